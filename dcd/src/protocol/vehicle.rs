//! Describes vehicles: bodies whose wheels are rays (Rapier's ray-cast vehicle controller), driven where they
//! are computed.

use std::f32::consts::FRAC_PI_2;

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// The most wheels of a vehicle.
pub const MAX_WHEELS: usize = 32;

/// The settings of a vehicle: a dynamic body, its chassis, that stands on wheels and is driven by them
/// ([`Drive`]).
///
/// Each wheel is a ray along its suspension, to the nearest collider with which the chassis may collide. A
/// body on which a wheel stands feels nothing of it.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Vehicle {
    /// The wheels, 1 to [`MAX_WHEELS`] (32).
    pub wheels: Vec<Wheel>,
    /// The speed above which the engine does not accelerate the vehicle, m/s; above 0, at most 10,000.
    pub top_speed_m_s: f32,
}

/// A wheel of a vehicle. All points and directions are relative to the chassis. Lengths are 0 to 100 m.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Wheel {
    /// The point where the suspension begins, metres.
    pub at_m: [f32; 3],
    /// The direction of the suspension, of length 1.
    pub down: [f32; 3],
    /// The axle, of length 1, across the suspension. The wheel rolls forward in the direction of `axle` ×
    /// `down`.
    pub axle: [f32; 3],
    /// The length of the suspension without a load, metres.
    pub rest_m: f32,
    /// The distance by which the suspension can be compressed from there, metres.
    pub travel_m: f32,
    /// The radius of the wheel, metres; above 0.
    pub radius_m: f32,
    /// The stiffness of the suspension per kilogram of the chassis, 1/s², 0 to 1e9.
    pub stiffness: f32,
    /// The damping of the suspension while it is compressed, per kilogram of the chassis, 1/s, 0 to 1e9.
    pub compression: f32,
    /// The damping of the suspension while it is released, per kilogram of the chassis, 1/s, 0 to 1e9.
    pub relaxation: f32,
    /// The greatest force of the suspension, newtons, 0 to 1e9.
    pub most_force_n: f32,
    /// The grip, 0 to 1,000: the wheel holds up to this many times the force that its suspension bears across
    /// its direction, and twice as much along it.
    pub grip: f32,
    /// The part of a sideways slip that the wheel takes, 0 to 1: with 1, a fifth in each substep.
    pub side_grip: f32,
    /// The force of the engine on this wheel at full throttle, newtons, 0 to 1e9.
    pub engine_n: f32,
    /// The force of the brake, newtons, 0 to 1e9.
    pub brake_n: f32,
    /// The angle by which the wheel turns when fully steered, radians, -π/2 to π/2. A positive angle turns it
    /// to the left, about `-down`.
    pub steering_rad: f32,
}

impl Default for Wheel {
    /// Returns a wheel of a car of a tonne, forward along x, upward along y; neither driven nor steered.
    fn default() -> Self {
        Self {
            at_m: [0.0; 3],
            down: [0.0, -1.0, 0.0],
            axle: [0.0, 0.0, 1.0],
            rest_m: 0.3,
            travel_m: 0.2,
            radius_m: 0.35,
            stiffness: 30.0,
            compression: 4.0,
            relaxation: 5.0,
            most_force_n: 20_000.0,
            grip: 1.5,
            side_grip: 1.0,
            engine_n: 0.0,
            brake_n: 4_000.0,
            steering_rad: 0.0,
        }
    }
}

impl Default for Vehicle {
    /// Returns a car with a chassis of 3.2 × 0.8 × 1.6 m and about a tonne, forward along x, upward along y:
    /// driven behind, steered in front.
    fn default() -> Self {
        let wheel = |x: f32, z: f32| {
            let (engine_n, steering_rad) = if x > 0.0 { (0.0, 0.6) } else { (2_500.0, 0.0) };
            Wheel { at_m: [x, -0.2, z], engine_n, steering_rad, ..Wheel::default() }
        };
        let wheels = vec![wheel(1.2, -0.8), wheel(1.2, 0.8), wheel(-1.2, -0.8), wheel(-1.2, 0.8)];
        Self { wheels, top_speed_m_s: 20.0 }
    }
}

