//! Defines the definition of a body, and keeps those by which bodies were made last.

use std::mem::offset_of;
use std::sync::Arc;

use dcd::protocol::BodyTraits;

use crate::ids::DcdShapeId;
use crate::pointer::Sized32;
use crate::types::{DcdBodyType, DcdCombineRule, DcdPose, DcdVelocity};

/// Definition of a body. Start from DCD_BODY_DEF_INIT and give at least `shape`. dcd_body_set_properties and
/// dcd_collider_set_properties change it later.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdBodyDef {
    /// Size of this struct: sizeof(DcdBodyDef).
    pub struct_size: u32,
    /// Type: DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    pub body_type: DcdBodyType,
    /// Pose at first.
    pub pose: DcdPose,
    /// Velocity at first.
    pub velocity: DcdVelocity,
    /// Shape of its first collider, of the same world. Two bodies may share one. dcd_collider_add gives a body more.
    pub shape: DcdShapeId,
    /// Density, kg/m³, 0 or more. A dynamic body needs mass by density, `mass` or `extra_mass`. A mesh that is not closed, and
    /// terrain, have none by density.
    pub density: f32,
    /// Mass of the shape, kilograms, instead of that by density; 0: by density.
    pub mass: f32,
    /// Friction: Coulomb coefficient, 0 or more.
    pub friction: f32,
    /// Restitution, 0 (no bounce) to 1 (all of the speed).
    pub restitution: f32,
    /// DCD_COMBINE_… rule by which two bodies in contact combine their friction.
    pub friction_rule: DcdCombineRule,
    /// DCD_COMBINE_… rule by which two bodies in contact combine their restitution.
    pub restitution_rule: DcdCombineRule,
    /// Distance that the shape is kept away from others, metres, 0 or more. A thin cushion makes contacts cheaper and calmer.
    pub contact_skin: f32,
    /// Damping of movement, 1/s, 0 or more.
    pub linear_damping: f32,
    /// Damping of turning, 1/s, 0 or more.
    pub angular_damping: f32,
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// DCD_BODY_… bits.
    pub flags: u32,
    /// DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    pub locked: u32,
    /// DCD_EVENT_… bits. A contact is reported when either body asks for it.
    pub events: u32,
    /// Force above which DCD_EVENT_FORCE reports a contact, newtons, 0 or more.
    pub force_threshold: f32,
    /// Groups that the body belongs to, as bits.
    pub groups: u32,
    /// Groups that the body meets, as bits. Two bodies collide when each meets a group of the other.
    pub mask: u32,
    /// Groups that the body belongs to when it comes to pushing, as bits. Contacts of bodies that do not push each other are
    /// reported and do nothing.
    pub solver_groups: u32,
    /// Groups that push the body and that it pushes, as bits.
    pub solver_mask: u32,
    /// DCD_PAIR_… bits: which types of bodies the body meets. A pair meets when either body asks for it.
    pub pairs: u32,
    /// Dominance, -128 to 127. Of two bodies in contact, the higher is not moved by the lower, which meets it like a wall at rest:
    /// Rapier leaves the velocity of the higher out, so that it neither pushes nor carries the lower. A kinematic body does both.
    pub dominance: i32,
    /// Distance ahead at which the body looks for what it may meet, metres; 0: none. It is cheaper than DCD_BODY_CCD, and not as
    /// sure.
    pub soft_ccd: f32,
    /// Speed below which the body may fall asleep, m/s, 0 or more.
    pub sleep_linear: f32,
    /// Spin below which the body may fall asleep, rad/s, 0 or more.
    pub sleep_angular: f32,
    /// Time that the body must have been so slow before it falls asleep, seconds, 0 or more. In a served world sleep_linear,
    /// sleep_angular and sleep_after must be as in DCD_BODY_DEF_INIT.
    pub sleep_after: f32,
    /// Mass besides that of the shape, kilograms, 0 or more. With extra_centre and extra_inertia 0 it makes the shape heavier as it
    /// is.
    pub extra_mass: f32,
    /// Centre of the extra mass, from the body's origin, metres.
    pub extra_centre: [f32; 3],
    /// Moments of inertia of the extra mass about the body's x, y and z through extra_centre, kg m², 0 or more.
    pub extra_inertia: [f32; 3],
    /// Number of solver iterations more than others have, for the body and what touches it, 0 to 1000.
    pub extra_solver_iterations: u32,
    /// Number of additional iterations within each solver iteration, 0 to 1000.
    pub extra_pgs_iterations: u32,
    /// DCD_HOOK_… bits of its shape: the functions of dcd_hooks_set that are asked about it.
    pub hooks: u32,
    /// User data of the body; events, views and ray hits carry it.
    pub user_data: u64,
    /// User data of its shape, such as the number of a material (DcdColliderProperties.user_data); contacts and hits carry it.
    pub material: u64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdBodyDef {
    const NAME: &'static str = "DcdBodyDef";
}

/// Definitions by which bodies were made last, and what is recorded of these bodies. Bodies that are made one after the other are
/// mostly of a few kinds. Bodies of one kind share the record, and are not checked and described one by one.
#[derive(Default)]
pub(crate) struct Made {
    kinds: Vec<(DcdBodyDef, Arc<BodyTraits>)>,
    /// Index of the definition that the next one replaces.
    oldest: usize,
}

impl Made {
    /// Number of kinds that are kept.
    const MOST: usize = 4;

    /// Returns what is recorded of a body that was made like this one. Place, motion and user data may differ.
    pub(crate) fn like(&self, def: &DcdBodyDef) -> Option<&Arc<BodyTraits>> {
        let is_like = |known: &DcdBodyDef| {
            let head = |def: &DcdBodyDef| (def.struct_size, def.body_type, def.material);
            head(known) == head(def) && bulk(known) == bulk(def)
        };
        self.kinds.iter().find(|(known, _)| is_like(known)).map(|(_, traits)| traits)
    }

    /// Keeps what is recorded of a checked body that is like none of those kept.
    pub(crate) fn keep(&mut self, def: &DcdBodyDef, traits: Arc<BodyTraits>) {
        if self.kinds.len() < Self::MOST {
            self.kinds.push((*def, traits));
        } else {
            self.kinds[self.oldest] = (*def, traits);
            self.oldest = (self.oldest + 1) % Self::MOST;
        }
    }
}

/// Returns the bytes of all members from the shape to the last one before the user data. To compare the members one by one takes
/// several times as long. NaN, which no checked definition has, equals itself here, and 0 does not equal -0.
fn bulk(def: &DcdBodyDef) -> &[u8] {
    const BEGIN: usize = offset_of!(DcdBodyDef, shape);
    const END: usize = offset_of!(DcdBodyDef, user_data);
    // None of these bytes is padding: they are those of a handle, and of numbers of four bytes each.
    const { assert!(END - BEGIN == size_of::<DcdShapeId>() + NUMBERS * size_of::<u32>()) };
    // SAFETY: the bytes lie within the definition, and all of them are those of numbers.
    unsafe { std::slice::from_raw_parts((&raw const *def).cast::<u8>().add(BEGIN), END - BEGIN) }
}

/// How many numbers lie between the shape and the user data.
const NUMBERS: usize = 34;
