//! Decides how long to wait for a peer that is out of reach, and when to report the wait again.

use std::time::Duration;

/// How often a process reports that it still waits.
const SAID_EVERY: Duration = Duration::from_secs(60);

/// A peer that is out of reach and waited for.
pub(super) struct Absence {
    since: Duration,
    /// How long the absence may last; `None`: without end.
    limit: Option<Duration>,
    say_at: Duration,
    reason: String,
}

impl Absence {
    pub(super) fn new(now: Duration, limit: Option<Duration>, reason: String) -> Self {
        Self { since: now, limit, say_at: now + SAID_EVERY, reason }
    }

    /// Records why the last attempt to reach the peer failed.
    pub(super) fn goes_on(&mut self, reason: String) {
        self.reason = reason;
    }

    /// Returns why the peer is out of reach, in the network's last words.
    pub(super) fn reason(&self) -> &str {
        &self.reason
    }

    /// Returns how long the peer has been out of reach.
    pub(super) fn lasted(&self, now: Duration) -> Duration {
        now.saturating_sub(self.since)
    }

    /// Returns the time waited, once the limit is reached.
    pub(super) fn is_over(&self, now: Duration) -> Option<Duration> {
        self.limit.filter(|limit| self.since.saturating_add(*limit) <= now)
    }

    /// Returns whether to report now that the wait lasts: once per minute.
    pub(super) fn is_to_be_told(&mut self, now: Duration) -> bool {
        let is_due = self.say_at <= now;
        if is_due {
            self.say_at = now + SAID_EVERY;
        }
        is_due
    }

    /// Returns when the wait ends or is to be reported next.
    pub(super) fn poll_timeout(&self) -> Option<Duration> {
        let end = self.limit.map(|limit| self.since.saturating_add(limit));
        end.into_iter().chain([self.say_at]).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waits for a day at most, while attempts fail each second. Returns when the wait was given up, if it
    /// was, and how often it was reported.
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
