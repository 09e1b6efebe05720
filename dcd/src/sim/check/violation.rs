//! Defines the violations of invariants that a run must never show.

use std::time::Duration;

use crate::protocol::ViewNumber;
use crate::space::{BodyId, ClientId, Epoch, NodeId, Tick};

/// A violation of an invariant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Violation {
    /// No node owns a body.
    #[error("{body} is owned by nobody after {tick}")]
    Lost {
        /// Which body.
        body: BodyId,
        /// After which tick.
        tick: Tick,
    },
    /// Two nodes own a body.
    #[error("{body} has more than one owner after {tick}")]
    Doubled {
        /// Which body.
        body: BodyId,
        /// After which tick.
        tick: Tick,
    },
    /// A replica has seen a later epoch than the owner's.
    #[error("a replica of {body} is newer than its owner after {tick}")]
    Outdated {
        /// Which body.
        body: BodyId,
        /// After which tick.
        tick: Tick,
    },
    /// An owner's epoch went down.
    #[error("{body} went back from {before} to {after} after {tick}")]
    WentBack {
        /// Which body.
        body: BodyId,
        /// Its earlier epoch.
        before: Epoch,
        /// Its epoch now.
        after: Epoch,
        /// After which tick.
        tick: Tick,
    },
    /// A node holds an older copy than it held before.
    #[error("{body} went back from {before} to {after} at {node} after {tick}")]
    NodeWentBack {
        /// Where.
        node: NodeId,
        /// Which body.
        body: BodyId,
        /// Its earlier epoch.
        before: Epoch,
        /// Its epoch now.
        after: Epoch,
        /// After which tick.
        tick: Tick,
    },
    /// A client was shown an older state than before.
    #[error("{body} went back from {before:?} to {after:?} at {client}")]
    ClientWentBack {
        /// Where.
        client: ClientId,
        /// Which body.
        body: BodyId,
        /// Epoch and tick that it had seen.
        before: (Epoch, Tick),
        /// What it shows now.
        after: (Epoch, Tick),
    },
    /// A node that computes a view that is over holds a body at an epoch that its successors do not beat.
    #[error("{node}, whose view is over, holds {body} at {epoch}, its owner at {present}")]
    Overreach {
        /// Who.
        node: NodeId,
        /// Which body.
        body: BodyId,
        /// At which epoch it holds it.
        epoch: Epoch,
        /// The owner's.
        present: Epoch,
    },
    /// Members took unequal numbers of rounds, or not the most that any of them had wanted.
    #[error("{tick} took {taken:?} rounds, where {wanted} were wanted")]
    Rounds {
        /// Which tick.
        tick: Tick,
        /// What members took.
        taken: Vec<u32>,
        /// The most that a member wanted after the tick before.
        wanted: u32,
    },
    /// State that a node computed in a view that is over got into the record.
    #[error("a checkpoint of view {} from {node} changed {body} on record", view.0)]
    StaleCommit {
        /// Who.
        node: NodeId,
        /// Of which view.
        view: ViewNumber,
        /// Which body.
        body: BodyId,
    },
    /// Two members of a group have not been able to reach each other for long.
    #[error("{a} and {b} are of one group and have not reached each other for {} ms", time.as_millis())]
    NoClique {
        /// One.
        a: NodeId,
        /// The other.
        b: NodeId,
        /// For how long.
        time: Duration,
    },
    /// A process was removed though all lived and could reach each other.
    #[error("{node} was expelled though nobody was dead or cut off")]
    Expelled {
        /// Who.
        node: NodeId,
    },
    /// A participant that computed what it should was said not to.
    #[error("{node} is said to have computed {tick} otherwise than it should, and has not")]
    Accused {
        /// Who.
        node: NodeId,
        /// In which tick.
        tick: Tick,
    },
    /// A node's estimate of a peer's clock is wrong by more than its own bound.
    #[error("{node} is wrong about a clock by {error_us} us, where {bound_us} us is the most")]
    Clock {
        /// Who.
        node: NodeId,
        /// By how much.
        error_us: i64,
        /// By how much it may be.
        bound_us: u64,
    },
    /// A queue held more than its limit.
    #[error("{queue} held {held}, where {bound} is the bound")]
    Queue {
        /// Which.
        queue: &'static str,
        /// What it held.
        held: usize,
        /// What it may hold.
        bound: usize,
    },
    /// Links broke because their readers did not read, though none was dead, stopped or cut off.
    #[error("{links} links broke because their readers did not read, though nobody was dead or cut off")]
    Overflow {
        /// How many.
        links: u64,
    },
    /// Bodies did what bodies do not do.
    #[error("{what}, after {tick}")]
    Strained {
        /// After which tick.
        tick: Tick,
        /// What they did, how much of it, and how much was the most.
        what: String,
    },
    /// Recovery took too long.
    #[error("the group had not recovered after {} ms: {lack}", after.as_millis())]
    Slow {
        /// Time after which it was given up.
        after: Duration,
        /// The condition that did not hold then.
        lack: String,
    },
    /// Some condition did not hold at the end of a calm time.
    #[error("all has been calm for {} s, and {lack}", after.as_secs())]
    Unhealed {
        /// How long.
        after: Duration,
        /// The condition that does not hold.
        lack: String,
    },
    /// A state machine panicked.
    #[error("a machine panicked: {0}")]
    Panicked(String),
}
