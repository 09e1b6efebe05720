//! Measures what hostile peers cost a world: a server, a node that computes and an honest client in real
//! processes, before, in and after a flood by another process, while clients join.

mod calls;
mod gates;
mod hostile;
mod process;

use std::error::Error;
use std::fs;
use std::net::SocketAddr;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant, SystemTime};

use clap::{Args, ValueEnum};
use dcd::net::{Authority, JoinRole};
use dcd::runtime::{ClientWorld, JoinConfig};
use serde::{Deserialize, Serialize};

use self::gates::GATES;
use self::hostile::{Flood, Sent};
pub(crate) use self::process::FloodProcess;
use self::process::Ticks;
use crate::child::Child;
use crate::output::{Output, Sheet, Shown, exit_code};
use crate::page;
use crate::results::{Measured, short};
use crate::usage::Usage;

const SHOWN: Shown<Row> = Shown { name: "floods", table, picture: None };
const LIMIT: Duration = Duration::from_secs(60);
/// The longest time that a client which joins in a flood waits.
const JOINING: Duration = Duration::from_secs(10);
/// The time between two joins.
const APART: Duration = Duration::from_millis(250);
/// The time until links of peers that are gone are given up, and what was theirs is freed.
const AFTER: Duration = Duration::from_secs(12);

/// The settings of the runs: which floods, how long each takes, and where its results go.
#[derive(Args)]
pub(crate) struct Floods {
    /// Only these floods; rows of others stay in the file.
    #[arg(long, value_delimiter = ',', value_name = "FLOOD")]
    flood: Vec<Flood>,
    /// Cubes of the scene `dve`, which all move all the time.
    #[arg(long, default_value_t = 2_000)]
    cubes: usize,
    /// Seconds before and in each flood.
    #[arg(long, default_value_t = 10.0, conflicts_with = "quick")]
    seconds: f64,
    /// Number of datagrams of random bytes.
    #[arg(long, default_value_t = 1_000_000, conflicts_with = "quick")]
    datagrams: u64,
    /// Priority of the hostile process, which has the last core: from 0, as the world's, to 19, below all
    /// others.
    #[arg(long, default_value_t = 19)]
    nice: i32,
    #[command(flatten)]
    output: Output,
}

/// The cost of one flood.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    flood: Flood,
    cubes: usize,
    seconds: f64,
    nice: i32,
    /// The handshakes, datagrams, links or frames that the hostile process sent.
    sent: u64,
    sent_per_s: f64,
    /// Resident memory before the flood, at most in it, and after it.
    server_before_mb: f64,
    server_peak_mb: f64,
    server_after_mb: f64,
    node_before_mb: f64,
    node_peak_mb: f64,
    node_after_mb: f64,
    /// The growth of the process that grew most, and whether that is within the gate.
    grown_mb: f64,
    memory_holds: bool,
    /// The time that the node computes per tick, milliseconds, before and in the flood.
    tick_p50_before_ms: f64,
    tick_p50_ms: f64,
    tick_p99_before_ms: f64,
    tick_p99_ms: f64,
    /// Says whether the 99th percentile is within the gate.
    ticks_hold: bool,
    ticks_per_s: f64,
    /// Processor time of the node's world per tick, milliseconds, before and in the flood.
    world_before_ms: f64,
    world_ms: f64,
    /// The parts of a core that the network's threads of server and node take in the flood.
    server_net_cores: f64,
    node_net_cores: f64,
    /// The time that a client takes to join and to have the world.
    join_before_ms: f64,
    join_p50_ms: f64,
    join_max_ms: f64,
    joins: usize,
    joins_failed: usize,
    /// The batches of states per second that were taken in by a client that was there before.
    updates_per_s: f64,
}

