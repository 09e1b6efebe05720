//! Bodies: making, asking, moving, pushing.

use std::collections::BTreeSet;

use dcd::protocol::WorldPose;
use dcd::space::BodyId;
use rapier3d::prelude::*;

use crate::backend::BodyView;
use crate::guard::{guard, guard_value};
use crate::handle::stale;
use crate::pointer::{self, Out, Sized32, check_numbers, check_point, is_in_range};
use crate::shape::{self, DcdShapeId};
use crate::status::{DcdStatus, Failure};
use crate::types::{DcdPose, DcdVelocity};
use crate::world::{DcdWorld, World, with};

/// A body. 0 is null. An id is never given again, so that of a destroyed body stays stale for ever; an id of another world
/// is stale in this one. It holds in this process only.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdBodyId {
    /// Opaque.
    pub v: u64,
}

/// How a body moves.
pub type DcdBodyType = u32;

/// Never. Ground and walls.
pub const DCD_FIXED: DcdBodyType = 0;
/// By forces.
pub const DCD_DYNAMIC: DcdBodyType = 1;
/// At the velocity that you give, whatever it meets. Doors and lifts.
pub const DCD_KINEMATIC: DcdBodyType = 2;

/// In DcdBodyDef.flags: never jumps through thin or moving bodies, at some cost.
pub const DCD_BODY_CCD: u32 = 1;
/// In DcdBodyDef.flags: detects and does not push.
pub const DCD_BODY_SENSOR: u32 = 2;
/// In DcdBodyDef.flags: does not fall asleep by itself.
pub const DCD_BODY_NO_SLEEP: u32 = 4;
/// In DcdBodyDef.flags: sleeps until something wakes it.
pub const DCD_BODY_ASLEEP: u32 = 8;

/// In DcdBodyDef.events: dcd_events tells of contacts that begin and end.
pub const DCD_EVENT_CONTACT: u32 = 1;
/// In DcdBodyDef.events: dcd_events tells of contacts that press harder than force_threshold.
pub const DCD_EVENT_FORCE: u32 = 2;

/// In DcdBodyDef.locked: no movement along x.
pub const DCD_LOCK_X: u32 = 1;
/// In DcdBodyDef.locked: no movement along y.
pub const DCD_LOCK_Y: u32 = 2;
/// In DcdBodyDef.locked: no movement along z.
pub const DCD_LOCK_Z: u32 = 4;
/// In DcdBodyDef.locked: no turning about x.
pub const DCD_LOCK_TURN_X: u32 = 8;
/// In DcdBodyDef.locked: no turning about y.
pub const DCD_LOCK_TURN_Y: u32 = 16;
/// In DcdBodyDef.locked: no turning about z.
pub const DCD_LOCK_TURN_Z: u32 = 32;

/// As DcdBodyInfo.region of a fixed body, which has no owner.
pub const DCD_NO_REGION: u32 = u32::MAX;

/// How a body is made. Start from DCD_BODY_DEF_INIT and give at least `shape`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBodyDef {
    /// sizeof(DcdBodyDef).
    pub struct_size: u32,
    /// DCD_FIXED, DCD_DYNAMIC or DCD_KINEMATIC.
    pub body_type: DcdBodyType,
    /// Where it starts.
    pub pose: DcdPose,
    /// How it moves at first.
    pub velocity: DcdVelocity,
    /// Of the same world. Two bodies may share one.
    pub shape: DcdShapeId,
    /// kg/m³, above 0 for a dynamic body.
    pub density: f32,
    /// Coulomb coefficient, 0 or more; two bodies in contact use the mean.
    pub friction: f32,
    /// 0 (no bounce) to 1 (all of the speed); two bodies in contact use the mean.
    pub restitution: f32,
    /// Slows movement down: 1/s, 0 or more.
    pub linear_damping: f32,
    /// Slows turning down: 1/s, 0 or more.
    pub angular_damping: f32,
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// DCD_BODY_… bits.
    pub flags: u32,
    /// DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    pub locked: u32,
    /// DCD_EVENT_… bits. A contact is told of when either body asks for it.
    pub events: u32,
    /// Newtons above which DCD_EVENT_FORCE tells, 0 or more.
    pub force_threshold: f32,
    /// Groups that the body belongs to, as bits.
    pub groups: u32,
    /// Groups that it meets. Two bodies collide when each meets a group of the other.
    pub mask: u32,
    /// Your own; events, views and ray hits carry it.
    pub user_data: u64,
}

