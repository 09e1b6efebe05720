//! Builds convex hulls that last: what is recorded of one builds the same one again, in every process.
//!
//! Parry merges triangles whose normals differ by less than 1.5 degrees. Where many do, what it merges is no
//! polygon any more: its surface has holes, and it would be another one each time that it is built.

use std::collections::{BTreeMap, BTreeSet};

use parry3d::shape::ConvexPolyhedron;
use parry3d::transformation::try_convex_hull;
use rapier3d::prelude::{SharedShape, Vector};

use super::{ShapeError, is_closed};

/// A closed surface: its points, and its triangles, counter-clockwise seen from outside.
type Surface = (Vec<Vector>, Vec<[u32; 3]>);

/// The least share of the volume of its points that a hull has.
const SHARE: f64 = 0.99;

/// Returns the convex hull of points, in a form that a world can hold: Parry's own hull may have holes.
/// `None` if the points span no volume.
///
/// ```
/// # use dcd::physics::convex_hull;
/// # use rapier3d::prelude::*;
/// let corners = [Vector::ZERO, Vector::X, Vector::Y, Vector::Z];
/// assert!(convex_hull(&corners).is_some());
/// assert!(convex_hull(&corners[..2]).is_none());
/// ```
pub fn convex_hull(points: &[Vector]) -> Option<SharedShape> {
    if points.len() < 4 {
        return None;
    }
    // What is too thin is refused for that when it is recorded.
    around(points).map(SharedShape::new).or_else(|| SharedShape::convex_hull(points))
}

/// Returns the surface to be recorded of a hull. The hull that is built of it has this surface.
pub(super) fn lasting(hull: &ConvexPolyhedron) -> Result<Surface, ShapeError> {
    let (points, triangles) = hull.to_trimesh();
    let whole = surface(&points).map_or(0.0, |(points, triangles)| volume(&points, &triangles));
    if let Some(hull) = settled(&points, &triangles, whole) {
        return Ok(hull.to_trimesh());
    }
    if is_surface(&triangles) && volume(&points, &triangles) >= SHARE * whole {
        return Ok((points, triangles));
    }
    around(&points).map(|hull| hull.to_trimesh()).ok_or(ShapeError::Points)
}

/// Returns a hull that has exactly this surface.
pub(super) fn exact(points: &[Vector], triangles: &[[u32; 3]]) -> Option<ConvexPolyhedron> {
    let merged = ConvexPolyhedron::from_convex_mesh(points.to_vec(), triangles);
    merged.filter(|hull| hull.to_trimesh().1 == triangles).or_else(|| faceted(points, triangles))
}

fn around(points: &[Vector]) -> Option<ConvexPolyhedron> {
    let (points, triangles) = surface(points).or_else(|| surface(&spread(points)))?;
    let whole = volume(&points, &triangles);
    settled(&points, &triangles, whole)
        .or_else(|| smoothed(&points, &triangles, whole))
        .or_else(|| faceted(&points, &triangles))
}

/// Returns the surface of the hull of points, if Parry finds one and it has a volume.
fn surface(points: &[Vector]) -> Option<Surface> {
    let (points, triangles) = try_convex_hull(points).ok()?;
    let reach = points.iter().map(|&point| (point - points[0]).abs().max_element()).fold(0.0, f32::max);
    let is_solid = is_surface(&triangles) && volume(&points, &triangles) > 1e-6 * f64::from(reach).powi(3);
    is_solid.then_some((points, triangles))
}

/// Returns points of which no two are in one cell of 4096 along the whole.
fn spread(points: &[Vector]) -> Vec<Vector> {
    let lowest = points.iter().copied().fold(Vector::INFINITY, Vector::min);
    let highest = points.iter().copied().fold(Vector::NEG_INFINITY, Vector::max);
    let cell = (highest - lowest).max_element() / 4096.0;
    let place = |point: Vector| ((point - lowest) / cell).to_array().map(|along| along as u32);
    let cells: BTreeMap<_, _> = points.iter().map(|&point| (place(point), point)).collect();
    cells.into_values().collect()
}

