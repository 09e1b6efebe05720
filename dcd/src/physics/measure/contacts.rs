//! Measures the contacts as the solver left them: their number, penetration, and force on the ground.
//!
//! A contact may be solved in several regions, wherever both bodies are held. The region that leads the dynamic body of the lowest
//! id answers for it, or else that body's owner, so that each is counted once, as it moves the body. Where a body's mass is split among regions, each bears its part of the force,
//! so forces are summed over all of them.

use rapier3d::geometry::ContactManifold;
use rapier3d::prelude::*;

use super::View;
use crate::physics::impulse::pair_impulse_ns;
use crate::physics::region::{Ownership, Region};
use crate::space::BodyId;

/// A summary of all contacts of a world in its last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactSample {
    /// Pairs of colliders that touch, of which at least one is on a dynamic body.
    pub pairs: usize,
    /// Deepest penetration, in metres; 0 when nothing overlaps.
    pub max_penetration_m: f64,
    /// Force on fixed bodies along gravity, in newtons: of normals and of friction. Kinematic bodies are no ground.
    pub ground_force_n: f64,
    /// Weight of all enabled dynamic bodies, in newtons, by their gravity scales.
    pub weight_n: f64,
}

impl ContactSample {
    /// Returns the force on the ground over the weight: 1 at rest. `None` without weight.
    pub fn ground_force_ratio(&self) -> Option<f64> {
        (self.weight_n > 0.0).then(|| self.ground_force_n / self.weight_n)
    }

    /// Adds up the samples of two parts of one world.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            pairs: self.pairs + other.pairs,
            max_penetration_m: self.max_penetration_m.max(other.max_penetration_m),
            ground_force_n: self.ground_force_n + other.ground_force_n,
            weight_n: self.weight_n + other.weight_n,
        }
    }
}

/// Returns the force of a contact pair, as a drawing shows it, in newtons; `None` where another region answers for the pair.
pub(crate) fn drawn_force_n(region: &Region, pair: &ContactPair) -> Option<[f64; 3]> {
    let view = View::Region(region);
    let is_told = answers(Side::of_pair(view, pair)) || is_pushed(region, pair);
    is_told.then(|| force_over_n(region.physics(), pair, solved_dt_s(view, pair)))
}

/// Returns whether no end of a pair is dynamic, and this region owns the first that is kinematic.
pub(super) fn is_pushed(region: &Region, pair: &ContactPair) -> bool {
    let world = region.physics();
    let parents = [pair.collider1, pair.collider2].map(|collider| world.colliders.get(collider)?.parent());
    let dynamic = |handle: &RigidBodyHandle| world.bodies.get(*handle).is_some_and(RigidBody::is_dynamic);
    let mut movable: Vec<_> = parents
        .into_iter()
        .flatten()
        .filter_map(|handle| region.role_of(handle))
        .filter(|(_, role)| *role != Ownership::Immovable)
        .collect();
    movable.sort_unstable_by_key(|(id, _)| *id);
    !parents.iter().flatten().any(dynamic)
        && movable.first().is_some_and(|(_, role)| *role == Ownership::Owner)
}

/// Returns the mean force of a contact pair on its second body over the step in which it was solved, whose length it is given, in newtons:
/// normals and friction.
///
/// Of a normal, Rapier keeps the impulse of the whole step. Of friction, its default model keeps only what the last of the
/// solver's iterations applied (`warmstart_tangent_world`, the same for all points of a manifold), so the step's friction
/// is taken to be to that as the step's normals are to the last iteration's. That is exact at rest, and never above the
/// coefficient of friction times the normal force.
pub(super) fn force_over_n(world: &PhysicsWorld, pair: &ContactPair, dt_s: f32) -> [f64; 3] {
    pair_impulse_ns(world, pair).map(|v| v / f64::from(dt_s))
}

/// Returns the length of the step in which a pair was solved last, in seconds. Of two that touch, both sleep or none does.
pub(super) fn solved_dt_s(view: View<'_>, pair: &ContactPair) -> f32 {
    let world = view.physics();
    let parents = [pair.collider1, pair.collider2].map(|collider| world.colliders.get(collider)?.parent());
    let dynamic = |handle: &RigidBodyHandle| world.bodies.get(*handle).is_some_and(RigidBody::is_dynamic);
    let handle = parents.into_iter().flatten().find(dynamic);
    handle.map_or(world.integration_parameters.dt, |handle| view.solved_dt_s(handle))
}

