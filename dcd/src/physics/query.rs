//! Rays across regions: each region asks its own Rapier world about the bodies it answers for, the nearest answer wins.

use rapier3d::prelude::*;

use super::convert;
use super::host::RegionHost;
use super::region::{Region, Role};
use crate::space::BodyId;

/// What a ray met first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Which body.
    pub body: BodyId,
    /// Where, in world space, metres.
    pub point: [f64; 3],
    /// Outward unit normal of the surface there.
    pub normal: [f32; 3],
    /// From the origin, metres.
    pub distance_m: f64,
}

/// What a ray looks for; the default meets everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayFilter<'a> {
    /// Meets colliders that belong to any of these groups.
    pub groups: Group,
    /// Passes through these bodies, as through the one that looks.
    pub exclude: &'a [BodyId],
    /// Whether it meets sensors too.
    pub sensors: bool,
}

impl Default for RayFilter<'_> {
    fn default() -> Self {
        Self { groups: Group::ALL, exclude: &[], sensors: true }
    }
}

impl RegionHost {
    /// The first body computed here that a ray meets and does not overlook.
    pub fn cast_ray(
        &self,
        origin: [f64; 3],
        direction: [f32; 3],
        max_m: f32,
        filter: &RayFilter<'_>,
    ) -> Option<RayHit> {
        let direction = convert::vector(direction);
        if !(direction.length() > 0.0 && direction.is_finite() && origin.iter().all(|v| v.is_finite())) {
            return None;
        }
        let direction = direction.normalize();
        let mut best: Option<RayHit> = None;
        for region in self.regions() {
            let reach_m = best.map_or(f64::from(max_m), |hit| hit.distance_m);
            let hit = cast_in_region(region, origin, direction, reach_m, filter);
            if let Some(hit) = hit
                && best.is_none_or(|best| (hit.distance_m, hit.body) < (best.distance_m, best.body))
            {
                best = Some(hit);
            }
        }
        best
    }
}

/// Replicas are left to their owners, so that no body answers twice from two slightly different places.
fn cast_in_region(
    region: &Region,
    origin: [f64; 3],
    direction: Vector,
    max_m: f64,
    filter: &RayFilter<'_>,
) -> Option<RayHit> {
    let answers = |_: ColliderHandle, collider: &Collider| {
        let role = collider.parent().and_then(|parent| region.role_of(parent));
        role.is_some_and(|(id, role)| !matches!(role, Role::Replica { .. }) && !filter.exclude.contains(&id))
            && collider.collision_groups().memberships.intersects(filter.groups)
            && (filter.sensors || !collider.is_sensor())
    };
    let filter = QueryFilter::default().predicate(&answers);
    let ray = Ray::new(convert::region_point(region.anchor(), origin), direction);
    let (handle, hit) = region.physics().cast_ray_and_get_normal(&ray, max_m as f32, true, filter)?;
    let collider = region.physics().colliders.get(handle)?;
    let (body, _) = region.role_of(collider.parent()?)?;
    Some(RayHit {
        body,
        point: convert::world_point(region.anchor(), ray.point_at(hit.time_of_impact)),
        normal: hit.normal.to_array(),
        distance_m: f64::from(hit.time_of_impact),
    })
}
