//! Asks functions of the user's about contacts while a world steps: which pairs meet, and how contacts are solved.

use std::ffi::c_void;
use std::sync::Arc;

use dcd::{ContactHooks, HookedPair};
use rapier3d::prelude::{ContactModificationContext, RigidBody, SolverContact, SolverFlags, Vector};

use crate::callback::{Callback, enter};
use crate::guard::guard;
use crate::handle::Mark;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Sized32, check_reserved};
use crate::registry::with;
use crate::status::{DcdStatus, Failure};
use crate::types::{DcdPose, DcdVelocity};

/// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.filter is asked about contacts of the collider.
pub const DCD_HOOK_FILTER: u32 = 1;
/// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.detect is asked about what it detects as a sensor, or is detected by.
pub const DCD_HOOK_DETECT: u32 = 2;
/// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.modify is asked about its contacts before they are solved.
pub const DCD_HOOK_MODIFY: u32 = 4;

/// Says what becomes of a pair: the answer of DcdHooks.filter.
pub type DcdPairAnswer = u32;

/// They touch and push each other, as without hooks.
pub const DCD_MEET_PUSH: DcdPairAnswer = 0;
/// They touch, which dcd_events tells, and do not push.
pub const DCD_MEET_TOUCH: DcdPairAnswer = 1;
/// They pass through each other, and nothing is told.
pub const DCD_MEET_NOT: DcdPairAnswer = 2;

/// Two colliders that a hook is asked about.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdHookedPair {
    /// The body made first.
    pub a: DcdBodyId,
    /// The other one.
    pub b: DcdBodyId,
    /// Your own of `a`.
    pub user_a: u64,
    /// Your own of `b`.
    pub user_b: u64,
    /// The user_data of the collider of `a`, as the number of a material.
    pub material_a: u64,
    /// The same of `b`.
    pub material_b: u64,
    /// Which collider of `a`, from 0.
    pub collider_a: u32,
    /// Which collider of `b`.
    pub collider_b: u32,
    /// The pose of `a`.
    pub pose_a: DcdPose,
    /// The pose of `b`.
    pub pose_b: DcdPose,
    /// The velocity of `a`.
    pub velocity_a: DcdVelocity,
    /// The velocity of `b`.
    pub velocity_b: DcdVelocity,
}

/// A contact that is about to be solved, of one manifold: several points with one normal.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdHookedContact {
    /// From a to b, of length 1; to be read.
    pub normal: [f32; 3],
    /// The least separation of its points, metres, negative where they overlap; to be read.
    pub separation: f32,
    /// How many points it has; to be read.
    pub points: u32,
    /// 1; 0 takes the contact out of this step: they touch and do not push.
    pub enabled: u32,
    /// Coulomb coefficient, 0 or more.
    pub friction: f32,
    /// 0 to 1.
    pub restitution: f32,
    /// The velocity of the surface of `a` against that of `b`, world axes, m/s: so a conveyor belt `a` carries `b` along; of a belt that is `b`,
    /// give the negative. 0 at first.
    pub surface_velocity: [f32; 3],
    /// A number of yours that the manifold keeps while it lasts; 0 at first, and where bodies come to another region.
    pub memory: u32,
}

/// Returns whether two colliders meet: DCD_MEET_PUSH, DCD_MEET_TOUCH or DCD_MEET_NOT.
pub type DcdFilterFn =
    Option<unsafe extern "C" fn(context: *mut c_void, pair: *const DcdHookedPair) -> DcdPairAnswer>;
/// Returns whether a sensor detects another collider.
pub type DcdDetectFn = Option<unsafe extern "C" fn(context: *mut c_void, pair: *const DcdHookedPair) -> bool>;
/// Changes a contact.
pub type DcdModifyFn = Option<
    unsafe extern "C" fn(context: *mut c_void, pair: *const DcdHookedPair, contact: *mut DcdHookedContact),
>;

/// Functions that are asked about contacts. Start from DCD_HOOKS_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdHooks {
    /// sizeof(DcdHooks).
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// The first argument of all functions.
    pub context: *mut c_void,
    /// Asked about colliders that touch, of which one has DCD_HOOK_FILTER. Null: they push.
    pub filter: DcdFilterFn,
    /// Asked about sensors and what is in them, of which one has DCD_HOOK_DETECT. Null: they detect.
    pub detect: DcdDetectFn,
    /// Asked about contacts of colliders, of which one has DCD_HOOK_MODIFY. Null: they stay.
    pub modify: DcdModifyFn,
}

// SAFETY: begins with `struct_size`; every other member is a number, a pointer or a function that may be null.
unsafe impl Sized32 for DcdHooks {
    const NAME: &'static str = "DcdHooks";
}

/// Sets the functions that a local world asks about contacts from the next dcd_step on; null removes them. `hooks` is read during the call; the
/// functions and `context` must be there until others are set or the world is destroyed.
///
/// They are called from within dcd_step (or the step that dcd_step_begin began), by any thread of the library and by several at the same time, in
/// no order that is promised. They must return normally (no longjmp, no C++ exception), guard what they share, and call no function on a
/// world: each is DCD_ERR_BUSY. What pointers lead to is valid during the call. Every region that holds both bodies asks about its
/// own copies, so that the answer must depend on the pair and on what you changed between steps, on nothing else: else regions disagree,
/// and the result depends on how the world is cut. A pair may be asked about in every step, or only when it begins to be near, for as long
/// as it rests.
///
/// They are not saved with the world. A recording goes on, and has what they answered: a replay does not call them.
/// Errors: DCD_ERR_NULL (world), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT, DCD_ERR_UNSUPPORTED in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_hooks_set(world: DcdWorld, hooks: *const DcdHooks) -> DcdStatus {
    guard("dcd_hooks_set", || {
        // SAFETY: the caller vouches for the pointer.
        let hooks =
            if hooks.is_null() { None } else { Some(unsafe { pointer::read_sized(hooks, "hooks")? }) };
        if let Some(hooks) = &hooks {
            check_reserved(hooks.reserved)?;
        }
        with(world, |world| {
            let mark = world.mark;
            let asked = hooks.map(|hooks| Arc::new(Asked { hooks, mark }) as Arc<dyn ContactHooks>);
            world.dcd.set_hooks(asked).map_err(Failure::from)
        })
    })
}

