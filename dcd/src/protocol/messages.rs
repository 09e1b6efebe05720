//! Defines the message set between server, nodes, leader and clients (thesis 4.3.2.9–10). Every message of a group carries the
//! [`ViewNumber`] it was written in, so that nothing of an earlier membership is ever taken for the present one.

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

/// Any message that one process sends another: a frame holds exactly one.
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
    /// Member to leader, at a rate: bodies that moved.
    Report(Report),
    /// Member to member, once per round, if they compute neighbours.
    Border(Border),
    /// Member to member, at a rate: the sender waits for others in this view, and is not the one who hangs.
    Waiting(ViewNumber),
    /// Client to leader, or to the server when there is none; also in this envelope over a participant's node.
    FromClient(ClientId, FromClient),
    /// Leader or server to client; also in this envelope over a participant's node.
    ToClient(ClientId, ToClient),
    /// Asks for an echo.
    Ping(Ping),
    /// The echo.
    Pong(Pong),
    /// Any process to the server: asks for the status of its world.
    AskStatus,
    /// The answer.
    Status(Status),
    /// Program to program, over a link between a server and another process.
    Program(Program),
    /// Member to leader, before it says that a tick is done, where participants are verified: what it has taken in.
    Testimony(Testimony),
    /// The same: what it told a participant whose regions the leader computes once more.
    Copied {
        /// Which participant.
        to: NodeId,
        /// What it told it.
        border: Border,
    },
    /// Leader to member: it tells some of the clients in the leader's place.
    Relay(ToRelay),
    /// Member to leader: a client that is expected there has a link, or has none any more.
    Linked {
        /// The present view.
        view: ViewNumber,
        /// Which client.
        client: ClientId,
        /// Whether it has one.
        up: bool,
    },
    /// Relay to leader: it has taken in what it was told, up to what has this number.
    Fed {
        /// The present view.
        view: ViewNumber,
        /// The number.
        number: u64,
    },
}

/// What a message is about, to say what links carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// Poses and velocities of bodies that move.
    States,
    /// What leaders tell relays, so that these tell clients states.
    Feeds,
    /// What bodies and joints are: when a process joins, and when they appear, change or go.
    Bodies,
    /// Beginnings, ends and forces of contacts.
    Contacts,
    /// Answers to questions.
    Answers,
    /// Who computes which regions, and who leads.
    Regions,
    /// Pings and their echoes.
    Pings,
    /// What programs tell one another.
    Programs,
    /// Bodies near borders, as nodes tell each other.
    Borders,
    /// How a group of nodes keeps in step: dispatches, and what members say of their ticks.
    Ticks,
    /// Greetings, refusals, and what nodes tell one another.
    Rest,
}

impl Subject {
    /// All of them.
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

    /// Returns its name.
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

/// The lane on which a message travels: reliable or datagram. Order holds within a lane only, and a dispatch or a border message may come
/// once more in a datagram, before or after what was sent with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lane {
    /// Reliable and ordered: membership, world, dispatch, clients' inputs.
    Control,
    /// Reliable and ordered: border messages of every tick.
    Border,
    /// Datagrams of at most [`DATAGRAM_BYTES`](super::DATAGRAM_BYTES): newest wins, loss is made up for by the next.
    State,
}

impl Message {
    /// Returns what it is about.
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

/// The first message of a process that joins. Its id is that of its certificate; the runtime knows it as the peer of the link.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Hello {
    /// [`VERSION`](super::VERSION) of the sender.
    pub version: u32,
    /// As what it joins.
    pub role: JoinAs,
}

/// The role in which a process joins.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub enum JoinAs {
    /// Computes regions.
    Node {
        /// Where other members and clients reach it.
        address: SocketAddr,
        /// The client in the same process, if it is a participant rather than a dedicated node.
        client: Option<ClientId>,
        /// The view that it is computing, if its link broke and it calls again; else it begins anew.
        resume: Option<ViewNumber>,
        /// If it leads that view: how many of the server's operations that move bodies it has heard in it.
        heard: u64,
    },
    /// Hosts avatars.
    Client {
        /// The area that it wants to be told of; `None`: the whole world. An own avatar is told wherever it is.
        interest: Option<Area>,
    },
}

