/* A game that draws a served world with raylib, and plays in it.
 *
 *   play SERVER TOKEN [--at X Y Z] [--screenshot FILE] [--frames N]
 *
 * The player is a character that walks (W A S D), jumps (space) and pushes what is in its way; the mouse looks around. A colour stands
 * for the region that owns a body; pale bodies are asleep. With --screenshot nobody sits at the keyboard: the character walks some
 * metres ahead by itself, and the last of N frames (default 240) becomes a PNG file.
 *
 * This file has what an engine does with dcd, and bodies.c what the bodies look like; light.c is raylib alone. The last line that the
 * program prints is for programs:
 *
 *   play: frames=<drawn> bodies=<known> meshes=<made> moved_m=<way that the player was seen to go> behind_ms=<age of what is shown>
 *         ahead_ms=<lead of the player> bytes_per_second=<received>
 */
#include "bodies.h"
#include "light.h"
#include "raymath.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const float SPEED = 5.0f;  /* m/s */
static const float JUMP = 6.0f;   /* m/s upwards */
static const double SIGHT = 80.0; /* metres around the player within which bodies are told and drawn */
static const double STROLL = 12.0; /* metres that the player goes by itself for a picture */

typedef struct Options {
    const char *server, *token, *screenshot;
    long frames; /* 0: until the window is closed */
    bool is_placed;
    double at[3];
} Options;

typedef struct Game {
    DcdWorld world;
    DcdBodyId avatar;
    Bodies bodies;
    DcdPose player; /* where the avatar is shown */
    double moved;
    float yaw, pitch; /* of the camera */
    DcdViewTime time;
    DcdStats stats;
    double rate, rate_time; /* bytes per second, and since when they are counted */
    uint64_t rate_bytes;
} Game;

static Options options_of(int argc, char **argv)
{
    Options options = { 0 };
    bool good = argc >= 3;
    for (int i = 3; i < argc && good; i++) {
        if (strcmp(argv[i], "--at") == 0 && i + 3 < argc) {
            options.is_placed = true;
            for (int axis = 0; axis < 3; axis++) {
                options.at[axis] = strtod(argv[++i], NULL);
            }
        } else if (strcmp(argv[i], "--screenshot") == 0 && i + 1 < argc) {
            options.screenshot = argv[++i];
        } else if (strcmp(argv[i], "--frames") == 0 && i + 1 < argc) {
            options.frames = strtol(argv[++i], NULL, 10);
        } else {
            good = false;
        }
    }
    if (!good) {
        fprintf(stderr, "usage: play SERVER TOKEN [--at X Y Z] [--screenshot FILE] [--frames N]\n");
        exit(EXIT_FAILURE);
    }
    options.server = argv[1];
    options.token = argv[2];
    if (options.screenshot != NULL && options.frames <= 0) {
        options.frames = 240;
    }
    return options;
}

