//! Shapes as they travel. A shape is named by the hash of its content, and a peer is sent it at most once (thesis 4.3.2.5).

use std::fmt;

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::Pose;

/// BLAKE3 of a shape's encoding, cut to 128 bits.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct ShapeHash(pub [u8; 16]);

impl fmt::Display for ShapeHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0[..4].iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// A shape's defining numbers, in metres; acceleration trees are rebuilt by the receiver.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum ShapeRecord {
    /// Radius.
    Ball(f32),
    /// Half edges.
    Cuboid([f32; 3]),
    /// Ends of the axis, radius.
    Capsule([f32; 3], [f32; 3], f32),
    /// Half height along y, radius.
    Cylinder(f32, f32),
    /// Half height along y, radius.
    Cone(f32, f32),
    /// Two points.
    Segment([[f32; 3]; 2]),
    /// Three points.
    Triangle([[f32; 3]; 3]),
    /// Outward unit normal; solid below.
    HalfSpace([f32; 3]),
    /// Vertices and the triangles of a closed convex surface.
    ConvexPolyhedron(Vec<[f32; 3]>, Vec<[u32; 3]>),
    /// Vertices, triangles and bits of Parry's `TriMeshFlags`.
    TriMesh(Vec<[f32; 3]>, Vec<[u32; 3]>, u16),
    /// Vertices and edges.
    Polyline(Vec<[f32; 3]>, Vec<[u32; 2]>),
    /// Heights in column order, rows, columns, scale, bits of Parry's `HeightFieldFlags`.
    HeightField(Vec<f32>, u32, u32, [f32; 3], u8),
    /// Half edges, border radius.
    RoundCuboid([f32; 3], f32),
    /// Half height, radius, border radius.
    RoundCylinder(f32, f32, f32),
    /// Half height, radius, border radius.
    RoundCone(f32, f32, f32),
    /// Other shapes and where each lies; named, so that no type contains itself.
    Compound(Vec<(Pose, ShapeHash)>),
}

impl ShapeRecord {
    /// The name of this shape.
    pub fn hash(&self) -> ShapeHash {
        // Encoding plain numbers into memory cannot fail.
        let bytes = bincode::encode_to_vec(self, bincode::config::standard()).expect("a shape encodes");
        let mut short = [0; 16];
        short.copy_from_slice(&blake3::hash(&bytes).as_bytes()[..16]);
        ShapeHash(short)
    }

    /// The shapes that this one is made of.
    pub fn parts(&self) -> impl Iterator<Item = ShapeHash> {
        let parts: &[(Pose, ShapeHash)] = match self {
            Self::Compound(parts) => parts,
            _ => &[],
        };
        parts.iter().map(|&(_, hash)| hash)
    }
}
