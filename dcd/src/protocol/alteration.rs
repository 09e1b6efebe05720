//! Defines how a server's program changes properties of bodies and joints that no step changes, while nodes
//! compute them.

use std::sync::Arc;

use bincode::{Decode, Encode};

use super::{BodyTraits, Check, Invalid, JointRecord};
use crate::space::BodyId;

/// A change of what a body or a joint is.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Alteration {
    /// A movable body gets these traits and this user data. The number, shapes and places of its colliders
    /// stay as they were.
    Body {
        /// The body.
        body: BodyId,
        /// The new traits, which replace the former ones.
        traits: Arc<BodyTraits>,
        /// The user's own number.
        user_data: u128,
        /// Says whether the body is woken.
        wakes: bool,
    },
    /// A joint gets these frames, limits, motors and settings. Its bodies stay as they were.
    Joint(Box<JointRecord>),
}

impl Check for Alteration {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Body { traits, .. } => traits.check(),
            Self::Joint(joint) => joint.check(),
        }
    }
}
