//! Generates the random numbers of scenes: the same on every machine and with every version of our
//! dependencies.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rapier3d::prelude::{Rotation, Vector};

/// A seeded source of the few distributions that scenes need. Floats are made here rather than by `rand`,
/// whose sampling may change from one version to the next.
pub(crate) struct Dice(ChaCha8Rng);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Returns a number uniform in `low..high`.
    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        let unit = (self.0.next_u32() >> 8) as f32 / (1 << 24) as f32;
        low + (high - low) * unit
    }

    /// Returns a point uniform in a cube of this half edge around the origin.
    pub(crate) fn in_cube(&mut self, half: f32) -> Vector {
        Vector::new(self.between(-half, half), self.between(-half, half), self.between(-half, half))
    }

    /// Returns a direction uniform on the unit sphere (Archimedes: height and angle are uniform).
    pub(crate) fn direction(&mut self) -> Vector {
        let y = self.between(-1.0, 1.0);
        let (sin, cos) = self.between(0.0, std::f32::consts::TAU).sin_cos();
        let r = (1.0 - y * y).max(0.0).sqrt();
        Vector::new(r * cos, y, r * sin)
    }

    /// Returns a rotation about a random axis by at most this angle.
    pub(crate) fn rotation(&mut self, most_rad: f32) -> Rotation {
        let axis = self.direction();
        Rotation::from_axis_angle(axis, self.between(0.0, most_rad))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_seeds_give_equal_numbers_and_unequal_seeds_do_not() {
        let draw = |seed| (0..8).map(|_| Dice::new(seed).in_cube(1.0)).collect::<Vec<_>>();
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
    }

    #[test]
    fn directions_have_unit_length_and_no_preference() {
        let mut dice = Dice::new(7);
        let mut sum = Vector::ZERO;
        for _ in 0..4_000 {
            let direction = dice.direction();
            assert!((direction.length() - 1.0).abs() < 1e-5);
            sum += direction;
        }
        assert!(sum.length() / 4_000.0 < 0.05, "mean direction {sum}");
    }
}
