//! Tells clients the states of bodies on a thread of its own, so that no tick waits for it.
//!
//! Its inbox is bounded. Beyond a few waiting ticks only the newest states are kept; of guesses (states of
//! speculative ticks) only the newest one, and of each client's acknowledgements the newest few dozen. So
//! whatever clients cost, they are told less often, and the world goes on. A relay's thread reads all that
//! its leader tells it, in order; the leader tells it no more than a bound before it hears that all was read.
//! States are given to the network's thread for a few links at a time, so that messages between members do
//! not wait behind the states for all clients.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;

use tracing::debug;

use super::bandwidth::Received;
use crate::cluster::{Peer, ReplicationEvent, StateReplication, TickNews};
use crate::net::{Datagrams, PeerKey};
use crate::priority::give_way;
use crate::protocol::{self, Heard, Lane, Message, Stamp, ToClient, ToRelay};
use crate::space::{ClientId, Tick};

/// The most acknowledgements of a client that wait; beyond it the oldest are dropped. A client that keeps to
/// the rules gathers each of them for 10 ms. The bound is per client, so that no client pushes out those of
/// another: acknowledgements are not sent again, and a client that seems to acknowledge nothing is told
/// little.
const HEARD: usize = 64;

/// The most ticks that wait as they are. This thread merges them into one. If it is farther behind, the loop
/// that computes the world merges further ones.
const TICKS: usize = 4;

/// The most bytes of states from a leader that wait at its relay. An honest leader sends no more than a
/// fraction of this before it hears that all was read. What another sends beyond is dropped, and nothing that
/// follows can be read.
const FED: usize = 64 << 20;

/// The number of clients that are told before the network's thread gets its turn. Each costs that thread some
/// 20 µs.
const CLIENTS_AT_ONCE: usize = 8;

/// States of a speculative tick are sent only if at most this many bytes of datagrams wait on their link.
/// They are worth nothing when they arrive late, and authoritative states would wait behind them.
const GUESSES_WAITING: usize = 8 << 10;

/// The links of a process, by the peers at their other ends.
pub(super) type Keys = Arc<RwLock<BTreeMap<Peer, PeerKey>>>;

/// What the thread sends with.
pub(super) struct Outlet {
    /// The links to send over.
    pub(super) keys: Keys,
    /// The network's datagrams.
    pub(super) datagrams: Datagrams,
    /// Counts what was sent.
    pub(super) sent: Arc<Mutex<Received>>,
}

/// A message that does not go by datagram: for a client in this process, or one that must arrive, as all
/// messages between leaders and relays.
pub(super) struct Told {
    pub(super) to: Peer,
    pub(super) message: Message,
}

/// Hands acknowledgements of clients to the thread.
#[derive(Clone, Default)]
pub(super) struct Ear(Arc<Inbox>);

impl Ear {
    /// Hands over an acknowledgement of a client. It counts for what is told next, which is after a tick; so
    /// the thread is not woken for it.
    pub(super) fn hear(&self, client: ClientId, heard: Heard) {
        let mut all = lock(&self.0.heard);
        let now = all.newest;
        all.push(client, heard, now);
    }

    /// Returns an ear of a thread at a leader.
    #[cfg(test)]
    pub(super) fn of_leader() -> Self {
        let ear = Self::default();
        lock(&ear.0.heard).leads = true;
        ear
    }

    /// Returns how many acknowledgements wait for the thread.
    #[cfg(test)]
    pub(super) fn waiting(&self) -> usize {
        lock(&self.0.heard).of.values().map(VecDeque::len).sum()
    }
}

/// The thread that tells clients. It ends when this is dropped.
pub(super) struct FanOut {
    inbox: Arc<Inbox>,
    thread: Option<JoinHandle<()>>,
}

impl FanOut {
    /// Starts the thread. What the thread does not send itself it gives to `tell`, which must not wait.
    pub(super) fn start(outlet: Outlet, tell: impl Fn(Told) + Send + 'static) -> std::io::Result<Self> {
        let inbox = Arc::new(Inbox::default());
        let from = Arc::clone(&inbox);
        let mut teller = Teller { outlet, tell, batches: BTreeMap::new(), links: BTreeMap::new(), sent: 0 };
        let thread = std::thread::Builder::new().name("dcd-fan-out".into()).spawn(move || {
            give_way();
            let mut replication = None;
            while let Some(events) = from.take() {
                let mut events = teller.read(&mut replication, events);
                make_one_tick(&mut events);
                for event in events {
                    // Telling all clients of the events before it takes long: by now the guess may be out of
                    // date.
                    let is_guess = matches!(event, ReplicationEvent::Speculative { .. });
                    if !is_guess || !from.lock().outdates_guesses() {
                        teller.handle(&mut replication, event);
                    }
                }
            }
        })?;
        Ok(Self { inbox, thread: Some(thread) })
    }

