/* Draws what a player sees of an avatar that drives into a tower, as two strips of pictures.
 *
 *   strips SERVER TOKEN [FOLDER]
 *
 * FOLDER/told.png shows the newest states that had come (dcd_state_view), FOLDER/shown.png what the library shows
 * (dcd_view_state). The world is `tower` with n=3. In each picture:
 *
 * - the number says how many frames after the player's input it was taken;
 * - the dashed square is where the avatar would be had it answered at once;
 * - below the ground there is a line for each frame so far, at the place of the avatar in that frame: gaps are jumps.
 *
 * The last line that it prints is for programs:
 *
 *   strips: told=<frames from asking to the first in which the avatar has moved> shown=<the same>
 */
#define _POSIX_C_SOURCE 200809L /* clock_gettime, nanosleep */

#include "dcd.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { PICTURES = 10, EVERY = 4, FRAMES = 120, STAND = 60 }; /* pictures of a strip; frames between two, in all, and before */
enum { SIDE = 120, GROUND = 104, WIDTH = PICTURES * SIDE, HEIGHT = SIDE }; /* pixels */
enum { ROW = 1 + WIDTH / 4, ROWS = HEIGHT * ROW }; /* bytes: a filter, then four pixels each */
enum { PAPER, INK, BOX, AVATAR };                  /* colours */
_Static_assert(ROWS <= 65535, "one block of deflate holds the picture");

static const double PATIENCE = 20.0;           /* seconds for the avatar to appear */
static const double LEFT = -3.2, SCALE = 20.0; /* metres where a picture begins, pixels per metre */
static const double START[2] = { -2.5, 0.52 }; /* where the avatar starts, metres */
static const double SPEED = 6.0, HALF = 0.5;   /* m/s of the avatar, metres of all boxes */

static void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[1024];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s: %s\n", dcd_status_string(status), message);
        exit(EXIT_FAILURE);
    }
}

static void wait_until(double when)
{
    const struct timespec time = { (time_t)when, (long)((when - floor(when)) * 1e9) };
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL);
}

/* Pictures side by side, and the file that they are written to. */
struct Strip {
    char path[1024];
    FILE *file;
    uint8_t pixels[HEIGHT][WIDTH];
    double trail[FRAMES]; /* where the avatar was in each frame, metres along x */
    int answered;         /* the first frame in which the avatar had moved; -1 before */
};

static void must(bool well, const char *path)
{
    if (!well) {
        fprintf(stderr, "strips: cannot write %s: %s\n", path, strerror(errno));
        exit(EXIT_FAILURE);
    }
}

static void open_strip(struct Strip *strip, const char *folder, const char *name)
{
    snprintf(strip->path, sizeof strip->path, "%s/%s", folder, name);
    strip->answered = -1;
    must((strip->file = fopen(strip->path, "wb")) != NULL, strip->path);
}

static void put_u32(uint8_t *to, uint32_t value)
{
    for (int i = 0; i < 4; i++) {
        to[i] = (uint8_t)(value >> (24 - 8 * i));
    }
}

/* Writes a chunk of PNG: its length, its type and data, and their CRC-32. */
static void write_chunk(FILE *file, const uint8_t *chunk, size_t size)
{
    uint8_t length[4], sum[4];
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        crc ^= chunk[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
        }
    }
    put_u32(length, (uint32_t)(size - 4));
    put_u32(sum, ~crc);
    fwrite(length, 1, 4, file);
    fwrite(chunk, 1, size, file);
    fwrite(sum, 1, 4, file);
}

/* Writes the file: a PNG of four colours. Its deflate block is not compressed, so that no library is needed. */
static void save_strip(struct Strip *strip)
{
    static const uint8_t magic[8] = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n' };
    static const uint8_t colours[16] = { 'P', 'L', 'T', 'E', 250, 250, 246, 40, 44, 52, 172, 182, 196, 240, 128, 32 };
    uint8_t header[17] = { 'I', 'H', 'D', 'R', [12] = 2, 3 }; /* 2 bits each, of a palette */
    uint8_t stream[11 + ROWS + 4] = { 'I', 'D', 'A', 'T', 0x78, 1, 1, ROWS & 255, ROWS >> 8, ~ROWS & 255, ~ROWS >> 8 & 255 };
    uint8_t *rows = stream + 11;
    uint32_t a = 1, b = 0; /* Adler-32 */
    put_u32(header + 4, WIDTH);
    put_u32(header + 8, HEIGHT);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        const size_t x = i % WIDTH, y = i / WIDTH;
        rows[y * ROW + 1 + x / 4] |= (uint8_t)(strip->pixels[y][x] << (6 - 2 * (x % 4)));
    }
    for (size_t i = 0; i < ROWS; i++) {
        a = (a + rows[i]) % 65521;
        b = (b + a) % 65521;
    }
    put_u32(rows + ROWS, b << 16 | a);
    fwrite(magic, 1, sizeof magic, strip->file);
    write_chunk(strip->file, header, sizeof header);
    write_chunk(strip->file, colours, sizeof colours);
    write_chunk(strip->file, stream, sizeof stream);
    write_chunk(strip->file, (const uint8_t *)"IEND", 4);
    must(ferror(strip->file) == 0 && fclose(strip->file) == 0, strip->path);
}

