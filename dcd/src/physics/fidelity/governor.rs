//! Chooses the rate of each region: by whether it is looked at, by the error that audits find, or by the time that steps take.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::estimate::Estimate;
use super::{Fidelity, FidelityReport};
use crate::physics::region::Signals;
use crate::space::{Cell, RegionId, Viewpoint};

/// Rates by level: a region is stepped once per so many ticks.
const RATES: [u8; 3] = [1, 2, 4];
/// A region is looked at from this far beyond what a viewer sees, metres, so that it is at the present time when it is seen; and until
/// it is this many times as far.
const MARGIN_M: f64 = 5.0;
const LEAVE: f64 = 2.0;
/// Levels are chosen every so many ticks.
const EVERY_TICKS: u64 = 8;
/// A region becomes coarser where its error is below this part of the tolerance, and finer where it is above, once it has been audited so
/// often at its level.
const EASY: f32 = 0.5;
const SEASONED: usize = 3;
/// From level to level at least so many ticks pass, after which signals are those of the present level.
const PAUSE_TICKS: u64 = 32;
/// In a step bodies turn by so much at most: what touches stays where it touched on both until the next.
const TURN_RAD: f32 = 1.0;
/// Beyond so many times that a region becomes finer.
const SLACK: f32 = 1.25;
/// The part of a new look in the mean overlap at full rate.
const NEWER: f32 = 0.25;
/// A region that was found too coarse stays finer for so many ticks, at first; each time twice as long, up to 64 times.
const PATIENCE_TICKS: u64 = 120;
/// The part of a budget that is planned for: single ticks take longer than the mean.
const PLANNED: f64 = 0.8;
/// The part of the time that audits take.
const AUDITED: f64 = 0.01;
/// Ticks in which overruns do not count: nothing has been measured yet.
const FIRST_TICKS: u64 = 60;

/// The state of a region that levels are chosen by.
#[derive(Clone, Copy, Debug)]
pub(in crate::physics) struct RegionState {
    pub id: RegionId,
    pub cell: Cell,
    /// The time that one step takes, smoothed, milliseconds.
    pub step_ms: f64,
    pub signals: Signals,
}

/// The memory of a governor about one region.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Memory {
    level: u8,
    watched: bool,
    error: Estimate,
    /// When it came to its level.
    since: u64,
    /// The mean overlap at full rate, metres; smoothed.
    overlap_m: Option<f32>,
    /// Until when it may not become coarser, and for how long that will be the next time, ticks.
    stays_until: u64,
    patience: u64,
}

/// Chooses levels for the regions of one process.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::physics) struct Governor {
    fidelity: Fidelity,
    viewpoints: Vec<Viewpoint>,
    regions: BTreeMap<RegionId, Memory>,
    /// Of all audits.
    error: Estimate,
    audits: u64,
    overruns: u64,
    ticks: u64,
    /// The time of all steps so far, and what it would have been at full rate, milliseconds.
    #[serde(skip)]
    spent_ms: f64,
    #[serde(skip)]
    full_ms: f64,
    /// The part of the time that audits may take.
    audited: f64,
    audits_all: bool,
    /// Where all islands are audited, the sum of their errors, and of their bodies and ticks.
    #[serde(skip)]
    all: (f64, f64),
    /// What audits may cost by now, in bodies stepped once.
    credit: f64,
    /// How many regions are stepped in every tick, in every second, in every fourth: more often than chosen where they are bound to others.
    levels: [usize; 3],
    /// The rates of this tick, as chosen or told.
    #[serde(skip)]
    rates: BTreeMap<RegionId, u8>,
    /// Whether rates are told, and not chosen.
    #[serde(skip)]
    is_told: bool,
}

impl Governor {
    pub(in crate::physics) fn new(fidelity: Fidelity) -> Self {
        Self {
            fidelity,
            viewpoints: Vec::new(),
            regions: BTreeMap::new(),
            error: Estimate::default(),
            audits: 0,
            overruns: 0,
            ticks: 0,
            audited: AUDITED,
            audits_all: false,
            all: (0.0, 0.0),
            spent_ms: 0.0,
            full_ms: 0.0,
            credit: 0.0,
            levels: [0; 3],
            rates: BTreeMap::new(),
            is_told: false,
        }
    }

    pub(in crate::physics) fn fidelity(&self) -> Fidelity {
        self.fidelity
    }

    pub(in crate::physics) fn set_viewpoints(&mut self, viewpoints: Vec<Viewpoint>) {
        self.viewpoints = viewpoints;
    }

    /// Returns the rates that were chosen for the tick that is under way, or done.
    pub(in crate::physics) fn rates(&self) -> &BTreeMap<RegionId, u8> {
        &self.rates
    }

