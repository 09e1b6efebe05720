//! Defines the wire form of a joint: the numbers of Rapier's `GenericJoint`.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::Pose;
use crate::space::{BodyId, JointId};

/// The limits of one axis of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct JointLimit {
    /// Lowest position, metres or radians.
    pub min: f32,
    /// Highest position, metres or radians.
    pub max: f32,
    /// Impulse of the last step, to warm-start the next.
    pub impulse: f32,
}

/// The motor of one axis of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct JointMotor {
    /// Velocity to reach.
    pub target_vel: f32,
    /// Position to reach.
    pub target_pos: f32,
    /// Spring stiffness.
    pub stiffness: f32,
    /// Damping.
    pub damping: f32,
    /// Limit of force or torque.
    pub max_force: f32,
    /// Impulse of the last step.
    pub impulse: f32,
    /// Whether stiffness and damping are per unit of mass (Rapier's `AccelerationBased`).
    pub acceleration_based: bool,
}

/// The additional data of a multibody joint: the second body is a link in reduced coordinates. Lists by degree of freedom have the
/// linear ones first and nothing for locked axes; the rest of each is zero.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct LinkRecord {
    /// Velocities of its degrees of freedom are the user's alone.
    pub kinematic: bool,
    /// By degree of freedom; `None` is Rapier's choice.
    pub damping: Option<[f32; 6]>,
    /// By degree of freedom.
    pub armature: [f32; 6],
    /// By degree of freedom.
    pub friction: [f32; 6],
    /// By axis: stiffness and rest position.
    pub springs: [[f32; 2]; 6],
    /// Where it is and how it moves; `None` at the zero of its coordinates.
    pub motion: Option<LinkMotion>,
}

/// The position and velocity of a link, in the coordinates of its joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LinkMotion {
    /// By axis, metres and radians.
    pub coordinates: [f32; 6],
    /// How it is turned, as a quaternion.
    pub rotation: [f32; 4],
    /// By degree of freedom.
    pub velocity: [f32; 6],
    /// Of the multibody's root, by its degrees of freedom.
    pub root_velocity: [f32; 6],
}

/// A joint between two bodies, solved by impulses or as the link of a multibody.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct JointRecord {
    /// Its name.
    pub id: JointId,
    /// First body.
    pub a: BodyId,
    /// Second body.
    pub b: BodyId,
    /// On the first body.
    pub frame_a: Pose,
    /// On the second body.
    pub frame_b: Pose,
    /// Bits of Rapier's `JointAxesMask`: no motion.
    pub locked_axes: u8,
    /// Limited motion.
    pub limit_axes: u8,
    /// Driven motion.
    pub motor_axes: u8,
    /// Limits and motors act on these together.
    pub coupled_axes: u8,
    /// One per axis.
    pub limits: [JointLimit; 6],
    /// One per axis.
    pub motors: [JointMotor; 6],
    /// Natural frequency (Hz) and damping ratio of the constraint.
    pub softness: [f32; 2],
    /// Whether the two bodies may touch.
    pub contacts_enabled: bool,
    /// Whether the joint acts.
    pub enabled: bool,
    /// The user's own.
    pub user_data: u128,
    /// Of a multibody joint, whose second body is the link.
    pub link: Option<LinkRecord>,
}
