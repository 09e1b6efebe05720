//! Tracks a process's connections for its user: the process at the other end, events (new, lost, back, gone),
//! and messages between programs.
//!
//! A connection is with a process, identified by its proven name. If its link breaks, the connection is lost;
//! if the link is made anew, the connection is back. A server has connections with nodes and clients. Other
//! processes have one with their server, and with those nodes of their group that they need. The programs at
//! both ends of a connection with the server may send each other any bytes.

mod mail;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use self::mail::Mail;
pub(super) use self::mail::Sent;
use super::ending::{Cause, Ending, GIVE_UP, Reason};
use crate::net::{PeerKey, PeerName, PeerStats};
use crate::protocol::Program;

/// How long a connection is kept without a link: as a rule as long as its process dials.
const KEPT: Duration = GIVE_UP;
/// The number of events kept for a user who does not take them. Beyond it the oldest are dropped.
const EVENTS: usize = 4_096;

/// The weight of untaken messages that are kept after the end of their links. Beyond it all of them are
/// dropped.
const ENDED_BYTES: u64 = 4 << 20;

/// The id of a connection of this process, never used twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ConnectionId(pub u64);

/// A connection at this moment.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Connection {
    /// The id of the connection.
    pub id: ConnectionId,
    /// The process at the other end.
    pub who: PeerName,
    /// The address of the other end when the link was made.
    pub address: SocketAddr,
    /// Says whether there is a link now; if not, the process waits for it.
    pub is_up: bool,
    /// The number of links that the connection has had.
    pub links: u32,
    /// The time since the connection came.
    pub age: Duration,
    /// The traffic over the connection, as of up to half a second ago.
    pub traffic: PeerStats,
    /// Datagrams of programs that were dropped at this end: the link was full or ended, or our program did
    /// not take them.
    pub dropped: u64,
}

/// An event of a connection: it is new, lost, back or gone.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ConnectionEvent {
    /// The id of the connection.
    pub id: ConnectionId,
    /// The process that is, or was, at the other end.
    pub who: PeerName,
    /// The change.
    pub change: ConnectionChange,
}

/// The ways in which a connection changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConnectionChange {
    /// The connection is new.
    Came,
    /// The link broke, for this reason. The process waits for it.
    Lost(Reason),
    /// The connection has a link again.
    Back,
    /// The connection is over, for this reason. Its id is not used again.
    Gone(Reason),
}

/// The ways in which programs' messages travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Delivered once and in order, as long as the link lasts.
    Message,
    /// May be lost or overtaken.
    Datagram,
}

/// A message from the program at the other end of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ProgramMessage {
    /// The connection that the message came over; it may be gone by now.
    pub from: ConnectionId,
    /// The process that sent it.
    pub who: PeerName,
    /// The way the message travelled.
    pub delivery: Delivery,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// The error of operations on a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConnectionError {
    /// The connection is over, or never existed.
    #[error("there is no such connection: it is gone; forget its id")]
    Gone,
    /// A process that is no server tried to disconnect another.
    #[error("only a server sends others away: to leave it, leave the world")]
    NotServer,
    /// The message is for a program of a process that is no server, and neither is this one.
    #[error("programs speak with the server's only: send it there, and let that pass it on")]
    NotByServer,
    /// The connection has no link now.
    #[error("the link is broken: wait until the connection is back, or gone")]
    Lost,
    /// The message is longer than the limit.
    #[error("a message of {bytes} bytes is over the limit of {limit}: send it in parts")]
    TooLong {
        /// The length of the message in bytes.
        bytes: usize,
        /// The limit in bytes.
        limit: usize,
    },
    /// The link, or the program at its other end, does not keep up.
    #[error(
        "too much waits to be sent already: the link or the program at its other end is slow; send it later"
    )]
    Full,
}

/// The connections of a running process. Clones share the same state. The methods return at once unless they
/// say otherwise.
///
/// A chat in which the server passes each message on to all:
///
/// ```no_run
/// # use dcd::runtime::{ConnectionError, Delivery, ServerProcess};
/// # fn chat(server: &ServerProcess) -> Result<(), ConnectionError> {
/// let connections = server.connections();
/// for message in connections.take_messages() {
///     for other in connections.list() {
///         connections.send(other.id, &message.bytes, Delivery::Message)?;
///     }
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone)]
pub struct Connections {
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    arrived: Condvar,
    is_server: bool,
    /// Wakes the process's loop.
    wake: Box<dyn Fn() + Send + Sync>,
}

