//! Defines the interface of a node to its physics: a device that takes one [`PhysicsCommand`] at a time and answers with a
//! [`PhysicsEvent`].

use crate::fidelity::RegionState;
use crate::protocol::{
    Answer, BodyCheckpoint, BodyRecord, BorderMessage, Chunk, Claim, EnvironmentProperties, JointRecord,
    LoadReport, Placed, RegionEvents, SharedState, WorldOp,
};
use crate::space::{BodyId, DistributionTree, RegionId, Tick, TreeChange};

/// The bodies that a sample of states lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// None.
    Nothing,
    /// Owned bodies that moved, fell asleep, or came here since the last sample of this kind.
    Moved,
    /// All owned bodies.
    All,
}

/// A command of the node to its physics. [`PhysicsCommand::World`], [`PhysicsCommand::Load`], [`PhysicsCommand::Anew`],
/// [`PhysicsCommand::Repartition`] and [`PhysicsCommand::Return`] have no answer; every other command is given only after the last one was answered,
/// but for [`PhysicsCommand::Verify`], which may be given at any time. A [`PhysicsCommand::World`] forgets all that was before.
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicsCommand {
    /// Set the properties of the world to come; before anything else.
    World(EnvironmentProperties),
    /// Keep these shapes, or these immovable bodies, which each region is to hold as far as it touches them. May repeat.
    Load(Chunk),
    /// Compute no region any more, and keep nothing of what was computed: the world, its shapes and what does not move stay. No answer.
    Anew,
    /// Compute these regions from now on, and no other. Kept regions keep their bodies; all forget which regions hold replicas,
    /// and treat their own replicas as stale until the exchange that follows has confirmed them. Bodies of regions that are not
    /// kept are released. The answer, [`PhysicsEvent::Computed`], announces every replica that others need.
    Rebuild {
        /// The last completed tick.
        tick: Tick,
        /// The tree of the coming view.
        tree: DistributionTree,
        /// In id order.
        regions: Vec<RegionId>,
        /// Bodies that found a new owner, here or elsewhere, in id order; they supersede what is held of them.
        placed: Vec<Placed>,
        /// Joints of these bodies.
        joints: Vec<JointRecord>,
        /// Bodies not to be held any more, unless announced.
        drop: Vec<BodyId>,
    },
    /// Change the tree before the next [`PhysicsCommand::Step`]. No answer.
    Repartition {
        /// In this order; they suit the tree.
        changes: Vec<TreeChange>,
        /// Regions that are new are computed here.
        newborn_here: bool,
    },
    /// Apply the operations and compute one tick (its first round); answered by [`PhysicsEvent::Computed`].
    Step {
        /// Which tick.
        tick: Tick,
        /// In how many rounds.
        rounds: u32,
        /// In order.
        ops: Vec<WorldOp>,
    },
    /// Take in all border messages of the round, in order of (from, to). Answered by [`PhysicsEvent::Computed`] when the tick
    /// has a further round, else by [`PhysicsEvent::Settled`].
    Accept {
        /// Which tick.
        tick: Tick,
        /// Which round.
        round: u32,
        /// Messages to regions of this node, from its own regions too; those from elsewhere may be of an earlier tick.
        incoming: Vec<BorderMessage>,
        /// What [`PhysicsEvent::Settled`] lists for clients.
        report: Sampling,
        /// What it lists for the server.
        checkpoint: Sampling,
        /// A report of the load is wanted, too.
        load: bool,
    },
    /// Take in border messages that are not taken in yet, without computing, for membership changes. Answered by
    /// [`PhysicsEvent::Drained`].
    Drain {
        /// The last computed tick.
        tick: Tick,
        /// In order of ticks; within one in order of (from, to).
        incoming: Vec<BorderMessage>,
    },
    /// Compute a speculative tick, while other nodes are waited for in vain: on a copy of all that is held here, as if nobody
    /// else were there. The first makes the copy; the world itself stands still. Answered by [`PhysicsEvent::Speculated`].
    Speculate(Vec<WorldOp>),
    /// Discard the copy of the speculative ticks. No answer.
    Return,
    /// List all owned bodies. Answered by [`PhysicsEvent::Surveyed`].
    Survey,
    /// Return these bodies with their states, and with how they lay when their contacts were found. Answered by [`PhysicsEvent::Found`].
    Fetch(Vec<BodyId>),
    /// Compute once more what another member computes, beside the regions here and apart from them; answered by [`PhysicsEvent::Verified`]
    /// where the command has an answer, or gives up a region that is not empty.
    Verify {
        /// Names what is computed. It begins with [`PhysicsCommand::Anew`], and knows the world, and what does not move, as they are here then.
        run: u64,
        /// Says what that member was told. `None`: no more of it.
        command: Option<Box<PhysicsCommand>>,
    },
}

/// An answer of the physics to a [`PhysicsCommand`].
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicsEvent {
    /// To [`PhysicsCommand::Rebuild`], [`PhysicsCommand::Step`], or [`PhysicsCommand::Accept`] with a round to come.
    Computed {
        /// Messages to all regions, one's own included; empty ones may be left out.
        outgoing: Vec<BorderMessage>,
        /// Regions of other nodes with which the regions here exchange messages in this tick, in id order; theirs know the same of
        /// the regions here.
        neighbours: Vec<RegionId>,
        /// Owned bodies that an operation removed, as they were.
        removed: Vec<BodyRecord>,
    },
    /// To the last [`PhysicsCommand::Accept`] of a tick.
    Settled {
        /// Rounds that the regions here want for the next tick.
        rounds_wanted: u32,
        /// What the tick cost.
        stats: TickStats,
        /// Avatars of which a copy is held here, in id order.
        holds: Vec<BodyId>,
        /// Contact events of the regions.
        events: Vec<RegionEvents>,
        /// Answers to the questions that came with the tick.
        answers: Vec<Answer>,
        /// For clients, as sampled, in id order.
        report: Vec<SharedState>,
        /// For the server, as sampled, in id order.
        checkpoint: Vec<BodyCheckpoint>,
        /// The load of the regions here, if it was wanted.
        load: Option<LoadReport>,
        /// The states of the regions here, in id order, where the world's fidelity lets them be stepped less often.
        regions: Vec<RegionState>,
    },
    /// To [`PhysicsCommand::Drain`].
    Drained,
    /// The states of the copied bodies after a speculative tick, in id order; those that rest may be left out.
    Speculated(Vec<SharedState>),
    /// Every owned body, in id order.
    Surveyed(Vec<Claim>),
    /// The fetched bodies that are held here, owned or replica, at the epoch of their owner, in id order.
    Found(Vec<BodyRecord>),
    /// To [`PhysicsCommand::Verify`].
    Verified {
        /// Of what.
        run: u64,
        /// Its answer. `None`: a region is given up there that is not empty. What cannot be computed is not answered any more.
        event: Option<Box<PhysicsEvent>>,
    },
}

/// What a tick cost one member.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickStats {
    /// Bodies owned.
    pub bodies: u32,
    /// Replicas held.
    pub replicas: u32,
    /// Contact pairs.
    pub contacts: u32,
    /// Bodies that came to a region of this device from another.
    pub transfers: u32,
    /// Microseconds of computing.
    pub compute_us: u32,
    /// Exchanges in it; 0 in a world of one region.
    pub exchanges: u32,
    /// How far copies of shared bodies were from agreement at the worst border, summed over its exchanges, m/s.
    pub disagreement_m_s: f32,
}
