/* Measures what calls of the C API cost, as C sees them. It prints one figure per line: its name and its value.
 *
 *   calls read BODIES REPEATS          ns per body: through the view, from an array of one's own, by a list of ids,
 *                                      one by one; the first two after something else was read, and again at once
 *   calls step BODIES STEPS            ms per step of a pile, the median
 *   calls viewed BODIES STEPS          the same with the view. It needs a run of its own: the second world of a program
 *                                      steps some percent slower than its first, seen or not
 *   calls made BODIES ROUNDS           ns per box: to make it, for the first step after that, and to destroy it after
 *                                      that; each the least of so many rounds
 *   calls rays BODIES RAYS REGIONS THREADS
 *                                      ns per ray into such boxes, all rays in one call, and ns per ball that moves
 *                                      along such a ray; each the least of some calls
 *   calls rollback BODIES REPEATS THREADS
 *                                      ms to keep a pile by a checkpoint, to go back to it, and by which the next step,
 *                                      in which what was shared is copied, takes longer for either; medians
 *   calls game BODIES STEPS REGIONS PLANE
 *                                      ms of the CPU per step of a game, the mean; four regions are cut at
 *                                      x = z = PLANE
 *   calls connect SERVER TOKEN         ms until a client has the first state of a served world */
#define _POSIX_C_SOURCE 200809L

#include "dcd.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { WARM_UP = 30 };

static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[512];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s\n", message);
        exit(EXIT_FAILURE);
    }
}

static double now_ns(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec * 1e9 + (double)time.tv_nsec;
}

static void *allocate(size_t count, size_t size)
{
    void *memory = calloc(count, size);
    if (memory == NULL) {
        exit(EXIT_FAILURE);
    }
    return memory;
}

/* Takes a result, so that the compiler must believe that it is used. */
static volatile double sink;

/* Does with poses the least that a game would do. */
static void look_at(const DcdPose *poses, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        const DcdPose *pose = &poses[i];
        sum += pose->p[0] + pose->p[1] + pose->p[2] + (double)pose->q[3];
    }
    sink = sum;
}

/* The ways of reading, in turn. What is read between two reads of a kind pushes their data out of the caches. */
enum { LIST, VIEW, VIEW_AGAIN, GET, OWN, OWN_AGAIN, WAYS };
static const char *const WAY_NAMES[WAYS] = { "list", "view", "view_again", "get", "own", "own_again" };

/* Measures reads of bodies that fly freely: the cost of a read does not depend on what bodies do. */
static void reading(size_t count, size_t repeats)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.threads = 1;
    def.regions = 2;
    check(dcd_world_create(&def, &world));
    DcdBodyDef ball = DCD_BODY_DEF_INIT;
    DcdBodyId *ids = allocate(count, sizeof *ids);
    check(dcd_shape_sphere(world, 0.25f, &ball.shape));
    for (size_t i = 0; i < count; i++) {
        ball.pose.p[0] = (double)(i % 100) - 49.5;
        ball.pose.p[1] = (double)(i / 10000);
        ball.pose.p[2] = (double)(i / 100 % 100) - 49.5;
        check(dcd_body_create(world, &ball, &ids[i]));
    }
    DcdStateView view = DCD_STATE_VIEW_INIT;
    DcdPose *poses = allocate(count, sizeof *poses);
    check(dcd_state_view(world, &view));
    check(dcd_step(world));
    DcdPose *own = allocate(count, sizeof *own);
    check(dcd_state_read(world, ids, count, DCD_FIELD_POSE, own, 0, NULL));
    double best[WAYS];
    for (size_t repeat = 0; repeat < repeats; repeat++) {
        for (int way = 0; way < WAYS; way++) {
            const double start = now_ns();
            switch (way) {
            case LIST:
                check(dcd_state_read(world, ids, count, DCD_FIELD_POSE, poses, 0, NULL));
                break;
            case VIEW:
            case VIEW_AGAIN:
                check(dcd_state_view(world, &view));
                look_at(view.poses, view.count);
                break;
            case GET:
                for (size_t i = 0; i < count; i++) {
                    check(dcd_body_get(world, ids[i], &poses[i], NULL));
                }
                break;
            default:
                look_at(own, count);
                break;
            }
            const double time = (now_ns() - start) / (double)count;
            best[way] = repeat == 0 || time < best[way] ? time : best[way];
        }
    }
    for (int way = 0; way < WAYS; way++) {
        printf("%s_ns %.3f\n", WAY_NAMES[way], best[way]);
    }
    check(dcd_world_destroy(world));
    free(own);
    free(poses);
    free(ids);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median_step_ms(size_t bodies, size_t steps, bool viewed)
{
    char n[32];
    const char *params[1] = { n };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    double *times = allocate(steps, sizeof *times);
    snprintf(n, sizeof n, "n=%zu", bodies);
    def.regions = 1;
    def.threads = 1;
    check(dcd_world_open_scene("pile", params, 1, &def, &world));
    if (viewed) {
        check(dcd_state_view(world, &view));
    }
    for (size_t i = 0; i < WARM_UP + steps; i++) {
        const double start = now_ns();
        check(dcd_step(world));
        if (viewed) {
            check(dcd_state_view(world, &view));
        }
        if (i >= WARM_UP) {
            times[i - WARM_UP] = now_ns() - start;
        }
    }
    check(dcd_world_destroy(world));
    qsort(times, steps, sizeof *times, by_value);
    const double median = times[steps / 2] / 1e6;
    free(times);
    return median;
}

