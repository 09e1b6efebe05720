//! Implements the server, which knows all nodes and clients, records every body, and decides membership
//! (thesis 3.3.5, 4.3.1, 4.3.3). The server may fail and come back: it stores what it must know again before
//! anything follows from it.

mod arbiter;
mod avatars;
mod budget;
mod builders;
mod clients;
mod common;
mod drain;
mod fading;
mod group;
mod moves;
mod nodes;
mod postponed;
mod program;
mod questions;
mod regroup;
mod retold;
mod save;
mod status;
mod steered;
mod stored;
#[cfg(test)]
mod tests;
mod unused;
mod verdicts;
mod vicinity;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use self::common::{ABSENCE, Common};
use self::group::Group;
use self::nodes::Resumption;
use self::questions::Questions;
use self::status::Statuses;
use super::{Batch, Peer, Pinger, PollCounts, Polls, Record};
use crate::protocol::{
    BuildOp, EnvironmentProperties, Farewell, Finding, FromClient, Hello, JoinAs, Member, Message, Query,
    QueryResult, Refusal, ShapeHash, ShapeRecord, ToClient, VERSION, View, ViewNumber, WorldEvents,
};
use crate::space::{BodyId, ClientId, GroupId, NodeId, Tick, Viewpoint};

pub use self::avatars::{MAX_AVATARS, MAX_SHAPE_BYTES};
pub use self::builders::{MAX_BUILT, MAX_BUILT_SHAPE_BYTES};
pub use self::drain::DrainError;
pub use self::group::Audit;
pub use self::regroup::Grouping;
pub use self::save::SavedWorld;
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) use self::stored::summary::{difference, highest_names, movable_bodies};
pub use self::stored::{RestoreError, ServerOrigin};
pub use self::verdicts::Verification;

/// The longest time between two wake-ups of the server while something is due.
const BEAT: Duration = Duration::from_millis(250);
/// A pause between two wake-ups that is longer than this means that the server's process was stopped.
const STOPPED: Duration = BEAT.saturating_mul(2);
/// The reason that all nodes and clients are given when the world ends.
pub const WORLD_ENDED: &str = "the world has ended";
/// The interval between two writes of the states of bodies to the directory.
const STORE_EVERY: Duration = Duration::from_secs(2);

/// The configuration of a server.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The properties of the world.
    pub world: EnvironmentProperties,
    /// Tells a world that begins now from those that the server served before: drawn by chance. A stored world keeps
    /// its own.
    pub incarnation: u64,
    /// The number of nodes to wait for before the world first begins; at least 1.
    pub min_nodes: usize,
    /// The rules of which nodes may share a group, besides the delay thresholds of the world.
    pub grouping: Grouping,
    /// How long the avatars of a client that left wait for its return.
    pub avatar_expiry: Duration,
    /// Says whether the server's program hears of contacts of bodies that ask for them
    /// ([`ServerOutput::Contacts`]).
    pub events: bool,
    /// The check that nodes can build the shapes that a client brings. A shape on record that they cannot
    /// build would stop all nodes that join later.
    pub can_build: CanBuild,
}

/// A function that returns whether new shapes, each listed after its parts, can be built beside those on
/// record.
pub type CanBuild = fn(&BTreeMap<ShapeHash, ShapeRecord>, &[ShapeRecord]) -> bool;

