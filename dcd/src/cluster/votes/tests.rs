//! Tests that ballots, motions and polls follow the rules of votes (thesis 4.3.1.5).

use std::time::Duration;

use super::*;

pub(super) const THRESHOLDS: VoteThresholds =
    VoteThresholds { inclusion_ms: 20.0, rejection_ms: 40.0, deviation_ms: 30.0 };

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn nodes<const N: usize>(numbers: [u32; N]) -> [NodeId; N] {
    numbers.map(NodeId)
}

#[test]
fn ballots_follow_the_delay_that_a_member_perceives() {
    let ballot = |delay| THRESHOLDS.ballot(delay);
    let average = |ms| ballot(PeerDelay::AverageMs(ms));
    assert_eq!([19.9, 20.0, 30.0, 40.0, 40.1].map(average), {
        use Ballot::{Abstain, Include, Reject};
        [Include, Abstain, Abstain, Abstain, Reject]
    });
    assert_eq!(ballot(PeerDelay::Unknown), Ballot::Abstain);
    assert_eq!(ballot(PeerDelay::Unreachable), Ballot::Reject);
    assert_eq!(average(f64::NAN), Ballot::Abstain);
}

#[test]
fn motions_pass_by_the_rules_of_the_thesis() {
    let tally = |include, abstain, reject| Tally { include, abstain, reject };
    let include = |i, a, r| Motion::Include(NodeId(1)).passes(tally(i, a, r));
    assert!(include(1, 0, 0) && include(1, 9, 0));
    assert!(!include(0, 3, 0), "somebody must want it");
    assert!(!include(9, 0, 1), "one is enough against it");
    // I + 0.5A − 2R < 0.
    let reject = |i, a, r| Motion::Reject(NodeId(1)).passes(tally(i, a, r));
    assert!(reject(1, 0, 1) && reject(0, 3, 1) && reject(1, 1, 1) && reject(3, 0, 2));
    assert!(!reject(2, 0, 1) && !reject(0, 4, 1) && !reject(1, 2, 1) && !reject(0, 0, 0));
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let thresholds = |inclusion_ms, rejection_ms, deviation_ms| {
        VoteThresholds { inclusion_ms, rejection_ms, deviation_ms }.checked().is_ok()
    };
    assert!(thresholds(20.0, 40.0, 0.0));
    for [inclusion_ms, rejection_ms, deviation_ms] in [
        [40.0, 40.0, 1.0],
        [0.0, 40.0, 1.0],
        [20.0, f64::INFINITY, 1.0],
        [f64::NAN, 40.0, 1.0],
        [20.0, 40.0, -1.0],
        [20.0, 40.0, f64::NAN],
    ] {
        assert!(!thresholds(inclusion_ms, rejection_ms, deviation_ms));
    }
    assert!(DelayRules { strikes: 0, ..DelayRules::default() }.checked().is_err());
    assert!(PollRules { max_votes: 0, ..PollRules::default() }.checked().is_err());
    assert!(PollRules { window: Duration::ZERO, ..PollRules::default() }.checked().is_err());
}

/// The groups: 1, 2 and 3; 4 and 5; 6 alone.
const GROUPS: [&[u32]; 3] = [&[1, 2, 3], &[4, 5], &[6]];

fn group_of(node: NodeId) -> Vec<NodeId> {
    let group = GROUPS.iter().find(|group| group.contains(&node.0)).expect("one of six");
    group.iter().copied().map(NodeId).collect()
}

fn call(polls: &mut Polls, now: u64, caller: u32, motion: Motion) -> Result<(u64, Vec<NodeId>), VoteRefusal> {
    let (group, present) = (group_of(NodeId(caller)), group_of(motion.candidate()));
    let call = Call { caller: NodeId(caller), motion, group: &group, present: &present, changing: false };
    polls.call(at(now), &call)
}

/// Calls for a rejection as the first member, whose call needs a second.
fn first(polls: &mut Polls, now: u64, caller: u32, motion: Motion) {
    assert_eq!(call(polls, now, caller, motion), Err(VoteRefusal::Unseconded));
}

const fn include(node: u32) -> Motion {
    Motion::Include(NodeId(node))
}

const fn reject(node: u32) -> Motion {
    Motion::Reject(NodeId(node))
}

fn polls() -> Polls {
    Polls::new(PollRules::default())
}

#[test]
fn the_group_votes_and_the_candidate_does_not() {
    let mut polls = polls();
    first(&mut polls, 0, 3, reject(2));
    assert_eq!(call(&mut polls, 0, 1, reject(2)), Ok((1, nodes([1, 3]).to_vec())));
    assert_eq!(polls.ballot(at(1), 1, NodeId(2), Ballot::Include), None, "the candidate");
    assert_eq!(polls.ballot(at(1), 1, NodeId(4), Ballot::Include), None, "a stranger");
    assert_eq!(polls.ballot(at(1), 9, NodeId(1), Ballot::Include), None, "no such vote");
    assert_eq!(polls.ballot(at(1), 1, NodeId(1), Ballot::Reject), None);
    assert_eq!(polls.ballot(at(1), 1, NodeId(1), Ballot::Include), None, "once is enough");
    let outcome = Outcome {
        poll: 1,
        motion: reject(2),
        group: nodes([1, 2, 3]).to_vec(),
        tally: Tally { include: 1, abstain: 0, reject: 1 },
        passed: true,
    };
    assert_eq!(polls.ballot(at(1), 1, NodeId(3), Ballot::Include), Some(outcome));
    assert_eq!(polls.poll_timeout(), None);
    assert_eq!(call(&mut polls, 1, 4, include(6)), Ok((2, nodes([4, 5]).to_vec())));
}

