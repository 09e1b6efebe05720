//! Builds ragdolls that fall on stairs and tumble down.

use rapier3d::prelude::*;

use super::{SEED, SLEEP, SceneInfo, count, number};
use crate::physics::LinkSettings;
use crate::scene::dice::Dice;
use crate::scene::model::world_pose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError, SceneJoint};
use crate::space::Bounds;

pub(super) const RAGDOLLS: SceneInfo = SceneInfo {
    name: "ragdolls",
    summary: "ragdolls (11 bodies, 10 joints with limits, 1.7 m, 65 kg each) thrown on stairs that lead down along x",
    params: &[
        count("count", "60", 1, 100_000, "ragdolls"),
        SEED,
        number("height", "1.5", [1.0, 100.0], "m", "how high above the stairs their hips start"),
        count("multibody", "0", 0, 1, "0: impulses hold their joints; 1: each is one multibody"),
        number(
            "armature",
            "0.05",
            [0.0, 10.0],
            "kg m²",
            "the inertia added to each axis of a multibody's joints: without it light limbs whip",
        ),
        SLEEP,
    ],
    build: ragdolls,
};

/// The bodies of a ragdoll.
pub(super) const BODIES: usize = 11;
/// The distance between ragdolls. No ragdoll reaches further than half of it from its hips.
const PITCH_M: f64 = 2.2;
/// The depth and height of a step: steeper than friction holds.
const STEP_M: [f64; 2] = [0.45, 0.35];
/// The speed at which ragdolls start down the stairs.
const THROW_M_S: f32 = 3.0;
/// Length of the floor at the foot of the stairs, along x.
const LANDING_M: f64 = 10.0;

fn ragdolls(values: &Values) -> Result<Scene, SceneError> {
    let (count, height_m) = (values.count("count"), f64::from(values.number("height")));
    let side = (1..).find(|side| side * side >= count).expect("a square is large enough");
    let steps = (side as f64 * PITCH_M / STEP_M[0]).ceil() as usize;
    let [length_m, drop_m] = STEP_M.map(|m| m * steps as f64);
    let half_m = 0.5 * side as f64 * PITCH_M;
    let mut scene = Scene::empty("ragdolls");
    let stone = ColliderBuilder::ball(1.0).friction(0.5);
    for step in 0..steps {
        let top_m = drop_m - step as f64 * STEP_M[1];
        let centre = [(step as f64 + 0.5) * STEP_M[0], top_m - 1.0, 0.0];
        scene.push_fixed_box(centre, [0.5 * STEP_M[0] as f32, 1.0, half_m as f32 + 10.0], &stone);
    }
    let floor = [0.5 * LANDING_M as f32, 1.0, half_m as f32 + 20.0];
    scene.push_fixed_box([length_m + 0.5 * LANDING_M, -1.0, 0.0], floor, &stone);
    let mut dice = Dice::new(values.seed("seed"));
    let armature = [values.number("armature"); 6];
    let link = (values.count("multibody") == 1).then(|| LinkSettings { armature, ..LinkSettings::default() });
    for i in 0..count {
        let (row, column) = (i / side, i % side);
        let x = (row as f64 + 0.5) * PITCH_M;
        let stair_m = drop_m - (x / STEP_M[0]).floor() * STEP_M[1];
        let hips = [x, stair_m + height_m, (column as f64 + 0.5) * PITCH_M - half_m];
        ragdoll(&mut scene, hips, &mut dice, link);
    }
    scene.bounds = Bounds::new([0.0, 0.0, -half_m], [length_m + LANDING_M, drop_m + height_m + 1.0, half_m]);
    Ok(scene)
}

/// A part of a ragdoll: its shape, and its position from the hips when the ragdoll stands with arms stretched
/// out.
struct Part {
    at: [f32; 3],
    shape: ColliderBuilder,
}

/// The joint that ties a part to one before it.
struct Tie {
    a: usize,
    b: usize,
    at: [f32; 3],
    bend: Bend,
}

/// The range of a joint, radians.
enum Bend {
    /// About one axis, from and to.
    Hinge(Vector, [f32; 2]),
    /// This far to both sides about x, y and z.
    Ball([f32; 3]),
}

