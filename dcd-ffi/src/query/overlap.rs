//! What overlaps shapes, points and boxes.

use dcd::physics::ColliderId;
use dcd::space::Bounds;

use super::cast::solid;
use super::{Batch, DcdFilter, DcdPointQuery, user_data};
use crate::body::{DcdBodyId, check_bits};
use crate::guard::guard;
use crate::motion::check_pose;
use crate::pointer::{Room, check_point};
use crate::shape::DcdShapeId;
use crate::status::DcdStatus;
use crate::types::DcdPose;
use crate::world::{DcdWorld, World};

/// A shape somewhere. Start from DCD_SHAPE_QUERY_INIT and give a shape.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdShapeQuery {
    /// Of the same world. It cannot be a mesh or terrain.
    pub shape: DcdShapeId,
    /// Where.
    pub pose: DcdPose,
    /// A body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// Groups that it meets; 0xFFFFFFFF for all.
    pub mask: u32,
    /// 0.
    pub reserved: u32,
}

/// A box along the axes of the world. Corners may be infinite. Start from DCD_BOX_QUERY_INIT and give them.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBoxQuery {
    /// Lowest corner, metres.
    pub min: [f64; 3],
    /// Highest corner.
    pub max: [f64; 3],
    /// A body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// Groups that it meets; 0xFFFFFFFF for all.
    pub mask: u32,
    /// 0.
    pub reserved: u32,
}

/// A body that overlaps something.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdOverlap {
    /// Which.
    pub body: DcdBodyId,
    /// Its user data.
    pub user_data: u64,
    /// Which shape of it, from 0.
    pub part: u32,
    /// 0.
    pub reserved: u32,
}

/// Finds every body that each of `count` shapes overlaps, by age. Outputs as of dcd_cast_rays_all.
///
/// Errors: as dcd_cast_rays_all; DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
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
    guard("dcd_overlap_shapes", || {
        // SAFETY: the caller vouches for `count` shapes and ends, `cap` overlaps, `total` and the filter.
        let (batch, room) = unsafe {
            (Batch::new(shapes, count, "shapes", filter)?, Room::new(found, cap, total, ["found", "total"])?)
        };
        // SAFETY: as above.
        unsafe {
            batch.lists(world, room, ends, |asked, query| {
                check_pose(&query.pose)?;
                let shape = solid(asked.world, query.shape)?;
                let found = asked.with_filter(query.exclude, query.mask, |queries, f| {
                    queries.intersect_shape(&*shape.0, &query.pose.into(), f)
                })?;
                Ok(overlaps(asked.world, &found))
            })
        }
    })
}

/// Finds every body that each of `count` points lies in, by age. Outputs as of dcd_cast_rays_all.
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
    guard("dcd_overlap_points", || {
        // SAFETY: the caller vouches for `count` points and ends, `cap` overlaps, `total` and the filter.
        let (batch, room) = unsafe {
            (Batch::new(points, count, "points", filter)?, Room::new(found, cap, total, ["found", "total"])?)
        };
        // SAFETY: as above.
        unsafe {
            batch.lists(world, room, ends, |asked, query| {
                check_point(&query.point, "point")?;
                check_bits(query.flags, 0, "flags")?;
                let found = asked.with_filter(query.exclude, query.mask, |queries, f| {
                    queries.intersect_point(query.point, f)
                })?;
                Ok(overlaps(asked.world, &found))
            })
        }
    })
}

/// Finds every body whose own box along the axes of the world touches each of `count` boxes, by age: what may overlap it, at
/// little cost. Outputs as of dcd_cast_rays_all.
///
/// Errors: as dcd_cast_rays_all; DCD_ERR_ARGUMENT also for a box whose min is above its max.
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
    guard("dcd_overlap_boxes", || {
        // SAFETY: the caller vouches for `count` boxes and ends, `cap` overlaps, `total` and the filter.
        let (batch, room) = unsafe {
            (Batch::new(boxes, count, "boxes", filter)?, Room::new(found, cap, total, ["found", "total"])?)
        };
        // SAFETY: as above.
        unsafe {
            batch.lists(world, room, ends, |asked, query| {
                let bounds = Bounds { min: query.min, max: query.max };
                let found = asked.with_filter(query.exclude, query.mask, |queries, f| {
                    queries.intersect_aabb_conservative(&bounds, f)
                })?;
                Ok(overlaps(asked.world, &found))
            })
        }
    })
}

fn overlaps(world: &World, found: &[ColliderId]) -> Vec<DcdOverlap> {
    let overlap = |id: &ColliderId| DcdOverlap {
        body: world.mark.body(id.body),
        user_data: user_data(world, id.body),
        part: id.index as u32,
        reserved: 0,
    };
    found.iter().map(overlap).collect()
}
