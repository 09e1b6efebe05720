//! Measures what a client sees of a served world, and what that costs: bytes, staleness, and how far from the
//! truth the client shows bodies.
//!
//! A server, a node and a client run in one process, over real QUIC. A proxy delays and loses packets between
//! client and node. Served worlds are bit-equal to local ones, so the truth is computed afterwards, when the
//! machine has nothing else to do.

mod picture;

use std::error::Error;
use std::time::{Duration, Instant};

use clap::Args;
use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;
use dcd::protocol::BodyKind;
use dcd::runtime::ClientWorld;
use dcd_tests::proxy::{Proxy, Weather, free_address};
use dcd_tests::truth::{Frame, Quantiles, Seen, Truth};
use serde::{Deserialize, Serialize};

use crate::bandwidth;
use crate::output::{Output, Sheet, Shown};
use crate::results::short;

const SHOWN: Shown<Row> = Shown { name: "clients", table: picture::table, picture: Some(picture::picture) };
const FRAME: Duration = Duration::from_micros(16_667);
const PATIENCE: Duration = Duration::from_secs(60);

/// The settings of a run: how long it takes, and where its results go.
#[derive(Args)]
pub(crate) struct Clients {
    #[command(flatten)]
    output: Output,
    /// Seconds that are measured of each run.
    #[arg(long, default_value_t = 8, conflicts_with = "quick")]
    seconds: u64,
}

/// A client's view of one scene over one network.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    scene: String,
    network: String,
    /// The most bytes per second that the client is sent; 0: no limit.
    limit_bytes_per_s: u32,
    bodies: usize,
    moving: f64,
    bytes_per_s: f64,
    bytes_per_moving_body_s: f64,
    staleness_p50_ms: f64,
    staleness_p99_ms: f64,
    /// How far what is shown is behind the world, milliseconds.
    behind_ms: f64,
    shown_error_p50_mm: f64,
    shown_error_p99_mm: f64,
    shown_error_max_mm: f64,
    /// The distance by which what is shown of a body moves otherwise than the body itself, from one frame to
    /// the next.
    shown_jump_p99_mm: f64,
    shown_jump_max_mm: f64,
    /// The same for the newest states, as they come.
    told_error_p99_mm: f64,
    told_jump_p99_mm: f64,
    frames_per_s: f64,
}

/// The scenes by name and parameters; the first two are measured with limits too.
const SCENES: [(&str, &[(&str, &str)]); 5] = [
    ("sweep", &[]),
    ("sweep, long arm", &[("reach", "13")]),
    ("dve", &[]),
    ("drum", &[]),
    ("dve, 5,000", &[("n", "5000")]),
];

/// The limits on what a client may be sent, bytes per second; 0: as much as the link carries.
const LIMITS: [u32; 4] = [0, 16_000, 8_000, 4_000];

fn networks() -> [(&'static str, Weather); 5] {
    let ms = Duration::from_millis;
    let far =
        |delay, jitter, loss| Weather { delay: ms(delay), jitter: ms(jitter), loss, ..Weather::default() };
    [
        ("this machine", Weather::default()),
        ("50 ± 10 ms", far(50, 10, 0.0)),
        ("100 ± 20 ms, 5 % lost", far(100, 20, 0.05)),
        ("100 ± 50 ms, 5 % lost", far(100, 50, 0.05)),
        ("200 ± 20 ms, 1 % lost", far(200, 20, 0.01)),
    ]
}

impl Clients {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        self.output.fill(&SHOWN, |rows| self.measure(rows)).map(drop)
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        let seconds = Duration::from_secs(if self.output.quick { 1 } else { self.seconds });
        for (i, (name, params)) in
            SCENES.into_iter().enumerate().take(if self.output.quick { 1 } else { SCENES.len() })
        {
            for (network, weather) in networks().into_iter().take(if self.output.quick { 2 } else { 9 }) {
                for limit in
                    LIMITS.into_iter().take(if i > 1 || self.output.quick { 1 } else { LIMITS.len() })
                {
                    let row = see(world(name, params)?, (name, network, limit), weather, seconds)?;
                    eprintln!(
                        "{name}, {network}, {limit}: {} mm off, {} B/s",
                        short(row.shown_error_p99_mm),
                        short(row.bytes_per_s)
                    );
                    rows.push(row)?;
                }
            }
        }
        Ok(())
    }
}

