/* Every kind of query: asked at once in a local world, and submitted to a served one, as a client and as a
 * participant of two nodes. All answers must be the same: `asking FOLDER`, run by served.rs. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <math.h>
#include <time.h>

enum { BODIES = 9, MOST = 64 };

/* A world with the shapes to query with and the bodies of the scene in it. */
typedef struct Place {
    DcdWorld world;
    DcdShapeId ball, plank, hull, both, mesh;
    DcdBodyId bodies[BODIES];
} Place;

static void step(DcdWorld world)
{
    struct timespec pause = { 0, 5 * 1000 * 1000 };
    OK(dcd_step(world));
    nanosleep(&pause, NULL);
}

static DcdBodyId put(DcdWorld world, DcdBodyType type, DcdShapeId shape, double x, double y, uint64_t user_data)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId body = { 0 };
    def.body_type = type;
    def.shape = shape;
    def.pose.p[0] = x;
    def.pose.p[1] = y;
    def.pose.q[1] = 0.6f;
    def.pose.q[3] = 0.8f;
    def.user_data = user_data;
    def.groups = user_data == 5 ? 2 : 1;
    def.flags = user_data == 6 ? DCD_BODY_SENSOR : 0;
    OK(dcd_body_create(world, &def, &body));
    return body;
}

/* Makes the shapes to query with. The bodies come in the order in which they were made. */
static Place at(DcdWorld world)
{
    const float half[3] = { 0.5f, 0.1f, 0.25f };
    const float corners[] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1 };
    const uint32_t faces[] = { 0, 1, 2, 0, 2, 3 };
    DcdFrame frames[2] = { { { -0.5f, 0, 0 }, { 0, 0, 0, 1 } }, { { 0.5f, 0.25f, 0 }, { 0, 0, 0, 1 } } };
    Place place = { .world = world };
    OK(dcd_shape_sphere(world, 0.75f, &place.ball));
    OK(dcd_shape_box(world, half, &place.plank));
    OK(dcd_shape_hull(world, corners, 5, &place.hull));
    OK(dcd_shape_mesh(world, corners, 5, faces, 2, false, &place.mesh));
    const DcdShapeId parts[2] = { place.ball, place.plank };
    OK(dcd_shape_compound(world, parts, frames, 2, &place.both));
    for (uint32_t i = 0; i < BODIES; i++)
        OK(dcd_body_at(world, i, &place.bodies[i]));
    return place;
}

/* A scene in which nothing moves: ground on both sides of the border, and bodies on either side. */
static DcdWorld scene(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world = { 0 };
    DcdShapeId ground, cube, ball, both;
    const float wide[3] = { 30.0f, 0.5f, 30.0f }, half[3] = { 0.5f, 0.5f, 0.5f };
    DcdFrame frames[2] = { { { -0.5f, 0, 0 }, { 0, 0, 0, 1 } }, { { 0.75f, 0, 0 }, { 0, 0, 0, 1 } } };
    def.regions = 2;
    def.gravity[1] = 0.0f;
    OK(dcd_world_create(&def, &world));
    OK(dcd_shape_box(world, wide, &ground));
    OK(dcd_shape_box(world, half, &cube));
    OK(dcd_shape_sphere(world, 0.5f, &ball));
    const DcdShapeId parts[2] = { cube, ball };
    OK(dcd_shape_compound(world, parts, frames, 2, &both));
    put(world, DCD_FIXED, ground, 0.0, -2.0, 1);
    put(world, DCD_DYNAMIC, cube, -6.0, 1.0, 2);
    put(world, DCD_DYNAMIC, ball, 6.0, 1.0, 3);
    put(world, DCD_DYNAMIC, both, -10.0, 1.0, 4);
    put(world, DCD_DYNAMIC, both, 10.0, 1.0, 5);
    put(world, DCD_DYNAMIC, ball, -14.0, 1.0, 6);
    put(world, DCD_DYNAMIC, cube, 14.0, 1.0, 7);
    put(world, DCD_KINEMATIC, cube, -18.0, 1.0, 8);
    put(world, DCD_FIXED, ball, 18.0, 1.0, 9);
    return world;
}

/* Steps until a query that is polled by this call is answered. */
#define POLL(place, call) \
    do { \
        DcdStatus status_ = (call); \
        for (int tries = 0; status_ == DCD_ERR_BUSY && tries < 6000; tries++) { \
            step((place)->world); \
            status_ = (call); \
        } \
        OK(status_); \
    } while (0)

