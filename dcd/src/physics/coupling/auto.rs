//! How many micro-steps a region takes: as many as its borders need, each by how far the copies at it disagree. The
//! disagreement of copies before they agree is an estimate of the error that the border makes (rank correlation with the
//! true deviation about 0.9); where it is small, one exchange a tick does.
//!
//! Both sides of a border see the same copies, so both come to the same result. A region says in the last exchange of a
//! tick how many micro-steps it will take in the next; a body is exchanged as often as all its members step.

use super::Moment;
use crate::space::RegionSet;

/// How fast the averaged disagreement follows one that is higher, and one that is lower.
const ATTACK: f32 = 0.3;
const RELEASE: f32 = 0.1;
/// Below this part of the tolerance a border is calm.
const CALM: f32 = 0.2;
/// Ticks that a border must have been calm for to take half the exchanges.
const CALM_TICKS: u32 = 60;

/// What a region knows of the micro-steps at its borders.
#[derive(Debug, Default)]
pub(in crate::physics) struct Pace {
    /// By rank, this region's own too: micro-steps in the present tick, and in the next as far as told.
    steps: Vec<(u8, u8)>,
    /// By rank of the other region.
    borders: Vec<BorderPace>,
    /// What this region will tell.
    wanted: u8,
}

#[derive(Clone, Copy, Debug)]
struct BorderPace {
    exchanges: u8,
    /// Sum over the exchanges of this tick, m/s.
    sum: f32,
    average: f32,
    calm: u32,
    /// Whether anything is shared across it.
    used: bool,
}

impl Pace {
    pub(super) fn new(regions: usize, steps: usize) -> Self {
        let idle = BorderPace { exchanges: 1, sum: 0.0, average: 0.0, calm: 0, used: false };
        let steps = steps as u8;
        Self { steps: vec![(steps, steps); regions], borders: vec![idle; regions], wanted: steps }
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
    /// shared. After the last of a tick decides what to want.
    pub(super) fn judge(&mut self, disagreement: &[Option<f32>], moment: Moment<'_>) {
        let most = largest_power(moment.settings.exchanges);
        for (border, disagreement) in self.borders.iter_mut().zip(disagreement) {
            border.sum += disagreement.unwrap_or(0.0);
            border.used |= disagreement.is_some();
            if moment.last {
                border.settle(moment.settings.tolerance_m_s, most);
            }
        }
        if moment.last {
            self.wanted = self.borders.iter().map(|border| border.exchanges).max().unwrap_or(1);
        }
    }
}

impl BorderPace {
    fn settle(&mut self, tolerance_m_s: f32, most: u8) {
        let (error, used) = (std::mem::take(&mut self.sum), std::mem::take(&mut self.used));
        if !used {
            (self.exchanges, self.average, self.calm) = (1, 0.0, 0);
            return;
        }
        self.average += (error - self.average) * if error > self.average { ATTACK } else { RELEASE };
        self.calm = if self.average < CALM * tolerance_m_s { self.calm + 1 } else { 0 };
        if self.average > tolerance_m_s && self.exchanges < most {
            self.exchanges *= 2;
            // The finer steps are to show first what they do.
            (self.average, self.calm) = (0.5 * tolerance_m_s, 0);
        } else if self.calm >= CALM_TICKS && self.exchanges > 1 {
            (self.exchanges, self.calm) = (self.exchanges / 2, 0);
        }
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
            border.settle(0.03, 4);
        }
        border.exchanges
    }

    #[test]
    fn a_border_takes_more_exchanges_while_its_copies_disagree_and_fewer_when_they_have_long_agreed() {
        let mut border = BorderPace { exchanges: 1, sum: 0.0, average: 0.0, calm: 0, used: false };
        assert_eq!(settled(&mut border, 0.02, 100), 1);
        assert_eq!(settled(&mut border, 0.5, 1), 2);
        assert_eq!(settled(&mut border, 0.5, 20), 4);
        assert_eq!(settled(&mut border, 0.01, 200), 4, "between calm and the tolerance nothing changes");
        assert_eq!(settled(&mut border, 0.0, 59), 4);
        assert_eq!(settled(&mut border, 0.0, 130), 1);
        settled(&mut border, 0.5, 20);
        border.settle(0.03, 4);
        assert_eq!(border.exchanges, 1, "nothing is shared any more");
    }
}
