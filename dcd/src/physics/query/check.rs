//! Checks the arguments of queries, and defines the error for those that are out of range.

use parry3d::shape::Shape;

use crate::protocol::{WORLD_REACH_M, WorldPose};
use crate::space::Bounds;

/// The error of a query whose arguments are out of range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QueryError {
    /// A number is NaN or infinite, or a point lies beyond 1e9 m.
    #[error("the {0} of the query is not finite, or lies beyond 1e9 m; check its numbers")]
    NotFinite(&'static str),
    /// The direction of a ray has no length.
    #[error("the ray's direction has no length; say where the ray goes, or ask `intersect_point`")]
    NoDirection,
    /// A distance or a time is NaN or negative.
    #[error("the {what} of the query is {value}; give a number of 0 or more, or infinity for no limit")]
    Limit {
        /// The name of the number.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// A rotation is not a unit quaternion, to 1e-3.
    #[error("the {0} of the query has a rotation that is not a unit quaternion; normalise it")]
    Rotation(&'static str),
    /// A half-space or terrain is to rotate on its way.
    #[error("a half-space or terrain cannot rotate in a cast; cast it straight, or another shape onto it")]
    CannotTurn,
    /// A box has its corners in the wrong order, or NaN in them.
    #[error("the box of the query is empty or has NaN in it; its min must not be above its max on any axis")]
    Box,
}

pub(super) fn point(point: [f64; 3], what: &'static str) -> Result<(), QueryError> {
    if point.iter().all(|v| v.abs() <= WORLD_REACH_M) { Ok(()) } else { Err(QueryError::NotFinite(what)) }
}

pub(in crate::physics) fn vector(vector: [f32; 3], what: &'static str) -> Result<(), QueryError> {
    if vector.iter().all(|v| v.is_finite()) { Ok(()) } else { Err(QueryError::NotFinite(what)) }
}

pub(in crate::physics) fn pose(pose: &WorldPose, what: &'static str) -> Result<(), QueryError> {
    point(pose.translation, what)?;
    vector([pose.rotation[0], pose.rotation[1], pose.rotation[2]], what)?;
    if pose.is_valid() { Ok(()) } else { Err(QueryError::Rotation(what)) }
}

/// Checks a limit, which may be infinite.
pub(super) fn limit(value: f64, what: &'static str) -> Result<(), QueryError> {
    // NaN is refused too: it is not above 0.
    if value >= 0.0 { Ok(()) } else { Err(QueryError::Limit { what, value }) }
}

/// Checks that a shape can rotate while it is cast: Parry has no such casts of half-spaces and terrain.
pub(super) fn turns(shape: &dyn Shape) -> Result<(), QueryError> {
    let cannot = shape.as_halfspace().is_some() || shape.as_heightfield().is_some();
    if cannot { Err(QueryError::CannotTurn) } else { Ok(()) }
}

pub(super) fn bounds(bounds: &Bounds) -> Result<(), QueryError> {
    if (0..3).all(|i| bounds.min[i] <= bounds.max[i]) { Ok(()) } else { Err(QueryError::Box) }
}

/// Converts a limit to f32, which Parry compares with finite numbers.
pub(super) fn f32_limit(value: f64) -> f32 {
    value.min(f64::from(f32::MAX)) as f32
}
