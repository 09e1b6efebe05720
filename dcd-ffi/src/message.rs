//! What programs at both ends of a connection say to each other.

use std::ffi::c_void;

use dcd::protocol::{PROGRAM_DATAGRAM_BYTES, PROGRAM_MESSAGE_BYTES};
use dcd::runtime::{Delivery, ProgramMessage};

use crate::connection::{DcdConnectionId, failure, names};
use crate::guard::guard;
use crate::handle::Mark;
use crate::pinned::Pinned;
use crate::pointer;
use crate::status::{DcdStatus, Failure};
use crate::world::{DcdRole, DcdWorld, with};

/// In dcd_send's flags and DcdMessage.flags: a datagram, which may be lost or overtaken.
pub const DCD_SEND_UNRELIABLE: u32 = 1;

/// Bytes of a message at most.
pub const DCD_MAX_MESSAGE: usize = 32_768;
/// Bytes of one with DCD_SEND_UNRELIABLE at most.
pub const DCD_MAX_DATAGRAM: usize = 1_024;

const _: () = assert!(DCD_MAX_MESSAGE == PROGRAM_MESSAGE_BYTES && DCD_MAX_DATAGRAM == PROGRAM_DATAGRAM_BYTES);

/// What the program at the other end of a connection sent by dcd_send.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdMessage {
    /// Over which connection; to answer by.
    pub connection: DcdConnectionId,
    /// The bytes, as they were sent, at an address for any type; null when there are none.
    pub data: *const c_void,
    /// How many.
    pub size: usize,
    /// What the sender is, as in DcdConnectionEvent.
    pub role: DcdRole,
    /// As in DcdConnectionEvent.
    pub node: u32,
    /// As in DcdConnectionEvent.
    pub client: u32,
    /// DCD_SEND_… bits.
    pub flags: u32,
}

// SAFETY: a plain value; whoever follows its pointer keeps to how long the bytes live, in any thread.
unsafe impl Send for DcdMessage {}

/// Messages with their bytes, lent to C.
#[derive(Default)]
pub(crate) struct Messages {
    pub list: Pinned<DcdMessage>,
    /// Words, so that all begin at an address for any type.
    words: Pinned<u64>,
}

impl Messages {
    pub(crate) fn refill(&mut self, messages: &[ProgramMessage], mark: Mark) {
        const WORD: usize = size_of::<u64>();
        let count = messages.iter().map(|message| message.bytes.len().div_ceil(WORD)).sum();
        // No more than `count`, which keeps them where they are.
        let words = self.words.refill(count);
        self.list.refill(messages.len()).extend(messages.iter().map(|message| {
            let (role, node, client) = names(message.who);
            let data = words.as_ptr().wrapping_add(words.len());
            words.extend(message.bytes.chunks(WORD).map(|chunk| {
                let mut word = [0; WORD];
                word[..chunk.len()].copy_from_slice(chunk);
                u64::from_ne_bytes(word)
            }));
            DcdMessage {
                connection: mark.connection(message.from),
                data: if message.bytes.is_empty() { std::ptr::null() } else { data.cast() },
                size: message.bytes.len(),
                role,
                node,
                client,
                flags: if message.delivery == Delivery::Datagram { DCD_SEND_UNRELIABLE } else { 0 },
            }
        }));
    }
}

/// Sends `size` bytes to the program at the other end of a connection, where they are among the messages of dcd_events after
/// its next dcd_step. A server's program speaks with that of every node, client and participant, and those with the server's only:
/// what one client has to say to another passes through the server's program.
///
/// A message, with `flags` 0, arrives once and in order, as long as the link lasts; it has DCD_MAX_MESSAGE bytes at most. With
/// DCD_SEND_UNRELIABLE it is a datagram of DCD_MAX_DATAGRAM bytes at most, which may be lost or overtaken, and never waits.
/// What is on its way when a link breaks (DCD_CONNECTION_LOST) is lost.
///
/// The world never waits for messages. A program that makes no steps takes none: then up to 128 KiB wait there and as much
/// here, counting 64 bytes more for each, and then the call is DCD_ERR_BUSY. Of datagrams the newest are dropped where 64 KiB
/// wait, and counted (DcdConnectionInfo.dropped).
///
/// The call copies the bytes and returns at once. `data` may be null when `size` is 0.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for too many bytes or unknown flags, DCD_ERR_BUSY when too much waits
/// already, DCD_ERR_NETWORK while the connection is lost, DCD_ERR_UNSUPPORTED in a local world, and when neither end is a server.
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
            let network = world.backend.networked("send messages")?;
            let id = world.mark.connection_id(connection)?;
            network.connections.send(id, bytes, delivery).map_err(|error| failure(connection, error))
        })
    })
}
