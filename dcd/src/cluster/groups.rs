//! Forms groups of nodes by network delay (thesis 3.3.7, 4.3.1.4): nodes share a group if each reaches every
//! other quickly, both ways. So a group is a clique of the graph of near pairs, and a node is in exactly one
//! group.
//!
//! The thesis sorts all subsets of the nodes. Here a search with a bound on its work finds the largest clique
//! of the nodes that are left, with the same result ([`form_groups`]). Besides measured delays the thesis
//! names other sources of what belongs together: the network (or exchange, or provider), the registered town,
//! groups that users declare. This module takes them all as keys of nodes ([`Hint`]).

mod clique;
mod leftovers;
mod near;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use bincode::{Decode, Encode};

use self::clique::Work;
use self::near::{Graph, Ranks};
use crate::space::NodeId;

/// The rules by which groups form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupRules {
    /// The delay below which a pair is near, both ways, milliseconds; `None`: a pair is near if each reaches
    /// the other.
    pub threshold_ms: Option<f64>,
    /// The largest number of nodes in a group, so that its leader is not overloaded (thesis 3.3.8).
    pub max_size: usize,
    /// The preferred sizes of groups.
    pub policy: GroupPolicy,
}

impl Default for GroupRules {
    /// Returns rules by which all nodes that reach each other share a group, up to the 32 nodes that the
    /// thesis tried (table 5.7).
    fn default() -> Self {
        Self { threshold_ms: None, max_size: 32, policy: GroupPolicy::Largest }
    }
}

/// The preferred sizes of groups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub enum GroupPolicy {
    /// Groups as large as possible, even if a node is left alone: the thesis's algorithm.
    #[default]
    Largest,
    /// Groups of 2^k nodes, since halving shares the world evenly among so many, and no node alone where that
    /// is possible. The thesis would prefer this (3.3.7). A group of another size is formed only where a node
    /// would else be alone.
    PowersOfTwo,
}

/// An error in the rules of groups: they cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GroupError {
    /// The largest size of a group is 0.
    #[error("groups of at most 0 nodes: let a group have at least 1")]
    NoSize,
    /// The threshold is not a positive number. It holds the given one, in milliseconds.
    #[error("a delay below {0} ms is no rule: give a positive number, or none at all")]
    Threshold(f64),
}

impl GroupRules {
    /// Returns the rules, if they can be followed.
    pub fn checked(self) -> Result<Self, GroupError> {
        match self.threshold_ms {
            _ if self.max_size == 0 => Err(GroupError::NoSize),
            Some(ms) if ms.is_nan() || ms <= 0.0 => Err(GroupError::Threshold(ms)),
            _ => Ok(self),
        }
    }

    /// Returns the size to look for.
    fn aim(&self) -> usize {
        self.cut(self.max_size)
    }

    /// Returns how many nodes of a clique of this size become a group.
    fn cut(&self, size: usize) -> usize {
        let size = size.min(self.max_size);
        match self.policy {
            GroupPolicy::Largest => size,
            GroupPolicy::PowersOfTwo => size.checked_ilog2().map_or(0, |log| 1 << log),
        }
    }

    fn is_near(&self, a: NodeId, b: NodeId, delay_ms: &impl Fn(NodeId, NodeId) -> Option<f64>) -> bool {
        let limit_ms = self.threshold_ms.unwrap_or(f64::INFINITY);
        let below = |from, to| delay_ms(from, to).is_some_and(|ms| ms < limit_ms);
        below(a, b) && below(b, a)
    }
}

/// A hint, from a source other than delays, about which nodes belong together: the network of each, its town,
/// its declared group. Nodes of one key belong together. Of a node without a key nothing is known. A hint
/// never makes a pair near that is not: users declare groups of friends in far countries, and one provider
/// serves a continent (thesis 3.3.10, 4.3.1.4).
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Hint {
    /// The key of each node, opaque.
    pub keys: BTreeMap<NodeId, u64>,
    /// The use of the hint.
    pub usage: HintUse,
}

/// The use of a [`Hint`]: to forbid shared groups, or to prefer them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum HintUse {
    /// Nodes of different keys never share a group, and need not even measure their delay.
    Prune,
    /// Among equally large groups, one whose nodes have one key is formed first.
    Seed,
}

impl Hint {
    /// Returns whether these hints let two nodes share a group. If not, nobody needs to measure their delay.
    #[doc(hidden)]
    pub fn allow(hints: &[Self], a: NodeId, b: NodeId) -> bool {
        let parts = |hint: &Self| hint.usage == HintUse::Prune && hint.same_key(a, b) == Some(false);
        !hints.iter().any(parts)
    }

    /// Returns whether two nodes have one key; `None` if either has none.
    fn same_key(&self, a: NodeId, b: NodeId) -> Option<bool> {
        Some(self.keys.get(&a)? == self.keys.get(&b)?)
    }
}

