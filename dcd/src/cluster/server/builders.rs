//! Obeys clients that may build, like the server's program but within bounds: what one client brings must
//! cost others little. What clients build belongs to the world, and stays when they leave.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use super::Server;
use super::budget::{MAX_EXTRA_ITERATIONS, MAX_OVERLAPS, MAX_REACH_M, Size, bounds_of, margin_m};
use super::group::Group;
use crate::cluster::{Key, Life, Peer, Record};
use crate::protocol::{
    Alteration, BUILD_BYTES, BodyKind, BodyRecord, BodyTraits, BuildOp, ColliderRecord, Costs, Farewell,
    Input, JointRecord, Refusal, ShapeHash, ShapeRecord, ToClient, Velocity, encoded_len,
};
use crate::space::{BodyId, Bounds, ClientId, Tick};

/// The most bodies, and the most joints, in the world that one client has built.
pub const MAX_BUILT: usize = 4_096;
/// The most bytes of shapes new to the world that one client brings to build with. It counts over all visits
/// of the client while a server runs, until shapes are forgotten: all clients are told of the shapes.
pub const MAX_BUILT_SHAPE_BYTES: usize = 16 << 20;
/// The most corners of all bodies that one client has built.
const MAX_BUILT_CORNERS: usize = 200_000;
/// The most colliders of these bodies, where a compound counts as its parts. They also bound the bytes of the
/// bodies' records, to some 3 MB.
const MAX_BUILT_COLLIDERS: usize = 16_384;
/// The most colliders, in total, of the bodies that a new body may overlap. Each of its own is compared with
/// each of them.
const MAX_OVERLAPPED_COLLIDERS: usize = 1_024;
/// How far a body may look around its colliders, metres.
const MAX_MARGIN_M: f32 = 10.0;
/// The bit of Rapier's `ActiveCollisionTypes::FIXED_FIXED`.
const FIXED_FIXED: u16 = 1 << 5;

/// The changes that a client may ask for at once: enough for all that it may have built to come, with a
/// collider each, and to go.
const CHANGES: f64 = 6.0 * MAX_BUILT as f64;
/// How many more changes a client may ask for per second.
const CHANGES_PER_S: f64 = 1_024.0;
/// The cost of an alteration, in changes: it is written down.
const ALTERATION: f64 = 4.0;
/// The bytes told to all clients that cost one change.
const TOLD_BYTES: f64 = 256.0;
/// The bodies looked through, before more comes, that cost one change.
const LOOKED_THROUGH: f64 = 256.0;

/// How many misuses (messages that no honest program sends) a client may send at once. A client that sends
/// more is cut off.
const MISUSES: f64 = 64.0;
/// How many misuses are forgiven per second.
const MISUSES_PER_S: f64 = 4.0;
/// A message is a misuse too if more of its changes than this, and most of them, come too soon. An honest
/// program may be somewhat too fast.
const FLOOD: usize = 64;

/// The outcome of the operations of one message: how many bodies and other things were asked for, how many of them
/// too soon, and why one is a misuse, if any is.
#[derive(Default)]
struct Told {
    asked: usize,
    too_soon: usize,
    misuse: Option<Refusal>,
}

impl Server {
    /// Returns the indices of the next body and the next joint that a client may build.
    pub(super) fn next_built(&self, client: ClientId) -> (u32, u32) {
        let record = self.record();
        let body = record.built(client).last().map_or(0, |body| body.id.index().saturating_add(1));
        let joint = record.built_joints(client).last().map_or(0, |id| (id.0 as u32).saturating_add(1));
        let known = self.common.allowances.get(&client).map_or((0, 0), |allowance| allowance.building.next);
        (body.max(known.0), joint.max(known.1))
    }

