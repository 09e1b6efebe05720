//! Defines the wire form of a joint: the numbers of Rapier's `GenericJoint`.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::Pose;
use crate::space::{BodyId, JointId};

/// The limits of one axis of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct JointLimit {
    /// The lowest position, metres or radians.
    pub min: f32,
    /// The highest position, metres or radians.
    pub max: f32,
    /// The impulse of the last step, from which the next one warm-starts.
    pub impulse: f32,
}

/// The motor of one axis of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct JointMotor {
    /// The velocity to reach.
    pub target_vel: f32,
    /// The position to reach.
    pub target_pos: f32,
    /// The stiffness of the spring.
    pub stiffness: f32,
    /// The damping.
    pub damping: f32,
    /// The greatest force or torque.
    pub max_force: f32,
    /// The impulse of the last step.
    pub impulse: f32,
    /// Says whether stiffness and damping are per unit of mass (Rapier's `AccelerationBased`).
    pub acceleration_based: bool,
}

/// The additional data of a multibody joint, whose second body is a link in reduced coordinates. Lists by
/// degree of freedom have the linear ones first and leave out locked axes; the rest of each list is zero.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct LinkRecord {
    /// Says whether the velocities of its degrees of freedom are set by the user alone.
    pub kinematic: bool,
    /// The damping, by degree of freedom; `None` for Rapier's choice.
    pub damping: Option<[f32; 6]>,
    /// The armature, by degree of freedom.
    pub armature: [f32; 6],
    /// The friction, by degree of freedom.
    pub friction: [f32; 6],
    /// The stiffness and rest position of the spring, by axis.
    pub springs: [[f32; 2]; 6],
    /// The place of the link and how it moves; `None` if it rests at the zero of its coordinates.
    pub motion: Option<LinkMotion>,
}

/// The position and velocity of a multibody's link, in the coordinates of its joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LinkMotion {
    /// The coordinates by axis (x, y, z, about x, y, z), metres and radians.
    pub coordinates: [f32; 6],
    /// The rotation of the joint, as a quaternion.
    pub rotation: [f32; 4],
    /// The velocity by degree of freedom, the linear ones first, m/s and rad/s.
    pub velocity: [f32; 6],
    /// The velocity of the multibody's root, by the root's degrees of freedom.
    pub root_velocity: [f32; 6],
}

/// A joint between two bodies, solved by impulses or as the link of a multibody.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct JointRecord {
    /// The id of the joint.
    pub id: JointId,
    /// The first body.
    pub a: BodyId,
    /// The second body.
    pub b: BodyId,
    /// The joint's frame on the first body.
    pub frame_a: Pose,
    /// The joint's frame on the second body.
    pub frame_b: Pose,
    /// The axes without motion, as bits of Rapier's `JointAxesMask`.
    pub locked_axes: u8,
    /// The axes with limited motion, as bits.
    pub limit_axes: u8,
    /// The axes with a motor, as bits.
    pub motor_axes: u8,
    /// The axes on which limits and motors act together, as bits.
    pub coupled_axes: u8,
    /// The limits, one per axis.
    pub limits: [JointLimit; 6],
    /// The motors, one per axis.
    pub motors: [JointMotor; 6],
    /// The natural frequency, Hz, and the damping ratio of the constraint.
    pub softness: [f32; 2],
    /// Says whether the two bodies may touch.
    pub contacts_enabled: bool,
    /// Says whether the joint is enabled.
    pub enabled: bool,
    /// The number that the user gave to the joint.
    pub user_data: u128,
    /// The data of a multibody joint, whose second body is the link; `None` for an impulse joint.
    pub link: Option<LinkRecord>,
}
