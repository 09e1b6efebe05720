//! Shares a body that suddenly flies off with the regions that it flies into, before it gets there: nobody
//! has predicted what it meets. The body follows the copy that is stopped first (`consensus`).
//!
//! A world that exchanges messages before a tick announces a body that its user sped up like a body that its
//! user inserted. Regions of several processes have no such exchange: there the body stays where it is for
//! that tick, and is shared at its end. A body that a collision sped up is shared at the end of that tick
//! everywhere.

use std::collections::BTreeSet;

use rapier3d::prelude::*;

use super::{Moment, Side};
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::CopyState;
use crate::space::{Bounds, RegionSet};

/// The distance, metres, by which a copy of a body in flight must be behind another to count as stopped.
const STOPPED_M: f32 = 0.01;

/// Returns whether a body moves by more than its own radius in a tick: it may jump over what it would hit.
pub(super) fn is_fast(region: &Region, handle: RigidBodyHandle, velocity: Vector, tick_s: f32) -> bool {
    let way_m = velocity.length() * tick_s;
    way_m > region.slot(handle).reach_m && way_m.is_finite()
}

/// Returns a body and all that joints tie to it; nothing where no joint does. These are shared alike, or
/// regions would not follow the same copy of all of them.
pub(super) fn together(region: &Region, link: BodyRef) -> &[BodyRef] {
    let assembly = region.slot(link.handle).assembly;
    assembly.map_or(&[], |place| &region.assemblies()[place as usize].members)
}

/// Returns the regions that a body, or what joints tie it to, comes to in the next tick, within a margin.
pub(super) fn on_its_way(
    region: &Region,
    partition: &Partition,
    link: BodyRef,
    tick_s: f32,
    margin_m: f64,
) -> RegionSet {
    let all = together(region, link).iter().chain(std::iter::once(&link));
    let of = |link: &BodyRef| way_of(region, partition, link.handle, tick_s, margin_m);
    all.map(of).fold(RegionSet::EMPTY, RegionSet::union)
}

fn way_of(
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

/// Marks for announcement the bodies that their user has sped up since the last step and that fly into other
/// regions at once.
pub(super) fn expect(side: &mut Side, moment: Moment<'_>) {
    let region = &mut side.region;
    let launched = region.take_launched();
    if launched.is_empty() {
        return;
    }
    // Some of the tied bodies may be gone.
    region.update_assemblies();
    let mut known: BTreeSet<_> = region.fresh().map(|link| link.id).collect();
    for link in launched {
        if !flies_off(region, moment, link, moment.partition.halo_m()) {
            continue;
        }
        let tied = together(region, link).to_vec();
        for link in tied.into_iter().chain([link]).filter(|link| known.insert(link.id)) {
            // Its island, or what that island comes to meet, may not lie in one region.
            region.slot_mut(link.handle).whole = false;
            region.keep_fresh(link);
        }
    }
}

/// Holds in place for a tick the bodies that fly into other regions and that nobody has been told of.
pub(super) fn hold(side: &mut Side, moment: Moment<'_>) {
    expect(side, moment);
    let Side { region, border, .. } = side;
    border.held_back.clear();
    if region.fresh().next().is_none() {
        return;
    }
    region.update_assemblies();
    let is_held = |link: &BodyRef| {
        // A body that a joint ties to it would not wait.
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

/// Gives the bodies held in place by [`hold`] their velocity back.
pub(super) fn release(side: &mut Side) {
    let Side { region, border, .. } = side;
    for (handle, velocity) in std::mem::take(&mut border.held_back) {
        if let Some(body) = region.world_mut().bodies.get_mut(handle) {
            let velocity = body.linvel() + velocity;
            body.set_linvel(velocity, true);
        }
    }
}

/// Returns whether a body owned here, which no other region holds, flies in the next tick to within a margin
/// of other regions.
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
        && on_its_way(region, moment.partition, link, tick_s, margin_m) != RegionSet::only(region.rank())
}

/// Returns how far, in micrometres, a copy of a fast body is behind another one because it was stopped on its
/// way in the last tick. Rapier stops a flying body where it is about to hit something, and lets it touch
/// that in the next step. Returns 0 for copies that are side by side, farther apart than a tick takes them,
/// or slow.
pub(super) fn stopped_um(ahead: &CopyState, copy: &CopyState, reach_m: f32, tick_s: f32) -> i64 {
    let way_m = way_m(ahead, tick_s);
    if way_m <= reach_m {
        return 0;
    }
    let motion = Vector::from_array(ahead.velocity.linear);
    let apart = |i: usize| (ahead.pose.translation[i] - copy.pose.translation[i]) as f32;
    let behind_m = Vector::from_array(std::array::from_fn(apart)).dot(motion.normalize_or_zero());
    if (STOPPED_M..=1.01 * way_m).contains(&behind_m) { (behind_m * 1e6) as i64 } else { 0 }
}

/// Returns how far a copy flies in a tick, metres.
pub(super) fn way_m(copy: &CopyState, tick_s: f32) -> f32 {
    Vector::from_array(copy.velocity.linear).length() * tick_s
}
