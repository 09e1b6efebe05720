//! What every link between two processes keeps to: how long it waits, how much it holds. The network keeps to this, the
//! simulator behaves like it, and the machines count on it.

use std::time::Duration;

/// Who hears nothing for so long takes the link for dead: the other end is killed, cut off, or stopped.
pub const IDLE_TIMEOUT: Duration = Duration::from_millis(1_000);
/// An end that has nothing to say says so this often.
pub const KEEP_ALIVE: Duration = Duration::from_millis(100);
/// From the first packet to the last greeting; then the call is given up.
pub const HANDSHAKE_TIMEOUT: Duration = Duration::from_millis(2_500);
/// What a round trip is taken for until there is a measurement. QUIC guesses 333 ms, and so speaks again after one, two and
/// four seconds: too late for a link that is to be back within three.
pub const FIRST_TRIP: Duration = Duration::from_millis(100);
/// When a first packet that is not answered is sent again (RFC 9002, 6.2.2: thrice a round trip); then after twice as long
/// each time.
pub const FIRST_PROBE: Duration = Duration::from_millis(3 * FIRST_TRIP.as_millis() as u64);
/// How long closing waits until the other end has what was sent before.
pub const LINGER: Duration = Duration::from_millis(500);

/// The longest frame from a server or node.
pub const FRAME_BYTES: usize = 16 << 20;
/// The longest frame from a process that is a client only.
pub const CLIENT_FRAME_BYTES: usize = 64 << 10;
/// How much may be in flight to a server or node.
pub const WINDOW_BYTES: usize = 8 << 20;
/// How much may wait for a slow server or node beside that.
pub const QUEUE_BYTES: usize = 32 << 20;
/// How much may wait for a slow client, and again as much in flight.
pub const CLIENT_QUEUE_BYTES: usize = 64 << 10;
/// Of programs' messages, so much may have been sent to a program that has not taken it yet.
pub const PROGRAM_WINDOW_BYTES: usize = 128 << 10;
/// Datagrams that have arrived and are not read yet.
pub const DATAGRAM_QUEUE_BYTES: usize = 64 << 10;

/// Of what has arrived from a peer with such frames, so much may wait to be read.
pub const fn inbox_bytes(frame_bytes: usize) -> usize {
    2 * frame_bytes
}
