//! Tests what a leader believes of members that lie.

use super::*;
use crate::space::Epoch;

#[test]
fn a_member_is_believed_of_its_own_regions_only() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    let state = |id: u32, owner: u32| SharedState {
        id: BodyId::persistent(id),
        owner: RegionId(owner),
        epoch: crate::space::Epoch(0),
        pose: WorldPose::default(),
        velocity: Velocity::default(),
        sleeping: false,
    };
    let states = vec![state(1, 1), state(2, 2), state(3, 7)];
    let report = Report { view: ViewNumber(1), tick: Tick(1), states };
    assert_eq!(leader.report(NodeId(2), report), 2);
    let known: Vec<_> = leader.latest.keys().copied().collect();
    assert_eq!(known, [BodyId::persistent(2)]);
    // No member is ahead of its leader: clients would count time from there, and the true owner's word of the
    // body would count no more.
    let to_come = Report { view: ViewNumber(1), tick: Tick(1 << 40), states: vec![state(2, 2)] };
    assert_eq!(leader.report(NodeId(2), to_come), 1);
    assert_eq!(leader.latest[&BodyId::persistent(2)].1, Tick(1));
    let key = ContactKey { a: BodyId::persistent(3), b: AVATAR, collider_a: 0, collider_b: 0 };
    let touch = Touch { key, began: true, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 };
    // Node 2 says so about region 1.
    let events =
        RegionEvents { region: RegionId(1), tick: Tick(1), touches: vec![touch], ..RegionEvents::default() };
    let done = Done {
        view: ViewNumber(1),
        tick: Tick(1),
        rounds_wanted: 1,
        holds: None,
        events: vec![events],
        answers: vec![],
        load: None,
        compute_us: 0,
        regions: vec![],
    };
    leader.take_messages();
    leader.done(NodeId(2), done.clone());
    leader.done(NodeId(1), Done { events: vec![], ..done });
    let told = leader.take_messages();
    assert!(told.iter().all(|(_, said)| !matches!(said, ToClient::Contacts { .. })), "{told:?}");
}

/// Reports a body of the sender's own region after a tick. Returns whether that is refused.
fn refuses(leader: &mut Leader, tick: u64, epoch: Epoch, x: f64) -> bool {
    let (id, pose, velocity) = (BodyId::persistent(7), WorldPose::at([x, 0.0, 0.0]), Velocity::default());
    let states = vec![SharedState { id, owner: RegionId(1), epoch, pose, velocity, sleeping: false }];
    leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states }) > 0
}

#[test]
fn a_state_at_an_epoch_of_a_view_that_is_not_keeps_no_true_one_back() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    assert!(refuses(&mut leader, 1, Epoch::placed_in(1 << 38), 99.0));
    assert!(refuses(&mut leader, 1, Epoch::placed_in(2), 99.0));
    assert!(!refuses(&mut leader, 1, Epoch::placed_in(1), 5.0));
    assert_eq!(leader.latest[&BodyId::persistent(7)].0.pose.translation[0], 5.0);
}

#[test]
fn what_the_server_has_placed_in_a_later_view_of_another_group_is_believed() {
    let mut leader = leader();
    let mut body = sim_body(BodyId::persistent(7), [1.0; 3]);
    body.epoch = Epoch::placed_in(5);
    leader.apply(vec![WorldOp::Insert { bodies: vec![body], shapes: vec![], joints: vec![] }]);
    leader.dispatch(Duration::ZERO).unwrap();
    assert!(!refuses(&mut leader, 1, Epoch::placed_in(5), 5.0));
    assert!(refuses(&mut leader, 1, Epoch::placed_in(6), 5.0));
    leader.knows_view(6);
    assert!(!refuses(&mut leader, 1, Epoch::placed_in(6), 5.0), "placed as its view began");
}
