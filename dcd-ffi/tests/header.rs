//! Tests that `include/dcd.h` is what cbindgen makes of this crate, no more and no less.
//!
//! `UPDATE=1 cargo test -p dcd-ffi --test header` writes it anew.

use std::fmt::Write;
use std::mem::{offset_of, size_of};
use std::path::Path;

use dcd_ffi::body::*;
use dcd_ffi::character::*;
use dcd_ffi::collider::*;
use dcd_ffi::connection::*;
use dcd_ffi::contacts::*;
use dcd_ffi::draw::*;
use dcd_ffi::event::*;
use dcd_ffi::fidelity::*;
use dcd_ffi::forces::*;
use dcd_ffi::hooks::*;
use dcd_ffi::ids::*;
use dcd_ffi::join::*;
use dcd_ffi::joint::*;
use dcd_ffi::looks::*;
use dcd_ffi::message::*;
use dcd_ffi::motion::*;
use dcd_ffi::prediction::*;
use dcd_ffi::profile::*;
use dcd_ffi::properties::*;
use dcd_ffi::query::*;
use dcd_ffi::serve::*;
use dcd_ffi::settings::*;
use dcd_ffi::shape_info::*;
use dcd_ffi::standing::*;
use dcd_ffi::state::*;
use dcd_ffi::stats::*;
use dcd_ffi::tasks::*;
use dcd_ffi::topology::*;
use dcd_ffi::types::*;
use dcd_ffi::vehicle::*;
use dcd_ffi::view::*;
use dcd_ffi::world::*;

