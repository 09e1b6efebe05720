/* The loop of a game around a world: frames of uneven length, steps of fixed length, and drawing between two steps.
 *
 *   game_loop                 a local world
 *   game_loop SERVER TOKEN    a served world, as a client: only the lines that make the world and those that draw differ
 *
 * The frames are simulated, so that the program always prints the same in a local world. A real game takes the length
 * of its last frame from its own clock, and draws where this program prints. */
#define _POSIX_C_SOURCE 200809L /* nanosleep */

#include "dcd.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { FRAMES = 300, SIDE = 4, BALLS = SIDE * SIDE };

static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[512];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

/* The length of a frame in seconds: about 1/75, sometimes three times that. */
static double frame_length(int frame)
{
    return frame % 50 == 49 ? 3.0 / 75.0 : (1.0 + 0.1 * (frame % 3 - 1)) / 75.0;
}

/* Waits for a served world, which goes on as time goes by. */
static void sleep_for(double seconds)
{
    struct timespec time = { 0, (long)(seconds * 1e9) };
    nanosleep(&time, NULL);
}

static DcdWorld make(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.regions = 4;
    check(dcd_world_create(&def, &world));

    const float half[3] = { 20.0f, 0.5f, 20.0f };
    DcdBodyDef ground = DCD_BODY_DEF_INIT;
    DcdBodyId id;
    check(dcd_shape_box(world, half, &ground.shape));
    ground.body_type = DCD_FIXED;
    ground.pose.p[1] = -0.5;
    check(dcd_body_create(world, &ground, &id));
    return world;
}

static DcdWorld join(const char *server, const char *token)
{
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    DcdWorld world;
    def.server = server;
    def.token = token;
    check(dcd_client_connect(&def, &world));
    return world;
}

static void add_balls(DcdWorld world, DcdBodyId balls[BALLS])
{
    DcdShapeId shape;
    check(dcd_shape_sphere(world, 0.25f, &shape));
    for (int i = 0; i < BALLS; i++) {
        DcdBodyDef ball = DCD_BODY_DEF_INIT;
        ball.shape = shape;
        ball.restitution = 0.5f;
        ball.pose.p[0] = i % SIDE - 1.5;
        ball.pose.p[1] = 2.0 + 0.25 * i;
        ball.pose.p[2] = i / SIDE - 1.5; /* NOLINT: whole rows are meant */
        ball.velocity.linear[0] = ball.pose.p[0] > 0.0 ? -1.0f : 1.0f; /* towards the border at x = 0 */
        ball.events = DCD_EVENT_CONTACT;
        ball.user_data = (uint64_t)i;
        check(dcd_body_create(world, &ball, &balls[i]));
    }
}

/* What is drawn of a body: where it was before the last step, and after. */
struct Drawn {
    DcdBodyId id;
    DcdPose before, now;
};

/* Takes in a step. A body has the same slot in every view, so a plain array remembers it. A slot with another id is a new
 * body. A game whose bodies come and go lets the array grow to view->slot_count. */
static void take_poses(const DcdStateView *view, struct Drawn drawn[BALLS])
{
    for (size_t i = 0; i < view->count; i++) {
        struct Drawn *body = &drawn[view->slots[i]];
        body->before = body->id.v == view->ids[i].v ? body->now : view->poses[i];
        body->now = view->poses[i];
        body->id = view->ids[i];
    }
}

/* Returns the height at which the highest body is drawn between two steps: `t` = 0 is before, 1 is now. */
static double draw_between(const DcdStateView *view, const struct Drawn drawn[BALLS], double t)
{
    double highest = 0.0;
    for (size_t i = 0; i < view->count; i++) {
        const struct Drawn *body = &drawn[view->slots[i]];
        DcdPose pose;
        check(dcd_pose_interpolate(&body->before, &body->now, t, &pose));
        highest = pose.p[1] > highest ? pose.p[1] : highest;
    }
    return highest;
}

/* The same in a served world. Its states come about every third step (DcdServerDef.state_every), late and unevenly; the
 * library shows at an even pace what lies between them. */
