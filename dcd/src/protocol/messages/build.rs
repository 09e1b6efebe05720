//! Defines the changes of a world by its server's program, and by clients that may build.

use bincode::{Decode, Encode};

use super::{Input, Push};
use crate::protocol::assembly::{Assembly, assemblies, gathered};
use crate::protocol::{Alteration, BodyRecord, JointRecord, ShapeRecord};
use crate::space::{BodyId, JointId};

/// The most changes in one message of a client that may build.
pub const MAX_BUILD_OPS: usize = 1_024;
/// The most bytes of such a message: it fits a client's frame.
pub(crate) const BUILD_BYTES: usize = 60 << 10;

/// A change of the world by its server's program, or by a client that may build.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum BuildOp {
    /// Bodies come, with joints among them and with fixed bodies.
    Insert {
        /// New ones, persistent.
        bodies: Vec<BodyRecord>,
        /// Their shapes, parts before compounds; known ones may be left out.
        shapes: Vec<ShapeRecord>,
        /// Each ties new bodies, or a new one to a fixed one.
        joints: Vec<JointRecord>,
    },
    /// A body goes, with its joints.
    Remove(BodyId),
    /// A joint goes.
    RemoveJoint(JointId),
    /// A body gets a velocity, and perhaps a pose.
    Move(Input),
    /// A body is pushed.
    Push(Push),
    /// A movable body or a joint is something else.
    Alter(Alteration),
}

impl BuildOp {
    /// Returns the bodies concerned: none where a joint is.
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

    /// Splits what comes into parts of at most so many bytes, as far as joints allow: what they tie together comes together.
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
