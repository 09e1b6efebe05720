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

/* One step and the time it stands for; in the background as in the foreground. */
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

/* Steps until a change of this kind concerns the body. */
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

/* Whether the body comes to lie beyond x within half a minute. */
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

/* What this role cannot do names it. */
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
    DcdPartProperties part = DCD_PART_PROPERTIES_INIT;

    OK(dcd_body_properties(world, other, &as));
    HOLDS(as.body_type == DCD_DYNAMIC);
    OK(dcd_body_properties(world, avatar, &as)); /* on its way */
    HOLDS(as.body_type == DCD_KINEMATIC && as.user_data == 7 && as.dominance == 3);
    OK(dcd_part_properties(world, other, 0, &part));
    joint.a = other;
    joint.b = avatar;
    fixed.body_type = DCD_FIXED;
    FAILS(dcd_joint_create(world, &joint, &joint_id), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_joint_set_motor(world, (DcdJointId){ 1 }, DCD_AXIS_X, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_joints(world, other, &joint_id, 1, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_cast_rays(world, &ray, 1, NULL, &hit), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_overlap_points(world, NULL, 0, NULL, NULL, 0, NULL, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_state_hash(world, &hash), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_snapshot_save(world, NULL, 0, &count), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_snapshot_load(world, &hash, sizeof hash), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_apply_impulse(world, avatar, one, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_apply_torque_impulse(world, avatar, one), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_force(world, avatar, one, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_add_force(world, avatar, one, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_target(world, avatar, &pose), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_set_properties(world, other, &as), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_part_set_properties(world, other, 0, &part), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_part_add(world, other, fixed.shape, NULL, NULL), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_part_remove(world, other, 0), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_part_set_shape(world, other, 0, fixed.shape), DCD_ERR_UNSUPPORTED, role);
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
    fixed.body_type = DCD_KINEMATIC_POSE;
    FAILS(dcd_body_create(world, &fixed, &body), DCD_ERR_UNSUPPORTED, role);
    fixed.body_type = DCD_KINEMATIC;
    fixed.sleep_after = 9.0f;
    FAILS(dcd_body_create(world, &fixed, &body), DCD_ERR_UNSUPPORTED, role);
}

/* The whole life of an avatar, and what can be read of the others. */
static void plays(DcdWorld world, DcdRole expected, const char *role)
{
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(world, &info));
    HOLDS(info.role == expected && info.client > 0 && info.regions == 2 && info.user_data == 42);
    HOLDS(info.dt > 0.0f && info.gravity[1] < 0.0f);

    /* The scene is there at once; its bodies are named as in a local world. */
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
    FAILS(dcd_own_avatars(world, NULL, 0, &count), DCD_ERR_SMALL_BUFFER, "1");
    refuses(world, box, avatar, role);

    HOLDS(await_change(world, avatar, DCD_BODY_APPEARED).user_data == 7);
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 101 && view.ids[100].v == avatar.v && view.user_data[100] == 7);
    DcdVelocity east = { { 10.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &east));
    HOLDS(gets_beyond(world, avatar, -10.0));

    /* A jump keeps the velocity; asked for in one step with another velocity, both count. */
    DcdPose far = def.pose;
    far.p[0] = 20.0;
    OK(dcd_body_set_pose(world, avatar, &far));
    HOLDS(gets_beyond(world, avatar, 21.0));
    DcdVelocity up = { { 0.0f, 5.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    far.p[0] = 100.0;
    OK(dcd_body_set_pose(world, avatar, &far));
    OK(dcd_body_set_velocity(world, avatar, &up));
    HOLDS(gets_beyond(world, avatar, 99.0));
    HOLDS(pose_of(world, avatar).p[0] == 100.0);

    DcdBodyInfo body_info = DCD_BODY_INFO_INIT;
    OK(dcd_body_info(world, avatar, &body_info));
    HOLDS(body_info.body_type == DCD_KINEMATIC && body_info.region != DCD_NO_REGION && body_info.parts == 1);
    DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
    OK(dcd_body_properties(world, avatar, &as));
    HOLDS(as.dominance == 3 && as.user_data == 7);
    DcdRegionInfo regions[2];
    OK(dcd_regions(world, regions, 2, &count));
    HOLDS(count == 2 && regions[0].bodies + regions[1].bodies == 101);
    DcdStats stats = DCD_STATS_INIT;
    OK(dcd_stats(world, &stats));
    HOLDS(stats.bytes_in > 0 && stats.bytes_out > 0 && stats.rtt > 0.0);
    HOLDS(stats.updates > 0 && stats.bodies == 101 && stats.ticks > 0);

    /* Too fast: refused by an event, and the avatar stays as it is. */
    DcdVelocity fast = { { 1000.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &fast));
    HOLDS(await_change(world, avatar, DCD_BODY_REFUSED).reason == DCD_REFUSED_TOO_FAST);
    HOLDS(dcd_body_is_valid(world, avatar));

    OK(dcd_body_destroy(world, avatar));
    HOLDS(!dcd_body_is_valid(world, avatar));
    FAILS(dcd_body_destroy(world, avatar), DCD_ERR_STALE_ID, "");
    HOLDS(await_change(world, avatar, DCD_BODY_REMOVED).user_data == 7);
    OK(dcd_own_avatars(world, NULL, 0, &count));
    HOLDS(count == 0);
}

/* An avatar left behind is found again by who joins with the same identity. */
static void comes_back(const char *server, const char *first, const char *second, const char *identity)
{
    DcdWorld world = connect(server, first, identity);
    DcdBodyDef def = avatar_def(world);
    DcdBodyId avatar, found;
    size_t count;
    OK(dcd_body_create(world, &def, &avatar));
    await_change(world, avatar, DCD_BODY_APPEARED);
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
    await_change(world, avatar, DCD_BODY_APPEARED);
    OK(dcd_world_destroy(world));
}

/* The server goes away: each step says so, and what was heard stays readable. */
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
    HOLDS((events.flags & DCD_EVENTS_LOST) != 0);
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 100);
    DcdBodyDef def = avatar_def(world);
    DcdBodyId body;
    FAILS(dcd_body_create(world, &def, &body), DCD_ERR_NETWORK, "");
    OK(dcd_world_destroy(world));
}

/* The server dies, and is back: the world goes on in between, and what was asked meanwhile is done then. */
static void survives(const char *server, const char *token)
{
    DcdWorld world = connect(server, token, NULL);
    DcdBodyDef def = avatar_def(world);
    DcdBodyId avatar, second, found[2];
    OK(dcd_body_create(world, &def, &avatar));
    await_change(world, avatar, DCD_BODY_APPEARED);
    DcdVelocity east = { { 1.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_velocity(world, avatar, &east));
    OK(step(world));
    puts("ready");
    fflush(stdout);
    getchar(); /* it is dead */
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
    HOLDS(await_change(world, second, DCD_BODY_APPEARED).user_data == 7); /* it is back */
    from = pose_of(world, avatar).p[0];
    HOLDS(gets_beyond(world, avatar, from + 1.0));
    OK(dcd_body_destroy(world, second));
    await_change(world, second, DCD_BODY_REMOVED);
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    HOLDS(view.count == 101);
    OK(dcd_world_destroy(world));
}

/* What is wrong on entering is said. */
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
    def.server = other; /* where nobody is */
    def.timeout_ms = 300;
    FAILS(dcd_client_connect(&def, &world), DCD_ERR_TIMEOUT, "no answer");
    HOLDS(world.v == 0);

    /* A token lets one process in, once. */
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
    } else if (strcmp(mode, "lose") == 0) {
        loses(argv[2], argv[3]);
    } else if (strcmp(mode, "survive") == 0) {
        survives(argv[2], argv[3]);
    } else if (strcmp(mode, "fail") == 0 && argc == 6) {
        fails(argv[2], argv[3], argv[4], argv[5]);
    } else {
        fprintf(stderr, "usage: client play|participate|return|lose|survive|fail SERVER TOKEN…\n");
        return EXIT_FAILURE;
    }
    return checked();
}
