//! Records what a process is given: packs entries into chunks, and ends the recording when writing fails.

use std::io::{self, Write};
use std::time::Duration;

use bincode::Encode;
use tracing::warn;

use super::entry::{Beginning, Digests, Entry, NodeEntry, NodeSeed, Subject, put};
use super::error::RecordingError;
use super::local::{LocalEntry, Operation};
use super::ring::Ring;
use super::server::{self, ServerEntry};
use super::{Maker, file};
use crate::cluster::{NodeConfig, NodeEvent, PhysicsEvent, ServerConfig, ServerEvent, ServerOrigin};
use crate::fidelity::RegionState;
use crate::protocol::{FromClient, Message};
use crate::space::{RegionId, Tick};

/// The size from which on a chunk is written, bytes.
const CHUNK: usize = 64 << 10;
/// The time since the last chunk after which the end of a tick writes the next. This is what a killed process
/// loses of its recording.
const FLUSH: Duration = Duration::from_millis(100);
/// The size of each part of a value that may not fit an entry, bytes.
const PART: usize = 1 << 20;

/// The recorder of one process.
pub struct Recorder {
    /// `None` once it has failed or ended.
    out: Option<Out>,
    failure: Option<io::Error>,
    chunk: Vec<u8>,
    now: Duration,
    flushed: Duration,
    regions: Vec<RegionId>,
}

enum Out {
    File { to: Box<dyn Write + Send + Sync>, before: [u8; 8] },
    Ring(Ring),
}

impl Out {
    fn to(mut to: impl Write + Send + Sync + 'static) -> io::Result<Self> {
        file::begin(&mut to)?;
        Ok(Self::File { to: Box::new(to), before: [0; 8] })
    }
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("now", &self.now).finish_non_exhaustive()
    }
}

impl Recorder {
    /// Begins the recording of a node. `stand_in` is whether its physics is the simulator's.
    pub fn of_node(
        to: impl Write + Send + Sync + 'static,
        config: &NodeConfig,
        stand_in: bool,
    ) -> io::Result<Self> {
        Self::begin(Out::to(to)?, Subject::Node { seed: NodeSeed::from(config), stand_in })
    }

    /// Begins the recording of a server.
    pub fn of_server(
        to: impl Write + Send + Sync + 'static,
        config: &ServerConfig,
        origin: &ServerOrigin,
    ) -> io::Result<Self> {
        let mut recorder = Self::begin(Out::to(to)?, Subject::Server)?;
        recorder.put_parts(&server::seed(config, origin));
        recorder.put::<ServerEntry<&Message>>(Duration::ZERO, ServerEntry::Begun);
        recorder.flush();
        Ok(recorder)
    }

    /// Begins the recording of a local world.
    pub fn of_local(to: impl Write + Send + Sync + 'static) -> io::Result<Self> {
        Self::begin(Out::to(to)?, Subject::Local)
    }

    /// Begins a recording in memory of at least the last `time` of a local world.
    pub fn of_local_for(time: Duration) -> Self {
        Self::begin(Out::Ring(Ring::new(time)), Subject::Local).expect("memory can be written")
    }

    fn begin(out: Out, subject: Subject) -> io::Result<Self> {
        let mut chunk = Vec::new();
        put(&mut chunk, &Beginning { maker: Maker::here(), subject });
        let mut recorder = Self {
            out: Some(out),
            failure: None,
            chunk,
            now: Duration::ZERO,
            flushed: Duration::ZERO,
            regions: Vec::new(),
        };
        recorder.flush();
        Ok(recorder)
    }

    /// Records an event that a node is about to take in.
    pub fn node_event(&mut self, now: Duration, event: &NodeEvent) {
        let what: NodeEntry<&Message, &FromClient> = match event {
            NodeEvent::Connected(peer) => NodeEntry::Connected(*peer),
            NodeEvent::Disconnected(peer) => NodeEntry::Disconnected(*peer),
            NodeEvent::Message { from, message } => NodeEntry::Message { from: *from, message },
            NodeEvent::Client(message) => NodeEntry::Client(message),
            NodeEvent::Leave => NodeEntry::Leave,
            NodeEvent::Physics(event) => answered(event),
        };
        self.put(now, what);
    }

