/* Makes random calls on valid and stale handles, with valid and invalid numbers: none may crash or find a bug
 * of ours. The first argument is the seed, the second the number of calls. */
#include "dcd.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WORLDS = 4, KEPT = 32, MANY = 3 };

static uint64_t state;

/* xorshift64*, so that a seed gives the same numbers everywhere. */
static uint32_t dice(uint32_t sides)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (uint32_t)((state * UINT64_C(2685821657736338717)) >> 33) % sides;
}

static float number(void)
{
    static const float odd[] = { 0.0f, -1.0f, NAN, INFINITY, -INFINITY, 1e-30f, 1e30f, 3.4e38f };
    return dice(12) == 0 ? odd[dice(sizeof odd / sizeof odd[0])] : (float)dice(1000) / 100.0f - 2.0f;
}

static float size(void)
{
    return dice(20) == 0 ? number() : 0.2f + (float)dice(100) / 100.0f;
}

static uint64_t handle(uint64_t kept)
{
    return dice(30) == 0 ? kept ^ (UINT64_C(1) << dice(64)) : dice(60) == 0 ? 0 : kept;
}

static DcdWorld worlds[WORLDS];
static DcdShapeId shapes[KEPT];
static DcdBodyId bodies[KEPT];
static DcdJointId joints[KEPT];
static DcdQueryId queries[KEPT];

static DcdPose some_pose(void)
{
    DcdPose pose = { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    for (int i = 0; i < 3; i++) {
        pose.p[i] = (double)number();
    }
    if (dice(4) == 0) {
        pose.q[0] = 0.6f;
        pose.q[3] = dice(20) == 0 ? number() : 0.8f;
    }
    return pose;
}

static DcdVelocity some_velocity(void)
{
    DcdVelocity velocity;
    for (int i = 0; i < 3; i++) {
        velocity.linear[i] = number();
        velocity.angular[i] = number();
    }
    return velocity;
}

static DcdJointMotor some_motor(void)
{
    DcdJointMotor motor = DCD_JOINT_MOTOR_INIT;
    motor.position = number();
    motor.velocity = number();
    motor.stiffness = dice(2) ? 0.0f : number();
    motor.damping = dice(2) ? 10.0f : number();
    motor.max_force = dice(2) ? motor.max_force : number();
    motor.model = dice(20) == 0 ? dice(4) : dice(2);
    return motor;
}

static DcdBodyDef some_body(void)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    def.shape.v = handle(shapes[dice(KEPT)].v);
    def.body_type = dice(6) == 0 ? dice(5) : DCD_DYNAMIC;
    def.pose = some_pose();
    def.density = dice(4) == 0 ? number() : def.density;
    def.restitution = dice(4) == 0 ? number() : def.restitution;
    def.flags = dice(8) == 0 ? dice(260) : 0;
    def.mass = dice(8) == 0 ? number() : 0.0f;
    def.friction_rule = dice(8) == 0 ? dice(7) : 0;
    def.contact_skin = dice(8) == 0 ? number() * 0.1f : 0.0f;
    def.solver_mask = dice(8) == 0 ? dice(3) : def.solver_mask;
    def.pairs = dice(8) == 0 ? dice(65) : def.pairs;
    def.dominance = dice(8) == 0 ? (int32_t)dice(300) - 150 : 0;
    def.soft_ccd = dice(8) == 0 ? number() : 0.0f;
    def.sleep_after = dice(8) == 0 ? number() : def.sleep_after;
    def.extra_mass = dice(8) == 0 ? number() : 0.0f;
    def.extra_centre[1] = def.extra_mass != 0.0f && dice(2) ? number() : 0.0f;
    def.extra_inertia[dice(3)] = def.extra_mass != 0.0f && dice(2) ? number() : 0.0f;
    def.extra_solver_iterations = dice(8) == 0 ? dice(4) : 0;
    def.locked = dice(8) == 0 ? dice(70) : 0;
    def.events = dice(4);
    def.mask = dice(8) == 0 ? dice(3) : def.mask;
    def.struct_size -= dice(50) == 0;
    return def;
}