/// An event for a server: a message, a lost link, a command of its operator, or a request of its program.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "an event lives for one call")]
pub enum ServerEvent {
    /// A link is gone.
    Disconnected(Peer),
    /// A decoded message has arrived. The first message on a link is [`Message::Hello`].
    Message {
        /// The other end of the link, as its certificate names it.
        from: Peer,
        /// The message.
        message: Message,
    },
    /// A process is no longer wanted. Its regions are handed over first, and its avatars wait for its return.
    SendAway {
        /// Its id as a node, if it is one.
        node: Option<NodeId>,
        /// Its id as a client, if it is one.
        client: Option<ClientId>,
        /// The reason that it is told.
        reason: String,
    },
    /// A node is to leave. Its regions are handed over first ([`Server::check_drain`]).
    Drain(NodeId),
    /// The world is to end, and all are to be told.
    Stop,
    /// The server's program changes the world, in this order.
    Program(Vec<BuildOp>),
    /// The server's program looks at the world from these viewpoints from now on, and from no others.
    Look(Vec<Viewpoint>),
    /// The server's program goes back to a saved world, or to another world.
    Replace(Box<SavedWorld>),
    /// A client has proved by its certificate that it may build.
    MayBuild(ClientId),
    /// The world is to be saved as it is after one tick ([`ServerOutput::Saved`]).
    Save,
    /// The server's program queries bodies. The question's number differs from those of all questions before.
    Ask(Query),
    /// The server's program no longer wants the answer to the question of this number.
    Forget(u64),
    /// The server is to stop, and its world to go on. What is known is written down, and nobody is told.
    Suspend,
}

/// An action that a server wants done. Actions are to be done in order.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerOutput {
    /// Write this batch to the directory before anything that follows is done, durably if the batch says so.
    Store(Batch),
    /// Send this message.
    Send {
        /// The link to send it over.
        to: Peer,
        /// The message.
        message: Message,
    },
    /// Close the link once everything is sent. No [`ServerEvent::Disconnected`] is needed.
    Close {
        /// The peer at the other end.
        peer: Peer,
        /// The reason.
        farewell: Farewell,
        /// The reason in words, for people.
        reason: String,
    },
    /// A view begins.
    Began {
        /// The group.
        group: GroupId,
        /// Its view.
        view: View,
    },
    /// A group has changed its tree or its allocation within its view.
    Repartitioned {
        /// The group.
        group: GroupId,
        /// Its view, as it is now.
        view: View,
    },
    /// No node of a group is left, or the server hears of none. The record holds the group's world.
    Held {
        /// The group.
        group: GroupId,
        /// The last tick on record.
        tick: Tick,
    },
    /// A group without members was dissolved.
    Dissolved(GroupId),
    /// A node was expelled from its view: it could not be reached.
    Expelled(NodeId),
    /// A node left its view, and begins anew in another group.
    Moved(NodeId),
    /// A node computes the world by itself until links come. It is a new or restarted node that some members
    /// do not reach, or a participant that is the only one not to reach a dedicated node.
    Unreached(NodeId),
    /// The leader's finding about a participant that was verified. A participant that computes otherwise than
    /// it should is sent away.
    Verdict {
        /// The participant.
        node: NodeId,
        /// The tick that the finding is about.
        tick: Tick,
        /// The finding.
        finding: Finding,
    },
    /// An audit of what all members of all groups own, made when the world is to end.
    Audited(Audit),
    /// The answer to [`ServerEvent::Ask`].
    Answered {
        /// The number of the question.
        number: u64,
        /// What was found.
        found: QueryResult,
    },
    /// Contacts of bodies that ask for them, each pair of bodies once.
    Contacts(WorldEvents),
    /// The answer to [`ServerEvent::Save`].
    Saved(Box<SavedWorld>),
    /// The world has ended and all have been told. What is stored of the world is of no use any more.
    Ended,
    /// Everything that is known has been stored. The server may stop.
    Suspended,
}

/// The server as a state machine: it takes in events and returns outputs.
#[derive(Clone, Debug)]
pub struct Server {
    common: Common,
    groups: BTreeMap<GroupId, Group>,
    /// The group whose record is the world's, except for bodies for which another group is authoritative.
    main: GroupId,
    last_group: GroupId,
    arbiter: arbiter::Arbiter,
    polls: Polls,
    questions: Questions,
    statuses: Statuses,
    /// How long the server was stopped, in total. That time does not count: what others sent meanwhile is yet
    /// to be heard.
    stopped: Duration,
    /// Says whether the server was stopped before the last event. A server that is late every time is slow, and
    /// its time passes.
    was_stopped: bool,
    looked_at: Duration,
    store_at: Option<Duration>,
    /// The time from which velocities of kinematic bodies may be written down again.
    steered_at: Duration,
    welcomes: u64,
    /// Clients that left, in order, each with the time at which its avatars are forgotten.
    gone: VecDeque<(Duration, ClientId)>,
    ended: bool,
}

