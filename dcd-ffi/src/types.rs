//! Declares values that several groups of functions share: poses, velocities, types of bodies, flags.

use dcd::protocol::{Velocity, WorldPose};
use rapier3d::prelude as rapier;

use crate::pointer::{check_numbers, check_point, is_in_range};
use crate::status::Failure;

/// Pose in world space: position and rotation.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdPose {
    /// Position of the body's origin, metres.
    pub p: [f64; 3],
    /// Rotation: unit quaternion x, y, z, w (to 0.001).
    pub q: [f32; 4],
}

/// Velocity of a body, in world axes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdVelocity {
    /// Velocity of the centre of mass, m/s.
    pub linear: [f32; 3],
    /// Angular velocity, rad/s.
    pub angular: [f32; 3],
}

/// Pose relative to a body or a shape: position and rotation.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdFrame {
    /// Position, metres.
    pub p: [f32; 3],
    /// Rotation: unit quaternion x, y, z, w (to 0.001).
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
    /// Checks that the frame is a position and a rotation.
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

/// Type of a body: how it moves.
pub type DcdBodyType = u32;

/// The body never moves: ground and walls.
pub const DCD_FIXED: DcdBodyType = 0;
/// The body moves by forces.
pub const DCD_DYNAMIC: DcdBodyType = 1;
/// The body moves at the velocity that the program gives it, whatever it meets: doors and lifts.
pub const DCD_KINEMATIC: DcdBodyType = 2;
/// The body moves to the pose that dcd_body_set_target gives it, whatever it meets: animated limbs. Not in a served world.
pub const DCD_KINEMATIC_POSE: DcdBodyType = 3;

/// In DcdBodyDef.flags: the body does not jump through moving bodies either (continuous collision detection), at some cost. No body
/// jumps through fixed ones.
pub const DCD_BODY_CCD: u32 = 1;
/// In DcdBodyDef.flags: the body is a sensor, which detects and does not push.
pub const DCD_BODY_SENSOR: u32 = 2;
/// In DcdBodyDef.flags: the body does not fall asleep by itself. Its thresholds of sleep are kept for when the flag is taken away.
pub const DCD_BODY_NO_SLEEP: u32 = 4;
/// In DcdBodyDef.flags: the body sleeps at first, until something wakes it.
pub const DCD_BODY_ASLEEP: u32 = 8;
/// In DcdBodyDef.flags: the body is not there until dcd_body_set_properties takes this flag away. It keeps its place, and its
/// joints wait.
pub const DCD_BODY_DISABLED: u32 = 16;
/// In DcdBodyDef.flags: the body may turn by more than a quarter turn per step, as wheels and propellers do.
pub const DCD_BODY_FAST_SPIN: u32 = 32;
/// In DcdBodyDef.flags: the body's own inertia does not change its spin, as it does that of a thrown book.
pub const DCD_BODY_NO_GYRO: u32 = 64;
/// In DcdBodyDef.flags: two bodies that both have this flag collide when groups and mask match one way. All others must match both
/// ways.
pub const DCD_BODY_ANY_GROUP: u32 = 128;

/// In DcdBodyDef.events: dcd_events reports contacts of the body that begin and end.
pub const DCD_EVENT_CONTACT: u32 = 1;
/// In DcdBodyDef.events: dcd_events reports contacts of the body that press harder than force_threshold.
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

/// Rule by which the coefficients of two colliders in contact become one. Of two rules, the one with the higher number counts.
pub type DcdCombineRule = u32;

/// Average: (a + b) / 2.
pub const DCD_COMBINE_AVERAGE: DcdCombineRule = 0;
/// Minimum: ice makes everything slippery.
pub const DCD_COMBINE_MIN: DcdCombineRule = 1;
/// Product: a * b.
pub const DCD_COMBINE_MULTIPLY: DcdCombineRule = 2;
/// Maximum: rubber makes everything stick.
pub const DCD_COMBINE_MAX: DcdCombineRule = 3;
/// Sum: a + b, at most 1.
pub const DCD_COMBINE_SUM: DcdCombineRule = 4;
/// Geometric mean: the square root of a * b.
pub const DCD_COMBINE_GEOMETRIC_MEAN: DcdCombineRule = 5;

/// DcdBodyInfo.region of a fixed body, which has no owner.
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
