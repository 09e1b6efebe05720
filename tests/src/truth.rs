//! Computes a world again that a client saw, and how far off it saw it.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

use dcd::prelude::*;

/// A body in one frame: as it is shown, and as it was told last.
pub struct Seen {
    /// Which.
    pub id: BodyId,
    /// Its newest state.
    pub told: WorldPose,
    /// Where it is shown.
    pub shown: WorldPose,
}

/// What a client sees in one frame.
pub struct Frame {
    /// When it is drawn.
    pub at: Instant,
    /// The ticks that it shows.
    pub time: dcd::ViewTime,
    /// The movable bodies.
    pub bodies: Vec<Seen>,
}

/// A body moves if it is at least so fast, m/s: of others any error is none.
const MOVES_M_S: f32 = 0.01;

/// Numbers of which quantiles are asked.
pub struct Quantiles(Vec<f64>);

impl From<Vec<f64>> for Quantiles {
    fn from(mut numbers: Vec<f64>) -> Self {
        numbers.sort_unstable_by(f64::total_cmp);
        Self(numbers)
    }
}

impl Quantiles {
    /// Returns the quantile, 0 to 1; NaN of nothing.
    pub fn at(&self, quantile: f64) -> f64 {
        let place = (quantile * self.0.len().saturating_sub(1) as f64).round() as usize;
        self.0.get(place).copied().unwrap_or(f64::NAN)
    }
}

/// The positions of all bodies after each tick that a client saw.
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

    /// Returns the errors of what is shown, against the ticks that it is shown of, and how these errors change from frame to frame;
    /// metres.
    pub fn shown(&self, frames: &[Frame]) -> (Quantiles, Quantiles) {
        self.compare(frames, |frame| frame.time.shown, |seen| seen.shown)
    }

    /// Returns the same of the newest states, against the tick that the world is at.
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
