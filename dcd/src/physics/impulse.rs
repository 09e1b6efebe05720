//! Reads from Rapier's contact pairs the impulses with which they pushed in the last step.

use rapier3d::dynamics::FrictionModel;
use rapier3d::geometry::ContactData;
use rapier3d::prelude::*;
use rapier3d::utils::OrthonormalBasis;

/// Returns the impulse of a contact pair on its second body in the last step, in newton seconds. It includes
/// friction as far as Rapier tells it: all of it with the Coulomb model; with the simplified one, that of the
/// last iteration, scaled to the step.
pub(super) fn pair_impulse_ns(world: &PhysicsWorld, pair: &ContactPair) -> [f64; 3] {
    let model = world.integration_parameters.friction_model;
    pair.solver_manifolds().iter().fold([0.0; 3], |sum, manifold| {
        let impulse = impulse_ns(manifold, model);
        std::array::from_fn(|i| sum[i] + impulse[i])
    })
}

/// Returns the impulse on the second body, in newton seconds.
fn impulse_ns(manifold: &ContactManifold, model: FrictionModel) -> [f64; 3] {
    let normal = manifold.data.normal;
    let step: f64 = solved_points(manifold).map(|data| f64::from(data.impulse)).sum();
    let friction = match model {
        FrictionModel::Simplified => last_friction(manifold, step),
        FrictionModel::Coulomb => friction(manifold),
    };
    // The normal points to the second body, but friction is kept for the first.
    std::array::from_fn(|i| step * f64::from(normal.to_array()[i]) - friction[i])
}

/// Returns the friction of the last iteration on the first body, which is all that Rapier keeps, times the
/// ratio of the step's normal impulse to that iteration's. Nothing is left of an impact in an earlier
/// iteration.
fn last_friction(manifold: &ContactManifold, step: f64) -> [f64; 3] {
    let last_iteration: f64 = solved_points(manifold).map(|data| f64::from(data.warmstart_impulse)).sum();
    // Without a normal there is no friction.
    let share = if last_iteration > 0.0 { step / last_iteration } else { 0.0 };
    // Each point has the friction of the whole manifold.
    let friction = solved_points(manifold).next().map_or(Vector::ZERO, |data| data.warmstart_tangent_world);
    friction.to_array().map(|v| share * f64::from(v))
}

/// Returns the friction of a step on the first body, which Rapier keeps by the axes of a basis around the normal.
fn friction(manifold: &ContactManifold) -> [f64; 3] {
    let direction = -manifold.data.normal;
    let first = direction.orthonormal_vector();
    let axes = [first, direction.cross(first)];
    solved_points(manifold).fold([0.0; 3], |sum, data| {
        let impulse = axes[0] * data.tangent_impulse.x + axes[1] * data.tangent_impulse.y;
        std::array::from_fn(|i| sum[i] + f64::from(impulse.to_array()[i]))
    })
}

/// Returns the points of a manifold that the solver selected. Other points keep stale impulses, so that sums
/// must not go over all points.
pub(super) fn solved_points(manifold: &ContactManifold) -> impl Iterator<Item = &ContactData> {
    let ids = manifold.data.solver_contacts.iter().map(|contact| contact.contact_indices()[0] as usize);
    ids.filter_map(|id| manifold.points.get(id)).map(|point| &point.data)
}
