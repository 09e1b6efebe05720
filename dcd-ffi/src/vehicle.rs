//! Creates and drives vehicles: bodies on wheels that are driven where they are computed.

use dcd::{Drive, Vehicle, Wheel};

use crate::body::{self, DcdBodyDef};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out, Sized32, check_reserved};
use crate::registry::{find, with};
use crate::status::{DcdStatus, Failure};
use crate::types::DCD_DYNAMIC;

/// Wheel of a vehicle. Points and directions are relative to the chassis. Start from DCD_WHEEL_INIT: a wheel of a car of a tonne,
/// forward along x, upward along y, neither driven nor steered.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdWheel {
    /// Point where the suspension begins, metres, within 100 of the chassis.
    pub at: [f32; 3],
    /// Direction in which the suspension points, of length 1.
    pub down: [f32; 3],
    /// Direction of the axle, of length 1: the wheel rolls forward in the direction of axle x down.
    pub axle: [f32; 3],
    /// Length of the suspension without a load, metres, 0 to 100.
    pub rest_length: f32,
    /// Largest way by which the suspension is pressed from rest_length, metres, 0 to 100.
    pub travel: f32,
    /// Radius of the wheel, metres, above 0 and at most 100.
    pub radius: f32,
    /// Stiffness of the suspension per kilogram of the chassis, 1/s², 0 to 1e9.
    pub stiffness: f32,
    /// Damping of the suspension as it is pressed, per kilogram of the chassis, 1/s, 0 to 1e9.
    pub compression: f32,
    /// Damping of the suspension as it is released, per kilogram of the chassis, 1/s, 0 to 1e9.
    pub relaxation: f32,
    /// Largest force of the suspension, newtons, 0 to 1e9.
    pub max_force: f32,
    /// Grip, 0 to 1000: across, the wheel holds up to this many times the force that its suspension bears; along, twice as much.
    pub grip: f32,
    /// Part of a sideways slip that the wheel takes, 0 to 1; with 1 it takes a fifth in each substep.
    pub side_grip: f32,
    /// Force of the engine on the wheel at full throttle, newtons, 0 to 1e9.
    pub engine_force: f32,
    /// Force of the wheel's brake, newtons, 0 to 1e9.
    pub brake_force: f32,
    /// Angle by which the wheel turns when steered, radians, -pi / 2 to pi / 2; above 0 to the left.
    pub steering: f32,
}

/// Settings of a vehicle. Start from DCD_VEHICLE_DEF_INIT: a car of 3.2 x 1.6 m and about a tonne, driven behind, steered in front.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdVehicleDef {
    /// Size of this struct: sizeof(DcdVehicleDef).
    pub struct_size: u32,
    /// Number of wheels, 1 to 32; 0: the four of that car.
    pub wheel_count: u32,
    /// Wheels, which are copied; null with a wheel_count of 0.
    pub wheels: *const DcdWheel,
    /// Speed above which the engine does not speed the vehicle up, m/s, above 0 and at most 10000.
    pub top_speed: f32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number or a pointer.
unsafe impl Sized32 for DcdVehicleDef {
    const NAME: &'static str = "DcdVehicleDef";
}

/// Controls of a vehicle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdDrive {
    /// Part of the engine's force, -1 (backward) to 1.
    pub throttle: f32,
    /// Part of the brakes' force, 0 to 1. With throttle it has no effect on wheels that are driven.
    pub brake: f32,
    /// Part of the wheels' steering angle, -1 to 1.
    pub steering: f32,
}

/// Creates a vehicle: a body, of DCD_DYNAMIC, that is a chassis on wheels. Each wheel is a ray along its suspension to the nearest
/// collider that the chassis may collide with. dcd_vehicle_drive says what its driver does. What the vehicle stands on feels
/// nothing of it.
///
/// In a served world the node that computes the vehicle drives it, also a client's, without a delay between wheels and ground. A
/// client's vehicle is bounded:
/// - It has at most 8 wheels, within 10 m.
/// - Its top_speed is at most the world's avatar_speed.
/// - Its suspensions together speed it up by at most 200 m/s² (stiffness x travel), and are damped by at most 60 1/s.
///
/// A vehicle above 1e9 kg, or at more than 1e5 m/s, has no wheels.
/// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT (another body_type or a setting out of range).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_vehicle_create(
    world: DcdWorld,
    body: *const DcdBodyDef,
    vehicle: *const DcdVehicleDef,
    out: *mut DcdBodyId,
) -> DcdStatus {
    guard("dcd_vehicle_create", || {
        // SAFETY: the caller vouches for `body`, `vehicle` and `out`.
        let (body, vehicle, out) = unsafe {
            (
                pointer::read_sized(body, "body")?,
                pointer::read_sized(vehicle, "vehicle")?,
                Out::new(out, "out")?,
            )
        };
        check_reserved(vehicle.reserved)?;
        if body.body_type != DCD_DYNAMIC {
            let given = body.body_type;
            return Err(Failure::argument(format!("body_type is {given}; a vehicle is of DCD_DYNAMIC")));
        }
        let count = vehicle.wheel_count as usize;
        if count > dcd::protocol::MAX_WHEELS {
            return Err(Failure::argument(format!("wheel_count is {count}; a vehicle has 1 to 32")));
        }
        // SAFETY: the caller vouches for that many wheels.
        let wheels = unsafe { pointer::slice(vehicle.wheels, count, "wheels")? };
        let wheels = match wheels {
            [] => Vehicle::default().wheels,
            wheels => wheels.iter().map(wheel).collect(),
        };
        let vehicle = Vehicle { wheels, top_speed_m_s: vehicle.top_speed };
        with(world, |world| {
            let new = body::parse(world, &body)?;
            let id = world.dcd.insert_vehicle(new.pose, &vehicle, new.body, [new.collider])?;
            out.write(world.mark.body(id));
            Ok(())
        })
    })
}

/// Sets what the driver of a vehicle does from now on, and wakes the vehicle. A client or participant drives its own avatars; a
/// local world or a server drives any vehicle, and a builder those of the world's own. In a served world the next dcd_step asks for
/// it.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: numbers out of range, or a body that is no vehicle.
/// - DCD_ERR_UNSUPPORTED: a body that this process may not drive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_vehicle_drive(
    world: DcdWorld,
    vehicle: DcdBodyId,
    drive: *const DcdDrive,
) -> DcdStatus {
    guard("dcd_vehicle_drive", || {
        // SAFETY: the caller vouches for the pointer.
        let DcdDrive { throttle, brake, steering } = unsafe { pointer::read(drive, "drive")? };
        with(world, |world| {
            let id = find(world, vehicle)?;
            Ok(world.dcd.drive(id, Drive { throttle, brake, steering })?)
        })
    })
}

fn wheel(wheel: &DcdWheel) -> Wheel {
    Wheel {
        at_m: wheel.at,
        down: wheel.down,
        axle: wheel.axle,
        rest_m: wheel.rest_length,
        travel_m: wheel.travel,
        radius_m: wheel.radius,
        stiffness: wheel.stiffness,
        compression: wheel.compression,
        relaxation: wheel.relaxation,
        most_force_n: wheel.max_force,
        grip: wheel.grip,
        side_grip: wheel.side_grip,
        engine_n: wheel.engine_force,
        brake_n: wheel.brake_force,
        steering_rad: wheel.steering,
    }
}
