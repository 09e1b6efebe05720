//! Defines the server's durable storage behind a trait ([`Directory`]): a key-value store of the world's
//! entries, from which the server recovers after a crash. The trait fits both a file and a consensus store.
//!
//! A directory maps [`Key`]s to bytes. A writer names the [`Revision`] of the entries that its write builds
//! on, so that of two writers one finds that it has lost. One server at a time *holds* a directory. The trait
//! maps to stores as follows:
//!
//! | | a file (`redb`) | a consensus store (etcd) |
//! |---|---|---|
//! | open | locks a file; the system releases the lock when the process dies | creates a holder's key if there is none; a server that finds one stands by until the key is gone, or no longer renewed |
//! | [`Directory::renew`] | nothing to do: [`Tenure::WhileOpen`] | a thread rewrites the holder's key again and again: [`Tenure::For`] what is left; [`DirectoryError::Deposed`] when the key is another server's |
//! | [`Directory::commit`] | one write transaction | one transaction, which also compares the holder's key: `Deposed` when that is another server's or gone |
//! | [`Revision`] | a counter in the file | a counter as well |
//! | a [`Batch`] that is not durable | stays in memory until a durable one | the same |
//! | a batch of any size | written as it is | beyond half a megabyte written in parts under new names, then one transaction that counts them |
//!
//! So the only entry that vanishes unless renewed is the holder's own. It has no [`Key`]: the implementation
//! of the trait keeps it. A holder whose tenure ends by the clock stops sending before it ends.

#[cfg(test)]
pub(crate) mod conformance;
mod memory;

use std::fmt;
use std::time::Duration;

use bincode::{Decode, Encode};

use crate::protocol::ShapeHash;
use crate::space::{BodyId, GroupId, JointId};

pub use memory::MemoryDirectory;

/// The key of an entry: what the entry is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub enum Key {
    /// The world as a whole: its settings, newest view number and tick.
    World,
    /// A group: its present view and the view before.
    Group(GroupId),
    /// A body as last known.
    Body(BodyId),
    /// A shape that colliders name.
    Shape(ShapeHash),
    /// A joint.
    Joint(JointId),
    /// A joint that is gone, but that nodes may still hold.
    GoneJoint(JointId),
    /// An immovable body that is gone, but that nodes may still hold.
    GoneScenery(BodyId),
    /// A body that was altered after nodes had it.
    AlteredBody(BodyId),
    /// A joint that was altered after nodes had it.
    AlteredJoint(JointId),
    /// A body that was woken when it was altered, but that may still sleep at nodes.
    WokenBody(BodyId),
}

/// The number of a commit, growing from 1. An entry has the number of the commit that wrote it. A number
/// whose batch a crash undid is given again: the holder that had it has died.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Encode, Decode)]
pub struct Revision(pub u64);

/// An entry as it was read.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Entry {
    /// Its key.
    pub key: Key,
    /// The revision of the commit that wrote it.
    pub revision: Revision,
    /// Its value.
    pub value: Vec<u8>,
}

/// An atomic batch of writes: all happen, or none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct Batch {
    /// New values, in order; `None` removes the entry, if there is one.
    pub writes: Vec<(Key, Option<Vec<u8>>)>,
    /// Says whether the batch and all batches before it survive a crash of the machine once it is committed.
    /// Otherwise a crash may undo the batch and all batches after it.
    pub durable: bool,
}

/// A condition for a batch to be written: an entry is at this revision, or absent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    /// The key of the entry.
    pub key: Key,
    /// The revision that the entry must have; `None`: there must be no such entry.
    pub at: Option<Revision>,
}

/// The time for which the holder of a directory is its only one (its lease).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tenure {
    /// As long as the holder has the directory open.
    WhileOpen,
    /// For this long from now, unless renewed.
    For(Duration),
}

/// A store of the world's entries, held by one server at a time.
pub trait Directory: Send {
    /// Returns all entries in the order of their keys.
    fn load(&mut self) -> Result<Vec<Entry>, DirectoryError>;

    /// Writes the whole batch if all conditions hold, otherwise nothing. A durable batch without writes makes
    /// the batches before it durable.
    ///
    /// After [`DirectoryError::Changed`] nothing was written. After any other error it is unknown whether the
    /// batch was written: open the directory anew.
    fn commit(&mut self, batch: &Batch, conditions: &[Condition]) -> Result<Revision, DirectoryError>;

