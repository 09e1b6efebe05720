//! Tests that a served world is computed less finely where nobody looks, whatever happens to its nodes.

use std::collections::BTreeMap;

use super::*;
use crate::cluster::{Record, ServerEvent};
use crate::fidelity::{Fidelity, FidelityReport};
use crate::physics::ShapeLibrary;
use crate::protocol::{Area, BodyState, EnvironmentProperties};
use crate::scene::{Params, Scene};
use crate::space::{DistributionTree, Viewpoint};

/// An area beyond all districts.
const NOWHERE: Area = Area { centre: [0.0, 2.0, 500.0], radius_m: 1.0 };
/// An area with several of the 24 districts, which have 60 m each.
const DISTRICTS: Area = Area { centre: [-90.0, 20.0, -30.0], radius_m: 80.0 };

/// Starts a small town whose audits are never too bad.
fn town(config: SimConfig, cars: u32, viewpoints: Vec<Viewpoint>) -> Sim {
    let params = Params::new().with("n", 600).with("cars", cars).with("seed", config.seed);
    let scene = Scene::named("town", &params).unwrap();
    let mut shapes = ShapeLibrary::default();
    let (bodies, joints) = scene.records(&mut shapes).unwrap();
    let mut tree = DistributionTree::halved(scene.bounds, 1).unwrap();
    if let Some(cut) =
        DistributionTree::cut_by(scene.bounds, &scene.cuts).ok().filter(|_| config.balance.is_none())
    {
        tree = cut;
    }
    let world = EnvironmentProperties {
        step: scene.step_settings().record(),
        tree,
        halo_m: None,
        fidelity: Fidelity::Tolerance { m_s: 1e6 },
        viewpoints,
        ..sim_world(1)
    };
    Sim::with_world(config, world, Record::new(bodies, shapes.records(), joints), RapierEngine::boxed)
}

fn report(sim: &Sim) -> FidelityReport {
    sim.server().fidelity_report().expect("the leader tells it")
}

/// Runs for as long as rates take to follow and to be told. Returns the number of regions by level.
fn settle(sim: &mut Sim) -> [usize; 3] {
    let target = Tick(sim.tick().0 + 240);
    sim.run_to(target).unwrap();
    report(sim).levels
}

#[test]
fn a_served_world_is_computed_in_full_where_its_clients_look() {
    let mut sim = town(config(1, 3), 0, Vec::new());
    // Now and then signals refine some regions that nobody looks at.
    let is_left = |[full, _, coarse]: [usize; 3]| full <= 3 && coarse >= 19;
    let levels = settle(&mut sim);
    assert!(is_left(levels), "nobody is there: {levels:?}");
    assert!(report(&sim).audits > 0, "members audit");
    let client = sim.start_client_in(NOWHERE);
    let levels = settle(&mut sim);
    assert!(is_left(levels), "one looks elsewhere: {levels:?}");
    sim.submit(client, ClientEvent::Interest(Some(DISTRICTS)));
    let levels = settle(&mut sim);
    assert!(levels[0] >= 6 && levels[2] >= 10, "one looks at some districts: {levels:?}");
    // A client that is told of everything looks at everything.
    let all = sim.start_client(None);
    assert_eq!(settle(&mut sim), [24, 0, 0]);
    sim.crash(Peer::Client(all));
    sim.submit(client, ClientEvent::Interest(Some(NOWHERE)));
    // Its link must count as lost, and a second must pass.
    sim.run_until(|sim| is_left(report(sim).levels)).expect("who left looks no more");
}

