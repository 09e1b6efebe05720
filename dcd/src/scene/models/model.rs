//! Defines a model as its file describes it, before it is placed: bodies, joints, and pairs that never touch.

use std::collections::BTreeSet;

use rapier3d::dynamics::RigidBodyAdditionalMassProps;
use rapier3d::prelude::*;

use super::warnings::Warnings;
use crate::physics::{LinkSettings, link_fault};
use crate::scene::SceneJoint;

/// The most bodies of a model: some of the work grows with the square of their number.
pub(super) const MAX_BODIES: usize = 20_000;
/// The most pairs of bodies of a model that never touch.
pub(super) const MAX_PAIRS: usize = 100_000;

/// One model as its file describes it.
pub(super) struct Model {
    pub(super) name: String,
    pub(super) gravity: [f32; 3],
    /// None if the format has none.
    pub(super) dt_s: Option<f32>,
    pub(super) parts: Vec<Part>,
    pub(super) joints: Vec<ModelJoint>,
    /// Pairs of parts that never touch, the lower index first.
    pub(super) apart: BTreeSet<(usize, usize)>,
    pub(super) warnings: Warnings,
}

/// A body of a model.
pub(super) struct Part {
    /// For messages.
    pub(super) name: String,
    pub(super) pose: Pose,
    /// Everything but pose and mass.
    pub(super) body: RigidBodyBuilder,
    pub(super) mass: MassProperties,
    /// Without mass of their own.
    pub(super) colliders: Vec<ColliderBuilder>,
}

/// A joint between two parts.
pub(super) struct ModelJoint {
    pub(super) a: usize,
    pub(super) b: usize,
    pub(super) joint: GenericJoint,
    /// Says whether it is part of the tree of bodies, and does not close a loop.
    pub(super) tree: bool,
    /// The joint's settings as a link of a multibody, if it is to be one.
    pub(super) link: Option<LinkSettings>,
}

impl Model {
    /// Notes that parts `a` and `b` never touch.
    pub(super) fn keep_apart(&mut self, a: usize, b: usize) {
        if a != b {
            self.apart.insert((a.min(b), a.max(b)));
        }
    }

    /// Returns whether a joint of the tree can be a link of a multibody. Others stay impulse joints.
    pub(super) fn links(&self, a: usize, b: usize, joint: &GenericJoint) -> bool {
        let is_root = self.parts[a].is_dynamic() || self.parts[a].is_fixed();
        let can_be = a != b && is_root && self.parts[b].is_dynamic();
        can_be && !joint.locked_axes.is_empty() && link_fault(joint).is_none()
    }

    /// Returns the joints of the scene: those of the file, and one without effect for each pair that never
    /// touches and that no joint of the file keeps from touching. Such a joint can be sent between regions;
    /// Rapier's hooks cannot.
    pub(super) fn scene_joints(&self) -> Vec<SceneJoint> {
        let silent: BTreeSet<_> = self
            .joints
            .iter()
            .filter(|joint| !joint.joint.contacts_enabled)
            .map(|joint| (joint.a.min(joint.b), joint.a.max(joint.b)))
            .collect();
        let touchable = |index: usize| !self.parts[index].colliders.is_empty();
        let apart = self.apart.difference(&silent).filter(|&&(a, b)| {
            touchable(a) && touchable(b) && !(self.parts[a].is_fixed() && self.parts[b].is_fixed())
        });
        let joints = self.joints.iter().map(|joint| SceneJoint {
            a: joint.a,
            b: joint.b,
            joint: joint.joint,
            multibody: joint.link,
        });
        let free = GenericJoint { contacts_enabled: false, ..GenericJoint::default() };
        joints.chain(apart.map(|&(a, b)| SceneJoint { a, b, joint: free, multibody: None })).collect()
    }
}

impl Part {
    /// Builds a part from a body that a loader built and did not insert. The hooks of its joints are left
    /// out: they cannot be sent, and a collider that has one computes all its contacts anew in every step.
    pub(super) fn of(name: String, body: &RigidBody, colliders: Vec<ColliderBuilder>) -> Self {
        let builder = RigidBodyBuilder::new(body.body_type())
            .linvel(body.linvel())
            .angvel(body.angvel())
            .gravity_scale(body.gravity_scale())
            .soft_ccd_prediction(body.soft_ccd_prediction());
        Self { name, pose: *body.position(), body: builder, mass: mass_of(body), colliders }
    }

    pub(super) fn is_fixed(&self) -> bool {
        self.body.body_type == RigidBodyType::Fixed
    }

    pub(super) fn is_dynamic(&self) -> bool {
        self.body.body_type == RigidBodyType::Dynamic
    }
}

/// Returns the mass of a loader's body, whose colliders have none.
pub(super) fn mass_of(body: &RigidBody) -> MassProperties {
    match body.mass_properties().additional_local_mprops.as_deref() {
        Some(RigidBodyAdditionalMassProps::MassProps(mass)) => *mass,
        Some(RigidBodyAdditionalMassProps::Mass(_)) | None => MassProperties::default(),
    }
}

/// Returns a loader's collider as a builder without mass.
pub(super) fn collider_builder(collider: &Collider) -> ColliderBuilder {
    ColliderBuilder::new(collider.shared_shape().clone())
        .position(*collider.position())
        .friction(collider.friction())
        .restitution(collider.restitution())
        .density(0.0)
}

/// Returns whether the joint locks all axes.
pub(super) fn is_weld(joint: &GenericJoint) -> bool {
    joint.locked_axes == JointAxesMask::LOCKED_FIXED_AXES
}

/// Removes limits of a whole turn or more from a hinge that is an impulse joint, and returns whether it did.
/// Rapier reads the angle of such a hinge off the poses, within one turn about the middle of its limits, so
/// that limits this wide have no effect.
pub(super) fn drop_wide_limits(joint: &mut GenericJoint) -> bool {
    let limits = &joint.limits[JointAxis::AngX as usize];
    let wide =
        joint.limit_axes.contains(JointAxesMask::ANG_X) && limits.max - limits.min >= std::f32::consts::TAU;
    if wide {
        joint.limit_axes.remove(JointAxesMask::ANG_X);
    }
    wide
}
