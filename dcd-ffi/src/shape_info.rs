//! Reads what shapes are: their kinds, sizes, vertices, triangles and heights.

use std::collections::BTreeMap;

use rapier3d::prelude::{Pose, Rotation, SharedShape, TypedShape, Vector};

use crate::guard::guard;
use crate::ids::{DcdShapeId, DcdWorld};
use crate::pointer::{Out, Room, Sized32};
use crate::registry::ask;
use crate::shape;
use crate::status::DcdStatus;
use crate::types::DcdFrame;

/// Kind of a shape. Later versions may add kinds: read shapes of unknown kinds by their vertices and triangles.
pub type DcdShapeKind = u32;

/// A box; `size` is half of its edges.
pub const DCD_SHAPE_BOX: DcdShapeKind = 0;
/// A ball; size[0] is its radius.
pub const DCD_SHAPE_SPHERE: DcdShapeKind = 1;
/// A capsule along y; size[0] is its radius, size[1] half of its length without the caps.
pub const DCD_SHAPE_CAPSULE: DcdShapeKind = 2;
/// A cylinder along y; size[0] is its radius, size[1] half of its height.
pub const DCD_SHAPE_CYLINDER: DcdShapeKind = 3;
/// A cone whose tip is at +y; size[0] is the radius of its base, size[1] half of its height.
pub const DCD_SHAPE_CONE: DcdShapeKind = 4;
/// A convex hull: vertices and triangles.
pub const DCD_SHAPE_HULL: DcdShapeKind = 5;
/// A mesh: vertices and triangles.
pub const DCD_SHAPE_MESH: DcdShapeKind = 6;
/// Terrain: `rows` x `columns` heights, stretched by `size`, and the vertices and triangles of its surface.
pub const DCD_SHAPE_HEIGHTFIELD: DcdShapeKind = 7;
/// A compound: several shapes, `parts` of them.
pub const DCD_SHAPE_COMPOUND: DcdShapeKind = 8;
/// A half-space: all below the plane y = 0.
pub const DCD_SHAPE_HALF_SPACE: DcdShapeKind = 9;
/// Lines between vertices, as triangles of which two corners are the same.
pub const DCD_SHAPE_LINES: DcdShapeKind = 10;
/// Voxels: filled cells of a grid, with edges `size`, and the vertices and triangles of their surface.
pub const DCD_SHAPE_VOXELS: DcdShapeKind = 11;

/// Kind and measures of a shape. Start from DCD_SHAPE_INFO_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdShapeInfo {
    /// Size of this struct: sizeof(DcdShapeInfo).
    pub struct_size: u32,
    /// Kind: DCD_SHAPE_BOX and so on.
    pub kind: DcdShapeKind,
    /// Sizes by kind, metres; 0 for a kind that has none.
    pub size: [f32; 3],
    /// Border by which the shape is rounded, metres: it reaches so far beyond its size or its vertices.
    pub border: f32,
    /// Pose of all this, from the shape's origin. It is elsewhere only for capsules and half-spaces that lie otherwise.
    pub frame: DcdFrame,
    /// Number of vertices that dcd_shape_vertices reads; 0 for boxes, balls, capsules, cylinders, cones, half-spaces and compounds.
    pub vertex_count: u32,
    /// Number of triangles that dcd_shape_triangles reads.
    pub triangle_count: u32,
    /// Number of heights along z, for terrain.
    pub rows: u32,
    /// Number of heights along x, for terrain.
    pub columns: u32,
    /// Number of shapes that dcd_shape_part finds, for a compound.
    pub parts: u32,
    /// Reserved; always 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdShapeInfo {
    const NAME: &'static str = "DcdShapeInfo";
}
/// Reads the kind and measures of a shape that the program made or found.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_info(
    world: DcdWorld,
    shape: DcdShapeId,
    out: *mut DcdShapeInfo,
) -> DcdStatus {
    guard("dcd_shape_info", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            out.write(info(shape::find(world, shape)?));
            Ok(())
        })
    })
}

