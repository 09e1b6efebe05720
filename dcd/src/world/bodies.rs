//! Inserts, reads, moves, changes and removes bodies and their colliders.

use std::sync::Arc;

use rapier3d::prelude::*;

use super::role::Instead;
use super::view::{Body, MovableBody};
use super::{Error, Inner, World};
use crate::physics::{ColliderId, Region};
use crate::protocol::{
    BodyKind, BodyRecord, BodyState, BodyTraits, Character, Controller, Drive, Push, ShapeHash, Vehicle,
    Velocity, WorldPose,
};
use crate::runtime::WorldError;
use crate::space::BodyId;

const SEND_BODY: &str = "send bodies to poses";
pub(super) const CHANGE_BODY: &str = "change a body in place";
pub(super) const CHANGE_SURFACE: &str = "change the surface of a body";

/// Bodies.
impl World {
    /// Inserts a body with one collider at the body's own position: in world space, exact near the origin.
    ///
    /// - A server's program, or a builder, inserts any body with its next step. The body is the world's own
    ///   and stays when the builder leaves.
    /// - A client's body is an avatar, dynamic or kinematic by velocity. Its id is valid at once, and it
    ///   stands where it was put. [`BodyChange`](super::BodyChange) reports that it is in the world, or that
    ///   it was refused. The server may limit its speed (`ServeConfig::avatar_speed_limit`).
    ///
    /// A kinematic body notices fixed bodies and sensors only with
    /// `active_collision_types(ActiveCollisionTypes::all())`, as in Rapier.
    pub fn insert(&mut self, body: impl Into<RigidBody>, collider: ColliderBuilder) -> Result<BodyId, Error> {
        let body = body.into();
        let pose = WorldPose {
            translation: body.translation().to_array().map(f64::from),
            rotation: body.rotation().to_array(),
        };
        self.insert_at(pose, body, [collider])
    }

