//! Rays, shapes that move, overlaps, nearest points: many questions a call, of the state as it is now.

use dcd::physics::{BodyFilter, ColliderId, Queries, QueryError, RayHit, ShapeHit, WorldMotion, WorldRay};
use dcd::protocol::Velocity;
use dcd::space::{BodyId, Bounds};
use rapier3d::parry::query::{ShapeCastOptions, ShapeCastStatus};
use rapier3d::prelude::*;

use crate::body::{self, DcdBodyId, check_bits};
use crate::guard::guard;
use crate::motion::check_pose;
use crate::pointer::{self, Room, Sized32, check_not_negative, check_numbers, check_point};
use crate::shape::{self, DcdShapeId};
use crate::status::{DcdStatus, Failure};
use crate::types::DcdPose;
use crate::world::{DcdWorld, World, with};

/// In DcdFilter.flags: overlooks fixed bodies.
pub const DCD_FILTER_NO_FIXED: u32 = 1;
/// In DcdFilter.flags: overlooks kinematic bodies.
pub const DCD_FILTER_NO_KINEMATIC: u32 = 2;
/// In DcdFilter.flags: overlooks dynamic bodies.
pub const DCD_FILTER_NO_DYNAMIC: u32 = 4;
/// In DcdFilter.flags: overlooks sensors.
pub const DCD_FILTER_NO_SENSORS: u32 = 8;
/// In DcdFilter.flags: overlooks all but sensors.
pub const DCD_FILTER_NO_SOLIDS: u32 = 16;

/// What all queries of a call overlook. Start from DCD_FILTER_INIT, which overlooks nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdFilter {
    /// sizeof(DcdFilter).
    pub struct_size: u32,
    /// DCD_FILTER_… bits.
    pub flags: u32,
    /// Groups that the queries belong to: shapes whose mask meets none of them are overlooked. 0 asks no shape's mask.
    pub groups: u32,
    /// Groups that the queries meet; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Bodies that are overlooked; null when there are none.
    pub exclude: *const DcdBodyId,
    /// How many.
    pub exclude_count: usize,
}

// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdFilter {
    const NAME: &'static str = "DcdFilter";
}

/// In flags of a ray or a point: bodies are hollow. A ray that starts inside of one meets its surface from within, and the
/// place nearest to a point inside of one is on its surface.
pub const DCD_QUERY_HOLLOW: u32 = 1;
/// In DcdShapeCast.flags: what the shape overlaps at the start stops it only if it moves farther in.
pub const DCD_QUERY_LEAVE: u32 = 2;

/// In flags of a hit: it began there. The shape overlaps the body at the start, the point lies inside of it.
pub const DCD_HIT_INSIDE: u32 = 1;

/// A ray. Start from DCD_RAY_INIT and give a direction.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdRay {
    /// Where it starts, world space, metres.
    pub origin: [f64; 3],
    /// Where it goes, of any length above 0.
    pub direction: [f32; 3],
    /// How far, metres, above 0; INFINITY is allowed.
    pub max_distance: f32,
    /// A body that it passes through, as the one that looks; null for none.
    pub exclude: DcdBodyId,
    /// Groups that it meets, as in DcdBodyDef.groups; 0xFFFFFFFF for all.
    pub mask: u32,
    /// DCD_QUERY_HOLLOW or 0.
    pub flags: u32,
}

/// A body that a ray met.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdRayHit {
    /// Which; null when the ray met nothing, and then all else is 0.
    pub body: DcdBodyId,
    /// Its user data.
    pub user_data: u64,
    /// Where, world space, metres.
    pub point: [f64; 3],
    /// Outward, of length 1; 0 when the ray starts inside the body.
    pub normal: [f32; 3],
    /// From the origin, metres.
    pub distance: f32,
    /// Which shape of the body, from 0.
    pub part: u32,
    /// Which triangle of a mesh or terrain, which part of a compound; else 0.
    pub subshape: u32,
}

/// A shape that moves straight, and may turn on the way. Start from DCD_SHAPE_CAST_INIT and give shape and motion.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdShapeCast {
    /// Of the same world. It cannot be a mesh or terrain.
    pub shape: DcdShapeId,
    /// Where it starts.
    pub pose: DcdPose,
    /// How far its origin moves, metres.
    pub motion: [f32; 3],
    /// By how much it turns on the way: about this axis of the world, by its length in radians. 0 is cheaper.
    pub turn: [f32; 3],
    /// Metres from a body at which it counts as there, 0 or more; 0 if it turns.
    pub margin: f32,
    /// Groups that it meets; 0xFFFFFFFF for all.
    pub mask: u32,
    /// A body that it passes through; null for none.
    pub exclude: DcdBodyId,
    /// DCD_QUERY_LEAVE or 0.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
}

