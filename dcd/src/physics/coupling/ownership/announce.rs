//! Sends bodies that were inserted, or that a collision sped up, to the regions that they come near, before
//! these regions could have seen them.

use rapier3d::prelude::RigidBodyHandle;

use super::Decision;
use super::membership::tell;
use crate::physics::coupling::{Moment, Side, launch, predicted_contacts};
use crate::physics::region::{BodyRef, Ownership};
use crate::space::RegionSet;

/// Sends the bodies inserted since the last step to the regions that must hold them: all whose cell they come near.
pub(in crate::physics::coupling) fn announce(side: &mut Side, moment: Moment<'_>) {
    side.outbox.clear(moment.tick);
    side.region.update_assemblies();
    side.border.decisions.clear();
    let fresh = share_fresh(side, moment);
    let Side { region, border, outbox, .. } = side;
    predicted_contacts::look(region, &mut border.predicted, moment, &fresh);
    predicted_contacts::show(region, &mut border.predicted, &mut border.neighbours, outbox, moment);
}

/// Sends the bodies inserted here to all regions that they come near, since they may touch anything at once.
/// Bodies of islands that are computed whole go to no new region, unless they are fast; after membership has changed they go to the
/// regions that held copies of them, which follow as before. A body whose holders are at different times, as
/// a joint may cause, waits until they are at the same time. Returns all bodies inserted here.
pub(super) fn share_fresh(side: &mut Side, moment: Moment<'_>) -> Vec<RigidBodyHandle> {
    let fresh = side.region.take_fresh();
    for &link in &fresh {
        let region = &side.region;
        if region.slot(link.handle).role == Ownership::Owner && !region.is_articulated(link.handle) {
            share(side, moment, link);
        }
    }
    fresh.into_iter().map(|link| link.handle).collect()
}

/// Sends the bodies that a collision sped up in this step to the regions that they fly into in the next ones.
pub(super) fn share_sudden(side: &mut Side, moment: Moment<'_>) {
    for link in std::mem::take(&mut side.border.predicted.sudden) {
        let is_decided = side.border.decisions.iter().any(|decision| decision.link.id == link.id);
        // Too much of an assembly would be sent at every blow.
        let is_tied = side.region.slot(link.handle).assembly.is_some();
        if !is_decided
            && !is_tied
            && launch::flies_off(&side.region, &side.border, moment, link, launch::UNSEEN_TICKS, 0.0)
        {
            side.region.slot_mut(link.handle).whole = false;
            share(side, moment, link);
        }
    }
}

/// Sends a body to all regions that it comes near in the next tick, or in the next ticks if it is fast.
fn share(side: &mut Side, moment: Moment<'_>, link: BodyRef) {
    let Side { region, border, outbox, .. } = side;
    let (own, handle) = (RegionSet::only(region.rank()), link.handle);
    let (whole, partition) = (region.slot(handle).whole, moment.partition);
    let is_fast = |link: &BodyRef| {
        let velocity = region.physics().bodies[link.handle].linvel();
        launch::is_fast(region, link.handle, velocity, moment.settings.dt_s)
    };
    let is_fast = is_fast(&link) || launch::together(region, link).iter().any(is_fast);
    let ahead_s = if is_fast { launch::UNSEEN_TICKS } else { 1.0 } * moment.settings.dt_s;
    // That its island lies in one region holds for the tick in which it came: by the next it may be elsewhere.
    let near = match whole && !is_fast {
        true => RegionSet::EMPTY,
        false => launch::on_its_way(region, border, partition, link, ahead_s, partition.halo_m()),
    };
    let reached = border.neighbours.reached(region.rank(), near);
    let holders = reached.union(region.slot(handle).holders).without(own);
    // A region that is behind takes in no body, and does not apply its own decisions.
    if !holders.is_empty() && border.neighbours.are_behind(holders.union(own)) {
        border.neighbours.wait_for(holders);
        region.keep_fresh(link);
    } else if !holders.is_empty() {
        let members = holders.union(own);
        // A copy with a part of the mass that does not meet what the others meet would carry the body past
        // it. Whole copies follow the one that was stopped.
        let follows = moment.settings.coupling.moves_islands() && moment.settings.island_limit > 0;
        let warming = if whole || follows && is_fast { holders } else { RegionSet::EMPTY };
        tell(region, outbox, handle, holders, holders, members, warming, region.rank(), None);
        border.decisions.push(Decision { link, members, warming });
    } else if is_fast && reached != near {
        // All regions on its way are met in the next tick.
        region.keep_fresh(link);
    }
}
