//! Counts how long the steps of a region take.

use std::time::Duration;

/// The weight of a tick in the smoothed time of a step.
const TIME_MEMORY: f64 = 0.1;

/// The wall time of a region's steps.
#[derive(Clone, Copy, Debug)]
pub(in crate::physics) struct StepTime {
    /// The time that the step under way has taken so far, or the last one has taken, microseconds.
    took_us: f64,
    /// The number of its ticks, and how many times as long as a step of one tick it is expected to take.
    ticks: u8,
    longer: f64,
    /// The smoothed time of a step of one tick, by the steps before this one, microseconds.
    before_us: f64,
}

impl Default for StepTime {
    fn default() -> Self {
        Self { took_us: 0.0, ticks: 0, longer: 1.0, before_us: 0.0 }
    }
}

impl StepTime {
    /// Begins a step of `ticks` ticks, which is expected to take `longer` times as long as one of a single
    /// tick.
    pub(in crate::physics) fn begin(&mut self, ticks: u8, longer: f64) {
        *self = Self { took_us: 0.0, ticks, longer, before_us: self.full_us() };
    }

    /// Adds the time of a round to that of its step.
    pub(in crate::physics) fn add(&mut self, took: Duration) {
        self.took_us += took.as_secs_f64() * 1e6;
    }

    /// Returns how long the last step took.
    pub(in crate::physics) fn last(&self) -> Duration {
        Duration::from_secs_f64(self.took_us * 1e-6)
    }

    /// Returns how long a step of one tick takes, whatever the lengths of the steps so far, microseconds;
    /// smoothed over their ticks.
    pub(in crate::physics) fn full_us(&self) -> f64 {
        let is_first = self.before_us == 0.0;
        let newer = if is_first { 1.0 } else { 1.0 - (1.0 - TIME_MEMORY).powi(self.ticks.into()) };
        self.before_us + newer * (self.took_us / self.longer - self.before_us)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_one_tick_is_the_same_by_long_and_by_short_steps() {
        let mut time = StepTime::default();
        let mut step = |ticks, longer, ms: f64, count| {
            for _ in 0..count {
                time.begin(ticks, longer);
                time.add(Duration::from_secs_f64(0.4e-3 * ms));
                time.add(Duration::from_secs_f64(0.6e-3 * ms));
            }
            time.full_us()
        };
        assert!((step(4, 1.5, 3.0, 1) - 2_000.0).abs() < 1.0, "the first");
        assert!((step(1, 1.0, 2.0, 100) - 2_000.0).abs() < 1.0);
        // No jump where the region comes to longer steps, or back.
        assert!((step(4, 1.5, 3.0, 1) - 2_000.0).abs() < 1.0);
        assert!((step(1, 1.0, 2.0, 1) - 2_000.0).abs() < 1.0);
        // What has come to take longer is known after as many ticks, however few steps these are.
        let of_few = step(4, 1.5, 6.0, 3);
        assert!((step(1, 1.0, 2.0, 100) - 2_000.0).abs() < 1.0);
        assert!((step(1, 1.0, 4.0, 12) - of_few).abs() < 1.0);
    }
}
