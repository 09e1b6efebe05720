//! Draws worlds by functions of the user's renderer, and into glTF files.

use std::ffi::{CString, c_char, c_void};

use dcd::{BodyId, Bounds, DebugDraw, DebugDrawFlags, DebugDrawSettings, DebugShape, WorldPose};

use crate::callback::{Callback, enter};
use crate::guard::guard;
use crate::handle::Mark;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Sized32, check_bits, check_numbers};
use crate::registry::with;
use crate::status::{DcdStatus, Failure};
use crate::types::DcdPose;
use crate::view::{DcdViewTime, checked};

/// DCD_DRAW_... bits: what is drawn.
pub type DcdDrawFlags = u32;

/// Draws bodies by their shapes, in the colour of the region that owns them, greyed while they sleep. Fixed bodies are grey,
/// sensors faint.
pub const DCD_DRAW_SHAPES: DcdDrawFlags = 1;
/// Draws the boxes (AABBs) around movable bodies.
pub const DCD_DRAW_AABBS: DcdDrawFlags = 2;
/// Draws the swept AABBs of movable bodies: the boxes around all that they may reach in the next three steps, by which regions
/// predict contacts across borders.
pub const DCD_DRAW_SWEPT_AABBS: DcdDrawFlags = 4;
/// Draws centres of mass, as points.
pub const DCD_DRAW_CENTRES_OF_MASS: DcdDrawFlags = 8;
/// Draws regions, as boxes within the bounds of the world.
pub const DCD_DRAW_BORDERS: DcdDrawFlags = 16;
/// Draws ghosts, copies of bodies in regions that do not own them, as boxes in the colour of the region that holds them.
pub const DCD_DRAW_GHOSTS: DcdDrawFlags = 32;
/// Draws contacts, as points, with their forces as lines.
pub const DCD_DRAW_CONTACTS: DcdDrawFlags = 64;
/// Draws joints, as lines from the one body to the joint and on to the other.
pub const DCD_DRAW_JOINTS: DcdDrawFlags = 128;
/// Draws linear velocities, as lines.
pub const DCD_DRAW_VELOCITIES: DcdDrawFlags = 256;
/// Draws avatars of clients, as points: white if they are this process's own.
pub const DCD_DRAW_AVATARS: DcdDrawFlags = 512;
/// Draws the ids of movable bodies, as text.
pub const DCD_DRAW_LABELS: DcdDrawFlags = 1024;
/// Draws all of it.
pub const DCD_DRAW_ALL: DcdDrawFlags = 2047;

/// Kind of a shape that is drawn: DCD_DRAWN_BOX to DCD_DRAWN_MESH. Later versions may add kinds: skip unknown ones.
pub type DcdDrawnKind = u32;

/// A box; `size` is half of its edges.
pub const DCD_DRAWN_BOX: DcdDrawnKind = 0;
/// A sphere; size[0] is its radius.
pub const DCD_DRAWN_SPHERE: DcdDrawnKind = 1;
/// A capsule along y; size[0] is its radius, size[1] half of its length without the caps.
pub const DCD_DRAWN_CAPSULE: DcdDrawnKind = 2;
/// A cylinder along y; size[0] is its radius, size[1] half of its height.
pub const DCD_DRAWN_CYLINDER: DcdDrawnKind = 3;
/// A cone whose tip is at +y; size[0] is the radius of its base, size[1] half of its height.
pub const DCD_DRAWN_CONE: DcdDrawnKind = 4;
/// A half-space: all below the plane y = 0.
pub const DCD_DRAWN_HALF_SPACE: DcdDrawnKind = 5;
/// A mesh of triangles, or of lines, which are triangles of which two corners are the same.
pub const DCD_DRAWN_MESH: DcdDrawnKind = 6;

