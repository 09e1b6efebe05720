//! Sends and reads ordered frames on lanes, one QUIC stream each, and queues what a blocked stream does not
//! take.

use std::collections::VecDeque;
use std::fmt;
use std::pin::Pin;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll, Waker};

use quinn::{ReadError, ReadExactError, RecvStream, SendStream, WriteError};

/// A channel of ordered frames. Frames of one lane arrive in order; a lane that stalls does not hold up the
/// others (thesis: separate channels).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Lane {
    /// Membership, leadership, pings and distribution. Goes first on a narrow link.
    Admin,
    /// Exchanges, transfers and shapes.
    Object,
    /// Client inputs, queries and state replication.
    Client,
    /// Messages between programs. Goes last, and takes no room from the others.
    Program,
}

/// Number of lanes.
pub(super) const LANES: usize = Lane::ALL.len();

impl Lane {
    pub(super) const ALL: [Self; 4] = [Self::Admin, Self::Object, Self::Client, Self::Program];

    pub(super) fn index(self) -> usize {
        self as usize
    }

    pub(super) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }
}

impl fmt::Display for Lane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Admin => "admin lane",
            Self::Object => "object lane",
            Self::Client => "client lane",
            Self::Program => "program lane",
        })
    }
}

/// The sending end of a lane. Frames go to the stream on the caller's own thread, which saves a change of
/// threads per frame. Only what the stream does not take waits here for the lane's task.
pub(super) struct LaneSender {
    stream: SendStream,
    /// Frames with their prefix. The first `sent` bytes of the first frame are already written.
    waiting: VecDeque<Vec<u8>>,
    sent: usize,
    task: Option<Waker>,
}

impl LaneSender {
    pub(super) fn new(stream: SendStream) -> Self {
        Self { stream, waiting: VecDeque::new(), sent: 0, task: None }
    }

    /// Sends a frame, or queues it. `queued` counts the bytes that wait on all lanes of the peer; the frame
    /// is refused if they would be more than `limit`. A frame is never refused when nothing waits.
    pub(super) fn send(
        &mut self,
        frame: &[u8],
        queued: &AtomicUsize,
        limit: usize,
    ) -> Result<(), SendFailure> {
        let total = frame.len() + PREFIX_BYTES;
        let waits = queued.load(Ordering::Relaxed);
        if waits > 0 && waits + total > limit {
            return Err(SendFailure::Full);
        }
        let length = u32::try_from(frame.len()).expect("the frame limit was checked before");
        let mut bytes = Vec::with_capacity(total);
        bytes.extend(length.to_le_bytes());
        bytes.extend(frame);
        queued.fetch_add(total, Ordering::Relaxed);
        self.waiting.push_back(bytes);
        if self.waiting.len() == 1 {
            // The stream may keep this waker; the lane's task then polls again with its own.
            let context = &mut Context::from_waker(Waker::noop());
            let flushed = self.flush(context, queued).map_err(|_| SendFailure::Broken)?;
            if let (Poll::Pending, Some(task)) = (flushed, &self.task) {
                task.wake_by_ref();
            }
        }
        Ok(())
    }

    /// Polls the lane's task, which writes what waits for as long as the connection lives.
    pub(super) fn poll_run(&mut self, context: &mut Context<'_>, queued: &AtomicUsize) -> Poll<WriteError> {
        self.task = Some(context.waker().clone());
        match self.flush(context, queued) {
            Err(error) => Poll::Ready(error),
            Ok(_) => Poll::Pending,
        }
    }

    /// Polls until nothing waits, and then finishes the stream.
    pub(super) fn poll_finish(
        &mut self,
        context: &mut Context<'_>,
        queued: &AtomicUsize,
    ) -> Poll<Option<impl Future<Output = ()> + use<>>> {
        match self.flush(context, queued) {
            Err(_) => Poll::Ready(None),
            Ok(Poll::Pending) => Poll::Pending,
            Ok(Poll::Ready(())) => {
                // An error means that the stream is finished already.
                let _ = self.stream.finish();
                let stopped = self.stream.stopped();
                Poll::Ready(Some(async {
                    let _ = stopped.await;
                }))
            }
        }
    }

    fn flush(&mut self, context: &mut Context<'_>, queued: &AtomicUsize) -> Result<Poll<()>, WriteError> {
        while let Some(frame) = self.waiting.front() {
            match Pin::new(&mut self.stream).poll_write(context, &frame[self.sent..]) {
                Poll::Pending => return Ok(Poll::Pending),
                Poll::Ready(Err(error)) => {
                    let lost: usize = self.waiting.drain(..).map(|frame| frame.len()).sum();
                    queued.fetch_sub(lost - std::mem::take(&mut self.sent), Ordering::Relaxed);
                    return Err(error);
                }
                Poll::Ready(Ok(bytes)) => {
                    self.sent += bytes;
                    queued.fetch_sub(bytes, Ordering::Relaxed);
                    if self.sent == frame.len() {
                        self.sent = 0;
                        self.waiting.pop_front();
                    }
                }
            }
        }
        Ok(Poll::Ready(()))
    }
}

/// The reason for which a lane refuses a frame.
pub(super) enum SendFailure {
    /// Too much waits already.
    Full,
    /// The connection is gone.
    Broken,
}

/// The length of the prefix of a frame: the frame's length as a little-endian u32.
const PREFIX_BYTES: usize = 4;

/// The next item on a lane's stream.
pub(super) enum FrameStart {
    /// A frame of this many bytes follows.
    Length(usize),
    /// The peer has finished the lane in good order.
    Finished,
}

/// The error with which reading a lane ends.
#[derive(Debug, thiserror::Error)]
pub(super) enum LaneError {
    #[error("a frame of {bytes} bytes on the {lane}, its limit is {limit}")]
    TooLong { lane: Lane, bytes: usize, limit: usize },
    #[error("the {0} ends in mid-frame")]
    Cut(Lane),
    #[error("the connection is gone")]
    Gone,
}

/// Reads the length of a frame, and checks it before anything is allocated for the frame.
pub(super) async fn read_length(
    stream: &mut RecvStream,
    lane: Lane,
    limit: usize,
) -> Result<FrameStart, LaneError> {
    let mut prefix = [0; PREFIX_BYTES];
    match stream.read_exact(&mut prefix).await {
        Ok(()) => {}
        Err(ReadExactError::FinishedEarly(0)) => return Ok(FrameStart::Finished),
        Err(error) => return Err(lane_error(lane, &error)),
    }
    let bytes = u32::from_le_bytes(prefix) as usize;
    if bytes > limit { Err(LaneError::TooLong { lane, bytes, limit }) } else { Ok(FrameStart::Length(bytes)) }
}

/// Reads a frame of `length` bytes. Memory grows with what has arrived, not with what the length claims.
pub(super) async fn read_body(
    stream: &mut RecvStream,
    lane: Lane,
    length: usize,
) -> Result<Vec<u8>, LaneError> {
    const FIRST_STEP_BYTES: usize = 64 * 1024;
    let mut body = Vec::new();
    while body.len() < length {
        let start = body.len();
        let step = (length - start).min(start.max(FIRST_STEP_BYTES));
        body.resize(start + step, 0);
        stream.read_exact(&mut body[start..]).await.map_err(|error| lane_error(lane, &error))?;
    }
    Ok(body)
}

fn lane_error(lane: Lane, error: &ReadExactError) -> LaneError {
    match error {
        ReadExactError::FinishedEarly(_) | ReadExactError::ReadError(ReadError::Reset(_)) => {
            LaneError::Cut(lane)
        }
        ReadExactError::ReadError(_) => LaneError::Gone,
    }
}