static double draw_shown(DcdWorld world)
{
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdStateView shown = DCD_STATE_VIEW_INIT;
    double highest = 0.0;
    check(dcd_view_time(world, &time));
    check(dcd_view_state(world, &time, &shown));
    for (size_t i = 0; i < shown.count; i++) {
        highest = shown.poses[i].p[1] > highest ? shown.poses[i].p[1] : highest;
    }
    return highest;
}

int main(int argc, char **argv)
{
    if (argc != 1 && argc != 3) {
        fprintf(stderr, "usage: game_loop [SERVER TOKEN]\n");
        return EXIT_FAILURE;
    }
    const bool joined = argc == 3;
    DcdWorld world = joined ? join(argv[1], argv[2]) : make();
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    check(dcd_world_info(world, &info));
    const double dt = (double)info.dt;
    DcdBodyId balls[BALLS];
    add_balls(world, balls);

    DcdStateView now = DCD_STATE_VIEW_INIT;
    struct Drawn drawn[BALLS] = { 0 };
    check(dcd_state_view(world, &now));
    if (!joined) {
        take_poses(&now, drawn);
    }

    double owed = 0.0; /* time that has passed and is not simulated yet */
    double highest = 0.0;
    unsigned steps = 0, began = 0, ended = 0, transfers = 0;
    for (int frame = 0; frame < FRAMES; frame++) {
        owed += frame_length(frame);
        while (owed >= dt) {
            owed -= dt;
            check(dcd_step(world));
            steps++;

            check(dcd_state_view(world, &now));
            if (!joined) {
                take_poses(&now, drawn);
            }

            DcdEventView events = DCD_EVENT_VIEW_INIT;
            check(dcd_events(world, &events));
            for (size_t i = 0; i < events.contact_count; i++) {
                const DcdContact *contact = &events.contacts[i];
                if (contact->kind == DCD_CONTACT_BEGAN) {
                    began++; /* play a sound, as loud as contact->speed */
                } else {
                    ended++;
                }
            }
            transfers += (unsigned)events.transfer_count;
        }

        highest = joined ? draw_shown(world) : draw_between(&now, drawn, owed / dt);
        if (frame % 60 == 59) {
            printf("frame %3d, tick %3u: highest body at %.2f m\n", frame, (unsigned)now.tick, highest);
        }
        if (joined) {
            sleep_for(frame_length(frame));
        }
    }

    /* Reads some bodies by id, here every fourth, into a struct of the game's own. */
    struct Sprite {
        uint32_t colour;
        DcdPose pose;
    } sprites[BALLS / 4];
    DcdBodyId ids[BALLS / 4];
    for (int i = 0; i < BALLS / 4; i++) {
        ids[i] = balls[4 * i];
    }
    check(dcd_state_read(world, ids, BALLS / 4, DCD_FIELD_POSE, &sprites[0].pose, sizeof sprites[0], NULL));

    /* Asks what is under the first of them. */
    DcdRay ray = DCD_RAY_INIT;
    for (int axis = 0; axis < 3; axis++) {
        ray.origin[axis] = sprites[0].pose.p[axis];
    }
    ray.direction[1] = -1.0f;
    ray.exclude = ids[0];
    DcdRayHit hit;
    DcdQueryId query;
    size_t answers;
    DcdStatus asked;
    check(dcd_cast_rays_submit(world, &ray, 1, NULL, &query));
    /* A local world answers at once, nodes within some steps. dcd_cast_rays is for local worlds alone. */
    while ((asked = dcd_query_poll(world, query, &hit, 1, &answers)) == DCD_ERR_BUSY) {
        check(dcd_step(world));
        sleep_for(dt);
    }
    check(asked);
    printf("ball 0 is %.2f m above %s\n", (double)hit.distance, hit.body.v != 0 ? "something" : "nothing");

    printf("%d frames, %u steps, %u contacts began, %u ended, %u transfers\n", FRAMES, steps, began, ended,
           transfers);
    check(dcd_world_destroy(world));
    return EXIT_SUCCESS;
}
