/* Calls every function that takes a world on a world of each role: `table FOLDER` writes a line for each
 * function, with the results for a local world, a client, a participant, a builder, a server and a node.
 * table.rs compares the lines with the page. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <time.h>

/* One role's world, and the arguments for its functions. */
typedef struct Scene {
    DcdWorld world;
    DcdShapeId shape;
    /* A body of its own, and one of others; the same body where there are no others. */
    DcdBodyId own, other;
    DcdBodyId body; /* the body of the present call */
    DcdJointId joint;
} Scene;

/* There is no object for which the function could be called. */
#define NOTHING 1

static const float ONE[3] = { 1.0f, 1.0f, 1.0f };
static DcdFrame HERE = { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } };
static DcdPose PLACE = { { 0.0, 30.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
static size_t count;

static DcdStatus body(Scene *s, DcdBodyId *out)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    def.shape = s->shape;
    def.pose = PLACE;
    return dcd_body_create(s->world, &def, out);
}

static DcdStatus joint(Scene *s, DcdJointId *out)
{
    DcdJointDef def = DCD_JOINT_DEF_INIT;
    def.joint_type = DCD_JOINT_PRISMATIC;
    if (body(s, &def.a) != DCD_OK || body(s, &def.b) != DCD_OK) {
        def.a = s->own;
        def.b = s->body;
    }
    return dcd_joint_create(s->world, &def, out);
}

/* Defines the call of a function by its name; `s` is the scene. It returns the status. */
#define CALL(name) static DcdStatus try_##name(Scene *s)

CALL(dcd_world_info) { DcdWorldInfo info = DCD_WORLD_INFO_INIT; return dcd_world_info(s->world, &info); }
CALL(dcd_world_is_valid) { return dcd_world_is_valid(s->world) ? DCD_OK : DCD_ERR_STALE_ID; }
CALL(dcd_own_avatars) {
    DcdBodyId ids[64];
    DcdStatus status = dcd_own_avatars(s->world, ids, 64, &count);
    return status == DCD_OK && count == 0 ? NOTHING : status;
}
CALL(dcd_token_create) {
    char token[512];
    return dcd_token_create(s->world, DCD_ROLE_CLIENT, 60, token, sizeof token, &count);
}
CALL(dcd_server_suspend) { return dcd_server_suspend(s->world); }
CALL(dcd_metrics_address) { char text[64]; return dcd_metrics_address(s->world, text, sizeof text, &count); }
CALL(dcd_address) { char text[64]; return dcd_address(s->world, text, sizeof text, &count); }

CALL(dcd_shape_box) { DcdShapeId id; return dcd_shape_box(s->world, ONE, &id); }
CALL(dcd_shape_sphere) { DcdShapeId id; return dcd_shape_sphere(s->world, 1.0f, &id); }
CALL(dcd_shape_capsule) { DcdShapeId id; return dcd_shape_capsule(s->world, 1.0f, 1.0f, &id); }
CALL(dcd_shape_cylinder) { DcdShapeId id; return dcd_shape_cylinder(s->world, 1.0f, 1.0f, &id); }
CALL(dcd_shape_cone) { DcdShapeId id; return dcd_shape_cone(s->world, 1.0f, 1.0f, &id); }
static const float CORNERS[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
CALL(dcd_shape_hull) { DcdShapeId id; return dcd_shape_hull(s->world, CORNERS, 4, &id); }
CALL(dcd_shape_mesh) {
    const uint32_t faces[12] = { 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3 };
    DcdShapeId id;
    return dcd_shape_mesh(s->world, CORNERS, 4, faces, 4, false, &id);
}
CALL(dcd_shape_heightfield) { DcdShapeId id; return dcd_shape_heightfield(s->world, CORNERS, 2, 2, ONE, &id); }
CALL(dcd_shape_half_space) { DcdShapeId id; return dcd_shape_half_space(s->world, ONE, &id); }
CALL(dcd_shape_segment) { DcdShapeId id; return dcd_shape_segment(s->world, CORNERS, ONE, &id); }
CALL(dcd_shape_round) {
    DcdShapeId box, id;
    DcdStatus status = dcd_shape_box(s->world, ONE, &box);
    return status == DCD_OK ? dcd_shape_round(s->world, box, 0.1f, &id) : status;
}
CALL(dcd_shape_compound) { DcdShapeId id; return dcd_shape_compound(s->world, &s->shape, &HERE, 1, &id); }
CALL(dcd_shape_scale) { DcdShapeId id; return dcd_shape_scale(s->world, s->shape, ONE, &id); }
CALL(dcd_shape_destroy) {
    DcdShapeId id;
    DcdStatus status = dcd_shape_sphere(s->world, 1.0f, &id);
    return status == DCD_OK ? dcd_shape_destroy(s->world, id) : status;
}

CALL(dcd_body_create) { DcdBodyId id; return body(s, &id); }
CALL(dcd_bodies_create) {
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId id;
    def.shape = s->shape;
    return dcd_bodies_create(s->world, &def, 1, &id);
}
CALL(dcd_character_create) {
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdCharacterDef character = DCD_CHARACTER_DEF_INIT;
    DcdBodyId id;
    def.shape = s->shape;
    def.body_type = DCD_KINEMATIC;
    return dcd_character_create(s->world, &def, &character, &id);
}
CALL(dcd_vehicle_create) {
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdVehicleDef vehicle = DCD_VEHICLE_DEF_INIT;
    DcdBodyId id;
    def.shape = s->shape;
    return dcd_vehicle_create(s->world, &def, &vehicle, &id);
}
CALL(dcd_vehicle_drive) {
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdVehicleDef vehicle = DCD_VEHICLE_DEF_INIT;
    DcdDrive drive = { 1.0f, 0.0f, 0.0f };
    DcdBodyId id = s->body;
    def.shape = s->shape;
    (void)dcd_vehicle_create(s->world, &def, &vehicle, &id);
    return dcd_vehicle_drive(s->world, id, &drive);
}
/* A body that is no character or vehicle is refused only after the role has been checked. */
CALL(dcd_character_state) {
    DcdCharacterState state = DCD_CHARACTER_STATE_INIT;
    DcdStatus status = dcd_character_state(s->world, s->body, &state);
    return status == DCD_ERR_ARGUMENT ? DCD_OK : status;
}
CALL(dcd_vehicle_wheels) {
    DcdStatus status = dcd_vehicle_wheels(s->world, s->body, NULL, 0, &count);
    return status == DCD_ERR_ARGUMENT ? DCD_OK : status;
}
CALL(dcd_body_destroy) {
    DcdBodyId id = s->body;
    if (s->body.v == s->own.v)
        body(s, &id);
    return dcd_body_destroy(s->world, id);
}
CALL(dcd_bodies_destroy) {
    DcdBodyId id = s->body;
    if (s->body.v == s->own.v)
        body(s, &id);
    return dcd_bodies_destroy(s->world, &id, 1);
}
CALL(dcd_body_is_valid) { (void)dcd_body_is_valid(s->world, s->body); return DCD_OK; }
CALL(dcd_body_at) { DcdBodyId id; return dcd_body_at(s->world, 0, &id); }
CALL(dcd_body_info) { DcdBodyInfo info = DCD_BODY_INFO_INIT; return dcd_body_info(s->world, s->body, &info); }
CALL(dcd_body_get) { DcdPose pose; return dcd_body_get(s->world, s->body, &pose, NULL); }
CALL(dcd_body_set_pose) { return dcd_body_set_pose(s->world, s->body, &PLACE); }
CALL(dcd_body_set_velocity) {
    const DcdVelocity velocity = { { 0.0f, 1.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    return dcd_body_set_velocity(s->world, s->body, &velocity);
}
CALL(dcd_body_set_target) {
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId id = s->body;
    def.shape = s->shape;
    def.body_type = DCD_KINEMATIC_POSE;
    /* Other roles have no such bodies, and use their own. */
    (void)dcd_body_create(s->world, &def, &id);
    return dcd_body_set_target(s->world, id, &PLACE);
}
CALL(dcd_body_wake) { return dcd_body_wake(s->world, s->body); }
CALL(dcd_body_sleep) { return dcd_body_sleep(s->world, s->body); }
CALL(dcd_body_apply_impulse) { return dcd_body_apply_impulse(s->world, s->body, ONE, NULL); }
CALL(dcd_body_apply_torque_impulse) { return dcd_body_apply_torque_impulse(s->world, s->body, ONE); }
CALL(dcd_body_set_force) { return dcd_body_set_force(s->world, s->body, ONE, ONE); }
CALL(dcd_body_add_force) { return dcd_body_add_force(s->world, s->body, ONE, NULL); }
CALL(dcd_body_properties) {
    DcdBodyProperties all = DCD_BODY_PROPERTIES_INIT;
    return dcd_body_properties(s->world, s->body, &all);
}
CALL(dcd_body_set_properties) {
    DcdBodyProperties all = DCD_BODY_PROPERTIES_INIT;
    all.body_type = DCD_DYNAMIC;
    all.sleep_linear = all.sleep_angular = all.sleep_after = 0.5f;
    return dcd_body_set_properties(s->world, s->body, &all);
}
CALL(dcd_collider_properties) {
    DcdColliderProperties all = DCD_COLLIDER_PROPERTIES_INIT;
    return dcd_collider_properties(s->world, s->body, 0, &all);
}
CALL(dcd_collider_set_properties) {
    DcdColliderProperties all = DCD_COLLIDER_PROPERTIES_INIT;
    return dcd_collider_set_properties(s->world, s->body, 0, &all);
}
CALL(dcd_collider_add) {
    DcdColliderProperties all = DCD_COLLIDER_PROPERTIES_INIT;
    uint32_t part;
    return dcd_collider_add(s->world, s->body, s->shape, &all, &part);
}
CALL(dcd_collider_remove) { return dcd_collider_remove(s->world, s->body, 0); }
CALL(dcd_collider_set_shape) { return dcd_collider_set_shape(s->world, s->body, 0, s->shape); }
CALL(dcd_body_set_events) { return dcd_body_set_events(s->world, s->body, 0, DCD_EVENT_CONTACT, 0.0f); }
CALL(dcd_body_set_material) { return dcd_body_set_material(s->world, s->body, 0, 0.5f, 0.5f); }
CALL(dcd_body_set_groups) { return dcd_body_set_groups(s->world, s->body, 0, 1, 1); }

CALL(dcd_joint_create) { DcdJointId id; return joint(s, &id); }
CALL(dcd_joint_destroy) {
    DcdJointId id = s->joint;
    (void)joint(s, &id);
    return dcd_joint_destroy(s->world, id);
}
CALL(dcd_joint_is_valid) { (void)dcd_joint_is_valid(s->world, s->joint); return DCD_OK; }
CALL(dcd_joint_info) { DcdJointInfo info = DCD_JOINT_INFO_INIT; return dcd_joint_info(s->world, s->joint, &info); }
CALL(dcd_joint_set_limit) { return dcd_joint_set_limit(s->world, s->joint, DCD_AXIS_X, NULL); }
CALL(dcd_joint_set_motor) { return dcd_joint_set_motor(s->world, s->joint, DCD_AXIS_X, NULL); }
CALL(dcd_joint_get_limit) {
    const float limit[2] = { -1.0f, 1.0f };
    float got[2];
    (void)dcd_joint_set_limit(s->world, s->joint, DCD_AXIS_X, limit);
    return dcd_joint_get_limit(s->world, s->joint, DCD_AXIS_X, got);
}
CALL(dcd_joint_get_motor) {
    DcdJointMotor motor = DCD_JOINT_MOTOR_INIT;
    (void)dcd_joint_set_motor(s->world, s->joint, DCD_AXIS_X, &motor);
    return dcd_joint_get_motor(s->world, s->joint, DCD_AXIS_X, &motor);
}
CALL(dcd_joint_set_frames) { return dcd_joint_set_frames(s->world, s->joint, &HERE, &HERE); }
CALL(dcd_joint_set_flags) { return dcd_joint_set_flags(s->world, s->joint, 0); }
CALL(dcd_joint_set_softness) { return dcd_joint_set_softness(s->world, s->joint, 1.0e6f, 1.0f); }
CALL(dcd_body_joints) { DcdJointId ids[64]; return dcd_body_joints(s->world, s->body, ids, 64, &count); }

CALL(dcd_step) { return dcd_step(s->world); }
CALL(dcd_step_begin) {
    DcdStatus status = dcd_step_begin(s->world);
    (void)dcd_step_wait(s->world, DCD_FOREVER);
    return status;
}
CALL(dcd_step_wait) { (void)dcd_step_begin(s->world); return dcd_step_wait(s->world, DCD_FOREVER); }
CALL(dcd_state_view) { DcdStateView view = DCD_STATE_VIEW_INIT; return dcd_state_view(s->world, &view); }
CALL(dcd_view_time) { DcdViewTime time = DCD_VIEW_TIME_INIT; return dcd_view_time(s->world, &time); }
CALL(dcd_view_body) { DcdPose pose; return dcd_view_body(s->world, s->body, 1.5, &pose, NULL); }
CALL(dcd_view_state) {
    DcdViewTime time = DCD_VIEW_TIME_INIT;
    DcdStateView view = DCD_STATE_VIEW_INIT;
    return dcd_view_state(s->world, &time, &view);
}
CALL(dcd_state_read) {
    DcdPose pose;
    return dcd_state_read(s->world, &s->body, 1, DCD_FIELD_POSE, &pose, 0, NULL);
}
CALL(dcd_state_write) { return dcd_state_write(s->world, &s->body, 1, DCD_FIELD_POSE, &PLACE, 0, NULL); }
CALL(dcd_events) { DcdEventView view = DCD_EVENT_VIEW_INIT; return dcd_events(s->world, &view); }

/* The oldest connection. In a process that joined, it is the connection to the server. */
static DcdStatus connection(Scene *s, DcdConnectionId *out)
{
    DcdConnectionId ids[16];
    DcdStatus status = dcd_connections(s->world, ids, 16, &count);
    if (status == DCD_OK && count == 0)
        return NOTHING;
    *out = ids[0];
    return status;
}

CALL(dcd_connections) { DcdConnectionId id; return connection(s, &id); }
CALL(dcd_connection_info) {
    DcdConnectionInfo info = DCD_CONNECTION_INFO_INIT;
    DcdConnectionId id;
    DcdStatus status = connection(s, &id);
    return status == DCD_OK ? dcd_connection_info(s->world, id, &info) : status;
}
CALL(dcd_send) {
    DcdConnectionId id = { 1 };
    (void)connection(s, &id);
    return dcd_send(s->world, id, "", 1, 0);
}
CALL(dcd_disconnect) {
    DcdConnectionId ids[16] = { { 1 } };
    DcdStatus status = dcd_connections(s->world, ids, 16, &count);
    /* The newest connection belongs to a client that joined for this. */
    return status == DCD_OK ? dcd_disconnect(s->world, ids[count > 0 ? count - 1 : 0], NULL) : status;
}
CALL(dcd_poll) {
    DcdStatus status = dcd_poll(s->world, 1);
    return status == DCD_ERR_TIMEOUT ? DCD_OK : status;
}

static DcdRay RAY = { { 0.0, 50.0, 0.0 }, { 0.0f, -1.0f, 0.0f }, 100.0f, { 0 }, 0xFFFFFFFFu, 0 };
CALL(dcd_cast_rays) { DcdRayHit hit; return dcd_cast_rays(s->world, &RAY, 1, NULL, &hit); }
CALL(dcd_cast_rays_all) {
    DcdRayHit hits[64];
    size_t end;
    return dcd_cast_rays_all(s->world, &RAY, 1, NULL, hits, 64, &end, &count);
}
static float end_ray(void *context, const DcdRayHit *hit) { (void)context, (void)hit; return 0.0f; }
static bool end_overlaps(void *context, const DcdOverlap *found) { (void)context, (void)found; return false; }
static float end_cast(void *context, const DcdShapeHit *hit) { (void)context, (void)hit; return 0.0f; }
CALL(dcd_cast_shape_each) {
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    cast.shape = s->shape;
    return dcd_cast_shape_each(s->world, &cast, NULL, end_cast, NULL);
}
CALL(dcd_cast_ray_each) { return dcd_cast_ray_each(s->world, &RAY, NULL, end_ray, NULL); }
CALL(dcd_overlap_shape_each) {
    DcdShapeQuery query = DCD_SHAPE_QUERY_INIT;
    query.shape = s->shape;
    return dcd_overlap_shape_each(s->world, &query, NULL, end_overlaps, NULL);
}
CALL(dcd_overlap_box_each) {
    DcdBoxQuery query = DCD_BOX_QUERY_INIT;
    return dcd_overlap_box_each(s->world, &query, NULL, end_overlaps, NULL);
}
CALL(dcd_cast_shapes) {
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    DcdShapeHit hit;
    cast.shape = s->shape;
    cast.motion[1] = -1.0f;
    return dcd_cast_shapes(s->world, &cast, 1, NULL, &hit);
}
CALL(dcd_project_points) {
    DcdPointQuery point = DCD_POINT_QUERY_INIT;
    DcdPointHit hit;
    return dcd_project_points(s->world, &point, 1, NULL, &hit);
}
CALL(dcd_overlap_shapes) {
    DcdShapeQuery query = DCD_SHAPE_QUERY_INIT;
    DcdOverlap found[64];
    size_t end;
    query.shape = s->shape;
    return dcd_overlap_shapes(s->world, &query, 1, NULL, found, 64, &end, &count);
}
CALL(dcd_overlap_points) {
    DcdPointQuery point = DCD_POINT_QUERY_INIT;
    DcdOverlap found[64];
    size_t end;
    return dcd_overlap_points(s->world, &point, 1, NULL, found, 64, &end, &count);
}
CALL(dcd_overlap_boxes) {
    DcdBoxQuery box = DCD_BOX_QUERY_INIT;
    DcdOverlap found[64];
    size_t end;
    return dcd_overlap_boxes(s->world, &box, 1, NULL, found, 64, &end, &count);
}
CALL(dcd_cast_rays_submit) { DcdQueryId id; return dcd_cast_rays_submit(s->world, &RAY, 1, NULL, &id); }
static DcdStatus casts(Scene *s, DcdQueryId *id)
{
    DcdShapeCast cast = DCD_SHAPE_CAST_INIT;
    cast.shape = s->shape;
    cast.motion[1] = -1.0f;
    return dcd_cast_shapes_submit(s->world, &cast, 1, NULL, id);
}

static DcdStatus points(Scene *s, DcdQueryId *id)
{
    DcdPointQuery point = DCD_POINT_QUERY_INIT;
    return dcd_overlap_points_submit(s->world, &point, 1, NULL, id);
}

CALL(dcd_cast_shapes_submit) { DcdQueryId id; return casts(s, &id); }
CALL(dcd_overlap_shapes_submit) {
    DcdShapeQuery query = DCD_SHAPE_QUERY_INIT;
    DcdQueryId id;
    query.shape = s->shape;
    return dcd_overlap_shapes_submit(s->world, &query, 1, NULL, &id);
}
CALL(dcd_overlap_points_submit) { DcdQueryId id; return points(s, &id); }
CALL(dcd_overlap_boxes_submit) {
    DcdBoxQuery box = DCD_BOX_QUERY_INIT;
    DcdQueryId id;
    return dcd_overlap_boxes_submit(s->world, &box, 1, NULL, &id);
}
CALL(dcd_query_poll_casts) {
    DcdQueryId id;
    DcdShapeHit hit;
    DcdStatus status = casts(s, &id);
    if (status == DCD_OK)
        status = dcd_query_poll_casts(s->world, id, &hit, 1, &count);
    return status == DCD_ERR_BUSY ? DCD_OK : status;
}
CALL(dcd_query_poll_overlaps) {
    DcdQueryId id;
    DcdOverlap found[64];
    size_t end;
    DcdStatus status = points(s, &id);
    if (status == DCD_OK)
        status = dcd_query_poll_overlaps(s->world, id, found, 64, &end, &count);
    return status == DCD_ERR_BUSY ? DCD_OK : status;
}
CALL(dcd_query_poll) {
    DcdQueryId id;
    DcdRayHit hit;
    DcdStatus status = dcd_cast_rays_submit(s->world, &RAY, 1, NULL, &id);
    if (status == DCD_OK)
        status = dcd_query_poll(s->world, id, &hit, 1, &count);
    return status == DCD_ERR_BUSY ? DCD_OK : status;
}
CALL(dcd_query_cancel) {
    DcdQueryId id;
    DcdStatus status = dcd_cast_rays_submit(s->world, &RAY, 1, NULL, &id);
    return status == DCD_OK ? dcd_query_cancel(s->world, id) : status;
}

CALL(dcd_settings) { DcdSettings settings = DCD_SETTINGS_INIT; return dcd_settings(s->world, &settings); }
CALL(dcd_settings_set) {
    DcdSettings settings = DCD_SETTINGS_INIT;
    DcdStatus status = dcd_settings(s->world, &settings);
    return status == DCD_OK ? dcd_settings_set(s->world, &settings) : status;
}
CALL(dcd_gravity_set) { return dcd_gravity_set(s->world, ONE); }
CALL(dcd_body_contacts) { return dcd_body_contacts(s->world, s->body, NULL, 0, &count); }
CALL(dcd_explode) { DcdExplosion blast = DCD_EXPLOSION_INIT; return dcd_explode(s->world, &blast, NULL); }
CALL(dcd_flow) { DcdFluid fluid = DCD_FLUID_INIT; return dcd_flow(s->world, &fluid, NULL); }
/* A body that is no sensor is refused only after the role has been checked. */
CALL(dcd_sensor_bodies) {
    DcdStatus status = dcd_sensor_bodies(s->world, s->body, 0, NULL, 0, &count);
    return status == DCD_ERR_ARGUMENT ? DCD_OK : status;
}
CALL(dcd_joint_set_strength) { return dcd_joint_set_strength(s->world, s->joint, 1.0f, 1.0f); }
CALL(dcd_profile) { DcdProfile profile = DCD_PROFILE_INIT; return dcd_profile(s->world, &profile); }
CALL(dcd_viewpoints_set) { return dcd_viewpoints_set(s->world, NULL, 0); }
CALL(dcd_fidelity_report) { DcdFidelityReport report = DCD_FIDELITY_REPORT_INIT; return dcd_fidelity_report(s->world, &report); }
CALL(dcd_hooks_set) { return dcd_hooks_set(s->world, NULL); }
CALL(dcd_tasks_set) { return dcd_tasks_set(s->world, NULL); }
CALL(dcd_bodies) { DcdBodyId ids[64]; return dcd_bodies(s->world, ids, 64, &count); }
CALL(dcd_body_extent) { DcdBodyExtent extent = DCD_BODY_EXTENT_INIT; return dcd_body_extent(s->world, s->body, &extent); }
CALL(dcd_collider_shape) { DcdShapeId shape; return dcd_collider_shape(s->world, s->body, 0, &shape); }
CALL(dcd_shape_info) { DcdShapeInfo info = DCD_SHAPE_INFO_INIT; return dcd_shape_info(s->world, s->shape, &info); }
CALL(dcd_shape_vertices) { return dcd_shape_vertices(s->world, s->shape, NULL, 0, &count); }
CALL(dcd_shape_triangles) { return dcd_shape_triangles(s->world, s->shape, NULL, 0, &count); }
CALL(dcd_shape_heights) { return dcd_shape_heights(s->world, s->shape, NULL, 0, &count); }
CALL(dcd_shape_part) {
    DcdShapeId whole, part;
    DcdStatus status = dcd_shape_compound(s->world, &s->shape, &HERE, 1, &whole);
    return status == DCD_OK ? dcd_shape_part(s->world, whole, 0, &part, NULL) : status;
}

CALL(dcd_regions) {
    DcdRegionInfo regions[8];
    DcdStatus status = dcd_regions(s->world, regions, 8, &count);
    return status == DCD_OK && count == 0 ? NOTHING : status;
}
CALL(dcd_borders) { DcdBorderInfo borders[8]; return dcd_borders(s->world, borders, 8, &count); }
CALL(dcd_body_owner) { DcdOwner owner = DCD_OWNER_INIT; return dcd_body_owner(s->world, s->body, &owner); }
CALL(dcd_debug_draw) { DcdDebugDraw draw = DCD_DEBUG_DRAW_INIT; return dcd_debug_draw(s->world, NULL, &draw); }
static char path[600];
CALL(dcd_gltf_save_file) { return dcd_gltf_save_file(s->world, path); }
CALL(dcd_prediction_set) { return dcd_prediction_set(s->world, true); }
CALL(dcd_prediction) { DcdPrediction prediction = DCD_PREDICTION_INIT; return dcd_prediction(s->world, &prediction); }
CALL(dcd_bandwidth_set) { return dcd_bandwidth_set(s->world, 0); }
CALL(dcd_interest_set) { return dcd_interest_set(s->world, NULL, 0.0); }
CALL(dcd_stats) { DcdStats stats = DCD_STATS_INIT; return dcd_stats(s->world, &stats); }
CALL(dcd_validate) { char text[4096]; return dcd_validate(s->world, text, sizeof text, &count); }
CALL(dcd_stats_text) { char text[4096]; return dcd_stats_text(s->world, text, sizeof text, &count); }
CALL(dcd_state_hash) { uint64_t hash; return dcd_state_hash(s->world, &hash); }
static char saved[1 << 20];
CALL(dcd_snapshot_save) { return dcd_snapshot_save(s->world, saved, sizeof saved, &count); }
CALL(dcd_snapshot_load) {
    count = 1;
    (void)dcd_snapshot_save(s->world, saved, sizeof saved, &count);
    return dcd_snapshot_load(s->world, saved, count);
}
static DcdCheckpointId checkpoint;
CALL(dcd_checkpoint_create) { return dcd_checkpoint_create(s->world, &checkpoint); }
/* Without a checkpoint there is nothing to save or to restore. */
#define ON_CHECKPOINT(name) \
    CALL(name) { \
        DcdStatus status = dcd_checkpoint_create(s->world, &checkpoint); \
        return status == DCD_OK ? name(s->world, checkpoint) : status; \
    }
ON_CHECKPOINT(dcd_checkpoint_save)
ON_CHECKPOINT(dcd_checkpoint_restore)
ON_CHECKPOINT(dcd_checkpoint_destroy)
CALL(dcd_snapshot_save_file) { return dcd_snapshot_save_file(s->world, path); }
CALL(dcd_snapshot_load_file) {
    (void)dcd_snapshot_save_file(s->world, path);
    return dcd_snapshot_load_file(s->world, path);
}
CALL(dcd_record) { return dcd_record(s->world, path); }
CALL(dcd_record_last) { return dcd_record_last(s->world, 1.0f); }
CALL(dcd_record_keep) { return dcd_record_keep(s->world, path); }
CALL(dcd_record_stop) { return dcd_record_stop(s->world); }
CALL(dcd_world_destroy) {
    DcdStatus status = s->world.v == 0 ? DCD_OK : dcd_world_destroy(s->world);
    s->world.v = 0;
    return status;
}

#define ALL(of) \
    of(dcd_world_info) of(dcd_world_is_valid) of(dcd_own_avatars) of(dcd_token_create) of(dcd_address) of(dcd_metrics_address) \
    of(dcd_shape_box) of(dcd_shape_sphere) of(dcd_shape_capsule) of(dcd_shape_cylinder) of(dcd_shape_cone) \
    of(dcd_shape_hull) of(dcd_shape_mesh) of(dcd_shape_heightfield) of(dcd_shape_half_space) of(dcd_shape_segment) of(dcd_shape_round) \
    of(dcd_shape_compound) of(dcd_shape_scale) of(dcd_shape_destroy) \
    of(dcd_body_create) of(dcd_bodies_create) of(dcd_character_create) of(dcd_vehicle_create) of(dcd_vehicle_drive) of(dcd_character_state) of(dcd_vehicle_wheels) \
    of(dcd_body_destroy) of(dcd_bodies_destroy) of(dcd_body_is_valid) \
    of(dcd_settings) of(dcd_settings_set) of(dcd_gravity_set) of(dcd_joint_set_strength) of(dcd_profile) of(dcd_viewpoints_set) of(dcd_fidelity_report) of(dcd_hooks_set) of(dcd_tasks_set) of(dcd_body_contacts) of(dcd_explode) of(dcd_flow) of(dcd_sensor_bodies) of(dcd_bodies) of(dcd_body_extent) of(dcd_collider_shape) of(dcd_shape_info) of(dcd_shape_vertices) \
    of(dcd_shape_triangles) of(dcd_shape_heights) of(dcd_shape_part) \
    of(dcd_body_at) of(dcd_body_info) of(dcd_body_get) of(dcd_body_set_pose) of(dcd_body_set_velocity) \
    of(dcd_body_set_target) of(dcd_body_wake) of(dcd_body_sleep) of(dcd_body_apply_impulse) \
    of(dcd_body_apply_torque_impulse) of(dcd_body_set_force) of(dcd_body_add_force) of(dcd_body_properties) \
    of(dcd_body_set_properties) of(dcd_collider_properties) of(dcd_collider_set_properties) of(dcd_collider_add) \
    of(dcd_collider_remove) of(dcd_collider_set_shape) of(dcd_body_set_events) of(dcd_body_set_material) \
    of(dcd_body_set_groups) of(dcd_joint_create) of(dcd_joint_destroy) of(dcd_joint_is_valid) of(dcd_joint_info) \
    of(dcd_joint_set_limit) of(dcd_joint_set_motor) of(dcd_joint_get_limit) of(dcd_joint_get_motor) \
    of(dcd_joint_set_frames) of(dcd_joint_set_flags) of(dcd_joint_set_softness) of(dcd_body_joints) of(dcd_step) \
    of(dcd_step_begin) of(dcd_step_wait) of(dcd_state_view) of(dcd_view_time) of(dcd_view_body) of(dcd_view_state) of(dcd_debug_draw) of(dcd_gltf_save_file) of(dcd_state_read) of(dcd_state_write) of(dcd_events) \
    of(dcd_connections) of(dcd_connection_info) of(dcd_send) of(dcd_disconnect) of(dcd_poll) of(dcd_cast_rays) \
    of(dcd_cast_rays_all) of(dcd_cast_ray_each) of(dcd_cast_shape_each) of(dcd_overlap_shape_each) of(dcd_overlap_box_each) of(dcd_cast_shapes) of(dcd_project_points) of(dcd_overlap_shapes) of(dcd_overlap_points) \
    of(dcd_overlap_boxes) of(dcd_cast_rays_submit) of(dcd_query_poll) of(dcd_query_cancel) of(dcd_regions) \
    of(dcd_cast_shapes_submit) of(dcd_overlap_shapes_submit) of(dcd_overlap_points_submit) \
    of(dcd_overlap_boxes_submit) of(dcd_query_poll_casts) of(dcd_query_poll_overlaps) \
    of(dcd_borders) of(dcd_body_owner) of(dcd_interest_set) of(dcd_bandwidth_set) of(dcd_prediction_set) of(dcd_prediction) of(dcd_stats) of(dcd_stats_text) of(dcd_validate) of(dcd_state_hash) \
    of(dcd_snapshot_save) of(dcd_snapshot_load) of(dcd_snapshot_save_file) of(dcd_snapshot_load_file) \
    of(dcd_checkpoint_create) of(dcd_checkpoint_save) of(dcd_checkpoint_restore) of(dcd_checkpoint_destroy) \
    of(dcd_record) of(dcd_record_last) of(dcd_record_keep) of(dcd_record_stop) \
    of(dcd_server_suspend) of(dcd_world_destroy)
#define ENTRY(name) { #name, try_##name },

static const struct {
    const char *name;
    DcdStatus (*call)(Scene *);
} CALLS[] = { ALL(ENTRY) };

/* The result, in the words of the page. */
static const char *verdict(Scene *s, DcdStatus (*call)(Scene *))
{
    s->body = s->own;
    const DcdStatus own = call(s);
    s->body = s->other;
    const DcdStatus other = own == DCD_OK && s->own.v != s->other.v ? call(s) : own;
    if (own == NOTHING)
        return "none";
    if (own == DCD_OK)
        return other == DCD_OK ? "yes" : other == DCD_ERR_UNSUPPORTED ? "own" : dcd_status_string(other);
    return own == DCD_ERR_UNSUPPORTED ? "-" : dcd_status_string(own);
}

/* Joins the server in this role. */
static DcdWorld joined(DcdWorld server, DcdRole role)
{
    char address[64] = "", token[512] = "";
    DcdClientDef client = DCD_CLIENT_DEF_INIT;
    DcdParticipantDef participant = DCD_PARTICIPANT_DEF_INIT;
    DcdNodeDef node = DCD_NODE_DEF_INIT;
    DcdWorld world = { 0 };
    client.server = participant.server = node.server = address;
    client.token = participant.token = node.token = token;
    participant.metrics = node.metrics = "127.0.0.1:0";
    OK(dcd_address(server, address, sizeof address, &count));
    OK(dcd_token_create(server, role, 60, token, sizeof token, &count));
    OK(role == DCD_ROLE_CLIENT || role == DCD_ROLE_BUILDER ? dcd_client_connect(&client, &world)
       : role == DCD_ROLE_PARTICIPANT ? dcd_participant_join(&participant, &world)
                                      : dcd_node_join(&node, &world));
    return world;
}

/* Steps until a body of others is known, and an own avatar is in the world. */
static void settle(Scene *s)
{
    struct timespec pause = { 0, 5 * 1000 * 1000 };
    bool appeared = false;
    OK(body(s, &s->own));
    for (int i = 0; i < 6000 && !appeared; i++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        nanosleep(&pause, NULL);
        OK(dcd_step(s->world));
        OK(dcd_events(s->world, &events));
        for (size_t k = 0; k < events.change_count; k++)
            appeared |= events.changes[k].kind == DCD_CHANGE_APPEARED && events.changes[k].body.v == s->own.v;
    }
    HOLDS(appeared);
    OK(dcd_body_at(s->world, 1, &s->other));
}

int main(int argc, char **argv)
{
    enum { LOCAL, CLIENT, PARTICIPANT, BUILDER, SERVER, NODE, ROLES };
    Scene scenes[ROLES];
    DcdWorldDef cut = DCD_WORLD_DEF_INIT;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    const char *params[] = { "n=10" };
    if (argc != 2)
        return 2;
    memset(scenes, 0, sizeof scenes);
    snprintf(path, sizeof path, "%s.saved", argv[1]);
    cut.regions = 2;
    def.world = &cut;
    def.scene = "pile";
    def.params = params;
    def.param_count = 1;
    def.data_path = argv[1];
    def.metrics = "127.0.0.1:0";
    OK(dcd_world_open_scene("pile", params, 1, &cut, &scenes[LOCAL].world));
    OK(dcd_server_create(&def, &scenes[SERVER].world));
    scenes[NODE].world = joined(scenes[SERVER].world, DCD_ROLE_NODE);
    scenes[PARTICIPANT].world = joined(scenes[SERVER].world, DCD_ROLE_PARTICIPANT);
    scenes[CLIENT].world = joined(scenes[SERVER].world, DCD_ROLE_CLIENT);
    scenes[BUILDER].world = joined(scenes[SERVER].world, DCD_ROLE_BUILDER);
    DcdWorld victim = joined(scenes[SERVER].world, DCD_ROLE_CLIENT);

    for (int role = 0; role < ROLES; role++) {
        Scene *s = &scenes[role];
        OK(dcd_shape_box(s->world, ONE, &s->shape));
        s->joint.v = 1;
        s->own.v = s->other.v = s->body.v = 1;
    }
    OK(body(&scenes[LOCAL], &scenes[LOCAL].own));
    scenes[LOCAL].other = scenes[LOCAL].body = scenes[LOCAL].own;
    OK(joint(&scenes[LOCAL], &scenes[LOCAL].joint));
    OK(body(&scenes[SERVER], &scenes[SERVER].own));
    scenes[SERVER].other = scenes[SERVER].body = scenes[SERVER].own;
    OK(joint(&scenes[SERVER], &scenes[SERVER].joint));
    settle(&scenes[CLIENT]);
    settle(&scenes[BUILDER]);
    scenes[BUILDER].other = scenes[BUILDER].body = scenes[BUILDER].own;
    OK(joint(&scenes[BUILDER], &scenes[BUILDER].joint));
    OK(try_dcd_character_create(&scenes[BUILDER]));
    settle(&scenes[PARTICIPANT]);

    for (size_t i = 0; i < sizeof CALLS / sizeof *CALLS; i++) {
        printf("%s", CALLS[i].name);
        for (int role = 0; role < ROLES; role++)
            printf(" %s", verdict(&scenes[role], CALLS[i].call));
        printf("\n");
    }
    OK(dcd_world_destroy(victim));
    return checked();
}