/// The layout of a struct in Rust: its size, and the offsets of its members.
struct Layout {
    name: &'static str,
    size: usize,
    members: Vec<(&'static str, usize)>,
}

macro_rules! layouts {
    ($($name:ident { $($member:ident),+ })+) => {
        vec![$(Layout {
            name: stringify!($name),
            size: size_of::<$name>(),
            members: vec![$((stringify!($member), offset_of!($name, $member))),+],
        }),+]
    };
}

fn layouts() -> Vec<Layout> {
    layouts! {
        DcdWorld { v }
        DcdBodyId { v }
        DcdShapeId { v }
        DcdJointId { v }
        DcdConnectionId { v }
        DcdPose { p, q }
        DcdVelocity { linear, angular }
        DcdFrame { p, q }
        DcdWorldDef {
            struct_size, threads, regions, solver_iterations, gravity, dt, min, max, user_data, coupling, preset,
            exchanges, depth, island_limit, tolerance, axes, speed_limit, fidelity, fidelity_limit, cuts, cut_count,
            reserved
        }
        DcdCut { at, axis, reserved }
        DcdWorldInfo { struct_size, role, tick, user_data, regions, dt, gravity, client, speed_limit, reserved }
        DcdClientDef {
            struct_size, timeout_ms, server, token, identity_path, user_data, interest_centre, interest_radius,
            give_up_ms, reserved
        }
        DcdParticipantDef {
            struct_size, timeout_ms, server, token, identity_path, user_data, threads, give_up_ms, interest_centre,
            interest_radius, record_path, metrics
        }
        DcdGroupDef { struct_size, lag_ticks, near_ms, far_ms, agree, size }
        DcdServerDef {
            struct_size, nodes, scene, params, param_count, world, source, groups, listen, data_path, last_tick, avatar_speed,
            flags, user_data, state_every, verify, metrics, directory, record_path, avatar_expiry, reserved
        }
        DcdNodeDef {
            struct_size, timeout_ms, server, token, identity_path, listen, user_data, threads, give_up_ms, record_path, metrics,
            advertise
        }
        DcdBodyDef {
            struct_size, body_type, pose, velocity, shape, density, mass, friction, restitution, friction_rule,
            restitution_rule, contact_skin, linear_damping, angular_damping, gravity_scale, flags, locked, events,
            force_threshold, groups, mask, solver_groups, solver_mask, pairs, dominance, soft_ccd, sleep_linear,
            sleep_angular, sleep_after, extra_mass, extra_centre, extra_inertia, extra_solver_iterations,
            extra_pgs_iterations, hooks, user_data, material
        }
        DcdCharacterDef {
            struct_size, step_height, step_depth, max_climb, min_slide, snap, gap, mass, reserved
        }
        DcdWheel {
            at, down, axle, rest_length, travel, radius, stiffness, compression, relaxation, max_force, grip, side_grip,
            engine_force, brake_force, steering
        }
        DcdVehicleDef { struct_size, wheel_count, wheels, top_speed, reserved }
        DcdDrive { throttle, brake, steering }
        DcdGround { body, material, point, normal, slope, collider, reserved }
        DcdCharacterState { struct_size, grounded, sliding, reserved, ground }
        DcdWheelState { pose, suspension, steering, rolled, spin, ground }
        DcdBodyProperties {
            struct_size, body_type, flags, locked, dominance, linear_damping, angular_damping, gravity_scale, soft_ccd,
            sleep_linear, sleep_angular, sleep_after, extra_mass, extra_centre, extra_inertia,
            extra_solver_iterations, extra_pgs_iterations, reserved, user_data
        }
        DcdColliderProperties {
            struct_size, flags, frame, density, mass, friction, restitution, friction_rule, restitution_rule,
            contact_skin, events, force_threshold, groups, mask, solver_groups, solver_mask, pairs, hooks,
            user_data
        }
        DcdBodyInfo {
            struct_size, body_type, user_data, centre, mass, region, force, torque, colliders, sleeping, outside, reserved
        }
        DcdForce { force, torque }
        DcdExplosion { struct_size, mask, centre, radius, falloff, impulse, reserved }
        DcdFluid { struct_size, mask, min, max, surface, density, velocity, drag, damping, lift,
            reserved }
        DcdShapeInfo {
            struct_size, kind, size, border, frame, vertex_count, triangle_count, rows, columns, parts, reserved
        }
        DcdSettings {
            struct_size, solver_iterations, gravity, dt, length_unit, speed_limit, contact_frequency, contact_damping,
            static_frequency, static_damping, max_correction, allowed_overlap, contact_margin, warm_start,
            internal_iterations, ccd_substeps, tolerance, friction_model
        }
        DcdProfile {
            struct_size, reserved, rapier, broad_phase, narrow_phase, islands, solver, ccd, border, contact_pairs, contacts,
            awake, joints, islands_awake, memory
        }
        DcdViewpoint { at, radius }
        DcdFidelityReport {
            struct_size, error, low95, high95, share_of_full_time, audits, overruns, levels, reserved
        }
        DcdBodyExtent { struct_size, mass, min, max, centre, inertia, axes }
        DcdJointDef {
            struct_size, joint_type, a, b, frame_a, frame_b, limit, motor, flags, locked, coupled, natural_frequency,
            damping_ratio, reserved, user_data
        }
        DcdJointMotor { position, velocity, stiffness, damping, max_force, model }
        DcdJointInfo {
            struct_size, joint_type, a, b, user_data, frame_a, frame_b, offset, position, force,
            natural_frequency, damping_ratio, flags, locked, coupled, limited, driven
        }
        DcdViewTime { struct_size, reserved, now, shown, predicted, clock_error, input_delay }
        DcdDrawnShape { kind, mesh, size, reserved, vertices, vertex_count, triangles, triangle_count }
        DcdDebugDraw {
            struct_size, flags, context, draw_point, draw_line, draw_box, draw_shape, draw_text, min, max, velocity_scale,
            force_scale
        }
        DcdPrediction {
            struct_size, bodies, ticks, replays, corrections, largest_correction, last_frame, longest_frame
        }
        DcdStateView { struct_size, slot_count, tick, count, ids, poses, velocities, user_data, flags, regions, slots }
        DcdConnectionEvent { connection, state, role, node, client, cause, reserved, reason }
        DcdConnectionInfo {
            struct_size, state, role, node, client, loss, rtt, age, bytes_in, bytes_out, udp_bytes_in, udp_bytes_out,
            messages_in, messages_out, dropped, bytes_waiting
        }
        DcdMessage { connection, data, size, role, node, client, flags }
        DcdContact {
            a, b, user_a, user_b, point, normal, speed, kind, flags, collider_a, collider_b, material_a, material_b
        }
        DcdContactPoint {
            a, b, point, normal, separation, impulse, manifold, collider_a, collider_b, material_a, material_b
        }
        DcdContactForce {
            a, b, user_a, user_b, force, magnitude, collider_a, collider_b, material_a, material_b
        }
        DcdJointOverload { joint, user_data, force, torque }
        DcdHookedPair {
            a, b, user_a, user_b, material_a, material_b, collider_a, collider_b, pose_a, pose_b, velocity_a, velocity_b
        }
        DcdHookedContact {
            normal, separation, points, enabled, friction, restitution, surface_velocity, memory
        }
        DcdHooks { struct_size, reserved, context, filter, detect, modify }
        DcdTasks { struct_size, reserved, context, enqueue, finish }
        DcdTransfer { body, user_data, from, to }
        DcdBodyChange { body, user_data, kind, reason }
        DcdEventView {
            struct_size, flags, tick, contacts, contact_count, forces, force_count, transfers, transfer_count,
            changes, change_count, connections, connection_count, messages, message_count,
            overloads, overload_count
        }
        DcdFilter { struct_size, flags, groups, mask, exclude, exclude_count }
        DcdRay { origin, direction, max_distance, exclude, mask, flags }
        DcdRayHit { body, user_data, point, normal, distance, collider, subshape, material }
        DcdShapeCast { shape, pose, motion, turn, margin, mask, exclude, flags, reserved }
        DcdShapeHit {
            body, user_data, point, normal, fraction, point_on_shape, normal_on_shape, collider, subshape, flags, reserved,
            material
        }
        DcdPointQuery { point, max_distance, mask, exclude, flags, reserved }
        DcdPointHit { body, user_data, point, distance, collider, flags, reserved, material }
        DcdShapeQuery { shape, pose, exclude, mask, reserved }
        DcdBoxQuery { min, max, exclude, mask, reserved }
        DcdOverlap { body, user_data, collider, reserved, material }
        DcdCheckpointId { v }
        DcdQueryId { v }
        DcdRegionInfo { region, bodies, ghosts, node, min, max }
        DcdOwner { struct_size, region, node, holders, flags }
        DcdBorderInfo { a, b, bodies, exchanges, depth, disagreement }
        DcdStats {
            struct_size, regions, ticks, bodies, ghosts, transfers, quarantined, updates, bytes_in, bytes_out,
            udp_bytes_in, udp_bytes_out, rtt, last_step, disagreement, exchanges
        }
    }
}

const MACROS: &str = "
/* Default values of each struct. */

/* One region, a thread per core, Earth's gravity, 60 steps per second, a box of 128 m around the origin, up to 400 m/s. */
#define DCD_WORLD_DEF_INIT \\
    { (uint32_t)sizeof(DcdWorldDef), 0, 0, 4, { 0.0f, -9.81f, 0.0f }, 1.0f / 60.0f, \\
      { -64.0, -64.0, -64.0 }, { 64.0, 64.0, 64.0 }, 0, 0, 0, 0, 0, 0, 0.0f, 0, 0.0f, 0, 0.0f, NULL, 0, 0 }

/* A dynamic body as dense as water at the origin. */
#define DCD_BODY_DEF_INIT \\
    { (uint32_t)sizeof(DcdBodyDef), DCD_DYNAMIC, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }, { 0 }, 1000.0f, 0.0f, 0.5f, 0.0f, 0, 0, 0.0f, \\
      0.0f, 0.0f, 1.0f, 0, 0, 0, 0.0f, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 7, 0, 0.0f, \\
      0.05f, 0.5f, 0.5f, 0.0f, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, 0, 0, 0, 0, 0 }

