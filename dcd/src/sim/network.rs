//! Simulates links that behave like QUIC over a lossy path, in virtual time.
//!
//! - Reliable lanes stay in order and repair loss by sending again. Datagrams do not.
//! - An end that hears nothing for the idle time-out drops the link. The other end learns this by a reset or
//!   by its own time-out.
//! - The bytes that a reader has not read are bounded.
//!
//! Keep-alives are not simulated one by one: an end *hears* the other as long as packets could pass. Only
//! when that ends, by a cut, a stop or a death, does its time-out begin. Congestion is not simulated: paths
//! are as wide as they need be.

mod conditions;
mod life;
mod link;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use self::link::{Frame, LANES, Link, Side, State, index};
use super::Random;
use crate::cluster::{Peer, PhysicsEvent};
use crate::protocol::Lane;
use crate::protocol::link::{HANDSHAKE_TIMEOUT, KEEP_ALIVE};
use crate::space::NodeId;

pub use conditions::{Bounds, Cut, NetworkConditions, Path, Who};
pub(super) use link::LinkId;

/// The longest time before an end acknowledges a packet.
const ACK_DELAY: Duration = Duration::from_millis(25);
/// The payload of one packet.
const PACKET_BYTES: usize = 1_200;

/// What arrives at a process: an event of a link, a message, or an answer of the physics.
#[derive(Clone, Debug)]
pub(super) enum Arrival {
    Connected(Peer),
    Disconnected(Peer),
    /// A call was not answered.
    Unanswered(Peer),
    /// The bytes of a message, and whether they came as a datagram.
    Frame(Peer, Vec<u8>, bool),
    Physics(Box<PhysicsEvent>),
}

/// An arrival with its receiver and its link.
#[derive(Clone, Debug)]
pub(super) struct Delivery {
    pub(super) to: Peer,
    pub(super) link: Option<LinkId>,
    pub(super) arrival: Arrival,
}

#[derive(Clone, Debug)]
enum Event {
    /// The dialler sends its first packet. The number counts attempts.
    Dial(LinkId, u32),
    /// The handshake is complete at the listener.
    Listen(LinkId, u32),
    /// The handshake is complete at the dialler.
    Open(LinkId),
    GiveUp(LinkId),
    /// Packets of a frame arrive: sender's side, lane, number of the frame, number of packets.
    Packets(LinkId, Side, usize, u64, u64),
    Resend(LinkId, Side, usize, u64),
    Datagram(LinkId, Side, Vec<u8>),
    /// The end has heard nothing since this time.
    Idle(LinkId, Side, Duration),
    /// The end hears the other again.
    Hears(LinkId, Side),
    /// The end sends a keep-alive to the other end, which is gone.
    Probe(LinkId, Side),
    /// The message that the other end has closed arrives at this end.
    Closed(LinkId, Side),
    Linger(LinkId, Side),
    Healed,
    Physics(NodeId, Box<PhysicsEvent>),
}

/// Statistics of the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// The number of frames and datagrams sent.
    pub messages: u64,
    /// The number of bytes in them.
    pub bytes: u64,
    /// The number of datagrams that did not arrive.
    pub datagrams_lost: u64,
    /// The number of times that packets of a frame were sent again.
    pub resent: u64,
    /// The number of links that broke because a reader did not read.
    pub overflows: u64,
    /// The most bytes that a sender kept for a server or node.
    pub most_queued: usize,
    /// The most bytes that a sender kept for a client.
    pub most_queued_for_client: usize,
    /// The most bytes that waited for a link to be opened.
    pub most_waiting: usize,
}

impl std::ops::AddAssign for Traffic {
    /// Adds up sums, and takes the larger of maxima.
    fn add_assign(&mut self, other: Self) {
        self.messages += other.messages;
        self.bytes += other.bytes;
        self.datagrams_lost += other.datagrams_lost;
        self.resent += other.resent;
        self.overflows += other.overflows;
        self.most_queued = self.most_queued.max(other.most_queued);
        self.most_queued_for_client = self.most_queued_for_client.max(other.most_queued_for_client);
        self.most_waiting = self.most_waiting.max(other.most_waiting);
    }
}