    /// Builds what a client asks for, as far as it may, and tells the client so.
    pub(super) fn hear_builder(&mut self, from: Peer, client: ClientId, number: u64, ops: Vec<BuildOp>) {
        // Nobody else speaks for a builder, not even its leader.
        if from != Peer::Client(client) || !self.common.clients.contains_key(&client) {
            self.common.stale += 1;
            return;
        }
        if !self.common.allowances.get(&client).is_some_and(|allowance| allowance.building.may) {
            self.refuse_to_build(client, &[], Refusal::MayNotBuild);
            self.misused(client, Refusal::MayNotBuild);
            return;
        }
        let mut told = Told::default();
        for op in ops {
            told.asked += op.bodies().len().max(1);
            let several =
                matches!(&op, BuildOp::Insert { bodies, .. } if bodies.len() > 1).then(|| op.clone());
            let bodies = op.bodies();
            let cost = cost(&op, self.built_count(client));
            let Err((reason, is_misuse)) = self.build_if_due(client, op, cost, &mut told) else { continue };
            // One body that may not come keeps no other away, but for those that joints tie to it.
            let parts = several.filter(|_| !is_misuse && reason != Refusal::TooMany).map(|op| op.in_parts(0));
            let Some(parts) = parts.filter(|parts| parts.len() > 1) else {
                self.refuse_to_build(client, &bodies, reason);
                told.misuse = told.misuse.or(is_misuse.then_some(reason));
                continue;
            };
            for part in parts {
                let bodies = part.bodies();
                // What it makes others compute and hear was counted with the whole.
                let cost = 1.0 + self.built_count(client) as f64 / LOOKED_THROUGH;
                if let Err((reason, is_misuse)) = self.build_if_due(client, part, cost, &mut told) {
                    self.refuse_to_build(client, &bodies, reason);
                    told.misuse = told.misuse.or(is_misuse.then_some(reason));
                }
            }
        }
        if told.too_soon > FLOOD && 2 * told.too_soon > told.asked {
            told.misuse = told.misuse.or(Some(Refusal::TooMany));
        }
        match told.misuse {
            Some(reason) if self.misused(client, reason) => {}
            _ => self.common.send_client(client, ToClient::Built(number)),
        }
    }

    /// Returns how many bodies a client has built.
    fn built_count(&self, client: ClientId) -> usize {
        self.common.allowances.get(&client).map_or(0, |allowance| allowance.building.sizes.len())
    }

    /// Carries out one operation of this cost if the client may ask for it so soon. An error is as that of [`Server::build`].
    fn build_if_due(
        &mut self,
        client: ClientId,
        op: BuildOp,
        cost: f64,
        told: &mut Told,
    ) -> Result<(), (Refusal, bool)> {
        let now = self.common.now;
        let building = &mut self.common.allowances.entry(client).or_default().building;
        if building.changes.ask(now, cost, CHANGES, CHANGES_PER_S) {
            return self.build(client, op);
        }
        told.too_soon += op.bodies().len().max(1);
        Err((Refusal::TooMany, false))
    }

    fn refuse_to_build(&mut self, client: ClientId, bodies: &[BodyId], reason: Refusal) {
        if bodies.is_empty() {
            self.common.send_client(client, ToClient::Rejected { body: None, reason });
        }
        for &id in bodies {
            self.common.send_client(client, ToClient::Rejected { body: Some(id), reason });
        }
    }

    /// Counts a misuse: a message that no honest program sends. Returns whether the client was cut off for
    /// it.
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

    /// Carries out one operation. An error gives the reason why not, and whether no honest program asks for
    /// it.
    fn build(&mut self, client: ClientId, op: BuildOp) -> Result<(), (Refusal, bool)> {
        let op = match op {
            BuildOp::Insert { bodies, mut shapes, joints } => {
                // A client that did not hear that this was done has asked again. What came of it may be gone
                // since, or be something else.
                let is_done = |body: &BodyRecord| body.id.builder() == Some(client) && self.is_there(body.id);
                if bodies.iter().any(is_done) {
                    return Ok(());
                }
                if self.is_held(&bodies, &joints) {
                    return Err((Refusal::Exists, false));
                }
                self.common.fading.bring_back(&bodies, &mut shapes, BUILD_BYTES);
                self.admit(client, &bodies, &shapes, &joints).map_err(as_refused)?;
                BuildOp::Insert { bodies, shapes, joints }
            }
            // When the client asked does not count: the input is told as one of the program's.
            BuildOp::Move(input) => BuildOp::Move(Input { logical_time: 0, tick: Tick(0), ..input }),
            BuildOp::Remove(id) if self.record().body(id).is_none() => return Ok(()),
            BuildOp::RemoveJoint(id) if self.record().joint(id).is_none() => return Ok(()),
            op => op,
        };
        let speed_limit_m_s = self.common.config.world.step.speed_limit_m_s;
        check_change(self.record(), &op, speed_limit_m_s).map_err(as_refused)?;
        self.obey(op);
        Ok(())
    }