    /// Records that a node's time-out is about to be handled.
    pub fn node_timeout(&mut self, now: Duration) {
        self.put::<NodeEntry<&Message, &FromClient>>(now, NodeEntry::Timeout);
    }

    /// Records the digests of all regions of a node after a tick.
    pub fn settled(&mut self, now: Duration, tick: Tick, digests: &[(RegionId, u64)]) {
        let digests = self.digests(tick, digests);
        self.put::<NodeEntry<&Message, &FromClient>>(now, NodeEntry::Settled(digests));
        self.flush_if_due();
    }

    /// Records an event that a server is about to take in.
    pub fn server_event(&mut self, now: Duration, event: &ServerEvent) {
        let entry = match event {
            ServerEvent::Disconnected(peer) => ServerEntry::Disconnected(*peer),
            ServerEvent::Message { from, message } => ServerEntry::Message { from: *from, message },
            ServerEvent::SendAway { node, client, reason } => {
                ServerEntry::SendAway { node: *node, client: *client, reason: reason.clone() }
            }
            ServerEvent::Drain(node) => ServerEntry::Drain(*node),
            ServerEvent::Stop => ServerEntry::Stop,
            ServerEvent::Program(ops) => {
                self.put_parts(ops);
                ServerEntry::Program
            }
            ServerEvent::Look(viewpoints) => ServerEntry::Look(viewpoints.clone()),
            ServerEvent::Replace(saved) => {
                self.put_parts(saved);
                ServerEntry::Replace
            }
            ServerEvent::MayBuild(client) => ServerEntry::MayBuild(*client),
            ServerEvent::Save => ServerEntry::Save,
            ServerEvent::Ask(question) => ServerEntry::Ask(question.clone()),
            ServerEvent::Forget(number) => ServerEntry::Forget(*number),
            ServerEvent::Suspend => ServerEntry::Suspend,
        };
        self.put(now, entry);
    }

    /// Records that a server's time-out is about to be handled.
    pub fn server_timeout(&mut self, now: Duration) {
        self.put::<ServerEntry<&Message>>(now, ServerEntry::Timeout);
    }

    /// Records the digest of all that a server has sent and stored so far.
    pub fn server_told(&mut self, now: Duration, tick: Tick, digest: u64) {
        self.put::<ServerEntry<&Message>>(now, ServerEntry::Told { tick, digest: digest.to_le_bytes() });
        self.flush_if_due();
    }

    /// Records a value that may not fit an entry, in parts.
    fn put_parts(&mut self, value: &impl Encode) {
        let mut bytes = Vec::new();
        put(&mut bytes, value);
        for part in bytes.chunks(PART) {
            self.put::<ServerEntry<&Message>>(self.now, ServerEntry::Part(part.to_vec()));
        }
    }

    /// Records an operation on a local world.
    pub fn operation(&mut self, now: Duration, operation: Operation) {
        self.put(now, LocalEntry::Did(operation));
    }

    /// Records the digests of all regions of a local world after a step.
    pub fn stepped(&mut self, now: Duration, tick: Tick, digests: &[(RegionId, u64)]) {
        let digests = self.digests(tick, digests);
        self.put(now, LocalEntry::Stepped(digests));
        self.flush_if_due();
    }

    /// Returns the entry of these digests. It names their regions if these differ from those before.
    fn digests(&mut self, tick: Tick, digests: &[(RegionId, u64)]) -> Digests {
        let same = digests.iter().map(|(region, _)| region).eq(&self.regions);
        if !same {
            self.regions = digests.iter().map(|(region, _)| *region).collect();
        }
        let regions = (!same).then(|| self.regions.clone());
        Digests { tick, regions, digests: digests.iter().map(|(_, digest)| digest.to_le_bytes()).collect() }
    }

