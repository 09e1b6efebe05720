/* Current contacts with their points, normals and impulses, the materials of contacts and hits, and what characters and wheels
 * stand on. */
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

static DcdCharacterState stance(DcdWorld world, DcdBodyId character)
{
    DcdCharacterState state = DCD_CHARACTER_STATE_INIT;
    OK(dcd_character_state(world, character, &state));
    HOLDS(state.struct_size == sizeof state && state.reserved[0] == 0 && state.ground.reserved == 0);
    return state;
}

/* Somebody lands on a cube, jumps, and lands again. */
static void a_character(DcdWorld world, DcdBodyId cube)
{
    const DcdVelocity jump = { { 0.0f, 4.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }, stand = { { 0.0f }, { 0.0f } };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdCharacterDef walks = DCD_CHARACTER_DEF_INIT;
    DcdCharacterState state;
    DcdBodyId person;
    DcdPose under;
    OK(dcd_body_get(world, cube, &under, NULL));
    def.pose = under;
    def.pose.p[1] += 2.0;
    def.body_type = DCD_KINEMATIC;
    OK(dcd_shape_capsule(world, 0.5f, 0.3f, &def.shape));
    OK(dcd_character_create(world, &def, &walks, &person));
    state = stance(world, person);
    HOLDS(!state.grounded && !state.sliding && state.ground.body.v == 0 && state.ground.slope == 0.0f);
    for (int i = 0; i < 60; i++)
        OK(dcd_step(world));
    state = stance(world, person);
    HOLDS(state.grounded && !state.sliding && state.ground.body.v == cube.v && state.ground.collider == 0);
    HOLDS(state.ground.material == RUBBER && state.ground.slope < 0.02f && state.ground.normal[1] > 0.999f);
    HOLDS(fabs(state.ground.point[1] - under.p[1] - 0.5) < 0.03 && fabs(state.ground.point[0] - under.p[0]) < 0.05);
    OK(dcd_body_set_velocity(world, person, &jump));
    OK(dcd_step(world));
    OK(dcd_body_set_velocity(world, person, &stand));
    for (int i = 0; i < 10; i++)
        OK(dcd_step(world));
    state = stance(world, person);
    HOLDS(!state.grounded && !state.sliding && state.ground.body.v == 0 && state.ground.material == 0);
    FAILS(dcd_character_state(world, person, NULL), DCD_ERR_NULL, "out");
    FAILS(dcd_character_state(world, cube, &state), DCD_ERR_ARGUMENT, "no character");
    state.struct_size = 8;
    FAILS(dcd_character_state(world, person, &state), DCD_ERR_STRUCT, "DcdCharacterState");
    OK(dcd_body_destroy(world, person));
    state.struct_size = sizeof state;
    FAILS(dcd_character_state(world, person, &state), DCD_ERR_STALE_ID, "body");
}

/* A car stands on its wheels, rolls off to the left, and is lifted off the ground. */
static void wheels_of_a_car(DcdWorld world, DcdBodyId floor)
{
    const float half[3] = { 1.6f, 0.4f, 0.8f };
    const DcdDrive left = { 0.5f, 0.0f, 1.0f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdVehicleDef vehicle = DCD_VEHICLE_DEF_INIT;
    DcdWheelState wheels[4], before[4];
    DcdBodyId car;
    DcdPose pose;
    size_t count = 0;
    def.density = 250.0f;
    def.pose.p[0] = -8.0;
    def.pose.p[1] = 1.0;
    def.pose.p[2] = 8.0;
    OK(dcd_shape_box(world, half, &def.shape));
    OK(dcd_vehicle_create(world, &def, &vehicle, &car));
    for (int i = 0; i < 45; i++)
        OK(dcd_step(world));
    OK(dcd_vehicle_wheels(world, car, NULL, 0, &count));
    HOLDS(count == 4);
    OK(dcd_vehicle_wheels(world, car, before, 4, &count));
    for (int i = 0; i < 4; i++) {
        const DcdWheelState *wheel = &before[i];
        HOLDS(wheel->ground.body.v == floor.v && wheel->ground.material == ICE && wheel->ground.slope < 0.01f);
        HOLDS(fabs(wheel->pose.p[1] - 0.35) < 0.01 && fabs(wheel->ground.point[1]) < 0.01 && wheel->ground.normal[1] > 0.999f);
        HOLDS(wheel->suspension > 0.1f && wheel->suspension < 0.3f && wheel->steering == 0.0f && fabsf(wheel->rolled) < 0.1f);
        HOLDS(fabs(wheel->pose.p[0] - (i < 2 ? -6.8 : -9.2)) < 0.1 && fabs(wheel->pose.p[2] - (i % 2 ? 8.8 : 7.2)) < 0.1);
    }
    OK(dcd_vehicle_drive(world, car, &left));
    for (int i = 0; i < 30; i++)
        OK(dcd_step(world));
    OK(dcd_vehicle_wheels(world, car, wheels, 4, &count));
    for (int i = 0; i < 4; i++) {
        HOLDS(wheels[i].spin > 0.5f && wheels[i].rolled > before[i].rolled + 0.1f);
        HOLDS(fabsf(wheels[i].steering - (i < 2 ? 0.6f : 0.0f)) < 1e-3f);
    }
    OK(dcd_body_get(world, car, &pose, NULL));
    pose.p[1] += 3.0;
    OK(dcd_body_set_pose(world, car, &pose));
    OK(dcd_vehicle_wheels(world, car, wheels, 4, &count));
    HOLDS(wheels[3].ground.body.v == 0 && wheels[3].ground.slope == 0.0f && wheels[3].suspension == 0.3f);
    FAILS(dcd_vehicle_wheels(world, car, wheels, 3, &count), DCD_ERR_SMALL_BUFFER, "out has room for 3");
    FAILS(dcd_vehicle_wheels(world, car, NULL, 4, &count), DCD_ERR_NULL, "out");
    FAILS(dcd_vehicle_wheels(world, car, wheels, 4, NULL), DCD_ERR_NULL, "count");
    FAILS(dcd_vehicle_wheels(world, floor, wheels, 4, &count), DCD_ERR_ARGUMENT, "no vehicle");
    OK(dcd_body_destroy(world, car));
    FAILS(dcd_vehicle_wheels(world, car, wheels, 4, &count), DCD_ERR_STALE_ID, "body");
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
    OK(dcd_body_destroy(world, crab));
    a_character(world, high);
    wheels_of_a_car(world, floor);

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
