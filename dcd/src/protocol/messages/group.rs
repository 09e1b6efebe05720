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
    /// Answers [`Hello`](super::Hello). Chunks of shapes and immovable bodies follow, then
    /// [`ToNode::WorldEnd`].
    Welcome {
        /// The node's id.
        id: NodeId,
        /// Tells this world from others, also in recordings.
        incarnation: u64,
        /// The world.
        world: EnvironmentProperties,
    },
    /// Brings a part of a world, before [`ToNode::WorldEnd`] or [`ToNode::Adopt`].
    Chunk(Chunk),
    /// Tells that the node has all that it needs to take regions. The node answers [`ToServer::Loaded`].
    WorldEnd,
    /// Begins a view change: the node starts no further tick, and answers [`ToServer::Settling`].
    Settle {
        /// The view to come.
        view: ViewNumber,
    },
    /// Has the node complete these ticks, waiting for survivors only, and then answer [`ToServer::Survey`].
    /// Several such messages may come, the last one marked.
    Finish {
        /// The view to come.
        view: ViewNumber,
        /// The dispatches. Those of all such messages together are all dispatches of the present view that
        /// some survivor may not have completed, in order.
        dispatches: Vec<Dispatch>,
        /// The nodes that still answer, in id order.
        survivors: Vec<NodeId>,
        /// Says whether no more such messages follow.
        last: bool,
    },
    /// Has the node send these bodies whole, owned or ghosts, as far as it holds them. It answers
    /// [`ToServer::Found`].
    Fetch {
        /// The view to come.
        view: ViewNumber,
        /// The bodies, in id order.
        bodies: Vec<BodyId>,
    },
    /// Begins the view, with the [`Placed`](super::Placed) bodies that were sent before.
    Adopt {
        /// The members, the leader and the allocation.
        view: View,
        /// The bodies to let go of: removed ones, and those that another member owns at a higher epoch.
        drop: Vec<BodyId>,
    },
    /// To the leader: put these operations into the next dispatch. They are already on record, so they
    /// outlive the leader.
    Apply {
        /// The present view.
        view: ViewNumber,
        /// The number in the view of the first of these operations that moves a body, counting only
        /// operations that do.
        first: u64,
        /// The operations, in order.
        ops: Vec<WorldOp>,
    },
    /// Names all nodes of the server. Each node links with each, so that delays are known before they matter.
    Roster(Vec<Member>),
    /// Asks this member to vote. It answers [`ToServer::Ballot`].
    Poll {
        /// The id of the vote.
        poll: u64,
        /// The motion to vote on.
        motion: Motion,
    },
    /// To the leader: asks a query of the server's program. It answers [`ToServer::Answer`].
    Ask {
        /// The present view.
        view: ViewNumber,
        /// The query.
        question: Query,
    },
    /// To the leader: the server's program looks at the world from these viewpoints from now on, and from no
    /// others. A later view brings its own.
    Look {
        /// The present view.
        view: ViewNumber,
        /// The viewpoints.
        viewpoints: Vec<Viewpoint>,
    },
    /// To the leader of a group: states of bodies for which other groups are authoritative. The newest wins.
    InterGroup {
        /// The present view of the receiver.
        view: ViewNumber,
        /// Says whether they come from the main group. The other groups keep up with its ticks.
        main: bool,
        /// The tick after which the states hold.
        tick: Tick,
        /// The states, in id order, in the compact form of `delta::alone`.
        states: Vec<u8>,
    },
    /// To the leader of a group: for which bodies its group is authoritative from now on.
    Authority {
        /// The present view of the receiver.
        view: ViewNumber,
        /// Says whether there is no other group.
        alone: bool,
        /// Says whether the receiver's group is authoritative for persistent bodies without a stance.
        by_default: bool,
        /// The new stances, in id order.
        stances: Vec<Stance>,
    },
    /// Before [`ToNode::Adopt`], if participants are verified. Each member is to tell the leader what it
    /// takes in, and what it tells these participants. The leader is to compute once more what they compute.
    Verify {
        /// The view to come.
        view: ViewNumber,
        /// The participants, in id order.
        nodes: Vec<Verified>,
        /// Says whether participants that have computed before keep nothing of that: all that they begin with is
        /// placed with the view.
        anew: bool,
    },
    /// Tells the node to stop.
    Shutdown {
        /// The reason, for programs.
        farewell: Farewell,
        /// The reason, for people.
        reason: String,
    },
}

/// The reason why the server removes a process from its world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Farewell {
    /// A node has handed its share over, and leaves. It asked to, or an operator drained it.
    Left,
    /// The server's user does not want the process any longer.
    SentAway,
    /// The process has another version, or is not what it claims to be.
    Refused,
    /// The world ends.
    Ended,
}

