//! Tests the cluster against its faults.

mod balance;
mod builders;
mod contact;
mod cut_off;
mod digging;
mod fidelity;
mod groups;
mod hour;

use std::time::Duration;

use super::*;
use crate::cluster::{ClientEvent, ClientOutput, NodeCounters, Peer};
use crate::protocol::{Refusal, Velocity};
use crate::space::{BodyId, ClientId, NodeId, Tick};

mod interest;
mod neighbours;
mod owners;
mod questions;
mod relays;
mod restore;
mod showing;
mod verify;

fn config(seed: u64, nodes: u32) -> SimConfig {
    SimConfig { seed, nodes, ..SimConfig::default() }
}

fn running(seed: u64, nodes: u32) -> Sim {
    let mut sim = Sim::new(config(seed, nodes));
    sim.run_to(Tick(5)).unwrap();
    sim
}

#[test]
fn a_calm_run_keeps_every_body_and_checks_every_tick() {
    let mut sim = running(1, 3);
    sim.run_to(Tick(300)).unwrap();
    assert!(sim.checker().checked() >= 300, "{} ticks checked", sim.checker().checked());
    assert_eq!(sim.checker().owned(), 40);
    for node in sim.nodes() {
        // A message that was sent before a link was up is sent again when it is.
        let counters = NodeCounters { stale: 0, ..node.counters() };
        assert_eq!(counters, NodeCounters::default(), "a calm network drops nothing");
        assert!(node.counters().stale <= 2 * 2);
    }
}

#[test]
fn a_calm_run_gives_the_same_states_for_any_number_of_nodes() {
    let states = |nodes| {
        let mut sim = running(2, nodes);
        sim.run_until(|sim| sim.nodes().all(|node| node.tick() == Tick(200))).unwrap();
        sim.states()
    };
    let alone = states(1);
    assert_eq!(alone.len(), 40);
    assert_eq!(alone, states(2));
    assert_eq!(alone, states(4));
}

#[test]
fn all_nodes_take_the_rounds_that_one_of_them_wants() {
    let mut sim = running(9, 3);
    let mut taken = std::collections::BTreeSet::new();
    for tick in 6..200 {
        // The checker compares the rounds of every node with the rounds that were wanted.
        sim.run_to(Tick(tick)).unwrap();
        taken.extend(sim.rounds());
    }
    assert_eq!(taken.into_iter().collect::<Vec<_>>(), [1, 2, 3], "the test needs them to vary");
}

#[test]
fn a_seed_always_gives_the_same_run() {
    let run = || {
        let mut sim = running(3, 3);
        sim.run_events(500).unwrap();
        sim.crash(Peer::Node(NodeId(2)));
        sim.run_to(Tick(90)).unwrap();
        (sim.now(), sim.checker().checked(), sim.states())
    };
    assert_eq!(run(), run());
}

#[test]
fn the_checker_finds_a_dropped_transfer() {
    let mut sim = running(4, 2);
    sim.drop_transfers(1);
    assert!(matches!(sim.run_to(Tick(300)), Err(Violation::Lost { .. })));
}

#[test]
fn a_node_killed_at_any_event_loses_and_doubles_nothing() {
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let nodes = 2 + random.below(3) as u32;
        let mut sim = Sim::new(config(seed, nodes));
        if random.below(8) > 0 {
            sim.run_to(Tick(1 + random.below(20))).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        }
        sim.run_events(random.below(400)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let before = sim.server().view().map(|view| view.members.len()).unwrap_or_default();
        sim.crash(Peer::Node(NodeId(1 + random.below(nodes.into()) as u32)));
        if before < nodes as usize {
            // The world waits until it has as many nodes as it was to begin with.
            sim.start_node();
        }
        let target = Tick(sim.tick().0 + 40);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!(sim.checker().owned(), 40, "seed {seed}");
    }
}

