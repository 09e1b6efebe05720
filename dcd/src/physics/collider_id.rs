//! Names colliders by body and index, so that a name is the same in every region.

use crate::space::BodyId;

/// The id of a collider: its body and its index there, counted from 0 in order of insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ColliderId {
    /// Which body.
    pub body: BodyId,
    /// Which of its colliders.
    pub index: usize,
}

/// The first collider of a body, as most bodies have but one.
impl From<BodyId> for ColliderId {
    fn from(body: BodyId) -> Self {
        Self { body, index: 0 }
    }
}

/// A body and the index of one of its colliders.
impl From<(BodyId, usize)> for ColliderId {
    fn from((body, index): (BodyId, usize)) -> Self {
        Self { body, index }
    }
}
