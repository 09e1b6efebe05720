//! Hands over what sleeps where it should not: where a plane has passed over it, or in a region that is being
//! emptied. It goes asleep. Woken, a settled stack would settle anew, and what its user put to sleep in the
//! air would fall. So all that touches or is tied together goes in one exchange, and only what cannot go like
//! that is woken, to go as what is awake does.

use std::collections::BTreeSet;

use rapier3d::prelude::RigidBodyHandle;

use super::Decision;
use super::membership::{hand_over, tell};
use crate::physics::coupling::neighbours::MEET_EVERY;
use crate::physics::coupling::{Border, Moment, predicted_contacts};
use crate::physics::outbox::Outbox;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyRecord, Transfer};
use crate::space::{Bounds, RegionSet};

/// What becomes of bodies that sleep and hang together.
enum Fate {
    /// Most of them lie in this region.
    Stays,
    /// Another region that is concerned is not at hand, or something awake here is near them.
    Waits,
    /// They cannot go asleep.
    Wakes,
    /// All go to the region of this rank.
    Goes(usize),
}

/// Hands over the bodies of [`Border::left_behind`] that can go now, in every few ticks. Returns them in id
/// order; the caller must give them up.
pub(super) fn hand_over_asleep(
    region: &mut Region,
    border: &mut Border,
    outbox: &mut Outbox,
    moment: Moment<'_>,
) -> Vec<BodyRef> {
    if border.left_behind.is_empty() || moment.tick.0 % MEET_EVERY >= moment.coarsest.into() {
        return Vec::new();
    }
    let awake = region.own_awake().into_iter().filter(|&handle| region.physics().bodies[handle].is_enabled());
    let awake: Vec<_> = awake.map(|handle| swept(region, handle, moment)).collect();
    let (mut gone, mut known) = (Vec::new(), BTreeSet::new());
    for handle in std::mem::take(&mut border.left_behind) {
        if !sleeps_here(region, handle) || known.contains(&handle.into_raw_parts()) {
            continue;
        }
        let all = hanging_together(region, handle, &mut known);
        match fate(region, border, moment, &all, &awake) {
            Fate::Stays => {}
            Fate::Waits => border.left_behind.push(handle),
            Fate::Wakes => {
                for link in all {
                    if sleeps_here(region, link.handle) {
                        region.wake(link.handle);
                    }
                }
            }
            Fate::Goes(goal) => {
                let owned = |link: &BodyRef| region.slot(link.handle).role == Ownership::Owner;
                let owned: Vec<_> = all.into_iter().filter(owned).collect();
                // Where others hold a body, its next owner holds it first.
                let unknown = |link: &BodyRef| {
                    let held = region.slot(link.handle).holders;
                    !held.is_empty() && !held.contains(goal)
                };
                let unknown: Vec<_> = owned.iter().filter(|link| unknown(link)).collect();
                if unknown.is_empty() {
                    owned.iter().for_each(|link| go(region, border, outbox, *link, goal));
                    gone.extend(owned);
                } else {
                    unknown.into_iter().for_each(|link| hold_there(region, border, outbox, *link, goal));
                    border.left_behind.push(handle);
                }
            }
        }
    }
    gone.sort_unstable_by_key(|link| link.id);
    gone
}

fn sleeps_here(region: &Region, handle: RigidBodyHandle) -> bool {
    let is_owned = region.role_of(handle).is_some_and(|(_, role)| role == Ownership::Owner);
    is_owned && region.physics().bodies.get(handle).is_some_and(|body| body.is_sleeping())
}

/// Returns all movable bodies that touch or are tied to a body, directly or through others, itself among them.
fn hanging_together(
    region: &Region,
    handle: RigidBodyHandle,
    known: &mut BTreeSet<(u32, u32)>,
) -> Vec<BodyRef> {
    known.insert(handle.into_raw_parts());
    let mut all = vec![BodyRef { id: region.slot(handle).id, handle }];
    let mut next = 0;
    while let Some(BodyRef { handle, .. }) = all.get(next).copied() {
        next += 1;
        region.for_each_contact(handle, |other, touches| {
            if touches && known.insert(other.into_raw_parts()) {
                all.push(BodyRef { id: region.slot(other).id, handle: other });
            }
        });
    }
    all
}