/* A person of 80 kg: steps of 0.3 m, slopes of 45 degrees. */
#define DCD_CHARACTER_DEF_INIT \\
    { (uint32_t)sizeof(DcdCharacterDef), 0.3f, 0.1f, 0.785398163f, 0.785398163f, 0.2f, 0.02f, 80.0f, 0 }

/* A wheel of a car of a tonne, forward along x, upward along y: neither driven nor steered. */
#define DCD_WHEEL_INIT \\
    { { 0.0f, 0.0f, 0.0f }, { 0.0f, -1.0f, 0.0f }, { 0.0f, 0.0f, 1.0f }, 0.3f, 0.2f, 0.35f, 30.0f, 4.0f, 5.0f, 20000.0f, \\
      1.5f, 1.0f, 0.0f, 4000.0f, 0.0f }

/* A car of 3.2 x 1.6 m and about a tonne, up to 20 m/s. */
#define DCD_VEHICLE_DEF_INIT \\
    { (uint32_t)sizeof(DcdVehicleDef), 0, NULL, 20.0f, 0 }

/* At the origin: 100 N s/m² within 5 m, down to nothing at 10 m. */
#define DCD_EXPLOSION_INIT \\
    { (uint32_t)sizeof(DcdExplosion), 0xFFFFFFFFu, { 0.0, 0.0, 0.0 }, 5.0f, 5.0f, 100.0f, 0 }

