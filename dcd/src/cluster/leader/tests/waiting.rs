//! Tests what becomes of operations and inputs that wait at a leader for a tick, or for their avatar.

use super::*;

#[test]
fn what_a_program_asks_for_while_no_tick_is_opened_is_handed_over_in_messages_that_can_be_read() {
    let mut leader = leader();
    let moved = |i: u32| {
        let body = BodyId::persistent(100 + i % 1_000);
        WorldOp::Input(Input { body, pose: None, ..input(0, i as f32) })
    };
    leader.apply((0..200_000).map(moved).collect());
    let undone = leader.undone();
    assert_eq!(undone, (199_000..200_000).map(moved).collect::<Vec<_>>(), "the newest of each");
    // Impulses at points cannot be summed up.
    let push = protocol::Push::impulse(BodyId::persistent(1), [1.0; 3]).at([0.0; 3]);
    leader.apply(vec![WorldOp::Push(push); 200_000]);
    let parts = protocol::split(leader.undone(), protocol::CHUNK_BYTES);
    assert_eq!(parts.iter().map(Vec::len).sum::<usize>(), 201_000);
    for undone in parts {
        let settling =
            ToServer::Settling { view: ViewNumber(2), dispatches: Vec::new(), undone, last: false };
        let message = protocol::Message::ToServer(settling);
        assert!(protocol::decode(&protocol::encode(&message)).unwrap() == message);
    }
}

#[test]
fn a_tick_takes_no_more_operations_than_who_reads_them_has_room_for() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let ops: Vec<_> = (0..200_000).map(|i| WorldOp::Remove(BodyId::persistent(i))).collect();
    // One message of the server takes no more, either.
    for ops in protocol::split(ops.clone(), 1 << 20) {
        let apply = protocol::ToNode::Apply { view: ViewNumber(1), first: 0, ops: ops.clone() };
        protocol::decode(&protocol::encode(&protocol::Message::ToNode(apply))).unwrap();
        leader.apply(ops);
    }
    let mut told = Vec::new();
    for tick in 1..9 {
        both_done(&mut leader, tick, vec![], vec![]);
        let dispatch = leader.dispatch(Duration::from_secs(tick)).unwrap();
        protocol::decode(&protocol::encode(&protocol::Message::Dispatch(dispatch.clone()))).unwrap();
        told.extend(dispatch.ops);
    }
    assert!(told == ops, "none is lost, and none overtaken");
}

#[test]
fn operations_that_no_message_has_room_for_wait_for_the_next_tick_in_order() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let corners = vec![[0.5; 3]; 100_000];
    let op = |i: u32| WorldOp::Insert {
        bodies: vec![sim_body(BodyId::persistent(100 + i), [1.0; 3])],
        shapes: vec![crate::protocol::ShapeRecord::ConvexPolyhedron(corners.clone(), Vec::new())],
        joints: vec![],
    };
    let ops: Vec<_> = (0..30).map(op).collect();
    leader.apply(ops.clone());
    let mut told = Vec::new();
    for tick in 1..20 {
        both_done(&mut leader, tick, vec![], vec![]);
        let dispatch = leader.dispatch(Duration::from_secs(tick)).unwrap();
        assert!(encoded_len(&dispatch) < crate::protocol::MAX_MESSAGE_BYTES / 2);
        told.extend(dispatch.ops);
    }
    assert_eq!(told.len(), ops.len());
    assert!(told == ops, "none is lost, and none overtaken");
}

