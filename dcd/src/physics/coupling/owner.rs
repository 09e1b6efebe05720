//! Owner coupling: each body is computed by its owner; regions whose halo it touches hold a dynamic replica, which feels
//! and is felt until the owner's word overwrites it after the step. A body is replicated before it is transferred
//! (thesis 3.3.3), so its contacts and their warm start are there when authority changes.

use rapier3d::prelude::*;

use super::{Change, Ground};
use crate::physics::ShapeError;
use crate::physics::convert;
use crate::physics::partition::{HALO_HYSTERESIS_M, HUB_REACH_M, OWNER_HYSTERESIS_M, Partition};
use crate::physics::region::{Link, Region, Role};
use crate::protocol::{BodyRecord, BorderMessage, SharedState, Transfer};
use crate::space::{Bounds, RegionSet, Tick};

/// Below these a replica's pose is left alone: a pose written every step would never let it sleep.
const DEAD_BAND_M: f32 = 2e-3;
const DEAD_BAND_RAD: f32 = 2e-3;
const DEAD_BAND_M_S: f32 = 0.05;
const DEAD_BAND_RAD_S: f32 = 0.1;
/// A sleeping replica is left alone unless its owner says something that differs by more than this.
const WAKE_M_S: f32 = 0.05;

/// Bodies far from any border are looked at again after at most so many ticks.
const LONGEST_REST: u32 = 8;
/// By how much a body may be sped up meanwhile without being seen late.
const SURPRISE_M_S: f32 = 10.0;

/// Says which regions must hold the bodies inserted since the last step.
pub(super) fn announce(region: &mut Region, partition: &Partition, tick: Tick, dt_s: f32) {
    clear_outbox(region, tick);
    region.update_assemblies();
    let fresh = std::mem::take(&mut region.fresh);
    let here = fresh.iter().filter(|link| region.handle_of(link.id) == Some(link.handle));
    let handles: Vec<_> = here.map(|link| link.handle).collect();
    tell_changes(region, partition, tick, dt_s, handles.into_iter());
}

/// Says how owned bodies moved, and to whom they must go.
pub(super) fn gather(region: &mut Region, partition: &Partition, tick: Tick, dt_s: f32) {
    if partition.len() == 1 {
        region.fresh.clear();
        return;
    }
    clear_outbox(region, tick);
    region.update_assemblies();
    tell_states(region);
    tell_wakes(region);
    // A body inserted asleep is not among the awake.
    let mut looked_at = std::mem::take(&mut region.looked_at);
    looked_at.clear();
    looked_at.extend(
        region
            .fresh
            .iter()
            .filter(|link| region.handle_of(link.id) == Some(link.handle))
            .map(|link| link.handle),
    );
    region.fresh.clear();
    let now = tick.0 as u32;
    let due = |handle: &RigidBodyHandle| region.due[handle.into_raw_parts().0 as usize] <= now;
    looked_at.extend(region.physics().islands.active_bodies().filter(due));
    tell_changes(region, partition, tick, dt_s, looked_at.iter().copied());
    region.looked_at = looked_at;
}

fn clear_outbox(region: &mut Region, tick: Tick) {
    for message in &mut region.outbox {
        message.clear();
        message.tick = tick;
    }
}

/// Says of each of these bodies, as far as it is owned here, what is new about its holders and its owner.
fn tell_changes(
    region: &mut Region,
    partition: &Partition,
    tick: Tick,
    dt_s: f32,
    handles: impl Iterator<Item = RigidBodyHandle>,
) {
    let mut changes = std::mem::take(&mut region.changes);
    find_changes(region, partition, tick, dt_s, handles, &mut changes);
    for change in changes.drain(..) {
        tell_change(region, &change);
    }
    region.changes = changes;
}

/// Takes in the word of the owners.
pub(super) fn apply<'a>(
    region: &mut Region,
    inbox: impl Iterator<Item = &'a BorderMessage>,
    ground: Ground<'_>,
) -> Result<(), ShapeError> {
    region.arrived.clear();
    cover_hubs(region, ground)?;
    for message in inbox {
        let sender = ground.partition.rank_of(message.from).expect("messages come from regions of this tree");
        for transfer in &message.transfers {
            take_over(region, transfer, sender, ground)?;
        }
        for body in &message.replicas {
            hold(region, body, sender, ground)?;
        }
        for joint in &message.joints {
            ground.statics.ensure(region, joint, ground.shapes)?;
            region.insert_joint(joint);
        }
        write_states(region, &message.states, sender);
        for &id in &message.drops {
            let handle = region.handle_of(id);
            // The word may have crossed a transfer: only a replica of the sender's is dropped.
            if handle.is_some_and(|handle| region.slot(handle).role == Role::Replica { owner: sender }) {
                region.remove(id);
            }
        }
        for &id in &message.wakes {
            if let Some(handle) = region.handle_of(id)
                && region.slot(handle).role == Role::Owner
            {
                region.world_mut().wake_up(handle, true);
            }
        }
    }
    Ok(())
}

