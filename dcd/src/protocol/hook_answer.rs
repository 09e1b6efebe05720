//! Carries what a program's contact hooks answered, so that a replay can give the same answers without them.

use bincode::{Decode, Encode};

use crate::space::{BodyId, RegionId};

/// A collider: its body, and its index on the body.
type Collider = (BodyId, u16);

/// A question to contact hooks: the region that asks, the question, the two colliders, and how often the
/// region has asked this in the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub struct HookCall {
    pub region: RegionId,
    pub question: HookQuestion,
    pub first: Collider,
    pub second: Collider,
    /// The number of the question among equal ones in the tick, from 0.
    pub time: u32,
}

/// The kind of question to hooks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub enum HookQuestion {
    /// Says whether two solid colliders touch.
    Contact,
    /// Says whether a sensor detects a collider.
    Intersection,
    /// How the solver is to treat a manifold.
    Solver,
}

/// An answer that differs from what holds without hooks.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum HookAnswer {
    /// The bits of the solver flags of two colliders that touch; `None` if they do not touch.
    Contact(Option<u32>),
    /// A sensor does not detect a collider.
    Unseen,
    /// The manifold as a hook changed it, in Rapier's serde form.
    Solver(Vec<u8>),
}
