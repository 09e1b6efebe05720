//! Sends decisions to all regions concerned, with the bodies that these do not have yet, and applies the
//! decisions here and those received.

use rapier3d::prelude::{Pose, RigidBodyHandle};

use crate::physics::convert;
use crate::physics::coupling::{Border, strike};
use crate::physics::outbox::Outbox;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyRecord, ContactPose, Membership, Transfer};
use crate::space::RegionSet;

/// Sends a membership to all members, new, remaining and former. Sends the body to the new ones too, with how
/// it lay when its contacts were found.
#[expect(clippy::too_many_arguments, reason = "one word of one owner")]
pub(super) fn tell(
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
        outbox.to(rank).ghosts.push(record.clone());
        outbox.to(rank).contact_poses.extend(lay);
        outbox.to(rank).joints.extend_from_slice(&joints);
    }
    for rank in told.iter() {
        outbox.to(rank).members.push(membership);
    }
}

/// Sends a body that no other region holds to its new owner, whole. The caller must remove it here.
pub(super) fn hand_over(region: &Region, outbox: &mut Outbox, link: BodyRef, owner: usize) {
    let record = region.body_record(link.handle);
    let epoch = record.epoch.next();
    let whole = region.slot(link.handle).whole;
    let body = BodyRecord { epoch, ..record };
    let joints: Vec<_> = region.joints_of(link.handle).collect();
    let message = outbox.to(owner);
    message.transfers.push(Transfer { body, holders: RegionSet::EMPTY, whole });
    message.joints.extend(joints);
}

/// Applies the owners' decisions: sets the members of bodies, and splits masses anew.
pub(in crate::physics::coupling) fn commit<'a>(
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
                region.give_up(decision.link.id);
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
            region.give_up(membership.id);
            continue;
        }
        if slot.role != Ownership::Owner && usize::from(membership.owner) != region.rank() {
            let role = Ownership::Ghost { owner: membership.owner.into() };
            region.set_role(handle, role, members.without(own), membership.epoch);
        }
        border.shared.set_members(region, handle, members, membership.warming);
    }
}
