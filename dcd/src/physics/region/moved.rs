//! Keeps a second BVH for queries, of colliders that are not where Rapier's broad phase has them: their bodies were inserted, moved
//! or changed since the last step.
//!
//! Rapier takes such changes in when it steps. Queries must not wait for that, and must not do it either: a tree that is brought
//! up to date early orders pairs otherwise, so that a query would change the bits of what follows. So queries have a tree of
//! their own for these colliders, made at the first query.

use std::collections::HashMap;

use parry3d::bounding_volume::BoundingVolume;
use parry3d::partitioning::Bvh;
use rapier3d::prelude::*;

use super::{Ownership, Region};

/// Copies of the moved colliders at their present places, in a BVH.
#[derive(Clone, Default)]
pub(in crate::physics) struct Moved {
    pub(in crate::physics) bvh: Bvh,
    pub(in crate::physics) colliders: ColliderSet,
    /// By Rapier's index of the copy.
    originals: HashMap<u32, ColliderHandle>,
    /// Rapier's indices of the bodies, ascending.
    bodies: Vec<u32>,
}

impl Moved {
    /// Collects the colliders of bodies that were `touched` since the last step, and of shared bodies that the coupling moved.
    pub(in crate::physics) fn of(region: &Region, touched: &[RigidBodyHandle]) -> Self {
        let world = region.physics();
        let shared = region.shared.iter().map(|link| link.handle).filter(|&handle| strayed(world, handle));
        let mut handles: Vec<_> = touched.iter().copied().chain(shared).collect();
        handles.sort_unstable_by_key(|handle| handle.into_raw_parts());
        handles.dedup();
        let mut moved = Self::default();
        for handle in handles {
            let role = region.role_of(handle).map(|(_, role)| role);
            if let (Some(Ownership::Owner | Ownership::Immovable), Some(body)) =
                (role, world.bodies.get(handle))
            {
                moved.add(region, handle, body);
            }
        }
        moved
    }

    fn add(&mut self, region: &Region, handle: RigidBodyHandle, body: &RigidBody) {
        self.bodies.push(handle.into_raw_parts().0);
        // While its body is disabled, Rapier's collider does not tell whether its user enabled it.
        let wanted = &region.slot(handle).traits.colliders;
        for (&original, record) in body.colliders().iter().zip(wanted) {
            let collider = &region.physics().colliders[original];
            if !(body.is_enabled() && record.enabled) {
                continue;
            }
            let mut copy = collider.clone();
            copy.set_position(place(body, collider));
            // Wider, as in Rapier's own tree: shapes may touch by rounding where their boxes do not.
            let aabb = copy.compute_aabb().loosened(0.01);
            if aabb.mins.is_finite() && aabb.maxs.is_finite() {
                let index = self.colliders.insert(copy).into_raw_parts().0;
                self.bvh.insert(aabb, index);
                self.originals.insert(index, original);
            }
        }
    }

    /// Returns whether a body is among them, and not to be looked for in Rapier's own tree.
    pub(in crate::physics) fn holds(&self, body: RigidBodyHandle) -> bool {
        self.bodies.binary_search(&body.into_raw_parts().0).is_ok()
    }

    /// Returns Rapier's own collider, of which this one is a copy.
    pub(in crate::physics) fn original(&self, copy: ColliderHandle) -> ColliderHandle {
        self.originals[&copy.into_raw_parts().0]
    }
}

/// Returns whether a body has been put elsewhere than its colliders are.
fn strayed(world: &PhysicsWorld, handle: RigidBodyHandle) -> bool {
    let body = &world.bodies[handle];
    body.colliders().iter().any(|&collider| {
        let collider = &world.colliders[collider];
        *collider.position() != place(body, collider)
    })
}

fn place(body: &RigidBody, collider: &Collider) -> Pose {
    *body.position() * collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY)
}
