//! Defines the experiments of SimBenchmark's 666: 6 x 6 x 6 balls that drop on a floor, elastic or not.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::Scene;
use dcd::space::{Axis, Bounds};

use super::super::scene::{Case, Experiment, Size, corner};
use super::super::trace::{Look, Trace, distance};

/// Frictionless elastic balls: energy must stay.
pub(super) const ELASTIC_666: Experiment = Experiment {
    number: 8,
    name: "elastic_666",
    metric: "root of the mean over time of (E / E₀ − 1)²",
    cases: elastic,
    more_regions: &[],
    finer: false,
};

/// The same balls without restitution.
pub(super) const BALLS_666: Experiment = Experiment {
    number: 9,
    name: "balls_666",
    metric: "mean over time of Σ penetration² over all pairs of balls and the floor, m²",
    cases: plastic,
    more_regions: &[],
    finer: false,
};

const EDGE: usize = 6;
const RADIUS_M: f64 = 0.1;
/// The distance from centre to centre.
const PITCH_M: f64 = 0.21;

fn elastic(size: Size) -> Vec<Case> {
    let mut scene = balls(1.1, 1.0);
    scene.dt_s = 1.0 / 960.0;
    let case =
        Case::new("dropped 1.1 m", scene, size.pick(1.0, 2.0), middle(1.1), |trace, _| energy_error(trace));
    vec![case.in_unit("", 1e-4).within(0.04)]
}

fn plastic(size: Size) -> Vec<Case> {
    let case = Case::new("dropped 0.2 m", balls(0.2, 0.0), size.pick(2.0, 4.0), middle(0.2), |trace, _| {
        trace.looks.iter().map(square_penetration_m2).sum::<f64>() / trace.looks.len() as f64
    });
    // The floor is a tenth of a millimetre in each of some hundred contacts.
    vec![case.in_unit("m²", 1e-6).within(1e-4)]
}

/// Builds columns of balls over a floor whose top is y = 0; the lowest balls fall by `drop_m`.
fn balls(drop_m: f64, restitution: f32) -> Scene {
    let mut scene = Scene::empty("balls");
    let friction = if restitution > 0.0 { 0.0 } else { 0.5 };
    let material = ColliderBuilder::ball(RADIUS_M as f32).restitution(restitution).friction(friction);
    scene.push_fixed_box([0.0, -1.0, 0.0], [20.0, 1.0, 20.0], &material);
    let ball = material.mass(10.0);
    let off = |i: usize| (i as f64 - 0.5 * (EDGE - 1) as f64) * PITCH_M;
    for i in 0..EDGE.pow(3) {
        let (x, y, z) = (off(i % EDGE), (i / EDGE.pow(2)) as f64 * PITCH_M, off(i / EDGE % EDGE));
        let place = WorldPose::at([x, drop_m + RADIUS_M + y, z]);
        scene.push(place, RigidBodyBuilder::dynamic().can_sleep(false), ball.clone());
    }
    scene.bounds = Bounds::new([-2.0, 0.0, -2.0], [2.0, 3.0, 2.0]);
    scene
}

/// Returns borders down between the middle columns, and across where the balls gather.
fn middle(drop_m: f64) -> impl Fn(usize) -> Vec<super::super::scene::Cut> {
    corner([Axis::X, Axis::Z, Axis::Y], [0.0, 0.25 + 0.2 * drop_m, 0.0])
}

fn energy_error(trace: &Trace) -> f64 {
    let start = trace.first().energy_j;
    let squares: f64 = trace.looks.iter().map(|look| (look.energy_j / start - 1.0).powi(2)).sum();
    (squares / trace.looks.len() as f64).sqrt()
}

fn square_penetration_m2(look: &Look) -> f64 {
    let places: Vec<_> = look.moving().map(|body| look.place(body)).collect();
    let floor = places.iter().map(|place| RADIUS_M - place[1]);
    let pairs = places
        .iter()
        .enumerate()
        .flat_map(|(i, a)| places[i + 1..].iter().map(|b| 2.0 * RADIUS_M - distance(*a, *b)));
    floor.chain(pairs).map(|depth_m| if depth_m.is_nan() { depth_m } else { depth_m.max(0.0).powi(2) }).sum()
}

#[cfg(test)]
mod tests {
    use dcd::protocol::Velocity;

    use super::*;

    #[test]
    fn penetration_counts_the_floor_and_each_pair_once() {
        let at = |x: f64, y: f64| Some((WorldPose::at([x, y, 0.0]), Velocity::default()));
        // The first ball lies 1 cm in the floor, the second 2 cm in the first, the third touches nothing.
        let look = Look { bodies: vec![None, at(0.0, 0.09), at(0.18, 0.1), at(9.0, 0.1)], ..Look::default() };
        let depth_m = 0.2 - (0.18f64.powi(2) + 0.01f64.powi(2)).sqrt();
        assert!((square_penetration_m2(&look) - (1e-4 + depth_m.powi(2))).abs() < 1e-12);
    }

    #[test]
    fn the_energy_error_is_a_root_mean_square() {
        let look = |energy_j| Look { energy_j, ..Look::default() };
        let trace = Trace { looks: vec![look(10.0), look(10.0), look(8.0), look(8.0)], ..Trace::default() };
        assert!((energy_error(&trace) - 0.02f64.sqrt()).abs() < 1e-12);
    }
}