/* Still water without end, up to the height of the origin. */
#define DCD_FLUID_INIT \\
    { (uint32_t)sizeof(DcdFluid), 0xFFFFFFFFu, { -1.0e9, -1.0e9, -1.0e9 }, { 1.0e9, 1.0e9, 1.0e9 }, 0.0, 1000.0f, \\
      { 0.0f, 0.0f, 0.0f }, 1.0f, 1.0f, 0.0f, 0 }

/* A shape as dense as water at the body's origin. */
#define DCD_COLLIDER_PROPERTIES_INIT \\
    { (uint32_t)sizeof(DcdColliderProperties), 0, { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \\
      1000.0f, 0.0f, 0.5f, 0.0f, 0, 0, 0.0f, 0, 0.0f, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 7, 0, 0 }

/* A motor that holds still by any force. */
#define DCD_JOINT_MOTOR_INIT { 0.0f, 0.0f, 0.0f, 1000.0f, 3.402823466e+38f, DCD_MOTOR_ACCELERATION }

/* A fixed joint that brings the origins of two bodies together. */
#define DCD_JOINT_DEF_INIT \\
    { (uint32_t)sizeof(DcdJointDef), DCD_JOINT_FIXED, { 0 }, { 0 }, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f }, DCD_JOINT_MOTOR_INIT, \\
      0, 0, 0, 1.0e6f, 1.0f, 0, 0 }

