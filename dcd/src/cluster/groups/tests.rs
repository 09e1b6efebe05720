//! Tests that groups form, and newcomers join them, by rules and hints, and that the search keeps within its
//! bound on work.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;
use crate::sim::Random;

/// Returns delays from a matrix, in which row `i` is node `i`, counted from 1.
fn matrix<const N: usize>(delays: [[f64; N]; N]) -> impl Fn(NodeId, NodeId) -> Option<f64> {
    move |a, b| Some(delays[a.0 as usize - 1][b.0 as usize - 1])
}

/// Returns delays of 1 ms along these edges; all others are unknown.
fn edges(edges: &[(u32, u32)]) -> impl Fn(NodeId, NodeId) -> Option<f64> + use<> {
    let edges: BTreeSet<_> = edges.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
    move |a, b| edges.contains(&(a.0, b.0)).then_some(1.0)
}

fn ids(count: u32) -> Vec<NodeId> {
    (1..=count).map(NodeId).collect()
}

fn numbers(groups: Vec<Vec<NodeId>>) -> Vec<Vec<u32>> {
    groups.into_iter().map(|group| group.into_iter().map(|node| node.0).collect()).collect()
}

fn rules(policy: GroupPolicy, max_size: usize) -> GroupRules {
    GroupRules { threshold_ms: Some(5.0), max_size, policy }
}

const LARGEST: GroupPolicy = GroupPolicy::Largest;
const POWERS: GroupPolicy = GroupPolicy::PowersOfTwo;

/// The delays of the four nodes of thesis 3.3.7.
const FOUR: [[f64; 4]; 4] =
    [[0.0, 3.0, 4.0, 10.0], [2.0, 0.0, 1.0, 6.0], [4.0, 3.0, 0.0, 2.0], [7.0, 4.0, 1.0, 0.0]];

fn formed(count: u32, near: &[(u32, u32)], policy: GroupPolicy, max_size: usize) -> Vec<Vec<u32>> {
    numbers(form_groups(&ids(count), edges(near), &rules(policy, max_size), &[]))
}

fn all_pairs(count: u32) -> Vec<(u32, u32)> {
    (1..=count).flat_map(|a| (a + 1..=count).map(move |b| (a, b))).collect()
}

fn hint(usage: HintUse, keys: &[(u32, u64)]) -> Hint {
    Hint { keys: keys.iter().map(|&(node, key)| (NodeId(node), key)).collect(), usage }
}

#[test]
fn four_nodes_of_the_thesis_are_three_and_one() {
    let groups = form_groups(&ids(4), matrix(FOUR), &rules(LARGEST, 32), &[]);
    assert_eq!(numbers(groups), [vec![1, 2, 3], vec![4]]);
}

#[test]
fn by_powers_of_two_they_are_two_and_two() {
    let groups = form_groups(&ids(4), matrix(FOUR), &rules(POWERS, 32), &[]);
    assert_eq!(numbers(groups), [vec![1, 2], vec![3, 4]]);
}

#[test]
fn five_nodes_of_the_thesis_group_by_the_lists_they_give() {
    // Thesis 4.3.1.4, A to E as 1 to 5: the candidates that each names.
    let lists: [&[u32]; 5] = [&[2, 3, 4], &[1, 3, 5], &[1, 4], &[1, 3, 5], &[4]];
    let delay = |a: NodeId, b: NodeId| lists[a.0 as usize - 1].contains(&b.0).then_some(1.0);
    let groups = form_groups(&ids(5), delay, &rules(LARGEST, 32), &[]);
    assert_eq!(numbers(groups), [vec![1, 3, 4], vec![2], vec![5]]);
}

#[test]
fn a_pair_is_near_only_if_both_ways_are_below_the_threshold() {
    let groups = |there, back| {
        let delay = |a: NodeId, _: NodeId| if a.0 == 1 { there } else { back };
        form_groups(&ids(2), delay, &rules(LARGEST, 32), &[]).len()
    };
    assert_eq!(groups(Some(4.9), Some(4.9)), 1);
    assert_eq!(groups(Some(4.9), Some(5.0)), 2);
    assert_eq!(groups(Some(5.0), Some(4.9)), 2);
    assert_eq!(groups(None, Some(1.0)), 2);
    assert_eq!(groups(Some(f64::NAN), Some(1.0)), 2);
}