/// The first body that a moving shape met.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdShapeHit {
    /// Which; null when the shape met nothing, and then all else is 0.
    pub body: DcdBodyId,
    /// Its user data.
    pub user_data: u64,
    /// Where on the body, world space, metres.
    pub point: [f64; 3],
    /// Outward of the body there, of length 1.
    pub normal: [f32; 3],
    /// How much of its way the shape came, 0 to 1.
    pub fraction: f32,
    /// Where on the shape, in its own space, metres.
    pub point_on_shape: [f32; 3],
    /// Outward of the shape there, in its own space.
    pub normal_on_shape: [f32; 3],
    /// Which shape of the body, from 0.
    pub part: u32,
    /// As in DcdRayHit.
    pub subshape: u32,
    /// DCD_HIT_INSIDE or 0.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
}

/// A point. Start from DCD_POINT_QUERY_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdPointQuery {
    /// World space, metres.
    pub point: [f64; 3],
    /// Of dcd_project_points: how far a place may be, metres, 0 or more; INFINITY is allowed.
    pub max_distance: f32,
    /// Groups that it meets; 0xFFFFFFFF for all.
    pub mask: u32,
    /// A body that is overlooked; null for none.
    pub exclude: DcdBodyId,
    /// Of dcd_project_points: DCD_QUERY_HOLLOW or 0; else 0.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
}

/// The place of a body nearest to a point.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdPointHit {
    /// Whose; null when there is none near enough, and then all else is 0.
    pub body: DcdBodyId,
    /// Its user data.
    pub user_data: u64,
    /// Where, world space, metres.
    pub point: [f64; 3],
    /// From the point that was asked about, metres.
    pub distance: f32,
    /// Which shape of the body, from 0.
    pub part: u32,
    /// DCD_HIT_INSIDE or 0.
    pub flags: u32,
    /// 0.
    pub reserved: u32,
}

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

/// Finds the first body that each of `count` rays meets; hits[i] belongs to rays[i]. Sensors count as bodies, unless `filter`
/// overlooks them; a null filter overlooks nothing.
///
/// This and the other queries see bodies where they are now, also those made or moved since the last step. They are answered on
/// the calling thread, and only where the whole world is: in a served world they are DCD_ERR_UNSUPPORTED.
///
/// `rays` and `filter` are read during the call; `hits` has `count` entries.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, or a body to exclude), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for numbers that are not
/// finite, a direction of length 0, a distance that is not above 0, unknown bits, or more than DCD_MAX_ITEMS,
/// DCD_ERR_UNSUPPORTED.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_rays(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdRayHit,
) -> DcdStatus {
    guard("dcd_cast_rays", || {
        // SAFETY: the caller vouches for `count` rays and hits, and for the filter.
        let batch = unsafe { Batch::new(rays, count, "rays", filter)? };
        // SAFETY: as above.
        unsafe {
            batch.each(world, hits, |asked, ray| {
                let straight = straight(ray)?;
                let hit =
                    asked.with_filter(ray.exclude, ray.mask, |queries, f| queries.cast_ray(&straight, f))?;
                Ok(hit.map_or(NO_RAY_HIT, |hit| ray_hit(asked.world, &hit)))
            })
        }
    })
}

/// Finds every body that each of `count` rays meets, a shape of it once, the nearest first. The hits of all rays go to `hits`, which
/// has `cap` entries, and their number to `total`; those of rays[i] end before hits[ends[i]] and begin where those of the ray
/// before end. `ends` has `count` entries. With `cap` 0 `hits` may be null, to ask for the number.
///
/// Errors: as dcd_cast_rays, and DCD_ERR_SMALL_BUFFER (then `total` is written all the same, and nothing else).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_rays_all(
    world: DcdWorld,
    rays: *const DcdRay,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdRayHit,
    cap: usize,
    ends: *mut usize,
    total: *mut usize,
) -> DcdStatus {
    guard("dcd_cast_rays_all", || {
        // SAFETY: the caller vouches for `count` rays and ends, `cap` hits, `total` and the filter.
        let (batch, room) =
            unsafe { (Batch::new(rays, count, "rays", filter)?, Room::new(hits, cap, total, "hits")?) };
        // SAFETY: as above.
        unsafe {
            batch.lists(world, room, ends, |asked, ray| {
                let straight = straight(ray)?;
                let hits = asked
                    .with_filter(ray.exclude, ray.mask, |queries, f| queries.intersect_ray(&straight, f))?;
                Ok(hits.iter().map(|hit| ray_hit(asked.world, hit)).collect())
            })
        }
    })
}