/// Returns the hull with its faces as Parry merges them, if they are polygons that Parry merges likewise again,
/// and if little of the `whole` volume is lost.
fn settled(points: &[Vector], triangles: &[[u32; 3]], whole: f64) -> Option<ConvexPolyhedron> {
    /// The most times that faces are merged anew. They mostly stay as they are.
    const TRIES: usize = 4;
    let mut triangles = triangles.to_vec();
    for _ in 0..TRIES {
        if !is_surface(&triangles) {
            return None;
        }
        let hull = ConvexPolyhedron::from_convex_mesh(points.to_vec(), &triangles)?;
        let merged = hull.to_trimesh().1;
        if merged == triangles {
            return (volume(points, &triangles) >= SHARE * whole).then_some(hull);
        }
        triangles = merged;
    }
    None
}

/// Returns the hull without the corners at which merged faces are no polygons, if little of the `whole` volume
/// is lost.
fn smoothed(points: &[Vector], triangles: &[[u32; 3]], whole: f64) -> Option<ConvexPolyhedron> {
    /// The most times that corners are taken away.
    const ROUNDS: usize = 16;
    let (mut points, mut triangles) = (points.to_vec(), triangles.to_vec());
    for _ in 0..ROUNDS {
        let flat = flat_corners(&points, &triangles);
        if flat.is_empty() {
            return None;
        }
        let left = (0_u32..).zip(&points).filter(|(corner, _)| !flat.contains(corner));
        let left: Vec<_> = left.map(|(_, &point)| point).collect();
        (points, triangles) = surface(&left)?;
        if volume(&points, &triangles) < SHARE * whole {
            return None;
        }
        if let Some(hull) = settled(&points, &triangles, whole) {
            return Some(hull);
        }
    }
    None
}

/// Returns corners, no two of which are neighbours, at which merged faces leave one edge, which ends there; if
/// there is none, those at which they leave fewer than three.
fn flat_corners(points: &[Vector], triangles: &[[u32; 3]]) -> BTreeSet<u32> {
    let normals: Vec<_> = triangles.iter().map(|&triangle| normal(points, triangle)).collect();
    let sides = triangles
        .iter()
        .enumerate()
        .flat_map(|(index, &[a, b, c])| [(a, b), (b, c), (c, a)].map(|side| (side, normals[index])));
    let sides: BTreeMap<(u32, u32), Vector> = sides.collect();
    // As Parry does.
    let are_merged = |one: Vector, other: Vector| one.dot(other) > 1.0 - f32::EPSILON.sqrt();
    let mut edges = vec![0; points.len()];
    for (&(from, to), &normal) in &sides {
        if sides.get(&(to, from)).is_some_and(|&other| !are_merged(normal, other)) {
            edges[from as usize] += 1;
        }
    }
    let with = |fits: fn(i32) -> bool| {
        let (mut found, mut near) = (BTreeSet::new(), BTreeSet::new());
        for (corner, &count) in (0_u32..).zip(&edges) {
            if fits(count) && !near.contains(&corner) {
                near.extend(sides.range((corner, 0)..=(corner, u32::MAX)).map(|(&(_, to), _)| to));
                found.insert(corner);
            }
        }
        found
    };
    let ends = with(|count| count == 1);
    if ends.is_empty() { with(|count| count < 3) } else { ends }
}

