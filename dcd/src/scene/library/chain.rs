//! Builds a hanging chain with a heavy bob.

use rapier3d::prelude::*;

use super::{SceneInfo, count, number};
use crate::protocol::WorldPose;
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError, SceneJoint};

pub(super) const CHAIN: SceneInfo = SceneInfo {
    name: "chain",
    summary: "capsules of 1 kg and 0.5 m with a bob, hanging from a fixed anchor (1000:1 swings only with 16 iterations)",
    params: &[
        count("links", "16", 1, 1_000, "capsules"),
        number("bob_mass_ratio", "1000", [0.001, 100_000.0], "", "mass of the bob in masses of a link"),
        number("offset", "0", [0.0, 500.0], "m", "how far along x the bob starts from below the anchor"),
    ],
    build: chain,
};

/// Distance from joint to joint.
const LINK_M: f64 = 0.5;
const BOB_RADIUS_M: f32 = 0.3;

fn chain(values: &Values) -> Result<Scene, SceneError> {
    let links = values.count("links");
    let length_m = links as f64 * LINK_M;
    let offset_m = f64::from(values.number("offset"));
    if offset_m > length_m {
        return Err(values.refuse("offset", &format!("at most the chain's length, {length_m} m")));
    }
    let angle = (offset_m / length_m).asin();
    let turn = Rotation::from_rotation_z(angle as f32);
    // The point at this distance along the chain; the anchor is the origin.
    let along = |distance_m: f64| [distance_m * angle.sin(), -distance_m * angle.cos(), 0.0];

    let mut scene = Scene::empty("chain");
    let mut above =
        scene.push(WorldPose::default(), RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(0.1, 0.1, 0.1));
    let mut anchor = Vector::ZERO;
    let half = 0.5 * LINK_M as f32;
    let link = ColliderBuilder::capsule_y(half - 0.05, 0.05).mass(1.0);
    for i in 0..links {
        let pose = world_pose(along((i as f64 + 0.5) * LINK_M), turn);
        let below = scene.push(pose, RigidBodyBuilder::dynamic(), link.clone());
        scene.joints.push(hang(above, anchor, below, Vector::Y * half));
        (above, anchor) = (below, -Vector::Y * half);
    }
    let bob = ColliderBuilder::ball(BOB_RADIUS_M).mass(values.number("bob_mass_ratio"));
    let pose = world_pose(along(length_m + f64::from(BOB_RADIUS_M)), turn);
    let below = scene.push(pose, RigidBodyBuilder::dynamic(), bob);
    scene.joints.push(hang(above, anchor, below, Vector::Y * BOB_RADIUS_M));
    scene.bounds = scene.tight_bounds().expect("a chain has a box").grown(0.5);
    Ok(scene)
}

fn hang(a: usize, anchor_a: Vector, b: usize, anchor_b: Vector) -> SceneJoint {
    let joint =
        SphericalJointBuilder::new().local_anchor1(anchor_a).local_anchor2(anchor_b).contacts_enabled(false);
    SceneJoint { a, b, joint: joint.into(), multibody: None }
}
