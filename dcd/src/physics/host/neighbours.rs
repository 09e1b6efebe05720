//! Chooses, tick by tick, which regions exchange messages: neighbours, or all regions after a change that may
//! concern any of them.

use super::RegionHost;
use crate::physics::coupling::{Moment, Side};
use crate::space::{RegionId, RegionSet};

impl RegionHost {
    /// Makes all regions exchange messages in the next tick, not only neighbours. All processes that compute
    /// a part of the world must call this before the same tick, since a body that is inserted, or put
    /// elsewhere at once, may concern any region.
    pub fn meet_all(&mut self) {
        self.is_placed = false;
        self.meets = true;
    }

    /// Makes all regions exchange messages in every tick, for processes that do not take in messages in the
    /// tick in which they were written.
    pub fn meet_always(&mut self) {
        self.meets_always = true;
    }

    /// Chooses the neighbours of every region here for the tick to come; with `all`, every region meets all
    /// others.
    pub(super) fn meet(&mut self, all: bool) {
        let (regions, behind) = (self.partition.len(), self.left_behind());
        let settles = self.meets && !std::mem::replace(&mut self.settled, true);
        for side in &mut self.sides {
            if settles {
                side.border.neighbours.settle(&side.region, &self.partition);
            }
            side.meet(regions, all, behind);
        }
        debug_assert!(self.strangers().next().is_none(), "of neighbours each knows the other");
    }

    /// Returns the pairs of regions here of which only one takes the other for a neighbour, in any round.
    fn strangers(&self) -> impl Iterator<Item = (RegionId, RegionId)> {
        let settings = self.settings;
        let rounds = (1..=self.rounds).map(move |round| {
            let moment = Moment::new(
                &self.partition,
                &settings,
                self.tick.next(),
                self.rounds,
                round,
                self.coarsest(),
            );
            self.sides.iter().map(|side| (&side.region, side.exchanges_with(&moment))).collect::<Vec<_>>()
        });
        rounds.flat_map(|sides| {
            let mut unequal = Vec::new();
            for (one, of_one) in &sides {
                let strangers = sides.iter().filter(|(other, of_other)| {
                    of_one.contains(other.rank()) && !of_other.contains(one.rank())
                });
                unequal.extend(strangers.map(|(other, _)| (one.id(), other.id())));
            }
            unequal
        })
    }

    /// Returns the regions computed elsewhere with which regions here exchange messages in the present round,
    /// in id order. Those regions exchange messages with the ones here, too.
    pub fn neighbours(&self) -> Vec<RegionId> {
        let settings = self.settings;
        let moment = Moment::new(
            &self.partition,
            &settings,
            self.tick.next(),
            self.rounds,
            self.round,
            self.coarsest(),
        );
        let of = |side: &Side| side.exchanges_with(&moment);
        let all = self.sides.iter().map(of).fold(RegionSet::EMPTY, RegionSet::union);
        let leaves = self.partition.leaves();
        all.iter().filter(|&rank| self.place_of[rank].is_none()).map(|rank| leaves[rank]).collect()
    }
}
