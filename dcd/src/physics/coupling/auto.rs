//! Chooses how many substeps a region takes per tick and how deep its overlaps are, by how far the copies at
//! each of its borders disagree over many ticks. Disagreement that shakes cancels out in the average;
//! disagreement that sags or creeps stays.
//!
//! A border climbs a ladder of rungs: one exchange per tick, two, a deeper overlap, four exchanges, and so
//! on. Depth comes before four exchanges: it costs a few more copies, while four exchanges find all contacts
//! of a region twice as often. Each climb is a trial: a climb that does not let copies agree better is taken
//! back, and the next comes much later.
//!
//! Both sides of a border see the same copies, so that both come to the same result. A region announces in
//! the last exchange of a tick how many substeps it will take in the next. A body is exchanged as often as
//! all its members step.

use std::sync::OnceLock;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Coupling, Moment};
use crate::physics::rank_remap::RankRemap;
use crate::space::RegionSet;

/// Ticks over which disagreement is averaged.
const AVERAGED_TICKS: f32 = 15.0;
/// A border whose lasting disagreement is below this part of the tolerance is calm.
const CALM: f32 = 0.2;
/// Ticks after which a climb must have paid: lasting disagreement is down to the part [`PAYS`] of what it
/// was, and average disagreement has not grown.
const TRIAL_TICKS: u32 = 30;
const PAYS: f32 = 0.7;
/// Ticks for which a border must have been calm to descend a rung, and for which it rests after a climb that
/// did not pay, at first. A change of rung disturbs the bodies at the border. So the number grows fourfold,
/// up to the longest, when a climb does not pay or when the border must climb again after a descent.
const PATIENCE_TICKS: u32 = 60;
const LONGEST_PATIENCE_TICKS: u32 = 64 * PATIENCE_TICKS;

/// The distance of copies' velocities from their mean at the border with another region, in m/s.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Disagreement {
    /// The largest of any copy, in an exchange.
    pub most_m_s: f32,
    /// The largest of any body's first copy. It is averaged as a vector over [`AVERAGED_TICKS`] and summed
    /// over the exchanges of a tick, less a part of the body's speed.
    pub lasting_m_s: f32,
}

impl Disagreement {
    /// Returns the worse of two bodies' disagreements, each field by itself.
    pub(super) fn max(self, other: Self) -> Self {
        Self {
            most_m_s: self.most_m_s.max(other.most_m_s),
            lasting_m_s: self.lasting_m_s.max(other.lasting_m_s),
        }
    }
}

/// Updates a running average with the disagreement in one of so many exchanges per tick.
pub(super) fn average(of: &mut Vector, disagreement: Vector, exchanges: usize) {
    *of += (disagreement - *of / exchanges as f32) / AVERAGED_TICKS;
}

/// The numbers of substeps of all regions as far as this one has heard, and the state of each of its borders.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Pace {
    /// The substeps in the present tick, and those announced for the next, by rank, this region included.
    steps: Vec<(u8, u8)>,
    /// The states of the borders, by rank of the other region.
    borders: Vec<BorderPace>,
    /// The number of substeps that this region will announce.
    wanted: u8,
    /// The number of substeps that each other region was told last, by its rank.
    told: Vec<u8>,
    /// Says whether all regions have been told what is wanted and all borders are at rung 0; kept until any of
    /// that changes.
    #[serde(skip)]
    level: OnceLock<bool>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct BorderPace {
    /// How far it has climbed: 0 is one exchange per tick.
    rung: u8,
    /// Largest disagreement, summed over the exchanges of this tick, m/s.
    sum: f32,
    /// The sum of the last tick.
    last: f32,
    /// The sum averaged over the last ticks.
    average: f32,
    /// Lasting disagreement after the last exchange of this tick, m/s.
    lasting: f32,
    calm: u32,
    /// The highest rung that has paid: climbing to it again is no trial.
    proven: u8,
    /// Lasting and average disagreement at the last climb, while that climb is on trial.
    trial: Option<(f32, f32)>,
    /// Ticks since it last changed its rung.
    since: u32,
    /// Ticks before it may climb again.
    rest: u32,
    /// Calm ticks that the next descent needs, and the ticks of the next rest.
    patience: u32,
    /// Says whether anything is shared across it.
    used: bool,
}