/// Large bodies reach far out of the cell: the ground under all of them must be here.
fn cover_hubs(region: &mut Region, ground: Ground<'_>) -> Result<(), ShapeError> {
    for index in 0..region.shared.len() + region.replicas.len() {
        let owned = region.shared.len();
        let link = if index < owned { region.shared[index] } else { region.replicas[index - owned] };
        if region.slot(link.handle).reach_m > HUB_REACH_M {
            ground.statics.cover(region, link.handle, ground.shapes)?;
        }
    }
    Ok(())
}

/// Every body held elsewhere: where it is, and once that it fell asleep.
fn tell_states(region: &mut Region) {
    for index in 0..region.shared.len() {
        let link = region.shared[index];
        if region.slot(link.handle).told_asleep && region.physics().bodies[link.handle].is_sleeping() {
            continue;
        }
        let state = region.shared_state(link.handle);
        let slot = region.slot_mut(link.handle);
        slot.told_asleep = state.sleeping;
        for rank in slot.holders.iter() {
            region.outbox[rank].states.push(state);
        }
    }
}

/// Replicas that something here has stirred although their owner sleeps.
fn tell_wakes(region: &mut Region) {
    for index in 0..region.replicas.len() {
        let link = region.replicas[index];
        let slot = region.slot(link.handle);
        let (Some(asleep_at), Role::Replica { owner }) = (slot.asleep_at, slot.role) else { continue };
        let body = &region.physics().bodies[link.handle];
        let stirred = !body.is_sleeping()
            && (body.linvel().length() > WAKE_M_S
                || (body.translation() - asleep_at.translation).length() > DEAD_BAND_M);
        if stirred {
            region.outbox[owner].wakes.push(link.id);
        }
    }
}

/// Looks at these bodies and at every assembly with one of them; `changes` come out in id order, each body once.
fn find_changes(
    region: &mut Region,
    partition: &Partition,
    tick: Tick,
    dt_s: f32,
    handles: impl Iterator<Item = RigidBodyHandle>,
    changes: &mut Vec<Change>,
) {
    let inner = Inner::of(region, partition);
    let mut assemblies = Vec::new();
    for handle in handles {
        let slot = region.slot(handle);
        if slot.role != Role::Owner {
            continue;
        }
        if let Some(assembly) = slot.assembly {
            assemblies.push(assembly);
            continue;
        }
        let rest = inner.ticks_within(region, handle, dt_s);
        if slot.holders.is_empty() && rest > 0 {
            region.due[handle.into_raw_parts().0 as usize] = tick.0 as u32 + rest;
            continue;
        }
        let near = Near::of(region, partition, handle, dt_s);
        let com = region.physics().bodies[handle].center_of_mass();
        let centre = convert::world_point(region.anchor(), com);
        let link = Link { id: slot.id, handle };
        propose(region, link, near, new_owner(region, partition, centre), changes);
    }
    assemblies.sort_unstable();
    assemblies.dedup();
    for index in assemblies {
        let members = std::mem::take(&mut region.assemblies[index as usize].members);
        look_at_assembly(region, partition, &inner, &members, tick, dt_s, changes);
        region.assemblies[index as usize].members = members;
    }
    changes.sort_unstable_by_key(|change| change.link.id);
    changes.dedup_by_key(|change| change.link.id);
}

