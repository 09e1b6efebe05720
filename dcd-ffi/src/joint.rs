//! Defines joints for C: their types, axes, limits and motors, and how they become Rapier's joints.

mod calls;

use dcd::protocol::{JointRecord, WorldPose};
use rapier3d::prelude::*;

use crate::ids::DcdBodyId;
use crate::pointer::{self, Sized32, check_bits, check_not_negative, check_numbers, is_in_range};
use crate::registry::World;
use crate::status::Failure;
use crate::types::DcdFrame;
pub use calls::*;

/// Type of a joint: what it lets free. Each type has axes of its own, to which `limit` and `motor` of DcdJointDef apply.
pub type DcdJointType = u32;

/// Lets nothing free: the frames stay together. It has no axis of its own.
pub const DCD_JOINT_FIXED: DcdJointType = 0;
/// Lets the bodies turn about the frames' x axis, as hinges and wheels do. Its axis is DCD_AXIS_TURN_X.
pub const DCD_JOINT_REVOLUTE: DcdJointType = 1;
/// Lets the bodies slide along the frames' x axis, as lifts and pistons do. Its axis is DCD_AXIS_X.
pub const DCD_JOINT_PRISMATIC: DcdJointType = 2;
/// Lets the bodies turn about every axis, as shoulders do. Its axes are DCD_AXIS_TURN_X, DCD_AXIS_TURN_Y and DCD_AXIS_TURN_Z, each
/// with the same limit and motor.
pub const DCD_JOINT_SPHERICAL: DcdJointType = 3;
/// Lets everything free up to a distance of the frames' origins. It needs a limit of DCD_AXIS_X from 0 to that length.
pub const DCD_JOINT_ROPE: DcdJointType = 4;
/// Lets everything free; a spring pulls the frames' origins to a distance. It needs a motor of DCD_AXIS_X, whose position is the
/// length at rest. Take DCD_MOTOR_FORCE to give stiffness in N/m.
pub const DCD_JOINT_SPRING: DcdJointType = 5;
/// Lets free what DcdJointDef.locked does not lock. It has no axes of its own: dcd_joint_set_limit and dcd_joint_set_motor take
/// any.
pub const DCD_JOINT_GENERIC: DcdJointType = 6;

/// Axis of a joint's frame on body `a`: along it, or about it. As a bit it is 1 << axis, as DCD_LOCK_… bits are.
pub type DcdJointAxis = u32;

/// Movement along x: metres, m/s, newtons.
pub const DCD_AXIS_X: DcdJointAxis = 0;
/// Movement along y: metres, m/s, newtons.
pub const DCD_AXIS_Y: DcdJointAxis = 1;
/// Movement along z: metres, m/s, newtons.
pub const DCD_AXIS_Z: DcdJointAxis = 2;
/// Turning about x: radians, rad/s, newton metres.
pub const DCD_AXIS_TURN_X: DcdJointAxis = 3;
/// Turning about y: radians, rad/s, newton metres.
pub const DCD_AXIS_TURN_Y: DcdJointAxis = 4;
/// Turning about z: radians, rad/s, newton metres.
pub const DCD_AXIS_TURN_Z: DcdJointAxis = 5;

/// In DcdJointDef.flags: `limit` counts. In DcdJointInfo.flags: the joint has some limit.
pub const DCD_JOINT_LIMIT: u32 = 1;
/// In DcdJointDef.flags: `motor` runs. In DcdJointInfo.flags: the joint has some motor.
pub const DCD_JOINT_MOTOR: u32 = 2;
/// In DcdJointDef.flags: the two bodies collide with one another too.
pub const DCD_JOINT_COLLIDE: u32 = 4;
/// In DcdJointDef.flags: the joint does nothing until dcd_joint_set_flags takes this flag away.
pub const DCD_JOINT_DISABLED: u32 = 8;

/// Model of a motor: whether stiffness and damping are per unit of mass.
pub type DcdMotorModel = u32;

/// Stiffness and damping are per unit of mass, so that heavy and light bodies move alike: stiffness in 1/s², damping in 1/s.
pub const DCD_MOTOR_ACCELERATION: DcdMotorModel = 0;
/// Stiffness and damping are not per unit of mass: stiffness in N/m or N m/rad, damping in N s/m or N m s/rad.
pub const DCD_MOTOR_FORCE: DcdMotorModel = 1;

