//! Stores shapes by content hash: two equal shapes are one object in memory, in every region of the process (thesis 4.3.2.5).

mod hulls;
#[cfg(test)]
mod tests;

pub use hulls::convex_hull;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use parry3d::shape::{
    ConvexPolyhedron, HeightField, HeightFieldCellStatus, HeightFieldFlags, RoundShape, Shape, SharedShape,
    TriMesh, TriMeshFlags, Triangle, TypedShape, Voxels,
};
use parry3d::utils::Array2;
use rapier3d::math::IVector;
use rapier3d::prelude::Vector;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::convert;
use crate::protocol::{
    BodyRecord, BodyTraits, SHAPE_LEAST_M, SHAPE_REACH_M, ShapeHash, ShapeRecord, voxels_fit,
};

/// The error of a shape that cannot be recorded, built or sent.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// The shape is of a kind that has no wire format.
    #[error(
        "shapes of kind {0} cannot travel between regions; use a hull, a mesh or a compound of simple shapes"
    )]
    Unsupported(&'static str),
    /// Parry refuses to build the shape.
    #[error("{what}: Parry refuses to build it ({cause}); check its vertices and indices")]
    Broken {
        /// The kind of shape.
        what: &'static str,
        /// Parry's reason.
        cause: String,
    },
    /// A size is NaN, infinite or beyond what Parry computes with.
    #[error(
        "a {0} has a size that is not from 1e-4 to 1e6 m, or a point that is farther than that from its origin; \
         give it other sizes, or move its points"
    )]
    Size(&'static str),
    /// The shape is a mesh of triangles without area, or a hull in a plane: it has no normal, or no mass.
    #[error(
        "a {0} is flat: a triangle needs an area, of those of a mesh one at least, and a hull a volume; \
         move its points apart, or take a thin box"
    )]
    Flat(&'static str),
    /// No hull of the points can be computed.
    #[error(
        "no hull can be computed around these points in single precision; leave out points that are nearer to one another than a thousandth of the whole, or take a box or a compound"
    )]
    Points,
    /// A dynamic body has no mass, so that nothing would move it.
    #[error(
        "a dynamic body has no mass: a mesh that is not closed, terrain and the like have none by density; give it a mass, or make it fixed or kinematic"
    )]
    Massless,
    /// The shape has no voxels, or too many.
    #[error(
        "a shape of voxels is empty, reaches farther than 2^20 voxels from its origin, or lies in more than 65,536 blocks of 8 × 8 × 8; cut it into several"
    )]
    Voxels,
    /// An avatar cannot have this shape.
    #[error(
        "an avatar cannot be a mesh, terrain, voxels or a half-space; take a hull, a box, or a compound of such"
    )]
    Avatar,
    /// The shape is longer than one message.
    #[error(
        "a shape of a served world is longer than 15.5 MiB, in which it is sent: some 600,000 triangles, 1.3 million voxels or four million heights; divide it into several colliders"
    )]
    TooLong,
    /// The shapes of the world together are longer than a link may queue.
    #[error(
        "the shapes of a served world take {0} MiB to send, and may take 256: share equal ones, and make meshes and terrain coarser"
    )]
    TooMany(usize),
    /// A record refers to a shape that is not known here.
    #[error("shape {0} is not known here; it must be sent before the bodies that use it")]
    Unknown(ShapeHash),
}

/// The number of objects that a library knows again by their addresses.
const RECENT: usize = 16;

/// The number of points for which a shape counts once more when unused shapes are to be forgotten: it takes
/// as much memory as many shapes.
const POINTS: usize = 4096;

/// The shapes of the process, each by the hash of its record.
#[derive(Clone, Default)]
pub struct ShapeLibrary {
    /// Shared with checkpoints until a shape is added or forgotten, the records even then: a mesh may have
    /// megabytes.
    shapes: Arc<BTreeMap<ShapeHash, (Arc<ShapeRecord>, SharedShape)>>,
    /// The number of shapes when unused ones were last forgotten.
    swept: usize,
    /// The number of shapes added since; a larger one counts as several.
    added: usize,
    /// The objects interned last, by their addresses: bodies made one after the other share a few. They are
    /// kept alive, so that an address means the same object.
    recent: [Option<(SharedShape, ShapeHash)>; RECENT],
    /// The traits of the bodies that were described last, the newest kind last. Bodies made one after the
    /// other are mostly of a few kinds, and share their traits.
    pub(super) latest: Vec<Arc<BodyTraits>>,
}

