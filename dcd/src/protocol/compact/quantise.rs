//! Quantises the state of a body to whole numbers, and turns them back into a state.

use crate::protocol::{Check, CodecError, SharedState, Velocity, WorldPose};
use crate::space::{BodyId, Epoch, RegionId};

/// Steps per metre.
const PLACE: f64 = 2048.0;
/// Steps per m/s.
const VELOCITY: f32 = 512.0;
/// Steps per rad/s.
const SPIN: f32 = 256.0;
/// No speed is told that is higher, in steps: a million m/s.
const FASTEST: i64 = 1 << 29;
/// Steps from 0 to the largest that a component of a unit quaternion can be without being the largest, 1/√2.
const TURN: f32 = 2047.0;

/// A body's state in whole numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quantised {
    pub id: i64,
    pub owner: i64,
    pub epoch: i64,
    pub place: [i64; 3],
    /// Which component of the rotation is the largest; the others follow in order ("smallest three").
    pub largest: usize,
    pub turn: [i64; 3],
    pub velocity: [i64; 3],
    pub spin: [i64; 3],
    pub sleeping: bool,
}

impl Quantised {
    pub(super) fn of(state: &SharedState) -> Self {
        let SharedState { id, owner, epoch, pose, velocity, sleeping } = *state;
        let size = |i: usize| pose.rotation[i].abs();
        let largest = (1..4).fold(0, |best, i| if size(i) > size(best) { i } else { best });
        // A quaternion and its negative are the same rotation: the largest component is positive.
        let sign = if pose.rotation[largest] < 0.0 { -1.0 } else { 1.0 };
        let step = |v: f32| (sign * v * std::f32::consts::SQRT_2 * TURN).round() as i64;
        let mut others = (0..4).filter(|&i| i != largest).map(|i| step(pose.rotation[i]));
        let awake = |v: [f32; 3], steps: f32| {
            v.map(|v| if sleeping { 0 } else { (f64::from(v) * f64::from(steps)).round() as i64 })
                .map(|v| v.clamp(-FASTEST, FASTEST))
        };
        Self {
            id: id.bits() as i64,
            owner: owner.0.into(),
            epoch: epoch.0 as i64,
            place: pose.translation.map(|v| (v * PLACE).round() as i64),
            largest,
            turn: std::array::from_fn(|_| others.next().expect("three of four")),
            velocity: awake(velocity.linear, VELOCITY),
            spin: awake(velocity.angular, SPIN),
            sleeping,
        }
    }

    /// Returns the state; an error if the numbers are of no state.
    pub(super) fn state(&self) -> Result<SharedState, CodecError> {
        let [a, b, c] = self.turn.map(|v| v as f32 / (TURN * std::f32::consts::SQRT_2));
        let rest = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
        let mut others = [a, b, c].into_iter();
        let mut component = |i| if i == self.largest { rest } else { others.next().unwrap_or(0.0) };
        let state = SharedState {
            id: BodyId::from_bits(self.id as u64),
            owner: RegionId(u32::try_from(self.owner).map_err(|_| CodecError::Compact)?),
            epoch: Epoch(self.epoch as u64),
            pose: WorldPose {
                translation: self.place.map(|v| v as f64 / PLACE),
                rotation: std::array::from_fn(&mut component),
            },
            velocity: Velocity {
                linear: self.velocity.map(|v| v as f32 / VELOCITY),
                angular: self.spin.map(|v| v as f32 / SPIN),
            },
            sleeping: self.sleeping,
        };
        state.check()?;
        Ok(state)
    }
}
