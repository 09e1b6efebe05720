//! Collects the changes that a server's program or a builder makes to the world between two steps, and reads
//! the world as it will be after them.

mod altered;
mod shapes;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rapier3d::prelude::*;

use self::altered::{Altered, Move};
use super::error::Error;
use super::remote::check_vehicle;
use super::role::{Instead, Role, Unsupported};
use super::view::{Body, MovableBody};
use crate::cluster::Joints;
use crate::physics::{
    ShapeError, ShapeLibrary, hangs, joint_record, try_on_body, try_on_collider, try_on_joint,
};
use crate::protocol::{
    Alteration, BodyKind, BodyRecord, BodyState, BodyTraits, BuildOp, Check, Controller, Drive, Input,
    Invalid, JointRecord, Push, ShapeHash, ShapeRecord, Velocity, WorldPose,
};
use crate::runtime::{WorldError, check_speed};
use crate::space::{BodyId, ClientId, DistributionTree, JointId, RegionId, Tick};

/// The world as an author knows it: the server's record, or what a client has heard.
pub(super) trait Known {
    /// Returns whether a body is known, even if it is about to be removed.
    fn knows(&self, id: BodyId) -> bool;
    /// Returns a body that is in the world.
    fn body(&self, id: BodyId) -> Option<BodyRecord>;
    /// Visits the bodies that are in the world, in id order. The threads that serve the world may have to
    /// wait meanwhile.
    fn for_each_body(&self, look: &mut dyn FnMut(&BodyRecord));
    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord>;
    /// Returns whether the world is known to have a shape.
    fn has_shape(&self, hash: ShapeHash) -> bool;
    fn joint(&self, id: JointId) -> Option<JointRecord>;
    fn joints(&self) -> Vec<JointRecord>;
    fn joints_of(&self, body: BodyId) -> Vec<JointRecord>;
    fn tree(&self) -> DistributionTree;
    /// Returns how many of the author's sends, counted from the first, the server has answered, by doing or
    /// refusing them.
    fn answered(&self) -> u64;
}

/// Who numbers the bodies and joints that an author makes.
#[derive(Clone, Copy)]
pub(super) enum Names {
    /// The server's program, which numbers what is the world's own.
    Program,
    /// A builder, which has ids of its own.
    Builder(ClientId),
}

impl Names {
    fn body(self, index: u32) -> BodyId {
        match self {
            Self::Program => BodyId::persistent(index),
            Self::Builder(client) => BodyId::built(client, index),
        }
    }

    fn joint(self, index: u64) -> JointId {
        match self {
            Self::Program => JointId(index),
            Self::Builder(client) => JointId::built(client, index as u32),
        }
    }

    fn role(self) -> Role {
        match self {
            Self::Program => Role::Server,
            Self::Builder(_) => Role::Builder,
        }
    }
}

/// The changes since the last step, and those of earlier steps that are not on record yet.
pub(super) struct Author {
    names: Names,
    shapes: ShapeLibrary,
    speed_limit_m_s: f32,
    /// Shapes that are known to fit into a message.
    fitting: BTreeSet<ShapeHash>,
    /// The number of sends so far: steps that sent any change.
    sends: u64,
    next_body: u32,
    next_joint: u64,
    /// Bodies and joints that were inserted since the last step.
    bodies: BTreeMap<BodyId, BodyRecord>,
    joints: Joints,
    /// Changes since the last step, and of earlier steps that are not answered yet: the next change builds on
    /// them.
    altered_bodies: BTreeMap<BodyId, Altered>,
    /// The same for joints, with the number of the send; `None` if not sent yet.
    altered_joints: BTreeMap<JointId, (JointRecord, Option<u64>)>,
    moves: BTreeMap<BodyId, Move>,
    /// Pushes by body, each with its place in the order of all pushes.
    pushes: BTreeMap<BodyId, Vec<(usize, Push)>>,
    pushed: usize,
    removed_joints: Vec<JointId>,
    removed: Vec<BodyId>,
    /// Bodies and joints of earlier steps that are not on record yet.
    awaited: BTreeMap<BodyId, BodyRecord>,
    awaited_joints: Joints,
    /// Bodies and joints that were removed, with the number of the send. They are still on record, or may yet
    /// come to be.
    leaving: BTreeMap<BodyId, u64>,
    leaving_joints: BTreeMap<JointId, u64>,
}

