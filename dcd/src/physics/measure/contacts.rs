//! Measures the contacts as the solver left them: their number, penetration, and force on the ground.
//!
//! Every region that holds both bodies of a contact may solve it. One region answers for it, so that each
//! contact is counted once, as it moves the body. This is the region that leads the dynamic body of the
//! lowest id, if it holds the other body, and otherwise the region that reports the contact, mostly that
//! body's owner. Where a body's mass is split among regions, each bears its part of the force, so that forces
//! are summed over all of them.

use rapier3d::geometry::ContactManifold;
use rapier3d::prelude::*;

use super::View;
use crate::physics::impulse::pair_impulse_ns;
use crate::physics::region::{Ownership, Region};
use crate::space::BodyId;

/// A summary of all contacts of a world in its last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactSample {
    /// The number of pairs of colliders that touch, of which at least one is on a dynamic body.
    pub pairs: usize,
    /// The deepest penetration, metres; 0 if nothing overlaps.
    pub max_penetration_m: f64,
    /// The force of normals and friction on fixed bodies, along gravity, newtons. Kinematic bodies are no
    /// ground.
    pub ground_force_n: f64,
    /// The weight of all enabled dynamic bodies, by their gravity scales, newtons.
    pub weight_n: f64,
}

impl ContactSample {
    /// Returns the ratio of the force on the ground to the weight: 1 at rest. `None` without weight.
    pub fn ground_force_ratio(&self) -> Option<f64> {
        (self.weight_n > 0.0).then(|| self.ground_force_n / self.weight_n)
    }

    /// Combines the samples of two parts of one world.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            pairs: self.pairs + other.pairs,
            max_penetration_m: self.max_penetration_m.max(other.max_penetration_m),
            ground_force_n: self.ground_force_n + other.ground_force_n,
            weight_n: self.weight_n + other.weight_n,
        }
    }
}

/// Returns the force of a contact pair for drawing, newtons; `None` if another region answers for the pair.
pub(crate) fn drawn_force_n(region: &Region, pair: &ContactPair) -> Option<[f64; 3]> {
    let view = View::Region(region);
    let is_told = answers(Side::of_pair(view, pair)) || is_pushed(region, pair);
    is_told.then(|| force_over_n(region.physics(), pair, solved_dt_s(view, pair)))
}

/// Returns whether neither body of a pair is dynamic and this region owns the movable one of the lowest id.
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

/// Returns the mean force of a contact pair on its second body, normals and friction, newtons. The mean is
/// over the step in which the pair was solved, of length `dt_s`.
///
/// Rapier keeps a normal's impulse of the whole step. Of friction, its default model keeps only what the
/// solver's last iteration applied (`warmstart_tangent_world`, the same for all points of a manifold). The
/// ratio of the step's friction to that of the last iteration is taken to be the ratio of their normals. That
/// is exact at rest, and never above the coefficient of friction times the normal force.
pub(super) fn force_over_n(world: &PhysicsWorld, pair: &ContactPair, dt_s: f32) -> [f64; 3] {
    pair_impulse_ns(world, pair).map(|v| v / f64::from(dt_s))
}

/// Returns the length of the step in which a pair was last solved, seconds. Two bodies that touch are both
/// asleep or both awake, so that either has this step.
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
            // A collider was removed since the step. Rapier forgets the pair in its next step.
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
    /// On a dynamic body: its id, whether the view's contacts are those that count for it, and whether the
    /// view has only a part of its mass.
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

/// Returns whether this view answers for the contact: whether its contacts are those that count for the
/// dynamic body of the lowest id.
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

/// Returns whether the contact is on a body of whose mass the view has a part. Every region with a part of
/// the mass bears a part of the force.
pub(super) fn has_part(sides: [Side; 2]) -> bool {
    sides.iter().any(|side| matches!(side, Side::Dynamic(_, _, true)))
}

/// Returns how deep two colliders overlap where their bodies are now, without their skins, metres.
///
/// Manifolds store the distances of the last full contact update, which Rapier skips while bodies hardly
/// move. The solver's anchors move with the bodies.
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