#[test]
fn without_a_threshold_all_that_reach_each_other_are_near() {
    let rules = GroupRules::default();
    let delay = |a: NodeId, b: NodeId| (a.0 + b.0 != 4 || a == b).then_some(9e9);
    assert_eq!(numbers(form_groups(&ids(3), delay, &rules, &[])), [vec![1, 2], vec![3]]);
}

#[test]
fn a_group_is_no_larger_than_its_limit_and_leaves_out_who_has_others_to_go_to() {
    let mut near = all_pairs(4);
    near.push((1, 5));
    assert_eq!(formed(5, &near, LARGEST, 3), [vec![2, 3, 4], vec![1, 5]]);
}

#[test]
fn cliques_of_any_size_are_cut_into_powers_of_two_with_nobody_alone() {
    let sizes =
        |count| -> Vec<usize> { formed(count, &all_pairs(count), POWERS, 32).iter().map(Vec::len).collect() };
    assert_eq!(sizes(1), [1]);
    assert_eq!(sizes(3), [3]);
    assert_eq!(sizes(4), [4]);
    assert_eq!(sizes(5), [5]);
    assert_eq!(sizes(6), [4, 2]);
    assert_eq!(sizes(7), [4, 3]);
    assert_eq!(sizes(44), [32, 8, 4]);
}

#[test]
fn a_node_alone_takes_one_of_a_larger_group_rather_than_stay_so() {
    // Nodes 1 to 4 are a clique. Node 5 is near 4, 6 and 7; these two are near nobody else, so one of them
    // stays alone.
    let mut near = all_pairs(4);
    near.extend([(4, 5), (5, 6), (5, 7)]);
    assert_eq!(formed(7, &near, POWERS, 32), [vec![1, 2, 3, 4], vec![5, 6], vec![7]]);
    // A pair in the middle of a path parts, so that both ends have company.
    assert_eq!(formed(4, &[(1, 2), (2, 3), (3, 4)], POWERS, 32), [vec![1, 2], vec![3, 4]]);
    // Not both three and two are powers of two, but nobody is alone.
    let mut near = all_pairs(4);
    near.push((4, 5));
    assert_eq!(formed(5, &near, POWERS, 32), [vec![1, 2, 3], vec![4, 5]]);
}

#[test]
fn hints_that_prune_part_nodes_of_different_keys_only() {
    let pruned = [hint(HintUse::Prune, &[(1, 7), (2, 7), (3, 8)])];
    assert!(Hint::allow(&pruned, NodeId(1), NodeId(2)));
    assert!(!Hint::allow(&pruned, NodeId(1), NodeId(3)));
    assert!(Hint::allow(&pruned, NodeId(3), NodeId(4)), "nothing is known of 4");
    let groups = form_groups(&ids(4), edges(&all_pairs(4)), &rules(LARGEST, 32), &pruned);
    assert_eq!(numbers(groups), [vec![1, 2, 4], vec![3]]);
}

#[test]
fn of_equally_large_groups_that_of_one_key_is_formed_first() {
    let all = edges(&all_pairs(6));
    let form = |hints: &[Hint]| numbers(form_groups(&ids(6), &all, &rules(LARGEST, 3), hints));
    assert_eq!(form(&[]), [vec![1, 2, 3], vec![4, 5, 6]]);
    let odd = hint(HintUse::Seed, &[(1, 1), (3, 1), (5, 1)]);
    assert_eq!(form(std::slice::from_ref(&odd)), [vec![1, 3, 5], vec![2, 4, 6]]);
    let declared = hint(HintUse::Seed, &[(1, 4), (2, 4), (6, 4)]);
    assert_eq!(form(&[declared, odd]), [vec![1, 2, 6], vec![3, 4, 5]], "earlier hints outrank later ones");
}

#[test]
fn a_seed_is_no_reason_for_a_smaller_group_or_a_distant_pair() {
    let near = [(1, 2), (2, 3), (1, 3), (3, 4)];
    let hints = [hint(HintUse::Seed, &[(3, 1), (4, 1), (5, 1)])];
    let groups = form_groups(&ids(5), edges(&near), &rules(LARGEST, 32), &hints);
    assert_eq!(numbers(groups), [vec![1, 2, 3], vec![4], vec![5]]);
}

