//! Tests which inputs of avatars a leader accepts, and which members it tells of them.

use super::*;

#[test]
fn only_the_newest_input_of_an_avatar_is_dispatched() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    assert_eq!(leader.accept_input(CLIENT, input(5, 1.0)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, input(7, 2.0)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, input(6, 3.0)), Err(Refusal::Late));
    assert_eq!(leader.accept_input(CLIENT, input(8, 20.5)), Err(Refusal::TooFast));
    assert_eq!(leader.accept_input(ClientId(5), input(9, 1.0)), Err(Refusal::NotYours));
    both_done(&mut leader, 1, vec![], vec![]);
    let ops = leader.dispatch(Duration::from_secs(1)).unwrap().ops;
    assert_eq!(ops, [WorldOp::Input(input(7, 2.0))]);
}

#[test]
fn an_avatar_jumps_no_farther_than_it_could_have_moved() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let limit = f64::from(sim_world(2).avatar_speed_limit);
    let mut time = 0;
    let mut jump = |leader: &mut Leader, x: f64| {
        time += 1;
        let pose = Some(WorldPose::at([1.0 + x, 1.0, 1.0]));
        leader.accept_input(CLIENT, Input { pose, ..input(time, 0.0) })
    };
    assert_eq!(jump(&mut leader, 1.01 * limit), Err(Refusal::TooFar), "more than in a second");
    assert_eq!(jump(&mut leader, 0.9 * limit), Ok(()));
    assert_eq!(jump(&mut leader, 1.8 * limit), Err(Refusal::TooFar), "the second one is not earned");
    let ticks = (0.9 / f64::from(sim_world(2).step.dt_s)).ceil() as u64;
    for tick in 1..=ticks {
        both_done(&mut leader, tick, vec![], vec![]);
        leader.dispatch(Duration::from_secs(tick)).unwrap();
    }
    assert_eq!(jump(&mut leader, 1.8 * limit), Ok(()), "now it is");
    let spin = Input { velocity: Velocity { linear: [0.0; 3], angular: [0.0, 0.0, 1e3] }, ..input(99, 0.0) };
    assert_eq!(leader.accept_input(CLIENT, spin), Err(Refusal::TooFast));
}

#[test]
fn a_teleport_is_told_to_all_members_and_a_velocity_to_those_that_hold_the_avatar() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    both_done(&mut leader, 1, vec![], vec![]);
    leader.holders.now_holds(NodeId(1), vec![AVATAR]);
    for (time, pose, told) in [(1, None, 0), (2, Some(WorldPose::default()), 1)] {
        leader.accept_input(CLIENT, Input { pose, ..input(time, 1.0) }).unwrap();
        let dispatch = leader.dispatch(Duration::from_secs(time)).unwrap();
        assert_eq!(leader.for_member(NodeId(1), &dispatch).ops.len(), 1);
        assert_eq!(leader.for_member(NodeId(2), &dispatch).ops.len(), told);
        both_done(&mut leader, 1 + time, vec![], vec![]);
    }
}
