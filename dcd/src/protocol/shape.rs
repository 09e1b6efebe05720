//! Defines the wire form of shapes. A shape is named by the hash of its content, and a peer is sent it at most once (thesis 4.3.2.5).

use std::collections::BTreeSet;
use std::fmt;

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::Pose;

/// The name of a shape: BLAKE3 of its encoding, cut to 128 bits.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct ShapeHash(pub [u8; 16]);

impl fmt::Display for ShapeHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0[..4].iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The defining numbers of a shape, in metres; acceleration trees are rebuilt by the receiver.
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
    /// Heights in column order, rows, columns, scale, bits of Parry's `HeightFieldFlags`; bits of its
    /// `HeightFieldCellStatus` for each cell in column order, or none if all are whole and cut the usual way.
    HeightField(Vec<f32>, u32, u32, [f32; 3], u8, Vec<u8>),
    /// Half edges, border radius.
    RoundCuboid([f32; 3], f32),
    /// Half height, radius, border radius.
    RoundCylinder(f32, f32, f32),
    /// Half height, radius, border radius.
    RoundCone(f32, f32, f32),
    /// Three points, border radius.
    RoundTriangle([[f32; 3]; 3], f32),
    /// Vertices and the triangles of a closed convex surface, border radius.
    RoundConvexPolyhedron(Vec<[f32; 3]>, Vec<[u32; 3]>, f32),
    /// Edges of a voxel, coordinates of the filled ones in ascending order, each once.
    Voxels([f32; 3], Vec<[i32; 3]>),
    /// Other shapes and where each lies; named, so that no type contains itself.
    Compound(Vec<(Pose, ShapeHash)>),
}

/// The farthest that voxels may lie from the origin of their shape, on each axis.
pub(crate) const MAX_VOXEL: i32 = 1 << 20;

/// Parry keeps voxels in blocks of this edge, and half a kilobyte for each block, however few of its voxels are filled.
const BLOCK: i32 = 8;

/// The most blocks of one shape.
const MAX_BLOCKS: usize = 1 << 16;

/// Returns whether these voxels can be held: not empty, ascending, not too far out and not strewn over too many blocks.
pub(crate) fn voxels_fit(voxels: &[[i32; 3]]) -> bool {
    let block = |voxel: &[i32; 3]| voxel.map(|v| v.div_euclid(BLOCK));
    !voxels.is_empty()
        && voxels.windows(2).all(|pair| pair[0] < pair[1])
        && voxels.as_flattened().iter().all(|v| (-MAX_VOXEL..=MAX_VOXEL).contains(v))
        && voxels.iter().map(block).collect::<BTreeSet<_>>().len() <= MAX_BLOCKS
}

impl ShapeRecord {
    /// Returns the name of this shape.
    pub fn hash(&self) -> ShapeHash {
        // Encoding plain numbers into memory cannot fail.
        let bytes = bincode::encode_to_vec(self, bincode::config::standard()).expect("a shape encodes");
        let mut short = [0; 16];
        short.copy_from_slice(&blake3::hash(&bytes).as_bytes()[..16]);
        ShapeHash(short)
    }

    /// Returns whether it is made of other shapes.
    #[doc(hidden)]
    pub fn is_compound(&self) -> bool {
        matches!(self, Self::Compound(_))
    }

    /// Returns whether clients may use it in queries and as an avatar: it is no mesh, and is bounded. Nor is it made of voxels: Parry
    /// aborts the process where they meet a half-space, and a cast goes along them cell by cell, however small they are.
    #[doc(hidden)]
    pub fn suits_clients(&self) -> bool {
        !matches!(
            self,
            Self::TriMesh(..)
                | Self::Polyline(..)
                | Self::HeightField(..)
                | Self::HalfSpace(..)
                | Self::Voxels(..)
        )
    }

