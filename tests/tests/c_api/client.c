/* What the C API does in a served world: `client MODE SERVER TOKEN…`, run by served.rs. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <math.h>
#include <time.h>

static DcdWorld connect(const char *server, const char *token, const char *identity)
{
    DcdWorld world = { 0 };
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    def.server = server;
    def.token = token;
    def.identity_path = identity;
    def.user_data = 42;
    OK(dcd_client_connect(&def, &world));
    return world;
}

/* Makes one step and waits for the time it stands for. Every second step is made in the background. */
static DcdStatus step(DcdWorld world)
{
    struct timespec pause = { 0, 10 * 1000 * 1000 };
    static unsigned count;
    DcdStatus status = count++ % 2 == 0 ? dcd_step(world) : dcd_step_begin(world);
    if (status == DCD_OK && count % 2 == 0) {
        status = dcd_step_wait(world, DCD_FOREVER);
    }
    nanosleep(&pause, NULL);
    return status;
}

/* Steps until a change of this kind happens to the body. */
static DcdBodyChange await_change(DcdWorld world, DcdBodyId body, uint32_t kind)
{
    DcdBodyChange none = { { 0 }, 0, 0, 0 };
    for (int i = 0; i < 3000; i++) {
        if (step(world) != DCD_OK) {
            break;
        }
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_events(world, &events));
        for (size_t k = 0; k < events.change_count; k++) {
            if (events.changes[k].kind == kind && events.changes[k].body.v == body.v) {
                return events.changes[k];
            }
        }
    }
    printf("no change of kind %u\n", kind);
    failures++;
    return none;
}

static DcdPose pose_of(DcdWorld world, DcdBodyId body)
{
    DcdPose pose = { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_get(world, body, &pose, NULL));
    return pose;
}

/* Whether the body gets beyond x within half a minute. */
static bool gets_beyond(DcdWorld world, DcdBodyId body, double x)
{
    for (int i = 0; i < 3000 && step(world) == DCD_OK; i++) {
        if (pose_of(world, body).p[0] > x) {
            return true;
        }
    }
    return false;
}

static DcdBodyDef avatar_def(DcdWorld world)
{
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    OK(dcd_shape_box(world, half, &def.shape));
    def.body_type = DCD_KINEMATIC;
    def.pose.p[0] = -12.0;
    def.pose.p[1] = 50.0;
    def.user_data = 7;
    def.dominance = 3;
    return def;
}

/* The nodes that own the bodies answer: with the avatar, with what is below it, and with nothing in the sky.
 * */
static void asks_the_owners(DcdWorld world, DcdBodyId avatar)
{
    const DcdPose at = pose_of(world, avatar);
    DcdRay rays[3], down = DCD_RAY_INIT;
    DcdRayHit hits[3];
    DcdQueryId query, other;
    size_t count = 0;
    down.origin[0] = at.p[0];
    down.origin[1] = at.p[1] + 10.0;
    down.origin[2] = at.p[2];
    down.direction[1] = -1.0f;
    rays[0] = rays[1] = rays[2] = down;
    rays[1].exclude = avatar;
    rays[2].direction[1] = 1.0f;
    OK(dcd_cast_rays_submit(world, rays, 3, NULL, &query));
    OK(dcd_cast_rays_submit(world, rays, 1, NULL, &other));
    OK(dcd_query_cancel(world, other));
    FAILS(dcd_query_poll(world, other, hits, 3, &count), DCD_ERR_STALE_ID, "query");
    DcdStatus status = DCD_ERR_BUSY;
    for (int i = 0; status == DCD_ERR_BUSY && i < 3000; i++) {
        status = dcd_query_poll(world, query, hits, 3, &count);
        OK(step(world));
    }
    OK(status);
    HOLDS(count == 3 && hits[0].body.v == avatar.v && hits[0].user_data == 7);
    HOLDS(fabs(hits[0].distance - 9.5) < 1e-3 && fabs(hits[0].point[1] - at.p[1] - 0.5) < 1e-3);
    HOLDS(hits[1].body.v != 0 && hits[1].body.v != avatar.v && hits[1].distance > 10.5f);
    HOLDS(hits[2].body.v == 0 && hits[2].distance == 0.0f);
    FAILS(dcd_query_poll(world, query, hits, 3, &count), DCD_ERR_STALE_ID, "query");
}

