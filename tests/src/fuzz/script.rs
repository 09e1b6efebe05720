//! Reads and writes events as bytes: a kind, the sender, the time since the event before, and a message. Any
//! bytes are some sequence of events, so every mutated script is a script.

use std::time::Duration;

use dcd::cluster::Peer;
use dcd::{ClientId, NodeId};

/// The most events that are read from a script: longer scripts find no more than short ones.
const MOST: usize = 4_096;
/// The length of an event's head: kind, peer, milliseconds, and two bytes of length.
const HEAD_BYTES: usize = 5;

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A message arrives.
    Said,
    /// A link is established.
    Connected,
    /// A link is lost.
    Disconnected,
    /// Time passes.
    Waited,
    /// The process's own user asks for something.
    Wanted,
}

/// An event in its encoded form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Event<'a> {
    /// The code of its [`Kind`].
    pub(super) kind: u8,
    /// The code of its [`Event::peer`].
    pub(super) from: u8,
    /// The time since the event before, milliseconds.
    pub(super) after_ms: u8,
    /// The bytes of its message.
    pub(super) bytes: &'a [u8],
}

const KINDS: [Kind; 8] = [
    Kind::Said,
    Kind::Connected,
    Kind::Disconnected,
    Kind::Waited,
    Kind::Wanted,
    Kind::Said,
    Kind::Said,
    Kind::Said,
];
const PEERS: [Peer; 8] = [
    Peer::Server,
    Peer::Node(NodeId(1)),
    Peer::Node(NodeId(2)),
    Peer::Node(NodeId(3)),
    Peer::Node(NodeId(4)),
    Peer::Client(ClientId(1)),
    Peer::Client(ClientId(2)),
    Peer::Client(ClientId(3)),
];

impl Event<'_> {
    /// Returns the kind of the event.
    pub(super) fn kind(&self) -> Kind {
        KINDS[usize::from(self.kind) % KINDS.len()]
    }

    /// Returns the process that the event is from.
    pub(super) fn peer(&self) -> Peer {
        PEERS[usize::from(self.from) % PEERS.len()]
    }

    /// Returns the time since the event before.
    pub(super) fn after(&self) -> Duration {
        Duration::from_millis(self.after_ms.into())
    }
}

/// Appends an event.
pub(super) fn put(to: &mut Vec<u8>, kind: Kind, from: Peer, after: Duration, bytes: &[u8]) {
    let code = |found: Option<usize>| found.expect("it is one of eight") as u8;
    let kind = code(KINDS.iter().position(|known| *known == kind));
    let from = code(PEERS.iter().position(|known| *known == from));
    let after_ms = after.as_millis().min(255) as u8;
    put_event(to, &Event { kind, from, after_ms, bytes });
}

/// Appends an event in its encoded form.
pub(super) fn put_event(to: &mut Vec<u8>, event: &Event<'_>) {
    // Longer messages are cut off: two bytes hold the length.
    let bytes = &event.bytes[..event.bytes.len().min(u16::MAX.into())];
    to.extend([event.kind, event.from, event.after_ms]);
    to.extend((bytes.len() as u16).to_le_bytes());
    to.extend(bytes);
}

/// Returns the events of a script.
pub(super) fn events(script: &[u8]) -> impl Iterator<Item = Event<'_>> {
    let mut rest = script;
    let next = move || {
        let (head, after) = rest.split_first_chunk::<HEAD_BYTES>()?;
        let [kind, from, after_ms, low, high] = *head;
        let length = usize::from(u16::from_le_bytes([low, high])).min(after.len());
        let (bytes, further) = after.split_at(length);
        rest = further;
        Some(Event { kind, from, after_ms, bytes })
    };
    std::iter::from_fn(next).take(MOST)
}
