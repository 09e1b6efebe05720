//! Inserts, changes and reads joints and multibody joints, in local worlds, by a server's program and by builders.

use rapier3d::prelude::GenericJoint;

use super::role::Instead;
use super::{Error, Inner, World};
use crate::physics::LinkSettings;
use crate::protocol::{JointRecord, LinkMotion};
use crate::runtime::JointOverload;
use crate::space::{BodyId, JointId};

const WATCH_JOINTS: &str = "watch what joints bear";

/// Joints of local worlds, and those that a server's program or a builder makes: other clients see none.
impl World {
    /// Returns an error if bodies cannot be joined here.
    #[doc(hidden)]
    pub fn ties_bodies(&self) -> Result<(), Error> {
        self.remote().map_or(Ok(()), |world| world.ties_bodies())
    }

    /// Inserts a joint between two bodies. The assemblies of both become one, which is owned and moved whole. A server or a builder ties
    /// bodies that were inserted since its last step, to one another or to fixed ones.
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

    /// Makes body `b` a link of the multibody of `a` (Featherstone's reduced coordinates, as Rapier's multibody joints): the
    /// joint cannot come apart. One region owns a whole multibody with all that is joined to it, whatever the coupling: it is
    /// never shared, and when it changes owner its contacts begin again without warm starting.
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

    /// Removes a joint.
    pub fn remove_joint(&mut self, joint: JointId) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.remove_joint(joint)?),
            Inner::Remote(world) => world.remove_joint(joint),
        }
    }

    /// Changes a joint in place: motors, limits, whether it acts; a server's program or a builder with its next step.
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

    /// Returns a joint as it is now: its motors are whole, however many regions share it. `None` if the world computes no such
    /// joint.
    #[must_use]
    pub fn joint(&self, joint: JointId) -> Option<JointRecord> {
        match &self.inner {
            Inner::Local(world) => world.joint(joint),
            Inner::Remote(world) => world.joint(joint),
        }
    }

    /// Returns the joints of a body, in order of insertion; none for clients and nodes.
    #[must_use]
    pub fn joints_of(&self, body: BodyId) -> Vec<JointId> {
        match &self.inner {
            Inner::Local(world) => world.joints_of(body),
            Inner::Remote(world) => world.joints_of(body),
        }
    }

    /// Returns the load on the locked axes of a joint in the last step: newtons along the three axes of its frame, newton metres
    /// about them. Rapier makes what it solves orthogonal first, so the numbers of several axes are mixed.
    #[must_use]
    pub fn joint_load(&self, joint: JointId) -> Option<[f32; 6]> {
        self.alone()?.joint_load(joint)
    }

    /// Returns an error if joints cannot be given strengths here.
    #[doc(hidden)]
    pub fn watches_joints(&self) -> Result<(), Error> {
        self.local(WATCH_JOINTS, Instead::JointsInScene).map(drop)
    }

    /// Sets the force and torque on its locked axes above which a joint is too weak: [`World::joint_overloads`] tells of it after each
    /// step in which it bears more, and the program decides whether it breaks. As [`World::joint_load`] it is the load
    /// of the solver's last iteration: one that lasts shows, of a blow what is left. Its torque is not that about the anchor, unless this is
    /// the body's centre of mass: go by the force. Infinite for never, as at first. Local worlds only.
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

    /// Returns the joints that bore more than their strength in the last step, in id order; none in a served world.
    #[must_use]
    pub fn joint_overloads(&self) -> &[JointOverload] {
        self.alone().map_or(&[], |world| world.joint_overloads())
    }

    /// Changes damping, armature, friction and springs of a multibody joint.
    pub fn update_link(&mut self, joint: JointId, settings: &LinkSettings) -> Result<(), Error> {
        Ok(self.local_mut("drive joints", Instead::JointsInScene)?.update_link(joint, settings)?)
    }

    /// Returns the position and velocity of a multibody's link in the coordinates of its joint; `None` before its first step.
    #[must_use]
    pub fn link_motion(&self, joint: JointId) -> Option<LinkMotion> {
        self.alone()?.link_motion(joint)
    }

    /// Sets the velocity of a multibody's link, by degree of freedom, the linear ones first, m/s and rad/s; kinematic links
    /// ([`LinkSettings::kinematic`]) keep to it. Not by axis: a hinge's only value is the first, whatever its axis, and values
    /// beyond a joint's degrees of freedom are ignored.
    pub fn set_link_velocity(&mut self, joint: JointId, velocity: [f32; 6]) -> Result<(), Error> {
        Ok(self.local_mut("drive joints", Instead::JointsInScene)?.set_link_velocity(joint, velocity)?)
    }
}
