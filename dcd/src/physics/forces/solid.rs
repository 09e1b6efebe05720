//! Measures shapes for explosions and fluids: their silhouettes, the area that presses them aside, and their
//! volumes below a plane.

use rapier3d::prelude::*;

/// The number of corners that stand for a circle where a curved surface is measured by triangles.
const SIDES: u32 = 24;

/// A volume, m³, and its centre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Volume {
    pub(super) m3: f32,
    pub(super) centre: Vector,
}

impl Volume {
    pub(super) fn joined(self, other: Self) -> Self {
        let m3 = self.m3 + other.m3;
        let moment = self.centre * self.m3 + other.centre * other.m3;
        Self { m3, centre: if m3 > 0.0 { moment / m3 } else { Vector::ZERO } }
    }
}

/// Returns the area of a shape's shadow in light along a direction of length 1, m². Parts of a compound or of
/// a shape that is not convex all count, even behind one another.
pub(super) fn silhouette_m2(shape: &dyn Shape, pose: &Pose, direction: Vector) -> f32 {
    let local = pose.rotation.inverse() * direction;
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => std::f32::consts::PI * ball.radius * ball.radius,
        TypedShape::Compound(compound) => {
            let parts = compound.shapes().iter();
            parts.map(|(place, part)| silhouette_m2(&**part, place, local)).sum()
        }
        _ => {
            let (points, triangles) = surface(shape);
            let shadow = |corners: &[u32; 3]| {
                let [a, b, c] = corners.map(|corner| points[corner as usize]);
                0.5 * (b - a).cross(c - a).dot(local).abs()
            };
            // A ray meets a closed surface twice.
            0.5 * triangles.iter().map(shadow).sum::<f32>()
        }
    }
}

/// Returns the area by which a fluid presses a shape aside, m², as a vector. The shape moves along
/// `direction`, of length 1. The area is the sum over all faces turned forwards of the face's shadow, against
/// its normal; of the sum only the part across the direction.
pub(super) fn lift_m2(shape: &dyn Shape, pose: &Pose, direction: Vector) -> Vector {
    let local = pose.rotation.inverse() * direction;
    if let TypedShape::Compound(compound) = shape.as_typed_shape() {
        let parts = compound.shapes().iter();
        return pose.rotation * parts.map(|(place, part)| lift_m2(&**part, place, local)).sum::<Vector>();
    }
    let (points, triangles) = surface(shape);
    let pressed = triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let face = 0.5 * (b - a).cross(c - a);
        face.try_normalize().map_or(Vector::ZERO, |normal| normal * -face.dot(local).max(0.0))
    });
    let pressed: Vector = pressed.sum();
    pose.rotation * (pressed - local * pressed.dot(local))
}

/// Returns the volume of a shape; zero for a shape without an inside.
pub(super) fn volume(shape: &dyn Shape, pose: &Pose) -> Volume {
    let mass = shape.mass_properties(1.0);
    Volume { m3: mass.mass(), centre: *pose * mass.local_com }
}

/// Returns the part of a shape's volume where `up · point` is at most `height_m`; `up` has length 1.
pub(super) fn volume_below(shape: &dyn Shape, pose: &Pose, up: Vector, height_m: f32) -> Volume {
    let ball = shape.compute_bounding_sphere(pose);
    let above_m = ball.center.dot(up) - height_m;
    if above_m >= ball.radius {
        return Volume::default();
    }
    if above_m <= -ball.radius {
        return volume(shape, pose);
    }
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => {
            // A spherical cap of depth h has the volume pi h² (3 r - h) / 3. Its centre lies
            // 3 (2 r - h)² / (4 (3 r - h)) below the ball's.
            let (r, h) = (ball.radius, ball.radius - above_m);
            let m3 = std::f32::consts::PI * h * h * (3.0 * r - h) / 3.0;
            let below_m = 0.75 * (2.0 * r - h).powi(2) / (3.0 * r - h);
            Volume { m3, centre: pose.translation - up * below_m }
        }
        TypedShape::Compound(compound) => {
            let parts = compound.shapes().iter();
            let parts = parts.map(|(place, part)| volume_below(&**part, &(*pose * *place), up, height_m));
            parts.fold(Volume::default(), Volume::joined)
        }
        _ => mesh_below(shape, pose, up, height_m),
    }
}

