//! Runs the view changes of a group: decides which nodes are members and which member computes which region,
//! so that no body is lost or doubled on the way.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::Group;
use super::agreement::{self, Division};
use super::divisions::Divisions;
use super::orphans::{Notes, Orphans};
use crate::cluster::server::ServerOutput;
use crate::cluster::server::common::Common;
use crate::cluster::server::moves::Moves;
use crate::cluster::server::verdicts::told_to;
use crate::cluster::{Key, Life};
use crate::protocol::{
    BodyRecord, CHUNK_BYTES, Chunk, Claim, Dispatch, Member, Placed, ToNode, View, ViewNumber, WorldOp,
    chunks, encoded_len, split,
};
use crate::space::{
    Allocation, BodyId, DistributionTree, Epoch, NodeId, RegionId, Tick, allocate, balanced, reallocate,
};

/// How long a member may keep a view change waiting before it is given up.
const MUTE: Duration = Duration::from_secs(5);
/// How long parts of what a member owes, which come slowly over some links, may put that off.
const PARTS: Duration = Duration::from_secs(20);
/// How much longer for each body that is fetched, which takes some 300 bytes.
const PART: Duration = Duration::from_millis(1);
/// How many times more often than the others a member may come back in one view change. Each return begins
/// the change anew.
const RETURNS: u32 = 3;
/// The most bytes of operations that a leader had not passed on and hands over.
const UNDONE_BYTES: usize = 64 << 20;

/// A view change under way. A death begins it anew under the next number.
#[derive(Clone, Debug)]
pub(in crate::cluster::server) struct ViewChange {
    pub number: ViewNumber,
    /// The time at which a member last did what was asked, or a part of it.
    at: Duration,
    /// The time at which a member last did all that was asked, and for how long after that parts may put off
    /// that the others are given up.
    since: Duration,
    patience: Duration,
    /// Members of the last view that are alive, including those that are leaving.
    survivors: BTreeSet<NodeId>,
    /// The dispatches that survivors know, as far as they have told yet.
    settling: BTreeMap<NodeId, Vec<Dispatch>>,
    /// The dispatches of survivors that have told all.
    settled: BTreeMap<NodeId, Vec<Dispatch>>,
    /// Operations of the server's program on moving bodies that the last leader had not passed on when it
    /// stopped.
    undone: Vec<WorldOp>,
    /// The same operations as far as the leader has told them, and their length in bytes.
    telling: Vec<WorldOp>,
    telling_bytes: usize,
    /// The last tick that the survivors complete.
    last: Tick,
    /// Survivors that have begun that tick, or one before it, otherwise than the others are to do it.
    astray: BTreeSet<NodeId>,
    surveys: BTreeMap<NodeId, Vec<Claim>>,
    /// The tree and the allocation of each survivor after that tick.
    divisions: BTreeMap<NodeId, Option<Division>>,
    /// The plan of the next view, made when all surveys are in.
    plan: Option<Plan>,
    /// Members that by this plan keep nothing of what they have computed. It is fetched, and placed with them
    /// anew.
    anew: BTreeSet<NodeId>,
}

/// The plan of the next view, made from the surveys.
#[derive(Clone, Debug)]
struct Plan {
    members: Vec<Member>,
    tree: DistributionTree,
    allocation: Allocation,
    owners: BTreeMap<BodyId, Owner>,
    /// Members that still owe bodies that were fetched.
    fetching: BTreeSet<NodeId>,
    /// The bodies that no member owns.
    orphans: Orphans,
    /// Says whether all bodies were fetched, so that the world can be saved.
    saves: bool,
}

#[derive(Clone, Copy, Debug)]
struct Owner {
    epoch: Epoch,
    node: NodeId,
    region: RegionId,
}

impl ViewChange {
    /// Notes that a member has done all that was asked, or a part of it. Parts put off the end of the wait
    /// for a limited time only.
    fn hears(&mut self, now: Duration, all: bool) {
        if all {
            self.since = now;
        }
        self.at = now.min(self.since + self.patience);
    }

    /// Returns whether a member has kept something of the last view. A member that has begun anew has no
    /// division.
    fn has_kept(&self, node: NodeId) -> bool {
        self.divisions.get(&node).is_some_and(Option::is_some)
    }

