//! Runs a node, or many clients, in a process of its own, which reports what it has done whenever it is asked
//! to.

use std::error::Error;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use dcd::net::JoinRole;
use dcd::protocol::Area;
use dcd::runtime::{ClientWorld, JoinConfig, Member, MemberConfig};
use serde::{Deserialize, Serialize};

use crate::child::{Child, answer};

const LIMIT: Duration = Duration::from_secs(120);
/// The number of clients that join at the same time.
const JOINING: usize = 4;

/// Joins a server's world as a node, or as one client per line of standard input: started by `fan-out`.
#[derive(Args)]
pub(crate) struct FanOutProcess {
    #[arg(long)]
    server: SocketAddr,
    /// Token of a node.
    #[arg(long, conflicts_with = "interest")]
    token: Option<String>,
    /// Radius in which clients hear, metres.
    #[arg(long)]
    interest: Option<f64>,
}

/// The totals of a process so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reading {
    /// The times when its ticks were complete, microseconds since its start.
    pub(super) ticks: Vec<u64>,
    /// Bytes of UDP payloads that its clients were sent, and how often they were told of states.
    pub(super) bytes: u64,
    pub(super) updates: u64,
    /// Bytes of UDP payloads that a node sent.
    #[serde(default)]
    pub(super) sent: u64,
}

impl FanOutProcess {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        match (self.token, self.interest) {
            (Some(token), _) => node(self.server, token),
            (None, Some(interest)) => clients(self.server, interest),
            (None, None) => Err("give it --token or --interest".into()),
        }
    }
}

fn node(server: SocketAddr, token: String) -> Result<(), Box<dyn Error>> {
    let identity = JoinConfig { timeout: LIMIT, ..JoinConfig::new(server, token) }.join(JoinRole::Node)?;
    let (ticks, start) = (Arc::new(Mutex::new(Vec::new())), Instant::now());
    let noted = ticks.clone();
    let onlooker = move |_: &_, _: &_| {
        noted.lock().unwrap_or_else(PoisonError::into_inner).push(start.elapsed().as_micros() as u64);
    };
    let mut config = MemberConfig::new(server, identity);
    config.onlooker = Some(Box::new(onlooker));
    let node = Member::start(config)?;
    println!("{}", node.summary().node.0);
    answer(|| {
        let ticks = ticks.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Reading { ticks, sent: node.traffic().udp_bytes_out, ..Reading::default() }
    })
}

fn clients(server: SocketAddr, interest_m: f64) -> Result<(), Box<dyn Error>> {
    let mut seats = Vec::new();
    for line in std::io::stdin().lines() {
        let line = line?;
        if line.is_empty() {
            break;
        }
        let mut words = line.split(' ');
        let token = words.next().unwrap_or_default().to_owned();
        let centre: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>()?;
        let centre = centre.try_into().map_err(|_| format!("{line:?} has no place"))?;
        let interest = Some(Area { centre, radius_m: interest_m });
        seats.push(JoinConfig { timeout: LIMIT, interest, ..JoinConfig::new(server, token) });
    }
    let seats = Mutex::new(seats);
    let join = || {
        let mut worlds = Vec::new();
        loop {
            let seat = seats.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let Some(seat) = seat else { return Ok(worlds) };
            worlds.push(ClientWorld::connect(&seat).map_err(|error| error.to_string())?);
        }
    };
    let worlds: Vec<Vec<ClientWorld>> = std::thread::scope(|scope| {
        let joining: Vec<_> = (0..JOINING).map(|_| scope.spawn(join)).collect();
        let joined = |thread: std::thread::ScopedJoinHandle<'_, Result<_, String>>| {
            thread.join().unwrap_or_else(|_| Err("a client panicked".to_owned()))
        };
        joining.into_iter().map(joined).collect::<Result<_, _>>()
    })?;
    let worlds: Vec<_> = worlds.into_iter().flatten().collect();
    println!("{}", worlds.len());
    answer(|| Reading {
        ticks: Vec::new(),
        bytes: worlds.iter().map(|world| world.traffic().udp_bytes_in).sum(),
        updates: worlds.iter().map(ClientWorld::updates).sum(),
        sent: 0,
    })?;
    worlds.iter().try_for_each(ClientWorld::check)?;
    Ok(())
}

/// A node, or clients, in a process of its own.
pub(super) struct Worker {
    child: Child,
    /// The id of the node, if the process is one.
    pub(super) node: Option<u32>,
}

impl Worker {
    /// Starts a node.
    pub(super) fn node(server: SocketAddr, token: &str) -> Result<Self, Box<dyn Error>> {
        let mut child = start(server, &["--token", token])?;
        let node = Some(child.line()?.parse()?);
        Ok(Self { child, node })
    }

    /// Starts a process of clients, and waits until all have joined. Each line of `seats` has a token and the
    /// centre of a client's interest.
    pub(super) fn clients(server: SocketAddr, interest_m: f64, seats: &str) -> Result<Self, Box<dyn Error>> {
        let mut child = start(server, &["--interest", &interest_m.to_string()])?;
        child.write(&format!("{seats}\n"))?;
        child.line()?;
        Ok(Self { child, node: None })
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Asks the process what it has done so far.
    pub(super) fn read(&mut self) -> Result<Reading, Box<dyn Error>> {
        self.child.read()
    }

    /// Ends the process; returns an error if it went wrong.
    pub(super) fn end(self) -> Result<(), Box<dyn Error>> {
        self.child.end()
    }
}

fn start(server: SocketAddr, arguments: &[&str]) -> Result<Child, Box<dyn Error>> {
    let server = server.to_string();
    Child::start(&[&["fan-out-process", "--server", &server], arguments].concat())
}
