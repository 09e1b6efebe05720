//! Implements a node, a process that computes regions: it takes part in the group's lockstep and view changes, and leads the
//! group if the server says so. The physics is a device behind [`PhysicsCommand`] and [`PhysicsEvent`].

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
    /// Where others reach it.
    pub address: SocketAddr,
    /// The client in the same process, if any.
    pub client: Option<ClientId>,
    /// The area of interest of that client at first.
    pub interest: Option<Area>,
    /// Ticks between checkpoints of moved bodies to the server; at most 0.5 s worth.
    pub checkpoint_every: u64,
    /// How long others are waited for before the node computes speculative ticks for its clients.
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
        /// Over which link.
        from: Peer,
        /// What it says.
        message: Message,
    },
    /// The physics has done what it was asked.
    Physics(PhysicsEvent),
    /// A message of the client in the same process to the leader.
    Client(FromClient),
    /// The user wants the node to leave; it ends with [`NodeOutput::Stopped`].
    Leave,
}

/// An action that a node wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum NodeOutput {
    /// Send this; wait with it while the link is being made.
    Send {
        /// Over which link.
        to: Peer,
        /// What.
        message: Message,
    },
    /// Make a link to the server, and answer with [`NodeEvent::Connected`] or [`NodeEvent::Disconnected`].
    Redial,
    /// Make a link to this member, and answer with [`NodeEvent::Connected`] or [`NodeEvent::Disconnected`].
    Connect(Member),
    /// Close the link to a former member.
    Disconnect(NodeId),
    /// Give the physics this.
    Physics(PhysicsCommand),
    /// A message of the leader to the client in the same process.
    Client(ToClient),
    /// A tick is complete here.
    Settled(Tick),
    /// The node has stopped.
    Stopped {
        /// Why.
        farewell: Farewell,
        /// The same for people.
        reason: String,
    },
}

/// Counters of what was dropped, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeCounters {
    /// Messages of an earlier view or tick.
    pub stale: u64,
    /// Messages from a sender that may not send them.
    pub refused: u64,
    /// Early border messages and inputs beyond their bounds.
    pub overflow: u64,
    /// Clients' inputs that the leader refused.
    pub rejected: u64,
    /// Speculative ticks: computed without the others, for clients only.
    pub speculative: u64,
    /// Ticks of participants that were computed once more here, and found right.
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
    /// The newest view in which the server has placed a body that members may have, of whatever group.
    newest_view: u64,
    /// Members whose border messages are waited for; not this node.
    others: BTreeSet<NodeId>,
    tick: Tick,
    phase: Phase,
    /// The physics owes an answer; for a view change: for which.
    busy: bool,
    asked: Option<ViewNumber>,
    /// Answers that the physics owes from before the node began anew.
    void: u32,
    /// Since when nothing that counts has been computed or heard, and how long the last tick took.
    since: Duration,
    tick_takes: Duration,
    /// When the leader last said anything.
    since_leader: Option<Duration>,
    /// When other members last said that they wait, too.
    waiting: BTreeMap<NodeId, Duration>,
    /// When this node, if it waits, says so again (heartbeat).
    reassure_at: Duration,
    complained_at: Duration,
    speculation: Speculation,
    /// Dispatches of the present view that another member may not have completed, and the newest tick of all.
    dispatches: VecDeque<Dispatch>,
    dispatched: Tick,
    /// Messages up to this tick have been taken in before their time, for a view change.
    drained: Tick,
    holds: Vec<BodyId>,
    change: Option<PendingView>,
    /// What the leader dispatched since the change began: it counts if nothing comes of the change.
    held: Vec<Dispatch>,
    placed: Vec<Placed>,
    joints: Vec<JointRecord>,
    early: BTreeMap<NodeId, VecDeque<Border>>,
    leader: Option<Leader>,
    /// The events for a replication that runs elsewhere, if it does.
    replication: Option<Vec<ReplicationEvent>>,
    relay: Relay,
    /// What clients sent before this node leads.
    inputs: Vec<(ClientId, FromClient)>,
    /// What nodes that are no members yet passed on of their clients.
    early_words: Vec<(NodeId, ClientId, FromClient)>,
    /// The logical times of the newest inputs of each kind that ticks have done here, for the leader that this node may be.
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
    /// The physics computes a round, or takes the messages of one in.
    Computing(Tick, u32),
    Exchanging(Exchange),
}

/// The exchange of border messages after a round.
#[derive(Clone, Debug)]
struct Exchange {
    tick: Tick,
    round: u32,
    /// The members whose messages are waited for, and get this node's.
    with: BTreeSet<NodeId>,
    /// Those for this node's regions so far; from its own regions too.
    arrived: BTreeMap<NodeId, Vec<BorderMessage>>,
}

/// A view change as far as it has come here.
#[derive(Clone, Debug)]
struct PendingView {
    view: ViewNumber,
    /// What is to be completed before, as far as it has been told.
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
        // Until its client says otherwise.
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

    /// Has the states for clients chosen and coded by a [`StateReplication`](super::StateReplication) of its user's, which is given the events of
    /// [`Node::take_replication_events`].
    #[must_use]
    pub fn with_replication_elsewhere(self) -> Self {
        Self { replication: Some(Vec::new()), ..self }
    }

    /// Returns the events for a replication elsewhere since the last call; to be asked when there is no output.
    pub fn take_replication_events(&mut self) -> Vec<ReplicationEvent> {
        self.replication.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Takes an event in; [`Node::poll_output`] tells what follows from it.
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

    /// Does what is due; to be called at [`Node::poll_timeout`].
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

    /// Returns when [`Node::handle_timeout`] is next due; ask again after every event.
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

    /// Returns its id.
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

    /// Returns the newest tick that it has opened as the leader, when that was by its clock, and how long a tick is.
    pub fn opened(&self) -> Option<(Tick, Duration, Duration)> {
        self.leader.as_ref().map(Leader::opened)
    }

    /// Returns whether it computes speculative ticks, because others are waited for.
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

    /// Returns how many ticks later the border messages of others are taken in.
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
                // The link that was to be closed is replaced by this one, which would be closed in its place, unheard.
                self.outputs.retain(|output| *output != NodeOutput::Disconnect(node));
                self.link_up(now, node);
            }
            Peer::Client(client) => {
                if let Some(leader) = &mut self.leader {
                    leader.admit(client);
                }
                // What it was told over the link before counts no more.
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
            // Only the server decides that a member is dead; until then its messages are waited for.
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
            // Nobody can be done with a view before its leader has begun it: the leader's border message is waited for.
            (Peer::Node(node), Message::Done(done)) => match &mut self.leader {
                Some(leader) if done.view == leader.view() => leader.done(node, done),
                _ => self.counters.stale += 1,
            },
            (Peer::Node(node), Message::Report(report)) => match &mut self.leader {
                // Who is verified says nothing of a tick once it is done with it: that is compared then.
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
