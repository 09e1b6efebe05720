/* The behaviour of the C API's functions when used as intended. Each group of checks has a small world of its
 * own. */
#include "checks.h"

#include <math.h>

#define NEAR(value, expected, by) near_to((double)(value), (double)(expected), (double)(by), #value, __LINE__)

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

static DcdBodyInfo info_of(DcdWorld world, DcdBodyId body)
{
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    OK(dcd_body_info(world, body, &info));
    return info;
}

static uint32_t region_of(DcdWorld world, DcdBodyId body)
{
    return info_of(world, body).region;
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
    def.mask = 2; /* it is in group 1 and meets group 2 only; the floor is in all groups */
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

/* Steps until a contact of this kind is reported. Returns the contact, or one of kind 99 if there is none. */
static DcdContact next_contact(DcdWorld world, uint32_t kind)
{
    DcdContact none = { { 0 }, { 0 }, 0, 0, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 0.0f, 99, 0, 0, 0, 0, 0 };
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

    steps(world, 20); /* it lies but is not asleep yet */
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

/* A body across the border is held and reported on both sides; a body far from it is not. */
static void topology_says_who_owns_what_and_what_borders_share(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyId ground = add_floor(world);
    DcdBodyId away = add(world, crate(world, -10.0, 0.5));
    DcdBodyId low = add(world, crate(world, -0.2, 0.5));
    DcdBodyDef def = crate(world, 0.2, 1.5);
    def.density = 100000.0f;
    DcdBodyId high = add(world, def);
    DcdRegionInfo regions[2];
    DcdBorderInfo border = { 9, 9, 9, 9, 9, 9.0f };
    DcdOwner owner = DCD_OWNER_INIT;
    size_t count = 0;
    float worst = 0.0f;
    OK(dcd_regions(world, regions, 2, &count));
    for (int i = 0; i < 30; i++) {
        DcdStats stats = DCD_STATS_INIT;
        OK(dcd_step(world));
        OK(dcd_borders(world, &border, 1, &count));
        OK(dcd_stats(world, &stats));
        HOLDS(count == 1 && border.disagreement == stats.disagreement);
        worst = border.disagreement > worst ? border.disagreement : worst;
    }
    HOLDS(border.a == regions[0].region && border.b == regions[1].region && border.depth >= 1 && border.exchanges >= 1);
    OK(dcd_body_owner(world, away, &owner));
    HOLDS(owner.region == region_of(world, away) && owner.node == DCD_NO_NODE && owner.holders == 1);
    HOLDS(owner.flags == DCD_OWNER_HERE);
    OK(dcd_body_owner(world, ground, &owner));
    HOLDS(owner.region == DCD_NO_REGION && owner.holders == 2 && owner.flags == 0);
    OK(dcd_world_destroy(world));

    /* With the coupling `overlap`, islands are not moved whole: both boxes live in both regions. */
    DcdWorldDef overlap = DCD_WORLD_DEF_INIT;
    overlap.regions = 2;
    overlap.coupling = DCD_COUPLING_OVERLAP;
    overlap.exchanges = 3;
    OK(dcd_world_create(&overlap, &world));
    add_floor(world);
    low = add(world, crate(world, -0.2, 0.5));
    def.shape = crate(world, 0.0, 0.0).shape;
    high = add(world, def);
    for (int i = 0; i < 30; i++) {
        OK(dcd_step(world));
        OK(dcd_borders(world, &border, 1, &count));
        worst = border.disagreement > worst ? border.disagreement : worst;
    }
    HOLDS(border.bodies == 2 && border.exchanges == 3 && border.depth == 2 && worst > 0.0f && worst < 1.0f);
    OK(dcd_body_owner(world, low, &owner));
    HOLDS(owner.holders == 2 && owner.region == region_of(world, low));
    OK(dcd_body_owner(world, high, &owner));
    HOLDS(owner.holders == 2 && owner.region == region_of(world, high));
    OK(dcd_world_destroy(world));
}

/* What DcdBodyDef says can be changed later, also for bodies of scenes. */
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
    OK(dcd_body_set_material(world, slides, DCD_ALL_COLLIDERS, 0.0f, 0.0f));
    OK(dcd_body_set_material(world, stops, DCD_ALL_COLLIDERS, 1.0f, 0.0f));
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

static DcdBodyProperties properties_of(DcdWorld world, DcdBodyId body)
{
    DcdBodyProperties properties = DCD_BODY_PROPERTIES_INIT;
    OK(dcd_body_properties(world, body, &properties));
    return properties;
}

static DcdColliderProperties collider_of(DcdWorld world, DcdBodyId body, uint32_t collider)
{
    DcdColliderProperties properties = DCD_COLLIDER_PROPERTIES_INIT;
    OK(dcd_collider_properties(world, body, collider, &properties));
    return properties;
}

/* A body whose definition sets every member to an unusual value. */
static DcdBodyDef peculiar(DcdWorld world)
{
    DcdBodyDef def = crate(world, 20.0, 50.0);
    def.density = 500.0f;
    def.friction = 0.25f;
    def.restitution = 0.125f;
    def.friction_rule = DCD_COMBINE_GEOMETRIC_MEAN;
    def.restitution_rule = DCD_COMBINE_MULTIPLY;
    def.contact_skin = 0.01f;
    def.linear_damping = 0.5f;
    def.angular_damping = 0.75f;
    def.gravity_scale = -2.0f;
    def.flags = DCD_BODY_CCD | DCD_BODY_SENSOR | DCD_BODY_FAST_SPIN | DCD_BODY_NO_GYRO | DCD_BODY_ANY_GROUP;
    def.locked = DCD_LOCK_X | DCD_LOCK_TURN_Z;
    def.events = DCD_EVENT_CONTACT;
    def.force_threshold = 3.0f;
    def.groups = 5;
    def.mask = 6;
    def.solver_groups = 9;
    def.solver_mask = 10;
    def.pairs = DCD_PAIR_DYNAMIC_FIXED | DCD_PAIR_KINEMATIC_FIXED;
    def.dominance = -7;
    def.soft_ccd = 0.25f;
    def.sleep_linear = 0.5f;
    def.sleep_angular = 0.25f;
    def.sleep_after = 4.0f;
    def.extra_mass = 8.0f;
    def.extra_centre[1] = 0.5f;
    def.extra_inertia[0] = 2.0f;
    def.extra_inertia[2] = 4.0f;
    def.extra_solver_iterations = 3;
    def.extra_pgs_iterations = 2;
    def.user_data = 99;
    return def;
}

static void every_member_of_a_body_is_read_back(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef def = peculiar(world);
    DcdBodyId body = add(world, def);
    DcdBodyProperties as = properties_of(world, body);
    HOLDS(as.body_type == DCD_DYNAMIC && as.flags == (DCD_BODY_CCD | DCD_BODY_FAST_SPIN | DCD_BODY_NO_GYRO));
    HOLDS(as.locked == def.locked && as.dominance == -7 && as.linear_damping == 0.5f && as.angular_damping == 0.75f);
    HOLDS(as.gravity_scale == -2.0f && as.soft_ccd == 0.25f && as.user_data == 99);
    HOLDS(as.sleep_linear == 0.5f && as.sleep_angular == 0.25f && as.sleep_after == 4.0f);
    HOLDS(as.extra_mass == 8.0f && as.extra_centre[1] == 0.5f && as.extra_inertia[0] == 2.0f);
    HOLDS(as.extra_inertia[1] == 0.0f && as.extra_inertia[2] == 4.0f);
    HOLDS(as.extra_solver_iterations == 3 && as.extra_pgs_iterations == 2);

    DcdColliderProperties collider = collider_of(world, body, 0);
    HOLDS(collider.flags == (DCD_COLLIDER_SENSOR | DCD_COLLIDER_ANY_GROUP) && collider.density == 500.0f && collider.mass == 0.0f);
    HOLDS(collider.friction == 0.25f && collider.restitution == 0.125f && collider.contact_skin == 0.01f);
    HOLDS(collider.friction_rule == DCD_COMBINE_GEOMETRIC_MEAN && collider.restitution_rule == DCD_COMBINE_MULTIPLY);
    HOLDS(collider.events == DCD_EVENT_CONTACT && collider.force_threshold == 3.0f && collider.pairs == def.pairs);
    HOLDS(collider.groups == 5 && collider.mask == 6 && collider.solver_groups == 9 && collider.solver_mask == 10);

    /* A body that does not sleep keeps its thresholds, also those of 0. */
    const float thresholds[4][2] = { { 0.3f, 0.4f }, { 0.0f, 0.0f }, { 1.0f, 1.0f }, { 0.05f, 0.5f } };
    for (int i = 0; i < 8; i++) {
        DcdBodyProperties sleeps = as, seen;
        sleeps.flags ^= i % 2 == 0 ? DCD_BODY_NO_SLEEP : 0;
        sleeps.sleep_linear = thresholds[i / 2][0];
        sleeps.sleep_angular = thresholds[i / 2][1];
        OK(dcd_body_set_properties(world, body, &sleeps));
        seen = properties_of(world, body);
        HOLDS(memcmp(&seen, &sleeps, sizeof seen) == 0);
    }
    OK(dcd_body_set_properties(world, body, &as));
    DcdBodyDef awake = peculiar(world);
    awake.flags |= DCD_BODY_NO_SLEEP;
    DcdBodyProperties made = properties_of(world, add(world, awake));
    HOLDS((made.flags & DCD_BODY_NO_SLEEP) != 0 && made.sleep_linear == 0.5f && made.sleep_angular == 0.25f);

    /* Given to another body, these properties make it the same. */
    DcdBodyId other = add(world, crate(world, -20.0, 50.0));
    DcdBodyProperties usual = properties_of(world, other), again;
    DcdColliderProperties plain = collider_of(world, other, 0), collider_again;
    OK(dcd_body_set_properties(world, other, &as));
    again = properties_of(world, other);
    HOLDS(memcmp(&again, &as, sizeof as) == 0);
    collider.frame.p[1] = 0.25f;
    collider.user_data = 12;
    OK(dcd_collider_set_properties(world, other, 0, &collider));
    collider_again = collider_of(world, other, 0);
    HOLDS(memcmp(&collider_again, &collider, sizeof collider) == 0);
    /* The former properties undo that. */
    OK(dcd_body_set_properties(world, other, &usual));
    again = properties_of(world, other);
    HOLDS(memcmp(&again, &usual, sizeof as) == 0);
    OK(dcd_collider_set_properties(world, other, 0, &plain));
    HOLDS(collider_of(world, other, 0).frame.p[1] == 0.0f && collider_of(world, other, 0).friction == 0.5f);
    NEAR(info_of(world, other).mass, 1000.0, 0.01);

    /* A sleeping body sleeps on when its properties are set to what they are. */
    OK(dcd_body_sleep(world, other));
    OK(dcd_body_set_properties(world, other, &again));
    HOLDS(info_of(world, other).sleeping);
    again.user_data = 5;
    OK(dcd_body_set_properties(world, other, &again));
    HOLDS(info_of(world, other).sleeping && info_of(world, other).user_data == 5);
    again.gravity_scale = 2.0f;
    OK(dcd_body_set_properties(world, other, &again));
    HOLDS(!info_of(world, other).sleeping);
    OK(dcd_world_destroy(world));
}

static void changed_bodies_behave_so(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyProperties as;
    add_floor(world);

    /* A body made fixed hangs in the air; made dynamic again, it falls. A disabled body takes no part. */
    DcdBodyId fixed = add(world, crate(world, -30.0, 20.0)), gone = add(world, crate(world, -25.0, 20.0));
    DcdBodyId light = add(world, crate(world, -20.0, 20.0)), held = add(world, crate(world, -15.0, 20.0));
    DcdBodyId slow = add(world, crate(world, -10.0, 20.0));
    as = properties_of(world, fixed);
    as.body_type = DCD_FIXED;
    OK(dcd_body_set_properties(world, fixed, &as));
    as = properties_of(world, gone);
    as.flags = DCD_BODY_DISABLED;
    OK(dcd_body_set_properties(world, gone, &as));
    as = properties_of(world, light);
    as.gravity_scale = 0.0f;
    OK(dcd_body_set_properties(world, light, &as));
    as = properties_of(world, held);
    as.locked = DCD_LOCK_Y;
    OK(dcd_body_set_properties(world, held, &as));
    as = properties_of(world, slow);
    as.linear_damping = 5.0f;
    OK(dcd_body_set_properties(world, slow, &as));
    steps(world, 60);
    NEAR(pose_of(world, fixed).p[1], 20.0, 0.0);
    NEAR(pose_of(world, gone).p[1], 20.0, 0.0);
    NEAR(pose_of(world, light).p[1], 20.0, 1e-6);
    NEAR(pose_of(world, held).p[1], 20.0, 1e-6);
    HOLDS(pose_of(world, slow).p[1] > 18.0 && pose_of(world, slow).p[1] < 19.5);
    as = properties_of(world, fixed);
    as.body_type = DCD_DYNAMIC;
    OK(dcd_body_set_properties(world, fixed, &as));
    as = properties_of(world, gone);
    as.flags = 0;
    OK(dcd_body_set_properties(world, gone, &as));
    steps(world, 30);
    NEAR(velocity_of(world, fixed).linear[1], -5.0, 0.05);
    HOLDS(pose_of(world, gone).p[1] < 19.0);

    /* 500 kg more, then 0.6 m higher. */
    DcdBodyId heavy = add(world, crate(world, 10.0, 20.0));
    as = properties_of(world, heavy);
    as.extra_mass = 500.0f;
    OK(dcd_body_set_properties(world, heavy, &as));
    NEAR(info_of(world, heavy).mass, 1500.0, 0.1);
    NEAR(info_of(world, heavy).centre[1], 20.0, 1e-4);
    as.extra_centre[1] = 0.6f;
    OK(dcd_body_set_properties(world, heavy, &as));
    NEAR(info_of(world, heavy).mass, 1500.0, 0.1);
    NEAR(info_of(world, heavy).centre[1], 20.2, 1e-3);

    /* A dominant body is not pushed back by a body a hundred times as heavy. */
    DcdBodyDef def = crate(world, 20.0, 0.5);
    def.friction = 0.0f;
    def.friction_rule = DCD_COMBINE_MULTIPLY;
    DcdBodyId anvil = add(world, def);
    def.pose.p[0] = 17.0;
    def.density = 10.0f;
    def.dominance = 1;
    def.velocity.linear[0] = 2.0f;
    DcdBodyId lord = add(world, def);
    steps(world, 150);
    NEAR(velocity_of(world, lord).linear[0], 2.0, 0.02);
    HOLDS(pose_of(world, anvil).p[0] > 20.5);
    OK(dcd_world_destroy(world));
}

static void speed_and_spin_are_as_asked(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    const float plate[3] = { 0.02f, 5.0f, 5.0f }, book[3] = { 0.5f, 0.1f, 0.3f };
    DcdBodyDef wall = DCD_BODY_DEF_INIT, def = crate(world, -4.0, 0.0);
    wall.body_type = DCD_KINEMATIC; /* bodies never jump through fixed ones */
    OK(dcd_shape_box(world, plate, &wall.shape));
    add(world, wall);
    /* Bullets of 300 m/s at a plate of 4 cm: one passes, one has soft CCD, one has CCD. */
    OK(dcd_shape_sphere(world, 0.05f, &def.shape));
    def.velocity.linear[0] = 300.0f;
    def.pose.p[1] = -3.0;
    DcdBodyId bullet = add(world, def);
    def.pose.p[1] = 0.0;
    def.soft_ccd = 10.0f;
    DcdBodyId careful = add(world, def);
    def.soft_ccd = 0.0f;
    def.pose.p[1] = 3.0;
    DcdBodyId swept = add(world, def);
    DcdBodyProperties as = properties_of(world, swept);
    as.flags |= DCD_BODY_CCD;
    OK(dcd_body_set_properties(world, swept, &as));
    steps(world, 30);
    HOLDS(pose_of(world, bullet).p[0] > 10.0);
    HOLDS(pose_of(world, careful).p[0] < 0.0 && pose_of(world, swept).p[0] < 0.0);

    /* 200 rad/s is more than a quarter turn per step. */
    def = crate(world, 20.0, 20.0);
    def.velocity.angular[1] = 200.0f;
    def.flags = DCD_BODY_NO_SLEEP;
    DcdBodyId capped = add(world, def);
    def.pose.p[0] = 25.0;
    def.flags |= DCD_BODY_FAST_SPIN;
    DcdBodyId wheel = add(world, def);
    /* A book tumbles about its middle axis, unless it has no gyroscopic torque. */
    def = crate(world, 30.0, 20.0);
    OK(dcd_shape_box(world, book, &def.shape));
    def.velocity.angular[0] = 0.05f;
    def.velocity.angular[2] = 6.0f;
    DcdBodyId tumbles = add(world, def);
    def.pose.p[0] = 35.0;
    def.flags |= DCD_BODY_NO_GYRO;
    DcdBodyId steady = add(world, def);
    float wildest = 0.0f;
    for (int i = 0; i < 300; i++) {
        OK(dcd_step(world));
        wildest = fmaxf(wildest, fabsf(velocity_of(world, tumbles).angular[0]));
        NEAR(velocity_of(world, steady).angular[0], 0.05, 1e-3);
    }
    HOLDS(velocity_of(world, capped).angular[1] < 100.0f);
    NEAR(velocity_of(world, wheel).angular[1], 200.0, 0.1);
    HOLDS(wildest > 1.0f);
    OK(dcd_world_destroy(world));
}

static void bodies_sleep_by_their_own_measure(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    add_floor(world);
    DcdBodyDef def = crate(world, -6.0, 0.5);
    DcdBodyId usual = add(world, def);
    def.pose.p[0] = -3.0;
    def.sleep_after = 3.0f;
    DcdBodyId late = add(world, def);
    def.pose.p[0] = 3.0;
    def.flags = DCD_BODY_NO_SLEEP;
    DcdBodyId never = add(world, def);
    steps(world, 90);
    HOLDS(info_of(world, usual).sleeping && !info_of(world, late).sleeping && !info_of(world, never).sleeping);
    steps(world, 150);
    HOLDS(info_of(world, late).sleeping && !info_of(world, never).sleeping);
    DcdBodyProperties as = properties_of(world, never);
    as.flags = 0;
    as.sleep_after = 0.5f;
    OK(dcd_body_set_properties(world, never, &as));
    steps(world, 90);
    HOLDS(info_of(world, never).sleeping);
    OK(dcd_world_destroy(world));
}

static void materials_and_groups_combine(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyId ground = add_floor(world);
    DcdColliderProperties collider = collider_of(world, ground, 0);
    collider.friction = 1.0f;
    OK(dcd_collider_set_properties(world, ground, 0, &collider));
    DcdBodyDef def = crate(world, -20.0, 0.5);
    def.velocity.linear[0] = 5.0f;
    def.friction = 0.0f;
    def.friction_rule = DCD_COMBINE_MIN;
    DcdBodyId ice = add(world, def);
    def.pose.p[2] = 10.0;
    def.friction_rule = DCD_COMBINE_AVERAGE;
    DcdBodyId wood = add(world, def);
    /* A contact skin keeps it off the ground. */
    DcdBodyId cushioned = add(world, crate(world, 20.0, 0.7));
    collider = collider_of(world, cushioned, 0);
    collider.contact_skin = 0.1f;
    OK(dcd_collider_set_properties(world, cushioned, 0, &collider));
    steps(world, 120);
    NEAR(velocity_of(world, ice).linear[0], 5.0, 0.01);
    NEAR(velocity_of(world, wood).linear[0], 0.0, 0.01);
    NEAR(pose_of(world, cushioned).p[1], 0.6, 0.02);

    /* Detected but not pushed: it falls through the ground, and the contact is reported. */
    def = crate(world, 30.0, 2.0);
    def.events = DCD_EVENT_CONTACT;
    def.solver_mask = 0;
    DcdBodyId ghost = add(world, def);
    HOLDS(next_contact(world, DCD_CONTACT_BEGAN).b.v == ghost.v);
    steps(world, 60);
    HOLDS(pose_of(world, ghost).p[1] < -2.0);

    /* Two bodies that both have DCD_BODY_ANY_GROUP collide if one of the two matches the other. */
    def = crate(world, 35.0, 10.0);
    def.body_type = DCD_FIXED;
    def.flags = DCD_BODY_ANY_GROUP;
    def.groups = 1;
    def.mask = 2;
    add(world, def);
    def.body_type = DCD_DYNAMIC;
    def.groups = 2;
    def.mask = 2;
    def.pose.p[1] = 12.0;
    DcdBodyId either = add(world, def);
    def.pose.p[1] = 14.0;
    def.flags = 0;
    DcdBodyId both = add(world, def);
    def.groups = 4;
    steps(world, 120);
    NEAR(pose_of(world, either).p[1], 11.0, 0.05);
    NEAR(pose_of(world, both).p[1], 12.0, 0.05); /* on the other one: the two match each other both ways */
    collider = collider_of(world, either, 0);
    collider.flags = 0;
    OK(dcd_collider_set_properties(world, either, 0, &collider));
    OK(dcd_body_wake(world, either));
    steps(world, 60);
    HOLDS(pose_of(world, either).p[1] < 10.0);
    OK(dcd_world_destroy(world));

    /* A fixed sensor detects a door only if it asks for such pairs. */
    world = make_world(2, 1, 0.0f);
    def = crate(world, 0.0, 0.0);
    def.flags = DCD_BODY_SENSOR;
    def.body_type = DCD_FIXED;
    def.events = DCD_EVENT_CONTACT;
    DcdBodyId gate = add(world, def);
    def = crate(world, -3.0, 0.0);
    def.body_type = DCD_KINEMATIC;
    def.velocity.linear[0] = 3.0f;
    DcdBodyId door = add(world, def);
    HOLDS(next_contact(world, DCD_CONTACT_BEGAN).kind == 99);
    collider = collider_of(world, gate, 0);
    collider.pairs = DCD_PAIR_KINEMATIC_FIXED;
    OK(dcd_collider_set_properties(world, gate, 0, &collider));
    OK(dcd_body_set_pose(world, door, &def.pose));
    HOLDS(next_contact(world, DCD_CONTACT_BEGAN).b.v == door.v);
    OK(dcd_world_destroy(world));
}

static void colliders_come_and_go(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyId ground = add_floor(world), body = add(world, crate(world, 0.0, 2.0));
    DcdShapeId ball = { 0 };
    DcdColliderProperties foot = DCD_COLLIDER_PROPERTIES_INIT;
    uint32_t collider = 9;
    OK(dcd_shape_sphere(world, 0.25f, &ball));
    foot.frame.p[1] = -1.0f;
    foot.mass = 500.0f;
    OK(dcd_collider_add(world, body, ball, &foot, &collider));
    HOLDS(collider == 1 && info_of(world, body).colliders == 2);
    NEAR(info_of(world, body).mass, 1500.0, 0.1);
    HOLDS(collider_of(world, body, 1).mass == 500.0f && collider_of(world, body, 1).frame.p[1] == -1.0f);
    DcdBodyProperties as = properties_of(world, body);
    as.locked = DCD_LOCK_TURN_X | DCD_LOCK_TURN_Z;
    OK(dcd_body_set_properties(world, body, &as));
    steps(world, 120);
    NEAR(pose_of(world, body).p[1], 1.25, 0.03); /* it stands on its foot */

    OK(dcd_body_set_events(world, body, 1, DCD_EVENT_CONTACT, 0.0f));
    OK(dcd_body_set_pose(world, body, &(DcdPose){ { 5.0, 2.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }));
    DcdContact contact = next_contact(world, DCD_CONTACT_BEGAN);
    HOLDS(contact.a.v == ground.v && contact.b.v == body.v && contact.collider_b == 1);

    /* A larger foot, with the offset of its frame, and then a disabled one. */
    DcdShapeId bigger = { 0 };
    OK(dcd_shape_sphere(world, 0.5f, &bigger));
    OK(dcd_collider_set_shape(world, body, 1, bigger));
    steps(world, 120);
    NEAR(pose_of(world, body).p[1], 1.5, 0.03);
    foot = collider_of(world, body, 1);
    foot.flags = DCD_COLLIDER_DISABLED;
    OK(dcd_collider_set_properties(world, body, 1, &foot));
    OK(dcd_body_wake(world, body));
    steps(world, 120);
    NEAR(pose_of(world, body).p[1], 0.5, 0.03);
    OK(dcd_collider_remove(world, body, 1));
    HOLDS(info_of(world, body).colliders == 1);
    NEAR(info_of(world, body).mass, 1000.0, 0.1);

    /* A compound that touches several bodies becomes a ball. Rapier by itself would not forget all of its
     * contacts. */
    const DcdShapeId two[2] = { bigger, bigger };
    const DcdFrame sides[2] = { { { -0.4f, 0.0f, 0.0f }, { 0, 0, 0, 1 } }, { { 0.4f, 0.0f, 0.0f }, { 0, 0, 0, 1 } } };
    DcdBodyDef def = crate(world, 20.0, 0.7);
    add(world, def);
    def.pose.p[0] = 21.0;
    def.pose.p[1] = 0.3;
    add(world, def);
    OK(dcd_shape_compound(world, two, sides, 2, &def.shape));
    def.pose.p[0] = 20.8;
    DcdBodyId changed = add(world, def);
    steps(world, 2);
    OK(dcd_collider_set_shape(world, changed, 0, bigger));
    steps(world, 240);
    NEAR(pose_of(world, changed).p[1], 0.5, 0.03);
    OK(dcd_world_destroy(world));
}

static void bodies_follow_poses(void)
{
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef def = crate(world, -3.0, 0.0);
    def.body_type = DCD_KINEMATIC_POSE;
    def.shape = box(world, 2.0f, 0.5f, 2.0f);
    def.friction = 1.0f;
    DcdBodyId lift = add(world, def);
    def = crate(world, -3.0, 1.0);
    def.friction = 1.0f;
    DcdBodyId load = add(world, def);
    DcdPose pose = pose_of(world, lift);
    HOLDS(properties_of(world, lift).body_type == DCD_KINEMATIC_POSE && info_of(world, lift).body_type == DCD_KINEMATIC_POSE);
    for (int i = 0; i < 120; i++) {
        pose.p[0] += 0.05;
        if (i % 2 == 0) {
            OK(dcd_body_set_target(world, lift, &pose));
        } else {
            OK(dcd_state_write(world, &lift, 1, DCD_FIELD_TARGET, &pose, 0, NULL));
        }
        OK(dcd_step(world));
        NEAR(pose_of(world, lift).p[0], pose.p[0], 1e-3);
    }
    NEAR(velocity_of(world, lift).linear[0], 3.0, 0.01);
    NEAR(velocity_of(world, load).linear[0], 3.0, 0.1);
    steps(world, 1);
    NEAR(velocity_of(world, lift).linear[0], 0.0, 1e-3);
    NEAR(pose_of(world, lift).p[0], 3.0, 1e-3);
    OK(dcd_world_destroy(world));
}

static void forces_add_up(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyId rocket = add(world, crate(world, 0.0, 0.0)), other = add(world, crate(world, 10.0, 0.0));
    const float push[3] = { 0.0f, 1000.0f, 0.0f };
    const double left[3] = { -0.5, 0.0, 0.0 }, right[3] = { 0.5, 0.0, 0.0 };
    OK(dcd_body_add_force(world, rocket, push, left));
    OK(dcd_body_add_force(world, rocket, push, right));
    OK(dcd_body_add_force(world, rocket, push, right));
    HOLDS(info_of(world, rocket).force[1] == 3000.0f);
    NEAR(info_of(world, rocket).torque[2], 500.0, 1e-3);
    DcdForce force;
    OK(dcd_state_read(world, &rocket, 1, DCD_FIELD_FORCE, &force, 0, NULL));
    OK(dcd_state_write(world, &other, 1, DCD_FIELD_FORCE, &force, 0, NULL));
    steps(world, 60);
    NEAR(velocity_of(world, rocket).linear[1], 3.0, 1e-3);
    NEAR(velocity_of(world, rocket).angular[2], 3.0, 0.05); /* 500 N m on 1000/6 kg m² */
    NEAR(velocity_of(world, other).linear[1], 3.0, 1e-3);
    NEAR(velocity_of(world, other).angular[2], velocity_of(world, rocket).angular[2], 1e-3);
    OK(dcd_body_set_force(world, rocket, NULL, NULL));
    HOLDS(info_of(world, rocket).force[1] == 0.0f && info_of(world, rocket).torque[2] == 0.0f);
    OK(dcd_world_destroy(world));
}

/* A post at the origin and a crate beside it, with a joint at the post. */
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

    /* About x, the axis on which the crate lies: it spins on the spot at the motor's speed, until the motor
     * stops. */
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

    /* Along x: a motor pushes against the limit, which is then moved and removed. */
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

    /* A pendulum: it keeps its distance and swings down. */
    world = make_world(2, 1, -10.0f);
    joint = tied(world, DCD_JOINT_SPHERICAL);
    OK(dcd_joint_create(world, &joint, &id));
    steps(world, 40);
    DcdPose pose = pose_of(world, joint.b);
    NEAR(sqrt(pose.p[0] * pose.p[0] + pose.p[1] * pose.p[1] + pose.p[2] * pose.p[2]), 2.0, 0.02);
    HOLDS(pose.p[1] < -1.0);
    OK(dcd_world_destroy(world));
}

/* Joints that hold by a distance or a stiffness: ropes, springs, servos. */
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
    OK(dcd_joint_set_limit(world, id, DCD_AXIS_Z, shorter)); /* a rope has one limit for all axes */
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
    /* The motor gets another target but no force, and does not turn. */
    motor.position = 1.0f;
    motor.max_force = 0.0f;
    OK(dcd_joint_set_motor(world, id, DCD_AXIS_TURN_X, &motor));
    steps(world, 60);
    NEAR(joint_info(world, id).position, -1.2, 0.02);
    OK(dcd_world_destroy(world));
}

static void generic_joints_free_what_they_are_told(void)
{
    /* Free along y only, between -1 and 1, and driven to both ends. */
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

    /* A cone of 0.5 rad about x, held at the origin: the crate falls until the cone stops it. */
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

    /* A metre longer, then switched off and on again. */
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
            OK(dcd_shape_mesh(world, corners, 4, triangles, 2, false, &def.shape));
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

/* The number of regions of a cubic box that are bounded along y. */
static size_t level_cuts(uint32_t regions, uint32_t axes, float down_x)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 0 };
    DcdRegionInfo all[8];
    size_t count = 0, level = 0;
    def.regions = regions;
    def.axes = axes;
    def.gravity[0] = down_x;
    OK(dcd_world_create(&def, &world));
    OK(dcd_regions(world, all, 8, &count));
    HOLDS(count == regions);
    for (size_t i = 0; i < count; i++) {
        level += isfinite(all[i].min[1]) || isfinite(all[i].max[1]);
    }
    OK(dcd_world_destroy(world));
    return level;
}

