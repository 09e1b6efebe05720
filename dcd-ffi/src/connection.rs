//! Declares the connections of a served world with other processes: their states, their figures, and why they end.

mod calls;

use std::ffi::c_char;

use dcd::net::PeerName;
use dcd::runtime::{Cause, Connection, ConnectionChange, ConnectionError, ConnectionEvent};

use crate::handle::stale;
use crate::ids::DcdConnectionId;
use crate::pointer::Sized32;
use crate::role::{
    DCD_ROLE_BUILDER, DCD_ROLE_CLIENT, DCD_ROLE_NODE, DCD_ROLE_PARTICIPANT, DCD_ROLE_SERVER, DcdRole,
};
use crate::status::{self, Failure};
pub use calls::*;

/// State of a connection.
pub type DcdConnectionState = u32;

/// The connection is new, and has a link.
pub const DCD_CONNECTION_CAME: DcdConnectionState = 1;
/// The link of the connection broke. The process at the other end is waited for: half a minute, as a rule, and for a server as long
/// as the world goes on.
pub const DCD_CONNECTION_LOST: DcdConnectionState = 2;
/// The connection has a link again.
pub const DCD_CONNECTION_BACK: DcdConnectionState = 3;
/// The connection is over, and its id is stale.
pub const DCD_CONNECTION_GONE: DcdConnectionState = 4;

/// Cause for which a connection is lost or gone.
pub type DcdCause = u32;

/// No cause: the connection came, or is back.
pub const DCD_CAUSE_NONE: DcdCause = 0;
/// The other process left by itself, or this process did.
pub const DCD_CAUSE_LEFT: DcdCause = 1;
/// The server's program sent the other process away (dcd_disconnect), or this process.
pub const DCD_CAUSE_SENT_AWAY: DcdCause = 2;
/// Nothing is heard of the other process: it was killed, hangs, or is cut off.
pub const DCD_CAUSE_BROKEN: DcdCause = 3;
/// One of the two processes said what it may not, or is not what the other takes it for, such as a process of another version.
pub const DCD_CAUSE_REFUSED: DcdCause = 4;
/// The world has ended.
pub const DCD_CAUSE_WORLD_ENDED: DcdCause = 5;
/// A newer link took the place of this one, or another process with the same identity did.
pub const DCD_CAUSE_REPLACED: DcdCause = 6;
/// The other process reads too slowly.
pub const DCD_CAUSE_SLOW: DcdCause = 7;
/// One of the two processes does not need the connection any more for what it does for the world, such as when another node leads.
pub const DCD_CAUSE_UNNEEDED: DcdCause = 8;
/// A fault of dcd ended this process's part in the world.
pub const DCD_CAUSE_FAILED: DcdCause = 9;

/// Largest size of a reason, bytes, NUL included.
pub const DCD_MAX_REASON: usize = 256;

/// Change of the state of a connection.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdConnectionEvent {
    /// The connection that changed.
    pub connection: DcdConnectionId,
    /// New state: DCD_CONNECTION_CAME, DCD_CONNECTION_LOST, DCD_CONNECTION_BACK or DCD_CONNECTION_GONE.
    pub state: DcdConnectionState,
    /// Role of the process that is, or was, at the other end: DCD_ROLE_SERVER, DCD_ROLE_NODE, DCD_ROLE_CLIENT, DCD_ROLE_PARTICIPANT
    /// or DCD_ROLE_BUILDER.
    pub role: DcdRole,
    /// Number by which the server knows that process as a node, from 1; 0 if it is none.
    pub node: u32,
    /// Number by which the server knows that process as a client, as DcdWorldInfo.client; 0 if it is none.
    pub client: u32,
    /// DCD_CAUSE_... constant: why the connection is lost or gone.
    pub cause: DcdCause,
    /// Reserved; always 0.
    pub reserved: u32,
    /// Cause in words, for people; empty with DCD_CAUSE_NONE. Cut to fit.
    pub reason: [c_char; DCD_MAX_REASON],
}

