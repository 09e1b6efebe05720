//! Implements a client, a process that hosts avatars: it joins at the server, sends avatar inputs to the
//! leader, and keeps its copy of the world up to date.

mod body_view;
mod building;
mod changed;
mod following;
mod hearing;
mod known;
mod newest;
mod relay;
mod requests;
mod shapes;
mod showing;
mod surroundings;
#[cfg(test)]
mod tests;
mod vigil;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use tracing::debug;

pub use self::body_view::BodyView;
use self::building::Building;
use self::newest::NewestInputs;
use self::relay::Relay;
use self::showing::Showing;
use self::surroundings::Surroundings;
use self::vigil::Vigil;
use super::joints::Joints;
use super::{Peer, Pinger};
use crate::delta::{FreeMotion, Receiver};
use crate::playback::Motion;
use crate::protocol::{
    Alteration, Area, BodyKind, BodyRecord, BuildOp, Chunk, ContactForce, Drive, EnvironmentProperties,
    FromClient, Handover, Hello, Input, JoinAs, Member, Message, Query, QueryResult, Refusal, ShapeHash,
    ShapeRecord, ToClient, Touch, VERSION, Velocity, WorldPose,
};
use crate::space::{Allocation, BodyId, ClientId, DistributionTree, GroupId, NodeId, Tick};

/// The most contacts, and handovers, kept for a user who does not fetch them. The oldest go first.
const MAX_EVENTS: usize = 4_096;

/// The time between attempts to dial the server, or a leader that cannot be reached.
const AGAIN: Duration = Duration::from_millis(250);

/// The time after which an unanswered query is asked again, of whoever leads by then.
const ASK_AGAIN: Duration = Duration::from_millis(500);

/// An event for a client: a message, a link, or a request of its user.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientEvent {
    /// A link is up.
    Connected(Peer),
    /// A link is gone, or could not be made.
    Disconnected(Peer),
    /// A decoded message.
    Message {
        /// The link that it came over.
        from: Peer,
        /// The message.
        message: Message,
    },
    /// A message of the leader, through the node in the same process.
    Node(ToClient),
    /// The user wants a new avatar.
    Spawn {
        /// The avatar. Its id is one of this client's.
        body: BodyRecord,
        /// The shapes of its colliders.
        shapes: Vec<ShapeRecord>,
    },
    /// The user moves an avatar.
    Input {
        /// The avatar.
        body: BodyId,
        /// The tick that is to apply it, by [`Client::name_tick`]; 0: the next one.
        tick: Tick,
        /// The wanted velocity.
        velocity: Velocity,
        /// The wanted pose, for a jump.
        pose: Option<WorldPose>,
    },
    /// The user drives a vehicle.
    Drive {
        /// The vehicle.
        body: BodyId,
        /// The tick that is to apply it, by [`Client::name_tick`]; 0: the next one.
        tick: Tick,
        /// Its controls from now on.
        drive: Drive,
    },
    /// The user removes an avatar for good.
    Despawn(BodyId),
    /// The user, who may build, changes the world, in this order.
    Build(Vec<BuildOp>),
    /// The user asks a query about bodies. Its number is unlike those of queries before.
    Ask(Query),
    /// The user does not want the answer to the query of this number any more.
    Forget(u64),
    /// The user sets the area of interest; `None`: the user wants to hear of all bodies.
    Interest(Option<Area>),
    /// The user limits how much is sent of bodies, in bytes per second; 0: as much as the link carries.
    Bandwidth(u32),
    /// The user leaves.
    Leave,
}

/// An action that a client wants done, or an event for its user.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientOutput {
    /// Send this message.
    Send {
        /// The link to send it over.
        to: Peer,
        /// The message.
        message: Message,
    },
    /// Make a link to the server, and answer with [`ClientEvent::Connected`] or
    /// [`ClientEvent::Disconnected`].
    Redial,
    /// Make a link to the leader, and answer with [`ClientEvent::Connected`] or
    /// [`ClientEvent::Disconnected`].
    Connect(Member),
    /// Close the link to a former leader.
    Disconnect(NodeId),
    /// Give this message to the node in the same process.
    Node(FromClient),
    /// The whole world has arrived.
    Joined,
    /// The world has ended: its server serves another one now.
    WorldEnded,
    /// A body appeared.
    Inserted(BodyId),
    /// A body disappeared.
    Removed(BodyId),
    /// An input, or another request, was refused.
    Rejected {
        /// The body that it concerned.
        body: Option<BodyId>,
        /// Why.
        reason: Refusal,
    },
    /// The server is gone. It is dialled again and again.
    Lost,
}

