//! Measures what it saves, and what it costs, to compute less where nobody looks: time beside error, the error stated beside the true one,
//! the budget asked for beside the time taken.

mod coverage;
mod fine;
mod picture;

use std::error::Error;
use std::time::Instant;

use clap::Args;
use dcd::physics::Measured as _;
use dcd::runtime::{LocalWorld, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::{Fidelity, FidelityReport, Viewpoint};
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::coverage::COVERAGE;
use self::fine::FINE;
use crate::draw;
use crate::output::{Output, Shown};
use crate::page;
use crate::results::{Measured, short};

const SAVINGS: Shown<Row> = Shown { name: "fidelity", table: savings_table, picture: None };

/// Steps that are not timed: the governor comes to its levels, and what is to fall falls.
const WARM_UP: usize = 120;

/// Measures the savings and the errors of fidelity.
#[derive(Args)]
pub(crate) struct Fidelities {
    #[command(flatten)]
    output: Output,
    /// Print one JSON object at the end.
    #[arg(long)]
    json: bool,
    /// Runs of each; the one whose steps took least in the mean counts.
    #[arg(long, value_name = "N", default_value_t = 4)]
    repeats: usize,
    /// Only loads out of proportion; rows of the others stay in their files.
    #[arg(long)]
    fine: bool,
}

/// One setting on one scene, on one thread.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Row {
    scene: String,
    bodies: usize,
    regions: usize,
    setting: String,
    /// The time that a tick was to take, where one was asked for.
    budget_ms: Option<f64>,
    step_ms: f64,
    p99_ms: f64,
    /// Of what the same steps take when all is computed in full.
    share_percent: f64,
    full: usize,
    half: usize,
    quarter: usize,
    stated_m_s: f32,
    low95_m_s: f32,
    high95_m_s: f32,
    audits: u64,
    /// Ticks above the budget, percent of those that were timed.
    overrun_percent: f64,
    /// Means of the timed steps.
    energy_j: f64,
    penetration_mm: f64,
    /// Says how far two worlds in full, one of another seed, are from each other in both.
    energy_spread_j: f64,
    penetration_spread_mm: f64,
}

/// A scene: its name, what says how large it is, how large, and its seed where it has one.
type Case = (&'static str, &'static str, usize, bool);

