//! Finds the bodies that overlap shapes, points and boxes.

use dcd::physics::QueryError;
use dcd::protocol::{Overlap, OverlapQuery, Place, ShapeHash};
use dcd::space::Bounds;
use rapier3d::prelude::SharedShape;

use super::cast::solid;
use super::{Batch, DcdFilter, DcdPointQuery, part_filter, refused, user_data};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdShapeId, DcdWorld};
use crate::material::material;
use crate::pointer::{Room, check_bits, check_point, check_reserved};
use crate::registry::World;
use crate::status::{DcdStatus, Failure};
use crate::types::{DcdPose, check_pose};

/// Shape at a pose, to find what overlaps it. Start from DCD_SHAPE_QUERY_INIT and give a shape.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdShapeQuery {
    /// The shape, of the same world. It cannot be a mesh or terrain.
    pub shape: DcdShapeId,
    /// Pose of the shape.
    pub pose: DcdPose,
    /// Body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// Groups that the shape meets, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Box along the axes of the world (AABB), to find what overlaps it. Corners may be infinite. Start from DCD_BOX_QUERY_INIT and
/// give them.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBoxQuery {
    /// Lowest corner, metres.
    pub min: [f64; 3],
    /// Highest corner, metres.
    pub max: [f64; 3],
    /// Body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// Groups that the box meets, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Body that overlaps a shape, a point or a box.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdOverlap {
    /// The body.
    pub body: DcdBodyId,
    /// User data of the body.
    pub user_data: u64,
    /// Number of the collider of the body, from 0.
    pub collider: u32,
    /// Reserved; always 0.
    pub reserved: u32,
    /// user_data of that collider, such as the number of a material.
    pub material: u64,
}

/// Finds every body that each of `count` shapes overlaps, oldest first. The outputs are as of dcd_cast_rays_all.
///
/// Errors: as dcd_cast_rays_all, DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_shapes(
    world: DcdWorld,
    shapes: *const DcdShapeQuery,
    count: usize,
    filter: *const DcdFilter,
    found: *mut DcdOverlap,
    cap: usize,
    ends: *mut usize,
    total: *mut usize,
) -> DcdStatus {
    // SAFETY: the caller vouches for `count` shapes and ends, `cap` overlaps, `total` and the filter.
    guard("dcd_overlap_shapes", || unsafe {
        overlaps(world, shapes, count, filter, (found, cap), (ends, total))
    })
}

/// Finds every body that each of `count` points lies in, oldest first. The outputs are as of dcd_cast_rays_all.
///
/// Errors: as dcd_cast_rays_all.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_points(
    world: DcdWorld,
    points: *const DcdPointQuery,
    count: usize,
    filter: *const DcdFilter,
    found: *mut DcdOverlap,
    cap: usize,
    ends: *mut usize,
    total: *mut usize,
) -> DcdStatus {
    // SAFETY: the caller vouches for `count` points and ends, `cap` overlaps, `total` and the filter.
    guard("dcd_overlap_points", || unsafe {
        overlaps(world, points, count, filter, (found, cap), (ends, total))
    })
}

/// Finds every body whose AABB (its own box along the axes of the world) touches each of `count` boxes, oldest first. These are the
/// bodies that may overlap the box, found at little cost. The outputs are as of dcd_cast_rays_all.
///
/// Errors: as dcd_cast_rays_all, DCD_ERR_ARGUMENT also for a box whose min is above its max.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_boxes(
    world: DcdWorld,
    boxes: *const DcdBoxQuery,
    count: usize,
    filter: *const DcdFilter,
    found: *mut DcdOverlap,
    cap: usize,
    ends: *mut usize,
    total: *mut usize,
) -> DcdStatus {
    // SAFETY: the caller vouches for `count` boxes and ends, `cap` overlaps, `total` and the filter.
    guard("dcd_overlap_boxes", || unsafe {
        overlaps(world, boxes, count, filter, (found, cap), (ends, total))
    })
}

/// Query that names a place.
pub(super) trait Somewhere {
    /// What an array of such queries is called, and what one of them is.
    const NAME: &'static str;
    const ONE: &'static str;

