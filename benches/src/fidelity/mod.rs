//! Measures what it saves, and what it costs, to compute less where nobody looks: time beside error, the
//! error stated beside the true one, the budget asked for beside the time taken.

mod coverage;
mod doubling;
mod fine;
mod picture;

use std::error::Error;
use std::time::Instant;

use clap::{Args, ValueEnum};
use dcd::physics::Measured as _;
use dcd::runtime::{LocalWorld, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::{Fidelity, FidelityReport, Viewpoint};
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::coverage::COVERAGE;
use self::doubling::DOUBLING;
use self::fine::FINE;
use crate::draw;
use crate::output::{Output, Shown};
use crate::page;
use crate::results::{Measured, short};

const SAVINGS: Shown<Row> = Shown { name: "fidelity", table: savings_table, picture: None };

/// Steps that are not timed, in which the governor comes to its levels and falling bodies come down.
const WARM_UP: usize = 120;

/// Measures the savings and the errors of fidelity.
#[derive(Args)]
pub(crate) struct Fidelities {
    #[command(flatten)]
    output: Output,
    /// Print one JSON object at the end.
    #[arg(long)]
    json: bool,
    /// Runs of each, each run with a seed of its own where the scene has one; of loads out of proportion the
    /// fastest counts.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// Measures one part; rows of the others stay in their files.
    #[arg(long, value_name = "PART")]
    only: Option<Part>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Part {
    /// Time saved beside error added.
    Savings,
    /// A budget in a world whose load doubles.
    Doubling,
    /// Errors stated beside true ones.
    Coverage,
    /// Loads out of proportion.
    Fine,
}

/// One setting on one scene, on one thread: means over the runs.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Row {
    scene: String,
    bodies: usize,
    regions: usize,
    setting: String,
    /// The time that a tick was to take, milliseconds, where a budget was asked for.
    budget_ms: Option<f64>,
    step_ms: f64,
    p99_ms: f64,
    /// The time over that of the same steps with all computed in full: the mean, the least and the most of
    /// all runs.
    share_percent: f64,
    least_share_percent: f64,
    most_share_percent: f64,
    /// The numbers of regions by how often they are stepped at the end of the first run, and the error stated
    /// then.
    full: usize,
    half: usize,
    quarter: usize,
    stated_m_s: f32,
    low95_m_s: f32,
    high95_m_s: f32,
    audits: u64,
    /// Ticks above the budget, percent of the timed ticks.
    overrun_percent: f64,
    /// Means over every tenth timed step.
    energy_j: f64,
    penetration_mm: f64,
    /// How far worlds in full, with as many seeds, are from their mean at most, in energy and in penetration.
    energy_spread_j: f64,
    penetration_spread_mm: f64,
}

/// A scene: its name, the parameter that says how large it is, the value of that, and whether it has a seed.
type Case = (&'static str, &'static str, usize, bool);

impl Fidelities {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let measures = |part| self.only.is_none_or(|only| only == part);
        let savings = self.output.fill(&SAVINGS, |rows| {
            if !measures(Part::Savings) {
                return Ok(());
            }
            let (steps, repeats) = if self.output.quick { (160, 1) } else { (360, self.repeats.into()) };
            let cases: &[Case] = if self.output.quick {
                &[("town", "n", 1_200, true)]
            } else {
                &[
                    ("town", "n", 2_000, true),
                    ("town", "n", 20_000, true),
                    ("terrain", "n", 4_000, true),
                    ("convoy", "cars", 200, false),
                ]
            };
            for &case in cases {
                savings(case, steps, repeats)?.into_iter().try_for_each(|row| rows.push(row))?;
            }
            Ok(())
        })?;
        let doubling = self.output.fill(&DOUBLING, |rows| {
            if !measures(Part::Doubling) {
                return Ok(());
            }
            let (case, ticks, repeats) = if self.output.quick {
                (("town", "n", 1_200, true), 90, 1)
            } else {
                (("town", "n", 2_000, true), 660, 3)
            };
            doubling::measure(case, ticks, repeats)?.into_iter().try_for_each(|row| rows.push(row))
        })?;
        let covers = self.output.fill(&COVERAGE, |rows| {
            if !measures(Part::Coverage) {
                return Ok(());
            }
            let seeds = if self.output.quick { 2 } else { 25 };
            coverage::measure(seeds)?.into_iter().try_for_each(|row| rows.push(row))
        })?;
        let fine = self.output.fill(&FINE, |rows| {
            if !measures(Part::Fine) {
                return Ok(());
            }
            let (ordinary, ticks, repeats) =
                if self.output.quick { (200, 90, 1) } else { (5_000, 600, self.repeats.into()) };
            fine::measure(ordinary, ticks, repeats)?.into_iter().try_for_each(|row| rows.push(row))
        })?;
        draw::write(&picture::picture(&savings, &covers), &self.output.folder()?.join(SAVINGS.name))?;
        let covers: Vec<_> = covers.iter().map(|cover| &cover.row).collect();
        let (runs, within) =
            covers.iter().fold((0, 0), |(runs, within), cover| (runs + cover.runs, within + cover.within));
        println!("{within} of {runs} runs");
        if self.json {
            let savings: Vec<_> = savings.iter().map(|row| &row.row).collect();
            let fine: Vec<_> = fine.iter().map(|row| &row.row).collect();
            let doubling: Vec<_> = doubling.iter().map(|row| &row.row).collect();
            let rows = json!({ "savings": savings, "doubling": doubling, "coverage": covers, "fine": fine, "within": within, "runs": runs });
            println!("{rows}");
        }
        Ok(())
    }
}

