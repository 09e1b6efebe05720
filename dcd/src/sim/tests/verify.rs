//! Tests that a participant that computes wrongly is found, and that no other participant is accused.

use super::*;
use crate::protocol::{Finding, Hindrance};
use crate::space::Balance;

/// Starts a cluster in which every third node is dedicated, and the first of these leads. The other nodes are
/// participants that are verified.
fn verified(seed: u64, nodes: u32) -> Sim {
    Sim::new(SimConfig { verify: true, ..config(seed, nodes) })
}

/// Runs until a participant has been found to deviate. Returns which one, and the tick.
fn found(sim: &mut Sim) -> (NodeId, Tick) {
    let deviates = |&(node, tick, finding): &(NodeId, Tick, Finding)| {
        matches!(finding, Finding::Deviates(_)).then_some((node, tick))
    };
    sim.run_until(|sim| sim.findings.iter().any(|found| deviates(found).is_some())).unwrap();
    sim.findings.iter().find_map(deviates).expect("it was found")
}

fn ticks_verified(sim: &Sim) -> u64 {
    sim.nodes().map(|node| node.counters().verified).sum()
}

#[test]
fn what_participants_compute_is_computed_once_more_from_its_first_tick_on() {
    let mut sim = verified(1, 3);
    sim.run_to(Tick(300)).unwrap();
    assert_eq!(sim.findings, []);
    let ticks = ticks_verified(&sim);
    assert!((2 * 295..=2 * 302).contains(&ticks), "{ticks} ticks of two participants");
}

/// A single bit of a single body is flipped once. Clients are told of the body every third tick, neighbours
/// every tick.
#[test]
fn a_participant_that_computes_otherwise_by_one_bit_is_found_within_three_ticks_and_goes() {
    let mut tried = 0;
    for seed in 0..20 {
        let mut sim = verified(seed, 3);
        let cheat = NodeId(2 + (seed % 2) as u32);
        sim.flip(cheat, Tick(30));
        sim.run_until(|sim| sim.flipped().is_some()).unwrap();
        let flipped = sim.flipped().unwrap().clone();
        // The last bits of a place may be lost as the body moves on, before anybody is told.
        if flipped.field.starts_with("translation") {
            continue;
        }
        tried += 1;
        let (node, tick) = found(&mut sim);
        assert_eq!(node, cheat, "seed {seed}");
        assert!(flipped.tick < tick && tick.0 <= flipped.tick.0 + 3, "seed {seed}: {tick} of {flipped:?}");
        sim.run_until(|sim| !sim.nodes().any(|node| node.id() == cheat)).unwrap();
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 2)).unwrap();
        let later = Tick(sim.tick().0 + 30);
        sim.run_to(later).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!(sim.checker().owned(), 40, "seed {seed}: what it computed is taken over");
        // Nobody may know what the cheat said at its end, and so what another participant did with it.
        let others = sim.findings.iter().filter(|(node, ..)| *node != cheat);
        assert!(
            others.into_iter().all(|found| !matches!(found.2, Finding::Deviates(_))),
            "{:?}",
            sim.findings
        );
    }
    assert!(tried > 5, "{tried}");
}

#[test]
fn who_tells_a_dedicated_node_what_it_has_not_computed_is_found() {
    let mut sim = verified(3, 6);
    sim.run_to(Tick(20)).unwrap();
    let (cheat, dedicated) = (NodeId(2), NodeId(4));
    assert_eq!(sim.server().view().unwrap().leader, NodeId(1));
    sim.liar = Some((cheat, dedicated));
    assert_eq!(found(&mut sim).0, cheat);
}

/// Nobody else has heard what one participant tells another. Both are named, and neither has to go.
#[test]
fn of_two_participants_that_contradict_each_other_neither_goes() {
    let mut sim = Sim::new(SimConfig { verify: true, regions: 4, ..config(4, 4) });
    sim.run_to(Tick(20)).unwrap();
    let (liar, other) = (NodeId(2), NodeId(3));
    sim.liar = Some((liar, other));
    sim.run_until(|sim| sim.findings.len() == 3).unwrap();
    sim.run_for(Duration::from_secs(2)).unwrap();
    let mut found: Vec<_> = sim.findings.iter().map(|&(node, _, finding)| (node, finding)).collect();
    found.sort_by_key(|(node, _)| *node);
    // It is known what the liar was told, but not what the other one was told.
    let (of_liar, of_other) = (Finding::Contradicts(other), Finding::Contradicts(liar));
    assert_eq!(found, [(liar, of_liar), (other, of_other), (other, Finding::GivenUp(Hindrance::Unknown))]);
    assert_eq!(sim.server().view().unwrap().members.len(), 4);
}

