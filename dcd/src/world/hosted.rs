//! Implements [`World`](super::World) for servers and nodes, which serve or compute a world for others and show nothing of it.

use std::net::SocketAddr;
use std::time::Duration;

use super::error::Error;
use super::network::Network;
use super::remote::Remote;
use super::role::Role;
use crate::net::PeerStats;
use crate::runtime::{Member, SUSPENDED, ServerProcess, Stats};
use crate::space::Tick;

/// The process that runs behind the world, on threads of its own.
pub(super) enum Process {
    Server(ServerProcess),
    Node(Member),
}

/// A server or a node, and what it knows of its world.
pub(super) struct Hosted {
    process: Process,
    network: Network,
    dt_s: f32,
    gravity: [f32; 3],
}

impl Hosted {
    pub(super) fn new(process: Process, dt_s: f32, gravity: [f32; 3]) -> Self {
        let connections = match &process {
            Process::Server(server) => server.connections(),
            Process::Node(node) => node.connections(),
        };
        Self { network: Network::new(connections.clone()), process, dt_s, gravity }
    }

    /// Returns an error if the process has failed or ended.
    fn look(&self) -> Result<(), Error> {
        let over = |why| Err(Error::Lost(format!("{why}; destroy the world, and begin or join another")));
        match &self.process {
            Process::Server(server) => match server.failure() {
                Some(failure) => Err(failure.into()),
                None if server.is_suspended() => over(SUSPENDED.to_owned()),
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
}

impl Remote for Hosted {
    fn role(&self) -> Role {
        match self.process {
            Process::Server(_) => Role::Server,
            Process::Node(_) => Role::Node,
        }
    }

    fn dt_s(&self) -> f32 {
        self.dt_s
    }

    fn gravity(&self) -> [f32; 3] {
        self.gravity
    }

    fn step(&mut self) -> Result<(), Error> {
        self.network.listen();
        self.look()
    }

    fn poll(&self, timeout: Duration) -> bool {
        self.network.poll(timeout)
    }

    fn is_lost(&self) -> bool {
        self.look().is_err()
    }

    fn network(&self) -> &Network {
        &self.network
    }

    fn server(&self) -> Option<&ServerProcess> {
        match &self.process {
            Process::Server(server) => Some(server),
            Process::Node(_) => None,
        }
    }

    fn address(&self) -> Option<SocketAddr> {
        Some(match &self.process {
            Process::Server(server) => server.address,
            Process::Node(node) => node.address,
        })
    }

    fn tick(&self) -> Tick {
        match &self.process {
            Process::Server(server) => server.summary().tick,
            Process::Node(node) => node.tick(),
        }
    }

    fn region_count(&self) -> usize {
        match &self.process {
            Process::Server(server) => server.summary().regions,
            Process::Node(node) => node.summary().regions,
        }
    }

    fn stats(&self) -> Stats {
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

    fn traffic(&self) -> PeerStats {
        match &self.process {
            Process::Server(server) => server.traffic(),
            Process::Node(node) => node.traffic(),
        }
    }
}
