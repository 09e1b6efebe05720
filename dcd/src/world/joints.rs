//! Inserts, changes, reads and removes joints and multibody joints, in local worlds, by a server's program
//! and by builders.

use rapier3d::prelude::GenericJoint;

use super::role::Instead;
use super::{Error, Inner, World};
use crate::physics::LinkSettings;
use crate::protocol::{JointRecord, LinkMotion};
use crate::runtime::JointOverload;
use crate::space::{BodyId, JointId};

const WATCH_JOINTS: &str = "watch what joints bear";

/// Joints of local worlds, and those that a server's program or a builder makes. Other clients see no joints.
impl World {
    /// Returns an error if this role cannot make joints.
    #[doc(hidden)]
    pub fn ties_bodies(&self) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.ties_bodies())
    }

    /// Inserts a joint between two bodies. The assemblies of both bodies become one, which one region owns
    /// and which moves as a whole. A server's program or a builder can only tie bodies that it inserted since
    /// its last step, to one another or to fixed bodies.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let post = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1))?;
    /// let bob = world.insert(
    ///     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, -2.0, 0.0)),
    ///     ColliderBuilder::ball(0.25),
    /// )?;
    /// let rope = SphericalJointBuilder::new().local_anchor2(Vector::new(0.0, 2.0, 0.0));
    /// world.insert_joint(post, bob, rope)?;
    /// world.step()?;
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn insert_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: impl Into<GenericJoint>,
    ) -> Result<JointId, Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.insert_joint(a, b, joint)?),
            Inner::Remote(world) => world.insert_joint(a, b, &joint.into()),
        }
    }

    /// Makes body `b` a link of the multibody of `a` (reduced coordinates after Featherstone, as Rapier's
    /// multibody joints): the joint cannot come apart. Local worlds only.
    ///
    /// One region owns a whole multibody with all that is joined to it, whatever the coupling. It is never
    /// shared, and when it changes owner its contacts begin again without warm starting.
    ///
    /// As in Rapier, the link starts at rest, and where the coordinates of its joint are 0, wherever its body was.
    /// Only the links of a scene start where and as their bodies do.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let base = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1))?;
    /// let below = RigidBodyBuilder::dynamic().translation(Vector::Y * -0.5);
    /// let arm = world.insert(below, ColliderBuilder::capsule_y(0.4, 0.05))?;
    /// let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor2(Vector::Y * 0.5);
    /// // The two overlap at the hinge: they must not touch there.
    /// let hinge = hinge.contacts_enabled(false);
    /// world.insert_multibody_joint(base, arm, hinge, LinkSettings::default())?;
    /// world.step()?;
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn insert_multibody_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: impl Into<GenericJoint>,
        settings: LinkSettings,
    ) -> Result<JointId, Error> {
        let world = self.local_mut("make joints", Instead::JointsInScene)?;
        Ok(world.insert_multibody_joint(a, b, joint, settings)?)
    }

    /// Removes a joint: at once in a local world, with the next step for a server's program or a builder.
    pub fn remove_joint(&mut self, joint: JointId) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.remove_joint(joint)?),
            Inner::Remote(world) => world.remove_joint(joint),
        }
    }

    /// Changes a joint in place: its motors, limits, and whether it is enabled. A server's program or a
    /// builder does so with its next step.
    pub fn update_joint(
        &mut self,
        joint: JointId,
        mut change: impl FnMut(&mut GenericJoint),
    ) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.update_joint(joint, change)?),
            Inner::Remote(world) => world.update_joint(joint, &mut change),
        }
    }

    /// Returns a joint as it is now, with its whole motors, however many regions share it. `None` if this
    /// process knows no such joint.
    #[must_use]
    pub fn joint(&self, joint: JointId) -> Option<JointRecord> {
        match &self.inner {
            Inner::Local(world) => world.joint(joint),
            Inner::Remote(world) => world.joint(joint),
        }
    }

    /// Returns the joints of a body, in order of insertion. Clients (other than builders) and nodes know
    /// none.
    #[must_use]
    pub fn joints_of(&self, body: BodyId) -> Vec<JointId> {
        match &self.inner {
            Inner::Local(world) => world.joints_of(body),
            Inner::Remote(world) => world.joints_of(body),
        }
    }

    /// Returns the load on the locked axes of a joint in the last step: newtons along the three axes of the
    /// joint's frame, then newton metres about them. Rapier makes the constraints orthogonal before it solves
    /// them, so that the numbers of several axes are mixed. `None` if there is no such joint, and in a served
    /// world.
    #[must_use]
    pub fn joint_load(&self, joint: JointId) -> Option<[f32; 6]> {
        self.alone()?.joint_load(joint)
    }

    /// Returns an error if this role cannot set strengths of joints.
    #[doc(hidden)]
    pub fn watches_joints(&self) -> Result<(), Error> {
        self.local(WATCH_JOINTS, Instead::JointsInScene).map(drop)
    }

    /// Sets the strength of a joint: the force, newtons, and torque, newton metres, on its locked axes that
    /// it bears. After each step in which it bears more, [`World::joint_overloads`] lists it, and the program
    /// decides whether it breaks. At first both are infinite, which means never. Local worlds only.
    ///
    /// As with [`World::joint_load`], the load is that of the solver's last iteration. A lasting load shows
    /// in full, a blow only by what is left of it then. The torque is about the anchor only where that is the
    /// body's centre of mass: prefer the force.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let nail = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1))?;
    /// let below = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, -1.0, 0.0));
    /// let weight = world.insert(below, ColliderBuilder::ball(0.3).mass(1000.0))?;
    /// let rope = SphericalJointBuilder::new().local_anchor2(Vector::Y);
    /// let rope = world.insert_joint(nail, weight, rope)?;
    /// world.set_joint_strength(rope, 5_000.0, f32::INFINITY)?; // half of what it must bear
    /// while world.joint_overloads().is_empty() {
    ///     world.step()?;
    /// }
    /// for overload in world.joint_overloads().to_vec() {
    ///     world.remove_joint(overload.joint)?;
    /// }
    /// assert!(world.joint(rope).is_none());
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn set_joint_strength(&mut self, joint: JointId, force_n: f32, torque_n_m: f32) -> Result<(), Error> {
        let world = self.local_mut(WATCH_JOINTS, Instead::JointsInScene)?;
        Ok(world.set_joint_strength(joint, force_n, torque_n_m)?)
    }

    /// Returns the joints that bore more than their strength in the last step, in id order. Empty in a served
    /// world.
    #[must_use]
    pub fn joint_overloads(&self) -> &[JointOverload] {
        self.alone().map_or(&[], |world| world.joint_overloads())
    }

    /// Changes damping, armature, friction and springs of a multibody joint. Local worlds only.
    pub fn update_link(&mut self, joint: JointId, settings: &LinkSettings) -> Result<(), Error> {
        Ok(self.local_mut("drive joints", Instead::JointsInScene)?.update_link(joint, settings)?)
    }

    /// Returns the position and velocity of a multibody's link in the coordinates of its joint. `None` before
    /// its first step, and in a served world.
    #[must_use]
    pub fn link_motion(&self, joint: JointId) -> Option<LinkMotion> {
        self.alone()?.link_motion(joint)
    }

    /// Sets the velocity of a multibody's link, one value per degree of freedom, the linear ones first, m/s
    /// and rad/s. Kinematic links ([`LinkSettings::kinematic`]) keep to it. Values are not by axis: the only
    /// value of a hinge is the first, whatever its axis. Values beyond the joint's degrees of freedom are
    /// ignored. Local worlds only.
    pub fn set_link_velocity(&mut self, joint: JointId, velocity: [f32; 6]) -> Result<(), Error> {
        Ok(self.local_mut("drive joints", Instead::JointsInScene)?.set_link_velocity(joint, velocity)?)
    }
}
