//! Defines the messages by which a member of a group tells clients the states of bodies in the leader's place (a relay).

use bincode::{Decode, Encode};

use super::{Area, ViewNumber};
use crate::space::{Allocation, BodyId, ClientId, Tick};

/// A message of a leader to a relay.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToRelay {
    /// These clients are asked to link with the receiver, who says when one does, and when its link ends
    /// ([`Message::Linked`](super::Message::Linked)).
    Expect {
        /// The present view.
        view: ViewNumber,
        /// In id order.
        clients: Vec<ClientId>,
    },
    /// What a tick changes for the receiver's clients.
    News(Box<RelayNews>),
    /// States of a speculative tick.
    Guess {
        /// The present view.
        view: ViewNumber,
        /// Later messages to a relay have higher numbers.
        number: u64,
        /// The number of the news against which the states are written.
        follows: u64,
        /// Which tick.
        tick: Tick,
        /// Bodies in id order, written against what was told before (module `delta`).
        states: Vec<u8>,
    },
}

/// What a tick changes for the clients of a relay; of several parts only the first says more than states.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct RelayNews {
    /// The present view.
    pub view: ViewNumber,
    /// Whether the relay begins anew: it has no clients but those that follow, and knows of no body but those that are told.
    pub begins: bool,
    /// Whether another part of the same tick follows.
    pub more: bool,
    /// Later messages to a relay have higher numbers, parts of a tick too.
    pub number: u64,
    /// The number of the news before; 0: it begins. What was lost with a link is missed so.
    pub follows: u64,
    /// After which tick.
    pub tick: Tick,
    /// When the leader opened that tick, microseconds of its own clock.
    pub opened_us: u64,
    /// Whether no tick follows.
    pub is_last: bool,
    /// Clients that the relay is to tell from now on, each with the number of its turn, and those that it is to tell no more, in id order.
    pub clients: Vec<(ClientId, Option<u32>)>,
    /// Interests that its clients have named.
    pub interests: Vec<(ClientId, Option<Area>)>,
    /// Up to which of its inputs a client's are applied, and how early the newest came.
    pub applied: Vec<(ClientId, u64, i8)>,
    /// Bodies that are gone.
    pub gone: Vec<BodyId>,
    /// Who computes which region, if that is new.
    pub allocation: Option<Allocation>,
    /// Bodies near what its clients are interested in that moved, or came to be near it, in id order, and after which tick they were so: written
    /// against what was told before (module `delta`).
    pub states: Vec<u8>,
}
