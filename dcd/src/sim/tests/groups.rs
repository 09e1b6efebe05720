//! Tests three groups of four nodes, 60 ms from one another. Two nodes of each group have a client with an
//! avatar in their process.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::avatar;
use crate::cluster::{ClientEvent, Peer};
use crate::protocol::{DelayThresholds, Thresholds, Velocity};
use crate::sim::fixtures::as_fast;
use crate::sim::{Apart, Comparer, FaultProfile, Random, Sim, SimConfig, sim_body};
use crate::space::{BodyId, ClientId, GroupId, NodeId, Tick};

const SITES: u32 = 3;
const MS: Duration = Duration::from_millis(1);
const TICK: Duration = Duration::from_nanos(16_666_667);

/// Starts the cluster, and runs until the groups have formed and the avatars are there.
fn groups(seed: u64) -> (Sim, Vec<ClientId>) {
    let delay = DelayThresholds { inclusion_ms: 30.0, rejection_ms: 60.0, deviation_ms: 30.0 };
    let mut sim = Sim::new(SimConfig {
        seed,
        nodes: 2 * SITES,
        bodies: 20,
        speed_m_s: 2.0,
        network: FaultProfile::GroupsKill.schedule(0).network,
        thresholds: Thresholds { delay: Some(delay), ..Thresholds::default() },
        state_every: 1,
        ..SimConfig::default()
    });
    for node in 1..=2 * SITES {
        sim.place(Peer::Node(NodeId(node)), node % SITES);
    }
    let mut clients = Vec::new();
    for at in 0..2 * SITES {
        let (node, client) = sim.start_participant(None);
        sim.place(Peer::Node(node), at % SITES);
        sim.place(Peer::Client(client), at % SITES);
        clients.push(client);
    }
    sim.run_until(|sim| sizes(sim) == [4; SITES as usize]).unwrap();
    for &client in &clients {
        sim.run_until(|sim| sim.client(client).leader().is_some()).unwrap();
        let place = [2.0 + 2.0 * f64::from(client.0), 4.0, 4.0];
        sim.submit(client, ClientEvent::Spawn { body: sim_body(avatar(client), place), shapes: Vec::new() });
    }
    sim.run_until(|sim| clients.iter().all(|&client| sim.client(client).body(avatar(client)).is_some()))
        .unwrap();
    sim.run_for(Duration::from_secs(2)).unwrap();
    (sim, clients)
}

fn sizes(sim: &Sim) -> Vec<usize> {
    sim.server().views().map(|(_, view)| view.members.len()).collect()
}

/// Returns the newest tick of each group.
fn ticks(sim: &Sim) -> BTreeMap<GroupId, u64> {
    let tick = |group| sim.checker().progress(group).map_or(0, |(_, tick)| tick.0);
    sim.server().views().map(|(group, _)| (group, tick(group))).collect()
}

fn input(sim: &mut Sim, client: ClientId, linear: [f32; 3]) -> Velocity {
    let velocity = Velocity { linear, angular: [0.0; 3] };
    sim.submit(client, ClientEvent::Input { body: avatar(client), tick: Tick(0), velocity, pose: None });
    velocity
}

fn site(node: NodeId) -> u32 {
    let participates = node.0 > 2 * SITES && node.0 <= 4 * SITES;
    (if participates { node.0 - 1 } else { node.0 }) % SITES
}

#[test]
fn nodes_near_one_another_are_a_group() {
    for seed in 0..3 {
        let (sim, clients) = groups(seed);
        for (group, view) in sim.server().views() {
            let sites: BTreeSet<_> = view.members.iter().map(|member| site(member.node)).collect();
            assert_eq!(
                (view.members.len(), sites.len()),
                (4, 1),
                "{group} of seed {seed}: {:?}",
                view.members
            );
        }
        let playing: BTreeSet<_> = clients.iter().map(|&client| sim.client(client).group()).collect();
        assert_eq!(playing.len(), 3, "clients play with the groups of their nodes");
    }
}

#[test]
fn an_avatar_is_seen_in_its_group_within_two_ticks_of_an_input() {
    let (mut sim, clients) = groups(1);
    let mut random = Random::new(2);
    for _ in 0..100 {
        let who = clients[random.below(6) as usize];
        let group = sim.client(who).group();
        let others: Vec<_> = clients
            .iter()
            .copied()
            .filter(|&other| other != who && sim.client(other).group() == group)
            .collect();
        assert_eq!(others.len(), 1);
        let began = sim.now();
        let input = input(&mut sim, who, std::array::from_fn(|_| random.unit() as f32 * 4.0 - 2.0));
        let sees = |sim: &Sim| {
            let view = sim.client(others[0]).body(avatar(who)).expect("it is there");
            as_fast(view.body.state.velocity, input)
        };
        sim.run_until(sees).unwrap();
        assert!(sim.now() - began <= 2 * TICK, "{:?}", sim.now() - began);
        for _ in 0..random.below(100) {
            sim.run_for(MS).unwrap();
            let tick = ticks(&sim)[&group.expect("it plays")];
            let view = sim.client(others[0]).body(avatar(who)).expect("it is there");
            assert!(view.settled_tick().0 + 2 >= tick, "{} at t{tick}", view.settled_tick());
        }
    }
}

