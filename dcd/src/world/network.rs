//! Exposes the connections of a served world, the messages between its programs, and the traffic.

use std::time::Duration;

use super::World;
use super::error::Error;
use super::role::{Instead, Unsupported};
use crate::net::PeerStats;
use crate::runtime::{Connection, ConnectionEvent, ConnectionId, Connections, Delivery, ProgramMessage};

/// The connections of a served world, and the events and messages that came over them up to its last step.
pub(super) struct Network {
    connections: Connections,
    /// How many arrivals there had been by then.
    seen: u64,
    events: Vec<ConnectionEvent>,
    messages: Vec<ProgramMessage>,
}

impl Network {
    pub(super) fn new(connections: Connections) -> Self {
        Self { connections, seen: 0, events: Vec::new(), messages: Vec::new() }
    }

    /// Takes in what has come since the last step.
    pub(super) fn listen(&mut self) {
        self.seen = self.connections.arrivals();
        self.events = self.connections.take_events();
        self.messages = self.connections.take_messages();
    }

    pub(super) fn poll(&self, timeout: Duration) -> bool {
        self.connections.wait(self.seen, timeout)
    }
}

/// A handle that waits for what a world's next step would take in, without holding the world.
#[derive(Clone)]
#[must_use]
pub struct Arrivals {
    connections: Connections,
    seen: u64,
}

impl std::fmt::Debug for Arrivals {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("Arrivals").field("seen", &self.seen).finish_non_exhaustive()
    }
}

impl Arrivals {
    /// Waits until something has come since the world's last step, or the world has ended, but not longer than `timeout`; returns
    /// whether it came.
    pub fn wait(&self, timeout: Duration) -> bool {
        self.connections.wait(self.seen, timeout)
    }
}

/// Connections and messages between programs.
impl World {
    fn network(&self) -> Option<&Network> {
        self.remote().map(|world| world.network())
    }

    pub(super) fn refuse(&self, what: &'static str, instead: Instead) -> Error {
        Unsupported { role: self.role(), what, instead }.into()
    }

    /// Returns an error for a local world, which has no connections.
    #[doc(hidden)]
    pub fn has_network(&self, what: &'static str) -> Result<(), Error> {
        self.network().map(drop).ok_or_else(|| self.refuse(what, Instead::Serve))
    }

    /// Lists the processes that this one is connected with, the oldest connection first; none in a local world. A server has one
    /// with each node, client and participant; others have one with their server, and with the nodes of their group that they
    /// need.
    #[must_use]
    pub fn connections(&self) -> Vec<Connection> {
        self.network().map(|network| network.connections.list()).unwrap_or_default()
    }

    /// Returns one connection as it is now; `None` once it is gone.
    #[must_use]
    pub fn connection(&self, id: ConnectionId) -> Option<Connection> {
        self.network()?.connections.get(id)
    }

    /// Returns the events of connections (new, lost, back, gone) up to the last step, in order.
    #[must_use]
    pub fn connection_events(&self) -> &[ConnectionEvent] {
        self.network().map_or(&[], |network| &network.events)
    }

    /// Returns the messages that programs of other processes sent to this one, up to the last step.
    #[must_use]
    pub fn messages(&self) -> &[ProgramMessage] {
        self.network().map_or(&[], |network| &network.messages)
    }

    /// Sends bytes to the program at the other end of a connection, where they are among the [`World::messages`] after its next
    /// step. A server's program may send to every process, the others to the server only.
    pub fn send(&self, to: ConnectionId, bytes: &[u8], delivery: Delivery) -> Result<(), Error> {
        let network = self.network().ok_or_else(|| self.refuse("send messages", Instead::Serve))?;
        Ok(network.connections.send(to, bytes, delivery)?)
    }

    /// Disconnects a process from a server's world, and tells it why. A node's regions are handed over first; a client's avatars
    /// wait for its return, which takes a new token.
    pub fn disconnect(&self, who: ConnectionId, why: &str) -> Result<(), Error> {
        let network = self.network().ok_or_else(|| self.refuse("send processes away", Instead::Serve))?;
        Ok(network.connections.disconnect(who, why)?)
    }

    /// Returns a handle that waits for the network without holding the world; `None` for a local world, to which nothing comes.
    pub fn arrivals(&self) -> Option<Arrivals> {
        let Network { connections, seen, .. } = self.network()?;
        Some(Arrivals { connections: connections.clone(), seen: *seen })
    }

    /// Returns the traffic over the network so far; zero in a local world.
    #[must_use]
    pub fn traffic(&self) -> PeerStats {
        self.remote().map(|world| world.traffic()).unwrap_or_default()
    }
}