/* What a wheel rolls over: 30 by 30 m, flat, and of two triangles, which have an edge in common. */
enum plain { TERRAIN, ONE_SIDED, TWO_SIDED };

/* A wheel rolls over the edge as over a box, but for that of a mesh that bears both sides. */
static void wheels_roll_over_edges(enum plain plain)
{
    const float heights[4] = { 0 };
    const float scale[3] = { 30.0f, 1.0f, 30.0f };
    const float corners[12] = { -15, 0, -15, 15, 0, -15, -15, 0, 15, 15, 0, 15 };
    const uint32_t triangles[6] = { 0, 2, 1, 1, 2, 3 };
    DcdWorld world = make_world(1, 1, -10.0f);
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    def.body_type = DCD_FIXED;
    if (plain == TERRAIN) {
        OK(dcd_shape_heightfield(world, heights, 2, 2, scale, &def.shape));
    } else {
        OK(dcd_shape_mesh(world, corners, 4, triangles, 2, plain == ONE_SIDED, &def.shape));
    }
    add(world, def);
    DcdBodyDef wheel = DCD_BODY_DEF_INIT;
    OK(dcd_shape_cylinder(world, 0.1f, 0.5f, &wheel.shape));
    /* Its axis lies along z. It meets the edge at x = 5, after 20 ticks. */
    wheel.pose.p[0] = 4.0;
    wheel.pose.p[1] = 0.5;
    wheel.pose.p[2] = -5.0;
    wheel.pose.q[0] = wheel.pose.q[3] = 0.70710678f;
    wheel.velocity.linear[0] = 3.0f;
    wheel.velocity.angular[2] = -6.0f;
    wheel.flags = DCD_BODY_FAST_SPIN;
    DcdBodyId rolls = add(world, wheel);
    steps(world, 60);
    NEAR(velocity_of(world, rolls).linear[0], 3.0, plain == TWO_SIDED ? 0.1 : 0.02);
    NEAR(pose_of(world, rolls).p[1], 0.5, 0.01);
    /* What comes from below passes if the mesh is one-sided. */
    if (plain != TERRAIN) {
        DcdBodyDef ball = DCD_BODY_DEF_INIT;
        OK(dcd_shape_sphere(world, 0.2f, &ball.shape));
        ball.pose.p[1] = -3.0;
        ball.velocity.linear[1] = 20.0f;
        DcdBodyId rises = add(world, ball);
        steps(world, 20);
        HOLDS((pose_of(world, rises).p[1] > 0) == (plain == ONE_SIDED));
    }
    OK(dcd_world_destroy(world));
}

