/* A client as an online game has it: its own avatar answers at once, though the world hears of it later.
 *
 *   mmo_client SERVER TOKEN [SECONDS]
 *
 * Prediction: the avatar is where the world last said, plus what was asked of it since that the world had not heard by then.
 * Smooth correction: where the two disagree (somebody was in the way), what is drawn slides over in a quarter of a second. Others
 * are drawn as they were a moment ago (dcd_view_time), evenly, however their states come. Interest: it hears of what is near its avatar, and no more. It greets
 * the server's program, if one listens, and shows what that says. What it says last is for programs, in one line:
 *
 *   mmo_client: steps=<steps> delay=<steps from asking to hearing> moved_m=<way that was drawn>
 *               ahead_m=<mean distance from what was heard> corrected_m=<most that prediction was off>
 */
#define _POSIX_C_SOURCE 200809L /* clock_gettime, nanosleep */

#include "dcd.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { REMEMBERED = 256 }; /* steps of asking that are remembered: more than the world is ever behind */

static const double PATIENCE = 20.0; /* seconds for the avatar to appear */
static const double SPEED = 3.0;     /* m/s */
static const double SLIDE = 0.25;    /* seconds within which a correction is out of sight */
static const double JUMP = 2.0;      /* metres beyond which it is shown at once */
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

/* The avatar as its own player sees it. */
struct Player {
    DcdBodyId avatar;
    double asked[REMEMBERED][2]; /* how far along x and z each of the last steps asks it to go */
    unsigned long steps;         /* how many asked */
    unsigned long delay;         /* steps from asking until the world shows it */
    double drawn[3];             /* where it is drawn */
    double error[3];             /* what of a correction is not shown yet */
    double corrected;            /* the largest */
};

/* What the player wants in this step: a round about where he started. */
static DcdVelocity wish(unsigned long step, double dt)
{
    const double turn = 0.8 * (double)step * dt;
    DcdVelocity velocity = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    velocity.linear[0] = (float)(SPEED * cos(turn));
    velocity.linear[2] = (float)(SPEED * sin(turn));
    return velocity;
}

static void ask(DcdWorld world, struct Player *player, double dt)
{
    const DcdVelocity velocity = wish(player->steps, dt);
    double *step = player->asked[player->steps++ % REMEMBERED];
    step[0] = (double)velocity.linear[0] * dt;
    step[1] = (double)velocity.linear[2] * dt;
    check(dcd_body_set_velocity(world, player->avatar, &velocity));
}

/* Where the avatar will be once the world has heard everything. */
static void predict(const struct Player *player, const DcdPose *heard, double out[3])
{
    for (int axis = 0; axis < 3; axis++) {
        out[axis] = heard->p[axis];
    }
    for (unsigned long i = 0; i < player->delay && i < player->steps; i++) {
        const double *step = player->asked[(player->steps - 1 - i) % REMEMBERED];
        out[0] += step[0];
        out[2] += step[1];
    }
}

/* Draws the avatar: on from where it was drawn, by what the player asked and a part of what was wrong. */
static void draw(struct Player *player, const DcdPose *heard, double dt)
{
    const double *step = player->asked[(player->steps - 1) % REMEMBERED];
    double target[3], off = 0.0;
    player->drawn[0] += step[0];
    player->drawn[2] += step[1];
    predict(player, heard, target);
    for (int axis = 0; axis < 3; axis++) {
        player->error[axis] = target[axis] - player->drawn[axis];
        off += player->error[axis] * player->error[axis];
    }
    off = sqrt(off);
    player->corrected = off > player->corrected ? off : player->corrected;
    const double share = off > JUMP ? 1.0 : 1.0 - exp(-3.0 * dt / SLIDE);
    for (int axis = 0; axis < 3; axis++) {
        player->drawn[axis] += share * player->error[axis];
    }
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

/* What came besides the world: a server to greet, lines to show. */
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

/* Makes the avatar and waits until the world has it. */
static DcdBodyId enter(DcdWorld world, DcdPose *at, double dt)
{
    const float half[3] = { 0.4f, 0.9f, 0.4f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId avatar;
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
            if (events.changes[i].body.v == avatar.v && events.changes[i].kind == DCD_BODY_APPEARED) {
                return avatar;
            }
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

    DcdPose start = { { -10.0, 1.0, 6.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    struct Player player = { { 0 }, { { 0.0, 0.0 } }, 0, 0, { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, 0.0 };
    player.avatar = enter(world, &start, dt);

    DcdStateView view = DCD_STATE_VIEW_INIT;
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    bool moves = false;
    double moved = 0.0, ahead = 0.0, others = 0.0;
    size_t near = 0, all = 0;
    DcdPose heard = start;
    for (int axis = 0; axis < 3; axis++) {
        player.drawn[axis] = start.p[axis];
    }
    const double begin = now();
    for (double next = begin; next < begin + seconds; next += dt, sleep_until(next)) {
        ask(world, &player, dt);
        check(dcd_interest_set(world, player.drawn, SIGHT));
        check(dcd_step(world)); /* sends what was asked, takes in what has come */
        chat(world);
        check(dcd_body_get(world, player.avatar, &heard, NULL));

        /* Until the world shows the first wish, none of them is in what it says. */
        if (!moves) {
            moves = hypot(heard.p[0] - start.p[0], heard.p[2] - start.p[2]) > 1e-6;
            player.delay = moves ? player.delay : player.delay + 1;
        }
        const double from[3] = { player.drawn[0], player.drawn[1], player.drawn[2] };
        draw(&player, &heard, dt);
        moved += hypot(player.drawn[0] - from[0], player.drawn[2] - from[2]);
        ahead += hypot(player.drawn[0] - heard.p[0], player.drawn[2] - heard.p[2]);

        /* Everybody else, as it was a moment ago. A game would draw them here. */
        check(dcd_view_time(world, &time));
        check(dcd_view_state(world, &time, &view));
        near = 0;
        all = view.count;
        for (size_t i = 0; i < view.count; i++) {
            if ((view.flags[i] & DCD_STATE_OUTSIDE) != 0) {
                continue; /* out of sight, and perhaps elsewhere by now */
            }
            near++;
            if (view.ids[i].v != player.avatar.v) {
                others = view.poses[i].p[1] > others ? view.poses[i].p[1] : others;
            }
        }
    }
    check(dcd_world_destroy(world));
    printf("%zu of %zu bodies in sight, others up to %.2f m high, shown %.0f ms behind the world\n", near, all, others,
           1e3 * dt * (time.now - time.shown));
    printf("mmo_client: steps=%lu delay=%lu moved_m=%.3f ahead_m=%.3f corrected_m=%.3f\n", player.steps, player.delay,
           moved, ahead / (double)player.steps, player.corrected);
    return EXIT_SUCCESS;
}
