//! Drives the vehicles of a region before each substep, by Rapier's ray-cast vehicle controller.
//!
//! Every region that holds a vehicle drives its copy. A copy with a part of the mass takes that part of the
//! forces of engine, brakes and suspension. Where copies differ, the coupling brings them together as those
//! of any other body.

use rapier3d::control::{DynamicRayCastVehicleController, Wheel, WheelTuning};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Ownership, Region};
use crate::physics::convert;
use crate::protocol::{Drive, Vehicle};
use crate::space::BodyId;

/// A vehicle has no wheels if it moves (m/s) or spins (rad/s) faster than this, lies farther from the
/// region's origin, or is heavier.
const FASTEST_M_S: f32 = 1e5;
const FARTHEST_M: f32 = 1e7;
const HEAVIEST_KG: f32 = 1e9;

/// A vehicle held by a region.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Driving {
    drive: Drive,
    /// Says whether rays find all that came with the vehicle.
    settled: bool,
}

impl Driving {
    pub(super) fn new(drive: Drive) -> Self {
        Self { drive, settled: false }
    }
}

impl Region {
    /// Returns what the driver of a vehicle does.
    pub(in crate::physics) fn drive(&self, handle: RigidBodyHandle) -> Option<Drive> {
        let slot = self.slot(handle);
        slot.traits.vehicle.as_ref()?;
        self.vehicles.get(&slot.id).map(|driving| driving.drive)
    }

    /// Sets what the driver of a vehicle does. Returns whether it is a vehicle held here.
    pub(in crate::physics) fn set_drive(&mut self, id: BodyId, drive: Option<Drive>) -> bool {
        let (Some(driving), Some(drive)) = (self.vehicles.get_mut(&id), drive) else { return false };
        driving.drive = drive;
        true
    }

    /// Notes that everything has another place in the region's space, where rays have to find it first.
    pub(super) fn unsettle_vehicles(&mut self) {
        self.vehicles.values_mut().for_each(|driving| driving.settled = false);
    }

    /// Returns how far the wheels of a body reach from its origin, metres; 0 if it has no wheels.
    pub(in crate::physics) fn wheels_reach_m(&self, handle: RigidBodyHandle) -> f32 {
        self.slot(handle).traits.vehicle.as_ref().map_or(0.0, Vehicle::reach_m)
    }

    /// Returns the groups of what the wheels of a body stand on: those of its first collider that is no sensor.
    pub(in crate::physics) fn wheel_groups(&self, handle: RigidBodyHandle) -> InteractionGroups {
        let colliders = self.world.bodies[handle].colliders().iter();
        let mut colliders = colliders.filter_map(|&collider| self.world.colliders.get(collider));
        let groups = colliders.find(|collider| !collider.is_sensor());
        groups.map_or(InteractionGroups::all(), Collider::collision_groups)
    }

    /// Returns the vehicles owned here, each with the speed at which every wheel rolled in the last substep, rad/s, above
    /// 0 forward; `None` for a wheel in the air, and for those of a vehicle that has just come. Wheels of a vehicle that
    /// rests do not roll.
    pub(in crate::physics) fn wheel_spins(&self) -> impl Iterator<Item = (BodyId, Vec<Option<f32>>)> {
        self.vehicles.keys().filter_map(|&id| {
            let handle = self.by_id[&id];
            let (slot, body) = (self.slot(handle), &self.world.bodies[handle]);
            let vehicle = slot.traits.vehicle.as_ref().filter(|_| slot.role == Ownership::Owner)?;
            let rests = body.is_sleeping() || !body.is_enabled();
            let at_rest = || vec![rests.then_some(0.0); vehicle.wheels.len()];
            Some((id, self.spins.get(&id).filter(|_| !rests).cloned().unwrap_or_else(at_rest)))
        })
    }

    /// Drives all awake vehicles held here for a substep of this length, in id order.
    pub(super) fn drive_on(&mut self, dt_s: f32) {
        if self.vehicles.values().any(|driving| !driving.settled) {
            self.find_moved();
            self.vehicles.values_mut().for_each(|driving| driving.settled = true);
        }
        let all: Vec<_> = self.vehicles.iter().map(|(&id, driving)| (id, driving.drive)).collect();
        for (id, drive) in all {
            self.drive_one(self.by_id[&id], &drive, dt_s);
        }
    }

