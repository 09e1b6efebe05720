//! Paces the reading of a client's frames by the generic cell rate algorithm (ITU-T I.371): a flood stays at
//! its sender and costs us nothing. Datagrams have a pace of their own, and those beyond it are dropped.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The burst that may come at once after a pause: this time's worth.
const BURST: Duration = Duration::from_secs(1);
/// The size up to which a frame counts as one; a longer one counts as several.
const FRAME_BYTES: usize = 256;

/// The pace at which frames of one peer are read.
pub(super) struct Pace {
    per_frame: Duration,
    /// The time at which everything that was read so far would have come at an even pace.
    even_at: Mutex<Option<Instant>>,
}

impl Pace {
    /// Returns a pace of `frames_per_s` frames per second; with `None` it holds nothing back.
    pub(super) fn new(frames_per_s: Option<u32>) -> Self {
        let per_frame = frames_per_s.map_or(Duration::ZERO, |rate| Duration::from_secs(1) / rate.max(1));
        Self { per_frame, even_at: Mutex::new(None) }
    }

    /// Counts a frame of this length. Returns when it may be read, if not now.
    pub(super) fn count(&self, now: Instant, bytes: usize) -> Option<Instant> {
        let mut even_at = self.even_at();
        let next = self.next(*even_at, now, bytes);
        *even_at = Some(next);
        next.checked_sub(BURST).filter(|at| *at > now)
    }

    /// Returns whether a datagram of this length may be read now, and counts it if so. It is never read
    /// later, since it would be of no use then.
    pub(super) fn admits(&self, now: Instant, bytes: usize) -> bool {
        let mut even_at = self.even_at();
        let next = self.next(*even_at, now, bytes);
        let is_due = next.checked_sub(BURST).is_none_or(|at| at <= now);
        if is_due {
            *even_at = Some(next);
        }
        is_due
    }

    fn next(&self, even_at: Option<Instant>, now: Instant, bytes: usize) -> Instant {
        let frames = u32::try_from(bytes / FRAME_BYTES).unwrap_or(u32::MAX).saturating_add(1);
        even_at.map_or(now, |at| at.max(now)) + self.per_frame.saturating_mul(frames)
    }

    fn even_at(&self) -> MutexGuard<'_, Option<Instant>> {
        self.even_at.lock().unwrap_or_else(PoisonError::into_inner)
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
        assert!((0..10_000).all(|_| free.admits(start, 1 << 10)));
    }

    #[test]
    fn datagrams_that_come_faster_are_refused_and_put_nothing_off() {
        let (pace, start) = (Pace::new(Some(100)), Instant::now());
        let admitted = |at: Instant, sent: usize| (0..sent).filter(|_| pace.admits(at, 10)).count();
        assert_eq!(admitted(start, 10_000), 100, "a second's worth at once");
        assert_eq!(admitted(start + Duration::from_millis(500), 10_000), 50, "and then those of the pace");
    }
}
