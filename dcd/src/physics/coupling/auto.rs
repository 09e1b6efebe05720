//! How many micro-steps a region takes and how deep its overlaps are: as much as its borders need, each by how far the
//! copies at it disagree. The disagreement of copies before they agree is an estimate of the error that the border makes
//! (rank correlation with the true deviation about 0.9); where it is small, one exchange a tick does.
//!
//! A border climbs by steps: one exchange, two, a deeper overlap, four exchanges, and so on. Depth comes before four, since
//! it costs a few copies more, and four exchanges find all contacts of a region twice as often.
//!
//! Both sides of a border see the same copies, so both come to the same result. A region says in the last exchange of a
//! tick how many micro-steps it will take in the next; a body is exchanged as often as all its members step.

use serde::{Deserialize, Serialize};

use super::{Coupling, Moment};
use crate::physics::renumber::Renumbering;
use crate::space::RegionSet;

/// How fast the averaged disagreement follows one that is higher, and one that is lower.
const ATTACK: f32 = 0.3;
const RELEASE: f32 = 0.1;
/// Below this part of the tolerance a border is calm.
const CALM: f32 = 0.2;
/// Ticks that a border must have been calm for to descend a rung, at first. A change of rung stirs what lies at the border:
/// when the border has to climb again soon after, it takes four times as long the next time, up to the longest.
const CALM_TICKS: u32 = 60;
const LONGEST_CALM_TICKS: u32 = 64 * CALM_TICKS;

/// What a region knows of the micro-steps at its borders.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Pace {
    /// By rank, this region's own too: micro-steps in the present tick, and in the next as far as told.
    steps: Vec<(u8, u8)>,
    /// By rank of the other region.
    borders: Vec<BorderPace>,
    /// What this region will tell.
    wanted: u8,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct BorderPace {
    /// How far it has climbed: 0 is one exchange.
    rung: u8,
    /// Sum over the exchanges of this tick, m/s.
    sum: f32,
    /// Of the last tick.
    last: f32,
    average: f32,
    calm: u32,
    /// Calm ticks before the next descent.
    patience: u32,
    /// Ticks since the last descent.
    descended: u32,
    /// Whether anything is shared across it.
    used: bool,
}

impl Pace {
    pub(super) fn new(regions: usize, steps: usize) -> Self {
        let steps = steps as u8;
        Self {
            steps: vec![(steps, steps); regions],
            borders: vec![BorderPace::idle(); regions],
            wanted: steps,
        }
    }

    /// Micro-steps that the region of this rank takes in the present tick.
    pub(in crate::physics) fn steps_of(&self, rank: usize) -> usize {
        self.steps[rank].0.into()
    }

    /// How often in the present tick a body is exchanged that these hold.
    pub(super) fn exchanges_among(&self, members: RegionSet) -> usize {
        members.iter().map(|rank| self.steps_of(rank)).min().unwrap_or(1)
    }

    /// What the region of this rank said of the next tick; 0 is nothing.
    pub(super) fn hear(&mut self, rank: usize, steps: u8) {
        if steps > 0 {
            self.steps[rank].1 = steps;
        }
    }

    /// What this region, of this rank, says of the next tick: 0 when that is nothing new.
    pub(super) fn tell(&mut self, own: usize) -> u8 {
        let news = self.steps[own].1 != self.wanted;
        self.steps[own].1 = self.wanted;
        if news { self.wanted } else { 0 }
    }

    /// Ranks have changed; a newborn region takes as many micro-steps as the one that it was cut from.
    pub(in crate::physics) fn renumber(&mut self, ranks: &Renumbering) {
        ranks.list(&mut self.steps, || (1, 1));
        ranks.list(&mut self.borders, BorderPace::idle);
        if let Some((new, from)) = ranks.born {
            self.steps[new] = self.steps[from];
        }
    }

    /// What a region that was cut from this one knows.
    pub(in crate::physics) fn of_newborn(self) -> Self {
        Self { borders: vec![BorderPace::idle(); self.borders.len()], ..self }
    }

    /// Whether this region, of this rank, says nothing new of its micro-steps, and has come down to one.
    pub(in crate::physics) fn is_settled(&self, own: usize) -> bool {
        self.steps[own] == (self.wanted, self.wanted) && self.borders.iter().all(|border| border.rung == 0)
    }

    /// The tick is over.
    pub(super) fn turn(&mut self) {
        for (now, next) in &mut self.steps {
            *now = *next;
        }
    }

    /// Micro-steps of this region in the tick after the present one.
    pub(in crate::physics) fn next_of(&self, own: usize) -> usize {
        self.steps[own].1.into()
    }

