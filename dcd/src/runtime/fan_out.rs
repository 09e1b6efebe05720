//! Tells clients the states of bodies on a thread of its own, so that no tick waits for it.
//!
//! Its inbox is bounded: of the ticks that wait there, but for a few, the newest states alone remain, of guesses the newest, and of what each
//! client acknowledges the newest some dozens. So whatever clients cost, they are told less often, and the world goes on. What a leader tells its
//! relay is all read, and in order; it tells no more than a bound before that is so. What is sent goes to the network's thread by a few links at a time, so
//! that what members tell each other does not wait behind the states for all clients.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;

use tracing::debug;

use super::bandwidth::Received;
use crate::cluster::{Peer, ReplicationEvent, StateReplication, TickNews};
use crate::net::{Datagrams, PeerKey};
use crate::protocol::{self, Heard, Lane, Message, Stamp, ToClient, ToRelay};
use crate::space::{ClientId, Tick};

/// Acknowledgements of a client that may wait, of the newest: one that keeps to the rules gathers them for 10 ms each. An acknowledgement is not
/// made again, and who seems to acknowledge nothing is told little, so that no client may push out those of another.
const HEARD: usize = 64;

/// Ticks that may wait as they are. This thread makes one of them; where it is farther behind, who computes the world does.
const TICKS: usize = 4;

/// Bytes of states from a leader that may wait at its relay. An honest leader tells no more than a fraction before it hears that all was read; of
/// another's what is beyond is dropped, and nothing that follows can be read.
const FED: usize = 64 << 20;

/// The clients that are told before the network's thread has had its turn. Each costs that thread some 20 µs.
const CLIENTS_AT_ONCE: usize = 8;

/// States of a speculative tick are sent only if at most this many bytes of datagrams wait on their link: they are worth nothing when they arrive
/// late, and authoritative states would wait behind them.
const GUESSES_WAITING: usize = 8 << 10;

/// The links of a process by the peers at their other ends.
pub(super) type Keys = Arc<RwLock<BTreeMap<Peer, PeerKey>>>;

/// What the thread sends with.
pub(super) struct Outlet {
    /// Over which links.
    pub(super) keys: Keys,
    /// The network.
    pub(super) datagrams: Datagrams,
    /// Counts what was sent.
    pub(super) sent: Arc<Mutex<Received>>,
}

/// A message that goes another way than by a datagram: for a client in this process, or one that must arrive, as all between leaders and relays.
pub(super) struct Told {
    pub(super) to: Peer,
    pub(super) message: Message,
}

/// Gives the thread what clients acknowledge.
#[derive(Clone, Default)]
pub(super) struct Ear(Arc<Inbox>);

impl Ear {
    /// Gives it an acknowledgement of a client. It counts for what is told next, which is after a tick: the thread is not woken for it.
    pub(super) fn hear(&self, client: ClientId, heard: Heard) {
        let mut all = lock(&self.0.heard);
        let now = all.newest;
        all.push(client, heard, now);
    }

    /// Returns the same at a leader.
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

/// The thread that tells clients; it ends when this is dropped.
pub(super) struct FanOut {
    inbox: Arc<Inbox>,
    thread: Option<JoinHandle<()>>,
}

impl FanOut {
    /// Starts the thread; what it does not send itself it gives to `tell`, which must not wait.
    pub(super) fn start(outlet: Outlet, tell: impl Fn(Told) + Send + 'static) -> std::io::Result<Self> {
        let inbox = Arc::new(Inbox::default());
        let from = Arc::clone(&inbox);
        let mut teller = Teller { outlet, tell, batches: BTreeMap::new(), links: BTreeMap::new(), sent: 0 };
        let thread = std::thread::Builder::new().name("dcd-fan-out".into()).spawn(move || {
            let mut replication = None;
            while let Some(events) = from.take() {
                let mut events = teller.read(&mut replication, events);
                make_one_tick(&mut events);
                for event in events {
                    // To tell all clients what was taken before it takes long: by now it may have come true.
                    let is_guess = matches!(event, ReplicationEvent::Speculative { .. });
                    if !is_guess || !from.lock().outdates_guesses() {
                        teller.handle(&mut replication, event);
                    }
                }
            }
        })?;
        Ok(Self { inbox, thread: Some(thread) })
    }

    /// Returns what gives it acknowledgements.
    pub(super) fn ear(&self) -> Ear {
        Ear(self.inbox.clone())
    }

    /// Gives it events; returns at once, and whether the thread lives.
    pub(super) fn handle(&self, events: Vec<ReplicationEvent>) -> bool {
        if !events.is_empty() {
            let mut waiting = self.inbox.lock();
            events.into_iter().for_each(|event| waiting.push(event));
            // Whoever wakes takes the lock.
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

/// The acknowledgements of each client, each with the newest tick then.
type AllHeard = BTreeMap<ClientId, VecDeque<(Heard, Tick)>>;

/// Keeps what clients acknowledged. It has a lock of its own, which is taken after the other, if both are: the network's thread puts it there, and does not
/// wait until ticks have been made one.
#[derive(Default)]
struct Acknowledged {
    of: AllHeard,
    /// The newest tick that is complete.
    newest: Tick,
    /// Whether this process leads: what clients acknowledge to others lies here for nobody.
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
    /// All but acknowledgements, which wake nobody.
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

    /// Waits for an event and takes all; `None` when there is none and no more will come.
    fn take(&self) -> Option<VecDeque<ReplicationEvent>> {
        let nothing = |waiting: &mut Waiting| waiting.events.is_empty() && !waiting.over;
        let mut waiting =
            self.changed.wait_while(self.lock(), nothing).unwrap_or_else(PoisonError::into_inner);
        let (events, heard) = waiting.take();
        // Who computes the world waits for the lock, and does not for what all clients acknowledged to be put in order.
        drop(waiting);
        (!events.is_empty()).then(|| in_order(events, heard))
    }
}

impl Waiting {
    /// Takes all.
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
            // A later guess, or what came true, says all that an earlier guess does.
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
            // What was said before says less.
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

    /// What the ticks that wait say of a client's former link would come after what follows, and what came over that acknowledges what counts no
    /// more.
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

    /// Returns whether what waits says all that a guess does which was taken before.
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

    /// Returns the bytes of states that wait here, at a relay.
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

    /// Nothing more will come.
    fn end(&mut self) {
        self.over = true;
        self.stop();
    }

    /// This process leads no more: what is still told are states that came true.
    fn stop(&mut self) {
        self.drop_guesses();
        let mut heard = lock(&self.heard);
        heard.leads = false;
        heard.of.clear();
    }

    /// Takes the last tick that waits, if as many do as may.
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

/// Makes one of all ticks, in the place of the last: of each body the newest state alone counts.
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
    /// Over which link each client is told: of a new one the loop hears first, and states that are meant for the old one would mislead it.
    links: BTreeMap<ClientId, PeerKey>,
    /// How many clients were told since the network's thread had its turn.
    sent: usize,
}

impl<T: Fn(Told)> Teller<T> {
    /// Reads what the leader tells its relay, and returns what is to be handled in its place. A replication that begins does so at once.
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
        // A client's own link is made anew with it, and begins anew; that of the node whose user it is breaks and comes back in the same view.
        if matches!(to, Peer::Client(_)) && *self.links.entry(client).or_insert(key) != key {
            return;
        }
        if let ToClient::CompactStates { part, .. } = &message
            && self.batches.insert(client, part.batch) != Some(part.batch)
        {
            // What is still waiting as the next batch is given to the link.
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

    /// Lets the network's thread have its turn after every few clients.
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
