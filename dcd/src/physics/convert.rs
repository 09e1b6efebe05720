//! Converts wire values to Rapier's types and back, and world space (f64) to region space (f32, relative to the region's origin,
//! its anchor).

use rapier3d::prelude::*;

use crate::protocol::{self, Velocity, WORLD_REACH_M, WorldPose};

/// The spacing, metres, of the grid on which region origins (anchors) lie. It is so coarse that worlds within
/// ±256 m have one anchor and all their regions agree bit for bit.
pub(crate) const ANCHOR_GRID_M: f64 = 512.0;

/// Returns the origin (anchor) of a region whose part of the world has this centre.
pub(crate) fn anchor_of(centre: [f64; 3]) -> [f64; 3] {
    centre.map(|v| (v / ANCHOR_GRID_M).round() * ANCHOR_GRID_M)
}

pub(crate) fn vector(v: [f32; 3]) -> Vector {
    Vector::from_array(v)
}

pub(crate) fn rotation(q: [f32; 4]) -> Rotation {
    Rotation::from_array(q)
}

pub(crate) fn pose(pose: protocol::Pose) -> Pose {
    Pose::from_parts(vector(pose.translation), rotation(pose.rotation))
}

pub(crate) fn pose_record(pose: &Pose) -> protocol::Pose {
    protocol::Pose { translation: pose.translation.to_array(), rotation: pose.rotation.to_array() }
}

pub(crate) fn region_from_world(anchor: [f64; 3], pose: &WorldPose) -> Pose {
    Pose::from_parts(region_point(anchor, pose.translation), rotation(pose.rotation))
}

/// Converts a pose to world space. A body that has left the world is reported at its edge: no message may
/// have a body farther out.
#[inline]
pub(crate) fn world_from_region(anchor: [f64; 3], pose: &Pose) -> WorldPose {
    let translation = world_point(anchor, pose.translation).map(|v| v.clamp(-WORLD_REACH_M, WORLD_REACH_M));
    WorldPose { translation, rotation: pose.rotation.to_array() }
}

pub(crate) fn region_point(anchor: [f64; 3], point: [f64; 3]) -> Vector {
    Vector::from_array(std::array::from_fn(|i| (point[i] - anchor[i]) as f32))
}

#[inline]
pub(crate) fn world_point(anchor: [f64; 3], point: Vector) -> [f64; 3] {
    let point = point.to_array();
    std::array::from_fn(|i| f64::from(point[i]) + anchor[i])
}

/// Returns a body's velocity, or zero if it is not finite: a position-based kinematic body keeps the velocity
/// that a contact with a broken body has given it.
#[inline]
pub(crate) fn velocity_of(body: &RigidBody) -> Velocity {
    let velocity = Velocity { linear: body.linvel().to_array(), angular: body.angvel().to_array() };
    if velocity.is_finite() { velocity } else { Velocity::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_worlds_share_one_anchor() {
        assert_eq!(anchor_of([-200.0, 0.0, 255.0]), [0.0; 3]);
        assert_eq!(anchor_of([100_000.0, 300.0, -300.0]), [99_840.0, 512.0, -512.0]);
    }

    #[test]
    fn a_pose_survives_the_way_into_a_region_and_back() {
        let anchor = [99_840.0, 0.0, 0.0];
        let pose = WorldPose { translation: [99_900.125, -2.5, 3.0], rotation: [0.5, 0.5, 0.5, 0.5] };
        assert_eq!(world_from_region(anchor, &region_from_world(anchor, &pose)), pose);
    }
}
