//! Keeps a second BVH for queries, of the colliders that are not where Rapier's broad phase has them because
//! their bodies were inserted, moved or changed since the last step.
//!
//! Rapier takes in such changes when it steps. Queries must not wait for that, nor cause it: a tree that is
//! brought up to date early orders pairs otherwise, so that a query would change the bits of what follows. So
//! queries have a tree of their own for these colliders, made at the first query.

use std::collections::HashMap;

use parry3d::bounding_volume::BoundingVolume;
use parry3d::partitioning::Bvh;
use rapier3d::prelude::*;

use super::{Ownership, Region};
use crate::space::Bounds;

/// Copies of the moved colliders at their present places, in a BVH.
#[derive(Clone, Default)]
pub(in crate::physics) struct Moved {
    pub(in crate::physics) bvh: Bvh,
    pub(in crate::physics) colliders: ColliderSet,
    /// The original of each copy, by Rapier's index of the copy.
    originals: HashMap<u32, ColliderHandle>,
    copies: HashMap<ColliderHandle, ColliderHandle>,
    /// Rapier's indices of the bodies, ascending.
    bodies: Vec<u32>,
    /// A box around all colliders of the region, moved or not, in world space; none if there are none. Each
    /// ray asks all regions for it.
    pub(in crate::physics) extent: Option<Bounds>,
}

impl Moved {
    /// Collects the colliders of bodies that were `touched` since the last step, and of shared bodies that
    /// the coupling moved.
    pub(in crate::physics) fn of(region: &Region, touched: &[RigidBodyHandle]) -> Self {
        let world = region.physics();
        let shared = region.shared.iter().map(|link| link.handle).filter(|&handle| strayed(world, handle));
        let mut handles: Vec<_> = touched.iter().copied().chain(shared).collect();
        handles.sort_unstable_by_key(|handle| handle.into_raw_parts());
        handles.dedup();
        let mut moved = Self::default();
        handles.into_iter().for_each(|handle| moved.add(region, handle));
        moved.measure(region);
        moved
    }

    /// Adds the colliders of a body, or updates those that are here already.
    pub(super) fn add(&mut self, region: &Region, handle: RigidBodyHandle) {
        let role = region.role_of(handle).map(|(_, role)| role);
        let (Some(Ownership::Owner | Ownership::Immovable), Some(body)) =
            (role, region.physics().bodies.get(handle))
        else {
            return;
        };
        let index = handle.into_raw_parts().0;
        if let Err(at) = self.bodies.binary_search(&index) {
            self.bodies.insert(at, index);
        }
        // While its body is disabled, Rapier's collider does not tell whether its user enabled it.
        let wanted = &region.slot(handle).traits.colliders;
        for (&original, record) in body.colliders().iter().zip(wanted) {
            let collider = &region.physics().colliders[original];
            let place = place(body, collider);
            // Loosened, as in Rapier's own tree: shapes may touch by rounding where their boxes do not.
            let aabb = collider.shape().compute_aabb(&place).loosened(0.01);
            if body.is_enabled() && record.enabled && aabb.mins.is_finite() && aabb.maxs.is_finite() {
                let copy = self.copy(original, collider);
                self.colliders[copy].set_position(place);
                self.bvh.insert(aabb, copy.into_raw_parts().0);
            } else if let Some(copy) = self.copies.get(&original) {
                self.bvh.remove(copy.into_raw_parts().0);
            }
        }
    }

    /// Computes the extent of the region, once all colliders are added.
    pub(super) fn measure(&mut self, region: &Region) {
        let trees = [region.physics().query_pipeline().bvh, &self.bvh];
        let boxes = trees.into_iter().filter(|bvh| !bvh.is_empty());
        self.extent =
            boxes.map(|bvh| region.box_in_world(bvh.root_aabb())).reduce(|all, one| all.union(&one));
    }

    fn copy(&mut self, original: ColliderHandle, collider: &Collider) -> ColliderHandle {
        *self.copies.entry(original).or_insert_with(|| {
            let copy = self.colliders.insert(collider.clone());
            self.originals.insert(copy.into_raw_parts().0, original);
            copy
        })
    }

    /// Returns whether a body's colliders are in this tree, and not to be looked for in Rapier's own.
    pub(in crate::physics) fn holds(&self, body: RigidBodyHandle) -> bool {
        self.bodies.binary_search(&body.into_raw_parts().0).is_ok()
    }

    /// Returns Rapier's own collider of which this one is a copy.
    pub(in crate::physics) fn original(&self, copy: ColliderHandle) -> ColliderHandle {
        self.originals[&copy.into_raw_parts().0]
    }
}

/// Returns whether a body has been moved since its colliders were placed.
fn strayed(world: &PhysicsWorld, handle: RigidBodyHandle) -> bool {
    let body = &world.bodies[handle];
    body.colliders().iter().any(|&collider| {
        let collider = &world.colliders[collider];
        *collider.position() != place(body, collider)
    })
}