#[test]
fn a_newcomer_joins_the_largest_group_with_room_that_is_all_near() {
    let groups = [ids(1), vec![NodeId(2), NodeId(3)], vec![NodeId(4), NodeId(5), NodeId(6)]];
    let best = |near: &[(u32, u32)], policy, max_size, hints: &[Hint]| {
        best_group(NodeId(9), &groups, edges(near), &rules(policy, max_size), hints)
    };
    let all: Vec<_> = (1..9).map(|node| (node, 9)).collect();
    assert_eq!(best(&all, LARGEST, 32, &[]), Some(2));
    assert_eq!(best(&all, LARGEST, 3, &[]), Some(1), "no room among three");
    assert_eq!(best(&all[..5], LARGEST, 32, &[]), Some(1), "6 is far");
    assert_eq!(best(&all[1..2], LARGEST, 32, &[]), None);
    assert_eq!(best(&all, LARGEST, 32, &[hint(HintUse::Prune, &[(9, 1), (4, 2)])]), Some(1));
    assert_eq!(best(&all[..5], POWERS, 32, &[]), Some(0), "two are better than three");
    assert_eq!(best(&all, POWERS, 32, &[]), Some(2), "four are better than two");
}

#[test]
fn of_equal_groups_a_newcomer_joins_its_like_else_the_first() {
    let groups = [vec![NodeId(1)], vec![NodeId(2)], vec![]];
    let near = [(1, 3), (2, 3)];
    let best = |hints: &[Hint]| best_group(NodeId(3), &groups, edges(&near), &rules(LARGEST, 32), hints);
    assert_eq!(best(&[]), Some(0));
    assert_eq!(best(&[hint(HintUse::Seed, &[(2, 5), (3, 5)])]), Some(1));
}

#[test]
fn nobody_joins_a_group_of_nobody_or_its_own() {
    let best =
        |groups: &[Vec<NodeId>]| best_group(NodeId(3), groups, |_, _| Some(1.0), &rules(LARGEST, 32), &[]);
    assert_eq!(best(&[vec![]]), None);
    assert_eq!(best(&[vec![NodeId(2), NodeId(3)]]), None);
}

#[test]
fn rules_that_cannot_be_are_refused() {
    assert_eq!(rules(LARGEST, 0).checked(), Err(GroupError::NoSize));
    for ms in [0.0, -1.0] {
        let bad = GroupRules { threshold_ms: Some(ms), ..GroupRules::default() };
        assert_eq!(bad.checked(), Err(GroupError::Threshold(ms)));
    }
    let bad = GroupRules { threshold_ms: Some(f64::NAN), ..GroupRules::default() };
    assert!(bad.checked().is_err());
    assert!(GroupRules::default().checked().is_ok());
}

/// A random graph of near pairs.
#[derive(Clone, Debug)]
struct Near(Vec<Vec<bool>>);

impl Near {
    fn random(count: usize, seed: u64, density: f64) -> Self {
        let mut random = Random::new(seed);
        let mut near = vec![vec![false; count]; count];
        for (a, b) in (0..count).flat_map(|a| (0..a).map(move |b| (a, b))) {
            near[a][b] = random.unit() < density;
            near[b][a] = near[a][b];
        }
        Self(near)
    }

    fn form(&self, rules: &GroupRules) -> Vec<Vec<NodeId>> {
        let nodes: Vec<_> = (0..self.0.len() as u32).map(NodeId).collect();
        let delay = |a: NodeId, b: NodeId| self.0[a.0 as usize][b.0 as usize].then_some(1.0);
        let groups = form_groups(&nodes, delay, rules, &[]);
        let mut seen: Vec<_> = groups.iter().flatten().copied().collect();
        seen.sort_unstable();
        assert_eq!(seen, nodes, "each node in exactly one group");
        for group in &groups {
            assert!(group.len() <= rules.max_size && group.is_sorted());
            let far = |a: &NodeId, b: &NodeId| a < b && !self.0[a.0 as usize][b.0 as usize];
            assert!(!group.iter().any(|a| group.iter().any(|b| far(a, b))), "{group:?} is no clique");
        }
        assert!(groups.is_sorted_by_key(|group| (std::cmp::Reverse(group.len()), group[0])));
        let reversed: Vec<_> = nodes.iter().rev().chain(&nodes).copied().collect();
        assert_eq!(form_groups(&reversed, delay, rules, &[]), groups, "order and repetition change nothing");
        groups
    }

