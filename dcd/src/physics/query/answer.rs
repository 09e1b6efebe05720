//! Answers queries in wire form, as clients and the C API send them, from the bodies that this process holds.

use std::ops::ControlFlow;

use parry3d::query::{ShapeCastOptions, ShapeCastStatus};
use rapier3d::prelude::*;

use super::{
    BodyFilter, ColliderId, Lets, PointHit, Queries, QueryError, RayHit, ShapeHit, WorldMotion, WorldRay,
};
use crate::physics::region::Region;
use crate::physics::{ShapeError, ShapeLibrary};
use crate::protocol::{
    CastAnswer, CastQuery, FilterRecord, MAX_FOUND, Overlap, OverlapQuery, PartFilter, Place, Query,
    QueryParts, QueryResult, RayAnswer, RayQuery, ShapeHash, ShapeRecord, Velocity, WorldPose,
};
use crate::space::BodyId;

impl Query {
    /// Makes a query for the first hit of one shape that moves straight by `motion`, metres, in world space.
    ///
    /// # Errors
    /// [`ShapeError`] for a shape that no query may use.
    pub fn cast_shape(shape: &SharedShape, pose: WorldPose, motion: [f32; 3]) -> Result<Self, ShapeError> {
        let (shape, shapes) = recorded(shape)?;
        let (turn, margin_m, leaves, filter) = ([0.0; 3], 0.0, false, PartFilter::default());
        let cast = CastQuery { shape, pose, motion, turn, margin_m, leaves, filter };
        Ok(Self { shapes, parts: QueryParts::Casts(vec![cast]), ..Self::rays([]) })
    }

    /// Makes a query for all colliders that overlap one shape.
    ///
    /// # Errors
    /// [`ShapeError`] for a shape that no query may use.
    pub fn intersect_shape(shape: &SharedShape, pose: WorldPose) -> Result<Self, ShapeError> {
        let (shape, shapes) = recorded(shape)?;
        Ok(Self { shapes, ..Self::overlaps([Place::Shape(shape, pose)]) })
    }
}

/// Returns a shape in wire form: its hash, and the records of which it consists.
fn recorded(shape: &SharedShape) -> Result<(ShapeHash, Vec<ShapeRecord>), ShapeError> {
    let mut library = ShapeLibrary::default();
    let hash = library.intern(shape)?;
    Ok((hash, library.records()))
}

impl From<QueryFilterFlags> for FilterRecord {
    fn from(flags: QueryFilterFlags) -> Self {
        Self { flags: flags.bits(), ..Self::default() }
    }
}