/* Makes a world for boxes that do not touch: the work of a step depends little on the number of steps before. */
static DcdWorld world_for_boxes(uint32_t regions, uint32_t threads, DcdBodyDef *box)
{
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.regions = regions;
    def.threads = threads;
    check(dcd_world_create(&def, &world));
    check(dcd_shape_box(world, half, &box->shape));
    return world;
}

/* Makes boxes in a grid, a metre and a half apart. */
static void make_boxes(DcdWorld world, DcdBodyDef *box, DcdBodyId *ids, size_t bodies)
{
    for (size_t i = 0; i < bodies; i++) {
        box->pose.p[0] = 1.5 * (double)(i % 50);
        box->pose.p[1] = 1.5 * (double)(i / 50 % 50);
        box->pose.p[2] = 1.5 * (double)(i / 2500);
        check(dcd_body_create(world, box, &ids[i]));
    }
}

/* Makes and destroys all boxes, `rounds` times. */
static void making(size_t bodies, size_t rounds)
{
    enum { MAKE, FIRST_STEP, DESTROY, PARTS };
    static const char *const names[PARTS] = { "make", "first_step", "destroy" };
    DcdBodyDef box = DCD_BODY_DEF_INIT;
    const DcdWorld world = world_for_boxes(1, 1, &box);
    DcdBodyId *ids = allocate(bodies, sizeof *ids);
    double best[PARTS];
    for (size_t round = 0; round < rounds; round++) {
        double times[PARTS + 1];
        times[MAKE] = now_ns();
        make_boxes(world, &box, ids, bodies);
        times[FIRST_STEP] = now_ns();
        check(dcd_step(world));
        times[DESTROY] = now_ns();
        for (size_t i = 0; i < bodies; i++) {
            check(dcd_body_destroy(world, ids[i]));
        }
        times[PARTS] = now_ns();
        check(dcd_step(world));
        for (int part = 0; part < PARTS; part++) {
            const double took = (times[part + 1] - times[part]) / (double)bodies;
            best[part] = round == 0 || took < best[part] ? took : best[part];
        }
    }
    check(dcd_world_destroy(world));
    free(ids);
    for (int part = 0; part < PARTS; part++) {
        printf("%s_ns %.1f\n", names[part], best[part]);
    }
}

/* Returns the i-th of numbers that are spread evenly over 0 to 1. */
static double spread(size_t i, double step)
{
    return fmod((double)i * step, 1.0);
}