static void worlds_are_cut_where_planes_say(void)
{
    const DcdCut planes[2] = { { 1.5, DCD_CUT_Y, 0 }, { -0.25, DCD_CUT_X, 0 } };
    const char *params[1] = { "n=3" };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld worlds[2];
    def.cuts = planes;
    def.cut_count = 2;
    OK(dcd_world_create(&def, &worlds[0]));
    OK(dcd_world_open_scene("tower", params, 1, &def, &worlds[1]));
    for (int k = 0; k < 2; k++) {
        DcdRegionInfo all[8];
        size_t count = 0, level = 0, upright = 0;
        OK(dcd_regions(worlds[k], all, 8, &count));
        HOLDS(count == 4);
        for (size_t i = 0; i < count; i++) {
            level += all[i].min[1] == 1.5 || all[i].max[1] == 1.5;
            upright += all[i].min[0] == -0.25 || all[i].max[0] == -0.25;
            HOLDS(isinf(all[i].min[2]) && isinf(all[i].max[2]));
        }
        HOLDS(level == 4 && upright == 4);
        OK(dcd_world_destroy(worlds[k]));
    }
}

static void worlds_are_cut_upright_unless_told_otherwise(void)
{
    HOLDS(level_cuts(4, 0, 0.0f) == 0);
    HOLDS(level_cuts(8, 0, 0.0f) == 0);
    HOLDS(level_cuts(4, DCD_CUT_Y, 0.0f) == 4);
    HOLDS(level_cuts(8, DCD_CUT_X | DCD_CUT_Y | DCD_CUT_Z, 0.0f) == 8);
    HOLDS(level_cuts(4, 0, 20.0f) == 4); /* down is along x */
}

