//! Tests that votes do not flap: nodes and server run together for an hour, and a node whose delay goes up
//! and down moves only a few times.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::tests::THRESHOLDS;
use super::*;
use crate::sim::Random;

/// A scenario: nodes ping each other every five seconds for an hour, and the delay of the last one drifts.
struct Hour {
    nodes: u32,
    watch: DelayRules,
    polls: PollRules,
    thresholds: VoteThresholds,
}

#[derive(Clone, Copy, Debug)]
struct Drift {
    period_s: f64,
    amplitude_ms: f64,
    noise_ms: f64,
    seed: u64,
}

impl Hour {
    fn careful() -> Self {
        Self { nodes: 4, watch: DelayRules::default(), polls: PollRules::default(), thresholds: THRESHOLDS }
    }

    /// Returns a scenario without the rules that keep nodes from flapping.
    fn careless() -> Self {
        let none = Duration::ZERO;
        let polls = PollRules {
            rest: none,
            max_votes: usize::MAX,
            min_stay: none,
            return_after: none,
            forgiven_after: none,
            ..PollRules::default()
        };
        let thresholds = VoteThresholds { inclusion_ms: 29.9, rejection_ms: 30.1, deviation_ms: 0.0 };
        Self { nodes: 4, watch: DelayRules { strikes: 1, ..DelayRules::default() }, polls, thresholds }
    }

    fn moves(&self, drift: Drift) -> Vec<(Duration, Motion)> {
        let mut run = Run::new(self);
        let mut random = Random::new(drift.seed);
        let pairs: Vec<_> = run.all().flat_map(|a| run.all().map(move |b| (a, b))).collect();
        for now in (0..3_600).step_by(5) {
            for &(a, b) in pairs.iter().filter(|(a, b)| a != b) {
                let drifts = a.max(b) == NodeId(self.nodes);
                let trip_ms = if drifts { drift.at(now, &mut random) } else { 1.0 };
                run.trip(Duration::from_secs(now), a, b, trip_ms);
            }
        }
        run.moves
    }
}

impl Drift {
    /// Returns the round trip at a time, milliseconds: about 30, midway between the thresholds.
    fn at(&self, now_s: u64, random: &mut Random) -> f64 {
        let phase = std::f64::consts::TAU * now_s as f64 / self.period_s;
        let noise_ms = self.noise_ms * (2.0 * random.unit() - 1.0);
        (30.0 + self.amplitude_ms * phase.sin() + noise_ms).max(0.5)
    }
}

/// The state of a run: nodes, their groups, their votes and the moves so far.
struct Run<'a> {
    hour: &'a Hour,
    polls: Polls,
    watches: BTreeMap<NodeId, DelayMonitor>,
    trips: BTreeMap<(NodeId, NodeId), VecDeque<f64>>,
    groups: Vec<Vec<NodeId>>,
    moves: Vec<(Duration, Motion)>,
}

impl<'a> Run<'a> {
    fn new(hour: &'a Hour) -> Self {
        let all: Vec<_> = (1..=hour.nodes).map(NodeId).collect();
        let mut polls = Polls::new(hour.polls);
        all.iter().for_each(|&node| polls.placed(Duration::ZERO, node));
        let watch = DelayMonitor::new(hour.thresholds, hour.watch);
        let watches = all.iter().map(|&node| (node, watch.clone())).collect();
        Self { hour, polls, watches, trips: BTreeMap::new(), groups: vec![all], moves: Vec::new() }
    }

    fn all(&self) -> impl Iterator<Item = NodeId> + use<> {
        (1..=self.hour.nodes).map(NodeId)
    }

    fn group_of(&self, node: NodeId) -> Vec<NodeId> {
        self.groups.iter().find(|group| group.contains(&node)).expect("everybody is in a group").clone()
    }

    /// Returns the average of the last 16 round trips.
    fn average_ms(&self, a: NodeId, b: NodeId) -> f64 {
        let trips = &self.trips[&(a, b)];
        trips.iter().sum::<f64>() / trips.len() as f64
    }

