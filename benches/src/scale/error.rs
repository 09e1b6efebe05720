//! Measures the error of a setting: how far its statistics are from those of one bare world, in parts of what
//! that world's own runs differ by when their bodies start a micrometre aside.

use std::error::Error;

use dcd::rapier3d::prelude::RigidBodyType;
use dcd::runtime::WorldConfig;
use dcd::scene::Scene;
use dcd::space::mixed;
use rayon::prelude::*;

use super::case::Case;
use super::setting::Setting;
use super::statistic::{Statistic, Subject};
use crate::accuracy::{Bare, Figure, Setup, Trace, finite, trace};

/// The factor by which the spread of one world's own runs may be exceeded.
const SLACK: f64 = 1.1;

/// The unit of an error that is a number of bodies.
pub(super) const BROKEN: &str = "bodies lost, doubled or set aside";

/// The statistics of one bare world on a scene, over several seeds.
pub(super) struct Reference<'a> {
    case: &'a Case,
    seconds: f64,
    subject: Subject,
    spreads: Vec<Spread>,
}

/// The spread of one statistic over one world's own runs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    mean: f64,
    /// The distance from the least to the most.
    range: f64,
}

/// The statistic of a setting that is worst in relation to its gate.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) error: f64,
    pub(super) r1_spread: f64,
    pub(super) unit: &'static str,
    pub(super) gate: f64,
    /// The number of regions at the end.
    pub(super) regions: usize,
}

impl<'a> Reference<'a> {
    /// Runs the bare world once for each seed, on all threads.
    pub(super) fn of(case: &'a Case, scene: &Scene, small: bool, seeds: u64) -> Result<Self, Box<dyn Error>> {
        let (seconds, subject) = (case.size(small).seconds, Subject::new(scene.clone()));
        let runs = (1..=seeds)
            .into_par_iter()
            .map(|seed| {
                let run = case.for_accuracy(nudged(scene, seed), seconds);
                let trace =
                    trace(&run, &run.scenes[0], &Setup::Bare(Bare::default())).map_err(|e| e.to_string())?;
                Ok(figures(case, &subject, &trace).map(|(_, figure)| figure.value).collect::<Vec<f64>>())
            })
            .collect::<Result<Vec<Vec<f64>>, String>>()?;
        let spreads = (0..case.statistics.len()).map(|i| Spread::of(runs.iter().map(|run| run[i]))).collect();
        Ok(Self { case, seconds, subject, spreads })
    }

    /// Runs a setting once, with no body moved, and compares it with the bare world.
    pub(super) fn read(&self, setting: Setting, threads: usize) -> Result<Reading, Box<dyn Error>> {
        let case = self.case.for_accuracy(self.subject.scene.clone(), self.seconds);
        let scene = &case.scenes[0];
        let trace = match setting.config(scene, threads) {
            None => {
                let bare = Bare { threads: Some(setting.threads(threads)), ..Bare::default() };
                trace(&case, scene, &Setup::Bare(bare))?
            }
            Some(wanted) => {
                let adjust = move |config: &mut WorldConfig| *config = wanted.clone();
                trace(&case, scene, &Setup::Cut { regions: 1, adjust: &adjust })?
            }
        };
        let broken = trace.lost + trace.doubled + trace.quarantined;
        if broken > 0 {
            let (error, regions) = (broken as f64, trace.regions);
            return Ok(Reading { error, r1_spread: 0.0, unit: BROKEN, gate: 0.5, regions });
        }
        let readings = figures(self.case, &self.subject, &trace)
            .zip(&self.spreads)
            .map(|((statistic, figure), spread)| Reading::of(statistic, figure, spread, trace.regions));
        Ok(readings.max_by(|a, b| a.of_gate().total_cmp(&b.of_gate())).expect("a case has a statistic"))
    }
}

fn figures<'a>(
    case: &'a Case,
    subject: &'a Subject,
    run: &'a Trace,
) -> impl Iterator<Item = (Statistic, Figure)> + 'a {
    case.statistics.iter().map(|&statistic| (statistic, statistic.figure(run, subject)))
}

