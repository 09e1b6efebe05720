//! Balances the load while the world runs: moves planes of the distribution tree, splits and merges regions. Whatever changes,
//! bodies change owners as if they had crossed a border by themselves; a region is given up only when nothing is left in it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::giants::Giants;
use super::{HostError, RegionHost};
use crate::physics::coupling::Side;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::Region;
use crate::space::{Balance, Burden, DistributionTree, Load, RegionId, TreeChange, plan};

/// The load balancer: its settings, and the merges under way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Balancer {
    settings: Balance,
    /// Regions that are being emptied into their siblings, by the vertex that is to be one region.
    merging: BTreeMap<RegionId, Heir>,
    /// The most bodies of an island that stays whole, as the user has it.
    island_limit: usize,
}

/// The one of two sibling regions that takes over all bodies of the other.
type Heir = RegionId;

impl Balancer {
    pub(super) fn new(settings: Balance, island_limit: usize) -> Self {
        Self { settings, merging: BTreeMap::new(), island_limit }
    }
}

/// The most bodies of an island that stays whole while the tree follows the load, however much there is to do.
const BALANCED_ISLAND: usize = 256;
/// Islands of at most so many bodies stay whole all the same.
const LEAST_ISLAND: usize = 16;
/// An island that stays whole is at most this part of what a region has to do: more could not be balanced.
const ISLAND_SHARE: usize = 4;

impl RegionHost {
    /// Turns load balancing on with these settings, or off with `None`. The host must compute every region. With load balancing,
    /// islands are cut that have more than 256 bodies, or more than both 16 and a quarter of a mean region's awake bodies: whole in
    /// one region, they would be its load.
    pub fn set_balance(&mut self, settings: Option<Balance>) {
        assert_eq!(self.sides.len(), self.partition.len(), "balance needs all regions in one process");
        let island_limit = self.balancer.as_ref().map_or(self.settings.island_limit, |old| old.island_limit);
        self.settings.island_limit = island_limit;
        self.balancer = settings.map(|settings| Balancer::new(settings, island_limit));
        if self.balancer.is_some() {
            self.limit_islands(island_limit);
        }
    }

    /// Limits the islands that stay whole to such as leave their region in balance.
    fn limit_islands(&mut self, island_limit: usize) {
        let awake: usize = self.regions().map(Region::awake_count).sum();
        let share = awake / self.sides.len() / ISLAND_SHARE;
        self.settings.island_limit = island_limit.min(share.clamp(LEAST_ISLAND, BALANCED_ISLAND));
    }

    /// Returns the settings of load balancing, if it is on.
    pub fn balance(&self) -> Option<&Balance> {
        self.balancer.as_ref().map(|balancer| &balancer.settings)
    }

    /// Rebalances the tree between two ticks, when it is due: moves planes, splits or merges regions. Returns the regions that
    /// have new ids, as (old, new).
    pub fn rebalance(&mut self) -> Result<Vec<(RegionId, RegionId)>, HostError> {
        let Some(mut balancer) = self.balancer.take() else { return Ok(Vec::new()) };
        let is_due = self.tick.0.is_multiple_of(balancer.settings.every_ticks.into());
        if is_due {
            self.limit_islands(balancer.island_limit);
        }
        let renamed = if is_due { self.follow_load(&mut balancer) } else { Ok(Vec::new()) };
        self.balancer = Some(balancer);
        renamed
    }

    fn follow_load(&mut self, balancer: &mut Balancer) -> Result<Vec<(RegionId, RegionId)>, HostError> {
        let mut renamed = Vec::new();
        self.sides.iter_mut().for_each(|side| side.region.wake_left_behind());
        self.finish_merging(balancer, &mut renamed)?;
        let giants = self.giants();
        let burdens = self.burdens(balancer.settings.load, &giants);
        let merging: Vec<_> = balancer.merging.keys().copied().collect();
        let changes = plan(self.partition.tree(), &burdens, &giants.boxes, &balancer.settings, &merging);
        self.change_tree(&changes, balancer, &mut renamed)?;
        Ok(renamed)
    }

    /// Returns the load of a region, in the units of the balance.
    pub fn load_of(&self, region: &Region, load: Load) -> f64 {
        match load {
            Load::Counts => region.activity(),
            Load::Times => region.mean_step_us(),
        }
    }