static void speed_has_a_limit_that_is_named(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyDef fast = crate(world, 0.0, 0.0);
    DcdBodyId body = { 0 };
    fast.velocity.linear[1] = 401.0f;
    FAILS(dcd_body_create(world, &fast, &body), DCD_ERR_ARGUMENT, "401 m/s");
    fast.velocity.linear[1] = 400.0f;
    body = add(world, fast);
    fast.velocity.linear[1] = 500.0f;
    FAILS(dcd_body_set_velocity(world, body, &fast.velocity), DCD_ERR_ARGUMENT, "speed limit");
    OK(dcd_world_destroy(world));

    def.gravity[1] = 0.0f;
    def.speed_limit = 1000.0f;
    OK(dcd_world_create(&def, &world));
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(world, &info));
    HOLDS(info.speed_limit == 1000.0f);
    fast.shape = box(world, 0.5f, 0.5f, 0.5f);
    body = add(world, fast);
    steps(world, 60);
    NEAR(pose_of(world, body).p[1], 500.0, 0.1);
    const float kick[3] = { 0.0f, 2.0e6f, 0.0f };
    OK(dcd_body_apply_impulse(world, body, kick, NULL));
    steps(world, 1);
    NEAR(velocity_of(world, body).linear[1], 1000.0, 0.1);
    OK(dcd_world_destroy(world));
}

static void what_has_no_mass_does_not_hang_in_the_air(void)
{
    const float heights[4] = { 0.0f, 0.0f, 0.0f, 0.0f }, scale[3] = { 2.0f, 1.0f, 2.0f };
    const float corners[12] = { -1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1 };
    const uint32_t triangles[6] = { 0, 1, 2, 0, 2, 3 };
    for (int kind = 0; kind < 2; kind++) {
        DcdWorld world = make_world(2, 1, -10.0f);
        DcdBodyDef def = DCD_BODY_DEF_INIT;
        DcdBodyId body = { 0 };
        if (kind == 0) {
            OK(dcd_shape_heightfield(world, heights, 2, 2, scale, &def.shape));
        } else {
            OK(dcd_shape_mesh(world, corners, 4, triangles, 2, false, &def.shape));
        }
        FAILS(dcd_body_create(world, &def, &body), DCD_ERR_ARGUMENT, "no mass");
        def.body_type = DCD_KINEMATIC;
        body = add(world, def);
        DcdBodyProperties as = properties_of(world, body);
        as.body_type = DCD_DYNAMIC;
        FAILS(dcd_body_set_properties(world, body, &as), DCD_ERR_ARGUMENT, "no mass");
        HOLDS(info_of(world, body).body_type == DCD_KINEMATIC);
        def.body_type = DCD_DYNAMIC;
        def.mass = 5.0f;
        def.pose.p[0] = 10.0;
        DcdBodyId falls = add(world, def);
        NEAR(info_of(world, falls).mass, 5.0, 1e-3);
        steps(world, 60);
        NEAR(pose_of(world, falls).p[1], -5.0, 0.2);
        OK(dcd_world_destroy(world));
    }

    /* Nor does a body that has lost all its extra mass. */
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef def = crate(world, 0.0, 10.0);
    def.density = 0.0f;
    def.extra_mass = 5.0f;
    DcdBodyId falls = add(world, def);
    def.body_type = DCD_KINEMATIC;
    def.pose.p[0] = 10.0;
    DcdBodyId stays = add(world, def);
    steps(world, 1);
    DcdBodyProperties as = properties_of(world, stays);
    as.body_type = DCD_DYNAMIC;
    as.extra_mass = 0.0f;
    FAILS(dcd_body_set_properties(world, stays, &as), DCD_ERR_ARGUMENT, "no mass");
    HOLDS(info_of(world, stays).body_type == DCD_KINEMATIC && properties_of(world, stays).extra_mass == 5.0f);
    FAILS(dcd_body_set_properties(world, falls, &as), DCD_ERR_ARGUMENT, "no mass");
    as.body_type = DCD_KINEMATIC;
    OK(dcd_body_set_properties(world, stays, &as));
    as.body_type = DCD_DYNAMIC;
    FAILS(dcd_body_set_properties(world, stays, &as), DCD_ERR_ARGUMENT, "no mass");
    as.extra_mass = 5.0f;
    OK(dcd_body_set_properties(world, stays, &as));
    steps(world, 60);
    NEAR(velocity_of(world, stays).linear[1], -10.0, 0.2);
    OK(dcd_world_destroy(world));
}

/* If one of several bodies is refused, none of them is created. */
static void several_bodies_come_all_or_none(void)
{
    const float corners[12] = { -1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1 };
    const uint32_t triangles[6] = { 0, 1, 2, 0, 2, 3 };
    DcdWorld world = make_world(2, 1, -10.0f);
    DcdBodyDef defs[2] = { crate(world, -5.0, 10.0), crate(world, 5.0, 10.0) };
    DcdBodyId made[2] = { { 7 }, { 7 } }, found;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_shape_mesh(world, corners, 4, triangles, 2, false, &defs[1].shape));
    FAILS(dcd_bodies_create(world, defs, 2, made), DCD_ERR_ARGUMENT, "no mass");
    HOLDS(made[0].v == 7 && made[1].v == 7);
    const DcdBodyId next = add(world, defs[0]);
    OK(dcd_body_at(world, 0, &found));
    HOLDS(found.v == next.v);
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 1);
    steps(world, 60);
    NEAR(velocity_of(world, next).linear[1], -10.0, 0.2);
    /* Without a call of dcd_view_time, a body is shown as it is. */
    DcdPose shown;
    OK(dcd_view_body(world, next, 75.0, &shown, NULL));
    HOLDS(shown.p[1] == pose_of(world, next).p[1]);
    OK(dcd_world_destroy(world));
}

