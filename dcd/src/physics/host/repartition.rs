//! Balances the load while the world runs: moves planes of the distribution tree, splits and merges regions.
//! Bodies then change owners as if they had crossed a border by themselves. A region is given up only when
//! nothing is left in it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{HostError, RegionHost};
use crate::fidelity::relative_time;
use crate::physics::coupling::Side;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::Region;
use crate::physics::settings::StepSettings;
use crate::space::{
    Balance, Bounds, Burden, DistributionTree, Load, Loads, RegionId, Renaming, TreeChange, plan,
};

/// The load balancer of a world in one process.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Balancer {
    settings: Balance,
    /// The most bodies of an island that stays whole, as the user set it.
    island_limit: usize,
    /// Says whether the tree stays as it is, while all else is done.
    #[serde(skip)]
    holds_cut: bool,
}

/// The most bodies of an island that stays whole while the tree follows the load, however much there is to
/// do.
const BALANCED_ISLAND: usize = 256;
/// Load balancing leaves islands of at most this many bodies whole. They are little work, and right: where a hanging
/// bridge of 90 bodies was split above 16, it never came to rest, and a wave of dominoes ran a fifth slower.
const LEAST_ISLAND: usize = 128;
/// An island of more than [`LEAST_ISLAND`] bodies that stays whole has at most one in this many of a mean region's awake
/// bodies: a larger one could not be balanced.
const ISLAND_SHARE: usize = 4;

impl RegionHost {
    /// Turns load balancing on with these settings, or off with `None`. The host must compute every region.
    /// With load balancing, islands are split that have more than 256 bodies, or more than both 128 and a
    /// quarter of a mean region's awake bodies. Whole in one region, they would be its load.
    pub fn set_balance(&mut self, settings: Option<Balance>) {
        assert_eq!(self.sides.len(), self.partition.len(), "balance needs all regions in one process");
        let island_limit = self.balancer.as_ref().map_or(self.settings.island_limit, |old| old.island_limit);
        self.settings.island_limit = island_limit;
        self.balancer = settings.map(|settings| Balancer { settings, island_limit, holds_cut: false });
        if self.balancer.is_some() {
            self.limit_islands(island_limit);
        }
    }

    /// Leaves the tree as it is from now on, for a replay: the recording has how the tree followed the load.
    /// Islands are limited, and bodies woken, as before.
    pub(crate) fn hold_cut(&mut self) {
        self.balancer.iter_mut().for_each(|balancer| balancer.holds_cut = true);
    }

    /// Returns the settings as the user asked for them. They are those by which the world is stepped, except
    /// for the island limit, which load balancing sets.
    pub(crate) fn asked_settings(&self) -> StepSettings {
        let island_limit = self.balancer.as_ref().map_or(self.settings.island_limit, |own| own.island_limit);
        StepSettings { island_limit, ..self.settings }
    }

    /// Limits the islands that stay whole to those that leave their region in balance.
    fn limit_islands(&mut self, island_limit: usize) {
        let awake: usize = self.regions().map(Region::awake_count).sum();
        let share = awake / self.sides.len() / ISLAND_SHARE;
        self.settings.island_limit = island_limit.min(share.clamp(LEAST_ISLAND, BALANCED_ISLAND));
    }

    /// Returns the settings of load balancing, if it is on.
    pub fn balance(&self) -> Option<&Balance> {
        self.balancer.as_ref().map(|balancer| &balancer.settings)
    }

    /// Rebalances the tree between two ticks, when it is due: moves planes, splits or merges regions. Returns
    /// the regions that have new ids, as (old, new).
    pub fn rebalance(&mut self) -> Result<Vec<(RegionId, RegionId)>, HostError> {
        let Some(&Balancer { settings, island_limit, holds_cut }) = self.balancer.as_ref() else {
            return Ok(Vec::new());
        };
        if !self.tick.0.is_multiple_of(settings.every_ticks.into()) {
            return Ok(Vec::new());
        }
        self.limit_islands(island_limit);
        self.move_left_behind();
        if holds_cut {
            return Ok(Vec::new());
        }
        let mut renamed = self.repartition(&self.mergeable(), true)?;
        let (burdens, islands) = self.burdens(settings.load);
        let (tree, capacity) = (self.partition.tree(), &|_| 1.0);
        let changes = plan(&Loads { tree, burdens: &burdens, islands: &islands, capacity }, &settings);
        // The world's bounds or the depth of its tree may leave no room.
        match self.repartition(&changes, true) {
            Ok(more) => renamed.extend(more),
            Err(HostError::Tree(error)) => tracing::debug!(%error, "the regions stay as they are"),
            Err(error) => return Err(error),
        }
        Ok(renamed)
    }

