//! Estimates which tick the world is at: from the times at which its leader opened the ticks that were heard
//! of, and from the difference between the leader's clock and ours.

use std::collections::VecDeque;
use std::time::Duration;

/// The number of rates kept. Their median counts, because one stop of the world says nothing of its pace.
const RATES: usize = 5;

/// How many times faster than real time a world is taken to run at most.
const FASTEST: f64 = 100.0;
/// How many times slower than real time a world is taken to run at most.
const SLOWEST: f64 = 100.0;

/// The fastest drift assumed between two clocks, seconds per second.
const DRIFT: f64 = 1e-3;

/// The ticks of a world, as a clock that a client reads.
#[derive(Clone, Debug)]
pub(super) struct TickClock {
    /// The newest tick heard of, and when it was opened, by our clock, seconds.
    newest: Option<(f64, f64)>,
    /// The time at which that tick was opened, by the leader's clock, seconds; `None` if that is not known.
    opened_s: Option<f64>,
    /// The last measured lengths of a tick, seconds.
    rates: VecDeque<f64>,
    /// The least transit, and when it was updated last, by our clock, seconds. The transit of a tick is from
    /// its opening, by the leader's clock, until it was heard of, by ours: it includes the difference of the
    /// clocks.
    transit: Option<(f64, f64)>,
    /// The leader's clock minus ours, and the bound on its error, seconds; `None` until pings tell.
    offset: Option<(f64, f64)>,
    dt_s: f64,
}

impl TickClock {
    pub(super) fn new(dt_s: f64) -> Self {
        Self { newest: None, opened_s: None, rates: VecDeque::new(), transit: None, offset: None, dt_s }
    }

    /// Sets the leader's clock minus ours, and the bound on its error, seconds, as pings have them.
    pub(super) fn set_offset(&mut self, offset_s: f64, error_s: f64) {
        self.offset = Some((offset_s, error_s));
    }

    /// Forgets the clock of the former leader, because another node leads from now on.
    pub(super) fn change_leader(&mut self) {
        (self.opened_s, self.transit, self.offset) = (None, None, None);
        self.rates.clear();
    }

    /// Takes in a tick that was heard of at `now`, and that the leader opened at `opened` by its own clock,
    /// if that is known. An older tick counts only if ticks are counted anew.
    pub(super) fn hear(&mut self, now: Duration, tick: f64, opened: Option<Duration>, anew: bool) {
        let now_s = now.as_secs_f64();
        let opened_s = opened.map(|opened| opened.as_secs_f64());
        if let Some(opened_s) = opened_s {
            let transit = now_s - opened_s;
            let least = self.transit.map_or(transit, |(least, at)| transit.min(least + DRIFT * (now_s - at)));
            self.transit = Some((least, now_s));
        }
        let newest = self.newest.filter(|_| !anew).map(|(tick, _)| tick);
        if newest.is_some_and(|newest| tick <= newest) {
            return;
        }
        if let (Some(newest), Some(before_s), Some(opened_s)) = (newest, self.opened_s, opened_s) {
            // Whatever a leader says, a tick is neither infinitely short nor infinitely long.
            let rate = (opened_s - before_s) / (tick - newest);
            self.rates.push_back(rate.clamp(self.dt_s / FASTEST, self.dt_s * SLOWEST));
            if self.rates.len() > RATES {
                self.rates.pop_front();
            }
        }
        self.opened_s = opened_s;
        self.newest = Some((tick, opened_s.map_or(now_s, |opened_s| opened_s - self.offset_s())));
    }

    /// Returns the newest tick heard of.
    pub(super) fn newest(&self) -> Option<f64> {
        self.newest.map(|(tick, _)| tick)
    }

    /// Returns the seconds that a tick takes at present: more than the world's `dt` where nodes do not keep
    /// up.
    pub(super) fn period_s(&self) -> f64 {
        let mut rates: Vec<_> = self.rates.iter().copied().collect();
        rates.sort_unstable_by(f64::total_cmp);
        rates.get(rates.len() / 2).copied().unwrap_or(self.dt_s).max(1e-6)
    }

    /// Returns the tick that the world is at, if it goes on at the same pace.
    pub(super) fn tick_at(&self, now: Duration) -> Option<f64> {
        let (tick, opened_s) = self.newest?;
        Some(tick + (now.as_secs_f64() - opened_s).max(0.0) / self.period_s())
    }

    /// Returns the bound on the error of [`Self::tick_at`] that comes from the clocks, seconds; `None` until
    /// pings tell.
    pub(super) fn error_s(&self) -> Option<f64> {
        self.offset.map(|(_, error_s)| error_s)
    }

    fn offset_s(&self) -> f64 {
        // Without pings the transit counts as nothing: the world is taken to be at the tick just heard of.
        let heard = self.transit.map_or(0.0, |(transit, _)| -transit);
        self.offset.map_or(heard, |(offset, _)| offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 1.0 / 60.0;

    fn at(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    /// Takes in ticks of a leader whose clock is 100 s ahead. Messages take 30 to 50 ms.
    fn hear(clock: &mut TickClock, ticks: std::ops::Range<u32>) {
        for tick in ticks.step_by(3) {
            let opened = f64::from(tick) * DT_S;
            let way = 0.030 + 0.020 * f64::from(tick % 7) / 6.0;
            clock.hear(at(opened + way), f64::from(tick), Some(at(100.0 + opened)), false);
        }
    }

    #[test]
    fn the_tick_is_known_by_pings_and_without_them_but_for_the_way() {
        let mut clock = TickClock::new(DT_S);
        hear(&mut clock, 0..600);
        let now = 600.0 * DT_S;
        assert!((clock.tick_at(at(now)).unwrap() - (600.0 - 0.030 / DT_S)).abs() < 0.2);
        clock.set_offset(100.0005, 0.002);
        hear(&mut clock, 600..603);
        assert!((clock.tick_at(at(now)).unwrap() - 600.0).abs() < 0.05);
        assert_eq!(clock.error_s(), Some(0.002));
        clock.change_leader();
        assert!((clock.tick_at(at(now)).unwrap() - 600.0).abs() < 0.05, "time goes on");
        clock.hear(at(now + 0.1), 606.0, Some(at(5.0)), false);
        assert!((clock.tick_at(at(now + 0.1)).unwrap() - 606.0).abs() < 0.05, "its clock is another");
    }

    #[test]
    fn a_stop_of_the_world_does_not_count_for_its_rate_and_slow_motion_does() {
        let mut clock = TickClock::new(DT_S);
        hear(&mut clock, 0..60);
        assert!((clock.period_s() - DT_S).abs() < 1e-9);
        clock.hear(at(3.0), 63.0, Some(at(103.0)), false);
        assert!((clock.period_s() - DT_S).abs() < 1e-9, "it stood still for two seconds");
        for i in 1..=3 {
            let opened = 103.0 + 0.3 * f64::from(i);
            clock.hear(at(opened - 100.0), 63.0 + 3.0 * f64::from(i), Some(at(opened)), false);
        }
        assert!((clock.period_s() - 0.1).abs() < 1e-9, "{}", clock.period_s());
    }

    #[test]
    fn the_count_goes_back_only_where_ticks_are_counted_anew() {
        let mut clock = TickClock::new(DT_S);
        hear(&mut clock, 0..60);
        clock.hear(at(1.0), 40.0, Some(at(100.7)), false);
        assert_eq!(clock.newest(), Some(57.0));
        clock.hear(at(2.0), 50.0, Some(at(102.0)), true);
        assert_eq!(clock.newest(), Some(50.0));
        assert!((clock.period_s() - DT_S).abs() < 1e-9);
    }
}