/// Returns the hull with each triangle as a face of its own.
fn faceted(points: &[Vector], triangles: &[[u32; 3]]) -> Option<ConvexPolyhedron> {
    let corners = triangles.as_flattened();
    let (mut edges, mut known, mut edge_of_side) = (Vec::new(), BTreeMap::new(), Vec::new());
    for (face, &[a, b, c]) in (0_u32..).zip(triangles) {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let edge: usize = *known.entry((from.min(to), from.max(to))).or_insert(edges.len());
            if edge == edges.len() {
                let along = (points[to as usize] - points[from as usize]).normalize_or(Vector::X);
                edges.push(([from, to], [face, face], along, false));
            }
            edges[edge].1[1] = face;
            edge_of_side.push(edge as u32);
        }
    }
    let faces = (0_u32..).zip(triangles).map(|(face, &triangle)| (3 * face, 3_u32, normal(points, triangle)));
    let faces: Vec<_> = faces.collect();
    let mut sides_of = vec![Vec::new(); points.len()];
    for (side, &corner) in (0_u32..).zip(corners) {
        sides_of[corner as usize].push(side);
    }
    let mut first = 0_u32;
    let vertices = sides_of.iter().map(|sides| {
        let vertex = (first, sides.len() as u32);
        first += vertex.1;
        vertex
    });
    let vertices: Vec<_> = vertices.collect();
    let sides: Vec<_> = sides_of.into_iter().flatten().collect();
    let faces_of_vertices: Vec<_> = sides.iter().map(|side| side / 3).collect();
    let edges_of_vertices: Vec<_> = sides.iter().map(|&side| edge_of_side[side as usize]).collect();
    // Parry has no constructor that leaves faces apart. It reads its fields in this order.
    let around = (faces_of_vertices, edges_of_vertices, edge_of_side, corners);
    let written = (points, vertices, faces, edges, around);
    let bytes = bincode::serde::encode_to_vec(written, bincode::config::standard()).ok()?;
    let (hull, _) = bincode::serde::decode_from_slice(&bytes, bincode::config::standard()).ok()?;
    Some(hull)
}

fn is_surface(triangles: &[[u32; 3]]) -> bool {
    !triangles.is_empty() && is_closed(triangles)
}

fn normal(points: &[Vector], triangle: [u32; 3]) -> Vector {
    let [a, b, c] = triangle.map(|corner| points[corner as usize]);
    (b - a).cross(c - a).normalize_or_zero()
}

