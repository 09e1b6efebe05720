//! Defines the types in which a `World` reports bodies, their owners, regions, and, in served worlds, changes of bodies.

use crate::playback::Motion;
use crate::protocol::{BodyKind, Refusal, Velocity, WorldPose};
use crate::space::{BodyId, Cell, NodeId, RegionId};

/// A body as it is after the last step; in a served world as last received.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Body {
    /// Where it is, in world space.
    pub pose: WorldPose,
    /// How it moves, m/s and rad/s.
    pub velocity: Velocity,
    /// How it is moved: dynamic, kinematic or fixed.
    pub kind: BodyKind,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// Its mass, kilograms: 0 for a fixed body, `None` where it is not known, as in a served world.
    pub mass_kg: Option<f32>,
    /// The number that its user gave it.
    pub user_data: u128,
    /// The region that owns it; `None` for a fixed body.
    pub owner: Option<RegionId>,
    /// Whether it lies outside a client's area of interest ([`World::set_interest`](super::World::set_interest)): then its state
    /// is the last received.
    pub outside: bool,
}

/// A movable body after the last step, as [`World::movable_bodies`](super::World::movable_bodies) lists them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MovableBody {
    /// The id of the body.
    pub id: BodyId,
    /// The region that owns it.
    pub region: RegionId,
    /// Where it is, in world space.
    pub pose: WorldPose,
    /// How it moves, m/s and rad/s.
    pub velocity: Velocity,
    /// The number that its user gave it.
    pub user_data: u128,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// Same as [`Body::outside`].
    pub outside: bool,
}

impl MovableBody {
    pub(super) fn moved_to(self, motion: Motion) -> Self {
        Self { pose: motion.pose, velocity: motion.velocity, ..self }
    }
}

/// The region and node that have authority over a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Owner {
    /// The region that owns it; `None` for a fixed body.
    pub region: Option<RegionId>,
    /// The node that computes the region, as far as known; `None` in a local world.
    pub node: Option<NodeId>,
    /// Whether its owner is not known yet: then the region is the one that the body lies in.
    pub by_place: bool,
    /// How many regions hold a copy of it; 0 where that is not known.
    pub holders: usize,
    /// Whether this process computes the region.
    pub here: bool,
    /// Whether the state of the body was received from other processes.
    pub heard: bool,
}

/// A region of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegionInfo {
    /// The id of the region.
    pub id: RegionId,
    /// The node that computes it; `None` where one process computes all, and where it is not known.
    pub node: Option<NodeId>,
    /// Bodies that it owns.
    pub owned: usize,
    /// Copies of other regions' bodies (replicas) that it holds; 0 where that is not known.
    pub replicas: usize,
    /// The box of space that is its own, metres; outer regions reach to infinity.
    pub cell: Cell,
}

/// A change of the bodies of a served world: one appeared or was removed, or an input was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BodyChange {
    /// It is in the world now.
    Appeared(BodyId),
    /// It is gone.
    Removed(BodyId),
    /// An input was refused. An avatar that has not appeared never will.
    Refused {
        /// Which avatar; `None` when it concerns none.
        body: Option<BodyId>,
        /// Why.
        why: Refusal,
        /// The avatar's user data, since it may be gone.
        user_data: u128,
    },
}
