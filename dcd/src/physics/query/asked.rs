//! Answers questions (queries in wire form, as clients and the C API ask them) by the bodies that this process holds.

use parry3d::query::{ShapeCastOptions, ShapeCastStatus};
use rapier3d::prelude::*;

use super::{BodyFilter, ColliderId, PointHit, Queries, QueryError, RayHit, ShapeHit, WorldMotion, WorldRay};
use crate::physics::ShapeLibrary;
use crate::protocol::{
    Asked, CastAnswer, CastQuestion, Found, MAX_FOUND, Meets, Overlap, OverlapQuestion, Overlooks, Place,
    Question, RayAnswer, RayQuestion, ShapeHash, Velocity,
};
use crate::space::BodyId;

impl Queries<'_> {
    /// Answers the queries of one message. An invalid query finds nothing.
    pub fn answer(&self, question: &Question) -> Found {
        let mut shapes = ShapeLibrary::default();
        for record in &question.shapes {
            // A query that names a refused shape finds nothing.
            let _ = shapes.add(record.clone());
        }
        let (all, shape) = (&question.overlooks, |hash| shapes.shape(hash).ok());
        match &question.asked {
            Asked::Rays(rays) => {
                let hit = |ray| self.ask_ray(all, ray).ok().flatten();
                Found::Rays(rays.iter().map(|ray| hit(ray).as_ref().map(RayAnswer::from)).collect())
            }
            Asked::Casts(casts) => {
                let hit =
                    |cast: &CastQuestion| self.ask_cast(all, &*shape(cast.shape)?.0, cast).ok().flatten();
                Found::Casts(casts.iter().map(|cast| hit(cast).as_ref().map(CastAnswer::from)).collect())
            }
            Asked::Overlaps(overlaps) => {
                let (mut lists, mut count) = (Vec::new(), 0);
                for overlap in overlaps {
                    let found = self.ask_overlap(all, shape, overlap).unwrap_or_default();
                    count += found.len();
                    if count > MAX_FOUND {
                        return Found::TooMuch;
                    }
                    lists.push(found.iter().map(Overlap::from).collect());
                }
                Found::Overlaps(lists)
            }
        }
    }

    /// Returns the first hit of one ray.
    pub fn ask_ray(&self, all: &Overlooks, ray: &RayQuestion) -> Result<Option<RayHit>, QueryError> {
        self.asking(all, &ray.meets, |queries, filter| queries.cast_ray(&straight(ray), filter))
    }

    /// Returns all hits of one ray, the nearest first.
    pub fn ask_ray_through(&self, all: &Overlooks, ray: &RayQuestion) -> Result<Vec<RayHit>, QueryError> {
        self.asking(all, &ray.meets, |queries, filter| queries.intersect_ray(&straight(ray), filter))
    }

    /// Returns the first hit of one moving shape, within one unit of time.
    pub fn ask_cast(
        &self,
        all: &Overlooks,
        shape: &dyn Shape,
        cast: &CastQuestion,
    ) -> Result<Option<ShapeHit>, QueryError> {
        let CastQuestion { pose, motion, turn, margin_m, leaves, meets, .. } = cast;
        if *turn != [0.0; 3] {
            let velocity = Velocity { linear: *motion, angular: *turn };
            let motion = WorldMotion { start: *pose, local_centre: [0.0; 3], velocity };
            return self.asking(all, meets, |queries, filter| {
                queries.cast_shape_nonlinear(shape, &motion, 0.0..1.0, !leaves, filter)
            });
        }
        let options = ShapeCastOptions {
            target_distance: *margin_m,
            stop_at_penetration: !leaves,
            compute_impact_geometry_on_penetration: true,
            ..ShapeCastOptions::with_max_time_of_impact(1.0)
        };
        self.asking(all, meets, |queries, filter| queries.cast_shape(shape, pose, *motion, options, filter))
    }

    /// Returns all colliders that overlap one shape, point or box, by id; none if its shape is not known.
    pub fn ask_overlap(
        &self,
        all: &Overlooks,
        shape: impl Fn(ShapeHash) -> Option<SharedShape>,
        overlap: &OverlapQuestion,
    ) -> Result<Vec<ColliderId>, QueryError> {
        self.asking(all, &overlap.meets, |queries, filter| match &overlap.place {
            Place::Shape(hash, pose) => match shape(*hash) {
                Some(shape) => queries.intersect_shape(&*shape.0, pose, filter),
                None => Ok(Vec::new()),
            },
            Place::Point(point) => queries.intersect_point(*point, filter),
            Place::Box(bounds) => queries.intersect_aabb_conservative(bounds, filter),
        })
    }

    /// Returns the point of any collider that is nearest to a given point, as [`Queries::project_point`].
    pub fn ask_nearest(
        &self,
        all: &Overlooks,
        point: [f64; 3],
        max_m: f64,
        solid: bool,
        meets: &Meets,
    ) -> Result<Option<PointHit>, QueryError> {
        self.asking(all, meets, |queries, filter| queries.project_point(point, max_m, solid, filter))
    }

    fn asking<R>(
        &self,
        all: &Overlooks,
        meets: &Meets,
        ask: impl FnOnce(&Self, &BodyFilter<'_>) -> Result<R, QueryError>,
    ) -> Result<R, QueryError> {
        let [groups, mask] = [all.groups, meets.mask].map(Group::from_bits_retain);
        // A question belongs to no group unless it says so, and then only memberships count.
        let lets = |id: BodyId, collider: &Collider| {
            let of = collider.collision_groups();
            of.memberships.intersects(mask)
                && (groups.is_empty() || of.filter.intersects(groups))
                && meets.but != Some(id)
                && all.exclude.binary_search(&id).is_err()
        };
        let flags = QueryFilterFlags::from_bits_truncate(all.flags);
        ask(self, &BodyFilter { flags, predicate: Some(&lets), ..BodyFilter::default() })
    }
}

fn straight(ray: &RayQuestion) -> WorldRay {
    WorldRay { solid: ray.solid, ..WorldRay::new(ray.origin, ray.direction).up_to(ray.max_m) }
}

impl From<&RayHit> for RayAnswer {
    fn from(hit: &RayHit) -> Self {
        Self {
            body: hit.body,
            collider: hit.collider as u32,
            point: hit.point,
            normal: hit.normal,
            distance_m: hit.distance_m,
            subshape: hit.subshape,
        }
    }
}

impl From<&ShapeHit> for CastAnswer {
    fn from(hit: &ShapeHit) -> Self {
        Self {
            body: hit.body,
            collider: hit.collider as u32,
            fraction: hit.time_of_impact,
            point: hit.point,
            normal: hit.normal,
            point_on_shape: hit.point_on_shape,
            normal_on_shape: hit.normal_on_shape,
            subshape: hit.subshape,
            inside: hit.status == ShapeCastStatus::PenetratingOrWithinTargetDist,
        }
    }
}

impl From<&ColliderId> for Overlap {
    fn from(id: &ColliderId) -> Self {
        Self { body: id.body, collider: id.index as u32 }
    }
}
