//! Remembers what the user gave to bodies that are gone: whoever computes them tells of the end of their contacts some ticks later.

use std::collections::{BTreeMap, VecDeque};

use crate::space::BodyId;

/// The most bodies of earlier steps.
const KEPT: usize = 4_096;

/// User data of bodies that are gone.
#[derive(Default)]
pub(super) struct Departed {
    /// With the number of its departure.
    user_data: BTreeMap<BodyId, (u128, u64)>,
    /// From the one that went first.
    order: VecDeque<(BodyId, u64)>,
    departures: u64,
}

impl Departed {
    pub(super) fn insert(&mut self, id: BodyId, user_data: u128) {
        self.departures += 1;
        self.user_data.insert(id, (user_data, self.departures));
        self.order.push_back((id, self.departures));
    }

    pub(super) fn get(&self, id: BodyId) -> Option<u128> {
        self.user_data.get(&id).map(|(user_data, _)| *user_data)
    }

    /// Forgets those that went first, of more than enough: once a step, so that all that go in one are remembered until the next.
    pub(super) fn trim(&mut self) {
        let excess = self.order.len().saturating_sub(KEPT);
        for (id, departure) in self.order.drain(..excess) {
            // One that has come back and gone again is remembered for its last time.
            if self.user_data.get(&id).is_some_and(|(_, last)| *last == departure) {
                self.user_data.remove(&id);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_that_go_the_newest_are_remembered_and_until_the_next_step_all() {
        let mut departed = Departed::default();
        let id = |i: usize| BodyId::persistent(i as u32);
        (0..2 * KEPT).for_each(|i| departed.insert(id(i), i as u128));
        departed.insert(id(0), 7);
        assert_eq!((departed.get(id(0)), departed.get(id(1))), (Some(7), Some(1)));
        departed.trim();
        assert_eq!((departed.get(id(KEPT)), departed.get(id(KEPT + 1))), (None, Some(KEPT as u128 + 1)));
        assert_eq!(departed.get(id(0)), Some(7), "it went last");
    }
}
