//! View changes: who is a member, who computes what, and how no body is lost or doubled on the way.

use std::collections::{BTreeMap, BTreeSet};

use super::{Life, Server, ServerOutput};
use crate::protocol::{BodyRecord, Chunk, Claim, Dispatch, Member, Placed, ToNode, View, ViewNumber, chunks};
use crate::space::{Allocation, BodyId, Epoch, NodeId, RegionId, Tick, allocate};

/// A view change under way. A death begins it anew with the next number.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// Members of the last view that live, those who are leaving included.
    survivors: BTreeSet<NodeId>,
    settled: BTreeMap<NodeId, Option<Dispatch>>,
    surveys: BTreeMap<NodeId, Vec<Claim>>,
    /// Made when all surveys are in.
    plan: Option<Plan>,
}

/// What the surveys lead to.
#[derive(Clone, Debug)]
struct Plan {
    members: Vec<Member>,
    allocation: Allocation,
    owners: BTreeMap<BodyId, Owner>,
    /// Who still owes bodies that were fetched.
    fetching: BTreeSet<NodeId>,
}

#[derive(Clone, Copy, Debug)]
struct Owner {
    epoch: Epoch,
    node: NodeId,
    region: RegionId,
}

impl Server {
    /// A node is dead, or has not been there.
    pub(super) fn lose(&mut self, node: NodeId) {
        let mattered = self.is_member(node) || self.change.is_some();
        if self.nodes.remove(&node).is_some() && mattered {
            self.begin_change();
        }
    }

    /// Begins a view change if membership is not as it should be.
    pub(super) fn reconsider(&mut self) {
        if self.change.is_some() {
            return;
        }
        if self.stopping {
            // Somebody died during the last survey. What it owned has been taken over: now all can be asked.
            return match self.view {
                Some(_) => self.begin_change(),
                None if self.ended => {}
                None => self.end(),
            };
        }
        let is_done = |view: &View| view.members.iter().all(|m| self.at_last_tick.contains(&m.node));
        if self.view.as_ref().is_some_and(is_done) {
            return self.stop();
        }
        let idle_leavers: Vec<_> = self
            .nodes
            .iter()
            .filter(|(node, entry)| entry.leaving && !self.is_member(**node))
            .map(|(&node, _)| node)
            .collect();
        for node in idle_leavers {
            self.dismiss(node, false, "leave granted".into());
        }
        let ready = self.nodes.values().filter(|entry| entry.loaded).count();
        let due = match &self.view {
            Some(view) => {
                let leaves =
                    view.members.iter().any(|m| self.nodes.get(&m.node).is_none_or(|entry| entry.leaving));
                leaves || ready > view.members.len()
            }
            None => ready >= if self.begun { 1 } else { self.config.min_nodes },
        };
        if due {
            self.begin_change();
        }
    }

    pub(super) fn begin_change(&mut self) {
        self.number = self.number.next();
        let members = self.view.iter().flat_map(|view| &view.members).map(|member| member.node);
        let survivors: BTreeSet<_> = members.filter(|node| self.nodes.contains_key(node)).collect();
        for &node in &survivors {
            self.send_node(node, ToNode::Settle { view: self.number });
        }
        let settled = BTreeMap::new();
        self.change = Some(Change { survivors, settled, surveys: BTreeMap::new(), plan: None });
        self.finish();
    }

    pub(super) fn settling(&mut self, node: NodeId, view: ViewNumber, dispatch: Option<Dispatch>) {
        match &mut self.change {
            Some(change)
                if view == self.number
                    && change.survivors.contains(&node)
                    && !change.settled.contains_key(&node) =>
            {
                change.settled.insert(node, dispatch);
                self.finish();
            }
            _ => self.stale += 1,
        }
    }

    /// All have stopped: the newest dispatch is completed by everybody.
    fn finish(&mut self) {
        let Some(change) = &self.change else { return };
        if change.settled.len() < change.survivors.len() {
            return;
        }
        let dispatch = change.settled.values().flatten().max_by_key(|dispatch| dispatch.tick).cloned();
        let survivors: Vec<_> = change.survivors.iter().copied().collect();
        for &node in &survivors {
            let (view, dispatch, survivors) = (self.number, dispatch.clone(), survivors.clone());
            self.send_node(node, ToNode::Finish { view, dispatch, survivors });
        }
        self.plan();
    }

    pub(super) fn surveyed(&mut self, node: NodeId, view: ViewNumber, tick: Tick, claims: Vec<Claim>) {
        match &mut self.change {
            Some(change)
                if view == self.number
                    && change.survivors.contains(&node)
                    && !change.surveys.contains_key(&node) =>
            {
                change.surveys.insert(node, claims);
                self.tick = self.tick.max(tick);
                self.plan();
            }
            _ => self.stale += 1,
        }
    }

