//! Runs a process that is a node, a client, or both (a participant, the thesis's normal case): one thread feeds network events,
//! physics results and the user's inputs to the state machines and carries out their outputs.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tracing::{debug, info, warn};

use super::bandwidth::Received;
use super::ending::{Cause, Ending, GIVE_UP, Reason};
use super::links::{LinkEvent, Links};
use super::{Connections, PhysicsDevice, ProcessError};
use crate::cluster::{
    Client, ClientEvent, ClientOutput, Node, NodeConfig, NodeEvent, NodeOutput, Peer, PhysicsCommand,
    PhysicsEvent, WORLD_ENDED,
};
use crate::net::{Identity, Limits, Net, NetConfig, NetEvent, NetEvents, PeerStats};
use crate::protocol::{Area, Farewell, Message, Refusal, ToClient};
use crate::space::{BodyId, ClientId, NodeId, Tick};

/// How often sending is tried again where a link had no room.
const RETRY: Duration = Duration::from_millis(2);
/// Events that may wait for the loop; beyond that the network holds its peers back.
const QUEUE: usize = 4_096;
/// How long a leaving node waits for the server: one that lives takes over within a second.
const RELEASE: Duration = Duration::from_secs(5);
/// How often the network's counters are read for the user.
const COUNT: Duration = Duration::from_millis(100);
/// Tick times kept for the summary: four hours at 60 per second.
const TIMES: usize = 1 << 20;

/// The settings of a node, client or participant.
pub struct MemberConfig {
    /// Where the server is.
    pub server: SocketAddr,
    /// Who the process is; its role decides what it does.
    pub identity: Identity,
    /// Where it listens for others; port 0 takes any free one.
    pub listen: SocketAddr,
    /// The address to give to others, if it is not the one listened on.
    pub advertise: Option<SocketAddr>,
    /// Regions stepped at a time.
    pub threads: usize,
    /// Ticks between reports of moved bodies to clients.
    pub report_every: u64,
    /// Ticks between checkpoints to the server.
    pub checkpoint_every: u64,
    /// How long the node waits for others before it computes speculative ticks for its clients.
    pub patience: Duration,
    /// How long the server may be out of reach before the process gives up. Meanwhile a node computes on.
    pub give_up: Duration,
    /// The area that a client wants to be told of; `None`: the whole world.
    pub interest: Option<Area>,
}

impl MemberConfig {
    /// Returns the usual settings for this identity.
    pub fn new(server: SocketAddr, identity: Identity) -> Self {
        Self {
            server,
            identity,
            listen: SocketAddr::new(interface_towards(server.ip().to_canonical()), 0),
            advertise: None,
            threads: 1,
            report_every: 3,
            checkpoint_every: 12,
            patience: Duration::from_millis(100),
            give_up: GIVE_UP,
            interest: None,
        }
    }
}

/// A summary of what a node did, for people and for the demo.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSummary {
    /// Its id.
    pub node: NodeId,
    /// The last completed tick.
    pub tick: Tick,
    /// Bodies owned at the last tick.
    pub bodies: u32,
    /// Regions computed at the last tick.
    pub regions: usize,
    /// Bodies that came from other regions.
    pub transfers: u64,
    /// Copies of other regions' bodies (replicas) held, summed over all ticks.
    pub replicas_sum: u64,
    /// Exchanges between regions, summed over all ticks.
    pub exchanges_sum: u64,
    /// Speculative ticks: computed for clients alone, while others were waited for.
    pub speculative: u64,
    /// Largest disagreement of copies of bodies held here in any tick, m/s.
    pub disagreement_max_m_s: f32,
    /// Microseconds of computing of each tick.
    pub compute_us: Vec<u32>,
    /// Bytes received and sent.
    pub bytes: u64,
    /// Seconds since its start.
    pub seconds: f64,
}

/// A running node, client or participant.
pub struct Member {
    pub(super) shared: Arc<Shared>,
    inbox: SyncSender<Input>,
    thread: Option<JoinHandle<()>>,
    /// Who the process is.
    pub who: crate::net::PeerName,
    /// Where it listens.
    pub address: SocketAddr,
    connections: Connections,
}

/// The state that the loop and its user share.
pub(super) struct Shared {
    /// The beginning of its time.
    pub(super) start: Instant,
    state: Mutex<State>,
    changed: Condvar,
}