impl ShapeLibrary {
    /// Finds or adds the shape; equal shapes get one hash.
    pub fn intern(&mut self, shape: &SharedShape) -> Result<ShapeHash, ShapeError> {
        let place = recent_place(shape);
        if let Some((known, hash)) = &self.recent[place]
            && Arc::ptr_eq(&known.0, &shape.0)
        {
            return Ok(*hash);
        }
        let record = self.record(shape)?;
        let hash = self.add(record)?;
        self.recent[place] = Some((shape.clone(), hash));
        Ok(hash)
    }

    /// Adds a shape that came as a record. Its parts must be in the library already.
    pub fn add(&mut self, record: ShapeRecord) -> Result<ShapeHash, ShapeError> {
        let hash = record.hash();
        if !self.shapes.contains_key(&hash) {
            let shape = self.build(&record)?;
            self.added += 1 + points_of(&record) / POINTS;
            Arc::make_mut(&mut self.shapes).insert(hash, (Arc::new(record), shape));
        }
        Ok(hash)
    }

    /// Returns the shape with this hash.
    pub fn shape(&self, hash: ShapeHash) -> Result<SharedShape, ShapeError> {
        self.look_at(hash).cloned()
    }

    /// Returns a reference to the shape with this hash, for callers that only look at it.
    pub(super) fn look_at(&self, hash: ShapeHash) -> Result<&SharedShape, ShapeError> {
        self.shapes.get(&hash).map(|(_, shape)| shape).ok_or(ShapeError::Unknown(hash))
    }

    /// Returns a shape that may be part of a compound. Other shapes make Parry stop, or let everything fall
    /// through them.
    fn part(&self, hash: ShapeHash) -> Result<SharedShape, ShapeError> {
        let (record, part) = self.shapes.get(&hash).ok_or(ShapeError::Unknown(hash))?;
        if is_composite(record) {
            let cause = "a part of it is made of parts itself".into();
            return Err(ShapeError::Broken { what: "compound", cause });
        }
        Ok(part.clone())
    }

    /// Returns the record with this hash, to send it on.
    pub fn record_of(&self, hash: ShapeHash) -> Option<&ShapeRecord> {
        self.shapes.get(&hash).map(|(record, _)| &**record)
    }

