//! Shows a world smoothly, at any time between and shortly beyond its known states: by a clock of its ticks,
//! a jitter buffer, interpolation, bounded extrapolation, and errors that fade out (thesis 3.3.11, 4.3.2.10).

mod clock;
mod lead;
mod melt;
mod motion;
mod playhead;
mod track;

use std::collections::BTreeMap;
use std::time::Duration;

use self::clock::TickClock;
pub(crate) use self::lead::Lead;
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) use self::melt::Melt;
pub use self::motion::Motion;
use self::motion::{BEYOND_S, GOES_ON_S, Reckoning, vector};
use self::playhead::Playhead;
use self::track::Track;
use crate::protocol::{SharedState, Stamp};
use crate::space::BodyId;

/// The number of ticks before the shown tick up to which all is taken to have been told, where nothing moves.
const STILL_UNTOLD: f64 = 20.0;

/// The number of ticks between two sweeps that drop tracks of resting bodies.
const SWEEP: f64 = 60.0;

/// The ticks at which to show a world now, as [`World::view_time`](crate::World::view_time) returns them. A
/// fraction is a time between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ViewTime {
    /// The tick that the world is at, as far as it is known. For own avatars use `predicted`.
    /// Moving bodies are extrapolated to it.
    pub now: f64,
    /// A tick a little ago, whose states have arrived by now: for all else. It advances evenly, unless ticks
    /// are counted anew because a speculative tick is taken back or the world goes back to a save.
    pub shown: f64,
    /// The tick in which nodes apply what an own avatar is asked now, where a client predicts
    /// ([`World::set_prediction`](crate::World::set_prediction)). Own avatars and what they touch are shown
    /// at this tick. Without prediction it is the same as `now`.
    pub predicted: f64,
    /// The bound on the error of `now` that comes from clocks, seconds. `None` until pings are answered,
    /// where there is no network, and in a participant, which counts the way of what it is told as nothing.
    pub clock_error_s: Option<f64>,
    /// The time from an input to the first state that shows its effect, seconds: the median of the last ones.
    /// `None` before the first.
    pub input_delay_s: Option<f64>,
}

impl ViewTime {
    /// Returns a time of one's own choice to look at, without prediction: `now` for own avatars, `shown` for
    /// all else.
    #[must_use]
    pub const fn new(now: f64, shown: f64) -> Self {
        Self { now, shown, predicted: now, clock_error_s: None, input_delay_s: None }
    }

    /// Returns the same with another tick for own avatars and what they touch.
    #[must_use]
    pub const fn predicting(self, tick: f64) -> Self {
        Self { predicted: tick, ..self }
    }
}

/// The states of a served world that are kept to show it.
#[derive(Clone, Debug)]
pub(crate) struct Playback {
    reckoning: Reckoning,
    clock: TickClock,
    playhead: Playhead,
    tracks: BTreeMap<BodyId, Track>,
    /// Says whether anything moved in the newest batch (then the next should come soon), and its tick.
    moves: bool,
    newest_batch: f64,
    /// The newest tick heard of that is no guess (not speculative).
    settled: f64,
    /// Says whether the newest tick heard of is a guess (speculative).
    guesses: bool,
    /// Says whether ticks are counted anew from the next one heard of on.
    recounts: bool,
    sweep_at: f64,
}

impl Playback {
    /// Creates the playback of a world with ticks of `dt_s` seconds and this gravity, m/s².
    pub(crate) fn new(dt_s: f32, gravity: [f32; 3]) -> Self {
        let dt_s = f64::from(dt_s).max(1e-6);
        Self {
            reckoning: Reckoning { dt_s, gravity: vector(gravity), told: f64::NEG_INFINITY },
            clock: TickClock::new(dt_s),
            playhead: Playhead::default(),
            tracks: BTreeMap::new(),
            moves: false,
            newest_batch: f64::NEG_INFINITY,
            settled: f64::NEG_INFINITY,
            guesses: false,
            recounts: false,
            sweep_at: 0.0,
        }
    }

    /// Sets the leader's clock minus ours, and the bound on its error, microseconds.
    pub(crate) fn set_offset_us(&mut self, offset: i64, error: u64) {
        self.clock.set_offset(offset as f64 * 1e-6, error as f64 * 1e-6);
    }

