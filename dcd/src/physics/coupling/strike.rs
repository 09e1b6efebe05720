//! Tells of contacts that not all regions see. Bodies that touch may be held by unlike regions: one that nobody expected is held by
//! its owner alone, and at the corner of three regions each pair of them shares others. A body follows the copy of one region, which
//! may know nothing of what has struck it elsewhere. So the impulse is sent along, and added: what one body loses the other gains.
//! The copy of a new holder is told in the same way what happened in the exchange in which it was sent.
//!
//! Of a normal impulse Rapier tells exactly, of friction in an impact about (`measure`).

use rapier3d::prelude::*;

use super::shared::SharedBodies;
use crate::physics::convert;
use crate::physics::measure::pair_impulse_ns;
use crate::physics::region::{Ownership, Region};
use crate::protocol::{CopyState, Impulse, Strike, Velocity};
use crate::space::RegionSet;

/// Returns what struck a copy here in the last step of bodies that are owned here and that not all of these regions hold.
pub(super) fn on(region: &Region, handle: RigidBodyHandle, members: RegionSet) -> Vec<Strike> {
    let (world, id) = (region.physics(), region.slot(handle).id);
    let centre = world.bodies[handle].center_of_mass();
    let mut strikes: Vec<Strike> = Vec::new();
    region.for_each_pair(handle, |other, pair| {
        let Some(pair) = pair.filter(|pair| pair.has_any_active_contact()) else { return };
        let slot = region.slot(other);
        let held_by = slot.holders.union(RegionSet::only(region.rank()));
        if slot.role != Ownership::Owner || members.without(held_by).is_empty() {
            return;
        }
        let impulse = Vector::from_array(pair_impulse_ns(world, pair).map(|v| v as f32));
        let is_second = world.colliders[pair.collider2].parent() == Some(handle);
        let impulse = if is_second { impulse } else { -impulse };
        let arm = contact_point(world, pair).map_or(Vector::ZERO, |at| at - centre);
        let impulse = Impulse { linear: impulse.to_array(), angular: arm.cross(impulse).to_array() };
        match strikes.iter_mut().find(|strike| strike.held_by == held_by) {
            _ if impulse == Impulse::default() => {}
            Some(strike) => strike.impulse = strike.impulse.plus(&impulse),
            None => strikes.push(Strike { id, held_by, impulse }),
        }
    });
    strikes
}

/// Notes what others made of a copy in this exchange, where it has been sent to new members as it was before: these are to be told.
pub(super) fn owe(region: &Region, all: &mut SharedBodies, handle: RigidBodyHandle, members: RegionSet) {
    let body = &region.physics().bodies[handle];
    let Some(shared) = all.get_mut(handle).filter(|shared| !shared.is_split() && body.is_dynamic()) else {
        return;
    };
    let held_by = members.intersection(shared.members);
    let sent = &shared.own.velocity;
    let (linear, angular) =
        (body.linvel() - convert::vector(sent.linear), body.angvel() - convert::vector(sent.angular));
    if held_by == members || (linear, angular) == (Vector::ZERO, Vector::ZERO) {
        return;
    }
    let local = &body.mass_properties().local_mprops;
    let rotation = *body.rotation() * local.principal_inertia_local_frame;
    let angular = rotation * (local.principal_inertia() * (rotation.inverse() * angular));
    let impulse = Impulse { linear: (linear / local.inv_mass).to_array(), angular: angular.to_array() };
    let is_finite = impulse.linear.iter().chain(&impulse.angular).all(|v| v.is_finite());
    shared.owed = is_finite.then_some(Strike { id: shared.own.id, held_by, impulse });
}

/// Stores what struck copies in another region.
pub(super) fn hear(region: &Region, shared: &mut SharedBodies, strikes: &[Strike], sender: usize) {
    for strike in strikes {
        let shared = region.handle_of(strike.id).and_then(|handle| shared.get_mut(handle));
        if let Some(shared) = shared {
            shared.strikes.push((sender, *strike));
        }
    }
}

/// Returns the velocity of a leader's copy after what the leader did not see; none if there was no such thing. All regions add it up in
/// the same order, to the same bits.
pub(super) fn struck(
    body: &RigidBody,
    copy: &CopyState,
    leader: usize,
    strikes: &mut [(usize, Strike)],
) -> Option<Velocity> {
    strikes.sort_by_key(|(rank, strike)| (*rank, strike.held_by));
    let unseen = strikes.iter().filter(|(_, strike)| !strike.held_by.contains(leader));
    let sum = unseen.map(|(_, strike)| strike.impulse).reduce(|sum, impulse| sum.plus(&impulse))?;
    let local = &body.mass_properties().local_mprops;
    let rotation = Rotation::from_array(copy.pose.rotation) * local.principal_inertia_local_frame;
    let turned = rotation.inverse() * convert::vector(sum.angular);
    let linear = convert::vector(copy.velocity.linear) + convert::vector(sum.linear) * local.inv_mass;
    let angular = convert::vector(copy.velocity.angular) + rotation * (local.inv_principal_inertia * turned);
    Some(Velocity { linear: linear.to_array(), angular: angular.to_array() })
}

/// Returns where a pair touches: the mean of its contact points, weighed by their impulses.
fn contact_point(world: &PhysicsWorld, pair: &ContactPair) -> Option<Vector> {
    let place = world.colliders[pair.collider1].position();
    let points = pair.manifolds().iter().flat_map(|manifold| {
        let from = manifold.subshape_pos1().map_or(*place, |sub| *place * *sub);
        manifold.points.iter().map(move |point| (from * point.local_p1, point.data.impulse))
    });
    let (sum, weight) =
        points.fold((Vector::ZERO, 0.0), |(sum, weight), (at, by)| (sum + at * by, weight + by));
    (weight > 0.0).then(|| sum / weight)
}
