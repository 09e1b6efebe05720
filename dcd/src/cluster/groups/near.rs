//! Stores which nodes are near each other as a graph of bit sets, so that two sets of a thousand nodes are
//! intersected in sixteen words.

use crate::space::NodeId;

/// A set of nodes by rank, in bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Ranks(Vec<u64>);

impl Ranks {
    pub(super) fn insert(&mut self, rank: usize) {
        self.0[rank / 64] |= 1 << (rank % 64);
    }

    pub(super) fn remove(&mut self, rank: usize) {
        self.0[rank / 64] &= !(1 << (rank % 64));
    }

    pub(super) fn contains(&self, rank: usize) -> bool {
        self.0[rank / 64] >> (rank % 64) & 1 == 1
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(|&word| word == 0)
    }

    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Returns the number of words that one operation goes over.
    pub(super) fn words(&self) -> usize {
        self.0.len()
    }

    /// Returns the members of both sets.
    pub(super) fn and(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a & b).collect())
    }

    /// Keeps only the members that are in the other set.
    pub(super) fn keep(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a &= b);
    }

    /// Removes the members of the other set.
    pub(super) fn drop(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a &= !b);
    }

    /// Returns the number of members in both sets.
    pub(super) fn common(&self, other: &Self) -> usize {
        self.0.iter().zip(&other.0).map(|(a, b)| (a & b).count_ones() as usize).sum()
    }

    /// Returns the lowest member at or above this rank.
    pub(super) fn first_from(&self, rank: usize) -> Option<usize> {
        let word = rank / 64;
        let head = self.0.get(word)? & (u64::MAX << (rank % 64));
        if head != 0 {
            return Some(word * 64 + head.trailing_zeros() as usize);
        }
        let at = word + 1 + self.0[word + 1..].iter().position(|&word| word != 0)?;
        Some(at * 64 + self.0[at].trailing_zeros() as usize)
    }

    /// Returns the members, ascending.
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(self.first_from(0), |&rank| self.first_from(rank + 1))
    }
}

/// The graph of pairs of near nodes. Nodes are ranked by how many are near them, most first, then by id.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    nodes: Vec<NodeId>,
    near: Vec<Ranks>,
}

impl Graph {
    /// Returns the graph of these nodes. Repeated ones count once.
    pub(super) fn new(nodes: &[NodeId], is_near: impl Fn(NodeId, NodeId) -> bool) -> Self {
        let mut ids = nodes.to_vec();
        ids.sort_unstable();
        ids.dedup();
        let none = Ranks(vec![0; ids.len().div_ceil(64)]);
        let mut by_id = vec![none.clone(); ids.len()];
        for a in 0..ids.len() {
            for b in a + 1..ids.len() {
                if is_near(ids[a], ids[b]) {
                    by_id[a].insert(b);
                    by_id[b].insert(a);
                }
            }
        }
        let mut order: Vec<usize> = (0..ids.len()).collect();
        order.sort_by_key(|&at| (std::cmp::Reverse(by_id[at].len()), at));
        let mut rank_of = vec![0; ids.len()];
        order.iter().enumerate().for_each(|(rank, &at)| rank_of[at] = rank);
        let ranked = |row: &Ranks| {
            let mut ranks = none.clone();
            row.iter().for_each(|at| ranks.insert(rank_of[at]));
            ranks
        };
        Self {
            nodes: order.iter().map(|&at| ids[at]).collect(),
            near: order.iter().map(|&at| ranked(&by_id[at])).collect(),
        }
    }

    pub(super) fn node(&self, rank: usize) -> NodeId {
        self.nodes[rank]
    }

    /// Returns the nodes near this one; never itself.
    pub(super) fn near(&self, rank: usize) -> &Ranks {
        &self.near[rank]
    }

    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn none(&self) -> Ranks {
        Ranks(vec![0; self.nodes.len().div_ceil(64)])
    }

    pub(super) fn all(&self) -> Ranks {
        let mut all = self.none();
        (0..self.nodes.len()).for_each(|rank| all.insert(rank));
        all
    }

    /// Adds to a clique the nodes of `left` that are near all of it, lowest rank first.
    pub(super) fn complete(&self, clique: &mut Vec<usize>, left: &Ranks) {
        let mut fit = left.clone();
        clique.iter().for_each(|&rank| fit.keep(self.near(rank)));
        while let Some(rank) = fit.first_from(0) {
            clique.push(rank);
            fit.keep(self.near(rank));
        }
    }
}