    fn is_there(&self, id: BodyId) -> bool {
        matches!(self.record().life(id), Some(Life::Live | Life::Waiting))
    }

    /// Returns whether any of these ids is taken: it is on record, even if on its way out, or gone but still
    /// to be removed where it may be held.
    fn is_held(&self, bodies: &[BodyRecord], joints: &[JointRecord]) -> bool {
        let is_held = |id| {
            self.groups.values().any(|group| group.record.body(id).is_some())
                || self.common.nodes.values().any(|node| node.stale_scenery.contains(&id))
        };
        let is_tied = |id| {
            let holds =
                |group: &Group| group.record.joint(id).is_some() || group.retold.contains(Key::GoneJoint(id));
            self.groups.values().any(holds)
        };
        bodies.iter().any(|body| is_held(body.id)) || joints.iter().any(|joint| is_tied(joint.id))
    }

    /// Checks what a client wants to insert, and counts it if it may come.
    fn admit(
        &mut self,
        client: ClientId,
        bodies: &[BodyRecord],
        shapes: &[ShapeRecord],
        joints: &[JointRecord],
    ) -> Result<(), Refusal> {
        let record = &self.groups[&self.main].record;
        let config = &self.common.config;
        let building = &mut self.common.allowances.entry(client).or_default().building;
        let find = record.shapes_with(shapes);
        honest(are_used(shapes, bodies, &find))?;
        let new = New { client, record, bodies, joints, find: &find };
        new.check(config.world.step.speed_limit_m_s, &mut building.sizes)?;
        let unknown = record.unknown(shapes);
        if building.shapes.bytes_with(&unknown) > MAX_BUILT_SHAPE_BYTES {
            return Err(Refusal::TooMany);
        }
        // Last, since it takes longest.
        if !(config.can_build)(record.shapes_by_hash(), &unknown) {
            return Err(Refusal::Shape);
        }
        building.shapes.add(&unknown);
        for body in bodies {
            building.next.0 = building.next.0.max(body.id.index().saturating_add(1));
        }
        for joint in joints {
            building.next.1 = building.next.1.max((joint.id.0 as u32).saturating_add(1));
        }
        Ok(())
    }
}

/// Returns whether each of these shapes is the shape of a body's collider, or a part of one. A shape on
/// record is told with the first body that has it, and only once.
pub(super) fn are_used<'a>(
    shapes: &[ShapeRecord],
    bodies: &[BodyRecord],
    find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>,
) -> bool {
    let colliders = bodies.iter().flat_map(|body| &body.traits.colliders);
    let mut used: BTreeSet<_> = colliders.map(|collider| collider.shape).collect();
    let parts: Vec<_> = used.iter().filter_map(|&hash| find(hash)).flat_map(ShapeRecord::parts).collect();
    used.extend(parts);
    shapes.iter().all(|shape| used.contains(&shape.hash()))
}

fn as_refused(reason: Refusal) -> (Refusal, bool) {
    (reason, reason == Refusal::NotToBeBuilt)
}

/// Returns what an operation costs, in changes: what it makes others compute, keep and hear. `built` is how
/// many bodies the client has built.
fn cost(op: &BuildOp, built: usize) -> f64 {
    let told = || encoded_len(op) as f64 / TOLD_BYTES;
    match op {
        BuildOp::Insert { bodies, shapes, joints } => {
            let colliders: usize = bodies.iter().map(|body| body.traits.colliders.len()).sum();
            let parts: usize = shapes.iter().map(|shape| shape.parts().count()).sum();
            let count = 1 + bodies.len() + joints.len() + colliders + parts;
            count as f64 + built as f64 / LOOKED_THROUGH + told()
        }
        BuildOp::Alter(_) => ALTERATION + told(),
        BuildOp::Remove(_) | BuildOp::RemoveJoint(_) | BuildOp::Move(_) | BuildOp::Push(_) => 1.0,
    }
}

