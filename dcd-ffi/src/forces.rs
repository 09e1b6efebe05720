//! Pushes bodies by explosions, water and wind, and lists the bodies inside a sensor.

use dcd::{Bounds, Explosion, Fluid};

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{
    self, Out, Room, Sized32, check_not_negative, check_numbers, check_point, check_reserved,
};
use crate::registry::{ask, find, with};
use crate::status::{DcdStatus, Failure};

/// Explosion. Start from DCD_EXPLOSION_INIT and give its centre. The struct may grow at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdExplosion {
    /// Size of this struct: sizeof(DcdExplosion).
    pub struct_size: u32,
    /// Groups of which a collider must be in one to be pushed, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Centre of the explosion, world space, metres.
    pub centre: [f64; 3],
    /// Distance up to which the explosion has its full strength, metres, 0 or more; to the nearest point of a collider.
    pub radius: f32,
    /// Distance beyond `radius` in which the explosion weakens, linearly down to nothing, metres, 0 or more.
    pub falloff: f32,
    /// Impulse per area of the silhouette that a collider shows to the explosion, N s/m²; negative draws bodies in.
    pub impulse: f32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdExplosion {
    const NAME: &'static str = "DcdExplosion";
}

/// Fluid, water or air, in a box. Start from DCD_FLUID_INIT. The struct may grow at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdFluid {
    /// Size of this struct: sizeof(DcdFluid).
    pub struct_size: u32,
    /// Groups of which a collider must be in one to be pushed, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Lowest corner of the box that the fluid is in, metres; may be infinite.
    pub min: [f64; 3],
    /// Highest corner of the box that the fluid is in, metres; may be infinite.
    pub max: [f64; 3],
    /// Height at which the fluid stands, metres from the origin against gravity (along +y without gravity); infinite where it fills
    /// its box.
    pub surface: f64,
    /// Density, kg/m³, 0 or more.
    pub density: f32,
    /// Velocity at which the fluid flows, or the wind blows, m/s.
    pub velocity: [f32; 3],
    /// Coefficient c of drag, 0 or more: 0.5 for balls, 1 for boxes.
    pub drag: f32,
    /// Rate at which motion and spin die down besides, for a body as heavy as what it displaces, 1/s, 0 or more.
    pub damping: f32,
    /// Coefficient l of dynamic lift, 0 or more: 1 for plates, 0 for none.
    pub lift: f32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdFluid {
    const NAME: &'static str = "DcdFluid";
}

/// Pushes all dynamic bodies near a place away from it, once and at once, and wakes them. Writes their number to `pushed`, which
/// may be null.
///
/// Each of their colliders near the place that is no sensor is pushed at its nearest point, away from the centre, by its
/// silhouette: of two bodies of one size the lighter flies off faster. Walls give no shelter: cast rays to know of them. No body
/// becomes faster by it than the world's speed limit.
///
/// `explosion` is read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range. Then nothing is pushed.
/// - DCD_ERR_UNSUPPORTED: in a served world. Its server finds bodies by dcd_overlap_shapes_submit and pushes them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_explode(
    world: DcdWorld,
    explosion: *const DcdExplosion,
    pushed: *mut usize,
) -> DcdStatus {
    guard("dcd_explode", || {
        // SAFETY: the caller vouches for both pointers.
        let (given, pushed) =
            unsafe { (pointer::read_sized(explosion, "explosion")?, Out::optional(pushed, "pushed")?) };
        check_reserved(given.reserved)?;
        check_point(&given.centre, "centre")?;
        check_not_negative(given.radius, "radius")?;
        check_not_negative(given.falloff, "falloff")?;
        check_numbers(&[given.impulse], "impulse")?;
        let explosion = Explosion {
            centre: given.centre,
            radius_m: given.radius,
            falloff_m: given.falloff,
            impulse_ns_m2: given.impulse,
            mask: given.mask,
        };
        with(world, |world| {
            let count = world.dcd.explode(&explosion)?;
            pushed.into_iter().for_each(|pushed| pushed.write(count));
            Ok(())
        })
    })
}

