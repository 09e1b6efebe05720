//! Joints: tying bodies together, limits, motors.

use rapier3d::prelude::*;

use crate::body::{self, DcdBodyId};
use crate::guard::guard;
use crate::handle::stale;
use crate::pointer::{self, Out, Sized32, check_numbers, is_in_range};
use crate::status::{DcdStatus, Failure};
use crate::types::DcdFrame;
use crate::world::{DcdWorld, with};

/// A joint. 0 is null; an id is never given again.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdJointId {
    /// Opaque.
    pub v: u64,
}

/// What a joint lets free.
pub type DcdJointType = u32;

/// Nothing: the frames stay together.
pub const DCD_JOINT_FIXED: DcdJointType = 0;
/// Turning about the frames' x axis. Limits in radians, motor in rad/s and N m.
pub const DCD_JOINT_REVOLUTE: DcdJointType = 1;
/// Sliding along the frames' x axis. Limits in metres, motor in m/s and N.
pub const DCD_JOINT_PRISMATIC: DcdJointType = 2;
/// Turning about every axis. Limits in radians hold for each of the three; no motor.
pub const DCD_JOINT_SPHERICAL: DcdJointType = 3;

/// In DcdJointDef.flags: `limit` counts.
pub const DCD_JOINT_LIMIT: u32 = 1;
/// In DcdJointDef.flags: the motor runs.
pub const DCD_JOINT_MOTOR: u32 = 2;
/// In DcdJointDef.flags: the two bodies collide with one another too.
pub const DCD_JOINT_COLLIDE: u32 = 4;

/// How a joint is made. Start from DCD_JOINT_DEF_INIT and give `a` and `b`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdJointDef {
    /// sizeof(DcdJointDef).
    pub struct_size: u32,
    /// DCD_JOINT_FIXED, _REVOLUTE, _PRISMATIC or _SPHERICAL.
    pub joint_type: DcdJointType,
    /// First body.
    pub a: DcdBodyId,
    /// Second body, another one.
    pub b: DcdBodyId,
    /// Where the joint sits on `a`; it brings the two frames together.
    pub frame_a: DcdFrame,
    /// Where it sits on `b`.
    pub frame_b: DcdFrame,
    /// Lowest and highest angle or distance of `b` seen from `a`, with DCD_JOINT_LIMIT.
    pub limit: [f32; 2],
    /// Speed that the motor tries to keep, with DCD_JOINT_MOTOR.
    pub motor_speed: f32,
    /// Most force or torque of the motor: finite, 0 or more.
    pub motor_max_force: f32,
    /// DCD_JOINT_LIMIT, _MOTOR, _COLLIDE bits.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdJointDef {
    const NAME: &'static str = "DcdJointDef";
}

/// How hard a velocity motor pulls towards its speed, per second: stiff enough to be there within a few steps.
const MOTOR_GAIN: f32 = 1000.0;

/// Ties two bodies of a local world; in a served world the three joint functions are DCD_ERR_UNSUPPORTED. What joints tie together is owned and moved whole by one region, so keep it small against a region.
///
/// `def` is read during the call. The joint is gone when either body is destroyed.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a body), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range, a
/// motor on a joint without one, or twice the same body.
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
            world.backend.check_joints()?;
            let (a, b) = (body::find(world, def.a)?, body::find(world, def.b)?);
            if a == b {
                return Err(Failure::argument("a and b are one body; a joint needs two"));
            }
            out.write(world.mark.joint(world.backend.insert_joint(a, b, joint)?));
            Ok(())
        })
    })
}

/// Starts, changes or, with `max_force` 0, stops the motor of a revolute or prismatic joint, and wakes its bodies. `speed` in
/// rad/s or m/s, `max_force` in N m or N, 0 or more.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for numbers out of range or a joint of another type.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_set_motor(
    world: DcdWorld,
    joint: DcdJointId,
    speed: f32,
    max_force: f32,
) -> DcdStatus {
    guard("dcd_joint_set_motor", || {
        check_motor(speed, max_force)?;
        with(world, |world| {
            world.backend.check_joints()?;
            let id = world.mark.joint_id(joint)?;
            let mut has_motor = true;
            let change = |joint: &mut GenericJoint| match free_axis(joint.locked_axes) {
                Some(axis) => drive(joint, axis, speed, max_force),
                None => has_motor = false,
            };
            world.backend.update_joint(id, change).map_err(|_| stale("joint", joint.v))?;
            if has_motor { Ok(()) } else { Err(no_motor()) }
        })
    })
}

