//! Defines the wire form of a rigid body: complete, so that nothing is lost when it changes region, process or machine.

use std::sync::Arc;

use bincode::{Decode, Encode};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::{Character, Drive, Gait, ShapeHash, ShapeRecord, Vehicle};
use crate::space::{BodyId, Epoch};

/// A pose in world space: position in metres (f64, so that worlds of 100 km keep millimetres), rotation as a unit
/// quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct WorldPose {
    /// Metres.
    pub translation: [f64; 3],
    /// Unit quaternion, scalar last.
    pub rotation: [f32; 4],
}

impl WorldPose {
    /// Returns the pose at this position without rotation.
    #[must_use]
    pub const fn at(translation: [f64; 3]) -> Self {
        Self { translation, rotation: [0.0, 0.0, 0.0, 1.0] }
    }

    /// Returns the pose as nalgebra's f64 isometry, for mathematics in world space.
    pub fn isometry(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.rotation.map(f64::from);
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Isometry3::from_parts(Translation3::from(self.translation), rotation)
    }

    /// Interpolates between this pose (`t` = 0) and `other` (`t` = 1): positions in a straight line, rotations by SLERP the
    /// shorter way (thesis 4.3.2.10). For drawing between ticks; `t` outside 0 to 1 extrapolates.
    #[must_use]
    pub fn interpolated(&self, other: &Self, t: f64) -> Self {
        let (a, b) = (self.isometry(), other.isometry());
        let translation = a.translation.vector.lerp(&b.translation.vector, t);
        // Opposite rotations have no shorter way; halfway between them either end is as good.
        let rotation = a.rotation.try_slerp(&b.rotation, t, 1e-9).unwrap_or(a.rotation);
        Self {
            translation: translation.into(),
            rotation: [rotation.i, rotation.j, rotation.k, rotation.w].map(|v| v as f32),
        }
    }

    /// Extrapolates the pose by `seconds` at this velocity: a straight line and a constant turn.
    #[must_use]
    pub fn moved(&self, velocity: &Velocity, seconds: f64) -> Self {
        let turn = velocity.angular.map(f64::from);
        let turn = UnitQuaternion::from_scaled_axis(nalgebra::Vector3::from(turn) * seconds);
        let rotation = turn * self.isometry().rotation;
        Self {
            translation: std::array::from_fn(|i| {
                self.translation[i] + f64::from(velocity.linear[i]) * seconds
            }),
            rotation: [rotation.i, rotation.j, rotation.k, rotation.w].map(|v| v as f32),
        }
    }

    /// Returns whether every number is finite and the rotation is a unit quaternion to 1e-3.
    pub fn is_valid(&self) -> bool {
        let norm2: f32 = self.rotation.iter().map(|v| v * v).sum();
        self.translation.iter().all(|v| v.is_finite()) && (norm2 - 1.0).abs() < 2e-3
    }
}

impl Default for WorldPose {
    fn default() -> Self {
        Self::at([0.0; 3])
    }
}

/// A pose relative to something nearer than the world: a collider on its body, a joint's frame.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Pose {
    /// Metres.
    pub translation: [f32; 3],
    /// Unit quaternion, scalar last.
    pub rotation: [f32; 4],
}

impl Pose {
    /// Returns the pose as nalgebra's f64 isometry.
    pub(crate) fn isometry(&self) -> Isometry3<f64> {
        WorldPose { translation: self.translation.map(f64::from), rotation: self.rotation }.isometry()
    }
}

/// An impulse on a body: linear (N s) and angular (N m s, about its centre of mass), in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Impulse {
    /// Newton seconds.
    pub linear: [f32; 3],
    /// Newton metre seconds.
    pub angular: [f32; 3],
}

impl Impulse {
    /// Returns whether all of it is a number.
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(&self.angular).all(|v| v.is_finite())
    }

    /// Returns the sum of two.
    pub fn plus(&self, other: &Self) -> Self {
        let sum = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|i| a[i] + b[i]);
        Self { linear: sum(self.linear, other.linear), angular: sum(self.angular, other.angular) }
    }

    /// Returns it so many times.
    #[must_use]
    pub fn scaled(&self, by: f32) -> Self {
        Self { linear: self.linear.map(|v| v * by), angular: self.angular.map(|v| v * by) }
    }
}

/// Linear (m/s) and angular (rad/s) velocity in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Velocity {
    /// Metres per second, of the centre of mass.
    pub linear: [f32; 3],
    /// Radians per second.
    pub angular: [f32; 3],
}

impl Velocity {
    /// Moves without turning, m/s.
    #[must_use]
    pub const fn linear(linear: [f32; 3]) -> Self {
        Self { linear, angular: [0.0; 3] }
    }

    /// Turns in place: about this axis, by its length in rad/s.
    #[must_use]
    pub const fn angular(angular: [f32; 3]) -> Self {
        Self { linear: [0.0; 3], angular }
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(&self.angular).all(|v| v.is_finite())
    }

