//! Defines the message set between server, nodes, leader and clients (thesis 4.3.2.9–10). Every message of a
//! group carries the [`ViewNumber`] in which it was written, so that nothing of an earlier membership is
//! taken for the present one.

mod build;
mod client;
mod group;
mod program;
mod query;
mod relay;
mod status;
mod verify;

use std::net::SocketAddr;

use bincode::{Decode, Encode};

use super::{BodyRecord, JointRecord, ShapeRecord, StepRecord};
use crate::fidelity::Fidelity;
use crate::space::{
    Allocation, Balance, ClientId, DistributionTree, GroupId, NodeId, RegionId, Tick, TreeError, Viewpoint,
};

pub(crate) use build::BUILD_BYTES;
pub use build::{BuildOp, MAX_BUILD_OPS};
pub use client::{
    Area, Costs, FromClient, Heard, Input, MAX_HEARD, MAX_INTRODUCED, Part, Refusal, Stamp, ToClient,
};
pub use group::{
    BodyCheckpoint, Border, Claim, Delay, Dispatch, Done, Farewell, LoadReport, Motion, Push, RegionLoad,
    Repartition, Report, Stance, ToNode, ToServer, Watch, WorldOp,
};
pub use program::Program;
pub use query::{
    Answer, CastAnswer, CastQuery, FilterRecord, MAX_COST, MAX_FOUND, MAX_OPEN_COST, MAX_OPEN_QUERIES,
    MAX_QUERY_BYTES, MAX_TURN, MAX_TURNING_M, OVERLAPS_COST, Overlap, OverlapQuery, PartFilter, Place, Query,
    QueryParts, QueryResult, RayAnswer, RayQuery, SHAPE_COST,
};
pub use relay::{RelayNews, ToRelay};
pub use status::{GroupStatus, NodeStatus, RegionStatus, Status};
pub use verify::{Finding, HeardBorder, Hindrance, Testimony, Verified};

/// The number of a group's membership. It grows with every join, leave and death; 0 is before the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode)]
pub struct ViewNumber(pub u64);

impl ViewNumber {
    /// Returns the number of the next view.
    pub const fn next(self) -> Self {
        Self(self.0 + 1)
    }
}

/// A message that one process sends another. A frame holds exactly one.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Message {
    /// Node or client to server: the first message on every link.
    Hello(Hello),
    /// Server to node.
    ToNode(ToNode),
    /// Node to server.
    ToServer(ToServer),
    /// Leader to member: permission to compute a tick (the barrier opens).
    Dispatch(Dispatch),
    /// Member to leader: a tick is completed (the barrier is reached).
    Done(Done),
    /// Member to leader, at a rate: bodies that moved.
    Report(Report),
    /// Member to member, once per round, if they compute neighbouring regions: border messages.
    Border(Border),
    /// Member to member, at a rate: the sender waits for others in this view, and does not hang itself.
    Waiting(ViewNumber),
    /// Client to leader, or to the server if there is no leader. A participant's node forwards it in this
    /// envelope too.
    FromClient(ClientId, FromClient),
    /// Leader or server to client. A participant's node forwards it in this envelope too.
    ToClient(ClientId, ToClient),
    /// Any process to another: asks for an echo.
    Ping(Ping),
    /// The echo of a ping.
    Pong(Pong),
    /// Any process to the server: asks for the status of its world.
    AskStatus,
    /// Server to process: the status that was asked for.
    Status(Status),
    /// Program to program, over a link between a server and another process.
    Program(Program),
    /// Member to leader, if participants are verified, before it says that a tick is done: what it has taken
    /// in.
    Testimony(Testimony),
    /// Member to leader, if participants are verified: what it told a participant whose regions the leader
    /// computes once more.
    Copied {
        /// The participant.
        to: NodeId,
        /// The border message that was sent to it.
        border: Border,
    },
    /// Leader to member: the member is to tell some of the clients in the leader's place.
    Relay(ToRelay),
    /// Member to leader: a client that is expected at the member now has a link there, or no longer.
    Linked {
        /// The present view.
        view: ViewNumber,
        /// The client.
        client: ClientId,
        /// Says whether it has a link.
        up: bool,
    },
    /// Relay to leader: the relay has taken in what it was told, up to the message of this number.
    Fed {
        /// The present view.
        view: ViewNumber,
        /// The number of the message.
        number: u64,
    },
}