/// Returns the part of a closed surface's volume below a plane. It is the sum of the tetrahedra from a point
/// on the plane to all triangles below the plane. The cut face lies in the plane, so its tetrahedra are
/// empty.
fn mesh_below(shape: &dyn Shape, pose: &Pose, up: Vector, height_m: f32) -> Volume {
    let (points, triangles) = surface(shape);
    // From here on points are relative to this point on the plane, so that numbers are small.
    let origin = pose.translation - up * (pose.translation.dot(up) - height_m);
    let points: Vec<Vector> = points.iter().map(|&point| *pose * point - origin).collect();
    let (mut all, mut below, mut moment) = (0.0_f32, 0.0_f32, Vector::ZERO);
    for corners in triangles {
        let triangle = corners.map(|corner| points[corner as usize]);
        all += six_times([triangle[0], triangle[1], triangle[2]]);
        let cut = clipped(triangle, up);
        for edge in cut.windows(2).skip(1) {
            let part = [cut[0], edge[0], edge[1]];
            let six = six_times(part);
            below += six;
            moment += (part[0] + part[1] + part[2]) * (0.25 * six);
        }
    }
    // Both sums are negative where triangles are wound inwards.
    let part = below / all;
    if part.is_nan() || part <= 0.0 {
        return Volume::default();
    }
    // Triangles hold less than a curved shape, so only the ratio is taken from them.
    let m3 = shape.mass_properties(1.0).mass() * part.min(1.0);
    Volume { m3, centre: origin + moment / below }
}

/// Returns six times the volume of the tetrahedron from the origin.
fn six_times([a, b, c]: [Vector; 3]) -> f32 {
    a.dot(b.cross(c))
}

/// Returns the corners of the part of a triangle that is not above the plane through the origin.
fn clipped(triangle: [Vector; 3], up: Vector) -> Vec<Vector> {
    let mut corners = Vec::with_capacity(4);
    for i in 0..3 {
        let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
        let (above_a, above_b) = (a.dot(up), b.dot(up));
        if above_a <= 0.0 {
            corners.push(a);
        }
        if (above_a < 0.0 && above_b > 0.0) || (above_a > 0.0 && above_b < 0.0) {
            corners.push(a + (b - a) * (above_a / (above_a - above_b)));
        }
    }
    corners
}

