//! Defines the experiments on ownership: bodies that are handed over every step, that stay on a border
//! without flapping, or that reach across all regions.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, Bounds};

use super::super::reading::worst;
use super::super::scene::{Case, Cut, Experiment, Size, corner, planes};
use super::super::trace::distance;

/// A tower of 100:1 that rides on a platform through borders that lie one step's travel apart, so that all of
/// it changes owner every step.
pub(super) const HANDOVER: Experiment = Experiment {
    number: 19,
    name: "handover",
    metric: "largest speed of a box against the platform from half a second before the first border on, m/s",
    cases: handover,
    more_regions: &[],
    finer: false,
};

/// A ball that swings by 1 cm about the border.
pub(super) const PING_PONG: Experiment = Experiment {
    number: 20,
    name: "ping_pong",
    metric: "changes of owner a simulated second",
    cases: ping_pong,
    more_regions: &[],
    finer: false,
};

/// A slab that lies across all regions, and a pebble on its corner.
pub(super) const GIANT: Experiment = Experiment {
    number: 21,
    name: "giant",
    metric: "displacement of slab and pebble, mean of the last second, m; three pairs touch: slab and floor once, pebble once",
    cases: giant,
    more_regions: &[],
    finer: false,
};

fn handover(size: Size) -> Vec<Case> {
    const SPEED_M_S: f64 = 6.0;
    const SETTLED_S: f64 = 3.0;
    let params = Params::new().with("top_mass_ratio", 100).with("sleep", 0);
    let mut scene = Scene::named("tower", &params).expect("the library has towers");
    let speed = Vector::new(SPEED_M_S as f32, 0.0, 0.0);
    for body in &mut scene.bodies {
        body.body = body.body.clone().linvel(speed);
    }
    // The floor of the tower, 41 m long, moves along.
    let floor = &mut scene.bodies[0].body;
    floor.body_type = RigidBodyType::KinematicVelocityBased;
    let step_m = SPEED_M_S / 60.0;
    let seconds = size.pick(4.5, 8.0);
    scene.bounds = Bounds::new([-2.0, -1.0, -2.0], [SPEED_M_S * seconds, 11.0, 2.0]);
    // Seven borders within seven steps, after the tower has settled.
    let borders: Vec<_> = (0..7).map(|i| SETTLED_S * SPEED_M_S + f64::from(i) * step_m).collect();
    let case =
        Case::new("100:1 at 6 m/s", scene, seconds, planes(Axis::X, borders), move |trace, _| {
            worst(trace.looks.iter().filter(|look| look.t_s > SETTLED_S - 0.5).flat_map(|look| {
                look.moving().map(|body| distance(look.velocity(body), [SPEED_M_S, 0.0, 0.0]))
            }))
        });
    vec![case.every_step().in_unit("m/s", 1e-3)]
}

fn ping_pong(size: Size) -> Vec<Case> {
    const SWING_M: f64 = 0.01;
    const RADIANS_S: f64 = std::f64::consts::TAU * 2.0;
    let mut scene = Scene::empty("ping_pong");
    scene.gravity = [0.0; 3];
    let ball = ColliderBuilder::ball(0.5);
    scene.push(WorldPose::default(), RigidBodyBuilder::dynamic().can_sleep(false), ball);
    scene.bounds = Bounds::around([0.0; 3], [5.0; 3]);
    let corner = corner(Axis::ALL, [0.0; 3]);
    let case = Case::new("1 cm at 2 Hz", scene, size.pick(5.0, 20.0), corner, |trace, _| {
        trace.transfers as f64 / trace.last().t_s
    });
    let driven = case.driven(|world, t_s| {
        let speed = SWING_M * RADIANS_S * (RADIANS_S * t_s).cos();
        world.change(0, |body| body.set_linvel(Vector::splat(speed as f32), true));
    });
    vec![driven.in_unit("1/s", 0.0).within(1.0)]
}

fn giant(size: Size) -> Vec<Case> {
    let mut scene = Scene::empty("giant");
    let material = ColliderBuilder::ball(1.0);
    scene.push_fixed_box([0.0, -1.0, 0.0], [60.0, 1.0, 60.0], &material);
    let dynamic = || RigidBodyBuilder::dynamic().can_sleep(false);
    scene.push(WorldPose::at([0.0, 0.5, 0.0]), dynamic(), ColliderBuilder::cuboid(20.0, 0.5, 6.0));
    scene.push(WorldPose::at([19.5, 1.2, 5.5]), dynamic(), ColliderBuilder::cuboid(0.2, 0.2, 0.2));
    scene.push(WorldPose::at([-19.5, 1.2, -5.5]), dynamic(), ColliderBuilder::ball(0.2));
    scene.bounds = Bounds::new([-25.0, -1.0, -10.0], [25.0, 5.0, 10.0]);
    let borders = |regions: usize| -> Vec<Cut> {
        match regions {
            2 => vec![(Axis::X, 0.0)],
            4 => vec![(Axis::X, 0.0), (Axis::X, -10.0), (Axis::X, 10.0)],
            _ => vec![(Axis::X, 0.0), (Axis::X, -10.0), (Axis::X, 10.0), (Axis::Z, 0.0)],
        }
    };
    let case = Case::new("slab of 40 m", scene, size.pick(5.0, 20.0), borders, |trace, _| {
        super::stacks::displacement(trace)
    });
    // All must rest within a millimetre.
    vec![Case { pairs: Some(3), ..case.resting().within(1e-3) }]
}
