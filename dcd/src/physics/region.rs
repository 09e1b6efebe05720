//! One region: a Rapier world around an anchor, and who owns what in it.

mod place;
mod read;

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize, Serializer};

use super::assembly::{self, Assembly};
use super::coupling::{self, Border, Shared};
use super::follow;
use super::guide::{self, Guide};
use super::hooks::{ContactHooks, Named};
use super::outbox::Outbox;
use super::outline::Outline;
use super::partition::HUB_REACH_M;
use super::query::Moved;
use super::shapes::{ShapeError, ShapeLibrary};
use super::ties::{HeldJoint, JointNews};
use super::watch::ContactWatch;
use super::{convert, record};
use crate::protocol::{BodyKind, BodyRecord, BodyTraits, JointRecord, RegionEvents};
use crate::space::{BodyId, Bounds, Cell, Epoch, JointId, RegionId, RegionSet, Tick};

/// Immovable bodies are held this far beyond the cell, so that what reaches out of it finds its ground.
const COVER_M: f64 = 4.0 * HUB_REACH_M as f64;

/// What a region is to a body that it holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Role {
    /// The body never moves; every region near it holds it and none sends it.
    Immovable,
    /// This region has authority over it.
    Owner,
    /// The region of this rank has.
    Replica {
        /// Rank of the owner.
        owner: usize,
    },
}

/// What a region knows of a body besides Rapier's own.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Slot {
    pub id: BodyId,
    pub epoch: Epoch,
    pub role: Role,
    /// The other regions that hold it; kept by the owner, and by replicas where regions agree on means.
    pub holders: RegionSet,
    pub traits: Arc<BodyTraits>,
    /// Radius of a ball around the centre of mass that holds all colliders, in metres.
    pub reach_m: f32,
    /// What boxes around it are made from.
    pub outline: Outline,
    /// The joints it hangs on, in order of insertion.
    pub joints: Vec<JointId>,
    /// Index into the region's assemblies, if joints tie it to others.
    pub assembly: Option<u32>,
    /// Owner: whether the holders know that it sleeps.
    pub told_asleep: bool,
    /// Replica: where the owner's copy fell asleep.
    pub asleep_at: Option<Pose>,
    /// Replica: whether its owner has announced it since membership changed last.
    pub confirmed: bool,
    /// What regions that agree on means know of each other's copies; none while the body is held by one region only.
    pub shared: Option<Box<Shared>>,
    /// Whether its island was small enough to be computed whole, when it last came near a border.
    pub whole: bool,
    /// Ticks for which its island's size has said otherwise.
    pub doubt: u16,
}

/// A body by name and by Rapier's handle.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Link {
    pub id: BodyId,
    pub handle: RigidBodyHandle,
}