#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) conditions: NetworkConditions,
    bounds: Bounds,
    random: Random,
    queue: BTreeMap<(Duration, u64), Event>,
    pushed: u64,
    /// Live processes, each with the time at which it was stopped, if it is stopped.
    alive: BTreeMap<Peer, Option<Duration>>,
    links: BTreeMap<LinkId, Link>,
    last_link: u64,
    /// The newest open link, by own end and other end.
    current: BTreeMap<(Peer, Peer), LinkId>,
    /// Messages sent before the link was up.
    waiting: BTreeMap<(Peer, Peer), Waiting>,
    /// Links that a process has closed itself. It hears nothing more of them.
    hung_up: BTreeSet<(Peer, LinkId)>,
    /// The datagrams that each process has not read, bytes.
    datagrams: BTreeMap<Peer, usize>,
    cuts: Vec<Cut>,
    ready: VecDeque<Delivery>,
    traffic: Traffic,
}

#[derive(Clone, Debug, Default)]
struct Waiting {
    frames: Vec<(Lane, Vec<u8>)>,
    bytes: usize,
}

impl Network {
    pub(super) fn new(conditions: NetworkConditions, bounds: Bounds, seed: u64) -> Self {
        Self {
            conditions,
            bounds,
            random: Random::new(seed),
            queue: BTreeMap::new(),
            pushed: 0,
            alive: BTreeMap::new(),
            links: BTreeMap::new(),
            last_link: 0,
            current: BTreeMap::new(),
            waiting: BTreeMap::new(),
            hung_up: BTreeSet::new(),
            datagrams: BTreeMap::new(),
            cuts: Vec::new(),
            ready: VecDeque::new(),
            traffic: Traffic::default(),
        }
    }

    /// Returns when the next event happens.
    pub(super) fn next_time(&self) -> Option<Duration> {
        self.queue.keys().next().map(|&(time, _)| time)
    }

    /// Executes the next event.
    pub(super) fn step(&mut self) {
        let Some(((now, _), event)) = self.queue.pop_first() else { return };
        match event {
            Event::Packets(id, sender, lane, number, count) => {
                self.packets(now, id, sender, lane, number, count)
            }
            Event::Datagram(id, sender, bytes) => self.datagram(now, id, sender, bytes),
            Event::Physics(node, event) => {
                let arrival = Arrival::Physics(event);
                self.ready.push_back(Delivery { to: Peer::Node(node), link: None, arrival });
            }
            Event::Resend(id, sender, lane, number) => self.resend(now, id, sender, lane, number),
            event => self.live(now, event),
        }
    }

    /// Returns the next arrival at a process.
    pub(super) fn take(&mut self) -> Option<Delivery> {
        self.ready.pop_front()
    }

    pub(super) fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Schedules an answer of a node's physics.
    pub(super) fn physics(&mut self, time: Duration, node: NodeId, event: PhysicsEvent) {
        self.push(time, Event::Physics(node, Box::new(event)));
    }

    /// Starts a process, perhaps once more.
    pub(super) fn start(&mut self, now: Duration, who: Peer) {
        self.alive.insert(who, None);
        self.recall(now, who);
    }

    /// Dials another process, which answers if it is there.
    pub(super) fn dial(&mut self, now: Duration, from: Peer, to: Peer) {
        self.last_link += 1;
        let id = LinkId(self.last_link);
        self.links.insert(id, Link::new(from, to));
        self.push(now, Event::Dial(id, 0));
        self.push(now + HANDSHAKE_TIMEOUT, Event::GiveUp(id));
    }

    /// Sends a message, now or when the link is up. The server only answers calls, so it waits for no link.
    pub(super) fn send(&mut self, now: Duration, from: Peer, to: Peer, lane: Lane, bytes: Vec<u8>) {
        self.traffic.messages += 1;
        self.traffic.bytes += bytes.len() as u64;
        match (self.current.get(&(from, to)).copied(), index(lane)) {
            (Some(id), Some(lane)) => self.send_frame(now, id, from, lane, bytes),
            (Some(id), None) => self.send_datagram(now, id, from, to, bytes),
            (None, None) => self.traffic.datagrams_lost += 1,
            (None, Some(_)) if from == Peer::Server => {}
            (None, Some(_)) => {
                let waiting = self.waiting.entry((from, to)).or_default();
                waiting.bytes += bytes.len();
                waiting.frames.push((lane, bytes));
                self.traffic.most_waiting = self.traffic.most_waiting.max(waiting.bytes);
            }
        }
    }

