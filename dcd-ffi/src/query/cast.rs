//! Casts shapes: finds the first body that each moving shape meets.

use dcd::protocol::{CastAnswer, CastQuery, ShapeHash};
use rapier3d::prelude::SharedShape;

use super::{Batch, DCD_HIT_INSIDE, DCD_QUERY_LEAVE, DcdFilter, NOBODY, part_filter, refused, user_data};
use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdShapeId, DcdWorld};
use crate::material::material;
use crate::pointer::{check_bits, check_not_negative, check_numbers, check_reserved};
use crate::registry::World;
use crate::shape;
use crate::status::{DcdStatus, Failure};
use crate::types::{DcdPose, check_pose};

/// Shape that moves straight, and may turn on the way. Start from DCD_SHAPE_CAST_INIT and give `shape` and `motion`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdShapeCast {
    /// Shape that moves, of the same world. It cannot be a mesh or terrain.
    pub shape: DcdShapeId,
    /// Pose at which the shape starts.
    pub pose: DcdPose,
    /// Way of the shape's origin, metres.
    pub motion: [f32; 3],
    /// Turn of the shape on the way: about this axis of the world, by its length in radians. 0 is cheaper.
    pub turn: [f32; 3],
    /// Distance from a body at which the shape counts as there, metres, 0 or more; 0 if it turns.
    pub margin: f32,
    /// Groups that the shape meets, as bits; 0xFFFFFFFF for all.
    pub mask: u32,
    /// Body that the shape passes through; null for none.
    pub exclude: DcdBodyId,
    /// DCD_QUERY_LEAVE or 0.
    pub flags: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// First body that a moving shape met.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdShapeHit {
    /// The body; null when the shape met nothing, and then all else is 0.
    pub body: DcdBodyId,
    /// User data of the body.
    pub user_data: u64,
    /// Point on the body, world space, metres.
    pub point: [f64; 3],
    /// Normal of the body there, outward, of length 1.
    pub normal: [f32; 3],
    /// Part of its way that the shape came, 0 to 1.
    pub fraction: f32,
    /// Point on the shape, in its own space, metres.
    pub point_on_shape: [f32; 3],
    /// Normal of the shape there, outward, in its own space.
    pub normal_on_shape: [f32; 3],
    /// Number of the collider of the body, from 0.
    pub collider: u32,
    /// Number of the triangle of a mesh or terrain, or of the part of a compound; else 0.
    pub subshape: u32,
    /// DCD_HIT_INSIDE or 0.
    pub flags: u32,
    /// Reserved; always 0.
    pub reserved: u32,
    /// user_data of that collider, such as the number of a material.
    pub material: u64,
}

/// Finds the first body that each of `count` moving shapes meets; hits[i] belongs to casts[i].
///
/// `casts` and `filter` are read during the call; `hits` has `count` entries.
/// Errors: as dcd_cast_rays, DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
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
                let shape = solid(asked.world, cast.shape)?;
                let cast = question(asked.world, asked.mask, cast)?;
                let hit = asked.queries.ask_cast(&asked.filter, &*shape.0, &cast).map_err(refused)?;
                Ok(shape_hit(asked.world, hit.as_ref().map(CastAnswer::from)))
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
    collider: 0,
    subshape: 0,
    flags: 0,
    reserved: 0,
    material: 0,
};

/// Returns the shape with which a query asks.
pub(super) fn solid(world: &World, shape: DcdShapeId) -> Result<&SharedShape, Failure> {
    let shape = shape::find(world, shape)?;
    if shape.as_trimesh().is_some() || shape.as_heightfield().is_some() {
        return Err(Failure::argument("meshes and terrain have no inside to ask with; take a hull or a box"));
    }
    Ok(shape)
}

/// Returns the cast of a call whose queries all meet these groups. Its shape has no name yet.
pub(super) fn question(world: &World, mask: u32, cast: &DcdShapeCast) -> Result<CastQuery, Failure> {
    check_pose(&cast.pose)?;
    check_numbers(&cast.motion, "motion")?;
    check_numbers(&cast.turn, "turn")?;
    check_not_negative(cast.margin, "margin")?;
    check_bits(cast.flags, DCD_QUERY_LEAVE, "flags")?;
    check_reserved(cast.reserved)?;
    if cast.turn != [0.0; 3] && cast.margin != 0.0 {
        return Err(Failure::argument(format!("margin is {}; give 0 where turn is given", cast.margin)));
    }
    Ok(CastQuery {
        shape: ShapeHash::default(),
        pose: cast.pose.into(),
        motion: cast.motion,
        turn: cast.turn,
        margin_m: cast.margin,
        leaves: cast.flags & DCD_QUERY_LEAVE != 0,
        filter: part_filter(world, mask, cast.mask, cast.exclude)?,
    })
}

pub(super) fn shape_hit(world: &World, hit: Option<CastAnswer>) -> DcdShapeHit {
    let Some(hit) = hit else { return NO_SHAPE_HIT };
    DcdShapeHit {
        body: world.mark.body(hit.body),
        user_data: user_data(world, hit.body),
        point: hit.point,
        normal: hit.normal,
        fraction: hit.fraction,
        point_on_shape: hit.point_on_shape,
        normal_on_shape: hit.normal_on_shape,
        collider: hit.collider,
        subshape: hit.subshape,
        flags: if hit.inside { DCD_HIT_INSIDE } else { 0 },
        reserved: 0,
        material: material(&world.dcd, hit.body, hit.collider as usize),
    }
}
