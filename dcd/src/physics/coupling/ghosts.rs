//! Receives bodies, joints, transfers and drops from other regions, and inserts and removes replicas: the receiving end of `halo`
//! and `membership`.

use rapier3d::prelude::*;

use super::{Border, Ground};
use crate::physics::ShapeError;
use crate::physics::convert;
use crate::physics::partition::HUB_REACH_M;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyKind, BodyRecord, BorderMessage, Transfer};
use crate::space::RegionSet;

/// Inserts the bodies and joints of a message: bodies transferred to this region, and replicas.
pub(super) fn arrive(
    region: &mut Region,
    border: &mut Border,
    message: &BorderMessage,
    sender: usize,
    ground: Ground<'_>,
    shares_mass: bool,
) -> Result<(), ShapeError> {
    for transfer in &message.transfers {
        take_over(region, border, transfer, sender, ground, shares_mass)?;
    }
    for body in &message.replicas {
        hold(region, body, sender, ground)?;
        let handle = region.handle_of(body.id).expect("held from now on");
        if shares_mass && region.slot(handle).role != Ownership::Owner {
            region.begin_mass_split(handle);
            border.shared.begin(handle);
        }
    }
    for joint in &message.joints {
        ground.statics.ensure(region, joint, ground.shapes)?;
        region.insert_joint(joint);
    }
    Ok(())
}

/// Removes replicas that are needed no more, and wakes owned bodies whose replicas something elsewhere has moved.
pub(super) fn depart(region: &mut Region, message: &BorderMessage, sender: usize) {
    for &id in &message.drops {
        let handle = region.handle_of(id);
        // The message may have crossed a transfer: only a replica of the sender's is dropped.
        if handle.is_some_and(|handle| region.slot(handle).role == Ownership::Replica { owner: sender }) {
            region.remove(id);
        }
    }
    for &id in &message.wakes {
        if let Some(handle) = region.handle_of(id)
            && region.slot(handle).role == Ownership::Owner
        {
            region.world_mut().wake_up(handle, true);
        }
    }
}

/// Inserts the immovable bodies under large shared bodies, which reach far out of the cell.
pub(super) fn cover_hubs(region: &mut Region, ground: Ground<'_>) -> Result<(), ShapeError> {
    for place in 0..region.held_elsewhere_count() {
        let link = region.held_elsewhere_at(place);
        if region.slot(link.handle).reach_m > HUB_REACH_M {
            ground.statics.cover(region, link.handle, ground.shapes)?;
        }
    }
    Ok(())
}

fn take_over(
    region: &mut Region,
    border: &mut Border,
    transfer: &Transfer,
    sender: usize,
    ground: Ground<'_>,
    shares_mass: bool,
) -> Result<(), ShapeError> {
    let body = &transfer.body;
    let holders = transfer.holders.without(RegionSet::only(region.rank()));
    let handle = match region.handle_of(body.id) {
        None => {
            hold(region, body, sender, ground)?;
            region.handle_of(body.id).expect("just inserted")
        }
        Some(handle) => handle,
    };
    // The sender is mistaken or malicious: the owner at the highest epoch stays.
    let slot = region.slot(handle);
    if slot.role == Ownership::Owner || body.epoch < slot.epoch {
        let (owned, epoch) = (slot.role == Ownership::Owner, slot.epoch);
        tracing::warn!(body = %body.id, sender, owned, %epoch, told = %body.epoch, "a transfer is refused");
        return Ok(());
    }
    region.set_role(handle, Ownership::Owner, holders, body.epoch);
    let slot = region.slot_mut(handle);
    (slot.whole, slot.doubt) = (transfer.whole, 0);
    border.note_arrival(BodyRef { id: body.id, handle });
    region.set_gait(body.id, body.state.gait);
    region.set_drive(body.id, body.state.drive);
    // Copies with a part of the mass follow their consensus instead.
    if !shares_mass {
        write_whole(region, handle, body);
    }
    Ok(())
}

/// Inserts a replica, or renews one that is here already.
fn hold(region: &mut Region, body: &BodyRecord, sender: usize, ground: Ground<'_>) -> Result<(), ShapeError> {
    let role = Ownership::Replica { owner: sender };
    if let Some(handle) = region.handle_of(body.id) {
        let slot = region.slot(handle);
        if slot.role == Ownership::Owner {
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
    // A kinematic ghost of the proxy coupling would not take the forces.
    if body.traits.kind == BodyKind::Dynamic && !rigid_body.is_dynamic() {
        rigid_body.set_body_type(RigidBodyType::Dynamic, false);
    }
    rigid_body.set_position(pose, false);
    rigid_body.set_linvel(convert::vector(state.velocity.linear), false);
    rigid_body.set_angvel(convert::vector(state.velocity.angular), false);
    rigid_body.reset_forces(false);
    rigid_body.reset_torques(false);
    rigid_body.add_force(convert::vector(state.force), false);
    rigid_body.add_torque(convert::vector(state.torque), false);
    rigid_body.activation_mut().time_since_can_sleep = state.still_s;
    let wakes = !state.sleeping && rigid_body.is_sleeping();
    region.set_gait(body.id, state.gait);
    region.set_drive(body.id, state.drive);
    if wakes {
        region.world_mut().wake_up(handle, true);
    }
}