    /// Returns the operations that the leader handed over. They count until it has told all of them again, as
    /// it may die before that. If it never told all, what it has begun to tell counts.
    pub(super) fn handed_over(self) -> Vec<WorldOp> {
        match self.undone.is_empty() {
            true => self.telling,
            false => self.undone,
        }
    }
}

impl Group {
    /// Begins a view change, anew if one is under way.
    pub(in crate::cluster::server) fn begin_change(&mut self, common: &mut Common) {
        self.unsure = false;
        if self.change.is_none() {
            self.returns.clear();
        }
        let number = common.next_view_number();
        let survivors = self.serving(common);
        for &node in &survivors {
            common.send_node(node, ToNode::Settle { view: number });
        }
        let left_over = std::mem::take(&mut self.left_over);
        let former = self.change.take();
        let undone = former.map_or(left_over, ViewChange::handed_over);
        self.change = Some(ViewChange {
            number,
            at: common.now,
            since: common.now,
            patience: PARTS,
            survivors,
            settling: BTreeMap::new(),
            settled: BTreeMap::new(),
            undone,
            telling: Vec::new(),
            telling_bytes: 0,
            last: Tick(0),
            astray: BTreeSet::new(),
            surveys: BTreeMap::new(),
            divisions: BTreeMap::new(),
            plan: None,
            anew: BTreeSet::new(),
        });
        self.finish(common);
    }

    /// Counts that a member comes back amid a view change. Returns whether it does so again and again while
    /// other linked members do not: the change would never end. Where the server's own link breaks, all come
    /// back equally often.
    pub(in crate::cluster::server) fn returns_too_often(&mut self, common: &Common, node: NodeId) -> bool {
        let own = self.returns.entry(node).or_default();
        *own += 1;
        let own = *own;
        let is_other = |other: &NodeId| *other != node && common.nodes[other].linked;
        let others = self.serving(common).into_iter().filter(is_other);
        let least = others.map(|other| self.returns.get(&other).copied().unwrap_or_default()).min();
        least.is_some_and(|least| own > least + RETURNS)
    }

    /// Returns when members that owe an answer are given up.
    pub(in crate::cluster::server) fn mute_at(&self) -> Option<Duration> {
        self.change.as_ref().filter(|change| !change.survivors.is_empty()).map(|change| change.at + MUTE)
    }

    /// Returns the members that have owed an answer for too long.
    pub(in crate::cluster::server) fn mute(&mut self, now: Duration) -> Vec<NodeId> {
        if self.mute_at().is_none_or(|at| now < at) {
            return Vec::new();
        }
        let Some(change) = &mut self.change else { return Vec::new() };
        change.at = now;
        let owes = |node: &&NodeId| match &change.plan {
            Some(plan) => plan.fetching.contains(node),
            None if change.settled.len() < change.survivors.len() => !change.settled.contains_key(node),
            None => !change.surveys.contains_key(node),
        };
        change.survivors.iter().filter(owes).copied().collect()
    }

    /// Returns the members that cannot complete the last tick with the others. The change goes on once they
    /// are gone.
    pub(in crate::cluster::server) fn take_astray(&mut self) -> BTreeSet<NodeId> {
        self.change.as_mut().map(|change| std::mem::take(&mut change.astray)).unwrap_or_default()
    }

    pub(in crate::cluster::server) fn settling(
        &mut self,
        common: &mut Common,
        node: NodeId,
        dispatches: Vec<Dispatch>,
        undone: Vec<WorldOp>,
        last: bool,
    ) -> bool {
        let leads = self.leads(node);
        // No member is ahead of another, or keeps dispatches, by more than the ticks that members may be
        // apart.
        let most = 4 * (common.config.world.protocol.lag_ticks() as usize + 1);
        let owes = |change: &&mut ViewChange| {
            change.survivors.contains(&node) && !change.settled.contains_key(&node)
        };
        let Some(change) = self.change.as_mut().filter(owes) else { return false };
        if leads && !change.settling.contains_key(&node) {
            (change.telling, change.telling_bytes) = (Vec::new(), 0);
        }
        let told = change.settling.entry(node).or_default();
        if told.len() + dispatches.len() > most {
            return false;
        }
        told.extend(dispatches);
        change.hears(common.now, last);
        for op in undone.into_iter().filter(|op| leads && op.moves().is_some()) {
            change.telling_bytes += encoded_len(&op);
            change.telling.extend(Some(op).filter(|_| change.telling_bytes <= UNDONE_BYTES));
        }
        if last && leads {
            change.undone = std::mem::take(&mut change.telling);
        }
        if last {
            change.settled.extend(change.settling.remove_entry(&node));
            self.finish(common);
        }
        true
    }

