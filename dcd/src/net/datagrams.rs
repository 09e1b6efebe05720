//! Sends datagrams from threads other than the one that holds the network.

use std::sync::Arc;
use std::sync::mpsc;
use std::time::Duration;

use tokio::runtime::Handle;

use super::calls::Shared;
use super::{PeerKey, SendError};

/// The longest wait for the network's thread.
const PATIENCE: Duration = Duration::from_millis(100);

/// A handle that sends datagrams over the links of a [`Net`](super::Net).
#[derive(Clone)]
pub(crate) struct Datagrams {
    pub(super) shared: Arc<Shared>,
    pub(super) runtime: Handle,
}

impl Datagrams {
    /// Sends a datagram, as [`Net::send_datagram`](super::Net::send_datagram) does.
    pub(crate) fn send(&self, peer: PeerKey, bytes: Vec<u8>) -> Result<(), SendError> {
        self.shared.peer(peer).ok_or(SendError::NotConnected)?.send_datagram(bytes)
    }

    /// Returns the bytes of datagrams that wait to be sent.
    pub(crate) fn waiting(&self, peer: PeerKey) -> usize {
        self.shared.peer(peer).map_or(0, |peer| peer.datagrams_waiting())
    }

    /// Waits until the network's thread has served the links that were given something before this call. That
    /// thread does its work in the order in which it came up: a caller that sends to many links without this
    /// makes others wait for all of them.
    pub(crate) fn wait_for_turn(&self) {
        let (come, comes) = mpsc::sync_channel(1);
        self.runtime.spawn(async move {
            let _ = come.send(());
        });
        // A network that has been shut down drops the task, and ends the wait.
        let _ = comes.recv_timeout(PATIENCE);
    }
}
