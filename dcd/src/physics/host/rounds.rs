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

    /// Rounds of the tick to come, or of the one under way.
    pub fn rounds(&self) -> usize {
        self.rounds
    }
}
