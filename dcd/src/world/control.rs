//! Runs Rapier's character and vehicle controllers in local worlds, reads how characters and vehicles stand, converts poses for PID
//! controllers, and sets contact hooks and the threads of the program.

use std::sync::Arc;

use rapier3d::control::EffectiveCharacterMovement;
use rapier3d::prelude::Pose;

use super::role::Instead;
use super::{Error, World};
use crate::physics::{
    BodyFilter, CharacterHit, CharacterMove, CharacterState, ContactHooks, Tasks, VehicleController,
    WheelState,
};
use crate::protocol::WorldPose;
use crate::space::BodyId;

const CONTROL: &str = "run controllers";

/// Controllers and hooks of local worlds.
impl World {
    /// Returns how far a character gets that is to move by `desired_m` within one tick, by Rapier's character
    /// controller: it slides along walls, climbs steps and keeps to the ground. `met` is called for each
    /// collider in its way. The character need not be a body of the world. If it is one, exclude it by the
    /// filter and move it by [`World::set_next_pose`]. Local worlds only.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # use dcd::rapier3d::control::KinematicCharacterController;
    /// let mut world = World::new(WorldConfig::default())?;
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
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn move_character(
        &self,
        character: &CharacterMove<'_>,
        met: impl FnMut(CharacterHit),
    ) -> Result<EffectiveCharacterMovement, Error> {
        Ok(self.local(CONTROL, Instead::DriveAvatars)?.move_character(character, met)?)
    }

    /// Pushes the dynamic bodies that a character of mass `mass_kg` met on its way. `hits` are those that
    /// [`World::move_character`] reported for the same movement. Local worlds only.
    pub fn push_by_character(
        &mut self,
        character: &CharacterMove<'_>,
        mass_kg: f32,
        hits: &[CharacterHit],
    ) -> Result<(), Error> {
        Ok(self.local_mut(CONTROL, Instead::DriveAvatars)?.push_by_character(character, mass_kg, hits)?)
    }

    /// Applies the forces of a vehicle's wheels to its chassis; call it before each [`World::step`]. The
    /// wheels stand on the colliders that `filter` lets through, and never on the chassis. Local worlds only.
    pub fn update_vehicle(
        &mut self,
        vehicle: &mut VehicleController,
        filter: &BodyFilter<'_>,
    ) -> Result<(), Error> {
        Ok(self.local_mut(CONTROL, Instead::DriveAvatars)?.update_vehicle(vehicle, filter)?)
    }

    /// Returns how a character that was made by [`World::insert_character`] stands after the last step: on what, how
    /// steep that is, and whether the character slides down it. Local worlds only: a client is told where its
    /// characters are and no more.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let floor = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(9.0, 0.5, 9.0))?;
    /// let (body, shape) = (RigidBodyBuilder::kinematic_velocity_based(), ColliderBuilder::capsule_y(0.5, 0.3));
    /// let walker = world.insert_character(WorldPose::at([0.0, 1.5, 0.0]), &Character::default(), body, [shape])?;
    /// assert!(!world.character_state(walker)?.grounded);
    /// for _ in 0..60 {
    ///     world.step()?;
    /// }
    /// let state = world.character_state(walker)?;
    /// let ground = state.ground.expect("it has landed");
    /// assert!(state.grounded && !state.sliding && ground.collider.body == floor && ground.slope_rad < 0.01);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn character_state(&self, character: BodyId) -> Result<CharacterState, Error> {
        Ok(self.local("tell how a character stands", Instead::SubmitQuery)?.character_state(character)?)
    }

    /// Returns the state of each wheel of a vehicle that was made by [`World::insert_vehicle`], after the last step and in
    /// the order of [`Vehicle::wheels`](crate::Vehicle): where to draw it, and on what it stands. Local worlds only: a
    /// client is told where its vehicles are and no more.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let floor = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(90.0, 0.5, 90.0))?;
    /// let chassis = ColliderBuilder::cuboid(1.6, 0.4, 0.8).density(250.0);
    /// let at = WorldPose::at([0.0, 1.5, 0.0]);
    /// let car = world.insert_vehicle(at, &Vehicle::default(), RigidBodyBuilder::dynamic(), [chassis])?;
    /// world.drive(car, Drive { throttle: 1.0, ..Drive::default() })?;
    /// for _ in 0..60 {
    ///     world.step()?;
    /// }
    /// for wheel in world.wheels(car)? {
    ///     assert!(wheel.ground.is_some_and(|ground| ground.collider.body == floor) && wheel.spin_rad_s > 1.0);
    ///     assert!((wheel.pose.translation[1] - 0.5 - 0.35).abs() < 0.01, "its radius above the floor");
    /// }
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn wheels(&self, vehicle: BodyId) -> Result<Vec<WheelState>, Error> {
        Ok(self.local("tell how wheels stand", Instead::SubmitQuery)?.wheels(vehicle)?)
    }

    /// Converts a pose in world space into the space of [`World::rigid_body`], in which Rapier's
    /// `PidController` needs its target. `None` if a local world has no such body, and in other roles.
    #[must_use]
    pub fn region_pose(&self, body: BodyId, pose: &WorldPose) -> Option<Pose> {
        self.alone()?.region_pose(body, pose)
    }

    /// Sets the contact hooks that are called from now on; `None` removes them. Local worlds only: a served
    /// world has no hooks.
    ///
    /// Hooks are called for colliders with Rapier's `ActiveHooks`. These flags are a property of the collider
    /// and go with it to other regions and into saves. The hooks themselves do not: set them again in a
    /// restored world.
    pub fn set_hooks(&mut self, hooks: Option<Arc<dyn ContactHooks>>) -> Result<(), Error> {
        self.local_mut("ask hooks about contacts", Instead::ComputeAlone)?.set_hooks(hooks);
        Ok(())
    }

    /// Lets the program's own threads (its job system) compute a local world from now on, as many as
    /// [`WorldConfig::threads`](crate::WorldConfig) says. The world then starts no threads of its own; `None`
    /// makes it start them again. Results do not depend on it.
    ///
    /// A step with enough work starts as many tasks and waits a tenth of a millisecond for them to begin.
    /// Those that have begun share the work; a task that begins later returns at once. If none has begun, the
    /// calling thread does the work alone, so that no step waits for a busy thread. Otherwise the calling
    /// thread waits meanwhile.
    ///
    /// A call with many queries does the same, on each thread that makes such a call. A thread of one of
    /// rayon's pools cannot take part.
    pub fn set_tasks(&mut self, tasks: Option<Arc<dyn Tasks>>) -> Result<(), Error> {
        Ok(self.local_mut("compute on the program's threads", Instead::ComputeAlone)?.set_tasks(tasks)?)
    }
}
