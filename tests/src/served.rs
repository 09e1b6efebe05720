//! Serves a local world to two nodes and a client, all in this process, over real QUIC.

use std::time::{Duration, Instant};

use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;
use dcd::protocol::Pace;

/// A limit that nothing here comes near, even on a busy machine.
const LIMIT: Duration = Duration::from_secs(30);

/// A served world with all its processes.
pub struct Served {
    /// The client's world.
    pub client: World,
    /// The worlds of the two nodes.
    pub nodes: Vec<World>,
    /// The server's world.
    pub server: World,
    _data: tempfile::TempDir,
}

impl Served {
    /// Serves a copy of a world.
    pub fn of(world: &World) -> Self {
        let data = tempfile::tempdir().unwrap();
        let config = ServeConfig { nodes: 2, pace: Pace::RealTime, ..ServeConfig::new(data.path()) };
        let server = world.serve_copy(config).unwrap();
        let nodes = (0..2).map(|_| World::join_as_node(&join(&server, JoinRole::Node)).unwrap()).collect();
        let client = World::connect(&join(&server, JoinRole::Client)).unwrap();
        Self { client, nodes, server, _data: data }
    }

    /// Steps client and server until a condition holds at the client.
    pub fn until(&mut self, what: &str, mut is_so: impl FnMut(&World) -> bool) {
        let deadline = Instant::now() + LIMIT;
        while !is_so(&self.client) {
            assert!(Instant::now() < deadline, "not within {LIMIT:?}: {what}");
            self.client.poll(Duration::from_millis(5));
            self.client.step().unwrap();
            self.server.step().unwrap();
        }
    }
}

/// Returns the configuration to join with, with a new token.
pub fn join(server: &World, role: JoinRole) -> JoinConfig {
    JoinConfig::new(server.address().unwrap(), server.token(role, LIMIT).unwrap())
}
