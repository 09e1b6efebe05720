//! Gives bodies at which loads hang that are out of proportion more solver iterations: what they touch and are tied to is solved with them.

use rapier3d::prelude::*;

use super::{Ownership, Region};

/// A contact or a joint of bodies of which one is so many times as heavy as the other takes more iterations.
const RATIO: f32 = 20.0;
/// So many more.
const EXTRA: usize = 16;

impl Region {
    /// Gives more iterations to the awake bodies that touch, or are tied to, bodies much heavier or lighter, and takes them from those that
    /// no longer do; what their user gave them they keep.
    pub(in crate::physics) fn refine(&mut self) {
        let awake: Vec<_> = self.world.islands.active_bodies().collect();
        for handle in awake {
            let wanted = self.own_iterations(handle).max(if self.is_strained(handle) { EXTRA } else { 0 });
            if self.world.bodies[handle].additional_solver_iterations() != wanted {
                self.world.bodies[handle].set_additional_solver_iterations(wanted);
            }
        }
    }

    /// Gives a body the iterations that its user gave it, to be seen by its user; [`Region::refine`] gives it more again.
    pub(in crate::physics) fn unrefine(&mut self, handle: RigidBodyHandle) {
        let own = self.own_iterations(handle);
        if self.world.bodies[handle].additional_solver_iterations() != own {
            self.world.bodies[handle].set_additional_solver_iterations(own);
        }
    }

    fn own_iterations(&self, handle: RigidBodyHandle) -> usize {
        self.slot(handle).traits.extra_solver_iterations as usize
    }

    fn is_strained(&self, handle: RigidBodyHandle) -> bool {
        let bodies = &self.world.bodies;
        // Rapier would solve all that touches a multibody with as many, at the price of all of them.
        if !bodies[handle].is_dynamic() || self.is_articulated(handle) {
            return false;
        }
        let mass_kg = bodies[handle].mass();
        let mut is_strained = false;
        self.for_each_contact(handle, |other, touches| {
            let is_movable = matches!(self.role_of(other), Some((_, role)) if role != Ownership::Immovable);
            if touches && is_movable && bodies[other].is_dynamic() {
                let ratio = mass_kg / bodies[other].mass();
                is_strained |= !(1.0 / RATIO..=RATIO).contains(&ratio);
            }
        });
        is_strained
    }
}
