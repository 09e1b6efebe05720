//! Runs Rapier's character, vehicle and PID controllers in a local world, and reads how its characters and vehicles stand.

use rapier3d::control::EffectiveCharacterMovement;
use rapier3d::prelude::Pose;

use super::config::WorldError;
use super::local::LocalWorld;
use crate::physics::{
    BodyFilter, CharacterHit, CharacterMove, CharacterState, VehicleController, WheelState,
};
use crate::protocol::WorldPose;
use crate::space::BodyId;

impl LocalWorld {
    /// Returns how far a character gets if it wants to move by `desired_m` within one tick, by Rapier's
    /// character controller: it slides along walls, climbs steps and keeps to the ground. `met` is called for
    /// each collider in its way. The character need not be a body of the world. If it is one, exclude it by
    /// the filter and move it by [`LocalWorld::set_next_pose`].
    ///
    /// ```
    /// # use dcd::physics::{BodyFilter, CharacterMove};
    /// # use dcd::protocol::WorldPose;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::control::KinematicCharacterController;
    /// # use rapier3d::prelude::*;
    /// let mut world = LocalWorld::new(WorldConfig::default())?;
    /// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
    /// let character = CharacterMove {
    ///     controller: &KinematicCharacterController::default(),
    ///     shape: &Capsule::new_y(0.5, 0.3),
    ///     pose: WorldPose::at([0.0, 1.4, 0.0]),
    ///     desired_m: [0.1, -0.2, 0.0],
    ///     filter: BodyFilter::default(),
    /// };
    /// let movement = world.move_character(&character, |_| ())?;
    /// assert!(movement.grounded && movement.translation.x > 0.09 && movement.translation.y > -0.11);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn move_character(
        &self,
        character: &CharacterMove<'_>,
        met: impl FnMut(CharacterHit),
    ) -> Result<EffectiveCharacterMovement, WorldError> {
        Ok(self.host().move_character(character, met)?)
    }

    /// Pushes the dynamic bodies that a character of this mass met on its way. `hits` are those that
    /// [`LocalWorld::move_character`] reported for the same movement.
    pub fn push_by_character(
        &mut self,
        character: &CharacterMove<'_>,
        mass_kg: f32,
        hits: &[CharacterHit],
    ) -> Result<(), WorldError> {
        if !hits.is_empty() {
            self.tape_spoilt();
        }
        hits.iter().try_for_each(|hit| self.host_mut().attend(hit.hit.body))?;
        Ok(self.host_mut().push_by_character(character, mass_kg, hits)?)
    }

    /// Applies the forces of a vehicle's wheels to its chassis. Call it before each [`LocalWorld::step`]. The
    /// wheels stand on the bodies that the filter admits, and never on the chassis.
    ///
    /// ```
    /// # use dcd::physics::{BodyFilter, VehicleController};
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::control::WheelTuning;
    /// # use rapier3d::prelude::*;
    /// let mut world = LocalWorld::new(WorldConfig::default())?;
    /// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
    /// let body = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 1.5, 0.0));
    /// let mut car = VehicleController::new(world.insert(body, ColliderBuilder::cuboid(1.0, 0.2, 0.6).density(100.0))?);
    /// let tuning = WheelTuning { suspension_stiffness: 80.0, suspension_damping: 8.0, ..WheelTuning::default() };
    /// for (x, z) in [(0.8, 0.5), (0.8, -0.5), (-0.8, 0.5), (-0.8, -0.5)] {
    ///     let at = Vector::new(x, 0.0, z);
    ///     car.controller.add_wheel(at, -Vector::Y, Vector::Z, 0.6, 0.2, &tuning).engine_force = 60.0;
    /// }
    /// for _ in 0..60 {
    ///     world.update_vehicle(&mut car, &BodyFilter::default())?;
    ///     world.step()?;
    /// }
    /// assert!(car.ground(0).is_some() && world.velocity(car.chassis()).unwrap().linear[0].abs() > 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn update_vehicle(
        &mut self,
        vehicle: &mut VehicleController,
        filter: &BodyFilter<'_>,
    ) -> Result<(), WorldError> {
        self.tape_spoilt();
        self.host_mut().attend(vehicle.chassis())?;
        Ok(self.host_mut().update_vehicle(vehicle, filter)?)
    }

    /// Returns how a character of this world stands after the last step.
    pub fn character_state(&self, character: BodyId) -> Result<CharacterState, WorldError> {
        let state = self.host().character_state(character)?;
        state.ok_or_else(|| self.is_not(WorldError::NoCharacter, character))
    }

    /// Returns the state of each wheel of a vehicle of this world after the last step.
    pub fn wheels(&self, vehicle: BodyId) -> Result<Vec<WheelState>, WorldError> {
        self.host().wheels(vehicle)?.ok_or_else(|| self.is_not(WorldError::NoVehicle, vehicle))
    }

    /// Returns the error of a body that is here and is not what was asked for, or is not here.
    fn is_not(&self, other: fn(BodyId) -> WorldError, body: BodyId) -> WorldError {
        if self.contains(body) { other(body) } else { WorldError::NoBody(body) }
    }

    /// Converts a pose from world space into the space of [`LocalWorld::body`], in which Rapier's
    /// `PidController` needs its target.
    ///
    /// ```
    /// # use dcd::protocol::WorldPose;
    /// # use dcd::runtime::{LocalWorld, WorldConfig};
    /// # use rapier3d::control::PidController;
    /// # use rapier3d::dynamics::RigidBodyVelocity;
    /// # use rapier3d::prelude::*;
    /// # let mut world = LocalWorld::new(WorldConfig::default())?;
    /// let drone = world.insert(RigidBodyBuilder::dynamic().gravity_scale(0.0), ColliderBuilder::ball(0.5))?;
    /// let mut pid = PidController::default();
    /// for _ in 0..120 {
    ///     let target = world.region_pose(drone, &WorldPose::at([1.0, 2.0, 0.0])).unwrap();
    ///     let body = world.body(drone).unwrap();
    ///     let correction = pid.rigid_body_correction(1.0 / 60.0, body, target, RigidBodyVelocity::default());
    ///     world.update(drone, |body| body.set_linvel(body.linvel() + correction.linvel, true))?;
    ///     world.step()?;
    /// }
    /// assert!((world.pose(drone).unwrap().translation[1] - 2.0).abs() < 0.2);
    /// # Ok::<(), dcd::runtime::WorldError>(())
    /// ```
    pub fn region_pose(&self, body: BodyId, pose: &WorldPose) -> Option<Pose> {
        self.host().region_pose(body, pose)
    }
}
