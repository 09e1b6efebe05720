//! Records the world on the server: every body, shape and joint as last known, so that nothing is lost with a
//! node (thesis 3.3.5).

use std::collections::{BTreeMap, BTreeSet};

use bincode::{Decode, Encode};

use super::joints::Joints;
use super::{CanBuild, Key, SavedWorld};
use crate::protocol::{
    Alteration, BodyCheckpoint, BodyKind, BodyRecord, BodyTraits, Check, Chunk, Invalid, JointRecord, Placed,
    ShapeHash, ShapeRecord, ViewNumber, chunks, encode_value,
};
use crate::space::{BodyId, Burden, ClientId, DistributionTree, Epoch, Groups, JointId, RegionId, Tick};

/// The life cycle of a recorded body: waiting for a node, live, being removed, or parked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Life {
    /// No node has been told of the body.
    Waiting,
    /// A region of some node owns the body.
    Live,
    /// The nodes have been told to remove the body and have not confirmed yet.
    Removing {
        /// Says whether the body stays on record until its client returns.
        park: bool,
        /// Says whether the client is back already.
        back: bool,
    },
    /// The body is an avatar whose client is away.
    Parked,
}

/// A body on record.
#[derive(Clone, Debug, Encode, Decode)]
pub(super) struct StoredBody {
    body: BodyRecord,
    tick: Tick,
    life: Life,
}

impl StoredBody {
    /// Returns the tick of its last known state.
    pub(super) fn tick(&self) -> Tick {
        self.tick
    }

    /// Returns whether nodes own it, as all bodies but immovable ones.
    pub(super) fn is_movable(&self) -> bool {
        self.body.traits.kind != BodyKind::Fixed
    }
}

impl Check for StoredBody {
    fn check(&self) -> Result<(), Invalid> {
        self.body.check()
    }
}

/// The ids of what has changed and is not written to the directory yet.
#[derive(Clone, Debug, Default, Encode, Decode)]
pub(super) struct Changes {
    /// Bodies that came, went, changed their [`Life`] or were altered.
    lives: BTreeSet<BodyId>,
    /// Bodies that moved.
    states: BTreeSet<BodyId>,
    shapes: BTreeSet<ShapeHash>,
    joints: BTreeSet<JointId>,
}

/// The record of a world: its bodies, shapes and joints, in id order.
#[derive(Clone, Debug, Default, Encode, Decode)]
pub struct Record {
    bodies: BTreeMap<BodyId, StoredBody>,
    shapes: BTreeMap<ShapeHash, ShapeRecord>,
    joints: Joints,
    changes: Changes,
}

impl Record {
    /// Returns a record of a world that no node knows yet.
    pub fn new(bodies: Vec<BodyRecord>, shapes: Vec<ShapeRecord>, joints: Vec<JointRecord>) -> Self {
        let mut record = Self::default();
        for body in bodies {
            record.insert(body);
        }
        record.learn(shapes);
        record.joints = joints.into_iter().collect();
        record
    }

    /// Returns a record as it was stored. Joints of bodies that have gone since are left out.
    pub(super) fn restored(
        bodies: Vec<StoredBody>,
        shapes: Vec<ShapeRecord>,
        joints: Vec<JointRecord>,
    ) -> Self {
        let bodies: BTreeMap<_, _> = bodies.into_iter().map(|stored| (stored.body.id, stored)).collect();
        let is_whole = |joint: &JointRecord| bodies.contains_key(&joint.a) && bodies.contains_key(&joint.b);
        let joints = joints.into_iter().filter(is_whole).collect();
        let shapes = shapes.into_iter().map(|shape| (shape.hash(), shape)).collect();
        Self { bodies, shapes, joints, changes: Changes::default() }
    }

    /// Copies the record for another group. With `known`, the group's nodes hold the bodies already.
    /// Otherwise bodies wait for nodes.
    pub(super) fn copied(&self, known: bool) -> Self {
        let mut copy = Self { changes: Changes::default(), ..self.clone() };
        if known {
            return copy;
        }
        let going: Vec<_> = copy.lives().collect();
        for (id, life) in going {
            match life {
                Life::Live | Life::Removing { park: true, back: true } => copy.set_life(id, Life::Waiting),
                Life::Removing { park: true, back: false } => copy.set_life(id, Life::Parked),
                Life::Removing { park: false, .. } => copy.remove(id),
                Life::Waiting | Life::Parked => {}
            }
        }
        copy.forget_changes();
        copy
    }

