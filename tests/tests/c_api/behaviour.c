/* What the functions of the C API do when used as meant: each group in a small world of its own. */
#include "dcd.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static int checks, failures;

#define OK(call) holds((call) == DCD_OK, #call, __LINE__)
#define HOLDS(what) holds((what), #what, __LINE__)
#define NEAR(value, expected, by) near_to((double)(value), (double)(expected), (double)(by), #value, __LINE__)

static void holds(bool what, const char *text, int line)
{
    checks++;
    if (!what) {
        char message[256] = "";
        dcd_last_error(message, sizeof message);
        printf("line %d: not so: %s (last error: %s)\n", line, text, message);
        failures++;
    }
}

static void near_to(double value, double expected, double by, const char *text, int line)
{
    checks++;
    if (!(fabs(value - expected) <= by)) {
        printf("line %d: %s is %g, not %g\n", line, text, value, expected);
        failures++;
    }
}

static DcdWorld make_world(uint32_t regions, uint32_t threads, float gravity)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 0 };
    def.regions = regions;
    def.threads = threads;
    def.gravity[1] = gravity;
    OK(dcd_world_create(&def, &world));
    return world;
}

static DcdShapeId box(DcdWorld world, float x, float y, float z)
{
    const float half[3] = { x, y, z };
    DcdShapeId shape = { 0 };
    OK(dcd_shape_box(world, half, &shape));
    return shape;
}

/* A dynamic box of 1 m and 1000 kg. */
static DcdBodyDef crate(DcdWorld world, double x, double y)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    def.shape = box(world, 0.5f, 0.5f, 0.5f);
    def.pose.p[0] = x;
    def.pose.p[1] = y;
    return def;
}

static DcdBodyId add(DcdWorld world, DcdBodyDef def)
{
    DcdBodyId body = { 0 };
    OK(dcd_body_create(world, &def, &body));
    return body;
}

/* A floor whose face is at y = 0. */
static DcdBodyId add_floor(DcdWorld world)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    def.body_type = DCD_FIXED;
    def.shape = box(world, 50.0f, 0.5f, 50.0f);
    def.pose.p[1] = -0.5;
    def.user_data = 1000;
    return add(world, def);
}

static void steps(DcdWorld world, int count)
{
    for (int i = 0; i < count; i++) {
        OK(dcd_step(world));
    }
}

static DcdPose pose_of(DcdWorld world, DcdBodyId body)
{
    DcdPose pose = { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_get(world, body, &pose, NULL));
    return pose;
}

static DcdVelocity velocity_of(DcdWorld world, DcdBodyId body)
{
    DcdVelocity velocity = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_get(world, body, NULL, &velocity));
    return velocity;
}

static uint32_t region_of(DcdWorld world, DcdBodyId body)
{
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    OK(dcd_body_info(world, body, &info));
    return info.region;
}

static void members_of_a_body_count(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef def = crate(world, 0.0, 100.0);
    add_floor(world);
    def.pose.p[0] = -10.0;
    DcdBodyId falling = add(world, def);
    def.pose.p[0] = -8.0;
    def.gravity_scale = 0.0f;
    DcdBodyId floating = add(world, def);
    def.gravity_scale = 1.0f;
    def.pose.p[0] = -6.0;
    def.locked = DCD_LOCK_Y | DCD_LOCK_TURN_Z;
    DcdBodyId hanging = add(world, def);
    def.locked = 0;
    def.pose.p[0] = -4.0;
    def.linear_damping = 5.0f;
    DcdBodyId slow = add(world, def);
    def.linear_damping = 0.0f;
    def.pose.p[0] = -2.0;
    def.flags = DCD_BODY_ASLEEP;
    DcdBodyId asleep = add(world, def);
    def.flags = 0;
    def.pose.p[0] = 2.0;
    def.pose.p[1] = 2.0;
    def.mask = 2; /* the floor belongs to all groups, this one meets group 2 only and belongs to group 1 */
    def.groups = 1;
    DcdBodyId rests = add(world, def);
    def.pose.p[0] = 4.0;
    def.mask = 0;
    DcdBodyId passes = add(world, def);
    def = crate(world, 0.0, 50.0);
    def.body_type = DCD_KINEMATIC;
    def.velocity.linear[0] = 3.0f;
    DcdBodyId lift = add(world, def);

    steps(world, 60);
    NEAR(pose_of(world, falling).p[1], 95.0, 0.1);
    NEAR(velocity_of(world, falling).linear[1], -10.0, 0.01);
    NEAR(pose_of(world, floating).p[1], 100.0, 1e-6);
    NEAR(pose_of(world, hanging).p[1], 100.0, 1e-6);
    HOLDS(pose_of(world, slow).p[1] > 98.0);
    NEAR(pose_of(world, asleep).p[1], 100.0, 0.0);
    NEAR(pose_of(world, rests).p[1], 0.5, 0.02);
    HOLDS(pose_of(world, passes).p[1] < -2.0);
    NEAR(pose_of(world, lift).p[0], 3.0, 1e-3);

    OK(dcd_body_wake(world, asleep));
    steps(world, 10);
    HOLDS(pose_of(world, asleep).p[1] < 99.9);
    OK(dcd_world_destroy(world));
}