/// A leaf of the distribution tree with its Rapier world.
#[derive(Serialize, Deserialize)]
pub struct Region {
    id: RegionId,
    rank: usize,
    cell: Cell,
    anchor: [f64; 3],
    world: PhysicsWorld,
    /// By Rapier's body index.
    slots: Vec<Option<Slot>>,
    /// For look-ups only: iteration goes by [`Region::links`], in id order. A map of one block leaves Rapier's own small
    /// blocks side by side in memory.
    #[serde(serialize_with = "in_id_order")]
    by_id: HashMap<BodyId, RigidBodyHandle>,
    /// Bodies owned here and held elsewhere too, in id order.
    pub(super) shared: Vec<Link>,
    /// Bodies owned elsewhere, in id order.
    pub(super) replicas: Vec<Link>,
    pub(super) assemblies: Vec<Assembly>,
    pub(super) assemblies_stale: bool,
    pub(super) joints: BTreeMap<JointId, HeldJoint>,
    /// Joints of bodies held here to bodies that are not, in id order.
    pub(super) waiting: BTreeMap<JointId, JointRecord>,
    pub(super) joint_news: JointNews,
    /// Immovable bodies that touch this box are held here.
    covered: Bounds,
    watch: ContactWatch,
    pub(super) guide: Guide,
    quarantined: Vec<BodyId>,
    /// Whom the user wants to be asked about contacts.
    #[serde(skip)]
    pub(super) hooks: Option<Arc<dyn ContactHooks>>,
    /// Whether a body's mass is shared among the regions that hold it; else each copy has all of it.
    pub(super) shares_mass: bool,
    pub(super) events: RegionEvents,
    pub(super) outbox: Outbox,
    /// Whether anything was changed here, or heard of others, since the last step.
    pub(super) stirred: bool,
    /// Whether it rests in the present tick.
    pub(super) rests: bool,
    /// Bodies inserted here as its own whose neighbourhood no exchange has seen yet.
    pub(super) fresh: Vec<Link>,
    /// Bodies that the coupling must look at once, asleep or not, since the border or another region's bodies have come to them.
    pub(super) overlooked: Vec<RigidBodyHandle>,
    /// Microseconds of the present tick so far, and of the last ones, smoothed.
    #[serde(skip)]
    step_us: f64,
    #[serde(skip)]
    mean_step_us: f64,
    /// Bodies that became this region's own in the exchange under way.
    pub(super) arrived: Vec<Link>,
    /// By Rapier's body index: the tick at which the coupling must look at the body again. Kept apart from the slots, so
    /// that passing over a body far from any border touches four bytes.
    pub(super) due: Vec<u32>,
    /// By Rapier's body index: the length of the micro-step in which Rapier solved the body's contacts last, in seconds.
    /// Empty as long as all micro-steps have had one length.
    solved_dt_s: Vec<f32>,
    /// What a coupling that agrees on means keeps from one exchange to the next.
    pub(super) border: Border,
    /// Bodies inserted or changed since the last step, perhaps more than once; and what queries make of them.
    touched: Vec<RigidBodyHandle>,
    #[serde(skip)]
    moved: OnceLock<Moved>,
    /// Scratch of the coupling, kept for its memory.
    #[serde(skip)]
    pub(super) looked_at: Vec<RigidBodyHandle>,
    /// The same.
    #[serde(skip)]
    pub(super) changes: Vec<super::coupling::Change>,
}

