//! Defines the wire form of a rigid body. It is complete, so that nothing is lost when a body changes region,
//! process or machine.

use std::sync::Arc;

use bincode::{Decode, Encode};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::{Character, Drive, Gait, ShapeHash, ShapeRecord, Vehicle, WORLD_REACH_M};
use crate::space::{BodyId, Epoch};

/// A pose in world space: position in metres (f64, so that worlds of 100 km keep millimetres), rotation as a
/// unit quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct WorldPose {
    /// The position, metres.
    pub translation: [f64; 3],
    /// The rotation, a unit quaternion, scalar last.
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

    /// Returns the pose between this one (`t` = 0) and `other` (`t` = 1), for drawing between ticks:
    /// positions in a straight line, rotations by SLERP the shorter way (thesis 4.3.2.10). A `t` outside 0 to
    /// 1 extrapolates.
    #[must_use]
    pub fn interpolated(&self, other: &Self, t: f64) -> Self {
        let (a, b) = (self.isometry(), other.isometry());
        let translation = a.translation.vector.lerp(&b.translation.vector, t);
        // Opposite rotations have no shorter way. Halfway between them either end is as good.
        let rotation = a.rotation.try_slerp(&b.rotation, t, 1e-9).unwrap_or(a.rotation);
        Isometry3::from_parts(translation.into(), rotation).into()
    }

    /// Returns the pose after `seconds` at this velocity: along a straight line, with a constant spin.
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

    /// Returns whether the position is within the world's reach, 1e9 m along each axis, and the rotation is a unit
    /// quaternion to 1e-3.
    pub fn is_valid(&self) -> bool {
        let norm2: f32 = self.rotation.iter().map(|v| v * v).sum();
        self.translation.iter().all(|v| v.abs() <= WORLD_REACH_M) && (norm2 - 1.0).abs() < 2e-3
    }
}

impl From<Isometry3<f64>> for WorldPose {
    fn from(Isometry3 { translation, rotation }: Isometry3<f64>) -> Self {
        let rotation = [rotation.i, rotation.j, rotation.k, rotation.w].map(|v| v as f32);
        Self { translation: translation.vector.into(), rotation }
    }
}

impl Default for WorldPose {
    fn default() -> Self {
        Self::at([0.0; 3])
    }
}

/// A pose relative to something nearer than the world, such as a collider on its body, or a joint's frame.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Pose {
    /// The position, metres.
    pub translation: [f32; 3],
    /// The rotation, a unit quaternion, scalar last.
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
    /// The linear impulse, newton seconds.
    pub linear: [f32; 3],
    /// The angular impulse, newton metre seconds.
    pub angular: [f32; 3],
}

impl Impulse {
    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(&self.angular).all(|v| v.is_finite())
    }

    /// Returns the sum of both impulses.
    pub fn plus(&self, other: &Self) -> Self {
        let sum = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|i| a[i] + b[i]);
        Self { linear: sum(self.linear, other.linear), angular: sum(self.angular, other.angular) }
    }

    /// Returns the impulse times `by`.
    #[must_use]
    pub fn scaled(&self, by: f32) -> Self {
        Self { linear: self.linear.map(|v| v * by), angular: self.angular.map(|v| v * by) }
    }
}

/// Linear (m/s) and angular (rad/s) velocity in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Velocity {
    /// The velocity of the centre of mass, m/s.
    pub linear: [f32; 3],
    /// The angular velocity, rad/s.
    pub angular: [f32; 3],
}

impl Velocity {
    /// Returns a velocity along a line, m/s, without spin.
    #[must_use]
    pub const fn linear(linear: [f32; 3]) -> Self {
        Self { linear, angular: [0.0; 3] }
    }

    /// Returns a spin in place about this axis, whose length is the angular speed in rad/s.
    #[must_use]
    pub const fn angular(angular: [f32; 3]) -> Self {
        Self { linear: [0.0; 3], angular }
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(&self.angular).all(|v| v.is_finite())
    }

