//! Tests trials over Rapier: bodies that touch across borders while clusters are disturbed.

use std::ops::Range;

use super::*;

fn config(scene: ContactScene) -> TrialConfig {
    TrialConfig { begin: scene.begin(), ..TrialConfig::default() }
}

fn hold(profiles: &[FaultProfile], seeds: Range<u64>) {
    for scene in ContactScene::ALL {
        for &profile in profiles {
            let row = simulate(&config(scene), profile, seeds.clone(), 2, &|| true);
            let failures: String =
                row.failures.iter().map(|failure| format!("{scene} {profile}: {failure}")).collect();
            assert_eq!((row.seeds, row.violations), (seeds.end - seeds.start, 0), "{failures}");
            assert!(row.strain.greatest() > 0.0, "{scene}: what is measured is never nothing");
        }
    }
}

#[test]
fn what_touches_holds_in_bad_weather() {
    hold(&[FaultProfile::None, FaultProfile::Loss5, FaultProfile::Delay], 0..2);
}

#[test]
fn what_touches_holds_when_nodes_are_killed_or_stopped() {
    hold(&[FaultProfile::KillNode, FaultProfile::KillServer, FaultProfile::Stop], 0..2);
}

#[test]
fn what_touches_holds_when_regions_move() {
    hold(&[FaultProfile::Rebalance], 0..2);
    hold(&[FaultProfile::Shrink], 0..3);
}

/// Runs a seed in which nothing goes wrong but what is planted.
fn planted(scene: ContactScene, spoilt: Option<Spoilt>) -> Option<String> {
    let config = TrialConfig { spoilt, ..config(scene) };
    let profile = FaultProfile::None;
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
