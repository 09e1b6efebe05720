//! Builds standing scenes: tower, pyramid, wall, pile. Boxes on a fixed floor whose top is y = 0.

use rapier3d::prelude::*;

use super::{MOST, NO_SLEEP, SEED, SLEEP, SceneInfo, count, number};
use crate::protocol::WorldPose;
use crate::scene::dice::Dice;
use crate::scene::params::Values;
use crate::scene::{ParamInfo, Scene, SceneError};
use crate::space::Bounds;

/// The margin around the bodies: room for bodies that move a little, and for the floor.
const MARGIN_M: f64 = 1.0;

const GAP: ParamInfo = number("gap", "0.05", [0.0, 10.0], "m", "free space between neighbours of one layer");

pub(super) const TOWER: SceneInfo = SceneInfo {
    name: "tower",
    summary: "unit boxes on one another, the top one heavier if wanted",
    params: &[
        count("n", "10", 1, 1_000, "boxes"),
        number(
            "top_mass_ratio",
            "1",
            [0.001, 100_000.0],
            "",
            "mass of the top box in masses of one below it",
        ),
        SLEEP,
    ],
    build: tower,
};

pub(super) const PYRAMID: SceneInfo = SceneInfo {
    name: "pyramid",
    summary: "a flat pyramid of unit boxes, along x",
    params: &[count("base", "20", 1, 1_000, "boxes of the lowest layer"), GAP, SLEEP],
    build: pyramid,
};

pub(super) const WALL: SceneInfo = SceneInfo {
    name: "wall",
    summary: "bricks of 1 x 0.5 x 0.5 m in running bond, along x; half bricks close every other course",
    params: &[
        count("width", "20", 1, 2_000, "bricks of a course"),
        count("height", "8", 1, 200, "courses"),
        number("gap", "0.005", [0.0, 0.1], "m", "joint between the bricks of a course"),
        number(
            "shot",
            "0",
            [0.0, 200.0],
            "m/s",
            "speed of a ball of 4 kg shot through the middle; 0: no ball",
        ),
        SLEEP,
    ],
    build: wall,
};

pub(super) const PILE: SceneInfo = SceneInfo {
    name: "pile",
    summary: "towers of unit boxes in a grid, as many left as right of the middle",
    params: &[
        count("n", "1000", 1, MOST, "boxes"),
        count("height", "10", 1, 50, "boxes of a tower"),
        number("gap", "0.5", [0.05, 100.0], "m", "free space between towers"),
        number(
            "jitter",
            "0",
            [0.0, 1.0],
            "m",
            "range within which a box lies aside at random, and height that it falls; at most `gap`",
        ),
        number(
            "lean",
            "0",
            [0.0, 0.5],
            "m",
            "how far a box lies along x of the one below it; towers of ten fall from 0.1",
        ),
        NO_SLEEP,
        SEED,
    ],
    build: pile,
};

fn tower(values: &Values) -> Result<Scene, SceneError> {
    let n = values.count("n");
    let mut scene = Scene::empty("tower");
    push_floor(&mut scene, [0.5, 0.5]);
    let unit = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
    for i in 0..n {
        let top = i + 1 == n;
        let mass_kg = if top { values.number("top_mass_ratio") } else { 1.0 };
        push_box(&mut scene, [0.0, i as f64 + 0.5, 0.0], unit.clone().mass(mass_kg));
    }
    Ok(bounded(scene))
}

fn pyramid(values: &Values) -> Result<Scene, SceneError> {
    let (base, pitch) = (values.count("base"), 1.0 + f64::from(values.number("gap")));
    let mut scene = Scene::empty("pyramid");
    push_floor(&mut scene, [0.5 * base as f64 * pitch, 0.5]);
    let unit = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
    for layer in 0..base {
        let row = base - layer;
        for i in 0..row {
            let x = (i as f64 - 0.5 * (row - 1) as f64) * pitch;
            push_box(&mut scene, [x, layer as f64 + 0.5, 0.0], unit.clone());
        }
    }
    Ok(bounded(scene))
}