/* A leg of a model lies across its axes. Whatever is changed of its mass, the axes of its inertia stay. */
static void a_part_of_a_model_keeps_its_axes(const char *path)
{
    char name[600];
    DcdWorld world = { 0 };
    DcdBodyId all[8], leg = { 0 };
    size_t count = 0;
    DcdBodyExtent before = DCD_BODY_EXTENT_INIT, after = DCD_BODY_EXTENT_INIT;
    snprintf(name, sizeof name, "%s.leg.xml", path);
    FILE *file = fopen(name, "w");
    HOLDS(file != NULL);
    if (file == NULL) {
        return;
    }
    fputs("<mujoco><worldbody><body name='leg' pos='0 0 5'><freejoint/>"
          "<geom type='capsule' fromto='0 0 0 0.4 0.4 0' size='0.08' density='1000'/></body></worldbody></mujoco>",
          file);
    fclose(file);
    OK(dcd_world_open_scene(name, NULL, 0, NULL, &world));
    OK(dcd_bodies(world, all, 8, &count));
    for (size_t i = 0; i < count; i++) {
        if (properties_of(world, all[i]).body_type == DCD_DYNAMIC) {
            leg = all[i];
        }
    }
    OK(dcd_body_extent(world, leg, &before));
    HOLDS(before.mass > 1.0f && fabsf(before.axes[3]) < 0.99f);
    for (int changed = 0; changed < 3; changed++) {
        DcdBodyProperties as = properties_of(world, leg);
        as.extra_mass *= 2.0f;
        if (changed == 1) {
            as.extra_centre[0] += 0.1f;
        }
        for (int axis = 0; axis < 3 && changed == 2; axis++) {
            as.extra_inertia[axis] *= 2.0f;
        }
        OK(dcd_body_set_properties(world, leg, &as));
        OK(dcd_body_extent(world, leg, &after));
        NEAR(after.mass, 2.0f * before.mass, 1e-3);
        for (int axis = 0; axis < 4; axis++) {
            NEAR(after.axes[axis], before.axes[axis], 1e-5);
        }
        for (int axis = 0; axis < 3; axis++) {
            NEAR(after.inertia[axis], before.inertia[axis] * (changed == 2 ? 2.0f : 1.0f), 1e-4);
        }
        before = after;
    }
    /* Without that mass the body has only its own axes, and it may be given another mass about them. */
    DcdBodyProperties as = properties_of(world, leg);
    as.body_type = DCD_KINEMATIC;
    as.extra_mass = 0.0f;
    memset(as.extra_centre, 0, sizeof as.extra_centre);
    memset(as.extra_inertia, 0, sizeof as.extra_inertia);
    OK(dcd_body_set_properties(world, leg, &as));
    as.body_type = DCD_DYNAMIC;
    as.extra_mass = 4.0f;
    as.extra_inertia[0] = 1.0f;
    as.extra_inertia[1] = 2.0f;
    as.extra_inertia[2] = 3.0f;
    OK(dcd_body_set_properties(world, leg, &as));
    OK(dcd_body_extent(world, leg, &after));
    const float x = after.axes[0], y = after.axes[1], z = after.axes[2], w = after.axes[3];
    const float east[3] = { 1.0f - 2.0f * (y * y + z * z), 2.0f * (x * y - w * z), 2.0f * (x * z + w * y) };
    float about_x = 0.0f;
    for (int axis = 0; axis < 3; axis++) {
        about_x += east[axis] * east[axis] * after.inertia[axis];
    }
    NEAR(about_x, 1.0, 1e-4);
    OK(dcd_world_destroy(world));
}

static void a_destroyed_sensor_ends_its_contacts_as_a_sensor(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyDef def = crate(world, 0.0, 0.0);
    add(world, def);
    def.flags = DCD_BODY_SENSOR;
    def.body_type = DCD_KINEMATIC;
    def.events = DCD_EVENT_CONTACT;
    DcdBodyId zone = add(world, def);
    HOLDS(next_contact(world, DCD_CONTACT_BEGAN).flags == DCD_CONTACT_SENSOR);
    OK(dcd_body_destroy(world, zone));
    HOLDS(next_contact(world, DCD_CONTACT_ENDED).flags == DCD_CONTACT_SENSOR);
    OK(dcd_world_destroy(world));
}