    /// Returns every awake body with its part of its region's load, and the sleeping bodies of islands that are too large to move
    /// whole.
    fn burdens(&self, load: Load, giants: &Giants) -> Vec<Burden> {
        let mut burdens = Vec::new();
        for region in self.regions() {
            let awake: Vec<_> = region.awake_places().collect();
            let weight = self.load_of(region, load) / awake.len() as f64;
            burdens.extend(awake.into_iter().map(|(id, place)| Burden {
                place,
                weight,
                island: giants.of(id),
            }));
        }
        for (id, island) in giants.members() {
            let owned = self.owned(id).filter(|(region, body)| region.physics().bodies[*body].is_sleeping());
            let place = owned.map(|(region, body)| region.centre_of(body));
            burdens.extend(place.map(|place| Burden { place, weight: 0.0, island: Some(island) }));
        }
        burdens
    }

    /// Returns the islands that are too large to move whole, if the coupling moves islands at all: to cut one takes more
    /// substeps, and most of its bodies are held twice. Other couplings pay that at every border.
    fn giants(&self) -> Giants {
        if self.settings.coupling.moves_islands() {
            Giants::find(&self.sides, self.settings.island_limit.max(BALANCED_ISLAND))
        } else {
            Giants::default()
        }
    }

    fn change_tree(
        &mut self,
        changes: &[TreeChange],
        balancer: &mut Balancer,
        renamed: &mut Vec<(RegionId, RegionId)>,
    ) -> Result<(), HostError> {
        if changes.is_empty() {
            return Ok(());
        }
        let mut tree = self.partition.tree().clone();
        for change in changes {
            match *change {
                TreeChange::Move { vertex, at } => {
                    tree.move_plane(vertex, at).expect("a plan names planes of the tree")
                }
                TreeChange::Merge { vertex, heir } => {
                    tree.yield_to(vertex, heir).expect("a plan names siblings");
                    balancer.merging.insert(vertex, heir);
                }
                TreeChange::Split { leaf, axis, at } => match tree.split_at(leaf, axis, at) {
                    Ok((left, right)) => {
                        self.adopt(tree.clone(), &[(leaf, left)], Some((right, left)))?;
                        renamed.push((leaf, left));
                    }
                    // The world's bounds or the depth of its tree leave no room.
                    Err(error) => tracing::debug!(%error, "a region stays whole"),
                },
            }
        }
        self.refit(tree)
    }

    /// Completes merges: gives up the regions that have been emptied.
    fn finish_merging(
        &mut self,
        balancer: &mut Balancer,
        renamed: &mut Vec<(RegionId, RegionId)>,
    ) -> Result<(), HostError> {
        for (vertex, heir) in balancer.merging.clone() {
            let (left, right) =
                self.partition.tree().children_of(vertex).expect("merged vertices are inner ones");
            let leaving = if heir == left { right } else { left };
            let place = self.regions().position(|region| region.id() == leaving).expect("all are here");
            let region = &self.sides[place].region;
            if region.holds_movable() || region.owes_word() {
                continue;
            }
            balancer.merging.remove(&vertex);
            let mut tree = self.partition.tree().clone();
            tree.merge(vertex).expect("its children are regions");
            self.sides.remove(place);
            self.adopt(tree.clone(), &[(heir, vertex)], None)?;
            renamed.push((heir, vertex));
            self.refit(tree)?;
        }
        Ok(())
    }

