//! Adds `collider_id` to hits and answers of queries, and `colliders` to contact keys.

use super::{PointHit, RayHit, ShapeHit};
use crate::physics::ColliderId;
use crate::protocol::{CastAnswer, ContactKey, Overlap, RayAnswer};

/// Implements `collider_id` for hits and answers that name a collider by body and index.
macro_rules! named_by_body_and_index {
    ($($found:ty),+) => {$(
        impl $found {
            /// Returns the id of the collider that was found.
            #[must_use]
            pub fn collider_id(&self) -> ColliderId {
                ColliderId { body: self.body, index: self.collider as usize }
            }
        }
    )+};
}

named_by_body_and_index!(RayHit, ShapeHit, PointHit, RayAnswer, CastAnswer, Overlap);

impl ContactKey {
    /// Returns the ids of the two colliders in contact.
    #[must_use]
    pub fn colliders(&self) -> [ColliderId; 2] {
        [(self.a, self.collider_a), (self.b, self.collider_b)]
            .map(|(body, index)| (body, usize::from(index)).into())
    }
}