    fn drive_one(&mut self, handle: RigidBodyHandle, drive: &Drive, dt_s: f32) {
        let traits = self.slot(handle).traits.clone();
        let Some(vehicle) = &traits.vehicle else { return };
        if drive.throttle != 0.0 && self.world.bodies[handle].is_sleeping() {
            self.world_mut().wake_up(handle, true);
        }
        let body = &self.world.bodies[handle];
        // Ghosts of the proxy coupling are kinematic.
        let drives = body.is_dynamic() && body.is_enabled() && !body.is_sleeping();
        if !drives || !is_moderate(body) {
            return;
        }
        let share = self.share_of(handle) as f32;
        let groups = self.wheel_groups(handle);
        let filter = QueryFilter::default().exclude_rigid_body(handle).exclude_sensors().groups(groups);
        let mut controller = controller(vehicle, handle, body, drive, share, dt_s);
        let PhysicsWorld { broad_phase, narrow_phase, bodies, colliders, .. } = self.world_mut();
        let rays =
            broad_phase.as_query_pipeline_mut(narrow_phase.query_dispatcher(), bodies, colliders, filter);
        controller.update_vehicle(dt_s, rays);
        // The controller is new, so that its wheels have rolled since the substep began.
        let spin = |wheel: &Wheel| wheel.raycast_info().is_in_contact.then_some(wheel.rotation / dt_s);
        let spins = controller.wheels().iter().map(spin).collect();
        self.spins.insert(self.slot(handle).id, spins);
    }
}

/// Returns whether Rapier's controller can compute with this body: it asserts that none of its forces is
/// infinite.
fn is_moderate(body: &RigidBody) -> bool {
    let most = |v: Vector, limit: f32| v.abs().max_element() <= limit;
    most(body.linvel(), FASTEST_M_S)
        && most(body.angvel(), FASTEST_M_S)
        && most(body.translation(), FARTHEST_M)
        && body.mass() <= HEAVIEST_KG
}

/// Returns Rapier's controller for one substep. Only what the driver does outlasts the substep.
fn controller(
    vehicle: &Vehicle,
    handle: RigidBodyHandle,
    body: &RigidBody,
    drive: &Drive,
    share: f32,
    dt_s: f32,
) -> DynamicRayCastVehicleController {
    let mut controller = DynamicRayCastVehicleController::new(handle);
    let first = &vehicle.wheels[0];
    let down = first.down.map(f32::abs);
    controller.index_up_axis = (0..3).max_by(|&a, &b| down[a].total_cmp(&down[b])).unwrap_or(1);
    let driven = vehicle.wheels.iter().filter(|wheel| wheel.engine_n > 0.0).count() as f32;
    for wheel in &vehicle.wheels {
        let tuning = WheelTuning {
            suspension_stiffness: wheel.stiffness,
            suspension_compression: wheel.compression,
            suspension_damping: wheel.relaxation,
            max_suspension_travel: wheel.travel_m,
            side_friction_stiffness: wheel.side_grip,
            friction_slip: wheel.grip,
            max_suspension_force: wheel.most_force_n / share,
        };
        let [at, down, axle] = [wheel.at_m, wheel.down, wheel.axle].map(convert::vector);
        let added = controller.add_wheel(at, down, axle, wheel.rest_m, wheel.radius_m, &tuning);
        // No substep makes the vehicle faster than its top speed along the push of a wheel, however light it
        // is.
        let steered = Rotation::from_axis_angle(-down, drive.steering * wheel.steering_rad);
        let forward = body.rotation() * (steered * axle.cross(down).normalize_or_zero());
        let speed_m_s = body.linvel().dot(forward) * drive.throttle.signum();
        let most_n = (vehicle.top_speed_m_s - speed_m_s).max(0.0) * body.mass() / (dt_s * driven.max(1.0));
        let engine_n = wheel.engine_n * drive.throttle.abs() / share;
        added.engine_force = engine_n.min(most_n) * drive.throttle.signum();
        // Rapier takes an impulse.
        added.brake = drive.brake * wheel.brake_n * dt_s / share;
        added.steering = drive.steering * wheel.steering_rad;
    }
    controller
}