/// The subject of a message, by which traffic is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// Poses and velocities of bodies that move.
    States,
    /// What leaders tell relays, so that relays tell clients states.
    Feeds,
    /// The definitions of bodies and joints: when a process joins, and when they appear, change or go.
    Bodies,
    /// Beginnings, ends and forces of contacts.
    Contacts,
    /// Answers to queries.
    Answers,
    /// Who computes which regions, and who leads.
    Regions,
    /// Pings and their echoes.
    Pings,
    /// What programs tell one another.
    Programs,
    /// Bodies near borders, as nodes tell each other.
    Borders,
    /// How a group of nodes keeps in step: dispatches, and members' reports of their ticks.
    Ticks,
    /// Greetings, refusals, and messages of no other subject.
    Rest,
}

impl Subject {
    /// All subjects, in order.
    pub const ALL: [Self; 11] = [
        Self::States,
        Self::Feeds,
        Self::Bodies,
        Self::Contacts,
        Self::Answers,
        Self::Regions,
        Self::Pings,
        Self::Programs,
        Self::Borders,
        Self::Ticks,
        Self::Rest,
    ];

    /// Returns the name of the subject.
    pub const fn name(self) -> &'static str {
        match self {
            Self::States => "states",
            Self::Feeds => "feeds",
            Self::Bodies => "bodies",
            Self::Contacts => "contacts",
            Self::Answers => "answers",
            Self::Regions => "regions",
            Self::Pings => "pings",
            Self::Programs => "programs",
            Self::Borders => "borders",
            Self::Ticks => "ticks",
            Self::Rest => "rest",
        }
    }
}

/// The lane on which a message travels, reliable or as a datagram. Order holds within a lane only. A dispatch
/// or a border message may arrive once more in a datagram, before or after what was sent with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lane {
    /// Reliable and ordered: membership, world, dispatches, inputs of clients.
    Control,
    /// Reliable and ordered: border messages of every tick.
    Border,
    /// Datagrams of at most [`DATAGRAM_BYTES`](super::DATAGRAM_BYTES). The newest wins; the next one makes up
    /// for a lost one.
    State,
}

impl Message {
    /// Returns the subject of the message.
    pub const fn subject(&self) -> Subject {
        match self {
            Self::ToClient(_, to_client) => match to_client {
                ToClient::States { .. } | ToClient::CompactStates { .. } => Subject::States,
                ToClient::Chunk(_)
                | ToClient::WorldEnd
                | ToClient::Inserted { .. }
                | ToClient::Removed(_)
                | ToClient::Altered(_)
                | ToClient::JointRemoved(_)
                | ToClient::ShapesGone(_) => Subject::Bodies,
                ToClient::Contacts { .. } => Subject::Contacts,
                ToClient::Answer { .. } => Subject::Answers,
                ToClient::LeaderIs { .. } | ToClient::Regions { .. } | ToClient::ToldBy(_) => {
                    Subject::Regions
                }
                ToClient::Welcome { .. } | ToClient::Rejected { .. } | ToClient::Built(_) => Subject::Rest,
            },
            Self::Relay(ToRelay::News(_) | ToRelay::Guess { .. }) | Self::Fed { .. } => Subject::Feeds,
            Self::Ping(_) | Self::Pong(_) => Subject::Pings,
            Self::Program(_) => Subject::Programs,
            Self::Border(_) | Self::Copied { .. } => Subject::Borders,
            Self::Dispatch(_) | Self::Done(_) | Self::Report(_) | Self::Waiting(_) | Self::Testimony(_) => {
                Subject::Ticks
            }
            _ => Subject::Rest,
        }
    }