    /// Makes all survivors complete the newest dispatch, once all have stopped.
    fn finish(&mut self, common: &mut Common) {
        let Some(change) = &mut self.change else { return };
        if change.settled.len() < change.survivors.len() {
            return;
        }
        let mut dispatches = Vec::new();
        if let Some(view) = &self.view {
            let lag = common.config.world.protocol.lag_ticks();
            let (counted, refused) = agreement::dispatches(view, self.tick, lag, &change.settled);
            change.last = counted.last().map_or(view.tick, |last| last.tick);
            common.stale += refused;
            change.astray = agreement::astray(view, lag, &change.settled, &counted);
            if !change.astray.is_empty() {
                return;
            }
            dispatches = counted;
        }
        let survivors: Vec<_> = change.survivors.iter().copied().collect();
        let mut parts = split(dispatches, CHUNK_BYTES);
        let end = parts.pop().unwrap_or_default();
        let parts: Vec<_> = parts.into_iter().map(|part| (part, false)).chain([(end, true)]).collect();
        for &node in &survivors {
            for (dispatches, last) in &parts {
                let (view, dispatches, survivors) = (change.number, dispatches.clone(), survivors.clone());
                common.send_node(node, ToNode::Finish { view, dispatches, survivors, last: *last });
            }
        }
        self.plan(common);
    }

    pub(in crate::cluster::server) fn surveyed(
        &mut self,
        common: &mut Common,
        node: NodeId,
        tick: Tick,
        division: Option<Division>,
        claims: Vec<Claim>,
    ) -> bool {
        match &mut self.change {
            Some(change) if change.survivors.contains(&node) && !change.surveys.contains_key(&node) => {
                change.hears(common.now, true);
                // No single member says which tick the world is at.
                common.stale += u64::from(tick > change.last);
                let tick = tick.min(change.last);
                let newest = common.number.0;
                let is_possible = |claim: &Claim| claim.epoch.is_possible(newest, tick);
                let (claims, forged): (Vec<_>, Vec<_>) = claims.into_iter().partition(is_possible);
                common.stale += forged.len() as u64;
                change.surveys.insert(node, claims);
                change.divisions.insert(node, division);
                if tick > self.tick {
                    (self.tick, self.heard_at) = (tick, common.now);
                }
                self.plan(common);
                true
            }
            _ => false,
        }
    }

