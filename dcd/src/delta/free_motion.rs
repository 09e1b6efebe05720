//! Predicts how a body moves that touches nothing: the guesses that both ends of a link make alike, to the same bits on every machine.

use super::quantise::{Quantised, Rotation};
use crate::protocol::StepRecord;

/// The ways in which a body may have gone on: by the two below, or it has come to a stand.
pub(super) const GUESSES: usize = 3;

/// It falls freely.
const FALLS: usize = 0;
/// It keeps its velocity.
const GLIDES: usize = 1;

/// No guess is made of what happened in more ticks than this: what moved for so long did not do so freely.
const LONGEST_TICKS: u64 = 120;

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
    /// Returns that of a world which is stepped so.
    pub fn of(step: &StepRecord) -> Self {
        let dt_s = f64::from(step.dt_s);
        let fall = step.gravity.map(|v| f64::from(v) * dt_s);
        Self { fall, dt_s, parts: f64::from(step.solver_iterations.max(1)) }
    }

    /// Returns what has become of a body after so many ticks, by one of the [`GUESSES`].
    pub(super) fn guess(&self, body: &Quantised, ticks: u64, guess: usize) -> Quantised {
        if body.sleeping || guess > GLIDES || ticks > LONGEST_TICKS {
            return Quantised { velocity: [0; 3], spin: [0; 3], ..*body };
        }
        let n = ticks as f64;
        let fall = if guess == FALLS { self.fall } else { [0.0; 3] };
        let (place, velocity) = (body.place_m(), body.velocity_m_s());
        let way = |axis: usize| {
            let falls = fall[axis] * (n * n + n / self.parts) / 2.0;
            place[axis] + (velocity[axis] * n + falls) * self.dt_s
        };
        let mut guess = *body;
        guess.set_place_m(std::array::from_fn(way));
        guess.set_velocity_m_s(std::array::from_fn(|axis| velocity[axis] + n * fall[axis]));
        guess.set_rotation(turned(body.rotation(), body.spin_rad_s(), n * self.dt_s));
        guess
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
