//! Creates and drives vehicles: bodies on wheels that are driven where they are computed.

use dcd::{Drive, Vehicle, Wheel};

use crate::body::{self, DcdBodyDef};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out, Sized32, check_reserved};
use crate::registry::{find, with};
use crate::status::{DcdStatus, Failure};
use crate::types::DCD_DYNAMIC;

/// A wheel of a vehicle. Points and directions are relative to the chassis. Start from DCD_WHEEL_INIT: of a car of a tonne, forward along
/// x, upward along y, neither driven nor steered.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdWheel {
    /// The place where its suspension begins, metres, within 100 of the chassis.
    pub at: [f32; 3],
    /// The direction in which its suspension points, of length 1.
    pub down: [f32; 3],
    /// Its axle, of length 1: it rolls forward in the direction of axle x down.
    pub axle: [f32; 3],
    /// The length of its suspension without a load, metres, 0 to 100.
    pub rest_length: f32,
    /// The way by which the suspension is pressed from there at most, metres, 0 to 100.
    pub travel: f32,
    /// Its radius, metres, above 0 and at most 100.
    pub radius: f32,
    /// The stiffness of its suspension per kilogram of the chassis, 1/s², 0 to 1e9.
    pub stiffness: f32,
    /// The damping of its suspension as it is pressed, per kilogram of the chassis, 1/s, 0 to 1e9.
    pub compression: f32,
    /// The damping of its suspension as it is released, per kilogram of the chassis, 1/s, 0 to 1e9.
    pub relaxation: f32,
    /// The greatest force of its suspension, newtons, 0 to 1e9.
    pub max_force: f32,
    /// Its grip, 0 to 1000: across, and along twice as much, it holds up to this many times the force that its suspension bears.
    pub grip: f32,
    /// The part of a sideways slip that it takes, 0 to 1: with 1 a fifth in each substep.
    pub side_grip: f32,
    /// The force of the engine on it at full throttle, newtons, 0 to 1e9.
    pub engine_force: f32,
    /// The force of its brake, newtons, 0 to 1e9.
    pub brake_force: f32,
    /// The angle by which it turns when steered, radians, -pi / 2 to pi / 2; above 0 to the left.
    pub steering: f32,
}

/// The settings of a vehicle. Start from DCD_VEHICLE_DEF_INIT: a car of 3.2 x 1.6 m and about a tonne, driven behind, steered in front.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdVehicleDef {
    /// sizeof(DcdVehicleDef).
    pub struct_size: u32,
    /// The number of wheels, 1 to 32; 0 for the four of that car.
    pub wheel_count: u32,
    /// The wheels; null with a wheel_count of 0. They are copied.
    pub wheels: *const DcdWheel,
    /// The speed above which its engine does not speed it up, m/s, above 0 and at most 10000.
    pub top_speed: f32,
    /// 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number or a pointer.
unsafe impl Sized32 for DcdVehicleDef {
    const NAME: &'static str = "DcdVehicleDef";
}

/// The controls of a vehicle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdDrive {
    /// The part of the engine's force, -1 (backward) to 1.
    pub throttle: f32,
    /// The part of the brakes' force, 0 to 1; with throttle it has no effect on wheels that are driven.
    pub brake: f32,
    /// The part of the wheels' steering angle, -1 to 1.
    pub steering: f32,
}

/// Creates a body, of DCD_DYNAMIC, that is a vehicle: its chassis stands on wheels, each a ray along its suspension to the nearest
/// collider that the chassis may collide with. dcd_vehicle_drive says what its driver does. What it stands on feels nothing of it.
///
/// In a served world it is driven by the node that computes it, also that of a client, without a delay between wheels and ground. A
/// client's is bounded: 8 wheels within 10 m, a top_speed of at most the world's avatar_speed, suspensions that together speed it up by at
/// most 200 m/s² (stiffness x travel) and are damped by at most 60 1/s. One above 1e9 kg, or at more than 1e5 m/s, has no wheels.
/// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT for another body_type or a setting out of range.
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

/// Says what the driver of a vehicle does from now on, and wakes it: an avatar of this process, or any of a local world or a server.
/// In a served world the next dcd_step asks for it.
///
/// Errors: DCD_ERR_UNSUPPORTED for a body that this process may not drive, DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for
/// numbers out of range or a body that is no vehicle.
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