impl Floods {
    pub(crate) fn run(self) -> Result<ExitCode, Box<dyn Error>> {
        let rows = self.output.fill(&SHOWN, |rows| self.measure(rows))?;
        // One second on a machine that does other things besides says nothing about times.
        let missed = |row: &Row| row.missed(!self.output.quick);
        let missed = rows
            .iter()
            .flat_map(|Measured { row, .. }| missed(row).into_iter().map(|missed| (name(row.flood), missed)));
        Ok(exit_code(missed))
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        let mut floods = self.flood.clone();
        if floods.is_empty() {
            floods = Flood::value_variants().to_vec();
        } else {
            rows.recall()?;
        }
        for flood in floods {
            let row = self.suffer(flood).map_err(|error| format!("{}: {error}", name(flood)))?;
            eprintln!(
                "{}: {} per second; {} MB more; ticks {} ms (p99, {} before); {} joins, {} failed, {} ms at most",
                name(flood),
                short(row.sent_per_s),
                short(row.grown_mb),
                short(row.tick_p99_ms),
                short(row.tick_p99_before_ms),
                row.joins,
                row.joins_failed,
                short(row.join_max_ms)
            );
            let row = rows.measured(row);
            rows.replace(|old| old.flood == flood, [row])?;
        }
        Ok(())
    }

    /// Serves a world of its own, floods it, and measures what that costs.
    fn suffer(&self, flood: Flood) -> Result<Row, Box<dyn Error>> {
        let quick = self.output.quick;
        let (seconds, datagrams, after) =
            if quick { (1.0, 20_000, Duration::ZERO) } else { (self.seconds, self.datagrams, AFTER) };
        let mut world = World::start(self.cubes)?;
        let client = ClientWorld::connect(&world.honest(LIMIT)?)?;
        let mut hostile = world.hostile(flood, seconds, datagrams, self.nice)?;
        let mut before = world.phase(&client, |_| {
            std::thread::sleep(Duration::from_secs_f64(seconds));
            Ok(())
        })?;
        let memory_before = world.memory()?;
        world.forget_peaks()?;
        let mut sent = Sent::default();
        let mut during = world.phase(&client, |_| {
            sent = hostile.read()?;
            Ok(())
        })?;
        let peak = world.memory()?;
        hostile.end()?;
        std::thread::sleep(after);
        let memory_after = world.memory()?;
        client.check()?;
        let grown_mb =
            [0, 1].map(|i| peak[i].peak_mb - memory_before[i].now_mb).into_iter().fold(0.0, f64::max);
        let [tick_p99_before_ms, tick_p99_ms] =
            [&mut before, &mut during].map(|phase| at(&mut phase.ticks_ms, 0.99));
        Ok(Row {
            flood,
            cubes: self.cubes,
            seconds: during.seconds,
            nice: self.nice,
            sent: sent.count,
            sent_per_s: sent.count as f64 / sent.seconds.max(1e-9),
            server_before_mb: memory_before[0].now_mb,
            server_peak_mb: peak[0].peak_mb,
            server_after_mb: memory_after[0].now_mb,
            node_before_mb: memory_before[1].now_mb,
            node_peak_mb: peak[1].peak_mb,
            node_after_mb: memory_after[1].now_mb,
            grown_mb,
            memory_holds: grown_mb < GATES.memory_mb,
            tick_p50_before_ms: at(&mut before.ticks_ms, 0.5),
            tick_p50_ms: at(&mut during.ticks_ms, 0.5),
            tick_p99_before_ms,
            tick_p99_ms,
            ticks_hold: tick_p99_ms < GATES.ticks * tick_p99_before_ms,
            ticks_per_s: during.ticks_ms.len() as f64 / during.seconds,
            world_before_ms: before.world_ms,
            world_ms: during.world_ms,
            server_net_cores: during.net_cores[0],
            node_net_cores: during.net_cores[1],
            join_before_ms: at(&mut before.joins_ms, 0.5),
            join_p50_ms: at(&mut during.joins_ms, 0.5),
            join_max_ms: at(&mut during.joins_ms, 1.0),
            joins: during.joins_ms.len() + during.joins_failed,
            joins_failed: during.joins_failed,
            updates_per_s: during.updates as f64 / during.seconds,
        })
    }
}

/// A server and a node.
struct World {
    server: Child,
    node: Child,
    server_at: SocketAddr,
    node_at: SocketAddr,
    authority: Authority,
    _data: tempfile::TempDir,
}

