//! Makes a local world of a served one that was saved, so that both have the same files, and back.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::choice::Why;
use super::local::LocalWorld;
use super::{ProcessError, WorldError};
use crate::cluster::SavedWorld;
use crate::physics::{HostError, Partition, RegionHost, ShapeError};
use crate::protocol::{
    BodyRecord, Check, ContactLedger, EnvironmentProperties, Invalid, JointRecord, ShapeRecord, WorldEvents,
};

/// Returns all movable and fixed bodies of a local world, in id order, its shapes and its joints.
pub(super) fn contents(world: &LocalWorld) -> (Vec<BodyRecord>, Vec<ShapeRecord>, Vec<JointRecord>) {
    let host = world.host();
    let movable = host.owned_bodies().map(|(_, region, handle)| region.body_record(handle));
    let mut bodies: Vec<_> = movable.chain(host.scenery().cloned()).collect();
    bodies.sort_unstable_by_key(|body| body.id);
    let joints: BTreeMap<_, _> =
        bodies.iter().flat_map(|body| host.joints_of(body.id)).map(|joint| (joint.id, joint)).collect();
    (bodies, host.shapes().records(), joints.into_values().collect())
}

/// Returns a local world with what was saved of a served one, its regions and its tick.
pub(super) fn local_of(
    saved: SavedWorld,
    properties: &EnvironmentProperties,
) -> Result<LocalWorld, WorldError> {
    let partition = Partition::new(saved.tree, properties.halo_m);
    let leaves = partition.leaves().to_vec();
    let mut host = RegionHost::new(partition, properties.step.into(), 1, &leaves)?;
    host.set_balance(properties.balance);
    // Parts before the compounds that name them.
    let (compounds, parts): (Vec<_>, Vec<_>) = saved.shapes.into_iter().partition(ShapeRecord::is_compound);
    for shape in parts.into_iter().chain(compounds) {
        host.shapes_mut().add(shape).map_err(HostError::from)?;
    }
    host.set_tick(saved.tick);
    host.insert(saved.bodies, &saved.joints)?;
    let (next_body, next_joint) = saved.next_ids;
    Ok(LocalWorld {
        tape: None,
        identity: Arc::default(),
        host,
        ledger: ContactLedger::default(),
        events: WorldEvents::default(),
        next_body,
        next_joint,
        last_step: Duration::ZERO,
        strengths: Default::default(),
        why: Why::Saved,
    })
}

/// Returns what a served world can have of a local one.
pub(super) fn saved_of(
    world: &LocalWorld,
    properties: &EnvironmentProperties,
) -> Result<SavedWorld, ProcessError> {
    let (host, step) = (world.host(), &properties.step);
    let theirs = (host.settings().dt_s, host.settings().gravity);
    if theirs != (step.dt_s, step.gravity) {
        return Err(ProcessError::OtherSteps { theirs, ours: (step.dt_s, step.gravity) });
    }
    if !host.settings().can_be_served() {
        let (field, rule) =
            ("step.integration", "Rapier's own parameters, with which served worlds are stepped");
        return Err(ProcessError::Unservable { field, rule });
    }
    let (bodies, shapes, joints) = contents(world);
    let checked = bodies
        .iter()
        .try_for_each(Check::check)
        .and_then(|()| shapes.iter().try_for_each(Check::check))
        .and_then(|()| joints.iter().try_for_each(Check::check));
    checked.map_err(|Invalid { field, rule }| ProcessError::Unservable { field, rule })?;
    if !shapes.iter().all(ShapeRecord::can_travel) {
        return Err(ShapeError::TooLong.into());
    }
    Ok(SavedWorld {
        tick: world.tick(),
        next_ids: (world.next_body, world.next_joint),
        tree: host.partition().tree().clone(),
        bodies,
        shapes,
        joints,
    })
}
