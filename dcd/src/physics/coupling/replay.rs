//! Computes what joints hold again, from an earlier tick to the present one, in a small world of its own.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;

use crate::physics::convert;
use crate::physics::region::Region;
use crate::physics::small_world::copy_body;
use crate::protocol::{Velocity, WorldPose};

/// The distance, metres, around each body within which what it may touch is copied too.
const AROUND_M: f32 = 0.1;
/// The most substeps of a tick that are computed again.
const MOST_SUBSTEPS: f32 = 16.0;

/// Returns how bodies of a region that were so `ticks` ago move by now, in the same order. What they may touch on the way,
/// or what joints tie to them, comes to where it is now as it moves now, and yields to nothing.
pub(super) fn replay(
    region: &Region,
    start: &[(RigidBodyHandle, WorldPose, Velocity)],
    ticks: u64,
    dt_s: f32,
) -> Vec<(WorldPose, Velocity)> {
    if start.is_empty() {
        return Vec::new();
    }
    let (physics, anchor) = (region.physics(), region.anchor());
    let mut world = PhysicsWorld::new();
    world.gravity = physics.gravity;
    world.integration_parameters = physics.integration_parameters;
    let (mut copies, mut around) = (BTreeMap::new(), BTreeSet::new());
    for (handle, pose, velocity) in start {
        let copy = copy_body(physics, *handle, &mut world);
        let body = &mut world.bodies[copy];
        body.set_position(convert::region_from_world(anchor, pose), true);
        body.set_linvel(convert::vector(velocity.linear), true);
        body.set_angvel(convert::vector(velocity.angular), true);
        copies.insert(handle.into_raw_parts(), copy);
        let reach = Vector::splat(region.slot(*handle).reach_m);
        let mut bounds = Aabb::from_half_extents(body.translation(), reach);
        bounds.merge(&Aabb::from_half_extents(physics.bodies[*handle].translation(), reach));
        let near = physics.intersect_aabb_conservative(bounds.loosened(AROUND_M), QueryFilter::default());
        around
            .extend(near.filter_map(|(_, collider)| collider.parent()).map(RigidBodyHandle::into_raw_parts));
    }
    let members: Vec<_> = start.iter().map(|(handle, ..)| *handle).collect();
    let mut joints = BTreeMap::new();
    for (a, b, joint, data) in
        members.iter().flat_map(|&handle| physics.impulse_joints.attached_joints(handle))
    {
        around.extend([a.into_raw_parts(), b.into_raw_parts()]);
        // Each joint is found from both of its bodies.
        joints.insert(joint.into_raw_parts(), (a, b, data.data));
    }
    let substeps = (dt_s / physics.integration_parameters.dt).round().clamp(1.0, MOST_SUBSTEPS);
    let steps = ticks * substeps as u64;
    let earlier_s = -(steps as f64) * f64::from(physics.integration_parameters.dt);
    for (index, generation) in around {
        let handle = RigidBodyHandle::from_raw_parts(index, generation);
        // A joint stays for a while when one of its bodies has gone.
        if copies.contains_key(&(index, generation)) || !physics.bodies.contains(handle) {
            continue;
        }
        let copy = copy_body(physics, handle, &mut world);
        let body = &mut world.bodies[copy];
        if !body.is_fixed() {
            let now = convert::world_from_region(anchor, body.position());
            let then = now.moved(&convert::velocity_of(body), earlier_s);
            body.set_body_type(RigidBodyType::KinematicVelocityBased, false);
            body.set_position(convert::region_from_world(anchor, &then), false);
        }
        copies.insert((index, generation), copy);
    }
    for (a, b, data) in joints.into_values() {
        let copy_of = |end: RigidBodyHandle| copies.get(&end.into_raw_parts()).copied();
        if let (Some(a), Some(b)) = (copy_of(a), copy_of(b)) {
            world.impulse_joints.insert(a, b, data, true);
        }
    }
    for _ in 0..steps {
        world.step();
    }
    let ends = members.iter().map(|handle| &world.bodies[copies[&handle.into_raw_parts()]]);
    let state =
        |body: &RigidBody| (convert::world_from_region(anchor, body.position()), convert::velocity_of(body));
    ends.map(state).collect()
}
