//! Notices that a leader has fallen silent while there should be more to hear, long before its link ends: a
//! client's links tolerate long silence.

use std::time::Duration;

/// The silence after states that counts: more states, or the leader's word that nothing moves, should have
/// come by then.
const SILENCE: Duration = Duration::from_millis(750);

/// The watch over the leader's silence. When the leader is silent, the client asks it, its relay if that
/// tells it states, and the server. If one of them was started again, its answer ends the link. If the server
/// has named another leader and that message was lost, it is sent again once anything else is acknowledged.
#[derive(Clone, Debug, Default)]
pub(super) struct Vigil {
    ask_at: Option<Duration>,
}

impl Vigil {
    /// Notes that the leader was heard, and whether more should follow soon.
    pub(super) fn heard(&mut self, now: Duration, more_follows: bool) {
        self.ask_at = more_follows.then_some(now + SILENCE);
    }

    /// Stops watching, since there is no leader to hear.
    pub(super) fn rest(&mut self) {
        self.ask_at = None;
    }

    /// Returns when it is time to ask.
    pub(super) fn timeout(&self) -> Option<Duration> {
        self.ask_at
    }

    /// Returns whether it is time to ask. The next time is after as long again.
    pub(super) fn is_due(&mut self, now: Duration) -> bool {
        let is_due = self.ask_at.is_some_and(|at| at <= now);
        if is_due {
            self.ask_at = Some(now + SILENCE);
        }
        is_due
    }
}
