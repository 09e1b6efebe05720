//! Reads from Rapier's contact pairs by which impulses they pushed in the last step.

use rapier3d::dynamics::FrictionModel;
use rapier3d::geometry::ContactData;
use rapier3d::prelude::*;

/// Returns the impulse of a contact pair on its second body in the last step, in newton seconds, with friction as far as Rapier tells.
pub(super) fn pair_impulse_ns(world: &PhysicsWorld, pair: &ContactPair) -> [f64; 3] {
    let model = world.integration_parameters.friction_model;
    pair.solver_manifolds().iter().fold([0.0; 3], |sum, manifold| {
        let impulse = impulse_ns(manifold, model);
        std::array::from_fn(|i| sum[i] + impulse[i])
    })
}

/// Returns the impulse on the second body, in newton seconds.
fn impulse_ns(manifold: &ContactManifold, model: FrictionModel) -> [f64; 3] {
    let solved = || solved_points(manifold);
    let step: f64 = solved().map(|data| f64::from(data.impulse)).sum();
    let last_iteration: f64 = solved().map(|data| f64::from(data.warmstart_impulse)).sum();
    let points = match model {
        FrictionModel::Simplified => 1,
        FrictionModel::Coulomb => usize::MAX,
    };
    // Without a normal there is no friction.
    let share = if last_iteration > 0.0 { step / last_iteration } else { 0.0 };
    let friction = solved().take(points).fold([0.0; 3], |sum, data| {
        let tangent = data.warmstart_tangent_world.to_array();
        std::array::from_fn(|i| sum[i] + share * f64::from(tangent[i]))
    });
    let normal = manifold.data.normal.to_array();
    // The normal points to the second body; the stored friction acts on the first.
    std::array::from_fn(|i| step * f64::from(normal[i]) - friction[i])
}

/// Returns the points of a manifold that the solver selected. Others keep stale impulses, so these must not be summed over all points.
pub(super) fn solved_points(manifold: &ContactManifold) -> impl Iterator<Item = &ContactData> {
    let ids = manifold.data.solver_contacts.iter().map(|contact| contact.contact_indices()[0] as usize);
    ids.filter_map(|id| manifold.points.get(id)).map(|point| &point.data)
}