impl Pace {
    pub(super) fn new(regions: usize, steps: usize) -> Self {
        let steps = steps as u8;
        Self {
            steps: vec![(steps, steps); regions],
            borders: vec![BorderPace::idle(); regions],
            wanted: steps,
            told: vec![steps; regions],
            level: OnceLock::new(),
        }
    }

    /// Returns the substeps that the region of this rank takes in the present tick.
    pub(in crate::physics) fn steps_of(&self, rank: usize) -> usize {
        self.steps[rank].0.into()
    }

    /// Returns how often in the present tick a body that these regions hold is exchanged.
    pub(super) fn exchanges_among(&self, members: RegionSet) -> usize {
        members.iter().map(|rank| self.steps_of(rank)).min().unwrap_or(1)
    }

    /// Notes the substeps that the region of this rank announced for the next tick; 0 announces nothing.
    pub(super) fn hear(&mut self, rank: usize, steps: u8) {
        if steps > 0 {
            self.steps[rank].1 = steps;
        }
    }

    /// Returns the number of substeps that this region, of rank `own`, announces for the next tick, and those
    /// of the regions `to` that have yet to be told.
    pub(super) fn tell(&mut self, own: usize, to: RegionSet) -> (u8, RegionSet) {
        self.level.take();
        (self.steps[own].1, self.told[own]) = (self.wanted, self.wanted);
        let unaware: RegionSet = to.iter().filter(|&rank| self.told[rank] != self.wanted).collect();
        unaware.iter().for_each(|rank| self.told[rank] = self.wanted);
        (self.wanted, unaware)
    }

    /// Translates all ranks.
    pub(in crate::physics) fn remap_ranks(&mut self, ranks: &RankRemap) {
        ranks.list(&mut self.steps, || (1, 1));
        ranks.list(&mut self.borders, BorderPace::idle);
        ranks.list(&mut self.told, || 1);
        self.level.take();
    }

    /// Makes all regions take so many substeps in the next tick. If this region wants another number, it
    /// announces that again.
    pub(in crate::physics) fn restart(&mut self, steps: usize) {
        self.steps.fill((steps as u8, steps as u8));
        self.told.fill(steps as u8);
        self.level.take();
    }

    /// Returns whether this region, of rank `own`, has no new number of substeps to announce, and all its borders are at rung 0.
    pub(in crate::physics) fn is_settled(&self, own: usize) -> bool {
        let is_level = || {
            #[cfg(test)]
            WALKS.set(WALKS.get() + 1);
            self.told.iter().all(|&told| told == self.wanted)
                && self.borders.iter().all(|border| border.rung == 0)
        };
        self.steps[own] == (self.wanted, self.wanted) && *self.level.get_or_init(is_level)
    }

    /// Returns whether no border waits to be allowed to climb again.
    pub(super) fn has_rested(&self) -> bool {
        self.borders.iter().all(|border| border.rest == 0)
    }

    /// Ends the tick: the substeps announced for the next tick are the present ones from now on.
    pub(super) fn turn(&mut self) {
        for (now, next) in &mut self.steps {
            *now = *next;
        }
    }

    /// Returns the substeps of this region, of rank `own`, in the tick after the present one.
    pub(in crate::physics) fn next_of(&self, own: usize) -> usize {
        self.steps[own].1.into()
    }

