//! Defines the limits of every link between two processes: time-outs, frame sizes and queue lengths. The
//! network keeps to them, the simulator behaves like it, and the state machines rely on them.

use std::time::Duration;

/// The silence after which an end takes the link for dead: the other end was killed, cut off, or stopped.
pub const IDLE_TIMEOUT: Duration = Duration::from_millis(1_000);
/// The interval of keep-alives on an idle link. The end that dialled sends them; the other end only
/// acknowledges them.
pub const KEEP_ALIVE: Duration = Duration::from_millis(100);
/// The same as [`IDLE_TIMEOUT`] for links that a client-only process dialled, which shall cost little while
/// nothing happens. The server tells the client that its leader is gone. A reset of the client's stale link
/// tells it that its server is back.
pub const CLIENT_IDLE_TIMEOUT: Duration = Duration::from_secs(10);
/// The same as [`KEEP_ALIVE`] for those links.
pub const CLIENT_KEEP_ALIVE: Duration = Duration::from_secs(4);
/// The longest time from the first packet to the last greeting. Then the call is given up.
pub const HANDSHAKE_TIMEOUT: Duration = Duration::from_millis(2_500);
/// The round trip that is assumed until one is measured. QUIC assumes 333 ms, and so sends again after one,
/// two and four seconds: too late for a link that is to be back within three.
pub const FIRST_TRIP: Duration = Duration::from_millis(100);
/// The time after which a first packet without an answer is sent again (RFC 9002, 6.2.2: thrice a round
/// trip). After that the time doubles each time.
pub const FIRST_PROBE: Duration = Duration::from_millis(3 * FIRST_TRIP.as_millis() as u64);
/// The longest time that closing waits until the other end has what was sent before.
pub const LINGER: Duration = Duration::from_millis(500);

/// The longest frame from a server or node, in bytes.
pub const FRAME_BYTES: usize = 16 << 20;
/// The longest frame from a client-only process, in bytes.
pub const CLIENT_FRAME_BYTES: usize = 64 << 10;
/// The most frames per second from a client-only process: an input for each of 1,024 avatars in each of 60
/// ticks, and more.
pub const CLIENT_FRAMES_PER_S: u32 = 64_000;
/// The most bytes in flight to a server or node.
pub const WINDOW_BYTES: usize = 8 << 20;
/// The most bytes that wait for a slow server or node, besides those in flight.
pub const QUEUE_BYTES: usize = 32 << 20;
/// The most bytes that wait for a slow client. As many again may be in flight.
pub const CLIENT_QUEUE_BYTES: usize = 64 << 10;
/// The most bytes of programs' messages that were sent to a program and that it has not taken yet.
pub const PROGRAM_WINDOW_BYTES: usize = 128 << 10;
/// The most bytes of datagrams that have arrived and are not read yet.
pub const DATAGRAM_QUEUE_BYTES: usize = 64 << 10;

/// Returns the most bytes that may have arrived from a peer and wait to be read, if its frames have at most
/// this size.
pub const fn inbox_bytes(frame_bytes: usize) -> usize {
    2 * frame_bytes
}