fn volume(points: &[Vector], triangles: &[[u32; 3]]) -> f64 {
    let corner = |corner: u32| points[corner as usize].as_dvec3() - points[0].as_dvec3();
    let sixfold = |&[a, b, c]: &[u32; 3]| corner(a).dot(corner(b).cross(corner(c)));
    triangles.iter().map(sixfold).sum::<f64>() / 6.0
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::super::ShapeLibrary;
    use super::*;

    const KINDS: [&str; 7] = ["cube", "ball", "ellipsoid", "flat box", "sheet", "rod", "grid"];

    fn point(dice: &mut ChaCha8Rng) -> Vector {
        let mut any = || (dice.next_u32() >> 8) as f32 / (1 << 23) as f32 - 1.0;
        Vector::new(any(), any(), any())
    }

    fn outward(dice: &mut ChaCha8Rng) -> Vector {
        loop {
            let point = point(dice);
            if (0.01..1.0).contains(&point.length_squared()) {
                return point.normalize();
            }
        }
    }

    fn cloud(kind: &str, count: usize, dice: &mut ChaCha8Rng) -> Vec<Vector> {
        (0..count).map(|_| shaped(kind, dice)).collect()
    }

    fn shaped(kind: &str, dice: &mut ChaCha8Rng) -> Vector {
        match kind {
            "ball" => outward(dice),
            "ellipsoid" => outward(dice) * Vector::new(2.0, 1.0, 0.5),
            "flat box" => point(dice) * Vector::new(1.0, 0.1, 1.0),
            "sheet" => point(dice) * Vector::new(1.0, 0.01, 1.0),
            "rod" => point(dice) * Vector::new(0.1, 0.1, 1.0),
            "grid" => (point(dice) * 2.0).round() * 0.3,
            _ => point(dice),
        }
    }

    /// Asserts that a hull has as much volume as the points, and reaches as far.
    fn check(shape: &SharedShape, points: &[Vector], what: &str) {
        let hull = shape.as_convex_polyhedron().unwrap();
        let (corners, triangles) = hull.to_trimesh();
        assert!(is_surface(&triangles), "{what}");
        let (all, sides) = surface(points).or_else(|| surface(&spread(points))).unwrap();
        let share = volume(&corners, &triangles) / volume(&all, &sides);
        assert!((SHARE..1.01).contains(&share), "{what}: {share} of the volume");
        let reach = |points: &[Vector], way: Vector| {
            points.iter().map(|point| point.dot(way)).fold(f32::NEG_INFINITY, f32::max)
        };
        for way in [Vector::X, Vector::Y, Vector::Z, Vector::new(0.6, -0.8, 0.0), Vector::new(0.0, 0.8, 0.6)]
        {
            for way in [way, -way] {
                let short = reach(points, way) - reach(&corners, way);
                assert!(short.abs() < 0.05, "{what}: {short} m short along {way}");
            }
        }
    }

    #[test]
    fn every_cloud_that_spans_a_volume_has_a_hull_that_is_built_again_as_it_was() {
        let mut dice = ChaCha8Rng::seed_from_u64(4);
        for kind in KINDS {
            for (count, clouds) in [(8, 100), (20, 60), (50, 40), (200, 30)] {
                for index in 0..clouds {
                    let points = cloud(kind, count, &mut dice);
                    // Few points of a grid may lie in a plane.
                    if kind == "grid" && surface(&points).is_none() {
                        continue;
                    }
                    let what = format!("{kind} of {count}, {index}");
                    let made = convex_hull(&points).unwrap();
                    let mut here = ShapeLibrary::default();
                    let name = here.intern(&made).unwrap_or_else(|error| panic!("{what}: {error}"));
                    let held = here.shape(name).unwrap();
                    check(&held, &points, &what);
                    let mut there = ShapeLibrary::default();
                    assert_eq!(there.add(here.record_of(name).unwrap().clone()), Ok(name), "{what}");
                    let received = there.shape(name).unwrap();
                    assert_eq!(ShapeLibrary::default().intern(&received), Ok(name), "{what}");
                    assert_eq!(received.as_convex_polyhedron(), held.as_convex_polyhedron(), "{what}");
                    let bare =
                        SharedShape::convex_hull(&points).map(|hull| ShapeLibrary::default().intern(&hull));
                    assert!(bare.is_none_or(|bare| bare.is_ok()), "{what}: as Parry makes it");
                }
            }
        }
    }

    #[test]
    fn a_scaled_or_rounded_hull_is_built_again_as_it_was() {
        let mut dice = ChaCha8Rng::seed_from_u64(5);
        for index in 0..100 {
            let points = cloud("cube", 50, &mut dice);
            let hull = convex_hull(&points).unwrap().as_convex_polyhedron().unwrap().clone();
            let scaled = hull.clone().scaled(Vector::new(1.0, 3.0, 0.2)).unwrap();
            let round = parry3d::shape::RoundShape { inner_shape: hull, border_radius: 0.1 };
            for shape in [SharedShape::new(scaled), SharedShape::new(round)] {
                let mut library = ShapeLibrary::default();
                let name = library.intern(&shape).unwrap_or_else(|error| panic!("{index}: {error}"));
                let held = library.shape(name).unwrap();
                assert_eq!(ShapeLibrary::default().intern(&held), Ok(name), "{index}");
            }
        }
    }

    #[test]
    fn a_hull_whose_faces_are_left_apart_is_as_parry_builds_it_where_none_are_merged() {
        let corners = [Vector::ZERO, Vector::X, Vector::Y, Vector::Z];
        let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let merged = ConvexPolyhedron::from_convex_mesh(corners.to_vec(), &triangles);
        assert_eq!(faceted(&corners, &triangles), merged);
    }
}
