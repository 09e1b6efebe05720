//! The server: directory of nodes and clients, record of every body, and the one who decides membership (thesis 3.3.5,
//! 4.3.1, 4.3.3). First cut: all nodes form one group.

mod avatars;
mod recovery;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use self::recovery::Change;
use super::{Life, Peer, Record};
use crate::protocol::{
    Chunk, EnvironmentProperties, Hello, Member, Message, Refusal, Role, ShapeHash, ToClient, ToNode,
    ToServer, VERSION, View, ViewNumber, WorldOp, chunks,
};
use crate::space::{BodyId, ClientId, NodeId, Tick};

pub use self::avatars::MAX_AVATARS;

/// What a server is told at its start.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The world.
    pub world: EnvironmentProperties,
    /// Nodes to wait for before the world first begins; at least 1.
    pub min_nodes: usize,
}

/// What happens to a server.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "an event lives for one call")]
pub enum ServerEvent {
    /// A link is gone.
    Disconnected(Peer),
    /// A decoded message; the first on a link is [`Message::Hello`].
    Message {
        /// Over which link, by the name on its certificate.
        from: Peer,
        /// What it says.
        message: Message,
    },
    /// The world is to end: all are told.
    Stop,
}

/// What a server wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerOutput {
    /// Send this.
    Send {
        /// Over which link.
        to: Peer,
        /// What.
        message: Message,
    },
    /// Close the link once all is sent; no [`ServerEvent::Disconnected`] is needed.
    Close(Peer),
    /// A view begins.
    Began(View),
    /// Nobody computes the world any more; the record holds it.
    Held(Tick),
    /// What all members together own, when the world is to end.
    Audited {
        /// Bodies of the world that no node owns.
        lost: Vec<BodyId>,
        /// Bodies that more than one node owns.
        doubled: Vec<BodyId>,
    },
    /// The world has ended and all have been told.
    Ended,
}

#[derive(Clone, Debug)]
struct NodeEntry {
    member: Member,
    loaded: bool,
    leaving: bool,
    shapes: BTreeSet<ShapeHash>,
    scenery: BTreeSet<BodyId>,
}

/// The state machine.
#[derive(Clone, Debug)]
pub struct Server {
    config: ServerConfig,
    record: Record,
    nodes: BTreeMap<NodeId, NodeEntry>,
    clients: BTreeSet<ClientId>,
    last_node: NodeId,
    last_client: ClientId,
    /// The newest view number in use.
    number: ViewNumber,
    tick: Tick,
    view: Option<View>,
    begun: bool,
    /// Members that have told all they know of the world's last tick.
    at_last_tick: BTreeSet<NodeId>,
    stopping: bool,
    ended: bool,
    /// Bodies that the leader was told to insert and that no node has spoken of yet.
    arriving: BTreeSet<BodyId>,
    change: Option<Change>,
    stale: u64,
    outputs: VecDeque<ServerOutput>,
}

impl Server {
    /// A server with a world that waits for nodes.
    pub fn new(config: ServerConfig, record: Record) -> Self {
        assert!(config.min_nodes > 0, "a world begins with at least one node");
        Self {
            config,
            record,
            nodes: BTreeMap::new(),
            clients: BTreeSet::new(),
            last_node: NodeId(0),
            last_client: ClientId(0),
            number: ViewNumber(0),
            tick: Tick(0),
            view: None,
            begun: false,
            at_last_tick: BTreeSet::new(),
            stopping: false,
            ended: false,
            arriving: BTreeSet::new(),
            change: None,
            stale: 0,
            outputs: VecDeque::new(),
        }
    }

    /// The id for the certificate of the next node.
    pub fn new_node_id(&mut self) -> NodeId {
        self.last_node.0 += 1;
        self.last_node
    }

    /// The id for the certificate of the next client.
    pub fn new_client_id(&mut self) -> ClientId {
        self.last_client.0 += 1;
        self.last_client
    }

