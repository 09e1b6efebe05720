//! Starts and ends a process that is a node, a client, or both (a participant, the thesis's normal case). Its
//! loop has a thread of its own, and shares with the user what the user reads.

mod absence;
mod event_loop;
mod recorded_node;

use std::collections::VecDeque;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use self::event_loop::Loop;
use self::recorded_node::RecordedNode;
use super::acknowledgements::Acknowledgements;
use super::bandwidth::Received;
use super::ending::{GIVE_UP, Reason};
use super::fan_out::{FanOut, Told};
use super::inbox::{InboxSender, inbox};
use super::links::Links;
use super::log::LogSpan;
use super::metrics::{NodeGauge, NodeMetrics};
use super::{Connections, PhysicsDevice, ProcessError, Pulse};
use crate::cluster::{Client, ClientEvent, Node, NodeConfig, Peer, PhysicsEvent, TickStats};
use crate::metrics::Endpoint;
use crate::net::{HeldEvent, Identity, Limits, Net, NetConfig, PeerName, PeerStats};
use crate::physics::RegionHost;
use crate::protocol::{Area, Refusal};
use crate::recording::{Background, Recorder};
use crate::space::{BodyId, NodeId, Tick};

/// A client whose server may be replaced by a standby misses it after this long: about when a standby has
/// taken over.
const MISSED: Duration = Duration::from_secs(2);

/// The settings of a node, client or participant.
pub struct MemberConfig {
    /// The address of the server.
    pub server: SocketAddr,
    /// The addresses of standby servers.
    pub standbys: Vec<SocketAddr>,
    /// The identity of the process. Its role decides what the process does.
    pub identity: Identity,
    /// The address to listen on for others; port 0 takes any free port. `None`: any free port, of this
    /// machine alone if all servers are on it and cannot be reached from elsewhere.
    pub listen: Option<SocketAddr>,
    /// The address to give to others, if it is not the one listened on.
    pub advertise: Option<SocketAddr>,
    /// The number of regions stepped at a time.
    pub threads: usize,
    /// The number of ticks between checkpoints to the server.
    pub checkpoint_every: u64,
    /// How long the node waits for others before it computes speculative ticks for its clients.
    pub patience: Duration,
    /// How long the server may be out of reach before the process gives up; `None`: without end. A node keeps
    /// computing meanwhile.
    pub give_up: Option<Duration>,
    /// The area of interest of a client; `None`: the whole world.
    pub interest: Option<Area>,
    /// A file to record the node to: all that it is given, and a digest of each region after each tick.
    pub record: Option<PathBuf>,
    /// An address where a node answers over HTTP with its metrics, and with whether it is well.
    pub metrics: Option<SocketAddr>,
    /// Looks at the regions of a node after each tick, on the node's thread.
    pub onlooker: Option<Onlooker>,
}

/// Looks at the regions of a node after a tick, with the numbers of that tick.
pub type Onlooker = Box<dyn FnMut(&RegionHost, &TickStats) + Send>;

impl MemberConfig {
    /// Returns the usual settings for this identity. A client waits for its server for 30 s. A node or
    /// participant waits without end: while no server is there, the world stops when a process that computes
    /// goes.
    pub fn new(server: SocketAddr, identity: Identity) -> Self {
        let give_up = usual_give_up(identity.who());
        Self {
            server,
            standbys: Vec::new(),
            identity,
            listen: None,
            advertise: None,
            threads: 1,
            checkpoint_every: 12,
            patience: Duration::from_millis(100),
            give_up,
            interest: None,
            record: None,
            metrics: None,
            onlooker: None,
        }
    }
}

/// Returns how long a process waits for a server that is out of reach, where nobody says; `None`: without end.
fn usual_give_up(who: PeerName) -> Option<Duration> {
    who.is_client_only().then_some(GIVE_UP)
}