/* Casts rays and balls into the boxes from one side. They meet a box after some metres. */
static void casting(size_t bodies, size_t count, uint32_t regions, uint32_t threads)
{
    enum { CALLS = 9 };
    DcdBodyDef box = DCD_BODY_DEF_INIT;
    const DcdWorld world = world_for_boxes(regions, threads, &box);
    DcdBodyId *ids = allocate(bodies, sizeof *ids);
    DcdRay *rays = allocate(count, sizeof *rays);
    DcdRayHit *hits = allocate(count, sizeof *hits);
    DcdShapeCast *casts = allocate(count, sizeof *casts);
    DcdShapeHit *touched = allocate(count, sizeof *touched);
    DcdShapeId ball;
    double best = 0.0, best_cast = 0.0, met = 0.0, came = 0.0;
    check(dcd_shape_sphere(world, 0.25f, &ball));
    box.gravity_scale = 0.0f;
    make_boxes(world, &box, ids, bodies);
    /* In the first steps Rapier puts the tree of new bodies in order. */
    for (int step = 0; step < WARM_UP; step++) {
        check(dcd_step(world));
    }
    for (size_t i = 0; i < count; i++) {
        const DcdRay ray = DCD_RAY_INIT;
        rays[i] = ray;
        rays[i].origin[0] = -2.0;
        rays[i].origin[1] = 75.0 * spread(i, 0.7548776662466927);
        rays[i].origin[2] = 12.0 * spread(i, 0.5698402909980532);
        rays[i].direction[0] = 1.0f;
        rays[i].direction[1] = (float)(spread(i, 0.6180339887498949) - 0.5);
        rays[i].direction[2] = (float)(spread(i, 0.4142135623730950) - 0.5);
        const DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
        casts[i] = cast;
        casts[i].shape = ball;
        for (int axis = 0; axis < 3; axis++) {
            casts[i].pose.p[axis] = rays[i].origin[axis];
            casts[i].motion[axis] = 100.0f * rays[i].direction[axis];
        }
    }
    for (int call = 0; call < CALLS; call++) {
        const double start = now_ns();
        check(dcd_cast_rays(world, rays, count, NULL, hits));
        const double took = (now_ns() - start) / (double)count;
        best = call == 0 || took < best ? took : best;
        const double begun = now_ns();
        check(dcd_cast_shapes(world, casts, count, NULL, touched));
        const double cast = (now_ns() - begun) / (double)count;
        best_cast = call == 0 || cast < best_cast ? cast : best_cast;
    }
    for (size_t i = 0; i < count; i++) {
        met += hits[i].body.v != 0 ? hits[i].distance : 0.0;
        came += touched[i].body.v != 0 ? touched[i].fraction : 0.0;
    }
    check(dcd_world_destroy(world));
    free(touched);
    free(casts);
    free(hits);
    free(rays);
    free(ids);
    printf("ray_ns %.1f\nmet_m %.3f\ncast_ns %.1f\ncame %.4f\n", best, met, best_cast, came);
}

/* Measures a game of rollback at its worst: everything moves, and each tick that is kept is computed once more. */
static void rolling_back(size_t bodies, size_t repeats, uint32_t threads)
{
    enum { PLAIN, SAVE, STEP_SAVED, RESTORE, STEP_RESTORED, PARTS };
    char n[32];
    const char *params[1] = { n };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    DcdCheckpointId checkpoint;
    double median[PARTS], *times[PARTS];
    snprintf(n, sizeof n, "n=%zu", bodies);
    def.regions = 1;
    def.threads = threads;
    check(dcd_world_open_scene("pile", params, 1, &def, &world));
    check(dcd_checkpoint_create(world, &checkpoint));
    for (size_t i = 0; i < WARM_UP; i++) {
        check(dcd_step(world));
    }
    for (int part = 0; part < PARTS; part++) {
        times[part] = allocate(repeats, sizeof **times);
    }
    for (size_t i = 0; i < repeats; i++) {
        for (int part = 0; part < PARTS; part++) {
            const double start = now_ns();
            if (part == SAVE) {
                check(dcd_checkpoint_save(world, checkpoint));
            } else if (part == RESTORE) {
                check(dcd_checkpoint_restore(world, checkpoint));
            } else {
                check(dcd_step(world));
            }
            times[part][i] = (now_ns() - start) / 1e6;
        }
    }
    for (int part = 0; part < PARTS; part++) {
        qsort(times[part], repeats, sizeof **times, by_value);
        median[part] = times[part][repeats / 2];
        free(times[part]);
    }
    check(dcd_world_destroy(world));
    printf("step_ms %.4f\n", median[PLAIN]);
    printf("save_ms %.4f\n", median[SAVE]);
    printf("copy_ms %.4f\n", median[STEP_SAVED] - median[PLAIN]);
    printf("restore_ms %.4f\n", median[RESTORE]);
    printf("copy_again_ms %.4f\n", median[STEP_RESTORED] - median[PLAIN]);
}