/* Compares hits. Bodies have other ids in every world, so only whether there is a body is compared. */
#define SAME(a, b, count) \
    do { \
        for (size_t i_ = 0; i_ < (count); i_++) { \
            HOLDS(((a)[i_].body.v == 0) == ((b)[i_].body.v == 0)); \
            (a)[i_].body.v = (b)[i_].body.v = 0; \
        } \
        HOLDS(memcmp(a, b, (count) * sizeof *(a)) == 0); \
    } while (0)

/* The filter number `which`, kept in `room`. */
static const DcdFilter *filter(const Place *place, int which, DcdFilter *room)
{
    *room = (DcdFilter)DCD_FILTER_INIT;
    room->flags = which == 1 ? DCD_FILTER_NO_FIXED | DCD_FILTER_NO_SENSORS : 0;
    room->mask = which == 2 ? 1 : 0xFFFFFFFFu;
    room->exclude = &place->bodies[1];
    room->exclude_count = which == 3 ? 2 : 0;
    return which == 0 ? NULL : room;
}

/* Whether a body lies above the ground at this x. */
static bool is_over_one(int x)
{
    return x % 4 != 0 && (x < -2 || x > 2);
}

static size_t rays(const Place *place, DcdRay *out)
{
    const DcdRay ray = DCD_RAY_INIT;
    size_t count = 0;
    for (int x = -20; x <= 20; x++) {
        out[count] = ray;
        out[count].origin[0] = x;
        out[count].origin[1] = 5.0;
        out[count].direction[0] = 0.01f;
        out[count].direction[1] = -1.0f;
        out[count].exclude = x == 7 ? place->bodies[2] : ray.exclude;
        out[count++].flags = x % 2 ? DCD_QUERY_HOLLOW : 0;
    }
    for (int side = -1; side <= 1; side += 2) {
        out[count] = ray;
        out[count].origin[0] = 1.0 * side;
        out[count].origin[1] = 1.0;
        out[count++].direction[0] = -1.0f * (float)side;
    }
    return count;
}

static size_t casts(const Place *place, DcdShapeCast *out)
{
    const DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    const DcdShapeId shapes[] = { place->ball, place->plank, place->hull, place->both };
    size_t count = 0;
    for (int x = -18; x <= 18; x += 4) {
        out[count] = cast;
        out[count].shape = shapes[count % 4];
        out[count].pose.p[0] = x;
        out[count].pose.p[1] = 6.0;
        out[count].motion[1] = -12.0f;
        out[count].turn[2] = count % 3 ? 0.0f : 1.5f;
        out[count].margin = count % 3 ? 0.125f : 0.0f;
        out[count++].exclude = x == -2 ? place->bodies[0] : cast.exclude;
    }
    /* Along the row: towards a body, from inside of one, and from inside of one on the way out. */
    for (int i = 0; i < 3; i++) {
        out[count] = cast;
        out[count].shape = place->ball;
        out[count].pose.p[0] = i == 0 ? -1.0 : 6.0;
        out[count].pose.p[1] = 1.0;
        out[count].motion[0] = 8.0f;
        out[count++].flags = i == 2 ? DCD_QUERY_LEAVE : 0;
    }
    return count;
}

static size_t shapes(const Place *place, DcdShapeQuery *out)
{
    const DcdShapeQuery query = DCD_SHAPE_QUERY_INIT;
    const DcdShapeId shapes[] = { place->ball, place->plank, place->hull, place->both };
    size_t count = 0;
    for (int x = -20; x <= 20; x += 2) {
        out[count] = query;
        out[count].shape = shapes[count % 4];
        out[count].pose.p[0] = x + 0.25;
        out[count].pose.p[1] = is_over_one(x) ? 1.0 : -1.25;
        out[count++].mask = x == 10 ? 2 : query.mask;
    }
    return count;
}

static size_t points(const Place *place, DcdPointQuery *out)
{
    const DcdPointQuery query = DCD_POINT_QUERY_INIT;
    size_t count = 0;
    for (int x = -20; x <= 20; x += 2) {
        out[count] = query;
        out[count].point[0] = x - 0.14;
        out[count].point[1] = is_over_one(x) ? 1.0 : -2.0;
        out[count].point[2] = x == 10 || x == -10 ? 0.48 : 0.0;
        out[count++].exclude = x == 0 ? place->bodies[0] : query.exclude;
    }
    return count;
}