/// A summary of what a node has done, for people and for the demo.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSummary {
    /// The node's id.
    pub node: NodeId,
    /// The last completed tick.
    pub tick: Tick,
    /// The number of bodies owned at the last tick.
    pub bodies: u32,
    /// The number of regions computed at the last tick.
    pub regions: usize,
    /// The number of bodies that came from other regions.
    pub transfers: u64,
    /// The number of ghosts held (copies of other regions' bodies), summed over all ticks.
    pub ghosts_sum: u64,
    /// The number of exchanges between regions, summed over all ticks.
    pub exchanges_sum: u64,
    /// The number of speculative ticks: computed only for clients, while other nodes were waited for.
    pub speculative: u64,
    /// The number of ticks of participants that this node, as leader, computed once more.
    pub verified: u64,
    /// The largest disagreement of copies of bodies held here in any tick, m/s.
    pub disagreement_max_m_s: f32,
    /// The computing time of each of the first million ticks, microseconds.
    pub compute_us: Vec<u32>,
    /// The computing time of the last tick, microseconds.
    pub last_us: u32,
    /// The bytes received and sent.
    pub bytes: u64,
    /// The seconds since the node's start.
    pub seconds: f64,
}

/// A running node, client or participant.
pub struct Member {
    pub(super) shared: Arc<Shared>,
    inbox: InboxSender<Input>,
    thread: Option<JoinHandle<()>>,
    /// The name of the process.
    pub who: crate::net::PeerName,
    /// The address on which the process listens.
    pub address: SocketAddr,
    connections: Connections,
    metrics: Option<Endpoint>,
}

/// A body that came or went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// The body appeared.
    Appeared(BodyId),
    /// The body disappeared.
    Disappeared(BodyId),
}

/// The state that the loop and its user share.
pub(super) struct Shared {
    /// The moment from which the loop counts time.
    pub(super) start: Instant,
    state: Mutex<State>,
    changed: Condvar,
}

pub(super) struct State {
    pub client: Option<Client>,
    pub refusals: VecDeque<(Option<BodyId>, Refusal)>,
    pub changes: VecDeque<Presence>,
    pub updates: u64,
    pub traffic: PeerStats,
    pub received: Received,
    pub summary: NodeSummary,
    /// The time at which the loop last turned.
    pub turned: Instant,
    pub end: Option<Result<(), ProcessError>>,
    /// Why the server ended the process, if that is not a failure.
    pub farewell: Option<String>,
}

pub(super) enum Input {
    Net(HeldEvent),
    Client(ClientEvent),
    Leave,
    /// A result of the repeated computation of what another member computes.
    Verified(PhysicsEvent),
    /// Wakes the loop, since its connections have work.
    Wake,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the condition holds or the time is up; returns whether the condition holds.
    pub(super) fn wait(&self, timeout: Duration, mut until: impl FnMut(&State) -> bool) -> bool {
        let (_state, timed_out) = self
            .changed
            .wait_timeout_while(self.lock(), timeout, |state| !until(state))
            .unwrap_or_else(PoisonError::into_inner);
        !timed_out.timed_out()
    }
}

