//! Measures what it costs to tell a client the states of a scene: bytes by field, over networks that delay
//! and lose. It simulates a leader that has one client. Nothing but the times depends on the machine.

mod picture;

use std::collections::BTreeMap;
use std::error::Error;
use std::time::{Duration, Instant};

use clap::Args;
use dcd::delta::{Field, FreeMotion, Receiver, Sender, Tally};
use dcd::prelude::*;
use dcd::protocol::{Part, STATES_BYTES, SharedState, StepRecord};
use dcd::sim::Random;
use dcd::space::{Epoch, RegionId, Tick};
use serde::{Deserialize, Serialize};

use crate::output::{Output, Sheet, Shown};
use crate::results::short;

const SHOWN: Shown<Row> = Shown { name: "bandwidth", table: picture::table, picture: Some(picture::picture) };
/// Leaders tell the states of every third tick.
const EVERY: u64 = 3;
/// Bytes of headers per datagram: those of UDP, QUIC and the message, and those of IP.
const DATAGRAM_COST: u64 = 90 + 28;

/// The settings of a run: how long it takes, and where its results go.
#[derive(Args)]
pub(crate) struct Bandwidth {
    /// Ticks of each run.
    #[arg(long, default_value_t = 900, conflicts_with = "quick")]
    ticks: u64,
    #[command(flatten)]
    output: Output,
}

/// The cost of a client of one scene over one network.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    scene: String,
    network: String,
    moving: f64,
    bytes_per_s: f64,
    bytes_per_moving_body_s: f64,
    states_per_s: f64,
    predicted_share: f64,
    whole_share: f64,
    /// Bits of a state by field.
    id: f64,
    reference: f64,
    owner: f64,
    place: f64,
    turn: f64,
    velocity: f64,
    spin: f64,
    /// Bytes of headers per state.
    headers: f64,
    /// Microseconds to code a state, and to read one.
    code_us: f64,
    read_us: f64,
    /// The time to code for 64 clients, over the time of the steps.
    clients_64: f64,
    told_error_max_mm: f64,
}

/// A network between leader and client: its name, the ticks each way, the most ticks added at random on the
/// way to the client, and the share of packets that is lost.
type Network = (&'static str, u64, u64, f64);

const NETWORKS: [Network; 4] = [
    ("this machine", 0, 0, 0.0),
    ("50 ms", 3, 0, 0.0),
    ("100 ± 20 ms, 5 % lost", 6, 2, 0.05),
    ("200 ± 20 ms, 1 % lost", 12, 2, 0.01),
];

/// The scenes by name and parameters. In `sweep` a short arm pushes some sixty cubes about, and a long one
/// some three hundred.
const SCENES: [(&str, &[(&str, &str)]); 5] = [
    ("sweep", &[]),
    ("sweep, long arm", &[("reach", "13")]),
    ("dve", &[]),
    ("drum", &[]),
    ("heap", &[("n", "1000")]),
];

struct Run {
    name: &'static str,
    world: World,
    step: StepRecord,
}

/// Opens the scene that the first word of `name` names.
pub(crate) fn open(name: &str, params: &[(&str, &str)]) -> Result<Scene, Box<dyn Error>> {
    let params = params.iter().fold(Params::new(), |all, (name, value)| all.with(name, value));
    Ok(Scene::open(name.split(',').next().unwrap_or(name), &params)?)
}

fn scenes() -> Result<Vec<Run>, Box<dyn Error>> {
    let mut runs = Vec::new();
    for (name, params) in SCENES {
        let scene = open(name, params)?;
        let config = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
        let step = config.step.record();
        let world = World::from_scene(&scene, config)?;
        runs.push(Run { name, world, step });
    }
    Ok(runs)
}

impl Bandwidth {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        self.output.fill(&SHOWN, |rows| self.measure(rows)).map(drop)
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        let ticks = if self.output.quick { 100 } else { self.ticks };
        for run in scenes()?.into_iter().take(if self.output.quick { 2 } else { 9 }) {
            for row in tell(run, ticks)? {
                eprintln!(
                    "{}, {}: {} B/s per moving body",
                    row.scene,
                    row.network,
                    short(row.bytes_per_moving_body_s)
                );
                rows.push(row)?;
            }
        }
        Ok(())
    }
}

/// One client, and the network on the way to it.
struct Way {
    network: Network,
    sender: Sender,
    receiver: Receiver,
    down: Vec<(u64, Tick, Part)>,
    up: Vec<(u64, dcd::protocol::Heard)>,
    bytes: u64,
    datagrams: u64,
    states: u64,
    /// The places of the bodies whose states were sent, by tick.
    sent: BTreeMap<Tick, BTreeMap<BodyId, [f64; 3]>>,
    worst: f64,
    code: Duration,
    read: Duration,
}