static size_t boxes(DcdBoxQuery *out)
{
    const DcdBoxQuery query = DCD_BOX_QUERY_INIT;
    for (int i = 0; i < 3; i++) {
        out[i] = query;
        for (int k = 0; k < 3; k++) {
            out[i].min[k] = i == 0 ? -(double)INFINITY : -8.0;
            out[i].max[k] = i == 0 ? (double)INFINITY : 1.0 + 8.0 * i;
        }
    }
    return 3;
}

/* By user data: the bodies that any query met. Place 0 is for queries that met none. */
static bool seen[BODIES + 1];

static void sees(uint64_t user_data)
{
    if (user_data <= BODIES)
        seen[user_data] = true;
}

static void same_rays(const Place *here, const Place *there, int which)
{
    DcdRay asked[MOST];
    DcdRayHit hits[MOST], told[MOST];
    DcdFilter room;
    DcdQueryId query;
    size_t count = rays(here, asked), total = 0;
    OK(dcd_cast_rays(here->world, asked, count, filter(here, which, &room), hits));
    OK(dcd_cast_rays_submit(there->world, asked, rays(there, asked), filter(there, which, &room), &query));
    POLL(there, dcd_query_poll(there->world, query, told, MOST, &total));
    HOLDS(total == count);
    SAME(hits, told, count);
    for (size_t i = 0; i < count; i++)
        sees(told[i].user_data);
}

static void same_casts(const Place *here, const Place *there, int which)
{
    DcdShapeCast asked[MOST];
    DcdShapeHit hits[MOST], told[MOST];
    DcdFilter room;
    DcdQueryId query;
    size_t count = casts(here, asked), total = 0;
    OK(dcd_cast_shapes(here->world, asked, count, filter(here, which, &room), hits));
    OK(dcd_cast_shapes_submit(there->world, asked, casts(there, asked), filter(there, which, &room), &query));
    POLL(there, dcd_query_poll_casts(there->world, query, told, MOST, &total));
    HOLDS(total == count && (which != 0 || (told[count - 2].flags & DCD_HIT_INSIDE) != 0));
    SAME(hits, told, count);
    for (size_t i = 0; i < count; i++)
        sees(told[i].user_data);
}

/* Overlaps of shapes, points or boxes, by `kind`. */
static void same_overlaps(const Place *here, const Place *there, int which, int kind)
{
    DcdShapeQuery shape[MOST];
    DcdPointQuery point[MOST];
    DcdBoxQuery box[MOST];
    DcdOverlap found[2 * MOST], told[2 * MOST];
    size_t ends[MOST], told_ends[MOST], count = 0, total = 0, told_total = 0;
    DcdFilter room;
    const DcdFilter *given = filter(here, which, &room);
    DcdQueryId query;
    switch (kind) {
    case 0:
        count = shapes(here, shape);
        OK(dcd_overlap_shapes(here->world, shape, count, given, found, 2 * MOST, ends, &total));
        shapes(there, shape);
        OK(dcd_overlap_shapes_submit(there->world, shape, count, filter(there, which, &room), &query));
        break;
    case 1:
        count = points(here, point);
        OK(dcd_overlap_points(here->world, point, count, given, found, 2 * MOST, ends, &total));
        points(there, point);
        OK(dcd_overlap_points_submit(there->world, point, count, filter(there, which, &room), &query));
        break;
    default:
        count = boxes(box);
        OK(dcd_overlap_boxes(here->world, box, count, given, found, 2 * MOST, ends, &total));
        OK(dcd_overlap_boxes_submit(there->world, box, count, filter(there, which, &room), &query));
    }
    POLL(there, dcd_query_poll_overlaps(there->world, query, told, 2 * MOST, told_ends, &told_total));
    HOLDS(told_total == total && total > 3);
    HOLDS(memcmp(ends, told_ends, count * sizeof *ends) == 0);
    SAME(found, told, total);
    for (size_t i = 0; i < total; i++)
        sees(told[i].user_data);
}

/* The answers here and there are the same to the bit, and queries of each kind meet every body. */
static void same(const Place *here, const Place *there)
{
    for (int kind = -2; kind < 3; kind++) {
        memset(seen, 0, sizeof seen);
        for (int which = 0; which < 4; which++) {
            if (kind == -2)
                same_rays(here, there, which);
            else if (kind == -1)
                same_casts(here, there, which);
            else
                same_overlaps(here, there, which, kind);
        }
        for (int i = 1; i <= BODIES; i++)
            HOLDS(seen[i]);
    }
}