    /// All owned bodies are known: who is to compute what, and which bodies must be seen whole for that?
    fn plan(&mut self) {
        let Some(change) = &self.change else { return };
        if change.surveys.len() < change.survivors.len() {
            return;
        }
        let is_whole =
            self.view.iter().flat_map(|view| &view.members).all(|m| change.survivors.contains(&m.node));
        if self.stopping && is_whole {
            return self.audit();
        }
        let members: Vec<_> = self
            .nodes
            .values()
            .filter(|entry| entry.loaded && !entry.leaving)
            .map(|entry| entry.member.clone())
            .collect();
        let tree = &self.config.world.tree;
        let loads = self.record.loads(tree);
        let ids: Vec<_> = members.iter().map(|member| member.node).collect();
        let allocation =
            if ids.is_empty() { Allocation::new() } else { allocate(tree, &ids, |region| loads[&region]) };
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
        for (id, life) in self.record.movable_lives() {
            match (owners.get(&id), life) {
                (Some(owner), Life::Live) if allocation.get(&owner.region) == Some(&owner.node) => {}
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
        for (node, bodies) in fetch {
            self.send_node(node, ToNode::Fetch { view: self.number, bodies });
        }
        if let Some(change) = &mut self.change {
            change.plan = Some(Plan { members, allocation, owners, fetching });
        }
        self.conclude();
    }

    /// Compares what the members own with what is on record; then the world ends.
    fn audit(&mut self) {
        let Some(change) = self.change.take() else { return };
        let mut owners: BTreeMap<BodyId, usize> = BTreeMap::new();
        for claim in change.surveys.values().flatten() {
            *owners.entry(claim.id).or_default() += 1;
        }
        let lost = self
            .record
            .movable_lives()
            .filter(|(_, life)| *life == Life::Live)
            .map(|(id, _)| id)
            .filter(|id| !owners.contains_key(id) && !self.arriving.contains(id))
            .collect();
        let doubled = owners.iter().filter(|(_, count)| **count > 1).map(|(&id, _)| id).collect();
        self.outputs.push_back(ServerOutput::Audited { lost, doubled });
        self.end();
    }

    pub(super) fn found(&mut self, node: NodeId, view: ViewNumber, bodies: Vec<BodyRecord>, last: bool) {
        let plan =
            self.change.as_mut().filter(|_| view == self.number).and_then(|change| change.plan.as_mut());
        let Some(plan) = plan.filter(|plan| plan.fetching.contains(&node)) else {
            self.stale += 1;
            return;
        };
        if last {
            plan.fetching.remove(&node);
        }
        for body in bodies {
            self.record.freshen(self.tick, body);
        }
        if last {
            self.conclude();
        }
    }

    /// Everything is known: the view begins.
    fn conclude(&mut self) {
        let is_complete =
            |change: &mut Change| change.plan.as_ref().is_some_and(|plan| plan.fetching.is_empty());
        let Some(change) = self.change.take_if(is_complete) else { return };
        let Some(Plan { members, allocation, owners, .. }) = change.plan else { return };
        let mut homeless = BTreeSet::new();
        let mut moved = BTreeMap::new();
        let mut drop: BTreeSet<BodyId> = BTreeSet::new();
        let mut resting = Vec::new();
        for (id, life) in self.record.movable_lives() {
            match (owners.get(&id), life) {
                (Some(owner), Life::Live) if allocation.get(&owner.region) == Some(&owner.node) => {}
                (Some(owner), Life::Live) => {
                    moved.insert(id, owner.region);
                }
                (None, Life::Live) | (_, Life::Waiting) => {
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
        // Without a view, what comes back waits on record, and is placed below like any newcomer.
        self.view = None;
        for (id, park, back) in resting {
            self.rest(id, park, back);
            if self.record.life(id) == Some(Life::Waiting) {
                homeless.insert(id);
            }
        }
        let leavers: Vec<_> =
            self.nodes.iter().filter(|(_, entry)| entry.leaving).map(|(&node, _)| node).collect();
        if members.is_empty() {
            self.outputs.push_back(ServerOutput::Held(self.tick));
        } else {
            let mut placed = Vec::new();
            for &id in homeless.iter().chain(moved.keys()) {
                self.record.renew(id, owners.get(&id).map(|owner| owner.epoch), self.tick);
                self.record.set_life(id, Life::Live);
            }
            placed.extend(self.record.place(&self.config.world.tree, &homeless));
            for (id, region) in moved {
                let body = self.record.body(id).expect("moved bodies are on record").clone();
                placed.push(Placed { region, body });
            }
            placed.sort_by_key(|placed| placed.body.id);
            self.adopt(members, allocation, placed, &drop, &owners, &change.surveys);
        }
        for node in leavers {
            self.dismiss(node, false, "leave granted".into());
        }
        let leader = self.leader_is();
        self.send_clients(leader);
    }

    fn adopt(
        &mut self,
        members: Vec<Member>,
        allocation: Allocation,
        placed: Vec<Placed>,
        drop: &BTreeSet<BodyId>,
        owners: &BTreeMap<BodyId, Owner>,
        surveys: &BTreeMap<NodeId, Vec<Claim>>,
    ) {
        let leader = members.iter().map(|member| member.node).min().expect("a group has a leader");
        let view = View { number: self.number, tick: self.tick, leader, members, allocation };
        let ids: BTreeSet<_> = placed.iter().map(|placed| placed.body.id).collect();
        let mut common = chunks(placed, Chunk::Placed);
        common.extend(self.record.joint_chunks(|id| ids.contains(&id)));
        for member in &view.members {
            let node = member.node;
            let Some(entry) = self.nodes.get_mut(&node) else { continue };
            let mut parts = self.record.shape_chunks(&mut entry.shapes);
            parts.extend(self.record.scenery_chunks(&mut entry.scenery));
            parts.extend(common.iter().cloned());
            for chunk in parts {
                self.send_node(node, ToNode::Chunk(chunk));
            }
            // Who claims a body that another owns at a higher epoch lets go of it.
            let beaten =
                surveys.get(&node).into_iter().flatten().filter(|claim| owners[&claim.id].node != node);
            let drop: BTreeSet<_> = drop.iter().copied().chain(beaten.map(|claim| claim.id)).collect();
            self.send_node(node, ToNode::Adopt { view: view.clone(), drop: drop.into_iter().collect() });
        }
        self.begun = true;
        self.arriving.clear();
        self.outputs.push_back(ServerOutput::Began(view.clone()));
        self.view = Some(view);
    }
}
