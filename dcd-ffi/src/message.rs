//! Declares the messages that programs at both ends of a connection send each other, and lends those received to C.

mod calls;

use std::ffi::c_void;

use dcd::protocol::{PROGRAM_DATAGRAM_BYTES, PROGRAM_MESSAGE_BYTES};
use dcd::runtime::{Delivery, ProgramMessage};

use crate::connection::names;
use crate::handle::Mark;
use crate::ids::DcdConnectionId;
use crate::pinned::Pinned;
use crate::role::DcdRole;
pub use calls::*;

/// In the flags of dcd_send and DcdMessage.flags: the message is a datagram, which may be lost or overtaken.
pub const DCD_SEND_UNRELIABLE: u32 = 1;

/// Largest size of a message, bytes.
pub const DCD_MAX_MESSAGE: usize = 32_768;
/// Largest size of a message with DCD_SEND_UNRELIABLE, bytes.
pub const DCD_MAX_DATAGRAM: usize = 1_024;

const _: () = assert!(DCD_MAX_MESSAGE == PROGRAM_MESSAGE_BYTES && DCD_MAX_DATAGRAM == PROGRAM_DATAGRAM_BYTES);

/// Message that the program at the other end of a connection sent by dcd_send.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdMessage {
    /// Connection over which the message came. Answer by it.
    pub connection: DcdConnectionId,
    /// Bytes of the message, as they were sent, at an address for any type; null when there are none.
    pub data: *const c_void,
    /// Number of bytes.
    pub size: usize,
    /// Role of the sender, as in DcdConnectionEvent.
    pub role: DcdRole,
    /// Number of the sender as a node, as in DcdConnectionEvent.
    pub node: u32,
    /// Number of the sender as a client, as in DcdConnectionEvent.
    pub client: u32,
    /// DCD_SEND_… bits.
    pub flags: u32,
}

// SAFETY: a plain value. Whoever follows its pointer, in any thread, keeps to how long the bytes live.
unsafe impl Send for DcdMessage {}
// SAFETY: as above.
unsafe impl Sync for DcdMessage {}

/// Messages with their bytes, lent to C.
#[derive(Default)]
pub(crate) struct Messages {
    pub list: Pinned<DcdMessage>,
    /// Bytes of all messages, as words, so that each begins at an address for any type.
    words: Pinned<u64>,
}

impl Messages {
    pub(crate) fn refill(&mut self, messages: &[ProgramMessage], mark: Mark) {
        const WORD: usize = size_of::<u64>();
        let count = messages.iter().map(|message| message.bytes.len().div_ceil(WORD)).sum();
        // No more than `count` words, so that they stay where they are.
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
