//! Computes how large and heavy a body is from its record, wherever the body is computed: box, mass, centre
//! of mass, inertia.

use rapier3d::prelude::*;

use super::convert;
use super::record;
use super::shapes::{ShapeError, ShapeLibrary};
use crate::protocol::{BodyKind, BodyRecord};
use crate::space::Bounds;

/// The size, mass and inertia of a body, as [`World::extent`](crate::World::extent) computes them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BodyExtent {
    /// The smallest box along the axes of world space that holds the body's colliders, metres; infinite for a
    /// half-space.
    pub aabb: Bounds,
    /// The mass, kilograms; 0 for a fixed body.
    pub mass_kg: f32,
    /// The centre of mass, from the body's origin along the body's own axes, metres.
    pub centre_of_mass: [f32; 3],
    /// The moments of inertia about the principal axes through the centre of mass, kg m²; 0 for a fixed body.
    pub principal_inertia: [f32; 3],
    /// The rotation from the body's own axes to the principal ones, a unit quaternion, scalar last.
    pub principal_axes: [f32; 4],
}

impl BodyExtent {
    /// Computes the extent of a body whose shapes are in the library.
    pub(crate) fn of(known: &BodyRecord, shapes: &ShapeLibrary) -> Result<Self, ShapeError> {
        // Near the body single precision is fine, wherever in the world the body is.
        let origin = known.state.pose.translation;
        let (body, parts) = record::build(known, origin, shapes)?;
        let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
        let body = bodies.insert(body);
        for part in parts {
            colliders.insert_with_parent(part, body, &mut bodies);
        }
        bodies[body].recompute_mass_properties_from_colliders(&colliders);
        let boxes = colliders.iter().map(|(_, collider)| {
            let aabb = collider.shape().compute_aabb(collider.position());
            // Parry's half-space spans half of f32's range.
            let far = |v: f32| if v.abs() > 1e30 { f32::INFINITY.copysign(v) } else { v };
            let point = |v: Vector| convert::world_point(origin, Vector::from_array(v.to_array().map(far)));
            Bounds { min: point(aabb.mins), max: point(aabb.maxs) }
        });
        let mass = &bodies[body].mass_properties().local_mprops;
        let moves = if known.traits.kind == BodyKind::Fixed { 0.0 } else { 1.0 };
        Ok(Self {
            aabb: boxes.reduce(|all, one| all.union(&one)).unwrap_or(Bounds { min: origin, max: origin }),
            mass_kg: moves * mass.mass(),
            centre_of_mass: mass.local_com.to_array(),
            principal_inertia: (moves * mass.principal_inertia()).to_array(),
            principal_axes: mass.principal_inertia_local_frame.to_array(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::WorldPose;
    use crate::space::BodyId;

    fn extent(pose: WorldPose, colliders: &[ColliderBuilder]) -> BodyExtent {
        let mut shapes = ShapeLibrary::default();
        let body = RigidBodyBuilder::dynamic().build();
        let known = shapes.describe(BodyId::persistent(0), pose, &body, colliders).unwrap();
        BodyExtent::of(&known, &shapes).unwrap()
    }

    #[test]
    fn a_box_far_out_has_the_mass_and_the_size_that_it_was_given() {
        let cube = ColliderBuilder::cuboid(0.5, 1.0, 1.5).density(1000.0).translation(Vector::X);
        let extent = extent(WorldPose::at([90_000.0, 0.0, 0.25]), &[cube]);
        assert_eq!(extent.aabb, Bounds::new([90_000.5, -1.0, -1.25], [90_001.5, 1.0, 1.75]));
        assert!((extent.mass_kg - 6000.0).abs() < 0.01, "{extent:?}");
        assert_eq!(extent.centre_of_mass, [1.0, 0.0, 0.0]);
        let moment = |a: f32, b: f32| 6000.0 / 12.0 * (a * a + b * b);
        let exact = [moment(2.0, 3.0), moment(1.0, 3.0), moment(1.0, 2.0)];
        for (found, exact) in extent.principal_inertia.into_iter().zip(exact) {
            assert!((found / exact - 1.0).abs() < 1e-4, "{extent:?}");
        }
    }

    #[test]
    fn what_is_endless_has_an_endless_box_and_what_is_disabled_no_mass() {
        let half_space = ColliderBuilder::new(SharedShape::halfspace(Vector::Y)).mass(1.0);
        let Bounds { min, max } = extent(WorldPose::default(), &[half_space]).aabb;
        assert_eq!((min, max), ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]));
        let balls =
            [ColliderBuilder::ball(1.0).mass(2.0), ColliderBuilder::ball(1.0).mass(3.0).enabled(false)];
        assert_eq!(extent(WorldPose::default(), &balls).mass_kg, 2.0);
    }
}
