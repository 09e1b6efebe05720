//! Casts rays: finds the first body that each meets, or all of them.

use dcd::protocol::{RayAnswer, RayQuery};
use rapier3d::prelude::Vector;

use super::{Batch, DCD_QUERY_HOLLOW, DcdFilter, NOBODY, part_filter, refused, user_data};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::material::material;
use crate::pointer::{Room, check_bits, check_numbers, check_point};
use crate::registry::World;
use crate::status::{DcdStatus, Failure};

/// Ray. Start from DCD_RAY_INIT and give a direction.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdRay {
    /// Point where the ray starts, world space, metres.
    pub origin: [f64; 3],
    /// Direction of the ray, of any length above 0.
    pub direction: [f32; 3],
    /// Length of the ray, metres, above 0; INFINITY is allowed.
    pub max_distance: f32,
    /// Body that the ray passes through, such as the one that looks; null for none.
    pub exclude: DcdBodyId,
    /// Groups that the ray meets, as bits, as in DcdBodyDef.groups; 0xFFFFFFFF for all.
    pub mask: u32,
    /// DCD_QUERY_HOLLOW or 0.
    pub flags: u32,
}

/// Body that a ray met.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdRayHit {
    /// The body; null when the ray met nothing, and then all else is 0.
    pub body: DcdBodyId,
    /// User data of the body.
    pub user_data: u64,
    /// Point where the ray met the body, world space, metres.
    pub point: [f64; 3],
    /// Normal of the body there, outward, of length 1; 0 when the ray starts inside the body.
    pub normal: [f32; 3],
    /// Distance of that point from the origin, metres.
    pub distance: f32,
    /// Number of the collider of the body, from 0.
    pub collider: u32,
    /// Number of the triangle of a mesh or terrain, or of the part of a compound; else 0.
    pub subshape: u32,
    /// user_data of that collider, such as the number of a material.
    pub material: u64,
}

/// Finds the first body that each of `count` rays meets; hits[i] belongs to rays[i]. Sensors count as bodies, unless `filter`
/// overlooks them. A null filter overlooks nothing.
///
/// This and the other queries see bodies where they are now, also those made or moved since the last step. Several threads may ask
/// one world at the same time. A hundred and more queries of one call are spread over DcdWorldDef.threads. Queries are answered
/// only where the whole world is. In a served world they give DCD_ERR_UNSUPPORTED; ask there by dcd_cast_rays_submit,
/// dcd_cast_shapes_submit, dcd_overlap_shapes_submit, dcd_overlap_points_submit and dcd_overlap_boxes_submit.
///
/// `rays` and `filter` are read during the call; `hits` has `count` entries.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world, or a body to exclude), DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED.
/// - DCD_ERR_ARGUMENT: numbers that are not finite, a direction of length 0, a distance that is not above 0, unknown bits, or more
///   than DCD_MAX_ITEMS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_rays(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdRayHit,
) -> DcdStatus {
    guard("dcd_cast_rays", || {
        // SAFETY: the caller vouches for `count` rays and hits, and for the filter.
        let batch = unsafe { Batch::new(rays, count, "rays", filter)? };
        // SAFETY: as above.
        unsafe {
            batch.each(world, hits, |asked, ray| {
                let ray = question(asked.world, asked.mask, ray)?;
                let hit = asked.queries.ask_ray(&asked.filter, &ray).map_err(refused)?;
                Ok(ray_hit(asked.world, hit.as_ref().map(RayAnswer::from)))
            })
        }
    })
}

/// Finds every body that each of `count` rays meets, the nearest first. Each collider of a body counts once.
///
/// The hits of all rays go to `hits`, which has `cap` entries, and their number to `total`. The hits of rays[i] end before
/// hits[ends[i]] and begin where those of the ray before end. `ends` has `count` entries. With `cap` 0, `hits` may be null, to ask
/// for the number.
/// Errors: as dcd_cast_rays, and DCD_ERR_SMALL_BUFFER (`total` is written all the same, and nothing else).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_rays_all(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdRayHit,
    cap: usize,
    ends: *mut usize,
    total: *mut usize,
) -> DcdStatus {
    guard("dcd_cast_rays_all", || {
        // SAFETY: the caller vouches for `count` rays and ends, `cap` hits, `total` and the filter.
        let (batch, room) = unsafe {
            (Batch::new(rays, count, "rays", filter)?, Room::new(hits, cap, total, ["hits", "total"])?)
        };
        // SAFETY: as above.
        unsafe {
            batch.lists(world, room, ends, |asked, ray| {
                let ray = question(asked.world, asked.mask, ray)?;
                let hits = asked.queries.ask_ray_through(&asked.filter, &ray).map_err(refused)?;
                Ok(hits.iter().map(|hit| ray_hit(asked.world, Some(hit.into()))).collect())
            })
        }
    })
}

const NO_RAY_HIT: DcdRayHit = DcdRayHit {
    body: NOBODY,
    user_data: 0,
    point: [0.0; 3],
    normal: [0.0; 3],
    distance: 0.0,
    collider: 0,
    subshape: 0,
    material: 0,
};

/// Returns the ray of a call whose queries all meet these groups.
pub(super) fn question(world: &World, mask: u32, ray: &DcdRay) -> Result<RayQuery, Failure> {
    check_point(&ray.origin, "origin")?;
    check_numbers(&ray.direction, "direction")?;
    check_bits(ray.flags, DCD_QUERY_HOLLOW, "flags")?;
    if Vector::from_array(ray.direction).try_normalize().is_none() {
        return Err(Failure::argument("direction has no length; say where the ray goes"));
    }
    // NaN is not above 0 either.
    if !matches!(ray.max_distance.partial_cmp(&0.0), Some(std::cmp::Ordering::Greater)) {
        return Err(Failure::argument(format!(
            "max_distance is {}; give metres above 0, or INFINITY",
            ray.max_distance
        )));
    }
    Ok(RayQuery {
        origin: ray.origin,
        direction: ray.direction,
        max_m: f64::from(ray.max_distance),
        solid: ray.flags & DCD_QUERY_HOLLOW == 0,
        filter: part_filter(world, mask, ray.mask, ray.exclude)?,
    })
}

pub(super) fn ray_hit(world: &World, hit: Option<RayAnswer>) -> DcdRayHit {
    let Some(hit) = hit else { return NO_RAY_HIT };
    DcdRayHit {
        body: world.mark.body(hit.body),
        user_data: user_data(world, hit.body),
        point: hit.point,
        normal: hit.normal,
        distance: hit.distance_m as f32,
        collider: hit.collider,
        subshape: hit.subshape,
        material: material(&world.dcd, hit.body, hit.collider as usize),
    }
}