static void casts_name_the_triangle_of_terrain_that_rays_do(void)
{
    const float heights[12] = { 0.0f, 0.1f, 0.3f, 0.0f, 0.2f, -0.1f, 0.4f, 0.0f, 0.1f, 0.0f, 0.3f, 0.2f };
    const float scale[3] = { 12.0f, 1.0f, 12.0f };
    DcdWorld world = make_world(4, 1, 0.0f);
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    def.body_type = DCD_FIXED;
    def.pose.p[0] = 1.0;
    OK(dcd_shape_heightfield(world, heights, 3, 4, scale, &def.shape));
    add(world, def);
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    DcdRay ray = DCD_RAY_INIT;
    OK(dcd_shape_sphere(world, 0.05f, &cast.shape));
    cast.motion[1] = -20.0f;
    ray.direction[1] = -1.0f;
    uint32_t seen = 0;
    for (int i = 0; i < 12; i++) {
        DcdRayHit below;
        DcdShapeHit met;
        ray.origin[0] = cast.pose.p[0] = -4.0 + 3.0 * (i % 4) + 0.3;
        ray.origin[2] = cast.pose.p[2] = -4.5 + 4.0 * (double)(i / 4);
        ray.origin[1] = cast.pose.p[1] = 5.0;
        OK(dcd_cast_rays(world, &ray, 1, NULL, &below));
        cast.turn[1] = i % 2 == 0 ? 0.0f : 0.1f;
        OK(dcd_cast_shapes(world, &cast, 1, NULL, &met));
        HOLDS(below.body.v != 0 && met.body.v == below.body.v && met.subshape == below.subshape);
        seen |= 1u << met.subshape;
    }
    HOLDS((seen & (seen - 1)) != 0 && seen != 1);
    OK(dcd_world_destroy(world));
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

/* What a program keeps of bodies, by slot: the body, and the number of the view that had it last. */
enum { SLOTS = 16 };
typedef struct Kept {
    DcdBodyId ids[SLOTS];
    unsigned seen[SLOTS];
    unsigned views;
} Kept;

/* Takes in a view. No two bodies share a slot, and no slot goes from one body to another between two
 * successive views. */
static void keep(const DcdStateView *view, Kept *kept)
{
    kept->views++;
    HOLDS(view->slot_count >= view->count && view->slot_count <= SLOTS);
    for (size_t i = 0; i < view->count; i++) {
        const uint32_t slot = view->slots[i];
        HOLDS(slot < view->slot_count && kept->seen[slot] < kept->views);
        HOLDS(kept->ids[slot].v == view->ids[i].v || kept->ids[slot].v == 0 || kept->seen[slot] + 1 < kept->views);
        kept->ids[slot] = view->ids[i];
        kept->seen[slot] = kept->views;
    }
}

static uint32_t slot_of(const DcdStateView *view, DcdBodyId body)
{
    for (size_t i = 0; i < view->count; i++) {
        if (view->ids[i].v == body.v) {
            return view->slots[i];
        }
    }
    return UINT32_MAX;
}

static void a_body_keeps_its_slot_in_all_views(void)
{
    DcdWorld world = make_world(2, 2, 0.0f);
    DcdStateView view = DCD_STATE_VIEW_INIT, shown = DCD_STATE_VIEW_INIT;
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdBodyId bodies[8];
    Kept kept = { { { 0 } }, { 0 }, 0 };
    add_floor(world); /* does not move, so it has no slot */
    for (int i = 0; i < 8; i++) {
        bodies[i] = add(world, crate(world, 4.0 * i - 14.0, 3.0));
    }
    OK(dcd_state_view(world, &view));
    for (uint32_t i = 0; i < 8; i++) {
        HOLDS(view.slots[i] == i);
    }
    keep(&view, &kept);

    /* In each round a body goes and another comes, with or without a view in between. The third body stays,
     * and so does its slot. */
    const DcdBodyId stays = bodies[2];
    for (int round = 0; round < 24; round++) {
        DcdBodyId *gone = &bodies[round % 8];
        if (gone->v != stays.v) {
            OK(dcd_body_destroy(world, *gone));
            if (round % 3 == 0) {
                steps(world, 1); /* a view without it */
                OK(dcd_state_view(world, &view));
                keep(&view, &kept);
                HOLDS(view.count == 7);
            }
            *gone = add(world, crate(world, 4.0 * (round % 8) - 14.0, 6.0 + 2.0 * round));
        }
        steps(world, 1);
        OK(dcd_state_view(world, &view));
        keep(&view, &kept);
        HOLDS(view.count == 8 && slot_of(&view, stays) == 2);
        /* The other kind of view has the same slots. */
        OK(dcd_view_time(world, &time));
        OK(dcd_view_state(world, &time, &shown));
        keep(&shown, &kept);
        for (size_t i = 0; i < shown.count; i++) {
            HOLDS(shown.slots[i] == slot_of(&view, shown.ids[i]));
        }
    }
    HOLDS(view.slot_count == 9); /* eight bodies, and one slot that is not free before a view without its body */
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

/* Two crates in a row hit a third at the border of two regions, under each coupling. */
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

/* A fixed crate at x = 0, a dynamic one at 3, a sensor at 6, a kinematic one at 9; two regions meet at 0. */
enum { WALL, CRATE, GATE, DOOR, ROW };

static void lay_out(DcdWorld world, DcdBodyId row[ROW])
{
    for (int i = 0; i < ROW; i++) {
        DcdBodyDef def = crate(world, 3.0 * i, 0.0);
        def.body_type = i == WALL ? DCD_FIXED : i == DOOR ? DCD_KINEMATIC : DCD_DYNAMIC;
        def.flags = i == GATE ? DCD_BODY_SENSOR : 0;
        def.groups = 1u << i;
        def.user_data = 100u + (uint64_t)i;
        row[i] = add(world, def);
    }
}

/* The bodies that a query's function has seen, and how it answers. */
typedef struct Seen {
    uint32_t bodies; /* bit i: body 100 + i */
    int calls, limit;
    bool nearer_only;
} Seen;

static float note_hit(void *context, const DcdRayHit *hit)
{
    Seen *seen = context;
    seen->bodies |= 1u << (hit->user_data - 100);
    seen->calls++;
    return seen->calls == seen->limit ? 0.0f : seen->nearer_only ? hit->distance : INFINITY;
}

static float note_cast(void *context, const DcdShapeHit *hit)
{
    Seen *seen = context;
    seen->bodies |= 1u << (hit->user_data - 100);
    seen->calls++;
    return seen->calls == seen->limit ? 0.0f : seen->nearer_only ? hit->fraction : 1.0f;
}

static bool note_overlap(void *context, const DcdOverlap *found)
{
    Seen *seen = context;
    seen->bodies |= 1u << (found->user_data - 100);
    seen->calls++;
    return seen->calls != seen->limit;
}

static void a_query_calls_until_its_function_has_enough(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyId row[ROW];
    DcdRay ray = DCD_RAY_INIT;
    DcdFilter filter = DCD_FILTER_INIT;
    DcdBoxQuery box = DCD_BOX_QUERY_INIT;
    DcdShapeQuery ball = DCD_SHAPE_QUERY_INIT;
    DcdShapeCast rod = DCD_SHAPE_CAST_INIT;
    const uint32_t all = (1u << ROW) - 1;
    lay_out(world, row);
    ray.origin[0] = -5.0;
    ray.direction[0] = 1.0f;
    OK(dcd_shape_capsule(world, 0.25f, 0.25f, &rod.shape));
    rod.pose.p[0] = -5.0;
    rod.motion[0] = 20.0f;
    for (int limit = 0; limit <= ROW; limit++) {
        Seen casts = { .limit = limit };
        Seen hits = { .limit = limit }, boxes = { .limit = limit }, balls = { .limit = limit };
        const int expected = limit == 0 ? ROW : limit;
        OK(dcd_cast_ray_each(world, &ray, NULL, note_hit, &hits));
        OK(dcd_cast_shape_each(world, &rod, NULL, note_cast, &casts));
        box.min[0] = -100.0;
        box.min[1] = box.min[2] = -1.0;
        box.max[0] = 100.0;
        box.max[1] = box.max[2] = 1.0;
        OK(dcd_overlap_box_each(world, &box, NULL, note_overlap, &boxes));
        if (ball.shape.v == 0)
            OK(dcd_shape_sphere(world, 100.0f, &ball.shape));
        OK(dcd_overlap_shape_each(world, &ball, NULL, note_overlap, &balls));
        HOLDS(hits.calls == expected && boxes.calls == expected && balls.calls == expected);
        HOLDS(casts.calls == expected && (limit != 0 || casts.bodies == all));
        HOLDS(limit != 0 || (hits.bodies == all && boxes.bodies == all && balls.bodies == all));
    }
    Seen nearest = { .nearer_only = true };
    OK(dcd_cast_ray_each(world, &ray, NULL, note_hit, &nearest));
    HOLDS(nearest.bodies & 1u << WALL);
    ray.origin[0] = 20.0;
    ray.direction[0] = -1.0f;
    ray.max_distance = 14.0f;
    Seen back = { 0 };
    OK(dcd_cast_ray_each(world, &ray, NULL, note_hit, &back));
    HOLDS(back.bodies == (1u << DOOR | 1u << GATE));
    filter.flags = DCD_FILTER_NO_SENSORS;
    Seen filtered = { 0 };
    OK(dcd_cast_ray_each(world, &ray, &filter, note_hit, &filtered));
    HOLDS(filtered.bodies == 1u << DOOR);
    Seen first = { .nearer_only = true }, short_of = { 0 }, solid = { 0 };
    OK(dcd_cast_shape_each(world, &rod, NULL, note_cast, &first));
    HOLDS(first.bodies & 1u << WALL);
    rod.pose.p[0] = 20.0;
    rod.motion[0] = -14.0f;
    OK(dcd_cast_shape_each(world, &rod, NULL, note_cast, &short_of));
    HOLDS(short_of.bodies == (1u << DOOR | 1u << GATE));
    OK(dcd_cast_shape_each(world, &rod, &filter, note_cast, &solid));
    HOLDS(solid.bodies == 1u << DOOR);
    OK(dcd_world_destroy(world));
}

static void rays_meet_what_the_filter_lets_through(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyId row[ROW];
    DcdRayHit hits[8];
    size_t ends[3], total = 0;
    DcdRay rays[3] = { DCD_RAY_INIT, DCD_RAY_INIT, DCD_RAY_INIT };
    lay_out(world, row); /* no step is needed */
    rays[0].origin[0] = -5.0; /* along the row */
    rays[0].direction[0] = 2.0f;
    rays[1].origin[0] = 20.0; /* and back, not past the gate */
    rays[1].direction[0] = -1.0f;
    rays[1].max_distance = 14.0f;
    rays[2].origin[1] = 5.0; /* above all bodies */
    rays[2].direction[0] = 1.0f;
    OK(dcd_cast_rays(world, rays, 3, NULL, hits));
    HOLDS(hits[0].body.v == row[WALL].v && hits[0].user_data == 100 && hits[0].collider == 0 && hits[0].normal[0] == -1.0f);
    NEAR(hits[0].distance, 4.5, 1e-4);
    NEAR(hits[0].point[0], -0.5, 1e-4);
    HOLDS(hits[1].body.v == row[DOOR].v && hits[2].body.v == 0);

    OK(dcd_cast_rays_all(world, rays, 3, NULL, hits, 8, ends, &total));
    HOLDS(total == 6 && ends[0] == 4 && ends[1] == 6 && ends[2] == 6);
    for (int i = 0; i < ROW; i++) {
        HOLDS(hits[i].body.v == row[i].v && hits[i].user_data == 100u + (uint64_t)i);
        NEAR(hits[i].distance, 4.5 + 3.0 * i, 1e-4);
    }
    HOLDS(hits[4].body.v == row[DOOR].v && hits[5].body.v == row[GATE].v);

    /* Each way to filter bodies out. */
    const struct Case {
        uint32_t flags, mask, left;
    } cases[] = {
        { DCD_FILTER_NO_FIXED, 0xFFFFFFFFu, 1u << CRATE | 1u << GATE | 1u << DOOR },
        { DCD_FILTER_NO_DYNAMIC, 0xFFFFFFFFu, 1u << WALL | 1u << DOOR },
        { DCD_FILTER_NO_KINEMATIC, 0xFFFFFFFFu, 1u << WALL | 1u << CRATE | 1u << GATE },
        { DCD_FILTER_NO_SENSORS, 0xFFFFFFFFu, 1u << WALL | 1u << CRATE | 1u << DOOR },
        { DCD_FILTER_NO_SOLIDS, 0xFFFFFFFFu, 1u << GATE },
        { 0, 1u << DOOR | 1u << CRATE, 1u << CRATE | 1u << DOOR },
        { DCD_FILTER_NO_DYNAMIC, 1u << DOOR | 1u << CRATE, 1u << DOOR },
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        DcdFilter filter = DCD_FILTER_INIT;
        uint32_t seen = 0;
        filter.flags = cases[k].flags;
        filter.mask = cases[k].mask;
        OK(dcd_cast_rays_all(world, rays, 1, &filter, hits, 8, ends, &total));
        for (size_t i = 0; i < total; i++) {
            seen |= 1u << (hits[i].user_data - 100);
        }
        HOLDS(seen == cases[k].left);
    }
    DcdFilter filter = DCD_FILTER_INIT;
    const DcdBodyId out[2] = { row[GATE], row[WALL] };
    filter.exclude = out;
    filter.exclude_count = 2;
    rays[0].exclude = row[CRATE];
    OK(dcd_cast_rays_all(world, rays, 1, &filter, hits, 8, ends, &total));
    HOLDS(total == 1 && hits[0].body.v == row[DOOR].v);
    rays[0].mask = 1u << WALL;
    OK(dcd_cast_rays_all(world, rays, 1, &filter, hits, 8, ends, &total));
    HOLDS(total == 0 && ends[0] == 0);

    /* A query of group 2 meets the bodies whose mask has group 2. */
    OK(dcd_body_set_groups(world, row[WALL], 0, 1, 1));
    rays[0].mask = 0xFFFFFFFFu;
    rays[0].exclude.v = 0;
    filter = (DcdFilter)DCD_FILTER_INIT;
    filter.groups = 2;
    OK(dcd_cast_rays(world, rays, 1, &filter, hits));
    HOLDS(hits[0].body.v == row[CRATE].v);

    /* From inside of the wall: a hit at once, or on the way out. */
    rays[0].origin[0] = 0.25;
    OK(dcd_cast_rays(world, rays, 1, NULL, hits));
    HOLDS(hits[0].body.v == row[WALL].v && hits[0].distance == 0.0f && hits[0].normal[0] == 0.0f);
    rays[0].flags = DCD_QUERY_HOLLOW;
    OK(dcd_cast_rays(world, rays, 1, NULL, hits));
    HOLDS(hits[0].body.v == row[WALL].v);
    NEAR(hits[0].distance, 0.25, 1e-4);
    OK(dcd_world_destroy(world));
}

static void shapes_and_points_find_bodies(void)
{
    DcdWorld world = make_world(2, 1, 0.0f);
    DcdBodyId row[ROW];
    lay_out(world, row);
    DcdShapeId ball = { 0 }, plank = box(world, 3.0f, 0.1f, 0.1f);
    OK(dcd_shape_sphere(world, 0.5f, &ball));

    /* A ball moves against the row, one stays short of it, one has a margin, one starts inside and leaves,
     * and a plank turns into the row. */
    DcdShapeCast casts[5] = { DCD_SHAPE_CAST_INIT, DCD_SHAPE_CAST_INIT, DCD_SHAPE_CAST_INIT, DCD_SHAPE_CAST_INIT,
                              DCD_SHAPE_CAST_INIT };
    DcdShapeHit hits[5];
    for (int i = 0; i < 5; i++) {
        casts[i].shape = ball;
        casts[i].pose.p[0] = -6.0;
        casts[i].motion[0] = 10.0f;
    }
    casts[1].motion[0] = 4.0f;
    casts[2].margin = 0.5f;
    casts[3].pose.p[0] = -0.25;
    casts[3].motion[0] = -1.0f;
    casts[3].flags = DCD_QUERY_LEAVE;
    casts[4].shape = plank;
    casts[4].pose.p[0] = -1.0;
    casts[4].pose.p[1] = 2.0;
    casts[4].motion[0] = 0.0f;
    casts[4].turn[2] = -3.0f; /* clockwise, its right end down */
    OK(dcd_cast_shapes(world, casts, 5, NULL, hits));
    HOLDS(hits[0].body.v == row[WALL].v && hits[0].user_data == 100 && hits[0].flags == 0);
    NEAR(hits[0].fraction, 0.5, 1e-3);
    NEAR(hits[0].point[0], -0.5, 1e-3);
    NEAR(hits[0].normal[0], -1.0, 1e-3);
    NEAR(hits[0].point_on_shape[0], 0.5, 1e-3);
    NEAR(hits[0].normal_on_shape[0], 1.0, 1e-3);
    HOLDS(hits[1].body.v == 0 && hits[1].fraction == 0.0f);
    NEAR(hits[2].fraction, 0.45, 1e-3);
    HOLDS(hits[3].body.v == 0);
    casts[3].flags = 0;
    OK(dcd_cast_shapes(world, &casts[3], 1, NULL, &hits[3]));
    HOLDS(hits[3].body.v == row[WALL].v && hits[3].fraction == 0.0f && hits[3].flags == DCD_HIT_INSIDE);
    HOLDS(hits[4].body.v == row[WALL].v && hits[4].fraction > 0.1f && hits[4].fraction < 0.9f);
    casts[4].turn[2] = 0.0f;
    OK(dcd_cast_shapes(world, &casts[4], 1, NULL, &hits[4]));
    HOLDS(hits[4].body.v == 0);

    /* The bodies that a blast reaches, a point lies in, a box touches. */
    DcdOverlap found[8];
    size_t ends[3], total = 0;
    DcdShapeQuery blasts[2] = { DCD_SHAPE_QUERY_INIT, DCD_SHAPE_QUERY_INIT };
    blasts[0].shape = plank;
    blasts[0].pose.p[0] = 3.0;
    blasts[1].shape = ball;
    blasts[1].pose.p[1] = 4.0;
    OK(dcd_overlap_shapes(world, blasts, 2, NULL, found, 8, ends, &total));
    HOLDS(total == 3 && ends[0] == 3 && ends[1] == 3);
    HOLDS(found[0].body.v == row[WALL].v && found[1].body.v == row[CRATE].v && found[2].body.v == row[GATE].v);
    HOLDS(found[2].user_data == 102 && found[2].collider == 0);
    blasts[0].exclude = row[CRATE];
    DcdFilter filter = DCD_FILTER_INIT;
    filter.flags = DCD_FILTER_NO_SENSORS;
    OK(dcd_overlap_shapes(world, blasts, 1, &filter, found, 8, ends, &total));
    HOLDS(total == 1 && found[0].body.v == row[WALL].v);

    DcdPointQuery points[2] = { DCD_POINT_QUERY_INIT, DCD_POINT_QUERY_INIT };
    points[0].point[0] = 3.25;
    points[1].point[0] = 4.0;
    OK(dcd_overlap_points(world, points, 2, NULL, found, 8, ends, &total));
    HOLDS(total == 1 && ends[0] == 1 && ends[1] == 1 && found[0].body.v == row[CRATE].v);
    DcdBoxQuery boxes[2] = { DCD_BOX_QUERY_INIT, DCD_BOX_QUERY_INIT };
    for (int axis = 0; axis < 3; axis++) {
        boxes[0].min[axis] = -INFINITY;
        boxes[0].max[axis] = INFINITY;
        boxes[1].min[axis] = -1.0;
        boxes[1].max[axis] = 1.0;
    }
    boxes[0].mask = 1u << DOOR | 1u << GATE;
    OK(dcd_overlap_boxes(world, boxes, 2, NULL, found, 8, ends, &total));
    HOLDS(total == 3 && ends[0] == 2 && found[0].body.v == row[GATE].v && found[1].body.v == row[DOOR].v);
    HOLDS(found[2].body.v == row[WALL].v);

    /* The nearest point: of the crate from inside and outside, then of no body within reach. */
    DcdPointHit nearest[2];
    points[1].point[0] = 4.5;
    points[1].exclude = row[GATE];
    OK(dcd_project_points(world, points, 2, NULL, nearest));
    HOLDS(nearest[0].body.v == row[CRATE].v && nearest[0].flags == DCD_HIT_INSIDE && nearest[0].distance == 0.0f);
    HOLDS(nearest[1].body.v == row[CRATE].v && nearest[1].flags == 0 && nearest[1].user_data == 101);
    NEAR(nearest[1].point[0], 3.5, 1e-4);
    NEAR(nearest[1].distance, 1.0, 1e-4);
    points[0].flags = DCD_QUERY_HOLLOW;
    points[1].max_distance = 0.9f;
    OK(dcd_project_points(world, points, 2, NULL, nearest));
    NEAR(nearest[0].distance, 0.25, 1e-4);
    HOLDS(nearest[0].flags == DCD_HIT_INSIDE && nearest[1].body.v == 0);
    OK(dcd_world_destroy(world));
}

static uint64_t hash_of(DcdWorld world)
{
    uint64_t hash = 0;
    OK(dcd_state_hash(world, &hash));
    return hash;
}

static uint64_t tick_of(DcdWorld world)
{
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(world, &info));
    return info.tick;
}

/* What a game with rollback does: it keeps the last ticks, goes back and computes them again. */
static void ticks_are_computed_again(void)
{
    enum { KEPT = 8, TICKS = 40 };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    const char *params[] = { "n=60" };
    DcdWorld world = { 0 };
    DcdCheckpointId kept[KEPT];
    uint64_t hashes[TICKS];
    DcdStateView view = DCD_STATE_VIEW_INIT;
    def.regions = 3;
    OK(dcd_world_open_scene("pile", params, 1, &def, &world));
    for (int i = 0; i < KEPT; i++) {
        OK(dcd_checkpoint_create(world, &kept[i]));
    }
    for (int tick = 0; tick < TICKS; tick++) {
        hashes[tick] = hash_of(world);
        OK(dcd_checkpoint_save(world, kept[tick % KEPT]));
        if (tick % 10 == 5) {
            add(world, crate(world, 0.0, 20.0)); /* after the checkpoint: it is gone when that is restored */
        }
        OK(dcd_step(world));
    }
    uint64_t end = hash_of(world);
    for (int turn = 0; turn < 2; turn++) {
        OK(dcd_checkpoint_restore(world, kept[(TICKS - KEPT) % KEPT]));
        OK(dcd_state_view(world, &view));
        HOLDS(tick_of(world) == TICKS - KEPT && view.tick == TICKS - KEPT);
        for (int tick = TICKS - KEPT; tick < TICKS; tick++) {
            HOLDS(hash_of(world) == hashes[tick]);
            OK(dcd_checkpoint_save(world, kept[tick % KEPT]));
            if (tick % 10 == 5) {
                add(world, crate(world, 0.0, 20.0));
            }
            OK(dcd_step(world));
        }
        HOLDS(hash_of(world) == end);
    }
    OK(dcd_checkpoint_destroy(world, kept[0]));
    OK(dcd_world_destroy(world)); /* and the other checkpoints with it */
}

static DcdContact ended_last(DcdWorld world)
{
    DcdContact none = { 0 };
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    none.kind = 99;
    OK(dcd_events(world, &events));
    return events.contact_count == 1 && events.contacts[0].kind == DCD_CONTACT_ENDED ? events.contacts[0] : none;
}

static DcdContact began_last(DcdWorld world)
{
    DcdContact none = { 0 };
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    none.kind = 99;
    OK(dcd_events(world, &events));
    return events.contact_count == 1 && events.contacts[0].kind == DCD_CONTACT_BEGAN ? events.contacts[0] : none;
}

/* After a checkpoint is restored, the events of the last step are told as they were then, even of a collider
 * that was gone when the checkpoint was made. */
static void a_collider_that_is_gone_is_known_again(void)
{
    DcdWorld world = make_world(1, 1, -10.0f);
    DcdCheckpointId kept = { 0 };
    DcdColliderProperties foot = DCD_COLLIDER_PROPERTIES_INIT;
    DcdBodyDef def = crate(world, 0.0, 1.5);
    add_floor(world);
    def.material = 101;
    def.events = DCD_EVENT_CONTACT;
    DcdBodyId body = add(world, def);
    foot.frame.p[1] = -0.9f;
    foot.user_data = 102;
    OK(dcd_collider_add(world, body, box(world, 0.2f, 0.2f, 0.2f), &foot, NULL));
    OK(dcd_body_set_events(world, body, 1, DCD_EVENT_CONTACT, 0.0f));
    DcdContact contact = next_contact(world, DCD_CONTACT_BEGAN);
    HOLDS(contact.collider_b == 1 && contact.material_b == 102);
    OK(dcd_collider_remove(world, body, 0));
    OK(dcd_checkpoint_create(world, &kept));
    OK(dcd_step(world));
    OK(dcd_checkpoint_restore(world, kept));
    HOLDS(began_last(world).collider_b == 1 && began_last(world).material_b == 102);
    OK(dcd_world_destroy(world));
}

/* The user data of a destroyed body come back with a checkpoint made before or after the step that tells of
 * its end. A snapshot does not hold them, and does not take over those of the world that it is loaded into.
 * */
static void who_is_gone_is_known_again(void)
{
    DcdWorld world = make_world(1, 1, -10.0f), other = make_world(1, 1, -10.0f);
    DcdCheckpointId before = { 0 }, after = { 0 };
    DcdBodyDef def = crate(world, 0.0, 0.5);
    add_floor(world);
    def.user_data = 7;
    def.events = DCD_EVENT_CONTACT;
    DcdBodyId body = add(world, def);
    HOLDS(next_contact(world, DCD_CONTACT_BEGAN).user_b == 7);
    OK(dcd_body_destroy(world, body));
    OK(dcd_checkpoint_create(world, &before));
    OK(dcd_step(world));
    HOLDS(ended_last(world).user_b == 7 && ended_last(world).b.v == body.v);
    OK(dcd_checkpoint_create(world, &after));
    size_t size = 0;
    HOLDS(dcd_snapshot_save(world, NULL, 0, &size) == DCD_OK);
    unsigned char *saved = malloc(size);
    OK(dcd_snapshot_save(world, saved, size, &size));
    def = crate(other, 0.0, 0.5);
    add_floor(other);
    def.user_data = 77;
    OK(dcd_body_destroy(other, add(other, def)));
    OK(dcd_snapshot_load(other, saved, size));
    HOLDS(ended_last(other).kind == DCD_CONTACT_ENDED && ended_last(other).user_b == 0);
    free(saved);
    OK(dcd_world_destroy(other));
    for (int turn = 0; turn < 2; turn++) {
        OK(dcd_checkpoint_restore(world, before));
        HOLDS(began_last(world).user_b == 7 && began_last(world).b.v == body.v);
        OK(dcd_step(world));
        HOLDS(ended_last(world).user_b == 7);
        OK(dcd_step(world));
        HOLDS(ended_last(world).kind == 99);
        OK(dcd_checkpoint_restore(world, after));
        HOLDS(ended_last(world).user_b == 7);
        OK(dcd_step(world));
        HOLDS(ended_last(world).kind == 99);
    }
    OK(dcd_world_destroy(world));
}

/* Snapshots are restored. `path` names a file that is written and left there. */
static void snapshots_are_gone_back_to(const char *path)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    const char *params[] = { "n=60" };
    DcdWorld world = { 0 }, other = make_world(1, 1, 0.0f);
    DcdBodyId box_at, later, again;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    size_t size = 0, small = 0;
    def.regions = 3;
    def.user_data = 5;
    OK(dcd_world_open_scene("pile", params, 1, &def, &world));
    OK(dcd_body_at(world, 7, &box_at));
    steps(world, 20);
    OK(dcd_state_view(world, &view));
    HOLDS(dcd_snapshot_save(world, NULL, 0, &size) == DCD_OK && size > 1000);
    unsigned char *saved = malloc(size);
    OK(dcd_snapshot_save(world, saved, size, &small));
    HOLDS(small == size);
    uint64_t hash = hash_of(world);
    double height = pose_of(world, box_at).p[1];
    steps(world, 30);
    uint64_t end = hash_of(world);
    later = add(world, crate(world, 0.0, 60.0));
    OK(dcd_step(world));

    /* Back: the same bodies by the same ids, and the same future. What was made after the snapshot is gone
     * for ever. */
    OK(dcd_snapshot_load(world, saved, size));
    HOLDS(hash_of(world) == hash && tick_of(world) == 20 && pose_of(world, box_at).p[1] == height);
    HOLDS(!dcd_body_is_valid(world, later));
    OK(dcd_state_view(world, &view));
    HOLDS(view.tick == 20 && view.count == 60 && view.ids[7].v != 0);
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(world, &info));
    HOLDS(info.user_data == 5 && info.regions == 3);
    steps(world, 30);
    HOLDS(hash_of(world) == end);
    again = add(world, crate(world, 0.0, 60.0));
    HOLDS(again.v != later.v && !dcd_body_is_valid(world, later));

    /* Into another world, from memory and from a file: all bodies are there, by other ids. */
    DcdShapeId kept = box(other, 0.5f, 0.5f, 0.5f);
    OK(dcd_snapshot_load(other, saved, size));
    HOLDS(hash_of(other) == hash && !dcd_body_is_valid(other, box_at));
    OK(dcd_body_at(other, 7, &again));
    HOLDS(pose_of(other, again).p[1] == height);
    DcdBodyDef more = DCD_BODY_DEF_INIT;
    more.shape = kept;
    more.pose.p[1] = 60.0;
    add(other, more); /* shapes stay */
    OK(dcd_snapshot_load(world, saved, size));
    OK(dcd_snapshot_save_file(world, path));
    OK(dcd_snapshot_load_file(other, path));
    HOLDS(hash_of(other) == hash);
    steps(other, 30);
    HOLDS(hash_of(other) == end);

    /* One damaged bit is detected, and nothing changes. */
    hash = hash_of(other);
    saved[size / 2] ^= 1;
    HOLDS(dcd_snapshot_load(other, saved, size) == DCD_ERR_ARGUMENT && hash_of(other) == hash);
    free(saved);
    OK(dcd_world_destroy(other));
    OK(dcd_world_destroy(world));
}