fn wall(values: &Values) -> Result<Scene, SceneError> {
    let (width, height) = (values.count("width"), values.count("height"));
    let (gap_m, shot_m_s) = (f64::from(values.number("gap")), values.number("shot"));
    let left = -0.5 * width as f64;
    let mut scene = Scene::empty("wall");
    // The ball and what it knocks out land on the floor.
    push_floor(&mut scene, [-left, 0.25 + 3.0 * f64::from(shot_m_s)]);
    let brick = |length_m: f64| ColliderBuilder::cuboid(0.5 * (length_m - gap_m) as f32, 0.25, 0.25);
    let (full, half) = (brick(1.0), brick(0.5));
    for course in 0..height {
        let y = 0.5 * course as f64 + 0.25;
        if course % 2 == 0 {
            for i in 0..width {
                push_box(&mut scene, [left + i as f64 + 0.5, y, 0.0], full.clone());
            }
        } else {
            push_box(&mut scene, [left + 0.25, y, 0.0], half.clone());
            for i in 1..width {
                push_box(&mut scene, [left + i as f64, y, 0.0], full.clone());
            }
            push_box(&mut scene, [-left - 0.25, y, 0.0], half.clone());
        }
    }
    if shot_m_s > 0.0 {
        // Damped, as balls roll for ever in Rapier.
        let ball =
            RigidBodyBuilder::dynamic().linvel(Vector::Z * shot_m_s).angular_damping(1.0).ccd_enabled(true);
        let start = WorldPose::at([0.0, (0.25 * height as f64).max(0.5), -2.0]);
        scene.push(start, ball, ColliderBuilder::ball(0.5).mass(4.0));
    }
    Ok(bounded(scene))
}

fn pile(values: &Values) -> Result<Scene, SceneError> {
    let (n, height) = (values.count("n"), values.count("height"));
    let (gap, jitter) = (values.number("gap"), values.number("jitter"));
    if jitter > gap {
        return Err(values.refuse("jitter", &format!("at most `gap`, {gap} m")));
    }
    let pitch = 1.0 + f64::from(gap);
    let towers = n.div_ceil(height);
    let (columns, rows) = grid_of(towers);
    let (half_x, half_z) = (0.5 * columns as f64 * pitch, 0.5 * rows as f64 * pitch);
    let mut scene = Scene::empty("pile");
    push_floor(&mut scene, [half_x, half_z]);
    let unit = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
    let mut dice = Dice::new(values.seed("seed"));
    let (rise, lean) = (1.0 + f64::from(jitter), f64::from(values.number("lean")));
    for tower in 0..towers {
        let (row, k) = (tower / columns, tower % columns);
        // Rows are filled from both ends towards the middle, so that a row that is not full still has two
        // equal halves.
        let column = if k % 2 == 0 { k / 2 } else { columns - 1 - k / 2 };
        let x = (column as f64 + 0.5) * pitch - half_x;
        let z = (row as f64 + 0.5) * pitch - half_z;
        for level in 0..height.min(n - tower * height) {
            let aside = dice.in_cube(0.5 * jitter).to_array().map(f64::from);
            let x = x + level as f64 * lean + aside[0];
            push_box(&mut scene, [x, level as f64 * rise + 0.5, z + aside[2]], unit.clone());
        }
    }
    // The bounds are never taller than long: the first cut is to fall between towers, not through them.
    let top = ((height - 1) as f64 * rise + 1.0).min(2.0 * half_x);
    scene.bounds = Bounds::new([-half_x, 0.0, -half_z], [half_x, top, half_z]);
    if jitter > 0.0 || lean > 0.0 {
        // Towers that are to fall are cut through instead: in the middle of the column beside the middle.
        scene.bounds.max[0] += pitch;
    }
    Ok(scene)
}