#[test]
fn who_has_not_voted_by_the_deadline_abstains() {
    let mut polls = polls();
    call(&mut polls, 10, 1, include(6)).unwrap();
    polls.ballot(at(11), 1, NodeId(1), Ballot::Include);
    assert_eq!(polls.poll_timeout(), Some(at(12)));
    assert_eq!(polls.handle_timeout(Duration::from_millis(11_999)), []);
    assert_eq!(polls.ballot(at(13), 1, NodeId(2), Ballot::Reject), None, "too late");
    let outcomes = polls.handle_timeout(at(13));
    assert_eq!(outcomes.len(), 1);
    assert_eq!(outcomes[0].tally, Tally { include: 1, abstain: 2, reject: 0 });
    assert!(outcomes[0].passed);
    assert_eq!(polls.handle_timeout(at(14)), []);
}

#[test]
fn motions_that_make_no_sense_are_refused() {
    let refused = |caller, motion| call(&mut polls(), 0, caller, motion).unwrap_err();
    assert_eq!(refused(1, reject(4)), VoteRefusal::Mistaken);
    assert_eq!(refused(1, reject(1)), VoteRefusal::Mistaken);
    assert_eq!(refused(1, include(2)), VoteRefusal::Mistaken);
    assert_eq!(refused(4, include(1)), VoteRefusal::Smaller);
    let (one, others) = (nodes([1]), nodes([2, 3]));
    let strange =
        Call { caller: NodeId(9), motion: reject(3), group: &others, present: &others, changing: false };
    assert_eq!(polls().call(at(0), &strange), Err(VoteRefusal::Mistaken));
    let strange = Call { caller: NodeId(1), motion: include(9), group: &one, present: &one, changing: false };
    assert_eq!(polls().call(at(0), &strange), Err(VoteRefusal::Mistaken));
}

#[test]
fn a_node_comes_from_a_group_no_larger_into_one_with_room() {
    let (small, large) = (nodes([1, 2]), nodes([3, 4, 5]));
    let wanted = |group: &[NodeId], present: &[NodeId], max_size| {
        let motion = Motion::Include(present[0]);
        let call = Call { caller: group[0], motion, group, present, changing: false };
        Polls::new(PollRules { max_size, ..PollRules::default() }).call(at(0), &call).err()
    };
    assert_eq!(wanted(&large, &small, 32), None);
    assert_eq!(wanted(&small, &nodes([7, 8]), 32), None, "as large is no larger");
    assert_eq!(wanted(&small, &large, 32), Some(VoteRefusal::Smaller));
    assert_eq!(wanted(&large, &small, 3), Some(VoteRefusal::Full));
}

#[test]
fn one_vote_at_a_time_concerns_a_node() {
    let mut polls = polls();
    call(&mut polls, 0, 1, include(6)).unwrap();
    assert_eq!(call(&mut polls, 0, 4, include(6)), Err(VoteRefusal::Voting), "on the same node");
    first(&mut polls, 0, 1, reject(3));
    assert_eq!(call(&mut polls, 0, 2, reject(3)), Err(VoteRefusal::Voting), "by the same group");
    assert!(call(&mut polls, 0, 4, reject(5)).is_ok());
    polls.handle_timeout(at(2));
    assert!(call(&mut polls, 2, 2, reject(3)).is_ok());
}

#[test]
fn no_vote_is_held_while_a_group_concerned_changes() {
    let mut polls = polls();
    let group = group_of(NodeId(1));
    first(&mut polls, 0, 3, reject(2));
    let changing =
        Call { caller: NodeId(1), motion: reject(2), group: &group, present: &group, changing: true };
    assert_eq!(polls.call(at(0), &changing), Err(VoteRefusal::Changing));
    // A vote that is under way is void.
    call(&mut polls, 0, 1, include(6)).unwrap();
    call(&mut polls, 0, 4, reject(5)).unwrap();
    polls.group_changes(&nodes([6]));
    assert_eq!(polls.handle_timeout(at(9)).iter().map(|outcome| outcome.poll).collect::<Vec<_>>(), [2]);
    assert_eq!(polls.ballot(at(0), 1, NodeId(1), Ballot::Include), None);
}

#[test]
fn a_vote_that_concerns_a_node_that_is_gone_is_void() {
    let mut polls = polls();
    call(&mut polls, 0, 1, include(6)).unwrap();
    polls.forget(NodeId(2));
    assert_eq!(polls.handle_timeout(at(9)), []);
}

