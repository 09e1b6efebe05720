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

/// The number of bodies from which on no further ones go in the same exchange: a message has a largest length.
const MOST_GOING: usize = 4_096;

/// The fate of bodies that sleep and hang together.
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

/// An awake body here.
struct Awake {
    swept: Bounds,
    articulated: bool,
}

/// Hands over the bodies of [`Border::left_behind`] that can go now. Returns them in id order; the caller must
/// give them up.
pub(super) fn hand_over_asleep(
    region: &mut Region,
    border: &mut Border,
    outbox: &mut Outbox,
    moment: Moment<'_>,
) -> Vec<BodyRef> {
    // In the first step of each region after all regions have met: others are no neighbours at other times.
    if border.left_behind.is_empty() || moment.tick.0 % MEET_EVERY >= moment.coarsest.into() {
        return Vec::new();
    }
    let awake = awake_here(region, moment);
    let (mut gone, mut known) = (Vec::new(), BTreeSet::new());
    for handle in std::mem::take(&mut border.left_behind) {
        if !sleeps_here(region, handle) || known.contains(&handle.into_raw_parts()) {
            continue;
        }
        if gone.len() >= MOST_GOING {
            border.left_behind.push(handle);
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
                let is_strange = |link: &BodyRef| {
                    let held = region.slot(link.handle).holders;
                    !held.is_empty() && !held.contains(goal)
                };
                let strange: Vec<_> = owned.iter().filter(|link| is_strange(link)).collect();
                if strange.is_empty() {
                    owned.iter().for_each(|link| go(region, border, outbox, *link, goal));
                    gone.extend(owned);
                } else {
                    strange.into_iter().for_each(|link| hold_there(region, border, outbox, *link, goal));
                    border.left_behind.push(handle);
                }
            }
        }
    }
    gone.sort_unstable_by_key(|link| link.id);
    gone
}

fn awake_here(region: &Region, moment: Moment<'_>) -> Vec<Awake> {
    let mut awake = region.own_awake();
    awake.retain(|&handle| region.physics().bodies[handle].is_enabled());
    let look = |handle| Awake {
        swept: predicted_contacts::swept_bounds(region, handle, moment.settings.dt_s),
        articulated: region.is_articulated(handle),
    };
    awake.into_iter().map(look).collect()
}

fn sleeps_here(region: &Region, handle: RigidBodyHandle) -> bool {
    let is_owned = region.role_of(handle).is_some_and(|(_, role)| role == Ownership::Owner);
    is_owned && region.physics().bodies.get(handle).is_some_and(|body| body.is_sleeping())
}

/// Returns all movable bodies that touch or are tied to a body, directly or through others, itself among them, in
/// id order.
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
    all.sort_unstable_by_key(|link| link.id);
    all
}

fn fate(region: &Region, border: &mut Border, moment: Moment<'_>, all: &[BodyRef], awake: &[Awake]) -> Fate {
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
    let bounds = all.iter().map(|link| region.world_bounds(link.handle));
    let bounds = bounds.reduce(|all, one| all.union(&one)).expect("an island has members");
    let mut near = awake.iter().filter(|awake| awake.swept.touches(&bounds)).peekable();
    let stays_whole = largest.len() == all.len() || all.len() <= moment.settings.island_limit;
    let cannot_go = |link: &BodyRef| {
        let (body, slot) = (&region.physics().bodies[link.handle], region.slot(link.handle));
        let others = slot.role != Ownership::Owner && slot.role != Ownership::Ghost { owner: goal };
        let is_needed_here = region.is_sensed(link.handle) || region.is_walked_on(link.handle);
        // Where something of another region comes, the two must go on to know of each other.
        let is_met = border.predicted.meetings_of(slot.id).any(|meeting| meeting.island > 0);
        let sleeps = body.is_dynamic() && body.is_enabled() && body.is_sleeping();
        !sleeps || others || is_needed_here || is_met
    };
    // A multibody goes together with multibodies that it may touch, and what is asleep would keep it.
    let is_beside_articulated = near.clone().any(|awake| awake.articulated);
    if !stays_whole || is_beside_articulated || all.iter().any(cannot_go) {
        return Fate::Wakes;
    }
    let held = all.iter().map(|link| region.slot(link.handle).holders);
    let concerned = held.fold(RegionSet::only(goal), RegionSet::union).without(RegionSet::only(own));
    let is_told = |link: &BodyRef| {
        let shared = border.shared.get(link.handle);
        let all_sleep = shared.is_none_or(|shared| shared.heard.iter().all(|(_, copy)| copy.sleeping));
        let is_new = region.fresh().any(|fresh| fresh.id == link.id)
            || border.decisions.iter().any(|decision| decision.link.id == link.id);
        all_sleep && !is_new
    };
    let waits = near.peek().is_some() || !all.iter().all(is_told);
    if waits || border.neighbours.reached(own, concerned) != concerned {
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
    let (own, next) = (RegionSet::only(region.rank()), RegionSet::only(goal));
    let members = slot.holders.union(next);
    let counted = border.shared.get(link.handle).map(|shared| shared.members.without(shared.warming));
    let counts = counted.unwrap_or(own).without(own).union(next).intersection(members);
    let warming = members.without(counts);
    tell(region, outbox, link.handle, slot.holders, RegionSet::EMPTY, members, warming, goal, None);
    let record = region.body_record(link.handle);
    let body = BodyRecord { epoch: slot.epoch.next(), ..record };
    outbox.to(goal).transfers.push(Transfer { body, holders: members.without(next), whole: slot.whole });
}

/// Has the next owner of a body that others hold come to hold it, without a part of its mass.
fn hold_there(region: &Region, border: &mut Border, outbox: &mut Outbox, link: BodyRef, goal: usize) {
    let (own, added) = (RegionSet::only(region.rank()), RegionSet::only(goal));
    let held = region.slot(link.handle).holders;
    let warming = border.shared.get(link.handle).map_or(held, |shared| shared.warming);
    let (members, warming) = (held.union(own).union(added), warming.union(added));
    tell(region, outbox, link.handle, members.without(own), added, members, warming, region.rank(), None);
    border.decisions.push(Decision { link, members, warming });
}