/// The properties of a world that every process must know (the thesis's `EnvironmentProperties`), sent whole on joining.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct EnvironmentProperties {
    /// Names the world among those of a server.
    pub world: u64,
    /// How it is stepped.
    pub step: StepRecord,
    /// How the world is cut into regions at first.
    pub tree: DistributionTree,
    /// How the regions follow the load from then on; `None`: they stay.
    pub balance: Option<Balance>,
    /// How much of it is computed in full.
    pub fidelity: Fidelity,
    /// Where it is looked at from, beside what clients look at.
    pub viewpoints: Vec<Viewpoint>,
    /// How far beyond its box a region holds replicas, metres; `None`: by the size and speed of bodies.
    pub halo_m: Option<f64>,
    /// The fastest that a client may ask its avatars to move, m/s.
    pub avatar_speed_limit: f32,
    /// How ticks are kept in step.
    pub protocol: SyncProtocol,
    /// Thresholds of delay and distance.
    pub thresholds: Thresholds,
    /// The pace of ticks.
    pub pace: Pace,
    /// Ticks from one state of a body that clients are told to the next.
    pub state_every: u32,
    /// The world ends after this tick; `None`: when it is told to.
    pub last_tick: Option<Tick>,
    /// The clients that a leader tells itself while there are members that may relay for the others; `None`: all.
    pub relays_above: Option<u32>,
}

/// The protocol by which the members of a group keep in step (thesis 4.3.2.10).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum SyncProtocol {
    /// The leader dispatches each tick and waits for all members.
    Synchronised,
    /// Members run on for so many ticks without hearing from one another, and extrapolate bodies that others own: a message
    /// written after one tick is applied so many ticks later, by all alike, so that cause still comes before effect. For links
    /// whose delay is longer than a tick; with the coupling `owner`.
    Unsynchronised {
        /// At least the longest round trip among members, at most [`MAX_LAG`](super::MAX_LAG).
        lag_ticks: u32,
    },
}

impl SyncProtocol {
    /// Returns after how many ticks messages of others are applied.
    pub const fn lag_ticks(self) -> u64 {
        match self {
            Self::Synchronised => 0,
            Self::Unsynchronised { lag_ticks } => lag_ticks as u64,
        }
    }
}

/// Thresholds of delay and distance (thesis 3.3.7–3.3.9).
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Thresholds {
    /// Delays at which nodes join and leave groups; `None`: all that reach each other are one group.
    pub delay: Option<DelayThresholds>,
    /// How far an avatar may be from its dead-reckoned position before an update is sent, metres; 0: always sent.
    pub dead_reckoning_m: f32,
    /// How far a body of one group may be from its position in the group that is authoritative for it, metres.
    pub between_groups_m: f32,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self { delay: None, dead_reckoning_m: 0.0, between_groups_m: 0.1 }
    }
}

/// Delays at which nodes join and leave groups: round trips, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct DelayThresholds {
    /// Below it a node is wanted; below `rejection_ms`.
    pub inclusion_ms: f32,
    /// Above it a member is not wanted any more.
    pub rejection_ms: f32,
    /// How much the latest delay may be above `rejection_ms` while the average is below it.
    pub deviation_ms: f32,
}

/// The pace at which ticks follow one another.
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

/// A membership view of a group: which member computes which regions from `tick` on.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct View {
    /// Of which group.
    pub group: GroupId,
    /// Its number.
    pub number: ViewNumber,
    /// The last tick before it; the leader dispatches the next.
    pub tick: Tick,
    /// Who leads; one of the members.
    pub leader: NodeId,
    /// In id order.
    pub members: Vec<Member>,
    /// The tree of the world's regions; it may change within the view.
    pub tree: DistributionTree,
    /// Which member computes each region.
    pub allocation: Allocation,
    /// Whether the server's program hears of the contacts of all bodies that ask for them; else clients do of their own.
    pub events: bool,
    /// Where the world is looked at from, whoever is there, until [`ToNode::Look`] says otherwise.
    pub viewpoints: Vec<Viewpoint>,
}

impl View {
    /// Returns the leader: the member that opens each tick.
    pub fn led_by(&self) -> Option<&Member> {
        self.members.iter().find(|member| member.node == self.leader)
    }

    /// Changes tree and allocation, or neither if the tree cannot be changed so.
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

/// A clock probe, microseconds of the sender's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Ping {
    /// When it was sent.
    pub sent_us: u64,
}

/// The answer to a clock probe: four time stamps with the asker's time of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Pong {
    /// Of the ping, by the asker's clock.
    pub sent_us: u64,
    /// Its arrival, by the answerer's clock.
    pub received_us: u64,
    /// When this was sent, by the answerer's clock.
    pub answered_us: u64,
}