    /// Returns whether its linear speed is at most this, m/s.
    #[doc(hidden)]
    pub fn is_within(&self, speed_m_s: f32) -> bool {
        self.linear.iter().map(|v| v * v).sum::<f32>() <= speed_m_s * speed_m_s
    }
}

/// The kind of a body: dynamic, fixed or kinematic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
pub enum BodyKind {
    /// By forces.
    Dynamic,
    /// Never.
    Fixed,
    /// To poses that its user gives.
    KinematicPosition,
    /// At velocities that its user gives.
    KinematicVelocity,
}

/// How a body lay when Rapier found its contacts, from where it is. Rapier keeps the lever arms of contacts as they are then, and where they are
/// found anew, in another process, they must be found so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ContactOffset {
    /// How far it lay from there, world axes, metres.
    pub moved_m: [f32; 3],
    /// How it was turned from there, world axes: the vector part of the unit quaternion, whose scalar part is positive.
    pub turned: [f32; 3],
}

impl ContactOffset {
    /// Nobody lay farther away than this, in metres.
    pub(crate) const FARTHEST_M: f32 = 0.5;
    /// The longest vector part of a turn, by a quarter of a radian.
    pub(crate) const MOST_TURNED: f32 = 0.125;

    /// Returns how a body lay that is there.
    #[cfg(feature = "physics")]
    pub(crate) fn applied_to(&self, pose: &WorldPose) -> WorldPose {
        let [x, y, z] = self.turned.map(f64::from);
        let scalar = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(scalar, x, y, z));
        let rotation = turn * pose.isometry().rotation;
        WorldPose {
            translation: std::array::from_fn(|i| pose.translation[i] + f64::from(self.moved_m[i])),
            rotation: [rotation.i, rotation.j, rotation.k, rotation.w].map(|v| v as f32),
        }
    }
}

/// The part of a body that a step changes; everything else stands in [`BodyTraits`].
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BodyState {
    /// Where it is.
    pub pose: WorldPose,
    /// How it moves.
    pub velocity: Velocity,
    /// The user's persistent force, newtons.
    pub force: [f32; 3],
    /// The user's persistent torque, newton metres.
    pub torque: [f32; 3],
    /// Whether it sleeps.
    pub sleeping: bool,
    /// For how long it has been still, seconds.
    pub still_s: f32,
    /// How it walks, if it is a character.
    pub gait: Option<Gait>,
    /// What its driver does, if it is a vehicle.
    pub drive: Option<Drive>,
    /// How it lay when its contacts were found, if that is known.
    pub contact_offset: Option<ContactOffset>,
}

/// Mass, centre of mass and inertia given as numbers.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct MassRecord {
    /// Centre of mass on the body, metres.
    pub local_com: [f32; 3],
    /// Inverse of the mass, 1/kg; 0 for an infinite mass.
    pub inv_mass: f32,
    /// Inverse of the square root of the principal inertia as Rapier keeps it.
    pub inv_principal_inertia: [f32; 3],
    /// Rotation from the body to its principal axes.
    pub principal_frame: [f32; 4],
}

/// Mass that a body has besides that of its colliders.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum ExtraMass {
    /// Kilograms; the inertia follows from the colliders.
    Mass(f32),
    /// Everything given.
    Properties(MassRecord),
}

/// The source of a collider's mass.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum ColliderMass {
    /// kg/m³.
    Density(f32),
    /// Kilograms.
    Mass(f32),
    /// Everything given.
    Properties(MassRecord),
}

/// The rule by which the coefficients of two colliders become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
#[repr(u8)]
pub enum CombineRule {
    /// (a + b) / 2.
    Average,
    /// The smaller.
    Min,
    /// a · b.
    Multiply,
    /// The larger.
    Max,
    /// a + b, at most 1.
    ClampedSum,
    /// √(a · b).
    GeometricMean,
}

/// A collider's collision groups: those it belongs to and those it meets; `any` makes one match enough, else both must match.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
pub struct Groups {
    /// Bits of the groups it belongs to.
    pub memberships: u32,
    /// Bits of the groups it meets.
    pub filter: u32,
    /// Whether one side's match is enough.
    pub any: bool,
}

/// A complete collider.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ColliderRecord {
    /// The shape, sent to a peer at most once.
    pub shape: ShapeHash,
    /// On its body.
    pub pose: Pose,
    /// Source of its mass.
    pub mass: ColliderMass,
    /// Coulomb coefficient.
    pub friction: f32,
    /// How two coefficients of friction combine.
    pub friction_rule: CombineRule,
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f32,
    /// How two coefficients of restitution combine.
    pub restitution_rule: CombineRule,
    /// Whether it only detects.
    pub sensor: bool,
    /// Whether it takes part at all.
    pub enabled: bool,
    /// Groups that decide which pairs collide.
    pub collision_groups: Groups,
    /// Groups that decide which contacts apply forces.
    pub solver_groups: Groups,
    /// Bits of Rapier's `ActiveCollisionTypes`.
    pub collision_types: u16,
    /// Bits of Rapier's `ActiveEvents`.
    pub events: u32,
    /// Bits of Rapier's `ActiveHooks`.
    pub hooks: u32,
    /// Newtons above which a force event is sent.
    pub force_event_threshold_n: f32,
    /// Metres kept between this and other colliders.
    pub contact_skin_m: f32,
    /// The user's own.
    pub user_data: u128,
}