/* The bounds of what may be submitted, and the errors beyond them. */
static void bounds(const Place *place)
{
    enum { MOST_SHAPES = DCD_MAX_SUBMITTED_COST / DCD_SHAPE_COST };
    static DcdShapeCast many[MOST_SHAPES + 1];
    static DcdShapeQuery around[MOST_SHAPES + 1];
    static DcdBoxQuery all[DCD_MAX_SUBMITTED_COST];
    static size_t ends[DCD_MAX_SUBMITTED_COST];
    DcdWorld world = place->world;
    DcdShapeHit hit;
    DcdRayHit ray;
    DcdOverlap overlap;
    DcdQueryId query = { 0 }, open[DCD_MAX_OPEN_QUERIES];
    size_t count = 0;
    const DcdShapeQuery ball = DCD_SHAPE_QUERY_INIT;
    for (int i = 0; i <= MOST_SHAPES; i++) {
        many[i] = (DcdShapeCast)DCD_SHAPE_CAST_INIT;
        many[i].shape = place->ball;
        many[i].motion[0] = 1.0f;
        around[i] = ball;
        around[i].shape = place->hull;
    }
    FAILS(dcd_cast_shapes_submit(world, many, MOST_SHAPES + 1, NULL, &query), DCD_ERR_ARGUMENT, "SUBMITTED_COST");
    FAILS(dcd_overlap_shapes_submit(world, around, MOST_SHAPES + 1, NULL, &query), DCD_ERR_ARGUMENT, "SUBMITTED_COST");
    many[0].shape = place->mesh;
    FAILS(dcd_cast_shapes_submit(world, many, 1, NULL, &query), DCD_ERR_ARGUMENT, "casts[0]: meshes");
    many[0].shape = (DcdShapeId){ 0 };
    FAILS(dcd_cast_shapes_submit(world, many, 1, NULL, &query), DCD_ERR_NULL, "shape");
    many[0].shape = place->ball;
    many[0].turn[1] = 65.0f;
    FAILS(dcd_cast_shapes_submit(world, many, 1, NULL, &query), DCD_ERR_ARGUMENT, "DCD_MAX_SUBMITTED_TURN");
    many[0].turn[1] = 60.0f;
    many[0].flags = DCD_QUERY_LEAVE;
    FAILS(dcd_cast_shapes_submit(world, many, 1, NULL, &query), DCD_ERR_ARGUMENT, "DCD_QUERY_LEAVE");
    many[0].flags = 0;
    HOLDS(query.v == 0);

    /* Each kind of query is fetched by its own call. */
    OK(dcd_cast_shapes_submit(world, many, 1, NULL, &query));
    FAILS(dcd_query_poll(world, query, &ray, 1, &count), DCD_ERR_ARGUMENT, "dcd_query_poll_casts");
    FAILS(dcd_query_poll_overlaps(world, query, &overlap, 1, ends, &count), DCD_ERR_ARGUMENT, "dcd_query_poll_casts");
    POLL(place, dcd_query_poll_casts(world, query, &hit, 1, &count));
    FAILS(dcd_query_poll_casts(world, query, &hit, 1, &count), DCD_ERR_STALE_ID, "query");
    OK(dcd_overlap_shapes_submit(world, around, 1, NULL, &query));
    FAILS(dcd_query_poll_casts(world, query, &hit, 1, &count), DCD_ERR_ARGUMENT, "dcd_query_poll_overlaps");
    OK(dcd_query_cancel(world, query));
    FAILS(dcd_query_poll_overlaps(world, query, &overlap, 1, ends, &count), DCD_ERR_STALE_ID, "query");

    /* Too small a buffer does not close the query. */
    for (int i = 0; i < DCD_MAX_SUBMITTED_COST; i++) {
        all[i] = (DcdBoxQuery)DCD_BOX_QUERY_INIT;
        for (int k = 0; k < 3; k++) {
            all[i].min[k] = -(double)INFINITY;
            all[i].max[k] = (double)INFINITY;
        }
    }
    all[0].min[1] = 1.0;
    all[0].max[1] = 0.0;
    FAILS(dcd_overlap_boxes_submit(world, all, 1, NULL, &query), DCD_ERR_ARGUMENT, "boxes[0]: the box");
    all[0] = all[1];
    OK(dcd_overlap_boxes_submit(world, all, 1, NULL, &query));
    DcdStatus status = DCD_ERR_BUSY;
    for (int tries = 0; status == DCD_ERR_BUSY && tries < 6000; tries++) {
        step(world);
        status = dcd_query_poll_overlaps(world, query, NULL, 0, ends, &count);
    }
    HOLDS(status == DCD_OK && count == BODIES);
    FAILS(dcd_query_poll_overlaps(world, query, &overlap, 1, NULL, &count), DCD_ERR_NULL, "ends");
    FAILS(dcd_query_poll_overlaps(world, query, &overlap, 1, ends, &count), DCD_ERR_SMALL_BUFFER, "room");
    OK(dcd_query_cancel(world, query));

    /* Overlaps beyond what an answer can hold. */
    OK(dcd_overlap_boxes_submit(world, all, DCD_MAX_SUBMITTED_COST, NULL, &query));
    status = DCD_ERR_BUSY;
    for (int tries = 0; status == DCD_ERR_BUSY && tries < 6000; tries++) {
        step(world);
        status = dcd_query_poll_overlaps(world, query, &overlap, 1, ends, &count);
    }
    HOLDS(status == DCD_ERR_LIMIT);
    FAILS(dcd_query_poll_overlaps(world, query, &overlap, 1, ends, &count), DCD_ERR_STALE_ID, "query");

    /* As much as may be open at once. */
    size_t opened = 0;
    while (opened < DCD_MAX_OPEN_COST / DCD_MAX_SUBMITTED_COST)
        OK(dcd_cast_shapes_submit(world, many, MOST_SHAPES, NULL, &open[opened++]));
    FAILS(dcd_overlap_boxes_submit(world, all, 1, NULL, &query), DCD_ERR_BUSY, "open");
    for (size_t i = 0; i < opened; i++) {
        static DcdShapeHit hits[MOST_SHAPES];
        POLL(place, dcd_query_poll_casts(world, open[i], hits, MOST_SHAPES, &count));
        HOLDS(count == MOST_SHAPES);
    }
}