    /// Has regions keep these rates until others are told: what a recorded world chose by the time that its steps took. Returns whether
    /// they are rates.
    pub(in crate::physics) fn follow(&mut self, rates: BTreeMap<RegionId, u8>) -> bool {
        let are_rates = rates.values().all(|rate| RATES.contains(rate));
        if are_rates {
            (self.rates, self.is_told) = (rates, true);
        }
        are_rates
    }

    /// Chooses the rate of every region for the tick that begins.
    pub(in crate::physics) fn choose(&mut self, regions: &[RegionState], dt_s: f32) {
        let now = self.ticks;
        self.ticks += 1;
        if self.is_told {
            return;
        }
        self.regions.retain(|id, _| regions.iter().any(|region| region.id == *id));
        for region in regions {
            let memory =
                self.regions.entry(region.id).or_insert_with(|| Memory { since: now, ..Memory::default() });
            let margin_m = if memory.watched { LEAVE * MARGIN_M } else { MARGIN_M };
            let is_seen = |view: &Viewpoint| view.gap_m(&region.cell) <= margin_m;
            let was_watched = memory.watched;
            memory.watched = self.viewpoints.is_empty() || self.viewpoints.iter().any(is_seen);
            // A budget may leave no more for what has long been looked at.
            let is_kept = was_watched && matches!(self.fidelity, Fidelity::Budget { .. });
            if memory.watched && !is_kept && memory.level > 0 {
                memory.turn_to(0, now);
            }
        }
        if now.is_multiple_of(EVERY_TICKS) {
            match self.fidelity {
                Fidelity::Off => {}
                Fidelity::Tolerance { m_s } => self.keep_error(m_s, dt_s, regions),
                Fidelity::Budget { tick_ms } => self.keep_time(tick_ms.into(), regions),
            }
        }
        let rate = |region: &RegionState| RATES[usize::from(self.regions[&region.id].level)];
        self.rates = regions.iter().map(|region| (region.id, rate(region))).collect();
    }

    /// Lets unwatched regions become coarser, a level at a time, until audits find too large an error, or signals too long a step.
    fn keep_error(&mut self, tolerance_m_s: f32, dt_s: f32, regions: &[RegionState]) {
        let now = self.ticks;
        for region in regions {
            let memory = self.regions.get_mut(&region.id).expect("every region has a memory");
            memory.look(&region.signals, now);
            if memory.watched {
                continue;
            }
            let (mean, count) = (memory.error.mean(), memory.error.count());
            let coarsest = RATES.len() as u8 - 1;
            let turn_rad =
                |level: u8| region.signals.spin_rad_s * dt_s * f32::from(RATES[usize::from(level)]);
            // Deeper by no more than what the error that is tolerated moves a body by in the longest step.
            let deeper_m = tolerance_m_s * dt_s * f32::from(RATES[RATES.len() - 1]);
            let overlaps = memory.is_settled(now)
                && memory.overlap_m.is_some_and(|full_m| region.signals.overlap_m > full_m + deeper_m);
            let errs = count >= SEASONED && mean > tolerance_m_s;
            if memory.level > 0 && (errs || overlaps || turn_rad(memory.level) > SLACK * TURN_RAD) {
                memory.patience = (2 * memory.patience).clamp(PATIENCE_TICKS, 64 * PATIENCE_TICKS);
                memory.stays_until = now + memory.patience;
                memory.turn_to(memory.level - 1, now);
            } else if memory.level < coarsest
                && now >= memory.stays_until
                && memory.overlap_m.is_some()
                && (count < SEASONED || mean < EASY * tolerance_m_s)
                && turn_rad(memory.level + 1) <= TURN_RAD
            {
                memory.stays_until = now + PAUSE_TICKS;
                memory.turn_to(memory.level + 1, now);
            }
        }
    }