fn world(name: &str, params: &[(&str, &str)]) -> Result<World, Box<dyn Error>> {
    let scene = bandwidth::open(name, params)?;
    let config = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::for_scene(&scene) };
    Ok(World::from_scene(&scene, config)?)
}

fn see(
    local: World,
    (name, network, limit): (&str, &str, u32),
    weather: Weather,
    seconds: Duration,
) -> Result<Row, Box<dyn Error>> {
    let data = tempfile::tempdir()?;
    let server = local.serve_copy(ServeConfig::new(data.path()))?;
    let join = |role| -> Result<JoinConfig, Box<dyn Error>> {
        let token = server.token(role, PATIENCE)?;
        Ok(JoinConfig { timeout: PATIENCE, ..JoinConfig::new(server.address()?, token) })
    };
    let (proxy, address) = (Proxy::start(7), free_address());
    let front = proxy.front(address);
    let at = JoinConfig { listen: Some(address), advertise: Some(front), ..join(JoinRole::Node)? };
    let node = World::join_as_node(&at)?;
    proxy.set(weather);
    let mut client = ClientWorld::connect(&join(JoinRole::Client)?)?;
    client.limit((limit > 0).then_some(limit))?;
    if !client.wait_update(0, PATIENCE) {
        return Err("the world does not begin".into());
    }
    let (mut frames, mut stale_ms) = (Vec::new(), Vec::new());
    let dt_ms = 1e3 * f64::from(local.dt_s());
    let warm_up = Duration::from_secs(3);
    let begin = Instant::now();
    let (mut next, mut bytes, mut moving) = (begin, None, 0);
    while begin.elapsed() < warm_up + seconds {
        next += FRAME;
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        client.check()?;
        let time = client.view_time();
        let Some(time) = time.filter(|_| begin.elapsed() >= warm_up) else { continue };
        bytes.get_or_insert_with(|| (Instant::now(), client.traffic().udp_bytes_in));
        let told = client.with_bodies(|view| {
            let body = &view.body;
            if body.traits.kind == BodyKind::Fixed {
                return None;
            }
            if !body.state.sleeping {
                moving += 1;
                stale_ms.push((time.now - view.tick.0 as f64) * dt_ms);
            }
            Some((body.id, body.state.pose))
        });
        let shown = client.motions_at(told.iter().map(|(id, _)| *id), &time);
        let bodies = told
            .into_iter()
            .zip(shown)
            .filter_map(|((id, told), shown)| Some(Seen { id, told, shown: shown?.pose }));
        frames.push(Frame { at: Instant::now(), time, bodies: bodies.collect() });
    }
    let (since, bytes_before) = bytes.ok_or("no frame was measured")?;
    let measured_s = since.elapsed().as_secs_f64();
    let bytes_per_s = (client.traffic().udp_bytes_in - bytes_before) as f64 / measured_s;
    client.leave()?;
    drop((node, server));

    let truth = Truth::of(local, &frames)?;
    let (shown, told) = (truth.shown(&frames), truth.told(&frames));
    let moving = f64::from(moving) / frames.len() as f64;
    let behind = frames.iter().map(|frame| frame.time.now - frame.time.shown).sum::<f64>();
    let stale = Quantiles::from(stale_ms);
    let (errors, jumps) = shown;
    let (told_errors, told_jumps) = told;
    Ok(Row {
        scene: name.to_owned(),
        network: network.to_owned(),
        limit_bytes_per_s: limit,
        bodies: frames.first().map_or(0, |frame| frame.bodies.len()),
        moving,
        bytes_per_s,
        bytes_per_moving_body_s: bytes_per_s / moving,
        staleness_p50_ms: stale.at(0.5),
        staleness_p99_ms: stale.at(0.99),
        behind_ms: behind / frames.len() as f64 * dt_ms,
        shown_error_p50_mm: 1e3 * errors.at(0.5),
        shown_error_p99_mm: 1e3 * errors.at(0.99),
        shown_error_max_mm: 1e3 * errors.at(1.0),
        shown_jump_p99_mm: 1e3 * jumps.at(0.99),
        shown_jump_max_mm: 1e3 * jumps.at(1.0),
        told_error_p99_mm: 1e3 * told_errors.at(0.99),
        told_jump_p99_mm: 1e3 * told_jumps.at(0.99),
        frames_per_s: frames.len() as f64 / measured_s,
    })
}
