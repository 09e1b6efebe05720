//! Tests that states arrive as they are told, whatever is lost, and what they cost.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::*;
use crate::protocol::{Check, Heard, Part, SharedState, StepRecord, Velocity, WorldPose};
use crate::sim::{Random, sim_world};
use crate::space::{BodyId, ClientId, Epoch, RegionId, Tick};

const LIMIT: usize = 1_040;

fn step() -> StepRecord {
    sim_world(2).step
}

fn ends() -> (Sender, Receiver) {
    let motion = FreeMotion::of(&step());
    let mut receiver = Receiver::default();
    receiver.set_motion(motion);
    (Sender::new(motion, 1), receiver)
}

/// Returns a random number from -1 to 1.
fn unit(random: &mut Random) -> f64 {
    2.0 * random.unit() - 1.0
}

/// Returns bodies as in a stirred heap: near each other, some asleep.
fn heap(count: u32, random: &mut Random) -> Vec<SharedState> {
    (0..count)
        .map(|i| {
            let turn: [f32; 4] = std::array::from_fn(|_| unit(random) as f32);
            let norm = turn.iter().map(|v| v * v).sum::<f32>().sqrt();
            let sleeping = i % 10 == 0;
            let speed = if sleeping { 0.0 } else { 1.0 };
            SharedState {
                id: BodyId::persistent(3 * i),
                owner: RegionId(3 + i / 100),
                epoch: Epoch::placed_in(5),
                pose: WorldPose {
                    translation: std::array::from_fn(|_| 20.0 * unit(random)),
                    rotation: turn.map(|v| v / norm),
                },
                velocity: Velocity {
                    linear: std::array::from_fn(|_| 3.0 * speed * unit(random) as f32),
                    angular: std::array::from_fn(|_| 5.0 * speed * unit(random) as f32),
                },
                sleeping,
            }
        })
        .collect()
}

/// Moves a body by one tick of free flight, as Rapier does.
fn fly(state: &mut SharedState) {
    let StepRecord { gravity, dt_s, solver_iterations, .. } = step();
    let (dt, parts) = (f64::from(dt_s), f64::from(solver_iterations));
    if state.sleeping {
        return;
    }
    for (axis, g) in gravity.map(f64::from).into_iter().enumerate() {
        let v = f64::from(state.velocity.linear[axis]);
        state.pose.translation[axis] += v * dt + g * dt * dt * (1.0 + parts) / (2.0 * parts);
        state.velocity.linear[axis] = (v + g * dt) as f32;
    }
    let [x, y, z] = state.velocity.angular.map(f64::from);
    let spin = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::new(x, y, z) * dt);
    let [i, j, k, w] = state.pose.rotation.map(f64::from);
    let turned = spin * nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    state.pose.rotation = [turned.i, turned.j, turned.k, turned.w].map(|v| v as f32);
}

/// Returns the worst difference between the real state and the told one, as a share of what is promised.
fn off(is: &SharedState, told: &SharedState) -> f64 {
    let facts = |state: &SharedState| (state.id, state.owner, state.epoch, state.sleeping);
    assert_eq!(facts(is), facts(told));
    let mut worst = 0.0_f64;
    for axis in 0..3 {
        worst = worst.max((is.pose.translation[axis] - told.pose.translation[axis]).abs() / 0.000_75);
        let apart = |a: [f32; 3], b: [f32; 3]| f64::from((a[axis] - b[axis]).abs());
        worst = worst.max(apart(is.velocity.linear, told.velocity.linear) / 0.005);
        worst = worst.max(apart(is.velocity.angular, told.velocity.angular) / 0.010);
    }
    let dot = (0..4).map(|i| f64::from(is.pose.rotation[i]) * f64::from(told.pose.rotation[i])).sum::<f64>();
    worst.max(2.0 * dot.abs().min(1.0).acos() / 0.004)
}

/// The cost and the outcome of a run over a network.
struct Outcome {
    bytes_per_state: f64,
    worst: f64,
    tally: Tally,
    states: BTreeMap<BodyId, SharedState>,
    told: BTreeMap<BodyId, SharedState>,
}

