/* Every misuse of the C API for which the header has a code: each call must return its code, and nothing may
 * crash. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <math.h>
#include <pthread.h>

static const DcdWorld NO_WORLD = { 0 };
static const DcdBodyId NO_BODY = { 0 };
static const DcdShapeId NO_SHAPE = { 0 };
static const DcdJointId NO_JOINT = { 0 };
static const float HALF[3] = { 0.5f, 0.5f, 0.5f };
static const float BAD[3] = { 0.0f, NAN, 0.0f };

/* A pointer that is not aligned. */
#define CROOKED(type, memory) ((type *)(void *)((char *)(memory) + 1))

static DcdWorld make_world(uint32_t regions)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 0 };
    def.regions = regions;
    EXPECT(dcd_world_create(&def, &world), DCD_OK);
    return world;
}

static DcdShapeId make_box(DcdWorld world)
{
    DcdShapeId shape = { 0 };
    EXPECT(dcd_shape_box(world, HALF, &shape), DCD_OK);
    return shape;
}

static DcdBodyId make_body(DcdWorld world, DcdShapeId shape, DcdBodyType type, double y)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId body = { 0 };
    def.shape = shape;
    def.body_type = type;
    def.pose.p[1] = y;
    EXPECT(dcd_body_create(world, &def, &body), DCD_OK);
    return body;
}

/* A dynamic body cannot lose all its mass in any way. A refused call changes nothing. */
static void mass_stays(void)
{
    const float corners[] = { 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    const uint32_t triangle[] = { 0, 1, 2 };
    DcdWorld world = make_world(1);
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
    DcdColliderProperties part = DCD_COLLIDER_PROPERTIES_INIT;
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    DcdShapeId sheet = { 0 }, box = make_box(world);
    DcdBodyId body = { 0 };
    EXPECT(dcd_shape_mesh(world, corners, 3, triangle, 1, false, &sheet), DCD_OK);
    def.shape = sheet;
    FAILS(dcd_body_create(world, &def, &body), DCD_ERR_ARGUMENT, "no mass");
    def.extra_mass = 3.0f;
    EXPECT(dcd_body_create(world, &def, &body), DCD_OK);
    EXPECT(dcd_body_properties(world, body, &as), DCD_OK);
    as.extra_mass = 0.0f;
    as.gravity_scale = 0.5f;
    FAILS(dcd_body_set_properties(world, body, &as), DCD_ERR_ARGUMENT, "no mass");
    EXPECT(dcd_body_properties(world, body, &as), DCD_OK);
    HOLDS(as.extra_mass == 3.0f && as.gravity_scale == 1.0f);
    EXPECT(dcd_collider_add(world, body, box, NULL, NULL), DCD_OK);
    as.extra_mass = 0.0f;
    EXPECT(dcd_body_set_properties(world, body, &as), DCD_OK); /* the box has a mass */
    FAILS(dcd_collider_remove(world, body, 1), DCD_ERR_ARGUMENT, "no mass");
    FAILS(dcd_collider_set_shape(world, body, 1, sheet), DCD_ERR_ARGUMENT, "no mass");
    EXPECT(dcd_collider_properties(world, body, 1, &part), DCD_OK);
    part.density = 0.0f;
    part.friction = 0.25f;
    FAILS(dcd_collider_set_properties(world, body, 1, &part), DCD_ERR_ARGUMENT, "no mass");
    part.density = 1000.0f;
    part.flags = DCD_COLLIDER_DISABLED;
    FAILS(dcd_collider_set_properties(world, body, 1, &part), DCD_ERR_ARGUMENT, "no mass");
    EXPECT(dcd_collider_properties(world, body, 1, &part), DCD_OK);
    HOLDS(part.friction == 0.5f && part.flags == 0);
    EXPECT(dcd_body_info(world, body, &info), DCD_OK);
    HOLDS(fabsf(info.mass - 1000.0f) < 1.0f);
    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_collider_remove(world, body, 0), DCD_OK);
    EXPECT(dcd_world_destroy(world), DCD_OK);
}

static void library(void)
{
    char small[8];
    HOLDS(dcd_version() == DCD_VERSION);
    HOLDS(dcd_version_check() == DCD_OK);
    HOLDS(strlen(dcd_version_string()) >= 5);
    HOLDS(strcmp(dcd_status_string(DCD_ERR_STALE_ID), "DCD_ERR_STALE_ID") == 0);
    HOLDS(strcmp(dcd_status_string(12345), "(no DCD status)") == 0);
    HOLDS(strcmp(dcd_refused_string(DCD_REFUSED_TOO_FAR), "DCD_REFUSED_TOO_FAR") == 0);
    HOLDS(strcmp(dcd_refused_string(0), "(no DCD reason)") == 0);
    HOLDS(dcd_last_error(NULL, 0) == 0);
    HOLDS(dcd_last_error(NULL, 100) == 0);
    EXPECT(dcd_world_create(NULL, NULL), DCD_ERR_NULL);
    HOLDS(dcd_last_error(small, sizeof small) > sizeof small);
    HOLDS(strcmp(small, "dcd_wor") == 0);
    HOLDS(dcd_last_error(small, 0) > 0);
    EXPECT(dcd_log_set(NULL, NULL, 6), DCD_ERR_ARGUMENT);
}

