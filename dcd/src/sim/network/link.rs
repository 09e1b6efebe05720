//! Defines one simulated connection: the state of each of its ends (opening, open, closed), and the frames
//! not yet given to their reader.

use std::collections::VecDeque;
use std::time::Duration;

use crate::cluster::Peer;
use crate::protocol::Lane;
use crate::protocol::link::{CLIENT_IDLE_TIMEOUT, CLIENT_KEEP_ALIVE, IDLE_TIMEOUT, KEEP_ALIVE};

/// The number of a connection. Later connections between the same two processes have higher numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::sim) struct LinkId(pub(super) u64);

/// An end of a link: that of the process that dialled, or that of the other process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Dialler,
    Listener,
}

impl Side {
    pub(super) const BOTH: [Self; 2] = [Self::Dialler, Self::Listener];

    pub(super) const fn other(self) -> Self {
        match self {
            Self::Dialler => Self::Listener,
            Self::Listener => Self::Dialler,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The handshake is not complete at this end.
    Opening,
    Open,
    Closed,
}

#[derive(Clone, Debug)]
pub(super) struct End {
    pub(super) who: Peer,
    pub(super) state: State,
    /// The time since when the end has not heard the other end; `None` if it hears it.
    pub(super) deaf: Option<Duration>,
    /// The frames of both reliable lanes towards the other end.
    pub(super) lanes: [Frames; 2],
    /// The bytes from this end that the other end has not read.
    pub(super) unread: usize,
    /// Says whether its process has closed it while what it sent before is still to arrive.
    pub(super) lingers: bool,
}

/// The frames of one reliable lane that have not been given to the reader yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Frames {
    /// The number of the first of these frames.
    pub(super) first: u64,
    pub(super) waiting: VecDeque<Frame>,
}

#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) bytes: Vec<u8>,
    /// The number of packets that the other end still lacks.
    pub(super) missing: u64,
    /// The number of times that packets have been sent again.
    pub(super) retries: u32,
}

#[derive(Clone, Debug)]
pub(super) struct Link {
    ends: [End; 2],
}

impl Link {
    pub(super) fn new(dialler: Peer, listener: Peer) -> Self {
        let end = |who| End {
            who,
            state: State::Opening,
            deaf: None,
            lanes: Default::default(),
            unread: 0,
            lingers: false,
        };
        Self { ends: [end(dialler), end(listener)] }
    }

    /// Returns whether the link is calm: a client that is no participant has dialled. Then the client breaks
    /// the silence rarely, and the other end never.
    pub(super) fn is_calm(&self) -> bool {
        matches!(self.end(Side::Dialler).who, Peer::Client(_))
    }

    /// Returns the longest silence after which an end drops the link.
    pub(super) fn idle_timeout(&self) -> Duration {
        if self.is_calm() { CLIENT_IDLE_TIMEOUT } else { IDLE_TIMEOUT }
    }

    /// Returns the longest time between two packets that an end of a live link hears.
    pub(super) fn keep_alive(&self) -> Duration {
        if self.is_calm() { CLIENT_KEEP_ALIVE } else { KEEP_ALIVE }
    }

    pub(super) fn end(&self, side: Side) -> &End {
        &self.ends[side as usize]
    }

    pub(super) fn end_mut(&mut self, side: Side) -> &mut End {
        &mut self.ends[side as usize]
    }

    /// Returns which end belongs to a process.
    pub(super) fn side_of(&self, who: Peer) -> Side {
        if self.ends[0].who == who { Side::Dialler } else { Side::Listener }
    }

    pub(super) fn is_open(&self, side: Side) -> bool {
        self.end(side).state == State::Open
    }

    pub(super) fn is_over(&self) -> bool {
        self.ends.iter().all(|end| end.state == State::Closed && !end.lingers)
    }
}

impl End {
    pub(super) fn frame(&mut self, lane: usize, number: u64) -> Option<&mut Frame> {
        let lane = &mut self.lanes[lane];
        lane.waiting.get_mut(number.checked_sub(lane.first)? as usize)
    }

    pub(super) fn push(&mut self, lane: usize, frame: Frame) -> u64 {
        let lane = &mut self.lanes[lane];
        lane.waiting.push_back(frame);
        lane.first + lane.waiting.len() as u64 - 1
    }

    /// Returns the next frame in order, if it has arrived.
    pub(super) fn next(&mut self, lane: usize) -> Option<Vec<u8>> {
        let lane = &mut self.lanes[lane];
        if lane.waiting.front()?.missing > 0 {
            return None;
        }
        lane.first += 1;
        lane.waiting.pop_front().map(|frame| frame.bytes)
    }

    /// Drops the frames that this end sent and the other end has not got.
    pub(super) fn drop_frames(&mut self, lane: usize) {
        let lane = &mut self.lanes[lane];
        lane.first += lane.waiting.len() as u64;
        lane.waiting.clear();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.lanes.iter().all(|lane| lane.waiting.is_empty())
    }
}

/// The number of reliable lanes.
pub(super) const LANES: usize = 2;

/// Returns the index of a reliable lane; `None` for datagrams.
pub(super) const fn index(lane: Lane) -> Option<usize> {
    match lane {
        Lane::Control => Some(0),
        Lane::Border => Some(1),
        Lane::State => None,
    }
}