    /// Takes in how far copies shared with each other region disagreed in an exchange, in m/s; none where nothing is
    /// shared. After the last of a tick decides what to want, if that is left to it.
    pub(super) fn judge(&mut self, disagreement: &[Option<f32>], moment: Moment<'_>) {
        let top = top_rung(moment.settings.exchanges);
        let decides = moment.settings.coupling == Coupling::Auto;
        for (border, disagreement) in self.borders.iter_mut().zip(disagreement) {
            border.sum += disagreement.unwrap_or(0.0);
            border.used |= disagreement.is_some();
            if moment.last && decides {
                border.settle(moment.settings.tolerance_m_s, top);
            } else if moment.last {
                border.last = std::mem::take(&mut border.sum);
            }
        }
        if moment.last && decides {
            let most = self.borders.iter().map(|border| exchanges_at(border.rung)).max();
            self.wanted = most.unwrap_or(1).min(largest_power(moment.settings.exchanges));
        }
    }

    /// By how many hops overlaps are to be deeper than usual.
    pub(in crate::physics) fn extra_depth(&self) -> usize {
        usize::from(self.borders.iter().any(|border| border.rung >= DEEPER))
    }

    /// How far copies have lately disagreed at the worst border in a tick, m/s.
    pub(in crate::physics) fn disagreement_m_s(&self) -> f32 {
        self.borders.iter().map(|border| border.last).fold(0.0, f32::max)
    }

    /// The same at the border with the region of this rank.
    pub(in crate::physics) fn disagreement_with_m_s(&self, rank: usize) -> f32 {
        self.borders[rank].last
    }
}

impl BorderPace {
    fn idle() -> Self {
        let (patience, descended) = (CALM_TICKS, CALM_TICKS);
        Self { rung: 0, sum: 0.0, last: 0.0, average: 0.0, calm: 0, patience, descended, used: false }
    }

    fn settle(&mut self, tolerance_m_s: f32, top: u8) {
        let (error, used) = (std::mem::take(&mut self.sum), std::mem::take(&mut self.used));
        self.last = error;
        if !used {
            *self = Self { last: error, ..Self::idle() };
            return;
        }
        self.average += (error - self.average) * if error > self.average { ATTACK } else { RELEASE };
        self.calm = if self.average < CALM * tolerance_m_s { self.calm + 1 } else { 0 };
        self.descended = self.descended.saturating_add(1);
        if self.average > tolerance_m_s && self.rung < top {
            self.rung += 1;
            if self.descended < CALM_TICKS {
                self.patience = (4 * self.patience).min(LONGEST_CALM_TICKS);
                self.descended = CALM_TICKS;
            }
            // The finer steps are to show first what they do.
            (self.average, self.calm) = (0.5 * tolerance_m_s, 0);
        } else if self.calm >= self.patience && self.rung > 0 {
            (self.rung, self.calm, self.descended) = (self.rung - 1, 0, 0);
        }
    }
}

/// The rung from which on overlaps are deeper.
const DEEPER: u8 = 2;

/// 1, 2, 2, 4, 8 …
fn exchanges_at(rung: u8) -> u8 {
    1 << if rung < DEEPER { rung } else { rung - 1 }
}

/// The highest rung with so many exchanges at most.
fn top_rung(exchanges: usize) -> u8 {
    match largest_power(exchanges).ilog2() as u8 {
        0 => 0,
        power => power + 1,
    }
}

/// Micro-steps of regions divide each other, so that they meet.
fn largest_power(most: usize) -> u8 {
    (1u8 << most.clamp(1, 64).ilog2()).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(border: &mut BorderPace, error: f32, ticks: usize) -> u8 {
        for _ in 0..ticks {
            (border.sum, border.used) = (error, true);
            border.settle(0.03, top_rung(4));
        }
        border.rung
    }

    #[test]
    fn a_border_climbs_while_its_copies_disagree_and_descends_when_they_have_long_agreed() {
        let mut border = BorderPace::idle();
        assert_eq!(settled(&mut border, 0.02, 100), 0);
        assert_eq!(settled(&mut border, 0.5, 1), 1);
        assert_eq!(settled(&mut border, 0.5, 20), 3);
        assert_eq!(settled(&mut border, 0.01, 200), 3, "between calm and the tolerance nothing changes");
        assert_eq!(settled(&mut border, 0.0, 59), 3);
        assert_eq!(settled(&mut border, 0.0, 200), 0);
        settled(&mut border, 0.5, 20);
        border.settle(0.03, 3);
        assert_eq!(border.rung, 0, "nothing is shared any more");
    }

    #[test]
    fn a_border_that_must_climb_again_soon_after_descending_waits_longer_the_next_time() {
        let mut border = BorderPace::idle();
        settled(&mut border, 0.5, 20);
        let descent = |border: &mut BorderPace| {
            let from = border.rung;
            (0..10_000).find(|_| settled(border, 0.0, 1) < from).expect("it descends")
        };
        let first = descent(&mut border);
        settled(&mut border, 0.5, 20);
        assert!(descent(&mut border) > 2 * first);
    }

    #[test]
    fn the_rungs_are_one_exchange_two_two_deeper_and_four() {
        assert_eq!([0, 1, 2, 3, 4].map(exchanges_at), [1, 2, 2, 4, 8]);
        assert_eq!([1, 2, 3, 4, 8, 64].map(top_rung), [0, 2, 2, 3, 4, 7]);
    }
}