static void pushes_push(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef def = crate(world, -3.0, 20.0);
    DcdBodyId body = add(world, def), thrust;
    const float push[3] = { 2000.0f, 0.0f, 0.0f }, lift[3] = { 0.0f, 10000.0f, 0.0f };
    const double above[3] = { -3.0, 20.5, 0.0 };

    OK(dcd_body_apply_impulse(world, body, push, NULL));
    NEAR(velocity_of(world, body).linear[0], 2.0, 1e-4);
    NEAR(velocity_of(world, body).angular[2], 0.0, 1e-6);
    OK(dcd_body_apply_impulse(world, body, push, above));
    NEAR(velocity_of(world, body).linear[0], 4.0, 1e-4);
    /* torque -0.5 m * 2000 N s on 1000/6 kg m² */
    NEAR(velocity_of(world, body).angular[2], -6.0, 0.05);
    OK(dcd_body_apply_torque_impulse(world, body, push));
    HOLDS(velocity_of(world, body).angular[0] > 1.0f);

    def.pose.p[0] = 3.0;
    thrust = add(world, def);
    OK(dcd_body_set_force(world, thrust, lift, NULL)); /* its weight, upwards */
    steps(world, 30);
    NEAR(pose_of(world, thrust).p[1], 20.0, 1e-3);
    OK(dcd_body_set_force(world, thrust, NULL, NULL));
    steps(world, 30);
    HOLDS(pose_of(world, thrust).p[1] < 19.0);

    def.pose.p[1] = 30.0;
    OK(dcd_body_set_pose(world, thrust, &def.pose));
    OK(dcd_body_set_velocity(world, thrust, &def.velocity));
    NEAR(pose_of(world, thrust).p[1], 30.0, 0.0);
    NEAR(velocity_of(world, thrust).linear[1], 0.0, 0.0);
    OK(dcd_world_destroy(world));
}

/* Steps until a contact of this kind is told of; gives it back, or one of kind 99. */
static DcdContact next_contact(DcdWorld world, uint32_t kind)
{
    DcdContact none = { { 0 }, { 0 }, 0, 0, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 0.0f, 99, 0, 0, 0 };
    for (int i = 0; i < 240; i++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_step(world));
        OK(dcd_events(world, &events));
        for (size_t k = 0; k < events.contact_count; k++) {
            if (events.contacts[k].kind == kind) {
                return events.contacts[k];
            }
        }
    }
    return none;
}

static void events_tell(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef def = crate(world, 0.0, 1.5);
    DcdBodyId ground = add_floor(world), body;
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    def.events = DCD_EVENT_CONTACT | DCD_EVENT_FORCE;
    def.force_threshold = 5000.0f;
    def.user_data = UINT64_MAX - 1;
    body = add(world, def);

    OK(dcd_events(world, &events));
    HOLDS(events.contact_count == 0 && events.contacts == NULL && events.tick == 0);
    DcdContact contact = next_contact(world, DCD_CONTACT_BEGAN);
    HOLDS(contact.a.v == ground.v && contact.b.v == body.v);
    HOLDS(contact.user_a == 1000 && contact.user_b == UINT64_MAX - 1);
    HOLDS(contact.flags == 0);
    NEAR(contact.point[1], 0.0, 0.1);
    NEAR(contact.normal[1], 1.0, 1e-3);

    steps(world, 20); /* it lies and is not asleep yet */
    OK(dcd_events(world, &events));
    HOLDS(events.force_count == 1);
    if (events.force_count == 1) {
        NEAR(events.forces[0].magnitude, 10000.0, 500.0); /* its weight */
        NEAR(events.forces[0].force[1], 10000.0, 500.0);
        HOLDS(events.forces[0].user_b == UINT64_MAX - 1);
    }

    OK(dcd_body_destroy(world, body));
    contact = next_contact(world, DCD_CONTACT_ENDED);
    HOLDS(contact.b.v == body.v && contact.user_b == UINT64_MAX - 1 && contact.user_a == 1000);

    def.flags = DCD_BODY_SENSOR;
    def.body_type = DCD_FIXED;
    def.pose.p[1] = 5.0;
    DcdBodyId gate = add(world, def);
    def = crate(world, 0.0, 9.0);
    body = add(world, def);
    contact = next_contact(world, DCD_CONTACT_BEGAN);
    HOLDS(contact.a.v == gate.v && contact.b.v == body.v && contact.flags == DCD_CONTACT_SENSOR);
    contact = next_contact(world, DCD_CONTACT_ENDED);
    HOLDS(contact.a.v == gate.v && contact.b.v == body.v);
    OK(dcd_world_destroy(world));
}

