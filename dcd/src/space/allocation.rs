//! Allocates regions to nodes: deals sub-trees of the distribution tree to nodes by load (thesis 3.2,
//! 4.3.1.3).

use std::collections::BTreeMap;

use super::{DistributionTree, NodeId, RegionId};

/// The node of each region, in region order.
pub type Allocation = BTreeMap<RegionId, NodeId>;

/// Deals the leaves of the tree to the nodes, so that each node has whole sub-trees and about an equal part
/// of the load.
///
/// `load_of` returns the load of a leaf, in any unit. The lowest node leads the group, and has the smallest
/// share: the thesis measured leaders 10 to 46 % slower than their members (table 5.6). If there are more
/// nodes than leaves, the lowest nodes stay idle.
///
/// # Panics
/// When `nodes` is empty: a world without a node has no allocation.
pub fn allocate(tree: &DistributionTree, nodes: &[NodeId], load_of: impl Fn(RegionId) -> f64) -> Allocation {
    assert!(!nodes.is_empty(), "an allocation needs at least one node");
    let mut nodes = nodes.to_vec();
    nodes.sort_unstable();
    let leader = nodes[0];
    nodes.drain(..nodes.len().saturating_sub(tree.leaf_count()));
    let mut allocation = Allocation::new();
    deal(tree, RegionId(0), &nodes, &load_of, &mut allocation);
    let mut shares: BTreeMap<NodeId, f64> = BTreeMap::new();
    for (&leaf, &node) in &allocation {
        *shares.entry(node).or_default() += load_of(leaf);
    }
    let smallest = shares.iter().min_by(|a, b| a.1.total_cmp(b.1)).map(|(&node, _)| node);
    if let Some(smallest) = smallest.filter(|_| nodes[0] == leader) {
        for node in allocation.values_mut() {
            *node = match *node {
                node if node == smallest => leader,
                node if node == leader => smallest,
                node => node,
            };
        }
    }
    allocation
}

/// Allocates anew the regions of nodes that are not among `nodes` any more, and moves nothing else. Each such
/// region goes to one of the nodes that are nearest to it in the tree: to the one with the least load. A new
/// node gets nothing yet. If no former node is left, the result is that of [`allocate`].
///
/// # Panics
/// When `nodes` is empty.
pub fn reallocate(
    tree: &DistributionTree,
    former: &Allocation,
    nodes: &[NodeId],
    load_of: impl Fn(RegionId) -> f64,
) -> Allocation {
    let is_leaf = |leaf: &RegionId| tree.is_leaf(*leaf);
    let mut allocation: Allocation = former
        .iter()
        .filter(|(leaf, node)| is_leaf(leaf) && nodes.contains(node))
        .map(|(&leaf, &node)| (leaf, node))
        .collect();
    if allocation.is_empty() {
        return allocate(tree, nodes, load_of);
    }
    let orphans: Vec<_> = tree.leaves().filter(|leaf| !allocation.contains_key(leaf)).collect();
    for orphan in orphans {
        let has = |node: NodeId| {
            let own = allocation.iter().filter(|(_, owner)| **owner == node);
            own.map(|(&leaf, _)| load_of(leaf)).sum::<f64>()
        };
        let mut above = orphan;
        let heir = loop {
            let near = leaves_below(tree, above).into_iter().filter_map(|leaf| allocation.get(&leaf));
            let least = near.min_by(|a, b| has(**a).total_cmp(&has(**b)).then(a.cmp(b)));
            match (least, above.parent()) {
                (Some(&heir), _) => break heir,
                (None, Some(parent)) => above = parent,
                (None, None) => unreachable!("some region is allocated"),
            }
        };
        allocation.insert(orphan, heir);
    }
    allocation
}

fn deal(
    tree: &DistributionTree,
    vertex: RegionId,
    nodes: &[NodeId],
    load_of: &impl Fn(RegionId) -> f64,
    out: &mut Allocation,
) {
    let leaves = leaves_below(tree, vertex);
    if nodes.len() == 1 {
        out.extend(leaves.into_iter().map(|leaf| (leaf, nodes[0])));
        return;
    }
    let (left, right) = vertex.children();
    let (left_leaves, right_leaves) = (leaves_below(tree, left).len(), leaves_below(tree, right).len());
    let load = |vertex| leaves_below(tree, vertex).into_iter().map(load_of).sum::<f64>();
    let (left_load, total) = (load(left), load(vertex));
    let share = if total > 0.0 { left_load / total } else { left_leaves as f64 / leaves.len() as f64 };
    // Each side gets at least one node, and at most as many as it has leaves.
    let most = left_leaves.min(nodes.len() - 1);
    let least = nodes.len().saturating_sub(right_leaves).max(1);
    let left_nodes = ((share * nodes.len() as f64).round() as usize).clamp(least, most);
    deal(tree, left, &nodes[..left_nodes], load_of, out);
    deal(tree, right, &nodes[left_nodes..], load_of, out);
}