#[derive(Default)]
struct State {
    last: u64,
    entries: BTreeMap<ConnectionId, Entry>,
    of_peer: BTreeMap<PeerName, ConnectionId>,
    of_link: BTreeMap<PeerKey, ConnectionId>,
    events: VecDeque<ConnectionEvent>,
    sent_away: BTreeMap<PeerName, String>,
    /// Connections that may have something to send.
    sending: BTreeSet<ConnectionId>,
    inbox: VecDeque<Received>,
    /// Weight of the messages in the inbox whose links have ended.
    ended: u64,
    arrivals: u64,
    over: bool,
}

struct Received {
    link: PeerKey,
    message: ProgramMessage,
}

struct Entry {
    who: PeerName,
    address: SocketAddr,
    came: Instant,
    /// The key of the link, or since when there is none.
    link: Result<PeerKey, Instant>,
    /// Traffic over former links, and over the present one.
    before: PeerStats,
    traffic: PeerStats,
    mail: Mail,
    links: u32,
}

impl Connections {
    /// Lists all connections, the oldest first.
    pub fn list(&self) -> Vec<Connection> {
        let state = self.lock();
        state.entries.iter().map(|(&id, entry)| entry.view(id)).collect()
    }

    /// Returns one connection; `None` once it is gone.
    pub fn get(&self, id: ConnectionId) -> Option<Connection> {
        Some(self.lock().entries.get(&id)?.view(id))
    }

    /// Takes the events of connections since the last call, in order.
    pub fn take_events(&self) -> Vec<ConnectionEvent> {
        self.lock().events.drain(..).collect()
    }

    /// Sends bytes to the program at the other end: from a server to any process, from other processes to the
    /// server. The world's own messages never wait for them. What is on its way when the link breaks is lost.
    pub fn send(&self, id: ConnectionId, bytes: &[u8], delivery: Delivery) -> Result<(), ConnectionError> {
        let mut state = self.lock();
        let entry = state.entries.get_mut(&id).ok_or(ConnectionError::Gone)?;
        if !self.is_spoken_with(entry.who) {
            return Err(ConnectionError::NotByServer);
        }
        entry.link.map_err(|_| ConnectionError::Lost)?;
        entry.mail.post(bytes, delivery)?;
        state.sending.insert(id);
        drop(state);
        (self.shared.wake)();
        Ok(())
    }

    /// Takes the messages that programs have sent to this one since the last call, in order of arrival. A
    /// program that does not take its messages holds their senders back.
    pub fn take_messages(&self) -> Vec<ProgramMessage> {
        let mut state = self.lock();
        let State { entries, sending, inbox, .. } = &mut *state;
        let mut is_to_tell = false;
        for Received { link, message } in inbox.iter() {
            if let Some(entry) = entries.get_mut(&message.from).filter(|entry| entry.link == Ok(*link)) {
                entry.mail.take(&message.bytes, message.delivery);
                if entry.mail.is_to_tell() {
                    is_to_tell |= sending.insert(message.from);
                }
            }
        }
        let messages = inbox.drain(..).map(|received| received.message).collect();
        state.ended = 0;
        drop(state);
        if is_to_tell {
            (self.shared.wake)();
        }
        messages
    }

    /// Returns the number of arrivals over the network so far that concern the user, for
    /// [`Connections::wait`].
    pub fn arrivals(&self) -> u64 {
        self.lock().arrivals
    }

    /// Waits until there are more than `seen` arrivals, or the process's loop has ended, but no longer than
    /// `timeout`. Returns whether one of the two happened.
    pub fn wait(&self, seen: u64, timeout: Duration) -> bool {
        let nothing = |state: &mut State| state.arrivals <= seen && !state.over;
        let waited = self.shared.arrived.wait_timeout_while(self.lock(), timeout, nothing);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }

