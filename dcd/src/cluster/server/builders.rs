//! Obeys clients that may build, as the server's program but within bounds: what one of them brings must cost others little. What they
//! build is the world's, and stays when they leave.

use std::collections::{BTreeMap, BTreeSet};

use super::budget::{MAX_EXTRA_ITERATIONS, MAX_OVERLAPS, MAX_REACH_M, Size};
use super::{CanBuild, Server};
use crate::cluster::{Peer, Record};
use crate::protocol::{
    Alteration, BodyKind, BodyRecord, BodyTraits, BuildOp, ColliderRecord, Costs, Farewell, Input,
    JointRecord, Refusal, ShapeHash, ShapeRecord, ToClient, Velocity,
};
use crate::space::{BodyId, ClientId, Tick};

/// The most bodies, and the most joints, of the world that one client has built.
pub const MAX_BUILT: usize = 4_096;
/// The most bytes of shapes that nobody knew before and that one client brings to build with, over all of its visits while a server
/// runs: shapes are never forgotten.
pub const MAX_BUILT_SHAPE_BYTES: usize = 16 << 20;
/// The most corners of all movable bodies that one client has built.
const MAX_BUILT_CORNERS: usize = 200_000;

/// The changes that a client may ask for at once: all that it may have built comes, and goes.
const CHANGES: f64 = 2.0 * MAX_BUILT as f64;
/// How many more each second: of a body each in every tick, for some.
const CHANGES_PER_S: f64 = 1_024.0;
/// What looking through all that a client has built counts, in changes, before more comes.
const LOOK: f64 = 16.0;
/// What an alteration counts: it is written down, and all clients are told.
const ALTERATION: f64 = 4.0;

/// How many messages that no honest program sends may come at once; who sends more is cut off.
const MISUSES: f64 = 64.0;
/// How many are forgiven each second.
const MISUSES_PER_S: f64 = 4.0;

impl Server {
    /// Returns the indices of the next body and the next joint that a client may build.
    pub(super) fn next_built(&self, client: ClientId) -> (u32, u32) {
        let record = self.record();
        let body = record.built(client).last().map_or(0, |body| body.id.index().saturating_add(1));
        let joint = record.built_joints(client).last().map_or(0, |id| (id.0 as u32).saturating_add(1));
        let known = self.common.allowances.get(&client).map_or((0, 0), |allowance| allowance.building.next);
        (body.max(known.0), joint.max(known.1))
    }

    /// Does what a client wants to build, as far as it may, and says so.
    pub(super) fn hear_builder(&mut self, from: Peer, client: ClientId, number: u64, ops: Vec<BuildOp>) {
        // Nobody else speaks for it, not even its leader.
        if from != Peer::Client(client) || !self.common.clients.contains_key(&client) {
            self.common.stale += 1;
            return;
        }
        if !self.common.allowances.get(&client).is_some_and(|allowance| allowance.building.may) {
            self.refuse_to_build(client, &[], Refusal::MayNotBuild);
            self.misused(client, Refusal::MayNotBuild);
            return;
        }
        let mut misuse = None;
        for op in ops {
            let bodies = op.bodies();
            let now = self.common.now;
            let account = &mut self.common.allowances.entry(client).or_default().building.changes;
            let built = match account.ask(now, cost(&op), CHANGES, CHANGES_PER_S) {
                true => self.build(client, op),
                false => Err((Refusal::TooMany, true)),
            };
            if let Err((reason, is_misuse)) = built {
                self.refuse_to_build(client, &bodies, reason);
                misuse = misuse.or(is_misuse.then_some(reason));
            }
        }
        match misuse {
            Some(reason) if self.misused(client, reason) => {}
            _ => self.common.send_client(client, ToClient::Built(number)),
        }
    }

    fn refuse_to_build(&mut self, client: ClientId, bodies: &[BodyId], reason: Refusal) {
        if bodies.is_empty() {
            self.common.send_client(client, ToClient::Rejected { body: None, reason });
        }
        for &id in bodies {
            self.common.send_client(client, ToClient::Rejected { body: Some(id), reason });
        }
    }

    /// Counts a message that no honest program sends. Returns whether the client was cut off for it.
    fn misused(&mut self, client: ClientId, reason: Refusal) -> bool {
        let now = self.common.now;
        let account = &mut self.common.allowances.entry(client).or_default().building.misuses;
        if account.ask(now, 1.0, MISUSES, MISUSES_PER_S) {
            return false;
        }
        let reason = format!("it went on to ask for what was refused each time: {reason}");
        self.common.close(Peer::Client(client), Farewell::Refused, reason);
        self.part(client);
        true
    }