/// What a body is now. Start from DCD_BODY_INFO_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBodyInfo {
    /// sizeof(DcdBodyInfo).
    pub struct_size: u32,
    /// DCD_FIXED, DCD_DYNAMIC or DCD_KINEMATIC.
    pub body_type: DcdBodyType,
    /// Your own.
    pub user_data: u64,
    /// Kilograms; 0 for a fixed body.
    pub mass: f32,
    /// The region that owns it, as in DcdRegionInfo; DCD_NO_REGION for a fixed body.
    pub region: u32,
    /// Whether it sleeps: it costs nothing until something wakes it.
    pub sleeping: bool,
    /// 0.
    pub reserved: [u8; 7],
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdBodyDef {
    const NAME: &'static str = "DcdBodyDef";
}
// SAFETY: as above; it is only written, so that any bits in `sleeping` do no harm.
unsafe impl Sized32 for DcdBodyInfo {
    const NAME: &'static str = "DcdBodyInfo";
}

/// Makes a body. As dcd_bodies_create with one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_create(
    world: DcdWorld,
    def: *const DcdBodyDef,
    out: *mut DcdBodyId,
) -> DcdStatus {
    // SAFETY: passed on.
    guard("dcd_body_create", || unsafe { create(world, def, 1, out) })
}

/// Makes `count` bodies, all or none: `defs` and `out` have `count` entries. Bodies are in the world at once; the next step
/// moves them.
///
/// `defs` is read during the call.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range or
/// more than DCD_MAX_ITEMS bodies, DCD_ERR_LIMIT when the world has given 4,294,967,295 ids.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_bodies_create(
    world: DcdWorld,
    defs: *const DcdBodyDef,
    count: usize,
    out: *mut DcdBodyId,
) -> DcdStatus {
    // SAFETY: passed on.
    guard("dcd_bodies_create", || unsafe { create(world, defs, count, out) })
}

/// # Safety
/// `defs` and `out` are null or have `count` entries.
unsafe fn create(
    world: DcdWorld,
    defs: *const DcdBodyDef,
    count: usize,
    out: *mut DcdBodyId,
) -> Result<(), Failure> {
    if count > 0 {
        // SAFETY: at least one entry. Its size is checked before the others are looked for behind it.
        unsafe { pointer::read_sized(defs, "def")? };
        pointer::check(out, "out")?;
    }
    // SAFETY: the caller vouches for `count` entries.
    let defs = unsafe { pointer::slice(defs, count, "def")? };
    with(world, |world| {
        let parsed: Vec<_> = defs
            .iter()
            .enumerate()
            .map(|(i, def)| {
                parse(world, def).map_err(|failure| match count {
                    1 => failure,
                    _ => Failure::new(failure.status, format!("defs[{i}]: {}", failure.message)),
                })
            })
            .collect::<Result<_, _>>()?;
        let mut made = Vec::with_capacity(count);
        for (pose, body, collider) in parsed {
            match world.backend.insert(pose, body, collider) {
                Ok(id) => made.push(id),
                Err(failure) => {
                    for id in made {
                        world.backend.remove(id)?;
                    }
                    return Err(failure);
                }
            }
        }
        world.events.owners_changed();
        for (i, &id) in made.iter().enumerate() {
            // SAFETY: not null, aligned, and the caller vouches for `count` entries.
            unsafe { out.add(i).write(world.mark.body(id)) };
        }
        Ok(())
    })
}

