//! Declares values that several groups of functions share: poses, velocities, types of bodies, flags.

use dcd::protocol::{Velocity, WorldPose};
use rapier3d::prelude as rapier;

use crate::pointer::{check_numbers, check_point, is_in_range};
use crate::status::Failure;

/// A pose in world space: position and rotation.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdPose {
    /// Position of the body's origin, metres.
    pub p: [f64; 3],
    /// Unit quaternion x, y, z, w (to 0.001).
    pub q: [f32; 4],
}

/// The velocity of a body, in world axes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdVelocity {
    /// Of the centre of mass, m/s.
    pub linear: [f32; 3],
    /// rad/s.
    pub angular: [f32; 3],
}

/// A pose relative to a body or a shape: position and rotation.
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
    /// Checks that it is a position and a rotation.
    pub(crate) fn check(&self, name: &str) -> Result<(), Failure> {
        let turns = (WorldPose { translation: [0.0; 3], rotation: self.q }).is_valid();
        if turns && self.p.iter().all(|&v| is_in_range(v)) {
            return Ok(());
        }
        check_numbers(&self.p, &format!("{name}.p"))?;
        Err(Failure::argument(format!("{name}.q is {:?}; give a quaternion x, y, z, w of length 1", self.q)))
    }

    pub(crate) fn pose(&self) -> rapier::Pose {
        rapier::Pose::from_parts(rapier::Vector::from_array(self.p), rapier::Rotation::from_array(self.q))
    }
}

/// The type of a body: how it moves.
pub type DcdBodyType = u32;

/// Never. Ground and walls.
pub const DCD_FIXED: DcdBodyType = 0;
/// By forces.
pub const DCD_DYNAMIC: DcdBodyType = 1;
/// At the velocity that you give, whatever it meets. Doors and lifts.
pub const DCD_KINEMATIC: DcdBodyType = 2;
/// To the pose that you give by dcd_body_set_target, whatever it meets. Animated limbs. Not in a served world.
pub const DCD_KINEMATIC_POSE: DcdBodyType = 3;

/// In DcdBodyDef.flags: never jumps through moving bodies either, at some cost. Through fixed ones no body does.
pub const DCD_BODY_CCD: u32 = 1;
/// In DcdBodyDef.flags: detects and does not push.
pub const DCD_BODY_SENSOR: u32 = 2;
/// In DcdBodyDef.flags: does not fall asleep by itself.
pub const DCD_BODY_NO_SLEEP: u32 = 4;
/// In DcdBodyDef.flags: sleeps until something wakes it.
pub const DCD_BODY_ASLEEP: u32 = 8;
/// In DcdBodyDef.flags: is not there until dcd_body_set_properties takes this away; it keeps its place, its joints wait.
pub const DCD_BODY_DISABLED: u32 = 16;
/// In DcdBodyDef.flags: may turn by more than a quarter turn per step, as wheels and propellers.
pub const DCD_BODY_FAST_SPIN: u32 = 32;
/// In DcdBodyDef.flags: its spin is not changed by its own inertia, as that of a thrown book is.
pub const DCD_BODY_NO_GYRO: u32 = 64;
/// In DcdBodyDef.flags: one match of groups and mask is enough for two bodies that both say so; else both must match.
pub const DCD_BODY_ANY_GROUP: u32 = 128;

/// In DcdBodyDef.events: dcd_events tells of contacts that begin and end.
pub const DCD_EVENT_CONTACT: u32 = 1;
/// In DcdBodyDef.events: dcd_events tells of contacts that press harder than force_threshold.
pub const DCD_EVENT_FORCE: u32 = 2;

/// In DcdBodyDef.locked: no movement along x.
pub const DCD_LOCK_X: u32 = 1;
/// In DcdBodyDef.locked: no movement along y.
pub const DCD_LOCK_Y: u32 = 2;
/// In DcdBodyDef.locked: no movement along z.
pub const DCD_LOCK_Z: u32 = 4;
/// In DcdBodyDef.locked: no turning about x.
pub const DCD_LOCK_TURN_X: u32 = 8;
/// In DcdBodyDef.locked: no turning about y.
pub const DCD_LOCK_TURN_Y: u32 = 16;
/// In DcdBodyDef.locked: no turning about z.
pub const DCD_LOCK_TURN_Z: u32 = 32;

/// The rule by which the coefficients of two colliders in contact become one; of two rules the one with the higher number counts.
pub type DcdCombineRule = u32;

/// (a + b) / 2.
pub const DCD_COMBINE_AVERAGE: DcdCombineRule = 0;
/// The smaller: ice makes everything slippery.
pub const DCD_COMBINE_MIN: DcdCombineRule = 1;
/// a * b.
pub const DCD_COMBINE_MULTIPLY: DcdCombineRule = 2;
/// The larger: rubber makes everything stick.
pub const DCD_COMBINE_MAX: DcdCombineRule = 3;
/// a + b, at most 1.
pub const DCD_COMBINE_SUM: DcdCombineRule = 4;
/// The square root of a * b.
pub const DCD_COMBINE_GEOMETRIC_MEAN: DcdCombineRule = 5;

/// As DcdBodyInfo.region of a fixed body, which has no owner.
pub const DCD_NO_REGION: u32 = u32::MAX;

pub(crate) fn check_pose(pose: &DcdPose) -> Result<(), Failure> {
    check_point(&pose.p, "pose.p")?;
    if WorldPose::from(*pose).is_valid() {
        return Ok(());
    }
    Err(Failure::argument(format!("pose.q is {:?}; give a quaternion x, y, z, w of length 1", pose.q)))
}

pub(crate) fn check_velocity(velocity: &DcdVelocity) -> Result<(), Failure> {
    check_numbers(&velocity.linear, "velocity.linear")?;
    check_numbers(&velocity.angular, "velocity.angular")
}
