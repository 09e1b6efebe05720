//! Names colliders by body and index, so that a collider has the same name in every region.

use crate::space::BodyId;

/// The id of a collider: its body, and its index there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ColliderId {
    /// The body.
    pub body: BodyId,
    /// The index among the body's colliders, counted from 0 in order of insertion.
    pub index: usize,
}

/// Names the first collider of a body, since most bodies have only one.
impl From<BodyId> for ColliderId {
    fn from(body: BodyId) -> Self {
        Self { body, index: 0 }
    }
}

/// Names a collider by its body and index.
impl From<(BodyId, usize)> for ColliderId {
    fn from((body, index): (BodyId, usize)) -> Self {
        Self { body, index }
    }
}