static void a_transfer_is_told_once(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyDef def = crate(world, -1.0, 0.0);
    unsigned told = 0;
    def.velocity.linear[0] = 2.0f;
    def.user_data = 5;
    DcdBodyId body = add(world, def);
    uint32_t first = region_of(world, body);
    for (int i = 0; i < 60; i++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_step(world));
        OK(dcd_events(world, &events));
        for (size_t k = 0; k < events.transfer_count; k++, told++) {
            HOLDS(events.transfers[k].body.v == body.v && events.transfers[k].user_data == 5);
            HOLDS(events.transfers[k].from == first && events.transfers[k].to == region_of(world, body));
        }
    }
    HOLDS(told == 1);
    NEAR(pose_of(world, body).p[0], 1.0, 1e-3);

    DcdRegionInfo regions[2];
    size_t count = 0;
    OK(dcd_regions(world, regions, 2, &count));
    for (size_t i = 0; i < count; i++) {
        HOLDS(regions[i].bodies == (regions[i].region == region_of(world, body) ? 1u : 0u));
    }
    OK(dcd_world_destroy(world));
}

/* What DcdBodyDef says can be changed later, of the bodies of scenes too. */
static void surfaces_can_be_changed(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyId ground = add_floor(world);
    DcdBodyDef def = crate(world, -10.0, 0.5);
    def.velocity.linear[0] = 5.0f;
    DcdBodyId slides = add(world, def);
    def.pose.p[0] = 10.0;
    DcdBodyId stops = add(world, def);
    def.velocity.linear[0] = 0.0f;
    def.pose.p[2] = 10.0;
    DcdBodyId falls = add(world, def);
    OK(dcd_body_set_material(world, ground, 0, 0.0f, 0.0f));
    OK(dcd_body_set_material(world, slides, DCD_ALL_PARTS, 0.0f, 0.0f));
    OK(dcd_body_set_material(world, stops, DCD_ALL_PARTS, 1.0f, 0.0f));
    OK(dcd_body_set_groups(world, falls, 0, 1, 0));
    steps(world, 120);
    NEAR(velocity_of(world, slides).linear[0], 5.0, 0.01);
    NEAR(velocity_of(world, stops).linear[0], 0.0, 0.01);
    HOLDS(pose_of(world, falls).p[1] < -10.0);
    OK(dcd_world_destroy(world));

    OK(dcd_world_open_scene("tower", NULL, 0, NULL, &world));
    DcdBodyId box = { 0 };
    OK(dcd_body_at(world, 1, &box));
    OK(dcd_body_set_events(world, box, 0, DCD_EVENT_CONTACT | DCD_EVENT_FORCE, 0.0f));
    OK(dcd_step(world));
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    OK(dcd_events(world, &events));
    HOLDS(events.contact_count > 0 && events.force_count > 0 && events.change_count == 0 && events.flags == 0);
    for (size_t i = 0; i < events.contact_count; i++) {
        HOLDS(events.contacts[i].a.v == box.v || events.contacts[i].b.v == box.v);
    }
    OK(dcd_world_destroy(world));
}

/* A post at the origin and a crate beside it, tied at the post. */
static DcdJointDef tied(DcdWorld world, DcdJointType type)
{
    DcdJointDef joint = DCD_JOINT_DEF_INIT;
    DcdBodyDef def = crate(world, 0.0, 0.0);
    def.body_type = DCD_FIXED;
    joint.a = add(world, def);
    def.body_type = DCD_DYNAMIC;
    def.pose.p[0] = 2.0;
    joint.b = add(world, def);
    joint.joint_type = type;
    joint.frame_b.p[0] = -2.0f;
    return joint;
}