pub(super) fn sample(view: View<'_>) -> ContactSample {
    let world = view.physics();
    let down = world.gravity.normalize_or_zero().to_array().map(f64::from);
    let gravity = f64::from(world.gravity.length());
    let mut sample = ContactSample::default();
    for (handle, body) in view.owned_handles().filter(|(_, body)| body.is_dynamic() && body.is_enabled()) {
        let mass = view.parts(handle) * f64::from(body.mass());
        sample.weight_n += mass * f64::from(body.gravity_scale()) * gravity;
    }
    for pair in world.contact_pairs() {
        let colliders = [pair.collider1, pair.collider2];
        if colliders.iter().any(|&collider| world.colliders.get(collider).is_none()) {
            // Removed since the step; Rapier forgets the pair in the next one.
            continue;
        }
        let sides = Side::of_pair(view, pair);
        if !pair.has_any_active_contact() || !(answers(sides) || has_part(sides)) {
            continue;
        }
        sample.max_penetration_m = sample.max_penetration_m.max(penetration_m(world, pair));
        sample.pairs += usize::from(answers(sides));
        if let Some(fixed) = sides.iter().position(|side| *side == Side::Fixed) {
            let sign = if fixed == 1 { 1.0 } else { -1.0 };
            let force = force_over_n(world, pair, solved_dt_s(view, pair));
            sample.ground_force_n += sign * (0..3).map(|i| down[i] * force[i]).sum::<f64>();
        }
    }
    sample
}

pub(super) fn penetrations_m(view: View<'_>) -> Vec<f64> {
    let world = view.physics();
    let answered = |pair: &&ContactPair| {
        let colliders = [pair.collider1, pair.collider2];
        let there = colliders.iter().all(|&collider| world.colliders.get(collider).is_some());
        there && pair.has_any_active_contact() && answers(Side::of_pair(view, pair))
    };
    world.contact_pairs().filter(answered).map(|pair| penetration_m(world, pair)).collect()
}

/// One end of a contact pair.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Side {
    /// On a dynamic body, by its id; whether the view solves what counts of it, and whether it has only a part of it.
    Dynamic(BodyId, bool, bool),
    /// On a fixed body, or on none.
    Fixed,
    Kinematic,
}

impl Side {
    /// Returns the two ends of a pair.
    pub(super) fn of_pair(view: View<'_>, pair: &ContactPair) -> [Self; 2] {
        let world = view.physics();
        let parent = |collider| world.colliders.get(collider).and_then(Collider::parent);
        let (first, second) = (parent(pair.collider1), parent(pair.collider2));
        [Self::of(view, first, second), Self::of(view, second, first)]
    }

    fn of(view: View<'_>, body: Option<RigidBodyHandle>, other: Option<RigidBodyHandle>) -> Self {
        let of_body = body.and_then(|handle| Some((handle, view.physics().bodies.get(handle)?)));
        let Some((handle, body)) = of_body else {
            return Self::Fixed;
        };
        match view.name(handle) {
            Some(id) if body.is_dynamic() => {
                let has_part = view.parts(handle) > 1.0 && view.counts(handle);
                Self::Dynamic(id, view.solves(handle, other), has_part)
            }
            _ if body.is_fixed() => Self::Fixed,
            _ => Self::Kinematic,
        }
    }
}

/// Returns whether this view answers for the contact: it solves what counts of the dynamic body of the lowest id.
pub(super) fn answers(sides: [Side; 2]) -> bool {
    match sides {
        [Side::Dynamic(a, solves_a, _), Side::Dynamic(b, solves_b, _)] => {
            if a <= b {
                solves_a
            } else {
                solves_b
            }
        }
        [Side::Dynamic(_, solves, _), _] | [_, Side::Dynamic(_, solves, _)] => solves,
        _ => false,
    }
}

/// Returns whether the contact is on a body of which the view has a part: then every region that has one bears a part of the
/// force.
pub(super) fn has_part(sides: [Side; 2]) -> bool {
    sides.iter().any(|side| matches!(side, Side::Dynamic(_, _, true)))
}

/// Returns how deep the two colliders overlap where their bodies are now, in metres, without their skins.
///
/// The distances that manifolds store are those of the last full contact update, which Rapier skips while bodies hardly
/// move; the solver's anchors ride with the bodies.
fn penetration_m(world: &PhysicsWorld, pair: &ContactPair) -> f64 {
    let skin = |collider| world.colliders.get(collider).map_or(0.0, Collider::contact_skin);
    let skins_m = f64::from(skin(pair.collider1) + skin(pair.collider2));
    let depth_m = |manifold: &ContactManifold, contact: &SolverContact| {
        let (on_first, on_second) = manifold.data.solver_contact_world_points(contact, &world.bodies);
        -f64::from((on_second - on_first).dot(manifold.data.normal)) - skins_m
    };
    pair.solver_manifolds()
        .iter()
        .flat_map(|manifold| manifold.data.solver_contacts.iter().map(move |c| depth_m(manifold, c)))
        .fold(0.0, f64::max)
}
