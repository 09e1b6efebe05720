//! Collects the events of the last step for C: contacts, forces, transfers, bodies that came or went, connections, messages.

mod calls;

use std::collections::HashMap;
use std::ffi::CStr;

use dcd::protocol::{ContactKey, Refusal};
use dcd::space::BodyId;
use dcd::{BodyChange, World as Dcd};

use crate::connection::DcdConnectionEvent;
use crate::handle::Mark;
use crate::ids::{DcdBodyId, DcdJointId};
use crate::material::material;
use crate::message::{DcdMessage, Messages};
use crate::pinned::Pinned;
use crate::pointer::Sized32;
pub use calls::*;

/// In DcdContact.kind: the two bodies began to touch.
pub const DCD_CONTACT_BEGAN: u32 = 0;
/// In DcdContact.kind: the two bodies ceased to touch.
pub const DCD_CONTACT_ENDED: u32 = 1;

/// In DcdContact.flags: one of the two colliders is a sensor.
pub const DCD_CONTACT_SENSOR: u32 = 1;

/// Contact event: two colliders of two bodies began or ceased to touch. It is reported when either has DCD_EVENT_CONTACT, once per
/// pair of colliders, whatever regions see it: two bodies of several colliders touch from the first event that begins to the last
/// that ends. In a served world it is reported for avatars of this process.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdContact {
    /// The body made first: of the two, the one that dcd_bodies lists first. Its id is stale when it was destroyed since.
    pub a: DcdBodyId,
    /// The other body.
    pub b: DcdBodyId,
    /// User data of `a`.
    pub user_a: u64,
    /// User data of `b`.
    pub user_b: u64,
    /// Point of the contact, world space, metres; 0 for ends.
    pub point: [f64; 3],
    /// Normal from a to b, of length 1; 0 for sensors and ends.
    pub normal: [f32; 3],
    /// Speed at which the bodies approached, m/s; 0 for ends.
    pub speed: f32,
    /// Kind: DCD_CONTACT_BEGAN or DCD_CONTACT_ENDED.
    pub kind: u32,
    /// DCD_CONTACT_SENSOR bit, or 0.
    pub flags: u32,
    /// Number of the collider of `a`, from 0, in the order of that step (dcd_collider_remove): bodies may have several.
    pub collider_a: u32,
    /// Number of the collider of `b`, from 0.
    pub collider_b: u32,
    /// User data of that collider of `a` (DcdBodyDef.material, DcdColliderProperties.user_data); 0 once the body is gone.
    pub material_a: u64,
    /// User data of that collider of `b`; 0 once the body is gone.
    pub material_b: u64,
}

/// Contact force event: a contact pressed harder than the force_threshold of a body with DCD_EVENT_FORCE.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdContactForce {
    /// The body made first, as in DcdContact.
    pub a: DcdBodyId,
    /// The other body.
    pub b: DcdBodyId,
    /// User data of `a`.
    pub user_a: u64,
    /// User data of `b`.
    pub user_b: u64,
    /// Sum of the forces on `b`, newtons, world axes.
    pub force: [f32; 3],
    /// Sum of the magnitudes of these forces, newtons.
    pub magnitude: f32,
    /// Number of the collider of `a`, from 0.
    pub collider_a: u32,
    /// Number of the collider of `b`, from 0.
    pub collider_b: u32,
    /// User data of that collider of `a`, as in DcdContact.
    pub material_a: u64,
    /// User data of that collider of `b`, as in DcdContact.
    pub material_b: u64,
}

/// Transfer: a body changed owner in the step. That the program put it elsewhere is not reported.
///
/// In a served world, it was heard of in the step, and another region owned it than when it was heard of before. That is exact for
/// both times, and leaves out what the body went through between them. Nothing is reported of bodies whose owner was not known
/// before (DCD_OWNER_BY_PLACE), of bodies outside the interest, and of regions that another node computes now.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdTransfer {
    /// The body that changed owner.
    pub body: DcdBodyId,
    /// User data of the body.
    pub user_data: u64,
    /// Region that owned the body, as in DcdRegionInfo.
    pub from: u32,
    /// Region that owns the body now.
    pub to: u32,
}

