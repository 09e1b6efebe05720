//! Bounds everything that a peer can make us hold: frames, queues, windows, connections, handshakes.

use std::sync::Arc;
use std::time::Duration;

use quinn::{IdleTimeout, TransportConfig, VarInt};

use super::PeerName;
use super::congestion::ToleratesLoss;
use super::lanes::LANES;
use super::source::Part;
use crate::protocol::link;

/// The longest datagram: it must fit into one packet on every path.
pub const MAX_DATAGRAM_BYTES: usize = crate::protocol::DATAGRAM_BYTES;

/// Time-outs and sizes of a process's network. The defaults suit a cluster that steps at 60 ticks per second.
#[derive(Clone, Debug)]
pub struct Limits {
    /// A peer that is silent for this long is reported as closed: killed, cut off, or stopped. Who dialled decides, up to the longer of
    /// this and [`Self::client_idle_timeout`].
    pub idle_timeout: Duration,
    /// How often the side that dialled sends a keep-alive when all is idle.
    pub keep_alive: Duration,
    /// The same as [`Self::idle_timeout`] where a process dialled that is a client only.
    pub client_idle_timeout: Duration,
    /// The same as [`Self::keep_alive`] where a process dialled that is a client only.
    pub client_keep_alive: Duration,
    /// How long the handshake may take, from the first packet to the last greeting; also a join.
    pub handshake_timeout: Duration,
    /// How long closing waits until the peer has what was sent before.
    pub linger: Duration,
    /// The longest frame from a server or node.
    pub frame_bytes: usize,
    /// The longest frame from a process that is a client only.
    pub client_frame_bytes: usize,
    /// How many frames per second are read from a process that is a client only, after a second's worth at once; of 256 bytes, a longer
    /// one counts as several. More wait at their sender. As many datagrams are read beside them; more are dropped.
    pub client_frames_per_s: u32,
    /// How much may wait for a slow server or node, beside what is in flight; then sending is refused.
    pub queue_bytes: usize,
    /// How much may wait for a slow client, and again as much in flight.
    pub client_queue_bytes: usize,
    /// How many proven peers may have dialled us.
    pub connections: usize,
    /// How many handshakes and joins may be under way; with more, one of the place (an IPv4 address, or an IPv6 /64) that has most gives way if it has
    /// asked for nothing, or who calls is ignored, and dials again by itself. So is who calls faster than a place, or all, may: 1,000 and 2,000 a second
    /// are taken, and of those beyond, who calls again a quarter of a second later or more goes first.
    pub handshakes: usize,
    /// From this many handshakes under way on, a dialler must first prove that it has the address it writes from.
    pub handshakes_before_retry: usize,
    /// How many connections may be coming to their end beside those, which QUIC remembers for some round trips of the caller's; with more, who
    /// calls is ignored, and dials again by itself. One place may have all handshakes and half of these, two together two thirds, and so on. A caller
    /// that answers slowly stays for twenty seconds: few would keep everybody from joining.
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

/// The round trip that is assumed of who calls while many do. QUIC remembers a handshake that is given up for nine such trips, and sends
/// again after three: it costs some packets twice, and a flood leaves fewer connections behind.
const FIRST_TRIP_IN_HASTE: Duration = Duration::from_millis(10);

/// How much a server or node may send ahead of our reading.
const RECEIVE_WINDOW_BYTES: u32 = 4 << 20;
/// How much a peer that has not proved its name may send ahead: a flood of them must not cost much.
const UNPROVEN_WINDOW_BYTES: u32 = 32 << 10;
/// The receive window of one stream: the world's three lanes fit into the connection's window together, so that a stalled one
/// leaves room for the others; the program lane never has more on it than its own, small window.
const STREAM_WINDOW_BYTES: u32 = 5 << 18;

impl Limits {
    /// Returns how long a frame *from* `who` may be.
    pub(super) fn frame_bytes_of(&self, who: PeerName) -> usize {
        if who.is_client_only() { self.client_frame_bytes } else { self.frame_bytes }
    }

    /// Returns how many frames per second are read from `who`; `None`: all that come.
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

    /// Returns how many bytes from `who` may wait for the role's loop; beyond that only its connection is held back.
    pub(super) fn inbox_bytes_of(&self, who: PeerName) -> usize {
        link::inbox_bytes(self.frame_bytes_of(who))
    }

    /// Returns the longest silence on a link that `who` has dialled.
    pub(super) fn idle_timeout_of(&self, who: PeerName) -> Duration {
        if who.is_client_only() { self.client_idle_timeout } else { self.idle_timeout }
    }

    /// Returns the settings of links that `who`, this process, dials: it says how long silence may last, and breaks it.
    pub(super) fn dialling(&self, who: PeerName) -> Arc<TransportConfig> {
        let keep_alive = if who.is_client_only() { self.client_keep_alive } else { self.keep_alive };
        self.transport(self.idle_timeout_of(who), Some(keep_alive), 0)
    }

    /// Returns the settings of links that others dial: the shorter of both sides' time-outs counts, so that ours only bounds theirs.
    pub(super) fn answering(&self, bidirectional_streams: u8) -> Arc<TransportConfig> {
        self.transport(self.idle_timeout.max(self.client_idle_timeout), None, bidirectional_streams)
    }

    /// Returns the same for one caller, who keeps its part as long as QUIC knows of its connection; in haste if it had to prove its address, since
    /// many call.
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

    /// Returns settings with this longest silence, for a side that breaks it so often, or never.
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
