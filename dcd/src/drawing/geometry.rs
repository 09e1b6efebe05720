//! Turns shapes into what is drawn: scaled copies of five primitives, planes, and meshes.

use std::collections::BTreeMap;

use rapier3d::prelude::{Pose, Rotation, SharedShape, Vector};

use crate::physics::ShapeLibrary;
use crate::protocol::{BodyRecord, Pose as PoseRecord, ShapeHash, ShapeRecord};

/// The most vertices of all meshes together. Further shapes are drawn as their bounding boxes.
const MOST_VERTICES: usize = 4 << 20;
/// The number of known shapes without a mesh at which they are forgotten.
const MOST_SIMPLE: usize = 1 << 15;
/// The numbers of geometries. The page makes those below [`FIRST_MESH`] itself; meshes have the numbers from
/// there on.
pub(crate) const BOX: u16 = 0;
pub(crate) const BALL: u16 = 1;
pub(crate) const CAPSULE: u16 = 2;
pub(crate) const CYLINDER: u16 = 3;
pub(crate) const CONE: u16 = 4;
pub(crate) const PLANE: u16 = 5;
pub(crate) const FIRST_MESH: u16 = 8;

/// A geometry at a place on a body, stretched along its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    pub(crate) geometry: u16,
    pub(crate) sensor: bool,
    pub(crate) translation: [f32; 3],
    pub(crate) rotation: [f32; 4],
    /// Half edges of a box; radius, half height and radius of a shape that is round about y; 1, 1, 1 of
    /// planes and meshes.
    pub(crate) size: [f32; 3],
}

/// Vertices and triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) vertices: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// The geometries that were needed so far, by shape.
#[derive(Default)]
pub(crate) struct Geometries {
    parts: BTreeMap<ShapeHash, Vec<Part>>,
    /// How many shapes were left when those without a mesh were last forgotten.
    kept: usize,
    meshes: u16,
    vertices: usize,
    /// The meshes that nobody has taken yet.
    fresh: Vec<Mesh>,
}

impl Geometries {
    /// Takes the meshes that were made since the last call; they are numbered in the order in which they are taken.
    pub(crate) fn take_fresh(&mut self) -> Vec<Mesh> {
        std::mem::take(&mut self.fresh)
    }

    /// Returns the parts of a body; shapes come from `find`.
    pub(crate) fn of_body(
        &mut self,
        body: &BodyRecord,
        find: impl Fn(ShapeHash) -> Option<ShapeRecord>,
    ) -> Vec<Part> {
        let mut all = Vec::new();
        for collider in body.traits.colliders.iter().filter(|collider| collider.enabled) {
            let place = pose(&collider.pose);
            for part in self.of_shape(collider.shape, &find) {
                all.push(Part { sensor: collider.sensor, ..moved(&place, part) });
            }
        }
        all
    }

    fn of_shape(&mut self, hash: ShapeHash, find: &impl Fn(ShapeHash) -> Option<ShapeRecord>) -> Vec<Part> {
        if let Some(parts) = self.parts.get(&hash) {
            return parts.clone();
        }
        let Some(record) = find(hash) else { return Vec::new() };
        let parts = match &record {
            ShapeRecord::Compound(children) => children
                .iter()
                .flat_map(|(place, child)| {
                    let place = pose(place);
                    // A compound within a compound is not a valid shape.
                    let parts = find(*child)
                        .filter(|child| !child.is_compound())
                        .map(|child| self.simple(child))
                        .unwrap_or_default();
                    parts.into_iter().map(move |part| moved(&place, part))
                })
                .collect(),
            _ => self.simple(record),
        };
        self.forget_simple();
        self.parts.insert(hash, parts.clone());
        parts
    }

    /// Forgets the shapes without a mesh if there are many: in a world that runs for long, all their bodies
    /// may be gone. Shapes with a mesh stay known, as meshes keep their numbers, of which there are few.
    fn forget_simple(&mut self) {
        if self.parts.len() - self.kept >= MOST_SIMPLE {
            self.parts.retain(|_, parts| parts.iter().any(|part| part.geometry >= FIRST_MESH));
            self.kept = self.parts.len();
        }
    }

