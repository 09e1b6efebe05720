//! Tests interest management: clients that receive only a part of the world.

use super::*;
use crate::protocol::Area;
use crate::sim::Scope;

/// A ball with a tenth of the world's volume, in and around which bodies fly.
const AREA: Area = Area { centre: [6.0, 4.0, 4.0], radius_m: 3.0 };
/// The core of the area. States of bodies that have come so far in must have been sent: bodies fly at up to
/// 21 m/s, so they take some 8 ticks from the edge.
const CORE: Area = Area { radius_m: 1.0, ..AREA };
/// The oldest fresh state: members report every three ticks, then a message is on its way for some
/// milliseconds.
const FRESH_TICKS: u64 = 12;

/// Starts a client or participant, and runs until it has stated its interest and heard from its leader since.
fn interested(sim: &mut Sim, participates: bool, area: Area) -> ClientId {
    let client = if participates { sim.start_participant(None).1 } else { sim.start_client(None) };
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    sim.submit(client, ClientEvent::Interest(Some(area)));
    let target = Tick(sim.tick().0 + 60);
    sim.run_to(target).unwrap();
    client
}

/// Checks that states of bodies in the area, or that the client has there, are recent, and returns their
/// number. In the stand-in physics everything moves all the time.
fn check_fresh(sim: &Sim, client: ClientId, seed: u64) -> usize {
    let (now, truth) = (sim.tick(), sim.states());
    let mut seen = 0;
    for view in sim.client(client).bodies() {
        let (id, believed) = (view.body.id, view.body.state.pose.translation);
        let is = truth[&id].pose.translation;
        if AREA.covers(believed) || CORE.covers(is) {
            let age = now.0.saturating_sub(view.settled_tick().0);
            assert!(age <= FRESH_TICKS, "seed {seed}: {id} is {age} ticks old, {now}");
            seen += 1;
        }
        assert!(view.outside || AREA.covers(believed), "seed {seed}: {id}");
    }
    seen
}

fn stay_fresh(sim: &mut Sim, client: ClientId, seed: u64) {
    let mut seen = 0;
    for _ in 0..10 {
        let target = Tick(sim.tick().0 + 7);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        seen += check_fresh(sim, client, seed);
    }
    assert!(seen > 0, "seed {seed}: the test needs bodies in the area");
}

#[test]
fn what_a_client_believes_of_its_area_is_fresh() {
    for seed in 0..20 {
        let mut sim = running(seed, 3);
        let client = interested(&mut sim, seed % 2 == 1, AREA);
        stay_fresh(&mut sim, client, seed);
        let other = Area { centre: [12.0, 4.0, 4.0], ..AREA };
        for area in [Some(other), None, Some(AREA)] {
            sim.submit(client, ClientEvent::Interest(area));
            sim.run_events(200).unwrap();
        }
        let target = Tick(sim.tick().0 + 20);
        sim.run_to(target).unwrap();
        stay_fresh(&mut sim, client, seed);
    }
}

