/* A client of a served world: its avatar, a box that nothing stops, drives through the world and reports what it runs into.
 *
 *   join SERVER TOKEN [SECONDS [X Y Z VX VY VZ [HX HY HZ]]]
 *
 * SERVER is host:port, TOKEN is what `dcd token --role client` printed. The avatar starts at X Y Z (metres), moves at
 * VX VY VZ (m/s) for SECONDS, and has the half edges HX HY HZ. The last line that it prints is for programs:
 *
 *   join: updates=<messages> contacts=<contacts that began> moved_m=<length of its way> bodies=<movable bodies>
 */
#define _POSIX_C_SOURCE 200809L /* clock_gettime, nanosleep */

#include "dcd.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* How long the server may take to put the avatar into the world, seconds. */
static const double PATIENCE = 20.0;

/* Ends the program with the library's own message when a call failed. */
static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[1024];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

/* Returns the seconds of a monotonic clock. */
static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + (double)time.tv_nsec * 1e-9;
}

static void sleep_until(double when)
{
    double left = when - now();
    if (left > 0.0) {
        struct timespec time;
        time.tv_sec = (time_t)left;
        time.tv_nsec = (long)((left - (double)time.tv_sec) * 1e9);
        nanosleep(&time, NULL);
    }
}

/* Returns argument i as a number, or `otherwise` where there are fewer arguments. */
static double number(int argc, char **argv, int i, double otherwise)
{
    if (i >= argc) {
        return otherwise;
    }
    char *end;
    double value = strtod(argv[i], &end);
    if (end == argv[i] || *end != '\0' || !isfinite(value)) {
        fprintf(stderr, "join: \"%s\" is not a number\n", argv[i]);
        exit(EXIT_FAILURE);
    }
    return value;
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* What happened to the avatar. */
struct Diary {
    bool appeared;
    uint64_t contacts;
};

/* Takes in what has come since the last step. */
static void hear(DcdWorld world, DcdBodyId avatar, struct Diary *diary)
{
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    check(dcd_events(world, &events));
    for (size_t i = 0; i < events.change_count; i++) {
        const DcdBodyChange *change = &events.changes[i];
        if (change->body.v != avatar.v) {
            continue;
        }
        if (change->kind == DCD_CHANGE_REFUSED) {
            fprintf(stderr, "join: the server refuses: %s\n", dcd_refused_string(change->reason));
            exit(EXIT_FAILURE);
        }
        diary->appeared = diary->appeared || change->kind == DCD_CHANGE_APPEARED;
    }
    for (size_t i = 0; i < events.contact_count; i++) {
        const DcdContact *contact = &events.contacts[i];
        if (contact->kind == DCD_CONTACT_BEGAN) {
            diary->contacts++;
            if (diary->contacts <= 10) { /* more would only scroll by */
                printf("contact %" PRIu64 " at %.2f %.2f %.2f, %.1f m/s\n", diary->contacts, contact->point[0],
                       contact->point[1], contact->point[2], (double)contact->speed);
            }
        }
    }
}

int main(int argc, char **argv)
{
    if (argc < 3 || (argc > 4 && argc != 10 && argc != 13)) {
        fprintf(stderr, "usage: join SERVER TOKEN [SECONDS [X Y Z VX VY VZ [HX HY HZ]]]\n");
        return EXIT_FAILURE;
    }
    const double seconds = number(argc, argv, 3, 5.0);
    setvbuf(stdout, NULL, _IOLBF, 0); /* whole lines, also into a pipe */

    /* Only this line differs between a local world and a served one. */
    DcdClientDef client = DCD_CLIENT_DEF_INIT;
    client.server = argv[1];
    client.token = argv[2];
    DcdWorld world;
    check(dcd_client_connect(&client, &world));
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    check(dcd_world_info(world, &info));
    printf("client %" PRIu32 " in a world of %" PRIu32 " regions, %.0f steps a second\n", info.client, info.regions,
           1.0 / (double)info.dt);

    float half[3];
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    const double from[3] = { -5.0, 1.0, 0.0 }, along[3] = { 2.0, 0.0, 0.0 };
    for (int axis = 0; axis < 3; axis++) {
        def.pose.p[axis] = number(argc, argv, 4 + axis, from[axis]);
        def.velocity.linear[axis] = (float)number(argc, argv, 7 + axis, along[axis]);
        half[axis] = (float)number(argc, argv, 10 + axis, 0.5);
    }
    check(dcd_shape_box(world, half, &def.shape));
    def.body_type = DCD_KINEMATIC;
    def.events = DCD_EVENT_CONTACT;
    def.flags = DCD_BODY_NO_SLEEP;
    DcdBodyId avatar;
    check(dcd_body_create(world, &def, &avatar));

    struct Diary diary = { false, 0 };
    DcdPose pose = def.pose, before = def.pose;
    double moved = 0.0;
    double next = now(), end = next + PATIENCE, next_report = next;
    bool driving = false;
    while (next < end) {
        /* Called once per tick of the world. On a local world the same call would advance it. */
        check(dcd_step(world));
        hear(world, avatar, &diary);
        if (diary.appeared && !driving) {
            driving = true;
            end = next + seconds;
        }
        if (driving) {
            check(dcd_body_set_velocity(world, avatar, &def.velocity));
            /* The pose as last told, about every third step (DcdServerDef.state_every). To draw, read dcd_view_body. */
            check(dcd_body_get(world, avatar, &pose, NULL));
            moved += distance(pose.p, before.p);
            before = pose;
            if (next >= next_report) {
                printf("at %.2f %.2f %.2f\n", pose.p[0], pose.p[1], pose.p[2]);
                next_report = next + 1.0;
            }
        }
        next += (double)info.dt;
        sleep_until(next);
    }
    if (!driving) {
        fprintf(stderr, "join: the avatar did not appear within %.0f s; does a node compute the world?\n", PATIENCE);
        return EXIT_FAILURE;
    }

    DcdStats stats = DCD_STATS_INIT;
    check(dcd_stats(world, &stats));
    check(dcd_world_destroy(world)); /* leaves the world in order */
    printf("join: updates=%" PRIu64 " contacts=%" PRIu64 " moved_m=%.3f bodies=%" PRIu64 "\n", stats.updates,
           diary.contacts, moved, stats.bodies);
    return EXIT_SUCCESS;
}