    /// Disconnects a process from the server. The process is told the reason. A node's regions are handed
    /// over first; a client's avatars wait for its return. The process may come back with a new token.
    /// [`ConnectionChange::Gone`] reports that it is gone.
    pub fn disconnect(&self, id: ConnectionId, reason: impl Into<String>) -> Result<(), ConnectionError> {
        if !self.shared.is_server {
            return Err(ConnectionError::NotServer);
        }
        let mut state = self.lock();
        let who = state.entries.get(&id).ok_or(ConnectionError::Gone)?.who;
        state.sent_away.insert(who, reason.into());
        drop(state);
        (self.shared.wake)();
        Ok(())
    }

    /// Makes the connections of a process with this name; `wake` wakes its loop, which then looks for work.
    pub(super) fn new(who: PeerName, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let shared = Shared {
            state: Mutex::default(),
            arrived: Condvar::new(),
            is_server: who == PeerName::Server,
            wake: Box::new(wake),
        };
        Self { shared: Arc::new(shared) }
    }

    /// Records a new link.
    pub(super) fn linked(&self, link: PeerKey, who: PeerName, address: SocketAddr) {
        let mut state = self.lock();
        match state.of_peer.get(&who).copied() {
            Some(id) => {
                if let Some(former) = state.entries.get(&id).and_then(|entry| entry.link.ok()) {
                    state.unlink(former, Ending::Superseded.reason());
                }
                let Some(entry) = state.entries.get_mut(&id) else { return };
                let traffic = std::mem::take(&mut entry.traffic);
                entry.before.add(&traffic);
                (entry.link, entry.address) = (Ok(link), address);
                entry.links += 1;
                state.of_link.insert(link, id);
                state.tell(id, who, ConnectionChange::Back);
            }
            None => {
                state.last += 1;
                let id = ConnectionId(state.last);
                let (before, traffic) = Default::default();
                let (came, mail) = (Instant::now(), Mail::default());
                let entry = Entry { who, address, came, link: Ok(link), before, traffic, mail, links: 1 };
                state.entries.insert(id, entry);
                state.of_peer.insert(who, id);
                state.of_link.insert(link, id);
                state.tell(id, who, ConnectionChange::Came);
            }
        }
        self.shared.arrived.notify_all();
    }

    /// Records that a link broke. Its process makes it again, or should.
    pub(super) fn lost(&self, link: PeerKey, reason: Reason) {
        self.lock().unlink(link, reason);
        self.shared.arrived.notify_all();
    }

    /// Records that a link was closed for good.
    pub(super) fn gone(&self, link: PeerKey, reason: Reason) {
        let mut state = self.lock();
        if let Some(id) = state.of_link.get(&link).copied() {
            state.forget(id, reason);
        }
        self.shared.arrived.notify_all();
    }

    /// Reads the counters of all links, and forgets connections that were without a link for too long. The
    /// connection with a server is kept: the process's loop decides itself when to give that up.
    pub(super) fn refresh(&self, now: Instant, traffic: impl Fn(PeerKey) -> Option<PeerStats>) {
        let mut state = self.lock();
        let mut late = Vec::new();
        for (&id, entry) in &mut state.entries {
            match entry.link {
                Ok(link) => entry.traffic = traffic(link).unwrap_or(entry.traffic),
                Err(since) if entry.who != PeerName::Server && since + KEPT <= now => late.push(id),
                Err(_) => {}
            }
        }
        for id in late {
            state.forget(id, Reason::new(Cause::Broken, "it did not come back"));
            self.shared.arrived.notify_all();
        }
    }

    /// Sends waiting messages of programs, as far as there is room. Returns whether to try again soon.
    pub(super) fn send_waiting(&self, mut send: impl FnMut(PeerKey, &[u8], Delivery) -> Sent) -> bool {
        let State { entries, sending, .. } = &mut *self.lock();
        sending.retain(|id| match entries.get_mut(id) {
            Some(Entry { link: Ok(link), mail, .. }) => {
                mail.send(|frame, delivery| send(*link, frame, delivery))
            }
            _ => false,
        });
        !sending.is_empty()
    }

