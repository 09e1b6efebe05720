//! What messages are for, so that bytes between groups can be told from those inside them.

use crate::protocol::{Message, ToNode, ToServer};

/// What a message is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Groups tell each other of bodies, by way of the server, and which of them is believed.
    BetweenGroups,
    /// Members of a group keep their ticks in step and exchange their borders.
    InsideGroups,
    /// Between nodes and the server, but for what groups tell each other: joining, views, checkpoints.
    Server,
    /// To and from clients.
    Clients,
    /// Measures delays.
    Pings,
}

/// How much was sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Messages.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
}

impl Scope {
    /// What this message is for.
    pub(super) fn of(message: &Message) -> Self {
        match message {
            Message::ToServer(ToServer::InterGroup { .. } | ToServer::Touched { .. })
            | Message::ToNode(ToNode::InterGroup { .. } | ToNode::Authority { .. }) => Self::BetweenGroups,
            Message::Dispatch(_) | Message::Done(_) | Message::Report(_) | Message::Border(_) => {
                Self::InsideGroups
            }
            Message::FromClient(..) | Message::ToClient(..) => Self::Clients,
            Message::Ping(_) | Message::Pong(_) => Self::Pings,
            _ => Self::Server,
        }
    }
}
