//! Tests how a node's device computes its part of the world.

use super::*;
use crate::physics::{Region, StepSettings, joint_record};
use crate::protocol::{ExtraMass, Placed, ShapeRecord, SyncProtocol, Transfer, Velocity, WorldPose};
use crate::sim::{sim_body, sim_world};
use crate::space::{Epoch, JointId, RegionSet};
use rapier3d::prelude::FixedJointBuilder;
use std::sync::Arc;

#[test]
fn of_bodies_those_alone_are_looked_at_that_do_not_sleep() {
    let mut physics = PhysicsDevice::new(1);
    let world = sim_world(1);
    let tree = world.tree.clone();
    let regions: Vec<_> = tree.leaves().collect();
    physics.run(PhysicsCommand::World(world)).unwrap();
    let ids = [1, 2, 3, 4].map(BodyId::persistent);
    let placed = ids.map(|id| {
        let mut body = sim_body(id, [2.0 * f64::from(id.index()), 4.0, 4.0]);
        body.state.sleeping = id != ids[0];
        if id == ids[3] {
            body.state.sleeping = false;
            std::sync::Arc::make_mut(&mut body.traits).enabled = false;
        }
        Placed { region: regions[0], body }
    });
    let (placed, joints) = (placed.to_vec(), Vec::new());
    let rebuild = PhysicsCommand::Rebuild { tick: Tick(3), tree, regions, placed, joints, drop: Vec::new() };
    physics.run(rebuild).unwrap();
    let accept = |tick, report| PhysicsCommand::Accept {
        tick: Tick(tick),
        round: 1,
        incoming: Vec::new(),
        report,
        checkpoint: Sampling::Nothing,
        load: false,
    };
    physics.run(accept(3, Sampling::Nothing)).unwrap();
    for tick in 4..7 {
        let elsewhere = [8.0, tick as f64, 4.0];
        physics.host_mut().unwrap().move_copies(ids[3], WorldPose::at(elsewhere));
        physics.run(PhysicsCommand::Step { tick: Tick(tick), rounds: 1, ops: Vec::new() }).unwrap();
        let before = Region::looks().0;
        let Some(PhysicsEvent::Settled { report, .. }) = physics.run(accept(tick, Sampling::Moved)).unwrap()
        else {
            panic!("it answers");
        };
        let reported: Vec<_> = report.iter().map(|state| state.id).collect();
        assert_eq!(reported, [ids[0], ids[3]], "one that is disabled and put elsewhere is told");
        assert_eq!(report[1].pose.translation, elsewhere);
        assert_eq!(Region::looks().0 - before, 2);
    }
}

#[test]
fn a_body_that_is_tied_to_one_held_elsewhere_moves_on_while_others_are_waited_for() {
    let mut physics = PhysicsDevice::new(1);
    let world = sim_world(2);
    let tree = world.tree.clone();
    let own = tree.leaves().next().unwrap();
    physics.run(PhysicsCommand::World(world)).unwrap();
    let [near, far] = [1, 2].map(BodyId::persistent);
    let mut body = sim_body(near, [1.0, 1.0, 1.0]);
    body.state.velocity = Velocity::linear([1.0, 0.0, 0.0]);
    let joint = joint_record(JointId(1), near, far, &FixedJointBuilder::new().build().into());
    let placed = vec![Placed { region: own, body }];
    let (regions, joints) = (vec![own], vec![joint]);
    let rebuild = PhysicsCommand::Rebuild { tick: Tick(3), tree, regions, placed, joints, drop: Vec::new() };
    physics.run(rebuild).unwrap();
    let Some(PhysicsEvent::Speculated(awake)) = physics.run(PhysicsCommand::Speculate(Vec::new())).unwrap()
    else {
        panic!("it answers");
    };
    assert_eq!(awake.iter().map(|state| state.id).collect::<Vec<_>>(), [near]);
}

