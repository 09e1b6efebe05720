//! Adds up masses and finds the axes of their inertia, in f64. Parry's own sums lose the axes of small bodies (moments
//! below some 1e-5 kg m²) and of bodies whose two smallest moments are equal.

use std::iter::Sum;
use std::ops::{Add, Mul};

use rapier3d::glamx::glam::{DMat3, DQuat, DVec3};
use rapier3d::parry::shape::Shape;
use rapier3d::prelude::*;

/// A mass in kilograms, its centre in metres, and its inertia about that centre in kg m².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mass {
    pub(super) kg: f64,
    pub(super) centre: DVec3,
    pub(super) inertia: DMat3,
}

impl Mass {
    /// Converts Rapier's mass properties.
    pub(super) fn of(properties: &MassProperties) -> Self {
        let frame = properties.principal_inertia_local_frame;
        let moments = DMat3::from_diagonal(properties.principal_inertia().as_dvec3());
        Self {
            kg: properties.mass().into(),
            centre: properties.local_com.as_dvec3(),
            inertia: turned(moments, frame),
        }
    }

    /// Returns the mass of a shape of density 1.
    pub(super) fn of_shape(shape: &dyn Shape) -> Self {
        if let Some(hull) = shape.as_convex_polyhedron() {
            let (points, triangles) = hull.to_trimesh();
            enclosed(&points, &triangles)
        } else if let Some(triangles) = shape.as_trimesh() {
            enclosed(triangles.vertices(), triangles.indices())
        } else {
            Self::of(&shape.mass_properties(1.0))
        }
    }

    /// Returns the mass as seen from the space in which this is the pose of its own.
    pub(super) fn placed(self, pose: &Pose) -> Self {
        let centre = unit(pose.rotation) * self.centre + pose.translation.as_dvec3();
        Self { kg: self.kg, centre, inertia: turned(self.inertia, pose.rotation) }
    }

    /// Returns the moments of inertia and the axes that they belong to. A moment that is below 0 belongs to
    /// no body.
    pub(super) fn principal(&self) -> (DVec3, DQuat) {
        const MOST_ITERATIONS: usize = 1000;
        let tensor = nalgebra::Matrix3::from_column_slice(&self.inertia.to_cols_array());
        let Some(found) = nalgebra::SymmetricEigen::try_new(tensor, f64::EPSILON, MOST_ITERATIONS) else {
            return (self.inertia.diagonal(), DQuat::IDENTITY);
        };
        let mut axes = DMat3::from_cols_slice(found.eigenvectors.as_slice());
        if axes.determinant() < 0.0 {
            axes.z_axis = -axes.z_axis;
        }
        (DVec3::from_slice(found.eigenvalues.as_slice()), DQuat::from_mat3(&axes).normalize())
    }

    /// Converts the mass to Rapier's properties. Moments below 0 become 0.
    pub(super) fn properties(&self) -> MassProperties {
        let (moments, axes) = self.principal();
        MassProperties::with_principal_inertia_frame(
            self.centre.as_vec3(),
            self.kg as f32,
            moments.max(DVec3::ZERO).as_vec3(),
            axes.as_quat().normalize(),
        )
    }
}

/// Joins two parts of a body. A part without mass is ignored.
impl Add for Mass {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        if self.kg == 0.0 || other.kg == 0.0 {
            return if self.kg == 0.0 { other } else { self };
        }
        let kg = self.kg + other.kg;
        let arm = other.centre - self.centre;
        let centre = self.centre + arm * (other.kg / kg);
        let inertia = self.inertia + other.inertia + about_middle(arm) * (self.kg * other.kg / kg);
        Self { kg, centre, inertia }
    }
}

impl Sum for Mass {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), Self::add)
    }
}

/// Makes the mass denser.
impl Mul<f64> for Mass {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { kg: self.kg * factor, inertia: self.inertia * factor, ..self }
    }
}

/// Returns a mesh's mass at density 1 as MuJoCo computes it by default: that of the pyramids over all
/// triangles, whose common tip is the middle of the surface. Each pyramid counts as positive. The mass is
/// exact for convex meshes.
pub(super) fn pyramids(points: &[Vector], triangles: &[[u32; 3]]) -> Mass {
    of_pyramids(points, triangles, f64::abs)
}

/// Returns the mass at density 1 of what a closed mesh encloses, whichever way its triangles all face.
pub(super) fn enclosed(points: &[Vector], triangles: &[[u32; 3]]) -> Mass {
    let mass = of_pyramids(points, triangles, |volume| volume);
    if mass.kg < 0.0 { mass * -1.0 } else { mass }
}

