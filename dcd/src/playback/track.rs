//! Keeps the last states of one body, and shows it at any time between and shortly beyond them (snapshot
//! interpolation).
//!
//! Where a new state contradicts what was extrapolated and shown, the difference fades out within moments
//! instead of being seen as a jump.

use std::collections::VecDeque;

use super::melt::Melt;
use super::motion::{Motion, Reckoning};
use crate::protocol::Velocity;

/// The most states kept of one body.
const KEPT: usize = 16;

/// The state of a body after one tick.
#[derive(Clone, Copy, Debug)]
struct Sample {
    tick: f64,
    motion: Motion,
    rests: bool,
    speculative: bool,
}

/// The last states of one body, in order of ticks.
#[derive(Clone, Debug)]
pub(super) struct Track {
    samples: VecDeque<Sample>,
    melt: Option<Melt>,
}

impl Track {
    /// Creates the track of a body that rested in this motion up to a tick.
    pub(super) fn new(tick: f64, motion: Motion) -> Self {
        let first = Sample { tick, motion, rests: true, speculative: false };
        Self { samples: [first].into(), melt: None }
    }

    fn newest(&self) -> &Sample {
        self.samples.back().expect("a track has a state")
    }

    /// Returns whether the body has rested since before a tick.
    pub(super) fn rests_since_before(&self, tick: f64) -> bool {
        self.newest().rests && self.newest().tick < tick
    }

    /// Returns the tick of the newest state, if the body moves.
    pub(super) fn moves_at(&self) -> Option<f64> {
        Some(self.newest()).filter(|newest| !newest.rests).map(|newest| newest.tick)
    }

    /// Adds the state after a tick: the tick, the motion, and whether the body rests. A moving body is told
    /// of within `cadence` ticks. `shown` is the tick that was shown last, at which errors are measured.
    pub(super) fn learn(
        &mut self,
        state: (f64, Motion, bool),
        speculative: bool,
        cadence: f64,
        shown: f64,
        reckoning: &Reckoning,
    ) {
        let (tick, motion, rests) = state;
        let newest = *self.newest();
        let is_guessed = newest.speculative && !speculative;
        if tick <= newest.tick && !is_guessed {
            return;
        }
        let before = self.at(shown, reckoning);
        while self.samples.len() > 1 && self.newest().speculative && !speculative {
            self.samples.pop_back();
        }
        let newest = *self.newest();
        if newest.rests && newest.tick < tick - cadence {
            // It began to move after the last batch, which did not tell of it.
            self.samples.push_back(Sample { tick: tick - cadence, ..newest });
        }
        if tick <= self.newest().tick {
            self.samples.clear();
        }
        self.samples.push_back(Sample { tick, motion, rests, speculative });
        while self.samples.len() > KEPT {
            self.samples.pop_front();
        }
        self.melt_from(before, shown, reckoning);
    }

    /// Begins anew at the tick `to` with what is shown now: ticks before and after it are counted
    /// differently.
    pub(super) fn rebase(&mut self, shown: f64, to: f64, reckoning: &Reckoning) {
        let rests = self.newest().rests;
        let motion = self.at(shown, reckoning);
        *self = Self::new(to, motion);
        self.samples[0].rests = rests;
    }

    /// Goes from the shown tick `from` to the tick `to` as smoothly as possible.
    pub(super) fn jump(&mut self, from: f64, to: f64, reckoning: &Reckoning) {
        let before = self.at(from, reckoning);
        self.melt_from(before, to, reckoning);
    }

    /// Goes on from what was shown with the former assumptions.
    pub(super) fn reckon_anew(&mut self, shown: f64, former: &Reckoning, reckoning: &Reckoning) {
        let before = self.at(shown, former);
        self.melt_from(before, shown, reckoning);
    }

    /// Lets the body stand still from its newest state on.
    pub(super) fn stand(&mut self, shown: f64, reckoning: &Reckoning) {
        let before = self.at(shown, reckoning);
        if let Some(newest) = self.samples.back_mut() {
            newest.rests = true;
        }
        self.melt_from(before, shown, reckoning);
    }

    /// Notes the difference between what was shown and what is known as an error that fades out.
    fn melt_from(&mut self, before: Motion, shown: f64, reckoning: &Reckoning) {
        let bare = self.told_at(shown, reckoning);
        self.melt = Melt::after(self.melt.take(), &before, &bare, shown, reckoning.dt_s);
    }

    /// Returns the motion in which the body is shown at a tick.
    pub(super) fn at(&self, tick: f64, reckoning: &Reckoning) -> Motion {
        let mut motion = self.told_at(tick, reckoning);
        if let Some(melt) = &self.melt {
            melt.apply(&mut motion, tick, reckoning.dt_s);
        }
        motion
    }

    /// Returns whether the body rests at a tick, as far as known.
    pub(super) fn rests_at(&self, tick: f64) -> bool {
        self.samples.iter().rev().find(|sample| sample.tick <= tick).is_none_or(|sample| sample.rests)
    }

