//! Computes loads out of proportion finer: bodies that bear or pull at much heavier ones have more solver iterations, and what they touch and
//! are tied to has as many; and contacts are stiffer in the region, since what a soft one gives way grows with the load.

use rapier3d::prelude::*;

use super::{Ownership, Region};

/// A contact or a joint of bodies of which one is so many times as heavy as the other takes more iterations.
const RATIO: f32 = 30.0;
/// So many more.
const EXTRA: usize = 16;
/// Contacts of a region with such bodies have so many times the natural frequency, and sag by the square of that less. With Rapier's 30 Hz and 4
/// iterations of 1/60 s it is 0.3 of the frequency of the iterations; they shake from half of it on.
const STIFFER: f32 = 2.4;

impl Region {
    /// Gives more iterations to the awake bodies that touch, or are tied to, bodies much heavier or lighter, and takes them from those that
    /// no longer do; what their user gave them they keep.
    pub(in crate::physics) fn refine(&mut self) {
        let awake: Vec<_> = self.world.islands.active_bodies().collect();
        self.strained = false;
        for handle in awake {
            let is_strained = self.is_strained(handle);
            self.strained |= is_strained;
            let wanted = self.own_iterations(handle).max(if is_strained { EXTRA } else { 0 });
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

    /// Returns the solver's parameters for this region.
    pub(in crate::physics) fn refined(&self, parameters: IntegrationParameters) -> IntegrationParameters {
        if !self.strained {
            return parameters;
        }
        let stiffer = |softness: SpringCoefficients<f32>| SpringCoefficients {
            natural_frequency: STIFFER * softness.natural_frequency,
            ..softness
        };
        IntegrationParameters {
            contact_softness: stiffer(parameters.contact_softness),
            static_contact_softness: stiffer(parameters.static_contact_softness),
            ..parameters
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