impl Region {
    pub(super) fn new(
        id: RegionId,
        rank: usize,
        cell: Cell,
        part: &Bounds,
        gravity: [f32; 3],
        regions: &Arc<[RegionId]>,
        steps: usize,
    ) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = convert::vector(gravity);
        Self {
            id,
            rank,
            cell,
            anchor: convert::anchor_of(part.centre()),
            world,
            slots: Vec::new(),
            by_id: HashMap::new(),
            shared: Vec::new(),
            replicas: Vec::new(),
            assemblies: Vec::new(),
            assemblies_stale: false,
            joints: BTreeMap::new(),
            waiting: BTreeMap::new(),
            joint_news: JointNews::default(),
            covered: Bounds { min: cell.min, max: cell.max }.grown(COVER_M),
            watch: ContactWatch::default(),
            guide: Guide::default(),
            quarantined: Vec::new(),
            hooks: None,
            shares_mass: false,
            events: RegionEvents { region: id, ..RegionEvents::default() },
            outbox: Outbox::new(id, regions.clone()),
            stirred: true,
            rests: false,
            fresh: Vec::new(),
            arrived: Vec::new(),
            overlooked: Vec::new(),
            step_us: 0.0,
            mean_step_us: 0.0,
            due: Vec::new(),
            solved_dt_s: Vec::new(),
            border: Border::new(regions.len(), steps),
            touched: Vec::new(),
            moved: OnceLock::new(),
            looked_at: Vec::new(),
            changes: Vec::new(),
        }
    }

    /// Its vertex of the tree.
    pub fn id(&self) -> RegionId {
        self.id
    }

    /// Its position among the leaves in id order.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Its half-open box; outer faces lie at infinity.
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// The origin of its region space, in world space.
    pub fn anchor(&self) -> [f64; 3] {
        self.anchor
    }

    /// Its Rapier world: positions are relative to the anchor, replicas are among the bodies.
    pub fn physics(&self) -> &PhysicsWorld {
        &self.world
    }

    /// Every body held here in id order, with the part the region plays for it.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyId, Role, RigidBodyHandle, &RigidBody)> {
        self.by_id
            .iter()
            .map(|(&id, &handle)| (id, self.slot(handle).role, handle, &self.world.bodies[handle]))
    }

    /// Every body held here, in id order.
    fn links(&self) -> Vec<Link> {
        let mut links: Vec<_> = self.by_id.iter().map(|(&id, &handle)| Link { id, handle }).collect();
        links.sort_unstable_by_key(|link| link.id);
        links
    }

    /// The role and name of the body behind a handle of [`Region::physics`].
    pub fn role_of(&self, handle: RigidBodyHandle) -> Option<(BodyId, Role)> {
        self.slot_at(handle).map(|slot| (slot.id, slot.role))
    }

    /// How many bodies it has authority over.
    pub fn owned_count(&self) -> usize {
        self.slots.iter().flatten().filter(|slot| slot.role == Role::Owner).count()
    }

    /// Whether there are any: found at once where there are, as bodies are inserted one by one.
    pub fn owns_any(&self) -> bool {
        self.slots.iter().flatten().any(|slot| slot.role == Role::Owner)
    }

    /// How many of them are awake.
    pub fn awake_count(&self) -> usize {
        let owned = |handle| self.slot_at(handle).is_some_and(|slot| slot.role == Role::Owner);
        self.world.islands.active_bodies().filter(|&handle| owned(handle)).count()
    }

    /// Wall time that its steps took in the last tick, without what it took in of other regions; zero when it rested.
    pub fn last_step(&self) -> Duration {
        if self.rests { Duration::ZERO } else { Duration::from_secs_f64(self.step_us * 1e-6) }
    }

    /// How many bodies it holds for others.
    pub fn replica_count(&self) -> usize {
        self.replicas.len()
    }

    /// Micro-steps of the present tick.
    pub fn steps(&self) -> usize {
        self.border.pace.steps_of(self.rank)
    }

    /// How far copies at the worst border were from their means in the last tick, m/s.
    pub(super) fn disagreement_m_s(&self) -> f32 {
        self.border.pace.disagreement_m_s()
    }

    /// Micro-steps of the next tick.
    pub(super) fn steps_next(&self) -> usize {
        self.border.pace.next_of(self.rank)
    }

    /// Copies that Rapier set aside in the last tick, as their numbers were not finite.
    pub fn quarantined(&self) -> &[BodyId] {
        &self.quarantined
    }

    /// Whether nothing here can change in the tick to come: all that it holds is at rest, and nobody has stirred it.
    pub(super) fn is_idle(&self) -> bool {
        !self.stirred
            && self.shared.is_empty()
            && self.replicas.is_empty()
            && !self.border.awaits_any()
            && self.world.islands.active_bodies().next().is_none()
            && self.fresh.is_empty()
            && self.border.pace.is_settled(self.rank)
    }

    /// Says and does nothing in this round.
    pub(super) fn be_silent(&mut self, tick: Tick) {
        self.outbox.clear(tick);
    }

    /// Steps the Rapier world.
    pub(super) fn step(&mut self, parameters: &IntegrationParameters) {
        let dt_before_s = std::mem::replace(&mut self.world.integration_parameters, *parameters).dt;
        let steps = self.steps();
        if self.guide.is_first() {
            self.quarantined.clear();
        }
        guide::guide(self, steps);
        self.tell_joints();
        self.stirred = false;
        self.touched.clear();
        self.moved.take();
        match self.hooks.as_deref() {
            Some(hooks) => {
                let named = Named { hooks, watch: &self.watch, anchor: self.anchor };
                self.world.step_with_events(&named, &self.watch);
            }
            None => self.world.step_with_events(&(), &self.watch),
        }
        self.note_solved(dt_before_s);
        self.watch.remind(&mut self.world.colliders);
        let heard = self.events.forces.len();
        self.watch.drain(self.anchor, 1.0 / steps as f32, &mut self.events);
        self.events.make_tellable();
        self.answer_for_forces(heard);
        for handle in self.world.quarantine().bodies().to_vec() {
            self.set_aside(handle);
        }
    }

    /// Notes in how long a micro-step the contacts of what is awake have been solved. What sleeps keeps its impulses, of a
    /// micro-step that may have been longer or shorter than the present one. Rapier lets bodies fall asleep before it solves:
    /// what is awake after a step has been solved in it.
    fn note_solved(&mut self, dt_before_s: f32) {
        let dt_s = self.world.integration_parameters.dt;
        if self.solved_dt_s.is_empty() && dt_s == dt_before_s {
            return;
        }
        self.solved_dt_s.resize(self.slots.len(), dt_before_s);
        for handle in self.world.islands.active_bodies() {
            self.solved_dt_s[handle.into_raw_parts().0 as usize] = dt_s;
        }
    }

    /// Keeps the forces that this region answers for. Where each copy has all of the mass, that is the owner of the first
    /// movable body; where masses are split, all whose copies count.
    fn answer_for_forces(&mut self, from: usize) {
        let mut forces = std::mem::take(&mut self.events.forces);
        let heard = forces.split_off(from);
        let role = |id| self.handle_of(id).map_or(Role::Immovable, |handle| self.slot(handle).role);
        let shared = |id| self.handle_of(id).and_then(|handle| self.slot(handle).shared.as_deref());
        let splits = |id| shared(id).is_some_and(Shared::is_split);
        let counts = |id| shared(id).is_none_or(|shared| !shared.shadows.contains(self.rank));
        forces.extend(heard.into_iter().filter(|force| match role(force.key.a) {
            _ if splits(force.key.a) || splits(force.key.b) => counts(force.key.a) && counts(force.key.b),
            Role::Immovable => role(force.key.b) == Role::Owner,
            role => role == Role::Owner,
        }));
        self.events.forces = forces;
    }

    /// Rapier has set a copy aside that was no longer finite. Where regions share the body, the others decide.
    fn set_aside(&mut self, handle: RigidBodyHandle) {
        let Some(slot) = self.slot_at(handle) else { return };
        self.quarantined.push(slot.id);
        match self.slot_mut(handle).shared.as_deref_mut() {
            Some(shared) => shared.broken = true,
            None => self.refresh(handle),
        }
    }

    /// The body of this name, if it is held here.
    pub fn handle_of(&self, id: BodyId) -> Option<RigidBodyHandle> {
        self.by_id.get(&id).copied()
    }

    pub(super) fn world_mut(&mut self) -> &mut PhysicsWorld {
        self.stirred = true;
        self.moved.take();
        &mut self.world
    }

    /// Bodies that are not where Rapier's own queries would find them.
    pub(super) fn moved(&self) -> &Moved {
        self.moved.get_or_init(|| Moved::of(self, &self.touched))
    }

    /// A body is not, or may not be, what and where it was in the last step.
    fn touch(&mut self, handle: RigidBodyHandle) {
        self.moved.take();
        if self.touched.last() != Some(&handle) {
            self.touched.push(handle);
        }
    }

    pub(super) fn slot(&self, handle: RigidBodyHandle) -> &Slot {
        self.slot_at(handle).expect("every body of a region has a slot")
    }

    pub(super) fn slot_mut(&mut self, handle: RigidBodyHandle) -> &mut Slot {
        let index = handle.into_raw_parts().0 as usize;
        self.slots[index].as_mut().expect("every body of a region has a slot")
    }

    fn slot_at(&self, handle: RigidBodyHandle) -> Option<&Slot> {
        self.slots.get(handle.into_raw_parts().0 as usize)?.as_ref()
    }

    /// Inserts a body that is not held here yet.
    pub(super) fn insert(
        &mut self,
        body: &BodyRecord,
        role: Role,
        holders: RegionSet,
        shapes: &ShapeLibrary,
    ) -> Result<RigidBodyHandle, ShapeError> {
        assert!(!self.by_id.contains_key(&body.id), "{} is already held by {}", body.id, self.id);
        let (rigid_body, colliders) = record::build(body, self.anchor, shapes)?;
        self.stirred = true;
        let handle = self.world.bodies.insert(rigid_body);
        self.touch(handle);
        for (place, (collider, record)) in colliders.into_iter().zip(&body.traits.colliders).enumerate() {
            let collider = self.world.colliders.insert_with_parent(collider, handle, &mut self.world.bodies);
            let inserted = &mut self.world.colliders[collider];
            if role == Role::Immovable {
                follow::fetch_plane(inserted, &body.state.pose, self.anchor);
            }
            self.watch.name(inserted, collider, (body.id, place as u16), record);
        }
        if body.traits.colliders.iter().any(|collider| !collider.enabled) {
            // Rapier counts their mass until it steps.
            self.world.bodies[handle].recompute_mass_properties_from_colliders(&self.world.colliders);
        }
        self.guide.note(handle, body.traits.kind);
        let reach_m = record::reach_of(&self.world.bodies[handle], &self.world.colliders);
        let outline = Outline::of(&self.world.bodies[handle], &self.world.colliders);
        let index = handle.into_raw_parts().0 as usize;
        if self.slots.len() <= index {
            self.slots.resize_with(index + 1, || None);
            self.due.resize(index + 1, 0);
        }
        self.due[index] = 0;
        self.slots[index] = Some(Slot {
            id: body.id,
            epoch: body.epoch,
            role,
            holders,
            traits: body.traits.clone(),
            reach_m,
            outline,
            joints: Vec::new(),
            assembly: None,
            told_asleep: body.state.sleeping,
            confirmed: true,
            shared: None,
            whole: false,
            doubt: 0,
            asleep_at: (body.state.sleeping)
                .then(|| convert::region_from_world(self.anchor, &body.state.pose)),
        });
        self.by_id.insert(body.id, handle);
        let link = Link { id: body.id, handle };
        self.list(link);
        if role == Role::Owner {
            self.fresh.push(link);
        }
        let tied = |joint: &JointRecord| joint.a == body.id || joint.b == body.id;
        for joint in self.waiting.values().filter(|joint| tied(joint)).cloned().collect::<Vec<_>>() {
            self.insert_joint(&joint);
        }
        Ok(handle)
    }

    /// Takes a body out, with its joints. Returns whether it was held here.
    pub(super) fn remove(&mut self, id: BodyId) -> bool {
        let Some(handle) = self.handle_of(id) else { return false };
        let joints: Vec<_> = self.joints_of(handle).collect();
        for joint in &joints {
            self.remove_joint(joint.id);
        }
        self.by_id.remove(&id);
        // What is still held here waits for it.
        joints.iter().for_each(|joint| self.insert_joint(joint));
        self.watch.forget(id);
        self.guide.forget(handle);
        self.fresh.retain(|link| link.handle != handle);
        self.moved.take();
        self.remove_from_rapier(handle);
        self.slots[handle.into_raw_parts().0 as usize] = None;
        self.unlist(id);
        true
    }

    /// Changes who owns a body that is held here, and who else holds it.
    pub(super) fn set_role(&mut self, handle: RigidBodyHandle, role: Role, holders: RegionSet, epoch: Epoch) {
        let slot = self.slot_mut(handle);
        assert!(epoch >= slot.epoch, "{} would go back from epoch {} to {epoch}", slot.id, slot.epoch);
        (slot.role, slot.epoch) = (role, epoch);
        slot.asleep_at = None;
        slot.told_asleep = false;
        self.due[handle.into_raw_parts().0 as usize] = 0;
        self.set_holders(handle, holders);
        self.relink(handle);
    }

    /// Changes which other regions hold a body.
    pub(super) fn set_holders(&mut self, handle: RigidBodyHandle, holders: RegionSet) {
        self.touch(handle);
        let slot = self.slot_mut(handle);
        slot.holders = holders;
        let link = Link { id: slot.id, handle };
        self.unlist(link.id);
        self.list(link);
    }

    /// Membership changed: who holds replicas of this region's bodies, and whether its own replicas are still right, must
    /// be told again.
    pub(super) fn forget_holders(&mut self, regions: usize, steps: usize) {
        self.fresh.clear();
        self.border = Border::new(regions, steps);
        self.guide.reset();
        for Link { id, handle } in self.links() {
            let kept = coupling::make_whole(self, handle);
            let slot = self.slot_mut(handle);
            match slot.role {
                Role::Owner => {
                    slot.holders = kept;
                    self.fresh.push(Link { id, handle });
                }
                Role::Replica { .. } => slot.confirmed = false,
                Role::Immovable => {}
            }
        }
        self.shared.clear();
    }

    /// Lets a user change the body in place, whole even where it is shared; reads its traits anew, and lets the coupling
    /// look at it soon.
    pub(super) fn change<R>(
        &mut self,
        handle: RigidBodyHandle,
        change: impl FnOnce(&mut RigidBody) -> R,
    ) -> R {
        self.touch(handle);
        // A dynamic body that is something else in Rapier is a ghost of the coupling, which its user must not see.
        let ghost = self.world.bodies[handle].body_type();
        let is_ghost = self.slot(handle).traits.kind == BodyKind::Dynamic && ghost != RigidBodyType::Dynamic;
        if is_ghost {
            self.world.bodies[handle].set_body_type(RigidBodyType::Dynamic, false);
        }
        let result = coupling::whole(self, handle, change);
        if is_ghost && self.slot(handle).traits.kind == BodyKind::Dynamic {
            self.world.bodies[handle].set_body_type(ghost, false);
        }
        result
    }

    /// Reads a body's traits anew.
    pub(super) fn refresh(&mut self, handle: RigidBodyHandle) {
        self.due[handle.into_raw_parts().0 as usize] = 0;
        let old = &self.slot(handle).traits;
        let new = record::traits_of(&self.world.bodies[handle], old.colliders.clone());
        if new != **old {
            self.guide.note(handle, new.kind);
            self.slot_mut(handle).traits = Arc::new(new);
        }
    }

    /// Changes one collider of a body, and its record with it. `None` if the body has no such collider. A shape that cannot
    /// travel is refused: the collider keeps the one that it has.
    pub(super) fn update_collider<R>(
        &mut self,
        handle: RigidBodyHandle,
        index: usize,
        shapes: &mut ShapeLibrary,
        change: impl FnOnce(&mut Collider) -> R,
    ) -> Option<Result<R, ShapeError>> {
        let collider = *self.world.bodies[handle].colliders().get(index)?;
        self.touch(handle);
        Some(coupling::whole_colliders(self, handle, |region| {
            let slot = region.slots[handle.into_raw_parts().0 as usize].as_mut().expect("a body held here");
            region.stirred = true;
            let (body, own) = (&mut region.world.bodies[handle], &mut region.world.colliders[collider]);
            let old = &slot.traits.colliders[index];
            let (mass, was_enabled) = (own.mass_properties(), own.is_enabled());
            let (shape, place) = (own.shared_shape().clone(), own.position_wrt_parent().copied());
            own.set_contact_force_event_threshold(old.force_event_threshold_n);
            let mut result = Ok(change(own));
            let shape_now = if Arc::ptr_eq(&own.shared_shape().0, &shape.0) {
                old.shape
            } else {
                shapes.intern(own.shared_shape()).unwrap_or_else(|error| {
                    own.set_shape(shape);
                    result = Err(error);
                    old.shape
                })
            };
            let mut new = record::renewed(old, own, own.mass_properties() != mass);
            new.shape = shape_now;
            if let Some(now) = own.position_wrt_parent().filter(|&&now| Some(now) != place) {
                new.pose = convert::pose_record(now);
            }
            // Rapier's colliders of a disabled body do not tell whether their user wants them.
            if !body.is_enabled() && own.is_enabled() == was_enabled {
                new.enabled = old.enabled;
            }
            region.watch.name(own, collider, (slot.id, index as u16), &new);
            if new != *old {
                Arc::make_mut(&mut slot.traits).colliders[index] = new;
            }
            body.recompute_mass_properties_from_colliders(&region.world.colliders);
            // Its skin may reach farther than before.
            slot.reach_m = record::reach_of(body, &region.world.colliders);
            slot.outline = Outline::of(body, &region.world.colliders);
            region.due[handle.into_raw_parts().0 as usize] = 0;
            result
        }))
    }

    /// Finds again which bodies joints tie together, if joints changed.
    pub(super) fn update_assemblies(&mut self) {
        if !std::mem::take(&mut self.assemblies_stale) {
            return;
        }
        for assembly in std::mem::take(&mut self.assemblies) {
            for link in assembly.members {
                if self.handle_of(link.id) == Some(link.handle) {
                    self.slot_mut(link.handle).assembly = None;
                }
            }
        }
        let movable = |id: BodyId| {
            let handle = self.handle_of(id)?;
            (self.slot(handle).traits.kind != BodyKind::Fixed).then_some(Link { id, handle })
        };
        let ties: Vec<_> = self
            .joints
            .values()
            .filter_map(|joint| Some((movable(joint.record.a)?, movable(joint.record.b)?)))
            .collect();
        let single = self.joints.values().filter_map(|joint| {
            // A body tied to something immovable is an assembly of one: its joint must travel with it.
            movable(joint.record.a).xor(movable(joint.record.b))
        });
        self.assemblies = assembly::connect(ties.into_iter().chain(single.map(|link| (link, link))));
        for index in 0..self.assemblies.len() {
            let members = std::mem::take(&mut self.assemblies[index].members);
            for member in &members {
                self.slot_mut(member.handle).assembly = Some(index as u32);
            }
            let is_link = |id: &JointId| self.joints.get(id).is_some_and(|joint| joint.record.link.is_some());
            let articulated = members.iter().any(|link| self.slot(link.handle).joints.iter().any(is_link));
            self.assemblies[index] = Assembly { members, articulated };
        }
    }

    /// Whether the body is part of a multibody, or tied to one.
    pub(super) fn is_articulated(&self, handle: RigidBodyHandle) -> bool {
        let assembly = self.slot(handle).assembly;
        assembly.is_some_and(|index| self.assemblies[index as usize].articulated)
    }

    /// Puts a body on the list of its role.
    fn list(&mut self, link: Link) {
        let slot = self.slot(link.handle);
        let list = match slot.role {
            Role::Owner if !slot.holders.is_empty() => &mut self.shared,
            Role::Replica { .. } => &mut self.replicas,
            _ => return,
        };
        if let Err(place) = list.binary_search_by_key(&link.id, |other| other.id) {
            list.insert(place, link);
        }
    }

    fn unlist(&mut self, id: BodyId) {
        for list in [&mut self.shared, &mut self.replicas] {
            if let Ok(place) = list.binary_search_by_key(&id, |other| other.id) {
                list.remove(place);
            }
        }
    }
}

/// As snapshots have it: equal regions, equal bytes.
fn in_id_order<S: Serializer>(
    by_id: &HashMap<BodyId, RigidBodyHandle>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    by_id.iter().collect::<BTreeMap<_, _>>().serialize(serializer)
}
