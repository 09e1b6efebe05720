//! Creates and destroys shapes, each of which any number of bodies may use.

use std::sync::Arc;

use dcd::physics::{ShapeLibrary, convex_hull};
use dcd::protocol::{SHAPE_LEAST_M, SHAPE_REACH_M};
use rapier3d::parry::shape::{HeightFieldFlags, RoundShape, TriMeshFlags, TypedShape};
use rapier3d::parry::utils::Array2;
use rapier3d::prelude::{Pose, Rotation, Shape, ShapeType, SharedShape, Vector};

use crate::guard::guard;
use crate::handle::{Mark, Slots, stale};
use crate::ids::{DcdShapeId, DcdWorld};
use crate::limits::{DCD_MAX_ITEMS, DCD_MAX_NUMBER};
use crate::pointer::{self, Out, check_numbers};
use crate::registry::{World, with};
use crate::status::{DcdStatus, Failure};
use crate::types::DcdFrame;

/// Least size of a shape, metres. A smaller shape has no mass to speak of in single precision.
pub const DCD_MIN_SIZE: f32 = 1.0e-4;

const _: () = assert!(DCD_MIN_SIZE == SHAPE_LEAST_M && DCD_MAX_NUMBER == SHAPE_REACH_M);

fn add(world: DcdWorld, shape: SharedShape, out: Out<DcdShapeId>) -> Result<(), Failure> {
    let shape = checked(&shape)?;
    with(world, |world| {
        let slot = world.shapes.insert(shape);
        out.write(world.mark.shape(slot));
        Ok(())
    })
}

/// Returns the shape as a world will hold it, or why no world can hold it: it is better refused here than when a body is made with
/// it.
fn checked(shape: &SharedShape) -> Result<SharedShape, Failure> {
    let mut library = ShapeLibrary::default();
    let name = library.intern(shape)?;
    Ok(library.shape(name)?)
}

/// Returns the shape behind a handle.
pub(crate) fn find(world: &World, shape: DcdShapeId) -> Result<&SharedShape, Failure> {
    among(&world.shapes, world.mark, shape)
}

/// Returns the shape behind a handle, for callers that change the world itself meanwhile.
pub(crate) fn among(
    shapes: &Slots<SharedShape>,
    mark: Mark,
    shape: DcdShapeId,
) -> Result<&SharedShape, Failure> {
    shapes.get(mark.shape_slot(shape)?).ok_or_else(|| stale("shape", shape.v))
}

fn check_sizes(sizes: &[(f32, &str)]) -> Result<(), Failure> {
    match sizes.iter().find(|(size, _)| !(DCD_MIN_SIZE..=DCD_MAX_NUMBER).contains(size)) {
        None => Ok(()),
        Some((size, name)) => Err(Failure::argument(format!(
            "{name} is {size}; give metres from DCD_MIN_SIZE ({DCD_MIN_SIZE}) to DCD_MAX_NUMBER ({DCD_MAX_NUMBER})"
        ))),
    }
}

/// # Safety
/// As [`pointer::slice`], for `count` points of three numbers.
unsafe fn points(xyz: *const f32, count: usize, name: &str) -> Result<Vec<Vector>, Failure> {
    // SAFETY: three floats have the alignment of one; the caller vouches for the rest.
    let points = unsafe { pointer::slice(xyz.cast::<[f32; 3]>(), count, name)? };
    check_numbers(points.as_flattened(), name)?;
    Ok(points.iter().map(|&point| Vector::from_array(point)).collect())
}

/// Makes a box around its origin. `half` holds half of its edges along x, y, z, metres, at least DCD_MIN_SIZE.
///
/// This and the other shape functions copy what they read, and write the new handle to `out`. A shape belongs to its world. Bodies
/// keep what they need of it, so it may be destroyed before them.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (a size out of range).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_box(world: DcdWorld, half: *const f32, out: *mut DcdShapeId) -> DcdStatus {
    guard("dcd_shape_box", || {
        // SAFETY: the caller vouches for three floats and for `out`.
        let ([x, y, z], out) =
            unsafe { (pointer::read(half.cast::<[f32; 3]>(), "half")?, Out::new(out, "out")?) };
        check_sizes(&[(x, "half[0]"), (y, "half[1]"), (z, "half[2]")])?;
        add(world, SharedShape::cuboid(x, y, z), out)
    })
}

/// Makes a ball of `radius` metres around its origin. Errors: as dcd_shape_box.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_sphere(world: DcdWorld, radius: f32, out: *mut DcdShapeId) -> DcdStatus {
    guard("dcd_shape_sphere", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        check_sizes(&[(radius, "radius")])?;
        add(world, SharedShape::ball(radius), out)
    })
}

