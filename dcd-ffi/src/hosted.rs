//! Processes that hold or compute a world for others, and show nothing of it: servers and nodes.

use std::time::Duration;

use dcd::net::PeerStats;
use dcd::runtime::{Member, ServerProcess, Stats};

use crate::connection::Network;
use crate::status::{DCD_ERR_NETWORK, DCD_ERR_UNSUPPORTED, Failure};
use crate::world::{DCD_ROLE_NODE, DCD_ROLE_SERVER, DcdRole};

/// What runs behind the handle, on threads of its own.
pub(crate) enum Process {
    Server(ServerProcess),
    Node(Member),
}

/// A server or a node, and what it knows of its world.
pub(crate) struct Hosted {
    pub process: Process,
    pub network: Network,
    pub dt_s: f32,
    pub gravity: [f32; 3],
}

impl Hosted {
    pub(crate) fn new(process: Process, dt_s: f32, gravity: [f32; 3]) -> Self {
        let connections = match &process {
            Process::Server(server) => server.connections(),
            Process::Node(node) => node.connections(),
        };
        Self { network: Network::new(connections.clone()), process, dt_s, gravity }
    }

    /// Takes in what came over the network, and says whether all is well.
    pub(crate) fn step(&mut self) -> Result<(), Failure> {
        self.network.listen();
        self.look()
    }

    pub(crate) fn role(&self) -> DcdRole {
        match self.process {
            Process::Server(_) => DCD_ROLE_SERVER,
            Process::Node(_) => DCD_ROLE_NODE,
        }
    }

    /// What this role cannot do with the bodies of its world.
    pub(crate) fn blind(&self, what: &str) -> Failure {
        let instead =
            "it works for others; join the world as a client (dcd_client_connect) to see it and play in it";
        self.unsupported(what, instead)
    }

    /// What this role cannot do, and what to do instead.
    pub(crate) fn unsupported(&self, what: &str, instead: &str) -> Failure {
        let role = match self.process {
            Process::Server(_) => "server",
            Process::Node(_) => "node",
        };
        Failure::new(DCD_ERR_UNSUPPORTED, format!("a {role} cannot {what}: {instead}"))
    }

    /// The server behind the handle.
    pub(crate) fn server(&self, what: &str, instead: &str) -> Result<&ServerProcess, Failure> {
        match &self.process {
            Process::Server(server) => Ok(server),
            Process::Node(_) => Err(self.unsupported(what, instead)),
        }
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> std::net::SocketAddr {
        match &self.process {
            Process::Server(server) => server.address,
            Process::Node(node) => node.address,
        }
    }

    pub(crate) fn tick(&self) -> u64 {
        match &self.process {
            Process::Server(server) => server.summary().tick.0,
            Process::Node(node) => node.tick().0,
        }
    }

    /// Whether all is well.
    pub(crate) fn look(&self) -> Result<(), Failure> {
        let over = |why| {
            Err(Failure::new(DCD_ERR_NETWORK, format!("{why}; destroy the world, and begin or join another")))
        };
        match &self.process {
            Process::Server(server) => match server.failure() {
                Some(failure) => Err(failure.into()),
                None if server.is_over() => over("the world has ended".to_owned()),
                None => Ok(()),
            },
            Process::Node(node) => match node.ended() {
                Some(Some(cause)) => over(cause),
                Some(None) => over("the world has ended, or its server let this node go".to_owned()),
                None => Ok(()),
            },
        }
    }

    /// Regions of the world, or of this node.
    pub(crate) fn regions(&self) -> usize {
        match &self.process {
            Process::Server(server) => server.summary().regions,
            Process::Node(node) => node.summary().regions,
        }
    }

    pub(crate) fn stats(&self) -> Stats {
        match &self.process {
            Process::Server(server) => {
                let summary = server.summary();
                Stats { ticks: summary.tick.0, bodies: summary.bodies, ..Stats::default() }
            }
            Process::Node(node) => {
                let summary = node.summary();
                let last_us = summary.compute_us.last().copied().unwrap_or_default();
                Stats {
                    ticks: summary.tick.0,
                    bodies: summary.bodies as usize,
                    transfers: summary.transfers,
                    last_step: Duration::from_micros(last_us.into()),
                    ..Stats::default()
                }
            }
        }
    }

    pub(crate) fn traffic(&self) -> PeerStats {
        match &self.process {
            Process::Server(server) => server.traffic(),
            Process::Node(node) => node.traffic(),
        }
    }
}
