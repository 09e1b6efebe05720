//! Builds a cluster in virtual time: processes with hosts and machines, the network between them, and the
//! checker that watches them.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use super::clock::Clock;
use super::config::SimConfig;
use super::host::{Host, Skew};
use super::network::{Cut, LinkId, Network, NetworkConditions, Traffic};
use super::{
    Checker, Engine, Flipped, Random, Sample, Scope, Sent, Spoilt, StandIn, Tally, Tape, Timeline, Violation,
    Watch, drifting, sim_world,
};
use crate::cluster::directory::{Directory, MemoryDirectory};
use crate::cluster::{
    Client, ClientEvent, ClientOutput, Grouping, Node, NodeConfig, NodeEvent, Peer, Record, SavedWorld,
    Server, ServerConfig, ServerEvent, ServerOrigin, Verification,
};
use crate::protocol::{Area, BodyKind, BodyState, EnvironmentProperties, Finding};
use crate::recording::{RecordedServer, Recorder};
use crate::space::{BodyId, ClientId, GroupId, NodeId, Tick};

/// The first id of clients that nobody plays.
const UNPLAYED: u32 = 10_000;

#[derive(Debug)]
pub(super) struct NodeProcess {
    pub(super) machine: Node,
    pub(super) physics: Box<dyn Engine>,
    pub(super) recorder: Option<Recorder>,
    /// The time at which the last answer of the physics comes. The physics does one thing after the other.
    pub(super) physics_until: Duration,
    /// The same for each run that computes other members' work once more. Runs do not wait for one another.
    pub(super) verified_until: BTreeMap<u64, Duration>,
    /// The client in the same process.
    pub(super) client: Option<ClientId>,
}

/// A running cluster.
#[derive(Debug)]
pub struct Sim {
    pub(super) config: SimConfig,
    pub(super) now: Duration,
    pub(super) random: Random,
    pub(super) network: Network,
    pub(super) hosts: BTreeMap<Peer, Host>,
    /// The server; `None` while it is dead.
    pub(super) server: Option<RecordedServer>,
    pub(super) disk: MemoryDirectory,
    pub(super) nodes: BTreeMap<NodeId, NodeProcess>,
    pub(super) clients: BTreeMap<ClientId, Client>,
    /// The clients whose certificates let them build.
    pub(super) builders: BTreeSet<ClientId>,
    pub(super) checker: Checker,
    pub(super) violation: Option<Violation>,
    pub(super) events: u64,
    /// The number of events at this instant.
    pub(super) at_once: u32,
    pub(super) tally: Tally,
    pub(super) timeline: Timeline,
    /// The leader of each group's newest view that the server began.
    pub(super) leaders: BTreeMap<GroupId, NodeId>,
    /// The number of members with which each node computed last, itself included.
    pub(super) company: BTreeMap<NodeId, usize>,
    /// The nodes that were expelled from a group of several members.
    pub(super) expelled: Vec<NodeId>,
    /// What leaders have found out about participants that were verified.
    pub(super) findings: Vec<(NodeId, Tick, Finding)>,
    /// The time at which a tick of each group was last checked.
    pub(super) checked_at: BTreeMap<GroupId, Duration>,
    /// The number of outputs after which the server dies, counted from its next durable batch on.
    pub(super) crash_after_store: Option<u32>,
    pub(super) has_stored: bool,
    /// Says whether the server has died of that.
    pub(super) server_crashed: bool,
    /// What the server's program saved last.
    pub(super) saved: Option<Box<SavedWorld>>,
    /// The node that takes longer than the others, and how many times as long.
    pub(super) slow_node: Option<(NodeId, f64)>,
    /// How many times longer it takes to compute other members' work once more.
    pub(super) slow_verifier: f64,
    /// Bugs to plant: the number of transfers still to be dropped, and how all others are spoilt.
    pub(super) drop_transfers: u32,
    pub(super) spoilt: Option<Spoilt>,
    /// The node that claims that its bodies are faster than they are, and the node that it tells so.
    pub(super) liar: Option<(NodeId, NodeId)>,
    /// The watch over what bodies do, if there is one.
    pub(super) watch: Option<Watch>,
    /// The outputs of clients' machines for their users, for tests.
    pub(super) told: Vec<(ClientId, ClientOutput)>,
    /// The messages sent, by purpose.
    pub(super) sent: BTreeMap<Scope, Sent>,
    /// The recordings of nodes and servers by name, including those that died.
    pub(super) tapes: BTreeMap<String, Tape>,
    /// The node on which a bit is to be flipped and the tick after which, and the bit that was flipped.
    pub(super) flip_at: Option<(NodeId, Tick)>,
    pub(super) flipped: Option<Flipped>,
    /// The number of ticks between samples, and the samples that were not taken yet.
    pub(super) sample_every: Option<u64>,
    pub(super) samples: Vec<Sample>,
    engine: fn() -> Box<dyn Engine>,
    server_config: ServerConfig,
    last_node: NodeId,
    last_client: ClientId,
}