/// Returns the surface of a shape that is neither a ball nor a compound, in its own space, counterclockwise
/// as seen from outside. The border of a round shape is left out, as in Rapier's masses.
fn surface(shape: &dyn Shape) -> (Vec<Vector>, Vec<[u32; 3]>) {
    match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.to_trimesh(),
        TypedShape::RoundCuboid(round) => round.inner_shape.to_trimesh(),
        TypedShape::Capsule(capsule) => capsule.to_trimesh(SIDES, SIDES / 2),
        TypedShape::Cylinder(cylinder) => cylinder.to_trimesh(SIDES),
        TypedShape::RoundCylinder(round) => round.inner_shape.to_trimesh(SIDES),
        TypedShape::Cone(cone) => cone.to_trimesh(SIDES),
        TypedShape::RoundCone(round) => round.inner_shape.to_trimesh(SIDES),
        TypedShape::ConvexPolyhedron(hull) => hull.to_trimesh(),
        TypedShape::RoundConvexPolyhedron(round) => round.inner_shape.to_trimesh(),
        TypedShape::Voxels(voxels) => voxels.to_trimesh(),
        TypedShape::TriMesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
        TypedShape::HeightField(field) => field.to_trimesh(),
        TypedShape::Triangle(triangle) => (vec![triangle.a, triangle.b, triangle.c], vec![[0, 1, 2]]),
        TypedShape::RoundTriangle(round) => {
            let triangle = &round.inner_shape;
            (vec![triangle.a, triangle.b, triangle.c], vec![[0, 1, 2]])
        }
        _ => Default::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solids() -> Vec<(&'static str, SharedShape)> {
        let corners: Vec<Vector> = [(1.0, 0.0), (-0.4, 0.9), (-0.6, -0.7)]
            .iter()
            .flat_map(|&(x, z)| [Vector::new(x, -0.5, z), Vector::new(x, 0.7, z)])
            .collect();
        let (vertices, triangles) = Cuboid::new(Vector::new(0.4, 0.5, 0.6)).to_trimesh();
        let two = [-1.0, 1.0].map(|x| (Pose::from_translation(Vector::X * x), SharedShape::ball(0.5)));
        vec![
            ("ball", SharedShape::ball(0.8)),
            ("box", SharedShape::cuboid(0.4, 0.5, 0.6)),
            ("capsule", SharedShape::capsule_y(0.5, 0.3)),
            ("cylinder", SharedShape::cylinder(0.5, 0.3)),
            ("cone", SharedShape::cone(0.5, 0.3)),
            ("hull", SharedShape::convex_hull(&corners).unwrap()),
            ("mesh", SharedShape::trimesh_with_flags(vertices, triangles, TriMeshFlags::ORIENTED).unwrap()),
            ("compound", SharedShape::compound(two.to_vec())),
            ("voxels", SharedShape::voxels(Vector::splat(0.5), &[[0, 0, 0].into(), [1, 0, 0].into()])),
        ]
    }

    /// Measures the part of a shape below the plane by counting points of a fine grid.
    fn counted(shape: &dyn Shape, pose: &Pose, up: Vector, height_m: f32) -> Volume {
        const STEP_M: f32 = 0.08;
        let around = shape.compute_aabb(pose);
        let count = ((around.maxs - around.mins) / STEP_M).ceil();
        let mut all = Volume::default();
        for i in 0..(count.x as usize * count.y as usize * count.z as usize) {
            let (x, y) = (count.x as usize, count.y as usize);
            let cell = Vector::new((i % x) as f32, (i / x % y) as f32, (i / (x * y)) as f32);
            let point = around.mins + (cell + 0.5) * STEP_M;
            if point.dot(up) <= height_m && shape.contains_point(pose, point) {
                all = all.joined(Volume { m3: STEP_M.powi(3), centre: point });
            }
        }
        all
    }

    #[test]
    fn the_part_below_a_plane_is_that_of_points_counted() {
        let pose = Pose::from_parts(
            Vector::new(3.0, 1.0, -2.0),
            Rotation::from_axis_angle(Vector::ONE.normalize(), 0.7),
        );
        let up = Vector::new(0.2, 0.9, -0.3).normalize();
        for (name, shape) in solids() {
            let middle = volume(&*shape, &pose).centre.dot(up);
            for height_m in [-9.0, -0.3, -0.05, 0.1, 0.25, 9.0].map(|off| middle + off) {
                let (found, counted) =
                    (volume_below(&*shape, &pose, up, height_m), counted(&*shape, &pose, up, height_m));
                let whole = volume(&*shape, &pose).m3;
                assert!((found.m3 - counted.m3).abs() < 0.06 * whole, "{name}: {found:?}, {counted:?}");
                let off_m = (found.centre - counted.centre).length();
                assert!(counted.m3 < 0.05 * whole || off_m < 0.05, "{name}: {found:?}, {counted:?}");
            }
        }
    }

    #[test]
    fn shadows_are_those_of_geometry() {
        let turned =
            Pose::from_parts(Vector::X, Rotation::from_axis_angle(Vector::Y, std::f32::consts::FRAC_PI_4));
        let side = |shape: SharedShape| silhouette_m2(&*shape, &turned, Vector::X);
        let is = |found: f32, exact: f32| assert!((found / exact - 1.0).abs() < 0.015, "{found}, {exact}");
        is(side(SharedShape::ball(0.5)), std::f32::consts::FRAC_PI_4);
        is(side(SharedShape::cuboid(0.5, 0.5, 0.5)), 2.0f32.sqrt());
        is(side(SharedShape::cylinder(0.5, 0.5)), 1.0);
        is(side(SharedShape::capsule_y(0.5, 0.5)), 1.0 + std::f32::consts::FRAC_PI_4);
        is(silhouette_m2(&Cylinder::new(0.5, 0.5), &turned, Vector::Y), std::f32::consts::FRAC_PI_4);
        let two = [-1.0, 1.0].map(|x| (Pose::from_translation(Vector::X * x), SharedShape::ball(0.5)));
        is(side(SharedShape::compound(two.to_vec())), 2.0 * std::f32::consts::FRAC_PI_4);
    }
}