    /// Adds up how far copies shared with each other region disagreed in an exchange; `None` where nothing is
    /// shared. With the coupling `auto`, it decides after the last exchange of a tick how many substeps to
    /// want.
    pub(super) fn judge(&mut self, disagreement: &[Option<Disagreement>], moment: Moment<'_>) {
        self.level.take();
        let top = top_rung(moment.settings.exchanges);
        let decides = moment.settings.coupling == Coupling::Auto;
        for (border, disagreement) in self.borders.iter_mut().zip(disagreement) {
            let Disagreement { most_m_s, lasting_m_s } = disagreement.unwrap_or_default();
            (border.sum, border.lasting) = (border.sum + most_m_s, lasting_m_s);
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

    /// Returns by how many hops overlaps are to be deeper than the settings say.
    pub(in crate::physics) fn extra_depth(&self) -> usize {
        usize::from(self.borders.iter().any(|border| border.rung >= DEEPER))
    }

    /// Returns how far copies disagreed in the last tick at the worst border, m/s.
    pub(in crate::physics) fn disagreement_m_s(&self) -> f32 {
        self.borders.iter().map(|border| border.last).fold(0.0, f32::max)
    }

    /// Returns how far copies disagreed in the last tick at the border with the region of this rank, m/s.
    pub(in crate::physics) fn disagreement_with_m_s(&self, rank: usize) -> f32 {
        self.borders[rank].last
    }
}

impl BorderPace {
    fn idle() -> Self {
        Self {
            rung: 0,
            sum: 0.0,
            last: 0.0,
            average: 0.0,
            lasting: 0.0,
            calm: 0,
            proven: 0,
            trial: None,
            since: 0,
            rest: 0,
            patience: PATIENCE_TICKS,
            used: false,
        }
    }

    fn settle(&mut self, tolerance_m_s: f32, top: u8) {
        self.last = std::mem::take(&mut self.sum);
        self.rest = self.rest.saturating_sub(1);
        if !std::mem::take(&mut self.used) {
            *self = Self { last: self.last, rest: self.rest, patience: self.patience, ..Self::idle() };
            return;
        }
        self.average += (self.last - self.average) / AVERAGED_TICKS;
        self.since = self.since.saturating_add(1);
        self.calm = if self.lasting < CALM * tolerance_m_s { self.calm + 1 } else { 0 };
        match self.trial {
            Some(_) if self.since < TRIAL_TICKS => {}
            Some((lasting, average)) if self.lasting > PAYS * lasting || self.average > average => {
                self.rest = self.patience;
                self.lose_patience();
                self.turn_to(self.rung - 1);
            }
            Some(_) => (self.trial, self.proven) = (None, self.proven.max(self.rung)),
            None if self.lasting > tolerance_m_s && self.rung < self.proven.min(top) => {
                self.lose_patience();
                self.turn_to(self.proven.min(top));
            }
            None if self.lasting > tolerance_m_s && self.rung < top && self.rest == 0 => {
                self.turn_to(self.rung + 1);
                self.trial = Some((self.lasting, self.average.max(self.last)));
            }
            None if self.calm >= self.patience && self.rung > 0 => self.turn_to(self.rung - 1),
            None => {}
        }
    }

    fn turn_to(&mut self, rung: u8) {
        (self.rung, self.calm, self.since, self.trial) = (rung, 0, 0, None);
    }

    fn lose_patience(&mut self) {
        self.patience = (4 * self.patience).min(LONGEST_PATIENCE_TICKS);
    }
}

/// The lowest rung at which overlaps are deeper.
const DEEPER: u8 = 2;

/// Returns the exchanges per tick at a rung: 1, 2, 2, 4, 8 …
fn exchanges_at(rung: u8) -> u8 {
    1 << if rung < DEEPER { rung } else { rung - 1 }
}

/// Returns the highest rung with at most so many exchanges.
fn top_rung(exchanges: usize) -> u8 {
    match largest_power(exchanges).ilog2() as u8 {
        0 => 0,
        power => power + 1,
    }
}

/// Returns the largest power of two up to `most`, or 64. The substeps of regions divide each other, so that
/// they end together.
fn largest_power(most: usize) -> u8 {
    (1u8 << most.clamp(1, 64).ilog2()).max(1)
}

#[cfg(test)]
thread_local! {
    pub(super) static WALKS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Pace {
        /// Forgets whether it is settled.
        pub(in crate::physics::coupling) fn forget(&mut self) {
            self.level.take();
        }
    }

    /// Runs `count` ticks in which copies disagree by what `disagreement` gives for the rung. Returns in how
    /// many of them the border was above the lowest rung.
    fn ticks(border: &mut BorderPace, count: usize, disagreement: impl Fn(u8) -> f32) -> usize {
        let tick = |_: &usize| {
            let now = disagreement(border.rung);
            (border.sum, border.lasting, border.used) = (now, now, true);
            border.settle(0.03, top_rung(4));
            border.rung > 0
        };
        (0..count).filter(tick).count()
    }

    /// Returns a disagreement that more exchanges ease.
    fn eased(rung: u8) -> f32 {
        [0.5, 0.25, 0.1, 0.01][usize::from(rung)]
    }

    #[test]
    fn a_border_climbs_while_that_pays_and_descends_when_its_copies_have_long_agreed() {
        let mut border = BorderPace::idle();
        assert_eq!(ticks(&mut border, 100, |_| 0.02), 0, "within the tolerance");
        ticks(&mut border, 300, eased);
        assert_eq!(border.rung, 3);
        ticks(&mut border, 59, |_| 0.0);
        assert_eq!(border.rung, 3);
        ticks(&mut border, 200, |_| 0.0);
        assert_eq!(border.rung, 0);
        ticks(&mut border, 1, eased);
        assert_eq!(border.rung, 3, "it has paid before");
        border.settle(0.03, 3);
        assert_eq!(border.rung, 0, "nothing is shared any more");
    }

    #[test]
    fn a_climb_that_does_not_pay_is_taken_back_within_a_second_and_seldom_tried_again() {
        for in_vain in [|_| 0.5, |rung| 0.5 + 0.2 * f32::from(rung)] {
            let mut border = BorderPace::idle();
            let tried = ticks(&mut border, 90, in_vain);
            assert!((1..60).contains(&tried) && border.rung == 0, "{tried} ticks, {border:?}");
            let tried = ticks(&mut border, 36_000, in_vain);
            assert!((1..600).contains(&tried), "{tried} of ten minutes' ticks");
        }
    }

    #[test]
    fn what_shakes_cancels_out_and_what_sags_does_not_however_many_exchanges_a_tick_has() {
        for exchanges in [1, 2, 4] {
            let (mut shaking, mut sagging) = (Vector::ZERO, Vector::ZERO);
            for i in 0..120 * exchanges {
                let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
                average(&mut shaking, Vector::X * sign, exchanges);
                average(&mut sagging, Vector::X * 0.3 / exchanges as f32, exchanges);
            }
            assert!(shaking.length() < 0.05, "{shaking:?}");
            assert!((sagging.x - 0.3).abs() < 0.01, "{sagging:?}");
        }
    }

    #[test]
    fn a_border_that_must_climb_again_soon_after_descending_waits_longer_the_next_time() {
        let mut border = BorderPace::idle();
        ticks(&mut border, 300, eased);
        let descent = |border: &mut BorderPace| {
            let from = border.rung;
            let descends = |_: &usize| {
                ticks(border, 1, |_| 0.0);
                border.rung < from
            };
            (0..10_000).find(descends).expect("it descends")
        };
        let first = descent(&mut border);
        ticks(&mut border, 1, |_| 0.5);
        ticks(&mut border, 200, eased);
        assert!(descent(&mut border) > 2 * first);
    }

    #[test]
    fn the_rungs_are_one_exchange_two_two_deeper_and_four() {
        assert_eq!([0, 1, 2, 3, 4].map(exchanges_at), [1, 2, 2, 4, 8]);
        assert_eq!([1, 2, 3, 4, 8, 64].map(top_rung), [0, 2, 2, 3, 4, 7]);
    }
}