/// The state machine of a client.
#[derive(Clone, Debug)]
pub struct Client {
    id: ClientId,
    /// The node in the same process, for a participant.
    node: Option<NodeId>,
    world: Option<EnvironmentProperties>,
    joined: bool,
    bodies: BTreeMap<BodyId, BodyView>,
    /// The bodies that changed since they were last taken; `None`: any may have.
    changed: Option<BTreeSet<BodyId>>,
    /// Bodies and shapes that the server has not sent yet while it sends the world again.
    unspoken: BTreeSet<BodyId>,
    unspoken_shapes: BTreeSet<ShapeHash>,
    /// The newest tick of its group heard of, and the newest that is not speculative.
    tick: Tick,
    settled: Tick,
    /// Says whether its leader, or the link to it, is new, and has told nothing yet that is not speculative.
    is_leader_new: bool,
    shapes: BTreeMap<ShapeHash, ShapeRecord>,
    joints: Joints,
    group: Option<GroupId>,
    leader: Option<Member>,
    /// How the world is cut into regions, and the node that computes each, as far as known.
    tree: Option<DistributionTree>,
    allocation: Allocation,
    linked: bool,
    relay: Relay,
    server_linked: bool,
    dial_server_at: Option<Duration>,
    dial_leader_at: Option<Duration>,
    logical_time: u64,
    /// Says whether it has greeted the server, and was not welcomed yet.
    greeted: bool,
    /// Says whether its link to the server is new, and what may be lost with the link before was not sent again.
    relinked: bool,
    /// Says whether it has had a whole world, so that bodies that it is told of since have appeared.
    has_arrived: bool,
    /// Which of the worlds that its server served one after the other it is in, once it is told.
    incarnation: Option<u64>,
    /// Says whether the world has ended: what its server tells since is of another one.
    is_over: bool,
    /// Says whether the world that it is being told replaces the one that it knew; and how often one did before.
    replaced: bool,
    replacements: u64,
    newest: NewestInputs,
    /// The states that it was told of bodies, to which later states refer.
    receiver: Receiver,
    /// The most bytes per second that it wants to be sent; 0: as many as the link carries.
    bytes_per_s: u32,
    /// The state of playback, while its user shows the world.
    showing: Option<Box<Showing>>,
    vigil: Vigil,
    /// Queries without an answer, by number, each with when it is asked again; and answers that are not
    /// fetched yet.
    asked: BTreeMap<u64, (Query, Duration)>,
    answers: BTreeMap<u64, QueryResult>,
    /// Its area of interest, as sent to the leader; `None` is everything.
    area: Option<Area>,
    surroundings: Surroundings,
    now: Duration,
    /// Requests that the server has not answered yet, in order. They are sent again when it is back.
    unanswered: Vec<FromClient>,
    building: Building,
    touches: VecDeque<(Tick, Touch)>,
    forces: VecDeque<(Tick, ContactForce)>,
    handovers: VecDeque<Handover>,
    outputs: VecDeque<ClientOutput>,
}

impl Client {
    /// Returns a client without links. `node` is the node in the same process, if there is one. With an area
    /// of interest it is told only of the world's part there. The first event is [`ClientEvent::Connected`]
    /// with [`Peer::Server`].
    pub fn new(id: ClientId, node: Option<NodeId>, area: Option<Area>) -> Self {
        Self {
            id,
            node,
            world: None,
            joined: false,
            bodies: BTreeMap::new(),
            changed: None,
            unspoken: BTreeSet::new(),
            unspoken_shapes: BTreeSet::new(),
            tick: Tick(0),
            settled: Tick(0),
            is_leader_new: false,
            shapes: BTreeMap::new(),
            joints: Joints::default(),
            group: None,
            leader: None,
            tree: None,
            allocation: Allocation::new(),
            linked: false,
            relay: Relay::default(),
            server_linked: false,
            dial_server_at: None,
            dial_leader_at: None,
            logical_time: 0,
            newest: NewestInputs::default(),
            receiver: Receiver::default(),
            bytes_per_s: 0,
            showing: None,
            vigil: Vigil::default(),
            asked: BTreeMap::new(),
            answers: BTreeMap::new(),
            area,
            surroundings: Surroundings::of(area),
            greeted: false,
            relinked: false,
            has_arrived: false,
            incarnation: None,
            is_over: false,
            replaced: false,
            replacements: 0,
            now: Duration::ZERO,
            unanswered: Vec::new(),
            building: Building::default(),
            touches: VecDeque::new(),
            forces: VecDeque::new(),
            handovers: VecDeque::new(),
            outputs: VecDeque::new(),
        }
    }

