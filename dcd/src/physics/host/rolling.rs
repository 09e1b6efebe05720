//! Counts how far the wheels of vehicles roll, for those who draw them. No step depends on it, and snapshots leave it out.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

use super::RegionHost;
use crate::space::BodyId;

/// The part of its speed that a wheel in the air keeps per tick, as with Rapier's controller.
const KEPT_IN_AIR: f32 = 0.99;

/// The rolling of a wheel; above 0 is forward.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::physics) struct Roll {
    /// The angle rolled so far, radians, -π to π.
    pub angle_rad: f32,
    pub spin_rad_s: f32,
}

/// The rolling of all wheels of vehicles owned here.
pub(super) type Rolls = BTreeMap<BodyId, Vec<Roll>>;

impl RegionHost {
    /// Returns how far a wheel of a vehicle has rolled.
    pub(in crate::physics) fn roll(&self, vehicle: BodyId, wheel: usize) -> Roll {
        self.rolls.get(&vehicle).and_then(|wheels| wheels.get(wheel)).copied().unwrap_or_default()
    }

    /// Rolls the wheels of all vehicles by a tick, and forgets those of vehicles that are gone. A wheel keeps its angle
    /// where its vehicle changes owner.
    pub(super) fn roll_wheels(&mut self) {
        let dt_s = self.settings.dt_s;
        let mut rolls = std::mem::take(&mut self.rolls);
        let mut present = Rolls::new();
        for region in self.sides.iter().map(|side| &side.region) {
            for (id, spins) in region.wheel_spins() {
                let mut wheels = rolls.remove(&id).unwrap_or_default();
                wheels.resize(spins.len(), Roll::default());
                for (wheel, spin) in wheels.iter_mut().zip(spins) {
                    wheel.spin_rad_s = spin.unwrap_or(wheel.spin_rad_s * KEPT_IN_AIR);
                    let angle_rad = wheel.angle_rad + wheel.spin_rad_s * dt_s;
                    wheel.angle_rad = (angle_rad + PI).rem_euclid(TAU) - PI;
                }
                present.insert(id, wheels);
            }
        }
        self.rolls = present;
    }
}
