//! Turns a saved served world into a local world, and back, so that both kinds have the same files.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::choice::Why;
use super::local::LocalWorld;
use super::{ProcessError, WorldError};
use crate::cluster::SavedWorld;
use crate::physics::{HostError, Partition, RegionHost, ShapeError, set_motions};
use crate::protocol::{
    BodyRecord, Check, ContactLedger, EnvironmentProperties, Invalid, JointRecord, ShapeRecord, WorldEvents,
};

/// Returns all bodies of a local world, movable and fixed, in id order, with its shapes and joints.
pub(super) fn contents(world: &LocalWorld) -> (Vec<BodyRecord>, Vec<ShapeRecord>, Vec<JointRecord>) {
    let host = world.host();
    let movable = host.records(&host.owned_bodies().map(|(id, ..)| id).collect::<Vec<_>>());
    let mut bodies: Vec<_> = movable.into_iter().chain(host.scenery().cloned()).collect();
    bodies.sort_unstable_by_key(|body| body.id);
    let joints: BTreeMap<_, _> =
        bodies.iter().flat_map(|body| host.joints_of(body.id)).map(|joint| (joint.id, joint)).collect();
    (bodies, host.shapes().records(), joints.into_values().collect())
}

/// Returns a local world with the saved state of a served world, its regions and its tick.
pub(super) fn local_of(
    mut saved: SavedWorld,
    properties: &EnvironmentProperties,
) -> Result<LocalWorld, WorldError> {
    let partition = Partition::new(saved.tree, properties.halo_m);
    let leaves = partition.leaves().to_vec();
    let mut host = RegionHost::new(partition, properties.step.into(), 1, &leaves)?;
    host.set_balance(properties.balance);
    host.set_fidelity(properties.fidelity);
    host.set_viewpoints(properties.viewpoints.clone());
    // Parts come before the compounds that name them.
    let (compounds, parts): (Vec<_>, Vec<_>) = saved.shapes.into_iter().partition(ShapeRecord::is_compound);
    for shape in parts.into_iter().chain(compounds) {
        host.shapes_mut().add(shape).map_err(HostError::from)?;
    }
    host.set_tick(saved.tick);
    let states: BTreeMap<_, _> = saved.bodies.iter().map(|body| (body.id, &body.state)).collect();
    set_motions(&mut saved.joints, |id| states.get(&id).copied());
    host.insert_saved(saved.bodies, &saved.joints)?;
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

/// Returns what a served world can take over from a local world.
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

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::{Coupling, LinkSettings, StepSettings};
    use crate::protocol::LinkRecord;
    use crate::runtime::{Partitioning, WorldConfig};
    use crate::sim::sim_world;

    #[test]
    fn a_world_that_was_saved_of_a_served_one_and_is_served_again_knows_how_its_stacks_lay() {
        let mut properties = sim_world(1);
        let step = StepSettings::default().with_coupling(Coupling::Owner);
        properties.step.gravity = step.gravity;
        let config = WorldConfig { partitioning: Partitioning::Regions(1), step, ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5);
        let at = |y: f32| RigidBodyBuilder::dynamic().translation(Vector::new(4.0, y, 4.0)).can_sleep(false);
        world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(9.0, 1.0, 9.0)).unwrap();
        for y in [1.5, 2.5, 3.5] {
            world.insert(at(y), cube()).unwrap();
        }
        (0..60).for_each(|_| world.step().unwrap());
        let offsets = |saved: &SavedWorld| {
            let dynamic = saved.bodies.iter().skip(1).map(|body| body.state.contact_offset);
            dynamic.collect::<Option<Vec<_>>>().expect("it is known of all")
        };
        let saved = saved_of(&world, &properties).unwrap();
        let before = offsets(&saved);
        // No step was done in between.
        let after = offsets(&saved_of(&local_of(saved, &properties).unwrap(), &properties).unwrap());
        for (one, other) in before.iter().zip(&after) {
            let apart = (0..3).map(|i| (one.moved_m[i] - other.moved_m[i]).abs()).fold(0.0, f32::max);
            assert!(apart < 2e-3, "{one:?} and {other:?}");
        }
    }

    /// The server's record of a joint may hold the joint's state of the beginning.
    #[test]
    fn a_multibody_that_was_saved_of_a_served_world_goes_on_from_where_its_bodies_are() {
        let properties = sim_world(1);
        let step = StepSettings { gravity: [0.0; 3], exchanges: 1, ..StepSettings::default() };
        let step = step.with_coupling(Coupling::Owner);
        let config = WorldConfig { partitioning: Partitioning::Regions(1), step, ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let mut insert = |body: RigidBodyBuilder, x: f32| {
            let body = body.translation(Vector::new(x, 1.0, 1.0)).can_sleep(false);
            world.insert(body, ColliderBuilder::cuboid(0.4, 0.1, 0.1)).unwrap()
        };
        let bodies = [
            insert(RigidBodyBuilder::dynamic(), 4.0),
            insert(RigidBodyBuilder::dynamic(), 5.0),
            insert(RigidBodyBuilder::dynamic(), 6.0),
        ];
        let half = Vector::X * 0.5;
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(half).local_anchor2(-half);
        let ball = SphericalJointBuilder::new().local_anchor1(half).local_anchor2(-half);
        let settings = LinkSettings { damping: Some([0.0; 6]), ..LinkSettings::default() };
        let first = world.insert_multibody_joint(bodies[0], bodies[1], hinge, settings).unwrap();
        let second = world.insert_multibody_joint(bodies[1], bodies[2], ball, settings).unwrap();
        world.step().unwrap();
        let begun = world.joint(first).unwrap().link;
        world.set_link_velocity(first, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        world.set_link_velocity(second, [0.5, -0.5, 0.2, 0.0, 0.0, 0.0]).unwrap();
        (0..60).for_each(|_| world.step().unwrap());
        let saved = || saved_of(&world, &properties).unwrap();
        let forgotten = |link: LinkRecord| LinkRecord { motion: None, ..link };
        let older = |link: LinkRecord| LinkRecord { motion: begun.unwrap().motion, ..link };
        for what_is_known in [&forgotten as &dyn Fn(LinkRecord) -> LinkRecord, &older, &|link| link] {
            let mut saved = saved();
            saved.joints.iter_mut().for_each(|joint| joint.link = joint.link.map(what_is_known));
            let mut again = local_of(saved, &properties).unwrap();
            let mut whole = Vec::new();
            world.save(&mut whole).unwrap();
            let mut other = LocalWorld::restore(&whole[..], 1).unwrap();
            for tick in 1..=30 {
                again.step().unwrap();
                other.step().unwrap();
                for id in bodies {
                    let [a, b] = [&again, &other].map(|world| world.pose(id).unwrap());
                    let apart =
                        (0..3).map(|i| (a.translation[i] - b.translation[i]).abs()).fold(0.0, f64::max);
                    assert!(apart < 2e-3, "{id} is {apart} m off after {tick} ticks");
                }
            }
        }
    }
}
