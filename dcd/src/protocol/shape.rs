//! Defines the wire form of shapes. A shape is named by the hash of its content, and a peer that has it is
//! not sent it again (thesis 4.3.2.5).

use std::collections::BTreeSet;
use std::fmt;

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{MAX_MESSAGE_BYTES, Pose, encoded_len};

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

/// The numbers that define a shape; lengths are in metres. The receiver rebuilds acceleration trees.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum ShapeRecord {
    /// A ball: radius.
    Ball(f32),
    /// A box: half edges.
    Cuboid([f32; 3]),
    /// A capsule: both ends of its axis, radius.
    Capsule([f32; 3], [f32; 3], f32),
    /// A cylinder: half height along y, radius.
    Cylinder(f32, f32),
    /// A cone: half height along y, radius.
    Cone(f32, f32),
    /// A segment: two points.
    Segment([[f32; 3]; 2]),
    /// A triangle: three points.
    Triangle([[f32; 3]; 3]),
    /// A half-space, solid below its surface: outward unit normal.
    HalfSpace([f32; 3]),
    /// A convex polyhedron: vertices, and the triangles of its closed surface.
    ConvexPolyhedron(Vec<[f32; 3]>, Vec<[u32; 3]>),
    /// A mesh of triangles: vertices, triangles, and bits of Parry's `TriMeshFlags`.
    TriMesh(Vec<[f32; 3]>, Vec<[u32; 3]>, u16),
    /// A polyline: vertices and edges.
    Polyline(Vec<[f32; 3]>, Vec<[u32; 2]>),
    /// A height field: heights in column order, rows, columns, scale, bits of Parry's `HeightFieldFlags`, and
    /// for each cell in column order bits of its `HeightFieldCellStatus`. The last list is empty if all cells
    /// are whole and cut the usual way.
    HeightField(Vec<f32>, u32, u32, [f32; 3], u8, Vec<u8>),
    /// A box with a border: half edges, border radius.
    RoundCuboid([f32; 3], f32),
    /// A cylinder with a border: half height, radius, border radius.
    RoundCylinder(f32, f32, f32),
    /// A cone with a border: half height, radius, border radius.
    RoundCone(f32, f32, f32),
    /// A triangle with a border: three points, border radius.
    RoundTriangle([[f32; 3]; 3], f32),
    /// A convex polyhedron with a border: vertices, the triangles of its closed surface, border radius.
    RoundConvexPolyhedron(Vec<[f32; 3]>, Vec<[u32; 3]>, f32),
    /// Voxels: edges of one voxel, and the coordinates of the filled ones in ascending order, each once.
    Voxels([f32; 3], Vec<[i32; 3]>),
    /// A compound: the pose and hash of each part. Parts are named, so that no type contains itself.
    Compound(Vec<(Pose, ShapeHash)>),
}

/// The farthest that voxels may lie from the origin of their shape, on each axis.
pub(crate) const MAX_VOXEL: i32 = 1 << 20;

/// The edge of the blocks in which Parry keeps voxels. A block takes half a kilobyte, however few of its
/// voxels are filled.
const BLOCK: i32 = 8;

/// The most blocks of one shape.
const MAX_BLOCKS: usize = 1 << 16;

/// Returns whether these voxels can be held: not empty, ascending, not too far out, and not strewn over too
/// many blocks.
pub(crate) fn voxels_fit(voxels: &[[i32; 3]]) -> bool {
    let block = |voxel: &[i32; 3]| voxel.map(|v| v.div_euclid(BLOCK));
    !voxels.is_empty()
        && voxels.windows(2).all(|pair| pair[0] < pair[1])
        && voxels.as_flattened().iter().all(|v| (-MAX_VOXEL..=MAX_VOXEL).contains(v))
        && voxels.iter().map(block).collect::<BTreeSet<_>>().len() <= MAX_BLOCKS
}