    /// Plans the next view once all owned bodies are known: which member computes which region, and which
    /// bodies must be fetched for that.
    fn plan(&mut self, common: &mut Common) {
        let Some(change) = &mut self.change else { return };
        if change.surveys.len() < change.survivors.len() {
            return;
        }
        let division = self.view.as_ref().and_then(|view| agreement::division(view, &change.divisions));
        if let Some((_, allocation)) = &division {
            for (node, claims) in &mut change.surveys {
                let before = claims.len();
                claims.retain(|claim| allocation.get(&claim.region) == Some(node));
                common.stale += (before - claims.len()) as u64;
            }
        }
        let Some(change) = &self.change else { return };
        let is_whole =
            self.view.iter().flat_map(|view| &view.members).all(|m| change.survivors.contains(&m.node));
        if common.stopping && is_whole {
            return self.audit();
        }
        let members: Vec<_> = self.wanted(common).map(|(_, entry)| entry.member.clone()).collect();
        let ids: Vec<_> = members.iter().map(|member| member.node).collect();
        let (tree, allocation) = self.divide(common, &ids, division);
        let anew = match members.is_empty() {
            true => BTreeSet::new(),
            false => self.drawn.anew(
                common,
                &members,
                leader_among(&members, self.view.as_ref().map(|view| view.leader)),
                |node| change.has_kept(node),
            ),
        };
        let mut owners: BTreeMap<BodyId, Owner> = BTreeMap::new();
        for (&node, claims) in &change.surveys {
            for claim in claims {
                let owner = Owner { epoch: claim.epoch, node, region: claim.region };
                let held = owners.entry(claim.id).or_insert(owner);
                if claim.epoch > held.epoch {
                    *held = owner;
                }
            }
        }
        let mut fetch: BTreeMap<NodeId, Vec<BodyId>> = BTreeMap::new();
        let lost = |(id, life): &(BodyId, Life)| *life == Life::Live && !owners.contains_key(id);
        let lost = self.record.movable_lives().filter(lost).map(|(id, _)| id);
        let orphans = Orphans::new(&self.record, &self.notes, lost);
        let tied: BTreeSet<_> = orphans.bodies().collect();
        for (id, life) in self.record.movable_lives() {
            let is_told = self.saving || tied.contains(&id);
            match (owners.get(&id), life) {
                (Some(owner), Life::Live) if !is_told && self.stays(id, owner, &allocation, &anew) => {}
                (Some(owner), Life::Live | Life::Removing { park: true, .. }) => {
                    fetch.entry(owner.node).or_default().push(id);
                }
                (None, Life::Live) => {
                    for &node in &change.survivors {
                        fetch.entry(node).or_default().push(id);
                    }
                }
                _ => {}
            }
        }
        let fetching = fetch.keys().copied().collect();
        let asked: usize = fetch.values().map(Vec::len).sum();
        for (node, bodies) in fetch {
            bodies.iter().for_each(|&id| self.notes.note(&self.record, id));
            common.send_node(node, ToNode::Fetch { view: change.number, bodies });
        }
        if let Some(change) = &mut self.change {
            change.patience = PARTS + PART * asked as u32;
            change.plan =
                Some(Plan { members, tree, allocation, owners, fetching, orphans, saves: self.saving });
            change.anew = anew;
        }
        self.conclude(common);
    }

    /// Returns the tree and the allocation of the next view. Where the world is balanced by load, members
    /// keep the regions that they have, and the leader later gives a share to members that have none. There,
    /// a world that nobody computes is cut by where its bodies lie.
    fn divide(&self, common: &Common, members: &[NodeId], present: Option<Division>) -> Division {
        let world = &common.config.world;
        let known = self.view.as_ref().map_or(&world.tree, |view| &view.tree);
        if members.is_empty() {
            return (present.map_or_else(|| known.clone(), |(tree, _)| tree), Allocation::new());
        }
        match (present, &world.balance) {
            (Some((tree, former)), Some(_)) => {
                let loads = self.record.loads(&tree);
                let allocation = reallocate(&tree, &former, members, |region| loads[&region]);
                (tree, allocation)
            }
            // A save changes neither.
            (Some((tree, former)), None) if self.saving && self.is_of(members) => (tree, former),
            (present, balance) => {
                let tree = match (present, balance) {
                    (Some((tree, _)), _) => tree,
                    (None, Some(balance)) => {
                        let burdens: Vec<_> = self.record.burdens().collect();
                        balanced(known.clone(), &burdens, &balance.among(members.len()))
                    }
                    (None, None) => known.clone(),
                };
                let loads = self.record.loads(&tree);
                let allocation = allocate(&tree, members, |region| loads[&region]);
                (tree, allocation)
            }
        }
    }

    /// Returns whether these are the members of the present view.
    fn is_of(&self, members: &[NodeId]) -> bool {
        let present = self.view.iter().flat_map(|view| &view.members).map(|member| member.node);
        present.eq(members.iter().copied())
    }

    /// Returns whether a body goes on where it is. Its region still belongs to its owner, the owner keeps
    /// what it computed, and the record has no later epoch, as from a view that nobody came to compute.
    fn stays(&self, id: BodyId, owner: &Owner, allocation: &Allocation, anew: &BTreeSet<NodeId>) -> bool {
        let known = self.record.body(id).map(|body| body.epoch);
        !anew.contains(&owner.node)
            && allocation.get(&owner.region) == Some(&owner.node)
            && known <= Some(owner.epoch)
    }

    /// Compares what the members own with the record. Then the world ends.
    fn audit(&mut self) {
        let Some(change) = self.change.take() else { return };
        let mut owners: BTreeMap<BodyId, usize> = BTreeMap::new();
        for claim in change.surveys.values().flatten() {
            *owners.entry(claim.id).or_default() += 1;
        }
        self.close_audit(&owners);
    }

