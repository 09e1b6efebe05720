//! Holds what all groups of a server share: nodes, clients, and messages to be sent.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use super::budget::{Account, Allowance};
use super::fading::Fading;
use super::moves::Moves;
use super::vicinity::Vicinity;
use super::{ServerConfig, ServerOutput};
use crate::cluster::departed::Departed;
use crate::cluster::{Peer, Record};
use crate::protocol::link::{CLIENT_IDLE_TIMEOUT, HANDSHAKE_TIMEOUT};
use crate::protocol::{Delay, Farewell, Member, Message, ShapeHash, ToClient, ToNode, ViewNumber};
use crate::space::{BodyId, ClientId, GroupId, NodeId, Viewpoint};

/// How long a node or client may have no link before the world goes on without it, if others can go on.
pub(super) const ABSENCE: Duration = Duration::from_secs(1);
/// How long members are waited for after the server was restarted.
pub(super) const RETURN: Duration = Duration::from_secs(3);
/// How long clients are waited for then. A client that says nothing finds out late that its link is gone, and
/// only then calls again.
pub(super) const RETURN_OF_CLIENTS: Duration = CLIENT_IDLE_TIMEOUT.saturating_add(HANDSHAKE_TIMEOUT);

/// Bounds how often a node may greet: so often at once, and so often per second. A link that breaks is made
/// anew after a second at most.
const GREETINGS: f64 = 32.0;
const GREETINGS_PER_S: f64 = 1.0;
/// Bounds how often a participant may make the others of its group stop: so often at once, and so often per
/// second. One that hangs more often computes apart from them.
const FAILURES: f64 = 8.0;
const FAILURES_PER_S: f64 = 1.0 / 300.0;

/// A node that has joined.
#[derive(Clone, Debug)]
pub(super) struct NodeEntry {
    pub member: Member,
    /// The time at which the node is given up. `None` while its link is up, or once no other node could take
    /// over.
    pub absent_until: Option<Duration>,
    pub linked: bool,
    /// Says whether it has the world, and may be given regions.
    pub loaded: bool,
    /// How many times it was sent the world over this link and has not answered.
    pub loading: u32,
    pub leaving: bool,
    /// What it is told when it leaves, if it did not ask to leave itself.
    pub unwanted: Option<(Farewell, String)>,
    /// The group that it is a member of, or is to be.
    pub group: Option<GroupId>,
    pub in_group_since: Duration,
    /// Says whether it has left a group, holds what was computed there, and is to begin anew.
    pub moved: bool,
    /// The view that it was last told to adopt.
    pub serving: Option<ViewNumber>,
    /// The newest view at the time when the node began anew. It holds nothing of that view and those before.
    pub anew_since: ViewNumber,
    pub shapes: BTreeSet<ShapeHash>,
    pub scenery: BTreeSet<BodyId>,
    /// Immovable bodies that are gone and that the node may hold. It is told of them with the next view.
    pub stale_scenery: BTreeSet<BodyId>,
    /// Round trips to other nodes, milliseconds, as the node measures them. `None`: out of reach.
    pub delays: BTreeMap<NodeId, Option<f32>>,
    /// Operations on moving bodies that it was told, if it leads.
    pub moves: Moves,
}

impl NodeEntry {
    /// Returns whether the node can be given regions.
    pub(super) fn is_ready(&self) -> bool {
        self.loaded && !self.leaving && (self.linked || self.serving.is_some())
    }

    /// Takes changed delays in.
    pub(super) fn learn(&mut self, delays: Vec<Delay>) {
        self.delays.extend(delays.into_iter().map(|delay| (delay.node, delay.delay_ms)));
    }
}

/// A client that has joined.
#[derive(Clone, Debug)]
pub(super) struct ClientEntry {
    pub linked: bool,
    /// The time at which the client counts as gone, and its avatars are taken out of the world.
    pub absent_until: Option<Duration>,
    /// The group whose leader it plays with.
    pub group: GroupId,
    /// What the client has been told of the world. `None`: all of it.
    pub vicinity: Option<Vicinity>,
}

#[derive(Clone, Debug)]
pub(super) struct Common {
    pub config: ServerConfig,
    pub now: Duration,
    pub nodes: BTreeMap<NodeId, NodeEntry>,
    pub clients: BTreeMap<ClientId, ClientEntry>,
    /// What clients have asked for, including clients that are gone.
    pub allowances: BTreeMap<ClientId, Allowance>,
    /// Counts how often nodes have greeted, including nodes that are gone.
    pub greetings: BTreeMap<NodeId, Account>,
    /// Counts how often participants have made others stop, including participants that are gone.
    pub failures: BTreeMap<NodeId, Account>,
    /// The newest view number in use, over all groups.
    pub number: ViewNumber,
    pub begun: bool,
    pub stopping: bool,
    pub stale: u64,
    /// Says whether the world's entry is to be written down.
    pub world_changed: bool,
    /// The ids of the next body and the next joint that the program makes.
    pub next_ids: (u32, u64),
    /// The places from which the program looks at the world.
    pub viewpoints: Vec<Viewpoint>,
    pub groups_changed: BTreeSet<GroupId>,
    pub fading: Fading,
    /// Bodies that are not on record any more: ends of contacts still name them.
    pub departed: Departed,
    pub outputs: VecDeque<ServerOutput>,
}

