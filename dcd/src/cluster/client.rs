//! A process that hosts avatars: joins at the server, moves its avatars through the leader, keeps its view of the world.

use std::collections::{BTreeMap, VecDeque};

use super::Peer;
use crate::protocol::{
    BodyRecord, Chunk, ContactForce, Drive, EnvironmentProperties, FromClient, Hello, JointRecord, Member,
    Message, Refusal, Role, ShapeHash, ShapeRecord, ToClient, Touch, VERSION, Velocity, ViewNumber,
    WorldPose,
};
use crate::space::{BodyId, ClientId, NodeId, Tick};

/// Contacts kept for a user who does not ask; the oldest go first.
const MAX_CONTACTS: usize = 4_096;

/// What happens to a client.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientEvent {
    /// A link is up.
    Connected(Peer),
    /// A link is gone, or could not be made.
    Disconnected(Peer),
    /// A decoded message.
    Message {
        /// Over which link.
        from: Peer,
        /// What it says.
        message: Message,
    },
    /// The leader speaks through the node in the same process.
    Node(ToClient),
    /// The user wants a new avatar.
    Spawn {
        /// Its id is one of this client's.
        body: BodyRecord,
        /// The shapes of its colliders.
        shapes: Vec<ShapeRecord>,
    },
    /// The user moves an avatar.
    Drive {
        /// Which.
        body: BodyId,
        /// Wanted velocity.
        velocity: Velocity,
        /// Wanted pose, for a jump.
        pose: Option<WorldPose>,
    },
    /// An avatar is to go for good.
    Despawn(BodyId),
    /// The user goes.
    Leave,
}

/// What a client wants done, or tells its user.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientOutput {
    /// Send this.
    Send {
        /// Over which link.
        to: Peer,
        /// What.
        message: Message,
    },
    /// Make a link to the leader, and answer with [`ClientEvent::Connected`] or [`ClientEvent::Disconnected`].
    Connect(Member),
    /// Close the link to a former leader.
    Disconnect(NodeId),
    /// Give this to the node in the same process.
    Node(FromClient),
    /// The whole world has arrived.
    Joined,
    /// A body appeared.
    Inserted(BodyId),
    /// A body disappeared.
    Removed(BodyId),
    /// A wish was refused.
    Rejected {
        /// Concerning which body.
        body: Option<BodyId>,
        /// Why.
        reason: Refusal,
    },
    /// The server is gone.
    Lost,
}

/// A body as a client knows it.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyView {
    /// The body, with its latest state.
    pub body: BodyRecord,
    /// After which tick.
    pub tick: Tick,
}

/// The state machine.
#[derive(Clone, Debug)]
pub struct Client {
    id: ClientId,
    /// The node in the same process, for a participant.
    node: Option<NodeId>,
    world: Option<EnvironmentProperties>,
    joined: bool,
    bodies: BTreeMap<BodyId, BodyView>,
    shapes: BTreeMap<ShapeHash, ShapeRecord>,
    joints: Vec<JointRecord>,
    since: ViewNumber,
    leader: Option<Member>,
    linked: bool,
    logical_time: u64,
    /// Wishes kept while the link to the leader is being made: the newest of each avatar.
    waiting: BTreeMap<BodyId, Drive>,
    touches: VecDeque<(Tick, Touch)>,
    forces: VecDeque<(Tick, ContactForce)>,
    outputs: VecDeque<ClientOutput>,
}

impl Client {
    /// A client without links; `node` is the node in the same process, if there is one. The first event is
    /// [`ClientEvent::Connected`] with [`Peer::Server`].
    pub fn new(id: ClientId, node: Option<NodeId>) -> Self {
        Self {
            id,
            node,
            world: None,
            joined: false,
            bodies: BTreeMap::new(),
            shapes: BTreeMap::new(),
            joints: Vec::new(),
            since: ViewNumber(0),
            leader: None,
            linked: false,
            logical_time: 0,
            waiting: BTreeMap::new(),
            touches: VecDeque::new(),
            forces: VecDeque::new(),
            outputs: VecDeque::new(),
        }
    }

    /// Takes an event in; [`Client::poll_output`] tells what follows from it.
    pub fn handle(&mut self, event: ClientEvent) {
        match event {
            ClientEvent::Connected(Peer::Server) => {
                self.send(Peer::Server, Message::Hello(Hello { version: VERSION, role: Role::Client }));
            }
            ClientEvent::Connected(peer) if self.is_leader(peer) => {
                self.linked = true;
                for drive in std::mem::take(&mut self.waiting).into_values() {
                    self.send_drive(drive);
                }
            }
            ClientEvent::Disconnected(Peer::Server) => self.outputs.push_back(ClientOutput::Lost),
            // The server will name a new leader; until then the newest wish of each avatar waits.
            ClientEvent::Disconnected(peer) if self.is_leader(peer) => self.linked = false,
            ClientEvent::Connected(_) | ClientEvent::Disconnected(_) => {}
            ClientEvent::Message { from, message: Message::ToClient(client, message) } => {
                if client == self.id && (from == Peer::Server || self.is_leader(from)) {
                    self.told(message);
                }
            }
            ClientEvent::Message { .. } => {}
            ClientEvent::Node(message) => self.told(message),
            ClientEvent::Spawn { body, shapes } => self.ask_server(FromClient::Spawn { body, shapes }),
            ClientEvent::Drive { body, velocity, pose } => {
                self.logical_time += 1;
                self.send_drive(Drive { body, logical_time: self.logical_time, velocity, pose });
            }
            ClientEvent::Despawn(body) => self.ask_server(FromClient::Despawn(body)),
            ClientEvent::Leave => self.ask_server(FromClient::Leave),
        }
    }

