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

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::island::Island;
use super::launch;
use super::predicted_contacts::{self, Meeting, PredictedContacts};
use super::shared::SharedBodies;
use super::{Border, Moment, Side, articulated, strike};
use crate::physics::convert;
use crate::physics::outbox::Outbox;
use crate::physics::region::{BodyRef, Ownership, Region, Slot};
use crate::protocol::{BIG_ISLAND, BodyKind, BodyRecord, ContactPose, Membership, Transfer};
use crate::space::{BodyId, RegionSet};

/// Ticks for which a region keeps a body that it no longer has a reason to hold.
const KEEP_TICKS: u32 = 10;
/// Ticks for which no region drops a body after its owner or its holders have changed. Only by then has a
/// new owner shown the body to all regions that may have something near it, and heard of that. A body dropped
/// at once could hit, in the new owner's region alone, a body that has just been sent there and whose owner
/// feels nothing.
const NOTICE_TICKS: u32 = 2;
/// Ticks for which the region to which a body moves holds it before owning it, if the body touches something.
const SETTLE_TICKS: u32 = 8;
/// The velocity, m/s, by which a warm-up ghost may at most stray from its body when the body moves: then the
/// body's load has found its way through the contacts there. After [`FOLLOW_TICKS`] the body moves anyway.
const STRAY_M_S: f32 = 1e-3;
const FOLLOW_TICKS: u32 = 120;
/// Ticks after which a body that is due to move moves as it is: its holders may change with every swing of a
/// rope, and it would never settle.
const LONGEST_AWAY_TICKS: u32 = 60;
/// The speed, m/s, above which a body of a large island moves without being held there first, once it has
/// been due for [`SETTLE_TICKS`]: the warm start of its contacts is of impacts, and worth nothing in the next
/// tick.
const LIVELY_M_S: f32 = 1.0;

/// A decision on the members of a body from the end of this exchange on.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Decision {
    link: BodyRef,
    members: RegionSet,
    warming: RegionSet,
}

/// The poses in which bodies of islands that are sent to another region lay when their contacts were found:
/// that region must find these alike.
#[derive(Clone, Debug, Default)]
pub(super) struct ContactPoses {
    /// The islands that were looked at, by their first member.
    seen: BTreeSet<BodyId>,
    of: BTreeMap<BodyId, Pose>,
}

impl ContactPoses {
    /// Looks at the island of a body that is sent to the regions `to`, unless it has done so before. It
    /// leaves out split islands, whose copies count at once and must be where the island is, and islands of
    /// which a part is there already.
    fn look(
        &mut self,
        region: &Region,
        border: &Border,
        moment: Moment<'_>,
        body: RigidBodyHandle,
        to: RegionSet,
    ) {
        let Some(island) = border.islands.of(body).filter(|island| self.seen.insert(island.members[0].id))
        else {
            return;
        };
        let goes = |link: &BodyRef| {
            let is_new = region.slot(link.handle).holders.intersection(to).is_empty();
            is_new && !splits(border, moment, link.id, link.handle)
        };
        let goes_whole = !island.big && !island.large && island.pressed && !island.spans();
        if goes_whole && island.members.iter().all(goes) {
            let lay = region.contact_poses(&island.members, moment.tick);
            self.of.extend(lay.into_iter().map(|(handle, pose)| (region.slot(handle).id, pose)));
        }
    }
}

/// The membership and owner that a body should have, by its owner's reckoning.
#[derive(Clone, Copy)]
struct Desired {
    /// Regions other than its present owner's that must hold it.
    holders: RegionSet,
    /// The regions among them within whose reach it is.
    reached: RegionSet,
    owner: usize,
    /// Says whether its island moves whole.
    whole: bool,
    /// Says whether its mass is split among the regions that hold it. Otherwise its owner's copy and each ghost
    /// have all of it.
    split: bool,
    /// Says whether something touches the body, or its island if that moves whole.
    pressed: bool,
    /// Says whether the region to which it moves holds it, and its island if that moves whole, with the contacts.
    ready: bool,
    /// Says whether it may move without having been held there first.
    lively: bool,
}

/// Sends the bodies inserted since the last step to the regions that must hold them: all whose cell they come near.
pub(super) fn announce(side: &mut Side, moment: Moment<'_>) {
    side.outbox.clear(moment.tick);
    side.region.update_assemblies();
    side.border.decisions.clear();
    let fresh = share_fresh(side, moment);
    let Side { region, border, outbox, .. } = side;
    predicted_contacts::look(region, &mut border.predicted, moment, &fresh);
    predicted_contacts::show(region, &mut border.predicted, &mut border.neighbours, outbox, moment);
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
    looked_at.extend(region.due(moment.tick));
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
    let candidates = candidates(region, border, moment);
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
    leaving.extend(articulated::leaving(&side.region, &mut side.border, moment));
    for (link, owner) in &leaving {
        hand_over(&side.region, &mut side.outbox, *link, *owner);
    }
    for (link, _) in leaving {
        side.region.remove(link.id);
    }
}

