//! Measures the error of a case in any setup, against the run of one bare Rapier world.
//!
//! Other parts of this package measure single experiments with it:
//!
//! ```text
//! for case in (experiment.cases)(Size::Quick) {
//!     let reference = Reference::of(&case)?;
//!     let setup = Setup::Cut { regions: 4, adjust: &|config| config.step.exchanges = 2 };
//!     let reading = read(&case, &setup, &reference)?; // reading.error in case.unit, reading.step_ms, reading.rtf
//! }
//! ```
//!
//! The scenes of a case run on the threads of rayon's pool. Callers that time them install a pool of one
//! thread.

use dcd::rapier3d::prelude::*;
use dcd::runtime::WorldError;
use dcd::runtime::measure::StepTimes;
use dcd::scene::Scene;
use rayon::prelude::*;

use super::run::trace;
use super::scene::{Case, Measure};
use super::trace::Trace;
use super::world::{Bare, Setup};

/// The error that stands for one that is no number: bodies lost, or thrown to infinity.
pub(super) const BROKEN: f64 = 1e9;

/// The distance by which one body of a twin starts aside: the smallest step that f32 resolves at ten metres.
const NUDGE_M: f64 = 1e-6;

/// The result of one bare Rapier world with the scene's own settings (R1) for a case.
pub(crate) struct Reference {
    traces: Vec<Trace>,
    /// The mean and standard deviation of each figure; empty unless the case is chaotic.
    spreads: Vec<Spread>,
    /// R1's own reading.
    pub r1: Reading,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    mean: f64,
    deviation: f64,
}

/// The outcome of the runs of a case.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reading {
    /// The error, in the unit of the case.
    pub error: f64,
    /// The error of one bare world, with which the gate compares it.
    pub r1_error: f64,
    /// The largest error that always passes.
    pub threshold: f64,
    /// The largest |P − P₀| / Σ m|v| of the run; `None` unless momentum must stay.
    pub momentum_error: Option<f64>,
    /// |mean ground force / weight − 1| of the last second; `None` unless all rests on the ground then.
    pub ground_error: Option<f64>,
    /// Bodies without an owner at any look.
    pub lost: usize,
    /// Bodies with several owners at any look.
    pub doubled: usize,
    /// Bodies set aside because their state was not finite.
    pub quarantined: usize,
    /// Pairs of colliders that touch at the end.
    pub pairs: usize,
    /// Changes of owner.
    pub transfers: u64,
    /// Copies of bodies held by regions that do not own them, mean of all steps.
    pub ghosts_mean: f64,
    /// The wall time of a step, over all runs together.
    pub step_ms: StepTimes,
    /// Simulated seconds per second of wall time.
    pub rtf: f64,
}

impl Reference {
    /// Runs the bare world, and its twins where the case needs them.
    pub(crate) fn of(case: &Case) -> Result<Self, WorldError> {
        let of_reference = case.reference_scenes.as_ref().unwrap_or(&case.scenes);
        let bare = Setup::Bare(Bare::default());
        let traces = traces(case, of_reference, &bare)?;
        let twins = match &case.measure {
            Measure::Statistics(_) => Some(nudged_traces(case, &bare)?),
            Measure::Formula(_) => None,
        };
        let spreads = match (&case.measure, &twins) {
            (Measure::Statistics(figures), Some(twins)) => {
                let all: Vec<_> = traces.iter().chain(twins).map(figures).collect();
                (0..all[0].len()).map(|i| Spread::of(all.iter().map(|run| run[i].value))).collect()
            }
            _ => Vec::new(),
        };
        let own = match (case.reference_scenes.is_some(), twins) {
            (false, None) => None,
            (true, _) => Some(self::traces(case, &case.scenes, &bare)?),
            (false, twins) => twins,
        };
        let own = own.as_ref().unwrap_or(&traces);
        let mut outcome = outcome(case, own, &traces, &spreads);
        // One world's error is how far its runs are from each other.
        if !spreads.is_empty() {
            outcome.error = spreads.iter().map(|spread| spread.deviation).fold(0.0, f64::max);
            outcome.r1_error = Some(outcome.error);
        } else if case.early {
            outcome.error = spread_of_orders(case, &traces, &bare)?;
        }
        let r1 = Reading::new(case, own, outcome, outcome.error);
        Ok(Self { traces, spreads, r1 })
    }
}