/// Returns the mass of the pyramids over all triangles, each of which counts by its signed volume as `weigh` says.
fn of_pyramids(points: &[Vector], triangles: &[[u32; 3]], weigh: impl Fn(f64) -> f64) -> Mass {
    let corners = |triangle: &[u32; 3]| triangle.map(|i| points[i as usize].as_dvec3());
    let (mut area, mut tip) = (0.0, DVec3::ZERO);
    for [a, b, c] in triangles.iter().map(corners) {
        let twice = (b - a).cross(c - a).length();
        area += twice;
        tip += (a + b + c) / 3.0 * twice;
    }
    tip /= area;
    let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
    let mut all = 0.0;
    for sides in triangles.iter().map(corners).map(|corners| corners.map(|corner| corner - tip)) {
        let part = weigh(sides[0].dot(sides[1].cross(sides[2])) / 6.0);
        let sum: DVec3 = sides.into_iter().sum();
        volume += part;
        all += part.abs();
        first += sum * (part / 4.0);
        second += (outer(sum) + sides.into_iter().map(outer).sum::<DMat3>()) * (part / 20.0);
    }
    // What encloses nothing has a volume of rounding errors.
    if volume.abs() <= 1e-6 * all || !volume.is_finite() {
        return Mass::default();
    }
    let centre = first / volume;
    let second = second - outer(centre) * volume;
    let inertia =
        DMat3::from_diagonal(DVec3::splat(second.col(0).x + second.col(1).y + second.col(2).z)) - second;
    Mass { kg: volume, centre: tip + centre, inertia }
}

/// Makes a collider of a body that is given its mass as a whole add nothing to it, not even an axis. Rapier (0.36) adds
/// them nevertheless, by Parry's sum, unless the collider's mass properties are all zero once it is placed. So they undo
/// its pose, and both are changed within rounding until nothing is left over. With the feature `enhanced-determinism`
/// products of rotations leave a rest, and Parry's sum it is where the collider is turned.
pub(super) fn weightless(collider: &ColliderBuilder) -> ColliderBuilder {
    const TRIES: usize = if cfg!(feature = "enhanced-determinism") { 1 } else { STEPS.pow(4) };
    let Pose { rotation, translation, .. } = collider.position;
    let undone = |rotation: Rotation| {
        let frame = nearest(rotation.inverse()).find(|frame| rotation * *frame == Rotation::IDENTITY)?;
        Some((rotation, frame))
    };
    let Some((rotation, principal_inertia_local_frame)) = nearest(rotation).take(TRIES).find_map(undone)
    else {
        return collider.clone().density(0.0);
    };
    let local_com = rotation.inverse() * -translation;
    let position = Pose::from_parts(-(rotation * local_com), rotation);
    let nothing = MassProperties { local_com, principal_inertia_local_frame, ..MassProperties::default() };
    collider.clone().position(position).mass_properties(nothing)
}

/// The number of values that [`nearest`] tries of each number.
const STEPS: usize = 7;

/// Returns the rotations whose numbers differ from these by no more than some last digits.
fn nearest(rotation: Rotation) -> impl Iterator<Item = Rotation> {
    (0..STEPS.pow(4)).map(move |choice| {
        let mut rest = choice;
        Rotation::from_array(rotation.to_array().map(|number| {
            let step = rest % STEPS;
            rest /= STEPS;
            (0..step.div_ceil(2)).fold(number, |number, _| {
                if step.is_multiple_of(2) { number.next_up() } else { number.next_down() }
            })
        }))
    })
}

/// Returns the inertia of two points this far from each other, about their centre of mass, by their reduced mass.
pub(super) fn about_middle(arm: DVec3) -> DMat3 {
    DMat3::from_diagonal(DVec3::splat(arm.length_squared())) - outer(arm)
}

/// Returns the outer product of a vector with itself.
fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

fn turned(tensor: DMat3, by: Rotation) -> DMat3 {
    let turn = DMat3::from_quat(unit(by));
    turn * tensor * turn.transpose()
}

