//! Stores a set of regions as a bit set of a few machine words, by their rank among the leaves.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// The most regions that one world may have at a time: as many as a [`RegionSet`] can name.
pub const MAX_REGIONS: usize = 64 * WORDS;

const WORDS: usize = 4;

/// A set of regions by rank. Bit `i` stands for the `i`-th leaf of the tree in id order.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct RegionSet([u64; WORDS]);

impl RegionSet {
    /// The empty set.
    pub const EMPTY: Self = Self([0; WORDS]);

    /// The set of all regions that a world can have.
    pub const ALL: Self = Self([u64::MAX; WORDS]);

    /// Returns the set with only the region of this rank.
    #[inline]
    pub fn only(rank: usize) -> Self {
        let mut set = Self::EMPTY;
        set.insert(rank);
        set
    }

    /// Returns whether the region of this rank is in the set.
    #[inline]
    pub fn contains(self, rank: usize) -> bool {
        rank < MAX_REGIONS && self.0[rank / 64] & (1 << (rank % 64)) != 0
    }

    /// Adds the region of this rank.
    #[inline]
    pub fn insert(&mut self, rank: usize) {
        assert!(rank < MAX_REGIONS, "region rank {rank} out of range");
        self.0[rank / 64] |= 1 << (rank % 64);
    }

    /// Removes the region of this rank.
    #[inline]
    pub fn remove(&mut self, rank: usize) {
        *self = self.without(Self::only(rank));
    }

    /// Returns the regions in either set.
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] | other.0[i]))
    }

    /// Returns the regions in this set and not in the other.
    #[inline]
    pub fn without(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] & !other.0[i]))
    }

    /// Returns the regions in both sets.
    #[inline]
    pub fn intersection(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] & other.0[i]))
    }

    /// Returns whether no region is in the set.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.0 == [0; WORDS]
    }

    /// Returns the number of regions in the set.
    #[inline]
    pub fn len(self) -> usize {
        let [a, b, c, d] = self.0;
        (a.count_ones() + b.count_ones() + c.count_ones() + d.count_ones()) as usize
    }

    /// Returns the ranks in the set, in ascending order.
    #[inline]
    pub fn iter(self) -> impl Iterator<Item = usize> {
        Ranks { rest: self, word: 0 }
    }
}

/// Takes the ranks out of a set. Written out, since every exchange goes through sets of a rank or two many
/// times.
struct Ranks {
    rest: RegionSet,
    /// The word that is read; those before it are empty.
    word: usize,
}

impl Iterator for Ranks {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        while self.word < WORDS {
            let bits = &mut self.rest.0[self.word];
            if *bits != 0 {
                let rank = 64 * self.word + bits.trailing_zeros() as usize;
                *bits &= *bits - 1;
                return Some(rank);
            }
            self.word += 1;
        }
        None
    }
}

impl FromIterator<usize> for RegionSet {
    fn from_iter<I: IntoIterator<Item = usize>>(ranks: I) -> Self {
        let mut set = Self::EMPTY;
        ranks.into_iter().for_each(|rank| set.insert(rank));
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iterates_in_rank_order() {
        let mut set: RegionSet = [200, 0, 63, 5].into_iter().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 5, 63, 200]);
        set.remove(5);
        assert_eq!((set.len(), set.contains(5), set.contains(63), set.contains(200)), (3, false, true, true));
        assert_eq!(set.without(RegionSet::only(200)).union(RegionSet::only(64)).len(), 3);
        assert!(set.intersection(RegionSet::only(136)).is_empty(), "another word's bit");
        assert!(!RegionSet::ALL.contains(MAX_REGIONS) && RegionSet::ALL.contains(MAX_REGIONS - 1));
    }
}
