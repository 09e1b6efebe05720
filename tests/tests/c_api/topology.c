/* Which node computes which region of a served world, and bodies that change owner: `topology FOLDER`, run by
 * served.rs. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <time.h>

enum { BALLS = 12 };

static DcdStatus step(DcdWorld world)
{
    struct timespec pause = { 0, 5 * 1000 * 1000 };
    nanosleep(&pause, NULL);
    return dcd_step(world);
}

/* Balls that fly over the border one after the other, and one fixed box. */
static DcdWorld scene(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdWorld world = { 0 };
    DcdBodyId made;
    DcdRegionInfo regions[2];
    size_t count = 0;
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    def.regions = 2;
    def.gravity[1] = 0.0f;
    OK(dcd_world_create(&def, &world));
    OK(dcd_regions(world, regions, 2, &count));
    HOLDS(count == 2 && regions[0].node == DCD_NO_NODE && regions[0].max[0] == 0.0 && regions[1].min[0] == 0.0);
    OK(dcd_shape_box(world, half, &body.shape));
    body.body_type = DCD_FIXED;
    body.pose.p[1] = 20.0;
    OK(dcd_body_create(world, &body, &made));
    body.body_type = DCD_DYNAMIC;
    body.pose.p[1] = 0.0;
    OK(dcd_shape_sphere(world, 0.25f, &body.shape));
    for (int i = 0; i < BALLS; i++) {
        body.pose.p[0] = -2.5 * (i + 1);
        body.velocity.linear[0] = 5.0f;
        body.user_data = 100 + (uint64_t)i;
        OK(dcd_body_create(world, &body, &made));
    }
    return world;
}

/* The node of a region, as dcd_regions lists it. */
static uint32_t node_of(DcdWorld world, uint32_t region)
{
    DcdRegionInfo regions[2];
    size_t count = 0;
    OK(dcd_regions(world, regions, 2, &count));
    for (size_t i = 0; i < count; i++)
        if (regions[i].region == region)
            return regions[i].node;
    return DCD_NO_NODE;
}

/* Every ball changes its owner once, from the left region to the right one, and is then owned by the latter.
 * */
static void changes_hands(DcdWorld world, bool is_participant)
{
    DcdRegionInfo regions[2];
    size_t count = 0, changed = 0;
    bool done[BALLS] = { false };
    OK(dcd_regions(world, regions, 2, &count));
    HOLDS(count == 2 && regions[0].min[0] < -1e9 && regions[1].max[0] > 1e9);
    for (int tries = 0; changed < 3 && tries < 6000 && step(world) == DCD_OK; tries++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_events(world, &events));
        for (size_t i = 0; i < events.transfer_count; i++) {
            const DcdTransfer *transfer = &events.transfers[i];
            const size_t ball = (size_t)transfer->user_data - 100;
            DcdOwner owner = DCD_OWNER_INIT;
            DcdPose pose;
            HOLDS(ball < BALLS && !done[ball]);
            HOLDS(transfer->from == regions[0].region && transfer->to == regions[1].region);
            OK(dcd_body_owner(world, transfer->body, &owner));
            OK(dcd_body_get(world, transfer->body, &pose, NULL));
            HOLDS(owner.region == transfer->to && owner.node == node_of(world, owner.region));
            HOLDS((owner.flags & DCD_OWNER_BY_PLACE) == 0 && (owner.flags & DCD_OWNER_HEARD) != 0);
            HOLDS(pose.p[0] > -0.5);
            HOLDS(is_participant || (owner.flags & DCD_OWNER_HERE) == 0);
            done[ball % BALLS] = true;
            changed++;
        }
    }
    HOLDS(changed >= 3);
    /* The balls behind are owned by the left region, and known to be. */
    DcdBodyId last, fixed;
    DcdOwner owner = DCD_OWNER_INIT;
    OK(dcd_body_at(world, 0, &fixed));
    OK(dcd_body_owner(world, fixed, &owner));
    HOLDS(owner.region == DCD_NO_REGION && owner.node == DCD_NO_NODE);
    OK(dcd_body_at(world, BALLS, &last));
    OK(dcd_body_owner(world, last, &owner));
    DcdPose pose;
    OK(dcd_body_get(world, last, &pose, NULL));
    HOLDS(pose.p[0] > 0.0 || (owner.region == regions[0].region && (owner.flags & DCD_OWNER_BY_PLACE) == 0));
    OK(dcd_regions(world, regions, 2, &count));
    HOLDS(regions[0].bodies + regions[1].bodies == BALLS && regions[1].bodies >= changed);
}

int main(int argc, char **argv)
{
    DcdWorld server = { 0 }, node = { 0 }, client = { 0 }, participant = { 0 };
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdNodeDef computes = DCD_NODE_DEF_INIT;
    DcdClientDef sees = DCD_CLIENT_DEF_INIT;
    DcdParticipantDef both = DCD_PARTICIPANT_DEF_INIT;
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    if (argc != 2)
        return 2;
    def.source = scene();
    def.data_path = argv[1];
    def.nodes = 2;
    OK(dcd_server_create(&def, &server));
    OK(dcd_address(server, address, sizeof address, &needed));
    computes.server = sees.server = both.server = address;
    computes.token = sees.token = both.token = token;
    both.threads = 1;
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    OK(dcd_client_connect(&sees, &client));
    /* No node computes yet. */
    HOLDS(node_of(client, 1) == DCD_NO_NODE && node_of(client, 2) == DCD_NO_NODE);
    OK(dcd_token_create(server, DCD_ROLE_NODE, 60, token, sizeof token, &needed));
    OK(dcd_node_join(&computes, &node));
    OK(dcd_token_create(server, DCD_ROLE_PARTICIPANT, 60, token, sizeof token, &needed));
    OK(dcd_participant_join(&both, &participant));

    changes_hands(client, false);
    changes_hands(participant, true);
    HOLDS(node_of(client, 1) != node_of(client, 2));
    HOLDS(node_of(client, 1) == node_of(participant, 1) && node_of(client, 2) == node_of(participant, 2));

    /* One node leaves, and the other computes all regions. */
    OK(dcd_world_destroy(node));
    for (int tries = 0; node_of(client, 1) != node_of(client, 2) && tries < 6000; tries++)
        OK(step(client));
    HOLDS(node_of(client, 1) != DCD_NO_NODE && node_of(client, 1) == node_of(client, 2));
    DcdBodyId ball;
    DcdOwner owner = DCD_OWNER_INIT;
    OK(dcd_body_at(participant, 1, &ball));
    for (int tries = 0; node_of(participant, 1) != node_of(participant, 2) && tries < 6000; tries++)
        OK(step(participant));
    OK(dcd_body_owner(participant, ball, &owner));
    HOLDS((owner.flags & DCD_OWNER_HERE) != 0 && owner.node == node_of(client, 1));

    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(participant));
    OK(dcd_world_destroy(server));
    OK(dcd_world_destroy(def.source));
    return checked();
}
