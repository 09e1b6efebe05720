//! Runs a server as a process: one thread feeds network events to the server's state machine and carries out its outputs.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rapier3d::prelude::IntegrationParameters;
use tracing::{debug, error, info, warn};

use super::end_request::EndRequests;
use super::ending::{Cause, Reason};
use super::links::{LinkEvent, Links};
use super::member::forward;
use super::{
    Connections, LocalWorld, Partitioning, ProcessError, RedbDirectory, Why, WorldConfig, WorldError,
};
use crate::cluster::directory::{Batch, Condition, Directory, DirectoryError, Entry, Key, Revision};
use crate::cluster::{
    Grouping, ProgramOp, Record, Server, ServerConfig, ServerEvent, ServerOutput, WORLD_ENDED,
};
use crate::net::{
    Authority, JoinRole, Limits, Net, NetConfig, NetEvent, NetTotals, PeerName, PeerStats, check_address,
};
use crate::physics::{Coupling, Partition, RegionHost, ShapeLibrary, StepSettings, can_build};
use crate::protocol::{
    BodyKind, BodyRecord, EnvironmentProperties, JointRecord, Pace, ShapeRecord, StateHasher, SyncProtocol,
    Thresholds, View,
};
use crate::scene::Scene;
use crate::space::{Balance, DistributionTree, Epoch, Tick};

/// How often sending is tried again where a link had no room.
const RETRY: Duration = Duration::from_millis(2);
/// How long the loop sleeps when nothing is due.
const IDLE: Duration = Duration::from_millis(500);
/// How long avatars wait for their client.
pub(crate) const AVATAR_EXPIRY: Duration = Duration::from_secs(3_600);
/// Time-out of the last audit: dead members are found much sooner.
const AUDIT: Duration = Duration::from_secs(10);
/// Events that may wait for the loop; beyond that the network holds its peers back.
const QUEUE: usize = 4_096;

/// What a server that keeps its world says at its end.
pub(crate) const SUSPENDED: &str = "the server has stopped, and its data folder keeps the world";

/// The initial state of a served world: a scene, or a copy of a local world.
pub enum Origin<'a> {
    /// A scene; of the configuration only the cut and the step settings count.
    Scene(&'a Scene, &'a WorldConfig),
    /// A world as it is now, with its cut and settings, copied. What is not a property of a body or joint stays behind:
    /// contacts under load begin anew, and the tick begins at 0.
    World(&'a LocalWorld),
}

/// The settings of a server.
#[derive(Clone, Debug)]
pub struct ServeConfig {
    /// Where to listen; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Folder of the authority (keys, used tokens) and of the world: a server that died and is started again with the same
    /// origin and settings goes on with it.
    pub data: PathBuf,
    /// Begin anew, and forget a world that is stored there.
    pub fresh: bool,
    /// Nodes to wait for before the first tick.
    pub nodes: usize,
    /// How fast ticks follow one another.
    pub pace: Pace,
    /// Stop after this tick.
    pub last_tick: Option<Tick>,
    /// The fastest that avatars may be asked to move, m/s.
    pub avatar_speed_limit: f32,
    /// How long the avatars of a client that left wait for its return; then they are removed.
    pub avatar_expiry: Duration,
    /// How members of a group keep in step, which nodes may share a group, and how far apart groups may be.
    pub groups: GroupConfig,
}

impl ServeConfig {
    /// Returns the usual settings: any free port of this machine alone, one node to wait for, in real time, until it is stopped,
    /// avatars of up to 20 m/s that wait an hour for their client.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 0)),
            data: data.into(),
            fresh: false,
            nodes: 1,
            pace: Pace::RealTime,
            last_tick: None,
            avatar_speed_limit: 20.0,
            avatar_expiry: AVATAR_EXPIRY,
            groups: GroupConfig::default(),
        }
    }
}

/// The settings of groups of nodes: lockstep or not, thresholds, sizes, votes.
#[derive(Clone, Debug, Default)]
pub struct GroupConfig {
    /// Members run ahead of one another by at most so many ticks and extrapolate (the thesis's unsynchronised mode); 0: lockstep.
    /// With the coupling `owner` only.
    pub lag_ticks: u32,
    /// Thresholds of delay and distance of groups.
    pub thresholds: Thresholds,
    /// Sizes, policies, votes.
    pub grouping: Grouping,
}

