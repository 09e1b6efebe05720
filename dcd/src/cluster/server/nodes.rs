//! Handles nodes that join, lose their links, come back, hang, leave and die (thesis 4.3.2.10, 4.3.3).

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::common::{ABSENCE, NodeEntry, RETURN};
use super::group::Group;
use super::moves::Moves;
use super::{Server, ServerOutput};
use crate::cluster::Peer;
use crate::protocol::{Delay, Farewell, Member, Refusal, ToNode, ToServer, ViewNumber};
use crate::space::{GroupId, NodeId};

/// How long a group whose members are all out of reach is left alone before other nodes take over.
const HOLD: Duration = Duration::from_secs(3);

/// The standing that a returning node has in its group.
pub(super) enum Resumption {
    /// It is still a member.
    Member(GroupId),
    /// It is a member of one of two views, and the server does not know yet which of them goes on.
    Undecided,
    /// It has none, and is sent the world anew.
    Anew,
}

impl Server {
    /// Returns the group whose view the node computes.
    pub(super) fn group_of(&self, node: NodeId) -> Option<GroupId> {
        let serving = self.common.nodes.get(&node)?.serving?;
        let is_view = |group: &&Group| group.view.as_ref().is_some_and(|view| view.number == serving);
        self.groups.values().find(is_view).map(|group| group.id)
    }

    /// Decides where a node belongs that comes back and computes the view of this number.
    pub(super) fn resumption(&mut self, node: NodeId, view: ViewNumber) -> Resumption {
        let Some(id) = self.group_of(node) else { return Resumption::Anew };
        let Some(group) = self.groups.get_mut(&id) else { return Resumption::Anew };
        // Perhaps no member has heard of the newest view, because the server or the links died at that
        // moment. Then the view before it goes on. A member whose link has not broken since has heard of the
        // newest view, or will.
        let is_heard = |member: &NodeId| *member != node && self.common.nodes[member].linked;
        let is_unheard = !group.confirmed && !group.serving(&self.common).iter().any(is_heard);
        let is_member = group.is_member(node);
        if (group.held || is_unheard)
            && let Some(former) = group.former.take_if(|former| former.number == view)
        {
            if !is_member {
                // The node was to leave. Those that were to stay know whether the newest view began.
                group.former = Some(former);
                return Resumption::Undecided;
            }
            let present = group.view.replace(former.clone()).map(|view| view.number);
            for (node, entry) in &mut self.common.nodes {
                let is_former = former.members.iter().any(|member| member.node == *node);
                // A node that computes for another group by now is not taken back.
                if entry.serving == present || (is_former && entry.serving.is_none()) {
                    let holds_it = is_former && entry.anew_since < former.number;
                    entry.serving = holds_it.then_some(former.number);
                }
            }
        } else if is_member && group.view.as_ref().is_some_and(|present| present.number == view) {
            self.let_go(id, view);
        }
        match self.common.nodes.get(&node) {
            Some(entry) if entry.serving == Some(view) => Resumption::Member(id),
            _ => Resumption::Anew,
        }
    }

    /// Drops the view before the present one, of which a member has heard by now. Nodes that were to leave
    /// with the present view begin anew.
    fn let_go(&mut self, id: GroupId, view: ViewNumber) {
        let Some(group) = self.groups.get_mut(&id) else { return };
        group.former = None;
        let is_over = |(node, entry): &(&NodeId, &mut NodeEntry)| {
            entry.serving == Some(view) && !group.is_member(**node)
        };
        let over = self.common.nodes.iter_mut().filter(is_over);
        let over: Vec<_> = over
            .map(|(&node, entry)| {
                entry.serving = None;
                node
            })
            .collect();
        over.into_iter().for_each(|node| self.begin_anew(node));
    }

