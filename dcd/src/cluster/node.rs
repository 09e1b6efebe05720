//! Implements a node, a process that computes regions: it takes part in the group's lockstep and view
//! changes, and leads the group if the server says so. The physics is a device behind [`PhysicsCommand`] and
//! [`PhysicsEvent`].

mod borders;
mod clients;
mod links;
mod lockstep;
mod relay;
mod reports;
mod speculation;
#[cfg(test)]
mod tests;
mod verifier;
mod view_change;
mod witness;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::time::Duration;

use self::links::Links;
use self::relay::Relay;
use self::reports::Reports;
use self::speculation::Speculation;
use self::verifier::Verifier;
use self::witness::Witness;
use super::{DelayMonitor, Leader, Peer, PhysicsCommand, PhysicsEvent, Pinger, ReplicationEvent};
use crate::protocol::{
    Area, Border, BorderMessage, Dispatch, Done, EnvironmentProperties, Farewell, FromClient, JointRecord,
    Member, Message, Placed, ToClient, ToServer, View, ViewNumber,
};
use crate::space::{BodyId, ClientId, NodeId, Tick};

/// The configuration of a node.
#[derive(Clone, Debug)]
pub struct NodeConfig {
    /// Its id, as on its certificate.
    pub id: NodeId,
    /// The address at which others reach it.
    pub address: SocketAddr,
    /// The client in the same process, if any.
    pub client: Option<ClientId>,
    /// The area of interest of that client at first; `None` is everything.
    pub interest: Option<Area>,
    /// The number of ticks between checkpoints of moved bodies to the server; at most 0.5 s worth.
    pub checkpoint_every: u64,
    /// The time for which the node waits for others before it computes speculative ticks for its clients.
    pub patience: Duration,
}

/// An event for a node: a message, a link, or an answer of its physics, its client or its user.
#[derive(Clone, Debug, PartialEq)]
pub enum NodeEvent {
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
    /// The physics has done what it was asked.
    Physics(PhysicsEvent),
    /// A message from the client in the same process to the leader.
    Client(FromClient),
    /// The user wants the node to leave. It ends with [`NodeOutput::Stopped`].
    Leave,
}

/// An action that a node wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum NodeOutput {
    /// Send this message. Keep it while the link is being made.
    Send {
        /// The link to send it over.
        to: Peer,
        /// The message.
        message: Message,
    },
    /// Make a link to the server, and answer with [`NodeEvent::Connected`] or [`NodeEvent::Disconnected`].
    Redial,
    /// Make a link to this member, and answer with [`NodeEvent::Connected`] or [`NodeEvent::Disconnected`].
    Connect(Member),
    /// Close the link to a former member.
    Disconnect(NodeId),
    /// Give the physics this command.
    Physics(PhysicsCommand),
    /// A message of the leader to the client in the same process.
    Client(ToClient),
    /// A tick is complete here.
    Settled(Tick),
    /// The node has stopped.
    Stopped {
        /// Why it has stopped.
        farewell: Farewell,
        /// The reason in words, for people.
        reason: String,
    },
}

/// The counters of what a node dropped, by reason, and of ticks beside the lockstep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeCounters {
    /// The number of messages of an earlier view or tick.
    pub stale: u64,
    /// The number of messages from senders that may not send them.
    pub refused: u64,
    /// The number of early border messages and inputs beyond their bounds.
    pub overflow: u64,
    /// The number of clients' inputs that the leader refused.
    pub rejected: u64,
    /// The number of speculative ticks: computed without the others, for clients only.
    pub speculative: u64,
    /// The number of participants' ticks that were computed once more here, and found right.
    pub verified: u64,
}