/// Pushes the dynamic bodies that are in a fluid as the fluid does in one step, and wakes them. Call it before each dcd_step, for
/// each lake and each wind. Writes the number of bodies to `pushed`, which may be null.
///
/// The fluid acts on each collider that is no sensor and whose box (AABB) touches the box of the fluid, by the part of it below the
/// surface:
/// - Buoyancy. The weight of the fluid that it displaces lifts it, at the centre of that volume.
/// - Drag. 1/2 density drag A v² acts at the centre of mass, by the silhouette A against the motion v through the fluid.
/// - Dynamic lift. Each face that is turned to the motion, with a shadow A, is pressed by 1/2 density lift A v² against its normal;
///   of this, what is across the flow counts. It lifts sails and leaves.
/// - Damping. Motion and spin die down by `damping` times the mass displaced over the body's own.
///
/// Neither drag nor damping ever turns a motion about. Buoyancy comes at once and weight over the step. So between two steps what
/// floats at rest has a velocity of up to half of gravity times dt downwards, and does not move. Terrain and open meshes displace
/// nothing and are left alone. The border of rounded shapes does not count, as it does not for their mass. No fluid makes a body
/// faster than the world's speed limit.
///
/// `fluid` is read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range, or a min above its max. Then nothing is pushed.
/// - DCD_ERR_UNSUPPORTED: in a served world. Its server finds bodies by dcd_overlap_boxes_submit and pushes them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_flow(world: DcdWorld, fluid: *const DcdFluid, pushed: *mut usize) -> DcdStatus {
    guard("dcd_flow", || {
        // SAFETY: the caller vouches for both pointers.
        let (given, pushed) =
            unsafe { (pointer::read_sized(fluid, "fluid")?, Out::optional(pushed, "pushed")?) };
        if !(0..3).all(|i| given.min[i] <= given.max[i]) {
            return Err(Failure::argument("min is above max, or NaN; give the corners of a box"));
        }
        if given.surface.is_nan() {
            return Err(Failure::argument("surface is NaN; give metres, or infinity where it fills its box"));
        }
        check_numbers(&given.velocity, "velocity")?;
        check_not_negative(given.density, "density")?;
        check_not_negative(given.drag, "drag")?;
        check_not_negative(given.damping, "damping")?;
        check_not_negative(given.lift, "lift")?;
        check_reserved(given.reserved)?;
        let fluid = Fluid {
            bounds: Bounds { min: given.min, max: given.max },
            surface_m: given.surface,
            density_kg_m3: given.density,
            velocity_m_s: given.velocity,
            drag: given.drag,
            lift: given.lift,
            damping_per_s: given.damping,
            mask: given.mask,
        };
        with(world, |world| {
            let count = world.dcd.flow(&fluid)?;
            pushed.into_iter().for_each(|pushed| pushed.write(count));
            Ok(())
        })
    })
}

/// Lists the movable bodies that overlap a sensor, oldest first, as the world is now: asleep or not, whichever region they are in,
/// also when they were made or moved since the last step.
///
/// `collider` says which collider of `body` is the sensor, from 0. Groups and masks of both colliders count. Other sensors and
/// fixed bodies are not listed, and no events need be asked for. dcd_events reports which bodies come and go.
///
/// Writes the ids to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
/// number.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a collider that is not there or is no sensor.
/// - DCD_ERR_SMALL_BUFFER: `count` is written all the same, `out` is not.
/// - DCD_ERR_UNSUPPORTED: in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_sensor_bodies(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    out: *mut DcdBodyId,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_sensor_bodies", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            let inside = world.dcd.inside((find(world, body)?, collider as usize))?;
            out.fill(inside.iter().map(|&body| world.mark.body(body)))
        })
    })
}
