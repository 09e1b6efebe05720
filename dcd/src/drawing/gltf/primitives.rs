//! Makes the vertices of boxes, planes, and shapes that are round about y.

use std::f32::consts::{FRAC_PI_2, TAU};

/// The corners around a round shape, and those from the pole of a ball to its equator.
const AROUND: usize = 24;
const RINGS: usize = 6;

/// Vertices with their normals, and triangles.
#[derive(Default)]
pub(super) struct Solid {
    pub(super) vertices: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Returns a cube of half edges 1.
pub(super) fn cube() -> Solid {
    let mut solid = Solid::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (mut normal, mut u) = ([0.0; 3], [0.0; 3]);
            (normal[axis], u[(axis + 1) % 3]) = (sign, 1.0);
            solid.square(normal, u);
        }
    }
    solid
}

/// Returns a square of this half edge in the plane y = 0.
pub(super) fn plane(half: f32) -> Solid {
    let mut solid = Solid::default();
    solid.square([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    for vertex in &mut solid.vertices {
        *vertex = [half * vertex[0], 0.0, half * vertex[2]];
    }
    solid
}

/// Returns a ball of radius 1.
pub(super) fn ball() -> Solid {
    capsule(1.0, 0.0)
}

/// Returns a capsule along y.
pub(super) fn capsule(radius: f32, half_height: f32) -> Solid {
    let rings = (0..=2 * RINGS + 1).map(|ring| {
        // The equator comes twice: at the lower end and at the upper one.
        let (step, centre) = if ring <= RINGS { (ring, -half_height) } else { (ring - 1, half_height) };
        let (sin, cos) = libm::sincosf(FRAC_PI_2 * (step as f32 / RINGS as f32 - 1.0));
        ([radius * cos, centre + radius * sin], [cos, sin])
    });
    turned(&rings.collect::<Vec<_>>())
}

/// Returns a cylinder along y of radius and half height 1.
pub(super) fn cylinder() -> Solid {
    let (down, out, up) = ([0.0, -1.0], [1.0, 0.0], [0.0, 1.0]);
    turned(&[
        ([0.0, -1.0], down),
        ([1.0, -1.0], down),
        ([1.0, -1.0], out),
        ([1.0, 1.0], out),
        ([1.0, 1.0], up),
        ([0.0, 1.0], up),
    ])
}

/// Returns a cone of radius and half height 1 whose tip is at +y.
pub(super) fn cone() -> Solid {
    let slope = [2.0 / libm::sqrtf(5.0), 1.0 / libm::sqrtf(5.0)];
    let down = [0.0, -1.0];
    turned(&[([0.0, -1.0], down), ([1.0, -1.0], down), ([1.0, -1.0], slope), ([0.0, 1.0], slope)])
}

/// Revolves a profile about y. It has the radius and the height of each ring from below, with the normal in
/// the same plane.
fn turned(profile: &[([f32; 2], [f32; 2])]) -> Solid {
    let mut solid = Solid::default();
    for &([radius, y], [out, up]) in profile {
        for step in 0..=AROUND {
            let (sin, cos) = libm::sincosf(TAU * step as f32 / AROUND as f32);
            solid.vertices.push([radius * cos, y, radius * sin]);
            solid.normals.push([out * cos, up, out * sin]);
        }
    }
    let ring = AROUND + 1;
    for low in 0..profile.len() - 1 {
        for step in 0..AROUND {
            let [a, b] = [low * ring + step, low * ring + step + 1].map(|at| at as u32);
            let [c, d] = [a, b].map(|at| at + ring as u32);
            // Triangles have no area at a pole, and between two equal rings with unlike normals.
            solid.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    let area = |triangle: &[u32; 3]| {
        let corners = triangle.map(|at| solid.vertices[at as usize]);
        let far = |a: [f32; 3], b: [f32; 3]| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-6);
        far(corners[0], corners[1]) && far(corners[1], corners[2]) && far(corners[2], corners[0])
    };
    let triangles = solid.triangles.iter().copied().filter(area).collect();
    Solid { triangles, ..solid }
}

impl Solid {
    /// Adds the square of half edges 1 at the end of a normal; `u` is another axis.
    fn square(&mut self, normal: [f32; 3], u: [f32; 3]) {
        let first = self.vertices.len() as u32;
        // v = normal × u, so that u, v, normal are right-handed.
        let v: [f32; 3] = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            normal[j] * u[k] - normal[k] * u[j]
        });
        for (s, t) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            self.vertices.push(std::array::from_fn(|i| normal[i] + s * u[i] + t * v[i]));
            self.normals.push(normal);
        }
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_counterclockwise_from_outside_and_normals_point_there() {
        let solids = [cube(), ball(), capsule(0.5, 2.0), cylinder(), cone()];
        let exact = [8.0, TAU * 2.0 / 3.0, TAU * 7.0 / 12.0, TAU, TAU / 3.0];
        for (at, (solid, exact)) in solids.iter().zip(exact).enumerate() {
            assert_eq!(solid.vertices.len(), solid.normals.len());
            for normal in &solid.normals {
                let length: f32 = normal.iter().map(|v| v * v).sum();
                assert!((length - 1.0).abs() < 1e-5, "{normal:?}");
            }
            let mut volume = 0.0;
            for triangle in &solid.triangles {
                let [a, b, c] = triangle.map(|at| solid.vertices[at as usize]);
                let [u, v]: [[f32; 3]; 2] = [b, c].map(|p| std::array::from_fn(|i| p[i] - a[i]));
                let cross: [f32; 3] = std::array::from_fn(|i| {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    u[j] * v[k] - u[k] * v[j]
                });
                let out: f32 = (0..3).map(|i| cross[i] * a[i]).sum();
                assert!(out > -1e-6, "solid {at}: {a:?} {b:?} {c:?}");
                volume += out / 6.0;
            }
            assert!((volume / exact - 1.0).abs() < 0.06, "solid {at}: {volume} m³ for {exact}");
        }
    }
}