impl Server {
    /// Returns a server with a world that waits for nodes.
    pub fn new(config: ServerConfig, record: Record) -> Self {
        assert!(config.min_nodes > 0, "a world begins with at least one node");
        let main = GroupId(1);
        let common = Common {
            viewpoints: config.world.viewpoints.clone(),
            config,
            now: Duration::ZERO,
            nodes: BTreeMap::new(),
            clients: BTreeMap::new(),
            allowances: BTreeMap::new(),
            greetings: BTreeMap::new(),
            failures: BTreeMap::new(),
            number: ViewNumber(0),
            begun: false,
            stopping: false,
            stale: 0,
            world_changed: true,
            next_ids: record.next_ids(),
            groups_changed: BTreeSet::new(),
            fading: Default::default(),
            departed: Default::default(),
            outputs: VecDeque::new(),
        };
        let mut group = Group::new(main, record, Tick(0));
        group.record.mark_all(Default::default());
        let groups = [(main, group)].into();
        let arbiter = arbiter::Arbiter::default();
        let polls = Polls::new(common.config.grouping.poll_rules());
        Self {
            polls,
            questions: Questions::default(),
            statuses: Statuses::default(),
            stopped: Duration::ZERO,
            was_stopped: false,
            looked_at: Duration::ZERO,
            common,
            groups,
            main,
            last_group: main,
            arbiter,
            store_at: None,
            steered_at: Duration::ZERO,
            welcomes: 0,
            gone: VecDeque::new(),
            ended: false,
        }
    }

    /// Takes an event in. [`Server::poll_output`] returns what follows from it. `now` never goes back.
    pub fn handle(&mut self, now: Duration, event: ServerEvent) {
        let mark = self.begin(now);
        if let ServerEvent::Disconnected(peer) = &event {
            self.statuses.forget(*peer);
        }
        match event {
            ServerEvent::Disconnected(Peer::Node(node)) => self.unlink_node(node),
            ServerEvent::Disconnected(Peer::Client(client)) => {
                let until = self.common.now + ABSENCE;
                if let Some(entry) = self.common.clients.get_mut(&client) {
                    entry.linked = false;
                    entry.absent_until = Some(until);
                }
            }
            ServerEvent::Disconnected(Peer::Server) => {}
            ServerEvent::Message { from, message: Message::Hello(hello) } => self.hello(from, hello),
            ServerEvent::Message { from: Peer::Node(node), message: Message::ToServer(message) } => {
                if self.common.nodes.contains_key(&node) {
                    self.hear_node(node, message);
                }
            }
            ServerEvent::Message {
                from,
                message: Message::FromClient(client, FromClient::Build { number, ops }),
            } => self.hear_builder(from, client, number, ops),
            ServerEvent::Message { from, message: Message::FromClient(client, message) } => {
                if self.speaks_for(from, client) && self.common.clients.contains_key(&client) {
                    self.hear_client(client, message);
                } else {
                    self.common.stale += 1;
                }
            }
            ServerEvent::Message { from, message: Message::Ping(ping) } => {
                let message = Pinger::answer(now, ping);
                self.common.outputs.push_back(ServerOutput::Send { to: from, message });
            }
            ServerEvent::Message { from, message: Message::AskStatus } => self.tell_status(from),
            ServerEvent::Message { .. } => self.common.stale += 1,
            ServerEvent::SendAway { node, client, reason } => {
                client.into_iter().for_each(|client| self.part(client));
                match (node, client) {
                    (Some(node), _) => self.send_away(node, reason),
                    (None, Some(client)) => {
                        self.common.close(Peer::Client(client), Farewell::SentAway, reason);
                    }
                    (None, None) => {}
                }
            }
            ServerEvent::Drain(node) => self.drain(node),
            ServerEvent::Program(ops) => ops.into_iter().for_each(|op| self.obey(op)),
            ServerEvent::Look(viewpoints) => self.look(viewpoints),
            ServerEvent::Replace(saved) => self.replace(*saved),
            ServerEvent::MayBuild(client) => {
                self.common.allowances.entry(client).or_default().building.may = true;
            }
            ServerEvent::Save => self.main_mut().saving = true,
            ServerEvent::Ask(question) => self.ask(question),
            ServerEvent::Forget(number) => self.unask(number),
            ServerEvent::Stop => self.common.stopping = true,
            ServerEvent::Suspend => {
                (self.common.world_changed, self.store_at) = (true, Some(Duration::ZERO));
                self.finish(mark);
                self.common.outputs.push_back(ServerOutput::Suspended);
                return;
            }
        }
        self.finish(mark);
    }