    /// Notes that a process has read or discarded an arrival, which makes room for more.
    pub(super) fn read(&mut self, Delivery { to, link, arrival }: &Delivery) {
        let (Some(link), Arrival::Frame(_, bytes, datagram)) = (link, arrival) else { return };
        if *datagram {
            let unread = self.datagrams.entry(*to).or_default();
            *unread = unread.saturating_sub(bytes.len());
        } else if let Some(link) = self.links.get_mut(link) {
            let sender = link.side_of(*to).other();
            let end = link.end_mut(sender);
            end.unread = end.unread.saturating_sub(bytes.len());
        }
    }

    /// Returns whether a process still accepts arrivals over this link.
    pub(super) fn is_heard(&self, reader: Peer, link: LinkId) -> bool {
        self.hung_up.is_empty() || !self.hung_up.contains(&(reader, link))
    }

    /// Returns whether a process's newest link to another process is open at both ends.
    pub(super) fn is_linked(&self, own: Peer, other: Peer) -> bool {
        let link = self.current.get(&(own, other)).and_then(|id| self.links.get(id));
        link.is_some_and(|link| Side::BOTH.into_iter().all(|side| link.is_open(side)))
    }

    /// Returns whether packets pass from one process to another.
    pub(super) fn passes(&self, now: Duration, from: Peer, to: Peer) -> bool {
        self.cuts.is_empty() || !self.cuts.iter().any(|cut| now < cut.until && cut.stops(from, to))
    }

    fn push(&mut self, time: Duration, event: Event) {
        self.pushed += 1;
        self.queue.insert((time, self.pushed), event);
    }

    fn delay(&mut self, from: Peer, to: Peer) -> Duration {
        let path = self.conditions.path(from, to);
        let mut delay = path.draw(&mut self.random);
        if self.random.chance(self.conditions.reorder) {
            delay += self.conditions.detour;
        }
        delay
    }

    /// Returns the time after which a packet without an acknowledgement is sent again: a round trip and some,
    /// doubled each time, but no longer than until a keep-alive's acknowledgement reveals the loss.
    fn patience(&self, from: Peer, to: Peer, retries: u32, keep_alive: Duration) -> Duration {
        let trip =
            self.conditions.path(from, to).longest() + self.conditions.path(to, from).longest() + ACK_DELAY;
        (trip * (1 << retries.min(8))).min(trip.max(keep_alive))
    }

    fn send_frame(&mut self, now: Duration, id: LinkId, from: Peer, lane: usize, bytes: Vec<u8>) {
        let Some(link) = self.links.get_mut(&id) else { return };
        let side = link.side_of(from);
        let to = link.end(side.other()).who;
        let end = link.end_mut(side);
        let queued = (end.unread + bytes.len()).saturating_sub(self.bounds.inbox_bytes);
        if queued > self.bounds.queue_for(to) && end.unread > 0 {
            return self.overflow(now, id, side);
        }
        let most = match to {
            Peer::Client(_) => &mut self.traffic.most_queued_for_client,
            Peer::Server | Peer::Node(_) => &mut self.traffic.most_queued,
        };
        *most = queued.max(*most);
        end.unread += bytes.len();
        let missing = 1 + bytes.len() as u64 / PACKET_BYTES as u64;
        let number = end.push(lane, Frame { bytes, missing, retries: 0 });
        self.transmit(now, id, side, lane, number);
        self.probe_by_sending(now, id, side);
    }

