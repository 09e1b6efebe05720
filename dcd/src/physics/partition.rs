//! What every region must know of all the others: their cells, and how far replicas reach.

use crate::space::{Bounds, Cell, DistributionTree, RegionId, RegionSet};

/// A body whose reach is larger is a hub: it does not widen the halo of all others, and its own box is used.
pub(super) const HUB_REACH_M: f32 = 4.0;

/// Kept around the halo before a replica is dropped, so that none flaps.
pub(super) const HALO_HYSTERESIS_M: f64 = 0.25;

/// How far a centre must have left its region before the owner changes, so that none flaps.
pub(super) const OWNER_HYSTERESIS_M: f64 = 0.05;

/// The leaves of the tree by rank, and the halo.
#[derive(Clone, Debug)]
pub struct Partition {
    tree: DistributionTree,
    leaves: Vec<RegionId>,
    cells: Vec<Cell>,
    halo_m: f64,
    fixed_halo: bool,
}

impl Partition {
    /// The halo follows the largest body that is no hub, unless `halo_m` fixes it.
    pub fn new(tree: DistributionTree, halo_m: Option<f64>) -> Self {
        let leaves: Vec<_> = tree.leaves().collect();
        let cells = leaves.iter().map(|&leaf| tree.cell(leaf)).collect();
        Self { tree, leaves, cells, halo_m: halo_m.unwrap_or(0.0), fixed_halo: halo_m.is_some() }
    }

    /// The tree.
    pub fn tree(&self) -> &DistributionTree {
        &self.tree
    }

    /// The regions in rank order.
    pub fn leaves(&self) -> &[RegionId] {
        &self.leaves
    }

    /// The cell of the region of this rank.
    pub fn cell(&self, rank: usize) -> &Cell {
        &self.cells[rank]
    }

    /// How many regions.
    pub fn len(&self) -> usize {
        self.leaves.len()
    }

    /// Never: a tree has at least one leaf.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// How far beyond its cell a region holds replicas, in metres.
    pub fn halo_m(&self) -> f64 {
        self.halo_m
    }

    /// The rank of the region that holds the point.
    pub fn rank_at(&self, point: [f64; 3]) -> usize {
        let leaf = self.tree.leaf_at(point);
        self.leaves.binary_search(&leaf).expect("leaf_at gives a leaf")
    }

    /// The rank of a region, if it is a leaf.
    pub fn rank_of(&self, region: RegionId) -> Option<usize> {
        self.leaves.binary_search(&region).ok()
    }

    /// The regions whose cell the box touches.
    pub fn touching(&self, bounds: &Bounds) -> RegionSet {
        let mut found = RegionSet::EMPTY;
        for (rank, cell) in self.cells.iter().enumerate() {
            if cell.touches(bounds) {
                found.insert(rank);
            }
        }
        found
    }

    /// A body of this reach is in the world from now on. A body P that touches a body Q of the neighbour must be held
    /// there, for Q's owner to feel it; P's box comes as near to Q's cell as Q reaches out of it.
    pub fn widen_halo(&mut self, reach_m: f32) {
        if !self.fixed_halo && reach_m <= HUB_REACH_M {
            self.halo_m = self.halo_m.max(f64::from(reach_m) + 0.1);
        }
    }
}
