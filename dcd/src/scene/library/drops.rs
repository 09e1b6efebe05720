//! Builds falling scenes: a heap in a pit, rain on a landscape.

use rapier3d::prelude::*;

use super::{MOST, NO_SLEEP, SEED, SLEEP, SceneInfo, count, number};
use crate::protocol::WorldPose;
use crate::scene::dice::Dice;
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError};
use crate::space::Bounds;

pub(super) const HEAP: SceneInfo = SceneInfo {
    name: "heap",
    summary: "unit boxes dropped into a pit, where they form one giant island",
    params: &[
        count("n", "500", 1, MOST, "boxes"),
        number("slenderness", "0.5", [0.1, 4.0], "", "height of the settled heap in widths of the pit"),
        count("mixed", "0", 0, 1, "1: boxes, balls, capsules, cylinders and hulls in turn"),
        NO_SLEEP,
        SEED,
    ],
    build: heap,
};

pub(super) const TERRAIN: SceneInfo = SceneInfo {
    name: "terrain",
    summary: "boxes and balls raining on a height field with a raised rim and walls",
    params: &[
        count("n", "500", 1, MOST, "bodies, every other one a ball"),
        number("relief", "2", [0.0, 10.0], "m", "height of the hills over the mean"),
        SLEEP,
        SEED,
    ],
    build: terrain,
};

fn heap(values: &Values) -> Result<Scene, SceneError> {
    /// Fraction of the volume that tumbled boxes fill.
    const FILLED: f64 = 0.6;
    /// The distance between the centres of boxes. A unit box turned by up to 0.15 rad reaches 0.60 m at most
    /// from its centre; jitter adds 0.04.
    const PITCH_M: f64 = 1.3;
    let n = values.count("n");
    let side = (n as f64 / FILLED / f64::from(values.number("slenderness"))).cbrt().max(3.0);
    let columns = ((side - 0.65) / PITCH_M) as usize;
    let layers = n.div_ceil(columns * columns);
    let top = layers as f64 * PITCH_M;

    let mut scene = Scene::empty("heap");
    // The walls are twice as high as the boxes that hang over the pit, so that boxes that bounce stay in.
    push_walls(&mut scene, 0.5 * side, 2.0 * top + 5.0, &ColliderBuilder::ball(1.0));
    scene.push_fixed_box(
        [0.0, -2.0, 0.0],
        [0.5 * side as f32 + 4.0, 2.0, 0.5 * side as f32 + 4.0],
        &ColliderBuilder::ball(1.0),
    );
    let mut dice = Dice::new(values.seed("seed"));
    let kinds = if values.count("mixed") == 1 { 5 } else { 1 };
    for i in 0..n {
        let (layer, cell) = (i / (columns * columns), i % (columns * columns));
        // Layers are shifted a little against each other; otherwise the boxes would land as towers.
        let shift = if layer % 2 == 0 { -0.15 } else { 0.15 };
        let along = |k: usize| (k as f64 - 0.5 * (columns - 1) as f64) * PITCH_M + shift;
        let jitter = dice.in_cube(0.04).to_array().map(f64::from);
        let place = [
            along(cell % columns) + jitter[0],
            (layer as f64 + 0.6) * PITCH_M + jitter[1],
            along(cell / columns) + jitter[2],
        ];
        let pose = world_pose(place, dice.rotation(0.15));
        scene.push(pose, RigidBodyBuilder::dynamic(), shape(i % kinds, &mut dice));
    }
    // Where many boxes hang over a narrow pit, the first cuts go through the heap and not over it.
    let high = if values.number("slenderness") > 0.5 { top.min(side) } else { top };
    scene.bounds = Bounds::new([-0.5 * side, 0.0, -0.5 * side], [0.5 * side, high, 0.5 * side]);
    Ok(scene)
}

/// Returns a unit box, or another shape of about its size that reaches no further aside than a box.
fn shape(kind: usize, dice: &mut Dice) -> ColliderBuilder {
    match kind {
        0 => ColliderBuilder::cuboid(0.5, 0.5, 0.5),
        1 => ColliderBuilder::ball(0.5),
        2 => ColliderBuilder::capsule_y(0.25, 0.3),
        3 => ColliderBuilder::cylinder(0.5, 0.45),
        _ => {
            let corners: Vec<_> = (0..14).map(|_| 0.59 * dice.direction()).collect();
            ColliderBuilder::convex_hull(&corners).expect("random directions lie in no plane")
        }
    }
}

