//! Carries one proven connection: greets, sends and reads its lanes and datagrams, and closes it.

use std::future::poll_fn;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use quinn::{Connection, ConnectionError, RecvStream, SendStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::JoinSet;

use super::events::{EventSender, HeldEvent};
use super::lanes::{FrameStart, LANES, LaneError, LaneSender, SendFailure, read_body, read_length};
use super::pace::Pace;
use super::stats::{Counters, count};
use super::{
    CloseCause, CloseCode, Lane, Limits, MAX_DATAGRAM_BYTES, NetEvent, PROTOCOL_VERSION, PeerKey, PeerName,
    PeerStats, SendError,
};
use crate::protocol::link;

/// The state of a connection that callers and tasks share.
pub(super) struct Peer {
    pub(super) key: PeerKey,
    pub(super) who: PeerName,
    connection: Connection,
    lanes: [Mutex<LaneSender>; LANES],
    /// The bytes that wait on the world's lanes together.
    queue: Queue,
    /// The bytes that wait on the program lane.
    program_queue: Queue,
    inbox_bytes: usize,
    /// The longest frame accepted from the peer.
    frame_limit: usize,
    pace: Pace,
    /// The pace of datagrams. Those beyond it are dropped, and so hold no frame back.
    datagram_pace: Pace,
    counters: Counters,
    /// The rule that the peer broke, if it did.
    violation: Mutex<Option<String>>,
}

/// The number of bytes that wait, and the most that may.
struct Queue {
    bytes: AtomicUsize,
    limit: usize,
}

impl Queue {
    fn new(limit: usize) -> Self {
        Self { bytes: AtomicUsize::new(0), limit }
    }
}

/// Both ends of all lanes, in the order of [`Lane::ALL`].
pub(super) struct Lanes {
    senders: [SendStream; LANES],
    receivers: [RecvStream; LANES],
}

/// The reason for which a greeting fails.
pub(super) enum GreetError {
    Lost(ConnectionError),
    Refused(String),
}

impl From<ConnectionError> for GreetError {
    fn from(error: ConnectionError) -> Self {
        Self::Lost(error)
    }
}

/// Opens our lanes, accepts the peer's, and compares versions. The caller bounds the time that this takes.
pub(super) async fn greet(connection: &Connection) -> Result<Lanes, GreetError> {
    let mut senders = Vec::new();
    for lane in Lane::ALL {
        let mut stream = connection.open_uni().await?;
        let mut greeting = vec![lane.index() as u8];
        greeting.extend(PROTOCOL_VERSION.to_le_bytes());
        // Errors here mean that the connection is gone, which accepting reports better.
        let _ = stream.set_priority(-(lane.index() as i32));
        let _ = stream.write_all(&greeting).await;
        senders.push(stream);
    }
    let mut receivers = [const { None }; LANES];
    for _ in Lane::ALL {
        let mut stream = connection.accept_uni().await?;
        let mut greeting = [0; 5];
        let read = stream.read_exact(&mut greeting).await;
        if let Some(closed) = connection.close_reason() {
            return Err(closed.into());
        }
        let [lane, version @ ..] = greeting;
        let version = u32::from_le_bytes(version);
        let slot = Lane::from_code(lane).map(|lane| &mut receivers[lane.index()]);
        match slot {
            Some(slot @ None) if read.is_ok() && version == PROTOCOL_VERSION => *slot = Some(stream),
            Some(None) if read.is_ok() => {
                let reason = format!(
                    "this side speaks protocol version {PROTOCOL_VERSION}, the other {version}; run the same dcd version on both"
                );
                connection.close(CloseCode::REFUSED.into(), reason.as_bytes());
                return Err(GreetError::Refused(reason));
            }
            _ => {
                let reason = "a lane does not begin with a greeting; run the same dcd version on both";
                connection.close(CloseCode::VIOLATION.into(), reason.as_bytes());
                return Err(GreetError::Refused(reason.to_owned()));
            }
        }
    }
    let senders = senders.try_into().unwrap_or_else(|_| unreachable!("one stream was opened per lane"));
    let receivers = receivers.map(|stream| stream.expect("as many streams of unlike lanes fill all slots"));
    Ok(Lanes { senders, receivers })
}

impl Peer {
    pub(super) fn new(
        key: PeerKey,
        who: PeerName,
        connection: Connection,
        lanes: Lanes,
        limits: &Limits,
    ) -> (Arc<Self>, [RecvStream; LANES]) {
        connection.set_send_window(limits.send_window_of(who));
        connection.set_receive_window(limits.receive_window_of(who));
        let peer = Arc::new(Self {
            key,
            who,
            connection,
            lanes: lanes.senders.map(|stream| Mutex::new(LaneSender::new(stream))),
            queue: Queue::new(limits.queue_bytes_of(who)),
            program_queue: Queue::new(link::PROGRAM_WINDOW_BYTES),
            inbox_bytes: limits.inbox_bytes_of(who),
            frame_limit: limits.frame_bytes_of(who),
            pace: Pace::new(limits.frames_per_s_of(who)),
            datagram_pace: Pace::new(limits.frames_per_s_of(who)),
            counters: Counters::default(),
            violation: Mutex::new(None),
        });
        (peer, lanes.receivers)
    }

    pub(super) fn send(&self, lane: Lane, frame: &[u8]) -> Result<(), SendError> {
        let Queue { bytes, limit } = self.queue(lane);
        match self.lane(lane).send(frame, bytes, *limit) {
            Ok(()) => {
                count(&self.counters.frames_out, &self.counters.bytes_out, frame.len());
                Ok(())
            }
            Err(SendFailure::Full) => {
                Err(SendError::Full { waiting_bytes: bytes.load(Ordering::Relaxed), limit_bytes: *limit })
            }
            Err(SendFailure::Broken) => Err(SendError::NotConnected),
        }
    }

    pub(super) fn send_datagram(&self, bytes: Vec<u8>) -> Result<(), SendError> {
        let length = bytes.len();
        if length > MAX_DATAGRAM_BYTES {
            return Err(SendError::DatagramTooLong { bytes: length });
        }
        // QUIC makes room by dropping the oldest datagrams: the newest state is the one worth sending.
        if self.connection.datagram_send_buffer_space() < length {
            self.counters.datagrams_dropped.fetch_add(1, Ordering::Relaxed);
        }
        match self.connection.send_datagram(bytes.into()) {
            Ok(()) => {
                count(&self.counters.datagrams_out, &self.counters.bytes_out, length);
                Ok(())
            }
            Err(quinn::SendDatagramError::ConnectionLost(_)) => Err(SendError::NotConnected),
            // The path is narrower than QUIC's minimum, or the peer takes no datagrams, which dcd's processes
            // always do.
            Err(_) => {
                self.counters.datagrams_dropped.fetch_add(1, Ordering::Relaxed);
                Ok(())
            }
        }
    }

    /// Returns the bytes of datagrams that wait to be sent.
    pub(super) fn datagrams_waiting(&self) -> usize {
        link::DATAGRAM_QUEUE_BYTES.saturating_sub(self.connection.datagram_send_buffer_space())
    }

    /// Returns the bytes of frames that wait on the world's lanes.
    #[cfg(feature = "physics")]
    pub(super) fn bytes_waiting(&self) -> usize {
        self.queue.bytes.load(Ordering::Relaxed)
    }

    pub(super) fn stats(&self) -> PeerStats {
        let waiting = [&self.queue, &self.program_queue].map(|queue| queue.bytes.load(Ordering::Relaxed));
        self.counters.read(waiting.iter().sum(), &self.connection.stats())
    }

    /// Sends what waits, and closes once the peer has it, or after `limits.linger` otherwise.
    pub(super) async fn close(&self, code: CloseCode, reason: &str, limits: &Limits) {
        let all_sent = async {
            for lane in Lane::ALL {
                let arrived =
                    poll_fn(|context| self.lane(lane).poll_finish(context, &self.queue(lane).bytes)).await;
                if let Some(arrived) = arrived {
                    arrived.await;
                }
            }
        };
        if tokio::time::timeout(limits.linger, all_sent).await.is_err() {
            tracing::debug!(peer = self.key.0, "closed before the peer had read everything");
        }
        self.connection.close(code.into(), reason.as_bytes());
    }

    /// Carries the connection until it has ended and all that arrived has been delivered. Returns how it
    /// ended.
    pub(super) async fn run(
        self: &Arc<Self>,
        receivers: [RecvStream; LANES],
        events: &EventSender,
    ) -> (CloseCause, String) {
        let mut senders = JoinSet::new();
        let mut readers = JoinSet::new();
        let inbox = Arc::new(Semaphore::new(self.inbox_bytes));
        for (lane, stream) in Lane::ALL.into_iter().zip(receivers) {
            let peer = self.clone();
            senders.spawn(async move {
                poll_fn(|context| peer.lane(lane).poll_run(context, &peer.queue(lane).bytes)).await;
            });
            readers.spawn(self.clone().read_lane(lane, stream, inbox.clone(), events.clone()));
        }
        readers.spawn(self.clone().read_datagrams(events.clone()));
        let error = self.connection.closed().await;
        // What arrived before the end is still to be read.
        while readers.join_next().await.is_some() {}
        self.describe(error)
    }

    async fn read_lane(
        self: Arc<Self>,
        lane: Lane,
        mut stream: RecvStream,
        inbox: Arc<Semaphore>,
        events: EventSender,
    ) {
        loop {
            match self.read_frame(lane, &mut stream, &inbox).await {
                Ok(Some((bytes, share))) => {
                    count(&self.counters.frames_in, &self.counters.bytes_in, bytes.len());
                    let event = NetEvent::Frame { peer: self.key, lane, bytes };
                    if events.send(HeldEvent { event, share: Some(share) }).is_err() {
                        return;
                    }
                }
                Ok(None) | Err(LaneError::Gone) => return,
                Err(error) => return self.violated(error.to_string()),
            }
        }
    }

    async fn read_frame(
        &self,
        lane: Lane,
        stream: &mut RecvStream,
        inbox: &Arc<Semaphore>,
    ) -> Result<Option<(Vec<u8>, OwnedSemaphorePermit)>, LaneError> {
        let FrameStart::Length(length) = read_length(stream, lane, self.frame_limit).await? else {
            return Ok(None);
        };
        if let Some(at) = self.pace.count(Instant::now(), length) {
            self.counters.frames_held_back.fetch_add(1, Ordering::Relaxed);
            tokio::select! {
                () = tokio::time::sleep_until(at.into()) => {}
                _ = self.connection.closed() => {}
            }
        }
        let share = share_of(length, self.inbox_bytes);
        let share = inbox.clone().acquire_many_owned(share).await.map_err(|_| LaneError::Gone)?;
        Ok(Some((read_body(stream, lane, length).await?, share)))
    }

    async fn read_datagrams(self: Arc<Self>, events: EventSender) {
        let inbox = Arc::new(Semaphore::new(DATAGRAM_INBOX_BYTES));
        while let Ok(bytes) = self.connection.read_datagram().await {
            count(&self.counters.datagrams_in, &self.counters.bytes_in, bytes.len());
            let share = share_of(bytes.len(), DATAGRAM_INBOX_BYTES);
            let share = inbox.clone().try_acquire_many_owned(share);
            let Some(share) = share.ok().filter(|_| self.datagram_pace.admits(Instant::now(), bytes.len()))
            else {
                self.counters.datagrams_dropped.fetch_add(1, Ordering::Relaxed);
                continue;
            };
            let event = NetEvent::Datagram { peer: self.key, bytes: bytes.to_vec() };
            if events.send(HeldEvent { event, share: Some(share) }).is_err() {
                return;
            }
        }
    }

    fn violated(&self, rule: String) {
        tracing::warn!(peer = self.key.0, who = %self.who, "closed: {rule}");
        self.connection.close(CloseCode::VIOLATION.into(), rule.as_bytes());
        self.violation.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(rule);
    }

    fn describe(&self, error: ConnectionError) -> (CloseCause, String) {
        let violation = self.violation.lock().unwrap_or_else(PoisonError::into_inner).take();
        match (violation, error) {
            (Some(rule), _) => (CloseCause::Violation, rule),
            (None, ConnectionError::LocallyClosed) => (CloseCause::ByUs, "closed by this side".to_owned()),
            (None, ConnectionError::ApplicationClosed(close)) => {
                let code = CloseCode::of(&close);
                (CloseCause::ByPeer(code), String::from_utf8_lossy(&close.reason).into_owned())
            }
            (None, ConnectionError::TimedOut) => (CloseCause::TimedOut, "nothing was heard of it".to_owned()),
            (None, error @ ConnectionError::TransportError(_)) => (CloseCause::Violation, error.to_string()),
            (None, error) => (CloseCause::Forgotten, error.to_string()),
        }
    }

    fn queue(&self, lane: Lane) -> &Queue {
        if lane == Lane::Program { &self.program_queue } else { &self.queue }
    }

    fn lane(&self, lane: Lane) -> MutexGuard<'_, LaneSender> {
        self.lanes[lane.index()].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

const DATAGRAM_INBOX_BYTES: usize = 64 << 10;

/// Returns what a message takes of its inbox: its bytes and the overhead of carrying it, but at most the
/// whole inbox.
fn share_of(length: usize, inbox_bytes: usize) -> u32 {
    const OVERHEAD_BYTES: usize = 64;
    u32::try_from((length + OVERHEAD_BYTES).min(inbox_bytes)).unwrap_or(u32::MAX)
}
