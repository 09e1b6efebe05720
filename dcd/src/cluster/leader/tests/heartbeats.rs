//! Tests how often clients hear that time goes on though nothing moves.

use super::*;

#[test]
fn clients_hear_now_and_then_that_time_goes_on_though_nothing_moves() {
    let mut leader = leader();
    let mut told = Vec::new();
    leader.take_messages();
    for tick in 1..=100 {
        leader.dispatch(Duration::from_secs(tick)).unwrap();
        // A client that is sent states of moving bodies needs no heartbeat.
        let (id, epoch) = (AVATAR, crate::space::Epoch(0));
        let (pose, velocity) = (WorldPose::default(), Velocity::default());
        let states = vec![SharedState { id, owner: RegionId(1), epoch, pose, velocity, sleeping: false }];
        if tick == 40 {
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        for (client, message) in leader.take_messages() {
            let (ToClient::States { stamp, .. } | ToClient::CompactStates { stamp, .. }) = &message else {
                continue;
            };
            let tick = stamp.tick.0;
            if let ToClient::CompactStates { part, .. } = &message {
                let datagrams = vec![(part.number, 1)];
                let heard = Heard { series: part.series, datagrams, lost: false, bytes_per_s: 0 };
                leader.heard(CLIENT, heard);
            }
            told.extend(told_of(vec![(client, message)]).into_iter().map(|(_, count)| (client, tick, count)));
        }
    }
    assert_eq!(told, [(CLIENT, 30, 0), (CLIENT, 40, 1), (CLIENT, 70, 0), (CLIENT, 100, 0)]);
}

/// The world has 60 ticks per second. One body comes to rest at the 40th, and the world stops for 0.3 s at
/// the 800th.
#[test]
fn clients_hear_rarely_that_time_goes_on_where_it_goes_on_as_ever() {
    let mut leader = leader();
    let (mut told, mut now) = (Vec::new(), Duration::ZERO);
    leader.take_messages();
    for tick in 1..=1_000 {
        now += leader.dt + Duration::from_millis(if tick == 800 { 300 } else { 0 });
        leader.dispatch(now).unwrap();
        let (id, epoch, pose) = (AVATAR, crate::space::Epoch(0), WorldPose::default());
        let velocity = Velocity::default();
        let states = vec![SharedState { id, owner: RegionId(1), epoch, pose, velocity, sleeping: true }];
        if tick == 40 {
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        for (client, message) in leader.take_messages() {
            if let ToClient::CompactStates { part, .. } = &message {
                let datagrams = vec![(part.number, 1)];
                let heard = Heard { series: part.series, datagrams, lost: false, bytes_per_s: 0 };
                leader.heard(CLIENT, heard);
            }
            told.extend(told_of(vec![(client, message)]).into_iter().map(|(_, count)| (tick, count)));
        }
    }
    let ticks: Vec<_> = told.iter().map(|&(tick, _)| tick).collect();
    assert_eq!(ticks[..5], [30, 40, 70, 100, 130], "often at first: some may be lost");
    assert!(told.iter().all(|&(tick, count)| count == usize::from(tick == 40)), "{told:?}");
    let rests: Vec<_> = ticks[4..].windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!((300..=301).contains(&rests[0]) && (300..=301).contains(&rests[1]), "{rests:?}");
    assert_eq!(ticks[7], 801, "who shows the world would be ahead of it: {ticks:?}");
    assert_eq!(ticks.len(), 8);
}