static DcdJointInfo joint_info(DcdWorld world, DcdJointId joint)
{
    DcdJointInfo info = DCD_JOINT_INFO_INIT;
    OK(dcd_joint_info(world, joint, &info));
    return info;
}

static void joints_hold(void)
{
    DcdJointId id;

    DcdWorld world = make_world(2, 1, -10.0f);
    DcdJointDef joint = tied(world, DCD_JOINT_FIXED);
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 60);
    NEAR(pose_of(world, joint.b).p[1], 0.0, 0.05);
    OK(dcd_joint_destroy(world, id));
    steps(world, 60);
    HOLDS(pose_of(world, joint.b).p[1] < -3.0);
    OK(dcd_world_destroy(world));

    /* About x, where the crate lies: it spins on the spot at the motor's speed, until the motor stops. */
    world = make_world(2, 1, 0.0f);
    joint = tied(world, DCD_JOINT_REVOLUTE);
    joint.flags = DCD_JOINT_MOTOR;
    joint.motor.velocity = 2.0f;
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 60);
    NEAR(velocity_of(world, joint.b).angular[0], 2.0, 0.05);
    NEAR(pose_of(world, joint.b).p[0], 2.0, 0.02);
    joint.motor.velocity = -1.0f;
    OK(dcd_joint_set_motor(world, id, DCD_AXIS_TURN_X, &joint.motor));
    steps(world, 60);
    NEAR(velocity_of(world, joint.b).angular[0], -1.0, 0.05);
    OK(dcd_joint_set_motor(world, id, DCD_AXIS_TURN_X, NULL));
    steps(world, 60);
    NEAR(velocity_of(world, joint.b).angular[0], -1.0, 0.05); /* nothing brakes it */
    OK(dcd_world_destroy(world));

    /* Along x, pushed by a motor against the limit, which is moved and taken away. */
    world = make_world(2, 1, 0.0f);
    joint = tied(world, DCD_JOINT_PRISMATIC);
    joint.flags = DCD_JOINT_MOTOR | DCD_JOINT_LIMIT;
    joint.limit[0] = -0.5f;
    joint.limit[1] = 0.75f;
    joint.motor.velocity = 1.0f;
    joint.motor.max_force = 1000.0f;
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 180);
    NEAR(pose_of(world, joint.b).p[0], 2.75, 0.02);
    const float wider[2] = { -INFINITY, 1.5f };
    float limit[2] = { 0.0f, 0.0f };
    OK(dcd_joint_set_limit(world, id, DCD_AXIS_X, wider));
    OK(dcd_joint_get_limit(world, id, DCD_AXIS_X, limit));
    HOLDS(limit[0] == -INFINITY && limit[1] == 1.5f);
    steps(world, 180);
    NEAR(pose_of(world, joint.b).p[0], 3.5, 0.02);
    NEAR(joint_info(world, id).position, 1.5, 0.02);
    OK(dcd_joint_set_limit(world, id, DCD_AXIS_X, NULL));
    OK(dcd_joint_get_limit(world, id, DCD_AXIS_X, limit));
    HOLDS(limit[0] == -INFINITY && limit[1] == INFINITY);
    steps(world, 120);
    HOLDS(pose_of(world, joint.b).p[0] > 4.5);
    OK(dcd_world_destroy(world));

    /* A pendulum: it keeps its distance and comes down. */
    world = make_world(2, 1, -10.0f);
    joint = tied(world, DCD_JOINT_SPHERICAL);
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 40);
    DcdPose pose = pose_of(world, joint.b);
    NEAR(sqrt(pose.p[0] * pose.p[0] + pose.p[1] * pose.p[1] + pose.p[2] * pose.p[2]), 2.0, 0.02);
    HOLDS(pose.p[1] < -1.0);
    OK(dcd_world_destroy(world));
}

