//! Predicts how a body moves that touches nothing: the guesses that both ends of a link make alike, to the same bits on every machine.

use super::quantise::{Quantised, Rotation};
use crate::protocol::StepRecord;

/// The ways in which a body may have gone on: it falls freely, it keeps its velocity, or it has come to a stand.
pub(super) const GUESSES: usize = 3;

/// No guess is made of what happened in more ticks than this: what moved for so long did not do so freely.
const LONGEST_TICKS: u64 = 120;

/// A client shows a body going on for so long though nothing is told of it, seconds.
pub(crate) const UNTOLD_S: f64 = 2.0;

/// A body whose acceleration is within this part of gravity falls.
pub(crate) const LIKE_FALL: f64 = 0.3;

/// What both ends know of a world: how bodies move that touch nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeMotion {
    /// The velocity that falling adds in a tick, m/s.
    fall: [f64; 3],
    dt_s: f64,
    /// The parts in which the solver takes a tick: the velocity grows in each.
    parts: f64,
}

impl FreeMotion {
    /// Nothing falls: for states that refer to nothing.
    pub(super) const NONE: Self = Self { fall: [0.0; 3], dt_s: 1.0, parts: 1.0 };

    /// Returns that of a world which is stepped so.
    pub fn of(step: &StepRecord) -> Self {
        let dt_s = f64::from(step.dt_s);
        let fall = step.gravity.map(|v| f64::from(v) * dt_s);
        Self { fall, dt_s, parts: f64::from(step.solver_iterations.max(1)) }
    }

    /// Returns what may have become of a body after so many ticks.
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

    /// Returns whether a body fell freely between two states.
    pub(super) fn falls(&self, before: &Quantised, last: &Quantised, ticks: u64) -> bool {
        let (from, to, n) = (before.velocity_m_s(), last.velocity_m_s(), ticks as f64);
        let off = (0..3).map(|axis| (to[axis] - from[axis] - n * self.fall[axis]).powi(2)).sum::<f64>();
        let most = (0..3).map(|axis| (LIKE_FALL * n * self.fall[axis]).powi(2)).sum::<f64>();
        off < most
    }

    /// Returns by how many metres a body is elsewhere than a client shows it that has heard nothing of it for so many ticks: it goes on, and
    /// comes to a stand after [`UNTOLD_S`].
    pub(super) fn error_m(&self, body: &Quantised, falls: bool, ticks: u64, place: [f64; 3]) -> f64 {
        let n = if body.sleeping { 0.0 } else { (ticks as f64).min(UNTOLD_S / self.dt_s) };
        let (from, velocity) = (body.place_m(), body.velocity_m_s());
        let fall = if falls { self.fall } else { [0.0; 3] };
        let way = |axis: usize| (velocity[axis] * n + fall[axis] * n * n / 2.0) * self.dt_s;
        (0..3).map(|axis| (from[axis] + way(axis) - place[axis]).powi(2)).sum::<f64>().sqrt()
    }
}

/// Returns a rotation after a time at this spin. Sine and cosine are those of the crate `libm`: those of a system differ in the last bits
/// from another's.
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