    /// Does what is due. Call it at [`Server::poll_timeout`].
    pub fn handle_timeout(&mut self, now: Duration) {
        let mark = self.begin(now);
        let now = self.common.now;
        let is_over = |until: Option<Duration>| until.is_some_and(|until| until <= now);
        let absent: Vec<_> = self
            .common
            .nodes
            .iter()
            .filter(|(_, entry)| is_over(entry.absent_until))
            .map(|(&id, _)| id)
            .collect();
        absent.into_iter().for_each(|node| self.give_up(node));
        let gone: Vec<_> = self
            .common
            .clients
            .iter()
            .filter(|(_, entry)| is_over(entry.absent_until))
            .map(|(&id, _)| id)
            .collect();
        gone.into_iter().for_each(|client| self.part(client));
        let due: Vec<_> =
            self.groups.values().filter(|group| is_over(group.hearing)).map(|group| group.id).collect();
        for id in due {
            let going = self.groups.get_mut(&id).map(|group| group.decide_complaints(&self.common));
            for (node, is_at_fault) in going.unwrap_or_default() {
                if is_at_fault
                    && !self.common.has_failed(node)
                    && let Some(group) = self.groups.get_mut(&id)
                {
                    group.has_not_counted(node);
                }
                self.set_apart(node);
            }
        }
        let mute: Vec<_> = self.groups.values_mut().flat_map(|group| group.mute(now)).collect();
        for node in mute {
            let group = self.group_of(node).and_then(|id| self.groups.get_mut(&id));
            if let Some(accuser) = group.and_then(|group| group.was_denounced_by(node)) {
                self.common.forgive(accuser);
            }
            self.common.has_failed(node);
            self.begin_anew(node);
        }
        self.handle_regrouping();
        self.ask_leader();
        self.finish(mark);
    }