/// Motor of an axis. It applies stiffness * (position - where it is) + damping * (velocity - how fast it moves), at most max_force.
/// Start from DCD_JOINT_MOTOR_INIT, which holds the axis still by any force. For a speed give `velocity`; for a servo `position`,
/// `stiffness` and `damping`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdJointMotor {
    /// Position that the motor drives to, metres or radians.
    pub position: f32,
    /// Velocity that the motor drives at, m/s or rad/s.
    pub velocity: f32,
    /// Stiffness, 0 or more; 0 heeds the velocity alone.
    pub stiffness: f32,
    /// Damping, 0 or more.
    pub damping: f32,
    /// Largest force or torque, newtons or newton metres; finite, 0 or more.
    pub max_force: f32,
    /// Model: DCD_MOTOR_ACCELERATION or DCD_MOTOR_FORCE.
    pub model: DcdMotorModel,
}

/// Definition of a joint. Start from DCD_JOINT_DEF_INIT and give `a` and `b`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdJointDef {
    /// Size of this struct: sizeof(DcdJointDef).
    pub struct_size: u32,
    /// Type: DCD_JOINT_FIXED to DCD_JOINT_GENERIC.
    pub joint_type: DcdJointType,
    /// First body.
    pub a: DcdBodyId,
    /// Second body, another one than `a`.
    pub b: DcdBodyId,
    /// Frame of the joint on `a`. The joint brings the two frames together.
    pub frame_a: DcdFrame,
    /// Frame of the joint on `b`.
    pub frame_b: DcdFrame,
    /// Lowest and highest position of `b` seen from `a` along or about the type's own axes, metres or radians, with
    /// DCD_JOINT_LIMIT. -INFINITY and INFINITY leave a side open.
    pub limit: [f32; 2],
    /// Motor that drives the type's own axes, with DCD_JOINT_MOTOR.
    pub motor: DcdJointMotor,
    /// DCD_JOINT_LIMIT, DCD_JOINT_MOTOR, DCD_JOINT_COLLIDE and DCD_JOINT_DISABLED bits.
    pub flags: u32,
    /// Axes that a DCD_JOINT_GENERIC does not let free, as bits 1 << DCD_AXIS_…; for other types 0.
    pub locked: u32,
    /// Free axes of a DCD_JOINT_GENERIC that count as one, as bits; for other types 0. Two or three axes along may be coupled:
    /// their position is their common distance. Two axes about may be coupled: their position is the angle between the third axes,
    /// as of a cone. Coupled axes have one limit, and those along have one motor.
    pub coupled: u32,
    /// Natural frequency with which the joint holds what it locks and limits, hertz, above 0: how stiff it is. Less than 1 / dt is
    /// soft.
    pub natural_frequency: f32,
    /// Damping ratio, 0 or more: how fast an error of the joint calms down; 1 is without swinging.
    pub damping_ratio: f32,
    /// Reserved; must be 0.
    pub reserved: u32,
    /// User data of the joint; dcd_joint_info gives it back.
    pub user_data: u64,
}