    /// Follows another leader, whose clock differs from the former one's.
    pub(crate) fn change_leader(&mut self) {
        self.clock.change_leader();
    }

    /// Counts ticks anew from the next one heard of on.
    pub(crate) fn recount(&mut self) {
        self.recounts = true;
    }

    /// Takes in the stamp of a batch of states, before each state is learned.
    pub(crate) fn hear(&mut self, now: Duration, stamp: &Stamp, states: &[SharedState]) {
        let tick = stamp.tick.0 as f64;
        if std::mem::take(&mut self.recounts) {
            self.settled = f64::NEG_INFINITY;
            self.hear_anew(now, stamp, true);
        } else if stamp.speculative && tick <= self.settled {
            // A guess that comes late.
            return;
        } else {
            // Settled states withdraw the guesses, unless they come late and are of a tick before the
            // guesses.
            let withdraws = self.guesses && !stamp.speculative && tick > self.settled;
            self.hear_anew(now, stamp, withdraws && self.clock.newest().is_some_and(|newest| tick < newest));
        }
        let moves = states.iter().any(|state| !state.sleeping);
        if self.clock.newest() == Some(tick) {
            // A batch comes in several parts.
            self.moves = moves || self.moves && self.newest_batch == tick;
            (self.guesses, self.newest_batch) = (stamp.speculative, tick);
            // A node that guesses does not know what other nodes would tell of.
            if !stamp.speculative {
                self.tell_up_to(tick);
            }
        }
        if !stamp.speculative {
            self.settled = self.settled.max(tick);
        }
        if !states.is_empty() {
            self.playhead.begin(tick);
        }
    }

    /// Notes that all nodes have told of this tick. Bodies that were shown slowing down, because nothing came
    /// for long, go on from where they are shown.
    fn tell_up_to(&mut self, tick: f64) {
        let former = std::mem::replace(&mut self.reckoning.told, tick);
        let slowed = |shown: &f64| (*shown - former) * self.reckoning.dt_s > GOES_ON_S && former < tick;
        if let Some(shown) = self.playhead.shown().filter(slowed) {
            let before = Reckoning { told: former, ..self.reckoning };
            self.tracks.values_mut().for_each(|track| track.reckon_anew(shown, &before, &self.reckoning));
        }
    }

    fn hear_anew(&mut self, now: Duration, stamp: &Stamp, anew: bool) {
        let (tick, newest) = (stamp.tick.0 as f64, self.clock.newest());
        let opened = (stamp.opened_us != 0).then(|| Duration::from_micros(stamp.opened_us));
        self.clock.hear(now, tick, opened, anew);
        if let (Some(newest), Some(shown)) = (newest.filter(|_| anew), self.playhead.shown()) {
            // What is shown now stays, and all that is told from here on is of later ticks.
            let to = (shown - newest + tick).min(tick - self.playhead.cadence());
            self.playhead.rebase(to);
            self.tracks.values_mut().for_each(|track| track.rebase(shown, to, &self.reckoning));
            self.sweep_at = to;
        }
    }

    /// Takes in the state of a body. `before` is its motion when it was last heard of.
    pub(crate) fn learn(&mut self, now: Duration, stamp: &Stamp, state: &SharedState, before: Motion) {
        let tick = stamp.tick.0 as f64;
        let cadence = self.playhead.cadence();
        let shown = self.playhead.shown().unwrap_or(tick - cadence);
        let track = self.tracks.entry(state.id).or_insert_with(|| Track::new(tick - cadence, before));
        if let (Some(known), Some(world_tick)) = (track.moves_at(), self.clock.tick_at(now)) {
            self.playhead.note(world_tick, tick, known, self.clock.period_s());
        }
        let motion = Motion { pose: state.pose, velocity: state.velocity };
        track.learn((tick, motion, state.sleeping), stamp.speculative, cadence, shown, &self.reckoning);
    }

    /// Lets a body stand where it was told last, from that tick on: nothing more will be heard of it.
    pub(crate) fn stand(&mut self, id: BodyId) {
        if let (Some(track), Some(shown)) = (self.tracks.get_mut(&id), self.playhead.shown()) {
            track.stand(shown, &self.reckoning);
        }
    }