    /// Returns when [`Server::handle_timeout`] is next due. Ask again after every event.
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.due().map(|due| due.min(self.common.now + BEAT) + self.stopped)
    }

    /// Returns when something is due, by the time that counts: without the time in which the server was
    /// stopped.
    fn due(&self) -> Option<Duration> {
        let nodes = self.common.nodes.values().filter_map(|entry| entry.absent_until);
        let clients = self.common.clients.values().filter_map(|entry| entry.absent_until);
        let groups = self.groups.values().flat_map(|group| group.hearing.into_iter().chain(group.mute_at()));
        nodes
            .chain(clients)
            .chain(groups)
            .chain(self.store_at)
            .chain(self.main().steered.has_unwritten().then_some(self.steered_at))
            .chain(self.questions.due())
            .chain(self.takeover_at())
            .chain(self.regrouping_at())
            .min()
            .filter(|_| !self.ended)
    }

    /// Returns the next output, until there is none.
    pub fn poll_output(&mut self) -> Option<ServerOutput> {
        self.common.outputs.pop_front()
    }

    /// Returns what tells the world from others.
    pub fn incarnation(&self) -> u64 {
        self.common.config.incarnation
    }

    /// Returns the newest tick that a member of the main group is known to have completed.
    pub fn tick(&self) -> Tick {
        self.main().tick
    }

    /// Returns whether any node has computed the world yet.
    pub fn has_begun(&self) -> bool {
        self.common.begun
    }

    /// Returns the record of the world: that of the main group.
    pub fn record(&self) -> &Record {
        &self.main().record
    }

    /// Returns the user data of a body on record, or of one that this server has had on record, unless very
    /// many bodies have gone since that one.
    pub fn user_data(&self, id: BodyId) -> Option<u128> {
        let known = self.record().body(id).map(|body| body.user_data);
        known.or_else(|| self.common.departed.get(id))
    }

    /// Returns the view (membership) of the main group, while nodes compute the world.
    pub fn view(&self) -> Option<&View> {
        self.main().view.as_ref().filter(|_| !self.main().held)
    }

    /// Returns the groups that have a view, with their views.
    pub fn views(&self) -> impl Iterator<Item = (GroupId, &View)> {
        self.groups.values().filter_map(|group| Some((group.id, group.view.as_ref()?)))
    }

    /// Returns the group whose record is the world's.
    pub fn main_group(&self) -> GroupId {
        self.main
    }

    /// Returns whether a view change is under way.
    pub fn is_changing(&self) -> bool {
        self.groups.values().any(|group| group.change.is_some())
    }

    /// Returns how many votes on membership there have been since this server started.
    pub fn poll_counts(&self) -> PollCounts {
        self.polls.counts()
    }

    /// Returns the clients that have joined and are linked.
    pub fn linked_clients(&self) -> impl Iterator<Item = ClientId> {
        self.common.clients.iter().filter(|(_, entry)| entry.linked).map(|(&client, _)| client)
    }

    /// Returns the nodes that have joined and are linked.
    pub fn linked_nodes(&self) -> impl Iterator<Item = NodeId> {
        self.common.nodes.iter().filter(|(_, entry)| entry.linked).map(|(&node, _)| node)
    }

    /// Returns the count of messages dropped because they were of an earlier view or from a sender that may
    /// not send them.
    pub fn stale(&self) -> u64 {
        self.common.stale
    }

    /// Returns whether a node leads the main group in the view of this number.
    fn is_led_by(&self, node: NodeId, view: ViewNumber) -> bool {
        self.view().is_some_and(|present| present.leader == node && present.number == view)
    }

    fn main(&self) -> &Group {
        &self.groups[&self.main]
    }

    fn main_mut(&mut self) -> &mut Group {
        self.groups.get_mut(&self.main).expect("there is a main group")
    }

    fn begin(&mut self, now: Duration) -> usize {
        let passed = now.checked_sub(self.stopped + self.common.now).expect("time never goes back");
        let is_late = passed > STOPPED && self.due().is_some();
        self.was_stopped = is_late && !self.was_stopped;
        let counted = if self.was_stopped { &mut self.stopped } else { &mut self.common.now };
        *counted += passed;
        self.common.outputs.len()
    }

    /// Ends the handling of any event: corrects membership, and puts the writes of what changed before the
    /// outputs of the event, which begin at `mark`.
    fn finish(&mut self, mark: usize) {
        if self.ended {
            return;
        }
        self.forget_avatars();
        self.forget_shapes();
        self.part_from_astray();
        self.take_over();
        self.release();
        self.welcome_moved();
        self.assign();
        let is_done = |group: &Group| {
            group.view.as_ref().is_some_and(|view| {
                view.members.iter().all(|member| group.at_last_tick.contains(&member.node))
            })
        };
        self.common.stopping |= self.groups.values().all(is_done);
        for group in self.groups.values_mut() {
            group.reconsider(&mut self.common);
        }
        self.tidy();
        self.welcome_moved();
        self.tell_leaders();
        let now = self.common.now;
        let soft = self.store_at.take_if(|at| *at <= now).is_some();
        if self.steered_at <= now {
            let main = self.main_mut();
            if main.steered.mark_unwritten(&mut main.record) {
                self.steered_at = now + steered::WRITE_EVERY;
            }
        }
        self.store(mark, soft);
        if self.main().record.has_moved() {
            self.store_at.get_or_insert(now + STORE_EVERY);
        }
        if self.common.stopping && self.groups.values().all(|group| group.audit.is_some()) {
            self.end();
        }
    }

    /// Returns whether a process may pass on what a client says: the client itself, its own node, or the
    /// leader of its group.
    fn speaks_for(&self, from: Peer, client: ClientId) -> bool {
        match from {
            Peer::Client(linked) => linked == client,
            Peer::Node(node) => {
                let entry = self.common.clients.get(&client);
                let group = entry.and_then(|entry| self.groups.get(&entry.group));
                group.is_some_and(|group| group.leads(node))
                    || self.common.nodes.get(&node).is_some_and(|entry| entry.member.client == Some(client))
            }
            Peer::Server => false,
        }
    }

    fn hello(&mut self, from: Peer, hello: Hello) {
        let refusal = Refusal::Version { theirs: hello.version, ours: VERSION };
        match (from, hello.role) {
            _ if hello.version != VERSION => {
                let reason = refusal.to_string();
                if let Peer::Client(client) = from {
                    self.common.send_client(client, ToClient::Rejected { body: None, reason: refusal });
                }
                self.turn_away(from, reason);
            }
            (Peer::Node(node), JoinAs::Node { .. }) if !self.common.may_greet(node) => {
                self.turn_away(from, Refusal::TooMany.to_string());
            }
            (Peer::Node(node), JoinAs::Node { address, client, resume, heard }) => {
                let member = Member { node, address, client };
                match resume.map_or(Resumption::Anew, |view| self.resumption(node, view)) {
                    Resumption::Member(group) => self.resume(member, group, heard),
                    Resumption::Undecided => self.link_again(member, resume.unwrap_or_default(), heard),
                    Resumption::Anew => {
                        let unwanted = self.common.nodes.get(&node).and_then(|entry| entry.unwanted.clone());
                        self.lose(node);
                        if let Some((farewell @ Farewell::SentAway, reason)) = unwanted {
                            // A node that is sent away keeps its link until it has handed its regions over.
                            // This one has let go of them.
                            self.common.dismiss(node, farewell, reason);
                            return self.common.tell_roster();
                        }
                        // Nodes that could not reach it before may reach it now.
                        for entry in self.common.nodes.values_mut() {
                            entry.delays.remove(&node);
                        }
                        self.welcome_node(member, 0);
                        self.is_anew(node);
                    }
                }
            }
            (Peer::Client(client), JoinAs::Client { interest }) => self.welcome_client(client, interest),
            _ => {
                let reason = "its certificate is for another role than the one it wants to play".to_owned();
                self.turn_away(from, reason);
            }
        }
    }

    /// Turns away a peer whose greeting is not accepted. Its earlier link ends with this one, without a
    /// message of its own: the peer loses the role that it had there.
    fn turn_away(&mut self, from: Peer, reason: String) {
        match from {
            Peer::Node(node) => {
                let was_here = self.common.nodes.contains_key(&node);
                self.lose(node);
                self.common.dismiss(node, Farewell::Refused, reason);
                if was_here {
                    self.common.tell_roster();
                }
            }
            Peer::Client(client) => {
                self.common.close(from, Farewell::Refused, reason);
                self.part(client);
            }
            Peer::Server => self.common.close(from, Farewell::Refused, reason),
        }
    }

    /// Tells everybody that the world is over.
    fn end(&mut self) {
        let mut found = Audit::default();
        for audit in self.groups.values_mut().filter_map(|group| group.audit.take()) {
            found.lost.extend(audit.lost);
            found.doubled.extend(audit.doubled);
            found.unanswered |= audit.unanswered;
        }
        self.common.outputs.push_back(ServerOutput::Audited(found));
        for node in self.common.nodes.keys().copied().collect::<Vec<_>>() {
            self.common.dismiss(node, Farewell::Ended, WORLD_ENDED.into());
        }
        for client in std::mem::take(&mut self.common.clients).into_keys() {
            self.common.close(Peer::Client(client), Farewell::Ended, WORLD_ENDED.into());
        }
        for group in self.groups.values_mut() {
            (group.view, group.change) = (None, None);
        }
        self.ended = true;
        self.common.outputs.push_back(ServerOutput::Ended);
    }
}
