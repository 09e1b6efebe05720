//! Defines the types by which a `World` reports bodies, their owners and regions, and, in served worlds,
//! changes of bodies.

use crate::playback::Motion;
use crate::protocol::{BodyKind, Refusal, Velocity, WorldPose};
use crate::space::{BodyId, Cell, NodeId, RegionId};

/// A body as it is after the last step; in a served world as last received.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Body {
    /// The pose in world space.
    pub pose: WorldPose,
    /// The velocity, m/s and rad/s.
    pub velocity: Velocity,
    /// The kind of body: dynamic, kinematic or fixed.
    pub kind: BodyKind,
    /// Says whether the body sleeps.
    pub sleeping: bool,
    /// The mass, kilograms: 0 for a fixed body, `None` where it is not known, as in a served world.
    pub mass_kg: Option<f32>,
    /// The number that the user gave to the body.
    pub user_data: u128,
    /// The region that owns the body; `None` for a fixed body, an avatar that is not in the world yet, and on
    /// a server.
    pub owner: Option<RegionId>,
    /// Says whether the body lies outside the client's area of interest
    /// ([`World::set_interest`](super::World::set_interest)). Its state is then the last one received.
    pub outside: bool,
}

/// A movable body after the last step, as [`World::movable_bodies`](super::World::movable_bodies) lists them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MovableBody {
    /// The id of the body.
    pub id: BodyId,
    /// The region that owns the body; on a server, the region in which the body lies.
    pub region: RegionId,
    /// The pose in world space.
    pub pose: WorldPose,
    /// The velocity, m/s and rad/s.
    pub velocity: Velocity,
    /// The number that the user gave to the body.
    pub user_data: u128,
    /// Says whether the body sleeps.
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
    /// The region that owns the body; `None` for a fixed body, or where owners are not known.
    pub region: Option<RegionId>,
    /// The node that computes the region, as far as it is known; `None` in a local world.
    pub node: Option<NodeId>,
    /// Says whether the owner is not known yet: `region` is then the one in which the body lies.
    pub by_place: bool,
    /// The number of regions that hold a copy of the body; 0 where it is not known.
    pub holders: usize,
    /// Says whether this process computes the region.
    pub here: bool,
    /// Says whether this process receives the state of the body from other processes.
    pub heard: bool,
}

/// A region of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegionInfo {
    /// The id of the region.
    pub id: RegionId,
    /// The node that computes the region; `None` in a local world, and where it is not known.
    pub node: Option<NodeId>,
    /// The number of bodies that the region owns.
    pub owned: usize,
    /// The number of ghosts (copies of other regions' bodies) that the region holds; 0 where it is not known.
    pub ghosts: usize,
    /// The region's cell, a box in metres. Cells at the edge of the world reach to infinity.
    pub cell: Cell,
}

/// A change of the bodies of a served world: one appeared or was removed, or an input was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BodyChange {
    /// The body is in the world now.
    Appeared(BodyId),
    /// The body is no longer in the world. If it appears in the same step, the world went back to
    /// a save in which it has other properties, or in which another body has its id: look at it anew.
    Removed {
        /// The body.
        body: BodyId,
        /// Its user data, since it is gone.
        user_data: u128,
    },
    /// The server refused an input. If the avatar has not appeared yet, it never will.
    Refused {
        /// The avatar or body; `None` if the input concerns none.
        body: Option<BodyId>,
        /// The reason.
        why: Refusal,
        /// The user data of the avatar or body, since it may be gone; 0 if they are not known.
        user_data: u128,
    },
}
