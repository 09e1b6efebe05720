//! Builds arches of wedge-shaped stones without mortar.

use std::f64::consts::PI;

use rapier3d::prelude::*;

use super::{SLEEP, SceneInfo, count, number};
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError};
use crate::space::Bounds;

pub(super) const VAULT: SceneInfo = SceneInfo {
    name: "vault",
    summary: "round arches of wedge-shaped stones (convex hulls) in a row along x, the middle of the world at a keystone",
    params: &[
        count("arches", "12", 1, 10_000, "arches beside one another"),
        count("stones", "13", 3, 101, "stones of an arch; an odd number has a keystone"),
        count("rows", "1", 1, 1_000, "arches behind one another, 1 m deep each"),
        number("thickness", "1", [0.4, 2.0], "m", "of an arch, whose inner radius is 3 m"),
        SLEEP,
    ],
    build: vault,
};

const INNER_M: f64 = 3.0;
/// Half of an arch's depth, and the free space behind it.
const HALF_DEPTH_M: f64 = 0.5;
const BEHIND_M: f64 = 0.1;
/// The gap between two stones: Parry takes some faces that lie exactly on one another for a metre deep.
const JOINT_M: f64 = 0.001;
/// Free space between two arches.
const BESIDE_M: f64 = 0.5;

fn vault(values: &Values) -> Result<Scene, SceneError> {
    let (arches, stones, rows) = (values.count("arches"), values.count("stones"), values.count("rows"));
    let outer_m = INNER_M + f64::from(values.number("thickness"));
    let (pitch_m, depth_m) = (2.0 * outer_m + BESIDE_M, 2.0 * HALF_DEPTH_M + BEHIND_M);
    let half_m = [0.5 * arches as f64 * pitch_m, 0.5 * rows as f64 * depth_m];
    let mut scene = Scene::empty("vault");
    let stone = ColliderBuilder::ball(1.0).friction(0.8);
    let floor = half_m.map(|half| half as f32 + 20.0);
    scene.push_fixed_box([0.0, -1.0, 0.0], [floor[0], 1.0, floor[1]], &stone);
    let angle = PI / stones as f64;
    let mean_m = 0.5 * (INNER_M + outer_m);
    let wedge = ColliderBuilder {
        shape: wedge(0.5 * (angle - JOINT_M / mean_m), [INNER_M - mean_m, outer_m - mean_m], mean_m),
        ..stone
    };
    for arch in 0..arches {
        let x = (arch as f64 + 0.5) * pitch_m - half_m[0];
        for row in 0..rows {
            let z = (row as f64 + 0.5) * depth_m - half_m[1];
            for i in 0..stones {
                // The stone's angle from upright: from the left springing over the crown to the right one.
                let lean = (i as f64 + 0.5) * angle - 0.5 * PI;
                let centre = [x + mean_m * lean.sin(), mean_m * lean.cos(), z];
                let turn = Rotation::from_rotation_z(-lean as f32);
                scene.push(world_pose(centre, turn), RigidBodyBuilder::dynamic(), wedge.clone());
            }
        }
    }
    // With an even number of arches, the bounds are wider by one arch on one side. The first cut then goes
    // through a crown and not between two arches.
    let further_m = if arches.is_multiple_of(2) { pitch_m } else { 0.0 };
    scene.bounds = Bounds::new([-half_m[0], 0.0, -half_m[1]], [half_m[0] + further_m, outer_m, half_m[1]]);
    Ok(scene)
}

/// Returns a stone that leans as much to both sides. Its origin is in the middle of the arch's thickness, and
/// `faces_m` are its inner and outer face relative to that.
fn wedge(half_angle: f64, faces_m: [f64; 2], mean_m: f64) -> SharedShape {
    let mut corners = Vec::with_capacity(8);
    for face_m in faces_m {
        for side in [-half_angle, half_angle] {
            let radius_m = mean_m + face_m;
            let (x, y) = (radius_m * side.sin(), radius_m * side.cos() - mean_m);
            corners.extend([-HALF_DEPTH_M, HALF_DEPTH_M].map(|z| Vector::new(x as f32, y as f32, z as f32)));
        }
    }
    SharedShape::convex_hull(&corners).expect("eight corners of a wedge span it")
}