    /// Returns the shapes that bodies have, each once, with parts before the shapes that they make up.
    pub(crate) fn records_of<'a>(
        &self,
        bodies: impl IntoIterator<Item = &'a BodyRecord>,
    ) -> Vec<(ShapeHash, &ShapeRecord)> {
        let (mut found, mut listed) = (Vec::new(), BTreeSet::new());
        let of_bodies = bodies.into_iter().flat_map(|body| &body.traits.colliders);
        for hash in of_bodies.map(|collider| collider.shape) {
            let parts = self.record_of(hash).into_iter().flat_map(ShapeRecord::parts);
            for hash in parts.chain([hash]) {
                if listed.insert(hash) {
                    found.extend(self.record_of(hash).map(|shape| (hash, shape)));
                }
            }
        }
        found
    }

    /// Returns how many shapes there are.
    pub(crate) fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Returns whether so many shapes have been added since the last [`ShapeLibrary::keep`] that it is worth
    /// looking at so many bodies.
    pub(crate) fn has_grown(&self, bodies: usize) -> bool {
        /// The number of unused shapes that may always be there.
        const UNUSED: usize = 8;
        /// The most bodies that are looked at for each shape added.
        const BODIES: usize = 100;
        self.shapes.len() > 2 * self.swept + UNUSED && self.added >= bodies / BODIES
    }

    /// Forgets all shapes except these and their parts.
    pub(crate) fn keep(&mut self, mut used: BTreeSet<ShapeHash>) {
        let parts = used.iter().flat_map(|&hash| self.record_of(hash)).flat_map(ShapeRecord::parts);
        let parts: Vec<_> = parts.collect();
        used.extend(parts);
        Arc::make_mut(&mut self.shapes).retain(|hash, _| used.contains(hash));
        for place in &mut self.recent {
            place.take_if(|(_, hash)| !used.contains(hash));
        }
        (self.swept, self.added) = (self.shapes.len(), 0);
    }

    /// Forgets these shapes, except those that are used, and parts of others.
    pub(crate) fn forget(&mut self, gone: &BTreeSet<ShapeHash>, mut used: BTreeSet<ShapeHash>) {
        used.extend(self.shapes.keys().filter(|hash| !gone.contains(hash)));
        self.keep(used);
    }

    /// Returns whether so many shapes have been added since the last [`ShapeLibrary::keep`] that it is worth
    /// looking at all of them.
    #[cfg(feature = "net")]
    pub(crate) fn has_gained(&self) -> bool {
        self.added > 8 + self.shapes.len() / 8
    }

    /// Returns the hashes of all shapes.
    #[cfg(any(test, feature = "net", feature = "sim"))]
    pub(crate) fn hashes(&self) -> impl Iterator<Item = ShapeHash> {
        self.shapes.keys().copied()
    }

    /// Returns all records, parts before the compounds that use them.
    pub fn records(&self) -> Vec<ShapeRecord> {
        self.in_order().cloned().collect()
    }

    fn in_order(&self) -> impl Iterator<Item = &ShapeRecord> {
        let records = || self.shapes.values().map(|(record, _)| &**record);
        let is_part = |record: &&ShapeRecord| !record.is_compound();
        records().filter(is_part).chain(records().filter(move |record| !is_part(record)))
    }

    fn record(&mut self, shape: &SharedShape) -> Result<ShapeRecord, ShapeError> {
        let points = |points: &[Vector]| points.iter().map(|p| p.to_array()).collect::<Vec<_>>();
        Ok(match shape.as_typed_shape() {
            TypedShape::Ball(s) => ShapeRecord::Ball(s.radius),
            TypedShape::Cuboid(s) => ShapeRecord::Cuboid(s.half_extents.to_array()),
            TypedShape::Capsule(s) => {
                ShapeRecord::Capsule(s.segment.a.to_array(), s.segment.b.to_array(), s.radius)
            }
            TypedShape::Cylinder(s) => ShapeRecord::Cylinder(s.half_height, s.radius),
            TypedShape::Cone(s) => ShapeRecord::Cone(s.half_height, s.radius),
            TypedShape::Segment(s) => ShapeRecord::Segment([s.a.to_array(), s.b.to_array()]),
            TypedShape::Triangle(s) => {
                ShapeRecord::Triangle([s.a.to_array(), s.b.to_array(), s.c.to_array()])
            }
            TypedShape::HalfSpace(s) => ShapeRecord::HalfSpace(s.normal.to_array()),
            TypedShape::ConvexPolyhedron(s) => self.hull_record(s, ShapeRecord::ConvexPolyhedron)?,
            TypedShape::TriMesh(s) => {
                let vertices = points(s.vertices());
                // Triangles without area carry nothing, and Parry stops at them in a step.
                let mut triangles = s.indices().to_vec();
                triangles.retain(|triangle| has_area(triangle.map(|i| vertices[i as usize])));
                if triangles.is_empty() {
                    return Err(ShapeError::Flat("triangle mesh"));
                }
                ShapeRecord::TriMesh(vertices, triangles, s.flags().bits())
            }
            TypedShape::Polyline(s) => ShapeRecord::Polyline(points(s.vertices()), s.indices().to_vec()),
            TypedShape::HeightField(s) => {
                let cells = s.cells_statuses().data();
                let plain = cells.iter().all(|status| status.is_empty());
                let heights = s.heights();
                ShapeRecord::HeightField(
                    heights.data().to_vec(),
                    heights.nrows() as u32,
                    heights.ncols() as u32,
                    s.scale().to_array(),
                    s.flags().bits(),
                    if plain { Vec::new() } else { cells.iter().map(|status| status.bits()).collect() },
                )
            }
            TypedShape::RoundCuboid(s) => {
                ShapeRecord::RoundCuboid(s.inner_shape.half_extents.to_array(), s.border_radius)
            }
            TypedShape::RoundCylinder(s) => {
                ShapeRecord::RoundCylinder(s.inner_shape.half_height, s.inner_shape.radius, s.border_radius)
            }
            TypedShape::RoundCone(s) => {
                ShapeRecord::RoundCone(s.inner_shape.half_height, s.inner_shape.radius, s.border_radius)
            }
            TypedShape::Compound(s) => {
                let parts = s
                    .shapes()
                    .iter()
                    .map(|(pose, part)| Ok((convert::pose_record(pose), self.intern(part)?)))
                    .collect::<Result<_, ShapeError>>()?;
                ShapeRecord::Compound(parts)
            }
            TypedShape::RoundTriangle(s) => {
                let Triangle { a, b, c } = s.inner_shape;
                ShapeRecord::RoundTriangle([a, b, c].map(|corner| corner.to_array()), s.border_radius)
            }
            TypedShape::RoundConvexPolyhedron(s) => self
                .hull_record(&s.inner_shape, |points, triangles| {
                    ShapeRecord::RoundConvexPolyhedron(points, triangles, s.border_radius)
                })?,
            TypedShape::Voxels(s) => {
                let filled = s.voxels().filter(|voxel| !voxel.state.is_empty());
                let mut voxels: Vec<_> = filled.map(|voxel| voxel.grid_coords.to_array()).collect();
                voxels.sort_unstable();
                let alone = voxels_of(s.voxel_size(), &voxels);
                if s.voxels().any(|voxel| {
                    alone.voxel_state(voxel.grid_coords).is_some_and(|state| state != voxel.state)
                }) {
                    return Err(ShapeError::Unsupported("voxels that know of another shape's"));
                }
                ShapeRecord::Voxels(s.voxel_size().to_array(), voxels)
            }
            _ => return Err(ShapeError::Unsupported("custom")),
        })
    }

    /// Returns the record of a hull, by its points and triangles. It is as Parry has it, unless Parry would then
    /// build another one.
    fn hull_record(
        &self,
        hull: &ConvexPolyhedron,
        record: impl Fn(Vec<[f32; 3]>, Vec<[u32; 3]>) -> ShapeRecord,
    ) -> Result<ShapeRecord, ShapeError> {
        let plain = |points: &[Vector]| points.iter().map(|point| point.to_array()).collect::<Vec<_>>();
        let (points, triangles) = hull.to_trimesh();
        let points = plain(&points);
        let is_thin = extents(&points).into_iter().any(|extent| extent < SHAPE_LEAST_M);
        let as_it_is = record(points, triangles);
        // What is thin is refused for that when it is built.
        if is_thin || self.shapes.contains_key(&as_it_is.hash()) {
            return Ok(as_it_is);
        }
        let (points, triangles) = hulls::lasting(hull)?;
        Ok(record(plain(&points), triangles))
    }

    fn build(&self, record: &ShapeRecord) -> Result<SharedShape, ShapeError> {
        let v = convert::vector;
        let vectors = |points: &[[f32; 3]]| points.iter().map(|&p| v(p)).collect::<Vec<_>>();
        check_sizes(record)?;
        Ok(match record {
            ShapeRecord::Ball(radius) => SharedShape::ball(*radius),
            ShapeRecord::Cuboid([x, y, z]) => SharedShape::cuboid(*x, *y, *z),
            ShapeRecord::Capsule(a, b, radius) => SharedShape::capsule(v(*a), v(*b), *radius),
            ShapeRecord::Cylinder(half_height, radius) => SharedShape::cylinder(*half_height, *radius),
            ShapeRecord::Cone(half_height, radius) => SharedShape::cone(*half_height, *radius),
            ShapeRecord::Segment([a, b]) => SharedShape::segment(v(*a), v(*b)),
            ShapeRecord::Triangle([a, b, c]) => SharedShape::triangle(v(*a), v(*b), v(*c)),
            ShapeRecord::HalfSpace(normal) => SharedShape::halfspace(v(*normal)),
            ShapeRecord::ConvexPolyhedron(vertices, triangles) => {
                SharedShape::new(hull(&vectors(vertices), triangles)?)
            }
            ShapeRecord::RoundConvexPolyhedron(vertices, triangles, border) => {
                let inner_shape = hull(&vectors(vertices), triangles)?;
                SharedShape::new(RoundShape { inner_shape, border_radius: *border })
            }
            ShapeRecord::RoundTriangle([a, b, c], border) => {
                SharedShape::round_triangle(v(*a), v(*b), v(*c), *border)
            }
            ShapeRecord::Voxels(size, voxels) => SharedShape::new(voxels_of(v(*size), voxels)),
            ShapeRecord::TriMesh(vertices, triangles, flags) => {
                let flags = TriMeshFlags::from_bits_truncate(*flags);
                let mesh = TriMesh::with_flags(vectors(vertices), triangles.clone(), flags)
                    .map_err(|e| ShapeError::Broken { what: "triangle mesh", cause: e.to_string() })?;
                SharedShape::new(mesh)
            }
            ShapeRecord::Polyline(vertices, edges) => {
                SharedShape::polyline(vectors(vertices), Some(edges.clone()))
            }
            ShapeRecord::HeightField(heights, rows, columns, scale, flags, cells) => {
                let heights = Array2::new(*rows as usize, *columns as usize, heights.clone());
                let flags = HeightFieldFlags::from_bits_truncate(*flags);
                let mut field = HeightField::with_flags(heights, v(*scale), flags);
                for (index, bits) in cells.iter().enumerate() {
                    let (row, column) = (index % (*rows as usize - 1), index / (*rows as usize - 1));
                    field.set_cell_status(row, column, HeightFieldCellStatus::from_bits_truncate(*bits));
                }
                SharedShape::new(field)
            }
            ShapeRecord::RoundCuboid([x, y, z], border) => SharedShape::round_cuboid(*x, *y, *z, *border),
            ShapeRecord::RoundCylinder(half_height, radius, border) => {
                SharedShape::round_cylinder(*half_height, *radius, *border)
            }
            ShapeRecord::RoundCone(half_height, radius, border) => {
                SharedShape::round_cone(*half_height, *radius, *border)
            }
            ShapeRecord::Compound(parts) => SharedShape::compound(
                parts
                    .iter()
                    .map(|&(pose, hash)| Ok((convert::pose(pose), self.part(hash)?)))
                    .collect::<Result<_, ShapeError>>()?,
            ),
        })
    }
}