    /// Returns the ear by which the thread gets acknowledgements.
    pub(super) fn ear(&self) -> Ear {
        Ear(self.inbox.clone())
    }

    /// Gives the thread events, without waiting. Returns whether the thread lives.
    pub(super) fn handle(&self, events: Vec<ReplicationEvent>) -> bool {
        if !events.is_empty() {
            let mut waiting = self.inbox.lock();
            events.into_iter().for_each(|event| waiting.push(event));
            // Released first: the thread takes the lock when it wakes.
            drop(waiting);
            self.inbox.changed.notify_one();
        }
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for FanOut {
    fn drop(&mut self) {
        self.inbox.lock().end();
        self.inbox.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Inbox {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    heard: Arc<Mutex<Acknowledged>>,
}

/// The acknowledgements of each client, each with the tick that was the newest when it came.
type AllHeard = BTreeMap<ClientId, VecDeque<(Heard, Tick)>>;

/// The acknowledgements that wait. They have a lock of their own, so that the network's thread, which adds
/// them, does not wait while ticks are merged. If both locks are taken, this one is taken last.
#[derive(Default)]
struct Acknowledged {
    of: AllHeard,
    /// The newest complete tick.
    newest: Tick,
    /// Says whether this process leads. If not, nobody here needs what clients acknowledge to others.
    leads: bool,
}

impl Acknowledged {
    fn push(&mut self, client: ClientId, heard: Heard, now: Tick) {
        if self.leads {
            let waiting = self.of.entry(client).or_default();
            if waiting.len() == HEARD {
                waiting.pop_front();
            }
            waiting.push_back((heard, now));
        }
    }
}

#[derive(Default)]
struct Waiting {
    /// All events but acknowledgements, which wake nobody.
    events: VecDeque<ReplicationEvent>,
    heard: Arc<Mutex<Acknowledged>>,
    over: bool,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Default for Inbox {
    fn default() -> Self {
        let waiting = Waiting::default();
        let heard = Arc::clone(&waiting.heard);
        Self { waiting: Mutex::new(waiting), changed: Condvar::new(), heard }
    }
}

impl Inbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        lock(&self.waiting)
    }

    /// Waits for an event, and takes all; `None` when there is none and no more will come.
    fn take(&self) -> Option<VecDeque<ReplicationEvent>> {
        let nothing = |waiting: &mut Waiting| waiting.events.is_empty() && !waiting.over;
        let mut waiting =
            self.changed.wait_while(self.lock(), nothing).unwrap_or_else(PoisonError::into_inner);
        let (events, heard) = waiting.take();
        // Released first: the loop that computes the world waits for this lock, and need not wait for the
        // sorting too.
        drop(waiting);
        (!events.is_empty()).then(|| in_order(events, heard))
    }
}

impl Waiting {
    /// Takes all events and acknowledgements.
    fn take(&mut self) -> (VecDeque<ReplicationEvent>, AllHeard) {
        (std::mem::take(&mut self.events), std::mem::take(&mut lock(&self.heard).of))
    }

    fn push(&mut self, event: ReplicationEvent) {
        let event = match event {
            // What a former leader has not told yet concerns nobody.
            ReplicationEvent::Begin(_) => {
                self.events.clear();
                let mut heard = lock(&self.heard);
                heard.of.clear();
                heard.leads = true;
                event
            }
            ReplicationEvent::Heard { client, heard, now } => {
                return lock(&self.heard).push(client, heard, now);
            }
            // A later guess, or an authoritative tick, says all that an earlier guess does.
            ReplicationEvent::Speculative { .. } => {
                self.drop_guesses();
                event
            }
            ReplicationEvent::End => {
                self.stop();
                event
            }
            ReplicationEvent::ByLeader(message) => {
                self.drop_guesses();
                if self.fed_bytes() > FED {
                    return;
                }
                if let ToRelay::News(news) = &message {
                    lock(&self.heard).newest = news.tick;
                    news.clients.iter().for_each(|&(client, _)| self.begins_anew(client));
                }
                ReplicationEvent::ByLeader(message)
            }
            // It includes what the node said before.
            ReplicationEvent::Fed { node, .. } => {
                let is_of = |event: &ReplicationEvent| matches!(event, ReplicationEvent::Fed { node: of, .. } if *of == node);
                self.events.retain(|event| !is_of(event));
                event
            }
            ReplicationEvent::Tick(news) => {
                lock(&self.heard).newest = news.tick();
                self.drop_guesses();
                ReplicationEvent::Tick(match self.take_tick() {
                    Some(mut earlier) => {
                        earlier.absorb(news);
                        earlier
                    }
                    None => news,
                })
            }
            ReplicationEvent::Admit { client, .. }
            | ReplicationEvent::Dismiss(client)
            | ReplicationEvent::Relay { client, .. } => {
                self.begins_anew(client);
                event
            }
        };
        self.events.push_back(event);
    }

    /// Drops what waits about a client's former link. Its interests in waiting ticks would be applied after
    /// what follows, and acknowledgements that came over that link are about what does not count any more.
    fn begins_anew(&mut self, client: ClientId) {
        lock(&self.heard).of.remove(&client);
        for waiting in &mut self.events {
            match waiting {
                ReplicationEvent::Tick(news) => news.uninterested(client),
                ReplicationEvent::ByLeader(ToRelay::News(news)) => {
                    news.interests.retain(|&(of, _)| of != client);
                }
                _ => {}
            }
        }
    }

    /// Returns whether what waits now outdates a guess that was taken before.
    fn outdates_guesses(&self) -> bool {
        let is_newer = |event: &ReplicationEvent| {
            !matches!(
                event,
                ReplicationEvent::Admit { .. }
                    | ReplicationEvent::Dismiss(_)
                    | ReplicationEvent::Relay { .. }
                    | ReplicationEvent::Fed { .. }
            )
        };
        self.over || self.events.iter().any(is_newer)
    }

    /// Returns the bytes of states that wait at a relay.
    fn fed_bytes(&self) -> usize {
        let bytes = |event: &ReplicationEvent| match event {
            ReplicationEvent::ByLeader(ToRelay::News(news)) => news.states.len(),
            _ => 0,
        };
        self.events.iter().map(bytes).sum()
    }

    fn drop_guesses(&mut self) {
        let is_guess = |event: &ReplicationEvent| {
            matches!(
                event,
                ReplicationEvent::Speculative { .. } | ReplicationEvent::ByLeader(ToRelay::Guess { .. })
            )
        };
        self.events.retain(|event| !is_guess(event));
    }

    /// Records that nothing more will come.
    fn end(&mut self) {
        self.over = true;
        self.stop();
    }

    /// Ends leading: from now on only authoritative states are told, and acknowledgements are dropped.
    fn stop(&mut self) {
        self.drop_guesses();
        let mut heard = lock(&self.heard);
        heard.leads = false;
        heard.of.clear();
    }

    /// Takes the last tick that waits, if [`TICKS`] of them do.
    fn take_tick(&mut self) -> Option<TickNews> {
        let is_tick = |event: &ReplicationEvent| matches!(event, ReplicationEvent::Tick(_));
        if self.events.iter().filter(|event| is_tick(event)).count() < TICKS {
            return None;
        }
        let at = self.events.iter().rposition(is_tick)?;
        match self.events.remove(at) {
            Some(ReplicationEvent::Tick(news)) => Some(news),
            _ => None,
        }
    }
}

/// Puts what clients acknowledged before what they are told next.
fn in_order(mut events: VecDeque<ReplicationEvent>, heard: AllHeard) -> VecDeque<ReplicationEvent> {
    let tells = |event: &ReplicationEvent| {
        matches!(
            event,
            ReplicationEvent::Tick(_) | ReplicationEvent::Speculative { .. } | ReplicationEvent::ByLeader(_)
        )
    };
    let at = events.iter().position(tells).unwrap_or(events.len());
    let told = events.split_off(at);
    for (client, heard) in heard {
        let event = |(heard, now)| ReplicationEvent::Heard { client, heard, now };
        events.extend(heard.into_iter().map(event));
    }
    events.extend(told);
    events
}

/// Merges all ticks into one, in the place of the last one: of each body only the newest state counts.
fn make_one_tick(events: &mut VecDeque<ReplicationEvent>) {
    let mut left = events.iter().filter(|event| matches!(event, ReplicationEvent::Tick(_))).count();
    let mut all: Option<TickNews> = None;
    for event in std::mem::take(events) {
        let ReplicationEvent::Tick(news) = event else {
            events.push_back(event);
            continue;
        };
        match &mut all {
            Some(earlier) => earlier.absorb(news),
            None => all = Some(news),
        }
        left -= 1;
        if left == 0 {
            events.extend(all.take().map(ReplicationEvent::Tick));
        }
    }
}

/// The state of the thread.
struct Teller<T> {
    outlet: Outlet,
    tell: T,
    /// The newest batch of states given to the link of each client.
    batches: BTreeMap<ClientId, u32>,
    /// The link over which each client is told. The loop hears of a new link first; states that are meant for
    /// the former link would mislead the client.
    links: BTreeMap<ClientId, PeerKey>,
    /// The number of clients that were told since the network's thread had its turn.
    sent: usize,
}

impl<T: Fn(Told)> Teller<T> {
    /// Reads what the leader tells its relay, and returns the events to handle in its place. The beginning of
    /// a replication is handled at once.
    fn read(
        &mut self,
        replication: &mut Option<Box<StateReplication>>,
        events: VecDeque<ReplicationEvent>,
    ) -> VecDeque<ReplicationEvent> {
        let mut all = VecDeque::new();
        for event in events {
            match (&mut *replication, event) {
                (_, event @ ReplicationEvent::Begin(_)) => self.handle(replication, event),
                (Some(replication), ReplicationEvent::ByLeader(message)) => {
                    all.extend(replication.read(message));
                }
                (_, event) => all.push_back(event),
            }
        }
        all
    }

    fn handle(&mut self, replication: &mut Option<Box<StateReplication>>, event: ReplicationEvent) {
        match (&mut *replication, event) {
            (_, ReplicationEvent::End) => *replication = None,
            (_, ReplicationEvent::Begin(new)) => {
                (self.batches, self.links) = (BTreeMap::new(), BTreeMap::new());
                *replication = Some(new);
            }
            (Some(replication), event) => {
                if let ReplicationEvent::Admit { client, .. }
                | ReplicationEvent::Dismiss(client)
                | ReplicationEvent::Relay { client, .. } = &event
                {
                    self.batches.remove(client);
                    self.links.remove(client);
                }
                replication.handle(event);
                for (client, message) in replication.take_messages() {
                    self.send(replication, client, message);
                }
                for (node, message) in replication.take_member_messages() {
                    (self.tell)(Told { to: Peer::Node(node), message });
                }
            }
            (None, _) => {}
        }
    }

    fn send(&mut self, replication: &mut StateReplication, client: ClientId, message: ToClient) {
        let Some(to) = replication.route(client) else { return };
        let key = self.outlet.keys.read().unwrap_or_else(PoisonError::into_inner).get(&to).copied();
        let Some(key) = key else {
            return (self.tell)(Told { to, message: Message::ToClient(client, message) });
        };
        // A client's own link that is made anew begins anew, with a new admission. The link of the node whose
        // user the client is may break and come back within a view.
        if matches!(to, Peer::Client(_)) && *self.links.entry(client).or_insert(key) != key {
            return;
        }
        if let ToClient::CompactStates { part, .. } = &message
            && self.batches.insert(client, part.batch) != Some(part.batch)
        {
            // Takes in how much still waits as the next batch is given to the link.
            replication.hear_backlog(client, self.outlet.datagrams.waiting(key));
            self.take_turns();
        }
        let guess = stamp_of(&message).is_some_and(|stamp| stamp.speculative);
        let message = Message::ToClient(client, message);
        let bytes = protocol::encode(&message);
        if message.lane() != Lane::State || bytes.len() > protocol::DATAGRAM_BYTES {
            return (self.tell)(Told { to, message });
        }
        if guess && self.outlet.datagrams.waiting(key) > GUESSES_WAITING {
            return;
        }
        self.outlet.sent.lock().unwrap_or_else(PoisonError::into_inner).count(message.subject(), bytes.len());
        if let Err(error) = self.outlet.datagrams.send(key, bytes) {
            debug!(?to, %error, "a datagram is not sent");
        }
    }

    /// Gives the network's thread its turn after every few clients.
    fn take_turns(&mut self) {
        self.sent += 1;
        if self.sent == CLIENTS_AT_ONCE {
            self.sent = 0;
            self.outlet.datagrams.wait_for_turn();
        }
    }
}

fn stamp_of(message: &ToClient) -> Option<&Stamp> {
    match message {
        ToClient::States { stamp, .. } | ToClient::CompactStates { stamp, .. } => Some(stamp),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
