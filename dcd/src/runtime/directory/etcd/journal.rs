//! Keeps the record of joins in etcd, so that the server that takes over knows which tokens were used, and
//! which ids were given.

use std::path::PathBuf;

use super::gateway::Op;
use super::keys::{Hold, VALUE_BYTES};
use crate::cluster::directory::DirectoryError;
use crate::net::{Journal, NetError};

/// The record of joins of a world in etcd, some lines per key. Each write is fenced, so that no id is given
/// twice.
pub(in crate::runtime) struct EtcdJournal {
    hold: Hold,
    /// The number of the next key.
    next: u64,
}

const FIRST: &str = "joins/";
/// Sorts after all numbers.
const END: &str = "joins/~";

impl EtcdJournal {
    pub(super) fn new(hold: Hold) -> Self {
        Self { hold, next: 0 }
    }

    fn name(number: u64) -> String {
        format!("{FIRST}{number:016x}")
    }

    fn put(&mut self, text: &str) -> Result<(), NetError> {
        let key = self.hold.keys().key(&Self::name(self.next));
        // This number is not used again: a write that failed may still be done late.
        self.next += 1;
        self.hold.write(&[Op::Put(key, text.as_bytes().to_vec())]).map_err(of_joins)
    }
}

impl Journal for EtcdJournal {
    fn place(&self) -> PathBuf {
        format!("{}/joins", self.hold.place()).into()
    }

    fn read(&mut self) -> Result<String, NetError> {
        let mut text = String::new();
        for found in self.hold.keys().read_range(FIRST, END).map_err(of_joins)? {
            text.push_str(&String::from_utf8_lossy(&found.value));
            let number = found.key.rsplit(|&byte| byte == b'/').next().unwrap_or_default();
            let number = std::str::from_utf8(number).ok().and_then(|text| u64::from_str_radix(text, 16).ok());
            self.next = self.next.max(number.unwrap_or_default() + 1);
        }
        Ok(text)
    }

    fn append(&mut self, line: &str) -> Result<(), NetError> {
        self.put(line)
    }

    /// The new lines are stored before the former ones are removed. Reading both gives nothing wrong.
    fn replace(&mut self, text: &str) -> Result<(), NetError> {
        let first = self.next;
        let mut rest = text;
        while !rest.is_empty() {
            let fits = rest.len().min(VALUE_BYTES);
            let whole = rest[..fits].rfind('\n').map_or(rest.len(), |end| end + 1);
            let (now, later) = rest.split_at(whole);
            self.put(now)?;
            rest = later;
        }
        let keys = self.hold.keys();
        let former = Op::Delete(keys.key(FIRST), keys.key(&Self::name(first)));
        self.hold.write(&[former]).map_err(of_joins)
    }
}

fn of_joins(error: DirectoryError) -> NetError {
    NetError::Joins(error.to_string())
}
