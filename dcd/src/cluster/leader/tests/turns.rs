//! Tests that each body and each client has its turn where there is more to tell than a tick has room for.

use super::*;

/// One client acknowledges what it is told; one has also asked for few bytes.
#[test]
fn of_thousands_that_move_each_is_told_and_no_batch_is_longer_than_its_room() {
    for (bytes_per_s, ticks) in [(0, 60), (40_000, 400)] {
        let count = 6_000;
        let mut leader = leader();
        leader.take_messages();
        let mut receiver = Receiver::default();
        receiver.set_motion(FreeMotion::of(&sim_world(2).step));
        let mut told = BTreeMap::<BodyId, u64>::new();
        let (mut random, mut bytes) = (crate::sim::Random::new(3), 0);
        for tick in 1..=ticks {
            let now = Duration::from_secs(tick);
            leader.dispatch(now).unwrap();
            let mut state = |i| SharedState {
                id: BodyId::persistent(i),
                owner: RegionId(1),
                epoch: crate::space::Epoch(0),
                pose: WorldPose::at([tick as f64, random.unit(), random.unit()]),
                velocity: Velocity::default(),
                sleeping: false,
            };
            // In the end all but one are at rest.
            let states = if tick < ticks / 2 { (0..count).map(state).collect() } else { vec![state(0)] };
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
            both_done(&mut leader, tick, vec![], vec![]);
            let mut batch = 0;
            for (_, message) in leader.take_messages() {
                let ToClient::CompactStates { part, stamp } = message else { continue };
                batch += part.states.len();
                let states = receiver.take_in(now, stamp.tick, &part, false).unwrap();
                told.extend(states.iter().map(|state| (state.id, state.pose.translation[0] as u64)));
            }
            assert!(batch < protocol::link::DATAGRAM_QUEUE_BYTES, "{batch} bytes at tick {tick}");
            bytes += batch;
            let heard = receiver.due(now + Duration::from_millis(500), bytes_per_s);
            heard.into_iter().for_each(|heard| leader.heard(CLIENT, heard));
        }
        assert_eq!(told.len() as u32, count, "of {bytes_per_s} bytes a second");
        let last = told.values().min().unwrap();
        assert!(*last >= ticks / 2 - 1, "{last}: where they came to rest");
        let rate = bytes as f64 * 60.0 / ticks as f64;
        assert!(bytes_per_s == 0 || rate < 1.02 * f64::from(bytes_per_s), "{rate} bytes a second");
    }
}

/// There are more states than a tick has time for.
#[test]
fn of_many_clients_each_has_its_turn_and_no_tick_codes_more_than_it_may() {
    const BODIES: u32 = 3_000;
    const CLIENTS: u32 = 40;
    let mut leader = leader();
    let mut clients = BTreeMap::new();
    for client in (100..100 + CLIENTS).map(ClientId) {
        leader.admit(client);
        leader.take_interest(client, None);
        let mut receiver = Receiver::default();
        receiver.set_motion(FreeMotion::of(&sim_world(2).step));
        clients.insert(client, (receiver, 0));
    }
    leader.take_messages();
    let mut random = crate::sim::Random::new(5);
    let per_tick = leader.replication_here().states_per_tick();
    assert_eq!(per_tick, 2_333);
    let round = (CLIENTS * BODIES).div_ceil(per_tick as u32);
    let mut all = 0;
    for tick in 1..=4 * u64::from(round) {
        let now = Duration::from_millis(17 * tick);
        leader.dispatch(now).unwrap();
        if tick % 3 == 1 {
            let mut state = |i| SharedState {
                id: BodyId::persistent(i),
                owner: RegionId(1),
                epoch: crate::space::Epoch(0),
                pose: WorldPose::at([tick as f64, random.unit(), random.unit()]),
                velocity: Velocity::default(),
                sleeping: false,
            };
            let states = (0..BODIES).map(&mut state).collect();
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        let mut coded = 0;
        for (client, message) in leader.take_messages() {
            let ToClient::CompactStates { part, stamp } = message else { continue };
            let Some((receiver, told)) = clients.get_mut(&client) else { continue };
            coded += receiver.take_in(now, stamp.tick, &part, false).unwrap().len();
            *told = tick;
            let heard = receiver.due(now + Duration::from_millis(500), 0);
            heard.into_iter().for_each(|heard| leader.heard(client, heard));
        }
        all += coded;
        assert!(coded < per_tick + BODIES as usize, "{coded} at tick {tick}");
        assert!(all < per_tick * tick as usize + BODIES as usize, "{all} until tick {tick}");
        for (client, (_, told)) in &clients {
            assert!(*told + u64::from(round) + 4 >= tick, "{client} was told at {told}, not until {tick}");
        }
    }
    assert!(clients.values().all(|(receiver, _)| receiver.tally().states > u64::from(BODIES)));
}
