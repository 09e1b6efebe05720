//! The message set between server, nodes, leader and clients (thesis 4.3.2.9–10). Every message of a group carries the
//! [`ViewNumber`] it was written in, so that nothing of an earlier membership is ever taken for the present one.

use std::net::SocketAddr;

use bincode::{Decode, Encode};

use super::{
    BodyRecord, BodyState, BorderMessage, ContactForce, JointRecord, RegionEvents, ShapeRecord, SharedState,
    Touch, Velocity, WorldPose,
};
use crate::space::{Allocation, BodyId, ClientId, DistributionTree, Epoch, JointId, NodeId, RegionId, Tick};

/// The number of a group's membership. It grows with every join, leave and death; 0 is before the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode)]
pub struct ViewNumber(pub u64);

impl ViewNumber {
    /// The view after this one.
    pub const fn next(self) -> Self {
        Self(self.0 + 1)
    }
}

/// Anything that one process sends another: a frame holds exactly one.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Message {
    /// Node or client to server, first on every link.
    Hello(Hello),
    /// Server to node.
    ToNode(ToNode),
    /// Node to server.
    ToServer(ToServer),
    /// Leader to member: the barrier opens.
    Dispatch(Dispatch),
    /// Member to leader: the barrier is reached.
    Done(Done),
    /// Member to leader, at a rate: what moved.
    Report(Report),
    /// Member to member, once a round.
    Border(Border),
    /// Client to leader, or to the server when there is none; also in this envelope over a participant's node.
    FromClient(ClientId, FromClient),
    /// Leader or server to client; also in this envelope over a participant's node.
    ToClient(ClientId, ToClient),
    /// Asks for an echo.
    Ping(Ping),
    /// The echo.
    Pong(Pong),
}

/// How a message travels. Order holds within a lane only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lane {
    /// Reliable and ordered: membership, world, dispatch, clients' wishes.
    Control,
    /// Reliable and ordered: border messages of every tick.
    Border,
    /// Datagrams of at most [`DATAGRAM_BYTES`](super::DATAGRAM_BYTES): newest wins, loss is made up for by the next.
    State,
}

impl Message {
    /// The lane of this kind of message.
    pub const fn lane(&self) -> Lane {
        match self {
            Self::Border(_) => Lane::Border,
            Self::Ping(_) | Self::Pong(_) | Self::ToClient(_, ToClient::States { .. }) => Lane::State,
            _ => Lane::Control,
        }
    }
}

/// Who joins. Its id is that of its certificate; the runtime knows it as the peer of the link.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Hello {
    /// [`VERSION`](super::VERSION) of the sender.
    pub version: u32,
    /// As what it joins.
    pub role: Role,
}

/// As what a process joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Role {
    /// Computes regions.
    Node {
        /// Where other members and clients reach it.
        address: SocketAddr,
        /// The client in the same process, if it is a participant rather than a dedicated node.
        client: Option<ClientId>,
    },
    /// Hosts avatars.
    Client,
}

/// What everybody must know of a world (the thesis's `EnvironmentProperties`), sent whole on joining.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct EnvironmentProperties {
    /// Names the world among those of a server.
    pub world: u64,
    /// m/s².
    pub gravity: [f32; 3],
    /// Seconds a tick.
    pub dt_s: f32,
    /// Solver iterations a tick.
    pub solver_iterations: u32,
    /// How the world is cut into regions.
    pub tree: DistributionTree,
    /// How far beyond its box a region holds replicas, metres; `None`: by the size and speed of bodies.
    pub halo_m: Option<f64>,
    /// Name of the coupling.
    pub coupling: String,
    /// Exchanges a tick.
    pub exchanges: u32,
    /// The fastest that a client may ask its avatars to move, m/s.
    pub avatar_speed_limit: f32,
    /// How ticks are kept in step.
    pub protocol: SyncProtocol,
    /// How fast ticks follow one another.
    pub pace: Pace,
    /// The world ends after this tick; `None`: when it is told to.
    pub last_tick: Option<Tick>,
    /// The application's own.
    pub extension: Vec<u8>,
}

/// How the members of a group keep in step (thesis 4.3.2.10).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum SyncProtocol {
    /// The leader dispatches each tick and waits for all members.
    Synchronised,
}