/// Unties two bodies and wakes them.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice, or when one of its bodies was destroyed).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_destroy(world: DcdWorld, joint: DcdJointId) -> DcdStatus {
    guard("dcd_joint_destroy", || {
        with(world, |world| {
            world.backend.check_joints()?;
            let id = world.mark.joint_id(joint)?;
            world.backend.remove_joint(id).map_err(|_| stale("joint", joint.v))
        })
    })
}

fn parse(def: &DcdJointDef) -> Result<GenericJoint, Failure> {
    let (locked, limited): (_, &[JointAxis]) = match def.joint_type {
        DCD_JOINT_FIXED => (JointAxesMask::LOCKED_FIXED_AXES, &[]),
        DCD_JOINT_REVOLUTE => (JointAxesMask::LOCKED_REVOLUTE_AXES, &[JointAxis::AngX]),
        DCD_JOINT_PRISMATIC => (JointAxesMask::LOCKED_PRISMATIC_AXES, &[JointAxis::LinX]),
        DCD_JOINT_SPHERICAL => {
            let all = &[JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ];
            (JointAxesMask::LOCKED_SPHERICAL_AXES, all)
        }
        other => {
            return Err(Failure::argument(format!("joint_type {other} is none; use a DCD_JOINT_… type")));
        }
    };
    for (frame, name) in [(&def.frame_a, "frame_a"), (&def.frame_b, "frame_b")] {
        if !frame.is_valid() {
            return Err(Failure::argument(format!("{name} is not finite, or its q is not of length 1")));
        }
    }
    if def.flags & !(DCD_JOINT_LIMIT | DCD_JOINT_MOTOR | DCD_JOINT_COLLIDE) != 0 {
        return Err(Failure::argument(format!(
            "flags {:#x} has bits that mean nothing; clear them",
            def.flags
        )));
    }
    let mut joint = GenericJoint::new(locked);
    joint.set_local_frame1(def.frame_a.pose());
    joint.set_local_frame2(def.frame_b.pose());
    joint.set_contacts_enabled(def.flags & DCD_JOINT_COLLIDE != 0);
    if def.flags & DCD_JOINT_LIMIT != 0 {
        let [low, high] = def.limit;
        if limited.is_empty() || !(is_in_range(low) && is_in_range(high) && low <= high) {
            return Err(Failure::argument(format!(
                "limit {low} to {high} is none; give a finite lower and upper one, and none for a fixed joint"
            )));
        }
        for &axis in limited {
            joint.set_limits(axis, [low, high]);
        }
    }
    if def.flags & DCD_JOINT_MOTOR != 0 {
        check_motor(def.motor_speed, def.motor_max_force)?;
        let axis = free_axis(locked).ok_or_else(no_motor)?;
        drive(&mut joint, axis, def.motor_speed, def.motor_max_force);
    }
    Ok(joint)
}

/// The one axis that a motor can drive.
fn free_axis(locked: JointAxesMask) -> Option<JointAxis> {
    match locked {
        JointAxesMask::LOCKED_REVOLUTE_AXES => Some(JointAxis::AngX),
        JointAxesMask::LOCKED_PRISMATIC_AXES => Some(JointAxis::LinX),
        _ => None,
    }
}

fn drive(joint: &mut GenericJoint, axis: JointAxis, speed: f32, max_force: f32) {
    joint.set_motor_model(axis, MotorModel::AccelerationBased);
    joint.set_motor_velocity(axis, speed, MOTOR_GAIN);
    joint.set_motor_max_force(axis, max_force);
}

fn no_motor() -> Failure {
    Failure::argument("only revolute and prismatic joints have a motor; use one of these")
}

fn check_motor(speed: f32, max_force: f32) -> Result<(), Failure> {
    check_numbers(&[speed], "the motor's speed")?;
    if max_force.is_finite() && max_force >= 0.0 {
        return Ok(());
    }
    Err(Failure::argument(format!(
        "the motor's greatest force is {max_force}; give a finite number of 0 or more"
    )))
}
