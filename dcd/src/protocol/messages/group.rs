//! Defines the messages between the server and the nodes of a group, and among those nodes.

use bincode::{Decode, Encode};

use super::{
    Answer, Area, Chunk, EnvironmentProperties, Finding, Input, Member, Query, QueryResult, Verified, View,
    ViewNumber,
};
use crate::fidelity::{FidelityReport, RegionState, Schedule};
use crate::protocol::{
    Alteration, BodyRecord, BodyState, BorderMessage, JointRecord, RegionEvents, ShapeHash, ShapeRecord,
    SharedState, WorldEvents,
};
use crate::space::{
    Allocation, BodyId, Bounds, Burden, ClientId, DistributionTree, Epoch, JointId, NodeId, RegionId,
    Renaming, Tick, TreeChange, Viewpoint,
};

/// A message of the server to a node.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToNode {
    /// Answer to [`Hello`](super::Hello); chunks of shapes and immovable bodies follow, then [`ToNode::WorldEnd`].
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
    /// Complete these ticks, waiting for survivors only; then answer [`ToServer::Survey`]. Several, the last one marked.
    Finish {
        /// The view to come.
        view: ViewNumber,
        /// Together all dispatches of the present view that some survivor may not have completed, in order.
        dispatches: Vec<Dispatch>,
        /// Who still answers, in id order.
        survivors: Vec<NodeId>,
        /// Whether no more follow.
        last: bool,
    },
    /// Send these bodies whole, owned or replica, as far as held; answered by [`ToServer::Found`].
    Fetch {
        /// The view to come.
        view: ViewNumber,
        /// In id order.
        bodies: Vec<BodyId>,
    },
    /// The view begins, with the [`Placed`](super::Placed) bodies sent before it.
    Adopt {
        /// Members, leader and allocation.
        view: View,
        /// Bodies to let go of: removed ones, and those that another member owns at a higher epoch.
        drop: Vec<BodyId>,
    },
    /// To the leader: put these into the next dispatch. Already on record, so they outlive the leader.
    Apply {
        /// The present view.
        view: ViewNumber,
        /// The number in the view of the first of them that moves a body, of those that do.
        first: u64,
        /// In order.
        ops: Vec<WorldOp>,
    },
    /// All nodes of the server: each is linked with each, so that delays are known before they matter.
    Roster(Vec<Member>),
    /// A vote on which this member is asked; answered by [`ToServer::Ballot`].
    Poll {
        /// Names the vote.
        poll: u64,
        /// What about.
        motion: Motion,
    },
    /// To the leader: a query of the server's program, answered by [`ToServer::Answer`].
    Ask {
        /// The present view.
        view: ViewNumber,
        /// What it asks.
        question: Query,
    },
    /// To the leader: the server's program looks at the world from these places from now on, and from no others. A view to come says it itself.
    Look {
        /// The present view.
        view: ViewNumber,
        /// From where.
        viewpoints: Vec<Viewpoint>,
    },
    /// To the leader of a group, from other groups: state replication of bodies for which those are authoritative. Newest wins.
    InterGroup {
        /// The present view of the receiver.
        view: ViewNumber,
        /// Whether they come from the main group, to whose ticks the others keep up.
        main: bool,
        /// The tick after which these states held.
        tick: Tick,
        /// In id order, in the compact form of `delta::alone`.
        states: Vec<u8>,
    },
    /// To the leader of a group: for which bodies its group is authoritative from now on.
    Authority {
        /// The present view of the receiver.
        view: ViewNumber,
        /// Whether there is no other group.
        alone: bool,
        /// Whether the receiver's group is authoritative for persistent bodies that no stance is on.
        by_default: bool,
        /// New stances, in id order.
        stances: Vec<Stance>,
    },
    /// Before [`ToNode::Adopt`], where participants are verified: say to the leader what you take in, and what you tell these. To the leader:
    /// compute once more what these compute.
    Verify {
        /// The view to come.
        view: ViewNumber,
        /// In id order.
        nodes: Vec<Verified>,
        /// Participants that have computed before keep nothing of that: all that they begin with is placed with the view.
        anew: bool,
    },
    /// Stop.
    Shutdown {
        /// Why.
        farewell: Farewell,
        /// The reason in words, for people.
        reason: String,
    },
}

/// The reason why the server removes a process from its world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Farewell {
    /// A node has handed its share over, and leaves: it asked to, or an operator drained it.
    Left,
    /// The server's user does not want it any longer.
    SentAway,
    /// It has another version, or is not what it claims to be.
    Refused,
    /// The world ends.
    Ended,
}

