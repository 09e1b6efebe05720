//! Computes again a world that a client saw, and the errors of what the client saw.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

use dcd::prelude::*;

/// A body in one frame: its shown pose and its newest pose.
pub struct Seen {
    /// The id of the body.
    pub id: BodyId,
    /// The pose of the newest state received.
    pub told: WorldPose,
    /// The pose that is shown.
    pub shown: WorldPose,
}

/// What a client sees in one frame.
pub struct Frame {
    /// The time at which the frame is drawn.
    pub at: Instant,
    /// The ticks that the frame shows.
    pub time: dcd::ViewTime,
    /// The movable bodies.
    pub bodies: Vec<Seen>,
}

/// A body moves if it is at least this fast, m/s. Errors of other bodies do not count.
const MOVES_M_S: f32 = 0.01;

/// Sorted numbers, to read quantiles from.
pub struct Quantiles(Vec<f64>);

impl From<Vec<f64>> for Quantiles {
    fn from(mut numbers: Vec<f64>) -> Self {
        numbers.sort_unstable_by(f64::total_cmp);
        Self(numbers)
    }
}

impl Quantiles {
    /// Returns a quantile, 0 to 1; NaN if there are no numbers.
    pub fn at(&self, quantile: f64) -> f64 {
        let place = (quantile * self.0.len().saturating_sub(1) as f64).round() as usize;
        self.0.get(place).copied().unwrap_or(f64::NAN)
    }
}

/// The poses and velocities of all movable bodies after each tick that a client saw.
pub struct Truth {
    first: u64,
    ticks: Vec<BTreeMap<BodyId, (WorldPose, Velocity)>>,
}

impl Truth {
    /// Steps a world through the ticks of these frames.
    pub fn of(mut world: World, frames: &[Frame]) -> Result<Self, Box<dyn Error>> {
        let times = || frames.iter().flat_map(|frame| [frame.time.shown, frame.time.now]);
        let first = times().fold(f64::MAX, f64::min).max(0.0) as u64;
        let last = times().fold(0.0, f64::max).ceil() as u64;
        let mut ticks = Vec::new();
        while world.tick().0 <= last {
            if world.tick().0 >= first {
                let bodies = world.movable_bodies().map(|body| (body.id, (body.pose, body.velocity)));
                ticks.push(bodies.collect());
            }
            world.step()?;
        }
        Ok(Self { first, ticks })
    }

    /// Returns where a body is at a tick, or between two; `None` if it does not move.
    fn at(&self, id: BodyId, tick: f64) -> Option<[f64; 3]> {
        let after = (tick - self.first as f64).max(0.0);
        let (whole, share) = (after as usize, after.fract());
        let last = self.ticks.len() - 1;
        let state = |tick: usize| self.ticks[tick.min(last)].get(&id);
        let ((a, velocity), (b, _)) = (state(whole)?, state(whole + 1)?);
        if velocity.is_within(MOVES_M_S) {
            return None;
        }
        Some(std::array::from_fn(|i| a.translation[i] + share * (b.translation[i] - a.translation[i])))
    }

    /// Returns the errors of the shown poses against the truth at the shown ticks, and how these errors
    /// change from frame to frame; metres.
    pub fn shown(&self, frames: &[Frame]) -> (Quantiles, Quantiles) {
        self.compare(frames, |frame| frame.time.shown, |seen| seen.shown)
    }

    /// Returns the same for the newest states, against the truth at the world's current tick.
    pub fn told(&self, frames: &[Frame]) -> (Quantiles, Quantiles) {
        self.compare(frames, |frame| frame.time.now, |seen| seen.told)
    }

    fn compare(
        &self,
        frames: &[Frame],
        tick: impl Fn(&Frame) -> f64,
        pose: impl Fn(&Seen) -> WorldPose,
    ) -> (Quantiles, Quantiles) {
        let (mut errors, mut jumps) = (Vec::new(), Vec::new());
        let mut before: BTreeMap<BodyId, [f64; 3]> = BTreeMap::new();
        for frame in frames {
            let offs = frame.bodies.iter().filter_map(|seen| {
                let (is, shown) = (self.at(seen.id, tick(frame))?, pose(seen).translation);
                Some((seen.id, std::array::from_fn(|i| shown[i] - is[i])))
            });
            let offs: BTreeMap<_, [f64; 3]> = offs.collect();
            for (id, off) in &offs {
                errors.push(length(off));
                if let Some(before) = before.get(id) {
                    jumps.push(length(&std::array::from_fn(|i| off[i] - before[i])));
                }
            }
            before = offs;
        }
        (errors.into(), jumps.into())
    }
}

fn length(way: &[f64; 3]) -> f64 {
    way.iter().map(|v| v * v).sum::<f64>().sqrt()
}
