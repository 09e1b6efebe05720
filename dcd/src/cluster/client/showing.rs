//! Shows a client's world smoothly: feeds its playback with states and with the leader's clock, and measures
//! how long inputs take.

use std::collections::VecDeque;
use std::time::Duration;

use super::Client;
use crate::cluster::{Peer, Pinger};
use crate::playback::{Lead, Motion, Playback, ViewTime};
use crate::protocol::{Input, Message, Pace, Pong, SharedState, Stamp};
use crate::space::{BodyId, NodeId, Tick};

/// The most inputs that wait to be applied.
const WAITING: usize = 256;
/// The number of delays of inputs of which the median is taken.
const DELAYS: usize = 33;

/// The state of what a client shows, from when its user first asks for a time to show: nobody else pays for
/// it.
#[derive(Clone, Debug)]
pub(super) struct Showing {
    playback: Playback,
    pinger: Pinger,
    inputs: InputDelay,
    lead: Lead,
    /// The newest tick that an input named.
    named: Tick,
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

    /// Sets the leader's clock as the pings so far have it. The older they are, the less they say.
    fn set_clock(&mut self, now: Duration, leader: Peer) {
        if let Some(clock) = self.pinger.clock(now, leader) {
            self.playback.set_offset_us(clock.offset_us, clock.error_us);
        }
        if let Some(delay_us) = self.pinger.delay_us(leader) {
            self.lead.set_round_trip_s(1e-6 * delay_us);
        }
    }

    /// Notes that the leader is linked, perhaps the same one over a new link.
    pub(super) fn connected(&mut self, now: Duration, leader: Peer) {
        self.pinger.add(now, leader);
    }

    pub(super) fn disconnected(&mut self, leader: Peer) {
        self.pinger.remove(leader);
    }

    /// Notes that there is another leader, whose clock is another.
    pub(super) fn change_leader(&mut self, former: Option<NodeId>) {
        former.into_iter().for_each(|node| self.pinger.remove(Peer::Node(node)));
        self.playback.change_leader();
        self.lead.change_leader();
    }

    /// Begins to count ticks anew with the next one heard of: that of another group, or of a world that was
    /// restored.
    pub(super) fn recount(&mut self) {
        self.playback.recount();
        self.lead.recount();
        self.inputs.waiting.clear();
        self.named = Tick(0);
    }

    /// Notes that an input was sent, which names a tick, or none (0).
    pub(super) fn sent(&mut self, now: Duration, Input { body, logical_time, tick: named, .. }: Input) {
        let world_tick = self.playback.world_tick(now).filter(|_| named != Tick(0)).map(|(tick, _)| tick);
        self.inputs.sent(Sent { body, logical_time, at: now, named, world_tick });
    }

    /// Waits no more for the inputs of a body, since one was refused.
    pub(super) fn refused(&mut self, body: BodyId) {
        self.inputs.waiting.retain(|sent| sent.body != body);
    }

    pub(super) fn hear(&mut self, now: Duration, stamp: &Stamp, states: &[SharedState]) {
        if !stamp.speculative {
            let newest = self.inputs.applied(now, stamp.applied);
            if let Some(Sent { named, world_tick: Some(world_tick), .. }) = newest {
                self.lead.measure(named.0 as f64, world_tick, stamp.early);
            }
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

/// Reads what a client shows.
impl Client {
    /// Returns the ticks to show now; `None` until the world is heard of. The first call starts the playback.
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
                lead: Lead::default(),
                named: Tick(0),
            })
        });
        leader.into_iter().for_each(|leader| showing.set_clock(now, leader));
        let time = showing.playback.time(now)?;
        Some(ViewTime { input_delay_s: showing.inputs.median_s(), ..time })
    }

    /// Returns the tick that applies an input that is made now, if the user shows the world and the world
    /// keeps real time.
    pub fn predicted_tick(&mut self, now: Duration) -> Option<f64> {
        if self.world.as_ref()?.pace != Pace::RealTime {
            return None;
        }
        let showing = self.showing.as_mut()?;
        let (world_tick, period_s) = showing.playback.world_tick(now)?;
        Some(showing.lead.advance(now, world_tick, period_s))
    }

    /// Returns the tick that an input made now is to name.
    pub fn name_tick(&mut self, now: Duration) -> Option<Tick> {
        let predicted = self.predicted_tick(now)?;
        let showing = self.showing.as_mut()?;
        let next = Tick(predicted.max(0.0) as u64 + 1);
        // The predicted tick goes back with the world, or hardly.
        let goes_back = next.next() < showing.named;
        showing.named = if goes_back { next } else { next.max(showing.named) };
        Some(showing.named)
    }

    /// Returns the newest tick of which everything that moves was told, speculative ones left out.
    pub fn told_tick(&self) -> Option<Tick> {
        Some(Tick(self.showing.as_ref()?.playback.told()? as u64))
    }

    /// Returns the tick that the oldest of the inputs named which were not applied by [`Client::told_tick`].
    pub fn first_unapplied(&self) -> Option<Tick> {
        self.showing.as_ref()?.inputs.waiting.front().map(|sent| sent.named)
    }

    /// Returns the motion of a body at a tick by what was told of it, and whether it rested.
    pub fn told_at(&self, id: BodyId, tick: Tick) -> Option<(Motion, bool)> {
        let told = self.showing.as_ref().and_then(|showing| showing.playback.told_at(id, tick.0 as f64));
        told.or_else(|| {
            self.bodies.get(&id).map(|view| (Motion::of(&view.body.state), view.body.state.sleeping))
        })
    }

    /// Returns the motion of a body as it is shown at a tick; `None` if the body is not known.
    pub fn view(&self, id: BodyId, tick: f64) -> Option<Motion> {
        let shown = self.showing.as_ref().and_then(|showing| showing.playback.at(id, tick));
        shown.or_else(|| self.bodies.get(&id).map(|view| Motion::of(&view.body.state)))
    }
}

/// An input that is not applied yet.
#[derive(Clone, Copy, Debug)]
struct Sent {
    body: BodyId,
    logical_time: u64,
    at: Duration,
    /// The tick that it names; 0: none.
    named: Tick,
    /// The tick that the world was at, if the input names one.
    world_tick: Option<f64>,
}

/// The time from an input to the first state that shows it.
#[derive(Clone, Debug, Default)]
struct InputDelay {
    /// The inputs that wait, in the order in which they were sent.
    waiting: VecDeque<Sent>,
    delays: VecDeque<Duration>,
}

impl InputDelay {
    fn sent(&mut self, input: Sent) {
        self.waiting.push_back(input);
        if self.waiting.len() > WAITING {
            self.waiting.pop_front();
        }
    }

    /// Notes that this input is applied. Those before it were too, or were replaced by it. Returns it, if it
    /// was not known to be applied.
    fn applied(&mut self, now: Duration, logical_time: u64) -> Option<Sent> {
        let count = self.waiting.partition_point(|waiting| waiting.logical_time <= logical_time);
        let newest = self.waiting.drain(..count).next_back()?;
        self.delays.push_back(now.saturating_sub(newest.at));
        if self.delays.len() > DELAYS {
            self.delays.pop_front();
        }
        Some(newest).filter(|newest| newest.logical_time == logical_time)
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
            let named = Tick(0);
            let (body, at) = (BodyId::default(), at(10 * logical_time));
            inputs.sent(Sent { body, logical_time, at, named, world_tick: None });
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