fn unit(rotation: Rotation) -> DQuat {
    rotation.as_dquat().normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::dice::Dice;

    /// Returns the largest difference of two tensors, as a fraction of the largest number of the second.
    fn error(found: DMat3, right: DMat3) -> f64 {
        let largest =
            |tensor: DMat3| tensor.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        largest(found - right) / largest(right)
    }

    /// Returns half-lengths from 2.5 mm to 0.5 m, of which two may be equal.
    fn sizes(dice: &mut Dice) -> Vector {
        let scale = 10f32.powf(dice.between(-2.6, -0.3));
        let [x, y, z] = [0.0; 3].map(|_| scale * dice.between(0.2, 1.0));
        [Vector::new(x, y, z), Vector::new(x, x, z), Vector::new(x, y, y), Vector::new(x, y, x)]
            [dice.between(0.0, 4.0) as usize]
    }

    #[test]
    fn the_pyramids_of_a_box_weigh_and_turn_as_the_box() {
        let (points, triangles) =
            rapier3d::parry::shape::Cuboid::new(Vector::new(1.0, 2.0, 3.0)).to_trimesh();
        let points: Vec<_> = points.into_iter().map(|point| point + Vector::new(5.0, 0.0, 0.0)).collect();
        let found = pyramids(&points, &triangles).properties();
        let right = SharedShape::cuboid(1.0, 2.0, 3.0).mass_properties(1.0);
        assert!((found.mass() - right.mass()).abs() < 1e-3);
        assert!((found.local_com - Vector::new(5.0, 0.0, 0.0)).length() < 1e-5);
        let difference = found.reconstruct_inertia_matrix() - right.reconstruct_inertia_matrix();
        assert!(difference.to_cols_array().into_iter().all(|v| v.abs() < 1e-2), "{difference:?}");
    }

    #[test]
    fn a_turned_box_keeps_its_axes_however_small_and_of_equal_edges() {
        let mut dice = Dice::new(5);
        for _ in 0..1000 {
            let (half, turn) = (sizes(&mut dice), dice.rotation(3.1));
            let right = Mass::of_shape(&Cuboid::new(half)).placed(&Pose::from_rotation(turn));
            assert!(error(Mass::of(&right.properties()).inertia, right.inertia) < 1e-5, "{half} {turn}");
        }
    }

    #[test]
    fn a_box_of_pieces_weighs_and_turns_as_the_box() {
        let mut dice = Dice::new(6);
        for _ in 0..200 {
            let half = sizes(&mut dice);
            let whole = Mass::of_shape(&Cuboid::new(half));
            let piece = |side: f32| {
                let pose = Pose::from_translation(Vector::new(side * half.x / 2.0, 0.0, 0.0));
                Mass::of_shape(&Cuboid::new(half * Vector::new(0.5, 1.0, 1.0))).placed(&pose)
            };
            let sum: Mass = [-1.0, 1.0].map(piece).into_iter().sum();
            assert!((sum.kg / whole.kg - 1.0).abs() < 1e-5 && sum.centre.length() < 1e-7);
            assert!(error(sum.inertia, whole.inertia) < 1e-5, "{half}");
            let corners: Vec<_> = Cuboid::new(half).to_trimesh().0;
            let hull = Mass::of_shape(&*SharedShape::convex_hull(&corners).unwrap());
            assert!(error(hull.inertia, whole.inertia) < 1e-4, "{half}");
        }
    }

    // With `enhanced-determinism`, rotations are multiplied in an order in which rounding seldom cancels.
    #[cfg(not(feature = "enhanced-determinism"))]
    #[test]
    fn a_body_in_rapier_has_the_mass_that_it_was_given_whatever_its_colliders() {
        let mut dice = Dice::new(7);
        for _ in 0..500 {
            let right = Mass::of_shape(&Cuboid::new(sizes(&mut dice)))
                .placed(&Pose::from_parts(dice.in_cube(0.1), dice.rotation(3.1)));
            let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
            let body = RigidBodyBuilder::dynamic().additional_mass_properties(right.properties());
            let body = bodies.insert(body);
            for _ in 0..3 {
                let at = Pose::from_parts(dice.in_cube(1.0), dice.rotation(3.1));
                let collider = weightless(&ColliderBuilder::cuboid(0.1, 0.2, 0.3).position(at));
                assert!((collider.position.translation - at.translation).length() < 1e-6);
                let turn = collider.position.rotation;
                assert!(
                    (turn.to_array().iter().zip(at.rotation.to_array())).all(|(a, b)| (a - b).abs() < 1e-6)
                );
                colliders.insert_with_parent(collider, body, &mut bodies);
            }
            bodies[body].recompute_mass_properties_from_colliders(&colliders);
            let found = bodies[body].mass_properties().local_mprops;
            assert_eq!(found, right.properties());
        }
    }
}
