//! Places one or many copies of a model as a scene.

use rapier3d::prelude::*;

use super::mass::weightless;
use super::{Model, ModelParams};
use crate::protocol::WorldPose;
use crate::scene::model::world_pose;
use crate::scene::{Scene, SceneBody, SceneJoint};
use crate::space::Bounds;

/// Margin around the bodies.
const MARGIN_M: f64 = 1.0;
/// Gap between copies, as a fraction of their size.
const ROOM: f64 = 0.2;
/// Least distance of copies without size.
const LEAST_SPACING_M: f64 = 0.2;

/// Places the copies in rows, first along x, then y.
pub(super) fn place(model: Model, params: &ModelParams) -> Scene {
    let mut scene = Scene::empty(&model.name);
    scene.gravity = model.gravity;
    scene.dt_s = if params.dt_s > 0.0 { params.dt_s } else { model.dt_s.unwrap_or(scene.dt_s) };
    scene.solver_iterations = params.iterations;
    let bodies = bodies_of(&model, params.sleep);
    let joints = model.scene_joints();
    let around = bodies.iter().map(SceneBody::bounds).filter(Bounds::is_finite).reduce(|a, b| a.union(&b));
    let size = around.map_or([0.0; 3], |b| std::array::from_fn(|i| b.max[i] - b.min[i]));
    let spacing = [size[0], size[1]].map(|size| match params.spacing_m {
        0.0 => (size * (1.0 + ROOM)).max(LEAST_SPACING_M),
        given => given,
    });
    let columns = (params.copies as f64).sqrt().ceil() as usize;
    for copy in 0..params.copies {
        let (column, row) = (copy % columns, copy / columns);
        let offset = [spacing[0] * column as f64, spacing[1] * row as f64, params.height_m];
        add_copy(&mut scene, &bodies, &joints, copy, offset);
    }
    if params.ground {
        let lowest = around.map_or(0.0, |bounds| bounds.min[2]);
        let ground = ColliderBuilder::new(SharedShape::halfspace(Vector::Z))
            .collision_groups(InteractionGroups::new(Group::ALL, Group::ALL, InteractionTestMode::Or));
        scene.push(WorldPose::at([0.0, 0.0, lowest.min(0.0)]), RigidBodyBuilder::fixed(), ground);
    }
    scene.bounds = scene.tight_bounds().unwrap_or(Bounds::around([0.0; 3], [0.0; 3])).grown(MARGIN_M);
    scene.warnings = model.warnings.lines();
    scene
}

fn bodies_of(model: &Model, sleep: bool) -> Vec<SceneBody> {
    let bodies = model.parts.iter().map(|part| SceneBody {
        pose: world_pose(part.pose.translation.to_array().map(f64::from), part.pose.rotation),
        body: part.body.clone().additional_mass_properties(part.mass).can_sleep(sleep),
        colliders: match part.is_dynamic() {
            true => part.colliders.iter().map(weightless).collect(),
            false => part.colliders.clone(),
        },
    });
    bodies.collect()
}

/// Adds a copy. Infinite colliders are placed once, with the first copy. A body that has no others is then
/// left out of further copies, unless a joint ties it.
fn add_copy(scene: &mut Scene, bodies: &[SceneBody], joints: &[SceneJoint], copy: usize, offset: [f64; 3]) {
    let mut placed = vec![None; bodies.len()];
    for (index, body) in bodies.iter().enumerate() {
        let mut body = body.clone();
        for (place, offset) in body.pose.translation.iter_mut().zip(offset) {
            *place += offset;
        }
        if copy == 0 && body.body.body_type == RigidBodyType::Fixed && offset[2] != 0.0 {
            // A floor stays where it is when the model is lifted.
            body = lowered(body, offset[2]);
        }
        if copy > 0 {
            let infinite = |collider: &ColliderBuilder| collider.shape.as_halfspace().is_some();
            body.colliders.retain(|collider| !infinite(collider));
            let tied = joints.iter().any(|joint| joint.a == index || joint.b == index);
            let was_there = bodies[index].colliders.iter().any(infinite);
            if body.colliders.is_empty() && was_there && !tied {
                continue;
            }
        }
        placed[index] = Some(scene.bodies.len());
        scene.bodies.push(body);
    }
    for &SceneJoint { a, b, joint, multibody } in joints {
        if let (Some(a), Some(b)) = (placed[a], placed[b]) {
            scene.joints.push(SceneJoint { a, b, joint, multibody });
        }
    }
}

fn lowered(mut body: SceneBody, by_m: f64) -> SceneBody {
    let turn = Pose::from_rotation(Rotation::from_array(body.pose.rotation));
    let down = turn.inverse() * Vector::new(0.0, 0.0, -by_m as f32);
    for collider in &mut body.colliders {
        if collider.shape.as_halfspace().is_some() {
            collider.position.translation += down;
        }
    }
    body
}