/// The actions of a vehicle's driver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Drive {
    /// The part of the engine's force, -1 (backward) to 1.
    pub throttle: f32,
    /// The part of the brakes' force, 0 to 1. While there is throttle it has no effect on driven wheels.
    pub brake: f32,
    /// The part of the wheels' steering angle, -1 to 1.
    pub steering: f32,
}

impl Drive {
    /// Returns the first value out of range, and its range.
    pub(crate) fn fault(&self) -> Option<(&'static str, &'static str)> {
        let signed = |value: f32| (-1.0..=1.0).contains(&value);
        [
            (signed(self.throttle), "drive.throttle", "-1 to 1"),
            ((0.0..=1.0).contains(&self.brake), "drive.brake", "0 to 1"),
            (signed(self.steering), "drive.steering", "-1 to 1"),
        ]
        .into_iter()
        .find_map(|(holds, field, rule)| (!holds).then_some((field, rule)))
    }
}

impl Vehicle {
    /// Returns the first setting out of range, and its range.
    pub(crate) fn fault(&self) -> Option<(&'static str, &'static str)> {
        if !(1..=MAX_WHEELS).contains(&self.wheels.len()) {
            return Some(("vehicle.wheels", "1 to 32"));
        }
        if !(self.top_speed_m_s > 0.0 && self.top_speed_m_s <= 1e4) {
            return Some(("vehicle.top_speed_m_s", "above 0, at most 10,000"));
        }
        self.wheels.iter().find_map(Wheel::fault)
    }

    /// Returns how far the wheels reach from the origin of the chassis at most, metres.
    pub(crate) fn reach_m(&self) -> f32 {
        let of = |wheel: &Wheel| length(wheel.at_m) + wheel.rest_m + wheel.travel_m + wheel.radius_m;
        self.wheels.iter().map(of).fold(0.0, f32::max)
    }
}

impl Wheel {
    fn fault(&self) -> Option<(&'static str, &'static str)> {
        let metres = |value: f32| (0.0..=100.0).contains(&value);
        let amount = |value: f32| (0.0..=1e9).contains(&value);
        let unit = |v: [f32; 3]| (length(v) - 1.0).abs() < 1e-3;
        let across = (0..3).map(|i| self.down[i] * self.axle[i]).sum::<f32>().abs() < 0.9;
        [
            (self.at_m.iter().all(|x| x.abs() <= 100.0), "wheel.at_m", "within 100 m of the chassis"),
            (unit(self.down), "wheel.down", "of length 1"),
            (unit(self.axle), "wheel.axle", "of length 1"),
            (across, "wheel.axle", "across the suspension"),
            (metres(self.rest_m), "wheel.rest_m", "0 to 100"),
            (metres(self.travel_m), "wheel.travel_m", "0 to 100"),
            (metres(self.radius_m) && self.radius_m > 0.0, "wheel.radius_m", "above 0, at most 100"),
            (amount(self.stiffness), "wheel.stiffness", "0 to 1e9"),
            (amount(self.compression), "wheel.compression", "0 to 1e9"),
            (amount(self.relaxation), "wheel.relaxation", "0 to 1e9"),
            (amount(self.most_force_n), "wheel.most_force_n", "0 to 1e9"),
            ((0.0..=1e3).contains(&self.grip), "wheel.grip", "0 to 1,000"),
            ((0.0..=1.0).contains(&self.side_grip), "wheel.side_grip", "0 to 1"),
            (amount(self.engine_n), "wheel.engine_n", "0 to 1e9"),
            (amount(self.brake_n), "wheel.brake_n", "0 to 1e9"),
            (self.steering_rad.abs() <= FRAC_PI_2, "wheel.steering_rad", "-π/2 to π/2"),
        ]
        .into_iter()
        .find_map(|(holds, field, rule)| (!holds).then_some((field, rule)))
    }
}

fn length(v: [f32; 3]) -> f32 {
    v.iter().map(|v| v * v).sum::<f32>().sqrt()
}