fn leaves_below(tree: &DistributionTree, vertex: RegionId) -> Vec<RegionId> {
    let mut found = Vec::new();
    let mut open = vec![vertex];
    while let Some(vertex) = open.pop() {
        if tree.cut_of(vertex).is_some() {
            let (left, right) = vertex.children();
            open.extend([left, right]);
        } else {
            found.push(vertex);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::space::Bounds;

    fn world(leaves: usize) -> DistributionTree {
        DistributionTree::halved(Bounds::new([0.0; 3], [16.0, 8.0, 8.0]), leaves).unwrap()
    }

    /// Counts the fewest vertices below which exactly the regions of one node lie: those whose whole sub-tree
    /// is the node's.
    fn tops(tree: &DistributionTree, allocation: &Allocation, node: NodeId) -> usize {
        let whole = |vertex| leaves_below(tree, vertex).iter().all(|leaf| allocation[leaf] == node);
        let mut open = vec![RegionId(0)];
        let mut count = 0;
        while let Some(vertex) = open.pop() {
            if whole(vertex) {
                count += 1;
            } else if tree.cut_of(vertex).is_some() {
                let (left, right) = vertex.children();
                open.extend([left, right]);
            }
        }
        count
    }

    proptest! {
        #[test]
        fn every_leaf_has_one_node_and_every_node_one_whole_sub_tree(
            leaves in 1_usize..=64, nodes in 1_u32..20, loads in prop::collection::vec(0.0..100.0_f64, 128),
        ) {
            let tree = world(leaves);
            let ids: Vec<_> = (1..=nodes).map(NodeId).collect();
            let allocation = allocate(&tree, &ids, |leaf| loads[leaf.0 as usize % loads.len()]);
            prop_assert_eq!(allocation.keys().copied().collect::<Vec<_>>(), tree.leaves().collect::<Vec<_>>());
            let computing = ids.len().min(leaves);
            for &node in &ids[ids.len() - computing..] {
                prop_assert_eq!(tops(&tree, &allocation, node), 1);
            }
            let share = |node| -> f64 {
                let own = allocation.iter().filter(|(_, owner)| **owner == node);
                own.map(|(leaf, _)| loads[leaf.0 as usize % loads.len()]).sum()
            };
            prop_assert!(ids.iter().all(|&node| share(ids[0]) <= share(node)), "the leader has the least");
        }

        #[test]
        fn what_nodes_leave_goes_to_others_and_nothing_else_moves(
            leaves in 1_usize..=64, nodes in 2_u32..20, gone in 1_u32..20, new in 0_u32..3,
        ) {
            let (tree, gone) = (world(leaves), NodeId(1 + gone % nodes));
            let ids: Vec<_> = (1..=nodes).map(NodeId).collect();
            let before = allocate(&tree, &ids, |_| 1.0);
            let left: Vec<_> = (1..=nodes + new).map(NodeId).filter(|&id| id != gone).collect();
            let after = reallocate(&tree, &before, &left, |_| 1.0);
            prop_assert_eq!(after.keys().copied().collect::<Vec<_>>(), tree.leaves().collect::<Vec<_>>());
            prop_assert!(after.values().all(|node| left.contains(node)));
            if before.values().any(|&node| node != gone) {
                prop_assert!(before.iter().all(|(leaf, &node)| node == gone || after[leaf] == node));
            }
        }

        #[test]
        fn with_equal_loads_and_powers_of_two_all_shares_are_equal(leaves in 0_u32..7, nodes in 0_u32..7) {
            let (leaves, nodes) = (1_usize << leaves.max(nodes), 1_u32 << nodes.min(leaves));
            let ids: Vec<_> = (1..=nodes).map(NodeId).collect();
            let allocation = allocate(&world(leaves), &ids, |_| 1.0);
            for node in ids {
                let share = allocation.values().filter(|&&owner| owner == node).count();
                prop_assert_eq!(share, leaves / nodes as usize);
            }
        }

        #[test]
        fn with_equal_loads_no_share_is_above_twice_the_mean(leaves in 1_usize..=64, nodes in 1_u32..20) {
            let ids: Vec<_> = (1..=nodes).map(NodeId).collect();
            let allocation = allocate(&world(leaves), &ids, |_| 1.0);
            let mean = leaves as f64 / f64::from(nodes).min(leaves as f64);
            for node in ids {
                let share = allocation.values().filter(|&&owner| owner == node).count() as f64;
                prop_assert!(share <= 2.0 * mean.ceil(), "{} of {} regions, {} nodes", share, leaves, nodes);
            }
        }
    }
}