/// Reads the vertices of a hull, mesh, terrain, lines or voxels into `xyz`, which has 3 x `cap` floats, and their number into
/// `count`. With `cap` 0, `xyz` may be null, to ask for the number.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_SMALL_BUFFER (`count` is written all the same, `xyz` is not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_vertices(
    world: DcdWorld,
    shape: DcdShapeId,
    xyz: *mut f32,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_shape_vertices", || {
        // SAFETY: three floats have the alignment of one; the caller vouches for `cap` of them and for `count`.
        let out = unsafe { Room::new(xyz.cast::<[f32; 3]>(), cap, count, ["xyz", "count"])? };
        ask(world, |world| out.fill(surface(shape::find(world, shape)?).0.into_iter()))
    })
}

/// Reads the triangles of a hull, mesh, terrain, lines or voxels into `indices`, which has room for 3 x `cap` indices of vertices,
/// and their number into `count`. Triangles are counterclockwise seen from outside. With `cap` 0, `indices` may be null, to ask for
/// the number.
///
/// Errors: as dcd_shape_vertices.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_triangles(
    world: DcdWorld,
    shape: DcdShapeId,
    indices: *mut u32,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_shape_triangles", || {
        // SAFETY: as for vertices.
        let out = unsafe { Room::new(indices.cast::<[u32; 3]>(), cap, count, ["indices", "count"])? };
        ask(world, |world| out.fill(surface(shape::find(world, shape)?).1.into_iter()))
    })
}

/// Reads the heights of terrain into `heights`, which has `cap` entries, as dcd_shape_heightfield takes them, and their number into
/// `count`: 0 for other shapes. With `cap` 0, `heights` may be null, to ask for the number.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_SMALL_BUFFER (`count` is written all the same, `heights` is
/// not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_heights(
    world: DcdWorld,
    shape: DcdShapeId,
    heights: *mut f32,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_shape_heights", || {
        // SAFETY: the caller vouches for `cap` heights and for `count`.
        let out = unsafe { Room::new(heights, cap, count, ["heights", "count"])? };
        ask(world, |world| {
            let field = shape::find(world, shape)?.as_heightfield();
            out.fill(field.map_or(&[][..], |field| field.heights().data()).iter().copied())
        })
    })
}

pub(crate) fn frame_of(pose: &Pose) -> DcdFrame {
    DcdFrame { p: pose.translation.to_array(), q: pose.rotation.to_array() }
}

fn info(shape: &SharedShape) -> DcdShapeInfo {
    let (kind, size, border) = kind_of(shape);
    let mut info = DcdShapeInfo {
        struct_size: size_of::<DcdShapeInfo>() as u32,
        kind,
        size,
        border,
        frame: frame_of(&Pose::IDENTITY),
        vertex_count: 0,
        triangle_count: 0,
        rows: 0,
        columns: 0,
        parts: shape.as_compound().map_or(0, |compound| compound.shapes().len() as u32),
        reserved: 0,
    };
    let turned =
        |along: Vector| Rotation::from_rotation_arc(Vector::Y, along.try_normalize().unwrap_or(Vector::Y));
    match shape.as_typed_shape() {
        TypedShape::Capsule(capsule) => {
            let (a, b) = (capsule.segment.a, capsule.segment.b);
            info.frame = frame_of(&Pose::from_parts(0.5 * (a + b), turned(b - a)));
        }
        TypedShape::HalfSpace(half_space) => {
            info.frame = frame_of(&Pose::from_parts(Vector::ZERO, turned(half_space.normal)));
        }
        TypedShape::HeightField(field) => {
            (info.rows, info.columns) = (field.heights().nrows() as u32, field.heights().ncols() as u32);
        }
        _ => {}
    }
    let (vertices, triangles) = surface(shape);
    (info.vertex_count, info.triangle_count) = (vertices.len() as u32, triangles.len() as u32);
    info
}

