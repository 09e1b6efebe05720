//! Shapes that move.

use dcd::physics::{ShapeHit, WorldMotion};
use dcd::protocol::Velocity;
use rapier3d::parry::query::{ShapeCastOptions, ShapeCastStatus};
use rapier3d::prelude::SharedShape;

use super::{Asked, Batch, DCD_HIT_INSIDE, DCD_QUERY_LEAVE, DcdFilter, NOBODY, user_data};
use crate::body::{DcdBodyId, check_bits};
use crate::guard::guard;
use crate::motion::check_pose;
use crate::pointer::{check_not_negative, check_numbers};
use crate::shape::{self, DcdShapeId};
use crate::status::{DcdStatus, Failure};
use crate::types::DcdPose;
use crate::world::{DcdWorld, World};

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

/// A shape to ask with.
pub(super) fn solid(world: &World, shape: DcdShapeId) -> Result<&SharedShape, Failure> {
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
