//! Tests clients that are told by other members of the group in the leader's place.

use super::*;
use crate::protocol::Area;
use crate::sim::{Cut, Who};

/// The oldest fresh state: members report every three ticks to the leader, which tells the relay. Each
/// message is on its way for some milliseconds.
const FRESH_TICKS: u64 = 15;

/// A ball around about half of the bodies, which fly to and fro.
const AREA: Area = Area { centre: [6.0, 4.0, 4.0], radius_m: 3.0 };
/// The core of the area. Clients must have been told of bodies that have come so far in.
const CORE: Area = Area { radius_m: 1.0, ..AREA };

/// Starts a cluster whose leader tells `above` clients itself, and four clients, every other one of which has
/// an interest.
fn relayed(seed: u64, nodes: u32, above: u32) -> (Sim, Vec<ClientId>) {
    let mut sim = Sim::new(SimConfig { relays_above: Some(above), ..config(seed, nodes) });
    sim.run_to(Tick(5)).unwrap();
    let clients: Vec<_> = (0..4).map(|_| sim.start_client(None)).collect();
    sim.run_until(|sim| clients.iter().all(|&client| sim.client(client).is_joined())).unwrap();
    for client in clients.iter().skip(1).step_by(2) {
        sim.submit(*client, ClientEvent::Interest(Some(AREA)));
    }
    sim.run_for(Duration::from_secs(2)).unwrap();
    (sim, clients)
}

fn leader(sim: &Sim) -> NodeId {
    sim.server().view().unwrap().leader
}

/// Returns the relay of each client that has one.
fn relays(sim: &Sim, clients: &[ClientId]) -> Vec<NodeId> {
    clients.iter().filter_map(|&client| sim.client(client).told_by()).collect()
}

/// Checks that what clients are told is recent, and right. Everything moves all the time.
fn check_fresh(sim: &Sim, clients: &[ClientId], seed: u64) {
    let (now, truth) = (sim.tick(), sim.states());
    for (at, &client) in clients.iter().enumerate() {
        let mut seen = 0;
        for view in sim.client(client).bodies() {
            let (id, believed) = (view.body.id, view.body.state.pose.translation);
            let is = truth[&id].pose.translation;
            if at % 2 == 0 || AREA.covers(believed) || CORE.covers(is) {
                let age = now.0.saturating_sub(view.settled_tick().0);
                assert!(
                    age <= FRESH_TICKS,
                    "seed {seed}: {client} has {id} as it was {age} ticks ago, {now}"
                );
                seen += 1;
            }
        }
        assert!(seen > 0, "seed {seed}: the test needs bodies that {client} is told of");
    }
}

fn stay_fresh(sim: &mut Sim, clients: &[ClientId], seed: u64) {
    for _ in 0..10 {
        let target = Tick(sim.tick().0 + 7);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        check_fresh(sim, clients, seed);
    }
}

#[test]
fn clients_beyond_those_of_the_leader_are_told_by_other_members_in_equal_shares() {
    for (above, own) in [(0, 0), (1, 1), (3, 3), (4, 4)] {
        let (mut sim, clients) = relayed(1, 3, above);
        let mut told_by = relays(&sim, &clients);
        assert_eq!(clients.len() - told_by.len(), own, "{above}: {told_by:?}");
        assert!(!told_by.contains(&leader(&sim)));
        told_by.sort();
        if above == 0 {
            assert_eq!(told_by.chunk_by(|a, b| a == b).map(<[_]>::len).collect::<Vec<_>>(), [2, 2]);
        }
        stay_fresh(&mut sim, &clients, 1);
    }
    let (sim, clients) = relayed(1, 1, 0);
    assert_eq!(relays(&sim, &clients), [], "nobody else is there");
}

#[test]
fn an_interest_that_turns_is_heard_by_the_relay() {
    for seed in 0..10 {
        let (mut sim, clients) = relayed(seed, 3, 0);
        let away = Area { centre: [500.0, 0.0, 0.0], radius_m: 1.0 };
        for area in [Some(away), None, Some(AREA)] {
            sim.submit(clients[1], ClientEvent::Interest(area));
            sim.run_for(Duration::from_secs(1)).unwrap();
        }
        assert_eq!(relays(&sim, &clients).len(), 4);
        stay_fresh(&mut sim, &clients, seed);
    }
}

#[test]
fn a_client_is_told_by_the_node_that_computes_what_it_is_interested_in_but_for_the_leader() {
    let mut by_others = 0;
    for seed in 0..8 {
        let mut sim = Sim::new(SimConfig { relays_above: Some(0), ..config(seed, 4) });
        sim.run_to(Tick(5)).unwrap();
        let client = sim.start_client_in(AREA);
        sim.run_until(|sim| sim.client(client).told_by().is_some()).unwrap();
        let view = sim.server().view().unwrap();
        let there = view.allocation[&view.tree.leaf_at(AREA.centre)];
        if there != view.leader {
            assert_eq!(sim.client(client).told_by(), Some(there), "seed {seed}");
            by_others += 1;
        }
    }
    assert!(by_others >= 3, "{by_others}");
}

