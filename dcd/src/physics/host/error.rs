//! Names why bodies, joints and regions are not held.

use crate::physics::shapes::ShapeError;
use crate::space::{BodyId, JointId, TreeError};

/// An error of a [`RegionHost`](super::RegionHost).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HostError {
    /// A shape cannot be held.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The distribution tree cannot be changed so.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// The operating system gives no threads.
    #[error("cannot start {threads} threads: {cause}; ask for fewer")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// The system's reason.
        cause: rayon::ThreadPoolBuildError,
    },
    /// The id is taken.
    #[error("{0} is in the world already; every body has one id")]
    Taken(BodyId),
    /// A joint ties a body that is not there.
    #[error("joint {joint} ties {body}, which is not in the world; insert both bodies first")]
    Untied {
        /// Which joint.
        joint: JointId,
        /// Which body.
        body: BodyId,
    },
    /// A joint ties a body to itself.
    #[error("joint {joint} ties {body} to itself; a joint needs two bodies")]
    Itself {
        /// Which joint.
        joint: JointId,
        /// Which body.
        body: BodyId,
    },
    /// Rapier cannot have the joint in a multibody.
    #[error("multibody joint {joint} to {body}: {cause}")]
    MultibodyJoint {
        /// Which joint.
        joint: JointId,
        /// Its second body.
        body: BodyId,
        /// What is wrong, and what to do.
        cause: &'static str,
    },
    /// A number that must be finite is not, or a rotation is not a unit quaternion.
    #[error(
        "{0} has a pose or velocity that is not finite, or a rotation that is not a unit quaternion; check its numbers"
    )]
    NotFinite(BodyId),
}