    /// Returns, for each set of nodes as bits, whether it is a clique.
    fn cliques(&self) -> Vec<bool> {
        let count = self.0.len();
        let near = |a: usize| (0..count).filter(|&b| self.0[a][b]).fold(0, |bits, b| bits | 1 << b);
        let near: Vec<usize> = (0..count).map(near).collect();
        let mut cliques = vec![true; 1 << count];
        for set in 1..1_usize << count {
            let rest = set & (set - 1);
            cliques[set] = cliques[rest] && rest & !near[set.trailing_zeros() as usize] == 0;
        }
        cliques
    }

    /// Returns the least number of lone nodes over all divisions into cliques up to a size.
    fn least_alone(&self, max_size: usize) -> usize {
        let cliques = self.cliques();
        let mut least = vec![0; cliques.len()];
        for set in 1..cliques.len() {
            let first = 1 << set.trailing_zeros();
            let mut others = set ^ first;
            least[set] = least[others] + 1;
            while others != 0 {
                let group = others | first;
                if cliques[group] && group.count_ones() as usize <= max_size {
                    least[set] = least[set].min(least[set ^ group]);
                }
                others = (others - 1) & (set ^ first);
            }
        }
        least[cliques.len() - 1]
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn each_group_is_as_large_as_any_that_the_others_left_over_could_form(
        count in 1_usize..=10, seed: u64, density in 0.0..1.0, max_size in 1_usize..=10,
    ) {
        let near = Near::random(count, seed, density);
        let cliques = near.cliques();
        let mut left = (1_usize << count) - 1;
        for group in near.form(&rules(LARGEST, max_size)) {
            let possible = (0..cliques.len()).filter(|&set| cliques[set] && set & !left == 0);
            let largest = possible.map(|set| set.count_ones() as usize).max().unwrap();
            prop_assert_eq!(group.len(), largest.min(max_size));
            group.iter().for_each(|node| left ^= 1 << node.0);
        }
    }

    #[test]
    fn powers_of_two_leave_as_few_alone_as_any_division(
        count in 1_usize..=10, seed: u64, density in 0.0..1.0, max_size in 1_usize..=10,
    ) {
        let near = Near::random(count, seed, density);
        let groups = near.form(&rules(POWERS, max_size));
        let alone = groups.iter().filter(|group| group.len() == 1).count();
        prop_assert_eq!(alone, near.least_alone(max_size));
    }

    #[test]
    fn nobody_fits_into_a_group_with_room_that_is_as_large_as_their_own(
        count in 1_usize..80, seed: u64, density in 0.0..1.0, max_size in 1_usize..20,
    ) {
        let near = Near::random(count, seed, density);
        let groups = near.form(&rules(LARGEST, max_size));
        for (at, group) in groups.iter().enumerate().filter(|(_, group)| group.len() < max_size) {
            for node in groups[at + 1..].iter().flatten() {
                let fits = group.iter().all(|one| near.0[node.0 as usize][one.0 as usize]);
                prop_assert!(!fits, "{node} could be in {group:?}");
            }
        }
    }
}

#[test]
fn hostile_graphs_are_grouped_within_the_bound_on_work() {
    // Moon and Moser 1965: of 3n nodes in n triples, where all are near except those of a triple, 3^n cliques
    // are the largest.
    let triples = Near((0..90).map(|a| (0..90).map(|b| a / 3 != b / 3).collect()).collect());
    let sizes: Vec<_> = triples.form(&rules(LARGEST, 100)).iter().map(Vec::len).collect();
    assert_eq!(sizes, [30, 30, 30]);
    // The complement of rings of five is hard for bounds by colours: three colours each, and a clique takes
    // two.
    let ring = |a: usize, b: usize| a / 5 == b / 5 && [1, 4].contains(&((a + 5 - b) % 5));
    let rings = Near((0..100).map(|a| (0..100).map(|b| a != b && !ring(a, b)).collect()).collect());
    let largest = rings.form(&rules(LARGEST, 100)).iter().map(Vec::len).max();
    assert_eq!(largest, Some(40));
    for density in [0.5, 0.9, 0.99] {
        Near::random(300, 11, density).form(&rules(LARGEST, 300));
        Near::random(300, 11, density).form(&rules(POWERS, 300));
    }
}