#[test]
fn participants_tell_nobody() {
    let mut sim = Sim::new(SimConfig { relays_above: Some(0), ..config(1, 1) });
    sim.run_to(Tick(5)).unwrap();
    sim.start_participant(None);
    let joined = |sim: &Sim| sim.server().view().is_some_and(|view| view.members.len() == 2);
    sim.run_until(joined).unwrap();
    let client = sim.start_client(None);
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    sim.run_for(Duration::from_secs(2)).unwrap();
    let view = sim.server().view().unwrap();
    let leads = view.members.iter().find(|member| member.client.is_none()).unwrap().node;
    let relay = sim.client(client).told_by();
    assert!(relay.is_none() || view.leader != leads && relay == Some(leads), "{relay:?}");
    stay_fresh(&mut sim, &[client], 1);
}

/// More links break within one view than a client may have turns. In the end the leader tells it, and
/// somebody tells it all the while.
#[test]
fn a_client_whose_link_to_the_leader_breaks_time_and_again_is_told_on() {
    let (mut sim, clients) = relayed(5, 3, 0);
    let (leader, client) = (Peer::Node(leader(&sim)), Peer::Client(clients[0]));
    let view = sim.server().view().unwrap().number;
    for _ in 0..80 {
        sim.break_link(client, leader);
        sim.run_for(Duration::from_millis(400)).unwrap();
    }
    assert_eq!(sim.server().view().unwrap().number, view, "all of it in one view");
    stay_fresh(&mut sim, &clients, 5);
    assert_eq!(relays(&sim, &clients).len(), 3, "its turns are used up");
}

#[test]
fn inputs_are_said_to_be_applied_though_a_relay_tells_of_them() {
    let (mut sim, clients) = relayed(3, 3, 0);
    let avatar = BodyId::avatar(clients[0], 0);
    sim.submit(clients[0], ClientEvent::Spawn { body: sim_body(avatar, [4.0; 3]), shapes: Vec::new() });
    sim.run_for(Duration::from_secs(1)).unwrap();
    let velocity = Velocity { linear: [1.0, 0.0, 0.0], angular: [0.0; 3] };
    sim.submit(clients[0], ClientEvent::Input { body: avatar, tick: Tick(0), velocity, pose: None });
    sim.run_for(Duration::from_secs(1)).unwrap();
    let place = |client: ClientId| sim.client(client).body(avatar).unwrap().body.state.pose.translation[0];
    assert!(place(clients[0]) > 4.5 && place(clients[2]) > 4.5);
    assert_eq!(relays(&sim, &clients).len(), 4);
}

/// Whatever happens to a relay, its link, or the leader: no body vanishes at a client, no client stays
/// without states, and none believes for long what is not true.
#[test]
fn a_relay_that_is_gone_or_silent_leaves_no_client_untold() {
    for seed in 0..24 {
        let (mut sim, clients) = relayed(seed, 4, (seed % 3 / 2) as u32);
        let (leader, relay) = (leader(&sim), relays(&sim, &clients)[0]);
        let told = *clients.iter().find(|&&client| sim.client(client).told_by() == Some(relay)).unwrap();
        let (leader, relay, client) = (Peer::Node(leader), Peer::Node(relay), Peer::Client(told));
        let mut random = Random::new(seed);
        sim.run_events(random.below(300)).unwrap();
        let for_s = |sim: &Sim, seconds| sim.now() + Duration::from_secs(seconds);
        match seed % 12 {
            0 => sim.crash(relay),
            1 => sim.crash(leader),
            2 => sim.break_link(client, relay),
            3 => sim.break_link(leader, relay),
            4 => sim.break_link(client, leader),
            // A cut for as long as the link lasts, and a longer one.
            5 | 6 => {
                let until = for_s(&sim, if seed % 12 == 5 { 2 } else { 30 });
                for (from, to) in [(client, relay), (relay, client)] {
                    let only = |peer| Who::Only([peer].into());
                    sim.cut(Cut { from: only(from), to: only(to), until });
                }
            }
            7 => sim.hang(relay),
            8 => sim.stop(relay),
            9 => sim.slow(relay, Duration::from_millis(3)),
            10 => {
                sim.start_node();
            }
            _ => {
                let Peer::Node(node) = relay else { unreachable!() };
                sim.leave(node);
            }
        }
        for _ in 0..60 {
            sim.run_for(Duration::from_millis(100)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            for &client in &clients {
                assert!(sim.client(client).bodies().count() >= 40, "seed {seed}: {client}");
            }
        }
        match seed % 12 {
            // What the relay holds must not count as the truth.
            7 | 8 => sim.crash(relay),
            9 => {
                sim.slow(relay, Duration::ZERO);
                sim.run_for(Duration::from_secs(1)).unwrap();
            }
            _ => {}
        }
        stay_fresh(&mut sim, &clients, seed);
    }
}

#[test]
fn clients_of_relays_see_what_others_do_whatever_goes_wrong() {
    use FaultProfile::{
        Delay, Duplicate, Grow, KillLeader, KillNode, KillServer, Loss5, Loss20, OneWay, Partition1,
        Partition5, Rebalance, Reorder, Restore, Shrink, Stop,
    };
    let profiles = [
        Loss5, Loss20, Delay, Reorder, Duplicate, Partition1, Partition5, OneWay, KillNode, KillLeader,
        KillServer, Stop, Rebalance, Grow, Shrink, Restore,
    ];
    for (profile, seed) in profiles.into_iter().zip([0, 1].into_iter().cycle()) {
        let config = TrialConfig { relays_above: Some(seed as u32 % 2), ..TrialConfig::default() };
        let outcome = run_trial(&config, profile, seed, &profile.schedule(seed));
        assert!(
            outcome.violation.is_none(),
            "{profile}, seed {seed}: {:?}\n{}",
            outcome.violation,
            outcome.timeline
        );
    }
}
