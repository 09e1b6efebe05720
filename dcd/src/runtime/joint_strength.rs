//! Compares the loads of joints with the strengths that their user gave them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::physics::RegionHost;
use crate::space::JointId;

/// A joint that bore more than its strength in the last step
/// ([`World::set_joint_strength`](crate::World::set_joint_strength)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct JointOverload {
    /// The joint.
    pub joint: JointId,
    /// The force on the joint's locked axes, newtons.
    pub force_n: f32,
    /// The torque on the joint's locked axes, newton metres.
    pub torque_n_m: f32,
}

/// The strengths of joints, and the joints that bore more than that in the last step.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Strengths {
    /// The strengths in newtons and newton metres.
    by_joint: BTreeMap<JointId, [f32; 2]>,
    overloads: Vec<JointOverload>,
    /// Joints of bodies that were awake at the last look, and joints whose strength was set since. Some may
    /// be there more than once.
    #[serde(skip)]
    due: Vec<JointId>,
    /// The number of joints with a strength at the last look at all of them.
    #[serde(skip)]
    swept: usize,
}

impl Strengths {
    /// Sets the strength of a joint; two infinite values remove it.
    pub(super) fn set(&mut self, joint: JointId, force_n: f32, torque_n_m: f32) {
        if force_n.is_infinite() && torque_n_m.is_infinite() {
            self.by_joint.remove(&joint);
        } else {
            self.by_joint.insert(joint, [force_n, torque_n_m]);
            self.due.push(joint);
        }
    }

    pub(super) fn overloads(&self) -> &[JointOverload] {
        &self.overloads
    }

    /// Compares what joints bore in the last step with their strengths, in id order. A joint of bodies that
    /// sleep bears what it bore when they fell asleep.
    pub(super) fn look(&mut self, host: &RegionHost) {
        let before = std::mem::take(&mut self.overloads);
        if self.by_joint.is_empty() {
            return;
        }
        let mut due = std::mem::replace(&mut self.due, host.awake_joints().collect());
        due.extend_from_slice(&self.due);
        due.extend(before.iter().map(|overload| overload.joint));
        // Looking at all of them forgets those that are gone.
        if due.len() >= self.by_joint.len() || self.by_joint.len() > 2 * self.swept {
            self.look_at_all(host);
            return;
        }
        due.sort_unstable();
        due.dedup();
        for joint in due {
            let Some(&strength) = self.by_joint.get(&joint) else { continue };
            match overload(host, joint, strength) {
                Some(overload) => self.overloads.extend(overload),
                None => _ = self.by_joint.remove(&joint),
            }
        }
    }

    fn look_at_all(&mut self, host: &RegionHost) {
        let overloads = &mut self.overloads;
        self.by_joint.retain(|&joint, &mut strength| {
            let found = overload(host, joint, strength);
            overloads.extend(found.flatten());
            found.is_some()
        });
        self.swept = self.by_joint.len();
    }
}

/// Returns the load of a joint if it is above its strength (`Some(None)` if not), or `None` if the joint was
/// removed, by itself or with one of its bodies.
fn overload(host: &RegionHost, joint: JointId, strength: [f32; 2]) -> Option<Option<JointOverload>> {
    #[cfg(test)]
    tests::LOOKS.set(tests::LOOKS.get() + 1);
    let load = host.joint_load(joint)?;
    let length = |axes: &[f32]| axes.iter().map(|v| v * v).sum::<f32>().sqrt();
    let (force_n, torque_n_m) = (length(&load[..3]), length(&load[3..]));
    let is_over = force_n > strength[0] || torque_n_m > strength[1];
    Some(is_over.then_some(JointOverload { joint, force_n, torque_n_m }))
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use rapier3d::prelude::*;

    use super::*;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    thread_local! {
        pub(super) static LOOKS: Cell<usize> = const { Cell::new(0) };
    }

    /// Makes a hundred balls that hang by joints, in eight regions. The first is too heavy for its joint.
    fn hung() -> (LocalWorld, Vec<JointId>) {
        let cuts = [-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0].map(|at| (Axis::X, at));
        let config =
            WorldConfig { partitioning: Partitioning::Cuts(cuts.to_vec()), ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let joints = (0..100).map(|i| {
            let x = 0.8 * i as f32 - 39.7;
            let nail = RigidBodyBuilder::fixed().translation(Vector::new(x, 10.0, 0.0));
            let nail = world.insert(nail, ColliderBuilder::ball(0.05)).unwrap();
            let ball = RigidBodyBuilder::dynamic().translation(Vector::new(x, 9.0, 0.0));
            let mass = if i == 0 { 1_000.0 } else { 100.0 };
            let ball = world.insert(ball, ColliderBuilder::ball(0.05).mass(mass)).unwrap();
            let tie = FixedJointBuilder::new().local_anchor2(Vector::Y);
            let joint = world.insert_joint(nail, ball, tie).unwrap();
            world.set_joint_strength(joint, 5_000.0, f32::INFINITY).unwrap();
            joint
        });
        let joints = joints.collect();
        for _ in 0..300 {
            world.step().unwrap();
        }
        (world, joints)
    }

    fn step(world: &mut LocalWorld) -> (usize, Vec<JointId>) {
        let before = LOOKS.get();
        world.step().unwrap();
        (LOOKS.get() - before, world.joint_overloads().iter().map(|overload| overload.joint).collect())
    }

    #[test]
    fn of_joints_that_sleep_those_alone_are_looked_at_that_bear_too_much() {
        let (mut world, joints) = hung();
        assert_eq!(step(&mut world), (1, vec![joints[0]]));
        // For another joint the strength is set, and for a third one its body is woken.
        world.set_joint_strength(joints[7], 1.0, f32::INFINITY).unwrap();
        assert_eq!(step(&mut world), (2, vec![joints[0], joints[7]]));
        let ball = world.joint(joints[20]).unwrap().b;
        world.update(ball, |body| body.set_linvel(Vector::new(0.0, 0.0, 1e-3), true)).unwrap();
        assert!(step(&mut world).0 >= 3);
        let mut saved = Vec::new();
        world.save(&mut saved).unwrap();
        let mut again = LocalWorld::restore(&saved[..], 1).unwrap();
        for _ in 0..300 {
            assert_eq!(step(&mut again).1, step(&mut world).1);
        }
        assert_eq!(step(&mut world), (2, vec![joints[0], joints[7]]));
        world.remove_joint(joints[0]).unwrap();
        assert_eq!(step(&mut world).1, [joints[7]]);
    }
}
