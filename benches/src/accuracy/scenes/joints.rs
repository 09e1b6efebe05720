//! Joints across the border.

use dcd::scene::{Params, Scene};
use dcd::space::Axis;

use super::super::reading::worst;
use super::super::scene::{Case, Experiment, Size, planes};
use super::super::trace::{Trace, distance};

/// A chain of 16 links of 0.5 m and 1 kg with a bob of 1,000 kg, hanging down through the borders.
pub(super) const CHAIN: Experiment = Experiment {
    number: 15,
    name: "chain",
    metric: "hanging: distance of the bob from where inextensible links hold it; swinging: from where R1 has it; m",
    cases: chain,
    more_regions: &[],
    finer: true,
};

const LINKS: usize = 16;
/// Links, and half the bob.
const LENGTH_M: f64 = 8.3;

fn chain(size: Size) -> Vec<Case> {
    let scene = |ratio: u32, offset_m: f64| {
        let params =
            Params::new().with("links", LINKS).with("bob_mass_ratio", ratio).with("offset", offset_m);
        let mut scene = Scene::named("chain", &params).expect("the library has chains");
        scene.bodies.iter_mut().for_each(|body| body.body.can_sleep = false);
        scene
    };
    let stiff = |mut scene: Scene, iterations: usize| {
        scene.solver_iterations = iterations;
        scene
    };
    let extra = |mut scene: Scene, iterations: usize| {
        for body in &mut scene.bodies {
            body.body.additional_solver_iterations = iterations;
        }
        scene
    };
    let seconds = size.pick(3.0, 10.0);
    let hanging =
        |label: &str, scene: Scene| Case::new(label, scene, seconds, across(), |trace, _| stretch(trace));
    let swinging =
        Case::new("swinging, 16 iterations", stiff(scene(1000, 2.0), 16), 1.0, across(), |trace, r1| {
            let (own, r1) = (trace.last(), r1.last());
            worst(r1.moving().map(|body| distance(own.place(body), r1.place(body))))
        });
    vec![
        hanging("hanging, 4 iterations", scene(1000, 0.0)),
        hanging("hanging, 16 iterations", stiff(scene(1000, 0.0), 16)),
        hanging("hanging, 12 extra iterations", extra(scene(1000, 0.0), 12)),
        hanging("10:1 hanging, 4 iterations", scene(10, 0.0)),
        // COUPLING.md: chains within 40 mm of one world at 1 s.
        swinging.within(0.04),
    ]
}

fn across() -> impl Fn(usize) -> Vec<super::super::scene::Cut> {
    planes(Axis::Y, [-4.0, -2.0, -6.0, -8.0, -1.25, -3.0, -5.25])
}

/// How far the bob is from where it should hang, mean of the last second.
fn stretch(trace: &Trace) -> f64 {
    let (count, sum) = trace.tail(1.0).fold((0, 0.0), |(count, sum), look| {
        (count + 1, sum + distance(look.place(LINKS + 1), [0.0, -LENGTH_M, 0.0]))
    });
    sum / f64::from(count)
}