/// The part of a body that a step does not change.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BodyTraits {
    /// How it moves.
    pub kind: BodyKind,
    /// Whether it takes part at all.
    pub enabled: bool,
    /// 1/s.
    pub linear_damping: f32,
    /// 1/s.
    pub angular_damping: f32,
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// Bits of Rapier's `LockedAxes`.
    pub locked_axes: u8,
    /// Heavier group wins.
    pub dominance: i8,
    /// Swept against moving bodies too.
    pub ccd: bool,
    /// Metres of prediction; 0 is none.
    pub soft_ccd_m: f32,
    /// May exceed Rapier's cap on spin.
    pub fast_rotation: bool,
    /// Gyroscopic torque is applied.
    pub gyroscopic: bool,
    /// More solver iterations around this body.
    pub extra_solver_iterations: u32,
    /// More PGS iterations around this body.
    pub extra_pgs_iterations: u32,
    /// Speed below which it may sleep, m/s; negative: never.
    pub sleep_linear_threshold: f32,
    /// Spin below which it may sleep, rad/s; negative: never.
    pub sleep_angular_threshold: f32,
    /// Seconds of stillness before sleep.
    pub sleep_after_s: f32,
    /// Mass besides that of its colliders.
    pub extra_mass: Option<ExtraMass>,
    /// How it walks, if it is a character; kinematic by velocity then.
    pub character: Option<Character>,
    /// On which wheels it drives, if it is a vehicle; dynamic then.
    pub vehicle: Option<Vehicle>,
    /// In order of insertion.
    pub colliders: Vec<ColliderRecord>,
}

/// A complete body, sent when a region is to hold it.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BodyRecord {
    /// Its name.
    pub id: BodyId,
    /// How often its owner has changed.
    pub epoch: Epoch,
    /// What a step changes.
    pub state: BodyState,
    /// What a step does not change; shared within a process by bodies that are alike.
    pub traits: Arc<BodyTraits>,
    /// The user's own. Bodies that differ in nothing else share their traits.
    pub user_data: u128,
}

impl BodyRecord {
    /// Returns how far it reaches from its origin at most, metres; shapes that are not found count as points.
    pub(crate) fn reach_m<'a>(&self, find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>) -> f64 {
        let length = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
        let of = |hash: &ShapeHash| find(*hash).map_or(0.0, ShapeRecord::reach_m);
        let reach = self.traits.colliders.iter().map(|collider| {
            let own = match find(collider.shape) {
                Some(ShapeRecord::Compound(parts)) => {
                    parts.iter().map(|(pose, hash)| length(pose.translation) + of(hash)).fold(0.0, f32::max)
                }
                _ => of(&collider.shape),
            };
            length(collider.pose.translation) + own
        });
        f64::from(reach.fold(0.0, f32::max))
    }

    /// Returns whether a client may have it as an avatar: all shapes that it names are found, and suit clients.
    #[doc(hidden)]
    pub fn suits_clients<'a>(&self, find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>) -> bool {
        let suits = |hash| find(hash).filter(|shape| shape.suits_clients());
        self.traits.colliders.iter().all(|collider| {
            suits(collider.shape).is_some_and(|shape| shape.parts().all(|part| suits(part).is_some()))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halfway_between_two_poses_is_half_the_way_and_half_the_turn() {
        let from = WorldPose::at([100_000.0, 0.0, 0.0]);
        let (sin, cos) = 0.5f32.sin_cos(); // 1 rad about y
        let to = WorldPose { translation: [100_001.0, 2.0, -4.0], rotation: [0.0, sin, 0.0, cos] };
        let half = from.interpolated(&to, 0.5);
        assert_eq!(half.translation, [100_000.5, 1.0, -2.0]);
        assert!((half.isometry().rotation.angle() - 0.5).abs() < 1e-6);
        assert_eq!(from.interpolated(&to, 0.0).translation, from.translation);
        // A quaternion and its negative are one rotation: the way between them is no way.
        let negative = WorldPose { rotation: to.rotation.map(|v| -v), ..to };
        assert!((to.interpolated(&negative, 0.5).isometry().rotation.angle() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn opposite_rotations_interpolate_to_a_rotation() {
        let from = WorldPose::default();
        let to = WorldPose { rotation: [1.0, 0.0, 0.0, 0.0], ..from };
        assert!(from.interpolated(&to, 0.5).is_valid());
    }
}