/// How fast ticks follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Pace {
    /// One every `dt_s` of real time; a late tick is not made up for by more than one.
    RealTime,
    /// As soon as all members are ready.
    Unpaced,
}

/// A node of a group.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Member {
    /// Which.
    pub node: NodeId,
    /// Where it is reached.
    pub address: SocketAddr,
    /// The client in its process, if any.
    pub client: Option<ClientId>,
}

/// A membership: who computes what from `tick` on.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct View {
    /// Its number.
    pub number: ViewNumber,
    /// The last tick before it; the leader dispatches the next.
    pub tick: Tick,
    /// Who leads; one of the members.
    pub leader: NodeId,
    /// In id order.
    pub members: Vec<Member>,
    /// Which member computes each region.
    pub allocation: Allocation,
}

/// A body and the region that owns it from the coming view on.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Placed {
    /// The owner.
    pub region: RegionId,
    /// The body, whole, at its new epoch.
    pub body: BodyRecord,
}

/// A part of a world too large for one message; at most [`CHUNK_BYTES`](super::CHUNK_BYTES) but for a single large item.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Chunk {
    /// Shapes, each before the bodies and compounds that name it.
    Shapes(Vec<ShapeRecord>),
    /// To nodes: immovable bodies, known to every node from the start. To clients: every body.
    Bodies(Vec<BodyRecord>),
    /// Bodies that change node in the coming view.
    Placed(Vec<Placed>),
    /// Joints of these bodies.
    Joints(Vec<JointRecord>),
}

/// Server to node.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToNode {
    /// Answer to [`Hello`]; chunks of shapes and immovable bodies follow, then [`ToNode::WorldEnd`].
    Welcome {
        /// The node's id.
        id: NodeId,
        /// The world.
        world: EnvironmentProperties,
    },
    /// Part of a world, before [`ToNode::WorldEnd`] or [`ToNode::Adopt`].
    Chunk(Chunk),
    /// The node has all it needs to take regions; it answers [`ToServer::Loaded`].
    WorldEnd,
    /// A view change begins: start no further tick, answer [`ToServer::Settling`].
    Settle {
        /// The view to come.
        view: ViewNumber,
    },
    /// Complete this tick, waiting for survivors only; then answer [`ToServer::Survey`].
    Finish {
        /// The view to come.
        view: ViewNumber,
        /// The newest dispatch that any survivor knows of in the present view.
        dispatch: Option<Dispatch>,
        /// Who still answers, in id order.
        survivors: Vec<NodeId>,
    },
    /// Send these bodies whole, owned or replica, as far as held; answered by [`ToServer::Found`].
    Fetch {
        /// The view to come.
        view: ViewNumber,
        /// In id order.
        bodies: Vec<BodyId>,
    },
    /// The view begins, with the [`Placed`] bodies sent before it.
    Adopt {
        /// Who computes what.
        view: View,
        /// Bodies to let go of: removed ones, and those that another member owns at a higher epoch.
        drop: Vec<BodyId>,
    },
    /// To the leader: put these into the next dispatch. Already on record, so they outlive the leader.
    Apply {
        /// The present view.
        view: ViewNumber,
        /// In order.
        ops: Vec<WorldOp>,
    },
    /// Stop: the world ends, the node's leave is granted, or it was evicted.
    Shutdown {
        /// For people.
        reason: String,
    },
}

/// Node to server.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToServer {
    /// The world has been received: regions may be given to this node.
    Loaded,
    /// Answer to [`ToNode::Settle`].
    Settling {
        /// The view to come.
        view: ViewNumber,
        /// The newest dispatch received in the present view.
        dispatch: Option<Dispatch>,
    },
    /// Answer to [`ToNode::Finish`]: what the node owns after its last tick.
    Survey {
        /// The view to come.
        view: ViewNumber,
        /// The last completed tick.
        tick: Tick,
        /// Every owned body, in id order.
        claims: Vec<Claim>,
    },
    /// Answer to [`ToNode::Fetch`]; several, the last one marked.
    Found {
        /// The view to come.
        view: ViewNumber,
        /// In id order.
        bodies: Vec<BodyRecord>,
        /// Whether no more follow.
        last: bool,
    },
    /// Bodies that moved since the last checkpoint, several times a second.
    Checkpoint {
        /// The present view.
        view: ViewNumber,
        /// After which tick.
        tick: Tick,
        /// In id order.
        bodies: Vec<BodyCheckpoint>,
    },
    /// Bodies that this node owned and removed by a [`WorldOp::Remove`], as they were last.
    Removed {
        /// The present view.
        view: ViewNumber,
        /// After which tick.
        tick: Tick,
        /// In id order.
        bodies: Vec<BodyRecord>,
    },
    /// Another member cannot be reached.
    LinkLost {
        /// The present view.
        view: ViewNumber,
        /// Who.
        node: NodeId,
    },
    /// The node wishes to go; its regions are handed over first, then it is told to shut down.
    Leave,
}