/* Errors of what this role cannot do name the role. */
static void refuses(DcdWorld world, DcdBodyId other, DcdBodyId avatar, const char *role)
{
    const float one[3] = { 1.0f, 0.0f, 0.0f };
    DcdJointDef joint = DCD_JOINT_DEF_INIT;
    DcdJointId joint_id;
    DcdRay ray = { { 0.0, 0.0, 0.0 }, { 0.0f, 1.0f, 0.0f }, 10.0f, { 0 }, 1, 0 };
    DcdRayHit hit;
    uint64_t hash, data = 1;
    size_t count;
    DcdPose pose = pose_of(world, other);
    DcdVelocity velocity = { { 1.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    DcdBodyDef fixed = avatar_def(world);
    DcdBodyId body;

    DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
    DcdColliderProperties collider = DCD_COLLIDER_PROPERTIES_INIT;

    OK(dcd_body_properties(world, other, &as));
    HOLDS(as.body_type == DCD_DYNAMIC);
    OK(dcd_body_properties(world, avatar, &as)); /* the avatar is not in the world yet */
    HOLDS(as.body_type == DCD_KINEMATIC && as.user_data == 7 && as.dominance == 3);
    OK(dcd_collider_properties(world, other, 0, &collider));
    joint.a = other;
    joint.b = avatar;
    fixed.body_type = DCD_FIXED;
    FAILS(dcd_joint_create(world, &joint, &joint_id), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_joint_set_motor(world, (DcdJointId){ 1 }, DCD_AXIS_X, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_joints(world, other, &joint_id, 1, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_cast_rays(world, &ray, 1, NULL, &hit), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_overlap_points(world, NULL, 0, NULL, NULL, 0, NULL, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_state_hash(world, &hash), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_borders(world, NULL, 0, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_snapshot_save(world, NULL, 0, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_snapshot_load(world, &hash, sizeof hash), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_apply_impulse(world, avatar, one, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_apply_torque_impulse(world, avatar, one), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_force(world, avatar, one, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_add_force(world, avatar, one, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_target(world, avatar, &pose), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_properties(world, other, &as), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_collider_set_properties(world, other, 0, &collider), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_collider_add(world, other, fixed.shape, NULL, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_collider_remove(world, other, 0), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_collider_set_shape(world, other, 0, fixed.shape), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_wake(world, avatar), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_sleep(world, avatar), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_events(world, other, 0, DCD_EVENT_CONTACT, 0.0f), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_material(world, other, 0, 0.5f, 0.5f), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_groups(world, other, 0, 1, 1), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_state_write(world, &avatar, 1, DCD_FIELD_USER_DATA, &data, 0, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_pose(world, other, &pose), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_velocity(world, other, &velocity), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_destroy(world, other), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_create(world, &fixed, &body), DCD_ERR_UNSUPPORTED, role);
    DcdBodyDef net = avatar_def(world);
    const float corners[] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 };
    const uint32_t face[] = { 0, 1, 2 };
    OK(dcd_shape_mesh(world, corners, 3, face, 1, false, &net.shape));
    FAILS(dcd_body_create(world, &net, &body), DCD_ERR_ARGUMENT, "an avatar cannot be a mesh");
    fixed.body_type = DCD_KINEMATIC_POSE;
    FAILS(dcd_body_create(world, &fixed, &body), DCD_ERR_UNSUPPORTED, role);
    fixed.body_type = DCD_KINEMATIC;
    fixed.sleep_after = 9.0f;
    FAILS(dcd_body_create(world, &fixed, &body), DCD_ERR_UNSUPPORTED, role);
}

/* A client knows the looks of its bodies: a hundred boxes and the ground of the scene, and its own avatar,
 * not yet in the world. */
static void looks(DcdWorld world, DcdBodyId avatar)
{
    DcdBodyId all[128];
    size_t count = 0, boxes = 0;
    double weight = 0.0;
    OK(dcd_bodies(world, all, 128, &count));
    HOLDS(count == 102 && all[count - 1].v == avatar.v);
    for (size_t i = 0; i < count; i++) {
        DcdShapeId shape;
        DcdShapeInfo info = DCD_SHAPE_INFO_INIT;
        DcdBodyExtent extent = DCD_BODY_EXTENT_INIT;
        const DcdPose at = pose_of(world, all[i]);
        OK(dcd_collider_shape(world, all[i], 0, &shape));
        OK(dcd_shape_info(world, shape, &info));
        OK(dcd_body_extent(world, all[i], &extent));
        boxes += info.kind == DCD_SHAPE_BOX;
        weight += extent.mass;
        HOLDS(extent.min[1] < at.p[1] + 1e-3 && extent.max[1] > at.p[1] - 1e-3 && (info.size[0] > 0.1f || info.vertex_count > 0));
    }
    HOLDS(boxes >= 100 && weight > 90.0);
}

/* If one of several avatars is refused, nobody hears of any of them. */
static void makes_all_or_none(DcdWorld world)
{
    DcdBodyDef defs[2] = { avatar_def(world), avatar_def(world) };
    DcdBodyId made[2] = { { 7 }, { 7 } };
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    defs[1].body_type = DCD_FIXED;
    FAILS(dcd_bodies_create(world, defs, 2, made), DCD_ERR_UNSUPPORTED, "fixed");
    HOLDS(made[0].v == 7 && made[1].v == 7);
    size_t changes = 0;
    for (int i = 0; i < 60; i++) {
        OK(step(world));
        OK(dcd_events(world, &events));
        changes += events.change_count;
    }
    HOLDS(changes == 0);
}

/* Where an avatar is shown that moves east at 10 m/s: at the world's present tick, or a moment ago, at an
 * even pace. */
static void shows(DcdWorld world, DcdBodyId avatar)
{
    DcdViewTime time = DCD_VIEW_TIME_INIT, before = DCD_VIEW_TIME_INIT;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    DcdPose now, shown;
    DcdVelocity velocity;
    OK(dcd_view_time(world, &before));
    HOLDS(gets_beyond(world, avatar, pose_of(world, avatar).p[0] + 3.0));
    OK(dcd_view_time(world, &time));
    HOLDS(time.shown > before.shown && time.now >= time.shown);
    HOLDS(time.predicted >= time.now);
    OK(dcd_view_body(world, avatar, time.predicted, &now, NULL));
    OK(dcd_view_body(world, avatar, time.shown, &shown, &velocity));
    HOLDS(now.p[0] >= shown.p[0] && shown.p[0] > now.p[0] - 10.0 && velocity.linear[0] > 5.0f);
    OK(dcd_view_state(world, &time, &view));
    HOLDS(view.count == 101 && view.ids[100].v == avatar.v && view.poses[100].p[0] == now.p[0]);
    const uint32_t slot = view.slots[100];
    HOLDS(slot < view.slot_count);
    time.predicted = time.shown;
    OK(dcd_view_state(world, &time, &view));
    HOLDS(view.poses[100].p[0] == shown.p[0]);
    OK(dcd_state_view(world, &view));
    HOLDS(view.slots[100] == slot && view.slot_count <= 110);
}

/* An own avatar reacts in the frame of the input. */
static void answers(DcdWorld world, DcdBodyId avatar)
{
    DcdPrediction prediction = DCD_PREDICTION_INIT;
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdVelocity velocity = { { -4.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_prediction(world, &prediction));
    HOLDS(prediction.bodies >= 1);
    OK(dcd_body_set_velocity(world, avatar, &velocity));
    OK(dcd_step(world));
    OK(dcd_view_time(world, &time));
    velocity.linear[0] = 0.0f;
    OK(dcd_view_body(world, avatar, time.predicted, NULL, &velocity));
    HOLDS(velocity.linear[0] < -1.0f);
    OK(dcd_prediction_set(world, false));
    OK(dcd_prediction(world, &prediction));
    HOLDS(prediction.bodies == 0);
    /* It is shown at the tick that is asked for, predicted or not. */
    DcdStateView view = DCD_STATE_VIEW_INIT;
    DcdPose at;
    OK(dcd_view_time(world, &time));
    HOLDS(time.predicted == time.now && time.shown < time.now);
    for (int i = 0; i < 2; i++) {
        OK(dcd_view_state(world, &time, &view));
        OK(dcd_view_body(world, avatar, time.predicted, &at, NULL));
        HOLDS(view.ids[100].v == avatar.v && view.poses[100].p[0] == at.p[0]);
        time.predicted = time.shown;
    }
    OK(dcd_prediction_set(world, true));
}

/* The whole life of an avatar, and what can be read of other bodies. */
static void plays(DcdWorld world, DcdRole expected, const char *role)
{
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(world, &info));
    HOLDS(info.role == expected && info.client > 0 && info.regions == 2 && info.user_data == 42);
    HOLDS(info.dt > 0.0f && info.gravity[1] < 0.0f);

    /* The scene is there at once. Its bodies have the same order as in a local world. */
    DcdBodyId box;
    OK(dcd_body_at(world, 5, &box));
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 100);

    DcdBodyDef def = avatar_def(world);
    DcdBodyId avatar, found[4];
    size_t count = 9;
    OK(dcd_body_create(world, &def, &avatar));
    HOLDS(dcd_body_is_valid(world, avatar) && pose_of(world, avatar).p[1] == 50.0);
    OK(dcd_own_avatars(world, found, 4, &count));
    HOLDS(count == 1 && found[0].v == avatar.v);
    OK(dcd_own_avatars(world, NULL, 0, &count));
    looks(world, avatar);
    refuses(world, box, avatar, role);

    HOLDS(await_change(world, avatar, DCD_CHANGE_APPEARED).user_data == 7);
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 101 && view.ids[100].v == avatar.v && view.user_data[100] == 7);
    asks_the_owners(world, avatar);
    makes_all_or_none(world);
    DcdVelocity east = { { 10.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &east));
    HOLDS(gets_beyond(world, avatar, -10.0));
    shows(world, avatar);
    answers(world, avatar);
    OK(dcd_body_set_velocity(world, avatar, &east));

    /* A jump keeps the velocity. If another velocity is set in the same step, both count. */
    DcdPose far = def.pose;
    far.p[0] = 5.0;
    OK(dcd_body_set_pose(world, avatar, &far));
    HOLDS(gets_beyond(world, avatar, 25.0));
    /* An avatar may jump as far as it could have moved since its last jump, at the 20 m/s of this server. */
    far.p[0] = 100.0;
    OK(dcd_body_set_pose(world, avatar, &far));
    HOLDS(await_change(world, avatar, DCD_CHANGE_REFUSED).reason == DCD_REFUSED_TOO_FAR);
    DcdVelocity up = { { 0.0f, 5.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    far.p[0] = 40.0;
    OK(dcd_body_set_pose(world, avatar, &far));
    OK(dcd_body_set_velocity(world, avatar, &up));
    HOLDS(gets_beyond(world, avatar, 39.0));
    HOLDS(pose_of(world, avatar).p[0] == 40.0);

    DcdBodyInfo body_info = DCD_BODY_INFO_INIT;
    OK(dcd_body_info(world, avatar, &body_info));
    HOLDS(body_info.body_type == DCD_KINEMATIC && body_info.region != DCD_NO_REGION && body_info.colliders == 1);
    DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
    OK(dcd_body_properties(world, avatar, &as));
    HOLDS(as.dominance == 3 && as.user_data == 7);
    DcdOwner owner = DCD_OWNER_INIT;
    OK(dcd_body_owner(world, avatar, &owner));
    HOLDS(owner.region == body_info.region && owner.holders == 0 && (owner.flags & DCD_OWNER_HEARD) != 0);
    /* All processes are told which node computes which region; a participant comes to compute a part. */
    bool computes = strcmp(role, "participant") == 0;
    for (int i = 0; computes && i < 3000 && (owner.flags & DCD_OWNER_HERE) == 0; i++) {
        step(world);
        OK(dcd_body_owner(world, i % 2 ? avatar : box, &owner));
    }
    HOLDS(computes == ((owner.flags & DCD_OWNER_HERE) != 0) && owner.node != DCD_NO_NODE);
    DcdRegionInfo regions[2];
    OK(dcd_regions(world, regions, 2, &count));
    HOLDS(regions[0].node != DCD_NO_NODE && regions[1].node != DCD_NO_NODE);
    HOLDS(count == 2 && regions[0].bodies + regions[1].bodies == 101);
    DcdStats stats = DCD_STATS_INIT;
    OK(dcd_stats(world, &stats));
    HOLDS(stats.bytes_in > 0 && stats.bytes_out > 0 && stats.rtt > 0.0);
    HOLDS(stats.udp_bytes_in > stats.bytes_in && stats.udp_bytes_out > 0); /* QUIC adds bytes of its own */
    HOLDS(stats.updates > 0 && stats.bodies == 101 && stats.ticks > 0);

    /* Too fast: an event refuses the input, and the avatar stays as it is. */
    DcdVelocity fast = { { 1000.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &fast));
    HOLDS(await_change(world, avatar, DCD_CHANGE_REFUSED).reason == DCD_REFUSED_TOO_FAST);
    HOLDS(dcd_body_is_valid(world, avatar));

    OK(dcd_body_destroy(world, avatar));
    HOLDS(!dcd_body_is_valid(world, avatar));
    FAILS(dcd_body_destroy(world, avatar), DCD_ERR_STALE_ID, "");
    HOLDS(await_change(world, avatar, DCD_CHANGE_REMOVED).user_data == 7);
    OK(dcd_own_avatars(world, NULL, 0, &count));
    HOLDS(count == 0);

    /* Values that the world's limits exclude are refused at once. */
    def.body_type = DCD_DYNAMIC;
    def.velocity.linear[0] = 500.0f;
    FAILS(dcd_body_create(world, &def, &avatar), DCD_ERR_ARGUMENT, "500 m/s");
    def.velocity.linear[0] = 0.0f;
    OK(dcd_body_create(world, &def, &avatar));
    fast.linear[0] = 500.0f;
    FAILS(dcd_body_set_velocity(world, avatar, &fast), DCD_ERR_ARGUMENT, "500 m/s");
    await_change(world, avatar, DCD_CHANGE_APPEARED);
    FAILS(dcd_body_set_velocity(world, avatar, &fast), DCD_ERR_ARGUMENT, "500 m/s");
    OK(dcd_body_destroy(world, avatar));
}

/* The number of movable bodies outside of the interest. */
static size_t outside(DcdWorld world)
{
    DcdStateView view = DCD_STATE_VIEW_INIT;
    size_t count = 0;
    OK(dcd_state_view(world, &view));
    for (size_t i = 0; i < view.count; i++) {
        count += (view.flags[i] & DCD_STATE_OUTSIDE) != 0;
    }
    return count;
}

/* Steps until this many bodies are outside. */
static bool comes_to(DcdWorld world, size_t count)
{
    for (int i = 0; i < 3000 && step(world) == DCD_OK; i++) {
        if (outside(world) == count) {
            return true;
        }
    }
    return false;
}

static bool is_outside(DcdWorld world, DcdBodyId body)
{
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    OK(dcd_body_info(world, body, &info));
    return info.outside;
}

/* A body that moves unseen stays where it was last heard of, and is in its true place once the interest
 * covers it. */
static void hears_of_a_part(const char *server, const char *first, const char *second)
{
    DcdWorld watcher = connect(server, first, NULL), mover = connect(server, second, NULL);
    DcdBodyDef def = avatar_def(mover);
    DcdVelocity east = { { 15.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }, still = { { 0.0f }, { 0.0f } };
    double here[3] = { -12.0, 50.0, 0.0 }, there[3] = { 0.0, 50.0, 0.0 };
    DcdBodyId avatar, seen, ground;
    size_t count = 0;
    OK(dcd_body_create(mover, &def, &avatar));
    await_change(mover, avatar, DCD_CHANGE_APPEARED);
    DcdStateView view = DCD_STATE_VIEW_INIT;
    while (count < 101 && step(watcher) == DCD_OK) {
        OK(dcd_state_view(watcher, &view));
        count = view.count;
    }
    seen = view.ids[100];
    HOLDS(outside(watcher) == 0 && pose_of(watcher, seen).p[1] == 50.0);
    OK(dcd_body_at(watcher, 0, &ground));

    OK(dcd_bandwidth_set(watcher, 200000));
    FAILS(dcd_interest_set(watcher, here, NAN), DCD_ERR_ARGUMENT, "radius");
    FAILS(dcd_interest_set(watcher, NULL, 5.0), DCD_ERR_NULL, "centre");
    here[2] = INFINITY;
    FAILS(dcd_interest_set(watcher, here, 5.0), DCD_ERR_ARGUMENT, "centre");
    here[2] = 0.0;

    /* Around the avatar alone: all boxes are outside; fixed ground never is. */
    OK(dcd_interest_set(watcher, here, 5.0));
    HOLDS(comes_to(watcher, 100) && !is_outside(watcher, seen) && !is_outside(watcher, ground));

    /* The avatar leaves the interest, and the client is told. Then it moves on unseen, and stops. */
    OK(dcd_body_set_velocity(mover, avatar, &east));
    OK(step(mover));
    HOLDS(comes_to(watcher, 101) && is_outside(watcher, seen));
    HOLDS(gets_beyond(mover, avatar, 25.0));
    OK(dcd_body_set_velocity(mover, avatar, &still));
    double last = -100.0, x = pose_of(mover, avatar).p[0];
    while (x > last && step(mover) == DCD_OK) {
        for (int i = 0; i < 10; i++) {
            step(mover);
        }
        last = x;
        x = pose_of(mover, avatar).p[0];
    }
    for (int i = 0; i < 30; i++) {
        step(watcher);
    }
    HOLDS(dcd_body_is_valid(watcher, seen) && pose_of(watcher, seen).p[0] < 10.0 && is_outside(watcher, seen));

    /* The interest is moved to where the avatar rests. */
    there[0] = x;
    OK(dcd_interest_set(watcher, there, 5.0));
    HOLDS(comes_to(watcher, 100) && pose_of(watcher, seen).p[0] == x && !is_outside(watcher, seen));

    /* Everything again, by a radius of 0 and by one of infinity. */
    OK(dcd_interest_set(watcher, NULL, 0.0));
    HOLDS(comes_to(watcher, 0));
    OK(dcd_interest_set(watcher, there, 5.0));
    HOLDS(comes_to(watcher, 100));
    OK(dcd_interest_set(watcher, NULL, INFINITY));
    HOLDS(comes_to(watcher, 0));

    /* A client always hears of its own avatar. */
    OK(dcd_interest_set(mover, here, 5.0));
    HOLDS(comes_to(mover, 100));
    OK(dcd_body_set_velocity(mover, avatar, &east));
    HOLDS(gets_beyond(mover, avatar, x + 10.0) && !is_outside(mover, avatar));
    OK(dcd_world_destroy(mover));
    OK(dcd_world_destroy(watcher));
}

/* A client that joins again with the same identity finds the avatar that it left behind. */
static void comes_back(const char *server, const char *first, const char *second, const char *identity)
{
    DcdWorld world = connect(server, first, identity);
    DcdBodyDef def = avatar_def(world);
    DcdBodyId avatar, found;
    size_t count;
    OK(dcd_body_create(world, &def, &avatar));
    await_change(world, avatar, DCD_CHANGE_APPEARED);
    DcdVelocity east = { { 10.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &east));
    HOLDS(gets_beyond(world, avatar, -8.0));
    OK(dcd_world_destroy(world));
    FAILS(dcd_step(world), DCD_ERR_STALE_ID, "");

    world = connect(server, second, identity);
    HOLDS(!dcd_body_is_valid(world, avatar)); /* an id belongs to one world handle */
    for (int i = 0; i < 3000; i++) {
        OK(step(world));
        OK(dcd_own_avatars(world, &found, 1, &count));
        if (count == 1) {
            break;
        }
    }
    HOLDS(count == 1 && pose_of(world, found).p[0] > -9.0);
    def = avatar_def(world);
    OK(dcd_body_create(world, &def, &avatar));
    HOLDS(avatar.v != found.v);
    await_change(world, avatar, DCD_CHANGE_APPEARED);
    OK(dcd_world_destroy(world));
}

/* The server goes away: each step says so, and the last known states stay readable. */
static void loses(const char *server, const char *token)
{
    DcdWorld world = connect(server, token, NULL);
    OK(dcd_step(world));
    puts("ready");
    fflush(stdout);
    DcdStatus status = DCD_OK;
    for (int i = 0; i < 6000 && status == DCD_OK; i++) {
        status = step(world);
    }
    FAILS(status, DCD_ERR_NETWORK, "server");
    FAILS(dcd_step(world), DCD_ERR_NETWORK, "server");
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    OK(dcd_events(world, &events));
    HOLDS((events.flags & DCD_EVENTS_DISCONNECTED) != 0);
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 100);
    DcdBodyDef def = avatar_def(world);
    DcdBodyId body;
    FAILS(dcd_body_create(world, &def, &body), DCD_ERR_NETWORK, "");
    OK(dcd_world_destroy(world));
}

/* The server dies and comes back. The world goes on in between, and requests made meanwhile are done then. */
static void survives(const char *server, const char *token)
{
    DcdWorld world = connect(server, token, NULL);
    DcdBodyDef def = avatar_def(world);
    DcdBodyId avatar, second, found[2];
    OK(dcd_body_create(world, &def, &avatar));
    await_change(world, avatar, DCD_CHANGE_APPEARED);
    DcdVelocity east = { { 1.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &east));
    OK(step(world));
    puts("ready");
    fflush(stdout);
    getchar(); /* until the server is dead */
    OK(step(world));
    double from = pose_of(world, avatar).p[0];
    OK(dcd_body_create(world, &def, &second));
    for (int i = 0; i < 180; i++) {
        OK(step(world));
        OK(dcd_body_set_velocity(world, avatar, &east));
    }
    HOLDS(pose_of(world, avatar).p[0] > from + 1.0);
    size_t count;
    OK(dcd_own_avatars(world, found, 2, &count));
    HOLDS(count == 2 && found[1].v == second.v);
    puts("alone");
    fflush(stdout);
    HOLDS(await_change(world, second, DCD_CHANGE_APPEARED).user_data == 7); /* the server is back */
    from = pose_of(world, avatar).p[0];
    HOLDS(gets_beyond(world, avatar, from + 1.0));
    OK(dcd_body_destroy(world, second));
    await_change(world, second, DCD_CHANGE_REMOVED);
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 101);
    OK(dcd_world_destroy(world));
}

/* Errors on joining name what is wrong. */
static void fails(const char *server, const char *token, const char *node_token, const char *other)
{
    DcdWorld world = { 0 };
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    FAILS(dcd_client_connect(NULL, &world), DCD_ERR_NULL, "def");
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_NULL, "server");
    def.server = server;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_NULL, "token");
    def.token = "not a token";
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_ARGUMENT, "token");
    def.token = node_token;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_ARGUMENT, "node");
    def.token = token;
    FAILS(dcd_client_connect(&def, NULL), DCD_ERR_NULL, "out");
    def.struct_size = 8;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_STRUCT, "DcdClientDef");
    def.struct_size = sizeof def;
    const char *bad[] = { "", "localhost", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:99999", "127.0.0.1:x" };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        def.server = bad[i];
        FAILS(dcd_client_connect(&def, &world), DCD_ERR_ARGUMENT, "host:port");
    }
    def.server = other; /* nobody listens there */
    def.timeout_ms = 300;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_TIMEOUT, "no answer");
    HOLDS(world.v == 0);

    def = (DcdClientDef)DCD_CLIENT_DEF_INIT;
    def.server = server;
    def.token = token;
    def.interest_radius = -1.0;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_ARGUMENT, "interest_radius");
    def.interest_radius = 1.0;
    def.interest_centre[2] = 1e12;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_ARGUMENT, "interest_centre");

    /* A token admits one process, once. */
    def = (DcdClientDef)DCD_CLIENT_DEF_INIT;
    def.server = server;
    def.token = token;
    OK(dcd_client_connect(&def, &world));
    DcdWorld second = { 0 };
    FAILS(dcd_client_connect(&def, &second), DCD_ERR_NETWORK, "used");
    HOLDS(second.v == 0);
    OK(dcd_world_destroy(world));

    DcdParticipantDef participant = DCD_PARTICIPANT_DEF_INIT;
    participant.server = server;
    participant.token = token;
    FAILS(dcd_participant_join(&participant, &world), DCD_ERR_ARGUMENT, "participant");
    participant.threads = 5000;
    FAILS(dcd_participant_join(&participant, &world), DCD_ERR_ARGUMENT, "threads");
}

int main(int argc, char **argv)
{
    const char *mode = argc > 3 ? argv[1] : "";
    if (strcmp(mode, "play") == 0) {
        DcdWorld world = connect(argv[2], argv[3], NULL);
        plays(world, DCD_ROLE_CLIENT, "client");
        OK(dcd_world_destroy(world));
    } else if (strcmp(mode, "participate") == 0) {
        DcdWorld world = { 0 };
        DcdParticipantDef def = DCD_PARTICIPANT_DEF_INIT;
        def.server = argv[2];
        def.token = argv[3];
        def.user_data = 42;
        def.threads = 1;
        OK(dcd_participant_join(&def, &world));
        plays(world, DCD_ROLE_PARTICIPANT, "participant");
        OK(dcd_world_destroy(world));
    } else if (strcmp(mode, "return") == 0 && argc == 6) {
        comes_back(argv[2], argv[3], argv[4], argv[5]);
    } else if (strcmp(mode, "interest") == 0 && argc == 5) {
        hears_of_a_part(argv[2], argv[3], argv[4]);
    } else if (strcmp(mode, "lose") == 0) {
        loses(argv[2], argv[3]);
    } else if (strcmp(mode, "survive") == 0) {
        survives(argv[2], argv[3]);
    } else if (strcmp(mode, "fail") == 0 && argc == 6) {
        fails(argv[2], argv[3], argv[4], argv[5]);
    } else {
        fprintf(stderr, "usage: client play|participate|return|interest|lose|survive|fail SERVER TOKEN…\n");
        return EXIT_FAILURE;
    }
    return checked();
}
