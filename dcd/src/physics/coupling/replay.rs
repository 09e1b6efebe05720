//! Computes what joints hold again, from an earlier tick to the present one, in a small world of its own.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use crate::physics::convert;
use crate::physics::region::Region;
use crate::physics::small_world::copy_body;
use crate::protocol::{Velocity, WorldPose};

/// The distance, metres, around the bodies within which what they may touch is copied too.
const AROUND_M: f32 = 0.1;

/// Returns how bodies of a region that were so `ticks` ago move by now, in the same order. What they may touch on the way
/// is where it is now, and yields to nothing.
pub(super) fn replay(
    region: &Region,
    start: &[(RigidBodyHandle, WorldPose, Velocity)],
    ticks: u64,
    dt_s: f32,
) -> Vec<(WorldPose, Velocity)> {
    if start.is_empty() {
        return Vec::new();
    }
    let physics = region.physics();
    let mut world = PhysicsWorld::new();
    world.gravity = physics.gravity;
    world.integration_parameters = IntegrationParameters { dt: dt_s, ..physics.integration_parameters };
    let mut copies = BTreeMap::new();
    let mut bounds = Aabb::new_invalid();
    for (handle, pose, velocity) in start {
        let copy = copy_body(physics, *handle, &mut world);
        for &collider in physics.bodies[*handle].colliders() {
            bounds.merge(&physics.colliders[collider].compute_aabb());
        }
        let body = &mut world.bodies[copy];
        body.set_position(convert::region_from_world(region.anchor(), pose), true);
        body.set_linvel(convert::vector(velocity.linear), true);
        body.set_angvel(convert::vector(velocity.angular), true);
        bounds
            .merge(&Aabb::from_half_extents(body.translation(), Vector::splat(region.slot(*handle).reach_m)));
        copies.insert(handle.into_raw_parts(), copy);
    }
    let members: Vec<_> = start.iter().map(|(handle, ..)| *handle).collect();
    let near = physics.intersect_aabb_conservative(bounds.loosened(AROUND_M), QueryFilter::default());
    let mut around: Vec<_> = near.filter_map(|(_, collider)| collider.parent()).collect();
    let joints = |handle: &RigidBodyHandle| physics.impulse_joints.attached_joints(*handle);
    around.extend(members.iter().flat_map(joints).flat_map(|(a, b, ..)| [a, b]));
    for handle in around {
        copies.entry(handle.into_raw_parts()).or_insert_with(|| {
            let copy = copy_body(physics, handle, &mut world);
            if physics.bodies[handle].is_dynamic() {
                world.bodies[copy].set_body_type(RigidBodyType::Fixed, false);
            }
            copy
        });
    }
    let mut tied = BTreeMap::new();
    for (a, b, joint, data) in members.iter().flat_map(joints) {
        // Each joint is found from both of its bodies.
        tied.insert(joint.into_raw_parts(), (a, b, data.data));
    }
    for (a, b, data) in tied.into_values() {
        let [a, b] = [a, b].map(|end| copies[&end.into_raw_parts()]);
        world.impulse_joints.insert(a, b, data, true);
    }
    for _ in 0..ticks {
        world.step();
    }
    let ends = members.iter().map(|handle| &world.bodies[copies[&handle.into_raw_parts()]]);
    let state = |body: &RigidBody| {
        (convert::world_from_region(region.anchor(), body.position()), convert::velocity_of(body))
    };
    ends.map(state).collect()
}
