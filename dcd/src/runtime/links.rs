//! Maps the cluster's peers to network links: encodes and decodes messages, chooses lanes, and queues
//! messages that must wait for a link.
//!
//! **A peer that reads slowly** costs bounded memory, and then loses its link; it can dial again. Besides
//! what QUIC and the lanes hold ([`protocol::link`]), the following may wait here:
//! - for a server, a node or a participant: a whole world, since a view change may move all of it;
//! - for a client: a whole world while it receives its first snapshot; later [`CHANGES_BYTES`] of what
//!   appears, goes or changes in the world, except avatars; otherwise nothing;
//! - for a peer that has taken in nothing for [`STUCK`] while its link was up: nothing;
//! - for all players that are receiving the world, together: [`WORLDS_BYTES`] and one world. Further
//!   greetings wait their turn.
//!
//! States go in datagrams and never wait: the oldest are dropped. A message that a tick waits for is sent
//! twice over links that lose packets ([`repeats`](super::repeats)).

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError, RwLockWriteGuard};
use std::time::{Duration, Instant};

use tracing::{debug, warn};

use super::bandwidth::{LinkTotals, Received};
use super::connections::{Connections, Delivery, Sent};
use super::ending::{Cause, Ending, Reason};
use super::fan_out::{Keys, Outlet};
use super::repeats::{Repeats, is_awaited};
use crate::cluster::Peer;
use crate::net::{CloseCause, CloseCode, Net, NetError, NetEvent, NetTotals, PeerKey, PeerName, SendError};
use crate::protocol::{self, CodecError, Hello, JoinAs, Lane, Message, ToClient};
use crate::space::{ClientId, NodeId};

/// The most bytes that may wait for a peer: a world, and what happens in it meanwhile.
pub(super) const WORLD_BYTES: usize = 256 << 20;
/// The most bytes of what others build that may wait for a client.
const CHANGES_BYTES: usize = 16 << 20;
/// Once this many bytes wait for players, further greetings wait before they are answered with the world. So
/// many players that come at once and read nothing cost no more than this and one world.
const WORLDS_BYTES: usize = 24 << 20;
/// While greetings wait, a player that takes in nothing for this long is given up.
const PRESSED: Duration = Duration::from_secs(2);
/// A greeting waits no longer than this, however slowly others take in the world.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// A peer that takes in nothing for this long, though something waits for it, is given up.
const STUCK: Duration = Duration::from_secs(10);
/// The fewest bytes that count as taking something in: a peer that reads a few bytes at a time does not keep
/// a world waiting for it.
const LEAST_READ: usize = 16 << 10;

/// A program's datagram is sent only if at most this many bytes of datagrams wait on its link: states go
/// first.
const PROGRAM_DATAGRAMS_WAITING: usize = 8 << 10;

/// How often the user's traffic counters are refreshed. There may be many links: one per client.
const COUNT: Duration = Duration::from_millis(400);
/// How often the losses of links to nodes are counted.
const COUNT_LOSSES: Duration = Duration::from_millis(100);

/// A message is repeated only if at most this many bytes of datagrams wait on its link.
const REPEATS_WAITING: usize = 8 << 10;

/// What a client is receiving besides the messages of each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    /// The first snapshot of the world.
    World,
    /// The first snapshot, whose last message waits for the client or was sent.
    WorldEnd,
    /// Changes of the world after the snapshot.
    Changes,
}

/// A greeting of a client that waits while others take in the world.
struct Greeting {
    key: PeerKey,
    since: Instant,
    event: LinkEvent,
}

/// An event of a link, translated for the cluster's state machines.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "an event lives for one call")]
pub(super) enum LinkEvent {
    /// A link is up. The name is the one that the other end has proved.
    Connected(Peer, PeerName),
    /// A link is gone, or could not be made.
    Disconnected {
        /// The peer at the other end.
        peer: Peer,
        /// The reason for which this process or the other ended the link, if one did.
        ending: Option<Ending>,
        /// Says whether nobody answered a call.
        is_unanswered: bool,
        /// The cause as far as known, for people.
        text: String,
    },
    /// A message that could be decoded and that its sender may send.
    Message { from: Peer, message: Message },
}