/* Makes any query. Its results must be numbers. */
static DcdStatus ask(DcdWorld world, DcdBodyId named, DcdShapeId shape)
{
    DcdFilter filter = DCD_FILTER_INIT;
    size_t ends[MANY], total;
    DcdStatus status;
    double sum = 0.0;
    filter.flags = dice(4) == 0 ? dice(33) : 0;
    filter.groups = dice(4) == 0 ? dice(4) : 0;
    filter.mask = dice(4) == 0 ? dice(4) : filter.mask;
    filter.exclude = &bodies[dice(KEPT - MANY)];
    filter.exclude_count = dice(4) == 0 ? dice(MANY) : 0;
    const DcdFilter *given = dice(2) ? &filter : NULL;
    switch (dice(5)) {
    case 0: {
        DcdRay rays[MANY];
        DcdRayHit hits[8];
        size_t cap = dice(9);
        for (int i = 0; i < MANY; i++) {
            rays[i] = (DcdRay)DCD_RAY_INIT;
            rays[i].origin[1] = (double)number();
            rays[i].direction[dice(3)] = number();
            rays[i].direction[1] = number();
            rays[i].max_distance = dice(2) ? 100.0f : number();
            rays[i].exclude = dice(3) == 0 ? named : rays[i].exclude;
            rays[i].flags = dice(3);
        }
        if (dice(2)) {
            DcdQueryId *query = &queries[dice(KEPT)];
            query->v = handle(query->v);
            return dice(2)   ? dcd_cast_rays_submit(world, rays, dice(MANY + 1), given, query)
                   : dice(8) ? dcd_query_poll(world, *query, hits, cap, &total)
                             : dcd_query_cancel(world, *query);
        }
        status = dice(2) ? dcd_cast_rays(world, rays, MANY, given, hits)
                         : dcd_cast_rays_all(world, rays, MANY, given, hits, cap, ends, &total);
        break;
    }
    case 1: {
        DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
        DcdShapeHit hit;
        cast.shape.v = handle(shape.v);
        cast.pose = some_pose();
        cast.motion[dice(3)] = number();
        cast.turn[dice(3)] = dice(2) ? number() : 0.0f;
        cast.margin = dice(3) == 0 ? number() : 0.0f;
        cast.flags = dice(4);
        if (dice(3) == 0) {
            DcdQueryId *query = &queries[dice(KEPT)];
            query->v = handle(query->v);
            return dice(2) ? dcd_cast_shapes_submit(world, &cast, 1, given, query)
                           : dcd_query_poll_casts(world, *query, &hit, 1, &total);
        }
        status = dcd_cast_shapes(world, &cast, 1, given, &hit);
        sum = status == DCD_OK ? hit.point[0] + (double)hit.fraction + (double)hit.normal[1] : 0.0;
        break;
    }
    case 2: {
        DcdPointQuery point = DCD_POINT_QUERY_INIT;
        DcdPointHit hit;
        DcdOverlap found[4];
        point.point[dice(3)] = (double)number();
        point.max_distance = dice(2) ? point.max_distance : number();
        point.flags = dice(3);
        if (dice(2)) {
            return dcd_overlap_points(world, &point, 1, given, found, dice(5), ends, &total);
        }
        status = dcd_project_points(world, &point, 1, given, &hit);
        sum = status == DCD_OK ? hit.point[0] + (double)hit.distance : 0.0;
        break;
    }
    case 3: {
        DcdShapeQuery query = DCD_SHAPE_QUERY_INIT;
        DcdOverlap found[4];
        query.shape.v = handle(shape.v);
        query.pose = some_pose();
        if (dice(3) == 0) {
            DcdQueryId *asked = &queries[dice(KEPT)];
            asked->v = handle(asked->v);
            return dice(2) ? dcd_overlap_shapes_submit(world, &query, 1, given, asked)
                           : dcd_query_poll_overlaps(world, *asked, found, dice(5), ends, &total);
        }
        status = dcd_overlap_shapes(world, &query, 1, given, found, dice(5), ends, &total);
        break;
    }
    default: {
        DcdBoxQuery query = DCD_BOX_QUERY_INIT;
        DcdOverlap found[4];
        for (int i = 0; i < 3; i++) {
            query.min[i] = (double)number() - 5.0;
            query.max[i] = (double)number();
        }
        status = dcd_overlap_boxes(world, &query, 1, given, found, dice(5), ends, &total);
    }
    }
    return isnan(sum) ? DCD_ERR_PANIC : status;
}

