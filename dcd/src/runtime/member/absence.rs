//! Decides how long a peer that is out of reach is waited for, and when that is said again.

use std::time::Duration;

/// How often a process says that it still waits.
const SAID_EVERY: Duration = Duration::from_secs(60);

/// A peer that is out of reach, and waited for.
pub(super) struct Absence {
    since: Duration,
    /// How long it may last; `None`: without end.
    limit: Option<Duration>,
    say_at: Duration,
    reason: String,
}

impl Absence {
    pub(super) fn new(now: Duration, limit: Option<Duration>, reason: String) -> Self {
        Self { since: now, limit, say_at: now + SAID_EVERY, reason }
    }

    /// Takes in why the last attempt to reach the peer failed.
    pub(super) fn goes_on(&mut self, reason: String) {
        self.reason = reason;
    }

    /// Returns why the peer is out of reach, as the network put it last.
    pub(super) fn reason(&self) -> &str {
        &self.reason
    }

    /// Returns how long the peer has been out of reach.
    pub(super) fn lasted(&self, now: Duration) -> Duration {
        now.saturating_sub(self.since)
    }

    /// Returns how long was waited, once that is as long as one waits.
    pub(super) fn is_over(&self, now: Duration) -> Option<Duration> {
        self.limit.filter(|limit| self.since.saturating_add(*limit) <= now)
    }

    /// Returns whether to say that the wait lasts: once per minute.
    pub(super) fn is_to_be_told(&mut self, now: Duration) -> bool {
        let is_due = self.say_at <= now;
        if is_due {
            self.say_at = now + SAID_EVERY;
        }
        is_due
    }

    /// Returns when the wait is over, or to be told of.
    pub(super) fn poll_timeout(&self) -> Option<Duration> {
        let end = self.limit.map(|limit| self.since.saturating_add(limit));
        end.into_iter().chain([self.say_at]).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waits for a day, attempts failing each second, if nobody gives up; returns when that is, and how often the wait was told of.
    fn wait(limit: Option<Duration>) -> (Option<Duration>, usize) {
        let start = Duration::from_secs(7);
        let day = Duration::from_secs(24 * 3600);
        let mut absence = Absence::new(start, limit, "no answer".to_owned());
        let (mut now, mut told) = (start, 0);
        while now < start + day {
            now = absence.poll_timeout().expect("somebody is always to be told").max(now);
            absence.goes_on(format!("no answer after {now:?}"));
            told += usize::from(absence.is_to_be_told(now));
            if let Some(waited) = absence.is_over(now) {
                assert_eq!(waited, absence.lasted(now));
                return (Some(waited), told);
            }
        }
        (None, told)
    }

    #[test]
    fn a_wait_without_end_is_told_of_each_minute_and_one_with_a_limit_ends_then() {
        assert_eq!(wait(None), (None, 24 * 60));
        for (limit_s, told) in [(30, 0), (150, 2)] {
            let limit = Duration::from_secs(limit_s);
            assert_eq!(wait(Some(limit)), (Some(limit), told));
        }
    }
}
