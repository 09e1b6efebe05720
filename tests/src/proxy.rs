//! Simulates a bad network between processes of one machine: UDP packets go through a proxy, which loses,
//! delays, reorders, duplicates or blocks them.
//!
//! A process is given the address of a *front* in place of its peer's. Each sender to a front gets a *flow*
//! with its own socket towards the peer, so the peer sees as many addresses as there are senders. The fate of
//! a flow's n-th packet depends on the seed, the order in which flows began, and n.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dcd::sim::Random;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// The conditions of the network, the same for each direction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Weather {
    /// The share of packets that are lost.
    pub loss: f64,
    /// The mean delay of packets.
    pub delay: Duration,
    /// The largest deviation from `delay`. It drifts slowly enough that packets keep their order.
    pub jitter: Duration,
    /// The share of packets that are delayed by [`LATE`], so that packets sent within that time overtake
    /// them.
    pub reorder: f64,
    /// The share of packets that arrive twice.
    pub duplicate: f64,
}

/// The additional delay of overtaken packets.
pub const LATE: Duration = Duration::from_millis(50);

/// The number of packets by their fate so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Packets that reached the proxy.
    pub taken: u64,
    /// Packets that were sent on, duplicates included.
    pub passed: u64,
    /// Packets that were lost by chance, or because the queue was full.
    pub lost: u64,
    /// Packets that a cut stopped.
    pub cut: u64,
    /// Packets that were overtaken.
    pub reordered: u64,
    /// Packets that were duplicated.
    pub doubled: u64,
}

/// A running proxy. Dropping it ends the proxy.
pub struct Proxy {
    shared: Arc<Mutex<Shared>>,
    /// A socket that wakes the proxy's thread.
    bell: UdpSocket,
    thread: Option<JoinHandle<()>>,
}

/// The sender and the receiver between which nothing passes; `None` stands for anybody.
type Cut = (Option<SocketAddr>, Option<SocketAddr>);

#[derive(Default)]
struct Shared {
    weather: Weather,
    cuts: Vec<Cut>,
    traffic: Traffic,
    new_fronts: Vec<Front>,
    over: bool,
}

/// The most packets on their way. Packets beyond that are lost, as in any router.
const QUEUE: usize = 1 << 16;

impl Proxy {
    /// Starts a proxy without fronts, on a perfect network.
    pub fn start(seed: u64) -> Self {
        let (bell, heard) = (loopback(), loopback());
        bell.connect(heard.local_addr().unwrap()).unwrap();
        let shared = Arc::new(Mutex::new(Shared::default()));
        let mut router = Router {
            shared: shared.clone(),
            bell: heard,
            seeds: Random::new(seed),
            fronts: Vec::new(),
            flows: Vec::new(),
            known: BTreeMap::new(),
            queue: BinaryHeap::new(),
            number: 0,
            epoch: Instant::now(),
        };
        let thread = std::thread::spawn(move || router.run());
        Self { shared, bell, thread: Some(thread) }
    }

    /// Returns an address that leads to `target`.
    pub fn front(&self, target: SocketAddr) -> SocketAddr {
        let socket = loopback();
        let address = socket.local_addr().unwrap();
        self.lock().new_fronts.push(Front { socket, target });
        self.ring();
        address
    }

    /// Sets the conditions for the packets from now on.
    pub fn set(&self, weather: Weather) {
        self.lock().weather = weather;
    }

    /// Blocks all packets from one real address to another from now on; `None` stands for anybody. A
    /// process's real address is the one that it listens on, not its front.
    pub fn cut(&self, from: Option<SocketAddr>, to: Option<SocketAddr>) {
        self.lock().cuts.push((from, to));
    }

    /// Undoes all cuts.
    pub fn heal(&self) {
        self.lock().cuts.clear();
    }