    /// Has what sleeps far outside its region's cell, and all that a region that is being emptied holds, move
    /// to where it belongs in the ticks to come.
    pub fn move_left_behind(&mut self) {
        let (emptied, coupling) = (self.partition.emptied(), self.settings.coupling);
        self.sides.iter_mut().for_each(|side| coupling.move_left_behind(side, emptied));
    }

    /// Returns the merges that can be completed, as far as is known here: those that give up an empty region.
    fn mergeable(&self) -> Vec<TreeChange> {
        let yielding = self.partition.tree().yielding();
        let empty = yielding.filter(|(_, regions)| self.is_vacant(regions.leaving));
        empty.map(|(vertex, _)| TreeChange::Merge { vertex }).collect()
    }

    /// Returns whether a region computed here holds nothing that can move, and has reported all contacts that
    /// ended.
    pub fn is_vacant(&self, region: RegionId) -> bool {
        let here = self.partition.rank_of(region).and_then(|rank| self.region_at(rank));
        here.is_some_and(|region| !region.holds_movable() && !region.owes_word())
    }

    /// Returns the load of a region computed here, in the units of the balance. The time of a step at a lower
    /// rate is divided among its ticks.
    pub fn load_of(&self, region: &Region, load: Load) -> f64 {
        match load {
            Load::Counts => region.activity(),
            Load::Times => {
                let rate = self.place_of[region.rank()].map_or(1, |place| self.sides[place].clock.rate);
                region.time().full_us() * relative_time(self.settings.solver_iterations, rate)
                    / f64::from(rate)
            }
        }
    }

    /// Returns every awake body computed here with its part of its region's load, the sleeping bodies of
    /// islands that are too large to move whole, and boxes around those islands. Couplings that move no
    /// islands have none of these: they pay the cost of a cut at every border.
    pub fn burdens(&mut self, load: Load) -> (Vec<Burden>, Vec<Bounds>) {
        let giants = match self.settings.coupling.moves_islands() {
            true => self.giants.find(&self.sides, self.settings.island_limit.max(BALANCED_ISLAND)),
            false => Arc::default(),
        };
        let mut burdens = Vec::new();
        for Side { region, .. } in &self.sides {
            let awake: Vec<_> = region.awake_places().collect();
            let weight = self.load_of(region, load) / awake.len() as f64;
            burdens.extend(awake.into_iter().map(|(id, place)| Burden {
                place,
                weight,
                island: giants.of(id),
            }));
        }
        burdens.extend_from_slice(&giants.asleep);
        (burdens, giants.boxes.clone())
    }

    /// Changes the tree between two ticks: makes all of these changes or none. Every process that computes a
    /// part of the world must make the same changes. With `newborn_here`, new regions are computed here. A
    /// region that is given up must hold nothing ([`RegionHost::is_vacant`]). Returns the regions that have
    /// new ids, as (old, new).
    pub fn repartition(
        &mut self,
        changes: &[TreeChange],
        newborn_here: bool,
    ) -> Result<Vec<(RegionId, RegionId)>, HostError> {
        if changes.is_empty() {
            return Ok(Vec::new());
        }
        let mut goal = self.partition.tree().clone();
        goal.change(changes)?;
        let mut renamed = Vec::new();
        let mut tree = self.partition.tree().clone();
        for change in changes {
            let renaming = tree.renaming(change);
            tree.change_unchecked(change)?;
            let Some(Renaming { from, to, born, gone }) = renaming else { continue };
            if let Some(place) = gone.and_then(|gone| self.regions().position(|region| region.id() == gone)) {
                assert!(
                    !self.sides[place].region.holds_movable(),
                    "{gone:?} is given up while it holds bodies"
                );
                self.sides.remove(place);
            }
            self.adopt(tree.clone(), (from, to), born.filter(|_| newborn_here))?;
            renamed.push((from, to));
        }
        self.refit(tree)?;
        Ok(renamed)
    }

