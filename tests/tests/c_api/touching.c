/* Current contacts with their points, normals and impulses, and the materials of contacts and hits. */
#include "checks.h"

#include <math.h>

enum { ICE = 11, STONE = 22, RUBBER = 33 };

static DcdBodyId body_of(DcdWorld world, DcdBodyType type, DcdShapeId shape, double x, double y, uint64_t material)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId body = { 0 };
    def.body_type = type;
    def.shape = shape;
    def.pose.p[0] = x;
    def.pose.p[1] = y;
    def.material = material;
    def.events = DCD_EVENT_CONTACT | DCD_EVENT_FORCE;
    def.flags = type == DCD_DYNAMIC ? DCD_BODY_NO_SLEEP : 0;
    OK(dcd_body_create(world, &def, &body));
    return body;
}

int main(void)
{
    const float slab[3] = { 20.0f, 0.5f, 20.0f }, half[3] = { 0.5f, 0.5f, 0.5f };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdContactPoint points[32];
    DcdWorld world;
    DcdShapeId flat, cube;
    size_t count = 0, began = 0, pressed = 0;
    double impulse = 0.0;

    def.regions = 2;
    OK(dcd_world_create(&def, &world));
    OK(dcd_shape_box(world, slab, &flat));
    OK(dcd_shape_box(world, half, &cube));
    const DcdBodyId floor = body_of(world, DCD_FIXED, flat, 0.0, -0.5, ICE);
    const DcdBodyId low = body_of(world, DCD_DYNAMIC, cube, 0.1, 0.5, STONE); /* at the border */
    const DcdBodyId high = body_of(world, DCD_DYNAMIC, cube, 0.1, 1.5, RUBBER);
    OK(dcd_body_contacts(world, low, points, 32, &count));
    HOLDS(count == 0);
    for (int i = 0; i < 120; i++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_step(world));
        OK(dcd_events(world, &events));
        for (size_t k = 0; k < events.contact_count; k++) {
            const DcdContact *contact = &events.contacts[k];
            if (contact->kind == DCD_CONTACT_BEGAN) {
                began++;
                HOLDS(contact->material_a == (contact->a.v == floor.v ? ICE : STONE));
                HOLDS(contact->material_b == (contact->a.v == floor.v ? STONE : RUBBER));
            }
        }
        pressed += events.force_count > 0 && events.forces[0].material_a == ICE && events.forces[0].material_b == STONE;
    }
    HOLDS(began == 2 && pressed > 60);

    /* Two tonnes press on the floor, one on the cube below. */
    OK(dcd_body_contacts(world, floor, points, 32, &count));
    HOLDS(count >= 3);
    for (size_t i = 0; i < count; i++) {
        const DcdContactPoint *p = &points[i];
        HOLDS(p->a.v == floor.v && p->b.v == low.v && p->collider_a == 0 && p->collider_b == 0);
        HOLDS(p->material_a == ICE && p->material_b == STONE);
        HOLDS(fabs(p->normal[1] - 1.0) < 1e-3 && fabs(p->point[1]) < 0.02 && fabs(p->point[0] - 0.1) < 0.55);
        HOLDS(fabs(p->separation) < 0.02 && p->impulse >= 0.0f);
        impulse += p->impulse;
    }
    HOLDS(fabs(impulse * 60.0 - 2000.0 * 9.81) < 400.0);
    FAILS(dcd_body_contacts(world, floor, points, 1, &count), DCD_ERR_SMALL_BUFFER, "out has room for 1");
    const size_t with_floor = count;
    OK(dcd_body_contacts(world, high, points, 32, &count));
    const size_t with_high = count;
    impulse = 0.0;
    for (size_t i = 0; i < count; i++)
        impulse += points[i].impulse;
    HOLDS(fabs(impulse * 60.0 - 1000.0 * 9.81) < 200.0);
    OK(dcd_body_contacts(world, low, points, 32, &count));
    HOLDS(count == with_floor + with_high);

    /* Hits have materials too. */
    DcdRay ray = DCD_RAY_INIT;
    DcdRayHit hit;
    ray.origin[0] = 0.1;
    ray.origin[1] = 9.0;
    ray.direction[1] = -1.0f;
    OK(dcd_cast_rays(world, &ray, 1, NULL, &hit));
    HOLDS(hit.body.v == high.v && hit.material == RUBBER);
    ray.origin[0] = 8.0;
    OK(dcd_cast_rays(world, &ray, 1, NULL, &hit));
    HOLDS(hit.material == ICE);
    DcdPointQuery point = DCD_POINT_QUERY_INIT;
    DcdPointHit nearest;
    point.point[0] = 0.1;
    point.point[1] = 2.5;
    OK(dcd_project_points(world, &point, 1, NULL, &nearest));
    HOLDS(nearest.body.v == high.v && nearest.material == RUBBER);
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    DcdShapeHit met;
    cast.shape = cube;
    cast.pose.p[0] = 8.0;
    cast.pose.p[1] = 4.0;
    cast.motion[1] = -9.0f;
    OK(dcd_cast_shapes(world, &cast, 1, NULL, &met));
    HOLDS(met.body.v == floor.v && met.material == ICE);
    DcdPointQuery inside = DCD_POINT_QUERY_INIT;
    DcdOverlap found;
    size_t end;
    inside.point[0] = 0.1;
    inside.point[1] = 0.5;
    OK(dcd_overlap_points(world, &inside, 1, NULL, &found, 1, &end, &count));
    HOLDS(count == 1 && found.body.v == low.v && found.material == STONE);
    DcdColliderProperties as = DCD_COLLIDER_PROPERTIES_INIT;
    OK(dcd_collider_properties(world, low, 0, &as));
    HOLDS(as.user_data == STONE);
    as.user_data = 44;
    OK(dcd_collider_set_properties(world, low, 0, &as));
    OK(dcd_overlap_points(world, &inside, 1, NULL, &found, 1, &end, &count));
    HOLDS(found.material == 44);

    /* Contacts of removed colliders, whose numbers are gone, end with the materials that these colliders had.
     * */
    DcdColliderProperties foot = DCD_COLLIDER_PROPERTIES_INIT;
    const DcdBodyId crab = body_of(world, DCD_DYNAMIC, cube, 8.0, 2.5, RUBBER);
    uint32_t ended = 0, ends = 0;
    foot.events = DCD_EVENT_CONTACT;
    for (uint32_t i = 1; i < 4; i++) {
        foot.frame.p[0] = (float)i - 2.0f;
        foot.frame.p[1] = -2.0f;
        foot.user_data = 100 + i;
        OK(dcd_collider_add(world, crab, cube, &foot, NULL));
    }
    for (int i = 0; i < 60; i++)
        OK(dcd_step(world));
    OK(dcd_collider_remove(world, crab, 2));
    OK(dcd_collider_remove(world, crab, 1));
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    OK(dcd_step(world));
    OK(dcd_events(world, &events));
    for (size_t k = 0; k < events.contact_count; k++) {
        const DcdContact *contact = &events.contacts[k];
        HOLDS(contact->a.v == floor.v && contact->b.v == crab.v && contact->material_a == ICE);
        HOLDS(contact->kind == DCD_CONTACT_ENDED && contact->material_b == 100 + contact->collider_b);
        ends++;
        ended |= 1u << contact->collider_b;
    }
    HOLDS(ends == 2 && ended == (1u << 2 | 1u << 3)); /* number 1 still touches: another collider has that number now */

    /* Misuse. */
    FAILS(dcd_body_contacts(world, low, NULL, 4, &count), DCD_ERR_NULL, "out");
    FAILS(dcd_body_contacts(world, low, points, 32, NULL), DCD_ERR_NULL, "count");
    OK(dcd_body_destroy(world, high));
    FAILS(dcd_body_contacts(world, high, points, 32, &count), DCD_ERR_STALE_ID, "body");
    OK(dcd_body_contacts(world, low, points, 32, &count));
    HOLDS(count == with_floor);
    OK(dcd_world_destroy(world));
    FAILS(dcd_body_contacts(world, low, points, 32, &count), DCD_ERR_STALE_ID, "world");
    return checked();
}
