//! Measures what many clients cost a world: a server, two nodes and N clients with an area of interest, in
//! real processes, beside the same world without clients.
//!
//! Where all processes share a machine's cores, the time between two ticks depends on the clients' own
//! processes too. What the world itself pays is the processor time of its nodes per tick, by thread: the
//! thread that computes the world, and the threads that serve others.

mod gates;
mod process;

use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use dcd::net::JoinRole;
use dcd::runtime::{Origin, ServeConfig, ServerProcess, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::sim::Random;
use serde::{Deserialize, Serialize};

use self::gates::CLIENTS;
pub(crate) use self::process::FanOutProcess;
use self::process::{Reading, Worker};
use crate::output::{Output, Sheet, Shown, exit_code};
use crate::page;
use crate::results::{Measured, short};
use crate::usage::Usage;

const SHOWN: Shown<Row> = Shown { name: "fan-out", table, picture: None };
const LIMIT: Duration = Duration::from_secs(120);
/// The time until links have found out what they carry, and clients have been told everything in full.
const WARM_UP: Duration = Duration::from_secs(4);
const NODES: usize = 2;
const DVE: &str = "dve";
/// The number of clients in one process.
const CLIENTS_PER_PROCESS: usize = 125;

/// The settings of the runs: how many clients, how long each run takes, and where its results go.
#[derive(Args)]
pub(crate) struct FanOut {
    /// Numbers of clients, one run for each.
    #[arg(long, value_delimiter = ',', default_value = "0,10,100,500", conflicts_with = "quick")]
    clients: Vec<usize>,
    /// Measures each number once more, with the leader telling this many clients itself and the other node
    /// the rest.
    #[arg(long, value_name = "CLIENTS", conflicts_with = "quick")]
    relays: Option<u32>,
    /// Radius in which each client hears, metres; clients are spread evenly over the world.
    #[arg(long, default_value_t = 12.0)]
    interest: f64,
    /// A scene of the library that is made of `n` bodies, or stacks of them.
    #[arg(long, default_value = DVE)]
    scene: String,
    /// The scene's `n`: cubes of `dve`, which all move all the time.
    #[arg(long, default_value_t = 1_000)]
    cubes: usize,
    /// Seconds that are measured of each run.
    #[arg(long, default_value_t = 10.0, conflicts_with = "quick")]
    seconds: f64,
    #[command(flatten)]
    output: Output,
}

/// The cost of one number of clients.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    clients: usize,
    cubes: usize,
    interest_m: f64,
    ticks_per_s: f64,
    /// The time between the ends of two ticks at the leader, milliseconds.
    tick_p50_ms: f64,
    tick_p99_ms: f64,
    /// Processor time of the leader's threads, milliseconds per tick: of the thread that computes the world,
    /// of the thread that tells clients, of the network's threads, of all.
    world_ms: f64,
    fan_out_ms: f64,
    net_ms: f64,
    leader_ms: f64,
    /// Processor time of all threads of the other node, milliseconds per tick.
    other_ms: f64,
    /// Processor time of all clients' processes together, milliseconds per tick.
    clients_ms: f64,
    /// Bytes per second that each client was sent, UDP payloads.
    bytes_per_s: f64,
    /// Batches of states per second that each client took in.
    updates_per_s: f64,
    /// The scene whose parameter `n` is `cubes`; `None`: `dve`.
    #[serde(default)]
    scene: Option<String>,
    /// The number of clients that the leader tells itself; `None`: all.
    #[serde(default)]
    relays_above: Option<u32>,
    /// Bytes of UDP payloads per second that each node sent, to all.
    #[serde(default)]
    leader_sent_per_s: Option<f64>,
    #[serde(default)]
    other_sent_per_s: Option<f64>,
}