    /// Returns the place. Its shape has no name yet.
    fn place(&self) -> Result<Place, Failure>;

    /// Returns the shape at the place, if the query has one.
    fn shape<'a>(&self, world: &'a World) -> Result<Option<&'a SharedShape>, Failure>;

    /// Returns the groups that the query meets, and the body that it overlooks.
    fn whom(&self) -> (u32, DcdBodyId);
}

impl Somewhere for DcdShapeQuery {
    const NAME: &'static str = "shapes";
    const ONE: &'static str = "shape";

    fn place(&self) -> Result<Place, Failure> {
        check_pose(&self.pose)?;
        check_reserved(self.reserved)?;
        Ok(Place::Shape(ShapeHash::default(), self.pose.into()))
    }

    fn shape<'a>(&self, world: &'a World) -> Result<Option<&'a SharedShape>, Failure> {
        solid(world, self.shape).map(Some)
    }

    fn whom(&self) -> (u32, DcdBodyId) {
        (self.mask, self.exclude)
    }
}

impl Somewhere for DcdPointQuery {
    const NAME: &'static str = "points";
    const ONE: &'static str = "point";

    fn place(&self) -> Result<Place, Failure> {
        check_point(&self.point, "point")?;
        check_bits(self.flags, 0, "flags")?;
        check_reserved(self.reserved)?;
        Ok(Place::Point(self.point))
    }

    fn shape<'a>(&self, _: &'a World) -> Result<Option<&'a SharedShape>, Failure> {
        Ok(None)
    }

    fn whom(&self) -> (u32, DcdBodyId) {
        (self.mask, self.exclude)
    }
}

impl Somewhere for DcdBoxQuery {
    const NAME: &'static str = "boxes";
    const ONE: &'static str = "box";

    fn place(&self) -> Result<Place, Failure> {
        check_reserved(self.reserved)?;
        if (0..3).all(|i| self.min[i] <= self.max[i]) {
            return Ok(Place::Box(Bounds { min: self.min, max: self.max }));
        }
        Err(refused(QueryError::Box))
    }

    fn shape<'a>(&self, _: &'a World) -> Result<Option<&'a SharedShape>, Failure> {
        Ok(None)
    }

    fn whom(&self) -> (u32, DcdBodyId) {
        (self.mask, self.exclude)
    }
}

/// Returns the place and the filter of a query, of a call whose queries all meet these groups.
pub(super) fn question(world: &World, mask: u32, query: &impl Somewhere) -> Result<OverlapQuery, Failure> {
    let (place, (own, exclude)) = (query.place()?, query.whom());
    Ok(OverlapQuery { place, filter: part_filter(world, mask, own, exclude)? })
}

/// # Safety
/// As [`Batch::new`], [`Room::new`] and [`Batch::lists`].
unsafe fn overlaps<Q: Somewhere + Sync>(
    world: DcdWorld,
    queries: *const Q,
    count: usize,
    filter: *const DcdFilter,
    (found, cap): (*mut DcdOverlap, usize),
    (ends, total): (*mut usize, *mut usize),
) -> Result<(), Failure> {
    // SAFETY: the caller upholds the same contract.
    unsafe {
        let batch = Batch::new(queries, count, Q::NAME, filter)?;
        let room = Room::new(found, cap, total, ["found", "total"])?;
        batch.lists(world, room, ends, |asked, query| {
            let shape = query.shape(asked.world)?;
            let question = question(asked.world, asked.mask, query)?;
            let found = asked.queries.ask_overlap(&asked.filter, |_| shape.cloned(), &question);
            Ok(found.map_err(refused)?.iter().map(|id| overlap(asked.world, &id.into())).collect())
        })
    }
}

pub(super) fn overlap(world: &World, found: &Overlap) -> DcdOverlap {
    DcdOverlap {
        body: world.mark.body(found.body),
        user_data: user_data(world, found.body),
        collider: found.collider,
        reserved: 0,
        material: material(&world.dcd, found.body, found.collider as usize),
    }
}
