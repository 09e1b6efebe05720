/* How long a served world waits: with avatars for the client that left them, and as a client for its server:
 * `leaving FOLDER`, run by served.rs. */
#include "checks.h"

#include <time.h>

static DcdWorld server, node;

static DcdWorld join(const char *identity)
{
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    DcdWorld client = { 0 };
    OK(dcd_address(server, address, sizeof address, &needed));
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    def.server = address;
    def.token = token;
    def.identity_path = identity;
    def.give_up_ms = 300;
    OK(dcd_client_connect(&def, &client));
    return client;
}

static size_t bodies_of(DcdWorld world)
{
    size_t count = 0;
    OK(dcd_bodies(world, NULL, 0, &count));
    return count;
}

/* Waits until the server has this many bodies, for at most half a minute. */
static bool has(size_t bodies, DcdWorld client)
{
    for (int i = 0; i < 6000; i++) {
        OK(dcd_step(server));
        if (client.v != 0)
            OK(dcd_step(client));
        if (bodies_of(server) == bodies)
            return true;
        (void)dcd_poll(server, 5); /* a timeout is no error here */
    }
    return false;
}

/* A client that comes back after the expiry finds its avatar gone. */
static void avatars_are_removed(const char *folder)
{
    char identity[600];
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId avatar;
    snprintf(identity, sizeof identity, "%s/client.id", folder);
    DcdWorld client = join(identity);
    OK(dcd_shape_sphere(client, 0.5f, &def.shape));
    OK(dcd_body_create(client, &def, &avatar));
    HOLDS(has(1, client));
    OK(dcd_world_destroy(client));
    HOLDS(has(0, (DcdWorld){ 0 }));
    for (const time_t left = time(NULL); time(NULL) - left < 2;) {
        OK(dcd_step(server));
        (void)dcd_poll(server, 5);
    }
    size_t avatars = 1;
    client = join(identity);
    OK(dcd_own_avatars(client, NULL, 0, &avatars));
    HOLDS(avatars == 0);
    OK(dcd_world_destroy(client));
}

/* The server goes and does not come back: the client gives up much earlier than after half a minute. */
static void clients_give_up(void)
{
    DcdWorld client = join(NULL);
    DcdStatus status = DCD_OK;
    OK(dcd_world_destroy(node));
    OK(dcd_server_suspend(server));
    OK(dcd_world_destroy(server));
    const time_t begun = time(NULL);
    while (status == DCD_OK && time(NULL) - begun < 60) {
        status = dcd_step(client);
        if (status == DCD_OK)
            (void)dcd_poll(client, 5);
    }
    HOLDS(status == DCD_ERR_NETWORK && time(NULL) - begun < 20);
    OK(dcd_world_destroy(client));
}

int main(int argc, char **argv)
{
    if (argc != 2)
        return 2;
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    DcdWorld local = { 0 };
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdNodeDef computes = DCD_NODE_DEF_INIT;
    DcdClientDef odd = DCD_CLIENT_DEF_INIT;
    OK(dcd_world_create(&(DcdWorldDef)DCD_WORLD_DEF_INIT, &local));
    def.source = local;
    def.data_path = argv[1];
    def.avatar_expiry = 0.0f;
    FAILS(dcd_server_create(&def, &server), DCD_ERR_ARGUMENT, "avatar_expiry is 0");
    def.avatar_expiry = 4e7f;
    FAILS(dcd_server_create(&def, &server), DCD_ERR_ARGUMENT, "avatar_expiry");
    def.avatar_expiry = 0.3f;
    def.reserved = 1;
    FAILS(dcd_server_create(&def, &server), DCD_ERR_ARGUMENT, "reserved");
    def.reserved = 0;
    OK(dcd_server_create(&def, &server));
    OK(dcd_world_destroy(local));
    odd.server = "127.0.0.1:1";
    odd.token = "dcd1-";
    odd.reserved = 1;
    FAILS(dcd_client_connect(&odd, &local), DCD_ERR_ARGUMENT, "reserved");
    OK(dcd_address(server, address, sizeof address, &needed));
    OK(dcd_token_create(server, DCD_ROLE_NODE, 60, token, sizeof token, &needed));
    computes.server = address;
    computes.token = token;
    computes.threads = 1;
    computes.give_up_ms = 300;
    OK(dcd_node_join(&computes, &node));
    avatars_are_removed(argv[1]);
    clients_give_up();
    return checked();
}