#[test]
fn groups_keep_step_and_bodies_are_where_the_believed_group_has_them_but_for_the_time_after_a_bounce() {
    let (mut sim, clients) = groups(3);
    let mut random = Random::new(4);
    let threshold_m = f64::from(Thresholds::default().between_groups_m);
    sim.sample_every(6);
    let (mut comparer, mut compared, mut near) = (Comparer::new(3), 0, 0);
    let mut since: BTreeMap<(GroupId, BodyId), u32> = BTreeMap::new();
    for _ in 0..20 {
        let who = clients[random.below(6) as usize];
        input(&mut sim, who, std::array::from_fn(|_| random.unit() as f32 * 4.0 - 2.0));
        sim.run_for(Duration::from_secs(1)).unwrap();
        let ticks = comparer.compare(&mut sim);
        assert!(ticks.len() >= 9, "{} ticks in a second", ticks.len());
        for tick in ticks {
            assert!(tick.apart <= Duration::from_millis(60), "{:?}", tick.apart);
            assert_eq!(tick.bodies.len(), 2 * 20);
            for Apart { group, body, by_m } in tick.bodies {
                let is_near = by_m <= threshold_m;
                (compared, near) = (compared + 1, near + u32::from(is_near));
                let far = since.entry((group, body)).or_default();
                *far = if is_near { 0 } else { *far + 1 };
                assert!(*far < 10, "{body} has been {by_m} m off in {group} for a second");
            }
        }
    }
    assert!(f64::from(near) > 0.97 * f64::from(compared), "{near} of {compared}");
}

#[test]
fn a_leader_and_a_node_killed_in_each_group_cost_no_body_and_stop_no_other_group() {
    for seed in 0..2 {
        let (mut sim, _) = groups(10 + seed);
        let views: Vec<_> = sim.server().views().map(|(group, view)| (group, view.clone())).collect();
        for (group, view) in &views {
            for killed in [view.leader, view.members[2].node] {
                let before = ticks(&sim);
                sim.crash(Peer::Node(killed));
                let is_over = |sim: &Sim| {
                    let view = sim.server().views().find(|(id, _)| id == group).map(|(_, view)| view);
                    view.is_some_and(|view| {
                        view.members.iter().all(|member| member.node != killed)
                            && sim.checker().progress(*group).is_some_and(|(number, _)| number == view.number)
                    })
                };
                let began = sim.now();
                sim.run_until(is_over).unwrap();
                let took = sim.now() - began;
                assert!(took < Duration::from_secs(2), "seed {seed}, {killed} of {group}: {took:?}");
                for (other, tick) in ticks(&sim).into_iter().filter(|(other, _)| other != group) {
                    // While the main group is late, the others wait for it, by a quarter of each tick at
                    // most.
                    let made = TICK * (tick - before[&other]) as u32;
                    let least = took * 3 / 4;
                    assert!(made + 50 * MS > least, "{other} made {made:?} in {took:?} without {killed}");
                }
            }
        }
        assert_eq!(sizes(&sim), [2; 3]);
    }
}

#[test]
fn an_avatar_that_comes_back_to_a_group_of_an_older_view_is_heard_of_there() {
    let (mut sim, _) = groups(20);
    let client = sim.start_client(None);
    sim.run_until(|sim| sim.client(client).leader().is_some()).unwrap();
    let own = sim.client(client).group().unwrap();
    let others: Vec<_> = sim.server().views().filter(|(group, _)| *group != own).collect();
    let killed =
        others[0].1.members.iter().map(|member| member.node).find(|&node| node != others[0].1.leader);
    sim.crash(Peer::Node(killed.unwrap()));
    sim.run_until(|sim| sizes(sim).contains(&3)).unwrap();
    let id = avatar(client);
    let body = sim_body(id, [6.0, 6.0, 6.0]);
    sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
    sim.run_until(|sim| sim.state(id).is_some()).unwrap();
    sim.crash(Peer::Client(client));
    sim.run_until(|sim| sim.state(id).is_none()).unwrap();
    sim.start_client(Some(client));
    sim.run_until(|sim| sim.state(id).is_some()).unwrap();
    let views: BTreeMap<_, _> = sim.server().views().map(|(group, view)| (group, view.number)).collect();
    assert!(views[&own] < *views.values().max().unwrap(), "the test needs groups of unlike views");
    let moving = input(&mut sim, client, [0.5, 0.0, 0.0]);
    let is_told = |sim: &Sim| {
        let view = sim.client(client).body(id);
        view.is_some_and(|view| view.body.state.velocity == moving && view.settled_tick() > Tick(0))
    };
    sim.run_until(is_told).unwrap();
}
