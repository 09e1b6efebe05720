/* Many bodies: made in bulk, stepped, and read in all three ways, with the time of each.
 *
 *   stress [BODIES [STEPS [REGIONS]]]
 *
 * Without arguments 100,000 balls rain on a plain, in one region per core. */
#define _POSIX_C_SOURCE 200809L /* clock_gettime, sysconf */

#include "dcd.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { LAYERS = 4 };

static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[512];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + (double)time.tv_nsec * 1e-9;
}

static void *allocate(size_t count, size_t size)
{
    void *memory = calloc(count, size);
    if (memory == NULL) {
        fprintf(stderr, "stress: no memory\n");
        exit(EXIT_FAILURE);
    }
    return memory;
}

static unsigned long argument(int argc, char **argv, int i, unsigned long otherwise)
{
    if (i >= argc) {
        return otherwise;
    }
    char *end;
    unsigned long value = strtoul(argv[i], &end, 10);
    if (value == 0 || *end != '\0') {
        fprintf(stderr, "usage: stress [BODIES [STEPS [REGIONS]]]\n");
        exit(EXIT_FAILURE);
    }
    return value;
}

int main(int argc, char **argv)
{
    const size_t count = argument(argc, argv, 1, 100000);
    const size_t steps = argument(argc, argv, 2, 120);
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    const size_t regions = argument(argc, argv, 3, cores > 0 ? (unsigned long)cores : 1);

    /* Columns of balls, 1.5 m apart, on a square. The world is as wide as they are, so that the cuts go through them. */
    size_t side = 1;
    while (side * side * LAYERS < count) {
        side++;
    }
    const double half = 0.75 * (double)side;
    DcdWorldDef world_def = DCD_WORLD_DEF_INIT;
    world_def.regions = (uint32_t)regions;
    for (int axis = 0; axis < 3; axis++) {
        world_def.min[axis] = -half;
        world_def.max[axis] = half;
    }
    DcdWorld world;
    check(dcd_world_create(&world_def, &world));
    DcdBodyDef ground = DCD_BODY_DEF_INIT;
    const float ground_half[3] = { (float)half + 10.0f, 0.5f, (float)half + 10.0f };
    DcdBodyId id;
    check(dcd_shape_box(world, ground_half, &ground.shape));
    ground.body_type = DCD_FIXED;
    ground.pose.p[1] = -0.5;
    check(dcd_body_create(world, &ground, &id));

    DcdBodyDef *defs = allocate(count, sizeof *defs);
    DcdBodyId *ids = allocate(count, sizeof *ids);
    DcdShapeId ball;
    check(dcd_shape_sphere(world, 0.25f, &ball));
    for (size_t i = 0; i < count; i++) {
        const size_t column = i / LAYERS;
        DcdBodyDef def = DCD_BODY_DEF_INIT;
        def.shape = ball;
        def.pose.p[0] = 1.5 * ((double)(column % side) + 0.5) - half;
        def.pose.p[1] = 0.5 + 0.75 * (double)(i % LAYERS);
        def.pose.p[2] = 1.5 * ((double)(column / side) + 0.5) - half; /* NOLINT: whole rows are meant */
        def.velocity.linear[0] = (float)(i % 7) - 3.0f;
        def.user_data = i;
        defs[i] = def;
    }
    double start = now();
    check(dcd_bodies_create(world, defs, count, ids));
    printf("made     %8.0f ns a body\n", (now() - start) * 1e9 / (double)count);

    DcdStateView view = DCD_STATE_VIEW_INIT;
    check(dcd_state_view(world, &view)); /* from here on every step fills the view */
    double whole = 0.0, longest = 0.0;
    for (size_t i = 0; i < steps; i++) {
        start = now();
        check(dcd_step(world));
        const double step = now() - start;
        whole += step;
        if (isatty(STDERR_FILENO)) {
            fprintf(stderr, "\rstep %zu of %zu%s", i + 1, steps, i + 1 < steps ? "" : "\r\033[K");
        }
        longest = step > longest ? step : longest;
    }
    printf("stepped  %8.2f ms a step of %zu bodies in %zu regions, %.2f ms at most\n", whole * 1e3 / (double)steps, count,
           regions, longest * 1e3);

    /* 1. All of them in place, without copying. */
    double highest = 0.0;
    start = now();
    check(dcd_state_view(world, &view));
    for (size_t i = 0; i < view.count; i++) {
        highest = view.poses[i].p[1] > highest ? view.poses[i].p[1] : highest;
    }
    printf("viewed   %8.2f ns a body\n", (now() - start) * 1e9 / (double)view.count);

    /* 2. Those that the program names, copied into its own memory. */
    DcdPose *poses = allocate(count, sizeof *poses);
    start = now();
    check(dcd_state_read(world, ids, count, DCD_FIELD_POSE, poses, 0, NULL));
    printf("copied   %8.2f ns a body\n", (now() - start) * 1e9 / (double)count);

    /* 3. One by one. */
    start = now();
    for (size_t i = 0; i < count; i++) {
        check(dcd_body_get(world, ids[i], &poses[i], NULL));
    }
    printf("got      %8.2f ns a body\n", (now() - start) * 1e9 / (double)count);

    DcdStats stats = DCD_STATS_INIT;
    check(dcd_stats(world, &stats));
    check(dcd_world_destroy(world));
    printf("%" PRIu64 " bodies after %" PRIu64 " steps, %" PRIu64 " transfers, the highest at %.2f m\n", stats.bodies,
           stats.ticks, stats.transfers, highest);
    free(poses);
    free(ids);
    free(defs);
    return EXIT_SUCCESS;
}
