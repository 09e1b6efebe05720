//! Compares the same boxes in bare Rapier, Rapier's `parallel`, Box3D, Jolt and dcd: time of a step beside what the step is worth, measured
//! alike for all from the poses read back.

mod bodies;
mod box3d;
mod case;
mod engine;
mod jolt;
mod look;
mod picture;
mod world;

use std::error::Error;
use std::path::{Path, PathBuf};

use clap::Args;
use dcd::runtime::measure::Plan;
use dcd::scene::Scene;
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::bodies::Bodies;
use self::case::{CASES, Case};
use self::engine::{ENGINES, Engine};
use self::look::{Look, Looker};
use crate::machine::Machine;
use crate::page;
use crate::results::{self, Measured, short};
use crate::timing::{StepMs, WARM_UP};

/// Which scenes are run, and how often.
#[derive(Args)]
pub(crate) struct Peers {
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Small scenes, timed once; writes no file unless `--out` names one.
    #[arg(long)]
    quick: bool,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Where the results go; the picture goes beside them [default: benches/results/peers.csv].
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Draws the picture and the page's table from the file, without measuring.
    #[arg(long)]
    draw: bool,
    /// Threads of every engine but bare Rapier.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=32))]
    threads: u16,
    /// How often each engine is timed; the fastest counts [default: 6, with `--quick` 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    repeats: Option<u16>,
}

/// A scene in one engine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    scene: String,
    bodies: usize,
    engine: String,
    threads: usize,
    /// 0 where there are none.
    regions: usize,
    ticks: usize,
    /// Milliseconds a step, median of the fastest run.
    ms_p50: f64,
    /// Of the time that bare Rapier takes, by medians: below 1 is faster.
    over_bare: f64,
    /// Of the pairs that overlap, metres, mean of the last second.
    mean_depth_m: f64,
    /// Of the deepest pair in the last second.
    deepest_m: f64,
    /// Kinetic and potential, mean of the last second.
    energy_j: f64,
    /// Before the first step.
    start_energy_j: f64,
    /// Of all bodies that move, mean of the last second.
    mean_height_m: f64,
    /// Before the first step.
    start_height_m: f64,
    /// Bodies that are not finite or outside of everything fixed, at the end.
    lost: usize,
}

/// What a run is worth.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    regions: usize,
    start: Look,
    /// Of the last second: the means, the deepest and the most.
    last: Look,
}

impl Peers {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let out = self.out.clone().or_else(|| (!self.quick).then(|| results::committed().join("peers.csv")));
        if self.draw {
            let path = out.ok_or("`--draw` with `--quick` needs `--out`: name the file to draw")?;
            return publish(&path, &results::read_csv(&path)?);
        }
        if box3d::has_assertions() {
            let cause =
                "Box3D is compiled with its assertions; run with `CFLAGS=-DNDEBUG` in the environment";
            if !self.quick {
                return Err(cause.into());
            }
            eprintln!("note: {cause}");
        }
        let cases = self.cases()?;
        let machine = Machine::here();
        let mut rows: Vec<Measured<Row>> = match &out {
            Some(path) if !self.scene.is_empty() => results::read_csv(path)?,
            _ => Vec::new(),
        };
        let mut fresh = Vec::new();
        for case in cases {
            let of_case = self.measure(case)?;
            print(&of_case);
            rows.retain(|old| old.row.scene != case.name);
            rows.extend(of_case.iter().map(|row| Measured { row: row.clone(), machine: machine.clone() }));
            fresh.extend(of_case);
            // After every scene: a run that is stopped keeps what it has.
            if let Some(path) = &out {
                results::write_csv(path, &rows)?;
            }
        }
        if let Some(path) = &out {
            publish(path, &rows)?;
        }
        if self.json {
            println!("{}", json!({ "peers": fresh }));
        }
        Ok(())
    }

    fn cases(&self) -> Result<Vec<&'static Case>, Box<dyn Error>> {
        if self.scene.is_empty() {
            return Ok(CASES.iter().collect());
        }
        Ok(self.scene.iter().map(|name| Case::named(name)).collect::<Result<_, _>>()?)
    }

    fn measure(&self, case: &Case) -> Result<Vec<Row>, Box<dyn Error>> {
        let scene = case.scene(self.quick)?;
        let (bodies, threads) = (Bodies::of(&scene)?, usize::from(self.threads));
        let looker = Looker::new(&bodies);
        let ticks = Plan::ticks_of(case.size(self.quick).seconds, scene.dt_s) as usize;
        let mut outcomes = Vec::new();
        for engine in ENGINES {
            eprintln!("{}: what it is worth, {}", case.name, engine.name());
            outcomes.push(outcome(engine, &scene, &looker, &bodies, threads, ticks)?);
        }
        let times = self.time(case.name, &scene, &bodies, ticks)?;
        let bare_ms = times[0].p50_ms;
        let rows = ENGINES.into_iter().zip(times).zip(outcomes);
        Ok(rows
            .map(|((engine, step), Outcome { regions, start, last })| Row {
                scene: case.name.to_owned(),
                bodies: bodies.movers().count(),
                engine: engine.name().to_owned(),
                threads: engine.threads(threads),
                regions,
                ticks,
                ms_p50: step.p50_ms,
                over_bare: step.p50_ms / bare_ms,
                mean_depth_m: last.mean_depth_m,
                deepest_m: last.deepest_m,
                energy_j: last.energy_j,
                start_energy_j: start.energy_j,
                mean_height_m: last.mean_height_m,
                start_height_m: start.mean_height_m,
                lost: last.lost,
            })
            .collect())
    }

    /// All engines in turn, several times over: the fastest run of each.
    fn time(
        &self,
        name: &str,
        scene: &Scene,
        bodies: &Bodies,
        ticks: usize,
    ) -> Result<Vec<StepMs>, Box<dyn Error>> {
        assert!(ticks > WARM_UP, "a case runs for longer than the warm-up");
        let repeats = self.repeats.unwrap_or(if self.quick { 1 } else { 6 });
        let mut best: Vec<Option<StepMs>> = vec![None; ENGINES.len()];
        for repeat in 1..=repeats {
            for (engine, best) in ENGINES.into_iter().zip(&mut best) {
                eprintln!("{name}: time, run {repeat} of {repeats}, {}", engine.name());
                let mut world = engine.world(scene, bodies, self.threads.into())?;
                let step = StepMs::from_steps(&world.steps(ticks)?)?;
                *best = Some(best.map_or(step, |best| best.faster(step)));
            }
        }
        Ok(best.into_iter().flatten().collect())
    }
}

