//! A body that lives in several regions: each copy has its share of the mass, and is pressed by its share of the user's
//! force and by what evens out the edges of the overlap.

use rapier3d::dynamics::RigidBodyAdditionalMassProps;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use crate::physics::convert;
use crate::physics::record;
use crate::physics::region::{Link, Region};
use crate::physics::renumber::Renumbering;
use crate::protocol::{BodyKind, BodyTraits, Check, ColliderMass, CopyState, ExtraMass, MassRecord};
use crate::space::RegionSet;

/// What a region knows of a body that it shares with others.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Shared {
    /// All that hold it as of the last exchange, this region too.
    pub members: RegionSet,
    /// Those of them whose copies do not count: they follow the others', to have their contacts when they come to count.
    pub shadows: RegionSet,
    /// By how many its mass is divided: the members that count.
    pub parts: usize,
    /// Rapier has set the copy here aside, as its numbers were no longer finite: the others' mean restores it.
    pub broken: bool,
    /// What the user presses on the whole body.
    pub user_force: Vector,
    pub user_torque: Vector,
    /// The other members' copies as last heard, by rank.
    pub heard: Vec<(usize, CopyState)>,
    /// This region's copy after the last step.
    pub own: CopyState,
    /// What evens out the edges of the overlap: on this copy, until the next exchange.
    pub push: Vector,
    pub twist: Vector,
    /// How the copy began the steps since the last exchange.
    pub start: Option<Start>,
    /// Whether it has followed the others since it came to be held here. What came as its owner had it may be other than what all
    /// agreed on in that exchange, so what becomes of it in the first step is nobody's word.
    pub followed: bool,
    /// Rank of the region whose word stood in the last exchange, unless the body is split.
    pub led_by: Option<usize>,
    /// How far the velocities of shadows were from what they follow, m/s; told to the owner.
    pub strayed_m_s: f32,
    /// Ticks since members changed.
    pub settled: u32,
    /// Ticks for which bodies of other regions have belonged to its island.
    pub joined: u32,
    /// Ticks for which some member has had no reason to be one.
    pub idle: u32,
    /// Ticks for which another region has been to own it.
    pub away: u32,
}

impl Shared {
    /// Whether several copies count, each with its share of the mass; else the owner's does, and the others are ghosts of it.
    pub(in crate::physics) fn is_split(&self) -> bool {
        self.members.without(self.shadows).len() > 1
    }

    /// Ranks have changed.
    pub(in crate::physics) fn renumber(&mut self, ranks: &Renumbering) {
        (self.members, self.shadows) = (ranks.set(self.members), ranks.set(self.shadows));
        for (rank, _) in &mut self.heard {
            *rank = ranks.rank(*rank);
        }
        self.heard.sort_by_key(|(rank, _)| *rank);
        self.led_by = self.led_by.and_then(|rank| ranks.to[rank]);
    }
}

/// Velocities at the beginning of the steps between two exchanges.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::physics) struct Start {
    linear: Vector,
    /// As gyroscopic forces alone would have it at the end.
    angular: Vector,
    elapsed_s: f32,
}

/// A remembered force may grow by this factor a step; more is an impact, and no load to be evened out.
const IMPACT: f32 = 4.0;
/// The memory of forces follows in this part of a tick, however many exchanges the tick has. What contacts press in shorter
/// steps is rougher, and copies that answer to it at once drive each other apart: four exchanges squeezed boxes out from under a
/// hundred courses and felled towers of 100:1, eight those of 10:1, all of which two held.
const FORCE_MEMORY_TICKS: f32 = 0.5;
/// By how much at most the memory of torques follows in an exchange. With more than two a tick it must follow still more slowly
/// than that of forces: as the square did for up to sixteen, where a slowness in proportion fell at eight.
const TORQUE_MEMORY: f32 = 0.3;

/// Presses on every copy what it must feel in the step to come, and remembers how it starts.
pub(super) fn prepare(region: &mut Region, dt_s: f32) {
    for index in 0..region.shared.len() + region.replicas.len() {
        let link = held(region, index);
        let Some(mut shared) = region.slot_mut(link.handle).shared.take() else { continue };
        let body = &region.physics().bodies[link.handle];
        if body.is_dynamic() && !body.is_sleeping() {
            let start = shared.start.get_or_insert_with(|| Start {
                linear: body.linvel(),
                angular: body.angvel_with_gyroscopic_forces(dt_s),
                elapsed_s: 0.0,
            });
            start.elapsed_s += dt_s;
            press(region, link.handle, &shared);
        }
        region.slot_mut(link.handle).shared = Some(shared);
    }
}

