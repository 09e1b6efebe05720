//! Chooses the pace of each region, and which regions are stepped in a tick. The pace follows from whether a
//! region is looked at, from the error that audits find, or from the time that steps take.
//!
//! Regions at a lower rate stay behind the present for some ticks and catch up in one step. Regions that
//! share bodies, or are about to, are always at one time, so that copies of the same moment are compared.

use std::cmp;
use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::budget::{self, Load};
use super::estimate::Estimate;
use super::schedule::{COARSEST, Pace};
use super::{Audited, Fidelity, FidelityReport, Pick, RegionState, Schedule, Signals};
use crate::space::{Cell, RegionId, RegionSet, Tick, Viewpoint, drawn, mixed};

/// The distance beyond what a viewer sees within which a region counts as looked at, metres, so that it is at
/// the present time when it is seen. It stays looked at up to `LEAVE` times that distance.
const MARGIN_M: f64 = 5.0;
const LEAVE: f64 = 2.0;
/// The longest interval at which levels are chosen, ticks.
const EVERY_TICKS: u64 = 8;
/// The part of the tolerance below which its error lets a region become coarser. An error above the tolerance
/// makes it finer. Errors count once a region has been audited `SEASONED` times at its pace.
const EASY: f32 = 0.5;
const SEASONED: usize = 3;
/// The least ticks between two changes to a coarser level. After them the signals are those of the present
/// level.
const PAUSE_TICKS: u64 = 32;
/// The most by which bodies turn in a step, so that bodies that touch do so at the same place on both until
/// the next step.
const TURN_RAD: f32 = 1.0;
/// A region becomes finer beyond this many times [`TURN_RAD`].
const SLACK: f32 = 1.25;
/// The weight of a new look in the mean overlap at full rate.
const NEWER: f32 = 0.25;
/// The ticks for which a region that was found too coarse stays finer, at first. The time doubles with each
/// return, up to 64 times.
const PATIENCE_TICKS: u64 = 120;
/// The part of a budget that is planned for: at first, and at least and at most. Single ticks take longer
/// than the mean.
const PLANNED: f64 = 0.95;
const PLANNED_RANGE: [f64; 2] = [0.6, 1.0];
/// The step by which the planned part becomes less after a tick that took longer than the budget. After any
/// other tick it grows by the part `OVERRUNS` of that step. So one tick in a hundred would take longer, if
/// plans held (stochastic approximation of a quantile, Robbins and Monro 1951).
const OVERRUN: f64 = 0.02;
const OVERRUNS: f64 = 0.01;
/// The weight that what was known keeps after each tick, in the estimate of how much longer ticks take than
/// steps.
const LONGER: f64 = 0.98;
/// The ticks for which regions go on to look as far ahead as some region was behind, since such regions come
/// and go.
const FARTHER_TICKS: u64 = 64;
/// The part of the work that lower rates must save, or they are given up, since for them all regions look
/// farther ahead. Chosen, not measured.
const FARTHER_COSTS: f64 = 0.1;
/// The ticks for which lower rates are tried at least before they are given up.
const TRIED_TICKS: u64 = 32;
/// The weight of a tick in the average of what was saved.
const SAVED_NEWER: f64 = 1.0 / 32.0;
/// The largest share of the time at full rate that is reported.
const LARGEST_SHARE: f64 = 1e6;
/// The part of the time that audits may take, unless another is set.
const AUDITED: f64 = 0.01;
/// The least number of bodies that a tick counts for audits. Of a part of fewer a world of some bodies would pay for an audit
/// in half a minute, and keep no tolerance.
const FEW_BODIES: u64 = 256;
/// The number of first ticks, in which overruns do not count, since nothing has been measured yet.
const FIRST_TICKS: u64 = 60;

/// A region, with what its pace is chosen by.
#[derive(Clone, Copy, Debug)]
pub struct Governed<'a> {
    /// The region's state after the last tick.
    pub state: &'a RegionState,
    /// The region's cell.
    pub cell: Cell,
    /// The process that computes it. What one process computes takes as long as all of that together.
    pub by: u64,
}

/// The part of a world that is looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LookedAt {
    /// All of the world.
    All,
    /// What is seen from these viewpoints.
    From(Vec<Viewpoint>),
}

