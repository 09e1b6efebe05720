//! Reads how characters and vehicles that are moved where they are computed stand: on what, how steep it is, and where each wheel
//! is.

use std::f32::consts::FRAC_PI_2;

use rapier3d::prelude::*;

use super::ControlError;
use crate::physics::collider_id::ColliderId;
use crate::physics::convert;
use crate::physics::host::RegionHost;
use crate::physics::query::{BodyFilter, WorldRay};
use crate::protocol::{Wheel, WorldPose};
use crate::space::BodyId;

/// The distance beyond its gap at which Rapier's controller takes a character to stand on something, metres.
const STANDS_WITHIN_M: f32 = 0.05;

/// The cosine of the steepest slope that counts as ground and not as a wall, as in Rapier's controller.
const STEEPEST: f32 = 1e-3;

/// The ground under a character or a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Ground {
    /// The collider.
    pub collider: ColliderId,
    /// The point on its surface, in world space, metres.
    pub point: [f64; 3],
    /// The unit normal there, out of the ground.
    pub normal: [f32; 3],
    /// The angle between the normal and the direction against gravity, radians: 0 on level ground.
    pub slope_rad: f32,
}

/// The stance of a character after the last step ([`World::character_state`](crate::World::character_state)).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CharacterState {
    /// Says whether the character stands on something. Only then can it jump.
    pub grounded: bool,
    /// Says whether the character slides down ground that is too steep for it to stand on
    /// ([`Character::min_slide_rad`](crate::Character)).
    pub sliding: bool,
    /// The flattest ground that the character touches; `None` in the air, and where what it stood on has gone in
    /// the same step.
    pub ground: Option<Ground>,
}

/// The state of a wheel after the last step ([`World::wheels`](crate::World::wheels)): where to draw it, and on what it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WheelState {
    /// The centre of the wheel, and its rotation: that of the chassis, then steered, then rolled.
    pub pose: WorldPose,
    /// The length of the suspension, from where it begins to the centre of the wheel, metres.
    pub suspension_m: f32,
    /// The angle by which the wheel is steered about its suspension, radians; above 0 to the left.
    pub steering_rad: f32,
    /// The angle by which the wheel has rolled forward since it was inserted, radians, -π to π.
    pub rolled_rad: f32,
    /// The speed at which the wheel rolls forward, rad/s. In the air it slows down by 1 % per step.
    pub spin_rad_s: f32,
    /// The ground on which the wheel stands; `None` in the air.
    pub ground: Option<Ground>,
}

impl RegionHost {
    /// Returns how a character stands; `None` if its region is not computed here, or if it is no character.
    pub(crate) fn character_state(&self, id: BodyId) -> Result<Option<CharacterState>, ControlError> {
        let Some((region, handle)) = self.owned(id) else { return Ok(None) };
        let Some((character, gait)) = region.traits_of(handle).character.zip(region.gait(handle)) else {
            return Ok(None);
        };
        let world = region.physics();
        let body = &world.bodies[handle];
        let mut parts = body.colliders().iter().filter_map(|&part| world.colliders.get(part));
        let part = parts.find(|part| !part.is_sensor() && part.is_enabled());
        let mut flattest: Option<Ground> = None;
        if let Some(part) = part {
            let place = *body.position() * part.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
            let place = convert::world_from_region(region.anchor(), &place);
            let filter = BodyFilter {
                flags: QueryFilterFlags::EXCLUDE_SENSORS,
                groups: Some(part.collision_groups()),
                exclude_bodies: &[id],
                ..BodyFilter::default()
            };
            let reach_m =
                if gait.grounded { character.gap_m + STANDS_WITHIN_M } else { 2.0 * character.gap_m };
            self.queries().visit_touching(part.shape(), &place, reach_m, &filter, |touching| {
                let ground = self.ground(touching.collider, touching.point, touching.normal);
                let is_flatter = flattest.is_none_or(|best| ground.slope_rad < best.slope_rad);
                if is_flatter && ground.slope_rad <= STEEPEST.acos() {
                    flattest = Some(ground);
                }
            })?;
        }
        let is_steep = |ground: Ground| ground.slope_rad > character.min_slide_rad;
        let sliding = !gait.grounded && gait.rise_m_s <= 0.0 && flattest.is_some_and(is_steep);
        Ok(Some(CharacterState { grounded: gait.grounded, sliding, ground: flattest }))
    }

