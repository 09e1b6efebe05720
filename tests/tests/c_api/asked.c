/* Functions that a world asks about contacts: which bodies pass through each other, what a sensor detects,
 * one-way floors, belts, ice. */
#include "checks.h"

#include <math.h>
#include <pthread.h>

enum { GHOST = 1, PLAIN = 2, BELT = 3, DOOR = 4, ICE = 5 };

/* What the functions saw. Several threads write it. */
typedef struct Seen {
    pthread_mutex_t lock;
    DcdWorld world;
    size_t filtered, detected, modified;
    DcdStatus inside;
    bool ok;
} Seen;

static bool is(const DcdHookedPair *pair, uint64_t user)
{
    return pair->user_a == user || pair->user_b == user;
}

static DcdPairAnswer on_filter(void *context, const DcdHookedPair *pair)
{
    Seen *seen = context;
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    const DcdStatus inside = dcd_world_info(seen->world, &info);
    const bool valid = dcd_body_is_valid(seen->world, pair->a); /* always false from within */
    pthread_mutex_lock(&seen->lock);
    seen->filtered++;
    seen->inside = inside;
    seen->ok = seen->ok && !valid && pair->a.v != pair->b.v && pair->collider_a == 0 && isfinite(pair->pose_a.p[1]) &&
               (pair->user_a != BELT || pair->material_a == 77);
    pthread_mutex_unlock(&seen->lock);
    return is(pair, GHOST) ? DCD_MEET_NOT : DCD_MEET_PUSH;
}

static bool on_detect(void *context, const DcdHookedPair *pair)
{
    Seen *seen = context;
    pthread_mutex_lock(&seen->lock);
    seen->detected++;
    pthread_mutex_unlock(&seen->lock);
    return !is(pair, GHOST);
}

static void on_modify(void *context, const DcdHookedPair *pair, DcdHookedContact *contact)
{
    Seen *seen = context;
    pthread_mutex_lock(&seen->lock);
    seen->modified++;
    seen->ok = seen->ok && contact->points >= 1 && contact->enabled == 1 && fabs(contact->normal[1] - 1.0) < 1e-3;
    pthread_mutex_unlock(&seen->lock);
    if (is(pair, DOOR))
        contact->enabled = 0;
    else if (is(pair, ICE))
        contact->friction = 0.0f;
    else
        contact->surface_velocity[0] = 2.0f;
}

static DcdBodyId cube_at(DcdWorld world, double x, double y, uint64_t user, uint32_t hooks)
{
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId body = { 0 };
    OK(dcd_shape_box(world, half, &def.shape));
    def.pose.p[0] = x;
    def.pose.p[1] = y;
    def.user_data = user;
    def.hooks = hooks;
    OK(dcd_body_create(world, &def, &body));
    return body;
}

static DcdPose pose_of(DcdWorld world, DcdBodyId body)
{
    DcdPose pose;
    OK(dcd_body_get(world, body, &pose, NULL));
    return pose;
}

