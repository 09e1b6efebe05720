//! Gives each body a slot: an index that it has in every view for as long as views show it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use dcd::BodyId;

/// The slots of the bodies of one world, in all of its views.
#[derive(Default)]
pub(super) struct BodySlots {
    /// Bodies of the last view with their slots, in id order.
    last: Vec<(BodyId, u32)>,
    /// How many bodies of the last view the view under way has passed by.
    passed: usize,
    /// Bodies of the view under way up to now.
    view: Vec<(BodyId, u32)>,
    /// Slots that no body has. The lowest is given first, which keeps the program's array short.
    free: BinaryHeap<Reverse<u32>>,
    /// Slots that become free with the view under way, which gives none of them anew.
    freed: Vec<u32>,
    count: u32,
}

impl BodySlots {
    /// Returns the slot of the next body of a view. Bodies come in id order.
    pub(super) fn next(&mut self, id: BodyId) -> u32 {
        debug_assert!(self.view.last().is_none_or(|(former, _)| *former < id), "{id} comes out of order");
        while let Some(&(gone, slot)) = self.last.get(self.passed)
            && gone < id
        {
            self.freed.push(slot);
            self.passed += 1;
        }
        let slot = match self.last.get(self.passed) {
            Some(&(same, slot)) if same == id => {
                self.passed += 1;
                slot
            }
            _ => self.give(),
        };
        self.view.push((id, slot));
        slot
    }

    /// Ends a view: the slots of bodies that it does not show are free from now on.
    pub(super) fn end_view(&mut self) {
        self.freed.extend(self.last.drain(..).skip(self.passed).map(|(_, slot)| slot));
        self.passed = 0;
        self.free.extend(self.freed.drain(..).map(Reverse));
        std::mem::swap(&mut self.last, &mut self.view);
    }

    /// Returns how many slots there are, free ones too. The number never shrinks.
    pub(super) fn count(&self) -> u32 {
        self.count
    }

    fn give(&mut self) -> u32 {
        self.free.pop().map_or_else(
            || {
                self.count += 1;
                self.count - 1
            },
            |Reverse(slot)| slot,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(slots: &mut BodySlots, ids: &[u32]) -> Vec<u32> {
        let given = ids.iter().map(|&id| slots.next(BodyId::persistent(id))).collect();
        slots.end_view();
        given
    }

    #[test]
    fn a_body_keeps_its_slot_while_others_come_and_go_before_and_after_it() {
        let mut slots = BodySlots::default();
        assert_eq!(view(&mut slots, &[3, 5, 7]), [0, 1, 2]);
        assert_eq!(view(&mut slots, &[1, 5, 9]), [3, 1, 4]);
        assert_eq!(view(&mut slots, &[5]), [1]);
        assert_eq!(view(&mut slots, &[4, 5, 6]), [0, 1, 2]);
        assert_eq!(slots.count(), 5);
    }

    #[test]
    fn a_slot_is_given_anew_only_after_a_view_in_which_it_is_free() {
        let mut slots = BodySlots::default();
        view(&mut slots, &[1]);
        assert_eq!(view(&mut slots, &[2]), [1], "slot 0 has just become free");
        assert_eq!(view(&mut slots, &[2, 3]), [1, 0]);
    }

    #[test]
    fn bodies_that_take_turns_for_ever_need_two_slots() {
        let mut slots = BodySlots::default();
        for id in 0..1000 {
            view(&mut slots, &[id]);
        }
        assert_eq!((slots.count(), slots.free.len(), slots.last.len()), (2, 1, 1));
    }
}
