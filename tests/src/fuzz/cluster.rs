//! Runs a small cluster in memory over links without loss or delay, and writes down what each process was
//! given. These scripts are inputs as honest processes send them.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use dcd::cluster::directory::{Directory, Entry, MemoryDirectory};
use dcd::cluster::{
    Client, ClientEvent, ClientOutput, Node, NodeEvent, NodeOutput, Peer, Record, Server, ServerConfig,
    ServerEvent, ServerOutput,
};
use dcd::protocol::{
    DelayThresholds, EnvironmentProperties, Message, Program, SyncProtocol, Thresholds, encode,
};
use dcd::recording::Physics;
use dcd::sim::{sim_body, sim_world};
use dcd::{Balance, BodyId, BodyRecord, ClientId, NodeId, Velocity};

use super::nodes::{node_config, perform};
use super::script::{Kind, put};

/// An event of one process.
enum Happening {
    Said(Peer, Box<Message>),
    Connected(Peer),
    Disconnected(Peer),
}

/// Makes what computes the regions of a node.
pub(super) type MakePhysics = fn() -> Box<dyn Physics>;

/// The processes: a server, some nodes, one client.
pub(super) struct Cluster {
    now: Duration,
    server: Server,
    directory: MemoryDirectory,
    nodes: BTreeMap<NodeId, (Node, Box<dyn Physics>)>,
    client: Client,
    mail: VecDeque<(Peer, Happening)>,
    scripts: BTreeMap<Peer, (Duration, Vec<u8>)>,
    physics: MakePhysics,
}

/// Returns a world whose groups form by delay. In lockstep its regions also follow the load, and relays tell
/// its clients.
#[must_use]
pub(super) fn world(in_lockstep: bool) -> EnvironmentProperties {
    let lagging = SyncProtocol::Unsynchronised { lag_ticks: 2 };
    let delay = DelayThresholds { inclusion_ms: 100.0, rejection_ms: 200.0, deviation_ms: 50.0 };
    EnvironmentProperties {
        protocol: if in_lockstep { SyncProtocol::Synchronised } else { lagging },
        balance: in_lockstep.then(|| Balance { every_ticks: 4, smallest_edge_m: 1.0, ..Balance::default() }),
        thresholds: Thresholds { delay: Some(delay), ..Thresholds::default() },
        relays_above: in_lockstep.then_some(0),
        ..sim_world(4)
    }
}

/// Returns some bodies without colliders, on both sides of every border.
#[must_use]
pub(super) fn points() -> Record {
    let body = |index: u32| {
        let x = f64::from(index);
        let mut body = sim_body(BodyId::persistent(index), [1.0 + 2.0 * x, 1.0 + x / 2.0, 4.0]);
        body.state.velocity.linear = [3.0 - x as f32, 1.0, 0.0];
        body
    };
    Record::new((0..8).map(body).collect(), Vec::new(), Vec::new())
}

/// Returns the configuration of a server of this world.
#[must_use]
pub(super) fn server_config(world: EnvironmentProperties) -> ServerConfig {
    ServerConfig {
        world,
        incarnation: 1,
        min_nodes: 2,
        grouping: Default::default(),
        avatar_expiry: Duration::from_secs(2),
        events: true,
        can_build: |_, _| true,
    }
}

impl Cluster {
    /// Starts the server alone.
    #[must_use]
    pub(super) fn new(world: EnvironmentProperties, record: Record, physics: MakePhysics) -> Self {
        Self {
            now: Duration::ZERO,
            server: Server::new(server_config(world), record),
            directory: MemoryDirectory::new(),
            nodes: BTreeMap::new(),
            client: Client::new(ClientId(1), None, None),
            mail: VecDeque::new(),
            scripts: BTreeMap::new(),
            physics,
        }
    }

    /// Starts a node.
    pub(super) fn start_node(&mut self, id: u32) {
        let node = (Node::new(node_config(NodeId(id))), (self.physics)());
        self.nodes.insert(NodeId(id), node);
        self.link(Peer::Node(NodeId(id)), Peer::Server);
    }

    /// Starts the client.
    pub(super) fn start_client(&mut self) {
        self.link(Peer::Client(self.client.id()), Peer::Server);
    }

    /// Kills a node.
    pub(super) fn kill(&mut self, id: u32) {
        let dead = Peer::Node(NodeId(id));
        self.nodes.remove(&NodeId(id));
        let others: Vec<_> = self.nodes.keys().map(|&node| Peer::Node(node)).collect();
        let rest = [Peer::Server, Peer::Client(self.client.id())];
        for other in others.into_iter().chain(rest) {
            self.mail.push_back((other, Happening::Disconnected(dead)));
        }
    }

    /// Has the client create an avatar.
    pub(super) fn spawn(&mut self, body: BodyRecord) {
        self.client.handle(self.now, ClientEvent::Spawn { body, shapes: Vec::new() });
    }

    /// Has the client move an avatar.
    pub(super) fn steer(&mut self, body: BodyId, linear: [f32; 3]) {
        let velocity = Velocity { linear, angular: [0.0; 3] };
        self.client
            .handle(self.now, ClientEvent::Input { body, tick: Default::default(), velocity, pose: None });
    }

    /// Gives the server an event that comes from no other process.
    pub(super) fn command(&mut self, event: ServerEvent) {
        self.server.handle(self.now, event);
    }

    /// Lets time pass, and delivers messages and timeouts meanwhile.
    pub(super) fn run(&mut self, time: Duration) {
        let until = self.now + time;
        while self.now < until {
            self.settle();
            self.now += Duration::from_millis(1);
            self.wake();
        }
        self.settle();
    }

