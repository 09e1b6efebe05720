//! What a server keeps beyond its own death: entries by key, changed in batches.

use crate::protocol::ShapeHash;
use crate::space::{BodyId, GroupId, JointId};

/// The name of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// The world and where the server stands.
    World,
    /// A group's membership.
    Group(GroupId),
    /// A body.
    Body(BodyId),
    /// A shape.
    Shape(ShapeHash),
    /// A joint.
    Joint(JointId),
}

/// Changes that happen all or not at all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// New values; `None` removes the entry.
    pub writes: Vec<(Key, Option<Vec<u8>>)>,
    /// Whether it must outlive a crash from the moment that it is committed; else it may be lost with the newest others.
    pub durable: bool,
}