/// Runs a scene and looks at it four times in its last second.
fn outcome(
    engine: Engine,
    scene: &Scene,
    looker: &Looker<'_>,
    bodies: &Bodies,
    threads: usize,
    ticks: usize,
) -> Result<Outcome, Box<dyn Error>> {
    const LOOKS: usize = 4;
    let between = Plan::ticks_of(1.0, scene.dt_s) as usize / LOOKS;
    let mut world = engine.world(scene, bodies, threads)?;
    let start = looker.look(&world.states());
    world.steps(ticks - (LOOKS - 1) * between)?;
    let mut looks = vec![looker.look(&world.states())];
    for _ in 1..LOOKS {
        world.steps(between)?;
        looks.push(looker.look(&world.states()));
    }
    let mean = |of: fn(&Look) -> f64| looks.iter().map(of).sum::<f64>() / LOOKS as f64;
    let last = Look {
        mean_depth_m: mean(|look| look.mean_depth_m),
        deepest_m: looks.iter().map(|look| look.deepest_m).fold(0.0, f64::max),
        energy_j: mean(|look| look.energy_j),
        mean_height_m: mean(|look| look.mean_height_m),
        lost: looks.iter().map(|look| look.lost).max().unwrap_or(0),
    };
    Ok(Outcome { regions: world.regions(), start, last })
}

fn print(rows: &[Row]) {
    println!(
        "scene   bodies engine          threads regions  p50 ms over bare mean depth   deepest energy mean height  lost"
    );
    for row in rows {
        let Row { scene, bodies, engine, threads, regions, ms_p50, over_bare, mean_height_m, lost, .. } = row;
        let (mean, deepest) = (short(row.mean_depth_m), short(row.deepest_m));
        println!(
            "{scene:8} {bodies:5} {engine:15} {threads:7} {regions:7} {ms_p50:7.3} {over_bare:8.2}x {mean:>10} {deepest:>9} {:6.3} {mean_height_m:11.4} {lost:5}",
            row.energy_j / row.start_energy_j
        );
    }
}

/// Picture and table, from what the file holds.
fn publish(path: &Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
    crate::draw::write(&picture::picture(rows), &path.with_extension(""))?;
    page::put(path.parent().unwrap_or(Path::new(".")), "peers", &picture::table(rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            scene: "pile".into(),
            bodies: 200,
            engine: "dcd, 2 regions".into(),
            threads: 2,
            regions: 2,
            ticks: 300,
            ms_p50: 0.25,
            over_bare: 0.5,
            mean_depth_m: 0.001,
            deepest_m: 0.004,
            energy_j: 90.0,
            start_energy_j: 100.0,
            mean_height_m: 4.5,
            start_height_m: 5.0,
            lost: 0,
        }
    }

    #[test]
    fn a_row_comes_back_from_its_file() {
        let path = std::env::temp_dir().join(format!("dcd-benches-peers-{}.csv", std::process::id()));
        let machine = Machine { cpu: "c".into(), cores: 2, date: "2026-11-22".into(), commit: "a".into() };
        results::write_csv(&path, &[Measured { row: row(), machine }]).unwrap();
        let read = results::read_csv::<Row>(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(read.into_iter().map(|read| read.row).collect::<Vec<_>>(), [row()]);
    }

    #[test]
    fn a_resting_tower_is_worth_the_same_in_every_engine() {
        let params = dcd::scene::Params::from_args(["n=4", "sleep=0"]).unwrap();
        let scene = Scene::named("tower", &params).unwrap();
        let bodies = Bodies::of(&scene).unwrap();
        let looker = Looker::new(&bodies);
        for engine in ENGINES {
            let Outcome { start, last, .. } = outcome(engine, &scene, &looker, &bodies, 2, 120).unwrap();
            assert_eq!((start.mean_height_m, start.lost, last.lost), (2.0, 0, 0), "{engine:?}");
            assert!((last.mean_height_m - 2.0).abs() < 0.1, "{engine:?}: {last:?}");
            assert!((last.energy_j / start.energy_j - 1.0).abs() < 0.05, "{engine:?}: {last:?}");
            // Jolt lets boxes sink into one another by up to 0.02 m.
            assert!(last.deepest_m < 0.03 && last.mean_depth_m <= last.deepest_m, "{engine:?}: {last:?}");
        }
    }
}