/// A message of a node to the server.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToServer {
    /// The world has been received, so that the node can be given regions.
    Loaded,
    /// Answers [`ToNode::Settle`]. Several such messages may come, the last one marked.
    Settling {
        /// The view to come.
        view: ViewNumber,
        /// The dispatches received in the present view that another member may not have completed, in order.
        dispatches: Vec<Dispatch>,
        /// From the leader: what the server's program did to moving bodies and no tick has applied yet. The
        /// next leader applies it.
        undone: Vec<WorldOp>,
        /// Says whether no more such messages follow.
        last: bool,
    },
    /// Answers [`ToNode::Finish`] with the bodies that the node owns after its last tick.
    Survey {
        /// The view to come.
        view: ViewNumber,
        /// The last completed tick.
        tick: Tick,
        /// The tree after that tick, and the member that computes each region; the same at all members.
        /// `None` if the node has begun anew since the server took it for a member.
        division: Option<(DistributionTree, Allocation)>,
        /// A claim for every owned body, in id order.
        claims: Vec<Claim>,
    },
    /// From the leader: the tree or the allocation has changed within the view. Sent again whenever the link
    /// was gone.
    Repartitioned {
        /// The present view.
        view: ViewNumber,
        /// The tick before which the change holds.
        tick: Tick,
        /// The tree from then on.
        tree: DistributionTree,
        /// The member that computes each region.
        allocation: Allocation,
        /// The number of changes of the tree in this view.
        division: u32,
    },
    /// Answers [`ToNode::Fetch`]. Several such messages may come, the last one marked.
    Found {
        /// The view to come.
        view: ViewNumber,
        /// The bodies, in id order.
        bodies: Vec<BodyRecord>,
        /// Says whether no more such messages follow.
        last: bool,
    },
    /// Brings bodies that moved since the last checkpoint, several times per second.
    Checkpoint {
        /// The present view.
        view: ViewNumber,
        /// The tick after which the states hold.
        tick: Tick,
        /// The number of changes of the tree in this view by then.
        division: u32,
        /// The bodies, in id order.
        bodies: Vec<BodyCheckpoint>,
    },
    /// Brings the last states of bodies that this node owned and removed by a [`WorldOp::Remove`].
    Removed {
        /// The present view.
        view: ViewNumber,
        /// The tick after which they were removed.
        tick: Tick,
        /// The bodies, in id order.
        bodies: Vec<BodyRecord>,
    },
    /// Tells that another member cannot be reached.
    LinkLost {
        /// The present view.
        view: ViewNumber,
        /// The other member.
        node: NodeId,
    },
    /// Tells the delays to other nodes that changed since the last time, in id order.
    Delays(Vec<Delay>),
    /// Calls for a vote.
    Call(Motion),
    /// Answers [`ToNode::Poll`] with the average delay to the node in question.
    Ballot {
        /// The id of the vote.
        poll: u64,
        /// The round trip, milliseconds; `None` if it is not known.
        delay_ms: Option<f32>,
    },
    /// From the leader: states of bodies for which its group is authoritative. The newest wins.
    InterGroup {
        /// The present view.
        view: ViewNumber,
        /// The tick after which the states hold.
        tick: Tick,
        /// The states, in id order, in the compact form of `delta::alone`.
        states: Vec<u8>,
    },
    /// From the leader: bodies that an avatar of its group has touched, each with its number of authority.
    Touched {
        /// The present view.
        view: ViewNumber,
        /// The bodies, in id order.
        bodies: Vec<(BodyId, u32)>,
    },
    /// From the leader: answers [`ToNode::Ask`].
    Answer {
        /// The present view.
        view: ViewNumber,
        /// The number of the query.
        number: u64,
        /// The result.
        found: QueryResult,
    },
    /// From the leader: contacts of bodies that ask for them, each pair once.
    Contacts {
        /// The present view.
        view: ViewNumber,
        /// The tick of the contacts.
        tick: Tick,
        /// The contacts that began or ceased, and the forces above thresholds.
        events: WorldEvents,
    },
    /// Asks to leave. The node's regions are handed over first, and then it is told to shut down.
    Leave,
    /// From the leader: what it has found out about a participant whose regions it computes once more.
    Verdict {
        /// The view of the tick.
        view: ViewNumber,
        /// The tick.
        tick: Tick,
        /// The participant.
        node: NodeId,
        /// The finding.
        finding: Finding,
    },
    /// From the leader, every 60 ticks: what it saves and costs that not everything is computed in full.
    Fidelity {
        /// The present view.
        view: ViewNumber,
        /// The report, as far as is known since the view began.
        report: FidelityReport,
    },
}

