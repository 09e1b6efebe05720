//! Obeys the program of the server, and clients that may build: they insert, move and remove bodies and
//! joints while nodes compute the world. What comes and goes is on record before anybody hears of it, so it
//! outlives every node, and the server. So do velocities of kinematic bodies. A jump, a push or another
//! velocity is lost with a leader that dies before it has passed it on.

use std::collections::BTreeMap;

use super::Server;
use super::common::Common;
use super::group::Group;
use crate::cluster::{Key, Life};
use crate::protocol::assembly::{assemblies, gathered, take_shapes_of};
use crate::protocol::{
    Alteration, BodyKind, BodyRecord, BodyState, BuildOp, Input, JointRecord, ShapeRecord, ToClient, ToNode,
    View, WorldOp, split,
};
use crate::space::{BodyId, Epoch, Viewpoint};

/// The most bytes of bodies that one message tells nodes to insert.
const INSERT_BYTES: usize = 1 << 20;
/// The most bytes of bodies that are tied to one another, and are therefore inserted by one operation. A tick
/// must have room for it.
const WHOLE_BYTES: usize = 4 << 20;

impl Server {
    /// Returns the ids of the next body and the next joint that the program makes. Neither was ever given.
    pub fn next_ids(&self) -> (u32, u64) {
        self.common.next_ids
    }

    /// Forgets the size of a body that a client built, as the body is altered.
    fn forget_size(&mut self, id: BodyId) {
        let builder = id.builder().and_then(|client| self.common.allowances.get_mut(&client));
        builder.and_then(|allowance| allowance.building.sizes.remove(&id));
    }

    /// Returns the places from which the program looks at the world.
    pub fn viewpoints(&self) -> &[Viewpoint] {
        &self.common.viewpoints
    }

    /// Makes leaders compute in full what the program sees from these places. The places are written down
    /// with the tick, now and then, as viewers move all the time.
    pub(super) fn look(&mut self, viewpoints: Vec<Viewpoint>) {
        if self.common.viewpoints == viewpoints {
            return;
        }
        self.common.viewpoints.clone_from(&viewpoints);
        for group in self.groups.values() {
            // A view to come has the viewpoints itself.
            if let (Some(view), None) = (&group.view, &group.change) {
                let message = ToNode::Look { view: view.number, viewpoints: viewpoints.clone() };
                self.common.send_node(view.leader, message);
            }
        }
    }

    pub(super) fn obey(&mut self, op: BuildOp) {
        match op {
            BuildOp::Insert { bodies, mut shapes, joints } => {
                self.common.fading.bring_back(&bodies, &mut shapes, usize::MAX);
                let (next_body, next_joint) = &mut self.common.next_ids;
                // What clients build has numbers of its own.
                for body in bodies.iter().filter(|body| body.id.builder().is_none()) {
                    *next_body = (*next_body).max(body.id.index().saturating_add(1));
                }
                for joint in joints.iter().filter(|joint| joint.id.builder().is_none()) {
                    *next_joint = (*next_joint).max(joint.id.0.saturating_add(1));
                }
                self.common.world_changed = true;
                for group in self.groups.values_mut() {
                    group.insert_all(&mut self.common, &bodies, &shapes, &joints);
                }
            }
            BuildOp::Remove(id) => {
                for group in self.groups.values_mut() {
                    group.remove(&mut self.common, id);
                }
            }
            BuildOp::RemoveJoint(id) => {
                for group in self.groups.values_mut() {
                    if group.record.remove_joint(id) {
                        self.common.send_clients(group.id, &ToClient::JointRemoved(id));
                        group.retold.forget(Key::AlteredJoint(id));
                        group.is_gone(&self.common, Key::GoneJoint(id));
                        group.apply_soon(&mut self.common, WorldOp::RemoveJoint(id));
                    }
                }
            }
            BuildOp::Push(push) => {
                for group in self.groups.values_mut() {
                    group.apply_soon(&mut self.common, WorldOp::Push(push));
                }
            }
            BuildOp::Alter(alteration) => {
                if let Alteration::Body { body, .. } = &alteration {
                    self.forget_size(*body);
                }
                for group in self.groups.values_mut() {
                    group.alter(&mut self.common, &alteration);
                }
            }
            BuildOp::Move(input) => {
                for group in self.groups.values_mut() {
                    group.steer(&mut self.common, input);
                }
            }
        }
    }
}