/// Finds the first body that each of `count` moving shapes meets; hits[i] belongs to casts[i].
///
/// `casts` and `filter` are read during the call; `hits` has `count` entries.
/// Errors: as dcd_cast_rays; DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_shapes(
    world: DcdWorld,
    casts: *const DcdShapeCast,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdShapeHit,
) -> DcdStatus {
    guard("dcd_cast_shapes", || {
        // SAFETY: the caller vouches for `count` casts and hits, and for the filter.
        let batch = unsafe { Batch::new(casts, count, "casts", filter)? };
        // SAFETY: as above.
        unsafe {
            batch.each(world, hits, |asked, cast| {
                let hit = cast_shape(asked, cast)?;
                Ok(hit.map_or(NO_SHAPE_HIT, |hit| shape_hit(asked.world, &hit)))
            })
        }
    })
}

/// Finds the place of any body that is nearest to each of `count` points; hits[i] belongs to points[i].
///
/// `points` and `filter` are read during the call; `hits` has `count` entries.
/// Errors: as dcd_cast_rays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_project_points(
    world: DcdWorld,
    points: *const DcdPointQuery,
    count: usize,
    filter: *const DcdFilter,
    hits: *mut DcdPointHit,
) -> DcdStatus {
    guard("dcd_project_points", || {
        // SAFETY: the caller vouches for `count` points and hits, and for the filter.
        let batch = unsafe { Batch::new(points, count, "points", filter)? };
        // SAFETY: as above.
        unsafe {
            batch.each(world, hits, |asked, query| {
                check_point(&query.point, "point")?;
                check_bits(query.flags, DCD_QUERY_HOLLOW, "flags")?;
                let (max_m, solid) = (f64::from(query.max_distance), query.flags & DCD_QUERY_HOLLOW == 0);
                let hit = asked.with_filter(query.exclude, query.mask, |queries, f| {
                    queries.project_point(query.point, max_m, solid, f)
                })?;
                Ok(hit.map_or(NO_POINT_HIT, |hit| DcdPointHit {
                    body: asked.world.mark.body(hit.body),
                    user_data: user_data(asked.world, hit.body),
                    point: hit.point,
                    distance: hit.distance_m as f32,
                    part: hit.collider as u32,
                    flags: if hit.inside { DCD_HIT_INSIDE } else { 0 },
                    reserved: 0,
                }))
            })
        }
    })
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
        let (batch, room) =
            unsafe { (Batch::new(shapes, count, "shapes", filter)?, Room::new(found, cap, total, "found")?) };
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
        let (batch, room) =
            unsafe { (Batch::new(points, count, "points", filter)?, Room::new(found, cap, total, "found")?) };
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
        let (batch, room) =
            unsafe { (Batch::new(boxes, count, "boxes", filter)?, Room::new(found, cap, total, "found")?) };
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

const NOBODY: DcdBodyId = DcdBodyId { v: 0 };
const NO_RAY_HIT: DcdRayHit = DcdRayHit {
    body: NOBODY,
    user_data: 0,
    point: [0.0; 3],
    normal: [0.0; 3],
    distance: 0.0,
    part: 0,
    subshape: 0,
};
const NO_SHAPE_HIT: DcdShapeHit = DcdShapeHit {
    body: NOBODY,
    user_data: 0,
    point: [0.0; 3],
    normal: [0.0; 3],
    fraction: 0.0,
    point_on_shape: [0.0; 3],
    normal_on_shape: [0.0; 3],
    part: 0,
    subshape: 0,
    flags: 0,
    reserved: 0,
};
const NO_POINT_HIT: DcdPointHit = DcdPointHit {
    body: NOBODY,
    user_data: 0,
    point: [0.0; 3],
    distance: 0.0,
    part: 0,
    flags: 0,
    reserved: 0,
};

/// The checked inputs that all queries have.
struct Batch<'a, Q> {
    queries: &'a [Q],
    name: &'static str,
    filter: Option<DcdFilter>,
    exclude: &'a [DcdBodyId],
}

/// A world to ask, and what all queries of a call overlook.
struct Asked<'a> {
    world: &'a World,
    queries: Queries<'a>,
    flags: QueryFilterFlags,
    groups: Group,
    mask: Group,
    /// In order.
    exclude: Vec<BodyId>,
}

