//! Creates, changes, reads and destroys joints: their frames, limits, motors and softness.

use dcd::protocol::JointRecord;
use dcd::space::JointId;
use rapier3d::prelude::*;

use super::*;
use crate::guard::{guard, guard_value};
use crate::handle::stale;
use crate::ids::{DcdBodyId, DcdJointId, DcdWorld};
use crate::pointer::{self, Out, Room, check_bits};
use crate::registry::{self, World, ask, with};
use crate::status::{DcdStatus, Failure};
use crate::types::DcdFrame;

/// Creates a joint between two bodies and wakes both. The joint is gone when either body is destroyed.
///
/// In a local world the two may be any bodies of which one is not fixed. A joint whose bodies are both made fixed later
/// (dcd_body_set_properties) is gone; make one of them kinematic where it must last.
///
/// A server, or a builder, ties bodies of its own: those that it made since its last dcd_step, or one of them and a fixed one. Servers
/// and builders may drive and destroy any joint. Clients that may not build, and nodes, have no joints (DCD_ERR_UNSUPPORTED).
///
/// One region owns what joints tie together, and it moves whole, so keep it small against a region.
///
/// `def` is read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a body), DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range, a limit or motor of a joint without an axis of its own, twice the same body, or two
///   fixed bodies.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_create(
    world: DcdWorld,
    def: *const DcdJointDef,
    out: *mut DcdJointId,
) -> DcdStatus {
    guard("dcd_joint_create", || {
        // SAFETY: the caller vouches for both pointers.
        let (def, out) = unsafe { (pointer::read_sized(def, "def")?, Out::new(out, "out")?) };
        let joint = parse(&def)?;
        with(world, |world| {
            world.dcd.ties_bodies()?;
            let find = |body, name: &str| {
                let named = |failure: Failure| {
                    Failure::new(failure.status, format!("def->{name}: {}", failure.message))
                };
                registry::find(world, body).map_err(named)
            };
            let (a, b) = (find(def.a, "a")?, find(def.b, "b")?);
            if a == b {
                return Err(Failure::argument("a and b are one body; a joint needs two"));
            }
            out.write(world.mark.joint(world.dcd.insert_joint(a, b, joint)?));
            Ok(())
        })
    })
}

/// Destroys a joint and wakes its bodies.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice, or when one of its bodies was destroyed).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_destroy(world: DcdWorld, joint: DcdJointId) -> DcdStatus {
    guard("dcd_joint_destroy", || {
        with(world, |world| {
            let id = find(world, joint)?.id;
            world.dcd.remove_joint(id).map_err(Failure::from)
        })
    })
}

/// Returns whether the id names a joint of this world. Returns false also from within a function that the library calls, and once
/// the world answers DCD_ERR_PANIC.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_is_valid(world: DcdWorld, joint: DcdJointId) -> bool {
    guard_value(false, || ask(world, |world| find(world, joint)).is_ok())
}

/// Reads the state of a joint: what it ties, where it stands, what it bears.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_info(
    world: DcdWorld,
    joint: DcdJointId,
    out: *mut DcdJointInfo,
) -> DcdStatus {
    guard("dcd_joint_info", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let record = find(world, joint)?;
            out.write(describe(world, &record).ok_or_else(|| stale("joint", joint.v))?);
            Ok(())
        })
    })
}

/// Sets the limit of one axis of a joint, and wakes its bodies. `limit` points to the lowest and the highest position, metres or
/// radians; -INFINITY and INFINITY leave a side open. A null `limit` takes the limit away. Coupled axes have one limit, and that of
/// a rope is DCD_AXIS_X. Where the position is a distance, its lowest is 0.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range, a lowest above the highest, or an axis that is
/// locked or none).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_set_limit(
    world: DcdWorld,
    joint: DcdJointId,
    axis: DcdJointAxis,
    limit: *const f32,
) -> DcdStatus {
    guard("dcd_joint_set_limit", || {
        let limit = limit.cast::<[f32; 2]>();
        // SAFETY: the caller vouches for two numbers, if it is not null.
        let limit = if limit.is_null() { None } else { Some(unsafe { pointer::read(limit, "limit")? }) };
        with(world, |world| {
            let record = find(world, joint)?;
            let axis = free_axis(&record, axis)?;
            let range = limit.map(|limit| check_limit(axis, axes(record.coupled_axes), limit)).transpose()?;
            world
                .dcd
                .update_joint(record.id, |joint| match range {
                    Some(range) => drop(joint.set_limits(axis, range)),
                    None => joint.limit_axes.remove(axis.into()),
                })
                .map_err(Failure::from)
        })
    })
}

/// Sets the motor of one axis of a joint, and wakes its bodies. A null `motor` stops the motor: the axis is free again. Coupled
/// axes have one motor, and that of a spring is DCD_AXIS_X.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range, an unknown model, an axis that is locked or
/// none, or coupled axes about which it would turn).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_set_motor(
    world: DcdWorld,
    joint: DcdJointId,
    axis: DcdJointAxis,
    motor: *const DcdJointMotor,
) -> DcdStatus {
    guard("dcd_joint_set_motor", || {
        // SAFETY: the caller vouches for the pointer, if it is not null.
        let motor = if motor.is_null() { None } else { Some(unsafe { pointer::read(motor, "motor")? }) };
        motor.as_ref().map(check_motor).transpose()?;
        with(world, |world| {
            let record = find(world, joint)?;
            let axis = free_axis(&record, axis)?;
            if (axes(record.coupled_axes) & JointAxesMask::ANG_AXES).contains(axis.into()) {
                return Err(Failure::argument("no motor turns coupled axes; drive free ones"));
            }
            world
                .dcd
                .update_joint(record.id, |joint| match &motor {
                    Some(motor) => drive(joint, axis, motor),
                    None => joint.motor_axes.remove(axis.into()),
                })
                .map_err(Failure::from)
        })
    })
}

