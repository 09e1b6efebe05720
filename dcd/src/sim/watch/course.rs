//! Follows a world from tick to tick, and sums up what moved its bodies.

use super::{Look, Quantity, Ruler, Strain};
use crate::space::Tick;

/// How many ticks a mean needs.
const ENOUGH: u32 = 150;

/// The way of a world through its ticks.
#[derive(Clone, Debug, Default)]
pub struct Course {
    before: Option<(Tick, Look)>,
    /// Momentum that contacts did not keep, over how many ticks.
    drift: (f64, u32),
}

impl Course {
    /// Notes that what follows does not follow from what was before.
    pub fn interrupt(&mut self) {
        self.before = None;
    }

    /// Takes the next look, and returns what moved bodies since the one before, if that was of the tick before.
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