/// A summary of the world, from the server's record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServerSummary {
    /// The last tick that all members completed, as far as known.
    pub tick: Tick,
    /// Movable bodies on record.
    pub bodies: usize,
    /// Regions of the world.
    pub regions: usize,
    /// Members now.
    pub nodes: usize,
    /// Membership changes since the start of the server.
    pub views: u64,
    /// How often the regions changed since then without a change of membership: they follow the load.
    pub repartitions: u64,
    /// Bodies that no node owned in the last audit.
    pub lost: usize,
    /// Bodies that two nodes owned in the last audit.
    pub doubled: usize,
    /// Members did not answer the last audit in time: nobody knows what is lost or doubled.
    pub unaudited: bool,
    /// Hash of all movable bodies in id order, after the last tick of a world that ended by [`ServeConfig::last_tick`].
    pub state_hash: Option<u64>,
    /// Bytes received and sent.
    pub bytes: u64,
    /// Seconds since the world first began, or went on.
    pub seconds: f64,
    /// The server was suspended, and its data folder keeps the world. One that never began is not kept.
    pub kept: bool,
}

/// A running server.
pub struct ServerProcess {
    inbox: SyncSender<Input>,
    shared: Arc<Shared>,
    /// The loop's; others only read it.
    server: Arc<Mutex<Server>>,
    thread: Option<JoinHandle<()>>,
    authority: Arc<Authority>,
    connections: Connections,
    /// Where it listens.
    pub address: SocketAddr,
    /// The tick from which it goes on with a world that was stored; the nodes may be farther already.
    pub resumed: Option<Tick>,
    /// Of the first body and the first joint that its program may make.
    pub next_ids: (u32, u64),
    /// The regions of the world.
    pub tree: DistributionTree,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    summary: ServerSummary,
    view: Option<View>,
    traffic: PeerStats,
    over: bool,
    suspended: bool,
    failure: Option<ProcessError>,
}

enum Input {
    Net(NetEvent),
    Stop,
    Suspend,
    Program(Vec<ProgramOp>),
    /// Wakes the loop: there is work for its connections.
    Wake,
}

