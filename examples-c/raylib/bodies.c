#include "bodies.h"

#include "raymath.h"

#include <stdio.h>
#include <stdlib.h>

/* A mesh at its place on a body. */
typedef struct Part {
    const Mesh *mesh;
    Matrix body_from_mesh;
    struct Part *next;
} Part;

/* A mesh made of a shape's own vertices. Equal shapes have one handle, so each is made once. */
typedef struct Lump {
    DcdShapeId shape;
    Mesh mesh;
    struct Lump *next;
} Lump;

typedef struct Body {
    DcdBodyId id;
    Mobility mobility;
    DcdPose pose;
    Color colour;
    unsigned long frame; /* when it was shown last, if it is movable */
    Part *parts;
    struct Body *next;
} Body;

static const Color PALETTE[] = { { 230, 92, 70, 255 },  { 92, 178, 106, 255 }, { 82, 136, 228, 255 },  { 236, 188, 72, 255 },
                                 { 170, 108, 214, 255 }, { 72, 190, 196, 255 }, { 236, 138, 176, 255 }, { 160, 168, 82, 255 } };

void check(DcdStatus status)
{
    if (status != DCD_OK) {
        char message[1024];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "play: %s\n", message);
        exit(EXIT_FAILURE);
    }
}

/* In raymath the left factor of a product applies first. */
static Matrix matrix_of(float x, float y, float z, const float q[4])
{
    const Quaternion turn = { q[0], q[1], q[2], q[3] };
    return MatrixMultiply(QuaternionToMatrix(turn), MatrixTranslate(x, y, z));
}

static Matrix matrix_of_frame(const DcdFrame *frame)
{
    return matrix_of(frame->p[0], frame->p[1], frame->p[2], frame->q);
}

/* Flat shaded: each triangle has corners of its own. */
static Mesh mesh_of(DcdWorld world, DcdShapeId shape, const DcdShapeInfo *info)
{
    Mesh mesh = { 0 };
    size_t vertices, triangles;
    float *xyz = MemAlloc(info->vertex_count * 3 * sizeof *xyz);
    uint32_t *corners = MemAlloc(info->triangle_count * 3 * sizeof *corners);
    check(dcd_shape_vertices(world, shape, xyz, info->vertex_count, &vertices));
    check(dcd_shape_triangles(world, shape, corners, info->triangle_count, &triangles));
    mesh.triangleCount = (int)triangles;
    mesh.vertexCount = 3 * mesh.triangleCount;
    mesh.vertices = MemAlloc((unsigned)mesh.vertexCount * sizeof(Vector3));
    mesh.normals = MemAlloc((unsigned)mesh.vertexCount * sizeof(Vector3));
    Vector3 *at = (Vector3 *)mesh.vertices, *normal = (Vector3 *)mesh.normals;
    for (size_t i = 0; i < 3 * triangles; i++) {
        const float *from = &xyz[3 * corners[i]];
        at[i] = (Vector3){ from[0], from[1], from[2] };
    }
    for (size_t i = 0; i < 3 * triangles; i++) {
        const Vector3 *t = &at[i - i % 3];
        normal[i] = Vector3Normalize(Vector3CrossProduct(Vector3Subtract(t[1], t[0]), Vector3Subtract(t[2], t[0])));
    }
    MemFree(corners);
    MemFree(xyz);
    UploadMesh(&mesh, false);
    return mesh;
}

static const Mesh *lump(Bodies *bodies, DcdShapeId shape, const DcdShapeInfo *info)
{
    for (Lump *known = bodies->lumps; known != NULL; known = known->next) {
        if (known->shape.v == shape.v) {
            return &known->mesh;
        }
    }
    Lump *made = MemAlloc(sizeof *made);
    *made = (Lump){ shape, mesh_of(bodies->world, shape, info), bodies->lumps };
    bodies->lumps = made;
    bodies->meshes++;
    return &made->mesh;
}

static void add_part(Body *body, const Mesh *mesh, Vector3 scale, Vector3 at, Matrix body_from_shape)
{
    Part *part = MemAlloc(sizeof *part);
    const Matrix shape_from_mesh = MatrixMultiply(MatrixScale(scale.x, scale.y, scale.z), MatrixTranslate(at.x, at.y, at.z));
    *part = (Part){ mesh, MatrixMultiply(shape_from_mesh, body_from_shape), body->parts };
    body->parts = part;
}

/* The renderer's meshes have the size 1. Its cylinders and cones stand on the origin; dcd's have their middle there. */
static void add_shape(Bodies *bodies, Body *body, DcdShapeId shape, Matrix body_from_place)
{
    DcdShapeInfo info = DCD_SHAPE_INFO_INIT;
    check(dcd_shape_info(bodies->world, shape, &info));
    const Matrix place = MatrixMultiply(matrix_of_frame(&info.frame), body_from_place);
    const float b = info.border, r = info.size[0] + b, h = info.size[1];
    const Vector3 zero = { 0 }, one = { 1.0f, 1.0f, 1.0f };
    switch (info.kind) {
    case DCD_SHAPE_BOX:
        add_part(body, &bodies->box, (Vector3){ 2.0f * r, 2.0f * (h + b), 2.0f * (info.size[2] + b) }, zero, place);
        break;
    case DCD_SHAPE_SPHERE:
        add_part(body, &bodies->ball, (Vector3){ r, r, r }, zero, place);
        break;
    case DCD_SHAPE_CAPSULE:
        add_part(body, &bodies->cylinder, (Vector3){ r, 2.0f * h, r }, (Vector3){ 0.0f, -h, 0.0f }, place);
        add_part(body, &bodies->ball, (Vector3){ r, r, r }, (Vector3){ 0.0f, h, 0.0f }, place);
        add_part(body, &bodies->ball, (Vector3){ r, r, r }, (Vector3){ 0.0f, -h, 0.0f }, place);
        break;
    case DCD_SHAPE_CYLINDER:
    case DCD_SHAPE_CONE:
        add_part(body, info.kind == DCD_SHAPE_CONE ? &bodies->cone : &bodies->cylinder,
                 (Vector3){ r, 2.0f * (h + b), r }, (Vector3){ 0.0f, -h - b, 0.0f }, place);
        break;
    case DCD_SHAPE_HALF_SPACE:
        add_part(body, &bodies->plane, one, zero, place);
        break;
    case DCD_SHAPE_COMPOUND:
        for (uint32_t i = 0; i < info.parts; i++) {
            DcdShapeId part;
            DcdFrame frame;
            check(dcd_shape_part(bodies->world, shape, i, &part, &frame));
            add_shape(bodies, body, part, MatrixMultiply(matrix_of_frame(&frame), place));
        }
        break;
    default: /* hulls, meshes, terrain, voxels, and what later versions have */
        if (info.triangle_count > 0) {
            add_part(body, lump(bodies, shape, &info), one, zero, place);
        }
    }
}

