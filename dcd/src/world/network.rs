//! Exposes the connections of a served world, the messages between programs, and the network traffic.

use std::time::Duration;

use super::World;
use super::error::Error;
use super::role::{Instead, Unsupported};
use crate::net::PeerStats;
use crate::runtime::{Connection, ConnectionEvent, ConnectionId, Connections, Delivery, ProgramMessage};

/// The connections of a served world, with the events and messages that arrived over them up to the last
/// step.
pub(super) struct Network {
    connections: Connections,
    /// The number of arrivals up to the last step.
    seen: u64,
    events: Vec<ConnectionEvent>,
    messages: Vec<ProgramMessage>,
}

impl Network {
    pub(super) fn new(connections: Connections) -> Self {
        Self { connections, seen: 0, events: Vec::new(), messages: Vec::new() }
    }

    /// Takes in what has arrived since the last step.
    pub(super) fn listen(&mut self) {
        self.seen = self.connections.arrivals();
        self.events = self.connections.take_events();
        self.messages = self.connections.take_messages();
    }

    pub(super) fn poll(&self, timeout: Duration) -> bool {
        self.connections.wait(self.seen, timeout)
    }
}

/// A handle that waits for what a world's next step would take in, without borrowing the world
/// ([`World::arrivals`]).
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
    /// Waits until something has arrived since the step of the world after which this handle was made, or the
    /// world has ended, but not longer than `timeout`. Returns false if the time ran out.
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

    /// Lists the processes to which this one is connected, the oldest connection first; empty in a local
    /// world. A server is connected to each node, client and participant. The others are connected to their
    /// server, and to the nodes of their group that they need.
    #[must_use]
    pub fn connections(&self) -> Vec<Connection> {
        self.network().map(|network| network.connections.list()).unwrap_or_default()
    }

    /// Returns a connection as it is now; `None` if it is gone.
    #[must_use]
    pub fn connection(&self, id: ConnectionId) -> Option<Connection> {
        self.network()?.connections.get(id)
    }

    /// Returns the events of connections (new, lost, back, gone) that were taken in by the last step, in
    /// order.
    #[must_use]
    pub fn connection_events(&self) -> &[ConnectionEvent] {
        self.network().map_or(&[], |network| &network.events)
    }

    /// Returns the messages from the programs of other processes that were taken in by the last step.
    #[must_use]
    pub fn messages(&self) -> &[ProgramMessage] {
        self.network().map_or(&[], |network| &network.messages)
    }

    /// Sends bytes to the program at the other end of a connection, where the next step adds them to
    /// [`World::messages`]. A server's program may send to every process, the others to the server only.
    pub fn send(&self, to: ConnectionId, bytes: &[u8], delivery: Delivery) -> Result<(), Error> {
        let network = self.network().ok_or_else(|| self.refuse("send messages", Instead::Serve))?;
        Ok(network.connections.send(to, bytes, delivery)?)
    }

    /// Disconnects a process from a server's world and tells it why; servers only. A node's regions are
    /// handed over first. A client's avatars wait for its return, for which it needs a new token.
    pub fn disconnect(&self, who: ConnectionId, why: &str) -> Result<(), Error> {
        let network = self.network().ok_or_else(|| self.refuse("send processes away", Instead::Serve))?;
        Ok(network.connections.disconnect(who, why)?)
    }

    /// Returns a handle that waits for the network without borrowing the world; `None` for a local world,
    /// where nothing arrives.
    pub fn arrivals(&self) -> Option<Arrivals> {
        let Network { connections, seen, .. } = self.network()?;
        Some(Arrivals { connections: connections.clone(), seen: *seen })
    }

    /// Returns the network traffic of this process so far; zero in a local world.
    #[must_use]
    pub fn traffic(&self) -> PeerStats {
        self.remote().map(|world| world.traffic()).unwrap_or_default()
    }
}