#[test]
fn an_input_that_names_a_tick_waits_for_it_and_the_client_is_told_how_early_it_came() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let named = |time, tick| Input { tick: Tick(tick), pose: None, ..input(time, 1.0) };
    let stamp = |leader: &Leader| leader.applied.get(&CLIENT).copied().unwrap_or_default();
    assert_eq!(leader.accept_input(CLIENT, named(5, 4)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, named(6, 4)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, named(5, 4)), Ok(()), "said twice, and overtaken: nobody minds");
    assert_eq!(leader.accept_input(CLIENT, named(7, 5)), Ok(()));
    let speculative: Vec<_> = leader.inputs().collect();
    assert_eq!(speculative, [], "it is not due");
    assert_eq!((taken(&mut leader), taken(&mut leader)), (vec![], vec![]), "ticks 2 and 3");
    assert_eq!(stamp(&leader), (0, 0));
    assert_eq!((taken(&mut leader), stamp(&leader)), (vec![6], (6, 2)), "the newest of tick 4");
    assert_eq!((taken(&mut leader), stamp(&leader)), (vec![7], (7, 3)));
    // One input is too late, by a tick, and one names a tick that nobody could mean.
    assert_eq!(leader.accept_input(CLIENT, named(8, 5)), Ok(()));
    assert_eq!((taken(&mut leader), stamp(&leader)), (vec![8], (8, -1)));
    assert_eq!(leader.accept_input(CLIENT, named(9, u64::MAX)), Ok(()));
    assert_eq!(taken(&mut leader), [9]);
    // A later request for an earlier tick counts.
    assert_eq!(leader.accept_input(CLIENT, named(10, 20)), Ok(()));
    assert_eq!(leader.accept_input(CLIENT, named(11, 10)), Ok(()));
    let all: Vec<_> = (0..20).flat_map(|_| taken(&mut leader)).collect();
    assert_eq!(all, [11]);
}

#[test]
fn a_client_cannot_have_inputs_wait_without_end() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let avatar = |index| BodyId::avatar(CLIENT, index);
    let bodies = (0..2_000).map(|index| sim_body(avatar(index), [1.0; 3])).collect();
    leader.apply(vec![WorldOp::Insert { bodies, shapes: vec![], joints: vec![] }]);
    taken(&mut leader);
    for index in 0..2_000 {
        let named =
            Input { body: avatar(index), tick: Tick(60), pose: None, ..input(u64::from(index) + 1, 1.0) };
        assert_eq!(leader.accept_input(CLIENT, named), Ok(()));
    }
    assert_eq!(taken(&mut leader).len(), 2_000 - 1_024, "those that have no room do not wait");
    leader.apply(vec![WorldOp::Remove(avatar(0))]);
    let rest: Vec<_> = (0..60).flat_map(|_| taken(&mut leader)).collect();
    assert_eq!(rest.len(), 1_023);
}

#[test]
fn an_input_that_waited_for_its_avatar_does_not_undo_a_later_one() {
    let mut leader = leader();
    assert_eq!(leader.accept_input(CLIENT, input(5, 1.0)), Ok(()), "the avatar has not appeared yet");
    let (id, epoch) = (AVATAR, crate::space::Epoch(0));
    let state = SharedState {
        id,
        owner: RegionId(1),
        epoch,
        pose: WorldPose::default(),
        velocity: Velocity::default(),
        sleeping: false,
    };
    leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(0), states: vec![state] });
    assert_eq!(leader.accept_input(CLIENT, input(6, 2.0)), Ok(()));
    let ops = leader.dispatch(Duration::ZERO).unwrap().ops;
    let inputs: Vec<_> = ops.iter().filter(|op| matches!(op, WorldOp::Input(_))).collect();
    assert_eq!(inputs, [&WorldOp::Input(input(6, 2.0))]);
}

#[test]
fn of_two_inputs_for_an_avatar_not_heard_of_yet_the_newer_counts_whichever_came_first() {
    let mut leader = leader();
    let early = BodyId::avatar(CLIENT, 7);
    for time in [6, 5] {
        let input = Input { body: early, ..input(time, time as f32) };
        assert_eq!(leader.accept_input(CLIENT, input), Ok(()));
    }
    let told = leader.into_legacy().0;
    let inputs: Vec<_> = told.into_iter().filter(|(_, told)| matches!(told, FromClient::Input(_))).collect();
    assert_eq!(inputs, [(CLIENT, FromClient::Input(Input { body: early, ..input(6, 6.0) }))]);
}