/// The `index`-th of all bodies that other regions hold too.
pub(super) fn held(region: &Region, index: usize) -> Link {
    let owned = region.shared.len();
    if index < owned { region.shared[index] } else { region.replicas[index - owned] }
}

/// Makes Rapier's forces on the copy what they must be.
fn press(region: &mut Region, handle: RigidBodyHandle, shared: &Shared) {
    let parts = shared.parts.max(1) as f32;
    let (force, torque) =
        (shared.user_force / parts + shared.push, shared.user_torque / parts + shared.twist);
    let body = &region.physics().bodies[handle];
    if body.user_force() == force && body.user_torque() == torque {
        return;
    }
    let body = &mut region.world_mut().bodies[handle];
    body.reset_forces(false);
    body.reset_torques(false);
    body.add_force(force, false);
    body.add_torque(torque, false);
}

/// Reads the copy after a step: its state, and what contacts and joints pressed on it since the last exchange.
pub(super) fn read(region: &Region, handle: RigidBodyHandle, shared: &mut Shared, tick_s: f32) {
    let (slot, body) = (region.slot(handle), &region.physics().bodies[handle]);
    if shared.broken {
        shared.own = CopyState { id: slot.id, ..CopyState::default() };
        return;
    }
    let (force, torque) = strain(body, region.physics().gravity, shared, tick_s);
    let own = CopyState {
        id: slot.id,
        pose: convert::world_from_region(region.anchor(), body.position()),
        velocity: convert::velocity_of(body),
        sleeping: body.is_sleeping(),
        force_n: force.to_array(),
        torque_nm: torque.to_array(),
        sound: true,
        partners: if body.is_dynamic() && shared.is_split() { partners(region, handle) } else { 0 },
        ..CopyState::default()
    };
    // What cannot be told says nothing, as a copy that Rapier has set aside.
    let unsound = CopyState { id: slot.id, ..CopyState::default() };
    shared.own = if own.check().is_ok() { own } else { unsound };
}

/// Rapier has set every copy aside: so is the body, until its user enables it.
pub(super) fn set_aside(region: &mut Region, handle: RigidBodyHandle, shared: &mut Shared) {
    (shared.user_force, shared.user_torque) = (Vector::ZERO, Vector::ZERO);
    region.refresh(handle);
}

/// Force and torque of contacts and joints: what moved the copy besides gravity and what we pressed on it.
fn strain(body: &RigidBody, gravity: Vector, shared: &Shared, tick_s: f32) -> (Vector, Vector) {
    let before = (Vector::from_array(shared.own.force_n), Vector::from_array(shared.own.torque_nm));
    // Frozen while asleep.
    let Some(start) = shared.start.filter(|_| body.is_dynamic() && !body.is_sleeping()) else {
        return before;
    };
    let (parts, mass) = (shared.parts.max(1) as f32, body.mass());
    let fall = gravity * body.gravity_scale();
    let gained = (body.linvel() - start.linear) / start.elapsed_s - fall;
    let mut force = gained * mass - shared.push - shared.user_force / parts;
    let spun = (body.angvel() - start.angular) / start.elapsed_s;
    let mut torque = inertia_times(body, spun) - shared.twist - shared.user_torque / parts;
    let most = IMPACT * (before.0.length() + mass * gravity.length().max(1.0));
    if force.length() > most {
        let cut = most / force.length();
        force *= cut;
        torque *= cut;
    }
    let follow = (start.elapsed_s / (FORCE_MEMORY_TICKS * tick_s)).min(1.0);
    let twist = TORQUE_MEMORY * follow * follow;
    (force * follow + before.0 * (1.0 - follow), before.1 + (torque - before.1) * twist)
}

fn inertia_times(body: &RigidBody, angular: Vector) -> Vector {
    let local = &body.mass_properties().local_mprops;
    let world_from_principal = *body.rotation() * local.principal_inertia_local_frame;
    world_from_principal * (local.principal_inertia() * (world_from_principal.inverse() * angular))
}

