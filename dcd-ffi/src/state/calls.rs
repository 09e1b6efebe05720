//! Lends and copies the state of many bodies at a time.

use dcd::BodyId;
use rapier3d::prelude::Vector;

use super::{
    DCD_FIELD_FORCE, DCD_FIELD_POSE, DCD_FIELD_TARGET, DCD_FIELD_USER_DATA, DCD_FIELD_VELOCITY, DcdField,
    DcdForce, DcdStateView,
};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::motion;
use crate::pointer::{self, Out, check_count};
use crate::push;
use crate::registry::{self, World, ask, with};
use crate::status::{DCD_OK, DcdStatus, Failure, remember};
use crate::types::{DcdPose, DcdVelocity};

/// Lends the state of every movable body as arrays, without copying, as it was after the last step. What was made or changed since
/// shows after the next one. Before the first step, and in the first call of all, the view shows the present. A client or
/// participant is told states every DcdServerDef.state_every steps; to draw the steps between, use dcd_view_state.
///
/// The arrays are the library's: do not write or free them. They keep their content until the step after next begins. Then they are
/// overwritten, and the memory stays readable until the world is destroyed. So another thread may read them while this one makes
/// one step. To go back (dcd_checkpoint_restore, dcd_snapshot_load) counts as a step. Before the first step every call overwrites
/// the arrays. The first call makes every later dcd_step fill the arrays, some 30 ns per body.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_state_view(world: DcdWorld, out: *mut DcdStateView) -> DcdStatus {
    guard("dcd_state_view", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        with(world, |world| {
            world.dcd.sees("see the bodies of its world")?;
            out.write(world.states.view(&world.dcd, world.mark));
            Ok(())
        })
    })
}

/// Copies one field of `count` bodies, as it is now, into the program's memory. The field of bodies[i] goes to (char *)dst + i *
/// stride. `stride`, in bytes, is at least the field's size; 0 is exactly that. `dst` needs no alignment.
///
/// With `each` null, the first bad body fails the call and nothing is written. Otherwise `each` has `count` entries that receive
/// DCD_OK or what is wrong with that body. Then only good bodies are written, and the call returns DCD_OK; dcd_last_error() tells
/// of the last bad one.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (an unknown field, a short stride, or more than DCD_MAX_ITEMS).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_state_read(
    world: DcdWorld,
    bodies: *const DcdBodyId,
    count: usize,
    field: DcdField,
    dst: *mut std::ffi::c_void,
    stride: usize,
    each: *mut DcdStatus,
) -> DcdStatus {
    guard("dcd_state_read", || {
        // SAFETY: the caller vouches for `count` entries of everything.
        let bulk = unsafe { Bulk::new(bodies, count, field, dst, stride, each)? };
        if field == DCD_FIELD_TARGET {
            return Err(Failure::argument("targets are written and not read; read DCD_FIELD_POSE"));
        }
        ask(world, |world| {
            let dcd = &world.dcd;
            // SAFETY: the caller vouches for both; the fields are as large as `Bulk::new` takes them to be.
            unsafe {
                match field {
                    DCD_FIELD_POSE => bulk.read(world, dst, each, |id| Some(DcdPose::from(dcd.pose(id)?))),
                    DCD_FIELD_VELOCITY => {
                        bulk.read(world, dst, each, |id| Some(DcdVelocity::from(dcd.velocity(id)?)))
                    }
                    DCD_FIELD_FORCE => bulk.read(world, dst, each, |id| {
                        let state = dcd.record(id)?.state;
                        Some(DcdForce { force: state.force, torque: state.torque })
                    }),
                    // The user data of bodies that are gone is known for a while.
                    _ => bulk.read(world, dst, each, |id| {
                        Some(dcd.user_data(id).filter(|_| dcd.contains(id))? as u64)
                    }),
                }
            }
        })
    })
}

/// Sets one field of `count` bodies from the program's memory, laid out as for dcd_state_read. It does what dcd_body_set_pose,
/// dcd_body_set_velocity, dcd_body_set_force and dcd_body_set_target do.
///
/// With `each` null, the first bad body or value fails the call. The bodies before it are changed already, unless an id was bad:
/// ids are checked first. Otherwise `each` has `count` entries that receive DCD_OK or what is wrong with that body, and the call
/// returns DCD_OK.
/// Errors: as dcd_state_read, and those of the single calls.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_state_write(
    world: DcdWorld,
    bodies: *const DcdBodyId,
    count: usize,
    field: DcdField,
    src: *const std::ffi::c_void,
    stride: usize,
    each: *mut DcdStatus,
) -> DcdStatus {
    guard("dcd_state_write", || {
        // SAFETY: the caller vouches for `count` entries of everything.
        let bulk = unsafe { Bulk::new(bodies, count, field, src.cast_mut(), stride, each)? };
        with(world, |world| {
            if each.is_null() {
                bulk.check(world)?;
            }
            for (i, &body) in bulk.bodies.iter().enumerate() {
                // SAFETY: place i lies in `src`, which the caller vouches for.
                let value = unsafe { Value::load(field, bulk.place(src.cast_mut(), i)) };
                let done = apply(world, body, value);
                if each.is_null() {
                    done?;
                } else {
                    // SAFETY: entry i lies in `each`, which the caller vouches for.
                    unsafe { each.add(i).write(status_of("dcd_state_write", &done)) };
                }
            }
            Ok(())
        })
    })
}