fn fate(region: &Region, border: &mut Border, moment: Moment<'_>, all: &[BodyRef], awake: &[Bounds]) -> Fate {
    let own = region.rank();
    let mut homes: Vec<_> = all.iter().map(|link| moment.home_of(region, link.handle)).collect();
    homes.sort_unstable();
    let runs = homes.chunk_by(|a, b| a == b);
    // Of regions with as many, that of the lowest rank.
    let largest = runs.rev().max_by_key(|run| run.len()).expect("an island has members");
    let goal = largest[0];
    if goal == own {
        return Fate::Stays;
    }
    let is_whole = largest.len() == all.len() || all.len() <= moment.settings.island_limit;
    let goes_asleep = |link: &BodyRef| {
        let (body, slot) = (&region.physics().bodies[link.handle], region.slot(link.handle));
        let is_right =
            matches!(slot.role, Ownership::Owner) || slot.role == Ownership::Replica { owner: goal };
        let is_apart = !region.is_sensed(link.handle) && !region.is_walked_on(link.handle);
        body.is_dynamic() && body.is_enabled() && body.is_sleeping() && is_right && is_apart
    };
    if !is_whole || !all.iter().all(goes_asleep) {
        return Fate::Wakes;
    }
    let held = all.iter().map(|link| region.slot(link.handle).holders);
    let concerned = held.fold(RegionSet::only(goal), RegionSet::union).without(RegionSet::only(own));
    let all_sleep = all.iter().all(|link| {
        let shared = border.shared.get(link.handle);
        shared.is_none_or(|shared| shared.heard.iter().all(|(_, copy)| copy.sleeping))
    });
    let reached = border.neighbours.reached(own, concerned);
    let bounds = all.iter().map(|link| region.world_bounds(link.handle));
    let bounds = bounds.reduce(|all, one| all.union(&one)).expect("an island has members");
    if reached != concerned || !all_sleep || awake.iter().any(|other| other.touches(&bounds)) {
        return Fate::Waits;
    }
    Fate::Goes(goal)
}

/// Hands over a body. The regions that hold it go on to hold it.
fn go(region: &Region, border: &Border, outbox: &mut Outbox, link: BodyRef, goal: usize) {
    let slot = region.slot(link.handle);
    if slot.holders.is_empty() {
        return hand_over(region, outbox, link, goal);
    }
    let (own, goal_alone) = (RegionSet::only(region.rank()), RegionSet::only(goal));
    let members = slot.holders.union(goal_alone);
    let counted = border.shared.get(link.handle).map(|shared| shared.members.without(shared.warming));
    let counts = counted.unwrap_or(own).without(own).union(goal_alone).intersection(members);
    let warming = members.without(counts);
    tell(region, outbox, link.handle, slot.holders, RegionSet::EMPTY, members, warming, goal, None);
    let record = region.body_record(link.handle);
    let body = BodyRecord { epoch: slot.epoch.next(), ..record };
    let holders = members.without(goal_alone);
    outbox.to(goal).transfers.push(Transfer { body, holders, whole: slot.whole });
}

/// Has the next owner of a body that others hold come to hold it, without a part of its mass.
fn hold_there(region: &Region, border: &mut Border, outbox: &mut Outbox, link: BodyRef, goal: usize) {
    let (own, added) = (RegionSet::only(region.rank()), RegionSet::only(goal));
    let Some(shared) = border.shared.get(link.handle) else { return };
    let (members, warming) = (shared.members.union(added), shared.warming.union(added));
    tell(region, outbox, link.handle, members.without(own), added, members, warming, region.rank(), None);
    border.decisions.push(Decision { link, members, warming });
}

fn swept(region: &Region, handle: RigidBodyHandle, moment: Moment<'_>) -> Bounds {
    predicted_contacts::swept_bounds(region, handle, moment.settings.dt_s)
}
