//! Builds a town: districts in a grid, some asleep, most busy, four of which a viewer looks at.

use rapier3d::prelude::*;

use super::convoy;
use super::machines::{grid_in_cylinder, shell};
use super::ragdolls;
use super::{SEED, SceneInfo, count};
use crate::protocol::WorldPose;
use crate::scene::dice::Dice;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneBody, SceneError};
use crate::space::{Axis, Bounds, Viewpoint};

pub(super) const TOWN: SceneInfo = SceneInfo {
    name: "town",
    summary: "24 districts, 60 m each: a third asleep, the others drums of balls, boxes and ragdolls, a wall that is shot, cars; \
              one viewpoint at the corner of four of them",
    params: &[
        count("n", "20000", 600, 150_000, "bodies, about"),
        count("cars", "20", 0, 28, "cars with trailers (8 bodies each) that drive through it along x"),
        SEED,
    ],
    build: town,
};

const PITCH_M: f64 = 60.0;
const COLUMNS: usize = 6;
const ROWS: usize = 4;
/// The radius of the viewpoint.
const SIGHT_M: f64 = 50.0;
const CAR_M_S: f32 = 12.0;
/// The distance of the cars' lane from the middle of a street, along which the town is cut.
const LANE_M: f64 = 5.0;

/// What stands in a district.
enum District {
    Towers,
    Drums(ColliderBuilder),
    Ragdolls,
    Wall,
}

fn town(values: &Values) -> Result<Scene, SceneError> {
    let cars = values.count("cars");
    let share = values.count("n").saturating_sub(8 * cars).div_ceil(COLUMNS * ROWS);
    let mut scene = Scene::empty("town");
    let half = [0.5 * COLUMNS as f64 * PITCH_M, 0.5 * ROWS as f64 * PITCH_M];
    let ground = [half[0] as f32 + 200.0, 0.5, half[1] as f32 + 200.0];
    scene.push_fixed_box([0.0, -0.5, 0.0], ground, &ColliderBuilder::ball(1.0).friction(0.8));
    let mut dice = Dice::new(values.seed("seed"));
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let place = |k: usize, half: f64| (k as f64 + 0.5) * PITCH_M - half;
            let centre = [place(column, half[0]), place(row, half[1])];
            match district(column, row) {
                District::Towers => towers(&mut scene, centre, share),
                District::Drums(shape) => drums(&mut scene, centre, share, &shape, &mut dice),
                District::Ragdolls => dryer(&mut scene, centre, share, &mut dice),
                District::Wall => wall(&mut scene, centre, share),
            }
        }
    }
    for car in 0..cars {
        convoy::car(&mut scene, [-half[0] + 10.0 + 12.0 * car as f64, LANE_M], CAR_M_S);
    }
    scene.bodies.iter_mut().for_each(|body| body.body.can_sleep = true);
    let planes = |axis: Axis, count: usize, half: f64| {
        (1..count).map(move |k| (axis, k as f64 * PITCH_M - half)).collect::<Vec<_>>()
    };
    scene.cuts = planes(Axis::X, COLUMNS, half[0]);
    scene.cuts.extend(planes(Axis::Z, ROWS, half[1]));
    scene.viewpoints = vec![Viewpoint { at: [PITCH_M - half[0], 2.0, PITCH_M - half[1]], radius_m: SIGHT_M }];
    let highest_m = scene.bodies.iter().map(|body| body.pose.translation[1]).fold(0.0, f64::max);
    scene.bounds = Bounds::new([-half[0], 0.0, -half[1]], [half[0], (highest_m + 2.0).max(30.0), half[1]]);
    Ok(scene)
}

/// Returns what stands in a district. The four districts at the viewpoint are one of each kind that moves.
/// Two in five of the others sleep.
fn district(column: usize, row: usize) -> District {
    let balls = || District::Drums(ColliderBuilder::ball(0.25));
    let boxes = || District::Drums(ColliderBuilder::cuboid(0.2, 0.25, 0.3));
    match (column, row) {
        (0, 0) => balls(),
        (1, 0) => District::Ragdolls,
        (0, 1) => District::Wall,
        (1, 1) => boxes(),
        _ => match (column + COLUMNS * row) % 5 {
            0 => balls(),
            1 | 3 => District::Towers,
            2 => boxes(),
            _ => District::Ragdolls,
        },
    }
}

