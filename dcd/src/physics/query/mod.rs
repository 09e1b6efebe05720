//! Answers spatial queries over all regions of a process: ray casts, shape casts, point projections,
//! overlaps.
//!
//! Each region asks its own Rapier world about the bodies for which it answers, and the answers are merged.
//! No body answers twice from two slightly different places:
//!
//! - A ghost is left to its owner.
//! - An immovable body is held by several regions. A region near the answer answers for it.

mod answer;
mod cast;
mod check;
mod filter;
mod found;
mod half_space;
mod nearest;
mod overlap;
mod point;
mod ray;
mod sensor;
mod touching;

pub use cast::{ShapeHit, WorldMotion};
pub use check::QueryError;
pub(super) use check::{pose as check_pose, vector as check_vector};
pub use filter::BodyFilter;
use filter::Lets;
pub use point::PointHit;
pub use ray::{RayHit, WorldRay};

use rapier3d::prelude::*;

use super::collider_id::ColliderId;
use super::host::RegionHost;
use super::region::{Moved, Ownership, Region};
use crate::space::Bounds;

/// The interface for spatial queries of a local world, or of the regions that one node computes.
/// [`World::queries`](crate::World::queries) returns it; the methods are named after Rapier's.
///
/// Positions are in world space. Each region computes in f32 relative to its anchor, as in a step, so that
/// answers are as exact as the positions of bodies. Bodies are found where they are now, even if they were
/// inserted or moved since the last step; bare Rapier finds those only after its next step. Queries do not
/// change what the world does next.
///
/// ```
/// use dcd::prelude::*;
///
/// let mut world = World::new(WorldConfig { partitioning: Partitioning::Regions(4), ..WorldConfig::default() })?;
/// let floor = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
/// let ball = world.insert(
///     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 5.0, 0.0)),
///     ColliderBuilder::ball(0.5),
/// )?;
/// let down = WorldRay::new([0.0, 10.0, 0.0], [0.0, -1.0, 0.0]);
/// let hit = world.queries()?.cast_ray(&down, &BodyFilter::default())?.unwrap();
/// assert_eq!((hit.body, hit.distance_m), (ball, 4.5));
/// let all = world.queries()?.intersect_ray(&down, &BodyFilter::default())?;
/// assert_eq!(all.iter().map(|hit| hit.body).collect::<Vec<_>>(), [ball, floor]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct Queries<'a> {
    host: &'a RegionHost,
}

impl std::fmt::Debug for Queries<'_> {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("Queries").field("regions", &self.host.regions().len()).finish_non_exhaustive()
    }
}

impl Queries<'_> {
    /// Returns whether several regions answer. More than one of them may then name the same immovable body.
    fn are_several(&self) -> bool {
        self.host.regions().len() > 1
    }

    /// Calls `ask` for each of `things`, on the world's threads if they are worth waking, and returns the
    /// answers in the order of `things`.
    #[doc(hidden)]
    pub fn ask_about<T: Sync, R: Send>(&self, things: &[T], ask: impl Fn(&T) -> R + Sync) -> Vec<R> {
        self.host.spread(things, ask)
    }
}

impl RegionHost {
    /// Returns the interface for queries over the bodies that this process computes.
    pub fn queries(&self) -> Queries<'_> {
        Queries { host: self }
    }
}

/// The colliders for which a region answers: those that are where Rapier's BVH has them, or those that were
/// moved since the last step.
struct Answerer<'a> {
    region: &'a Region,
    pipeline: QueryPipeline<'a>,
    moved: Option<&'a Moved>,
}

impl<'a> Queries<'a> {
    /// Asks every region.
    fn ask(&self, filter: &impl Lets, near: Option<&Bounds>, ask: impl FnMut(&Answerer<'_>)) {
        Self::ask_in(self.host.regions(), filter, near, ask);
    }

    /// Asks some regions, one after the other, and a region twice if some of its bodies were moved since its
    /// last step. A region answers for immovable bodies if it covers `near`, or if `near` is `None`.
    fn ask_in<'r>(
        regions: impl Iterator<Item = &'r Region>,
        filter: &impl Lets,
        near: Option<&Bounds>,
        mut ask: impl FnMut(&Answerer<'_>),
    ) {
        for region in regions {
            let world = region.physics();
            let immovable_too = near.is_none_or(|near| region.covers(near));
            let all_count = immovable_too && region.ghosts().is_empty();
            let counts = |parent| match region.role_of(parent) {
                Some((_, Ownership::Immovable)) => immovable_too,
                Some((_, Ownership::Owner)) => true,
                _ => false,
            };
            let wants = |handle: ColliderHandle, collider: &Collider| {
                let parent = collider.parent().filter(|&parent| all_count || counts(parent));
                parent.is_some_and(|parent| filter.lets(region, parent, handle, collider))
            };
            let moved = region.moved();
            let stayed = |handle: ColliderHandle, collider: &Collider| {
                collider.is_enabled()
                    && !collider.parent().is_some_and(|parent| moved.holds(parent))
                    && wants(handle, collider)
            };
            let pipeline = world.query_pipeline_with_filter(QueryFilter::new().predicate(&stayed));
            if !pipeline.bvh.is_empty() {
                ask(&Answerer { region, pipeline, moved: None });
            }
            if !moved.bvh.is_empty() {
                let anew = |handle: ColliderHandle, _: &Collider| {
                    let handle = moved.original(handle);
                    wants(handle, &world.colliders[handle])
                };
                let filter = QueryFilter::new().predicate(&anew);
                let (bvh, colliders) = (&moved.bvh, &moved.colliders);
                let pipeline = QueryPipeline { bvh, colliders, filter, ..pipeline };
                ask(&Answerer { region, pipeline, moved: Some(moved) });
            }
        }
    }
}

impl Answerer<'_> {
    /// Returns the id of a collider; `near` is a box around the answer, in region space. `None` if the body
    /// is immovable and the region does not cover that box: then a region nearer to the answer names it.
    fn name(&self, handle: ColliderHandle, near: Aabb) -> Option<ColliderId> {
        let (region, world) = (self.region, self.region.physics());
        let handle = self.moved.map_or(handle, |moved| moved.original(handle));
        let parent = world.colliders.get(handle)?.parent()?;
        let (_, role) = region.role_of(parent)?;
        if role == Ownership::Immovable && !region.covers(&region.box_in_world(near)) {
            return None;
        }
        region.collider_name(handle).map(|(body, index)| ColliderId { body, index: index.into() })
    }

    /// Returns the AABB of all its colliders, in world space.
    fn extent(&self) -> Bounds {
        self.region.box_in_world(self.pipeline.bvh.root_aabb())
    }
}
