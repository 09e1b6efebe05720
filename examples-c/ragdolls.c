/* Ragdolls that tumble down a slope across the borders of four regions. A ragdoll is bodies tied by joints with limits; one
 * region at a time computes it whole.
 *
 *   ragdolls [COUNT [SECONDS]] */
#include "dcd.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { TORSO, HEAD, UPPER_ARM_L, LOWER_ARM_L, UPPER_ARM_R, LOWER_ARM_R, UPPER_LEG_L, LOWER_LEG_L, UPPER_LEG_R, LOWER_LEG_R,
       PARTS };

/* A part of a standing ragdoll: a capsule, and where a joint ties it to which other part. */
static const struct Part {
    float half_height, radius;
    double at[3];    /* its middle, metres above the ground */
    int parent;      /* -1: none */
    double joint[3]; /* where the two parts meet */
    float bend;      /* how far it turns, radians */
} PART[PARTS] = {
    [TORSO] = { 0.20f, 0.15f, { 0.0, 1.15, 0.0 }, -1, { 0.0, 0.0, 0.0 }, 0.0f },
    [HEAD] = { 0.05f, 0.11f, { 0.0, 1.65, 0.0 }, TORSO, { 0.0, 1.50, 0.0 }, 0.6f },
    [UPPER_ARM_L] = { 0.10f, 0.06f, { -0.24, 1.27, 0.0 }, TORSO, { -0.22, 1.42, 0.0 }, 1.5f },
    [LOWER_ARM_L] = { 0.10f, 0.05f, { -0.24, 0.95, 0.0 }, UPPER_ARM_L, { -0.24, 1.11, 0.0 }, 1.2f },
    [UPPER_ARM_R] = { 0.10f, 0.06f, { 0.24, 1.27, 0.0 }, TORSO, { 0.22, 1.42, 0.0 }, 1.5f },
    [LOWER_ARM_R] = { 0.10f, 0.05f, { 0.24, 0.95, 0.0 }, UPPER_ARM_R, { 0.24, 1.11, 0.0 }, 1.2f },
    [UPPER_LEG_L] = { 0.13f, 0.08f, { -0.10, 0.62, 0.0 }, TORSO, { -0.10, 0.82, 0.0 }, 1.0f },
    [LOWER_LEG_L] = { 0.13f, 0.06f, { -0.10, 0.22, 0.0 }, UPPER_LEG_L, { -0.10, 0.42, 0.0 }, 1.0f },
    [UPPER_LEG_R] = { 0.13f, 0.08f, { 0.10, 0.62, 0.0 }, TORSO, { 0.10, 0.82, 0.0 }, 1.0f },
    [LOWER_LEG_R] = { 0.13f, 0.06f, { 0.10, 0.22, 0.0 }, UPPER_LEG_R, { 0.10, 0.42, 0.0 }, 1.0f },
};

struct Ragdoll {
    DcdBodyId parts[PARTS];
};

static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[512];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

/* The slope: 40 m by 40 m, 20 degrees down along x, its middle at the origin, where all four regions meet. */
static void add_slope(DcdWorld world)
{
    const float half[3] = { 20.0f, 0.5f, 20.0f };
    const float turn = -0.3490659f;
    DcdBodyDef slope = DCD_BODY_DEF_INIT;
    DcdBodyId id;
    check(dcd_shape_box(world, half, &slope.shape));
    slope.body_type = DCD_FIXED;
    slope.friction = 0.2f;
    slope.pose.q[2] = sinf(turn / 2.0f);
    slope.pose.q[3] = cosf(turn / 2.0f);
    check(dcd_body_create(world, &slope, &id));
}

static struct Ragdoll add_ragdoll(DcdWorld world, const DcdShapeId shapes[PARTS], const double feet[3], uint64_t number)
{
    struct Ragdoll doll;
    DcdBodyDef defs[PARTS];
    for (int i = 0; i < PARTS; i++) {
        DcdBodyDef def = DCD_BODY_DEF_INIT;
        def.shape = shapes[i];
        def.angular_damping = 0.5f;
        def.user_data = number;
        for (int axis = 0; axis < 3; axis++) {
            def.pose.p[axis] = feet[axis] + PART[i].at[axis];
        }
        defs[i] = def;
    }
    check(dcd_bodies_create(world, defs, PARTS, doll.parts));
    for (int i = 0; i < PARTS; i++) {
        const int parent = PART[i].parent;
        if (parent < 0) {
            continue;
        }
        DcdJointDef joint = DCD_JOINT_DEF_INIT;
        DcdJointId id;
        joint.joint_type = DCD_JOINT_SPHERICAL;
        joint.a = doll.parts[parent];
        joint.b = doll.parts[i];
        joint.flags = DCD_JOINT_LIMIT;
        joint.limit[0] = -PART[i].bend;
        joint.limit[1] = PART[i].bend;
        for (int axis = 0; axis < 3; axis++) {
            joint.frame_a.p[axis] = (float)(PART[i].joint[axis] - PART[parent].at[axis]);
            joint.frame_b.p[axis] = (float)(PART[i].joint[axis] - PART[i].at[axis]);
        }
        check(dcd_joint_create(world, &joint, &id));
    }
    return doll;
}