    /// Does one thing, or returns why not, and whether no honest program asks for it.
    fn build(&mut self, client: ClientId, op: BuildOp) -> Result<(), (Refusal, bool)> {
        let record = &self.groups[&self.main].record;
        let op = match op {
            BuildOp::Insert { bodies, shapes, joints } => {
                if is_done(record, &bodies, &joints) {
                    return Ok(());
                }
                let building = &mut self.common.allowances.entry(client).or_default().building;
                let brought = building.shape_bytes.saturating_add(record.bytes_of_new(&shapes));
                let new = New { client, record, bodies: &bodies, shapes: &shapes, joints: &joints };
                let config = &self.common.config;
                new.check(config.world.step.speed_limit_m_s, config.can_build).map_err(as_refused)?;
                if brought > MAX_BUILT_SHAPE_BYTES {
                    return Err((Refusal::TooMany, false));
                }
                building.shape_bytes = brought;
                for body in &bodies {
                    building.next.0 = building.next.0.max(body.id.index().saturating_add(1));
                }
                for joint in &joints {
                    building.next.1 = building.next.1.max((joint.id.0 as u32).saturating_add(1));
                }
                BuildOp::Insert { bodies, shapes, joints }
            }
            // When it was asked is of no account: it is told as the program's.
            BuildOp::Move(input) => BuildOp::Move(Input { logical_time: 0, tick: Tick(0), ..input }),
            op => op,
        };
        check_change(record, &op, self.common.config.world.step.speed_limit_m_s).map_err(as_refused)?;
        self.obey(op);
        Ok(())
    }
}

fn as_refused(reason: Refusal) -> (Refusal, bool) {
    (reason, reason == Refusal::NotToBeBuilt)
}

fn cost(op: &BuildOp) -> f64 {
    match op {
        BuildOp::Insert { bodies, joints, .. } => LOOK + (bodies.len() + joints.len()) as f64,
        BuildOp::Alter(_) => ALTERATION,
        BuildOp::Remove(_) | BuildOp::RemoveJoint(_) | BuildOp::Move(_) | BuildOp::Push(_) => 1.0,
    }
}

/// Returns whether all of this is on record: a client that did not hear so has asked again.
fn is_done(record: &Record, bodies: &[BodyRecord], joints: &[JointRecord]) -> bool {
    let is_there = |body: &BodyRecord| record.body(body.id).is_some_and(|known| known.traits == body.traits);
    bodies.iter().all(is_there) && joints.iter().all(|joint| record.joint(joint.id).is_some())
}

fn honest(holds: bool) -> Result<(), Refusal> {
    if holds { Ok(()) } else { Err(Refusal::NotToBeBuilt) }
}

fn is_slow(kind: BodyKind, velocity: &Velocity, limit_m_s: f32) -> bool {
    kind != BodyKind::Dynamic || velocity.is_within(limit_m_s * 1.000_01)
}

/// Checks a change of what is there.
fn check_change(record: &Record, op: &BuildOp, speed_limit_m_s: f32) -> Result<(), Refusal> {
    let found = |id: BodyId| {
        honest(id.client().is_none())?;
        record.body(id).ok_or(Refusal::Unknown)
    };
    let movable = |id: BodyId| {
        let body = found(id)?;
        honest(body.traits.kind != BodyKind::Fixed)?;
        Ok(body)
    };
    match op {
        BuildOp::Insert { .. } => Ok(()),
        BuildOp::Remove(id) => found(*id).map(drop),
        BuildOp::RemoveJoint(id) => record.joint(*id).map(drop).ok_or(Refusal::Unknown),
        BuildOp::Move(input) => {
            let body = movable(input.body)?;
            honest(is_slow(body.traits.kind, &input.velocity, speed_limit_m_s))?;
            honest(input.drive.is_none() || body.traits.vehicle.is_some())
        }
        BuildOp::Push(push) => honest(found(push.body)?.traits.kind == BodyKind::Dynamic),
        BuildOp::Alter(Alteration::Body { body, traits, .. }) => {
            let known = &movable(*body)?.traits;
            let place = |collider: &ColliderRecord| (collider.shape, collider.pose);
            let same = known.colliders.iter().map(place).eq(traits.colliders.iter().map(place));
            honest(same && traits.kind != BodyKind::Fixed)?;
            honest(known.character == traits.character && known.vehicle == traits.vehicle)?;
            check_iterations(traits)
        }
        BuildOp::Alter(Alteration::Joint(joint)) => {
            let known = record.joint(joint.id).ok_or(Refusal::Unknown)?;
            honest(known.a == joint.a && known.b == joint.b && known.link == joint.link)
        }
    }
}

fn check_iterations(traits: &BodyTraits) -> Result<(), Refusal> {
    match traits.extra_solver_iterations.max(traits.extra_pgs_iterations) <= MAX_EXTRA_ITERATIONS {
        true => Ok(()),
        false => Err(Refusal::Costly(Costs::Iterations)),
    }
}