/// Sends a batch every third tick, as leaders do, over a network that takes `delay` ticks each way, and loses
/// and delays packets.
fn send(
    ticks: u64,
    (delay, jitter, loss): (u64, u64, f64),
    mut bodies: Vec<SharedState>,
    mut change: impl FnMut(u64, &mut Vec<SharedState>, &mut Random),
) -> Outcome {
    let (mut sender, mut receiver) = ends();
    let mut random = Random::new(9);
    let mut down: Vec<(u64, Tick, Part, Vec<SharedState>)> = Vec::new();
    let mut up = VecDeque::new();
    let (mut bytes, mut sent, mut worst) = (0, 0, 0.0_f64);
    let (mut newest, mut told) = (BTreeMap::new(), BTreeMap::new());
    let mut ticks_told = BTreeMap::<BodyId, u64>::new();
    for tick in 1..=ticks {
        let now = Duration::from_millis(17 * tick);
        bodies.iter_mut().for_each(fly);
        change(tick, &mut bodies, &mut random);
        let due: Vec<_> = down.extract_if(.., |(at, ..)| *at <= tick).collect();
        for (_, of, part, states) in due {
            for state in receiver.take_in(now, of, &part, false).unwrap() {
                let is = states.iter().find(|is| is.id == state.id).unwrap();
                worst = worst.max(off(is, &state));
                if ticks_told.get(&state.id).is_none_or(|known| *known < of.0) {
                    ticks_told.insert(state.id, of.0);
                    told.insert(state.id, state);
                }
            }
        }
        if let Some(heard) = receiver.due(now, 0)
            && random.unit() >= loss
        {
            up.push_back((tick + delay, heard));
        }
        while up.front().is_some_and(|(at, _)| *at <= tick) {
            sender.hear(Tick(tick), &up.pop_front().unwrap().1);
        }
        let overdue = sender.overdue(Tick(tick));
        let tells = |state: &&SharedState| {
            (tick % 3 == 0 && newest.get(&state.id) != Some(*state)) || overdue.contains(&state.id)
        };
        let states: Vec<_> = bodies.iter().filter(tells).copied().collect();
        newest.extend(states.iter().map(|state| (state.id, *state)));
        for part in sender.pack(Tick(tick), Tick(tick), &states, false, LIMIT) {
            assert!(part.states.len() <= LIMIT, "{}", part.states.len());
            bytes += part.states.len();
            if random.unit() >= loss {
                let at = tick + delay + random.below(1 + jitter);
                down.push((at, Tick(tick), part, states.clone()));
            }
        }
        sent += states.len();
    }
    let states = bodies.into_iter().map(|state| (state.id, state)).collect();
    Outcome { bytes_per_state: bytes as f64 / sent as f64, worst, tally: *receiver.tally(), states, told }
}

#[test]
fn states_arrive_within_the_errors_that_are_promised_whatever_is_lost() {
    for network in [(0, 0, 0.0), (3, 0, 0.0), (6, 4, 0.05), (12, 3, 0.3)] {
        let bodies = heap(300, &mut Random::new(1));
        let outcome = send(400, network, bodies, |_, bodies, random| {
            for _ in 0..10 {
                // Some bodies hit something.
                let at = random.below(bodies.len() as u64) as usize;
                if !bodies[at].sleeping {
                    bodies[at].velocity.linear = std::array::from_fn(|_| 5.0 * unit(random) as f32);
                    bodies[at].velocity.angular = std::array::from_fn(|_| 5.0 * unit(random) as f32);
                }
            }
        });
        assert!(outcome.worst <= 1.0, "{network:?}: {} times what is promised", outcome.worst);
        assert!(outcome.tally.states > 5_000);
    }
}

#[test]
fn what_came_to_rest_is_known_where_it_rests_and_costs_nothing_more() {
    let network = (6, 4, 0.3);
    let bodies = heap(300, &mut Random::new(2));
    let mut bytes = [0.0; 2];
    for (bytes, ticks) in bytes.iter_mut().zip([300, 3_000]) {
        let outcome = send(ticks, network, bodies.clone(), |tick, bodies, _| {
            for (i, state) in bodies.iter_mut().enumerate() {
                if !state.sleeping && tick > 20 + i as u64 / 4 {
                    (state.sleeping, state.velocity) = (true, Velocity::default());
                }
            }
        });
        for (id, is) in &outcome.states {
            assert!(off(is, &outcome.told[id]) <= 1.0, "{id}");
        }
        *bytes = outcome.tally.bits.iter().sum::<f64>();
    }
    assert_eq!(bytes[0], bytes[1]);
}

