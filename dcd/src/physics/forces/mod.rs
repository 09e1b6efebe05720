//! Computes the pushes of explosions and fluids (water, wind) on the bodies that queries find. Each body is
//! pushed once, as its owner's copy has it.

mod explosion;
mod fluid;
mod solid;

pub use explosion::Explosion;
pub use fluid::Fluid;

use rapier3d::glamx::glam::DVec3;
use rapier3d::prelude::*;

use super::collider_id::ColliderId;
use super::convert;
use super::host::{MOST_M_S, RegionHost};
use super::query::BodyFilter;
use crate::protocol::Push;
use crate::space::BodyId;

/// The share of a bound on velocities that pushes use: their rounding stays below the rest.
const BELOW: f32 = 1.0 - 1e-6;

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

    /// Returns the push of an impulse and an angular impulse, scaled down so that it makes the body no faster
    /// than `limit_m_s` and no push may; `None` if it is zero or not finite.
    fn push(&self, linear: Vector, angular: Vector, limit_m_s: f32) -> Option<Push> {
        // In f64 no change overflows.
        let inv_inertia = self.body.mass_properties().effective_world_inv_inertia;
        let (axis, twist) = (angular.as_dvec3().normalize_or_zero(), angular.as_dvec3().length());
        let turns = (inv_inertia * axis.as_vec3()).as_dvec3() * (twist / f64::from(self.share));
        let speeds = linear.as_dvec3() / f64::from(self.mass_kg);
        let velocity = self.body.vels();
        let part = part_within(velocity.linvel, speeds, limit_m_s * BELOW).min(part_within(
            velocity.angvel,
            turns,
            MOST_M_S * BELOW,
        ));
        let (linear, angular) = (linear * part, angular * part);
        let does =
            linear.is_finite() && angular.is_finite() && (linear, angular) != (Vector::ZERO, Vector::ZERO);
        let push = Push { angular: angular.to_array(), ..Push::impulse(self.id, linear.to_array()) };
        does.then_some(push)
    }
}

/// Returns the largest part of a change, up to 1, that leaves a velocity no larger than `most`, or than it is.
fn part_within(before: Vector, change: DVec3, most: f32) -> f32 {
    let before = before.as_dvec3();
    let square = change.length_squared();
    let room = (f64::from(most).powi(2) - before.length_squared()).max(0.0);
    // The larger root s of |before + s change|² = most², or = |before|² where that is more.
    let along = before.dot(change);
    let part = ((along * along + square * room).sqrt() - along) / square;
    // Of no change at all any part will do.
    if square == 0.0 { 1.0 } else { part.clamp(0.0, 1.0) as f32 }
}

impl RegionHost {
    /// Returns the direction against gravity; +y where there is none.
    fn up(&self) -> Vector {
        (-convert::vector(self.settings().gravity)).try_normalize().unwrap_or(Vector::Y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_cut_to_what_leaves_a_velocity_within_its_bound() {
        let [still, fast] = [Vector::ZERO, Vector::X * 8.0];
        assert_eq!(part_within(still, DVec3::ZERO, 10.0), 1.0);
        assert_eq!(part_within(fast, DVec3::X, 10.0), 1.0);
        assert_eq!(part_within(still, DVec3::Y * 40.0, 10.0), 0.25);
        assert_eq!(part_within(fast, DVec3::Y * 12.0, 10.0), 0.5);
        assert_eq!(part_within(fast, DVec3::X * -36.0, 10.0), 0.5);
        assert_eq!(part_within(fast, DVec3::X, 5.0), 0.0, "it gets no faster");
        assert_eq!(part_within(fast, -DVec3::X, 5.0), 1.0, "it gets slower");
        assert_eq!(part_within(still, DVec3::Y * 1e30, 1e6), 1e-24);
    }
}