/// All links of a process.
pub(super) struct Links {
    net: Net,
    connections: Connections,
    count_at: Option<Instant>,
    count_losses_at: Option<Instant>,
    /// Shared with the thread that tells clients.
    keys: Keys,
    names: BTreeMap<PeerKey, PeerName>,
    dialled: BTreeMap<PeerKey, Peer>,
    waiting: BTreeMap<Peer, Waiting>,
    /// What clients are receiving besides the messages of each tick.
    told: BTreeMap<Peer, Told>,
    given_up: Vec<LinkEvent>,
    /// Greetings of players that wait while others take in the world.
    greetings: VecDeque<Greeting>,
    world_bytes: usize,
    worlds_bytes: usize,
    repeats: Repeats,
    received: Received,
    /// Messages that were taken past this process's loop.
    received_beside: Arc<Mutex<Received>>,
    sent: Received,
    /// Messages that the thread that tells clients has sent.
    sent_to_clients: Arc<Mutex<Received>>,
    malformed: u64,
    /// Says whether this process is the server, which alone sends to a participant also as a client.
    is_server: bool,
}

#[derive(Default)]
struct Waiting {
    frames: VecDeque<(crate::net::Lane, Vec<u8>)>,
    bytes: usize,
    /// The time at which the link last took something in, or something began to wait for a link that is up.
    since: Option<Instant>,
    /// The bytes given to the link that it had still to take in at that moment. A frame may hold a shape of
    /// 15.5 MiB.
    on_link: usize,
}

impl Links {
    /// Makes the links of `net`, which the user sees as `connections`.
    pub(super) fn new(net: Net, connections: Connections) -> Self {
        let is_server = net.who() == PeerName::Server;
        Self {
            net,
            connections,
            count_at: None,
            count_losses_at: None,
            keys: Keys::default(),
            names: BTreeMap::new(),
            dialled: BTreeMap::new(),
            waiting: BTreeMap::new(),
            told: BTreeMap::new(),
            given_up: Vec::new(),
            greetings: VecDeque::new(),
            world_bytes: WORLD_BYTES,
            worlds_bytes: WORLDS_BYTES,
            repeats: Repeats::default(),
            received: Received::default(),
            received_beside: Arc::default(),
            sent: Received::default(),
            sent_to_clients: Arc::default(),
            malformed: 0,
            is_server,
        }
    }

    /// Returns what the thread that tells clients sends with.
    pub(super) fn outlet(&self) -> Outlet {
        let (keys, sent) = (self.keys.clone(), self.sent_to_clients.clone());
        Outlet { keys, datagrams: self.net.datagrams(), sent }
    }

    /// Returns the counter of messages that are taken past this process's loop.
    pub(super) fn received_beside(&self) -> Arc<Mutex<Received>> {
        self.received_beside.clone()
    }

    pub(super) fn is_linked(&self, peer: Peer) -> bool {
        self.key(peer).is_some()
    }

    fn key(&self, peer: Peer) -> Option<PeerKey> {
        self.keys.read().unwrap_or_else(PoisonError::into_inner).get(&peer).copied()
    }

    fn keys_mut(&self) -> RwLockWriteGuard<'_, BTreeMap<Peer, PeerKey>> {
        self.keys.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the traffic over all links. If there are many links, it is that of an earlier call.
    pub(super) fn totals(&self) -> NetTotals {
        self.net.counted().totals
    }

    /// Returns the traffic over all links as it is now.
    pub(super) fn totals_now(&self) -> NetTotals {
        self.net.totals()
    }

    /// Returns all that is counted here, together with the network's counters.
    pub(super) fn all_totals(&self, net: NetTotals) -> LinkTotals {
        let waiting_bytes = self.waiting.values().map(|waiting| waiting.bytes as u64).sum();
        let (received, &Self { mut sent, malformed, .. }) = (self.received(), self);
        sent.add(&self.sent_to_clients.lock().unwrap_or_else(PoisonError::into_inner));
        LinkTotals { net, received, sent, waiting_bytes, malformed }
    }