/// Adds towers of five unit boxes that sleep.
fn towers(scene: &mut Scene, [x, z]: [f64; 2], count: usize) {
    const HEIGHT: usize = 5;
    const GAP_M: f64 = 1.5;
    let side = (1..).find(|side| side * side * HEIGHT >= count).expect("a square is large enough");
    for i in 0..count {
        let (tower, level) = (i / HEIGHT, i % HEIGHT);
        let along = |k: usize| (k as f64 - 0.5 * side as f64) * GAP_M;
        let place = [x + along(tower % side), level as f64 + 0.5, z + along(tower / side)];
        let body = RigidBodyBuilder::dynamic().sleeping(true);
        scene.push(WorldPose::at(place), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
}

/// Adds two turning drums with half of the bodies each.
fn drums(scene: &mut Scene, [x, z]: [f64; 2], count: usize, shape: &ColliderBuilder, dice: &mut Dice) {
    const GRID_M: f64 = 0.75;
    for (side, count) in [(-1.0, count / 2), (1.0, count - count / 2)] {
        let fits =
            |radius_m: &f64| grid_in_cylinder(0.75 * radius_m - 0.4, radius_m - 0.4, GRID_M).len() >= count;
        let radius_m = (4..).map(|halves| 0.5 * f64::from(halves)).find(fits).expect("one is large enough");
        let centre = [x + side * (radius_m + 2.0), radius_m + 1.5, z];
        turning(scene, centre, radius_m);
        let places = grid_in_cylinder(0.75 * radius_m - 0.4, radius_m - 0.4, GRID_M);
        for place in places.into_iter().take(count) {
            let aside = dice.in_cube(0.05).to_array();
            let at = std::array::from_fn(|i| centre[i] + place[i] + f64::from(aside[i]));
            scene.push(WorldPose::at(at), RigidBodyBuilder::dynamic(), shape.clone());
        }
    }
}

/// Adds a turning drum with ragdolls.
fn dryer(scene: &mut Scene, [x, z]: [f64; 2], bodies: usize, dice: &mut Dice) {
    const GRID_M: f64 = 2.2;
    let count = bodies / ragdolls::BODIES;
    let fits = |radius_m: &f64| grid_in_cylinder(0.8 * radius_m - 1.0, radius_m - 1.0, GRID_M).len() >= count;
    let radius_m = (6..).map(|halves| 0.5 * f64::from(halves)).find(fits).expect("one is large enough");
    let centre = [x, radius_m + 1.5, z];
    turning(scene, centre, radius_m);
    for place in grid_in_cylinder(0.8 * radius_m - 1.0, radius_m - 1.0, GRID_M).into_iter().take(count) {
        ragdolls::ragdoll(scene, std::array::from_fn(|i| centre[i] + place[i]), dice, None);
    }
}

fn turning(scene: &mut Scene, centre: [f64; 3], radius_m: f64) {
    let drum = RigidBodyBuilder::kinematic_velocity_based().angvel(Vector::Z * 0.6);
    scene.bodies.push(SceneBody {
        pose: WorldPose::at(centre),
        body: drum,
        colliders: shell(radius_m as f32),
    });
}

/// Adds a wall across z, and a heavy ball that flies at it.
fn wall(scene: &mut Scene, [x, z]: [f64; 2], count: usize) {
    /// The most bricks of a course that fit into a district.
    const WIDEST: usize = 50;
    let width = ((count as f64).sqrt() as usize).clamp(2, WIDEST);
    let brick = ColliderBuilder::cuboid(0.49, 0.25, 0.25);
    for i in 0..count.saturating_sub(1) {
        let (course, at) = (i / width, i % width);
        let shift = if course % 2 == 0 { 0.0 } else { 0.5 };
        let place = [x + at as f64 - 0.5 * width as f64 + shift, 0.25 + 0.5 * course as f64, z];
        scene.push(WorldPose::at(place), RigidBodyBuilder::dynamic(), brick.clone());
    }
    let ball = RigidBodyBuilder::dynamic().linvel(Vector::Z * 20.0).angular_damping(1.0).ccd_enabled(true);
    let start = [x, 0.3 * count as f64 / width as f64, z - 15.0];
    scene.push(WorldPose::at(start), ball, ColliderBuilder::ball(1.0).mass(4_000.0));
}