    /// Takes an event in; [`Server::poll_output`] tells what follows from it.
    pub fn handle(&mut self, event: ServerEvent) {
        match event {
            ServerEvent::Disconnected(Peer::Node(node)) => self.lose(node),
            ServerEvent::Disconnected(Peer::Client(client)) => self.part(client),
            ServerEvent::Disconnected(Peer::Server) => {}
            ServerEvent::Message { from, message: Message::Hello(hello) } => self.hello(from, hello),
            ServerEvent::Message { from: Peer::Node(node), message: Message::ToServer(message) } => {
                if self.nodes.contains_key(&node) {
                    self.hear_node(node, message);
                }
            }
            ServerEvent::Message { from, message: Message::FromClient(client, message) } => {
                let speaks_for = match from {
                    Peer::Client(linked) => linked == client,
                    Peer::Node(node) => {
                        let is_leader = self.view.as_ref().is_some_and(|view| view.leader == node);
                        is_leader
                            || self.nodes.get(&node).is_some_and(|entry| entry.member.client == Some(client))
                    }
                    Peer::Server => false,
                };
                if speaks_for && self.clients.contains(&client) {
                    self.hear_client(client, message);
                } else {
                    self.stale += 1;
                }
            }
            ServerEvent::Message { .. } => self.stale += 1,
            ServerEvent::Stop => self.stop(),
        }
        self.reconsider();
    }

    /// The next thing to do, until there is none.
    pub fn poll_output(&mut self) -> Option<ServerOutput> {
        self.outputs.pop_front()
    }

    /// The newest tick that a member is known to have completed.
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The record of the world.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The membership, while nodes compute the world.
    pub fn view(&self) -> Option<&View> {
        self.view.as_ref()
    }

    /// Whether a view change is under way.
    pub fn is_changing(&self) -> bool {
        self.change.is_some()
    }

    /// Messages dropped because they were of an earlier view or from somebody who may not say that.
    pub fn stale(&self) -> u64 {
        self.stale
    }

    fn send_node(&mut self, node: NodeId, message: ToNode) {
        self.outputs
            .push_back(ServerOutput::Send { to: Peer::Node(node), message: Message::ToNode(message) });
    }

    fn send_client(&mut self, client: ClientId, message: ToClient) {
        let message = Message::ToClient(client, message);
        self.outputs.push_back(ServerOutput::Send { to: Peer::Client(client), message });
    }

    fn send_clients(&mut self, message: ToClient) {
        for client in self.clients.clone() {
            self.send_client(client, message.clone());
        }
    }

    fn hello(&mut self, from: Peer, hello: Hello) {
        let refusal = Refusal::Version { theirs: hello.version, ours: VERSION };
        match (from, hello.role) {
            (Peer::Node(node), _) if hello.version != VERSION => {
                self.dismiss(node, true, refusal.to_string())
            }
            (Peer::Client(client), _) if hello.version != VERSION => {
                self.send_client(client, ToClient::Rejected { body: None, reason: refusal });
                self.outputs.push_back(ServerOutput::Close(from));
            }
            (Peer::Node(node), Role::Node { address, client }) => {
                self.lose(node);
                self.welcome_node(Member { node, address, client });
            }
            (Peer::Client(client), Role::Client) => {
                self.part(client);
                self.welcome_client(client);
            }
            _ => self.outputs.push_back(ServerOutput::Close(from)),
        }
    }

    fn welcome_node(&mut self, member: Member) {
        let node = member.node;
        let (mut shapes, mut scenery) = (BTreeSet::new(), BTreeSet::new());
        let mut parts = self.record.shape_chunks(&mut shapes);
        parts.extend(self.record.scenery_chunks(&mut scenery));
        self.nodes.insert(node, NodeEntry { member, loaded: false, leaving: false, shapes, scenery });
        self.send_node(node, ToNode::Welcome { id: node, world: self.config.world.clone() });
        for chunk in parts {
            self.send_node(node, ToNode::Chunk(chunk));
        }
        self.send_node(node, ToNode::WorldEnd);
    }

