//! Classifies messages by purpose, so that bytes between groups can be told from those inside them.

use crate::protocol::{Message, ToNode, ToServer};

/// The purpose of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Inter-group: state replication of bodies by way of the server, and which group is authoritative for them.
    BetweenGroups,
    /// Members of a group keep their ticks in step.
    InsideGroups,
    /// Members whose regions are neighbours exchange their borders.
    Borders,
    /// Between nodes and the server, except inter-group messages: joining, views, checkpoints.
    Server,
    /// To and from clients.
    Clients,
    /// Measures delays.
    Pings,
}

/// The number and bytes of messages sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Messages.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
}

impl Scope {
    /// Returns the purpose of this message.
    pub(super) fn of(message: &Message) -> Self {
        match message {
            Message::ToServer(ToServer::InterGroup { .. } | ToServer::Touched { .. })
            | Message::ToNode(ToNode::InterGroup { .. } | ToNode::Authority { .. }) => Self::BetweenGroups,
            Message::Dispatch(_) | Message::Done(_) | Message::Report(_) | Message::Testimony(_) => {
                Self::InsideGroups
            }
            Message::Border(_) | Message::Copied { .. } => Self::Borders,
            Message::Relay(_) | Message::Linked { .. } | Message::Fed { .. } => Self::InsideGroups,
            Message::FromClient(..) | Message::ToClient(..) => Self::Clients,
            Message::Waiting(_) | Message::Ping(_) | Message::Pong(_) => Self::Pings,
            _ => Self::Server,
        }
    }
}
