//! Assigns nodes to groups: at the start by delay, later by joining, by votes, and by which nodes cannot
//! reach each other (thesis 3.3.7–3.3.9).

use std::collections::BTreeMap;
use std::time::Duration;

use bincode::{Decode, Encode};

use super::group::Group;
use super::verdicts::Verification;
use super::{Server, ServerOutput};
use crate::cluster::{
    Call, GroupPolicy, GroupRules, Hint, Outcome, PeerDelay, PollRules, VoteThresholds, best_group,
    form_groups,
};
use crate::protocol::{Motion, ToClient, ToNode};
use crate::space::{ClientId, GroupId, NodeId};

/// How long the server waits for a newcomer's delays.
const MEASURE: Duration = Duration::from_secs(2);
/// The least time for which a node that was out of reach stays alone, when groups do not depend on delay.
const APART: Duration = Duration::from_secs(3);
/// How long a dedicated node that all others reach waits for the one participant that does not reach it.
const DENIED: Duration = Duration::from_secs(10);

/// The interval between checks of which nodes can reach each other again.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// The rules of which nodes may share a group.
#[derive(Clone, Debug, Encode, Decode)]
pub struct Grouping {
    /// The largest number of nodes in a group, also by votes.
    pub max_size: usize,
    /// The preferred sizes of groups.
    pub policy: GroupPolicy,
    /// Hints about which nodes belong together.
    #[doc(hidden)]
    pub hints: Vec<Hint>,
    /// The rules of votes. Their `max_size` does not count: that of the grouping does.
    pub votes: PollRules,
    /// Which participants are verified. A server process sets it by its `ServeConfig::verify`.
    #[doc(hidden)]
    pub verification: Verification,
}

impl Default for Grouping {
    fn default() -> Self {
        let votes = PollRules::default();
        Self {
            max_size: votes.max_size,
            policy: GroupPolicy::default(),
            hints: Vec::new(),
            votes,
            verification: Verification::default(),
        }
    }
}

impl Grouping {
    /// Returns the rules of votes, which let no group grow beyond the size of this grouping.
    pub(super) fn poll_rules(&self) -> PollRules {
        PollRules { max_size: self.max_size, ..self.votes }
    }
}

impl Server {
    fn rules(&self) -> GroupRules {
        let Grouping { max_size, policy, .. } = self.common.config.grouping;
        let threshold_ms =
            self.common.config.world.thresholds.delay.map(|delay| f64::from(delay.inclusion_ms));
        GroupRules { threshold_ms, max_size, policy }
    }

    /// Returns the delay from one node to another, as far as groups depend on delay. If they do not, nodes
    /// that reach each other are near. Before the world has begun, nodes of which that is not known are near
    /// too.
    fn delay_ms(&self, from: NodeId, to: NodeId) -> Option<f64> {
        let told = self.common.nodes.get(&from).and_then(|entry| entry.delays.get(&to));
        match self.common.config.world.thresholds.delay {
            Some(_) => told.copied().flatten().map(f64::from),
            None if self.common.begun => self.reaches(from, to).then_some(0.0),
            None => told.map_or(Some(0.0), |delay| delay.map(f64::from)),
        }
    }

    /// Returns whether two nodes are known to reach each other. One side's word is enough: what the other
    /// once said may have been forgotten when it joined again.
    fn reaches(&self, a: NodeId, b: NodeId) -> bool {
        let told =
            |of: NodeId, to: NodeId| self.common.nodes.get(&of).and_then(|entry| entry.delays.get(&to));
        match (told(a, b), told(b, a)) {
            (Some(None), _) | (_, Some(None)) | (None, None) => false,
            (Some(Some(_)), _) | (_, Some(Some(_))) => true,
        }
    }

