//! Computes what joints hold again, from an earlier tick to the present one, in a small world of its own.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;

use crate::physics::articulation::{equip_link, insert_link, record_of};
use crate::physics::region::Region;
use crate::physics::small_world::copy_body;
use crate::physics::{convert, joints};
use crate::protocol::{JointRecord, Velocity, WorldPose};

/// The distance, metres, around each body within which what it may touch is copied too.
const AROUND_M: f32 = 0.1;
/// The most substeps of a tick that are computed again.
const MOST_SUBSTEPS: f32 = 16.0;

/// A body of a region, and how it was some ticks ago.
pub(super) type Earlier = (RigidBodyHandle, WorldPose, Velocity);

/// Returns how bodies of a region that were so `ticks` ago move by now, in the same order. What they may touch on the way,
/// or what joints tie to them, comes to where it is now as it moves now, and yields to nothing.
pub(super) fn replay(
    region: &Region,
    start: &[Earlier],
    ticks: u64,
    dt_s: f32,
) -> Vec<(WorldPose, Velocity)> {
    if start.is_empty() {
        return Vec::new();
    }
    let (mut ends, mut tying) = (BTreeSet::new(), BTreeMap::new());
    let set = &region.physics().impulse_joints;
    for (a, b, joint, data) in start.iter().flat_map(|&(handle, ..)| set.attached_joints(handle)) {
        ends.extend([a.into_raw_parts(), b.into_raw_parts()]);
        // Each joint is found from both of its bodies.
        tying.insert(joint.into_raw_parts(), (a, b, data.data));
    }
    let mut past = Past::of(region, start, ends, ticks, dt_s);
    for (a, b, data) in tying.into_values() {
        if let (Some(a), Some(b)) = (past.copy_of(a), past.copy_of(b)) {
            past.world.impulse_joints.insert(a, b, data, true);
        }
    }
    past.run();
    past.states(region, start)
}

/// Returns the same for multibodies, tied by these joints, with all that is tied to them. The joints are told what their
/// links have come to. `None` if the region lacks one of the bodies, or Rapier could not have one as a link.
pub(super) fn replay_multibodies(
    region: &Region,
    start: &[Earlier],
    joints: &mut [JointRecord],
    ticks: u64,
    dt_s: f32,
) -> Option<Vec<(WorldPose, Velocity)>> {
    let members: BTreeSet<_> = start.iter().map(|(handle, ..)| handle.into_raw_parts()).collect();
    let is_dynamic = |end: RigidBodyHandle| {
        members.contains(&end.into_raw_parts()) && region.physics().bodies[end].is_dynamic()
    };
    let ends = |record: &JointRecord| {
        let (a, b) = (region.handle_of(record.a)?, region.handle_of(record.b)?);
        // Rapier ends the program at a link that is not dynamic.
        (record.link.is_none() || is_dynamic(b)).then_some((a, b))
    };
    let tied: Vec<_> = joints.iter().map(ends).collect::<Option<_>>()?;
    let around = tied.iter().flat_map(|(a, b)| [a.into_raw_parts(), b.into_raw_parts()]).collect();
    let mut past = Past::of(region, start, around, ticks, dt_s);
    let mut links = Vec::new();
    for (record, &(a, b)) in joints.iter().zip(&tied) {
        let (a, b, joint) = (past.copy_of(a)?, past.copy_of(b)?, joints::joint_of(record));
        links.push(match &record.link {
            Some(link) => Some(insert_link(&mut past.world.multibody_joints, a, b, joint, link)?),
            None => {
                past.world.impulse_joints.insert(a, b, joint, true);
                None
            }
        });
    }
    let all = &mut past.world.multibody_joints;
    for (record, link) in joints.iter().zip(&links) {
        if let (Some(link), Some(handle)) = (&record.link, link) {
            equip_link(all, *handle, link);
        }
    }
    past.run();
    let all = &past.world.multibody_joints;
    for (record, link) in joints.iter_mut().zip(links) {
        if let (Some(link), Some((multibody, index))) = (&mut record.link, link.and_then(|it| all.get(it))) {
            *link = record_of(multibody, index, link);
        }
    }
    Some(past.states(region, start))
}

/// Returns how many steps such a time takes.
pub(super) fn steps(region: &Region, ticks: u64, dt_s: f32) -> u64 {
    let substeps = (dt_s / region.physics().integration_parameters.dt).round().clamp(1.0, MOST_SUBSTEPS);
    ticks * substeps as u64
}

/// A small world that begins some ticks ago.
struct Past {
    world: PhysicsWorld,
    steps: u64,
    copies: BTreeMap<(u32, u32), RigidBodyHandle>,
}

impl Past {
    /// Copies bodies, to where they were, with what they may touch and these others.
    fn of(
        region: &Region,
        start: &[Earlier],
        mut around: BTreeSet<(u32, u32)>,
        ticks: u64,
        dt_s: f32,
    ) -> Self {
        let (physics, anchor) = (region.physics(), region.anchor());
        let mut world = PhysicsWorld::new();
        world.gravity = physics.gravity;
        world.integration_parameters = physics.integration_parameters;
        let mut copies = BTreeMap::new();
        for (handle, pose, velocity) in start {
            let copy = copy_body(physics, *handle, &mut world);
            let body = &mut world.bodies[copy];
            if body.is_kinematic() {
                body.set_body_type(RigidBodyType::KinematicVelocityBased, false);
            }
            body.set_position(convert::region_from_world(anchor, pose), true);
            body.set_linvel(convert::vector(velocity.linear), true);
            body.set_angvel(convert::vector(velocity.angular), true);
            copies.insert(handle.into_raw_parts(), copy);
            let reach = Vector::splat(region.slot(*handle).reach_m);
            let mut bounds = Aabb::from_half_extents(body.translation(), reach);
            bounds.merge(&Aabb::from_half_extents(physics.bodies[*handle].translation(), reach));
            let near = physics.intersect_aabb_conservative(bounds.loosened(AROUND_M), QueryFilter::default());
            around.extend(
                near.filter_map(|(_, collider)| collider.parent()).map(RigidBodyHandle::into_raw_parts),
            );
        }
        let steps = steps(region, ticks, dt_s);
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
        Self { world, steps, copies }
    }

    fn copy_of(&self, handle: RigidBodyHandle) -> Option<RigidBodyHandle> {
        self.copies.get(&handle.into_raw_parts()).copied()
    }

    fn run(&mut self) {
        (0..self.steps).for_each(|_| self.world.step());
    }

    /// Returns how the bodies that it began with move by now.
    fn states(&self, region: &Region, start: &[Earlier]) -> Vec<(WorldPose, Velocity)> {
        let ends = start.iter().map(|(handle, ..)| &self.world.bodies[self.copies[&handle.into_raw_parts()]]);
        let state = |body: &RigidBody| {
            (convert::world_from_region(region.anchor(), body.position()), convert::velocity_of(body))
        };
        ends.map(state).collect()
    }
}
