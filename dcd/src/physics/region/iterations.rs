//! Records the length of the solver iterations by which Rapier last solved each body, since the impulses that
//! it keeps for joints are those of one iteration. Iterations are shorter where bodies have additional ones.

use rapier3d::prelude::*;

use super::Region;
use crate::space::PlaceGroups;

/// Returns the length of each iteration of a step that has `additional` iterations more, in seconds.
pub(super) fn iteration_s(parameters: &IntegrationParameters, additional: usize) -> f32 {
    parameters.dt / (parameters.num_solver_iterations + additional) as f32
}

impl Region {
    /// Returns the length of the solver iterations of the last step in which a body was awake, in seconds.
    pub(super) fn iteration_s(&self, handle: RigidBodyHandle) -> f32 {
        let noted = self.iterations_s.get(handle.into_raw_parts().0 as usize);
        noted.copied().unwrap_or_else(|| iteration_s(&self.world.integration_parameters, 0))
    }

    /// Notes the length of the iterations of the step that was just made, for the bodies that are awake after
    /// it: these are all that it solved. `before_s` is the length in the step before.
    pub(super) fn note_iterations(&mut self, before_s: f32) {
        if self.joints.is_empty() {
            return;
        }
        let parameters = self.world.integration_parameters;
        let additional = self.additional_iterations();
        let is_usual = additional.is_none() && iteration_s(&parameters, 0) == before_s;
        if self.iterations_s.is_empty() && is_usual {
            return;
        }
        self.iterations_s.resize(self.slots.len(), before_s);
        for (place, handle) in self.world.islands.active_bodies().enumerate() {
            let additional = additional.as_ref().map_or(0, |by_place| by_place[place]);
            self.iterations_s[handle.into_raw_parts().0 as usize] = iteration_s(&parameters, additional);
        }
    }

    /// Returns how many additional iterations each awake body had in the step that was just made, in Rapier's
    /// order; `None` if none had any. Rapier gives all bodies that touch or are tied the most that any of
    /// them asks for. In a region with a multibody it gives that to all bodies.
    fn additional_iterations(&self) -> Option<Vec<usize>> {
        let world = self.physics();
        let asked = |handle: RigidBodyHandle| world.bodies[handle].additional_solver_iterations();
        let most = world.islands.active_bodies().map(asked).max().filter(|&most| most > 0)?;
        let awake: Vec<_> = world.islands.active_bodies().collect();
        if world.multibody_joints.iter().next().is_some() {
            return Some(vec![most; awake.len()]);
        }
        let mut groups = self.solved_together(&awake);
        let mut had = vec![0; awake.len()];
        for (place, &handle) in awake.iter().enumerate() {
            let root = groups.root(place);
            had[root] = had[root].max(asked(handle));
        }
        for place in 0..awake.len() {
            had[place] = had[groups.root(place)];
        }
        Some(had)
    }

    /// Groups those of these bodies that Rapier solves together, by their places: dynamic ones that touch or
    /// that impulse joints tie. Sleeping bodies are not looked at.
    fn solved_together(&self, awake: &[RigidBodyHandle]) -> PlaceGroups {
        let world = self.physics();
        // By Rapier's index: the body's place plus one; 0 if it is not solved.
        let mut places = vec![0_u32; self.slots.len()];
        for (place, &handle) in (1..).zip(awake) {
            let body = &world.bodies[handle];
            if body.is_dynamic() && !body.is_sleeping() {
                places[handle.into_raw_parts().0 as usize] = place;
            }
        }
        let place = |handle: RigidBodyHandle| match places[handle.into_raw_parts().0 as usize] {
            0 => None,
            place => Some(place as usize - 1),
        };
        let mut groups = PlaceGroups::new(awake.len());
        for (handle, own) in awake.iter().filter_map(|&handle| Some((handle, place(handle)?))) {
            for &collider in world.bodies[handle].colliders() {
                for pair in world.narrow_phase.contact_pairs_with(collider) {
                    #[cfg(test)]
                    tests::PAIRS.set(tests::PAIRS.get() + 1);
                    let other = if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
                    let other = world.colliders.get(other).and_then(Collider::parent).and_then(place);
                    if let Some(other) = other.filter(|_| pair.has_any_active_contact()) {
                        groups.join(own, other);
                    }
                }
            }
            for (a, b, ..) in world.impulse_joints.attached_joints(handle) {
                if let Some(other) = place(if a == handle { b } else { a }) {
                    groups.join(own, other);
                }
            }
        }
        groups
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use rapier3d::prelude::*;

    use crate::runtime::{LocalWorld, WorldConfig};

    thread_local! {
        pub(super) static PAIRS: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn who_has_additional_iterations_among_sleepers_has_none_of_them_looked_at() {
        let mut world = LocalWorld::new(WorldConfig { threads: 1, ..WorldConfig::default() }).unwrap();
        let floor = RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0));
        world.insert(floor, ColliderBuilder::cuboid(100.0, 0.5, 100.0)).unwrap();
        let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5);
        for i in 0..500 {
            let at = Vector::new((i % 25) as f32 - 60.0, 0.5, (i / 25) as f32);
            world.insert(RigidBodyBuilder::dynamic().translation(at), cube()).unwrap();
        }
        for _ in 0..240 {
            world.step().unwrap();
        }
        let awake = |x| RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.5, 0.0)).can_sleep(false);
        let one = world.insert(awake(20.0).additional_solver_iterations(4), cube()).unwrap();
        let other = world.insert(awake(21.0), cube()).unwrap();
        world.insert_joint(one, other, RopeJointBuilder::new(2.0)).unwrap();
        for _ in 0..10 {
            world.step().unwrap();
        }
        let before = PAIRS.get();
        world.step().unwrap();
        let pairs = PAIRS.get() - before;
        assert!((1..=4).contains(&pairs), "{pairs} contacts: two with the floor, and one of both, twice");
        let region = world.regions().next().unwrap();
        let [one, other] = [one, other].map(|id| region.iteration_s(region.handle_of(id).unwrap()));
        assert_eq!(one, other, "what is tied has as many");
        let usual = super::iteration_s(&region.physics().integration_parameters, 0);
        assert!(one < usual);
        let sleeper = region.bodies().find(|(.., body)| body.is_dynamic() && body.is_sleeping()).unwrap().2;
        assert_eq!(region.iteration_s(sleeper), usual);
    }
}
