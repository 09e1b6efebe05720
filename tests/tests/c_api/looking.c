/* What bodies look like: all bodies are listed, shapes are read back as they were made, and the sizes and
 * masses of bodies follow from them. */
#include "checks.h"

#include <math.h>

static const DcdFrame HERE = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } };

static bool near(double a, double b, double within)
{
    return fabs(a - b) <= within;
}

static DcdShapeInfo info_of(DcdWorld world, DcdShapeId shape)
{
    DcdShapeInfo info = DCD_SHAPE_INFO_INIT;
    OK(dcd_shape_info(world, shape, &info));
    return info;
}

/* Each shape is read back as it was made. */
static void shapes(DcdWorld world)
{
    const float half[3] = { 1.0f, 2.0f, 3.0f };
    const float corners[15] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.1f, 0.1f, 0.1f };
    const uint32_t faces[6] = { 0, 2, 1, 0, 1, 3 };
    const float heights[6] = { 0, 1, 2, 3, 4, 5 }, scale[3] = { 10.0f, 2.0f, 20.0f };
    float xyz[12 * 3] = { 0 }, read[6] = { 0 };
    uint32_t indices[12 * 3] = { 0 };
    size_t count = 0;
    DcdShapeId shape, part, again;
    DcdFrame frame = HERE;

    OK(dcd_shape_box(world, half, &shape));
    DcdShapeInfo info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_BOX && memcmp(info.size, half, sizeof half) == 0 && info.border == 0.0f);
    HOLDS(info.vertex_count == 0 && info.parts == 0 && memcmp(&info.frame, &HERE, sizeof HERE) == 0);
    OK(dcd_shape_vertices(world, shape, NULL, 0, &count));
    HOLDS(count == 0);
    OK(dcd_shape_sphere(world, 0.75f, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_SPHERE && info.size[0] == 0.75f);
    OK(dcd_shape_capsule(world, 0.5f, 0.25f, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_CAPSULE && info.size[0] == 0.25f && info.size[1] == 0.5f);
    HOLDS(memcmp(&info.frame, &HERE, sizeof HERE) == 0);
    OK(dcd_shape_cylinder(world, 0.5f, 0.25f, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_CYLINDER && info.size[0] == 0.25f && info.size[1] == 0.5f);
    OK(dcd_shape_cone(world, 0.5f, 0.25f, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_CONE && info.size[0] == 0.25f && info.size[1] == 0.5f);

    /* The point inside is no corner of the hull. */
    OK(dcd_shape_hull(world, corners, 5, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_HULL && info.vertex_count == 4 && info.triangle_count == 4);
    OK(dcd_shape_vertices(world, shape, xyz, 12, &count));
    HOLDS(count == 4);
    OK(dcd_shape_triangles(world, shape, indices, 12, &count));
    HOLDS(count == 4);
    for (size_t i = 0; i < 3 * count; i++)
        HOLDS(indices[i] < 4);

    OK(dcd_shape_mesh(world, corners, 4, faces, 2, false, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_MESH && info.vertex_count == 4 && info.triangle_count == 2);
    OK(dcd_shape_vertices(world, shape, xyz, 4, &count));
    OK(dcd_shape_triangles(world, shape, indices, 2, &count));
    HOLDS(memcmp(xyz, corners, 12 * sizeof *xyz) == 0 && memcmp(indices, faces, sizeof faces) == 0);
    /* Scaled: each vertex of a mesh; a sphere becomes a hull unless all factors are the same. The original
     * stays. */
    const float stretch[3] = { 2.0f, 3.0f, 0.5f }, twice[3] = { 2.0f, 2.0f, 2.0f };
    OK(dcd_shape_scale(world, shape, stretch, &again));
    OK(dcd_shape_vertices(world, again, xyz, 4, &count));
    for (int i = 0; i < 12; i++)
        HOLDS(xyz[i] == corners[i] * stretch[i % 3]);
    OK(dcd_shape_vertices(world, shape, xyz, 4, &count));
    HOLDS(memcmp(xyz, corners, 12 * sizeof *xyz) == 0);
    OK(dcd_shape_sphere(world, 0.75f, &part));
    OK(dcd_shape_scale(world, part, twice, &again));
    info = info_of(world, again);
    HOLDS(info.kind == DCD_SHAPE_SPHERE && info.size[0] == 1.5f);
    OK(dcd_shape_scale(world, part, stretch, &again));
    info = info_of(world, again);
    HOLDS(info.kind == DCD_SHAPE_HULL && info.vertex_count > 100);
    const DcdShapeId pieces[2] = { part, part };
    const DcdFrame places[2] = { { { 1, 0, 0 }, { 0, 0, 0, 1 } }, { { 0, 1, 0 }, { 0, 0, 1, 0 } } };
    OK(dcd_shape_compound(world, pieces, places, 1, &part));
    OK(dcd_shape_scale(world, part, stretch, &again));
    OK(dcd_shape_compound(world, pieces, places, 2, &part));
    OK(dcd_shape_scale(world, part, twice, &again));
    OK(dcd_shape_part(world, again, 1, &part, &frame));
    HOLDS(frame.p[1] == 2.0f && info_of(world, part).size[0] == 1.5f);
    OK(dcd_shape_compound(world, pieces, places, 2, &part));
    FAILS(dcd_shape_scale(world, part, stretch, &again), DCD_ERR_ARGUMENT, "part 1");
    xyz[0] = 9.0f;
    FAILS(dcd_shape_vertices(world, shape, xyz, 3, &count), DCD_ERR_SMALL_BUFFER, "xyz has room for 3");
    HOLDS(count == 4 && xyz[0] == 9.0f);
    FAILS(dcd_shape_triangles(world, shape, indices, 1, &count), DCD_ERR_SMALL_BUFFER, "indices");
    HOLDS(count == 2);
    OK(dcd_shape_triangles(world, shape, NULL, 0, &count));
    HOLDS(count == 2);

    OK(dcd_shape_heightfield(world, heights, 2, 3, scale, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_HEIGHTFIELD && info.rows == 2 && info.columns == 3);
    HOLDS(memcmp(info.size, scale, sizeof scale) == 0 && info.vertex_count == 6 && info.triangle_count == 4);
    OK(dcd_shape_heights(world, shape, read, 6, &count));
    HOLDS(count == 6 && memcmp(read, heights, sizeof heights) == 0);
    /* heights[1] is the second one along z, at x = -5, z = 10. */
    OK(dcd_shape_vertices(world, shape, xyz, 12, &count));
    bool found = false;
    for (size_t i = 0; i < count; i++)
        found |= xyz[3 * i] == -5.0f && xyz[3 * i + 1] == 2.0f && xyz[3 * i + 2] == 10.0f;
    HOLDS(found);
    FAILS(dcd_shape_heights(world, shape, read, 5, &count), DCD_ERR_SMALL_BUFFER, "6");

    DcdShapeId parts[2];
    DcdFrame frames[2] = { HERE, HERE };
    frames[1].p[1] = 2.0f;
    OK(dcd_shape_box(world, half, &parts[0]));
    OK(dcd_shape_sphere(world, 1.0f, &parts[1]));
    OK(dcd_shape_compound(world, parts, frames, 2, &shape));
    info = info_of(world, shape);
    HOLDS(info.kind == DCD_SHAPE_COMPOUND && info.parts == 2 && info.vertex_count == 0);
    OK(dcd_shape_part(world, shape, 1, &part, &frame));
    HOLDS(info_of(world, part).kind == DCD_SHAPE_SPHERE && frame.p[1] == 2.0f);
    OK(dcd_shape_part(world, shape, 1, &again, NULL));
    HOLDS(again.v == part.v && part.v != parts[1].v);
    FAILS(dcd_shape_part(world, shape, 2, &part, NULL), DCD_ERR_ARGUMENT, "has 2 parts");
    FAILS(dcd_shape_part(world, parts[0], 0, &part, NULL), DCD_ERR_ARGUMENT, "has 0 parts");
    FAILS(dcd_shape_part(world, shape, 0, NULL, NULL), DCD_ERR_NULL, "out");
    info.struct_size = 3;
    FAILS(dcd_shape_info(world, shape, &info), DCD_ERR_STRUCT, "DcdShapeInfo");
    FAILS(dcd_shape_info(world, shape, NULL), DCD_ERR_NULL, "out");
    info.struct_size = (uint32_t)sizeof info;
    OK(dcd_shape_destroy(world, shape));
    FAILS(dcd_shape_info(world, shape, &info), DCD_ERR_STALE_ID, "shape");
    FAILS(dcd_shape_vertices(world, shape, xyz, 12, &count), DCD_ERR_STALE_ID, "shape");
    FAILS(dcd_shape_triangles(world, shape, indices, 12, &count), DCD_ERR_STALE_ID, "shape");
    FAILS(dcd_shape_heights(world, shape, read, 6, &count), DCD_ERR_STALE_ID, "shape");
    FAILS(dcd_shape_vertices(world, parts[0], xyz, 12, NULL), DCD_ERR_NULL, "count");
}

/* Bodies as the library describes them. */
static void bodies(DcdWorld world)
{
    const float slab[3] = { 20.0f, 0.5f, 20.0f }, half[3] = { 0.5f, 1.0f, 1.5f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdColliderProperties hat = DCD_COLLIDER_PROPERTIES_INIT;
    DcdBodyId floor, box, twin, all[4];
    DcdShapeId made, shape, other, again;
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    DcdBodyExtent extent = DCD_BODY_EXTENT_INIT;
    size_t count = 7;

    OK(dcd_bodies(world, NULL, 0, &count));
    HOLDS(count == 0);
    def.body_type = DCD_FIXED;
    def.pose.p[1] = -0.5;
    OK(dcd_shape_box(world, slab, &def.shape));
    OK(dcd_body_create(world, &def, &floor));
    def.body_type = DCD_DYNAMIC;
    OK(dcd_shape_box(world, half, &made));
    def.shape = made;
    def.pose.p[0] = -0.4; /* at the border */
    def.pose.p[1] = 1.0;
    OK(dcd_body_create(world, &def, &box));
    def.pose.p[0] = 0.7;
    OK(dcd_body_create(world, &def, &twin));
    for (int i = 0; i < 5; i++)
        OK(dcd_step(world));

    FAILS(dcd_bodies(world, all, 2, &count), DCD_ERR_SMALL_BUFFER, "3");
    OK(dcd_bodies(world, all, 4, &count));
    HOLDS(count == 3 && all[0].v == floor.v && all[1].v == box.v && all[2].v == twin.v);

    /* Bodies with equal shapes share one handle. It differs from the handle that they were made with, and
     * works like any other. */
    OK(dcd_collider_shape(world, box, 0, &shape));
    OK(dcd_collider_shape(world, twin, 0, &other));
    HOLDS(shape.v == other.v && shape.v != made.v);
    OK(dcd_shape_destroy(world, made));
    HOLDS(info_of(world, shape).size[2] == 1.5f);
    OK(dcd_collider_shape(world, floor, 0, &other));
    HOLDS(other.v != shape.v && info_of(world, other).size[0] == 20.0f);
    OK(dcd_shape_destroy(world, shape));
    OK(dcd_collider_shape(world, box, 0, &again));
    HOLDS(again.v != shape.v && info_of(world, again).size[2] == 1.5f);
    FAILS(dcd_collider_shape(world, box, 1, &again), DCD_ERR_ARGUMENT, "no collider 1");
    FAILS(dcd_collider_shape(world, box, 0, NULL), DCD_ERR_NULL, "out");
    def.shape = again;
    def.pose.p[0] = 9.0;
    DcdBodyId third;
    OK(dcd_body_create(world, &def, &third));
    OK(dcd_body_destroy(world, third));
    FAILS(dcd_collider_shape(world, third, 0, &again), DCD_ERR_STALE_ID, "body");

    /* 1 x 2 x 3 m with the density of water, no matter which regions hold it. */
    OK(dcd_body_extent(world, box, &extent));
    OK(dcd_body_info(world, box, &info));
    HOLDS(near(extent.mass, 6000.0, 0.1) && near(info.mass, extent.mass, 0.1));
    HOLDS(near(extent.max[0] - extent.min[0], 1.0, 0.02) && near(extent.max[2] - extent.min[2], 3.0, 0.02));
    HOLDS(near(0.5 * (extent.max[0] + extent.min[0]), -0.4, 0.05) && near(extent.min[1], 0.0, 0.02));
    HOLDS(near(extent.inertia[0], 500.0 * 13.0, 1.0) && near(extent.inertia[1], 500.0 * 10.0, 1.0) &&
          near(extent.inertia[2], 500.0 * 5.0, 1.0));
    /* A collider of the same mass two metres above. */
    hat.mass = 6000.0f;
    hat.frame.p[1] = 2.0f;
    OK(dcd_shape_sphere(world, 0.5f, &shape));
    OK(dcd_collider_add(world, twin, shape, &hat, NULL));
    OK(dcd_body_extent(world, twin, &extent));
    HOLDS(near(extent.mass, 12000.0, 0.1) && near(extent.centre[1], 1.0, 1e-4) && near(extent.centre[0], 0.0, 1e-4));
    HOLDS(near(extent.max[1] - extent.min[1], 3.5, 0.05));
    OK(dcd_body_extent(world, floor, &extent));
    HOLDS(extent.mass == 0.0f && extent.inertia[1] == 0.0f && extent.max[0] == 20.0 && extent.max[1] == 0.0);
    extent.struct_size = 8;
    FAILS(dcd_body_extent(world, floor, &extent), DCD_ERR_STRUCT, "DcdBodyExtent");
    FAILS(dcd_body_extent(world, floor, NULL), DCD_ERR_NULL, "out");
    extent.struct_size = (uint32_t)sizeof extent;
    FAILS(dcd_body_extent(world, third, &extent), DCD_ERR_STALE_ID, "body");
    FAILS(dcd_bodies(world, all, 4, NULL), DCD_ERR_NULL, "count");
    FAILS(dcd_bodies((DcdWorld){ 0 }, all, 4, &count), DCD_ERR_NULL, "world");

    /* Handles that were looked up do not keep the shapes of bodies that are gone. The others stay. */
    DcdShapeId first = { 0 }, kept;
    DcdShapeInfo gone = DCD_SHAPE_INFO_INIT;
    OK(dcd_collider_shape(world, box, 0, &kept));
    def.pose.p[0] = 12.0;
    for (int i = 0; i < 200; i++) {
        const float size[3] = { 0.2f + 0.01f * (float)i, 0.3f, 0.3f };
        OK(dcd_shape_box(world, size, &def.shape));
        OK(dcd_body_create(world, &def, &third));
        OK(dcd_collider_shape(world, third, 0, &again));
        HOLDS(info_of(world, again).size[0] == size[0]);
        if (i == 0)
            first = again;
        OK(dcd_shape_destroy(world, def.shape));
        OK(dcd_body_destroy(world, third));
    }
    FAILS(dcd_shape_info(world, first, &gone), DCD_ERR_STALE_ID, "shape");
    HOLDS(info_of(world, kept).size[2] == 1.5f);
    OK(dcd_collider_shape(world, box, 0, &again));
    HOLDS(again.v == kept.v);
}

/* A half-space bears bodies in both regions; a round box stands on its border; a wire is met by a query. */
static void ground_wires_and_round_edges(DcdWorld world)
{
    const float up[3] = { 0.0f, 3.0f, 0.0f }, half[3] = { 0.4f, 0.4f, 0.4f }, end[3] = { 4.0f, 0.0f, 0.0f }, start[3] = { 0 };
    DcdBodyDef ground = DCD_BODY_DEF_INIT, crate = DCD_BODY_DEF_INIT, wire = DCD_BODY_DEF_INIT;
    DcdShapeQuery near_by = DCD_SHAPE_QUERY_INIT;
    DcdBodyId plane, crates[2], line;
    DcdOverlap met;
    DcdShapeId sharp;
    size_t found = 0, ended = 0;
    ground.body_type = wire.body_type = DCD_FIXED;
    ground.pose.p[1] = -30.0;
    OK(dcd_shape_half_space(world, up, &ground.shape));
    DcdShapeInfo info = info_of(world, ground.shape);
    HOLDS(info.kind == DCD_SHAPE_HALF_SPACE && memcmp(&info.frame, &HERE, sizeof HERE) == 0);
    OK(dcd_body_create(world, &ground, &plane));
    OK(dcd_shape_box(world, half, &sharp));
    OK(dcd_shape_round(world, sharp, 0.1f, &crate.shape));
    info = info_of(world, crate.shape);
    HOLDS(info.kind == DCD_SHAPE_BOX && info.border == 0.1f && memcmp(info.size, half, sizeof half) == 0);
    crate.pose.p[1] = -29.0;
    for (int i = 0; i < 2; i++) {
        crate.pose.p[0] = i == 0 ? -40.0 : 40.0;
        OK(dcd_body_create(world, &crate, &crates[i]));
    }
    wire.pose.p[2] = 50.0;
    OK(dcd_shape_segment(world, start, end, &wire.shape));
    info = info_of(world, wire.shape);
    HOLDS(info.kind == DCD_SHAPE_LINES && info.vertex_count == 2);
    OK(dcd_body_create(world, &wire, &line));
    near_by.shape = sharp;
    near_by.pose.p[0] = 3.0;
    near_by.pose.p[1] = 0.3;
    near_by.pose.p[2] = 50.0;
    OK(dcd_overlap_shapes(world, &near_by, 1, NULL, &met, 1, &ended, &found));
    HOLDS(found == 1 && met.body.v == line.v);
    near_by.pose.p[1] = 0.5;
    OK(dcd_overlap_shapes(world, &near_by, 1, NULL, &met, 1, &ended, &found));
    HOLDS(found == 0);
    for (int i = 0; i < 120; i++)
        OK(dcd_step(world));
    for (int i = 0; i < 2; i++) {
        DcdPose pose;
        OK(dcd_body_get(world, crates[i], &pose, NULL));
        HOLDS(near(pose.p[1], -29.5, 0.01));
    }
    ground.body_type = DCD_DYNAMIC;
    FAILS(dcd_body_create(world, &ground, &plane), DCD_ERR_ARGUMENT, "mass");
}

/* Poses between two poses: positions are interpolated linearly, rotations along the shorter arc. */
static void poses_between(void)
{
    const double eighth = 3.14159265358979 / 8.0; /* half of 45 degrees */
    const DcdPose from = { { 1.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    DcdPose to = { { 3.0, 4.0, 0.0 }, { 0.0f, 0.0f, (float)sin(2.0 * eighth), (float)cos(2.0 * eighth) } }, between, bad;
    OK(dcd_pose_interpolate(&from, &to, 0.0, &between));
    HOLDS(memcmp(between.p, from.p, sizeof from.p) == 0 && near(between.q[3], 1.0, 1e-6));
    for (int sign = 1; sign >= -1; sign -= 2) { /* both signs are the same rotation */
        for (int i = 0; i < 4; i++)
            to.q[i] *= (float)sign;
        OK(dcd_pose_interpolate(&from, &to, 0.5, &between));
        HOLDS(near(between.p[0], 2.0, 1e-9) && near(between.p[1], 2.0, 1e-9));
        HOLDS(near(fabs(between.q[3]), cos(eighth), 1e-6) && near(between.q[2] / between.q[3], tan(eighth), 1e-6));
    }
    between = to;
    OK(dcd_pose_interpolate(&from, &between, 1.0, &between)); /* the result may be one of the inputs */
    HOLDS(memcmp(between.p, to.p, sizeof to.p) == 0);
    FAILS(dcd_pose_interpolate(NULL, &to, 0.5, &between), DCD_ERR_NULL, "from");
    FAILS(dcd_pose_interpolate(&from, NULL, 0.5, &between), DCD_ERR_NULL, "to");
    FAILS(dcd_pose_interpolate(&from, &to, 0.5, NULL), DCD_ERR_NULL, "out");
    FAILS(dcd_pose_interpolate(&from, &to, NAN, &between), DCD_ERR_ARGUMENT, "t is not finite");
    bad = from;
    bad.q[3] = 0.5f;
    FAILS(dcd_pose_interpolate(&bad, &to, 0.5, &between), DCD_ERR_ARGUMENT, "from.q");
    bad = to;
    bad.p[2] = INFINITY;
    FAILS(dcd_pose_interpolate(&from, &bad, 0.5, &between), DCD_ERR_ARGUMENT, "to");
    HOLDS(memcmp(between.p, to.p, sizeof to.p) == 0);
}

int main(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.regions = 2;
    OK(dcd_world_create(&def, &world));
    shapes(world);
    bodies(world);
    ground_wires_and_round_edges(world);
    poses_between();
    OK(dcd_world_destroy(world));
    return checked();
}
