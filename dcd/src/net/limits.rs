//! Bounds everything that a peer can make this process hold: frames, queues, windows, connections,
//! handshakes.

use std::sync::Arc;
use std::time::Duration;

use quinn::{IdleTimeout, TransportConfig, VarInt};

use super::PeerName;
use super::congestion::ToleratesLoss;
use super::lanes::LANES;
use super::source::Part;
use crate::protocol::link;

/// The longest datagram in bytes. It must fit into one packet on every path.
pub const MAX_DATAGRAM_BYTES: usize = crate::protocol::DATAGRAM_BYTES;

/// Time-outs and sizes of a process's network. The defaults suit a cluster that steps at 60 ticks per second.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The silence after which a peer is reported as closed: it was killed, cut off, or stopped. The side
    /// that dialled decides, up to the longer of this and [`Self::client_idle_timeout`] of the other side.
    pub idle_timeout: Duration,
    /// The interval at which the side that dialled sends keep-alives on an idle link.
    pub keep_alive: Duration,
    /// The same as [`Self::idle_timeout`], for links that a client-only process dialled.
    pub client_idle_timeout: Duration,
    /// The same as [`Self::keep_alive`], for links that a client-only process dialled.
    pub client_keep_alive: Duration,
    /// The longest time for a handshake, from the first packet to the last greeting, and for a join.
    pub handshake_timeout: Duration,
    /// The longest time that closing waits until the peer has what was sent before.
    pub linger: Duration,
    /// The longest frame from a server or node, in bytes.
    pub frame_bytes: usize,
    /// The longest frame from a client-only process, in bytes.
    pub client_frame_bytes: usize,
    /// The frames per second that are read from a client-only process, after a burst of a second's worth. A
    /// frame of 256 bytes or more counts as several. More frames wait at their sender. As many datagrams are
    /// read besides; more are dropped.
    pub client_frames_per_s: u32,
    /// The most bytes that may wait for a slow server or node, besides those in flight. Beyond that, sending
    /// is refused.
    pub queue_bytes: usize,
    /// The most bytes that may wait for a slow client. As many again may be in flight.
    pub client_queue_bytes: usize,
    /// The most proven peers that may have dialled this process.
    pub connections: usize,
    /// The most handshakes and joins that may be under way. Beyond that, one that has asked for nothing gives
    /// way to a new caller, from the place (an IPv4 address, or an IPv6 /64) that has most. If there is none,
    /// the caller is ignored, and dials again by itself.
    ///
    /// Calls beyond 1,000 per second from one place, or 2,000 from all, are ignored too. Of those, a caller
    /// that calls again a quarter of a second later or more goes first.
    pub handshakes: usize,
    /// The number of handshakes under way from which on a caller must first prove that it has the address it
    /// writes from.
    pub handshakes_before_retry: usize,
    /// The most connections that may be coming to their end besides those handshakes; QUIC remembers each for
    /// some of the caller's round trips. Beyond that, callers are ignored, and dial again by themselves.
    ///
    /// One place may have all handshakes and half of these connections, two places together two thirds, and
    /// so on. A caller that answers slowly stays for twenty seconds: without shares, a few would keep
    /// everybody from joining.
    pub closing: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            idle_timeout: link::IDLE_TIMEOUT,
            keep_alive: link::KEEP_ALIVE,
            client_idle_timeout: link::CLIENT_IDLE_TIMEOUT,
            client_keep_alive: link::CLIENT_KEEP_ALIVE,
            handshake_timeout: link::HANDSHAKE_TIMEOUT,
            linger: link::LINGER,
            frame_bytes: link::FRAME_BYTES,
            client_frame_bytes: link::CLIENT_FRAME_BYTES,
            client_frames_per_s: link::CLIENT_FRAMES_PER_S,
            queue_bytes: link::QUEUE_BYTES,
            client_queue_bytes: link::CLIENT_QUEUE_BYTES,
            connections: 4096,
            handshakes: 256,
            handshakes_before_retry: 32,
            closing: 2048,
        }
    }
}

/// The round trip that is assumed of a caller while many call. QUIC remembers an abandoned handshake for nine
/// such trips, and sends again after three. A short one costs some packets twice, and a flood leaves fewer
/// connections behind.
const FIRST_TRIP_IN_HASTE: Duration = Duration::from_millis(10);

/// The most bytes that a server or node may send ahead of our reading.
const RECEIVE_WINDOW_BYTES: u32 = 4 << 20;
/// The most bytes that a peer that has not proved its name may send ahead: a flood of such peers must not
/// cost much.
const UNPROVEN_WINDOW_BYTES: u32 = 32 << 10;
/// The receive window of one stream. The world's three lanes fit into the connection's window together, so
/// that a stalled lane leaves room for the others. The program lane never carries more than its own, small
/// window.
const STREAM_WINDOW_BYTES: u32 = 5 << 18;

