//! Simulates the monotonic clock of a process, which begins at any value and runs at a rate of its own.

use std::time::Duration;

/// The clock of one process. Reading it takes the true time of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    /// The true time at which the process began.
    began: Duration,
    /// The value that it showed at that time.
    shown: Duration,
    /// How much faster than true time it runs, parts per million.
    drift_ppm: i64,
}

impl Clock {
    /// Creates a clock that shows `shown` at the true time `began`.
    pub const fn new(began: Duration, shown: Duration, drift_ppm: i64) -> Self {
        Self { began, shown, drift_ppm }
    }

    /// Returns the value that the clock shows at a true time.
    pub fn read(&self, now: Duration) -> Duration {
        let true_ns = now.saturating_sub(self.began).as_nanos() as i128;
        let local_ns = true_ns + true_ns * i128::from(self.drift_ppm) / 1_000_000;
        self.shown + Duration::from_nanos(local_ns as u64)
    }

    /// Returns the true time at which the clock first shows `local`.
    pub fn due(&self, local: Duration) -> Duration {
        let Some(ahead) = local.checked_sub(self.shown) else { return self.began };
        let true_ns = ahead.as_nanos() as i128 * 1_000_000 / (1_000_000 + i128::from(self.drift_ppm));
        let mut due = self.began + Duration::from_nanos(true_ns as u64);
        while self.read(due) < local {
            due += Duration::from_nanos(1);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_timer_is_never_early_and_at_most_some_nanoseconds_late() {
        for drift_ppm in [-500, 0, 137, 500] {
            let clock = Clock::new(Duration::from_secs(3), Duration::from_secs(10), drift_ppm);
            for local_us in [10_000_001, 10_016_667, 3_000_000_000] {
                let local = Duration::from_micros(local_us);
                let due = clock.due(local);
                assert!(clock.read(due) >= local);
                assert!(clock.read(due) - local < Duration::from_nanos(10));
            }
        }
    }

    #[test]
    fn a_fast_clock_gains_its_drift() {
        let clock = Clock::new(Duration::ZERO, Duration::ZERO, 500);
        assert_eq!(clock.read(Duration::from_secs(100)), Duration::from_millis(100_050));
    }
}
