//! Stores a server's directory in an etcd cluster, so that another server can go on with the world when this
//! one dies.
//!
//! A world is a log of *segments*: batches of entries in order, of which newer ones win. Its *head* names the
//! segments that count. A save writes the next segment and, in one transaction with the segment's last part,
//! a head that counts it. Once the log is much longer than the entries in it, all entries are written as one
//! segment, from which the head counts on. So a batch of any size is stored whole or not at all, although a
//! transaction of etcd takes 128 writes and 1.5 MiB, and thousands of bodies take a few keys. Entries are
//! kept in memory as well: they are read from etcd once, by the server that takes over.
//!
//! | key, after `dcd/NAME/` | value |
//! |---|---|
//! | `holder` | who holds the world ([`lease`]) |
//! | `authority` | the authority's key and certificate, as in `authority.pem` |
//! | `head` | format, last revision, first segment, the one after the last |
//! | `log/SEGMENT/PART` | a part of a segment |
//! | `joins/NUMBER` | lines of the record of joins ([`journal`]) |

mod address;
mod gateway;
mod glance;
mod journal;
mod keys;
mod lease;
mod login;
mod segment;
#[cfg(test)]
mod tests;
mod tls;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use self::gateway::Op;
use self::keys::{Hold, Keys, VALUE_BYTES};
use self::lease::Lease;
use crate::cluster::directory::{Batch, Condition, Directory, DirectoryError, Entry, Key, Revision, Tenure};

pub(super) use self::address::EtcdAddress;
pub(super) use self::glance::Glance;
pub(super) use self::journal::EtcdJournal;
pub(super) use self::lease::Wait;

/// The format of head and segments. A world of another format is refused.
const FORMAT: u64 = 6;
/// A commit saves batches that are not durable, too, if the last save was this long ago.
const UNSAVED: Duration = Duration::from_secs(1);
/// The log is begun anew once it has this many times the bytes of the entries in it,
const LOG_RATIO: usize = 3;
/// and more bytes than this.
const LOG_BYTES: usize = 1 << 20;

/// A world in etcd that this server does not hold yet.
pub(super) struct EtcdWorld {
    keys: Keys,
}

/// The directory of a world in etcd, held by this server.
///
/// A batch that is not durable stays in memory until a durable batch comes, or any batch a second after the
/// last save.
pub(super) struct EtcdDirectory {
    hold: Hold,
    lease: Lease,
    head: Head,
    /// The head as it is stored.
    stored: Option<Vec<u8>>,
    /// All entries, including those that are not saved yet.
    entries: BTreeMap<Key, (Revision, Vec<u8>)>,
    /// The changes that are not saved yet; an entry without a value is removed.
    unsaved: BTreeMap<Key, (Revision, Option<Vec<u8>>)>,
    /// The last revision, saved or not.
    revision: Revision,
    log_bytes: usize,
    saved_at: Instant,
    /// Says whether it is unknown what is stored: not known yet, or not any more.
    is_lost: bool,
    /// Says whether another server has removed all entries while this one stood by.
    is_cleared: bool,
}

/// The head of the log, which names the segments that count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Head {
    revision: Revision,
    first: u64,
    /// The segment after the last.
    next: u64,
}

impl EtcdWorld {
    /// Returns the world at an address, with the credentials that etcd asks for. An error names the file.
    pub(super) fn at(address: EtcdAddress) -> Result<Self, DirectoryError> {
        Keys::new(address).map(|keys| Self { keys })
    }

    /// Returns the authority of all servers of the world, and stores `own` if there was none.
    pub(super) fn authority(&mut self, own: &str) -> Result<String, DirectoryError> {
        let found = self.keys.read_or_create("authority", own.as_bytes())?;
        String::from_utf8(found).map_err(|_| DirectoryError::Damaged {
            place: self.keys.place(),
            what: "its authority is no text".to_owned(),
        })
    }

    /// Waits until no other server holds the world, and opens it. `holder` names this server, unlike all
    /// others. During the wait `goes_on` is told repeatedly why it waits, and decides whether to keep
    /// waiting; if not, this returns `None`. `fresh`: what is stored may be damaged, and is removed then.
    pub(super) fn open(
        self,
        holder: &str,
        fresh: bool,
        goes_on: &mut dyn FnMut(Wait) -> bool,
    ) -> Result<Option<EtcdDirectory>, DirectoryError> {
        let mut keys = self.keys;
        let before = keys.read("head")?;
        let Some(hold) = lease::hold(keys, holder, goes_on)? else { return Ok(None) };
        let mut directory = EtcdDirectory::new(hold)?;
        let read = directory.read();
        directory.is_cleared = read.is_ok() && directory.entries.is_empty() && directory.stored != before;
        match read {
            Err(DirectoryError::Damaged { .. } | DirectoryError::Format { .. }) if fresh => {
                directory.clear()?
            }
            read => read?,
        }
        directory.is_lost = false;
        Ok(Some(directory))
    }
}