/// The state machine of a node.
#[derive(Clone, Debug)]
pub struct Node {
    config: NodeConfig,
    world: Option<EnvironmentProperties>,
    view: Option<View>,
    /// How often the tree has changed in the view.
    division: u32,
    /// The newest view, of any group, in which the server has placed a body that members may have.
    newest_view: u64,
    /// The other members that are still there: those whose border messages may be waited for.
    others: BTreeSet<NodeId>,
    tick: Tick,
    phase: Phase,
    /// Says whether the physics owes an answer, and for which view change the newest survey or fetch was asked.
    busy: bool,
    asked: Option<ViewNumber>,
    /// The number of answers that the physics owes from before the node began anew.
    void: u32,
    /// The time at which the physics last answered (speculative ticks and drains aside) or the view began,
    /// and how long that answer took to come after the one before.
    since: Duration,
    tick_takes: Duration,
    /// The time at which the leader last said anything.
    since_leader: Option<Duration>,
    /// The time at which each other member last said that it waits, too.
    waiting: BTreeMap<NodeId, Duration>,
    /// The earliest time at which this node, if it waits, says so again (heartbeat).
    reassure_at: Duration,
    complained_at: Duration,
    speculation: Speculation,
    /// Dispatches of the present view that another member may not have completed, and the newest dispatched
    /// tick.
    dispatches: VecDeque<Dispatch>,
    dispatched: Tick,
    /// Border messages up to this tick have been taken in before their time, for a view change or a change of
    /// the tree.
    drained: Tick,
    holds: Vec<BodyId>,
    change: Option<PendingView>,
    /// Dispatches that have come since the change began: they count if nothing comes of the change.
    held: Vec<Dispatch>,
    placed: Vec<Placed>,
    joints: Vec<JointRecord>,
    early: BTreeMap<NodeId, VecDeque<Border>>,
    leader: Option<Leader>,
    /// The events for a state replication that runs elsewhere, if it does.
    replication: Option<Vec<ReplicationEvent>>,
    relay: Relay,
    /// Messages of clients that came before this node led.
    inputs: Vec<(ClientId, FromClient)>,
    /// Messages of clients that nodes passed on which are no members yet.
    early_words: Vec<(NodeId, ClientId, FromClient)>,
    /// The logical times of the newest inputs of each kind that ticks have done here, for the leader that
    /// this node may become.
    done_inputs: BTreeMap<(BodyId, bool), u64>,
    /// The newest interest of the client in this process.
    interest: Option<FromClient>,
    links: BTreeSet<Peer>,
    link: Links,
    /// The newest `Done`s to the leader, as many as it may not have heard.
    done: VecDeque<Done>,
    reports: Reports,
    /// The tick that the server was last sent.
    told: Tick,
    leaving: bool,
    witness: Witness,
    verifier: Verifier,
    watch: Option<DelayMonitor>,
    pinger: Pinger,
    counters: NodeCounters,
    stopped: bool,
    outputs: VecDeque<NodeOutput>,
}

#[derive(Clone, Debug)]
enum Phase {
    Resting,
    /// The physics computes a round, or takes in the border messages of one.
    Computing(Tick, u32),
    Exchanging(Exchange),
}

/// The exchange of border messages after a round.
#[derive(Clone, Debug)]
struct Exchange {
    tick: Tick,
    round: u32,
    /// The members whose messages are waited for, and that get this node's.
    with: BTreeSet<NodeId>,
    /// The members that it would exchange with too if they were not lost.
    lost: BTreeSet<NodeId>,
    /// The messages for this node's regions so far, also from its own regions.
    arrived: BTreeMap<NodeId, Vec<BorderMessage>>,
}

/// A view change, as far as it has come here.
#[derive(Clone, Debug)]
struct PendingView {
    view: ViewNumber,
    /// The dispatches that are to be completed before, as far as they have been told.
    dispatches: Vec<Dispatch>,
    finish: bool,
    drained: bool,
    surveyed: bool,
    fetch: Option<Vec<BodyId>>,
    adopt: Option<(View, Vec<BodyId>)>,
}

impl PendingView {
    fn to(view: ViewNumber) -> Self {
        Self {
            view,
            dispatches: Vec::new(),
            finish: false,
            drained: false,
            surveyed: false,
            fetch: None,
            adopt: None,
        }
    }
}

impl Node {
    /// Returns a node without links. The first event is [`NodeEvent::Connected`] with [`Peer::Server`].
    pub fn new(config: NodeConfig) -> Self {
        assert!(config.checkpoint_every > 0, "samples are at least a tick apart");
        // This interest counts until the client says otherwise.
        let interest = config.client.map(|_| FromClient::Interest(config.interest));
        Self {
            config,
            world: None,
            view: None,
            division: 0,
            newest_view: 0,
            others: BTreeSet::new(),
            tick: Tick(0),
            phase: Phase::Resting,
            busy: false,
            asked: None,
            void: 0,
            since: Duration::ZERO,
            tick_takes: Duration::ZERO,
            since_leader: None,
            waiting: BTreeMap::new(),
            reassure_at: Duration::ZERO,
            complained_at: Duration::ZERO,
            speculation: Speculation::default(),
            dispatches: VecDeque::new(),
            dispatched: Tick(0),
            drained: Tick(0),
            holds: Vec::new(),
            change: None,
            held: Vec::new(),
            placed: Vec::new(),
            joints: Vec::new(),
            early: BTreeMap::new(),
            leader: None,
            replication: None,
            relay: Relay::default(),
            inputs: Vec::new(),
            early_words: Vec::new(),
            done_inputs: BTreeMap::new(),
            interest,
            links: BTreeSet::new(),
            link: Links::default(),
            done: VecDeque::new(),
            reports: Reports::default(),
            told: Tick(0),
            leaving: false,
            witness: Witness::default(),
            verifier: Verifier::default(),
            watch: None,
            pinger: Pinger::default(),
            counters: NodeCounters::default(),
            stopped: false,
            outputs: VecDeque::new(),
        }
    }