    /// Returns the lane of this kind of message.
    pub const fn lane(&self) -> Lane {
        match self {
            Self::Border(_) => Lane::Border,
            Self::Ping(_)
            | Self::Pong(_)
            | Self::ToClient(_, ToClient::States { .. } | ToClient::CompactStates { .. })
            | Self::FromClient(_, FromClient::Heard(_))
            | Self::Program(Program::Datagram(_))
            | Self::ToServer(ToServer::InterGroup { .. })
            | Self::ToNode(ToNode::InterGroup { .. }) => Lane::State,
            _ => Lane::Control,
        }
    }
}

/// The first message of a process that joins. Its id is that of its certificate, which the runtime knows from
/// the link.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Hello {
    /// The sender's [`VERSION`](super::VERSION).
    pub version: u32,
    /// The role in which it joins.
    pub role: JoinAs,
}

/// The role in which a process joins.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub enum JoinAs {
    /// A node, which computes regions.
    Node {
        /// The address at which other members and clients reach it.
        address: SocketAddr,
        /// The client in the same process, if it is a participant and not a dedicated node.
        client: Option<ClientId>,
        /// The view that it is computing, if its link broke and it calls again; `None` if it begins anew.
        resume: Option<ViewNumber>,
        /// The number of the server's operations on moving bodies that it has heard in that view, if it leads
        /// the view.
        heard: u64,
    },
    /// A client, which hosts avatars.
    Client {
        /// The area that it wants to be told of; `None` for the whole world. Its own avatars are told of
        /// wherever they are.
        interest: Option<Area>,
    },
}

/// The properties of a world that every process must know (the thesis's `EnvironmentProperties`), sent whole
/// when a process joins.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct EnvironmentProperties {
    /// The name of the world among those of a server.
    pub world: u64,
    /// How the world is stepped.
    pub step: StepRecord,
    /// How the world is cut into regions at first.
    pub tree: DistributionTree,
    /// How the regions follow the load from then on; `None` if they stay.
    pub balance: Option<Balance>,
    /// How much of the world is computed in full.
    pub fidelity: Fidelity,
    /// The viewpoints from which the world is looked at, besides what clients look at.
    pub viewpoints: Vec<Viewpoint>,
    /// How far beyond its cell a region holds ghosts, metres; `None` if that follows from the size and speed
    /// of bodies.
    pub halo_m: Option<f64>,
    /// The highest speed at which a client may ask its avatars to move, m/s.
    pub avatar_speed_limit: f32,
    /// The protocol by which ticks are kept in step.
    pub protocol: SyncProtocol,
    /// The thresholds of delay and distance.
    pub thresholds: Thresholds,
    /// The pace of ticks.
    pub pace: Pace,
    /// The ticks between two states of a body that clients are told.
    pub state_every: u32,
    /// The tick after which the world ends; `None` if it ends when it is told to.
    pub last_tick: Option<Tick>,
    /// The number of clients that a leader tells itself while members may relay for the others; `None` for
    /// all.
    pub relays_above: Option<u32>,
}

/// The protocol by which the members of a group keep in step (thesis 4.3.2.10).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum SyncProtocol {
    /// The leader dispatches each tick and waits for all members.
    Synchronised,
    /// Members run on for `lag_ticks` ticks without hearing from one another, and extrapolate bodies that
    /// others own. A message that was written after one tick is applied that many ticks later, by all members
    /// alike, so that cause still comes before effect. For links whose delay is longer than a tick, with the
    /// coupling `owner`.
    Unsynchronised {
        /// The number of ticks: at least the longest round trip among members, at most
        /// [`MAX_LAG`](super::MAX_LAG).
        lag_ticks: u32,
    },
}

impl SyncProtocol {
    /// Returns the number of ticks after which messages of others are applied.
    pub const fn lag_ticks(self) -> u64 {
        match self {
            Self::Synchronised => 0,
            Self::Unsynchronised { lag_ticks } => lag_ticks as u64,
        }
    }
}