    /// The next thing to do, until there is none.
    pub fn poll_output(&mut self) -> Option<ClientOutput> {
        self.outputs.pop_front()
    }

    /// Its name.
    pub fn id(&self) -> ClientId {
        self.id
    }

    /// The world, once the server has told.
    pub fn world(&self) -> Option<&EnvironmentProperties> {
        self.world.as_ref()
    }

    /// Whether the whole world has arrived.
    pub fn is_joined(&self) -> bool {
        self.joined
    }

    /// Who leads, as far as known.
    pub fn leader(&self) -> Option<NodeId> {
        self.leader.as_ref().map(|member| member.node)
    }

    /// A body as last heard of.
    pub fn body(&self, id: BodyId) -> Option<&BodyView> {
        self.bodies.get(&id)
    }

    /// All bodies in id order.
    pub fn bodies(&self) -> impl Iterator<Item = &BodyView> {
        self.bodies.values()
    }

    /// All shapes by name.
    pub fn shapes(&self) -> &BTreeMap<ShapeHash, ShapeRecord> {
        &self.shapes
    }

    /// Joints that were there when the client joined.
    pub fn joints(&self) -> &[JointRecord] {
        &self.joints
    }

    /// Beginnings and ends of contacts of own avatars since the last call.
    pub fn take_touches(&mut self) -> impl Iterator<Item = (Tick, Touch)> {
        std::mem::take(&mut self.touches).into_iter()
    }

    /// Forces on own avatars above their thresholds since the last call.
    pub fn take_forces(&mut self) -> impl Iterator<Item = (Tick, ContactForce)> {
        std::mem::take(&mut self.forces).into_iter()
    }

    fn send(&mut self, to: Peer, message: Message) {
        self.outputs.push_back(ClientOutput::Send { to, message });
    }

    /// What lasts goes to the server, whose record outlives every leader.
    fn ask_server(&mut self, message: FromClient) {
        self.send(Peer::Server, Message::FromClient(self.id, message));
    }

    fn is_leader(&self, peer: Peer) -> bool {
        self.leader.as_ref().is_some_and(|member| peer == Peer::Node(member.node))
    }

    fn send_drive(&mut self, drive: Drive) {
        let wish = FromClient::Drive(drive);
        match &self.leader {
            None => self.ask_server(wish),
            Some(_) if self.node.is_some() => self.outputs.push_back(ClientOutput::Node(wish)),
            Some(member) if self.linked => {
                let to = Peer::Node(member.node);
                self.send(to, Message::FromClient(self.id, wish));
            }
            Some(_) => {
                self.waiting.insert(drive.body, drive);
            }
        }
    }

    fn told(&mut self, message: ToClient) {
        match message {
            ToClient::Welcome { world, .. } => {
                self.world = Some(world);
                self.joined = false;
                self.bodies.clear();
                self.joints.clear();
            }
            ToClient::Chunk(Chunk::Shapes(shapes)) => self.learn(shapes),
            ToClient::Chunk(Chunk::Bodies(bodies)) => {
                let views = bodies.into_iter().map(|body| (body.id, BodyView { body, tick: Tick(0) }));
                self.bodies.extend(views);
            }
            ToClient::Chunk(Chunk::Joints(joints)) => self.joints.extend(joints),
            ToClient::Chunk(Chunk::Placed(_)) => {}
            ToClient::WorldEnd => {
                self.joined = true;
                self.outputs.push_back(ClientOutput::Joined);
            }
            ToClient::LeaderIs { view, leader } if view >= self.since => {
                self.since = view;
                self.follow(leader);
            }
            ToClient::LeaderIs { .. } => {}
            ToClient::Inserted { body, shapes } => {
                self.learn(shapes);
                let id = body.id;
                self.bodies.insert(id, BodyView { body, tick: Tick(0) });
                self.outputs.push_back(ClientOutput::Inserted(id));
            }
            ToClient::Removed(id) => {
                self.bodies.remove(&id);
                self.joints.retain(|joint| joint.a != id && joint.b != id);
                self.outputs.push_back(ClientOutput::Removed(id));
            }
            ToClient::States { tick, states } => {
                for state in states {
                    if let Some(view) = self.bodies.get_mut(&state.id)
                        && (view.body.epoch, view.tick) <= (state.epoch, tick)
                    {
                        view.tick = tick;
                        view.body.epoch = state.epoch;
                        view.body.state.pose = state.pose;
                        view.body.state.velocity = state.velocity;
                        view.body.state.sleeping = state.sleeping;
                    }
                }
            }
            ToClient::Contacts { tick, touches, forces } => {
                keep(&mut self.touches, tick, touches);
                keep(&mut self.forces, tick, forces);
            }
            ToClient::Rejected { body, reason } => {
                self.outputs.push_back(ClientOutput::Rejected { body, reason });
            }
        }
    }

    fn learn(&mut self, shapes: Vec<ShapeRecord>) {
        self.shapes.extend(shapes.into_iter().map(|shape| (shape.hash(), shape)));
    }

    fn follow(&mut self, leader: Option<Member>) {
        let former = self.leader.as_ref().map(|member| member.node);
        let next = leader.as_ref().map(|member| member.node);
        self.leader = leader.clone();
        if self.node.is_some() || (former == next && self.linked) {
            return;
        }
        self.linked = false;
        if former != next {
            self.outputs.extend(former.map(ClientOutput::Disconnect));
        }
        self.outputs.extend(leader.map(ClientOutput::Connect));
    }
}

fn keep<T>(queue: &mut VecDeque<(Tick, T)>, tick: Tick, items: Vec<T>) {
    queue.extend(items.into_iter().map(|item| (tick, item)));
    let excess = queue.len().saturating_sub(MAX_CONTACTS);
    queue.drain(..excess);
}