    /// Makes regions coarser until the tick fits the budget: first the unwatched, the farthest first, down to each second tick and then
    /// to each fourth; then the watched in the same way.
    fn keep_time(&mut self, tick_ms: f64, regions: &[RegionState]) {
        let far_m = |region: &RegionState| {
            self.viewpoints.iter().map(|view| view.gap_m(&region.cell)).fold(f64::INFINITY, f64::min)
        };
        let mut order: Vec<_> =
            regions.iter().map(|region| (self.regions[&region.id].watched, far_m(region), region)).collect();
        order.sort_by(|(a_watched, a_m, a), (b_watched, b_m, b)| {
            a_watched.cmp(b_watched).then(b_m.total_cmp(a_m)).then(a.id.cmp(&b.id))
        });
        let mut levels: BTreeMap<RegionId, u8> = regions.iter().map(|region| (region.id, 0)).collect();
        let at_ms = |region: &RegionState, level: u8| region.step_ms / f64::from(RATES[usize::from(level)]);
        let mut expected_ms: f64 = regions.iter().map(|region| region.step_ms).sum();
        let goal_ms = PLANNED * tick_ms;
        'shed: for watched in [false, true] {
            for level in 1..RATES.len() as u8 {
                for (_, _, region) in order.iter().filter(|(is, ..)| *is == watched) {
                    if expected_ms <= goal_ms {
                        break 'shed;
                    }
                    expected_ms += at_ms(region, level) - at_ms(region, level - 1);
                    levels.insert(region.id, level);
                }
            }
        }
        for (id, level) in levels {
            let memory = self.regions.get_mut(&id).expect("every region has a memory");
            if memory.level != level {
                memory.turn_to(level, self.ticks);
            }
        }
    }

    /// Notes that a region took so long for a step of so many ticks, which had so many times the iterations of one tick.
    pub(in crate::physics) fn note_step(&mut self, took_ms: f64, ticks: u8, iterations: f64) {
        self.spent_ms += took_ms;
        self.full_ms += took_ms * f64::from(ticks) / (0.5 + 0.5 * iterations);
    }

    /// Notes that so many bodies are stepped in a tick; returns whether an audit is paid for.
    pub(in crate::physics) fn earn(&mut self, bodies: usize) -> bool {
        self.credit += self.audited * bodies as f64;
        bodies > 0 && self.credit >= 0.0
    }

    /// Pays for an audit that costs as much as stepping so many bodies once. What an island costs decides when the next one is audited,
    /// not whether it is: so each is as likely as it is large.
    pub(in crate::physics) fn pay(&mut self, bodies: f64) {
        self.credit = self.credit.min(0.0) - bodies;
    }

    /// Notes what an audit of a region found: the mean error of an island's bodies per tick, m/s.
    pub(in crate::physics) fn note_error(&mut self, region: RegionId, error_m_s: f32) {
        self.audits += 1;
        self.error.add(error_m_s);
        if let Some(memory) = self.regions.get_mut(&region) {
            memory.error.add(error_m_s);
        }
    }

    pub(in crate::physics) fn set_audited(&mut self, part: f64) {
        self.audited = part;
    }

    pub(in crate::physics) fn audit_all(&mut self) {
        self.audits_all = true;
    }

    pub(in crate::physics) fn audits_all(&self) -> bool {
        self.audits_all
    }

    /// Notes the sum of errors, m/s, of so many bodies and ticks.
    pub(in crate::physics) fn note_all(&mut self, errors: f64, weight: f64) {
        self.all = (self.all.0 + errors, self.all.1 + weight);
    }

    pub(in crate::physics) fn true_error_m_s(&self) -> Option<f64> {
        let (errors, weight) = self.all;
        (weight > 0.0).then(|| errors / weight)
    }

    pub(in crate::physics) fn note_levels(&mut self, levels: [usize; 3]) {
        self.levels = levels;
    }

    /// Notes how long a tick took.
    pub(in crate::physics) fn note_time(&mut self, took_ms: f64) {
        if let Fidelity::Budget { tick_ms } = self.fidelity
            && self.ticks > FIRST_TICKS
        {
            self.overruns += u64::from(took_ms > f64::from(tick_ms));
        }
    }

    pub(in crate::physics) fn report(&self) -> FidelityReport {
        let [low95_m_s, high95_m_s] = self.error.interval();
        FidelityReport {
            share_of_full_time: if self.full_ms > 0.0 { self.spent_ms / self.full_ms } else { 1.0 },
            error_m_s: self.error.mean(),
            low95_m_s,
            high95_m_s,
            audits: self.audits,
            overruns: self.overruns,
            levels: self.levels,
        }
    }
}

impl Memory {
    fn turn_to(&mut self, level: u8, now: u64) {
        (self.level, self.since, self.error) = (level, now, Estimate::default());
    }

    /// Returns whether it has been at its level for long enough.
    fn is_settled(&self, now: u64) -> bool {
        now >= self.since + PAUSE_TICKS
    }