/// Makes a capsule along y: a cylinder of height 2 × `half_height` with a half ball of `radius` at either end, metres. Errors: as
/// dcd_shape_box.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_capsule(
    world: DcdWorld,
    half_height: f32,
    radius: f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_capsule", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        check_sizes(&[(half_height, "half_height"), (radius, "radius")])?;
        add(world, SharedShape::capsule_y(half_height, radius), out)
    })
}

/// Makes a cylinder of `radius` along y, from -half_height to half_height, metres. Errors: as dcd_shape_box.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_cylinder(
    world: DcdWorld,
    half_height: f32,
    radius: f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_cylinder", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        check_sizes(&[(half_height, "half_height"), (radius, "radius")])?;
        add(world, SharedShape::cylinder(half_height, radius), out)
    })
}

/// Makes a cone along y, with its base of `radius` at -half_height and its tip at half_height, metres. Errors: as dcd_shape_box.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_cone(
    world: DcdWorld,
    half_height: f32,
    radius: f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_cone", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        check_sizes(&[(half_height, "half_height"), (radius, "radius")])?;
        add(world, SharedShape::cone(half_height, radius), out)
    })
}

/// Makes the convex hull of `count` points. `xyz` holds 3 × count floats (x, y, z, x, y, z …), metres. There must be at least 4
/// points, not all in a plane, that reach over DCD_MIN_SIZE along each axis. Points that hardly stand out may be left out: the hull
/// has at least 99 % of the volume of all.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (points out of range or that span no volume).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_hull(
    world: DcdWorld,
    xyz: *const f32,
    count: usize,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_hull", || {
        // SAFETY: the caller vouches for 3 × `count` floats and for `out`.
        let (points, out) = unsafe { (points(xyz, count, "xyz")?, Out::new(out, "out")?) };
        let refused =
            || Failure::argument("the points span no volume; give at least 4 that are not in a plane");
        add(world, convex_hull(&points).ok_or_else(refused)?, out)
    })
}

/// Makes a mesh of `triangle_count` triangles. `xyz` holds 3 × vertex_count floats, metres. `indices` holds 3 × triangle_count
/// indices: each triangle has three indices below `vertex_count`, counter-clockwise seen from outside. Triangles without area are
/// left out.
///
/// A `one_sided` mesh bears what is outside, and lets pass what comes from inside, at its triangles that run clockwise, too. What rolls
/// from triangle to triangle on it is not slowed by their edges. Any other mesh bears what is on either side, and its edges slow what
/// rolls over them by some hundredths.
///
/// A mesh is hollow, and has mass by density only if it is closed: use it for fixed bodies, or give them DcdBodyDef.mass.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (vertices out of range, no triangle with an area, or an index
/// past the vertices).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_mesh(
    world: DcdWorld,
    xyz: *const f32,
    vertex_count: usize,
    indices: *const u32,
    triangle_count: usize,
    one_sided: bool,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_mesh", || {
        // SAFETY: the caller vouches for the floats, the indices and `out`.
        let (vertices, triangles, out) = unsafe {
            (
                points(xyz, vertex_count, "xyz")?,
                pointer::slice(indices.cast::<[u32; 3]>(), triangle_count, "indices")?,
                Out::new(out, "out")?,
            )
        };
        if let Some(index) = triangles.as_flattened().iter().find(|&&index| index as usize >= vertex_count) {
            return Err(Failure::argument(format!(
                "index {index} is past the {vertex_count} vertices; count from 0"
            )));
        }
        let flags = if one_sided { TriMeshFlags::FIX_INTERNAL_EDGES } else { TriMeshFlags::default() };
        let mesh = SharedShape::trimesh_with_flags(vertices, triangles.to_vec(), flags).map_err(|cause| {
            Failure::argument(format!("the mesh is refused ({cause}); check its triangles"))
        })?;
        add(world, mesh, out)
    })
}