/// In DcdBodyChange.kind: a body came into a served world.
pub const DCD_CHANGE_APPEARED: u32 = 1;
/// In DcdBodyChange.kind: a body of a served world is gone, and its id is stale.
pub const DCD_CHANGE_REMOVED: u32 = 2;
/// In DcdBodyChange.kind: what was asked of an avatar, or built, is refused. If the body had not appeared yet, it never will, and
/// its id is stale.
pub const DCD_CHANGE_REFUSED: u32 = 3;

/// In DcdBodyChange.reason: the program speaks another version of the protocol than the server.
pub const DCD_REFUSED_VERSION: u32 = 1;
/// In DcdBodyChange.reason: the body is not an avatar of this process.
pub const DCD_REFUSED_NOT_YOURS: u32 = 2;
/// In DcdBodyChange.reason: the avatar is not in the world.
pub const DCD_REFUSED_UNKNOWN: u32 = 3;
/// In DcdBodyChange.reason: an avatar with this id waits for its return. Make another.
pub const DCD_REFUSED_EXISTS: u32 = 4;
/// In DcdBodyChange.reason: the velocity is above the limit that the server sets, or the spin is above a quarter of a turn per
/// tick.
pub const DCD_REFUSED_TOO_FAST: u32 = 5;
/// In DcdBodyChange.reason: a newer input had arrived before.
pub const DCD_REFUSED_LATE: u32 = 6;
/// In DcdBodyChange.reason: the shape did not arrive with the avatar, or cannot be an avatar's. For a builder: the shape cannot be
/// a builder's, which has neither voxels nor half-spaces.
pub const DCD_REFUSED_SHAPE: u32 = 7;
/// In DcdBodyChange.reason: the client wants too many avatars or too much of them.
/// - It has 1,024 avatars, or has brought 2,048 at once and 128 more each second, those that it destroyed included.
/// - It has asked too much of them at a time.
/// - It has brought more than 1 MiB of new shapes that are not forgotten yet: use the shapes that there are.
/// - For a builder: more than 4,096 bodies or joints of its own, more than 24,576 changes at once and 1,024 more each second, or
///   more than 16 MiB of such shapes.
pub const DCD_REFUSED_TOO_MANY: u32 = 8;
/// In DcdBodyChange.reason: the body would cost too much.
/// - An avatar has more than 8 extra solver or PGS iterations, reaches farther than 100 m from its origin, or begins where 64
///   others of this client are. Or all avatars of the client together have more than 20,000 corners.
/// - For a client's characters and vehicles see dcd_character_create and dcd_vehicle_create.
/// - A body that is built takes more than 60 KiB with its shapes and what joints tie to it, asks for contacts of fixed bodies,
///   begins among more than 1,024 colliders, or looks farther than 10 m around (contact_skin, soft_ccd). Or all that the builder
///   has built has more than 200,000 corners or 16,384 colliders.
pub const DCD_REFUSED_COSTLY: u32 = 9;
/// In DcdBodyChange.reason: the jump is farther than the avatar could have moved since its last one, or in a second, at the limit
/// of speed that the server sets.
pub const DCD_REFUSED_TOO_FAR: u32 = 10;
/// In DcdBodyChange.reason: the client may not build, because its token was for another role than DCD_ROLE_BUILDER.
pub const DCD_REFUSED_MAY_NOT_BUILD: u32 = 11;
/// In DcdBodyChange.reason: a builder may not do that. It leaves avatars, the kind of fixed bodies, and shapes as they are.
pub const DCD_REFUSED_NOT_TO_BE_BUILT: u32 = 12;

/// Change of a body of a served world: it appeared, is gone, or an input was refused. Bodies that were there on joining are not
/// reported. An avatar that is destroyed before it has appeared is reported to appear, and then to be gone. A body that is
/// gone and appears in the same step may be another one by the same id, or is altered: the world went back to a save. Look at it anew.
/// In a local world, and to the server's own program, nothing is reported.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBodyChange {
    /// The body; null when a refusal concerns none.
    pub body: DcdBodyId,
    /// User data of the body, from the program or from whoever made it; 0 for a body of another process that came and went between
    /// two steps.
    pub user_data: u64,
    /// Kind: DCD_CHANGE_APPEARED, DCD_CHANGE_REMOVED or DCD_CHANGE_REFUSED.
    pub kind: u32,
    /// DCD_REFUSED_… reason of a refusal, else 0; dcd_refused_string names it.
    pub reason: u32,
}