    /// Returns whether everything is known that a node's group depends on, or it took too long to find out.
    fn is_measured(&self, node: NodeId) -> bool {
        let Some(entry) = self.common.nodes.get(&node) else { return false };
        let others = self.common.nodes.iter().filter(|&(&other, entry)| entry.linked && other != node);
        let by_delay = self.common.config.world.thresholds.delay.is_some();
        if !by_delay && self.common.begun {
            // A member that nobody reaches would stop the world, so the node must be reached first.
            let mut members = others.filter(|(_, entry)| entry.group.is_some());
            return entry.in_group_since + MEASURE <= self.common.now
                || members.all(|(&other, _)| self.reaches(node, other));
        }
        let knows = |from: NodeId, to: NodeId| match self.common.nodes[&from].delays.get(&to) {
            None => !by_delay,
            // The link may be on its way back.
            Some(delay) => delay.is_some(),
        };
        // The server may have lost all links, and this node may be the first one back. Nodes near it are
        // still to come.
        let awaits = by_delay && self.common.nodes.values().any(|entry| entry.absent_until.is_some());
        entry.in_group_since + MEASURE <= self.common.now
            || !awaits
                && others.map(|(&other, _)| other).all(|other| knows(node, other) && knows(other, node))
    }

    /// Puts each node that has no group into one.
    pub(super) fn assign(&mut self) {
        let homeless = self.common.nodes.iter().filter(|(_, entry)| entry.loaded && entry.group.is_none());
        let homeless: Vec<_> =
            homeless.map(|(&node, _)| node).filter(|&node| self.is_measured(node)).collect();
        if !self.common.begun {
            if homeless.len() >= self.common.config.min_nodes {
                let hints = &self.common.config.grouping.hints;
                let groups = form_groups(&homeless, |a, b| self.delay_ms(a, b), &self.rules(), hints);
                for (index, group) in groups.into_iter().enumerate() {
                    let id = if index == 0 { self.main } else { self.new_group() };
                    group.into_iter().for_each(|node| self.put(node, id));
                }
            }
            return;
        }
        for node in homeless {
            let mut members: BTreeMap<GroupId, Vec<NodeId>> = BTreeMap::new();
            for (&other, entry) in self.common.nodes.iter().filter(|(_, entry)| entry.linked) {
                if let Some(group) = entry.group {
                    members.entry(group).or_default().push(other);
                }
            }
            let groups: Vec<_> = members.values().collect();
            let hints = &self.common.config.grouping.hints;
            let best = best_group(node, &groups, |a, b| self.delay_ms(a, b), &self.rules(), hints);
            let best = best.and_then(|index| members.keys().nth(index).copied());
            let fails = self.common.fails_often(node);
            let group = match best.filter(|_| !fails) {
                Some(group) => group,
                // The main group has no members: the world waits for this node.
                None if !members.contains_key(&self.main) => self.main,
                None => {
                    if self.common.config.world.thresholds.delay.is_none() && !fails {
                        self.common.outputs.push_back(ServerOutput::Unreached(node));
                    }
                    self.new_group()
                }
            };
            self.put(node, group);
        }
    }

    /// Makes nodes that have left a group begin anew in the group that they are to be in.
    pub(super) fn welcome_moved(&mut self) {
        let moved =
            self.common.nodes.iter().filter(|(_, entry)| entry.moved && entry.linked && !entry.leaving);
        for node in moved.map(|(&node, _)| node).collect::<Vec<_>>() {
            self.common.outputs.push_back(ServerOutput::Moved(node));
            self.welcome_node_again(node);
        }
    }

