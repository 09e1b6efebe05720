//! Applies forces, torques and impulses to bodies.

use dcd::{BodyId, BodyKind, Push, Role};
use rapier3d::prelude::*;

use crate::guard::guard;
use crate::handle::stale;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, check_point};
use crate::registry::{self, World, with};
use crate::status::{DCD_ERR_UNSUPPORTED, DcdStatus, Failure};

/// Applies an impulse to a dynamic body, and wakes it. `impulse` is in N s, world axes, and acts at `point` in world space, metres;
/// a null `point` is the centre of mass.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a body that is not dynamic, or that would be faster than DCD_MAX_NUMBER. Forces and impulses themselves may
///   be larger. Servers and builders do not know masses: there the nodes leave out what would make the body so fast.
/// - DCD_ERR_UNSUPPORTED: clients that may not build, participants and nodes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_apply_impulse(
    world: DcdWorld,
    body: DcdBodyId,
    impulse: *const f32,
    point: *const f64,
) -> DcdStatus {
    guard("dcd_body_apply_impulse", || {
        // SAFETY: the caller vouches for three numbers behind each pointer that is not null.
        let (impulse, point) =
            unsafe { (pointer::read(impulse.cast::<[f32; 3]>(), "impulse")?, read_point(point)?) };
        with(world, |world| {
            let push = Push { point, ..Push::impulse(find_dynamic(world, body)?, impulse) };
            world.dcd.push(&push).map_err(Failure::from)
        })
    })
}

/// Applies an angular impulse to a dynamic body, and wakes it. `impulse` is in N m s, world axes. Errors: as
/// dcd_body_apply_impulse.
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
            let id = find_dynamic(world, body)?;
            world.dcd.push(&Push::torque_impulse(id, impulse)).map_err(Failure::from)
        })
    })
}

/// Sets the force and torque on a dynamic body in every step from now on, and wakes it. `force` is in N and acts at the centre of
/// mass; `torque` is in N m. Both are in world axes, and null is none. Set both to none to stop. A later call replaces what an
/// earlier one set.
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
            set_force(world, id, Vector::from_array(force), Vector::from_array(torque))
        })
    })
}

/// Adds a force to that of dcd_body_set_force. `force` is in N, world axes, and acts at `point` in world space, metres; a null
/// `point` is the centre of mass. Its torque is computed now, and stays when the body moves on. For a thruster, set no force and
/// add those of all thrusters before each step.
///
/// Errors: as dcd_body_apply_impulse, and DCD_ERR_UNSUPPORTED also for servers and builders, which set the whole force
/// (dcd_body_set_force).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_add_force(
    world: DcdWorld,
    body: DcdBodyId,
    force: *const f32,
    point: *const f64,
) -> DcdStatus {
    guard("dcd_body_add_force", || {
        // SAFETY: the caller vouches for three numbers behind each pointer that is not null.
        let (force, point) =
            unsafe { (pointer::read(force.cast::<[f32; 3]>(), "force")?, read_point(point)?) };
        with(world, |world| {
            let id = find_dynamic(world, body)?;
            let role = world.dcd.role();
            if matches!(role, Role::Server | Role::Builder) {
                let message = format!(
                    "a {role} cannot add to a force, which it knows late: set the whole force (dcd_body_set_force)"
                );
                return Err(Failure::new(DCD_ERR_UNSUPPORTED, message));
            }
            let force = Vector::from_array(force);
            let turn = turn_of(world, id, force, point);
            let state = world.dcd.record(id).ok_or_else(|| stale("body", body.v))?.state;
            let (before, turned) = (Vector::from_array(state.force), Vector::from_array(state.torque));
            set_force(world, id, before + force, turned + turn)
        })
    })
}

pub(crate) fn set_force(world: &mut World, id: BodyId, force: Vector, torque: Vector) -> Result<(), Failure> {
    world.dcd.push(&Push::force(id, force.to_array(), torque.to_array())).map_err(Failure::from)
}

/// # Safety
/// The pointer is null or has three numbers.
unsafe fn read_point(point: *const f64) -> Result<Option<[f64; 3]>, Failure> {
    if point.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller upholds the same contract.
    let point = unsafe { pointer::read(point.cast::<[f64; 3]>(), "point")? };
    check_point(&point, "point").map(|()| Some(point))
}

/// Returns the angular part of a push at a point, about the centre of mass. It is the same in every region, whatever its origin
/// (anchor).
fn turn_of(world: &World, id: BodyId, push: Vector, point: Option<[f64; 3]>) -> Vector {
    match (point, world.dcd.centre_of_mass(id)) {
        (Some(point), Some(centre)) => {
            let arm: [f32; 3] = std::array::from_fn(|i| (point[i] - centre[i]) as f32);
            Vector::from_array(arm).cross(push)
        }
        _ => Vector::ZERO,
    }
}

fn find_dynamic(world: &World, body: DcdBodyId) -> Result<BodyId, Failure> {
    let id = registry::find(world, body)?;
    check_dynamic(world, id).map(|()| id)
}

pub(crate) fn check_dynamic(world: &World, id: BodyId) -> Result<(), Failure> {
    world.dcd.pushes_bodies()?;
    if world.dcd.body(id).is_none_or(|body| body.kind != BodyKind::Dynamic) {
        return Err(Failure::argument("the body is not dynamic; forces move dynamic bodies only"));
    }
    Ok(())
}
