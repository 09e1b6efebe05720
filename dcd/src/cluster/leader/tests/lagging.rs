//! Tests reports by members that are behind, about bodies that were removed or came again.

use super::*;

/// Returns a leader whose members may be twelve ticks apart. It has opened five ticks, with these operations,
/// and none is completed.
fn lagging(ops: [Vec<WorldOp>; 5]) -> Leader {
    let protocol = protocol::SyncProtocol::Unsynchronised { lag_ticks: 12 };
    let mut leader = leader_of(&EnvironmentProperties { protocol, ..sim_world(2) });
    leader.take_messages();
    for (tick, ops) in (1..).zip(ops) {
        leader.apply(ops);
        leader.dispatch(Duration::from_secs(tick)).unwrap();
    }
    leader
}

/// Takes in that node 1 has the avatar at `x` after a tick.
fn report_avatar(leader: &mut Leader, tick: u64, x: f64) {
    let (owner, epoch) = (RegionId(1), crate::space::Epoch(0));
    let (pose, velocity) = (WorldPose::at([x, 0.0, 0.0]), Velocity::default());
    let states = vec![SharedState { id: AVATAR, owner, epoch, pose, velocity, sleeping: false }];
    let refused = leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
    assert_eq!(refused, 0);
}

#[test]
fn what_is_removed_does_not_come_back_by_members_that_are_behind() {
    let mut leader = lagging([vec![], vec![], vec![], vec![], vec![WorldOp::Remove(AVATAR)]]);
    for tick in 1..=5 {
        if tick < 5 {
            report_avatar(&mut leader, tick, 1.0);
        }
        both_done(&mut leader, tick, vec![], vec![]);
    }
    let told: usize = told_of(leader.take_messages()).iter().map(|(_, count)| count).sum();
    assert_eq!((told, leader.replication_here().bytes_of(CLIENT).0), (0, 0), "no client hears of it");
    assert!(leader.latest.is_empty() && leader.gone.is_empty(), "nothing is kept of it");
    assert_eq!(leader.accept_input(CLIENT, input(1, 1.0)), Ok(()));
    assert!(taken(&mut leader).is_empty(), "its inputs wait for it to appear");
}

#[test]
fn what_came_again_under_its_id_is_not_where_the_former_was() {
    let again = WorldOp::Insert { bodies: vec![sim_body(AVATAR, [9.0; 3])], shapes: vec![], joints: vec![] };
    let mut leader = lagging([vec![], vec![], vec![WorldOp::Remove(AVATAR)], vec![again], vec![]]);
    report_avatar(&mut leader, 2, 1.0);
    assert!(leader.latest.is_empty());
    report_avatar(&mut leader, 4, 9.0);
    assert_eq!(leader.latest[&AVATAR].0.pose.translation[0], 9.0);
}