    /// Returns whether the linear speed is at most this, m/s.
    #[doc(hidden)]
    pub fn is_within(&self, speed_m_s: f32) -> bool {
        self.linear.iter().map(|v| v * v).sum::<f32>() <= speed_m_s * speed_m_s
    }
}

/// The kind of a body: dynamic, fixed or kinematic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
pub enum BodyKind {
    /// Moved by forces and contacts.
    Dynamic,
    /// Never moved.
    Fixed,
    /// Moved to poses that the program gives.
    KinematicPosition,
    /// Moved at velocities that the program gives.
    KinematicVelocity,
}

/// How a body lay when Rapier found its contacts, relative to where it is. Rapier keeps the lever arms of
/// contacts as they are then. Another process that finds the contacts anew must find them so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ContactOffset {
    /// The offset to where it lay, world axes, metres.
    pub moved_m: [f32; 3],
    /// The turn to how it lay, world axes: the vector part of the unit quaternion, whose scalar part is
    /// positive.
    pub turned: [f32; 3],
}

impl ContactOffset {
    /// The longest offset, metres.
    pub(crate) const FARTHEST_M: f32 = 0.5;
    /// The longest vector part of a turn, which is by a quarter of a radian.
    pub(crate) const MOST_TURNED: f32 = 0.125;

    /// Returns how a body lay that is now at this pose.
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

/// The part of a body that a step changes; all else is in [`BodyTraits`].
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BodyState {
    /// The pose in world space.
    pub pose: WorldPose,
    /// The velocity, m/s and rad/s.
    pub velocity: Velocity,
    /// The persistent force that the program applies, newtons.
    pub force: [f32; 3],
    /// The persistent torque that the program applies, newton metres.
    pub torque: [f32; 3],
    /// Says whether the body sleeps.
    pub sleeping: bool,
    /// The time for which the body has been still, seconds.
    pub still_s: f32,
    /// How the body walks, if it is a character.
    pub gait: Option<Gait>,
    /// What the driver does, if the body is a vehicle.
    pub drive: Option<Drive>,
    /// How the body lay when its contacts were found, if that is known.
    pub contact_offset: Option<ContactOffset>,
}

/// The mass properties of a body or collider, as numbers: mass, centre of mass and inertia.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct MassRecord {
    /// The centre of mass on the body, metres.
    pub local_com: [f32; 3],
    /// The inverse of the mass, 1/kg; 0 for an infinite mass.
    pub inv_mass: f32,
    /// The inverse of the square root of the principal inertia, as Rapier keeps it.
    pub inv_principal_inertia: [f32; 3],
    /// The rotation from the body to its principal axes.
    pub principal_frame: [f32; 4],
}

/// The mass that a body has besides that of its colliders.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum ExtraMass {
    /// A mass in kilograms. The inertia follows from the colliders.
    Mass(f32),
    /// All mass properties.
    Properties(MassRecord),
}

/// The source of a collider's mass.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum ColliderMass {
    /// The density, kg/m³.
    Density(f32),
    /// The mass, kilograms.
    Mass(f32),
    /// All mass properties.
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

/// The collision groups of a collider: those that it belongs to, and those that it meets. Both sides must
/// match, unless `any` makes one match enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
pub struct Groups {
    /// The groups that it belongs to, as bits.
    pub memberships: u32,
    /// The groups that it meets, as bits.
    pub filter: u32,
    /// Says whether one side's match is enough.
    pub any: bool,
}