    /// Takes an event in. [`Client::poll_output`] returns what follows from it.
    pub fn handle(&mut self, now: Duration, event: ClientEvent) {
        self.now = now;
        match event {
            ClientEvent::Connected(Peer::Server) => {
                self.server_linked = true;
                (self.greeted, self.relinked) = (true, true);
                self.dial_server_at = None;
                let interest = self.area.filter(|_| !self.surroundings.is_whole());
                self.surroundings = Surroundings::of(interest);
                let role = JoinAs::Client { interest };
                self.send(Peer::Server, Message::Hello(Hello { version: VERSION, role }));
            }
            ClientEvent::Connected(peer) if self.is_leader(peer) => {
                self.linked = true;
                self.dial_leader_at = None;
                if self.relay.teller().is_none() {
                    self.receiver.reset();
                }
                self.is_leader_new = true;
                self.say_inputs_again();
                self.send_interest();
                self.ask_again(now, now + ASK_AGAIN);
                self.showing.iter_mut().for_each(|showing| showing.connected(now, peer));
            }
            ClientEvent::Disconnected(Peer::Server) => {
                if std::mem::take(&mut self.server_linked) {
                    self.outputs.push_back(ClientOutput::Lost);
                }
                self.dial_server_at = Some(now + AGAIN);
            }
            // The server may name a new leader. Until then the newest input of each avatar waits.
            ClientEvent::Disconnected(peer) if self.is_leader(peer) => {
                self.linked = false;
                self.dial_leader_at = Some(now + AGAIN);
                self.vigil.rest();
                self.showing.iter_mut().for_each(|showing| showing.disconnected(peer));
            }
            ClientEvent::Connected(peer) if self.relay.is(peer) => self.relay_connected(),
            ClientEvent::Disconnected(peer) if self.relay.is(peer) => self.relay_disconnected(now),
            ClientEvent::Connected(_) | ClientEvent::Disconnected(_) => {}
            ClientEvent::Message { from, message: Message::ToClient(client, message) } => {
                let may_tell = from == Peer::Server
                    || self.is_leader(from)
                    || self.relay.is(from) && relay::is_of_relay(&message);
                if client == self.id && may_tell {
                    self.told(Some(from), message);
                }
            }
            ClientEvent::Message { from, message: Message::Pong(pong) } => {
                if self.is_teller(from) {
                    self.relay.answered();
                    self.vigil.heard(now, false);
                }
                self.showing.iter_mut().for_each(|showing| showing.pong(now, from, pong));
            }
            ClientEvent::Message { .. } => {}
            ClientEvent::Node(message) => self.told(None, message),
            ClientEvent::Spawn { body, shapes } => self.spawn(body, shapes),
            ClientEvent::Input { body, tick, velocity, pose } => {
                self.send_newest(Input { body, logical_time: 0, tick, velocity, pose, drive: None });
            }
            ClientEvent::Drive { body, tick, drive } => {
                let (velocity, pose, drive) = (Velocity::default(), None, Some(drive));
                self.send_newest(Input { body, logical_time: 0, tick, velocity, pose, drive });
            }
            ClientEvent::Despawn(body) => self.want(FromClient::Despawn(body)),
            ClientEvent::Build(ops) => self.build(ops),
            ClientEvent::Interest(area) => self.turn_to(area),
            ClientEvent::Ask(question) => {
                self.tell_leader(FromClient::Ask(question.clone()));
                self.asked.insert(question.number, (question, now + ASK_AGAIN));
            }
            ClientEvent::Forget(number) => {
                self.asked.remove(&number);
                self.answers.remove(&number);
            }
            ClientEvent::Bandwidth(bytes_per_s) => {
                self.bytes_per_s = bytes_per_s;
                self.receiver.speak(now);
            }
            ClientEvent::Leave => self.ask_server(FromClient::Leave),
        }
    }

