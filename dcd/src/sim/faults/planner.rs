//! Plans faults one after the other, from a seed.

use std::time::Duration;

use super::{Fault, Island, Moment, Planned, ProcessKind, Victim, Ways};
use crate::sim::Random;

/// A planner that adds faults to a schedule. `at` is the time from which on the next may begin.
pub(super) struct Planner<'a> {
    pub(super) at: Duration,
    pub(super) faults: Vec<Planned>,
    pub(super) random: &'a mut Random,
}

impl Planner<'_> {
    pub(super) fn wait(&mut self, least_ms: u64, most_ms: u64) {
        self.at += self.random.between_ms(least_ms, most_ms);
    }

    fn add(&mut self, moment: Moment, fault: Fault) {
        self.wait(0, 700);
        self.faults.push(Planned { at: self.at, moment, fault });
    }

    fn moment(&mut self) -> Moment {
        match self.random.below(3) {
            0 => Moment::Any,
            1 => Moment::Changing(self.random.below(60) as u32),
            _ => Moment::Transferring(self.random.below(12) as u32),
        }
    }

    fn victim(&mut self, role: ProcessKind) -> Victim {
        Victim { role, pick: self.random.bits() }
    }

    fn anybody(&mut self) -> Victim {
        let roles = [
            ProcessKind::Server,
            ProcessKind::Leader,
            ProcessKind::Member,
            ProcessKind::Member,
            ProcessKind::Client,
        ];
        let role = roles[self.random.below(roles.len() as u64) as usize];
        self.victim(role)
    }

    pub(super) fn cut(&mut self, least_ms: u64, most_ms: u64, one_way: bool, rest_ms: u64) {
        let island = match self.random.below(8) {
            0..=3 => Island::One(self.anybody()),
            4 | 5 => Island::Nodes {
                pick: self.random.bits(),
                count: 1 + self.random.below(2),
                with_server: self.random.chance(0.5),
            },
            _ => Island::Pair(self.random.bits()),
        };
        let ways = match self.random.below(2) {
            _ if !one_way => Ways::Both,
            0 => Ways::Out,
            _ => Ways::In,
        };
        let time = self.random.between_ms(least_ms, most_ms);
        let moment = self.moment();
        self.add(moment, Fault::Cut { island, ways, time });
        self.at += time;
        self.wait(rest_ms, rest_ms);
    }

    pub(super) fn kill(&mut self, role: ProcessKind, least_ms: u64, most_ms: u64, rest_ms: u64) {
        let back_after = self.random.between_ms(least_ms, most_ms);
        let (victim, moment) = (self.victim(role), self.moment());
        self.add(moment, Fault::Kill { victim, back_after });
        self.at += back_after;
        self.wait(rest_ms, rest_ms);
    }

    pub(super) fn stop(&mut self, rest_ms: u64) {
        let time = match self.random.below(3) {
            0 => self.random.between_ms(100, 3_000),
            1 => Duration::from_secs(10),
            _ => self.random.between_ms(1_000, 12_000),
        };
        let (victim, moment) = (self.anybody(), self.moment());
        self.add(moment, Fault::Stop { victim, time });
        self.at += time;
        self.wait(rest_ms, rest_ms);
    }

    /// Adds a fault of any kind. It need not be over before the next begins.
    pub(super) fn anything(&mut self) {
        let before = self.at;
        match self.random.below(6) {
            0 => self.cut(300, 6_000, false, 0),
            1 => self.cut(300, 6_000, true, 0),
            2 => {
                let role = self.anybody().role;
                self.kill(role, 200, 4_000, 0);
            }
            3 => self.kill(ProcessKind::Leader, 200, 4_000, 0),
            4 => self.stop(0),
            _ => {
                let cost = Duration::from_micros(200 + self.random.below(5_000));
                let time = self.random.between_ms(500, 4_000);
                let victim = self.anybody();
                self.add(Moment::Any, Fault::Slow { victim, cost, time });
                self.at += time;
            }
        }
        if self.random.chance(0.4) {
            let whole = (self.at - before).as_millis() as u64;
            self.at = before + self.random.between_ms(0, whole);
        } else {
            self.wait(0, 5_000);
        }
    }
}