impl EtcdDirectory {
    fn new(hold: Hold) -> Result<Self, DirectoryError> {
        let lease = Lease::begin(hold.clone())?;
        Ok(Self {
            hold: hold.for_bulk(),
            lease,
            head: Head::default(),
            stored: None,
            entries: BTreeMap::new(),
            unsaved: BTreeMap::new(),
            revision: Revision(0),
            log_bytes: 0,
            saved_at: Instant::now(),
            is_lost: true,
            is_cleared: false,
        })
    }

    /// Returns whether another server has ended the world while this one stood by.
    pub(super) fn is_cleared(&self) -> bool {
        self.is_cleared
    }

    /// Returns a record of joins that only the holder of this directory writes.
    pub(super) fn journal(&self) -> EtcdJournal {
        EtcdJournal::new(self.hold.clone())
    }

    /// Reads all entries, and removes segments that do not count any more, or whose writer died before they
    /// counted.
    fn read(&mut self) -> Result<(), DirectoryError> {
        let place = self.hold.keys().place();
        let damaged = |what: &str| DirectoryError::Damaged { place: place.clone(), what: what.to_owned() };
        self.stored = self.hold.keys().read("head")?;
        if let Some(head) = &self.stored {
            self.head = Head::decode(head, &place)?;
        }
        self.revision = self.head.revision;
        let Head { first, next, .. } = self.head;
        let parts = self.hold.keys().read_range(&segment_name(first), &segment_name(next))?;
        let mut segments = BTreeMap::<u64, Vec<u8>>::new();
        for part in &parts {
            let segment = number_of_segment(&part.key).ok_or_else(|| damaged("a segment has no number"))?;
            segments.entry(segment).or_default().extend(&part.value);
        }
        for number in first..next {
            let segment = segments.remove(&number).ok_or_else(|| damaged("a segment is missing"))?;
            let records = segment::decode(&segment).ok_or_else(|| damaged("a segment is not whole"))?;
            for (key, revision, value) in records {
                match value {
                    Some(value) => self.entries.insert(key, (revision, value.to_vec())),
                    None => self.entries.remove(&key),
                };
            }
            self.log_bytes += segment.len();
        }
        self.remove_others()
    }

    /// Removes all that is stored. Numbers go on, so that no head is ever stored twice.
    fn clear(&mut self) -> Result<(), DirectoryError> {
        self.entries.clear();
        let Head { revision, next, .. } = self.head;
        (self.revision, self.log_bytes) = (revision, 0);
        self.write_head(Head { revision, first: next, next }, Vec::new())?;
        self.remove_others()
    }

    /// Removes all segments that do not count. If etcd did that late, newer segments would go too; so the
    /// removal depends on the head, which is another one then.
    fn remove_others(&mut self) -> Result<(), DirectoryError> {
        let Head { first, next, .. } = self.head;
        let ranges = [(0, first), (next, u64::MAX)].into_iter().filter(|(from, to)| from < to);
        let keys = self.hold.keys();
        let removal = |(from, to)| Op::Delete(keys.key(&segment_name(from)), keys.key(&segment_name(to)));
        let removals: Vec<_> = ranges.map(removal).collect();
        self.hold.write_if("head", self.stored.as_deref(), &removals).map(drop)
    }

    /// Saves all that is not saved yet.
    fn save(&mut self) -> Result<(), DirectoryError> {
        let saved = self.append_unsaved().and_then(|()| self.begin_anew_in_time());
        self.is_lost |= saved.is_err();
        saved
    }

    fn append_unsaved(&mut self) -> Result<(), DirectoryError> {
        self.saved_at = Instant::now();
        if self.head.revision == self.revision {
            return Ok(());
        }
        let unsaved = std::mem::take(&mut self.unsaved);
        let segment = segment::encode(unsaved.iter().map(|(key, (at, value))| (*key, *at, value.as_deref())));
        self.log_bytes += segment.len();
        let Head { first, next, .. } = self.head;
        self.append(&segment, Head { revision: self.revision, first, next: next + 1 })
    }

    fn begin_anew_in_time(&mut self) -> Result<(), DirectoryError> {
        if self.log_bytes <= LOG_BYTES {
            return Ok(());
        }
        let entries_bytes: usize = self.entries.values().map(|(_, value)| value.len()).sum();
        if self.log_bytes > LOG_RATIO * entries_bytes { self.begin_anew() } else { Ok(()) }
    }