/* What is drawn must have finite positions: the context becomes NaN if one is NaN. */
static void add_line(void *context, const double *from, const double *to, uint32_t colour)
{
    (void)colour;
    for (int i = 0; i < 3; i++)
        if (isnan(from[i]) || isnan(to[i]))
            *(double *)context = NAN;
}

static void add_text(void *context, const double *at, const char *text, uint32_t colour)
{
    add_line(context, at, at, colour + (uint32_t)strlen(text));
}

static DcdStatus play(void)
{
    DcdWorld world = { handle(worlds[dice(WORLDS)].v) };
    DcdBodyId *body = &bodies[dice(KEPT)];
    DcdShapeId *shape = &shapes[dice(KEPT)];
    DcdJointId *joint = &joints[dice(KEPT)];
    DcdBodyId named = { handle(body->v) }, list[MANY];
    DcdStatus each[MANY];
    DcdPose pose = some_pose(), poses[MANY];
    DcdVelocity velocity = some_velocity();
    float three[3] = { size(), size(), size() };
    float points[24];
    uint32_t indices[12];
    for (int i = 0; i < MANY; i++) {
        list[i].v = handle(bodies[dice(KEPT)].v);
        poses[i] = some_pose();
    }
    for (int i = 0; i < 24; i++) {
        points[i] = number();
    }
    for (int i = 0; i < 12; i++) {
        indices[i] = dice(dice(10) == 0 ? 20 : 8);
    }

    switch (dice(40)) {
    case 0:
        if (dice(20) == 0) {
            DcdWorld *place = &worlds[dice(WORLDS)];
            DcdWorldDef def = DCD_WORLD_DEF_INIT;
            dcd_world_destroy(*place);
            def.regions = dice(6);
            def.threads = 1;
            def.gravity[1] = dice(10) == 0 ? number() : -9.81f;
            def.max[0] = dice(10) == 0 ? (double)number() : def.max[0];
            return dcd_world_create(&def, place);
        }
        return DCD_OK;
    case 1:
        return dcd_shape_box(world, three, shape);
    case 2:
        return dcd_shape_sphere(world, three[0], shape);
    case 3:
        return dice(2) ? dcd_shape_capsule(world, three[0], three[1], shape)
                       : dcd_shape_cylinder(world, three[0], three[1], shape);
    case 4:
        return dcd_shape_hull(world, points, dice(9), shape);
    case 5:
        return dcd_shape_mesh(world, points, 8, indices, dice(5), dice(2), shape);
    case 6:
        return dcd_shape_heightfield(world, points, dice(5), dice(6), three, shape);
    case 7: {
        DcdFrame frames[2] = { { { number(), 0, 0 }, { 0, 0, 0, 1 } }, { { 0, number(), 0 }, { 0, 0, 0, 1 } } };
        return dcd_shape_compound(world, &shapes[dice(KEPT - 1)], frames, dice(3), shape);
    }
    case 8:
        return dcd_shape_destroy(world, *shape);
    case 9:
    case 10:
    case 11: {
        DcdBodyDef def = some_body();
        if (dice(4) == 0) {
            DcdCharacterDef character = DCD_CHARACTER_DEF_INIT;
            def.body_type = DCD_KINEMATIC;
            character.gap = dice(2) ? character.gap : number();
            return dcd_character_create(world, &def, &character, body);
        }
        if (dice(4) == 0) {
            DcdVehicleDef vehicle = DCD_VEHICLE_DEF_INIT;
            DcdWheel wheel = DCD_WHEEL_INIT;
            DcdDrive drive = { 1.0f, 0.0f, number() };
            wheel.radius = dice(2) ? wheel.radius : number();
            vehicle.wheel_count = dice(2);
            vehicle.wheels = vehicle.wheel_count ? &wheel : NULL;
            def.body_type = DCD_DYNAMIC;
            DcdStatus made = dcd_vehicle_create(world, &def, &vehicle, body);
            if (made == DCD_OK)
                (void)dcd_vehicle_drive(world, *body, &drive);
            return made;
        }
        if (dice(4) == 0) {
            DcdCharacterState state = DCD_CHARACTER_STATE_INIT;
            DcdWheelState wheels[2];
            size_t wheel_count;
            (void)dcd_character_state(world, named, &state);
            return dcd_vehicle_wheels(world, named, wheels, dice(3), &wheel_count);
        }
        return dcd_body_create(world, &def, body);
    }
    case 12: {
        DcdBodyDef defs[MANY];
        for (int i = 0; i < MANY; i++) {
            defs[i] = some_body();
        }
        return dcd_bodies_create(world, defs, MANY, &bodies[dice(KEPT - MANY)]);
    }
    case 13:
        return dcd_bodies_destroy(world, list, dice(MANY + 1));
    case 14:
        return dcd_body_set_pose(world, named, &pose);
    case 15:
        return dcd_body_set_velocity(world, named, &velocity);
    case 16:
        return dcd_body_apply_impulse(world, named, velocity.linear, dice(2) ? pose.p : NULL);
    case 17:
        return dcd_body_set_force(world, named, dice(2) ? velocity.linear : NULL, dice(2) ? velocity.angular : NULL);
    case 18:
        return dice(2) ? dcd_body_wake(world, named) : dcd_body_sleep(world, named);
    case 19: {
        DcdJointDef def = DCD_JOINT_DEF_INIT;
        def.joint_type = dice(8);
        def.a = named;
        def.b = list[0];
        def.frame_b.p[0] = number();
        def.flags = dice(17);
        def.limit[0] = dice(2) ? 0.0f : number();
        def.limit[1] = number();
        def.motor = some_motor();
        if (def.joint_type == DCD_JOINT_GENERIC) {
            def.flags &= ~(DCD_JOINT_LIMIT | DCD_JOINT_MOTOR);
            def.locked = dice(65);
            def.coupled = dice(4) == 0 ? dice(65) & ~def.locked : 0;
        }
        return dcd_joint_create(world, &def, joint);
    }
    case 20: {
        float limit[2] = { dice(2) ? 0.0f : number(), number() };
        DcdJointMotor motor = some_motor();
        DcdJointInfo info = DCD_JOINT_INFO_INIT;
        DcdFrame frame = { { number(), 0.0f, number() }, { 0.0f, 0.0f, 0.0f, 1.0f } };
        switch (dice(6)) {
        case 0:
            return dcd_joint_set_limit(world, *joint, dice(7), dice(4) ? limit : NULL);
        case 1:
            return dcd_joint_set_frames(world, *joint, dice(2) ? &frame : NULL, dice(2) ? &frame : NULL);
        case 2:
            return dcd_joint_set_flags(world, *joint, dice(4) * 4);
        case 3:
            return dcd_joint_set_softness(world, *joint, number(), number());
        case 4: {
            DcdStatus status = dcd_joint_info(world, *joint, &info);
            return status == DCD_OK && isnan(info.position) ? DCD_ERR_PANIC : status;
        }
        default:
            return dcd_joint_set_motor(world, *joint, dice(7), dice(4) ? &motor : NULL);
        }
    }
    case 21: {
        size_t count;
        return dice(2) ? dcd_joint_destroy(world, *joint) : dcd_body_joints(world, named, &joints[dice(KEPT - 1)], 1, &count);
    }
    case 22: {
        DcdStateView view = DCD_STATE_VIEW_INIT;
        double sum = 0.0;
        DcdViewTime time = DCD_VIEW_TIME_INIT;
        DcdStatus status = dice(2) ? dcd_state_view(world, &view) : dcd_view_time(world, &time);
        if (dice(3) == 0) {
            time.shown += (double)number();
            status = dcd_view_state(world, &time, &view);
        }
        if (dice(3) == 0) {
            DcdDebugDraw draw = DCD_DEBUG_DRAW_INIT;
            draw.flags = dice(4096);
            draw.context = &sum;
            draw.draw_line = add_line;
            draw.draw_box = dice(2) ? add_line : NULL;
            draw.draw_text = add_text;
            draw.max[dice(3)] = (double)number();
            status = dcd_debug_draw(world, dice(2) ? &time : NULL, &draw);
        }
        for (size_t i = 0; i < view.count; i++) {
            sum += view.poses[i].p[0] + (double)view.velocities[i].linear[0] + (double)view.flags[i];
        }
        return isnan(sum) ? DCD_ERR_PANIC : status; /* no NaN comes out, whatever goes in */
    }
    case 23: {
        DcdEventView view = DCD_EVENT_VIEW_INIT;
        return dcd_events(world, &view);
    }
    case 24:
        return dcd_state_read(world, list, MANY, dice(6), poses, sizeof poses[0], dice(2) ? each : NULL);
    case 25:
        return dcd_state_write(world, list, MANY, dice(6), poses, sizeof poses[0], dice(2) ? each : NULL);
    case 26:
        return ask(world, named, *shape);
    case 27:
        return dcd_body_set_events(world, named, dice(2), dice(5), number());
    case 28:
        return dcd_body_set_material(world, named, dice(2) ? DCD_ALL_COLLIDERS : dice(2), number(), number());
    case 29:
        return dcd_body_set_groups(world, named, 0, dice(4), dice(4));
    case 30: {
        DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
        DcdStatus status = dcd_body_properties(world, named, &as);
        if (status != DCD_OK) {
            return status;
        }
        switch (dice(7)) {
        case 0:
            as.body_type = dice(5);
            break;
        case 1:
            as.flags ^= 1u << dice(8);
            break;
        case 2:
            as.locked = dice(65);
            break;
        case 3:
            as.extra_mass = number();
            break;
        case 4:
            as.gravity_scale = number();
            break;
        case 5:
            as.sleep_linear = number();
            break;
        default:
            as.linear_damping = number();
            as.dominance = (int32_t)dice(5) - 2;
        }
        return dcd_body_set_properties(world, named, &as);
    }
    case 31: {
        DcdColliderProperties as = DCD_COLLIDER_PROPERTIES_INIT;
        uint32_t part = dice(2);
        switch (dice(6)) {
        case 0:
            as.frame.p[dice(3)] = number();
            as.mass = dice(2) ? number() : 0.0f;
            return dcd_collider_add(world, named, *shape, dice(4) ? &as : NULL, dice(2) ? &part : NULL);
        case 1:
            return dcd_collider_remove(world, named, part);
        case 2:
            return dcd_collider_set_shape(world, named, part, *shape);
        default: {
            DcdStatus status = dcd_collider_properties(world, named, part, &as);
            if (status != DCD_OK) {
                return status;
            }
            as.flags ^= dice(8);
            as.frame.p[0] = dice(4) ? as.frame.p[0] : number();
            as.density = dice(4) ? as.density : number();
            as.mass = dice(4) ? as.mass : number();
            as.pairs = dice(4) ? as.pairs : dice(64);
            as.contact_skin = dice(4) ? as.contact_skin : number() * 0.1f;
            return dcd_collider_set_properties(world, named, part, &as);
        }
        }
    }
    case 32:
        return dice(2) ? dcd_body_set_target(world, named, &pose)
                       : dcd_body_add_force(world, named, velocity.linear, dice(2) ? pose.p : NULL);
    case 33:
        return dice(2) ? dcd_step_begin(world) : dcd_step_wait(world, dice(2) ? DCD_FOREVER : 0);
    case 34: {
        static char saved[1 << 20];
        static size_t size;
        saved[dice(sizeof saved)] ^= dice(4) == 0;
        static DcdCheckpointId kept;
        if (dice(2)) {
            switch (dice(4)) {
            case 0:
                return dcd_checkpoint_create(world, &kept);
            case 1:
                return dcd_checkpoint_save(world, kept);
            case 2:
                return dcd_checkpoint_restore(world, kept);
            default:
                return dcd_checkpoint_destroy(world, kept);
            }
        }
        return dice(3) == 0 ? dcd_snapshot_save(world, saved, sizeof saved, &size) : dcd_snapshot_load(world, saved, size);
    }
    case 35: {
        DcdOwner owner = DCD_OWNER_INIT;
        DcdBorderInfo borders[4];
        size_t count;
        if (dice(2)) {
            DcdExplosion blast = DCD_EXPLOSION_INIT;
            DcdFluid fluid = DCD_FLUID_INIT;
            DcdBodyId inside[4];
            memcpy(blast.centre, pose.p, sizeof blast.centre);
            blast.radius = number();
            blast.impulse = number();
            fluid.surface = (double)number();
            fluid.density = number();
            return dice(3) == 0 ? dcd_explode(world, &blast, dice(2) ? &count : NULL)
                   : dice(2)    ? dcd_flow(world, &fluid, dice(2) ? &count : NULL)
                                : dcd_sensor_bodies(world, named, dice(3), inside, dice(5), &count);
        }
        return dice(3) ? dcd_body_owner(world, named, &owner)
               : dice(3) == 0 ? dcd_bandwidth_set(world, dice(100000))
               : dice(3) == 0 ? dcd_prediction_set(world, dice(2) == 0)
               : dice(2) ? dcd_borders(world, borders, dice(5), &count)
                         : dcd_interest_set(world, dice(2) ? pose.p : NULL, (double)number());
    }
    case 36: {
        DcdConnectionId any = { dice(2) ? named.v : dice(3) };
        DcdConnectionInfo is = DCD_CONNECTION_INFO_INIT;
        size_t count;
        switch (dice(5)) {
        case 0:
            return dcd_connections(world, &any, dice(2), &count);
        case 1:
            return dcd_connection_info(world, any, &is);
        case 2:
            return dcd_disconnect(world, any, dice(2) ? "go" : NULL);
        case 3:
            return dcd_send(world, any, dice(2) ? &is : NULL, dice(2) ? dice(sizeof is) : DCD_MAX_MESSAGE + 1, dice(3));
        default:
            return dcd_poll(world, dice(2));
        }
    }
    default:
        return dcd_step(world);
    }
}

