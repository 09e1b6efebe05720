//! Keeps what an author changes of a body until the next step.

use std::sync::Arc;

use crate::protocol::{BodyState, BodyTraits, Drive, Velocity, WorldPose};

/// What a body is changed to.
pub(super) struct Altered {
    pub(super) traits: Arc<BodyTraits>,
    pub(super) user_data: u128,
    pub(super) wakes: bool,
    /// With which send.
    pub(super) sent: Option<u64>,
}

/// How a body is moved.
#[derive(Clone, Copy, Default)]
pub(super) struct Move {
    pub(super) velocity: Option<Velocity>,
    pub(super) pose: Option<WorldPose>,
    pub(super) drive: Option<Drive>,
}

impl Move {
    /// Returns the state of a body after it.
    pub(super) fn of(&self, state: &BodyState) -> BodyState {
        let (velocity, pose) = (self.velocity.unwrap_or(state.velocity), self.pose.unwrap_or(state.pose));
        BodyState { velocity, pose, ..*state }
    }
}