    pub(in crate::cluster::server) fn found(
        &mut self,
        common: &mut Common,
        node: NodeId,
        bodies: Vec<BodyRecord>,
        last: bool,
    ) -> bool {
        let number = common.number.0;
        let owes =
            |change: &&mut ViewChange| change.plan.as_ref().is_some_and(|plan| plan.fetching.contains(&node));
        let Some(change) = self.change.as_mut().filter(owes) else { return false };
        change.hears(common.now, last);
        let Some(plan) = &mut change.plan else { return false };
        if last {
            plan.fetching.remove(&node);
        }
        for body in bodies {
            if !body.epoch.is_possible(number, self.tick) {
                common.stale += 1;
                continue;
            }
            let id = body.id;
            match plan.owners.get(&id) {
                Some(owner) if owner.node == node => self.record.reclaim(self.tick, body),
                _ => self.record.freshen(self.tick, body),
            }
            self.steered.hold(&mut self.record, id);
        }
        if last {
            self.conclude(common);
        }
        true
    }

    /// Begins the view once everything is known.
    fn conclude(&mut self, common: &mut Common) {
        let is_complete =
            |change: &mut ViewChange| change.plan.as_ref().is_some_and(|plan| plan.fetching.is_empty());
        let Some(mut change) = self.change.take_if(is_complete) else { return };
        let Some(Plan { members, tree, allocation, owners, orphans, saves, .. }) = change.plan.take() else {
            return;
        };
        self.notes = Notes::default();
        orphans.bring_back(&mut self.record, self.tick, &common.config.world.step);
        let mut homeless = BTreeSet::new();
        let mut moved = BTreeMap::new();
        let mut drop: BTreeSet<BodyId> = BTreeSet::new();
        let mut resting = Vec::new();
        for (id, life) in self.record.movable_lives() {
            match (owners.get(&id), life) {
                (Some(owner), Life::Live) if self.stays(id, owner, &allocation, &change.anew) => {}
                (Some(owner), Life::Live) if tree.is_leaf(owner.region) => {
                    moved.insert(id, owner.region);
                }
                // A claim in a region that does not exist is a mistake, or a lie.
                (_, Life::Live | Life::Waiting) => {
                    homeless.insert(id);
                }
                (_, Life::Removing { park, back }) => {
                    drop.insert(id);
                    resting.push((id, park, back));
                }
                (Some(_), Life::Parked) => {
                    drop.insert(id);
                }
                (None, Life::Parked) => {}
            }
        }
        drop.extend(owners.keys().filter(|id| self.record.life(**id).is_none()));
        // Without a view, bodies that come back wait on record. They are placed below like any newcomer.
        let former = self.view.take();
        for (id, park, back) in resting {
            self.rest(common, id, park, back);
            if self.record.life(id) == Some(Life::Waiting) {
                homeless.insert(id);
            }
        }
        self.held = false;
        self.silent_since = None;
        self.denounced.clear();
        let dropped: Vec<_> =
            change.survivors.iter().filter(|&node| !members.iter().any(|m| m.node == *node)).collect();
        for node in dropped {
            if let Some(entry) = common.nodes.get_mut(node) {
                entry.serving = None;
                entry.loaded = false;
                entry.moved = true;
            }
        }
        common.groups_changed.insert(self.id);
        if members.is_empty() {
            self.steer_record(common, change.undone);
            common.outputs.push_back(ServerOutput::Held { group: self.id, tick: self.tick });
        } else {
            let mut placed = Vec::new();
            for &id in homeless.iter().chain(moved.keys()) {
                self.record.renew(id, change.number);
                self.record.set_life(id, Life::Live);
            }
            placed.extend(self.record.place(&tree, &homeless));
            for (id, region) in moved {
                let body = self.record.body(id).expect("moved bodies are on record").clone();
                placed.push(Placed { region, body });
            }
            placed.sort_by_key(|placed| placed.body.id);
            let view = View {
                group: self.id,
                number: change.number,
                tick: self.tick,
                leader: leader_among(&members, self.view.as_ref().map(|view| view.leader)),
                members,
                tree,
                allocation,
                events: common.config.events,
                viewpoints: common.viewpoints.clone(),
            };
            self.adopt(common, view, placed, &drop, &owners, &change);
            self.catch_up(common, change.undone);
            self.former = former;
        }
        if saves {
            self.tell_saved(common);
        }
        let leader = self.leader_is();
        common.send_clients(self.id, &leader);
    }

