//! Bounds how fast a client may ask its avatars to move, spin and jump.

use std::f32::consts::FRAC_PI_2;

use crate::protocol::{EnvironmentProperties, Refusal, Vehicle, Velocity};

/// The time whose travel at top speed is the longest jump, seconds. A jump may take an avatar as far as it
/// could have moved since its last jump, up to that length.
const JUMP_S: f32 = 1.0;

/// The speeds, spins and jumps that a world lets clients ask of their avatars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AvatarLimits {
    speed_m_s: f32,
    /// The largest spin: a quarter of a turn per tick. Beyond half a turn per tick the direction of a spin
    /// cannot be told.
    spin_rad_s: f32,
    dt_s: f32,
}

impl AvatarLimits {
    pub(super) fn of(world: &EnvironmentProperties) -> Self {
        let dt_s = world.step.dt_s;
        Self { speed_m_s: world.avatar_speed_limit, spin_rad_s: FRAC_PI_2 / dt_s, dt_s }
    }

    /// Checks a wanted velocity against the limits of speed and spin.
    pub(super) fn allow(&self, velocity: &Velocity) -> Result<(), Refusal> {
        let is_within = |v: &[f32; 3], limit: f32| v.iter().map(|v| v * v).sum::<f32>() <= limit * limit;
        let fits =
            is_within(&velocity.linear, self.speed_m_s) && is_within(&velocity.angular, self.spin_rad_s);
        if fits { Ok(()) } else { Err(Refusal::TooFast) }
    }

    /// Returns whether the top speed of a vehicle's engine is within the limit for avatars.
    pub(super) fn allow_vehicle(&self, vehicle: &Vehicle) -> bool {
        vehicle.top_speed_m_s <= self.speed_m_s
    }

    /// Returns how far an avatar may jump now, metres, if it could jump `left_m` metres this many ticks ago.
    pub(super) fn reach_m(&self, left_m: f64, ticks: u64) -> f64 {
        let earned_m = f64::from(self.speed_m_s * self.dt_s) * ticks as f64;
        (left_m + earned_m).min(self.longest_jump_m())
    }

    /// Returns how far an avatar may jump that has not jumped for a while, metres.
    pub(super) fn longest_jump_m(&self) -> f64 {
        f64::from(self.speed_m_s * JUMP_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::sim_world;

    #[test]
    fn spin_is_bounded_as_speed_is() {
        let world = sim_world(2);
        let limits = AvatarLimits::of(&world);
        let allowed = |linear: f32, angular: f32| {
            limits.allow(&Velocity { linear: [0.0, linear, 0.0], angular: [0.0, 0.0, angular] }).is_ok()
        };
        let quarter_turn = FRAC_PI_2 / world.step.dt_s;
        assert!(allowed(world.avatar_speed_limit, 0.99 * quarter_turn));
        assert!(!allowed(0.0, 1.01 * quarter_turn) && !allowed(1.01 * world.avatar_speed_limit, 0.0));
    }

    #[test]
    fn a_jump_must_be_earned() {
        let world = sim_world(2);
        let limits = AvatarLimits::of(&world);
        let tick_m = f64::from(world.avatar_speed_limit * world.step.dt_s);
        assert_eq!(limits.reach_m(0.0, 0), 0.0);
        assert!((limits.reach_m(1.0, 3) - (1.0 + 3.0 * tick_m)).abs() < 1e-6);
        assert_eq!(limits.reach_m(0.0, u64::MAX), limits.longest_jump_m());
    }
}
