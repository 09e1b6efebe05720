//! Reads how characters and vehicles stand: on what, how steep it is, and where each wheel is.

use dcd::{Ground, WheelState};

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::material::material;
use crate::pointer::{Out, Room, Sized32};
use crate::registry::{World, ask, find};
use crate::status::DcdStatus;
use crate::types::DcdPose;

/// Ground under a character or a wheel. Where there is none, `body` is null and all else is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdGround {
    /// Body that is the ground.
    pub body: DcdBodyId,
    /// user_data of its collider there, such as the number of a material.
    pub material: u64,
    /// Point on its surface, world space, metres.
    pub point: [f64; 3],
    /// Normal there, out of the ground, of length 1.
    pub normal: [f32; 3],
    /// Angle between the normal and the direction against gravity, radians: 0 on level ground.
    pub slope: f32,
    /// Number of the collider, from 0.
    pub collider: u32,
    /// Reserved; always 0.
    pub reserved: u32,
}

/// Stance of a character after the last step. Start from DCD_CHARACTER_STATE_INIT. The struct may grow at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdCharacterState {
    /// Size of this struct: sizeof(DcdCharacterState).
    pub struct_size: u32,
    /// Says whether the character stands on something. Only then can it jump.
    pub grounded: bool,
    /// Says whether the character slides down ground that is steeper than its min_slide.
    pub sliding: bool,
    /// Reserved; always 0.
    pub reserved: [u8; 2],
    /// Flattest ground that the character touches; none in the air, and where what it stood on has gone in the same step.
    pub ground: DcdGround,
}

// SAFETY: begins with `struct_size`; it is only written, so any bits in its bools do no harm.
unsafe impl Sized32 for DcdCharacterState {
    const NAME: &'static str = "DcdCharacterState";
}

/// State of a wheel after the last step: where to draw it, and on what it stands.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdWheelState {
    /// Centre of the wheel in world space, and its rotation: that of the chassis, then steered, then rolled.
    pub pose: DcdPose,
    /// Length of the suspension, from DcdWheel.at to the centre of the wheel, metres.
    pub suspension: f32,
    /// Angle by which the wheel is steered about its suspension, radians; above 0 to the left.
    pub steering: f32,
    /// Angle by which the wheel has rolled forward, radians, -pi to pi; 0 at first, and after dcd_snapshot_load.
    pub rolled: f32,
    /// Speed at which the wheel rolls forward, rad/s. In the air it slows down by 1 % per step.
    pub spin: f32,
    /// Ground on which the wheel stands; none in the air.
    pub ground: DcdGround,
}

/// Reads how a character of a local world stands after the last step: whether it is on the ground, on what, how steep that is, and
/// whether it slides down it. A character that has just been created is in the air until the next step.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a body that is no character (dcd_character_create).
/// - DCD_ERR_UNSUPPORTED: in a served world, which tells where characters are and no more. Submit a ray or a cast downwards there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_character_state(
    world: DcdWorld,
    character: DcdBodyId,
    out: *mut DcdCharacterState,
) -> DcdStatus {
    guard("dcd_character_state", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let state = world.dcd.character_state(find(world, character)?)?;
            out.write(DcdCharacterState {
                struct_size: size_of::<DcdCharacterState>() as u32,
                grounded: state.grounded,
                sliding: state.sliding,
                reserved: [0; 2],
                ground: ground(world, state.ground),
            });
            Ok(())
        })
    })
}

/// Reads the state of each wheel of a vehicle of a local world after the last step, in the order of DcdVehicleDef.wheels: where to
/// draw it, and on what it stands. Each call casts a ray for every wheel.
///
/// Writes the wheels to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
/// number.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
/// - DCD_ERR_ARGUMENT: a body that is no vehicle (dcd_vehicle_create).
/// - DCD_ERR_UNSUPPORTED: in a served world, which tells where vehicles are and no more. Submit a ray for each wheel there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_vehicle_wheels(
    world: DcdWorld,
    vehicle: DcdBodyId,
    out: *mut DcdWheelState,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_vehicle_wheels", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            let wheels = world.dcd.wheels(find(world, vehicle)?)?;
            out.fill(wheels.iter().map(|wheel| wheel_state(world, wheel)))
        })
    })
}

fn wheel_state(world: &World, wheel: &WheelState) -> DcdWheelState {
    DcdWheelState {
        pose: wheel.pose.into(),
        suspension: wheel.suspension_m,
        steering: wheel.steering_rad,
        rolled: wheel.rolled_rad,
        spin: wheel.spin_rad_s,
        ground: ground(world, wheel.ground),
    }
}

fn ground(world: &World, ground: Option<Ground>) -> DcdGround {
    let Some(Ground { collider, point, normal, slope_rad, .. }) = ground else {
        return DcdGround {
            body: DcdBodyId { v: 0 },
            material: 0,
            point: [0.0; 3],
            normal: [0.0; 3],
            slope: 0.0,
            collider: 0,
            reserved: 0,
        };
    };
    DcdGround {
        body: world.mark.body(collider.body),
        material: material(&world.dcd, collider.body, collider.index),
        point,
        normal,
        slope: slope_rad,
        collider: collider.index as u32,
        reserved: 0,
    }
}
