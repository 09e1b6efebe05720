//! Draws a world by calls of a program's own renderer: points, lines, boxes, shapes and text, chosen by flags.

mod lines;
mod scene;

use std::ops::{BitOr, BitOrAssign};

use crate::playback::ViewTime;
use crate::protocol::WorldPose;
use crate::space::{BodyId, Bounds};
pub(crate) use scene::Canvas;

/// A renderer that [`World::debug_draw`](crate::World::debug_draw) draws a world by.
///
/// Every method has a default: points and text are not drawn, boxes and shapes are drawn by lines. So a renderer that only draws lines
/// implements [`DebugDraw::line`] alone. Places are metres of world space, colours red, green, blue and opacity.
pub trait DebugDraw {
    /// Draws a point that is so many pixels wide, however far it is.
    fn point(&mut self, _at: [f64; 3], _size_px: f32, _colour: [u8; 4]) {}

    /// Draws a line between two points.
    fn line(&mut self, _from: [f64; 3], _to: [f64; 3], _colour: [u8; 4]) {}

    /// Draws a box along the axes of world space.
    fn aabb(&mut self, bounds: &Bounds, colour: [u8; 4]) {
        lines::of_box(bounds, &mut |from, to| self.line(from, to, colour));
    }

    /// Draws one shape of a body at its place in the world.
    fn shape(&mut self, _body: BodyId, shape: &DebugShape<'_>, pose: &WorldPose, colour: [u8; 4]) {
        lines::of_shape(shape, pose, &mut |from, to| self.line(from, to, colour));
    }

    /// Writes a text that begins at a point and is turned to whoever looks.
    fn text(&mut self, _at: [f64; 3], _text: &str, _colour: [u8; 4]) {}
}

/// A shape that is drawn, about the origin of its pose. Rounded shapes are drawn as large as they are, with edges.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum DebugShape<'a> {
    /// A box.
    Box {
        /// Half of its edges, metres.
        half: [f32; 3],
    },
    /// A ball.
    Ball {
        /// Its radius, metres.
        radius: f32,
    },
    /// A capsule along y.
    Capsule {
        /// Half of the length without the caps, metres.
        half_height: f32,
        /// Its radius, metres.
        radius: f32,
    },
    /// A cylinder along y.
    Cylinder {
        /// Half of its height, metres.
        half_height: f32,
        /// Its radius, metres.
        radius: f32,
    },
    /// A cone whose tip is at +y.
    Cone {
        /// Half of its height, metres.
        half_height: f32,
        /// The radius of its base, metres.
        radius: f32,
    },
    /// All below the plane y = 0.
    HalfSpace,
    /// A mesh: of triangles, or of lines, which are triangles of which two corners are one.
    Mesh {
        /// Which it is: in one world the same number is the same mesh for ever, so that a renderer may keep what it makes of it.
        number: u32,
        /// Its corners, metres.
        vertices: &'a [[f32; 3]],
        /// Its triangles, counterclockwise from outside.
        triangles: &'a [[u32; 3]],
    },
}

/// The things that [`World::debug_draw`](crate::World::debug_draw) draws, joined by `|`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DebugDrawFlags(u32);

impl DebugDrawFlags {
    /// Bodies by their shapes, in the colour of the region that owns them, greyed while they sleep; fixed ones are grey, sensors faint.
    pub const SHAPES: Self = Self(1);
    /// The boxes around movable bodies.
    pub const AABBS: Self = Self(1 << 1);
    /// The boxes around all that movable bodies may reach in the next three ticks, by which regions predict contacts across borders.
    pub const SWEPT_AABBS: Self = Self(1 << 2);
    /// Centres of mass, as points.
    pub const CENTRES_OF_MASS: Self = Self(1 << 3);
    /// Regions, as boxes within the bounds of the world.
    pub const BORDERS: Self = Self(1 << 4);
    /// Copies of bodies in regions that do not own them, as boxes in the colour of the region that holds them.
    pub const GHOSTS: Self = Self(1 << 5);
    /// Contacts, as points, with their forces as lines.
    pub const CONTACTS: Self = Self(1 << 6);
    /// Joints, as lines from the one body to the joint and on to the other.
    pub const JOINTS: Self = Self(1 << 7);
    /// Linear velocities, as lines.
    pub const VELOCITIES: Self = Self(1 << 8);
    /// Avatars of clients, as points: white if they are this process's own.
    pub const AVATARS: Self = Self(1 << 9);
    /// Ids of movable bodies, as text.
    pub const LABELS: Self = Self(1 << 10);
    /// All of it.
    pub const ALL: Self = Self((1 << 11) - 1);

    /// Returns the flags of these bits; `None` if one means nothing.
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

/// What is drawn, when, where, and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DebugDrawSettings {
    /// What is drawn; by default [`DebugDrawFlags::SHAPES`].
    pub what: DebugDrawFlags,
    /// The time at which bodies, velocities, joints and labels are shown; `None`: as they are after the last step. Boxes, centres of mass, ghosts and
    /// contacts are always of the last step.
    pub time: Option<ViewTime>,
    /// Where: movable bodies with their origin elsewhere, and contacts elsewhere, are left out; `None`: everywhere.
    pub within: Option<Bounds>,
    /// The length of the line of a velocity, metres per m/s.
    pub metres_per_m_s: f32,
    /// The length of the line of a force, metres per newton.
    pub metres_per_n: f32,
}

impl Default for DebugDrawSettings {
    fn default() -> Self {
        let what = DebugDrawFlags::SHAPES;
        Self { what, time: None, within: None, metres_per_m_s: 0.1, metres_per_n: 1e-4 }
    }
}
