/* A client as in an online game: its own avatar answers at once, though the world hears of the input later.
 *
 *   mmo_client SERVER TOKEN [SECONDS]
 *
 * - Prediction: the avatar, and what it touches, are drawn as they will be once the world has heard what the player asks now.
 *   Where somebody was in the way, the prediction is corrected, and what is drawn slides over.
 * - Interpolation: all other bodies are drawn as they were a moment ago, evenly, however their states come (dcd_view_time,
 *   dcd_view_state).
 * - Interest: the client hears only of what is near its avatar.
 * - Messages: the client greets the server's program, if one listens, and shows what that says.
 *
 * The last line is for programs:
 *
 *   mmo_client: steps=<steps> moved_m=<way that was drawn> ahead_m=<mean distance from what was heard>
 *               ticks=<steps predicted> replays=<times they were computed again> corrections=<those above 2 cm>
 *               largest_m=<the largest>
 */
#define _POSIX_C_SOURCE 200809L /* clock_gettime, nanosleep */

#include "dcd.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static const double PATIENCE = 20.0; /* seconds for the avatar to appear */
static const double SPEED = 3.0;     /* m/s */
static const double SIGHT = 12.0;    /* metres that the player sees */

static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[1024];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + (double)time.tv_nsec * 1e-9;
}

static void sleep_until(double when)
{
    const double left = when - now();
    if (left > 0.0) {
        struct timespec time;
        time.tv_sec = (time_t)left;
        time.tv_nsec = (long)((left - (double)time.tv_sec) * 1e9);
        nanosleep(&time, NULL);
    }
}

/* Returns what the player wants in this step: a round, back to where he started. */
static DcdVelocity wish(unsigned long step, double dt)
{
    const double turn = 0.8 * (double)step * dt;
    DcdVelocity velocity = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    velocity.linear[0] = (float)(SPEED * cos(turn));
    velocity.linear[2] = (float)(SPEED * sin(turn));
    return velocity;
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

/* Takes in what came besides the world: a server to greet, lines to show. */
static void chat(DcdWorld world)
{
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    check(dcd_events(world, &events));
    for (size_t i = 0; i < events.connection_count; i++) {
        const DcdConnectionEvent *event = &events.connections[i];
        if (event->role == DCD_ROLE_SERVER && event->state == DCD_CONNECTION_CAME) {
            check(dcd_send(world, event->connection, "hello", 5, 0));
        }
    }
    for (size_t i = 0; i < events.message_count; i++) {
        printf("the server says: %.*s\n", (int)events.messages[i].size, (const char *)events.messages[i].data);
    }
}

/* Makes the avatar, and waits until the world has it and the library predicts it. */
static DcdBodyId enter(DcdWorld world, const DcdPose *at, double dt)
{
    const float half[3] = { 0.4f, 0.9f, 0.4f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdPrediction prediction = DCD_PREDICTION_INIT;
    DcdBodyId avatar;
    bool appeared = false;
    check(dcd_shape_box(world, half, &def.shape));
    def.body_type = DCD_KINEMATIC;
    def.flags = DCD_BODY_NO_SLEEP;
    def.pose = *at;
    check(dcd_body_create(world, &def, &avatar));
    for (double start = now(), next = start; next < start + PATIENCE; next += dt, sleep_until(next)) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        check(dcd_step(world));
        chat(world);
        check(dcd_events(world, &events));
        for (size_t i = 0; i < events.change_count; i++) {
            const DcdBodyChange *change = &events.changes[i];
            appeared = appeared || (change->body.v == avatar.v && change->kind == DCD_CHANGE_APPEARED);
        }
        check(dcd_view_time(world, &time)); /* the first call starts the prediction */
        check(dcd_prediction(world, &prediction));
        if (appeared && prediction.bodies > 0) {
            return avatar;
        }
    }
    fprintf(stderr, "mmo_client: the avatar does not appear; does a node compute the world?\n");
    exit(EXIT_FAILURE);
}

int main(int argc, char **argv)
{
    if (argc != 3 && argc != 4) {
        fprintf(stderr, "usage: mmo_client SERVER TOKEN [SECONDS]\n");
        return EXIT_FAILURE;
    }
    const double seconds = argc == 4 ? strtod(argv[3], NULL) : 10.0;
    DcdWorld world = join(argv[1], argv[2]);
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    check(dcd_world_info(world, &info));
    const double dt = (double)info.dt;

    DcdPose told, drawn = { { -10.0, 1.0, 6.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    const DcdBodyId avatar = enter(world, &drawn, dt);

    DcdStateView view = DCD_STATE_VIEW_INIT;
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    unsigned long steps = 0;
    double moved = 0.0, ahead = 0.0, others = 0.0;
    size_t near = 0;
    const double begin = now();
    for (double next = begin; next < begin + seconds; next += dt, sleep_until(next)) {
        const DcdVelocity velocity = wish(steps++, dt);
        check(dcd_body_set_velocity(world, avatar, &velocity));
        check(dcd_interest_set(world, drawn.p, SIGHT));
        check(dcd_step(world)); /* sends what was asked, takes in what has come */
        chat(world);

        /* A game would draw here. */
        check(dcd_view_time(world, &time));
        check(dcd_view_state(world, &time, &view));
        near = 0;
        for (size_t i = 0; i < view.count; i++) {
            const DcdPose *pose = &view.poses[i];
            if ((view.flags[i] & DCD_STATE_OUTSIDE) != 0) {
                continue; /* out of sight, and perhaps elsewhere by now */
            }
            near++;
            if (view.ids[i].v == avatar.v) {
                moved += hypot(pose->p[0] - drawn.p[0], pose->p[2] - drawn.p[2]);
                drawn = *pose;
            } else {
                others = pose->p[1] > others ? pose->p[1] : others;
            }
        }
        check(dcd_body_get(world, avatar, &told, NULL));
        ahead += hypot(drawn.p[0] - told.p[0], drawn.p[2] - told.p[2]);
    }
    DcdPrediction prediction = DCD_PREDICTION_INIT;
    check(dcd_prediction(world, &prediction));
    check(dcd_world_destroy(world));
    printf("%zu of %zu bodies in sight, others up to %.2f m high, shown %.0f ms behind the world, the avatar %.0f ms ahead\n",
           near, view.count, others, 1e3 * dt * (time.now - time.shown), 1e3 * dt * (time.predicted - time.now));
    printf("mmo_client: steps=%lu moved_m=%.3f ahead_m=%.3f ticks=%" PRIu64 " replays=%" PRIu64 " corrections=%" PRIu64
           " largest_m=%.3f\n",
           steps, moved, ahead / (double)steps, prediction.ticks, prediction.replays, prediction.corrections,
           prediction.largest_correction);
    return EXIT_SUCCESS;
}