/// Joint that bore more than its strength in the step (dcd_joint_set_strength), in a local world. Whether it breaks is up to the
/// program: dcd_joint_destroy breaks it.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdJointOverload {
    /// The joint.
    pub joint: DcdJointId,
    /// User data of the joint.
    pub user_data: u64,
    /// Force on the joint's locked axes, newtons.
    pub force: f32,
    /// Torque on the joint's locked axes as Rapier's solver has it, newton metres: not that about the anchor, unless this is the
    /// body's centre of mass.
    pub torque: f32,
}

/// In DcdEventView.flags: the link to the server is gone. dcd_step says why.
pub const DCD_EVENTS_DISCONNECTED: u32 = 1;

/// Events of the last step. Start from DCD_EVENT_VIEW_INIT. Arrays are null when their count is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdEventView {
    /// Size of this struct: sizeof(DcdEventView).
    pub struct_size: u32,
    /// DCD_EVENTS_… bits.
    pub flags: u32,
    /// Number of the step in which the events happened; in a served world that of the newest tick heard of, while the events are
    /// of all ticks since the call before.
    pub tick: u64,
    /// Contacts that began or ended, in order of their bodies.
    pub contacts: *const DcdContact,
    /// Number of entries in `contacts`.
    pub contact_count: usize,
    /// Contacts that pressed hard, in order of their bodies.
    pub forces: *const DcdContactForce,
    /// Number of entries in `forces`.
    pub force_count: usize,
    /// Bodies that changed owner. In a served world, those that were heard to, in the order in which this was heard; if there are
    /// more than 4096, the newest.
    pub transfers: *const DcdTransfer,
    /// Number of entries in `transfers`.
    pub transfer_count: usize,
    /// Bodies of a served world that came and went, and refusals.
    pub changes: *const DcdBodyChange,
    /// Number of entries in `changes`.
    pub change_count: usize,
    /// Changes of a served world's connections, in order; if there are more than 4096, the newest.
    pub connections: *const DcdConnectionEvent,
    /// Number of entries in `connections`.
    pub connection_count: usize,
    /// Messages that programs of other processes sent to this one, in the order in which they came. Their bytes live as long as the
    /// array.
    pub messages: *const DcdMessage,
    /// Number of entries in `messages`.
    pub message_count: usize,
    /// Joints that bore more than their strength, oldest first.
    pub overloads: *const DcdJointOverload,
    /// Number of entries in `overloads`.
    pub overload_count: usize,
}

// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdEventView {
    const NAME: &'static str = "DcdEventView";
}

/// Events of the last two steps, lent as the state is.
#[derive(Default)]
pub(crate) struct EventBuffers {
    sets: [EventArrays; 2],
    newest: usize,
    /// What was taken away since the last step.
    departed: Departed,
    /// What was taken away before the last step. The events of that step speak of it.
    told: Departed,
}

/// User data of what was taken away between two steps. Its contacts end in the second step.
#[derive(Clone, Default)]
struct Departed {
    /// User data of bodies that were destroyed: at first in the order in which they were, and by id once the events are written.
    bodies: Vec<(BodyId, u64)>,
    /// User data of the colliders, as they were numbered, of bodies that lost some.
    colliders: HashMap<BodyId, Vec<u64>>,
}

impl Departed {
    /// Returns the user data of a body that was destroyed. The bodies must be sorted by id.
    fn user_data(&self, id: BodyId) -> Option<u64> {
        let place = self.bodies.binary_search_by_key(&id, |(body, _)| *body).ok()?;
        Some(self.bodies[place].1)
    }

    /// Forgets all, and keeps the memory.
    fn clear(&mut self) {
        self.bodies.clear();
        self.colliders.clear();
    }
}

/// What events must know of a world that is kept, besides the world.
pub(crate) struct KeptEvents {
    departed: Departed,
    told: Departed,
}

#[derive(Default)]
struct EventArrays {
    tick: u64,
    flags: u32,
    contacts: Pinned<DcdContact>,
    forces: Pinned<DcdContactForce>,
    transfers: Pinned<DcdTransfer>,
    changes: Pinned<DcdBodyChange>,
    connections: Pinned<DcdConnectionEvent>,
    messages: Messages,
    overloads: Pinned<DcdJointOverload>,
}

impl EventBuffers {
    /// Notes that a body is about to be destroyed.
    pub(crate) fn departs(&mut self, id: BodyId, user_data: u64) {
        self.departed.bodies.push((id, user_data));
    }

