//! Builds scenes with kinematic bodies that move others: boxes on belts, balls in a turning drum, cubes
//! before an arm that sweeps.

use std::f64::consts::PI;

use rapier3d::prelude::*;

use super::{MOST, SEED, SLEEP, SceneInfo, count, number};
use crate::protocol::WorldPose;
use crate::scene::dice::Dice;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneBody, SceneError};
use crate::space::Bounds;

pub(super) const CONVEYOR: SceneInfo = SceneInfo {
    name: "conveyor",
    summary: "stacks of three unit boxes on kinematic belts that carry them along x, every other one the other way",
    params: &[
        count("n", "240", 1, MOST, "boxes"),
        count("belts", "8", 1, 1_000, "belts beside one another"),
        number("speed", "2", [0.0, 20.0], "m/s", "speed of the belts, and of the boxes at the start"),
        SLEEP,
    ],
    build: conveyor,
};

pub(super) const DRUM: SceneInfo = SceneInfo {
    name: "drum",
    summary: "balls tumbling in a turning drum: one kinematic body of 24 plates, 4 blades and 2 lids, its axis along z",
    params: &[
        count("n", "300", 1, MOST, "balls of radius 0.25 m"),
        number("speed", "0.6", [0.0, 10.0], "rad/s", "of the drum"),
        SLEEP,
        SEED,
    ],
    build: drum,
};

pub(super) const SWEEP: SceneInfo = SceneInfo {
    name: "sweep",
    summary: "cubes of 0.4 m that lie on a plane, and a kinematic arm that turns about the middle and pushes them aside",
    params: &[
        count("n", "900", 1, MOST, "cubes, in a square grid of 1 m"),
        number(
            "reach",
            "6",
            [0.5, 1_000.0],
            "m",
            "half the length of the arm: it touches the cubes within, about pi reach^2 of them, in half a turn",
        ),
        number("speed", "0.25", [0.0, 10.0], "rad/s", "of the arm"),
        SLEEP,
    ],
    build: sweep,
};

fn conveyor(values: &Values) -> Result<Scene, SceneError> {
    const STACK: usize = 3;
    const PITCH_M: f64 = 1.5;
    let (n, belts, speed) = (values.count("n"), values.count("belts"), values.number("speed"));
    let columns = n.div_ceil(STACK).div_ceil(belts);
    let half_x = 0.5 * columns as f64 * PITCH_M;
    let half_z = 0.5 * belts as f64 * PITCH_M;
    let along = |k: usize, half: f64| (k as f64 + 0.5) * PITCH_M - half;
    let velocity = |belt: usize| Vector::X * if belt.is_multiple_of(2) { speed } else { -speed };
    let mut scene = Scene::empty("conveyor");
    for belt in 0..belts {
        let body = RigidBodyBuilder::kinematic_velocity_based().linvel(velocity(belt));
        let plate = ColliderBuilder::cuboid(half_x as f32 + 2.0, 0.25, 0.7).friction(0.8);
        scene.push(WorldPose::at([0.0, -0.25, along(belt, half_z)]), body, plate);
    }
    let unit = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
    for i in 0..n {
        let (stack, level) = (i / STACK, i % STACK);
        // Stacks go to one belt after the other, so that only the ends of the last belts lack boxes.
        let place = [along(stack / belts, half_x), level as f64 + 0.5, along(stack % belts, half_z)];
        // Boxes that start at rest would topple.
        let body = RigidBodyBuilder::dynamic().linvel(velocity(stack % belts));
        scene.push(WorldPose::at(place), body, unit.clone());
    }
    scene.bounds = Bounds::new([-half_x, 0.0, -half_z], [half_x, STACK as f64, half_z]);
    Ok(scene)
}

fn drum(values: &Values) -> Result<Scene, SceneError> {
    const RADIUS_M: f64 = 0.25;
    const PITCH_M: f64 = 0.6;
    let n = values.count("n");
    // The drum is as long as wide. In a grid within its blades the balls fill a third of it.
    let (radius_m, places) = (4..)
        .map(|halves| 0.5 * f64::from(halves))
        .map(|radius_m| {
            (radius_m, grid_in_cylinder(0.75 * radius_m - RADIUS_M, radius_m - 0.5 * PITCH_M, PITCH_M))
        })
        .find(|(_, places)| places.len() >= n)
        .expect("a drum is large enough");
    let mut scene = Scene::empty("drum");
    let turning = RigidBodyBuilder::kinematic_velocity_based().angvel(Vector::Z * values.number("speed"));
    scene.bodies.push(SceneBody {
        pose: WorldPose::default(),
        body: turning,
        colliders: shell(radius_m as f32),
    });
    let mut dice = Dice::new(values.seed("seed"));
    let ball = ColliderBuilder::ball(RADIUS_M as f32);
    for place in places.into_iter().take(n) {
        let aside = dice.in_cube(0.5 * (PITCH_M - 2.0 * RADIUS_M) as f32).to_array();
        let place = std::array::from_fn(|i| place[i] + f64::from(aside[i]));
        scene.push(WorldPose::at(place), RigidBodyBuilder::dynamic(), ball.clone());
    }
    scene.bounds = Bounds::around([0.0; 3], [radius_m; 3]);
    Ok(scene)
}

