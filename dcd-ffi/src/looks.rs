//! Lists all bodies of a world, finds their shapes, and reads how large and heavy they are.

use std::sync::Arc;

use dcd::query::ShapeHash;
use rapier3d::prelude::SharedShape;

use crate::collider;
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdShapeId, DcdWorld};
use crate::pointer::{Out, Room, Sized32};
use crate::registry::{World, ask, find, missing, with};
use crate::shape;
use crate::shape_info::frame_of;
use crate::status::{DcdStatus, Failure};
use crate::types::DcdFrame;

/// Size and mass of a body. Start from DCD_BODY_EXTENT_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdBodyExtent {
    /// Size of this struct: sizeof(DcdBodyExtent).
    pub struct_size: u32,
    /// Mass, kilograms; 0 for a fixed body.
    pub mass: f32,
    /// Lowest corner of the smallest box along the axes of world space that holds the body's colliders, metres; infinite for a
    /// half-space.
    pub min: [f64; 3],
    /// Highest corner of that box, metres.
    pub max: [f64; 3],
    /// Centre of mass, from the body's origin, along its own axes, metres.
    pub centre: [f32; 3],
    /// Moments of inertia about the principal axes through the centre of mass, kg m²; 0 for a fixed body.
    pub inertia: [f32; 3],
    /// Rotation from the body's own axes to the principal ones: unit quaternion x, y, z, w.
    pub axes: [f32; 4],
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdBodyExtent {
    const NAME: &'static str = "DcdBodyExtent";
}

/// Lists all bodies, fixed ones too, in the order in which they were made. In a served world these are the bodies that this process
/// has heard of: first those of the scene and the server's program, then avatars, client by client, then what builders have built.
///
/// Writes the ids to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
/// number.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not),
/// DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_bodies(
    world: DcdWorld,
    out: *mut DcdBodyId,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_bodies", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            world.dcd.sees("see the bodies of its world")?;
            out.fill(world.dcd.bodies().into_iter().map(|id| world.mark.body(id)))
        })
    })
}

/// Reads how large and heavy a body is as it is now. This follows from its shapes and properties, so in a served world it is known
/// of every body that this process has heard of. The call takes some microseconds, and more for a body of many vertices.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_extent(
    world: DcdWorld,
    body: DcdBodyId,
    out: *mut DcdBodyExtent,
) -> DcdStatus {
    guard("dcd_body_extent", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let extent = world.dcd.extent(find(world, body)?).ok_or_else(|| missing(world, body))?;
            out.write(DcdBodyExtent {
                struct_size: size_of::<DcdBodyExtent>() as u32,
                mass: extent.mass_kg,
                min: extent.aabb.min,
                max: extent.aabb.max,
                centre: extent.centre_of_mass,
                inertia: extent.principal_inertia,
                axes: extent.principal_axes,
            });
            Ok(())
        })
    })
}

/// Finds the shape of one collider of any body that this process knows. `collider` is its number, from 0. dcd_collider_properties
/// says where it sits on the body.
///
/// Equal shapes have one handle, so a renderer can keep what it makes of a shape by its handle. The handle from the shape function
/// that made the shape is another one. The handle need not be destroyed, and does not keep the shape: some time after no body and
/// no compound has the shape any more, the handle is stale. Once it is stale or destroyed, the call gives a new one.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a collider that is not there), DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_collider_shape(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_collider_shape", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::new(out, "out")? };
        with(world, |world| {
            let hash = collider::recorded(world, body, collider)?.shape;
            let id = world.mark.body_id(body)?;
            let shape =
                |world: &World| world.dcd.shape((id, collider as usize)).ok_or_else(|| missing(world, body));
            out.write(named(world, hash, shape)?);
            Ok(())
        })
    })
}

/// Finds one of the shapes that a compound is made of, by its number `part`, from 0, as dcd_collider_shape does. `frame` receives
/// where it is in the compound, and may be null.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT (a part that is not there).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_part(
    world: DcdWorld,
    shape: DcdShapeId,
    part: u32,
    out: *mut DcdShapeId,
    frame: *mut DcdFrame,
) -> DcdStatus {
    guard("dcd_shape_part", || {
        // SAFETY: the caller vouches for both pointers.
        let (out, frame) = unsafe { (Out::new(out, "out")?, Out::optional(frame, "frame")?) };
        with(world, |world| {
            let parts =
                shape::find(world, shape)?.as_compound().map_or(&[][..], |compound| compound.shapes());
            let (pose, found) = parts.get(part as usize).cloned().ok_or_else(|| {
                Failure::argument(format!("the shape has {} parts, there is no part {part}", parts.len()))
            })?;
            let hash = dcd::physics::ShapeLibrary::default().intern(&found)?;
            out.write(named(world, hash, |_| Ok(found))?);
            if let Some(frame) = frame {
                frame.write(frame_of(&pose));
            }
            Ok(())
        })
    })
}

/// Returns the one handle that a shape has.
fn named(
    world: &mut World,
    hash: ShapeHash,
    shape: impl FnOnce(&World) -> Result<SharedShape, Failure>,
) -> Result<DcdShapeId, Failure> {
    let slot = match world.looked_up.slot(hash) {
        Some(slot) => slot,
        None => {
            let shape = shape(world)?;
            let_go(world);
            let slot = world.shapes.insert(shape);
            world.looked_up.remember(hash, slot);
            slot
        }
    };
    Ok(world.mark.shape(slot))
}

/// Lets go, now and then, of the shapes that were looked up and that no body and no other handle has any more.
fn let_go(world: &mut World) {
    if !world.looked_up.has_grown() {
        return;
    }
    let World { dcd, shapes, looked_up, .. } = world;
    let is_shared = |slot| shapes.get(slot).is_some_and(|shape| Arc::strong_count(&shape.0) > 1);
    let unused = looked_up.take_unused(|hash, slot| is_shared(slot) || dcd.knows_shape(hash));
    for slot in unused {
        drop(shapes.remove(slot));
    }
}
