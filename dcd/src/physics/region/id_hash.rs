//! Hashes body ids for a map in which consecutive ids lie side by side. Programs create and destroy bodies in
//! runs of ids, and border messages list them in order: per run only one look-up in the map waits for memory.

use std::hash::{BuildHasher, Hasher};

use foldhash::quality::{FoldHasher, RandomState};

/// How many consecutive ids lie together. A power of two, at most the number of slots that a map of the
/// standard library compares at once.
const RUN: u64 = 16;

/// Builds the hashers of one map, with a seed of its own: peers choose ids, and must not be able to choose
/// which ids share a slot. With some seeds the faster hasher of the same crate gives consecutive runs few
/// different high bits.
#[derive(Clone, Default)]
pub(super) struct IdHash(RandomState);

/// Hashes one id.
pub(super) struct IdHasher {
    run: FoldHasher<'static>,
    place: u64,
}

impl BuildHasher for IdHash {
    type Hasher = IdHasher;

    fn build_hasher(&self) -> IdHasher {
        IdHasher { run: self.0.build_hasher(), place: 0 }
    }
}

impl Hasher for IdHasher {
    #[inline]
    fn write_u64(&mut self, id: u64) {
        self.run.write_u64(id / RUN);
        self.place = id % RUN;
    }

    fn write(&mut self, bytes: &[u8]) {
        self.run.write(bytes);
    }

    /// The low bits of a hash choose the slot in the map. The high bits tell the ids of one run apart there.
    #[inline]
    fn finish(&self) -> u64 {
        ((self.run.finish() & !(RUN - 1)) | self.place) ^ self.place.rotate_right(RUN.trailing_zeros())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::space::BodyId;

    #[test]
    fn ids_that_follow_one_another_lie_side_by_side_and_runs_lie_anywhere() {
        let hash = IdHash::default();
        let (mut places, mut tags) = (BTreeSet::new(), BTreeSet::new());
        for run in 0..64 {
            let hashes: Vec<_> = (0..16).map(|i| hash.hash_one(BodyId::persistent(16 * run + i))).collect();
            let low = |hash: &u64| hash & 0xFFFF;
            assert!(hashes.windows(2).all(|pair| low(&pair[1]) == low(&pair[0]) + 1), "{hashes:x?}");
            places.insert(low(&hashes[0]));
            tags.extend(hashes.iter().map(|hash| hash >> 57));
        }
        // Each bound fails by chance once in millions of seeds.
        assert!(places.len() > 55, "runs share {} places of 4,096", places.len());
        assert!(tags.len() > 100, "{} of 128 tags are used", tags.len());
    }
}