    fn simple(&mut self, record: ShapeRecord) -> Vec<Part> {
        let round = |geometry, radius: f32, half: f32| vec![upright(geometry, [radius, half, radius])];
        match record {
            ShapeRecord::Ball(radius) => vec![upright(BALL, [radius; 3])],
            ShapeRecord::Cuboid(half) => vec![upright(BOX, half)],
            ShapeRecord::RoundCuboid(half, border) => vec![upright(BOX, half.map(|half| half + border))],
            ShapeRecord::Cylinder(half, radius) => round(CYLINDER, radius, half),
            ShapeRecord::RoundCylinder(half, radius, border) => {
                round(CYLINDER, radius + border, half + border)
            }
            ShapeRecord::Cone(half, radius) => round(CONE, radius, half),
            ShapeRecord::RoundCone(half, radius, border) => round(CONE, radius + border, half + border),
            ShapeRecord::Capsule(a, b, radius) => {
                let [a, b] = [a, b].map(Vector::from_array);
                let half = 0.5 * (b - a).length();
                let axis = (b - a).try_normalize().unwrap_or(Vector::Y);
                vec![Part {
                    translation: (0.5 * (a + b)).to_array(),
                    rotation: Rotation::from_rotation_arc(Vector::Y, axis).to_array(),
                    ..upright(CAPSULE, [radius, half, radius])
                }]
            }
            ShapeRecord::HalfSpace(normal) => {
                let normal = Vector::from_array(normal).try_normalize().unwrap_or(Vector::Y);
                let rotation = Rotation::from_rotation_arc(Vector::Y, normal).to_array();
                vec![Part { rotation, ..upright(PLANE, [1.0; 3]) }]
            }
            ShapeRecord::ConvexPolyhedron(vertices, triangles)
            | ShapeRecord::RoundConvexPolyhedron(vertices, triangles, _)
            | ShapeRecord::TriMesh(vertices, triangles, _) => self.mesh(Mesh { vertices, triangles }),
            ShapeRecord::Triangle(corners) | ShapeRecord::RoundTriangle(corners, _) => {
                self.mesh(Mesh { vertices: corners.to_vec(), triangles: vec![[0, 1, 2]] })
            }
            // Drawn as lines: two of the three corners of each triangle are the same.
            ShapeRecord::Segment(ends) => {
                self.mesh(Mesh { vertices: ends.to_vec(), triangles: vec![[0, 1, 1]] })
            }
            ShapeRecord::Polyline(vertices, edges) => {
                let triangles = edges.into_iter().map(|[a, b]| [a, b, b]).collect();
                self.mesh(Mesh { vertices, triangles })
            }
            record @ (ShapeRecord::HeightField(..) | ShapeRecord::Voxels(..)) => {
                let mut library = ShapeLibrary::default();
                let built = library.add(record).and_then(|hash| library.shape(hash));
                built.ok().as_ref().map(surface).map(|mesh| self.mesh(mesh)).unwrap_or_default()
            }
            ShapeRecord::Compound(_) => Vec::new(),
        }
    }

    fn mesh(&mut self, mesh: Mesh) -> Vec<Part> {
        if self.vertices + mesh.vertices.len() > MOST_VERTICES || self.meshes >= u16::MAX - FIRST_MESH {
            return vec![bounding_box(&mesh.vertices)];
        }
        self.vertices += mesh.vertices.len();
        self.meshes += 1;
        self.fresh.push(mesh);
        vec![upright(FIRST_MESH + self.meshes - 1, [1.0; 3])]
    }
}

fn surface(shape: &SharedShape) -> Mesh {
    let (vertices, triangles) = match (shape.as_heightfield(), shape.as_voxels()) {
        (Some(field), _) => field.to_trimesh(),
        (_, Some(voxels)) => voxels.to_trimesh(),
        _ => (Vec::new(), Vec::new()),
    };
    Mesh { vertices: vertices.into_iter().map(|vertex| vertex.to_array()).collect(), triangles }
}

