//! Tests when the interest of a client counts, and that a leader asks for what it does not know.

use super::*;

#[test]
fn an_interest_counts_when_what_is_there_has_been_reported() {
    let mut leader = leader_of(&sim_world(2));
    let near = Area { centre: [0.0; 3], radius_m: 10.0 };
    let far = Area { centre: [900.0, 0.0, 0.0], radius_m: 10.0 };
    let state = |x: f64| SharedState {
        id: BodyId::persistent(1),
        owner: RegionId(1),
        epoch: crate::space::Epoch(0),
        pose: WorldPose::at([x, 0.0, 0.0]),
        velocity: Velocity::default(),
        sleeping: true,
    };
    leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(0), states: vec![state(900.0)] });
    let mut tick = 0;
    // Members report every third tick.
    let mut plays = |leader: &mut Leader, x: Option<f64>| {
        tick += 1;
        let dispatch = leader.dispatch(Duration::from_millis(20 * tick)).unwrap();
        let states = x.map(state).into_iter().collect();
        leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        both_done(leader, tick, vec![], vec![]);
        let watches = dispatch.ops.into_iter().filter_map(|op| match op {
            WorldOp::Watch(watch) => Some(watch.areas),
            _ => None,
        });
        (told_of(leader.take_messages()), watches.flatten().collect::<Vec<_>>())
    };
    leader.take_interest(CLIENT, Some(near));
    assert_eq!(plays(&mut leader, None).1, [(CLIENT, Some(near))]);
    plays(&mut leader, None);
    plays(&mut leader, None);
    leader.take_interest(CLIENT, Some(far));
    // The body moved while nobody looked there: where it was is not told.
    assert_eq!(plays(&mut leader, None), (vec![], vec![(CLIENT, Some(far))]));
    assert_eq!(plays(&mut leader, None), (vec![], vec![]));
    assert_eq!(plays(&mut leader, Some(905.0)).0, [(CLIENT, 1)]);
    // Another part of what is looked at has been reported already.
    leader.take_interest(CLIENT, Some(Area { centre: [901.0, 0.0, 0.0], radius_m: 9.0 }));
    assert_eq!(plays(&mut leader, None).1, []);
}

#[test]
fn an_interest_counts_from_the_tick_on_is_handed_on_and_goes_with_the_link() {
    let mut leader = leader();
    let body = BodyId::persistent(1);
    let told_at = |leader: &mut Leader, tick: u64, x: f64| {
        leader.dispatch(Duration::from_millis(20 * tick)).unwrap();
        let pose = WorldPose::at([x, 0.0, 0.0]);
        let (epoch, velocity) = (crate::space::Epoch(0), Velocity::default());
        let states =
            vec![SharedState { id: body, owner: RegionId(1), epoch, pose, velocity, sleeping: false }];
        leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        leader.take_messages();
        both_done(leader, tick, vec![], vec![]);
        told_of(leader.take_messages())
    };
    let area = Area { centre: [0.0; 3], radius_m: 10.0 };
    let other = ClientId(5);
    leader.admit(other);
    assert_eq!(told_at(&mut leader, 1, 50.0), [(CLIENT, 1), (other, 0)], "but that time goes on");
    leader.take_interest(other, None);
    assert_eq!(told_at(&mut leader, 2, 50.5), [(other, 1), (CLIENT, 1)], "all of it");
    leader.take_interest(CLIENT, Some(area));
    leader.take_interest(ClientId(6), Some(area));
    assert_eq!(told_at(&mut leader, 3, 51.0), [(other, 1)]);
    assert_eq!(told_at(&mut leader, 4, 5.0), [(CLIENT, 1), (other, 1)]);
    let handed_on = leader.clone().into_legacy().0;
    let interests = [(CLIENT, FromClient::Interest(Some(area))), (other, FromClient::Interest(None))];
    assert_eq!(handed_on, interests);
    leader.take_interest(CLIENT, None);
    assert_eq!(told_at(&mut leader, 5, 60.0), [(CLIENT, 1), (other, 1)]);
    leader.take_interest(CLIENT, Some(area));
    told_at(&mut leader, 6, 70.0);
    leader.admit(CLIENT);
    assert_eq!(told_at(&mut leader, 7, 71.0), [(other, 1)], "it has not said it again yet");
    let handed_on = leader.clone().into_legacy().0;
    assert_eq!(handed_on, [(other, FromClient::Interest(None))], "nor is it known to another");
}

#[test]
fn a_client_whose_interest_is_not_known_is_asked_for_it_now_and_then() {
    let mut leader = leader();
    let silent = ClientId(5);
    leader.admit(silent);
    let mut asked = Vec::new();
    for tick in 1..=100 {
        leader.dispatch(Duration::from_secs(tick)).unwrap();
        both_done(&mut leader, tick, vec![], vec![]);
        for (client, message) in leader.take_messages() {
            let ToClient::LeaderIs { leader: Some(member), allocation, .. } = message else { continue };
            assert_eq!((client, member.node, allocation.len()), (silent, NodeId(1), 2));
            asked.push(tick);
        }
        if tick == 75 {
            leader.take_interest(silent, None);
        }
    }
    assert_eq!(asked, [1, 31, 61]);
}
