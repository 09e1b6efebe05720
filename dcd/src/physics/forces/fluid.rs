//! Computes the impulses of a fluid (water, wind) on bodies in one step: buoyancy, drag, dynamic lift and
//! damping.

use rapier3d::prelude::*;

use super::solid::{Volume, lift_m2, silhouette_m2, volume, volume_below};
use super::{Target, is_in, solids};
use crate::physics::convert;
use crate::physics::host::RegionHost;
use crate::physics::query::QueryError;
use crate::protocol::Push;
use crate::space::Bounds;

/// A fluid, water or air, that lifts and drags the dynamic bodies in it. A body is in it if its box (AABB)
/// touches `bounds`; of that body the part below the surface counts.
///
/// - **Buoyancy** is the weight of the displaced fluid, at the centre of the displaced volume (Archimedes).
///   It acts at once at the beginning of a step, and weight over its substeps. Between two steps a floating
///   body at rest thus has a velocity of up to half of g dt downwards, 0.08 m/s at 60 steps per second, and
///   does not move.
/// - **Drag** acts at the centre of mass: ½ ρ c A v², with the silhouette A against the motion through the
///   fluid.
/// - **Dynamic lift** pushes faces at a slant aside (sails, falling leaves). The fluid presses on each face
///   that is turned to it by ½ ρ l A v², with the face's shadow A, against the face's normal. Only the part
///   across the flow counts. It never gives more speed across the flow than there is along it.
/// - **Damping** slows motion and spin down by `damping_per_s` times the displaced mass over the body's own.
///
/// Drag and damping never reverse a motion. Whatever the numbers, a fluid makes no body faster than the world's
/// speed limit.
///
/// Terrain and flat meshes displace nothing and are left alone. The lift of an open mesh means nothing: close
/// it. The border of round shapes does not count, as in Rapier's masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fluid {
    /// The box of the fluid in world space, metres; may be infinite.
    pub bounds: Bounds,
    /// The height of the surface, metres from the origin of world space against gravity (along +y without
    /// gravity). Infinite where the fluid fills its bounds.
    pub surface_m: f64,
    /// The density ρ, kg/m³; 0 to 1,000,000.
    pub density_kg_m3: f32,
    /// The velocity of the fluid, or of the wind, m/s; finite.
    pub velocity_m_s: [f32; 3],
    /// The drag coefficient c, without unit, 0 to 1,000,000: 0.5 for balls, 1 for boxes.
    pub drag: f32,
    /// The coefficient l of dynamic lift, without unit, 0 to 1,000,000: 1 for plates, 0 for none. A shape
    /// that is the same on all sides has none.
    pub lift: f32,
    /// The further rate at which motion and spin die down, 1/s, 0 to 1,000,000, for a body as heavy as the
    /// fluid that it displaces.
    pub damping_per_s: f32,
    /// Only colliders that are in one of these groups are pushed.
    pub mask: u32,
}

impl Default for Fluid {
    /// Returns still water without end, up to the height of the origin.
    fn default() -> Self {
        Self {
            bounds: Bounds { min: [f64::NEG_INFINITY; 3], max: [f64::INFINITY; 3] },
            surface_m: 0.0,
            density_kg_m3: 1000.0,
            velocity_m_s: [0.0; 3],
            drag: 1.0,
            lift: 0.0,
            damping_per_s: 1.0,
            mask: u32::MAX,
        }
    }
}

impl Fluid {
    /// Returns the name and the range of a setting that is out of range; `None` if there is none.
    pub(crate) fn fault(&self) -> Option<(&'static str, &'static str)> {
        let positive = |v: f32| (0.0..=1e6).contains(&v);
        if !(0..3).all(|i| self.bounds.min[i] <= self.bounds.max[i]) {
            Some(("bounds of a fluid", "min not above max, without NaN"))
        } else if self.surface_m.is_nan() {
            Some(("surface of a fluid", "no NaN"))
        } else if ![self.density_kg_m3, self.drag, self.lift, self.damping_per_s].into_iter().all(positive) {
            Some(("density, drag, lift or damping of a fluid", "0 to 1,000,000"))
        } else if !self.velocity_m_s.iter().all(|v| v.is_finite()) {
            Some(("velocity of a fluid", "finite"))
        } else {
            None
        }
    }