#[test]
fn a_served_world_is_computed_in_full_where_its_program_looks_whoever_leads_and_serves() {
    let mut sim = town(config(1, 3), 0, Vec::new());
    let is_left = |[full, _, coarse]: [usize; 3]| full <= 3 && coarse >= 19;
    assert!(is_left(settle(&mut sim)), "nobody looks");
    let Area { centre: at, radius_m } = DISTRICTS;
    sim.order(ServerEvent::Look(vec![Viewpoint { at, radius_m }]));
    let is_seen = |[full, _, coarse]: [usize; 3]| full >= 6 && coarse >= 10;
    let levels = settle(&mut sim);
    assert!(is_seen(levels), "the program looks at some districts: {levels:?}");
    let leader = sim.server().view().unwrap().leader;
    sim.crash(Peer::Node(leader));
    let levels = settle(&mut sim);
    assert!(sim.server().view().unwrap().leader != leader && is_seen(levels), "another leads: {levels:?}");
    sim.crash(Peer::Server);
    sim.restart_server();
    let levels = settle(&mut sim);
    assert!(is_seen(levels), "another server serves: {levels:?}");
    sim.order(ServerEvent::Look(Vec::new()));
    let levels = settle(&mut sim);
    assert!(is_left(levels), "the program looks away: {levels:?}");
}

#[test]
fn an_avatar_is_computed_in_full_wherever_its_client_looks() {
    let mut sim = town(config(1, 3), 0, Vec::new());
    let client = sim.start_client_in(NOWHERE);
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    let avatar = BodyId::avatar(client, 0);
    let mut body = sim_body(avatar, [-90.0, 100.0, -30.0]);
    body.state.velocity.linear = [0.0, 1.0, 0.0];
    sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
    settle(&mut sim);
    // At a fourth of the rate the avatar would stand still in three of four ticks.
    let mut at = Vec::new();
    for _ in 0..12 {
        let next = Tick(sim.tick().0 + 1);
        sim.run_to(next).unwrap();
        at.push(sim.states()[&avatar].pose.translation);
    }
    let still = at.windows(2).filter(|two| two[0] == two[1]).count();
    assert_eq!(still, 0, "{at:?}");
}

#[test]
fn bodies_that_fall_where_nobody_looks_are_no_later_than_those_that_are_seen() {
    let fall = |viewpoints: Vec<Viewpoint>| {
        let mut sim = town(config(1, 2), 3, viewpoints);
        sim.run_until(|sim| sim.nodes().all(|node| node.tick() == Tick(200))).unwrap();
        sim.states()
    };
    let everywhere = Viewpoint { at: [0.0; 3], radius_m: 1e4 };
    let (seen, unseen) = (fall(vec![everywhere]), fall(Vec::new()));
    assert_eq!(seen.len(), unseen.len());
    // The cars drive on a road where nothing stands.
    let east = |states: &BTreeMap<BodyId, BodyState>| {
        let x = states.values().map(|state| state.pose.translation[0]);
        x.fold(f64::NEG_INFINITY, f64::max)
    };
    let moved = (east(&seen), east(&unseen));
    assert!((moved.0 - moved.1).abs() < 1.0, "{moved:?}");
}

fn less(config: SimConfig) -> Sim {
    let looks = Viewpoint { at: [-150.0, 2.0, -90.0], radius_m: 30.0 };
    town(config, 3, vec![looks])
}

fn hold(profiles: &[FaultProfile], verify: bool) {
    let config = TrialConfig { begin: less, clients: 0, verify, nodes: 4, ..TrialConfig::default() };
    for &profile in profiles {
        let row = simulate(&config, profile, 0..1, 2, &|| true);
        let failures: String = row.failures.iter().map(|failure| format!("{profile}: {failure}\n")).collect();
        assert_eq!((row.seeds, row.violations), (1, 0), "{failures}");
    }
}

#[test]
fn regions_that_are_behind_outlive_nodes_and_links() {
    hold(&[FaultProfile::KillNode, FaultProfile::KillLeader, FaultProfile::Stop], false);
    hold(&[FaultProfile::KillServer, FaultProfile::Partition1], false);
}

#[test]
fn regions_that_are_behind_follow_the_load() {
    hold(&[FaultProfile::Rebalance, FaultProfile::Grow], false);
}

#[test]
fn regions_that_are_behind_are_computed_once_more_to_the_same_bits() {
    hold(&[FaultProfile::KillNode, FaultProfile::Rebalance], true);
}
