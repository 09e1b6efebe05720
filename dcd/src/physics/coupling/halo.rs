//! Sends ghosts of bodies to the regions whose halo they touch and transfers ownership, for the couplings `owner`
//! and `proxy`. A body that comes near a neighbour's cell is sent to the neighbour as a ghost, and dropped
//! there when it leaves the halo. A body whose centre has left the region is transferred. It has a ghost there
//! before that (thesis 3.3.3), so that its contacts and their warm start are there when authority changes.

use rapier3d::prelude::*;

use super::neighbours::{LOOKAHEAD_TICKS, Neighbours};
use super::predicted_contacts::{LONGEST_REST, SURPRISE_M_S};
use super::{Border, Side};
use crate::physics::convert;
use crate::physics::outbox::Outbox;
use crate::physics::partition::{HALO_HYSTERESIS_M, HUB_REACH_M, OWNER_HYSTERESIS_M, Partition};
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyRecord, Membership, Transfer};
use crate::space::{Bounds, RegionSet, Tick};

/// A change of the regions that hold a body, or of its owner.
#[derive(Clone, Debug)]
pub(super) struct HolderChange {
    link: BodyRef,
    holders: RegionSet,
    owner: usize,
}

/// Sends the bodies inserted since the last step to the regions that must hold them.
pub(super) fn announce(side: &mut Side, partition: &Partition, tick: Tick, dt_s: f32) {
    let Side { region, border, outbox, .. } = side;
    outbox.clear(tick);
    region.update_assemblies();
    border.looked_at.clear();
    border.looked_at.extend(region.take_fresh().into_iter().map(|link| link.handle));
    tell_changes(region, border, outbox, partition, tick, dt_s);
}

/// Sends changes of holders and owners after a step. Only awake bodies, and those inserted since the last step, can need one.
pub(super) fn tell(side: &mut Side, partition: &Partition, tick: Tick, dt_s: f32) {
    let Side { region, border, outbox, .. } = side;
    border.looked_at.clear();
    border.looked_at.extend(region.take_fresh().into_iter().map(|link| link.handle));
    let overlooked = border.take_overlooked(region);
    border.looked_at.extend(overlooked);
    border.looked_at.extend(region.due(tick, SURPRISE_M_S));
    tell_changes(region, border, outbox, partition, tick, dt_s);
}

/// Sends the changes of holders and owner of the bodies to be checked that are owned here.
fn tell_changes(
    region: &mut Region,
    border: &mut Border,
    outbox: &mut Outbox,
    partition: &Partition,
    tick: Tick,
    dt_s: f32,
) {
    let Border { looked_at, changes, neighbours, .. } = border;
    find_changes(region, partition, neighbours, tick, dt_s, looked_at.iter().copied(), changes);
    for change in changes.drain(..) {
        tell_change(region, outbox, &change);
    }
}

/// Checks these bodies and every assembly with one of them. The `changes` come out in id order, each body
/// once.
fn find_changes(
    region: &mut Region,
    partition: &Partition,
    neighbours: &mut Neighbours,
    tick: Tick,
    dt_s: f32,
    handles: impl Iterator<Item = RigidBodyHandle>,
    changes: &mut Vec<HolderChange>,
) {
    let inner = Inner::of(region, partition);
    let looks_ahead = neighbours.has_strangers(partition.len());
    let mut assemblies = Vec::new();
    for handle in handles {
        let slot = region.slot(handle);
        if slot.role != Ownership::Owner {
            continue;
        }
        if let Some(assembly) = slot.assembly {
            assemblies.push(assembly);
            continue;
        }
        let rest = inner.ticks_within(region, handle, dt_s);
        if slot.holders.is_empty() && rest > 0 {
            region.rest_until(handle, tick.0 as u32 + rest);
            continue;
        }
        let near = Near::of(region, partition, handle, dt_s, looks_ahead);
        let com = region.physics().bodies[handle].center_of_mass();
        let centre = convert::world_point(region.anchor(), com);
        let link = BodyRef { id: slot.id, handle };
        propose(region, neighbours, link, near, new_owner(region, partition, centre), changes);
    }
    assemblies.sort_unstable();
    assemblies.dedup();
    for index in assemblies {
        let members = region.assemblies()[index as usize].members.clone();
        look_at_assembly(region, partition, neighbours, &inner, &members, tick, dt_s, changes);
    }
    changes.sort_unstable_by_key(|change| change.link.id);
    changes.dedup_by_key(|change| change.link.id);
}

/// Checks bodies that joints tie together: all of them get the holders that any of them needs.
#[expect(clippy::too_many_arguments, reason = "one look at one assembly")]
fn look_at_assembly(
    region: &mut Region,
    partition: &Partition,
    neighbours: &mut Neighbours,
    inner: &Inner,
    members: &[BodyRef],
    tick: Tick,
    dt_s: f32,
    changes: &mut Vec<HolderChange>,
) {
    let rest = members.iter().map(|link| inner.ticks_within(region, link.handle, dt_s)).min().unwrap_or(0);
    let shared = members.iter().any(|link| !region.slot(link.handle).holders.is_empty());
    if rest > 0 && !shared {
        for link in members {
            region.rest_until(link.handle, tick.0 as u32 + rest);
        }
        return;
    }
    let looks_ahead = neighbours.has_strangers(partition.len());
    let near = members
        .iter()
        .map(|link| Near::of(region, partition, link.handle, dt_s, looks_ahead))
        .fold(Near::default(), Near::union);
    // The lowest member leads: where it goes, all go.
    let lead = region.physics().bodies[members[0].handle].center_of_mass();
    let owner = new_owner(region, partition, convert::world_point(region.anchor(), lead));
    for &link in members {
        propose(region, neighbours, link, near, owner, changes);
    }
}