/// Runs a case in any setup, and reads its error.
pub(crate) fn read(case: &Case, setup: &Setup<'_>, reference: &Reference) -> Result<Reading, WorldError> {
    let traces = traces(case, &case.scenes, setup)?;
    let outcome = outcome(case, &traces, &reference.traces, &reference.spreads);
    Ok(Reading::new(case, &traces, outcome, reference.r1.error))
}

fn traces(case: &Case, scenes: &[Scene], setup: &Setup<'_>) -> Result<Vec<Trace>, WorldError> {
    scenes.par_iter().map(|scene| trace(case, scene, setup)).collect()
}

fn nudged_traces(case: &Case, bare: &Setup<'_>) -> Result<Vec<Trace>, WorldError> {
    traces(case, &case.scenes.iter().map(nudged).collect::<Vec<_>>(), bare)
}

/// Returns the mean error of worlds in which the bodies are inserted in other orders.
fn spread_of_orders(case: &Case, r1: &[Trace], bare: &Setup<'_>) -> Result<f64, WorldError> {
    let Measure::Formula(formula) = &case.measure else { unreachable!("only formulas are early") };
    let bodies = case.scenes[0].bodies.len();
    let orders = [bodies - 1, bodies / 3, bodies / 5].map(|stride| order(bodies, stride));
    let errors = orders.iter().map(|order| {
        let scenes: Vec<_> = case.scenes.iter().map(|scene| reordered(scene, order)).collect();
        let mut own = traces(case, &scenes, bare)?;
        for look in own.iter_mut().flat_map(|trace| &mut trace.looks) {
            let mut bodies = vec![None; look.bodies.len()];
            order.iter().zip(&look.bodies).for_each(|(&body, state)| bodies[body] = *state);
            look.bodies = bodies;
        }
        Ok(worst(own.iter().zip(r1).map(|(own, r1)| formula(own, r1))))
    });
    let errors = errors.collect::<Result<Vec<_>, WorldError>>()?;
    Ok(errors.iter().sum::<f64>() / errors.len() as f64)
}

/// Returns all numbers below `count` once, each about `stride` after the one before, modulo `count`.
fn order(count: usize, stride: usize) -> Vec<usize> {
    let common_divisor = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let stride = (stride.max(1)..).find(|&stride| common_divisor(stride, count) == 1);
    let stride = stride.expect("there are primes beyond any number");
    (0..count).map(|i| i * stride % count).collect()
}

/// Returns the same scene with its bodies inserted in another order.
fn reordered(scene: &Scene, order: &[usize]) -> Scene {
    assert!(scene.joints.is_empty(), "joints name bodies by their order");
    let bodies = order.iter().map(|&body| scene.bodies[body].clone()).collect();
    Scene { bodies, ..scene.clone() }
}

/// The figures that the gate compares.
#[derive(Clone, Copy)]
struct Outcome {
    error: f64,
    /// The error of one world, where it is not that of its own reading.
    r1_error: Option<f64>,
    threshold: f64,
}

/// Returns the error of some runs; for statistics, that of the figure that is worst in relation to what is
/// allowed.
fn outcome(case: &Case, traces: &[Trace], r1: &[Trace], spreads: &[Spread]) -> Outcome {
    let threshold = case.threshold.unwrap_or(0.0);
    match &case.measure {
        Measure::Formula(formula) => {
            let error = worst(traces.iter().zip(r1).map(|(own, r1)| formula(own, r1)));
            Outcome { error, r1_error: None, threshold }
        }
        Measure::Statistics(figures) => {
            let runs: Vec<_> = traces.iter().map(figures).collect();
            let of_figure = |(i, spread): (usize, &Spread)| {
                let figure = runs[0][i];
                let mean = runs.iter().map(|run| run[i].value).sum::<f64>() / runs.len() as f64;
                let error = finite(figure.better.error(mean, spread.mean));
                let threshold = threshold.max(figure.within);
                Outcome { error, r1_error: Some(spread.deviation), threshold }
            };
            let badness = |outcome: &Outcome| {
                let deviation = outcome.r1_error.unwrap_or(0.0);
                outcome.error / (case.slack * deviation + case.floor).max(outcome.threshold)
            };
            spreads
                .iter()
                .enumerate()
                .map(of_figure)
                .max_by(|a, b| badness(a).total_cmp(&badness(b)))
                .expect("statistics have at least one figure")
        }
    }
}

