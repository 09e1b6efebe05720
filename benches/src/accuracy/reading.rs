//! The error of a case by any setup, against what one bare Rapier world makes of it.
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
//! The scenes of a case run on the threads of rayon's pool; whoever times them installs a pool of one thread.

use dcd::rapier3d::prelude::*;
use dcd::runtime::WorldError;
use dcd::runtime::measure::StepTimes;
use dcd::scene::Scene;
use rayon::prelude::*;

use super::scene::Case;
use super::trace::{Bare, Setup, Trace, trace};

/// What stands for an error that is no number: bodies lost, or thrown to infinity.
const BROKEN: f64 = 1e9;

/// How far aside one body of a twin starts: the least that f32 sees at ten metres.
const NUDGE_M: f64 = 1e-6;

/// What one bare Rapier world with the scene's own settings makes of a case (R1).
pub(crate) struct Reference {
    traces: Vec<Trace>,
    /// Its error; of a chaotic case, that of a twin against it.
    pub r1: Reading,
}

/// What came of a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reading {
    /// In the unit of the case.
    pub error: f64,
    /// |P − P₀| / Σ m|v|, largest of the run, if momentum must stay.
    pub momentum_error: Option<f64>,
    /// |mean ground force / weight − 1| of the last second, if all rests on the ground then.
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
    pub replicas_mean: f64,
    /// Wall time of a step, of all runs together.
    pub step_ms: StepTimes,
    /// Simulated seconds a second of wall time.
    pub rtf: f64,
}

impl Reference {
    /// Runs the bare world.
    pub(crate) fn of(case: &Case) -> Result<Self, WorldError> {
        let bare = Setup::Bare(Bare::default());
        let traces = traces(case, case.reference_scenes.as_ref().unwrap_or(&case.scenes), &bare)?;
        let twins = if case.chaotic {
            let nudged: Vec<_> = case.scenes.iter().map(nudged).collect();
            Some(self::traces(case, &nudged, &bare)?)
        } else if case.reference_scenes.is_some() {
            Some(self::traces(case, &case.scenes, &bare)?)
        } else {
            None
        };
        let r1 = reading(case, twins.as_ref().unwrap_or(&traces), &traces);
        Ok(Self { traces, r1 })
    }
}

/// Runs a case by any setup.
pub(crate) fn read(case: &Case, setup: &Setup<'_>, reference: &Reference) -> Result<Reading, WorldError> {
    Ok(reading(case, &traces(case, &case.scenes, setup)?, &reference.traces))
}

fn traces(case: &Case, scenes: &[Scene], setup: &Setup<'_>) -> Result<Vec<Trace>, WorldError> {
    scenes.par_iter().map(|scene| trace(case, scene, setup)).collect()
}

fn reading(case: &Case, traces: &[Trace], r1: &[Trace]) -> Reading {
    let error = (case.measure)(traces, r1);
    let most = |of: fn(&Trace) -> usize| traces.iter().map(of).max().unwrap_or(0);
    let steps: Vec<_> = traces.iter().flat_map(|trace| trace.steps.iter().copied()).collect();
    let wall_s: f64 = steps.iter().map(std::time::Duration::as_secs_f64).sum();
    let simulated_s: f64 = traces.iter().map(|trace| trace.last().t_s).sum();
    Reading {
        error: if error.is_finite() { error.min(BROKEN) } else { BROKEN },
        momentum_error: case.free.then(|| worst(traces.iter().map(|trace| trace.momentum_error))),
        ground_error: case.rests.then(|| worst(traces.iter().map(ground_error))),
        lost: most(|trace| trace.lost),
        doubled: most(|trace| trace.doubled),
        quarantined: most(|trace| trace.quarantined),
        pairs: most(|trace| trace.pairs),
        transfers: traces.iter().map(|trace| trace.transfers).max().unwrap_or(0),
        replicas_mean: traces.iter().map(|trace| trace.replicas_mean).sum::<f64>() / traces.len() as f64,
        step_ms: StepTimes::of(&steps),
        rtf: simulated_s / wall_s,
    }
}

/// The largest; what is no number is worst.
pub(crate) fn worst(errors: impl Iterator<Item = f64>) -> f64 {
    errors
        .fold(0.0, |most, error| if error.is_nan() || error > most { error.abs().min(BROKEN) } else { most })
}

fn ground_error(trace: &Trace) -> f64 {
    let count = trace.ground_ratios.len();
    assert!(count > 0, "what rests on the ground has weight");
    (trace.ground_ratios.iter().sum::<f64>() / count as f64 - 1.0).abs()
}

/// The same scene with one body a little aside.
fn nudged(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let dynamic: Vec<_> = (0..scene.bodies.len())
        .filter(|&index| scene.bodies[index].body.body_type == RigidBodyType::Dynamic)
        .collect();
    scene.bodies[dynamic[dynamic.len() / 2]].pose.translation[0] += NUDGE_M;
    scene
}