/// A hash of the names of the bodies that press on this one or are tied to it, the same in whatever order they come.
fn partners(region: &Region, handle: RigidBodyHandle) -> u64 {
    let world = region.physics();
    let mut hash = 0u64;
    for &collider in world.bodies[handle].colliders() {
        for pair in world.narrow_phase.contact_pairs_with(collider) {
            if !pair.has_any_active_contact() || pair.total_impulse_magnitude() == 0.0 {
                continue;
            }
            let other = if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
            let parent = world.colliders.get(other).and_then(Collider::parent);
            if let Some((id, _)) = parent.and_then(|parent| region.role_of(parent)) {
                hash = hash.wrapping_add(mixed(id.bits().wrapping_add(1)));
            }
        }
    }
    for joint in &region.slot(handle).joints {
        hash = hash.wrapping_add(mixed(!joint.0));
    }
    hash
}

/// Steele, Lea and Flood's SplitMix64 finaliser.
fn mixed(v: u64) -> u64 {
    let v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ (v >> 31)
}

/// Makes these regions the members: each copy has its share of the mass from now on. A body with one member is whole.
pub(super) fn set_members(
    region: &mut Region,
    handle: RigidBodyHandle,
    members: RegionSet,
    shadows: RegionSet,
) {
    let mut shared = region.slot_mut(handle).shared.take().unwrap_or_else(|| {
        let body = &region.physics().bodies[handle];
        Box::new(Shared {
            parts: 1,
            user_force: body.user_force(),
            user_torque: body.user_torque(),
            ..Shared::default()
        })
    });
    let counting = members.without(shadows);
    if (shared.members, shared.shadows) != (members, shadows) {
        (shared.settled, shared.joined, shared.idle) = (0, 0, 0);
        shared.heard.retain(|(rank, _)| members.contains(*rank));
        region.slot_mut(handle).told_asleep = false;
    }
    (shared.members, shared.shadows) = (members, shadows);
    let parts = if region.slot(handle).traits.kind == BodyKind::Dynamic { counting.len() } else { 1 };
    if shared.parts != parts {
        shared.parts = parts;
        divide(region, handle, parts);
    }
    let alone = members.len() == 1;
    if alone {
        (shared.push, shared.twist) = (Vector::ZERO, Vector::ZERO);
        press(region, handle, &shared);
    }
    let own = RegionSet::only(region.rank());
    region.set_holders(handle, members.without(own));
    region.slot_mut(handle).shared = (!alone).then_some(shared);
    for joint in region.slot(handle).joints.clone() {
        region.share_joint(joint);
    }
}

/// Undoes all sharing of a body. Returns which other regions held it.
pub(in crate::physics) fn make_whole(region: &mut Region, handle: RigidBodyHandle) -> RegionSet {
    if region.slot(handle).shared.is_none() {
        return RegionSet::EMPTY;
    }
    let holders = region.slot(handle).holders;
    set_members(region, handle, RegionSet::only(region.rank()), RegionSet::EMPTY);
    holders
}

/// A body has come to be held here, or is announced anew: no copies of others have been heard.
pub(super) fn begin(region: &mut Region, handle: RigidBodyHandle) {
    let body = &region.physics().bodies[handle];
    let (user_force, user_torque) = (body.user_force(), body.user_torque());
    let shared = region
        .slot_mut(handle)
        .shared
        .get_or_insert_with(|| Box::new(Shared { parts: 1, ..Shared::default() }));
    (shared.user_force, shared.user_torque) = (user_force, user_torque);
    shared.followed = false;
    shared.heard.clear();
}

/// Lets a user see and change the body whole: with all of its mass and none but the user's forces. Reads its traits anew.
pub(in crate::physics) fn whole<R>(
    region: &mut Region,
    handle: RigidBodyHandle,
    change: impl FnOnce(&mut RigidBody) -> R,
) -> R {
    let Some(mut shared) = region.slot_mut(handle).shared.take() else {
        let extra_mass = region.slot(handle).traits.extra_mass;
        let result = change(&mut region.world_mut().bodies[handle]);
        region.refresh(handle);
        if region.slot(handle).traits.extra_mass != extra_mass {
            // Rapier itself does so only when it steps.
            let PhysicsWorld { bodies, colliders, .. } = region.world_mut();
            bodies[handle].recompute_mass_properties_from_colliders(colliders);
        }
        return result;
    };
    let parts = shared.parts;
    let before = lift(region, handle, &mut shared);
    // To change colliders would wake the body, which its user may only look at, or have put to sleep. So all of the mass
    // stands in for what the body has besides its colliders.
    let all = all_of(region.physics().bodies[handle].mass_properties().local_mprops, parts);
    let body = &mut region.world_mut().bodies[handle];
    if parts > 1 {
        body.set_additional_mass_properties(all, false);
        body.recompute_mass_properties_from_colliders(&ColliderSet::new());
    }
    let result = change(body);
    let stood_in = RigidBodyAdditionalMassProps::MassProps(all);
    if parts > 1 && body.mass_properties().additional_local_mprops.as_deref() == Some(&stood_in) {
        let traits = region.slot(handle).traits.clone();
        divide_extra(&mut region.world_mut().bodies[handle], &traits, 1.0);
    }
    region.refresh(handle);
    shared.parts = parts_of(region, handle, &shared);
    if shared.parts == parts {
        let traits = region.slot(handle).traits.clone();
        let PhysicsWorld { bodies, colliders, .. } = region.world_mut();
        divide_extra(&mut bodies[handle], &traits, 1.0 / parts as f32);
        bodies[handle].recompute_mass_properties_from_colliders(colliders);
    } else {
        divide(region, handle, shared.parts);
    }
    lower(region, handle, shared, before);
    result
}

