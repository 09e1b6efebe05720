//! Keeps strangers from filling the log: one line per second is written about what they cause, with the count
//! of those left out.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The least time between two lines.
const APART: Duration = Duration::from_secs(1);

/// A limit on how many of many like events are logged.
#[derive(Debug, Default)]
pub(super) struct Seldom(Mutex<Past>);

#[derive(Debug, Default)]
struct Past {
    told: Option<Instant>,
    left_out: u64,
}

impl Seldom {
    /// Returns how many events were left out before this one, if this one is to be logged.
    pub(super) fn tell(&self, now: Instant) -> Option<u64> {
        let mut past = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if past.told.is_some_and(|told| now.saturating_duration_since(told) < APART) {
            past.left_out += 1;
            return None;
        }
        past.told = Some(now);
        Some(std::mem::take(&mut past.left_out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_a_second_is_told_with_the_number_of_those_that_were_not() {
        let (seldom, start) = (Seldom::default(), Instant::now());
        let told: Vec<_> = (0..25).filter_map(|i| seldom.tell(start + i * APART / 10)).collect();
        assert_eq!(told, [0, 9, 9]);
    }
}
