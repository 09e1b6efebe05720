//! Values that several groups of functions share.

use dcd::protocol::{Velocity, WorldPose};
use rapier3d::prelude as rapier;

use crate::pointer::check_numbers;
use crate::status::Failure;

/// A place and a turn in world space.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdPose {
    /// Position of the body's origin, metres.
    pub p: [f64; 3],
    /// Unit quaternion x, y, z, w (to 0.001).
    pub q: [f32; 4],
}

/// How a body moves, in world axes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdVelocity {
    /// Of the centre of mass, m/s.
    pub linear: [f32; 3],
    /// rad/s.
    pub angular: [f32; 3],
}

/// A place and a turn relative to a body or a shape.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdFrame {
    /// Metres.
    pub p: [f32; 3],
    /// Unit quaternion x, y, z, w (to 0.001).
    pub q: [f32; 4],
}

impl From<WorldPose> for DcdPose {
    fn from(pose: WorldPose) -> Self {
        Self { p: pose.translation, q: pose.rotation }
    }
}

impl From<DcdPose> for WorldPose {
    fn from(pose: DcdPose) -> Self {
        Self { translation: pose.p, rotation: pose.q }
    }
}

impl From<Velocity> for DcdVelocity {
    fn from(velocity: Velocity) -> Self {
        Self { linear: velocity.linear, angular: velocity.angular }
    }
}

impl From<DcdVelocity> for Velocity {
    fn from(velocity: DcdVelocity) -> Self {
        Self { linear: velocity.linear, angular: velocity.angular }
    }
}

impl DcdFrame {
    /// Whether it is a place and a turn.
    pub(crate) fn check(&self, name: &str) -> Result<(), Failure> {
        check_numbers(&self.p, &format!("{name}.p"))?;
        if (WorldPose { translation: [0.0; 3], rotation: self.q }).is_valid() {
            return Ok(());
        }
        Err(Failure::argument(format!("{name}.q is {:?}; give a quaternion x, y, z, w of length 1", self.q)))
    }

    pub(crate) fn pose(&self) -> rapier::Pose {
        rapier::Pose::from_parts(rapier::Vector::from_array(self.p), rapier::Rotation::from_array(self.q))
    }
}