    /// Does what is due. Call it at [`Client::poll_timeout`].
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.dial_server_at.take_if(|at| *at <= now).is_some() {
            self.outputs.push_back(ClientOutput::Redial);
        }
        self.ask_again(now, now);
        if let Some(message) = self.surroundings.look_again(now) {
            self.ask_server(message);
        }
        self.acknowledge(now);
        for (to, ping) in self.showing.as_mut().map(|showing| showing.pings(now)).unwrap_or_default() {
            self.send(to, ping);
        }
        if self.vigil.is_due(now) {
            let leader = self.leader.as_ref().map(|leader| Peer::Node(leader.node));
            let relay = self.doubt_relay(now);
            leader
                .into_iter()
                .chain(relay)
                .chain([Peer::Server])
                .for_each(|peer| self.send(peer, Pinger::ask(now)));
        }
        if self.dial_leader_at.take_if(|at| *at <= now).is_some() && self.node.is_none() && !self.linked {
            self.outputs.extend(self.leader.clone().map(ClientOutput::Connect));
        }
        self.tend_relay(now);
    }

    /// Returns when [`Client::handle_timeout`] is next due. Ask again after every event.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let ask = self.asked.values().map(|&(_, at)| at).min();
        let ping = self.showing.as_ref().and_then(|showing| showing.timeout());
        let heard = self.receiver.timeout();
        let dial = self.dial_server_at.into_iter().chain(self.dial_leader_at);
        dial.chain(ask)
            .chain(ping)
            .chain(heard)
            .chain(self.vigil.timeout())
            .chain(self.relay.timeout())
            .chain(self.surroundings.timeout())
            .min()
    }

    /// Returns the next output, until there is none.
    pub fn poll_output(&mut self) -> Option<ClientOutput> {
        self.outputs.pop_front()
    }

    fn send(&mut self, to: Peer, message: Message) {
        self.outputs.push_back(ClientOutput::Send { to, message });
    }

    fn is_leader(&self, peer: Peer) -> bool {
        self.leader.as_ref().is_some_and(|member| peer == Peer::Node(member.node))
    }

    /// Asks the queries that are due by then once more, or for the first time: before there is a link to the
    /// leader, nobody can be asked.
    fn ask_again(&mut self, now: Duration, due_by: Duration) {
        let mut again = Vec::new();
        for (question, at) in self.asked.values_mut().filter(|(_, at)| *at <= due_by) {
            *at = now + ASK_AGAIN;
            again.push(question.clone());
        }
        again.into_iter().for_each(|question| self.tell_leader(FromClient::Ask(question)));
    }

    fn told(&mut self, from: Option<Peer>, message: ToClient) {
        if self.is_over {
            return;
        }
        match message {
            ToClient::Welcome { world, logical_time, next_built, incarnation, .. } => {
                // The server has begun another world. Nothing that is known or was asked counts in that one.
                if *self.incarnation.get_or_insert(incarnation) != incarnation {
                    self.is_over = true;
                    self.outputs.push_back(ClientOutput::WorldEnded);
                    return;
                }
                self.building.next = next_built;
                self.logical_time = self.logical_time.max(logical_time);
                self.receiver.set_motion(FreeMotion::of(&world.step));
                self.world = Some(world);
                self.joined = false;
                if !std::mem::take(&mut self.greeted) {
                    // The server sends another world over a link that lost nothing: requests to the world
                    // before are not meant for it.
                    self.newest.clear();
                    self.building.clear();
                    self.replaced = true;
                    self.showing.iter_mut().for_each(|showing| showing.recount());
                }
                self.unspoken = self.bodies.keys().copied().collect();
                self.unspoken_shapes = self.shapes.keys().copied().collect();
                self.joints = Joints::default();
            }
            ToClient::Chunk(Chunk::Shapes(shapes)) => self.learn(shapes),
            ToClient::Chunk(Chunk::Bodies(bodies)) => {
                for body in bodies {
                    self.unspoken.remove(&body.id);
                    let id = body.id;
                    if self.replaced && self.bodies.get(&id).is_some_and(|view| is_another(&view.body, &body))
                    {
                        self.drop_body(id);
                    }
                    let is_new =
                        !self.bodies.contains_key(&id) && (self.has_arrived || self.has_asked_for(id));
                    self.know(body);
                    self.outputs.extend(is_new.then_some(ClientOutput::Inserted(id)));
                }
            }
            ToClient::Chunk(Chunk::Joints(joints)) => self.joints.extend(joints),
            ToClient::Chunk(Chunk::Placed(_)) => {}
            ToClient::WorldEnd => {
                (self.joined, self.has_arrived) = (true, true);
                std::mem::take(&mut self.unspoken).into_iter().for_each(|id| self.drop_body(id));
                let unspoken = std::mem::take(&mut self.unspoken_shapes);
                self.forget_shapes(&unspoken);
                self.replacements += u64::from(std::mem::take(&mut self.replaced));
                // Only over a new link may requests be lost. Those to a replaced world are not meant for this
                // one.
                if std::mem::take(&mut self.relinked) {
                    self.say_again();
                }
                self.build_again();
                self.outputs.push_back(ClientOutput::Joined);
            }
            ToClient::Regions { tree, allocation } => {
                (self.tree, self.allocation) = (Some(tree), allocation);
            }
            ToClient::LeaderIs { group, leader, tree, allocation, .. } => {
                (self.tree, self.allocation) = (tree.or(self.tree.take()), allocation);
                if self.group.replace(group) != Some(group) {
                    // Another group has its own epochs and owners: whatever it says first counts.
                    (self.tick, self.settled) = (Tick(0), Tick(0));
                    self.receiver.reset();
                    self.showing.iter_mut().for_each(|showing| showing.recount());
                    for view in self.bodies.values_mut() {
                        (view.settled, view.owner) = Default::default();
                    }
                    self.changed = None;
                }
                self.follow(leader);
                // What the last leader had taken in and not passed on is lost with it.
                if self.linked || self.node.is_some() {
                    let now = self.now;
                    self.say_inputs_again();
                    self.send_interest();
                    self.ask_again(now, now + ASK_AGAIN);
                }
            }
            ToClient::Inserted { body, shapes, joints } => {
                self.learn(shapes);
                self.joints.extend(joints);
                let id = body.id;
                self.answered(id, None);
                self.know(body);
                self.outputs.push_back(ClientOutput::Inserted(id));
            }
            ToClient::Removed(id) => {
                // A client that removes a body that is on its way out, or away, is told everything once more.
                let is_news = self.answered(id, None) | self.bodies.remove(&id).is_some();
                self.newest.forget(id);
                self.note_change(id);
                self.forget(id);
                self.joints.remove_of(id);
                self.outputs.extend(is_news.then_some(ClientOutput::Removed(id)));
            }
            ToClient::Altered(Alteration::Body { body, traits, user_data, .. }) => {
                if let Some(view) = self.bodies.get_mut(&body) {
                    view.body.set_traits(traits, user_data);
                    self.note_change(body);
                }
            }
            ToClient::Altered(Alteration::Joint(joint)) => self.joints.alter(*joint),
            ToClient::JointRemoved(id) => _ = self.joints.remove(id),
            ToClient::ShapesGone(gone) => self.forget_shapes(&gone.into_iter().collect()),
            ToClient::ToldBy(relay) => self.turn_to_relay(relay),
            ToClient::Built(number) => self.building.answered(number),
            ToClient::States { stamp, states } if self.group.is_none_or(|own| own == stamp.group) => {
                self.hear_tick(&stamp);
                if !stamp.speculative {
                    self.newest.are_applied(stamp.applied);
                }
                if self.linked {
                    self.relay.answered();
                    self.vigil.heard(self.now, !states.is_empty());
                }
                self.showing.iter_mut().for_each(|showing| showing.hear(self.now, &stamp, &states));
                let hearing = self.hearing();
                let mut strangers = Vec::new();
                for state in states {
                    let outside = !hearing.follows(state.id, &state.pose);
                    // Nothing would correct a speculative state outside the area.
                    if stamp.speculative && outside {
                        continue;
                    }
                    if let Some(view) = self.bodies.get_mut(&state.id) {
                        let before = Motion::of(&view.body.state);
                        let (is_news, handover) = view.learn(&state, stamp.tick, stamp.speculative, outside);
                        if let Some(showing) = self.showing.as_mut().filter(|_| is_news) {
                            showing.learn(self.now, &stamp, &state, before);
                            if outside {
                                showing.stand(state.id);
                            }
                        }
                        if is_news {
                            self.note_change(state.id);
                        }
                        keep_newest(&mut self.handovers, handover);
                    } else if !outside {
                        strangers.push(state.id);
                    }
                }
                let strangers = self.surroundings.ask(self.now, strangers);
                if !strangers.is_empty() {
                    self.ask_server(FromClient::Introduce(strangers));
                }
            }
            ToClient::CompactStates { stamp, part } => {
                // Another group's states come in a series of their own.
                if self.group.is_some_and(|own| own != stamp.group) {
                    return;
                }
                // Nothing is believed of a part that cannot be read. The next parts refer to nothing.
                let read = self.receiver.take_in(self.now, stamp.tick, &part, stamp.speculative);
                self.note_teller(from, &part);
                match read {
                    Ok(states) if !states.is_empty() => self.told(from, ToClient::States { stamp, states }),
                    Ok(_) => {}
                    Err(error) => debug!(%error, tick = stamp.tick.0, "states cannot be read"),
                }
            }
            // These come from a leader that is no longer ours.
            ToClient::States { .. } => {}
            ToClient::Contacts { tick, touches, forces } => {
                keep(&mut self.touches, tick, touches);
                keep(&mut self.forces, tick, forces);
            }
            ToClient::Answer { number, found } => {
                let Some((question, _)) = self.asked.get(&number) else { return };
                let mut answer = question.parts.nothing();
                if answer.join(found) {
                    self.asked.remove(&number);
                    self.answers.insert(number, answer);
                }
            }
            ToClient::Rejected { body, reason } => {
                if (body, reason) == (None, Refusal::TooMany) {
                    self.surroundings.refused(self.now);
                }
                if let Some(id) = body {
                    self.answered(id, Some(reason));
                    self.newest.are_refused(id);
                    self.showing.iter_mut().for_each(|showing| showing.refused(id));
                }
                self.outputs.push_back(ClientOutput::Rejected { body, reason });
            }
        }
    }

    /// Takes out a body that is no longer in the world, or that another one has the id of.
    fn drop_body(&mut self, id: BodyId) {
        self.bodies.remove(&id);
        self.note_change(id);
        self.forget(id);
        // What it asked to have removed is gone: the user is told so once.
        self.unanswered.retain(|asked| *asked != FromClient::Despawn(id));
        self.outputs.push_back(ClientOutput::Removed(id));
    }

    fn forget(&mut self, id: BodyId) {
        self.receiver.forget(id);
        self.showing.iter_mut().for_each(|showing| showing.forget(id));
    }

    /// Takes in a body of the server's record, unless what the leader sent before is newer.
    fn know(&mut self, body: BodyRecord) {
        let is_newer = |view: &BodyView| match body.traits.kind {
            // A fixed body is as the server says.
            BodyKind::Fixed => view.body != body,
            _ => view.settled.0 < body.epoch,
        };
        if self.bodies.get(&body.id).is_none_or(is_newer) {
            let outside = self.hearing().misses(&body);
            self.receiver.remember(body.id);
            self.showing.iter_mut().for_each(|showing| showing.forget(body.id));
            let id = body.id;
            self.bodies.insert(id, BodyView { outside, ..BodyView::new(body) });
            self.note_change(id);
        }
    }
}

/// Returns whether two bodies of one id, in worlds of which one replaces the other, look different.
fn is_another(a: &BodyRecord, b: &BodyRecord) -> bool {
    (&a.traits, a.user_data) != (&b.traits, b.user_data)
}

fn keep<T>(queue: &mut VecDeque<(Tick, T)>, tick: Tick, items: Vec<T>) {
    keep_newest(queue, items.into_iter().map(|item| (tick, item)));
}

fn keep_newest<T>(queue: &mut VecDeque<T>, items: impl IntoIterator<Item = T>) {
    queue.extend(items);
    let excess = queue.len().saturating_sub(MAX_EVENTS);
    queue.drain(..excess);
}
