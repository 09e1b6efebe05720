//! Spreads what a client is told over batches: of more bodies than a batch takes each has its turn.

use std::collections::BTreeSet;
use std::ops::Bound::{Excluded, Unbounded};

use crate::protocol::link;
use crate::space::BodyId;

/// The most bodies in a batch: with some 30 bytes each, all of its datagrams wait in the queue of a link at once. What is beyond
/// would push out the first ones, the same in every batch.
pub(super) const MOST_AT_ONCE: usize = 1_500;

/// The fewest bodies that a batch may have come down to.
const LEAST_AT_ONCE: usize = 32;

/// What may wait for the link when a batch follows, bytes. If nothing ever waited, QUIC would not learn what the link carries, and
/// would send ever more slowly what there is; at twice as much the oldest are dropped.
const WAITING_BYTES: usize = link::DATAGRAM_QUEUE_BYTES / 2;

/// The bodies that a client is still to be told of, and how many of them a batch takes.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    waiting: BTreeSet<BodyId>,
    /// The last one whose turn it was.
    last: BodyId,
    /// The most bodies in a batch: as many as the link carries until the next one.
    most: usize,
}

impl Default for Turns {
    fn default() -> Self {
        Self { waiting: BTreeSet::new(), last: BodyId::default(), most: MOST_AT_ONCE }
    }
}

impl Turns {
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Returns the most bodies that a batch takes now.
    pub(super) fn most(&self) -> usize {
        self.most
    }

    /// Notes how many bytes of the batches before still waited for the link when one was sent: batches become smaller while that is
    /// much, and larger again while it is not.
    pub(super) fn adapt(&mut self, waiting_bytes: usize) {
        self.most = match waiting_bytes > WAITING_BYTES {
            true => (self.most * 3 / 4).max(LEAST_AT_ONCE),
            false => (self.most + self.most / 16).min(MOST_AT_ONCE),
        };
    }

    /// Adds bodies, and takes those whose turn it is, in id order.
    pub(super) fn take(&mut self, bodies: impl IntoIterator<Item = BodyId>) -> BTreeSet<BodyId> {
        self.waiting.extend(bodies);
        let round =
            self.waiting.range((Excluded(self.last), Unbounded)).chain(self.waiting.range(..=self.last));
        let next: Vec<_> = round.take(self.most).copied().collect();
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

    /// A link that carries so many bytes between two batches.
    #[test]
    fn batches_become_as_large_as_the_link_carries() {
        for room in [2_000, 9_000, 30_000] {
            let (mut turns, mut waiting, mut told) = (Turns::default(), 0, 0);
            for batch in 0..400 {
                turns.adapt(waiting);
                let bodies = turns.take((0..2_000).map(BodyId::persistent)).len();
                waiting = (waiting + 27 * bodies).saturating_sub(room);
                if batch >= 100 {
                    told += bodies;
                    assert!(waiting < link::DATAGRAM_QUEUE_BYTES, "{room}: {waiting}");
                }
            }
            let share = (told * 27) as f64 / 300.0 / room as f64;
            assert!((0.6..=1.01).contains(&share), "{room}: {share}");
        }
    }
}