#[test]
fn who_is_verified_stays_so_while_others_come_and_go() {
    for seed in 0..10 {
        let mut sim = verified(seed, 3);
        sim.run_to(Tick(30)).unwrap();
        let late = sim.start_node();
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 4)).unwrap();
        sim.run_for(Duration::from_secs(1)).unwrap();
        sim.leave(late);
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 3)).unwrap();
        let (before, tick) = (ticks_verified(&sim), sim.tick());
        sim.run_to(Tick(tick.0 + 100)).unwrap();
        assert_eq!(sim.findings, [], "seed {seed}");
        assert!(ticks_verified(&sim) - before >= 2 * 95, "seed {seed}: both go on to be verified");
        sim.flip(NodeId(3), sim.tick());
        assert_eq!(found(&mut sim).0, NodeId(3), "seed {seed}");
    }
}

#[test]
fn who_was_there_before_the_node_that_leads_is_verified_by_that_from_its_first_tick_on() {
    for seed in 0..5 {
        let mut sim = verified(seed, 6);
        sim.run_to(Tick(30)).unwrap();
        sim.crash(Peer::Node(NodeId(1)));
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.leader == NodeId(4))).unwrap();
        let tick = sim.tick();
        sim.run_to(Tick(tick.0 + 100)).unwrap();
        assert_eq!(sim.findings, [], "seed {seed}");
        let ticks = ticks_verified(&sim);
        assert!(ticks >= 4 * 95, "seed {seed}: {ticks} ticks of four participants");
        assert_eq!(sim.checker().owned(), 40, "seed {seed}");
        sim.flip(NodeId(3), sim.tick());
        assert_eq!(found(&mut sim).0, NodeId(3), "seed {seed}");
    }
}

#[test]
fn a_server_that_is_started_again_has_those_verified_who_are_there() {
    for seed in 0..5 {
        let mut sim = verified(seed, 3);
        sim.run_to(Tick(30)).unwrap();
        sim.crash(Peer::Server);
        sim.run_for(Duration::from_secs(1)).unwrap();
        sim.restart_server();
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.members.len() == 3)).unwrap();
        let (before, tick) = (ticks_verified(&sim), sim.tick());
        sim.run_to(Tick(tick.0 + 100)).unwrap();
        assert_eq!(sim.findings, [], "seed {seed}");
        assert!(ticks_verified(&sim) - before >= 2 * 95, "seed {seed}");
        sim.flip(NodeId(3), sim.tick());
        assert_eq!(found(&mut sim).0, NodeId(3), "seed {seed}");
    }
}

#[test]
fn without_a_dedicated_node_nobody_is_verified_which_is_said() {
    let mut sim = verified(1, 3);
    sim.run_to(Tick(30)).unwrap();
    sim.crash(Peer::Node(NodeId(1)));
    sim.run_until(|sim| sim.server().view().is_some_and(|view| view.leader == NodeId(2))).unwrap();
    // The other one was in a group of its own for a while, without the node that verified it.
    let found: Vec<_> = sim.findings.iter().map(|&(node, _, finding)| (node, finding)).collect();
    assert_eq!(found, [(NodeId(3), Finding::GivenUp(Hindrance::Unled))]);
}

/// Threads of their own compute it, and may come to it late or never.
#[test]
fn the_world_does_not_wait_for_what_is_computed_once_more() {
    let run = |slow_verifier| {
        let mut sim = verified(1, 3);
        sim.slow_verifier = slow_verifier;
        sim.run_to(Tick(300)).unwrap();
        let found = sim.findings.iter().map(|&(node, _, finding)| (node, finding));
        (sim.now(), found.collect::<Vec<_>>())
    };
    let ((usual, none), (slow, given_up)) = (run(1.0), run(500.0));
    assert_eq!(none, []);
    assert_eq!(given_up, [2, 3].map(|node| (NodeId(node), Finding::GivenUp(Hindrance::Behind))));
    assert!(slow < usual + Duration::from_millis(100), "{slow:?}, usually {usual:?}");
}

