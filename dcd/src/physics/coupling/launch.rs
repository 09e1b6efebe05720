//! Shares what flies off all of a sudden with the regions that it flies into, before it does: nobody has predicted what it meets there. It
//! follows the copy that is stopped first (`consensus`).
//!
//! A world that exchanges messages before a tick announces what its user sped up like what its user inserted. Regions of several processes have no such
//! exchange: there it stays where it is for that tick, and is shared at its end. What is sped up by a collision is shared at the end of that
//! tick everywhere.

use std::collections::BTreeSet;

use rapier3d::prelude::*;

use super::{Moment, Side};
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::space::{Bounds, RegionSet};

/// Returns whether a body moves by more than its own radius in a tick: it may jump over what it would hit.
pub(super) fn is_fast(region: &Region, handle: RigidBodyHandle, velocity: Vector, tick_s: f32) -> bool {
    let way_m = velocity.length() * tick_s;
    way_m > region.slot(handle).reach_m && way_m.is_finite()
}

/// Returns the regions that a body comes to in the next tick, within a margin.
pub(super) fn on_its_way(
    region: &Region,
    partition: &Partition,
    handle: RigidBodyHandle,
    tick_s: f32,
    margin_m: f64,
) -> RegionSet {
    let bounds = match region.slot(handle).reach_m.is_finite() {
        true => region.world_bounds(handle),
        false => Bounds::around([0.0; 3], [f64::INFINITY; 3]),
    };
    let velocity = region.physics().bodies[handle].linvel().to_array();
    partition.touching(&bounds.swept(velocity, tick_s.into()).grown(margin_m))
}

/// Has those announced that their user sped up since the last step and that fly into other regions at once.
pub(super) fn expect(side: &mut Side, moment: Moment<'_>) {
    let region = &mut side.region;
    let launched = region.take_launched();
    if launched.is_empty() {
        return;
    }
    let mut known: BTreeSet<_> = region.fresh().map(|link| link.id).collect();
    for link in launched {
        if flies_off(region, moment, link, moment.partition.halo_m()) && known.insert(link.id) {
            // Its island, or what that comes to meet, may not lie in one region.
            region.slot_mut(link.handle).whole = false;
            region.keep_fresh(link);
        }
    }
}

/// Keeps those where they are for a tick that nobody has been told of and that fly into other regions.
pub(super) fn hold(side: &mut Side, moment: Moment<'_>) {
    expect(side, moment);
    let Side { region, border, .. } = side;
    border.held_back.clear();
    let is_held = |link: &BodyRef| {
        // What a joint ties it to does not wait.
        flies_off(region, moment, *link, moment.partition.halo_m())
            && region.joints_of(link.handle).next().is_none()
    };
    let held: Vec<_> = region.fresh().filter(is_held).collect();
    for BodyRef { handle, .. } in held {
        let body = &mut region.world_mut().bodies[handle];
        border.held_back.push((handle, body.linvel()));
        body.set_linvel(Vector::ZERO, false);
    }
}

/// Gives them back their velocity.
pub(super) fn release(side: &mut Side) {
    let Side { region, border, .. } = side;
    for (handle, velocity) in std::mem::take(&mut border.held_back) {
        if let Some(body) = region.world_mut().bodies.get_mut(handle) {
            let velocity = body.linvel() + velocity;
            body.set_linvel(velocity, true);
        }
    }
}

/// Returns whether a body flies to within a margin of regions that do not hold it, in the next tick, and is no other's.
pub(super) fn flies_off(region: &Region, moment: Moment<'_>, link: BodyRef, margin_m: f64) -> bool {
    let BodyRef { id, handle } = link;
    let (held, tick_s) = (region.physics().bodies.get(handle), moment.settings.dt_s);
    let Some(body) = held.filter(|_| region.role_of(handle) == Some((id, Ownership::Owner))) else {
        return false;
    };
    body.is_dynamic()
        && !region.is_articulated(handle)
        && region.slot(handle).holders.is_empty()
        && is_fast(region, handle, body.linvel(), tick_s)
        && on_its_way(region, moment.partition, handle, tick_s, margin_m) != RegionSet::only(region.rank())
}