pub(super) struct State {
    pub client: Option<Client>,
    pub refusals: Vec<(Option<BodyId>, Refusal)>,
    pub appeared: Vec<BodyId>,
    pub disappeared: Vec<BodyId>,
    pub updates: u64,
    pub traffic: PeerStats,
    pub received: Received,
    pub summary: NodeSummary,
    pub end: Option<Result<(), ProcessError>>,
}

#[expect(clippy::large_enum_variant, reason = "an input lives for one call")]
pub(super) enum Input {
    Net(NetEvent),
    Client(ClientEvent),
    Leave,
    /// Wakes the loop: there is work for its connections.
    Wake,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the condition holds or the time is up; returns which.
    pub(super) fn wait(&self, timeout: Duration, mut until: impl FnMut(&State) -> bool) -> bool {
        let (_state, timed_out) = self
            .changed
            .wait_timeout_while(self.lock(), timeout, |state| !until(state))
            .unwrap_or_else(PoisonError::into_inner);
        !timed_out.timed_out()
    }
}

impl Member {
    /// Starts the process's loop on a thread of its own, and the link to the server.
    pub fn start(config: MemberConfig) -> Result<Self, ProcessError> {
        let who = config.identity.who();
        let net = NetConfig {
            listen: config.listen,
            identity: config.identity,
            authority: None,
            renewed_by: Some(config.server),
            limits: Limits::default(),
        };
        let (net, events) = Net::start(net)?;
        let address = net.local_addr();
        let advertised = config.advertise.unwrap_or_else(|| reachable(address, config.server));
        let client = who.client().map(|client| Client::new(client, who.node(), config.interest));
        let node = who.node().map(|id| {
            Node::new(NodeConfig {
                id,
                address: advertised,
                client: who.client(),
                interest: config.interest,
                report_every: config.report_every,
                checkpoint_every: config.checkpoint_every,
                patience: config.patience,
            })
        });
        let summary = NodeSummary { node: who.node().unwrap_or_default(), ..NodeSummary::default() };
        let state = State {
            client,
            refusals: Vec::new(),
            appeared: Vec::new(),
            disappeared: Vec::new(),
            updates: 0,
            traffic: PeerStats::default(),
            received: Received::default(),
            summary,
            end: None,
        };
        let shared =
            Arc::new(Shared { start: Instant::now(), state: Mutex::new(state), changed: Condvar::new() });
        let (inbox, inputs) = mpsc::sync_channel(QUEUE);
        forward(events, inbox.clone())?;
        let waker = inbox.clone();
        // A loop whose inbox is full is awake.
        let connections = Connections::new(who, move || drop(waker.try_send(Input::Wake)));
        let mut links = Links::new(net, connections.clone());
        links.dial(Peer::Server, config.server);
        let mut running = Loop {
            server: config.server,
            start: shared.start,
            links,
            node,
            device: PhysicsDevice::new(config.threads),
            shared: shared.clone(),
            connections: connections.clone(),
            release_by: None,
            give_up: config.give_up,
            has_more: false,
            lost: None,
            unheard: None,
            unheard_leader: None,
            joined: false,
            count_at: Duration::ZERO,
            told: BTreeMap::new(),
            end: None,
            reason: None,
        };
        let thread = std::thread::Builder::new()
            .name(format!("dcd-{who:?}"))
            .spawn(move || {
                let shared = running.shared.clone();
                if catch_unwind(AssertUnwindSafe(|| running.run(&inputs))).is_err() {
                    shared.lock().end = Some(Err(ProcessError::Fault));
                    shared.changed.notify_all();
                    running.connections.end(Reason::of_end(&Err(ProcessError::Fault)));
                }
            })
            .map_err(ProcessError::Thread)?;
        Ok(Self { shared, inbox, thread: Some(thread), who, address, connections })
    }

    /// Returns the connections of the process.
    pub fn connections(&self) -> &Connections {
        &self.connections
    }

    /// Returns a summary of what the node did so far.
    pub fn summary(&self) -> NodeSummary {
        self.shared.lock().summary.clone()
    }

    /// Returns the last tick completed by the node.
    pub fn tick(&self) -> Tick {
        self.shared.lock().summary.tick
    }

    /// Returns the traffic over the network, as of a tenth of a second ago.
    pub fn traffic(&self) -> PeerStats {
        self.shared.lock().traffic
    }

    /// Returns whether the loop has ended, and why if something went wrong.
    pub fn ended(&self) -> Option<Option<String>> {
        let state = self.shared.lock();
        state.end.as_ref().map(|end| end.as_ref().err().map(ToString::to_string))
    }

