/* A world is drawn by a renderer's functions, and into the file that is named. Checks where things are and in
 * which colours, what a null function means, and that no function can call its world from within. */
#include "checks.h"

#include <math.h>

#define MOST 64

/* What was drawn. */
typedef struct Seen {
    DcdWorld world;
    size_t points, lines, boxes, shapes, texts;
    double from[MOST][3], to[MOST][3];
    double min[MOST][3], max[MOST][3];
    DcdBodyId bodies[MOST];
    DcdPose poses[MOST];
    DcdDrawnShape drawn[MOST];
    uint32_t colours[MOST];
    char text[64];
    DcdStatus inside; /* the status of a call from within */
} Seen;

static void on_point(void *context, const double *at, float size, uint32_t colour)
{
    Seen *seen = context;
    seen->points++;
    HOLDS(isfinite(at[0]) && size > 0.0f && (colour & 0xFFu) == 0xFFu);
}

static void on_line(void *context, const double *from, const double *to, uint32_t colour)
{
    Seen *seen = context;
    const size_t i = seen->lines++;
    HOLDS(colour != 0);
    if (i < MOST) {
        memcpy(seen->from[i], from, sizeof seen->from[i]);
        memcpy(seen->to[i], to, sizeof seen->to[i]);
    }
}

static void on_box(void *context, const double *min, const double *max, uint32_t colour)
{
    Seen *seen = context;
    const size_t i = seen->boxes++;
    HOLDS(min[0] <= max[0] && min[1] <= max[1] && min[2] <= max[2] && colour != 0);
    if (i < MOST) {
        memcpy(seen->min[i], min, sizeof seen->min[i]);
        memcpy(seen->max[i], max, sizeof seen->max[i]);
    }
}

static void on_shape(void *context, DcdBodyId body, const DcdDrawnShape *shape, const DcdPose *pose, uint32_t colour)
{
    Seen *seen = context;
    const size_t i = seen->shapes++;
    if (i < MOST) {
        seen->bodies[i] = body;
        seen->poses[i] = *pose;
        seen->drawn[i] = *shape;
        seen->colours[i] = colour;
    }
    for (size_t k = 0; k < shape->triangle_count * 3; k++)
        HOLDS(shape->triangles[k] < shape->vertex_count);
}

static void on_text(void *context, const double *at, const char *text, uint32_t colour)
{
    Seen *seen = context;
    seen->texts++;
    HOLDS(at[1] > -1e6 && colour != 0);
    snprintf(seen->text, sizeof seen->text, "%s", text);
}

static void on_text_that_calls(void *context, const double *at, const char *text, uint32_t colour)
{
    Seen *seen = context;
    (void)at, (void)text, (void)colour;
    seen->texts++;
    seen->inside = dcd_step(seen->world);
    FAILS(dcd_step(seen->world), DCD_ERR_BUSY, "dcd_debug_draw");
    FAILS(dcd_world_destroy(seen->world), DCD_ERR_BUSY, "call later");
    HOLDS(dcd_version() == DCD_VERSION); /* functions that take no world can be called */
}

static DcdDebugDraw by(Seen *seen, uint32_t flags)
{
    DcdDebugDraw draw = DCD_DEBUG_DRAW_INIT;
    memset(seen, 0, sizeof *seen);
    draw.flags = flags;
    draw.context = seen;
    draw.draw_point = on_point;
    draw.draw_line = on_line;
    draw.draw_box = on_box;
    draw.draw_shape = on_shape;
    draw.draw_text = on_text;
    return draw;
}

static Seen seen;

