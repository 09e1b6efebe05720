//! The tree follows the load while the world runs: planes move, regions are cut and merged. Whatever changes, bodies change
//! hands as if they had crossed a border by themselves; a region is given up only when nothing is left in it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{HostError, RegionHost};
use crate::physics::region::Region;
use crate::physics::renumber::Renumbering;
use crate::space::{Balance, Burden, Change, DistributionTree, Load, RegionId, plan};

/// How the tree is kept in balance, and what is under way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Balancer {
    settings: Balance,
    /// Regions that are being emptied into their siblings, by the vertex that is to be one region.
    merging: BTreeMap<RegionId, Heir>,
}

/// The one of two siblings that takes over all of the other's.
type Heir = RegionId;

impl Balancer {
    pub(super) fn new(settings: Balance) -> Self {
        Self { settings, merging: BTreeMap::new() }
    }
}

impl RegionHost {
    /// Lets the tree follow the load from now on, or stay as it is. The host must compute every region.
    pub fn set_balance(&mut self, settings: Option<Balance>) {
        assert_eq!(self.regions.len(), self.partition.len(), "balance needs all regions in one process");
        self.balancer = settings.map(Balancer::new);
    }

    /// How the tree follows the load.
    pub fn balance(&self) -> Option<&Balance> {
        self.balancer.as_ref().map(|balancer| &balancer.settings)
    }

    /// Between two ticks: looks whether planes should move, or regions come or go, when it is time to. Returns regions that
    /// have new names, with these.
    pub fn rebalance(&mut self) -> Result<Vec<(RegionId, RegionId)>, HostError> {
        let Some(mut balancer) = self.balancer.take() else { return Ok(Vec::new()) };
        let is_due = self.tick.0.is_multiple_of(balancer.settings.every_ticks.into());
        let renamed = if is_due { self.follow_load(&mut balancer) } else { Ok(Vec::new()) };
        self.balancer = Some(balancer);
        renamed
    }

    fn follow_load(&mut self, balancer: &mut Balancer) -> Result<Vec<(RegionId, RegionId)>, HostError> {
        let mut renamed = Vec::new();
        self.regions.iter_mut().for_each(Region::wake_left_behind);
        self.finish_merging(balancer, &mut renamed)?;
        let burdens = self.burdens(balancer.settings.load);
        let merging: Vec<_> = balancer.merging.keys().copied().collect();
        let changes = plan(self.partition.tree(), &burdens, &balancer.settings, &merging);
        self.change_tree(&changes, balancer, &mut renamed)?;
        Ok(renamed)
    }

    /// The load of a region, in the units of the balance.
    pub fn load_of(&self, region: &Region, load: Load) -> f64 {
        match load {
            Load::Counts => region.activity(),
            Load::Times => region.mean_step_us(),
        }
    }

    /// Every awake body with its share of its region's load.
    fn burdens(&self, load: Load) -> Vec<Burden> {
        let mut burdens = Vec::new();
        for region in &self.regions {
            let awake: Vec<_> = region.awake_places().collect();
            let weight = self.load_of(region, load) / awake.len() as f64;
            burdens.extend(awake.into_iter().map(|place| Burden { place, weight }));
        }
        burdens
    }

    fn change_tree(
        &mut self,
        changes: &[Change],
        balancer: &mut Balancer,
        renamed: &mut Vec<(RegionId, RegionId)>,
    ) -> Result<(), HostError> {
        if changes.is_empty() {
            return Ok(());
        }
        let mut tree = self.partition.tree().clone();
        for change in changes {
            match *change {
                Change::Move { vertex, at } => {
                    tree.move_plane(vertex, at).expect("a plan names planes of the tree")
                }
                Change::Merge { vertex, heir } => {
                    tree.yield_to(vertex, heir).expect("a plan names siblings");
                    balancer.merging.insert(vertex, heir);
                }
                Change::Split { leaf, axis, at } => match tree.split_at(leaf, axis, at) {
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

    /// Regions that have been emptied are given up.
    fn finish_merging(
        &mut self,
        balancer: &mut Balancer,
        renamed: &mut Vec<(RegionId, RegionId)>,
    ) -> Result<(), HostError> {
        for (vertex, heir) in balancer.merging.clone() {
            let (left, right) =
                self.partition.tree().children_of(vertex).expect("merged vertices are inner ones");
            let leaving = if heir == left { right } else { left };
            let place = self.regions.iter().position(|region| region.id() == leaving).expect("all are here");
            if self.regions[place].holds_movable() {
                continue;
            }
            balancer.merging.remove(&vertex);
            let mut tree = self.partition.tree().clone();
            tree.merge(vertex).expect("its children are regions");
            self.regions.remove(place);
            self.adopt(tree.clone(), &[(heir, vertex)], None)?;
            renamed.push((heir, vertex));
            self.refit(tree)?;
        }
        Ok(())
    }

    /// Takes over a tree that has other leaves: `names` says which regions are called what from now on, `born` names a region
    /// that is new and the one that it was cut from.
    fn adopt(
        &mut self,
        tree: DistributionTree,
        names: &[(RegionId, RegionId)],
        born: Option<(RegionId, RegionId)>,
    ) -> Result<(), HostError> {
        let old = self.partition.leaves().clone();
        self.partition.set_tree(tree);
        let name_of = |id: RegionId| names.iter().find(|(from, _)| *from == id).map_or(id, |(_, to)| *to);
        let rank = |id| self.partition.rank_of(id);
        let ranks = Renumbering {
            to: old.iter().map(|&id| rank(name_of(id))).collect(),
            leaves: self.partition.leaves().clone(),
            born: born.and_then(|(new, from)| Some((rank(new)?, rank(from)?))),
        };
        self.regions.iter_mut().for_each(|region| region.renumber(&ranks));
        self.regions.sort_by_key(Region::rank);
        self.place_of = vec![None; self.partition.len()];
        if let Some((new, from)) = born {
            self.add_region(new);
            let place = |id| self.regions.iter().position(|region| region.id() == id).expect("both are here");
            let (new, from) = (place(new), place(from));
            let (pace, anchor) = (self.regions[from].border.pace.clone(), self.regions[from].anchor());
            let region = &mut self.regions[new];
            region.border.pace = pace.of_newborn();
            region.set_anchor(anchor);
            self.statics.recover(region, &self.shapes)?;
            self.lend_threads()?;
        }
        self.index();
        Ok(())
    }

    /// The tree has the same leaves, but its planes are elsewhere: gives every region its cell, with the ground there.
    pub(crate) fn refit(&mut self, tree: DistributionTree) -> Result<(), HostError> {
        self.partition.set_tree(tree);
        for region in &mut self.regions {
            let cell = *self.partition.cell(region.rank());
            if *region.cell() != cell {
                region.set_cell(cell);
                self.statics.recover(region, &self.shapes)?;
            }
        }
        Ok(())
    }
}
