//! Names colliders across regions.

use crate::space::BodyId;

/// A collider by its body and its place on it, counted from 0 in order of insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ColliderId {
    /// Which body.
    pub body: BodyId,
    /// Which of its colliders.
    pub index: usize,
}