fn honest(holds: bool) -> Result<(), Refusal> {
    if holds { Ok(()) } else { Err(Refusal::NotToBeBuilt) }
}

fn is_slow(kind: BodyKind, velocity: &Velocity, limit_m_s: f32) -> bool {
    kind != BodyKind::Dynamic || velocity.is_within(limit_m_s * 1.000_01)
}

/// Checks an operation on bodies and joints that are there.
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
            // The nodes that compute the body refuse that too.
            let is_part = |joint: &JointRecord| joint.link.is_some() && [joint.a, joint.b].contains(body);
            let is_link = || record.joints().any(is_part);
            honest(traits.kind == BodyKind::Dynamic || !is_link())?;
            honest(known.character == traits.character && known.vehicle == traits.vehicle)?;
            check_traits(traits)
        }
        BuildOp::Alter(Alteration::Joint(joint)) => {
            let known = record.joint(joint.id).ok_or(Refusal::Unknown)?;
            honest(known.a == joint.a && known.b == joint.b && known.link == joint.link)
        }
    }
}

fn check_traits(traits: &BodyTraits) -> Result<(), Refusal> {
    if traits.extra_solver_iterations.max(traits.extra_pgs_iterations) > MAX_EXTRA_ITERATIONS {
        return Err(Refusal::Costly(Costs::Iterations));
    }
    if traits.colliders.iter().any(|collider| margin_m(traits, collider) > MAX_MARGIN_M) {
        return Err(Refusal::Costly(Costs::Size));
    }
    // The bit does nothing on a body that moves.
    let meets_fixed = |collider: &ColliderRecord| collider.collision_types & FIXED_FIXED != 0;
    match traits.kind == BodyKind::Fixed && traits.colliders.iter().any(meets_fixed) {
        true => Err(Refusal::Costly(Costs::FixedPairs)),
        false => Ok(()),
    }
}

fn is_fixed(body: &BodyRecord) -> bool {
    body.traits.kind == BodyKind::Fixed
}

/// What a client wants to insert.
struct New<'a, 'f> {
    client: ClientId,
    record: &'a Record,
    bodies: &'a [BodyRecord],
    joints: &'a [JointRecord],
    /// Finds shapes on record, and those that come with the insertion.
    find: &'f dyn Fn(ShapeHash) -> Option<&'a ShapeRecord>,
}

impl New<'_, '_> {
    /// Checks everything except whether new shapes can be built. Adds to `sizes`, those of what the client
    /// has built.
    fn check(&self, speed_limit_m_s: f32, sizes: &mut BTreeMap<BodyId, Size>) -> Result<(), Refusal> {
        let ids: BTreeMap<_, _> = self.bodies.iter().map(|body| (body.id, body.traits.kind)).collect();
        honest(ids.len() == self.bodies.len())?;
        honest(ids.keys().all(|id| id.builder() == Some(self.client)))?;
        self.check_joints(&ids)?;
        for body in self.bodies {
            // Characters and vehicles are avatars, and bounded as such.
            honest(body.traits.character.is_none() && body.traits.vehicle.is_none())?;
            honest(is_slow(body.traits.kind, &body.state.velocity, speed_limit_m_s))?;
            check_traits(&body.traits)?;
        }
        // Checked before each part is looked at.
        if self.part_count() > MAX_BUILT_COLLIDERS {
            return Err(Refusal::Costly(Costs::Colliders));
        }
        if !self.shapes_fit() {
            return Err(Refusal::Shape);
        }
        self.check_costs(sizes)
    }

