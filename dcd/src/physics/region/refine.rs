//! Computes loads out of proportion more finely. Bodies that bear or pull at much heavier ones get more
//! solver iterations, and so does what they touch and are tied to. Contacts in the whole region are stiffer,
//! since a soft contact gives way in proportion to its load.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Ownership, Region};
use crate::fidelity::Signals;

/// The mass ratio of two bodies that touch or are tied beyond which both take more iterations.
const RATIO: f32 = 30.0;
/// The least number of additional iterations that such a body takes.
const EXTRA: usize = 16;
/// Contacts of a region with such bodies have this many times the natural frequency, and sag by the square of
/// that less. With Rapier's 30 Hz and 4 iterations of 1/60 s their frequency is 0.3 of that of the
/// iterations; contacts shake from half of it on.
const STIFFER: f32 = 2.4;
/// How far away a body foresees contacts in a step of several ticks, metres. Otherwise bodies would be found
/// inside one another after the step.
pub(super) const FORESEEN_M: f32 = 1.0;
/// The turn in a step from which on Rapier is told not to cap a spin, radians. It caps spins at π/4 per step: at a quarter
/// of that which it allows in a tick.
const FREE_RAD: f32 = 0.3;
/// A step that is so many times longer than the last one needs boxes of its own in the broad phase, for bodies that go
/// farther in it than this, metres.
const LONGER: f32 = 1.01;
const SLOW_M: f32 = 0.01;
/// The spin that counts is the one that one in this many bodies exceeds.
const SPINNING: usize = 10;

/// The findings of the last look at all awake bodies of a region.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Findings {
    /// Says whether there are loads out of proportion: a body that touches or is tied to a much heavier or
    /// lighter one.
    strained: bool,
    signals: Signals,
}

impl Region {
    /// Gives more iterations to the awake bodies that touch, or are tied to, much heavier or lighter ones,
    /// and takes them from those that no longer do. Bodies keep the iterations that their user gave them.
    /// Renews the signals.
    pub(in crate::physics) fn refine(&mut self) {
        let awake: Vec<_> = self.world.islands.active_bodies().collect();
        self.findings.strained = false;
        for handle in awake {
            let is_strained = self.is_strained(handle);
            self.findings.strained |= is_strained;
            let wanted = self.own_iterations(handle).max(if is_strained { EXTRA } else { 0 });
            if self.world.bodies[handle].additional_solver_iterations() != wanted {
                self.world.bodies[handle].set_additional_solver_iterations(wanted);
            }
        }
        self.findings.signals = self.look();
    }

    /// Returns the signals that the last [`Region::refine`] found.
    pub(in crate::physics) fn signals(&self) -> Signals {
        self.findings.signals
    }

    /// Makes awake bodies foresee what they would come to touch in a step of so many ticks of this length, and lets them
    /// spin on in it.
    pub(in crate::physics) fn foresee(&mut self, ticks: u8, dt_s: f32) {
        let least_m = if ticks > 1 { FORESEEN_M } else { 0.0 };
        let awake: Vec<_> = self.world.islands.active_bodies().collect();
        let step_s = f32::from(ticks) * dt_s;
        let is_longer = ticks > 1 && step_s > LONGER * self.world.integration_parameters.dt;
        for handle in awake {
            let traits = &self.slot(handle).traits;
            let wanted_m = traits.soft_ccd_m.max(least_m);
            let body = &self.world.bodies[handle];
            let spins = traits.fast_rotation || ticks > 1 && body.angvel().length() * step_s > FREE_RAD;
            let sees_farther = wanted_m > body.soft_ccd_prediction() || is_longer;
            if body.soft_ccd_prediction() != wanted_m || body.is_fast_rotation_allowed() != spins {
                let body = &mut self.world.bodies[handle];
                body.set_soft_ccd_prediction(wanted_m);
                body.set_allow_fast_rotation(spins);
            }
            let body = &self.world.bodies[handle];
            if sees_farther && body.linvel().length() * step_s > SLOW_M {
                // Rapier has made the boxes of the broad phase at the end of the last step, for one as short.
                for collider in body.colliders().to_vec() {
                    let collider = &mut self.world.colliders[collider];
                    collider.set_position(*collider.position());
                }
            }
        }
    }

    fn look(&self) -> Signals {
        let bodies = &self.world.bodies;
        let (mut overlap_m, mut spins) = (0.0, Vec::new());
        for handle in self.world.islands.active_bodies() {
            let pairs = bodies[handle]
                .colliders()
                .iter()
                .flat_map(|&collider| self.world.narrow_phase.contact_pairs_with(collider));
            let dist_m =
                pairs.filter_map(|pair| pair.find_deepest_contact()).map(|(_, contact)| contact.dist);
            overlap_m += dist_m.fold(0.0, |deepest: f32, dist_m| deepest.max(-dist_m));
            spins.push(bodies[handle].angvel().length());
        }
        let count = spins.len();
        if count == 0 {
            return Signals::default();
        }
        let (_, spin_rad_s, _) = spins.select_nth_unstable_by(count - 1 - count / SPINNING, f32::total_cmp);
        Signals { overlap_m: overlap_m / count as f32, spin_rad_s: *spin_rad_s }
    }

    /// Resets a body to the iterations that its user gave it, so that the user sees these; [`Region::refine`]
    /// gives it more again.
    pub(in crate::physics) fn unrefine(&mut self, handle: RigidBodyHandle) {
        let traits = &self.slot(handle).traits;
        let (own, own_m, spins) = (self.own_iterations(handle), traits.soft_ccd_m, traits.fast_rotation);
        let body = &self.world.bodies[handle];
        let now = (
            body.additional_solver_iterations(),
            body.soft_ccd_prediction(),
            body.is_fast_rotation_allowed(),
        );
        if now != (own, own_m, spins) {
            let body = &mut self.world.bodies[handle];
            body.set_additional_solver_iterations(own);
            body.set_soft_ccd_prediction(own_m);
            body.set_allow_fast_rotation(spins);
        }
    }

    /// Returns the solver's parameters for this region, with stiffer contacts if it has loads out of
    /// proportion.
    pub(in crate::physics) fn refined(&self, parameters: IntegrationParameters) -> IntegrationParameters {
        if !self.findings.strained {
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
        // Rapier would solve all that touches a multibody with as many iterations, and all of it would cost
        // more.
        if !bodies[handle].is_dynamic() || self.is_articulated(handle) {
            return false;
        }
        // Masses of whole bodies: each copy of a split body has only a part.
        let mass_kg = |handle: RigidBodyHandle| bodies[handle].mass() * self.share_of(handle) as f32;
        let mut is_strained = false;
        self.for_each_contact(handle, |other, touches| {
            let is_movable = matches!(self.role_of(other), Some((_, role)) if role != Ownership::Immovable);
            if touches && is_movable && bodies[other].is_dynamic() {
                let ratio = mass_kg(handle) / mass_kg(other);
                is_strained |= !(1.0 / RATIO..=RATIO).contains(&ratio);
            }
        });
        is_strained
    }
}