/// The same for its colliders, which have all of their mass meanwhile.
pub(in crate::physics) fn whole_colliders<R>(
    region: &mut Region,
    handle: RigidBodyHandle,
    change: impl FnOnce(&mut Region) -> R,
) -> R {
    let Some(mut shared) = region.slot_mut(handle).shared.take() else { return change(region) };
    let before = lift(region, handle, &mut shared);
    divide(region, handle, 1);
    let result = change(region);
    shared.parts = parts_of(region, handle, &shared);
    divide(region, handle, shared.parts);
    lower(region, handle, shared, before);
    result
}

/// Takes away what evens out the edges, and returns it.
fn lift(region: &mut Region, handle: RigidBodyHandle, shared: &mut Shared) -> (Vector, Vector) {
    let before = (shared.push, shared.twist);
    (shared.parts, shared.push, shared.twist) = (1, Vector::ZERO, Vector::ZERO);
    press(region, handle, shared);
    before
}

/// Undoes [`lift`], with the forces that the user left.
fn lower(region: &mut Region, handle: RigidBodyHandle, mut shared: Box<Shared>, before: (Vector, Vector)) {
    let body = &region.physics().bodies[handle];
    (shared.user_force, shared.user_torque) = (body.user_force(), body.user_torque());
    (shared.push, shared.twist) = before;
    // What the user did is no contact's doing.
    (shared.start, shared.broken) = (None, false);
    press(region, handle, &shared);
    region.slot_mut(handle).shared = Some(shared);
}

/// By how many the mass of a body is to be divided; a newcomer's copy is whole until the members are told.
fn parts_of(region: &Region, handle: RigidBodyHandle, shared: &Shared) -> usize {
    if region.slot(handle).traits.kind == BodyKind::Dynamic {
        shared.members.without(shared.shadows).len().max(1)
    } else {
        1
    }
}

/// The mass of so many equal parts.
fn all_of(part: MassProperties, parts: usize) -> MassProperties {
    let parts = parts as f32;
    MassProperties {
        inv_mass: part.inv_mass / parts,
        inv_principal_inertia: part.inv_principal_inertia / parts,
        ..part
    }
}

/// Gives every source of the body's mass its share.
fn divide(region: &mut Region, handle: RigidBodyHandle, parts: usize) {
    let traits = region.slot(handle).traits.clone();
    let share = 1.0 / parts as f32;
    let PhysicsWorld { bodies, colliders, .. } = region.world_mut();
    let body = &mut bodies[handle];
    for (record, &collider) in traits.colliders.iter().zip(body.colliders()) {
        let collider = &mut colliders[collider];
        match &record.mass {
            ColliderMass::Density(density) => collider.set_density(density * share),
            ColliderMass::Mass(mass) => collider.set_mass(mass * share),
            ColliderMass::Properties(props) => collider.set_mass_properties(shared_properties(props, share)),
        }
    }
    divide_extra(body, &traits, share);
    body.recompute_mass_properties_from_colliders(colliders);
}

fn divide_extra(body: &mut RigidBody, traits: &BodyTraits, share: f32) {
    match &traits.extra_mass {
        None => body.set_additional_mass_properties(MassProperties::default(), false),
        Some(ExtraMass::Mass(mass)) => body.set_additional_mass(mass * share, false),
        Some(ExtraMass::Properties(props)) => {
            body.set_additional_mass_properties(shared_properties(props, share), false);
        }
    }
}

fn shared_properties(props: &MassRecord, share: f32) -> MassProperties {
    let whole = record::mass_properties(props);
    MassProperties {
        inv_mass: whole.inv_mass / share,
        inv_principal_inertia: whole.inv_principal_inertia / share,
        ..whole
    }
}