/* Makes the world of a game: groups of five on 90 m by 90 m of ground. A third of them are stacks that sleep, a third
 * are chains that fall, and a third are heaps of all shapes, each with a ball that somebody plays. A platform carries
 * some of them along. One row of groups along x and one along z lie at `plane` 20.25; none lies at 0. */
static DcdWorld game_world(size_t bodies, uint32_t regions, double plane, DcdBodyId *ids)
{
    enum { GROUP = 5, ROW = 20 };
    const float half_ground[3] = { 100.0f, 0.5f, 100.0f }, half_platform[3] = { 6.0f, 0.2f, 6.0f };
    const float half_box[3] = { 0.5f, 0.25f, 0.4f };
    const float corners[12] = { -0.4f, -0.3f, -0.4f, 0.4f, -0.3f, -0.4f, 0.0f, -0.3f, 0.5f, 0.0f, 0.5f, 0.0f };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef ground = DCD_BODY_DEF_INIT, platform = DCD_BODY_DEF_INIT;
    DcdWorld world;
    DcdShapeId shapes[GROUP];
    DcdBodyId id;
    def.regions = regions;
    def.threads = 1;
    for (int axis = 0; axis < 3; axis += 2) {
        def.min[axis] += plane;
        def.max[axis] += plane;
    }
    check(dcd_world_create(&def, &world));
    ground.body_type = DCD_FIXED;
    ground.pose.p[1] = -0.5;
    check(dcd_shape_box(world, half_ground, &ground.shape));
    check(dcd_body_create(world, &ground, &id));
    platform.body_type = DCD_KINEMATIC;
    platform.pose.p[0] = -50.0;
    platform.pose.p[1] = 5.0;
    platform.velocity.linear[0] = 4.0f;
    check(dcd_shape_box(world, half_platform, &platform.shape));
    check(dcd_body_create(world, &platform, &id));
    check(dcd_shape_box(world, half_box, &shapes[0]));
    check(dcd_shape_sphere(world, 0.35f, &shapes[1]));
    check(dcd_shape_capsule(world, 0.3f, 0.2f, &shapes[2]));
    check(dcd_shape_cylinder(world, 0.25f, 0.4f, &shapes[3]));
    check(dcd_shape_hull(world, corners, 4, &shapes[4]));
    for (size_t i = 0; i < bodies; i++) {
        const size_t group = i / GROUP, place = i % GROUP, kind = group % 3;
        DcdBodyDef body = DCD_BODY_DEF_INIT;
        body.pose.p[0] = 4.5 * (double)(group % ROW) - 42.75;
        body.pose.p[2] = 4.5 * (double)(group / ROW) - 42.75;
        if (kind == 0) {
            body.shape = shapes[0];
            body.pose.p[1] = 0.25 + 0.5 * (double)place;
            body.flags = DCD_BODY_ASLEEP;
        } else if (kind == 1) {
            body.shape = shapes[2];
            body.pose.p[1] = 1.0 + (double)place;
            body.velocity.linear[2] = 1.0f;
        } else {
            body.shape = shapes[place];
            body.pose.p[0] += 0.3 * (double)place - 0.6;
            body.pose.p[1] = 0.5 + (double)place + (group < 12 ? 5.0 : 0.0);
        }
        check(dcd_body_create(world, &body, &ids[i]));
        if (kind == 1 && place > 0) {
            DcdJointDef joint = DCD_JOINT_DEF_INIT;
            DcdJointId tied;
            joint.joint_type = DCD_JOINT_SPHERICAL;
            joint.a = ids[i - 1];
            joint.b = ids[i];
            joint.frame_a.p[1] = 0.5f;
            joint.frame_b.p[1] = -0.5f;
            check(dcd_joint_create(world, &joint, &tied));
        }
    }
    return world;
}