/// The most bytes of one shape: as many as fit into a message with what is around them. The tick in which the
/// shape comes has inputs too.
const MAX_SHAPE_BYTES: usize = MAX_MESSAGE_BYTES - (512 << 10);

impl ShapeRecord {
    /// Returns whether the shape fits into one message. The reader counts lists by their size in memory,
    /// before it reads them.
    #[doc(hidden)]
    pub fn can_travel(&self) -> bool {
        let points = |points: &Vec<[f32; 3]>| encoded_len(points);
        let triangles = |triangles: &Vec<[u32; 3]>| encoded_len(triangles).max(size_of_val(&triangles[..]));
        let bytes = match self {
            Self::ConvexPolyhedron(p, t) | Self::TriMesh(p, t, _) | Self::RoundConvexPolyhedron(p, t, _) => {
                points(p) + triangles(t)
            }
            Self::Polyline(p, edges) => points(p) + encoded_len(edges).max(size_of_val(&edges[..])),
            Self::Voxels(_, voxels) => encoded_len(voxels).max(size_of_val(&voxels[..])),
            _ => encoded_len(self),
        };
        bytes <= MAX_SHAPE_BYTES
    }

    /// Returns the hash that names this shape.
    pub fn hash(&self) -> ShapeHash {
        // Encoding plain numbers into memory cannot fail.
        let bytes = bincode::encode_to_vec(self, bincode::config::standard()).expect("a shape encodes");
        let mut short = [0; 16];
        short.copy_from_slice(&blake3::hash(&bytes).as_bytes()[..16]);
        ShapeHash(short)
    }

    /// Returns whether the shape is made of other shapes.
    #[doc(hidden)]
    pub fn is_compound(&self) -> bool {
        matches!(self, Self::Compound(_))
    }

    /// Returns whether clients may use the shape in queries and as an avatar: it is bounded and no mesh.
    /// Voxels are excluded too: Parry aborts the process where they meet a half-space, and a cast goes along
    /// them cell by cell, however small they are.
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

    /// Returns whether a builder may make a fixed body of the shape. Parry aborts the process where voxels
    /// meet a half-space, whoever made either of them.
    pub(crate) fn suits_builders(&self) -> bool {
        !matches!(self, Self::HalfSpace(..) | Self::Voxels(..))
    }

    /// Returns the largest dimension of the shape, metres; infinity unless it suits clients. Parts of a
    /// compound have their own.
    #[doc(hidden)]
    pub fn largest_m(&self) -> f32 {
        match self.suits_clients() {
            true => self.half_extents_m().into_iter().fold(0.0, f32::max),
            false => f32::INFINITY,
        }
    }

    /// Returns how far the shape reaches from its origin at most, metres; infinity for a half-space. Parts of
    /// a compound have their own.
    #[doc(hidden)]
    pub fn reach_m(&self) -> f32 {
        self.half_extents_m().iter().map(|v| v * v).sum::<f32>().sqrt()
    }

