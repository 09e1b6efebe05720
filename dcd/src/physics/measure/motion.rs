//! Computes the energy and momentum of a world, summed in 64 bits.

use rapier3d::prelude::*;

use super::View;
use super::convert;

pub(super) fn energy_j(view: View<'_>) -> f64 {
    let gravity = view.physics().gravity.to_array().map(f64::from);
    taking_part(view)
        .map(|(parts, body)| parts * (kinetic_j(&body) + potential_j(view, &body, gravity)))
        .sum()
}

pub(super) fn momentum_kgms(view: View<'_>) -> [f64; 3] {
    taking_part(view).fold([0.0; 3], |sum, (parts, body)| {
        let (mass, velocity) = (parts * f64::from(body.mass()), body.linvel().to_array());
        std::array::from_fn(|i| sum[i] + mass * f64::from(velocity[i]))
    })
}

/// Returns the enabled dynamic bodies with their masses, each with the number of parts into which its mass is
/// split. Rapier computes masses in the first step only, but a world can be measured before it.
fn taking_part(view: View<'_>) -> impl Iterator<Item = (f64, RigidBody)> {
    let colliders = &view.physics().colliders;
    view.owned_handles().filter(|(_, body)| body.is_dynamic() && body.is_enabled()).map(
        move |(handle, body)| {
            let mut body = body.clone();
            body.recompute_mass_properties_from_colliders(colliders);
            (view.parts(handle), body)
        },
    )
}

fn kinetic_j(body: &RigidBody) -> f64 {
    let local = &body.mass_properties().local_mprops;
    // The tensor of inertia is diagonal in the principal frame.
    let world_from_principal = *body.rotation() * local.principal_inertia_local_frame;
    let spin = (world_from_principal.inverse() * body.angvel()).to_array();
    let inertia = local.principal_inertia().to_array();
    let rotation: f64 = (0..3).map(|i| f64::from(inertia[i]) * f64::from(spin[i]).powi(2)).sum();
    let translation: f64 = body.linvel().to_array().iter().map(|&v| f64::from(v).powi(2)).sum();
    0.5 * (f64::from(body.mass()) * translation + rotation)
}

fn potential_j(view: View<'_>, body: &RigidBody, gravity: [f64; 3]) -> f64 {
    let centre = convert::world_point(view.anchor(), body.center_of_mass());
    let height: f64 = (0..3).map(|i| gravity[i] * centre[i]).sum();
    -f64::from(body.mass()) * f64::from(body.gravity_scale()) * height
}