impl Limits {
    /// Returns the longest frame *from* `who`, in bytes.
    pub(super) fn frame_bytes_of(&self, who: PeerName) -> usize {
        if who.is_client_only() { self.client_frame_bytes } else { self.frame_bytes }
    }

    /// Returns the frames per second that are read from `who`; `None` for all that come.
    pub(super) fn frames_per_s_of(&self, who: PeerName) -> Option<u32> {
        who.is_client_only().then_some(self.client_frames_per_s)
    }

    /// Returns how many bytes may wait *for* `who`.
    pub(super) fn queue_bytes_of(&self, who: PeerName) -> usize {
        if who.is_client_only() { self.client_queue_bytes } else { self.queue_bytes }
    }

    /// Returns how many bytes may be in flight to `who`.
    pub(super) fn send_window_of(&self, who: PeerName) -> u64 {
        let world = if who.is_client_only() { self.client_queue_bytes } else { link::WINDOW_BYTES };
        (world + link::PROGRAM_WINDOW_BYTES) as u64
    }

    /// Returns how many bytes `who` may send ahead of our reading.
    pub(super) fn receive_window_of(&self, who: PeerName) -> VarInt {
        if who.is_client_only() {
            u32::try_from(2 * self.client_frame_bytes).map_or(VarInt::MAX, VarInt::from_u32)
        } else {
            VarInt::from_u32(RECEIVE_WINDOW_BYTES)
        }
    }

    /// Returns how many bytes from `who` may wait for the role's loop. Beyond that only its own connection is
    /// held back.
    pub(super) fn inbox_bytes_of(&self, who: PeerName) -> usize {
        link::inbox_bytes(self.frame_bytes_of(who))
    }

    /// Returns the longest silence on a link that `who` has dialled.
    pub(super) fn idle_timeout_of(&self, who: PeerName) -> Duration {
        if who.is_client_only() { self.client_idle_timeout } else { self.idle_timeout }
    }

    /// Returns the settings of links that `who`, this process, dials. This side sets the longest silence, and
    /// sends the keep-alives.
    pub(super) fn dialling(&self, who: PeerName) -> Arc<TransportConfig> {
        let keep_alive = if who.is_client_only() { self.client_keep_alive } else { self.keep_alive };
        self.transport(self.idle_timeout_of(who), Some(keep_alive), 0)
    }

    /// Returns the settings of links that others dial. The shorter of both sides' time-outs counts, so ours
    /// only bounds theirs.
    pub(super) fn answering(&self, bidirectional_streams: u8) -> Arc<TransportConfig> {
        self.transport(self.idle_timeout.max(self.client_idle_timeout), None, bidirectional_streams)
    }

    /// Returns the same as [`Self::answering`], for one caller. The settings hold its part for as long as
    /// QUIC knows of its connection. A caller is `in_haste` if it had to prove its address because many call.
    pub(super) fn answering_caller(
        &self,
        bidirectional_streams: u8,
        in_haste: bool,
        part: Arc<Part>,
    ) -> Arc<TransportConfig> {
        let mut transport = self.answering(bidirectional_streams);
        if let Some(transport) = Arc::get_mut(&mut transport) {
            transport.congestion_controller_factory(Arc::new(ToleratesLoss::of_caller(part)));
            if in_haste {
                transport.initial_rtt(FIRST_TRIP_IN_HASTE);
            }
        }
        transport
    }

    /// Returns settings with this longest silence, for a side that sends keep-alives at this interval, or
    /// none.
    pub(super) fn transport(
        &self,
        idle_timeout: Duration,
        keep_alive: Option<Duration>,
        bidirectional_streams: u8,
    ) -> Arc<TransportConfig> {
        let mut transport = TransportConfig::default();
        transport
            .max_idle_timeout(Some(
                IdleTimeout::try_from(idle_timeout).unwrap_or(IdleTimeout::from(VarInt::MAX)),
            ))
            .keep_alive_interval(keep_alive)
            .initial_rtt(link::FIRST_TRIP)
            .max_concurrent_uni_streams(VarInt::from_u32(LANES as u32))
            .max_concurrent_bidi_streams(VarInt::from(bidirectional_streams))
            .receive_window(VarInt::from_u32(UNPROVEN_WINDOW_BYTES))
            .stream_receive_window(VarInt::from_u32(STREAM_WINDOW_BYTES))
            .send_window(link::WINDOW_BYTES as u64)
            .datagram_receive_buffer_size(Some(link::DATAGRAM_QUEUE_BYTES))
            .datagram_send_buffer_size(link::DATAGRAM_QUEUE_BYTES)
            // With the default loss detection, reordering alone cut throughput six- to tenfold (measured).
            .packet_threshold(128)
            .time_threshold(3.0)
            .congestion_controller_factory(Arc::new(ToleratesLoss::default()));
        Arc::new(transport)
    }
}
