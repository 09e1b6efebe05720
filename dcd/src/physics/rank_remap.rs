//! Translates ranks when regions come and go: those that stay learn the new ranks of all.

use std::sync::Arc;

use crate::space::{RegionId, RegionSet};

/// Old ranks to new ones.
pub(super) struct RankRemap {
    /// By old rank; none for a region that is no more, of which nobody holds anything.
    pub to: Vec<Option<usize>>,
    /// All regions by new rank.
    pub leaves: Arc<[RegionId]>,
    /// A region that is new, and the one that it was cut from, by new rank.
    pub born: Option<(usize, usize)>,
}

impl RankRemap {
    /// The new rank of a region that stays.
    pub(super) fn rank(&self, old: usize) -> usize {
        self.to[old].expect("nobody holds anything of a region that is given up")
    }

    pub(super) fn set(&self, old: RegionSet) -> RegionSet {
        old.iter().filter_map(|rank| self.to[rank]).collect()
    }

    /// A list by rank.
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