#[test]
fn an_interest_outlives_leaders_links_and_servers() {
    for seed in 0..20 {
        let mut sim = running(seed, 3);
        let client = interested(&mut sim, seed % 2 == 1, AREA);
        let leader = sim.server().view().unwrap().leader;
        match seed % 5 {
            0 | 1 => sim.crash(Peer::Node(leader)),
            2 => sim.break_link(Peer::Client(client), Peer::Node(leader)),
            3 => sim.break_link(Peer::Node(NodeId(4)), Peer::Node(leader)),
            _ => {
                sim.crash(Peer::Server);
                sim.run_for(Duration::from_secs(1)).unwrap();
                sim.restart_server();
            }
        }
        // Areas that are requested while nobody leads count too.
        sim.submit(client, ClientEvent::Interest(Some(Area { centre: [12.0, 4.0, 4.0], ..AREA })));
        sim.submit(client, ClientEvent::Interest(Some(AREA)));
        sim.run_for(Duration::from_secs(5)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        stay_fresh(&mut sim, client, seed);
        // The interest is still kept to: states of bodies outside are not sent.
        let now = sim.tick().0;
        assert!(sim.client(client).bodies().any(|view| view.settled_tick().0 + 30 < now), "seed {seed}");
        let before = bytes_to_clients(&sim);
        sim.submit(client, ClientEvent::Interest(Some(Area { centre: [500.0, 0.0, 0.0], radius_m: 1.0 })));
        sim.run_for(Duration::from_secs(1)).unwrap();
        let between = bytes_to_clients(&sim);
        sim.run_for(Duration::from_secs(2)).unwrap();
        assert!(between > before || seed % 2 == 1, "seed {seed}");
        // Nothing is there, so the client only hears that time goes on, twice a second.
        let idle = bytes_to_clients(&sim) - between;
        assert!(idle <= 5 * 15, "seed {seed}: {idle} bytes");
    }
}

fn bytes_to_clients(sim: &Sim) -> u64 {
    sim.sent().get(&Scope::Clients).map_or(0, |sent| sent.bytes)
}

#[test]
fn members_report_what_somebody_looks_at_and_hardly_anything_else() {
    let mut sim = running(5, 3);
    let client = interested(&mut sim, false, AREA);
    let told = |sim: &mut Sim| {
        let bytes = |sim: &Sim| sim.sent()[&Scope::InsideGroups].bytes;
        let before = bytes(sim);
        sim.run_to(Tick(sim.tick().0 + 120)).unwrap();
        bytes(sim) - before
    };
    let turn = |sim: &mut Sim, area| {
        sim.submit(client, ClientEvent::Interest(Some(area)));
        sim.run_to(Tick(sim.tick().0 + 20)).unwrap();
    };
    let seen = told(&mut sim);
    turn(&mut sim, Area { centre: [500.0, 0.0, 0.0], radius_m: 1.0 });
    let unseen = told(&mut sim);
    assert!(unseen < seen / 2, "{unseen} bytes where nobody looks, {seen} where somebody does");
    turn(&mut sim, AREA);
    stay_fresh(&mut sim, client, 5);
}

#[test]
fn loss_does_not_leave_ghosts_in_the_area() {
    for seed in 0..10 {
        let mut sim = running(seed, 3);
        let client = interested(&mut sim, false, AREA);
        let calm = sim.config.network.clone();
        sim.set_network(NetworkConditions { loss: 0.05, ..calm.clone() });
        sim.run_for(Duration::from_secs(10)).unwrap();
        sim.set_network(calm);
        let target = Tick(sim.tick().0 + 20);
        sim.run_to(target).unwrap();
        stay_fresh(&mut sim, client, seed);
    }
}

#[test]
fn an_area_of_a_tenth_costs_a_fraction_of_the_bytes() {
    let bytes = |area: Option<Area>| {
        let mut sim = running(3, 2);
        let client = interested(&mut sim, false, AREA);
        sim.submit(client, ClientEvent::Interest(area));
        sim.run_for(Duration::from_secs(1)).unwrap();
        // Bytes of states: headers of messages take more than these where so little moves.
        let bytes = |sim: &Sim| sim.client(client).tally().bits.iter().sum::<f64>() / 8.0;
        let before = bytes(&sim);
        sim.run_for(Duration::from_secs(10)).unwrap();
        bytes(&sim) - before
    };
    let (all, part) = (bytes(None), bytes(Some(AREA)));
    assert!(part > 0.0 && part < 0.6 * all, "{part} of {all}");
}

/// Starts a client that joins with an interest, and runs until it has heard from its leader.
fn joined_in(sim: &mut Sim, area: Area) -> ClientId {
    let client = sim.start_client_in(area);
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    let target = Tick(sim.tick().0 + 60);
    sim.run_to(target).unwrap();
    client
}

/// Checks that the client knows recent states of all bodies near the middle of its area, though it was never
/// told the whole world.
fn know_what_is_near(sim: &mut Sim, client: ClientId, seed: u64) {
    let mut seen = 0;
    for _ in 0..20 {
        let target = Tick(sim.tick().0 + 7);
        sim.run_to(target).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let (now, truth) = (sim.tick(), sim.states());
        for (&id, state) in truth.iter().filter(|(_, state)| CORE.covers(state.pose.translation)) {
            let view = sim.client(client).body(id);
            let age = view.map(|view| now.0.saturating_sub(view.settled_tick().0));
            assert!(
                age.is_some_and(|age| age <= FRESH_TICKS),
                "seed {seed}: {id} at {:?}: {age:?}",
                state.pose
            );
            seen += 1;
        }
    }
    assert!(seen > 0, "seed {seed}: the test needs bodies in the area");
}

#[test]
fn who_joins_with_an_interest_is_told_of_what_is_near_and_of_what_comes_near() {
    for seed in 0..20 {
        let mut sim = running(seed, 3);
        let client = sim.start_client_in(AREA);
        sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
        let (known, all) = (sim.client(client).bodies().count(), sim.states().len());
        assert!(known < all / 2, "seed {seed}: {known} of {all}");
        let target = Tick(sim.tick().0 + 60);
        sim.run_to(target).unwrap();
        know_what_is_near(&mut sim, client, seed);
        assert!(sim.client(client).bodies().count() > known, "seed {seed}: bodies came into the area");
        sim.submit(client, ClientEvent::Interest(None));
        let target = Tick(sim.tick().0 + 60);
        sim.run_to(target).unwrap();
        assert_eq!(sim.client(client).bodies().count(), sim.states().len(), "seed {seed}");
    }
}

#[test]
fn who_joined_with_an_interest_knows_what_is_near_after_any_fault() {
    for seed in 0..20 {
        let mut sim = running(seed, 3);
        let client = joined_in(&mut sim, AREA);
        let leader = sim.server().view().unwrap().leader;
        match seed % 4 {
            0 => sim.crash(Peer::Node(leader)),
            1 => sim.break_link(Peer::Client(client), Peer::Node(leader)),
            2 => sim.break_link(Peer::Client(client), Peer::Server),
            _ => {
                sim.crash(Peer::Server);
                sim.run_for(Duration::from_secs(1)).unwrap();
                sim.restart_server();
            }
        }
        sim.run_for(Duration::from_secs(5)).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        know_what_is_near(&mut sim, client, seed);
        assert!(sim.client(client).bodies().count() <= sim.states().len(), "seed {seed}");
    }
}