fn propose(
    region: &Region,
    neighbours: &mut Neighbours,
    link: BodyRef,
    near: Near,
    owner: usize,
    changes: &mut Vec<HolderChange>,
) {
    let own = RegionSet::only(region.rank());
    let held = region.slot(link.handle).holders;
    let still_near = held.intersection(near.within_hysteresis);
    let holders = near.within_halo.union(still_near).without(own);
    neighbours.reached(region.rank(), near.soon);
    let holders = neighbours.reached(region.rank(), holders);
    let is_reached = !neighbours.reached(region.rank(), RegionSet::only(owner)).is_empty();
    let owner = if is_reached { owner } else { region.rank() };
    if holders != held || owner != region.rank() {
        changes.push(HolderChange { link, holders, owner });
    }
}

/// Returns the rank of the region that the centre lies in, or of the present region until the centre has left
/// that by the hysteresis.
fn new_owner(region: &Region, partition: &Partition, centre: [f64; 3]) -> usize {
    if region.cell().excess_m(centre) > OWNER_HYSTERESIS_M {
        partition.rank_at(centre)
    } else {
        region.rank()
    }
}

/// Sends the body to its new holders, has regions that no longer need it drop it, and transfers authority.
fn tell_change(region: &mut Region, outbox: &mut Outbox, change: &HolderChange) {
    let HolderChange { link, holders, owner } = *change;
    let own = RegionSet::only(region.rank());
    let slot = region.slot(link.handle);
    let (before, epoch) = (slot.holders, slot.epoch);
    let record = region.body_record(link.handle);
    let joints: Vec<_> = region.joints_of(link.handle).collect();
    let leaving = owner != region.rank();
    let target = RegionSet::only(owner);
    let added = holders.without(before).without(if leaving { target } else { RegionSet::EMPTY });
    for rank in added.iter() {
        outbox.to(rank).ghosts.push(record.clone());
        outbox.to(rank).joints.extend_from_slice(&joints);
    }
    for rank in before.without(holders).without(if leaving { target } else { RegionSet::EMPTY }).iter() {
        outbox.to(rank).drops.push(link.id);
    }
    if leaving {
        let holders = holders.union(own).without(target);
        let body = BodyRecord { epoch: epoch.next(), ..record };
        let message = outbox.to(owner);
        message.transfers.push(Transfer { body, holders, whole: false });
        message.joints.extend(joints);
        // The holders must know which region will send them the body's states.
        let membership = Membership {
            id: link.id,
            epoch: epoch.next(),
            owner: owner as u8,
            holders: holders.union(target),
            warming: RegionSet::EMPTY,
        };
        for rank in holders.without(own).iter() {
            outbox.to(rank).members.push(membership);
        }
        region.set_role(link.handle, Ownership::Ghost { owner }, RegionSet::EMPTY, epoch.next());
    } else {
        region.set_role(link.handle, Ownership::Owner, holders, epoch);
    }
}

/// The part of a region's cell that is outside all its neighbours' halos, in region space.
struct Inner {
    min: Vector,
    max: Vector,
}

impl Inner {
    fn of(region: &Region, partition: &Partition) -> Self {
        let (cell, halo) = (region.cell(), partition.halo_m());
        Self {
            min: convert::region_point(region.anchor(), cell.min.map(|v| v + halo)),
            max: convert::region_point(region.anchor(), cell.max.map(|v| v - halo)),
        }
    }

    /// Returns for how many ticks a body surely stays within, if nothing speeds it up by more than
    /// [`SURPRISE_M_S`]; at most [`LONGEST_REST`]. A body that is hit harder is checked at most that many
    /// ticks late: its ghost comes late, it is never lost.
    fn ticks_within(&self, region: &Region, handle: RigidBodyHandle, dt_s: f32) -> u32 {
        let body = &region.physics().bodies[handle];
        let centre = body.center_of_mass();
        let gap_m = (centre - self.min).min(self.max - centre).min_element() - region.slot(handle).reach_m;
        let step_m = (body.linvel().length() + SURPRISE_M_S) * dt_s;
        ((gap_m / step_m).max(0.0) as u32).min(LONGEST_REST)
    }
}

/// The regions whose halo a body touches.
#[derive(Clone, Copy, Default)]
struct Near {
    within_halo: RegionSet,
    within_hysteresis: RegionSet,
    /// The regions whose halo it may touch before all regions meet again; none where all are neighbours for
    /// good.
    soon: RegionSet,
}

impl Near {
    fn of(
        region: &Region,
        partition: &Partition,
        handle: RigidBodyHandle,
        dt_s: f32,
        looks_ahead: bool,
    ) -> Self {
        let slot = region.slot(handle);
        let body = &region.physics().bodies[handle];
        let travel_m = f64::from(body.linvel().length() * dt_s);
        let bounds = if slot.reach_m > HUB_REACH_M {
            region.world_bounds(handle)
        } else {
            let centre = convert::world_point(region.anchor(), body.center_of_mass());
            Bounds::around(centre, [f64::from(slot.reach_m); 3])
        };
        let halo = bounds.grown(partition.halo_m() + travel_m);
        Self {
            within_halo: partition.touching(&halo),
            within_hysteresis: partition.touching(&halo.grown(HALO_HYSTERESIS_M)),
            soon: if looks_ahead {
                partition.touching(&halo.grown(f64::from(LOOKAHEAD_TICKS) * travel_m))
            } else {
                RegionSet::EMPTY
            },
        }
    }

    fn union(self, other: Self) -> Self {
        Self {
            within_halo: self.within_halo.union(other.within_halo),
            within_hysteresis: self.within_hysteresis.union(other.within_hysteresis),
            soon: self.soon.union(other.soon),
        }
    }
}