    /// Notes that a body is about to lose a collider, by which the colliders after it get other numbers. Later losses concern
    /// numbers that no contact has had.
    pub(crate) fn loses_collider(&mut self, world: &Dcd, id: BodyId) {
        let data = || (0..world.collider_count(id)).map(|collider| material(world, id, collider)).collect();
        self.departed.colliders.entry(id).or_insert_with(data);
    }

    /// Returns what is needed to show the events of the last step again.
    pub(crate) fn keep(&self) -> KeptEvents {
        KeptEvents { departed: self.departed.clone(), told: self.told.clone() }
    }

    /// Shows the events of the last step of a world that was gone back to.
    pub(crate) fn go_back(&mut self, kept: &KeptEvents, world: &Dcd, mark: Mark) {
        self.departed.clone_from(&kept.departed);
        self.told.clone_from(&kept.told);
        self.take_down(world, mark);
    }

    /// Forgets what was taken away: the world is another.
    pub(crate) fn forget(&mut self) {
        self.departed.clear();
    }

    /// Writes down what happened in the step just done.
    pub(crate) fn fill(&mut self, world: &Dcd, mark: Mark) {
        std::mem::swap(&mut self.told, &mut self.departed);
        self.departed.clear();
        self.take_down(world, mark);
    }

    fn take_down(&mut self, world: &Dcd, mark: Mark) {
        self.newest = 1 - self.newest;
        for departed in [&mut self.told, &mut self.departed] {
            departed.bodies.sort_unstable_by_key(|(id, _)| *id);
        }
        let (arrays, told, since) = (&mut self.sets[self.newest], &self.told, &self.departed);
        let events = world.events();
        let departed = |id: BodyId| told.user_data(id).or_else(|| since.user_data(id));
        // Returns the colliders, as they were numbered, of a body that has lost some.
        let former = |of: &Departed, body: BodyId, collider: u16| {
            let colliders = of.colliders.get(&body).filter(|_| world.contains(body))?;
            colliders.get(usize::from(collider)).copied()
        };
        let material_of = |body: BodyId, collider: u16| {
            former(since, body, collider).unwrap_or_else(|| material(world, body, usize::from(collider)))
        };
        let user = |id| world.user_data(id).map(|data| data as u64).or_else(|| departed(id)).unwrap_or(0);
        arrays.tick = world.tick().0;
        arrays.flags = if world.is_lost() { DCD_EVENTS_DISCONNECTED } else { 0 };
        let changes = world.changes();
        arrays.changes.refill(changes.len()).extend(changes.iter().map(|change| {
            let (body, kind, reason, user_data) = match *change {
                BodyChange::Appeared(id) => (Some(id), DCD_CHANGE_APPEARED, 0, user(id)),
                BodyChange::Removed { body, user_data } => {
                    (Some(body), DCD_CHANGE_REMOVED, 0, user_data as u64)
                }
                BodyChange::Refused { body, why, user_data } => {
                    (body, DCD_CHANGE_REFUSED, code_of(why), user_data as u64)
                }
                _ => unreachable!("dcd and dcd-ffi are of one version"),
            };
            let body = body.map_or(DcdBodyId { v: 0 }, |id| mark.body(id));
            DcdBodyChange { body, user_data, kind, reason }
        }));
        arrays.contacts.refill(events.touches.len()).extend(events.touches.iter().map(|touch| {
            let ContactKey { a, b, collider_a, collider_b } = touch.key;
            let material = |body, collider| {
                let before = if touch.began { None } else { former(told, body, collider) };
                before.unwrap_or_else(|| material_of(body, collider))
            };
            DcdContact {
                a: mark.body(a),
                b: mark.body(b),
                user_a: user(a),
                user_b: user(b),
                point: touch.point,
                normal: touch.normal,
                speed: touch.speed,
                kind: if touch.began { DCD_CONTACT_BEGAN } else { DCD_CONTACT_ENDED },
                flags: if touch.sensor { DCD_CONTACT_SENSOR } else { 0 },
                collider_a: u32::from(collider_a),
                collider_b: u32::from(collider_b),
                material_a: material(a, collider_a),
                material_b: material(b, collider_b),
            }
        }));
        arrays.forces.refill(events.forces.len()).extend(events.forces.iter().map(|force| {
            let ContactKey { a, b, collider_a, collider_b } = force.key;
            DcdContactForce {
                a: mark.body(a),
                b: mark.body(b),
                user_a: user(a),
                user_b: user(b),
                force: force.force_n,
                magnitude: force.magnitude_n,
                collider_a: u32::from(collider_a),
                collider_b: u32::from(collider_b),
                material_a: material_of(a, collider_a),
                material_b: material_of(b, collider_b),
            }
        }));
        let handovers = world.handovers();
        arrays.transfers.refill(handovers.len()).extend(handovers.iter().map(|handover| DcdTransfer {
            body: mark.body(handover.body),
            user_data: user(handover.body),
            from: handover.from.0,
            to: handover.to.0,
        }));
        let changes = world.connection_events();
        let told = changes.iter().map(|event| DcdConnectionEvent::new(event, mark.connection(event.id)));
        arrays.connections.refill(changes.len()).extend(told);
        arrays.messages.refill(world.messages(), mark);
        let overloads = world.joint_overloads();
        arrays.overloads.refill(overloads.len()).extend(overloads.iter().map(|overload| DcdJointOverload {
            joint: mark.joint(overload.joint),
            user_data: world.joint(overload.joint).map_or(0, |joint| joint.user_data as u64),
            force: overload.force_n,
            torque: overload.torque_n_m,
        }));
    }

