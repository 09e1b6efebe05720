//! Audits what a region computes: copies an island before a step and computes it again, finer, in a small
//! world of its own. The difference after the step is the error.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use crate::physics::region::{Ownership, Region};
use crate::physics::small_world::copy_body;

/// The number of substeps per tick of the finer model, each with all iterations of a tick.
const FINESSE: usize = 4;
/// The most bodies of an island that is audited whole. Of a larger island only the bodies nearest to the
/// first one are audited, and those with a neighbour left out move as they moved in the region.
const MOST: usize = 48;
/// The costs of making a small world and of stepping a body in it once, in bodies that a region steps.
const MAKING: f64 = 30.0;
const STEPPING: f64 = 2.0;
/// The distance, metres, from the island and from what it may reach in the step, within which other bodies
/// are copied too.
const AROUND_M: f32 = 0.1;

/// An island before a step, and its finer model.
pub(super) struct Audit {
    world: PhysicsWorld,
    /// The bodies of the island, each with its handles in the region and in the small world.
    members: BTreeMap<(u32, u32), (RigidBodyHandle, RigidBodyHandle)>,
    /// The bodies with a neighbour that was left out.
    rim: Vec<(RigidBodyHandle, RigidBodyHandle)>,
    ticks: u8,
}

impl Audit {
    /// Copies the island of a body, before a step of so many ticks. Returns `None` where the body is no
    /// dynamic one that the region owns, or where the island cannot be computed by itself: with a multibody,
    /// a character or a vehicle in it, with a body whose mass is split among regions, or with a neighbour of
    /// the body left out.
    pub(super) fn begin(
        region: &Region,
        seed: RigidBodyHandle,
        ticks: u8,
        parameters: &IntegrationParameters,
    ) -> Option<Self> {
        let physics = region.physics();
        let is_own = matches!(region.role_of(seed), Some((_, Ownership::Owner)));
        if !is_own || !physics.bodies[seed].is_dynamic() {
            return None;
        }
        let mut members = BTreeMap::from([(seed.into_raw_parts(), seed)]);
        let (mut open, mut at, mut rim) = (vec![seed], 0, Vec::new());
        while let Some(&handle) = open.get(at) {
            at += 1;
            let mut is_rim = false;
            region.for_each_contact(handle, |other, touches| {
                if !touches
                    || !physics.bodies[other].is_dynamic()
                    || members.contains_key(&other.into_raw_parts())
                {
                    return;
                }
                if members.len() < MOST {
                    members.insert(other.into_raw_parts(), other);
                    open.push(other);
                } else {
                    is_rim = true;
                }
            });
            if is_rim {
                rim.push(handle);
            }
        }
        if rim.contains(&seed) || members.values().any(|&handle| !region.is_auditable(handle)) {
            return None;
        }
        let mut world = PhysicsWorld::new();
        world.gravity = physics.gravity;
        world.integration_parameters =
            IntegrationParameters { dt: parameters.dt / FINESSE as f32, ..*parameters };
        let mut copied = BTreeMap::new();
        let mut bounds = Aabb::new_invalid();
        for (&key, &handle) in &members {
            let body = &physics.bodies[handle];
            let copy = copy_body(physics, handle, &mut world);
            let reach = body.linvel() * (parameters.dt * f32::from(ticks));
            for &collider in body.colliders() {
                let aabb = physics.colliders[collider].compute_aabb();
                bounds.merge(&aabb);
                bounds.merge(&Aabb::new(aabb.mins + reach, aabb.maxs + reach));
            }
            copied.insert(key, (handle, copy));
        }
        // What the island may come to stand against.
        let around: Vec<_> = physics
            .intersect_aabb_conservative(bounds.loosened(AROUND_M), QueryFilter::default())
            .filter_map(|(_, collider)| collider.parent())
            .collect();
        let mut others = BTreeMap::new();
        for handle in around {
            let key = handle.into_raw_parts();
            if !copied.contains_key(&key) && !others.contains_key(&key) {
                others.insert(key, (handle, copy_body(physics, handle, &mut world)));
            }
        }
        for (&key, &(handle, _)) in &copied {
            for (a, b, _, joint) in physics.impulse_joints.attached_joints(handle) {
                let end = |body: RigidBodyHandle| {
                    copied
                        .get(&body.into_raw_parts())
                        .or_else(|| others.get(&body.into_raw_parts()))
                        .map(|(_, copy)| *copy)
                };
                // Each joint is found from both of its bodies.
                let is_first = a.into_raw_parts() == key || !copied.contains_key(&a.into_raw_parts());
                if let (true, Some(a), Some(b)) = (is_first, end(a), end(b)) {
                    world.impulse_joints.insert(a, b, joint.data, false);
                }
            }
        }
        let rim = rim.into_iter().map(|handle| copied[&handle.into_raw_parts()]).collect();
        Some(Self { world, members: copied, rim, ticks })
    }

    /// Returns whether a body of the region is in the island.
    pub(super) fn contains(&self, handle: RigidBodyHandle) -> bool {
        self.members.contains_key(&handle.into_raw_parts())
    }

    /// Returns how many bodies of the region are in the island.
    pub(super) fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns the cost of the audit, in bodies stepped once.
    pub(super) fn work(&self) -> f64 {
        MAKING + STEPPING * (FINESSE * usize::from(self.ticks) * self.members.len()) as f64
    }

    /// Computes the finer model and returns how far it is from what the region came to: the mean difference
    /// of the bodies' velocities at the end of the step, m/s. Returns `None` if a body has gone, or if the
    /// result is not finite.
    ///
    /// The difference is not divided by the ticks of the step. That would make long steps look better than
    /// short ones: what collides errs by about its speed once, however long the step is.
    pub(super) fn finish(mut self, region: &Region) -> Option<f32> {
        let after = &region.physics().bodies;
        if self.members.values().any(|(body, _)| !after.contains(*body)) {
            return None;
        }
        for (body, copy) in &self.rim {
            let (velocity, spin) = (after[*body].linvel(), after[*body].angvel());
            let copy = &mut self.world.bodies[*copy];
            copy.set_body_type(RigidBodyType::KinematicVelocityBased, false);
            copy.set_linvel(0.5 * (copy.linvel() + velocity), false);
            copy.set_angvel(0.5 * (copy.angvel() + spin), false);
        }
        for _ in 0..FINESSE * usize::from(self.ticks) {
            self.world.step();
        }
        let rim: Vec<_> = self.rim.iter().map(|(body, _)| *body).collect();
        let inner = self.members.values().filter(|(body, _)| !rim.contains(body));
        let off = inner.map(|(body, copy)| {
            f64::from((after[*body].linvel() - self.world.bodies[*copy].linvel()).length())
        });
        let (sum, count) = off.fold((0.0, 0), |(sum, count), off| (sum + off, count + 1));
        let mean = sum / f64::from(count.max(1));
        (mean.is_finite()).then_some(mean as f32)
    }
}
