//! Defines the interface of a node to its physics: a device that takes one [`PhysicsCommand`] at a time and
//! answers with a [`PhysicsEvent`].

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

/// A command of the node to its physics. [`PhysicsCommand::World`], [`PhysicsCommand::Load`],
/// [`PhysicsCommand::Anew`], [`PhysicsCommand::Repartition`] and [`PhysicsCommand::Return`] have no answer.
/// [`PhysicsCommand::Verify`] may be given at any time. Every other command is given only after the last one
/// was answered. [`PhysicsCommand::World`] discards everything before it.
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicsCommand {
    /// Set the properties of the world to come. This is the first command.
    World(EnvironmentProperties),
    /// Keep these shapes, or these immovable bodies. Each region is to hold those bodies that touch it. May
    /// repeat.
    Load(Chunk),
    /// Compute no region any more, and discard what was computed. The world's properties, its shapes and its
    /// immovable bodies stay. No answer.
    Anew,
    /// Compute these regions from now on, and no other. Kept regions keep their bodies. All regions forget
    /// which regions hold ghosts, and treat their own ghosts as stale until the next exchange has confirmed
    /// them. Bodies of regions that are not kept are released. The answer, [`PhysicsEvent::Computed`],
    /// announces every ghost that others need.
    Rebuild {
        /// The last completed tick.
        tick: Tick,
        /// The tree of the coming view.
        tree: DistributionTree,
        /// The regions, in id order.
        regions: Vec<RegionId>,
        /// Bodies that got a new owner, here or elsewhere, in id order. They supersede what is held of them.
        placed: Vec<Placed>,
        /// The joints of these bodies.
        joints: Vec<JointRecord>,
        /// Bodies not to be held any more, unless announced.
        drop: Vec<BodyId>,
    },
    /// Change the tree before the next [`PhysicsCommand::Step`]. No answer.
    Repartition {
        /// The changes, in this order. They suit the tree.
        changes: Vec<TreeChange>,
        /// Says whether new regions are computed here.
        newborn_here: bool,
    },
    /// Apply the operations and compute the first round of a tick. Answered by [`PhysicsEvent::Computed`].
    Step {
        /// The tick.
        tick: Tick,
        /// The number of rounds in it.
        rounds: u32,
        /// The operations, in order.
        ops: Vec<WorldOp>,
    },
    /// Take in all border messages of the round, in order of (from, to). Answered by
    /// [`PhysicsEvent::Computed`] if the tick has a further round, else by [`PhysicsEvent::Settled`].
    Accept {
        /// The tick.
        tick: Tick,
        /// The round.
        round: u32,
        /// Messages to regions of this node, also from its own regions. Those from other nodes may be of an
        /// earlier tick.
        incoming: Vec<BorderMessage>,
        /// The bodies that [`PhysicsEvent::Settled`] lists for clients.
        report: Sampling,
        /// The bodies that it lists for the server.
        checkpoint: Sampling,
        /// Says whether a report of the load is wanted, too.
        load: bool,
    },
    /// Take in border messages that were not taken in yet, without computing. Given before a survey, or a
    /// change of the tree. Answered by [`PhysicsEvent::Drained`].
    Drain {
        /// The last computed tick.
        tick: Tick,
        /// The messages, in order of (tick, from, to).
        incoming: Vec<BorderMessage>,
    },
    /// Compute a speculative tick, while other nodes are waited for in vain: on a copy of all that is held
    /// here, as if there were no other node. The first such command makes the copy. The world itself stands
    /// still. Answered by [`PhysicsEvent::Speculated`].
    Speculate(Vec<WorldOp>),
    /// Discard the copy of the speculative ticks. No answer.
    Return,
    /// List all owned bodies. Answered by [`PhysicsEvent::Surveyed`].
    Survey,
    /// Return these bodies with their states, and with their poses of when their contacts were found.
    /// Answered by [`PhysicsEvent::Found`].
    Fetch(Vec<BodyId>),
    /// Compute once more what another member computes, apart from the regions here. Answered by
    /// [`PhysicsEvent::Verified`] where the command has an answer, or gives up a region that is not empty.
    Verify {
        /// The number of the run that the command belongs to. A run begins with [`PhysicsCommand::Anew`],
        /// with the world and its immovable bodies as they are here then.
        run: u64,
        /// The command that the other member carried out. `None` ends the run.
        command: Option<Box<PhysicsCommand>>,
    },
}

/// An answer of the physics to a [`PhysicsCommand`].
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicsEvent {
    /// The answer to [`PhysicsCommand::Rebuild`], [`PhysicsCommand::Step`], and [`PhysicsCommand::Accept`] if
    /// a round follows.
    Computed {
        /// Messages to all regions, also to those here. Empty ones may be left out.
        outgoing: Vec<BorderMessage>,
        /// Regions of other nodes with which the regions here exchange messages in this tick, in id order.
        /// Both sides of a pair come to the same result.
        neighbours: Vec<RegionId>,
        /// Owned bodies that an operation removed, as they were.
        removed: Vec<BodyRecord>,
    },
    /// The answer to the last [`PhysicsCommand::Accept`] of a tick.
    Settled {
        /// The number of rounds that the regions here want for the next tick.
        rounds_wanted: u32,
        /// What the tick cost.
        stats: TickStats,
        /// Avatars of which a copy is held here, in id order.
        holds: Vec<BodyId>,
        /// Contact events of the regions.
        events: Vec<RegionEvents>,
        /// Answers to the queries that came with the tick.
        answers: Vec<Answer>,
        /// States for clients, as sampled, in id order.
        report: Vec<SharedState>,
        /// Checkpoints for the server, as sampled, in id order.
        checkpoint: Vec<BodyCheckpoint>,
        /// The load of the regions here, if it was wanted.
        load: Option<LoadReport>,
        /// The states of the regions here, in id order, if the world's fidelity lets regions be stepped at
        /// lower rates.
        regions: Vec<RegionState>,
    },
    /// The answer to [`PhysicsCommand::Drain`].
    Drained,
    /// The answer to [`PhysicsCommand::Speculate`]: the states of the copied bodies after the tick, in id
    /// order. Bodies at rest may be left out.
    Speculated(Vec<SharedState>),
    /// The answer to [`PhysicsCommand::Survey`]: every owned body, in id order.
    Surveyed(Vec<Claim>),
    /// The answer to [`PhysicsCommand::Fetch`]: those of the bodies that are held here, owned or as ghosts,
    /// at the epoch of their owner, in id order.
    Found(Vec<BodyRecord>),
    /// The answer to [`PhysicsCommand::Verify`].
    Verified {
        /// The number of the run.
        run: u64,
        /// The answer to the run's command. `None`: the command gives up a region that is not empty there. A
        /// run that cannot be computed gives no more answers.
        event: Option<Box<PhysicsEvent>>,
    },
}

/// What a tick cost one member.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickStats {
    /// The number of bodies owned.
    pub bodies: u32,
    /// The number of ghosts held.
    pub ghosts: u32,
    /// The number of contact pairs.
    pub contacts: u32,
    /// The number of bodies that came to a region of this device from another region.
    pub transfers: u32,
    /// The time of computing, microseconds.
    pub compute_us: u32,
    /// The number of exchanges in the tick; 0 in a world of one region.
    pub exchanges: u32,
    /// How far copies of shared bodies were from agreement at the worst border, summed over its exchanges,
    /// m/s.
    pub disagreement_m_s: f32,
}
