//! Times steps and nothing else: nothing is measured or logged between them.

use std::error::Error;
use std::time::{Duration, Instant};

use dcd::runtime::WorldError;
use dcd::runtime::measure::{StepTimes, Subject};
use rustix::time::{ClockId, clock_gettime};

/// Steps before the clock counts: [`StepTimes::of`] leaves them out.
pub(crate) const WARM_UP: usize = 30;

/// Returns the processor time that this process has used, of all threads together, in milliseconds.
pub(crate) fn cpu_ms() -> f64 {
    let used = clock_gettime(ClockId::ProcessCPUTime);
    used.tv_sec as f64 * 1e3 + used.tv_nsec as f64 / 1e6
}

/// Steps a world through the warm-up and then through so many timed ticks. Returns the median step in
/// milliseconds.
pub(crate) fn median_ms(subject: &mut Subject, ticks: usize) -> Result<f64, Box<dyn Error>> {
    median_of(&steps(subject, ticks)?)
}

/// Steps a world through the warm-up and then through so many ticks. Returns the time of each step, those of
/// the warm-up too.
pub(crate) fn steps(subject: &mut Subject, ticks: usize) -> Result<Vec<Duration>, WorldError> {
    subject.at_home(|subject| {
        let timed = (0..WARM_UP + ticks).map(|_| {
            let start = Instant::now();
            step(subject)?;
            Ok(start.elapsed())
        });
        timed.collect()
    })?
}

/// Steps a world once.
pub(crate) fn step(subject: &mut Subject) -> Result<(), WorldError> {
    match subject {
        Subject::Bare(world) => world.step(),
        Subject::Regions(world) => world.step()?,
    }
    Ok(())
}

/// Returns the median of all steps of a run, in milliseconds. The steps are given in order; those of the
/// warm-up do not count.
pub(crate) fn median_of(steps: &[Duration]) -> Result<f64, Box<dyn Error>> {
    StepTimes::of(steps).p50.ok_or_else(|| "a timed run needs at least one tick after its warm-up".into())
}