/// Returns the number of columns along x, even, so that the middle falls between two, and of rows along z.
/// The grid is nearly square, and no longer along z than along x.
fn grid_of(towers: usize) -> (usize, usize) {
    let root = (towers as f64).sqrt().ceil() as usize;
    let first = root + root % 2;
    // A grid without an unfilled row, if one is nearly square.
    let even = |step: usize| (first..=root + root / 2).step_by(2).find(|c| towers.is_multiple_of(c * step));
    let columns = even(2).or_else(|| even(1)).unwrap_or(first).max(2);
    (columns, towers.div_ceil(columns))
}

fn push_box(scene: &mut Scene, centre: [f64; 3], collider: ColliderBuilder) {
    scene.push(WorldPose::at(centre), RigidBodyBuilder::dynamic(), collider);
}

/// Adds a slab of 2 m as floor, with room around the bodies for what falls.
fn push_floor(scene: &mut Scene, half_xz_m: [f64; 2]) {
    const ROOM_M: f64 = 20.0;
    let half = half_xz_m.map(|half| (half + ROOM_M) as f32);
    scene.push_fixed_box([0.0, -1.0, 0.0], [half[0], 1.0, half[1]], &ColliderBuilder::ball(1.0));
}

fn bounded(mut scene: Scene) -> Scene {
    scene.bounds = scene.tight_bounds().expect("a stack has a box").grown(MARGIN_M);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Params;

    #[test]
    fn a_pile_of_20_000_has_two_equal_halves_and_no_tower_across_the_middle() {
        for n in [20, 1_000, 1_010, 12_345, 20_000] {
            let scene = Scene::named("pile", &Params::new().with("n", n)).unwrap();
            let axis = scene.bounds.longest_axis().index();
            let middle = scene.bounds.centre()[axis];
            let boxes = &scene.bodies[1..];
            assert_eq!(boxes.len(), n);
            assert!(boxes.iter().all(|body| (body.pose.translation[axis] - middle).abs() > 0.5), "{n}");
            let left = boxes.iter().filter(|body| body.pose.translation[axis] < middle).count();
            assert!(left.abs_diff(n - left) <= 10, "{n}: {left} left of the middle");
            assert!(n != 20_000 || left == 10_000);
        }
    }

    #[test]
    fn the_top_of_a_tower_has_the_mass_asked_for() {
        let scene = Scene::named("tower", &Params::new().with("n", 3).with("top_mass_ratio", 100)).unwrap();
        let world = scene.bare_world();
        let mut masses: Vec<_> = world.rigid_bodies().map(|(_, body)| body.clone()).collect();
        for body in &mut masses {
            body.recompute_mass_properties_from_colliders(&world.colliders);
        }
        assert_eq!(masses.iter().skip(1).map(RigidBody::mass).collect::<Vec<_>>(), [1.0, 1.0, 100.0]);
    }

    #[test]
    fn a_jittered_pile_is_cut_through_its_towers() {
        for n in [200, 20_000] {
            let params = Params::new().with("n", n).with("gap", 0.3).with("jitter", 0.2);
            let scene = Scene::named("pile", &params).unwrap();
            let (axis, middle) = (scene.bounds.longest_axis().index(), scene.bounds.centre());
            let across =
                |body: &&crate::scene::SceneBody| (body.pose.translation[axis] - middle[axis]).abs() < 0.5;
            let columns = (n as f64 / 10.0).sqrt();
            let count = scene.bodies[1..].iter().filter(across).count();
            assert!(count as f64 > 5.0 * columns, "{n}: {count} boxes lie across the middle");
        }
    }

    #[test]
    fn a_jitter_beyond_the_gap_is_refused() {
        let params = Params::new().with("gap", 0.3).with("jitter", 0.4);
        let error = Scene::named("pile", &params).unwrap_err().to_string();
        assert!(error.contains("`jitter=0.4` is not at most `gap`, 0.3 m"), "{error}");
    }
}
