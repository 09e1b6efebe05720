/* Clients that may build change a world that a node computes, and other clients cannot: `builder FOLDER`, run
 * by served.rs. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <time.h>

static DcdWorld server, node, builder, client;

static void step(void)
{
    struct timespec pause = { 0, 5 * 1000 * 1000 };
    OK(dcd_step(server));
    OK(dcd_step(builder));
    OK(dcd_step(client));
    nanosleep(&pause, NULL);
}

enum { BOB = 7 };

/* Finds the bob in this world: ids belong to one world handle. */
static bool find(DcdWorld world, DcdBodyId *body, DcdPose *pose)
{
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(world, &view));
    for (size_t i = 0; i < view.count; i++)
        if (view.user_data[i] == BOB) {
            *body = view.ids[i];
            *pose = view.poses[i];
            return true;
        }
    return false;
}

/* Steps until the client sees the bob between these heights, for at most half a minute. */
static bool comes(double low, double high)
{
    DcdBodyId body;
    DcdPose pose = { { 0.0, -1e6, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    for (int k = 0; k < 6000; k++) {
        if (find(client, &body, &pose) && pose.p[1] > low && pose.p[1] < high)
            return true;
        step();
    }
    printf("it is at %g\n", pose.p[1]);
    return false;
}

static void token(DcdRole role, char *text, size_t cap)
{
    size_t needed = 0;
    OK(dcd_token_create(server, role, 60, text, cap, &needed));
}

static DcdWorld connected(DcdRole role)
{
    char address[64] = "", text[512] = "";
    size_t needed = 0;
    DcdWorld world = { 0 };
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_address(server, address, sizeof address, &needed));
    token(role, text, sizeof text);
    def.server = address;
    def.token = text;
    OK(dcd_client_connect(&def, &world));
    OK(dcd_world_info(world, &info));
    HOLDS(info.role == role);
    return world;
}

int main(int argc, char **argv)
{
    if (argc != 2)
        return 2;
    const float ground_half[3] = { 50.0f, 0.5f, 50.0f }, half[3] = { 0.25f, 0.25f, 0.25f };
    char address[64] = "", text[512] = "";
    size_t needed = 0;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdNodeDef computes = DCD_NODE_DEF_INIT;
    DcdWorldDef empty = DCD_WORLD_DEF_INIT;
    DcdWorld local = { 0 };
    OK(dcd_world_create(&empty, &local));
    def.source = local;
    def.data_path = argv[1];
    OK(dcd_server_create(&def, &server));
    OK(dcd_address(server, address, sizeof address, &needed));
    token(DCD_ROLE_NODE, text, sizeof text);
    computes.server = address;
    computes.token = text;
    OK(dcd_node_join(&computes, &node));
    builder = connected(DCD_ROLE_BUILDER);
    client = connected(DCD_ROLE_CLIENT);

    /* Ground, and a bob that hangs from a post. */
    DcdShapeId ground_shape, box;
    DcdBodyDef ground = DCD_BODY_DEF_INIT, post = DCD_BODY_DEF_INIT, bob = DCD_BODY_DEF_INIT;
    DcdJointDef rope = DCD_JOINT_DEF_INIT;
    DcdBodyId on;
    DcdJointId tied;
    OK(dcd_shape_box(builder, ground_half, &ground_shape));
    OK(dcd_shape_box(builder, half, &box));
    ground.body_type = post.body_type = DCD_FIXED;
    ground.shape = ground_shape;
    post.shape = bob.shape = box;
    post.pose.p[1] = 6.0;
    bob.pose.p[1] = 4.0;
    bob.user_data = BOB;
    OK(dcd_body_create(builder, &ground, &on));
    OK(dcd_body_create(builder, &post, &rope.a));
    OK(dcd_body_create(builder, &bob, &rope.b));
    rope.joint_type = DCD_JOINT_SPHERICAL;
    rope.frame_b.p[1] = 2.0f;
    OK(dcd_joint_create(builder, &rope, &tied));
    HOLDS(dcd_body_is_valid(builder, rope.b) && dcd_joint_is_valid(builder, tied));
    HOLDS(comes(3.9, 4.1));
    OK(dcd_joint_destroy(builder, tied));
    HOLDS(comes(0.7, 0.8));
    const float kick[3] = { 0.0f, 2000.0f, 0.0f }; /* 125 kg: 16 m/s; up, even if it is still falling */
    OK(dcd_body_apply_impulse(builder, rope.b, kick, NULL));
    HOLDS(comes(1.5, 20.0));
    DcdBodyProperties light = DCD_BODY_PROPERTIES_INIT;
    OK(dcd_body_properties(builder, rope.b, &light));
    light.gravity_scale = 0.0f;
    OK(dcd_body_set_properties(builder, rope.b, &light));
    DcdPose up = { { 1.0, 9.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    DcdVelocity still = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_body_set_pose(builder, rope.b, &up));
    OK(dcd_body_set_velocity(builder, rope.b, &still));
    HOLDS(comes(8.9, 9.1));

    /* A client that may not build is told which role may. */
    DcdBodyId none, seen;
    DcdPose at;
    DcdShapeId other;
    OK(dcd_shape_box(client, half, &other));
    post.shape = other;
    FAILS(dcd_body_create(client, &post, &none), DCD_ERR_UNSUPPORTED, "DCD_ROLE_BUILDER");
    HOLDS(find(client, &seen, &at));
    FAILS(dcd_body_destroy(client, seen), DCD_ERR_UNSUPPORTED, "own avatars");
    DcdBodyDef avatar = DCD_BODY_DEF_INIT;
    DcdBodyId both[2] = { { 0 }, seen };
    avatar.shape = other;
    avatar.pose.p[0] = 20.0;
    OK(dcd_body_create(client, &avatar, &both[0]));
    FAILS(dcd_bodies_destroy(client, both, 2), DCD_ERR_UNSUPPORTED, "own avatars");
    HOLDS(dcd_body_is_valid(client, both[0]));
    OK(dcd_body_destroy(client, both[0]));
    FAILS(dcd_body_apply_impulse(client, seen, kick, NULL), DCD_ERR_UNSUPPORTED, "own avatars");
    rope.a = rope.b = seen;
    FAILS(dcd_joint_create(client, &rope, &tied), DCD_ERR_UNSUPPORTED, "DCD_ROLE_BUILDER");

    /* The builder leaves. What it has built stays until another builder removes it. */
    OK(dcd_world_destroy(builder));
    builder = connected(DCD_ROLE_BUILDER);
    HOLDS(comes(8.9, 9.1) && find(builder, &seen, &at));
    OK(dcd_body_destroy(builder, seen));
    HOLDS(!dcd_body_is_valid(builder, seen));
    for (int k = 0; k < 6000 && find(client, &seen, &at); k++)
        step();
    HOLDS(!find(client, &seen, &at));

    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(builder));
    OK(dcd_world_destroy(node));
    OK(dcd_world_destroy(server));
    OK(dcd_world_destroy(local));
    return checked();
}
