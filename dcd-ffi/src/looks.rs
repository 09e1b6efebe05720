//! Lists all bodies of a world, finds their shapes, and reads how large and heavy they are.

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

/// How large and heavy a body is. Start from DCD_BODY_EXTENT_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdBodyExtent {
    /// sizeof(DcdBodyExtent).
    pub struct_size: u32,
    /// Kilograms; 0 for a fixed body.
    pub mass: f32,
    /// The lowest corner of the smallest box along the axes of world space that holds its colliders, metres; infinite for a
    /// half-space.
    pub min: [f64; 3],
    /// The highest corner.
    pub max: [f64; 3],
    /// Its centre of mass, from its origin, along its own axes, metres.
    pub centre: [f32; 3],
    /// Its moments of inertia about its principal axes through that centre, kg m²; 0 for a fixed body.
    pub inertia: [f32; 3],
    /// The rotation from its own axes to the principal ones: unit quaternion x, y, z, w.
    pub axes: [f32; 4],
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdBodyExtent {
    const NAME: &'static str = "DcdBodyExtent";
}

/// Lists all bodies into `out`, which has `cap` entries, and their number into `count`: fixed ones too, in the order in which they were
/// made; in a served world those that this process has heard of: first those of the scene and the server's program, then avatars,
/// client by client, then what builders have built. With `cap` 0 `out` may be null, to ask for the number.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not),
/// DCD_ERR_UNSUPPORTED for a node.
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

/// Reads how large and heavy a body is as it is now. It follows from its shapes and properties, so that in a served world it is known of every
/// body that this process has heard of. It takes some microseconds, of a body of many vertices more.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node.
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

/// Finds the shape of one collider of a body, of any body that this process knows. `collider` is its number, from 0;
/// dcd_collider_properties says where it sits on the body.
///
/// Equal shapes have one handle, so that what a renderer makes of it can be kept by it; that of the shape function with which you made
/// it is another. It need not be destroyed; once it is, this gives a new one.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there, DCD_ERR_UNSUPPORTED for a node.
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

/// Finds one of the shapes that a compound is made of, from 0 on, as dcd_collider_shape does, and where it is in the compound.
/// `frame` may be null.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT for a part that is not there.
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

/// Returns the one handle of a shape.
fn named(
    world: &mut World,
    hash: ShapeHash,
    shape: impl FnOnce(&World) -> Result<SharedShape, Failure>,
) -> Result<DcdShapeId, Failure> {
    let slot = match world.looked_up.slot(hash) {
        Some(slot) => slot,
        None => {
            let shape = shape(world)?;
            let slot = world.shapes.insert(shape);
            world.looked_up.remember(hash, slot);
            slot
        }
    };
    Ok(world.mark.shape(slot))
}