/// Forms groups of these nodes and returns them, largest first, equals by their lowest id. In each group the
/// ids ascend.
///
/// Repeatedly the largest clique of the nodes that are left becomes a group, cut to the size that the rules
/// allow. The nodes with the most other nodes near them are left out first. The clique is the largest unless
/// the search for it exceeds its share of a fixed amount of work. The same arguments always give the same
/// groups.
///
/// `delay_ms(a, b)` is the delay from `a` to `b`, `None` if it is unknown or `b` cannot be reached. It is
/// called at most once for every ordered pair, a million times for 1,000 nodes: let it look into an array.
///
/// # Panics
/// When the rules would not pass [`GroupRules::checked`].
pub fn form_groups(
    nodes: &[NodeId],
    delay_ms: impl Fn(NodeId, NodeId) -> Option<f64>,
    rules: &GroupRules,
    hints: &[Hint],
) -> Vec<Vec<NodeId>> {
    assert_eq!(rules.checked(), Ok(*rules), "rules are checked before they are followed");
    let graph = Graph::new(nodes, |a, b| Hint::allow(hints, a, b) && rules.is_near(a, b, &delay_ms));
    let seeds = seeds(&graph, hints);
    let mut work = Work::default();
    let mut left = graph.all();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    while !left.is_empty() {
        let first = clique::greedy(&graph, &left);
        let rounds = left.len().div_ceil(rules.cut(first.len()));
        let mut clique = work.share(rounds, |work| {
            // Cliques within seeds come first: nothing of the same size replaces them.
            let seeded = seeded(&graph, &left, &seeds, rules.aim(), work);
            let best = if seeded.len() >= first.len().min(rules.aim()) { seeded } else { first };
            clique::largest(&graph, &left, rules.aim(), best, work)
        });
        if clique.len() == 1 {
            groups.extend(left.iter().map(|rank| vec![rank]));
            break;
        }
        if clique.len() < rules.aim() {
            graph.complete(&mut clique, &left);
        }
        let size = rules.cut(clique.len());
        leave_out(&graph, &left, &mut clique, size);
        clique.iter().for_each(|&rank| left.remove(rank));
        groups.push(clique);
    }
    if rules.policy == GroupPolicy::PowersOfTwo {
        leftovers::give_company(&graph, &mut groups, rules.max_size);
    }
    named(&graph, groups)
}

/// Returns the nodes of each key of each hint, in the order of hints and keys.
fn seeds(graph: &Graph, hints: &[Hint]) -> Vec<Ranks> {
    let mut seeds = Vec::new();
    for hint in hints.iter().filter(|hint| hint.usage == HintUse::Seed) {
        let mut by_key: BTreeMap<u64, Ranks> = BTreeMap::new();
        for rank in graph.all().iter() {
            if let Some(&key) = hint.keys.get(&graph.node(rank)) {
                by_key.entry(key).or_insert_with(|| graph.none()).insert(rank);
            }
        }
        seeds.extend(by_key.into_values().filter(|seed| seed.len() > 1));
    }
    seeds
}

/// Returns the largest clique within any one seed, or the first that is large enough.
fn seeded(graph: &Graph, left: &Ranks, seeds: &[Ranks], enough: usize, work: &mut Work) -> Vec<usize> {
    let mut best = Vec::new();
    for seed in seeds {
        let among = seed.and(left);
        if best.len() < enough && best.len() < among.len() {
            let first = clique::greedy(graph, &among);
            best = if first.len() > best.len() { first } else { best };
            best = clique::largest(graph, &among, enough, best, work);
        }
    }
    best
}

/// Cuts a clique to a size. The nodes with the most others near them are left out, among equals those with
/// the highest ids.
fn leave_out(graph: &Graph, left: &Ranks, clique: &mut Vec<usize>, size: usize) {
    clique.sort_by_key(|&rank| (graph.near(rank).common(left), graph.node(rank)));
    clique.truncate(size);
}

fn named(graph: &Graph, groups: Vec<Vec<usize>>) -> Vec<Vec<NodeId>> {
    let mut groups: Vec<Vec<NodeId>> = groups
        .into_iter()
        .map(|group| {
            let mut group: Vec<_> = group.into_iter().map(|rank| graph.node(rank)).collect();
            group.sort_unstable();
            group
        })
        .collect();
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group[0]));
    groups
}

/// Returns the index in `groups` of the group that a newcomer is to join: one with room whose every member is
/// near. `None`: the newcomer stays alone. Among several groups these rules decide, in order:
///
/// 1. With [`GroupPolicy::PowersOfTwo`], a group that will have 2^k members.
/// 2. The largest group.
/// 3. The group with the most members of the newcomer's keys; earlier hints outrank later ones.
/// 4. The first group.
///
/// The newcomer never joins a group that it is in already, nor one without members.
///
/// # Panics
/// When the rules would not pass [`GroupRules::checked`].
pub fn best_group<G: AsRef<[NodeId]>>(
    newcomer: NodeId,
    groups: &[G],
    delay_ms: impl Fn(NodeId, NodeId) -> Option<f64>,
    rules: &GroupRules,
    hints: &[Hint],
) -> Option<usize> {
    assert_eq!(rules.checked(), Ok(*rules), "rules are checked before they are followed");
    let fits = |group: &[NodeId]| {
        let near = |&member: &NodeId| {
            member != newcomer
                && Hint::allow(hints, newcomer, member)
                && rules.is_near(newcomer, member, &delay_ms)
        };
        !group.is_empty() && group.len() < rules.max_size && group.iter().all(near)
    };
    let merit = |group: &[NodeId]| {
        let liked = rules.policy == GroupPolicy::PowersOfTwo && (group.len() + 1).is_power_of_two();
        let akin = |hint: &Hint| {
            group.iter().filter(|&&member| hint.same_key(newcomer, member) == Some(true)).count()
        };
        let akin: Vec<_> = hints.iter().filter(|hint| hint.usage == HintUse::Seed).map(akin).collect();
        (liked, group.len(), akin)
    };
    groups
        .iter()
        .map(AsRef::as_ref)
        .enumerate()
        .filter(|(_, group)| fits(group))
        .max_by_key(|&(index, group)| (merit(group), std::cmp::Reverse(index)))
        .map(|(index, _)| index)
}