impl Member {
    /// Starts the process's loop on a thread of its own, and dials the server.
    pub fn start(config: MemberConfig) -> Result<Self, ProcessError> {
        let who = config.identity.who();
        let servers = [&[config.server], &config.standbys[..]].concat();
        let net = NetConfig {
            listen: config.listen.unwrap_or_else(|| SocketAddr::new(interface_towards(&servers), 0)),
            identity: config.identity,
            authority: None,
            renewed_by: servers.clone(),
            limits: limits(servers.len()),
        };
        let (net, events) = Net::start(net)?;
        let address = net.local_addr();
        let advertised = config.advertise.unwrap_or_else(|| reachable(address, &servers));
        let client = who.client().map(|client| Client::new(client, who.node(), config.interest));
        let node = who.node().map(|id| NodeConfig {
            id,
            address: advertised,
            client: who.client(),
            interest: config.interest,
            checkpoint_every: config.checkpoint_every,
            patience: config.patience,
        });
        let metrics = node.as_ref().and(config.metrics).map(|address| {
            let metrics = Arc::new(NodeMetrics::new());
            super::metrics::start(address, metrics.clone())
                .map(|endpoint| (endpoint, NodeGauge::new(metrics)))
        });
        let (metrics, gauge) = metrics.transpose()?.unzip();
        let recorder = match (&node, config.record) {
            (Some(node), Some(path)) => {
                let begun = Background::create(&path).and_then(|file| Recorder::of_node(file, node, false));
                match begun {
                    Ok(recorder) => Some((path, recorder)),
                    Err(cause) => return Err(ProcessError::Record { path, cause }),
                }
            }
            _ => None,
        };
        let node =
            node.map(|config| RecordedNode::new(Node::new(config).with_replication_elsewhere(), recorder));
        let summary = NodeSummary { node: who.node().unwrap_or_default(), ..NodeSummary::default() };
        let state = State {
            client,
            refusals: VecDeque::new(),
            changes: VecDeque::new(),
            updates: 0,
            traffic: PeerStats::default(),
            received: Received::default(),
            summary,
            turned: Instant::now(),
            end: None,
            farewell: None,
        };
        let shared =
            Arc::new(Shared { start: Instant::now(), state: Mutex::new(state), changed: Condvar::new() });
        let (inbox, inputs) = inbox();
        let waker = inbox.clone();
        let connections = Connections::new(who, move || waker.wake(Input::Wake));
        let mut links = Links::new(net, connections.clone());
        links.dial(Peer::Server, &servers);
        let told: Arc<Mutex<Vec<Told>>> = Arc::default();
        let fan_out = match &node {
            Some(_) => Some(fan_out(&links, inbox.clone(), told.clone())?),
            None => None,
        };
        let mut acknowledgements =
            fan_out.as_ref().map(|fan_out| Acknowledgements::new(fan_out.ear(), links.received_beside()));
        let to = inbox.clone();
        // Events that came before are passed on first, so links that are up already are known here, too.
        events.pass_to(move |held| {
            let is_taken = acknowledgements.as_mut().is_some_and(|of| of.take(held.event()));
            is_taken || to.tell(Input::Net(held))
        });
        let verifier = inbox.clone();
        // A loop that has ended does not listen.
        let tell = move |event| {
            verifier.tell(Input::Verified(event));
        };
        let device = PhysicsDevice::new(config.threads).with_twins_apart(tell);
        let mut running =
            Loop::new(servers, config.give_up, links, node, device, shared.clone(), connections.clone());
        (running.fan_out, running.told) = (fan_out, told);
        (running.onlooker, running.gauge) = (config.onlooker, gauge);
        let thread = std::thread::Builder::new()
            .name(format!("dcd-{who:?}"))
            .spawn(move || {
                let shared = running.shared.clone();
                if catch_unwind(AssertUnwindSafe(|| running.run(&inputs, LogSpan::new(who)))).is_err() {
                    shared.lock().end = Some(Err(ProcessError::Fault));
                    shared.changed.notify_all();
                    running.connections.end(Reason::of_end(&Err(ProcessError::Fault)));
                }
            })
            .map_err(ProcessError::Thread)?;
        Ok(Self { shared, inbox, thread: Some(thread), who, address, connections, metrics })
    }

    /// Returns the connections of the process.
    pub fn connections(&self) -> &Connections {
        &self.connections
    }

    /// Returns the address of the node's metrics endpoint, if it has one.
    pub fn metrics_address(&self) -> Option<SocketAddr> {
        self.metrics.as_ref().map(Endpoint::address)
    }