/// Shape that is drawn, about the origin of its pose. Rounded shapes are drawn as large as they are, with edges. The struct may
/// grow at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdDrawnShape {
    /// Kind: DCD_DRAWN_BOX and so on.
    pub kind: DcdDrawnKind,
    /// Number of the mesh. In one world the same number is the same mesh for ever, so a renderer can keep what it makes of it.
    pub mesh: u32,
    /// Sizes by kind, metres.
    pub size: [f32; 3],
    /// Reserved; always 0.
    pub reserved: u32,
    /// Corners of a mesh: x, y, z of each, metres.
    pub vertices: *const f32,
    /// Number of corners.
    pub vertex_count: usize,
    /// Triangles of a mesh: three corners of each, counterclockwise from outside.
    pub triangles: *const u32,
    /// Number of triangles.
    pub triangle_count: usize,
}

/// Draws a point that is `size` pixels wide, however far away it is.
pub type DcdDrawPointFn =
    Option<unsafe extern "C" fn(context: *mut c_void, at: *const f64, size: f32, colour: u32)>;
/// Draws a line between two points.
pub type DcdDrawLineFn =
    Option<unsafe extern "C" fn(context: *mut c_void, from: *const f64, to: *const f64, colour: u32)>;
/// Draws a box along the axes of world space, from its lowest corner to its highest.
pub type DcdDrawBoxFn =
    Option<unsafe extern "C" fn(context: *mut c_void, min: *const f64, max: *const f64, colour: u32)>;
/// Draws one shape of a body at its place in the world.
pub type DcdDrawShapeFn = Option<
    unsafe extern "C" fn(
        context: *mut c_void,
        body: DcdBodyId,
        shape: *const DcdDrawnShape,
        pose: *const DcdPose,
        colour: u32,
    ),
>;
/// Draws a text that begins at a point and is turned to the viewer.
pub type DcdDrawTextFn =
    Option<unsafe extern "C" fn(context: *mut c_void, at: *const f64, text: *const c_char, colour: u32)>;

/// What is drawn, and the functions that draw it. Start from DCD_DEBUG_DRAW_INIT.
///
/// Points are three doubles, in metres of world space. Colours are 0xRRGGBBAA. What pointers lead to is valid during the call.
/// Without draw_box or draw_shape, draw_line draws their things. What has no function otherwise is skipped.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdDebugDraw {
    /// Size of this struct: sizeof(DcdDebugDraw).
    pub struct_size: u32,
    /// DCD_DRAW_... bits.
    pub flags: DcdDrawFlags,
    /// First argument of all functions.
    pub context: *mut c_void,
    /// Function that draws points. Null: points are skipped.
    pub draw_point: DcdDrawPointFn,
    /// Function that draws lines. Null: lines are skipped.
    pub draw_line: DcdDrawLineFn,
    /// Function that draws boxes. Null: draw_line draws them.
    pub draw_box: DcdDrawBoxFn,
    /// Function that draws shapes. Null: draw_line draws them.
    pub draw_shape: DcdDrawShapeFn,
    /// Function that draws texts. Null: texts are skipped.
    pub draw_text: DcdDrawTextFn,
    /// Lowest corner of the box to draw, metres. Movable bodies with their origin outside the box, and contacts outside it, are
    /// left out.
    pub min: [f64; 3],
    /// Highest corner of the box to draw, metres.
    pub max: [f64; 3],
    /// Length of the line of a velocity, metres per m/s.
    pub velocity_scale: f32,
    /// Length of the line of a force, metres per newton.
    pub force_scale: f32,
}

// SAFETY: begins with `struct_size`; every other member is a number, a pointer or a function that may be null.
unsafe impl Sized32 for DcdDebugDraw {
    const NAME: &'static str = "DcdDebugDraw";
}