fn tell(mut run: Run, ticks: u64) -> Result<Vec<Row>, Box<dyn Error>> {
    let step = run.step;
    let motion = FreeMotion::of(&step);
    let way = |network| {
        let mut receiver = Receiver::default();
        receiver.set_motion(motion);
        let (down, up) = (Vec::new(), Vec::new());
        Way {
            network,
            sender: Sender::new(motion, 1),
            receiver,
            down,
            up,
            bytes: 0,
            datagrams: 0,
            states: 0,
            sent: BTreeMap::new(),
            worst: 0.0,
            code: Duration::ZERO,
            read: Duration::ZERO,
        }
    };
    let mut steps = Duration::ZERO;
    let mut ways = NETWORKS.map(way);
    let mut random = Random::new(7);
    let mut newest = BTreeMap::<BodyId, SharedState>::new();
    let mut moving = 0;
    for tick in 1..=ticks {
        let start = Instant::now();
        run.world.step()?;
        steps += start.elapsed();
        let state = |body: dcd::MovableBody| SharedState {
            id: body.id,
            owner: RegionId(1),
            epoch: Epoch(0),
            pose: body.pose,
            velocity: body.velocity,
            sleeping: body.sleeping,
        };
        let mut moved = Vec::new();
        if tick % EVERY == 0 {
            let is_new = |state: &SharedState| newest.get(&state.id) != Some(state);
            moved = run.world.movable_bodies().map(state).filter(is_new).collect();
            newest.extend(moved.iter().map(|state| (state.id, *state)));
            moving += moved.len();
        }
        for way in &mut ways {
            way.tick(tick, &moved, &newest, &mut random)?;
        }
    }
    let seconds = ticks as f64 * f64::from(step.dt_s);
    let moving = moving as f64 / (ticks / EVERY) as f64;
    Ok(ways.iter().map(|way| way.row(run.name, seconds, moving, steps)).collect())
}

impl Way {
    fn tick(
        &mut self,
        tick: u64,
        moved: &[SharedState],
        newest: &BTreeMap<BodyId, SharedState>,
        random: &mut Random,
    ) -> Result<(), Box<dyn Error>> {
        let (now, (_, delay, jitter, loss)) = (Tick(tick), self.network);
        let clock = Duration::from_secs_f64(tick as f64 / 60.0);
        let come: Vec<_> = self.down.extract_if(.., |(at, ..)| *at <= tick).collect();
        for (_, of, part) in come {
            let start = Instant::now();
            let states = self.receiver.take_in(clock, of, &part, false)?;
            self.read += start.elapsed();
            for told in states {
                let is = self.sent[&of][&told.id];
                let off = (0..3).map(|i| (is[i] - told.pose.translation[i]).powi(2)).sum::<f64>().sqrt();
                self.worst = self.worst.max(off);
            }
        }
        if let Some(heard) = self.receiver.due(clock, 0)
            && !random.chance(loss)
        {
            self.up.push((tick + delay, heard));
        }
        for (_, heard) in self.up.extract_if(.., |(at, _)| *at <= tick) {
            self.sender.hear(now, &heard);
        }
        let start = Instant::now();
        let mut tells: BTreeMap<_, _> =
            self.sender.overdue(now).iter().filter_map(|id| Some((*id, *newest.get(id)?))).collect();
        tells.extend(moved.iter().map(|state| (state.id, *state)));
        let states: Vec<_> = tells.into_values().collect();
        self.states += states.len() as u64;
        let parts = self.sender.pack(now, now, &states, false, STATES_BYTES);
        self.code += start.elapsed();
        self.sent.insert(now, states.iter().map(|state| (state.id, state.pose.translation)).collect());
        self.sent.retain(|of, _| of.0 + 60 > tick);
        for part in parts {
            self.bytes += part.states.len() as u64;
            self.datagrams += 1;
            if !random.chance(loss) {
                self.down.push((tick + delay + random.below(1 + jitter), now, part));
            }
        }
        Ok(())
    }

    fn row(&self, scene: &str, seconds: f64, moving: f64, steps: Duration) -> Row {
        let Tally { states, wholes, predicted, bits, .. } = *self.receiver.tally();
        let of = |field: Field| bits[field as usize] / states as f64;
        let headers = self.datagrams * DATAGRAM_COST;
        let bytes_per_s = (self.bytes + headers) as f64 / seconds;
        Row {
            scene: scene.to_owned(),
            network: self.network.0.to_owned(),
            moving,
            bytes_per_s,
            bytes_per_moving_body_s: bytes_per_s / moving,
            states_per_s: self.states as f64 / seconds,
            predicted_share: predicted as f64 / states as f64,
            whole_share: wholes as f64 / states as f64,
            id: of(Field::Id),
            reference: of(Field::Reference),
            owner: of(Field::Owner),
            place: of(Field::Place),
            turn: of(Field::Turn),
            velocity: of(Field::Velocity),
            spin: of(Field::Spin),
            headers: headers as f64 / self.states as f64,
            code_us: 1e6 * self.code.as_secs_f64() / self.states as f64,
            read_us: 1e6 * self.read.as_secs_f64() / states as f64,
            clients_64: 64.0 * self.code.as_secs_f64() / steps.as_secs_f64(),
            told_error_max_mm: 1e3 * self.worst,
        }
    }
}
