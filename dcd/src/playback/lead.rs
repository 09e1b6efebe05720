//! Finds how far ahead of the world a client must be, so that what it asks of its avatars comes before the ticks that it is for.

use std::collections::VecDeque;
use std::time::Duration;

/// The lead before anything is known of the way, seconds.
const FIRST_S: f64 = 0.1;
/// The inputs by which the lead is measured: those of a few seconds.
const MEASURED: usize = 64;
/// The share of them that may come too late.
const LATE: f64 = 0.01;
/// The lead is longer than it must be by so much, ticks: an input that comes too late is seen, one too early is not.
const MARGIN: f64 = 0.5;
/// No lead is longer, seconds.
const MOST_S: f64 = 1.0;
/// The share by which the predicted tick goes faster or slower to get where it should be.
const SLEW: f64 = 0.1;
/// The same while inputs come too late.
const FAST_SLEW: f64 = 0.3;
/// It jumps if it is farther off than this, seconds.
const JUMP_S: f64 = 1.0;
/// The world has stood still where it is behind what it was taken to be at by this, seconds.
const STOOD_S: f64 = 0.25;

/// The tick for which a client makes inputs now: ahead of the world by as long as they take to get there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lead {
    /// The predicted tick last returned, the tick that the world was taken to be at, and when.
    at: Option<(f64, f64, Duration)>,
    /// By how many ticks inputs had to be ahead of the world to come in time, of the last ones.
    needed: VecDeque<f64>,
    /// Half the round trip, by pings.
    way_s: Option<f64>,
}

impl Lead {
    /// Takes in the round trip to the leader, seconds.
    pub(crate) fn set_round_trip_s(&mut self, trip_s: f64) {
        self.way_s = Some(0.5 * trip_s);
    }

    /// Forgets the way to a former leader.
    pub(crate) fn change_leader(&mut self) {
        self.needed.clear();
        self.way_s = None;
    }

    /// Begins anew: ticks are counted otherwise.
    pub(crate) fn recount(&mut self) {
        self.change_leader();
        self.at = None;
    }

    /// Takes in that an input named a tick, was made when the world was at another, and came so many ticks before the one it named.
    pub(crate) fn measure(&mut self, named: f64, world_tick: f64, early: i8) {
        self.needed.push_back(named - world_tick - f64::from(early));
        if self.needed.len() > MEASURED {
            self.needed.pop_front();
        }
    }

    /// Returns by how many ticks the client should be ahead.
    fn goal(&self, period_s: f64) -> f64 {
        let mut needed: Vec<_> = self.needed.iter().copied().collect();
        needed.sort_unstable_by(|a, b| b.total_cmp(a));
        let late = (LATE * needed.len() as f64) as usize;
        // Before inputs tell, a tick more than pings do: these go both ways alike.
        let first = || self.way_s.map_or(FIRST_S / period_s, |way_s| way_s / period_s + 1.0);
        (needed.get(late).copied().unwrap_or_else(first) + MARGIN).clamp(0.0, MOST_S / period_s)
    }

    /// Returns the predicted tick, which goes back only where the world does: it stood still, as while its leader died, and nobody knew. A tick
    /// takes `period_s` now.
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

    /// Plays for some seconds with inputs that take so long, by their number; returns how early the last ones came, and the least step of
    /// the predicted tick.
    fn play(lead: &mut Lead, from_s: f64, seconds: f64, way_s: impl Fn(u32) -> f64) -> (Vec<i8>, f64) {
        play_behind(lead, 0.0, from_s, seconds, way_s)
    }

    /// The same in a world that is so many ticks behind, as it has stood still.
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
        // The way becomes longer, and uneven.
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