/// Ends a tick with this sample of each kind; returns the bodies that they tell of.
fn sampled(
    physics: &mut PhysicsDevice,
    tick: Tick,
    incoming: Vec<BorderMessage>,
    sampling: Sampling,
) -> [Vec<BodyId>; 2] {
    let (report, checkpoint) = (sampling, sampling);
    let accept = PhysicsCommand::Accept { tick, round: 0, incoming, report, checkpoint, load: false };
    let Some(PhysicsEvent::Settled { report, checkpoint, .. }) = physics.run(accept).unwrap() else {
        panic!("it answers");
    };
    let checkpoint = checkpoint.iter().map(|body| body.id).collect();
    [report.iter().map(|state| state.id).collect(), checkpoint]
}

#[test]
fn what_was_placed_or_came_awake_and_sleeps_before_the_next_sample_is_told_of_once() {
    let mut physics = PhysicsDevice::new(1);
    let world = sim_world(2);
    let tree = world.tree.clone();
    let regions: Vec<_> = tree.leaves().collect();
    let (own, other) = (regions[0], regions[1]);
    physics.run(PhysicsCommand::World(world)).unwrap();
    let [placed, comes] = [1, 2].map(BodyId::persistent);
    let nearly_asleep = |id, x| {
        let mut body = sim_body(id, [x, 1.0, 1.0]);
        (body.epoch, body.state.still_s) = (Epoch(1), 1.999);
        body
    };
    let bodies = vec![Placed { region: own, body: nearly_asleep(placed, 1.0) }];
    let (regions, joints, drop) = (vec![own], Vec::new(), Vec::new());
    physics
        .run(PhysicsCommand::Rebuild { tick: Tick(3), tree, regions, placed: bodies, joints, drop })
        .unwrap();
    assert_eq!(sampled(&mut physics, Tick(3), vec![], Sampling::All), [vec![placed], vec![placed]]);
    let body = nearly_asleep(comes, 3.0);
    let transfers = vec![Transfer { body, holders: RegionSet::EMPTY, whole: false }];
    let message =
        BorderMessage { from: other, to: own, tick: Tick(4), transfers, ..BorderMessage::default() };
    let ends = |physics: &mut PhysicsDevice, tick: u64, incoming, sampling| {
        physics.run(PhysicsCommand::Step { tick: Tick(tick), rounds: 1, ops: Vec::new() }).unwrap();
        sampled(physics, Tick(tick), incoming, sampling)
    };
    ends(&mut physics, 4, vec![message], Sampling::Nothing);
    let host = physics.host_mut().unwrap();
    for id in [placed, comes] {
        host.update(id, |body| body.sleep()).unwrap().unwrap();
    }
    assert_eq!(ends(&mut physics, 5, vec![], Sampling::Nothing), [vec![], vec![]]);
    let both = vec![placed, comes];
    assert_eq!(ends(&mut physics, 6, vec![], Sampling::Moved), [both.clone(), both]);
    assert_eq!(ends(&mut physics, 7, vec![], Sampling::Moved), [vec![], vec![]], "they have slept before");
}