/* Recordings are written to files beside `path`, and left there for the command line. */
static void recordings_are_written(const char *path)
{
    char whole[600], last[600];
    const char *params[] = { "n=60" };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 0 };
    DcdBodyId thrown;
    DcdVelocity velocity = { { 3.0f, 4.0f, 0.0f }, { 0.0f, 0.0f, 1.0f } };
    snprintf(whole, sizeof whole, "%s.whole.dcdr", path);
    snprintf(last, sizeof last, "%s.last.dcdr", path);
    def.regions = 2;
    OK(dcd_world_open_scene("pile", params, 1, &def, &world));
    OK(dcd_record_stop(world)); /* nothing is recorded */
    OK(dcd_record(world, whole));
    steps(world, 5);
    OK(dcd_record(world, whole)); /* starts again and replaces the file */
    thrown = add(world, crate(world, 0.0, 20.0));
    steps(world, 20);
    FAILS(dcd_record_keep(world, last), DCD_ERR_ARGUMENT, "file already");
    OK(dcd_body_set_velocity(world, thrown, &velocity));
    steps(world, 10);
    OK(dcd_record_stop(world));
    OK(dcd_record_last(world, 0.001f));
    steps(world, 10);
    OK(dcd_record_keep(world, last));
    steps(world, 10);
    OK(dcd_world_destroy(world));
}

