//! How many micro-steps a tick takes, each followed by an exchange, and how well the last one went.
//!
//! A host of all regions decides by itself. Nodes each say what their own regions want, and all take the most of it: every
//! region takes micro-steps of the same length.

use super::RegionHost;

impl RegionHost {
    /// Micro-steps that the regions computed here want in the next tick; a world of one region has nothing to agree on.
    pub fn rounds_wanted(&self) -> usize {
        if self.partition.len() == 1 { 1 } else { self.settings.exchanges }
    }

    /// Makes the next tick take so many micro-steps. A host of all regions sets them itself in [`RegionHost::step`].
    ///
    /// # Panics
    /// Within a tick, or when there are none.
    pub fn set_rounds(&mut self, rounds: usize) {
        assert_eq!(self.round, 0, "the micro-steps of a tick are equally long");
        assert!(rounds > 0, "a tick takes at least one micro-step");
        self.rounds = rounds;
    }

    /// Exchanges of the last tick; 0 before the first and in a world of one region.
    pub fn exchanges_done(&self) -> usize {
        if self.tick.0 == 0 || self.partition.len() == 1 { 0 } else { self.rounds }
    }

    /// How far the velocity of a copy was from the mean that its holders agreed on, in m/s: the most of any copy here in
    /// the last exchange. What [`Coupling::Auto`](crate::physics::Coupling::Auto) steers by; 0 with couplings that do not
    /// agree on means.
    pub fn disagreement_m_s(&self) -> f32 {
        let all = self.regions.iter().flat_map(|region| &region.disagreement);
        // A number that travels, whatever a copy has come to.
        all.copied().fold(0.0, f32::max).min(f32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use crate::physics::{Coupling, StepSettings};
    use crate::runtime::{DcdWorld, Partitioning, WorldConfig};
    use crate::scene::{Params, Scene};

    /// A tower of ten boxes that stays awake, cut at this height.
    fn tower(coupling: Coupling, at: f64) -> DcdWorld {
        let scene = Scene::named("tower", &Params::new().with("sleep", 0)).unwrap();
        let config = WorldConfig::for_scene(&scene);
        let step = StepSettings { exchanges: 3, ..config.step.with_coupling(coupling) };
        let cuts = Partitioning::Cuts(vec![(crate::space::Axis::Y, at)]);
        DcdWorld::from_scene(&scene, WorldConfig { partitioning: cuts, step, ..config }).unwrap()
    }

    #[test]
    fn copies_in_a_cut_tower_disagree_a_little_and_the_exchanges_are_counted() {
        let mut world = tower(Coupling::Overlap, 5.0);
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
        let mut world = tower(Coupling::Owner, 5.0);
        for _ in 0..30 {
            world.step().unwrap();
        }
        assert_eq!(world.host().disagreement_m_s(), 0.0);
    }

    #[test]
    fn one_region_takes_its_tick_in_one_step() {
        let mut world = DcdWorld::new(WorldConfig::default()).unwrap();
        world.step().unwrap();
        assert_eq!((world.host().rounds_wanted(), world.host().exchanges_done()), (1, 0));
    }
}