/// A complete collider.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ColliderRecord {
    /// The shape, which a peer is sent at most once.
    pub shape: ShapeHash,
    /// The pose on its body.
    pub pose: Pose,
    /// The source of its mass.
    pub mass: ColliderMass,
    /// The coefficient of Coulomb friction.
    pub friction: f32,
    /// How two coefficients of friction combine.
    pub friction_rule: CombineRule,
    /// The coefficient of restitution, 0 to 1.
    pub restitution: f32,
    /// How two coefficients of restitution combine.
    pub restitution_rule: CombineRule,
    /// Says whether the collider is a sensor, which only detects.
    pub sensor: bool,
    /// Says whether the collider takes part in the simulation.
    pub enabled: bool,
    /// The groups that decide which pairs collide.
    pub collision_groups: Groups,
    /// The groups that decide which contacts apply forces.
    pub solver_groups: Groups,
    /// Bits of Rapier's `ActiveCollisionTypes`.
    pub collision_types: u16,
    /// Bits of Rapier's `ActiveEvents`.
    pub events: u32,
    /// Bits of Rapier's `ActiveHooks`.
    pub hooks: u32,
    /// The force above which a force event is sent, newtons.
    pub force_event_threshold_n: f32,
    /// The distance that is kept between this and other colliders, metres.
    pub contact_skin_m: f32,
    /// The number that the user gave to the collider.
    pub user_data: u128,
}

/// The part of a body that a step does not change.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BodyTraits {
    /// The kind of body.
    pub kind: BodyKind,
    /// Says whether the body takes part in the simulation.
    pub enabled: bool,
    /// The damping of linear motion, 1/s.
    pub linear_damping: f32,
    /// The damping of rotation, 1/s.
    pub angular_damping: f32,
    /// The factor on gravity.
    pub gravity_scale: f32,
    /// The locked axes, as bits of Rapier's `LockedAxes`.
    pub locked_axes: u8,
    /// The dominance group: of two bodies in contact, the one of the higher group acts as if it had infinite
    /// mass.
    pub dominance: i8,
    /// Says whether continuous collision detection is on: the body is swept, against moving bodies too.
    pub ccd: bool,
    /// The prediction distance of soft continuous collision detection, metres; 0 for none.
    pub soft_ccd_m: f32,
    /// Says whether the body may spin faster than Rapier's limit.
    pub fast_rotation: bool,
    /// Says whether gyroscopic torque is applied.
    pub gyroscopic: bool,
    /// The number of additional solver iterations around this body.
    pub extra_solver_iterations: u32,
    /// The number of additional PGS iterations around this body.
    pub extra_pgs_iterations: u32,
    /// The speed below which the body may sleep, m/s; negative for never.
    pub sleep_linear_threshold: f32,
    /// The angular speed below which the body may sleep, rad/s; negative for never.
    pub sleep_angular_threshold: f32,
    /// The time of stillness before the body sleeps, seconds.
    pub sleep_after_s: f32,
    /// The mass besides that of the colliders.
    pub extra_mass: Option<ExtraMass>,
    /// The settings of a character, if the body is one; it is then kinematic by velocity.
    pub character: Option<Character>,
    /// The wheels of a vehicle, if the body is one; it is then dynamic.
    pub vehicle: Option<Vehicle>,
    /// The colliders, in order of insertion.
    pub colliders: Vec<ColliderRecord>,
}

/// A complete body, as it is sent to a region that is to hold it.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BodyRecord {
    /// The id of the body.
    pub id: BodyId,
    /// The number of changes of the body's owner, with the view of its placement ([`Epoch`]).
    pub epoch: Epoch,
    /// The part that a step changes.
    pub state: BodyState,
    /// The part that a step does not change. Bodies that are alike share it within a process.
    pub traits: Arc<BodyTraits>,
    /// The number that the user gave to the body. Bodies that differ in nothing else share their traits.
    pub user_data: u128,
}

impl BodyRecord {
    /// Returns how far the body reaches from its origin at most, metres. Shapes that are not found count as
    /// points.
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

    /// Returns whether a client may have the body as an avatar: all shapes that it names are found, and suit
    /// clients.
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
        // A quaternion and its negative are one rotation, so the way between them is no way.
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
