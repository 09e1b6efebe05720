//! Keeps shapes that no body has any more for as long as a message that names one may be on its way, and
//! keeps their names until nodes are told.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use super::budget::kept_len;
use crate::protocol::link::CLIENT_IDLE_TIMEOUT;
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord, encoded_len};

/// The bytes of shapes that must come before all bodies are searched for shapes that nobody has.
const ROOM: usize = 4 << 20;
/// The same per body on record, if that is more: a search of many bodies takes long.
const ROOM_PER_BODY: usize = 16;
/// The longest time for which a message that names a shape may be on its way: a link that is silent for
/// longer is gone.
const UNDERWAY: Duration = CLIENT_IDLE_TIMEOUT;

/// Shapes that no body has and that are being forgotten.
#[derive(Clone, Debug, Default)]
pub(super) struct Fading {
    /// Bytes of shapes that have come since the last search of all bodies.
    come: usize,
    /// Shapes that the record and clients have forgotten, and when they did. None of them is on record.
    shapes: BTreeMap<ShapeHash, (Duration, ShapeRecord)>,
    /// The same shapes in order of time. Some may be on record again.
    since: VecDeque<(Duration, Vec<ShapeHash>)>,
    /// Names of shapes that nobody can ask for any more and that nodes have not forgotten yet. None of them
    /// is on record.
    owed: BTreeSet<ShapeHash>,
}

impl Fading {
    /// Returns whether nothing is being forgotten.
    #[cfg(test)]
    pub(super) fn is_at_rest(&self) -> bool {
        self.shapes.is_empty() && self.owed.is_empty()
    }

    /// Notes shapes that have come on record.
    pub(super) fn have_come(&mut self, new: &[ShapeRecord]) {
        for shape in new {
            self.come = self.come.saturating_add(kept_len(shape));
            if !self.shapes.is_empty() || !self.owed.is_empty() {
                let hash = shape.hash();
                self.shapes.remove(&hash);
                self.owed.remove(&hash);
            }
        }
    }

    /// Returns whether enough bytes have come to make a search of so many bodies worthwhile.
    pub(super) fn is_crowded(&self, bodies: usize) -> bool {
        self.come >= ROOM.max(ROOM_PER_BODY * bodies)
    }

    /// Takes in the shapes that no body has, after a search of all bodies. `used` are the shapes that bodies
    /// have.
    pub(super) fn begin(
        &mut self,
        now: Duration,
        gone: BTreeMap<ShapeHash, ShapeRecord>,
        used: &BTreeSet<ShapeHash>,
    ) {
        self.come = 0;
        // A world that replaced another may have brought some back.
        self.shapes.retain(|hash, _| !used.contains(hash));
        self.owed.retain(|hash| !used.contains(hash));
        if !gone.is_empty() {
            self.since.push_back((now, gone.keys().copied().collect()));
            self.shapes.extend(gone.into_iter().map(|(hash, shape)| (hash, (now, shape))));
        }
    }

    /// Forgets the shapes that nobody can be asking for any more, but not their names. Returns the names, in
    /// order.
    pub(super) fn end(&mut self, now: Duration) -> BTreeSet<ShapeHash> {
        let mut ended = BTreeSet::new();
        while self.since.front().is_some_and(|(since, _)| *since + UNDERWAY <= now) {
            let Some((since, names)) = self.since.pop_front() else { break };
            for name in names {
                // The shape may have come and gone again since.
                if self.shapes.get(&name).is_some_and(|(last, _)| *last == since) {
                    self.shapes.remove(&name);
                    ended.insert(name);
                }
            }
        }
        self.owed.extend(&ended);
        ended
    }

    /// Returns whether nodes are to be told of any names.
    pub(super) fn owes(&self) -> bool {
        !self.owed.is_empty()
    }

    /// Takes the names that nodes are to be told.
    pub(super) fn take_owed(&mut self) -> BTreeSet<ShapeHash> {
        std::mem::take(&mut self.owed)
    }

    /// Adds to the shapes that come with new bodies those shapes of these bodies that are being forgotten and
    /// take at most `bytes`. Whoever asked for the bodies may not have heard that the shapes are gone.
    pub(super) fn bring_back(&self, bodies: &[BodyRecord], shapes: &mut Vec<ShapeRecord>, bytes: usize) {
        if self.shapes.is_empty() {
            return;
        }
        let brought: BTreeMap<_, _> = shapes.iter().map(|shape| (shape.hash(), shape)).collect();
        let fading = |hash: &ShapeHash| {
            self.shapes.get(hash).map(|(_, shape)| shape).filter(|shape| encoded_len(shape) <= bytes)
        };
        let colliders = bodies.iter().flat_map(|body| &body.traits.colliders);
        let mut named: BTreeSet<_> = colliders.map(|collider| collider.shape).collect();
        let known = named.iter().filter_map(|hash| brought.get(hash).copied().or_else(|| fading(hash)));
        let parts: Vec<_> = known.flat_map(ShapeRecord::parts).collect();
        named.extend(parts);
        let back = named.iter().filter(|hash| !brought.contains_key(hash)).filter_map(fading);
        let back: Vec<_> = back.cloned().collect();
        shapes.extend(back);
        // Parts come before compounds.
        shapes.sort_by_key(ShapeRecord::is_compound);
    }
}
