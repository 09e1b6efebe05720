//! Reads and sets the pose, velocity, kinematic target and sleep of single bodies.

use dcd::{BodyId, BodyKind, WorldPose};

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::limits::DCD_MAX_NUMBER;
use crate::pointer::{self, Out, Sized32, check_point};
use crate::properties::type_of;
use crate::registry::{World, ask, find, missing, with};
use crate::status::{DcdStatus, Failure};
use crate::types::{DCD_NO_REGION, DcdBodyType, DcdPose, DcdVelocity, check_pose, check_velocity};

/// State of a body besides pose and velocity. Start from DCD_BODY_INFO_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBodyInfo {
    /// Size of this struct: sizeof(DcdBodyInfo).
    pub struct_size: u32,
    /// Type: DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    pub body_type: DcdBodyType,
    /// User data of the body.
    pub user_data: u64,
    /// Centre of mass, world space, metres; in a served world the body's origin.
    pub centre: [f64; 3],
    /// Mass, kilograms; 0 for a fixed body, and in a served world, where it is not told.
    pub mass: f32,
    /// Region that owns the body, as in DcdRegionInfo; DCD_NO_REGION for a fixed body and for an avatar that has not appeared yet.
    /// In a served world as DcdOwner.region.
    pub region: u32,
    /// Force that dcd_body_set_force and dcd_body_add_force put on the body, newtons.
    pub force: [f32; 3],
    /// Torque that dcd_body_set_force and dcd_body_add_force put on the body, newton metres.
    pub torque: [f32; 3],
    /// Number of the body's colliders.
    pub colliders: u32,
    /// Says whether the body sleeps: it costs nothing until something wakes it.
    pub sleeping: bool,
    /// Says whether this process's interest does not reach the body (dcd_interest_set). Then this is what was last heard of it.
    pub outside: bool,
    /// Reserved; always 0.
    pub reserved: [u8; 2],
}

// SAFETY: begins with `struct_size`; it is only written, so any bits in its bools do no harm.
unsafe impl Sized32 for DcdBodyInfo {
    const NAME: &'static str = "DcdBodyInfo";
}

/// Reads the type, mass, owner, forces and sleep of a body.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_info(world: DcdWorld, body: DcdBodyId, out: *mut DcdBodyInfo) -> DcdStatus {
    guard("dcd_body_info", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let id = world.mark.body_id(body)?;
            let view = view(world, body)?;
            let record = world.dcd.record(id).ok_or_else(|| missing(world, body))?;
            out.write(DcdBodyInfo {
                struct_size: size_of::<DcdBodyInfo>() as u32,
                body_type: type_of(view.kind),
                user_data: view.user_data as u64,
                centre: world.dcd.centre_of_mass(id).unwrap_or(view.pose.translation),
                mass: view.mass_kg.unwrap_or(0.0),
                region: view.owner.map_or(DCD_NO_REGION, |region| region.0),
                force: record.state.force,
                torque: record.state.torque,
                colliders: record.traits.colliders.len() as u32,
                sleeping: view.sleeping,
                outside: view.outside,
                reserved: [0; 2],
            });
            Ok(())
        })
    })
}

/// Reads the pose and velocity of a body. `pose` or `velocity` may be null. For many bodies use dcd_state_view and dcd_state_read.
/// A client or participant reads what it was last told, every DcdServerDef.state_every steps; to draw, use dcd_view_body.
///
/// Errors: DCD_ERR_NULL (world, body), DCD_ERR_STALE_ID.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_get(
    world: DcdWorld,
    body: DcdBodyId,
    pose: *mut DcdPose,
    velocity: *mut DcdVelocity,
) -> DcdStatus {
    guard("dcd_body_get", || {
        // SAFETY: the caller vouches for what is not null.
        let (pose, velocity) =
            unsafe { (Out::optional(pose, "pose")?, Out::optional(velocity, "velocity")?) };
        ask(world, |world| {
            let id = world.mark.body_id(body)?;
            let missing = || missing(world, body);
            match (pose, velocity) {
                (Some(pose), None) => pose.write(world.dcd.pose(id).ok_or_else(missing)?.into()),
                (None, Some(out)) => out.write(world.dcd.velocity(id).ok_or_else(missing)?.into()),
                (Some(pose), Some(out)) => {
                    let (now, moves) = world.dcd.motion(id).ok_or_else(missing)?;
                    pose.write(now.into());
                    out.write(moves.into());
                }
                (None, None) => drop(find(world, body)?),
            }
            Ok(())
        })
    })
}

/// Interpolates between two poses, for drawing between steps: `t` = 0 is `from`, 1 is `to`. Positions go straight, rotations by
/// SLERP the shorter way. `from`, `to` and `out` may be the same. The call needs no world, and may run beside any other call.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_ARGUMENT (a `t` that is not finite, a pose out of range, or a q that is not of length 1).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_pose_interpolate(
    from: *const DcdPose,
    to: *const DcdPose,
    t: f64,
    out: *mut DcdPose,
) -> DcdStatus {
    guard("dcd_pose_interpolate", || {
        // SAFETY: the caller vouches for the pointers.
        let (from, to, out) =
            unsafe { (pointer::read(from, "from")?, pointer::read(to, "to")?, Out::new(out, "out")?) };
        let (from, to) = (WorldPose::from(from), WorldPose::from(to));
        for (pose, name) in [(&from, "from"), (&to, "to")] {
            check_point(&pose.translation, name)?;
            if !pose.is_valid() {
                return Err(Failure::argument(format!("{name}.q is not of length 1; normalise it")));
            }
        }
        if !t.is_finite() {
            return Err(Failure::argument(
                "t is not finite; give the part of a step that has passed, 0 to 1",
            ));
        }
        out.write(from.interpolated(&to, t).into());
        Ok(())
    })
}