/// A message of a node to the server.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToServer {
    /// The world has been received: the node can be given regions.
    Loaded,
    /// Answer to [`ToNode::Settle`]; several, the last one marked.
    Settling {
        /// The view to come.
        view: ViewNumber,
        /// Dispatches received in the present view that another member may not have completed, in order.
        dispatches: Vec<Dispatch>,
        /// From the leader: what the server's program did to moving bodies and no tick has done yet. The leader to come does it.
        undone: Vec<WorldOp>,
        /// Whether no more follow.
        last: bool,
    },
    /// Answer to [`ToNode::Finish`]: the bodies that the node owns after its last tick.
    Survey {
        /// The view to come.
        view: ViewNumber,
        /// The last completed tick.
        tick: Tick,
        /// The tree after that tick, and which member computes each region, the same at all members. `None`: the node has begun anew
        /// since the server took it for a member.
        division: Option<(DistributionTree, Allocation)>,
        /// Every owned body, in id order.
        claims: Vec<Claim>,
    },
    /// From the leader: the tree or the allocation has changed within the view; sent again whenever the link was gone.
    Repartitioned {
        /// The present view.
        view: ViewNumber,
        /// Before which tick.
        tick: Tick,
        /// The tree from then on.
        tree: DistributionTree,
        /// Which member computes each region.
        allocation: Allocation,
        /// How often the tree has changed in this view.
        division: u32,
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
    /// Bodies that moved since the last checkpoint, several times per second.
    Checkpoint {
        /// The present view.
        view: ViewNumber,
        /// After which tick.
        tick: Tick,
        /// How often the tree had changed in this view by then.
        division: u32,
        /// In id order.
        bodies: Vec<BodyCheckpoint>,
    },
    /// The last states of bodies that this node owned and removed by a [`WorldOp::Remove`].
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
    /// Delays to other nodes that changed since the last time, in id order.
    Delays(Vec<Delay>),
    /// Calls for a vote.
    Call(Motion),
    /// Answer to [`ToNode::Poll`]: the average delay to the node in question, milliseconds; `None`: unknown.
    Ballot {
        /// Names the vote.
        poll: u64,
        /// Round trip.
        delay_ms: Option<f32>,
    },
    /// From the leader: state replication of bodies for which its group is authoritative. Newest wins.
    InterGroup {
        /// The present view.
        view: ViewNumber,
        /// After which tick.
        tick: Tick,
        /// In id order, in the compact form of `delta::alone`.
        states: Vec<u8>,
    },
    /// From the leader: bodies that an avatar of its group has touched, each with its number of authority.
    Touched {
        /// The present view.
        view: ViewNumber,
        /// In id order.
        bodies: Vec<(BodyId, u32)>,
    },
    /// From the leader: the answer to [`ToNode::Ask`].
    Answer {
        /// The present view.
        view: ViewNumber,
        /// The question's.
        number: u64,
        /// What was found.
        found: QueryResult,
    },
    /// From the leader: contacts of bodies that ask for them, each pair once.
    Contacts {
        /// The present view.
        view: ViewNumber,
        /// In which tick.
        tick: Tick,
        /// Beginnings, ends, and forces above thresholds.
        events: WorldEvents,
    },
    /// The node asks to leave; its regions are handed over first, then it is told to shut down.
    Leave,
    /// From the leader: what it has found out about a participant whose regions it computes once more.
    Verdict {
        /// The view of that tick.
        view: ViewNumber,
        /// In which tick.
        tick: Tick,
        /// Which participant.
        node: NodeId,
        /// What.
        finding: Finding,
    },
    /// From the leader, every 60 ticks: what it saves and costs that not all is computed in full.
    Fidelity {
        /// The present view.
        view: ViewNumber,
        /// As far as is known since the view began.
        report: FidelityReport,
    },
}

/// The measured delay from the sender to another node.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Delay {
    /// Which.
    pub node: NodeId,
    /// Average round trip, milliseconds; `None`: it cannot be reached.
    pub delay_ms: Option<f32>,
}

/// The motion of a vote on membership (thesis 3.3.9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub enum Motion {
    /// The node is to join the caller's group.
    Include(NodeId),
    /// The node is to leave the caller's group.
    Reject(NodeId),
}