/// The same for bodies that joints tie together: what one of them needs, all get.
fn look_at_assembly(
    region: &mut Region,
    partition: &Partition,
    inner: &Inner,
    members: &[Link],
    tick: Tick,
    dt_s: f32,
    changes: &mut Vec<Change>,
) {
    let rest = members.iter().map(|link| inner.ticks_within(region, link.handle, dt_s)).min().unwrap_or(0);
    let shared = members.iter().any(|link| !region.slot(link.handle).holders.is_empty());
    if rest > 0 && !shared {
        for link in members {
            region.due[link.handle.into_raw_parts().0 as usize] = tick.0 as u32 + rest;
        }
        return;
    }
    let near = members
        .iter()
        .fold(Near::default(), |near, link| near.union(Near::of(region, partition, link.handle, dt_s)));
    // The lowest member leads: where it goes, all go.
    let lead = region.physics().bodies[members[0].handle].center_of_mass();
    let owner = new_owner(region, partition, convert::world_point(region.anchor(), lead));
    for &link in members {
        propose(region, link, near, owner, changes);
    }
}

fn propose(region: &Region, link: Link, near: Near, owner: usize, changes: &mut Vec<Change>) {
    let own = RegionSet::only(region.rank());
    let held = region.slot(link.handle).holders;
    let still_near = RegionSet::from_bits(held.bits() & near.within_hysteresis.bits());
    let holders = near.within_halo.union(still_near).without(own);
    if holders != held || owner != region.rank() {
        changes.push(Change { link, holders, owner });
    }
}

/// The region of the centre, once the centre has left the present one for good.
fn new_owner(region: &Region, partition: &Partition, centre: [f64; 3]) -> usize {
    if region.cell().excess_m(centre) > OWNER_HYSTERESIS_M {
        partition.rank_at(centre)
    } else {
        region.rank()
    }
}

/// Sends the body to its new holders, calls it back from those that need it no more, and hands over authority.
fn tell_change(region: &mut Region, change: &Change) {
    let Change { link, holders, owner } = *change;
    let own = RegionSet::only(region.rank());
    let slot = region.slot(link.handle);
    let (before, epoch) = (slot.holders, slot.epoch);
    let record = region.body_record(link.handle);
    let joints: Vec<_> = region.joints_of(link.handle).collect();
    let leaving = owner != region.rank();
    let target = RegionSet::only(owner);
    let added = holders.without(before).without(if leaving { target } else { RegionSet::EMPTY });
    for rank in added.iter() {
        region.outbox[rank].replicas.push(record.clone());
        region.outbox[rank].joints.extend_from_slice(&joints);
    }
    for rank in before.without(holders).without(if leaving { target } else { RegionSet::EMPTY }).iter() {
        region.outbox[rank].drops.push(link.id);
    }
    if leaving {
        let holders = holders.union(own).without(target);
        let body = BodyRecord { epoch: epoch.next(), ..record };
        let message = &mut region.outbox[owner];
        message.transfers.push(Transfer { body, holders: holders.bits() });
        message.joints.extend(joints);
        region.set_role(link.handle, Role::Replica { owner }, RegionSet::EMPTY, epoch.next());
    } else {
        region.set_role(link.handle, Role::Owner, holders, epoch);
    }
}

fn take_over(
    region: &mut Region,
    transfer: &Transfer,
    sender: usize,
    ground: Ground<'_>,
) -> Result<(), ShapeError> {
    let body = &transfer.body;
    let holders = RegionSet::from_bits(transfer.holders).without(RegionSet::only(region.rank()));
    let handle = match region.handle_of(body.id) {
        None => {
            hold(region, body, sender, ground)?;
            region.handle_of(body.id).expect("just inserted")
        }
        Some(handle) => handle,
    };
    assert!(
        region.slot(handle).role != Role::Owner,
        "{} is transferred to {} which owns it already",
        body.id,
        region.id()
    );
    region.set_role(handle, Role::Owner, holders, body.epoch);
    region.arrived.push(Link { id: body.id, handle });
    write_whole(region, handle, body);
    Ok(())
}

/// Inserts a replica, or renews one that is here already.
fn hold(region: &mut Region, body: &BodyRecord, sender: usize, ground: Ground<'_>) -> Result<(), ShapeError> {
    let role = Role::Replica { owner: sender };
    if let Some(handle) = region.handle_of(body.id) {
        let slot = region.slot(handle);
        if slot.role == Role::Owner {
            return Ok(());
        }
        if slot.traits == body.traits && slot.epoch <= body.epoch {
            region.set_role(handle, role, RegionSet::EMPTY, body.epoch);
            region.slot_mut(handle).confirmed = true;
            write_whole(region, handle, body);
            return Ok(());
        }
        region.remove(body.id);
    }
    let handle = region.insert(body, role, RegionSet::EMPTY, ground.shapes)?;
    ground.statics.cover(region, handle, ground.shapes)
}

