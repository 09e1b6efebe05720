//! Shows a world smoothly, at any time between and shortly beyond the states that are known of it: a clock of its ticks, a jitter buffer,
//! interpolation, bounded extrapolation, and errors that melt away (thesis 3.3.11, 4.3.2.10).

mod clock;
mod motion;
mod playhead;
mod track;

use std::collections::BTreeMap;
use std::time::Duration;

use self::clock::TickClock;
use self::motion::BEYOND_S;
pub use self::motion::Motion;
use self::playhead::Playhead;
use self::track::Track;
use crate::protocol::{SharedState, Stamp};
use crate::space::BodyId;

/// How often tracks of bodies that rest are dropped, ticks.
const SWEEP: f64 = 60.0;

/// The ticks at which to show a world now, as [`World::view_time`](crate::World::view_time) returns them. A fraction is a time between
/// two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ViewTime {
    /// The tick that the world is at, as far as known: for what must not lag, as an own avatar. What moves is extrapolated.
    pub now: f64,
    /// The tick whose states have come by now, a little ago: for all else. It goes forward evenly.
    pub shown: f64,
    /// The bound on the error of `now` that comes from clocks, seconds; `None` until pings tell, and where no network is between.
    pub clock_error_s: Option<f64>,
    /// The time from an input to the first state that shows it, seconds: the median of the last ones. `None` before the first.
    pub input_delay_s: Option<f64>,
}

impl ViewTime {
    /// Returns the times at which to show own avatars, and all else: to look at a time of one's own choice.
    #[must_use]
    pub const fn new(now: f64, shown: f64) -> Self {
        Self { now, shown, clock_error_s: None, input_delay_s: None }
    }
}

/// The states of a served world that are kept to show it.
#[derive(Clone, Debug)]
pub(crate) struct Playback {
    dt_s: f64,
    clock: TickClock,
    playhead: Playhead,
    tracks: BTreeMap<BodyId, Track>,
    /// Whether anything moved in the newest batch: if so, the next is to come soon.
    moves: bool,
    /// Whether the newest tick heard of is a guess.
    guesses: bool,
    /// Whether the next tick heard of is counted otherwise than those before.
    recounts: bool,
    sweep_at: f64,
}

impl Playback {
    /// Returns one of a world with ticks of this length.
    pub(crate) fn new(dt_s: f32) -> Self {
        let dt_s = f64::from(dt_s).max(1e-6);
        Self {
            dt_s,
            clock: TickClock::new(dt_s),
            playhead: Playhead::default(),
            tracks: BTreeMap::new(),
            moves: false,
            guesses: false,
            recounts: false,
            sweep_at: 0.0,
        }
    }

    /// Sets the leader's clock minus ours, and the bound on its error, microseconds.
    pub(crate) fn set_offset_us(&mut self, offset: Option<(i64, u64)>) {
        let seconds = |(offset, error): (i64, u64)| (offset as f64 * 1e-6, error as f64 * 1e-6);
        self.clock.set_offset(offset.map(seconds));
    }

    /// Follows another leader, whose clock is another.
    pub(crate) fn change_leader(&mut self) {
        self.clock.change_leader();
    }

    /// Begins to count ticks anew with the next one heard of.
    pub(crate) fn recount(&mut self) {
        self.recounts = true;
    }

    /// Takes in which tick states are of, before they are learned.
    pub(crate) fn hear(&mut self, now: Duration, stamp: &Stamp, states: &[SharedState]) {
        let tick = stamp.tick.0 as f64;
        let newest = self.clock.newest();
        let withdraws = self.guesses && !stamp.speculative && newest.is_some_and(|newest| tick < newest);
        let anew = std::mem::take(&mut self.recounts) || withdraws;
        let opened = (stamp.opened_us != 0).then(|| Duration::from_micros(stamp.opened_us));
        self.clock.hear(now, tick, opened, anew);
        if let Some(newest) = newest.filter(|_| anew) {
            self.go_back(newest - tick);
        }
        if self.clock.newest() == Some(tick) {
            self.guesses = stamp.speculative;
            self.moves = states.iter().any(|state| !state.sleeping);
        }
        if !states.is_empty() {
            self.playhead.begin(tick);
        }
    }

    /// Shows what it showed, at a tick that is so many ticks earlier.
    fn go_back(&mut self, ticks: f64) {
        let Some(shown) = self.playhead.shown() else { return };
        let to = shown - ticks;
        self.playhead.rebase(to);
        for track in self.tracks.values_mut() {
            track.rebase(shown, to, self.dt_s);
        }
    }

    /// Takes in the state of a body, which was like `before` when it was last heard of.
    pub(crate) fn learn(&mut self, now: Duration, stamp: &Stamp, state: &SharedState, before: Motion) {
        let tick = stamp.tick.0 as f64;
        let cadence = self.playhead.cadence();
        let shown = self.playhead.shown().unwrap_or(tick - cadence);
        let track = self.tracks.entry(state.id).or_insert_with(|| Track::new(tick - cadence, before));
        if let (Some(known), Some(world_tick)) = (track.moves_at(), self.clock.tick_at(now)) {
            self.playhead.note((world_tick - known) * self.clock.period_s());
        }
        let motion = Motion { pose: state.pose, velocity: state.velocity };
        track.learn((tick, motion, state.sleeping), stamp.speculative, cadence, shown, self.dt_s);
    }

    /// Forgets a body.
    pub(crate) fn forget(&mut self, id: BodyId) {
        self.tracks.remove(&id);
    }

    /// Returns the ticks to show now.
    pub(crate) fn time(&mut self, now: Duration) -> Option<ViewTime> {
        let (newest, world_tick) = (self.clock.newest()?, self.clock.tick_at(now)?);
        let period_s = self.clock.period_s();
        // While something moves, nobody knows how it is long after it was last heard of.
        let limit = if self.moves { newest + BEYOND_S / period_s } else { f64::INFINITY };
        let before = self.playhead.shown();
        let (shown, jumps) = self.playhead.advance(now, world_tick, limit, period_s);
        if let Some(before) = before.filter(|_| jumps) {
            self.tracks.values_mut().for_each(|track| track.jump(before, shown, self.dt_s));
        }
        if self.sweep_at <= shown {
            self.sweep_at = shown + SWEEP;
            self.tracks.retain(|_, track| !track.rests_since_before(shown - SWEEP));
        }
        Some(ViewTime {
            now: world_tick.min(limit).max(shown),
            shown,
            clock_error_s: self.clock.error_s(),
            input_delay_s: None,
        })
    }

    /// Returns how a body is shown at a tick; `None` if nothing was heard of it since long: then it is as it was told last.
    pub(crate) fn at(&self, id: BodyId, tick: f64) -> Option<Motion> {
        Some(self.tracks.get(&id)?.at(tick, self.dt_s))
    }
}