/// A statement which group is authoritative for a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Stance {
    /// Which body.
    pub body: BodyId,
    /// Grows with every change; the higher one counts.
    pub number: u32,
    /// Whether the receiver's group is the authoritative one.
    pub yours: bool,
}

/// One owned body in a survey: the claim of a node to own it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Claim {
    /// Which body.
    pub id: BodyId,
    /// At which epoch.
    pub epoch: Epoch,
    /// Which of the node's regions owns it.
    pub region: RegionId,
}

/// The state of a body that a checkpoint keeps.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct BodyCheckpoint {
    /// Which body.
    pub id: BodyId,
    /// Which of the sender's regions owns it.
    pub region: RegionId,
    /// Of its owner.
    pub epoch: Epoch,
    /// What steps changed.
    pub state: BodyState,
}

/// The leader's permission to compute a tick: the barrier opens.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Dispatch {
    /// In which view.
    pub view: ViewNumber,
    /// Which tick.
    pub tick: Tick,
    /// Number of rounds in which all compute it: substeps of equal length, each followed by an exchange.
    pub rounds: u32,
    /// Changes of the world before it, in order.
    pub ops: Vec<WorldOp>,
}

/// A change of the tree within a view, agreed upon by the tick before which every member makes it.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Repartition {
    /// In this order, all or none.
    pub changes: Vec<TreeChange>,
    /// Who computes regions that are new: the right one of each [`TreeChange::Split`].
    pub newborn: NodeId,
}

impl Repartition {
    /// Returns what becomes of the names of the regions of `tree`, which is as it was before, in order.
    pub fn renamings(&self, tree: &DistributionTree) -> impl Iterator<Item = Renaming> {
        self.changes.iter().filter_map(|change| tree.renaming(change))
    }

    /// Makes the same change to an allocation of the regions of `tree`, which is as it was before.
    pub fn reallocate(&self, allocation: &mut Allocation, tree: &DistributionTree) {
        for Renaming { from, to, born, gone } in self.renamings(tree) {
            let node = allocation.remove(&from);
            gone.map(|gone| allocation.remove(&gone));
            allocation.extend(node.map(|node| (to, node)));
            allocation.extend(born.map(|born| (born, self.newborn)));
        }
    }
}

/// What one member has to do, for its leader to balance.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct LoadReport {
    /// Its regions, in id order.
    pub regions: Vec<RegionLoad>,
    /// Where the load of those is, summed up.
    pub burdens: Vec<Burden>,
    /// Boxes around the islands there that are too large to move whole.
    pub islands: Vec<Bounds>,
}

impl LoadReport {
    /// The most places for each region to which its load is summed up.
    pub const BURDENS: usize = 128;
}

/// What one region has to do.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RegionLoad {
    /// Which.
    pub region: RegionId,
    /// Awake bodies and their contacts.
    pub activity: f64,
    /// What a tick of it takes, smoothed, microseconds.
    pub step_us: f64,
    /// Nothing is left in it, so that it may be given up.
    pub vacant: bool,
}

/// A change of the world from outside, applied by every member at the start of a tick to what it holds.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum WorldOp {
    /// Bodies appear; the region at its place owns each, and that in which most of an assembly lies the whole assembly.
    Insert {
        /// The bodies.
        bodies: Vec<BodyRecord>,
        /// Shapes that are new to the group.
        shapes: Vec<ShapeRecord>,
        /// Joints among them, and with fixed bodies.
        joints: Vec<JointRecord>,
    },
    /// A body disappears, with its joints.
    Remove(BodyId),
    /// A joint disappears.
    RemoveJoint(JointId),
    /// No body has had these shapes for a while: each member forgets those that nothing has there.
    ForgetShapes(Vec<ShapeHash>),
    /// An avatar's user moves it, or the server's program a body.
    Input(Input),
    /// The server's program pushes a body.
    Push(Push),
    /// The server's program changes what a body or a joint is.
    Alter(Alteration),
    /// Bodies for which another group is authoritative: corrected gradually towards their states there, without a jump.
    Correct {
        /// The tick after which these states held.
        tick: Tick,
        /// In id order.
        states: Vec<SharedState>,
    },
    /// The tree changes before anything else of this tick.
    Repartition(Repartition),
    /// A client queries bodies as they are after the tick; changes nothing.
    Ask {
        /// Whose question.
        client: ClientId,
        /// What it asks.
        question: Query,
    },
    /// Some regions stay behind in this tick. All others are stepped, by all the ticks that they are behind; without this all are.
    Schedule(Schedule),
    /// What clients look at changes, of which members report bodies.
    Watch(Watch),
}

