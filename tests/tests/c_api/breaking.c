/* A chain across the border of two regions is loaded until its weakest joint is reported and breaks. A weld is twisted until torque
 * alone is too much. */
#include "checks.h"

#include <math.h>

static DcdBodyId ball_at(DcdWorld world, DcdShapeId shape, DcdBodyType type, double y, float mass)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId ball = { 0 };
    def.body_type = type;
    def.shape = shape;
    def.mass = mass;
    def.pose.p[0] = 0.1;
    def.pose.p[1] = y;
    OK(dcd_body_create(world, &def, &ball));
    return ball;
}

static DcdJointId tied(DcdWorld world, DcdBodyId above, DcdBodyId below, uint64_t user_data)
{
    DcdJointDef def = DCD_JOINT_DEF_INIT;
    DcdJointId joint = { 0 };
    def.joint_type = DCD_JOINT_SPHERICAL;
    def.a = above;
    def.b = below;
    def.frame_a.p[1] = -0.5f;
    def.frame_b.p[1] = 0.5f;
    def.user_data = user_data;
    OK(dcd_joint_create(world, &def, &joint));
    return joint;
}

/* Steps, and returns the first overloaded joint that is reported, or none. */
static DcdJointOverload told_in(DcdWorld world, int steps)
{
    DcdJointOverload none = { { 0 }, 0, 0.0f, 0.0f };
    for (int i = 0; i < steps; i++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_step(world));
        OK(dcd_events(world, &events));
        HOLDS((events.overloads == NULL) == (events.overload_count == 0));
        if (events.overload_count > 0)
            return events.overloads[0];
    }
    return none;
}

static void chain(uint32_t regions)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    DcdShapeId shape;
    def.regions = regions;
    OK(dcd_world_create(&def, &world));
    OK(dcd_shape_sphere(world, 0.3f, &shape));
    const DcdBodyId nail = ball_at(world, shape, DCD_FIXED, 10.0, 0.0f);
    const DcdBodyId upper = ball_at(world, shape, DCD_DYNAMIC, 9.0, 100.0f);
    const DcdBodyId lower = ball_at(world, shape, DCD_DYNAMIC, 8.0, 100.0f);
    const DcdJointId top = tied(world, nail, upper, 1), bottom = tied(world, upper, lower, 2);

    /* The upper joint bears both balls: 1962 N. */
    OK(dcd_joint_set_strength(world, top, 2500.0f, INFINITY));
    OK(dcd_joint_set_strength(world, bottom, 1300.0f, INFINITY));
    HOLDS(told_in(world, 60).joint.v == 0);
    /* A load of another 100 kg below. */
    const DcdBodyId load = ball_at(world, shape, DCD_DYNAMIC, 7.0, 100.0f);
    tied(world, lower, load, 3);
    DcdJointOverload weak = told_in(world, 60);
    HOLDS(weak.joint.v != 0 && weak.torque >= 0.0f);
    for (int i = 0; i < 60; i++)
        OK(dcd_step(world));
    OK(dcd_joint_set_strength(world, bottom, INFINITY, INFINITY));
    weak = told_in(world, 1);
    HOLDS(weak.joint.v == top.v && weak.user_data == 1 && fabs(weak.force - 2943.0) < 60.0);
    OK(dcd_joint_destroy(world, top));
    HOLDS(told_in(world, 30).joint.v == 0);
    DcdVelocity velocity;
    OK(dcd_body_get(world, upper, NULL, &velocity));
    HOLDS(velocity.linear[1] < -4.0f);

    FAILS(dcd_joint_set_strength(world, top, 1.0f, 1.0f), DCD_ERR_STALE_ID, "joint");
    FAILS(dcd_joint_set_strength(world, (DcdJointId){ 0 }, 1.0f, 1.0f), DCD_ERR_NULL, "joint");
    FAILS(dcd_joint_set_strength(world, bottom, -1.0f, 1.0f), DCD_ERR_ARGUMENT, "force");
    FAILS(dcd_joint_set_strength(world, bottom, 1.0f, NAN), DCD_ERR_ARGUMENT, "torque");
    OK(dcd_world_destroy(world));
    FAILS(dcd_joint_set_strength(world, bottom, 1.0f, 1.0f), DCD_ERR_STALE_ID, "world");
}

/* A ball of 50 kg is welded to a wall and twisted by 1,000 N m: its joint bears 491 N and that torque. */
static void weld(uint32_t regions)
{
    const float twist[3] = { 600.0f, 0.0f, 800.0f };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdJointDef fixed = DCD_JOINT_DEF_INIT;
    DcdWorld world;
    DcdShapeId shape;
    DcdJointId joint;
    DcdJointOverload told;
    def.regions = regions;
    OK(dcd_world_create(&def, &world));
    OK(dcd_shape_sphere(world, 0.3f, &shape));
    fixed.a = ball_at(world, shape, DCD_FIXED, 10.0, 0.0f);
    fixed.b = ball_at(world, shape, DCD_DYNAMIC, 11.0, 50.0f);
    fixed.joint_type = DCD_JOINT_FIXED;
    fixed.frame_a.p[1] = 1.0f; /* the joint is at the centre of mass of the ball */
    fixed.user_data = 4;
    OK(dcd_joint_create(world, &fixed, &joint));
    OK(dcd_body_set_force(world, fixed.b, NULL, twist));
    for (int i = 0; i < 60; i++)
        OK(dcd_step(world));
    OK(dcd_joint_set_strength(world, joint, 600.0f, 1100.0f));
    HOLDS(told_in(world, 30).joint.v == 0);
    OK(dcd_joint_set_strength(world, joint, 600.0f, 900.0f)); /* the torque alone is too much */
    told = told_in(world, 1);
    HOLDS(told.joint.v == joint.v && told.user_data == 4);
    HOLDS(fabs(told.torque - 1000.0) < 20.0 && fabs(told.force - 490.5) < 10.0);
    OK(dcd_joint_set_strength(world, joint, 400.0f, 1100.0f)); /* the force alone */
    HOLDS(told_in(world, 1).joint.v == joint.v);
    OK(dcd_world_destroy(world));
}

int main(void)
{
    chain(1);
    chain(2);
    weld(1);
    weld(2);
    return checked();
}
