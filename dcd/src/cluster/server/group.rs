//! Keeps one consistency group on the server: its view (membership), its record of the world, and its
//! members' complaints about lost links.

mod agreement;
mod change;
mod divisions;
mod orphans;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use self::change::ViewChange;
use self::divisions::Divisions;
use self::orphans::Notes;
use super::ServerOutput;
use super::common::{Common, NodeEntry};
use super::postponed::Postponed;
use super::retold::Retold;
use super::steered::Steered;
use super::verdicts::Drawn;
use crate::cluster::state_replication::TELL_TICK;
use crate::cluster::{Life, Record};
use crate::fidelity::FidelityReport;
use crate::protocol::{BodyRecord, ToClient, ToNode, ToServer, View, WorldOp};
use crate::space::{Allocation, BodyId, DistributionTree, GroupId, NodeId, RegionId, Tick};

/// How long complaints about lost links are collected before one of the members concerned has to go.
const HEARING: Duration = Duration::from_millis(50);
/// How long a participant is not believed about another member, once it was believed when it accused one
/// alone.
const BELIEVED: Duration = Duration::from_secs(10);

/// A complaint: the node that complains, and the node that it cannot reach.
type Complaint = (NodeId, NodeId);

/// The findings of an audit, which compares what members own with the record when the world is to end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Audit {
    /// Bodies of the world that no node owns.
    pub lost: Vec<BodyId>,
    /// Bodies that more than one node owns.
    pub doubled: Vec<BodyId>,
    /// Says whether a group's members could not be asked, since none is heard of.
    pub unanswered: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Group {
    pub id: GroupId,
    pub record: Record,
    pub tick: Tick,
    /// The time at which the server heard of that tick.
    pub heard_at: Duration,
    pub view: Option<View>,
    /// The view before the present one: members that never heard of the present view are known by it.
    pub former: Option<View>,
    pub change: Option<ViewChange>,
    /// Operations that the leader had handed over when the group fell silent in a view change. They are for
    /// the nodes that take over.
    pub left_over: Vec<WorldOp>,
    /// The states that the record had of jointed bodies before survivors told of them in view changes that were
    /// not completed.
    pub notes: Notes,
    divisions: Divisions,
    /// Members that have reported all that they know of the world's last tick.
    pub at_last_tick: BTreeSet<NodeId>,
    /// Bodies that the leader was told to insert and that no node has reported yet.
    pub arriving: BTreeSet<BodyId>,
    pub postponed: Postponed,
    /// What the program took away and altered, for leaders to come.
    pub retold: Retold,
    /// The velocities that kinematic bodies were given.
    pub steered: Steered,
    /// The region that owns each body, as members reported in the present view. Operators are told it, and it
    /// shows which member may report a removal.
    pub owners: BTreeMap<BodyId, RegionId>,
    complaints: BTreeSet<Complaint>,
    /// The time at which each participant that accused a member alone was believed.
    believed: BTreeMap<NodeId, Duration>,
    /// For each member that was accused by one participant alone in the present view, and did not go: the
    /// participant, which went itself.
    denounced: BTreeMap<NodeId, NodeId>,
    /// The time at which the complaints are decided on.
    pub hearing: Option<Duration>,
    /// Says whether a view change must compare everything: a member's link broke and what was sent over it may be
    /// lost, or bodies to be inserted are too large for one operation.
    pub unsure: bool,
    /// Says whether anything was heard of the present view. If not, perhaps no member has heard of it.
    pub confirmed: bool,
    /// The time since which no member has a link, though some may go on computing.
    pub silent_since: Option<Duration>,
    /// Says whether the group is held: no member has a link, and clients were told so.
    pub held: bool,
    /// Says whether the world is to be saved. Members then say all that they own.
    pub saving: bool,
    /// The findings of the last survey of a world that ends.
    pub audit: Option<Audit>,
    /// How often each member has come back in the present view change. Each return began the change anew.
    returns: BTreeMap<NodeId, u32>,
    /// The participants that are verified.
    pub drawn: Drawn,
    /// What the leader last reported of what it saves and costs not to compute everything in full.
    pub fidelity: Option<FidelityReport>,
}