impl Author {
    pub(super) fn new(names: Names, (next_body, next_joint): (u32, u64), speed_limit_m_s: f32) -> Self {
        Self {
            names,
            shapes: ShapeLibrary::default(),
            speed_limit_m_s,
            fitting: BTreeSet::new(),
            sends: 0,
            next_body,
            next_joint,
            bodies: BTreeMap::new(),
            joints: Joints::default(),
            altered_bodies: BTreeMap::new(),
            altered_joints: BTreeMap::new(),
            moves: BTreeMap::new(),
            pushes: BTreeMap::new(),
            pushed: 0,
            removed_joints: Vec::new(),
            removed: Vec::new(),
            awaited: BTreeMap::new(),
            awaited_joints: Joints::default(),
            leaving: BTreeMap::new(),
            leaving_joints: BTreeMap::new(),
        }
    }

    /// Forgets all changes that were not sent or not confirmed, since the world was replaced by another.
    /// Takes the next ids of that world.
    pub(super) fn begin_anew(&mut self, (next_body, next_joint): (u32, u64)) {
        self.next_body = self.next_body.max(next_body);
        self.next_joint = self.next_joint.max(next_joint);
        self.bodies.clear();
        self.joints = Joints::default();
        self.altered_bodies.clear();
        self.altered_joints.clear();
        self.moves.clear();
        self.pushes.clear();
        self.removed_joints.clear();
        self.removed.clear();
        self.awaited.clear();
        self.awaited_joints = Joints::default();
        self.leaving.clear();
        self.leaving_joints.clear();
    }

    /// Forgets what the server refused: changes of a body, or of joints if `id` is `None`.
    pub(super) fn refused(&mut self, id: Option<BodyId>) {
        match id {
            Some(id) => {
                self.awaited.remove(&id);
                self.awaited_joints.remove_of(id);
                self.leaving.remove(&id);
                self.altered_bodies.retain(|known, altered| *known != id || altered.sent.is_none());
            }
            None => {
                let sends = self.sends;
                self.altered_joints.retain(|_, (_, sent)| sent.is_none());
                self.leaving_joints.retain(|_, sent| *sent > sends);
            }
        }
    }

    /// Returns whether a body was removed here and may still be in the world.
    pub(super) fn is_leaving(&self, id: BodyId) -> bool {
        self.leaving.contains_key(&id)
    }

    /// Returns whether anything was changed since the last step.
    pub(super) fn has_news(&self) -> bool {
        let (bodies, joints) = (self.altered_bodies.values(), self.altered_joints.values());
        let mut altered = bodies.map(|altered| altered.sent).chain(joints.map(|(_, sent)| *sent));
        let made = !self.bodies.is_empty() || !self.joints.is_empty();
        let removed = !self.removed.is_empty() || !self.removed_joints.is_empty();
        let moved = !self.moves.is_empty() || !self.pushes.is_empty();
        made || removed || moved || altered.any(|sent| sent.is_none())
    }

