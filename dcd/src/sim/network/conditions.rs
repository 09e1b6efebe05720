//! Defines the conditions of the simulated network: delays, loss, sites, and cuts between processes.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::cluster::Peer;
use crate::protocol::link;
use crate::sim::Random;

/// The delay of packets on a path: from `base_us` to `base_us + jitter_us`, microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Path {
    /// The delay of the quickest packet, microseconds.
    pub base_us: u64,
    /// How much later the slowest packet may be, microseconds.
    pub jitter_us: u64,
}

impl Path {
    /// Returns a path on which packets take at most `longest_us`, and at least a tenth of that.
    pub const fn up_to(longest_us: u64) -> Self {
        Self { base_us: longest_us / 10, jitter_us: longest_us - longest_us / 10 }
    }

    pub(in crate::sim) fn draw(self, random: &mut Random) -> Duration {
        Duration::from_micros(self.base_us + random.below(self.jitter_us + 1))
    }

    pub(super) fn longest(self) -> Duration {
        Duration::from_micros(self.base_us + self.jitter_us)
    }
}

/// The delay, loss, duplication and reordering of packets.
///
/// Frames of reliable lanes keep their order whatever happens to their packets: loss shows as delay.
/// Datagrams are lost, doubled and overtaken.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkConditions {
    /// The path between processes of one site.
    pub near: Path,
    /// The path between sites.
    pub far: Path,
    /// The sites of processes. Processes that are not named are at site 0.
    pub sites: BTreeMap<Peer, u32>,
    /// The path between the server and all others; `None`: as between any two.
    pub server: Option<Path>,
    /// The fraction of packets that are lost.
    pub loss: f64,
    /// The fraction of packets that take a detour, so that later packets overtake them.
    pub reorder: f64,
    /// How much longer the detour takes.
    pub detour: Duration,
    /// The fraction of packets that arrive twice.
    pub duplicate: f64,
}

impl NetworkConditions {
    /// Returns conditions in which nothing goes wrong and all paths are alike.
    pub const fn calm(near: Path) -> Self {
        Self {
            near,
            far: near,
            sites: BTreeMap::new(),
            server: None,
            loss: 0.0,
            reorder: 0.0,
            detour: Duration::from_millis(50),
            duplicate: 0.0,
        }
    }

    /// Returns the site of a process.
    pub fn site(&self, peer: Peer) -> u32 {
        self.sites.get(&peer).copied().unwrap_or_default()
    }

    /// Returns the path between two processes.
    pub fn path(&self, from: Peer, to: Peer) -> Path {
        match self.server {
            Some(path) if from == Peer::Server || to == Peer::Server => path,
            _ if self.sites.is_empty() || self.site(from) == self.site(to) => self.near,
            _ => self.far,
        }
    }
}

/// Bounds on the bytes that wait between a sender and the machine that reads them; by default those of real
/// links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// The bytes that a reader's process takes in before its machine has read them.
    pub inbox_bytes: usize,
    /// The bytes that the sender keeps beyond these for a server or node, in flight and waiting.
    pub queue_bytes: usize,
    /// The same for a client.
    pub client_queue_bytes: usize,
    /// The bytes of datagrams that a process takes in before its machine has read them.
    pub datagram_bytes: usize,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            inbox_bytes: link::inbox_bytes(link::FRAME_BYTES),
            queue_bytes: link::WINDOW_BYTES + link::QUEUE_BYTES,
            client_queue_bytes: 2 * link::CLIENT_QUEUE_BYTES,
            datagram_bytes: link::DATAGRAM_QUEUE_BYTES,
        }
    }
}

impl Bounds {
    /// Returns the bytes that a sender may keep for this peer.
    pub(super) fn queue_for(&self, to: Peer) -> usize {
        match to {
            Peer::Client(_) => self.client_queue_bytes,
            Peer::Server | Peer::Node(_) => self.queue_bytes,
        }
    }
}

/// A side of a cut: a set of processes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Who {
    /// These processes.
    Only(BTreeSet<Peer>),
    /// All other processes, including those still to come.
    AllBut(BTreeSet<Peer>),
}

impl Who {
    /// Returns the side that has one process only.
    pub fn one(peer: Peer) -> Self {
        Self::Only(BTreeSet::from([peer]))
    }

    /// Returns whether a process is on this side.
    pub fn has(&self, peer: Peer) -> bool {
        match self {
            Self::Only(peers) => peers.contains(&peer),
            Self::AllBut(peers) => !peers.contains(&peer),
        }
    }
}

/// A one-way cut until a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cut {
    /// The senders whose packets are lost.
    pub from: Who,
    /// The receivers that miss these packets.
    pub to: Who,
    /// The end of the cut.
    pub until: Duration,
}

impl Cut {
    /// Returns cuts between these processes and all others, both ways.
    pub fn partition(island: BTreeSet<Peer>, until: Duration) -> [Self; 2] {
        let (inside, outside) = (Who::Only(island.clone()), Who::AllBut(island));
        [Self { from: inside.clone(), to: outside.clone(), until }, Self { from: outside, to: inside, until }]
    }

    /// Returns cuts between these two, both ways. All others reach both.
    pub fn between(a: Peer, b: Peer, until: Duration) -> [Self; 2] {
        [
            Self { from: Who::one(a), to: Who::one(b), until },
            Self { from: Who::one(b), to: Who::one(a), until },
        ]
    }

    pub(super) fn stops(&self, from: Peer, to: Peer) -> bool {
        self.from.has(from) && self.to.has(to)
    }
}