/// The memory of a governor about one region.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Memory {
    pace: Pace,
    watched: bool,
    error: Estimate,
    /// The tick at which the region came to its pace.
    since: u64,
    /// The mean overlap at full rate, metres; smoothed.
    overlap_m: Option<f32>,
    /// The tick until which it may not become coarser, and for how many ticks it may not the next time.
    stays_until: u64,
    patience: u64,
}

/// The choice of paces for all regions of a world, with what it is made from.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Governor {
    fidelity: Fidelity,
    looked_at: LookedAt,
    regions: BTreeMap<RegionId, Memory>,
    /// The errors of all audits.
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
    /// The sum of the errors of all islands, and the sum of their bodies and ticks, where all are audited.
    #[serde(skip)]
    all: (f64, f64),
    /// What audits may cost by now, in bodies that are stepped once.
    credit: f64,
    /// The ticks of bodies that were computed since the last audit, for which the next one stands: audits of
    /// long steps are dear, and so seldom.
    unaudited: f64,
    /// The numbers of regions that are stepped in every tick, in every second, and in every fourth: more
    /// often than chosen if they are bound to others.
    levels: [usize; 3],
    /// The number of ticks by which any region may be behind the present after this tick, as known after the
    /// last; and until when that holds at least.
    behind_most: u8,
    farther_until: u64,
    /// Says whether regions may be behind at all, since when, and for how long they may not when that has not
    /// paid.
    lags: bool,
    lags_since: u64,
    lags_patience: u64,
    /// The part of the awake bodies' steps that lower rates save, on average.
    saved: f64,
    /// The part of a budget that is planned for, and whether the plan is expected to keep the budget.
    planned: f64,
    is_kept: bool,
    /// The time of each process's ticks, and of its regions' steps in them, milliseconds. What is long ago
    /// counts less.
    #[serde(skip)]
    took_ms: BTreeMap<u64, [f64; 2]>,
    /// The time of this tick in the process that took longest, milliseconds.
    #[serde(skip)]
    slowest_ms: f64,
    /// The paces of this tick, chosen or told.
    #[serde(skip)]
    paces: BTreeMap<RegionId, Pace>,
    /// Says whether paces are told, and not chosen.
    #[serde(skip)]
    is_told: bool,
}

impl Governor {
    /// Makes the governor of a world that is all looked at.
    pub fn new(fidelity: Fidelity) -> Self {
        Self {
            fidelity,
            looked_at: LookedAt::All,
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
            unaudited: 0.0,
            levels: [0; 3],
            behind_most: 0,
            farther_until: 0,
            lags: true,
            lags_since: 0,
            lags_patience: 0,
            saved: 1.0,
            planned: PLANNED,
            is_kept: false,
            took_ms: BTreeMap::new(),
            slowest_ms: 0.0,
            paces: BTreeMap::new(),
            is_told: false,
        }
    }

    /// Returns the fidelity that the governor keeps.
    pub fn fidelity(&self) -> Fidelity {
        self.fidelity
    }

    /// Returns the viewpoints that the world is looked at from; none if all of it is looked at.
    pub fn viewpoints(&self) -> &[Viewpoint] {
        match &self.looked_at {
            LookedAt::All => &[],
            LookedAt::From(viewpoints) => viewpoints,
        }
    }

    /// Sets what of the world is looked at.
    pub fn look(&mut self, at: LookedAt) {
        self.looked_at = at;
    }

    /// Returns the paces that were chosen for the tick that is under way, or done.
    pub fn paces(&self) -> &BTreeMap<RegionId, Pace> {
        &self.paces
    }

    /// Returns by how many ticks any region may be behind the present after the tick that follows the one
    /// under way.
    pub fn behind_most(&self) -> u8 {
        self.behind_most
    }

