//! Creates characters: bodies that walk by themselves where they are computed.

use dcd::Character;

use crate::body::{self, DcdBodyDef};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out, Sized32, check_reserved};
use crate::registry::with;
use crate::status::{DcdStatus, Failure};
use crate::types::DCD_KINEMATIC;

/// Settings of a character. Start from DCD_CHARACTER_DEF_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdCharacterDef {
    /// Size of this struct: sizeof(DcdCharacterDef).
    pub struct_size: u32,
    /// Height of the highest step that the character climbs without a jump, metres, 0 to 100; 0: it climbs none.
    pub step_height: f32,
    /// Free floor that there must be on a step, metres, 0 to 100.
    pub step_depth: f32,
    /// Steepest slope that the character climbs, radians, 0 to pi / 2.
    pub max_climb: f32,
    /// Least steep slope that the character slides down, radians, 0 to pi / 2.
    pub min_slide: f32,
    /// Height by which the character is drawn down to the ground as it walks downhill, metres, 0 to 100; 0: it is in the air
    /// instead.
    pub snap: f32,
    /// Gap that the character keeps from all else, metres, above 0 and at most 1.
    pub gap: f32,
    /// Mass with which the character pushes dynamic bodies and stands on them, kilograms, 0 to 1e9; 0: it pushes none.
    pub mass: f32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdCharacterDef {
    const NAME: &'static str = "DcdCharacterDef";
}

/// Creates a character: a body, of DCD_KINEMATIC, that walks by itself. It walks on what it stands on, slides along walls, climbs
/// steps and slopes, falls, rides on what moves, and pushes what is in its way.
///
/// dcd_body_set_velocity says where the character wants to go: along the ground, and upwards to jump, which it can from the ground.
/// With a gravity_scale of 0 it flies as it wants, and collides all the same. dcd_body_get tells how it moves. Its shape must have
/// volume. dcd_collider_add gives it further shapes, which only meet what comes.
///
/// In a served world the node that computes the character walks it, also a client's: it stops at a wall without a delay, and its
/// client cannot put it elsewhere (dcd_body_set_pose). A client may have 32 characters and vehicles together. Its characters take
/// steps (step_height, step_depth, snap) of at most 1 m, keep a gap of at most 0.1 m, and weigh at most 10,000 kg.
/// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT (another body_type, a sensor, a shape without volume such as terrain or a
/// segment, or a setting out of range).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_character_create(
    world: DcdWorld,
    body: *const DcdBodyDef,
    character: *const DcdCharacterDef,
    out: *mut DcdBodyId,
) -> DcdStatus {
    guard("dcd_character_create", || {
        // SAFETY: the caller vouches for `body`, `character` and `out`.
        let (body, character, out) = unsafe {
            (
                pointer::read_sized(body, "body")?,
                pointer::read_sized(character, "character")?,
                Out::new(out, "out")?,
            )
        };
        check_reserved(character.reserved)?;
        if body.body_type != DCD_KINEMATIC {
            let given = body.body_type;
            return Err(Failure::argument(format!("body_type is {given}; a character is of DCD_KINEMATIC")));
        }
        let character = Character {
            step_height_m: character.step_height,
            step_depth_m: character.step_depth,
            max_climb_rad: character.max_climb,
            min_slide_rad: character.min_slide,
            snap_m: character.snap,
            gap_m: character.gap,
            mass_kg: character.mass,
        };
        with(world, |world| {
            let new = body::parse(world, &body)?;
            let id = world.dcd.insert_character(new.pose, &character, new.body, [new.collider])?;
            out.write(world.mark.body(id));
            Ok(())
        })
    })
}
