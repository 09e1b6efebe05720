//! Replays a server: gives its recorded events to a machine of its own, and compares everything that it sends
//! and stores.

use std::time::Duration;

use bincode::{Decode, Encode};

use super::entries::Entries;
use super::entry::{put, take_whole};
use super::replayed::{Flip, Replayed, Settled, Who};
use super::{BodyBits, Cut, Maker, Readout, RecordingError};
use crate::cluster::{
    CanBuild, Grouping, Peer, Server, ServerConfig, ServerEvent, ServerOrigin, ServerOutput,
};
use crate::protocol::{EnvironmentProperties, Message, Query};
use crate::space::{BodyId, ClientId, NodeId, RegionId, Tick, Viewpoint};

/// The region id that stands for a server, whose digest has no region.
const WHOLE: RegionId = RegionId(0);

/// What happened to a server. Messages are recorded by reference and read as values.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) enum ServerEntry<M = Message> {
    /// A part of a value that may not fit an entry.
    Part(Vec<u8>),
    /// The parts before were the seed.
    Begun,
    Disconnected(Peer),
    Message {
        from: Peer,
        message: M,
    },
    SendAway {
        node: Option<NodeId>,
        client: Option<ClientId>,
        reason: String,
    },
    Stop,
    /// The parts before were what the program did.
    Program,
    Save,
    Ask(Query),
    Forget(u64),
    Suspend,
    Timeout,
    /// The digest of everything that the server had sent and stored when it knew of this tick.
    Told {
        tick: Tick,
        digest: [u8; 8],
    },
    Drain(NodeId),
    /// The parts before were the world that replaced it.
    Replace,
    MayBuild(ClientId),
    Look(Vec<Viewpoint>),
}

/// The configuration of a server, and what it began with.
#[derive(Clone, Debug, Encode, Decode)]
struct ServerSeed {
    world: EnvironmentProperties,
    incarnation: u64,
    min_nodes: u64,
    grouping: Grouping,
    avatar_expiry: Duration,
    events: bool,
    origin: ServerOrigin,
}

/// Returns the seed of a server's recording.
pub(super) fn seed(config: &ServerConfig, origin: &ServerOrigin) -> impl Encode {
    let ServerConfig { world, incarnation, min_nodes, grouping, avatar_expiry, events, can_build: _ } =
        config.clone();
    let (min_nodes, origin) = (min_nodes as u64, origin.clone());
    ServerSeed { world, incarnation, min_nodes, grouping, avatar_expiry, events, origin }
}

/// The running digest of what a server sends and stores, in order.
#[derive(Clone, Debug, Default)]
pub struct Sent {
    hasher: blake3::Hasher,
    bytes: Vec<u8>,
}

impl Sent {
    /// Adds an output, if it is something sent or stored.
    pub fn add(&mut self, output: &ServerOutput) {
        self.bytes.clear();
        match output {
            ServerOutput::Send { to, message } => put(&mut self.bytes, &(0_u8, to, message)),
            ServerOutput::Store(batch) => put(&mut self.bytes, &(1_u8, batch)),
            _ => return,
        }
        self.hasher.update(&self.bytes);
    }

    /// Returns the digest so far.
    pub fn digest(&self) -> u64 {
        let mut first = [0; 8];
        first.copy_from_slice(&self.hasher.finalize().as_bytes()[..8]);
        u64::from_le_bytes(first)
    }
}

/// The replay of a server.
pub(super) struct ServerReplay {
    entries: Entries,
    server: Server,
    began: Tick,
    sent: Sent,
    parts: Vec<u8>,
}

