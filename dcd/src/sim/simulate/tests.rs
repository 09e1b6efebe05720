//! Tests the fault table with a few seeds of each row, and tests that violations are found.

use super::*;
use crate::sim::Spoilt;

fn few(config: &TrialConfig, profile: FaultProfile, seeds: Range<u64>) -> Row {
    simulate(config, profile, seeds, 2, &|| true)
}

fn hold(profiles: &[FaultProfile], seeds: Range<u64>) -> Vec<Row> {
    let check = |&profile: &FaultProfile| {
        let row = few(&TrialConfig::default(), profile, seeds.clone());
        let failures: String = row.failures.iter().map(|failure| format!("{profile}: {failure}")).collect();
        assert_eq!((row.seeds, row.violations), (seeds.end - seeds.start, 0), "{failures}");
        assert!(row.holds(), "{profile}: p99 of what clients see is {:?} ms old", row.staleness_ms);
        row
    };
    profiles.iter().map(check).collect()
}

#[test]
fn the_world_holds_in_bad_weather() {
    use FaultProfile::{Delay, Duplicate, Loss1, Loss5, Loss20, None, Reorder};
    hold(&[None, Loss1, Loss5, Loss20, Delay, Reorder, Duplicate], 0..4);
}

#[test]
fn the_world_holds_when_processes_cannot_reach_one_another() {
    use FaultProfile::{OneWay, Partition1, Partition5, Partition30};
    hold(&[Partition1, Partition5, Partition30, OneWay], 0..4);
}

#[test]
fn the_world_holds_when_processes_are_killed_or_stopped() {
    use FaultProfile::{KillLeader, KillNode, KillServer, Stop};
    hold(&[KillNode, KillLeader, KillServer, Stop], 0..4);
}

#[test]
fn the_world_holds_when_it_goes_back_to_a_save() {
    hold(&[FaultProfile::Restore], 0..12);
}

/// Of the seeds of these rows one kills nodes and one cuts them off.
#[test]
fn the_world_holds_when_regions_follow_the_load_and_nodes_come_go_or_tire() {
    use FaultProfile::{Grow, Rebalance, Shrink, SlowNode};
    let rows = hold(&[Rebalance, Grow, Shrink, SlowNode], 1..3);
    assert!(rows.iter().all(|row| row.tally.evictions > 0), "nodes are killed and cut off");
}

#[test]
fn the_world_holds_when_clocks_differ() {
    hold(&[FaultProfile::ClockSkew], 0..4);
}

#[test]
fn the_world_holds_when_members_are_out_of_step() {
    hold(&[FaultProfile::Lag], 0..4);
}

#[test]
fn several_groups_hold_and_agree_whoever_is_killed_cut_off_or_stopped() {
    hold(&[FaultProfile::GroupsKill, FaultProfile::GroupsServer, FaultProfile::GroupsCut], 0..1);
}

#[test]
fn the_world_holds_when_all_goes_wrong_at_once() {
    hold(&[FaultProfile::All], 0..12);
}

#[test]
fn a_planted_bug_is_found_within_a_thousand_seeds_and_told_with_its_seed() {
    let config = TrialConfig { lost_transfers: 1, ..TrialConfig::default() };
    let found = (0..1_000).find_map(|seed| {
        let row = few(&config, FaultProfile::All, seed..seed + 1);
        row.failures.into_iter().find(|failure| matches!(failure.violation, Violation::Lost { .. }))
    });
    let failure = found.expect("a transfer that is lost leaves a body without an owner");
    // The shrunk schedule still shows the violation.
    let again = run_trial(&config, FaultProfile::All, failure.seed, &failure.schedule);
    assert_eq!(again.violation, Some(failure.violation.clone()));
    assert!(failure.schedule.faults.is_empty(), "a lost transfer needs no other fault: {failure}");
    assert!(failure.to_string().contains(&format!("seed {}: ", failure.seed)));
}

#[test]
fn a_seed_gives_the_same_run_and_the_report_does_not_depend_on_threads() {
    let run = |threads| {
        let row = simulate(&TrialConfig::default(), FaultProfile::All, 0..6, threads, &|| true);
        (row.violations, row.tally, row.traffic, row.worst_recovery, row.staleness_ms, row.simulated)
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_row_that_is_interrupted_says_how_far_it_came() {
    let asked = AtomicU64::new(0);
    let goes_on = || asked.fetch_add(1, Ordering::Relaxed) < 3;
    let row = simulate(&TrialConfig::default(), FaultProfile::None, 0..100, 1, &goes_on);
    assert_eq!(row.seeds, 3);
}

/// Runs a seed in which nothing goes wrong but this profile's faults and the planted bug.
fn planted(profile: FaultProfile, spoilt: Option<Spoilt>) -> Option<Violation> {
    let config = TrialConfig { spoilt, ..TrialConfig::default() };
    run_trial(&config, profile, 1, &profile.schedule(1)).violation
}

#[test]
fn what_flies_straight_on_is_watched() {
    use FaultProfile::{KillNode, None as Calm};
    for (profile, spoilt) in [(Calm, Spoilt::Halted), (Calm, Spoilt::Stale), (KillNode, Spoilt::Recovered)] {
        assert_eq!(planted(profile, None), None);
        let found = planted(profile, Some(spoilt));
        assert!(matches!(found, Some(Violation::Strained { .. })), "{spoilt:?}: {found:?}");
    }
}

#[test]
fn what_nobody_saw_is_not_too_old() {
    let config = TrialConfig { clients: 0, ..TrialConfig::default() };
    let row = few(&config, FaultProfile::Loss5, 0..1);
    assert_eq!(row.staleness_ms, None);
    assert!(row.holds(), "{:?}", row.failures);
    let stale = Row { staleness_ms: Some(250), ..row };
    assert!(!stale.holds());
}

#[test]
fn a_world_of_one_node_goes_on_when_that_is_back() {
    use FaultProfile::{KillLeader, KillNode, Stop};
    let config = TrialConfig { nodes: 1, ..TrialConfig::default() };
    for profile in [KillNode, KillLeader, Stop] {
        let row = few(&config, profile, 0..4);
        let failures: String = row.failures.iter().map(|failure| format!("{profile}: {failure}")).collect();
        assert_eq!(row.violations, 0, "{failures}");
    }
}