impl Group {
    fn insert_all(
        &mut self,
        common: &mut Common,
        bodies: &[BodyRecord],
        shapes: &[ShapeRecord],
        joints: &[JointRecord],
    ) {
        let new_shapes = self.record.learn(shapes.to_vec());
        common.fading.have_come(&new_shapes);
        for body in bodies {
            // Nobody has found contacts of a new body, whatever is claimed.
            let state = BodyState { contact_offset: None, ..body.state };
            self.record.insert(BodyRecord { epoch: Epoch(0), state, ..body.clone() });
            // Nobody owns a fixed body: all nodes hold it.
            if body.traits.kind == BodyKind::Fixed {
                self.record.set_life(body.id, Life::Live);
            }
        }
        joints.iter().for_each(|joint| self.record.tie(joint.clone()));
        let mut untold: BTreeMap<_, _> =
            new_shapes.iter().map(|shape| (shape.hash(), shape.clone())).collect();
        let mut of_later: BTreeMap<BodyId, Vec<JointRecord>> = BTreeMap::new();
        for joint in joints {
            of_later.entry(joint.a.max(joint.b)).or_default().push(joint.clone());
        }
        for body in bodies {
            // Each shape goes with the first body that has it, each joint with the later of its bodies.
            let shapes = take_shapes_of(body, &mut untold);
            let joints = of_later.remove(&body.id).unwrap_or_default();
            let inserted = ToClient::Inserted { body: body.clone(), shapes, joints };
            common.announce(self.id, &self.record, body.id, &inserted);
        }
        if self.view.is_none() || self.change.is_some() || self.held {
            return;
        }
        for shapes in split(new_shapes, INSERT_BYTES) {
            self.apply(common, vec![WorldOp::Insert { bodies: Vec::new(), shapes, joints: Vec::new() }]);
        }
        for part in gathered(assemblies(bodies, &[], joints), INSERT_BYTES) {
            // A larger assembly waits on record, and comes in chunks as a view begins.
            if !part.fits(WHOLE_BYTES) {
                self.unsure = true;
                continue;
            }
            let (bodies, joints) = (part.bodies, part.joints);
            for body in bodies.iter().filter(|body| body.traits.kind != BodyKind::Fixed) {
                self.record.set_life(body.id, Life::Live);
                self.arriving.insert(body.id);
            }
            self.apply(common, vec![WorldOp::Insert { bodies, shapes: Vec::new(), joints }]);
        }
    }

    fn remove(&mut self, common: &mut Common, id: BodyId) {
        let Some(body) = self.record.body(id) else { return };
        if body.traits.kind != BodyKind::Fixed {
            return self.retire(common, id, false);
        }
        self.forget_body(common, id);
        // Nodes that load the world, or compute it, may hold the body.
        for entry in common.nodes.values_mut() {
            entry.scenery.remove(&id);
            entry.stale_scenery.insert(id);
        }
        self.is_gone(common, Key::GoneScenery(id));
        self.apply_soon(common, WorldOp::Remove(id));
        common.announce_end(self.id, id);
    }

    /// Notes that something is gone that nodes may hold, if any node computes the world.
    fn is_gone(&mut self, common: &Common, key: Key) {
        if self.view.is_some() {
            self.retold.add(key, common.now);
        }
    }

    fn alter(&mut self, common: &mut Common, alteration: &Alteration) {
        if !self.record.alter(alteration) {
            return;
        }
        match alteration {
            Alteration::Body { body, wakes, .. } => {
                self.retold.keep(Key::AlteredBody(*body));
                self.steered.is_altered(&self.record, *body);
                if *wakes {
                    self.retold.add(Key::WokenBody(*body), common.now);
                }
            }
            Alteration::Joint(joint) => {
                self.retold.keep(Key::AlteredJoint(joint.id));
            }
        }
        common.send_clients(self.id, &ToClient::Altered(alteration.clone()));
        self.apply_soon(common, WorldOp::Alter(alteration.clone()));
    }