    /// Returns the state of each wheel of a vehicle, in the order of [`Vehicle::wheels`](crate::Vehicle); `None` if
    /// its region is not computed here, or if it is no vehicle.
    pub(crate) fn wheels(&self, id: BodyId) -> Result<Option<Vec<WheelState>>, ControlError> {
        let Some((region, handle)) = self.owned(id) else { return Ok(None) };
        let Some(drive) = region.drive(handle) else { return Ok(None) };
        let Some(vehicle) = &region.traits_of(handle).vehicle else { return Ok(None) };
        let chassis = region.world_pose(handle);
        let filter = BodyFilter {
            flags: QueryFilterFlags::EXCLUDE_SENSORS,
            groups: Some(region.wheel_groups(handle)),
            exclude_bodies: &[id],
            ..BodyFilter::default()
        };
        let states = vehicle.wheels.iter().enumerate().map(|(number, wheel)| {
            let roll = self.roll(id, number);
            let steering_rad = drive.steering * wheel.steering_rad;
            let (begin, down) = suspension(wheel, &chassis);
            let ray = WorldRay::new(begin, down.to_array()).up_to(f64::from(wheel.rest_m + wheel.radius_m));
            let hit = self.queries().cast_ray(&ray, &filter)?;
            let suspension_m = hit.map_or(wheel.rest_m, |hit| {
                let pressed_m = hit.distance_m as f32 - wheel.radius_m;
                pressed_m.clamp(wheel.rest_m - wheel.travel_m, wheel.rest_m + wheel.travel_m)
            });
            let turn = Rotation::from_axis_angle(-convert::vector(wheel.down), steering_rad)
                * Rotation::from_axis_angle(convert::vector(wheel.axle), -roll.angle_rad);
            let pose = WorldPose {
                translation: convert::world_point(begin, down * suspension_m),
                rotation: (convert::rotation(chassis.rotation) * turn).normalize().to_array(),
            };
            let ground = hit.map(|hit| {
                // A ray that begins inside of something has no normal there.
                let normal = convert::vector(hit.normal).try_normalize().unwrap_or(-down);
                self.ground(hit.collider_id(), hit.point, normal)
            });
            let (rolled_rad, spin_rad_s) = (roll.angle_rad, roll.spin_rad_s);
            Ok(WheelState { pose, suspension_m, steering_rad, rolled_rad, spin_rad_s, ground })
        });
        states.collect::<Result<_, ControlError>>().map(Some)
    }

    fn ground(&self, collider: ColliderId, point: [f64; 3], normal: Vector) -> Ground {
        let up = (-convert::vector(self.settings().gravity)).try_normalize().unwrap_or(Vector::Y);
        let rise = normal.dot(up).clamp(-1.0, 1.0);
        // Near 1 the arc cosine is off by a milliradian.
        let slope_rad = normal.cross(up).length().min(1.0).asin();
        let slope_rad = if rise < 0.0 { 2.0 * FRAC_PI_2 - slope_rad } else { slope_rad };
        Ground { collider, point, normal: normal.to_array(), slope_rad }
    }
}

/// Returns where the suspension of a wheel begins, in world space, and its direction there.
fn suspension(wheel: &Wheel, chassis: &WorldPose) -> ([f64; 3], Vector) {
    let turn = convert::rotation(chassis.rotation);
    let begin = convert::world_point(chassis.translation, turn * convert::vector(wheel.at_m));
    (begin, turn * convert::vector(wheel.down))
}