    /// Returns the changes since the last step, to be sent, and counts them as sent.
    pub(super) fn take(&mut self, world: &dyn Known) -> Vec<BuildOp> {
        let answered = world.answered();
        self.awaited.retain(|id, _| !world.knows(*id));
        let told: Vec<_> =
            self.awaited_joints.keys().copied().filter(|id| world.joint(*id).is_some()).collect();
        told.into_iter().for_each(|id| _ = self.awaited_joints.remove(id));
        self.leaving.retain(|id, sent| *sent > answered || world.knows(*id));
        self.leaving_joints.retain(|id, sent| *sent > answered || world.joint(*id).is_some());
        let is_open = |sent: Option<u64>| sent.is_none_or(|send| send > answered);
        self.altered_bodies.retain(|_, altered| is_open(altered.sent));
        self.altered_joints.retain(|_, (_, sent)| is_open(*sent));
        let send = self.sends + 1;
        let mut ops = Vec::new();
        let (bodies, joints) = (std::mem::take(&mut self.bodies), std::mem::take(&mut self.joints));
        if !bodies.is_empty() {
            let new = |(hash, _): &(ShapeHash, _)| match self.names {
                // The server takes the shapes that it lacks from the program's library.
                Names::Program => false,
                // The insertion that brought the shape may have been refused.
                Names::Builder(_) => !world.has_shape(*hash),
            };
            let shapes = self.shapes.records_of(bodies.values()).into_iter().filter(new);
            let shapes = shapes.map(|(_, shape)| shape.clone()).collect();
            let joints: Vec<_> = joints.values().cloned().collect();
            self.awaited_joints.extend(joints.clone());
            ops.push(BuildOp::Insert { bodies: bodies.values().cloned().collect(), shapes, joints });
            self.awaited.extend(bodies);
        }
        for (&body, Altered { traits, user_data, wakes, sent }) in &mut self.altered_bodies {
            if sent.is_none() {
                *sent = Some(send);
                let (traits, user_data, wakes) = (traits.clone(), *user_data, std::mem::take(wakes));
                ops.push(BuildOp::Alter(Alteration::Body { body, traits, user_data, wakes }));
            }
        }
        for (joint, sent) in self.altered_joints.values_mut() {
            if sent.is_none() {
                *sent = Some(send);
                ops.push(BuildOp::Alter(Alteration::Joint(Box::new(joint.clone()))));
            }
        }
        for (body, Move { velocity, pose, drive }) in std::mem::take(&mut self.moves) {
            let Some(known) = self.known(world, body).map(|known| known.asked()) else { continue };
            let input = Input {
                body,
                logical_time: 0,
                tick: Tick(0),
                velocity: velocity.unwrap_or(known),
                pose,
                drive: None,
            };
            if velocity.is_some() || pose.is_some() {
                ops.push(BuildOp::Move(input));
            }
            if drive.is_some() {
                ops.push(BuildOp::Move(Input { pose: None, drive, ..input }));
            }
        }
        let mut pushes: Vec<_> = std::mem::take(&mut self.pushes).into_values().flatten().collect();
        pushes.sort_unstable_by_key(|(place, _)| *place);
        ops.extend(pushes.into_iter().map(|(_, push)| BuildOp::Push(push)));
        ops.extend(std::mem::take(&mut self.removed_joints).into_iter().map(BuildOp::RemoveJoint));
        ops.extend(std::mem::take(&mut self.removed).into_iter().map(BuildOp::Remove));
        self.sends += u64::from(!ops.is_empty());
        if self.shapes.has_gained() {
            self.forget_shapes(world);
        }
        ops
    }

    pub(super) fn insert(
        &mut self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
        controller: Option<Controller<'_>>,
    ) -> Result<BodyId, Error> {
        let id = self.names.body(self.next_body);
        let record = self.shapes.describe(id, pose, body, colliders)?.with_controller(controller);
        record.check().map_err(refused)?;
        check_speed(&record, self.speed_limit_m_s)?;
        self.check_shapes(&record)?;
        self.next_body = self.next_body.checked_add(1).ok_or(WorldError::Full)?;
        self.bodies.insert(id, record);
        Ok(id)
    }

    /// Takes back the bodies that were inserted last, since the last step, as if they had never been there.
    /// Their ids are given again.
    pub(super) fn take_back(&mut self, bodies: &[BodyId]) {
        let Some(&first) = bodies.first() else { return };
        self.bodies.retain(|id, _| *id < first);
        self.next_body = first.index();
    }

    pub(super) fn remove(&mut self, world: &dyn Known, id: BodyId) -> Result<(), Error> {
        self.found(world, id)?;
        self.moves.remove(&id);
        self.altered_bodies.remove(&id);
        self.pushes.remove(&id);
        self.joints.remove_of(id);
        if self.bodies.remove(&id).is_none() {
            self.removed.push(id);
            self.leaving.insert(id, self.sends + 1);
            self.awaited.remove(&id);
            self.awaited_joints.remove_of(id);
        }
        Ok(())
    }

    pub(super) fn set_velocity(
        &mut self,
        world: &dyn Known,
        id: BodyId,
        velocity: Velocity,
    ) -> Result<(), Error> {
        velocity.check().map_err(refused)?;
        let mut body = self.movable(world, id, "move fixed bodies")?;
        body.state.velocity = velocity;
        check_speed(&body, self.speed_limit_m_s)?;
        // Moves are sent before pushes, and a velocity that is set undoes the impulses before it.
        if let Some(pushes) = self.pushes.get_mut(&id) {
            pushes.retain(|(_, push)| push.lasts);
        }
        match self.bodies.get_mut(&id) {
            Some(body) => body.steer(velocity),
            None => self.moves.entry(id).or_default().velocity = Some(velocity),
        }
        Ok(())
    }

    pub(super) fn drive(&mut self, world: &dyn Known, id: BodyId, drive: Drive) -> Result<(), Error> {
        check_vehicle(id, self.known(world, id).as_ref())?;
        match self.bodies.get_mut(&id) {
            Some(body) => body.state.drive = Some(drive),
            None => self.moves.entry(id).or_default().drive = Some(drive),
        }
        Ok(())
    }