impl Queries<'_> {
    /// Answers the queries of one message. An invalid query finds nothing.
    #[doc(hidden)]
    pub fn answer(&self, query: &Query) -> QueryResult {
        let mut shapes = ShapeLibrary::default();
        for record in &query.shapes {
            // A query that names a refused shape finds nothing.
            let _ = shapes.add(record.clone());
        }
        let (all, shape) = (&query.filter, |hash| shapes.shape(hash).ok());
        match &query.parts {
            QueryParts::Rays(rays) => {
                let hit = |ray| self.ask_ray(all, ray).ok().flatten();
                QueryResult::Rays(rays.iter().map(|ray| hit(ray).as_ref().map(RayAnswer::from)).collect())
            }
            QueryParts::Casts(casts) => {
                let hit = |cast: &CastQuery| self.ask_cast(all, &*shape(cast.shape)?.0, cast).ok().flatten();
                QueryResult::Casts(
                    casts.iter().map(|cast| hit(cast).as_ref().map(CastAnswer::from)).collect(),
                )
            }
            QueryParts::Overlaps(overlaps) => {
                let (mut lists, mut count) = (Vec::new(), 0);
                for overlap in overlaps {
                    let found = self.ask_overlap(all, shape, overlap).unwrap_or_default();
                    count += found.len();
                    if count > MAX_FOUND {
                        return QueryResult::TooMuch;
                    }
                    lists.push(found.iter().map(Overlap::from).collect());
                }
                QueryResult::Overlaps(lists)
            }
        }
    }

    /// Returns the first hit of one ray.
    #[doc(hidden)]
    pub fn ask_ray(&self, all: &FilterRecord, ray: &RayQuery) -> Result<Option<RayHit>, QueryError> {
        self.first_met(&straight(ray), &Told { all, part: &ray.filter })
    }

    /// Returns all hits of one ray, the nearest first.
    #[doc(hidden)]
    pub fn ask_ray_through(&self, all: &FilterRecord, ray: &RayQuery) -> Result<Vec<RayHit>, QueryError> {
        self.asking(all, &ray.filter, |queries, filter| queries.intersect_ray(&straight(ray), filter))
    }

    /// Returns the first hit of one moving shape, within one unit of time.
    #[doc(hidden)]
    pub fn ask_cast(
        &self,
        all: &FilterRecord,
        shape: &dyn Shape,
        cast: &CastQuery,
    ) -> Result<Option<ShapeHit>, QueryError> {
        let CastQuery { pose, motion, turn, margin_m, leaves, filter, .. } = cast;
        if *turn != [0.0; 3] {
            let velocity = Velocity { linear: *motion, angular: *turn };
            let motion = WorldMotion { start: *pose, local_centre: [0.0; 3], velocity };
            return self.asking(all, filter, |queries, filter| {
                queries.cast_shape_nonlinear(shape, &motion, 0.0..1.0, !leaves, filter)
            });
        }
        let options = options(*margin_m, *leaves);
        self.asking(all, filter, |queries, filter| queries.cast_shape(shape, pose, *motion, options, filter))
    }

    /// Calls `meet` for the hits of one shape that moves straight, as [`Queries::visit_cast_shape`] does. The
    /// rotation of the cast is ignored.
    #[doc(hidden)]
    pub fn ask_cast_each(
        &self,
        all: &FilterRecord,
        shape: &dyn Shape,
        cast: &CastQuery,
        mut meet: impl FnMut(CastAnswer) -> f32,
    ) -> Result<(), QueryError> {
        let CastQuery { pose, motion, margin_m, leaves, filter, .. } = cast;
        let options = options(*margin_m, *leaves);
        self.asking(all, filter, |queries, filter| {
            queries.visit_cast_shape(shape, pose, *motion, options, filter, |hit| meet(hit.into()))
        })
    }

    /// Calls `meet` for the hits of one ray, as [`Queries::visit_ray`] does.
    #[doc(hidden)]
    pub fn ask_ray_each(
        &self,
        all: &FilterRecord,
        ray: &RayQuery,
        mut meet: impl FnMut(RayAnswer) -> f64,
    ) -> Result<(), QueryError> {
        self.asking(all, &ray.filter, |queries, filter| {
            queries.visit_ray(&straight(ray), filter, |hit| meet(hit.into()))
        })
    }

    /// Calls `meet` for the colliders that overlap one shape, point or box, until `meet` breaks off. An
    /// unknown shape overlaps none.
    #[doc(hidden)]
    pub fn ask_overlap_each(
        &self,
        all: &FilterRecord,
        shape: impl Fn(ShapeHash) -> Option<SharedShape>,
        overlap: &OverlapQuery,
        meet: impl FnMut(ColliderId) -> ControlFlow<()>,
    ) -> Result<(), QueryError> {
        self.asking(all, &overlap.filter, |queries, filter| match &overlap.place {
            Place::Shape(hash, pose) => match shape(*hash) {
                Some(shape) => queries.visit_shape(&*shape.0, pose, filter, meet),
                None => Ok(()),
            },
            Place::Point(point) => {
                let _ = queries.intersect_point(*point, filter)?.into_iter().try_for_each(meet);
                Ok(())
            }
            Place::Box(bounds) => queries.visit_aabb_conservative(bounds, filter, meet),
        })
    }

    /// Returns all colliders that overlap one shape, point or box, in order of ids. An unknown shape overlaps
    /// none.
    #[doc(hidden)]
    pub fn ask_overlap(
        &self,
        all: &FilterRecord,
        shape: impl Fn(ShapeHash) -> Option<SharedShape>,
        overlap: &OverlapQuery,
    ) -> Result<Vec<ColliderId>, QueryError> {
        self.asking(all, &overlap.filter, |queries, filter| match &overlap.place {
            Place::Shape(hash, pose) => match shape(*hash) {
                Some(shape) => queries.intersect_shape(&*shape.0, pose, filter),
                None => Ok(Vec::new()),
            },
            Place::Point(point) => queries.intersect_point(*point, filter),
            Place::Box(bounds) => queries.intersect_aabb_conservative(bounds, filter),
        })
    }

    /// Returns the point of any collider that is nearest to a given point, as [`Queries::project_point`]
    /// does.
    #[doc(hidden)]
    pub fn ask_nearest(
        &self,
        all: &FilterRecord,
        point: [f64; 3],
        max_m: f64,
        solid: bool,
        filter: &PartFilter,
    ) -> Result<Option<PointHit>, QueryError> {
        self.asking(all, filter, |queries, filter| queries.project_point(point, max_m, solid, filter))
    }

    fn asking<R>(
        &self,
        all: &FilterRecord,
        filter: &PartFilter,
        ask: impl FnOnce(&Self, &BodyFilter<'_>) -> Result<R, QueryError>,
    ) -> Result<R, QueryError> {
        let told = Told { all, part: filter };
        let lets = |id: BodyId, collider: &Collider| told.meets(collider) && !told.overlooks(id);
        ask(self, &BodyFilter { flags: told.flags(), predicate: Some(&lets), ..BodyFilter::default() })
    }
}

/// A filter in wire form: the part for all queries of a message, and the part for one of them.
struct Told<'a> {
    all: &'a FilterRecord,
    part: &'a PartFilter,
}

impl Told<'_> {
    fn flags(&self) -> QueryFilterFlags {
        QueryFilterFlags::from_bits_truncate(self.all.flags)
    }

    /// Returns whether the filter lets a collider through by its groups. By default a query is in no group,
    /// and only the collider's memberships count.
    fn meets(&self, collider: &Collider) -> bool {
        let [groups, mask] = [self.all.groups, self.part.mask].map(Group::from_bits_retain);
        let of = collider.collision_groups();
        of.memberships.intersects(mask) && (groups.is_empty() || of.filter.intersects(groups))
    }

    fn overlooks(&self, id: BodyId) -> bool {
        self.part.exclude == Some(id) || self.all.exclude.binary_search(&id).is_ok()
    }
}

impl Lets for Told<'_> {
    fn lets(&self, region: &Region, parent: RigidBodyHandle, _: ColliderHandle, collider: &Collider) -> bool {
        // Few queries exclude bodies. For the others the body of a collider is not looked up.
        let all_are_met = self.part.exclude.is_none() && self.all.exclude.is_empty();
        self.flags().test(&region.physics().bodies, collider)
            && self.meets(collider)
            && (all_are_met || region.role_of(parent).is_some_and(|(id, _)| !self.overlooks(id)))
    }
}

/// Returns the options of a cast that ends after its whole motion, at time 1.
fn options(margin_m: f32, leaves: bool) -> ShapeCastOptions {
    ShapeCastOptions {
        target_distance: margin_m,
        stop_at_penetration: !leaves,
        compute_impact_geometry_on_penetration: true,
        ..ShapeCastOptions::with_max_time_of_impact(1.0)
    }
}

fn straight(ray: &RayQuery) -> WorldRay {
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