/// Returns the kind of a shape, its size, and by how much it is rounded.
fn kind_of(shape: &SharedShape) -> (DcdShapeKind, [f32; 3], f32) {
    let round = |radius: f32, half_height: f32| [radius, half_height, radius];
    match shape.as_typed_shape() {
        TypedShape::Ball(s) => (DCD_SHAPE_SPHERE, [s.radius; 3], 0.0),
        TypedShape::Cuboid(s) => (DCD_SHAPE_BOX, s.half_extents.to_array(), 0.0),
        TypedShape::RoundCuboid(s) => (DCD_SHAPE_BOX, s.inner_shape.half_extents.to_array(), s.border_radius),
        TypedShape::Capsule(s) => (DCD_SHAPE_CAPSULE, round(s.radius, s.half_height()), 0.0),
        TypedShape::Cylinder(s) => (DCD_SHAPE_CYLINDER, round(s.radius, s.half_height), 0.0),
        TypedShape::RoundCylinder(s) => {
            let inner = &s.inner_shape;
            (DCD_SHAPE_CYLINDER, round(inner.radius, inner.half_height), s.border_radius)
        }
        TypedShape::Cone(s) => (DCD_SHAPE_CONE, round(s.radius, s.half_height), 0.0),
        TypedShape::RoundCone(s) => {
            let inner = &s.inner_shape;
            (DCD_SHAPE_CONE, round(inner.radius, inner.half_height), s.border_radius)
        }
        TypedShape::ConvexPolyhedron(_) => (DCD_SHAPE_HULL, [0.0; 3], 0.0),
        TypedShape::RoundConvexPolyhedron(s) => (DCD_SHAPE_HULL, [0.0; 3], s.border_radius),
        TypedShape::RoundTriangle(s) => (DCD_SHAPE_MESH, [0.0; 3], s.border_radius),
        TypedShape::HeightField(s) => (DCD_SHAPE_HEIGHTFIELD, s.scale().to_array(), 0.0),
        TypedShape::Compound(_) => (DCD_SHAPE_COMPOUND, [0.0; 3], 0.0),
        TypedShape::HalfSpace(_) => (DCD_SHAPE_HALF_SPACE, [0.0; 3], 0.0),
        TypedShape::Segment(_) | TypedShape::Polyline(_) => (DCD_SHAPE_LINES, [0.0; 3], 0.0),
        TypedShape::Voxels(s) => (DCD_SHAPE_VOXELS, s.voxel_size().to_array(), 0.0),
        // Worlds hold no other shapes.
        _ => (DCD_SHAPE_MESH, [0.0; 3], 0.0),
    }
}

/// Returns the same triangles with vertices that triangles side by side share.
fn welded((vertices, triangles): &(Vec<Vector>, Vec<[u32; 3]>)) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let (mut places, mut shared) = (BTreeMap::new(), Vec::new());
    let mut place = |corner: u32| {
        let vertex = vertices[corner as usize];
        *places.entry(vertex.to_array().map(f32::to_bits)).or_insert_with(|| {
            shared.push(vertex);
            shared.len() as u32 - 1
        })
    };
    let triangles = triangles.iter().map(|triangle| triangle.map(&mut place)).collect();
    (shared, triangles)
}

/// Returns the vertices and triangles of a shape that has them.
fn surface(shape: &SharedShape) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (vertices, triangles) = match shape.as_typed_shape() {
        TypedShape::ConvexPolyhedron(s) => s.to_trimesh(),
        TypedShape::RoundConvexPolyhedron(s) => s.inner_shape.to_trimesh(),
        TypedShape::TriMesh(s) => (s.vertices().to_vec(), s.indices().to_vec()),
        TypedShape::HeightField(s) => welded(&s.to_trimesh()),
        TypedShape::Voxels(s) => s.to_trimesh(),
        TypedShape::Triangle(s) => (vec![s.a, s.b, s.c], vec![[0, 1, 2]]),
        TypedShape::RoundTriangle(s) => {
            (vec![s.inner_shape.a, s.inner_shape.b, s.inner_shape.c], vec![[0, 1, 2]])
        }
        TypedShape::Segment(s) => (vec![s.a, s.b], vec![[0, 1, 1]]),
        TypedShape::Polyline(s) => {
            (s.vertices().to_vec(), s.indices().iter().map(|&[a, b]| [a, b, b]).collect())
        }
        _ => (Vec::new(), Vec::new()),
    };
    (vertices.into_iter().map(|vertex| vertex.to_array()).collect(), triangles)
}