    pub(super) fn set_pose(&mut self, world: &dyn Known, id: BodyId, pose: WorldPose) -> Result<(), Error> {
        pose.check().map_err(refused)?;
        let from = self.movable(world, id, "move fixed bodies")?.state.pose.translation;
        // Moves are sent before pushes: the points of pushes up to now move along, so that their arms stay as
        // long.
        let pushes = self.pushes.get_mut(&id).into_iter().flatten();
        for point in pushes.filter_map(|(_, push)| push.point.as_mut()) {
            *point = std::array::from_fn(|i| point[i] + pose.translation[i] - from[i]);
        }
        match self.bodies.get_mut(&id) {
            Some(body) => body.state.pose = pose,
            None => self.moves.entry(id).or_default().pose = Some(pose),
        }
        Ok(())
    }

    pub(super) fn push(&mut self, world: &dyn Known, push: &Push) -> Result<(), Error> {
        push.check().map_err(refused)?;
        if self.found(world, push.body)?.traits.kind != BodyKind::Dynamic {
            return Err(self.unsupported("push bodies that are not dynamic", Instead::SetVelocity));
        }
        self.pushes.entry(push.body).or_default().push((self.pushed, *push));
        self.pushed += 1;
        Ok(())
    }

    /// Lets the program change the traits of a movable body.
    pub(super) fn update(
        &mut self,
        world: &dyn Known,
        id: BodyId,
        change: &mut dyn FnMut(&mut RigidBody),
    ) -> Result<(), Error> {
        let known = self.movable(world, id, "change fixed bodies")?;
        self.learn(world, &known)?;
        let tried = try_on_body(&known, &self.shapes, change)?;
        if tried.moves {
            return Err(
                self.unsupported("move bodies, or put them to sleep, by changing them", Instead::MoveByName)
            );
        }
        if tried.traits.kind == BodyKind::Fixed {
            return Err(self.unsupported("fix what moves", Instead::InsertAnew));
        }
        let is_part = || self.joints_of(world, id).iter().any(|joint| joint.link.is_some());
        if tried.traits.kind != BodyKind::Dynamic && is_part() {
            let what = "make a link or the root of a multibody other than dynamic";
            return Err(self.unsupported(what, Instead::InsertAnew));
        }
        self.alter(&known, tried.traits, tried.user_data, tried.wakes)
    }

    /// Lets the program change a collider of a movable body.
    pub(super) fn update_collider(
        &mut self,
        world: &dyn Known,
        id: BodyId,
        index: usize,
        change: &mut dyn FnMut(&mut Collider),
    ) -> Result<(), Error> {
        let known = self.movable(world, id, "change fixed bodies")?;
        let count = known.traits.colliders.len();
        if index >= count {
            return Err(WorldError::NoCollider { body: id, index, count }.into());
        }
        self.learn(world, &known)?;
        let Some(collider) = try_on_collider(&known, index, &self.shapes, change)? else {
            return Err(
                self.unsupported("change where colliders are and how they are shaped", Instead::InsertAnew)
            );
        };
        let mut traits = (*known.traits).clone();
        traits.colliders[index] = collider;
        self.alter(&known, traits, known.user_data, false)
    }

    fn alter(
        &mut self,
        known: &BodyRecord,
        traits: BodyTraits,
        user_data: u128,
        wakes: bool,
    ) -> Result<(), Error> {
        traits.check().map_err(refused)?;
        if hangs(&traits, &self.shapes) {
            return Err(ShapeError::Massless.into());
        }
        let traits = Arc::new(traits);
        match self.bodies.get_mut(&known.id) {
            Some(body) => {
                body.set_traits(traits, user_data);
                body.state.sleeping &= !wakes;
            }
            None => {
                if let Some(body) = self.awaited.get_mut(&known.id) {
                    body.set_traits(traits.clone(), user_data);
                }
                let woken = self.altered_bodies.get(&known.id).is_some_and(|altered| altered.wakes);
                let altered = Altered { traits, user_data, wakes: wakes || woken, sent: None };
                self.altered_bodies.insert(known.id, altered);
            }
        }
        Ok(())
    }

    /// Lets the program change a joint.
    pub(super) fn update_joint(
        &mut self,
        world: &dyn Known,
        id: JointId,
        change: &mut dyn FnMut(&mut GenericJoint),
    ) -> Result<(), Error> {
        let known = self.joint(world, id).ok_or(WorldError::NoJoint(id))?;
        let joint = try_on_joint(&known, change);
        joint.check().map_err(refused)?;
        match self.joints.contains_key(&id) {
            true => self.joints.insert(joint),
            false => _ = self.altered_joints.insert(id, (joint, None)),
        }
        Ok(())
    }

