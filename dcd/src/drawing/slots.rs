//! Gives each drawn body a slot: a small number that no other body gets while pictures that show the body are
//! kept.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::space::BodyId;

/// The number of frames for which a body that got a new slot for a new look keeps this slot, however its look
/// changes. A body that changes in every tick thus does not take a slot for each change.
const CHANGED_FRAMES: u64 = 60;

/// The slots of bodies, in id order. A body whose look changes gets a new slot, unless it got one for that
/// reason less than [`CHANGED_FRAMES`] frames before.
#[derive(Default)]
pub(crate) struct Slots {
    /// The bodies, each with a hash of its look.
    ids: Vec<(BodyId, u64)>,
    slots: Arc<Vec<u32>>,
    /// The frame in which each last got a new slot for a new look.
    changed: Vec<Option<u64>>,
    /// Slots of bodies that went, each with the frame in which its body went, the oldest first.
    free: VecDeque<(u64, u32)>,
    count: u32,
}

/// The bodies that came, and the slots that became empty.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Change {
    /// Bodies and their new slots, or the slots that they keep although their look has changed.
    pub(crate) came: Vec<(BodyId, u32)>,
    /// Slots that are empty now.
    pub(crate) went: Vec<u32>,
}

impl Slots {
    /// Returns the slots of the bodies, in id order.
    pub(crate) fn in_order(&self) -> &Arc<Vec<u32>> {
        &self.slots
    }

    /// Returns how many slots there are, empty ones too.
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    /// Returns whether exactly these bodies, with these looks, have slots.
    pub(crate) fn are(&self, ids: &[(BodyId, u64)]) -> bool {
        self.ids == ids
    }

    /// Returns the slot of a body.
    pub(crate) fn of(&self, id: BodyId) -> Option<u32> {
        Some(self.slots[self.ids.binary_search_by_key(&id, |(id, _)| *id).ok()?])
    }

    /// Empties all slots, since no picture is kept of what was in them. Returns how many there were.
    pub(crate) fn clear(&mut self) -> u32 {
        std::mem::take(self).count
    }

    /// Updates the slots to the bodies of a frame, given in id order with their looks. A slot that became
    /// empty is given again only after more than `kept` frames: until then, pictures of its former body are
    /// kept.
    pub(crate) fn update(&mut self, now: &[(BodyId, u64)], frame: u64, kept: u64) -> Change {
        let mut change = Change::default();
        if self.are(now) {
            return change;
        }
        let (mut slots, mut changed) = (Vec::with_capacity(now.len()), Vec::with_capacity(now.len()));
        let before = self.ids.iter().zip(self.slots.iter().zip(&self.changed));
        let mut before = before.map(|(&(id, look), (&slot, &changed))| (id, look, slot, changed)).peekable();
        for &(id, look) in now {
            while let Some((_, _, slot, _)) = before.next_if(|former| former.0 < id) {
                change.went.push(slot);
            }
            let former = before.next_if(|former| former.0 == id);
            if let Some((_, former, slot, when)) = former
                && (former == look || when.is_some_and(|when| frame < when + CHANGED_FRAMES))
            {
                change.came.extend((former != look).then_some((id, slot)));
                slots.push(slot);
                changed.push(when);
                continue;
            }
            change.went.extend(former.map(|(_, _, slot, _)| slot));
            let slot = match self.free.front() {
                Some(&(went, slot)) if went + kept < frame => {
                    self.free.pop_front();
                    slot
                }
                _ => {
                    self.count += 1;
                    self.count - 1
                }
            };
            slots.push(slot);
            changed.push(former.map(|_| frame));
            change.came.push((id, slot));
        }
        change.went.extend(before.map(|(_, _, slot, _)| slot));
        self.free.extend(change.went.iter().map(|&slot| (frame, slot)));
        self.ids = now.to_vec();
        self.slots = Arc::new(slots);
        self.changed = changed;
        change
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(numbers: &[u32]) -> Vec<(BodyId, u64)> {
        numbers.iter().map(|&number| (BodyId::persistent(number), 0)).collect()
    }

    #[test]
    fn bodies_keep_their_slots_while_others_come_and_go() {
        let mut slots = Slots::default();
        let change = slots.update(&ids(&[3, 5]), 1, 10);
        assert_eq!(change.came, [(BodyId::persistent(3), 0), (BodyId::persistent(5), 1)]);
        let change = slots.update(&ids(&[1, 5, 9]), 2, 10);
        assert_eq!(change.came, [(BodyId::persistent(1), 2), (BodyId::persistent(9), 3)]);
        assert_eq!((change.went, &slots.in_order()[..]), (vec![0], &[2, 1, 3][..]));
        assert_eq!((slots.of(BodyId::persistent(5)), slots.of(BodyId::persistent(3))), (Some(1), None));
    }

    #[test]
    fn a_body_that_looks_otherwise_has_another_slot() {
        let mut slots = Slots::default();
        let body = BodyId::persistent(3);
        for (appearance, frame, slot, went) in
            [(5, 0, 0, vec![]), (7, 2, 2, vec![0]), (4, 2 + CHANGED_FRAMES, 3, vec![2])]
        {
            let change = slots.update(&[(body, appearance), (BodyId::persistent(4), 6)], frame, 10_000);
            assert_eq!((change.came[0], change.went, slots.of(body)), ((body, slot), went, Some(slot)));
        }
    }

    #[test]
    fn a_body_that_looks_otherwise_in_every_frame_takes_few_slots_and_is_told_each_time() {
        let mut slots = Slots::default();
        let body = BodyId::persistent(3);
        for frame in 0..1_000 {
            let change = slots.update(&[(body, frame)], frame, 2_400);
            assert_eq!(change.came, [(body, slots.of(body).unwrap())]);
        }
        assert!(slots.count() <= 2 + 1_000 / CHANGED_FRAMES as u32, "{}", slots.count());
    }

    #[test]
    fn bodies_that_come_and_go_while_slots_are_cleared_take_as_many_slots_as_there_are_bodies() {
        let mut slots = Slots::default();
        for round in 0..5 {
            slots.update(&ids(&[1, 2, 3, 10 + round]), 2 * u64::from(round), 2_400);
            assert_eq!(slots.count(), 4);
            assert_eq!(slots.clear(), 4);
            let change = slots.update(&ids(&[2, 7]), 2 * u64::from(round) + 1, 2_400);
            assert_eq!(change.came, [(BodyId::persistent(2), 0), (BodyId::persistent(7), 1)]);
            assert_eq!(slots.clear(), 2);
        }
    }

    #[test]
    fn a_slot_is_given_again_once_no_picture_shows_what_was_in_it() {
        let mut slots = Slots::default();
        slots.update(&ids(&[1]), 1, 10);
        slots.update(&ids(&[]), 2, 10);
        assert_eq!(slots.update(&ids(&[2]), 12, 10).came, [(BodyId::persistent(2), 1)]);
        assert_eq!(slots.update(&ids(&[2, 3]), 13, 10).came, [(BodyId::persistent(3), 0)]);
        assert_eq!(slots.count(), 2);
    }
}
