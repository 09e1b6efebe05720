//! Moves the tick that is shown of a world, smoothly and as little behind the world as the arriving states
//! allow (a jitter buffer).

use std::time::Duration;

/// The number of depths told apart, each [`STEP_S`] deeper than the one before: half a second in all.
const DEPTHS: usize = 128;
const STEP_S: f64 = 0.004;
/// The share of states that may arrive later than the buffer is deep.
const LATE: f32 = 0.015;
/// The share of their weight that earlier states keep with each batch: those of some two seconds count.
const KEPT: f32 = 0.97;
/// The number of batches back from which the last known state of a body counts at most.
const MOST_BATCHES: f64 = 2.0;
/// The margin added to the depth of the buffer, seconds.
const MARGIN_S: f64 = 0.004;
/// The depth before anything is measured, seconds.
const FIRST_S: f64 = 0.1;
/// The gap between states of a body above which the network was not the cause, seconds: the body was not told
/// of.
const PAUSE_S: f64 = 1.0;
/// The share by which the shown tick runs faster or slower to approach its goal.
const SLEW: f64 = 0.1;
/// The same where it is farther off than [`FAR_S`].
const FAST_SLEW: f64 = 0.5;
/// The most by which that share changes per second: a body that moves at 10 m/s is then shown to gain or lose
/// 10 m/s² by it.
const EASE_PER_S: f64 = 1.0;
/// The distance from the goal above which [`FAST_SLEW`] applies, seconds.
const FAR_S: f64 = 0.1;
/// The lag above which the shown tick jumps forward, seconds.
const JUMP_S: f64 = 0.5;
/// The lead above which the shown tick jumps back, seconds: only a fault can cause it.
const BACK_S: f64 = 3.0;

/// The tick that is shown, and how deep the buffer behind it is.
#[derive(Clone, Debug)]
pub(super) struct Playhead {
    /// The tick shown last, and when that was.
    shown: Option<(f64, Duration)>,
    /// The share by which the shown tick runs faster than the world, or slower if it is negative.
    slew: f64,
    /// The tick of the last batch of states, and the tick of the batch before.
    last: Option<f64>,
    before: Option<f64>,
    /// For each depth, the number of states that came while what was known of their bodies was so old. Later
    /// states weigh more.
    late: Box<[f32; DEPTHS]>,
}

impl Default for Playhead {
    fn default() -> Self {
        Self { shown: None, slew: 0.0, last: None, before: None, late: Box::new([0.0; DEPTHS]) }
    }
}

impl Playhead {
    /// Begins a batch of states of this tick.
    pub(super) fn begin(&mut self, tick: f64) {
        if self.last.is_none_or(|last| last < tick) {
            self.before = self.last.replace(tick);
            self.late.iter_mut().for_each(|count| *count *= KEPT);
        }
    }

    /// Notes that a state of a moving body has come. It is of `tick`, the state known until then was of
    /// `known`, and the world is at `world_tick`. A body that several batches left out was not lost with
    /// them: it goes on as it did, or there was no room for it.
    pub(super) fn note(&mut self, world_tick: f64, tick: f64, known: f64, period_s: f64) {
        if !(0.0..PAUSE_S).contains(&((world_tick - known) * period_s)) {
            return;
        }
        let behind_s = (world_tick - known.max(tick - MOST_BATCHES * self.cadence())) * period_s;
        if behind_s >= 0.0 {
            self.late[((behind_s / STEP_S) as usize).min(DEPTHS - 1)] += 1.0;
        }
    }

    /// Counts ticks anew: this tick is shown now.
    pub(super) fn rebase(&mut self, tick: f64) {
        self.shown = self.shown.map(|(_, at)| (tick, at));
        (self.last, self.before) = (None, None);
    }

    /// Returns the ticks between two batches of states.
    pub(super) fn cadence(&self) -> f64 {
        let gap = self.last.zip(self.before).map(|(last, before)| last - before);
        gap.unwrap_or(3.0).clamp(1.0, 12.0)
    }

    /// Returns the tick shown last.
    pub(super) fn shown(&self) -> Option<f64> {
        self.shown.map(|(tick, _)| tick)
    }

    /// Returns by how many seconds the shown tick should be behind the world.
    fn depth_s(&self) -> f64 {
        let most = self.late.iter().sum::<f32>() * LATE;
        let mut later = 0.0;
        let depth = self.late.iter().rposition(|count| {
            later += count;
            later > most
        });
        depth.map_or(FIRST_S, |depth| (depth + 1) as f64 * STEP_S + MARGIN_S)
    }