    /// Sends the packets of a frame that the other end lacks. Lost packets are sent again later.
    fn transmit(&mut self, now: Duration, id: LinkId, side: Side, lane: usize, number: u64) {
        let Some(link) = self.links.get_mut(&id) else { return };
        let to = link.end(side.other()).who;
        let end = link.end_mut(side);
        let from = end.who;
        let Some(&mut Frame { missing, retries, .. }) = end.frame(lane, number) else { return };
        let keep_alive = link.keep_alive();
        let loss = self.conditions.loss;
        let lost = match self.passes(now, from, to) {
            false => missing,
            true if loss == 0.0 => 0,
            true => (0..missing).filter(|_| self.random.chance(loss)).count() as u64,
        };
        if lost < missing {
            let delay = self.delay(from, to);
            self.push(now + delay, Event::Packets(id, side, lane, number, missing - lost));
        }
        if lost > 0 {
            let again = now + self.patience(from, to, retries, keep_alive);
            self.push(again, Event::Resend(id, side, lane, number));
        }
    }

    fn resend(&mut self, now: Duration, id: LinkId, side: Side, lane: usize, number: u64) {
        let Some(link) = self.links.get_mut(&id) else { return };
        let end = link.end_mut(side);
        if end.state != State::Open && !end.lingers {
            return;
        }
        let who = end.who;
        let Some(frame) = end.frame(lane, number).filter(|frame| frame.missing > 0) else { return };
        frame.retries += 1;
        if self.is_stopped(who) {
            self.push(now + KEEP_ALIVE, Event::Resend(id, side, lane, number));
        } else {
            self.traffic.resent += 1;
            self.transmit(now, id, side, lane, number);
        }
    }

    fn packets(&mut self, now: Duration, id: LinkId, side: Side, lane: usize, number: u64, count: u64) {
        let Some(link) = self.links.get(&id) else { return };
        let (from, to, keep_alive) = (link.end(side).who, link.end(side.other()).who, link.keep_alive());
        if self.passes(now, from, to) {
            let frame = self.links.get_mut(&id).and_then(|link| link.end_mut(side).frame(lane, number));
            let Some(frame) = frame else { return };
            frame.missing = frame.missing.saturating_sub(count);
            self.hear(now, id, side.other());
            self.give(now, id, side);
        } else {
            let again = now + self.patience(from, to, 0, keep_alive);
            self.push(again, Event::Resend(id, side, lane, number));
        }
    }

    /// Gives the reader the frames from this end that have arrived in order.
    fn give(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get_mut(&id) else { return };
        if !link.is_open(side.other()) {
            return;
        }
        let to = link.end(side.other()).who;
        let end = link.end_mut(side);
        for lane in 0..LANES {
            while let Some(bytes) = end.next(lane) {
                let arrival = Arrival::Frame(end.who, bytes, false);
                self.ready.push_back(Delivery { to, link: Some(id), arrival });
            }
        }
        if end.lingers && end.is_empty() {
            end.lingers = false;
            self.tell_closed(now, id, side.other());
        }
    }

    fn send_datagram(&mut self, now: Duration, id: LinkId, from: Peer, to: Peer, bytes: Vec<u8>) {
        let Some(side) = self.links.get(&id).map(|link| link.side_of(from)) else { return };
        self.probe_by_sending(now, id, side);
        if !self.passes(now, from, to) || self.random.chance(self.conditions.loss) {
            self.traffic.datagrams_lost += 1;
            return;
        }
        if self.random.chance(self.conditions.duplicate) {
            let again = now + self.delay(from, to);
            self.push(again, Event::Datagram(id, side, bytes.clone()));
        }
        let time = now + self.delay(from, to);
        self.push(time, Event::Datagram(id, side, bytes));
    }

    fn datagram(&mut self, now: Duration, id: LinkId, side: Side, bytes: Vec<u8>) {
        let Some(link) = self.links.get(&id) else { return };
        let (from, to) = (link.end(side).who, link.end(side.other()).who);
        let unread = self.datagrams.entry(to).or_default();
        let has_room = *unread + bytes.len() <= self.bounds.datagram_bytes;
        if !link.is_open(side.other()) || !has_room || !self.passes(now, from, to) {
            self.traffic.datagrams_lost += 1;
            return;
        }
        *self.datagrams.entry(to).or_default() += bytes.len();
        self.hear(now, id, side.other());
        self.ready.push_back(Delivery { to, link: Some(id), arrival: Arrival::Frame(from, bytes, true) });
    }
}
