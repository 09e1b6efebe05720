//! Quantises the state of a body to whole numbers, and turns these back into a state.

use crate::protocol::{Check, CodecError, SharedState, Velocity, WorldPose};
use crate::space::{BodyId, Epoch, RegionId};

/// Steps per metre.
const PLACE: f64 = 2048.0;
/// Steps per m/s.
const VELOCITY: f64 = 512.0;
/// Steps per rad/s.
const SPIN: f64 = 256.0;
/// The highest speed that is told, in steps: a million m/s.
const FASTEST: f64 = (1 << 29) as f64;
/// Steps from 0 to 1/√2, the most that a component of a unit quaternion can be without being the largest.
const TURN: f64 = 2047.0;
/// The size down to which the component that was left out before is still left out, though another may be
/// larger.
const LEAST_LEFT_OUT: f64 = 0.5;

/// The same for a state that comes from this grid, with the component that was left out of it: that one is
/// computed from the others, and may have become a little smaller.
const STILL_LEFT_OUT: f64 = 0.45;

/// The most steps by which a state that is told as predicted may differ from the real one: in place and turn,
/// and in velocity and spin.
const NEAR: (i64, i64) = (1, 2);

/// A rotation as a unit quaternion x, y, z, w.
pub(super) type Rotation = [f64; 4];

/// The state of a body in whole numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quantised {
    pub owner: u32,
    pub epoch: u64,
    pub place: [i64; 3],
    /// The component of the rotation that is left out: the largest, or one that was the largest. The others
    /// follow in order ("smallest three").
    pub left_out: u8,
    pub turn: [i16; 3],
    pub velocity: [i32; 3],
    pub spin: [i32; 3],
    pub sleeping: bool,
}

impl Quantised {
    /// Quantises a state. The component of the rotation that was left out before is left out again, if it is
    /// large enough.
    pub(super) fn of(state: &SharedState, left_out: Option<u8>) -> Self {
        Self::leaving_out(state, left_out, LEAST_LEFT_OUT)
    }

    /// Quantises again a state that comes from this grid, to the same numbers. `left_out` is the component
    /// that was left out of its rotation.
    pub(super) fn again(state: &SharedState, left_out: u8) -> Self {
        Self::leaving_out(state, Some(left_out), STILL_LEFT_OUT)
    }

    fn leaving_out(state: &SharedState, left_out: Option<u8>, least: f64) -> Self {
        let SharedState { owner, epoch, pose, velocity, sleeping, .. } = *state;
        let mut quantised = Self { owner: owner.0, epoch: epoch.0, sleeping, ..Self::default() };
        quantised.left_out = left_out.unwrap_or_default();
        quantised.set_place_m(pose.translation);
        quantised.set_rotation_leaving_out(pose.rotation.map(f64::from), left_out, least);
        if !sleeping {
            quantised.set_velocity_m_s(velocity.linear.map(f64::from));
            quantised.spin = steps(velocity.angular.map(f64::from), SPIN);
        }
        quantised
    }

    pub(super) fn place_m(&self) -> [f64; 3] {
        self.place.map(|v| v as f64 / PLACE)
    }

    pub(super) fn velocity_m_s(&self) -> [f64; 3] {
        self.velocity.map(|v| f64::from(v) / VELOCITY)
    }

    pub(super) fn spin_rad_s(&self) -> [f64; 3] {
        self.spin.map(|v| f64::from(v) / SPIN)
    }

    pub(super) fn rotation(&self) -> Rotation {
        let [a, b, c] = self.turn.map(|v| f64::from(v) / (TURN * std::f64::consts::SQRT_2));
        let rest = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
        let mut others = [a, b, c].into_iter();
        std::array::from_fn(
            |i| {
                if i == usize::from(self.left_out) { rest } else { others.next().unwrap_or(0.0) }
            },
        )
    }

    pub(super) fn set_place_m(&mut self, place: [f64; 3]) {
        self.place = place.map(|v| (v * PLACE).round() as i64);
    }

    pub(super) fn set_velocity_m_s(&mut self, velocity: [f64; 3]) {
        self.velocity = steps(velocity, VELOCITY);
    }

    /// Sets the rotation. The component that was left out before is left out again, if it is large enough.
    pub(super) fn set_rotation(&mut self, rotation: Rotation) {
        self.set_rotation_leaving_out(rotation, Some(self.left_out), LEAST_LEFT_OUT);
    }

    fn set_rotation_leaving_out(&mut self, rotation: Rotation, left_out: Option<u8>, least: f64) {
        let size = |i: usize| rotation[i].abs();
        let does = |i: &usize| *i < 4 && size(*i) >= least;
        let largest = || (1..4).fold(0, |best, i| if size(i) > size(best) { i } else { best });
        let left_out = left_out.map(usize::from).filter(does).unwrap_or_else(largest);
        // A quaternion and its negative are the same rotation, so the component left out can be made
        // positive.
        let sign = if rotation[left_out] < 0.0 { -1.0 } else { 1.0 };
        let step = |v: f64| (sign * v * std::f64::consts::SQRT_2 * TURN).round() as i16;
        let mut others = (0..4).filter(|&i| i != left_out).map(|i| step(rotation[i]));
        self.turn = std::array::from_fn(|_| others.next().expect("three of four"));
        self.left_out = left_out as u8;
    }

    /// Returns whether a predicted state may stand for this one: no number is off by more than [`NEAR`].
    pub(super) fn is_near(&self, predicted: &Self) -> bool {
        let facts = |state: &Self| (state.owner, state.epoch, state.left_out, state.sleeping);
        facts(self) == facts(predicted)
            && (0..3).all(|axis| {
                let far = |a: i64, b: i64| a.abs_diff(b);
                far(self.place[axis], predicted.place[axis]) <= NEAR.0 as u64
                    && far(self.turn[axis].into(), predicted.turn[axis].into()) <= NEAR.0 as u64
                    && far(self.velocity[axis].into(), predicted.velocity[axis].into()) <= NEAR.1 as u64
                    && far(self.spin[axis].into(), predicted.spin[axis].into()) <= NEAR.1 as u64
            })
    }

    /// Returns the state, or an error if the numbers are of no valid state.
    pub(super) fn state(&self, id: BodyId) -> Result<SharedState, CodecError> {
        let state = SharedState {
            id,
            owner: RegionId(self.owner),
            epoch: Epoch(self.epoch),
            pose: WorldPose {
                translation: self.place_m(),
                rotation: self.rotation().map(|component| component as f32),
            },
            velocity: Velocity {
                linear: self.velocity_m_s().map(|v| v as f32),
                angular: self.spin_rad_s().map(|v| v as f32),
            },
            sleeping: self.sleeping,
        };
        state.check()?;
        Ok(state)
    }
}

fn steps(velocity: [f64; 3], steps: f64) -> [i32; 3] {
    velocity.map(|v| (v * steps).round().clamp(-FASTEST, FASTEST) as i32)
}
