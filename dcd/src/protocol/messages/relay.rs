//! Defines the messages by which a member of a group tells clients the states of bodies in the leader's place
//! (a relay).

use bincode::{Decode, Encode};

use super::{Area, ViewNumber};
use crate::space::{Allocation, BodyId, ClientId, Tick};

/// A message of a leader to a relay.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToRelay {
    /// Tells that these clients are asked to link with the receiver. The receiver tells when one does, and
    /// when its link ends ([`Message::Linked`](super::Message::Linked)).
    Expect {
        /// The present view.
        view: ViewNumber,
        /// The clients, in id order.
        clients: Vec<ClientId>,
    },
    /// Brings what a tick changes for the receiver's clients.
    News(Box<RelayNews>),
    /// Brings states of a speculative tick.
    Guess {
        /// The present view.
        view: ViewNumber,
        /// The number of the message. Later messages to a relay have higher numbers.
        number: u64,
        /// The number of the news against which the states are written.
        follows: u64,
        /// The tick.
        tick: Tick,
        /// The states of bodies in id order, written against what was told before (module `delta`).
        states: Vec<u8>,
    },
}

/// What a tick changes for the clients of a relay. If it comes in several parts, only the first has more than
/// states.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct RelayNews {
    /// The present view.
    pub view: ViewNumber,
    /// Says whether the relay begins anew: it has no clients except those that follow, and knows of no body except
    /// those that are told.
    pub begins: bool,
    /// Says whether another part of the same tick follows.
    pub more: bool,
    /// The number of the message. Later messages to a relay have higher numbers, and so have later parts of a
    /// tick.
    pub number: u64,
    /// The number of the news before; 0 at the beginning. By it the relay notices what was lost with a link.
    pub follows: u64,
    /// The tick after which this holds.
    pub tick: Tick,
    /// The time at which the leader opened that tick, microseconds of its own clock.
    pub opened_us: u64,
    /// Says whether no tick follows.
    pub is_last: bool,
    /// The clients that the relay is to tell from now on, each with the number of its turn, and those that it
    /// is to tell no more (`None`), in id order.
    pub clients: Vec<(ClientId, Option<u32>)>,
    /// The interests that its clients have named.
    pub interests: Vec<(ClientId, Option<Area>)>,
    /// For a client: the number up to which its inputs are applied, and how early the newest came.
    pub applied: Vec<(ClientId, u64, i8)>,
    /// The bodies that are gone.
    pub gone: Vec<BodyId>,
    /// The member that computes each region, if that has changed.
    pub allocation: Option<Allocation>,
    /// The states of bodies near what its clients are interested in that moved or came near it, in id order,
    /// each with its tick, written against what was told before (module `delta`).
    pub states: Vec<u8>,
}