/* Returns where the avatar enters the world: at --at, or else in front of all movable bodies and above the ground, so that it falls. */
static DcdPose entrance(DcdWorld world, const Options *options)
{
    DcdPose pose = { { 0.0, 3.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    DcdStateView view = DCD_STATE_VIEW_INIT;
    check(dcd_state_view(world, &view));
    for (size_t i = 0; i < view.count; i++) {
        pose.p[2] = fmax(pose.p[2], view.poses[i].p[2] + 4.0);
    }
    if (options->is_placed) {
        memcpy(pose.p, options->at, sizeof pose.p);
    }
    return pose;
}

static void join(Game *game, const Options *options)
{
    DcdClientDef def = DCD_CLIENT_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdCharacterDef character = DCD_CHARACTER_DEF_INIT;
    def.server = options->server;
    def.token = options->token;
    check(dcd_client_connect(&def, &game->world));
    bodies_open(&game->bodies, game->world);

    body.body_type = DCD_KINEMATIC;
    body.pose = game->player = entrance(game->world, options);
    check(dcd_shape_capsule(game->world, 0.5f, 0.4f, &body.shape));
    check(dcd_character_create(game->world, &body, &character, &game->avatar));
}

/* Sends what the player wants, by the keys, in the directions of the camera. */
static void drive(const Game *game, bool by_itself)
{
    DcdVelocity velocity = { { 0 }, { 0 } };
    const float along = (float)(by_itself || IsKeyDown(KEY_W)) - (float)IsKeyDown(KEY_S);
    const float aside = (float)IsKeyDown(KEY_D) - (float)IsKeyDown(KEY_A);
    const float scale = SPEED / fmaxf(1.0f, hypotf(along, aside));
    velocity.linear[0] = scale * (aside * cosf(game->yaw) - along * sinf(game->yaw));
    velocity.linear[1] = IsKeyDown(KEY_SPACE) ? JUMP : 0.0f;
    velocity.linear[2] = scale * (-aside * sinf(game->yaw) - along * cosf(game->yaw));
    check(dcd_body_set_velocity(game->world, game->avatar, &velocity));
}

/* Takes in which bodies came and went since the last step. */
static void hear(Game *game)
{
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    check(dcd_events(game->world, &events));
    for (size_t i = 0; i < events.change_count; i++) {
        const DcdBodyChange *change = &events.changes[i];
        if (change->kind == DCD_CHANGE_APPEARED) {
            /* Bodies that have gone again since are told of too. */
            if (dcd_body_is_valid(game->world, change->body)) {
                bodies_add(&game->bodies, change->body);
            }
        } else if (change->kind == DCD_CHANGE_REMOVED) {
            bodies_remove(&game->bodies, change->body);
        } else if (change->body.v == game->avatar.v && !dcd_body_is_valid(game->world, game->avatar)) {
            fprintf(stderr, "play: the avatar is refused: %s\n", dcd_refused_string(change->reason));
            exit(EXIT_FAILURE);
        }
    }
}

/* One step of the world's length: sends what the player wants and what it looks at, takes in what has come. */
static void step(Game *game, bool by_itself)
{
    drive(game, by_itself);
    check(dcd_interest_set(game->world, game->player.p, SIGHT));
    check(dcd_step(game->world));
    hear(game);
}

/* Reads how to show the world in this frame: the avatar, and what it touches, ahead of the world, others a moment behind. */
static void look(Game *game)
{
    DcdStateView view = DCD_STATE_VIEW_INIT;
    check(dcd_view_time(game->world, &game->time));
    check(dcd_view_state(game->world, &game->time, &view));
    bodies_show(&game->bodies, &view, game->avatar);
    const DcdPose before = game->player;
    check(dcd_view_body(game->world, game->avatar, game->time.predicted, &game->player, NULL));
    game->moved += hypot(game->player.p[0] - before.p[0], game->player.p[2] - before.p[2]);

    check(dcd_stats(game->world, &game->stats));
    const double elapsed = GetTime() - game->rate_time;
    if (elapsed > 1.0) {
        game->rate = (double)(game->stats.udp_bytes_in - game->rate_bytes) / elapsed;
        game->rate_bytes = game->stats.udp_bytes_in;
        game->rate_time = GetTime();
    }
}

/* Returns a camera behind the player and a little above. All is drawn relative to the player, however far he is from the world's origin. */
static Camera3D camera_of(Game *game)
{
    const Vector2 mouse = IsMouseButtonDown(MOUSE_BUTTON_LEFT) ? GetMouseDelta() : (Vector2){ 0.0f, 0.0f };
    game->yaw -= 0.004f * mouse.x;
    game->pitch = Clamp(game->pitch + 0.004f * mouse.y, 0.05f, 1.4f);
    const float far = 11.0f, back = far * cosf(game->pitch);
    return (Camera3D){ .position = { back * sinf(game->yaw), 1.0f + far * sinf(game->pitch), back * cosf(game->yaw) },
                       .target = { 0.0f, 1.0f, 0.0f },
                       .up = { 0.0f, 1.0f, 0.0f },
                       .fovy = 60.0f,
                       .projection = CAMERA_PERSPECTIVE };
}

static void draw_figures(const Game *game, double dt)
{
    const DcdViewTime *time = &game->time;
    const char *text = TextFormat("tick %llu   %zu bodies   shown %.0f ms behind, you %.0f ms ahead, heard after %.0f ms   %.1f kB/s",
                                  (unsigned long long)game->stats.ticks, game->bodies.count, 1e3 * dt * (time->now - time->shown),
                                  1e3 * dt * (time->predicted - time->now), 1e3 * fmax(time->input_delay, 0.0), 1e-3 * game->rate);
    DrawRectangle(0, 0, GetScreenWidth(), 30, (Color){ 20, 24, 30, 170 });
    DrawText(text, 12, 8, 16, RAYWHITE);
}

static void draw(Game *game, Light *light, double dt)
{
    const double *origin = game->player.p;
    const Camera3D camera = camera_of(game);
    BeginDrawing();
    light_begin_shadows(light);
    bodies_draw(&game->bodies, SCENERY, light->material, origin);
    bodies_draw(&game->bodies, MOVABLE, light->material, origin);
    light_begin(light, camera, origin);
    light_grid(light, true);
    bodies_draw(&game->bodies, SCENERY, light->material, origin);
    light_grid(light, false);
    bodies_draw(&game->bodies, MOVABLE, light->material, origin);
    light_end();
    draw_figures(game, dt);
    EndDrawing();
}

static void save_picture(const char *path)
{
    Image image = LoadImageFromScreen();
    ImageFormat(&image, PIXELFORMAT_UNCOMPRESSED_R8G8B8);
    if (!ExportImage(image, path)) {
        fprintf(stderr, "play: cannot write %s\n", path);
        exit(EXIT_FAILURE);
    }
    UnloadImage(image);
}

int main(int argc, char **argv)
{
    const Options options = options_of(argc, argv);
    SetTraceLogLevel(LOG_WARNING);
    SetConfigFlags(FLAG_MSAA_4X_HINT | FLAG_WINDOW_RESIZABLE);
    InitWindow(1280, 720, "dcd");
    if (!IsWindowReady()) {
        fprintf(stderr, "play: there is no screen; without one start it as: xvfb-run play ...\n");
        return EXIT_FAILURE;
    }
    SetTargetFPS(60);
    Light light = light_load();

    Game game = { .time = DCD_VIEW_TIME_INIT, .stats = DCD_STATS_INIT, .pitch = 0.4f };
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    join(&game, &options);
    check(dcd_world_info(game.world, &info));
    const double dt = (double)info.dt;
    double owed = 0.0; /* time that has passed and is not simulated yet */
    long frames = 0;
    while (!WindowShouldClose() && (options.frames == 0 || frames < options.frames)) {
        for (owed += fmin((double)GetFrameTime(), 0.25); owed >= dt; owed -= dt) {
            step(&game, options.screenshot != NULL && game.moved < STROLL);
        }
        look(&game);
        draw(&game, &light, dt);
        frames++;
    }
    if (options.screenshot != NULL) {
        save_picture(options.screenshot);
    }
    printf("play: frames=%ld bodies=%zu meshes=%zu moved_m=%.2f behind_ms=%.1f ahead_ms=%.1f bytes_per_second=%.0f\n", frames,
           game.bodies.count, game.bodies.meshes, game.moved, 1e3 * dt * (game.time.now - game.time.shown),
           1e3 * dt * (game.time.predicted - game.time.now), game.rate);
    check(dcd_world_destroy(game.world));
    CloseWindow();
    return EXIT_SUCCESS;
}
