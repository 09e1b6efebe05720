//! Finds how far ahead of the world a client must be, so that inputs for its avatars arrive before the ticks
//! that they name.

use std::collections::VecDeque;
use std::time::Duration;

/// The lead before anything is known of the transit, seconds.
const FIRST_S: f64 = 0.1;
/// The number of inputs by which the lead is measured: those of a few seconds.
const MEASURED: usize = 64;
/// The share of inputs that may arrive too late.
const LATE: f64 = 0.01;
/// The margin added to the lead, ticks: an input that arrives too late is seen, one too early is not.
const MARGIN: f64 = 0.5;
/// The longest lead, seconds.
const MOST_S: f64 = 1.0;
/// The most by which the predicted tick runs slower while it is ahead of its goal, as a share.
const SLEW: f64 = 0.1;
/// The most by which it runs faster while it is behind its goal and inputs may arrive too late, as a share.
const FAST_SLEW: f64 = 0.3;
/// The distance from the goal, seconds, from which on the predicted tick jumps forward to it, or waits for
/// it.
const JUMP_S: f64 = 1.0;
/// The world has stood still if it is farther than this behind the tick that it should be at, seconds.
const STOOD_S: f64 = 0.25;

/// The tick for which a client makes inputs now: ahead of the world by the time that inputs take to arrive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lead {
    /// The predicted tick last returned, the tick that the world was taken to be at then, and the time.
    at: Option<(f64, f64, Duration)>,
    /// The number of ticks by which each of the last inputs had to be ahead of the world to arrive in time.
    needed: VecDeque<f64>,
    /// Half the round trip to the leader, by pings, seconds.
    way_s: Option<f64>,
}

impl Lead {
    /// Sets the round trip to the leader, seconds.
    pub(crate) fn set_round_trip_s(&mut self, trip_s: f64) {
        self.way_s = Some(0.5 * trip_s);
    }

    /// Forgets what was measured of the way to a former leader.
    pub(crate) fn change_leader(&mut self) {
        self.needed.clear();
        self.way_s = None;
    }

    /// Begins anew, because ticks are counted anew.
    pub(crate) fn recount(&mut self) {
        self.change_leader();
        self.at = None;
    }

    /// Takes in an input that named the tick `named`, was made when the world was at `world_tick`, and
    /// arrived `early` ticks before the tick that it named.
    pub(crate) fn measure(&mut self, named: f64, world_tick: f64, early: i8) {
        self.needed.push_back(named - world_tick - f64::from(early));
        if self.needed.len() > MEASURED {
            self.needed.pop_front();
        }
    }

    /// Returns by how many ticks the client should be ahead of the world.
    fn goal(&self, period_s: f64) -> f64 {
        let mut needed: Vec<_> = self.needed.iter().copied().collect();
        needed.sort_unstable_by(|a, b| b.total_cmp(a));
        let late = (LATE * needed.len() as f64) as usize;
        // Before inputs are measured, a tick more than half the ping's round trip: its two ways may differ.
        let first = || self.way_s.map_or(FIRST_S / period_s, |way_s| way_s / period_s + 1.0);
        (needed.get(late).copied().unwrap_or_else(first) + MARGIN).clamp(0.0, MOST_S / period_s)
    }