    /// Returns half the edges of a box around the shape's origin, along its own axes, that holds it, metres;
    /// infinite for a half-space. The box of a compound holds the origins of its parts.
    pub(crate) fn half_extents_m(&self) -> [f32; 3] {
        let of = |points: &[[f32; 3]], border: f32| {
            [0, 1, 2].map(|k| points.iter().fold(0.0f32, |most, point| most.max(point[k].abs())) + border)
        };
        match self {
            Self::Ball(radius) => [*radius; 3],
            Self::Cuboid(half) => *half,
            Self::RoundCuboid(half, border) => of(&[*half], *border),
            Self::Capsule(a, b, radius) => of(&[*a, *b], *radius),
            Self::Cylinder(half, radius) | Self::Cone(half, radius) => [*radius, *half, *radius],
            Self::RoundCylinder(half, radius, border) | Self::RoundCone(half, radius, border) => {
                of(&[[*radius, *half, *radius]], *border)
            }
            Self::Segment(ends) => of(ends, 0.0),
            Self::Triangle(corners) => of(corners, 0.0),
            Self::RoundTriangle(corners, border) => of(corners, *border),
            Self::ConvexPolyhedron(vertices, _)
            | Self::TriMesh(vertices, ..)
            | Self::Polyline(vertices, ..) => of(vertices, 0.0),
            Self::RoundConvexPolyhedron(vertices, _, border) => of(vertices, *border),
            Self::HeightField(heights, _, _, scale, ..) => {
                let height = heights.iter().fold(0.0f32, |most, v| most.max(v.abs()));
                of(&[[0.5 * scale[0], height * scale[1], 0.5 * scale[2]]], 0.0)
            }
            Self::Voxels(edges, cells) => {
                let cell = |k: usize| cells.iter().fold(0, |most, cell| cell[k].unsigned_abs().max(most)) + 1;
                [0, 1, 2].map(|k| cell(k) as f32 * edges[k].abs())
            }
            Self::HalfSpace(_) => [f32::INFINITY; 3],
            Self::Compound(parts) => {
                let places: Vec<_> = parts.iter().map(|(pose, _)| pose.translation).collect();
                of(&places, 0.0)
            }
        }
    }

    /// Returns the number of corners, which is what a contact with the shape costs; 1 for a shape that is
    /// round or made of others.
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
    use crate::protocol::{Chunk, Message, ToNode, decode, encode};

    #[test]
    fn what_has_a_border_reaches_as_far_as_that() {
        let [a, b] = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(ShapeRecord::Capsule(a, b, 0.5).half_extents_m(), [0.5, 1.5, 0.5]);
        assert_eq!(ShapeRecord::RoundCylinder(1.0, 2.0, 0.25).half_extents_m(), [2.25, 1.25, 2.25]);
        assert_eq!(ShapeRecord::RoundCuboid([1.0, 2.0, 2.0], 1.0).largest_m(), 3.0);
        assert_eq!(ShapeRecord::Cuboid([2.0, 1.0, 2.0]).reach_m(), 3.0);
        assert!(ShapeRecord::HalfSpace(b).reach_m().is_infinite());
    }

    #[test]
    fn voxels_strewn_wide_or_out_of_order_do_not_fit() {
        assert!(voxels_fit(&[[-1, 0, 5], [0, 0, 0], [0, 0, 1]]));
        assert!(!voxels_fit(&[]));
        assert!(!voxels_fit(&[[0, 0, 1], [0, 0, 0]]) && !voxels_fit(&[[0; 3], [0; 3]]));
        assert!(!voxels_fit(&[[0, MAX_VOXEL + 1, 0]]) && !voxels_fit(&[[i32::MIN; 3]]));
        let line = |apart: i32| (0..=MAX_BLOCKS as i32).map(|i| [i * apart, 0, 0]).collect::<Vec<_>>();
        assert!(voxels_fit(&line(1)) && !voxels_fit(&line(BLOCK)));
    }

    #[test]
    fn what_can_travel_is_read_as_it_was_sent_and_one_more_is_not_sent() {
        // An edge of 128, so that they lie in few of Parry's blocks. The list is short when encoded, and long
        // in memory.
        let voxels = |count: i32| {
            let all = (0..count).map(|i| [i >> 14, i >> 7 & 127, i & 127]).collect();
            ShapeRecord::Voxels([0.5; 3], all)
        };
        let most = (MAX_SHAPE_BYTES / 12) as i32;
        assert!(!voxels(most + 1).can_travel());
        let shape = voxels(most);
        assert!(shape.can_travel());
        let message = Message::ToNode(ToNode::Chunk(Chunk::Shapes(vec![shape])));
        assert!(decode(&encode(&message)).unwrap() == message);
        let field = |cells| ShapeRecord::HeightField(vec![0.5; 4_000_000], 2_000, 2_000, [1.0; 3], 0, cells);
        assert!(field(Vec::new()).can_travel());
        assert!(!field(vec![0; 1_999 * 1_999]).can_travel());
    }
}