impl<'a, Q> Batch<'a, Q> {
    /// # Safety
    /// `queries` has `count` entries; `filter` is null, or it and what it points to are there during the call.
    unsafe fn new(
        queries: *const Q,
        count: usize,
        name: &'static str,
        filter: *const DcdFilter,
    ) -> Result<Self, Failure> {
        // SAFETY: passed on.
        unsafe {
            let queries = pointer::slice(queries, count, name)?;
            if filter.is_null() {
                return Ok(Self { queries, name, filter: None, exclude: &[] });
            }
            let filter = pointer::read_sized(filter, "filter")?;
            let exclude = pointer::slice(filter.exclude, filter.exclude_count, "filter->exclude")?;
            Ok(Self { queries, name, filter: Some(filter), exclude })
        }
    }

    fn ask<'w>(&self, world: &'w World) -> Result<Asked<'w>, Failure> {
        let queries = world.backend.queries()?;
        let (flags, groups, mask) =
            self.filter.map_or((0, 0, u32::MAX), |filter| (filter.flags, filter.groups, filter.mask));
        check_bits(flags, QueryFilterFlags::all().bits(), "filter->flags")?;
        let mut exclude =
            self.exclude.iter().map(|&body| body::find(world, body)).collect::<Result<Vec<_>, _>>()?;
        exclude.sort_unstable();
        let (groups, mask) = (Group::from_bits_retain(groups), Group::from_bits_retain(mask));
        Ok(Asked {
            world,
            queries,
            flags: QueryFilterFlags::from_bits_truncate(flags),
            groups,
            mask,
            exclude,
        })
    }

    /// Answers every query, and says which one is wrong if one is.
    fn answers<R>(
        &self,
        asked: &Asked<'_>,
        answer: impl Fn(&Asked<'_>, &Q) -> Result<R, Failure>,
    ) -> Result<Vec<R>, Failure> {
        let name = self.name;
        let numbered = |(i, query)| {
            answer(asked, query)
                .map_err(|failure| Failure::new(failure.status, format!("{name}[{i}]: {}", failure.message)))
        };
        self.queries.iter().enumerate().map(numbered).collect()
    }

    /// One answer a query, to `hits`.
    ///
    /// # Safety
    /// `hits` has an entry for each query.
    unsafe fn each<R>(
        &self,
        world: DcdWorld,
        hits: *mut R,
        answer: impl Fn(&Asked<'_>, &Q) -> Result<R, Failure>,
    ) -> Result<(), Failure> {
        if !self.queries.is_empty() {
            pointer::check(hits, "hits")?;
        }
        with(world, |world| {
            let answers = self.answers(&self.ask(world)?, answer)?;
            for (i, hit) in answers.into_iter().enumerate() {
                // SAFETY: not null, aligned, and the caller vouches for the entries.
                unsafe { hits.add(i).write(hit) };
            }
            Ok(())
        })
    }

    /// A list of answers a query, all of them to `room`, and where each list ends to `ends`.
    ///
    /// # Safety
    /// `ends` has an entry for each query.
    unsafe fn lists<R>(
        &self,
        world: DcdWorld,
        room: Room<R>,
        ends: *mut usize,
        answer: impl Fn(&Asked<'_>, &Q) -> Result<Vec<R>, Failure>,
    ) -> Result<(), Failure> {
        if !self.queries.is_empty() {
            pointer::check(ends, "ends")?;
        }
        with(world, |world| {
            let answers = self.answers(&self.ask(world)?, answer)?;
            let lengths: Vec<usize> = answers.iter().map(Vec::len).collect();
            room.fill(answers.into_iter().flatten().collect::<Vec<_>>().into_iter())?;
            let mut end = 0;
            for (i, length) in lengths.into_iter().enumerate() {
                end += length;
                // SAFETY: not null, aligned, and the caller vouches for the entries.
                unsafe { ends.add(i).write(end) };
            }
            Ok(())
        })
    }
}

impl Asked<'_> {
    /// Asks with what this one query overlooks besides.
    fn with_filter<R>(
        &self,
        exclude: DcdBodyId,
        mask: u32,
        ask: impl FnOnce(&Queries<'_>, &BodyFilter<'_>) -> Result<R, QueryError>,
    ) -> Result<R, Failure> {
        let own = if exclude.v == 0 { None } else { Some(body::find(self.world, exclude)?) };
        let mask = self.mask & Group::from_bits_retain(mask);
        // A query belongs to no group unless it says so, and then only memberships count.
        let lets = |id: BodyId, collider: &Collider| {
            let groups = collider.collision_groups();
            groups.memberships.intersects(mask)
                && (self.groups.is_empty() || groups.filter.intersects(self.groups))
                && own != Some(id)
                && self.exclude.binary_search(&id).is_err()
        };
        let filter = BodyFilter { flags: self.flags, predicate: Some(&lets), ..BodyFilter::default() };
        ask(&self.queries, &filter).map_err(|error| Failure::argument(error.to_string()))
    }
}

fn user_data(world: &World, id: BodyId) -> u64 {
    world.backend.user_data(id).unwrap_or(0)
}

fn straight(ray: &DcdRay) -> Result<WorldRay, Failure> {
    check_point(&ray.origin, "origin")?;
    check_numbers(&ray.direction, "direction")?;
    check_bits(ray.flags, DCD_QUERY_HOLLOW, "flags")?;
    if Vector::from_array(ray.direction).try_normalize().is_none() {
        return Err(Failure::argument("direction has no length; say where the ray goes"));
    }
    // NaN is not above 0 either.
    if !matches!(ray.max_distance.partial_cmp(&0.0), Some(std::cmp::Ordering::Greater)) {
        return Err(Failure::argument(format!(
            "max_distance is {}; give metres above 0, or INFINITY",
            ray.max_distance
        )));
    }
    let straight = WorldRay::new(ray.origin, ray.direction).up_to(f64::from(ray.max_distance));
    Ok(WorldRay { solid: ray.flags & DCD_QUERY_HOLLOW == 0, ..straight })
}

fn ray_hit(world: &World, hit: &RayHit) -> DcdRayHit {
    DcdRayHit {
        body: world.mark.body(hit.body),
        user_data: user_data(world, hit.body),
        point: hit.point,
        normal: hit.normal,
        distance: hit.distance_m as f32,
        part: hit.collider as u32,
        subshape: hit.subshape,
    }
}

/// A shape to ask with.
fn solid(world: &World, shape: DcdShapeId) -> Result<&SharedShape, Failure> {
    let shape = shape::find(world, shape)?;
    if shape.as_trimesh().is_some() || shape.as_heightfield().is_some() {
        return Err(Failure::argument("meshes and terrain have no inside to ask with; take a hull or a box"));
    }
    Ok(shape)
}

fn cast_shape(asked: &Asked<'_>, cast: &DcdShapeCast) -> Result<Option<ShapeHit>, Failure> {
    check_pose(&cast.pose)?;
    check_numbers(&cast.motion, "motion")?;
    check_numbers(&cast.turn, "turn")?;
    check_not_negative(cast.margin, "margin")?;
    check_bits(cast.flags, DCD_QUERY_LEAVE, "flags")?;
    let shape = solid(asked.world, cast.shape)?;
    let (start, stops) = (cast.pose.into(), cast.flags & DCD_QUERY_LEAVE == 0);
    if cast.turn == [0.0; 3] {
        let options = ShapeCastOptions {
            target_distance: cast.margin,
            stop_at_penetration: stops,
            compute_impact_geometry_on_penetration: true,
            ..ShapeCastOptions::with_max_time_of_impact(1.0)
        };
        return asked.with_filter(cast.exclude, cast.mask, |queries, f| {
            queries.cast_shape(&*shape.0, &start, cast.motion, options, f)
        });
    }
    if cast.margin != 0.0 {
        return Err(Failure::argument(format!("margin is {}; give 0 where turn is given", cast.margin)));
    }
    let velocity = Velocity { linear: cast.motion, angular: cast.turn };
    let motion = WorldMotion { start, local_centre: [0.0; 3], velocity };
    asked.with_filter(cast.exclude, cast.mask, |queries, f| {
        queries.cast_shape_nonlinear(&*shape.0, &motion, 0.0..1.0, stops, f)
    })
}

fn shape_hit(world: &World, hit: &ShapeHit) -> DcdShapeHit {
    DcdShapeHit {
        body: world.mark.body(hit.body),
        user_data: user_data(world, hit.body),
        point: hit.point,
        normal: hit.normal,
        fraction: hit.time_of_impact,
        point_on_shape: hit.point_on_shape,
        normal_on_shape: hit.normal_on_shape,
        part: hit.collider as u32,
        subshape: hit.subshape,
        flags: match hit.status {
            ShapeCastStatus::PenetratingOrWithinTargetDist => DCD_HIT_INSIDE,
            _ => 0,
        },
        reserved: 0,
    }
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
