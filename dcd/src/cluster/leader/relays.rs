//! Gives clients to other members of the group (relays), so that the cost of all clients does not fall on the
//! leader alone: the leader sends a relay once what all of the relay's clients need, and the relay tells them
//! as the leader would.

use std::collections::{BTreeMap, BTreeSet};

use super::Leader;
use crate::cluster::Peer;
use crate::cluster::state_replication::{MAX_TURNS, ReplicationEvent};
use crate::protocol::{EnvironmentProperties, Member, Message, ToClient, ToRelay, View};
use crate::space::{BodyId, ClientId, NodeId, RegionId, Tick};

/// The time within which a client should have a link to the relay that it is given to, seconds.
const ON_THE_WAY_S: f64 = 5.0;

/// A client that was given to a relay.
#[derive(Clone, Copy, Debug)]
struct Given {
    to: NodeId,
    /// Says whether the relay tells it. Until the relay says that the client is linked, the leader tells it.
    told: bool,
    /// The tick in which it was given.
    since: Tick,
}

/// The assignment of clients to relays. It lasts as long as the view.
#[derive(Clone, Debug, Default)]
pub(super) struct Relays {
    /// The number of clients that the leader tells itself; `None`: all.
    above: Option<u32>,
    /// The members that may relay: those that are no participants, without the leader.
    members: BTreeMap<NodeId, Member>,
    /// The members among them that have no link here.
    away: BTreeSet<NodeId>,
    /// Clients that have named an interest since the tick before, and of which it is not decided who tells
    /// them.
    undecided: BTreeSet<ClientId>,
    decided: BTreeSet<ClientId>,
    given: BTreeMap<ClientId, Given>,
    /// The number of each client's present turn.
    turns: BTreeMap<ClientId, u32>,
    pub(super) messages: Vec<(NodeId, Message)>,
}

impl Relays {
    pub(super) fn new(view: &View, world: &EnvironmentProperties) -> Self {
        let may_relay = |member: &&Member| member.client.is_none() && member.node != view.leader;
        let members = view.members.iter().filter(may_relay).map(|member| (member.node, member.clone()));
        Self { above: world.relays_above, members: members.collect(), ..Self::default() }
    }

    /// Returns the number of the next turn of a client. Where there are no relays it is always 0: each turn
    /// begins with a new link, and with nothing told.
    pub(super) fn next_turn(&mut self, client: ClientId) -> u32 {
        if self.above.is_none() {
            return 0;
        }
        // The last turn lasts: no relay comes after it, and a client that links anew has forgotten what it
        // was told.
        let next = self.turns.get(&client).map_or(0, |turn| (turn + 1).min(MAX_TURNS - 1));
        self.turns.insert(client, next);
        next
    }

    pub(super) fn interested(&mut self, client: ClientId) {
        if self.above.is_some() && !self.decided.contains(&client) {
            self.undecided.insert(client);
        }
    }

    /// Forgets a client whose link is gone, or new.
    pub(super) fn forget(&mut self, client: ClientId) {
        self.undecided.remove(&client);
        self.decided.remove(&client);
        self.given.remove(&client);
    }

    fn given_to(&self, node: NodeId) -> Vec<ClientId> {
        self.given.iter().filter(|(_, given)| given.to == node).map(|(&client, _)| client).collect()
    }

    /// Returns the relay for one client more, where this many are linked: `near`, unless it has its share;
    /// else the one with the fewest clients.
    fn choose(&self, linked: usize, near: Option<NodeId>) -> Option<NodeId> {
        let mut loads: BTreeMap<_, _> = self.members.keys().map(|&node| (node, 0)).collect();
        loads.retain(|node, _| !self.away.contains(node));
        for given in self.given.values() {
            loads.entry(given.to).and_modify(|load| *load += 1);
        }
        let above = self.above? as usize;
        let nodes = loads.len() + usize::from(above > 0);
        let share = above.max(linked.div_ceil(nodes.max(1)));
        let has_room = |node: &NodeId| loads.get(node).is_some_and(|&load| load < share);
        near.filter(has_room).or_else(|| loads.iter().min_by_key(|(_, load)| **load).map(|(&node, _)| node))
    }
}

impl Leader {
    /// Gives clients that have said what they want to hear of to relays, if there are more than the leader
    /// tells itself. Members may begin the view later than the leader; when its first tick is complete, all
    /// have begun it.
    pub(super) fn give_clients(&mut self) {
        let undecided = std::mem::take(&mut self.relays.undecided);
        let mut expected: BTreeMap<NodeId, Vec<ClientId>> = BTreeMap::new();
        for client in undecided {
            let is_direct = |client: ClientId| self.clients.get(&client) == Some(&Peer::Client(client));
            if !is_direct(client) {
                continue;
            }
            self.relays.decided.insert(client);
            let linked = self.clients.keys().filter(|&&client| is_direct(client)).count();
            let own = linked - self.told_or_soon();
            let is_above = self.relays.above.is_some_and(|above| own > above as usize);
            let relay = match is_above {
                true => self.relays.choose(linked, self.near(client)),
                false => None,
            };
            if let Some(to) = relay {
                self.relays.given.insert(client, Given { to, told: false, since: self.tick });
                expected.entry(to).or_default().push(client);
            }
            let member = relay.and_then(|node| self.relays.members.get(&node)).cloned();
            self.messages.push((client, ToClient::ToldBy(member)));
        }
        let view = self.view;
        let expect = |(node, clients)| (node, Message::Relay(ToRelay::Expect { view, clients }));
        self.relays.messages.extend(expected.into_iter().map(expect));
    }