fn sweep(values: &Values) -> Result<Scene, SceneError> {
    const PITCH_M: f64 = 1.0;
    const HALF_M: f32 = 0.2;
    const HALF_HIGH_M: f32 = 0.5;
    let (n, reach_m) = (values.count("n"), values.number("reach"));
    let side = (1..).find(|side| side * side >= n).expect("a square is large enough");
    let half_m = 0.5 * side as f64 * PITCH_M;
    let along = |k: usize| (k as f64 + 0.5) * PITCH_M - half_m;
    // Pushed cubes end up outside the grid, on the plane.
    let plane_half_m = 2.0 * half_m.max(f64::from(reach_m)) + 10.0;
    let mut scene = Scene::empty("sweep");
    let plane_half = [plane_half_m as f32, 0.5, plane_half_m as f32];
    scene.push_fixed_box([0.0, -0.5, 0.0], plane_half, &ColliderBuilder::ball(1.0));
    let cube = ColliderBuilder::cuboid(HALF_M, HALF_M, HALF_M);
    for i in 0..n {
        let place = [along(i % side), f64::from(HALF_M), along(i / side)];
        scene.push(WorldPose::at(place), RigidBodyBuilder::dynamic(), cube.clone());
    }
    // The arm turns clear of the plane, and begins between two rows.
    let between = if side.is_multiple_of(2) { 0.0 } else { 0.5 * PITCH_M };
    let turning = RigidBodyBuilder::kinematic_velocity_based().angvel(Vector::Y * values.number("speed"));
    let arm = ColliderBuilder::cuboid(reach_m, HALF_HIGH_M, HALF_M);
    scene.push(WorldPose::at([0.0, f64::from(HALF_HIGH_M) + 0.1, between]), turning, arm);
    scene.bounds = Bounds::new([-half_m - 2.0, 0.0, -half_m - 2.0], [half_m + 2.0, 4.0, half_m + 2.0]);
    Ok(scene)
}

/// Returns the points of a grid within a cylinder along z, from the lowest to the highest.
pub(super) fn grid_in_cylinder(radius_m: f64, half_length_m: f64, pitch_m: f64) -> Vec<[f64; 3]> {
    let steps = (radius_m.max(half_length_m) / pitch_m) as i64;
    let line = move || (-steps..=steps).map(move |k| k as f64 * pitch_m);
    let all = line().flat_map(|y| line().flat_map(move |z| line().map(move |x| [x, y, z])));
    all.filter(|[x, y, z]| x.hypot(*y) <= radius_m && z.abs() <= half_length_m).collect()
}

/// Returns the colliders of a drum of this inner radius, as long as wide.
pub(super) fn shell(radius: f32) -> Vec<ColliderBuilder> {
    const PLATES: u16 = 24;
    const BLADES: u16 = 4;
    const HALF_THICK_M: f32 = 0.25;
    let at = |i: u16, of: u16, distance: f32| {
        let turn = Rotation::from_rotation_z(std::f32::consts::TAU * f32::from(i) / f32::from(of));
        Pose::from_parts(turn * (Vector::X * distance), turn)
    };
    let half_plate = (radius + 2.0 * HALF_THICK_M) * (PI as f32 / f32::from(PLATES)).tan();
    let plate = ColliderBuilder::cuboid(HALF_THICK_M, half_plate, radius);
    let blade = ColliderBuilder::cuboid(0.1 * radius, 0.1, radius);
    let lid = ColliderBuilder::cuboid(radius + 0.5, radius + 0.5, HALF_THICK_M);
    let plates = (0..PLATES).map(|i| plate.clone().position(at(i, PLATES, radius + HALF_THICK_M)));
    let blades = (0..BLADES).map(|i| blade.clone().position(at(i, BLADES, 0.9 * radius)));
    let lids = [-1.0, 1.0].map(|side| lid.clone().translation(Vector::Z * (side * (radius + HALF_THICK_M))));
    plates.chain(blades).chain(lids).collect()
}