    /// Returns a function that reports when the process's loop last turned, and the state of its node.
    pub fn pulse(&self) -> impl Fn() -> Pulse + Send + 'static {
        let shared = self.shared.clone();
        move || {
            let state = shared.lock();
            let NodeSummary { node, tick, bodies, regions, .. } = &state.summary;
            let words = match tick.0 {
                0 => format!("{node} waits for its group"),
                tick => format!("{node} at tick {tick}, {bodies} bodies, {regions} regions"),
            };
            Pulse { turned: state.turned, words }
        }
    }

    /// Returns a summary of what the node has done so far.
    pub fn summary(&self) -> NodeSummary {
        self.shared.lock().summary.clone()
    }

    /// Reads the summary of what the node has done so far without copying it: it has some megabytes after
    /// hours.
    pub(crate) fn read_summary<R>(&self, read: impl FnOnce(&NodeSummary) -> R) -> R {
        read(&self.shared.lock().summary)
    }

    /// Returns the last tick completed by the node.
    pub fn tick(&self) -> Tick {
        self.shared.lock().summary.tick
    }

    /// Returns the traffic over the network, as of a tenth of a second ago; with more than sixteen links, as
    /// of the count before.
    pub fn traffic(&self) -> PeerStats {
        self.shared.lock().traffic
    }

    /// Returns whether the loop has ended, and the error if it ended with one.
    pub fn ended(&self) -> Option<Option<String>> {
        let state = self.shared.lock();
        state.end.as_ref().map(|end| end.as_ref().err().map(ToString::to_string))
    }

    /// Returns whether a bug ended the loop.
    pub(crate) fn is_faulty(&self) -> bool {
        matches!(self.shared.lock().end, Some(Err(ProcessError::Fault)))
    }

    /// Returns why the server ended the process, if it did and that is not a failure.
    pub fn farewell(&self) -> Option<String> {
        self.shared.lock().farewell.clone()
    }

    /// Returns whether the loop has ended.
    pub fn is_over(&self) -> bool {
        self.shared.lock().end.is_some()
    }

    /// Waits for the end of the loop, no longer than `timeout`; returns whether it has ended.
    pub fn wait_over(&self, timeout: Duration) -> bool {
        self.shared.wait(timeout, |state| state.end.is_some())
    }

    /// Asks to leave in order: regions are handed over first. [`Member::finish`] waits for that.
    pub fn leave(&self) {
        let _ = self.inbox.send(Input::Leave);
    }

    /// Waits for the end of the loop and returns the summary, or the error it ended with.
    pub fn finish(mut self) -> Result<NodeSummary, ProcessError> {
        self.join();
        let mut state = self.shared.lock();
        let summary = state.summary.clone();
        state.end.take().unwrap_or(Ok(())).map(|()| summary)
    }

    pub(super) fn submit(&self, event: ClientEvent) -> Result<(), ProcessError> {
        self.inbox.send(Input::Client(event))
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Member {
    fn drop(&mut self) {
        if self.thread.is_some() {
            self.leave();
            self.join();
        }
    }
}

/// Starts the thread that tells clients. Messages that do not go by datagram wait in `told` until the loop
/// turns; a loop whose inbox is full does that anyway.
fn fan_out(
    links: &Links,
    inbox: InboxSender<Input>,
    told: Arc<Mutex<Vec<Told>>>,
) -> Result<FanOut, ProcessError> {
    let tell = move |one| {
        told.lock().unwrap_or_else(PoisonError::into_inner).push(one);
        inbox.wake(Input::Wake);
    };
    FanOut::start(links.outlet(), tell).map_err(ProcessError::Thread)
}

/// Returns the limits of a process whose server may be at this many addresses. Nobody tells a client that a
/// server at another address has taken over, so it must miss its own server soon.
fn limits(servers: usize) -> Limits {
    match servers {
        1 => Limits::default(),
        _ => Limits { client_idle_timeout: MISSED, client_keep_alive: MISSED / 4, ..Limits::default() },
    }
}

/// Returns the address to listen on: of this machine alone if all servers are on it and cannot be reached
/// from elsewhere. A socket bound to that address reaches no other machine.
pub(super) fn interface_towards(servers: &[SocketAddr]) -> IpAddr {
    match farthest(servers).ip().to_canonical() {
        server if server.is_loopback() => server,
        IpAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
        IpAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
    }
}

/// Returns the first server that is on another machine; the first of all if none is.
fn farthest(servers: &[SocketAddr]) -> SocketAddr {
    let is_far = |server: &&SocketAddr| !server.ip().to_canonical().is_loopback();
    *servers.iter().find(is_far).unwrap_or(&servers[0])
}

/// Returns the address that others can use: if all interfaces are listened on, that of the interface that
/// leads to the servers.
fn reachable(bound: SocketAddr, servers: &[SocketAddr]) -> SocketAddr {
    if !bound.ip().is_unspecified() {
        return bound;
    }
    let towards = std::net::UdpSocket::bind(SocketAddr::new(bound.ip(), 0)).and_then(|socket| {
        socket.connect(farthest(servers))?;
        socket.local_addr()
    });
    towards.map_or(bound, |local| SocketAddr::new(local.ip(), bound.port()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{ClientId, NodeId};

    #[test]
    fn who_computes_a_part_of_the_world_waits_for_its_server_without_end() {
        let (node, client) = (NodeId(1), ClientId(2));
        for computes in [PeerName::Node(node), PeerName::Participant(node, client)] {
            assert_eq!(usual_give_up(computes), None);
        }
        for watches in [PeerName::Client(client), PeerName::Builder(client)] {
            assert_eq!(usual_give_up(watches), Some(GIVE_UP));
        }
    }

    #[test]
    fn a_node_of_a_far_server_listens_where_that_server_and_others_reach_it() {
        for (servers, listens) in [
            (&["127.0.0.1:1"][..], "127.0.0.1"),
            (&["192.0.2.7:1"], "0.0.0.0"),
            (&["[::1]:1"], "::1"),
            (&["[2001:db8::7]:1"], "::"),
            // The standby server is elsewhere.
            (&["127.0.0.1:1", "192.0.2.7:1"], "0.0.0.0"),
            (&["127.0.0.1:1", "127.0.0.1:2"], "127.0.0.1"),
        ] {
            let servers: Vec<SocketAddr> = servers.iter().map(|server| server.parse().unwrap()).collect();
            assert_eq!(interface_towards(&servers), listens.parse::<IpAddr>().unwrap());
        }
        let loopback = reachable("0.0.0.0:7".parse().unwrap(), &["127.0.0.1:9".parse().unwrap()]);
        assert_eq!(loopback, "127.0.0.1:7".parse().unwrap());
    }

    /// What a peer sends and the loop has not read holds that peer back: the peer's own queue fills, not this
    /// process's memory.
    #[test]
    fn what_a_peer_says_waits_at_the_peer_while_the_loop_stands() {
        const FRAMES: usize = 600;
        let patience = Duration::from_secs(60);
        let folder = tempfile::tempdir().unwrap();
        let authority = Arc::new(crate::net::Authority::load_or_create(folder.path()).unwrap());
        let limits = Limits { frame_bytes: 64 << 10, queue_bytes: 256 << 10, ..Limits::default() };
        let start = |identity, authority| {
            let listen = ([127, 0, 0, 1], 0).into();
            Net::start(NetConfig {
                listen,
                identity,
                authority,
                renewed_by: Vec::new(),
                limits: limits.clone(),
            })
        };
        let (server, events) = start(authority.server_identity().unwrap(), Some(authority.clone())).unwrap();
        let now = std::time::SystemTime::now();
        let token = authority.issue_token(crate::net::JoinRole::Node, patience, now).unwrap();
        let joined = crate::net::join(&[server.local_addr()], &token, None, patience).unwrap();
        let (peer, own) = start(joined, None).unwrap();
        peer.connect(server.local_addr(), crate::net::PeerName::Server);
        let crate::net::NetEvent::Connected { peer: to, .. } = own.recv_timeout(patience).unwrap() else {
            panic!("it is linked")
        };
        let (inbox, inputs) = inbox();
        events.pass_to(move |held| inbox.tell(Input::Net(held)));
        let (begun, mut said) = (Instant::now(), 0);
        let say = |said: &mut usize| {
            while *said < FRAMES && peer.send(to, crate::net::Lane::Object, [7; 64 << 10]).is_ok() {
                *said += 1;
            }
        };
        while begun.elapsed() < Duration::from_secs(2) && said < FRAMES {
            say(&mut said);
            std::thread::yield_now();
        }
        assert!(said < FRAMES / 2, "{said} frames of 64 KiB went on, and nobody read them");
        let mut read = 0;
        while read < FRAMES {
            say(&mut said);
            if let Ok(Input::Net(event)) = inputs.recv_timeout(Duration::from_millis(10)) {
                let event = event.into_event();
                read += usize::from(matches!(event, crate::net::NetEvent::Frame { .. }));
            }
            assert!(begun.elapsed() < patience, "{read} of {said} frames arrived");
        }
    }
}
