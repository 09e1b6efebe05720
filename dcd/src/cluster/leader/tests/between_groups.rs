//! Measures what it costs to tell other groups of bodies, and what it would cost in other forms.

use std::collections::{BTreeMap, VecDeque};

use super::*;
use crate::delta::{Sender, alone};
use crate::protocol::{Message, STATES_BYTES, Thresholds, datagrams, encoded_len};
use crate::sim::Random;

const BODIES: u32 = 300;
const TICKS: u64 = 600;
/// The delay of acknowledgements of the server, or of the other group, ticks: 100 ms.
const DELAY_TICKS: u64 = 6;
/// The bytes of the headers of UDP and QUIC.
const HEADERS: usize = 70;

/// Moves a ball that falls, bounces and rolls, and is struck now and then.
fn fly(state: &mut SharedState, random: &mut Random) {
    const DT_S: f32 = 1.0 / 60.0;
    let [x, y, z] = &mut state.velocity.linear;
    *y -= 9.81 * DT_S;
    if state.pose.translation[1] < 0.5 && *y < 0.0 {
        (*x, *y, *z) = (0.98 * *x, if *y < -0.6 { -0.6 * *y } else { 0.0 }, 0.98 * *z);
    }
    if random.chance(0.01) {
        (*x, *y, *z) =
            (random.unit() as f32 * 6.0 - 3.0, random.unit() as f32 * 4.0, random.unit() as f32 - 0.5);
    }
    state.pose = state.pose.moved(&state.velocity, f64::from(DT_S));
}

/// Returns the bytes per second that a moving body costs between a leader and the server: in the form for
/// other groups, in full, and in the form for clients, which refers to what was acknowledged.
fn cost(dead_reckoning_m: f32) -> [f64; 3] {
    let mut leader = leader();
    leader.thresholds = Thresholds { dead_reckoning_m, ..leader.thresholds };
    leader.authority(false, true, Vec::new());
    let motion = FreeMotion::of(&sim_world(2).step);
    let (mut sender, mut receiver) = (Sender::new(motion, 1), Receiver::default());
    receiver.set_motion(motion);
    let mut random = Random::new(3);
    let mut bodies: Vec<_> = (0..BODIES)
        .map(|i| SharedState {
            id: BodyId::persistent(i),
            owner: RegionId(1),
            epoch: crate::space::Epoch::placed_in(1),
            pose: WorldPose::at([f64::from(i % 20), 3.0 * random.unit(), f64::from(i / 20)]),
            velocity: Velocity { linear: [0.0; 3], angular: [1.0, 2.0, 3.0] },
            sleeping: false,
        })
        .collect();
    let (mut alone, mut full, mut compact) = (0, 0, 0);
    let mut come = VecDeque::new();
    for tick in 1..=TICKS {
        leader.dispatch(Duration::from_millis(17 * tick)).unwrap();
        bodies.iter_mut().for_each(|body| fly(body, &mut random));
        leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states: bodies.clone() });
        both_done(&mut leader, tick, vec![], vec![]);
        let now = Duration::from_millis(17 * tick);
        let mut batch = Vec::new();
        for message in leader.take_server_messages() {
            let ToServer::InterGroup { states, .. } = &message else { continue };
            batch.extend(alone::read(states).unwrap());
            alone += encoded_len(&Message::ToServer(message)) + HEADERS;
        }
        for states in datagrams(batch.clone()) {
            full += encoded_len(&states) + 20 + HEADERS;
        }
        for part in sender.pack(Tick(tick), Tick(tick), &batch, false, STATES_BYTES) {
            compact += part.states.len() + 20 + HEADERS;
            receiver.take_in(now, Tick(tick), &part, false).unwrap();
        }
        if let Some(heard) = receiver.due(now + Duration::from_millis(17), 0) {
            compact += 12 + HEADERS;
            come.push_back((tick + DELAY_TICKS, heard));
        }
        while let Some((_, heard)) = come.pop_front_if(|(due, _)| *due <= tick) {
            sender.hear(Tick(tick), &heard);
        }
    }
    let per_body_s = |bytes: usize| bytes as f64 / f64::from(BODIES) / (TICKS as f64 / 60.0);
    [alone, full, compact].map(per_body_s)
}

/// Referring to what was acknowledged would save another half, and need acknowledgements both ways between
/// each leader and the server.
#[test]
fn other_groups_are_told_in_a_quarter_of_the_bytes_of_full_states() {
    for dead_reckoning_m in [0.0, 0.01] {
        let [alone, full, compact] = cost(dead_reckoning_m);
        println!(
            "within {dead_reckoning_m} m: {alone:.0} B/s per body; in full {full:.0}, against what was acknowledged {compact:.0}"
        );
        assert!(alone < 0.28 * full && compact < alone, "{alone} {full} {compact}");
    }
}

/// A state may be lost on its way to another group, and what rests is told only once by itself.
#[test]
fn other_groups_are_reminded_of_every_body_in_turn() {
    let mut leader = leader();
    leader.authority(false, true, Vec::new());
    let states = (0..9).map(|i| SharedState {
        id: BodyId::persistent(i),
        owner: RegionId(1),
        epoch: crate::space::Epoch::placed_in(1),
        pose: WorldPose::at([f64::from(i), 0.0, 0.0]),
        velocity: Velocity { linear: [0.0; 3], angular: [0.0; 3] },
        sleeping: true,
    });
    let mut states: Vec<_> = states.collect();
    let mut told = BTreeMap::new();
    for tick in 1..=120 {
        leader.dispatch(Duration::from_millis(17 * tick)).unwrap();
        let states = std::mem::take(&mut states);
        leader.report(NodeId(1), Report { view: ViewNumber(1), tick: Tick(tick), states });
        both_done(&mut leader, tick, vec![], vec![]);
        for message in leader.take_server_messages() {
            let ToServer::InterGroup { states, .. } = &message else { continue };
            alone::read(states).unwrap().iter().for_each(|state| *told.entry(state.id).or_insert(0) += 1);
        }
    }
    assert!(told.len() == 9 && told.values().all(|&times| times > 2), "{told:?}");
}
