//! Implements the cluster protocol (membership, lockstep, view changes, clients) as sans-I/O state machines:
//! each takes (now, event) and returns outputs, without socket, clock or thread. The runtime gives them links
//! and physics. The simulator gives them a virtual clock and a stand-in for physics. `now` is the time since
//! the process began, from a clock that never goes back.
//!
//! A group computes in lockstep. [`Server`] keeps the record and decides membership. [`Node`] computes
//! regions through a physics *device* ([`PhysicsCommand`], [`PhysicsEvent`]). One node contains the
//! [`Leader`]. [`Client`] hosts avatars.
//!
//! **A tick.**
//!
//! 1. The leader sends `Dispatch(t)` to each node.
//! 2. Each node steps its regions (`Step`) and sends border messages to the members that compute neighbours
//!    of them.
//! 3. When theirs have arrived, the node hands them to the physics (`Accept`).
//! 4. It sends `Done(t)` to the leader, which then opens the next tick.
//!
//! **A view change.** A start, a join, a leave and a death take the same steps. A death during a view change
//! begins another.
//!
//! 1. `Settle`: start nothing new; answer with the newest dispatches.
//! 2. `Finish`: complete these ticks with the survivors' messages alone; answer with all owned bodies.
//! 3. `Fetch`: return bodies that nobody owns, and those that move to another node.
//! 4. `Adopt`: build and drop bodies, exchange border messages once, and send `Done` of the view's own tick
//!    to the new leader, which goes on.

mod avatar_limits;
mod client;
mod correction;
mod coverage;
mod departed;
mod device;
pub mod directory;
mod groups;
mod joints;
mod leader;
mod node;
mod ping;
mod record;
mod server;
mod state_replication;
mod votes;

use bincode::{Decode, Encode};

use crate::space::{ClientId, NodeId};

pub use client::{BodyView, Client, ClientEvent, ClientOutput};
pub use correction::{correction, deviation_m, shift};
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) use departed::Departed;
pub use device::{PhysicsCommand, PhysicsEvent, Sampling, TickStats};
pub use directory::{Batch, Key};
pub use groups::{GroupError, GroupPolicy, GroupRules, Hint, HintUse, best_group, form_groups};
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) use joints::Joints;
pub use leader::{Deviations, Leader};
pub use node::{Node, NodeConfig, NodeCounters, NodeEvent, NodeOutput};
pub use ping::{ClockOffset, Pinger, RoundTrip, ping_interval_s};
pub use record::{Life, Record};
pub use server::{
    Audit, CanBuild, DrainError, Grouping, MAX_AVATARS, MAX_BUILT, MAX_BUILT_SHAPE_BYTES, MAX_SHAPE_BYTES,
    RestoreError, SavedWorld, Server, ServerConfig, ServerEvent, ServerOrigin, ServerOutput, Verification,
    WORLD_ENDED,
};
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) use server::{difference, highest_names, movable_bodies};
pub use state_replication::{ReplicationEvent, StateReplication, TickNews};
pub use votes::{
    Ballot, Call, DelayMonitor, DelayRules, Outcome, PeerDelay, PollCounts, PollRules, Polls, Tally,
    VoteError, VoteRefusal, VoteThresholds,
};

/// The other end of a link, as its certificate names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub enum Peer {
    /// The one server.
    Server,
    /// A node.
    Node(NodeId),
    /// A client.
    Client(ClientId),
}