impl Reading {
    /// Returns the error in gates: 1 just passes.
    pub(super) fn of_gate(&self) -> f64 {
        self.error / self.gate
    }

    fn of(statistic: Statistic, figure: Figure, spread: &Spread, regions: usize) -> Self {
        Self {
            error: finite(figure.better.error(figure.value, spread.mean)),
            r1_spread: spread.range,
            unit: statistic.unit(),
            gate: SLACK * spread.range + figure.within,
            regions,
        }
    }
}

impl Spread {
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count() as f64;
        let (least, most) =
            values.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
                (least.min(value), most.max(value))
            });
        Self { mean: values.sum::<f64>() / count, range: most - least }
    }
}

/// Returns the same scene with every dynamic body up to a micrometre aside along each axis, differently for
/// each seed. Of bodies far from the origin only some move, as f32 resolves no micrometre beyond 16 m.
fn nudged(scene: &Scene, seed: u64) -> Scene {
    const NUDGE_M: f64 = 1e-6;
    let mut scene = scene.clone();
    let dynamic = scene.bodies.iter_mut().filter(|body| body.body.body_type == RigidBodyType::Dynamic);
    for (i, body) in (0u64..).zip(dynamic) {
        for (axis, place) in (0u64..).zip(&mut body.pose.translation) {
            let random = mixed(((seed << 40) | (i << 2) | axis).wrapping_add(0x9E37_79B9_7F4A_7C15)) >> 11;
            *place += NUDGE_M * (random as f64 / (1u64 << 52) as f64 - 1.0);
        }
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_move_all_dynamic_bodies_by_a_micrometre_at_most_and_each_otherwise() {
        let scene = Case::named("rubble").unwrap().scene(true).unwrap();
        let places =
            |scene: &Scene| scene.bodies.iter().map(|body| body.pose.translation).collect::<Vec<_>>();
        let [a, b] = [1, 2].map(|seed| places(&nudged(&scene, seed)));
        assert_eq!(a, places(&nudged(&scene, 1)));
        for ((start, a), b) in places(&scene).iter().zip(&a).zip(&b).skip(1) {
            assert!(a != start && a != b);
            assert!((0..3).all(|i| (a[i] - start[i]).abs() <= 1.001e-6));
        }
        assert_eq!(a[0], places(&scene)[0], "the floor stays");
    }

    #[test]
    fn an_error_is_the_distance_from_the_mean_of_one_worlds_runs_and_their_range_is_allowed() {
        let spread = Spread::of([1.0, 2.0, 6.0].into_iter());
        assert_eq!(spread, Spread { mean: 3.0, range: 5.0 });
        let figure = Figure { value: 9.0, better: crate::accuracy::Better::Nowhere, within: 0.5 };
        let reading = Reading::of(Statistic::MeanHeight, figure, &spread, 1);
        assert_eq!((reading.error, reading.r1_spread, reading.gate), (6.0, 5.0, 6.0));
        assert_eq!(reading.of_gate(), 1.0);
    }

    #[test]
    fn one_region_reads_what_one_world_reads_and_one_world_passes() {
        let case = Case::named("rubble").unwrap();
        let scene = case.scene(true).unwrap();
        let reference = Reference::of(case, &scene, true, 2).unwrap();
        let bare = reference.read(Setting::Bare, 1).unwrap();
        assert!(bare.of_gate() <= 1.0, "{bare:?}");
        assert_eq!(reference.read(Setting::Auto(1), 1).unwrap(), bare);
    }

    #[test]
    fn one_region_passes_where_it_wakes_sleepers_before_one_world_does() {
        let case = Case::named("domino_ring").unwrap();
        let scene = case.scene(true).unwrap();
        let reference = Reference::of(case, &scene, true, 2).unwrap();
        let one = reference.read(Setting::Auto(1), 1).unwrap();
        assert!(one.of_gate() <= 0.1, "{one:?}");
    }
}
