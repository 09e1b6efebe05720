//! Configures a server: where it listens, what it stores, how its world is paced, and which nodes may share a
//! group.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use crate::cluster::Grouping;
use crate::protocol::{Pace, Thresholds};
use crate::space::Tick;

/// How long avatars wait for their client, by default.
const AVATAR_EXPIRY: Duration = Duration::from_secs(3_600);

/// The settings of a server.
#[derive(Clone, Debug)]
pub struct ServeConfig {
    /// The address to listen on; port 0 takes any free port.
    pub listen: SocketAddr,
    /// The folder of the authority (keys, used tokens) and of the world. A server that died and is started
    /// again with the same origin and settings goes on with the world stored there.
    pub data: PathBuf,
    /// The place where the world is stored, if not in `data`; needs the feature `etcd`.
    /// `etcd://HOST:PORT[,HOST:PORT...]/NAME` names members of an etcd cluster, and the world there. Servers
    /// with the same place and the same origin are standbys of one another: one serves, and the others wait
    /// until it is gone.
    ///
    /// Over TLS it is `etcds://…/NAME?cacert=FILE`, with the certificate of etcd's authority in PEM. More
    /// settings follow, separated by `&`: `cert=FILE` and `key=FILE`, where etcd asks for certificates, and
    /// `user=NAME` and `password-file=FILE`, where it has users. Without a password file the password is in
    /// the environment variable `DCD_ETCD_PASSWORD`.
    pub directory: Option<String>,
    /// Says whether to begin anew and forget a world that is stored there.
    pub fresh: bool,
    /// The number of nodes to wait for before the first tick; 0 counts as 1.
    pub nodes: usize,
    /// How fast ticks follow one another.
    pub pace: Pace,
    /// The number of ticks, 1 to 30, between two states of a moving body that clients are sent. Clients
    /// interpolate between them; more frequent states take more bytes.
    pub state_every: u32,
    /// The tick after which the world ends; `None` for no end.
    pub last_tick: Option<Tick>,
    /// The speed limit of avatars, m/s: none may be asked to move faster.
    pub avatar_speed_limit: f32,
    /// How long the avatars of a client that has left wait for its return, before they are removed.
    pub avatar_expiry: Duration,
    /// Says whether nodes report the contacts of all bodies that ask for them to the program (`World::events`),
    /// over the network. A client receives those of its avatars in either case.
    pub events: bool,
    /// A file to which the server is recorded: all that it is given, and a digest of all that it sends and
    /// stores.
    pub record: Option<PathBuf>,
    /// An address at which the server answers over HTTP with its metrics (`/metrics`, in Prometheus' format)
    /// and its health (`/healthz`, `/readyz`). Everyone who reaches the address may read that.
    pub metrics: Option<SocketAddr>,
    /// The number of clients to which the leader of a group sends states of bodies itself. Other dedicated
    /// nodes of the group (relays) serve the clients beyond that number; the leader sends the states once to
    /// each relay. `None`: the leader serves all clients.
    pub relays_above: Option<u32>,
    /// The share of participants, 0 to 1, that are verified: the leader, if it is a dedicated node, computes
    /// their regions once more and compares. Each participant is drawn when it begins to compute, and not
    /// told. One whose results differ is sent away.
    pub verify: f64,
    /// How members of a group keep in step, which nodes may share a group, and how far apart groups may be.
    pub groups: GroupConfig,
}

impl ServeConfig {
    /// Returns the default settings, with the data folder `data`: any free port of this machine alone, one
    /// node to wait for, real time, no last tick, states every third tick, a speed limit of 20 m/s for
    /// avatars, which wait an hour for their client.
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

/// The settings of consistency groups of nodes: lockstep or lag, thresholds, sizes, votes.
#[derive(Clone, Debug, Default)]
pub struct GroupConfig {
    /// The number of ticks by which members of a group may run ahead of one another, extrapolating (the
    /// thesis's unsynchronised mode). 0 means lockstep. Other values need the coupling `owner`.
    pub lag_ticks: u32,
    /// The thresholds of delay and distance of groups.
    pub thresholds: Thresholds,
    /// The sizes of groups, and the policies and votes that form them.
    pub grouping: Grouping,
}