    /// Returns its largest dimension in metres; infinity unless it suits clients. Parts of a compound have their own.
    #[doc(hidden)]
    pub fn largest_m(&self) -> f32 {
        let of = |points: &[[f32; 3]], more: &[f32]| {
            points.as_flattened().iter().chain(more).fold(0.0f32, |most, v| most.max(v.abs()))
        };
        match self {
            Self::Ball(radius) => *radius,
            Self::Cuboid(half) => of(&[*half], &[]),
            Self::Capsule(a, b, radius) => of(&[*a, *b], &[*radius]),
            Self::Cylinder(a, b) | Self::Cone(a, b) => of(&[], &[*a, *b]),
            Self::Segment(ends) => of(ends, &[]),
            Self::Triangle(corners) => of(corners, &[]),
            Self::ConvexPolyhedron(vertices, _) => of(vertices, &[]),
            Self::RoundCuboid(half, border) => of(&[*half], &[*border]),
            Self::RoundCylinder(a, b, border) | Self::RoundCone(a, b, border) => of(&[], &[*a, *b, *border]),
            Self::RoundTriangle(corners, border) => of(corners, &[*border]),
            Self::RoundConvexPolyhedron(vertices, _, border) => of(vertices, &[*border]),
            Self::Compound(parts) => {
                parts.iter().map(|(pose, _)| of(&[pose.translation], &[])).fold(0.0, f32::max)
            }
            Self::HalfSpace(..)
            | Self::TriMesh(..)
            | Self::Polyline(..)
            | Self::HeightField(..)
            | Self::Voxels(..) => f32::INFINITY,
        }
    }

    /// Returns how far it reaches from its origin at most, metres; infinity for a half-space. Parts of a compound have their own.
    #[doc(hidden)]
    pub fn reach_m(&self) -> f32 {
        let of = |points: &[[f32; 3]]| points.as_flattened().iter().fold(0.0f32, |most, v| most.max(v.abs()));
        let largest_m = match self {
            Self::TriMesh(vertices, ..) | Self::Polyline(vertices, ..) => of(vertices),
            Self::HeightField(heights, _, _, scale, ..) => {
                let height = heights.iter().fold(0.0f32, |most, v| most.max(v.abs()));
                of(&[[0.5 * scale[0], height * scale[1], 0.5 * scale[2]]])
            }
            Self::Voxels(edges, cells) => {
                let cell = cells.as_flattened().iter().fold(0, |most, v| v.unsigned_abs().max(most)) + 1;
                cell as f32 * of(&[*edges])
            }
            // A rounded cylinder or a cone is as far across as it is high.
            _ => self.largest_m(),
        };
        // A corner is farther off than along its largest axis.
        3f32.sqrt() * largest_m
    }

    /// Returns how many corners it has, 1 for what is round or made of other shapes: what a contact with it costs.
    #[doc(hidden)]
    pub fn corner_count(&self) -> usize {
        match self {
            Self::ConvexPolyhedron(vertices, _)
            | Self::RoundConvexPolyhedron(vertices, ..)
            | Self::TriMesh(vertices, ..)
            | Self::Polyline(vertices, ..) => vertices.len(),
            Self::Cuboid(_) | Self::RoundCuboid(..) => 8,
            _ => 1,
        }
    }

    /// Returns the shapes that this one is made of.
    #[doc(hidden)]
    pub fn parts(&self) -> impl Iterator<Item = ShapeHash> {
        let parts: &[(Pose, ShapeHash)] = match self {
            Self::Compound(parts) => parts,
            _ => &[],
        };
        parts.iter().map(|&(_, hash)| hash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_strewn_wide_or_out_of_order_do_not_fit() {
        assert!(voxels_fit(&[[-1, 0, 5], [0, 0, 0], [0, 0, 1]]));
        assert!(!voxels_fit(&[]));
        assert!(!voxels_fit(&[[0, 0, 1], [0, 0, 0]]) && !voxels_fit(&[[0; 3], [0; 3]]));
        assert!(!voxels_fit(&[[0, MAX_VOXEL + 1, 0]]) && !voxels_fit(&[[i32::MIN; 3]]));
        let line = |apart: i32| (0..=MAX_BLOCKS as i32).map(|i| [i * apart, 0, 0]).collect::<Vec<_>>();
        assert!(voxels_fit(&line(1)) && !voxels_fit(&line(BLOCK)));
    }
}
