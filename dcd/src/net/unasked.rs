//! Keeps the connections without a name that have not asked for anything yet, or were refused: the one that has waited longest gives way
//! where there is no room for another, so that who only occupies a place does not keep others from joining.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use quinn::Connection;

use super::CloseCode;

/// Connections in the order in which they came.
#[derive(Default)]
pub(super) struct Unasked(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    next: u64,
    connections: BTreeMap<u64, Connection>,
}

/// A connection's place among them, until it is dropped.
pub(super) struct Place<'a> {
    of: &'a Unasked,
    number: u64,
}

impl Unasked {
    /// Notes a connection that may ask now, or read why it was refused.
    pub(super) fn enter(&self, connection: &Connection) -> Place<'_> {
        let mut waiting = self.lock();
        let number = waiting.next;
        waiting.next += 1;
        waiting.connections.insert(number, connection.clone());
        Place { of: self, number }
    }

    /// Returns how many there are.
    pub(super) fn count(&self) -> usize {
        self.lock().connections.len()
    }

    /// Closes the connection that has waited longest; returns whether there was one. Its handshake slot is free soon.
    pub(super) fn give_way(&self) -> bool {
        let oldest = self.lock().connections.pop_first();
        let reason = b"others wait to join, and nothing was asked here that waits for an answer; try again";
        oldest.map(|(_, connection)| connection.close(CloseCode::REFUSED.into(), reason)).is_some()
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.of.lock().connections.remove(&self.number);
    }
}
