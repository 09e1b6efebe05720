//! Runs a node, or many clients, in a process of its own, which says what it has done whenever it is asked to.

use std::error::Error;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use dcd::net::JoinRole;
use dcd::protocol::Area;
use dcd::runtime::{ClientWorld, JoinConfig, Member, MemberConfig};
use serde::{Deserialize, Serialize};

const LIMIT: Duration = Duration::from_secs(120);
/// Clients that join at a time.
const JOINING: usize = 4;

/// Joins a server's world as a node, or as one client per line of standard input: started by `fan-out`.
#[derive(Args)]
pub(crate) struct FanOutProcess {
    #[arg(long)]
    server: SocketAddr,
    /// Of a node.
    #[arg(long, conflicts_with = "interest")]
    token: Option<String>,
    /// How far clients hear.
    #[arg(long)]
    interest: Option<f64>,
}

/// What a process has done so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reading {
    /// When its ticks were complete, microseconds since its start.
    pub(super) ticks: Vec<u64>,
    /// What its clients were sent, UDP payloads, and how often they were told of states.
    pub(super) bytes: u64,
    pub(super) updates: u64,
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
        Reading { ticks, ..Reading::default() }
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
    })?;
    worlds.iter().try_for_each(ClientWorld::check)?;
    Ok(())
}

/// Answers each line of standard input, until it ends.
fn answer(read: impl Fn() -> Reading) -> Result<(), Box<dyn Error>> {
    for line in std::io::stdin().lines() {
        line?;
        println!("{}", serde_json::to_string(&read())?);
    }
    Ok(())
}

/// A process that runs until its end of a pipe is closed.
pub(super) struct Child {
    child: std::process::Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    /// Its id, if it is a node.
    pub(super) node: Option<u32>,
}

impl Child {
    /// Starts a node.
    pub(super) fn node(server: SocketAddr, token: &str) -> Result<Self, Box<dyn Error>> {
        let mut child = Self::start(server, &["--token", token])?;
        child.node = Some(child.line()?.parse()?);
        Ok(child)
    }

    /// Starts a process of clients, and waits until all have joined. A seat is a line: a token, and where the client's interest is.
    pub(super) fn clients(server: SocketAddr, interest_m: f64, seats: &str) -> Result<Self, Box<dyn Error>> {
        let mut child = Self::start(server, &["--interest", &interest_m.to_string()])?;
        child.write(&format!("{seats}\n"))?;
        child.line()?;
        Ok(child)
    }

    fn start(server: SocketAddr, arguments: &[&str]) -> Result<Self, Box<dyn Error>> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(["fan-out-process", "--server", &server.to_string()])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start a process: {error}"))?;
        let output = child.stdout.take().ok_or("it has no standard output")?;
        Ok(Self { input: child.stdin.take(), child, output: BufReader::new(output), node: None })
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Asks it what it has done so far.
    pub(super) fn read(&mut self) -> Result<Reading, Box<dyn Error>> {
        self.write("\n")?;
        Ok(serde_json::from_str(&self.line()?)?)
    }

    /// Ends it; says so if it went wrong.
    pub(super) fn end(mut self) -> Result<(), Box<dyn Error>> {
        self.input = None;
        self.output.read_to_string(&mut String::new())?;
        match self.child.wait()? {
            status if status.success() => Ok(()),
            status => Err(format!("a process of clients ended with {status}").into()),
        }
    }

    fn write(&mut self, text: &str) -> Result<(), Box<dyn Error>> {
        Ok(self.input.as_mut().ok_or("it is ending")?.write_all(text.as_bytes())?)
    }

    fn line(&mut self) -> Result<String, Box<dyn Error>> {
        let mut line = String::new();
        match self.output.read_line(&mut line)? {
            0 => Err("a process ended early".into()),
            _ => Ok(line.trim_end().to_owned()),
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