int main(int argc, char **argv)
{
    const float half[3] = { 20.0f, 0.5f, 20.0f }, corners[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdBodyId floor, left, right, hull;
    DcdWorld world;
    DcdPose pose;
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    def.regions = 2;
    OK(dcd_world_create(&def, &world));
    body.body_type = DCD_FIXED;
    body.pose.p[1] = -0.5;
    OK(dcd_shape_box(world, half, &body.shape));
    OK(dcd_body_create(world, &body, &floor));
    body.body_type = DCD_DYNAMIC;
    body.pose.p[1] = 0.5;
    OK(dcd_shape_sphere(world, 0.5f, &body.shape));
    body.pose.p[0] = -3.0;
    OK(dcd_body_create(world, &body, &left));
    body.pose.p[0] = 3.0;
    OK(dcd_body_create(world, &body, &right));
    OK(dcd_shape_hull(world, corners, 4, &body.shape));
    body.pose.p[1] = 30.0;
    OK(dcd_body_create(world, &body, &hull));
    OK(dcd_view_time(world, &time));
    for (int i = 0; i < 10; i++)
        OK(dcd_step(world));

    /* Shapes where the bodies are, in the colour of their owner; a mesh by its vertices. */
    DcdDebugDraw draw = by(&seen, DCD_DRAW_SHAPES);
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.shapes == 4 && seen.points + seen.lines + seen.boxes + seen.texts == 0);
    HOLDS(seen.bodies[0].v == floor.v && seen.bodies[1].v == left.v && seen.bodies[2].v == right.v && seen.bodies[3].v == hull.v);
    for (size_t i = 0; i < 4; i++) {
        OK(dcd_body_get(world, seen.bodies[i], &pose, NULL));
        HOLDS(memcmp(&pose, &seen.poses[i], sizeof pose) == 0);
    }
    HOLDS(seen.drawn[0].kind == DCD_DRAWN_BOX && seen.drawn[0].size[0] == 20.0f && seen.drawn[0].size[1] == 0.5f);
    HOLDS(seen.drawn[1].kind == DCD_DRAWN_SPHERE && seen.drawn[1].size[0] == 0.5f && seen.drawn[1].vertices == NULL);
    HOLDS(seen.drawn[3].kind == DCD_DRAWN_MESH && seen.drawn[3].vertex_count == 4 && seen.drawn[3].triangle_count == 4);
    HOLDS(seen.colours[1] == 0x4269d0FFu && seen.colours[2] == 0xefb118FFu && seen.colours[3] == seen.colours[2]);

    /* Between steps, at the ticks that the game shows. */
    time.now = time.shown = time.predicted = 9.5;
    draw = by(&seen, DCD_DRAW_SHAPES);
    OK(dcd_debug_draw(world, &time, &draw));
    OK(dcd_view_body(world, hull, 9.5, &pose, NULL));
    HOLDS(memcmp(&pose, &seen.poses[3], sizeof pose) == 0);

    /* Each of the other layers. */
    draw = by(&seen, DCD_DRAW_AABBS);
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.boxes == 3 && fabs(seen.max[0][0] - -2.5) < 0.05 && fabs(seen.min[0][1]) < 0.05);
    draw = by(&seen, DCD_DRAW_BORDERS);
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.boxes == 2 && seen.max[0][0] == 0.0 && seen.min[1][0] == 0.0 && seen.max[1][0] == 64.0);
    draw = by(&seen, DCD_DRAW_CONTACTS);
    draw.force_scale = 1e-3f;
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.points == 2 && seen.lines == 2);
    /* A ball of 524 kg presses on the ground with 5.1 kN. */
    HOLDS(fabs(fabs(seen.to[0][1] - seen.from[0][1]) - 5.14) < 0.6 && fabs(seen.from[0][0] - -3.0) < 0.05);
    draw = by(&seen, DCD_DRAW_CENTRES_OF_MASS | DCD_DRAW_LABELS | DCD_DRAW_VELOCITIES);
    draw.max[1] = 10.0; /* without the hull, which falls from above */
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.points == 2 && seen.texts == 2 && strcmp(seen.text, "b2") == 0);
    draw = by(&seen, DCD_DRAW_ALL);
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.shapes == 4 && seen.texts == 3 && seen.boxes >= 3 + 3 + 2);

    /* Without their functions, boxes and shapes are drawn as lines; points and texts are not drawn. */
    draw = by(&seen, DCD_DRAW_AABBS | DCD_DRAW_LABELS | DCD_DRAW_CENTRES_OF_MASS);
    draw.draw_box = NULL;
    draw.draw_text = NULL;
    draw.draw_point = NULL;
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.lines == 3 * 12 && seen.boxes + seen.texts + seen.points == 0);
    draw = by(&seen, DCD_DRAW_SHAPES);
    draw.draw_shape = NULL;
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.lines > 12 && seen.from[0][1] <= 0.0 && fabs(seen.from[0][0]) == 20.0);
    draw.draw_line = NULL;
    OK(dcd_debug_draw(world, NULL, &draw));

    /* A function that calls its world gets an error, and the world goes on. */
    draw = by(&seen, DCD_DRAW_LABELS);
    seen.world = world;
    draw.draw_text = on_text_that_calls;
    OK(dcd_debug_draw(world, NULL, &draw));
    HOLDS(seen.texts == 3 && seen.inside == DCD_ERR_BUSY);
    OK(dcd_step(world));

    /* Misuse. */
    FAILS(dcd_debug_draw(world, NULL, NULL), DCD_ERR_NULL, "draw");
    FAILS(dcd_debug_draw((DcdWorld){ 0 }, NULL, &draw), DCD_ERR_NULL, "world");
    draw.flags = 1u << 20;
    FAILS(dcd_debug_draw(world, NULL, &draw), DCD_ERR_ARGUMENT, "flags");
    draw = by(&seen, DCD_DRAW_ALL);
    draw.struct_size = 8;
    FAILS(dcd_debug_draw(world, NULL, &draw), DCD_ERR_STRUCT, "DcdDebugDraw");
    draw = by(&seen, DCD_DRAW_ALL);
    draw.min[2] = NAN;
    FAILS(dcd_debug_draw(world, NULL, &draw), DCD_ERR_ARGUMENT, "corner");
    draw = by(&seen, DCD_DRAW_ALL);
    draw.force_scale = INFINITY;
    FAILS(dcd_debug_draw(world, NULL, &draw), DCD_ERR_ARGUMENT, "force_scale");
    draw = by(&seen, DCD_DRAW_ALL);
    time.shown = NAN;
    FAILS(dcd_debug_draw(world, &time, &draw), DCD_ERR_ARGUMENT, "tick");
    HOLDS(seen.shapes == 0);

    /* A glTF file of the world, at argv[1]. */
    HOLDS(argc == 2);
    OK(dcd_gltf_save_file(world, argv[1]));
    FAILS(dcd_gltf_save_file(world, "/nowhere/at/all.glb"), DCD_ERR_IO, "path");
    FAILS(dcd_gltf_save_file(world, NULL), DCD_ERR_NULL, "path");
    OK(dcd_world_destroy(world));
    FAILS(dcd_debug_draw(world, NULL, &draw), DCD_ERR_STALE_ID, "world");
    return checked();
}