fn bounding_box(vertices: &[[f32; 3]]) -> Part {
    let (mut min, mut max) = ([f32::MAX; 3], [f32::MIN; 3]);
    for vertex in vertices {
        for i in 0..3 {
            (min[i], max[i]) = (min[i].min(vertex[i]), max[i].max(vertex[i]));
        }
    }
    let half = std::array::from_fn(|i| 0.5 * (max[i] - min[i]));
    Part { translation: std::array::from_fn(|i| 0.5 * (max[i] + min[i])), ..upright(BOX, half) }
}

fn upright(geometry: u16, size: [f32; 3]) -> Part {
    Part { geometry, sensor: false, translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], size }
}

fn pose(record: &PoseRecord) -> Pose {
    Pose::from_parts(Vector::from_array(record.translation), Rotation::from_array(record.rotation))
}

fn moved(by: &Pose, part: Part) -> Part {
    let place = *by * pose(&PoseRecord { translation: part.translation, rotation: part.rotation });
    Part { translation: place.translation.to_array(), rotation: place.rotation.to_array(), ..part }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(record: ShapeRecord) -> (Vec<Part>, Vec<Mesh>) {
        let mut geometries = Geometries::default();
        let parts = geometries.simple(record);
        (parts, geometries.take_fresh())
    }

    #[test]
    fn a_capsule_that_lies_is_turned() {
        let (parts, _) = parts(ShapeRecord::Capsule([-1.0, 0.0, 0.0], [3.0, 0.0, 0.0], 0.5));
        let [part] = parts[..] else { panic!("{parts:?}") };
        assert_eq!((part.geometry, part.size, part.translation), (CAPSULE, [0.5, 2.0, 0.5], [1.0, 0.0, 0.0]));
        let along = Rotation::from_array(part.rotation) * Vector::Y;
        assert!((along - Vector::X).length() < 1e-6, "{along:?}");
    }

    #[test]
    fn voxels_and_height_fields_are_drawn_by_their_surfaces() {
        let (parts, meshes) = parts(ShapeRecord::Voxels([1.0; 3], vec![[0, 0, 0], [1, 0, 0]]));
        assert_eq!(parts[0].geometry, FIRST_MESH);
        assert!(!meshes[0].triangles.is_empty());
        let heights = vec![0.0, 1.0, 2.0, 3.0];
        let (_, meshes) =
            self::parts(ShapeRecord::HeightField(heights, 2, 2, [4.0, 1.0, 4.0], 0, Vec::new()));
        assert_eq!(meshes[0].triangles.len(), 2);
    }

    #[test]
    fn meshes_beyond_the_limit_are_drawn_as_boxes() {
        let mut geometries = Geometries { vertices: MOST_VERTICES - 2, ..Geometries::default() };
        let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 4.0, 2.0]];
        let parts = geometries.simple(ShapeRecord::Triangle(corners));
        assert_eq!(
            (parts[0].geometry, parts[0].size, parts[0].translation),
            (BOX, [1.0, 2.0, 1.0], [1.0, 2.0, 1.0])
        );
        assert!(geometries.take_fresh().is_empty());
    }

    #[test]
    fn of_shapes_without_end_those_alone_stay_known_that_have_a_mesh() {
        let mut geometries = Geometries::default();
        let name = |number: u32| {
            let mut name = [0; 16];
            name[..4].copy_from_slice(&number.to_le_bytes());
            ShapeHash(name)
        };
        let sheet = ShapeRecord::Triangle([[0.0; 3], [2.0, 0.0, 0.0], [0.0, 4.0, 2.0]]);
        let drawn = |geometries: &mut Geometries| geometries.of_shape(name(0), &|_| Some(sheet.clone()));
        let mesh = drawn(&mut geometries);
        assert_eq!(geometries.take_fresh().len(), 1);
        for number in 1..=2 * MOST_SIMPLE as u32 {
            let ball = geometries.of_shape(name(number), &|_| Some(ShapeRecord::Ball(number as f32)));
            assert_eq!(ball[0].size[0], number as f32);
            assert!(geometries.parts.len() <= MOST_SIMPLE + 1);
        }
        assert_eq!((drawn(&mut geometries), geometries.take_fresh().len()), (mesh, 0));
    }
}
