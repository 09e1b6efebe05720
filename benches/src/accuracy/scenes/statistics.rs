//! Defines the experiments of chaotic scenes, judged by figures over several seeds instead of positions.

use dcd::scene::{Params, Scene};
use dcd::space::Axis;

use super::super::scene::{Better, Case, Cut, Experiment, Figure, Measure, Size, corner};
use super::super::trace::{Trace, distance, masses_kg, norm};

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

/// waLBerla's test of equivalence: 1,000 falling spheres by 1, 8 and 64 regions.
pub(super) const SPHERES_1000: Experiment = Experiment {
    number: 23,
    name: "spheres_1000",
    metric: "0.5 s: root mean square distance from R1, m; later, mean over seeds against R1's: mean height, v²/2g, m",
    cases: spheres,
    more_regions: &[64],
    finer: false,
};

/// The seeds of a chaotic case. The mean of eight runs is off by chance by more than the gate allows in one
/// of 300 cases; that of three runs was in one of twenty.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=8;
/// The seeds of a gas, whose second figure is the net momentum: of eight runs its spread, by which it is judged, is off
/// by chance by a third.
const GAS_SEEDS: std::ops::RangeInclusive<u64> = 1..=16;

fn pile(size: Size) -> Vec<Case> {
    let case = |boxes: usize, seconds: f64, seeds: std::ops::RangeInclusive<u64>| {
        let params = |seed| Params::new().with("n", boxes).with("seed", seed);
        let scenes: Vec<_> =
            seeds.map(|seed| Scene::named("heap", &params(seed)).expect("the library has heaps")).collect();
        // Borders through the settled heap, which is half as high as wide.
        let low_m = 0.2 * scenes[0].bounds.size()[0];
        let corner = corner([Axis::X, Axis::Z, Axis::Y], [0.0, low_m, 0.0]);
        let figures = Measure::Statistics(Box::new(|trace| heap_figures(trace).into()));
        Case { rests: true, ..Case::of(format!("{boxes} boxes"), scenes, seconds, corner, figures) }
    };
    match size {
        Size::Quick => vec![case(150, 5.0, SEEDS)],
        // With ten thousand boxes every mean is sharp: two seeds suffice.
        Size::Full => vec![case(1_000, 8.0, SEEDS), case(10_000, 10.0, 1..=2)],
    }
}

/// Returns the mean height, the deepest penetration, and the height to which the remaining motion could lift
/// the boxes, in metres. A heap may lie 25 mm higher or lower in the mean: how boxes of 1 m come to lie is
/// chance.
fn heap_figures(trace: &Trace) -> [Figure; 3] {
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
    let [height, penetration, motion] = sums.map(|sum| sum / looks);
    [
        Figure { value: height, better: Better::Nowhere, within: 0.025 },
        Figure { value: penetration, better: Better::Less, within: 0.0 },
        Figure { value: motion, better: Better::Less, within: 0.0 },
    ]
}

fn spheres(size: Size) -> Vec<Case> {
    let spheres = size.pick(216, 1000);
    let scene = |seed| {
        let params = Params::new().with("n", spheres).with("seed", seed).with("fill", 0.1);
        let mut scene = Scene::named("gas", &params).expect("the library has gases");
        scene.name = "spheres_1000".to_owned();
        scene.gravity = [0.0, -9.81, 0.0];
        for collider in scene.bodies.iter_mut().flat_map(|body| &mut body.colliders) {
            *collider = collider.clone().restitution(0.3).friction(0.4);
        }
        scene
    };
    let edge_m = scene(1).bounds.size()[0];
    let cuts = move |regions: usize| -> Vec<Cut> {
        let middle = Axis::ALL.map(|axis| (axis, 0.0));
        match regions {
            64 => Axis::ALL
                .into_iter()
                .flat_map(|axis| [0.0, -0.25, 0.25].map(|part| (axis, part * edge_m)))
                .collect(),
            _ => middle[..regions.ilog2() as usize].to_vec(),
        }
    };
    let early = Case::new("0.5 s", scene(1), 0.5, cuts, |trace, r1| {
        let (own, r1) = (trace.last(), r1.last());
        let squares: f64 = r1.moving().map(|body| distance(own.place(body), r1.place(body)).powi(2)).sum();
        (squares / r1.moving().count() as f64).sqrt()
    });
    let figures = Measure::Statistics(Box::new(|trace| {
        let [height, _, motion] = heap_figures(trace);
        vec![height, motion]
    }));
    let late_s = size.pick(4.0, 5.0);
    let late = Case::of(format!("{late_s} s"), SEEDS.map(scene).collect(), late_s, cuts, figures);
    vec![Case { early: true, ..early }, Case { rests: true, ..late }]
}

fn gas(size: Size) -> Vec<Case> {
    let balls = size.pick(216, 512);
    let scenes: Vec<_> = GAS_SEEDS
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

/// Returns the energy left, and the net momentum as a share of the momentum of all that moves; the walls take
/// and give momentum.
fn gas_figures(trace: &Trace, masses_kg: &[f64]) -> Vec<Figure> {
    let last = trace.last();
    let (mut net, mut all) = ([0.0; 3], 0.0);
    for body in last.moving() {
        let momentum = last.velocity(body).map(|v| masses_kg[body] * v);
        (0..3).for_each(|i| net[i] += momentum[i]);
        all += norm(momentum);
    }
    vec![
        // One world loses a quarter of its energy; a run that loses less is right.
        Figure { value: last.energy_j / trace.first().energy_j, better: Better::Towards(1.0), within: 0.0 },
        Figure { value: norm(net) / all, better: Better::Nowhere, within: 0.0 },
    ]
}
