//! Notes how long the solver iterations were by which Rapier solved each body last: the impulses that it keeps for joints are those of
//! one of them. They are shorter where bodies have additional ones.

use rapier3d::prelude::*;

use super::Region;
use crate::space::PlaceGroups;

/// Returns the length of each of the iterations that a step has, some of them additional, in seconds.
pub(super) fn iteration_s(parameters: &IntegrationParameters, additional: usize) -> f32 {
    parameters.dt / (parameters.num_solver_iterations + additional) as f32
}

impl Region {
    /// Returns the length of the solver iterations of the last step in which a body was awake, in seconds.
    pub(super) fn iteration_s(&self, handle: RigidBodyHandle) -> f32 {
        let noted = self.iterations_s.get(handle.into_raw_parts().0 as usize);
        noted.copied().unwrap_or_else(|| iteration_s(&self.world.integration_parameters, 0))
    }

    /// Notes the length of the iterations of the step that has just been made, for the bodies that are awake after it: all that it solved.
    /// `before_s` is that of the step before.
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
        for handle in self.world.islands.active_bodies() {
            let index = handle.into_raw_parts().0 as usize;
            let additional = additional.as_ref().map_or(0, |by_body| by_body[index]);
            self.iterations_s[index] = iteration_s(&parameters, additional);
        }
    }

    /// Returns how many additional iterations the awake bodies had in the step that has just been made, by Rapier's index; `None` if none
    /// had any. Rapier gives all bodies that touch or are tied the most that any of them asks for; where there is a multibody, all of the
    /// region.
    fn additional_iterations(&self) -> Option<Vec<usize>> {
        let world = self.physics();
        let asked = |handle: RigidBodyHandle| world.bodies[handle].additional_solver_iterations();
        let most = world.islands.active_bodies().map(asked).max().filter(|&most| most > 0)?;
        let bodies = self.slots.len();
        if world.multibody_joints.iter().next().is_some() {
            return Some(vec![most; bodies]);
        }
        let mut groups = self.solved_together();
        let mut had = vec![0; bodies];
        for handle in world.islands.active_bodies() {
            let root = groups.root(handle.into_raw_parts().0 as usize);
            had[root] = had[root].max(asked(handle));
        }
        for handle in world.islands.active_bodies() {
            let index = handle.into_raw_parts().0 as usize;
            had[index] = had[groups.root(index)];
        }
        Some(had)
    }

    /// Groups the awake dynamic bodies that touch or that impulse joints tie, by Rapier's index.
    fn solved_together(&self) -> PlaceGroups {
        let world = self.physics();
        let place = |handle: RigidBodyHandle| {
            let is_solved =
                world.bodies.get(handle).is_some_and(|body| body.is_dynamic() && !body.is_sleeping());
            is_solved.then_some(handle.into_raw_parts().0 as usize)
        };
        let mut groups = PlaceGroups::new(self.slots.len());
        let mut join = |a: RigidBodyHandle, b: RigidBodyHandle| {
            if let (Some(a), Some(b)) = (place(a), place(b)) {
                groups.join(a, b);
            }
        };
        for pair in world.contact_pairs().filter(|pair| pair.has_any_active_contact()) {
            let parent = |collider| world.colliders.get(collider)?.parent();
            if let (Some(a), Some(b)) = (parent(pair.collider1), parent(pair.collider2)) {
                join(a, b);
            }
        }
        for (_, joint) in world.impulse_joints.iter() {
            join(joint.body1(), joint.body2());
        }
        groups
    }
}