    /// Sends a node the world anew. Its group and what is known of its links stay.
    pub(super) fn welcome_node_again(&mut self, node: NodeId) {
        let Some(entry) = self.common.nodes.get(&node) else { return };
        let (member, group, delays) = (entry.member.clone(), entry.group, entry.delays.clone());
        self.welcome_node(member, entry.loading);
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            (entry.group, entry.delays) = (group, delays);
        }
    }

    /// Moves a node that can reach the largest group again back to it. When groups do not depend on delay,
    /// there are several only because some nodes could not reach one another.
    fn rejoin(&mut self) {
        let now = self.common.now;
        let mut members: BTreeMap<GroupId, Vec<NodeId>> = BTreeMap::new();
        for (&node, entry) in &self.common.nodes {
            let Some(group) = entry.group.filter(|_| entry.linked && entry.serving.is_some()) else {
                continue;
            };
            members.entry(group).or_default().push(node);
        }
        let is_calm = |id: &GroupId| self.groups.get(id).is_some_and(|g| g.change.is_none() && !g.held);
        members.retain(|id, _| is_calm(id));
        let rank = |id: &GroupId| (members[id].len(), *id == self.main, std::cmp::Reverse(*id));
        let Some(largest) = members.keys().copied().max_by_key(|id| rank(id)) else { return };
        let apart = members.iter().filter(|(id, _)| **id != largest).flat_map(|(_, nodes)| nodes);
        let apart: Vec<_> = apart.map(|&node| (node, self.common.nodes[&node].in_group_since)).collect();
        let returning = apart.iter().find(|&&(node, since)| {
            let is_due = since + APART <= now && !self.common.fails_often(node);
            is_due && members[&largest].iter().all(|&other| self.reaches(node, other))
        });
        if let Some(&(node, _)) = returning {
            if members[&largest].len() < self.common.config.grouping.max_size {
                self.put(node, largest);
            }
            return;
        }
        // Otherwise a participant that lies would keep a dedicated node out for good. With the next check the
        // dedicated node is back.
        let denier = apart.iter().find_map(|&(node, since)| {
            let is_due = since + DENIED <= now && !self.plays(node) && members[&largest].len() > 1;
            let mut away = members[&largest].iter().filter(|&&other| !self.reaches(node, other));
            let denier = away.next().filter(|_| is_due)?;
            (away.next().is_none() && self.plays(*denier)).then_some(*denier)
        });
        if let Some(node) = denier {
            self.common.outputs.push_back(ServerOutput::Unreached(node));
            self.set_apart(node);
        }
    }

    /// Returns whether a node is a participant.
    fn plays(&self, node: NodeId) -> bool {
        self.common.nodes.get(&node).is_some_and(|entry| entry.member.client.is_some())
    }

    pub(super) fn regrouping_at(&self) -> Option<Duration> {
        let unmeasured = self.common.nodes.values().filter(|entry| entry.group.is_none() && entry.loaded);
        let measured =
            unmeasured.map(|entry| entry.in_group_since + MEASURE).filter(|&at| at > self.common.now);
        let by_reach = self.common.config.world.thresholds.delay.is_none() && self.groups.len() > 1;
        let soon = (by_reach && !self.common.stopping).then_some(self.looked_at + LOOK_EVERY);
        measured.chain(self.polls.poll_timeout()).chain(soon).min()
    }

    pub(super) fn handle_regrouping(&mut self) {
        let now = self.common.now;
        for outcome in self.polls.handle_timeout(now) {
            self.decide(&outcome);
        }
        let by_reach = self.common.config.world.thresholds.delay.is_none();
        if by_reach && self.groups.len() > 1 && self.looked_at + LOOK_EVERY <= now {
            self.looked_at = now;
            self.rejoin();
        }
    }

    fn members(&self, group: GroupId) -> Vec<NodeId> {
        self.common.nodes.iter().filter(|(_, e)| e.group == Some(group)).map(|(&node, _)| node).collect()
    }

    /// Takes in a member's call for a vote.
    pub(super) fn call(&mut self, caller: NodeId, motion: Motion) {
        let group_of = |node| self.common.nodes.get(&node).and_then(|entry| entry.group);
        let (Some(own), Some(other)) = (group_of(caller), group_of(motion.candidate())) else { return };
        let changing = [own, other].iter().any(|id| {
            self.groups
                .get(id)
                .is_none_or(|group| group.change.is_some() || group.view.is_none() || group.held)
        });
        let (group, present) = (self.members(own), self.members(other));
        let call = Call { caller, motion, group: &group, present: &present, changing };
        if let Ok((poll, voters)) = self.polls.call(self.common.now, &call) {
            for voter in voters {
                self.common.send_node(voter, ToNode::Poll { poll, motion });
            }
        }
    }

    /// Takes in a member's ballot, which gives its delay to the candidate.
    pub(super) fn cast(&mut self, voter: NodeId, poll: u64, delay_ms: Option<f32>) {
        let Some(thresholds) = self.common.config.world.thresholds.delay else { return };
        let delay = delay_ms.map_or(PeerDelay::Unknown, |ms| PeerDelay::AverageMs(ms.into()));
        let ballot = VoteThresholds::from(thresholds).ballot(delay);
        if let Some(outcome) = self.polls.ballot(self.common.now, poll, voter, ballot) {
            self.decide(&outcome);
        }
    }

    fn decide(&mut self, outcome: &Outcome) {
        if !outcome.passed {
            return;
        }
        let group = outcome.group.iter().find_map(|node| self.common.nodes.get(node)?.group);
        match (outcome.motion, group) {
            (Motion::Include(node), Some(group))
                if self.groups.contains_key(&group) && !self.common.fails_often(node) =>
            {
                self.put(node, group);
            }
            (Motion::Reject(node), _) => {
                let alone = self.new_group();
                self.put(node, alone);
            }
            _ => {}
        }
    }

    /// Adds a group without members, and returns its id.
    pub(super) fn new_group(&mut self) -> GroupId {
        self.last_group.0 += 1;
        self.common.world_changed = true;
        let (id, main) = (self.last_group, self.main());
        let mut group = Group::new(id, main.record.copied(false), main.tick);
        group.steered.clone_from(&main.steered);
        self.groups.insert(id, group);
        id
    }

    pub(super) fn put(&mut self, node: NodeId, group: GroupId) {
        self.polls.placed(self.common.now, node);
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            entry.group = Some(group);
            entry.in_group_since = self.common.now;
        }
    }

    /// Dissolves groups that have no nodes and expect none. If the main group is one of them, the largest of
    /// the others becomes the main group.
    pub(super) fn tidy(&mut self) {
        let is_empty = |group: &Group| {
            group.change.is_none()
                && (group.view.is_none() || group.held && group.serving(&self.common).is_empty())
                && !self.common.nodes.values().any(|entry| entry.group == Some(group.id))
        };
        let lives = |group: &Group| group.view.is_some() && !group.held;
        let empty: Vec<_> =
            self.groups.values().filter(|group| is_empty(group)).map(|group| group.id).collect();
        let was_one = self.groups.len() == 1;
        for id in empty {
            if id == self.main {
                let size = |group: &Group| group.view.as_ref().map_or(0, |view| view.members.len());
                let heirs = self.groups.values().filter(|group| group.id != id && lives(group));
                let heir = heirs.max_by_key(|group| (size(group), std::cmp::Reverse(group.id)));
                let Some(heir) = heir.map(|group| group.id) else { continue };
                let marked = self.main_mut().record.take_marks();
                let former = std::mem::take(&mut self.main_mut().retold);
                self.main = heir;
                self.common.world_changed = true;
                self.main_mut().record.mark_all(marked);
                self.main_mut().retold.replaces(&former);
            }
            self.groups.remove(&id);
            self.common.groups_changed.insert(id);
            self.common.outputs.push_back(ServerOutput::Dissolved(id));
        }
        // If there was only one group before, all clients play with it.
        if !was_one {
            self.settle_clients();
        }
    }

    /// Returns the group that a client is to play with: the group of its own node, the one that it has, or
    /// the main group.
    pub(super) fn group_for(&self, client: ClientId) -> GroupId {
        let own = self.common.nodes.iter().find(|(_, entry)| entry.member.client == Some(client));
        let own = own.and_then(|(&node, _)| self.group_of(node));
        let present = self.common.clients.get(&client).map(|entry| entry.group);
        own.or(present.filter(|group| self.groups.contains_key(group))).unwrap_or(self.main)
    }

    fn settle_clients(&mut self) {
        for client in self.common.clients.keys().copied().collect::<Vec<_>>() {
            let group = self.group_for(client);
            let Some(entry) = self.common.clients.get_mut(&client) else { continue };
            if entry.group != group {
                entry.group = group;
                if entry.linked {
                    let leader: ToClient = self.groups[&group].leader_is();
                    self.common.send_client(client, leader);
                }
            }
        }
    }
}