#[test]
fn what_moves_freely_takes_two_bytes_and_what_is_stirred_a_quarter_of_its_bytes() {
    let flying: Vec<_> = heap(900, &mut Random::new(3)).into_iter().filter(|state| !state.sleeping).collect();
    let free = send(300, (3, 0, 0.0), flying.clone(), |_, _, _| {});
    let stirred = send(300, (3, 0, 0.0), flying, |_, bodies, random| {
        for state in bodies {
            for axis in 0..3 {
                state.velocity.linear[axis] += 0.3 * unit(random) as f32;
                state.velocity.angular[axis] += 0.6 * unit(random) as f32;
            }
        }
    });
    println!("free {} {:?}", free.bytes_per_state, free.tally);
    println!("stirred {} {:?}", stirred.bytes_per_state, stirred.tally);
    assert!(free.bytes_per_state < 2.0 && stirred.bytes_per_state < 17.0);
}

/// Stirred bodies are told to a relay, and by it to a client. What the client has must be within the promised
/// errors of the real states.
#[test]
fn a_client_of_a_relay_is_told_as_well_as_others_and_the_relay_in_few_bytes() {
    let motion = FreeMotion::of(&step());
    let (mut to_relay, mut at_relay) = (OrderedSender::new(motion), OrderedReceiver::new(motion));
    let (mut sender, mut receiver) = ends();
    let mut random = Random::new(12);
    let mut bodies = heap(300, &mut random);
    let (mut bytes, mut told, mut worst) = (0, 0, 0.0_f64);
    for tick in 1..=400 {
        bodies.iter_mut().for_each(fly);
        for _ in 0..10 {
            let body = &mut bodies[random.below(300) as usize];
            body.velocity.linear = [0; 3].map(|_| 3.0 * unit(&mut random) as f32);
            body.velocity.angular = [0; 3].map(|_| 5.0 * unit(&mut random) as f32);
        }
        bodies.iter_mut().filter(|body| body.sleeping).for_each(|body| body.velocity = Velocity::default());
        if tick % 3 != 0 {
            continue;
        }
        let now = Tick(tick);
        let states: Vec<_> = bodies.iter().map(|body| (now, *body)).collect();
        told += states.len();
        let mut relayed = Vec::new();
        for part in to_relay.write(now, &states) {
            bytes += part.len();
            relayed.extend(at_relay.read(now, &part).unwrap().into_iter().map(|(_, state)| state));
        }
        let left_out = |id| at_relay.left_out(id);
        let clock = Duration::from_millis(17 * tick);
        for part in sender.pack_again(now, now, &relayed, false, LIMIT, left_out) {
            for state in receiver.take_in(clock, now, &part, false).unwrap() {
                let is = bodies.iter().find(|is| is.id == state.id).unwrap();
                worst = worst.max(off(is, &state));
            }
        }
        sender.hear(now, &receiver.due(clock + Duration::from_millis(20), 0).unwrap());
    }
    println!("{} bytes per state, {worst} of what is promised", bytes as f64 / told as f64);
    assert!(worst <= 1.0, "{worst}");
    assert!(bytes < 8 * told, "{bytes} for {told}");
}

/// The client reads nothing that it is told, time and again, as often as a view may last. It must be told
/// anew each time, and also once the sender has used up its series.
#[test]
fn a_client_that_is_told_anew_more_often_than_a_turn_has_series_is_told_anew_still() {
    let (mut sender, mut receiver) = ends();
    let bodies = heap(40, &mut Random::new(4));
    for tick in (1..200).map(|round| 100 * round) {
        receiver.reset();
        for tick in tick..tick + 2 {
            let now = Duration::from_secs(tick);
            for part in sender.pack(Tick(tick), Tick(tick), &bodies, false, LIMIT) {
                let _ = receiver.take_in(now, Tick(tick), &part, false);
            }
            if let Some(heard) = receiver.due(now + Duration::from_millis(20), 0) {
                sender.hear(Tick(tick), &heard);
                if heard.lost {
                    assert_eq!(sender.restart(Tick(tick), heard.series).len(), 40);
                }
            }
        }
        let part = &sender.pack(Tick(tick + 2), Tick(tick + 2), &bodies, false, LIMIT)[0];
        assert!(
            receiver.take_in(Duration::from_secs(tick + 2), Tick(tick + 2), part, false).is_ok(),
            "{tick}"
        );
        assert!(sender.series() < RESTARTS, "the next turn has the series after these");
    }
}

