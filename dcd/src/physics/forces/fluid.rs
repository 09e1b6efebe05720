//! Computes the impulses of water and wind in one step: lift by what is displaced, and drag.

use rapier3d::prelude::*;

use super::solid::{Volume, lift_m2, silhouette_m2, volume, volume_below};
use super::{Target, is_in, solids};
use crate::physics::convert;
use crate::physics::host::RegionHost;
use crate::physics::query::QueryError;
use crate::protocol::Push;
use crate::space::Bounds;

/// A fluid, water or air, that lifts and drags the dynamic bodies in it. What is in it is what has its box (AABB) touch `bounds`, and of
/// that the part below the surface.
///
/// Lift is the weight of the fluid that is displaced, at the centre of that volume (Archimedes). Drag, at the centre of mass, is ½ ρ c A v², by the
/// silhouette A against the motion through the fluid. Faces at a slant are pushed aside (dynamic lift, of sails and falling leaves): the fluid presses on each
/// face that is turned to it by ½ ρ l A v², by the shadow A of the face, against its normal, and of that counts what is across the flow. There is also a slowing down of motion and spin by `damping_per_s` times the mass displaced over
/// the body's own. Neither ever turns a motion about, and dynamic lift never gives more speed across than there is along. The lift of what is displaced comes at once at the beginning of a step and weight over its substeps: between two
/// steps what floats at rest has a velocity of up to half of g dt downwards, 0.08 m/s at 60 steps per second, and does not move.
///
/// Terrain and flat meshes displace nothing and are left alone; the lift of an open mesh means nothing: close it. Of round shapes the border does not count, as in Rapier's masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fluid {
    /// Where it is, in world space; may be infinite.
    pub bounds: Bounds,
    /// How high it stands, metres from the origin of world space against gravity (along +y without gravity); infinite where it fills its bounds.
    pub surface_m: f64,
    /// ρ, kg/m³.
    pub density_kg_m3: f32,
    /// How it flows, or the wind blows, m/s.
    pub velocity_m_s: [f32; 3],
    /// c, without unit: 0.5 for balls, 1 for boxes.
    pub drag: f32,
    /// l, without unit: 1 for plates, 0 for none. What is alike on all sides has none.
    pub lift: f32,
    /// How fast motion and spin die down besides, of a body as heavy as what it displaces, 1/s.
    pub damping_per_s: f32,
    /// Only colliders that are in one of these groups.
    pub mask: u32,
}

impl Default for Fluid {
    /// Still water without end, up to the height of the origin.
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
    /// Returns what is out of range, and its range.
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

    /// Returns the part of a body that is in it, how large that looks to what flows against it along a direction, and where and how
    /// much this presses it aside, m².
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
        // Both are taken at the end of the step, so that they end a motion at most.
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
    /// Returns the angular momentum about the centre of mass.
    fn spin(&self) -> Vector {
        let mass = &self.body.mass_properties().local_mprops;
        let axes = *self.body.rotation() * mass.principal_inertia_local_frame;
        let about = axes.inverse() * self.body.vels().angvel;
        axes * (about * mass.principal_inertia()) * self.share
    }
}

impl RegionHost {
    /// Returns the pushes of a fluid in one step, by body.
    pub(crate) fn pushes_of_fluid(&self, fluid: &Fluid) -> Result<Vec<Push>, QueryError> {
        let found = self.queries().intersect_aabb_conservative(&fluid.bounds, &solids(&is_in(fluid.mask)))?;
        Ok(Target::all(self, &found).iter().filter_map(|target| fluid.push(target, self)).collect())
    }
}