fn terrain(values: &Values) -> Result<Scene, SceneError> {
    /// The number of layers: few, on a wide field, so that free fall does not outrun the narrow phase.
    const LAYERS: f64 = 4.0;
    const PITCH_M: f64 = 1.5;
    const RIM_M: f64 = 6.0;
    let (n, relief) = (values.count("n"), f64::from(values.number("relief")));
    let columns = ((n as f64 / LAYERS).sqrt().ceil() as usize).max(4).next_multiple_of(2);
    let half = 0.5 * columns as f64 * PITCH_M + 2.0 * RIM_M;
    let lowest = relief + 2.0;
    let layers = n.div_ceil(columns * columns);
    let top = lowest + layers as f64 * PITCH_M;

    let mut scene = Scene::empty("terrain");
    let mut dice = Dice::new(values.seed("seed"));
    let field = hills(half, relief, RIM_M, &mut dice);
    scene.push(WorldPose::default(), RigidBodyBuilder::fixed(), field);
    push_walls(&mut scene, half, top + RIM_M, &ColliderBuilder::ball(1.0));
    for i in 0..n {
        let (layer, cell) = (i / (columns * columns), i % (columns * columns));
        let along = |k: usize| (k as f64 - 0.5 * (columns - 1) as f64) * PITCH_M;
        let jitter = dice.in_cube(0.15).to_array().map(f64::from);
        let place = [
            along(cell % columns) + jitter[0],
            lowest + layer as f64 * PITCH_M + jitter[1],
            along(cell / columns) + jitter[2],
        ];
        // With half edges up to 0.35, half a diagonal (0.61) and the jitter (0.15) are together about half a
        // pitch.
        let size = dice.between(0.2, 0.35);
        let collider = match i % 2 {
            0 => ColliderBuilder::cuboid(size, dice.between(0.2, 0.35), dice.between(0.2, 0.35)),
            _ => ColliderBuilder::ball(size),
        };
        scene.push(world_pose(place, dice.rotation(3.0)), RigidBodyBuilder::dynamic(), collider);
    }
    scene.bounds = Bounds::new([-half, -relief, -half], [half, top, half]);
    Ok(scene)
}

/// Returns a square height field of 2 m cells: four waves of random direction, and a rim that rises towards
/// the edge.
fn hills(half_m: f64, relief_m: f64, rim_m: f64, dice: &mut Dice) -> ColliderBuilder {
    let waves: Vec<_> = (0..4)
        .map(|_| {
            let (sin, cos) = f64::from(dice.between(0.0, std::f32::consts::TAU)).sin_cos();
            let length_m = f64::from(dice.between(12.0, 40.0));
            (cos / length_m, sin / length_m, f64::from(dice.between(0.0, 1.0)))
        })
        .collect();
    let cells = (half_m.ceil() as usize).max(2);
    let heights = Array2::new(
        cells + 1,
        cells + 1,
        // Column by column: the column is x, the row z.
        (0..(cells + 1) * (cells + 1))
            .map(|i| {
                let at = |k: usize| half_m * (2.0 * k as f64 / cells as f64 - 1.0);
                let (x, z) = (at(i / (cells + 1)), at(i % (cells + 1)));
                let wave =
                    |(a, b, phase): &(f64, f64, f64)| (std::f64::consts::TAU * (a * x + b * z + phase)).sin();
                let hill = waves.iter().map(wave).sum::<f64>() / waves.len() as f64;
                let outside = (x.abs().max(z.abs()) - (half_m - rim_m)).max(0.0) / rim_m;
                (relief_m * hill + rim_m * outside * outside) as f32
            })
            .collect(),
    );
    let scale = Vector::new(2.0 * half_m as f32, 1.0, 2.0 * half_m as f32);
    ColliderBuilder::heightfield_with_flags(heights, scale, HeightFieldFlags::FIX_INTERNAL_EDGES)
}

/// Adds four walls, 4 m thick, around a square pit, from below its floor to this height.
fn push_walls(scene: &mut Scene, half_m: f64, height_m: f64, material: &ColliderBuilder) {
    const THICK_M: f64 = 4.0;
    const DEEP_M: f64 = 12.0;
    let (middle_y, half_y) = (0.5 * (height_m - DEEP_M), 0.5 * (height_m + DEEP_M) as f32);
    let (off, long) = (half_m + 0.5 * THICK_M, (half_m + THICK_M) as f32);
    let thin = 0.5 * THICK_M as f32;
    for side in [-off, off] {
        scene.push_fixed_box([side, middle_y, 0.0], [thin, half_y, long], material);
        scene.push_fixed_box([0.0, middle_y, side], [long, half_y, thin], material);
    }
}
