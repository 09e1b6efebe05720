//! Drives vehicles whose wheels are rays, by Rapier's ray-cast vehicle controller, through all regions.

use parry3d::bounding_volume::BoundingVolume;
use rapier3d::control::{DynamicRayCastVehicleController, Wheel};
use rapier3d::prelude::*;

use super::{ControlError, Neighbourhood};
use crate::physics::collider_id::ColliderId;
use crate::physics::convert;
use crate::physics::host::RegionHost;
use crate::physics::query::BodyFilter;
use crate::space::{BodyId, Bounds};

/// Rapier's `DynamicRayCastVehicleController` for a body of a local world, updated by
/// [`World::update_vehicle`](crate::World::update_vehicle).
pub struct VehicleController {
    chassis: BodyId,
    /// Rapier's controller: wheels, axes, engine, brakes and steering. Each update sets its chassis. Its
    /// places in world space are relative to [`VehicleController::anchor`].
    pub controller: DynamicRayCastVehicleController,
    anchor: [f64; 3],
    grounds: Vec<Option<ColliderId>>,
}

impl std::fmt::Debug for VehicleController {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("VehicleController")
            .field("chassis", &self.chassis)
            .field("anchor", &self.anchor)
            .field("grounds", &self.grounds)
            .finish_non_exhaustive()
    }
}

impl VehicleController {
    /// Makes a vehicle without wheels on a chassis; add wheels by `controller.add_wheel`.
    #[must_use]
    pub fn new(chassis: BodyId) -> Self {
        Self {
            chassis,
            controller: DynamicRayCastVehicleController::new(RigidBodyHandle::invalid()),
            anchor: [0.0; 3],
            grounds: Vec::new(),
        }
    }

    /// Returns the chassis: the body that the controller drives.
    pub fn chassis(&self) -> BodyId {
        self.chassis
    }

    /// Returns the origin (anchor) of the controller's space in the last update, in world space, metres.
    pub fn anchor(&self) -> [f64; 3] {
        self.anchor
    }

    /// Returns the centre of a wheel as of the last update, in world space, metres; `None` if there is no
    /// such wheel.
    pub fn wheel_centre(&self, wheel: usize) -> Option<[f64; 3]> {
        Some(convert::world_point(self.anchor, self.controller.wheels().get(wheel)?.center()))
    }

    /// Returns the collider on which a wheel stood in the last update; `None` if it stood on none.
    pub fn ground(&self, wheel: usize) -> Option<ColliderId> {
        self.grounds.get(wheel).copied().flatten()
    }
}

impl RegionHost {
    /// Updates a vehicle; see `LocalWorld::update_vehicle`.
    pub(crate) fn update_vehicle(
        &mut self,
        vehicle: &mut VehicleController,
        filter: &BodyFilter<'_>,
    ) -> Result<(), ControlError> {
        let chassis = vehicle.chassis;
        let (region, handle) = self.owned(chassis).ok_or(ControlError::NoChassis(chassis))?;
        let body = &region.physics().bodies[handle];
        if !body.is_dynamic() {
            return Err(ControlError::NoChassis(chassis));
        }
        let rays = vehicle.controller.wheels().iter().map(|wheel| ray_box(wheel, body.position()));
        let around =
            rays.reduce(|a, b| a.merged(&b)).unwrap_or(Aabb::new(body.translation(), body.translation()));
        let bounds = Bounds {
            min: convert::world_point(region.anchor(), around.mins),
            max: convert::world_point(region.anchor(), around.maxs),
        };
        let mut around = Neighbourhood::gather(self, &bounds, filter, Some(chassis))?;
        vehicle.controller.chassis = around.bodies[&chassis];
        vehicle.controller.update_vehicle(self.settings().dt_s, around.pipeline_mut());
        vehicle.anchor = around.anchor;
        vehicle.grounds = vehicle
            .controller
            .wheels()
            .iter()
            .map(|wheel| around.names.get(&wheel.raycast_info().ground_object?).copied())
            .collect();
        around.hand_back(self);
        Ok(())
    }
}

/// Returns a box around all that the ray of a wheel may hit, in region space.
fn ray_box(wheel: &Wheel, chassis: &Pose) -> Aabb {
    let from = chassis * wheel.chassis_connection_point_cs;
    let to = from + chassis.rotation * wheel.direction_cs * (wheel.suspension_rest_length + wheel.radius);
    Aabb::new(from.min(to), from.max(to)).loosened(0.1)
}