    fn view(&self) -> DcdEventView {
        let arrays = &self.sets[self.newest];
        DcdEventView {
            struct_size: size_of::<DcdEventView>() as u32,
            flags: arrays.flags,
            tick: arrays.tick,
            contacts: arrays.contacts.as_ptr(),
            contact_count: arrays.contacts.len(),
            forces: arrays.forces.as_ptr(),
            force_count: arrays.forces.len(),
            transfers: arrays.transfers.as_ptr(),
            transfer_count: arrays.transfers.len(),
            changes: arrays.changes.as_ptr(),
            change_count: arrays.changes.len(),
            connections: arrays.connections.as_ptr(),
            connection_count: arrays.connections.len(),
            messages: arrays.messages.list.as_ptr(),
            message_count: arrays.messages.list.len(),
            overloads: arrays.overloads.as_ptr(),
            overload_count: arrays.overloads.len(),
        }
    }
}

fn code_of(refusal: Refusal) -> u32 {
    match refusal {
        Refusal::Version { .. } => DCD_REFUSED_VERSION,
        Refusal::NotYours => DCD_REFUSED_NOT_YOURS,
        Refusal::Unknown => DCD_REFUSED_UNKNOWN,
        Refusal::Exists => DCD_REFUSED_EXISTS,
        Refusal::TooFast => DCD_REFUSED_TOO_FAST,
        Refusal::TooFar => DCD_REFUSED_TOO_FAR,
        Refusal::Late => DCD_REFUSED_LATE,
        Refusal::Shape => DCD_REFUSED_SHAPE,
        Refusal::TooMany => DCD_REFUSED_TOO_MANY,
        Refusal::Costly(_) => DCD_REFUSED_COSTLY,
        Refusal::MayNotBuild => DCD_REFUSED_MAY_NOT_BUILD,
        Refusal::NotToBeBuilt => DCD_REFUSED_NOT_TO_BE_BUILT,
    }
}

pub(crate) fn refused_name(reason: u32) -> &'static CStr {
    match reason {
        DCD_REFUSED_VERSION => c"DCD_REFUSED_VERSION",
        DCD_REFUSED_NOT_YOURS => c"DCD_REFUSED_NOT_YOURS",
        DCD_REFUSED_UNKNOWN => c"DCD_REFUSED_UNKNOWN",
        DCD_REFUSED_EXISTS => c"DCD_REFUSED_EXISTS",
        DCD_REFUSED_TOO_FAST => c"DCD_REFUSED_TOO_FAST",
        DCD_REFUSED_LATE => c"DCD_REFUSED_LATE",
        DCD_REFUSED_SHAPE => c"DCD_REFUSED_SHAPE",
        DCD_REFUSED_TOO_MANY => c"DCD_REFUSED_TOO_MANY",
        DCD_REFUSED_COSTLY => c"DCD_REFUSED_COSTLY",
        DCD_REFUSED_TOO_FAR => c"DCD_REFUSED_TOO_FAR",
        DCD_REFUSED_MAY_NOT_BUILD => c"DCD_REFUSED_MAY_NOT_BUILD",
        DCD_REFUSED_NOT_TO_BE_BUILT => c"DCD_REFUSED_NOT_TO_BE_BUILT",
        _ => c"(no DCD reason)",
    }
}