/* A filter that every body passes. */
#define DCD_FILTER_INIT { (uint32_t)sizeof(DcdFilter), 0, 0, 0xFFFFFFFFu, NULL, 0 }
#define DCD_RAY_INIT { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 1.0e6f, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_SHAPE_CAST_INIT \\
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, \\
      0.0f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_POINT_QUERY_INIT { { 0.0, 0.0, 0.0 }, 1.0e6f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_SHAPE_QUERY_INIT \\
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_BOX_QUERY_INIT { { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, { 0 }, 0xFFFFFFFFu, 0 }

/* Draws shapes, without a bound in space; set its functions. */
#define DCD_DEBUG_DRAW_INIT \\
    { (uint32_t)sizeof(DcdDebugDraw), DCD_DRAW_SHAPES, NULL, NULL, NULL, NULL, NULL, NULL, \\
      { -1.0e300, -1.0e300, -1.0e300 }, { 1.0e300, 1.0e300, 1.0e300 }, 0.1f, 1.0e-4f }

/* Ten seconds of patience, no identity file; one thread per core. */
#define DCD_CLIENT_DEF_INIT \\
    { (uint32_t)sizeof(DcdClientDef), 10000, NULL, NULL, NULL, 0, { 0.0, 0.0, 0.0 }, 0.0, 0, 0 }
#define DCD_PARTICIPANT_DEF_INIT \\
    { (uint32_t)sizeof(DcdParticipantDef), 10000, NULL, NULL, NULL, 0, 0, 0, { 0.0, 0.0, 0.0 }, 0.0, NULL, NULL }

/* All nodes in one group and in step; a server in real time that waits for one node, on a free port of this machine, and tells states
 * of every third step. */
#define DCD_GROUP_DEF_INIT \\
    { (uint32_t)sizeof(DcdGroupDef), 0, 0.0f, 0.0f, 0.1f, 32 }
#define DCD_SERVER_DEF_INIT \\
    { (uint32_t)sizeof(DcdServerDef), 1, NULL, NULL, 0, NULL, { 0 }, NULL, \"127.0.0.1:0\", NULL, 0, \\
      20.0f, 0, 0, 3, 0.0f, NULL, NULL, NULL, 3600.0f, 0 }
#define DCD_NODE_DEF_INIT \\
    { (uint32_t)sizeof(DcdNodeDef), 10000, NULL, NULL, NULL, NULL, 0, 0, 0, NULL, NULL, NULL }

/* Structs that are written by the library. */
#define DCD_WORLD_INFO_INIT \\
    { (uint32_t)sizeof(DcdWorldInfo), 0, 0, 0, 0, 0.0f, { 0.0f, 0.0f, 0.0f }, 0, 0.0f, 0 }
#define DCD_BODY_INFO_INIT \\
    { (uint32_t)sizeof(DcdBodyInfo), 0, 0, { 0.0, 0.0, 0.0 }, 0.0f, 0, { 0.0f, 0.0f, 0.0f }, \\
      { 0.0f, 0.0f, 0.0f }, 0, false, false, { 0, 0 } }
#define DCD_CHARACTER_STATE_INIT \\
    { (uint32_t)sizeof(DcdCharacterState), false, false, { 0, 0 }, \\
      { { 0 }, 0, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 0.0f, 0, 0 } }
#define DCD_SHAPE_INFO_INIT \\
    { (uint32_t)sizeof(DcdShapeInfo), 0, { 0.0f, 0.0f, 0.0f }, 0.0f, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, 0, 0, 0, 0, 0, 0 }
#define DCD_SETTINGS_INIT \\
    { (uint32_t)sizeof(DcdSettings), 0, { 0.0f, 0.0f, 0.0f }, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, \\
      0.0f, 0.0f, 0, 0, 0.0f, 0 }
#define DCD_FIDELITY_REPORT_INIT \\
    { (uint32_t)sizeof(DcdFidelityReport), 0.0f, 0.0f, 0.0f, 0.0, 0, 0, { 0, 0, 0 }, 0 }
#define DCD_PROFILE_INIT \\
    { (uint32_t)sizeof(DcdProfile), 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0 }
/* No hooks: set those that the library is to call. */
#define DCD_HOOKS_INIT { (uint32_t)sizeof(DcdHooks), 0, NULL, NULL, NULL, NULL }
#define DCD_TASKS_INIT { (uint32_t)sizeof(DcdTasks), 0, NULL, NULL, NULL }
#define DCD_BODY_EXTENT_INIT \\
    { (uint32_t)sizeof(DcdBodyExtent), 0.0f, { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, \\
      { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }
#define DCD_BODY_PROPERTIES_INIT \\
    { (uint32_t)sizeof(DcdBodyProperties), 0, 0, 0, 0, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, \\
      { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, 0, 0, 0, 0 }
#define DCD_JOINT_INFO_INIT \\
    { (uint32_t)sizeof(DcdJointInfo), 0, { 0 }, { 0 }, 0, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 0.0f } }, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 0.0f } }, \\
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 0.0f } }, 0.0f, \\
      { 0.0f, 0.0f, 0.0f }, 0.0f, 0.0f, 0, 0, 0, 0, 0 }
