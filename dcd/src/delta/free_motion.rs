//! Predicts how a body moves that touches nothing. Both ends of a link make the same guesses, to the same
//! bits on every machine.

use super::quantise::{Quantised, Rotation};
use crate::protocol::StepRecord;

/// The number of guesses: the body falls freely, it keeps its velocity, or it has come to rest.
pub(super) const GUESSES: usize = 3;

/// The most ticks over which free motion is guessed: a body that moved for longer did not do so freely.
const LONGEST_TICKS: u64 = 120;

/// How long a client shows a body going on though nothing is told of it, seconds.
pub(crate) const UNTOLD_S: f64 = 2.0;

/// The deviation from free fall, as a part of gravity, below which a body counts as falling.
pub(crate) const LIKE_FALL: f64 = 0.3;

/// How bodies move that touch nothing, as both ends of a link know it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeMotion {
    /// The velocity that falling adds in a tick, m/s.
    fall: [f64; 3],
    dt_s: f64,
    /// The number of parts in which the solver takes a tick: the velocity grows in each.
    parts: f64,
}

impl FreeMotion {
    /// A world in which nothing falls, for states that refer to nothing.
    pub(super) const NONE: Self = Self { fall: [0.0; 3], dt_s: 1.0, parts: 1.0 };

    /// Returns the free motion in a world that is stepped so.
    pub fn of(step: &StepRecord) -> Self {
        let dt_s = f64::from(step.dt_s);
        let fall = step.gravity.map(|v| f64::from(v) * dt_s);
        Self { fall, dt_s, parts: f64::from(step.solver_iterations.max(1)) }
    }

    /// Returns the guesses of what has become of a body after `ticks` ticks: it falls, it glides, or it
    /// stands.
    pub(super) fn guesses(&self, body: &Quantised, ticks: u64) -> [Quantised; GUESSES] {
        let stands = Quantised { velocity: [0; 3], spin: [0; 3], ..*body };
        if body.sleeping || ticks > LONGEST_TICKS {
            return [stands; GUESSES];
        }
        let (place, velocity) = (body.place_m(), body.velocity_m_s());
        let n = ticks as f64;
        let mut glides = *body;
        glides.set_place_m(std::array::from_fn(|axis| place[axis] + velocity[axis] * n * self.dt_s));
        glides.set_rotation(turned(body.rotation(), body.spin_rad_s(), n * self.dt_s));
        let mut falls = glides;
        let fallen = |axis: usize| {
            let falls = self.fall[axis] * (n * n + n / self.parts) / 2.0;
            place[axis] + (velocity[axis] * n + falls) * self.dt_s
        };
        falls.set_place_m(std::array::from_fn(fallen));
        falls.set_velocity_m_s(std::array::from_fn(|axis| velocity[axis] + n * self.fall[axis]));
        [falls, glides, stands]
    }

    /// Returns whether a body fell freely between two states that are `ticks` apart.
    pub(super) fn falls(&self, before: &Quantised, last: &Quantised, ticks: u64) -> bool {
        let (from, to, n) = (before.velocity_m_s(), last.velocity_m_s(), ticks as f64);
        let off = (0..3).map(|axis| (to[axis] - from[axis] - n * self.fall[axis]).powi(2)).sum::<f64>();
        let most = (0..3).map(|axis| (LIKE_FALL * n * self.fall[axis]).powi(2)).sum::<f64>();
        off < most
    }

    /// Returns the distance in metres between a body's `place` and where a client shows it that has been told
    /// nothing of it for `ticks` ticks. The client shows the body going on, and at rest after [`UNTOLD_S`].
    pub(super) fn error_m(&self, body: &Quantised, falls: bool, ticks: u64, place: [f64; 3]) -> f64 {
        let n = if body.sleeping { 0.0 } else { (ticks as f64).min(UNTOLD_S / self.dt_s) };
        let (from, velocity) = (body.place_m(), body.velocity_m_s());
        let fall = if falls { self.fall } else { [0.0; 3] };
        let way = |axis: usize| (velocity[axis] * n + fall[axis] * n * n / 2.0) * self.dt_s;
        (0..3).map(|axis| (from[axis] + way(axis) - place[axis]).powi(2)).sum::<f64>().sqrt()
    }
}

/// Returns a rotation after a time at this spin. Sine and cosine are those of the crate `libm`, since those
/// of two systems differ in the last bits.
fn turned(rotation: Rotation, spin: [f64; 3], seconds: f64) -> Rotation {
    let rate = spin.iter().map(|v| v * v).sum::<f64>().sqrt();
    if rate == 0.0 {
        return rotation;
    }
    let half = rate * seconds / 2.0;
    let (sin, w) = (libm::sin(half) / rate, libm::cos(half));
    let [x, y, z] = spin.map(|v| v * sin);
    let [i, j, k, r] = rotation;
    [
        w * i + x * r + y * k - z * j,
        w * j + y * r + z * i - x * k,
        w * k + z * r + x * j - y * i,
        w * r - x * i - y * j - z * k,
    ]
}