static void playing(size_t bodies, size_t steps, uint32_t regions, double plane)
{
    DcdBodyId *ids = allocate(bodies, sizeof *ids);
    const DcdWorld world = game_world(bodies, regions, plane, ids);
    const clock_t start = clock();
    for (size_t step = 0; step < steps; step++) {
        for (size_t i = 11; i < bodies && step % 30 == 0; i += 15) {
            const float along = step % 60 == 0 ? 4.0f : -4.0f, across = (float)(i % 7) - 3.0f;
            const DcdVelocity velocity = { { along, 0.0f, across }, { 0.0f, 0.0f, 0.0f } };
            check(dcd_body_set_velocity(world, ids[i], &velocity));
        }
        check(dcd_step(world));
    }
    printf("step_ms %.4f\n", 1e3 * (double)(clock() - start) / CLOCKS_PER_SEC / (double)steps);
    check(dcd_world_destroy(world));
    free(ids);
}

static void connecting(const char *server, const char *token)
{
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    DcdWorld world;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    def.server = server;
    def.token = token;
    const double start = now_ns();
    check(dcd_client_connect(&def, &world));
    check(dcd_state_view(world, &view));
    printf("connect_ms %.3f\n", (now_ns() - start) / 1e6);
    if (view.count == 0) {
        fprintf(stderr, "calls: the first state is empty\n");
        exit(EXIT_FAILURE);
    }
    check(dcd_world_destroy(world));
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "read") == 0) {
        reading(strtoul(argv[2], NULL, 10), strtoul(argv[3], NULL, 10));
    } else if (argc == 4 && (strcmp(argv[1], "step") == 0 || strcmp(argv[1], "viewed") == 0)) {
        const size_t bodies = strtoul(argv[2], NULL, 10), steps = strtoul(argv[3], NULL, 10);
        printf("step_ms %.6f\n", median_step_ms(bodies, steps, strcmp(argv[1], "viewed") == 0));
    } else if (argc == 4 && strcmp(argv[1], "made") == 0) {
        making(strtoul(argv[2], NULL, 10), strtoul(argv[3], NULL, 10));
    } else if (argc == 6 && strcmp(argv[1], "rays") == 0) {
        const uint32_t regions = (uint32_t)strtoul(argv[4], NULL, 10), threads = (uint32_t)strtoul(argv[5], NULL, 10);
        casting(strtoul(argv[2], NULL, 10), strtoul(argv[3], NULL, 10), regions, threads);
    } else if (argc == 5 && strcmp(argv[1], "rollback") == 0) {
        const uint32_t threads = (uint32_t)strtoul(argv[4], NULL, 10);
        rolling_back(strtoul(argv[2], NULL, 10), strtoul(argv[3], NULL, 10), threads);
    } else if (argc == 6 && strcmp(argv[1], "game") == 0) {
        const uint32_t regions = (uint32_t)strtoul(argv[4], NULL, 10);
        playing(strtoul(argv[2], NULL, 10), strtoul(argv[3], NULL, 10), regions, strtod(argv[5], NULL));
    } else if (argc == 4 && strcmp(argv[1], "connect") == 0) {
        connecting(argv[2], argv[3]);
    } else {
        fprintf(stderr, "usage: calls read|made|rollback BODIES REPEATS | step|viewed BODIES STEPS | rays BODIES RAYS REGIONS THREADS | game BODIES STEPS REGIONS PLANE | connect SERVER TOKEN\n");
        return EXIT_FAILURE;
    }
    return EXIT_SUCCESS;
}