    /// Returns the counts of all flows, both ways.
    pub fn traffic(&self) -> Traffic {
        self.lock().traffic
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ring(&self) {
        let _ = self.bell.send(&[0]);
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.lock().over = true;
        self.ring();
        let ended = self.thread.take().map(JoinHandle::join);
        if !std::thread::panicking() {
            ended.unwrap().expect("the proxy's thread does not panic");
        }
    }
}

fn loopback() -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_nonblocking(true).unwrap();
    socket
}

/// Returns an address with a port that is free now and that the system gives to nobody who asks for any port.
/// It can be used later, and again. The ports that the system gives begin at 32,768.
pub fn free_address() -> SocketAddr {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    loop {
        // Processes that run at the same time begin at different ports.
        let step = COUNT.fetch_add(1, Ordering::Relaxed);
        let port = 20_000 + std::process::id().wrapping_mul(61).wrapping_add(step) % 12_000;
        let address = SocketAddr::from(([127, 0, 0, 1], port as u16));
        if UdpSocket::bind(address).is_ok() {
            return address;
        }
    }
}

struct Front {
    socket: UdpSocket,
    target: SocketAddr,
}

struct Flow {
    front: usize,
    source: SocketAddr,
    /// The socket whose address the target sees.
    back: UdpSocket,
    /// The way to the target, and the way back.
    ways: [Way; 2],
}

struct Way {
    seed: u64,
    dice: Random,
    /// The time before which no packet that keeps its order is due.
    last_due: Instant,
}

const THERE: usize = 0;
const BACK: usize = 1;

/// A packet on its way: when it is due, its number, its flow and direction, and its bytes.
type Parcel = (Instant, u64, usize, usize, Vec<u8>);

struct Router {
    shared: Arc<Mutex<Shared>>,
    bell: UdpSocket,
    seeds: Random,
    fronts: Vec<Front>,
    flows: Vec<Flow>,
    /// The flow of each pair of a front and a source.
    known: BTreeMap<(usize, SocketAddr), usize>,
    queue: BinaryHeap<Reverse<Parcel>>,
    number: u64,
    epoch: Instant,
}

impl Router {
    fn run(&mut self) {
        let mut buffer = vec![0; 1 << 16];
        loop {
            let shared = self.shared.clone();
            let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            if shared.over {
                return;
            }
            self.fronts.append(&mut shared.new_fronts);
            while self.bell.recv(&mut buffer).is_ok() {}
            for front in 0..self.fronts.len() {
                while let Ok((length, source)) = received(&self.fronts[front].socket, &mut buffer) {
                    let flow = self.flow(front, source);
                    self.take(&mut shared, flow, THERE, &buffer[..length]);
                }
            }
            for flow in 0..self.flows.len() {
                let target = self.fronts[self.flows[flow].front].target;
                while let Ok((length, source)) = received(&self.flows[flow].back, &mut buffer) {
                    if source == target {
                        self.take(&mut shared, flow, BACK, &buffer[..length]);
                    }
                }
            }
            self.pass(&mut shared);
            drop(shared);
            self.wait();
        }
    }

    /// Waits until a packet comes or is due.
    fn wait(&self) {
        let fronts = self.fronts.iter().map(|front| &front.socket);
        let backs = self.flows.iter().map(|flow| &flow.back);
        let sockets = std::iter::once(&self.bell).chain(fronts).chain(backs);
        let mut fds: Vec<_> =
            sockets.map(|socket| PollFd::from_borrowed_fd(socket.as_fd(), PollFlags::IN)).collect();
        let left =
            self.queue.peek().map(|Reverse(parcel)| parcel.0.saturating_duration_since(Instant::now()));
        let left = left.map(|left| Timespec::try_from(left).unwrap());
        // Whether interrupted or not, the next round finds what there is.
        let _ = poll(&mut fds, left.as_ref());
    }

    fn flow(&mut self, front: usize, source: SocketAddr) -> usize {
        *self.known.entry((front, source)).or_insert_with(|| {
            let mut way = || Way {
                seed: self.seeds.bits(),
                dice: Random::new(self.seeds.bits()),
                last_due: self.epoch,
            };
            self.flows.push(Flow { front, source, back: loopback(), ways: [way(), way()] });
            self.flows.len() - 1
        })
    }

