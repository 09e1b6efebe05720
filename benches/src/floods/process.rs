//! Runs the server, the node or the hostile peers of a flood in a process of its own.

use std::error::Error;
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use dcd::cluster::TickStats;
use dcd::net::JoinRole;
use dcd::runtime::{JoinConfig, Member, MemberConfig, Origin, ServeConfig, ServerProcess, WorldConfig};
use dcd::scene::{Params, Scene};
use serde::{Deserialize, Serialize};

use super::hostile::Hostile;
use crate::child::answer;

const LIMIT: Duration = Duration::from_secs(60);

/// Runs one of the processes of a flood: started by `floods`.
#[derive(Args)]
pub(crate) struct FloodProcess {
    #[command(subcommand)]
    role: Role,
}

#[derive(Subcommand)]
enum Role {
    /// Serves so many cubes.
    Server {
        #[arg(long)]
        data: PathBuf,
        #[arg(long)]
        cubes: usize,
    },
    /// Computes them.
    Node {
        #[arg(long)]
        server: SocketAddr,
        #[arg(long)]
        token: String,
    },
    /// Floods both.
    Hostile(Hostile),
}

/// The ticks of a node since it was last asked.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Ticks {
    /// The time at which each tick was complete, microseconds since the node's start, and how long it was
    /// computed, microseconds.
    pub(super) ticks: Vec<(u64, u32)>,
}

impl FloodProcess {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        match self.role {
            Role::Server { data, cubes } => serve(data, cubes),
            Role::Node { server, token } => compute(server, token),
            Role::Hostile(hostile) => hostile.run(),
        }
    }
}

/// Prints the address where it listens, and then answers with the tick of the world.
fn serve(data: PathBuf, cubes: usize) -> Result<(), Box<dyn Error>> {
    let scene = Scene::named("dve", &Params::new().with("n", cubes))?;
    let config = ServeConfig { events: false, ..ServeConfig::new(data) };
    let server = ServerProcess::start(Origin::Scene(&scene, &WorldConfig::for_scene(&scene)), config)?;
    println!("{}", server.address);
    answer(|| server.summary().tick.0)
}

/// Prints the node's id and the address where it listens, and then answers with its ticks.
fn compute(server: SocketAddr, token: String) -> Result<(), Box<dyn Error>> {
    let identity = JoinConfig { timeout: LIMIT, ..JoinConfig::new(server, token) }.join(JoinRole::Node)?;
    let (ticks, start) = (Arc::new(Mutex::new(Vec::new())), Instant::now());
    let noted = ticks.clone();
    let onlooker = move |_: &_, stats: &TickStats| {
        let at = (start.elapsed().as_micros() as u64, stats.compute_us);
        noted.lock().unwrap_or_else(PoisonError::into_inner).push(at);
    };
    // Any free port, found here since the node's summary does not tell its address.
    let listen = UdpSocket::bind("127.0.0.1:0")?.local_addr()?;
    let mut config = MemberConfig::new(server, identity);
    config.listen = Some(listen);
    config.onlooker = Some(Box::new(onlooker));
    let node = Member::start(config)?;
    println!("{} {listen}", node.summary().node.0);
    answer(|| Ticks { ticks: std::mem::take(&mut *ticks.lock().unwrap_or_else(PoisonError::into_inner)) })
}
