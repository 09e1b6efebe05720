//! Projects points onto the nearest collider, and finds the colliders that contain a point.

use parry3d::query::PointProjection;
use rapier3d::prelude::*;

use super::{Answerer, BodyFilter, ColliderId, Queries, QueryError, check};
use crate::physics::convert;
use crate::space::{BodyId, Bounds};

/// The point of a collider that is nearest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PointHit {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, from 0 in order of insertion.
    pub collider: usize,
    /// The nearest point of the collider, in world space, metres.
    pub point: [f64; 3],
    /// The distance from the given point, metres.
    pub distance_m: f64,
    /// Says whether the given point lies inside the collider.
    pub inside: bool,
}

impl Queries<'_> {
    /// Returns the point of any collider that is nearest to a given point, at most `max_m` metres away, which
    /// may be infinite. With `solid`, a point inside a collider is its own nearest point; otherwise the
    /// nearest point of the surface counts.
    pub fn project_point(
        &self,
        point: [f64; 3],
        max_m: f64,
        solid: bool,
        filter: &BodyFilter<'_>,
    ) -> Result<Option<PointHit>, QueryError> {
        let found = self.nearest(point, max_m, filter, |answerer, point, max_m| {
            let (handle, projection) = answerer.pipeline.project_point(point, max_m, solid)?;
            Some((handle, projection, ()))
        })?;
        Ok(found.map(|(hit, ())| hit))
    }

    /// Returns the nearest point of any surface, and the face, edge or vertex on which it lies.
    pub fn project_point_and_get_feature(
        &self,
        point: [f64; 3],
        max_m: f64,
        filter: &BodyFilter<'_>,
    ) -> Result<Option<(PointHit, FeatureId)>, QueryError> {
        self.nearest(point, max_m, filter, |answerer, point, max_m| {
            answerer.pipeline.project_point_and_get_feature(point, max_m)
        })
    }

    /// Returns every collider in which a point lies, in order of ids.
    ///
    /// ```
    /// # use dcd::physics::BodyFilter;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::prelude::*;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// let area = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(2.0).sensor(true))?;
    /// let inside = world.queries().intersect_point([1.0, 0.0, 0.0], &BodyFilter::default())?;
    /// assert_eq!(inside.iter().map(|id| id.body).collect::<Vec<_>>(), [area]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn intersect_point(
        &self,
        point: [f64; 3],
        filter: &BodyFilter<'_>,
    ) -> Result<Vec<ColliderId>, QueryError> {
        check::point(point, "point")?;
        let mut found = Vec::new();
        self.ask(filter, Some(&Bounds::new(point, point)), |answerer| {
            let at = convert::region_point(answerer.region.anchor(), point);
            let around = answerer.pipeline.intersect_point(at);
            found.extend(around.filter_map(|(handle, _)| answerer.name(handle, Aabb::new(at, at))));
        });
        found.sort_unstable();
        found.dedup();
        Ok(found)
    }

    fn nearest<T>(
        &self,
        point: [f64; 3],
        max_m: f64,
        filter: &BodyFilter<'_>,
        project: impl Fn(&Answerer<'_>, Vector, f32) -> Option<(ColliderHandle, PointProjection, T)>,
    ) -> Result<Option<(PointHit, T)>, QueryError> {
        check::point(point, "point")?;
        check::limit(max_m, "max_m")?;
        let mut best: Option<(PointHit, T)> = None;
        self.ask(filter, None, |answerer| {
            let reach_m = best.as_ref().map_or(max_m, |(hit, _)| hit.distance_m);
            let anchor = answerer.region.anchor();
            let at = convert::region_point(anchor, point);
            let Some((handle, projection, more)) = project(answerer, at, check::f32_limit(reach_m)) else {
                return;
            };
            let Some(id) = answerer.name(handle, Aabb::new(projection.point, projection.point)) else {
                return;
            };
            let hit = PointHit {
                body: id.body,
                collider: id.index,
                point: convert::world_point(anchor, projection.point),
                distance_m: f64::from((projection.point - at).length()),
                inside: projection.is_inside,
            };
            let key = |hit: &PointHit| (hit.body, hit.collider);
            let nearer = |best: &PointHit| {
                hit.distance_m.total_cmp(&best.distance_m).then(key(&hit).cmp(&key(best))).is_lt()
            };
            if best.as_ref().is_none_or(|(best, _)| nearer(best)) {
                best = Some((hit, more));
            }
        });
        Ok(best)
    }
}