impl Common {
    /// Counts that a node greets, which stops its group or costs sending it a world. Returns whether the node
    /// may greet.
    pub(super) fn may_greet(&mut self, node: NodeId) -> bool {
        let now = self.now;
        self.greetings.entry(node).or_default().ask(now, 1.0, GREETINGS, GREETINGS_PER_S)
    }

    /// Counts that a participant makes the others of its group stop. Returns whether it was counted.
    pub(super) fn has_failed(&mut self, node: NodeId) -> bool {
        let now = self.now;
        let Some(entry) = self.nodes.get(&node).filter(|entry| entry.member.client.is_some()) else {
            return false;
        };
        let serves = entry.serving;
        let computes_with = |other: (&NodeId, &NodeEntry)| *other.0 != node && other.1.serving == serves;
        serves.is_some()
            && self.nodes.iter().any(computes_with)
            && self.failures.entry(node).or_default().ask(now, 1.0, FAILURES, FAILURES_PER_S)
    }

    /// Takes back a failure of a node that was counted: what the node said was true.
    pub(super) fn forgive(&mut self, node: NodeId) {
        if let Some(account) = self.failures.get_mut(&node) {
            account.give_back(1.0);
        }
    }

    /// Returns whether a node has made others stop so often that it computes apart from them for now.
    pub(super) fn fails_often(&self, node: NodeId) -> bool {
        let account = self.failures.get(&node).copied();
        account.is_some_and(|mut account| !account.ask(self.now, 1.0, FAILURES, FAILURES_PER_S))
    }

    pub(super) fn send_node(&mut self, node: NodeId, message: ToNode) {
        if self.nodes.get(&node).is_some_and(|entry| entry.linked) {
            let message = Message::ToNode(message);
            self.outputs.push_back(ServerOutput::Send { to: Peer::Node(node), message });
        }
    }

    pub(super) fn send_client(&mut self, client: ClientId, message: ToClient) {
        let message = Message::ToClient(client, message);
        self.outputs.push_back(ServerOutput::Send { to: Peer::Client(client), message });
    }

    /// Sends a message to all clients that play with this group.
    pub(super) fn send_clients(&mut self, group: GroupId, message: &ToClient) {
        let concerned = |(_, entry): &(&ClientId, &ClientEntry)| entry.linked && entry.group == group;
        let ids: Vec<_> = self.clients.iter().filter(concerned).map(|(&id, _)| id).collect();
        for client in ids {
            self.send_client(client, message.clone());
        }
    }

    /// Tells the clients of a group of a body that is new to it. Clients with an area of interest are told if
    /// the body is near or their own.
    pub(super) fn announce(&mut self, group: GroupId, record: &Record, id: BodyId, inserted: &ToClient) {
        let mut messages = Vec::new();
        let concerned = self.clients.iter_mut().filter(|(_, entry)| entry.linked && entry.group == group);
        for (&client, entry) in concerned {
            let told = match &mut entry.vicinity {
                None => vec![inserted.clone()],
                Some(vicinity) => vicinity.announce(client, id, record),
            };
            messages.extend(told.into_iter().map(|message| (client, message)));
        }
        messages.into_iter().for_each(|(client, message)| self.send_client(client, message));
    }

    /// Tells the clients of a group that know a body that it is gone.
    pub(super) fn announce_end(&mut self, group: GroupId, id: BodyId) {
        let mut concerned = Vec::new();
        // The body may still be there for clients of another group.
        for (&client, entry) in self.clients.iter_mut().filter(|(_, entry)| entry.group == group) {
            let knows = entry.vicinity.as_mut().is_none_or(|vicinity| vicinity.forget(id));
            if entry.linked && (knows || id.client() == Some(client)) {
                concerned.push(client);
            }
        }
        concerned.into_iter().for_each(|client| self.send_client(client, ToClient::Removed(id)));
    }

    pub(super) fn close(&mut self, peer: Peer, farewell: Farewell, reason: String) {
        self.outputs.push_back(ServerOutput::Close { peer, farewell, reason });
    }

    /// Tells a node to go, and forgets it.
    pub(super) fn dismiss(&mut self, node: NodeId, farewell: Farewell, reason: String) {
        let message = Message::ToNode(ToNode::Shutdown { farewell, reason: reason.clone() });
        self.outputs.push_back(ServerOutput::Send { to: Peer::Node(node), message });
        self.close(Peer::Node(node), farewell, reason);
        self.nodes.remove(&node);
    }

    /// Tells every node of all nodes.
    pub(super) fn tell_roster(&mut self) {
        let here: BTreeSet<_> = self.nodes.keys().copied().collect();
        self.nodes.values_mut().for_each(|entry| entry.delays.retain(|node, _| here.contains(node)));
        let roster: Vec<_> = self.nodes.values().map(|entry| entry.member.clone()).collect();
        for node in self.nodes.keys().copied().collect::<Vec<_>>() {
            self.send_node(node, ToNode::Roster(roster.clone()));
        }
    }
}
