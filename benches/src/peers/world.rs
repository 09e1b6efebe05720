//! Defines the one interface of all engines: a world is stepped, and the places of its bodies are read back.

use std::error::Error;
use std::time::{Duration, Instant};

use super::bodies::State;

/// A scene in one engine.
pub(super) trait World {
    /// Steps so many times, and returns the wall time of each step.
    fn steps(&mut self, ticks: usize) -> Result<Vec<Duration>, Box<dyn Error>>;

    /// Returns all bodies that move, in the order of the scene.
    fn states(&self) -> Vec<State>;

    /// Returns the number of regions that step it; 0 where there are none.
    fn regions(&self) -> usize {
        0
    }
}

/// Returns the wall times of calls in a row.
pub(super) fn timed<E>(ticks: usize, mut step: impl FnMut() -> Result<(), E>) -> Result<Vec<Duration>, E> {
    let once = |_| {
        let start = Instant::now();
        step()?;
        Ok(start.elapsed())
    };
    (0..ticks).map(once).collect()
}