#[test]
fn all_nodes_but_one_may_be_killed_one_soon_after_the_other() {
    for seed in 0..100 {
        let mut random = Random::new(1_000 + seed);
        let mut sim = running(seed, 4);
        let spared = NodeId(1 + random.below(4) as u32);
        for node in (1..=4).map(NodeId).filter(|&node| node != spared) {
            sim.run_events(random.below(120)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            sim.crash(Peer::Node(node));
        }
        let target = Tick(sim.tick().0 + 30);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!(sim.checker().owned(), 40, "seed {seed}");
    }
}

#[test]
fn the_world_waits_on_record_while_no_node_is_there() {
    let mut sim = running(5, 2);
    let tick = sim.tick();
    sim.crash(Peer::Node(NodeId(1)));
    sim.crash(Peer::Node(NodeId(2)));
    sim.run_until(|sim| sim.server().view().is_none()).unwrap();
    sim.start_node();
    sim.run_to(Tick(tick.0 + 60)).unwrap();
    assert_eq!(sim.checker().owned(), 40);
}

#[test]
fn a_state_recovered_from_a_checkpoint_is_at_most_half_a_second_old() {
    for seed in 0..20 {
        let mut sim = running(seed, 2);
        sim.run_to(Tick(60)).unwrap();
        let before = sim.states();
        sim.crash(Peer::Node(NodeId(1)));
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 1)).unwrap();
        sim.run_until(|sim| sim.states().len() == 40).unwrap();
        for (id, state) in sim.states() {
            let then = before[&id].pose.translation;
            let gap_m = (0..3).map(|i| (state.pose.translation[i] - then[i]).abs()).fold(0.0, f64::max);
            assert!(gap_m <= 12.0 * 0.5, "seed {seed}: {id} jumped by {gap_m} m\n{}", sim.timeline());
        }
    }
}

#[test]
fn a_late_node_takes_regions_over_and_nothing_jumps() {
    for seed in 0..30 {
        let mut sim = running(seed, 2);
        let mut calm = running(seed, 2);
        let late = sim.start_node();
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 3)).unwrap();
        sim.run_until(|sim| sim.nodes().all(|node| node.tick() == Tick(120))).unwrap();
        calm.run_until(|sim| sim.nodes().all(|node| node.tick() == Tick(120))).unwrap();
        assert!(sim.server().view().unwrap().allocation.values().any(|&node| node == late));
        assert_eq!(sim.states(), calm.states(), "seed {seed}: the hand-over is exact");
    }
}

#[test]
fn a_node_that_leaves_hands_its_regions_over_exactly() {
    for seed in 0..30 {
        let mut sim = running(seed, 3);
        let mut calm = running(seed, 3);
        sim.leave(NodeId(1 + (seed % 3) as u32));
        sim.run_until(|sim| sim.nodes().count() == 2).unwrap();
        sim.run_until(|sim| sim.nodes().all(|node| node.tick() == Tick(120))).unwrap();
        calm.run_until(|sim| sim.nodes().all(|node| node.tick() == Tick(120))).unwrap();
        assert_eq!(sim.states(), calm.states(), "seed {seed}");
    }
}

#[test]
fn the_last_node_that_leaves_gives_the_world_back_to_the_record() {
    let mut sim = running(6, 1);
    sim.leave(NodeId(1));
    sim.run_until(|sim| sim.nodes().count() == 0).unwrap();
    assert!(sim.server().view().is_none());
    let at_rest = sim.server().record().present().count();
    sim.start_node();
    sim.run_until(|sim| !sim.states().is_empty()).unwrap();
    assert_eq!((at_rest, sim.states().len()), (40, 40));
}