    fn adopt(
        &mut self,
        common: &mut Common,
        view: View,
        placed: Vec<Placed>,
        drop: &BTreeSet<BodyId>,
        owners: &BTreeMap<BodyId, Owner>,
        change: &ViewChange,
    ) {
        let ids: BTreeSet<_> = placed.iter().map(|placed| placed.body.id).collect();
        let mut common_parts = chunks(placed, Chunk::Placed);
        common_parts.extend(self.record.joint_chunks(|id| ids.contains(&id)));
        let mut drops = BTreeMap::new();
        for member in &view.members {
            let node = member.node;
            let Some(entry) = common.nodes.get_mut(&node) else { continue };
            // A link that breaks may lose what the node was told before.
            let retold = self.retold.keys().into_iter().filter_map(|key| match key {
                Key::GoneScenery(id) if self.record.body(id).is_none() => Some(id),
                _ => None,
            });
            let stale = std::mem::take(&mut entry.stale_scenery).into_iter().chain(retold);
            // A node that claims a body that another owns at a higher epoch lets go of it.
            let beaten = change
                .surveys
                .get(&node)
                .into_iter()
                .flatten()
                .filter(|claim| owners[&claim.id].node != node);
            let drop: BTreeSet<_> =
                drop.iter().copied().chain(beaten.map(|claim| claim.id)).chain(stale).collect();
            drops.insert(node, drop.into_iter().collect::<Vec<_>>());
        }
        let goes_on = |node| change.has_kept(node) && !change.anew.contains(&node);
        let verified = self.drawn.draw(common, &view, goes_on, &drops);
        for (node, drop) in drops {
            let Some(entry) = common.nodes.get_mut(&node) else { continue };
            entry.serving = Some(view.number);
            entry.moves = Moves::of_view(view.number);
            let mut parts = self.record.shape_chunks(&mut entry.shapes);
            parts.extend(self.record.scenery_chunks(&mut entry.scenery));
            parts.extend(common_parts.iter().cloned());
            for chunk in parts {
                common.send_node(node, ToNode::Chunk(chunk));
            }
            if let Some(verified) = &verified {
                let (nodes, anew) = (told_to(node, &view, verified), !change.anew.is_empty());
                common.send_node(node, ToNode::Verify { view: view.number, nodes, anew });
            }
            common.send_node(node, ToNode::Adopt { view: view.clone(), drop });
        }
        common.world_changed |= !std::mem::replace(&mut common.begun, true);
        self.arriving.clear();
        self.owners.clear();
        self.confirmed = false;
        self.divisions = Divisions::of_view(view.allocation.clone());
        common.outputs.push_back(ServerOutput::Began { group: self.id, view: view.clone() });
        self.view = Some(view);
    }
}

/// Chooses the leader: a dedicated node as long as there is one, since a participant's process is its user's.
/// Among equals the present leader goes on, or else the node with the lowest id leads.
fn leader_among(members: &[Member], present: Option<NodeId>) -> NodeId {
    let leads = |member: &Member| Some(member.node) == present;
    let first = members.iter().min_by_key(|member| (member.client.is_some(), !leads(member), member.node));
    first.expect("a group has a leader").node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::ClientId;

    #[test]
    fn a_participant_leads_only_where_no_dedicated_node_is() {
        let member = |id: u32, client: Option<u32>| Member {
            node: NodeId(id),
            address: ([127, 0, 0, 1], 1).into(),
            client: client.map(ClientId),
        };
        let players = [member(3, Some(1)), member(2, Some(2))];
        assert_eq!(leader_among(&players, None), NodeId(2));
        let [one, two] = players;
        let all = [one, two, member(9, None), member(8, None)];
        assert_eq!(leader_among(&all, None), NodeId(8));
        assert_eq!(leader_among(&all, Some(NodeId(9))), NodeId(9), "who leads leads on");
        assert_eq!(leader_among(&all, Some(NodeId(3))), NodeId(8), "a participant does not");
    }
}
