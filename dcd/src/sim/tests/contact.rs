//! Tests trials over Rapier: bodies that touch across borders while clusters are disturbed.

use std::ops::Range;

use rapier3d::prelude::Vector;

use super::*;
use crate::cluster::Record;
use crate::physics::ShapeLibrary;
use crate::protocol::EnvironmentProperties;
use crate::scene::{Params, Scene};
use crate::space::DistributionTree;

fn trial(scene: ContactScene) -> TrialConfig {
    TrialConfig { begin: scene.begin(), ..TrialConfig::default() }
}

fn hold(profiles: &[FaultProfile], seeds: Range<u64>) {
    for scene in ContactScene::ALL {
        for &profile in profiles {
            let row = simulate(&trial(scene), profile, seeds.clone(), 2, &|| true);
            let failures: String =
                row.failures.iter().map(|failure| format!("{scene} {profile}: {failure}")).collect();
            assert_eq!((row.seeds, row.violations), (seeds.end - seeds.start, 0), "{failures}");
            assert!(row.strain.greatest() > 0.0, "{scene}: what is measured is never nothing");
        }
    }
}

#[test]
fn no_body_goes_back_a_tick_with_the_members_that_are_lost_in_it() {
    // Two of four nodes are cut off in a tick that they complete and the others do not.
    let row = simulate(&trial(ContactScene::Crowd), FaultProfile::OneWay, 21..22, 2, &|| true);
    assert_eq!((row.seeds, row.violations), (1, 0), "{:?}", row.failures);
}

#[test]
fn what_hangs_on_a_chain_comes_back_beside_it_though_its_guide_was_told_of_later() {
    // The server begins anew. A member that keeps the end of the chain is lost after others have told of the rest.
    let row = simulate(&trial(ContactScene::Chain), FaultProfile::All, 55..56, 2, &|| true);
    assert_eq!((row.seeds, row.violations), (1, 0), "{:?}", row.failures);
}

#[test]
fn what_touches_holds_in_bad_weather() {
    hold(&[FaultProfile::None, FaultProfile::Loss5, FaultProfile::Delay], 0..1);
}

#[test]
fn what_touches_holds_when_nodes_are_killed_or_stopped() {
    hold(&[FaultProfile::KillNode, FaultProfile::KillServer, FaultProfile::Stop], 0..1);
}

#[test]
fn what_touches_holds_when_regions_move() {
    hold(&[FaultProfile::Rebalance], 0..1);
    hold(&[FaultProfile::Shrink], 0..2);
}

/// Runs a seed in which nothing goes wrong but the planted bug.
fn planted(scene: ContactScene, spoilt: Option<Spoilt>) -> Option<String> {
    planted_beside(FaultProfile::None, scene, spoilt)
}

/// Runs a seed in which nothing goes wrong but this profile's faults and the planted bug.
fn planted_beside(profile: FaultProfile, scene: ContactScene, spoilt: Option<Spoilt>) -> Option<String> {
    let config = TrialConfig { spoilt, ..trial(scene) };
    match run_trial(&config, profile, 1, &profile.schedule(1)).violation {
        Some(Violation::Strained { what, .. }) => Some(what),
        None => None,
        Some(other) => panic!("{other}"),
    }
}

#[test]
fn a_velocity_that_is_lost_in_a_hand_over_is_found() {
    assert_eq!(planted(ContactScene::Crowd, None), None);
    let found = planted(ContactScene::Crowd, Some(Spoilt::Halted)).expect("it is found");
    assert!(found.contains("has changed its velocity"), "{found}");
}

#[test]
fn a_body_that_is_handed_over_a_tick_late_is_found() {
    let found = planted(ContactScene::Crowd, Some(Spoilt::Stale)).expect("it is found");
    assert!(found.contains("is not where its velocity brought it"), "{found}");
}

#[test]
fn boxes_that_stand_and_are_handed_over_aside_as_nodes_die_are_found() {
    let found = |spoilt| planted_beside(FaultProfile::KillNode, ContactScene::Stack, spoilt);
    assert_eq!(found(None), None);
    let found = found(Some(Spoilt::Aside)).expect("it is found");
    assert!(found.contains("a body that stood has moved"), "{found}");
}

#[test]
fn a_tower_under_load_stands_while_one_node_after_the_other_leaves() {
    let params = Params::new().with("top_mass_ratio", 100).with("sleep", 0);
    let scene = Scene::named("tower", &params).unwrap();
    let mut shapes = ShapeLibrary::default();
    let (bodies, joints) = scene.records(&mut shapes).unwrap();
    let tree = DistributionTree::halved(scene.bounds, 1).unwrap();
    let world =
        EnvironmentProperties { step: scene.step_settings().record(), tree, halo_m: None, ..sim_world(1) };
    let record = Record::new(bodies, shapes.records(), joints);
    let mut sim = Sim::with_world(config(1, 1), world, record, RapierEngine::boxed);
    sim.run_to(Tick(300)).unwrap();
    let mut node = NodeId(1);
    for changes in 1..=10 {
        let next = sim.start_node();
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 2)).unwrap();
        sim.leave(node);
        node = next;
        let (until, mut worst_m_s) = (Tick(sim.tick().0 + 100), 0.0_f32);
        let last = |sim: &Sim| {
            let speeds =
                sim.states().into_values().map(|state| Vector::from_array(state.velocity.linear).length());
            worst_m_s = worst_m_s.max(speeds.fold(0.0, f32::max));
            sim.tick() >= until
        };
        sim.run_until(last).unwrap();
        assert!(worst_m_s < 0.03, "{worst_m_s} m/s after {changes} changes");
    }
    assert_eq!(sim.nodes().count(), 1);
}
