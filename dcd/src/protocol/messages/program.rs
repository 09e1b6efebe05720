//! Between the programs at both ends of a link. The world does not know of it.

use bincode::{Decode, Encode};

/// What a server's program and that of a node or client say to each other, in bytes of their own.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Program {
    /// Arrives once and in order, as long as the link lasts; at most
    /// [`PROGRAM_MESSAGE_BYTES`](crate::protocol::PROGRAM_MESSAGE_BYTES).
    Message(Vec<u8>),
    /// May be lost, or overtaken; at most [`PROGRAM_DATAGRAM_BYTES`](crate::protocol::PROGRAM_DATAGRAM_BYTES).
    Datagram(Vec<u8>),
    /// How much of the messages on this link the program has taken so far: room for more of them.
    Taken(u64),
}