    /// Leaves the states for clients to a [`StateReplication`](super::StateReplication) of the caller's,
    /// which is given the events of [`Node::take_replication_events`].
    #[must_use]
    pub fn with_replication_elsewhere(self) -> Self {
        Self { replication: Some(Vec::new()), ..self }
    }

    /// Returns the events for a replication elsewhere since the last call. Call it when there is no output.
    pub fn take_replication_events(&mut self) -> Vec<ReplicationEvent> {
        self.replication.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Takes an event in. [`Node::poll_output`] returns what follows from it.
    pub fn handle(&mut self, now: Duration, event: NodeEvent) {
        if self.stopped {
            return;
        }
        match event {
            NodeEvent::Connected(peer) => self.connected(now, peer),
            NodeEvent::Disconnected(peer) => self.disconnected(now, peer),
            NodeEvent::Message { from, message } => self.message(now, from, message),
            NodeEvent::Physics(event) => self.physics(now, event),
            NodeEvent::Client(message) => self.own_client(message),
            NodeEvent::Leave => {
                self.leaving = true;
                self.send_server(ToServer::Leave);
            }
        }
        if !self.stopped {
            self.progress(now);
        }
    }

    /// Does what is due. Call it at [`Node::poll_timeout`].
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.stopped {
            return;
        }
        for (to, message) in self.pinger.due(now) {
            self.send(to, message);
        }
        self.tend_links(now);
        self.complain_of_stalled(now);
        self.reassure(now);
        self.progress(now);
        self.speculate(now);
    }

    /// Returns when [`Node::handle_timeout`] is next due. Ask again after every event.
    pub fn poll_timeout(&self) -> Option<Duration> {
        if self.stopped {
            return None;
        }
        let dispatch = match (&self.leader, &self.change) {
            (Some(leader), None) => leader.timeout(),
            _ => None,
        };
        dispatch
            .into_iter()
            .chain(self.pinger.timeout())
            .chain(self.link.timeout(&self.others))
            .chain(self.stalled_at())
            .chain(self.reassurance_at())
            .chain(self.speculation_due())
            .min()
    }

    /// Returns the next output, until there is none.
    pub fn poll_output(&mut self) -> Option<NodeOutput> {
        self.outputs.pop_front()
    }

    /// Returns the node's id.
    pub fn id(&self) -> NodeId {
        self.config.id
    }

    /// Returns the last completed tick.
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Returns the present view: the membership.
    pub fn view(&self) -> Option<&View> {
        self.view.as_ref()
    }

    /// Returns the leader's state, while this node leads.
    pub fn leader(&self) -> Option<&Leader> {
        self.leader.as_ref()
    }

    /// Returns the counters of what was dropped.
    pub fn counters(&self) -> NodeCounters {
        self.counters
    }

    /// Returns, while this node leads, the newest tick that it has opened, when that was by its clock, and
    /// how long a tick is.
    pub fn opened(&self) -> Option<(Tick, Duration, Duration)> {
        self.leader.as_ref().map(Leader::opened)
    }

    /// Returns whether the node computes speculative ticks, because others are waited for.
    pub fn is_speculating(&self) -> bool {
        self.speculation.is_running()
    }

    /// Returns whether the link to the server is up.
    pub fn has_server(&self) -> bool {
        self.link.server_up()
    }

    /// Returns the round trips to peers.
    pub fn pinger(&self) -> &Pinger {
        &self.pinger
    }

    /// Returns how many ticks later than its own the border messages of others are taken in.
    fn lag(&self) -> u64 {
        self.world.as_ref().map_or(0, |world| world.protocol.lag_ticks())
    }

    fn number(&self) -> ViewNumber {
        self.view.as_ref().map_or(ViewNumber::default(), |view| view.number)
    }