/// State of a joint. Start from DCD_JOINT_INFO_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdJointInfo {
    /// Size of this struct: sizeof(DcdJointInfo).
    pub struct_size: u32,
    /// Type, by what the joint lets free: one made generic may be a hinge, and a rope with a motor is a spring.
    pub joint_type: DcdJointType,
    /// First body.
    pub a: DcdBodyId,
    /// Second body.
    pub b: DcdBodyId,
    /// User data of the joint.
    pub user_data: u64,
    /// Frame of the joint on `a`.
    pub frame_a: DcdFrame,
    /// Frame of the joint on `b`.
    pub frame_b: DcdFrame,
    /// frame_b seen from frame_a, as the bodies are now.
    pub offset: DcdFrame,
    /// Position: angle of a revolute joint, -π to π; way of a prismatic one; distance of a rope or spring; else 0.
    pub position: f32,
    /// Force in the last step that held the axes along x, y and z of frame_a that the joint locks, newtons. Rapier mixes what it
    /// solves, so take it for an estimate, such as of what should break the joint. 0 in a served world, where it is not told.
    pub force: [f32; 3],
    /// Natural frequency, hertz, as in DcdJointDef.
    pub natural_frequency: f32,
    /// Damping ratio, as in DcdJointDef.
    pub damping_ratio: f32,
    /// DCD_JOINT_LIMIT, DCD_JOINT_MOTOR, DCD_JOINT_COLLIDE and DCD_JOINT_DISABLED bits.
    pub flags: u32,
    /// Axes that are not free, as bits 1 << DCD_AXIS_….
    pub locked: u32,
    /// Axes that count as one, as bits 1 << DCD_AXIS_….
    pub coupled: u32,
    /// Axes with a limit, as bits 1 << DCD_AXIS_….
    pub limited: u32,
    /// Axes with a motor, as bits 1 << DCD_AXIS_….
    pub driven: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdJointDef {
    const NAME: &'static str = "DcdJointDef";
}
// SAFETY: as above.
unsafe impl Sized32 for DcdJointInfo {
    const NAME: &'static str = "DcdJointInfo";
}

fn axes(bits: u8) -> JointAxesMask {
    JointAxesMask::from_bits_truncate(bits)
}

/// Returns which axes a type locks, which it couples, and which are its own.
fn layout(joint_type: DcdJointType) -> Option<(JointAxesMask, JointAxesMask, &'static [JointAxis])> {
    let (none, along) = (JointAxesMask::empty(), JointAxesMask::LIN_AXES);
    Some(match joint_type {
        DCD_JOINT_FIXED => (JointAxesMask::LOCKED_FIXED_AXES, none, &[]),
        DCD_JOINT_REVOLUTE => (JointAxesMask::LOCKED_REVOLUTE_AXES, none, &[JointAxis::AngX]),
        DCD_JOINT_PRISMATIC => (JointAxesMask::LOCKED_PRISMATIC_AXES, none, &[JointAxis::LinX]),
        DCD_JOINT_SPHERICAL => {
            (JointAxesMask::LOCKED_SPHERICAL_AXES, none, &[JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ])
        }
        DCD_JOINT_ROPE | DCD_JOINT_SPRING => (none, along, &[JointAxis::LinX]),
        DCD_JOINT_GENERIC => (none, none, &[]),
        _ => return None,
    })
}

/// Returns the type that locks and couples these axes.
fn type_of(record: &JointRecord) -> DcdJointType {
    let (locked, coupled) = (axes(record.locked_axes), axes(record.coupled_axes));
    if coupled == JointAxesMask::LIN_AXES && locked.is_empty() {
        let is_driven = axes(record.motor_axes).contains(JointAxesMask::LIN_X);
        return if is_driven { DCD_JOINT_SPRING } else { DCD_JOINT_ROPE };
    }
    let plain = DCD_JOINT_FIXED..=DCD_JOINT_SPHERICAL;
    let same = |&joint_type: &DcdJointType| {
        layout(joint_type).is_some_and(|(axes, none, _)| (axes, none) == (locked, coupled))
    };
    plain.into_iter().find(same).unwrap_or(DCD_JOINT_GENERIC)
}

