//! Defines the application messages between the programs at both ends of a link. The world ignores them;
//! their queues and flow control are in `runtime/connections/mail.rs`.

use bincode::{Decode, Encode};

/// A message between a server's program and that of a node or client, whose bytes the programs define.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Program {
    /// A message that arrives once and in order, as long as the link lasts; at most
    /// [`PROGRAM_MESSAGE_BYTES`](crate::protocol::PROGRAM_MESSAGE_BYTES).
    Message(Vec<u8>),
    /// A datagram that may be lost or overtaken; at most
    /// [`PROGRAM_DATAGRAM_BYTES`](crate::protocol::PROGRAM_DATAGRAM_BYTES).
    Datagram(Vec<u8>),
    /// The total of the messages on this link that the program has taken so far, which makes room for more.
    Taken(u64),
}