/// Reads the limit of one axis of a joint, lowest and highest, into `out`, which has two entries: -INFINITY to INFINITY where there
/// is none.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (an axis that is locked or none).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_get_limit(
    world: DcdWorld,
    joint: DcdJointId,
    axis: DcdJointAxis,
    out: *mut f32,
) -> DcdStatus {
    guard("dcd_joint_get_limit", || {
        // SAFETY: the caller vouches for two places.
        let out = unsafe { Out::new(out.cast::<[f32; 2]>(), "out")? };
        ask(world, |world| {
            let record = find(world, joint)?;
            let axis = free_axis(&record, axis)?;
            let limit = record.limits[axis as usize];
            let open = |end: f32| if end.abs() < f32::MAX { end } else { f32::INFINITY.copysign(end) };
            out.write(if axes(record.limit_axes).contains(axis.into()) {
                [open(limit.min), open(limit.max)]
            } else {
                [f32::NEG_INFINITY, f32::INFINITY]
            });
            Ok(())
        })
    })
}

/// Reads the motor of one axis of a joint; all is 0 where none runs.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (an axis that is locked or none).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_get_motor(
    world: DcdWorld,
    joint: DcdJointId,
    axis: DcdJointAxis,
    out: *mut DcdJointMotor,
) -> DcdStatus {
    guard("dcd_joint_get_motor", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        ask(world, |world| {
            let record = find(world, joint)?;
            let axis = free_axis(&record, axis)?;
            let motor = record.motors[axis as usize];
            out.write(if axes(record.motor_axes).contains(axis.into()) {
                DcdJointMotor {
                    position: motor.target_pos,
                    velocity: motor.target_vel,
                    stiffness: motor.stiffness,
                    damping: motor.damping,
                    max_force: motor.max_force,
                    model: if motor.acceleration_based { DCD_MOTOR_ACCELERATION } else { DCD_MOTOR_FORCE },
                }
            } else {
                let [position, velocity, stiffness, damping, max_force] = [0.0; 5];
                DcdJointMotor { position, velocity, stiffness, damping, max_force, model: 0 }
            });
            Ok(())
        })
    })
}

/// Sets where a joint sits on `a` and on `b`, and wakes its bodies. A null frame stays as it is.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a frame that is not finite or no rotation).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_joint_set_frames(
    world: DcdWorld,
    joint: DcdJointId,
    frame_a: *const DcdFrame,
    frame_b: *const DcdFrame,
) -> DcdStatus {
    guard("dcd_joint_set_frames", || {
        let given = |frame: *const DcdFrame, name| {
            if frame.is_null() {
                return Ok(None);
            }
            // SAFETY: the caller vouches for what is not null.
            let frame = unsafe { pointer::read(frame, name)? };
            frame.check(name).map(|()| Some(frame.pose()))
        };
        let (a, b) = (given(frame_a, "frame_a")?, given(frame_b, "frame_b")?);
        with(world, |world| {
            let id = find(world, joint)?.id;
            world
                .dcd
                .update_joint(id, |joint| {
                    joint.local_frame1 = a.unwrap_or(joint.local_frame1);
                    joint.local_frame2 = b.unwrap_or(joint.local_frame2);
                })
                .map_err(Failure::from)
        })
    })
}

/// Sets whether a joint acts and whether its bodies collide with one another, and wakes them. `flags` has DCD_JOINT_COLLIDE and
/// DCD_JOINT_DISABLED bits.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (other bits).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_set_flags(world: DcdWorld, joint: DcdJointId, flags: u32) -> DcdStatus {
    guard("dcd_joint_set_flags", || {
        check_bits(flags, DCD_JOINT_COLLIDE | DCD_JOINT_DISABLED, "flags")?;
        with(world, |world| {
            let id = find(world, joint)?.id;
            world
                .dcd
                .update_joint(id, |joint| {
                    joint.set_contacts_enabled(flags & DCD_JOINT_COLLIDE != 0);
                    joint.set_enabled(flags & DCD_JOINT_DISABLED == 0);
                })
                .map_err(Failure::from)
        })
    })
}

/// Sets how stiffly a joint holds what it locks and limits, as in DcdJointDef, and wakes its bodies.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_set_softness(
    world: DcdWorld,
    joint: DcdJointId,
    natural_frequency: f32,
    damping_ratio: f32,
) -> DcdStatus {
    guard("dcd_joint_set_softness", || {
        let softness = softness(natural_frequency, damping_ratio)?;
        with(world, |world| {
            let id = find(world, joint)?.id;
            world.dcd.update_joint(id, |joint| joint.softness = softness).map_err(Failure::from)
        })
    })
}

/// Lists the joints of a body, oldest first. Writes the ids to `out`, which has `cap` entries, and their number to `count`. With
/// `cap` 0, `out` may be null, to ask for the number.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_joints(
    world: DcdWorld,
    body: DcdBodyId,
    out: *mut DcdJointId,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_body_joints", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            world.dcd.ties_bodies()?;
            let id = registry::find(world, body)?;
            let joints = world.dcd.joints_of(id);
            out.fill(joints.into_iter().map(|id| world.mark.joint(id)))
        })
    })
}

/// Returns the joint behind a handle.
fn find(world: &World, joint: DcdJointId) -> Result<JointRecord, Failure> {
    world.dcd.ties_bodies()?;
    let id: JointId = world.mark.joint_id(joint)?;
    world.dcd.joint(id).ok_or_else(|| stale("joint", joint.v))
}
