//! A set of regions as one machine word, by their rank among the leaves.

/// The most regions one world may have at a time: what [`RegionSet`] can name.
pub const MAX_REGIONS: usize = 64;

/// Regions by rank: bit `i` stands for the `i`-th leaf of the tree in id order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RegionSet(u64);

impl RegionSet {
    /// No region.
    pub const EMPTY: Self = Self(0);

    /// The one region of this rank.
    pub fn only(rank: usize) -> Self {
        assert!(rank < MAX_REGIONS, "region rank {rank} out of range");
        Self(1 << rank)
    }

    /// The set whose [`RegionSet::bits`] these are.
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// One bit a rank.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Whether the region of this rank is in the set.
    pub fn contains(self, rank: usize) -> bool {
        rank < MAX_REGIONS && self.0 & (1 << rank) != 0
    }

    /// Adds a region.
    pub fn insert(&mut self, rank: usize) {
        *self = self.union(Self::only(rank));
    }

    /// Takes a region out.
    pub fn remove(&mut self, rank: usize) {
        *self = self.without(Self::only(rank));
    }

    /// Regions in either set.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Regions in this set and not in the other.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Regions in both sets.
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Whether no region is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// How many regions.
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Ranks in ascending order.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        std::iter::from_fn(move || {
            if rest == 0 {
                return None;
            }
            let rank = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            Some(rank)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iterates_in_rank_order() {
        let mut set = RegionSet::only(63);
        set.insert(0);
        set.insert(5);
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 5, 63]);
        set.remove(5);
        assert_eq!((set.len(), set.contains(5), set.contains(63)), (2, false, true));
    }
}
