//! Computes the impulses of an explosion.

use rapier3d::prelude::*;

use super::solid::{silhouette_m2, volume};
use super::{Target, is_in, solids};
use crate::physics::host::RegionHost;
use crate::physics::query::QueryError;
use crate::protocol::{Push, WorldPose};

/// An explosion: an impulse on all dynamic bodies near a place, away from it, in proportion to how large they
/// look from there. Of two bodies of one size the lighter one thus flies off faster. Walls give no shelter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Explosion {
    /// The centre in world space, metres; finite.
    pub centre: [f64; 3],
    /// The distance up to which the explosion has its full strength, metres, 0 or more, to the nearest point
    /// of a collider.
    pub radius_m: f32,
    /// The distance beyond `radius_m` over which the strength falls off linearly to nothing, metres, 0 or
    /// more.
    pub falloff_m: f32,
    /// The impulse per area of a collider's silhouette, N s/m², finite; negative draws bodies in.
    pub impulse_ns_m2: f32,
    /// Only colliders that are in one of these groups are pushed.
    pub mask: u32,
}

impl Default for Explosion {
    /// Returns an explosion at the origin, of 100 N s/m² within 5 m, falling off to nothing at 10 m.
    fn default() -> Self {
        Self { centre: [0.0; 3], radius_m: 5.0, falloff_m: 5.0, impulse_ns_m2: 100.0, mask: u32::MAX }
    }
}

impl Explosion {
    /// Returns the name and the range of a setting that is out of range; `None` if there is none.
    pub(crate) fn fault(&self) -> Option<(&'static str, &'static str)> {
        let length = |v: f32| v.is_finite() && v >= 0.0;
        if !self.centre.iter().all(|v| v.is_finite()) {
            Some(("centre of an explosion", "finite"))
        } else if !length(self.radius_m) || !length(self.falloff_m) {
            Some(("radius or falloff of an explosion", "0 or more, metres"))
        } else if !self.impulse_ns_m2.is_finite() {
            Some(("impulse of an explosion", "finite"))
        } else {
            None
        }
    }

    fn strength_at(&self, distance_m: f32) -> f32 {
        let beyond_m = distance_m - self.radius_m;
        if beyond_m <= 0.0 { 1.0 } else { (1.0 - beyond_m / self.falloff_m).max(0.0) }
    }
}

impl RegionHost {
    /// Returns the pushes of an explosion, one per body.
    pub(crate) fn pushes_of_explosion(&self, explosion: &Explosion) -> Result<Vec<Push>, QueryError> {
        let reach = Ball::new(explosion.radius_m + explosion.falloff_m);
        let (at, meant) = (WorldPose::at(explosion.centre), is_in(explosion.mask));
        let found = self.queries().intersect_shape(&reach, &at, &solids(&meant))?;
        let (up, limit_m_s) = (self.up(), self.settings().speed_limit_m_s());
        let push = |target: Target<'_>| {
            let (centre, mut linear, mut angular) =
                (target.local(explosion.centre), Vector::ZERO, Vector::ZERO);
            for (collider, pose) in &target.parts {
                let shape = collider.shape();
                let nearest = shape.project_point(pose, centre, true).point;
                let away = [nearest - centre, volume(shape, pose).centre - centre];
                let direction = away.iter().find_map(|way| (way.length() > 1e-4).then(|| way.normalize()));
                let direction = direction.unwrap_or(up);
                let strength = explosion.impulse_ns_m2 * explosion.strength_at((nearest - centre).length());
                let impulse = direction * (strength * silhouette_m2(shape, pose, direction));
                linear += impulse;
                angular += nearest.cross(impulse);
            }
            target.push(linear, angular, limit_m_s)
        };
        Ok(Target::all(self, &found).into_iter().filter_map(push).collect())
    }
}