    /// Returns the part of a body that is in the fluid, its silhouette against a flow along a direction, m²,
    /// and the area by which this flow presses it aside, m², as a vector.
    fn holds(&self, target: &Target<'_>, up: Vector, along: Vector) -> (Volume, f32, Vector) {
        let centre_m: f64 = (0..3).map(|i| target.centre[i] * f64::from(up[i])).sum();
        let height_m = (self.surface_m - centre_m).clamp(-1e30, 1e30) as f32;
        let parts = target.parts.iter().map(|(collider, pose)| {
            let (shape, all) = (collider.shape(), volume(collider.shape(), pose));
            let within = volume_below(shape, pose, up, height_m);
            let part = if all.m3 > 0.0 { within.m3 / all.m3 } else { 0.0 };
            if part <= 0.0 {
                return (within, 0.0, Vector::ZERO);
            }
            let aside = if self.lift > 0.0 { lift_m2(shape, pose, along) } else { Vector::ZERO };
            (within, part * silhouette_m2(shape, pose, along), aside * part)
        });
        parts.fold((Volume::default(), 0.0, Vector::ZERO), |(all, area, aside), (one, more, further)| {
            (all.joined(one), area + more, aside + further)
        })
    }

    fn push(&self, target: &Target<'_>, host: &RegionHost) -> Option<Push> {
        let (dt_s, gravity) = (host.settings().dt_s, convert::vector(host.settings().gravity));
        let (body, up) = (target.body, host.up());
        let through = body.vels().linvel - convert::vector(self.velocity_m_s);
        let speed_m_s = through.length();
        let along = through.try_normalize().unwrap_or(up);
        let (within, area_m2, aside_m2) = self.holds(target, up, along);
        let displaced_kg = self.density_kg_m3 * within.m3;
        if displaced_kg <= 0.0 {
            return None;
        }
        let buoyancy = gravity * (-displaced_kg * dt_s);
        // Drag and damping follow from the velocity at the end of the step, so that they end a motion at
        // most.
        let damping_per_s = self.damping_per_s * displaced_kg / target.mass_kg;
        let drag_per_s = 0.5 * self.density_kg_m3 * self.drag * area_m2 * speed_m_s / target.mass_kg;
        let lost = |rate_per_s: f32| rate_per_s * dt_s / (1.0 + rate_per_s * dt_s);
        let aside = aside_m2.try_normalize().unwrap_or(Vector::ZERO);
        let lift_per_s =
            0.5 * self.density_kg_m3 * self.lift * aside_m2.length() * speed_m_s / target.mass_kg;
        let linear = buoyancy - through * (target.mass_kg * lost(drag_per_s + damping_per_s))
            + aside * (target.mass_kg * speed_m_s * lost(lift_per_s));
        let angular = within.centre.cross(buoyancy) - target.spin() * lost(damping_per_s);
        target.push(linear, angular, host.settings().speed_limit_m_s())
    }
}

impl Target<'_> {
    /// Returns the angular momentum of the whole body about its centre of mass.
    fn spin(&self) -> Vector {
        let mass = &self.body.mass_properties().local_mprops;
        let axes = *self.body.rotation() * mass.principal_inertia_local_frame;
        let about = axes.inverse() * self.body.vels().angvel;
        axes * (about * mass.principal_inertia()) * self.share
    }
}

impl RegionHost {
    /// Returns the pushes of a fluid in one step, one per body.
    pub(crate) fn pushes_of_fluid(&self, fluid: &Fluid) -> Result<Vec<Push>, QueryError> {
        let found = self.queries().intersect_aabb_conservative(&fluid.bounds, &solids(&is_in(fluid.mask)))?;
        Ok(Target::all(self, &found).iter().filter_map(|target| fluid.push(target, self)).collect())
    }
}
