//! Makes and resolves handles: numbers that name things for C, and that stay stale for ever once their thing is gone.

use std::collections::BTreeMap;

use dcd::query::ShapeHash;
use dcd::runtime::ConnectionId;
use dcd::space::{BodyId, JointId};

use crate::ids::{DcdBodyId, DcdCheckpointId, DcdConnectionId, DcdJointId, DcdQueryId, DcdShapeId};
use crate::status::{DCD_ERR_NULL, DCD_ERR_STALE_ID, Failure};

/// Things by index and generation. The generation grows when a place is used again.
#[derive(Debug)]
pub(crate) struct Slots<T> {
    entries: Vec<Entry<T>>,
    free: Vec<u32>,
}

#[derive(Debug)]
struct Entry<T> {
    generation: u32,
    value: Option<T>,
}

impl<T> Slots<T> {
    pub(crate) const fn new() -> Self {
        Self { entries: Vec::new(), free: Vec::new() }
    }

    /// Adds a thing and returns its handle, which is never 0 and never given again.
    pub(crate) fn insert(&mut self, value: T) -> u64 {
        let place = self.free.pop().unwrap_or_else(|| {
            self.entries.push(Entry { generation: 0, value: None });
            (self.entries.len() - 1) as u32
        });
        let entry = &mut self.entries[place as usize];
        entry.value = Some(value);
        (u64::from(entry.generation) << 32) | u64::from(place + 1)
    }

    pub(crate) fn get(&self, handle: u64) -> Option<&T> {
        self.entries.get(self.place(handle)?)?.value.as_ref()
    }

    pub(crate) fn get_mut(&mut self, handle: u64) -> Option<&mut T> {
        let place = self.place(handle)?;
        self.entries.get_mut(place)?.value.as_mut()
    }

    pub(crate) fn remove(&mut self, handle: u64) -> Option<T> {
        let place = self.place(handle)?;
        let entry = &mut self.entries[place];
        let value = entry.value.take()?;
        // A place whose generations are used up is not used again.
        if let Some(next) = entry.generation.checked_add(1) {
            entry.generation = next;
            self.free.push(place as u32);
        }
        Some(value)
    }

    fn place(&self, handle: u64) -> Option<usize> {
        let place = (handle as u32).checked_sub(1)? as usize;
        let entry = self.entries.get(place)?;
        (entry.generation == (handle >> 32) as u32).then_some(place)
    }
}

/// Handles of shapes that were looked up, so that each shape has one.
#[derive(Debug, Default)]
pub(crate) struct LookedUp {
    slots: BTreeMap<ShapeHash, u64>,
    /// The shape that each handle is of.
    shapes: BTreeMap<u64, ShapeHash>,
    /// The number of handles when unused ones were last forgotten.
    kept: usize,
}

impl LookedUp {
    pub(crate) fn slot(&self, shape: ShapeHash) -> Option<u64> {
        self.slots.get(&shape).copied()
    }

    pub(crate) fn remember(&mut self, shape: ShapeHash, slot: u64) {
        self.slots.insert(shape, slot);
        self.shapes.insert(slot, shape);
    }

    /// Returns whether there are so many more handles than were kept last that it is worth looking which are used.
    pub(crate) fn has_grown(&self) -> bool {
        /// Number of unused handles that may always be there.
        const UNUSED: usize = 8;
        self.slots.len() > 2 * self.kept + UNUSED
    }

    /// Forgets the handles that are not used, and returns them.
    pub(crate) fn take_unused(&mut self, is_used: impl Fn(ShapeHash, u64) -> bool) -> Vec<u64> {
        let unused = self.shapes.iter().filter(|&(&slot, &shape)| !is_used(shape, slot));
        let unused: Vec<_> = unused.map(|(&slot, _)| slot).collect();
        unused.iter().for_each(|&slot| self.forget(slot));
        self.kept = self.slots.len();
        unused
    }

    /// Forgets a handle that is about to go stale.
    pub(crate) fn forget(&mut self, slot: u64) {
        self.shapes.remove(&slot).map(|shape| self.slots.remove(&shape));
    }
}

/// Number with which the handles of one world are mixed, so that another world does not know them.
///
/// A body's id has 64 bits, and all may be in use: the upper half names a client, 0 in a local world. The mark is added to that
/// half without carry. In another world the handle then names a body of a client that is not there. In a local world that always
/// holds. Marks are far apart, and clients are numbered from 1, so the same holds for a served world, but for chance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mark(u32);

impl Mark {
    /// Returns the mark of the `count`-th world of this process.
    pub(crate) fn new(count: u32) -> Self {
        // Fibonacci hashing: the factor is odd, so no two of 2³² counts share a mark.
        Self(count.wrapping_mul(0x9E37_79B9))
    }

    fn mix(self, bits: u64) -> u64 {
        bits ^ (u64::from(self.0) << 32)
    }

    /// Returns the handle of a body. It is not 0: the index of a body is never `u32::MAX`, so its lower half is not 0.
    pub(crate) fn body(self, id: BodyId) -> DcdBodyId {
        DcdBodyId { v: self.mix(id.bits() + 1) }
    }

    pub(crate) fn body_id(self, body: DcdBodyId) -> Result<BodyId, Failure> {
        let bits = self.mix(not_null(body.v, "body")?);
        bits.checked_sub(1).map(BodyId::from_bits).ok_or_else(|| stale("body", body.v))
    }

