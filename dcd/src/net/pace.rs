//! Paces the reading of a client's frames: a flood is left where it is, at its sender, and costs us nothing (generic cell rate
//! algorithm, ITU-T I.371).

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What may come at once after a pause: all of this time.
const BURST: Duration = Duration::from_secs(1);
/// A longer frame counts as several.
const FRAME_BYTES: usize = 256;

/// The pace at which frames of one peer are read.
pub(super) struct Pace {
    per_frame: Duration,
    /// When everything read so far would have come at an even pace.
    even_at: Mutex<Option<Instant>>,
}

impl Pace {
    /// Returns a pace of so many frames per second; `None` does not hold anything back.
    pub(super) fn new(frames_per_s: Option<u32>) -> Self {
        let per_frame = frames_per_s.map_or(Duration::ZERO, |rate| Duration::from_secs(1) / rate.max(1));
        Self { per_frame, even_at: Mutex::new(None) }
    }

    /// Counts a frame of this length. Returns when it may be read, if not now.
    pub(super) fn count(&self, now: Instant, bytes: usize) -> Option<Instant> {
        let frames = u32::try_from(bytes / FRAME_BYTES).unwrap_or(u32::MAX).saturating_add(1);
        let mut even_at = self.even_at.lock().unwrap_or_else(PoisonError::into_inner);
        let next = even_at.map_or(now, |at| at.max(now)) + self.per_frame.saturating_mul(frames);
        *even_at = Some(next);
        next.checked_sub(BURST).filter(|at| *at > now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_faster_waits_until_it_would_have_come_at_the_pace() {
        let (pace, start) = (Pace::new(Some(100)), Instant::now());
        for _ in 0..100 {
            assert_eq!(pace.count(start, 10), None, "a second's worth at once");
        }
        let next = pace.count(start, 10).unwrap();
        assert_eq!(next, start + Duration::from_millis(10));
        assert_eq!(pace.count(start + Duration::from_secs(1), 10), None, "time forgives");
        let long = Pace::new(Some(100));
        assert_eq!(long.count(start, 99 * FRAME_BYTES), None);
        assert!(long.count(start, 10).is_some(), "a long frame counts as several");
        let free = Pace::new(None);
        assert!((0..10_000).all(|_| free.count(start, 1 << 20).is_none()));
    }
}
