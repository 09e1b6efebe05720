//! Builds a net of balls: all of it is one island and one assembly.

use rapier3d::prelude::*;

use super::{SLEEP, SceneInfo, count};
use crate::protocol::WorldPose;
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError, SceneJoint};
use crate::space::Bounds;

pub(super) const NET: SceneInfo = SceneInfo {
    name: "net",
    summary: "balls tied to their neighbours by joints in a square grid, let go from lying flat",
    params: &[
        count("edge", "20", 2, 1_000, "balls along an edge"),
        count(
            "hang",
            "0",
            0,
            1,
            "0: falls on a pole across its middle; 1: every fourth ball of an edge is held",
        ),
        SLEEP,
    ],
    build: net,
};

const PITCH_M: f64 = 0.5;
/// Distance from the net down to the axis of the pole.
const DROP_M: f64 = 2.0;
const POLE_RADIUS_M: f32 = 0.5;

fn net(values: &Values) -> Result<Scene, SceneError> {
    let (edge, hangs) = (values.count("edge"), values.count("hang") == 1);
    let half_m = 0.5 * edge as f64 * PITCH_M;
    let along = |k: usize| (k as f64 + 0.5) * PITCH_M - half_m;
    let mut scene = Scene::empty("net");
    if !hangs {
        let lying = world_pose([0.0, -DROP_M, 0.0], Rotation::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let pole = ColliderBuilder::cylinder(half_m as f32 + 5.0, POLE_RADIUS_M);
        scene.push(lying, RigidBodyBuilder::fixed(), pole);
    }
    let first = scene.bodies.len();
    let ball = ColliderBuilder::ball(0.2);
    for row in 0..edge {
        for column in 0..edge {
            let held = hangs && row == 0 && (column % 4 == 0 || column + 1 == edge);
            let body = if held { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
            scene.push(WorldPose::at([along(column), 0.0, along(row)]), body, ball.clone());
        }
    }
    let at = |row: usize, column: usize| first + row * edge + column;
    for row in 0..edge {
        for column in 0..edge {
            if row > 0 {
                scene.joints.push(tie(at(row - 1, column), at(row, column), Vector::Z));
            }
            if column > 0 {
                scene.joints.push(tie(at(row, column - 1), at(row, column), Vector::X));
            }
        }
    }
    let low_m = if hangs { -2.0 * half_m } else { -half_m - DROP_M };
    scene.bounds = Bounds::new([-half_m, low_m, -half_m], [half_m, 1.0, half_m]);
    Ok(scene)
}

/// Returns a joint half-way between two balls, the second of which lies in this direction.
fn tie(a: usize, b: usize, direction: Vector) -> SceneJoint {
    let arm = 0.5 * PITCH_M as f32 * direction;
    let joint = SphericalJointBuilder::new().local_anchor1(arm).local_anchor2(-arm).contacts_enabled(false);
    SceneJoint { a, b, joint: joint.into(), multibody: None }
}