    /// Ties bodies that were inserted since the last step to one another, or to fixed ones. A body that is
    /// computed already may be in any region.
    pub(super) fn insert_joint(
        &mut self,
        world: &dyn Known,
        [a, b]: [BodyId; 2],
        joint: &GenericJoint,
    ) -> Result<JointId, Error> {
        let mut is_new = false;
        for id in [a, b] {
            let kind = self.found(world, id)?.traits.kind;
            let is_fresh = self.bodies.contains_key(&id);
            is_new |= is_fresh && kind != BodyKind::Fixed;
            if kind != BodyKind::Fixed && !is_fresh {
                return Err(self.unsupported("tie bodies that are computed already", Instead::TieAtBirth));
            }
        }
        if !is_new {
            return Err(self.unsupported("tie fixed bodies", Instead::TieAtBirth));
        }
        let id = self.names.joint(self.next_joint);
        let record = joint_record(id, a, b, joint);
        record.check().map_err(refused)?;
        self.next_joint += 1;
        self.joints.insert(record);
        // As in a local world, a new joint wakes the bodies that it ties.
        for end in [a, b] {
            let Some(body) = self.bodies.get_mut(&end) else { continue };
            (body.state.sleeping, body.state.still_s) = (false, 0.0);
        }
        Ok(id)
    }

    pub(super) fn remove_joint(&mut self, world: &dyn Known, id: JointId) -> Result<(), Error> {
        self.joint(world, id).ok_or(WorldError::NoJoint(id))?;
        if self.joints.remove(id).is_none() {
            self.altered_joints.remove(&id);
            self.awaited_joints.remove(id);
            self.removed_joints.push(id);
            self.leaving_joints.insert(id, self.sends + 1);
        }
        Ok(())
    }

    /// Returns a joint as it is on record or was made, with the changes since.
    pub(super) fn joint(&self, world: &dyn Known, id: JointId) -> Option<JointRecord> {
        if let Some(joint) = self.joints.get(&id) {
            return Some(joint.clone());
        }
        let joint = world.joint(id).or_else(|| self.awaited_joints.get(&id).cloned())?;
        self.is_left(&joint).then(|| self.as_altered(joint))
    }

    /// Returns all joints in id order, each as by [`Author::joint`].
    pub(super) fn joints(&self, world: &dyn Known) -> Vec<JointRecord> {
        let own = (self.awaited_joints.values(), self.joints.values());
        self.with_own(world.joints(), own.0, own.1)
    }

    /// Returns the joints of a body.
    pub(super) fn joints_of(&self, world: &dyn Known, body: BodyId) -> Vec<JointRecord> {
        self.with_own(world.joints_of(body), self.awaited_joints.of(body), self.joints.of(body))
    }