    fn welcome_client(&mut self, client: ClientId) {
        // First, so that the world it is told of has its own avatars in it: new ones must not take their names.
        self.bring_back(client);
        self.send_client(client, ToClient::Welcome { id: client, world: self.config.world.clone() });
        // Before its world is written, so that the client finds its avatars in it.
        self.bring_back(client);
        let mut parts = self.record.shape_chunks(&mut BTreeSet::new());
        // Those that are still on their way out stand where they were until they are back.
        let returning = self.record.avatars(client).into_iter().filter_map(|(id, life)| {
            self.record.body(id).filter(|_| matches!(life, Life::Removing { back: true, .. }))
        });
        parts.extend(chunks(self.record.present().chain(returning).cloned(), Chunk::Bodies));
        parts.extend(self.record.joint_chunks(|_| true));
        for chunk in parts {
            self.send_client(client, ToClient::Chunk(chunk));
        }
        self.send_client(client, ToClient::WorldEnd);
        let leader = self.leader_is();
        self.send_client(client, leader);
        self.clients.insert(client);
    }

    fn leader_is(&self) -> ToClient {
        let leader = self
            .view
            .as_ref()
            .and_then(|view| view.members.iter().find(|member| member.node == view.leader).cloned());
        ToClient::LeaderIs { view: self.number, leader }
    }

    fn hear_node(&mut self, node: NodeId, message: ToServer) {
        let present = self.view.as_ref().map(|view| view.number);
        let is_member = self.is_member(node);
        let Some(entry) = self.nodes.get_mut(&node) else { return };
        match message {
            ToServer::Loaded => entry.loaded = true,
            ToServer::Leave => entry.leaving = true,
            ToServer::Checkpoint { view, tick, bodies } if Some(view) == present && is_member => {
                for checkpoint in &bodies {
                    self.arriving.remove(&checkpoint.id);
                    self.record.checkpoint(tick, checkpoint);
                }
                self.tick = self.tick.max(tick);
                if self.config.world.last_tick == Some(tick) {
                    self.at_last_tick.insert(node);
                }
            }
            ToServer::Removed { view, tick, bodies } if Some(view) == present && is_member => {
                for body in bodies {
                    self.removed(tick, body);
                }
            }
            // Two members that cannot speak to each other cannot both stay; the first to complain does.
            ToServer::LinkLost { view, node: other } if Some(view) == present && is_member => {
                if self.is_member(other) {
                    self.dismiss(
                        other,
                        true,
                        format!("{node} cannot reach this node: check the network and join anew"),
                    );
                    self.begin_change();
                }
            }
            ToServer::Settling { view, dispatch } => self.settling(node, view, dispatch),
            ToServer::Survey { view, tick, claims } => self.surveyed(node, view, tick, claims),
            ToServer::Found { view, bodies, last } => self.found(node, view, bodies, last),
            ToServer::Checkpoint { .. } | ToServer::Removed { .. } | ToServer::LinkLost { .. } => {
                self.stale += 1
            }
        }
    }

    fn is_member(&self, node: NodeId) -> bool {
        self.nodes.contains_key(&node)
            && self.view.as_ref().is_some_and(|view| view.members.iter().any(|member| member.node == node))
    }

    /// Tells the leader what to do to the world; while membership changes, `Adopt` takes care of it.
    fn apply(&mut self, ops: Vec<WorldOp>) {
        if let Some(view) = self.view.as_ref().filter(|_| self.change.is_none()) {
            let (leader, view) = (view.leader, view.number);
            self.send_node(leader, ToNode::Apply { view, ops });
        }
    }

    /// A node is told to go, and is no longer known.
    fn dismiss(&mut self, node: NodeId, evicted: bool, reason: String) {
        self.send_node(node, ToNode::Shutdown { evicted, reason });
        self.outputs.push_back(ServerOutput::Close(Peer::Node(node)));
        self.nodes.remove(&node);
    }

    /// The world is to end: a last survey audits it first.
    fn stop(&mut self) {
        if self.stopping {
            return;
        }
        self.stopping = true;
        if self.change.is_none() && self.view.is_some() {
            self.begin_change();
        } else if self.view.is_none() {
            self.end();
        }
    }

    /// Everybody is told that the world is over.
    fn end(&mut self) {
        for node in self.nodes.keys().copied().collect::<Vec<_>>() {
            self.dismiss(node, false, "the server ends the world".into());
        }
        for client in std::mem::take(&mut self.clients) {
            self.outputs.push_back(ServerOutput::Close(Peer::Client(client)));
        }
        self.view = None;
        self.change = None;
        self.ended = true;
        self.outputs.push_back(ServerOutput::Ended);
    }
}
