//! Remaps ranks when regions are split or merged: regions that stay translate every rank that they hold.

use std::sync::Arc;

use crate::space::{RegionId, RegionSet};

/// The rank remap: old ranks to new ones.
pub(super) struct RankRemap {
    /// The new rank by old rank. `None` for a region that was given up, of whose bodies no region holds any.
    pub to: Vec<Option<usize>>,
    /// All regions by new rank.
    pub leaves: Arc<[RegionId]>,
}

impl RankRemap {
    /// Returns the new rank of a region that stays.
    pub(super) fn rank(&self, old: usize) -> usize {
        self.to[old].expect("nobody holds anything of a region that is given up")
    }

    pub(super) fn set(&self, old: RegionSet) -> RegionSet {
        old.iter().filter_map(|rank| self.to[rank]).collect()
    }

    /// Reorders a list by rank; a new region gets a `fresh` value.
    pub(super) fn list<T>(&self, old: &mut Vec<T>, fresh: impl Fn() -> T) {
        let mut new: Vec<_> = std::iter::repeat_with(fresh).take(self.leaves.len()).collect();
        for (value, to) in std::mem::take(old).into_iter().zip(&self.to) {
            if let Some(to) = *to {
                new[to] = value;
            }
        }
        *old = new;
    }
}
