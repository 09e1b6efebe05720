//! A simulated cluster: processes, their links, and the loop that runs them.

use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use super::network::{Arrival, Network};
use super::{Checker, Random, StandIn, Violation, drifting, sim_world};
use crate::cluster::{
    Client, ClientEvent, ClientOutput, Node, NodeConfig, NodeEvent, NodeOutput, Peer, PhysicsEvent, Record,
    Server, ServerConfig, ServerEvent, ServerOutput,
};
use crate::protocol::{BodyState, DATAGRAM_BYTES, Message, ToClient, decode, encode};
use crate::space::{BodyId, ClientId, NodeId, Tick};

/// What a run is made of.
#[derive(Clone, Debug)]
pub struct SimConfig {
    /// Of everything random.
    pub seed: u64,
    /// Nodes at the start.
    pub nodes: u32,
    /// Regions of the world.
    pub regions: usize,
    /// Persistent bodies.
    pub bodies: u32,
    /// Longest delay of a message, microseconds; the shortest is a tenth of it.
    pub delay_us: u64,
}

#[derive(Clone, Debug)]
struct NodeProcess {
    machine: Node,
    physics: StandIn,
    /// In the same process.
    client: Option<ClientId>,
}

/// A running cluster.
#[derive(Clone, Debug)]
pub struct Sim {
    config: SimConfig,
    now: Duration,
    random: Random,
    network: Network,
    server: Server,
    nodes: BTreeMap<NodeId, NodeProcess>,
    clients: BTreeMap<ClientId, Client>,
    checker: Checker,
    violation: Option<Violation>,
    events: u64,
    /// Bugs to plant: transfers still to be dropped.
    drop_transfers: u32,
    /// What clients were told, for tests.
    told: Vec<(ClientId, ClientOutput)>,
    last_node: NodeId,
    last_client: ClientId,
}

impl Sim {
    /// A server with a world, and its nodes about to join.
    pub fn new(config: SimConfig) -> Self {
        let mut random = Random::new(config.seed);
        let bodies: Vec<_> =
            (0..config.bodies).map(|i| drifting(BodyId::persistent(i), &mut random)).collect();
        let checker = Checker::new(bodies.iter().map(|body| body.id));
        let server_config = ServerConfig {
            world: sim_world(config.regions),
            min_nodes: config.nodes.max(1) as usize,
            grouping: Default::default(),
        };
        let server = Server::new(server_config, Record::new(bodies, Vec::new(), Vec::new()));
        let mut sim = Self {
            now: Duration::ZERO,
            random,
            network: Network::default(),
            server,
            nodes: BTreeMap::new(),
            clients: BTreeMap::new(),
            checker,
            violation: None,
            events: 0,
            drop_transfers: 0,
            told: Vec::new(),
            last_node: NodeId(0),
            last_client: ClientId(0),
            config,
        };
        for _ in 0..sim.config.nodes {
            sim.start_node();
        }
        sim
    }

    /// A further node joins.
    pub fn start_node(&mut self) -> NodeId {
        self.start_process(None)
    }

    /// A client and a node in one process join (the thesis's normal participant).
    pub fn start_participant(&mut self) -> (NodeId, ClientId) {
        self.last_client.0 += 1;
        let client = self.last_client;
        let node = self.start_process(Some(client));
        self.clients.insert(client, Client::new(client, Some(node)));
        let time = self.later();
        self.network.connect(time, Peer::Client(client), Peer::Server);
        (node, client)
    }

