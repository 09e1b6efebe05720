//! Links by the names of the cluster: encodes, decodes, chooses lanes, and keeps what must wait for a link.

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;

use tracing::{debug, warn};

use crate::cluster::Peer;
use crate::net::{Net, NetEvent, NetTotals, PeerKey, PeerName, SendError};
use crate::protocol::{self, Lane, Message, Role, ToClient};
use crate::space::{ClientId, NodeId};

/// What may wait for a link that is being made, or for a peer that still reads a world, in bytes. Beyond it the peer is
/// given up: it can join anew.
const WAITING_BYTES: usize = 256 << 20;

/// Bytes of states that may wait on a link that a guess is to be sent over.
const GUESSES_WAITING: usize = 8 << 10;

/// Why a link ends when its peer calls again: it came back before the former link was found dead, or is there twice.
pub(super) const SUPERSEDED: &str = "a newer link of the same peer took its place";

/// Why a link ends when the world does.
pub(super) const ENDED: &str = "the world has ended";

/// Why a link ends that the server does not want any more.
pub(super) const THE_END: &str = "the server ends the link";

/// What happens on links, in the cluster's words.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "an event lives for one call")]
pub(super) enum LinkEvent {
    /// A link is up.
    Connected(Peer),
    /// A link is gone, or could not be made; why.
    Disconnected(Peer, String),
    /// A message that could be read and is allowed to be.
    Message { from: Peer, message: Message },
}

/// All links of a process.
pub(super) struct Links {
    net: Net,
    keys: BTreeMap<Peer, PeerKey>,
    names: BTreeMap<PeerKey, PeerName>,
    dialled: BTreeMap<PeerKey, Peer>,
    waiting: BTreeMap<Peer, Waiting>,
    /// Whether a participant is spoken to as a client too: only the server does.
    is_server: bool,
}

#[derive(Default)]
struct Waiting {
    frames: VecDeque<(crate::net::Lane, Vec<u8>)>,
    bytes: usize,
}

impl Links {
    pub(super) fn new(net: Net) -> Self {
        let is_server = net.who() == PeerName::Server;
        Self {
            net,
            keys: BTreeMap::new(),
            names: BTreeMap::new(),
            dialled: BTreeMap::new(),
            waiting: BTreeMap::new(),
            is_server,
        }
    }

    pub(super) fn totals(&self) -> NetTotals {
        self.net.totals()
    }

    /// Makes a link; the answer comes as an event.
    pub(super) fn dial(&mut self, peer: Peer, addr: SocketAddr) {
        let expected = match peer {
            Peer::Server => PeerName::Server,
            Peer::Node(node) => PeerName::Node(node),
            Peer::Client(client) => PeerName::Client(client),
        };
        let key = self.net.connect(addr, expected);
        self.dialled.insert(key, peer);
    }