fn savings_table(rows: &[Measured<Row>]) -> String {
    let head = [
        "scene",
        "bodies",
        "setting",
        "budget, ms",
        "step, ms",
        "p99",
        "share, %",
        "regions at 1, 1/2, 1/4",
        "stated error, m/s (95 %)",
        "over budget, %",
        "energy, J",
        "penetration, mm",
        "spread of one world",
    ];
    page::table(&head, rows.iter().map(|row| row.row.cells()))
}

fn scene_of((name, key, count, has_seed): Case, seed: i64) -> Result<Scene, Box<dyn Error>> {
    let params = Params::new().with(key, count as i64);
    let params = if has_seed { params.with("seed", seed) } else { params };
    let mut scene = Scene::named(name, &params)?;
    if scene.viewpoints.is_empty() {
        // A quarter of the scene's length is looked at, from one end.
        let [min, max] = [scene.bounds.min, scene.bounds.max];
        scene.viewpoints = vec![Viewpoint { at: [min[0], 0.0, 0.0], radius_m: 0.25 * (max[0] - min[0]) }];
        scene.regions = Some(8);
    }
    Ok(scene)
}

fn world(scene: &Scene, fidelity: Fidelity) -> Result<LocalWorld, Box<dyn Error>> {
    Ok(LocalWorld::from_scene(scene, WorldConfig { fidelity, ..WorldConfig::for_scene(scene) })?)
}

/// A run of one setting.
struct Run {
    /// The milliseconds that each timed step took.
    took_ms: Vec<f64>,
    /// Means over every tenth timed step.
    energy_j: f64,
    penetration_m: f64,
    report: FidelityReport,
}

impl Run {
    fn mean_ms(&self) -> f64 {
        mean(self.took_ms.iter().copied())
    }

    fn p99_ms(&self) -> f64 {
        let mut sorted = self.took_ms.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() * 99 / 100]
    }

    /// Returns the share of steps that took longer than this setting allows, percent.
    fn overrun_percent(&self, fidelity: Fidelity) -> f64 {
        let Fidelity::Budget { tick_ms } = fidelity else { return 0.0 };
        let over = self.took_ms.iter().filter(|took_ms| **took_ms > f64::from(tick_ms));
        100.0 * over.count() as f64 / self.took_ms.len() as f64
    }
}

fn mean(of: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = of.len() as f64;
    of.sum::<f64>() / count
}

/// Returns the largest distance of a value from the mean of all.
fn spread(of: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let mean = mean(of.clone());
    of.fold(0.0, |most, value| f64::max(most, (value - mean).abs()))
}