/// The user's functions, as regions call them.
struct Asked {
    hooks: DcdHooks,
    mark: Mark,
}

// SAFETY: nothing here is written; that the user's functions may be called by any thread with their context is what dcd_hooks_set asks
// of them.
unsafe impl Send for Asked {}
// SAFETY: as above.
unsafe impl Sync for Asked {}

impl Asked {
    /// Returns the pair for C, and whether it is the other way round.
    fn pair(&self, pair: &HookedPair<'_>) -> (DcdHookedPair, bool) {
        let swapped = pair.second < pair.first;
        let (a, b) = if swapped { (1, 0) } else { (0, 1) };
        let names = [pair.first, pair.second];
        let pose = |body: &RigidBody| {
            let (at, anchor) = (body.translation(), pair.anchor);
            DcdPose {
                p: std::array::from_fn(|i| anchor[i] + f64::from(at[i])),
                q: body.rotation().to_array(),
            }
        };
        let velocity = |body: &RigidBody| DcdVelocity {
            linear: body.linvel().to_array(),
            angular: body.angvel().to_array(),
        };
        let hooked = DcdHookedPair {
            a: self.mark.body(names[a].body),
            b: self.mark.body(names[b].body),
            user_a: pair.bodies[a].user_data as u64,
            user_b: pair.bodies[b].user_data as u64,
            material_a: pair.colliders[a].user_data as u64,
            material_b: pair.colliders[b].user_data as u64,
            collider_a: names[a].index as u32,
            collider_b: names[b].index as u32,
            pose_a: pose(pair.bodies[a]),
            pose_b: pose(pair.bodies[b]),
            velocity_a: velocity(pair.bodies[a]),
            velocity_b: velocity(pair.bodies[b]),
        };
        (hooked, swapped)
    }
}

impl ContactHooks for Asked {
    fn filter_contact_pair(&self, pair: &HookedPair<'_>) -> Option<SolverFlags> {
        let Some(filter) = self.hooks.filter else { return Some(SolverFlags::COMPUTE_RIGID_IMPULSES) };
        let ((pair, _), mut answer) = (self.pair(pair), DCD_MEET_PUSH);
        // SAFETY: the user's function, called as the header says; what it is pointed to outlives the call.
        enter(Callback::Hook, || answer = unsafe { filter(self.hooks.context, &pair) });
        match answer {
            DCD_MEET_NOT => None,
            DCD_MEET_TOUCH => Some(SolverFlags::empty()),
            _ => Some(SolverFlags::COMPUTE_RIGID_IMPULSES),
        }
    }

    fn filter_intersection_pair(&self, pair: &HookedPair<'_>) -> bool {
        let Some(detect) = self.hooks.detect else { return true };
        let ((pair, _), mut answer) = (self.pair(pair), true);
        // SAFETY: as for the filter.
        enter(Callback::Hook, || answer = unsafe { detect(self.hooks.context, &pair) });
        answer
    }

    fn modify_solver_contacts(&self, pair: &HookedPair<'_>, contacts: &mut ContactModificationContext<'_>) {
        let (Some(modify), Some(manifold)) = (self.hooks.modify, contacts.rigid_mut()) else {
            return;
        };
        let (pair, swapped) = self.pair(pair);
        let turned = |v: Vector| if swapped { -v } else { v };
        let first: Option<&SolverContact> = manifold.solver_contacts.iter().next();
        let before = DcdHookedContact {
            normal: turned(*manifold.normal).to_array(),
            separation: manifold.solver_contacts.iter().map(|contact| contact.dist).fold(f32::MAX, f32::min),
            points: manifold.solver_contacts.len() as u32,
            enabled: 1,
            friction: *manifold.friction,
            restitution: *manifold.restitution,
            surface_velocity: first.map_or([0.0; 3], |contact| turned(contact.tangent_velocity).to_array()),
            memory: *manifold.user_data,
        };
        let mut contact = before;
        // SAFETY: as for the filter.
        enter(Callback::Hook, || unsafe { modify(self.hooks.context, &pair, &mut contact) });
        *manifold.user_data = contact.memory;
        if contact.enabled == 0 {
            manifold.solver_contacts.clear();
        }
        // What Rapier could not compute with stays as it was.
        if contact.friction.is_finite() && contact.friction >= 0.0 {
            *manifold.friction = contact.friction;
        }
        if (0.0..=1.0).contains(&contact.restitution) {
            *manifold.restitution = contact.restitution;
        }
        let carried = Vector::from_array(contact.surface_velocity);
        if contact.surface_velocity != before.surface_velocity && carried.is_finite() {
            for point in manifold.solver_contacts.iter_mut() {
                point.tangent_velocity = turned(carried);
            }
        }
    }
}