impl Group {
    pub(super) fn new(id: GroupId, record: Record, tick: Tick) -> Self {
        Self {
            id,
            record,
            tick,
            heard_at: Duration::ZERO,
            view: None,
            former: None,
            change: None,
            left_over: Vec::new(),
            notes: Notes::default(),
            divisions: Divisions::default(),
            at_last_tick: BTreeSet::new(),
            arriving: BTreeSet::new(),
            postponed: Postponed::default(),
            retold: Retold::default(),
            steered: Steered::default(),
            owners: BTreeMap::new(),
            complaints: BTreeSet::new(),
            believed: BTreeMap::new(),
            denounced: BTreeMap::new(),
            hearing: None,
            unsure: false,
            confirmed: false,
            silent_since: None,
            held: false,
            saving: false,
            audit: None,
            returns: BTreeMap::new(),
            drawn: Drawn::default(),
            fidelity: None,
        }
    }

    /// Returns the same group under another id.
    pub(super) fn renamed(self, id: GroupId, tick: Tick) -> Self {
        Self { id, tick, ..self }
    }

    pub(super) fn is_member(&self, node: NodeId) -> bool {
        self.view.as_ref().is_some_and(|view| view.members.iter().any(|member| member.node == node))
    }

    /// Returns the members that compute the present view, as far as the server knows.
    pub(super) fn serving(&self, common: &Common) -> BTreeSet<NodeId> {
        let Some(view) = &self.view else { return BTreeSet::new() };
        let serves =
            |node: &NodeId| common.nodes.get(node).is_some_and(|entry| entry.serving == Some(view.number));
        view.members.iter().map(|member| member.node).filter(serves).collect()
    }