    /// Replaces the world by a saved one. Avatars stay, and those that were saved too go to where they were
    /// saved. Movable bodies wait for nodes of views after this one.
    pub(super) fn replace(&mut self, saved: &SavedWorld, view: ViewNumber) {
        let mut new = self.copied(false);
        new.bodies.retain(|id, _| id.client().is_some());
        new.shapes.extend(saved.shapes.iter().map(|shape| (shape.hash(), shape.clone())));
        for body in &saved.bodies {
            match new.bodies.get_mut(&body.id) {
                Some(avatar) => avatar.body.set_state(body.state),
                None if body.id.client().is_some() => {}
                None => new.insert(BodyRecord { epoch: Epoch(0), ..body.clone() }),
            }
        }
        let is_whole = |joint: &&JointRecord| [joint.a, joint.b].iter().all(|id| new.bodies.contains_key(id));
        new.joints = saved.joints.iter().filter(is_whole).cloned().collect();
        for entry in new.bodies.values_mut() {
            match entry.body.traits.kind {
                // Nobody owns a fixed body: it is wherever the nodes are.
                BodyKind::Fixed => entry.life = Life::Live,
                _ => entry.body.epoch = Epoch::placed_in(view.0).max(entry.body.epoch.next()),
            }
        }
        new.mark_all(Changes::default());
        // The ends of former bodies and joints are written down too.
        new.changes.lives.extend(self.bodies.keys());
        new.changes.joints.extend(self.joints.keys());
        *self = new;
    }

    /// Returns a hash of the world as it is now, which tells scenes apart.
    pub fn fingerprint(&self) -> u64 {
        let mut hasher = blake3::Hasher::new();
        let parts = self.bodies.values().map(encode_value);
        let parts = parts.chain(self.shapes.values().map(encode_value));
        for part in parts.chain(self.joints.values().map(encode_value)) {
            hasher.update(&part);
        }
        let mut first = [0; 8];
        first.copy_from_slice(&hasher.finalize().as_bytes()[..8]);
        u64::from_le_bytes(first)
    }

    /// Marks everything as to be written to the directory, also what another record had marked, which may be
    /// gone from this one.
    pub(super) fn mark_all(&mut self, marked: Changes) {
        self.changes = marked;
        self.changes.lives.extend(self.bodies.keys());
        self.changes.shapes.extend(self.shapes.keys());
        self.changes.joints.extend(self.joints.keys());
    }

    /// Marks bodies as to be written to the directory at once, as if they had come or gone.
    pub(super) fn mark(&mut self, bodies: BTreeSet<BodyId>) {
        self.changes.lives.extend(bodies);
    }

    /// Takes the marks of what is to be written to the directory.
    pub(super) fn take_marks(&mut self) -> Changes {
        std::mem::take(&mut self.changes)
    }

    /// Returns whether states of bodies are to be written to the directory.
    pub(super) fn has_moved(&self) -> bool {
        !self.changes.states.is_empty()
    }

    /// Forgets what was to be written to the directory.
    pub(super) fn forget_changes(&mut self) {
        self.take_marks();
    }

    /// Returns the states of bodies that moved since the last call, as writes.
    pub(super) fn take_states(&mut self) -> Vec<(Key, Option<Vec<u8>>)> {
        let moved = std::mem::take(&mut self.changes.states);
        moved.into_iter().map(|id| self.stored(id)).collect()
    }

    /// Returns what else has changed since the last call, as writes: lives of bodies, shapes and joints.
    pub(super) fn take_changes(&mut self) -> Vec<(Key, Option<Vec<u8>>)> {
        let states = std::mem::take(&mut self.changes.states);
        let Changes { lives, shapes, joints, .. } =
            std::mem::replace(&mut self.changes, Changes { states, ..Changes::default() });
        let lives = lives.into_iter().map(|id| self.stored(id));
        let shapes =
            shapes.into_iter().map(|hash| (Key::Shape(hash), self.shapes.get(&hash).map(encode_value)));
        let joints = joints.into_iter().map(|id| (Key::Joint(id), self.joints.get(&id).map(encode_value)));
        lives.chain(shapes).chain(joints).collect()
    }

