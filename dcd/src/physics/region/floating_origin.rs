//! Moves a region's floating origin (the anchor) towards its bodies, so that f32 resolves millimetres
//! wherever they go. While they stay within a kilometre of the anchor, as in any small world, it stays too.

use rapier3d::prelude::*;

use super::{Ownership, Region};
use crate::physics::convert;
use crate::protocol::WorldPose;
use crate::space::{BodyId, Bounds, Tick};

/// Ticks between two checks of the anchor: at 1,000 m/s a body goes a kilometre meanwhile.
const EVERY_TICKS: u64 = 64;
/// Bodies farther from the anchor than this may move it, metres: f32 resolves 0.06 mm here.
const FAR_M: f64 = 1024.0;

impl Region {
    /// Moves the anchor to the middle of the region's own awake bodies when that brings all of them much
    /// nearer to it. Must be called before the first step of a tick. `span` is the number of ticks of that
    /// step, and `immovable` returns where an immovable body is.
    pub(in crate::physics) fn shift_origin(
        &mut self,
        tick: Tick,
        span: u8,
        immovable: impl Fn(BodyId) -> Option<WorldPose>,
    ) {
        if tick.0 % EVERY_TICKS >= u64::from(span) {
            return;
        }
        let awake = self.world.islands.active_bodies();
        let owned = awake.filter(|&handle| matches!(self.role_of(handle), Some((_, Ownership::Owner))));
        let places =
            owned.map(|handle| convert::world_point(self.anchor, self.world.bodies[handle].translation()));
        if let Some(anchor) = better_anchor(self.anchor, places) {
            self.set_anchor(anchor, immovable);
        }
    }
}

/// Returns an anchor much nearer to these places, in world space, if the present one is far from them.
pub(in crate::physics) fn better_anchor(
    anchor: [f64; 3],
    places: impl Iterator<Item = [f64; 3]>,
) -> Option<[f64; 3]> {
    let around = places.map(|place| Bounds::new(place, place)).reduce(|all, place| all.union(&place))?;
    let reach_m = |from: [f64; 3]| {
        let axis = |i: usize| (around.min[i] - from[i]).abs().max((around.max[i] - from[i]).abs());
        (0..3).map(axis).fold(0.0, f64::max)
    };
    let better = convert::anchor_of(around.centre());
    let far_m = reach_m(anchor);
    (far_m > FAR_M && reach_m(better) < 0.5 * far_m).then_some(better)
}

/// Moves the origin of a half-space along its plane to near the region's anchor, if it is far from there.
/// Otherwise the points where the plane is touched would be rounded as that distance is. `pose` is its
/// body's.
pub(super) fn fetch_plane(collider: &mut Collider, pose: &WorldPose, anchor: [f64; 3]) {
    let Some(plane) = collider.shape().as_halfspace() else { return };
    let local = collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
    let body = pose.isometry();
    let of = |v: Vector| nalgebra::Vector3::from(v.to_array().map(f64::from));
    let turn = convert::rotation(pose.rotation) * local.rotation;
    let normal = of(turn * plane.normal).normalize();
    let origin = body * nalgebra::Point3::from(of(local.translation));
    let away = nalgebra::Point3::from(anchor) - origin;
    let along = away - normal * away.dot(&normal);
    if along.norm() > FAR_M {
        let near = body.inverse() * (origin + along);
        let translation = Vector::from_array([near.x, near.y, near.z].map(|v| v as f32));
        collider.set_position_wrt_parent(Pose::from_parts(translation, local.rotation));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_anchor_moves_only_when_that_brings_everything_much_nearer() {
        let moved = |places: &[[f64; 3]]| better_anchor([0.0; 3], places.iter().copied());
        assert_eq!(moved(&[]), None);
        assert_eq!(moved(&[[1000.0, 0.0, -1000.0]]), None, "near enough");
        assert_eq!(moved(&[[99_000.0, 0.0, 0.0], [100_000.0, 50.0, 0.0]]), Some([99_328.0, 0.0, 0.0]));
        assert_eq!(moved(&[[0.0; 3], [100_000.0, 0.0, 0.0]]), None, "half of them would be as far");
    }

    #[test]
    fn a_plane_is_touched_near_the_anchor_and_stays_the_same_plane() {
        let turn = Rotation::from_rotation_z(0.1);
        let pose = WorldPose { translation: [3.0, 2.0, 1.0], rotation: turn.to_array() };
        let mut world = PhysicsWorld::new();
        let (_, plane) =
            world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::new(SharedShape::halfspace(Vector::Y)));
        let plane = &mut world.colliders[plane];
        let anchor = [51_200.0, 5_120.0, 0.0];
        fetch_plane(plane, &pose, anchor);
        let local = plane.position_wrt_parent().unwrap().translation;
        assert!(local.y.abs() < 0.01, "still in the plane: {local}");
        let found = convert::world_from_region(
            anchor,
            &(convert::region_from_world(anchor, &pose) * Pose::from_translation(local)),
        );
        let normal = (turn * Vector::Y).to_array();
        let off: f64 = (0..3).map(|i| (found.translation[i] - anchor[i]) * f64::from(normal[i])).sum();
        let far: f64 = (0..3).map(|i| (found.translation[i] - anchor[i]).powi(2)).sum::<f64>().sqrt();
        assert!(far - off.abs() < 1.0, "the nearest point of the plane");
        plane.set_position_wrt_parent(Pose::IDENTITY);
        fetch_plane(plane, &pose, [512.0, 0.0, 0.0]);
        assert_eq!(plane.position_wrt_parent(), Some(&Pose::IDENTITY), "near enough");
    }
}
