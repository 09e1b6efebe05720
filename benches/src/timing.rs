//! Times steps and nothing else: no measurement, no log between them.

use std::error::Error;
use std::time::{Duration, Instant};

use dcd::runtime::WorldError;
use dcd::runtime::measure::{StepTimes, Subject};
use serde::{Deserialize, Serialize};

/// Steps before the clock counts: [`StepTimes::of`] leaves them out.
pub(crate) const WARM_UP: usize = 30;

/// Milliseconds a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StepMs {
    pub(crate) mean_ms: f64,
    pub(crate) p50_ms: f64,
    pub(crate) p99_ms: f64,
    pub(crate) max_ms: f64,
}

impl StepMs {
    /// Steps a world through the warm-up and then so many timed ticks.
    pub(crate) fn of(subject: &mut Subject, ticks: usize) -> Result<Self, Box<dyn Error>> {
        let steps = subject.at_home(|subject| {
            let timed = (0..WARM_UP + ticks).map(|_| {
                let start = Instant::now();
                match subject {
                    Subject::Bare(world) => world.step(),
                    Subject::Regions(world) => world.step()?,
                }
                Ok(start.elapsed())
            });
            timed.collect::<Result<Vec<_>, WorldError>>()
        })??;
        Self::from_steps(&steps)
    }

    /// Of all steps of a run, in order; those of the warm-up do not count.
    pub(crate) fn from_steps(steps: &[Duration]) -> Result<Self, Box<dyn Error>> {
        let times = StepTimes::of(steps);
        match (times.mean, times.p50, times.p99, times.max) {
            (Some(mean_ms), Some(p50_ms), Some(p99_ms), Some(max_ms)) => {
                Ok(Self { mean_ms, p50_ms, p99_ms, max_ms })
            }
            _ => Err("a timed run needs at least one tick after its warm-up".into()),
        }
    }

    /// Of two runs of the same work the one that was disturbed less.
    pub(crate) fn faster(self, other: Self) -> Self {
        if other.p50_ms < self.p50_ms { other } else { self }
    }
}