    /// Returns the tick to show now, and whether the shown tick jumps there. It is hardly ever below the last
    /// one. `limit` is the last tick that can be shown.
    pub(super) fn advance(
        &mut self,
        now: Duration,
        world_tick: f64,
        limit: f64,
        period_s: f64,
    ) -> (f64, bool) {
        let target = (world_tick - self.depth_s() / period_s).min(limit);
        let Some((shown, at)) = self.shown else {
            // A world that is younger than the buffer is deep is shown as it began.
            self.shown = (target >= 0.0).then_some((target, now));
            return (target.max(0.0), false);
        };
        let elapsed = now.saturating_sub(at).as_secs_f64() / period_s;
        let off = target - (shown + elapsed);
        let jumps = off * period_s > JUMP_S || off * period_s < -BACK_S;
        let most = if off.abs() * period_s > FAR_S { FAST_SLEW } else { SLEW };
        // No faster than it can still slow down from.
        let wanted = most.min((2.0 * EASE_PER_S * off.abs() * period_s).sqrt()).copysign(off);
        let ease = EASE_PER_S * elapsed * period_s;
        self.slew += (wanted - self.slew).clamp(-ease, ease);
        let next = match jumps {
            true => target.max(0.0),
            false => (shown + elapsed * (1.0 + self.slew)).min(limit.max(shown)),
        };
        self.shown = Some((next, now));
        (next, jumps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 1.0 / 60.0;

    fn at(ticks: f64) -> Duration {
        Duration::from_secs_f64(10.0 + ticks * DT_S)
    }

    /// Plays 600 ticks. The states of every third tick come `late` ticks later; frames are 1.7 ticks long.
    /// Returns for each frame the world's tick, the tick shown, and the tick of the newest state.
    fn play(late: impl Fn(u32) -> f64) -> Vec<(f64, f64, f64)> {
        let mut playhead = Playhead::default();
        let mut come: Vec<_> = (0..600).step_by(3).map(|tick| (f64::from(tick) + late(tick), tick)).collect();
        come.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let (mut next, mut newest) = (come.into_iter().peekable(), 0.0f64);
        (0..350)
            .map(|frame| {
                let world = f64::from(frame) * 1.7;
                while let Some((when, tick)) = next.next_if(|(when, _)| *when <= world) {
                    playhead.begin(tick.into());
                    playhead.note(when, tick.into(), newest, DT_S);
                    newest = newest.max(tick.into());
                }
                (world, playhead.advance(at(world), world, newest + 15.0, DT_S).0, newest)
            })
            .collect()
    }

    #[test]
    fn what_is_shown_is_as_little_behind_as_the_states_that_come_allow() {
        for (way, jitter) in [(0.5, 0.0), (6.0, 1.2), (12.0, 3.0)] {
            let shown = play(|tick| way + jitter * f64::from(tick * 7 % 11) / 10.0);
            for &(world, shown, newest) in &shown[120..] {
                assert!(shown <= newest + 0.3, "{way} {jitter}: {shown} of {newest}");
                assert!(world - shown < 3.0 + way + jitter + 0.8, "{way} {jitter}: {shown} of {world}");
            }
        }
    }

    #[test]
    fn it_goes_at_an_even_pace_and_never_back() {
        let shown = play(|tick| 6.0 + if tick % 30 == 0 { 2.5 } else { 0.4 });
        for pair in shown[60..].windows(2) {
            let pace = (pair[1].1 - pair[0].1) / 1.7;
            assert!((0.89..1.11).contains(&pace), "{pace}");
        }
    }

    #[test]
    fn a_young_world_is_shown_from_its_beginning_on() {
        let shown = play(|_| 1.0);
        assert_eq!(shown[0].1, 0.0);
        for pair in shown[..60].windows(2) {
            let pace = (pair[1].1 - pair[0].1) / 1.7;
            assert!((0.0..1.6).contains(&pace), "{pair:?}");
        }
    }

    #[test]
    fn a_way_that_becomes_longer_slows_it_until_the_buffer_is_deep_enough() {
        let shown = play(|tick| if tick < 300 { 1.0 } else { 13.0 });
        assert!(shown.windows(2).all(|pair| pair[1].1 >= pair[0].1), "never back");
        let &(world, last, newest) = shown.last().unwrap();
        assert!(last <= newest + 0.1 && world - last > 15.0, "{last} of {newest} at {world}");
    }

    #[test]
    fn it_stops_at_its_limit_and_is_soon_back_after_a_pause() {
        let mut playhead = Playhead::default();
        for tick in 0..20 {
            let tick = 3.0 * f64::from(tick);
            playhead.begin(tick);
            playhead.note(tick + 1.0, tick, tick - 3.0, DT_S);
            playhead.advance(at(tick + 1.0), tick + 1.0, tick + 15.0, DT_S);
        }
        for tick in 58..300 {
            let tick = f64::from(tick);
            assert!(playhead.advance(at(tick), tick, 72.0, DT_S).0 <= 72.0);
        }
        playhead.begin(300.0);
        playhead.note(300.0, 300.0, 57.0, DT_S);
        let (shown, jumps) = playhead.advance(at(301.0), 301.0, 315.0, DT_S);
        assert!(shown > 290.0 && jumps);
        assert!(playhead.depth_s() < 5.0 * DT_S, "the pause does not count");
    }
}