/// A message of the first tick is taken in after the third, so it lacks the pushes of the second and third.
#[test]
fn a_push_on_a_body_that_is_on_its_way_here_is_not_lost() {
    let mut physics = PhysicsDevice::new(1);
    let protocol = SyncProtocol::Unsynchronised { lag_ticks: 2 };
    let world = EnvironmentProperties { protocol, ..sim_world(2) };
    let tree = world.tree.clone();
    let [from, to] = [0, 1].map(|rank| tree.leaves().nth(rank).unwrap());
    physics.run(PhysicsCommand::World(world)).unwrap();
    let (regions, joints) = (vec![to], Vec::new());
    let rebuild =
        PhysicsCommand::Rebuild { tick: Tick(0), tree, regions, placed: vec![], joints, drop: vec![] };
    physics.run(rebuild).unwrap();
    let accept = |physics: &mut PhysicsDevice, tick, incoming| {
        let (report, checkpoint) = (Sampling::Nothing, Sampling::Nothing);
        let accept = PhysicsCommand::Accept { tick, round: 0, incoming, report, checkpoint, load: false };
        physics.run(accept).unwrap();
    };
    let [thrown, drawn, stopped, held] = [1, 2, 3, 4].map(BodyId::persistent);
    // Of one body there is a copy here, which shows what was done to it.
    let mut copy = sim_body(held, [7.0, 4.0, 1.0]);
    Arc::make_mut(&mut copy.traits).extra_mass = Some(ExtraMass::Mass(2.0));
    let tell = BorderMessage { from, to, tick: Tick(0), ..BorderMessage::default() };
    accept(&mut physics, Tick(0), vec![BorderMessage { ghosts: vec![copy.clone()], ..tell.clone() }]);
    let states = vec![SharedState {
        id: held,
        owner: from,
        epoch: copy.epoch,
        pose: copy.state.pose,
        velocity: copy.state.velocity,
        sleeping: false,
    }];
    let tell = BorderMessage { states, ..tell };
    let transfer = |id: BodyId| {
        let mut body = sim_body(id, [9.0, f64::from(id.bits() as u8), 1.0]);
        body.epoch = Epoch(1);
        Arc::make_mut(&mut body.traits).extra_mass = Some(ExtraMass::Mass(2.0));
        Transfer { body, holders: RegionSet::EMPTY, whole: false }
    };
    let transfers = [thrown, drawn, stopped].map(transfer).into_iter();
    let body = BodyRecord { epoch: Epoch(copy.epoch.0 + 1), ..copy };
    let transfers = transfers.chain([Transfer { body, holders: RegionSet::EMPTY, whole: false }]).collect();
    let message = BorderMessage { from, to, tick: Tick(1), transfers, ..BorderMessage::default() };
    let impulse = |id| WorldOp::Push(Push::impulse(id, [4.0, 0.0, 0.0]));
    let halt = crate::protocol::Input {
        body: stopped,
        logical_time: 1,
        tick: Tick(0),
        velocity: Velocity::default(),
        pose: None,
        drive: None,
    };
    let ops = [
        vec![impulse(thrown)],
        vec![
            impulse(stopped),
            WorldOp::Push(Push::force(drawn, [5.0, 0.0, 0.0], [0.0; 3])),
            impulse(held),
            WorldOp::Push(Push::force(held, [0.0, 5.0, 0.0], [0.0; 3])),
        ],
        vec![WorldOp::Input(halt), impulse(thrown)],
    ];
    for (ops, tick) in ops.into_iter().zip(1..).map(|(ops, tick)| (ops, Tick(tick))) {
        physics.run(PhysicsCommand::Step { tick, rounds: 1, ops }).unwrap();
        let heard = match tick.0 {
            1 => vec![tell.clone()],
            3 => vec![message.clone()],
            _ => vec![],
        };
        accept(&mut physics, tick, heard);
    }
    let state = |id| physics.host().unwrap().record(id).unwrap().state;
    assert_eq!(state(thrown).velocity.linear, [2.0, 0.0, 0.0], "not what is in the message");
    assert_eq!(state(drawn).force, [5.0, 0.0, 0.0]);
    assert_eq!(state(stopped).velocity.linear, [0.0; 3]);
    assert_eq!((state(held).velocity.linear[0], state(held).force), (2.0, [0.0, 5.0, 0.0]), "once");
}

#[test]
fn what_comes_with_a_shape_that_was_to_be_forgotten_before_has_it_whoever_holds_that() {
    let tree = sim_world(1).tree;
    let ball = ShapeRecord::Ball(0.375);
    let inserted = |ops: Vec<WorldOp>| {
        let mut host = RegionHost::new(
            Partition::new(tree.clone(), None),
            StepSettings::default(),
            1,
            &tree.leaves().collect::<Vec<_>>(),
        )
        .unwrap();
        host.shapes_mut().add(ball.clone()).unwrap();
        apply(&mut host, &mut Led::default(), ops, 0.0);
        host.shapes().record_of(ball.hash()).is_some()
    };
    // Another node computes the body, and may hand it over later.
    let comes = || WorldOp::Insert { bodies: Vec::new(), shapes: vec![ball.clone()], joints: Vec::new() };
    let goes = || WorldOp::ForgetShapes(vec![ball.hash()]);
    assert!(inserted(vec![goes(), comes()]));
    assert!(!inserted(vec![comes(), goes()]));
    assert!(!inserted(vec![goes(), goes()]));
}
