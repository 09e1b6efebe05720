//! Decides when the next step of a world is due, where viewers may pause it, step it and set its speed.

use std::time::{Duration, Instant};

/// The most time by which a slow world may be behind its schedule; time lost beyond that is forgotten.
const MOST_BEHIND: Duration = Duration::from_millis(100);
/// The most single steps that may be outstanding.
const MOST_STEPS: u32 = 1000;

/// The controls of a world: pause, single steps, speed, and the tick of a recording to go to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Control {
    paused: bool,
    /// The tick of a recording to go to.
    goal: Option<u64>,
    /// Single steps still to take while paused.
    steps: u32,
    /// The speed, simulated seconds per second of wall time; 0: as fast as possible.
    speed: f32,
    due: Option<Instant>,
}

/// The time at which the next step is due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Next {
    /// Now.
    Now,
    /// Once the recording has gone to this tick.
    Goal(u64),
    /// This time.
    At(Instant),
    /// The moment at which a viewer asks for it.
    Asked,
}

impl Default for Control {
    fn default() -> Self {
        Self { paused: false, goal: None, steps: 0, speed: 1.0, due: None }
    }
}

impl Control {
    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    pub(super) fn speed(&self) -> f32 {
        self.speed
    }

    pub(super) fn pause(&mut self, paused: bool) {
        (self.paused, self.steps, self.due) = (paused, 0, None);
    }

    /// Pauses, and asks for `count` more steps.
    pub(super) fn step(&mut self, count: u32) {
        self.paused = true;
        self.steps = self.steps.saturating_add(count).min(MOST_STEPS);
    }

    /// Goes to a tick, and pauses there.
    pub(super) fn go(&mut self, tick: u64) {
        self.pause(true);
        self.goal = Some(tick);
    }

    /// Takes the tick to go to, if there is one.
    pub(super) fn take_goal(&mut self) -> Option<u64> {
        self.goal.take()
    }

    /// Sets the speed. It must be 0, or from 0.001 to 1000; other values are ignored.
    pub(super) fn set_speed(&mut self, speed: f32) {
        if speed == 0.0 || (0.001..=1000.0).contains(&speed) {
            (self.speed, self.due) = (speed, None);
        }
    }

    /// Returns when the next step, of `dt_s` seconds, is due. If that is now, the step counts as taken.
    pub(super) fn next(&mut self, now: Instant, dt_s: f32) -> Next {
        if let Some(tick) = self.take_goal() {
            return Next::Goal(tick);
        }
        if self.paused {
            if self.steps == 0 {
                return Next::Asked;
            }
            self.steps -= 1;
            return Next::Now;
        }
        if self.speed == 0.0 {
            return Next::Now;
        }
        let due = self.due.unwrap_or(now);
        if due > now {
            return Next::At(due);
        }
        let period = Duration::from_secs_f32((dt_s / self.speed).clamp(0.0, 3600.0));
        let forgotten = now.checked_sub(MOST_BEHIND).unwrap_or(now);
        self.due = Some(due.max(forgotten) + period);
        Next::Now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f32 = 0.5;

    #[test]
    fn steps_are_due_at_the_speed_that_was_asked_for() {
        let start = Instant::now();
        let mut control = Control::default();
        assert_eq!(control.next(start, DT_S), Next::Now);
        assert_eq!(control.next(start, DT_S), Next::At(start + Duration::from_millis(500)));
        control.set_speed(2.0);
        assert_eq!(control.next(start, DT_S), Next::Now);
        assert_eq!(control.next(start, DT_S), Next::At(start + Duration::from_millis(250)));
        control.set_speed(0.0);
        assert_eq!((control.next(start, DT_S), control.next(start, DT_S)), (Next::Now, Next::Now));
        control.set_speed(f32::NAN);
        control.set_speed(-1.0);
        assert_eq!(control.speed(), 0.0);
    }

    #[test]
    fn time_that_was_lost_is_not_made_up() {
        let start = Instant::now();
        let mut control = Control::default();
        control.next(start, DT_S);
        let late = start + Duration::from_secs(100);
        assert_eq!(control.next(late, DT_S), Next::Now);
        assert_eq!(control.next(late, DT_S), Next::At(late + Duration::from_millis(400)));
    }

    #[test]
    fn a_paused_world_takes_single_steps() {
        let now = Instant::now();
        let mut control = Control::default();
        control.pause(true);
        assert_eq!(control.next(now, DT_S), Next::Asked);
        control.step(2);
        assert_eq!([0; 3].map(|_| control.next(now, DT_S)), [Next::Now, Next::Now, Next::Asked]);
        control.step(u32::MAX);
        assert_eq!(control.steps, MOST_STEPS);
        control.pause(false);
        assert_eq!(control.next(now, DT_S), Next::Now);
    }

    #[test]
    fn a_recording_pauses_at_the_tick_that_it_is_asked_to_go_to() {
        let now = Instant::now();
        let mut control = Control::default();
        control.step(3);
        control.go(7);
        control.go(9);
        assert_eq!([0; 2].map(|_| control.next(now, DT_S)), [Next::Goal(9), Next::Asked]);
        control.go(4);
        control.pause(false);
        assert_eq!([0; 2].map(|_| control.next(now, DT_S)), [Next::Goal(4), Next::Now]);
    }
}