/// The figures of a world over some seconds.
struct Phase {
    seconds: f64,
    ticks_ms: Vec<f64>,
    /// Processor time of the node's world per tick, milliseconds.
    world_ms: f64,
    /// The parts of a core that the network's threads of server and node took.
    net_cores: [f64; 2],
    joins_ms: Vec<f64>,
    joins_failed: usize,
    updates: u64,
}

/// Resident memory of a process.
#[derive(Clone, Copy, Debug)]
struct Memory {
    now_mb: f64,
    peak_mb: f64,
}

impl World {
    fn start(cubes: usize) -> Result<Self, Box<dyn Error>> {
        let data = tempfile::tempdir()?;
        let folder = data.path().to_str().ok_or("a temporary folder with a strange name")?.to_owned();
        let mut server =
            Child::start(&["flood-process", "server", "--data", &folder, "--cubes", &cubes.to_string()])?;
        let server_at: SocketAddr = server.line()?.parse()?;
        let authority = Authority::load_or_create(data.path())?;
        let token = authority.issue_token(JoinRole::Node, LIMIT, SystemTime::now())?.to_string();
        let mut node =
            Child::start(&["flood-process", "node", "--server", &server_at.to_string(), "--token", &token])?;
        let said = node.line()?;
        let node_at = said.split_once(' ').ok_or("a node says where it is")?.1.parse()?;
        let until = Instant::now() + LIMIT;
        while server.read::<u64>()? < 60 {
            if Instant::now() > until {
                return Err("the world does not begin".into());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(Self { server, node, server_at, node_at, authority, _data: data })
    }

    fn token(&self, role: JoinRole, uses: u32) -> Result<String, Box<dyn Error>> {
        Ok(self.authority.issue_token_for(uses, role, 10 * LIMIT, SystemTime::now())?.to_string())
    }

    fn honest(&self, timeout: Duration) -> Result<JoinConfig, Box<dyn Error>> {
        Ok(JoinConfig { timeout, ..JoinConfig::new(self.server_at, self.token(JoinRole::Client, 1_000)?) })
    }

    /// Starts the hostile process, and waits until it is ready to begin.
    fn hostile(
        &self,
        flood: Flood,
        seconds: f64,
        datagrams: u64,
        nice: i32,
    ) -> Result<Child, Box<dyn Error>> {
        let token = flood.peers().map(|(role, count)| self.token(role, count)).transpose()?;
        let (server, node) = (self.server_at.to_string(), self.node_at.to_string());
        let (seconds, datagrams, nice) = (seconds.to_string(), datagrams.to_string(), nice.to_string());
        let name = name(flood);
        let mut arguments = vec!["flood-process", "hostile", "--flood", &name, "--server", &server];
        arguments.extend([
            "--node",
            &node,
            "--seconds",
            &seconds,
            "--datagrams",
            &datagrams,
            "--nice",
            &nice,
        ]);
        arguments.extend(token.iter().flat_map(|token| ["--token", token.as_str()]));
        let mut hostile = Child::start(&arguments)?;
        hostile.line()?;
        Ok(hostile)
    }

    /// Measures the world while `during` runs and clients join one after the other.
    fn phase(
        &mut self,
        client: &ClientWorld,
        during: impl FnOnce(&mut Self) -> Result<(), Box<dyn Error>>,
    ) -> Result<Phase, Box<dyn Error>> {
        let config = self.honest(JOINING)?;
        self.node.read::<Ticks>()?;
        let usage = |world: &Self| {
            Ok::<_, Box<dyn Error>>([Usage::of(world.server.id())?, Usage::of(world.node.id())?])
        };
        let (used, updates, start) = (usage(self)?, client.updates(), Instant::now());
        let (joins, failed) = (Mutex::new(Vec::new()), Mutex::new(0));
        let (stop, stopped) = mpsc::channel::<()>();
        let (result, ticks, seconds, now_used) = std::thread::scope(|scope| {
            scope.spawn(|| join_on_and_on(&config, stopped, &joins, &failed));
            let result = during(self);
            let seconds = start.elapsed().as_secs_f64();
            let (ticks, now_used) = (self.node.read::<Ticks>(), usage(self));
            drop(stop);
            (result, ticks, seconds, now_used)
        });
        result?;
        let (ticks, now_used) = (ticks?.ticks, now_used?);
        let used = [0, 1].map(|i| now_used[i].since(&used[i]));
        let net = |used: &Usage| used.of_threads("dcd-net") + used.of_threads("dcd-events");
        Ok(Phase {
            seconds,
            world_ms: used[1].of_threads("dcd-Node") / ticks.len().max(1) as f64,
            net_cores: [0, 1].map(|i| 1e-3 * net(&used[i]) / seconds),
            ticks_ms: ticks.iter().map(|&(_, us)| 1e-3 * f64::from(us)).collect(),
            joins_ms: joins.into_inner().unwrap_or_default(),
            joins_failed: failed.into_inner().unwrap_or_default(),
            updates: client.updates() - updates,
        })
    }

    fn memory(&self) -> Result<[Memory; 2], Box<dyn Error>> {
        Ok([Memory::of(self.server.id())?, Memory::of(self.node.id())?])
    }

    /// Resets the memory peaks of both processes.
    fn forget_peaks(&self) -> Result<(), Box<dyn Error>> {
        for process in [self.server.id(), self.node.id()] {
            fs::write(format!("/proc/{process}/clear_refs"), "5")?;
        }
        Ok(())
    }
}

impl Memory {
    fn of(process: u32) -> Result<Self, Box<dyn Error>> {
        let text = fs::read_to_string(format!("/proc/{process}/status"))?;
        let of = |key: &str| -> Result<f64, Box<dyn Error>> {
            let line = text.lines().find_map(|line| line.strip_prefix(key)).ok_or("no memory is told")?;
            Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? / 1_024.0)
        };
        Ok(Self { now_mb: of("VmRSS:")?, peak_mb: of("VmHWM:")? })
    }
}

/// Joins as an honest client and leaves again, over and over, until it is told to stop.
fn join_on_and_on(
    config: &JoinConfig,
    stopped: mpsc::Receiver<()>,
    joins_ms: &Mutex<Vec<f64>>,
    failed: &Mutex<usize>,
) {
    while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(APART) {
        let begun = Instant::now();
        match ClientWorld::connect(config) {
            Ok(_) => {
                if let Ok(mut joins_ms) = joins_ms.lock() {
                    joins_ms.push(1e3 * begun.elapsed().as_secs_f64());
                }
            }
            Err(error) => {
                eprintln!("  a client could not join: {error}");
                if let Ok(mut failed) = failed.lock() {
                    *failed += 1;
                }
            }
        }
    }
}

fn at(values: &mut [f64], share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let place = (share * values.len() as f64) as usize;
    values.get(place.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

fn name(flood: Flood) -> String {
    flood.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "flood",
        "per second",
        "server, MB: before / peak / after",
        "node, MB: before / peak / after",
        "tick, p50 / p99 ms: before",
        "in the flood",
        "ticks per second",
        "network's threads, of a core: server / node",
        "joining, ms: before",
        "in the flood, p50 / max",
        "joined",
    ];
    let cells = |Measured { row, .. }: &Measured<Row>| {
        vec![
            name(row.flood),
            if row.sent == 0 { "–".to_owned() } else { short(row.sent_per_s) },
            page::bold_unless(
                [row.server_before_mb, row.server_peak_mb, row.server_after_mb].map(short).join(" / "),
                row.server_peak_mb - row.server_before_mb < GATES.memory_mb,
            ),
            page::bold_unless(
                [row.node_before_mb, row.node_peak_mb, row.node_after_mb].map(short).join(" / "),
                row.node_peak_mb - row.node_before_mb < GATES.memory_mb,
            ),
            [row.tick_p50_before_ms, row.tick_p99_before_ms].map(short).join(" / "),
            page::bold_unless([row.tick_p50_ms, row.tick_p99_ms].map(short).join(" / "), row.ticks_hold),
            short(row.ticks_per_s),
            [row.server_net_cores, row.node_net_cores].map(short).join(" / "),
            short(row.join_before_ms),
            [row.join_p50_ms, row.join_max_ms].map(short).join(" / "),
            page::bold_unless(
                format!("{} of {}", row.joins - row.joins_failed, row.joins),
                row.joins_failed == 0,
            ),
        ]
    };
    page::table(&head, rows.iter().map(cells))
}
