//! Draws boxes and shapes by lines, for renderers that draw nothing else.

use std::f32::consts::TAU;

use nalgebra::Point3;

use super::DebugShape;
use crate::protocol::WorldPose;
use crate::space::Bounds;

/// The number of lines of a circle.
const SEGMENTS: usize = 16;
/// Half of the edge of the square that stands for a plane, metres.
const PLANE_M: f32 = 10.0;

/// A function that takes the two ends of each line.
type Line<'a> = dyn FnMut([f64; 3], [f64; 3]) + 'a;

pub(super) fn of_box(bounds: &Bounds, line: &mut Line<'_>) {
    edges(|high| std::array::from_fn(|i| if high[i] { bounds.max[i] } else { bounds.min[i] }), line);
}

/// Draws the twelve edges of a box. `corner` takes, for each axis, whether the corner is at the high end.
fn edges(corner: impl Fn([bool; 3]) -> [f64; 3], line: &mut Line<'_>) {
    for axis in 0..3 {
        for (one, two) in [(false, false), (false, true), (true, false), (true, true)] {
            let end = |high: bool| {
                let mut corner = [one; 3];
                (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (high, one, two);
                corner
            };
            line(corner(end(false)), corner(end(true)));
        }
    }
}

pub(super) fn of_shape(shape: &DebugShape<'_>, pose: &WorldPose, line: &mut Line<'_>) {
    let isometry = pose.isometry();
    let place =
        |local: [f32; 3]| -> [f64; 3] { (isometry * Point3::from(local.map(f64::from))).coords.into() };
    let mut lines = |from, to| line(place(from), place(to));
    match *shape {
        DebugShape::Box { half } => {
            let corner = |high: [bool; 3]| std::array::from_fn(|i| if high[i] { half[i] } else { -half[i] });
            edges(|high| place(corner(high)), line);
        }
        DebugShape::Ball { radius } => {
            for axis in 0..3 {
                arc(1.0, |c, s| on_plane(axis, [radius * c, radius * s]), &mut lines);
            }
        }
        DebugShape::Capsule { half_height, radius } => {
            for y in [-half_height, half_height] {
                arc(1.0, |c, s| [radius * c, y, radius * s], &mut lines);
                let up = y.signum();
                arc(0.5, |c, s| [radius * c, y + up * radius * s, 0.0], &mut lines);
                arc(0.5, |c, s| [0.0, y + up * radius * s, radius * c], &mut lines);
            }
            for [x, z] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                lines([radius * x, -half_height, radius * z], [radius * x, half_height, radius * z]);
            }
        }
        DebugShape::Cylinder { half_height, radius } | DebugShape::Cone { half_height, radius } => {
            let is_cone = matches!(shape, DebugShape::Cone { .. });
            let top = if is_cone { 0.0 } else { radius };
            for (y, radius) in [(-half_height, radius), (half_height, top)] {
                if radius > 0.0 {
                    arc(1.0, |c, s| [radius * c, y, radius * s], &mut lines);
                }
            }
            for [x, z] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                lines([radius * x, -half_height, radius * z], [top * x, half_height, top * z]);
            }
        }
        DebugShape::HalfSpace => {
            for k in -2i8..=2 {
                let at = PLANE_M * f32::from(k) / 2.0;
                lines([at, 0.0, -PLANE_M], [at, 0.0, PLANE_M]);
                lines([-PLANE_M, 0.0, at], [PLANE_M, 0.0, at]);
            }
        }
        DebugShape::Mesh { vertices, triangles, .. } => {
            let corner = |index: u32| vertices.get(index as usize).copied();
            for &[a, b, c] in triangles {
                let [Some(a_at), Some(b_at), Some(c_at)] = [a, b, c].map(corner) else { continue };
                lines(a_at, b_at);
                if b != c {
                    lines(b_at, c_at);
                    lines(c_at, a_at);
                }
            }
        }
    }
}

fn on_plane(axis: usize, [u, v]: [f32; 2]) -> [f32; 3] {
    let mut point = [0.0; 3];
    (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (u, v);
    point
}

/// Draws a part, 0 to 1, of a circle from the angle 0 on. `point` takes the cosine and the sine of an angle.
fn arc(part: f32, point: impl Fn(f32, f32) -> [f32; 3], line: &mut impl FnMut([f32; 3], [f32; 3])) {
    let count = (part * SEGMENTS as f32) as usize;
    let at = |i: usize| {
        let (sin, cos) = libm::sincosf(part * TAU * i as f32 / count as f32);
        point(cos, sin)
    };
    (0..count).for_each(|i| line(at(i), at(i + 1)));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(shape: DebugShape<'_>, at: [f64; 3]) -> Vec<[[f64; 3]; 2]> {
        let mut lines = Vec::new();
        of_shape(&shape, &WorldPose::at(at), &mut |from, to| lines.push([from, to]));
        lines
    }

    #[test]
    fn a_box_has_twelve_edges_as_long_as_its_sides() {
        let edges = lines(DebugShape::Box { half: [1.0, 2.0, 3.0] }, [10.0, 0.0, 0.0]);
        assert_eq!(edges.len(), 12);
        let length = |[a, b]: &[[f64; 3]; 2]| (0..3).map(|i| (a[i] - b[i]).abs()).sum::<f64>();
        let mut lengths: Vec<_> = edges.iter().map(length).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(lengths, [[2.0; 4], [4.0; 4], [6.0; 4]].concat());
        assert!(edges.iter().flatten().all(|point| (point[0] - 10.0).abs() == 1.0));
    }

    #[test]
    fn what_is_round_lies_on_its_surface() {
        for [a, b] in lines(DebugShape::Ball { radius: 2.0 }, [0.0; 3]) {
            for point in [a, b] {
                let radius = point.iter().map(|v| v * v).sum::<f64>().sqrt();
                assert!((radius - 2.0).abs() < 1e-6, "{point:?}");
            }
        }
        let capsule = lines(DebugShape::Capsule { half_height: 1.0, radius: 0.5 }, [0.0; 3]);
        let highest = capsule.iter().flatten().map(|point| point[1]).fold(f64::MIN, f64::max);
        assert!((highest - 1.5).abs() < 1e-6, "{highest}");
        let cone = lines(DebugShape::Cone { half_height: 1.0, radius: 0.5 }, [0.0; 3]);
        assert_eq!(cone.iter().flatten().filter(|point| point[1] == 1.0).count(), 4, "the tip");
    }

    #[test]
    fn a_triangle_has_three_edges_and_a_line_is_one() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = |triangles| DebugShape::Mesh { number: 0, vertices: &vertices, triangles };
        assert_eq!(lines(mesh(&[[0, 1, 2]]), [0.0; 3]).len(), 3);
        assert_eq!(lines(mesh(&[[0, 1, 1], [2, 1, 1]]), [0.0; 3]).len(), 2);
        assert!(lines(mesh(&[[7, 8, 9]]), [0.0; 3]).is_empty(), "no such vertices");
    }
}