/// Teleports a body to a pose, whatever is there, and wakes it.
///
/// - In a local world any body may be moved, also a fixed one. The body keeps its velocity.
/// - A client or participant moves its own avatars except characters, which obey dcd_body_set_velocity alone. A server moves all
///   but fixed bodies; a builder does so with the world's own. The next dcd_step asks for it. The body gets the velocity that this
///   process last heard of (dcd_body_get), up to half a second old, or the one that is set in the same step.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a pose out of range, or whose q is not of length 1.
/// - DCD_ERR_UNSUPPORTED: a body that this process may not move.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_set_pose(
    world: DcdWorld,
    body: DcdBodyId,
    pose: *const DcdPose,
) -> DcdStatus {
    guard("dcd_body_set_pose", || {
        // SAFETY: the caller vouches for the pointer.
        let pose = unsafe { pointer::read(pose, "pose")? };
        with(world, |world| {
            let id = find(world, body)?;
            set_pose(world, id, pose)
        })
    })
}

/// Sets the velocity of a dynamic or kinematic body, and wakes it. A client or participant drives its own avatars, a server all
/// bodies, and a builder those of the world's own. In a served world the next dcd_step asks for it.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: numbers out of range, a dynamic body above DcdWorldInfo.speed_limit, a fixed body, or one that follows
///   poses.
/// - DCD_ERR_UNSUPPORTED: a body that this process may not drive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_set_velocity(
    world: DcdWorld,
    body: DcdBodyId,
    velocity: *const DcdVelocity,
) -> DcdStatus {
    guard("dcd_body_set_velocity", || {
        // SAFETY: the caller vouches for the pointer.
        let velocity = unsafe { pointer::read(velocity, "velocity")? };
        with(world, |world| {
            let id = find(world, body)?;
            set_velocity(world, id, velocity)
        })
    })
}

/// Sets the kinematic target of a body of type DCD_KINEMATIC_POSE: the pose that it has after the next step. What it touches feels
/// the speed that this takes. The body stays there until it gets another target. For many bodies use dcd_state_write.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: another type; a pose out of range, whose q is not of length 1, or so far off that the body would be faster
///   than DCD_MAX_NUMBER.
/// - DCD_ERR_UNSUPPORTED: in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_set_target(
    world: DcdWorld,
    body: DcdBodyId,
    pose: *const DcdPose,
) -> DcdStatus {
    guard("dcd_body_set_target", || {
        // SAFETY: the caller vouches for the pointer.
        let pose = unsafe { pointer::read(pose, "pose")? };
        with(world, |world| {
            let id = find(world, body)?;
            set_target(world, id, pose)
        })
    })
}

/// Wakes a body. Bodies wake by themselves when something that moves touches them.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (in a served world, except for its server and builders, which wake
/// movable bodies).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_wake(world: DcdWorld, body: DcdBodyId) -> DcdStatus {
    guard("dcd_body_wake", || {
        with(world, |world| {
            let id = find(world, body)?;
            world.dcd.update(id, |body| body.wake_up(true)).map_err(Failure::from)
        })
    })
}

/// Puts a body to sleep: it stops, and costs nothing until something wakes it. A body that touches others that are
/// awake, or is tied to them, is woken in the next step: put all of them to sleep.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_sleep(world: DcdWorld, body: DcdBodyId) -> DcdStatus {
    guard("dcd_body_sleep", || {
        with(world, |world| {
            let id = find(world, body)?;
            world.dcd.update(id, |body| body.sleep()).map_err(Failure::from)
        })
    })
}

/// Returns what the world knows of a body.
pub(crate) fn view(world: &World, body: DcdBodyId) -> Result<dcd::Body, Failure> {
    let id = world.mark.body_id(body)?;
    world.dcd.body(id).ok_or_else(|| missing(world, body))
}

pub(crate) fn set_pose(world: &mut World, id: BodyId, pose: DcdPose) -> Result<(), Failure> {
    check_pose(&pose)?;
    Ok(world.dcd.set_pose(id, pose.into())?)
}

pub(crate) fn set_velocity(world: &mut World, id: BodyId, velocity: DcdVelocity) -> Result<(), Failure> {
    check_velocity(&velocity)?;
    match world.dcd.body(id).map(|body| body.kind) {
        Some(BodyKind::Fixed) => Err(Failure::argument("the body is fixed; make it kinematic to move it"))?,
        Some(BodyKind::KinematicPosition) => {
            Err(Failure::argument("the body follows poses; give it one by dcd_body_set_target"))?
        }
        _ => {}
    }
    Ok(world.dcd.set_velocity(id, velocity.into())?)
}

pub(crate) fn set_target(world: &mut World, id: BodyId, pose: DcdPose) -> Result<(), Failure> {
    world.dcd.sends_bodies()?;
    check_pose(&pose)?;
    let Some(body) = world.dcd.body(id).filter(|body| body.kind == BodyKind::KinematicPosition) else {
        return Err(Failure::argument(
            "the body does not follow poses; make it DCD_KINEMATIC_POSE, or move it by dcd_body_set_pose",
        ));
    };
    let way: [f64; 3] = std::array::from_fn(|i| pose.p[i] - body.pose.translation[i]);
    let speed = way.iter().map(|v| v * v).sum::<f64>().sqrt() / f64::from(world.dcd.dt_s());
    if speed > f64::from(DCD_MAX_NUMBER) {
        return Err(Failure::argument(format!(
            "to be there after a step it would move at {speed:.0} m/s; send it nearer, or put it there by dcd_body_set_pose"
        )));
    }
    Ok(world.dcd.set_next_pose(id, pose.into())?)
}
