//! Simulates the host of a process: its clock, its unread mailbox, and whether it is slow or stopped.

use std::collections::VecDeque;
use std::time::Duration;

use super::clock::Clock;
use super::network::Delivery;

/// The skew of processes' clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skew {
    /// The largest offset from the true time, either way.
    pub offset: Duration,
    /// The largest difference of rate, parts per million.
    pub drift_ppm: i64,
}

/// The host of one process.
#[derive(Clone, Debug)]
pub(super) struct Host {
    pub(super) clock: Clock,
    pub(super) mailbox: VecDeque<Delivery>,
    /// The time that handling one event takes.
    pub(super) cost: Duration,
    pub(super) busy_until: Duration,
    pub(super) stopped: bool,
    /// The true time at which the host's machine wants to be called.
    pub(super) timer: Option<Duration>,
}

impl Host {
    pub(super) fn new(clock: Clock) -> Self {
        Self {
            clock,
            mailbox: VecDeque::new(),
            cost: Duration::ZERO,
            busy_until: Duration::ZERO,
            stopped: false,
            timer: None,
        }
    }

    /// Returns whether an arrival now has to wait.
    pub(super) fn is_occupied(&self, now: Duration) -> bool {
        self.stopped || now < self.busy_until || !self.mailbox.is_empty()
    }

    /// Returns when the host next acts by itself.
    pub(super) fn wake(&self) -> Option<Duration> {
        if self.stopped {
            None
        } else if self.mailbox.is_empty() {
            self.timer.map(|timer| timer.max(self.busy_until))
        } else {
            Some(self.busy_until)
        }
    }
}