    /// Returns whether the loop has ended.
    pub fn is_over(&self) -> bool {
        self.shared.lock().end.is_some()
    }

    /// Waits for the end of the loop, no longer than `timeout`; returns whether it came.
    pub fn wait_over(&self, timeout: Duration) -> bool {
        self.shared.wait(timeout, |state| state.end.is_some())
    }

    /// Asks to leave in order: regions are handed over first. [`Member::finish`] waits for it.
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
        self.inbox.send(Input::Client(event)).map_err(|_| ProcessError::Stopped)
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

/// Returns the address to listen on: of this machine alone if the server is on it and cannot be reached from elsewhere.
fn interface_towards(server: IpAddr) -> IpAddr {
    match server {
        server if server.is_loopback() => server,
        IpAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
        IpAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
    }
}

/// Returns the address that others can use: one on the interface that leads to the server, if all are listened on.
fn reachable(bound: SocketAddr, server: SocketAddr) -> SocketAddr {
    if !bound.ip().is_unspecified() {
        return bound;
    }
    let towards = std::net::UdpSocket::bind(SocketAddr::new(bound.ip(), 0)).and_then(|socket| {
        socket.connect(server)?;
        socket.local_addr()
    });
    towards.map_or(bound, |local| SocketAddr::new(local.ip(), bound.port()))
}

/// Forwards network events into the loop's inbox, so that they and the user's inputs come through one channel.
pub(super) fn forward<T: From<NetEvent> + Send + 'static>(
    events: NetEvents,
    inbox: SyncSender<T>,
) -> Result<(), ProcessError> {
    let pump = move || {
        while let Ok(event) = events.recv() {
            if inbox.send(event.into()).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new().name("dcd-events".into()).spawn(pump).map_err(ProcessError::Thread)?;
    Ok(())
}

impl From<NetEvent> for Input {
    fn from(event: NetEvent) -> Self {
        Self::Net(event)
    }
}

struct Loop {
    server: SocketAddr,
    start: Instant,
    links: Links,
    node: Option<Node>,
    device: PhysicsDevice,
    shared: Arc<Shared>,
    connections: Connections,
    /// When the process leaves without the server, after its user asked to leave.
    release_by: Option<Duration>,
    give_up: Duration,
    /// Outputs may be left to carry out.
    has_more: bool,
    /// Since when the server is out of reach, and why.
    lost: Option<(Duration, String)>,
    /// Since when a client hears no leader, and why.
    unheard: Option<(Duration, String)>,
    /// Where the leader is that it does not hear.
    unheard_leader: Option<SocketAddr>,
    /// Whether it was ever reached: one that never was is not waited for.
    joined: bool,
    /// When the network's counters are read next.
    count_at: Duration,
    /// The newest batch of states given to the link of each client.
    told: BTreeMap<ClientId, u32>,
    end: Option<Result<(), ProcessError>>,
    /// Why the loop ends, where `end` does not say.
    reason: Option<Reason>,
}

impl Loop {
    fn run(&mut self, inputs: &mpsc::Receiver<Input>) {
        while self.end.is_none() {
            let now = self.start.elapsed();
            let due = self.poll_timeout();
            let mut wait = due.map_or(Duration::from_millis(500), |due| due.saturating_sub(now));
            if self.links.flush(Instant::now()) {
                wait = wait.min(RETRY);
            }
            let has_more = std::mem::take(&mut self.has_more);
            match inputs.recv_timeout(if has_more { Duration::ZERO } else { wait }) {
                Ok(input) => self.take(input),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if has_more {
                inputs.try_iter().take(QUEUE).for_each(|input| self.take(input));
            }
            let now = self.start.elapsed();
            if let Some(node) = &mut self.node
                && node.poll_timeout().is_some_and(|due| due <= now)
            {
                node.handle_timeout(now);
            }
            if let Some(client) = &mut self.shared.lock().client
                && client.poll_timeout().is_some_and(|due| due <= now)
            {
                client.handle_timeout(now);
            }
            self.pump();
            for event in self.links.take_given_up() {
                self.link_event(event);
                self.pump();
            }
            if self.end.is_none()
                && let Some((since, reason)) = &self.lost
                && since.saturating_add(self.give_up) <= now
            {
                let (reason, waited) = (reason.clone(), self.give_up);
                self.end = Some(Err(ProcessError::GivenUp { server: self.server, waited, reason }));
            }
            self.look_for_leader(now);
            if self.count_at <= now {
                self.count_at = now + COUNT;
                let mut state = self.shared.lock();
                (state.traffic, state.received) = (self.links.totals().traffic, self.links.received());
            }
            if self.end.is_none() && self.release_by.is_some_and(|by| by <= now) {
                self.end = Some(Err(ProcessError::NotReleased { server: self.server, waited: RELEASE }));
            }
        }
        let end = self.end.take().unwrap_or(Ok(()));
        let reason = self.reason.take().unwrap_or_else(|| Reason::of_end(&end));
        let mut state = self.shared.lock();
        state.summary.seconds = self.start.elapsed().as_secs_f64();
        state.end = Some(end);
        drop(state);
        self.shared.changed.notify_all();
        self.connections.end(reason);
    }

    /// Ends a client to which its server names a leader that it cannot reach.
    fn look_for_leader(&mut self, now: Duration) {
        let leader =
            self.shared.lock().client.as_ref().and_then(Client::unheard_leader).map(|leader| leader.address);
        let Some(leader) = leader else {
            self.unheard = None;
            return;
        };
        // A new leader has its own time.
        if self.unheard_leader.replace(leader) != Some(leader) {
            self.unheard = None;
        }
        let (since, reason) =
            self.unheard.get_or_insert_with(|| (now, "nothing is heard from it".to_owned()));
        if self.end.is_none() && since.saturating_add(self.give_up) <= now {
            let (reason, waited) = (reason.clone(), self.give_up);
            self.end = Some(Err(ProcessError::LeaderUnreachable { leader, waited, reason }));
        }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let node = self.node.as_ref().and_then(Node::poll_timeout);
        let client = self.shared.lock().client.as_ref().and_then(Client::poll_timeout);
        let waits = [&self.lost, &self.unheard].into_iter().flatten();
        let end = waits.map(|(since, _)| since.saturating_add(self.give_up)).min();
        node.into_iter().chain(client).chain(end).min()
    }

    fn take(&mut self, input: Input) {
        match input {
            Input::Net(event) => {
                for event in self.links.translate(event) {
                    self.link_event(event);
                }
            }
            Input::Client(event) => self.client(event),
            Input::Wake => {}
            Input::Leave => {
                self.client(ClientEvent::Leave);
                match &mut self.node {
                    Some(node) => {
                        let now = self.start.elapsed();
                        self.release_by.get_or_insert(now + RELEASE);
                        node.handle(now, NodeEvent::Leave);
                    }
                    None => {
                        self.pump();
                        self.end = Some(Ok(()));
                    }
                }
            }
        }
    }

    fn link_event(&mut self, event: LinkEvent) {
        let now = self.start.elapsed();
        match event {
            LinkEvent::Connected(peer) => {
                if peer == Peer::Server {
                    self.joined = true;
                    if self.lost.take().is_some() {
                        info!(server = %self.server, "the server is back");
                    }
                }
                if let Some(node) = &mut self.node {
                    node.handle(now, NodeEvent::Connected(peer));
                }
                if self.node.is_none() || peer == Peer::Server {
                    self.client(ClientEvent::Connected(peer));
                }
            }
            LinkEvent::Disconnected { peer, ending, text: reason } => {
                // Whoever it was for: at worst a backlog is looked at twice.
                self.told.clear();
                if peer == Peer::Server {
                    let server = self.server;
                    let end = match ending {
                        Some(Ending::Superseded) => Some(ProcessError::Superseded { server }),
                        Some(Ending::SentAway) => {
                            Some(ProcessError::SentAway { server, reason: reason.clone() })
                        }
                        Some(Ending::WorldEnded) => return self.world_ended(),
                        Some(Ending::Refused) => {
                            Some(ProcessError::ServerGone { server, reason: reason.clone() })
                        }
                        _ if !self.joined => {
                            Some(ProcessError::ServerGone { server, reason: reason.clone() })
                        }
                        _ => None,
                    };
                    if let Some(end) = end {
                        self.end = Some(Err(end));
                        return;
                    }
                    let since = self.lost.as_ref().map(|(since, _)| *since);
                    if since.is_none() {
                        warn!(%server, reason, "the server is out of reach; going on without it, and dialling it again");
                    }
                    self.lost = Some((since.unwrap_or(now), reason));
                } else if let Some((_, why)) = self.unheard.as_mut().filter(|_| self.node.is_none()) {
                    if *why != reason {
                        warn!(
                            ?peer,
                            reason, "the node that tells of the world is out of reach; dialling it again"
                        );
                    }
                    *why = reason;
                } else {
                    debug!(?peer, reason, "a link is gone");
                }
                if let Some(node) = &mut self.node {
                    node.handle(now, NodeEvent::Disconnected(peer));
                }
                if self.node.is_none() || peer == Peer::Server {
                    self.client(ClientEvent::Disconnected(peer));
                }
            }
            LinkEvent::Message { from, message } => {
                let to_client =
                    self.node.is_none() || (from == Peer::Server && matches!(message, Message::ToClient(..)));
                match &mut self.node {
                    Some(node) if !to_client => node.handle(now, NodeEvent::Message { from, message }),
                    _ => self.client(ClientEvent::Message { from, message }),
                }
            }
        }
    }

    fn client(&mut self, event: ClientEvent) {
        let is_heard = matches!(event, ClientEvent::Message { .. } | ClientEvent::Node(_));
        let mut state = self.shared.lock();
        if is_update(&event) {
            state.updates += 1;
        }
        if let Some(client) = &mut state.client {
            client.handle(self.start.elapsed(), event);
        }
        drop(state);
        self.shared.changed.notify_all();
        if is_heard {
            self.connections.ring();
        }
    }

    /// Carries out the outputs of the state machines, until there are none or a tick is complete: a node that waits for nobody would
    /// hear nobody else.
    fn pump(&mut self) {
        self.has_more = false;
        while self.end.is_none() {
            let of_node = if self.has_more { None } else { self.node.as_mut().and_then(Node::poll_output) };
            if let Some(output) = of_node {
                self.has_more = matches!(output, NodeOutput::Settled(_));
                self.node_output(output);
                continue;
            }
            let output = self.shared.lock().client.as_mut().and_then(Client::poll_output);
            match output {
                Some(output) => self.client_output(output),
                None => return,
            }
        }
    }

    fn node_output(&mut self, output: NodeOutput) {
        match output {
            NodeOutput::Send { to, message } => {
                self.look_at_backlog(to, &message);
                self.links.send(to, &message);
            }
            NodeOutput::Redial => self.redial(),
            NodeOutput::Connect(member) => self.links.dial(Peer::Node(member.node), member.address),
            NodeOutput::Disconnect(node) => self.links.end(Peer::Node(node), Ending::NotAMember),
            NodeOutput::Physics(command) => self.compute(command),
            NodeOutput::Client(message) => self.client(ClientEvent::Node(message)),
            NodeOutput::Settled(tick) => {
                let bytes = self.links.totals().traffic;
                let mut state = self.shared.lock();
                state.summary.tick = tick;
                state.summary.bytes = bytes.bytes_in + bytes.bytes_out;
                state.summary.seconds = self.start.elapsed().as_secs_f64();
                drop(state);
                self.shared.changed.notify_all();
            }
            NodeOutput::Stopped { farewell, reason } => {
                info!(reason, "the node stops");
                let server = self.server;
                match farewell {
                    Farewell::SentAway | Farewell::Refused => {
                        self.end = Some(Err(ProcessError::Evicted { server, reason }));
                    }
                    Farewell::Ended => self.world_ended(),
                    Farewell::Left => self.end = Some(Ok(())),
                }
            }
        }
    }

    /// Tells the node what still waits of the states before, with the first message of each batch for a client.
    fn look_at_backlog(&mut self, to: Peer, message: &Message) {
        let Message::ToClient(client, ToClient::CompactStates { part, .. }) = message else { return };
        let (client, bytes) = (*client, self.links.datagrams_waiting(to));
        if self.told.insert(client, part.batch) != Some(part.batch)
            && let Some(node) = &mut self.node
        {
            node.handle(self.start.elapsed(), NodeEvent::Backlog { client, bytes });
        }
    }

    /// Ends in order for all: no failure for a mere node; clients must learn of it.
    fn world_ended(&mut self) {
        let (server, reason) = (self.server, WORLD_ENDED.to_owned());
        let plays = self.shared.lock().client.is_some();
        self.end = Some(if plays { Err(ProcessError::ServerGone { server, reason }) } else { Ok(()) });
        self.reason = Some(Reason::new(Cause::WorldEnded, WORLD_ENDED));
    }

    fn redial(&mut self) {
        self.links.dial(Peer::Server, self.server);
    }

    fn compute(&mut self, command: PhysicsCommand) {
        match self.device.run(command) {
            Ok(None) => {}
            Ok(Some(event)) => {
                if let PhysicsEvent::Settled { stats, .. } = &event {
                    let summary = &mut self.shared.lock().summary;
                    summary.bodies = stats.bodies;
                    summary.regions = self.device.host().map_or(0, |host| host.regions().len());
                    summary.transfers += u64::from(stats.transfers);
                    summary.replicas_sum += u64::from(stats.replicas);
                    summary.exchanges_sum += u64::from(stats.exchanges);
                    summary.disagreement_max_m_s = summary.disagreement_max_m_s.max(stats.disagreement_m_s);
                    if summary.compute_us.len() < TIMES {
                        summary.compute_us.push(stats.compute_us);
                    }
                }
                if matches!(event, PhysicsEvent::Speculated(_)) {
                    self.shared.lock().summary.speculative += 1;
                }
                if let Some(node) = &mut self.node {
                    node.handle(self.start.elapsed(), NodeEvent::Physics(event));
                }
            }
            Err(error) => self.end = Some(Err(error.into())),
        }
    }

    fn client_output(&mut self, output: ClientOutput) {
        let mut state = self.shared.lock();
        match output {
            ClientOutput::Inserted(id) => state.appeared.push(id),
            ClientOutput::Removed(id) => state.disappeared.push(id),
            ClientOutput::Rejected { body, reason } => state.refusals.push((body, reason)),
            ClientOutput::Joined | ClientOutput::Lost => {}
            ClientOutput::Send { to, message } => self.links.send(to, &message),
            // A participant's node dials for both.
            ClientOutput::Redial if self.node.is_some() => {}
            ClientOutput::Redial => {
                drop(state);
                self.redial();
            }
            ClientOutput::Connect(member) => self.links.dial(Peer::Node(member.node), member.address),
            ClientOutput::Disconnect(node) => self.links.end(Peer::Node(node), Ending::NotTheLeader),
            ClientOutput::Node(message) => {
                drop(state);
                if let Some(node) = &mut self.node {
                    node.handle(self.start.elapsed(), NodeEvent::Client(message));
                }
            }
        }
    }
}

fn is_update(event: &ClientEvent) -> bool {
    match event {
        ClientEvent::Message { message: Message::ToClient(_, ToClient::States { states, .. }), .. }
        | ClientEvent::Node(ToClient::States { states, .. }) => !states.is_empty(),
        ClientEvent::Message { message: Message::ToClient(_, ToClient::CompactStates { .. }), .. }
        | ClientEvent::Node(ToClient::CompactStates { .. }) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::net::{Authority, JoinRole};
    use crate::runtime::JoinConfig;

    #[test]
    fn a_node_of_a_far_server_listens_where_that_server_and_others_reach_it() {
        for (server, listens) in
            [("127.0.0.1", "127.0.0.1"), ("192.0.2.7", "0.0.0.0"), ("::1", "::1"), ("2001:db8::7", "::")]
        {
            assert_eq!(interface_towards(server.parse().unwrap()), listens.parse::<IpAddr>().unwrap());
        }
        let loopback = reachable("0.0.0.0:7".parse().unwrap(), "127.0.0.1:9".parse().unwrap());
        assert_eq!(loopback, "127.0.0.1:7".parse().unwrap());
    }

    #[test]
    fn a_server_that_lives_but_never_answers_does_not_keep_a_node() {
        let folder = tempfile::tempdir().unwrap();
        let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
        let net = NetConfig {
            listen: "127.0.0.1:0".parse().unwrap(),
            identity: authority.server_identity().unwrap(),
            authority: Some(authority.clone()),
            renewed_by: None,
            limits: Limits::default(),
        };
        let (net, _events) = Net::start(net).unwrap();
        let now = std::time::SystemTime::now();
        let token = authority.issue_token(JoinRole::Node, Duration::from_secs(60), now).unwrap();
        let join = JoinConfig::new(net.local_addr(), token.to_string());
        let node =
            Member::start(MemberConfig::new(net.local_addr(), join.join(JoinRole::Node).unwrap())).unwrap();
        node.leave();
        assert!(node.wait_over(2 * RELEASE), "it must not wait for ever");
        let error = node.finish().unwrap_err();
        assert!(matches!(error, ProcessError::NotReleased { waited: RELEASE, .. }), "{error}");
    }
}
