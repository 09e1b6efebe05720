//! Casts rays through all regions: finds the first hit, all hits along a ray, or as many as a program wants.

use std::collections::BTreeSet;

use rapier3d::prelude::*;

use super::nearest::nearest;
use super::{Answerer, BodyFilter, Lets, Queries, QueryError, check};
use crate::physics::convert;
use crate::physics::region::Region;
use crate::space::{BodyId, Bounds};

/// The greatest distance from a ray's origin to the box of the colliders, metres, at which the ray is cast
/// from its own origin. f32 resolves this distance to micrometres. From farther away the ray is cast from 1 m
/// before the box.
const NEAR_M: f64 = 256.0;

/// A ray in world space: a straight line that begins at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldRay {
    /// The start of the ray, in world space, metres.
    pub origin: [f64; 3],
    /// The direction, of any length above 0.
    pub direction: [f32; 3],
    /// The length of the ray, metres, 0 or more; may be infinite.
    pub max_m: f64,
    /// Says whether the ray hits a body that it starts in at once. Otherwise it hits the body's surface from
    /// inside.
    pub solid: bool,
}

impl WorldRay {
    /// Makes a ray of infinite length, which hits the bodies that it starts in.
    #[must_use]
    pub const fn new(origin: [f64; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, max_m: f64::INFINITY, solid: true }
    }

    /// Returns the same ray with this length, metres.
    #[must_use]
    pub const fn up_to(self, max_m: f64) -> Self {
        Self { max_m, ..self }
    }
}

/// The hit of a ray on a collider.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RayHit {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, from 0 in order of insertion.
    pub collider: usize,
    /// The point of the hit in world space, metres.
    pub point: [f64; 3],
    /// The outward unit normal of the surface there; zero where a solid ray starts inside.
    pub normal: [f32; 3],
    /// The distance from the origin of the ray, metres.
    pub distance_m: f64,
    /// The face, edge or vertex of the shape.
    pub feature: FeatureId,
    /// The part of a compound, or the triangle of a mesh.
    pub subshape: u32,
}

impl Queries<'_> {
    /// Returns the first hit of a ray; of equally near hits, that on the collider with the lowest id.
    pub fn cast_ray(&self, ray: &WorldRay, filter: &BodyFilter<'_>) -> Result<Option<RayHit>, QueryError> {
        self.first_met(ray, filter)
    }

    /// Returns the first hit of a ray, as [`Queries::cast_ray`] does, by any form of filter.
    pub(super) fn first_met(&self, ray: &WorldRay, filter: &impl Lets) -> Result<Option<RayHit>, QueryError> {
        let ray = Straight::of(ray)?;
        let mut best: Option<RayHit> = None;
        let ask = |answerer: &Answerer<'_>| {
            let reach_m = best.map_or(ray.max_m, |hit| hit.distance_m);
            let Some(part) = ray.part(&answerer.extent(), reach_m) else { return };
            let (local, reach) = part.local(answerer);
            let hit = nearest(&answerer.pipeline, &local, reach, ray.solid);
            let Some(hit) = hit.and_then(|(handle, hit)| part.hit(answerer, &local, handle, &hit)) else {
                return;
            };
            if best.is_none_or(|best| order(&hit, &best).is_lt()) {
                best = Some(hit);
            }
        };
        if self.are_several() {
            Self::ask_in(self.entered(&ray).into_iter().map(|(_, region)| region), filter, None, ask);
        } else {
            self.ask(filter, None, ask);
        }
        Ok(best)
    }

    /// Returns the regions where a ray may hit something, each with the distance at which the ray enters it,
    /// nearest first. After a hit the ray need not look any farther.
    fn entered(&self, ray: &Straight) -> Vec<(f64, &Region)> {
        let enters = |region: &Region| ray.enters(region.moved().extent.as_ref()?, ray.max_m);
        let regions = self.host.regions();
        let mut entered: Vec<_> = regions.filter_map(|region| Some((enters(region)?, region))).collect();
        entered.sort_by(|a, b| a.0.total_cmp(&b.0));
        entered
    }

    /// Returns one hit on every collider that a ray meets, the nearest first; of equally near hits, that on
    /// the lowest id first.
    pub fn intersect_ray(&self, ray: &WorldRay, filter: &BodyFilter<'_>) -> Result<Vec<RayHit>, QueryError> {
        let ray = Straight::of(ray)?;
        let mut hits = Vec::new();
        self.ask(filter, None, |answerer| {
            let Some(part) = ray.part(&answerer.extent(), ray.max_m) else { return };
            let (local, reach) = part.local(answerer);
            let met = answerer.pipeline.intersect_ray(local, reach, ray.solid);
            hits.extend(met.filter_map(|(handle, _, hit)| part.hit(answerer, &local, handle, &hit)));
        });
        // Several regions may have named the same immovable body.
        hits.sort_by(|a, b| (a.body, a.collider).cmp(&(b.body, b.collider)).then(order(a, b)));
        hits.dedup_by_key(|hit| (hit.body, hit.collider));
        hits.sort_by(order);
        Ok(hits)
    }

    /// Calls `meet` with one hit on every collider that a ray meets, in no particular order. `meet` returns
    /// the length of the ray from then on, metres: the distance of the hit leaves only what is nearer,
    /// infinity leaves everything, and 0 ends the query.
    ///
    /// ```
    /// # use dcd::physics::{BodyFilter, WorldRay};
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::prelude::*;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// # for x in [3.0, 6.0, 9.0] {
    /// #     world.insert(RigidBodyBuilder::fixed().translation(Vector::new(x, 0.0, 0.0)), ColliderBuilder::ball(1.0))?;
    /// # }
    /// let mut thickness = 0;
    /// let along = WorldRay::new([0.0; 3], [1.0, 0.0, 0.0]);
    /// world.queries().visit_ray(&along, &BodyFilter::default(), |_| {
    ///     thickness += 1;
    ///     if thickness < 2 { f64::INFINITY } else { 0.0 }
    /// })?;
    /// assert_eq!(thickness, 2, "of the three it has seen enough");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn visit_ray(
        &self,
        ray: &WorldRay,
        filter: &BodyFilter<'_>,
        mut meet: impl FnMut(&RayHit) -> f64,
    ) -> Result<(), QueryError> {
        let ray = Straight::of(ray)?;
        let mut reach_m = ray.max_m;
        // Several regions may name the same immovable body.
        let mut met = self.are_several().then(BTreeSet::new);
        self.ask(filter, None, |answerer| {
            let Some(part) = ray.part(&answerer.extent(), reach_m).filter(|_| reach_m > 0.0) else { return };
            let (local, reach) = part.local(answerer);
            for (handle, _, hit) in answerer.pipeline.intersect_ray(local, reach, ray.solid) {
                let Some(hit) = part.hit(answerer, &local, handle, &hit) else { continue };
                let mut is_new = || met.as_mut().is_none_or(|met| met.insert((hit.body, hit.collider)));
                if hit.distance_m <= reach_m && is_new() {
                    // NaN ends the query too.
                    reach_m = meet(&hit).clamp(0.0, reach_m).max(0.0);
                    if reach_m == 0.0 {
                        return;
                    }
                }
            }
        });
        Ok(())
    }
}

