//! Follows a world from tick to tick, and sums up what moved its bodies.

use super::{Look, Quantity, Ruler, Strain};
use crate::space::Tick;

/// The number of ticks that a mean needs.
const ENOUGH: u32 = 150;

/// The course of a world through its ticks.
#[derive(Clone, Debug, Default)]
pub struct Course {
    before: Option<(Tick, Look)>,
    /// The momentum that contacts did not keep, summed up, and over how many ticks.
    drift: (f64, u32),
}

impl Course {
    /// Notes that the next look does not follow from the look before.
    pub fn interrupt(&mut self) {
        self.before = None;
    }

    /// Takes in the next look. Returns what moved bodies since the look before, if that was of the tick
    /// before.
    pub fn follow(&mut self, ruler: &Ruler, tick: Tick, look: Look) -> Strain {
        let before = self.before.take().filter(|(before, _)| before.next() == tick);
        let found = before.map(|(_, before)| ruler.of_motion(&before, &look));
        self.before = Some((tick, look));
        let Some(found) = found else { return Strain::default() };
        let (sum, ticks) = &mut self.drift;
        (*sum, *ticks) = (*sum + found.of(Quantity::Drift), *ticks + 1);
        let mean = if *ticks < ENOUGH { 0.0 } else { *sum / f64::from(*ticks) };
        Strain::each(|quantity| if quantity == Quantity::Drift { mean } else { found.of(quantity) })
    }
}