    /// Adopts a tree that has other leaves: `names` maps old ids of regions to new ones, `born` names a region that is new and
    /// the one that it was cut from.
    fn adopt(
        &mut self,
        tree: DistributionTree,
        names: &[(RegionId, RegionId)],
        born: Option<(RegionId, RegionId)>,
    ) -> Result<(), HostError> {
        let old = self.partition.leaves().clone();
        Arc::make_mut(&mut self.partition).set_tree(tree);
        let name_of = |id: RegionId| names.iter().find(|(from, _)| *from == id).map_or(id, |(_, to)| *to);
        let rank = |id| self.partition.rank_of(id);
        let ranks = RankRemap {
            to: old.iter().map(|&id| rank(name_of(id))).collect(),
            leaves: self.partition.leaves().clone(),
            born: born.and_then(|(new, from)| Some((rank(new)?, rank(from)?))),
        };
        self.sides.iter_mut().for_each(|side| side.remap_ranks(&ranks));
        self.sides.sort_by_key(|side| side.region.rank());
        self.place_of = vec![None; self.partition.len()];
        if let Some((new, from)) = born {
            self.add_region(new);
            let place = |id| self.regions().position(|region| region.id() == id).expect("both are here");
            let (new, from) = (place(new), place(from));
            let (pace, anchor) = (self.sides[from].border.pace.clone(), self.sides[from].region.anchor());
            let side = &mut self.sides[new];
            side.border.pace = pace.of_newborn();
            side.region.set_anchor(anchor);
            self.statics.recover(&mut side.region, &self.shapes)?;
        }
        self.threads.suit(self.sides.len())?;
        self.index();
        Ok(())
    }

    /// Adopts a tree with the same leaves whose planes have moved: gives every region its cell, with the immovable bodies there.
    pub(crate) fn refit(&mut self, tree: DistributionTree) -> Result<(), HostError> {
        Arc::make_mut(&mut self.partition).set_tree(tree);
        for Side { region, border, .. } in &mut self.sides {
            let cell = *self.partition.cell(region.rank());
            if *region.cell() != cell {
                region.set_cell(cell);
                // Sleeping bodies too are looked at anew.
                border.overlook(region.own_sleepers());
                self.statics.recover(region, &self.shapes)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use crate::protocol::WorldPose;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::scene::Scene;
    use crate::space::{Axis, Balance, Bounds};

    /// 600 boxes in courses of ten by ten, each on four others, so that all touch: 10.5 m wide, around the origin. Beside it
    /// stand twenty small stacks, four of them on the left.
    fn heap_and_stacks() -> Scene {
        let mut scene = Scene::empty("heap and stacks");
        scene.push_fixed_box([0.0, -0.5, 0.0], [80.0, 0.5, 20.0], &ColliderBuilder::ball(1.0).friction(0.7));
        let mut brick = |at: [f64; 3]| {
            let body = RigidBodyBuilder::dynamic().can_sleep(false);
            scene.push(WorldPose::at(at), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(0.7));
        };
        for course in 0..6 {
            let off = 0.5 * f64::from(course % 2) - 4.75;
            for i in 0..100 {
                brick([f64::from(i % 10) + off, f64::from(course) + 0.5, f64::from(i / 10) + off]);
            }
        }
        for stack in 0..20 {
            let x = if stack < 4 { -12.0 - 3.0 * f64::from(stack) } else { 3.0 * f64::from(stack) };
            (0..3).for_each(|level| brick([x, f64::from(level) + 0.5, 0.0]));
        }
        scene.bounds = Bounds::new([-60.0, -1.0, -10.0], [60.0, 8.0, 10.0]);
        scene
    }

    #[test]
    fn planes_leave_a_heap_that_they_began_in_and_stay_beside_it() {
        let scene = heap_and_stacks();
        for cuts in [vec![(Axis::X, 0.0)], vec![(Axis::X, 0.0), (Axis::Z, 0.3)]] {
            let regions = 1 << cuts.len();
            let config = WorldConfig {
                partitioning: Partitioning::Cuts(cuts),
                balance: Some(Balance { every_ticks: 5, ..Balance::keeping(regions) }),
                ..WorldConfig::for_scene(&scene)
            };
            let mut world = LocalWorld::from_scene(&scene, config).unwrap();
            let mut cells = Vec::new();
            for _ in 0..60 {
                world.step().unwrap();
                let now: Vec<_> = world.regions().map(|region| *region.cell()).collect();
                if cells.last() != Some(&now) {
                    cells.push(now);
                }
            }
            assert!(cells.len() <= 3, "{regions} regions: the planes went to and fro: {cells:?}");
            let heap = Bounds::new([-5.25, 0.0, -5.25], [5.25, 6.0, 5.25]);
            let touched = world.regions().filter(|region| region.cell().touches(&heap)).count();
            assert_eq!(touched, 1, "{regions} regions: {cells:?}");
        }
    }
}
