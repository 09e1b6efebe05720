//! Lists connections, ends them, and waits for what comes over them.

use std::ffi::c_char;
use std::time::Duration;

use super::{DCD_MAX_REASON, DcdConnectionInfo, failure};
use crate::guard::guard;
use crate::handle::stale;
use crate::ids::{DcdConnectionId, DcdWorld};
use crate::pointer::{self, Out, Room};
use crate::registry::{ask, with};
use crate::status::{DCD_ERR_TIMEOUT, DcdStatus, Failure};

/// Lists the connections of a world, oldest first. Writes the ids to `out`, which has `cap` entries, and their number to `count`.
/// With `cap` 0, `out` may be null, to ask for the number.
///
/// A server has a connection with each node, client and participant. Others have one with their server, and those with nodes and
/// clients that their share of the world, or their avatars, ask for. A local world has none.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_connections(
    world: DcdWorld,
    out: *mut DcdConnectionId,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_connections", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            out.fill(
                world.dcd.connections().into_iter().map(|connection| world.mark.connection(connection.id)),
            )
        })
    })
}

/// Reads the state and figures of a connection.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also once the connection is gone), DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_connection_info(
    world: DcdWorld,
    connection: DcdConnectionId,
    out: *mut DcdConnectionInfo,
) -> DcdStatus {
    guard("dcd_connection_info", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let id = world.mark.connection_id(connection)?;
            let found = world.dcd.connection(id);
            out.write((&found.ok_or_else(|| stale("connection", connection.v))?).into());
            Ok(())
        })
    })
}

/// Disconnects a process from a server's world, and returns at once. The process is told `reason`, a text shorter than
/// DCD_MAX_REASON, or null for none. A node's regions are handed over first. A client's avatars wait for its return, which takes a
/// new token. DCD_CONNECTION_GONE tells when the process is gone. There its dcd_step returns DCD_ERR_NETWORK with the reason.
///
/// To leave a world, call dcd_world_destroy.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a reason that is too long), DCD_ERR_UNSUPPORTED (the world is not a
/// server).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_disconnect(
    world: DcdWorld,
    connection: DcdConnectionId,
    reason: *const c_char,
) -> DcdStatus {
    guard("dcd_disconnect", || {
        let reason = match reason.is_null() {
            true => "no reason is given",
            // SAFETY: the caller vouches for the text.
            false => unsafe { pointer::text(reason, "reason")? },
        };
        if reason.len() >= DCD_MAX_REASON {
            let length = reason.len();
            return Err(Failure::argument(format!(
                "a reason of {length} bytes is too long; give less than DCD_MAX_REASON ({DCD_MAX_REASON})"
            )));
        }
        with(world, |world| {
            world.dcd.has_network("send processes away")?;
            let id = world.mark.connection_id(connection)?;
            world.dcd.disconnect(id, reason).map_err(|error| failure(connection, error))
        })
    })
}

/// Waits until something has come that the next dcd_step would take in, but not longer than `timeout_ms` milliseconds: states and
/// events of a client's world, messages, changes of connections, or the end of the world. In a local world it does not wait at all.
/// Once the world has ended or the server is given up, it returns at once, and dcd_step says why. Other calls on the world do not
/// wait for this one.
///
/// Errors: DCD_ERR_TIMEOUT (nothing has come), DCD_ERR_NULL, DCD_ERR_STALE_ID.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_poll(world: DcdWorld, timeout_ms: u32) -> DcdStatus {
    guard("dcd_poll", || {
        let Some(arrivals) = with(world, |world| Ok(world.dcd.arrivals()))? else { return Ok(()) };
        match arrivals.wait(Duration::from_millis(timeout_ms.into())) {
            true => Ok(()),
            false => {
                let message = format!("nothing has come within {timeout_ms} ms; go on, and ask again");
                Err(Failure::new(DCD_ERR_TIMEOUT, message))
            }
        }
    })
}
