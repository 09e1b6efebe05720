//! Groups things that are tied in pairs, by union-find (Tarjan 1975, with path compression). The root of a
//! group is its lowest member, so that groups do not depend on the order of the ties.

use std::collections::BTreeMap;

/// The groups of a few things among many. A thing that was never tied is a group of its own.
#[derive(Clone, Debug)]
pub(crate) struct Groups<K> {
    parents: BTreeMap<K, K>,
}

impl<K> Default for Groups<K> {
    fn default() -> Self {
        Self { parents: BTreeMap::new() }
    }
}

impl<K: Copy + Ord> Groups<K> {
    /// Puts both into one group.
    pub(crate) fn join(&mut self, a: K, b: K) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            self.parents.insert(a.max(b), a.min(b));
        }
    }

    /// Returns the lowest member of the group.
    pub(crate) fn root(&mut self, of: K) -> K {
        let mut root = of;
        while let Some(&parent) = self.parents.get(&root) {
            root = parent;
        }
        let mut at = of;
        while let Some(parent) = self.parents.get_mut(&at) {
            at = std::mem::replace(parent, root);
        }
        root
    }
}

/// The groups of the indices of a list.
#[derive(Clone, Debug)]
#[cfg(feature = "physics")]
pub(crate) struct PlaceGroups {
    parents: Vec<u32>,
}

#[cfg(feature = "physics")]
impl PlaceGroups {
    /// Makes `count` places, each a group of its own.
    pub(crate) fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect() }
    }

    /// Puts both into one group.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b) as u32;
    }

    /// Returns the first place of the group.
    pub(crate) fn root(&mut self, place: usize) -> usize {
        let mut root = place;
        while self.parents[root] as usize != root {
            root = self.parents[root] as usize;
        }
        let mut at = place;
        while at != root {
            at = std::mem::replace(&mut self.parents[at], root as u32) as usize;
        }
        root
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIES: [(usize, usize); 4] = [(5, 4), (9, 8), (4, 9), (1, 2)];
    const ROOTS: [(usize, usize); 7] = [(5, 4), (4, 4), (9, 4), (8, 4), (1, 1), (2, 1), (7, 7)];

    #[test]
    fn ties_make_groups_with_the_lowest_as_root_in_any_order() {
        for turned in [false, true] {
            let mut ties = TIES;
            if turned {
                ties.reverse();
            }
            let mut groups = Groups::default();
            ties.iter().for_each(|&(a, b)| groups.join(a, b));
            assert!(ROOTS.iter().all(|&(of, root)| groups.root(of) == root), "{groups:?}");
        }
    }

    #[test]
    #[cfg(feature = "physics")]
    fn places_are_grouped_alike() {
        let mut groups = PlaceGroups::new(10);
        TIES.iter().for_each(|&(a, b)| groups.join(a, b));
        assert!(ROOTS.iter().all(|&(of, root)| groups.root(of) == root), "{groups:?}");
    }
}