    pub(crate) fn joint(self, id: JointId) -> DcdJointId {
        DcdJointId { v: self.mix(id.0 + 1) }
    }

    pub(crate) fn joint_id(self, joint: DcdJointId) -> Result<JointId, Failure> {
        let bits = self.mix(not_null(joint.v, "joint")?);
        bits.checked_sub(1).map(JointId).ok_or_else(|| stale("joint", joint.v))
    }

    /// Returns the handle of a connection. Connections are numbered from 1.
    pub(crate) fn connection(self, id: ConnectionId) -> DcdConnectionId {
        DcdConnectionId { v: self.mix(id.0) }
    }

    pub(crate) fn connection_id(self, connection: DcdConnectionId) -> Result<ConnectionId, Failure> {
        Ok(ConnectionId(self.mix(not_null(connection.v, "connection")?)))
    }

    pub(crate) fn shape(self, slot: u64) -> DcdShapeId {
        DcdShapeId { v: self.mix(slot) }
    }

    pub(crate) fn checkpoint(self, slot: u64) -> DcdCheckpointId {
        DcdCheckpointId { v: self.mix(slot) }
    }

    pub(crate) fn checkpoint_slot(self, checkpoint: DcdCheckpointId) -> Result<u64, Failure> {
        Ok(self.mix(not_null(checkpoint.v, "checkpoint")?))
    }

    pub(crate) fn query(self, slot: u64) -> DcdQueryId {
        DcdQueryId { v: self.mix(slot) }
    }

    pub(crate) fn query_slot(self, query: DcdQueryId) -> Result<u64, Failure> {
        Ok(self.mix(not_null(query.v, "query")?))
    }

    pub(crate) fn shape_slot(self, shape: DcdShapeId) -> Result<u64, Failure> {
        Ok(self.mix(not_null(shape.v, "shape")?))
    }
}

pub(crate) fn not_null(v: u64, what: &str) -> Result<u64, Failure> {
    if v == 0 { Err(null(what)) } else { Ok(v) }
}

#[cold]
fn null(what: &str) -> Failure {
    Failure::new(DCD_ERR_NULL, format!("the {what} is null (v is 0); create one first"))
}

#[cold]
pub(crate) fn stale(what: &str, v: u64) -> Failure {
    Failure::new(
        DCD_ERR_STALE_ID,
        format!(
            "{what} {v:#x} is not here: it was destroyed, or belongs to another world; forget the handle"
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use dcd::space::ClientId;

    #[test]
    fn a_place_used_again_has_another_handle() {
        let mut slots = Slots::new();
        let first = slots.insert('a');
        assert_eq!(slots.remove(first), Some('a'));
        let second = slots.insert('b');
        assert_ne!(first, second);
        assert_eq!((slots.get(first), slots.get(second)), (None, Some(&'b')));
        assert_eq!(slots.remove(first), None);
        assert_eq!(slots.get(0), None);
        assert_eq!(slots.get(u64::MAX), None);
    }

    #[test]
    fn a_shape_that_was_looked_up_is_forgotten_with_its_handle() {
        let [one, other] = [1, 2].map(|byte| ShapeHash([byte; 16]));
        let mut known = LookedUp::default();
        known.remember(one, 5);
        known.remember(other, 6);
        known.forget(7);
        known.forget(5);
        assert_eq!((known.slot(one), known.slot(other)), (None, Some(6)));
        assert_eq!((known.slots.len(), known.shapes.len()), (1, 1), "both ways");
    }

    #[test]
    fn shapes_that_were_looked_up_and_are_not_used_any_more_are_forgotten_now_and_then() {
        let (mut known, mut most, mut looks) = (LookedUp::default(), 0, 0);
        for slot in 0..1000_u64 {
            if known.has_grown() {
                looks += 1;
                let unused = known.take_unused(|shape, other| {
                    assert_eq!(u64::from(shape.0[0]), other % 256);
                    other + 10 > slot
                });
                assert!(unused.iter().all(|other| !known.shapes.contains_key(other)));
            }
            let mut name = [0; 16];
            name[..8].copy_from_slice(&slot.to_le_bytes());
            known.remember(ShapeHash(name), slot);
            most = most.max(known.slots.len());
        }
        assert_eq!(known.slots.len(), known.shapes.len());
        assert!(most < 40 && looks < 100, "{most} kept, looked {looks} times");
    }

    #[test]
    fn ids_survive_the_way_to_c_and_back() {
        let mark = Mark::new(3);
        for id in [BodyId::persistent(0), BodyId::persistent(u32::MAX - 1), BodyId::avatar(ClientId(9), 4)] {
            assert_ne!(mark.body(id).v, 0);
            assert_eq!(mark.body_id(mark.body(id)).unwrap(), id);
        }
    }

    #[test]
    fn a_handle_of_another_world_names_a_client_that_is_not_there() {
        for other in 1..1000 {
            let body = Mark::new(other).body(BodyId::persistent(5));
            let seen = Mark::new(other + 1).body_id(body).unwrap();
            let client = seen.client().or_else(|| seen.builder());
            assert!(client.is_some_and(|client| client.0 > 1_000_000), "{seen}");
        }
    }
}