static void steps_go_on_in_the_background(void)
{
    const char *params[] = { "n=60" };
    DcdWorld world = { 0 }, other = { 0 };
    OK(dcd_world_open_scene("pile", params, 1, NULL, &world));
    OK(dcd_world_open_scene("pile", params, 1, NULL, &other));
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    for (uint64_t tick = 1; tick <= 60; tick++) {
        double before = view.poses[59].p[1];
        OK(dcd_step_begin(world));
        HOLDS(dcd_step_begin(world) == DCD_ERR_BUSY);
        HOLDS(view.poses[59].p[1] == before); /* the view from before can be read meanwhile */
        if (tick % 3 == 0) {
            HOLDS(tick_of(world) == tick); /* any other call waits for the step */
        }
        DcdStatus status = DCD_ERR_TIMEOUT;
        while (status == DCD_ERR_TIMEOUT) {
            status = dcd_step_wait(world, tick % 2 == 0 ? DCD_FOREVER : 1000);
        }
        OK(status);
        HOLDS(dcd_step_wait(world, DCD_FOREVER) == DCD_ERR_ARGUMENT);
        OK(dcd_state_view(world, &view));
        HOLDS(view.tick == tick);
        OK(dcd_step(other));
    }
    HOLDS(hash_of(world) == hash_of(other));
    OK(dcd_step_begin(world));
    OK(dcd_step_begin(other));
    OK(dcd_world_destroy(world)); /* waits for the step */
    OK(dcd_step_wait(other, DCD_FOREVER));
    OK(dcd_world_destroy(other));
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
    OK(dcd_cast_rays(world, &ray, 1, NULL, &hit));
    HOLDS(hit.body.v == body.v);
    NEAR(hit.point[0], 100000.001, 1e-3);
    OK(dcd_world_destroy(world));
}

static DcdWorld last_world;
static DcdBodyId last_body;

/* What a game does at exit, when the library's own objects of this thread are gone. */
static void save_at_exit(void)
{
    DcdPose pose;
    DcdVelocity velocity;
    if (dcd_body_get(last_world, last_body, &pose, &velocity) != DCD_OK || dcd_world_destroy(last_world) != DCD_OK ||
        dcd_body_get(last_world, last_body, &pose, &velocity) != DCD_ERR_STALE_ID)
        _Exit(3);
}

int main(int count, char **texts)
{
    HOLDS(atexit(save_at_exit) == 0);
    last_world = make_world(1, 1, 0.0f);
    last_body = add(last_world, crate(last_world, 0.0, 0.0));
    members_of_a_body_count();
    pushes_push();
    events_tell();
    a_transfer_is_told_once();
    topology_says_who_owns_what_and_what_borders_share();
    surfaces_can_be_changed();
    every_member_of_a_body_is_read_back();
    changed_bodies_behave_so();
    speed_and_spin_are_as_asked();
    bodies_sleep_by_their_own_measure();
    materials_and_groups_combine();
    colliders_come_and_go();
    bodies_follow_poses();
    forces_add_up();
    joints_hold();
    joints_pull();
    generic_joints_free_what_they_are_told();
    joints_are_changed_and_found();
    every_shape_rests_on_every_ground();
    wheels_roll_over_edges(TERRAIN);
    wheels_roll_over_edges(ONE_SIDED);
    wheels_roll_over_edges(TWO_SIDED);
    worlds_are_cut_upright_unless_told_otherwise();
    worlds_are_cut_where_planes_say();
    speed_has_a_limit_that_is_named();
    what_has_no_mass_does_not_hang_in_the_air();
    several_bodies_come_all_or_none();
    a_part_of_a_model_keeps_its_axes(count > 1 ? texts[1] : "behaviour");
    a_destroyed_sensor_ends_its_contacts_as_a_sensor();
    casts_name_the_triangle_of_terrain_that_rays_do();
    views_and_bulk_agree();
    a_body_keeps_its_slot_in_all_views();
    threads_do_not_change_the_result();
    couplings_are_as_asked();
    a_query_calls_until_its_function_has_enough();
    rays_meet_what_the_filter_lets_through();
    shapes_and_points_find_bodies();
    millimetres_count_far_out();
    ticks_are_computed_again();
    who_is_gone_is_known_again();
    a_collider_that_is_gone_is_known_again();
    snapshots_are_gone_back_to(count > 1 ? texts[1] : "behaviour.dcd");
    recordings_are_written(count > 1 ? texts[1] : "behaviour");
    steps_go_on_in_the_background();
    return checked();
}