    /// Returns how many clients are told by relays, or were given to them so lately that they may still be on
    /// their way there.
    fn told_or_soon(&self) -> usize {
        let patience_ticks = (ON_THE_WAY_S / self.dt.as_secs_f64()) as u64;
        let is_so = |given: &&Given| given.told || self.tick.0 <= given.since.0 + patience_ticks;
        self.relays.given.values().filter(is_so).count()
    }

    /// Returns how many clients the leader tells itself, and how many relays tell in its place.
    pub fn clients_told(&self) -> (usize, usize) {
        let by_relays = self.relays.given.values().filter(|given| given.told).count();
        (self.clients.len() - by_relays, by_relays)
    }

    /// Returns the member that computes the region of a client's area of interest, or else of its first
    /// avatar.
    fn near(&self, client: ClientId) -> Option<NodeId> {
        let area = self.interests.get(&client).copied().flatten();
        let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        let avatar = || self.latest.range(own).next().map(|(_, (state, _))| state.pose.translation);
        let at = area.map(|area| area.centre).or_else(avatar)?;
        let (_, allocation) = self.computed_by.back()?;
        let tree = self.balancing.as_ref().map_or(&self.tree, |balancing| balancing.tree());
        let region: RegionId = tree.leaf_at(at);
        allocation.get(&region).copied()
    }

    /// Takes in that a client has a link to a member, or none any more. If the client was given to that
    /// member, it is told there from now on.
    pub(in crate::cluster) fn linked_elsewhere(&mut self, node: NodeId, client: ClientId, up: bool) {
        let Some(given) = self.relays.given.get_mut(&client).filter(|given| given.to == node) else { return };
        match (up, given.told) {
            (true, false) if self.relays.turns.get(&client).is_none_or(|turn| turn + 2 < MAX_TURNS) => {
                given.told = true;
                let turn = self.relays.next_turn(client);
                let area = self.interests.get(&client).copied().flatten();
                self.replicate(ReplicationEvent::Relay { client, node, turn, area });
                self.say_applied_again(client);
            }
            (false, true) => self.take_back(client),
            _ => {}
        }
    }

    /// Takes a client back from its relay: the leader tells it again, from the beginning.
    fn take_back(&mut self, client: ClientId) {
        let given = self.relays.given.get_mut(&client);
        if !given.is_some_and(|given| std::mem::replace(&mut given.told, false)) {
            return;
        }
        let turn = self.relays.next_turn(client);
        // Interests are otherwise told with the next complete tick. That tick may be long in coming: the
        // relay may have to be given up first.
        let area = self.interests.get(&client).copied();
        self.news.uninterested(client);
        self.watching.forget_interests(client);
        self.replicate(ReplicationEvent::Admit { client, turn, told_elsewhere: true, area });
        self.say_applied_again(client);
    }

    fn say_applied_again(&mut self, client: ClientId) {
        if let Some(&applied) = self.applied.get(&client) {
            self.news.has_applied(client, applied);
        }
    }

    /// Takes in that a client hears nothing from its relay.
    pub(in crate::cluster) fn untold(&mut self, client: ClientId) {
        self.take_back(client);
    }

    /// Takes back the clients of a relay whose link is gone. They are its again when the link is back.
    pub(in crate::cluster) fn relay_lost(&mut self, node: NodeId) {
        self.relays.away.insert(node);
        for client in self.relays.given_to(node) {
            self.take_back(client);
        }
    }

    /// Takes in that a member is linked, perhaps over another link than before: what it was told may be lost.
    pub(in crate::cluster) fn relay_back(&mut self, node: NodeId) {
        self.relay_lost(node);
        self.relays.away.remove(&node);
        let clients = self.relays.given_to(node);
        if !clients.is_empty() {
            let expect = ToRelay::Expect { view: self.view, clients };
            self.relays.messages.push((node, Message::Relay(expect)));
        }
    }

    /// Takes in that a relay has read what it was sent, up to this number.
    pub(in crate::cluster) fn fed(&mut self, node: NodeId, number: u64) {
        self.replicate(ReplicationEvent::Fed { node, number });
    }

    /// Returns the messages for other members since the last call.
    pub(in crate::cluster) fn take_member_messages(&mut self) -> Vec<(NodeId, Message)> {
        std::mem::take(&mut self.relays.messages)
    }
}
