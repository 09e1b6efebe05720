//! Classifies messages by purpose, so that bytes between groups can be told from bytes inside them.

use crate::protocol::{Message, ToNode, ToServer};

/// The purpose of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Messages between groups by way of the server: the states of bodies, and which group is authoritative
    /// for them.
    BetweenGroups,
    /// Messages by which members of a group keep their ticks in step.
    InsideGroups,
    /// Border messages, which members exchange whose regions are neighbours.
    Borders,
    /// Messages between nodes and the server, except those between groups: joining, views, checkpoints.
    Server,
    /// Messages to and from clients.
    Clients,
    /// Messages that measure delays.
    Pings,
}

/// The number of messages sent, and their bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// The number of messages.
    pub messages: u64,
    /// The number of bytes in them.
    pub bytes: u64,
}

impl Scope {
    /// Returns the purpose of a message.
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
