/* A server's program builds a game in an empty world that a node computes, and a client sees it:
 * `building FOLDER`, run by served.rs. */
#define _POSIX_C_SOURCE 200809L
#include "played.h"

#include <math.h>

enum { BOXES = 2000 };

static DcdWorld node;

/* Steps until the client sees the i-th body between these heights, for at most half a minute. */
static bool comes(uint32_t i, double low, double high)
{
    for (int k = 0; k < 6000; k++) {
        const double y = seen(i).p[1];
        if (y > low && y < high)
            return true;
        step();
    }
    printf("body %u is at %g\n", i, seen(i).p[1]);
    return false;
}

static void join(void)
{
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    DcdNodeDef computes = DCD_NODE_DEF_INIT;
    DcdClientDef sees = DCD_CLIENT_DEF_INIT;
    computes.server = sees.server = address;
    computes.token = sees.token = token;
    OK(dcd_address(server, address, sizeof address, &needed));
    OK(dcd_token_create(server, DCD_ROLE_NODE, 60, token, sizeof token, &needed));
    OK(dcd_node_join(&computes, &node));
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    OK(dcd_client_connect(&sees, &client));
}

/* A ball that reports contacts falls where two regions meet: its contact is reported once, and a ray of the
 * program finds the ball. */
static void hears_and_asks(DcdShapeId shape, DcdBodyId ground)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId ball;
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    DcdRay ray = DCD_RAY_INIT;
    DcdRayHit hit;
    DcdQueryId query;
    size_t began = 0, count = 0;
    def.shape = shape;
    def.pose.p[1] = 3.0;
    def.pose.p[2] = 60.0;
    def.events = DCD_EVENT_CONTACT;
    OK(dcd_body_create(server, &def, &ball));
    for (int k = 0; k < 6000 && began == 0; k++) {
        step();
        OK(dcd_events(server, &events));
        for (size_t i = 0; i < events.contact_count; i++) {
            const DcdContact *contact = &events.contacts[i];
            HOLDS(contact->a.v == ground.v && contact->b.v == ball.v);
            began++;
        }
    }
    HOLDS(began == 1);
    ray.origin[1] = 20.0;
    ray.origin[2] = 60.0;
    ray.direction[1] = -1.0f;
    OK(dcd_cast_rays_submit(server, &ray, 1, NULL, &query));
    DcdStatus status = DCD_ERR_BUSY;
    for (int k = 0; k < 6000 && status == DCD_ERR_BUSY; k++) {
        step();
        status = dcd_query_poll(server, query, &hit, 1, &count);
    }
    HOLDS(status == DCD_OK && count == 1 && hit.body.v == ball.v);
    OK(dcd_body_destroy(server, ball));
}

/* The number of bodies that a client sees. `has` says whether one of them has these user data. */
static uint32_t sees(DcdWorld who, uint64_t user_data, bool *has)
{
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_step(who));
    OK(dcd_state_view(who, &view));
    *has = false;
    for (uint32_t i = 0; i < view.count; i++)
        *has |= view.user_data[i] == user_data;
    return view.count;
}

/* A client that joins with an interest is told what is near, then what comes there, and finally everything,
 * if it asks for it. */
