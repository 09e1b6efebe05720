/* A server's program builds a game in an empty world whose nodes are processes of their own. It plays on
 * while one node is killed and another joins: `killed FOLDER`, run by served.rs. The test reads on standard
 * output when to do what, and answers with a line when it is done. */
#define _POSIX_C_SOURCE 200809L
#include "played.h"

#include <math.h>

/* Boxes in rows, a platform that goes up, and a box that is made while no node computes. */
enum { BOXES = 200, LIFT = BOXES + 1, LATE, COUNT = LATE };

/* Steps until the client sees the i-th body between these heights, for at most half a minute. The lift must
 * never go back below `floor`. */
static bool comes(uint32_t i, double low, double high, double floor)
{
    for (int k = 0; k < 6000; k++) {
        const double y = seen(i).p[1];
        if (y > low && y < high)
            return true;
        step();
        HOLDS(seen(LIFT).p[1] > floor);
    }
    printf("body %u is at %g\n", i, seen(i).p[1]);
    return false;
}

/* Tells the test something, and waits until the test has reacted. */
static void tell(const char *what)
{
    char line[16];
    printf("%s\n", what);
    fflush(stdout);
    HOLDS(fgets(line, sizeof line, stdin) != NULL);
}

/* Prints the address for the test's nodes to join, and two tokens. */
static void tell_nodes(void)
{
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    OK(dcd_address(server, address, sizeof address, &needed));
    printf("%s\n", address);
    for (int k = 0; k < 2; k++) {
        OK(dcd_token_create(server, DCD_ROLE_NODE, 600, token, sizeof token, &needed));
        printf("%s\n", token);
    }
    DcdClientDef sees = DCD_CLIENT_DEF_INIT;
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 600, token, sizeof token, &needed));
    sees.server = address;
    sees.token = token;
    OK(dcd_client_connect(&sees, &client));
    tell("served");
}

int main(int argc, char **argv)
{
    if (argc != 2)
        return 2;
    DcdWorldDef empty = DCD_WORLD_DEF_INIT;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdWorld local = { 0 };
    empty.regions = 2;
    OK(dcd_world_create(&empty, &local));
    def.source = local;
    def.data_path = argv[1];
    OK(dcd_server_create(&def, &server));
    OK(dcd_world_destroy(local));
    tell_nodes();

    const float ground_half[3] = { 100.0f, 0.5f, 100.0f }, half[3] = { 0.25f, 0.25f, 0.25f };
    DcdShapeId ground_shape, box;
    OK(dcd_shape_box(server, ground_half, &ground_shape));
    OK(dcd_shape_box(server, half, &box));
    DcdBodyDef defs[LIFT + 1];
    DcdBodyId bodies[COUNT + 1];
    for (int i = 0; i <= LIFT; i++) {
        defs[i] = (DcdBodyDef)DCD_BODY_DEF_INIT;
        defs[i].shape = box;
        defs[i].pose.p[0] = i % 20 - 10.0;
        defs[i].pose.p[1] = 1.0;
        defs[i].pose.p[2] = i / 20 - 5.0;
        defs[i].user_data = (uint64_t)i;
    }
    defs[0].body_type = DCD_FIXED;
    defs[0].shape = ground_shape;
    defs[0].pose = (DcdPose){ { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    defs[LIFT].body_type = DCD_KINEMATIC;
    defs[LIFT].pose.p[1] = 5.0;
    defs[LIFT].pose.p[2] = 40.0;
    const DcdVelocity up = { { 0.0f, 1.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_bodies_create(server, defs, LIFT + 1, bodies));
    OK(dcd_body_set_velocity(server, bodies[LIFT], &up));
    HOLDS(comes(LIFT, 7.0, 1e3, -1e7) && comes(1, 0.7, 0.8, 6.9) && comes(BOXES, 0.7, 0.8, 6.9));
    static DcdPose before[BOXES + 1];
    for (uint32_t i = 1; i <= BOXES; i++)
        before[i] = seen(i);
    const double height = seen(LIFT).p[1];

    tell("computed");
    /* The node is dead, whether the server has noticed or not. The next node is to do what is created and
     * removed now. */
    DcdBodyDef late = DCD_BODY_DEF_INIT;
    late.shape = box;
    late.pose.p[1] = 9.0;
    late.pose.p[2] = -40.0;
    late.user_data = LATE;
    OK(dcd_body_create(server, &late, &bodies[LATE]));
    OK(dcd_body_destroy(server, bodies[BOXES]));
    step();
    HOLDS(dcd_body_is_valid(server, bodies[LATE]) && !dcd_body_is_valid(server, bodies[BOXES]));
    tell("built");

    /* The other node continues from the first one's state, without its last untold ticks: at most 1.5 s of
     * the lift's way. */
    HOLDS(comes(LATE, 0.7, 0.8, height - 1.5) && comes(LIFT, height + 3.0, 1e3, height - 1.5));
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(client, &view));
    HOLDS(view.count == COUNT - 1);
    bool has[COUNT + 1] = { false };
    for (size_t i = 0; i < view.count; i++)
        if (view.user_data[i] <= COUNT)
            has[view.user_data[i]] = true;
    for (uint32_t i = 1; i <= COUNT; i++)
        HOLDS(has[i] == (i != BOXES));
    for (uint32_t i = 1; i < BOXES; i++)
        for (int k = 0; k < 3; k++)
            HOLDS(fabs(seen(i).p[k] - before[i].p[k]) < 0.02);
    /* It takes the program's requests as the first node did. */
    const float kick[3] = { 0.0f, 1500.0f, 0.0f };
    OK(dcd_body_apply_impulse(server, bodies[1], kick, NULL));
    HOLDS(comes(1, 2.0, 20.0, height) && comes(1, 0.7, 0.8, height));
    OK(dcd_body_destroy(server, bodies[LATE]));
    for (int k = 0; k < 6000 && seen(LATE).p[1] > -1e6; k++)
        step();
    HOLDS(seen(LATE).p[1] == -1e6);
    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(server));
    return checked();
}
