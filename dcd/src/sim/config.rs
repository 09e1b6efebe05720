//! Defines the configuration of a run: the cluster, its network, and what is recorded and verified.

use super::host::Skew;
use super::network::{Bounds, NetworkConditions, Path};
use crate::cluster::Grouping;
use crate::protocol::{SyncProtocol, Thresholds};
use crate::space::Balance;

/// The configuration of a run.
#[derive(Clone, Debug)]
pub struct SimConfig {
    /// The seed of everything random.
    pub seed: u64,
    /// The number of nodes at the start.
    pub nodes: u32,
    /// The number of regions of the world.
    pub regions: usize,
    /// The number of persistent bodies.
    pub bodies: u32,
    /// The largest speed of these bodies along each axis, m/s.
    pub speed_m_s: f64,
    /// The simulated seconds per tick.
    pub dt_s: f32,
    /// The network conditions at the start.
    pub network: NetworkConditions,
    /// Bounds on the bytes that may wait for a reader.
    pub bounds: Bounds,
    /// The time that the physics takes for a command.
    pub physics: Path,
    /// The skew of the clocks; `None`: all show the true time.
    pub skew: Option<Skew>,
    /// The thresholds of delay and distance.
    pub thresholds: Thresholds,
    /// The protocol by which members keep in step.
    pub protocol: SyncProtocol,
    /// How regions follow the load; `None`: they do not.
    pub balance: Option<Balance>,
    /// The rules of grouping.
    pub grouping: Grouping,
    /// The number of ticks from one state that clients are told to the next.
    pub state_every: u32,
    /// The number of clients that a leader tells itself; `None`: all.
    pub relays_above: Option<u32>,
    /// The number of ticks between nodes' checkpoints of moved bodies to the server.
    pub checkpoint_every: u64,
    /// Says whether the nodes and the server are recorded.
    pub record: bool,
    /// Says whether two of three nodes are participants and are all verified. Nobody plays their clients.
    pub verify: bool,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self {
            seed: 0,
            nodes: 3,
            regions: 8,
            bodies: 40,
            // Each body crosses several regions in a second or two.
            speed_m_s: 12.0,
            dt_s: 1.0 / 60.0,
            network: NetworkConditions::calm(Path::up_to(2_000)),
            bounds: Bounds::default(),
            physics: Path::up_to(2_000),
            skew: None,
            thresholds: Thresholds::default(),
            protocol: SyncProtocol::Synchronised,
            balance: None,
            grouping: Grouping::default(),
            state_every: 3,
            relays_above: None,
            checkpoint_every: 6,
            record: false,
            verify: false,
        }
    }
}
