/* A server, two nodes and a client in one process, over loopback: `roles FOLDER`, run by served.rs. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <time.h>

/* Calls dcd_step, as often as a game would, until the world has reached this tick. */
static bool reaches(DcdWorld world, uint64_t tick)
{
    struct timespec pause = { 0, 5 * 1000 * 1000 };
    for (int i = 0; i < 6000; i++) {
        DcdWorldInfo info = DCD_WORLD_INFO_INIT;
        if (dcd_step(world) != DCD_OK || dcd_world_info(world, &info) != DCD_OK)
            return false;
        if (info.tick >= tick)
            return true;
        nanosleep(&pause, NULL);
    }
    return false;
}

static void bad_definitions(const char *folder)
{
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdGroupDef groups = DCD_GROUP_DEF_INIT;
    DcdWorld world = { 0 };
    FAILS(dcd_server_create(NULL, &world), DCD_ERR_NULL, "def");
    FAILS(dcd_server_create(&def, &world), DCD_ERR_NULL, "scene");
    def.scene = "pile";
    FAILS(dcd_server_create(&def, &world), DCD_ERR_NULL, "data_path");
    def.data_path = folder;
    FAILS(dcd_server_create(&def, NULL), DCD_ERR_NULL, "out");
    def.struct_size--;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_STRUCT, "DcdServerDef");
    def.struct_size++;
    def.nodes = 0;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "nodes");
    def.nodes = 1;
    def.flags = 64;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "flags");
    def.flags = 0;
    def.avatar_speed = 0.0f;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "avatar_speed");
    def.avatar_speed = 20.0f;
    def.state_every = 0;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "state_every is 0; ");
    def.state_every = 31;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "state_every");
    def.state_every = 3;
    def.verify = 1.5f;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "verify is 1.5");
    def.verify = 0.0f;
    def.listen = "here";
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "0.0.0.0:7420");
    def.listen = "127.0.0.1:0";
    def.metrics = "there";
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "metrics");
    def.metrics = "\xff";
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "UTF-8");
    def.metrics = NULL;
    def.directory = "somewhere else";
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "etcd");
    def.directory = NULL;
    def.scene = "no such scene";
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "no such scene");
    def.scene = "pile";
    def.groups = &groups;
    groups.near_ms = 60.0f;
    groups.far_ms = 30.0f;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "far_ms");
    groups.near_ms = groups.far_ms = 0.0f;
    groups.lag_ticks = 61;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "lag_ticks");
    groups.lag_ticks = 6;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "owner");
    groups.lag_ticks = 0;
    groups.agree = -1.0f;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "agree");
    groups.agree = 0.1f;
    groups.size = 0;
    FAILS(dcd_server_create(&def, &world), DCD_ERR_ARGUMENT, "size");
    HOLDS(world.v == 0);
}

/* The errors of a process that shows nothing of its world. */
static void cannot(DcdWorld world, const char *role)
{
    DcdShapeId shape = { 0 };
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdBodyId id = { 0 };
    DcdStateView view = DCD_STATE_VIEW_INIT;
    DcdOwner owner = DCD_OWNER_INIT;
    DcdQueryId query;
    uint64_t hash = 0;
    size_t needed = 0;
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    OK(dcd_shape_box(world, half, &shape));
    body.shape = shape;
    FAILS(dcd_body_create(world, &body, &id), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_state_view(world, &view), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_state_hash(world, &hash), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_borders(world, NULL, 0, &needed), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_interest_set(world, NULL, 0.0), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_cast_rays_submit(world, NULL, 0, NULL, &query), DCD_ERR_UNSUPPORTED, role);
    FAILS(dcd_body_owner(world, (DcdBodyId){ 1 }, &owner), DCD_ERR_UNSUPPORTED, role);
    HOLDS(id.v == 0 && hash == 0);
}