fn apply(world: &mut World, body: DcdBodyId, value: Value) -> Result<(), Failure> {
    let id = registry::find(world, body)?;
    match value {
        Value::Pose(pose) => motion::set_pose(world, id, pose),
        Value::Velocity(velocity) => motion::set_velocity(world, id, velocity),
        Value::Target(pose) => motion::set_target(world, id, pose),
        Value::Force(DcdForce { force, torque }) => {
            push::check_dynamic(world, id)?;
            push::set_force(world, id, Vector::from_array(force), Vector::from_array(torque))
        }
        Value::UserData(data) => {
            world.dcd.update(id, |body| body.user_data = u128::from(data)).map_err(Failure::from)
        }
    }
}

/// Value of one field of one body.
#[derive(Clone, Copy)]
enum Value {
    Pose(DcdPose),
    Velocity(DcdVelocity),
    UserData(u64),
    Force(DcdForce),
    Target(DcdPose),
}

impl Value {
    /// # Safety
    /// `place` is valid for reading the field.
    unsafe fn load(field: DcdField, place: *const u8) -> Self {
        // SAFETY: the caller vouches for the place; none of the reads asks for alignment.
        unsafe {
            match field {
                DCD_FIELD_POSE => Self::Pose(place.cast::<DcdPose>().read_unaligned()),
                DCD_FIELD_VELOCITY => Self::Velocity(place.cast::<DcdVelocity>().read_unaligned()),
                DCD_FIELD_FORCE => Self::Force(place.cast::<DcdForce>().read_unaligned()),
                DCD_FIELD_TARGET => Self::Target(place.cast::<DcdPose>().read_unaligned()),
                _ => Self::UserData(place.cast::<u64>().read_unaligned()),
            }
        }
    }
}

/// Checked arguments of a call with strides.
struct Bulk<'a> {
    bodies: &'a [DcdBodyId],
    stride: usize,
}

impl<'a> Bulk<'a> {
    /// # Safety
    /// `bodies` has `count` entries.
    unsafe fn new(
        bodies: *const DcdBodyId,
        count: usize,
        field: DcdField,
        memory: *mut std::ffi::c_void,
        stride: usize,
        each: *mut DcdStatus,
    ) -> Result<Self, Failure> {
        let size = match field {
            DCD_FIELD_POSE | DCD_FIELD_TARGET => size_of::<DcdPose>(),
            DCD_FIELD_FORCE => size_of::<DcdForce>(),
            DCD_FIELD_VELOCITY => size_of::<DcdVelocity>(),
            DCD_FIELD_USER_DATA => size_of::<u64>(),
            other => {
                return Err(Failure::argument(format!("field {other} is none; use a DCD_FIELD_… constant")));
            }
        };
        if stride != 0 && stride < size {
            return Err(Failure::argument(format!("stride {stride} is less than the field's {size} bytes")));
        }
        let stride = if stride == 0 { size } else { stride };
        check_count(count, "bodies")?;
        if stride.checked_mul(count).is_none_or(|bytes| bytes > isize::MAX as usize) {
            return Err(Failure::argument(format!(
                "{count} times a stride of {stride} is more than memory holds"
            )));
        }
        if count > 0 {
            pointer::check(memory.cast::<u8>(), "the caller's memory")?;
            if !each.is_null() {
                pointer::check(each, "each")?;
            }
        }
        // SAFETY: the caller vouches for `count` entries.
        Ok(Self { bodies: unsafe { pointer::slice(bodies, count, "bodies")? }, stride })
    }

    /// Checks that all bodies are there.
    fn check(&self, world: &World) -> Result<(), Failure> {
        self.bodies.iter().try_for_each(|&body| registry::find(world, body).map(drop))
    }

    /// Writes what `value` returns for each body.
    ///
    /// # Safety
    /// `dst` has `stride` bytes for each body, no less than a `T`; `each` is null or has an entry for each.
    unsafe fn read<T>(
        &self,
        world: &World,
        dst: *mut std::ffi::c_void,
        each: *mut DcdStatus,
        value: impl Fn(BodyId) -> Option<T>,
    ) -> Result<(), Failure> {
        if each.is_null() {
            self.check(world)?;
        }
        for (i, &body) in self.bodies.iter().enumerate() {
            let id = world.mark.body_id(body);
            let value = id.and_then(|id| value(id).ok_or_else(|| registry::missing(world, body)));
            if each.is_null() {
                // SAFETY: place i lies in `dst`, which the caller vouches for.
                unsafe { self.place(dst, i).cast::<T>().write_unaligned(value?) };
                continue;
            }
            // SAFETY: place i lies in `dst`, entry i in `each`; the caller vouches for both.
            unsafe {
                each.add(i).write(status_of("dcd_state_read", &value));
                if let Ok(value) = value {
                    self.place(dst, i).cast::<T>().write_unaligned(value);
                }
            }
        }
        Ok(())
    }

    /// # Safety
    /// `memory` has `stride` bytes for each body and `i` is one of them.
    unsafe fn place(&self, memory: *mut std::ffi::c_void, i: usize) -> *mut u8 {
        // SAFETY: `new` checked that the product fits.
        unsafe { memory.cast::<u8>().add(i * self.stride) }
    }
}

fn status_of<T>(function: &str, result: &Result<T, Failure>) -> DcdStatus {
    match result {
        Ok(_) => DCD_OK,
        Err(failure) => {
            remember(function, failure);
            failure.status
        }
    }
}