    /// Forgets a body.
    pub(crate) fn forget(&mut self, id: BodyId) {
        self.tracks.remove(&id);
    }

    /// Returns the ticks to show now.
    pub(crate) fn time(&mut self, now: Duration) -> Option<ViewTime> {
        let (newest, world_tick) = (self.clock.newest()?, self.clock.tick_at(now)?);
        let period_s = self.clock.period_s();
        // While something moves, its motion long after the last state is unknown: time stops there.
        let limit = if self.moves { newest + BEYOND_S / period_s } else { f64::INFINITY };
        let before = self.playhead.shown();
        let (shown, jumps) = self.playhead.advance(now, world_tick, limit, period_s);
        if let Some(before) = before.filter(|_| jumps) {
            self.tracks.values_mut().for_each(|track| track.jump(before, shown, &self.reckoning));
        }
        if self.sweep_at <= shown {
            self.sweep_at = shown + SWEEP;
            self.tracks.retain(|_, track| !track.rests_since_before(shown - SWEEP));
        }
        let now = world_tick.min(limit).max(shown);
        Some(ViewTime { clock_error_s: self.clock.error_s(), ..ViewTime::new(now, shown) })
    }

    /// Returns the tick that the world is at, whether or not anything was heard of it lately, and the seconds
    /// that a tick takes.
    pub(crate) fn world_tick(&self, now: Duration) -> Option<(f64, f64)> {
        Some((self.clock.tick_at(now)?, self.clock.period_s()))
    }

    /// Returns the newest tick up to which everything that moves was told, guesses left out. Where nothing
    /// moves, little is told.
    pub(crate) fn told(&self) -> Option<f64> {
        let told = Some(self.reckoning.told).filter(|told| told.is_finite())?;
        let still = self.playhead.shown().filter(|_| !self.moves && !self.guesses);
        // A body that begins to move is told of some time after it began.
        Some(still.map_or(told, |shown| told.max(shown - STILL_UNTOLD)))
    }

    /// Returns the motion of a body at a tick by what was told of it, and whether it rested; `None` if
    /// nothing was heard of it for long.
    pub(crate) fn told_at(&self, id: BodyId, tick: f64) -> Option<(Motion, bool)> {
        let track = self.tracks.get(&id)?;
        Some((track.told_at(tick, &self.reckoning), track.rests_at(tick)))
    }

    /// Returns the motion in which a body is shown at a tick; `None` if nothing was heard of it for long:
    /// then it is as told last.
    pub(crate) fn at(&self, id: BodyId, tick: f64) -> Option<Motion> {
        Some(self.tracks.get(&id)?.at(tick, &self.reckoning))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Velocity, WorldPose};
    use crate::space::{Epoch, GroupId, RegionId, Tick};

    const ID: BodyId = BodyId::persistent(1);
    const DT_S: f64 = 1.0 / 60.0;

    /// Tells of a body that moves at 6 m/s, or rests, at the time `at`, in ticks by our clock.
    fn tell(playback: &mut Playback, at: f64, tick: u64, x: f64, sleeping: bool, speculative: bool) {
        let velocity = Velocity::linear(if sleeping { [0.0; 3] } else { [6.0, 0.0, 0.0] });
        let pose = WorldPose::at([x, 0.0, 0.0]);
        let state = SharedState { id: ID, owner: RegionId(1), epoch: Epoch(0), pose, velocity, sleeping };
        let opened_us = (1e6 * (100.0 + (at - 1.0) * DT_S)) as u64;
        let stamp = Stamp { opened_us, ..Stamp::untimed(GroupId(1), Tick(tick), speculative) };
        let now = Duration::from_secs_f64(at * DT_S);
        playback.hear(now, &stamp, &[state]);
        playback.learn(now, &stamp, &state, Motion::at_rest(pose));
    }

    fn show(playback: &mut Playback, at: f64) -> (f64, f64) {
        let time = playback.time(Duration::from_secs_f64(at * DT_S)).unwrap();
        // Nothing is kept of a body that has rested for long: it is where it was told last.
        (time.shown, playback.at(ID, time.shown).map_or(29.7, |motion| motion.pose.translation[0]))
    }

