//! Compares the same boxes in bare Rapier, Rapier's `parallel`, Box3D, Jolt and dcd: the time of a step
//! beside what the step is worth, which is measured alike for all from the poses read back.

mod bodies;
mod box3d;
mod case;
mod engine;
mod jolt;
mod look;
mod picture;
mod world;

use std::error::Error;

use clap::Args;
use dcd::runtime::measure::Plan;
use dcd::scene::Scene;
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::bodies::Bodies;
use self::case::{CASES, Case};
use self::engine::{ENGINES, Engine};
use self::look::{Look, Looker};
use crate::output::{Output, Sheet, Shown};
use crate::results::short;
use crate::timing::{WARM_UP, median_of};

const SHOWN: Shown<Row> = Shown { name: "peers", table: picture::table, picture: Some(picture::picture) };

/// Which scenes are run, and how often.
#[derive(Args)]
pub(crate) struct Peers {
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    #[command(flatten)]
    output: Output,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
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
    /// The number of regions; 0 where there are none.
    regions: usize,
    ticks: usize,
    /// Milliseconds per step, median of the fastest run.
    ms_p50: f64,
    /// The median step over that of bare Rapier: below 1 is faster.
    over_bare: f64,
    /// The mean depth of the pairs that overlap, metres, mean of the last second.
    mean_depth_m: f64,
    /// The depth of the deepest pair in the last second, metres.
    deepest_m: f64,
    /// Kinetic and potential energy, joules, mean of the last second.
    energy_j: f64,
    /// The energy before the first step, joules.
    start_energy_j: f64,
    /// The mean height of all bodies that move, metres, mean of the last second.
    mean_height_m: f64,
    /// The mean height before the first step, metres.
    start_height_m: f64,
    /// Bodies that are not finite or outside of everything fixed, at most in the last second.
    lost: usize,
}

/// The figures of a run, which tell what it is worth.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    regions: usize,
    start: Look,
    /// The last second: the means, the deepest pair and the most bodies lost.
    last: Look,
}

impl Peers {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let mut fresh = Vec::new();
        self.output.fill(&SHOWN, |rows| self.measure_all(rows, &mut fresh))?;
        if self.json {
            println!("{}", json!({ "peers": fresh }));
        }
        Ok(())
    }

    fn measure_all(&self, rows: &mut Sheet<Row>, fresh: &mut Vec<Row>) -> Result<(), Box<dyn Error>> {
        if box3d::has_assertions() {
            let cause =
                "Box3D is compiled with its assertions; run with `CFLAGS=-DNDEBUG` in the environment";
            if !self.output.quick {
                return Err(cause.into());
            }
            eprintln!("note: {cause}");
        }
        if !self.scene.is_empty() {
            rows.recall()?;
        }
        for case in self.cases()? {
            let of_case = self.measure(case)?;
            print(&of_case);
            let measured: Vec<_> = of_case.iter().cloned().map(|row| rows.measured(row)).collect();
            rows.replace(|old| old.scene == case.name, measured)?;
            fresh.extend(of_case);
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
        let scene = case.scene(self.output.quick)?;
        let (bodies, threads) = (Bodies::of(&scene)?, usize::from(self.threads));
        let looker = Looker::new(&bodies);
        let ticks = Plan::ticks_of(case.size(self.output.quick).seconds, scene.dt_s) as usize;
        let mut outcomes = Vec::new();
        for engine in ENGINES {
            eprintln!("{}: what it is worth, {}", case.name, engine.name());
            outcomes.push(outcome(engine, &scene, &looker, &bodies, threads, ticks)?);
        }
        let times = self.time(case.name, &scene, &bodies, ticks)?;
        let bare_ms = times[0];
        let rows = ENGINES.into_iter().zip(times).zip(outcomes);
        Ok(rows
            .map(|((engine, ms_p50), Outcome { regions, start, last })| Row {
                scene: case.name.to_owned(),
                bodies: bodies.movers().count(),
                engine: engine.name().to_owned(),
                threads: engine.threads(threads),
                regions,
                ticks,
                ms_p50,
                over_bare: ms_p50 / bare_ms,
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

    /// Times all engines in turn, several times over. Returns the milliseconds per step of the fastest run of
    /// each.
    fn time(
        &self,
        name: &str,
        scene: &Scene,
        bodies: &Bodies,
        ticks: usize,
    ) -> Result<Vec<f64>, Box<dyn Error>> {
        assert!(ticks > WARM_UP, "a case runs for longer than the warm-up");
        let repeats = self.repeats.unwrap_or(if self.output.quick { 1 } else { 6 });
        let mut best = vec![f64::INFINITY; ENGINES.len()];
        for repeat in 1..=repeats {
            for (engine, best) in ENGINES.into_iter().zip(&mut best) {
                eprintln!("{name}: time, run {repeat} of {repeats}, {}", engine.name());
                let mut world = engine.world(scene, bodies, self.threads.into())?;
                *best = best.min(median_of(&world.steps(ticks)?)?);
            }
        }
        Ok(best)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::results::{self, Measured};

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