impl Spread {
    /// Returns the mean and the sample standard deviation.
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / count;
        let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
        Self { mean, deviation: (squares / (count - 1.0)).sqrt() }
    }
}

impl Reading {
    fn new(case: &Case, traces: &[Trace], outcome: Outcome, r1_error: f64) -> Self {
        let most = |of: fn(&Trace) -> usize| traces.iter().map(of).max().unwrap_or(0);
        let steps: Vec<_> = traces.iter().flat_map(|trace| trace.steps.iter().copied()).collect();
        let wall_s: f64 = steps.iter().map(std::time::Duration::as_secs_f64).sum();
        let simulated_s: f64 = traces.iter().map(|trace| trace.last().t_s).sum();
        Self {
            error: finite(outcome.error),
            r1_error: outcome.r1_error.unwrap_or(r1_error),
            threshold: outcome.threshold,
            momentum_error: case.free.then(|| worst(traces.iter().map(|trace| trace.momentum_error))),
            ground_error: case.rests.then(|| worst(traces.iter().map(ground_error))),
            lost: most(|trace| trace.lost),
            doubled: most(|trace| trace.doubled),
            quarantined: most(|trace| trace.quarantined),
            pairs: most(|trace| trace.pairs),
            transfers: traces.iter().map(|trace| trace.transfers).max().unwrap_or(0),
            ghosts_mean: traces.iter().map(|trace| trace.ghosts_mean).sum::<f64>() / traces.len() as f64,
            step_ms: StepTimes::of(&steps),
            rtf: simulated_s / wall_s,
        }
    }
}

/// Returns the error, at most `BROKEN`, which also stands for an error that is no number.
pub(crate) fn finite(error: f64) -> f64 {
    if error.is_finite() { error.min(BROKEN) } else { BROKEN }
}

/// Returns the largest error; what is no number is worst.
pub(crate) fn worst(errors: impl Iterator<Item = f64>) -> f64 {
    errors.map(finite).fold(0.0, f64::max)
}

fn ground_error(trace: &Trace) -> f64 {
    let count = trace.ground_ratios.len();
    assert!(count > 0, "what rests on the ground has weight");
    (trace.ground_ratios.iter().sum::<f64>() / count as f64 - 1.0).abs()
}

/// Returns the same scene with one body moved a little aside.
fn nudged(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let dynamic: Vec<_> = (0..scene.bodies.len())
        .filter(|&index| scene.bodies[index].body.body_type == RigidBodyType::Dynamic)
        .collect();
    scene.bodies[dynamic[dynamic.len() / 2]].pose.translation[0] += NUDGE_M;
    scene
}

#[cfg(test)]
impl Reading {
    /// Returns a reading that has an error and nothing else, to be judged and reported.
    pub(crate) fn plain(error: f64, r1_error: f64) -> Self {
        Self {
            error,
            r1_error,
            threshold: 0.0,
            momentum_error: None,
            ground_error: None,
            lost: 0,
            doubled: 0,
            quarantined: 0,
            pairs: 0,
            transfers: 0,
            ghosts_mean: 0.0,
            step_ms: StepTimes::default(),
            rtf: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_is_the_worst_error() {
        assert_eq!(worst([0.5, f64::NAN, 0.1].into_iter()), BROKEN);
        assert_eq!(worst([0.5, f64::INFINITY].into_iter()), BROKEN);
        assert_eq!(worst([0.5, 0.7, 0.1].into_iter()), 0.7);
        assert_eq!(worst([].into_iter()), 0.0);
    }

    #[test]
    fn an_order_has_each_body_once_whatever_their_number() {
        for count in [1, 2, 12, 222, 1006] {
            for stride in [count - 1, count / 3, count / 5] {
                let mut order = order(count, stride);
                assert!(count < 12 || !order.is_sorted(), "{order:?}");
                order.sort_unstable();
                assert!(order.into_iter().eq(0..count), "{count} by {stride}");
            }
        }
    }

    #[test]
    fn a_figure_is_the_mean_and_the_sample_deviation() {
        let figure = Spread::of([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0].into_iter());
        assert_eq!(figure.mean, 5.0);
        assert!((figure.deviation - (32.0f64 / 7.0).sqrt()).abs() < 1e-12);
    }
}
