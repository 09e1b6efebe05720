//! What every role can say of bodies and regions.

use crate::protocol::{BodyKind, Refusal, Velocity, WorldPose};
use crate::space::{BodyId, Cell, NodeId, RegionId};

/// A body as it is after the last step; in a served world as last heard of.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Body {
    /// Where it is, in world space.
    pub pose: WorldPose,
    /// How it moves, m/s and rad/s.
    pub velocity: Velocity,
    /// What moves it.
    pub kind: BodyKind,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// Its mass, kilograms: 0 for a fixed body, `None` where it is not known, as in a served world.
    pub mass_kg: Option<f32>,
    /// Its user's number.
    pub user_data: u128,
    /// The region that owns it; `None` for a fixed body.
    pub owner: Option<RegionId>,
    /// Whether it lies outside the interest of a client ([`World::set_interest`](super::World::set_interest)): it is where it was
    /// last heard of.
    pub outside: bool,
}

/// A movable body after the last step, as [`World::movable_bodies`](super::World::movable_bodies) lists them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MovableBody {
    /// Which.
    pub id: BodyId,
    /// The region that owns it.
    pub region: RegionId,
    /// Where it is, in world space.
    pub pose: WorldPose,
    /// How it moves, m/s and rad/s.
    pub velocity: Velocity,
    /// Its user's number.
    pub user_data: u128,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// As [`Body::outside`].
    pub outside: bool,
}

/// Who has authority over a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Owner {
    /// The region that owns it; `None` for a fixed body.
    pub region: Option<RegionId>,
    /// The node that computes the region, as far as known; `None` in a local world.
    pub node: Option<NodeId>,
    /// Whether nobody has told yet who owns it: then the region is the one that it is in.
    pub by_place: bool,
    /// How many regions hold a copy of it; 0 where that is not known.
    pub holders: usize,
    /// Whether this process computes the region.
    pub here: bool,
    /// Whether what is known of the body was heard from others.
    pub heard: bool,
}

/// A region of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegionInfo {
    /// Which.
    pub id: RegionId,
    /// The node that computes it; `None` where one process computes all, and where it is not known.
    pub node: Option<NodeId>,
    /// Bodies that it owns.
    pub owned: usize,
    /// Copies of bodies of other regions that it holds; 0 where that is not known.
    pub replicas: usize,
    /// The box of space that is its own, metres; outer regions reach to infinity.
    pub cell: Cell,
}

/// A body of a served world came or went, or something asked of an avatar was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BodyChange {
    /// It is in the world now.
    Appeared(BodyId),
    /// It is gone.
    Removed(BodyId),
    /// What was asked is refused. An avatar that has not appeared never will.
    Refused {
        /// Which avatar; `None` when it concerns none.
        body: Option<BodyId>,
        /// Why.
        why: Refusal,
        /// The avatar's user data, since it may be gone.
        user_data: u128,
    },
}
