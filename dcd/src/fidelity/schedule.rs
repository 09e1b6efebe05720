//! Defines what is told about the pace of regions: what each says of itself after a tick, and which stay behind in the next. From both follows by how
//! many ticks each is stepped.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use crate::space::{RegionId, RegionSet};

/// The most ticks that one step of a region may have: it is behind the present by one less at most.
pub const COARSEST: u8 = 4;

/// The part of a step of one tick that its solver takes, with the iterations that are set. Reckoned for all scenes alike: of terrain it is less.
const SOLVING: f64 = 0.5;

/// How often a region is computed, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize, Deserialize)]
pub struct Pace {
    /// It is stepped once per so many ticks.
    pub rate: u8,
    /// In the ticks whose number leaves the remainder that this leaves, divided by the rate.
    pub turn: u8,
}

impl Pace {
    /// Names the pace of what is computed in full.
    pub const FULL: Self = Self { rate: 1, turn: 0 };

    /// Returns whether it is one that a region may have.
    pub fn is_valid(self) -> bool {
        matches!(self.rate, 1 | 2 | COARSEST) && self.turn < COARSEST
    }
}

/// Returns the solver iterations of a step of so many ticks, where one of one tick has so many: a longer step needs more, though fewer than its
/// ticks would take.
pub fn iterations(per_tick: usize, ticks: u8) -> usize {
    match ticks {
        0 | 1 => per_tick,
        2 | 3 => per_tick + per_tick.div_ceil(2),
        _ => 2 * per_tick,
    }
}

/// Returns how long a step of so many ticks takes over one of one tick in full, as reckoned.
pub fn relative_time(per_tick: usize, ticks: u8) -> f64 {
    let per_tick = per_tick.max(1);
    1.0 - SOLVING + SOLVING * iterations(per_tick, ticks) as f64 / per_tick as f64
}

/// The findings of a look at a region, by which a step is judged too long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Signals {
    /// The mean of the awake bodies' deepest overlaps, metres.
    pub overlap_m: f32,
    /// The spin that a tenth of the awake bodies exceed, rad/s.
    pub spin_rad_s: f32,
}

/// The state of a region after a tick, as the pace of the next is chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RegionState {
    /// Which region.
    pub region: RegionId,
    /// Ticks that it is behind the present.
    pub behind: u8,
    /// Nothing in it can change by itself: it is the same at any time.
    pub rests: bool,
    /// Bodies inserted there wait to be told to regions that it is not at one time with.
    pub awaited: bool,
    /// The regions, by rank, that must be at one time with it: those with which it shares bodies, or is about to.
    pub bound: RegionSet,
    /// Awake bodies.
    pub awake: u32,
    /// How long a step of one tick in full takes, smoothed, as reckoned, milliseconds.
    pub step_ms: f32,
    /// What the last look at it found.
    pub signals: Signals,
    /// How long its step in this tick took, milliseconds; 0 if there was none.
    pub took_ms: f32,
    /// How long as many steps of one tick each would have taken, as reckoned, milliseconds.
    pub full_ms: f32,
    /// What was found by an audit in this tick.
    pub audited: Option<Audited>,
}

impl RegionState {
    /// Returns the times in it, which no other run finds again: of a step in full, of that in this tick, and of as many steps as that has ticks.
    pub fn times_ms(&self) -> [f32; 3] {
        [self.step_ms, self.took_ms, self.full_ms]
    }

    /// Puts other times in their place.
    pub fn set_times_ms(&mut self, times_ms: [f32; 3]) {
        [self.step_ms, self.took_ms, self.full_ms] = times_ms;
    }

    /// Returns the state of a region of which nothing is known: it is computed in full.
    pub fn unknown(region: RegionId) -> Self {
        Self {
            region,
            behind: 0,
            rests: false,
            awaited: true,
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
    /// The mean error per tick of the region's bodies, as estimated by it, m/s; `None` where what was drawn could not be audited.
    pub error_m_s: Option<f32>,
    /// What it cost, in bodies stepped once.
    pub cost: f32,
}

/// The pace of all regions in one tick. Those that do not stay behind are stepped, by all the ticks that they are behind and this one.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct Schedule {
    /// The regions that stay behind, in id order.
    pub behind: Vec<RegionId>,
    /// By how many ticks any region may be behind the present after the next tick: regions look as far ahead.
    pub behind_most: u8,
    /// What is audited in this tick.
    pub audit: Option<Pick>,
}

/// A region of which an island is to be audited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Pick {
    /// Which region.
    pub region: RegionId,
    /// By which its bodies are drawn.
    pub seed: u64,
}