    /// Writes all entries as one segment, and removes the segments before it.
    fn begin_anew(&mut self) -> Result<(), DirectoryError> {
        let records = self.entries.iter().map(|(key, (at, value))| (*key, *at, Some(value.as_slice())));
        let segment = segment::encode(records);
        let first = self.head.next;
        self.append(&segment, Head { revision: self.revision, first, next: first + 1 })?;
        self.log_bytes = segment.len();
        self.remove_others()
    }

    /// Writes the next segment, and a head that counts it.
    fn append(&mut self, segment: &[u8], head: Head) -> Result<(), DirectoryError> {
        let keys = self.hold.keys();
        let parts = segment.chunks(VALUE_BYTES).enumerate();
        let mut parts: Vec<_> = parts
            .map(|(i, part)| {
                Op::Put(keys.key(&format!("{}/{i:08x}", segment_name(head.next - 1))), part.to_vec())
            })
            .collect();
        let last = parts.pop().expect("a segment is not empty: it begins with its length");
        for part in parts {
            self.hold.write(&[part])?;
        }
        self.write_head(head, vec![last])
    }

    /// Writes a new head, with what belongs to it. Each head is stored once only: if etcd does this late, it
    /// finds a newer head and does nothing.
    fn write_head(&mut self, head: Head, mut ops: Vec<Op>) -> Result<(), DirectoryError> {
        let value = head.encode();
        ops.push(Op::Put(self.hold.keys().key("head"), value.clone()));
        let is_written = self.hold.write_if("head", self.stored.as_deref(), &ops)?;
        // etcd may have done it at an earlier request that it did not answer in time.
        if !is_written && self.hold.keys().read("head")?.as_ref() != Some(&value) {
            let (place, what) = (self.hold.place(), "others than servers of dcd write there".to_owned());
            return Err(DirectoryError::Damaged { place, what });
        }
        (self.head, self.stored) = (head, Some(value));
        Ok(())
    }
}

impl Directory for EtcdDirectory {
    fn load(&mut self) -> Result<Vec<Entry>, DirectoryError> {
        let entries = self.entries.iter();
        Ok(entries
            .map(|(&key, (revision, value))| Entry { key, revision: *revision, value: value.clone() })
            .collect())
    }

    /// Conditions are checked here: only this server writes, which etcd ensures.
    fn commit(&mut self, batch: &Batch, conditions: &[Condition]) -> Result<Revision, DirectoryError> {
        for &Condition { key, at } in conditions {
            let found = self.entries.get(&key).map(|(revision, _)| *revision);
            if found != at {
                return Err(DirectoryError::Changed { key, expected: at, found });
            }
        }
        self.revision.0 += 1;
        for (key, value) in &batch.writes {
            match value {
                Some(value) => self.entries.insert(*key, (self.revision, value.clone())),
                None => self.entries.remove(key),
            };
            self.unsaved.insert(*key, (self.revision, value.clone()));
        }
        if batch.durable || self.saved_at.elapsed() >= UNSAVED {
            self.save()?;
        }
        Ok(self.revision)
    }

    fn renew(&mut self) -> Result<Tenure, DirectoryError> {
        self.lease.left().map(Tenure::For)
    }
}

impl Drop for EtcdDirectory {
    fn drop(&mut self) {
        if !self.is_lost {
            let _ = self.save();
        }
    }
}

impl Head {
    fn encode(self) -> Vec<u8> {
        [FORMAT, self.revision.0, self.first, self.next].into_iter().flat_map(u64::to_be_bytes).collect()
    }

    fn decode(bytes: &[u8], place: &str) -> Result<Self, DirectoryError> {
        let (numbers, rest) = bytes.as_chunks();
        let numbers: Vec<_> = numbers.iter().map(|number| u64::from_be_bytes(*number)).collect();
        match numbers[..] {
            [FORMAT, revision, first, next] if first <= next && rest.is_empty() => {
                Ok(Self { revision: Revision(revision), first, next })
            }
            [found, ..] if found != FORMAT => {
                Err(DirectoryError::Format { place: place.to_owned(), found, known: FORMAT })
            }
            _ => {
                Err(DirectoryError::Damaged { place: place.to_owned(), what: "its head is none".to_owned() })
            }
        }
    }
}

/// Returns the common beginning of the names of a segment's parts. Names sort in the order of numbers.
fn segment_name(number: u64) -> String {
    format!("log/{number:016x}")
}

/// Returns the number of the segment that a key is a part of.
fn number_of_segment(key: &[u8]) -> Option<u64> {
    let mut names = std::str::from_utf8(key).ok()?.rsplit('/');
    let _part = names.next()?;
    u64::from_str_radix(names.next()?, 16).ok()
}