    /// Learns how deep overlaps are at full rate.
    fn look(&mut self, signals: &Signals, now: u64) {
        if self.level == 0 && self.is_settled(now) {
            let mean_m = self.overlap_m.get_or_insert(signals.overlap_m);
            *mean_m += NEWER * (signals.overlap_m - *mean_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regions in a row, 10 m each, of which a step takes so long.
    fn row(count: u32, step_ms: f64) -> Vec<RegionState> {
        let cell = |k: f64| Cell { min: [10.0 * k, -5.0, -5.0], max: [10.0 * k + 10.0, 5.0, 5.0] };
        (0..count)
            .map(|k| RegionState {
                id: RegionId(k),
                cell: cell(f64::from(k)),
                step_ms,
                signals: Signals::default(),
            })
            .collect()
    }

    fn governor(fidelity: Fidelity) -> Governor {
        let mut governor = Governor::new(fidelity);
        governor.set_viewpoints(vec![Viewpoint { at: [0.0; 3], radius_m: 1.0 }]);
        governor
    }

    fn rates(governor: &mut Governor, regions: &[RegionState]) -> Vec<u8> {
        governor.choose(regions, 1.0 / 60.0);
        governor.rates().values().copied().collect()
    }

    fn rates_after(governor: &mut Governor, regions: &[RegionState], ticks: u64) -> Vec<u8> {
        (0..ticks).map(|_| rates(governor, regions)).last().unwrap()
    }

    #[test]
    fn a_budget_is_kept_by_what_is_farthest_first_and_what_is_seen_last() {
        for (step_ms, rates) in [
            (0.9, [1, 1, 1, 1, 1, 1]),
            (1.5, [1, 1, 1, 1, 2, 2]),
            (2.2, [1, 2, 2, 2, 2, 2]),
            (3.0, [1, 2, 4, 4, 4, 4]),
            (4.0, [2, 4, 4, 4, 4, 4]),
            (50.0, [4, 4, 4, 4, 4, 4]),
        ] {
            let mut governor = governor(Fidelity::Budget { tick_ms: 10.0 });
            assert_eq!(rates_after(&mut governor, &row(6, step_ms), 20), rates, "{step_ms} ms");
            assert_eq!(rates_after(&mut governor, &row(6, 0.5), 20), [1; 6], "when there is less to do");
        }
    }

    #[test]
    fn an_error_above_the_tolerance_makes_a_region_finer_for_ever_longer_times() {
        let mut governor = governor(Fidelity::Tolerance { m_s: 0.1 });
        let regions = row(4, 1.0);
        let mut fine = Vec::new();
        for tick in 0..4_000 {
            let rates = rates(&mut governor, &regions);
            for (id, &rate) in (0..).map(RegionId).zip(&rates) {
                // The second region that is not seen errs at its lowest rate.
                governor.note_error(id, if id == RegionId(3) && rate == 4 { 0.5 } else { 0.01 });
            }
            if rates[3] < 4 && tick > 100 {
                fine.push(tick);
            }
        }
        assert_eq!(rates_after(&mut governor, &regions, 1)[..3], [1, 4, 4]);
        let returns = fine.windows(2).filter(|two| two[1] > two[0] + 1).count();
        assert!((2..8).contains(&returns), "{returns} returns to the lowest rate in 4,000 ticks");
    }

    #[test]
    fn what_spins_is_stepped_so_often_that_it_turns_by_a_radian_at_most() {
        for (spin_rad_s, rate) in [(10.0, 4), (14.0, 4), (20.0, 2), (29.0, 2), (31.0, 1), (200.0, 1)] {
            let mut governor = governor(Fidelity::AUTO);
            let mut regions = row(3, 1.0);
            regions[2].signals.spin_rad_s = spin_rad_s;
            assert_eq!(rates_after(&mut governor, &regions, 200), [1, 4, rate], "{spin_rad_s} rad/s");
            // When it comes to spin faster it is stepped more often.
            regions[1].signals.spin_rad_s = 40.0;
            assert_eq!(rates_after(&mut governor, &regions, 40)[1], 1);
        }
    }

    #[test]
    fn what_overlaps_more_than_at_full_rate_becomes_finer() {
        let mut governor = governor(Fidelity::Tolerance { m_s: 0.3 });
        let mut regions = row(3, 1.0);
        // As deep at any rate is no fault of the rate.
        regions[1].signals.overlap_m = 0.5;
        regions[2].signals.overlap_m = 0.01;
        assert_eq!(rates_after(&mut governor, &regions, 200), [1, 4, 4]);
        // By 0.3 m/s in four ticks: 20 mm.
        regions[2].signals.overlap_m = 0.029;
        assert_eq!(rates_after(&mut governor, &regions, 100)[2], 4);
        regions[2].signals.overlap_m = 0.031;
        assert!(rates_after(&mut governor, &regions, 100)[2] < 4);
    }

    #[test]
    fn a_region_that_comes_into_view_is_computed_in_full_at_once() {
        let mut governor = governor(Fidelity::AUTO);
        let regions = row(6, 1.0);
        assert_eq!(rates_after(&mut governor, &regions, 100)[5], 4);
        governor.set_viewpoints(vec![Viewpoint { at: [55.0, 0.0, 0.0], radius_m: 1.0 }]);
        assert_eq!(rates_after(&mut governor, &regions, 1)[5], 1);
    }
}
