//! Sets how many rounds of substep and exchange a tick has: as many as the region with the most substeps
//! takes. A region with fewer substeps steps only in some of the rounds.

use super::{RegionHost, Side};

impl RegionHost {
    /// Returns the most substeps that any region computed here wants in the next tick; known once a tick has
    /// been completed.
    pub fn rounds_wanted(&self) -> usize {
        self.sides.iter().map(Side::steps_next).max().unwrap_or(1)
    }

    /// Sets the rounds of the next tick: the most that any region of the world wants.
    ///
    /// # Panics
    /// Within a tick, or if `rounds` is 0.
    pub fn set_rounds(&mut self, rounds: usize) {
        assert_eq!(self.round, 0, "a tick has the rounds that it began with");
        assert!(rounds > 0, "a tick has at least one round");
        self.rounds = rounds;
    }

    /// Returns the disagreement at the worst border in the last tick, in m/s: how far the copies of a body
    /// were from their mean, summed over the exchanges. [`Coupling::Auto`](crate::physics::Coupling::Auto)
    /// steers by this error estimate. 0 with couplings without consensus.
    pub fn disagreement_m_s(&self) -> f32 {
        let all = self.sides.iter().map(|side| side.border.pace.disagreement_m_s());
        // Finite, so that it can be sent, whatever a copy has come to.
        all.fold(0.0, f32::max).min(f32::MAX)
    }

    /// Returns the rounds of the next tick, or of the one under way.
    pub fn rounds(&self) -> usize {
        self.rounds
    }

    /// Returns the exchanges of the last tick, at the border that took most; 0 before the first and in a
    /// world of one region.
    pub fn exchanges_done(&self) -> usize {
        if self.partition.len() == 1 { 0 } else { self.rounds_done }
    }
}

#[cfg(test)]
mod tests {
    use crate::physics::{Coupling, StepSettings};
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::scene::{Params, Scene};

    /// A tower of ten boxes that stays awake, cut through its middle.
    fn tower(coupling: Coupling) -> LocalWorld {
        let scene = Scene::named("tower", &Params::new().with("sleep", 0)).unwrap();
        let config = WorldConfig::for_scene(&scene);
        let step = StepSettings { exchanges: 3, ..config.step.with_coupling(coupling) };
        let cuts = Partitioning::Cuts(vec![(crate::space::Axis::Y, 5.0)]);
        LocalWorld::from_scene(&scene, WorldConfig { partitioning: cuts, step, ..config }).unwrap()
    }

    #[test]
    fn copies_in_a_cut_tower_disagree_a_little_and_the_exchanges_are_counted() {
        let mut world = tower(Coupling::Overlap);
        assert_eq!(world.host().exchanges_done(), 0);
        let mut worst = 0.0f32;
        for _ in 0..30 {
            world.step().unwrap();
            worst = worst.max(world.host().disagreement_m_s());
        }
        assert_eq!(world.host().exchanges_done(), 3);
        assert!(worst > 1e-6 && worst < 0.5, "{worst} m/s");
    }

    #[test]
    fn the_owner_s_word_leaves_nothing_to_disagree_on() {
        let mut world = tower(Coupling::Owner);
        for _ in 0..30 {
            world.step().unwrap();
        }
        assert_eq!(world.host().disagreement_m_s(), 0.0);
    }

    #[test]
    fn a_world_of_one_region_exchanges_nothing() {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        world.step().unwrap();
        assert_eq!((world.host().rounds_wanted(), world.host().exchanges_done()), (1, 0));
    }
}