#[test]
fn who_comes_back_is_not_held_to_what_it_was_evicted_for() {
    let none = Duration::ZERO;
    let rules = PollRules { rest: none, min_stay: none, return_after: none, ..PollRules::default() };
    let mut polls = Polls::new(rules);
    moved(&mut polls, 0, reject(3));
    moved(&mut polls, 2, include(3));
    first(&mut polls, 3, 1, reject(3));
}

#[test]
fn caller_and_candidate_rest_after_a_vote() {
    let mut polls = polls();
    call(&mut polls, 0, 1, include(6)).unwrap();
    polls.handle_timeout(at(2));
    first(&mut polls, 2, 3, reject(2));
    first(&mut polls, 2, 1, reject(3));
    assert_eq!(call(&mut polls, 29, 1, reject(2)), Err(VoteRefusal::Resting), "the caller");
    assert_eq!(call(&mut polls, 29, 4, include(6)), Err(VoteRefusal::Resting), "the candidate");
    assert!(call(&mut polls, 29, 2, reject(3)).is_ok(), "others need not");
    assert!(call(&mut polls, 30, 4, include(6)).is_ok());
}

#[test]
fn a_rejection_is_heard_when_two_of_three_call_for_it_in_time() {
    let mut polls = polls();
    first(&mut polls, 0, 1, reject(2));
    first(&mut polls, 10, 1, reject(2));
    first(&mut polls, 20, 2, reject(1));
    first(&mut polls, 310, 3, reject(2));
    assert!(call(&mut polls, 310, 1, reject(2)).is_ok());
    // In a group of two there is only one member beside the candidate.
    assert!(call(&mut polls, 310, 4, reject(5)).is_ok());
}

#[test]
fn votes_in_a_time_are_capped() {
    let mut polls = Polls::new(PollRules { max_votes: 2, ..PollRules::default() });
    first(&mut polls, 0, 3, reject(2));
    call(&mut polls, 0, 1, reject(2)).unwrap();
    call(&mut polls, 10, 4, reject(5)).unwrap();
    first(&mut polls, 50, 2, reject(1));
    polls.handle_timeout(at(50));
    assert_eq!(call(&mut polls, 59, 3, reject(1)), Err(VoteRefusal::TooMany));
    assert!(call(&mut polls, 60, 3, reject(1)).is_ok());
}

#[test]
fn a_node_stays_for_a_while_wherever_it_comes() {
    let mut polls = polls();
    polls.placed(at(100), NodeId(2));
    polls.placed(at(100), NodeId(6));
    first(&mut polls, 159, 3, reject(2));
    assert_eq!(call(&mut polls, 159, 1, reject(2)), Err(VoteRefusal::Staying));
    assert_eq!(call(&mut polls, 159, 4, include(6)), Err(VoteRefusal::Staying));
    let (alone, other) = (nodes([6]), nodes([7]));
    let wanting =
        Call { caller: NodeId(6), motion: include(7), group: &alone, present: &other, changing: false };
    // A node that is alone joins as much as it is joined.
    assert_eq!(polls.call(at(159), &wanting), Err(VoteRefusal::Staying));
    assert!(call(&mut polls, 160, 1, reject(2)).is_ok());
    polls.forget(NodeId(6));
    assert!(call(&mut polls, 159, 4, include(6)).is_ok(), "another with its number");
}

/// Votes a node out, or in, at the first second from `from` at which that is allowed. Returns that second.
fn moved(polls: &mut Polls, from: u64, motion: Motion) -> u64 {
    let candidate = motion.candidate();
    let rest = if candidate.0 == 3 { nodes([1, 2, 4]) } else { nodes([1, 2, 3]) };
    let all = [rest.as_slice(), &[candidate]].concat();
    let (group, present): (Vec<NodeId>, Vec<NodeId>) = match motion {
        Motion::Include(_) => (rest.to_vec(), vec![candidate]),
        Motion::Reject(_) => (all.clone(), all),
    };
    for now in from.. {
        let caller = rest[now as usize % 3];
        let call = Call { caller, motion, group: &group, present: &present, changing: false };
        let Ok((poll, voters)) = polls.call(at(now), &call) else { continue };
        let ballot = if let Motion::Include(_) = motion { Ballot::Include } else { Ballot::Reject };
        let outcome = voters.iter().find_map(|&voter| polls.ballot(at(now), poll, voter, ballot));
        assert!(outcome.expect("all have voted").passed);
        return now;
    }
    unreachable!()
}

#[test]
fn every_eviction_keeps_a_node_out_for_three_times_as_long_until_forgiven() {
    let mut polls = polls();
    polls.placed(at(0), NodeId(9));
    let mut now = 0;
    let mut moves = Vec::new();
    for _ in 0..4 {
        for motion in [reject(9), include(9)] {
            let then = moved(&mut polls, now, motion);
            moves.push(then - now);
            now = then;
        }
    }
    assert_eq!(moves, [60, 300, 60, 900, 60, 2_700, 60, 3_600]);
    // Evicted for the last time an hour ago.
    assert_eq!(moved(&mut polls, now, reject(9)), now + 60);
    assert_eq!(moved(&mut polls, now + 60, include(9)), now + 60 + 300);
}
