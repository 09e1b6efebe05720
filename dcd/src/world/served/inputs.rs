//! Keeps the inputs of a client's avatars until the next step sends them.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::Served;
use crate::protocol::{BodyKind, Drive, Velocity, WorldPose};
use crate::runtime::{ProcessError, WorldError, check_speed};
use crate::space::BodyId;
use crate::world::remote::Remote;

/// The inputs of one avatar for the next step.
#[derive(Default)]
pub(super) struct PendingInput {
    pub velocity: Option<Velocity>,
    pub pose: Option<WorldPose>,
    pub drive: Option<Drive>,
}

impl Served {
    /// Returns an error if the velocity is above the world's speed limit.
    pub(super) fn check_speed(&self, id: BodyId, velocity: Velocity) -> Result<(), WorldError> {
        let Some(mut avatar) = self.known(id).map(Cow::into_owned) else { return Ok(()) };
        avatar.state.velocity = velocity;
        check_speed(&avatar, self.speed_limit_m_s())
    }

    /// Sends the inputs of avatars since the last step. Inputs of avatars that are not in the world yet are
    /// kept.
    pub(super) fn send_inputs(&mut self) -> Result<(), ProcessError> {
        let (waiting, due): (BTreeMap<_, _>, BTreeMap<_, _>) =
            std::mem::take(&mut self.inputs).into_iter().partition(|(id, _)| self.awaited.contains_key(id));
        self.inputs = waiting;
        for (id, input) in due {
            let Some(body) = self.heard(id) else { continue };
            // An input message says one or the other; a leader takes in both.
            if input.velocity.is_some() || input.pose.is_some() {
                let kinematic = body.body.traits.kind != BodyKind::Dynamic;
                let now = body.body.asked();
                let driven = if kinematic { self.driven.get(&id).copied() } else { None };
                let velocity = input.velocity.or(driven).unwrap_or(now);
                self.driven.insert(id, velocity);
                self.world.send_input(id, velocity, input.pose)?;
            }
            if let Some(drive) = input.drive {
                self.world.drive(id, drive)?;
            }
        }
        Ok(())
    }
}
