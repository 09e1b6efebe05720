//! Between clients and their leader or the server.

use bincode::{Decode, Encode};

use super::{Chunk, EnvironmentProperties, Member, ViewNumber};
use crate::protocol::{BodyRecord, ContactForce, ShapeRecord, SharedState, Touch, Velocity, WorldPose};
use crate::space::{BodyId, ClientId, GroupId, Tick};

/// Client to leader, or to the server when there is none.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum FromClient {
    /// Moves an avatar.
    Drive(Drive),
    /// A new avatar.
    Spawn {
        /// Its id must be one of the client's own.
        body: BodyRecord,
        /// The shapes that its colliders name, as far as the world may not know them.
        shapes: Vec<ShapeRecord>,
    },
    /// The avatar disappears for good.
    Despawn(BodyId),
    /// The client goes; its avatars wait for its return.
    Leave,
}

/// Leader or server to client.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToClient {
    /// The server's answer to [`Hello`](super::Hello); chunks of the world follow, then [`ToClient::WorldEnd`].
    Welcome {
        /// The client's id.
        id: ClientId,
        /// Where its logical time begins: beyond all that an earlier process of the same client came to.
        logical_time: u64,
        /// The world.
        world: EnvironmentProperties,
    },
    /// Part of the world.
    Chunk(Chunk),
    /// The world is whole.
    WorldEnd,
    /// Who leads the group; `None` while nobody computes the world.
    LeaderIs {
        /// The client's group: states of others do not concern it.
        group: GroupId,
        /// Since which view.
        view: ViewNumber,
        /// Whom to connect to.
        leader: Option<Member>,
    },
    /// A body appeared after the client joined.
    Inserted {
        /// The body.
        body: BodyRecord,
        /// Shapes new to the world.
        shapes: Vec<ShapeRecord>,
    },
    /// A body disappeared.
    Removed(BodyId),
    /// Bodies that moved; fits a datagram.
    States {
        /// Of when and whose.
        stamp: Stamp,
        /// In id order.
        states: Vec<SharedState>,
    },
    /// Contacts of the client's own avatars, each pair once.
    Contacts {
        /// In which tick.
        tick: Tick,
        /// Beginnings and ends.
        touches: Vec<Touch>,
        /// Forces above a threshold.
        forces: Vec<ContactForce>,
    },
    /// A wish was refused.
    Rejected {
        /// Concerning which body.
        body: Option<BodyId>,
        /// Why.
        reason: Refusal,
    },
}

/// What states are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Stamp {
    /// The group that computed them: epochs and ticks of unlike groups do not compare.
    pub group: GroupId,
    /// After which tick.
    pub tick: Tick,
    /// Computed without the other members, and not to be relied on: the next that is not counts whatever its tick.
    pub provisional: bool,
}

/// Why a client's wish, or a join, was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, thiserror::Error)]
pub enum Refusal {
    /// Unequal protocol versions.
    #[error("protocol version {theirs} does not match the server's {ours}: install the same dcd on both")]
    Version {
        /// The joiner's.
        theirs: u32,
        /// The server's.
        ours: u32,
    },
    /// A body of somebody else.
    #[error("the body does not belong to this client: a client moves its own avatars only")]
    NotYours,
    /// The body is not in the world.
    #[error("no such body: spawn the avatar first")]
    Unknown,
    /// The body is there already.
    #[error("a body of this id exists: choose another index")]
    Exists,
    /// Above [`EnvironmentProperties::avatar_speed_limit`].
    #[error("faster than the world allows: stay below its avatar speed limit")]
    TooFast,
    /// A wish with a newer logical time was there before.
    #[error("older than the last update of this avatar: let the logical time grow")]
    Late,
    /// A collider names a shape that the world does not know.
    #[error("a collider names an unknown shape: send the shape with the body")]
    Shape,
    /// Too many bodies or updates at once.
    #[error("too many avatars or updates: fewer, or less often")]
    TooMany,
}

/// Where an avatar's user wants it to go.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Drive {
    /// Which avatar.
    pub body: BodyId,
    /// The user's clock: an older wish never overwrites a newer one.
    pub logical_time: u64,
    /// Wanted velocity.
    pub velocity: Velocity,
    /// Wanted pose, for a jump.
    pub pose: Option<WorldPose>,
}