    /// Chooses which regions stay behind in the tick that begins, and perhaps a region of which an island is
    /// to be audited. `regions` are all regions of the world, in order of their ranks.
    pub fn schedule(&mut self, tick: Tick, regions: &[Governed<'_>], dt_s: f32) -> Schedule {
        self.choose(regions, dt_s);
        let behind = self.left_behind(tick, regions);
        let audit = self.pick(tick, regions, &behind);
        Schedule { audit, behind, behind_most: self.behind_most }
    }

    /// Returns the regions that stay behind, in id order.
    fn left_behind(&mut self, tick: Tick, regions: &[Governed<'_>]) -> Vec<RegionId> {
        let mut behind = RegionSet::EMPTY;
        self.levels = [0; 3];
        let (mut coarsest, mut saved, mut awake) = (1, 0.0, 0.0);
        // A budget has already counted what its lower rates save.
        let lags = self.lags || self.is_told || matches!(self.fidelity, Fidelity::Budget { .. });
        for group in bound(regions) {
            let members = || group.iter().filter_map(|rank| regions.get(rank)).map(|region| region.state);
            let pace = |state: &RegionState| self.paces.get(&state.region).copied().unwrap_or(Pace::FULL);
            // If all rest, nothing is stepped, and the paces that were chosen stand.
            let busy = members().filter(|state| !state.rests).map(pace).min_by_key(|pace| pace.rate);
            let pace = busy.or(members().map(pace).min_by_key(|pace| pace.rate));
            let is_urgent = members().any(|state| state.urgent);
            let Pace { rate, turn } = pace.filter(|_| !is_urgent).unwrap_or(Pace::FULL);
            let steps: f64 = members().map(|state| f64::from(state.awake)).sum();
            (saved, awake) = (saved + steps * (1.0 - 1.0 / f64::from(rate)), awake + steps);
            let rate = if lags { rate } else { 1 };
            self.levels[rate.ilog2() as usize] += members().count();
            coarsest = rate.max(coarsest);
            let owed = members().map(|state| state.behind).max().unwrap_or(0);
            // Groups of one rate take turns, so that ticks take about equally long.
            let is_due = owed + 1 >= rate
                // Other regions have looked less far ahead.
                || owed + 1 > self.behind_most
                || tick.0 % u64::from(rate) == u64::from(turn % rate);
            if !is_due {
                // A region that rests and shares nothing is the same at any time. One that rests and shares
                // bodies may be woken before the tick.
                let is_apart = |state: &RegionState| state.rests && state.bound.is_empty();
                let moves = |rank: &usize| regions.get(*rank).is_some_and(|region| !is_apart(region.state));
                behind = behind.union(group.iter().filter(moves).collect());
            }
        }
        if awake > 0.0 {
            self.weigh(saved / awake);
        }
        let owed = regions.iter().map(|region| region.state.behind).max().unwrap_or(0);
        let most = (coarsest - 1).max(owed);
        if most >= self.behind_most {
            (self.behind_most, self.farther_until) = (most, self.ticks + FARTHER_TICKS);
        } else if !lags || self.ticks >= self.farther_until {
            self.behind_most = most;
        }
        behind.iter().map(|rank| regions[rank].state.region).collect()
    }

    /// Lets regions be behind only as long as that saves more than it costs to look farther ahead. Once given
    /// up, it is tried again after ever longer times.
    fn weigh(&mut self, saved: f64) {
        self.saved += SAVED_NEWER * (saved - self.saved);
        let lasted = self.ticks.saturating_sub(self.lags_since);
        if self.lags && self.saved < FARTHER_COSTS && lasted > TRIED_TICKS {
            let before = if lasted > 4 * self.lags_patience { 0 } else { self.lags_patience };
            self.lags_patience = (2 * before).clamp(PATIENCE_TICKS, 64 * PATIENCE_TICKS);
            (self.lags, self.lags_since) = (false, self.ticks);
        } else if !self.lags && self.saved >= FARTHER_COSTS && lasted > self.lags_patience {
            (self.lags, self.lags_since) = (true, self.ticks);
        }
    }

    /// Picks a region for an audit when the last one is paid for. Every body in every tick is equally likely:
    /// what one step computes counts for each of its ticks.
    fn pick(&mut self, tick: Tick, regions: &[Governed<'_>], behind: &[RegionId]) -> Option<Pick> {
        let steps = |region: &&Governed<'_>| {
            !region.state.rests && behind.binary_search(&region.state.region).is_err()
        };
        let stepped = || regions.iter().filter(steps).map(|region| region.state);
        let weight = |state: &RegionState| u64::from(state.awake) * (u64::from(state.behind) + 1);
        self.unaudited += stepped().map(weight).sum::<u64>() as f64;
        let work: u64 = stepped().map(|state| u64::from(state.awake)).sum();
        if !self.earn(work) {
            return None;
        }
        let seed = drawn(mixed(tick.0));
        let mut at = seed % stepped().map(weight).sum::<u64>().max(1);
        let found = stepped().find(|state| {
            let is_there = at < weight(state);
            at = at.saturating_sub(weight(state));
            is_there
        });
        Some(Pick { region: found?.region, seed })
    }

    /// Has regions keep these paces until others are told, as when a recorded world chose them by the time
    /// that its steps took. Returns whether the paces are valid.
    pub fn follow(&mut self, paces: BTreeMap<RegionId, Pace>) -> bool {
        let are_valid = paces.values().all(|pace| pace.is_valid());
        if are_valid {
            (self.paces, self.is_told) = (paces, true);
        }
        are_valid
    }

    /// Chooses the pace of every region for the tick that begins.
    fn choose(&mut self, regions: &[Governed<'_>], dt_s: f32) {
        let now = self.ticks;
        self.ticks += 1;
        if self.is_told {
            return;
        }
        self.regions.retain(|id, _| regions.iter().any(|region| region.state.region == *id));
        let is_budget = matches!(self.fidelity, Fidelity::Budget { .. });
        let mut is_due = now.is_multiple_of(EVERY_TICKS);
        for region in regions {
            let memory = self.regions.entry(region.state.region).or_insert_with(|| Memory::new(now));
            let margin_m = if memory.watched { LEAVE * MARGIN_M } else { MARGIN_M };
            let is_seen = |view: &Viewpoint| view.gap_m(&region.cell) <= margin_m;
            let was_watched = memory.watched;
            memory.watched = match &self.looked_at {
                LookedAt::All => true,
                LookedAt::From(viewpoints) => viewpoints.iter().any(is_seen),
            };
            // With a budget there may be no time for a finer pace of a region that was looked at before.
            let is_kept = was_watched && is_budget;
            if memory.watched && !is_kept && !memory.is_full() {
                memory.turn_to(Pace::FULL, now);
                is_due |= is_budget;
            }
            // Others must make room at once for what is stepped more often than planned.
            is_due |= is_budget && region.state.urgent && !memory.is_full();
        }
        if is_due {
            match self.fidelity {
                Fidelity::Off => {}
                Fidelity::Tolerance { m_s } => self.keep_error(m_s, dt_s, regions),
                Fidelity::Budget { tick_ms } => self.keep_time(tick_ms.into(), regions),
            }
        }
        let pace = |region: &Governed<'_>| self.regions[&region.state.region].pace;
        self.paces = regions.iter().map(|region| (region.state.region, pace(region))).collect();
    }

    /// Lets unwatched regions become coarser, one rate at a time, until audits find too large an error, or
    /// signals tell that a step is too long.
    fn keep_error(&mut self, tolerance_m_s: f32, dt_s: f32, regions: &[Governed<'_>]) {
        let now = self.ticks;
        for (rank, RegionState { region, signals, .. }) in
            regions.iter().map(|region| region.state).enumerate()
        {
            let memory = self.regions.get_mut(region).expect("every region has a memory");
            memory.look(signals, now);
            memory.pace.turn = (rank % usize::from(COARSEST)) as u8;
            if memory.watched {
                continue;
            }
            let rate = memory.pace.rate;
            let (mean, count) = (memory.error.mean(), memory.error.count());
            let turn_rad = |rate: u8| signals.spin_rad_s * dt_s * f32::from(rate);
            // Overlaps may be deeper by as much as the tolerated error moves a body in the longest step.
            let deeper_m = tolerance_m_s * dt_s * f32::from(COARSEST);
            let overlaps = memory.is_settled(now)
                && memory.overlap_m.is_some_and(|full_m| signals.overlap_m > full_m + deeper_m);
            let errs = count >= SEASONED && mean > tolerance_m_s;
            if rate > 1 && (errs || overlaps || turn_rad(rate) > SLACK * TURN_RAD) {
                memory.patience = (2 * memory.patience).clamp(PATIENCE_TICKS, 64 * PATIENCE_TICKS);
                memory.stays_until = now + memory.patience;
                memory.turn_to(Pace { rate: rate / 2, ..memory.pace }, now);
            } else if rate < COARSEST
                && now >= memory.stays_until
                && memory.overlap_m.is_some()
                && (count < SEASONED || mean < EASY * tolerance_m_s)
                && turn_rad(2 * rate) <= TURN_RAD
            {
                memory.stays_until = now + PAUSE_TICKS;
                memory.turn_to(Pace { rate: 2 * rate, ..memory.pace }, now);
            }
        }
    }

    /// Makes regions coarser until ticks fit the budget in each process. First come the unwatched regions,
    /// the farthest first, down to each second tick and then to each fourth; then the watched ones in the
    /// same way. Regions that are bound together have one pace.
    fn keep_time(&mut self, tick_ms: f64, regions: &[Governed<'_>]) {
        let groups = bound(regions);
        let mut paces = vec![Pace::FULL; groups.len()];
        let processes: BTreeSet<u64> = regions.iter().map(|region| region.by).collect();
        self.is_kept = true;
        for process in processes {
            let (of, loads): (Vec<_>, Vec<_>) = groups
                .iter()
                .enumerate()
                .filter_map(|(at, group)| Some((at, self.load(group, process, regions)?)))
                .unzip();
            let plan = budget::plan(&loads, self.planned * tick_ms / self.longer(process));
            self.is_kept &= plan.is_kept;
            // A group that several processes compute is as coarse as the slowest of them needs.
            for (at, pace) in of.into_iter().zip(plan.paces) {
                paces[at] = cmp::max_by_key(pace, paces[at], |pace| pace.rate);
            }
        }
        for (group, pace) in groups.iter().zip(paces) {
            for region in group.iter().filter_map(|rank| regions.get(rank)) {
                let memory = self.regions.get_mut(&region.state.region).expect("every region has a memory");
                if memory.pace != pace {
                    memory.turn_to(pace, self.ticks);
                }
            }
        }
    }

    /// Returns the part of a group that a process computes, if any.
    fn load(&self, group: &RegionSet, process: u64, regions: &[Governed<'_>]) -> Option<Load> {
        let members = || group.iter().filter_map(|rank| regions.get(rank));
        members().find(|region| region.by == process)?;
        let far_m = |region: &Governed<'_>| {
            self.viewpoints().iter().map(|view| view.gap_m(&region.cell)).fold(f64::INFINITY, f64::min)
        };
        let own = members().filter(|region| region.by == process);
        let memory = |region: &Governed<'_>| &self.regions[&region.state.region];
        Some(Load {
            watched: members().any(|region| memory(region).watched),
            urgent: members().any(|region| region.state.urgent),
            pace: members().map(|region| memory(region).pace).min_by_key(|pace| pace.rate)?,
            far_m: members().map(far_m).fold(f64::INFINITY, f64::min),
            step_ms: own.map(|region| f64::from(region.state.step_ms)).sum(),
        })
    }

    /// Returns how many times as long the ticks of a process take as the steps of its regions: more because
    /// of exchanges, less on several threads.
    fn longer(&self, process: u64) -> f64 {
        match self.took_ms.get(&process) {
            Some([tick_ms, steps_ms]) if *steps_ms > 0.0 => tick_ms / steps_ms,
            _ => 1.0,
        }
    }

    /// Notes how long a region's step took, and how long as many steps of one tick each would have taken,
    /// milliseconds.
    pub fn note_spent(&mut self, took_ms: f32, full_ms: f32) {
        self.spent_ms += f64::from(took_ms);
        self.full_ms += f64::from(full_ms);
    }

    /// Notes what an audit of a region found.
    pub fn note_audited(&mut self, region: RegionId, audited: &Audited) {
        self.pay(audited.cost.into());
        audited.error_m_s.into_iter().for_each(|error_m_s| self.note_error(region, error_m_s));
    }

    /// Notes that `bodies` bodies are stepped in a tick. Returns whether an audit is paid for.
    fn earn(&mut self, bodies: u64) -> bool {
        self.credit += self.audited * bodies.max(FEW_BODIES) as f64;
        bodies > 0 && self.credit >= 0.0
    }

    /// Pays for an audit that costs as much as stepping `bodies` bodies once. The cost of an island decides
    /// when the next audit is made, not whether that island is audited: so each island is as likely as it is
    /// large.
    fn pay(&mut self, bodies: f64) {
        // By chance up to an eighth less or more, the same in every run: audits that all cost the same would come in step with the
        // turns of regions, and find one region alone.
        let lot = (drawn(mixed(self.ticks)) >> 32) as f64 / f64::from(u32::MAX);
        self.credit = self.credit.min(0.0) - bodies * (0.875 + 0.25 * lot);
    }

    /// Notes the error that an audit of a region found: the mean over an island's bodies after the step, m/s.
    pub(super) fn note_error(&mut self, region: RegionId, error_m_s: f32) {
        self.audits += 1;
        let weight = std::mem::take(&mut self.unaudited).max(1.0) as f32;
        self.error.add(error_m_s, weight);
        if let Some(memory) = self.regions.get_mut(&region) {
            memory.error.add(error_m_s, weight);
        }
    }

    /// Sets the part of the time that audits may take.
    pub fn set_audited(&mut self, part: f64) {
        self.audited = part;
    }

    /// Has every island audited in every tick, besides the audits by which levels are chosen.
    pub fn audit_all(&mut self) {
        self.audits_all = true;
    }

    /// Returns whether every island is audited in every tick.
    pub fn audits_all(&self) -> bool {
        self.audits_all
    }

    /// Notes a sum of errors, m/s, over `weight` bodies and ticks.
    pub fn note_all(&mut self, errors: f64, weight: f64) {
        self.all = (self.all.0 + errors, self.all.1 + weight);
    }

    /// Returns the mean error of all bodies over all ticks in which all islands were audited, m/s.
    pub fn true_error_m_s(&self) -> Option<f64> {
        let (errors, weight) = self.all;
        (weight > 0.0).then(|| errors / weight)
    }

    /// Notes how long a tick took a process, and how long the steps of its regions in it took, milliseconds.
    pub fn note_tick(&mut self, process: u64, tick_ms: f64, steps_ms: f64) {
        self.slowest_ms = self.slowest_ms.max(tick_ms);
        // A tick without any step says nothing of how long steps take.
        if steps_ms > 0.0 {
            let took_ms = self.took_ms.entry(process).or_default();
            *took_ms = [LONGER * took_ms[0] + tick_ms, LONGER * took_ms[1] + steps_ms];
        }
    }

    /// Ends a tick of which all processes have told how long it took. Counts the tick if it took longer than
    /// the budget, and then plans for less, if a plan can help.
    pub fn end_tick(&mut self) {
        let took_ms = std::mem::take(&mut self.slowest_ms);
        let Fidelity::Budget { tick_ms } = self.fidelity else { return };
        if self.ticks <= FIRST_TICKS {
            return;
        }
        let is_over = took_ms > f64::from(tick_ms);
        self.overruns += u64::from(is_over);
        if self.is_kept {
            let [least, most] = PLANNED_RANGE;
            let change = if is_over { OVERRUNS - 1.0 } else { OVERRUNS };
            self.planned = (self.planned + OVERRUN * change).clamp(least, most);
        }
    }

    /// Returns what fidelity saves and costs.
    pub fn report(&self) -> FidelityReport {
        let [low95_m_s, high95_m_s] = self.error.interval();
        FidelityReport {
            share_of_full_time: match self.full_ms > 0.0 {
                true => (self.spent_ms / self.full_ms).min(LARGEST_SHARE),
                false => 1.0,
            },
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
    fn new(now: u64) -> Self {
        let error = Estimate::default();
        Self {
            pace: Pace::FULL,
            watched: false,
            error,
            since: now,
            overlap_m: None,
            stays_until: 0,
            patience: 0,
        }
    }

    fn turn_to(&mut self, pace: Pace, now: u64) {
        (self.pace, self.since, self.error) = (pace, now, Estimate::default());
    }

    fn is_full(&self) -> bool {
        self.pace.rate == 1
    }

    /// Returns whether the region has had its pace for long enough.
    fn is_settled(&self, now: u64) -> bool {
        now >= self.since + PAUSE_TICKS
    }

    /// Learns from signals how deep overlaps are at full rate.
    fn look(&mut self, signals: &Signals, now: u64) {
        if self.is_full() && self.is_settled(now) {
            let mean_m = self.overlap_m.get_or_insert(signals.overlap_m);
            *mean_m += NEWER * (signals.overlap_m - *mean_m);
        }
    }
}

/// Returns the regions, by rank, in groups that must be at one time.
fn bound(regions: &[Governed<'_>]) -> Vec<RegionSet> {
    let mut groups: Vec<RegionSet> = Vec::new();
    for (rank, region) in regions.iter().enumerate() {
        let bound = region.state.bound.union(RegionSet::only(rank));
        // The groups so far are disjoint. Those that the region is bound to become one with it.
        let (joined, apart): (Vec<_>, Vec<_>) =
            groups.into_iter().partition(|group| !group.intersection(bound).is_empty());
        groups = apart;
        groups.push(joined.into_iter().fold(bound, RegionSet::union));
    }
    groups
}
