//! Measures what partitioning costs at one region and gains at more: step times against one bare Rapier world, and against Rapier's own
//! `parallel` solver on the same threads. Machines are noisy: all variants of a case are run in turn, several times over, and
//! the run with the smallest median counts.

mod case;
mod measure;
mod picture;

use std::error::Error;
use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::case::{CASES, Case, QUICK_CASES, Variant};
use self::measure::{Measurement, measure};
use crate::machine::Machine;
use crate::page;
use crate::results::{self, Measured};
use crate::timing::StepMs;

/// Which worlds are timed, and how often.
#[derive(Args)]
pub(crate) struct Speed {
    /// How often each world is run; the fastest counts.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// A few small worlds and short runs, without `parallel`; writes no file unless `--out` names one.
    #[arg(long)]
    quick: bool,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Where the results go; pictures go beside them [default: benches/results/speed.csv].
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Regions, and threads of Rapier's `parallel`, stepped at a time.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Leaves out Rapier's own `parallel` solver.
    #[arg(long)]
    no_parallel: bool,
    /// Measures it also with `--quick`.
    #[arg(long, conflicts_with = "no_parallel")]
    parallel: bool,
    /// Draws the picture and the page's table from the file, without measuring.
    #[arg(long)]
    draw: bool,
}

/// One world at its best.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    scene: String,
    bodies: usize,
    /// Of Rapier's solver: `serial` or `parallel`.
    solver: String,
    /// 0: one bare Rapier world.
    regions: usize,
    threads: usize,
    coupling: String,
    exchanges: usize,
    ticks: usize,
    mean_ms: f64,
    p50_ms: f64,
    p99_ms: f64,
    max_ms: f64,
    replicas: usize,
    /// How many times faster than one bare, serial world, by medians.
    over_bare: f64,
    /// How many times faster than Rapier's `parallel` on the same threads.
    over_parallel: Option<f64>,
}

impl Speed {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let out = self.out.clone().or_else(|| (!self.quick).then(|| results::committed().join("speed.csv")));
        if self.draw {
            let path = out.ok_or("`--draw` with `--quick` needs `--out`: name the file to draw")?;
            return publish(&path, &results::read_csv(&path)?);
        }
        let with_parallel = self.parallel || !(self.quick || self.no_parallel);
        let machine = Machine::here();
        let wanted = |case: &&Case| self.scene.is_empty() || self.scene.iter().any(|name| name == case.scene);
        let cases: Vec<_> = if self.quick { QUICK_CASES } else { CASES }.iter().filter(wanted).collect();
        if cases.is_empty() {
            return Err(format!("no such scene; there are {}", case::names().join(", ")).into());
        }
        let mut rows: Vec<Measured<Row>> = match &out {
            Some(path) if !self.scene.is_empty() => results::read_csv(path)?,
            _ => Vec::new(),
        };
        let mut fresh = Vec::new();
        for case in cases {
            let of_case = self.measure(case, with_parallel)?;
            rows.retain(|old| (&*old.row.scene, old.row.bodies) != (case.scene, case.bodies));
            rows.extend(of_case.iter().map(|row| Measured { row: row.clone(), machine: machine.clone() }));
            fresh.extend(of_case);
            // After every case: a run that is stopped keeps what it has.
            if let Some(path) = &out {
                results::write_csv(path, &rows)?;
            }
        }
        if let Some(path) = &out {
            publish(path, &rows)?;
        }
        if self.json {
            println!("{}", json!({ "speed": fresh }));
        }
        Ok(())
    }

    fn measure(&self, case: &Case, with_parallel: bool) -> Result<Vec<Row>, Box<dyn Error>> {
        eprintln!("{} {}: prepares", case.scene, case.bodies);
        let scene = case.scene()?;
        let variants = case.variants(self.quick, self.threads, with_parallel);
        let ticks = case::ticks_worth(measure(&scene, &variants[0], 1)?.step.p50_ms, self.quick);
        let mut best: Vec<Option<Measurement>> = vec![None; variants.len()];
        for repeat in 1..=self.repeats {
            eprintln!("{} {}: run {repeat} of {}, {ticks} ticks each", case.scene, case.bodies, self.repeats);
            for (variant, best) in variants.iter().zip(&mut best) {
                let measured = measure(&scene, variant, ticks)?;
                let step = best.as_ref().map_or(measured.step, |best| best.step.faster(measured.step));
                *best = Some(Measurement { step, ..measured });
            }
        }
        let measured: Vec<_> = best.into_iter().flatten().collect();
        let median_of = |of: &Variant| {
            let at = variants.iter().position(|variant| variant == of)?;
            Some(measured[at].step.p50_ms)
        };
        let bare_ms = median_of(&Variant::bare()).expect("the bare world is always measured");
        let parallel_ms = median_of(&Variant::bare_parallel(self.threads));
        let rows: Vec<_> = variants
            .iter()
            .zip(&measured)
            .map(|(variant, measured)| {
                let StepMs { mean_ms, p50_ms, p99_ms, max_ms } = measured.step;
                Row {
                    scene: case.scene.to_owned(),
                    bodies: case.bodies,
                    solver: if variant.parallel { "parallel" } else { "serial" }.to_owned(),
                    regions: variant.regions,
                    threads: variant.threads,
                    coupling: measured.coupling.clone(),
                    exchanges: measured.exchanges,
                    ticks,
                    mean_ms,
                    p50_ms,
                    p99_ms,
                    max_ms,
                    replicas: measured.replicas,
                    over_bare: bare_ms / p50_ms,
                    over_parallel: parallel_ms.map(|parallel_ms| parallel_ms / p50_ms),
                }
            })
            .collect();
        print(&rows);
        Ok(rows)
    }
}

fn print(rows: &[Row]) {
    println!("scene  bodies regions threads solver    p50 ms   p99 ms   max ms replicas over bare, parallel");
    for row in rows {
        let Row { scene, bodies, solver, regions, threads, p50_ms, p99_ms, max_ms, .. } = row;
        let over_parallel = row.over_parallel.map_or("–".to_owned(), |over| format!("{over:.2}x"));
        println!(
            "{scene:6} {bodies:6} {regions:7} {threads:7} {solver:8} {p50_ms:7.3} {p99_ms:8.3} {max_ms:8.3} {:8} {:8.2}x {over_parallel:>8}",
            row.replicas, row.over_bare
        );
    }
}

/// Picture and table, from what the file holds.
fn publish(path: &std::path::Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
    crate::draw::write(&picture::picture(rows), &path.with_extension(""))?;
    let folder = path.parent().unwrap_or(std::path::Path::new("."));
    page::put(folder, "speed", &picture::table(rows))
}