    fn send(&mut self, to: Peer, message: Message) {
        self.outputs.push_back(NodeOutput::Send { to, message });
    }

    fn send_server(&mut self, message: ToServer) {
        self.send(Peer::Server, Message::ToServer(message));
    }

    fn connected(&mut self, now: Duration, peer: Peer) {
        let is_anew = !self.links.insert(peer);
        match peer {
            Peer::Server => self.greet_server(now),
            Peer::Node(node) => {
                // The new link replaces the one that was to be closed. That output would close the new one in
                // its place, unheard.
                self.outputs.retain(|output| *output != NodeOutput::Disconnect(node));
                self.link_up(now, node);
            }
            Peer::Client(client) => {
                if let Some(leader) = &mut self.leader {
                    leader.admit(client);
                }
                // What the client was told over the link before counts no more.
                if is_anew {
                    self.tell_of_link(client, false);
                }
                self.tell_of_link(client, true);
            }
        }
    }

    fn disconnected(&mut self, now: Duration, peer: Peer) {
        self.links.remove(&peer);
        self.pinger.remove(peer);
        match peer {
            Peer::Server => self.miss_server(now),
            // Only the server decides that a member is dead. Until then its messages are waited for.
            Peer::Node(node) => self.link_down(now, node),
            Peer::Client(client) => {
                if let Some(leader) = &mut self.leader {
                    leader.dismiss(client);
                }
                self.tell_of_link(client, false);
            }
        }
    }

    fn stop(&mut self, farewell: Farewell, reason: String) {
        self.stopped = true;
        self.end_leading();
        self.end_relaying();
        self.outputs.push_back(NodeOutput::Stopped { farewell, reason });
    }

    fn message(&mut self, now: Duration, from: Peer, message: Message) {
        if self.view.as_ref().is_some_and(|view| from == Peer::Node(view.leader)) {
            self.since_leader = Some(now);
        }
        match (from, message) {
            (Peer::Server, Message::ToNode(message)) => self.hear_server(now, message),
            (Peer::Node(node), Message::Dispatch(dispatch)) => self.dispatched(node, dispatch),
            (Peer::Node(node), Message::Border(border)) => self.keep_early(node, border),
            // No member can be done with a view before its leader has begun it, since the leader's border
            // message is waited for.
            (Peer::Node(node), Message::Done(done)) => match &mut self.leader {
                Some(leader) if done.view == leader.view() => leader.done(node, done),
                _ => self.counters.stale += 1,
            },
            (Peer::Node(node), Message::Report(report)) => match &mut self.leader {
                // A participant that is verified reports nothing of a tick once it is done with it: what it
                // has reported is compared then.
                Some(leader)
                    if self.verifier.verifies(node) && leader.has_done(node, report.view, report.tick) =>
                {
                    self.counters.refused += report.states.len() as u64;
                }
                Some(leader) if report.view == leader.view() => {
                    self.verifier.report(node, &report);
                    self.counters.refused += leader.report(node, report);
                }
                _ => self.counters.stale += 1,
            },
            (Peer::Node(node), message @ (Message::Testimony(_) | Message::Copied { .. }))
                if self.leader.is_some() && self.others.contains(&node) =>
            {
                self.hear_witness(node, message);
            }
            (Peer::Node(node), Message::Waiting(view)) if view == self.number() => {
                self.waiting.insert(node, now);
            }
            (Peer::Node(node), Message::Relay(message)) => self.hear_as_relay(now, node, message),
            (Peer::Node(node), Message::Linked { view, client, up }) => match &mut self.leader {
                Some(leader) if view == leader.view() => leader.linked_elsewhere(node, client, up),
                _ => self.counters.stale += 1,
            },
            (Peer::Node(node), Message::Fed { view, number }) => match &mut self.leader {
                Some(leader) if view == leader.view() => leader.fed(node, number),
                _ => self.counters.stale += 1,
            },
            (_, Message::FromClient(client, message)) => self.hear_client(from, client, message),
            (Peer::Node(node), Message::ToClient(client, message)) => {
                let leads = self.view.as_ref().is_some_and(|view| view.leader == node);
                if leads && self.config.client == Some(client) {
                    self.outputs.push_back(NodeOutput::Client(message));
                } else {
                    self.counters.refused += 1;
                }
            }
            (_, Message::Ping(ping)) => self.send(from, Pinger::answer(now, ping)),
            (_, Message::Pong(pong)) => self.hear_pong(now, from, pong),
            _ => self.counters.refused += 1,
        }
    }
}