#[test]
fn a_jump_is_not_lost_as_other_inputs_follow_it_before_a_tick_does_it() {
    let jumps = |body, tick| Input { body, tick: Tick(tick), ..input(1, 1.0) };
    let moves = |body, time, speed| Input { body, pose: None, ..input(time, speed) };
    let both = |body| Input { pose: input(1, 1.0).pose, ..moves(body, 3, 3.0) };
    let asks = |leader: &mut Leader, body, tick| {
        for input in [jumps(body, tick), moves(body, 2, 2.0), moves(body, 3, 3.0)] {
            assert_eq!(leader.accept_input(CLIENT, input), Ok(()));
        }
    };
    // This holds for the same tick, and for one that comes later.
    for tick in [0, 9] {
        let mut leader = leader();
        leader.dispatch(Duration::ZERO);
        asks(&mut leader, AVATAR, tick);
        both_done(&mut leader, 1, vec![], vec![]);
        let ops = leader.dispatch(Duration::from_secs(1)).unwrap().ops;
        assert_eq!(ops, [WorldOp::Input(both(AVATAR))], "{tick}");
        both_done(&mut leader, 2, vec![], vec![]);
        assert_eq!(taken(&mut leader), Vec::<u64>::new());
    }
    // The next leader is told, even of an avatar that this one has not heard of.
    let unknown = BodyId::avatar(CLIENT, 7);
    let mut leader = leader();
    asks(&mut leader, unknown, 0);
    let told = leader.into_legacy().0.into_iter().map(|(_, told)| told);
    let told: Vec<_> = told.filter(|told| matches!(told, FromClient::Input(_))).collect();
    assert_eq!(told, [FromClient::Input(both(unknown))]);
}

#[test]
fn what_a_client_says_again_of_both_kinds_as_its_link_is_back_is_refused_of_neither() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO);
    let put = Input { pose: None, ..input(3, 1.0) };
    let driven = Input { drive: Some(Default::default()), ..Input { pose: None, ..input(4, 1.0) } };
    for _ in 0..2 {
        assert_eq!([put, driven].map(|input| leader.accept_input(CLIENT, input)), [Ok(()); 2]);
    }
    assert_eq!(taken(&mut leader), [3, 4]);
    assert_eq!([put, driven].map(|input| leader.accept_input(CLIENT, input)), [Ok(()); 2]);
    assert_eq!(taken(&mut leader), Vec::<u64>::new());
    assert_eq!(leader.accept_input(CLIENT, Input { logical_time: 2, ..put }), Err(Refusal::Late));
}

#[test]
fn an_input_that_was_done_before_the_view_is_answered_and_not_done_again_where_the_avatar_lives_on() {
    use crate::space::Epoch;
    for (epoch, again) in [(Epoch(0), vec![]), (Epoch::placed_in(1), vec![7])] {
        let mut leader = leader();
        leader.pass_over([((AVATAR, false), 7)].into());
        // The input may come before anything is heard of the avatar, or later.
        assert_eq!(leader.accept_input(CLIENT, input(7, 1.0)), Ok(()));
        let state = SharedState {
            id: AVATAR,
            owner: RegionId(1),
            epoch,
            pose: WorldPose::default(),
            velocity: Velocity::default(),
            sleeping: false,
        };
        leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(0), states: vec![state] });
        assert_eq!(leader.accept_input(CLIENT, input(7, 1.0)), Ok(()));
        assert_eq!(taken(&mut leader), again);
        assert_eq!(leader.applied.get(&CLIENT), Some(&(7, 0)));
        assert_eq!(leader.accept_input(CLIENT, input(8, 1.0)), Ok(()));
        assert_eq!(taken(&mut leader), [8]);
    }
}

#[test]
fn of_a_vehicle_not_heard_of_yet_what_it_does_and_where_it_is_put_both_wait() {
    let car = BodyId::avatar(CLIENT, 7);
    let jump = Input { body: car, ..input(1, 1.0) };
    let drive = Input { body: car, pose: None, drive: Some(Default::default()), ..input(2, 0.0) };
    let asked = |leader: &mut Leader| {
        for input in [drive, jump] {
            assert_eq!(leader.accept_input(CLIENT, input), Ok(()));
        }
    };
    let mut former = leader();
    asked(&mut former);
    let told: Vec<_> = former.into_legacy().0.into_iter().map(|(_, told)| told).collect();
    assert!(told.starts_with(&[FromClient::Input(jump), FromClient::Input(drive)]), "{told:?}");
    let mut leader = leader();
    asked(&mut leader);
    let bodies = vec![sim_body(car, [0.0; 3])];
    leader.apply(vec![WorldOp::Insert { bodies, shapes: vec![], joints: vec![] }]);
    leader.dispatch(Duration::ZERO).unwrap();
    assert_eq!(taken(&mut leader), [1, 2]);
}