    /// Sends, now or when the link is there and has room.
    pub(super) fn send(&mut self, to: Peer, message: &Message) {
        let bytes = protocol::encode(message);
        let lane = match message.lane() {
            Lane::State => {
                let key = self.keys.get(&to).copied();
                // A guess that waits is worth nothing when it arrives, and what counts waits behind it.
                let is_guess = matches!(message, Message::ToClient(_, ToClient::States { stamp, .. }) if stamp.provisional);
                if is_guess && key.is_some_and(|key| self.net.datagrams_waiting(key) > GUESSES_WAITING) {
                    return;
                }
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
            Lane::Control if matches!(message, Message::ToClient(..) | Message::FromClient(..)) => {
                crate::net::Lane::Client
            }
            Lane::Control => crate::net::Lane::Admin,
            Lane::Border => crate::net::Lane::Object,
        };
        self.send_frame(to, lane, bytes);
    }

    /// Sends what waits, as far as there is room. Returns whether anything still waits for a link that is up.
    pub(super) fn flush(&mut self) -> bool {
        let peers: Vec<_> =
            self.waiting.keys().filter(|peer| self.keys.contains_key(peer)).copied().collect();
        let mut left = false;
        for peer in peers {
            let Some(mut waiting) = self.waiting.remove(&peer) else { continue };
            let key = self.keys[&peer];
            while let Some((lane, frame)) = waiting.frames.pop_front() {
                match self.net.send(key, lane, &frame) {
                    Err(SendError::Full { .. }) => {
                        waiting.frames.push_front((lane, frame));
                        break;
                    }
                    Err(error) => debug!(?peer, %error, "a frame is not sent"),
                    Ok(()) => waiting.bytes -= frame.len(),
                }
            }
            if !waiting.frames.is_empty() {
                left = true;
                self.waiting.insert(peer, waiting);
            }
        }
        left
    }

    /// Ends a link after what was sent has arrived.
    pub(super) fn close(&mut self, peer: Peer, reason: &str) {
        self.waiting.remove(&peer);
        if let Some(key) = self.keys.remove(&peer) {
            self.names.remove(&key);
            self.keys.retain(|_, other| *other != key);
            self.net.close(key, reason);
        }
    }

    /// Ends all links.
    pub(super) fn shutdown(mut self) -> NetTotals {
        for _ in 0..100 {
            if !self.flush() {
                break;
            }
            std::thread::yield_now();
        }
        let totals = self.net.totals();
        self.net.shutdown();
        totals
    }

    /// What a network event means.
    pub(super) fn translate(&mut self, event: NetEvent) -> Vec<LinkEvent> {
        match event {
            NetEvent::Connected { peer: key, who, .. } => {
                self.dialled.remove(&key);
                self.names.insert(key, who);
                let peers = self.peers_of(who);
                for &peer in &peers {
                    if let Some(former) = self.keys.insert(peer, key) {
                        self.names.remove(&former);
                        self.net.close(former, SUPERSEDED);
                    }
                }
                self.flush();
                peers.into_iter().map(LinkEvent::Connected).collect()
            }
            NetEvent::ConnectFailed { peer: key, error } => {
                let Some(peer) = self.dialled.remove(&key) else { return Vec::new() };
                self.waiting.remove(&peer);
                vec![LinkEvent::Disconnected(peer, error.to_string())]
            }
            NetEvent::Frame { peer: key, bytes, .. } | NetEvent::Datagram { peer: key, bytes } => {
                let Some(&who) = self.names.get(&key) else { return Vec::new() };
                match protocol::decode(&bytes) {
                    Ok(message) => vec![LinkEvent::Message { from: self.sender(who, &message), message }],
                    Err(error) => {
                        warn!(?who, %error, "a peer sent what cannot be read and is disconnected");
                        let peers = self.peers_of(who);
                        for &peer in &peers {
                            self.close(peer, &error.to_string());
                        }
                        self.gone(peers, &error.to_string())
                    }
                }
            }
            NetEvent::Closed { peer: key, who, reason, .. } => {
                if self.names.remove(&key).is_none() {
                    return Vec::new();
                }
                let mut peers = self.peers_of(who);
                peers.retain(|peer| self.keys.get(peer) == Some(&key));
                for peer in &peers {
                    self.keys.remove(peer);
                    self.waiting.remove(peer);
                }
                self.gone(peers, &reason)
            }
        }
    }

    fn gone(&self, peers: Vec<Peer>, reason: &str) -> Vec<LinkEvent> {
        peers.into_iter().map(|peer| LinkEvent::Disconnected(peer, reason.to_owned())).collect()
    }

    fn send_frame(&mut self, to: Peer, lane: crate::net::Lane, bytes: Vec<u8>) {
        let order_kept = !self.waiting.contains_key(&to);
        if order_kept && let Some(&key) = self.keys.get(&to) {
            match self.net.send(key, lane, &bytes) {
                Ok(()) => return,
                Err(SendError::Full { .. }) => {}
                Err(error) => {
                    debug!(?to, %error, "a frame is not sent");
                    return;
                }
            }
        } else if order_kept && self.is_server {
            // The server answers links; others may be dialled by whom they speak to, and wait for that.
            debug!(?to, "no link to send over");
            return;
        }
        let waiting = self.waiting.entry(to).or_default();
        waiting.bytes += bytes.len();
        waiting.frames.push_back((lane, bytes));
        if waiting.bytes > WAITING_BYTES {
            warn!(?to, "a peer reads too slowly and is disconnected");
            self.close(to, "reads too slowly; join anew");
        }
    }

    fn peers_of(&self, who: PeerName) -> Vec<Peer> {
        match who {
            PeerName::Server => vec![Peer::Server],
            PeerName::Node(node) => vec![Peer::Node(node)],
            PeerName::Client(client) => vec![Peer::Client(client)],
            PeerName::Participant(node, client) if self.is_server => {
                vec![Peer::Node(node), Peer::Client(client)]
            }
            PeerName::Participant(node, _) => vec![Peer::Node(node)],
        }
    }

    /// A participant speaks to the server with two voices over one link.
    fn sender(&self, who: PeerName, message: &Message) -> Peer {
        let node = |node: NodeId| Peer::Node(node);
        let is_own = |client: ClientId| {
            matches!(message, Message::FromClient(other, _) if *other == client)
                || matches!(message, Message::Hello(hello) if hello.role == Role::Client)
        };
        match who {
            PeerName::Server => Peer::Server,
            PeerName::Node(id) => node(id),
            PeerName::Client(client) => Peer::Client(client),
            PeerName::Participant(_, client) if self.is_server && is_own(client) => Peer::Client(client),
            PeerName::Participant(id, _) => node(id),
        }
    }
}