static void worlds(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 7 }, again;
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;

    EXPECT(dcd_world_create(&def, NULL), DCD_ERR_NULL);
    EXPECT(dcd_world_create(NULL, &world), DCD_ERR_NULL);
    def.struct_size = 0;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_STRUCT);
    def.struct_size = UINT32_MAX;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_STRUCT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.regions = 257;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.regions = UINT32_MAX;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.threads = UINT32_MAX;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.gravity[2] = INFINITY;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.dt = 0.0f;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.dt = NAN;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.dt = 1e6f;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "dt is 1000000: ");
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.solver_iterations = 0;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.min[0] = NAN;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.min[0] = 65.0;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.min[0] = -64.0;
    def.min[1] = def.max[1];
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "(min) below");
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.axes = DCD_CUT_X;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "regions is 0");
    def.regions = 4;
    def.axes = 8;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "axes has bits 0x8");
    EXPECT(dcd_world_open_scene("tower", NULL, 0, &def, &world), DCD_ERR_ARGUMENT);
    DcdCut cut = { 0.0, DCD_CUT_X, 0 };
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.cut_count = 1;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_NULL, "cuts is null");
    def.cuts = &cut;
    cut.axis = DCD_CUT_X | DCD_CUT_Y;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "cuts[i].axis is 3");
    cut.axis = DCD_CUT_X;
    cut.at = NAN;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "cuts[i].at");
    cut.at = 64.0;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "does not cut any region");
    cut.at = 0.0;
    cut.reserved = 1;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "reserved");
    cut.reserved = 0;
    def.regions = 2;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "regions or axes");
    FAILS(dcd_world_open_scene("tower", NULL, 0, &def, &world), DCD_ERR_ARGUMENT, "regions or axes");
    def.regions = 0;
    def.reserved = 1;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "reserved");
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.speed_limit = -1.0f;
    FAILS(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT, "speed_limit is -1; ");
    def.speed_limit = NAN;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.speed_limit = INFINITY;
    EXPECT(dcd_world_open_scene("tower", NULL, 0, &def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.coupling = DCD_COUPLING_AUTO + 1;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    EXPECT(dcd_world_open_scene("tower", NULL, 0, &def, &world), DCD_ERR_ARGUMENT);
    def.coupling = DCD_COUPLING_DEFAULT;
    def.preset = UINT32_MAX;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.preset = DCD_PRESET_DRAFT;
    def.coupling = DCD_COUPLING_OWNER; /* it has no presets */
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.exchanges = 65;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.exchanges = UINT32_MAX;
    EXPECT(dcd_world_open_scene("tower", NULL, 0, &def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.depth = 17;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.island_limit = 65535;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.tolerance = -0.5f;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.tolerance = NAN;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    def.tolerance = INFINITY;
    EXPECT(dcd_world_create(&def, &world), DCD_ERR_ARGUMENT);
    HOLDS(world.v == 7); /* written on success only */

    EXPECT(dcd_step(NO_WORLD), DCD_ERR_NULL);
    EXPECT(dcd_world_destroy(NO_WORLD), DCD_ERR_NULL);
    HOLDS(!dcd_world_is_valid(NO_WORLD));
    HOLDS(!dcd_world_is_valid((DcdWorld){ UINT64_MAX }));
    EXPECT(dcd_step((DcdWorld){ UINT64_MAX }), DCD_ERR_STALE_ID);

    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.user_data = 99;
    EXPECT(dcd_world_create(&def, &world), DCD_OK);
    EXPECT(dcd_world_info(world, NULL), DCD_ERR_NULL);
    info.struct_size--;
    EXPECT(dcd_world_info(world, &info), DCD_ERR_STRUCT);
    info.struct_size++;
    EXPECT(dcd_world_info(world, &info), DCD_OK);
    HOLDS(info.role == DCD_ROLE_LOCAL && info.user_data == 99 && info.regions == 1 && info.tick == 0);
    HOLDS(info.dt == def.dt && info.gravity[1] == def.gravity[1] && info.speed_limit == 400.0f);
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_world_destroy(world), DCD_ERR_STALE_ID);
    EXPECT(dcd_step(world), DCD_ERR_STALE_ID);
    again = make_world(1); /* reuses the slot, but not the handle */
    HOLDS(again.v != world.v && !dcd_world_is_valid(world) && dcd_world_is_valid(again));
    EXPECT(dcd_world_destroy(again), DCD_OK);
}

static void scenes(void)
{
    DcdWorld world = { 0 };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyId body;
    const char *few[] = { "n=3" }, *unknown[] = { "colour=3" }, *broken[] = { "n" }, *none[] = { NULL };

    EXPECT(dcd_world_open_scene(NULL, NULL, 0, NULL, &world), DCD_ERR_NULL);
    EXPECT(dcd_world_open_scene("tower", NULL, 0, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_world_open_scene("tower", NULL, 1, NULL, &world), DCD_ERR_NULL);
    EXPECT(dcd_world_open_scene("tower", none, 1, NULL, &world), DCD_ERR_NULL);
    EXPECT(dcd_world_open_scene("towr", NULL, 0, NULL, &world), DCD_ERR_ARGUMENT);
    EXPECT(dcd_world_open_scene("tow\xff", NULL, 0, NULL, &world), DCD_ERR_ARGUMENT);
    EXPECT(dcd_world_open_scene("tower", unknown, 1, NULL, &world), DCD_ERR_ARGUMENT);
    EXPECT(dcd_world_open_scene("tower", broken, 1, NULL, &world), DCD_ERR_ARGUMENT);
    EXPECT(dcd_world_open_scene("no/such/file.toml", NULL, 0, NULL, &world), DCD_ERR_IO);
    def.struct_size = 4;
    EXPECT(dcd_world_open_scene("tower", few, 1, &def, &world), DCD_ERR_STRUCT);
    HOLDS(world.v == 0);
    def = (DcdWorldDef)DCD_WORLD_DEF_INIT;
    def.regions = 2;
    EXPECT(dcd_world_open_scene("tower", few, 1, &def, &world), DCD_OK);
    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_body_at(world, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_at(world, 0, &body), DCD_OK);
    HOLDS(dcd_body_is_valid(world, body));
    EXPECT(dcd_body_at(world, UINT32_MAX, &body), DCD_ERR_STALE_ID);
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_world_open_scene("tower", few, 1, NULL, &world), DCD_OK);
    EXPECT(dcd_world_destroy(world), DCD_OK);
}

static void shapes(void)
{
    DcdWorld world = make_world(1), other = make_world(1);
    DcdShapeId shape = { 5 }, parts[2];
    DcdFrame frames[2] = { { { 0, 0, 0 }, { 0, 0, 0, 1 } }, { { 0, 1, 0 }, { 0, 0, 0, 1 } } };
    const float flat[12] = { 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 1 };
    const float solid[12] = { 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0 };
    const float dust[12] = { 0, 0, 0, 9e-5f, 0, 0, 0, 0, 9e-5f, 0, 9e-5f, 0 };
    const float sheet[12] = { 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 9e-5f, 0 };
    const uint32_t triangle[3] = { 0, 1, 2 }, beyond[3] = { 0, 1, 4 };
    const uint32_t line[6] = { 0, 1, 1, 0, 1, 2 };
    const float zero[3] = { 1.0f, 0.0f, 1.0f };
    const float high[4] = { 0.0f, 1e6f, 0.0f, 0.0f };
    const float steep[3] = { 1.0f, 1e6f, 1.0f };

    EXPECT(dcd_shape_box(NO_WORLD, HALF, &shape), DCD_ERR_NULL);
    EXPECT(dcd_shape_box(world, NULL, &shape), DCD_ERR_NULL);
    EXPECT(dcd_shape_box(world, HALF, NULL), DCD_ERR_NULL);
    EXPECT(dcd_shape_box(world, CROOKED(const float, solid), &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_box(world, BAD, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_box(world, zero, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_sphere(world, -1.0f, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_sphere(world, INFINITY, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_capsule(world, NAN, 1.0f, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_cylinder(world, 1.0f, 0.0f, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_cone(world, 0.0f, 1.0f, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_hull(world, NULL, 4, &shape), DCD_ERR_NULL);
    EXPECT(dcd_shape_hull(world, solid, 3, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_hull(world, solid, 0, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_hull(world, flat, 4, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_hull(world, solid, SIZE_MAX, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_mesh(world, solid, 4, triangle, 0, false, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_mesh(world, solid, 4, beyond, 1, false, &shape), DCD_ERR_ARGUMENT);
    FAILS(dcd_shape_mesh(world, solid, 4, line, 1, false, &shape), DCD_ERR_ARGUMENT, "mesh is flat");
    FAILS(dcd_shape_hull(world, dust, 4, &shape), DCD_ERR_ARGUMENT, "1e-4");
    FAILS(dcd_shape_hull(world, sheet, 4, &shape), DCD_ERR_ARGUMENT, "1e-4"); /* along one axis */
    EXPECT(dcd_shape_mesh(world, solid, 4, NULL, 1, false, &shape), DCD_ERR_NULL);
    EXPECT(dcd_shape_mesh(world, solid, 4, triangle, SIZE_MAX / 2, false, &shape), DCD_ERR_ARGUMENT);
    EXPECT(dcd_shape_heightfield(world, solid, 1, 4, HALF, &shape), DCD_ERR_ARGUMENT);
    FAILS(dcd_shape_heightfield(world, solid, SIZE_MAX, SIZE_MAX, HALF, &shape), DCD_ERR_ARGUMENT, "cut the terrain");
    EXPECT(dcd_shape_heightfield(world, solid, 2, 2, zero, &shape), DCD_ERR_ARGUMENT);
    FAILS(dcd_shape_heightfield(world, high, 2, 2, steep, &shape), DCD_ERR_ARGUMENT, "heights times scale[1]");
    EXPECT(dcd_shape_compound(world, parts, frames, 0, &shape), DCD_ERR_ARGUMENT);
    HOLDS(shape.v == 5);

    EXPECT(dcd_shape_hull(world, solid, 4, &shape), DCD_OK);
    EXPECT(dcd_shape_heightfield(world, solid, 2, 3, HALF, &shape), DCD_OK);
    parts[0] = make_box(world);
    parts[1] = shape;
    FAILS(dcd_shape_compound(world, parts, frames, 2, &shape), DCD_ERR_ARGUMENT, "parts[1]"); /* terrain is no part either */
    EXPECT(dcd_shape_mesh(world, solid, 4, line, 2, false, &shape), DCD_OK); /* the valid triangle alone */
    EXPECT(dcd_shape_mesh(world, solid, 4, line, 2, true, &shape), DCD_OK);
    FAILS(dcd_shape_mesh(world, solid, 4, line, 1, true, &shape), DCD_ERR_ARGUMENT, "mesh is flat");
    EXPECT(dcd_shape_mesh(world, solid, 4, triangle, 1, false, &shape), DCD_OK);
    parts[0] = make_box(world);
    parts[1] = shape;
    EXPECT(dcd_shape_compound(world, parts, frames, 2, &shape), DCD_ERR_ARGUMENT); /* a mesh is no part */
    parts[1] = make_box(other);
    EXPECT(dcd_shape_compound(world, parts, frames, 2, &shape), DCD_ERR_STALE_ID);
    parts[1] = parts[0];
    frames[1].q[3] = 0.5f;
    EXPECT(dcd_shape_compound(world, parts, frames, 2, &shape), DCD_ERR_ARGUMENT);
    frames[1].q[3] = 1.0f;
    EXPECT(dcd_shape_compound(world, parts, frames, 2, &shape), DCD_OK);

    const float level[3] = { 1.0f, 0.0f, 1.0f }, dusty[3] = { 1e-5f, 1e-5f, 1e-5f }, vast[3] = { 1e6f, 1e6f, NAN };
    EXPECT(dcd_shape_scale(world, parts[0], NULL, &shape), DCD_ERR_NULL);
    EXPECT(dcd_shape_scale(world, parts[0], HALF, NULL), DCD_ERR_NULL);
    FAILS(dcd_shape_scale(world, parts[0], level, &shape), DCD_ERR_ARGUMENT, "scale");
    FAILS(dcd_shape_scale(world, parts[0], vast, &shape), DCD_ERR_ARGUMENT, "scale");
    FAILS(dcd_shape_scale(world, parts[0], dusty, &shape), DCD_ERR_ARGUMENT, "1e-4");
    EXPECT(dcd_shape_scale(other, parts[0], HALF, &shape), DCD_ERR_STALE_ID);
    EXPECT(dcd_shape_scale(world, parts[0], HALF, &shape), DCD_OK);

    const float none[3] = { 0.0f, 0.0f, 0.0f }, infinite[3] = { 0.0f, INFINITY, 0.0f };
    DcdShapeId hollow;
    FAILS(dcd_shape_half_space(world, NULL, &shape), DCD_ERR_NULL, "normal");
    EXPECT(dcd_shape_half_space(world, level, NULL), DCD_ERR_NULL);
    FAILS(dcd_shape_half_space(world, none, &shape), DCD_ERR_ARGUMENT, "no length");
    FAILS(dcd_shape_half_space(world, infinite, &shape), DCD_ERR_ARGUMENT, "normal");
    FAILS(dcd_shape_segment(world, NULL, level, &shape), DCD_ERR_NULL, "a is null");
    FAILS(dcd_shape_segment(world, level, NULL, &shape), DCD_ERR_NULL, "b is null");
    EXPECT(dcd_shape_segment(world, none, level, NULL), DCD_ERR_NULL);
    FAILS(dcd_shape_segment(world, level, level, &shape), DCD_ERR_ARGUMENT, "length from a to b is 0");
    FAILS(dcd_shape_segment(world, none, infinite, &shape), DCD_ERR_ARGUMENT, "b has inf");
    EXPECT(dcd_shape_segment(world, none, level, &hollow), DCD_OK);
    FAILS(dcd_shape_round(world, hollow, 0.1f, &shape), DCD_ERR_ARGUMENT, "sharp edges");
    EXPECT(dcd_shape_destroy(world, hollow), DCD_OK);
    EXPECT(dcd_shape_round(world, hollow, 0.1f, &shape), DCD_ERR_STALE_ID);
    EXPECT(dcd_shape_round(world, parts[0], 0.1f, NULL), DCD_ERR_NULL);
    FAILS(dcd_shape_round(world, parts[0], -0.1f, &shape), DCD_ERR_ARGUMENT, "border is -0.1");
    FAILS(dcd_shape_round(world, parts[0], NAN, &shape), DCD_ERR_ARGUMENT, "border");

    EXPECT(dcd_shape_destroy(world, NO_SHAPE), DCD_ERR_NULL);
    EXPECT(dcd_shape_destroy(other, shape), DCD_ERR_STALE_ID);
    EXPECT(dcd_shape_destroy(world, shape), DCD_OK);
    EXPECT(dcd_shape_destroy(world, shape), DCD_ERR_STALE_ID);
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_world_destroy(other), DCD_OK);
}

static void bodies(void)
{
    DcdWorld world = make_world(2), other = make_world(1);
    DcdShapeId box = make_box(world);
    DcdBodyDef good = DCD_BODY_DEF_INIT, def, defs[3];
    DcdBodyId body = { 5 }, many[3] = { { 5 }, { 5 }, { 5 } }, fixed;
    DcdPose pose = good.pose, read;
    DcdVelocity velocity = good.velocity;
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    const double far_point[3] = { 0.0, INFINITY, 0.0 };
    good.shape = box;

    EXPECT(dcd_body_create(world, NULL, &body), DCD_ERR_NULL);
    EXPECT(dcd_body_create(world, &good, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_create(NO_WORLD, &good, &body), DCD_ERR_NULL);
    EXPECT(dcd_body_create(other, &good, &body), DCD_ERR_STALE_ID); /* the shape is of another world */
#define REFUSED(member, value, code)                                                                                  \
    def = good;                                                                                                       \
    def.member = value;                                                                                               \
    EXPECT(dcd_body_create(world, &def, &body), code)
    REFUSED(struct_size, 8, DCD_ERR_STRUCT);
    REFUSED(body_type, 4, DCD_ERR_ARGUMENT);
    REFUSED(pose.p[0], (double)NAN, DCD_ERR_ARGUMENT);
    REFUSED(pose.p[0], (double)INFINITY, DCD_ERR_ARGUMENT);
    REFUSED(pose.q[3], 0.0f, DCD_ERR_ARGUMENT);
    REFUSED(velocity.linear[1], NAN, DCD_ERR_ARGUMENT);
    REFUSED(velocity.angular[1], INFINITY, DCD_ERR_ARGUMENT);
    REFUSED(shape, NO_SHAPE, DCD_ERR_NULL);
    REFUSED(density, 0.0f, DCD_ERR_ARGUMENT);
    REFUSED(density, NAN, DCD_ERR_ARGUMENT);
    REFUSED(friction, -1.0f, DCD_ERR_ARGUMENT);
    REFUSED(restitution, INFINITY, DCD_ERR_ARGUMENT);
    REFUSED(restitution, 1.01f, DCD_ERR_ARGUMENT);
    REFUSED(restitution, -0.01f, DCD_ERR_ARGUMENT);
    REFUSED(restitution, NAN, DCD_ERR_ARGUMENT);
    REFUSED(hooks, 8, DCD_ERR_ARGUMENT);
    REFUSED(linear_damping, -0.5f, DCD_ERR_ARGUMENT);
    REFUSED(angular_damping, NAN, DCD_ERR_ARGUMENT);
    REFUSED(gravity_scale, NAN, DCD_ERR_ARGUMENT);
    REFUSED(flags, 256, DCD_ERR_ARGUMENT);
    REFUSED(locked, 64, DCD_ERR_ARGUMENT);
    REFUSED(events, 4, DCD_ERR_ARGUMENT);
    REFUSED(force_threshold, -1.0f, DCD_ERR_ARGUMENT);
    REFUSED(mass, -1.0f, DCD_ERR_ARGUMENT);
    REFUSED(friction_rule, 6, DCD_ERR_ARGUMENT);
    REFUSED(restitution_rule, UINT32_MAX, DCD_ERR_ARGUMENT);
    REFUSED(contact_skin, NAN, DCD_ERR_ARGUMENT);
    REFUSED(pairs, 64, DCD_ERR_ARGUMENT);
    REFUSED(dominance, 128, DCD_ERR_ARGUMENT);
    REFUSED(dominance, -129, DCD_ERR_ARGUMENT);
    REFUSED(soft_ccd, -1.0f, DCD_ERR_ARGUMENT);
    REFUSED(sleep_linear, NAN, DCD_ERR_ARGUMENT);
    REFUSED(sleep_angular, -1.0f, DCD_ERR_ARGUMENT);
    REFUSED(sleep_after, INFINITY, DCD_ERR_ARGUMENT);
    REFUSED(extra_mass, -1.0f, DCD_ERR_ARGUMENT);
    REFUSED(extra_centre[0], 1.0f, DCD_ERR_ARGUMENT); /* without extra mass */
    REFUSED(extra_inertia[2], 1.0f, DCD_ERR_ARGUMENT);
    REFUSED(extra_solver_iterations, 1001, DCD_ERR_ARGUMENT);
    REFUSED(extra_pgs_iterations, UINT32_MAX, DCD_ERR_ARGUMENT);
    HOLDS(body.v == 5);
    REFUSED(extra_mass, 1.0f, DCD_OK);
    EXPECT(dcd_body_destroy(world, body), DCD_OK);
    body.v = 5;

    defs[0] = defs[1] = defs[2] = good;
    defs[2].density = -1.0f;
    EXPECT(dcd_bodies_create(world, defs, 3, many), DCD_ERR_ARGUMENT);
    HOLDS(many[0].v == 5);
    defs[2] = good;
    defs[1].struct_size = 1000;
    EXPECT(dcd_bodies_create(world, defs, 3, many), DCD_ERR_STRUCT);
    FAILS(dcd_bodies_create(world, defs, SIZE_MAX, many), DCD_ERR_ARGUMENT, "defs has a count of -1; ");
    FAILS(dcd_bodies_create(world, defs, DCD_MAX_ITEMS + 1, many), DCD_ERR_ARGUMENT, "defs has a count of 16777217, ");
    EXPECT(dcd_bodies_create(world, NULL, 0, NULL), DCD_OK);
    defs[1] = good;
    EXPECT(dcd_bodies_create(world, defs, 3, NULL), DCD_ERR_NULL);
    EXPECT(dcd_bodies_create(world, defs, 3, many), DCD_OK);
    fixed = make_body(world, box, DCD_FIXED, -5.0);

    DcdCharacterDef walks = DCD_CHARACTER_DEF_INIT, odd;
    DcdBodyDef person = good;
    person.body_type = DCD_KINEMATIC;
    person.pose.p[0] = 30.0;
    body.v = 5;
    EXPECT(dcd_character_create(world, NULL, &walks, &body), DCD_ERR_NULL);
    EXPECT(dcd_character_create(world, &person, NULL, &body), DCD_ERR_NULL);
    EXPECT(dcd_character_create(world, &person, &walks, NULL), DCD_ERR_NULL);
    EXPECT(dcd_character_create(world, &good, &walks, &body), DCD_ERR_ARGUMENT);
#define CANNOT(member, value, code)                                                                                   \
    odd = walks;                                                                                                      \
    odd.member = value;                                                                                               \
    EXPECT(dcd_character_create(world, &person, &odd, &body), code)
    CANNOT(struct_size, 8, DCD_ERR_STRUCT);
    CANNOT(reserved, 1, DCD_ERR_ARGUMENT);
    CANNOT(step_height, -0.1f, DCD_ERR_ARGUMENT);
    CANNOT(step_depth, 101.0f, DCD_ERR_ARGUMENT);
    CANNOT(max_climb, 2.0f, DCD_ERR_ARGUMENT);
    CANNOT(min_slide, NAN, DCD_ERR_ARGUMENT);
    CANNOT(snap, INFINITY, DCD_ERR_ARGUMENT);
    CANNOT(gap, 0.0f, DCD_ERR_ARGUMENT);
    CANNOT(mass, -1.0f, DCD_ERR_ARGUMENT);
#undef CANNOT
    person.flags = DCD_BODY_SENSOR;
    EXPECT(dcd_character_create(world, &person, &walks, &body), DCD_ERR_ARGUMENT);
    person.flags = 0;
    HOLDS(body.v == 5);
    EXPECT(dcd_character_create(world, &person, &walks, &body), DCD_OK);
    EXPECT(dcd_body_destroy(world, body), DCD_OK);
    body.v = 5;

    DcdVehicleDef car = DCD_VEHICLE_DEF_INIT, cart;
    DcdWheel wheel = DCD_WHEEL_INIT;
    DcdDrive drive = { 1.0f, 0.0f, -1.0f };
    DcdBodyDef frame = good;
    frame.pose.p[0] = 40.0;
    EXPECT(dcd_vehicle_create(world, NULL, &car, &body), DCD_ERR_NULL);
    EXPECT(dcd_vehicle_create(world, &frame, NULL, &body), DCD_ERR_NULL);
    EXPECT(dcd_vehicle_create(world, &frame, &car, NULL), DCD_ERR_NULL);
    EXPECT(dcd_vehicle_create(world, &person, &car, &body), DCD_ERR_ARGUMENT);
#define CANNOT(member, value, code)                                                                                   \
    cart = car;                                                                                                       \
    cart.member = value;                                                                                              \
    EXPECT(dcd_vehicle_create(world, &frame, &cart, &body), code)
    CANNOT(struct_size, 8, DCD_ERR_STRUCT);
    CANNOT(reserved, 1, DCD_ERR_ARGUMENT);
    CANNOT(wheel_count, 1, DCD_ERR_NULL);
    CANNOT(wheel_count, 4000000000u, DCD_ERR_ARGUMENT);
    CANNOT(top_speed, NAN, DCD_ERR_ARGUMENT);
    wheel.radius = 0.0f;
    cart = car;
    cart.wheels = &wheel;
    cart.wheel_count = 1;
    EXPECT(dcd_vehicle_create(world, &frame, &cart, &body), DCD_ERR_ARGUMENT);
#undef CANNOT
    HOLDS(body.v == 5);
    EXPECT(dcd_vehicle_drive(world, many[0], &drive), DCD_ERR_ARGUMENT);
    EXPECT(dcd_vehicle_create(world, &frame, &car, &body), DCD_OK);
    EXPECT(dcd_vehicle_drive(world, body, NULL), DCD_ERR_NULL);
    EXPECT(dcd_vehicle_drive(world, body, &drive), DCD_OK);
    drive.brake = 2.0f;
    EXPECT(dcd_vehicle_drive(world, body, &drive), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_destroy(world, body), DCD_OK);
    EXPECT(dcd_vehicle_drive(world, body, &drive), DCD_ERR_STALE_ID);
    body.v = 5;

    EXPECT(dcd_body_info(world, many[0], &info), DCD_OK);
    HOLDS(fabsf(info.mass - 1000.0f) < 0.1f && info.body_type == DCD_DYNAMIC && info.region != DCD_NO_REGION);
    EXPECT(dcd_body_info(world, fixed, &info), DCD_OK);
    HOLDS(info.body_type == DCD_FIXED && info.region == DCD_NO_REGION && info.mass == 0.0f);
    EXPECT(dcd_body_info(world, many[0], NULL), DCD_ERR_NULL);
    info.struct_size = 0;
    EXPECT(dcd_body_info(world, many[0], &info), DCD_ERR_STRUCT);

    EXPECT(dcd_body_get(world, NO_BODY, &read, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_get(world, (DcdBodyId){ 1 }, &read, NULL), DCD_ERR_STALE_ID);
    EXPECT(dcd_body_get(world, (DcdBodyId){ UINT64_MAX }, &read, NULL), DCD_ERR_STALE_ID);
    EXPECT(dcd_body_get(other, many[0], &read, NULL), DCD_ERR_STALE_ID);
    EXPECT(dcd_body_get(world, many[0], NULL, NULL), DCD_OK);
    HOLDS(!dcd_body_is_valid(other, many[0]) && dcd_body_is_valid(world, many[0]));
    HOLDS(!dcd_body_is_valid(world, NO_BODY) && !dcd_body_is_valid(NO_WORLD, many[0]));

    EXPECT(dcd_body_set_pose(world, many[0], NULL), DCD_ERR_NULL);
    pose.p[2] = (double)NAN;
    EXPECT(dcd_body_set_pose(world, many[0], &pose), DCD_ERR_ARGUMENT);
    pose.p[2] = 0.0;
    pose.q[0] = 1.0f;
    EXPECT(dcd_body_set_pose(world, many[0], &pose), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_velocity(world, fixed, &velocity), DCD_ERR_ARGUMENT);
    velocity.linear[0] = NAN;
    EXPECT(dcd_body_set_velocity(world, many[0], &velocity), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_apply_impulse(world, many[0], NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_apply_impulse(world, many[0], BAD, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_apply_impulse(world, many[0], HALF, far_point), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_apply_impulse(world, fixed, HALF, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_apply_torque_impulse(world, many[0], BAD), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_force(world, many[0], BAD, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_force(world, many[0], NULL, NULL), DCD_OK);
    EXPECT(dcd_body_set_events(world, NO_BODY, 0, 0, 0.0f), DCD_ERR_NULL);
    EXPECT(dcd_body_set_events(other, many[0], 0, 0, 0.0f), DCD_ERR_STALE_ID);
    EXPECT(dcd_body_set_events(world, many[0], 1, 0, 0.0f), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_events(world, many[0], 0, 4, 0.0f), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_events(world, many[0], 0, 3, NAN), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_events(world, many[0], DCD_ALL_COLLIDERS, 3, 1.0f), DCD_OK);
    EXPECT(dcd_body_set_material(world, many[0], 0, -1.0f, 0.0f), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_material(world, many[0], 0, 0.0f, INFINITY), DCD_ERR_ARGUMENT);
    FAILS(dcd_body_set_material(world, many[0], 0, 0.0f, 5.0f), DCD_ERR_ARGUMENT, "0 to 1");
    EXPECT(dcd_body_set_material(world, fixed, 0, 0.5f, 0.0f), DCD_OK);
    EXPECT(dcd_body_set_groups(world, many[0], 7, 1, 1), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_groups(world, many[0], 0, 0xFFFFFFFFu, 0xFFFFFFFFu), DCD_OK);
    DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
    EXPECT(dcd_body_properties(world, many[0], NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_properties(other, many[0], &as), DCD_ERR_STALE_ID);
    as.struct_size = 4;
    EXPECT(dcd_body_properties(world, many[0], &as), DCD_ERR_STRUCT);
    as.struct_size = sizeof as;
    EXPECT(dcd_body_properties(world, many[0], &as), DCD_OK);
    EXPECT(dcd_body_set_properties(world, many[0], NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_set_properties(world, NO_BODY, &as), DCD_ERR_NULL);
    EXPECT(dcd_body_set_properties(other, many[0], &as), DCD_ERR_STALE_ID);
    as.flags = DCD_BODY_SENSOR; /* a flag of its collider */
    EXPECT(dcd_body_set_properties(world, many[0], &as), DCD_ERR_ARGUMENT);
    as.flags = 0;
    as.gravity_scale = NAN;
    EXPECT(dcd_body_set_properties(world, many[0], &as), DCD_ERR_ARGUMENT);
    as.gravity_scale = 1.0f;
    as.body_type = 4;
    EXPECT(dcd_body_set_properties(world, many[0], &as), DCD_ERR_ARGUMENT);

    DcdColliderProperties part = DCD_COLLIDER_PROPERTIES_INIT;
    uint32_t number = 7;
    EXPECT(dcd_collider_properties(world, many[0], 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_collider_properties(world, many[0], 1, &part), DCD_ERR_ARGUMENT);
    EXPECT(dcd_collider_properties(world, many[0], DCD_ALL_COLLIDERS, &part), DCD_ERR_ARGUMENT);
    EXPECT(dcd_collider_properties(world, many[0], 0, &part), DCD_OK);
    EXPECT(dcd_collider_set_properties(world, many[0], 1, &part), DCD_ERR_ARGUMENT);
    part.frame.q[0] = 2.0f;
    EXPECT(dcd_collider_set_properties(world, many[0], 0, &part), DCD_ERR_ARGUMENT);
    EXPECT(dcd_collider_add(world, many[0], box, &part, &number), DCD_ERR_ARGUMENT);
    part.struct_size = 0;
    EXPECT(dcd_collider_add(world, many[0], box, &part, &number), DCD_ERR_STRUCT);
    EXPECT(dcd_collider_add(world, many[0], NO_SHAPE, NULL, &number), DCD_ERR_NULL);
    EXPECT(dcd_collider_add(other, many[0], box, NULL, &number), DCD_ERR_STALE_ID);
    EXPECT(dcd_collider_remove(world, many[0], 0), DCD_ERR_ARGUMENT); /* its only collider */
    EXPECT(dcd_collider_set_shape(world, many[0], 0, NO_SHAPE), DCD_ERR_NULL);
    EXPECT(dcd_collider_set_shape(world, many[0], 1, box), DCD_ERR_ARGUMENT);
    HOLDS(number == 7);
    EXPECT(dcd_collider_add(world, many[0], box, NULL, NULL), DCD_OK);
    EXPECT(dcd_collider_remove(world, many[0], 2), DCD_ERR_ARGUMENT);
    EXPECT(dcd_collider_remove(world, many[0], 0), DCD_OK);
    EXPECT(dcd_body_set_events(world, many[0], 1, 0, 0.0f), DCD_ERR_ARGUMENT);

    DcdBodyId guided = make_body(world, box, DCD_KINEMATIC_POSE, -20.0);
    EXPECT(dcd_body_set_target(world, many[0], &good.pose), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_target(world, guided, NULL), DCD_ERR_NULL);
    pose = good.pose;
    pose.p[0] = 1e9;
    EXPECT(dcd_body_set_target(world, guided, &pose), DCD_ERR_ARGUMENT); /* at 60 Gm/s */
    pose.p[0] = (double)NAN;
    EXPECT(dcd_body_set_target(world, guided, &pose), DCD_ERR_ARGUMENT);
    velocity.linear[0] = 1.0f;
    EXPECT(dcd_body_set_velocity(world, guided, &velocity), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_set_target(world, guided, &good.pose), DCD_OK);
    EXPECT(dcd_body_add_force(world, many[0], NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_add_force(world, many[0], BAD, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_add_force(world, many[0], HALF, far_point), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_add_force(world, guided, HALF, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_body_add_force(other, many[0], HALF, NULL), DCD_ERR_STALE_ID);
    EXPECT(dcd_own_avatars(world, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_wake(world, NO_BODY), DCD_ERR_NULL);
    EXPECT(dcd_body_sleep(world, many[0]), DCD_OK);
    EXPECT(dcd_body_wake(world, many[0]), DCD_OK);

    many[2] = many[0];
    EXPECT(dcd_bodies_destroy(world, many, 3), DCD_ERR_STALE_ID); /* one of them twice */
    HOLDS(dcd_body_is_valid(world, many[0]) && dcd_body_is_valid(world, many[1]));
    EXPECT(dcd_bodies_destroy(world, NULL, 2), DCD_ERR_NULL);
    EXPECT(dcd_bodies_destroy(world, many, SIZE_MAX), DCD_ERR_ARGUMENT);
    EXPECT(dcd_bodies_destroy(world, many, 2), DCD_OK);
    FAILS(dcd_body_destroy(world, many[0]), DCD_ERR_STALE_ID, "dcd_body_destroy: ");
    EXPECT(dcd_body_set_pose(world, many[1], &good.pose), DCD_ERR_STALE_ID);
    EXPECT(dcd_step(world), DCD_OK);
    body = make_body(world, box, DCD_DYNAMIC, 0.0); /* ids are not reused */
    HOLDS(body.v != many[0].v && body.v != many[1].v && !dcd_body_is_valid(world, many[0]));
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_body_get(world, body, &read, NULL), DCD_ERR_STALE_ID);
    EXPECT(dcd_world_destroy(other), DCD_OK);
}

static void joints(void)
{
    DcdWorld world = make_world(1), other = make_world(1);
    DcdShapeId box = make_box(world);
    DcdJointDef good = DCD_JOINT_DEF_INIT, def;
    DcdJointId joint = { 5 };
    good.a = make_body(world, box, DCD_FIXED, 0.0);
    good.b = make_body(world, box, DCD_DYNAMIC, 2.0);

    EXPECT(dcd_joint_create(world, NULL, &joint), DCD_ERR_NULL);
    EXPECT(dcd_joint_create(world, &good, NULL), DCD_ERR_NULL);
    EXPECT(dcd_joint_create(other, &good, &joint), DCD_ERR_STALE_ID);
#define UNTIED(member, value, code)                                                                                   \
    def = good;                                                                                                       \
    def.member = value;                                                                                               \
    EXPECT(dcd_joint_create(world, &def, &joint), code)
    UNTIED(struct_size, 0, DCD_ERR_STRUCT);
    UNTIED(joint_type, 9, DCD_ERR_ARGUMENT);
    UNTIED(a, NO_BODY, DCD_ERR_NULL);
    def = good;
    def.b = NO_BODY;
    FAILS(dcd_joint_create(world, &def, &joint), DCD_ERR_NULL, "def->b: ");
    UNTIED(reserved, 1, DCD_ERR_ARGUMENT);
    UNTIED(a, good.b, DCD_ERR_ARGUMENT);
    UNTIED(frame_a.p[0], NAN, DCD_ERR_ARGUMENT);
    UNTIED(frame_b.q[0], 1.0f, DCD_ERR_ARGUMENT);
    UNTIED(flags, 16, DCD_ERR_ARGUMENT);
    UNTIED(flags, DCD_JOINT_LIMIT, DCD_ERR_ARGUMENT); /* a fixed joint has no limit */
    UNTIED(flags, DCD_JOINT_MOTOR, DCD_ERR_ARGUMENT);
    UNTIED(locked, DCD_LOCK_X, DCD_ERR_ARGUMENT); /* its type determines what it locks */
    UNTIED(coupled, DCD_LOCK_X, DCD_ERR_ARGUMENT);
    UNTIED(natural_frequency, 0.0f, DCD_ERR_ARGUMENT);
    UNTIED(natural_frequency, NAN, DCD_ERR_ARGUMENT);
    UNTIED(damping_ratio, -1.0f, DCD_ERR_ARGUMENT);
    UNTIED(joint_type, DCD_JOINT_ROPE, DCD_ERR_ARGUMENT);   /* without a length */
    UNTIED(joint_type, DCD_JOINT_SPRING, DCD_ERR_ARGUMENT); /* without stiffness */
    good.joint_type = DCD_JOINT_ROPE;
    good.flags = DCD_JOINT_LIMIT | DCD_JOINT_MOTOR;
    UNTIED(limit[0], 0.5f, DCD_ERR_ARGUMENT); /* a distance has no lower limit */
    UNTIED(limit[1], -1.0f, DCD_ERR_ARGUMENT);
    UNTIED(limit[1], NAN, DCD_ERR_ARGUMENT);
    UNTIED(limit[1], 1e30f, DCD_ERR_ARGUMENT);
    UNTIED(motor.position, INFINITY, DCD_ERR_ARGUMENT);
    UNTIED(motor.velocity, NAN, DCD_ERR_ARGUMENT);
    UNTIED(motor.stiffness, -1.0f, DCD_ERR_ARGUMENT);
    UNTIED(motor.damping, INFINITY, DCD_ERR_ARGUMENT);
    UNTIED(motor.max_force, INFINITY, DCD_ERR_ARGUMENT);
    UNTIED(motor.max_force, -1.0f, DCD_ERR_ARGUMENT);
    UNTIED(motor.model, 2, DCD_ERR_ARGUMENT);
    good.joint_type = DCD_JOINT_GENERIC;
    UNTIED(flags, DCD_JOINT_LIMIT, DCD_ERR_ARGUMENT); /* for which axis? */
    good.flags = 0;
    UNTIED(locked, 64, DCD_ERR_ARGUMENT);
    UNTIED(coupled, DCD_LOCK_TURN_X, DCD_ERR_ARGUMENT);
    UNTIED(coupled, DCD_LOCK_TURN_X | DCD_LOCK_TURN_Y | DCD_LOCK_TURN_Z, DCD_ERR_ARGUMENT);
    UNTIED(coupled, DCD_LOCK_X, DCD_ERR_ARGUMENT);
    def.locked = DCD_LOCK_X;
    def.coupled = DCD_LOCK_X | DCD_LOCK_Y;
    EXPECT(dcd_joint_create(world, &def, &joint), DCD_ERR_ARGUMENT);
    HOLDS(joint.v == 5);
    /* Of a joint between two fixed bodies nobody would hear again. */
    def = good;
    def.b = make_body(world, box, DCD_FIXED, 9.0);
    FAILS(dcd_joint_create(world, &def, &joint), DCD_ERR_ARGUMENT, "make one of them kinematic");

    /* x and y are locked; the turns about x and y are coupled. */
    DcdJointMotor motor = DCD_JOINT_MOTOR_INIT;
    DcdJointInfo info = DCD_JOINT_INFO_INIT;
    DcdFrame frame = good.frame_a;
    const float range[2] = { -1.0f, 1.0f }, backwards[2] = { 1.0f, -1.0f };
    float limit[2];
    size_t count;
    good.locked = DCD_LOCK_X | DCD_LOCK_Y;
    good.coupled = DCD_LOCK_TURN_X | DCD_LOCK_TURN_Y;
    EXPECT(dcd_joint_create(world, &good, &joint), DCD_OK);
    EXPECT(dcd_joint_set_limit(world, joint, DCD_AXIS_X, range), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_limit(world, joint, 6, range), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_limit(world, joint, DCD_AXIS_Z, backwards), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_limit(world, joint, DCD_AXIS_Z, CROOKED(const float, range)), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_limit(other, joint, DCD_AXIS_Z, range), DCD_ERR_STALE_ID);
    EXPECT(dcd_joint_set_limit(world, NO_JOINT, DCD_AXIS_Z, range), DCD_ERR_NULL);
    EXPECT(dcd_joint_set_limit(world, joint, DCD_AXIS_TURN_Y, range), DCD_OK);
    EXPECT(dcd_joint_get_limit(world, joint, DCD_AXIS_TURN_X, NULL), DCD_ERR_NULL);
    EXPECT(dcd_joint_get_limit(world, joint, DCD_AXIS_Y, limit), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_get_limit(world, joint, DCD_AXIS_TURN_X, limit), DCD_OK);
    HOLDS(limit[0] == -1.0f && limit[1] == 1.0f);
    EXPECT(dcd_joint_set_motor(world, joint, DCD_AXIS_Y, &motor), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_motor(world, joint, DCD_AXIS_TURN_Y, &motor), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_motor(world, joint, UINT32_MAX, &motor), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_motor(world, joint, DCD_AXIS_Z, &motor), DCD_OK);
    EXPECT(dcd_joint_get_motor(world, joint, DCD_AXIS_Z, NULL), DCD_ERR_NULL);
    EXPECT(dcd_joint_get_motor(world, joint, DCD_AXIS_Y, &motor), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_get_motor(world, joint, DCD_AXIS_TURN_Z, &motor), DCD_OK);
    HOLDS(motor.max_force == 0.0f && motor.damping == 0.0f);
    motor.velocity = NAN;
    EXPECT(dcd_joint_set_motor(world, joint, DCD_AXIS_Z, &motor), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_motor(world, NO_JOINT, DCD_AXIS_Z, NULL), DCD_ERR_NULL);
    frame.q[3] = 0.5f;
    EXPECT(dcd_joint_set_frames(world, joint, &frame, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_frames(world, joint, NULL, NULL), DCD_OK);
    EXPECT(dcd_joint_set_flags(world, joint, DCD_JOINT_MOTOR), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_softness(world, joint, -1.0f, 1.0f), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_set_softness(world, joint, 1.0f, NAN), DCD_ERR_ARGUMENT);
    EXPECT(dcd_joint_info(world, joint, NULL), DCD_ERR_NULL);
    info.struct_size = 4;
    EXPECT(dcd_joint_info(world, joint, &info), DCD_ERR_STRUCT);
    EXPECT(dcd_body_joints(world, good.a, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_body_joints(world, good.a, NULL, 1, &count), DCD_ERR_NULL);
    EXPECT(dcd_body_joints(world, good.a, NULL, 0, &count), DCD_OK);
    HOLDS(count == 1);
    EXPECT(dcd_body_joints(other, good.a, &joint, 1, &count), DCD_ERR_STALE_ID);
    HOLDS(dcd_joint_is_valid(world, joint) && !dcd_joint_is_valid(other, joint) && !dcd_joint_is_valid(world, NO_JOINT));
    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_joint_destroy(other, joint), DCD_ERR_STALE_ID);
    EXPECT(dcd_joint_destroy(world, NO_JOINT), DCD_ERR_NULL);
    EXPECT(dcd_joint_destroy(world, joint), DCD_OK);
    EXPECT(dcd_joint_destroy(world, joint), DCD_ERR_STALE_ID);
    EXPECT(dcd_joint_create(world, &good, &joint), DCD_OK);
    EXPECT(dcd_body_destroy(world, good.b), DCD_OK);
    EXPECT(dcd_joint_destroy(world, joint), DCD_ERR_STALE_ID); /* it went with its body */
    EXPECT(dcd_joint_set_motor(world, joint, DCD_AXIS_Z, NULL), DCD_ERR_STALE_ID);
    HOLDS(!dcd_joint_is_valid(world, joint));
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_world_destroy(other), DCD_OK);
}

static void bulk(void)
{
    DcdWorld world = make_world(2);
    DcdShapeId box = make_box(world);
    DcdBodyId ids[3];
    DcdPose poses[3];
    DcdStatus each[3];
    DcdStateView view = DCD_STATE_VIEW_INIT, early = DCD_STATE_VIEW_INIT;
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    DcdRegionInfo regions[2];
    DcdBorderInfo border;
    DcdOwner owner = DCD_OWNER_INIT;
    DcdStats stats = DCD_STATS_INIT;
    size_t count = 0;
    char text[1024], tiny[4] = "abc";
    uint64_t hash = 0;

    EXPECT(dcd_state_view(world, NULL), DCD_ERR_NULL);
    view.struct_size = 1;
    EXPECT(dcd_state_view(world, &view), DCD_ERR_STRUCT);
    view.struct_size = sizeof view;
    EXPECT(dcd_state_view(world, &view), DCD_OK);
    HOLDS(view.count == 0 && view.ids == NULL && view.slots == NULL && view.slot_count == 0);
    for (int i = 0; i < 3; i++) {
        ids[i] = make_body(world, box, DCD_DYNAMIC, 3.0 * i);
    }
    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_state_view(world, &early), DCD_OK);
    HOLDS(early.count == 3 && early.tick == 1);
    HOLDS(early.ids[2].v == ids[2].v);

    /* An old view can be read until the step after next, and never shows freed memory, even if the arrays
     * grow. */
    double height = early.poses[2].p[1];
    EXPECT(dcd_step(world), DCD_OK);
    HOLDS(early.poses[2].p[1] == height && early.slots[2] == 2);
    for (int i = 0; i < 40; i++) {
        make_body(world, box, DCD_DYNAMIC, 10.0 + 3.0 * i);
    }
    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_step(world), DCD_OK);
    HOLDS(isfinite(early.poses[2].p[1]) && early.slots[2] < early.slot_count);
    EXPECT(dcd_state_view(world, &view), DCD_OK);
    HOLDS(view.count == 43 && view.tick == 4);

    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdVelocity velocity;
    EXPECT(dcd_view_time(world, NULL), DCD_ERR_NULL);
    time.struct_size = 8;
    EXPECT(dcd_view_time(world, &time), DCD_ERR_STRUCT);
    EXPECT(dcd_view_state(world, &time, &view), DCD_ERR_STRUCT);
    time.struct_size = sizeof time;
    EXPECT(dcd_view_time(world, &time), DCD_OK);
    HOLDS(time.now == 4.0 && time.shown >= 3.0 && time.shown <= 4.0 && time.clock_error < 0.0);
    EXPECT(dcd_view_body(world, ids[2], time.shown, poses, NULL), DCD_OK);
    EXPECT(dcd_view_body(world, ids[2], time.now, NULL, &velocity), DCD_OK);
    EXPECT(dcd_view_body(world, ids[2], NAN, poses, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_view_body(world, ids[2], 1e300, poses, NULL), DCD_OK);
    HOLDS(isfinite(poses[0].p[1]));
    EXPECT(dcd_view_state(world, &time, NULL), DCD_ERR_NULL);
    EXPECT(dcd_view_state(world, NULL, &view), DCD_ERR_NULL);
    EXPECT(dcd_view_state(world, &time, &early), DCD_OK);
    HOLDS(early.count == 43 && early.poses != view.poses && early.ids[2].v == ids[2].v);
    time.shown = INFINITY;
    EXPECT(dcd_view_state(world, &time, &early), DCD_ERR_ARGUMENT);
    time.shown = -1e300;
    EXPECT(dcd_view_state(world, &time, &early), DCD_OK);
    time.reserved = 1;
    EXPECT(dcd_view_state(world, &time, &early), DCD_ERR_ARGUMENT);

    EXPECT(dcd_state_read(world, NULL, 3, DCD_FIELD_POSE, poses, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_POSE, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_state_read(world, ids, 3, 5, poses, 0, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_TARGET, poses, 0, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_FORCE, poses, 8, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_POSE, poses, 8, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_state_read(world, ids, SIZE_MAX, DCD_FIELD_POSE, poses, 0, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_POSE, poses, SIZE_MAX / 2, NULL), DCD_ERR_ARGUMENT);
    EXPECT(dcd_state_read(world, NULL, 0, DCD_FIELD_POSE, NULL, 0, NULL), DCD_OK);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_POSE, poses, 0, NULL), DCD_OK);
    EXPECT(dcd_state_write(world, ids, 3, DCD_FIELD_POSE, poses, 0, NULL), DCD_OK);
    EXPECT(dcd_state_write(world, ids, 3, DCD_FIELD_TARGET, poses, 0, NULL), DCD_ERR_ARGUMENT);
    poses[0].p[0] = -1.0;
    poses[1].q[3] = NAN;
    EXPECT(dcd_state_write(world, ids, 3, DCD_FIELD_POSE, poses, sizeof poses[0], each), DCD_OK);
    HOLDS(each[0] == DCD_OK && each[1] == DCD_ERR_ARGUMENT && each[2] == DCD_OK);
    ids[1] = NO_BODY;
    poses[0].p[0] = 7.0;
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_POSE, poses, 0, NULL), DCD_ERR_NULL);
    HOLDS(poses[0].p[0] == 7.0); /* nothing is written, not even of good bodies */
    EXPECT(dcd_body_destroy(world, ids[2]), DCD_OK);
    EXPECT(dcd_state_read(world, ids, 3, DCD_FIELD_POSE, poses, 0, each), DCD_OK);
    HOLDS(each[0] == DCD_OK && each[1] == DCD_ERR_NULL && each[2] == DCD_ERR_STALE_ID);
    HOLDS(poses[0].p[0] == -1.0 && isnan(poses[1].q[3])); /* bad bodies leave their elements unchanged */

    EXPECT(dcd_events(world, NULL), DCD_ERR_NULL);
    events.struct_size = 0;
    EXPECT(dcd_events(world, &events), DCD_ERR_STRUCT);
    events.struct_size = sizeof events;
    EXPECT(dcd_events(world, &events), DCD_OK);

    EXPECT(dcd_regions(world, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_regions(world, NULL, 2, &count), DCD_ERR_NULL);
    EXPECT(dcd_regions(world, NULL, 0, &count), DCD_OK);
    HOLDS(count == 2);
    EXPECT(dcd_regions(world, regions, 1, &count), DCD_ERR_SMALL_BUFFER);
    EXPECT(dcd_regions(world, regions, 2, &count), DCD_OK);
    HOLDS(regions[0].max[0] == 0.0 && isinf(regions[0].min[0]));
    EXPECT(dcd_borders(world, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_borders(world, NULL, 1, &count), DCD_ERR_NULL);
    EXPECT(dcd_borders(world, NULL, 0, &count), DCD_OK);
    HOLDS(count == 1);
    EXPECT(dcd_borders(world, &border, 1, &count), DCD_OK);
    const double nowhere[3] = { 0.0, NAN, 0.0 };
    EXPECT(dcd_interest_set(world, NULL, 1.0), DCD_ERR_NULL);
    EXPECT(dcd_interest_set(world, nowhere, 1.0), DCD_ERR_ARGUMENT);
    EXPECT(dcd_interest_set(world, NULL, NAN), DCD_ERR_ARGUMENT);
    EXPECT(dcd_interest_set((DcdWorld){ 0 }, NULL, 0.0), DCD_ERR_NULL);
    EXPECT(dcd_bandwidth_set((DcdWorld){ 0 }, 1000), DCD_ERR_NULL);
    EXPECT(dcd_bandwidth_set(world, 1000), DCD_OK); /* a local world needs no network */
    DcdPrediction prediction = DCD_PREDICTION_INIT;
    EXPECT(dcd_prediction_set((DcdWorld){ 0 }, true), DCD_ERR_NULL);
    EXPECT(dcd_prediction_set(world, true), DCD_OK); /* and has nothing to predict */
    EXPECT(dcd_prediction(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_prediction(world, &prediction), DCD_OK);
    HOLDS(prediction.bodies == 0 && prediction.ticks == 0);
    prediction.struct_size = 4;
    EXPECT(dcd_prediction(world, &prediction), DCD_ERR_STRUCT);
    EXPECT(dcd_interest_set(world, NULL, 0.0), DCD_OK); /* a local world shows everything */
    EXPECT(dcd_body_owner(world, NO_BODY, &owner), DCD_ERR_NULL);
    EXPECT(dcd_body_owner(world, ids[2], &owner), DCD_ERR_STALE_ID);
    EXPECT(dcd_body_owner(world, ids[0], NULL), DCD_ERR_NULL);
    owner.struct_size = 4;
    EXPECT(dcd_body_owner(world, ids[0], &owner), DCD_ERR_STRUCT);
    EXPECT(dcd_stats(world, NULL), DCD_ERR_NULL);
    stats.struct_size = 0;
    EXPECT(dcd_stats(world, &stats), DCD_ERR_STRUCT);
    stats.struct_size = sizeof stats;
    EXPECT(dcd_stats(world, &stats), DCD_OK);
    HOLDS(stats.ticks == 4 && stats.bodies == 42 && stats.regions == 2);
    EXPECT(dcd_stats_text(world, tiny, sizeof tiny, &count), DCD_ERR_SMALL_BUFFER);
    HOLDS(strcmp(tiny, "abc") == 0);
    EXPECT(dcd_stats_text(world, text, count, &count), DCD_OK);
    HOLDS(strlen(text) + 1 == count);
    EXPECT(dcd_validate(world, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_validate(world, NULL, 4, &count), DCD_ERR_NULL);
    EXPECT(dcd_validate(world, text, sizeof text, &count), DCD_OK);
    HOLDS(count == 1 && text[0] == 0);
    EXPECT(dcd_state_hash(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_state_hash(world, &hash), DCD_OK);
    EXPECT(dcd_world_destroy(world), DCD_OK);
}

/* Submitted rays: their ids, the limit of open ones, and when they are closed. */
static void submitted(void)
{
    DcdWorld world = make_world(2), other = make_world(1);
    DcdBodyId body = make_body(world, make_box(world), DCD_FIXED, 0.0);
    DcdRay ray = { { 0.0, 5.0, 0.0 }, { 0.0f, -1.0f, 0.0f }, 100.0f, { 0 }, 0xFFFFFFFFu, 0 }, rays[2];
    DcdRayHit hits[2];
    DcdQueryId query = { 7 }, many[DCD_MAX_OPEN_QUERIES];
    DcdFilter filter = DCD_FILTER_INIT;
    size_t count = 9;
    rays[0] = rays[1] = ray;
    rays[1].direction[1] = 1.0f;
    EXPECT(dcd_cast_rays_submit(world, NULL, 1, NULL, &query), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays_submit(world, rays, 2, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays_submit((DcdWorld){ 0 }, rays, 2, NULL, &query), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays_submit(world, rays, SIZE_MAX, NULL, &query), DCD_ERR_ARGUMENT);
    filter.struct_size = 1;
    EXPECT(dcd_cast_rays_submit(world, rays, 2, &filter, &query), DCD_ERR_STRUCT);
    ray.origin[0] = NAN;
    EXPECT(dcd_cast_rays_submit(world, &ray, 1, NULL, &query), DCD_ERR_ARGUMENT);
    HOLDS(query.v == 7);
    static DcdRay crowd[DCD_MAX_SUBMITTED_COST + 1];
    for (size_t i = 0; i <= DCD_MAX_SUBMITTED_COST; i++)
        crowd[i] = rays[0];
    EXPECT(dcd_cast_rays_submit(world, crowd, DCD_MAX_SUBMITTED_COST + 1, NULL, &query), DCD_ERR_ARGUMENT);
    EXPECT(dcd_cast_rays_submit(world, crowd, DCD_MAX_SUBMITTED_COST, NULL, &query), DCD_OK);
    EXPECT(dcd_query_cancel(world, query), DCD_OK);
    EXPECT(dcd_query_cancel(world, query), DCD_ERR_STALE_ID);

    EXPECT(dcd_cast_rays_submit(world, rays, 2, NULL, &query), DCD_OK);
    EXPECT(dcd_query_poll(other, query, hits, 2, &count), DCD_ERR_STALE_ID);
    EXPECT(dcd_query_poll(world, (DcdQueryId){ 0 }, hits, 2, &count), DCD_ERR_NULL);
    EXPECT(dcd_query_poll(world, (DcdQueryId){ 12345 }, hits, 2, &count), DCD_ERR_STALE_ID);
    EXPECT(dcd_query_poll(world, query, hits, 2, NULL), DCD_ERR_NULL);
    EXPECT(dcd_query_poll(world, query, NULL, 2, &count), DCD_ERR_NULL);
    HOLDS(count == 9);
    EXPECT(dcd_query_poll(world, query, hits, 1, &count), DCD_ERR_SMALL_BUFFER);
    HOLDS(count == 2);
    EXPECT(dcd_query_poll(world, query, NULL, 0, &count), DCD_OK); /* returns the number and leaves the query open */
    HOLDS(count == 2);
    EXPECT(dcd_query_poll(world, query, hits, 2, &count), DCD_OK);
    HOLDS(count == 2 && hits[0].body.v == body.v && hits[0].distance > 0.0f && hits[1].body.v == 0);
    EXPECT(dcd_query_poll(world, query, hits, 2, &count), DCD_ERR_STALE_ID);
    EXPECT(dcd_query_cancel(world, query), DCD_ERR_STALE_ID);

    for (size_t i = 0; i < DCD_MAX_OPEN_COST / DCD_MAX_SUBMITTED_COST; i++)
        EXPECT(dcd_cast_rays_submit(world, crowd, DCD_MAX_SUBMITTED_COST, NULL, &many[i]), DCD_OK);
    EXPECT(dcd_cast_rays_submit(world, rays, 1, NULL, &query), DCD_ERR_BUSY);
    for (size_t i = 0; i < DCD_MAX_OPEN_COST / DCD_MAX_SUBMITTED_COST; i++)
        EXPECT(dcd_query_cancel(world, many[i]), DCD_OK);
    for (size_t i = 0; i < DCD_MAX_OPEN_QUERIES; i++)
        EXPECT(dcd_cast_rays_submit(world, rays, 1, NULL, &many[i]), DCD_OK);
    EXPECT(dcd_cast_rays_submit(world, rays, 1, NULL, &query), DCD_ERR_BUSY);
    EXPECT(dcd_query_cancel(world, many[3]), DCD_OK);
    EXPECT(dcd_cast_rays_submit(world, rays, 0, NULL, &query), DCD_OK);
    EXPECT(dcd_query_poll(world, query, NULL, 0, &count), DCD_OK);
    HOLDS(count == 0);
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_world_destroy(other), DCD_OK);
    EXPECT(dcd_query_poll(world, many[0], hits, 2, &count), DCD_ERR_STALE_ID);
}

/* Submitted casts and overlaps: null pointers, no world, too many, NaN. */
static void submitted_shapes(void)
{
    DcdWorld world = make_world(2), none = { 0 };
    DcdShapeId box = make_box(world);
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    DcdShapeQuery shape = DCD_SHAPE_QUERY_INIT;
    DcdPointQuery point = DCD_POINT_QUERY_INIT;
    DcdBoxQuery around = DCD_BOX_QUERY_INIT;
    DcdShapeHit hit;
    DcdOverlap found;
    DcdQueryId query = { 7 };
    size_t count = 9, end;
    cast.shape = shape.shape = box;
    EXPECT(dcd_cast_shapes_submit(world, NULL, 1, NULL, &query), DCD_ERR_NULL);
    EXPECT(dcd_cast_shapes_submit(world, &cast, 1, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_cast_shapes_submit(none, &cast, 1, NULL, &query), DCD_ERR_NULL);
    EXPECT(dcd_cast_shapes_submit(world, &cast, SIZE_MAX, NULL, &query), DCD_ERR_ARGUMENT);
    EXPECT(dcd_overlap_shapes_submit(world, NULL, 1, NULL, &query), DCD_ERR_NULL);
    EXPECT(dcd_overlap_points_submit(world, &point, 1, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_overlap_boxes_submit(none, &around, 1, NULL, &query), DCD_ERR_NULL);
    EXPECT(dcd_overlap_points_submit(world, &point, SIZE_MAX, NULL, &query), DCD_ERR_ARGUMENT);
    EXPECT(dcd_overlap_points_submit(world, &point, DCD_MAX_SUBMITTED_COST + 1, NULL, &query), DCD_ERR_ARGUMENT);
    cast.motion[1] = NAN;
    shape.pose.q[3] = 2.0f;
    point.point[0] = INFINITY;
    around.min[2] = NAN;
    EXPECT(dcd_cast_shapes_submit(world, &cast, 1, NULL, &query), DCD_ERR_ARGUMENT);
    EXPECT(dcd_overlap_shapes_submit(world, &shape, 1, NULL, &query), DCD_ERR_ARGUMENT);
    EXPECT(dcd_overlap_points_submit(world, &point, 1, NULL, &query), DCD_ERR_ARGUMENT);
    EXPECT(dcd_overlap_boxes_submit(world, &around, 1, NULL, &query), DCD_ERR_ARGUMENT);
    cast.motion[1] = 1.0f;
    cast.turn[0] = NAN;
    EXPECT(dcd_cast_shapes_submit(world, &cast, 1, NULL, &query), DCD_ERR_ARGUMENT);
    cast.turn[0] = 0.0f;
    EXPECT(dcd_shape_destroy(world, box), DCD_OK);
    EXPECT(dcd_cast_shapes_submit(world, &cast, 1, NULL, &query), DCD_ERR_STALE_ID);
    HOLDS(query.v == 7);

    /* A submitted query keeps its shape. */
    cast.shape = shape.shape = make_box(world);
    shape.pose.q[3] = 1.0f;
    EXPECT(dcd_cast_shapes_submit(world, &cast, 1, NULL, &query), DCD_OK);
    EXPECT(dcd_shape_destroy(world, cast.shape), DCD_OK);
    EXPECT(dcd_query_poll_casts(none, query, &hit, 1, &count), DCD_ERR_NULL);
    EXPECT(dcd_query_poll_casts(world, query, NULL, 1, &count), DCD_ERR_NULL);
    EXPECT(dcd_query_poll_casts(world, query, &hit, 1, NULL), DCD_ERR_NULL);
    EXPECT(dcd_query_poll_casts(world, query, &hit, 1, &count), DCD_OK);
    HOLDS(count == 1 && hit.body.v == 0);
    EXPECT(dcd_overlap_boxes_submit(world, &around, 0, NULL, &query), DCD_OK);
    EXPECT(dcd_query_poll_overlaps(world, query, NULL, 1, &end, &count), DCD_ERR_NULL);
    EXPECT(dcd_query_poll_overlaps(world, query, &found, 1, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_query_poll_overlaps(world, query, &found, 1, NULL, &count), DCD_OK);
    HOLDS(count == 0);
    EXPECT(dcd_world_destroy(world), DCD_OK);
}

/* The status of a call on the world from within a query's function. */
static DcdStatus meddled;

static float meddling_hit(void *context, const DcdRayHit *hit)
{
    (void)hit;
    meddled = dcd_step(*(DcdWorld *)context);
    return NAN; /* NaN ends the query */
}

static float meddling_cast(void *context, const DcdShapeHit *hit)
{
    (void)hit;
    meddled = dcd_step(*(DcdWorld *)context);
    return NAN;
}

static bool meddling_overlap(void *context, const DcdOverlap *found)
{
    (void)found;
    meddled = dcd_step(*(DcdWorld *)context);
    return false;
}

static void *no_memory(void *context, size_t size, size_t alignment)
{
    (void)context, (void)size, (void)alignment;
    return NULL;
}

static void keep_memory(void *context, void *block, size_t size, size_t alignment)
{
    (void)context, (void)block, (void)size, (void)alignment;
}

/* The library of these tests is built without the feature `allocator`. */
static void an_allocator(void)
{
    FAILS(dcd_allocator_set(no_memory, keep_memory, NULL), DCD_ERR_UNSUPPORTED, "--features allocator");
    FAILS(dcd_allocator_set(NULL, keep_memory, NULL), DCD_ERR_NULL, "allocate");
    FAILS(dcd_allocator_set(no_memory, NULL, NULL), DCD_ERR_NULL, "free");
}

static void queries(void)
{
    DcdWorld world = make_world(2);
    DcdBodyId body = make_body(world, make_box(world), DCD_FIXED, 0.0);
    DcdRay good = { { 0.0, 5.0, 0.0 }, { 0.0f, -2.0f, 0.0f }, 100.0f, { 0 }, 0xFFFFFFFFu, 0 }, ray;
    DcdRayHit hit, nothing = { { 0 }, 0, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 0.0f, 0, 0, 0 };

    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_cast_rays(world, NULL, 1, NULL, &hit), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays(world, &good, 1, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays(world, &good, SIZE_MAX, NULL, &hit), DCD_ERR_ARGUMENT);
    EXPECT(dcd_cast_rays(world, NULL, 0, NULL, NULL), DCD_OK);
#define BLIND(member, value, code)                                                                                    \
    ray = good;                                                                                                       \
    ray.member = value;                                                                                               \
    EXPECT(dcd_cast_rays(world, &ray, 1, NULL, &hit), code)
    BLIND(origin[0], (double)NAN, DCD_ERR_ARGUMENT);
    BLIND(direction[1], 0.0f, DCD_ERR_ARGUMENT);
    BLIND(direction[0], INFINITY, DCD_ERR_ARGUMENT);
    BLIND(max_distance, 0.0f, DCD_ERR_ARGUMENT);
    BLIND(max_distance, NAN, DCD_ERR_ARGUMENT);
    BLIND(exclude, (DcdBodyId){ 77 }, DCD_ERR_STALE_ID);
    EXPECT(dcd_cast_rays(world, &good, 1, NULL, &hit), DCD_OK);
    HOLDS(hit.body.v == body.v && fabsf(hit.distance - 4.5f) < 1e-4f && hit.normal[1] > 0.99f);
    BLIND(max_distance, INFINITY, DCD_OK);
    HOLDS(hit.body.v == body.v);
    BLIND(exclude, body, DCD_OK);
    HOLDS(memcmp(&hit, &nothing, sizeof hit) == 0);
    BLIND(mask, 0, DCD_OK);
    HOLDS(hit.body.v == 0);
    BLIND(flags, DCD_QUERY_LEAVE, DCD_ERR_ARGUMENT);

    DcdFilter filter = DCD_FILTER_INIT;
    const DcdBodyId stale[2] = { body, { 77 } };
    filter.struct_size = 0;
    EXPECT(dcd_cast_rays(world, &good, 1, &filter, &hit), DCD_ERR_STRUCT);
    filter.struct_size = sizeof filter;
    filter.flags = 32;
    EXPECT(dcd_cast_rays(world, &good, 1, &filter, &hit), DCD_ERR_ARGUMENT);
    filter.flags = 0;
    filter.exclude_count = 2;
    EXPECT(dcd_cast_rays(world, &good, 1, &filter, &hit), DCD_ERR_NULL);
    filter.exclude = stale;
    EXPECT(dcd_cast_rays(world, &good, 1, &filter, &hit), DCD_ERR_STALE_ID);
    filter.exclude_count = SIZE_MAX;
    EXPECT(dcd_cast_rays(world, &good, 1, &filter, &hit), DCD_ERR_ARGUMENT);
    filter.exclude_count = 1;
    EXPECT(dcd_cast_rays(world, &good, 1, &filter, &hit), DCD_OK);
    HOLDS(hit.body.v == 0);

    EXPECT(dcd_cast_ray_each(world, &good, NULL, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_cast_ray_each(world, NULL, NULL, meddling_hit, &world), DCD_ERR_NULL);
    meddled = DCD_OK;
    EXPECT(dcd_cast_ray_each(world, &good, NULL, meddling_hit, &world), DCD_OK);
    HOLDS(meddled == DCD_ERR_BUSY);
    DcdShapeCast moved = DCD_SHAPE_CAST_INIT;
    EXPECT(dcd_cast_shape_each(world, &moved, NULL, meddling_cast, &world), DCD_ERR_NULL); /* no shape */
    EXPECT(dcd_shape_sphere(world, 0.25f, &moved.shape), DCD_OK);
    memcpy(moved.pose.p, good.origin, sizeof moved.pose.p);
    for (int i = 0; i < 3; i++) {
        moved.motion[i] = 100.0f * good.direction[i];
    }
    EXPECT(dcd_cast_shape_each(world, &moved, NULL, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_cast_shape_each(world, NULL, NULL, meddling_cast, &world), DCD_ERR_NULL);
    moved.turn[1] = 1.0f;
    FAILS(dcd_cast_shape_each(world, &moved, NULL, meddling_cast, &world), DCD_ERR_ARGUMENT, "turn");
    moved.turn[1] = 0.0f;
    meddled = DCD_OK;
    EXPECT(dcd_cast_shape_each(world, &moved, NULL, meddling_cast, &world), DCD_OK);
    HOLDS(meddled == DCD_ERR_BUSY);
    DcdBoxQuery everywhere = DCD_BOX_QUERY_INIT, inside_out = DCD_BOX_QUERY_INIT;
    for (int i = 0; i < 3; i++) {
        everywhere.min[i] = -1e3;
        everywhere.max[i] = 1e3;
        inside_out.min[i] = 1.0;
        inside_out.max[i] = 0.0;
    }
    EXPECT(dcd_overlap_box_each(world, &everywhere, NULL, NULL, NULL), DCD_ERR_NULL);
    EXPECT(dcd_overlap_box_each(world, &inside_out, NULL, meddling_overlap, &world), DCD_ERR_ARGUMENT);
    meddled = DCD_OK;
    EXPECT(dcd_overlap_box_each(world, &everywhere, NULL, meddling_overlap, &world), DCD_OK);
    HOLDS(meddled == DCD_ERR_BUSY);
    DcdShapeQuery nowhere = DCD_SHAPE_QUERY_INIT;
    EXPECT(dcd_overlap_shape_each(world, &nowhere, NULL, meddling_overlap, &world), DCD_ERR_NULL);

    size_t ends = 9, total = 9;
    EXPECT(dcd_cast_rays_all(world, &good, 1, NULL, &hit, 1, NULL, &total), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays_all(world, &good, 1, NULL, NULL, 1, &ends, &total), DCD_ERR_NULL);
    EXPECT(dcd_cast_rays_all(world, &good, 1, NULL, &hit, 1, &ends, NULL), DCD_ERR_NULL);
    HOLDS(ends == 9 && total == 9);
    EXPECT(dcd_cast_rays_all(world, &good, 1, NULL, NULL, 0, &ends, &total), DCD_OK);
    HOLDS(ends == 9 && total == 1);
    EXPECT(dcd_cast_rays_all(world, NULL, 0, NULL, NULL, 0, NULL, &total), DCD_OK);
    HOLDS(total == 0);

    DcdShapeId box = make_box(world), mesh;
    const float corners[9] = { 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    const uint32_t triangle[3] = { 0, 1, 2 };
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT, fair;
    DcdShapeHit met;
    EXPECT(dcd_shape_mesh(world, corners, 3, triangle, 1, false, &mesh), DCD_OK);
    fair = cast;
    fair.shape = box;
#define STUCK(member, value, code)                                                                                    \
    cast = fair;                                                                                                      \
    cast.member = value;                                                                                              \
    EXPECT(dcd_cast_shapes(world, &cast, 1, NULL, &met), code)
    STUCK(shape, NO_SHAPE, DCD_ERR_NULL);
    STUCK(shape.v, 12345, DCD_ERR_STALE_ID);
    STUCK(shape, mesh, DCD_ERR_ARGUMENT);
    STUCK(pose.p[0], (double)NAN, DCD_ERR_ARGUMENT);
    STUCK(pose.q[3], 0.0f, DCD_ERR_ARGUMENT);
    STUCK(motion[0], INFINITY, DCD_ERR_ARGUMENT);
    STUCK(turn[0], NAN, DCD_ERR_ARGUMENT);
    STUCK(margin, -1.0f, DCD_ERR_ARGUMENT);
    STUCK(flags, DCD_QUERY_HOLLOW, DCD_ERR_ARGUMENT);
    STUCK(exclude, stale[1], DCD_ERR_STALE_ID);
    STUCK(turn[0], 1.0f, DCD_OK);
    cast.margin = 1.0f;
    EXPECT(dcd_cast_shapes(world, &cast, 1, NULL, &met), DCD_ERR_ARGUMENT);
    EXPECT(dcd_cast_shapes(world, &fair, 1, NULL, NULL), DCD_ERR_NULL);

    DcdPointQuery point = DCD_POINT_QUERY_INIT;
    DcdPointHit place;
    DcdOverlap found[2];
    EXPECT(dcd_project_points(world, &point, 1, NULL, NULL), DCD_ERR_NULL);
    point.max_distance = -1.0f;
    EXPECT(dcd_project_points(world, &point, 1, NULL, &place), DCD_ERR_ARGUMENT);
    point.max_distance = NAN;
    EXPECT(dcd_project_points(world, &point, 1, NULL, &place), DCD_ERR_ARGUMENT);
    point.max_distance = INFINITY;
    EXPECT(dcd_project_points(world, &point, 1, NULL, &place), DCD_OK);
    point.flags = DCD_QUERY_HOLLOW;
    EXPECT(dcd_overlap_points(world, &point, 1, NULL, found, 2, &ends, &total), DCD_ERR_ARGUMENT);
    point.flags = 4;
    EXPECT(dcd_project_points(world, &point, 1, NULL, &place), DCD_ERR_ARGUMENT);
    point.flags = 0;
    point.point[1] = (double)INFINITY;
    EXPECT(dcd_overlap_points(world, &point, 1, NULL, found, 2, &ends, &total), DCD_ERR_ARGUMENT);
    DcdShapeQuery blast = DCD_SHAPE_QUERY_INIT;
    EXPECT(dcd_overlap_shapes(world, &blast, 1, NULL, found, 2, &ends, &total), DCD_ERR_NULL);
    blast.shape = mesh;
    EXPECT(dcd_overlap_shapes(world, &blast, 1, NULL, found, 2, &ends, &total), DCD_ERR_ARGUMENT);
    DcdBoxQuery area = DCD_BOX_QUERY_INIT;
    area.min[2] = 1.0;
    EXPECT(dcd_overlap_boxes(world, &area, 1, NULL, found, 2, &ends, &total), DCD_ERR_ARGUMENT);
    area.min[2] = (double)NAN;
    EXPECT(dcd_overlap_boxes(world, &area, 1, NULL, found, 2, &ends, &total), DCD_ERR_ARGUMENT);
    EXPECT(dcd_world_destroy(world), DCD_OK);
}

/* Calls about other processes, of which a local world has none. */
static void network(void)
{
    const DcdConnectionId none = { 0 }, stranger = { 12345 };
    DcdWorld world = make_world(1);
    DcdConnectionInfo info = DCD_CONNECTION_INFO_INIT;
    DcdConnectionId found[1];
    size_t count = 7;
    EXPECT(dcd_connections(NO_WORLD, found, 1, &count), DCD_ERR_NULL);
    EXPECT(dcd_connections(world, found, 1, NULL), DCD_ERR_NULL);
    EXPECT(dcd_connections(world, NULL, 1, &count), DCD_ERR_NULL);
    HOLDS(count == 7);
    EXPECT(dcd_connections(world, found, 1, &count), DCD_OK);
    HOLDS(count == 0);
    EXPECT(dcd_connection_info(world, stranger, NULL), DCD_ERR_NULL);
    EXPECT(dcd_connection_info(world, none, &info), DCD_ERR_NULL);
    EXPECT(dcd_connection_info(world, stranger, &info), DCD_ERR_STALE_ID);
    info.struct_size++;
    EXPECT(dcd_connection_info(world, stranger, &info), DCD_ERR_STRUCT);
    EXPECT(dcd_disconnect(NO_WORLD, stranger, NULL), DCD_ERR_NULL);
    EXPECT(dcd_disconnect(world, stranger, "\xff"), DCD_ERR_ARGUMENT);
    EXPECT(dcd_disconnect(world, stranger, "go"), DCD_ERR_UNSUPPORTED);
    EXPECT(dcd_send(world, stranger, NULL, 1, 0), DCD_ERR_NULL);
    EXPECT(dcd_send(world, stranger, found, sizeof found, 8), DCD_ERR_ARGUMENT);
    EXPECT(dcd_send(world, stranger, found, SIZE_MAX, DCD_SEND_UNRELIABLE), DCD_ERR_ARGUMENT);
    EXPECT(dcd_send(world, stranger, found, sizeof found, 0), DCD_ERR_UNSUPPORTED);
    EXPECT(dcd_poll(NO_WORLD, 0), DCD_ERR_NULL);
    EXPECT(dcd_poll(world, UINT32_MAX), DCD_OK);
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_poll(world, UINT32_MAX), DCD_ERR_STALE_ID);
    EXPECT(dcd_send(world, stranger, found, sizeof found, 0), DCD_ERR_STALE_ID);
}

static void checkpoints(void)
{
    const DcdCheckpointId none = { 0 };
    DcdCheckpointId one = none, other = none;
    DcdWorld world = make_world(2), stranger = make_world(1);
    EXPECT(dcd_checkpoint_create(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_create(NO_WORLD, &one), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_create(world, &one), DCD_OK);
    EXPECT(dcd_checkpoint_create(stranger, &other), DCD_OK);
    EXPECT(dcd_checkpoint_save(world, none), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_save(world, other), DCD_ERR_STALE_ID);
    EXPECT(dcd_checkpoint_save(NO_WORLD, one), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_restore(world, none), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_restore(world, other), DCD_ERR_STALE_ID);
    EXPECT(dcd_checkpoint_restore(NO_WORLD, one), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_destroy(world, none), DCD_ERR_NULL);
    EXPECT(dcd_checkpoint_destroy(world, other), DCD_ERR_STALE_ID);
    EXPECT(dcd_checkpoint_destroy(NO_WORLD, one), DCD_ERR_NULL);
    /* A body made after the checkpoint is gone, and its id is reused. */
    DcdShapeId shape = make_box(world);
    DcdBodyId late = make_body(world, shape, DCD_DYNAMIC, 5.0);
    EXPECT(dcd_checkpoint_restore(world, one), DCD_OK);
    EXPECT(dcd_body_destroy(world, late), DCD_ERR_STALE_ID);
    HOLDS(make_body(world, shape, DCD_DYNAMIC, 5.0).v == late.v);
    EXPECT(dcd_checkpoint_destroy(world, one), DCD_OK);
    EXPECT(dcd_checkpoint_destroy(world, one), DCD_ERR_STALE_ID);
    EXPECT(dcd_checkpoint_restore(world, one), DCD_ERR_STALE_ID);
    EXPECT(dcd_world_destroy(stranger), DCD_OK);
    EXPECT(dcd_checkpoint_restore(stranger, other), DCD_ERR_STALE_ID);
    EXPECT(dcd_world_destroy(world), DCD_OK);
}

static void snapshots(void)
{
    DcdWorld world = make_world(2);
    size_t size = 0;
    char small[8] = "as it is";
    const char junk[64] = "not a snapshot at all, but some text";
    EXPECT(dcd_snapshot_save(world, NULL, 0, NULL), DCD_ERR_NULL);
    EXPECT(dcd_snapshot_save(world, NULL, 8, &size), DCD_ERR_NULL);
    EXPECT(dcd_snapshot_save(world, small, sizeof small, &size), DCD_ERR_SMALL_BUFFER);
    HOLDS(memcmp(small, "as it is", 8) == 0 && size > 8);
    EXPECT(dcd_snapshot_load(world, NULL, 8), DCD_ERR_NULL);
    EXPECT(dcd_snapshot_load(world, junk, 0), DCD_ERR_ARGUMENT);
    EXPECT(dcd_snapshot_load(world, junk, sizeof junk), DCD_ERR_ARGUMENT);
    EXPECT(dcd_snapshot_load(world, junk, SIZE_MAX), DCD_ERR_ARGUMENT);
    EXPECT(dcd_snapshot_load(NO_WORLD, junk, sizeof junk), DCD_ERR_NULL);
    EXPECT(dcd_snapshot_load_file(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_snapshot_load_file(world, "no/such/file.dcd"), DCD_ERR_IO);
    EXPECT(dcd_record(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_record(world, "no/such/folder/file.dcdr"), DCD_ERR_IO);
    EXPECT(dcd_record_keep(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_record_keep(world, "file.dcdr"), DCD_ERR_ARGUMENT);
    EXPECT(dcd_record_last(world, 0.0f), DCD_ERR_ARGUMENT);
    EXPECT(dcd_record_last(world, NAN), DCD_ERR_ARGUMENT);
    EXPECT(dcd_record_last(world, 1.0f), DCD_OK);
    EXPECT(dcd_record_keep(world, "no/such/folder/file.dcdr"), DCD_ERR_IO);
    EXPECT(dcd_record_stop(world), DCD_OK);
    EXPECT(dcd_snapshot_save_file(world, NULL), DCD_ERR_NULL);
    EXPECT(dcd_snapshot_save_file(world, "no/such/folder/file.dcd"), DCD_ERR_IO);
    char *saved = malloc(size);
    EXPECT(dcd_snapshot_save(world, saved, size, &size), DCD_OK);
    EXPECT(dcd_snapshot_load(world, saved, size - 1), DCD_ERR_ARGUMENT);
    EXPECT(dcd_snapshot_load(world, saved, size), DCD_OK);
    free(saved);
    EXPECT(dcd_step(world), DCD_OK);
    EXPECT(dcd_step_wait(world, 0), DCD_ERR_ARGUMENT);
    EXPECT(dcd_step_wait(NO_WORLD, 0), DCD_ERR_NULL);
    EXPECT(dcd_step_begin(NO_WORLD), DCD_ERR_NULL);
    EXPECT(dcd_world_destroy(world), DCD_OK);
    EXPECT(dcd_step_begin(world), DCD_ERR_STALE_ID);
    EXPECT(dcd_step_wait(world, 0), DCD_ERR_STALE_ID);
    EXPECT(dcd_record_stop(world), DCD_ERR_STALE_ID);
}

static DcdWorld logged_world;
static DcdStatus logged_status;
static int logged_lines;

static void on_log(void *user, DcdLogLevel level, const char *message, size_t length)
{
    int *count = user;
    if (level <= DCD_LOG_DEBUG && message != NULL && length > 0) {
        ++*count;
    }
    logged_status = dcd_step(logged_world);
    EXPECT(dcd_bug_set(NULL, NULL), DCD_ERR_BUSY);
}

static void logging(void)
{
    logged_world = make_world(1);
    EXPECT(dcd_log_set(on_log, &logged_lines, DCD_LOG_DEBUG), DCD_OK);
    EXPECT(dcd_step(NO_WORLD), DCD_ERR_NULL); /* a failed call is logged */
    HOLDS(logged_lines == 1);
    HOLDS(logged_status == DCD_ERR_BUSY);
    EXPECT(dcd_log_set(NULL, NULL, DCD_LOG_TRACE), DCD_OK);
    EXPECT(dcd_step(NO_WORLD), DCD_ERR_NULL);
    HOLDS(logged_lines == 1);
    EXPECT(dcd_world_destroy(logged_world), DCD_OK);
}

/* Some threads step, one makes and destroys bodies, one reads, and finally the world is destroyed under all
 * of them. The threads return statuses instead of using EXPECT, since `checks` belongs to the main thread. */
static DcdWorld shared;
static DcdShapeId shared_box;

static void *step_it(void *unused)
{
    (void)unused;
    DcdStatus status = DCD_OK;
    while (status == DCD_OK) {
        status = dcd_step(shared);
    }
    return status == DCD_ERR_STALE_ID ? NULL : &shared;
}

/* Two of these threads alternate: neither can wait for the other's step. */
static void *begin_it(void *unused)
{
    (void)unused;
    DcdStatus status = DCD_OK;
    while (status == DCD_OK || status == DCD_ERR_BUSY || status == DCD_ERR_ARGUMENT) {
        status = dcd_step_begin(shared);
        if (status == DCD_OK) {
            status = dcd_step_wait(shared, DCD_FOREVER);
        }
    }
    return status == DCD_ERR_STALE_ID ? NULL : &shared;
}

static void *change_it(void *unused)
{
    (void)unused;
    DcdStatus status = DCD_OK;
    while (status == DCD_OK) {
        DcdBodyDef def = DCD_BODY_DEF_INIT;
        DcdBodyId body;
        def.shape = shared_box;
        status = dcd_body_create(shared, &def, &body);
        if (status == DCD_OK) {
            status = dcd_body_destroy(shared, body);
        }
    }
    return status == DCD_ERR_STALE_ID ? NULL : &shared;
}

static void *read_it(void *unused)
{
    (void)unused;
    DcdStatus status = DCD_OK;
    while (status == DCD_OK) {
        uint64_t hash;
        DcdStats stats = DCD_STATS_INIT;
        status = dcd_state_hash(shared, &hash);
        if (status == DCD_OK) {
            status = dcd_stats(shared, &stats);
        }
    }
    return status == DCD_ERR_STALE_ID ? NULL : &shared;
}

static void threads(void)
{
    void *(*work[])(void *) = { step_it, step_it, change_it, read_it, begin_it, begin_it };
    enum { THREADS = sizeof work / sizeof work[0] };
    pthread_t running[THREADS];
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    shared = make_world(2);
    shared_box = make_box(shared);
    make_body(shared, shared_box, DCD_DYNAMIC, 0.0);
    for (int i = 0; i < THREADS; i++) {
        HOLDS(pthread_create(&running[i], NULL, work[i], NULL) == 0);
    }
    while (info.tick < 50) {
        EXPECT(dcd_world_info(shared, &info), DCD_OK);
    }
    EXPECT(dcd_world_destroy(shared), DCD_OK);
    for (int i = 0; i < THREADS; i++) {
        void *wrong = &shared;
        HOLDS(pthread_join(running[i], &wrong) == 0);
        HOLDS(wrong == NULL);
    }
}

int main(void)
{
    library();
    worlds();
    scenes();
    shapes();
    bodies();
    mass_stays();
    joints();
    bulk();
    queries();
    an_allocator();
    submitted();
    submitted_shapes();
    network();
    snapshots();
    checkpoints();
    logging();
    threads();
    return checked();
}
