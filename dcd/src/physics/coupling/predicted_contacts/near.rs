//! Describes a body near the border: its AABB, the ball around it, and its swept AABB, around all that it may
//! reach in the ticks for which contacts are predicted.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::{AHEAD_TICKS, MARGIN_M};
use crate::physics::convert;
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Region};
use crate::protocol::{BodyKind, NearbyBody};
use crate::space::{Bounds, RegionSet};

/// A body owned here near the border, with its AABB and its swept AABB.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::physics::coupling) struct Near {
    pub link: BodyRef,
    /// Its AABB now, and the radius of a ball around the middle of that box.
    pub(super) bounds: Bounds,
    radius_m: f32,
    pub(super) velocity: Vector,
    /// Its swept AABB: around all that it may reach in the ticks to come.
    pub swept: Bounds,
    pub(super) awake: bool,
    /// The size of its island as sent: the number of its bodies owned here.
    pub(super) island: u16,
    /// Says whether this region keeps its island at home.
    pub(super) stays: bool,
    /// Says whether it is a part of a multibody.
    pub(super) articulated: bool,
    /// Says whether it is a character or a vehicle.
    pub(super) driven: bool,
    /// Says whether it asks for continuous collision detection.
    ccd: bool,
    /// Says whether one of its colliders is a sensor.
    pub(super) senses: bool,
}

impl Near {
    /// Describes a body held here as awake and as an island by itself, swept over the next `ahead_s` seconds.
    pub(super) fn of(region: &Region, link: BodyRef, ahead_s: f32) -> Self {
        let body = &region.physics().bodies[link.handle];
        let turn_m = (body.angvel().length() * ahead_s).min(1.0) * region.slot(link.handle).reach_m;
        let bounds = region.world_bounds(link.handle).grown(MARGIN_M + f64::from(turn_m));
        // A region that drives a vehicle holds what its wheels stand on.
        let wheels_m = f64::from(region.wheels_reach_m(link.handle));
        let bounds = match wheels_m {
            0.0 => bounds,
            wheels_m => bounds.union(&region.world_box(link.handle, wheels_m)),
        };
        let velocity = Vector::from_array(convert::velocity_of(body).linear);
        let velocity = region.heading(link.handle, velocity);
        let swept = bounds.swept(velocity.to_array(), f64::from(ahead_s));
        let traits = &region.slot(link.handle).traits;
        Self {
            link,
            bounds,
            radius_m: radius_of(region, link.handle, &bounds),
            velocity,
            swept,
            awake: true,
            island: 1,
            stays: false,
            articulated: region.is_articulated(link.handle),
            driven: traits.character.is_some() || traits.vehicle.is_some(),
            ccd: body.is_ccd_enabled(),
            senses: body.colliders().iter().any(|&of| region.physics().colliders[of].is_sensor()),
        }
    }

    /// Returns the body as it is sent.
    pub(super) fn nearby(&self) -> NearbyBody {
        NearbyBody {
            id: self.link.id,
            bounds: self.bounds,
            radius_m: self.radius_m,
            velocity: self.velocity.to_array(),
            awake: self.awake,
            island: self.island,
            stays: self.stays || self.articulated || self.driven,
            articulated: self.articulated,
            driven: self.driven,
            ccd: self.ccd,
            goes: RegionSet::EMPTY,
        }
    }

    /// Returns the regions that hold it, or into whose cells it may come.
    pub(super) fn goes(&self, region: &Region, partition: &Partition) -> RegionSet {
        region.slot(self.link.handle).holders.union(partition.touching(&self.swept))
    }

    /// Returns whether contacts move it.
    pub(super) fn is_dynamic(&self, region: &Region) -> bool {
        region.slot(self.link.handle).traits.kind == BodyKind::Dynamic
    }
}

/// Returns the swept AABB of a body held here.
pub(in crate::physics) fn swept_bounds(region: &Region, handle: RigidBodyHandle, tick_s: f32) -> Bounds {
    Near::of(region, BodyRef { id: region.slot(handle).id, handle }, AHEAD_TICKS * tick_s).swept
}

/// Returns the radius of a ball around the middle of a body's AABB that holds all of it, however it turns.
fn radius_of(region: &Region, handle: RigidBodyHandle, bounds: &Bounds) -> f32 {
    let slot = region.slot(handle);
    let corner_m = norm(bounds.size()) / 2.0;
    // Only the box includes what a character or a vehicle asks for.
    if slot.traits.character.is_some() || slot.traits.vehicle.is_some() {
        return corner_m as f32;
    }
    let (middle, centre) = (bounds.centre(), region.centre_of(handle));
    let aside_m = norm(std::array::from_fn(|i| middle[i] - centre[i]));
    corner_m.min(aside_m + f64::from(slot.reach_m) + MARGIN_M) as f32
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}