    fn stored(&self, id: BodyId) -> (Key, Option<Vec<u8>>) {
        (Key::Body(id), self.bodies.get(&id).map(encode_value))
    }

    /// Adds a new body, which waits for a node.
    pub(super) fn insert(&mut self, body: BodyRecord) {
        self.changes.lives.insert(body.id);
        self.bodies.insert(body.id, StoredBody { body, tick: Tick(0), life: Life::Waiting });
    }

    /// Forgets a body and its joints.
    pub(super) fn remove(&mut self, id: BodyId) {
        self.changes.lives.insert(id);
        self.bodies.remove(&id);
        for joint in self.joints.of(id).map(|joint| joint.id).collect::<Vec<_>>() {
            self.remove_joint(joint);
        }
    }

    /// Adds a joint between bodies on record.
    pub(super) fn tie(&mut self, joint: JointRecord) {
        self.changes.joints.insert(joint.id);
        self.joints.insert(joint);
    }

    /// Changes the properties of a movable body or a joint. Returns false, and changes nothing, if it is not
    /// on record, or if a body is or would become fixed.
    pub(super) fn alter(&mut self, alteration: &Alteration) -> bool {
        match alteration {
            Alteration::Body { body, traits, user_data, wakes } => {
                let Some(StoredBody { body, .. }) = self.bodies.get_mut(body) else { return false };
                let is_movable = |traits: &BodyTraits| traits.kind != BodyKind::Fixed;
                if !is_movable(&body.traits) || !is_movable(traits) {
                    return false;
                }
                body.set_traits(traits.clone(), *user_data);
                body.state.sleeping &= !wakes;
                self.changes.lives.insert(body.id);
            }
            Alteration::Joint(joint) => {
                if !self.joints.contains_key(&joint.id) {
                    return false;
                }
                self.tie((**joint).clone());
            }
        }
        true
    }

    /// Forgets a joint. Returns whether there was one.
    pub(super) fn remove_joint(&mut self, id: JointId) -> bool {
        self.changes.joints.insert(id);
        self.joints.remove(id).is_some()
    }

    /// Returns the bodies that a client has built, in id order.
    pub(super) fn built(&self, client: ClientId) -> impl Iterator<Item = &BodyRecord> {
        let range = BodyId::built(client, 0)..=BodyId::built(client, u32::MAX);
        self.bodies.range(range).map(|(_, entry)| &entry.body)
    }

    /// Returns the joints that a client has built, in id order.
    pub(super) fn built_joints(&self, client: ClientId) -> impl Iterator<Item = JointId> {
        let range = JointId::built(client, 0)..=JointId::built(client, u32::MAX);
        self.joints.range(range).map(|(&id, _)| id)
    }

    /// Returns a joint.
    pub(crate) fn joint(&self, id: JointId) -> Option<&JointRecord> {
        self.joints.get(&id)
    }

    /// Returns the joints of a body, in id order.
    pub fn joints_of(&self, body: BodyId) -> impl Iterator<Item = &JointRecord> {
        self.joints.of(body)
    }

    /// Returns the joints, in id order.
    pub fn joints(&self) -> impl Iterator<Item = &JointRecord> {
        self.joints.values()
    }

    /// Returns the next indices of persistent bodies and of joints: one beyond the highest on record. Bodies
    /// and joints that clients built do not count.
    pub(super) fn next_ids(&self) -> (u32, u64) {
        let is_own = |id: &&BodyId| id.client().is_none() && id.builder().is_none();
        let body = self.bodies.keys().filter(is_own).map(|id| id.index()).max();
        let joint = self.joints.keys().filter(|id| id.builder().is_none()).map(|id| id.0).max();
        (body.map_or(0, |index| index.saturating_add(1)), joint.map_or(0, |id| id.saturating_add(1)))
    }

    /// Records shapes and returns those that are new.
    pub(super) fn learn(&mut self, shapes: Vec<ShapeRecord>) -> Vec<ShapeRecord> {
        let mut new = Vec::new();
        for shape in shapes {
            let hash = shape.hash();
            if self.shapes.insert(hash, shape.clone()).is_none() {
                self.changes.shapes.insert(hash);
                new.push(shape);
            }
        }
        new
    }

