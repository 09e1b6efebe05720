//! Builds scenes without gravity: a gas of balls, and the thesis's freely moving cubes.

use rapier3d::prelude::*;

use super::{MOST, NO_SLEEP, SEED, SceneInfo, count, number};
use crate::protocol::WorldPose;
use crate::scene::dice::Dice;
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError};
use crate::space::Bounds;

pub(super) const GAS: SceneInfo = SceneInfo {
    name: "gas",
    summary: "elastic frictionless balls, or balls and cubes, without gravity in a closed box",
    params: &[
        count("n", "512", 1, MOST, "balls of radius 0.25 m"),
        number("fill", "0.05", [0.0001, 0.2], "", "share of the box that balls fill"),
        number("speed", "2", [0.0, 50.0], "m/s", "speed of every ball at the start"),
        number("cubes", "0", [0.0, 1.0], "", "share of the balls that are cubes of 0.38 m instead"),
        NO_SLEEP,
        SEED,
    ],
    build: gas,
};

pub(super) const DVE: SceneInfo = SceneInfo {
    name: "dve",
    summary: "the thesis's world (5.1): unit cubes moving freely without gravity in a cube of side cbrt(n / coverage)",
    params: &[
        count("n", "1000", 1, MOST, "cubes"),
        // On average 4 n c pairs overlap at coverage c: at 0.004, 16 of 1000, as few as in table 5.1.
        number("coverage", "0.004", [0.00001, 0.15], "", "share of the world that cubes fill"),
        number("speed", "2", [0.0, 50.0], "m/s", "highest speed at the start"),
        number(
            "axis_speed",
            "0",
            [0.0, 50.0],
            "m/s",
            "highest speed along each axis at the start, in place of `speed`; 0: as `speed` says",
        ),
        NO_SLEEP,
        SEED,
    ],
    build: dve,
};

fn gas(values: &Values) -> Result<Scene, SceneError> {
    const RADIUS_M: f32 = 0.25;
    /// Half the edge of a cube: so small that the cube may turn in a cell of the densest gas.
    const HALF_CUBE_M: f32 = 0.19;
    let n = values.count("n");
    let cubes = (f64::from(values.number("cubes")) * n as f64).round() as usize;
    let is_cube = |i: usize| (i + 1) * cubes / n > i * cubes / n;
    let reach_m = if cubes > 0 { f64::from(HALF_CUBE_M) * 3f64.sqrt() } else { 1.1 * f64::from(RADIUS_M) };
    let volume = (n - cubes) as f64 * 4.0 / 3.0 * std::f64::consts::PI * f64::from(RADIUS_M).powi(3)
        + cubes as f64 * (2.0 * f64::from(HALF_CUBE_M)).powi(3);
    // Even a few balls need a box that holds each in a cell of its own.
    let cells = cells_for(n);
    let side = (volume / f64::from(values.number("fill"))).cbrt().max(cells as f64 * 2.0 * reach_m);
    let speed = values.number("speed");

    let mut scene = Scene::empty("gas");
    let mut dice = Dice::new(values.seed("seed"));
    let ball = elastic(ColliderBuilder::ball(RADIUS_M));
    let cube = elastic(ColliderBuilder::cuboid(HALF_CUBE_M, HALF_CUBE_M, HALF_CUBE_M));
    let cell_m = 0.5 * (side / cells as f64) as f32;
    let mut velocities: Vec<_> = (0..n).map(|_| speed * dice.direction()).collect();
    // The mean velocity is subtracted, so that the momentum of equal bodies sums to zero at the start.
    let drift = velocities.iter().sum::<Vector>() / n as f32;
    if n > 1 {
        velocities.iter_mut().for_each(|velocity| *velocity -= drift);
    }
    for (i, (place, velocity)) in places(n, side).zip(velocities).enumerate() {
        let body = RigidBodyBuilder::dynamic().linvel(velocity);
        if is_cube(i) {
            let place = jittered(place, (cell_m - reach_m as f32).max(0.0), &mut dice);
            scene.push(world_pose(place, dice.rotation(std::f32::consts::PI)), body, cube.clone());
        } else {
            scene.push(WorldPose::at(jittered(place, cell_m - RADIUS_M, &mut dice)), body, ball.clone());
        }
    }
    Ok(closed(scene, side))
}

fn dve(values: &Values) -> Result<Scene, SceneError> {
    /// Half the diagonal of a unit cube: the cube stays within this distance, however it is turned.
    const REACH_M: f32 = 0.866_1;
    let n = values.count("n");
    // Even where few cubes fill much of the world, each has a cell of its own.
    let least = cells_for(n) as f64 * 2.0 * f64::from(REACH_M);
    let side = (n as f64 / f64::from(values.number("coverage"))).cbrt().max(least);
    let room_m = (0.5 * (side / cells_for(n) as f64) as f32 - REACH_M).max(0.0);
    let (speed, axis_speed) = (values.number("speed"), values.number("axis_speed"));

    let mut scene = Scene::empty("dve");
    let mut dice = Dice::new(values.seed("seed"));
    let cube = elastic(ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    for place in places(n, side) {
        let place = jittered(place, room_m, &mut dice);
        let turn = dice.rotation(std::f32::consts::PI);
        let velocity = match axis_speed {
            0.0 => dice.between(0.0, speed) * dice.direction(),
            _ => dice.in_cube(axis_speed),
        };
        let spin = dice.between(0.0, 1.0) * dice.direction();
        let body = RigidBodyBuilder::dynamic().linvel(velocity).angvel(spin);
        scene.push(world_pose(place, turn), body, cube.clone());
    }
    Ok(closed(scene, side))
}

/// Returns the number of cells along an edge of the smallest cube that has a cell for each of n bodies.
fn cells_for(n: usize) -> usize {
    (1..).find(|k: &usize| k.pow(3) >= n).expect("some cube holds n cells")
}

/// Returns the centres of n cells of a cube around the origin, spread evenly over all its cells.
fn places(n: usize, side: f64) -> impl Iterator<Item = [f64; 3]> {
    let k = cells_for(n);
    (0..n).map(move |i| {
        let cell = i * k.pow(3) / n;
        [cell % k, cell / k % k, cell / (k * k)].map(|c| side * ((c as f64 + 0.5) / k as f64 - 0.5))
    })
}

fn jittered(place: [f64; 3], room_m: f32, dice: &mut Dice) -> [f64; 3] {
    let jitter = dice.in_cube(room_m);
    std::array::from_fn(|i| place[i] + f64::from(jitter[i]))
}

fn elastic(collider: ColliderBuilder) -> ColliderBuilder {
    collider.restitution(1.0).friction(0.0)
}

/// Closes a scene: no gravity, and six fixed walls around a cube of this side.
fn closed(mut scene: Scene, side: f64) -> Scene {
    const THICK_M: f64 = 2.0;
    let (half, off) = (0.5 * side, 0.5 * (side + THICK_M));
    let wall = elastic(ColliderBuilder::ball(1.0));
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (mut centre, mut halves) = ([0.0; 3], [(half + THICK_M) as f32; 3]);
            centre[axis] = sign * off;
            halves[axis] = 0.5 * THICK_M as f32;
            scene.push_fixed_box(centre, halves, &wall);
        }
    }
    scene.gravity = [0.0; 3];
    scene.bounds = Bounds::around([0.0; 3], [half; 3]);
    scene
}
