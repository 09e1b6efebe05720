//! Drains nodes: an operator takes a node out while the world runs, and the other nodes take over its
//! regions.

use super::Server;
use crate::protocol::Farewell;
use crate::space::{ClientId, NodeId};

/// The reason that a drained node is told.
const DRAINED: &str = "it was drained: other nodes have its regions";

/// The reason why a node is not drained. Each message names the remedy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrainError {
    /// No node of this id was ever in the world.
    #[error("{0} is no node of this world and never was; `dcd status` lists those that are")]
    Unknown(NodeId),
    /// The node has left the world already.
    #[error("{0} has left the world already; `dcd status` lists the nodes that are there")]
    Gone(NodeId),
    /// No other node could take its regions over.
    #[error(
        "{0} is the last node: start another one, which takes its regions over, and drain it then; or stop it (Ctrl-C, SIGTERM), \
         and the world stands still until a node comes"
    )]
    Last(NodeId),
    /// The server has no link with the node to tell it.
    #[error(
        "the server has no link with {0}, which could hand nothing over: look at its machine and the network, and kill it if it hangs; it \
         leaves by itself when it is not back within seconds"
    )]
    Unlinked(NodeId),
    /// The node was lost before it had handed its regions over.
    #[error(
        "{0} was lost before it had handed its regions over: other nodes have them as of the last checkpoint. It may still run; see to it \
         that it is stopped"
    )]
    Lost(NodeId),
    /// The node is a participant, and leaves with its client.
    #[error(
        "{0} is the participant of {1}, and leaves when its player does; to send it away is for the server's program"
    )]
    Plays(NodeId, ClientId),
    /// The node was started again before it had left.
    #[error("{0} was started again while it was drained, and has joined anew; drain it once more")]
    Back(NodeId),
    /// The node hangs, or other nodes do.
    #[error(
        "{0} has not handed its regions over yet; see the server's log for who hangs. It leaves as soon as it has"
    )]
    Slow(NodeId),
    /// Nobody is left who could tell whether the node was drained.
    #[error("the world has ended, or its server has stopped, while {0} was drained")]
    Over(NodeId),
}

impl Server {
    /// Returns whether a node can be drained now. [`DrainError::Gone`] is also returned for a node that never
    /// was there.
    pub fn check_drain(&self, node: NodeId) -> Result<(), DrainError> {
        let Some(entry) = self.common.nodes.get(&node) else { return Err(DrainError::Gone(node)) };
        if let Some(client) = entry.member.client {
            return Err(DrainError::Plays(node, client));
        }
        if !entry.linked {
            return Err(DrainError::Unlinked(node));
        }
        let mut others = self.common.nodes.iter().filter(|&(&other, _)| other != node);
        let has_heir = others.any(|(_, other)| other.linked && other.is_ready());
        if self.group_of(node).is_some() && !entry.leaving && !has_heir {
            return Err(DrainError::Last(node));
        }
        Ok(())
    }

    /// Returns whether a node that is to leave is still there. Returns an error if it has joined anew.
    pub fn is_draining(&self, node: NodeId) -> Result<bool, DrainError> {
        match self.common.nodes.get(&node) {
            Some(entry) if entry.leaving => Ok(true),
            Some(_) => Err(DrainError::Back(node)),
            None => Ok(false),
        }
    }

    /// Makes a node leave as if it had asked to.
    pub(super) fn drain(&mut self, node: NodeId) {
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            entry.leaving = true;
            entry.unwanted.get_or_insert((Farewell::Left, DRAINED.to_owned()));
        }
    }
}