    /// Returns the messages received, by subject.
    pub(super) fn received(&self) -> Received {
        let mut received = self.received;
        received.add(&self.received_beside.lock().unwrap_or_else(PoisonError::into_inner));
        received
    }

    /// Dials a peer at one of these addresses. The outcome comes as an event.
    pub(super) fn dial(&mut self, peer: Peer, addrs: &[SocketAddr]) {
        let expected = match peer {
            Peer::Server => PeerName::Server,
            Peer::Node(node) => PeerName::Node(node),
            Peer::Client(client) => PeerName::Client(client),
        };
        let key = self.net.connect_to_one_of(addrs, expected);
        self.dialled.insert(key, peer);
    }

    /// Sends a message, now or when there is a link with room for it.
    pub(super) fn send(&mut self, to: Peer, message: &Message) {
        let bytes = protocol::encode(message);
        self.sent.count(message.subject(), bytes.len());
        let lane = match message.lane() {
            Lane::State => {
                let key = self.key(to);
                if bytes.len() <= protocol::DATAGRAM_BYTES {
                    if let Some(key) = key
                        && let Err(error) = self.net.send_datagram(key, bytes)
                    {
                        debug!(?to, %error, "a datagram is not sent");
                    }
                    return;
                }
                crate::net::Lane::Client
            }
            // Messages to relays and dispatches of ticks must not wait for each other.
            Lane::Control
                if matches!(message, Message::ToClient(..) | Message::FromClient(..) | Message::Relay(_)) =>
            {
                crate::net::Lane::Client
            }
            Lane::Control => crate::net::Lane::Admin,
            Lane::Border => crate::net::Lane::Object,
        };
        match message {
            Message::ToClient(_, ToClient::Welcome { .. }) => drop(self.told.insert(to, Told::World)),
            Message::ToClient(_, ToClient::WorldEnd) => drop(self.told.insert(to, Told::WorldEnd)),
            // Somebody else builds. The client can neither foresee that nor ask for less of it.
            Message::ToClient(_, message) if message.changes_world() => {
                self.told.entry(to).or_insert(Told::Changes);
            }
            _ => {}
        }
        self.repeats.sent(Instant::now(), to, message, &bytes);
        self.send_frame(to, lane, bytes);
        self.forget_told(to);
    }

    /// Forgets what a client was receiving besides the messages of ticks, once it has taken in the last of
    /// it.
    fn forget_told(&mut self, to: Peer) {
        if !self.waiting.contains_key(&to) && self.told.get(&to).is_some_and(|told| *told != Told::World) {
            self.told.remove(&to);
        }
    }

