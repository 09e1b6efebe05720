//! Defines planted bugs of the hand-over, and of recovery: what a body that changes owner comes with is spoilt on its way.

use crate::protocol::{BodyState, Velocity};

/// How a planted bug spoils what a body is handed over with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spoilt {
    /// It comes without its velocity.
    Halted,
    /// It comes as it was a tick before.
    Stale,
    /// It comes well from its owner, but without its velocity from the server, as after a death.
    Recovered,
}

impl Spoilt {
    pub(super) fn spoil(self, state: &mut BodyState, dt_s: f32) {
        match self {
            Self::Halted => state.velocity = Velocity::default(),
            Self::Recovered => {}
            Self::Stale => state.pose = state.pose.moved(&state.velocity, -f64::from(dt_s)),
        }
    }
}