/// Checks a definition and turns it into Rapier's builders.
fn parse(world: &World, def: &DcdBodyDef) -> Result<(WorldPose, RigidBodyBuilder, ColliderBuilder), Failure> {
    if def.struct_size as usize != size_of::<DcdBodyDef>() {
        return Err(Failure::new(
            crate::status::DCD_ERR_STRUCT,
            format!("struct_size is {}; start each entry from DCD_BODY_DEF_INIT", def.struct_size),
        ));
    }
    let kind = match def.body_type {
        DCD_FIXED => RigidBodyType::Fixed,
        DCD_DYNAMIC => RigidBodyType::Dynamic,
        DCD_KINEMATIC => RigidBodyType::KinematicVelocityBased,
        other => {
            return Err(Failure::argument(format!(
                "body_type {other} is none; use DCD_FIXED, DCD_DYNAMIC or DCD_KINEMATIC"
            )));
        }
    };
    check_pose(&def.pose)?;
    check_velocity(&def.velocity)?;
    for (value, name) in [
        (def.density, "density"),
        (def.friction, "friction"),
        (def.restitution, "restitution"),
        (def.linear_damping, "linear_damping"),
        (def.angular_damping, "angular_damping"),
        (def.force_threshold, "force_threshold"),
    ] {
        if !(is_in_range(value) && value >= 0.0) {
            return Err(Failure::argument(format!(
                "{name} is {value}; give a number from 0 to DCD_MAX_NUMBER"
            )));
        }
    }
    if kind == RigidBodyType::Dynamic && def.density == 0.0 {
        return Err(Failure::argument("density is 0; a dynamic body needs some mass, water has 1000 kg/m³"));
    }
    check_numbers(&[def.gravity_scale], "gravity_scale")?;
    check_bits(def.flags, DCD_BODY_CCD | DCD_BODY_SENSOR | DCD_BODY_NO_SLEEP | DCD_BODY_ASLEEP, "flags")?;
    check_bits(def.locked, 63, "locked")?;
    check_bits(def.events, DCD_EVENT_CONTACT | DCD_EVENT_FORCE, "events")?;

    let mut events = ActiveEvents::empty();
    events.set(ActiveEvents::COLLISION_EVENTS, def.events & DCD_EVENT_CONTACT != 0);
    events.set(ActiveEvents::CONTACT_FORCE_EVENTS, def.events & DCD_EVENT_FORCE != 0);
    let body = RigidBodyBuilder::new(kind)
        .linvel(Vector::from_array(def.velocity.linear))
        .angvel(Vector::from_array(def.velocity.angular))
        .linear_damping(def.linear_damping)
        .angular_damping(def.angular_damping)
        .gravity_scale(def.gravity_scale)
        .locked_axes(LockedAxes::from_bits_truncate(def.locked as u8))
        .ccd_enabled(def.flags & DCD_BODY_CCD != 0)
        .can_sleep(def.flags & DCD_BODY_NO_SLEEP == 0)
        .sleeping(def.flags & DCD_BODY_ASLEEP != 0)
        .user_data(u128::from(def.user_data));
    let collider = ColliderBuilder::new(shape::find(world, def.shape)?.clone())
        .density(def.density)
        .friction(def.friction)
        .restitution(def.restitution)
        .sensor(def.flags & DCD_BODY_SENSOR != 0)
        .active_events(events)
        .contact_force_event_threshold(def.force_threshold)
        .collision_groups(InteractionGroups::new(
            Group::from_bits_retain(def.groups),
            Group::from_bits_retain(def.mask),
            InteractionTestMode::And,
        ));
    Ok((def.pose.into(), body, collider))
}

/// Destroys `count` bodies with their joints, all or none; contacts they had are told as ended after the next step.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (the world, a body, or a body named twice), DCD_ERR_ARGUMENT for more than
/// DCD_MAX_ITEMS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_bodies_destroy(
    world: DcdWorld,
    bodies: *const DcdBodyId,
    count: usize,
) -> DcdStatus {
    guard("dcd_bodies_destroy", || {
        // SAFETY: the caller vouches for `count` entries.
        let bodies = unsafe { pointer::slice(bodies, count, "bodies")? };
        with(world, |world| {
            let mut ids = BTreeSet::new();
            for &body in bodies {
                let id = find(world, body)?;
                if !ids.insert(id) {
                    return Err(stale("body", body.v));
                }
            }
            for id in ids {
                world.events.departs(id, world.backend.user_data(id).unwrap_or(0));
                world.backend.remove(id)?;
            }
            world.events.owners_changed();
            Ok(())
        })
    })
}

/// Destroys one body. As dcd_bodies_destroy.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_destroy(world: DcdWorld, body: DcdBodyId) -> DcdStatus {
    // SAFETY: a reference to one body is valid for reading one.
    unsafe { dcd_bodies_destroy(world, &body, 1) }
}

/// Whether the id names a body of this world.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_is_valid(world: DcdWorld, body: DcdBodyId) -> bool {
    guard_value(false, || with(world, |world| find(world, body)).is_ok())
}

/// Finds the body that the world numbered `index` when it was made: body i of a scene, or the i-th that was created.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID when that body is destroyed or there is none yet.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_at(world: DcdWorld, index: u32, out: *mut DcdBodyId) -> DcdStatus {
    guard("dcd_body_at", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        with(world, |world| {
            let id = BodyId::persistent(index);
            if !world.backend.contains(id) {
                return Err(stale("body number", u64::from(index)));
            }
            out.write(world.mark.body(id));
            Ok(())
        })
    })
}