/// One owned body in a survey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Claim {
    /// Which body.
    pub id: BodyId,
    /// At which epoch.
    pub epoch: Epoch,
    /// Which of the node's regions owns it.
    pub region: RegionId,
}

/// What a checkpoint keeps of a body.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct BodyCheckpoint {
    /// Which body.
    pub id: BodyId,
    /// Of its owner.
    pub epoch: Epoch,
    /// What steps changed.
    pub state: BodyState,
}

/// The leader's word that a tick may be computed.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Dispatch {
    /// In which view.
    pub view: ViewNumber,
    /// Which tick.
    pub tick: Tick,
    /// What happens to the world before it, in order.
    pub ops: Vec<WorldOp>,
}

/// A change of the world from outside, applied by every member at the start of a tick to what it holds.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum WorldOp {
    /// A body appears; the region at its place owns it.
    Insert {
        /// The body.
        body: BodyRecord,
        /// Shapes that are new to the group.
        shapes: Vec<ShapeRecord>,
        /// Joints to bodies that exist by then.
        joints: Vec<JointRecord>,
    },
    /// A body disappears, with its joints.
    Remove(BodyId),
    /// A joint disappears.
    RemoveJoint(JointId),
    /// An avatar's user moves it.
    Drive(Drive),
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

/// A member has completed a tick.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Done {
    /// In which view.
    pub view: ViewNumber,
    /// Which tick; the tick of the view itself when the member is ready to begin.
    pub tick: Tick,
    /// What it cost.
    pub stats: TickStats,
    /// Contacts of avatars.
    pub events: Vec<RegionEvents>,
}

/// What a tick cost one member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct TickStats {
    /// Bodies owned.
    pub bodies: u32,
    /// Replicas held.
    pub replicas: u32,
    /// Contact pairs.
    pub contacts: u32,
    /// Bodies that left for another region.
    pub transfers: u32,
    /// Microseconds of computing.
    pub compute_us: u32,
    /// Hash of the states of all owned bodies in id order, if asked for.
    pub state_hash: Option<u64>,
}

/// Bodies that moved since the member's last report.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Report {
    /// In which view.
    pub view: ViewNumber,
    /// After which tick.
    pub tick: Tick,
    /// In id order.
    pub states: Vec<SharedState>,
}

/// Everything that one member's regions have to say to another's in one round; sent even when empty.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Border {
    /// In which view.
    pub view: ViewNumber,
    /// Of which tick.
    pub tick: Tick,
    /// Which exchange of the tick, from 0.
    pub round: u32,
    /// In order of (from, to).
    pub messages: Vec<BorderMessage>,
}

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
    /// The server's answer to [`Hello`]; chunks of the world follow, then [`ToClient::WorldEnd`].
    Welcome {
        /// The client's id.
        id: ClientId,
        /// The world.
        world: EnvironmentProperties,
    },
    /// Part of the world.
    Chunk(Chunk),
    /// The world is whole.
    WorldEnd,
    /// Who leads the group; `None` while nobody computes the world.
    LeaderIs {
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
        /// After which tick.
        tick: Tick,
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

/// A question for the time, microseconds of the sender's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Ping {
    /// When it was sent.
    pub sent_us: u64,
}

/// The answer: four time stamps with the asker's time of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Pong {
    /// Of the ping, by the asker's clock.
    pub sent_us: u64,
    /// Its arrival, by the answerer's clock.
    pub received_us: u64,
    /// When this was sent, by the answerer's clock.
    pub answered_us: u64,
}