fn parse(def: &DcdJointDef) -> Result<GenericJoint, Failure> {
    let (mut locked, mut coupled, own) = layout(def.joint_type).ok_or_else(|| {
        Failure::argument(format!("joint_type {} is none; use a DCD_JOINT_… type", def.joint_type))
    })?;
    pointer::check_reserved(def.reserved)?;
    def.frame_a.check("frame_a")?;
    def.frame_b.check("frame_b")?;
    let known = DCD_JOINT_LIMIT | DCD_JOINT_MOTOR | DCD_JOINT_COLLIDE | DCD_JOINT_DISABLED;
    check_bits(def.flags, known, "flags")?;
    let is_generic = def.joint_type == DCD_JOINT_GENERIC;
    for (bits, name) in [(def.locked, "locked"), (def.coupled, "coupled")] {
        check_bits(bits, if is_generic { 63 } else { 0 }, name)?;
    }
    if is_generic {
        (locked, coupled) = (axes(def.locked as u8), axes(def.coupled as u8));
        check_coupled(locked, coupled)?;
    }
    let mut joint = GenericJoint::new(locked);
    joint.coupled_axes = coupled;
    joint.softness = softness(def.natural_frequency, def.damping_ratio)?;
    joint.set_local_frame1(def.frame_a.pose());
    joint.set_local_frame2(def.frame_b.pose());
    joint.set_contacts_enabled(def.flags & DCD_JOINT_COLLIDE != 0);
    joint.set_enabled(def.flags & DCD_JOINT_DISABLED == 0);
    joint.user_data = u128::from(def.user_data);
    let (limit, motor) = (def.flags & DCD_JOINT_LIMIT != 0, def.flags & DCD_JOINT_MOTOR != 0);
    if (limit || motor) && own.is_empty() {
        return Err(Failure::argument(
            "joints of this type have no axis of their own to limit or drive; clear the flags, and for a generic joint use \
             dcd_joint_set_limit and dcd_joint_set_motor",
        ));
    }
    if def.joint_type == DCD_JOINT_ROPE && !limit {
        return Err(Failure::argument(
            "a rope is its limit; set DCD_JOINT_LIMIT and `limit` to 0 and its length",
        ));
    }
    if def.joint_type == DCD_JOINT_SPRING && !motor {
        return Err(Failure::argument(
            "a spring is its motor; set DCD_JOINT_MOTOR, and motor.position to its length",
        ));
    }
    for &axis in own {
        if limit {
            joint.set_limits(axis, check_limit(axis, coupled, def.limit)?);
        }
        if motor {
            check_motor(&def.motor)?;
            drive(&mut joint, axis, &def.motor);
        }
    }
    Ok(joint)
}

/// Checks that Rapier can couple these axes: two or three along, or two about.
fn check_coupled(locked: JointAxesMask, coupled: JointAxesMask) -> Result<(), Failure> {
    let count = |axes: JointAxesMask| (coupled & axes).bits().count_ones();
    let fits = count(JointAxesMask::LIN_AXES) != 1 && matches!(count(JointAxesMask::ANG_AXES), 0 | 2);
    if fits && (locked & coupled).is_empty() {
        return Ok(());
    }
    Err(Failure::argument(
        "coupled axes are two or three along or none, two about or none, and not locked; couple others",
    ))
}

/// Returns the axis that is meant. Of coupled axes, the first stands for them.
fn free_axis(record: &JointRecord, axis: DcdJointAxis) -> Result<JointAxis, Failure> {
    const ALL: [JointAxis; 6] = [
        JointAxis::LinX,
        JointAxis::LinY,
        JointAxis::LinZ,
        JointAxis::AngX,
        JointAxis::AngY,
        JointAxis::AngZ,
    ];
    let Some(&axis) = ALL.get(axis as usize) else {
        return Err(Failure::argument(format!("axis {axis} is none; use a DCD_AXIS_… constant")));
    };
    if axes(record.locked_axes).contains(axis.into()) {
        return Err(Failure::argument(format!(
            "the joint locks axis {}; limit and drive those that it lets free",
            axis as u32
        )));
    }
    let coupled = axes(record.coupled_axes);
    if !coupled.contains(axis.into()) {
        return Ok(axis);
    }
    let alike = if JointAxesMask::LIN_AXES.contains(axis.into()) { &ALL[..3] } else { &ALL[3..] };
    Ok(alike.iter().copied().find(|&axis| coupled.contains(axis.into())).unwrap_or(axis))
}

/// Returns a limit as Rapier has it, with finite numbers.
fn check_limit(axis: JointAxis, coupled: JointAxesMask, [low, high]: [f32; 2]) -> Result<[f32; 2], Failure> {
    let fits = |end: f32, open: f32| is_in_range(end) || end == open;
    if !(fits(low, f32::NEG_INFINITY) && fits(high, f32::INFINITY) && low <= high) {
        return Err(Failure::argument(format!(
            "limit {low} to {high} is none; give the lower number first, within DCD_MAX_NUMBER or infinite"
        )));
    }
    if (coupled & JointAxesMask::LIN_AXES).contains(axis.into()) && low != 0.0 {
        return Err(Failure::argument(format!("limit[0] of a distance is {low}; give 0: it has no lowest")));
    }
    Ok([low.max(-f32::MAX), high.min(f32::MAX)])
}

