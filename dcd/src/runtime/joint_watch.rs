//! Watches the joints of a local world: reports those that bear more than their strength.

use super::config::WorldError;
use super::joint_strength::JointOverload;
use super::local::LocalWorld;
use crate::space::JointId;

impl LocalWorld {
    /// Sets the force (newtons) and torque (newton metres) above which a joint is reported, after each step
    /// in which it bears more. Infinite means never, as at first.
    pub fn set_joint_strength(
        &mut self,
        joint: JointId,
        force_n: f32,
        torque_n_m: f32,
    ) -> Result<(), WorldError> {
        for (what, value) in [("force", force_n), ("torque", torque_n_m)] {
            if value.is_nan() || value < 0.0 {
                let range = "0 or more, infinite for never";
                return Err(WorldError::Setting { what, value: value.to_string(), range });
            }
        }
        let known = self.joint(joint).ok_or(WorldError::NoJoint(joint))?;
        if known.link.is_some() {
            let range = "for joints that are solved by impulses; those of a multibody cannot come apart";
            return Err(WorldError::Setting { what: "strength", value: joint.to_string(), range });
        }
        self.strengths.set(joint, force_n, torque_n_m);
        Ok(())
    }

    /// Returns the joints that bore more than their strength in the last step, in id order.
    pub fn joint_overloads(&self) -> &[JointOverload] {
        self.strengths.overloads()
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::LinkSettings;
    use crate::runtime::{Partitioning, WorldConfig};
    use crate::space::{Axis, BodyId};

    /// Makes a ball of a tonne that hangs by a joint a metre below a fixed one, which is at x = `at`.
    fn hung(cuts: Vec<(Axis, f64)>, at: f32) -> (LocalWorld, BodyId, JointId) {
        let config =
            WorldConfig { partitioning: Partitioning::Cuts(cuts), threads: 1, ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let nail = RigidBodyBuilder::fixed().translation(Vector::new(at, 10.0, 0.0));
        let nail = world.insert(nail, ColliderBuilder::ball(0.1)).unwrap();
        let ball = RigidBodyBuilder::dynamic().translation(Vector::new(at, 9.0, 0.0));
        let ball = world.insert(ball, ColliderBuilder::ball(0.3).mass(1000.0)).unwrap();
        let joint = FixedJointBuilder::new().local_anchor2(Vector::new(0.0, 1.0, 0.0));
        let joint = world.insert_joint(nail, ball, joint).unwrap();
        (world, ball, joint)
    }

    fn steps(world: &mut LocalWorld, count: usize) -> Vec<JointOverload> {
        (0..count)
            .flat_map(|_| {
                world.step().unwrap();
                world.joint_overloads().to_vec()
            })
            .collect()
    }

    #[test]
    fn a_joint_that_bears_more_than_it_can_is_told_of_wherever_the_world_is_cut() {
        for (cuts, at) in [(vec![], 0.0), (vec![(Axis::X, 0.0)], 0.0), (vec![(Axis::Y, 9.5)], 0.1)] {
            let (mut world, _, joint) = hung(cuts, at);
            world.set_joint_strength(joint, 11_000.0, 500.0).unwrap();
            assert_eq!(steps(&mut world, 60), [], "9.81 kN");
            world.set_joint_strength(joint, 9_000.0, 500.0).unwrap();
            let told = steps(&mut world, 3);
            assert_eq!(told.len(), 3);
            assert!((told[2].force_n - 9810.0).abs() < 100.0, "{told:?}");
            world.remove_joint(joint).unwrap();
            assert_eq!(steps(&mut world, 1), []);
            assert!(matches!(world.set_joint_strength(joint, 1.0, 1.0), Err(WorldError::NoJoint(_))));
        }
    }

    #[test]
    fn strengths_are_saved_with_the_world() {
        let (mut world, _, joint) = hung(vec![], 0.0);
        world.set_joint_strength(joint, 9_000.0, f32::INFINITY).unwrap();
        steps(&mut world, 30);
        let mut saved = Vec::new();
        world.save(&mut saved).unwrap();
        let mut again = LocalWorld::restore(&saved[..], 1).unwrap();
        assert_eq!(again.joint_overloads(), world.joint_overloads());
        let (there, here) = (steps(&mut again, 3), steps(&mut world, 3));
        assert!(there == here && here.len() == 3, "{here:?}");
        assert!(world.set_joint_strength(joint, -1.0, 0.0).is_err());
        assert!(world.set_joint_strength(joint, f32::NAN, 0.0).is_err());
    }

    #[test]
    fn additional_solver_iterations_do_not_change_what_a_joint_is_told_to_bear() {
        for (cuts, at) in [(vec![], 0.0), (vec![(Axis::Y, 9.5)], 0.1)] {
            for on_the_second in [false, true] {
                let (mut world, ball, joint) = hung(cuts.clone(), at);
                let more = |body: &mut RigidBody| body.set_additional_solver_iterations(16);
                if on_the_second {
                    let below = RigidBodyBuilder::dynamic().translation(Vector::new(at, 8.0, 0.0));
                    let below = world.insert(below, ColliderBuilder::ball(0.1).mass(1.0)).unwrap();
                    let tie = FixedJointBuilder::new().local_anchor2(Vector::Y);
                    world.insert_joint(ball, below, tie).unwrap();
                    world.update(below, more).unwrap();
                } else {
                    world.update(ball, more).unwrap();
                }
                // Another joint beside it is solved with as many iterations as before.
                let beside = RigidBodyBuilder::dynamic().translation(Vector::new(at + 5.0, 9.0, 0.0));
                let beside = world.insert(beside, ColliderBuilder::ball(0.3).mass(1000.0)).unwrap();
                let nail = RigidBodyBuilder::fixed().translation(Vector::new(at + 5.0, 10.0, 0.0));
                let nail = world.insert(nail, ColliderBuilder::ball(0.1)).unwrap();
                let tie = FixedJointBuilder::new().local_anchor2(Vector::Y);
                let other = world.insert_joint(nail, beside, tie).unwrap();
                for joint in [joint, other] {
                    world.set_joint_strength(joint, 11_000.0, f32::INFINITY).unwrap();
                }
                assert_eq!(steps(&mut world, 60), []);
                for joint in [joint, other] {
                    let load = world.joint_load(joint).unwrap();
                    let force_n = load[..3].iter().map(|v| v * v).sum::<f32>().sqrt();
                    assert!((force_n - 9810.0).abs() < 490.0, "{force_n} N; the second one: {on_the_second}");
                }
                world.set_joint_strength(joint, 9_000.0, f32::INFINITY).unwrap();
                assert_eq!(steps(&mut world, 3).len(), 3);
                // When its bodies sleep, the joint keeps the impulse of the step in which they fell asleep.
                steps(&mut world, 240);
                assert!(world.body(ball).unwrap().is_sleeping());
                assert_eq!(steps(&mut world, 3).len(), 3);
            }
        }
    }

    #[test]
    fn a_multibody_beside_a_joint_does_not_change_what_that_is_told_to_bear() {
        let (mut world, _, joint) = hung(vec![], 0.0);
        let post = RigidBodyBuilder::fixed().translation(Vector::new(5.0, 10.0, 0.0));
        let post = world.insert(post, ColliderBuilder::ball(0.1)).unwrap();
        let arm = RigidBodyBuilder::dynamic().translation(Vector::new(5.0, 9.0, 0.0));
        let arm = arm.additional_solver_iterations(16).can_sleep(false);
        let arm = world.insert(arm, ColliderBuilder::ball(0.1)).unwrap();
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor2(Vector::Y);
        world.insert_multibody_joint(post, arm, hinge, LinkSettings::default()).unwrap();
        steps(&mut world, 30);
        let load = world.joint_load(joint).unwrap();
        let force_n = load[..3].iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((force_n - 9810.0).abs() < 490.0, "{force_n} N");
    }
}