#define DCD_STATE_VIEW_INIT \\
    { (uint32_t)sizeof(DcdStateView), 0, 0, 0, NULL, NULL, NULL, NULL, NULL, NULL, NULL }
#define DCD_VIEW_TIME_INIT { (uint32_t)sizeof(DcdViewTime), 0, 0.0, 0.0, 0.0, -1.0, -1.0 }
#define DCD_PREDICTION_INIT { (uint32_t)sizeof(DcdPrediction), 0, 0, 0, 0, 0.0, 0.0, 0.0 }
#define DCD_EVENT_VIEW_INIT \\
    { (uint32_t)sizeof(DcdEventView), 0, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, \\
      NULL, 0, NULL, 0, NULL, 0 }
#define DCD_OWNER_INIT { (uint32_t)sizeof(DcdOwner), 0, 0, 0, 0 }
#define DCD_CONNECTION_INFO_INIT \\
    { (uint32_t)sizeof(DcdConnectionInfo), 0, 0, 0, 0, 0.0f, 0.0, 0.0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define DCD_STATS_INIT \\
    { (uint32_t)sizeof(DcdStats), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, 0.0f, 0 }

/* Whether the library that runs fits this header: DCD_OK or DCD_ERR_VERSION. Before 1.0 the minor version must match too. */
static inline DcdStatus dcd_version_check(void)
{
    return dcd_version() / 1000u == DCD_VERSION / 1000u ? DCD_OK : DCD_ERR_VERSION;
}
";

fn versions() -> String {
    let [major, minor, patch] =
        [env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"), env!("CARGO_PKG_VERSION_PATCH")];
    format!(
        "\n\n/* The version of this header; compare with dcd_version() by dcd_version_check(). */\n\
         #define DCD_VERSION_MAJOR {major}u\n#define DCD_VERSION_MINOR {minor}u\n#define DCD_VERSION_PATCH {patch}u\n\
         #define DCD_VERSION (DCD_VERSION_MAJOR * 1000000u + DCD_VERSION_MINOR * 1000u + DCD_VERSION_PATCH)"
    )
}

/// Returns compile-time checks that C lays the structs out as Rust does.
fn asserts() -> String {
    let mut text = String::from(
        "\n/* The library's own layout, on 64-bit systems: a compiler that differs says so here. */\n\
         #if UINTPTR_MAX == 0xFFFFFFFFFFFFFFFFu\n\
         #ifdef __cplusplus\n#define DCD_ASSERT_(what) static_assert(what, #what)\n\
         #else\n#define DCD_ASSERT_(what) _Static_assert(what, #what)\n#endif\n",
    );
    for Layout { name, size, members } in layouts() {
        writeln!(text, "DCD_ASSERT_(sizeof({name}) == {size});").unwrap();
        for (member, offset) in members {
            writeln!(text, "DCD_ASSERT_(offsetof({name}, {member}) == {offset});").unwrap();
        }
    }
    text + "#undef DCD_ASSERT_\n#endif\n\n#endif /* DCD_H */"
}

fn generate() -> String {
    let crate_dir = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut config =
        cbindgen::Config::from_file(crate_dir.join("cbindgen.toml")).expect("cbindgen.toml is right");
    config.after_includes.as_mut().expect("cbindgen.toml has it").push_str(&versions());
    config.trailer = Some(format!("{MACROS}{}", asserts()));
    let bindings = cbindgen::Builder::new()
        .with_config(config)
        .with_src(crate_dir.join("src/lib.rs"))
        .generate()
        .expect("the crate parses");
    let mut text = Vec::new();
    bindings.write(&mut text);
    let text = String::from_utf8(text).expect("C is text");
    let plain = |line: &str| {
        let words: Vec<_> = line.split(' ').collect();
        match words[..] {
            ["typedef", "struct", ..] => format!("{line}\n"),
            // In brackets, as a macro may stand in any expression.
            ["#define", name, value] if value.starts_with('-') => format!("#define {name} ({value})\n"),
            // Every struct is a typedef before it is used, so its uses need no `struct`.
            _ => line.replace("struct Dcd", "Dcd") + "\n",
        }
    };
    text.lines().map(plain).collect()
}

fn path() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../include/dcd.h")
}

#[test]
fn the_committed_header_is_the_generated_one() {
    let generated = generate();
    if std::env::var_os("UPDATE").is_some() {
        std::fs::create_dir_all(path().parent().unwrap()).unwrap();
        std::fs::write(path(), &generated).unwrap();
    }
    let committed = std::fs::read_to_string(path()).unwrap_or_default();
    let differs = committed.lines().zip(generated.lines()).position(|(a, b)| a != b);
    assert!(
        committed == generated,
        "include/dcd.h differs from dcd-ffi from line {} on; run UPDATE=1 cargo test -p dcd-ffi --test header",
        differs.map_or(committed.lines().count(), |line| line + 1)
    );
}

#[test]
fn every_struct_of_the_header_has_its_layout_asserted() {
    let header = generate();
    let known: Vec<_> = layouts().iter().map(|layout| layout.name).collect();
    let structs: Vec<_> = header.lines().filter_map(|line| line.strip_prefix("typedef struct ")).collect();
    assert_eq!(structs.len(), known.len());
    for name in structs {
        let name = name.trim_end_matches(" {");
        assert!(known.contains(&name), "{name} is missing in `layouts`");
    }
}

#[test]
fn no_struct_has_padding_that_a_program_could_leave_undefined() {
    // Each member must end where the next begins. Sizes come from the types in the header.
    let header = generate();
    for layout in layouts() {
        let body = header.split(&format!("typedef struct {} {{", layout.name)).nth(1).expect("it is there");
        let body = &body[..body.find('}').expect("it ends")];
        let mut end = 0;
        for (line, (member, offset)) in body
            .lines()
            .map(str::trim)
            .filter(|line| line.ends_with(';') && !line.starts_with("//"))
            .zip(&layout.members)
        {
            assert_eq!(end, *offset, "{}.{member} follows a gap", layout.name);
            end += size_of_member(line);
        }
        assert_eq!(end, layout.size, "{} ends with a gap", layout.name);
    }
}

/// Returns the size of a member by its declaration, as `float q[4];`.
fn size_of_member(declaration: &str) -> usize {
    let declaration = declaration.trim_end_matches(';').trim_start_matches("struct ");
    let (name, count) = match declaration.split_once('[') {
        Some((name, "DCD_MAX_REASON]")) => (name, DCD_MAX_REASON),
        Some((name, count)) => (name, count.trim_end_matches(']').parse().expect("a number of entries")),
        None => (declaration, 1),
    };
    let kind = name.split_whitespace().next().expect("a type");
    let size = match kind {
        _ if name.contains('*') => size_of::<usize>(),
        "uint8_t" | "bool" | "char" => 1,
        "float" | "uint32_t" | "int32_t" | "DcdStatus" | "DcdBodyType" | "DcdJointType" | "DcdMotorModel"
        | "DcdCombineRule" | "DcdDrawFlags" | "DcdDrawnKind" | "DcdConnectionState" | "DcdCause"
        | "DcdRole" | "DcdCoupling" | "DcdPreset" | "DcdFidelity" | "DcdShapeKind" | "DcdFrictionModel" => 4,
        "double" | "uint64_t" | "size_t" => 8,
        name if name.starts_with("Dcd") && name.ends_with("Fn") => size_of::<usize>(),
        name => layouts().iter().find(|layout| layout.name == name).unwrap_or_else(|| panic!("{name}")).size,
    };
    size * count
}
