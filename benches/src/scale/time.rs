//! Times the settings of a scene in turn, several times over; the fastest run of each counts.

use std::error::Error;

use dcd::physics::Measured as _;
use dcd::runtime::WorldConfig;
use dcd::runtime::measure::{Plan, Subject};
use dcd::scene::Scene;

use super::Progress;
use super::setting::Setting;
use crate::timing::{WARM_UP, cpu_ms, median_ms};

/// The time that a setting took.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timed {
    /// Milliseconds per step, median of the fastest run.
    pub(super) p50_ms: f64,
    /// Processor time of all threads, milliseconds per step, of the run that took least.
    pub(super) cpu_ms: f64,
    /// The number of regions at the end; 0: one Rapier world.
    pub(super) regions: usize,
}

/// Runs every setting once in each round, so that whatever else the machine does disturbs all alike.
pub(super) fn time(
    scene: &Scene,
    ticks: usize,
    settings: &[Setting],
    threads: usize,
    rounds: u16,
    progress: &Progress,
) -> Result<Vec<Timed>, Box<dyn Error>> {
    let mut best: Vec<Option<Timed>> = vec![None; settings.len()];
    for round in 1..=rounds {
        progress.tell(format_args!("times, round {round} of {rounds}"));
        for (setting, best) in settings.iter().zip(&mut best) {
            let timed = run(scene, ticks, setting.config(scene, threads), setting.threads(threads))?;
            *best = Some(best.map_or(timed, |best| best.least(timed)));
        }
    }
    Ok(best.into_iter().flatten().collect())
}

/// Runs a world once; a world without regions runs on so many threads by Rapier's `parallel`.
pub(super) fn run(
    scene: &Scene,
    ticks: usize,
    config: Option<WorldConfig>,
    threads: usize,
) -> Result<Timed, Box<dyn Error>> {
    let plan = Plan { config, ticks: ticks as u64 };
    let mut subject = plan.subject(scene)?;
    if let Subject::Bare(world) = &mut subject {
        world.configure_thread_pool(threads)?;
    }
    let before = cpu_ms();
    let p50_ms = median_ms(&mut subject, ticks.saturating_sub(WARM_UP).max(1))?;
    let cpu_ms = (cpu_ms() - before) / ticks as f64;
    let regions = if plan.config.is_none() { 0 } else { subject.views().len() };
    Ok(Timed { p50_ms, cpu_ms, regions })
}

impl Timed {
    pub(super) fn least(self, other: Self) -> Self {
        Self {
            p50_ms: self.p50_ms.min(other.p50_ms),
            cpu_ms: self.cpu_ms.min(other.cpu_ms),
            regions: other.regions,
        }
    }
}
