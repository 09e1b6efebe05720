//! Finds the colliders that overlap a shape or a box.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use parry3d::bounding_volume::BoundingVolume;
use rapier3d::prelude::*;

use super::{BodyFilter, ColliderId, Queries, QueryError, check};
use crate::physics::convert;
use crate::protocol::WorldPose;
use crate::space::Bounds;

impl Queries<'_> {
    /// Returns every collider that overlaps a shape at a pose, in order of ids.
    ///
    /// ```
    /// # use dcd::physics::BodyFilter;
    /// # use dcd::protocol::WorldPose;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::prelude::*;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// let crate_ = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(0.5, 0.5, 0.5))?;
    /// let blast = Ball::new(3.0);
    /// let hit = world.queries().intersect_shape(&blast, &WorldPose::at([3.0, 0.0, 0.0]), &BodyFilter::default())?;
    /// assert_eq!(hit.iter().map(|id| id.body).collect::<Vec<_>>(), [crate_]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn intersect_shape(
        &self,
        shape: &dyn Shape,
        pose: &WorldPose,
        filter: &BodyFilter<'_>,
    ) -> Result<Vec<ColliderId>, QueryError> {
        let mut found = Vec::new();
        self.visit_shape(shape, pose, filter, |id| {
            found.push(id);
            ControlFlow::Continue(())
        })?;
        found.sort_unstable();
        Ok(found)
    }

    /// Calls `meet` with every collider that overlaps a shape at a pose, in no particular order, until `meet`
    /// breaks off.
    ///
    /// ```
    /// # use std::ops::ControlFlow;
    /// # use dcd::physics::BodyFilter;
    /// # use dcd::protocol::WorldPose;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::prelude::*;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// # world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(0.5, 0.5, 0.5))?;
    /// let (mut is_free, at) = (true, WorldPose::at([0.0, 0.2, 0.0]));
    /// world.queries().visit_shape(&Ball::new(0.5), &at, &BodyFilter::default(), |_| {
    ///     is_free = false;
    ///     ControlFlow::Break(())
    /// })?;
    /// assert!(!is_free);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn visit_shape(
        &self,
        shape: &dyn Shape,
        pose: &WorldPose,
        filter: &BodyFilter<'_>,
        meet: impl FnMut(ColliderId) -> ControlFlow<()>,
    ) -> Result<(), QueryError> {
        check::pose(pose, "shape's pose")?;
        let mut once = Once::new(meet, self.are_several());
        let turn = Pose::from_rotation(convert::rotation(pose.rotation));
        let around = shape.compute_aabb(&turn);
        let world = |v: Vector| convert::world_point(pose.translation, v);
        // Wider than the shape, for rounding.
        let near = Bounds { min: world(around.mins), max: world(around.maxs) }.grown(0.01);
        self.ask(filter, Some(&near), |answerer| {
            let pose = convert::region_from_world(answerer.region.anchor(), pose);
            let near = shape.compute_aabb(&pose).loosened(0.01);
            let overlapping = answerer.pipeline.intersect_shape(pose, shape);
            once.pass(overlapping.filter_map(|(handle, _)| answerer.name(handle, near)));
        });
        Ok(())
    }

    /// Returns every collider whose own AABB touches this box, in order of ids: those that may overlap it.
    /// The box may be infinite. Rapier's own answer depends on the boxes of its BVH, which are wider; this
    /// one does not.
    pub fn intersect_aabb_conservative(
        &self,
        bounds: &Bounds,
        filter: &BodyFilter<'_>,
    ) -> Result<Vec<ColliderId>, QueryError> {
        let mut found = Vec::new();
        self.visit_aabb_conservative(bounds, filter, |id| {
            found.push(id);
            ControlFlow::Continue(())
        })?;
        found.sort_unstable();
        Ok(found)
    }

    /// Calls `meet` with every collider whose own AABB touches this box, in no particular order, until `meet`
    /// breaks off.
    pub fn visit_aabb_conservative(
        &self,
        bounds: &Bounds,
        filter: &BodyFilter<'_>,
        meet: impl FnMut(ColliderId) -> ControlFlow<()>,
    ) -> Result<(), QueryError> {
        check::bounds(bounds)?;
        let mut once = Once::new(meet, self.are_several());
        self.ask(filter, Some(bounds), |answerer| {
            let local = |point: [f64; 3]| {
                let point = convert::region_point(answerer.region.anchor(), point);
                point.clamp(Vector::splat(-f32::MAX), Vector::splat(f32::MAX))
            };
            let aabb = Aabb::new(local(bounds.min), local(bounds.max));
            let near = answerer.pipeline.intersect_aabb_conservative(aabb);
            let touching = near.filter(|(_, collider)| collider.compute_aabb().intersects(&aabb));
            once.pass(touching.filter_map(|(handle, _)| answerer.name(handle, aabb)));
        });
        Ok(())
    }
}

/// A receiver of colliders. It passes each on once, though several regions may name it, until `meet` breaks
/// off.
struct Once<F> {
    meet: F,
    /// The colliders passed on so far; `None` if there is one region, which names each once.
    met: Option<BTreeSet<ColliderId>>,
    is_over: bool,
}

impl<F: FnMut(ColliderId) -> ControlFlow<()>> Once<F> {
    fn new(meet: F, are_several: bool) -> Self {
        Self { meet, met: are_several.then(BTreeSet::new), is_over: false }
    }

    fn pass(&mut self, mut found: impl Iterator<Item = ColliderId>) {
        while !self.is_over
            && let Some(id) = found.next()
        {
            let is_new = self.met.as_mut().is_none_or(|met| met.insert(id));
            self.is_over = is_new && (self.meet)(id).is_break();
        }
    }
}