impl FanOut {
    pub(crate) fn run(self) -> Result<ExitCode, Box<dyn Error>> {
        let rows = self.output.fill(&SHOWN, |rows| self.measure(rows))?;
        // One second on a machine that does other things besides says nothing about times.
        if self.output.quick {
            return Ok(ExitCode::SUCCESS);
        }
        let all = || rows.iter().map(|row| &row.row);
        let missed = all().flat_map(|row| {
            // A run without such a row has nothing to compare with.
            let missed = row.alone(all()).map(|alone| row.missed(alone)).unwrap_or_default();
            missed.into_iter().map(|missed| (format!("{} clients", row.clients), missed))
        });
        Ok(exit_code(missed))
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        let (clients, seconds) =
            if self.output.quick { (&[0, 4][..], 1.0) } else { (&self.clients[..], self.seconds) };
        let relays = if self.output.quick { Some(0) } else { self.relays };
        for &count in clients {
            for above in [None].into_iter().chain(relays.filter(|_| count > 0).map(Some)) {
                let row = self.serve(count, above, Duration::from_secs_f64(seconds))?;
                eprintln!(
                    "{}, {count} clients{}: {} ticks per second, {} ms of the leader per tick, which sends {} bytes/s",
                    self.scene,
                    above.map(|above| format!(", of which the leader tells {above}")).unwrap_or_default(),
                    short(row.ticks_per_s),
                    short(row.leader_ms),
                    short(row.leader_sent_per_s.unwrap_or_default())
                );
                rows.push(row)?;
            }
        }
        Ok(())
    }

    /// Serves the world to so many clients, and measures what they cost.
    fn serve(&self, count: usize, relays_above: Option<u32>, time: Duration) -> Result<Row, Box<dyn Error>> {
        let scene = Scene::named(&self.scene, &Params::new().with("n", self.cubes))?;
        let data = tempfile::tempdir()?;
        let config =
            ServeConfig { nodes: NODES, events: false, relays_above, ..ServeConfig::new(data.path()) };
        let server = ServerProcess::start(Origin::Scene(&scene, &WorldConfig::for_scene(&scene)), config)?;
        let mut nodes = Vec::new();
        for _ in 0..NODES {
            let token = server.token(JoinRole::Node, LIMIT)?;
            nodes.push(Worker::node(server.address, &token)?);
        }
        let begins =
            |view: Option<&dcd::protocol::View>| view.is_some_and(|view| view.members.len() == NODES);
        if !server.wait(LIMIT, |summary, view| begins(view) && summary.tick.0 > 0) {
            return Err("the world does not begin".into());
        }
        let mut clients = self.clients(&server, &scene, count)?;
        std::thread::sleep(WARM_UP);
        let leader = server.view().ok_or("nobody computes the world")?.leader;
        let place = nodes.iter().position(|node| node.node == Some(leader.0)).ok_or("a stranger leads")?;
        nodes.swap(0, place);
        let before = Moment::now(&mut nodes, &mut clients)?;
        std::thread::sleep(time);
        let after = Moment::now(&mut nodes, &mut clients)?;
        if server.view().map(|view| view.leader) != Some(leader) {
            return Err("another node leads than at first".into());
        }
        for client in clients {
            client.end()?;
        }
        drop(server);
        Ok(Row { relays_above, ..self.row(count, &before, &after) })
    }

    /// Starts the processes of clients, each client with an interest at a place of its own.
    fn clients(
        &self,
        server: &ServerProcess,
        scene: &Scene,
        count: usize,
    ) -> Result<Vec<Worker>, Box<dyn Error>> {
        let mut random = Random::new(7);
        let mut children = Vec::new();
        for begin in (0..count).step_by(CLIENTS_PER_PROCESS) {
            let mut seats = String::new();
            for _ in begin..count.min(begin + CLIENTS_PER_PROCESS) {
                let token = server.token(JoinRole::Client, LIMIT)?;
                let (low, high) = (scene.bounds.min, scene.bounds.max);
                let [x, y, z] = [0, 1, 2].map(|axis| low[axis] + random.unit() * (high[axis] - low[axis]));
                seats += &format!("{token} {x} {y} {z}\n");
            }
            children.push(Worker::clients(server.address, self.interest, &seats)?);
        }
        Ok(children)
    }

