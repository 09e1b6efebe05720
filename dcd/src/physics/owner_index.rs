//! Finds the owner's copy of each body by id. The owner index is looked up once per call of a user, never per body and step.

use std::collections::BTreeMap;

use rapier3d::prelude::RigidBodyHandle;
use serde::{Deserialize, Serialize};

use crate::space::BodyId;

/// The place of the owner's copy of a body: rank of the region and Rapier's handle there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Home {
    pub rank: usize,
    pub handle: RigidBodyHandle,
}

/// Persistent ids below this index an array; higher ones, which a peer could choose, must not make it grow.
const DENSE: u32 = 1 << 20;

/// The owner index. Low persistent ids are dense, so they index an array; the other bodies are few.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct OwnerIndex {
    dense: Vec<Option<Home>>,
    sparse: BTreeMap<BodyId, Home>,
    len: usize,
}

impl OwnerIndex {
    #[inline]
    pub(super) fn home(&self, id: BodyId) -> Option<Home> {
        match dense_index(id) {
            Some(index) => *self.dense.get(index)?,
            None => self.sparse.get(&id).copied(),
        }
    }

    pub(super) fn set(&mut self, id: BodyId, home: Home) {
        let before = match dense_index(id) {
            Some(index) => {
                if self.dense.len() <= index {
                    self.dense.resize(index + 1, None);
                }
                self.dense[index].replace(home)
            }
            None => self.sparse.insert(id, home),
        };
        self.len += usize::from(before.is_none());
    }

    pub(super) fn remove(&mut self, id: BodyId) {
        let before = match dense_index(id) {
            Some(index) => self.dense.get_mut(index).and_then(Option::take),
            None => self.sparse.remove(&id),
        };
        self.len -= usize::from(before.is_some());
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Returns all entries in id order: dense ids are the lowest.
    pub(super) fn homes(&self) -> impl Iterator<Item = (BodyId, Home)> {
        let dense = self
            .dense
            .iter()
            .enumerate()
            .filter_map(|(index, home)| Some((BodyId::persistent(index as u32), (*home)?)));
        dense.chain(self.sparse.iter().map(|(&id, &home)| (id, home)))
    }
}

#[inline]
fn dense_index(id: BodyId) -> Option<usize> {
    (id.bits() < u64::from(DENSE)).then_some(id.index() as usize)
}