/// Returns the place in `recent` where an object is looked for.
fn recent_place(shape: &SharedShape) -> usize {
    // Fibonacci hashing: addresses of objects differ in their middle bits.
    let address = Arc::as_ptr(&shape.0).cast::<()>().addr() as u64;
    (address.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize % RECENT
}

/// Returns whether these shapes can be built, each after its parts, given those known already. Known shapes
/// may be large, so that no part is built that no compound can have.
pub(crate) fn can_build(known: &BTreeMap<ShapeHash, ShapeRecord>, shapes: &[ShapeRecord]) -> bool {
    let mut library = ShapeLibrary::default();
    shapes.iter().all(|shape| {
        let parts: BTreeSet<_> = shape.parts().collect();
        let mut parts = parts.into_iter().filter_map(|part| known.get(&part));
        parts.all(|part| !is_composite(part) && library.add(part.clone()).is_ok())
            && library.add(shape.clone()).is_ok()
    })
}

/// Returns how many points, heights or voxels a shape has; 0 for what has few.
fn points_of(shape: &ShapeRecord) -> usize {
    match shape {
        ShapeRecord::TriMesh(points, ..)
        | ShapeRecord::ConvexPolyhedron(points, ..)
        | ShapeRecord::RoundConvexPolyhedron(points, ..)
        | ShapeRecord::Polyline(points, ..) => points.len(),
        ShapeRecord::HeightField(heights, ..) => heights.len(),
        ShapeRecord::Voxels(_, voxels) => voxels.len(),
        _ => 0,
    }
}

/// Returns whether a shape is made of parts, so that no compound can have it.
fn is_composite(shape: &ShapeRecord) -> bool {
    matches!(
        shape,
        ShapeRecord::TriMesh(..)
            | ShapeRecord::HeightField(..)
            | ShapeRecord::Polyline(..)
            | ShapeRecord::Voxels(..)
            | ShapeRecord::Compound(..)
    )
}

/// Serialises the library as its records, as they travel. The reader builds the shapes anew.
impl Serialize for ShapeLibrary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.in_order().collect::<Vec<_>>())
    }
}