/// Draws a world by calling the functions of `draw`. Give `time` to draw a frame at the time that it shows (dcd_view_time). With
/// `time` null, the world is drawn as it is after the last dcd_step. Boxes around bodies, centres of mass, ghosts and contacts are
/// always of the last step.
///
/// A local world draws everything. A client or participant draws what it is told: shapes, borders, velocities, avatars, labels. A
/// server, whose record is half a second old, draws joints too. The rest is known only to processes that compute it, and is left
/// out.
///
/// The calling thread calls the functions, before this call returns. They must return normally (no longjmp, no C++ exception). The
/// world is theirs meanwhile: calls of other threads on it wait, and every call on a world from within gives DCD_ERR_BUSY.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: unknown flags, a `min` that is above its `max`, NaN in them, or scales that are not finite. Corners may be
///   infinite.
/// - DCD_ERR_BUSY: called from within a callback.
/// - DCD_ERR_UNSUPPORTED: a node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_debug_draw(
    world: DcdWorld,
    time: *const DcdViewTime,
    draw: *const DcdDebugDraw,
) -> DcdStatus {
    guard("dcd_debug_draw", || {
        // SAFETY: the caller vouches for both pointers.
        let (time, draw) = unsafe {
            let time = if time.is_null() { None } else { Some(checked(time)?) };
            (time, pointer::read_sized(draw, "draw")?)
        };
        let settings = DebugDrawSettings { time, ..settings_of(&draw)? };
        with(world, |world| {
            let mut renderer = Renderer { draw, mark: world.mark };
            Ok(world.dcd.debug_draw(&mut renderer, &settings)?)
        })
    })
}

/// Writes the world as it is after the last step to a binary glTF file (.glb), for Blender and engines. Bodies are nodes named by
/// their numbers ("b7", "c2/b0"), with their shapes in the colour of the region that owns them. A file that is there is replaced once
/// the new one is whole. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes and folders are refused.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_LIMIT (a file above 4 GiB), DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_gltf_save_file(world: DcdWorld, path: *const c_char) -> DcdStatus {
    guard("dcd_gltf_save_file", || {
        // SAFETY: the caller vouches for the text.
        let path = unsafe { pointer::text(path, "path")? };
        with(world, |world| world.dcd.save_gltf(path).map_err(|error| Failure::from(error).of_file(path)))
    })
}

fn settings_of(draw: &DcdDebugDraw) -> Result<DebugDrawSettings, Failure> {
    check_bits(draw.flags, DCD_DRAW_ALL, "draw->flags")?;
    check_numbers(&[draw.velocity_scale], "draw->velocity_scale")?;
    check_numbers(&[draw.force_scale], "draw->force_scale")?;
    // NaN is not at most anything, so it is refused too.
    if !(0..3).all(|i| draw.min[i] <= draw.max[i]) {
        let (min, max) = (draw.min, draw.max);
        return Err(Failure::argument(format!(
            "draw->min {min:?} is not below draw->max {max:?}; give the lowest corner and the highest one"
        )));
    }
    Ok(DebugDrawSettings {
        what: DebugDrawFlags::from_bits(draw.flags).unwrap_or_default(),
        time: None,
        within: Some(Bounds { min: draw.min, max: draw.max }),
        metres_per_m_s: draw.velocity_scale,
        metres_per_n: draw.force_scale,
    })
}

/// The user's renderer.
struct Renderer {
    draw: DcdDebugDraw,
    mark: Mark,
}

impl Renderer {
    fn line(&self, from: [f64; 3], to: [f64; 3], colour: u32) {
        if let Some(line) = self.draw.draw_line {
            let context = self.draw.context;
            // SAFETY: the user's function, called as the header says; what it is pointed to outlives the call.
            enter(Callback::Drawing, || unsafe { line(context, from.as_ptr(), to.as_ptr(), colour) });
        }
    }
}

/// Draws by lines what the user's renderer has no function for.
struct Lines<'a>(&'a Renderer);

impl DebugDraw for Lines<'_> {
    fn line(&mut self, from: [f64; 3], to: [f64; 3], colour: [u8; 4]) {
        self.0.line(from, to, u32::from_be_bytes(colour));
    }
}

