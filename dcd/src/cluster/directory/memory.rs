//! Keeps a directory in memory and simulates which batches a disk would have kept after a crash.

use std::collections::BTreeMap;

use super::{Batch, Condition, Directory, DirectoryError, Entry, Key, Revision, Tenure};

/// A directory in memory, for the simulator and for worlds that need not outlive their server.
#[derive(Clone, Debug, Default)]
pub struct MemoryDirectory {
    now: State,
    /// The entries as of the last durable batch.
    synced: State,
    /// Batches committed since then, in order.
    unsynced: Vec<Batch>,
}

#[derive(Clone, Debug, Default)]
struct State {
    revision: Revision,
    entries: BTreeMap<Key, (Revision, Vec<u8>)>,
}

impl State {
    fn write(&mut self, batch: &Batch) -> Revision {
        self.revision.0 += 1;
        for (key, value) in &batch.writes {
            match value {
                Some(value) => self.entries.insert(*key, (self.revision, value.clone())),
                None => self.entries.remove(key),
            };
        }
        self.revision
    }
}

impl MemoryDirectory {
    /// Returns an empty directory.
    pub fn new() -> Self {
        Self::default()
    }

    /// Simulates a crash of the machine. Of the batches since the last durable one, in order, keeps those
    /// that `keep_unsynced` accepts, up to the first that it refuses: a disk may have got any number of them,
    /// but none without all before it.
    pub fn crash(&mut self, mut keep_unsynced: impl FnMut(&Batch) -> bool) {
        for batch in std::mem::take(&mut self.unsynced) {
            if !keep_unsynced(&batch) {
                break;
            }
            self.synced.write(&batch);
        }
        self.now = self.synced.clone();
    }

    /// Returns how many batches a crash could undo.
    pub fn unsynced(&self) -> usize {
        self.unsynced.len()
    }
}

impl Directory for MemoryDirectory {
    fn load(&mut self) -> Result<Vec<Entry>, DirectoryError> {
        let entries = self.now.entries.iter();
        Ok(entries
            .map(|(&key, (revision, value))| Entry { key, revision: *revision, value: value.clone() })
            .collect())
    }

    fn commit(&mut self, batch: &Batch, conditions: &[Condition]) -> Result<Revision, DirectoryError> {
        for &Condition { key, at } in conditions {
            let found = self.now.entries.get(&key).map(|(revision, _)| *revision);
            if found != at {
                return Err(DirectoryError::Changed { key, expected: at, found });
            }
        }
        let revision = self.now.write(batch);
        self.unsynced.push(batch.clone());
        if batch.durable {
            for batch in self.unsynced.drain(..) {
                self.synced.write(&batch);
            }
        }
        Ok(revision)
    }

    fn renew(&mut self) -> Result<Tenure, DirectoryError> {
        Ok(Tenure::WhileOpen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::directory::conformance::{self, body, values};

    /// Reopens a directory as after a process's crash, in which the simulated disk loses nothing.
    #[test]
    fn it_does_what_a_directory_does() {
        conformance::all(&|| MemoryDirectory::new(), &|mut directory| {
            directory.crash(|_| true);
            directory
        });
    }

    #[test]
    fn a_crash_keeps_all_durable_batches_and_none_behind_a_gap() {
        for kept in 0..=3 {
            let mut directory = MemoryDirectory::new();
            directory.commit(&body(1, 10, false), &[]).unwrap();
            directory.commit(&body(2, 20, true), &[]).unwrap();
            for i in 3..6 {
                directory.commit(&body(i, 0, false), &[]).unwrap();
            }
            directory.commit(&body(1, 11, false), &[]).unwrap();
            assert_eq!(directory.unsynced(), 4);
            let mut asked = 0;
            directory.crash(|_| {
                asked += 1;
                asked <= kept
            });
            let mut expected = vec![(1, 10), (2, 20)];
            expected.extend((3..3 + u32::try_from(kept).unwrap()).map(|i| (i, 0)));
            assert_eq!((values(&mut directory), asked), (expected, kept + 1));
            assert_eq!(directory.unsynced(), 0);
            directory.crash(|_| unreachable!("nothing is left to be lost"));
        }
    }
}
