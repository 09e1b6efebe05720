//! Configures a server: where it listens, what it keeps, how its world is paced, and who may share a group.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use crate::cluster::Grouping;
use crate::protocol::{Pace, Thresholds};
use crate::space::Tick;

/// How long avatars wait for their client.
const AVATAR_EXPIRY: Duration = Duration::from_secs(3_600);

/// The settings of a server.
#[derive(Clone, Debug)]
pub struct ServeConfig {
    /// Where to listen; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Folder of the authority (keys, used tokens) and of the world: a server that died and is started again with the same
    /// origin and settings goes on with it.
    pub data: PathBuf,
    /// Where the world is kept, if not in `data`: `etcd://HOST:PORT[,HOST:PORT...]/NAME` names members of an etcd cluster, and the world
    /// there. Servers with the same place and the same origin stand by for one another: one serves, and the others wait until
    /// it is gone. Over TLS it is `etcds://…/NAME?cacert=FILE`, the certificate of etcd's authority in PEM. More follows with `&` in
    /// between: `cert=FILE` and `key=FILE`, where etcd asks for certificates, `user=NAME` and `password-file=FILE`, where it has users;
    /// without a file the password is in the environment's `DCD_ETCD_PASSWORD`. Needs the feature `etcd`.
    pub directory: Option<String>,
    /// Begin anew, and forget a world that is stored there.
    pub fresh: bool,
    /// Nodes to wait for before the first tick.
    pub nodes: usize,
    /// How fast ticks follow one another.
    pub pace: Pace,
    /// Ticks from one state of a moving body that clients are told to the next, 1 to 30: what they show between is interpolated, and
    /// the more often they are told, the more bytes it takes.
    pub state_every: u32,
    /// Stop after this tick.
    pub last_tick: Option<Tick>,
    /// The fastest that avatars may be asked to move, m/s.
    pub avatar_speed_limit: f32,
    /// How long the avatars of a client that left wait for its return; then they are removed.
    pub avatar_expiry: Duration,
    /// Whether the program hears of the contacts of all bodies that ask for them (`World::events`), over the network. Each client hears of
    /// those of its avatars anyway.
    pub events: bool,
    /// A file to record the server to: all that it is given, and a digest of all that it sends and stores.
    pub record: Option<PathBuf>,
    /// An address where the server answers over HTTP with its metrics (`/metrics`, in Prometheus' format) and whether it is well
    /// (`/healthz`, `/readyz`). Whoever reaches it may read that.
    pub metrics: Option<SocketAddr>,
    /// The clients that the leader of a group tells the states of bodies itself; those beyond are told by other dedicated nodes of the group, which it
    /// tells once each. `None`: it tells all.
    pub relays_above: Option<u32>,
    /// The share of participants, 0 to 1, whose regions the leader computes once more to compare the two, where that is a dedicated node: each
    /// is drawn when it begins to compute, and not told. One that computes otherwise is sent away.
    pub verify: f64,
    /// How members of a group keep in step, which nodes may share a group, and how far apart groups may be.
    pub groups: GroupConfig,
}

impl ServeConfig {
    /// Returns the usual settings: any free port of this machine alone, one node to wait for, in real time, until it is stopped,
    /// states every third tick, avatars of up to 20 m/s that wait an hour for their client.
    #[must_use]
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 0)),
            data: data.into(),
            directory: None,
            fresh: false,
            nodes: 1,
            pace: Pace::RealTime,
            state_every: 3,
            last_tick: None,
            avatar_speed_limit: 20.0,
            avatar_expiry: AVATAR_EXPIRY,
            events: true,
            record: None,
            metrics: None,
            relays_above: None,
            verify: 0.0,
            groups: GroupConfig::default(),
        }
    }
}

/// The settings of groups of nodes: lockstep or not, thresholds, sizes, votes.
#[derive(Clone, Debug, Default)]
pub struct GroupConfig {
    /// Members run ahead of one another by at most so many ticks and extrapolate (the thesis's unsynchronised mode); 0: lockstep.
    /// With the coupling `owner` only.
    pub lag_ticks: u32,
    /// Thresholds of delay and distance of groups.
    pub thresholds: Thresholds,
    /// Sizes, policies, votes.
    pub grouping: Grouping,
}