/* Ropes, springs, servos: what holds by distance or by stiffness. */
static void joints_pull(void)
{
    DcdJointId id;
    DcdJointMotor motor = DCD_JOINT_MOTOR_INIT;

    /* A rope of 3 m from centre to centre: the crate falls beside the post, then hangs below it. */
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdJointDef joint = tied(world, DCD_JOINT_ROPE);
    joint.frame_b.p[0] = 0.0f;
    joint.flags = DCD_JOINT_LIMIT;
    joint.limit[1] = 3.0f;
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 20);
    HOLDS(pose_of(world, joint.b).p[1] < -0.5 && joint_info(world, id).position < 2.9f); /* it is slack */
    OK(dcd_body_set_pose(world, joint.b, &(DcdPose){ { 0.0, -2.5, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }));
    OK(dcd_body_set_velocity(world, joint.b, &(DcdVelocity){ { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }));
    steps(world, 120);
    NEAR(joint_info(world, id).position, 3.0, 0.02);
    HOLDS(joint_info(world, id).joint_type == DCD_JOINT_ROPE);
    const float shorter[2] = { 0.0f, 2.0f };
    OK(dcd_joint_set_limit(world, id, DCD_AXIS_Z, shorter)); /* its axes are one */
    steps(world, 240);
    NEAR(joint_info(world, id).position, 2.0, 0.02);
    OK(dcd_world_destroy(world));

    /* 1000 kg on a spring of 20 kN/m: half a metre longer than at rest. */
    world = make_world(2, 1, -10.0f);
    joint = tied(world, DCD_JOINT_SPRING);
    joint.frame_b.p[0] = 0.0f;
    joint.flags = DCD_JOINT_MOTOR;
    joint.motor.position = 2.0f;
    joint.motor.stiffness = 20000.0f;
    joint.motor.damping = 5000.0f;
    joint.motor.model = DCD_MOTOR_FORCE;
    OK(dcd_body_set_pose(world, joint.b, &(DcdPose){ { 0.0, -2.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }));
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 300);
    NEAR(joint_info(world, id).position, 2.5, 0.02);
    HOLDS(joint_info(world, id).joint_type == DCD_JOINT_SPRING);
    OK(dcd_world_destroy(world));

    /* A servo turns a wheel to an angle. */
    world = make_world(2, 1, 0.0f);
    joint = tied(world, DCD_JOINT_REVOLUTE);
    OK(dcd_joint_create(world, &joint, &id));
    motor.position = -1.2f;
    motor.stiffness = 200.0f;
    motor.damping = 30.0f;
    OK(dcd_joint_set_motor(world, id, DCD_AXIS_TURN_X, &motor));
    steps(world, 240);
    NEAR(joint_info(world, id).position, -1.2, 0.01);
    DcdJointMotor read = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0 };
    OK(dcd_joint_get_motor(world, id, DCD_AXIS_TURN_X, &read));
    HOLDS(read.position == motor.position && read.stiffness == 200.0f && read.damping == 30.0f);
    HOLDS(read.velocity == 0.0f && read.max_force == motor.max_force && read.model == DCD_MOTOR_ACCELERATION);
    /* Its strength and not its will: too weak to turn. */
    motor.position = 1.0f;
    motor.max_force = 0.0f;
    OK(dcd_joint_set_motor(world, id, DCD_AXIS_TURN_X, &motor));
    steps(world, 60);
    NEAR(joint_info(world, id).position, -1.2, 0.02);
    OK(dcd_world_destroy(world));
}

static void generic_joints_free_what_they_are_told(void)
{
    /* Free along y only, between -1 and 1, and driven there. */
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdJointDef joint = tied(world, DCD_JOINT_GENERIC);
    DcdJointId id;
    const float range[2] = { -1.0f, 1.0f };
    joint.locked = DCD_LOCK_X | DCD_LOCK_Z | DCD_LOCK_TURN_X | DCD_LOCK_TURN_Y | DCD_LOCK_TURN_Z;
    joint.user_data = UINT64_MAX;
    OK(dcd_joint_create(world, &joint, &id));
    OK(dcd_joint_set_limit(world, id, DCD_AXIS_Y, range));
    steps(world, 120);
    NEAR(pose_of(world, joint.b).p[1], -1.0, 0.02);
    NEAR(pose_of(world, joint.b).p[0], 2.0, 0.02);
    DcdJointMotor lift = DCD_JOINT_MOTOR_INIT;
    lift.velocity = 2.0f;
    OK(dcd_joint_set_motor(world, id, DCD_AXIS_Y, &lift));
    steps(world, 120);
    NEAR(pose_of(world, joint.b).p[1], 1.0, 0.02);
    DcdJointInfo info = joint_info(world, id);
    HOLDS(info.joint_type == DCD_JOINT_GENERIC && info.locked == joint.locked && info.coupled == 0);
    HOLDS(info.limited == 1u << DCD_AXIS_Y && info.driven == 1u << DCD_AXIS_Y && info.user_data == UINT64_MAX);
    HOLDS(info.flags == (DCD_JOINT_LIMIT | DCD_JOINT_MOTOR));
    HOLDS(info.a.v == joint.a.v && info.b.v == joint.b.v && info.frame_b.p[0] == -2.0f);
    NEAR(info.offset.p[1], 1.0, 0.02);
    NEAR(info.offset.q[3], 1.0, 1e-3);
    OK(dcd_world_destroy(world));

    /* A cone of 0.5 rad about x, held at the origin: the crate falls until the cone holds it. */
    world = make_world(2, 1, -10.0f);
    joint = tied(world, DCD_JOINT_GENERIC);
    joint.locked = DCD_LOCK_X | DCD_LOCK_Y | DCD_LOCK_Z;
    joint.coupled = DCD_LOCK_TURN_Y | DCD_LOCK_TURN_Z;
    const float cone[2] = { 0.0f, 0.5f };
    OK(dcd_joint_create(world, &joint, &id));
    OK(dcd_joint_set_limit(world, id, DCD_AXIS_TURN_Z, cone));
    steps(world, 240);
    DcdPose pose = pose_of(world, joint.b);
    NEAR(atan2(-pose.p[1], hypot(pose.p[0], pose.p[2])), 0.5, 0.02);
    OK(dcd_world_destroy(world));
}