pub(super) fn place(body: &RigidBody, collider: &Collider) -> Pose {
    *body.position() * collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY)
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::physics::{BodyFilter, Partition, RegionHost, StepSettings, WorldRay};
    use crate::protocol::{Push, Velocity, WorldPose};
    use crate::space::{BodyId, Bounds, DistributionTree};

    #[test]
    fn who_is_pushed_and_looks_around_again_and_again_is_looked_for_where_the_last_step_left_it() {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [100.0; 3]), 1).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let mut host = RegionHost::new(partition, StepSettings::default(), 1, &leaves).unwrap();
        let agents: Vec<_> = (0..100).map(BodyId::persistent).collect();
        let bodies = agents.iter().zip(0_u8..).map(|(&id, place)| {
            let at = WorldPose::at([2.0 * f64::from(place), 0.0, 0.0]);
            let body = RigidBodyBuilder::dynamic().build();
            host.shapes_mut().describe(id, at, &body, &[ColliderBuilder::ball(0.5)]).unwrap()
        });
        let bodies = bodies.collect();
        host.insert(bodies, &[]).unwrap();
        host.step().unwrap();
        let copies = |host: &RegionHost| host.regions().next().unwrap().moved().colliders.len();
        let found = |host: &RegionHost, x: f64| {
            let down = WorldRay::new([x, 10.0, 0.0], [0.0, -1.0, 0.0]);
            host.queries().cast_ray(&down, &BodyFilter::default()).unwrap().map(|hit| hit.body)
        };
        for (&agent, place) in agents.iter().zip(0_u8..) {
            let x = 2.0 * f64::from(place);
            assert_eq!(found(&host, x), Some(agent));
            host.push(&Push::impulse(agent, [0.0, 0.0, 1.0]));
            host.steer(agent, &Velocity::linear([0.0, 0.0, 1.0]));
            host.update(agent, |body| body.set_gravity_scale(0.5, true)).unwrap();
            assert_eq!(copies(&host), 0);
        }
        // A body that is put elsewhere, twice; one that is no longer there; and one that comes.
        for x in [-9.0, -7.0] {
            host.teleport(agents[3], WorldPose::at([x, 0.0, 0.0])).unwrap();
            host.push(&Push::impulse(agents[3], [0.0, 0.0, 1.0]));
            assert_eq!((found(&host, 6.0), found(&host, x)), (None, Some(agents[3])));
        }
        host.update(agents[4], |body| body.set_enabled(false)).unwrap();
        let new = BodyId::persistent(100);
        let (body, ball) = (RigidBodyBuilder::dynamic().build(), ColliderBuilder::ball(0.5));
        let record = host.shapes_mut().describe(new, WorldPose::at([-20.0, 0.0, 0.0]), &body, &[ball]);
        host.insert(vec![record.unwrap()], &[]).unwrap();
        assert_eq!((found(&host, -9.0), found(&host, 8.0), found(&host, -20.0)), (None, None, Some(new)));
        assert_eq!(copies(&host), 2);
        host.update(new, |body| body.set_enabled(false)).unwrap();
        host.remove(agents[3]);
        assert_eq!(
            (found(&host, -20.0), found(&host, -7.0), found(&host, 10.0)),
            (None, None, Some(agents[5]))
        );
    }

    #[test]
    fn a_ray_goes_to_a_region_for_what_came_to_lie_outside_of_all_else_there() {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [100.0; 3]), 4).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let mut host = RegionHost::new(partition, StepSettings::default(), 1, &leaves).unwrap();
        let insert = |host: &mut RegionHost, index: u32, at: [f64; 3]| {
            let (id, body) = (BodyId::persistent(index), RigidBodyBuilder::dynamic().build());
            let ball = ColliderBuilder::ball(0.5);
            let record = host.shapes_mut().describe(id, WorldPose::at(at), &body, &[ball]).unwrap();
            host.insert(vec![record], &[]).unwrap();
            id
        };
        let found = |host: &RegionHost, y: f64| {
            let along = WorldRay::new([-200.0, y, 30.0], [1.0, 0.0, 0.0]);
            host.queries().cast_ray(&along, &BodyFilter::default()).unwrap().map(|hit| hit.body)
        };
        let first = insert(&mut host, 0, [30.0, 0.0, 30.0]);
        host.step().unwrap();
        assert_eq!((found(&host, 0.0), found(&host, 50.0)), (Some(first), None));
        let second = insert(&mut host, 1, [30.0, 50.0, 30.0]);
        assert_eq!(found(&host, 50.0), Some(second), "one that came");
        host.teleport(first, WorldPose::at([30.0, -50.0, 30.0])).unwrap();
        assert_eq!((found(&host, 0.0), found(&host, -50.0)), (None, Some(first)), "one that was put there");
        host.remove(second);
        assert_eq!(found(&host, 50.0), None);
    }
}
