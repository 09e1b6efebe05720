//! What the network tells a role's loop.

use std::net::SocketAddr;
use std::sync::mpsc;
use std::time::Duration;

use quinn::{ApplicationClose, VarInt};
use tokio::sync::OwnedSemaphorePermit;

use super::{Lane, NetError, PeerName};

/// One connection, for as long as the process lives: never given a second time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PeerKey(pub(super) u64);

/// Something happened on a connection. Per connection the order is `Connected`, then frames and datagrams, then `Closed`,
/// or `ConnectFailed` alone.
#[derive(Debug)]
pub enum NetEvent {
    /// Both sides have proved their names; frames can be sent.
    Connected {
        /// The connection.
        peer: PeerKey,
        /// Whom the peer proved to be.
        who: PeerName,
        /// Where it is.
        addr: SocketAddr,
    },
    /// [`Net::connect`](super::Net::connect) came to nothing.
    ConnectFailed {
        /// The connection that is none.
        peer: PeerKey,
        /// Why.
        error: NetError,
    },
    /// A frame, whole and in order on its lane.
    Frame {
        /// Who sent it.
        peer: PeerKey,
        /// Where.
        lane: Lane,
        /// What.
        bytes: Vec<u8>,
    },
    /// A datagram; others may have been lost or overtaken.
    Datagram {
        /// Who sent it.
        peer: PeerKey,
        /// What.
        bytes: Vec<u8>,
    },
    /// The connection is over; nothing of it follows.
    Closed {
        /// The connection.
        peer: PeerKey,
        /// Who was there.
        who: PeerName,
        /// In what way it ended.
        cause: CloseCause,
        /// In words.
        reason: String,
    },
}

/// In what way a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloseCause {
    /// We closed it.
    ByUs,
    /// The peer closed it, and why.
    ByPeer(CloseCode),
    /// The peer does not know the connection any more: it was killed, and something new is in its place.
    Forgotten,
    /// Nothing was heard of the peer for the idle time-out: killed, stopped, or cut off.
    TimedOut,
    /// The peer broke a rule, and we closed.
    Violation,
}

/// Why a connection is closed, for programs; words for people go beside it. Who closes connections by
/// [`Net::close`](super::Net::close) gives codes of its own, from [`CloseCode::FIRST_FREE`] on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CloseCode(pub u32);

impl CloseCode {
    /// In good order: what was to be done is done, or the process ends.
    pub const DONE: Self = Self(0);
    /// The peer broke a rule.
    pub const VIOLATION: Self = Self(1);
    /// The peers do not fit together, or there is no room; the reason says which.
    pub const REFUSED: Self = Self(2);
    /// The first that this module gives no meaning to.
    pub const FIRST_FREE: u32 = 16;

    pub(super) fn of(close: &ApplicationClose) -> Self {
        Self(u32::try_from(close.error_code.into_inner()).unwrap_or(u32::MAX))
    }
}

impl From<CloseCode> for VarInt {
    fn from(code: CloseCode) -> Self {
        Self::from_u32(code.0)
    }
}

/// The receiving end of a [`Net`](super::Net)'s events. What one peer has in it is bounded: beyond that its connection is
/// held back (frames) or newer datagrams are dropped, while others go on.
pub struct NetEvents {
    deliveries: mpsc::Receiver<Delivery>,
}

impl NetEvents {
    pub(super) fn channel() -> (mpsc::Sender<Delivery>, Self) {
        let (sender, deliveries) = mpsc::channel();
        (sender, Self { deliveries })
    }

    /// The next event, waiting for it. An error says that the network is shut down and all is read.
    pub fn recv(&self) -> Result<NetEvent, mpsc::RecvError> {
        self.deliveries.recv().map(Delivery::into_event)
    }

    /// The next event, waiting no longer than `timeout`.
    pub fn recv_timeout(&self, timeout: Duration) -> Result<NetEvent, mpsc::RecvTimeoutError> {
        self.deliveries.recv_timeout(timeout).map(Delivery::into_event)
    }

    /// The next event if it is there.
    pub fn try_recv(&self) -> Result<NetEvent, mpsc::TryRecvError> {
        self.deliveries.try_recv().map(Delivery::into_event)
    }

    /// All events that are there.
    pub fn try_iter(&self) -> impl Iterator<Item = NetEvent> + '_ {
        std::iter::from_fn(|| self.try_recv().ok())
    }
}

/// An event on its way, with the peer's share of the channel that it takes up until it is read.
pub(super) struct Delivery {
    pub(super) event: NetEvent,
    pub(super) share: Option<OwnedSemaphorePermit>,
}

impl Delivery {
    fn into_event(self) -> NetEvent {
        drop(self.share);
        self.event
    }
}
