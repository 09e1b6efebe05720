//! Carries what a program's contact hooks have answered, so that a replay can answer the same without them.

use bincode::{Decode, Encode};

use crate::space::{BodyId, RegionId};

/// A collider: its body, and its index there.
type Collider = (BodyId, u16);

/// A question to contact hooks: which region asks what about which two colliders, and how often it has asked that in the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub struct HookCall {
    pub region: RegionId,
    pub question: HookQuestion,
    pub first: Collider,
    pub second: Collider,
    /// Counted from 0.
    pub time: u32,
}

/// What hooks are asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub enum HookQuestion {
    /// Whether two solid colliders touch.
    Contact,
    /// Whether a sensor detects a collider.
    Intersection,
    /// What the solver is to make of a manifold.
    Solver,
}

/// An answer that is otherwise than without hooks.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum HookAnswer {
    /// The bits of the solver flags of two colliders that touch; `None` where they do not.
    Contact(Option<u32>),
    /// A sensor does not detect a collider.
    Unseen,
    /// What a hook has made of a manifold, in Rapier's serde form.
    Solver(Vec<u8>),
}