    /// Sends what waits, as far as there is room. Returns whether anything still waits for a link that is up.
    pub(super) fn flush(&mut self, now: Instant) -> bool {
        if self.count_at.is_none_or(|at| at <= now) {
            self.count_at = Some(now + COUNT);
            let counted = self.net.counted();
            self.connections.refresh(now, |link| counted.links.get(&link).copied());
        }
        if self.count_losses_at.is_none_or(|at| at <= now) {
            self.count_losses_at = Some(now + COUNT_LOSSES);
            self.count_losses();
        }
        while let Some((to, bytes)) = self.repeats.due(now) {
            // Not repeated over a full link: it loses packets because it is full.
            let key = self.key(to).filter(|&key| self.net.datagrams_waiting(key) <= REPEATS_WAITING);
            if let Some(key) = key
                && let Err(error) = self.net.send_datagram(key, bytes)
            {
                debug!(?to, %error, "a message is not repeated");
            }
        }
        let peers: Vec<_> = self.waiting.keys().filter_map(|&peer| Some((peer, self.key(peer)?))).collect();
        let mut left = self.send_programs() || self.repeats.is_waiting() || !self.greetings.is_empty();
        for (peer, key) in peers {
            let Some(mut waiting) = self.waiting.remove(&peer) else { continue };
            let before = waiting.frames.len();
            while let Some((lane, frame)) = waiting.frames.pop_front() {
                match self.net.send(key, lane, &frame) {
                    Err(SendError::Full { .. }) => {
                        waiting.frames.push_front((lane, frame));
                        break;
                    }
                    sent => {
                        waiting.bytes -= frame.len();
                        if let Err(error) = sent {
                            debug!(?peer, %error, "a frame is not sent");
                        }
                    }
                }
            }
            if waiting.frames.is_empty() {
                self.forget_told(peer);
                continue;
            }
            let on_link = self.net.bytes_waiting(key);
            let is_stuck = waiting.frames.len() == before && on_link + LEAST_READ > waiting.on_link;
            let since = waiting.since.filter(|_| is_stuck).unwrap_or(now);
            if waiting.since != Some(since) {
                (waiting.since, waiting.on_link) = (Some(since), on_link);
            }
            self.waiting.insert(peer, waiting);
            left = true;
            let is_pressed = !self.greetings.is_empty() && self.is_player(peer);
            if now.saturating_duration_since(since) >= if is_pressed { PRESSED } else { STUCK } {
                self.give_up(peer);
            }
        }
        left
    }

    fn count_losses(&mut self) {
        let keys = self.keys.read().unwrap_or_else(PoisonError::into_inner);
        self.repeats.retain(|peer| keys.contains_key(peer));
        for (&peer, &key) in keys.iter().filter(|(peer, _)| matches!(peer, Peer::Node(_))) {
            if let Some(stats) = self.net.stats(key) {
                self.repeats.count(peer, &stats);
            }
        }
    }

    /// Sends waiting messages of programs, as far as there is room. Returns whether to try again soon.
    fn send_programs(&mut self) -> bool {
        let Self { connections, net, sent, .. } = self;
        connections.send_waiting(|link, frame, delivery| {
            match delivery {
                Delivery::Datagram if net.datagrams_waiting(link) > PROGRAM_DATAGRAMS_WAITING => {
                    return Sent::Dropped;
                }
                Delivery::Datagram => {
                    let _ = net.send_datagram(link, frame.to_vec());
                }
                Delivery::Message => {
                    if let Err(SendError::Full { .. }) = net.send(link, crate::net::Lane::Program, frame) {
                        return Sent::Waits;
                    }
                }
            }
            sent.count(protocol::Subject::Programs, frame.len());
            Sent::Done
        })
    }

    /// Returns whether a peer is a client or a participant, whose process belongs to its user.
    fn is_player(&self, peer: Peer) -> bool {
        let who = self.key(peer).and_then(|key| self.names.get(&key));
        who.is_some_and(|who| who.client().is_some())
    }

    /// Returns how many bytes wait for players. Most of them are worlds.
    fn worlds_waiting(&self) -> usize {
        let of = |(&peer, waiting): (&Peer, &Waiting)| if self.is_player(peer) { waiting.bytes } else { 0 };
        self.waiting.iter().map(of).sum()
    }

    /// Lets a client's greeting wait while much already waits for players, since the answer to it is the
    /// world. Of several greetings of one client the last counts.
    fn in_turn(&mut self, key: PeerKey, who: PeerName, event: LinkEvent, now: Instant) -> Vec<LinkEvent> {
        let is_greeting = matches!(event, LinkEvent::Message { message: Message::Hello(_), .. });
        if !self.is_server || !is_greeting || !matches!(who, PeerName::Client(_) | PeerName::Builder(_)) {
            return vec![event];
        }
        if let Some(greeting) = self.greetings.iter_mut().find(|greeting| greeting.key == key) {
            greeting.event = event;
        } else if self.greetings.is_empty() && self.worlds_waiting() < self.worlds_bytes {
            return vec![event];
        } else {
            self.greetings.push_back(Greeting { key, since: now, event });
        }
        Vec::new()
    }

