//! Computes the pushes of explosions and fluids (water, wind) on the bodies that queries find. Each body is
//! pushed once, as its owner's copy has it.

mod explosion;
mod fluid;
mod solid;

pub use explosion::Explosion;
pub use fluid::Fluid;

use rapier3d::prelude::*;

use super::collider_id::ColliderId;
use super::convert;
use super::host::RegionHost;
use super::query::BodyFilter;
use crate::protocol::Push;
use crate::space::BodyId;

/// Returns a predicate that tells whether a collider is in one of the groups of `mask`.
fn is_in(mask: u32) -> impl Fn(BodyId, &Collider) -> bool {
    move |_, collider| collider.collision_groups().memberships.intersects(Group::from_bits_retain(mask))
}

/// Returns the filter of explosions and fluids: solid colliders of dynamic bodies that the predicate lets
/// through.
fn solids<'a>(predicate: &'a dyn Fn(BodyId, &Collider) -> bool) -> BodyFilter<'a> {
    let flags = QueryFilterFlags::ONLY_DYNAMIC | QueryFilterFlags::EXCLUDE_SENSORS;
    BodyFilter { flags, predicate: Some(predicate), ..BodyFilter::default() }
}

/// A body and those of its colliders that were found. Poses have the axes of world space and the body's
/// centre of mass as origin, so that numbers are the same whichever region owns the body.
struct Target<'a> {
    id: BodyId,
    body: &'a RigidBody,
    mass_kg: f32,
    /// The number of parts into which the mass of the body is split.
    share: f32,
    centre: [f64; 3],
    parts: Vec<(&'a Collider, Pose)>,
}

impl<'a> Target<'a> {
    /// Returns the bodies of these colliders, which are in order of ids.
    fn all(host: &'a RegionHost, found: &[ColliderId]) -> Vec<Self> {
        found.chunk_by(|a, b| a.body == b.body).filter_map(|parts| Self::of(host, parts)).collect()
    }

    fn of(host: &'a RegionHost, found: &[ColliderId]) -> Option<Self> {
        let id = found.first()?.body;
        let (region, handle) = host.owned(id)?;
        let world = region.physics();
        let body = &world.bodies[handle];
        let (mass_kg, centre) = (host.mass_kg(id)?, host.centre_of_mass(id)?);
        if mass_kg <= 0.0 {
            return None;
        }
        let turn = Pose::from_rotation(*body.rotation());
        let part = |found: &ColliderId| {
            let collider = &world.colliders[*body.colliders().get(found.index)?];
            let mut place = collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
            place.translation -= body.local_center_of_mass();
            Some((collider, turn * place))
        };
        let parts = found.iter().filter_map(part).collect();
        Some(Self { id, body, mass_kg, share: mass_kg / body.mass(), centre, parts })
    }

    /// Returns a point of world space relative to the centre of mass.
    fn local(&self, point: [f64; 3]) -> Vector {
        convert::region_point(self.centre, point)
    }

    /// Returns the push of an impulse and an angular impulse, scaled down so that it changes the body's speed
    /// by at most `limit_m_s`; `None` if it is zero or not finite.
    fn push(&self, linear: Vector, angular: Vector, limit_m_s: f32) -> Option<Push> {
        let kick_m_s = linear.length() / self.mass_kg;
        let part = if kick_m_s > limit_m_s { limit_m_s / kick_m_s } else { 1.0 };
        let (linear, angular) = (linear * part, angular * part);
        let does =
            linear.is_finite() && angular.is_finite() && (linear, angular) != (Vector::ZERO, Vector::ZERO);
        let push = Push { angular: angular.to_array(), ..Push::impulse(self.id, linear.to_array()) };
        does.then_some(push)
    }
}

impl RegionHost {
    /// Returns the direction against gravity; +y where there is none.
    fn up(&self) -> Vector {
        (-convert::vector(self.settings().gravity)).try_normalize().unwrap_or(Vector::Y)
    }
}
