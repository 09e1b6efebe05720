//! Casts a shape that moves and rotates onto a half-space, which Parry 0.31 does not support.

use std::ops::Range;

use parry3d::query::{NonlinearRigidMotion, ShapeCastHit, ShapeCastStatus};
use rapier3d::prelude::*;

/// The steps per radian that the shape turns. Between two of them a point at distance r from the centre dips by
/// r / (8 * 64²) at most, r / 32,768, and comes up again.
const STEPS_PER_RAD: f32 = 64.0;

/// The fewest and the most steps of a cast. A shape that turns by more than 32 rad is looked at less often.
const STEPS: [f32; 2] = [16.0, 2048.0];

/// The number of times that the step in which the shape hits is halved.
const HALVINGS: usize = 24;

/// The depth by which a shape that overlaps the half-space at the start must get deeper to hit it, metres.
const DEEPER_M: f32 = 1e-4;

/// Returns the first hit of a moving shape on a half-space, in the half-space's own space: where the height of
/// the shape's lowest point becomes 0. `None` if there is none, or the shape has no lowest point that is known
/// here.
///
/// No point of the shape falls faster than the fastest one may, so that each step goes as far as the height
/// lasts (conservative advancement: Mirtich, Impulse-based Dynamic Simulation, 1996), or on by a fixed part of
/// the turn where that is more.
pub(super) fn onto_half_space(
    half_space: &HalfSpace,
    place: &Pose,
    shape: &dyn Shape,
    motion: &NonlinearRigidMotion,
    times: &Range<f32>,
    stop_at_penetration: bool,
) -> Option<ShapeCastHit> {
    let normal = place.rotation * half_space.normal;
    let span = times.end - times.start;
    let at = |part: f32| times.start + span * part;
    let lowest = |part: f32| farthest(shape, &motion.position_at_time(at(part)), -normal);
    let height_at = |part: f32| Some(normal.dot(lowest(part)? - place.translation));
    let hit = |part: f32, status: ShapeCastStatus| {
        let (pose, point) = (motion.position_at_time(at(part)), lowest(part)?);
        let below = point - normal * normal.dot(point - place.translation);
        Some(ShapeCastHit {
            time_of_impact: at(part),
            witness1: place.inverse_transform_point(below),
            witness2: pose.inverse_transform_point(point),
            normal1: half_space.normal,
            normal2: pose.rotation.inverse() * -normal,
            status,
            subshape1: 0,
            subshape2: 0,
        })
    };
    let mut height_m = height_at(0.0)?;
    let overlaps = height_m <= 0.0;
    if overlaps && stop_at_penetration {
        return hit(0.0, ShapeCastStatus::PenetratingOrWithinTargetDist);
    }
    let ball = shape.compute_local_bounding_sphere();
    let reach_m = (ball.center - motion.local_center).length() + ball.radius;
    let fastest_m = (reach_m * motion.angvel.cross(normal).length() - motion.linvel.dot(normal)) * span;
    if fastest_m <= 0.0 {
        return None;
    }
    // NaN takes the fewest steps.
    let steps = (motion.angvel.length() * span * STEPS_PER_RAD).clamp(STEPS[0], STEPS[1]).max(STEPS[0]);
    let slack_m = if overlaps { DEEPER_M } else { 0.0 };
    // The highest that it was while it overlapped, or 0.
    let mut level_m = height_m.min(0.0);
    let mut part = 0.0;
    while part < 1.0 {
        let hits_m = level_m - slack_m;
        let next = (part + ((height_m - hits_m) / fastest_m).max(steps.recip())).min(1.0);
        let next_m = height_at(next)?;
        if next_m <= hits_m {
            let (mut before, mut after) = (part, next);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (before + after);
                if height_at(middle)? <= hits_m { after = middle } else { before = middle }
            }
            let status = match level_m < 0.0 {
                true => ShapeCastStatus::PenetratingOrWithinTargetDist,
                false => ShapeCastStatus::Converged,
            };
            return hit(before, status);
        }
        level_m = level_m.max(next_m.min(0.0));
        (part, height_m) = (next, next_m);
    }
    None
}

