//! Inserts, changes, reads and removes joints and multibody joints of a local world.

use rapier3d::prelude::GenericJoint;

use super::LocalWorld;
use crate::physics::{LinkSettings, joint_record};
use crate::protocol::{JointRecord, LinkMotion};
use crate::recording::Operation;
use crate::runtime::WorldError;
use crate::runtime::tape::Copies;
use crate::space::{BodyId, JointId};

impl LocalWorld {
    /// Inserts a joint between two bodies.
    pub fn insert_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: impl Into<GenericJoint>,
    ) -> Result<JointId, WorldError> {
        self.tie(a, b, &joint.into(), None)
    }

    /// Makes body `b` a link of the multibody of `a` (Featherstone's reduced coordinates, as Rapier's
    /// multibody joints). The joint cannot come apart.
    pub fn insert_multibody_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: impl Into<GenericJoint>,
        settings: LinkSettings,
    ) -> Result<JointId, WorldError> {
        self.tie(a, b, &joint.into(), Some(settings))
    }

    fn tie(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: &GenericJoint,
        link: Option<LinkSettings>,
    ) -> Result<JointId, WorldError> {
        for body in [a, b] {
            if self.host.record(body).is_none() {
                return Err(WorldError::NoBody(body));
            }
        }
        if [a, b].iter().all(|&body| self.host.immovable(body).is_some()) {
            return Err(WorldError::Setting {
                what: "a joint",
                value: "between two fixed bodies".into(),
                range: "it moves neither, and no region would keep it; make one of them kinematic, and it stays where it is all the same",
            });
        }
        let id = JointId(self.next_joint);
        let link = link.map(|settings| settings.record());
        let record = JointRecord { link, ..joint_record(id, a, b, joint) };
        self.host.attend_ends(&record)?;
        self.or_spoil(|world| Ok(world.host.tie(record.clone())?))?;
        self.tape(true, || Operation::InsertJoint(Box::new(record)));
        self.next_joint += 1;
        Ok(id)
    }

    /// Removes a joint.
    pub fn remove_joint(&mut self, joint: JointId) -> Result<(), WorldError> {
        self.host.attend_joint(joint)?;
        let done = self.host.remove_joint(joint);
        self.tape(done, || Operation::RemoveJoint(joint));
        if done { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    /// Changes a joint in place: its motors, its limits, whether it acts.
    pub fn update_joint(
        &mut self,
        joint: JointId,
        mut change: impl FnMut(&mut GenericJoint),
    ) -> Result<(), WorldError> {
        self.host.attend_joint(joint)?;
        let mut copies = Copies::new(self.tape.is_some());
        let done = self.host.update_joint(joint, |joint| {
            change(joint);
            copies.note(joint);
        });
        self.tape_joint(joint, copies);
        if done { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    /// Returns a joint as it is now, with its whole motors, however many regions share it.
    pub fn joint(&self, joint: JointId) -> Option<JointRecord> {
        self.host.joint(joint)
    }

    /// Returns the joints of a body, in order of insertion.
    pub fn joints_of(&self, body: BodyId) -> Vec<JointId> {
        self.host.all_joints_of(body).into_keys().collect()
    }

    /// Returns the load on the locked axes of a joint in the last step: newtons along the three axes of its
    /// frame, then newton metres about them.
    pub fn joint_load(&self, joint: JointId) -> Option<[f32; 6]> {
        self.host.joint_load(joint)
    }

    /// Changes damping, armature, friction and springs of a multibody joint.
    pub fn update_link(&mut self, joint: JointId, settings: &LinkSettings) -> Result<(), WorldError> {
        self.tape_spoilt();
        self.host.attend_joint(joint)?;
        if self.host.update_link(joint, settings) { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    /// Returns the position and velocity of a multibody's link in the coordinates of its joint; `None` before
    /// its first step.
    pub fn link_motion(&self, joint: JointId) -> Option<LinkMotion> {
        self.host.link_motion(joint)
    }

    /// Sets the velocity of a multibody's link by degree of freedom, the linear ones first, m/s and rad/s.
    /// Kinematic links ([`LinkSettings::kinematic`]) keep this velocity.
    pub fn set_link_velocity(&mut self, joint: JointId, velocity: [f32; 6]) -> Result<(), WorldError> {
        if !velocity.iter().all(|v| v.is_finite()) {
            let (what, range) = ("velocity", "six finite numbers");
            return Err(WorldError::Setting { what, value: format!("{velocity:?}"), range });
        }
        self.tape_spoilt();
        self.host.attend_joint(joint)?;
        if self.host.set_link_velocity(joint, velocity) { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }
}