impl From<NetEvent> for Input {
    fn from(event: NetEvent) -> Self {
        Self::Net(event)
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ServerProcess {
    /// Starts a server on a thread of its own.
    pub fn start(origin: Origin<'_>, config: ServeConfig) -> Result<Self, ProcessError> {
        let (environment, record) = world_of(Beginning::of(origin)?, &config)?;
        // A port that is taken leaves no new folder behind.
        check_address(config.listen)?;
        let authority = Arc::new(Authority::load_or_create(&config.data)?);
        let net = NetConfig {
            listen: config.listen,
            identity: authority.server_identity()?,
            authority: Some(authority.clone()),
            renewed_by: None,
            limits: Limits::default(),
        };
        let (net, events) = Net::start(net)?;
        let address = net.local_addr();
        let (inbox, inputs) = mpsc::sync_channel(QUEUE);
        forward(events, inbox.clone())?;
        let waker = inbox.clone();
        // A loop whose inbox is full is awake.
        let connections = Connections::new(PeerName::Server, move || drop(waker.try_send(Input::Wake)));
        let shared = Arc::new(Shared { state: Mutex::default(), changed: Condvar::new() });
        let tree = environment.tree.clone();
        shared.lock().summary.regions = tree.leaf_count();
        let mut directory = match config.fresh {
            true => RedbDirectory::open_or_replace(&config.data)?,
            false => RedbDirectory::open(&config.data)?,
        };
        let entries = directory.load()?;
        let server_config = ServerConfig {
            world: environment,
            min_nodes: config.nodes.max(1),
            grouping: config.groups.grouping,
            avatar_expiry: config.avatar_expiry,
            can_build,
        };
        let (mut stored, mut resumed) = (None, None);
        let server = if config.fresh {
            forget(&mut directory, &entries)?;
            Server::instead(server_config, record, &entries)
        } else if entries.is_empty() {
            Server::new(server_config, record)
        } else {
            stored = entries.iter().find(|entry| entry.key == Key::World).map(|entry| entry.revision);
            let server = Server::restore(server_config, entries)?;
            resumed = Some(server.tick());
            server
        };
        let next_ids = server.next_ids();
        let server = Arc::new(Mutex::new(server));
        let running = Loop {
            links: Some(Links::new(net, connections.clone())),
            connections: connections.clone(),
            directory,
            end_requests: EndRequests::of(&config.data),
            stored,
            start: Instant::now(),
            server: server.clone(),
            shared: shared.clone(),
            began: None,
            end_by: None,
            audited: false,
            over: false,
        };
        let thread = std::thread::Builder::new()
            .name("dcd-server".into())
            .spawn(move || {
                let (shared, connections) = (running.shared.clone(), running.connections.clone());
                if catch_unwind(AssertUnwindSafe(|| running.run(&inputs))).is_err() {
                    let mut state = shared.lock();
                    (state.failure, state.over) = (Some(ProcessError::Fault), true);
                    drop(state);
                    shared.changed.notify_all();
                    connections.end(Reason::new(Cause::Failed, ProcessError::Fault.to_string()));
                }
            })
            .map_err(ProcessError::Thread)?;
        Ok(Self {
            inbox,
            shared,
            server,
            thread: Some(thread),
            authority,
            connections,
            address,
            resumed,
            next_ids,
            tree,
        })
    }

    /// Returns the connections with nodes and clients, also those whose links broke a moment ago.
    pub fn connections(&self) -> &Connections {
        &self.connections
    }

    /// Mints a token for one process of this role to join with.
    pub fn token(&self, role: JoinRole, valid_for: Duration) -> Result<String, ProcessError> {
        let now = std::time::SystemTime::now();
        Ok(self.authority.issue_token(role, valid_for, now)?.to_string())
    }

    /// Returns a summary of the world so far.
    pub fn summary(&self) -> ServerSummary {
        self.shared.lock().summary.clone()
    }

    /// Returns the traffic over the network.
    pub fn traffic(&self) -> PeerStats {
        self.shared.lock().traffic
    }

    /// Returns the membership, while nodes compute the world.
    pub fn view(&self) -> Option<View> {
        self.shared.lock().view.clone()
    }

    /// Waits until the condition holds for summary and membership, or the time is up; returns which.
    pub fn wait(
        &self,
        timeout: Duration,
        mut until: impl FnMut(&ServerSummary, Option<&View>) -> bool,
    ) -> bool {
        let (_state, timed_out) = self
            .shared
            .changed
            .wait_timeout_while(self.shared.lock(), timeout, |state| {
                !state.over && !until(&state.summary, state.view.as_ref())
            })
            .unwrap_or_else(PoisonError::into_inner);
        !timed_out.timed_out()
    }

    /// Takes the error with which the server had to stop, if it had to.
    pub fn failure(&self) -> Option<ProcessError> {
        self.shared.lock().failure.take()
    }

    /// Returns whether the world has ended.
    pub fn is_over(&self) -> bool {
        self.shared.lock().over
    }

    /// Changes the world, in this order; it is on record some milliseconds later, and computed some ticks later. Bodies have been
    /// checked: nodes refuse a server that sends what may not be.
    pub fn change(&self, ops: Vec<ProgramOp>) {
        let _ = self.inbox.send(Input::Program(ops));
    }

    /// Reads the record of the world: every body as the nodes last told, at most half a second ago.
    pub fn read<R>(&self, read: impl FnOnce(&Record) -> R) -> R {
        read(self.server.lock().unwrap_or_else(PoisonError::into_inner).record())
    }

    /// Returns whether the server has stopped by [`ServerProcess::suspend`].
    pub fn is_suspended(&self) -> bool {
        self.shared.lock().suspended
    }

    /// Writes down what is known of the world, stops the server, and waits for that. The world does not end: nodes compute on
    /// and dial a server that is started again, for a while, and the data folder keeps it.
    pub fn suspend(&self) {
        let _ = self.inbox.send(Input::Suspend);
        let state = self.shared.lock();
        let _over = self.shared.changed.wait_while(state, |state| !state.over);
    }

    /// Audits the world, tells all processes that it ends, and waits for the end.
    pub fn stop(mut self) -> ServerSummary {
        self.end();
        self.summary()
    }

    fn end(&mut self) {
        let _ = self.inbox.send(Input::Stop);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        if self.thread.is_some() {
            self.end();
        }
    }
}

/// The values that a served world begins with.
struct Beginning {
    tree: DistributionTree,
    balance: Option<Balance>,
    halo_m: Option<f64>,
    step: StepSettings,
    shapes: Vec<ShapeRecord>,
    bodies: Vec<BodyRecord>,
    joints: Vec<JointRecord>,
}

impl Beginning {
    fn of(origin: Origin<'_>) -> Result<Self, ProcessError> {
        match origin {
            Origin::Scene(scene, config) => {
                config.check()?;
                let mut shapes = ShapeLibrary::default();
                let (bodies, joints) = scene.records(&mut shapes)?;
                let (tree, halo_m, step) = (config.tree()?, config.halo_m, config.step);
                let is_uncut = matches!(config.partitioning, Partitioning::Auto);
                let balance = config.balance.or_else(|| is_uncut.then(Balance::by_nodes));
                Ok(Self { tree, balance, halo_m, step, shapes: shapes.records(), bodies, joints })
            }
            Origin::World(world) => {
                let host = world.host();
                let movable = host.owned_bodies().map(|(_, region, handle)| region.body_record(handle));
                let mut bodies: Vec<_> = movable.chain(host.scenery().cloned()).collect();
                bodies.sort_unstable_by_key(|body| body.id);
                // Its owner in the other world means nothing in this one.
                bodies.iter_mut().for_each(|body| body.epoch = Epoch(0));
                let joints: BTreeMap<_, _> = bodies
                    .iter()
                    .flat_map(|body| host.joints_of(body.id))
                    .map(|joint| (joint.id, joint))
                    .collect();
                let is_cut = matches!(world.chosen().why, Why::Asked | Why::Saved);
                Ok(Self {
                    tree: host.partition().tree().clone(),
                    balance: host.balance().copied().or_else(|| (!is_cut).then(Balance::by_nodes)),
                    // An empty world has none, unless it was given.
                    halo_m: Some(host.partition().halo_m()).filter(|halo_m| *halo_m > 0.0),
                    step: *host.settings(),
                    shapes: host.shapes().records(),
                    bodies,
                    joints: joints.into_values().collect(),
                })
            }
        }
    }
}

/// Returns the properties of the world as sent to all processes. The halo is that of a local world with the same bodies, so that
/// both compute the same bits.
fn world_of(
    beginning: Beginning,
    config: &ServeConfig,
) -> Result<(EnvironmentProperties, Record), ProcessError> {
    let Beginning { tree, balance, halo_m, step, shapes, bodies, joints } = beginning;
    if step.integration != IntegrationParameters::default() {
        let range = "a served world is stepped with Rapier's own parameters: leave them at their defaults";
        let (what, value) = ("step.integration", "changed".to_owned());
        return Err(WorldError::Setting { what, value, range }.into());
    }
    let mut host = RegionHost::new(Partition::new(tree.clone(), halo_m), step, 1, &[])?;
    for record in &shapes {
        host.shapes_mut().add(record.clone())?;
    }
    host.insert(bodies.clone(), &joints)?;
    let record = Record::new(bodies, shapes, joints);
    let lag_ticks = config.groups.lag_ticks;
    if lag_ticks > 0 && step.coupling != Coupling::Owner {
        return Err(ProcessError::Lag { coupling: step.coupling.name() });
    }
    let protocol = match lag_ticks {
        0 => SyncProtocol::Synchronised,
        lag_ticks => SyncProtocol::Unsynchronised { lag_ticks },
    };
    // With lag, bodies are sent later, so that the halo must reach farther ahead.
    let ahead_m = f64::from(config.avatar_speed_limit * step.dt_s) * f64::from(lag_ticks);
    // A world that its program fills later has the halo of what comes, as a local one.
    let is_empty = record.present().all(|body| body.traits.kind == BodyKind::Fixed);
    let halo_m = if is_empty && lag_ticks == 0 { halo_m } else { Some(host.partition().halo_m() + ahead_m) };
    let environment = EnvironmentProperties {
        world: record.fingerprint(),
        step: step.record(),
        tree,
        balance,
        halo_m,
        avatar_speed_limit: config.avatar_speed_limit,
        protocol,
        thresholds: config.groups.thresholds,
        pace: config.pace,
        last_tick: config.last_tick,
    };
    Ok((environment, record))
}

/// Removes entries from a directory.
fn forget(directory: &mut RedbDirectory, entries: &[Entry]) -> Result<(), DirectoryError> {
    let writes = entries.iter().map(|entry| (entry.key, None)).collect();
    directory.commit(&Batch { writes, durable: true }, &[]).map(|_| ())
}

struct Loop {
    links: Option<Links>,
    connections: Connections,
    directory: RedbDirectory,
    end_requests: EndRequests,
    /// The revision at which this server wrote the world's entry: whoever else writes it has taken over.
    stored: Option<Revision>,
    start: Instant,
    server: Arc<Mutex<Server>>,
    shared: Arc<Shared>,
    began: Option<Instant>,
    /// When the world ends even without an audit.
    end_by: Option<Instant>,
    audited: bool,
    over: bool,
}

impl Loop {
    fn run(mut self, inputs: &mpsc::Receiver<Input>) {
        while !self.over {
            let due = self.server().poll_timeout().map(|due| due.saturating_sub(self.start.elapsed()));
            let Some(links) = &mut self.links else { break };
            let wait = due.unwrap_or(IDLE).min(if links.flush(Instant::now()) { RETRY } else { IDLE });
            let input = inputs.recv_timeout(wait);
            let now = self.start.elapsed();
            match input {
                Ok(Input::Net(event)) => {
                    for event in links.translate(event) {
                        self.hear(now, event);
                    }
                }
                Ok(Input::Stop) => self.stop(now),
                Ok(Input::Suspend) => self.server().handle(now, ServerEvent::Suspend),
                Ok(Input::Program(ops)) => self.server().handle(now, ServerEvent::Program(ops)),
                Ok(Input::Wake) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            let now = self.start.elapsed();
            if self.server().poll_timeout().is_some_and(|due| due <= now) {
                self.server().handle_timeout(now);
            }
            if self.end_requests.take() {
                info!("the world is to end: its data folder has a request");
                self.stop(now);
            }
            self.send_away(now);
            self.pump();
            let given_up = self.links.as_mut().map(Links::take_given_up).unwrap_or_default();
            if !given_up.is_empty() {
                given_up.into_iter().for_each(|event| self.hear(now, event));
                self.pump();
            }
            self.publish();
            if !self.over && self.end_by.is_some_and(|by| by <= Instant::now()) {
                warn!("the last audit is given up: members do not answer");
                self.shared.lock().summary.unaudited = true;
                break;
            }
        }
        let totals = self.links.take().map(Links::shutdown);
        self.finish(totals);
    }

    fn server(&self) -> MutexGuard<'_, Server> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn stop(&mut self, now: Duration) {
        self.end_by.get_or_insert(Instant::now() + AUDIT);
        self.server().handle(now, ServerEvent::Stop);
    }

    fn hear(&mut self, now: Duration, event: LinkEvent) {
        match event {
            LinkEvent::Connected(_) => {}
            LinkEvent::Disconnected { peer, text, .. } => {
                info!(?peer, text, "a link is gone");
                self.server().handle(now, ServerEvent::Disconnected(peer));
            }
            LinkEvent::Message { from, message } => {
                self.server().handle(now, ServerEvent::Message { from, message });
            }
        }
    }

    /// Disconnects the processes that the user asked to disconnect.
    fn send_away(&mut self, now: Duration) {
        for (who, reason) in self.connections.take_sent_away() {
            info!(%who, reason, "sent away");
            let (node, client) = (who.node(), who.client());
            self.server().handle(now, ServerEvent::SendAway { node, client, reason });
        }
    }

    fn pump(&mut self) {
        loop {
            let output = self.server().poll_output();
            let Some(output) = output else { return };
            let Some(links) = &mut self.links else { return };
            match output {
                ServerOutput::Send { to, message } => links.send(to, &message),
                ServerOutput::Close { peer, farewell, reason } => links.close(peer, farewell.into(), &reason),
                ServerOutput::Store(batch) => {
                    if let Err(error) = self.store(&batch) {
                        error!(%error, "the server cannot go on");
                        self.shared.lock().failure = Some(error.into());
                        self.over = true;
                        return;
                    }
                }
                ServerOutput::Dissolved(group) => info!(%group, "a group is no more"),
                ServerOutput::Expelled(node) => warn!(%node, "the world goes on without a node"),
                ServerOutput::Began { group, view } if group != self.server().main_group() => {
                    info!(%group, view = view.number.0, members = view.members.len(), "a view begins");
                }
                ServerOutput::Began { view, .. } => {
                    self.began.get_or_insert_with(Instant::now);
                    info!(view = view.number.0, members = view.members.len(), "a view begins");
                    let mut state = self.shared.lock();
                    state.summary.views += 1;
                    state.summary.bodies = movable(&self.server()).count();
                    state.summary.nodes = view.members.len();
                    state.summary.regions = view.allocation.len();
                    state.view = Some(view);
                }
                ServerOutput::Repartitioned { group, view } => {
                    debug!(%group, view = view.number.0, regions = view.allocation.len(), "regions follow the load");
                    if group == self.server().main_group() {
                        let mut state = self.shared.lock();
                        state.summary.repartitions += 1;
                        state.summary.regions = view.allocation.len();
                        state.view = Some(view);
                    }
                }
                ServerOutput::Held(tick) => {
                    warn!(tick = tick.0, "no node is left; the world waits for one");
                    let mut state = self.shared.lock();
                    state.summary.nodes = 0;
                    state.view = None;
                }
                ServerOutput::Audited { lost, doubled } => {
                    let mut state = self.shared.lock();
                    (state.summary.lost, state.summary.doubled) = (lost.len(), doubled.len());
                    self.audited = true;
                }
                ServerOutput::Ended => {
                    self.forget();
                    self.over = true;
                }
                ServerOutput::Suspended => {
                    let kept = self.server().has_begun();
                    if !kept {
                        self.forget();
                    }
                    let mut state = self.shared.lock();
                    (state.suspended, state.summary.kept) = (true, kept);
                    self.over = true;
                }
            }
        }
    }

    fn store(&mut self, batch: &Batch) -> Result<(), DirectoryError> {
        let revision = self.directory.commit(batch, &[Condition { key: Key::World, at: self.stored }])?;
        if batch.writes.iter().any(|(key, _)| *key == Key::World) {
            self.stored = Some(revision);
        }
        Ok(())
    }

    /// Clears the directory: a world that has ended, or never began, leaves nothing to go on with.
    fn forget(&mut self) {
        let cleared = self.directory.load().and_then(|entries| {
            let writes = entries.into_iter().map(|entry| (entry.key, None)).collect();
            self.store(&Batch { writes, durable: true })
        });
        if let Err(error) = cleared {
            warn!(%error, "what is stored of the world stays");
        }
    }

    fn publish(&mut self) {
        let mut state = self.shared.lock();
        state.summary.tick = self.server().tick();
        state.summary.seconds = self.began.map_or(0.0, |began| began.elapsed().as_secs_f64());
        if let Some(links) = &self.links {
            let traffic = links.totals().traffic;
            state.traffic = traffic;
            state.summary.bytes = traffic.bytes_in + traffic.bytes_out;
        }
        drop(state);
        self.shared.changed.notify_all();
    }

    fn finish(self, totals: Option<NetTotals>) {
        // Whoever hears of the end may start another server here.
        let Self { directory, server, shared, connections, .. } = self;
        drop(directory);
        let server = server.lock().unwrap_or_else(PoisonError::into_inner);
        let mut hasher = StateHasher::default();
        for body in movable(&server) {
            hasher.add(body.id, &body.state.pose, &body.state.velocity);
        }
        let mut state = shared.lock();
        state.summary.bodies = movable(&server).count();
        state.summary.state_hash = Some(hasher.finish());
        if let Some(totals) = totals {
            state.summary.bytes = totals.traffic.bytes_in + totals.traffic.bytes_out;
        }
        state.over = true;
        let reason = match state.suspended {
            true => Reason::new(Cause::Left, SUSPENDED),
            false => Reason::new(Cause::WorldEnded, WORLD_ENDED),
        };
        drop(state);
        shared.changed.notify_all();
        connections.end(reason);
    }
}

fn movable(server: &Server) -> impl Iterator<Item = &crate::protocol::BodyRecord> {
    server.record().present().filter(|body| body.traits.kind != BodyKind::Fixed)
}
