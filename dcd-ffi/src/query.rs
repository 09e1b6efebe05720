//! Rays.

use rapier3d::prelude::Vector;

use crate::body::{self, DcdBodyId};
use crate::guard::guard;
use crate::pointer::{self, check_numbers, check_point};
use crate::status::{DcdStatus, Failure};
use crate::view::RayQuery;
use crate::world::{DcdWorld, World, with};

/// A ray.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdRay {
    /// Where it starts, world space, metres.
    pub origin: [f64; 3],
    /// Where it goes, of any length above 0.
    pub direction: [f32; 3],
    /// How far, metres, above 0; INFINITY is allowed.
    pub max_distance: f32,
    /// A body that it passes through, as the one that looks; null for none.
    pub exclude: DcdBodyId,
    /// Groups that it meets, as in DcdBodyDef.groups; 0xFFFFFFFF for all.
    pub mask: u32,
    /// 0.
    pub reserved: u32,
}

/// The first body that a ray met.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdRayHit {
    /// Which; null when the ray met nothing, and then all else is 0.
    pub body: DcdBodyId,
    /// Its user data.
    pub user_data: u64,
    /// Where, world space, metres.
    pub point: [f64; 3],
    /// Outward, of length 1; 0 when the ray starts inside the body.
    pub normal: [f32; 3],
    /// From the origin, metres.
    pub distance: f32,
}

/// Finds the first body that each of `count` rays meets; hits[i] belongs to rays[i]. Sensors count as bodies.
///
/// `rays` is read during the call; `hits` has `count` entries.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, or a body to exclude), DCD_ERR_ARGUMENT for numbers that are not finite, a
/// direction of length 0, a distance that is not above 0, or more than DCD_MAX_ITEMS, DCD_ERR_UNSUPPORTED in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_rays(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    hits: *mut DcdRayHit,
) -> DcdStatus {
    guard("dcd_cast_rays", || {
        // SAFETY: the caller vouches for `count` rays.
        let rays = unsafe { pointer::slice(rays, count, "rays")? };
        if count > 0 {
            pointer::check(hits, "hits")?;
        }
        with(world, |world| {
            let parse_at = |(i, ray)| {
                parse(world, ray).map_err(|f| Failure::new(f.status, format!("rays[{i}]: {}", f.message)))
            };
            let queries = rays.iter().enumerate().map(parse_at).collect::<Result<Vec<_>, _>>()?;
            let answers = queries.iter().map(|query| answer(world, query)).collect::<Result<Vec<_>, _>>()?;
            for (i, hit) in answers.into_iter().enumerate() {
                // SAFETY: not null, aligned, and the caller vouches for `count` entries.
                unsafe { hits.add(i).write(hit) };
            }
            Ok(())
        })
    })
}

fn parse(world: &World, ray: &DcdRay) -> Result<RayQuery, Failure> {
    check_point(&ray.origin, "origin")?;
    check_numbers(&ray.direction, "direction")?;
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
    let exclude = if ray.exclude.v == 0 { None } else { Some(body::find(world, ray.exclude)?) };
    Ok(RayQuery {
        origin: ray.origin,
        direction: ray.direction,
        max_m: ray.max_distance,
        mask: ray.mask,
        exclude,
    })
}

fn answer(world: &World, query: &RayQuery) -> Result<DcdRayHit, Failure> {
    Ok(match world.backend.cast_ray(query)? {
        Some(hit) => DcdRayHit {
            body: world.mark.body(hit.body),
            user_data: world.backend.user_data(hit.body).unwrap_or(0),
            point: hit.point,
            normal: hit.normal,
            distance: hit.distance_m as f32,
        },
        None => DcdRayHit {
            body: DcdBodyId { v: 0 },
            user_data: 0,
            point: [0.0; 3],
            normal: [0.0; 3],
            distance: 0.0,
        },
    })
}