impl Sim {
    /// Creates a server with a world of bodies that fly straight on, and nodes that are about to join.
    pub fn new(config: SimConfig) -> Self {
        let mut random = Random::new(config.seed);
        let bodies: Vec<_> = (0..config.bodies)
            .map(|i| drifting(BodyId::persistent(i), config.speed_m_s, &mut random))
            .collect();
        let mut world = sim_world(config.regions);
        world.step.dt_s = config.dt_s;
        let record = Record::new(bodies, Vec::new(), Vec::new());
        Self::start(config, world, record, || Box::<StandIn>::default(), random)
    }

    /// Creates a cluster with another world and another physics. The fields `regions`, `bodies`, `speed_m_s`
    /// and `dt_s` of the configuration do not count.
    pub fn with_world(
        config: SimConfig,
        world: EnvironmentProperties,
        record: Record,
        engine: fn() -> Box<dyn Engine>,
    ) -> Self {
        let random = Random::new(config.seed);
        Self::start(config, world, record, engine, random)
    }

    fn start(
        config: SimConfig,
        mut world: EnvironmentProperties,
        record: Record,
        engine: fn() -> Box<dyn Engine>,
        mut random: Random,
    ) -> Self {
        let movable = record.present().filter(|body| body.traits.kind != BodyKind::Fixed);
        let checker = Checker::new(movable.map(|body| body.id), config.protocol.lag_ticks());
        (world.thresholds, world.protocol) = (config.thresholds, config.protocol);
        world.balance = config.balance.or(world.balance);
        world.state_every = config.state_every;
        world.relays_above = config.relays_above;
        let server_config = ServerConfig {
            world,
            incarnation: config.seed,
            min_nodes: config.nodes.max(1) as usize,
            grouping: Grouping {
                verification: Verification { share: f64::from(u8::from(config.verify)), seed: config.seed },
                ..config.grouping.clone()
            },
            avatar_expiry: Duration::from_secs(3_600),
            events: false,
            can_build: |_, _| true,
        };
        let mut tapes = BTreeMap::new();
        let origin = ServerOrigin::New(record);
        let server = begin_server(&mut tapes, config.record, &server_config, origin);
        let network = Network::new(config.network.clone(), config.bounds, random.bits());
        let mut sim = Self {
            now: Duration::ZERO,
            random,
            network,
            hosts: BTreeMap::new(),
            server: Some(server),
            server_config,
            disk: MemoryDirectory::new(),
            nodes: BTreeMap::new(),
            clients: BTreeMap::new(),
            builders: BTreeSet::new(),
            checker,
            violation: None,
            events: 0,
            at_once: 0,
            tally: Tally::default(),
            timeline: Timeline::default(),
            leaders: BTreeMap::new(),
            company: BTreeMap::new(),
            expelled: Vec::new(),
            findings: Vec::new(),
            checked_at: BTreeMap::new(),
            crash_after_store: None,
            has_stored: false,
            server_crashed: false,
            saved: None,
            slow_node: None,
            slow_verifier: 1.0,
            drop_transfers: 0,
            spoilt: None,
            liar: None,
            watch: None,
            told: Vec::new(),
            sent: BTreeMap::new(),
            tapes,
            flip_at: None,
            flipped: None,
            sample_every: None,
            samples: Vec::new(),
            engine,
            last_node: NodeId(0),
            last_client: ClientId(0),
            config,
        };
        sim.host(Peer::Server, true);
        for _ in 0..sim.config.nodes {
            sim.start_node();
        }
        sim.drain_server();
        sim
    }

