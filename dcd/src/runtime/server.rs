//! Starts and ends a server as a process. Its loop has a thread of its own, and shares with the user what the
//! user reads.

mod backup;
mod event_loop;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::mpsc::{self, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ring::rand::{SecureRandom, SystemRandom};

use self::event_loop::Loop;
use super::config::check_viewpoints;
use super::directory::{self, GoesOn, Opened};
use super::end_request::EndRequests;
use super::ending::{Cause, Reason};
use super::inbox::{Inbox, InboxSender, inbox};
use super::links::Links;
use super::metrics::ServerMetrics;
use super::origin::{Beginning, world_of};
use super::saved::{local_of, saved_of};
use super::{Connections, LocalWorld, Origin, ProcessError, Pulse, ServeConfig, WorldError};
use crate::cluster::directory::{Batch, Directory, DirectoryError, Entry, Key};
use crate::cluster::{
    DrainError, Grouping, Record, SavedWorld, ServerConfig, ServerOrigin, Verification, highest_names,
    movable_bodies,
};
use crate::fidelity::FidelityReport;
use crate::metrics::Endpoint;
use crate::net::{
    Authority, HeldEvent, JoinRole, Limits, Net, NetConfig, NetError, PeerName, PeerStats, check_address,
};
use crate::physics::{ShapeLibrary, can_build};
use crate::priority::give_way;
use crate::protocol::{BuildOp, EnvironmentProperties, Query, QueryResult, View, WorldEvents};
use crate::recording::{Background, RecordedServer, Recorder};
use crate::space::{BodyId, DistributionTree, NodeId, Tick, Viewpoint};

/// How long nodes may take to report what they own, for a save. A node that hangs is given up within seconds.
const SAVING: Duration = Duration::from_secs(30);
/// How long a node may take to hand its regions over.
const DRAINING: Duration = Duration::from_secs(30);

/// The reason that a server which keeps its world gives at its end.
pub(crate) const SUSPENDED: &str = "the server has stopped, and the world is kept";

/// A summary of the world, from the server's record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServerSummary {
    /// The last tick that all members are known to have completed.
    pub tick: Tick,
    /// The number of movable bodies on record.
    pub bodies: usize,
    /// The number of regions of the world.
    pub regions: usize,
    /// The number of members now.
    pub nodes: usize,
    /// The number of membership changes since the start of the server.
    pub views: u64,
    /// How often the regions changed since then without a change of membership, since they follow the load.
    pub repartitions: u64,
    /// The number of bodies that no node owned in the last audit.
    pub lost: usize,
    /// The number of bodies that two nodes owned in the last audit.
    pub doubled: usize,
    /// Says whether members did not answer the last audit, or not in time, so that nobody knows what is lost or doubled.
    pub unaudited: bool,
    /// A hash of all movable bodies in id order, after the last tick of a world that ended by
    /// [`ServeConfig::last_tick`].
    pub state_hash: Option<u64>,
    /// The bytes received and sent.
    pub bytes: u64,
    /// The seconds since the world first began, or went on.
    pub seconds: f64,
    /// Says whether the server was suspended and its data folder keeps the world. A world that never began is not
    /// kept.
    pub kept: bool,
}

/// A running server.
pub struct ServerProcess {
    inbox: InboxSender<Input>,
    shared: Arc<Shared>,
    /// The state machine. It belongs to the loop; others only read it.
    server: Arc<Mutex<RecordedServer>>,
    thread: Option<JoinHandle<()>>,
    authority: Arc<Authority>,
    connections: Connections,
    /// The metrics endpoint, until the server is suspended.
    metrics: Mutex<Option<Endpoint>>,
    metrics_address: Option<SocketAddr>,
    /// The address at which the server listens.
    pub address: SocketAddr,
    /// The tick from which the server goes on with a stored world. The nodes may be ahead of it already.
    pub resumed: Option<Tick>,
    /// The ids of the first body and the first joint that the server's program may make.
    pub next_ids: (u32, u64),
    /// The properties of the world, with the regions with which it began.
    properties: Box<EnvironmentProperties>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    summary: ServerSummary,
    view: Option<View>,
    /// How many of the program's changes were done.
    changes: u64,
    /// Answers to queries of the program, by number, and contacts that it has not taken.
    answers: BTreeMap<u64, QueryResult>,
    events: WorldEvents,
    traffic: PeerStats,
    /// The time at which the loop last turned.
    turned: Option<Instant>,
    over: bool,
    suspended: bool,
    failure: Option<ProcessError>,
}