    /// Returns the nodes that are to be the members of the next view. A node that computes another group's
    /// view must first be let go there.
    pub(super) fn wanted<'a>(&self, common: &'a Common) -> impl Iterator<Item = (NodeId, &'a NodeEntry)> {
        let (id, present) = (self.id, self.view.as_ref().map(|view| view.number));
        let is_free = move |entry: &NodeEntry| entry.serving.is_none() || entry.serving == present;
        let belongs = move |entry: &NodeEntry| entry.group == Some(id) && entry.is_ready() && is_free(entry);
        common.nodes.iter().filter(move |(_, entry)| belongs(entry)).map(|(&node, entry)| (node, entry))
    }

    pub(super) fn leader_is(&self) -> ToClient {
        let number = self.view.as_ref().map_or_else(Default::default, |view| view.number);
        let view = self.view.as_ref().filter(|_| !self.held);
        let leader = view.and_then(View::led_by).cloned();
        let allocation = view.map(|view| view.allocation.clone()).unwrap_or_default();
        let tree = view.map(|view| view.tree.clone());
        ToClient::LeaderIs { group: self.id, view: number, leader, tree, allocation }
    }

    /// Tells the leader what to do to the world. While membership changes, `Adopt` takes care of it instead.
    pub(super) fn apply(&self, common: &mut Common, ops: Vec<WorldOp>) {
        if self.change.is_none() {
            self.tell_leader(common, ops);
        }
    }

    /// Tells the leader of the present view what to do to the world, if it has a link.
    pub(super) fn tell_leader(&self, common: &mut Common, ops: Vec<WorldOp>) {
        let (now, Some(view)) = (common.now, &self.view) else { return };
        let Some(leader) = common.nodes.get_mut(&view.leader).filter(|leader| leader.linked) else { return };
        let first = leader.moves.are_sent(now, &ops);
        common.send_node(view.leader, ToNode::Apply { view: view.number, first, ops });
    }

    /// Begins a view change if membership is not as it should be.
    pub(super) fn reconsider(&mut self, common: &mut Common) {
        if self.change.is_some() || self.audit.is_some() {
            return;
        }
        if common.stopping {
            // If a member died during the last survey, what it owned has been taken over: now all can be
            // asked.
            return match self.view {
                Some(_) if !self.held => self.begin_change(common),
                // Nobody computes, or nobody who does is heard of.
                None => self.audit = Some(Audit::default()),
                Some(_) => self.audit = Some(Audit { unanswered: true, ..Audit::default() }),
            };
        }
        // Without a view, the record has all that there is to know. A group that is held has a view: its
        // members may compute unheard, and are waited for.
        if self.saving && self.view.is_none() {
            self.tell_saved(common);
        }
        // No view change begins while a member may come back, as its answer would have to be waited for. The
        // members compute on meanwhile.
        let is_awaited = |node: &NodeId| common.nodes[node].absent_until.is_some();
        if self.serving(common).iter().any(is_awaited) {
            return;
        }
        let wanted: Vec<_> = self.wanted(common).map(|(node, _)| node).collect();
        let is_due = match &self.view {
            Some(_) if self.unsure || self.saving => true,
            Some(view) => view.members.iter().map(|member| member.node).ne(wanted.iter().copied()),
            None => !wanted.is_empty(),
        };
        let can = !self.held || wanted.iter().any(|node| common.nodes[node].linked);
        if is_due && can && (self.view.is_some() || common.begun || common.may_begin()) {
            self.begin_change(common);
        }
    }

    /// Takes in what a member says about the world. Returns `false` if the message is not from a member, or
    /// is of another view.
    pub(super) fn hear(&mut self, common: &mut Common, node: NodeId, message: ToServer) -> bool {
        let present = self.view.as_ref().map(|view| view.number);
        let coming = self.change.as_ref().map(|change| change.number);
        match message {
            ToServer::Settling { view, dispatches, undone, last } if Some(view) == coming => {
                return self.settling(common, node, dispatches, undone, last);
            }
            ToServer::Survey { view, tick, division, claims } if Some(view) == coming => {
                return self.surveyed(common, node, tick, division, claims);
            }
            ToServer::Found { view, bodies, last } if Some(view) == coming => {
                return self.found(common, node, bodies, last);
            }
            _ if !self.is_member(node) => return false,
            ToServer::Checkpoint { view, division, .. } if Some(view) == present => {
                self.confirmed = true;
                match self.divisions.is_ahead(division) {
                    true => common.stale += self.divisions.wait(node, message),
                    false => self.hear_of_bodies(common, node, message),
                }
            }
            ToServer::Removed { view, .. } if Some(view) == present => {
                self.confirmed = true;
                self.hear_of_bodies(common, node, message);
            }
            ToServer::Repartitioned { view, tree, allocation, division, .. }
                if Some(view) == present && self.leads(node) =>
            {
                return self.repartitioned(common, tree, allocation, division);
            }
            ToServer::LinkLost { view, node: other } if Some(view) == present && self.is_member(other) => {
                self.complaints.insert((node, other));
                // If the server has no link with that node either, nobody else needs to be heard.
                let misses_it = !common.nodes.get(&other).is_some_and(|entry| entry.linked);
                let at = if misses_it { common.now } else { common.now + HEARING };
                self.hearing = Some(self.hearing.map_or(at, |hearing| hearing.min(at)));
            }
            _ => return false,
        }
        true
    }

    pub(super) fn leads(&self, node: NodeId) -> bool {
        self.view.as_ref().is_some_and(|view| view.leader == node)
    }

    /// Takes in the new tree and allocation, and tells clients, which look for bodies by them. These need not
    /// outlive the server, as members know them. Returns `false` if a node of the allocation is no member.
    fn repartitioned(
        &mut self,
        common: &mut Common,
        tree: DistributionTree,
        allocation: Allocation,
        division: u32,
    ) -> bool {
        let Some(view) = &mut self.view else { return false };
        if !allocation.values().all(|node| view.members.iter().any(|member| member.node == *node)) {
            return false;
        }
        for (node, message) in self.divisions.learn(division, allocation.clone()) {
            self.hear_of_bodies(common, node, message);
        }
        let Some(view) = &mut self.view else { return false };
        if (&view.tree, &view.allocation) == (&tree, &allocation) {
            return true;
        }
        (view.tree, view.allocation) = (tree.clone(), allocation.clone());
        let view = view.clone();
        common.outputs.push_back(ServerOutput::Repartitioned { group: self.id, view });
        common.send_clients(self.id, &ToClient::Regions { tree, allocation });
        true
    }

    /// Takes in states of bodies in the sender's own regions. Others are counted as stale, and change
    /// nothing.
    fn hear_of_bodies(&mut self, common: &mut Common, node: NodeId, message: ToServer) {
        // The leader says which tick the world is at, even when nothing moves. Other members may be ahead of
        // its word, but not by much.
        let most = Tick(self.tick.0 + 2 * (TELL_TICK + common.config.world.protocol.lag_ticks()));
        let leads = self.leads(node);
        match message {
            ToServer::Checkpoint { tick: said, division, bodies, .. } => {
                let tick = if leads { said } else { said.min(most) };
                for checkpoint in &bodies {
                    let is_own = self.divisions.computes(node, checkpoint.region, division);
                    if !is_own || !checkpoint.epoch.is_possible(common.number.0, tick) {
                        common.stale += 1;
                        continue;
                    }
                    self.arriving.remove(&checkpoint.id);
                    self.record.checkpoint(tick, checkpoint);
                    self.steered.hold(&mut self.record, checkpoint.id);
                    let known = self.record.body(checkpoint.id);
                    if known.is_some_and(|body| body.epoch == checkpoint.epoch) {
                        self.owners.insert(checkpoint.id, checkpoint.region);
                    }
                }
                // Bodies that are gone are forgotten now and then.
                if self.owners.len() > 2 * self.record.len() + 64 {
                    self.owners.retain(|&id, _| self.record.life(id).is_some());
                }
                if leads {
                    if tick > self.tick {
                        (self.tick, self.heard_at) = (tick, common.now);
                    }
                    // While the group is unsure, what the leader was told may be lost with a link.
                    if self.change.is_none() && !self.unsure {
                        let ahead = common.config.world.protocol.lag_ticks() + 1;
                        self.retold.leader_is_at(common.now, tick, ahead);
                    }
                }
                if common.config.world.last_tick == Some(said) {
                    self.at_last_tick.insert(node);
                }
            }
            ToServer::Removed { tick: said, bodies, .. } => {
                let tick = if leads { said } else { said.min(most) };
                for body in bodies {
                    let is_own = !self.is_anothers(node, &body);
                    if is_own && body.epoch.is_possible(common.number.0, tick) {
                        self.removed(common, tick, body);
                    } else {
                        common.stale += 1;
                    }
                }
            }
            _ => {}
        }
    }

    /// Returns whether another member is known to own a body, having said so at the epoch that the sender
    /// names or at a later one.
    fn is_anothers(&self, node: NodeId, body: &BodyRecord) -> bool {
        let known = self.record.body(body.id).is_some_and(|known| known.epoch >= body.epoch);
        let region = self.owners.get(&body.id).filter(|_| known);
        let allocation = self.view.as_ref().map(|view| &view.allocation);
        let owner = region.and_then(|region| allocation?.get(region));
        owner.is_some_and(|owner| *owner != node)
    }

    /// Decides which members have to go, as members that cannot reach one another cannot share a tree.
    /// Members without a link go first, then those that most others complain of. Among equals a participant
    /// goes, then the one with the highest id. A node that is dead or hangs does not complain itself. Returns
    /// each member that goes once, with whether it is at fault itself. It is not if it has no link, or if a
    /// participant alone accuses it, which may say what it likes.
    pub(super) fn decide_complaints(&mut self, common: &Common) -> Vec<(NodeId, bool)> {
        self.hearing = None;
        // A node that is on its way out neither accuses nor is accused.
        let serving = self.serving(common);
        let mut open: BTreeSet<_> = std::mem::take(&mut self.complaints)
            .into_iter()
            .filter(|(a, b)| serving.contains(a) && serving.contains(b))
            .collect();
        let mut going = Vec::new();
        while !open.is_empty() {
            let mut votes: BTreeMap<NodeId, usize> = BTreeMap::new();
            for &(_, accused) in &open {
                *votes.entry(accused).or_default() += 1;
            }
            let is_gone = |node: &NodeId| !common.nodes.get(node).is_some_and(|entry| entry.linked);
            let worst = votes
                .iter()
                .max_by_key(|&(node, &count)| (is_gone(node), count, !self.is_dedicated(*node), *node));
            let Some((&worst, &count)) = worst else { break };
            let lone = open.iter().find(|(_, accused)| *accused == worst).map(|(accuser, _)| *accuser);
            let lone = lone.filter(|lone| count == 1 && !is_gone(&worst) && self.is_doubtful(*lone));
            let named = |accuser| open.iter().filter(|(a, _)| *a == accuser).count();
            let liar = lone.filter(|&lone| self.overreaches(common, lone, worst, named(lone)));
            self.denounced.extend(liar.map(|liar| (worst, liar)));
            let goes = liar.unwrap_or(worst);
            going.push((goes, liar.is_some() || lone.is_none() && !is_gone(&worst)));
            open.retain(|&(a, b)| a != goes && b != goes);
        }
        going
    }

    /// Notes that a participant that accused a member alone and goes has nothing to be forgiven: its failure
    /// did not count.
    pub(super) fn has_not_counted(&mut self, accuser: NodeId) {
        self.denounced.retain(|_, liar| *liar != accuser);
    }

    /// Returns, and forgets, the participant that accused this member alone and went itself, though this
    /// member hangs indeed.
    pub(super) fn was_denounced_by(&mut self, mute: NodeId) -> Option<NodeId> {
        self.denounced.remove(&mute)
    }

    fn is_dedicated(&self, node: NodeId) -> bool {
        let mut members = self.view.iter().flat_map(|view| &view.members);
        members.any(|member| member.node == node && member.client.is_none())
    }

    /// Returns whether a node's word alone may be a lie: the node is a participant and does not lead.
    fn is_doubtful(&self, node: NodeId) -> bool {
        !self.leads(node) && !self.is_dedicated(node)
    }

    /// Returns whether a participant that accuses alone claims more than its word is good for. It does if it
    /// accuses several members, another one soon after it was believed, or the last dedicated node. Then its
    /// own links are at fault, or it wants the world for itself.
    fn overreaches(&mut self, common: &Common, accuser: NodeId, accused: NodeId, named: usize) -> bool {
        let others = self.serving(common).into_iter().filter(|node| *node != accused);
        let is_last = self.is_dedicated(accused) && !others.into_iter().any(|node| self.is_dedicated(node));
        let now = common.now;
        self.believed.retain(|_, at| now < *at + BELIEVED);
        let was_believed = self.believed.contains_key(&accuser);
        let overreaches = named > 1 || is_last || was_believed;
        if !overreaches {
            self.believed.insert(accuser, now);
        }
        overreaches
    }

    /// Closes the audit and lists the lost and the doubled bodies. By now all members have told what they
    /// own, or there is nobody to ask.
    pub(super) fn close_audit(&mut self, owners: &BTreeMap<BodyId, usize>) {
        let lost = self
            .record
            .movable_lives()
            .filter(|(_, life)| *life == Life::Live)
            .map(|(id, _)| id)
            .filter(|id| !owners.contains_key(id) && !self.arriving.contains(id))
            .collect();
        let doubled = owners.iter().filter(|(_, count)| **count > 1).map(|(&id, _)| id).collect();
        self.audit = Some(Audit { lost, doubled, unanswered: false });
    }

    /// Marks the group as held, as no member has a link. Members may be dead, or compute where they are not
    /// heard.
    pub(super) fn fall_silent(&mut self, common: &mut Common) {
        if let Some(change) = self.change.take() {
            self.left_over = change.handed_over();
        }
        self.denounced.clear();
        self.silent_since.get_or_insert(common.now);
        if !self.held {
            self.held = true;
            common.outputs.push_back(ServerOutput::Held { group: self.id, tick: self.tick });
            let leader = self.leader_is();
            common.send_clients(self.id, &leader);
        }
    }
}

impl Common {
    /// Returns whether enough nodes are there for the world to begin.
    pub(super) fn may_begin(&self) -> bool {
        self.nodes.values().filter(|entry| entry.is_ready()).count() >= self.config.min_nodes
    }
}