#[test]
fn a_client_that_cannot_read_what_it_is_told_is_told_anew() {
    let (mut sender, mut receiver) = ends();
    let bodies = heap(40, &mut Random::new(4));
    let tell = |sender: &mut Sender, receiver: &mut Receiver, tick: u64| {
        let now = Duration::from_secs(tick);
        let parts = sender.pack(Tick(tick), Tick(tick), &bodies, false, LIMIT);
        let read: usize = parts
            .iter()
            .flat_map(|part| receiver.take_in(now, Tick(tick), part, false))
            .map(|s| s.len())
            .sum();
        let heard = receiver.due(now + Duration::from_millis(20), 7).unwrap();
        sender.hear(Tick(tick), &heard);
        let again = if heard.lost { sender.restart(Tick(tick), heard.series).len() } else { 0 };
        (read, again)
    };
    assert_eq!(tell(&mut sender, &mut receiver, 101), (40, 0));
    assert_eq!(tell(&mut sender, &mut receiver, 102), (40, 0));
    // Another process is at the other end of the same link.
    receiver.reset();
    assert_eq!(tell(&mut sender, &mut receiver, 103), (0, 40));
    assert_eq!(sender.series(), 2);
    assert!(sender.restart(Tick(110), 2).is_empty(), "it has only just begun");
    assert_eq!(tell(&mut sender, &mut receiver, 104), (40, 0));
    assert_eq!(tell(&mut sender, &mut receiver, 105), (40, 0));
    assert!(sender.overdue(Tick(500)).is_empty());
}

/// Bodies that wake after a long time are told against a state of long ago until the first acknowledgement,
/// and then against a new one.
#[test]
fn bodies_that_wake_are_understood_though_datagrams_overtake_one_another() {
    for (delay, jitter) in [(0, 6), (3, 9), (12, 12)] {
        let bodies = heap(60, &mut Random::new(8));
        let outcome = send(1_200, (delay, jitter, 0.05), bodies, |tick, bodies, random| {
            for (i, body) in (0..).zip(bodies) {
                let wakes = (tick / 60 + i) % 4 == 0;
                body.sleeping = !wakes;
                body.velocity = if wakes { body.velocity } else { Velocity::default() };
                if wakes && random.below(8) == 0 {
                    body.velocity = Velocity::linear([0; 3].map(|_: i32| unit(random) as f32));
                }
            }
        });
        assert!(outcome.tally.states > 2_000 && outcome.worst <= 1.0, "{}", outcome.worst);
        // All were told anew once, and again only until the first acknowledgement.
        assert!(outcome.tally.wholes < 60 * 20, "{}", outcome.tally.wholes);
    }
}

#[test]
fn what_a_client_did_not_hear_while_it_was_silent_it_is_told_again() {
    let (mut sender, mut receiver) = ends();
    let bodies = heap(40, &mut Random::new(5));
    for tick in 1..1_000 {
        sender.pack(Tick(tick), Tick(tick), &bodies, false, LIMIT);
        assert!(sender.waits());
        if tick % 60 == 0 {
            sender.give_up();
            assert_eq!((sender.bytes().0, sender.overdue(Tick(tick)).len()), (0, bodies.len()));
        }
    }
    let now = Duration::from_secs(1_000);
    for part in sender.pack(Tick(1_000), Tick(1_000), &bodies, false, LIMIT) {
        assert!(!receiver.take_in(now, Tick(1_000), &part, false).unwrap().is_empty());
    }
    assert!(sender.hear(Tick(1_000), &receiver.due(now + Duration::from_millis(20), 0).unwrap()));
    assert!(!sender.waits() && sender.overdue(Tick(1_020)).is_empty());
}

/// Acknowledgements of what is sent in the tick of a flood go unheard, so it is told again. Later ones are
/// heard.
#[test]
fn a_flood_of_acknowledgements_is_passed_over() {
    let (mut sender, _) = ends();
    let bodies = heap(300, &mut Random::new(5));
    let first = sender.pack(Tick(1), Tick(1), &bodies, false, LIMIT)[0].number;
    let heard = |datagrams| Heard { series: 1, datagrams, lost: false, bytes_per_s: 0 };
    // None of these datagrams was sent.
    let flood = heard(vec![(first.wrapping_sub(1_000_000), 900_000); 64]);
    assert!(!sender.hear(Tick(1), &flood));
    for _ in 0..1_000 {
        assert!(!sender.hear(Tick(1), &heard(vec![(first, 1)])), "no time is spent on it");
    }
    assert!(sender.hear(Tick(2), &heard(vec![(first, 1)])));
    // An honest client says at most this much per tick, and may make up for what it did not say for a while.
    for tick in 3..60 {
        let parts = sender.pack(Tick(tick), Tick(tick), &bodies, false, LIMIT);
        if tick > 20 {
            assert!(parts.iter().all(|part| sender.hear(Tick(tick), &heard(vec![(part.number, 1)]))));
        }
    }
}

