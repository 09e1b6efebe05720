//! Copies bodies into small worlds, in which they are computed again.

use rapier3d::prelude::*;

/// Copies a body with its colliders.
pub(super) fn copy_body(
    from: &PhysicsWorld,
    handle: RigidBodyHandle,
    to: &mut PhysicsWorld,
) -> RigidBodyHandle {
    let body = from.bodies[handle].clone();
    let colliders: Vec<_> = body.colliders().to_vec();
    let copy = to.bodies.insert(body);
    for collider in colliders {
        to.colliders.insert_with_parent(from.colliders[collider].clone(), copy, &mut to.bodies);
    }
    copy
}