int main(int argc, char **argv)
{
    DcdWorld server = { 0 }, node = { 0 }, client = { 0 }, participant = { 0 };
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdNodeDef computes = DCD_NODE_DEF_INIT;
    DcdClientDef sees_it = DCD_CLIENT_DEF_INIT;
    DcdParticipantDef does_both = DCD_PARTICIPANT_DEF_INIT;
    char address[64] = "", token[512] = "";
    size_t needed = 0;
    if (argc != 2)
        return 2;
    Place here = at(scene());
    same(&here, &here);
    bounds(&here);

    def.data_path = argv[1];
    def.source = here.world;
    def.nodes = 2;
    OK(dcd_server_create(&def, &server));
    OK(dcd_address(server, address, sizeof address, &needed));
    computes.server = sees_it.server = does_both.server = address;
    computes.token = sees_it.token = does_both.token = token;
    does_both.threads = 1;
    OK(dcd_token_create(server, DCD_ROLE_NODE, 60, token, sizeof token, &needed));
    OK(dcd_node_join(&computes, &node));
    OK(dcd_token_create(server, DCD_ROLE_PARTICIPANT, 60, token, sizeof token, &needed));
    OK(dcd_participant_join(&does_both, &participant));
    OK(dcd_token_create(server, DCD_ROLE_CLIENT, 60, token, sizeof token, &needed));
    OK(dcd_client_connect(&sees_it, &client));
    Place apart = at(client), within = at(participant), above = at(server);

    /* The participant computes one of the two regions, the other node the other. */
    bool is_here[2] = { false, false };
    for (int tries = 0; is_here[0] == is_here[1] && tries < 6000; tries++) {
        step(participant);
        for (int i = 0; i < 2; i++) {
            DcdOwner owner = DCD_OWNER_INIT;
            OK(dcd_body_owner(participant, within.bodies[1 + i], &owner));
            is_here[i] = (owner.flags & DCD_OWNER_HERE) != 0;
        }
    }
    HOLDS(is_here[0] != is_here[1]);
    same(&here, &apart);
    same(&here, &within);
    same(&here, &above);
    bounds(&apart);
    bounds(&within);
    bounds(&above);

    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(participant));
    OK(dcd_world_destroy(node));
    OK(dcd_world_destroy(server));
    OK(dcd_world_destroy(here.world));
    return checked();
}