impl State {
    /// Shows the membership of the main group, or that no node computes the world.
    fn show(&mut self, view: Option<&View>) {
        if self.view.as_ref() == view {
            return;
        }
        self.summary.nodes = view.map_or(0, |view| view.members.len());
        if let Some(view) = view {
            self.summary.regions = view.allocation.len();
        }
        self.view = view.cloned();
    }
}

enum Input {
    Net(HeldEvent),
    Stop,
    Suspend,
    /// Changes by the program, with the shapes that the program has made.
    Program(Vec<BuildOp>, Box<ShapeLibrary>),
    Look(Vec<Viewpoint>),
    Ask(Query),
    Forget(u64),
    /// Drains a node. The sender reports when the node is gone, or why it stays.
    Drain(NodeId, SyncSender<Result<(), DrainError>>),
    /// Asks for what is stored.
    Copy(SyncSender<Result<Vec<Entry>, DirectoryError>>),
    /// Asks for the world as it is after one tick.
    Save(SyncSender<SavedWorld>),
    /// Replaces the world. The sender reports the next ids once that is done.
    Replace(Box<SavedWorld>, SyncSender<(u32, u64)>),
    /// Wakes the loop, since its connections have work.
    Wake,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ServerProcess {
    /// Starts a server on a thread of its own. A standby server waits until no other server serves the world.
    pub fn start(origin: Origin<'_>, config: ServeConfig) -> Result<Self, ProcessError> {
        Self::start_from(Beginning::of(origin)?, config)
    }

    /// Does the same with a prepared beginning of the world.
    pub(crate) fn start_from(beginning: Beginning, config: ServeConfig) -> Result<Self, ProcessError> {
        let started = Self::start_or_stand_by(beginning, config, &mut |_, _| true)?;
        started.ok_or_else(|| ProcessError::Ended("this server was not to wait on".to_owned()))
    }

    /// Does the same; returns `None` if `goes_on` ended the wait.
    pub(crate) fn start_or_stand_by(
        beginning: Beginning,
        config: ServeConfig,
        goes_on: GoesOn<'_>,
    ) -> Result<Option<Self>, ProcessError> {
        let (environment, record) = world_of(beginning, &config)?;
        if let Some(path) = &config.record {
            Background::check(path).map_err(|cause| ProcessError::Record { path: path.clone(), cause })?;
        }
        // Checked first: a port that is taken leaves no new folder and no begun recording behind, and a
        // stored world as it is.
        check_address(config.listen)?;
        config.metrics.map_or(Ok(()), super::metrics::check)?;
        let Some(opened) = directory::open(&config, &environment, goes_on)? else { return Ok(None) };
        let Opened { mut directory, authority, folder_lock } = opened;
        let entries = directory.load()?;
        if !config.fresh {
            directory::check_same(&entries, &environment, &config)?;
        }
        keep_names(&authority, &entries)?;
        let net = NetConfig {
            listen: config.listen,
            identity: authority.server_identity()?,
            authority: Some(authority.clone()),
            renewed_by: Vec::new(),
            limits: Limits::default(),
        };
        let (net, events) = Net::start(net)?;
        let address = net.local_addr();
        let (inbox, inputs) = inbox();
        let to = inbox.clone();
        events.pass_to(move |held| to.tell(Input::Net(held)));
        let waker = inbox.clone();
        let connections = Connections::new(PeerName::Server, move || waker.wake(Input::Wake));
        let shared = Arc::new(Shared { state: Mutex::default(), changed: Condvar::new() });
        let properties = Box::new(environment.clone());
        shared.lock().summary.regions = properties.tree.leaf_count();
        let server_config = ServerConfig {
            world: environment,
            incarnation: by_chance()?,
            min_nodes: config.nodes.max(1),
            grouping: Grouping { verification: drawn_by_chance(config.verify)?, ..config.groups.grouping },
            avatar_expiry: config.avatar_expiry,
            events: config.events,
            can_build,
        };
        let stored = entries.iter().find(|entry| entry.key == Key::World).map(|entry| entry.revision);
        let stored = stored.filter(|_| !config.fresh);
        let origin = origin_of(directory.as_mut(), entries, record, config.fresh)?;
        let goes_on = matches!(origin, ServerOrigin::Stored(_));
        let recorder = config.record.as_deref().map(|path| record_to(path, &server_config, &origin));
        let server = RecordedServer::begin(server_config, origin, recorder.transpose()?)?;
        let resumed = goes_on.then(|| server.tick());
        let next_ids = server.next_ids();
        let server = Arc::new(Mutex::new(server));
        let metrics = config.metrics.map(|address| {
            let metrics = Arc::new(ServerMetrics::new(server.clone()));
            super::metrics::start(address, metrics.clone()).map(|endpoint| (endpoint, metrics))
        });
        let (endpoint, metrics) = metrics.transpose()?.unzip();
        let running = Loop {
            links: Some(Links::new(net, connections.clone())),
            connections: connections.clone(),
            directory,
            authority: authority.clone(),
            folder_lock,
            end_requests: EndRequests::of(&config.data),
            stored,
            record: config.record,
            start: Instant::now(),
            server: server.clone(),
            shared: shared.clone(),
            metrics,
            began: None,
            count_at: Instant::now(),
            savers: Vec::new(),
            drains: Vec::new(),
            end_by: None,
            over: false,
        };
        let thread = spawn(running, inputs)?;
        Ok(Some(Self {
            inbox,
            shared,
            server,
            thread: Some(thread),
            authority,
            connections,
            metrics_address: endpoint.as_ref().map(Endpoint::address),
            metrics: Mutex::new(endpoint),
            address,
            resumed,
            next_ids,
            properties,
        }))
    }

    /// Returns the speed limit of dynamic bodies of the world, m/s.
    pub(crate) fn speed_limit_m_s(&self) -> f32 {
        self.properties.step.speed_limit_m_s
    }

    /// Returns the connections with nodes and clients, including those whose links broke a moment ago.
    pub fn connections(&self) -> &Connections {
        &self.connections
    }

    /// Mints a token with which one process of this role can join.
    pub fn token(&self, role: JoinRole, valid_for: Duration) -> Result<String, ProcessError> {
        let now = std::time::SystemTime::now();
        Ok(self.authority.issue_token(role, valid_for, now)?.to_string())
    }

    /// Returns a summary of the world so far.
    pub fn summary(&self) -> ServerSummary {
        self.shared.lock().summary.clone()
    }

    /// Returns what the main group saves and costs by not computing all in full, as its leader last reported.
    pub(crate) fn fidelity_report(&self) -> Option<FidelityReport> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner).fidelity_report()
    }

    /// Returns a function that reports when the server's loop last turned, and the state of the server.
    pub fn pulse(&self) -> impl Fn() -> Pulse + Send + 'static {
        let (shared, begun) = (self.shared.clone(), Instant::now());
        move || {
            let state = shared.lock();
            let ServerSummary { tick, bodies, nodes, .. } = &state.summary;
            let words = format!("tick {}, {bodies} bodies, {nodes} nodes", tick.0);
            Pulse { turned: state.turned.unwrap_or(begun), words }
        }
    }

    /// Returns the address of the server's metrics endpoint, if it has one.
    pub fn metrics_address(&self) -> Option<SocketAddr> {
        self.metrics_address
    }

    /// Returns the traffic over the network, as of a tenth of a second ago; with more than sixteen links, as
    /// of the count before.
    pub fn traffic(&self) -> PeerStats {
        self.shared.lock().traffic
    }

    /// Returns the membership, while nodes compute the world.
    pub fn view(&self) -> Option<View> {
        self.shared.lock().view.clone()
    }

    /// Returns how the world is cut into regions.
    pub fn tree(&self) -> DistributionTree {
        self.view().map_or_else(|| self.properties.tree.clone(), |view| view.tree)
    }

    /// Waits until the condition holds for summary and membership, the server has ended, or the time is up.
    /// Returns whether it was one of the first two.
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

    /// Takes the error with which the server had to stop, if there is one. Later calls return an error in the
    /// same words: of the same kind if a bug or a disk caused it, otherwise [`ProcessError::Ended`].
    pub fn failure(&self) -> Option<ProcessError> {
        let mut state = self.shared.lock();
        let failure = state.failure.take()?;
        state.failure = Some(failure.again());
        Some(failure)
    }

    /// Returns whether the server does not compute and keep its world any more: it has failed, was suspended,
    /// or has ended.
    pub(crate) fn is_gone(&self) -> bool {
        let state = self.shared.lock();
        state.failure.is_some() || state.suspended || state.over
    }

    /// Returns whether the world has ended.
    pub fn is_over(&self) -> bool {
        self.shared.lock().over
    }

    /// Changes the world by these operations, in order. The change is on record some milliseconds later, and
    /// computed some ticks later. The caller must have checked the bodies: nodes refuse a server that sends
    /// invalid ones. Each insertion brings the shapes of its bodies, since the world forgets shapes that no
    /// body has any more. Shapes that are known already cost nothing.
    pub fn change(&self, ops: Vec<BuildOp>) {
        self.change_with(ops, ShapeLibrary::default());
    }

    /// Does the same. Shapes of new bodies that are not on record, or not any more, are taken from `shapes`.
    pub(crate) fn change_with(&self, ops: Vec<BuildOp>, shapes: ShapeLibrary) {
        let _ = self.inbox.send(Input::Program(ops, Box::new(shapes)));
    }

    /// Returns how many calls of [`ServerProcess::change`] were done.
    pub(crate) fn changes_done(&self) -> u64 {
        self.shared.lock().changes
    }

    /// Sets the viewpoints of the server's program. From some tick on, what is seen from them is computed in
    /// full; they replace the program's former ones.
    pub fn look(&self, viewpoints: &[Viewpoint]) -> Result<(), WorldError> {
        check_viewpoints(viewpoints)?;
        let _ = self.inbox.send(Input::Look(viewpoints.to_vec()));
        Ok(())
    }

    /// Sends a query to the nodes. [`ServerProcess::take_answer`] returns the answer some ticks later, or
    /// once there are nodes. The query's number must differ from those of other queries.
    pub fn ask(&self, question: Query) {
        let _ = self.inbox.send(Input::Ask(question));
    }

    /// Takes the answer to a query, if it has come. Each answer is given once.
    pub fn take_answer(&self, number: u64) -> Option<QueryResult> {
        self.shared.lock().answers.remove(&number)
    }

    /// Cancels a query: its answer is dropped.
    pub fn forget(&self, number: u64) {
        let _ = self.inbox.send(Input::Forget(number));
    }

    /// Takes the contacts since the last call, of bodies that ask for them ([`ServeConfig::events`]). If they
    /// are many, only the newest are kept.
    pub fn take_events(&self) -> WorldEvents {
        std::mem::take(&mut self.shared.lock().events)
    }

    /// Reads the record of the world: each body as the nodes last reported it, at most half a second ago.
    pub fn read<R>(&self, read: impl FnOnce(&Record) -> R) -> R {
        read(self.server.lock().unwrap_or_else(PoisonError::into_inner).record())
    }

    /// Returns the user data of a body that is or was in the world.
    pub(crate) fn user_data(&self, id: BodyId) -> Option<u128> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner).user_data(id)
    }

    /// Returns a copy of the world as it is after one tick, from what its nodes report. They stop for some
    /// ticks meanwhile.
    pub fn save(&self) -> Result<LocalWorld, ProcessError> {
        let (saver, saved) = mpsc::sync_channel(1);
        let _ = self.inbox.send(Input::Save(saver));
        let saved = saved.recv_timeout(SAVING).map_err(|error| match error {
            RecvTimeoutError::Timeout => {
                let server = self.server.lock().unwrap_or_else(PoisonError::into_inner);
                ProcessError::NotSaved { waited: SAVING, linked: server.linked_nodes().count() }
            }
            RecvTimeoutError::Disconnected => ProcessError::Ended("the world has ended".to_owned()),
        })?;
        let viewpoints = self.server.lock().unwrap_or_else(PoisonError::into_inner).viewpoints().to_vec();
        let properties = EnvironmentProperties { viewpoints, ..(*self.properties).clone() };
        Ok(local_of(saved, &properties)?)
    }

    /// Takes a node out of the world: others take its regions over, and the node ends in order. Returns when
    /// it is gone.
    pub fn drain(&self, node: NodeId) -> Result<(), DrainError> {
        let (sender, drained) = mpsc::sync_channel(1);
        let _ = self.inbox.send(Input::Drain(node, sender));
        let drained = drained.recv_timeout(DRAINING).map_err(|error| match error {
            RecvTimeoutError::Timeout => DrainError::Slow(node),
            RecvTimeoutError::Disconnected => DrainError::Over(node),
        });
        match drained.flatten() {
            Err(DrainError::Gone(_)) if !self.authority.has_named(node) => Err(DrainError::Unknown(node)),
            drained => drained,
        }
    }

    /// Writes a data folder from which another server goes on with the world as this server's successor would
    /// if it died now: the authority, the record of joins, and the stored world, at most some seconds old.
    /// The folder must not exist yet. Returns the number of movable bodies.
    pub fn back_up(&self, folder: &Path) -> Result<usize, ProcessError> {
        let (sender, copied) = mpsc::sync_channel(1);
        let _ = self.inbox.send(Input::Copy(sender));
        let copied = copied.recv().map_err(|_| ProcessError::Ended("the world has ended".to_owned()))?;
        let entries = copied?;
        let bodies = movable_bodies(&entries);
        backup::write(folder, entries, &self.authority)?;
        Ok(bodies)
    }

    /// Replaces the world by a copy of a local world, which may be a saved one. From then on that copy is the
    /// record, and nodes and clients begin anew with it. Avatars belong to their clients: those that are in
    /// both worlds go to where they were in the copy, and none is added or removed. Returns the ids of the
    /// next body and the next joint that the program may make.
    pub fn replace(&self, world: &LocalWorld) -> Result<(u32, u64), ProcessError> {
        let saved = Box::new(saved_of(world, &self.properties)?);
        let (replacer, replaced) = mpsc::sync_channel(1);
        let _ = self.inbox.send(Input::Replace(saved, replacer));
        replaced.recv().map_err(|_| ProcessError::Ended("the world has ended".to_owned()))
    }

    /// Returns whether the server has stopped by [`ServerProcess::suspend`].
    pub fn is_suspended(&self) -> bool {
        self.shared.lock().suspended
    }

    /// Stores what is known of the world, stops the server, and waits for that. The world does not end: the
    /// data folder keeps it, nodes go on computing, and nodes and clients dial a server that is started again
    /// until they give up.
    pub fn suspend(&self) {
        let _ = self.inbox.send(Input::Suspend);
        let state = self.shared.lock();
        drop(self.shared.changed.wait_while(state, |state| !state.over));
        // The port is released here, since the handle stays: whoever hears of the end may start another
        // server.
        let metrics = self.metrics.lock().unwrap_or_else(PoisonError::into_inner).take();
        drop(metrics);
    }

    /// Audits the world, tells all processes that it ends, and waits for the end. Returns the error if
    /// something fails, as [`ServerProcess::failure`] does.
    pub fn stop(mut self) -> Result<ServerSummary, ProcessError> {
        self.end();
        self.failure().map_or_else(|| Ok(self.summary()), Err)
    }

    /// Does the same, but leaves the handle, which tells how the server ended. If the server is over already,
    /// this changes nothing.
    pub(crate) fn end(&mut self) {
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

/// Gives no name of the stored world to another process, also where the record of joins is lost or older than
/// the world.
fn keep_names(authority: &Authority, entries: &[Entry]) -> Result<(), NetError> {
    let (node, client) = highest_names(entries);
    if authority.keep_names(node, client)? {
        tracing::warn!(
            %node,
            %client,
            "the record of joins (joins.log) does not know all nodes and clients of the stored world: it is lost, or older than the world. \
             No name is given twice, but tokens that were used let processes in again until they expire. Put joins.log back from a \
             backup if there is one: stop the server first"
        );
    }
    Ok(())
}

/// Returns what the server begins with: the stored world, unless it is to be forgotten.
fn origin_of(
    directory: &mut dyn Directory,
    entries: Vec<Entry>,
    record: Record,
    fresh: bool,
) -> Result<ServerOrigin, DirectoryError> {
    if fresh {
        forget(directory, &entries)?;
        return Ok(ServerOrigin::Instead(record, entries));
    }
    Ok(if entries.is_empty() { ServerOrigin::New(record) } else { ServerOrigin::Stored(entries) })
}

/// Returns the drawing of participants to be verified, from a random seed that nobody else can know.
fn drawn_by_chance(share: f64) -> Result<Verification, ProcessError> {
    Ok(Verification { share, seed: by_chance()? })
}

fn by_chance() -> Result<u64, ProcessError> {
    let mut bytes = [0; 8];
    let random = SystemRandom::new().fill(&mut bytes);
    random.map_err(|_| NetError::Tls("the system gives no random bytes".to_owned()))?;
    Ok(u64::from_le_bytes(bytes))
}

fn record_to(path: &Path, config: &ServerConfig, origin: &ServerOrigin) -> Result<Recorder, ProcessError> {
    let recorder = Background::create(path).and_then(|file| Recorder::of_server(file, config, origin));
    recorder.map_err(|cause| ProcessError::Record { path: path.to_owned(), cause })
}

/// Runs the loop on a thread of its own. A bug in it ends the server, but not the process.
fn spawn(running: Loop, inputs: Inbox<Input>) -> Result<JoinHandle<()>, ProcessError> {
    let run = move || {
        give_way();
        let (shared, connections) = (running.shared.clone(), running.connections.clone());
        let (metrics, authority) = (running.metrics.clone(), running.authority.clone());
        if catch_unwind(AssertUnwindSafe(|| running.run(&inputs))).is_err() {
            authority.close_ledger();
            let mut state = shared.lock();
            (state.failure, state.over) = (Some(ProcessError::Fault), true);
            drop(state);
            shared.changed.notify_all();
            metrics.iter().for_each(|metrics| metrics.failed());
            connections.end(Reason::new(Cause::Failed, ProcessError::Fault.to_string()));
        }
    };
    std::thread::Builder::new().name("dcd-server".into()).spawn(run).map_err(ProcessError::Thread)
}

/// Removes entries from a directory.
fn forget(directory: &mut dyn Directory, entries: &[Entry]) -> Result<(), DirectoryError> {
    let writes = entries.iter().map(|entry| (entry.key, None)).collect();
    directory.commit(&Batch { writes, durable: true }, &[]).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::WorldConfig;

    #[test]
    fn a_server_that_has_stopped_leaves_its_folder_and_its_address_to_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let world = LocalWorld::new(WorldConfig::default()).unwrap();
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let config = || ServeConfig { metrics: Some(free), ..ServeConfig::new(folder.path()) };
        let start = || ServerProcess::start(Origin::World(&world), config());
        let former = start().unwrap();
        former.suspend();
        assert_eq!(former.metrics_address(), Some(free));
        // The handle of the suspended server is still there.
        drop(start().unwrap());
        assert!(!former.authority.has_named(NodeId(1)));
        drop(start().unwrap());
        drop(former);
    }

    #[test]
    fn a_fault_is_told_as_one_to_all_who_ask() {
        let folder = tempfile::tempdir().unwrap();
        let world = LocalWorld::new(WorldConfig::default()).unwrap();
        let server = ServerProcess::start(Origin::World(&world), ServeConfig::new(folder.path())).unwrap();
        server.shared.lock().failure = Some(ProcessError::Fault);
        for _ in 0..3 {
            assert!(matches!(server.failure(), Some(ProcessError::Fault)));
        }
    }
}