/// Makes a copy that is here already equal to the record.
fn write_whole(region: &mut Region, handle: RigidBodyHandle, body: &BodyRecord) {
    let state = &body.state;
    let pose = convert::region_from_world(region.anchor(), &state.pose);
    let rigid_body = &mut region.world_mut().bodies[handle];
    rigid_body.set_position(pose, false);
    rigid_body.set_linvel(convert::vector(state.velocity.linear), false);
    rigid_body.set_angvel(convert::vector(state.velocity.angular), false);
    rigid_body.reset_forces(false);
    rigid_body.reset_torques(false);
    rigid_body.add_force(convert::vector(state.force), false);
    rigid_body.add_torque(convert::vector(state.torque), false);
    rigid_body.activation_mut().time_since_can_sleep = state.still_s;
    if !state.sleeping && rigid_body.is_sleeping() {
        region.world_mut().wake_up(handle, true);
    }
}

/// Walks both lists, which are in id order, side by side: no look-up a body.
fn write_states(region: &mut Region, states: &[SharedState], sender: usize) {
    let mut at = 0;
    for state in states {
        while at < region.replicas.len() && region.replicas[at].id < state.id {
            at += 1;
        }
        let Some(&link) = region.replicas.get(at) else { return };
        if link.id == state.id {
            write_state(region, link, state, sender);
        }
    }
}

fn write_state(region: &mut Region, link: Link, state: &SharedState, sender: usize) {
    let pose = convert::region_from_world(region.anchor(), &state.pose);
    let slot = region.slot_mut(link.handle);
    if state.epoch < slot.epoch {
        return;
    }
    slot.epoch = state.epoch;
    slot.role = Role::Replica { owner: sender };
    slot.asleep_at = state.sleeping.then_some(pose);
    let (linear, angular) = (convert::vector(state.velocity.linear), convert::vector(state.velocity.angular));
    let body = &region.physics().bodies[link.handle];
    if *body.position() == pose && body.linvel() == linear && body.angvel() == angular {
        // A copy that met nobody moved exactly like the owner's; writing would make Rapier go over it again.
        return;
    }
    let body = &mut region.world_mut().bodies[link.handle];
    let moved_m = (pose.translation - body.translation()).length();
    let turned_rad = 2.0 * pose.rotation.dot(*body.rotation()).abs().min(1.0).acos();
    if body.is_sleeping() {
        let differs = moved_m > DEAD_BAND_M
            || linear.length() > WAKE_M_S
            || angular.length() > WAKE_M_S
            || turned_rad > 5.0 * DEAD_BAND_RAD;
        if differs {
            body.set_position(pose, false);
            body.set_linvel(linear, false);
            body.set_angvel(angular, false);
            region.world_mut().wake_up(link.handle, true);
        }
        return;
    }
    body.set_linvel(linear, false);
    body.set_angvel(angular, false);
    let still = linear.length() < DEAD_BAND_M_S
        && angular.length() < DEAD_BAND_RAD_S
        && moved_m < DEAD_BAND_M
        && turned_rad < DEAD_BAND_RAD;
    if !still {
        body.set_position(pose, false);
    }
}

/// The part of a region where nothing concerns its neighbours, in region space.
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

    /// For how many ticks a body surely stays within, if nothing speeds it up by more than [`SURPRISE_M_S`]; at most
    /// [`LONGEST_REST`]. A body that is hit harder is seen at most so many ticks late: it is replicated late, never lost.
    fn ticks_within(&self, region: &Region, handle: RigidBodyHandle, dt_s: f32) -> u32 {
        let body = &region.physics().bodies[handle];
        let centre = body.center_of_mass();
        let gap_m = (centre - self.min).min(self.max - centre).min_element() - region.slot(handle).reach_m;
        let step_m = (body.linvel().length() + SURPRISE_M_S) * dt_s;
        ((gap_m / step_m).max(0.0) as u32).min(LONGEST_REST)
    }
}

/// The regions whose cell a body comes near.
#[derive(Clone, Copy, Default)]
struct Near {
    within_halo: RegionSet,
    within_hysteresis: RegionSet,
}

impl Near {
    fn of(region: &Region, partition: &Partition, handle: RigidBodyHandle, dt_s: f32) -> Self {
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
        }
    }

    fn union(self, other: Self) -> Self {
        Self {
            within_halo: self.within_halo.union(other.within_halo),
            within_hysteresis: self.within_hysteresis.union(other.within_hysteresis),
        }
    }
}