    /// Notes that a node begins anew: it greeted and was told to, or it has loaded what it was sent.
    pub(super) fn is_anew(&mut self, node: NodeId) {
        let newest = self.groups.values().filter_map(|group| Some(group.view.as_ref()?.number)).max();
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            entry.anew_since = newest.unwrap_or_default();
        }
    }

    /// Restores the link of a node whose membership is not decided yet, and which has `heard` so many
    /// operations in this view.
    pub(super) fn link_again(&mut self, member: Member, view: ViewNumber, heard: u64) {
        if let Some(entry) = self.common.nodes.get_mut(&member.node) {
            (entry.member, entry.linked, entry.absent_until) = (member, true, None);
            entry.loading = 0;
            // What the node missed of that view was told to another leader, if to any.
            entry.moves.are_heard(view, heard, |_| false);
        }
        self.common.tell_roster();
    }

    /// Resumes a member whose link broke and is back. Messages sent over that link may be lost, so a view
    /// change compares everything. If the member leads, it has `heard` so many of the operations that no
    /// comparison finds.
    pub(super) fn resume(&mut self, member: Member, id: GroupId, heard: u64) {
        let (node, until) = (member.node, self.common.now + RETURN);
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            entry.member = member;
            entry.linked = true;
            entry.absent_until = None;
            entry.loading = 0;
            // What the node was sent last may be lost. The next view sends it everything, and the node knows
            // what it has already.
            entry.shapes.clear();
            entry.scenery.clear();
        }
        let Some(group) = self.groups.get_mut(&id) else { return };
        let others: Vec<_> = group.serving(&self.common).into_iter().filter(|&other| other != node).collect();
        // No other member has a link either: the server was cut off, not the members. They should be back
        // about now as well.
        if others.iter().all(|other| !self.common.nodes[other].linked) {
            for other in others {
                if let Some(entry) = self.common.nodes.get_mut(&other) {
                    entry.absent_until = Some(entry.absent_until.map_or(until, |at| at.max(until)));
                }
            }
        }
        if std::mem::replace(&mut group.held, false) {
            group.silent_since = None;
            let leader = group.leader_is();
            self.common.send_clients(id, &leader);
        }
        if let Some(group) = self.groups.get_mut(&id) {
            group.unsure = true;
            // The members went on as before, and have done what their leader was to hand over.
            group.left_over.clear();
            group.notes = Default::default();
            // The leader hands these over in the change that follows, unless it has done them.
            if group.leads(node) {
                group.say_again(&mut self.common, heard);
            }
            if group.change.is_some() {
                if group.returns_too_often(&self.common, node) {
                    self.common.has_failed(node);
                    return self.begin_anew(node);
                }
                group.begin_change(&mut self.common);
            }
        }
        self.common.tell_roster();
    }

    /// Sends a node the world. The node was sent it `loading` times before and has not answered.
    pub(super) fn welcome_node(&mut self, member: Member, loading: u32) {
        let node = member.node;
        let (mut shapes, mut scenery) = (BTreeSet::new(), BTreeSet::new());
        let mut parts = self.main().record.shape_chunks(&mut shapes);
        parts.extend(self.main().record.scenery_chunks(&mut scenery));
        let entry = NodeEntry {
            member,
            absent_until: None,
            linked: true,
            loaded: false,
            loading: loading + 1,
            leaving: false,
            unwanted: None,
            group: None,
            in_group_since: self.common.now,
            moved: false,
            serving: None,
            anew_since: ViewNumber::default(),
            shapes,
            scenery,
            stale_scenery: BTreeSet::new(),
            delays: BTreeMap::new(),
            moves: Moves::default(),
        };
        self.common.nodes.insert(node, entry);
        let (incarnation, world) = (self.common.config.incarnation, self.common.config.world.clone());
        self.common.send_node(node, ToNode::Welcome { id: node, incarnation, world });
        for chunk in parts {
            self.common.send_node(node, ToNode::Chunk(chunk));
        }
        self.common.send_node(node, ToNode::WorldEnd);
        self.common.tell_roster();
    }

    pub(super) fn hear_node(&mut self, node: NodeId, message: ToServer) {
        let Some(entry) = self.common.nodes.get_mut(&node) else { return };
        match message {
            ToServer::Loaded => self.has_loaded(node),
            ToServer::Leave => entry.leaving = true,
            ToServer::Delays(delays) => self.learn_delays(node, delays),
            ToServer::Call(motion) => self.call(node, motion),
            ToServer::Ballot { poll, delay_ms } => self.cast(node, poll, delay_ms),
            ToServer::InterGroup { view, tick, states } => self.inter_group(node, view, tick, states),
            ToServer::Touched { view, bodies } => self.touched(node, view, bodies),
            ToServer::Verdict { view, tick, node: of, finding } => {
                self.verdict(node, view, tick, of, finding)
            }
            ToServer::Answer { view, number, found } => self.answered(node, view, number, found),
            ToServer::Fidelity { view, report } => match self.is_led_by(node, view) {
                true => {
                    let group = self.group_of(node).and_then(|id| self.groups.get_mut(&id));
                    group.into_iter().for_each(|group| group.fidelity = Some(report));
                }
                false => self.common.stale += 1,
            },
            ToServer::Contacts { view, events, .. } => match self.is_led_by(node, view) {
                true => self.common.outputs.push_back(ServerOutput::Contacts(events)),
                false => self.common.stale += 1,
            },
            message => {
                let heard = self.group_of(node).and_then(|id| self.groups.get_mut(&id));
                if !heard.is_some_and(|group| group.hear(&mut self.common, node, message)) {
                    self.common.stale += 1;
                }
            }
        }
    }

    /// Notes that a node has loaded a world that it was sent. If it was sent another world since, only the
    /// answer to the last one counts.
    fn has_loaded(&mut self, node: NodeId) {
        let Some(entry) = self.common.nodes.get_mut(&node) else { return };
        entry.loading = entry.loading.saturating_sub(1);
        if entry.loading > 0 {
            return;
        }
        // The server took the node for a member of a former view while it loaded, and it holds nothing of
        // that view. Or it says so to be sent another world.
        if entry.serving.is_some() {
            if !self.common.may_greet(node) {
                return self.turn_away(Peer::Node(node), Refusal::TooMany.to_string());
            }
            self.common.has_failed(node);
            return self.begin_anew(node);
        }
        entry.loaded = true;
        self.is_anew(node);
    }

    /// Takes in changed delays from a node to other nodes that are here. The node may name any.
    fn learn_delays(&mut self, node: NodeId, mut delays: Vec<Delay>) {
        let before = delays.len();
        delays.retain(|delay| self.common.nodes.contains_key(&delay.node));
        self.common.stale += (before - delays.len()) as u64;
        if let Some(entry) = self.common.nodes.get_mut(&node) {
            entry.learn(delays);
        }
    }

    pub(super) fn unlink_node(&mut self, node: NodeId) {
        let serves = self.group_of(node).is_some();
        let until = self.common.now + ABSENCE;
        match self.common.nodes.get_mut(&node) {
            Some(entry) if serves => {
                entry.linked = false;
                entry.absent_until = Some(until);
            }
            // Nothing depends on the node yet.
            Some(_) => {
                self.lose(node);
                self.common.tell_roster();
            }
            None => {}
        }
    }

    /// Gives up a node that has been without a link for too long.
    pub(super) fn give_up(&mut self, node: NodeId) {
        let Some(entry) = self.common.nodes.get_mut(&node) else { return };
        entry.absent_until = None;
        let Some(id) = self.group_of(node) else {
            self.lose(node);
            return self.common.tell_roster();
        };
        let Some(group) = self.groups.get_mut(&id) else { return };
        let serving = group.serving(&self.common);
        let is_linked = |node: &NodeId| self.common.nodes[node].linked;
        let may_return = |node: &NodeId| self.common.nodes[node].absent_until.is_some();
        if serving.iter().any(is_linked) {
            self.lose(node);
            self.common.tell_roster();
        } else if !serving.iter().any(may_return) {
            group.fall_silent(&mut self.common);
        }
    }

    /// Removes a node that is dead or has begun anew. The world goes on without what it computed.
    pub(super) fn lose(&mut self, node: NodeId) {
        let group = self.group_of(node);
        if self.common.nodes.remove(&node).is_none() {
            return;
        }
        self.polls.group_changes(&[node]);
        if group.is_some() {
            self.common.outputs.push_back(ServerOutput::Expelled(node));
        }
        if let Some(group) = group.and_then(|id| self.groups.get_mut(&id)) {
            group.begin_change(&mut self.common);
        }
    }

    /// Makes a member begin anew that does not do its part. What it computes does not count, and it is sent
    /// the world anew. A member that is to leave has nothing to hand over then, and leaves.
    pub(super) fn begin_anew(&mut self, node: NodeId) {
        let Some(entry) = self.common.nodes.get(&node) else { return };
        let (member, linked, unwanted) = (entry.member.clone(), entry.linked, entry.unwanted.clone());
        let loading = entry.loading;
        self.lose(node);
        match unwanted {
            None if linked => return self.welcome_node(member, loading),
            Some((farewell, reason)) if linked => self.common.dismiss(node, farewell, reason),
            _ => {}
        }
        self.common.tell_roster();
    }

    /// Makes members begin anew that were told of a tick alone, and do in it what the others do not. It is
    /// not their fault, and nobody waits for them in vain.
    pub(super) fn part_from_astray(&mut self) {
        let astray: Vec<_> = self.groups.values_mut().flat_map(Group::take_astray).collect();
        astray.into_iter().for_each(|node| self.begin_anew(node));
    }

    /// Sets apart a member that others cannot reach. It goes on in a group of its own, or is removed if it
    /// has no link.
    pub(super) fn set_apart(&mut self, node: NodeId) {
        let Some(entry) = self.common.nodes.get(&node) else { return };
        if !entry.linked {
            self.lose(node);
            return self.common.tell_roster();
        }
        self.begin_anew(node);
        if self.common.nodes.contains_key(&node) {
            let group = self.new_group();
            self.put(node, group);
        }
    }

    /// Returns when other nodes may take over from groups that are out of reach.
    pub(super) fn takeover_at(&self) -> Option<Duration> {
        let is_silent = |group: &&Group| group.held && group.view.is_some() && self.has_successors(group);
        self.groups.values().filter(is_silent).filter_map(|group| Some(group.silent_since? + HOLD)).min()
    }

    /// Returns whether linked nodes exist that could compute the world in place of this group.
    pub(super) fn has_successors(&self, group: &Group) -> bool {
        let serving = group.serving(&self.common);
        let can = |(node, entry): (&NodeId, &NodeEntry)| {
            entry.linked && entry.loaded && !entry.leaving && !serving.contains(node)
        };
        self.common.nodes.iter().any(can)
    }

    /// Lets other nodes take over from groups that were silent for too long. What the members of these groups
    /// do from now on does not count.
    pub(super) fn take_over(&mut self) {
        if self.takeover_at().is_none_or(|at| at > self.common.now) {
            return;
        }
        let now = self.common.now;
        let is_due =
            |group: &&Group| group.held && group.silent_since.is_some_and(|since| since + HOLD <= now);
        let due: Vec<_> = self.groups.values().filter(is_due).map(|group| group.id).collect();
        for id in due {
            let Some(group) = self.groups.get(&id) else { continue };
            for node in group.serving(&self.common) {
                self.common.nodes.remove(&node);
                self.common.outputs.push_back(ServerOutput::Expelled(node));
            }
            if let Some(group) = self.groups.get_mut(&id) {
                group.held = false;
                group.begin_change(&mut self.common);
            }
            self.common.tell_roster();
        }
    }

    /// Sends a node away, as if it had asked to leave.
    pub(super) fn send_away(&mut self, node: NodeId, reason: String) {
        match self.common.nodes.get_mut(&node) {
            Some(entry) => (entry.leaving, entry.unwanted) = (true, Some((Farewell::SentAway, reason))),
            None => self.common.close(Peer::Node(node), Farewell::SentAway, reason),
        }
    }

    /// Dismisses leaving nodes that no longer compute anything.
    pub(super) fn release(&mut self) {
        let free: Vec<_> = self
            .common
            .nodes
            .iter()
            .filter(|(node, entry)| entry.leaving && self.group_of(**node).is_none())
            .map(|(&node, _)| node)
            .collect();
        if !free.is_empty() {
            for node in free {
                let unwanted = self.common.nodes.get_mut(&node).and_then(|entry| entry.unwanted.take());
                let (farewell, reason) = unwanted.unwrap_or((Farewell::Left, "it has left".into()));
                self.common.dismiss(node, farewell, reason);
            }
            self.common.tell_roster();
        }
    }
}
