//! Defines the entries of a recording, and their form in bytes.

use std::net::SocketAddr;
use std::time::Duration;

use bincode::config::{Configuration, Limit};
use bincode::{Decode, Encode};

use super::{Maker, RecordingError};
use crate::cluster::{NodeConfig, Peer};
use crate::protocol::{Area, FromClient, Message};
use crate::space::{ClientId, NodeId, RegionId, Tick};

/// The encoding of entries. Its limit leaves room for the longest message.
const CONFIG: Configuration<bincode::config::LittleEndian, bincode::config::Varint, Limit<{ 32 << 20 }>> =
    bincode::config::standard().with_limit::<{ 32 << 20 }>();

/// The first entry: what was recorded, and by which build and machine.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) struct Beginning {
    pub(super) maker: Maker,
    pub(super) subject: Subject,
}

/// The kind of process that is recorded.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) enum Subject {
    /// A node, and whether its physics is the simulator's.
    Node { seed: NodeSeed, stand_in: bool },
    /// A local world.
    Local,
    /// A server; its seed follows.
    Server,
}

/// The configuration of a node.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) struct NodeSeed {
    id: NodeId,
    address: SocketAddr,
    client: Option<ClientId>,
    interest: Option<Area>,
    checkpoint_every: u64,
    patience: Duration,
}

impl From<&NodeConfig> for NodeSeed {
    fn from(config: &NodeConfig) -> Self {
        let NodeConfig { id, address, client, interest, checkpoint_every, patience } = *config;
        Self { id, address, client, interest, checkpoint_every, patience }
    }
}

impl From<&NodeSeed> for NodeConfig {
    fn from(seed: &NodeSeed) -> Self {
        let NodeSeed { id, address, client, interest, checkpoint_every, patience } = *seed;
        Self { id, address, client, interest, checkpoint_every, patience }
    }
}

/// An entry after the first one: the nanoseconds since the entry before, and what happened.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) struct Entry<W> {
    pub(super) after_ns: u64,
    pub(super) what: W,
}

/// What happened to a node. Messages are recorded by reference and read as values.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) enum NodeEntry<M = Message, C = FromClient> {
    Connected(Peer),
    Disconnected(Peer),
    Message {
        from: Peer,
        message: M,
    },
    Client(C),
    Leave,
    Timeout,
    /// The physics had done its work, in this time. Its answer told this load of regions, and these times of
    /// theirs ([`RegionState::times_ms`](crate::fidelity::RegionState::times_ms)). All else in the answer is
    /// computed again.
    Answered {
        compute_us: u32,
        step_us: Vec<f64>,
        region_ms: Vec<[f32; 3]>,
    },
    Settled(Digests),
    /// The run of this number, which computes another member's work once more, had given its next answer. The
    /// answer is computed again.
    Verified(u64),
}

/// The digests of regions after a tick.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) struct Digests {
    pub(super) tick: Tick,
    /// The regions; `None` if they are the same as before.
    pub(super) regions: Option<Vec<RegionId>>,
    /// The digests, in the order of the regions.
    pub(super) digests: Vec<[u8; 8]>,
}

/// Appends an entry.
pub(super) fn put(to: &mut Vec<u8>, entry: &impl Encode) {
    bincode::encode_into_std_write(entry, to, CONFIG).expect("plain values in memory encode");
}

/// Decodes a value that was recorded in parts, however long it is: recordings are trusted.
pub(super) fn take_whole<T: Decode<()>>(bytes: &[u8]) -> Result<T, RecordingError> {
    let decoded = bincode::decode_from_slice(bytes, bincode::config::standard());
    decoded.map(|(value, _)| value).map_err(|error| RecordingError::Undecodable(error.to_string()))
}

/// Takes the next entry of a chunk.
pub(super) fn take<T: Decode<()>>(from: &mut &[u8]) -> Result<T, RecordingError> {
    let (entry, read) = bincode::decode_from_slice(from, CONFIG)
        .map_err(|error| RecordingError::Undecodable(error.to_string()))?;
    *from = &from[read..];
    Ok(entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_recorded_in_parts_is_read_whole_however_long_it_is() {
        // Short when encoded, and more in memory than an entry may take.
        let world = vec![0_u64; 5 << 20];
        let mut bytes = Vec::new();
        put(&mut bytes, &world);
        assert!(take::<Vec<u64>>(&mut &bytes[..]).is_err(), "it fits an entry: this says nothing");
        assert!(take_whole::<Vec<u64>>(&bytes).unwrap() == world);
    }
}
