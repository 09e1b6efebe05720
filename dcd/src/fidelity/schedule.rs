//! Defines what is told about the pace of regions: what each reports of itself after a tick, and which stay
//! behind in the next. From both follows by how many ticks each region is stepped.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use crate::space::{RegionId, RegionSet};

/// The most ticks that one step of a region may have. So a region is behind the present by at most one tick
/// less.
pub const COARSEST: u8 = 4;

/// The ticks in which a region is stepped after its program has moved or changed something there, from the next
/// one on.
pub const ATTENDED_TICKS: u8 = 8;

/// The part of a step of one tick that its solver takes, with the iterations that are set. The estimate is
/// the same for all scenes; on terrain the part is smaller.
const SOLVING: f64 = 0.5;

/// How often a region is stepped, and in which ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
pub struct Pace {
    /// The rate: the region is stepped once per this many ticks.
    pub rate: u8,
    /// The turn: the region is stepped in the ticks whose number has the same remainder as this, divided by
    /// the rate.
    pub turn: u8,
}

impl Pace {
    /// The pace of a region that is computed in full.
    pub const FULL: Self = Self { rate: 1, turn: 0 };

    /// Returns whether a region may have this pace.
    pub fn is_valid(self) -> bool {
        matches!(self.rate, 1 | 2 | COARSEST) && self.turn < COARSEST
    }
}

/// Returns the solver iterations of a step of `ticks` ticks, where a step of one tick has `per_tick`. A
/// longer step needs more, but fewer than its ticks would need one by one.
pub fn iterations(per_tick: usize, ticks: u8) -> usize {
    match ticks {
        0 | 1 => per_tick,
        2 | 3 => per_tick + per_tick.div_ceil(2),
        _ => 2 * per_tick,
    }
}

/// Returns the estimated time of a step of `ticks` ticks over that of a step of one tick in full.
pub fn relative_time(per_tick: usize, ticks: u8) -> f64 {
    let per_tick = per_tick.max(1);
    1.0 - SOLVING + SOLVING * iterations(per_tick, ticks) as f64 / per_tick as f64
}

/// The findings of a look at a region, by which a step is judged to be too long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Signals {
    /// The mean of the awake bodies' deepest overlaps, metres.
    pub overlap_m: f32,
    /// The spin that a tenth of the awake bodies exceed, rad/s.
    pub spin_rad_s: f32,
}

/// The state of a region after a tick, by which its pace in the next tick is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RegionState {
    /// The region.
    pub region: RegionId,
    /// The ticks by which it is behind the present.
    pub behind: u8,
    /// Says whether nothing in it can change by itself, so that it is the same at any time.
    pub rests: bool,
    /// Says whether it must be stepped in the next tick, whatever its pace: a step of several ticks would be
    /// wrong there, or bodies inserted there wait to be told to regions that it is not at one time with.
    pub urgent: bool,
    /// The regions, by rank, that must be at one time with it, since it shares bodies with them or is about
    /// to.
    pub bound: RegionSet,
    /// The number of awake bodies.
    pub awake: u32,
    /// The estimated time of a step of one tick in full, smoothed, milliseconds.
    pub step_ms: f32,
    /// The findings of the last look at it.
    pub signals: Signals,
    /// The time of its step in this tick, milliseconds; 0 if there was none.
    pub took_ms: f32,
    /// The estimated time that as many steps of one tick each would have taken, milliseconds.
    pub full_ms: f32,
    /// The result of an audit in this tick.
    pub audited: Option<Audited>,
}

impl RegionState {
    /// Returns the times in it, which no other run measures again: of a step in full, of the step in this
    /// tick, and of as many steps as that has ticks.
    pub fn times_ms(&self) -> [f32; 3] {
        [self.step_ms, self.took_ms, self.full_ms]
    }

    /// Replaces these times.
    pub fn set_times_ms(&mut self, times_ms: [f32; 3]) {
        [self.step_ms, self.took_ms, self.full_ms] = times_ms;
    }

    /// Returns the state of a region of which nothing is known, so that it is computed in full.
    pub fn unknown(region: RegionId) -> Self {
        Self {
            region,
            behind: 0,
            rests: false,
            urgent: true,
            bound: RegionSet::EMPTY,
            awake: 0,
            step_ms: 0.0,
            signals: Signals::default(),
            took_ms: 0.0,
            full_ms: 0.0,
            audited: None,
        }
    }
}

/// The result of an audit.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Audited {
    /// The mean error of the region's bodies after the step, as the audit estimates it, m/s; `None` if what was
    /// drawn could not be audited.
    pub error_m_s: Option<f32>,
    /// The cost of the audit, in bodies stepped once.
    pub cost: f32,
}

/// The choice for one tick. Regions that do not stay behind are stepped by this tick and all those that they
/// are behind.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct Schedule {
    /// The regions that stay behind, in id order.
    pub behind: Vec<RegionId>,
    /// The number of ticks by which any region may be behind the present after the next tick. Regions look
    /// that far ahead.
    pub behind_most: u8,
    /// The region to audit in this tick.
    pub audit: Option<Pick>,
}

/// A region of which an island is to be audited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Pick {
    /// The region.
    pub region: RegionId,
    /// The seed by which its bodies are drawn.
    pub seed: u64,
}