    /// Takes the greeting that has waited longest, if there is room by now for the world that answers it, or
    /// if it has waited for too long.
    pub(super) fn next_greeting(&mut self, now: Instant) -> Option<LinkEvent> {
        let Self { greetings, names, .. } = self;
        greetings.retain(|greeting| names.contains_key(&greeting.key));
        let waits_long = now.saturating_duration_since(self.greetings.front()?.since) >= LONGEST_WAIT;
        if !waits_long && self.worlds_waiting() >= self.worlds_bytes {
            return None;
        }
        self.greetings.pop_front().map(|greeting| greeting.event)
    }

    /// Takes the events of links that ended here, for this process's own state machines.
    pub(super) fn take_given_up(&mut self) -> Vec<LinkEvent> {
        let given_up = std::mem::take(&mut self.given_up);
        for event in &given_up {
            if let LinkEvent::Disconnected { peer, .. } = event {
                // Drops messages that were queued after the link had ended.
                self.waiting.remove(peer);
            }
        }
        given_up
    }

    fn give_up(&mut self, peer: Peer) {
        warn!(?peer, "a peer reads too slowly and is disconnected");
        let who = self.key(peer).and_then(|key| self.names.get(&key));
        let peers = who.map_or_else(|| vec![peer], |&who| self.peers_of(who));
        for &peer in &peers {
            self.cut(peer, Ending::TooSlow, Ending::TooSlow.words());
        }
        let gone = gone(peers, Some(Ending::TooSlow), Ending::TooSlow.words());
        self.given_up.extend(gone);
    }

    /// Returns how many bytes may wait for a peer.
    fn room_for(&self, peer: Peer) -> usize {
        let who = self.key(peer).and_then(|key| self.names.get(&key));
        let is_client =
            matches!((peer, who), (Peer::Client(_), None)) || who.is_some_and(|who| who.is_client_only());
        match self.told.get(&peer) {
            None if is_client => 0,
            Some(Told::Changes) if is_client => CHANGES_BYTES.min(self.world_bytes),
            _ => self.world_bytes,
        }
    }

    /// Ends a link after what was sent has arrived.
    pub(super) fn end(&mut self, peer: Peer, ending: Ending) {
        self.close(peer, ending, ending.words());
    }

    /// Ends a link after what was sent has arrived, with the caller's text. The end of other peers behind the
    /// link is reported to this process's own state machines: a participant is gone both as a node and as a
    /// client.
    pub(super) fn close(&mut self, peer: Peer, ending: Ending, words: &str) {
        let who = self.key(peer).and_then(|key| self.names.get(&key).copied());
        let mut others = who.map(|who| self.peers_of(who)).unwrap_or_default();
        others.retain(|&other| other != peer);
        self.cut(peer, ending, words);
        self.given_up.extend(gone(others, Some(ending), words));
    }

    /// Does the same without such a report.
    fn cut(&mut self, peer: Peer, ending: Ending, words: &str) {
        self.waiting.remove(&peer);
        self.told.remove(&peer);
        let key = self.keys_mut().remove(&peer);
        if let Some(key) = key {
            self.names.remove(&key);
            self.keys_mut().retain(|_, other| *other != key);
            self.send_programs();
            let reason = Reason::new(ending.cause(), words);
            match ending {
                Ending::TooSlow => self.connections.lost(key, reason),
                _ => self.connections.gone(key, reason),
            }
            self.net.close(key, ending.code(), words);
        }
    }

    /// Ends all links.
    pub(super) fn shutdown(mut self) -> NetTotals {
        for _ in 0..100 {
            if !self.flush(Instant::now()) {
                break;
            }
            std::thread::yield_now();
        }
        let totals = self.net.totals();
        self.net.shutdown();
        totals
    }

