//! Calls functions of the user's about contacts while a world steps: which pairs meet, and how contacts are solved.

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
/// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.detect is asked about what the collider detects as a sensor, or is
/// detected by.
pub const DCD_HOOK_DETECT: u32 = 2;
/// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.modify is asked about contacts of the collider before they are
/// solved.
pub const DCD_HOOK_MODIFY: u32 = 4;

/// Answer of DcdHooks.filter: what becomes of a pair.
pub type DcdPairAnswer = u32;

/// The two colliders touch and push each other, as without hooks.
pub const DCD_MEET_PUSH: DcdPairAnswer = 0;
/// The two colliders touch, which dcd_events reports, and do not push.
pub const DCD_MEET_TOUCH: DcdPairAnswer = 1;
/// The two colliders pass through each other, and nothing is reported.
pub const DCD_MEET_NOT: DcdPairAnswer = 2;

/// Two colliders that a hook is asked about.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdHookedPair {
    /// The body made first.
    pub a: DcdBodyId,
    /// The other body.
    pub b: DcdBodyId,
    /// User data of `a`.
    pub user_a: u64,
    /// User data of `b`.
    pub user_b: u64,
    /// user_data of the collider of `a`, such as the number of a material.
    pub material_a: u64,
    /// user_data of the collider of `b`, such as the number of a material.
    pub material_b: u64,
    /// Number of the collider of `a`, from 0.
    pub collider_a: u32,
    /// Number of the collider of `b`, from 0.
    pub collider_b: u32,
    /// Pose of `a`.
    pub pose_a: DcdPose,
    /// Pose of `b`.
    pub pose_b: DcdPose,
    /// Velocity of `a`.
    pub velocity_a: DcdVelocity,
    /// Velocity of `b`.
    pub velocity_b: DcdVelocity,
}

/// Contact that is about to be solved, of one manifold: several points with one normal.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdHookedContact {
    /// Normal from a to b, of length 1. To be read only.
    pub normal: [f32; 3],
    /// Least separation of the contact's points, metres, negative where they overlap. To be read only.
    pub separation: f32,
    /// Number of the contact's points. To be read only.
    pub points: u32,
    /// 1 at first. 0 takes the contact out of this step: the colliders touch and do not push. Any other number counts as 1.
    pub enabled: u32,
    /// Friction: Coulomb coefficient, 0 or more and finite.
    pub friction: f32,
    /// Restitution, 0 to 1.
    pub restitution: f32,
    /// Velocity of the surface of `a` against that of `b`, world axes, m/s; 0 at first. So a conveyor belt `a` carries `b` along.
    /// For a belt that is `b`, give the negative.
    pub surface_velocity: [f32; 3],
    /// Number of the program's own that the manifold keeps while it lasts; 0 at first, and where bodies come to another region. The
    /// function is called once per substep, of which a step may have several where regions meet.
    pub memory: u32,
}

/// Returns whether two colliders meet: DCD_MEET_PUSH, DCD_MEET_TOUCH or DCD_MEET_NOT. Any other answer counts as DCD_MEET_PUSH, and
/// nothing tells of it.
pub type DcdFilterFn =
    Option<unsafe extern "C" fn(context: *mut c_void, pair: *const DcdHookedPair) -> DcdPairAnswer>;
/// Returns whether a sensor detects another collider.
pub type DcdDetectFn = Option<unsafe extern "C" fn(context: *mut c_void, pair: *const DcdHookedPair) -> bool>;
/// Changes a contact before it is solved. A member that is out of its range afterwards (a friction that is NaN or below 0, a
/// restitution above 1, a surface_velocity that is not finite) is left as it was, and nothing tells of it. What is to be read only is
/// not read back.
pub type DcdModifyFn = Option<
    unsafe extern "C" fn(context: *mut c_void, pair: *const DcdHookedPair, contact: *mut DcdHookedContact),
>;

/// Functions that are asked about contacts. Start from DCD_HOOKS_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdHooks {
    /// Size of this struct: sizeof(DcdHooks).
    pub struct_size: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
    /// First argument of all functions.
    pub context: *mut c_void,
    /// Function that is asked about two colliders that touch, of which one has DCD_HOOK_FILTER. Null: they push.
    pub filter: DcdFilterFn,
    /// Function that is asked about a sensor and what is in it, of which one has DCD_HOOK_DETECT. Null: the sensor detects it.
    pub detect: DcdDetectFn,
    /// Function that is asked about a contact of two colliders, of which one has DCD_HOOK_MODIFY. Null: the contact stays as it is.
    pub modify: DcdModifyFn,
}

// SAFETY: begins with `struct_size`; every other member is a number, a pointer or a function that may be null.
unsafe impl Sized32 for DcdHooks {
    const NAME: &'static str = "DcdHooks";
}

/// Sets the functions that a local world asks about contacts from the next dcd_step on; a null `hooks` removes them. `hooks` is
/// read during the call. The functions and `context` must be there until others are set or the world is destroyed.
///
/// - Callers. The functions are called from within dcd_step (or the step that dcd_step_begin began), by any thread of the library
///   and by several at the same time, in no order that is promised. What pointers lead to is valid during the call.
/// - Duties. They must return normally (no longjmp, no C++ exception), guard what they share, and call no function on a world: each
///   gives DCD_ERR_BUSY.
/// - Regions. Every region that holds both bodies asks about its own copies. So the answer must depend on the pair and on what the
///   program changed between steps, and on nothing else. Otherwise regions disagree, and the result depends on how the world is
///   cut.
/// - Resting pairs. A pair may be asked about in every step, or only when it begins to be near, for as long as it rests.
/// - Saving. The functions are not saved with the world. A recording goes on, and has what they answered: a replay does not call
///   them.
///
/// Errors: DCD_ERR_NULL (world), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT, DCD_ERR_UNSUPPORTED (in a served world).
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

// SAFETY: nothing here is written. dcd_hooks_set asks for functions that any thread may call with their context.
unsafe impl Send for Asked {}
// SAFETY: as above.
unsafe impl Sync for Asked {}

impl Asked {
    /// Returns the pair for C, and whether its two sides are swapped.
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
        // SAFETY: the user's function, called as the header says; what its pointers lead to outlives the call.
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
        // Numbers with which Rapier could not compute are left as they were.
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
