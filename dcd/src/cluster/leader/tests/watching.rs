//! Tests when an interest counts.

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