/// The thresholds of delay and distance of consistency groups (thesis 3.3.7–3.3.9).
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Thresholds {
    /// The delays at which nodes join and leave groups. `None`: all nodes that reach each other form one
    /// group.
    pub delay: Option<DelayThresholds>,
    /// The largest distance of an avatar from its dead-reckoned position without an update being sent,
    /// metres; 0: always sent.
    pub dead_reckoning_m: f32,
    /// The largest distance of a body in one group from its position in the group that is authoritative for
    /// it, metres.
    pub between_groups_m: f32,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self { delay: None, dead_reckoning_m: 0.0, between_groups_m: 0.1 }
    }
}

/// The delays at which nodes join and leave groups, as round trips in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct DelayThresholds {
    /// Below this delay a node is wanted in the group; less than `rejection_ms`.
    pub inclusion_ms: f32,
    /// Above this delay a member is not wanted any more.
    pub rejection_ms: f32,
    /// The amount by which the latest delay may exceed `rejection_ms` while the average is below it.
    pub deviation_ms: f32,
}

/// The pace at which ticks follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Pace {
    /// One tick per `dt_s` of real time. At most one late tick is made up for.
    RealTime,
    /// A tick as soon as all members are ready.
    Unpaced,
}

/// A node that is a member of a group.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Member {
    /// The node.
    pub node: NodeId,
    /// The address at which it is reached.
    pub address: SocketAddr,
    /// The client in its process, if there is one.
    pub client: Option<ClientId>,
}

/// A view, that is a numbered membership of a group: which member computes which regions from `tick` on.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct View {
    /// The group.
    pub group: GroupId,
    /// The number of the view.
    pub number: ViewNumber,
    /// The last tick before the view. The leader dispatches the next one.
    pub tick: Tick,
    /// The leader, one of the members.
    pub leader: NodeId,
    /// The members, in id order.
    pub members: Vec<Member>,
    /// The tree of the world's regions, which may change within the view.
    pub tree: DistributionTree,
    /// The member that computes each region.
    pub allocation: Allocation,
    /// Says whether the server's program hears of the contacts of all bodies that ask for them; otherwise clients
    /// hear of those of their own bodies.
    pub events: bool,
    /// The viewpoints of the server's program, whoever else looks, until [`ToNode::Look`] changes them.
    pub viewpoints: Vec<Viewpoint>,
}

impl View {
    /// Returns the leader: the member that opens each tick.
    pub fn led_by(&self) -> Option<&Member> {
        self.members.iter().find(|member| member.node == self.leader)
    }

    /// Changes tree and allocation, or neither of them if the tree cannot be changed so.
    pub fn repartition(&mut self, repartition: &Repartition) -> Result<(), TreeError> {
        let mut tree = self.tree.clone();
        tree.change(&repartition.changes)?;
        repartition.reallocate(&mut self.allocation, &self.tree);
        self.tree = tree;
        Ok(())
    }
}

/// A body together with the region that owns it from the coming view on.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Placed {
    /// The region that owns it.
    pub region: RegionId,
    /// The body, whole, at its new epoch.
    pub body: BodyRecord,
}

/// A part of a world that is too large for one message: at most [`CHUNK_BYTES`](super::CHUNK_BYTES), except
/// for a single larger item.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Chunk {
    /// Shapes. Each comes before the bodies and compounds that name it.
    Shapes(Vec<ShapeRecord>),
    /// To nodes: immovable bodies, which every node knows from the start. To clients: all bodies.
    Bodies(Vec<BodyRecord>),
    /// Bodies that change node in the coming view.
    Placed(Vec<Placed>),
    /// Joints of these bodies.
    Joints(Vec<JointRecord>),
}

/// A clock probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Ping {
    /// The time of sending, microseconds of the sender's clock.
    pub sent_us: u64,
}

/// The answer to a clock probe. Together with the time at which it arrives, it gives four time stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Pong {
    /// The time at which the ping was sent, microseconds of the asker's clock.
    pub sent_us: u64,
    /// The time at which the ping arrived, microseconds of the answerer's clock.
    pub received_us: u64,
    /// The time at which this answer was sent, microseconds of the answerer's clock.
    pub answered_us: u64,
}