    fn check_joints(&self, new: &BTreeMap<BodyId, BodyKind>) -> Result<(), Refusal> {
        let ids: BTreeSet<_> = self.joints.iter().map(|joint| joint.id).collect();
        honest(ids.len() == self.joints.len())?;
        honest(ids.iter().all(|id| id.builder() == Some(self.client)))?;
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

    /// Returns how many parts the compounds of the bodies have.
    fn part_count(&self) -> usize {
        let colliders = self.bodies.iter().flat_map(|body| &body.traits.colliders);
        let shapes = colliders.filter_map(|collider| (self.find)(collider.shape));
        shapes.map(|shape| shape.parts().count()).sum()
    }

    /// Returns whether all shapes are there, and suit their bodies.
    fn shapes_fit(&self) -> bool {
        let suits = |hash| (self.find)(hash).filter(|shape| shape.suits_builders());
        let is_fine = |collider: &ColliderRecord| {
            suits(collider.shape).is_some_and(|shape| shape.parts().all(|part| suits(part).is_some()))
        };
        self.bodies.iter().all(|body| match is_fixed(body) {
            true => body.traits.colliders.iter().all(is_fine),
            false => body.suits_clients(self.find),
        })
    }

    /// Checks how many bodies and joints the client would have built, and what they cost.
    fn check_costs(&self, sizes: &mut BTreeMap<BodyId, Size>) -> Result<(), Refusal> {
        if sizes.len() > 2 * MAX_BUILT {
            sizes.clear();
        }
        let mut all = Vec::new();
        for body in self.record.built(self.client) {
            let size = *sizes.entry(body.id).or_insert_with(|| Size::of(body, self.find));
            all.push(Known { body, size, bounds: OnceCell::new() });
        }
        let before = all.len();
        let new = |body| Known { body, size: Size::of(body, self.find), bounds: OnceCell::new() };
        all.extend(self.bodies.iter().map(new));
        let joints = self.record.built_joints(self.client).count() + self.joints.len();
        let sum = |of: fn(&Size) -> usize| all.iter().map(|one| of(&one.size)).sum::<usize>();
        if all.len().max(joints) > MAX_BUILT {
            return Err(Refusal::TooMany);
        }
        if sum(|size| size.colliders) > MAX_BUILT_COLLIDERS {
            return Err(Refusal::Costly(Costs::Colliders));
        }
        if sum(|size| size.corners) > MAX_BUILT_CORNERS {
            return Err(Refusal::Costly(Costs::BuiltCorners));
        }
        let new = &all[before..];
        if new.iter().any(|one| !is_fixed(one.body) && one.size.reach_m > MAX_REACH_M) {
            return Err(Refusal::Costly(Costs::Size));
        }
        if new.iter().any(|one| self.is_crowded(one, &all)) {
            return Err(Refusal::Costly(Costs::Overlaps));
        }
        sizes.extend(new.iter().map(|one| (one.body.id, one.size)));
        Ok(())
    }

    /// Returns whether a body begins where too many other bodies of its client are. A fixed body is compared
    /// with fixed ones, and a movable body with movable ones.
    fn is_crowded<'b>(&self, one: &Known<'b>, all: &[Known<'b>]) -> bool {
        let bounds_of = |of: &Known<'b>| *of.bounds.get_or_init(|| bounds_of(of.body, self.find));
        let Some(bounds) = bounds_of(one) else { return false };
        let (mut bodies, mut colliders) = (0, 0);
        for other in all {
            if other.body.id == one.body.id || is_fixed(other.body) != is_fixed(one.body) {
                continue;
            }
            let (a, b) = (one.body.state.pose.translation, other.body.state.pose.translation);
            let apart_m2: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
            let is_near = apart_m2 <= f64::from(one.size.reach_m + other.size.reach_m).powi(2);
            if is_near && bounds_of(other).is_some_and(|other| bounds.touches(&other)) {
                bodies += 1;
                colliders += other.size.colliders;
            }
            if bodies > MAX_OVERLAPS || colliders > MAX_OVERLAPPED_COLLIDERS {
                return true;
            }
        }
        false
    }
}

/// A body with its size, and with its AABB once that was asked for. Computing the AABB takes long, and each
/// body is compared with all others.
struct Known<'b> {
    body: &'b BodyRecord,
    size: Size,
    bounds: OnceCell<Option<Bounds>>,
}
