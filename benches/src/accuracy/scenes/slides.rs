//! Bodies that slide and roll over the border.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::Scene;
use dcd::space::{Axis, Bounds};

use super::super::scene::{Case, Experiment, Size, corner};

/// A ball that slides until it rolls: slipping ends right on the border.
pub(super) const SLIDE_TO_ROLL: Experiment = Experiment {
    number: 4,
    name: "slide_to_roll",
    metric: "|v − 5/7 v₀| after 2 s, m/s",
    cases: slide_to_roll,
    more_regions: &[],
    finer: true,
};

/// A floor whose top is y = 0.
fn push_floor(scene: &mut Scene, half_m: f32, friction: f32) {
    let material = ColliderBuilder::ball(1.0).friction(friction);
    scene.push_fixed_box([0.0, -1.0, 0.0], [half_m, 1.0, half_m], &material);
}

fn slide_to_roll(_: Size) -> Vec<Case> {
    const FRICTION: f32 = 0.2;
    const SPEED_M_S: f64 = 5.0;
    const RADIUS_M: f64 = 0.5;
    // v₀² (1 − 25/49) / (2 μ g)
    const ROLLS_AT_M: f64 = 3.061;
    let mut scene = Scene::empty("slide_to_roll");
    scene.gravity = [0.0, -10.0, 0.0];
    push_floor(&mut scene, 30.0, FRICTION);
    let body = RigidBodyBuilder::dynamic().linvel(Vector::new(SPEED_M_S as f32, 0.0, 0.0)).can_sleep(false);
    let ball = ColliderBuilder::ball(RADIUS_M as f32).friction(FRICTION).mass(1.0);
    scene.push(WorldPose::at([0.0, RADIUS_M, 0.0]), body, ball);
    scene.bounds = Bounds::new([-2.0, 0.0, -2.0], [12.0, 2.0, 2.0]);
    let corner = corner([Axis::X, Axis::Z, Axis::Y], [ROLLS_AT_M, RADIUS_M, 0.0]);
    let case = Case::new("μ 0.2", scene, 2.0, corner, |trace, _| {
        (trace.last().velocity(1)[0] - 5.0 / 7.0 * SPEED_M_S).abs()
    });
    vec![case.in_unit("m/s", 1e-4).within(0.01).resting()]
}