/* Returns where a point of a body is: the body's pose applied to the point. */
static void place(const DcdPose *pose, const double local[3], double out[3])
{
    const double x = (double)pose->q[0], y = (double)pose->q[1], z = (double)pose->q[2], w = (double)pose->q[3];
    const double t[3] = { 2.0 * (y * local[2] - z * local[1]), 2.0 * (z * local[0] - x * local[2]),
                          2.0 * (x * local[1] - y * local[0]) };
    out[0] = pose->p[0] + local[0] + w * t[0] + y * t[2] - z * t[1];
    out[1] = pose->p[1] + local[1] + w * t[1] + z * t[0] - x * t[2];
    out[2] = pose->p[2] + local[2] + w * t[2] + x * t[1] - y * t[0];
}

/* Returns how far the two ends of a ragdoll's worst joint are apart. */
static double worst_gap(DcdWorld world, const struct Ragdoll *doll)
{
    DcdPose poses[PARTS];
    double worst = 0.0;
    check(dcd_state_read(world, doll->parts, PARTS, DCD_FIELD_POSE, poses, 0, NULL));
    for (int i = 0; i < PARTS; i++) {
        const int parent = PART[i].parent;
        if (parent < 0) {
            continue;
        }
        double ends[2][3], local[2][3], gap = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            local[0][axis] = PART[i].joint[axis] - PART[parent].at[axis];
            local[1][axis] = PART[i].joint[axis] - PART[i].at[axis];
        }
        place(&poses[parent], local[0], ends[0]);
        place(&poses[i], local[1], ends[1]);
        for (int axis = 0; axis < 3; axis++) {
            gap += (ends[0][axis] - ends[1][axis]) * (ends[0][axis] - ends[1][axis]);
        }
        worst = sqrt(gap) > worst ? sqrt(gap) : worst;
    }
    return worst;
}

int main(int argc, char **argv)
{
    const long count = argc > 1 ? strtol(argv[1], NULL, 10) : 16;
    const double seconds = argc > 2 ? strtod(argv[2], NULL) : 5.0;
    if (count < 1 || count > 1000 || !(seconds > 0.0)) {
        fprintf(stderr, "usage: ragdolls [COUNT [SECONDS]]\n");
        return EXIT_FAILURE;
    }
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.regions = 4;
    def.min[1] = -16.0; /* lower than wide, so that dcd cuts it along x and z */
    def.max[1] = 16.0;
    check(dcd_world_create(&def, &world));
    add_slope(world);

    DcdShapeId shapes[PARTS];
    for (int i = 0; i < PARTS; i++) {
        check(dcd_shape_capsule(world, PART[i].half_height, PART[i].radius, &shapes[i]));
    }
    struct Ragdoll *dolls = calloc((size_t)count, sizeof *dolls);
    if (dolls == NULL) {
        return EXIT_FAILURE;
    }
    for (long i = 0; i < count; i++) { /* in rows of four, uphill of the border at x = 0 and on both sides of the one at z = 0 */
        const double row = (double)(i / 4), column = (double)(i % 4);
        const double feet[3] = { -2.0 - 3.0 * row, 2.0 + 1.1 * row, 2.5 * column - 3.75 };
        dolls[i] = add_ragdoll(world, shapes, feet, (uint64_t)i);
    }

    unsigned long transfers = 0;
    double gap = 0.0;
    const long steps = lround(seconds / (double)def.dt);
    for (long step = 0; step < steps; step++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        check(dcd_step(world));
        check(dcd_events(world, &events));
        transfers += (unsigned long)events.transfer_count;
        for (long i = 0; i < count; i++) {
            const double worst = worst_gap(world, &dolls[i]);
            gap = worst > gap ? worst : gap;
        }
    }

    long over = 0;
    for (long i = 0; i < count; i++) {
        DcdPose torso;
        check(dcd_body_get(world, dolls[i].parts[TORSO], &torso, NULL));
        over += torso.p[0] > 0.0 ? 1 : 0;
    }
    printf("%ld ragdolls, %ld over the border, %lu transfers of parts, widest gap of a joint %.1f mm\n", count, over,
           transfers, gap * 1000.0);
    free(dolls);
    check(dcd_world_destroy(world));
    return EXIT_SUCCESS;
}