/// How what clients look at differs from the tick before. A view begins with nobody looking.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct Watch {
    /// Clients that look at another area than before; `None`: at everything. In id order.
    pub areas: Vec<(ClientId, Option<Area>)>,
    /// Clients that look no longer, in id order.
    pub gone: Vec<ClientId>,
    /// Avatars of clients with an area, and the cells that they have come to (level, and place along each axis), in id order.
    pub avatars: Vec<(BodyId, [i64; 4])>,
}

impl WorldOp {
    /// Returns which regions stay behind, if it says so.
    pub const fn schedule(&self) -> Option<&Schedule> {
        match self {
            Self::Schedule(schedule) => Some(schedule),
            _ => None,
        }
    }

    /// Returns the change of the tree, if it is one.
    pub const fn repartition(&self) -> Option<&Repartition> {
        match self {
            Self::Repartition(change) => Some(change),
            _ => None,
        }
    }

    /// Returns the body that it moves, of whose motion the server's record knows nothing.
    pub(crate) fn moves(&self) -> Option<BodyId> {
        match self {
            Self::Input(input) => Some(input.body),
            Self::Push(push) => Some(push.body),
            _ => None,
        }
    }

    /// Returns whether it may concern regions that are far from each other: what appears somewhere, or is moved there at once.
    pub fn concerns_all(&self) -> bool {
        matches!(self, Self::Insert { .. } | Self::Input(Input { pose: Some(_), .. }))
    }
}

/// A push on a dynamic body.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Push {
    /// The body that is pushed, and woken.
    pub body: BodyId,
    /// An impulse, N s, or a force, N; world axes.
    pub linear: [f32; 3],
    /// An angular impulse, N m s, or a torque, N m, besides that which `linear` has at `point`; world axes.
    pub angular: [f32; 3],
    /// Where `linear` acts, in world space, metres; `None`: at the centre of mass.
    pub point: Option<[f64; 3]>,
    /// Whether it is a force and a torque, which replace those before and last until they are replaced, or impulses.
    pub lasts: bool,
}

impl Push {
    /// Makes an impulse at the centre of mass, N s.
    #[must_use]
    pub const fn impulse(body: BodyId, linear: [f32; 3]) -> Self {
        Self { body, linear, angular: [0.0; 3], point: None, lasts: false }
    }

    /// Makes an angular impulse, N m s.
    #[must_use]
    pub const fn torque_impulse(body: BodyId, angular: [f32; 3]) -> Self {
        Self { body, linear: [0.0; 3], angular, point: None, lasts: false }
    }

    /// Makes a force at the centre of mass, N, and a torque, N m, that last until others replace them; zeros end them.
    #[must_use]
    pub const fn force(body: BodyId, linear: [f32; 3], angular: [f32; 3]) -> Self {
        Self { body, linear, angular, point: None, lasts: true }
    }

    /// Lets it act at a point of world space, metres.
    #[must_use]
    pub const fn at(self, point: [f64; 3]) -> Self {
        Self { point: Some(point), ..self }
    }
}

/// A member's report that it has completed a tick: it has reached the barrier.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Done {
    /// In which view.
    pub view: ViewNumber,
    /// Which tick; the tick of the view itself when the member is ready to begin.
    pub tick: Tick,
    /// Rounds that its regions want for the next tick; all take the most that any member wants.
    pub rounds_wanted: u32,
    /// Avatars of which it holds a copy, in id order, if that has changed since it last reported it in this view.
    pub holds: Option<Vec<BodyId>>,
    /// Contacts of avatars.
    pub events: Vec<RegionEvents>,
    /// Answers to the questions that came with the tick.
    pub answers: Vec<Answer>,
    /// What it has to do, when that is due.
    pub load: Option<LoadReport>,
    /// How long it has computed for it, microseconds.
    pub compute_us: u32,
    /// The states of its regions, in id order, where the world's fidelity lets them be stepped less often.
    pub regions: Vec<RegionState>,
}

/// A member's report of bodies that moved since its last report, and that somebody looks at.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Report {
    /// In which view.
    pub view: ViewNumber,
    /// After which tick.
    pub tick: Tick,
    /// In id order.
    pub states: Vec<SharedState>,
}

/// The border messages of one member's regions to another's in one round; sent even when empty.
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