/// What a client wants to come.
struct New<'a> {
    client: ClientId,
    record: &'a Record,
    bodies: &'a [BodyRecord],
    shapes: &'a [ShapeRecord],
    joints: &'a [JointRecord],
}

impl New<'_> {
    fn check(&self, speed_limit_m_s: f32, can_build: CanBuild) -> Result<(), Refusal> {
        let ids: BTreeMap<_, _> = self.bodies.iter().map(|body| (body.id, body.traits.kind)).collect();
        honest(ids.len() == self.bodies.len())?;
        honest(ids.keys().all(|id| id.builder() == Some(self.client)))?;
        if ids.keys().any(|id| self.record.body(*id).is_some()) {
            return Err(Refusal::Exists);
        }
        self.check_joints(&ids)?;
        for body in self.bodies {
            // What walks and drives is an avatar, and bounded as such.
            honest(body.traits.character.is_none() && body.traits.vehicle.is_none())?;
            honest(is_slow(body.traits.kind, &body.state.velocity, speed_limit_m_s))?;
            check_iterations(&body.traits)?;
        }
        if !self.shapes_fit() || !can_build(self.record.shapes_by_hash(), self.shapes) {
            return Err(Refusal::Shape);
        }
        self.check_costs()
    }

    fn check_joints(&self, new: &BTreeMap<BodyId, BodyKind>) -> Result<(), Refusal> {
        let ids: BTreeSet<_> = self.joints.iter().map(|joint| joint.id).collect();
        honest(ids.len() == self.joints.len())?;
        honest(ids.iter().all(|id| id.builder() == Some(self.client)))?;
        if ids.iter().any(|id| self.record.joint(*id).is_some()) {
            return Err(Refusal::Exists);
        }
        let kind = |id: BodyId| match (new.get(&id), self.record.body(id)) {
            (Some(kind), _) => Some((*kind, true)),
            (None, known) => known.map(|body| (body.traits.kind, false)),
        };
        for joint in self.joints {
            let (a, b) = (kind(joint.a).ok_or(Refusal::Unknown)?, kind(joint.b).ok_or(Refusal::Unknown)?);
            let is_movable = |(kind, _): (BodyKind, bool)| kind != BodyKind::Fixed;
            honest([a, b].into_iter().any(is_movable) && joint.link.is_none())?;
            honest([a, b].into_iter().all(|(kind, is_new)| kind == BodyKind::Fixed || is_new))?;
        }
        Ok(())
    }

    /// Returns whether all shapes are there, and whether what moves has none but those that clients may move.
    fn shapes_fit(&self) -> bool {
        let with: BTreeMap<_, _> = self.shapes.iter().map(|shape| (shape.hash(), shape)).collect();
        let find = |hash: ShapeHash| with.get(&hash).copied().or_else(|| self.record.shape(hash));
        let is_whole = |collider: &ColliderRecord| {
            find(collider.shape).is_some_and(|shape| shape.parts().all(|part| find(part).is_some()))
        };
        self.bodies.iter().all(|body| match body.traits.kind {
            BodyKind::Fixed => body.traits.colliders.iter().all(is_whole),
            _ => body.suits_clients(find),
        })
    }

    /// Checks how many there are by then, and what those that move cost.
    fn check_costs(&self) -> Result<(), Refusal> {
        let joints = self.record.built_joints(self.client).count() + self.joints.len();
        let bodies = self.record.built(self.client).count() + self.bodies.len();
        if bodies > MAX_BUILT || joints > MAX_BUILT {
            return Err(Refusal::TooMany);
        }
        let is_movable = |body: &&BodyRecord| body.traits.kind != BodyKind::Fixed;
        let place = |body: &BodyRecord| {
            (body.state.pose.translation, Size::of(body, |hash| self.record.shape_or(hash, self.shapes)))
        };
        let all = self.record.built(self.client).chain(self.bodies).filter(is_movable);
        let all: Vec<_> = all.map(place).collect();
        let new = &all[all.len() - self.bodies.iter().filter(is_movable).count()..];
        if new.iter().any(|(_, size)| size.reach_m > MAX_REACH_M) {
            return Err(Refusal::Costly(Costs::Size));
        }
        if all.iter().map(|(_, size)| size.corners).sum::<usize>() > MAX_BUILT_CORNERS {
            return Err(Refusal::Costly(Costs::BuiltCorners));
        }
        let overlap = |(a, of_a): &([f64; 3], Size), (b, of_b): &([f64; 3], Size)| {
            let apart_m2: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
            apart_m2 < f64::from(of_a.reach_m + of_b.reach_m).powi(2)
        };
        // Each overlaps itself.
        let is_crowded = |new| all.iter().filter(|other| overlap(new, other)).count() > MAX_OVERLAPS + 1;
        if new.iter().any(is_crowded) { Err(Refusal::Costly(Costs::Overlaps)) } else { Ok(()) }
    }
}