    /// Starts one more node, which joins.
    pub fn start_node(&mut self) -> NodeId {
        self.start_process(None)
    }

    /// Starts a client and a node in one process (the thesis's normal participant). With an id, the client is
    /// one that was there before.
    pub fn start_participant(&mut self, again: Option<ClientId>) -> (NodeId, ClientId) {
        let client = again.unwrap_or_else(|| self.new_client_id());
        let node = self.start_process(Some(client));
        self.clients.insert(client, Client::new(client, Some(node), None));
        self.host(Peer::Client(client), false);
        self.network.dial(self.now, Peer::Client(client), Peer::Server);
        (node, client)
    }

    fn start_process(&mut self, client: Option<ClientId>) -> NodeId {
        self.last_node.0 += 1;
        let id = self.last_node;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, id.0 as u16));
        let unplayed = (self.config.verify && id.0 % 3 != 1).then_some(ClientId(UNPLAYED + id.0));
        let config = NodeConfig {
            id,
            address,
            client: client.or(unplayed),
            interest: None,
            checkpoint_every: self.config.checkpoint_every,
            patience: Duration::from_millis(100),
        };
        let physics = (self.engine)();
        let tape = self.config.record.then(|| self.tapes.entry(id.to_string()).or_default());
        let recorder = tape.map(|tape| tape.recorder(&config, physics.is_stand_in()));
        let machine = Node::new(config);
        let process = NodeProcess {
            machine,
            physics,
            recorder,
            physics_until: Duration::ZERO,
            verified_until: BTreeMap::new(),
            client,
        };
        self.nodes.insert(id, process);
        self.host(Peer::Node(id), self.now.is_zero());
        self.network.dial(self.now, Peer::Node(id), Peer::Server);
        id
    }

    /// Starts a client, which joins. With an id, it is one that was there before.
    pub fn start_client(&mut self, again: Option<ClientId>) -> ClientId {
        let id = again.unwrap_or_else(|| self.new_client_id());
        self.start_client_near(id, None)
    }

    /// Starts a client that wants to be told only of the world's part in an area.
    pub fn start_client_in(&mut self, area: Area) -> ClientId {
        let id = self.new_client_id();
        self.start_client_near(id, Some(area))
    }

    fn start_client_near(&mut self, id: ClientId, area: Option<Area>) -> ClientId {
        self.clients.insert(id, Client::new(id, None, area));
        self.host(Peer::Client(id), false);
        self.network.dial(self.now, Peer::Client(id), Peer::Server);
        id
    }

    /// Starts a client that may build.
    pub fn start_builder(&mut self) -> ClientId {
        let id = self.new_client_id();
        self.builders.insert(id);
        self.start_client_near(id, None)
    }

    fn new_client_id(&mut self) -> ClientId {
        self.last_client.0 += 1;
        self.last_client
    }

    /// Starts a process with a clock of its own. A veteran's clock began some time before the simulation.
    fn host(&mut self, who: Peer, veteran: bool) {
        let clock = match self.config.skew {
            None => Clock::new(Duration::ZERO, Duration::ZERO, 0),
            Some(Skew { offset, drift_ppm }) => {
                let shown = if veteran { self.random.up_to(2 * offset) } else { Duration::ZERO };
                let drift_ppm = self.random.below(2 * drift_ppm as u64 + 1) as i64 - drift_ppm;
                Clock::new(self.now, shown, drift_ppm)
            }
        };
        self.hosts.insert(who, Host::new(clock));
        self.network.start(self.now, who);
    }

    /// Flips a bit of a body on a node once it has completed this tick or a later one.
    pub fn flip(&mut self, node: NodeId, tick: Tick) {
        self.flip_at = Some((node, tick));
    }

    /// Returns the bit that was flipped, if any.
    pub fn flipped(&self) -> Option<&Flipped> {
        self.flipped.as_ref()
    }

    /// Ends the recordings of all nodes and servers, and returns them by their names.
    pub fn take_recordings(&mut self) -> BTreeMap<String, Tape> {
        self.nodes.values_mut().for_each(|process| process.recorder = None);
        if let Some(server) = &mut self.server {
            server.finish().expect("memory can be written");
        }
        std::mem::take(&mut self.tapes)
    }

    /// Kills a process from one instant to the next.
    pub fn crash(&mut self, peer: Peer) {
        self.note(|| format!("{} is killed", name(peer)));
        self.end(peer);
    }

    /// Ends a process. With a node, the client in its process ends too.
    pub(super) fn end(&mut self, peer: Peer) {
        match peer {
            Peer::Node(node) => {
                let client = self.nodes.remove(&node).and_then(|process| process.client);
                self.checker.forget_node(node);
                if let Some(client) = client {
                    self.end(Peer::Client(client));
                }
            }
            Peer::Client(client) => {
                self.clients.remove(&client);
                self.checker.forget_client(client);
            }
            Peer::Server => {
                self.server = None;
                // Of the batches that are not durable, the first few are kept.
                let mut kept = self.random.below(self.disk.unsynced() as u64 + 1);
                self.disk.crash(|_| {
                    let is_kept = kept > 0;
                    kept = kept.saturating_sub(1);
                    is_kept
                });
            }
        }
        self.hosts.remove(&peer);
        self.network.crash(self.now, peer);
    }

    /// Kills the server once it has stored a durable output and has executed this many of the outputs that
    /// follow. With 0, kills it at its next output.
    pub fn crash_after_store(&mut self, outputs: u32) {
        self.crash_after_store = Some(outputs);
    }

    /// Restarts the server from its record.
    ///
    /// # Panics
    /// When the server lives, or cannot go on from its record.
    pub fn restart_server(&mut self) {
        assert!(self.server.is_none(), "the server lives");
        self.note(|| "the server starts again".into());
        let entries = self.disk.load().expect("memory can be read");
        let origin = ServerOrigin::Stored(entries);
        let server = begin_server(&mut self.tapes, self.config.record, &self.server_config, origin);
        self.server = Some(server);
        self.host(Peer::Server, false);
        self.drain_server();
        self.set_timer(Peer::Server);
    }

    /// Stops a process (SIGSTOP): it handles nothing until it is resumed.
    pub fn stop(&mut self, peer: Peer) {
        self.note(|| format!("{} is stopped", name(peer)));
        if let Some(host) = self.hosts.get_mut(&peer) {
            host.stopped = true;
            self.network.stop(self.now, peer);
        }
    }

    /// Hangs a process: it does nothing any more, while its network still sends keep-alives.
    pub fn hang(&mut self, peer: Peer) {
        self.note(|| format!("{} hangs", name(peer)));
        if let Some(host) = self.hosts.get_mut(&peer) {
            host.stopped = true;
        }
    }

    /// Resumes a stopped process (SIGCONT).
    pub fn resume(&mut self, peer: Peer) {
        self.note(|| format!("{} is resumed", name(peer)));
        let ended = self.network.resume(self.now, peer);
        let Some(host) = self.hosts.get_mut(&peer) else { return };
        host.stopped = false;
        host.busy_until = self.now;
        let is_over = |link: &Option<LinkId>| link.is_some_and(|link| ended.contains(&link));
        let (over, left) = std::mem::take(&mut host.mailbox).into_iter().partition(|d| is_over(&d.link));
        host.mailbox = left;
        over.iter().for_each(|delivery| self.network.read(delivery));
        while let Some(delivery) = self.network.take() {
            match self.hosts.get_mut(&delivery.to) {
                Some(host) if delivery.to == peer => host.mailbox.push_front(delivery),
                _ => self.deliver(delivery),
            }
        }
    }

    /// Slows a process: from now on every event costs it this time.
    pub fn slow(&mut self, peer: Peer, cost: Duration) {
        self.note(|| format!("{} takes {} us an event", name(peer), cost.as_micros()));
        if let Some(host) = self.hosts.get_mut(&peer) {
            host.cost = cost;
        }
    }

    /// Makes a node take this many times as long as the others from now on, for whatever it computes.
    pub fn slow_down(&mut self, node: NodeId, times: f64) {
        self.note(|| format!("{node} is {times} times slower"));
        self.slow_node = Some((node, times));
    }

    /// Places a process at this site from now on.
    pub fn place(&mut self, peer: Peer, site: u32) {
        self.network.conditions.sites.insert(peer, site);
    }

    /// Sets the network conditions from now on.
    pub fn set_network(&mut self, conditions: NetworkConditions) {
        self.network.conditions = conditions;
    }

    /// Applies a cut until its end.
    pub fn cut(&mut self, cut: Cut) {
        self.network.cut(self.now, cut);
    }

    /// Cuts these processes off from all others for a time.
    pub fn isolate(&mut self, island: BTreeSet<Peer>, time: Duration) {
        for cut in Cut::partition(island, self.now + time) {
            self.cut(cut);
        }
    }

    /// Breaks the link between two processes. Both live, and can call each other.
    pub fn break_link(&mut self, a: Peer, b: Peer) {
        self.network.break_link(a, b);
        self.deliver_all();
    }

    /// Asks a node to leave.
    pub fn leave(&mut self, node: NodeId) {
        self.node_event(node, NodeEvent::Leave);
    }

    /// Lets the server's program, or its operator, do something.
    ///
    /// # Panics
    /// When the server is dead.
    pub fn order(&mut self, event: ServerEvent) {
        assert!(self.server.is_some(), "the server is dead");
        self.server_event(event);
    }

    /// Returns what the server's program saved last, if anything.
    pub fn saved(&self) -> Option<&SavedWorld> {
        self.saved.as_deref()
    }

    /// Submits a user's input to a client.
    pub fn submit(&mut self, client: ClientId, input: ClientEvent) {
        self.client_event(client, input);
    }

    /// Plants a bug: the next transfers between nodes are lost.
    pub fn drop_transfers(&mut self, count: u32) {
        self.drop_transfers = count;
    }

    /// Plants a bug: from now on every transfer between nodes is spoilt.
    pub fn spoil_transfers(&mut self, how: Spoilt) {
        self.spoilt = Some(how);
    }

    /// Watches what bodies do from now on.
    pub fn watch(&mut self, watch: Watch) {
        self.watch = Some(watch);
    }

    /// Runs events until the condition holds. Returns the violation if an invariant is violated before.
    ///
    /// # Panics
    /// When the condition does not hold after 60 simulated seconds: the cluster is stuck.
    pub fn run_until(&mut self, mut holds: impl FnMut(&Self) -> bool) -> Result<(), Violation> {
        let deadline = self.now + Duration::from_secs(60);
        while !holds(self) {
            assert!(
                self.now < deadline,
                "stuck at {:?} of seed {}:\n{}",
                self.now,
                self.config.seed,
                self.timeline
            );
            // Where nothing happens, time passes.
            if !self.step(self.now + Duration::from_millis(100)) {
                self.events += 1;
            }
            if let Some(violation) = self.violation.take() {
                return Err(violation);
            }
        }
        Ok(())
    }

    /// Runs until this tick has been completed by every node of its view, and checked.
    pub fn run_to(&mut self, tick: Tick) -> Result<(), Violation> {
        self.run_until(|sim| sim.checker.last() >= tick)
    }

    /// Runs this many events.
    pub fn run_events(&mut self, count: u64) -> Result<(), Violation> {
        let target = self.events + count;
        self.run_until(|sim| sim.events >= target)
    }

    /// Runs for this time.
    pub fn run_for(&mut self, time: Duration) -> Result<(), Violation> {
        let end = self.now + time;
        while self.step(end) {
            if let Some(violation) = self.violation.take() {
                return Err(violation);
            }
        }
        Ok(())
    }

    /// Returns the newest tick that any live node has completed.
    pub fn tick(&self) -> Tick {
        self.nodes().map(Node::tick).max().unwrap_or_default()
    }

    /// Returns the simulated time.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Returns the server.
    ///
    /// # Panics
    /// While the server is dead.
    pub fn server(&self) -> &Server {
        self.server.as_ref().expect("the server lives")
    }

    /// Returns whether the server lives.
    pub fn has_server(&self) -> bool {
        self.server.is_some()
    }

    /// Returns a live client.
    pub fn client(&self, id: ClientId) -> &Client {
        &self.clients[&id]
    }

    /// Returns live nodes in id order.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.nodes.values().map(|node| &node.machine)
    }

    /// Returns the rounds of the last tick of each live node.
    pub fn rounds(&self) -> impl Iterator<Item = u32> {
        self.nodes.values().map(|node| node.physics.rounds())
    }

    /// Returns the checker.
    pub fn checker(&self) -> &Checker {
        &self.checker
    }

    /// Returns the outputs of clients' machines for their users.
    pub fn told(&self) -> &[(ClientId, ClientOutput)] {
        &self.told
    }

    /// Returns the counts of events.
    pub fn tally(&self) -> Tally {
        Tally { ticks: self.checker.checked(), ..self.tally }
    }

    /// Returns the statistics of the network.
    pub fn traffic(&self) -> Traffic {
        self.network.traffic()
    }

    /// Returns the messages sent, by purpose, including those that were lost.
    pub fn sent(&self) -> &BTreeMap<Scope, Sent> {
        &self.sent
    }

    /// Samples every node after every tick from now on that is a multiple of `ticks`.
    pub fn sample_every(&mut self, ticks: u64) {
        self.sample_every = Some(ticks);
    }

    /// Returns the samples since the last call, in the order in which nodes completed ticks.
    pub fn take_samples(&mut self) -> Vec<Sample> {
        std::mem::take(&mut self.samples)
    }

    /// Returns the timeline of events, for people.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Returns the states of all owned bodies.
    pub fn states(&self) -> BTreeMap<BodyId, BodyState> {
        let claims = |node: &NodeProcess| node.physics.claims();
        self.nodes
            .values()
            .flat_map(|node| {
                claims(node).into_iter().filter_map(|claim| Some((claim.id, node.physics.state(claim.id)?)))
            })
            .collect()
    }

    /// Returns the state of a body as its owner has it.
    pub fn state(&self, id: BodyId) -> Option<BodyState> {
        self.nodes.values().find_map(|node| node.physics.state(id))
    }

    pub(super) fn note(&mut self, what: impl FnOnce() -> String) {
        self.timeline.note(self.now, what());
    }
}

/// Begins a server. If it is to be recorded, it has a tape of its own.
fn begin_server(
    tapes: &mut BTreeMap<String, Tape>,
    is_recorded: bool,
    config: &ServerConfig,
    origin: ServerOrigin,
) -> RecordedServer {
    let recorder = is_recorded.then(|| {
        let tape = Tape::default();
        let before = tapes.keys().filter(|name| name.starts_with("server")).count();
        tapes.insert(format!("server-{}", before + 1), tape.clone());
        Recorder::of_server(tape, config, &origin).expect("memory can be written")
    });
    RecordedServer::begin(config.clone(), origin, recorder).expect("what a server writes can be read")
}

/// Returns the name of a process in timelines.
pub(super) fn name(peer: Peer) -> String {
    match peer {
        Peer::Server => "the server".into(),
        Peer::Node(node) => node.to_string(),
        Peer::Client(client) => client.to_string(),
    }
}