/* Joins a node and a client. */
static void join(DcdWorld server, DcdWorld *node, DcdWorld *client)
{
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    DcdNodeDef computes = DCD_NODE_DEF_INIT;
    DcdClientDef sees = DCD_CLIENT_DEF_INIT;
    computes.server = sees.server = address;
    computes.token = sees.token = token;
    OK(dcd_address(server, address, sizeof address, &needed));
    /* A client need not wait for nodes. */
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    OK(dcd_client_connect(&sees, client));
    OK(dcd_token_create(server, DCD_ROLE_NODE, 60, token, sizeof token, &needed));
    FAILS(dcd_client_connect(&sees, node), DCD_ERR_ARGUMENT, "dcd_token_create");
    OK(dcd_node_join(&computes, node));
}

/* A world built here is served as it is: a box at rest, and a ball on a joint that swings below it. */
static void own_world(const char *folder)
{
    DcdWorld local = { 0 }, server = { 0 }, node = { 0 }, client = { 0 };
    DcdWorldDef world = DCD_WORLD_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdJointDef joint = DCD_JOINT_DEF_INIT;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdBodyId box, ball;
    DcdShapeId cube, sphere;
    DcdJointId held;
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    world.regions = 2;
    world.gravity[1] = -5.0f;
    OK(dcd_world_create(&world, &local));
    OK(dcd_shape_box(local, half, &cube));
    OK(dcd_shape_sphere(local, 0.25f, &sphere));
    body.body_type = DCD_FIXED;
    body.shape = cube;
    body.pose.p[1] = 10.0;
    body.user_data = 1;
    OK(dcd_body_create(local, &body, &box));
    body.body_type = DCD_DYNAMIC;
    body.shape = sphere;
    body.pose.p[0] = 3.0;
    body.user_data = 2;
    OK(dcd_body_create(local, &body, &ball));
    joint.a = box;
    joint.b = ball;
    joint.joint_type = DCD_JOINT_SPHERICAL;
    joint.frame_b.p[0] = -3.0f;
    OK(dcd_joint_create(local, &joint, &held));

    def.data_path = folder;
    def.source = local;
    def.scene = "pile";
    FAILS(dcd_server_create(&def, &server), DCD_ERR_ARGUMENT, "source");
    def.scene = NULL;
    OK(dcd_server_create(&def, &server));
    def.source = server;
    FAILS(dcd_server_create(&def, &node), DCD_ERR_UNSUPPORTED, "server");
    /* The server has a copy of the world. */
    OK(dcd_world_destroy(local));
    def.source = local;
    FAILS(dcd_server_create(&def, &node), DCD_ERR_STALE_ID, "world");

    join(server, &node, &client);
    HOLDS(reaches(client, 60));
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_world_info(client, &info));
    HOLDS(info.regions == 2 && info.gravity[1] == -5.0f);
    OK(dcd_state_view(client, &view));
    HOLDS(view.count == 1);
    if (view.count == 1) {
        /* The ball swings: it is lower than where it was made, and as far from the box. */
        double x = view.poses[0].p[0], y = view.poses[0].p[1] - 10.0;
        HOLDS(view.user_data[0] == 2);
        HOLDS(y < -1.0 && x * x + y * y > 8.9 && x * x + y * y < 9.1);
    }
    OK(dcd_world_destroy(server));
    OK(dcd_world_destroy(node));
    OK(dcd_world_destroy(client));
}

/* If nothing moves, time goes on all the same, for the server too. */
static void world_at_rest(const char *folder)
{
    DcdWorld local = { 0 }, server = { 0 }, node = { 0 }, client = { 0 };
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdBodyId box;
    DcdStats stats = DCD_STATS_INIT;
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    DcdWorldDef world = DCD_WORLD_DEF_INIT;
    OK(dcd_world_create(&world, &local));
    OK(dcd_shape_box(local, half, &body.shape));
    body.flags = DCD_BODY_ASLEEP;
    OK(dcd_body_create(local, &body, &box));
    def.data_path = folder;
    def.source = local;
    OK(dcd_server_create(&def, &server));
    OK(dcd_world_destroy(local));
    join(server, &node, &client);
    HOLDS(reaches(client, 90) && reaches(server, 120) && reaches(client, 150));
    OK(dcd_stats(client, &stats));
    HOLDS(stats.updates <= 2);
    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(node));
    OK(dcd_world_destroy(server));
}