/// The measured delay from the sender to another node.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Delay {
    /// The other node.
    pub node: NodeId,
    /// The average round trip, milliseconds; `None` if the node cannot be reached.
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

/// A statement of which group is authoritative for a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Stance {
    /// The body.
    pub body: BodyId,
    /// The number of the stance, which grows with every change. The higher one counts.
    pub number: u32,
    /// Says whether the receiver's group is the authoritative one.
    pub yours: bool,
}

/// The claim of a node, in a survey, to own a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Claim {
    /// The body.
    pub id: BodyId,
    /// The epoch at which it is owned.
    pub epoch: Epoch,
    /// The region of the node that owns it.
    pub region: RegionId,
}

/// The state of a body that a checkpoint keeps.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct BodyCheckpoint {
    /// The body.
    pub id: BodyId,
    /// The region of the sender that owns it.
    pub region: RegionId,
    /// The epoch of its owner.
    pub epoch: Epoch,
    /// The part of the body that steps change.
    pub state: BodyState,
}

/// The leader's permission to compute a tick (the barrier opens).
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Dispatch {
    /// The view.
    pub view: ViewNumber,
    /// The tick.
    pub tick: Tick,
    /// The number of rounds in which all members compute it: substeps of equal length, each followed by an
    /// exchange.
    pub rounds: u32,
    /// The changes of the world before the tick, in order.
    pub ops: Vec<WorldOp>,
}

/// A change of the tree within a view. All members make it before the same tick.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Repartition {
    /// The changes, to be made in this order, all or none.
    pub changes: Vec<TreeChange>,
    /// The node that computes new regions: the right one of each [`TreeChange::Split`].
    pub newborn: NodeId,
}

impl Repartition {
    /// Returns what becomes of the names of regions, in order. `tree` is the tree before the change.
    pub fn renamings(&self, tree: &DistributionTree) -> impl Iterator<Item = Renaming> {
        self.changes.iter().filter_map(|change| tree.renaming(change))
    }

    /// Makes the same change to an allocation. `tree` is the tree before the change.
    pub fn reallocate(&self, allocation: &mut Allocation, tree: &DistributionTree) {
        for Renaming { from, to, born, gone } in self.renamings(tree) {
            let node = allocation.remove(&from);
            gone.map(|gone| allocation.remove(&gone));
            allocation.extend(node.map(|node| (to, node)));
            allocation.extend(born.map(|born| (born, self.newborn)));
        }
    }
}

/// The load of one member, from which its leader balances.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct LoadReport {
    /// The member's regions, in id order.
    pub regions: Vec<RegionLoad>,
    /// The places where the load of these regions lies, summed up.
    pub burdens: Vec<Burden>,
    /// Boxes around the islands there that are too large to move whole.
    pub islands: Vec<Bounds>,
}

impl LoadReport {
    /// The most places per region to which its load is summed up.
    pub const BURDENS: usize = 128;
}

/// The load of one region.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RegionLoad {
    /// The region.
    pub region: RegionId,
    /// The number of awake bodies and of their contacts.
    pub activity: f64,
    /// The time that a tick of the region takes, smoothed, microseconds.
    pub step_us: f64,
    /// Says whether nothing is left in it, so that it may be given up.
    pub vacant: bool,
}

/// A change of the world from outside. Every member applies it at the start of a tick to what it holds.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum WorldOp {
    /// Inserts bodies. The region at a body's place owns it; the region in which most of an assembly lies
    /// owns the whole assembly.
    Insert {
        /// The new bodies.
        bodies: Vec<BodyRecord>,
        /// The shapes that are new to the group.
        shapes: Vec<ShapeRecord>,
        /// The joints among the bodies, and with fixed bodies.
        joints: Vec<JointRecord>,
    },
    /// Removes a body with its joints.
    Remove(BodyId),
    /// Removes a joint.
    RemoveJoint(JointId),
    /// Forgets shapes that no body has had for a while: each member forgets those that nothing there has.
    ForgetShapes(Vec<ShapeHash>),
    /// Moves an avatar as its user asks, or a body as the server's program asks.
    Input(Input),
    /// Pushes a body, as the server's program asks.
    Push(Push),
    /// Changes what a body or a joint is, as the server's program asks.
    Alter(Alteration),
    /// Corrects bodies for which another group is authoritative, gradually and without a jump, towards their
    /// states there.
    Correct {
        /// The tick after which the states hold.
        tick: Tick,
        /// The states, in id order.
        states: Vec<SharedState>,
        /// The bodies among them that something has kept away for long, in id order. They are put there at once,
        /// unless joints hold them.
        stuck: Vec<BodyId>,
    },
    /// Changes the tree, before anything else of this tick.
    Repartition(Repartition),
    /// Asks a client's query about bodies as they are after the tick; changes nothing.
    Ask {
        /// The client that asks.
        client: ClientId,
        /// The query.
        question: Query,
    },
    /// Says which regions stay behind in this tick. All others are stepped, by all the ticks that they are
    /// behind. Without this all regions are stepped.
    Schedule(Schedule),
    /// Changes what clients look at. Members report bodies that are looked at.
    Watch(Watch),
}

