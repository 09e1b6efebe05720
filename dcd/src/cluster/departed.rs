//! Remembers the user data of removed bodies, since the end of their contacts is reported some ticks after
//! the removal.

use std::collections::{BTreeMap, VecDeque};

use crate::space::BodyId;

/// The user data of removed bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct Departed {
    /// With the number of the body's departure.
    user_data: BTreeMap<BodyId, (u128, u64)>,
    /// The departures, the first one first.
    order: VecDeque<(BodyId, u64)>,
    departures: u64,
}

impl Departed {
    pub(crate) fn insert(&mut self, id: BodyId, user_data: u128) {
        self.departures += 1;
        self.user_data.insert(id, (user_data, self.departures));
        self.order.push_back((id, self.departures));
    }

    pub(crate) fn get(&self, id: BodyId) -> Option<u128> {
        self.user_data.get(&id).map(|(user_data, _)| *user_data)
    }

    /// Forgets all but the newest departures, of which it keeps so many.
    pub(crate) fn trim(&mut self, kept: usize) {
        let excess = self.order.len().saturating_sub(kept);
        for (id, departure) in self.order.drain(..excess) {
            // A body that has come back and gone again is remembered for its last departure.
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
    fn of_many_that_go_the_newest_are_remembered_and_until_the_rest_is_forgotten_all() {
        const KEPT: usize = 4_096;
        let mut departed = Departed::default();
        let id = |i: usize| BodyId::persistent(i as u32);
        (0..2 * KEPT).for_each(|i| departed.insert(id(i), i as u128));
        departed.insert(id(0), 7);
        assert_eq!((departed.get(id(0)), departed.get(id(1))), (Some(7), Some(1)));
        departed.trim(KEPT);
        assert_eq!((departed.get(id(KEPT)), departed.get(id(KEPT + 1))), (None, Some(KEPT as u128 + 1)));
        assert_eq!(departed.get(id(0)), Some(7), "it went last");
    }
}