static void sees_what_is_near(DcdBodyId far, const DcdPose *home)
{
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    DcdWorld near = { 0 };
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    OK(dcd_address(server, address, sizeof address, &needed));
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    def.server = address;
    def.token = token;
    def.interest_centre[0] = -24.0;
    def.interest_centre[2] = -20.0;
    def.interest_radius = 3.0;
    OK(dcd_client_connect(&def, &near));
    bool has;
    HOLDS(sees(near, 1, &has) < BOXES / 20 && has);
    sees(near, BOXES, &has);
    HOLDS(!has);
    DcdPose pose = { { -24.0, 4.0, -20.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    OK(dcd_body_set_pose(server, far, &pose));
    for (int k = 0; k < 6000 && !has; k++) {
        sees(near, BOXES, &has);
        step();
    }
    HOLDS(has && sees(near, BOXES, &has) < BOXES / 20);
    OK(dcd_interest_set(near, NULL, 0.0));
    uint32_t count = 0;
    for (int k = 0; k < 6000 && count < BOXES; k++) {
        count = sees(near, BOXES, &has);
        step();
    }
    HOLDS(count == BOXES);
    OK(dcd_world_destroy(near));
    OK(dcd_body_set_pose(server, far, home));
    step();
    HOLDS(comes(BOXES, 0.7, 0.8));
}

/* A client's character walks over the border to a wall that the program builds, jumps there and comes down.
 * */
static void walks_to_the_wall(void)
{
    const float wall_half[3] = { 0.5f, 2.0f, 5.0f };
    DcdShapeId wall_shape, capsule;
    DcdBodyDef wall = DCD_BODY_DEF_INIT, person = DCD_BODY_DEF_INIT;
    DcdCharacterDef character = DCD_CHARACTER_DEF_INIT;
    DcdBodyId id, built;
    DcdPose pose = { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    DcdVelocity go = { { 3.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    OK(dcd_shape_box(server, wall_half, &wall_shape));
    OK(dcd_shape_capsule(client, 0.5f, 0.3f, &capsule));
    wall.body_type = DCD_FIXED;
    wall.shape = wall_shape;
    wall.pose.p[0] = 4.5;
    wall.pose.p[2] = -60.0;
    OK(dcd_body_create(server, &wall, &built));
    person.body_type = DCD_KINEMATIC;
    person.shape = capsule;
    person.pose.p[0] = -3.0;
    person.pose.p[1] = 1.5;
    person.pose.p[2] = -60.0;
    OK(dcd_character_create(client, &person, &character, &id));
    OK(dcd_body_set_velocity(client, id, &go));
    for (int k = 0; k < 6000 && pose.p[0] < 3.6; k++) {
        step();
        OK(dcd_body_get(client, id, &pose, NULL));
        HOLDS(pose.p[0] < 3.75);
    }
    HOLDS(pose.p[0] > 3.6 && pose.p[1] > 1.28 && pose.p[1] < 1.4);
    go.linear[1] = 5.0f;
    OK(dcd_body_set_velocity(client, id, &go));
    double highest = 0.0;
    for (int k = 0; k < 6000 && highest < 2.0; k++) {
        step();
        OK(dcd_body_get(client, id, &pose, NULL));
        highest = pose.p[1] > highest ? pose.p[1] : highest;
    }
    HOLDS(highest > 2.0 && pose.p[0] < 3.75);
    OK(dcd_body_destroy(client, id));
    OK(dcd_body_destroy(server, built));
    step();
}

/* A client's car, computed by nodes, drives over the border. */
static void drives_over_the_border(void)
{
    const float half[3] = { 1.6f, 0.4f, 0.8f };
    DcdShapeId box;
    DcdBodyDef chassis = DCD_BODY_DEF_INIT;
    DcdVehicleDef car = DCD_VEHICLE_DEF_INIT;
    DcdWheel wheels[4] = { DCD_WHEEL_INIT, DCD_WHEEL_INIT, DCD_WHEEL_INIT, DCD_WHEEL_INIT };
    DcdDrive drive = { 1.0f, 0.0f, 0.0f };
    DcdPose pose = { { -5.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    DcdBodyId id;
    for (int k = 0; k < 4; k++) {
        wheels[k].at[0] = k < 2 ? 1.2f : -1.2f;
        wheels[k].at[1] = -0.2f;
        wheels[k].at[2] = k % 2 ? 0.8f : -0.8f;
        wheels[k].engine_force = 2000.0f;
    }
    car.wheels = wheels;
    car.wheel_count = 4;
    OK(dcd_shape_box(client, half, &box));
    chassis.shape = box;
    chassis.density = 250.0f;
    chassis.pose.p[0] = -5.0;
    chassis.pose.p[1] = 1.5;
    chassis.pose.p[2] = -70.0;
    OK(dcd_vehicle_create(client, &chassis, &car, &id));
    OK(dcd_vehicle_drive(client, id, &drive));
    for (int k = 0; k < 6000 && pose.p[0] < 5.0; k++) {
        step();
        OK(dcd_body_get(client, id, &pose, NULL));
    }
    HOLDS(pose.p[0] > 5.0 && pose.p[1] > 0.9 && pose.p[1] < 1.6 && pose.p[2] > -70.5 && pose.p[2] < -69.5);
    OK(dcd_body_destroy(client, id));
    step();
}

/* Waits until the client sees this many movable bodies. */
static bool counts(uint32_t bodies)
{
    DcdStateView view = DCD_STATE_VIEW_INIT;
    for (int k = 0; k < 6000; k++) {
        OK(dcd_state_view(client, &view));
        if (view.count == bodies)
            return true;
        step();
    }
    return false;
}

/* The game is saved while nodes compute it, and then restored: the removed body is back, and the new one is
 * gone. */
static void goes_back(const char *folder, DcdBodyId body, const DcdBodyDef *like, uint32_t bodies)
{
    char path[512];
    DcdBodyId new_one, seen_one;
    snprintf(path, sizeof path, "%s/half.dcd", folder);
    HOLDS(counts(bodies));
    FAILS(dcd_snapshot_save_file(client, path), DCD_ERR_UNSUPPORTED, "server keeps");
    OK(dcd_snapshot_save_file(server, path));
    OK(dcd_body_create(server, like, &new_one));
    HOLDS(counts(bodies + 1));
    OK(dcd_body_destroy(server, body));
    HOLDS(counts(bodies) && !dcd_body_is_valid(server, body));
    FAILS(dcd_snapshot_load_file(client, path), DCD_ERR_UNSUPPORTED, "server keeps");
    OK(dcd_snapshot_load_file(server, path));
    HOLDS(dcd_body_is_valid(server, body) && !dcd_body_is_valid(server, new_one));
    for (int k = 0; k < 6000 && dcd_body_at(client, BOXES, &seen_one) != DCD_OK; k++)
        step();
    HOLDS(dcd_body_is_valid(client, seen_one) && counts(bodies));
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
    join();

    const float ground_half[3] = { 100.0f, 0.5f, 100.0f }, half[3] = { 0.25f, 0.25f, 0.25f };
    const float deck[3] = { 2.0f, 0.25f, 2.0f };
    DcdShapeId ground_shape, box, plate;
    OK(dcd_shape_box(server, ground_half, &ground_shape));
    OK(dcd_shape_box(server, half, &box));
    OK(dcd_shape_box(server, deck, &plate));
    static DcdBodyDef defs[BOXES + 1];
    static DcdBodyId bodies[BOXES + 1];
    defs[0] = (DcdBodyDef)DCD_BODY_DEF_INIT;
    defs[0].body_type = DCD_FIXED;
    defs[0].shape = ground_shape;
    for (int i = 1; i <= BOXES; i++) {
        defs[i] = (DcdBodyDef)DCD_BODY_DEF_INIT;
        defs[i].shape = box;
        defs[i].pose.p[0] = i % 50 - 25.0;
        defs[i].pose.p[1] = 1.0;
        defs[i].pose.p[2] = i / 50 - 20.0;
        defs[i].user_data = (uint64_t)i;
    }
    OK(dcd_bodies_create(server, defs, BOXES + 1, bodies));
    HOLDS(dcd_body_is_valid(server, bodies[BOXES]));
    HOLDS(comes(BOXES, 0.7, 0.8) && comes(1, 0.7, 0.8));
    DcdStateView view = DCD_STATE_VIEW_INIT;
    OK(dcd_state_view(client, &view));
    HOLDS(view.count == BOXES && view.user_data[BOXES - 1] == BOXES);
    OK(dcd_state_view(server, &view));
    HOLDS(view.count == BOXES && view.user_data[0] == 1);
    sees_what_is_near(bodies[BOXES], &defs[BOXES].pose);

    /* A platform that goes up, with a ball that swings below it. */
    DcdBodyDef lift = DCD_BODY_DEF_INIT, bob = DCD_BODY_DEF_INIT;
    DcdJointDef rope = DCD_JOINT_DEF_INIT;
    DcdJointId tied;
    DcdVelocity up = { { 0.0f, 2.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    lift.body_type = DCD_KINEMATIC;
    lift.shape = plate;
    lift.pose.p[1] = 5.0;
    lift.pose.p[2] = 40.0;
    bob.shape = box;
    bob.pose.p[1] = 3.0;
    bob.pose.p[2] = 40.0;
    DcdRay down = DCD_RAY_INIT;
    DcdQueryId query;
    down.direction[1] = -1.0f;
    OK(dcd_body_create(server, &lift, &rope.a));
    OK(dcd_cast_rays_submit(server, &down, 1, NULL, &query)); /* a query in between does not separate bodies that are then tied */
    OK(dcd_query_cancel(server, query));
    OK(dcd_body_create(server, &bob, &rope.b));
    rope.joint_type = DCD_JOINT_SPHERICAL;
    rope.frame_b.p[1] = 2.0f;
    OK(dcd_joint_create(server, &rope, &tied));
    HOLDS(dcd_joint_is_valid(server, tied));
    step();
    HOLDS(dcd_joint_is_valid(server, tied));
    OK(dcd_body_set_velocity(server, rope.a, &up));
    HOLDS(comes(BOXES + 2, 6.0, 30.0));
    rope.a = bodies[1];
    FAILS(dcd_joint_create(server, &rope, &tied), DCD_ERR_UNSUPPORTED, "before the next step");
    OK(dcd_joint_destroy(server, tied));
    HOLDS(!dcd_joint_is_valid(server, tied));
    step();
    HOLDS(!dcd_joint_is_valid(server, tied));
    FAILS(dcd_joint_destroy(server, tied), DCD_ERR_STALE_ID, "");
    HOLDS(comes(BOXES + 2, 0.7, 0.8));

    /* A push throws a box up: each N s per kilogram is 1 m/s. */
    float kick[3] = { 0.0f, 1500.0f, 0.0f };
    OK(dcd_body_apply_impulse(server, bodies[BOXES], kick, NULL));
    HOLDS(comes(BOXES, 2.0, 20.0) && comes(BOXES, 0.7, 0.8));
    FAILS(dcd_body_apply_impulse(server, bodies[0], kick, NULL), DCD_ERR_ARGUMENT, "dynamic");

    /* Removed bodies are gone for all, and the others stay. */
    OK(dcd_bodies_destroy(server, bodies + 1, BOXES / 2));
    HOLDS(!dcd_body_is_valid(server, bodies[1]) && dcd_body_is_valid(server, bodies[BOXES]));
    HOLDS(counts(BOXES / 2 + 2));
    goes_back(argv[1], bodies[BOXES], &defs[BOXES], BOXES / 2 + 2);

    hears_and_asks(box, bodies[0]);
    walks_to_the_wall();
    drives_over_the_border();

    /* The server stops and starts again. The node has computed meanwhile, and the client plays on. */
    char address[64] = "";
    size_t needed = 0;
    OK(dcd_address(server, address, sizeof address, &needed));
    OK(dcd_server_suspend(server));
    FAILS(dcd_step(server), DCD_ERR_NETWORK, "the world is kept");
    FAILS(dcd_server_suspend(client), DCD_ERR_UNSUPPORTED, "client");
    OK(dcd_world_destroy(server));
    def.listen = address;
    const float speed = def.avatar_speed;
    def.avatar_speed = speed + 1.0f;
    FAILS(dcd_server_create(&def, &server), DCD_ERR_ARGUMENT, "another world");
    def.avatar_speed = speed;
    OK(dcd_server_create(&def, &server));
    OK(dcd_world_destroy(local));
    OK(dcd_body_at(server, BOXES, &bodies[BOXES]));
    DcdPose above = { { 0.0, 20.0, -60.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    OK(dcd_body_set_pose(server, bodies[BOXES], &above));
    for (int k = 0; k < 6000 && seen(BOXES).p[1] < 10.0; k++)
        step();
    HOLDS(seen(BOXES).p[1] > 10.0);
    HOLDS(comes(BOXES, 0.7, 0.8));
    OK(dcd_body_at(server, 0, &bodies[0]));
    OK(dcd_shape_box(server, half, &box));
    hears_and_asks(box, bodies[0]);
    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(node));
    OK(dcd_world_destroy(server));
    return checked();
}