int main(int argc, char **argv)
{
    char folder[512];
    if (argc != 2)
        return 2;
    snprintf(folder, sizeof folder, "%s-own", argv[1]);
    own_world(folder);
    snprintf(folder, sizeof folder, "%s-rest", argv[1]);
    world_at_rest(folder);
    bad_definitions(argv[1]);

    const char *params[] = { "n=40" };
    DcdWorldDef cut = DCD_WORLD_DEF_INIT;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdWorld server = { 0 }, local = { 0 }, nodes[2] = { { 0 }, { 0 } }, client = { 0 }, other = { 0 };
    cut.regions = 2;
    def.scene = "pile";
    def.params = params;
    def.param_count = 1;
    def.world = &cut;
    def.nodes = 2;
    def.data_path = argv[1];
    def.user_data = 7;
    def.metrics = "127.0.0.1:0";
    OK(dcd_server_create(&def, &server));
    def.metrics = NULL;
    FAILS(dcd_server_create(&def, &other), DCD_ERR_IO, "");

    char address[64] = "", token[512] = "", small[4] = "", metrics[64] = "";
    size_t needed = 0;
    FAILS(dcd_metrics_address(server, small, sizeof small, NULL), DCD_ERR_NULL, "needed");
    FAILS(dcd_metrics_address(server, small, sizeof small, &needed), DCD_ERR_SMALL_BUFFER, "room");
    OK(dcd_metrics_address(server, metrics, sizeof metrics, &needed));
    HOLDS(strncmp(metrics, "127.0.0.1:", 10) == 0 && strcmp(metrics, "127.0.0.1:0") != 0 && strlen(metrics) + 1 == needed);
    /* A second server cannot take the address. */
    def.metrics = metrics;
    snprintf(folder, sizeof folder, "%s-taken", argv[1]);
    def.data_path = folder;
    FAILS(dcd_server_create(&def, &other), DCD_ERR_NETWORK, metrics);
    def.metrics = NULL;
    def.data_path = argv[1];
    FAILS(dcd_address(server, small, sizeof small, NULL), DCD_ERR_NULL, "needed");
    FAILS(dcd_address(server, small, sizeof small, &needed), DCD_ERR_SMALL_BUFFER, "room");
    HOLDS(needed > sizeof "127.0.0.1:" && needed <= sizeof address && small[0] == 0);
    OK(dcd_address(server, address, sizeof address, &needed));
    HOLDS(strncmp(address, "127.0.0.1:", 10) == 0 && strlen(address) + 1 == needed);
    OK(dcd_token_create(server, DCD_ROLE_NODE, 60, NULL, 0, &needed));
    HOLDS(needed <= sizeof token);
    FAILS(dcd_token_create(server, DCD_ROLE_SERVER, 60, token, sizeof token, &needed), DCD_ERR_ARGUMENT, "role");
    FAILS(dcd_token_create(server, DCD_ROLE_NODE, 0, token, sizeof token, &needed), DCD_ERR_ARGUMENT, "valid_seconds");

    DcdNodeDef node = DCD_NODE_DEF_INIT;
    node.server = address;
    node.token = token;
    for (int i = 0; i < 2; i++) {
        OK(dcd_token_create(server, DCD_ROLE_NODE, 60, token, sizeof token, &needed));
        HOLDS(strlen(token) + 1 == needed);
        node.listen = i == 0 ? NULL : "nowhere";
        if (i > 0)
            FAILS(dcd_node_join(&node, &nodes[i]), DCD_ERR_ARGUMENT, "listen");
        node.listen = NULL;
        node.advertise = "elsewhere";
        FAILS(dcd_node_join(&node, &nodes[i]), DCD_ERR_ARGUMENT, "advertise");
        node.advertise = NULL;
        node.user_data = 100 + (uint64_t)i;
        node.metrics = i == 0 ? "127.0.0.1:0" : NULL;
        OK(dcd_node_join(&node, &nodes[i]));
        if (i == 0)
            FAILS(dcd_metrics_address(nodes[i], small, 0, &needed), DCD_ERR_SMALL_BUFFER, "");
        else
            FAILS(dcd_metrics_address(nodes[i], metrics, sizeof metrics, &needed), DCD_ERR_UNSUPPORTED, "metrics");
    }
    FAILS(dcd_node_join(&node, &other), DCD_ERR_NETWORK, "");

    DcdClientDef join = DCD_CLIENT_DEF_INIT;
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    join.server = address;
    join.token = token;
    node.token = token;
    FAILS(dcd_node_join(&node, &other), DCD_ERR_ARGUMENT, "node");
    OK(dcd_client_connect(&join, &client));
    HOLDS(reaches(client, 30));
    HOLDS(reaches(server, 30) && reaches(nodes[0], 30) && reaches(nodes[1], 30));

    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(client, &view));
    HOLDS(view.count == 40);

    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    DcdStats stats = DCD_STATS_INIT;
    OK(dcd_world_info(server, &info));
    HOLDS(info.role == DCD_ROLE_SERVER && info.regions == 2 && info.user_data == 7 && info.client == 0);
    HOLDS(info.dt > 0.01f && info.dt < 0.02f && info.gravity[1] < -9.0f);
    OK(dcd_stats(server, &stats));
    HOLDS(stats.bodies == 40 && stats.bytes_in > 0 && stats.bytes_out > 0);
    uint64_t owned = 0;
    for (int i = 0; i < 2; i++) {
        OK(dcd_world_info(nodes[i], &info));
        HOLDS(info.role == DCD_ROLE_NODE && info.regions == 1 && info.user_data == 100 + (uint64_t)i);
        OK(dcd_stats(nodes[i], &stats));
        HOLDS(stats.bytes_in > 0 && stats.last_step > 0.0);
        owned += stats.bodies;
        OK(dcd_address(nodes[i], address, sizeof address, &needed));
        cannot(nodes[i], "node");
        FAILS(dcd_token_create(nodes[i], DCD_ROLE_CLIENT, 60, token, sizeof token, &needed), DCD_ERR_UNSUPPORTED, "node");
    }
    HOLDS(owned == 40);
    /* A server's program sees the server's record and can change the world, but computes nothing. */
    OK(dcd_state_view(server, &view));
    HOLDS(view.count == 40);
    uint64_t hash = 0;
    FAILS(dcd_state_hash(server, &hash), DCD_ERR_UNSUPPORTED, "server");
    FAILS(dcd_interest_set(server, NULL, 0.0), DCD_ERR_UNSUPPORTED, "server");
    FAILS(dcd_bandwidth_set(server, 1000), DCD_ERR_UNSUPPORTED, "server");
    FAILS(dcd_prediction_set(server, true), DCD_ERR_UNSUPPORTED, "server");
    OK(dcd_world_create(&cut, &local));
    FAILS(dcd_address(local, address, sizeof address, &needed), DCD_ERR_UNSUPPORTED, "local");
    FAILS(dcd_address(client, address, sizeof address, &needed), DCD_ERR_UNSUPPORTED, "client");

    /* One node leaves in order: the other computes both regions. */
    uint64_t before = info.tick;
    OK(dcd_world_destroy(nodes[0]));
    FAILS(dcd_step(nodes[0]), DCD_ERR_STALE_ID, "world");
    HOLDS(reaches(client, before + 30) && reaches(nodes[1], before + 30));
    OK(dcd_world_info(nodes[1], &info));
    HOLDS(info.regions == 2);

    /* The server ends the world for all. */
    OK(dcd_world_destroy(server));
    HOLDS(!reaches(nodes[1], UINT64_MAX));
    FAILS(dcd_step(nodes[1]), DCD_ERR_NETWORK, "ended");
    HOLDS(!reaches(client, UINT64_MAX));
    OK(dcd_world_destroy(nodes[1]));
    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(local));
    return checked();
}