    /// Confirms the hold on the directory. Call it before anything that only the holder may do. Waits while
    /// the hold is in doubt, as after a stop of the process.
    fn renew(&mut self) -> Result<Tenure, DirectoryError>;
}

/// An error of opening, reading or writing a directory.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DirectoryError {
    /// Another server wrote first.
    #[error(
        "{key} is {} in the directory and should be {}: another server writes there too; stop one of them, and start this one again",
        at(*.found), at(*.expected)
    )]
    Changed {
        /// The key of the first condition that does not hold.
        key: Key,
        /// The revision that the condition names.
        expected: Option<Revision>,
        /// The revision that the entry has.
        found: Option<Revision>,
    },
    /// Another server holds the directory.
    #[error("another server keeps its world in {place}; stop it or choose another place")]
    Taken {
        /// The place of the directory.
        place: String,
    },
    /// The hold is lost: another server has taken the directory over.
    #[error(
        "another server has taken over the world in {place}, since this one was out of reach for too long; start it again, and it stands by"
    )]
    Deposed {
        /// The place of the directory.
        place: String,
    },
    /// The directory cannot be written. What was committed durably stays.
    #[error(
        "cannot write to {place}: {cause}; see to that and start again: the world goes on from the last durable write"
    )]
    Unwritable {
        /// The place of the directory.
        place: String,
        /// What the system said.
        cause: String,
    },
    /// The directory cannot be opened or read.
    #[error("cannot use {place}: {cause}; check that it exists and that this user may read and write it")]
    Unreadable {
        /// The place of the directory.
        place: String,
        /// What the system said.
        cause: String,
    },
    /// Nobody answers at the directory's place.
    #[error(
        "cannot use {place}: {cause}; see that etcd runs at these addresses, and that its port (TCP) can be reached from here"
    )]
    Unreachable {
        /// The place of the directory.
        place: String,
        /// The words of the system.
        cause: String,
    },
    /// The content of the directory contradicts itself.
    #[error("{place} is damaged ({what}); restore it from a copy, or begin the world anew (--fresh)")]
    Damaged {
        /// The place of the directory.
        place: String,
        /// What is wrong with it.
        what: String,
    },
    /// The directory is not a world of dcd.
    #[error(
        "{place} is no world of dcd; put a backup in its place, choose another place, or move it away to begin a world here"
    )]
    Foreign {
        /// The place of the directory.
        place: String,
    },
    /// The directory was written by another version of dcd.
    #[error(
        "{place} has format {found}, this dcd reads {known}; run the version that wrote it, or begin the world anew \
         (--fresh)"
    )]
    Format {
        /// The place of the directory.
        place: String,
        /// The format it has.
        found: u64,
        /// The format that this version reads.
        known: u64,
    },
}

fn at(revision: Option<Revision>) -> String {
    revision.map_or_else(|| "absent".to_owned(), |revision| format!("at {revision}"))
}

/// The first byte of every encoded key: the version of the encoding.
const KEY_VERSION: u8 = 1;

impl Key {
    /// Encodes the key as bytes, which are ordered as keys are.
    pub fn to_bytes(self) -> Vec<u8> {
        let mut bytes = vec![KEY_VERSION, self.kind()];
        match self {
            Self::World => {}
            Self::Group(id) => bytes.extend(id.0.to_be_bytes()),
            Self::Body(id) | Self::AlteredBody(id) | Self::GoneScenery(id) | Self::WokenBody(id) => {
                bytes.extend(id.bits().to_be_bytes());
            }
            Self::Shape(hash) => bytes.extend(hash.0),
            Self::Joint(id) | Self::AlteredJoint(id) | Self::GoneJoint(id) => {
                bytes.extend(id.0.to_be_bytes());
            }
        }
        bytes
    }