impl<'de> Deserialize<'de> for ShapeLibrary {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut library = Self::default();
        for record in Vec::<ShapeRecord>::deserialize(deserializer)? {
            library.add(record).map_err(D::Error::custom)?;
        }
        Ok(library)
    }
}

fn hull(vertices: &[Vector], triangles: &[[u32; 3]]) -> Result<ConvexPolyhedron, ShapeError> {
    let open = || {
        let cause =
            "its triangles do not close a convex surface, seen from outside all in the same sense".into();
        ShapeError::Broken { what: "convex polyhedron", cause }
    };
    if !is_closed(triangles) {
        return Err(open());
    }
    let hull = hulls::exact(vertices, triangles).ok_or_else(open)?;
    if has_volume(&hull) { Ok(hull) } else { Err(ShapeError::Flat("convex polyhedron")) }
}

/// Returns whether every edge belongs to two triangles that pass it in opposite senses. Parry follows
/// contours from triangle to triangle without checking; where this is not so it stops, or never does.
fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let edges = || triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut seen = BTreeSet::new();
    edges().all(|edge| seen.insert(edge)) && edges().all(|(a, b)| a != b && seen.contains(&(b, a)))
}

fn voxels_of(size: Vector, voxels: &[[i32; 3]]) -> Voxels {
    Voxels::new(size, &voxels.iter().map(|&voxel| IVector::from_array(voxel)).collect::<Vec<_>>())
}