    fn steer(&mut self, common: &mut Common, input: Input) {
        self.steered.note(&mut self.record, &input);
        if self.view.is_none() {
            // Nobody computes the world, so only the record can be moved.
            if let Some(body) = self.record.body_mut(input.body) {
                body.obey(&input);
                if let Some(pose) = input.pose {
                    // How the body lay at its contacts is known only for where it was.
                    (body.state.pose, body.state.contact_offset) = (pose, None);
                }
                body.state.sleeping = false;
            }
            return;
        }
        self.apply_soon(common, WorldOp::Input(input));
    }

    /// Tells an operation to the leader. It is kept for the next leader while membership changes, while the
    /// leader is out of reach, or if its body comes with the next view.
    fn apply_soon(&mut self, common: &mut Common, op: WorldOp) {
        let hears = |view: &View| common.nodes.get(&view.leader).is_some_and(|leader| leader.linked);
        let comes_later = op.moves().is_some_and(|id| self.record.life(id) == Some(Life::Waiting));
        match &self.view {
            Some(view) if self.change.is_none() && !self.held && hears(view) && !comes_later => {
                self.apply(common, vec![op]);
            }
            _ => self.postponed.add(op),
        }
    }

    /// Tells a leader that is back, and has `heard` so many operations, those again that were sent into its
    /// link when the link was dead and nobody knew. Members do not report how a body was to move.
    pub(super) fn say_again(&self, common: &mut Common, heard: u64) {
        let Some(view) = &self.view else { return };
        let Some(leader) = common.nodes.get_mut(&view.leader) else { return };
        let lost = leader.moves.are_heard(view.number, heard, |id| self.record.body(id).is_some());
        for ops in split(lost, INSERT_BYTES) {
            self.tell_leader(common, ops);
        }
    }

    /// Moves bodies on record as they were to move when the last node left: by what its leader had not passed
    /// on, and by what came after that.
    pub(super) fn steer_record(&mut self, common: &mut Common, undone: Vec<WorldOp>) {
        let later = std::mem::take(&mut self.postponed).ops(|_| true);
        undone.into_iter().chain(later).for_each(|op| self.postponed.add(op));
        for input in self.postponed.take_inputs() {
            self.steer(common, input);
        }
    }

    /// Tells the leader of a view that has begun what the last leader had not passed on, and what was to be
    /// done meanwhile. It is also told again what was taken away and altered: a leader that has died tells
    /// nothing of that.
    pub(super) fn catch_up(&mut self, common: &mut Common, undone: Vec<WorldOp>) {
        let retold = self.retelling();
        let is_there = |id| self.record.body(id).is_some();
        let undone: Vec<_> = undone.into_iter().filter(|op| op.moves().is_some_and(is_there)).collect();
        let postponed = std::mem::take(&mut self.postponed).ops(is_there);
        self.retold.is_told(common.now);
        for ops in split(retold.into_iter().chain(undone).chain(postponed), INSERT_BYTES) {
            self.apply(common, ops);
        }
    }

    /// Returns the operations for all that the program has taken away and altered, as it is on record.
    fn retelling(&mut self) -> Vec<WorldOp> {
        let record = &self.record;
        self.retold.retain(|key| match key {
            Key::AlteredBody(id) | Key::WokenBody(id) => record.body(id).is_some(),
            Key::AlteredJoint(id) => record.joint(id).is_some(),
            _ => true,
        });
        let op = |key| match key {
            Key::GoneJoint(id) => Some(WorldOp::RemoveJoint(id)),
            Key::AlteredBody(body) => {
                let wakes = self.retold.contains(Key::WokenBody(body));
                let known = record.body(body)?;
                let (traits, user_data) = (known.traits.clone(), known.user_data);
                Some(WorldOp::Alter(Alteration::Body { body, traits, user_data, wakes }))
            }
            Key::AlteredJoint(id) => {
                Some(WorldOp::Alter(Alteration::Joint(Box::new(record.joint(id)?.clone()))))
            }
            // Scenery is compared when a view begins.
            _ => None,
        };
        self.retold.keys().into_iter().filter_map(op).collect()
    }
}