/// Lets nodes and clients join, leave and die in any order, several at a time.
fn chaos(seed: u64) {
    let mut random = Random::new(seed);
    let mut sim = Sim::new(config(seed, 1 + random.below(3) as u32));
    let mut clients = Vec::new();
    for _ in 0..12 {
        sim.run_events(random.below(250)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let nodes: Vec<_> = sim.nodes().map(|node| node.id()).collect();
        let node = nodes.get(random.below(4) as usize).copied();
        match (random.below(8), node) {
            (0, Some(node)) => sim.crash(Peer::Node(node)),
            (1, Some(node)) => sim.leave(node),
            (2, _) if nodes.len() < 4 => drop(sim.start_node()),
            (5, _) if nodes.len() < 4 => {
                let (_, client) = sim.start_participant(None);
                let body = sim_body(avatar(client), [random.unit() * 16.0, 4.0, 4.0]);
                sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
            }
            (6, Some(node)) => {
                let other = nodes[random.below(nodes.len() as u64) as usize];
                if other != node {
                    sim.break_link(Peer::Node(node), Peer::Node(other));
                }
            }
            (3, _) => {
                let client = sim.start_client(None);
                clients.push((client, true));
                let body = sim_body(avatar(client), [random.unit() * 16.0, 4.0, 4.0]);
                sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
            }
            (4, _) => {
                for (client, here) in &mut clients {
                    if *here {
                        sim.crash(Peer::Client(*client));
                    } else {
                        sim.start_client(Some(*client));
                    }
                    *here = !*here;
                }
            }
            _ => {
                for &(client, _) in clients.iter().filter(|(_, here)| *here) {
                    let velocity = Velocity { linear: [5.0, -3.0, 1.0], angular: [0.0; 3] };
                    sim.submit(
                        client,
                        ClientEvent::Input { body: avatar(client), tick: Tick(0), velocity, pose: None },
                    );
                }
            }
        }
    }
    for _ in 0..3 {
        sim.start_node();
    }
    // Long enough for everything under way to be over. Perhaps nobody computes at the moment.
    let target = Tick(sim.tick().max(sim.checker().last()).0 + 150);
    sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    // An input that was sent before the client was linked and welcomed may have been refused. Bodies on
    // record must be there.
    let present = sim.server().record().present().count();
    assert_eq!(sim.checker().owned(), present, "seed {seed}:\n{}", sim.timeline());
}

#[test]
fn chaos_loses_and_doubles_nothing() {
    (0..40).for_each(chaos);
}

#[test]
#[ignore = "a soak of some minutes: cargo test --release -- --ignored soak"]
fn soak_of_chaos_loses_and_doubles_nothing() {
    (1_000..6_000).for_each(chaos);
}

fn avatar(client: ClientId) -> BodyId {
    BodyId::avatar(client, 0)
}

/// Starts a client with an avatar, and drives the avatar somewhere.
fn playing(seed: u64) -> (Sim, ClientId) {
    let mut sim = running(seed, 3);
    let client = sim.start_client(None);
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    assert_eq!(sim.client(client).bodies().count(), 40);
    sim.submit(
        client,
        ClientEvent::Spawn { body: sim_body(avatar(client), [1.0, 4.0, 4.0]), shapes: Vec::new() },
    );
    sim.run_until(|sim| sim.states().contains_key(&avatar(client))).unwrap();
    let velocity = Velocity { linear: [6.0, 0.0, 0.0], angular: [0.0; 3] };
    sim.submit(client, ClientEvent::Input { body: avatar(client), tick: Tick(0), velocity, pose: None });
    sim.run_until(|sim| sim.states().get(&avatar(client)).is_some_and(|s| s.pose.translation[0] > 9.0))
        .unwrap();
    (sim, client)
}

#[test]
fn a_client_sees_its_avatar_go_where_it_drives_it() {
    let (mut sim, client) = playing(7);
    let seen_x = |sim: &Sim| sim.client(client).body(avatar(client)).unwrap().body.state.pose.translation[0];
    sim.run_until(|sim| seen_x(sim) > 9.0).unwrap();
    assert!((seen_x(&sim) - sim.states()[&avatar(client)].pose.translation[0]).abs() < 2.0);
}

#[test]
fn an_avatar_returns_with_its_client_where_it_was() {
    for seed in 0..30 {
        let (mut sim, client) = playing(seed);
        // It is stopped first, so that its last place is known.
        sim.submit(
            client,
            ClientEvent::Input {
                body: avatar(client),
                tick: Tick(0),
                velocity: Velocity::default(),
                pose: None,
            },
        );
        sim.run_until(|sim| sim.states()[&avatar(client)].velocity == Velocity::default()).unwrap();
        let parked = sim.states()[&avatar(client)].pose;
        sim.crash(Peer::Client(client));
        sim.run_until(|sim| !sim.states().contains_key(&avatar(client))).unwrap();
        if seed % 3 == 0 {
            sim.crash(Peer::Node(NodeId(1)));
        }
        sim.run_events(seed * 10).unwrap();
        sim.start_client(Some(client));
        sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
        assert!(
            sim.client(client).body(avatar(client)).is_some(),
            "who has joined knows its avatars, seed {seed}"
        );
        sim.run_until(|sim| sim.states().contains_key(&avatar(client))).unwrap();
        assert_eq!(sim.states()[&avatar(client)].pose, parked, "seed {seed}");
        let seen = |sim: &Sim| sim.client(client).body(avatar(client)).map(|view| view.body.state.pose);
        sim.run_until(|sim| seen(sim) == Some(parked)).unwrap();
    }
}

#[test]
fn a_client_that_rejoins_while_its_avatar_is_being_removed_gets_it_back_once() {
    for seed in 0..60 {
        let (mut sim, client) = playing(seed);
        sim.crash(Peer::Client(client));
        sim.run_events(seed).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        sim.start_client(Some(client));
        sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
        assert!(
            sim.client(client).body(avatar(client)).is_some(),
            "who has joined knows its avatars, seed {seed}"
        );
        let tick = sim.tick();
        sim.run_to(Tick(tick.0 + 30)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!(sim.checker().owned(), 41, "seed {seed}");
    }
}

#[test]
fn a_client_goes_on_with_the_new_leader_when_its_leader_is_killed() {
    for seed in 0..40 {
        let (mut sim, client) = playing(seed);
        let old = sim.client(client).leader().unwrap();
        sim.run_events(seed * 3).unwrap();
        sim.crash(Peer::Node(old));
        let velocity = Velocity { linear: [0.0, 3.5, 0.0], angular: [0.0; 3] };
        sim.run_until(|sim| sim.client(client).leader() != Some(old)).unwrap();
        sim.submit(client, ClientEvent::Input { body: avatar(client), tick: Tick(0), velocity, pose: None });
        let driven = |sim: &Sim| {
            sim.client(client).body(avatar(client)).is_some_and(|view| view.body.state.velocity == velocity)
        };
        sim.run_until(driven).unwrap();
    }
}

#[test]
fn inputs_against_the_rules_are_refused_with_the_reason() {
    let (mut sim, client) = playing(8);
    let other = sim.start_client(None);
    sim.run_until(|sim| sim.client(other).is_joined() && sim.client(other).leader().is_some()).unwrap();
    let fast = Velocity { linear: [21.0, 0.0, 0.0], angular: [0.0; 3] };
    let input = |body, velocity| ClientEvent::Input { body, tick: Tick(0), velocity, pose: None };
    let refusal_of = |sim: &mut Sim, who, input| {
        let known = sim.told().len();
        sim.submit(who, input);
        let find = |sim: &Sim| {
            sim.told()[known..].iter().find_map(|(told, output)| match output {
                ClientOutput::Rejected { reason, .. } if *told == who => Some(*reason),
                _ => None,
            })
        };
        sim.run_until(|sim| find(sim).is_some()).unwrap();
        find(sim).unwrap()
    };
    let again = ClientEvent::Spawn { body: sim_body(avatar(client), [1.0; 3]), shapes: Vec::new() };
    let foreign = ClientEvent::Spawn { body: sim_body(BodyId::persistent(99), [1.0; 3]), shapes: Vec::new() };
    assert_eq!(refusal_of(&mut sim, client, input(avatar(client), fast)), Refusal::TooFast);
    assert_eq!(refusal_of(&mut sim, other, input(avatar(client), Velocity::default())), Refusal::NotYours);
    assert_eq!(refusal_of(&mut sim, other, input(avatar(other), Velocity::default())), Refusal::Unknown);
    assert_eq!(refusal_of(&mut sim, client, again), Refusal::Exists);
    assert_eq!(refusal_of(&mut sim, other, foreign), Refusal::NotYours);
    assert_eq!(refusal_of(&mut sim, other, ClientEvent::Despawn(avatar(client))), Refusal::NotYours);
}

#[test]
fn a_link_between_members_that_breaks_is_made_anew_and_the_world_goes_on() {
    for seed in 0..30 {
        let mut sim = running(seed, 3);
        sim.run_events(seed * 7).unwrap();
        sim.break_link(Peer::Node(NodeId(1 + (seed % 2) as u32)), Peer::Node(NodeId(3)));
        let view = sim.server().view().unwrap().number;
        let target = Tick(sim.tick().0 + 30);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!((sim.nodes().count(), sim.checker().owned()), (3, 40), "seed {seed}");
        assert_eq!(sim.server().view().unwrap().number, view, "nobody had to go, seed {seed}");
    }
}

#[test]
fn a_participant_plays_through_its_own_node_whether_it_leads_or_not() {
    for leads in [true, false] {
        let mut sim = Sim::new(SimConfig { nodes: u32::from(!leads), ..config(9, 1) });
        if !leads {
            sim.run_to(Tick(5)).unwrap();
        }
        let (node, client) = sim.start_participant(None);
        sim.run_until(|sim| sim.client(client).leader().is_some_and(|leader| (leader == node) == leads))
            .unwrap();
        let body = sim_body(avatar(client), [1.0, 4.0, 4.0]);
        sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
        sim.run_until(|sim| sim.states().contains_key(&avatar(client))).unwrap();
        let velocity = Velocity { linear: [6.0, 0.0, 0.0], angular: [0.0; 3] };
        sim.submit(client, ClientEvent::Input { body: avatar(client), tick: Tick(0), velocity, pose: None });
        let is_seen = |sim: &Sim| {
            let view = sim.client(client).body(avatar(client));
            view.is_some_and(|view| view.body.state.pose.translation[0] > 9.0)
        };
        sim.run_until(is_seen).unwrap();
        assert!(sim.nodes().all(|node| node.counters().refused == 0));
    }
}

/// Starts a cluster with two clients that each have an avatar, and little room for a reader that does not
/// read.
fn with_two_clients(seed: u64) -> (Sim, [ClientId; 2]) {
    let bounds =
        Bounds { inbox_bytes: 8_192, queue_bytes: 65_536, client_queue_bytes: 8_192, ..Bounds::default() };
    let mut sim = Sim::new(SimConfig { bounds, ..config(seed, 3) });
    let clients = [sim.start_client(None), sim.start_client(None)];
    sim.run_until(|sim| clients.iter().all(|&client| sim.client(client).is_joined())).unwrap();
    for client in clients {
        let body = sim_body(avatar(client), [1.0, 4.0, 4.0]);
        sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
    }
    sim.run_to(Tick(60)).unwrap();
    (sim, clients)
}

/// Adds one more avatar, of which everybody is told. It is placed beside the others, so that a body does not
/// touch all of them at once.
fn chatter(sim: &mut Sim, client: ClientId, index: u32) {
    let body = sim_body(BodyId::avatar(client, index), [0.08 * f64::from(index), 4.0, 4.0]);
    sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
}

#[test]
fn a_client_that_does_not_read_costs_nobody_else_anything_and_no_more_than_its_bound() {
    for seed in 0..10 {
        let ticks = |hangs: bool| {
            let (mut sim, [silent, lively]) = with_two_clients(seed);
            if hangs {
                sim.hang(Peer::Client(silent));
            }
            for index in 1..200 {
                chatter(&mut sim, lively, index);
                sim.run_for(Duration::from_millis(20)).unwrap();
            }
            let traffic = sim.traffic();
            assert_eq!(traffic.overflows > 0, hangs, "seed {seed}: {traffic:?}");
            assert!(traffic.most_queued_for_client <= 8_192, "seed {seed}: {traffic:?}");
            assert_eq!(sim.client(lively).bodies().count(), if hangs { 240 } else { 241 }, "seed {seed}");
            sim.tick().0
        };
        let (with, without) = (ticks(true), ticks(false));
        assert!(with + 2 >= without, "seed {seed}: {with} ticks instead of {without}");
    }
}

#[test]
fn a_client_and_a_node_that_do_not_read_cost_no_more_than_their_bounds_and_the_others_the_time_to_notice() {
    for seed in 0..5 {
        let (mut sim, [silent, lively]) = with_two_clients(seed);
        let view = sim.server().view().unwrap().clone();
        let node = view.members.iter().find(|member| member.node != view.leader).unwrap().node;
        let before = sim.checker().last();
        sim.hang(Peer::Client(silent));
        sim.hang(Peer::Node(node));
        for index in 1..200 {
            chatter(&mut sim, lively, index);
            sim.run_for(Duration::from_millis(30)).unwrap();
        }
        let traffic = sim.traffic();
        assert!(traffic.overflows > 0, "seed {seed}: {traffic:?}");
        assert!(traffic.most_queued_for_client <= 8_192, "seed {seed}: {traffic:?}");
        assert!(traffic.most_queued <= 65_536, "seed {seed}: {traffic:?}");
        assert_eq!(sim.server().view().map(|view| view.members.len()), Some(2), "seed {seed}");
        assert_eq!(sim.client(lively).bodies().count(), 240, "seed {seed}");
        // Six seconds, less the three after which a process that keeps others waiting is expelled.
        let made = sim.checker().last().0 - before.0;
        assert!(made > 3 * 60 - 30, "seed {seed}: {made}");
    }
}

#[test]
fn a_node_that_hangs_does_not_hold_the_others_up_for_long() {
    for seed in 0..10 {
        let mut sim = running(seed, 4);
        sim.hang(Peer::Node(NodeId(1 + (seed % 4) as u32)));
        let is_whole = |sim: &Sim| {
            sim.server().view().is_some_and(|view| view.members.len() == 3) && sim.checker().owned() == 40
        };
        sim.run_for(Duration::from_secs(5)).unwrap();
        assert!(is_whole(&sim), "seed {seed}:\n{}", sim.timeline());
        let before = sim.checker().last();
        sim.run_for(Duration::from_secs(1)).unwrap();
        assert!(sim.checker().last().0 > before.0 + 50, "seed {seed}:\n{}", sim.timeline());
    }
}

#[test]
fn of_two_members_that_cannot_reach_each_other_one_goes_and_the_world_goes_on() {
    for seed in 0..20 {
        let mut sim = running(seed, 3);
        sim.run_events(seed * 7).unwrap();
        for cut in Cut::between(Peer::Node(NodeId(1)), Peer::Node(NodeId(3)), Duration::from_secs(60)) {
            sim.cut(cut);
        }
        let view = |sim: &Sim| sim.server().view().map(|view| view.members.len());
        sim.run_until(|sim| view(sim) == Some(2)).unwrap();
        let target = Tick(sim.checker().last().0 + 30);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert!(sim.now() < Duration::from_secs(4), "seed {seed}:\n{}", sim.timeline());
        assert_eq!((sim.nodes().count(), sim.checker().owned()), (3, 40), "seed {seed}");
    }
}

#[test]
fn a_server_that_is_killed_and_comes_back_finds_the_world_as_it_is() {
    for seed in 0..40 {
        let (mut sim, client) = playing(seed);
        sim.run_events(seed * 13).unwrap();
        let tick = sim.tick();
        sim.crash(Peer::Server);
        sim.run_for(Duration::from_secs(3)).unwrap();
        assert!(sim.checker().last().0 > tick.0 + 150, "nobody needs the server to go on, seed {seed}");
        sim.restart_server();
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 3)).unwrap();
        let target = Tick(sim.tick().0 + 30);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!((sim.nodes().count(), sim.checker().owned()), (3, 41), "seed {seed}");
        sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
        assert!(sim.client(client).body(avatar(client)).is_some(), "seed {seed}");
    }
}

#[test]
fn a_slow_node_slows_the_world_down_and_stays() {
    for seed in 0..10 {
        let mut sim = running(seed, 3);
        sim.slow(Peer::Node(NodeId(2)), Duration::from_millis(3));
        sim.run_for(Duration::from_secs(10)).unwrap();
        assert_eq!(sim.tally().evictions, 0, "seed {seed}");
        assert!((100..600).contains(&sim.tick().0), "seed {seed}: {}", sim.tick());
    }
}
