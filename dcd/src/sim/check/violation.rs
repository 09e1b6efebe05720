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
        /// The body.
        body: BodyId,
        /// The tick after which it is lost.
        tick: Tick,
    },
    /// Two nodes own a body.
    #[error("{body} has more than one owner after {tick}")]
    Doubled {
        /// The body.
        body: BodyId,
        /// The tick after which it has two owners.
        tick: Tick,
    },
    /// A ghost has seen a later epoch than its owner's.
    #[error("a ghost of {body} is newer than its owner after {tick}")]
    Outdated {
        /// The body.
        body: BodyId,
        /// The tick after which the ghost is newer.
        tick: Tick,
    },
    /// An owner's epoch went down.
    #[error("{body} went back from {before} to {after} after {tick}")]
    WentBack {
        /// The body.
        body: BodyId,
        /// Its earlier epoch.
        before: Epoch,
        /// Its epoch now.
        after: Epoch,
        /// The tick after which the epoch is lower.
        tick: Tick,
    },
    /// A node holds an older copy than it held before.
    #[error("{body} went back from {before} to {after} at {node} after {tick}")]
    NodeWentBack {
        /// The node.
        node: NodeId,
        /// The body.
        body: BodyId,
        /// Its earlier epoch.
        before: Epoch,
        /// Its epoch now.
        after: Epoch,
        /// The tick after which the copy is older.
        tick: Tick,
    },
    /// A client was shown an older state than before.
    #[error("{body} went back from {before:?} to {after:?} at {client}")]
    ClientWentBack {
        /// The client.
        client: ClientId,
        /// The body.
        body: BodyId,
        /// The epoch and tick that it had seen.
        before: (Epoch, Tick),
        /// The epoch and tick that it shows now.
        after: (Epoch, Tick),
    },
    /// A node that computes a view that is over holds a body at an epoch that its successors do not beat.
    #[error("{node}, whose view is over, holds {body} at {epoch}, its owner at {present}")]
    Overreach {
        /// The node.
        node: NodeId,
        /// The body.
        body: BodyId,
        /// The epoch at which the node holds it.
        epoch: Epoch,
        /// The epoch of its owner.
        present: Epoch,
    },
    /// Members took unequal numbers of rounds, or not the largest number that any of them had wanted.
    #[error("{tick} took {taken:?} rounds, where {wanted} were wanted")]
    Rounds {
        /// The tick.
        tick: Tick,
        /// The numbers of rounds that members took.
        taken: Vec<u32>,
        /// The largest number that a member wanted after the tick before.
        wanted: u32,
    },
    /// State that a node computed in a view that is over got into the record.
    #[error("a checkpoint of view {} from {node} changed {body} on record", view.0)]
    StaleCommit {
        /// The node.
        node: NodeId,
        /// The view in which it computed.
        view: ViewNumber,
        /// The body.
        body: BodyId,
    },
    /// Two members of a group have been unable to reach each other for too long.
    #[error("{a} and {b} are of one group and have not reached each other for {} ms", time.as_millis())]
    NoClique {
        /// One of the two.
        a: NodeId,
        /// The other one.
        b: NodeId,
        /// How long they have been unable.
        time: Duration,
    },
    /// A process was expelled though all processes lived and could reach each other.
    #[error("{node} was expelled though nobody was dead or cut off")]
    Expelled {
        /// The node.
        node: NodeId,
    },
    /// A participant was accused of computing wrongly though it computed what it should.
    #[error("{node} is said to have computed {tick} otherwise than it should, and has not")]
    Accused {
        /// The node.
        node: NodeId,
        /// The tick of which it was accused.
        tick: Tick,
    },
    /// A node's estimate of a peer's clock is wrong by more than its own bound.
    #[error("{node} is wrong about a clock by {error_us} us, where {bound_us} us is the most")]
    Clock {
        /// The node.
        node: NodeId,
        /// The error, microseconds.
        error_us: i64,
        /// The bound that the node states, microseconds.
        bound_us: u64,
    },
    /// A queue held more than its limit.
    #[error("{queue} held {held}, where {bound} is the bound")]
    Queue {
        /// The name of the queue.
        queue: &'static str,
        /// The amount that it held.
        held: usize,
        /// The amount that it may hold.
        bound: usize,
    },
    /// Links broke because their readers did not read, though no process was dead, stopped or cut off.
    #[error("{links} links broke because their readers did not read, though nobody was dead or cut off")]
    Overflow {
        /// The number of links.
        links: u64,
    },
    /// Bodies did what undisturbed bodies do not do: a [`Quantity`](crate::sim::Quantity) is beyond its gate.
    #[error("{what}, after {tick}")]
    Strained {
        /// The tick after which this was measured.
        tick: Tick,
        /// What the bodies did, how much of it, and how much is allowed.
        what: String,
    },
    /// Recovery took too long.
    #[error("the group had not recovered after {} ms: {lack}", after.as_millis())]
    Slow {
        /// The time after which waiting was given up.
        after: Duration,
        /// The condition that did not hold then.
        lack: String,
    },
    /// A condition did not hold at the end of a calm time.
    #[error("all has been calm for {} s, and {lack}", after.as_secs())]
    Unhealed {
        /// How long it has been calm.
        after: Duration,
        /// The condition that does not hold.
        lack: String,
    },
    /// A state machine panicked.
    #[error("a machine panicked: {0}")]
    Panicked(String),
}