    /// Translates a network event into link events.
    pub(super) fn translate(&mut self, event: NetEvent) -> Vec<LinkEvent> {
        let is_datagram = matches!(event, NetEvent::Datagram { .. });
        match event {
            NetEvent::Connected { peer: key, who, addr } => {
                self.dialled.remove(&key);
                self.connections.linked(key, who, addr);
                self.names.insert(key, who);
                let peers = self.peers_of(who);
                for &peer in &peers {
                    let former = self.keys_mut().insert(peer, key);
                    if let Some(former) = former {
                        // Messages that wait were meant for the former link, over which some were lost. A
                        // peer that is back is told everything anew.
                        self.waiting.remove(&peer);
                        self.told.remove(&peer);
                        self.names.remove(&former);
                        self.net.close(former, Ending::Superseded.code(), Ending::Superseded.words());
                    }
                }
                self.flush(Instant::now());
                peers.into_iter().map(|peer| LinkEvent::Connected(peer, who)).collect()
            }
            NetEvent::ConnectFailed { peer: key, error } => {
                let Some(peer) = self.dialled.remove(&key) else { return Vec::new() };
                // The peer was forgotten and came back: another attempt is under way, or has made a link, and
                // its outcome counts.
                if self.key(peer).is_some() || self.dialled.values().any(|other| *other == peer) {
                    return Vec::new();
                }
                self.waiting.remove(&peer);
                match &error {
                    NetError::Refused { code, reason, .. } if Ending::of(*code).is_some() => {
                        gone(vec![peer], Ending::of(*code), reason)
                    }
                    _ => vec![LinkEvent::Disconnected {
                        peer,
                        ending: None,
                        is_unanswered: matches!(
                            error,
                            NetError::Unreachable { .. } | NetError::Broken { .. }
                        ),
                        text: error.to_string(),
                    }],
                }
            }
            NetEvent::Frame { peer: key, bytes, .. } | NetEvent::Datagram { peer: key, bytes } => {
                let Some(&who) = self.names.get(&key) else { return Vec::new() };
                let message = protocol::decode(&bytes);
                if let Ok(message) = &message {
                    self.received.count(message.subject(), bytes.len());
                }
                let heard = match message {
                    Ok(message) if is_datagram && !may_overtake(&message) => Err((
                        Ending::BrokeRule,
                        "a message that keeps its place among others came in a datagram".to_owned(),
                    )),
                    Ok(Message::Program(program)) => match self.connections.heard(key, program) {
                        Ok(()) => return Vec::new(),
                        Err(rule) => Err((Ending::BrokeRule, rule.to_owned())),
                    },
                    Ok(message) if speaks_for_another(who, &message) => Err((
                        Ending::BrokeRule,
                        "a node's greeting names a client that is not its own".to_owned(),
                    )),
                    Ok(message) => Ok(message),
                    Err(error @ CodecError::Version { .. }) => Err((Ending::Refused, error.to_string())),
                    Err(error) => Err((Ending::BrokeRule, error.to_string())),
                };
                match heard {
                    Ok(message) => {
                        let event = LinkEvent::Message { from: self.sender(who, &message), message };
                        self.in_turn(key, who, event, Instant::now())
                    }
                    Err((ending, error)) => {
                        self.malformed += 1;
                        warn!(?who, error, "a peer sent what it may not and is disconnected");
                        let peers = self.peers_of(who);
                        for &peer in &peers {
                            self.cut(peer, ending, &error);
                        }
                        gone(peers, Some(ending), &error)
                    }
                }
            }
            NetEvent::Closed { peer: key, who, cause, reason } => {
                if self.names.remove(&key).is_none() {
                    return Vec::new();
                }
                let (ending, meant) = match cause {
                    CloseCause::ByPeer(CloseCode::DONE) => (None, Cause::Left),
                    CloseCause::ByPeer(code) => {
                        let ending = Ending::of(code);
                        (ending, ending.map_or(Cause::Refused, Ending::cause))
                    }
                    CloseCause::Forgotten | CloseCause::TimedOut => (None, Cause::Broken),
                    CloseCause::ByUs | CloseCause::Violation => (None, Cause::Refused),
                };
                let meant = Reason::new(meant, reason.clone());
                // A peer that dials again comes back. The server is dialled again, until it is given up.
                match cause == CloseCause::TimedOut
                    || ending == Some(Ending::TooSlow)
                    || who == PeerName::Server
                {
                    true => self.connections.lost(key, meant),
                    false => self.connections.gone(key, meant),
                }
                let mut peers = self.peers_of(who);
                peers.retain(|&peer| self.key(peer) == Some(key));
                for peer in &peers {
                    self.keys_mut().remove(peer);
                    self.waiting.remove(peer);
                    self.told.remove(peer);
                }
                gone(peers, ending, &reason)
            }
        }
    }

