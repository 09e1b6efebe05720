//! Tests what a leader believes of members that lie.

use super::*;
use crate::space::Epoch;

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
