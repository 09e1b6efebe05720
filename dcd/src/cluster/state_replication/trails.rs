//! Remembers for some seconds where bodies have been that move fast, or jump: a client that another process
//! has told up to now may have them there.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::cluster::coverage::AROUND_M;
use crate::protocol::Area;
use crate::space::{BodyId, Tick};

/// The seconds for which a client may have been told nothing before it finds that its relay is silent: as
/// long as its link to the relay stands
/// ([`CLIENT_IDLE_TIMEOUT`](crate::protocol::link::CLIENT_IDLE_TIMEOUT)), and some more until another process
/// tells it.
pub(super) const SILENT_S: f64 = 15.0;

/// The largest speed of bodies that are not followed, m/s: in all that time they come no farther than the
/// distance within which bodies count around an area.
const SLOW_M_S: f64 = AROUND_M / SILENT_S;

/// The seconds of which trails are kept together.
const TOGETHER_S: f64 = 1.0;

/// A box around all places where a body was, by two corners.
type Trail = ([f64; 3], [f64; 3]);

/// The places where fast bodies have been lately.
#[derive(Clone, Debug, Default)]
pub(super) struct Trails {
    /// The trails in parts of a second or so, each with the tick from which it begins.
    parts: VecDeque<(Tick, BTreeMap<BodyId, Trail>)>,
}

impl Trails {
    /// Notes that a body has moved from one place to another in the ticks since `last`.
    pub(super) fn add(
        &mut self,
        (last, now): (Tick, Tick),
        dt_s: f64,
        id: BodyId,
        (from, to): ([f64; 3], [f64; 3]),
    ) {
        let way_m = (0..3).map(|axis| (to[axis] - from[axis]).powi(2)).sum::<f64>().sqrt();
        let passed_s = dt_s * now.0.saturating_sub(last.0).max(1) as f64;
        if way_m <= SLOW_M_S * passed_s {
            return;
        }
        let ticks = |seconds: f64| (seconds / dt_s) as u64;
        if self.parts.back().is_none_or(|(since, _)| since.0 + ticks(TOGETHER_S) <= now.0) {
            self.parts.push_back((now, BTreeMap::new()));
            self.parts.retain(|(since, _)| since.0 + ticks(SILENT_S + TOGETHER_S) >= now.0);
        }
        let Some((_, part)) = self.parts.back_mut() else { return };
        let (low, high) = part.entry(id).or_insert((from, from));
        for axis in 0..3 {
            low[axis] = low[axis].min(from[axis]).min(to[axis]);
            high[axis] = high[axis].max(from[axis]).max(to[axis]);
        }
    }

    /// Returns the bodies that may have been in one of these areas.
    pub(super) fn through(&self, areas: &[Area], now: Tick, dt_s: f64) -> BTreeSet<BodyId> {
        let from = now.0.saturating_sub(((SILENT_S + TOGETHER_S) / dt_s) as u64);
        let nearest =
            |(low, high): &Trail, at: [f64; 3]| [0, 1, 2].map(|axis| at[axis].clamp(low[axis], high[axis]));
        let is_in = |trail: &Trail| areas.iter().any(|area| area.enters(nearest(trail, area.centre)));
        let all = self.parts.iter().filter(|(since, _)| since.0 >= from).flat_map(|(_, part)| part);
        all.filter(|(_, trail)| is_in(trail)).map(|(&id, _)| id).collect()
    }
}
