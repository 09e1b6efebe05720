//! Changes what a node is a member of: from one view to the next, and the tree and allocation within one.

use std::time::Duration;

use super::reports::Reports;
use super::{Exchange, Node, Phase, Witness};
use crate::cluster::{Leader, Peer, PhysicsCommand};
use crate::protocol::{CHUNK_BYTES, Repartition, ToServer, View, ViewNumber, split};
use crate::space::{BodyId, NodeId, Tick};

impl Node {
    /// Tells the server what was dispatched and may not be done, in parts that each fit into a message.
    pub(super) fn tell_settled(&mut self, view: ViewNumber) {
        let undone = self.leader.as_ref().map(Leader::undone).unwrap_or_default();
        let dispatches = split(self.dispatches.iter().cloned(), CHUNK_BYTES).into_iter();
        let undone = split(undone, CHUNK_BYTES).into_iter().map(|part| (Vec::new(), part));
        let mut parts: Vec<_> = dispatches.map(|part| (part, Vec::new())).chain(undone).collect();
        let end = parts.pop().unwrap_or_default();
        for (dispatches, undone) in parts {
            self.send_server(ToServer::Settling { view, dispatches, undone, last: false });
        }
        let (dispatches, undone) = end;
        self.send_server(ToServer::Settling { view, dispatches, undone, last: true });
    }

    /// Goes on to the last tick of the view, whose dispatches have all arrived, with the survivors alone.
    pub(super) fn finish(&mut self, survivors: &[NodeId]) {
        let Some(change) = &mut self.change else { return };
        change.finish = true;
        // These are all of the members' dispatches, this node's among them. A server that asks again is sent
        // all of them.
        self.dispatches = std::mem::take(&mut change.dispatches).into();
        let newest = self.dispatches.back().map_or(Tick(0), |newest| newest.tick);
        self.dispatched = self.dispatched.max(newest);
        self.held.retain(|held| held.tick > self.dispatched);
        self.others.retain(|node| survivors.contains(node));
        self.verifier.survive(survivors);
        if let Phase::Exchanging(Exchange { with, lost, arrived, .. }) = &mut self.phase {
            lost.extend(with.iter().filter(|node| !survivors.contains(node)));
            with.retain(|node| survivors.contains(node));
            arrived.retain(|node, _| survivors.contains(node));
        }
    }

    /// Discards whatever was computed here: the server sends the world anew.
    pub(super) fn begin_anew(&mut self) {
        if std::mem::take(&mut self.busy) {
            self.void += 1;
        }
        self.view = None;
        self.others.clear();
        self.tick = Tick(0);
        self.phase = Phase::Resting;
        self.asked = None;
        self.speculation = Default::default();
        self.dispatches.clear();
        self.holds.clear();
        self.change = None;
        self.held.clear();
        self.placed.clear();
        self.joints.clear();
        self.early.clear();
        self.done_inputs.clear();
        self.end_leading();
        self.end_relaying();
        self.done.clear();
        self.witness = Witness::default();
        self.verifier.end();
        self.link.tell_again();
    }

    /// Drops a view change of which nothing has come. The group goes on as it was.
    pub(super) fn drop_change(&mut self) {
        self.change = None;
        self.asked = None;
        let held = std::mem::take(&mut self.held);
        self.dispatched = held.last().map_or(self.dispatched, |newest| newest.tick);
        self.dispatches.extend(held);
    }

    pub(super) fn adopt(&mut self, now: Duration, view: View, drop: Vec<BodyId>) {
        let me = self.config.id;
        assert!(view.number > self.number(), "views follow one another");
        self.witness.begin(view.number);
        self.others = view.members.iter().map(|member| member.node).filter(|&node| node != me).collect();
        self.know(now, &view.members, false);
        self.tend_links(now);
        (self.since, self.reports) = (now, Reports::default());
        self.done.clear();
        self.waiting.clear();
        self.early.retain(|_, queue| {
            queue.retain(|border| border.view >= view.number);
            !queue.is_empty()
        });
        // What clients sent and was not dispatched yet is not lost with the view.
        self.end_relaying();
        let (pending, legacy) = self.end_leading().map(Leader::into_legacy).unzip();
        self.inputs.splice(..0, pending.unwrap_or_default());
        let leader =
            self.world.as_ref().filter(|_| view.leader == me).map(|world| Leader::new(now, &view, world));
        self.leader = match self.replication {
            Some(_) => leader.map(Leader::with_replication_elsewhere),
            None => leader,
        };
        if let (Some(leader), Some(legacy)) = (&mut self.leader, legacy) {
            let plays = |node| view.members.iter().any(|one| one.node == node && one.client.is_some());
            let is_kept = |node| !self.witness.begins_anew() || !plays(node);
            leader.inherit(legacy, is_kept);
        }
        self.hand_inputs_on(&drop);
        for peer in &self.links {
            if let (Peer::Client(client), Some(leader)) = (peer, &mut self.leader) {
                leader.admit(*client);
            }
        }
        (self.tick, self.drained, self.told) = (view.tick, view.tick, view.tick);
        self.division = 0;
        self.dispatches.clear();
        self.dispatched = view.tick;
        self.holds.clear();
        self.change = None;
        self.held.clear();
        self.phase = Phase::Computing(view.tick, 0);
        let regions =
            view.allocation.iter().filter(|&(_, &node)| node == me).map(|(&region, _)| region).collect();
        let mut placed = std::mem::take(&mut self.placed);
        placed.sort_by_key(|placed| placed.body.id);
        self.begin_epochs(view.number, &placed);
        let joints = std::mem::take(&mut self.joints);
        let (tick, tree) = (view.tick, view.tree.clone());
        if self.witness.begins_anew() && self.config.client.is_some() {
            self.order(PhysicsCommand::Anew);
        }
        let verified = self.witness.verified().map(|_| (placed.clone(), joints.clone()));
        self.ask(PhysicsCommand::Rebuild { tick, tree, regions, placed, joints, drop });
        self.view = Some(view);
        let (placed, joints) = verified.unwrap_or_default();
        self.verify_view(&placed, &joints);
        self.grant_early_inputs();
        self.tell_own_client();
    }

    /// Changes tree and allocation, as all members do before this tick.
    pub(super) fn repartition(&mut self, tick: Tick, change: &Repartition) {
        let (me, view) = (self.config.id, self.view.as_mut().expect("only members compute"));
        let is_member = view.members.iter().any(|member| member.node == change.newborn);
        if !is_member || view.repartition(change).is_err() {
            self.counters.refused += 1;
            return;
        }
        // A repartition without changes only wakes what sleeps in regions that are being given up.
        let is_leader = view.leader == me;
        if !change.changes.is_empty() {
            self.division += 1;
            if is_leader {
                self.tell_division(tick);
            }
        }
        self.verifier.repartition(&change.changes, change.newborn);
        let (changes, newborn_here) = (change.changes.clone(), change.newborn == me);
        self.order(PhysicsCommand::Repartition { changes, newborn_here });
    }

    /// Tells the server how the world is cut before this tick, and who computes which region.
    pub(super) fn tell_division(&mut self, tick: Tick) {
        let Some(view) = &self.view else { return };
        let (view, tree, allocation) = (view.number, view.tree.clone(), view.allocation.clone());
        let division = self.division;
        self.send_server(ToServer::Repartitioned { view, tick, tree, allocation, division });
    }
}