impl Fidelities {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let savings = self.output.fill(&SAVINGS, |rows| {
            if self.fine {
                return Ok(());
            }
            let (steps, repeats) = if self.output.quick { (160, 1) } else { (360, self.repeats) };
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
        let covers = self.output.fill(&COVERAGE, |rows| {
            if self.fine {
                return Ok(());
            }
            let seeds = if self.output.quick { 2 } else { 25 };
            coverage::measure(seeds)?.into_iter().try_for_each(|row| rows.push(row))
        })?;
        let fine = self.output.fill(&FINE, |rows| {
            let (ordinary, ticks, repeats) =
                if self.output.quick { (200, 90, 1) } else { (5_000, 600, self.repeats) };
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
            let rows = json!({ "savings": savings, "coverage": covers, "fine": fine, "within": within, "runs": runs });
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
        // A quarter of its length is looked at, from one end.
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
    /// Milliseconds that each step took which was timed.
    took_ms: Vec<f64>,
    report: FidelityReport,
}

impl Run {
    fn mean_ms(&self) -> f64 {
        self.took_ms.iter().sum::<f64>() / self.took_ms.len() as f64
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

/// Returns the run that was disturbed least. Budgets follow the time that steps took, so that steps of several runs are of none.
fn best(runs: &[Run]) -> &Run {
    let least = runs.iter().min_by(|a, b| a.mean_ms().total_cmp(&b.mean_ms()));
    least.expect("each setting is run")
}

/// Returns the median step of a run in full, milliseconds: budgets need to know what the whole takes.
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

/// Runs all settings of a scene in turn, step by step.
fn savings(case: Case, steps: usize, repeats: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let scene = scene_of(case, 1)?;
    eprintln!("{} of {}", scene.name, case.2);
    let full_ms = full_step_ms(&scene)?;
    let budget = |part: f64| Fidelity::Budget { tick_ms: (full_ms * part) as f32 };
    let settings = [
        ("full", Fidelity::Off),
        ("auto", Fidelity::AUTO),
        ("lowest rate", Fidelity::Tolerance { m_s: 1e6 }),
        ("budget, 75 %", budget(0.75)),
        ("budget, 50 %", budget(0.5)),
    ];
    let mut runs: Vec<Vec<Run>> = settings.iter().map(|_| Vec::new()).collect();
    let mut rows = Vec::new();
    for repeat in 0..repeats {
        let mut worlds =
            settings.iter().map(|(_, fidelity)| world(&scene, *fidelity)).collect::<Result<Vec<_>, _>>()?;
        let mut means = vec![(0.0, 0.0); settings.len()];
        let mut took_ms = vec![Vec::new(); settings.len()];
        for step in 0..steps {
            for (i, world) in worlds.iter_mut().enumerate() {
                let start = Instant::now();
                world.step()?;
                let took = start.elapsed();
                if step >= WARM_UP {
                    took_ms[i].push(took.as_secs_f64() * 1e3);
                }
                if step >= WARM_UP && repeat == 0 && step % 10 == 0 {
                    means[i].0 += world.energy_j();
                    means[i].1 += world.contacts().max_penetration_m;
                }
            }
        }
        for ((runs, world), took_ms) in runs.iter_mut().zip(&worlds).zip(took_ms) {
            runs.push(Run { took_ms, report: world.fidelity_report().unwrap_or_default() });
        }
        if repeat > 0 {
            continue;
        }
        let samples = (WARM_UP..steps).filter(|step| step % 10 == 0).count() as f64;
        let twin = if case.3 { twin(case, steps)? } else { means[0] };
        for (i, world) in worlds.iter().enumerate() {
            rows.push(Row {
                scene: scene.name.clone(),
                bodies: world.stats().bodies,
                regions: world.regions().len(),
                setting: settings[i].0.to_owned(),
                energy_j: means[i].0 / samples,
                penetration_mm: 1e3 * means[i].1 / samples,
                energy_spread_j: (means[0].0 - twin.0).abs() / samples,
                penetration_spread_mm: 1e3 * (means[0].1 - twin.1).abs() / samples,
                ..Row::default()
            });
        }
    }
    let full_ms = best(&runs[0]).mean_ms();
    for ((row, runs), (_, fidelity)) in rows.iter_mut().zip(&runs).zip(settings) {
        row.set_run(best(runs), fidelity, full_ms);
    }
    Ok(rows)
}

/// Sums the energy and the penetration of the same scene of another seed, in full.
fn twin(case: Case, steps: usize) -> Result<(f64, f64), Box<dyn Error>> {
    let mut world = world(&scene_of(case, 2)?, Fidelity::Off)?;
    let mut sums = (0.0, 0.0);
    for step in 0..steps {
        world.step()?;
        if step >= WARM_UP && step % 10 == 0 {
            sums.0 += world.energy_j();
            sums.1 += world.contacts().max_penetration_m;
        }
    }
    Ok(sums)
}

impl Row {
    /// Takes in what one run took, and what it did by then.
    fn set_run(&mut self, run: &Run, fidelity: Fidelity, full_ms: f64) {
        let Run { report, .. } = run;
        (self.step_ms, self.p99_ms) = (run.mean_ms(), run.p99_ms());
        self.share_percent = 100.0 * self.step_ms / full_ms;
        self.budget_ms = match fidelity {
            Fidelity::Budget { tick_ms } => Some(tick_ms.into()),
            _ => None,
        };
        self.overrun_percent = run.overrun_percent(fidelity);
        let levels = if report.levels == [0; 3] { [self.regions, 0, 0] } else { report.levels };
        [self.full, self.half, self.quarter] = levels;
        (self.stated_m_s, self.audits) = (report.error_m_s, report.audits);
        (self.low95_m_s, self.high95_m_s) = (report.low95_m_s, report.high95_m_s);
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
            format!("{:.0}", self.share_percent),
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
    fn times_are_of_one_run_and_not_of_the_best_steps_of_several() {
        let run = |took_ms: &[f64]| Run { took_ms: took_ms.to_vec(), report: FidelityReport::default() };
        let runs = [run(&[1.0, 9.0]), run(&[9.0, 1.0]), run(&[9.0, 9.0])];
        assert_eq!((best(&runs).mean_ms(), best(&runs).p99_ms()), (5.0, 9.0));
        assert_eq!(best(&runs).overrun_percent(Fidelity::Budget { tick_ms: 5.0 }), 50.0);
    }
}
