/* A local world of two regions: a stack of boxes falls onto the border between them and comes to rest.
 *
 * Build it with `make` or CMake in this folder; run it without arguments. */
#include "dcd.h"

#include <stdio.h>
#include <stdlib.h>

enum { BOXES = 5, STEPS = 240 };

/* Ends the program with the library's own message when a call failed. */
static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[512];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

int main(void)
{
    if (dcd_version_check() != DCD_OK) {
        fprintf(stderr, "compiled for dcd %u.%u, runs with %s\n", DCD_VERSION_MAJOR, DCD_VERSION_MINOR,
                dcd_version_string());
        return EXIT_FAILURE;
    }

    DcdWorldDef world_def = DCD_WORLD_DEF_INIT;
    world_def.regions = 2; /* halves of the world, left and right of x = 0 */
    DcdWorld world;
    check(dcd_world_create(&world_def, &world));

    const float ground_half[3] = { 20.0f, 0.5f, 20.0f };
    const float box_half[3] = { 0.5f, 0.5f, 0.5f };
    DcdShapeId ground_shape, box_shape;
    check(dcd_shape_box(world, ground_half, &ground_shape));
    check(dcd_shape_box(world, box_half, &box_shape));

    DcdBodyDef ground = DCD_BODY_DEF_INIT;
    ground.body_type = DCD_FIXED;
    ground.shape = ground_shape;
    ground.pose.p[1] = -0.5; /* its upper face is at y = 0 */
    DcdBodyId ground_id;
    check(dcd_body_create(world, &ground, &ground_id));

    DcdBodyDef defs[BOXES];
    DcdBodyId boxes[BOXES];
    for (int i = 0; i < BOXES; i++) {
        DcdBodyDef def = DCD_BODY_DEF_INIT;
        def.shape = box_shape;
        def.pose.p[0] = i % 2 == 0 ? -0.1 : 0.1; /* every other box starts in the other region */
        def.pose.p[1] = 0.6 + 1.1 * i;
        def.user_data = (uint64_t)i;
        defs[i] = def;
    }
    check(dcd_bodies_create(world, defs, BOXES, boxes));

    for (int step = 0; step < STEPS; step++) {
        check(dcd_step(world));
    }

    for (int i = 0; i < BOXES; i++) {
        DcdPose pose;
        DcdBodyInfo info = DCD_BODY_INFO_INIT;
        check(dcd_body_get(world, boxes[i], &pose, NULL));
        check(dcd_body_info(world, boxes[i], &info));
        printf("box %d: y = %.2f m, %.0f kg, region %u%s\n", i, pose.p[1], (double)info.mass, info.region,
               info.sleeping ? ", asleep" : "");
    }

    char text[512];
    size_t needed;
    check(dcd_stats_text(world, text, sizeof text, &needed));
    fputs(text, stdout);

    check(dcd_world_destroy(world));
    return EXIT_SUCCESS;
}