static Body **find(Bodies *bodies, DcdBodyId id)
{
    Body **link = &bodies->buckets[(id.v * 0x9E3779B97F4A7C15u >> 32) % BODIES_BUCKETS];
    while (*link != NULL && (*link)->id.v != id.v) {
        link = &(*link)->next;
    }
    return link;
}

void bodies_add(Bodies *bodies, DcdBodyId id)
{
    Body **link = find(bodies, id);
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    if (*link != NULL) {
        return;
    }
    Body *body = *link = MemAlloc(sizeof *body);
    check(dcd_body_info(bodies->world, id, &info));
    *body = (Body){ .id = id, .mobility = info.body_type == DCD_FIXED ? SCENERY : MOVABLE, .colour = { 176, 178, 170, 255 } };
    check(dcd_body_get(bodies->world, id, &body->pose, NULL));
    for (uint32_t i = 0; i < info.colliders; i++) {
        DcdColliderProperties collider = DCD_COLLIDER_PROPERTIES_INIT;
        DcdShapeId shape;
        check(dcd_collider_properties(bodies->world, id, i, &collider));
        if ((collider.flags & (DCD_COLLIDER_SENSOR | DCD_COLLIDER_DISABLED)) == 0) {
            check(dcd_collider_shape(bodies->world, id, i, &shape));
            add_shape(bodies, body, shape, matrix_of_frame(&collider.frame));
        }
    }
    bodies->count++;
}

void bodies_remove(Bodies *bodies, DcdBodyId id)
{
    Body **link = find(bodies, id), *gone = *link;
    if (gone == NULL) {
        return;
    }
    *link = gone->next;
    for (Part *part = gone->parts, *next; part != NULL; part = next) {
        next = part->next;
        MemFree(part);
    }
    MemFree(gone);
    bodies->count--;
}

void bodies_open(Bodies *bodies, DcdWorld world)
{
    *bodies = (Bodies){ .world = world, .meshes = 5 };
    bodies->box = GenMeshCube(1.0f, 1.0f, 1.0f);
    bodies->ball = GenMeshSphere(1.0f, 16, 24);
    bodies->cylinder = GenMeshCylinder(1.0f, 1.0f, 24);
    bodies->cone = GenMeshCone(1.0f, 1.0f, 24);
    bodies->plane = GenMeshPlane(2000.0f, 2000.0f, 1, 1);
    size_t count;
    check(dcd_bodies(world, NULL, 0, &count));
    DcdBodyId *ids = malloc(count * sizeof *ids);
    check(dcd_bodies(world, ids, count, &count));
    for (size_t i = 0; i < count; i++) {
        bodies_add(bodies, ids[i]);
    }
    free(ids);
}

void bodies_show(Bodies *bodies, const DcdStateView *view, DcdBodyId avatar)
{
    bodies->frame++;
    for (size_t i = 0; i < view->count; i++) {
        Body *body = *find(bodies, view->ids[i]);
        if (body == NULL || (view->flags[i] & DCD_STATE_OUTSIDE) != 0) {
            continue; /* not appeared yet, or out of sight and perhaps elsewhere by now */
        }
        /* Neighbours of one region differ a little. */
        const float shade = 0.06f * ((float)(view->ids[i].v % 5) - 2.0f);
        const Color colour = ColorBrightness(PALETTE[view->regions[i] % (sizeof PALETTE / sizeof *PALETTE)], shade);
        const bool sleeps = (view->flags[i] & DCD_STATE_SLEEPING) != 0;
        body->pose = view->poses[i];
        body->colour = body->id.v == avatar.v ? RAYWHITE : sleeps ? ColorLerp(colour, GRAY, 0.45f) : colour;
        body->frame = bodies->frame;
    }
}

void bodies_draw(const Bodies *bodies, Mobility mobility, Material material, const double origin[3])
{
    for (int i = 0; i < BODIES_BUCKETS; i++) {
        for (const Body *body = bodies->buckets[i]; body != NULL; body = body->next) {
            if (body->mobility != mobility || (mobility == MOVABLE && body->frame != bodies->frame)) {
                continue;
            }
            const double *p = body->pose.p;
            const Matrix place = matrix_of((float)(p[0] - origin[0]), (float)(p[1] - origin[1]), (float)(p[2] - origin[2]),
                                           body->pose.q);
            material.maps[MATERIAL_MAP_DIFFUSE].color = body->colour;
            for (const Part *part = body->parts; part != NULL; part = part->next) {
                DrawMesh(*part->mesh, material, MatrixMultiply(part->body_from_mesh, place));
            }
        }
    }
}