fn check_motor(motor: &DcdJointMotor) -> Result<(), Failure> {
    check_numbers(&[motor.position, motor.velocity], "motor.position or motor.velocity")?;
    check_not_negative(motor.stiffness, "motor.stiffness")?;
    check_not_negative(motor.damping, "motor.damping")?;
    if motor.model > DCD_MOTOR_FORCE {
        return Err(Failure::argument(format!(
            "motor.model {} is none; use DCD_MOTOR_ACCELERATION or DCD_MOTOR_FORCE",
            motor.model
        )));
    }
    if motor.max_force.is_finite() && motor.max_force >= 0.0 {
        return Ok(());
    }
    Err(Failure::argument(format!(
        "motor.max_force is {}; give a finite number of 0 or more",
        motor.max_force
    )))
}

fn drive(joint: &mut GenericJoint, axis: JointAxis, motor: &DcdJointMotor) {
    let force = motor.model == DCD_MOTOR_FORCE;
    joint.set_motor_model(axis, if force { MotorModel::ForceBased } else { MotorModel::AccelerationBased });
    joint.set_motor(axis, motor.position, motor.velocity, motor.stiffness, motor.damping);
    joint.set_motor_max_force(axis, motor.max_force);
}

fn softness(natural_frequency: f32, damping_ratio: f32) -> Result<SpringCoefficients<f32>, Failure> {
    check_not_negative(damping_ratio, "damping_ratio")?;
    check_not_negative(natural_frequency, "natural_frequency")?;
    if natural_frequency == 0.0 {
        return Err(Failure::argument("natural_frequency is 0; give hertz above 0, or disable the joint"));
    }
    Ok(SpringCoefficients::new(natural_frequency, damping_ratio))
}

/// Returns `None` when one of the joint's bodies is not there, which cannot be.
fn describe(world: &World, record: &JointRecord) -> Option<DcdJointInfo> {
    let frame = |pose: dcd::protocol::Pose| DcdFrame { p: pose.translation, q: pose.rotation };
    let placed = |body, frame: dcd::protocol::Pose| {
        let frame = WorldPose { translation: frame.translation.map(f64::from), rotation: frame.rotation };
        Some(world.dcd.pose(body)?.isometry() * frame.isometry())
    };
    let between = placed(record.a, record.frame_a)?.inv_mul(&placed(record.b, record.frame_b)?);
    let (way, turn) = (between.translation.vector, between.rotation);
    let joint_type = type_of(record);
    let load = world.dcd.joint_load(record.id).unwrap_or_default();
    let bit = |bit: u32, set: bool| if set { bit } else { 0 };
    Some(DcdJointInfo {
        struct_size: size_of::<DcdJointInfo>() as u32,
        joint_type,
        a: world.mark.body(record.a),
        b: world.mark.body(record.b),
        user_data: record.user_data as u64,
        frame_a: frame(record.frame_a),
        frame_b: frame(record.frame_b),
        offset: DcdFrame {
            p: [way.x as f32, way.y as f32, way.z as f32],
            q: [turn.i as f32, turn.j as f32, turn.k as f32, turn.w as f32],
        },
        position: match joint_type {
            // A quaternion and its negative give the same angle.
            DCD_JOINT_REVOLUTE => 2.0 * (turn.i * turn.w.signum()).atan2(turn.w.abs()) as f32,
            DCD_JOINT_PRISMATIC => way.x as f32,
            DCD_JOINT_ROPE | DCD_JOINT_SPRING => way.norm() as f32,
            _ => 0.0,
        },
        force: [load[0], load[1], load[2]],
        natural_frequency: record.softness[0],
        damping_ratio: record.softness[1],
        flags: bit(DCD_JOINT_LIMIT, record.limit_axes != 0)
            | bit(DCD_JOINT_MOTOR, record.motor_axes != 0)
            | bit(DCD_JOINT_COLLIDE, record.contacts_enabled)
            | bit(DCD_JOINT_DISABLED, !record.enabled),
        locked: record.locked_axes.into(),
        coupled: record.coupled_axes.into(),
        limited: record.limit_axes.into(),
        driven: record.motor_axes.into(),
    })
}
