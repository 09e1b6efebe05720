//! Counts what a process was sent over its links: bytes by the subject of messages, by the fields of states,
//! and by body.

use crate::delta::{Field, Tally};
use crate::net::NetTotals;
use crate::protocol::Subject;
use crate::space::BodyId;

/// The number of costliest bodies that are listed.
pub(super) const COSTLIEST: usize = 10;

/// A number of messages and their bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// The number of messages.
    pub messages: u64,
    /// The bytes of these messages, without what QUIC adds.
    pub bytes: u64,
}

/// Messages and bytes by [`Subject`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received([Count; Subject::ALL.len()]);

impl Received {
    /// Counts a message.
    pub(super) fn count(&mut self, subject: Subject, bytes: usize) {
        let count = &mut self.0[subject as usize];
        count.messages += 1;
        count.bytes += bytes as u64;
    }

    /// Adds the counts of another.
    pub(super) fn add(&mut self, others: &Self) {
        for (count, other) in self.0.iter_mut().zip(&others.0) {
            count.messages += other.messages;
            count.bytes += other.bytes;
        }
    }

    /// Returns the counts, by subject.
    pub fn iter(&self) -> impl Iterator<Item = (Subject, Count)> {
        Subject::ALL.into_iter().zip(self.0)
    }
}

/// Totals over all links of a process since its start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinkTotals {
    /// The network's own counters.
    pub net: NetTotals,
    /// Messages received, by subject.
    pub received: Received,
    /// Messages handed over for sending, by subject.
    pub sent: Received,
    /// Bytes that wait for links now, besides those in [`NetTotals`].
    pub waiting_bytes: u64,
    /// Messages that could not be decoded, or that their sender was not allowed to send.
    pub malformed: u64,
}

/// What a client was sent since it joined, and for what.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Bandwidth {
    /// UDP bytes received: those of all messages, and what QUIC adds.
    pub udp_bytes: u64,
    /// Messages received, by subject.
    pub messages: Received,
    /// The cost of states of bodies.
    pub states: Tally,
    /// The bodies whose states took the most bytes, with those bytes, the costliest first.
    pub bodies: Vec<(BodyId, f64)>,
}

impl Bandwidth {
    /// Returns the bytes that QUIC added: its headers, acknowledgements and handshakes.
    pub fn quic_bytes(&self) -> u64 {
        self.udp_bytes.saturating_sub(self.messages.iter().map(|(_, count)| count.bytes).sum())
    }

    /// Returns the bytes of states by field. They add up to all but the last few bytes of each message.
    pub fn fields(&self) -> impl Iterator<Item = (Field, f64)> {
        Field::ALL.into_iter().zip(self.states.bits.map(|bits| bits / 8.0))
    }
}
