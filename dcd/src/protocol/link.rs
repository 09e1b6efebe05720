//! Defines the limits of every link between two processes: time-outs, frame sizes and queue lengths. The network keeps to them,
//! the simulator behaves like it, and the state machines rely on them.

use std::time::Duration;

/// An end that hears nothing for this long takes the link for dead: the other end is killed, cut off, or stopped.
pub const IDLE_TIMEOUT: Duration = Duration::from_millis(1_000);
/// Interval of keep-alives of an idle end. It is the end that dialled; the other acknowledges, which is all that it says.
pub const KEEP_ALIVE: Duration = Duration::from_millis(100);
/// The same as [`IDLE_TIMEOUT`] for links that a process dialled which is a client only: it shall cost little where nothing happens. That its
/// leader is gone its server tells it, and that its server is back a reset of what it still believes in.
pub const CLIENT_IDLE_TIMEOUT: Duration = Duration::from_secs(10);
/// The same as [`KEEP_ALIVE`] for those links.
pub const CLIENT_KEEP_ALIVE: Duration = Duration::from_secs(4);
/// Time from the first packet to the last greeting; then the call is given up.
pub const HANDSHAKE_TIMEOUT: Duration = Duration::from_millis(2_500);
/// Assumed round trip until there is a measurement. QUIC guesses 333 ms, and so sends again after one, two and four seconds:
/// too late for a link that is to be back within three.
pub const FIRST_TRIP: Duration = Duration::from_millis(100);
/// Time after which a first packet without an answer is sent again (RFC 9002, 6.2.2: thrice a round trip); then after twice as
/// long each time.
pub const FIRST_PROBE: Duration = Duration::from_millis(3 * FIRST_TRIP.as_millis() as u64);
/// Time that closing waits until the other end has what was sent before.
pub const LINGER: Duration = Duration::from_millis(500);

/// The longest frame from a server or node.
pub const FRAME_BYTES: usize = 16 << 20;
/// The longest frame from a process that is a client only.
pub const CLIENT_FRAME_BYTES: usize = 64 << 10;
/// The most frames per second from a process that is a client only: an input for each of 1,024 avatars in each of 60 ticks, and more.
pub const CLIENT_FRAMES_PER_S: u32 = 64_000;
/// The most bytes in flight to a server or node.
pub const WINDOW_BYTES: usize = 8 << 20;
/// The most bytes that wait for a slow server or node beside those.
pub const QUEUE_BYTES: usize = 32 << 20;
/// The most bytes that wait for a slow client, and again as much in flight.
pub const CLIENT_QUEUE_BYTES: usize = 64 << 10;
/// The most bytes of programs' messages that may have been sent to a program that has not taken them yet.
pub const PROGRAM_WINDOW_BYTES: usize = 128 << 10;
/// The most bytes of datagrams that have arrived and are not read yet.
pub const DATAGRAM_QUEUE_BYTES: usize = 64 << 10;

/// Returns the most bytes that may have arrived from a peer with frames of this size and wait to be read.
pub const fn inbox_bytes(frame_bytes: usize) -> usize {
    2 * frame_bytes
}