    fn row(&self, clients: usize, before: &Moment, after: &Moment) -> Row {
        let ticks = after.leader.ticks.len().saturating_sub(before.leader.ticks.len()).max(1) as f64;
        let seconds = (after.at - before.at).as_secs_f64();
        let mut apart: Vec<_> = after.leader.ticks[before.leader.ticks.len()..]
            .windows(2)
            .map(|pair| 1e-3 * (pair[1] - pair[0]) as f64)
            .collect();
        apart.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| apart.get((share * apart.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        let used = after.of_leader.since(&before.of_leader);
        let per_client = |count: u64| count as f64 / seconds / clients.max(1) as f64;
        Row {
            scene: Some(self.scene.clone()),
            clients,
            cubes: self.cubes,
            interest_m: self.interest,
            ticks_per_s: ticks / seconds,
            tick_p50_ms: at(0.5),
            tick_p99_ms: at(0.99),
            world_ms: used.of_threads("dcd-Node") / ticks,
            fan_out_ms: used.of_threads("dcd-fan-out") / ticks,
            net_ms: (used.of_threads("dcd-net") + used.of_threads("dcd-events")) / ticks,
            leader_ms: used.all() / ticks,
            other_ms: after.of_other.since(&before.of_other).all() / ticks,
            clients_ms: after.of_clients.since(&before.of_clients).all() / ticks,
            bytes_per_s: per_client(after.clients.bytes - before.clients.bytes),
            updates_per_s: per_client(after.clients.updates - before.clients.updates),
            relays_above: None,
            leader_sent_per_s: Some((after.leader.sent - before.leader.sent) as f64 / seconds),
            other_sent_per_s: Some((after.other.sent - before.other.sent) as f64 / seconds),
        }
    }
}

/// The totals of all processes up to a moment.
struct Moment {
    at: Instant,
    leader: Reading,
    other: Reading,
    clients: Reading,
    of_leader: Usage,
    of_other: Usage,
    of_clients: Usage,
}

impl Moment {
    /// Asks all processes; the first of the nodes leads.
    fn now(nodes: &mut [Worker], clients: &mut [Worker]) -> Result<Self, Box<dyn Error>> {
        let mut said = Reading::default();
        let mut of_clients = Usage::default();
        for client in clients {
            let reading = client.read()?;
            said.bytes += reading.bytes;
            said.updates += reading.updates;
            of_clients.add(&Usage::of(client.id())?);
        }
        let [of_leader, of_other] = [0, 1].map(|i| Usage::of(nodes[i].id()));
        let leader = nodes[0].read()?;
        let other = nodes[1].read()?;
        Ok(Self {
            at: Instant::now(),
            leader,
            other,
            clients: said,
            of_leader: of_leader?,
            of_other: of_other?,
            of_clients,
        })
    }
}

fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "clients",
        "ticks per second",
        "between ticks, p50 / p99 ms",
        "over none: world / between ticks, p99",
        "leader, CPU ms per tick: world / clients / network / all",
        "other node, CPU ms per tick",
        "clients' processes, CPU ms per tick",
        "bytes/s per client",
        "updates/s per client",
        "bytes/s sent, leader / other node",
    ];
    let over = |row: &Row| {
        let Some(alone) = row.alone(rows.iter().map(|row| &row.row)).filter(|_| row.clients > 0) else {
            return "–".to_owned();
        };
        let over = row.over(alone);
        let holds = if row.clients > CLIENTS { [true; 2] } else { over.holds() };
        let cell = |i: usize, over: f64| page::bold_unless(format!("{over:.2}×"), holds[i]);
        [cell(0, over.world), cell(1, over.between)].join(" / ")
    };
    let cells = |Measured { row, .. }: &Measured<Row>| {
        let per_client = |value: f64| if row.clients == 0 { "–".to_owned() } else { short(value) };
        let scene = row.scene.as_deref().filter(|&scene| scene != DVE);
        let scene = scene.map(|scene| format!("{scene}, {}: ", row.cubes)).unwrap_or_default();
        vec![
            match row.relays_above {
                None => format!("{scene}{}", row.clients),
                Some(0) => format!("{scene}{}, told by the other node", row.clients),
                Some(above) => format!("{scene}{}, of which the leader tells {above}", row.clients),
            },
            short(row.ticks_per_s),
            format!("{} / {}", short(row.tick_p50_ms), short(row.tick_p99_ms)),
            over(row),
            [row.world_ms, row.fan_out_ms, row.net_ms, row.leader_ms].map(short).join(" / "),
            short(row.other_ms),
            short(row.clients_ms),
            per_client(row.bytes_per_s),
            per_client(row.updates_per_s),
            [row.leader_sent_per_s, row.other_sent_per_s]
                .map(|sent| sent.map_or_else(|| "–".to_owned(), short))
                .join(" / "),
        ]
    };
    page::table(&head, rows.iter().map(cells))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{committed, read_csv};

    #[test]
    fn what_misses_the_goal_is_bold() {
        let text = table(&read_csv::<Row>(&committed().join("fan-out.csv")).unwrap());
        let bold: Vec<_> = text.split("**").skip(1).step_by(2).collect();
        assert_eq!(bold, ["1.27×", "2.37×"], "{text}");
    }
}
