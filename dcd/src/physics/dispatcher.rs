//! Answers queries about pairs of shapes as Parry does, except for contacts with half-spaces, which Parry 0.31.1
//! finds in the wrong place.

use parry3d::query::{
    ClosestPoints, Contact, DefaultQueryDispatcher, NonlinearRigidMotion, QueryDispatcher, ShapeCastOptions,
    ShapeDistance, ShapeIntersection, Unsupported, details,
};
use rapier3d::prelude::*;

/// Parry's dispatcher, with right contacts of half-spaces. Parry's own `contact_support_map_halfspace` takes the
/// pose of the half-space in the shape's space for that of the shape in the half-space's: a half-space below a
/// shape is always deep in it.
pub(super) struct Dispatcher;

impl QueryDispatcher for Dispatcher {
    fn contact(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
        prediction: f32,
    ) -> Result<Option<Contact>, Unsupported> {
        let parts = second.as_composite_shape();
        match (first.as_halfspace(), second.as_halfspace(), parts) {
            (None, Some(_), _) => {
                let found = self.contact(&pose.inverse(), second, first, prediction)?;
                Ok(found.map(Contact::flipped))
            }
            // Parry asks its own dispatcher about the parts.
            (Some(_), None, Some(parts)) => {
                Ok(details::contact_shape_composite_shape(self, pose, first, parts, prediction))
            }
            _ => DefaultQueryDispatcher.contact(pose, first, second, prediction),
        }
    }

    fn intersection_test(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
    ) -> Result<ShapeIntersection, Unsupported> {
        DefaultQueryDispatcher.intersection_test(pose, first, second)
    }

    fn distance(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
    ) -> Result<ShapeDistance, Unsupported> {
        DefaultQueryDispatcher.distance(pose, first, second)
    }

    fn closest_points(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
        most: f32,
    ) -> Result<ClosestPoints, Unsupported> {
        DefaultQueryDispatcher.closest_points(pose, first, second, most)
    }

    fn cast_shapes(
        &self,
        pose: &Pose,
        velocity: Vector,
        first: &dyn Shape,
        second: &dyn Shape,
        options: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        DefaultQueryDispatcher.cast_shapes(pose, velocity, first, second, options)
    }

    fn cast_shapes_nonlinear(
        &self,
        motion: &NonlinearRigidMotion,
        first: &dyn Shape,
        other: &NonlinearRigidMotion,
        second: &dyn Shape,
        start: f32,
        end: f32,
        stop_at_penetration: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        DefaultQueryDispatcher.cast_shapes_nonlinear(
            motion,
            first,
            other,
            second,
            start,
            end,
            stop_at_penetration,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_space_touches_a_shape_alike_whichever_comes_first() {
        let pair = [-0.2, 0.2].map(|x| (Pose::from_translation(Vector::X * x), SharedShape::ball(0.5)));
        let shapes = [
            SharedShape::ball(0.5),
            SharedShape::cuboid(0.3, 0.5, 0.4),
            SharedShape::capsule_y(0.2, 0.3),
            SharedShape::compound(pair.to_vec()),
        ];
        let half_space = SharedShape::halfspace(Vector::Y);
        let ground = Pose::from_translation(Vector::new(1.0, -3.0, 4.0));
        for shape in &shapes {
            // All reach half a metre below their origin.
            for (height_m, dist_m) in [(0.4, Some(-0.1)), (0.6, Some(0.1)), (5.0, None)] {
                let turn = Rotation::from_axis_angle(Vector::Y, 1.0);
                let place = Pose::from_parts(Vector::new(7.0, height_m - 3.0, -2.0), turn);
                let contact = |one: (&Pose, &SharedShape), other: (&Pose, &SharedShape)| {
                    let apart = one.0.inv_mul(other.0);
                    Dispatcher.contact(&apart, &*one.1.0, &*other.1.0, 1.0).unwrap()
                };
                let [on, under] = [(&place, shape), (&ground, &half_space)];
                let (one, other) = (contact(on, under), contact(under, on).map(Contact::flipped));
                for found in [one, other] {
                    assert_eq!(found.is_some(), dist_m.is_some(), "{height_m} m up");
                    let (Some(found), Some(dist_m)) = (found, dist_m) else { continue };
                    assert!((found.dist - dist_m).abs() < 1e-4, "{height_m} m up: {found:?}");
                    let normal = place.rotation * found.normal1;
                    assert!((normal + Vector::Y).length() < 1e-4, "{height_m} m up: {found:?}");
                    let lowest_m = (place * found.point1).y + 3.0;
                    assert!((lowest_m - dist_m).abs() < 1e-4, "{height_m} m up: {found:?}");
                }
            }
        }
    }
}