    /// Returns the predicted tick at `now`, where a tick takes `period_s`. It goes back only where the world
    /// does: where the world stood still without the client's knowledge, for example while its leader died.
    pub(crate) fn advance(&mut self, now: Duration, world_tick: f64, period_s: f64) -> f64 {
        let goal = world_tick + self.goal(period_s);
        let next = match self.at {
            Some((mut at, world_before, since)) => {
                let elapsed = now.saturating_sub(since).as_secs_f64() / period_s;
                let stood = world_before + elapsed - world_tick;
                if stood * period_s > STOOD_S {
                    at -= stood;
                }
                let off = goal - (at + elapsed);
                match (goal - at).abs() * period_s < JUMP_S {
                    true => at + elapsed + off.clamp(-SLEW * elapsed, FAST_SLEW * elapsed),
                    false => goal.max(at),
                }
            }
            None => goal,
        };
        self.at = Some((next, world_tick, now));
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 1.0 / 60.0;

    /// Plays for some seconds with inputs that take `way_s` of their number to arrive. Returns by how many
    /// ticks each of the later half was early, and the least step of the predicted tick.
    fn play(lead: &mut Lead, from_s: f64, seconds: f64, way_s: impl Fn(u32) -> f64) -> (Vec<i8>, f64) {
        play_behind(lead, 0.0, from_s, seconds, way_s)
    }

    /// Plays like [`play`], in a world that is `stood` ticks behind, because it stood still.
    fn play_behind(
        lead: &mut Lead,
        stood: f64,
        from_s: f64,
        seconds: f64,
        way_s: impl Fn(u32) -> f64,
    ) -> (Vec<i8>, f64) {
        let mut under_way = VecDeque::<(f64, f64, f64, i8)>::new();
        let (mut early, mut least, mut last) = (Vec::new(), f64::INFINITY, None);
        for frame in 0..(60.0 * seconds) as u32 {
            let now_s = from_s + f64::from(frame) * DT_S;
            let world_tick = now_s / DT_S - stood;
            // An answer comes 0.1 s after its input.
            while let Some(&(_, named, of, came)) = under_way.front().filter(|(at, ..)| *at <= now_s) {
                lead.measure(named, of, came);
                under_way.pop_front();
            }
            let predicted = lead.advance(Duration::from_secs_f64(now_s), world_tick, DT_S);
            least = last.map_or(least, |last| f64::min(least, predicted - last));
            last = Some(predicted);
            let named = predicted.floor() + 1.0;
            let opens_next = ((now_s + way_s(frame)) / DT_S - stood).floor() + 1.0;
            let came = (named - opens_next) as i8;
            early.push(came);
            under_way.push_back((now_s + way_s(frame) + 0.1, named, world_tick, came));
        }
        (early.split_off(early.len() / 2), least)
    }

    #[test]
    fn inputs_come_in_time_and_not_much_too_early() {
        let mut lead = Lead::default();
        let (early, least) = play(&mut lead, 10.0, 6.0, |_| 0.1);
        assert!(early.iter().all(|early| (0..=2).contains(early)), "{early:?}");
        assert!(least > 0.0, "{least}: time never goes back");
        // The transit becomes longer, and uneven.
        let (early, least) =
            play(&mut lead, 16.0, 12.0, |frame| 0.18 + 0.04 * f64::from(frame * 7 % 11) / 10.0);
        let late = early.iter().filter(|early| **early < 0).count();
        assert!(late * 20 < early.len(), "{late} of {} come late", early.len());
        assert!(early.iter().all(|early| *early <= 4), "{early:?}");
        assert!(least > 0.0, "{least}");
    }

    #[test]
    fn after_the_world_stood_still_inputs_come_as_early_as_before() {
        for stood in [20.0, 50.0, 90.0] {
            let mut lead = Lead::default();
            play(&mut lead, 10.0, 6.0, |_| 0.1);
            let (early, _) = play_behind(&mut lead, stood, 16.0, 2.0, |_| 0.1);
            assert!(early.iter().all(|early| (0..=4).contains(early)), "{stood} ticks: {early:?}");
        }
    }

    #[test]
    fn before_inputs_tell_pings_do() {
        let mut lead = Lead::default();
        let ahead =
            |lead: &mut Lead, at: f64| lead.advance(Duration::from_secs_f64(at), at / DT_S, DT_S) - at / DT_S;
        assert!((ahead(&mut lead, 5.0) - 6.5).abs() < 1e-6);
        lead.set_round_trip_s(0.3);
        (1..120).for_each(|frame| assert!(ahead(&mut lead, 5.0 + f64::from(frame) * DT_S) > 0.0));
        assert!((ahead(&mut lead, 7.0) - 10.5).abs() < 1e-6);
        lead.recount();
        assert!((ahead(&mut lead, 1.0) - 6.5).abs() < 1e-6, "of another count nothing is known");
    }
}