int main(int count, char **texts)
{
    unsigned long calls = count > 2 ? strtoul(texts[2], NULL, 10) : 10000;
    unsigned long good = 0;
    state = count > 1 ? strtoull(texts[1], NULL, 10) : 1;
    state = state * 2 + 1; /* never 0 */
    for (int i = 0; i < WORLDS; i++) {
        DcdWorldDef def = DCD_WORLD_DEF_INIT;
        def.regions = (uint32_t)i + 1;
        def.threads = 1;
        if (dcd_world_create(&def, &worlds[i]) != DCD_OK) {
            return EXIT_FAILURE;
        }
    }
    for (unsigned long call = 0; call < calls; call++) {
        DcdStatus status = play();
        good += status == DCD_OK;
        if (status == DCD_ERR_PANIC || status > DCD_OK || status < DCD_ERR_LIMIT) {
            char message[1024] = "";
            dcd_last_error(message, sizeof message);
            /* A fault of Rapier's debug builds, described in dcd/RAPIER.md: the worlds cannot go on, but dcd
             * has no bug. */
            if (strstr(message, "force-event pair list diverged")) {
                printf("call %lu: ended by Rapier's %s\n", call, message);
                return EXIT_SUCCESS;
            }
            printf("call %lu: %s: %s\n", call, dcd_status_string(status), message);
            return EXIT_FAILURE;
        }
    }
    for (int i = 0; i < WORLDS; i++) {
        dcd_world_destroy(worlds[i]);
    }
    printf("%lu calls, %lu of them good\n", calls, good);
    return EXIT_SUCCESS;
}