/// Returns the point of a shape that is farthest in a direction.
fn farthest(shape: &dyn Shape, pose: &Pose, direction: Vector) -> Option<Vector> {
    if let Some(convex) = shape.as_support_map() {
        return Some(convex.support_point(pose, direction));
    }
    let mut found = None::<Vector>;
    let mut offer = |point: Vector| {
        if found.is_none_or(|other| direction.dot(point) > direction.dot(other)) {
            found = Some(point);
        }
    };
    if let Some(voxels) = shape.as_voxels() {
        let voxel = Cuboid::new(voxels.voxel_size() * 0.5);
        for filled in voxels.voxels().filter(|voxel| !voxel.state.is_empty()) {
            offer(voxel.support_point(&(*pose * Pose::from_translation(filled.center)), direction));
        }
    } else if let Some(parts) = shape.as_composite_shape() {
        for part in parts.bvh().leaves(|_| true) {
            parts.map_part_at(part, &mut |place, part, _| {
                let pose = place.map_or(*pose, |place| *pose * *place);
                farthest(part, &pose, direction).into_iter().for_each(&mut offer);
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Casts a shape onto a half-space with this place.
    fn cast(
        place: &Pose,
        shape: &SharedShape,
        motion: &NonlinearRigidMotion,
        times: Range<f32>,
        stop_at_penetration: bool,
    ) -> Option<ShapeCastHit> {
        onto_half_space(&HalfSpace::new(Vector::Y), place, &*shape.0, motion, &times, stop_at_penetration)
    }

    /// Returns the height of a shape's lowest point by the AABBs of its parts.
    fn height_m(place: &Pose, shape: &SharedShape, motion: &NonlinearRigidMotion, time: f32) -> f32 {
        let pose = place.inv_mul(&motion.position_at_time(time));
        let lowest = |pose: &Pose, shape: &SharedShape| shape.compute_aabb(pose).mins.y;
        match shape.as_compound() {
            Some(compound) => {
                let parts = compound.shapes().iter();
                parts.map(|(at, part)| lowest(&(pose * *at), part)).fold(f32::INFINITY, f32::min)
            }
            None => lowest(&pose, shape),
        }
    }

    #[test]
    fn a_turning_shape_hits_when_its_lowest_point_does() {
        let pair = [-0.6, 0.6].map(|x| (Pose::from_translation(Vector::X * x), SharedShape::ball(0.3)));
        let shapes = [
            SharedShape::ball(0.5),
            SharedShape::cuboid(0.3, 0.8, 0.4),
            SharedShape::capsule_y(0.6, 0.2),
            SharedShape::cone(0.5, 0.4),
            SharedShape::compound(pair.to_vec()),
        ];
        let mut state = 1_u64;
        let mut roll = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
        };
        let mut any = |size: f32| Vector::new(roll(), roll(), roll()) * size;
        let (mut hits, mut misses) = (0, 0);
        for shape in shapes.iter().cycle().take(500) {
            let place = Pose::from_parts(any(1.0), Rotation::from_scaled_axis(any(1.0)));
            let above = Pose::from_translation(Vector::Y * 1.5 + any(1.0));
            let motion = NonlinearRigidMotion {
                start: place * above * Pose::from_rotation(Rotation::from_scaled_axis(any(3.0))),
                local_center: any(0.5),
                linvel: any(3.0),
                angvel: any(5.0),
            };
            let hit = cast(&place, shape, &motion, 0.5..1.5, true);
            let end = hit.map_or(1.5, |hit| hit.time_of_impact);
            let time = |i: u16| 0.5 + (end - 0.5) * f32::from(i) / 1e3;
            let heights = (0..=1_000).map(|i| height_m(&place, shape, &motion, time(i)));
            let Some(hit) = hit else {
                assert!(heights.fold(f32::INFINITY, f32::min) > -1e-4, "it misses {motion:?}");
                misses += 1;
                continue;
            };
            if hit.status == ShapeCastStatus::PenetratingOrWithinTargetDist {
                assert!(hit.time_of_impact == 0.5 && height_m(&place, shape, &motion, 0.5) < 1e-4, "{hit:?}");
                continue;
            }
            hits += 1;
            assert!(heights.fold(f32::INFINITY, f32::min) > -1e-4, "{hit:?} is late, {motion:?}");
            assert!(height_m(&place, shape, &motion, end) < 1e-3, "{hit:?} is early, {motion:?}");
            let on_shape = motion.position_at_time(end) * hit.witness2;
            assert!((place * hit.witness1 - on_shape).length() < 1e-3, "{hit:?}");
            let turned = motion.position_at_time(end).rotation * hit.normal2;
            assert!((place.rotation * hit.normal1 + turned).length() < 1e-4, "{hit:?}");
        }
        assert!(hits > 100 && misses > 100, "{hits} hits, {misses} misses");
    }

    #[test]
    fn what_overlaps_at_the_start_hits_where_it_gets_deeper_or_comes_back() {
        let ball = SharedShape::ball(0.5);
        // It swings about a point beside it: up and down again, or down at once.
        let swung = |spin: f32| NonlinearRigidMotion {
            start: Pose::from_translation(Vector::Y * 0.4),
            local_center: Vector::X,
            linvel: Vector::ZERO,
            angvel: Vector::Z * spin,
        };
        let hit = |spin: f32, stop: bool| cast(&Pose::IDENTITY, &ball, &swung(spin), 0.0..4.0, stop).unwrap();
        let overlaps = ShapeCastStatus::PenetratingOrWithinTargetDist;
        for spin in [-1.0, 1.0] {
            let stopped = hit(spin, true);
            assert_eq!((stopped.time_of_impact, stopped.status), (0.0, overlaps));
        }
        let deeper = hit(1.0, false);
        assert!(deeper.time_of_impact < 1e-3 && deeper.status == overlaps, "{deeper:?}");
        let back = hit(-1.0, false);
        let expected = std::f32::consts::PI - 0.1_f32.asin();
        assert!((back.time_of_impact - expected).abs() < 1e-2, "{back:?}");
        assert_eq!(back.status, ShapeCastStatus::Converged);
    }
}
