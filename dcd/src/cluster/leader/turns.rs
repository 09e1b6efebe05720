//! Spreads what a client is told over batches: of more bodies than a batch takes each has its turn.

use std::collections::BTreeSet;
use std::ops::Bound::{Excluded, Unbounded};

use crate::space::BodyId;

/// The most bodies in a batch: with some 30 bytes each, all of its datagrams wait in the queue of a link at once. What is beyond
/// would push out the first ones, the same in every batch.
pub(super) const MOST_AT_ONCE: usize = 1_500;

/// The bodies that a client is still to be told of.
#[derive(Clone, Debug, Default)]
pub(super) struct Turns {
    waiting: BTreeSet<BodyId>,
    /// The last one whose turn it was.
    last: BodyId,
}

impl Turns {
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Adds bodies, and takes those whose turn it is, in id order.
    pub(super) fn take(&mut self, bodies: impl IntoIterator<Item = BodyId>) -> BTreeSet<BodyId> {
        self.waiting.extend(bodies);
        let round =
            self.waiting.range((Excluded(self.last), Unbounded)).chain(self.waiting.range(..=self.last));
        let next: Vec<_> = round.take(MOST_AT_ONCE).copied().collect();
        self.last = next.last().copied().unwrap_or(self.last);
        let next: BTreeSet<_> = next.into_iter().collect();
        self.waiting.retain(|id| !next.contains(id));
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_has_its_turn_however_many_others_move_all_the_time() {
        let all = 4 * MOST_AT_ONCE as u32 - 7;
        let ids = || (0..all).map(BodyId::persistent);
        let mut turns = Turns::default();
        let mut heard = vec![0u32; all as usize];
        // What has moved once.
        let once = BodyId::persistent(all);
        assert!(!turns.take(ids().chain([once])).contains(&once));
        let mut told_once = 0;
        for _ in 0..8 {
            let told = turns.take(ids());
            assert_eq!(told.len(), MOST_AT_ONCE);
            told_once += u32::from(told.contains(&once));
            told.iter().filter(|id| **id != once).for_each(|id| heard[id.index() as usize] += 1);
        }
        assert_eq!(told_once, 1);
        assert!(heard.iter().all(|&times| (1..=3).contains(&times)), "{:?}", heard.iter().min());
        while !turns.is_empty() {
            turns.take([]);
        }
    }
}
