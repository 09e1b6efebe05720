//! Gives access to what a client knows of its world, and to what it was told since the last call.

use std::collections::BTreeMap;
use std::ops::Bound;

use super::{BodyView, Client};
use crate::delta::Tally;
use crate::protocol::{
    ContactForce, EnvironmentProperties, Handover, JointRecord, Member, QueryResult, ShapeHash, ShapeRecord,
    Touch,
};
use crate::space::{BodyId, ClientId, DistributionTree, GroupId, JointId, NodeId, RegionId, Tick};

impl Client {
    /// Returns what states have cost so far.
    pub fn tally(&self) -> &Tally {
        self.receiver.tally()
    }

    /// Returns the bodies whose states took most bytes, with these bytes, the costliest first.
    pub fn costliest(&self, count: usize) -> Vec<(BodyId, f64)> {
        self.receiver.costliest(count)
    }

    /// Returns the client's id.
    pub fn id(&self) -> ClientId {
        self.id
    }

    /// Returns the properties of the world, once the server has sent them.
    pub fn world(&self) -> Option<&EnvironmentProperties> {
        self.world.as_ref()
    }

    /// Returns whether the whole world has arrived.
    pub fn is_joined(&self) -> bool {
        self.joined
    }

    /// Returns how often another world has arrived in place of the one before.
    pub fn replacements(&self) -> u64 {
        self.replacements
    }

    /// Returns the leader that this process should hear from and has no link to; none if the leader reaches
    /// it through its own node.
    pub fn unheard_leader(&self) -> Option<&Member> {
        self.leader.as_ref().filter(|_| self.node.is_none() && !self.linked)
    }

    /// Returns the leader, as far as known.
    pub fn leader(&self) -> Option<NodeId> {
        self.leader.as_ref().map(|member| member.node)
    }

    /// Returns how the world is cut into regions, as far as known.
    pub fn tree(&self) -> Option<&DistributionTree> {
        self.tree.as_ref().or(self.world.as_ref().map(|world| &world.tree))
    }

    /// Returns the node that computes a region, as far as known.
    pub fn computed_by(&self, region: RegionId) -> Option<NodeId> {
        self.allocation.get(&region).copied()
    }

    /// Returns the client's group, as far as known. Epochs and ticks of different groups do not compare.
    pub fn group(&self) -> Option<GroupId> {
        self.group
    }

    /// Returns the newest tick heard of, speculative ones included. In a world at rest it advances every five
    /// seconds or so.
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Returns a body as last heard of.
    pub fn body(&self, id: BodyId) -> Option<&BodyView> {
        self.bodies.get(&id)
    }

    /// Returns all bodies in id order.
    pub fn bodies(&self) -> impl Iterator<Item = &BodyView> {
        self.bodies.values()
    }

    /// Returns the bodies whose ids follow this one, or all, in id order.
    pub fn bodies_after(&self, id: Option<BodyId>) -> impl Iterator<Item = &BodyView> {
        let from = id.map_or(Bound::Unbounded, Bound::Excluded);
        self.bodies.range((from, Bound::Unbounded)).map(|(_, view)| view)
    }

    /// Returns the client's avatars in the world, in id order.
    pub fn own_avatars(&self) -> impl Iterator<Item = &BodyView> {
        let own = BodyId::avatar(self.id, 0)..=BodyId::avatar(self.id, u32::MAX);
        self.bodies.range(own).map(|(_, view)| view)
    }

    /// Returns all shapes by hash.
    pub fn shapes(&self) -> &BTreeMap<ShapeHash, ShapeRecord> {
        &self.shapes
    }

    /// Returns a joint of bodies that the client was told of.
    pub fn joint(&self, id: JointId) -> Option<&JointRecord> {
        self.joints.get(&id)
    }

    /// Returns the joints of the bodies that the client was told of, in id order.
    pub fn joints(&self) -> impl Iterator<Item = &JointRecord> {
        self.joints.values()
    }

    /// Returns the joints of a body that the client was told of, in id order.
    pub fn joints_of(&self, body: BodyId) -> impl Iterator<Item = &JointRecord> {
        self.joints.of(body)
    }

    /// Returns the beginnings and ends of contacts of own avatars since the last call.
    pub fn take_touches(&mut self) -> impl Iterator<Item = (Tick, Touch)> {
        std::mem::take(&mut self.touches).into_iter()
    }

    /// Returns the forces on own avatars above their thresholds since the last call.
    pub fn take_forces(&mut self) -> impl Iterator<Item = (Tick, ContactForce)> {
        std::mem::take(&mut self.forces).into_iter()
    }

    /// Returns the changes of owner that were heard of since the last call, in the order in which they were
    /// heard of. Owners in between that were not heard of are left out.
    pub fn take_handovers(&mut self) -> impl Iterator<Item = Handover> {
        std::mem::take(&mut self.handovers).into_iter()
    }

    /// Takes the answer to a query, if it has come.
    pub fn take_answer(&mut self, number: u64) -> Option<QueryResult> {
        self.answers.remove(&number)
    }
}
