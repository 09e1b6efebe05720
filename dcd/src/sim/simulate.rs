//! Runs many seeds of many profiles on several cores, and sums them up as rows of the fault table.

#[cfg(test)]
mod tests;

use std::fmt;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use super::faults::{FaultProfile, Schedule};
use super::trial::{Outcome, Staleness, TrialConfig, run_trial};
use super::{Strain, Tally, Timeline, Traffic, Violation};

/// The most failures of a row that are kept with their timelines.
const KEPT_FAILURES: usize = 3;
/// The most runs that shrinking a failure may take.
const SHRINKING_RUNS: u32 = 40;

/// A row of the fault table.
#[derive(Clone, Debug)]
pub struct Row {
    /// The fault profile.
    pub profile: FaultProfile,
    /// The number of seeds that were run.
    pub seeds: u64,
    /// The number of seeds that violated an invariant or promise.
    pub violations: u64,
    /// The number of these that did so only by what their bodies did.
    pub strained: u64,
    /// The longest recovery.
    pub worst_recovery: Duration,
    /// The longest time without a tick.
    pub worst_pause: Duration,
    /// The longest time that a group went back because nobody was left who had computed it.
    pub worst_rewind: Duration,
    /// The age that 99 % of clients' states of their avatars did not exceed, milliseconds.
    pub staleness_ms: Option<u32>,
    /// The counts of events, summed over all seeds.
    pub tally: Tally,
    /// The statistics of the network, summed over all seeds. The most that a queue held is the maximum.
    pub traffic: Traffic,
    /// The simulated time of all seeds.
    pub simulated: Duration,
    /// The worst that touching bodies did, as shares of their gates.
    pub strain: Strain,
    /// The first failures by seed, with the smallest schedules found that still fail.
    pub failures: Vec<Failure>,
}

impl Row {
    /// Returns whether everything that the row promises holds.
    pub fn holds(&self) -> bool {
        self.violations == 0 && self.profile.promise().is_fresh(self.staleness_ms)
    }
}

/// A seed that violated an invariant or promise.
#[derive(Clone, Debug)]
pub struct Failure {
    /// The seed.
    pub seed: u64,
    /// The violation.
    pub violation: Violation,
    /// The faults that the violation needs, as far as shrinking found.
    pub schedule: Schedule,
    /// The timeline of the run with these faults.
    pub timeline: Timeline,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "seed {}: {}", self.seed, self.violation)?;
        for planned in &self.schedule.faults {
            writeln!(f, "  planned {planned}")?;
        }
        self.timeline.fmt(f)
    }
}

/// Runs all these seeds of a profile, while `goes_on` returns true before each.
pub fn simulate(
    config: &TrialConfig,
    profile: FaultProfile,
    seeds: Range<u64>,
    threads: usize,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Row {
    let next = AtomicU64::new(seeds.start);
    let row = Mutex::new(Row {
        profile,
        seeds: 0,
        violations: 0,
        strained: 0,
        worst_recovery: Duration::ZERO,
        worst_pause: Duration::ZERO,
        worst_rewind: Duration::ZERO,
        staleness_ms: None,
        tally: Tally::default(),
        traffic: Traffic::default(),
        simulated: Duration::ZERO,
        strain: Strain::default(),
        failures: Vec::new(),
    });
    let staleness = Mutex::new(Staleness::default());
    let lock = "no worker panics";
    thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end || !goes_on() {
                        return;
                    }
                    let schedule = profile.schedule(seed);
                    let outcome = try_seed(config, profile, seed, &schedule);
                    staleness.lock().expect(lock).merge(&outcome.staleness);
                    row.lock().expect(lock).add(seed, schedule, outcome);
                }
            });
        }
    });
    let mut row = row.into_inner().expect(lock);
    row.staleness_ms = staleness.into_inner().expect(lock).quantile_ms(0.99);
    for failure in &mut row.failures {
        shrink(config, profile, failure);
    }
    row
}

impl Row {
    /// Adds an outcome. Sums do not depend on the order of outcomes. The first failures by seed are kept.
    fn add(&mut self, seed: u64, schedule: Schedule, outcome: Outcome) {
        self.seeds += 1;
        self.worst_recovery = self.worst_recovery.max(outcome.worst_recovery);
        self.worst_pause = self.worst_pause.max(outcome.worst_pause);
        self.worst_rewind = self.worst_rewind.max(outcome.worst_rewind);
        self.tally += outcome.tally;
        self.traffic += outcome.traffic;
        self.simulated += outcome.time;
        self.strain = self.strain.or_worse(outcome.strain);
        if let Some(violation) = outcome.violation {
            self.violations += 1;
            self.strained += u64::from(matches!(violation, Violation::Strained { .. }));
            let at = self.failures.partition_point(|failure| failure.seed < seed);
            self.failures.insert(at, Failure { seed, violation, schedule, timeline: outcome.timeline });
            self.failures.truncate(KEPT_FAILURES);
        }
    }
}

/// Runs a seed, and reports a panic as a violation.
fn try_seed(config: &TrialConfig, profile: FaultProfile, seed: u64, schedule: &Schedule) -> Outcome {
    catch_unwind(AssertUnwindSafe(|| run_trial(config, profile, seed, schedule))).unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("without a word");
        Outcome::panicked(text)
    })
}

/// Shrinks a failing schedule by leaving faults out. A smaller schedule that still fails is kept, whatever
/// its violation.
fn shrink(config: &TrialConfig, profile: FaultProfile, failure: &mut Failure) {
    let mut runs = 0;
    let mut size = failure.schedule.faults.len().div_ceil(2);
    while size > 0 {
        let mut at = 0;
        while at < failure.schedule.faults.len() {
            if runs == SHRINKING_RUNS {
                return;
            }
            runs += 1;
            let mut smaller = failure.schedule.clone();
            smaller.faults.drain(at..(at + size).min(smaller.faults.len()));
            let outcome = try_seed(config, profile, failure.seed, &smaller);
            match outcome.violation {
                Some(violation) => {
                    failure.schedule = smaller;
                    failure.violation = violation;
                    failure.timeline = outcome.timeline;
                }
                None => at += size,
            }
        }
        size /= 2;
    }
}
