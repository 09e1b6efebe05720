//! Decides which regions hold a body and which one owns it, for the couplings with consensus (`overlap`,
//! `island`, `auto`). The owner decides, after the last step of a tick. All holders of the body receive the
//! decision in the same exchange and apply it together, so that its mass is split into the same number of
//! parts everywhere.
//!
//! - A body is held by the regions within whose reach it is (`reach`), and some ticks longer, so that none
//!   flaps.
//! - It is owned by the region of its centre, or by the region to which its island moves (`island`). A body
//!   that touches something is first held there for some ticks, so that its contacts and their warm start are
//!   there (thesis 3.3.3). A free body is transferred at once.
//! - A body in flight does not go to a region that would not be told in time of what it flies to (`launch`).
//! - A body that is about to touch something that stays does not go for some ticks. Its next owner does not
//!   know of that other body yet, and three ticks later the two would be in each other.
//! - A region that comes to hold an island whole finds its contacts as they were found where the island is
//!   (`region::lever_arms`).
//! - A body that only moves to a region has a warm-up ghost there, without a part of the mass. So has, for
//!   one exchange, a body that comes to be held where several regions hold it already: the warm-up ghost
//!   starts from their mean.
//!
//! This file follows the course of a tick: `survey`, then `decide`. `announce` sends what is new, `desired`
//! finds what membership a body should have, `ready` finds when it may move, `decide_on` decides on one body,
//! `asleep` hands over what sleeps where it should not, and `membership` tells the regions concerned and
//! applies what is told.

mod announce;
mod asleep;
mod contact_poses;
mod decide_on;
mod desired;
mod membership;
mod ready;

use std::collections::BTreeSet;

use rapier3d::prelude::RigidBodyHandle;
use serde::{Deserialize, Serialize};

pub(super) use self::announce::announce;
use self::announce::{share_fresh, share_sudden};
use self::asleep::hand_over_asleep;
use self::contact_poses::ContactPoses;
use self::decide_on::decide_on;
use self::desired::{desired_membership, goal_of};
pub(super) use self::membership::commit;
use self::membership::hand_over;
use self::ready::find_ready;
use super::island::Island;
use super::predicted_contacts::{self, Meeting, PredictedContacts};
use super::{Border, Moment, Side, articulated};
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::space::RegionSet;

/// A decision on the members of a body from the end of this exchange on.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Decision {
    link: BodyRef,
    members: RegionSet,
    warming: RegionSet,
}

/// Finds after a step the bodies near the border, the islands there, and the new bodies.
pub(super) fn survey(side: &mut Side, moment: Moment<'_>) {
    side.region.update_assemblies();
    side.border.decisions.clear();
    let fresh = share_fresh(side, moment);
    let Side { region, border, .. } = &mut *side;
    let mut looked_at = std::mem::take(&mut border.looked_at);
    looked_at.clear();
    looked_at.extend(fresh);
    looked_at.extend(border.take_overlooked(region));
    looked_at.extend(region.due(moment.tick, predicted_contacts::SURPRISE_M_S));
    predicted_contacts::look(region, &mut border.predicted, moment, &looked_at);
    border.looked_at = looked_at;
    share_sudden(side, moment);
    let Side { region, border, .. } = side;
    if moment.settings.coupling.moves_islands() {
        let Border { islands, predicted, shared, .. } = border;
        let seeds = island_seeds(region, predicted, moment);
        islands.find(region, shared, moment, seeds.into_iter());
        let draws = |handle| islands.of(handle).is_some_and(|island| island.draws(region.rank()));
        predicted.set_islands(|handle| (islands.size(handle), draws(handle)));
    }
}

