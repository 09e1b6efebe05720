//! Keeps an author's changes of a body until they are sent and answered.

use std::sync::Arc;

use crate::protocol::{BodyState, BodyTraits, Drive, Velocity, WorldPose};

/// The traits and user data that a body is changed to.
pub(super) struct Altered {
    pub(super) traits: Arc<BodyTraits>,
    pub(super) user_data: u128,
    pub(super) wakes: bool,
    /// The number of the send; `None` if not sent yet.
    pub(super) sent: Option<u64>,
}

/// The velocity, pose and drive that are set for a body.
#[derive(Clone, Copy, Default)]
pub(super) struct Move {
    pub(super) velocity: Option<Velocity>,
    pub(super) pose: Option<WorldPose>,
    pub(super) drive: Option<Drive>,
}

impl Move {
    /// Returns the state of a body after the move.
    pub(super) fn of(&self, state: &BodyState) -> BodyState {
        let (velocity, pose) = (self.velocity.unwrap_or(state.velocity), self.pose.unwrap_or(state.pose));
        BodyState { velocity, pose, ..*state }
    }
}
