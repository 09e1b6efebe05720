//! Chooses the rate of each region: by whether it is looked at, by the error that audits find, or by the time that steps take.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::estimate::Estimate;
use super::{Fidelity, FidelityReport};
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
/// From level to level at least so many ticks pass.
const PAUSE_TICKS: u64 = 30;
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
}

/// The memory of a governor about one region.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Memory {
    level: u8,
    watched: bool,
    error: Estimate,
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
    /// Where all islands are audited, the sum of their errors, and of their bodies and ticks.
    #[serde(skip)]
    all: (f64, f64),
    /// What audits may cost by now, in bodies stepped once.
    credit: f64,
    /// How many regions are stepped in every tick, in every second, in every fourth: more often than chosen where they are bound to others.
    levels: [usize; 3],
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
            all: (0.0, 0.0),
            spent_ms: 0.0,
            full_ms: 0.0,
            credit: 0.0,
            levels: [0; 3],
        }
    }

    pub(in crate::physics) fn fidelity(&self) -> Fidelity {
        self.fidelity
    }

    pub(in crate::physics) fn set_viewpoints(&mut self, viewpoints: Vec<Viewpoint>) {
        self.viewpoints = viewpoints;
    }

    /// Returns the rate of every region for the tick that begins.
    pub(in crate::physics) fn rates(&mut self, regions: &[RegionState]) -> Vec<(RegionId, u8)> {
        let now = self.ticks;
        self.ticks += 1;
        self.regions.retain(|id, _| regions.iter().any(|region| region.id == *id));
        for region in regions {
            let memory = self.regions.entry(region.id).or_default();
            let margin_m = if memory.watched { LEAVE * MARGIN_M } else { MARGIN_M };
            let is_seen = |view: &Viewpoint| view.gap_m(&region.cell) <= margin_m;
            let was_watched = memory.watched;
            memory.watched = self.viewpoints.is_empty() || self.viewpoints.iter().any(is_seen);
            // A budget may leave no more for what has long been looked at.
            let is_kept = was_watched && matches!(self.fidelity, Fidelity::Budget { .. });
            if memory.watched && !is_kept {
                memory.level = 0;
            }
        }
        if now.is_multiple_of(EVERY_TICKS) {
            match self.fidelity {
                Fidelity::Off => {}
                Fidelity::Tolerance { m_s } => self.keep_error(m_s, now),
                Fidelity::Budget { tick_ms } => self.keep_time(tick_ms.into(), regions),
            }
        }
        regions.iter().map(|region| (region.id, RATES[usize::from(self.regions[&region.id].level)])).collect()
    }

    /// Lets unwatched regions become coarser, a level at a time, until audits find too large an error.
    fn keep_error(&mut self, tolerance_m_s: f32, now: u64) {
        for memory in self.regions.values_mut().filter(|memory| !memory.watched) {
            let (mean, count) = (memory.error.mean(), memory.error.count());
            let coarsest = RATES.len() as u8 - 1;
            if memory.level > 0 && count >= SEASONED && mean > tolerance_m_s {
                memory.patience = (2 * memory.patience).clamp(PATIENCE_TICKS, 64 * PATIENCE_TICKS);
                memory.stays_until = now + memory.patience;
                memory.turn_to(memory.level - 1);
            } else if memory.level < coarsest
                && now >= memory.stays_until
                && (count < SEASONED || mean < EASY * tolerance_m_s)
            {
                memory.stays_until = now + PAUSE_TICKS;
                memory.turn_to(memory.level + 1);
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
                memory.turn_to(level);
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

    pub(in crate::physics) fn is_thorough(&self) -> bool {
        self.audited.is_infinite()
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
    fn turn_to(&mut self, level: u8) {
        (self.level, self.error) = (level, Estimate::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regions in a row, 10 m each, of which a step takes so long.
    fn row(count: u32, step_ms: f64) -> Vec<RegionState> {
        let cell = |k: f64| Cell { min: [10.0 * k, -5.0, -5.0], max: [10.0 * k + 10.0, 5.0, 5.0] };
        (0..count).map(|k| RegionState { id: RegionId(k), cell: cell(f64::from(k)), step_ms }).collect()
    }

    fn governor(fidelity: Fidelity) -> Governor {
        let mut governor = Governor::new(fidelity);
        governor.set_viewpoints(vec![Viewpoint { at: [0.0; 3], radius_m: 1.0 }]);
        governor
    }

    fn rates_after(governor: &mut Governor, regions: &[RegionState], ticks: u64) -> Vec<u8> {
        (0..ticks)
            .map(|_| governor.rates(regions))
            .last()
            .unwrap()
            .into_iter()
            .map(|(_, rate)| rate)
            .collect()
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
            let rates = governor.rates(&regions);
            for &(id, rate) in &rates {
                // The second region that is not seen errs at its lowest rate.
                governor.note_error(id, if id == RegionId(3) && rate == 4 { 0.5 } else { 0.01 });
            }
            if rates[3].1 < 4 && tick > 100 {
                fine.push(tick);
            }
        }
        let rates: Vec<_> = governor.rates(&regions).into_iter().map(|(_, rate)| rate).collect();
        assert_eq!(rates[..3], [1, 4, 4]);
        let returns = fine.windows(2).filter(|two| two[1] > two[0] + 1).count();
        assert!((2..8).contains(&returns), "{returns} returns to the lowest rate in 4,000 ticks");
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
