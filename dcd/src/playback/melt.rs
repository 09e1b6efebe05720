//! Fades out an error that was shown within moments, instead of letting it be seen as a jump.

use nalgebra::Vector3;

use super::motion::{End, Motion, turn_between, turned, vector};

/// The time in which a small error that was shown fades out, seconds.
const MELT_S: f64 = 0.2;

/// The additional time for a larger error, seconds per metre.
const MELT_S_PER_M: f64 = 0.1;

/// The error above which a body jumps at once, metres: a body that slides so far looks stranger than one that
/// jumps.
const JUMP_M: f64 = 3.0;

/// An error that was shown, and how it fades out from a tick on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Melt {
    from: f64,
    seconds: f64,
    way_m: Vector3<f64>,
    speed_m_s: Vector3<f64>,
    turn_rad: Vector3<f64>,
}

impl Melt {
    /// Returns the melt of the error between what was shown (`before`) and what is known now (`bare`), both
    /// at the tick `shown`. That is `former` if the error is still the same, and `None` if there is no error,
    /// or one that must not be hidden.
    pub(crate) fn after(
        former: Option<Self>,
        before: &Motion,
        bare: &Motion,
        shown: f64,
        dt_s: f64,
    ) -> Option<Self> {
        let way_m = Vector3::from(before.pose.translation) - Vector3::from(bare.pose.translation);
        let turn_rad = turn_between(&bare.pose, &before.pose);
        if !way_m.norm().is_finite() || way_m.norm() > JUMP_M {
            return None;
        }
        // What was shown is what is known.
        if way_m.norm() <= 1e-6 && turn_rad.norm() <= 1e-4 {
            return None;
        }
        let seconds = MELT_S + MELT_S_PER_M * way_m.norm();
        // Limited, so that an error that closes does not overshoot.
        let speed_m_s = vector(before.velocity.linear) - vector(bare.velocity.linear);
        let speed_m_s = speed_m_s.cap_magnitude(3.0 * way_m.norm() / seconds);
        let is_same = former.is_some_and(|melt| {
            let mut again = *bare;
            melt.apply(&mut again, shown, dt_s);
            again.distance_m(before) < 1e-6 && turn_between(&again.pose, &before.pose).norm() < 1e-4
        });
        if is_same { former } else { Some(Self { from: shown, seconds, way_m, speed_m_s, turn_rad }) }
    }

    /// Adds what is left of the error at the tick `at` to a motion.
    pub(crate) fn apply(&self, motion: &mut Motion, at: f64, dt_s: f64) {
        let share = (at - self.from) * dt_s / self.seconds;
        if !(0.0..1.0).contains(&share) {
            return;
        }
        let none = End { at: 0.0, speed: 0.0 };
        for axis in 0..3 {
            let error = End { at: self.way_m[axis], speed: self.speed_m_s[axis] };
            let left = error.hermite(none, self.seconds, share);
            motion.pose.translation[axis] += left.at;
            motion.velocity.linear[axis] += left.speed as f32;
        }
        let left = End { at: 1.0, speed: 0.0 }.hermite(none, self.seconds, share).at;
        motion.pose.rotation = turned(&motion.pose, self.turn_rad * left);
    }
}
