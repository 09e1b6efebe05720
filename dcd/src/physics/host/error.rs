//! Defines the error of bodies, joints and regions that a process cannot hold.

use crate::physics::shapes::ShapeError;
use crate::space::{BodyId, JointId, TreeError};

/// The error of a process that computes regions ([`RegionHost`](super::RegionHost)): a body, joint or region
/// cannot be as asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HostError {
    /// A shape cannot be recorded or built.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The distribution tree cannot be changed as asked.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// The operating system cannot start so many threads.
    #[error("cannot start {threads} threads: {cause}; ask for fewer")]
    Threads {
        /// The number of threads asked for.
        threads: usize,
        /// The system's reason.
        cause: rayon::ThreadPoolBuildError,
    },
    /// The world has a body of this id already.
    #[error("{0} is in the world already; every body has one id")]
    Taken(BodyId),
    /// A joint ties a body that is not in the world.
    #[error("joint {joint} ties {body}, which is not in the world; insert both bodies first")]
    Untied {
        /// The joint.
        joint: JointId,
        /// The body.
        body: BodyId,
    },
    /// A joint ties a body to itself.
    #[error("joint {joint} ties {body} to itself; a joint needs two bodies")]
    Itself {
        /// The joint.
        joint: JointId,
        /// The body.
        body: BodyId,
    },
    /// Rapier cannot hold the joint in a multibody.
    #[error("multibody joint {joint} to {body}: {cause}")]
    MultibodyJoint {
        /// The joint.
        joint: JointId,
        /// The joint's second body.
        body: BodyId,
        /// What is wrong, and what to do.
        cause: &'static str,
    },
    /// A number that must be finite is not, a position is beyond 1e9 m, or a rotation is not a unit quaternion.
    #[error(
        "{0} has a pose or velocity that is not finite, lies beyond 1e9 m, or has a rotation that is not a unit quaternion; check its numbers"
    )]
    NotFinite(BodyId),
}