/// Connection as it is now. Start from DCD_CONNECTION_INFO_INIT. All numbers are up to half a second old.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdConnectionInfo {
    /// Size of this struct: sizeof(DcdConnectionInfo).
    pub struct_size: u32,
    /// State: DCD_CONNECTION_CAME while the connection has the link that it came with, DCD_CONNECTION_LOST while it has none,
    /// DCD_CONNECTION_BACK while it has another.
    pub state: DcdConnectionState,
    /// Role of the process at the other end, as in DcdConnectionEvent.
    pub role: DcdRole,
    /// Number of that process as a node, as in DcdConnectionEvent.
    pub node: u32,
    /// Number of that process as a client, as in DcdConnectionEvent.
    pub client: u32,
    /// Share of the packets sent that got lost on the way, 0 to 1.
    pub loss: f32,
    /// Round trip, seconds.
    pub rtt: f64,
    /// Time since the connection came, seconds.
    pub age: f64,
    /// Bytes received over the connection, without those of QUIC itself.
    pub bytes_in: u64,
    /// Bytes sent over the connection, without those of QUIC itself.
    pub bytes_out: u64,
    /// Bytes of UDP received over the connection: those of bytes_in, and what QUIC adds, as DcdStats.udp_bytes_in.
    pub udp_bytes_in: u64,
    /// Bytes of UDP sent over the connection: those of bytes_out, and what QUIC adds.
    pub udp_bytes_out: u64,
    /// Messages received, dcd's own and those of programs, and datagrams.
    pub messages_in: u64,
    /// Messages and datagrams sent.
    pub messages_out: u64,
    /// Datagrams dropped at this end, because the link was full or nobody took them.
    pub dropped: u64,
    /// Bytes that wait because the link or the other end is slow.
    pub bytes_waiting: u64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdConnectionInfo {
    const NAME: &'static str = "DcdConnectionInfo";
}

/// Returns the role of a process, and its numbers as a node and as a client.
pub(crate) fn names(who: PeerName) -> (DcdRole, u32, u32) {
    let role = match who {
        PeerName::Server => DCD_ROLE_SERVER,
        PeerName::Node(_) => DCD_ROLE_NODE,
        PeerName::Client(_) => DCD_ROLE_CLIENT,
        PeerName::Participant(..) => DCD_ROLE_PARTICIPANT,
        PeerName::Builder(_) => DCD_ROLE_BUILDER,
    };
    (role, who.node().unwrap_or_default().0, who.client().unwrap_or_default().0)
}

impl DcdConnectionEvent {
    pub(crate) fn new(event: &ConnectionEvent, connection: DcdConnectionId) -> Self {
        let (role, node, client) = names(event.who);
        let (state, why) = match &event.change {
            ConnectionChange::Came => (DCD_CONNECTION_CAME, None),
            ConnectionChange::Lost(why) => (DCD_CONNECTION_LOST, Some(why)),
            ConnectionChange::Back => (DCD_CONNECTION_BACK, None),
            ConnectionChange::Gone(why) => (DCD_CONNECTION_GONE, Some(why)),
        };
        let (cause, why) = why.map_or((DCD_CAUSE_NONE, ""), |why| (number(why.cause), &why.text[..]));
        let mut reason = [0; DCD_MAX_REASON];
        // SAFETY: `reason` is an array of this size.
        unsafe { status::copy_text(why, reason.as_mut_ptr(), DCD_MAX_REASON) };
        Self { connection, state, role, node, client, cause, reserved: 0, reason }
    }
}

fn number(cause: Cause) -> DcdCause {
    match cause {
        Cause::Left => DCD_CAUSE_LEFT,
        Cause::SentAway => DCD_CAUSE_SENT_AWAY,
        Cause::Broken => DCD_CAUSE_BROKEN,
        Cause::Refused => DCD_CAUSE_REFUSED,
        Cause::WorldEnded => DCD_CAUSE_WORLD_ENDED,
        Cause::Replaced => DCD_CAUSE_REPLACED,
        Cause::Slow => DCD_CAUSE_SLOW,
        Cause::Unneeded => DCD_CAUSE_UNNEEDED,
        Cause::Failed => DCD_CAUSE_FAILED,
    }
}

impl From<&Connection> for DcdConnectionInfo {
    fn from(connection: &Connection) -> Self {
        let (role, node, client) = names(connection.who);
        let traffic = connection.traffic;
        Self {
            struct_size: size_of::<Self>() as u32,
            state: match (connection.is_up, connection.links) {
                (false, _) => DCD_CONNECTION_LOST,
                (true, 1) => DCD_CONNECTION_CAME,
                (true, _) => DCD_CONNECTION_BACK,
            },
            role,
            node,
            client,
            loss: (traffic.packets_lost as f64 / traffic.packets_out.max(1) as f64) as f32,
            rtt: traffic.rtt.as_secs_f64(),
            age: connection.age.as_secs_f64(),
            bytes_in: traffic.bytes_in,
            bytes_out: traffic.bytes_out,
            udp_bytes_in: traffic.udp_bytes_in,
            udp_bytes_out: traffic.udp_bytes_out,
            messages_in: traffic.frames_in + traffic.datagrams_in,
            messages_out: traffic.frames_out + traffic.datagrams_out,
            dropped: traffic.datagrams_dropped + connection.dropped,
            bytes_waiting: traffic.bytes_waiting,
        }
    }
}

/// Returns why something cannot be done with a connection.
pub(crate) fn failure(connection: DcdConnectionId, error: dcd::Error) -> Failure {
    match error {
        dcd::Error::Connection(ConnectionError::Gone) => stale("connection", connection.v),
        error => error.into(),
    }
}