/// Makes terrain in the x-z plane around its origin. `heights` holds `rows` heights along z times `columns` along x, metres, at
/// heights[row + column * rows]. `scale` stretches the terrain: the whole is scale[0] by scale[2] metres, and heights are times
/// scale[1]. Use it for fixed bodies: it has no mass by density. It bears what is above it. What rolls from triangle to triangle is
/// not slowed by their edges.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (fewer than 2 rows or columns, heights out of range, or a scale
/// below DCD_MIN_SIZE).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_heightfield(
    world: DcdWorld,
    heights: *const f32,
    rows: usize,
    columns: usize,
    scale: *const f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_heightfield", || {
        if rows < 2 || columns < 2 {
            return Err(Failure::argument(format!("{rows} x {columns} heights; give at least 2 x 2")));
        }
        let Some(count) = rows.checked_mul(columns).filter(|&count| count <= DCD_MAX_ITEMS) else {
            return Err(Failure::argument(format!(
                "{rows} x {columns} heights are more than DCD_MAX_ITEMS ({DCD_MAX_ITEMS}); cut the terrain into several"
            )));
        };
        // SAFETY: the caller vouches for rows × columns heights, three floats and `out`.
        let (heights, scale, out) = unsafe {
            (
                pointer::slice(heights, count, "heights")?,
                pointer::read(scale.cast::<[f32; 3]>(), "scale")?,
                Out::new(out, "out")?,
            )
        };
        check_numbers(heights, "heights")?;
        check_sizes(&[(scale[0], "scale[0]"), (scale[1], "scale[1]"), (scale[2], "scale[2]")])?;
        let highest = heights.iter().fold(0.0, |most: f32, height| most.max(height.abs()));
        check_numbers(&[highest * scale[1]], "heights times scale[1]")?;
        let heights = Array2::new(rows, columns, heights.to_vec());
        let (scale, flags) = (Vector::from_array(scale), HeightFieldFlags::FIX_INTERNAL_EDGES);
        add(world, SharedShape::heightfield_with_flags(heights, scale, flags), out)
    })
}

/// Makes a half-space: all behind the plane through its origin from which `normal` points away, without end. `normal` has any
/// length above 0. Use it as ground for fixed bodies, in which nothing falls through: it has no mass and no edge.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (a normal out of range or without length).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_half_space(
    world: DcdWorld,
    normal: *const f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_half_space", || {
        // SAFETY: the caller vouches for three floats and for `out`.
        let (normal, out) =
            unsafe { (pointer::read(normal.cast::<[f32; 3]>(), "normal")?, Out::new(out, "out")?) };
        check_numbers(&normal, "normal")?;
        let Some(normal) = Vector::from_array(normal).try_normalize() else {
            return Err(Failure::argument(
                "normal has no length; give the way out of the ground, as 0, 1, 0",
            ));
        };
        add(world, SharedShape::halfspace(normal), out)
    })
}

/// Makes a line from `a` to `b`, three floats each, metres: a wire, an edge. It has no mass by density: use it for fixed bodies, or
/// give them DcdBodyDef.mass.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (points out of range, or nearer to one another than
/// DCD_MIN_SIZE).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_segment(
    world: DcdWorld,
    a: *const f32,
    b: *const f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_segment", || {
        // SAFETY: the caller vouches for three floats each and for `out`.
        let (a, b, out) = unsafe {
            (
                pointer::read(a.cast::<[f32; 3]>(), "a")?,
                pointer::read(b.cast::<[f32; 3]>(), "b")?,
                Out::new(out, "out")?,
            )
        };
        check_numbers(&a, "a")?;
        check_numbers(&b, "b")?;
        let (a, b) = (Vector::from_array(a), Vector::from_array(b));
        check_sizes(&[((b - a).length(), "the length from a to b")])?;
        add(world, SharedShape::segment(a, b), out)
    })
}

/// Makes a rounded box, cylinder, cone or hull: another shape grown by `border` metres on all sides, with edges and corners of that
/// radius (DcdShapeInfo.border). Rounded shapes roll smoothly over their edges, and rounded hulls touch at more than a corner.
///
/// The other shape may be destroyed afterwards.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT (a border below DCD_MIN_SIZE or out of range, or
/// another kind of shape, also one that is round already).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_round(
    world: DcdWorld,
    shape: DcdShapeId,
    border: f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_round", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        check_sizes(&[(border, "border")])?;
        with(world, |world| {
            let round = checked(&rounded(find(world, shape)?, border)?)?;
            let slot = world.shapes.insert(round);
            out.write(world.mark.shape(slot));
            Ok(())
        })
    })
}

fn rounded(shape: &SharedShape, border_radius: f32) -> Result<SharedShape, Failure> {
    Ok(match shape.as_typed_shape() {
        TypedShape::Cuboid(s) => {
            let [x, y, z] = s.half_extents.to_array();
            SharedShape::round_cuboid(x, y, z, border_radius)
        }
        TypedShape::Cylinder(s) => SharedShape::round_cylinder(s.half_height, s.radius, border_radius),
        TypedShape::Cone(s) => SharedShape::round_cone(s.half_height, s.radius, border_radius),
        TypedShape::ConvexPolyhedron(s) => {
            SharedShape::new(RoundShape { inner_shape: s.clone(), border_radius })
        }
        _ => {
            return Err(Failure::argument(
                "the shape is no box, cylinder, cone or hull with sharp edges; make those round",
            ));
        }
    })
}

