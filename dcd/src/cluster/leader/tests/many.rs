//! Measures what clients cost the leader of a thousand moving bodies.

use super::*;

const BODIES: u32 = 1_000;
const TICKS: u64 = 300;

/// Returns the processor time of this thread, which other busy threads do not lengthen.
fn processor_time() -> Duration {
    let times = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    Duration::from_nanos(times.split(' ').next().unwrap().parse().unwrap())
}

/// Returns the processor time of a tick with this many clients, from members' reports to the messages for
/// clients; and how many states a client is told per second.
fn tick_with(count: u32) -> (Duration, f64) {
    let mut leader = leader();
    let mut clients = BTreeMap::new();
    for client in (100..100 + count).map(ClientId) {
        leader.admit(client);
        leader.take_interest(client, None);
        let mut receiver = Receiver::default();
        receiver.set_motion(FreeMotion::of(&sim_world(2).step));
        clients.insert(client, receiver);
    }
    let mut random = crate::sim::Random::new(5);
    let mut took = Duration::ZERO;
    let place = |i: u32, tick: u64| WorldPose::at([f64::from(i) + 0.01 * tick as f64, 1.0, 0.0]);
    for tick in 1..=TICKS {
        let now = Duration::from_millis(17 * tick);
        leader.dispatch(now).unwrap();
        // Some of the bodies are struck.
        let mut state = |i| SharedState {
            id: BodyId::persistent(i),
            owner: RegionId(1),
            epoch: crate::space::Epoch(0),
            pose: place(i, tick),
            velocity: Velocity::linear([
                if random.chance(0.3) { random.unit() as f32 } else { 0.6 },
                0.0,
                0.0,
            ]),
            sleeping: false,
        };
        let states = (0..BODIES).map(&mut state).collect();
        let start = processor_time();
        if tick % 3 == 1 {
            leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        }
        both_done(&mut leader, tick, vec![], vec![]);
        let messages = leader.take_messages();
        took += processor_time() - start;
        for (client, message) in messages {
            let ToClient::CompactStates { part, stamp } = message else { continue };
            let Some(receiver) = clients.get_mut(&client) else { continue };
            receiver.take_in(now, stamp.tick, &part, false).unwrap();
            if let Some(heard) = receiver.due(now + Duration::from_millis(500), 0) {
                leader.heard(client, heard);
            }
        }
    }
    let told = clients.values().map(|receiver| receiver.tally().states).sum::<u64>() as f64;
    (took / TICKS as u32, told / f64::from(count.max(1)) / (TICKS as f64 / 60.0))
}

/// `cargo test --release -p dcd --lib --no-default-features --features sim clients_cost -- --ignored --nocapture`
#[test]
#[ignore = "measures time"]
fn sixty_four_clients_cost_their_leader_a_fifth_of_a_tick_at_most() {
    for count in [0, 1, 8, 64] {
        let (took, told) = tick_with(count);
        let share = took.as_secs_f64() * 60.0;
        let told = told / f64::from(BODIES);
        println!(
            "{count} clients: {took:?}, {share:.3} of a tick; each is told {told:.1} times per second of each body"
        );
        // On a core that has nothing else to do, it is a fifth at most.
        assert!(share < 0.25, "{count} clients: {took:?}");
    }
}
