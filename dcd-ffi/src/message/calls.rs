//! Sends messages to the program at the other end of a connection.

use std::ffi::c_void;

use dcd::runtime::Delivery;

use super::{DCD_MAX_DATAGRAM, DCD_MAX_MESSAGE, DCD_SEND_UNRELIABLE};
use crate::connection::failure;
use crate::guard::guard;
use crate::ids::{DcdConnectionId, DcdWorld};
use crate::pointer;
use crate::registry::with;
use crate::status::{DcdStatus, Failure};

/// Sends `size` bytes to the program at the other end of a connection. There they are among the messages of dcd_events after its
/// next dcd_step. A server's program speaks with that of every node, client and participant. Those speak with the server's only:
/// what one client has to say to another passes through the server's program.
///
/// - Messages. With `flags` 0 a message arrives once and in order, as long as the link lasts. It has at most DCD_MAX_MESSAGE bytes.
/// - Datagrams. With DCD_SEND_UNRELIABLE it is a datagram of at most DCD_MAX_DATAGRAM bytes, which may be lost or overtaken, and
///   never waits.
/// - Broken links. Messages on their way when a link breaks (DCD_CONNECTION_LOST) are lost.
/// - Slow readers. The world never waits for messages, and a program that makes no steps takes none. Then up to 128 KiB wait there
///   and as much here, counting 64 bytes more for each message. Beyond that the call gives DCD_ERR_BUSY.
/// - Dropped datagrams. Where 64 KiB of datagrams wait, the newest are dropped, and counted (DcdConnectionInfo.dropped).
///
/// The call copies the bytes and returns at once. `data` may be null when `size` is 0.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: too many bytes, or unknown flags.
/// - DCD_ERR_BUSY: too much waits already.
/// - DCD_ERR_NETWORK: the connection is lost.
/// - DCD_ERR_UNSUPPORTED: in a local world, and when neither end is a server.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_send(
    world: DcdWorld,
    connection: DcdConnectionId,
    data: *const c_void,
    size: usize,
    flags: u32,
) -> DcdStatus {
    guard("dcd_send", || {
        let (delivery, most, name) = match flags {
            0 => (Delivery::Message, DCD_MAX_MESSAGE, "DCD_MAX_MESSAGE"),
            DCD_SEND_UNRELIABLE => (Delivery::Datagram, DCD_MAX_DATAGRAM, "DCD_MAX_DATAGRAM"),
            _ => return Err(Failure::argument(format!("flags is {flags:#x}; give bits DCD_SEND_..."))),
        };
        if size > most {
            let cause = format!("{size} bytes are more than {name} ({most}); send them in parts");
            return Err(Failure::argument(cause));
        }
        // SAFETY: the caller vouches for `size` bytes.
        let bytes = unsafe { pointer::slice(data.cast::<u8>(), size, "data")? };
        with(world, |world| {
            world.dcd.has_network("send messages")?;
            let id = world.mark.connection_id(connection)?;
            world.dcd.send(id, bytes, delivery).map_err(|error| failure(connection, error))
        })
    })
}