    /// Takes in a frame from the program at the other end of a link. An error names the rule that the frame
    /// broke.
    pub(super) fn heard(&self, link: PeerKey, program: Program) -> Result<(), &'static str> {
        let state = &mut *self.lock();
        let Some(&from) = state.of_link.get(&link) else { return Ok(()) };
        let Some(entry) = state.entries.get_mut(&from) else { return Ok(()) };
        let who = entry.who;
        if !self.is_spoken_with(who) {
            return Err("a message for our program, which speaks with the server's only");
        }
        let is_room = matches!(program, Program::Taken(_));
        if let Some((bytes, delivery)) = entry.mail.hear(program)? {
            state.inbox.push_back(Received { link, message: ProgramMessage { from, who, delivery, bytes } });
            state.arrivals += 1;
            self.shared.arrived.notify_all();
        } else if is_room {
            state.sending.insert(from);
        }
        Ok(())
    }

    /// Takes the processes to disconnect, with the reasons. Connections without a link are gone at once.
    pub(super) fn take_sent_away(&self) -> BTreeMap<PeerName, String> {
        let mut state = self.lock();
        let sent_away = std::mem::take(&mut state.sent_away);
        for (who, reason) in &sent_away {
            let id = state.of_peer.get(who).copied();
            let is_lost = |id: &ConnectionId| state.entries[id].link.is_err();
            if let Some(id) = id.filter(is_lost) {
                state.forget(id, Reason::new(Cause::SentAway, reason.clone()));
                self.shared.arrived.notify_all();
            }
        }
        sent_away
    }

    /// Wakes a waiting user, since something else has arrived.
    pub(super) fn ring(&self) {
        self.lock().arrivals += 1;
        self.shared.arrived.notify_all();
    }

    /// Ends all connections, since the process's loop has ended.
    pub(super) fn end(&self, reason: Reason) {
        let mut state = self.lock();
        for id in state.entries.keys().copied().collect::<Vec<_>>() {
            state.forget(id, reason.clone());
        }
        state.over = true;
        self.shared.arrived.notify_all();
    }

    /// Returns whether this process's program and that of `who` may send to each other.
    fn is_spoken_with(&self, who: PeerName) -> bool {
        self.shared.is_server || who == PeerName::Server
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entry {
    fn view(&self, id: ConnectionId) -> Connection {
        let mut traffic = self.before;
        traffic.add(&self.traffic);
        let (rtt, bytes_waiting) = (self.traffic.rtt, self.traffic.bytes_waiting);
        Connection {
            id,
            who: self.who,
            address: self.address,
            is_up: self.link.is_ok(),
            links: self.links,
            age: self.came.elapsed(),
            traffic: PeerStats { rtt, bytes_waiting, ..traffic },
            dropped: self.mail.dropped,
        }
    }
}

impl State {
    fn unlink(&mut self, link: PeerKey, reason: Reason) {
        let Some(id) = self.of_link.remove(&link) else { return };
        let Some(entry) = self.entries.get_mut(&id) else { return };
        entry.link = Err(Instant::now());
        let (who, untaken) = (entry.who, entry.mail.untaken());
        entry.mail.end();
        self.keep_ended(untaken);
        self.tell(id, who, ConnectionChange::Lost(reason));
    }

    fn forget(&mut self, id: ConnectionId, reason: Reason) {
        let Some(entry) = self.entries.remove(&id) else { return };
        self.of_peer.remove(&entry.who);
        if let Ok(link) = entry.link {
            self.of_link.remove(&link);
            self.keep_ended(entry.mail.untaken());
        }
        self.tell(id, entry.who, ConnectionChange::Gone(reason));
    }

    /// Counts untaken messages of a link that has ended.
    fn keep_ended(&mut self, untaken: u64) {
        self.ended += untaken;
        if self.ended > ENDED_BYTES {
            tracing::warn!("messages of processes that went are forgotten: this program does not take them");
            self.inbox.retain(|received| self.of_link.contains_key(&received.link));
            self.ended = 0;
        }
    }

    fn tell(&mut self, id: ConnectionId, who: PeerName, change: ConnectionChange) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(ConnectionEvent { id, who, change });
        self.arrivals += 1;
    }
}