/// Says what a body is now: type, mass, owner, sleep.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_info(world: DcdWorld, body: DcdBodyId, out: *mut DcdBodyInfo) -> DcdStatus {
    guard("dcd_body_info", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::sized(out, "out")? };
        with(world, |world| {
            let view = view(world, body)?;
            out.write(DcdBodyInfo {
                struct_size: size_of::<DcdBodyInfo>() as u32,
                body_type: view.kind,
                user_data: view.user_data,
                mass: view.mass_kg,
                region: view.owner.map_or(DCD_NO_REGION, |region| region.0),
                sleeping: view.sleeping,
                reserved: [0; 7],
            });
            Ok(())
        })
    })
}

/// Reads where a body is and how it moves. `pose` or `velocity` may be null. For many bodies see dcd_state_view and
/// dcd_state_read.
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
        let (pose, velocity) = unsafe {
            (
                if pose.is_null() { None } else { Some(Out::new(pose, "pose")?) },
                if velocity.is_null() { None } else { Some(Out::new(velocity, "velocity")?) },
            )
        };
        with(world, |world| {
            let view = view(world, body)?;
            if let Some(out) = pose {
                out.write(view.pose.into());
            }
            if let Some(out) = velocity {
                out.write(view.velocity.into());
            }
            Ok(())
        })
    })
}

/// Puts a body elsewhere at once, whatever is there, and wakes it. A fixed body may be moved so too.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a pose out of range or whose q is not of length 1.
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

/// Sets how a dynamic or kinematic body moves, and wakes it.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for numbers out of range or a fixed body.
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

/// Pushes a dynamic body once, and wakes it: `impulse` in N s, world axes, at `point` in world space, metres; a null `point`
/// is the centre of mass.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a body that is not dynamic, or that would be
/// faster than DCD_MAX_NUMBER; forces and impulses themselves may be larger.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_apply_impulse(
    world: DcdWorld,
    body: DcdBodyId,
    impulse: *const f32,
    point: *const f64,
) -> DcdStatus {
    guard("dcd_body_apply_impulse", || {
        // SAFETY: the caller vouches for three numbers behind each pointer that is not null.
        let (impulse, point) = unsafe {
            let point = point.cast::<[f64; 3]>();
            (
                pointer::read(impulse.cast::<[f32; 3]>(), "impulse")?,
                if point.is_null() { None } else { Some(pointer::read(point, "point")?) },
            )
        };
        if let Some(point) = &point {
            check_point(point, "point")?;
        }
        with(world, |world| {
            let id = find_dynamic(world, body)?;
            let impulse = Vector::from_array(impulse);
            // About the centre of mass, which is the same in every region, whatever its anchor.
            let turn = match (point, world.backend.centre_of_mass(id)) {
                (Some(point), Some(centre)) => {
                    let arm: [f32; 3] = std::array::from_fn(|i| (point[i] - centre[i]) as f32);
                    Vector::from_array(arm).cross(impulse)
                }
                _ => Vector::ZERO,
            };
            check_kick(world, id, impulse, turn, 1.0)?;
            world.backend.update(id, |body| {
                body.apply_impulse(impulse, true);
                body.apply_torque_impulse(turn, true);
            })
        })
    })
}

/// Turns a dynamic body once, and wakes it: `impulse` in N m s, world axes. Errors: as dcd_body_apply_impulse.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_apply_torque_impulse(
    world: DcdWorld,
    body: DcdBodyId,
    impulse: *const f32,
) -> DcdStatus {
    guard("dcd_body_apply_torque_impulse", || {
        // SAFETY: the caller vouches for three numbers.
        let impulse = unsafe { pointer::read(impulse.cast::<[f32; 3]>(), "impulse")? };
        with(world, |world| {
            let (id, impulse) = (find_dynamic(world, body)?, Vector::from_array(impulse));
            check_kick(world, id, Vector::ZERO, impulse, 1.0)?;
            world.backend.update(id, |body| body.apply_torque_impulse(impulse, true))
        })
    })
}