fn check_sizes(record: &ShapeRecord) -> Result<(), ShapeError> {
    let positive = |what, sizes: &[f32]| {
        let good = sizes.iter().all(|size| (SHAPE_LEAST_M..=SHAPE_REACH_M).contains(size));
        if good { Ok(()) } else { Err(ShapeError::Size(what)) }
    };
    let finite = |what, points: &[[f32; 3]]| {
        let good = points.iter().flatten().all(|v| v.abs() <= SHAPE_REACH_M);
        if good { Ok(()) } else { Err(ShapeError::Size(what)) }
    };
    let indexed = |what, vertices: usize, mut indices: std::slice::Iter<'_, u32>, count: usize| {
        let good = count > 0 && indices.all(|&i| (i as usize) < vertices);
        let cause = || "an index points past the vertices, or there is none".to_string();
        if good { Ok(()) } else { Err(ShapeError::Broken { what, cause: cause() }) }
    };
    let hull = |vertices: &Vec<[f32; 3]>, triangles: &Vec<[u32; 3]>| {
        let indices = triangles.as_flattened().iter();
        let what = "convex polyhedron";
        finite(what, vertices).and(indexed(what, vertices.len(), indices, triangles.len()))?;
        positive(what, &extents(vertices))
    };
    match record {
        ShapeRecord::Ball(r) => positive("ball", &[*r]),
        ShapeRecord::Cuboid(half) => positive("cuboid", half),
        ShapeRecord::Capsule(a, b, r) => finite("capsule", &[*a, *b]).and(positive("capsule", &[*r])),
        ShapeRecord::Cylinder(h, r) => positive("cylinder", &[*h, *r]),
        ShapeRecord::Cone(h, r) => positive("cone", &[*h, *r]),
        ShapeRecord::Segment(points) => finite("segment", points),
        ShapeRecord::Triangle(points) => {
            finite("triangle", points)?;
            if has_area(*points) { Ok(()) } else { Err(ShapeError::Flat("triangle")) }
        }
        ShapeRecord::HalfSpace(normal) => finite("half-space", &[*normal]),
        ShapeRecord::ConvexPolyhedron(vertices, triangles) => hull(vertices, triangles),
        ShapeRecord::RoundConvexPolyhedron(vertices, triangles, border) => {
            hull(vertices, triangles).and(positive("round convex polyhedron", &[*border]))
        }
        ShapeRecord::RoundTriangle(points, border) => {
            finite("round triangle", points)?;
            positive("round triangle", &[*border])?;
            if has_area(*points) { Ok(()) } else { Err(ShapeError::Flat("round triangle")) }
        }
        ShapeRecord::Voxels(size, voxels) => {
            positive("voxel", size)?;
            if voxels_fit(voxels) { Ok(()) } else { Err(ShapeError::Voxels) }
        }
        ShapeRecord::TriMesh(vertices, triangles, _) => {
            finite("triangle mesh", vertices)?;
            let indices = triangles.as_flattened().iter();
            indexed("triangle mesh", vertices.len(), indices, triangles.len())?;
            let flat = |triangle: &[u32; 3]| !has_area(triangle.map(|i| vertices[i as usize]));
            if triangles.iter().any(flat) { Err(ShapeError::Flat("triangle mesh")) } else { Ok(()) }
        }
        ShapeRecord::Polyline(vertices, edges) => finite("polyline", vertices).and(indexed(
            "polyline",
            vertices.len(),
            edges.as_flattened().iter(),
            edges.len(),
        )),
        ShapeRecord::HeightField(heights, rows, columns, scale, _, cells) => {
            let corners = (*rows as usize).checked_mul(*columns as usize);
            if *rows < 2
                || *columns < 2
                || corners != Some(heights.len())
                || !(cells.is_empty() || cells.len() == (*rows as usize - 1) * (*columns as usize - 1))
                || !heights.iter().all(|h| h.abs() <= SHAPE_REACH_M)
            {
                return Err(ShapeError::Size("height field"));
            }
            positive("height field", scale)
        }
        ShapeRecord::RoundCuboid(half, border) => {
            positive("round cuboid", half).and(positive("round cuboid", &[*border]))
        }
        ShapeRecord::RoundCylinder(h, r, border) => positive("round cylinder", &[*h, *r, *border]),
        ShapeRecord::RoundCone(h, r, border) => positive("round cone", &[*h, *r, *border]),
        ShapeRecord::Compound(parts) => {
            if parts.is_empty() {
                Err(ShapeError::Size("compound"))
            } else {
                Ok(())
            }
        }
    }
}

/// Returns how far points reach along each axis.
fn extents(points: &[[f32; 3]]) -> [f32; 3] {
    let along = |axis: usize, of: fn(f32, f32) -> f32| points.iter().map(|point| point[axis]).reduce(of);
    std::array::from_fn(|axis| along(axis, f32::max).unwrap_or(0.0) - along(axis, f32::min).unwrap_or(0.0))
}

/// Returns whether a triangle has a normal. A triangle whose height is below the rounding of its longest edge
/// has none to speak of.
fn has_area(points: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = points.map(convert::vector);
    let normal = (b - a).cross(c - a);
    let longest2 = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    normal.length() > 1e-6 * longest2 && normal.try_normalize().is_some()
}

/// Returns whether a hull is more than a sheet. Parry also makes flat hulls, which have no mass.
fn has_volume(hull: &ConvexPolyhedron) -> bool {
    let size = hull.compute_local_aabb().extents();
    hull.mass_properties(1.0).mass() > 1e-6 * size.max_element().powi(3)
}
