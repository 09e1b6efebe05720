//! Defines one region: a Rapier world with its own origin (anchor), and the ownership of the bodies in it.

mod assembly;
mod awake;
mod change;
mod characters;
mod contact_offsets;
mod contacts;
mod contents;
mod cow_world;
mod floating_origin;
mod id_hash;
mod iterations;
mod kinematic_targets;
mod lever_arms;
mod mass_splitting;
mod moved;
mod place;
mod profile;
#[cfg(feature = "net")]
mod put;
mod read;
mod refine;
mod sleepers;
mod slot;
mod step;
mod step_time;
mod struck;
mod ties;
mod urgency;
mod vehicles;

pub(super) use assembly::Assembly;
pub(super) use floating_origin::better_anchor;
pub(super) use moved::Moved;
pub use profile::Profile;
pub use slot::Ownership;
pub(super) use slot::{BodyRef, Slot};

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize, Serializer};

use self::assembly::Assemblies;
use self::awake::ChangedSleep;
use self::characters::Walking;
use self::cow_world::CowWorld;
use self::id_hash::IdHash;
use self::kinematic_targets::KinematicTargets;
use self::refine::Findings;
use self::sleepers::Turnover;
use self::step_time::StepTime;
use self::ties::{HeldJoint, JointNews};
use self::vehicles::Driving;
use super::contact_listener::ContactListener;
use super::convert;
use super::hooks::ContactHooks;
use super::partition::HUB_REACH_M;
use crate::protocol::{BodyKind, BodyTraits, ContactForce, JointRecord, RegionEvents};
use crate::space::{BodyId, Bounds, Cell, JointId, RegionId, Tick};

