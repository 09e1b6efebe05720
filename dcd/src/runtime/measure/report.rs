//! Defines the report of a measured run: times, accuracy and consistency, as JSON.

use std::time::Duration;

use serde::Serialize;

use crate::fidelity::FidelityReport;

/// The number of steps at the start that are not timed: caches, pools and contacts are still being filled.
const WARM_UP: usize = 30;

/// The result of a run. As JSON it is the object that `dcd run --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The name of the scene.
    pub scene: String,
    /// The number of movable bodies of the scene.
    pub bodies: usize,
    /// The number of regions; 0 means one bare Rapier world.
    pub regions: usize,
    /// The number of threads that may step the world at a time.
    pub threads: usize,
    /// The name of the coupling; `None` for a bare world.
    pub coupling: Option<&'static str>,
    /// The number of exchanges per tick, with `auto` the most that it may take; 0 for a bare world.
    pub exchanges: usize,
    /// The mean number of exchanges per tick at the border that took most; 0 with one region.
    pub exchanges_mean: f64,
    /// The disagreement of the copies of a body in a tick at the worst border, summed over its exchanges,
    /// m/s; 0 with couplings without consensus.
    pub disagreement_m_s: MeanMax,
    /// The awake bodies of the busiest region, ghosts included, divided by the mean of all regions; 1 is
    /// perfect balance.
    pub imbalance: MeanMax,
    /// The number of ticks done.
    pub ticks: u64,
    /// Simulated seconds per tick.
    pub dt_s: f32,
    /// The wall time of all steps, seconds, without what was measured between them.
    pub wall_s: f64,
    /// The real-time factor: simulated seconds per second of `wall_s`.
    pub rtf: f64,
    /// The wall times of a step, milliseconds.
    pub step_ms: StepTimes,
    /// The number of pairs of colliders that touch at the end, each counted once.
    pub contacts: usize,
    /// The number of ghosts (copies of bodies in regions that do not own them), mean of all steps.
    pub ghosts_mean: f64,
    /// The number of changes of owner.
    pub transfers: u64,
    /// The kinetic and potential energy, joules.
    pub energy_j: StartEnd<f64>,
    /// The total momentum, kg m/s.
    pub momentum_kgms: StartEnd<[f64; 3]>,
    /// The deepest penetration of the last simulated second, metres.
    pub max_penetration_m: f64,
    /// The force on fixed bodies along gravity over the weight of all dynamic bodies, mean of the last
    /// simulated second; `None` without gravity.
    pub ground_force_ratio: Option<f64>,
    /// The number of bodies without an owner: the most at any check. Checks are made once per simulated
    /// second and at the end.
    pub lost: usize,
    /// The number of bodies with several owners, likewise.
    pub doubled: usize,
    /// The number of bodies that Rapier set aside during the run because their state was not finite.
    pub quarantined: usize,
    /// The hash of all movable bodies in id order, 16 hexadecimal digits.
    pub state_hash: String,
    /// How the world was computed, and the reason for that.
    pub chosen: Chosen,
    /// What is not computed in full, and the cost of that; `None` if all is computed in full.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fidelity: Option<FidelityShare>,
}

/// A [`FidelityReport`](crate::fidelity::FidelityReport) as numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FidelityShare {
    /// The time of regions' steps over the time that they would have taken at full rate, by the governor's
    /// estimate.
    pub share_of_full_time: f64,
    /// The mean error of a body's velocity after a step against a model four times as fine, m/s, by audits.
    pub error_stated_m_s: Stated,
    /// The number of audits so far.
    pub audits: u64,
    /// The number of ticks since the first second that took longer than the budget.
    pub overruns: u64,
    /// The number of regions that are stepped in every tick, in every second one and in every fourth one, at
    /// the end.
    pub levels: [usize; 3],
}

