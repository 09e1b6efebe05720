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

/// Persistent ids below this index pages. Higher ids, which a peer could choose, must not make their table
/// grow.
const DENSE: u32 = 1 << 24;
/// The number of ids on a page.
const PAGE: usize = 256;
/// Persistent ids below this are an array in snapshots.
const SAVED_DENSE: usize = 1 << 20;

/// The owner index. Low persistent ids are dense, so they index pages; the other bodies are few. Ids are not
/// given again, so pages whose bodies are all gone are freed.
#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(from = "Saved", into = "Saved")]
pub(super) struct OwnerIndex {
    pages: Vec<Option<Box<Page>>>,
    sparse: BTreeMap<BodyId, Home>,
    len: usize,
}

#[derive(Clone)]
struct Page {
    homes: [Option<Home>; PAGE],
    used: usize,
}

/// The form of an owner index in snapshots.
#[derive(Serialize, Deserialize)]
struct Saved {
    dense: Vec<Option<Home>>,
    sparse: BTreeMap<BodyId, Home>,
    len: usize,
}

impl OwnerIndex {
    #[inline]
    pub(super) fn home(&self, id: BodyId) -> Option<Home> {
        match dense_index(id) {
            Some(index) => self.pages.get(index / PAGE)?.as_ref()?.homes[index % PAGE],
            None => self.sparse.get(&id).copied(),
        }
    }

    /// Sets the place of a body. Inlined, so that `home` is not written to memory and read from there at
    /// once.
    #[inline]
    pub(super) fn set(&mut self, id: BodyId, home: Home) {
        let dense = dense_index(id);
        let page = dense.and_then(|index| self.pages.get_mut(index / PAGE)?.as_deref_mut());
        match (dense, page) {
            (Some(index), Some(page)) => {
                let is_new = usize::from(page.homes[index % PAGE].is_none());
                page.homes[index % PAGE] = Some(home);
                page.used += is_new;
                self.len += is_new;
            }
            _ => self.set_first(id, home.rank, home.handle),
        }
    }

    /// Sets the place of a body that is on no page yet, or never will be on one. The place is given in its
    /// parts, which lie in registers.
    #[cold]
    fn set_first(&mut self, id: BodyId, rank: usize, handle: RigidBodyHandle) {
        let home = Home { rank, handle };
        let Some(index) = dense_index(id) else {
            self.len += usize::from(self.sparse.insert(id, home).is_none());
            return;
        };
        if self.pages.len() <= index / PAGE {
            self.pages.resize(index / PAGE + 1, None);
        }
        let mut page = Box::new(Page { homes: [None; PAGE], used: 1 });
        page.homes[index % PAGE] = Some(home);
        self.pages[index / PAGE] = Some(page);
        self.len += 1;
    }

    pub(super) fn remove(&mut self, id: BodyId) {
        let before = match dense_index(id) {
            Some(index) => self.pages.get_mut(index / PAGE).and_then(|place| {
                let page = place.as_mut()?;
                let before = page.homes[index % PAGE].take()?;
                page.used -= 1;
                if page.used == 0 {
                    *place = None;
                }
                Some(before)
            }),
            None => self.sparse.remove(&id),
        };
        self.len -= usize::from(before.is_some());
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Returns all entries in id order: dense ids are the lowest.
    pub(super) fn homes(&self) -> impl Iterator<Item = (BodyId, Home)> {
        let pages =
            (0..).step_by(PAGE).zip(&self.pages).filter_map(|(first, page)| Some((first, page.as_ref()?)));
        let dense = pages.flat_map(|(first, page)| {
            #[cfg(test)]
            tests::LOOKS.set(tests::LOOKS.get() + PAGE);
            let homes = (first..).zip(&page.homes);
            homes.filter_map(|(index, home): (u32, _)| Some((BodyId::persistent(index), (*home)?)))
        });
        dense.chain(self.sparse.iter().map(|(&id, &home)| (id, home)))
    }
}

impl From<Saved> for OwnerIndex {
    fn from(Saved { dense, sparse, .. }: Saved) -> Self {
        let mut index = Self::default();
        let dense = (0..).zip(dense).filter_map(|(id, home)| Some((BodyId::persistent(id), home?)));
        dense.chain(sparse).for_each(|(id, home)| index.set(id, home));
        index
    }
}

impl From<OwnerIndex> for Saved {
    fn from(index: OwnerIndex) -> Self {
        let (mut dense, mut sparse) = (Vec::new(), BTreeMap::new());
        for (id, home) in index.homes() {
            match dense_index(id).filter(|&place| place < SAVED_DENSE) {
                Some(place) => {
                    dense.resize(place, None);
                    dense.push(Some(home));
                }
                None => _ = sparse.insert(id, home),
            }
        }
        Self { dense, sparse, len: index.len }
    }
}

#[inline]
fn dense_index(id: BodyId) -> Option<usize> {
    (id.bits() < u64::from(DENSE)).then_some(id.index() as usize)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::space::ClientId;

    thread_local! {
        pub(super) static LOOKS: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn of_many_bodies_that_are_gone_nothing_is_left_to_go_over() {
        let home = |rank| Home { rank, handle: RigidBodyHandle::from_raw_parts(7, 1) };
        let mut index = OwnerIndex::default();
        let kept = [5, 70_000, SAVED_DENSE as u32 + 9].map(BodyId::persistent);
        let avatar = BodyId::avatar(ClientId(3), 1);
        index.set(avatar, home(4));
        for id in (0..100_000).map(BodyId::persistent).chain([kept[2]]) {
            index.set(id, home(id.index() as usize));
        }
        assert_eq!(index.len(), 100_002);
        // A body that moves to another region is counted once.
        for id in [kept[0], avatar] {
            let before = index.home(id).unwrap();
            index.set(id, home(9));
            assert_eq!((index.home(id), index.len()), (Some(home(9)), 100_002));
            index.set(id, before);
        }
        for id in (0..100_000).map(BodyId::persistent).filter(|id| !kept.contains(id)) {
            index.remove(id);
            index.remove(id);
        }
        let left = [(kept[0], home(5)), (kept[1], home(70_000)), (kept[2], home(kept[2].index() as usize))];
        let left = [&left[..], &[(avatar, home(4))]].concat();
        let before = LOOKS.get();
        assert_eq!(index.homes().collect::<Vec<_>>(), left);
        assert_eq!(LOOKS.get() - before, 3 * PAGE);
        assert_eq!(
            (index.len(), index.home(kept[1]), index.home(BodyId::persistent(6))),
            (4, Some(home(70_000)), None)
        );
        // A snapshot holds what it held before there were pages.
        let saved = Saved::from(index.clone());
        assert_eq!((saved.dense.len(), saved.sparse.len(), saved.len), (70_001, 2, 4));
        let again = OwnerIndex::from(saved);
        assert_eq!((again.homes().collect::<Vec<_>>(), again.len()), (left, 4));
    }
}