/// Sets what pushes a dynamic body in every step from now on, and wakes it: `force` in N at its centre of mass and `torque`
/// in N m, world axes; null is none. Set both to none to stop. A later call replaces what an earlier one set.
///
/// Errors: as dcd_body_apply_impulse.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_set_force(
    world: DcdWorld,
    body: DcdBodyId,
    force: *const f32,
    torque: *const f32,
) -> DcdStatus {
    guard("dcd_body_set_force", || {
        let given = |numbers: *const f32, name| {
            let numbers = numbers.cast::<[f32; 3]>();
            // SAFETY: the caller vouches for three numbers behind each pointer that is not null.
            if numbers.is_null() { Ok([0.0; 3]) } else { unsafe { pointer::read(numbers, name) } }
        };
        let (force, torque) = (given(force, "force")?, given(torque, "torque")?);
        with(world, |world| {
            let id = find_dynamic(world, body)?;
            let (force, torque) = (Vector::from_array(force), Vector::from_array(torque));
            check_kick(world, id, force, torque, world.backend.dt_s())?;
            world.backend.update(id, |body| {
                body.reset_forces(true);
                body.reset_torques(true);
                body.add_force(force, true);
                body.add_torque(torque, true);
            })
        })
    })
}

/// Wakes a body. Bodies wake by themselves when something that moves touches them.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_wake(world: DcdWorld, body: DcdBodyId) -> DcdStatus {
    guard("dcd_body_wake", || {
        with(world, |world| {
            let id = find(world, body)?;
            world.backend.update(id, |body| body.wake_up(true))
        })
    })
}

/// Puts a body to sleep: it stops, and costs nothing until something wakes it.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_sleep(world: DcdWorld, body: DcdBodyId) -> DcdStatus {
    guard("dcd_body_sleep", || {
        with(world, |world| {
            let id = find(world, body)?;
            world.backend.update(id, |body| body.sleep())
        })
    })
}

/// The body behind a handle.
pub(crate) fn find(world: &World, body: DcdBodyId) -> Result<BodyId, Failure> {
    let id = world.mark.body_id(body)?;
    if world.backend.contains(id) { Ok(id) } else { Err(stale("body", body.v)) }
}

fn view(world: &World, body: DcdBodyId) -> Result<BodyView, Failure> {
    let id = world.mark.body_id(body)?;
    world.backend.body(id).ok_or_else(|| stale("body", body.v))
}

fn find_dynamic(world: &World, body: DcdBodyId) -> Result<BodyId, Failure> {
    if view(world, body)?.kind != DCD_DYNAMIC {
        return Err(Failure::argument("the body is not dynamic; forces move dynamic bodies only"));
    }
    world.mark.body_id(body)
}

pub(crate) fn set_pose(world: &mut World, id: BodyId, pose: DcdPose) -> Result<(), Failure> {
    check_pose(&pose)?;
    world.events.owners_changed();
    world.backend.set_pose(id, pose.into())
}

pub(crate) fn set_velocity(world: &mut World, id: BodyId, velocity: DcdVelocity) -> Result<(), Failure> {
    check_velocity(&velocity)?;
    if world.backend.body(id).is_some_and(|body| body.kind == DCD_FIXED) {
        return Err(Failure::argument("the body is fixed; make it kinematic to move it"));
    }
    world.backend.set_velocity(id, velocity.into())
}

fn check_pose(pose: &DcdPose) -> Result<(), Failure> {
    check_point(&pose.p, "pose.p")?;
    if WorldPose::from(*pose).is_valid() {
        return Ok(());
    }
    Err(Failure::argument(format!("pose.q is {:?}; give a quaternion x, y, z, w of length 1", pose.q)))
}

fn check_velocity(velocity: &DcdVelocity) -> Result<(), Failure> {
    check_numbers(&velocity.linear, "velocity.linear")?;
    check_numbers(&velocity.angular, "velocity.angular")
}

/// Whether a body keeps a speed in range when it is pushed so for `seconds`; impulses last one.
fn check_kick(world: &World, id: BodyId, push: Vector, turn: Vector, seconds: f32) -> Result<(), Failure> {
    let Some(velocity) = world.backend.kicked(id, push * seconds, turn * seconds) else { return Ok(()) };
    if velocity.linear.iter().chain(&velocity.angular).all(|v| is_in_range(*v)) {
        return Ok(());
    }
    Err(Failure::argument(format!(
        "it would move the body at {velocity:?}, which is not within DCD_MAX_NUMBER; push less, or give the body more mass"
    )))
}

fn check_bits(bits: u32, known: u32, name: &str) -> Result<(), Failure> {
    if bits & !known == 0 {
        return Ok(());
    }
    Err(Failure::argument(format!("{name} has bits {:#x} that mean nothing; clear them", bits & !known)))
}
