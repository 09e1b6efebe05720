//! Keeps the kind of a body and what its user asks of it consistent, for bodies that walk or drive by
//! themselves where they are computed.

use std::sync::Arc;

use super::{BodyRecord, BodyState, BodyTraits, Character, Drive, Gait, Input, Vehicle, Velocity};

/// The controller of a body that moves by itself where it is computed: it walks or drives.
#[derive(Clone, Copy, Debug)]
pub enum Controller<'a> {
    /// A character, which walks; kinematic by velocity.
    Character(&'a Character),
    /// A vehicle, which stands on wheels; dynamic.
    Vehicle(&'a Vehicle),
}

impl BodyRecord {
    /// Gives the body a controller, if there is one. A character never sleeps, and its velocity is the one
    /// that it wants.
    #[must_use]
    #[doc(hidden)]
    pub fn with_controller(mut self, controller: Option<Controller<'_>>) -> Self {
        match controller {
            None => {}
            Some(Controller::Character(character)) => {
                let traits = Arc::make_mut(&mut self.traits);
                traits.character = Some(*character);
                (traits.sleep_linear_threshold, traits.sleep_angular_threshold) = (-1.0, -1.0);
                self.state.sleeping = false;
                self.state.gait = Some(Gait { wanted: self.state.velocity.linear, ..Gait::default() });
            }
            Some(Controller::Vehicle(vehicle)) => {
                Arc::make_mut(&mut self.traits).vehicle = Some(vehicle.clone());
                self.state.drive = Some(Drive::default());
            }
        }
        self
    }

    /// Changes the traits of the body. A body that is no character any more does not walk; one that is no
    /// vehicle any more does not drive.
    #[doc(hidden)]
    pub fn set_traits(&mut self, traits: Arc<BodyTraits>, user_data: u128) {
        (self.traits, self.user_data) = (traits, user_data);
        self.set_state(self.state);
    }

    /// Changes the state of the body. Only what suits the body counts: the state may be of a time when the
    /// body was something else.
    #[doc(hidden)]
    pub fn set_state(&mut self, state: BodyState) {
        let gait = self.traits.character.map(|_| state.gait.unwrap_or_default());
        let drive = self.traits.vehicle.as_ref().map(|_| state.drive.unwrap_or_default());
        self.state = BodyState { gait, drive, ..state };
    }

    /// Returns the velocity that the user of the body asked for last, as far as it is known; for a body that
    /// is no character, its own velocity.
    #[doc(hidden)]
    pub fn asked(&self) -> Velocity {
        let own = self.state.velocity;
        self.state.gait.map_or(own, |gait| Velocity { linear: gait.wanted, ..own })
    }

    /// Applies what the user of the body asks for, except a jump: a velocity, or what a driver does.
    #[doc(hidden)]
    pub fn obey(&mut self, input: &Input) {
        match (&mut self.state.drive, input.drive) {
            (Some(drive), Some(wanted)) => *drive = wanted,
            (None, Some(_)) => {}
            (_, None) => self.steer(input.velocity),
        }
    }

    /// Sets the velocity that the user of the body asks for.
    #[doc(hidden)]
    pub fn steer(&mut self, velocity: Velocity) {
        match &mut self.state.gait {
            Some(gait) => {
                gait.wanted = velocity.linear;
                self.state.velocity.angular = velocity.angular;
            }
            None => self.state.velocity = velocity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{BodyKind, Check};
    use crate::sim::sim_body;
    use crate::space::BodyId;

    #[test]
    fn state_and_traits_of_different_times_make_a_body_that_may_be() {
        let plain = sim_body(BodyId::persistent(0), [0.0; 3]);
        let car = plain.clone().with_controller(Some(Controller::Vehicle(&Vehicle::default())));
        let mut walker = plain.clone();
        Arc::make_mut(&mut walker.traits).kind = BodyKind::KinematicVelocity;
        let walker = walker.with_controller(Some(Controller::Character(&Character::default())));
        let bodies = [plain, car, walker];
        for body in &bodies {
            for other in &bodies {
                let (mut stated, mut altered) = (body.clone(), body.clone());
                stated.set_state(other.state);
                altered.set_traits(other.traits.clone(), other.user_data);
                let fits = |body: &BodyRecord| {
                    let (state, traits) = (&body.state, &body.traits);
                    (state.gait.is_some(), state.drive.is_some())
                        == (traits.character.is_some(), traits.vehicle.is_some())
                };
                assert!(fits(&stated) && fits(&altered) && stated.state.check().is_ok());
            }
        }
    }
}