/// Bodies come and go: what is still on its way of them must be understood, and nothing kept.
#[test]
fn bodies_that_are_gone_are_forgotten_and_those_that_come_back_are_not() {
    let (mut sender, mut receiver) = ends();
    let bodies = heap(20, &mut Random::new(5));
    let tell = |sender: &mut Sender, receiver: &mut Receiver, tick: u64, bodies: &[SharedState]| {
        let now = Duration::from_secs(tick);
        for part in sender.pack(Tick(tick), Tick(tick), bodies, false, LIMIT) {
            receiver.take_in(now, Tick(tick), &part, false).unwrap();
        }
        sender.hear(Tick(tick), &receiver.due(now + Duration::from_millis(20), 0).unwrap());
    };
    tell(&mut sender, &mut receiver, 1, &bodies);
    tell(&mut sender, &mut receiver, 2_000, &bodies[..10]);
    bodies.iter().for_each(|body| receiver.forget(body.id));
    // States that were on their way arrive, and two bodies are back.
    tell(&mut sender, &mut receiver, 2_001, &bodies);
    bodies[..2].iter().for_each(|body| receiver.remember(body.id));
    // One of them goes again.
    receiver.forget(bodies[1].id);
    receiver.remember(bodies[1].id);
    tell(&mut sender, &mut receiver, 2_700, &bodies[..1]);
    assert_eq!(receiver.costliest(99).len(), 2);
}

#[test]
fn thousands_that_rest_alike_are_told_of() {
    let (mut sender, mut receiver) = ends();
    let upright = SharedState { pose: WorldPose::at([3.0, 0.5, 7.0]), ..heap(1, &mut Random::new(4))[0] };
    let states: Vec<_> = (0..5_000).map(|i| SharedState { id: BodyId::persistent(i), ..upright }).collect();
    let parts = sender.pack(Tick(1), Tick(1), &states, false, LIMIT);
    let read = parts.iter().map(|part| receiver.take_in(Duration::ZERO, Tick(1), part, false).unwrap().len());
    assert_eq!(read.sum::<usize>(), states.len());
    assert!(parts.iter().map(|part| part.states.len()).sum::<usize>() < states.len() / 4);
}

#[test]
fn the_strangest_states_fit() {
    let mut random = Random::new(6);
    let usual = heap(1, &mut random)[0];
    let far = |sign: f64| SharedState {
        id: BodyId::avatar(ClientId(u32::MAX), u32::MAX),
        owner: RegionId(u32::MAX),
        epoch: Epoch(1 << 63),
        pose: WorldPose { translation: [1e9 * sign; 3], rotation: [0.5, -0.5, 0.5, -0.5] },
        velocity: Velocity { linear: [f32::MAX * sign as f32; 3], angular: [f32::MIN_POSITIVE; 3] },
        sleeping: false,
    };
    let near = SharedState { id: BodyId::persistent(0), owner: RegionId(0), epoch: Epoch(0), ..far(0.0) };
    let (mut sender, mut receiver) = ends();
    // The models expect nothing new by the time it comes.
    for round in 0..6u64 {
        let alike = (0..900).map(|i| SharedState { id: BodyId::persistent(i), ..near });
        let strange = (0..100).map(|i| {
            let state = [far(1.0), near, far(-1.0), usual][(random.below(4) + round) as usize % 4];
            SharedState { id: BodyId::avatar(ClientId(1 << 31 | i), i << 25), ..state }
        });
        let states: Vec<_> = alike.chain(strange).collect();
        let parts = sender.pack(Tick(round), Tick(round), &states, false, LIMIT);
        assert!(parts.iter().all(|part| part.states.len() <= LIMIT));
        let read: Vec<_> = parts
            .iter()
            .flat_map(|part| receiver.take_in(Duration::ZERO, Tick(round), part, false).unwrap())
            .collect();
        for (is, told) in states.iter().zip(&read) {
            let facts = |state: &SharedState| (state.id, state.owner, state.epoch, state.sleeping);
            assert_eq!(facts(is), facts(told));
            assert!((is.pose.translation[0] - told.pose.translation[0]).abs() < 0.001);
        }
        sender.hear(Tick(round), &receiver.due(Duration::from_secs(1), 0).unwrap());
    }
}

