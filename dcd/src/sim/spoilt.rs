//! Defines planted bugs of the hand-over: what a body that changes owner comes with is spoilt on its way.

use crate::protocol::{BodyState, Velocity};

/// How a planted bug spoils what a body is handed over with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spoilt {
    /// It comes without its velocity.
    Halted,
    /// It comes as it was a tick before.
    Stale,
}

impl Spoilt {
    pub(super) fn spoil(self, state: &mut BodyState, dt_s: f32) {
        match self {
            Self::Halted => state.velocity = Velocity::default(),
            Self::Stale => state.pose = state.pose.moved(&state.velocity, -f64::from(dt_s)),
        }
    }
}
