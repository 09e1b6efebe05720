//! Projects points onto bodies: finds the place of any body that is nearest to each point.

use super::{Batch, DCD_HIT_INSIDE, DCD_QUERY_HOLLOW, DcdFilter, NOBODY, part_filter, refused, user_data};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::material::material;
use crate::pointer::{check_bits, check_point, check_reserved};
use crate::status::DcdStatus;

/// Point, to find the place nearest to it, or the bodies that it lies in. Start from DCD_POINT_QUERY_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdPointQuery {
    /// The point, world space, metres.
    pub point: [f64; 3],
    /// Largest distance of a place, for dcd_project_points, metres, 0 or more; INFINITY is allowed.
    pub max_distance: f32,
    /// Groups that the point meets, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// DCD_QUERY_HOLLOW or 0, for dcd_project_points; else 0.
    pub flags: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Place of a body nearest to a point.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdPointHit {
    /// The body; null when none is near enough, and then all else is 0.
    pub body: DcdBodyId,
    /// User data of the body.
    pub user_data: u64,
    /// The place, world space, metres.
    pub point: [f64; 3],
    /// Distance from the point that was asked about, metres.
    pub distance: f32,
    /// Number of the collider of the body, from 0.
    pub collider: u32,
    /// DCD_HIT_INSIDE or 0.
    pub flags: u32,
    /// Reserved; always 0.
    pub reserved: u32,
    /// user_data of that collider, such as the number of a material.
    pub material: u64,
}

/// Finds the place of any body that is nearest to each of `count` points; hits[i] belongs to points[i].
///
/// `points` and `filter` are read during the call; `hits` has `count` entries.
/// Errors: as dcd_cast_rays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_project_points(
    world: DcdWorld,
    points: *const DcdPointQuery,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdPointHit,
) -> DcdStatus {
    guard("dcd_project_points", || {
        // SAFETY: the caller vouches for `count` points and hits, and for the filter.
        let batch = unsafe { Batch::new(points, count, "points", filter)? };
        // SAFETY: as above.
        unsafe {
            batch.each(world, hits, |asked, query| {
                check_point(&query.point, "point")?;
                check_bits(query.flags, DCD_QUERY_HOLLOW, "flags")?;
                check_reserved(query.reserved)?;
                let (max_m, solid) = (f64::from(query.max_distance), query.flags & DCD_QUERY_HOLLOW == 0);
                let filter = part_filter(asked.world, asked.mask, query.mask, query.exclude)?;
                let hit = asked.queries.ask_nearest(&asked.filter, query.point, max_m, solid, &filter);
                Ok(hit.map_err(refused)?.map_or(NO_POINT_HIT, |hit| DcdPointHit {
                    body: asked.world.mark.body(hit.body),
                    user_data: user_data(asked.world, hit.body),
                    point: hit.point,
                    distance: hit.distance_m as f32,
                    collider: hit.collider as u32,
                    flags: if hit.inside { DCD_HIT_INSIDE } else { 0 },
                    reserved: 0,
                    material: material(&asked.world.dcd, hit.body, hit.collider),
                }))
            })
        }
    })
}

const NO_POINT_HIT: DcdPointHit = DcdPointHit {
    body: NOBODY,
    user_data: 0,
    point: [0.0; 3],
    distance: 0.0,
    collider: 0,
    flags: 0,
    reserved: 0,
    material: 0,
};