    /// Returns the script of what a process was given.
    #[must_use]
    pub(super) fn script(&self, of: Peer) -> Vec<u8> {
        self.scripts.get(&of).map(|(_, script)| script.clone()).unwrap_or_default()
    }

    /// Returns the entries that the server has stored.
    #[must_use]
    pub(super) fn stored(&mut self) -> Vec<Entry> {
        self.directory.load().expect("memory does not fail")
    }

    /// Returns the server.
    #[must_use]
    pub(super) fn server(&self) -> &Server {
        &self.server
    }

    /// Returns how many messages of others the nodes and the server have refused.
    #[must_use]
    pub(super) fn refused(&self) -> u64 {
        self.nodes.values().map(|(node, _)| node.counters().refused).sum()
    }

    fn link(&mut self, a: Peer, b: Peer) {
        self.mail.push_back((a, Happening::Connected(b)));
        self.mail.push_back((b, Happening::Connected(a)));
    }

    /// Handles the timeouts of all processes that are due.
    fn wake(&mut self) {
        let (now, is_due) = (self.now, |at: Option<Duration>| at.is_some_and(|at| at <= self.now));
        let server = is_due(self.server.poll_timeout());
        let client = is_due(self.client.poll_timeout());
        let nodes = self.nodes.iter().filter(|(_, (node, _))| is_due(node.poll_timeout()));
        let nodes: Vec<_> = nodes.map(|(&id, _)| id).collect();
        if server {
            self.note(Peer::Server, Kind::Waited, Peer::Server, &[]);
            self.server.handle_timeout(now);
        }
        if client {
            self.note(Peer::Client(self.client.id()), Kind::Waited, Peer::Server, &[]);
            self.client.handle_timeout(now);
        }
        for id in nodes {
            self.note(Peer::Node(id), Kind::Waited, Peer::Server, &[]);
            if let Some((node, _)) = self.nodes.get_mut(&id) {
                node.handle_timeout(now);
            }
        }
    }

    fn note(&mut self, of: Peer, kind: Kind, from: Peer, bytes: &[u8]) {
        let (before, script) = self.scripts.entry(of).or_default();
        put(script, kind, from, self.now - *before, bytes);
        *before = self.now;
    }

    /// Delivers messages until none is on its way.
    fn settle(&mut self) {
        loop {
            self.collect();
            let Some((to, happening)) = self.mail.pop_front() else { return };
            match &happening {
                Happening::Said(from, message) => self.note(to, Kind::Said, *from, &encode(message)),
                Happening::Connected(peer) => self.note(to, Kind::Connected, *peer, &[]),
                Happening::Disconnected(peer) => self.note(to, Kind::Disconnected, *peer, &[]),
            }
            self.deliver(to, happening);
        }
    }

    fn deliver(&mut self, to: Peer, happening: Happening) {
        let now = self.now;
        match to {
            Peer::Server => match happening {
                Happening::Said(from, message) => {
                    self.server.handle(now, ServerEvent::Message { from, message: *message });
                }
                Happening::Disconnected(peer) => self.server.handle(now, ServerEvent::Disconnected(peer)),
                Happening::Connected(_) => {}
            },
            Peer::Client(_) => {
                let event = match happening {
                    Happening::Said(from, message) => ClientEvent::Message { from, message: *message },
                    Happening::Connected(peer) => ClientEvent::Connected(peer),
                    Happening::Disconnected(peer) => ClientEvent::Disconnected(peer),
                };
                self.client.handle(now, event);
            }
            Peer::Node(id) => {
                let Some((node, _)) = self.nodes.get_mut(&id) else { return };
                let event = match happening {
                    Happening::Said(from, message) => NodeEvent::Message { from, message: *message },
                    Happening::Connected(peer) => NodeEvent::Connected(peer),
                    Happening::Disconnected(peer) => NodeEvent::Disconnected(peer),
                };
                node.handle(now, event);
            }
        }
    }

    /// Performs the outputs of all processes.
    fn collect(&mut self) {
        while let Some(output) = self.server.poll_output() {
            match output {
                ServerOutput::Send { to, message } => self.send(Peer::Server, to, message),
                ServerOutput::Store(batch) => {
                    self.directory.commit(&batch, &[]).expect("memory does not fail");
                }
                _ => {}
            }
        }
        let own = Peer::Client(self.client.id());
        while let Some(output) = self.client.poll_output() {
            match output {
                ClientOutput::Send { to, message } => self.send(own, to, message),
                ClientOutput::Connect(member) => self.link(own, Peer::Node(member.node)),
                ClientOutput::Redial => self.link(own, Peer::Server),
                _ => {}
            }
        }
        for id in self.nodes.keys().copied().collect::<Vec<_>>() {
            let outputs = match self.nodes.get_mut(&id) {
                Some((node, physics)) => perform(self.now, node, &mut **physics),
                None => Vec::new(),
            };
            let own = Peer::Node(id);
            for output in outputs {
                match output {
                    NodeOutput::Send { to, message } => self.send(own, to, message),
                    NodeOutput::Connect(member) if self.nodes.contains_key(&member.node) => {
                        self.link(own, Peer::Node(member.node));
                    }
                    NodeOutput::Connect(member) => {
                        self.mail.push_back((own, Happening::Disconnected(Peer::Node(member.node))));
                    }
                    NodeOutput::Redial => self.link(own, Peer::Server),
                    _ => {}
                }
            }
        }
    }

    fn send(&mut self, from: Peer, to: Peer, message: Message) {
        // The runtime takes these messages. The state machines never see them.
        if !matches!(message, Message::Program(Program::Taken(_))) {
            self.mail.push_back((to, Happening::Said(from, Box::new(message))));
        }
    }
}
