//! Defines the events of the network that a role's loop reads.

use std::net::SocketAddr;
#[cfg(feature = "physics")]
use std::sync::Weak;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

use quinn::{ApplicationClose, VarInt};
use tokio::sync::OwnedSemaphorePermit;

use super::{Lane, NetError, PeerName};

/// The key of a connection. No other connection gets the same key while the process lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PeerKey(pub(super) u64);

impl PeerKey {
    /// Returns a key that need not belong to any connection.
    #[cfg(all(test, feature = "physics"))]
    pub(crate) fn numbered(number: u64) -> Self {
        Self(number)
    }
}

/// An event of a connection. Per connection the order is `Connected`, then frames and datagrams, then
/// `Closed`; or `ConnectFailed` alone.
#[derive(Debug)]
pub enum NetEvent {
    /// Both sides have proved their names. Frames can be sent.
    Connected {
        /// The connection.
        peer: PeerKey,
        /// The name that the peer proved.
        who: PeerName,
        /// The peer's address.
        addr: SocketAddr,
    },
    /// [`Net::connect`](super::Net::connect) failed.
    ConnectFailed {
        /// The key of the connection that failed.
        peer: PeerKey,
        /// The reason.
        error: NetError,
    },
    /// A frame arrived, whole and in order on its lane.
    Frame {
        /// The connection that it came over.
        peer: PeerKey,
        /// The lane that it came on.
        lane: Lane,
        /// Its bytes.
        bytes: Vec<u8>,
    },
    /// A datagram arrived. Others may have been lost or overtaken.
    Datagram {
        /// The connection that it came over.
        peer: PeerKey,
        /// Its bytes.
        bytes: Vec<u8>,
    },
    /// The connection is over. No event of it follows.
    Closed {
        /// The connection.
        peer: PeerKey,
        /// The name that the peer had proved.
        who: PeerName,
        /// The way in which it ended.
        cause: CloseCause,
        /// The reason, for people.
        reason: String,
    },
}

impl NetEvent {
    /// Returns the connection whose event this is.
    pub fn peer(&self) -> PeerKey {
        match *self {
            Self::Connected { peer, .. }
            | Self::ConnectFailed { peer, .. }
            | Self::Frame { peer, .. }
            | Self::Datagram { peer, .. }
            | Self::Closed { peer, .. } => peer,
        }
    }
}

/// The way in which a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloseCause {
    /// We closed it.
    ByUs,
    /// The peer closed it, with this code.
    ByPeer(CloseCode),
    /// The peer does not know the connection any more: it was killed, and a new process is in its place.
    Forgotten,
    /// Nothing was received from the peer during the idle time-out: it was killed, stopped, or cut off.
    TimedOut,
    /// The peer broke a rule, and we closed the connection.
    Violation,
}

/// The code with which a connection is closed, for programs; a text for people goes with it. Callers of
/// [`Net::close`](super::Net::close) define codes of their own, from [`CloseCode::FIRST_FREE`] on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CloseCode(pub u32);

impl CloseCode {
    /// The close is in good order: the work is done, or the process ends.
    pub const DONE: Self = Self(0);
    /// The peer broke a rule.
    pub const VIOLATION: Self = Self(1);
    /// The peers do not fit together, or there is no room; the reason says which.
    pub const REFUSED: Self = Self(2);
    /// The server's user sent the peer away: it is let in with a new token only.
    pub const SENT_AWAY: Self = Self(17);
    /// The first of the codes that callers define. Of these, this module uses [`CloseCode::SENT_AWAY`] only.
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

/// The receiving end of a [`Net`](super::Net)'s events. What one peer has in it is bounded: beyond that, its
/// frames are held back and its newer datagrams dropped, while other peers go on.
pub struct NetEvents {
    held: mpsc::Receiver<HeldEvent>,
    /// A weak reference: the senders end with the network, so that readers see the end.
    #[cfg(feature = "physics")]
    way: Weak<Mutex<Way>>,
}

/// The destination of events.
enum Way {
    /// The channel to [`NetEvents`].
    Channel(mpsc::Sender<HeldEvent>),
    /// A function that takes each event as it comes, on the network's thread. It returns whether it takes any
    /// more.
    #[cfg(feature = "physics")]
    Sink(Box<dyn FnMut(HeldEvent) -> bool + Send>),
}

/// The sending end of the events.
#[derive(Clone)]
pub(super) struct EventSender {
    way: Arc<Mutex<Way>>,
}

/// The error of an event that nobody will read.
pub(super) struct Unread;

impl EventSender {
    /// Passes an event on.
    pub(super) fn send(&self, event: HeldEvent) -> Result<(), Unread> {
        match &mut *self.way.lock().unwrap_or_else(PoisonError::into_inner) {
            Way::Channel(held) => held.send(event).map_err(|_| Unread),
            #[cfg(feature = "physics")]
            Way::Sink(take) => take(event).then_some(()).ok_or(Unread),
        }
    }
}

impl NetEvents {
    pub(super) fn channel() -> (EventSender, Self) {
        let (sender, held) = mpsc::channel();
        let way = Arc::new(Mutex::new(Way::Channel(sender)));
        let receiver = Self {
            held,
            #[cfg(feature = "physics")]
            way: Arc::downgrade(&way),
        };
        (EventSender { way }, receiver)
    }

    /// Has the network's thread pass each event from now on to `take`, after those that came before. An event
    /// takes up its peer's share until it is taken out of its [`HeldEvent`]. `take` returns whether it takes
    /// any more.
    #[cfg(feature = "physics")]
    pub(crate) fn pass_to(self, mut take: impl FnMut(HeldEvent) -> bool + Send + 'static) {
        let way = self.way.upgrade();
        let mut way = way.as_ref().map(|way| way.lock().unwrap_or_else(PoisonError::into_inner));
        if self.held.try_iter().all(&mut take)
            && let Some(way) = &mut way
        {
            **way = Way::Sink(Box::new(take));
        }
    }

    /// Waits for the next event. An error means that the network is shut down and everything is read.
    pub fn recv(&self) -> Result<NetEvent, mpsc::RecvError> {
        self.held.recv().map(HeldEvent::into_event)
    }

    /// Waits for the next event, at most for `timeout`.
    pub fn recv_timeout(&self, timeout: Duration) -> Result<NetEvent, mpsc::RecvTimeoutError> {
        self.held.recv_timeout(timeout).map(HeldEvent::into_event)
    }

    /// Returns the next event, if one is there.
    pub fn try_recv(&self) -> Result<NetEvent, mpsc::TryRecvError> {
        self.held.try_recv().map(HeldEvent::into_event)
    }

    /// Returns all events that are there.
    pub fn try_iter(&self) -> impl Iterator<Item = NetEvent> + '_ {
        std::iter::from_fn(|| self.try_recv().ok())
    }
}

/// An event that is not read yet, with its peer's share of the channel, which it takes up until it is read.
pub(crate) struct HeldEvent {
    pub(super) event: NetEvent,
    pub(super) share: Option<OwnedSemaphorePermit>,
}

impl HeldEvent {
    /// Takes the event out and frees its peer's share.
    pub(crate) fn into_event(self) -> NetEvent {
        drop(self.share);
        self.event
    }

    /// Returns the event without taking it out.
    #[cfg(feature = "physics")]
    pub(crate) fn event(&self) -> &NetEvent {
        &self.event
    }

    /// Returns whether this is the end of a connection.
    #[cfg(feature = "physics")]
    pub(crate) fn is_end(&self) -> bool {
        matches!(self.event, NetEvent::Closed { .. })
    }
}