static void joints_are_changed_and_found(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdJointDef joint = tied(world, DCD_JOINT_FIXED);
    DcdJointId first, second, found[2];
    size_t count = 0;
    OK(dcd_joint_create(world, &joint, &first));
    steps(world, 60);
    NEAR(fabs((double)joint_info(world, first).force[1]), 10000.0, 200.0); /* 1000 kg */

    /* Longer by a metre, then switched off and on again. */
    const DcdFrame farther = { { -3.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    OK(dcd_joint_set_frames(world, first, NULL, &farther));
    steps(world, 120);
    NEAR(pose_of(world, joint.b).p[0], 3.0, 0.05);
    HOLDS(joint_info(world, first).frame_b.p[0] == -3.0f && joint_info(world, first).frame_a.p[0] == 0.0f);
    OK(dcd_joint_set_flags(world, first, DCD_JOINT_DISABLED | DCD_JOINT_COLLIDE));
    HOLDS(joint_info(world, first).flags == (DCD_JOINT_DISABLED | DCD_JOINT_COLLIDE));
    steps(world, 30);
    HOLDS(pose_of(world, joint.b).p[1] < -1.0);
    OK(dcd_joint_set_flags(world, first, 0));
    steps(world, 300);
    NEAR(pose_of(world, joint.b).p[1], 0.0, 0.05);

    /* At 1 Hz it gives way under the load. */
    OK(dcd_joint_set_softness(world, first, 1.0f, 1.0f));
    HOLDS(joint_info(world, first).natural_frequency == 1.0f);
    steps(world, 120);
    HOLDS(pose_of(world, joint.b).p[1] < -0.1);

    OK(dcd_joint_create(world, &joint, &second));
    OK(dcd_body_joints(world, joint.a, found, 2, &count));
    HOLDS(count == 2 && found[0].v == first.v && found[1].v == second.v);
    OK(dcd_body_joints(world, joint.b, found, 2, &count));
    HOLDS(count == 2 && found[0].v == first.v && dcd_joint_is_valid(world, second));
    OK(dcd_joint_destroy(world, first));
    OK(dcd_body_joints(world, joint.b, found, 2, &count));
    HOLDS(count == 1 && found[0].v == second.v && !dcd_joint_is_valid(world, first));
    OK(dcd_world_destroy(world));
}

static void every_shape_rests_on_every_ground(void)
{
    const float heights[9] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }, scale[3] = { 100.0f, 1.0f, 100.0f };
    const float corners[12] = { -50, 0, -50, -50, 0, 50, 50, 0, 50, 50, 0, -50 };
    const uint32_t triangles[6] = { 0, 1, 2, 0, 2, 3 };
    const float wedge[18] = { -1, 0, -1, 1, 0, -1, -1, 0, 1, 1, 0, 1, -1, 1, 0, 1, 1, 0 };
    for (int ground = 0; ground < 2; ground++) {
        DcdWorld world = make_world(4, 1, -10.0f);
        DcdBodyDef def = DCD_BODY_DEF_INIT;
        def.body_type = DCD_FIXED;
        if (ground == 0) {
            OK(dcd_shape_heightfield(world, heights, 3, 3, scale, &def.shape));
        } else {
            OK(dcd_shape_mesh(world, corners, 4, triangles, 2, &def.shape));
        }
        add(world, def);

        DcdShapeId shapes[7];
        const DcdFrame halves[2] = { { { -0.5f, 0, 0 }, { 0, 0, 0, 1 } }, { { 0.5f, 0, 0 }, { 0, 0, 0, 1 } } };
        shapes[0] = box(world, 0.5f, 0.5f, 0.5f);
        OK(dcd_shape_sphere(world, 0.5f, &shapes[1]));
        OK(dcd_shape_cylinder(world, 0.5f, 0.5f, &shapes[2]));
        OK(dcd_shape_cone(world, 0.5f, 0.5f, &shapes[3]));
        OK(dcd_shape_hull(world, wedge, 6, &shapes[4]));
        OK(dcd_shape_capsule(world, 0.5f, 0.5f, &shapes[5]));
        const DcdShapeId parts[2] = { shapes[0], shapes[0] };
        OK(dcd_shape_compound(world, parts, halves, 2, &shapes[6]));
        const double rest[7] = { 0.5, 0.5, 0.5, 0.5, 0.0, 1.0, 0.5 };
        DcdBodyId bodies[7];
        for (int i = 0; i < 7; i++) {
            DcdBodyDef body = DCD_BODY_DEF_INIT;
            body.shape = shapes[i];
            body.locked = DCD_LOCK_TURN_X | DCD_LOCK_TURN_Z; /* a capsule on end */
            body.pose.p[0] = 5.0 * (i - 3) + 1.0;
            body.pose.p[1] = rest[i] + 0.5;
            body.pose.p[2] = 3.0;
            bodies[i] = add(world, body);
            OK(dcd_shape_destroy(world, shapes[i])); /* bodies keep theirs */
        }
        steps(world, 120);
        for (int i = 0; i < 7; i++) {
            NEAR(pose_of(world, bodies[i]).p[1], rest[i], 0.03);
        }
        OK(dcd_world_destroy(world));
    }
}

static void views_and_bulk_agree(void)
{
    DcdWorld world = make_world(4, 1, -10.0f);
    DcdBodyId ids[8], ground = add_floor(world);
    DcdVelocity velocities[8];
    uint64_t data[8];
    struct Row {
        char tag;
        DcdPose pose;
    } rows[8];
    for (int i = 0; i < 8; i++) {
        ids[i] = add(world, crate(world, 2.0 * i - 7.0, 0.5));
        data[i] = 70u + (uint64_t)i;
        velocities[i] = (DcdVelocity){ { 0.0f, (float)i, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    }
    OK(dcd_state_write(world, ids, 8, DCD_FIELD_USER_DATA, data, 0, NULL));
    OK(dcd_state_write(world, ids, 8, DCD_FIELD_VELOCITY, velocities, sizeof velocities[0], NULL));
    OK(dcd_state_write(world, &ground, 1, DCD_FIELD_USER_DATA, data, 0, NULL));
    OK(dcd_state_read(world, &ground, 1, DCD_FIELD_USER_DATA, &data[7], 0, NULL));
    HOLDS(data[7] == 70);
    steps(world, 6);

    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    OK(dcd_state_read(world, ids, 8, DCD_FIELD_POSE, &rows[0].pose, sizeof rows[0], NULL));
    OK(dcd_state_read(world, ids, 8, DCD_FIELD_VELOCITY, velocities, 0, NULL));
    HOLDS(view.count == 8 && view.tick == 6); /* the floor does not move */
    for (size_t i = 0; i < view.count; i++) {
        HOLDS(view.ids[i].v == ids[i].v && view.user_data[i] == 70 + i);
        HOLDS(view.regions[i] == region_of(world, ids[i]));
        NEAR(view.poses[i].p[1], rows[i].pose.p[1], 0.0);
        NEAR(view.velocities[i].linear[1], velocities[i].linear[1], 0.0);
        HOLDS(i == 0 || view.poses[i].p[1] > view.poses[i - 1].p[1]); /* the faster, the higher */
    }
    steps(world, 300);
    OK(dcd_state_view(world, &view));
    for (size_t i = 0; i < view.count; i++) {
        HOLDS(view.flags[i] == DCD_STATE_SLEEPING);
    }
    OK(dcd_world_destroy(world));
}

static void threads_do_not_change_the_result(void)
{
    uint64_t hashes[3] = { 0, 1, 2 };
    const char *params[] = { "n=120" };
    for (uint32_t threads = 1; threads <= 3; threads++) {
        DcdWorldDef def = DCD_WORLD_DEF_INIT;
        DcdWorld world = { 0 };
        DcdStats stats = DCD_STATS_INIT;
        def.threads = threads;
        def.regions = 4;
        OK(dcd_world_open_scene("pile", params, 1, &def, &world));
        steps(world, 60);
        OK(dcd_state_hash(world, &hashes[threads - 1]));
        OK(dcd_stats(world, &stats));
        HOLDS(stats.bodies == 120 && stats.regions == 4 && stats.ticks == 60 && stats.quarantined == 0);
        OK(dcd_world_destroy(world));
    }
    HOLDS(hashes[0] == hashes[1] && hashes[1] == hashes[2]);
}

/* Two crates in a row meet a third at the border of two regions: as each coupling has it. */
static void couplings_are_as_asked(void)
{
    const DcdCoupling couplings[] = { DCD_COUPLING_PROXY, DCD_COUPLING_OWNER, DCD_COUPLING_OVERLAP,
                                      DCD_COUPLING_ISLAND, DCD_COUPLING_AUTO, DCD_COUPLING_DEFAULT };
    uint64_t hashes[6] = { 0 };
    for (int i = 0; i < 6; i++) {
        DcdWorldDef def = DCD_WORLD_DEF_INIT;
        DcdWorld world = { 0 };
        DcdStats stats = DCD_STATS_INIT;
        double momentum = 0.0, worst = 0.0;
        def.regions = 2;
        def.gravity[1] = 0.0f;
        def.coupling = couplings[i];
        def.exchanges = couplings[i] == DCD_COUPLING_OVERLAP ? 3 : 0;
        OK(dcd_world_create(&def, &world));
        OK(dcd_stats(world, &stats));
        HOLDS(stats.exchanges == 0 && stats.disagreement == 0.0f);
        DcdBodyId bodies[3];
        for (int b = 0; b < 3; b++) {
            DcdBodyDef body = crate(world, 1.1 * b - 1.6, 0.0);
            body.velocity.linear[0] = b == 0 ? 3.0f : 0.0f;
            bodies[b] = add(world, body);
        }
        for (int step = 0; step < 60; step++) {
            OK(dcd_step(world));
            OK(dcd_stats(world, &stats));
            worst = stats.disagreement > worst ? stats.disagreement : worst;
        }
        HOLDS(stats.exchanges == (couplings[i] == DCD_COUPLING_OVERLAP ? 3 : stats.exchanges));
        HOLDS(stats.exchanges >= 1 && stats.exchanges <= 4);
        HOLDS(worst > 0.0 || couplings[i] != DCD_COUPLING_OVERLAP);
        HOLDS(worst == 0.0 || couplings[i] >= DCD_COUPLING_OVERLAP || couplings[i] == DCD_COUPLING_DEFAULT);
        for (int b = 0; b < 3; b++) {
            DcdVelocity velocity = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
            OK(dcd_body_get(world, bodies[b], NULL, &velocity));
            momentum += velocity.linear[0];
        }
        if (couplings[i] >= DCD_COUPLING_OVERLAP) {
            NEAR(momentum, 3.0, 1e-3);
        }
        OK(dcd_state_hash(world, &hashes[i]));
        OK(dcd_world_destroy(world));
    }
    HOLDS(hashes[5] == hashes[4]); /* auto is the default */
    HOLDS(hashes[1] != hashes[2] && hashes[0] != hashes[2]);
}

static void millimetres_count_far_out(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 0 };
    def.min[0] = 99000.0;
    def.max[0] = 101000.0;
    OK(dcd_world_create(&def, &world));
    DcdBodyId body = add(world, crate(world, 100000.001, 0.0));
    NEAR(pose_of(world, body).p[0], 100000.001, 1e-4);
    DcdRay ray = { { 100000.001, 5.0, 0.0 }, { 0.0f, -1.0f, 0.0f }, 10.0f, { 0 }, 0xFFFFFFFFu, 0 };
    DcdRayHit hit;
    OK(dcd_step(world));
    OK(dcd_cast_rays(world, &ray, 1, &hit));
    HOLDS(hit.body.v == body.v);
    NEAR(hit.point[0], 100000.001, 1e-3);
    OK(dcd_world_destroy(world));
}

int main(void)
{
    members_of_a_body_count();
    pushes_push();
    events_tell();
    a_transfer_is_told_once();
    surfaces_can_be_changed();
    joints_hold();
    joints_pull();
    generic_joints_free_what_they_are_told();
    joints_are_changed_and_found();
    every_shape_rests_on_every_ground();
    views_and_bulk_agree();
    threads_do_not_change_the_result();
    couplings_are_as_asked();
    millimetres_count_far_out();
    printf("%d checks, %d failures\n", checks, failures);
    return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
