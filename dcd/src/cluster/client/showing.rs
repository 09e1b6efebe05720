//! Shows a client's world smoothly: feeds its playback with states and with the leader's clock, and measures how long inputs take.

use std::collections::VecDeque;
use std::time::Duration;

use super::Client;
use crate::cluster::{Peer, Pinger};
use crate::playback::{Motion, Playback, ViewTime};
use crate::protocol::{Message, Pong, SharedState, Stamp};
use crate::space::{BodyId, NodeId};

/// The most inputs that wait to be applied.
const WAITING: usize = 256;
/// The delays of inputs by which the median is taken.
const DELAYS: usize = 33;

/// Keeps what a client shows, once its user asked for a time to show: nobody pays who does not.
#[derive(Clone, Debug)]
pub(super) struct Showing {
    playback: Playback,
    pinger: Pinger,
    inputs: InputDelay,
}

impl Showing {
    pub(super) fn timeout(&self) -> Option<Duration> {
        self.pinger.timeout()
    }

    pub(super) fn pings(&mut self, now: Duration) -> Vec<(Peer, Message)> {
        self.pinger.due(now)
    }

    pub(super) fn pong(&mut self, now: Duration, from: Peer, pong: Pong) {
        self.pinger.pong(now, from, pong);
        self.set_clock(now, from);
    }

    /// Sets the leader's clock as the pings so far have it; the older they are, the less they say.
    fn set_clock(&mut self, now: Duration, leader: Peer) {
        if let Some(clock) = self.pinger.clock(now, leader) {
            self.playback.set_offset_us(clock.offset_us, clock.error_us);
        }
    }

    /// Has another leader, or the same over a new link.
    pub(super) fn connected(&mut self, now: Duration, leader: Peer) {
        self.pinger.add(now, leader);
    }

    pub(super) fn disconnected(&mut self, leader: Peer) {
        self.pinger.remove(leader);
    }

    /// Has another leader, whose clock is another.
    pub(super) fn change_leader(&mut self, former: Option<NodeId>) {
        former.into_iter().for_each(|node| self.pinger.remove(Peer::Node(node)));
        self.playback.change_leader();
    }

    /// Begins to count ticks anew with the next one heard of: that of another group, or of a world that was restored.
    pub(super) fn recount(&mut self) {
        self.playback.recount();
    }

    pub(super) fn sent(&mut self, now: Duration, logical_time: u64) {
        self.inputs.sent(now, logical_time);
    }

    pub(super) fn hear(&mut self, now: Duration, stamp: &Stamp, states: &[SharedState]) {
        if !stamp.speculative {
            self.inputs.applied(now, stamp.applied);
        }
        self.playback.hear(now, stamp, states);
    }

    pub(super) fn learn(&mut self, now: Duration, stamp: &Stamp, state: &SharedState, before: Motion) {
        self.playback.learn(now, stamp, state, before);
    }

    pub(super) fn stand(&mut self, id: BodyId) {
        self.playback.stand(id);
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        self.playback.forget(id);
    }
}

/// What a client shows.
impl Client {
    /// Returns the ticks to show now; `None` until the world is heard of. From the first call on it keeps what that takes.
    pub fn view_time(&mut self, now: Duration) -> Option<ViewTime> {
        let step = self.world.as_ref()?.step;
        let leader = self.leader.as_ref().filter(|_| self.linked).map(|leader| Peer::Node(leader.node));
        let showing = self.showing.get_or_insert_with(|| {
            let mut pinger = Pinger::default();
            leader.into_iter().for_each(|leader| pinger.add(now, leader));
            Box::new(Showing {
                playback: Playback::new(step.dt_s, step.gravity),
                pinger,
                inputs: InputDelay::default(),
            })
        });
        leader.into_iter().for_each(|leader| showing.set_clock(now, leader));
        let time = showing.playback.time(now)?;
        Some(ViewTime { input_delay_s: showing.inputs.median_s(), ..time })
    }

    /// Returns how a body is shown at a tick; `None` if it is not known.
    pub fn view(&self, id: BodyId, tick: f64) -> Option<Motion> {
        let shown = self.showing.as_ref().and_then(|showing| showing.playback.at(id, tick));
        shown.or_else(|| self.bodies.get(&id).map(|view| Motion::of(&view.body.state)))
    }
}

/// Measures the time from an input to the first state that shows it.
#[derive(Clone, Debug, Default)]
struct InputDelay {
    /// The logical times of inputs that are not applied yet, and when they were sent.
    waiting: VecDeque<(u64, Duration)>,
    delays: VecDeque<Duration>,
}

impl InputDelay {
    fn sent(&mut self, now: Duration, logical_time: u64) {
        self.waiting.push_back((logical_time, now));
        if self.waiting.len() > WAITING {
            self.waiting.pop_front();
        }
    }

    /// Notes that this input is applied; those before it were, or were replaced by it.
    fn applied(&mut self, now: Duration, logical_time: u64) {
        let count = self.waiting.partition_point(|(waiting, _)| *waiting <= logical_time);
        let Some((_, sent)) = self.waiting.drain(..count).next_back() else { return };
        self.delays.push_back(now.saturating_sub(sent));
        if self.delays.len() > DELAYS {
            self.delays.pop_front();
        }
    }

    fn median_s(&self) -> Option<f64> {
        let mut delays: Vec<_> = self.delays.iter().copied().collect();
        delays.sort_unstable();
        delays.get(delays.len() / 2).map(Duration::as_secs_f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delay_of_an_input_is_that_until_a_state_shows_it_or_a_later_one() {
        let mut inputs = InputDelay::default();
        assert_eq!(inputs.median_s(), None);
        let at = Duration::from_millis;
        for logical_time in 1..=9 {
            inputs.sent(at(10 * logical_time), logical_time);
        }
        inputs.applied(at(60), 0);
        assert_eq!(inputs.median_s(), None, "a new leader has applied none");
        inputs.applied(at(90), 4);
        assert_eq!(inputs.median_s(), Some(0.05));
        inputs.applied(at(200), 4);
        inputs.applied(at(110), 8);
        inputs.applied(at(115), 9);
        assert_eq!(inputs.median_s(), Some(0.03));
    }
}