/// Regions follow the load, so that all regions of a participant are born in a view, and empty.
#[test]
fn regions_that_are_cut_and_merged_are_verified_too() {
    for seed in 0..5 {
        let balance = Some(Balance { every_ticks: 20, smallest_edge_m: 1.0, ..Balance::by_nodes() });
        let mut sim = Sim::new(SimConfig { verify: true, balance, regions: 1, ..config(seed, 1) });
        sim.run_to(Tick(20)).unwrap();
        for _ in 0..3 {
            sim.start_node();
        }
        sim.run_until(|sim| sim.server().view().is_some_and(|view| view.allocation.len() == 4)).unwrap();
        sim.run_for(Duration::from_secs(3)).unwrap();
        assert_eq!(sim.findings, [], "seed {seed}");
        sim.flip(NodeId(2), sim.tick());
        assert_eq!(found(&mut sim).0, NodeId(2), "seed {seed}");
    }
}

#[test]
fn nothing_is_sent_for_it_where_no_participant_is() {
    let sent = |verify| {
        let mut sim = Sim::new(SimConfig { verify, ..config(5, 1) });
        sim.run_to(Tick(100)).unwrap();
        sim.sent().clone()
    };
    assert_eq!(sent(true), sent(false));
}

/// Runs seeds of trials in which two of three nodes are participants. Returns how many ticks were verified.
fn trials(config: &TrialConfig, profiles: &[FaultProfile], seeds: std::ops::Range<u64>) -> u64 {
    let mut verified = 0;
    for (&profile, seed) in profiles.iter().flat_map(|profile| seeds.clone().map(move |seed| (profile, seed)))
    {
        let outcome = run_trial(config, profile, seed, &profile.schedule(seed));
        assert!(
            outcome.violation.is_none(),
            "{profile}, seed {seed}: {:?}\n{}",
            outcome.violation,
            outcome.timeline
        );
        verified += outcome.verified;
    }
    verified
}

#[test]
fn no_honest_participant_is_accused_whatever_goes_wrong() {
    use FaultProfile::{
        Delay, Duplicate, Grow, KillLeader, KillNode, KillServer, Loss20, OneWay, Partition1, Partition5,
        Rebalance, Reorder, Restore, Shrink, Stop,
    };
    let profiles = [
        Loss20, Delay, Reorder, Duplicate, Partition1, Partition5, OneWay, KillNode, KillLeader, KillServer,
        Stop, Rebalance, Grow, Shrink, Restore,
    ];
    let verified = trials(&TrialConfig { verify: true, ..TrialConfig::default() }, &profiles, 0..1);
    assert!(verified > 2_500, "{verified} ticks");
}

#[test]
fn what_touches_is_computed_once_more_to_the_same_bits() {
    use FaultProfile::{KillNode, None, Rebalance};
    for scene in ContactScene::ALL {
        let config = TrialConfig { verify: true, begin: scene.begin(), ..TrialConfig::default() };
        let verified = trials(&config, &[None, KillNode, Rebalance], 0..1);
        assert!(verified > 300, "{scene}: {verified} ticks");
    }
}

/// A bit of a body that touches others is flipped, on one of two participants.
#[test]
fn a_participant_that_computes_what_touches_otherwise_by_one_bit_is_found_within_three_ticks() {
    for scene in ContactScene::ALL {
        for seed in 1..3 {
            let cheat = NodeId(2 + (seed % 2) as u32);
            let mut sim = scene.begin()(SimConfig { verify: true, ..config(seed, 3) });
            // What the cheat does to its bodies is no fault of a hand-over.
            sim.watch = None;
            sim.flip(cheat, Tick(30));
            let (node, tick) = found(&mut sim);
            assert_eq!(node, cheat, "{scene}, seed {seed}");
            let flipped = sim.flipped().unwrap().tick;
            assert!(flipped < tick && tick.0 <= flipped.0 + 3, "{scene}, seed {seed}: {tick}");
        }
    }
}
