//! Finds the regions at a point or in a box by their cells, and holds the width of the halo in which regions keep ghosts.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::space::{Bounds, Cell, DistributionTree, RegionId, RegionSet};

/// The largest reach of a body that widens the halo, metres. A larger body is a hub: the halo stays as it is,
/// and the hub's own AABB is used.
pub(super) const HUB_REACH_M: f32 = 4.0;

/// The margin of the halo beyond the reach of any body but a hub, metres.
const HALO_SLACK_M: f64 = 0.1;

/// The margin beyond the halo that a ghost must leave before it is dropped, metres, so that none flaps.
pub(super) const HALO_HYSTERESIS_M: f64 = 0.25;

/// The distance by which a centre must have left its region before the owner changes, metres, so that none flaps.
pub(super) const OWNER_HYSTERESIS_M: f64 = 0.05;

/// The regions (leaves of the distribution tree) by rank, and the halo.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Partition {
    tree: DistributionTree,
    leaves: Arc<[RegionId]>,
    cells: Vec<Cell>,
    /// The regions that are being emptied.
    emptied: RegionSet,
    /// The tree's inner vertices, the root first.
    branches: Vec<Branch>,
    halo_m: f64,
    fixed_halo: bool,
}

/// An inner vertex, laid out for quick descent.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Branch {
    axis: usize,
    at: f64,
    below: [Twig; 2],
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Twig {
    /// Index of a branch.
    Branch(usize),
    /// Rank of a region.
    Leaf(usize),
}

impl Partition {
    /// Creates a partition. The halo follows the largest body that is no hub, unless `halo_m` fixes it.
    pub fn new(tree: DistributionTree, halo_m: Option<f64>) -> Self {
        let mut partition = Self {
            leaves: Arc::new([]),
            cells: Vec::new(),
            emptied: RegionSet::EMPTY,
            branches: Vec::new(),
            halo_m: halo_m.unwrap_or(0.0),
            fixed_halo: halo_m.is_some(),
            tree,
        };
        partition.index();
        partition
    }

    /// Replaces the tree.
    pub(super) fn set_tree(&mut self, tree: DistributionTree) {
        self.tree = tree;
        self.index();
    }

    /// Lays out the tree anew.
    fn index(&mut self) {
        self.leaves = self.tree.leaves().collect();
        self.cells = self.leaves.iter().map(|&leaf| self.tree.cell(leaf)).collect();
        let yielding = self.tree.yielding();
        self.emptied = yielding.filter_map(|(_, regions)| self.rank_of(regions.leaving)).collect();
        self.branches.clear();
        self.lay_out(RegionId(0));
    }

    fn lay_out(&mut self, vertex: RegionId) -> Twig {
        let (Some((axis, at)), Some((left, right))) =
            (self.tree.cut_of(vertex), self.tree.children_of(vertex))
        else {
            return Twig::Leaf(self.leaves.binary_search(&vertex).expect("a vertex without cut is a leaf"));
        };
        let place = self.branches.len();
        self.branches.push(Branch { axis: axis.index(), at, below: [Twig::Branch(place); 2] });
        self.branches[place].below = [self.lay_out(left), self.lay_out(right)];
        Twig::Branch(place)
    }

    fn root(&self) -> Twig {
        if self.branches.is_empty() { Twig::Leaf(0) } else { Twig::Branch(0) }
    }

    /// Returns the tree.
    pub fn tree(&self) -> &DistributionTree {
        &self.tree
    }

    /// Returns the regions in rank order.
    pub fn leaves(&self) -> &Arc<[RegionId]> {
        &self.leaves
    }

    /// Returns the cell of the region of this rank.
    pub fn cell(&self, rank: usize) -> &Cell {
        &self.cells[rank]
    }

    /// Returns the regions that are being emptied, each into another one that takes over its cell.
    pub(super) fn emptied(&self) -> RegionSet {
        self.emptied
    }

    /// Returns the number of regions.
    pub fn len(&self) -> usize {
        self.leaves.len()
    }

    /// Returns `false`: a tree has at least one leaf.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Returns how far beyond its cell a region holds ghosts, in metres.
    pub fn halo_m(&self) -> f64 {
        self.halo_m
    }

    /// Returns the largest gap, metres, between the cells of two regions that may both hold a body that lies
    /// in one of them. It does not depend on a halo that is not fixed: each process widens that for the
    /// bodies that it knows of.
    pub(super) fn near_m(&self) -> f64 {
        f64::from(HUB_REACH_M)
            + if self.fixed_halo { self.halo_m } else { f64::from(HUB_REACH_M) + HALO_SLACK_M }
    }

    /// Returns the rank of the region whose cell contains the point.
    pub fn rank_at(&self, point: [f64; 3]) -> usize {
        let mut at = self.root();
        loop {
            match at {
                Twig::Leaf(rank) => return rank,
                Twig::Branch(place) => {
                    let branch = &self.branches[place];
                    at = branch.below[usize::from(point[branch.axis] >= branch.at)];
                }
            }
        }
    }

    /// Returns the rank of a region, if it is a leaf.
    pub fn rank_of(&self, region: RegionId) -> Option<usize> {
        self.leaves.binary_search(&region).ok()
    }

    /// Returns the regions whose cells the box touches.
    pub fn touching(&self, bounds: &Bounds) -> RegionSet {
        let mut found = RegionSet::EMPTY;
        self.visit(self.root(), bounds, &mut found);
        found
    }

    fn visit(&self, twig: Twig, bounds: &Bounds, found: &mut RegionSet) {
        match twig {
            Twig::Leaf(rank) => found.insert(rank),
            Twig::Branch(place) => {
                let Branch { axis, at, below } = self.branches[place];
                if bounds.min[axis] < at {
                    self.visit(below[0], bounds, found);
                }
                if bounds.max[axis] >= at {
                    self.visit(below[1], bounds, found);
                }
            }
        }
    }

    /// Widens the halo for a body of this reach. A neighbour must hold a body P that touches its own body Q,
    /// so that it can solve the contact; P's AABB comes as near to Q's cell as Q reaches out of it.
    pub fn widen_halo(&mut self, reach_m: f32) {
        if self.is_widened_by(reach_m) {
            self.halo_m = f64::from(reach_m) + HALO_SLACK_M;
        }
    }

    /// Returns whether the halo must be wider for a body of this reach.
    pub(super) fn is_widened_by(&self, reach_m: f32) -> bool {
        !self.fixed_halo && reach_m <= HUB_REACH_M && f64::from(reach_m) + HALO_SLACK_M > self.halo_m
    }
}