    /// Merges joints that are on record, those that are awaited there, and new ones.
    fn with_own<'a>(
        &self,
        told: Vec<JointRecord>,
        awaited: impl Iterator<Item = &'a JointRecord>,
        fresh: impl Iterator<Item = &'a JointRecord>,
    ) -> Vec<JointRecord> {
        let named = |joint: JointRecord| (joint.id, joint);
        let mut joints: BTreeMap<_, _> = awaited.cloned().map(named).collect();
        joints.extend(told.into_iter().map(named));
        let of_before = joints.into_values().filter(|joint| self.is_left(joint));
        let mut joints: Vec<_> = of_before.map(|joint| self.as_altered(joint)).collect();
        joints.extend(fresh.cloned());
        joints
    }

    /// Returns whether neither a joint nor one of its bodies was removed.
    fn is_left(&self, joint: &JointRecord) -> bool {
        let is_leaving = [joint.a, joint.b].iter().any(|id| self.leaving.contains_key(id));
        !is_leaving && !self.leaving_joints.contains_key(&joint.id)
    }

    fn as_altered(&self, joint: JointRecord) -> JointRecord {
        self.altered_joints.get(&joint.id).map_or(joint, |(altered, _)| altered.clone())
    }

    /// Returns a body as it is on record or was inserted, with the changes since.
    pub(super) fn known(&self, world: &dyn Known, id: BodyId) -> Option<BodyRecord> {
        if self.leaving.contains_key(&id) {
            return None;
        }
        let fresh = self.bodies.get(&id).cloned();
        let body = fresh.or_else(|| world.body(id)).or_else(|| self.awaited.get(&id).cloned())?;
        Some(self.as_changed(body))
    }

    fn as_changed(&self, mut body: BodyRecord) -> BodyRecord {
        let id = body.id;
        if let Some(Altered { traits, user_data, .. }) = self.altered_bodies.get(&id) {
            body.set_traits(traits.clone(), *user_data);
        }
        if let Some(moved) = self.moves.get(&id) {
            body.state = moved.of(&body.state);
        }
        body
    }

    pub(super) fn body(&self, world: &dyn Known, id: BodyId) -> Option<Body> {
        let BodyRecord { state, traits, user_data, .. } = self.known(world, id)?;
        Some(Body {
            pose: state.pose,
            velocity: state.velocity,
            kind: traits.kind,
            sleeping: state.sleeping,
            mass_kg: None,
            user_data,
            owner: None,
            outside: false,
        })
    }

    /// Returns the movable bodies in id order.
    pub(super) fn movable_bodies(&self, world: &dyn Known) -> Vec<MovableBody> {
        let mut bodies = Vec::new();
        self.for_each_known(world, |id, traits, user_data, state| {
            if traits.kind != BodyKind::Fixed {
                bodies.push(MovableBody {
                    id,
                    region: RegionId(0),
                    pose: state.pose,
                    velocity: state.velocity,
                    user_data,
                    sleeping: state.sleeping,
                    outside: false,
                });
            }
        });
        let tree = world.tree();
        bodies.iter_mut().for_each(|body| body.region = tree.leaf_at(body.pose.translation));
        bodies
    }

    pub(super) fn movable_count(&self, world: &dyn Known) -> usize {
        let mut count = 0;
        self.for_each_known(world, |_, traits, _, _| count += usize::from(traits.kind != BodyKind::Fixed));
        count
    }

    /// Visits all bodies in id order, as [`Author::known`] returns them, without copies: whoever serves the
    /// world waits meanwhile.
    fn for_each_known(&self, world: &dyn Known, mut look: impl FnMut(BodyId, &BodyTraits, u128, &BodyState)) {
        let mut look = |body: &BodyRecord| {
            if !self.is_leaving(body.id) {
                let altered = self.altered_bodies.get(&body.id);
                let altered = altered.map(|altered| (&altered.traits, altered.user_data));
                let (traits, user_data) = altered.unwrap_or((&body.traits, body.user_data));
                let moved = self.moves.get(&body.id).map(|moved| moved.of(&body.state));
                look(body.id, traits, user_data, moved.as_ref().unwrap_or(&body.state));
            }
        };
        // For a body on record the record counts, unless the body is of this step.
        let mut own: BTreeMap<_, _> = self.awaited.iter().collect();
        own.extend(&self.bodies);
        let mut own = own.into_iter().peekable();
        world.for_each_body(&mut |told| {
            while let Some((_, body)) = own.next_if(|(id, _)| **id < told.id) {
                look(body);
            }
            let same = own.next_if(|(id, _)| **id == told.id);
            look(same.map_or(told, |(id, _)| self.bodies.get(id).unwrap_or(told)));
        });
        own.for_each(|(_, body)| look(body));
    }

    /// Returns the fixed bodies in id order.
    pub(super) fn fixed_bodies(&self, world: &dyn Known) -> Vec<(BodyId, WorldPose)> {
        let mut fixed = Vec::new();
        self.for_each_known(world, |id, traits, _, state| {
            fixed.extend((traits.kind == BodyKind::Fixed).then_some((id, state.pose)));
        });
        fixed
    }

    fn unsupported(&self, what: &'static str, instead: Instead) -> Error {
        Unsupported { role: self.names.role(), what, instead }.into()
    }

    fn found(&self, world: &dyn Known, id: BodyId) -> Result<BodyRecord, Error> {
        self.known(world, id).ok_or_else(|| WorldError::NoBody(id).into())
    }

    fn movable(&self, world: &dyn Known, id: BodyId, what: &'static str) -> Result<BodyRecord, Error> {
        let body = self.found(world, id)?;
        match body.traits.kind {
            BodyKind::Fixed => Err(self.unsupported(what, Instead::InsertAnew)),
            _ => Ok(body),
        }
    }
}

/// Converts the fault of a value that cannot be sent to an error.
pub(super) fn refused(Invalid { field, rule }: Invalid) -> Error {
    WorldError::Setting { what: field, value: "out of range".to_owned(), range: rule }.into()
}