impl DebugDraw for Renderer {
    fn point(&mut self, at: [f64; 3], size_px: f32, colour: [u8; 4]) {
        if let Some(point) = self.draw.draw_point {
            let (context, colour) = (self.draw.context, u32::from_be_bytes(colour));
            // SAFETY: as for lines.
            enter(Callback::Drawing, || unsafe { point(context, at.as_ptr(), size_px, colour) });
        }
    }

    fn line(&mut self, from: [f64; 3], to: [f64; 3], colour: [u8; 4]) {
        Renderer::line(self, from, to, u32::from_be_bytes(colour));
    }

    fn aabb(&mut self, bounds: &Bounds, colour: [u8; 4]) {
        let Some(aabb) = self.draw.draw_box else { return Lines(self).aabb(bounds, colour) };
        let (context, colour) = (self.draw.context, u32::from_be_bytes(colour));
        let (min, max) = (bounds.min.as_ptr(), bounds.max.as_ptr());
        // SAFETY: as for lines.
        enter(Callback::Drawing, || unsafe { aabb(context, min, max, colour) });
    }

    fn shape(&mut self, body: BodyId, shape: &DebugShape<'_>, pose: &WorldPose, colour: [u8; 4]) {
        let Some(draw) = self.draw.draw_shape else { return Lines(self).shape(body, shape, pose, colour) };
        let Some(shape) = drawn(shape) else { return };
        let (context, colour) = (self.draw.context, u32::from_be_bytes(colour));
        let (body, pose) = (self.mark.body(body), DcdPose::from(*pose));
        // SAFETY: as for lines.
        enter(Callback::Drawing, || unsafe { draw(context, body, &shape, &pose, colour) });
    }

    fn text(&mut self, at: [f64; 3], text: &str, colour: [u8; 4]) {
        // A label has no NUL inside.
        if let (Some(draw), Ok(text)) = (self.draw.draw_text, CString::new(text)) {
            let (context, colour) = (self.draw.context, u32::from_be_bytes(colour));
            // SAFETY: as for lines.
            enter(Callback::Drawing, || unsafe { draw(context, at.as_ptr(), text.as_ptr(), colour) });
        }
    }
}

/// Returns a shape for C, or `None` for one that this version of the header has no name for.
fn drawn(shape: &DebugShape<'_>) -> Option<DcdDrawnShape> {
    let plain = |kind, size| DcdDrawnShape {
        kind,
        mesh: 0,
        size,
        reserved: 0,
        vertices: std::ptr::null(),
        vertex_count: 0,
        triangles: std::ptr::null(),
        triangle_count: 0,
    };
    let round = |kind, radius, half_height| plain(kind, [radius, half_height, radius]);
    Some(match *shape {
        DebugShape::Box { half } => plain(DCD_DRAWN_BOX, half),
        DebugShape::Ball { radius } => plain(DCD_DRAWN_SPHERE, [radius; 3]),
        DebugShape::Capsule { half_height, radius } => round(DCD_DRAWN_CAPSULE, radius, half_height),
        DebugShape::Cylinder { half_height, radius } => round(DCD_DRAWN_CYLINDER, radius, half_height),
        DebugShape::Cone { half_height, radius } => round(DCD_DRAWN_CONE, radius, half_height),
        DebugShape::HalfSpace => plain(DCD_DRAWN_HALF_SPACE, [0.0; 3]),
        DebugShape::Mesh { number, vertices, triangles } => DcdDrawnShape {
            mesh: number,
            vertices: vertices.as_ptr().cast(),
            vertex_count: vertices.len(),
            triangles: triangles.as_ptr().cast(),
            triangle_count: triangles.len(),
            ..plain(DCD_DRAWN_MESH, [1.0; 3])
        },
        _ => return None,
    })
}
