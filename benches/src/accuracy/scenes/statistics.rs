//! Chaotic scenes: figures over several seeds instead of positions.

use dcd::scene::{Params, Scene};
use dcd::space::Axis;

use super::super::scene::{Case, Experiment, Measure, Size, corner};
use super::super::trace::{Trace, masses_kg, norm};

/// Boxes that fall into a heap.
pub(super) const PILE: Experiment = Experiment {
    number: 24,
    name: "pile",
    metric: "mean over seeds against R1's of: mean height, deepest penetration, mean v²/2g, all of the last second, m",
    cases: pile,
    more_regions: &[],
    finer: false,
};

/// Elastic balls without gravity in a closed box.
pub(super) const GAS: Experiment = Experiment {
    number: 25,
    name: "gas",
    metric: "mean over seeds against R1's of: E / E₀ at the end, |P| / Σ m|v| at the end",
    cases: gas,
    more_regions: &[],
    finer: false,
};

/// How many seeds.
fn seeds(size: Size) -> std::ops::RangeInclusive<u64> {
    1..=size.pick(3, 8)
}

fn pile(size: Size) -> Vec<Case> {
    let case = |boxes: usize, seconds: f64, seeds: std::ops::RangeInclusive<u64>| {
        let params = |seed| Params::new().with("n", boxes).with("seed", seed);
        let scenes: Vec<_> =
            seeds.map(|seed| Scene::named("heap", &params(seed)).expect("the library has heaps")).collect();
        // Through the settled heap, which is half as high as wide.
        let low_m = 0.2 * scenes[0].bounds.size()[0];
        let corner = corner([Axis::X, Axis::Z, Axis::Y], [0.0, low_m, 0.0]);
        let figures = Measure::Statistics(Box::new(heap_figures));
        Case { rests: true, ..Case::of(format!("{boxes} boxes"), scenes, seconds, corner, figures) }
    };
    match size {
        Size::Quick => vec![case(150, 5.0, seeds(size))],
        // Of ten thousand every mean is sharp; two seeds do, within the 25 mm of COUPLING.md.
        Size::Full => vec![case(1_000, 8.0, seeds(size)), case(10_000, 10.0, 1..=2).within(0.025)],
    }
}

/// Mean height, deepest penetration, and the height that the remaining motion could lift the boxes, in metres.
fn heap_figures(trace: &Trace) -> Vec<f64> {
    const GRAVITY_M_S2: f64 = 9.81;
    let mut sums = [0.0; 3];
    let mut looks = 0.0;
    for look in trace.tail(1.0) {
        let bodies: Vec<_> = look.moving().collect();
        let mean = |of: &dyn Fn(usize) -> f64| {
            bodies.iter().map(|&body| of(body)).sum::<f64>() / bodies.len() as f64
        };
        sums[0] += mean(&|body| look.place(body)[1]);
        sums[1] += look.penetration_m;
        sums[2] += mean(&|body| 0.5 * norm(look.velocity(body)).powi(2) / GRAVITY_M_S2);
        looks += 1.0;
    }
    sums.map(|sum| sum / looks).into()
}

fn gas(size: Size) -> Vec<Case> {
    let balls = size.pick(216, 512);
    let scenes: Vec<_> = seeds(size)
        .map(|seed| {
            let params = Params::new().with("n", balls).with("seed", seed);
            Scene::named("gas", &params).expect("the library has gases")
        })
        .collect();
    let masses = masses_kg(&scenes[0]);
    let figures = Measure::Statistics(Box::new(move |trace| gas_figures(trace, &masses)));
    let corner = corner(Axis::ALL, [0.0; 3]);
    vec![Case::of(format!("{balls} balls"), scenes, size.pick(5.0, 10.0), corner, figures).in_unit("", 1e-4)]
}

/// Energy left, and the net momentum as a share of all that moves; the walls take and give momentum.
fn gas_figures(trace: &Trace, masses_kg: &[f64]) -> Vec<f64> {
    let last = trace.last();
    let (mut net, mut all) = ([0.0; 3], 0.0);
    for body in last.moving() {
        let momentum = last.velocity(body).map(|v| masses_kg[body] * v);
        (0..3).for_each(|i| net[i] += momentum[i]);
        all += norm(momentum);
    }
    vec![last.energy_j / trace.first().energy_j, norm(net) / all]
}
