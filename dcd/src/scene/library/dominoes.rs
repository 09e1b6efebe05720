//! Builds dominoes in a ring.

use std::f64::consts::{FRAC_PI_4, TAU};

use rapier3d::prelude::*;

use super::{SLEEP, SceneInfo, count, number};
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError};
use crate::space::Bounds;

pub(super) const DOMINO_RING: SceneInfo = SceneInfo {
    name: "domino_ring",
    summary: "a ring of dominoes through the corner where four regions meet, pushed at one place or several",
    params: &[
        count("n", "200", 8, 1_000_000, "dominoes of 0.16 x 1.2 x 0.6 m, 0.6 m apart"),
        count("starts", "1", 1, 10_000, "how many are pushed, at equal distances; at most every fourth"),
        number("push", "1.5", [0.0, 10.0], "rad/s", "how fast these fall at the start"),
        SLEEP,
    ],
    build: domino_ring,
};

/// Half the size of a domino: along the ring, upright, across.
const HALF_M: [f32; 3] = [0.08, 0.6, 0.3];
const APART_M: f64 = 0.6;

fn domino_ring(values: &Values) -> Result<Scene, SceneError> {
    let (n, starts) = (values.count("n"), values.count("starts"));
    if 4 * starts > n {
        return Err(values.refuse("starts", &format!("at most a quarter of the {n} dominoes")));
    }
    let radius_m = n as f64 * APART_M / TAU;
    // The ring touches the origin from one side, aslant to both axes.
    let middle_m = radius_m * FRAC_PI_4.cos();
    let half_m = middle_m + radius_m + 1.0;
    let mut scene = Scene::empty("domino_ring");
    let floor_m = half_m as f32 + 5.0;
    let stone = ColliderBuilder::ball(1.0).friction(0.8);
    scene.push_fixed_box([0.0, -1.0, 0.0], [floor_m, 1.0, floor_m], &stone);
    let domino = ColliderBuilder::cuboid(HALF_M[0], HALF_M[1], HALF_M[2]).friction(0.3);
    for i in 0..n {
        let angle = TAU * i as f64 / n as f64;
        let (sin, cos) = angle.sin_cos();
        let place = [middle_m + radius_m * cos, f64::from(HALF_M[1]), middle_m + radius_m * sin];
        // The domino's own x axis points along the ring.
        let turn = Rotation::from_rotation_y((-cos).atan2(-sin) as f32);
        let mut body = RigidBodyBuilder::dynamic();
        if (i + 1) * starts / n > i * starts / n {
            // The domino turns about its foot.
            let rate = values.number("push");
            body = body.angvel(turn * Vector::Z * -rate).linvel(turn * Vector::X * (rate * HALF_M[1]));
        }
        scene.push(world_pose(place, turn), body, domino.clone());
    }
    scene.bounds = Bounds::new([-half_m, 0.0, -half_m], [half_m, 2.0 * f64::from(HALF_M[1]), half_m]);
    Ok(scene)
}