    /// Inserts a body with any number of colliders at a pose in world space, which replaces the body's own
    /// position. Otherwise it does the same as [`World::insert`].
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let far = WorldPose::at([100_000.0, 2.0, 0.25]);
    /// let id = world.insert_at(far, RigidBodyBuilder::dynamic(), [ColliderBuilder::ball(0.5)])?;
    /// assert_eq!(world.pose(id).unwrap().translation[2], 0.25);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn insert_at(
        &mut self,
        pose: WorldPose,
        body: impl Into<RigidBody>,
        colliders: impl AsRef<[ColliderBuilder]>,
    ) -> Result<BodyId, Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.insert_at(pose, body, colliders)?),
            Inner::Remote(world) => world.insert(pose, &body.into(), colliders.as_ref(), None),
        }
    }

    /// Inserts a body with one collider into a local world from the parts of its record. `traits` makes the
    /// body's traits from the hash of its shape. This spares the caller Rapier's builders, which take most of
    /// the time of an insertion. Bodies that are inserted one after the other may share their traits.
    #[doc(hidden)]
    pub fn insert_recorded(
        &mut self,
        state: BodyState,
        user_data: u128,
        shape: &SharedShape,
        traits: impl FnOnce(ShapeHash) -> Arc<BodyTraits>,
    ) -> Result<BodyId, Error> {
        let world = self.local_mut("make bodies by their records", Instead::MakeAvatars)?;
        Ok(world.insert_recorded(state, user_data, shape, traits)?)
    }

    /// Inserts a character: a velocity-based kinematic body that the process which computes it moves by
    /// Rapier's character controller.
    ///
    /// [`World::set_velocity`] sets where the character wants to go: along the ground, and upwards to jump.
    /// [`World::velocity`] returns how it moves. A velocity that [`World::update`] sets is replaced at the
    /// next tick. Every role inserts a character as by [`World::insert_at`], but a builder's is an avatar
    /// too. In a served world nodes move a client's characters, so that they stop at walls without delay; the
    /// client cannot set their poses. A body of another kind is refused, and one whose first collider that is
    /// no sensor has no volume, as terrain.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
    /// let wall = RigidBodyBuilder::fixed().translation(Vector::new(3.0, 1.0, 0.0));
    /// world.insert(wall, ColliderBuilder::cuboid(0.5, 2.0, 5.0))?;
    /// let body = RigidBodyBuilder::kinematic_velocity_based();
    /// let capsule = ColliderBuilder::capsule_y(0.5, 0.3);
    /// let walker = world.insert_character(WorldPose::at([0.0, 1.4, 0.0]), &Character::default(), body, [capsule])?;
    /// world.set_velocity(walker, Velocity::linear([3.0, 0.0, 0.0]))?;
    /// for _ in 0..90 {
    ///     world.step()?;
    /// }
    /// let at = world.pose(walker).unwrap().translation;
    /// assert!((2.1..2.2).contains(&at[0]), "it stops at the wall: {at:?}");
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn insert_character(
        &mut self,
        pose: WorldPose,
        character: &Character,
        body: impl Into<RigidBody>,
        colliders: impl AsRef<[ColliderBuilder]>,
    ) -> Result<BodyId, Error> {
        let (body, colliders) = (body.into(), colliders.as_ref());
        let refused = |what, value: String, range| Err(WorldError::Setting { what, value, range }.into());
        if let Some((what, range)) = character.fault() {
            return refused(what, format!("{character:?}"), range);
        }
        if body.body_type() != RigidBodyType::KinematicVelocityBased {
            let kind = format!("{:?}", body.body_type());
            return refused("body of a character", kind, "RigidBodyBuilder::kinematic_velocity_based()");
        }
        if colliders.iter().all(|collider| collider.is_sensor) {
            let count = format!("{} colliders", colliders.len());
            return refused("colliders of a character", count, "one or more that are no sensors");
        }
        // The first one is its shape.
        let shape = colliders.iter().find(|collider| !collider.is_sensor).map(|collider| &collider.shape);
        if let Some(shape) = shape.filter(|shape| shape.mass_properties(1.0).mass() <= 0.0) {
            let kind = format!("{:?}", shape.shape_type());
            let range =
                "one with volume, such as a capsule, a box or a hull: terrain, segments and planes have none";
            return refused("shape of a character", kind, range);
        }
        match &mut self.inner {
            Inner::Local(world) => {
                Ok(world.insert_as(Some(Controller::Character(character)), pose, &body, colliders)?)
            }
            Inner::Remote(world) => {
                world.insert(pose, &body, colliders, Some(Controller::Character(character)))
            }
        }
    }

    /// Inserts a vehicle: a dynamic body whose wheels are rays, driven by Rapier's vehicle controller in the
    /// process that computes it. [`World::drive`] sets what its driver does; [`Vehicle::default`] is a car.
    ///
    /// In a served world it is an avatar of this process, or a body of the server's program. Clients are not
    /// told how its wheels stand.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(100.0, 0.5, 50.0))?;
    /// let chassis = ColliderBuilder::cuboid(1.6, 0.4, 0.8).density(250.0);
    /// let body = RigidBodyBuilder::dynamic();
    /// let car = world.insert_vehicle(WorldPose::at([0.0, 1.6, 0.0]), &Vehicle::default(), body, [chassis])?;
    /// world.drive(car, Drive { throttle: 1.0, ..Drive::default() })?;
    /// for _ in 0..180 {
    ///     world.step()?;
    /// }
    /// let at = world.pose(car).unwrap().translation;
    /// assert!((10.0..30.0).contains(&at[0]) && at[2].abs() < 0.1, "straight on: {at:?}");
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn insert_vehicle(
        &mut self,
        pose: WorldPose,
        vehicle: &Vehicle,
        body: impl Into<RigidBody>,
        colliders: impl AsRef<[ColliderBuilder]>,
    ) -> Result<BodyId, Error> {
        let (body, colliders) = (body.into(), colliders.as_ref());
        let refused = |what, value: String, range| Err(WorldError::Setting { what, value, range }.into());
        if let Some((what, range)) = vehicle.fault() {
            return refused(what, format!("{vehicle:?}"), range);
        }
        if body.body_type() != RigidBodyType::Dynamic {
            let kind = format!("{:?}", body.body_type());
            return refused("body of a vehicle", kind, "RigidBodyBuilder::dynamic()");
        }
        let controller = Some(Controller::Vehicle(vehicle));
        match &mut self.inner {
            Inner::Local(world) => Ok(world.insert_as(controller, pose, &body, colliders)?),
            Inner::Remote(world) => world.insert(pose, &body, colliders, controller),
        }
    }

    /// Sets what the driver of a vehicle does from now on, and wakes the vehicle. A client may drive its own
    /// avatars; a local world, a server's program or a builder any vehicle that is the world's own.
    pub fn drive(&mut self, vehicle: BodyId, drive: Drive) -> Result<(), Error> {
        if let Some((what, range)) = drive.fault() {
            return Err(WorldError::Setting { what, value: format!("{drive:?}"), range }.into());
        }
        match &mut self.inner {
            Inner::Local(world) => Ok(world.drive(vehicle, &drive)?),
            Inner::Remote(world) => world.drive(vehicle, drive),
        }
    }

    /// Returns an error if a client or participant cannot insert a body. Its insertions are sent at once.
    /// Call this for each body of a group, before the first is inserted, where either all or none of them
    /// should be there.
    #[doc(hidden)]
    pub fn can_insert(
        &self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.can_insert(pose, body, colliders))
    }

    /// Takes back the bodies that were inserted last, since the last step, as if they had never been there.
    #[doc(hidden)]
    pub fn take_back(&mut self, bodies: &[BodyId]) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.take_back(bodies)?),
            Inner::Remote(world) => world.take_back(bodies),
        }
    }

    /// Removes a body with its colliders and joints, for good. A server's program removes any body and a
    /// builder any that is the world's own, with the next step. A client removes its own avatars.
    pub fn remove(&mut self, body: BodyId) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.remove(body)?),
            Inner::Remote(world) => world.remove(body),
        }
    }

    /// Returns an error if this process may not remove a body that is there. Call it for each of several
    /// bodies before the first is removed.
    #[doc(hidden)]
    pub fn can_remove(&self, body: BodyId) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.can_remove(body))
    }

    /// Returns whether the world has a body, as far as this process knows.
    #[must_use]
    #[inline]
    pub fn contains(&self, body: BodyId) -> bool {
        match &self.inner {
            Inner::Local(world) => world.contains(body),
            Inner::Remote(world) => world.contains(body),
        }
    }

    /// Returns the pose, velocity, kind, mass, owner and user data of a body; `None` if this process knows no
    /// such body.
    #[must_use]
    pub fn body(&self, id: BodyId) -> Option<Body> {
        let world = match &self.inner {
            Inner::Local(world) => world,
            Inner::Remote(world) => return world.body(id),
        };
        let body = world.body(id)?;
        let (pose, velocity) = world.motion(id)?;
        Some(Body {
            pose,
            velocity,
            kind: match body.body_type() {
                RigidBodyType::Fixed => BodyKind::Fixed,
                RigidBodyType::Dynamic | RigidBodyType::SoftFrame => BodyKind::Dynamic,
                RigidBodyType::KinematicVelocityBased => BodyKind::KinematicVelocity,
                RigidBodyType::KinematicPositionBased => BodyKind::KinematicPosition,
            },
            sleeping: body.is_sleeping(),
            mass_kg: world.mass_kg(id),
            user_data: body.user_data,
            owner: world.owner_of(id),
            outside: false,
        })
    }

    /// Returns the pose of a body in world space; `None` if this process knows no such body.
    #[must_use]
    #[inline]
    pub fn pose(&self, body: BodyId) -> Option<WorldPose> {
        match &self.inner {
            Inner::Local(world) => world.pose(body),
            Inner::Remote(world) => Some(world.motion(body)?.0),
        }
    }

    /// Returns the velocity of a body, m/s and rad/s; zero for a fixed body, `None` if this process knows no
    /// such body.
    #[must_use]
    #[inline]
    pub fn velocity(&self, body: BodyId) -> Option<Velocity> {
        match &self.inner {
            Inner::Local(world) => world.velocity(body),
            Inner::Remote(world) => Some(world.motion(body)?.1),
        }
    }

    /// Returns the pose and velocity of a body ([`World::pose`], [`World::velocity`]) by one look-up.
    #[must_use]
    #[inline]
    pub fn motion(&self, body: BodyId) -> Option<(WorldPose, Velocity)> {
        match &self.inner {
            Inner::Local(world) => world.motion(body),
            Inner::Remote(world) => world.motion(body),
        }
    }

    /// Returns the user data of a body. In a served world it also returns that of removed bodies, whose
    /// contacts end later: of the newest 4,096, and of all since the last step.
    #[must_use]
    pub fn user_data(&self, body: BodyId) -> Option<u128> {
        match &self.inner {
            Inner::Local(world) => world.host().user_data(body),
            Inner::Remote(world) => world.user_data(body),
        }
    }

    /// Returns the whole record of a body: the data that are sent when the body changes owner.
    #[must_use]
    pub fn record(&self, body: BodyId) -> Option<BodyRecord> {
        match &self.inner {
            Inner::Local(world) => world.host().record(body),
            Inner::Remote(world) => world.record(body),
        }
    }

    /// Returns the user data of a collider, as far as this process knows the body.
    #[doc(hidden)]
    #[must_use]
    pub fn collider_user_data(&self, body: BodyId, collider: usize) -> Option<u128> {
        let data = |traits: &BodyTraits| Some(traits.colliders.get(collider)?.user_data);
        match &self.inner {
            Inner::Local(world) => data(world.host().traits(body)?),
            Inner::Remote(world) => data(&world.record(body)?.traits),
        }
    }

    /// Returns the movable bodies after the last step, in id order.
    #[must_use]
    pub fn movable_bodies(&self) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        let row = |(id, region, handle): (_, &Region, _)| {
            let (pose, velocity) = region.motion(handle);
            let body = &region.physics().bodies[handle];
            MovableBody {
                id,
                region: region.id(),
                pose,
                velocity,
                user_data: body.user_data,
                sleeping: body.is_sleeping(),
                outside: false,
            }
        };
        match &self.inner {
            Inner::Local(world) => Box::new(world.host().owned_bodies().map(row)),
            Inner::Remote(world) => world.movable_bodies(),
        }
    }

    /// Returns the number of movable bodies.
    #[must_use]
    pub fn movable_count(&self) -> usize {
        match &self.inner {
            Inner::Local(world) => world.host().owned_count(),
            Inner::Remote(world) => world.movable_count(),
        }
    }

    /// Returns the ids of this process's avatars in a served world, in order: those in the world, those on
    /// their way into it, and those of an earlier stay. Empty in a local world.
    #[must_use]
    pub fn own_avatars(&self) -> Vec<BodyId> {
        self.remote().map(|world| world.own_avatars()).unwrap_or_default()
    }

    /// Returns an error if this role does not see the bodies of its world.
    #[doc(hidden)]
    pub fn sees(&self, what: &'static str) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.sees(what))
    }

    /// Moves a body to a pose in world space at once, whatever is there, and wakes it. In a served world the
    /// next step sends the move: a server's program moves any movable body, a builder any that is the world's
    /// own, a client its own avatars, but no character.
    ///
    /// In a local world the body keeps its velocity. In a served world it gets the velocity that is set in
    /// the same step, otherwise the one that this process last heard of, which is up to half a second old.
    pub fn set_pose(&mut self, body: BodyId, pose: WorldPose) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.set_pose(body, pose)?),
            Inner::Remote(world) => world.set_pose(body, pose),
        }
    }

    /// Sets the velocity of a body, m/s and rad/s, and wakes it. In a served world the next step sends the
    /// change: a server's program sets the velocity of any movable body, a builder of any that is the world's
    /// own, a client of its own avatars. A dynamic body cannot be set above [`World::speed_limit_m_s`].
    pub fn set_velocity(&mut self, body: BodyId, velocity: Velocity) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.set_velocity(body, velocity)?),
            Inner::Remote(world) => world.set_velocity(body, velocity),
        }
    }

    /// Sets the kinematic target of a position-based kinematic body. The body is there at the end of the next
    /// tick, and what it touches feels the speed that this takes. Bodies of other kinds ignore the call.
    /// Local worlds only.
    pub fn set_next_pose(&mut self, body: BodyId, pose: WorldPose) -> Result<(), Error> {
        Ok(self.local_mut(SEND_BODY, Instead::DriveAvatars)?.set_next_pose(body, pose)?)
    }

    /// Returns an error if this role cannot set kinematic targets.
    #[doc(hidden)]
    pub fn sends_bodies(&self) -> Result<(), Error> {
        self.local(SEND_BODY, Instead::DriveAvatars).map(drop)
    }

    /// Returns an error if this role cannot change bodies in place, but only by avatar inputs.
    #[doc(hidden)]
    pub fn changes_bodies(&self) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.changes_bodies())
    }

    /// Returns Rapier's own body: the owner's copy of a movable body, or any copy of a fixed one; `None` if
    /// there is no such body. Its position is in region space. Where several regions share the body, the copy
    /// has only a part of its mass: [`World::body`] returns the whole mass, and the pose in world space.
    /// Local worlds only.
    pub fn rigid_body(&self, body: BodyId) -> Result<Option<&RigidBody>, Error> {
        Ok(self.local("show Rapier's bodies", Instead::DriveAvatars)?.body(body))
    }

    /// Returns an error if this role cannot apply forces and impulses.
    #[doc(hidden)]
    pub fn pushes_bodies(&self) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.pushes_bodies())
    }

    /// Applies a force or an impulse to a dynamic body, and wakes it: at once in a local world, with the next
    /// step for a server's program or a builder.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// # let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5).mass(2.0))?;
    /// world.push(&dcd::Push::impulse(ball, [1.0, 0.0, 0.0]))?;
    /// assert_eq!(world.velocity(ball).unwrap().linear[0], 0.5);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn push(&mut self, push: &Push) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.push(push)?),
            Inner::Remote(world) => world.push(push),
        }
    }

    /// Changes a body in place by Rapier's own setters, forces and impulses. `change` is called for every
    /// copy of the body, so that it may be called more than once and must do the same each time. Positions in
    /// it are in region space; use [`World::set_pose`] to move a body. A body that becomes fixed or movable
    /// is inserted anew.
    ///
    /// A server's program or a builder changes a movable body with its next step, by the setters of what no
    /// step changes (damping, gravity scale, locked axes, mass and the like), and may wake it. There `change`
    /// is called once, on a copy of the body. The change is refused if it moves the body or puts it to sleep.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// # let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// world.update(ball, |body| body.apply_impulse(Vector::new(1.0, 0.0, 0.0), true))?;
    /// assert!(world.velocity(ball).unwrap().linear[0] > 0.0);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn update<R>(
        &mut self,
        body: BodyId,
        mut change: impl FnMut(&mut RigidBody) -> R,
    ) -> Result<R, Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.update(body, change)?),
            Inner::Remote(world) => {
                let mut result = None;
                world.update(body, &mut |body| result = Some(change(body)))?;
                Ok(result.expect("the change was tried"))
            }
        }
    }

    /// Returns the number of colliders of a body, as far as this process knows of it.
    #[must_use]
    pub fn collider_count(&self, body: BodyId) -> usize {
        match &self.inner {
            Inner::Local(world) => world.body(body).map_or(0, |body| body.colliders().len()),
            Inner::Remote(world) => world.record(body).map_or(0, |body| body.traits.colliders.len()),
        }
    }

    /// Returns an error if this role cannot add colliders to bodies or remove them.
    #[doc(hidden)]
    pub fn shapes_bodies(&self) -> Result<(), Error> {
        self.local(CHANGE_SURFACE, Instead::ShapeAtBirth).map(drop)
    }

    /// Returns an error if this role cannot change colliders.
    #[doc(hidden)]
    pub fn changes_colliders(&self) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.changes_colliders())
    }

    /// Adds a collider to a body, as the last of its list, and returns its id. The body is inserted anew,
    /// with all bodies that joints tie to it: their contacts begin again without warm starting. Local worlds
    /// only.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// # let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// let hat = world.insert_collider(ball, ColliderBuilder::ball(0.2).mass(3.0).translation(Vector::Y))?;
    /// assert!(world.body(ball).unwrap().mass_kg > Some(3.0));
    /// world.remove_collider(hat)?;
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn insert_collider(&mut self, body: BodyId, collider: ColliderBuilder) -> Result<ColliderId, Error> {
        let id = ColliderId { body, index: self.collider_count(body) };
        self.local_mut(CHANGE_SURFACE, Instead::ShapeAtBirth)?.insert_collider(body, collider)?;
        Ok(id)
    }

    /// Removes a collider from a body. Contacts begin again as with [`World::insert_collider`]. The colliders
    /// after it move up by one place, and their ids change accordingly. Local worlds only.
    pub fn remove_collider(&mut self, collider: impl Into<ColliderId>) -> Result<(), Error> {
        let ColliderId { body, index } = collider.into();
        Ok(self.local_mut(CHANGE_SURFACE, Instead::ShapeAtBirth)?.remove_collider(body, index)?)
    }

    /// Changes a collider of a body, in every copy of the body, by Rapier's own setters: what it touches and
    /// how, what it reports, its mass, its shape (one that can be sent to other processes), and its place on
    /// the body. A [`BodyId`] stands for the body's first collider, and `(body, index)` for a later one. The
    /// ids of colliders in queries and contacts are taken, too.
    ///
    /// A server's program or a builder changes a collider of a movable body with its next step, but neither
    /// its shape nor its place.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// # let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// world.update_collider(ball, |collider| collider.set_active_events(ActiveEvents::COLLISION_EVENTS))?;
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn update_collider<R>(
        &mut self,
        collider: impl Into<ColliderId>,
        mut change: impl FnMut(&mut Collider) -> R,
    ) -> Result<R, Error> {
        let ColliderId { body, index } = collider.into();
        match &mut self.inner {
            Inner::Local(world) => Ok(world.update_collider(body, index, change)?),
            Inner::Remote(world) => {
                let mut result = None;
                world.update_collider(body, index, &mut |collider| result = Some(change(collider)))?;
                Ok(result.expect("the change was tried"))
            }
        }
    }

    /// Returns the centre of mass of a body in a local world, in world space; `None` in other roles.
    #[must_use]
    pub fn centre_of_mass(&self, id: BodyId) -> Option<[f64; 3]> {
        let Inner::Local(world) = &self.inner else { return None };
        world.host().centre_of_mass(id)
    }
}
