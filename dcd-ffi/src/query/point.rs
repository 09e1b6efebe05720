//! Projects points onto bodies: finds the place of any body that is nearest to each point.

use super::{Batch, DCD_HIT_INSIDE, DCD_QUERY_HOLLOW, DcdFilter, NOBODY, part_filter, refused, user_data};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::material::material;
use crate::pointer::{check_bits, check_point, check_reserved};
use crate::status::DcdStatus;

/// A point. Start from DCD_POINT_QUERY_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdPointQuery {
    /// World space, metres.
    pub point: [f64; 3],
    /// Of dcd_project_points: how far a place may be, metres, 0 or more; INFINITY is allowed.
    pub max_distance: f32,
    /// Groups that it meets; 0xFFFFFFFF for all.
    pub mask: u32,
    /// A body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// Of dcd_project_points: DCD_QUERY_HOLLOW or 0; else 0.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
}

/// The place of a body nearest to a point.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdPointHit {
    /// Whose; null when there is none near enough, and then all else is 0.
    pub body: DcdBodyId,
    /// Its user data.
    pub user_data: u64,
    /// Where, world space, metres.
    pub point: [f64; 3],
    /// From the point that was asked about, metres.
    pub distance: f32,
    /// Which collider of the body, from 0.
    pub collider: u32,
    /// DCD_HIT_INSIDE or 0.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
    /// The user_data of that collider, as the number of a material.
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
