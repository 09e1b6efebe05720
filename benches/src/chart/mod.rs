//! Charts speed against accuracy: every coupling at every number of regions and exchanges, one bare Rapier world swept over its time
//! step and over its iterations, and `auto` with its presets; and whether anything fixed is better than `auto`.
//!
//! Errors come from the accuracy suite, on all cores. Times come from runs of their own, one world at a time: nothing is
//! looked at between their steps, all settings are run in turn, several times over, and the run with the smallest median
//! counts.

mod front;
mod panel;
mod picture;
mod setting;

use std::error::Error;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::panel::{PANELS, Panel, QUICK_PANELS};
use crate::accuracy::{Case, Reference, judge, read};
use crate::machine::Machine;
use crate::page;
use crate::results::{self, Measured};
use crate::timing::{StepMs, WARM_UP};

/// What is charted.
#[derive(Args)]
pub(crate) struct Chart {
    /// A few scenes and settings, one run each; the results go to a temporary folder unless `--out` names one.
    #[arg(long)]
    quick: bool,
    /// Draws the picture and the page's table from the file, without measuring.
    #[arg(long)]
    draw: bool,
    /// Where `chart.csv` and the pictures go [default: benches/results].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// How often each world is timed; the fastest run counts.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
}

/// One setting in one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    scene: String,
    case: String,
    /// `bare` for one Rapier world, else the coupling.
    method: String,
    /// What is swept: `dt`, `iterations`, `exchanges`, `preset`.
    sweep: String,
    /// The value of what is swept.
    setting: String,
    /// 0: one bare Rapier world.
    regions: usize,
    threads: usize,
    error: f64,
    unit: String,
    /// Differences of the error up to this mean nothing.
    noise: f64,
    /// The largest error that passes the gate.
    gate: f64,
    /// Whether the gate is passed, ground force, momentum and the number of bodies included.
    pass: bool,
    /// Simulated seconds a second of wall time.
    rtf: f64,
    mean_ms: f64,
    p50_ms: f64,
    p99_ms: f64,
    max_ms: f64,
}

impl Chart {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let folder = results::folder(self.out.as_deref(), self.quick)?;
        let path = folder.join("chart.csv");
        let panels = if self.quick { QUICK_PANELS } else { PANELS };
        if let Some(name) = self.scene.iter().find(|name| panels.iter().all(|panel| panel.scene != **name)) {
            let known: Vec<_> = panels.iter().map(|panel| panel.scene).collect();
            return Err(format!("the chart has no scene `{name}`; it has {}", known.join(", ")).into());
        }
        let mut rows = results::read_csv::<Row>(&path)?;
        if !self.draw {
            let machine = Machine::here();
            let wanted =
                |panel: &&Panel| self.scene.is_empty() || self.scene.iter().any(|name| name == panel.scene);
            rows.retain(|row| panels.iter().any(|panel| panel.is(&row.row.scene, &row.row.case)));
            for panel in panels.iter().filter(wanted) {
                let fresh = self.measure(panel)?;
                rows.retain(|row| !panel.is(&row.row.scene, &row.row.case));
                rows.extend(fresh.into_iter().map(|row| Measured { row, machine: machine.clone() }));
                // After every panel: a run that is stopped keeps what it has.
                results::write_csv(&path, &rows)?;
            }
        }
        publish(&folder, &rows)?;
        print!("{}", front::text(&rows));
        println!("{} and its pictures are in {}", path.display(), folder.display());
        Ok(())
    }

    fn measure(&self, panel: &Panel) -> Result<Vec<Row>, Box<dyn Error>> {
        let case = panel.case()?;
        let settings = panel.settings(self.quick, case.scenes[0].dt_s);
        let style = ProgressStyle::with_template("{prefix} {msg} {bar:30} {pos}/{len} {elapsed}")?;
        let repeats = if self.quick { 1 } else { self.repeats };
        let steps = settings.len() as u64 * (1 + u64::from(repeats));
        let bar = ProgressBar::new(steps).with_style(style).with_prefix(panel.scene).with_message("errors");
        let reference = Reference::of(&case)?;
        let readings: Vec<_> = settings
            .par_iter()
            .map(|setting| setting.with(|setup| read(&case, &setup, &reference)).inspect(|_| bar.inc(1)))
            .collect::<Result<_, _>>()?;
        bar.set_message("times ");
        let threads = panel.threads(&case);
        let seconds = timed_s(&case, reference.r1.rtf, self.quick);
        let mut best: Vec<Option<StepMs>> = vec![None; settings.len()];
        for _ in 0..repeats {
            for (setting, best) in settings.iter().zip(&mut best) {
                let step = setting.time(&case, seconds, threads)?;
                *best = Some(best.map_or(step, |best| best.faster(step)));
                bar.inc(1);
            }
        }
        bar.finish();
        let rows = settings.iter().zip(&readings).zip(best).map(|((setting, reading), step)| {
            let StepMs { mean_ms, p50_ms, p99_ms, max_ms } = step.expect("every setting is timed");
            let verdict = judge(&case, reading, &reference.r1);
            let (sweep, value) = setting.sweep();
            Row {
                scene: panel.scene.to_owned(),
                case: case.label.clone(),
                method: setting.method().to_owned(),
                sweep: sweep.to_owned(),
                setting: value,
                regions: setting.regions(),
                threads: setting.threads(threads),
                error: reading.error,
                unit: case.unit.to_owned(),
                noise: panel::noise(&case, reading),
                gate: verdict.limit,
                pass: verdict.pass(),
                rtf: setting.dt_s(&case) * 1e3 / mean_ms,
                mean_ms,
                p50_ms,
                p99_ms,
                max_ms,
            }
        });
        Ok(rows.collect())
    }
}

/// How much of a case is timed, in simulated seconds: half a second's work of one bare world, at most all of it, at least
/// enough steps for a percentile.
fn timed_s(case: &Case, rtf: f64, quick: bool) -> f64 {
    let wall_s = if quick { 0.05 } else { 0.3 };
    let least_s = f64::from(case.scenes[0].dt_s) * (2 * WARM_UP + 30) as f64;
    (wall_s * rtf).min(case.seconds).max(least_s)
}

fn publish(folder: &Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
    crate::draw::write(&picture::picture(rows), &folder.join("chart"))?;
    page::put(folder, "chart", &front::table(rows))
}
