//! Defines the definition of a body, and keeps those by which bodies were made last.

use std::mem::offset_of;
use std::sync::Arc;

use dcd::protocol::BodyTraits;

use crate::ids::DcdShapeId;
use crate::pointer::Sized32;
use crate::types::{DcdBodyType, DcdCombineRule, DcdPose, DcdVelocity};

/// The definition of a body. Start from DCD_BODY_DEF_INIT and give at least `shape`. dcd_body_set_properties and
/// dcd_collider_set_properties change it later.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdBodyDef {
    /// sizeof(DcdBodyDef).
    pub struct_size: u32,
    /// DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    pub body_type: DcdBodyType,
    /// Where it starts.
    pub pose: DcdPose,
    /// How it moves at first.
    pub velocity: DcdVelocity,
    /// Of the same world. Two bodies may share one. dcd_collider_add gives a body more.
    pub shape: DcdShapeId,
    /// kg/m³, 0 or more. A dynamic body needs mass by this, `mass` or `extra_mass`; a mesh that is not closed and terrain have none by this.
    pub density: f32,
    /// Kilograms of the shape, instead of those that follow from density; 0 is by density.
    pub mass: f32,
    /// Coulomb coefficient, 0 or more.
    pub friction: f32,
    /// 0 (no bounce) to 1 (all of the speed).
    pub restitution: f32,
    /// DCD_COMBINE_…: what two bodies in contact use of their friction.
    pub friction_rule: DcdCombineRule,
    /// DCD_COMBINE_…: what they use of their restitution.
    pub restitution_rule: DcdCombineRule,
    /// Metres that the shape is kept away from others, 0 or more: a thin cushion makes contacts cheaper and calmer.
    pub contact_skin: f32,
    /// Slows movement down: 1/s, 0 or more.
    pub linear_damping: f32,
    /// Slows turning down: 1/s, 0 or more.
    pub angular_damping: f32,
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// DCD_BODY_… bits.
    pub flags: u32,
    /// DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    pub locked: u32,
    /// DCD_EVENT_… bits. A contact is told of when either body asks for it.
    pub events: u32,
    /// Newtons above which DCD_EVENT_FORCE tells, 0 or more.
    pub force_threshold: f32,
    /// Groups that the body belongs to, as bits.
    pub groups: u32,
    /// Groups that it meets. Two bodies collide when each meets a group of the other.
    pub mask: u32,
    /// Groups that it belongs to when it comes to pushing; contacts of others are told of and do nothing.
    pub solver_groups: u32,
    /// Groups that push it and that it pushes.
    pub solver_mask: u32,
    /// DCD_PAIR_… bits: which types of bodies it meets. A pair meets when either asks for it.
    pub pairs: u32,
    /// -128 to 127: of two bodies the higher is not moved by the lower, which meets it like a wall.
    pub dominance: i32,
    /// Metres ahead that it looks for what it may meet: cheaper than DCD_BODY_CCD, and not as sure; 0 is none.
    pub soft_ccd: f32,
    /// m/s below which it may fall asleep, 0 or more.
    pub sleep_linear: f32,
    /// rad/s below which it may fall asleep, 0 or more.
    pub sleep_angular: f32,
    /// Seconds it must have been so slow, 0 or more. In a served world these three must be as in DCD_BODY_DEF_INIT.
    pub sleep_after: f32,
    /// Kilograms besides those of its shape, 0 or more. With extra_centre and extra_inertia 0 it makes the shape heavier as it
    /// is.
    pub extra_mass: f32,
    /// Where the extra mass is, from the body's origin, metres.
    pub extra_centre: [f32; 3],
    /// Its moments of inertia about the body's x, y and z through that centre, kg m², 0 or more.
    pub extra_inertia: [f32; 3],
    /// Iterations of the solver that it gets more than others, and what touches it; 0 to 1000.
    pub extra_solver_iterations: u32,
    /// Iterations within each of them, 0 to 1000.
    pub extra_pgs_iterations: u32,
    /// DCD_HOOK_… bits of its shape: the functions of dcd_hooks_set that are asked about it.
    pub hooks: u32,
    /// Your own; events, views and ray hits carry it.
    pub user_data: u64,
    /// Your own of its shape, as the number of a material (DcdColliderProperties.user_data); contacts and hits carry it.
    pub material: u64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdBodyDef {
    const NAME: &'static str = "DcdBodyDef";
}

/// Definitions by which bodies were made last, and what is recorded of these. Bodies that are made one after the other are mostly of a few
/// kinds: those of a kind share it, and are not checked and described each.
#[derive(Default)]
pub(crate) struct Made {
    kinds: Vec<(DcdBodyDef, Arc<BodyTraits>)>,
    /// Which of them is replaced by the next.
    oldest: usize,
}

impl Made {
    /// So many kinds are kept.
    const MOST: usize = 4;

    /// Returns what is recorded of a body that was made like this one, elsewhere perhaps, in another motion and with other user data.
    pub(crate) fn like(&self, def: &DcdBodyDef) -> Option<&Arc<BodyTraits>> {
        let is_like = |known: &DcdBodyDef| {
            let head = |def: &DcdBodyDef| (def.struct_size, def.body_type, def.material);
            head(known) == head(def) && bulk(known) == bulk(def)
        };
        self.kinds.iter().find(|(known, _)| is_like(known)).map(|(_, traits)| traits)
    }

    /// Keeps what is recorded of a checked body that is like none of these.
    pub(crate) fn keep(&mut self, def: &DcdBodyDef, traits: Arc<BodyTraits>) {
        if self.kinds.len() < Self::MOST {
            self.kinds.push((*def, traits));
        } else {
            self.kinds[self.oldest] = (*def, traits);
            self.oldest = (self.oldest + 1) % Self::MOST;
        }
    }
}

/// Returns the bytes of all members from the shape to what comes before the user data: to compare them one by one takes several times as long. NaN,
/// which no checked definition has, is equal to itself here, and 0 is not to -0.
fn bulk(def: &DcdBodyDef) -> &[u8] {
    const BEGIN: usize = offset_of!(DcdBodyDef, shape);
    const END: usize = offset_of!(DcdBodyDef, user_data);
    // No byte of it is padding: a handle, and numbers of four bytes each.
    const { assert!(END - BEGIN == size_of::<DcdShapeId>() + NUMBERS * size_of::<u32>()) };
    // SAFETY: it lies within the definition, and all of its bytes are those of numbers.
    unsafe { std::slice::from_raw_parts((&raw const *def).cast::<u8>().add(BEGIN), END - BEGIN) }
}

/// How many numbers are between the shape and the user data.
const NUMBERS: usize = 34;