    /// Takes in a round trip from `a` to `b`, and carries out all that follows from it.
    fn trip(&mut self, now: Duration, a: NodeId, b: NodeId, trip_ms: f64) {
        let trips = self.trips.entry((a, b)).or_default();
        trips.push_back(trip_ms);
        if trips.len() > 16 {
            trips.pop_front();
        }
        let average_ms = self.average_ms(a, b);
        let (group, present) = (self.group_of(a), self.group_of(b));
        let watch = self.watches.get_mut(&a).expect("everybody watches");
        let Some(motion) = watch.observe(now, b, group == present, average_ms, trip_ms) else { return };
        let call = Call { caller: a, motion, group: &group, present: &present, changing: false };
        let Ok((poll, voters)) = self.polls.call(now, &call) else { return };
        let mut outcome = None;
        for voter in voters {
            let known = self.trips.contains_key(&(voter, b));
            let delay =
                if known { PeerDelay::AverageMs(self.average_ms(voter, b)) } else { PeerDelay::Unknown };
            outcome = self.polls.ballot(now, poll, voter, self.hour.thresholds.ballot(delay));
        }
        if outcome.expect("all have voted").passed {
            self.moves.push((now, motion));
            self.groups.iter_mut().for_each(|group| group.retain(|&node| node != b));
            match motion {
                Motion::Reject(_) => self.groups.push(vec![b]),
                Motion::Include(_) => {
                    let wanting = self.groups.iter_mut().find(|group| group.contains(&a));
                    wanting.expect("the caller is in a group").push(b);
                }
            }
            self.groups.retain(|group| !group.is_empty());
        }
    }
}

fn drifts() -> Vec<Drift> {
    let mut drifts = Vec::new();
    for period_s in [60.0, 200.0, 400.0, 600.0, 900.0, 1_800.0] {
        for amplitude_ms in [15.0, 28.0, 60.0] {
            for noise_ms in [0.0, 10.0, 30.0] {
                drifts.extend((0..3).map(|seed| Drift { period_s, amplitude_ms, noise_ms, seed }));
            }
        }
    }
    drifts
}

#[test]
fn a_delay_that_drifts_for_an_hour_moves_a_node_a_handful_of_times() {
    let mut most = 0;
    for drift in drifts() {
        let moves = Hour::careful().moves(drift);
        assert!(moves.len() <= 6, "{drift:?}: {moves:?}");
        most = most.max(moves.len());
        let slow = drift.period_s >= 400.0 && drift.amplitude_ms > 20.0;
        assert!(!slow || moves.len() >= 2, "{drift:?}: out and in again, not {moves:?}");
    }
    assert!(most >= 4, "no drift puts the rules to the test");
}

#[test]
fn without_the_rules_it_moves_far_more_often() {
    let moves = |hour: &Hour| drifts().into_iter().map(|drift| hour.moves(drift).len()).collect::<Vec<_>>();
    let (careful, careless) = (moves(&Hour::careful()), moves(&Hour::careless()));
    for (drift, moves) in drifts().into_iter().zip(&careless) {
        assert!(*moves > 6 || drift.period_s > 900.0, "{drift:?}: {moves}");
    }
    assert!(careless.iter().sum::<usize>() > 5 * careful.iter().sum::<usize>());
    // The bound comes from how long evicted nodes stay out.
    let polls = PollRules { return_after: Duration::ZERO, ..PollRules::default() };
    assert!(moves(&Hour { polls, ..Hour::careful() }).into_iter().any(|moves| moves > 20));
}

#[test]
fn the_node_that_lags_is_evicted_and_not_one_that_it_accuses() {
    for nodes in [3, 4, 6] {
        for drift in drifts() {
            let moves = Hour { nodes, ..Hour::careful() }.moves(drift);
            assert!(moves.len() <= 6, "{nodes} nodes, {drift:?}: {moves:?}");
            let lags = |motion: &Motion| motion.candidate().0 == nodes;
            assert!(moves.iter().all(|(_, motion)| lags(motion)), "{nodes} nodes, {drift:?}: {moves:?}");
        }
    }
}