int main(void)
{
    const float slab[3] = { 30.0f, 0.5f, 30.0f }, gate_half[3] = { 2.0f, 2.0f, 2.0f };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef floor_def = DCD_BODY_DEF_INIT, gate_def = DCD_BODY_DEF_INIT;
    DcdHooks hooks = DCD_HOOKS_INIT;
    DcdBodyId floor, gate;
    size_t entered = 0;
    static Seen seen = { PTHREAD_MUTEX_INITIALIZER, { 0 }, 0, 0, 0, DCD_OK, true };

    def.regions = 2;
    def.threads = 2;
    OK(dcd_world_create(&def, &seen.world));
    const DcdWorld world = seen.world;
    floor_def.body_type = DCD_FIXED;
    floor_def.pose.p[1] = -0.5;
    floor_def.user_data = BELT;
    floor_def.material = 77;
    floor_def.hooks = DCD_HOOK_FILTER | DCD_HOOK_MODIFY;
    OK(dcd_shape_box(world, slab, &floor_def.shape));
    OK(dcd_body_create(world, &floor_def, &floor));
    gate_def.body_type = DCD_FIXED;
    gate_def.pose.p[0] = -10.0;
    gate_def.pose.p[1] = 2.0;
    gate_def.flags = DCD_BODY_SENSOR;
    gate_def.events = DCD_EVENT_CONTACT;
    gate_def.hooks = DCD_HOOK_DETECT;
    OK(dcd_shape_box(world, gate_half, &gate_def.shape));
    OK(dcd_body_create(world, &gate_def, &gate));
    const DcdBodyId ghost = cube_at(world, -10.0, 1.0, GHOST, 0), rider = cube_at(world, 5.0, 0.5, PLAIN, 0);
    const DcdBodyId thief = cube_at(world, 10.0, 0.5, DOOR, 0), slider = cube_at(world, -5.0, 0.5, ICE, 0);
    const DcdBodyId guest = cube_at(world, -10.5, 3.0, PLAIN, 0);
    const DcdVelocity slow = { { 3.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };

    hooks.context = &seen;
    hooks.filter = on_filter;
    hooks.detect = on_detect;
    hooks.modify = on_modify;
    OK(dcd_hooks_set(world, &hooks));
    OK(dcd_body_set_velocity(world, slider, &slow));
    for (int i = 0; i < 60; i++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        OK(dcd_step(world));
        OK(dcd_events(world, &events));
        for (size_t k = 0; k < events.contact_count; k++) {
            entered += events.contacts[k].kind == DCD_CONTACT_BEGAN;
            HOLDS(events.contacts[k].a.v != ghost.v && events.contacts[k].b.v != ghost.v);
        }
    }
    HOLDS(seen.ok && seen.filtered > 0 && seen.detected > 0 && seen.modified > 60 && seen.inside == DCD_ERR_BUSY);
    HOLDS(entered == 1); /* the guest, and not the ghost */
    HOLDS(pose_of(world, ghost).p[1] < -2.0 && pose_of(world, thief).p[1] < -2.0);
    HOLDS(pose_of(world, rider).p[1] > 0.45 && pose_of(world, rider).p[0] > 6.0 && pose_of(world, rider).p[0] < 7.1);
    HOLDS(fabs(pose_of(world, slider).p[0] - -2.0) < 0.1); /* 3 m in a second, without friction */
    HOLDS(dcd_body_is_valid(world, guest));

    /* Without functions, contacts are as the bodies' definitions say. */
    const size_t before = seen.modified;
    DcdVelocity velocity;
    OK(dcd_hooks_set(world, NULL));
    for (int i = 0; i < 60; i++)
        OK(dcd_step(world));
    OK(dcd_body_get(world, slider, NULL, &velocity));
    HOLDS(seen.modified == before && fabs(velocity.linear[0]) < 0.05);
    DcdColliderProperties as = DCD_COLLIDER_PROPERTIES_INIT;
    OK(dcd_collider_properties(world, floor, 0, &as));
    HOLDS(as.hooks == (DCD_HOOK_FILTER | DCD_HOOK_MODIFY));
    as.hooks = 0;
    OK(dcd_collider_set_properties(world, floor, 0, &as));
    OK(dcd_hooks_set(world, &hooks));
    OK(dcd_step(world));
    HOLDS(seen.modified == before);

    /* Misuse. */
    FAILS(dcd_hooks_set((DcdWorld){ 0 }, &hooks), DCD_ERR_NULL, "world");
    hooks.reserved = 1;
    FAILS(dcd_hooks_set(world, &hooks), DCD_ERR_ARGUMENT, "reserved");
    hooks.reserved = 0;
    hooks.struct_size = 8;
    FAILS(dcd_hooks_set(world, &hooks), DCD_ERR_STRUCT, "DcdHooks");
    as.hooks = 8;
    FAILS(dcd_collider_set_properties(world, floor, 0, &as), DCD_ERR_ARGUMENT, "hooks");
    OK(dcd_world_destroy(world));
    FAILS(dcd_hooks_set(world, NULL), DCD_ERR_STALE_ID, "world");
    return checked();
}