    /// Returns whether these changes would give up a region here that holds anything movable.
    pub(crate) fn gives_up_bodies(&self, changes: &[TreeChange]) -> bool {
        let mut tree = self.partition.tree().clone();
        // By the ids that regions have at that point.
        let mut full: Vec<_> =
            self.regions().filter(|region| region.holds_movable()).map(Region::id).collect();
        for change in changes {
            let renaming = tree.renaming(change);
            if tree.change_unchecked(change).is_err() {
                return false;
            }
            let Some(Renaming { from, to, gone, .. }) = renaming else { continue };
            if gone.is_some_and(|gone| full.contains(&gone)) {
                return true;
            }
            full.iter_mut().filter(|id| **id == from).for_each(|id| *id = to);
        }
        false
    }

    /// Adopts a tree that has other leaves: one region has another id, as (old, new), and one may be new
    /// here.
    fn adopt(
        &mut self,
        tree: DistributionTree,
        (from, to): (RegionId, RegionId),
        newborn: Option<RegionId>,
    ) -> Result<(), HostError> {
        let old = self.partition.leaves().clone();
        Arc::make_mut(&mut self.partition).set_tree(tree);
        let name_of = |id: RegionId| if id == from { to } else { id };
        let ranks = RankRemap {
            to: old.iter().map(|&id| self.partition.rank_of(name_of(id))).collect(),
            leaves: self.partition.leaves().clone(),
        };
        self.sides.iter_mut().for_each(|side| side.remap_ranks(&ranks));
        self.late.clear();
        self.sides.sort_by_key(|side| side.region.rank());
        self.place_of = vec![None; self.partition.len()];
        // A region that is new elsewhere does not know others' substeps, so all begin again alike.
        let steps = self.settings.coupling.first_steps(self.settings.exchanges);
        self.sides.iter_mut().for_each(|side| side.border.pace.restart(steps));
        if let Some(id) = newborn {
            self.add_region(id);
            let side = self.sides.iter_mut().find(|side| side.region.id() == id).expect("just added");
            self.statics.recover(&mut side.region, &self.shapes)?;
        }
        self.threads.suit(self.sides.len())?;
        self.index();
        Ok(())
    }