    /// Bars a process that has joined: it may come back by a new token only, and is told the reason.
    pub(super) fn bar(&self, who: PeerName, reason: String) {
        self.net.bar(who, reason);
    }

    fn send_frame(&mut self, to: Peer, lane: crate::net::Lane, bytes: Vec<u8>) {
        let order_kept = !self.waiting.contains_key(&to);
        if order_kept && let Some(key) = self.key(to) {
            match self.net.send(key, lane, &bytes) {
                Ok(()) => return,
                Err(SendError::Full { .. }) => {}
                Err(error @ SendError::FrameTooLong { .. }) => {
                    warn!(?to, %error, "a frame is lost");
                    return;
                }
                Err(error) => {
                    debug!(?to, %error, "a frame is not sent");
                    return;
                }
            }
        } else if order_kept && self.is_server {
            // The server only answers. Other processes may still be dialled by the peer, so their messages
            // wait for that.
            debug!(?to, "no link to send over");
            return;
        }
        let room = self.room_for(to);
        let waiting = self.waiting.entry(to).or_default();
        waiting.bytes += bytes.len();
        waiting.frames.push_back((lane, bytes));
        if waiting.bytes > room {
            self.give_up(to);
        }
    }

    fn peers_of(&self, who: PeerName) -> Vec<Peer> {
        match who {
            PeerName::Server => vec![Peer::Server],
            PeerName::Node(node) => vec![Peer::Node(node)],
            PeerName::Client(client) | PeerName::Builder(client) => vec![Peer::Client(client)],
            PeerName::Participant(node, client) if self.is_server => {
                vec![Peer::Node(node), Peer::Client(client)]
            }
            PeerName::Participant(node, _) => vec![Peer::Node(node)],
        }
    }

    /// Returns the sender of a message. A participant sends to the server both as node and as client, over
    /// one link.
    fn sender(&self, who: PeerName, message: &Message) -> Peer {
        let node = |node: NodeId| Peer::Node(node);
        let is_own = |client: ClientId| {
            matches!(message, Message::FromClient(other, _) if *other == client)
                || matches!(message, Message::Hello(hello) if matches!(hello.role, JoinAs::Client { .. }))
        };
        match who {
            PeerName::Server => Peer::Server,
            PeerName::Node(id) => node(id),
            PeerName::Client(client) | PeerName::Builder(client) => Peer::Client(client),
            PeerName::Participant(_, client) if self.is_server && is_own(client) => Peer::Client(client),
            PeerName::Participant(id, _) => node(id),
        }
    }
}

/// Returns whether a node's greeting names a client that its certificate does not name. All that this client
/// asked would be believed of the node.
fn speaks_for_another(who: PeerName, message: &Message) -> bool {
    let Message::Hello(Hello { role: JoinAs::Node { client, .. }, .. }) = message else { return false };
    who.node().is_some() && *client != who.client()
}

/// Returns whether a message may come in a datagram, before messages that were sent earlier.
fn may_overtake(message: &Message) -> bool {
    message.lane() == Lane::State || is_awaited(message)
}

/// Returns the events of a link's end for the peers behind it.
fn gone(peers: Vec<Peer>, ending: Option<Ending>, text: &str) -> Vec<LinkEvent> {
    let event = |peer| LinkEvent::Disconnected { peer, ending, is_unanswered: false, text: text.to_owned() };
    peers.into_iter().map(event).collect()
}

#[cfg(test)]
mod tests;