    fn start_process(&mut self, client: Option<ClientId>) -> NodeId {
        self.last_node.0 += 1;
        let id = self.last_node;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, id.0 as u16));
        let machine = Node::new(NodeConfig {
            id,
            address,
            client,
            report_every: 3,
            checkpoint_every: 6,
            patience: Duration::from_millis(100),
        });
        self.nodes.insert(id, NodeProcess { machine, physics: StandIn::default(), client });
        let time = self.later();
        self.network.connect(time, Peer::Node(id), Peer::Server);
        id
    }

    /// A client joins; with an id, one that was there before.
    pub fn start_client(&mut self, again: Option<ClientId>) -> ClientId {
        let id = again.unwrap_or_else(|| {
            self.last_client.0 += 1;
            self.last_client
        });
        self.clients.insert(id, Client::new(id, None));
        let time = self.later();
        self.network.connect(time, Peer::Client(id), Peer::Server);
        id
    }

    /// A process is gone from one instant to the next.
    pub fn crash(&mut self, peer: Peer) {
        match peer {
            Peer::Node(node) => {
                let client = self.nodes.remove(&node).and_then(|process| process.client);
                self.checker.died();
                if let Some(client) = client {
                    self.crash(Peer::Client(client));
                }
            }
            Peer::Client(client) => drop(self.clients.remove(&client)),
            Peer::Server => panic!("the first cut does not survive the loss of its server"),
        }
        self.network.crash(self.now, peer, &mut self.random);
    }

    /// The link between two processes breaks; both live.
    pub fn cut(&mut self, a: Peer, b: Peer) {
        self.network.cut(self.now, a, b);
    }

    /// A node is asked to leave.
    pub fn leave(&mut self, node: NodeId) {
        self.node_event(node, NodeEvent::Leave);
    }

    /// A user's wish.
    pub fn wish(&mut self, client: ClientId, wish: ClientEvent) {
        self.client_event(client, wish);
    }

    /// Plants a bug: the next transfers between nodes are lost.
    pub fn drop_transfers(&mut self, count: u32) {
        self.drop_transfers = count;
    }

    /// Runs events until the condition holds; `Err` on a violation of the invariant.
    ///
    /// # Panics
    /// When it does not hold after 60 simulated seconds: the cluster is stuck.
    pub fn run_until(&mut self, mut holds: impl FnMut(&Self) -> bool) -> Result<(), Violation> {
        let deadline = self.now + Duration::from_secs(60);
        while !holds(self) {
            assert!(self.now < deadline, "stuck at {:?} of seed {}", self.now, self.config.seed);
            self.step();
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

    /// The newest tick that any live node has completed.
    pub fn tick(&self) -> Tick {
        self.nodes().map(Node::tick).max().unwrap_or_default()
    }

    /// The simulated time.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// The server.
    pub fn server(&self) -> &Server {
        &self.server
    }

    /// A live client.
    pub fn client(&self, id: ClientId) -> &Client {
        &self.clients[&id]
    }

    /// Live nodes in id order.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.nodes.values().map(|node| &node.machine)
    }

    /// Rounds of the last tick of each live node.
    pub fn rounds(&self) -> impl Iterator<Item = u32> {
        self.nodes.values().map(|node| node.physics.rounds())
    }

    /// The checker.
    pub fn checker(&self) -> &Checker {
        &self.checker
    }

    /// What clients were told.
    pub fn told(&self) -> &[(ClientId, ClientOutput)] {
        &self.told
    }

    /// The states of all owned bodies.
    pub fn states(&self) -> BTreeMap<BodyId, BodyState> {
        let claims = |node: &NodeProcess| node.physics.claims();
        self.nodes
            .values()
            .flat_map(|node| {
                claims(node).into_iter().filter_map(|claim| Some((claim.id, node.physics.state(claim.id)?)))
            })
            .collect()
    }

    fn later(&mut self) -> Duration {
        let least = self.config.delay_us / 10;
        self.now + Duration::from_micros(least + self.random.below(self.config.delay_us - least + 1))
    }

    /// The next arrival or timer.
    fn step(&mut self) {
        self.events += 1;
        let nodes =
            self.nodes.iter().filter_map(|(&id, node)| Some((node.machine.poll_timeout()?, Peer::Node(id))));
        let clients =
            self.clients.iter().filter_map(|(&id, client)| Some((client.poll_timeout()?, Peer::Client(id))));
        let server = self.server.poll_timeout().map(|time| (time, Peer::Server));
        let timer = nodes.chain(clients).chain(server).min();
        match (self.network.next_time(), timer) {
            (arrival, Some((time, peer))) if arrival.is_none_or(|arrival| time < arrival) => {
                self.now = self.now.max(time);
                self.alarm(peer);
            }
            (Some(_), _) => {
                let Some((time, to, arrival)) = self.network.pop() else { return };
                self.now = self.now.max(time);
                self.arrive(to, arrival);
            }
            (None, _) => self.now += Duration::from_millis(100),
        }
    }

    fn alarm(&mut self, peer: Peer) {
        match peer {
            Peer::Server => {
                self.server.handle_timeout(self.now);
                self.drain_server();
            }
            Peer::Node(node) => {
                if let Some(process) = self.nodes.get_mut(&node) {
                    process.machine.handle_timeout(self.now);
                }
                self.drain_node(node);
            }
            Peer::Client(id) => {
                if let Some(client) = self.clients.get_mut(&id) {
                    client.handle_timeout(self.now);
                }
                self.drain_client(id);
            }
        }
    }

    fn arrive(&mut self, to: Peer, arrival: Arrival) {
        let open = |bytes: Vec<u8>| decode(&bytes).expect("our own messages are valid");
        match to {
            Peer::Server => {
                match arrival {
                    Arrival::Disconnected(peer) => {
                        self.server.handle(self.now, ServerEvent::Disconnected(peer))
                    }
                    Arrival::Frame(from, bytes) => {
                        self.server.handle(self.now, ServerEvent::Message { from, message: open(bytes) });
                    }
                    Arrival::Connected(_) | Arrival::Physics(_) => {}
                }
                self.drain_server();
            }
            Peer::Node(node) => {
                let event = match arrival {
                    Arrival::Connected(peer) => NodeEvent::Connected(peer),
                    Arrival::Disconnected(peer) => NodeEvent::Disconnected(peer),
                    Arrival::Frame(from, bytes) => NodeEvent::Message { from, message: open(bytes) },
                    Arrival::Physics(event) => NodeEvent::Physics(event),
                };
                self.node_event(node, event);
            }
            Peer::Client(client) => {
                let event = match arrival {
                    Arrival::Connected(peer) => ClientEvent::Connected(peer),
                    Arrival::Disconnected(peer) => ClientEvent::Disconnected(peer),
                    Arrival::Frame(from, bytes) => ClientEvent::Message { from, message: open(bytes) },
                    Arrival::Physics(_) => return,
                };
                self.client_event(client, event);
            }
        }
    }

    fn node_event(&mut self, node: NodeId, event: NodeEvent) {
        if let Some(process) = self.nodes.get_mut(&node) {
            process.machine.handle(self.now, event);
            self.drain_node(node);
        }
    }

    fn client_event(&mut self, id: ClientId, event: ClientEvent) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        client.handle(self.now, event);
        self.drain_client(id);
    }

    fn drain_client(&mut self, id: ClientId) {
        while let Some(output) = self.clients.get_mut(&id).and_then(Client::poll_output) {
            match output {
                ClientOutput::Send { to, message } => self.send(Peer::Client(id), to, message),
                ClientOutput::Redial => {
                    let time = self.later();
                    self.network.connect(time, Peer::Client(id), Peer::Server);
                }
                ClientOutput::Connect(member) => self.dial(Peer::Client(id), member.node),
                ClientOutput::Disconnect(node) => {
                    self.network.close(self.now, Peer::Client(id), Peer::Node(node))
                }
                ClientOutput::Node(message) => {
                    let with_client = |(_, process): &(&NodeId, &NodeProcess)| process.client == Some(id);
                    if let Some((&node, _)) = self.nodes.iter().find(with_client) {
                        self.node_event(node, NodeEvent::Client(message));
                    }
                }
                other => self.told.push((id, other)),
            }
        }
    }

    fn dial(&mut self, from: Peer, node: NodeId) {
        let time = self.later();
        if self.nodes.contains_key(&node) {
            self.network.connect(time, from, Peer::Node(node));
        } else {
            self.network.refuse(time, from, Peer::Node(node));
        }
    }

    fn send(&mut self, from: Peer, to: Peer, mut message: Message) {
        if let Message::Border(border) = &mut message {
            for transfers in border.messages.iter_mut().map(|message| &mut message.transfers) {
                while self.drop_transfers > 0 && transfers.pop().is_some() {
                    self.drop_transfers -= 1;
                }
            }
        }
        let bytes = encode(&message);
        if let Message::ToClient(_, ToClient::States { .. }) = message {
            assert!(bytes.len() <= DATAGRAM_BYTES, "a datagram of {} bytes", bytes.len());
        }
        let time = self.later();
        self.network.send(time, from, to, message.lane(), bytes);
    }

    fn drain_server(&mut self) {
        while let Some(output) = self.server.poll_output() {
            match output {
                ServerOutput::Send { to, message } => self.send(Peer::Server, to, message),
                ServerOutput::Close(peer) => self.network.close(self.now, Peer::Server, peer),
                ServerOutput::Began { .. }
                | ServerOutput::Store(_)
                | ServerOutput::Dissolved(_)
                | ServerOutput::Expelled(_)
                | ServerOutput::Held(_)
                | ServerOutput::Audited { .. }
                | ServerOutput::Ended => {}
            }
        }
    }

    fn drain_node(&mut self, id: NodeId) {
        while let Some(process) = self.nodes.get_mut(&id) {
            let Some(output) = process.machine.poll_output() else { return };
            match output {
                NodeOutput::Send { to, message } => self.send(Peer::Node(id), to, message),
                NodeOutput::Redial => {
                    let time = self.later();
                    self.network.connect(time, Peer::Node(id), Peer::Server);
                }
                NodeOutput::Connect(member) => self.dial(Peer::Node(id), member.node),
                NodeOutput::Disconnect(node) => {
                    self.network.close(self.now, Peer::Node(id), Peer::Node(node))
                }
                NodeOutput::Physics(command) => {
                    let answer: Option<PhysicsEvent> = process.physics.execute(command);
                    if let Some(event) = answer {
                        let time = self.later();
                        self.network.physics(time, id, event);
                    }
                }
                NodeOutput::Settled(tick) => {
                    let view = process.machine.view().expect("only members complete ticks");
                    let checked = self.checker.settled(id, view, tick, &process.physics);
                    self.violation = self.violation.take().or(checked.err());
                }
                NodeOutput::Client(message) => {
                    if let Some(client) = process.client {
                        self.client_event(client, ClientEvent::Node(message));
                    }
                }
                NodeOutput::Stopped { .. } => {
                    self.nodes.remove(&id);
                    self.checker.died();
                    self.network.crash(self.now, Peer::Node(id), &mut self.random);
                }
            }
        }
    }
}