    /// Everything rests in a minute of silence, after which another group, or a save, counts ticks
    /// differently.
    #[test]
    fn what_is_told_after_ticks_are_counted_anew_is_shown() {
        for count in [3_000_000, 40] {
            let mut playback = Playback::new(DT_S as f32, [0.0; 3]);
            for tick in (0..300).step_by(3) {
                tell(&mut playback, tick as f64 + 1.0, tick, 0.1 * tick as f64, tick == 297, false);
                show(&mut playback, tick as f64 + 1.5);
            }
            let (before, _) = show(&mut playback, 4_000.0);
            assert!(before > 3_900.0, "where nothing moves, time goes on");
            playback.change_leader();
            playback.recount();
            let mut last = show(&mut playback, 4_000.1).1;
            for i in 0..60u64 {
                let at = 4_001.0 + 3.0 * i as f64;
                tell(&mut playback, at, count + 3 * i, 29.7 + 0.3 * i as f64, false, false);
                let (_, x) = show(&mut playback, at + 0.5);
                assert!((-0.1..1.0).contains(&(x - last)), "{count}: from {last} to {x}");
                last = x;
            }
            let (shown, x) = show(&mut playback, 4_179.0);
            assert!((x - 29.7 - 0.1 * (shown - count as f64)).abs() < 0.02, "{count}: {x} at {shown}");
            assert!(shown > count as f64 + 165.0);
        }
    }

    /// Nothing came for a while, so everything slowed down. Then a batch comes that leaves out one body.
    #[test]
    fn a_body_that_is_not_told_of_after_a_pause_does_not_jump() {
        let mut playback = Playback::new(DT_S as f32, [0.0; 3]);
        for tick in (0..60).step_by(3) {
            tell(&mut playback, tick as f64 + 1.0, tick, 0.1 * tick as f64, false, false);
            show(&mut playback, tick as f64 + 1.5);
        }
        let (_, mut last) = show(&mut playback, 61.0);
        for tenth in 610..900 {
            let at = f64::from(tenth) / 10.0;
            if tenth == 700 {
                let stamp = Stamp::untimed(GroupId(1), Tick(69), false);
                let pose = WorldPose::default();
                let velocity = Velocity::default();
                let id = BodyId::persistent(2);
                let other =
                    SharedState { id, owner: RegionId(1), epoch: Epoch(0), pose, velocity, sleeping: false };
                playback.hear(Duration::from_secs_f64(at * DT_S), &stamp, &[other]);
            }
            let (_, x) = show(&mut playback, at);
            assert!((-1e-9..0.03).contains(&(x - last)), "from {last} to {x} at {at}");
            last = x;
        }
    }

    #[test]
    fn guesses_that_come_late_and_states_that_do_withdraw_nothing() {
        let mut playback = Playback::new(DT_S as f32, [0.0; 3]);
        for tick in (0..60).step_by(3) {
            tell(&mut playback, tick as f64 + 1.0, tick, 0.1 * tick as f64, false, false);
            show(&mut playback, tick as f64 + 1.5);
        }
        tell(&mut playback, 61.0, 60, 6.0, false, true);
        tell(&mut playback, 64.0, 63, 6.3, false, true);
        let before = show(&mut playback, 64.5).0;
        // A late part of the batch of tick 57.
        tell(&mut playback, 64.6, 57, 5.7, false, false);
        assert!(show(&mut playback, 64.7).0 > before);
        // A settled state comes after 30 ticks were guessed.
        tell(&mut playback, 90.0, 90, 9.0, false, true);
        let so_far = show(&mut playback, 90.2).1;
        tell(&mut playback, 91.0, 60, 6.0, false, false);
        let (shown, x) = show(&mut playback, 91.1);
        assert!(shown < 61.0, "{shown}: it counts anew");
        assert!((-1e-6..0.5).contains(&(x - so_far)), "{x}: it shows what it showed, {so_far}");
        tell(&mut playback, 91.2, 60, 6.0, false, true);
        assert_eq!(playback.clock.newest(), Some(60.0));
        tell(&mut playback, 92.0, 63, 6.3, false, false);
        assert!(playback.clock.newest() == Some(63.0) && !playback.guesses);
    }
}