/// A mean with its 95 % confidence interval, which has no upper end before there are two samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stated {
    /// The mean of the samples.
    pub mean: f32,
    /// The lower end of the interval.
    pub low95: f32,
    /// The upper end of the interval.
    pub high95: Option<f32>,
}

#[cfg(feature = "cli")]
impl FidelityShare {
    /// Returns the share in words, on one line.
    pub(crate) fn words(&self) -> String {
        let [full, half, quarter] = self.levels;
        let Stated { mean, low95, high95 } = self.error_stated_m_s;
        let error = match high95 {
            Some(high95) => format!("mean error {mean:.3} m/s ({low95:.3} to {high95:.3})"),
            None => "no error known yet".to_owned(),
        };
        let overruns = match self.overruns {
            0 => String::new(),
            1 => ", 1 tick over the budget".to_owned(),
            ticks => format!(", {ticks} ticks over the budget"),
        };
        format!(
            "{full} regions in each tick, {half} in each second, {quarter} in each fourth: {:.0} % of the time of all in full, {error}{overruns}",
            100.0 * self.share_of_full_time
        )
    }
}

impl From<FidelityReport> for FidelityShare {
    fn from(report: FidelityReport) -> Self {
        Self {
            share_of_full_time: report.share_of_full_time,
            error_stated_m_s: Stated {
                mean: report.error_m_s,
                low95: report.low95_m_s,
                high95: report.high95_m_s.is_finite().then_some(report.high95_m_s),
            },
            audits: report.audits,
            overruns: report.overruns,
            levels: report.levels,
        }
    }
}

/// A [`Choice`](crate::runtime::Choice) as text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Chosen {
    /// The number of regions at the end; 0 means one bare Rapier world.
    pub regions: usize,
    /// The number of threads that may step the world at a time.
    pub threads: usize,
    /// The name of the coupling; `None` for a bare world.
    pub coupling: Option<&'static str>,
    /// The reason for the number of regions.
    pub why: String,
}

/// A quantity before the first step and after the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StartEnd<T> {
    /// Before the first step.
    pub start: T,
    /// After the last step.
    pub end: T,
}

/// The mean and maximum of a quantity over all ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeanMax {
    /// The arithmetic mean.
    pub mean: f64,
    /// The maximum.
    pub max: f64,
}

/// The wall times of steps in milliseconds, without the first 30; `None` if there were no more than these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StepTimes {
    /// The arithmetic mean.
    pub mean: Option<f64>,
    /// The median.
    pub p50: Option<f64>,
    /// The 99th percentile.
    pub p99: Option<f64>,
    /// The longest time.
    pub max: Option<f64>,
}

impl StepTimes {
    /// Returns the times of all steps of a run, given in order.
    pub fn of(steps: &[Duration]) -> Self {
        let mut ms: Vec<_> = steps.iter().skip(WARM_UP).map(|step| step.as_secs_f64() * 1e3).collect();
        ms.sort_by(f64::total_cmp);
        // The nearest rank, so that it is a time that was measured.
        let at = |share: f64| Some(*ms.get(((share * ms.len() as f64).ceil() as usize).saturating_sub(1))?);
        Self {
            mean: (!ms.is_empty()).then(|| ms.iter().sum::<f64>() / ms.len() as f64),
            p50: at(0.5),
            p99: at(0.99),
            max: ms.last().copied(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_thirty_steps_do_not_count() {
        let steps: Vec<_> =
            (1..=130).map(|i| Duration::from_millis(if i <= 30 { 9_000 } else { i - 30 })).collect();
        let times = StepTimes::of(&steps);
        let rounded = [times.mean, times.p50, times.p99, times.max].map(|v| v.unwrap().round());
        assert_eq!(rounded, [51.0, 50.0, 99.0, 100.0]);
        assert_eq!(StepTimes::of(&steps[..30]), StepTimes::default());
        assert_eq!(StepTimes::of(&steps[..31]).p50, StepTimes::of(&steps[..31]).max);
    }
}
