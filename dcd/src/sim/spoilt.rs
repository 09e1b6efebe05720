//! Defines planted bugs of transfers and of recovery, which spoil the state that a body brings to its new
//! owner.

use crate::protocol::{BodyState, Velocity};

/// A planted bug that spoils the state with which a body is handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spoilt {
    /// The body arrives without its velocity.
    Halted,
    /// The body arrives as it was a tick before.
    Stale,
    /// The body arrives unspoilt from its owner, but without its velocity from the server, as after a node's
    /// death.
    Recovered,
    /// The body arrives some centimetres aside, from its owner as from the server.
    Aside,
}

/// The distance by which a body arrives aside, metres.
const ASIDE_M: f64 = 0.1;

impl Spoilt {
    /// Spoils a state that a body's owner hands over.
    pub(super) fn spoil(self, state: &mut BodyState, dt_s: f32) {
        match self {
            Self::Halted => state.velocity = Velocity::default(),
            Self::Recovered => {}
            Self::Stale => state.pose = state.pose.moved(&state.velocity, -f64::from(dt_s)),
            Self::Aside => state.pose.translation[0] += ASIDE_M,
        }
    }

    /// Spoils a state that the server hands over.
    pub(super) fn spoil_recovered(self, state: &mut BodyState) {
        match self {
            Self::Halted | Self::Stale => {}
            Self::Recovered => state.velocity = Velocity::default(),
            Self::Aside => state.pose.translation[0] += ASIDE_M,
        }
    }
}
