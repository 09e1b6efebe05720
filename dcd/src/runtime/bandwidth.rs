//! Says what a process was sent over its links: bytes by what messages are about, by the fields of states, and by body.

use crate::delta::{Field, Tally};
use crate::net::NetTotals;
use crate::protocol::Subject;
use crate::space::BodyId;

/// How many bodies are named.
pub(super) const COSTLIEST: usize = 10;

/// Messages, and their bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// How many.
    pub messages: u64,
    /// Their bytes, without what QUIC adds.
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

    /// Adds the counts of others.
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

/// What went over all links of a process since its start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinkTotals {
    /// As the network counts.
    pub net: NetTotals,
    /// Messages received, by what they are about.
    pub received: Received,
    /// Messages given to send.
    pub sent: Received,
    /// Bytes that wait for links now, beside those of [`NetTotals`].
    pub waiting_bytes: u64,
    /// Messages that could not be decoded, or that their sender may not send.
    pub malformed: u64,
}

/// What a client was sent since it joined, and what for.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Bandwidth {
    /// Bytes of UDP that came: those of all messages, and what QUIC adds.
    pub udp_bytes: u64,
    /// Messages by what they are about.
    pub messages: Received,
    /// What states of bodies took.
    pub states: Tally,
    /// The bodies whose states took the most bytes, the costliest first.
    pub bodies: Vec<(BodyId, f64)>,
}

impl Bandwidth {
    /// Returns the bytes that QUIC added: its headers, acknowledgements and handshakes.
    pub fn quic_bytes(&self) -> u64 {
        self.udp_bytes.saturating_sub(self.messages.iter().map(|(_, count)| count.bytes).sum())
    }

    /// Returns the bytes of states by field; all but the last few of a message's bytes are among them.
    pub fn fields(&self) -> impl Iterator<Item = (Field, f64)> {
        Field::ALL.into_iter().zip(self.states.bits.map(|bits| bits / 8.0))
    }
}