/// Applies the owners' decisions: sets the members of bodies, and splits masses anew.
pub(super) fn commit<'a>(
    region: &mut Region,
    border: &mut Border,
    told: impl Iterator<Item = &'a Membership>,
) {
    let own = RegionSet::only(region.rank());
    for decision in &border.decisions {
        if region.handle_of(decision.link.id) == Some(decision.link.handle) {
            if decision.members.contains(region.rank()) {
                strike::owe(region, &mut border.shared, decision.link.handle, decision.members);
                border.shared.set_members(region, decision.link.handle, decision.members, decision.warming);
            } else {
                region.remove(decision.link.id);
            }
        }
    }
    for membership in told {
        let Some(handle) = region.handle_of(membership.id) else { continue };
        let slot = region.slot(handle);
        if membership.epoch < slot.epoch {
            continue;
        }
        let members = membership.holders;
        if !members.contains(region.rank()) {
            region.remove(membership.id);
            continue;
        }
        if slot.role != Ownership::Owner && usize::from(membership.owner) != region.rank() {
            let role = Ownership::Replica { owner: membership.owner.into() };
            region.set_role(handle, role, members.without(own), membership.epoch);
        }
        border.shared.set_members(region, handle, members, membership.warming);
    }
}

/// Sends the bodies inserted here to all regions that they come near, since they may touch anything at once.
/// Bodies of islands that are computed whole go to no new region, unless they are fast; after membership has changed they go to the
/// regions that held copies of them, which follow as before. A body whose holders are at different times, as
/// a joint may cause, waits until they are at the same time. Returns all bodies inserted here.
fn share_fresh(side: &mut Side, moment: Moment<'_>) -> Vec<RigidBodyHandle> {
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
fn share_sudden(side: &mut Side, moment: Moment<'_>) {
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
    let fresh = |link: &BodyRef| border.decisions.iter().any(|decision| decision.link.id == link.id);
    all.retain(|link| border.decisions.is_empty() || !fresh(link));
    // Others of these have yet to be announced.
    let waiting: Vec<_> = region.fresh().map(|link| link.handle).collect();
    all.retain(|link| !waiting.contains(&link.handle));
    all
}

/// Decides on one body. Returns it with its new owner if it is to be transferred at once.
fn decide_on(
    side: &mut Side,
    moment: Moment<'_>,
    link: BodyRef,
    mut desired: Desired,
    contact_poses: &mut ContactPoses,
) -> Option<(BodyRef, usize)> {
    let Side { region, border, outbox, .. } = side;
    let own_rank = region.rank();
    let own = RegionSet::only(own_rank);
    if desired.owner != own_rank
        && !desired.pressed
        && launch::outruns(region, border, moment, link, desired.owner)
    {
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
        // Memberships and masses stay as they are while a body sleeps: changing them would wake it.
        let noticed = shared.settled > NOTICE_TICKS;
        let needless = noticed && !held.without(desired.holders).is_empty() && !asleep;
        shared.idle = if needless { shared.idle + 1 } else { 0 };
        // A kinematic body may carry other regions' bodies which its new owner has not received yet.
        if shared.idle > if desired.pressed || carries { KEEP_TICKS } else { 0 } {
            members = desired.holders.union(own);
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
            if counts == own && (desired.whole || !touches_any(region, link.handle)) {
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
        region.set_role(link.handle, Ownership::Replica { owner }, members.without(own), epoch.next());
    }
    border.decisions.push(Decision { link, members, warming });
    None
}

/// Returns the membership and owner that a body should have among the neighbours of this tick, and all
/// regions that it should have, whether they are neighbours or not.
fn desired_membership(
    region: &Region,
    border: &Border,
    moment: Moment<'_>,
    handle: RigidBodyHandle,
) -> (Desired, RegionSet) {
    let own = RegionSet::only(region.rank());
    let body = &region.physics().bodies[handle];
    let island = border.islands.of(handle).filter(|island| !island.big);
    let goal = goal_of(region, border, moment, handle);
    let neighbours = border.neighbours.present();
    let owner = if neighbours.contains(goal) { goal } else { region.rank() };
    let pressed = island.map_or_else(|| region.is_pressed(handle), |island| island.pressed);
    let ready = match (island, region.slot(handle).assembly) {
        (Some(island), _) if !island.large || region.is_articulated(handle) => island.ready,
        (Some(_), Some(assembly)) => border.ready_assemblies[assembly as usize],
        (island, _) => is_ready(region, &border.shared, island, handle, owner, pressed, moment),
    };
    // A kinematic body is held by the regions with a predicted contact to it; reach does not spread from it.
    let id = region.slot(handle).id;
    let met = border
        .predicted
        .meetings_of(id)
        .fold(RegionSet::EMPTY, |set, meeting| set.union(RegionSet::only(meeting.rank)).union(meeting.goes));
    let met = if body.is_dynamic() { RegionSet::EMPTY } else { met };
    let all = border.reach.of(handle).union(met).without(own);
    let reached = all.intersection(neighbours);
    let wanted = all.union(RegionSet::only(goal));
    let lively = island.is_some_and(|island| island.large)
        && region.slot(handle).assembly.is_none()
        && body.linvel().length() > LIVELY_M_S;
    let there = if lively { RegionSet::EMPTY } else { RegionSet::only(owner) };
    let holders = reached.union(there).without(own);
    let split = splits(border, moment, id, handle);
    (Desired { holders, reached, owner, whole: island.is_some(), split, pressed, ready, lively }, wanted)
}

/// Returns the rank of the region that is to own a body.
fn goal_of(region: &Region, border: &Border, moment: Moment<'_>, handle: RigidBodyHandle) -> usize {
    match border.islands.of(handle).filter(|island| !island.big) {
        Some(island) => island.target,
        // A sleeping body stays where it is.
        None if region.physics().bodies[handle].is_sleeping() => region.rank(),
        None => moment.home_of(region, handle),
    }
}

/// Notes that a body is due to move to another region. Returns for how many ticks it has been due before.
fn note_away(region: &mut Region, link: BodyRef, owner: usize, moment: Moment<'_>) -> u32 {
    if owner == region.rank() {
        return 0;
    }
    let now = moment.tick.0 as u32;
    let slot = region.slot_mut(link.handle);
    let before = away_ticks(slot, moment);
    slot.away = (now - before, now);
    before
}

/// Returns for how many ticks a body has been due to move, up to the last step of its region.
fn away_ticks(slot: &Slot, moment: Moment<'_>) -> u32 {
    let ((first, last), now) = (slot.away, moment.tick.0 as u32);
    if last < now && last + u32::from(moment.coarsest) >= now { now - first } else { 0 }
}

/// Returns whether the region that is to own a body holds it, with its contacts.
fn is_ready(
    region: &Region,
    all: &SharedBodies,
    island: Option<&Island>,
    handle: RigidBodyHandle,
    owner: usize,
    pressed: bool,
    moment: Moment<'_>,
) -> bool {
    // A multibody moves in one piece, when all else is ready.
    if region.is_articulated(handle) {
        return true;
    }
    let slot = region.slot(handle);
    let settled = all.get(handle).is_some_and(|shared| {
        let strays = shared.warming.contains(owner) && shared.strayed_m_s > STRAY_M_S;
        // A body that only bounces off another region's has parted from it before it would move.
        let lasts = !island.is_some_and(Island::spans) || shared.joined >= SETTLE_TICKS;
        let follows = shared.settled >= if strays { FOLLOW_TICKS } else { SETTLE_TICKS };
        lasts && follows || away_ticks(slot, moment) >= LONGEST_AWAY_TICKS
    });
    slot.holders.contains(owner) && (settled || !pressed)
}

/// Finds which islands are ready to move. A small island moves when all of it is ready. Bodies that keep
/// joining a large island would delay it for ever: there each body moves when it is ready, and bodies tied by
/// joints move together.
fn find_ready(region: &Region, border: &mut Border, moment: Moment<'_>) {
    let Border { islands, ready_assemblies, shared, parting, .. } = border;
    let own = region.rank();
    ready_assemblies.clear();
    ready_assemblies.resize(region.assemblies().len(), true);
    for island in islands.found.iter_mut().filter(|island| !island.big && island.target != own) {
        let ready = |link: &BodyRef| {
            is_ready(region, shared, Some(island), link.handle, island.target, island.pressed, moment)
        };
        if island.large {
            for link in &island.members {
                if let Some(assembly) = region.slot(link.handle).assembly {
                    ready_assemblies[assembly as usize] &= ready(link);
                }
            }
        }
        let waits = |link: &BodyRef| {
            away_ticks(region.slot(link.handle), moment) < 2 * SETTLE_TICKS && is_among(parting, link.handle)
        };
        island.ready = island.members.iter().all(|link| ready(link) && !waits(link));
    }
}

/// Returns whether a body's mass is to be split. With `overlap` it always is. Otherwise it is split only in
/// an island that is too large to be whole in one region, or if the body has a predicted contact to such an
/// island or to a body that sleeps split.
fn splits(border: &Border, moment: Moment<'_>, id: BodyId, handle: RigidBodyHandle) -> bool {
    let big = |handle| border.islands.of(handle).is_some_and(|island| island.big);
    let mut meetings = border.predicted.meetings_of(id);
    !moment.settings.coupling.moves_islands()
        || big(handle)
        || meetings.any(|meeting| meeting.island == BIG_ISLAND)
        || is_among(&border.splitting, handle)
}

/// Returns whether a body is in a list that is in order of handle.
fn is_among(bodies: &[RigidBodyHandle], body: RigidBodyHandle) -> bool {
    bodies.binary_search_by_key(&body.into_raw_parts(), |one| one.into_raw_parts()).is_ok()
}

/// Returns whether the body touches, or is tied to, a body that can move.
fn touches_any(region: &Region, handle: RigidBodyHandle) -> bool {
    let mut any = false;
    region.for_each_contact(handle, |_, touches| any |= touches);
    any
}

/// Returns whether a body can be transferred at once without loss: it is dynamic and awake, no other region holds
/// it, and nothing touches it or is tied to it. A character would stand still in its first tick there, and what a
/// platform carries may stay here: their new owner holds them first.
fn goes_at_once(region: &Region, handle: RigidBodyHandle) -> bool {
    let body = &region.physics().bodies[handle];
    let is_free = region.slot(handle).holders.is_empty() && !region.is_pressed(handle);
    body.is_dynamic() && !body.is_sleeping() && is_free
}

/// Sends a body that no other region holds to its new owner, whole. The caller must remove it here.
fn hand_over(region: &Region, outbox: &mut Outbox, link: BodyRef, owner: usize) {
    let record = region.body_record(link.handle);
    let epoch = record.epoch.next();
    let whole = region.slot(link.handle).whole;
    let body = BodyRecord { epoch, ..record };
    let joints: Vec<_> = region.joints_of(link.handle).collect();
    let message = outbox.to(owner);
    message.transfers.push(Transfer { body, holders: RegionSet::EMPTY, whole });
    message.joints.extend(joints);
}

/// Sends a membership to all members, new, remaining and former. Sends the body to the new ones too, with how
/// it lay when its contacts were found.
#[expect(clippy::too_many_arguments, reason = "one word of one owner")]
fn tell(
    region: &Region,
    outbox: &mut Outbox,
    handle: RigidBodyHandle,
    told: RegionSet,
    added: RegionSet,
    members: RegionSet,
    warming: RegionSet,
    owner: usize,
    lay: Option<&Pose>,
) {
    let record = region.body_record(handle);
    let lay =
        lay.map(|lay| ContactPose { id: record.id, pose: convert::world_from_region(region.anchor(), lay) });
    let joints: Vec<_> = region.joints_of(handle).collect();
    let epoch = if owner == region.rank() { record.epoch } else { record.epoch.next() };
    let membership = Membership { id: record.id, epoch, owner: owner as u8, holders: members, warming };
    for rank in added.iter() {
        outbox.to(rank).replicas.push(record.clone());
        outbox.to(rank).contact_poses.extend(lay);
        outbox.to(rank).joints.extend_from_slice(&joints);
    }
    for rank in told.iter() {
        outbox.to(rank).members.push(membership);
    }
}

#[cfg(test)]
mod tests {
    use super::super::OWNER_HYSTERESIS_M;
    use super::*;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    /// A train of eight wagons, which moves when seven are out. The last one is still far within the region
    /// that they leave.
    #[test]
    fn what_goes_along_is_not_waited_for_as_what_stays_is() {
        let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
        let mut config = WorldConfig { partitioning, ..WorldConfig::default() };
        config.step.gravity = [0.0; 3];
        let mut world = LocalWorld::new(config).unwrap();
        let wagon = |i: i32| {
            let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(Vector::X * 2.0);
            body.translation(Vector::X * (-1.0 - 1.04 * i as f32))
        };
        let ids: Vec<_> =
            (0..8).map(|i| world.insert(wagon(i), ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()).collect();
        for pair in ids.windows(2) {
            let hook =
                SphericalJointBuilder::new().local_anchor1(Vector::X * -0.52).local_anchor2(Vector::X * 0.52);
            world.insert_joint(pair[0], pair[1], hook).unwrap();
        }
        let (mut out_at, mut moved_at) = (None, None);
        for tick in 0..400 {
            world.step().unwrap();
            let is_out = |id: &&BodyId| world.pose(**id).unwrap().translation[0] > OWNER_HYSTERESIS_M;
            out_at = out_at.or((ids.iter().filter(is_out).count() >= 7).then_some(tick));
            let moved = world.regions().any(|region| {
                let owned = region.bodies().filter(|(_, role, ..)| *role == Ownership::Owner);
                region.cell().min[0] == 0.0 && owned.count() == 8
            });
            moved_at = moved_at.or(moved.then_some(tick));
        }
        let (out_at, moved_at) = (out_at.unwrap(), moved_at.unwrap());
        let waited = moved_at - out_at;
        assert!((0..=SETTLE_TICKS as i32).contains(&waited), "it waited for {waited} ticks");
    }
}