    /// Returns the motion of the body at a tick by what is known of it.
    pub(super) fn told_at(&self, tick: f64, reckoning: &Reckoning) -> Motion {
        let after = self.samples.partition_point(|sample| sample.tick <= tick);
        match (after.checked_sub(1).map(|i| &self.samples[i]), self.samples.get(after)) {
            (Some(a), Some(b)) => {
                let span = b.tick - a.tick;
                a.motion.towards(&b.motion, span * reckoning.dt_s, (tick - a.tick) / span)
            }
            (Some(last), None) if last.rests => Motion::at_rest(last.motion.pose),
            (Some(last), None) => {
                let before = after.checked_sub(2).map(|i| &self.samples[i]);
                let falls = before.is_some_and(|before| {
                    !before.rests && reckoning.falls(&before.motion, &last.motion, last.tick - before.tick)
                });
                reckoning.beyond(&last.motion, falls, last.tick, tick)
            }
            (None, first) => {
                Motion { velocity: Velocity::default(), ..first.expect("a track has a state").motion }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::protocol::WorldPose;

    const DT_S: f64 = 1.0 / 60.0;
    const CADENCE: f64 = 3.0;
    /// Nothing falls, and no batch has been told.
    const RECKONING: Reckoning =
        Reckoning { dt_s: DT_S, gravity: Vector3::new(0.0, 0.0, 0.0), told: f64::NEG_INFINITY };

    fn going(x: f64, speed: f32) -> Motion {
        Motion { pose: WorldPose::at([x, 0.0, 0.0]), velocity: Velocity::linear([speed, 0.0, 0.0]) }
    }

    fn x(track: &Track, tick: f64) -> f64 {
        track.at(tick, &RECKONING).pose.translation[0]
    }

    #[test]
    fn a_body_that_rested_is_shown_at_rest_until_it_began_to_move() {
        let mut track = Track::new(0.0, going(0.0, 0.0));
        track.learn((90.0, going(0.1, 3.0), false), false, CADENCE, 85.0, &RECKONING);
        assert_eq!((x(&track, 50.0), x(&track, 87.0), x(&track, 90.0)), (0.0, 0.0, 0.1));
        assert!(x(&track, 88.5) > 0.0);
    }

    #[test]
    fn what_is_shown_of_the_past_does_not_change_when_more_is_known() {
        let mut track = Track::new(0.0, going(0.0, 6.0));
        for tick in (3..12).step_by(3) {
            let tick = f64::from(tick);
            track.learn((tick, going(0.1 * tick, 6.0), false), false, CADENCE, tick - 3.0, &RECKONING);
        }
        let before: Vec<_> = (0..90).map(|at| x(&track, f64::from(at) / 10.0)).collect();
        track.learn((12.0, going(0.0, -6.0), false), false, CADENCE, 9.0, &RECKONING);
        let after: Vec<_> = (0..90).map(|at| x(&track, f64::from(at) / 10.0)).collect();
        assert_eq!(before, after);
    }

    /// The body was shown going on, while a wall had stopped it.
    #[test]
    fn an_error_melts_away_without_a_jump() {
        let mut track = Track::new(0.0, going(0.0, 6.0));
        track.learn((3.0, going(0.3, 6.0), false), false, CADENCE, 0.0, &RECKONING);
        let (wrong, learned) = (10.0, going(0.4, 0.0));
        let shown = track.at(wrong, &RECKONING);
        track.learn((9.0, learned, false), false, CADENCE, wrong, &RECKONING);
        let again = track.at(wrong, &RECKONING);
        assert!(shown.distance_m(&again) < 1e-9, "{shown:?} {again:?}");
        assert!((shown.velocity.linear[0] - again.velocity.linear[0]).abs() < 1e-6);
        let mut last = again;
        for step in 1..=400 {
            let at = wrong + f64::from(step) * 0.05;
            let next = track.at(at, &RECKONING);
            let speed_m_s = next.distance_m(&last) / (0.05 * DT_S);
            assert!(speed_m_s < 7.0, "{speed_m_s}");
            let change = f64::from(next.velocity.linear[0] - last.velocity.linear[0]).abs();
            assert!(change < 1.0, "its speed changes by {change} m/s within a twentieth of a tick");
            last = next;
        }
        assert!(last.distance_m(&learned) < 1e-9);
        // The same state again: the error goes on fading out.
        track.learn((11.0, learned, true), false, CADENCE, 12.0, &RECKONING);
        assert!(x(&track, 12.0) > 0.4);
    }

    #[test]
    fn a_guess_gives_way_to_what_is_so_without_a_jump() {
        let mut track = Track::new(0.0, going(0.0, 6.0));
        track.learn((3.0, going(0.3, 6.0), false), false, CADENCE, 0.0, &RECKONING);
        for tick in [6.0, 9.0, 12.0] {
            track.learn((tick, going(0.1 * tick, 6.0), false), true, CADENCE, tick - 3.0, &RECKONING);
        }
        assert!((x(&track, 12.0) - 1.2).abs() < 1e-9);
        let shown = x(&track, 9.0);
        track.learn((6.0, going(0.35, 0.0), false), false, CADENCE, 9.0, &RECKONING);
        assert!((x(&track, 9.0) - shown).abs() < 1e-9);
        assert!((x(&track, 26.0) - 0.35).abs() < 1e-9, "the guess is withdrawn");
        track.learn((9.0, going(0.9, 6.0), false), true, CADENCE, 9.0, &RECKONING);
        track.learn((7.0, going(0.35, 0.0), false), false, CADENCE, 9.0, &RECKONING);
        assert!((x(&track, 40.0) - 0.35).abs() < 1e-9, "whatever its tick");
    }

    #[test]
    fn a_body_that_batches_do_not_tell_of_goes_on_as_it_did() {
        let told = |told: f64| Reckoning { gravity: Vector3::new(-9.81, 0.0, 0.0), told, ..RECKONING };
        let mut track = Track::new(0.0, going(0.0, 6.0));
        track.learn((3.0, going(0.3, 6.0), false), false, CADENCE, 0.0, &told(3.0));
        let x = |track: &Track, tick: f64, until: f64| track.at(tick, &told(until)).pose.translation[0];
        assert!((x(&track, 33.0, 33.0) - 3.3).abs() < 1e-6, "half a second of 6 m/s");
        assert!(x(&track, 33.0, 3.0) < 1.9, "nobody said that it does");
        assert!(x(&track, 1_000.0, 1_000.0) < 0.3 + 6.0 * 2.2, "not for ever");
        // It fell between the last two states, so it falls on.
        let mut track = Track::new(0.0, going(0.0, 6.0));
        let fall = |ticks: f64| {
            let s = ticks * DT_S;
            going(6.0 * s - 4.905 * s * s, (6.0 - 9.81 * s) as f32)
        };
        track.learn((0.5, fall(0.5), false), false, CADENCE, 0.0, &told(0.5));
        track.learn((3.0, fall(3.0), false), false, CADENCE, 0.0, &told(3.0));
        let is = fall(33.0).pose.translation[0];
        assert!((x(&track, 33.0, 33.0) - is).abs() < 1e-3, "{} {is}", x(&track, 33.0, 33.0));
    }

    #[test]
    fn a_body_of_which_nothing_more_is_heard_stands_without_a_jump() {
        let told = Reckoning { told: 30.0, ..RECKONING };
        let mut track = Track::new(0.0, going(0.0, 6.0));
        track.learn((3.0, going(0.3, 6.0), false), false, CADENCE, 0.0, &told);
        let before = track.at(8.0, &told);
        track.stand(8.0, &told);
        assert!(track.at(8.0, &told).distance_m(&before) < 1e-9);
        assert_eq!(track.at(60.0, &told), Motion::at_rest(going(0.3, 0.0).pose));
    }

    #[test]
    fn a_body_that_rests_and_moves_again_and_again_keeps_no_more_states_for_it() {
        let mut track = Track::new(0.0, going(0.0, 0.0));
        for cycle in 1..=100 {
            let tick = 30.0 * f64::from(cycle);
            track.learn((tick, going(0.1, 3.0), false), false, CADENCE, tick - 3.0, &RECKONING);
            track.learn((tick + 3.0, going(0.2, 0.0), true), false, CADENCE, tick, &RECKONING);
        }
        assert!(track.samples.len() <= KEPT, "{}", track.samples.len());
    }

    #[test]
    fn what_comes_late_changes_nothing() {
        let mut track = Track::new(3.0, going(0.3, 6.0));
        track.learn((6.0, going(0.6, 6.0), false), false, CADENCE, 3.0, &RECKONING);
        track.learn((4.5, going(9.0, 6.0), false), false, CADENCE, 3.0, &RECKONING);
        assert!((x(&track, 4.5) - 0.45).abs() < 1e-9);
    }

    #[test]
    fn ticks_may_be_counted_anew_without_a_jump() {
        let mut track = Track::new(0.0, going(0.0, 6.0));
        track.learn((3.0, going(0.3, 6.0), false), false, CADENCE, 0.0, &RECKONING);
        let shown = track.at(2.0, &RECKONING);
        track.rebase(2.0, 1_000.0, &RECKONING);
        assert_eq!(track.at(1_000.0, &RECKONING), shown);
        track.learn((1_003.0, going(0.5, 6.0), false), false, CADENCE, 1_001.0, &RECKONING);
        let melted = track.at(1_003.0, &RECKONING).distance_m(&track.at(1_001.0, &RECKONING));
        assert!(melted < 0.3, "{melted}");
        track.learn((1_015.0, going(0.5, 0.0), true), false, CADENCE, 1_004.0, &RECKONING);
        assert!((x(&track, 1_017.0) - 0.5).abs() < 1e-9);
    }
}
