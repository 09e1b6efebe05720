//! Reports the borders between regions to an observer: bodies that both hold, exchanges per tick, overlap
//! depth, disagreement.

use std::collections::BTreeMap;

use rapier3d::prelude::RigidBodyHandle;

use super::{RegionHost, Side};
use crate::physics::coupling::swept_bounds;
use crate::physics::region::Region;
use crate::space::{BodyId, Bounds, Cell, RegionId, RegionSet};

/// The border of two regions of a local world, as [`World::borders`](crate::World::borders) returns it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BorderView {
    /// The region with the lower id.
    pub a: RegionId,
    /// The other region.
    pub b: RegionId,
    /// The number of movable bodies that both regions hold, whoever owns them.
    pub bodies: usize,
    /// The number of exchanges per tick, from the next tick on; with
    /// [`Coupling::Auto`](crate::physics::Coupling::Auto) as many as the border came to need.
    pub exchanges: usize,
    /// The number of contact hops across the border within which bodies live in both regions, on the side
    /// where it is larger; 0 with couplings that go by distance.
    pub depth: usize,
    /// The deviation of the copies of shared bodies from their means in the last tick, summed over its
    /// exchanges, m/s; 0 with couplings without consensus.
    pub disagreement_m_s: f32,
}

impl RegionHost {
    /// Returns the borders between regions computed here, in order of (a, b): one for each two regions whose
    /// cells have a face in common, or that hold the same body.
    pub fn borders(&self) -> Vec<BorderView> {
        let mut shared = self.bodies_shared();
        for (at, a) in self.regions().enumerate() {
            for b in self.regions().skip(at + 1).filter(|b| share_a_face(a.cell(), b.cell())) {
                shared.entry((a.rank(), b.rank())).or_default();
            }
        }
        let here = |rank: usize| self.place_of[rank].map(|place| &self.sides[place]);
        let view = |((a, b), bodies)| {
            let (a, b) = (here(a)?, here(b)?);
            let agrees = self.settings.coupling.shares_mass();
            let deeper = a.border.pace.extra_depth().max(b.border.pace.extra_depth());
            let from = |one: &Side, other: &Side| one.border.pace.disagreement_with_m_s(other.region.rank());
            Some(BorderView {
                a: a.region.id(),
                b: b.region.id(),
                bodies,
                exchanges: a.steps().min(b.steps()),
                depth: if agrees { self.settings.depth + deeper } else { 0 },
                disagreement_m_s: from(a, b).max(from(b, a)).min(f32::MAX),
            })
        };
        shared.into_iter().filter_map(view).collect()
    }

    /// Returns how many regions hold a body, as its owner knows. For an immovable body, or one owned
    /// elsewhere, counts the regions here.
    pub fn holders(&self, id: BodyId) -> usize {
        match self.owned(id) {
            Some((region, handle)) => 1 + region.slot(handle).holders.len(),
            None => self.regions().filter(|region| region.handle_of(id).is_some()).count(),
        }
    }

    /// Returns the ghosts here: every copy of a movable body in a region that does not own it, with that
    /// region and Rapier's handle there.
    pub fn ghosts(&self) -> impl Iterator<Item = (BodyId, &Region, RigidBodyHandle)> {
        self.regions()
            .flat_map(|region| region.ghosts().iter().map(move |copy| (copy.id, region, copy.handle)))
    }

    /// Returns the swept AABB of a movable body as a region holds it: the box around all that it may reach in
    /// the next three ticks.
    pub(crate) fn swept_bounds(&self, region: &Region, handle: RigidBodyHandle) -> Bounds {
        swept_bounds(region, handle, self.settings.dt_s)
    }

    /// Returns how many bodies each two regions both hold, by their ranks in ascending order.
    fn bodies_shared(&self) -> BTreeMap<(usize, usize), usize> {
        let mut shared = BTreeMap::new();
        for region in self.regions() {
            for link in region.shared() {
                let own = RegionSet::only(region.rank());
                let ranks: Vec<_> = region.slot(link.handle).holders.union(own).iter().collect();
                for (at, &a) in ranks.iter().enumerate() {
                    for &b in &ranks[at + 1..] {
                        *shared.entry((a, b)).or_default() += 1;
                    }
                }
            }
        }
        shared
    }
}

fn share_a_face(a: &Cell, b: &Cell) -> bool {
    let common: [f64; 3] = std::array::from_fn(|i| a.max[i].min(b.max[i]) - a.min[i].max(b.min[i]));
    common.iter().all(|&length| length >= 0.0) && common.iter().filter(|&&length| length > 0.0).count() == 2
}

#[cfg(test)]
mod tests {
    use crate::physics::{BorderView, Coupling, Preset, StepSettings};
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::scene::{Params, Scene};
    use crate::space::{Axis, Bounds};
    use rapier3d::prelude::*;

    #[test]
    fn every_face_between_regions_is_a_border_and_an_edge_is_none() {
        let cuts = Partitioning::Cuts(vec![(Axis::X, 0.0), (Axis::Z, 0.0)]);
        let world = LocalWorld::new(WorldConfig { partitioning: cuts, ..WorldConfig::default() }).unwrap();
        let borders = world.host().borders();
        assert_eq!(borders.len(), 4, "{borders:?}");
        assert!(borders.iter().all(|border| border.a < border.b && border.bodies == 0));
        assert!(borders.windows(2).all(|two| (two[0].a, two[0].b) < (two[1].a, two[1].b)));
        assert!(LocalWorld::new(WorldConfig::default()).unwrap().host().borders().is_empty());
    }

    #[test]
    fn a_body_held_by_four_regions_is_shared_at_the_edges_too() {
        let cuts = Partitioning::Cuts(vec![(Axis::X, 0.0), (Axis::Z, 0.0)]);
        let step = StepSettings::default().with_coupling(Coupling::Owner);
        let config = WorldConfig { partitioning: cuts, step, ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).unwrap();
        world.step().unwrap();
        let borders = world.host().borders();
        assert_eq!(borders.len(), 6);
        assert!(
            borders.iter().all(|border| border.bodies == 1 && border.depth == 0 && border.exchanges == 1)
        );
        assert!(borders.iter().all(|border| border.disagreement_m_s == 0.0));
    }

    #[test]
    fn a_border_under_load_climbs_and_others_do_not() {
        let scene =
            Scene::named("tower", &Params::new().with("sleep", 0).with("top_mass_ratio", 100)).unwrap();
        let config = WorldConfig::for_scene(&scene);
        let step = config.step.with_preset(Preset::Precise);
        let cuts = Partitioning::Cuts(vec![(Axis::Y, 5.0), (Axis::X, 10.0)]);
        let bounds = Bounds::around([0.0, 5.0, 0.0], [20.0; 3]);
        let step = StepSettings { island_limit: 1, ..step };
        let config = WorldConfig { bounds, partitioning: cuts, step, ..config };
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        let (mut most, mut deepest) = (0, 0);
        for _ in 0..600 {
            world.step().unwrap();
            let borders = world.host().borders();
            let (busy, idle): (Vec<BorderView>, Vec<_>) =
                borders.iter().copied().partition(|border| border.bodies > 0);
            let [busy] = busy[..] else { panic!("{borders:?}") };
            assert_eq!(busy.disagreement_m_s, world.host().disagreement_m_s());
            assert!(idle.iter().all(|border| border.disagreement_m_s == 0.0 && border.exchanges == 1));
            (most, deepest) = (most.max(busy.exchanges), deepest.max(busy.depth));
        }
        assert!(most >= 2 && deepest >= step.depth, "{most} exchanges, {deepest} hops");
    }
}
