//! Which node computes which region: sub-trees are dealt to nodes by load (thesis 3.2, 4.3.1.3).

use std::collections::BTreeMap;

use super::tree::children;
use super::{DistributionTree, NodeId, RegionId};

/// The node of each region, in region order.
pub type Allocation = BTreeMap<RegionId, NodeId>;

/// Deals the leaves of the tree to the nodes, so that each node has whole sub-trees and about its share of the load.
///
/// `load_of` says what a leaf costs, in any unit. With more nodes than leaves the last nodes stay idle.
///
/// # Panics
/// When `nodes` is empty: a world without a node has no allocation.
pub fn allocate(tree: &DistributionTree, nodes: &[NodeId], load_of: impl Fn(RegionId) -> f64) -> Allocation {
    assert!(!nodes.is_empty(), "an allocation needs at least one node");
    let mut nodes = nodes.to_vec();
    nodes.sort_unstable();
    nodes.truncate(tree.leaf_count());
    let mut allocation = Allocation::new();
    deal(tree, RegionId(0), &nodes, &load_of, &mut allocation);
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
    let (left, right) = children(vertex);
    let (left_leaves, right_leaves) = (leaves_below(tree, left).len(), leaves_below(tree, right).len());
    let load = |vertex| leaves_below(tree, vertex).into_iter().map(load_of).sum::<f64>();
    let (left_load, total) = (load(left), load(vertex));
    let share = if total > 0.0 { left_load / total } else { left_leaves as f64 / leaves.len() as f64 };
    // Each side gets at least one node and at most as many as it has leaves.
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
            let (left, right) = children(vertex);
            open.extend([left, right]);
        } else {
            found.push(vertex);
        }
    }
    found
}