impl ServerReplay {
    pub(super) fn begin(mut entries: Entries, can_build: CanBuild) -> Result<Self, RecordingError> {
        let mut parts = Vec::new();
        loop {
            match entries.next()?.ok_or(RecordingError::Empty)? {
                ServerEntry::<Message>::Part(part) => parts.extend(part),
                ServerEntry::Begun => break,
                _ => return Err(RecordingError::Undecodable("it has no seed".into())),
            }
        }
        let ServerSeed { world, incarnation, min_nodes, grouping, avatar_expiry, events, origin } =
            take_whole(&parts)?;
        let min_nodes = (min_nodes as usize).max(1);
        let config =
            ServerConfig { world, incarnation, min_nodes, grouping, avatar_expiry, events, can_build };
        let server = Server::of(config, origin);
        let server = server.map_err(|error| RecordingError::Undecodable(error.to_string()))?;
        let began = server.tick();
        Ok(Self { entries, server, began, sent: Sent::default(), parts: Vec::new() })
    }

    /// Adds the outputs of an event to the digest.
    fn drain(&mut self) {
        while let Some(output) = self.server.poll_output() {
            self.sent.add(&output);
        }
    }
}

impl Replayed for ServerReplay {
    fn who(&self) -> Who {
        Who::Server
    }

    fn maker(&self) -> &Maker {
        self.entries.maker()
    }

    fn cut(&self) -> Option<Cut> {
        self.entries.cut()
    }

    fn hash(&self) -> [u8; 8] {
        self.entries.hash()
    }

    fn world(&self) -> Option<u64> {
        Some(self.server.incarnation())
    }

    fn began(&self) -> Option<Tick> {
        Some(self.began)
    }

    fn readout(&self) -> &dyn Readout {
        &NoRegions
    }

    fn flip(&mut self, _flip: Flip) {}

    fn has_flipped(&self) -> bool {
        false
    }

    fn acted_on(&self, _body: BodyId) -> Vec<String> {
        Vec::new()
    }

    fn advance(&mut self) -> Result<Option<Settled>, RecordingError> {
        while let Some(entry) = self.entries.next::<ServerEntry>()? {
            let event = match entry {
                ServerEntry::Part(part) => {
                    self.parts.extend(part);
                    continue;
                }
                ServerEntry::Begun => {
                    return Err(RecordingError::Undecodable("it has two seeds".into()));
                }
                ServerEntry::Told { tick, digest } => {
                    let recorded = vec![(WHOLE, u64::from_le_bytes(digest))];
                    let replayed = vec![(WHOLE, self.sent.digest())];
                    return Ok(Some(Settled { tick, recorded, replayed }));
                }
                ServerEntry::Timeout => {
                    self.server.handle_timeout(self.entries.now());
                    self.drain();
                    continue;
                }
                ServerEntry::Program => ServerEvent::Program(take_whole(&std::mem::take(&mut self.parts))?),
                ServerEntry::Replace => {
                    ServerEvent::Replace(Box::new(take_whole(&std::mem::take(&mut self.parts))?))
                }
                ServerEntry::MayBuild(client) => ServerEvent::MayBuild(client),
                ServerEntry::Look(viewpoints) => ServerEvent::Look(viewpoints),
                ServerEntry::Disconnected(peer) => ServerEvent::Disconnected(peer),
                ServerEntry::Message { from, message } => ServerEvent::Message { from, message },
                ServerEntry::SendAway { node, client, reason } => {
                    ServerEvent::SendAway { node, client, reason }
                }
                ServerEntry::Drain(node) => ServerEvent::Drain(node),
                ServerEntry::Stop => ServerEvent::Stop,
                ServerEntry::Save => ServerEvent::Save,
                ServerEntry::Ask(question) => ServerEvent::Ask(question),
                ServerEntry::Forget(number) => ServerEvent::Forget(number),
                ServerEntry::Suspend => ServerEvent::Suspend,
            };
            self.server.handle(self.entries.now(), event);
            self.drain();
        }
        Ok(None)
    }
}

/// The regions of a server, which computes none.
struct NoRegions;

impl Readout for NoRegions {
    fn regions(&self) -> Vec<RegionId> {
        Vec::new()
    }

    fn bodies(&self, _region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_> {
        Box::new(std::iter::empty())
    }

    fn set(&mut self, _body: BodyId, _bits: &BodyBits) -> bool {
        false
    }

    fn touching(&self, _body: BodyId) -> Vec<BodyId> {
        Vec::new()
    }
}