/* Returns how deep a point lies in a box, metres; outside of the box this is below 0. Boxes lie at z = 0 and turn about z. */
static double depth(const DcdPose *box, double x, double y)
{
    const double z = (double)box->q[2], w = (double)box->q[3], c = w * w - z * z, s = 2.0 * z * w;
    const double dx = x - box->p[0], dy = y - box->p[1];
    return HALF - fmax(fabs(dx * c + dy * s), fabs(dy * c - dx * s));
}

/* Writes a number below 100 into a corner, in digits of 3 by 5, each twice as large. */
static void draw_number(struct Strip *strip, int left, int number)
{
    static const uint16_t digits[] = { 075557, 026222, 071747, 071717, 055711, 074717, 074757, 071111, 075757, 075717 };
    for (int i = 0; i < 120; i++) {
        const int x = i % 6, y = i / 6 % 10, digit = i < 60 ? number / 10 : number % 10;
        if ((digits[digit] >> (14 - (y / 2 * 3 + x / 2)) & 1) != 0 && (i >= 60 || number >= 10)) {
            strip->pixels[6 + y][left + i / 60 * 8 + x] = INK;
        }
    }
}

/* Draws a cut through the world along z = 0. */
static void draw_picture(struct Strip *strip, const DcdStateView *view, DcdBodyId avatar, int frame, double dt)
{
    const int left = frame / EVERY * SIDE;
    const DcdPose mark = { { START[0] + SPEED * frame * dt, START[1], 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    for (int py = 0; py < GROUND; py++) {
        for (int px = 1; px < SIDE; px++) {
            const double x = LEFT + (px + 0.5) / SCALE, y = (GROUND - py - 0.5) / SCALE;
            uint8_t *pixel = &strip->pixels[py][left + px];
            for (size_t i = 0; i < view->count; i++) {
                const double in = depth(&view->poses[i], x, y);
                if (in >= 0.0) {
                    *pixel = view->ids[i].v == avatar.v ? AVATAR : in < 1.0 / SCALE ? INK : BOX;
                }
            }
            const double in = depth(&mark, x, y);
            if (in >= 0.0 && in < 1.5 / SCALE && (px + py) % 6 < 3) {
                *pixel = INK;
            }
        }
    }
    for (int i = 0; i <= frame; i++) {
        const int px = (int)((strip->trail[i] - LEFT) * SCALE);
        for (int py = GROUND + 5; py < HEIGHT - 2 && px > 0 && px < SIDE; py++) {
            strip->pixels[py][left + px] = AVATAR;
        }
    }
    for (int i = 0; i < SIDE; i++) {
        strip->pixels[i][left] = strip->pixels[GROUND][left + i] = INK;
    }
    draw_number(strip, left + 6, frame);
}

/* Records a frame. */
static void see(struct Strip *strip, const DcdStateView *view, DcdBodyId avatar, int frame, double dt)
{
    for (size_t i = 0; i < view->count; i++) {
        if (view->ids[i].v == avatar.v) {
            strip->trail[frame] = view->poses[i].p[0];
            strip->answered = strip->answered < 0 && strip->trail[frame] > START[0] + 0.01 ? frame : strip->answered;
        }
    }
    if (frame % EVERY == 0 && frame / EVERY < PICTURES) {
        draw_picture(strip, view, avatar, frame, dt);
    }
}

int main(int argc, char **argv)
{
    static struct Strip told, shown;
    if (argc != 3 && argc != 4) {
        fprintf(stderr, "usage: strips SERVER TOKEN [FOLDER]\n");
        return EXIT_FAILURE;
    }
    open_strip(&told, argc == 4 ? argv[3] : ".", "told.png"); /* before the token is used up */
    open_strip(&shown, argc == 4 ? argv[3] : ".", "shown.png");

    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    DcdBodyDef box = DCD_BODY_DEF_INIT;
    DcdBodyId avatar;
    DcdWorld world;
    def.server = argv[1];
    def.token = argv[2];
    check(dcd_client_connect(&def, &world));
    check(dcd_world_info(world, &info));

    const double dt = (double)info.dt;
    const float half[3] = { (float)HALF, (float)HALF, (float)HALF };
    box.body_type = DCD_KINEMATIC;
    box.flags = DCD_BODY_NO_SLEEP;
    box.pose.p[0] = START[0];
    box.pose.p[1] = START[1];
    check(dcd_shape_box(world, half, &box.shape));
    check(dcd_body_create(world, &box, &avatar));

    /* The avatar stands for a second once the world answers. */
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    struct timespec begin;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    int frame = -STAND;
    for (double start = (double)begin.tv_sec + 1.0, next = start; frame < FRAMES; wait_until(next += dt)) {
        DcdVelocity velocity = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
        velocity.linear[0] = frame < 0 ? 0.0f : (float)SPEED;
        check(dcd_body_set_velocity(world, avatar, &velocity));
        check(dcd_step(world));
        check(dcd_view_time(world, &time));
        if (frame >= 0) {
            check(dcd_state_view(world, &view));
            see(&told, &view, avatar, frame, dt);
            check(dcd_view_state(world, &time, &view));
            see(&shown, &view, avatar, frame, dt);
        } else if (next > start + PATIENCE) {
            fprintf(stderr, "strips: the avatar does not appear; does a node compute the world?\n");
            return EXIT_FAILURE;
        }
        frame += time.input_delay >= 0.0 ? 1 : 0;
    }
    check(dcd_world_destroy(world));
    save_strip(&told);
    save_strip(&shown);
    printf("strips: told=%d shown=%d\n", told.answered, shown.answered);
    return EXIT_SUCCESS;
}
