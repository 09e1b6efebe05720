//! Defines the changes of a world that its server's program, and clients that may build, make.

use bincode::{Decode, Encode};

use super::{Input, Push};
use crate::protocol::assembly::{Assembly, assemblies, gathered};
use crate::protocol::{Alteration, BodyRecord, JointRecord, ShapeRecord};
use crate::space::{BodyId, JointId};

/// The most changes in one message of a builder.
pub const MAX_BUILD_OPS: usize = 1_024;
/// The most bytes of such a message, so that it fits a client's frame.
pub(crate) const BUILD_BYTES: usize = 60 << 10;

/// A change of the world by its server's program, or by a builder.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum BuildOp {
    /// Inserts bodies, with joints among them and with fixed bodies.
    Insert {
        /// The new bodies, which are persistent.
        bodies: Vec<BodyRecord>,
        /// The shapes of the bodies, parts before compounds. Known shapes may be left out.
        shapes: Vec<ShapeRecord>,
        /// The joints. Each ties new bodies, or a new one to a fixed one.
        joints: Vec<JointRecord>,
    },
    /// Removes a body with its joints.
    Remove(BodyId),
    /// Removes a joint.
    RemoveJoint(JointId),
    /// Sets the velocity of a body, and perhaps its pose.
    Move(Input),
    /// Pushes a body.
    Push(Push),
    /// Changes what a movable body or a joint is.
    Alter(Alteration),
}

impl BuildOp {
    /// Returns the bodies that the change concerns; none for a change of a joint.
    pub(crate) fn bodies(&self) -> Vec<BodyId> {
        match self {
            Self::Insert { bodies, .. } => bodies.iter().map(|body| body.id).collect(),
            Self::Remove(id) => vec![*id],
            Self::Move(input) => vec![input.body],
            Self::Push(push) => vec![push.body],
            Self::Alter(Alteration::Body { body, .. }) => vec![*body],
            Self::Alter(Alteration::Joint(_)) | Self::RemoveJoint(_) => Vec::new(),
        }
    }

    /// Splits an insertion into parts of at most `bytes` bytes, as far as joints allow: bodies that they tie
    /// stay together.
    pub(crate) fn in_parts(self, bytes: usize) -> Vec<Self> {
        match self {
            Self::Insert { bodies, shapes, joints } => {
                let part = |Assembly { bodies, shapes, joints }| Self::Insert { bodies, shapes, joints };
                gathered(assemblies(&bodies, &shapes, &joints), bytes).into_iter().map(part).collect()
            }
            op => vec![op],
        }
    }
}
