//! Links with seeded delays: ordered within a lane, unordered across lanes, cut by crashes.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::Random;
use crate::cluster::{Peer, PhysicsEvent};
use crate::protocol::Lane;
use crate::space::NodeId;

/// Something that will happen to a process.
#[derive(Clone, Debug)]
pub(super) enum Arrival {
    Connected(Peer),
    Disconnected(Peer),
    /// The bytes of a message.
    Frame(Peer, Vec<u8>),
    Physics(PhysicsEvent),
}

/// The bytes of a message on its lane.
type Waiting = (Lane, Vec<u8>);

#[derive(Clone, Debug, Default)]
pub(super) struct Network {
    /// What will happen, by time and order of sending.
    queue: BTreeMap<(Duration, u64), (Peer, Lane, Arrival)>,
    sent: u64,
    links: BTreeSet<(Peer, Peer)>,
    /// When the last thing on a lane arrives: nothing overtakes it.
    last: BTreeMap<(Peer, Peer, Lane), Duration>,
    /// Sent before the link was up.
    waiting: BTreeMap<(Peer, Peer), Vec<Waiting>>,
}

impl Network {
    pub(super) fn next_time(&self) -> Option<Duration> {
        self.queue.keys().next().map(|&(time, _)| time)
    }

    pub(super) fn pop(&mut self) -> Option<(Duration, Peer, Arrival)> {
        self.queue.pop_first().map(|((time, _), (to, _, arrival))| (time, to, arrival))
    }

    fn push(&mut self, time: Duration, to: Peer, lane: Lane, arrival: Arrival) {
        self.sent += 1;
        self.queue.insert((time, self.sent), (to, lane, arrival));
    }

    /// Puts an arrival on a lane, behind everything there.
    fn deliver(&mut self, time: Duration, from: Peer, to: Peer, lane: Lane, arrival: Arrival) {
        let last = self.last.entry((from, to, lane)).or_default();
        *last = time.max(*last);
        let time = *last;
        self.push(time, to, lane, arrival);
    }

    pub(super) fn physics(&mut self, time: Duration, node: NodeId, event: PhysicsEvent) {
        self.push(time, Peer::Node(node), Lane::Control, Arrival::Physics(event));
    }

    pub(super) fn send(&mut self, time: Duration, from: Peer, to: Peer, lane: Lane, bytes: Vec<u8>) {
        if self.links.contains(&pair(from, to)) {
            self.deliver(time, from, to, lane, Arrival::Frame(from, bytes));
        } else {
            self.waiting.entry((from, to)).or_default().push((lane, bytes));
        }
    }

    /// Makes a link; both ends hear of it before anything else arrives over it.
    pub(super) fn connect(&mut self, time: Duration, a: Peer, b: Peer) {
        if !self.links.insert(pair(a, b)) {
            return;
        }
        for (from, to) in [(a, b), (b, a)] {
            self.bury(time, from, to);
        }
        for (from, to) in [(a, b), (b, a)] {
            for lane in [Lane::Control, Lane::Border, Lane::State] {
                let last = self.last.entry((from, to, lane)).or_default();
                *last = time.max(*last);
            }
            self.deliver(time, from, to, Lane::Control, Arrival::Connected(from));
            for (lane, bytes) in self.waiting.remove(&(from, to)).unwrap_or_default() {
                self.deliver(time, from, to, lane, Arrival::Frame(from, bytes));
            }
        }
    }

    /// The end of an earlier link between the same two is heard of before its successor, and nothing of it afterwards.
    fn bury(&mut self, time: Duration, from: Peer, to: Peer) {
        let mut ended = false;
        self.queue.retain(|&(due, _), (at, _, arrival)| match arrival {
            Arrival::Disconnected(of) if *at == to && *of == from && due > time => {
                ended = true;
                false
            }
            Arrival::Frame(of, _) => *at != to || *of != from || due <= time,
            _ => true,
        });
        if ended {
            self.push(time, to, Lane::Control, Arrival::Disconnected(from));
        }
    }

    /// A link cannot be made.
    pub(super) fn refuse(&mut self, time: Duration, dialler: Peer, to: Peer) {
        self.waiting.remove(&(dialler, to));
        self.push(time, dialler, Lane::Control, Arrival::Disconnected(to));
    }

    /// One end closes the link: what it has sent arrives, then the other end hears of it.
    pub(super) fn close(&mut self, time: Duration, from: Peer, to: Peer) {
        self.waiting.remove(&(from, to));
        self.waiting.remove(&(to, from));
        if self.links.remove(&pair(from, to)) {
            let lanes = [Lane::Control, Lane::Border, Lane::State];
            let behind = lanes.iter().filter_map(|&lane| self.last.get(&(from, to, lane))).max();
            let time = time.max(behind.copied().unwrap_or_default());
            self.push(time, to, Lane::Control, Arrival::Disconnected(from));
        }
    }

    /// The link breaks: what is under way is lost, and both ends hear of it.
    pub(super) fn cut(&mut self, time: Duration, a: Peer, b: Peer) {
        self.queue.retain(|_, (to, _, arrival)| {
            !matches!(arrival, Arrival::Frame(from, _) if pair(*from, *to) == pair(a, b))
        });
        self.push(time, a, Lane::Control, Arrival::Disconnected(b));
        self.close(time, a, b);
    }

    /// A process is gone: nothing reaches it, and of each of its lanes what is under way arrives or is lost.
    pub(super) fn crash(&mut self, time: Duration, dead: Peer, random: &mut Random) {
        let peers: Vec<_> = self
            .links
            .iter()
            .filter_map(|&(a, b)| match dead {
                dead if dead == a => Some(b),
                dead if dead == b => Some(a),
                _ => None,
            })
            .collect();
        self.queue.retain(|_, (to, _, _)| *to != dead);
        for &peer in &peers {
            for lane in [Lane::Control, Lane::Border, Lane::State] {
                if random.below(2) == 0 {
                    self.queue.retain(|_, (to, of, arrival)| {
                        !(*to == peer
                            && *of == lane
                            && matches!(arrival, Arrival::Frame(from, _) if *from == dead))
                    });
                }
            }
            // Some notice at once, some only by time-out.
            let noticed = time + Duration::from_micros(random.below(40_000));
            self.close(noticed, dead, peer);
        }
        self.waiting.retain(|&(from, to), _| from != dead && to != dead);
        self.last.retain(|&(from, to, _), _| from != dead && to != dead);
    }
}

fn pair(a: Peer, b: Peer) -> (Peer, Peer) {
    (a.min(b), a.max(b))
}
