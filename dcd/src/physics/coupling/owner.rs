//! Implements the owner coupling: the owner computes each body. Regions whose halo the body touches hold it
//! as a dynamic ghost, which pushes and is pushed until the owner's state overwrites it after the step.
//! Momentum is not conserved across a border: each side solves the contact with its own copy of the other
//! body.

use super::consensus::{MOVED_M, STILL_M_S, STILL_RAD_S, TURNED_RAD, WAKE_M_S, WAKE_RAD_S, turned_rad};
use super::{Ground, Side, ghosts, halo};
use crate::physics::ShapeError;
use crate::physics::convert;
use crate::physics::outbox::Outbox;
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BorderMessage, Membership, SharedState};
use crate::space::{RegionSet, Tick};

/// Sends the states of owned bodies to their holders, and the changes of holders and owners.
pub(super) fn gather(side: &mut Side, partition: &Partition, tick: Tick, dt_s: f32) {
    let Side { region, border, outbox, .. } = side;
    outbox.clear(tick);
    border.late.look_back(region, tick, dt_s);
    region.update_assemblies();
    tell_states(region, outbox);
    tell_wakes(region, outbox);
    halo::tell(side, partition, tick, dt_s);
}

/// Applies the owners' messages: bodies that arrive, states, and bodies that depart.
pub(super) fn apply<'a>(
    side: &mut Side,
    inbox: impl Iterator<Item = &'a BorderMessage>,
    ground: Ground<'_>,
) -> Result<(), ShapeError> {
    let Side { region, border, .. } = side;
    ghosts::cover_hubs(region, ground)?;
    for message in inbox {
        let sender = ground.rank_of(message);
        ghosts::arrive(region, border, message, sender, ground, false)?;
        write_states(region, &message.states, sender);
        hear_owners(region, &message.members);
        ghosts::depart(region, message, sender);
    }
    border.late.look_ahead(region);
    Ok(())
}

/// Sends the state of every body held elsewhere; of a sleeping body only once.
fn tell_states(region: &mut Region, outbox: &mut Outbox) {
    for index in 0..region.shared().len() {
        let link = region.shared()[index];
        if region.slot(link.handle).told_asleep && region.physics().bodies[link.handle].is_sleeping() {
            continue;
        }
        let state = region.shared_state(link.handle);
        let slot = region.slot_mut(link.handle);
        slot.told_asleep = state.sleeping;
        for rank in slot.holders.iter() {
            outbox.to(rank).states.push(state);
        }
    }
}

/// Asks owners to wake the sleeping bodies whose ghosts something here has moved.
fn tell_wakes(region: &Region, outbox: &mut Outbox) {
    for link in region.ghosts() {
        let slot = region.slot(link.handle);
        let (Some(asleep_at), Ownership::Ghost { owner }) = (slot.asleep_at, slot.role) else { continue };
        let body = &region.physics().bodies[link.handle];
        let stirred = !body.is_sleeping()
            && (body.linvel().length() > WAKE_M_S
                || (body.translation() - asleep_at.translation).length() > MOVED_M);
        if stirred {
            outbox.to(owner).wakes.push(link.id);
        }
    }
}

/// Notes the new owners of bodies of which this region holds ghosts.
fn hear_owners(region: &mut Region, members: &[Membership]) {
    for member in members {
        let Some(handle) = region.handle_of(member.id) else { continue };
        let slot = region.slot(handle);
        if slot.role != Ownership::Owner && member.epoch > slot.epoch {
            let role = Ownership::Ghost { owner: member.owner.into() };
            region.set_role(handle, role, RegionSet::EMPTY, member.epoch);
        }
    }
}

/// Writes the received states. Walks both lists side by side, since both are in id order: no body needs a
/// look-up.
fn write_states(region: &mut Region, states: &[SharedState], sender: usize) {
    let mut at = 0;
    for state in states {
        while region.ghosts().get(at).is_some_and(|link| link.id < state.id) {
            at += 1;
        }
        let Some(&link) = region.ghosts().get(at) else { return };
        if link.id == state.id {
            write_state(region, link, state, sender);
        }
    }
}

fn write_state(region: &mut Region, link: BodyRef, state: &SharedState, sender: usize) {
    let pose = convert::region_from_world(region.anchor(), &state.pose);
    let slot = region.slot_mut(link.handle);
    if state.epoch < slot.epoch {
        return;
    }
    slot.epoch = state.epoch;
    slot.role = Ownership::Ghost { owner: sender };
    slot.asleep_at = state.sleeping.then_some(pose);
    let (linear, angular) = (convert::vector(state.velocity.linear), convert::vector(state.velocity.angular));
    let body = &region.physics().bodies[link.handle];
    if *body.position() == pose && body.linvel() == linear && body.angvel() == angular {
        // A copy that met nobody moved exactly like the owner's. Writing would make Rapier go over it again.
        return;
    }
    let moved_m = (pose.translation - body.translation()).length();
    let turned_rad = turned_rad(pose.rotation, *body.rotation());
    if body.is_sleeping() {
        let differs = moved_m > MOVED_M
            || linear.length() > WAKE_M_S
            || angular.length() > WAKE_RAD_S
            || turned_rad > 5.0 * TURNED_RAD;
        if differs {
            region.put_copy(link.handle, pose);
            let body = &mut region.world_mut().bodies[link.handle];
            body.set_linvel(linear, false);
            body.set_angvel(angular, false);
            region.world_mut().wake_up(link.handle, true);
        }
        return;
    }
    let body = &mut region.world_mut().bodies[link.handle];
    body.set_linvel(linear, false);
    body.set_angvel(angular, false);
    let still = linear.length() < STILL_M_S
        && angular.length() < STILL_RAD_S
        && moved_m < MOVED_M
        && turned_rad < TURNED_RAD;
    if !still {
        region.put_copy(link.handle, pose);
    }
}