/// Returns the median step of a run in full, milliseconds, of which budgets are a part.
fn full_step_ms(scene: &Scene) -> Result<f64, Box<dyn Error>> {
    let mut full = world(scene, Fidelity::Off)?;
    let mut took_ms = Vec::new();
    for step in 0..2 * WARM_UP {
        let start = Instant::now();
        full.step()?;
        if step >= WARM_UP {
            took_ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    took_ms.sort_by(f64::total_cmp);
    Ok(took_ms[took_ms.len() / 2])
}

/// Runs all settings of a scene in turn, step by step, and repeats that with another seed each time.
fn savings(case: Case, steps: usize, repeats: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let first = scene_of(case, 1)?;
    let full_ms = full_step_ms(&first)?;
    let budget = |part: f64| Fidelity::Budget { tick_ms: (full_ms * part) as f32 };
    let settings = [
        ("full", Fidelity::Off),
        ("auto", Fidelity::AUTO),
        ("lowest rate", Fidelity::Tolerance { m_s: 1e6 }),
        ("budget, 75 %", budget(0.75)),
        ("budget, 50 %", budget(0.5)),
    ];
    let mut runs: Vec<Vec<Run>> = settings.iter().map(|_| Vec::new()).collect();
    let mut scene_row = Row { scene: first.name.clone(), ..Row::default() };
    for seed in 1..=repeats {
        eprintln!("{} of {}, {seed} of {repeats}", first.name, case.2);
        let scene = scene_of(case, seed as i64)?;
        let mut worlds =
            settings.iter().map(|(_, fidelity)| world(&scene, *fidelity)).collect::<Result<Vec<_>, _>>()?;
        let mut took_ms = vec![Vec::new(); settings.len()];
        let mut looks = vec![Vec::new(); settings.len()];
        for step in 0..steps {
            for (i, world) in worlds.iter_mut().enumerate() {
                let start = Instant::now();
                world.step()?;
                let took = start.elapsed();
                if step >= WARM_UP {
                    took_ms[i].push(took.as_secs_f64() * 1e3);
                }
                if step >= WARM_UP && step % 10 == 0 {
                    looks[i].push((world.energy_j(), world.contacts().max_penetration_m));
                }
            }
        }
        for (((runs, world), took_ms), looks) in runs.iter_mut().zip(&worlds).zip(took_ms).zip(looks) {
            let report = world.fidelity_report().unwrap_or_default();
            let energy_j = mean(looks.iter().map(|(energy_j, _)| *energy_j));
            let penetration_m = mean(looks.iter().map(|(_, penetration_m)| *penetration_m));
            runs.push(Run { took_ms, energy_j, penetration_m, report });
        }
        (scene_row.bodies, scene_row.regions) = (worlds[0].stats().bodies, worlds[0].regions().len());
    }
    let row = |(runs_of, (setting, fidelity)): (&Vec<Run>, (&str, Fidelity))| Row {
        setting: setting.to_owned(),
        ..scene_row.clone().of(runs_of, &runs[0], fidelity)
    };
    Ok(runs.iter().zip(settings).map(row).collect())
}

impl Row {
    /// Takes in the runs of a setting, beside those of the same seeds in full.
    fn of(mut self, runs: &[Run], full: &[Run], fidelity: Fidelity) -> Self {
        self.step_ms = mean(runs.iter().map(Run::mean_ms));
        self.p99_ms = mean(runs.iter().map(Run::p99_ms));
        let shares = || runs.iter().zip(full).map(|(run, full)| 100.0 * run.mean_ms() / full.mean_ms());
        self.share_percent = mean(shares());
        self.least_share_percent = shares().fold(f64::INFINITY, f64::min);
        self.most_share_percent = shares().fold(0.0, f64::max);
        self.budget_ms = match fidelity {
            Fidelity::Budget { tick_ms } => Some(tick_ms.into()),
            _ => None,
        };
        self.overrun_percent = mean(runs.iter().map(|run| run.overrun_percent(fidelity)));
        self.energy_j = mean(runs.iter().map(|run| run.energy_j));
        self.penetration_mm = 1e3 * mean(runs.iter().map(|run| run.penetration_m));
        self.energy_spread_j = spread(full.iter().map(|run| run.energy_j));
        self.penetration_spread_mm = 1e3 * spread(full.iter().map(|run| run.penetration_m));
        let report = &runs[0].report;
        let levels = if report.levels == [0; 3] { [self.regions, 0, 0] } else { report.levels };
        [self.full, self.half, self.quarter] = levels;
        (self.stated_m_s, self.audits) = (report.error_m_s, report.audits);
        (self.low95_m_s, self.high95_m_s) = (report.low95_m_s, report.high95_m_s);
        self
    }

    fn cells(&self) -> Vec<String> {
        let stated = if self.audits == 0 {
            "–".to_owned()
        } else {
            format!(
                "{:.3} ({:.3} to {:.3}, {} audits)",
                self.stated_m_s, self.low95_m_s, self.high95_m_s, self.audits
            )
        };
        vec![
            self.scene.clone(),
            self.bodies.to_string(),
            self.setting.clone(),
            self.budget_ms.map_or("–".to_owned(), short),
            short(self.step_ms),
            short(self.p99_ms),
            if self.least_share_percent < self.most_share_percent {
                format!(
                    "{:.0} ({:.0} to {:.0})",
                    self.share_percent, self.least_share_percent, self.most_share_percent
                )
            } else {
                format!("{:.0}", self.share_percent)
            },
            format!("{}, {}, {}", self.full, self.half, self.quarter),
            stated,
            if self.setting.starts_with("budget") {
                format!("{:.1}", self.overrun_percent)
            } else {
                "–".to_owned()
            },
            short(self.energy_j),
            short(self.penetration_mm),
            format!("{} J, {} mm", short(self.energy_spread_j), short(self.penetration_spread_mm)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_of_the_same_seed_in_full() {
        let run = |step_ms: f64, energy_j| Run {
            took_ms: vec![0.5 * step_ms, 1.5 * step_ms],
            energy_j,
            penetration_m: 0.001,
            report: FidelityReport::default(),
        };
        let full = [run(10.0, 100.0), run(20.0, 108.0)];
        let row =
            Row::default().of(&[run(5.0, 90.0), run(20.0, 90.0)], &full, Fidelity::Budget { tick_ms: 8.0 });
        let shares = (row.share_percent, row.least_share_percent, row.most_share_percent);
        assert_eq!(shares, (75.0, 50.0, 100.0));
        assert_eq!((row.step_ms, row.p99_ms, row.overrun_percent), (12.5, 18.75, 50.0));
        assert_eq!((row.energy_j, row.energy_spread_j, row.penetration_mm), (90.0, 4.0, 1.0));
    }
}