pub(super) fn ragdoll(scene: &mut Scene, hips: [f64; 3], dice: &mut Dice, multibody: Option<LinkSettings>) {
    let turn = dice.rotation(std::f32::consts::PI);
    let (throw, spin) = (Vector::X * THROW_M_S + dice.in_cube(1.0), dice.in_cube(3.0));
    let (first, parts) = (scene.bodies.len(), parts());
    for Part { at, shape } in &parts {
        let off = turn * Vector::from(*at);
        let place: [f64; 3] = std::array::from_fn(|i| hips[i] + f64::from(off[i]));
        // All parts turn as one.
        let body = RigidBodyBuilder::dynamic().linvel(throw + spin.cross(off)).angvel(spin);
        scene.push(world_pose(place, turn), body, shape.clone().density(1000.0).friction(0.5));
    }
    for Tie { a, b, at, bend } in ties() {
        let anchor = |part: usize| Vector::from(at) - Vector::from(parts[part].at);
        let joint: GenericJoint = match bend {
            Bend::Hinge(axis, limits) => RevoluteJointBuilder::new(axis)
                .local_anchor1(anchor(a))
                .local_anchor2(anchor(b))
                .limits(limits)
                .contacts_enabled(false)
                .into(),
            Bend::Ball(bends) => {
                let joint = SphericalJointBuilder::new()
                    .local_anchor1(anchor(a))
                    .local_anchor2(anchor(b))
                    .contacts_enabled(false);
                let axes = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].into_iter().zip(bends);
                axes.fold(joint, |joint, (axis, bend)| joint.limits(axis, [-bend, bend])).into()
            }
        };
        scene.joints.push(SceneJoint { a: first + a, b: first + b, joint, multibody });
    }
}

/// Returns the parts: hips, trunk, head; right and left: upper arm, forearm, thigh, shin.
fn parts() -> Vec<Part> {
    let part = |at, shape| Part { at, shape };
    let mut parts = vec![
        part([0.0, 0.0, 0.0], ColliderBuilder::cuboid(0.15, 0.08, 0.1)),
        part([0.0, 0.3, 0.0], ColliderBuilder::cuboid(0.16, 0.2, 0.1)),
        part([0.0, 0.64, 0.0], ColliderBuilder::ball(0.11)),
    ];
    for side in [-1.0, 1.0] {
        parts.push(part([side * 0.35, 0.44, 0.0], ColliderBuilder::capsule_x(0.11, 0.05)));
        parts.push(part([side * 0.67, 0.44, 0.0], ColliderBuilder::capsule_x(0.1, 0.04)));
        parts.push(part([side * 0.09, -0.3, 0.0], ColliderBuilder::capsule_y(0.14, 0.07)));
        parts.push(part([side * 0.09, -0.73, 0.0], ColliderBuilder::capsule_y(0.15, 0.05)));
    }
    parts
}

fn ties() -> Vec<Tie> {
    let tie = |a, b, at, bend| Tie { a, b, at, bend };
    let mut ties = vec![
        tie(0, 1, [0.0, 0.09, 0.0], Bend::Ball([0.6, 0.4, 0.4])),
        tie(1, 2, [0.0, 0.515, 0.0], Bend::Ball([0.6, 0.8, 0.4])),
    ];
    for (side, arm) in [(-1.0, 3), (1.0, 7)] {
        let (forearm, thigh, shin) = (arm + 1, arm + 2, arm + 3);
        // Turned about y, an arm comes forward.
        let elbow = if side < 0.0 { [0.0, 2.4] } else { [-2.4, 0.0] };
        ties.extend([
            tie(1, arm, [side * 0.18, 0.44, 0.0], Bend::Ball([0.8, 1.2, 1.2])),
            tie(arm, forearm, [side * 0.52, 0.44, 0.0], Bend::Hinge(Vector::Y, elbow)),
            tie(0, thigh, [side * 0.09, -0.085, 0.0], Bend::Ball([1.4, 0.4, 0.5])),
            tie(thigh, shin, [side * 0.09, -0.52, 0.0], Bend::Hinge(Vector::X, [0.0, 2.4])),
        ]);
    }
    ties
}