/// Decides, after [`survey`], on holders and owners, and sends the decisions to all regions concerned.
pub(super) fn decide(side: &mut Side, moment: Moment<'_>) {
    let Side { region, border, outbox, .. } = side;
    predicted_contacts::show(region, &mut border.predicted, &mut border.neighbours, outbox, moment);
    let gone = hand_over_asleep(region, border, outbox, moment);
    let is_gone = |link: &BodyRef| gone.binary_search_by_key(&link.id, |gone| gone.id).is_ok();
    let Border { reach, islands, pace, predicted, shared, .. } = border;
    let draws = |handle| islands.of(handle).is_some_and(|island| island.draws(region.rank()));
    let draws_large =
        |handle| islands.of(handle).is_some_and(|island| island.large && island.draws(region.rank()));
    let joining = predicted.joining(region).into_iter().filter(|(handle, _)| !draws_large(*handle));
    // Of two islands that would both be kept at home, each is sent to the other's region.
    let is_anchored = |handle| islands.of(handle).is_some_and(|island| island.anchored);
    let is_sent = |meeting: &Meeting, handle| {
        let waits = draws(handle) && !meeting.stays || is_anchored(handle) && meeting.outweighs();
        meeting.island > 0 && !waits
    };
    let own = RegionSet::only(region.rank());
    let met = predicted.meetings.iter().filter_map(|meeting| {
        let handle = region.handle_of(meeting.own)?;
        is_sent(meeting, handle).then_some((handle, meeting.concerned().without(own)))
    });
    let met = met.chain(joining.map(|(handle, rank)| (handle, RegionSet::only(rank))));
    let met = met.chain(predicted.on_the_way(region, moment.partition));
    let depth = moment.settings.depth + pace.extra_depth();
    let small = |handle| islands.of(handle).is_some_and(|island| !island.big);
    let out = predicted.near.iter().filter(|near| !region.cell().contains_box(&near.swept));
    let leaving = out.map(|near| near.link.handle).filter(|&handle| !small(handle));
    let leaving = leaving.filter_map(|handle| {
        let home = moment.home_of(region, handle);
        (home != region.rank() && !region.physics().bodies[handle].is_sleeping()).then_some((handle, home))
    });
    reach.spread(region, islands, shared, depth, leaving, met);
    reach.complete(region, islands);
    reach.carry(region, predicted.carriers(region, moment.partition));
    let mut candidates = candidates(region, border, moment);
    candidates.retain(|link| !is_gone(link));
    // These come first, since a decision needs them of all bodies of an island.
    for link in &candidates {
        let spans = border.islands.of(link.handle).is_some_and(Island::spans);
        if let Some(shared) = border.shared.get_mut(link.handle) {
            shared.settled += 1;
            shared.joined = if spans { shared.joined + 1 } else { 0 };
        }
    }
    border.parting = border.predicted.parting(region, |handle| {
        goal_of(region, border, moment, handle) != region.rank() && !region.is_articulated(handle)
    });
    find_ready(region, border, moment);
    border.splitting.clear();
    if moment.settings.coupling.moves_islands() {
        let is_big = |handle| border.islands.of(handle).is_some_and(|island| island.big);
        // A sleeping body is in no island. A body that is split only since it will touch a split one splits
        // nothing else: two bodies that approach each other would take turns.
        let is_split = |handle: RigidBodyHandle| {
            let asleep = region.physics().bodies[handle].is_sleeping();
            is_big(handle) || asleep && region.mass_split(handle).is_some_and(|split| split.is_split())
        };
        border.splitting = border.predicted.splitting(region, is_split, |handle| !is_big(handle));
    }
    // What a body should have does not depend on what is decided on others.
    let desired =
        moment.team.spread(&candidates, |link| desired_membership(region, border, moment, link.handle));
    let wanted = desired.iter().fold(RegionSet::EMPTY, |all, (_, wanted)| all.union(*wanted));
    border.neighbours.need(wanted);
    let (mut leaving, mut contact_poses) = (Vec::new(), ContactPoses::default());
    for (link, (desired, _)) in candidates.into_iter().zip(desired) {
        leaving.extend(decide_on(side, moment, link, desired, &mut contact_poses));
    }
    let articulated = articulated::leaving(&side.region, &mut side.border, moment);
    leaving.extend(articulated.into_iter().filter(|(link, _)| !is_gone(link)));
    for (link, owner) in &leaving {
        hand_over(&side.region, &mut side.outbox, *link, *owner);
    }
    let left = leaving.into_iter().map(|(link, _)| link).chain(gone);
    left.for_each(|link| side.region.give_up(link.id));
}

/// Returns the bodies whose islands are to be found. A body near the border that no other region holds, that
/// touches nothing, has no predicted contact and lies in its cell is an island by itself.
fn island_seeds(region: &Region, predicted: &PredictedContacts, moment: Moment<'_>) -> Vec<RigidBodyHandle> {
    let near = moment.team.spread(&predicted.near, |near| {
        let handle = near.link.handle;
        let here = region.cell().contains_box(&near.swept) && region.slot(handle).holders.is_empty();
        let is_seed =
            !here || predicted.meetings_of(near.link.id).next().is_some() || region.is_pressed(handle);
        is_seed.then_some(handle)
    });
    near.into_iter().flatten().chain(region.held_elsewhere().map(|link| link.handle)).collect()
}

/// Returns every body owned here whose membership or owner may have to change, in id order.
fn candidates(region: &Region, border: &Border, moment: Moment<'_>) -> Vec<BodyRef> {
    let owned = |handle: &RigidBodyHandle| {
        let slot = region.slot(*handle);
        (slot.role == Ownership::Owner).then_some(BodyRef { id: slot.id, handle: *handle })
    };
    let mut all = region.shared().to_vec();
    all.extend(border.reach.reached.iter().filter_map(owned));
    let changes = moment.team.spread(&border.predicted.near, |near| {
        let meets = || border.predicted.meetings_of(near.link.id).next().is_some();
        (!region.cell().contains_box(&near.swept) || meets()).then_some(near.link)
    });
    all.extend(changes.into_iter().flatten());
    let moving = border.islands.found.iter().filter(|island| !island.big && island.target != region.rank());
    all.extend(moving.flat_map(|island| &island.members));
    // The list consists of ordered runs, which are merged.
    all.sort_by_key(|link| link.id);
    all.dedup_by_key(|link| link.id);
    all.retain(|link| !region.is_articulated(link.handle));
    // Bodies inserted in this tick have been decided on already.
    let decided = border.decisions.iter().map(|decision| decision.link.id);
    // Others of these have yet to be announced.
    let fresh: BTreeSet<_> = decided.chain(region.fresh().map(|link| link.id)).collect();
    all.retain(|link| !fresh.contains(&link.id));
    all
}

/// Returns whether a body is in a list that is in order of handle.
fn is_among(bodies: &[RigidBodyHandle], body: RigidBodyHandle) -> bool {
    bodies.binary_search_by_key(&body.into_raw_parts(), |one| one.into_raw_parts()).is_ok()
}