fn order(a: &RayHit, b: &RayHit) -> std::cmp::Ordering {
    a.distance_m.total_cmp(&b.distance_m).then((a.body, a.collider).cmp(&(b.body, b.collider)))
}

/// A ray with a direction of length 1.
struct Straight {
    origin: [f64; 3],
    direction: [f64; 3],
    /// The inverse of the direction. Multiplying by it is cheaper than dividing by the direction for each
    /// box.
    inverse: [f64; 3],
    max_m: f64,
    solid: bool,
}

impl Straight {
    fn of(ray: &WorldRay) -> Result<Self, QueryError> {
        check::point(ray.origin, "ray's origin")?;
        check::vector(ray.direction, "ray's direction")?;
        check::limit(ray.max_m, "ray's max_m")?;
        let direction = ray.direction.map(f64::from);
        let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length == 0.0 {
            return Err(QueryError::NoDirection);
        }
        let direction = direction.map(|v| v / length);
        let inverse = direction.map(f64::recip);
        Ok(Self { origin: ray.origin, direction, inverse, max_m: ray.max_m, solid: ray.solid })
    }

    /// Returns the part of the ray that may hit something in a box; `None` if there is none.
    fn part(&self, extent: &Bounds, reach_m: f64) -> Option<Part<'_>> {
        let enter_m = self.enters(extent, reach_m)?;
        let start_m = if enter_m > NEAR_M { enter_m - 1.0 } else { 0.0 };
        Some(Part { ray: self, start_m, reach_m })
    }

    /// Returns the distance at which the ray enters a box, metres, 0 from inside; `None` if it does not enter
    /// it within `reach_m`.
    fn enters(&self, extent: &Bounds, reach_m: f64) -> Option<f64> {
        let (mut enter_m, mut leave_m) = (0.0f64, reach_m);
        for i in 0..3 {
            // The margin covers the rounding of the box to f32.
            let margin = 1e-3 + 1e-6 * (extent.min[i].abs().max(extent.max[i].abs())).min(1e9);
            let [low, high] = [extent.min[i] - margin, extent.max[i] + margin].map(|v| v - self.origin[i]);
            if self.direction[i] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let [a, b] = [low, high].map(|v| v * self.inverse[i]);
            (enter_m, leave_m) = (enter_m.max(a.min(b)), leave_m.min(a.max(b)));
        }
        (enter_m <= leave_m).then_some(enter_m)
    }
}

struct Part<'a> {
    ray: &'a Straight,
    start_m: f64,
    reach_m: f64,
}

impl Part<'_> {
    /// Returns this part as a ray in region space, and its length, metres.
    fn local(&self, answerer: &Answerer<'_>) -> (Ray, f32) {
        let start: [f64; 3] =
            std::array::from_fn(|i| self.ray.origin[i] + self.start_m * self.ray.direction[i]);
        let direction = convert::vector(self.ray.direction.map(|v| v as f32));
        let origin = convert::region_point(answerer.region.anchor(), start);
        (Ray::new(origin, direction), check::f32_limit(self.reach_m - self.start_m))
    }

    fn hit(
        &self,
        answerer: &Answerer<'_>,
        local: &Ray,
        handle: ColliderHandle,
        hit: &RayIntersection,
    ) -> Option<RayHit> {
        let at = local.point_at(hit.time_of_impact);
        let id = answerer.name(handle, Aabb::new(at, at))?;
        Some(RayHit {
            body: id.body,
            collider: id.index,
            point: convert::world_point(answerer.region.anchor(), at),
            normal: hit.normal.to_array(),
            distance_m: self.start_m + f64::from(hit.time_of_impact),
            feature: hit.feature,
            subshape: hit.subshape,
        })
    }
}
