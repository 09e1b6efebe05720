//! Goes back to a former tick, for who predicts: with the contacts as they were then, or with bodies put into other states.

use super::{RegionHost, Side};
use crate::physics::region;
use crate::protocol::BodyState;
use crate::space::{BodyId, Tick};

/// What a host held after a tick. It can be restored as long as nothing was inserted, removed or changed since.
pub(crate) struct Checkpoint {
    tick: Tick,
    regions: Vec<region::Checkpoint>,
}

impl Checkpoint {
    /// Returns the tick after which it was made.
    pub(crate) fn tick(&self) -> Tick {
        self.tick
    }
}

impl RegionHost {
    /// Returns what it holds now, after a whole tick.
    pub(crate) fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            tick: self.tick,
            regions: self.sides.iter().map(|side| side.region.checkpoint()).collect(),
        }
    }

    /// Goes back to what it held.
    pub(crate) fn restore(&mut self, to: &Checkpoint) {
        self.tick = to.tick;
        for (Side { region, .. }, to) in self.sides.iter_mut().zip(&to.regions) {
            region.restore(to);
        }
    }

    /// Puts bodies held here into the states that they have after a tick, as if they had come into them by themselves, and goes on from
    /// that tick.
    pub(crate) fn put<'a>(&mut self, tick: Tick, states: impl Iterator<Item = (BodyId, &'a BodyState)>) {
        self.tick = tick;
        for (id, state) in states {
            self.sides.iter_mut().for_each(|side| side.region.put(id, state));
        }
        self.sides.iter_mut().for_each(|side| side.region.find_moved());
    }
}
