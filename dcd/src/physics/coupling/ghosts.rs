//! Receives bodies, joints, transfers and drops from other regions, and inserts and removes ghosts: the
//! receiving end of `halo` and `ownership`.

use rapier3d::prelude::*;

use super::{Border, Ground};
use crate::physics::ShapeError;
use crate::physics::convert;
use crate::physics::partition::HUB_REACH_M;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::{BodyKind, BodyRecord, BorderMessage, ContactPose, Transfer};
use crate::space::RegionSet;

/// The farthest, in metres, that a body is put away from where it is, whatever its owner says.
const FARTHEST_DISPLACED_M: f32 = 1.0;

/// Inserts the bodies and joints of a message: bodies transferred to this region, and ghosts.
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
    let mut held = Vec::new();
    for body in &message.ghosts {
        let Some(handle) = hold(region, body, sender, ground)? else { continue };
        if shares_mass {
            region.begin_mass_split(handle);
            border.shared.begin(handle);
            held.push(BodyRef { id: body.id, handle });
        }
    }
    displace(region, border, &message.contact_poses, &held);
    for joint in &message.joints {
        ground.statics.ensure(region, joint, ground.shapes)?;
        region.insert_joint(joint);
    }
    Ok(())
}

/// Puts ghosts that this region has just come to hold where they lay when their owner found their contacts,
/// until the next exchange, so that the step in between finds the same contacts. If another dynamic body
/// might touch one of them there, all stay where they are.
fn displace(region: &mut Region, border: &mut Border, poses: &[ContactPose], held: &[BodyRef]) {
    if poses.is_empty() {
        return;
    }
    let mut held = held.to_vec();
    held.sort_by_key(|link| link.id);
    let place = |lay: &ContactPose| {
        let link = held[held.binary_search_by_key(&lay.id, |link| link.id).ok()?];
        let pose = convert::region_from_world(region.anchor(), &lay.pose);
        let far_m = (pose.translation - region.physics().bodies[link.handle].translation()).length();
        (far_m <= FARTHEST_DISPLACED_M).then_some((link.handle, pose))
    };
    let places: Vec<_> = poses.iter().filter_map(place).collect();
    let world = region.physics();
    let is_another = |_: ColliderHandle, collider: &Collider| {
        let parent = collider.parent().filter(|parent| world.bodies[*parent].is_dynamic());
        parent.is_some_and(|parent| !held.iter().any(|link| link.handle == parent))
    };
    let others = world.query_pipeline_with_filter(QueryFilter::new().predicate(&is_another));
    let touches = |&(handle, pose): &(RigidBodyHandle, Pose)| {
        world.bodies[handle].colliders().iter().any(|&collider| {
            let collider = &world.colliders[collider];
            let at = pose * collider.position_wrt_parent().copied().unwrap_or_default();
            others.intersect_aabb_conservative(collider.shape().compute_aabb(&at)).next().is_some()
        })
    };
    if places.iter().any(touches) {
        return;
    }
    for (handle, pose) in places {
        region.put_copy(handle, pose);
        if let Some(shared) = border.shared.get_mut(handle) {
            shared.displaced = true;
        }
    }
}