/// Makes a compound: one shape of `count` others, part i at frames[i]. Parts must be simple: no mesh, terrain or compound.
///
/// `parts` and `frames` have `count` entries, at least one. The parts may be destroyed afterwards.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a part), DCD_ERR_ARGUMENT (no part, a part that is not simple, or a frame that
/// is not finite or no rotation).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_compound(
    world: DcdWorld,
    parts: *const DcdShapeId,
    frames: *const DcdFrame,
    count: usize,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_compound", || {
        // SAFETY: the caller vouches for `count` entries of both and for `out`.
        let (parts, frames, out) = unsafe {
            (
                pointer::slice(parts, count, "parts")?,
                pointer::slice(frames, count, "frames")?,
                Out::new(out, "out")?,
            )
        };
        if parts.is_empty() {
            return Err(Failure::argument("count is 0; give at least one part"));
        }
        with(world, |world| {
            let mut placed = Vec::with_capacity(count);
            for (i, (&part, frame)) in parts.iter().zip(frames).enumerate() {
                let shape = find(world, part)?;
                if !is_simple(shape) {
                    return Err(Failure::argument(format!(
                        "parts[{i}] is made of parts itself; add those instead"
                    )));
                }
                frame.check(&format!("frames[{i}]"))?;
                placed.push((frame.pose(), shape.clone()));
            }
            let slot = world.shapes.insert(SharedShape::compound(placed));
            out.write(world.mark.shape(slot));
            Ok(())
        })
    })
}

/// Returns whether the shape may be part of a compound.
fn is_simple(shape: &SharedShape) -> bool {
    use ShapeType::{Compound, HeightField, Polyline, TriMesh, Voxels};
    !matches!(shape.shape_type(), Compound | HeightField | Polyline | TriMesh | Voxels)
}

/// Makes a shape that is another one stretched along its own axes by `scale` (three factors above 0): one mesh or hull in many
/// sizes.
///
/// Round shapes stay round where the factors let them; otherwise they become a hull (of a sphere some hundred points). Parts of a
/// compound that are turned can only be stretched alike along all axes. A border (DcdShapeInfo.border) keeps its thickness.
///
/// `scale` is read during the call. The other shape may be destroyed afterwards.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT (a factor that is not above 0 or makes the shape too
/// small or too large, or a compound that cannot be stretched so).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_shape_scale(
    world: DcdWorld,
    shape: DcdShapeId,
    scale: *const f32,
    out: *mut DcdShapeId,
) -> DcdStatus {
    guard("dcd_shape_scale", || {
        // SAFETY: the caller vouches for three floats and for `out`.
        let (scale, out) = unsafe { (pointer::slice(scale, 3, "scale")?, Out::new(out, "out")?) };
        let scale = Vector::from_slice(scale);
        if !scale.to_array().iter().all(|factor| (1e-6..=1e6).contains(factor)) {
            return Err(Failure::argument(format!("scale is {scale}; give factors from 1e-6 to 1e6")));
        }
        with(world, |world| {
            let scaled = checked(&scaled(&**find(world, shape)?, scale)?)?;
            let slot = world.shapes.insert(scaled);
            out.write(world.mark.shape(slot));
            Ok(())
        })
    })
}

/// Number of steps along each of two angles in which round shapes are cut when they become hulls.
const ROUND: u32 = 16;

fn scaled(shape: &dyn Shape, scale: Vector) -> Result<SharedShape, Failure> {
    let Some(compound) = shape.as_compound() else {
        let scaled = shape.scale_dyn(scale, ROUND).ok_or_else(|| {
            Failure::argument(format!("the shape becomes flat or thin by {scale}; take larger factors"))
        })?;
        return Ok(SharedShape(Arc::from(scaled)));
    };
    let alike = scale.max_element() == scale.min_element();
    let parts = compound.shapes().iter().enumerate().map(|(i, (place, part))| {
        if !alike && place.rotation != Rotation::IDENTITY {
            return Err(Failure::argument(format!(
                "part {i} of the compound is turned; give one factor three times, or scale the parts"
            )));
        }
        Ok((Pose { translation: place.translation * scale, ..*place }, scaled(&**part, scale)?))
    });
    Ok(SharedShape::compound(parts.collect::<Result<_, _>>()?))
}

/// Destroys a shape's handle. Bodies made with it keep their shape.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_shape_destroy(world: DcdWorld, shape: DcdShapeId) -> DcdStatus {
    guard("dcd_shape_destroy", || {
        with(world, |world| {
            let slot = world.mark.shape_slot(shape)?;
            world.looked_up.forget(slot);
            world.shapes.remove(slot).map(drop).ok_or_else(|| stale("shape", shape.v))
        })
    })
}
