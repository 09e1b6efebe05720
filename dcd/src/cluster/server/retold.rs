//! Keeps what the server's program, or a builder, took away or altered, and what is written down of that. No
//! node says what it knows of these changes. So each new leader is told of them again, also by a restarted
//! server.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::cluster::Key;
use crate::space::Tick;

/// The time after which a leader that goes on has surely heard what it was told.
const SURELY_HEARD: Duration = Duration::from_secs(5);

/// The time at which a leader was told, and the tick that it was at once it had surely heard.
#[derive(Clone, Copy, Debug)]
struct Told {
    at: Duration,
    heard_by: Option<Tick>,
}

/// The changes that leaders are told again, each by the key of its entry in the directory.
#[derive(Clone, Debug, Default)]
pub(super) struct Retold {
    /// Changes that are told again until a leader has surely done them.
    until_done: BTreeMap<Key, Told>,
    /// Changes that are told again for as long as the body or joint is there.
    always: BTreeSet<Key>,
    /// Changes whose entries are to be written down, or deleted.
    changes: BTreeSet<Key>,
}

impl Retold {
    /// Returns the changes that another server has written down, as far as they still hold.
    pub(super) fn restored(keys: BTreeSet<Key>, is_so: impl Fn(Key) -> bool) -> Self {
        let mut retold = Self::default();
        for key in keys {
            match key {
                _ if !is_so(key) => _ = retold.changes.insert(key),
                Key::AlteredBody(_) | Key::AlteredJoint(_) => _ = retold.always.insert(key),
                key => _ = retold.until_done.insert(key, Told { at: Duration::ZERO, heard_by: None }),
            }
        }
        retold
    }

    /// Adds a change that is told now, and again until it is done.
    pub(super) fn add(&mut self, key: Key, now: Duration) {
        self.changes.extend(Some(key).filter(|key| !self.until_done.contains_key(key)));
        self.until_done.insert(key, Told { at: now, heard_by: None });
    }

    /// Adds a change that is told again for as long as its body or joint is there.
    pub(super) fn keep(&mut self, key: Key) {
        self.changes.extend(Some(key).filter(|key| self.always.insert(*key)));
    }

    /// Forgets a change whose body or joint is gone.
    pub(super) fn forget(&mut self, key: Key) {
        let was_there = self.until_done.remove(&key).is_some() | self.always.remove(&key);
        self.changes.extend(Some(key).filter(|_| was_there));
    }

    pub(super) fn contains(&self, key: Key) -> bool {
        self.until_done.contains_key(&key) || self.always.contains(&key)
    }

    /// Returns all changes, in the order of their keys.
    pub(super) fn keys(&self) -> BTreeSet<Key> {
        self.until_done.keys().chain(&self.always).copied().collect()
    }

    /// Forgets the changes whose bodies or joints are not there any more.
    pub(super) fn retain(&mut self, is_there: impl Fn(Key) -> bool) {
        for key in self.keys().into_iter().filter(|key| !is_there(*key)) {
            self.until_done.remove(&key);
            self.always.remove(&key);
            self.changes.insert(key);
        }
    }

    /// Notes that a leader is told all changes now.
    pub(super) fn is_told(&mut self, now: Duration) {
        for told in self.until_done.values_mut() {
            *told = Told { at: now, heard_by: None };
        }
    }

    /// Takes in the tick that the leader has reached. The leader has opened no tick more than `ahead` beyond
    /// it. A change is done once a tick is done that the leader opened after it had surely heard of the
    /// change. That it heard of it long ago is not enough, as it may have waited for one tick ever since.
    pub(super) fn leader_is_at(&mut self, now: Duration, tick: Tick, ahead: u64) {
        let is_done = |told: &mut Told| {
            now >= told.at + SURELY_HEARD && tick.0 > told.heard_by.get_or_insert(tick).0 + ahead
        };
        let done = self.until_done.iter_mut().filter_map(|(&key, told)| is_done(told).then_some(key));
        let done: Vec<_> = done.collect();
        self.until_done.retain(|key, _| done.binary_search(key).is_err());
        self.changes.extend(done);
    }

    /// Forgets all changes, as the world is another.
    pub(super) fn clear(&mut self) {
        self.retain(|_| false);
    }

    /// Notes that these changes are written down from now on, in place of those of another group.
    pub(super) fn replaces(&mut self, other: &Self) {
        self.changes.extend(other.keys());
        self.changes.extend(other.changes.iter().chain(&self.keys()));
    }

    /// Returns what has changed since the last call, as writes. Deletions of entries wait for a call that is
    /// `soft`.
    pub(super) fn take_writes(&mut self, soft: bool) -> Vec<(Key, Option<Vec<u8>>)> {
        let changes = std::mem::take(&mut self.changes);
        let (now, later) = changes.into_iter().partition(|key| soft || self.contains(*key));
        self.changes = later;
        let now: BTreeSet<Key> = now;
        now.into_iter().map(|key| (key, self.contains(key).then(Vec::new))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{BodyId, JointId};

    #[test]
    fn what_a_leader_did_is_forgotten_once_a_tick_is_done_that_it_opened_after_it_heard_of_it() {
        let (gone, altered) = (Key::GoneJoint(JointId(1)), Key::AlteredBody(BodyId::persistent(1)));
        let mut retold = Retold::default();
        retold.add(gone, Duration::ZERO);
        retold.keep(altered);
        assert_eq!(retold.take_writes(false), [(gone, Some(Vec::new())), (altered, Some(Vec::new()))]);
        let at = |retold: &mut Retold, seconds, tick| {
            retold.leader_is_at(Duration::from_secs(seconds), Tick(tick), 1);
            retold.contains(gone)
        };
        assert!(at(&mut retold, 4, 100), "it may not have heard it");
        assert!(at(&mut retold, 60, 101), "it may have opened this tick long before it heard it");
        assert!(at(&mut retold, 61, 102), "and this one as it did");
        retold.is_told(Duration::from_secs(61));
        assert!(at(&mut retold, 62, 200), "another leader");
        assert!(at(&mut retold, 67, 201) && !at(&mut retold, 67, 203));
        assert_eq!(retold.take_writes(false), [], "that is of no hurry");
        assert_eq!(retold.take_writes(true), [(gone, None)]);
        assert_eq!(retold.keys(), [altered].into());
    }
}
