//! Measures what recording a world costs: time per step, and bytes per second.

use std::error::Error;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use serde::{Deserialize, Serialize};

use crate::output::{Output, Sheet, Shown};
use crate::page;
use crate::results::{Measured, short};

/// The first steps of a run, which are left out: the snapshot that begins a recording is written before the
/// first.
const WARM_UP: usize = 10;
const SHOWN: Shown<Row> = Shown { name: "recording", table, picture: None };

/// Measures step times with and without a recording, in turn, on one thread.
#[derive(Args)]
pub(crate) struct Recording {
    #[command(flatten)]
    output: Output,
    /// Runs of each; of every step, the run counts in which it took least.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
}

/// The figures of one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    scene: String,
    bodies: usize,
    awake: usize,
    regions: usize,
    step_ms: f64,
    recorded_ms: f64,
    /// The time that recording adds, percent of a step.
    added_percent: f64,
    /// The time that recording adds, percent of a sixtieth of a second.
    of_tick_percent: f64,
    /// Kilobytes recorded per second, at 60 steps per second, without snapshots and what the program does.
    kb_per_s: f64,
    snapshot_kb: f64,
}

/// A writer that counts what is written.
#[derive(Clone, Default)]
struct Counter(Arc<AtomicU64>);

impl Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Recording {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        self.output.fill(&SHOWN, |rows| self.measure(rows)).map(drop)
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        let (steps, cases): (usize, &[(&str, &str, usize, usize)]) = if self.output.quick {
            (40, &[("pile", "n", 200, 1), ("pile", "n", 200, 8)])
        } else {
            let cases = &[
                ("pile", "n", 5_000, 1),
                ("pile", "n", 5_000, 8),
                ("pile", "n", 5_000, 64),
                ("terrain", "n", 5_000, 64),
                ("dve", "n", 1_000, 8),
                ("dve", "n", 5_000, 64),
                ("ragdolls", "count", 300, 8),
                ("drum", "n", 300, 2),
            ];
            (200, cases)
        };
        let repeats = if self.output.quick { 1 } else { self.repeats.into() };
        for &(scene, name, count, regions) in cases {
            eprintln!("{scene} of {count} in {regions} regions");
            let row = measure(scene, name, count, regions, steps, repeats)?;
            eprintln!(
                "  {:.2} ms, recorded {:.2} ms, {:.1} kB/s",
                row.step_ms, row.recorded_ms, row.kb_per_s
            );
            rows.push(row)?;
        }
        Ok(())
    }
}

fn table(rows: &[Measured<Row>]) -> String {
    let cells = |Measured { row, .. }: &Measured<Row>| {
        let percent = |v: f64| format!("{v:.1}");
        vec![
            row.scene.clone(),
            row.bodies.to_string(),
            row.awake.to_string(),
            row.regions.to_string(),
            short(row.step_ms),
            short(row.recorded_ms),
            percent(row.added_percent),
            percent(row.of_tick_percent),
            short(row.kb_per_s),
            short(row.snapshot_kb),
        ]
    };
    let head = [
        "scene",
        "bodies",
        "awake",
        "regions",
        "step, ms",
        "recorded, ms",
        "added, %",
        "of a 60th of a second, %",
        "kB/s",
        "snapshot, kB",
    ];
    page::table(&head, rows.iter().map(cells))
}

fn measure(
    scene: &str,
    name: &str,
    count: usize,
    regions: usize,
    steps: usize,
    repeats: usize,
) -> Result<Row, Box<dyn Error>> {
    let scene = Scene::named(scene, &Params::new().with(name, count as i64))?;
    let partitioning = Partitioning::Regions(regions);
    let config = WorldConfig { partitioning, ..WorldConfig::for_scene(&scene) };
    let mut least = [vec![Duration::MAX; steps], vec![Duration::MAX; steps]];
    let (mut bytes, mut snapshot, mut awake, mut bodies) = (0, 0, 0, 0);
    for _ in 0..repeats {
        let mut worlds =
            [config.clone(), config.clone()].map(|config| LocalWorld::from_scene(&scene, config));
        let counter = Counter::default();
        if let Ok(world) = &mut worlds[1] {
            world.record(counter.clone())?;
        }
        let [plain, recorded] = worlds;
        let mut worlds = [plain?, recorded?];
        for step in 0..steps {
            // In turn, so that whatever else the machine does disturbs both alike.
            for (world, least) in worlds.iter_mut().zip(&mut least) {
                let start = Instant::now();
                world.step()?;
                least[step] = least[step].min(start.elapsed());
            }
            if step == WARM_UP {
                snapshot = counter.0.load(Ordering::Relaxed);
            }
        }
        let [plain, mut recorded] = worlds;
        if plain.state_hash() != recorded.state_hash() {
            return Err("a recorded world is another".into());
        }
        bodies = plain.stats().bodies;
        awake = plain.regions().map(|region| region.awake_count()).sum();
        recorded.stop_recording()?;
        bytes = counter.0.load(Ordering::Relaxed) - snapshot;
    }
    let mean_ms = |least: &[Duration]| {
        let sum: Duration = least[WARM_UP..].iter().sum();
        1e3 * sum.as_secs_f64() / (steps - WARM_UP) as f64
    };
    let [step_ms, recorded_ms] = [mean_ms(&least[0]), mean_ms(&least[1])];
    Ok(Row {
        scene: scene.name.clone(),
        bodies,
        awake,
        regions,
        step_ms,
        recorded_ms,
        added_percent: 100.0 * (recorded_ms / step_ms - 1.0),
        of_tick_percent: 100.0 * (recorded_ms - step_ms) * 60.0 / 1e3,
        kb_per_s: bytes as f64 * 60.0 / (steps - 1 - WARM_UP) as f64 / 1e3,
        snapshot_kb: snapshot as f64 / 1e3,
    })
}
