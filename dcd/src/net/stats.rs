//! Counts the traffic of connections: bytes, frames, datagrams, packets, round trips.

#[cfg(feature = "physics")]
use std::collections::BTreeMap;
#[cfg(feature = "physics")]
use std::sync::atomic::AtomicBool;
use std::sync::atomic::{AtomicU64, Ordering};
#[cfg(feature = "physics")]
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use quinn::ConnectionStats;

#[cfg(feature = "physics")]
use super::PeerKey;

/// The traffic over one connection, or a sum over several. Bytes are those of frames and datagrams, without
/// QUIC's own, unless they are named UDP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PeerStats {
    /// Bytes of messages received.
    pub bytes_in: u64,
    /// Bytes of messages handed over for sending.
    pub bytes_out: u64,
    /// Bytes of UDP received: messages and what QUIC adds.
    pub udp_bytes_in: u64,
    /// Bytes of UDP sent.
    pub udp_bytes_out: u64,
    /// Frames received.
    pub frames_in: u64,
    /// Frames handed over for sending.
    pub frames_out: u64,
    /// Frames that a client sent faster than it may, and that were therefore read later.
    pub frames_held_back: u64,
    /// Datagrams received.
    pub datagrams_in: u64,
    /// Datagrams handed over for sending.
    pub datagrams_out: u64,
    /// Datagrams dropped at this end: the link was congested, this process was slow to read them, or a client
    /// sent more than it may.
    pub datagrams_dropped: u64,
    /// Bytes that wait to be sent because the peer or the link is slow.
    pub bytes_waiting: u64,
    /// Packets of QUIC sent.
    pub packets_out: u64,
    /// Packets lost on the way, as far as QUIC knows.
    pub packets_lost: u64,
    /// The smoothed round trip as QUIC measures it; in totals, that of the slowest peer.
    pub rtt: Duration,
}

/// Traffic over all connections since the start, with joins and handshakes granted and refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NetTotals {
    /// Sums over living and closed connections.
    pub traffic: PeerStats,
    /// Living connections.
    pub peers: u64,
    /// Joins granted.
    pub joins_granted: u64,
    /// Joins refused, and anonymous peers that sent anything else.
    pub joins_refused: u64,
    /// Handshakes that failed or were turned away, and calls beyond the pace or the room of their place or of
    /// all.
    pub handshakes_refused: u64,
    /// Connections closed because the peer broke a rule.
    pub violations: u64,
}

impl PeerStats {
    /// Adds the traffic of another connection.
    pub(crate) fn add(&mut self, other: &Self) {
        self.bytes_in += other.bytes_in;
        self.bytes_out += other.bytes_out;
        self.udp_bytes_in += other.udp_bytes_in;
        self.udp_bytes_out += other.udp_bytes_out;
        self.frames_in += other.frames_in;
        self.frames_out += other.frames_out;
        self.frames_held_back += other.frames_held_back;
        self.datagrams_in += other.datagrams_in;
        self.datagrams_out += other.datagrams_out;
        self.datagrams_dropped += other.datagrams_dropped;
        self.bytes_waiting += other.bytes_waiting;
        self.packets_out += other.packets_out;
        self.packets_lost += other.packets_lost;
        self.rtt = self.rtt.max(other.rtt);
    }
}

/// The traffic over all connections, and over each that lives.
#[cfg(feature = "physics")]
#[derive(Default)]
pub(crate) struct Counted {
    pub(crate) totals: NetTotals,
    pub(crate) links: BTreeMap<PeerKey, PeerStats>,
}

/// The last count, and whether another one is under way.
#[cfg(feature = "physics")]
#[derive(Default)]
pub(super) struct Counting {
    last: Mutex<Arc<Counted>>,
    is_under_way: AtomicBool,
}

#[cfg(feature = "physics")]
impl Counting {
    pub(super) fn last(&self) -> Arc<Counted> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns whether the caller is to count, because nobody else does.
    pub(super) fn begin(&self) -> bool {
        !self.is_under_way.swap(true, Ordering::Relaxed)
    }

    pub(super) fn end(&self, counted: Counted) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Arc::new(counted);
        self.is_under_way.store(false, Ordering::Relaxed);
    }
}

/// The counters that tasks and callers share.
#[derive(Default)]
pub(super) struct Counters {
    pub(super) bytes_in: AtomicU64,
    pub(super) bytes_out: AtomicU64,
    pub(super) frames_in: AtomicU64,
    pub(super) frames_out: AtomicU64,
    pub(super) frames_held_back: AtomicU64,
    pub(super) datagrams_in: AtomicU64,
    pub(super) datagrams_out: AtomicU64,
    pub(super) datagrams_dropped: AtomicU64,
}

impl Counters {
    pub(super) fn read(&self, bytes_waiting: usize, link: &ConnectionStats) -> PeerStats {
        let value = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        PeerStats {
            bytes_in: value(&self.bytes_in),
            bytes_out: value(&self.bytes_out),
            udp_bytes_in: link.udp_rx.bytes,
            udp_bytes_out: link.udp_tx.bytes,
            frames_in: value(&self.frames_in),
            frames_out: value(&self.frames_out),
            frames_held_back: value(&self.frames_held_back),
            datagrams_in: value(&self.datagrams_in),
            datagrams_out: value(&self.datagrams_out),
            datagrams_dropped: value(&self.datagrams_dropped),
            bytes_waiting: bytes_waiting as u64,
            packets_out: link.path.sent_packets - link.path.sent_plpmtud_probes,
            packets_lost: link.path.lost_packets,
            rtt: link.path.rtt,
        }
    }
}

/// Counts one message of `bytes` in a pair of counters.
pub(super) fn count(messages: &AtomicU64, byte_sum: &AtomicU64, bytes: usize) {
    messages.fetch_add(1, Ordering::Relaxed);
    byte_sum.fetch_add(bytes as u64, Ordering::Relaxed);
}