    /// Decodes a key from the bytes of [`Self::to_bytes`]; `None` if they are not one.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let [KEY_VERSION, kind, id @ ..] = bytes else { return None };
        let number = |id: &[u8]| Some(u64::from_be_bytes(id.try_into().ok()?));
        let body = |id| number(id).map(BodyId::from_bits);
        let joint = |id| number(id).map(JointId);
        Some(match kind {
            0 if id.is_empty() => Self::World,
            1 => Self::Group(GroupId(u32::from_be_bytes(id.try_into().ok()?))),
            2 => Self::Body(body(id)?),
            3 => Self::Shape(ShapeHash(id.try_into().ok()?)),
            4 => Self::Joint(joint(id)?),
            5 => Self::GoneJoint(joint(id)?),
            6 => Self::GoneScenery(body(id)?),
            7 => Self::AlteredBody(body(id)?),
            8 => Self::AlteredJoint(joint(id)?),
            9 => Self::WokenBody(body(id)?),
            _ => return None,
        })
    }

    fn kind(self) -> u8 {
        match self {
            Self::World => 0,
            Self::Group(_) => 1,
            Self::Body(_) => 2,
            Self::Shape(_) => 3,
            Self::Joint(_) => 4,
            Self::GoneJoint(_) => 5,
            Self::GoneScenery(_) => 6,
            Self::AlteredBody(_) => 7,
            Self::AlteredJoint(_) => 8,
            Self::WokenBody(_) => 9,
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::World => write!(f, "the world's entry"),
            Self::Group(id) => write!(f, "group {id}"),
            Self::Body(id) => write!(f, "body {id}"),
            Self::Shape(hash) => write!(f, "shape {hash}"),
            Self::Joint(id) => write!(f, "joint {id}"),
            Self::AlteredBody(id) => write!(f, "alteration of body {id}"),
            Self::AlteredJoint(id) => write!(f, "alteration of joint {id}"),
            Self::GoneScenery(id) => write!(f, "end of body {id}"),
            Self::GoneJoint(id) => write!(f, "end of joint {id}"),
            Self::WokenBody(id) => write!(f, "waking of body {id}"),
        }
    }
}

impl fmt::Display for Revision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "revision {}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_key() -> impl Strategy<Value = Key> {
        prop_oneof![
            Just(Key::World),
            any::<u32>().prop_map(|id| Key::Group(GroupId(id))),
            any::<u64>().prop_map(|bits| Key::Body(BodyId::from_bits(bits))),
            any::<[u8; 16]>().prop_map(|hash| Key::Shape(ShapeHash(hash))),
            any::<u64>().prop_map(|id| Key::Joint(JointId(id))),
            any::<u64>().prop_map(|bits| Key::AlteredBody(BodyId::from_bits(bits))),
            any::<u64>().prop_map(|id| Key::AlteredJoint(JointId(id))),
            any::<u64>().prop_map(|bits| Key::GoneScenery(BodyId::from_bits(bits))),
            any::<u64>().prop_map(|id| Key::GoneJoint(JointId(id))),
            any::<u64>().prop_map(|bits| Key::WokenBody(BodyId::from_bits(bits))),
        ]
    }

    proptest! {
        #[test]
        fn names_of_keys_are_ordered_as_keys_are_and_mean_them(a in any_key(), b in any_key()) {
            prop_assert_eq!(a.to_bytes().cmp(&b.to_bytes()), a.cmp(&b));
            prop_assert_eq!(Key::from_bytes(&a.to_bytes()), Some(a));
        }

        #[test]
        fn what_is_no_name_of_a_key_is_none(bytes in proptest::collection::vec(0u8..11, 0..24)) {
            if let Some(key) = Key::from_bytes(&bytes) {
                prop_assert_eq!(key.to_bytes(), bytes);
            }
        }
    }

    #[test]
    fn names_of_keys_stay_what_they_are_in_files() {
        assert_eq!(Key::World.to_bytes(), [1, 0]);
        assert_eq!(Key::Group(GroupId(258)).to_bytes(), [1, 1, 0, 0, 1, 2]);
        assert_eq!(Key::Body(BodyId::persistent(7)).to_bytes(), [1, 2, 0, 0, 0, 0, 0, 0, 0, 7]);
        assert_eq!(Key::from_bytes(&[2, 0]), None, "of another version");
    }

    #[test]
    fn a_lost_race_is_told_from_a_full_disk() {
        let lost = DirectoryError::Changed {
            key: Key::Group(GroupId(3)),
            expected: Some(Revision(4)),
            found: Some(Revision(9)),
        };
        let said = lost.to_string();
        assert!(
            said.starts_with("group g3 is at revision 9 in the directory and should be at revision 4"),
            "{said}"
        );
        let full = DirectoryError::Unwritable { place: "world.redb".into(), cause: "no space".into() };
        assert!(full.to_string().contains("world.redb: no space"), "{full}");
    }
}
