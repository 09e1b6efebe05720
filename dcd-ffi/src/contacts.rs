//! Reads the points at which a body touches others now.

use dcd::ContactPoint;
use dcd::protocol::ContactKey;

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::material::material;
use crate::pointer::Room;
use crate::registry::{World, ask, find};
use crate::status::DcdStatus;

/// Point at which two bodies touch, or are about to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdContactPoint {
    /// The body made first.
    pub a: DcdBodyId,
    /// The other body.
    pub b: DcdBodyId,
    /// Position in the middle between the two surfaces, world space, metres.
    pub point: [f64; 3],
    /// Normal from a to b, of length 1.
    pub normal: [f32; 3],
    /// Distance between the surfaces, metres, negative where they overlap.
    pub separation: f32,
    /// Impulse along the normal on `b` in the last step, N s, without friction. Divided by dt it is the force.
    pub impulse: f32,
    /// Number of the point's manifold among those of the two colliders: points of one manifold have one normal.
    pub manifold: u32,
    /// Number of the collider of `a`, from 0.
    pub collider_a: u32,
    /// Number of the collider of `b`, from 0.
    pub collider_b: u32,
    /// user_data of that collider of `a`, such as the number of a material.
    pub material_a: u64,
    /// user_data of that collider of `b`, such as the number of a material.
    pub material_b: u64,
}

/// Lists the points at which a body touches others as they are after the last step, by pairs of colliders and manifolds. Sensors
/// have none; dcd_events and dcd_overlap_shapes report them.
///
/// Writes the points to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for
/// the number.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not),
/// DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_contacts(
    world: DcdWorld,
    body: DcdBodyId,
    out: *mut DcdContactPoint,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_body_contacts", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            let points = world.dcd.contact_points(find(world, body)?)?;
            out.fill(points.iter().map(|point| contact_point(world, point)))
        })
    })
}

fn contact_point(world: &World, point: &ContactPoint) -> DcdContactPoint {
    let ContactKey { a, b, collider_a, collider_b } = point.key;
    DcdContactPoint {
        a: world.mark.body(a),
        b: world.mark.body(b),
        point: point.point,
        normal: point.normal,
        separation: point.separation_m,
        impulse: point.impulse_ns,
        manifold: point.manifold,
        collider_a: u32::from(collider_a),
        collider_b: u32::from(collider_b),
        material_a: material(&world.dcd, a, usize::from(collider_a)),
        material_b: material(&world.dcd, b, usize::from(collider_b)),
    }
}