    /// Decides the fate of a packet.
    fn take(&mut self, shared: &mut Shared, flow: usize, way: usize, bytes: &[u8]) {
        shared.traffic.taken += 1;
        let weather = shared.weather;
        let ends = self.ends(flow, way);
        let now = Instant::now();
        let way_index = way;
        let way = &mut self.flows[flow].ways[way];
        // All random numbers are drawn for every packet, so that one share does not change which packets
        // another hits.
        let [lost, reordered, doubled] =
            [weather.loss, weather.reorder, weather.duplicate].map(|share| way.dice.unit() < share);
        if is_cut(shared, ends) {
            shared.traffic.cut += 1;
            return;
        }
        if lost || self.queue.len() >= QUEUE {
            shared.traffic.lost += 1;
            return;
        }
        let mut due = now + delay(weather, way.seed, now - self.epoch);
        if reordered {
            shared.traffic.reordered += 1;
            due += LATE;
        } else {
            due = due.max(way.last_due);
            way.last_due = due;
        }
        shared.traffic.doubled += u64::from(doubled);
        for _ in 0..1 + usize::from(doubled) {
            self.number += 1;
            self.queue.push(Reverse((due, self.number, flow, way_index, bytes.to_vec())));
        }
    }

    /// Sends on the packets that are due.
    fn pass(&mut self, shared: &mut Shared) {
        while self.queue.peek().is_some_and(|Reverse(parcel)| parcel.0 <= Instant::now()) {
            let Some(Reverse((_, _, flow, way, bytes))) = self.queue.pop() else { return };
            if is_cut(shared, self.ends(flow, way)) {
                shared.traffic.cut += 1;
                continue;
            }
            let Flow { front, source, back, .. } = &self.flows[flow];
            let front = &self.fronts[*front];
            // If the peer is gone, its system answers with an error, unlike a network. The error is ignored.
            let _ = if way == THERE {
                back.send_to(&bytes, front.target)
            } else {
                front.socket.send_to(&bytes, source)
            };
            shared.traffic.passed += 1;
        }
    }

    /// Returns the real sender and receiver of a flow's packets.
    fn ends(&self, flow: usize, way: usize) -> (SocketAddr, SocketAddr) {
        let flow = &self.flows[flow];
        let target = self.fronts[flow.front].target;
        if way == THERE { (flow.source, target) } else { (target, flow.source) }
    }
}

/// Returns the next packet. An error that an earlier packet caused is skipped.
fn received(socket: &UdpSocket, buffer: &mut [u8]) -> std::io::Result<(usize, SocketAddr)> {
    loop {
        match socket.recv_from(buffer) {
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionRefused => {}
            other => return other,
        }
    }
}

fn is_cut(shared: &Shared, (from, to): (SocketAddr, SocketAddr)) -> bool {
    let is = |wanted: Option<SocketAddr>, is: SocketAddr| wanted.is_none_or(|wanted| wanted == is);
    shared.cuts.iter().any(|&(source, target)| is(source, from) && is(target, to))
}

/// Returns the delay at a time. It goes in straight lines from one random delay to the next, never steeper
/// than time itself, so that packets sent later arrive later.
fn delay(weather: Weather, seed: u64, since: Duration) -> Duration {
    let step_s = weather.jitter.as_secs_f64().max(0.01) * 2.0;
    let steps = since.as_secs_f64() / step_s;
    let at = |step: u64| 2.0 * Random::new(seed.wrapping_add(step)).unit() - 1.0;
    let (a, b) = (at(steps as u64), at(steps as u64 + 1));
    let drift = weather.jitter.as_secs_f64() * (a + (b - a) * steps.fract());
    Duration::from_secs_f64((weather.delay.as_secs_f64() + drift).max(0.0))
}

#[cfg(test)]
mod tests;