#[test]
fn a_part_that_refers_to_nothing_is_read_alone() {
    let bodies = heap(300, &mut Random::new(3));
    let parts = alone::write(&bodies, LIMIT);
    assert!(parts.len() > 1);
    let read: Vec<_> = parts.iter().rev().map(|part| alone::read(part).unwrap()).collect();
    let read: Vec<_> = read.into_iter().rev().flatten().collect();
    assert_eq!(read.len(), bodies.len());
    assert!(bodies.iter().zip(&read).all(|(is, told)| off(is, told) <= 1.0));
    assert_eq!(alone::write(&[], LIMIT), [[0u8; 0]]);
    assert_eq!(alone::read(&[]).unwrap(), []);
    // States for a client refer to earlier ones.
    let (mut sender, mut receiver) = ends();
    for tick in 1..3 {
        let part = sender.pack(Tick(tick), Tick(tick), &bodies[..5], false, LIMIT).remove(0);
        let now = Duration::from_secs(tick);
        receiver.take_in(now, Tick(tick), &part, false).unwrap();
        sender.hear(Tick(tick), &receiver.due(now + Duration::from_secs(1), 0).unwrap());
        assert_eq!(alone::read(&part.states).is_ok(), tick == 1);
    }
}

/// Takes in bytes made by strangers, and honest parts that strangers changed. Returns how many were read and
/// how many refused.
fn take_in_strange(rounds: u64, seed: u64) -> (u64, u64) {
    let mut random = Random::new(seed);
    let (mut sender, mut receiver) = ends();
    let mut bodies = heap(60, &mut random);
    let mut honest = Vec::new();
    for tick in 1..6 {
        let now = Duration::from_secs(tick);
        bodies.iter_mut().for_each(fly);
        honest = sender.pack(Tick(tick), Tick(tick), &bodies, false, LIMIT);
        for part in &honest {
            receiver.take_in(now, Tick(tick), part, false).unwrap();
        }
        sender.hear(Tick(tick), &receiver.due(now + Duration::from_millis(20), 0).unwrap());
    }
    let known = receiver;
    let mut receiver = known.clone();
    let (mut read, mut refused) = (0, 0);
    for round in 0..rounds {
        if round % 64 == 0 {
            receiver.clone_from(&known);
        }
        let mut part = honest[random.below(honest.len() as u64) as usize].clone();
        if round % 3 == 0 {
            part.states = (0..random.below(200)).map(|_| random.bits() as u8).collect();
        }
        if round % 5 == 0 {
            part.batch = part.batch.wrapping_add(random.below(7) as u32).wrapping_sub(3);
        }
        if round % 3 == 2 {
            part.states.truncate(random.below(part.states.len() as u64 + 1) as usize);
        }
        for _ in 0..random.below(4) {
            let at = random.below(part.states.len().max(1) as u64) as usize;
            if let Some(byte) = part.states.get_mut(at) {
                *byte = random.bits() as u8;
            }
        }
        match receiver.take_in(Duration::ZERO, Tick(5 + random.below(9)), &part, round % 7 == 0) {
            Ok(states) => {
                assert!(states.len() <= 1_024 && states.iter().all(|state| state.check().is_ok()));
                read += 1;
            }
            Err(_) => refused += 1,
        }
        receiver.due(Duration::MAX, 0);
        if let Ok(states) = alone::read(&part.states) {
            assert!(states.len() <= 1_024 && states.iter().all(|state| state.check().is_ok()));
        }
    }
    (read, refused)
}

#[test]
fn strangers_bytes_are_states_or_an_error() {
    let (read, refused) = take_in_strange(20_000, 3);
    assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
}

/// Does the same at length: `cargo test --release -p dcd --lib --features cli,sim ten_million -- --ignored`.
#[test]
#[ignore = "minutes"]
fn ten_million_strangers_bytes_are_states_or_an_error() {
    for seed in 0..100 {
        let (read, refused) = take_in_strange(100_000, seed);
        assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
    }
}
