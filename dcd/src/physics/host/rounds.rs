//! How many rounds of exchange a tick has: as many as the region that takes most micro-steps. A region that takes fewer
//! steps only in some of them.

use super::RegionHost;

impl RegionHost {
    /// Micro-steps that the regions computed here want in the next tick, at most; known once a tick has been completed.
    pub fn rounds_wanted(&self) -> usize {
        self.regions.iter().map(|region| region.steps_next()).max().unwrap_or(1)
    }

    /// Sets the rounds of the tick to come: the most that any region of the world wants.
    pub fn set_rounds(&mut self, rounds: usize) {
        self.rounds = rounds;
    }

    /// How far the copies of a body were from their mean in the last tick at the worst border, summed over its exchanges, in
    /// m/s: the error estimate of [`Coupling::Auto`](super::Coupling::Auto).
    pub fn disagreement_m_s(&self) -> f32 {
        self.regions.iter().map(|region| region.disagreement_m_s()).fold(0.0, f32::max)
    }

    /// Rounds of the tick to come, or of the one under way.
    pub fn rounds(&self) -> usize {
        self.rounds
    }
}