    /// Returns those of these shapes that are not on record.
    pub(super) fn unknown(&self, shapes: &[ShapeRecord]) -> Vec<ShapeRecord> {
        shapes.iter().filter(|shape| !self.shapes.contains_key(&shape.hash())).cloned().collect()
    }

    /// Returns the hashes of the shapes of all bodies, and of their parts.
    pub(super) fn used_shapes(&self) -> BTreeSet<ShapeHash> {
        self.named_by(self.bodies.values().map(|entry| &entry.body))
    }

    fn named_by<'a>(&self, bodies: impl Iterator<Item = &'a BodyRecord>) -> BTreeSet<ShapeHash> {
        let colliders = bodies.flat_map(|body| &body.traits.colliders);
        let mut named: BTreeSet<_> = colliders.map(|collider| collider.shape).collect();
        let parts: Vec<_> =
            named.iter().filter_map(|hash| self.shapes.get(hash)).flat_map(ShapeRecord::parts).collect();
        named.extend(parts);
        named
    }

    /// Returns the shapes of these bodies, with their parts.
    pub(super) fn shapes_of(&self, bodies: &[BodyRecord]) -> Vec<ShapeRecord> {
        let named = self.named_by(bodies.iter());
        named.iter().filter_map(|hash| self.shapes.get(hash)).cloned().collect()
    }

    /// Forgets all shapes but these. Returns the forgotten ones.
    pub(super) fn keep_shapes(&mut self, used: &BTreeSet<ShapeHash>) -> BTreeMap<ShapeHash, ShapeRecord> {
        let all = std::mem::take(&mut self.shapes).into_iter();
        let (kept, gone): (_, BTreeMap<_, _>) = all.partition(|(hash, _)| used.contains(hash));
        self.shapes = kept;
        self.changes.shapes.extend(gone.keys());
        gone
    }

    /// Returns all shapes, by hash.
    pub(crate) fn shapes_by_hash(&self) -> &BTreeMap<ShapeHash, ShapeRecord> {
        &self.shapes
    }

    /// Returns a shape that is on record.
    pub fn shape(&self, hash: ShapeHash) -> Option<&ShapeRecord> {
        self.shapes.get(&hash)
    }

    /// Returns how far a body reaches from its origin at most, metres.
    pub(super) fn reach_m(&self, body: &BodyRecord) -> f64 {
        body.reach_m(|hash| self.shape(hash))
    }

    /// Returns a function that finds a shape on record or among the `brought` ones. Each of these is hashed
    /// once.
    pub(super) fn shapes_with<'a>(
        &'a self,
        brought: &'a [ShapeRecord],
    ) -> impl Fn(ShapeHash) -> Option<&'a ShapeRecord> {
        let brought: BTreeMap<_, _> = brought.iter().map(|shape| (shape.hash(), shape)).collect();
        move |hash| brought.get(&hash).copied().or_else(|| self.shapes.get(&hash))
    }

    /// Returns whether a body can be an avatar with its shapes, of which `brought` may be new, and whether
    /// these can be built.
    pub(super) fn admits(&self, avatar: &BodyRecord, brought: &[ShapeRecord], can_build: CanBuild) -> bool {
        avatar.suits_clients(self.shapes_with(brought)) && can_build(&self.shapes, brought)
    }

    /// Returns how many bodies are on record, also those that are not in the world now.
    pub(super) fn len(&self) -> usize {
        self.bodies.len()
    }

    /// Returns a body as last known.
    pub fn body(&self, id: BodyId) -> Option<&BodyRecord> {
        self.bodies.get(&id).map(|entry| &entry.body)
    }

    /// Returns where a body is in its life cycle.
    pub fn life(&self, id: BodyId) -> Option<Life> {
        self.bodies.get(&id).map(|entry| entry.life)
    }

    /// Returns the bodies in the world, as last known: live ones and those that wait for a node.
    pub fn present(&self) -> impl Iterator<Item = &BodyRecord> {
        self.bodies
            .values()
            .filter(|entry| matches!(entry.life, Life::Live | Life::Waiting))
            .map(|entry| &entry.body)
    }

    /// Returns a client's avatars that are being removed although the client is back. Until they return they
    /// stand where they were.
    pub(super) fn returning(&self, client: ClientId) -> impl Iterator<Item = &BodyRecord> {
        let avatars = self.avatars(client).into_iter();
        avatars.filter_map(|(id, life)| {
            self.body(id).filter(|_| matches!(life, Life::Removing { back: true, .. }))
        })
    }

    /// Returns the movable bodies with their lives. Immovable ones have no owner: every node is sent them on
    /// joining.
    pub(super) fn movable_lives(&self) -> impl Iterator<Item = (BodyId, Life)> {
        self.bodies.iter().filter(|(_, entry)| entry.is_movable()).map(|(&id, entry)| (id, entry.life))
    }

    /// Returns the ids of all recorded bodies with their lives.
    pub fn lives(&self) -> impl Iterator<Item = (BodyId, Life)> {
        self.bodies.iter().map(|(&id, entry)| (id, entry.life))
    }

    /// Returns the recorded bodies of one client: its avatars.
    pub fn avatars(&self, client: ClientId) -> Vec<(BodyId, Life)> {
        let range = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        self.bodies.range(range).map(|(&id, entry)| (id, entry.life)).collect()
    }

    pub(super) fn set_life(&mut self, id: BodyId, life: Life) {
        if let Some(entry) = self.bodies.get_mut(&id) {
            entry.life = life;
            self.changes.lives.insert(id);
        }
    }

    /// Returns the tick of the last known state of a body.
    pub(super) fn told_at(&self, id: BodyId) -> Option<Tick> {
        self.bodies.get(&id).map(|entry| entry.tick)
    }

    pub(super) fn body_mut(&mut self, id: BodyId) -> Option<&mut BodyRecord> {
        self.changes.states.insert(id);
        self.bodies.get_mut(&id).map(|entry| &mut entry.body)
    }

    /// Takes a checkpoint in, unless something newer is known. (epoch, tick) decides.
    pub(super) fn checkpoint(&mut self, tick: Tick, checkpoint: &BodyCheckpoint) {
        if let Some(entry) = self.bodies.get_mut(&checkpoint.id)
            && (entry.body.epoch, entry.tick) <= (checkpoint.epoch, tick)
        {
            // Only the state is taken: the body's properties may have changed meanwhile.
            entry.body.set_state(checkpoint.state);
            entry.body.epoch = checkpoint.epoch;
            entry.tick = tick;
            self.changes.states.insert(checkpoint.id);
        }
    }

    /// Takes a whole body in, unless something newer is known, as [`Self::checkpoint`] does.
    pub(super) fn freshen(&mut self, tick: Tick, body: BodyRecord) {
        if let Some(entry) = self.bodies.get_mut(&body.id)
            && (entry.body.epoch, entry.tick) <= (body.epoch, tick)
        {
            self.changes.states.insert(body.id);
            // The server knows the body's properties best.
            entry.body.epoch = body.epoch;
            entry.body.set_state(body.state);
            entry.tick = tick;
        }
    }

    /// Takes a body in as its owner holds it. The record may have a later epoch, from a view that nobody came
    /// to compute. That epoch stays.
    pub(super) fn reclaim(&mut self, tick: Tick, body: BodyRecord) {
        if let Some(entry) = self.bodies.get_mut(&body.id)
            && entry.tick <= tick
        {
            self.changes.states.insert(body.id);
            entry.body.epoch = body.epoch.max(entry.body.epoch);
            entry.body.set_state(body.state);
            entry.tick = tick;
        }
    }

    /// Raises the epoch of a body that is placed anew in this view above all epochs that it can have had
    /// before.
    pub(super) fn renew(&mut self, id: BodyId, view: ViewNumber) {
        if let Some(entry) = self.bodies.get_mut(&id) {
            // A node that counts epochs wrong must not make its claims last.
            entry.body.epoch = Epoch::placed_in(view.0).max(entry.body.epoch.next());
        }
    }

    /// Returns the shapes that are not in `known` as chunks, each shape before the compounds that name it,
    /// and adds them to `known`.
    pub(super) fn shape_chunks(&self, known: &mut BTreeSet<ShapeHash>) -> Vec<Chunk> {
        let mut new: Vec<_> = self.shapes.iter().filter(|(hash, _)| !known.contains(hash)).collect();
        new.sort_by_key(|(_, shape)| shape.is_compound());
        known.extend(new.iter().map(|(hash, _)| **hash));
        chunks(new.into_iter().map(|(_, shape)| shape.clone()), Chunk::Shapes)
    }

    /// Returns the immovable bodies that are not in `known` as chunks, and adds them to `known`.
    pub(super) fn scenery_chunks(&self, known: &mut BTreeSet<BodyId>) -> Vec<Chunk> {
        let new: Vec<_> = self
            .present()
            .filter(|body| body.traits.kind == BodyKind::Fixed && !known.contains(&body.id))
            .cloned()
            .collect();
        known.extend(new.iter().map(|body| body.id));
        chunks(new, Chunk::Bodies)
    }

    /// Returns the joints of any of these bodies as chunks.
    pub(super) fn joint_chunks(&self, of: impl Fn(BodyId) -> bool) -> Vec<Chunk> {
        chunks(self.joints.values().filter(|joint| of(joint.a) || of(joint.b)).cloned(), Chunk::Joints)
    }

    /// Returns the region in which each of these ownerless bodies is placed. An assembly (bodies tied by
    /// joints) goes whole to the region of its body with the lowest id.
    pub(super) fn place(&self, tree: &DistributionTree, ids: &BTreeSet<BodyId>) -> Vec<Placed> {
        let movable =
            |id| self.bodies.get(&id).is_some_and(|entry| entry.body.traits.kind != BodyKind::Fixed);
        let mut groups = Groups::default();
        for joint in self.joints.values() {
            let known = ids.contains(&joint.a) && ids.contains(&joint.b);
            if known && movable(joint.a) && movable(joint.b) {
                groups.join(joint.a, joint.b);
            }
        }
        ids.iter()
            .filter_map(|&id| {
                let first = self.body(groups.root(id))?;
                Some(Placed {
                    region: tree.leaf_at(first.state.pose.translation),
                    body: self.body(id)?.clone(),
                })
            })
            .collect()
    }

    /// Returns the places of the movable bodies that do not sleep.
    pub(super) fn burdens(&self) -> impl Iterator<Item = Burden> {
        let awake = |body: &&BodyRecord| body.traits.kind != BodyKind::Fixed && !body.state.sleeping;
        self.present().filter(awake).map(|body| Burden {
            place: body.state.pose.translation,
            weight: 1.0,
            island: None,
        })
    }

    /// Counts the movable bodies in each region, for allocation by load.
    pub(super) fn loads(&self, tree: &DistributionTree) -> BTreeMap<RegionId, f64> {
        let mut loads: BTreeMap<RegionId, f64> = tree.leaves().map(|leaf| (leaf, 0.0)).collect();
        for body in self.present().filter(|body| body.traits.kind != BodyKind::Fixed) {
            *loads.entry(tree.leaf_at(body.state.pose.translation)).or_default() += 1.0;
        }
        loads
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::protocol::WorldPose;
    use crate::sim::sim_body;

    #[test]
    fn owners_know_best_where_a_body_is_and_the_record_what_it_is() {
        let id = BodyId::persistent(0);
        let old = sim_body(id, [1.0; 3]);
        let mut record = Record::new(vec![old.clone()], Vec::new(), Vec::new());
        let traits = Arc::new(BodyTraits { gravity_scale: 0.5, ..(*old.traits).clone() });
        let body = |traits: &Arc<BodyTraits>| {
            let traits = traits.clone();
            Alteration::Body { body: id, traits, user_data: 7, wakes: false }
        };
        assert!(record.alter(&body(&traits)));
        let mut moved = old.clone();
        moved.state.pose = WorldPose::at([2.0; 3]);
        let is = |record: &Record, x: f64| {
            let known = record.body(id).unwrap();
            assert_eq!((known.traits.gravity_scale, known.state.pose.translation[0]), (0.5, x));
            assert_eq!(known.user_data, 7);
        };
        record.freshen(Tick(3), moved.clone());
        is(&record, 2.0);
        moved.state.pose = WorldPose::at([3.0; 3]);
        record.reclaim(Tick(4), moved);
        is(&record, 3.0);
        let fixed = Arc::new(BodyTraits { kind: BodyKind::Fixed, ..(*traits).clone() });
        assert!(!record.alter(&body(&fixed)), "it has an owner");
        is(&record, 3.0);
    }
}