    /// Adopts a tree with the same leaves whose planes have moved: gives every region its cell, with the
    /// immovable bodies there.
    pub(crate) fn refit(&mut self, tree: DistributionTree) -> Result<(), HostError> {
        Arc::make_mut(&mut self.partition).set_tree(tree);
        self.settled = false;
        self.meet_all();
        for Side { region, border, .. } in &mut self.sides {
            let cell = *self.partition.cell(region.rank());
            // What reaches out of its cell may reach into another one's than before.
            region.stir();
            if *region.cell() != cell {
                region.set_cell(cell);
                // Sleeping and disabled bodies are checked anew, too.
                border.overlook(region.own_resting());
                self.statics.recover(region, &self.shapes)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::host::processes::Processes;
    use crate::physics::{Coupling, LinkSettings};
    use crate::protocol::{Velocity, WorldPose};
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::scene::{Params, Scene, SceneJoint};
    use crate::space::{Axis, BodyId};

    /// 600 boxes in courses of ten by ten, each on four others, so that all touch: 10.5 m wide, around the
    /// origin. Beside it stand twenty small stacks, four of them on the left.
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

    #[test]
    fn regions_that_are_cut_handed_over_and_merged_among_processes_compute_what_one_process_does() {
        let terrain = Scene::named("terrain", &Params::new().with("n", 150)).unwrap();
        let heap = Scene::named("heap", &Params::new().with("n", 120)).unwrap();
        for scene in [terrain, heap] {
            let mut runs =
                [1, 2, 3].map(|count| Processes::of(&scene, WorldConfig::for_scene(&scene).step, 3, count));
            let count = runs[0].states().len();
            let (mut handed_over, mut merged) = (None, 0);
            for tick in 0..300 {
                let tree = runs[0].0[0].partition().tree().clone();
                let (axis, at) = tree.cut_of(RegionId(0)).unwrap();
                let i = axis.index();
                let mut changes = Vec::new();
                match tick {
                    20 | 200 => {
                        let at = at + 0.1 * (tree.bounds().max[i] - at);
                        changes.push(TreeChange::Move { vertex: RegionId(0), at });
                    }
                    40 | 80 => {
                        let busiest = |id: &RegionId| runs[0].states().iter().filter(|s| s.1 == *id).count();
                        let leaf = tree.leaves().max_by_key(busiest).unwrap();
                        let part = tree.part(leaf);
                        let axis = part.longest_axis();
                        let at = part.centre()[axis.index()];
                        changes.push(TreeChange::Split { leaf, axis, at });
                        // The second region is handed over as a whole.
                        if tick == 80 {
                            changes.push(TreeChange::Yield { vertex: leaf, heir: leaf.children().1 });
                            handed_over = Some(leaf);
                        }
                    }
                    _ if tick % 10 == 0 => {
                        let is_vacant = |region| runs[0].0.iter().any(|host| host.is_vacant(region));
                        let empty = tree.yielding().filter(|(_, regions)| is_vacant(regions.leaving));
                        changes.extend(empty.map(|(vertex, _)| TreeChange::Merge { vertex }));
                        merged += changes.len();
                        if changes.is_empty() && tree.yielding().next().is_some() {
                            runs.iter_mut().for_each(|run| run.repartition(&[], 0));
                        }
                    }
                    _ => {}
                }
                for run in &mut runs {
                    if !changes.is_empty() {
                        run.repartition(&changes, 1);
                    }
                    run.step();
                }
                let states = runs[0].states();
                assert_eq!(states.len(), count, "{}, tick {tick}", scene.name);
                for run in &runs[1..] {
                    assert!(run.states() == states, "{}, tick {tick}: {} processes", scene.name, run.0.len());
                }
            }
            assert_eq!(merged, 1, "{}: {handed_over:?} was not emptied", scene.name);
            assert!(runs[0].0[0].partition().tree().is_leaf(handed_over.unwrap()));
        }
    }

    /// A settled stack in each region and one over the border, and in the air two boxes, a chain and a ragdoll that
    /// their user put to sleep.
    fn sleepers() -> Scene {
        let mut scene = Scene::empty("sleepers");
        scene.push_fixed_box([0.0, -0.5, 0.0], [80.0, 0.5, 20.0], &ColliderBuilder::ball(1.0).friction(0.7));
        let brick = ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(0.7);
        for x in [-30.0, -3.0, 0.1, 4.0, 30.0] {
            for level in 0..3 {
                let at = WorldPose::at([x, f64::from(level) + 0.5, 0.0]);
                scene.push(at, RigidBodyBuilder::dynamic(), brick.clone());
            }
        }
        for x in [-20.0, 1.0, 25.0] {
            let first = scene.bodies.len();
            for link in 0..4 {
                let at = WorldPose::at([x + 1.1 * f64::from(link), 5.0, 0.0]);
                scene.push(at, RigidBodyBuilder::dynamic().sleeping(true), brick.clone());
            }
            for a in first..first + 3 {
                let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::X * 0.55);
                let joint = hinge.local_anchor2(Vector::X * -0.55).into();
                let multibody = (x > 20.0).then(LinkSettings::default);
                scene.joints.push(SceneJoint { a, b: a + 1, joint, multibody });
            }
        }
        scene.bounds = Bounds::new([-60.0, -1.0, -10.0], [60.0, 8.0, 10.0]);
        scene
    }

    #[test]
    fn what_sleeps_in_a_region_that_is_emptied_goes_to_its_heir_asleep() {
        let scene = sleepers();
        let cases =
            [(Coupling::Auto, 1, 2), (Coupling::Auto, 2, 1), (Coupling::Auto, 2, 2), (Coupling::Owner, 2, 1)];
        for (coupling, processes, heir) in cases {
            let settings = WorldConfig::for_scene(&scene).step.with_coupling(coupling);
            let mut run = Processes::of(&scene, settings, 2, processes);
            let asleep = |run: &Processes| run.0.iter().all(|host| host.awake_bodies().is_empty());
            let mut tick = 0;
            while !asleep(&run) {
                run.step();
                tick += 1;
                assert!(tick < 400, "it comes to rest");
            }
            let at_first = run.states();
            run.repartition(&[TreeChange::Yield { vertex: RegionId(0), heir: RegionId(heir) }], 0);
            let leaving = RegionId(3 - heir);
            let mut ticks = 0;
            while !run.0.iter().any(|host| host.is_vacant(leaving)) {
                run.step();
                assert!(
                    asleep(&run),
                    "{coupling:?}, heir {heir}, {processes} processes, tick {ticks}: some woke"
                );
                if ticks % 10 == 0 {
                    run.repartition(&[], 0);
                }
                ticks += 1;
                assert!(
                    ticks < 60,
                    "{coupling:?}, heir {heir}, {processes} processes: {leaving:?} is not emptied"
                );
            }
            run.repartition(&[TreeChange::Merge { vertex: RegionId(0) }], 0);
            (0..30).for_each(|_| run.step());
            let states = run.states();
            assert!(asleep(&run) && states.iter().all(|(_, region, ..)| *region == RegionId(0)));
            let places = |states: &[(BodyId, RegionId, WorldPose, Velocity)]| {
                states.iter().map(|(id, _, pose, velocity)| (*id, *pose, *velocity)).collect::<Vec<_>>()
            };
            assert_eq!(places(&states), places(&at_first), "none has moved");
            // The uppermost box of a stack, and a link of a chain, are woken.
            for id in [at_first[5].0, at_first[15].0] {
                run.0.iter_mut().for_each(|host| _ = host.steer(id, &Velocity::linear([0.0, 0.0, 3.0])));
            }
            (0..60).for_each(|_| run.step());
            let lies_m = |at: usize| run.states()[at].2.translation[1];
            assert!((lies_m(3) - 0.5).abs() < 0.02 && lies_m(15) < 4.0, "{} and {} m", lies_m(3), lies_m(15));
        }
    }

    /// A multibody sleeps beside one that never does, closer than multibodies may be in different regions.
    #[test]
    fn what_never_sleeps_keeps_nothing_asleep_in_a_region_that_is_emptied() {
        let mut scene = Scene::empty("two arms");
        scene.push_fixed_box([0.0, -0.5, 0.0], [80.0, 0.5, 20.0], &ColliderBuilder::ball(1.0).friction(0.7));
        for (z, can_sleep) in [(0.0, true), (1.05, false)] {
            let first = scene.bodies.len();
            for x in [30.0, 31.1] {
                let body = RigidBodyBuilder::dynamic().can_sleep(can_sleep);
                scene.push(WorldPose::at([x, 0.5, z]), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
            }
            let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::X * 0.55);
            let joint = hinge.local_anchor2(Vector::X * -0.55).into();
            let multibody = Some(LinkSettings::default());
            scene.joints.push(SceneJoint { a: first, b: first + 1, joint, multibody });
        }
        scene.bounds = Bounds::new([-60.0, -1.0, -10.0], [60.0, 8.0, 10.0]);
        let mut run = Processes::of(&scene, WorldConfig::for_scene(&scene).step, 2, 2);
        (0..200).for_each(|_| run.step());
        assert_eq!(run.0.iter().map(|host| host.awake_bodies().len()).sum::<usize>(), 2);
        run.repartition(&[TreeChange::Yield { vertex: RegionId(0), heir: RegionId(1) }], 0);
        for _ in 0..6 {
            (0..10).for_each(|_| run.step());
            run.repartition(&[], 0);
        }
        assert!(run.0.iter().any(|host| host.is_vacant(RegionId(2))));
    }
}
