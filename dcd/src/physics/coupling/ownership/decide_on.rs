//! Decides on one body, by the membership that it should have and the one that it has: who holds it from now
//! on, which copies count, and whether another region owns it.

use rapier3d::prelude::RigidBodyHandle;

use super::contact_poses::ContactPoses;
use super::desired::Desired;
use super::membership::tell;
use super::ready::{SETTLE_TICKS, note_away};
use super::{Decision, is_among};
use crate::physics::coupling::{Moment, Side, launch};
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyKind, BodyRecord, Transfer};
use crate::space::RegionSet;

/// Ticks for which a region keeps a body that it no longer has a reason to hold.
const KEEP_TICKS: u32 = 10;
/// Ticks for which no region drops a body after its owner or its holders have changed. Only by then has a
/// new owner shown the body to all regions that may have something near it, and heard of that. A body dropped
/// at once could hit, in the new owner's region alone, a body that has just been sent there and whose owner
/// feels nothing.
const NOTICE_TICKS: u32 = 2;

/// Decides on one body. Returns it with its new owner if it is to be transferred at once.
pub(super) fn decide_on(
    side: &mut Side,
    moment: Moment<'_>,
    link: BodyRef,
    mut desired: Desired,
    contact_poses: &mut ContactPoses,
) -> Option<(BodyRef, usize)> {
    let Side { region, border, outbox, .. } = side;
    let own_rank = region.rank();
    let own = RegionSet::only(own_rank);
    if desired.owner != own_rank && !desired.pressed && launch::outruns(region, moment, link, desired.owner) {
        (desired.owner, desired.holders) = (own_rank, desired.reached);
    }
    let away = note_away(region, link, desired.owner, moment);
    let flies = desired.lively && away >= SETTLE_TICKS;
    let slot = region.slot(link.handle);
    let (held, epoch) = (slot.holders, slot.epoch);
    let asleep = region.physics().bodies[link.handle].is_sleeping();
    let alone = desired.holders == RegionSet::only(desired.owner);
    let at_once = alone && goes_at_once(region, link.handle) || flies && held.is_empty();
    if desired.owner != own_rank && at_once {
        if away >= SETTLE_TICKS || !is_among(&border.parting, link.handle) {
            return Some((link, desired.owner));
        }
        (desired.owner, desired.holders) = (own_rank, desired.reached);
    }
    let (mut members, mut owner) = (held.union(desired.holders).union(own), own_rank);
    let carries = slot.traits.kind != BodyKind::Dynamic;
    let shared = border.shared.get_mut(link.handle);
    if shared.is_none() && members == own {
        return None;
    }
    let (mut before, mut warming_before) = (own, RegionSet::EMPTY);
    let mut ready = false;
    if let Some(shared) = shared {
        (before, warming_before) = (shared.members, shared.warming);
        let noticed = shared.settled > NOTICE_TICKS;
        // A sleeping body stays where it is held, except in a region that is being emptied.
        let needless = held.without(desired.holders);
        let needless = if asleep { needless.intersection(moment.partition.emptied()) } else { needless };
        shared.idle = if noticed && !needless.is_empty() { shared.idle + 1 } else { 0 };
        // A kinematic body may carry other regions' bodies which its new owner has not received yet, and a character may
        // stand on the body there.
        let is_trodden = region.is_walked_on(link.handle);
        let lasts = desired.pressed && !asleep || carries || is_trodden;
        if shared.idle > if lasts { KEEP_TICKS } else { 0 } {
            members = members.without(needless);
        }
        ready = (desired.ready || flies)
            && held.contains(desired.owner)
            && members.contains(desired.owner)
            && !asleep;
    }
    // Copies within reach get a part of the mass: at once if only the owner's copy counted before, else after
    // one exchange.
    let counting = before.without(warming_before);
    let at_once = if counting == own { members } else { before };
    let counts = if desired.split {
        counting.union(desired.reached.without(own).intersection(at_once)).intersection(members)
    } else if asleep {
        counting.intersection(members)
    } else {
        own
    };
    let mut warming = members.without(counts);
    if desired.owner != own_rank && ready {
        owner = desired.owner;
        if counts == own && !desired.split {
            // From now on the new owner's copy counts, and the one here follows it.
            warming = members.without(RegionSet::only(owner));
        } else if warming.contains(owner) {
            warming.remove(owner);
            // Nothing that stays here touches it.
            let is_left = desired.whole || !touches_any(region, link.handle);
            if counts == own && is_left && !region.is_walked_on(link.handle) {
                members = RegionSet::only(owner);
            }
        }
        warming = warming.intersection(members);
    }
    if (members, warming, owner) == (before, warming_before, own_rank) {
        return None;
    }
    let (told, added) = (members.union(before).without(own), members.without(before));
    if !added.is_empty() {
        contact_poses.look(region, border, moment, link.handle, added);
    }
    tell(region, outbox, link.handle, told, added, members, warming, owner, contact_poses.of.get(&link.id));
    if owner != own_rank {
        let record = region.body_record(link.handle);
        let body = BodyRecord { epoch: epoch.next(), ..record };
        let holders = members.without(RegionSet::only(owner));
        let whole = region.slot(link.handle).whole;
        outbox.to(owner).transfers.push(Transfer { body, holders, whole });
        region.set_role(link.handle, Ownership::Ghost { owner }, members.without(own), epoch.next());
    }
    border.decisions.push(Decision { link, members, warming });
    None
}

/// Returns whether the body touches, or is tied to, a body that can move.
fn touches_any(region: &Region, handle: RigidBodyHandle) -> bool {
    let mut any = false;
    region.for_each_contact(handle, |_, touches| any |= touches);
    any
}

/// Returns whether a body can be transferred at once without loss: it is dynamic and awake, no other region holds
/// it, nothing touches it or is tied to it, and it is in no sensor. A character would stand still in its first
/// tick there, and what a platform carries may stay here, as may a character that stands on the body: their new owner
/// holds them first.
fn goes_at_once(region: &Region, handle: RigidBodyHandle) -> bool {
    let body = &region.physics().bodies[handle];
    let is_free = region.slot(handle).holders.is_empty() && !region.is_pressed(handle);
    let is_apart = !region.is_sensed(handle) && !region.is_walked_on(handle);
    body.is_dynamic() && !body.is_sleeping() && is_free && is_apart
}
