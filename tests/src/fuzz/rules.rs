//! Forms groups from delays, and holds votes with calls and ballots, that no network and no honest node would
//! produce.

use std::time::Duration;

use dcd::NodeId;
use dcd::cluster::{Ballot, Call, GroupPolicy, GroupRules, PollRules, Polls, best_group, form_groups};
use dcd::protocol::Motion;

/// The bound of the number of nodes: `form_groups` searches for cliques, within a limit that its own tests
/// check.
const NODES: u32 = 12;

/// Forms groups by the first bytes, and holds votes by all of them.
pub(super) fn rules(bytes: &[u8]) {
    groups(bytes);
    votes(bytes);
}

/// Checks that every node is in exactly one group and that no group is too large.
fn groups(bytes: &[u8]) {
    let Some((&[count, size, policy], delays)) = bytes.split_first_chunk::<3>() else { return };
    let nodes: Vec<_> = (1..=u32::from(count) % NODES).map(NodeId).collect();
    let delay_ms = |from: NodeId, to: NodeId| {
        let byte = *delays.get((from.0 * NODES + to.0) as usize % delays.len().max(1))?;
        match byte {
            0 => None,
            1 => Some(f64::NAN),
            2 => Some(f64::INFINITY),
            _ => Some(f64::from(byte)),
        }
    };
    let policy = if policy % 2 == 0 { GroupPolicy::Largest } else { GroupPolicy::PowersOfTwo };
    let max_size = usize::from(size) % 8 + 1;
    let rules = GroupRules { threshold_ms: (size > 8).then_some(100.0), max_size, policy };
    let formed = form_groups(&nodes, delay_ms, &rules, &[]);
    assert!(formed.iter().all(|group| (1..=max_size).contains(&group.len())), "{formed:?}");
    let mut all: Vec<_> = formed.concat();
    all.sort_unstable();
    assert_eq!(all, nodes, "each is in one group");
    let best = best_group(NodeId(NODES + 1), &formed, delay_ms, &rules, &[]);
    assert!(best.is_none_or(|index| formed[index].len() < max_size), "there is room");
}

/// Checks that each vote ends once and that no candidate is among its voters.
fn votes(bytes: &[u8]) {
    let (mut polls, mut now) = (Polls::new(PollRules::default()), Duration::ZERO);
    let mut over = Vec::new();
    for part in bytes.chunks_exact(4) {
        let &[what, a, b, ms] = part else { continue };
        now += Duration::from_millis(u64::from(ms) << (what >> 5));
        let node = |byte: u8| NodeId(u32::from(byte % 8));
        let group: Vec<_> = (0..8).filter(|node| a >> node & 1 == 1).map(NodeId).collect();
        let present: Vec<_> = (0..8).filter(|node| b >> node & 1 == 1).map(NodeId).collect();
        match what % 8 {
            0 => polls.placed(now, node(a)),
            1 => polls.group_changes(&[node(a)]),
            2 => polls.forget(node(a)),
            3 => over.extend(polls.handle_timeout(now).into_iter().map(|outcome| outcome.poll)),
            4 | 5 => {
                let ballot = [Ballot::Include, Ballot::Abstain, Ballot::Reject][usize::from(b >> 6) % 3];
                over.extend(polls.ballot(now, (b % 32).into(), node(a), ballot).map(|outcome| outcome.poll));
            }
            kind => {
                let motion = if kind == 6 { Motion::Include(node(ms)) } else { Motion::Reject(node(ms)) };
                let caller = node(what >> 3);
                let call = Call { caller, motion, group: &group, present: &present, changing: false };
                if let Ok((_, voters)) = polls.call(now, &call) {
                    assert!(!voters.contains(&motion.candidate()), "nobody votes on itself");
                }
            }
        }
    }
    let count = over.len();
    over.sort_unstable();
    over.dedup();
    assert_eq!(over.len(), count, "each vote ends once");
}