    /// Begins a segment, which can be replayed without what was before. The next digests name their regions.
    pub fn begin_segment(&mut self) {
        self.flush();
        self.regions.clear();
        if let Some(Out::Ring(ring)) = &mut self.out {
            ring.begin_segment(self.now);
        }
    }

    /// Returns whether the recording wants to begin a segment.
    pub fn wants_segment(&self) -> bool {
        matches!(&self.out, Some(Out::Ring(ring)) if ring.wants_segment(self.now))
    }

    /// Writes what is kept in memory of the last seconds. Fails if the recording goes to a file.
    pub fn keep(&mut self, to: &mut impl Write) -> Result<(), RecordingError> {
        self.flush();
        match &self.out {
            Some(Out::Ring(ring)) => Ok(ring.write(to)?),
            _ => Err(RecordingError::Unsuitable(
                "it is recorded to a file already, and not in memory: that is begun by World::record_last"
                    .into(),
            )),
        }
    }

    /// Writes what is not written yet, if the last write is [`FLUSH`] ago.
    fn flush_if_due(&mut self) {
        if self.now.saturating_sub(self.flushed) >= FLUSH {
            self.flush();
        }
    }

    /// Writes what is not written yet.
    fn flush(&mut self) {
        self.flushed = self.now;
        let chunk = std::mem::take(&mut self.chunk);
        if chunk.is_empty() {
            return;
        }
        let written = match &mut self.out {
            Some(Out::File { to, before }) => {
                file::write_chunk(to, *before, &chunk).map(|hash| *before = hash)
            }
            Some(Out::Ring(ring)) => {
                ring.put(chunk);
                return;
            }
            None => return,
        };
        self.chunk = chunk;
        self.chunk.clear();
        if let Err(error) = written {
            self.fail(error);
        }
    }

    /// Ends the recording for this reason, which [`Recorder::finish`] returns.
    pub fn fail(&mut self, error: io::Error) {
        warn!(%error, "the recording ends here");
        (self.out, self.failure) = (None, Some(error));
    }

    /// Returns whether nothing is recorded any more because something could not be written.
    pub fn has_failed(&self) -> bool {
        self.failure.is_some()
    }

    /// Writes what is not written yet and the end, and waits for the disk. Returns what went wrong at any
    /// time.
    pub fn finish(mut self) -> io::Result<()> {
        self.end()
    }

    fn end(&mut self) -> io::Result<()> {
        self.flush();
        if let Some(Out::File { mut to, before }) = self.out.take() {
            file::write_chunk(&mut to, before, &[])?;
            to.flush()?;
        }
        self.failure.take().map_or(Ok(()), Err)
    }

    fn put<W: Encode>(&mut self, now: Duration, what: W) {
        if self.out.is_none() {
            return;
        }
        let after_ns = now.saturating_sub(self.now).as_nanos() as u64;
        self.now = now.max(self.now);
        put(&mut self.chunk, &Entry { after_ns, what });
        if self.chunk.len() >= CHUNK {
            self.flush();
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Err(error) = self.end() {
            warn!(%error, "a recording is not whole");
        }
    }
}

/// Returns the entry of an answer: what cannot be computed again, which is how long it took.
fn answered<M, C>(event: &PhysicsEvent) -> NodeEntry<M, C> {
    let (mut compute_us, mut step_us, mut region_ms) = (0, Vec::new(), Vec::new());
    match event {
        // Another thread computes it, so that its answers come between the others.
        PhysicsEvent::Verified { run, .. } => return NodeEntry::Verified(*run),
        PhysicsEvent::Settled { stats, load, regions, .. } => {
            compute_us = stats.compute_us;
            step_us = load.iter().flat_map(|load| &load.regions).map(|region| region.step_us).collect();
            region_ms = regions.iter().map(RegionState::times_ms).collect();
        }
        _ => {}
    }
    NodeEntry::Answered { compute_us, step_us, region_ms }
}