/// The changes in what clients look at, since the tick before. A view begins with nobody looking.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct Watch {
    /// The clients that look at another area than before, in id order; `None` for everything.
    pub areas: Vec<(ClientId, Option<Area>)>,
    /// The clients that do not look any longer, in id order.
    pub gone: Vec<ClientId>,
    /// The avatars of clients with an area, with the cells that they have come to (level, and place along
    /// each axis), in id order.
    pub avatars: Vec<(BodyId, [i64; 4])>,
}

impl WorldOp {
    /// Returns the schedule, if this is one.
    pub const fn schedule(&self) -> Option<&Schedule> {
        match self {
            Self::Schedule(schedule) => Some(schedule),
            _ => None,
        }
    }

    /// Returns the change of the tree, if this is one.
    pub const fn repartition(&self) -> Option<&Repartition> {
        match self {
            Self::Repartition(change) => Some(change),
            _ => None,
        }
    }

    /// Returns the body that is moved, if this moves one. The server's record knows nothing of such motion.
    pub(crate) fn moves(&self) -> Option<BodyId> {
        match self {
            Self::Input(input) => Some(input.body),
            Self::Push(push) => Some(push.body),
            _ => None,
        }
    }

    /// Returns whether this may concern regions that are far from each other: bodies are inserted, or one
    /// jumps to a pose, is put there or flies off as a projectile.
    pub fn concerns_all(&self) -> bool {
        match self {
            Self::Insert { .. } => true,
            Self::Input(input) => input.pose.is_some() || input.is_shot(),
            Self::Correct { stuck, .. } => !stuck.is_empty(),
            _ => false,
        }
    }
}

/// A push on a dynamic body: an impulse, or a lasting force.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Push {
    /// The body that is pushed and woken.
    pub body: BodyId,
    /// The impulse, N s, or the force, N; world axes.
    pub linear: [f32; 3],
    /// The angular impulse, N m s, or the torque, N m, in addition to that of `linear` at `point`; world
    /// axes.
    pub angular: [f32; 3],
    /// The point at which `linear` acts, in world space, metres; `None` for the centre of mass.
    pub point: Option<[f64; 3]>,
    /// Says whether the push is a force and a torque, which replace earlier ones and last until they are replaced.
    /// Otherwise it is an impulse.
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

    /// Makes a force at the centre of mass, N, and a torque, N m, which last until others replace them. Zeros
    /// end them.
    #[must_use]
    pub const fn force(body: BodyId, linear: [f32; 3], angular: [f32; 3]) -> Self {
        Self { body, linear, angular, point: None, lasts: true }
    }

    /// Returns the same push, acting at a point in world space, metres.
    #[must_use]
    pub const fn at(self, point: [f64; 3]) -> Self {
        Self { point: Some(point), ..self }
    }
}

/// A member's report that it has completed a tick (it has reached the barrier).
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Done {
    /// The view.
    pub view: ViewNumber,
    /// The tick; the tick of the view itself when the member is ready to begin.
    pub tick: Tick,
    /// The rounds that its regions want for the next tick. All members take the most that any of them wants.
    pub rounds_wanted: u32,
    /// The avatars of which it holds a copy, in id order, if they have changed since it last reported them in
    /// this view.
    pub holds: Option<Vec<BodyId>>,
    /// The contacts of avatars.
    pub events: Vec<RegionEvents>,
    /// The answers to the queries that came with the tick.
    pub answers: Vec<Answer>,
    /// The load of the member, when it is due.
    pub load: Option<LoadReport>,
    /// The time for which it has computed the tick, microseconds.
    pub compute_us: u32,
    /// The states of its regions, in id order, if the world's fidelity lets regions be stepped less often.
    pub regions: Vec<RegionState>,
}

/// A member's report of bodies that moved since its last report and that somebody looks at.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Report {
    /// The view.
    pub view: ViewNumber,
    /// The tick after which the states hold.
    pub tick: Tick,
    /// The states, in id order.
    pub states: Vec<SharedState>,
}

/// The border messages of one member's regions to another's in one round. It is sent even when it is empty.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Border {
    /// The view.
    pub view: ViewNumber,
    /// The tick.
    pub tick: Tick,
    /// The exchange of the tick, from 0.
    pub round: u32,
    /// The messages, in order of (from, to).
    pub messages: Vec<BorderMessage>,
}
