//! Lets a state replication run in place, with its leader or relay, or elsewhere, on another thread.

use super::{ReplicationEvent, StateReplication};
use crate::protocol::{Message, ToClient};
use crate::space::{ClientId, NodeId};

/// The place where clients' states are chosen and coded.
#[derive(Clone, Debug)]
pub(in crate::cluster) enum Replication {
    /// The same process, at once.
    Here(Box<StateReplication>),
    /// On another thread, which is given these events.
    Elsewhere(Vec<ReplicationEvent>),
}

/// The messages of a replication: to clients, and to other members.
pub(in crate::cluster) type Said = (Vec<(ClientId, ToClient)>, Vec<(NodeId, Message)>);

impl Replication {
    /// Gives the replication an event, and returns the messages that follow from it here.
    pub(in crate::cluster) fn handle(&mut self, event: ReplicationEvent) -> Said {
        match self {
            Self::Here(replication) => {
                replication.handle(event);
                (replication.take_messages(), replication.take_member_messages())
            }
            Self::Elsewhere(events) => {
                events.push(event);
                Said::default()
            }
        }
    }

    /// Has the replication run elsewhere, from its beginning on.
    pub(in crate::cluster) fn moved_elsewhere(self) -> Self {
        match self {
            Self::Here(replication) => {
                Self::Elsewhere(vec![ReplicationEvent::Begin(Box::new(replication.with_own_thread()))])
            }
            Self::Elsewhere(_) => self,
        }
    }

    /// Returns the events for a replication elsewhere since the last call.
    pub(in crate::cluster) fn take_events(&mut self) -> Vec<ReplicationEvent> {
        match self {
            Self::Here(_) => Vec::new(),
            Self::Elsewhere(events) => std::mem::take(events),
        }
    }
}
