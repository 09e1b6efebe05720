//! Draws a world by calling a program's own renderer: with points, lines, boxes, shapes and text, chosen by
//! flags.

mod lines;
mod scene;

use std::ops::{BitOr, BitOrAssign};

use crate::playback::ViewTime;
use crate::protocol::WorldPose;
use crate::space::{BodyId, Bounds};
pub(crate) use scene::Canvas;

/// A renderer by which [`World::debug_draw`](crate::World::debug_draw) draws a world.
///
/// Every method has a default: points and text are not drawn, boxes and shapes are drawn by lines. A renderer
/// that only draws lines thus implements [`DebugDraw::line`] alone. Positions are in world space, metres;
/// colours are red, green, blue and opacity.
pub trait DebugDraw {
    /// Draws a point that is `size_px` pixels wide at any distance.
    fn point(&mut self, _at: [f64; 3], _size_px: f32, _colour: [u8; 4]) {}

    /// Draws a line between two points.
    fn line(&mut self, _from: [f64; 3], _to: [f64; 3], _colour: [u8; 4]) {}

    /// Draws a box along the axes of world space.
    fn aabb(&mut self, bounds: &Bounds, colour: [u8; 4]) {
        lines::of_box(bounds, &mut |from, to| self.line(from, to, colour));
    }

    /// Draws one shape of a body at its pose in world space.
    fn shape(&mut self, _body: BodyId, shape: &DebugShape<'_>, pose: &WorldPose, colour: [u8; 4]) {
        lines::of_shape(shape, pose, &mut |from, to| self.line(from, to, colour));
    }

    /// Draws a text that begins at a point and faces the viewer.
    fn text(&mut self, _at: [f64; 3], _text: &str, _colour: [u8; 4]) {}
}

/// A shape to draw, around the origin of its pose. Rounded shapes are drawn in their full size, with edges.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum DebugShape<'a> {
    /// A box.
    Box {
        /// Half of the edges, metres.
        half: [f32; 3],
    },
    /// A ball.
    Ball {
        /// The radius, metres.
        radius: f32,
    },
    /// A capsule along y.
    Capsule {
        /// Half of the length without the caps, metres.
        half_height: f32,
        /// The radius, metres.
        radius: f32,
    },
    /// A cylinder along y.
    Cylinder {
        /// Half of the height, metres.
        half_height: f32,
        /// The radius, metres.
        radius: f32,
    },
    /// A cone whose tip is at +y.
    Cone {
        /// Half of the height, metres.
        half_height: f32,
        /// The radius of the base, metres.
        radius: f32,
    },
    /// The half-space below the plane y = 0.
    HalfSpace,
    /// A mesh of triangles, or of lines, which are triangles with two equal corners.
    Mesh {
        /// The number of the mesh. In one world the same number always means the same mesh, so that a
        /// renderer may keep what it makes of it.
        number: u32,
        /// The corners, metres.
        vertices: &'a [[f32; 3]],
        /// The triangles, counterclockwise from outside.
        triangles: &'a [[u32; 3]],
    },
}

/// The items that [`World::debug_draw`](crate::World::debug_draw) draws, joined by `|`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DebugDrawFlags(u32);

impl DebugDrawFlags {
    /// Bodies by their shapes, in the colour of the region that owns them, greyed while they sleep. Fixed
    /// bodies are grey, sensors faint.
    pub const SHAPES: Self = Self(1);
    /// The boxes around movable bodies.
    pub const AABBS: Self = Self(1 << 1);
    /// The swept AABBs: boxes around all that movable bodies may reach in the next three ticks, by which
    /// regions predict contacts across borders.
    pub const SWEPT_AABBS: Self = Self(1 << 2);
    /// Centres of mass, as points.
    pub const CENTRES_OF_MASS: Self = Self(1 << 3);
    /// Regions, as boxes within the bounds of the world.
    pub const BORDERS: Self = Self(1 << 4);
    /// Ghosts: copies of bodies in regions that do not own them, as boxes in the colour of the region that
    /// holds them.
    pub const GHOSTS: Self = Self(1 << 5);
    /// Contacts, as points, with their forces as lines.
    pub const CONTACTS: Self = Self(1 << 6);
    /// Joints, as lines from one body to the joint and on to the other.
    pub const JOINTS: Self = Self(1 << 7);
    /// Linear velocities, as lines.
    pub const VELOCITIES: Self = Self(1 << 8);
    /// Avatars of clients, as points: white if they are this process's own.
    pub const AVATARS: Self = Self(1 << 9);
    /// Ids of movable bodies, as text.
    pub const LABELS: Self = Self(1 << 10);
    /// All of these.
    pub const ALL: Self = Self((1 << 11) - 1);

    /// Returns the flags of these bits; `None` if a bit has no meaning.
    #[doc(hidden)]
    #[must_use]
    pub fn from_bits(bits: u32) -> Option<Self> {
        (bits & !Self::ALL.0 == 0).then_some(Self(bits))
    }

    fn has(self, flag: Self) -> bool {
        self.0 & flag.0 != 0
    }

    fn has_any(self, flags: &[Self]) -> bool {
        flags.iter().any(|&flag| self.has(flag))
    }
}

impl BitOr for DebugDrawFlags {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for DebugDrawFlags {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

/// The settings of [`World::debug_draw`](crate::World::debug_draw): what is drawn, at which time, where, and
/// how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DebugDrawSettings {
    /// The items that are drawn; by default [`DebugDrawFlags::SHAPES`].
    pub what: DebugDrawFlags,
    /// The time at which bodies, velocities, joints and labels are shown. `None`: as they are after the last
    /// step. Boxes, centres of mass, ghosts and contacts are always those of the last step.
    pub time: Option<ViewTime>,
    /// The box to draw, in world space, metres: movable bodies whose origin is outside it, and contacts
    /// outside it, are left out. `None`: everywhere.
    pub within: Option<Bounds>,
    /// The length of a velocity's line, metres per m/s.
    pub metres_per_m_s: f32,
    /// The length of a force's line, metres per newton.
    pub metres_per_n: f32,
}

impl Default for DebugDrawSettings {
    fn default() -> Self {
        let what = DebugDrawFlags::SHAPES;
        Self { what, time: None, within: None, metres_per_m_s: 0.1, metres_per_n: 1e-4 }
    }
}