#[cfg(test)]
thread_local! {
    /// The number of times that a region was asked for the handle of a body.
    pub(super) static LOOKS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// How far beyond the cell immovable bodies are held, metres, so that bodies that reach out of it find their
/// ground.
const COVER_M: f64 = 4.0 * HUB_REACH_M as f64;

/// A leaf of the distribution tree with its Rapier world.
#[derive(Clone, Serialize, Deserialize)]
pub struct Region {
    id: RegionId,
    rank: usize,
    cell: Cell,
    anchor: [f64; 3],
    world: CowWorld,
    /// The slots of bodies, by Rapier's body index.
    slots: Vec<Option<Slot>>,
    /// The slot at which [`Region::owns_any`] looks first.
    #[serde(skip)]
    owned_at: usize,
    /// For look-ups only: iteration goes by [`Region::links`], in id order. A map of one block leaves
    /// Rapier's own small blocks side by side in memory.
    #[serde(serialize_with = "in_id_order")]
    by_id: HashMap<BodyId, RigidBodyHandle, IdHash>,
    /// Bodies owned here and held by other regions too, in id order.
    shared: Vec<BodyRef>,
    /// Bodies owned elsewhere, in id order.
    ghosts: Vec<BodyRef>,
    assemblies: Assemblies,
    joints: BTreeMap<JointId, HeldJoint>,
    /// Joints of bodies held here to bodies that are not, in id order.
    waiting: BTreeMap<JointId, JointRecord>,
    joint_news: JointNews,
    /// Immovable bodies that touch this box are held here.
    covered: Bounds,
    listener: ContactListener,
    targets: KinematicTargets,
    /// The characters held here.
    characters: BTreeMap<BodyId, Walking>,
    vehicles: BTreeMap<BodyId, Driving>,
    /// The speed at which each wheel of a vehicle rolled in its last substep, rad/s; none in the air.
    #[serde(skip)]
    spins: BTreeMap<BodyId, Vec<Option<f32>>>,
    /// The number of bodies held here that are met more finely than others, by [`urgency::is_delicate`].
    delicate: usize,
    /// The number of bodies held here that nothing can move; `None` until it is asked for.
    #[serde(skip)]
    immovable: Option<usize>,
    /// The dynamic bodies that characters held here stood on in their last walk, in order of Rapier's handles.
    #[serde(skip)]
    walked_on: Vec<RigidBodyHandle>,
    quarantined: Vec<BodyId>,
    /// Says whether bodies were quarantined in silent steps: the first tick has to tell of these.
    #[serde(skip)]
    quarantined_before: bool,
    /// The user's hooks that are asked about contacts.
    #[serde(skip)]
    hooks: Option<Arc<dyn ContactHooks>>,
    events: RegionEvents,
    /// Says whether anything was changed here, or received from other regions, since the last step.
    stirred: bool,
    /// Says whether its cell has changed since it last looked for sleeping bodies that lie in another cell.
    passed_over: bool,
    /// Says whether it rests in the present tick.
    rests: bool,
    /// Bodies inserted here as its own that no exchange has announced yet; some may be gone again.
    fresh: Vec<BodyRef>,
    /// Bodies of its own that their user has sped up since the last step.
    launched: Vec<BodyRef>,
    /// Bodies of its own that their user has put elsewhere since the last step, or has let touch what they did not.
    appeared: Vec<BodyRef>,
    /// Bodies that are not dynamic and that have been inserted since the last step, or that their user has put elsewhere
    /// or has let touch what they did not; some may be gone again.
    obstacles: Vec<RigidBodyHandle>,
    /// The tick from which on the coupling must check each body again for nearness to a border, by Rapier's
    /// body index. Kept apart from the slots, so that passing over a body far from any border touches four
    /// bytes.
    due: Vec<u32>,
    /// The time that its steps take.
    #[serde(skip)]
    time: StepTime,
    /// The length of the substep in which Rapier solved each body's contacts last, in seconds, by Rapier's
    /// body index. Empty as long as all substeps have had one length.
    solved_dt_s: Vec<f32>,
    /// The length of the solver iterations by which Rapier solved each body last, in seconds, by Rapier's
    /// body index. Empty as long as all iterations have had one length.
    iterations_s: Vec<f32>,
    findings: Findings,
    /// The ticks in which it may still not stay behind, since its user has changed something there.
    attended: u8,
    /// Bodies inserted or changed since the last step, perhaps more than once.
    touched: Vec<RigidBodyHandle>,
    changed_sleep: ChangedSleep,
    /// Bodies that their user has put to sleep since the last step.
    put_to_sleep: Vec<RigidBodyHandle>,
    turnover: Turnover,
    /// The movable bodies that Rapier does not step, since they are disabled or fixed, by Rapier's body
    /// index.
    #[serde(skip)]
    unstepped: BTreeMap<u32, RigidBodyHandle>,
    /// The number of changes of what is held here, of where it is, and of what touches; and the same after
    /// the last step.
    #[serde(skip)]
    revision: u64,
    #[serde(skip)]
    stepped: u64,
    #[serde(skip)]
    moved: OnceLock<Box<Moved>>,
    #[serde(skip)]
    profile: Profile,
}

impl Region {
    pub(super) fn new(id: RegionId, rank: usize, cell: Cell, part: &Bounds, gravity: [f32; 3]) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = convert::vector(gravity);
        Self {
            id,
            rank,
            cell,
            anchor: convert::anchor_of(part.centre()),
            world: CowWorld::new(world),
            slots: Vec::new(),
            by_id: HashMap::default(),
            owned_at: 0,
            shared: Vec::new(),
            ghosts: Vec::new(),
            assemblies: Assemblies::default(),
            joints: BTreeMap::new(),
            waiting: BTreeMap::new(),
            joint_news: JointNews::default(),
            covered: Bounds { min: cell.min, max: cell.max }.grown(COVER_M),
            listener: ContactListener::default(),
            targets: KinematicTargets::default(),
            characters: BTreeMap::new(),
            vehicles: BTreeMap::new(),
            spins: BTreeMap::new(),
            delicate: 0,
            immovable: None,
            walked_on: Vec::new(),
            quarantined: Vec::new(),
            quarantined_before: false,
            hooks: None,
            events: RegionEvents { region: id, ..RegionEvents::default() },
            stirred: true,
            passed_over: false,
            rests: false,
            fresh: Vec::new(),
            launched: Vec::new(),
            appeared: Vec::new(),
            obstacles: Vec::new(),
            due: Vec::new(),
            time: StepTime::default(),
            solved_dt_s: Vec::new(),
            iterations_s: Vec::new(),
            findings: Findings::default(),
            attended: 0,
            touched: Vec::new(),
            changed_sleep: ChangedSleep::default(),
            put_to_sleep: Vec::new(),
            turnover: Turnover::default(),
            unstepped: BTreeMap::new(),
            revision: 0,
            stepped: 0,
            moved: OnceLock::new(),
            profile: Profile::default(),
        }
    }

    /// Returns the id of its leaf of the distribution tree.
    pub fn id(&self) -> RegionId {
        self.id
    }

    /// Returns its rank: its position among the leaves in id order.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Returns its cell, a half-open box; outer faces lie at infinity.
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// Returns the region's origin (anchor): the origin of its region space, in world space.
    pub fn anchor(&self) -> [f64; 3] {
        self.anchor
    }

    /// Returns its Rapier world: positions are relative to the anchor, ghosts are among the bodies.
    #[inline]
    pub fn physics(&self) -> &PhysicsWorld {
        &self.world
    }

    /// Returns every body held here, in no order, with its ownership.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyId, Ownership, RigidBodyHandle, &RigidBody)> {
        self.by_id
            .iter()
            .map(|(&id, &handle)| (id, self.slot(handle).role, handle, &self.world.bodies[handle]))
    }

    /// Returns the traits of every body held here, in no order.
    pub(super) fn all_traits(&self) -> impl Iterator<Item = &BodyTraits> {
        self.slots.iter().flatten().map(|slot| &*slot.traits)
    }

    /// Returns every body held here, in id order.
    fn links(&self) -> Vec<BodyRef> {
        let mut links: Vec<_> = self.by_id.iter().map(|(&id, &handle)| BodyRef { id, handle }).collect();
        links.sort_unstable_by_key(|link| link.id);
        links
    }

    /// Returns the id and the ownership of the body behind a handle of [`Region::physics`].
    #[inline]
    pub fn role_of(&self, handle: RigidBodyHandle) -> Option<(BodyId, Ownership)> {
        self.slot_at(handle).map(|slot| (slot.id, slot.role))
    }

    /// Returns how many bodies it owns.
    pub fn owned_count(&self) -> usize {
        self.slots.iter().flatten().filter(|slot| slot.role == Ownership::Owner).count()
    }

    /// Returns whether it owns any body. It first looks where it last found one: bodies come and go one by
    /// one.
    pub(super) fn owns_any(&mut self) -> bool {
        let is_owned = |slot: &Option<Slot>| slot.as_ref().is_some_and(|slot| slot.role == Ownership::Owner);
        let from = self.owned_at.min(self.slots.len());
        let found = self.slots[from..].iter().position(is_owned).map(|place| from + place);
        let found = found.or_else(|| self.slots[..from].iter().position(is_owned));
        self.owned_at = found.unwrap_or(self.owned_at);
        found.is_some()
    }

    /// Returns how many of the bodies that it owns are awake.
    pub fn awake_count(&self) -> usize {
        let owned = |handle| self.slot_at(handle).is_some_and(|slot| slot.role == Ownership::Owner);
        self.world.islands.active_bodies().filter(|&handle| owned(handle)).count()
    }

    /// Returns the wall time that its steps took in the last tick, without that of applying messages; zero if
    /// it rested.
    pub fn last_step(&self) -> Duration {
        if self.rests { Duration::ZERO } else { self.time.last() }
    }

    /// Returns how many bodies it holds that other regions own.
    pub fn ghost_count(&self) -> usize {
        self.ghosts.len()
    }

    /// Returns the bodies whose copies here Rapier quarantined in the last tick, because their numbers were
    /// not finite.
    pub fn quarantined(&self) -> &[BodyId] {
        &self.quarantined
    }

    /// Returns the bodies owned here that other regions hold too, in id order.
    pub(super) fn shared(&self) -> &[BodyRef] {
        &self.shared
    }

    /// Returns the bodies owned elsewhere that are held here, in id order.
    pub(super) fn ghosts(&self) -> &[BodyRef] {
        &self.ghosts
    }

    /// Returns all bodies held here and elsewhere.
    pub(super) fn held_elsewhere(&self) -> impl Iterator<Item = BodyRef> {
        self.shared.iter().chain(&self.ghosts).copied()
    }

    /// Returns how many bodies are held here and elsewhere: for callers that change them one by one, by place.
    pub(super) fn held_elsewhere_count(&self) -> usize {
        self.shared.len() + self.ghosts.len()
    }

    /// Returns the body at a place below [`Region::held_elsewhere_count`].
    pub(super) fn held_elsewhere_at(&self, place: usize) -> BodyRef {
        let owned = self.shared.len();
        if place < owned { self.shared[place] } else { self.ghosts[place - owned] }
    }

    /// Returns the next body held here and elsewhere, in id order, and counts it. `before` are the numbers of
    /// those counted already: owned here, and owned by others.
    pub(super) fn next_held_elsewhere(&self, before: &mut (usize, usize)) -> Option<BodyRef> {
        let next = (self.shared.get(before.0), self.ghosts.get(before.1));
        let is_own = match next {
            (Some(own), Some(other)) => own.id < other.id,
            (own, _) => own.is_some(),
        };
        *(if is_own { &mut before.0 } else { &mut before.1 }) += 1;
        (if is_own { next.0 } else { next.1 }).copied()
    }

    /// Returns the bodies inserted as this region's own, and still here, that no exchange has announced yet.
    pub(super) fn fresh(&self) -> impl Iterator<Item = BodyRef> {
        self.fresh.iter().copied().filter(|link| self.world.bodies.contains(link.handle))
    }

    /// Takes the bodies of [`Region::fresh`]: an exchange announces them.
    pub(super) fn take_fresh(&mut self) -> Vec<BodyRef> {
        let fresh = self.fresh().collect();
        self.fresh.clear();
        fresh
    }

    /// Puts the bodies of [`Region::fresh`] into id order, in which an exchange announces them.
    pub(super) fn order_fresh(&mut self) {
        self.fresh.sort_unstable_by_key(|link| link.id);
    }

    /// Leaves a body to the next exchange, which announces it.
    pub(super) fn keep_fresh(&mut self, link: BodyRef) {
        self.fresh.push(link);
    }

    /// Takes the bodies that their user has sped up since the last step; some may be gone again, or another region's.
    pub(super) fn take_launched(&mut self) -> Vec<BodyRef> {
        std::mem::take(&mut self.launched)
    }

    /// Notes that a user has sped up a body owned here, if it is faster than `before`.
    fn note_launch(&mut self, handle: RigidBodyHandle, before: Vector) {
        let is_faster = self.world.bodies[handle].linvel().length_squared() > before.length_squared();
        if is_faster && self.slot(handle).role == Ownership::Owner {
            self.launched.push(BodyRef { id: self.slot(handle).id, handle });
        }
    }

    /// Takes the bodies that their user has put elsewhere since the last step, or has let touch what they did not; some
    /// may be gone again, or another region's.
    pub(super) fn take_appeared(&mut self) -> Vec<BodyRef> {
        std::mem::take(&mut self.appeared)
    }

    /// Notes that a user has put a body owned here elsewhere, or has let it touch what it did not.
    fn note_appearance(&mut self, handle: RigidBodyHandle) {
        if self.slot(handle).role == Ownership::Owner {
            self.appeared.push(BodyRef { id: self.slot(handle).id, handle });
        }
        if self.slot(handle).traits.kind != BodyKind::Dynamic {
            self.obstacles.push(handle);
        }
    }

    /// Returns the awake bodies that the coupling must check in a tick: those whose rest is over, and those that are faster
    /// than this, m/s, since a collision may just have set them off.
    pub(super) fn due(&self, tick: Tick, fast_m_s: f32) -> impl Iterator<Item = RigidBodyHandle> {
        let now = tick.0 as u32;
        let is_due = move |handle: RigidBodyHandle| self.due[handle.into_raw_parts().0 as usize] <= now;
        let awake = self.world.islands.active_bodies();
        let is_fast = move |handle: RigidBodyHandle| self.world.bodies[handle].linvel().length() > fast_m_s;
        awake.filter(move |&handle| is_due(handle) || is_fast(handle))
    }

    /// Returns whether a body moves so far in a tick that it may jump over what it would hit, or come to lie deep in it
    /// before that is known to be there.
    pub(super) fn flies(&self, handle: RigidBodyHandle, tick_s: f32) -> bool {
        let way_m = self.world.bodies[handle].linvel().length() * tick_s;
        way_m > self.leap_m(handle) && way_m.is_finite()
    }

    /// Returns the way in a tick beyond which a body flies, metres: a quarter of its radius.
    pub(super) fn leap_m(&self, handle: RigidBodyHandle) -> f32 {
        0.25 * self.slot(handle).reach_m
    }

    /// Exempts a body from checks until a tick, unless it is changed.
    pub(super) fn rest_until(&mut self, handle: RigidBodyHandle, tick: u32) {
        self.due[handle.into_raw_parts().0 as usize] = tick;
    }

    /// Returns whether nothing here can change by itself in the tick to come: all that it holds sleeps, and
    /// nothing has stirred it. Decisions on bodies that others hold too are another matter.
    pub(super) fn is_idle(&self) -> bool {
        !self.stirred && self.world.islands.active_bodies().next().is_none() && self.fresh().next().is_none()
    }

    /// Notes that something that concerns the region was received from others: it is not idle.
    pub(super) fn stir(&mut self) {
        self.stirred = true;
    }

    /// Notes that something was changed here.
    fn unsettle(&mut self) {
        self.stirred = true;
        self.revision += 1;
    }

    /// Returns a number that changes with every change of what is held here, of where it is, and of what
    /// touches.
    pub(super) fn revision(&self) -> u64 {
        self.revision
    }

    /// Returns whether it rests in the present tick: it is not stepped.
    pub(super) fn rests(&self) -> bool {
        self.rests
    }

    /// Begins a tick, in which it rests or not.
    pub(super) fn begin_tick(&mut self, rests: bool) {
        self.rests = rests;
        self.profile = Profile::default();
        if rests {
            self.forget_quarantined();
        }
    }

    /// Forgets which copies were quarantined in the last tick.
    fn forget_quarantined(&mut self) {
        if !std::mem::take(&mut self.quarantined_before) {
            self.quarantined.clear();
        }
    }

    /// Returns the profile of the last tick, zero if it rested, and with counts of what there is now.
    pub(super) fn profile(&self) -> Profile {
        self.profile.with(&self.world)
    }

    /// Sets the hooks that are asked about contacts from now on.
    pub(super) fn set_hooks(&mut self, hooks: Option<Arc<dyn ContactHooks>>) {
        self.hooks = hooks;
    }

    /// Returns the contact events since [`Region::clear_events`].
    pub(super) fn events(&self) -> &RegionEvents {
        &self.events
    }

    /// Forgets all contact events.
    pub(super) fn clear_events(&mut self) {
        self.events.touches.clear();
        self.events.forces.clear();
    }

    /// Returns the handle of a body, if it is held here.
    pub fn handle_of(&self, id: BodyId) -> Option<RigidBodyHandle> {
        #[cfg(test)]
        LOOKS.set(LOOKS.get() + 1);
        self.by_id.get(&id).copied()
    }

    /// Takes the contact forces since [`Region::clear_events`].
    pub(super) fn take_forces(&mut self) -> Vec<ContactForce> {
        std::mem::take(&mut self.events.forces)
    }

    /// Returns whether a body is held here.
    pub(super) fn holds(&self, id: BodyId) -> bool {
        self.by_id.contains_key(&id)
    }

    /// Makes the next copy of the region share its Rapier world until one of them changes it.
    pub(super) fn share(&mut self) {
        self.world.share();
    }

    /// Returns whether the region and a copy of it still share one Rapier world.
    #[cfg(test)]
    pub(crate) fn shares(&self, other: &Self) -> bool {
        std::ptr::eq(self.physics(), other.physics())
    }

    pub(super) fn world_mut(&mut self) -> &mut PhysicsWorld {
        self.unsettle();
        self.moved.take();
        &mut self.world
    }

    /// Returns the colliders that are not where Rapier's own queries would find them.
    pub(super) fn moved(&self) -> &Moved {
        self.moved.get_or_init(|| Box::new(Moved::of(self, &self.touched)))
    }

    #[inline]
    pub(super) fn slot(&self, handle: RigidBodyHandle) -> &Slot {
        self.slot_at(handle).expect("every body of a region has a slot")
    }

    #[inline]
    pub(super) fn slot_mut(&mut self, handle: RigidBodyHandle) -> &mut Slot {
        let index = handle.into_raw_parts().0 as usize;
        self.slots[index].as_mut().expect("every body of a region has a slot")
    }

    /// Returns an upper bound of Rapier's body indices here.
    pub(super) fn index_bound(&self) -> usize {
        self.slots.len()
    }

    #[inline]
    fn slot_at(&self, handle: RigidBodyHandle) -> Option<&Slot> {
        self.slots.get(handle.into_raw_parts().0 as usize)?.as_ref()
    }

    /// Returns the groups of bodies that joints tie together, in no order; empty ones are no groups.
    pub(super) fn assemblies(&self) -> &[Assembly] {
        &self.assemblies.all
    }

    /// Returns whether any body here is kinematic.
    pub(super) fn has_kinematic(&self) -> bool {
        self.targets.any_kinematic()
    }

    /// Returns whether joints hold the body.
    pub(crate) fn is_jointed(&self, handle: RigidBodyHandle) -> bool {
        !self.slot(handle).joints.is_empty()
    }

    /// Returns whether the body is part of a multibody, or tied to one.
    pub(super) fn is_articulated(&self, handle: RigidBodyHandle) -> bool {
        let assembly = self.slot(handle).assembly;
        assembly.is_some_and(|index| self.assemblies.all[index as usize].articulated)
    }
}

/// Serializes in id order, so that snapshots of equal regions have equal bytes.
fn in_id_order<S: Serializer>(
    by_id: &HashMap<BodyId, RigidBodyHandle, IdHash>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    by_id.iter().collect::<BTreeMap<_, _>>().serialize(serializer)
}