/// Removes ghosts that are no longer needed, and wakes owned bodies whose ghosts something elsewhere has
/// moved.
pub(super) fn depart(region: &mut Region, message: &BorderMessage, sender: usize) {
    for &id in &message.drops {
        let handle = region.handle_of(id);
        // The message may have crossed a transfer: only a ghost of the sender's is dropped.
        if handle.is_some_and(|handle| region.slot(handle).role == Ownership::Ghost { owner: sender }) {
            region.give_up(id);
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
        None => hold(region, body, sender, ground)?,
        held => held,
    };
    let Some(handle) = handle else { return Ok(()) };
    // Otherwise the sender is mistaken or malicious: the owner at the highest epoch stays, and an immovable
    // body has no owner.
    let slot = region.slot(handle);
    if !matches!(slot.role, Ownership::Ghost { .. }) || body.epoch < slot.epoch {
        let (role, epoch) = (slot.role, slot.epoch);
        tracing::warn!(body = %body.id, sender, ?role, %epoch, told = %body.epoch, "a transfer is refused");
        return Ok(());
    }
    region.set_role(handle, Ownership::Owner, holders, body.epoch);
    let slot = region.slot_mut(handle);
    (slot.whole, slot.doubt) = (transfer.whole, 0);
    border.note_arrival(BodyRef { id: body.id, handle });
    // What comes asleep is not looked at by itself.
    if body.state.sleeping {
        border.overlooked.push(handle);
    }
    region.set_gait(body.id, body.state.gait);
    region.set_drive(body.id, body.state.drive);
    // Copies with a part of the mass follow their consensus instead.
    if !shares_mass {
        write_whole(region, handle, body);
    }
    Ok(())
}

/// Inserts a ghost, or renews one that is here already, and returns it. Returns `None` if what is here is
/// no ghost, or if the body cannot be built: a member that invents shapes must not end this process.
fn hold(
    region: &mut Region,
    body: &BodyRecord,
    sender: usize,
    ground: Ground<'_>,
) -> Result<Option<RigidBodyHandle>, ShapeError> {
    let role = Ownership::Ghost { owner: sender };
    if let Some(handle) = region.handle_of(body.id) {
        let slot = region.slot(handle);
        if !matches!(slot.role, Ownership::Ghost { .. }) {
            return Ok(None);
        }
        if slot.traits == body.traits && slot.epoch <= body.epoch {
            region.set_role(handle, role, RegionSet::EMPTY, body.epoch);
            region.slot_mut(handle).confirmed = true;
            write_whole(region, handle, body);
            return Ok(Some(handle));
        }
        region.remove(body.id);
    }
    match region.insert(body.clone(), role, RegionSet::EMPTY, ground.shapes) {
        Ok(handle) => {
            ground.statics.cover(region, handle, ground.shapes)?;
            Ok(Some(handle))
        }
        Err(error) => {
            tracing::warn!(body = %body.id, sender, %error, "a body is refused");
            Ok(None)
        }
    }
}

/// Makes a copy that is already here equal to the record.
fn write_whole(region: &mut Region, handle: RigidBodyHandle, body: &BodyRecord) {
    let state = &body.state;
    let pose = convert::region_from_world(region.anchor(), &state.pose);
    let mut is_another = false;
    region.put_copy(handle, pose);
    let rigid_body = &mut region.world_mut().bodies[handle];
    // A kinematic ghost of the proxy coupling would not take the forces.
    if body.traits.kind == BodyKind::Dynamic && !rigid_body.is_dynamic() {
        rigid_body.set_body_type(RigidBodyType::Dynamic, false);
        is_another = true;
    }
    rigid_body.user_data = body.user_data;
    rigid_body.set_linvel(convert::vector(state.velocity.linear), false);
    rigid_body.set_angvel(convert::vector(state.velocity.angular), false);
    rigid_body.reset_forces(false);
    rigid_body.reset_torques(false);
    rigid_body.add_force(convert::vector(state.force), false);
    rigid_body.add_torque(convert::vector(state.torque), false);
    rigid_body.activation_mut().time_since_can_sleep = state.still_s;
    let wakes = !state.sleeping && rigid_body.is_sleeping();
    if is_another {
        region.look_at_ties();
    }
    region.set_gait(body.id, state.gait);
    region.set_drive(body.id, state.drive);
    if wakes {
        region.world_mut().wake_up(handle, true);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rapier3d::prelude::*;

    use crate::physics::{Coupling, Partition, RegionHost, StepSettings};
    use crate::protocol::{BodyKind, BodyRecord, BorderMessage, ContactPose, ShapeHash, Transfer, WorldPose};
    use crate::space::{BodyId, Bounds, DistributionTree, Epoch, RegionSet};

    /// A region with a slab that does not move, and the record of the slab.
    fn host(coupling: Coupling) -> (RegionHost, BodyRecord) {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [8.0; 3]), 2).unwrap();
        let partition = Partition::new(tree, None);
        let right = partition.leaves()[1];
        let step = StepSettings { coupling, ..StepSettings::default() };
        let mut host = RegionHost::new(partition, step, 1, &[right]).unwrap();
        let slab = ColliderBuilder::cuboid(1.0, 1.0, 1.0);
        let (id, at) = (BodyId::persistent(0), WorldPose::at([5.0, 0.0, 0.0]));
        let record = host.shapes_mut().describe(id, at, &RigidBodyBuilder::fixed().build(), &[slab]).unwrap();
        host.insert(vec![record.clone()], &[]).unwrap();
        (host, record)
    }

    #[test]
    fn a_copy_lies_where_its_owner_says_unless_that_is_far_off_or_something_is_there() {
        for (aside_m, crowded, lies) in [(0.1, false, true), (0.1, true, false), (1.5, false, false)] {
            let (mut host, slab) = host(Coupling::Auto);
            let mut copy = BodyRecord { id: BodyId::persistent(1), ..slab.clone() };
            let mut other = BodyRecord { id: BodyId::persistent(2), ..slab };
            Arc::make_mut(&mut copy.traits).kind = BodyKind::Dynamic;
            Arc::make_mut(&mut other.traits).kind = BodyKind::Dynamic;
            copy.state.pose = WorldPose::at([5.0, 4.0, 0.0]);
            other.state.pose = WorldPose::at([if crowded { 7.05 } else { 17.0 }, 4.0, 0.0]);
            host.insert(vec![other], &[]).unwrap();
            let [left, right] = [0, 1].map(|rank| host.partition().leaves()[rank]);
            let tick = host.tick().next();
            host.compute();
            let lay = ContactPose { id: copy.id, pose: WorldPose::at([5.0 + aside_m, 4.0, 0.0]) };
            let (ghosts, contact_poses) = (vec![copy.clone()], vec![lay]);
            let message =
                BorderMessage { from: left, to: right, tick, ghosts, contact_poses, ..Default::default() };
            host.accept(message);
            host.exchange().unwrap();
            host.end_tick();
            let region = host.regions().next().unwrap();
            let at_m = region.physics().bodies[region.handle_of(copy.id).unwrap()].translation().x;
            let wanted_m = if lies { 5.0 + aside_m as f32 } else { 5.0 };
            assert!((at_m - wanted_m).abs() < 1e-3, "{aside_m} m aside, crowded: {crowded}: at {at_m} m");
        }
    }

    #[test]
    fn bodies_of_unknown_shapes_and_what_does_not_move_are_not_taken_from_another_process() {
        for coupling in [Coupling::Owner, Coupling::Proxy, Coupling::Auto] {
            let (mut host, slab) = host(coupling);
            let stolen = BodyRecord { epoch: Epoch(9), ..slab.clone() };
            let mut invented = BodyRecord { id: BodyId::persistent(1), ..slab.clone() };
            let traits = Arc::make_mut(&mut invented.traits);
            traits.kind = BodyKind::Dynamic;
            traits.colliders[0].shape = ShapeHash([7; 16]);
            let transfer = |body: &BodyRecord| {
                let (body, holders) = (body.clone(), RegionSet::EMPTY);
                Transfer { body, holders, whole: false }
            };
            let transfers = vec![transfer(&stolen), transfer(&invented)];
            let ghosts = vec![stolen, invented.clone()];
            let [left, right] = [0, 1].map(|rank| host.partition().leaves()[rank]);
            let tick = host.tick().next();
            host.compute();
            host.accept(BorderMessage {
                from: left,
                to: right,
                tick,
                transfers,
                ghosts,
                ..Default::default()
            });
            host.exchange().unwrap();
            host.end_tick();
            assert!(host.owned(slab.id).is_none() && host.owned(invented.id).is_none(), "{coupling:?}");
            let region = host.regions().next().unwrap();
            assert!(region.handle_of(slab.id).is_some(), "{coupling:?}: it is still there");
            assert!(region.handle_of(invented.id).is_none(), "{coupling:?}");
        }
    }
}
