//! Defines how a server's program changes what no step changes of bodies and joints that nodes compute.

use std::sync::Arc;

use bincode::{Decode, Encode};

use super::{BodyTraits, Check, Invalid, JointRecord};
use crate::space::BodyId;

/// What a body or a joint is from now on.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Alteration {
    /// A movable body has these traits and user data; number, shapes and places of its colliders are as before.
    Body {
        /// Which.
        body: BodyId,
        /// Those of before count no more.
        traits: Arc<BodyTraits>,
        /// The user's own.
        user_data: u128,
        /// Whether it is woken.
        wakes: bool,
    },
    /// A joint has these frames, limits, motors and settings; its bodies are as before.
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
