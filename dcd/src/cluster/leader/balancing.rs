//! Plans how the regions of a group follow its load (thesis 3.2.3, 3.3.5). From members' reports the leader
//! decides which planes move, and which regions are cut, merged and handed to other members. All members make
//! these changes before the same tick.

use std::collections::{BTreeMap, BTreeSet};

use crate::protocol::{LoadReport, Repartition, View};
use crate::space::{
    Allocation, Balance, Bounds, Burden, DistributionTree, Load, Loads, NodeId, RegionId, Tick, TreeChange,
    Yielding, plan,
};

/// The part of a node's price that a new measurement replaces.
const NEWS: f64 = 0.5;
/// The most time per tick that a node's steps may take whatever they compute, microseconds: to wake threads,
/// and for what else the machine does. If it were counted as work, a node with little to do would seem slow,
/// get less, and seem slower.
const OVERHEAD_US: f64 = 500.0;
/// The largest ratio between the speed of a node and the mean speed that counts.
const LARGEST_RATIO: f64 = 100.0;

/// The balancer of a group: the members' reports, and the tree as it is after the last dispatch.
#[derive(Clone, Debug)]
pub(super) struct Balancing {
    settings: Balance,
    view: View,
    /// Says whether a member's messages may still be on their way to another when both have completed a tick.
    lags: bool,
    reports: BTreeMap<NodeId, (Tick, LoadReport)>,
    /// The time that a unit of work costs each node, microseconds.
    prices: BTreeMap<NodeId, f64>,
    /// The regions that were vacant in the last reports.
    vacant: BTreeSet<RegionId>,
}

impl Balancing {
    pub(super) fn new(settings: Balance, view: View, lags: bool) -> Self {
        Self {
            settings,
            view,
            lags,
            reports: BTreeMap::new(),
            prices: BTreeMap::new(),
            vacant: BTreeSet::new(),
        }
    }

    /// Returns the tree as it is after the last dispatch.
    pub(super) fn tree(&self) -> &DistributionTree {
        &self.view.tree
    }

    /// Returns who computes which regions after the last dispatch.
    pub(super) fn allocation(&self) -> &Allocation {
        &self.view.allocation
    }

    /// Takes in a member's load after a tick.
    pub(super) fn hear(&mut self, from: NodeId, tick: Tick, report: LoadReport) {
        let computes = |region| self.view.allocation.get(&region) == Some(&from);
        // A report that names other regions is of a former tree.
        if report.regions.iter().all(|region| computes(region.region)) {
            self.reports.insert(from, (tick, report));
        }
    }

    /// Returns the change to make before the next tick, if there is one. All members must have reported of
    /// the same tick since the last change.
    pub(super) fn plan(&mut self) -> Option<Repartition> {
        let members = self.view.members.iter().map(|member| member.node);
        let ticks: Option<BTreeSet<_>> = members.map(|node| Some(self.reports.get(&node)?.0)).collect();
        if ticks?.len() != 1 {
            return None;
        }
        let reports = std::mem::take(&mut self.reports);
        let reports: BTreeMap<_, _> = reports.into_iter().map(|(node, (_, report))| (node, report)).collect();
        self.learn_prices(&reports);
        let merges = self.merges(&reports);
        let mut after = self.view.clone();
        let mut change = Repartition { changes: merges, newborn: self.view.leader };
        after.repartition(&change).ok()?;
        let is_emptying = after.tree.yielding().next().is_some();
        let more = self.hand_over(&after, &reports).or_else(|| self.level(&after, &reports));
        if let Some(more) = more.filter(|more| after.repartition(more).is_ok()) {
            change.changes.extend(more.changes);
            change.newborn = more.newborn;
        }
        // A change without moves, cuts or merges has what sleeps in regions that are being emptied leave them.
        let is_due = is_emptying || !change.changes.is_empty();
        is_due.then(|| {
            self.view = after;
            change
        })
    }

    /// Learns what a unit of work costs each node. As far as a node's time may be overhead, its price is not
    /// known, and is taken to be as near to the least of all as it can be.
    fn learn_prices(&mut self, reports: &BTreeMap<NodeId, LoadReport>) {
        let told = reports.iter().filter_map(|(&node, report)| {
            let work: f64 = report.regions.iter().map(|region| region.activity).sum();
            let took_us: f64 = report.regions.iter().map(|region| region.step_us).sum();
            (work > 0.0 && took_us > 0.0)
                .then(|| (node, (took_us - OVERHEAD_US).max(0.0) / work, took_us / work))
        });
        let told: Vec<_> = told.collect();
        let known = self.prices.values().copied();
        let least = known.chain(told.iter().map(|(.., most)| *most)).fold(f64::INFINITY, f64::min);
        for (node, at_least, at_most) in told {
            let price = least.clamp(at_least, at_most);
            self.prices.entry(node).and_modify(|old| *old += NEWS * (price - *old)).or_insert(price);
        }
    }

    fn mean_price(&self) -> f64 {
        if self.settings.load == Load::Counts || self.prices.is_empty() {
            return 1.0;
        }
        self.prices.values().sum::<f64>() / self.prices.len() as f64
    }

    /// Returns the speed of a node: 1 for the mean, and for all if loads are counts.
    fn speed(&self, node: NodeId) -> f64 {
        match self.prices.get(&node) {
            Some(price) if self.settings.load == Load::Times => {
                (self.mean_price() / price).clamp(1.0 / LARGEST_RATIO, LARGEST_RATIO)
            }
            _ => 1.0,
        }
    }

    /// Returns the merges that can be completed: nothing is left in the region that is given up, nor on its
    /// way there.
    fn merges(&mut self, reports: &BTreeMap<NodeId, LoadReport>) -> Vec<TreeChange> {
        let regions = reports.values().flat_map(|report| &report.regions);
        let vacant: BTreeSet<_> =
            regions.filter(|region| region.vacant).map(|region| region.region).collect();
        let before = std::mem::replace(&mut self.vacant, vacant);
        let is_over = |regions: &Yielding| {
            let leaving = regions.leaving;
            self.vacant.contains(&leaving) && (!self.lags || before.contains(&leaving))
        };
        let yielding = self.view.tree.yielding().filter(|(_, regions)| is_over(regions));
        yielding.map(|(vertex, _)| TreeChange::Merge { vertex }).collect()
    }

    /// Gives a member without a region one of a member that has several. A new region of that member takes
    /// its place, and the old one is emptied into it.
    fn hand_over(&self, view: &View, reports: &BTreeMap<NodeId, LoadReport>) -> Option<Repartition> {
        let idle = idle(view).next()?;
        let load_of = |region: RegionId| {
            let told = reports.values().flat_map(|report| &report.regions);
            told.filter(|load| load.region == region).map(|load| load.activity).sum::<f64>()
        };
        let mut regions: BTreeMap<NodeId, Vec<RegionId>> = BTreeMap::new();
        let yielding: BTreeSet<_> = view.tree.yielding().flat_map(|(_, it)| [it.heir, it.leaving]).collect();
        for (&region, &node) in view.allocation.iter().filter(|(region, _)| !yielding.contains(region)) {
            regions.entry(node).or_default().push(region);
        }
        let busy = |(node, regions): &(&NodeId, &Vec<RegionId>)| {
            regions.iter().map(|&region| load_of(region)).sum::<f64>() / self.speed(**node)
        };
        let donors = regions.iter().filter(|(_, regions)| regions.len() > 1);
        let (_, regions) = donors.max_by(|a, b| busy(a).total_cmp(&busy(b)))?;
        let vertex = *regions.iter().min_by(|a, b| load_of(**a).total_cmp(&load_of(**b)))?;
        let part = view.tree.part(vertex);
        let axis = part.longest_axis();
        let at = part.centre()[axis.index()];
        let heir = vertex.children().1;
        let changes = vec![TreeChange::Split { leaf: vertex, axis, at }, TreeChange::Yield { vertex, heir }];
        Some(Repartition { changes, newborn: idle })
    }

    /// Moves planes, or cuts or merges a region. A new region goes to a member without one, if there is one.
    fn level(&self, view: &View, reports: &BTreeMap<NodeId, LoadReport>) -> Option<Repartition> {
        let (mut burdens, islands) = joined(reports);
        let price = self.mean_price();
        burdens.iter_mut().for_each(|burden| burden.weight *= price);
        let yielding: BTreeMap<_, _> = view.tree.yielding().collect();
        let leaving: BTreeSet<_> = yielding.values().map(|regions| regions.leaving).collect();
        let mut counts: BTreeMap<NodeId, f64> = BTreeMap::new();
        for (_, &node) in view.allocation.iter().filter(|(region, _)| !leaving.contains(region)) {
            *counts.entry(node).or_default() += 1.0;
        }
        let capacity = |region: RegionId| {
            let region = yielding.get(&region).map_or(region, |regions| regions.heir);
            let node = view.allocation[&region];
            self.speed(node) / counts[&node]
        };
        let loads = Loads { tree: &view.tree, burdens: &burdens, islands: &islands, capacity: &capacity };
        let changes = plan(&loads, &self.settings.among(view.members.len()));
        let newborn = match changes.first()? {
            TreeChange::Split { leaf, .. } => idle(view).next().unwrap_or(view.allocation[leaf]),
            _ => view.leader,
        };
        Some(Repartition { changes, newborn })
    }
}

/// Returns the members without a region, the highest id first: a leader with the lowest id, which has most
/// other work, comes last.
fn idle(view: &View) -> impl Iterator<Item = NodeId> {
    let nodes = view.members.iter().rev().map(|member| member.node);
    nodes.filter(|node| !view.allocation.values().any(|owner| owner == node))
}

/// Returns all members' burdens and islands. Islands of several members whose boxes touch are one.
fn joined(reports: &BTreeMap<NodeId, LoadReport>) -> (Vec<Burden>, Vec<Bounds>) {
    let (mut burdens, mut islands) = (Vec::new(), Vec::<Bounds>::new());
    for report in reports.values() {
        let known = islands.len();
        let mut names = Vec::new();
        for island in &report.islands {
            let same = islands[..known].iter().position(|other| other.touches(island));
            let name = same.unwrap_or_else(|| {
                islands.push(*island);
                islands.len() - 1
            });
            islands[name] = islands[name].union(island);
            names.push(name);
        }
        burdens.extend(report.burdens.iter().map(|burden| {
            let island = burden.island.map(|island| names[island]);
            Burden { island, ..*burden }
        }));
    }
    (burdens, islands)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Member, RegionLoad, ViewNumber};
    use crate::space::{Allocation, GroupId};

    /// Returns a view of a road of 1,000 m in this many regions, allocated to the nodes in turn.
    fn road(regions: usize, nodes: &[u32], members: u32) -> View {
        let bounds = Bounds::new([0.0, -4.0, -4.0], [1000.0, 4.0, 4.0]);
        let tree = DistributionTree::halved(bounds, regions).unwrap();
        let allocation: Allocation =
            tree.leaves().zip(nodes.iter().cycle()).map(|(leaf, &node)| (leaf, NodeId(node))).collect();
        let member = |node| Member {
            node: NodeId(node),
            address: std::net::SocketAddr::from(([127, 0, 0, 1], 1)),
            client: None,
        };
        View {
            events: false,
            viewpoints: Vec::new(),
            group: GroupId(1),
            number: ViewNumber(1),
            tick: Tick(0),
            leader: NodeId(1),
            members: (1..=members).map(member).collect(),
            tree,
            allocation,
        }
    }

    /// Lets bodies change region at once, and members report the time that their work takes, until nothing
    /// changes for a while. Returns each member's share.
    fn settle(
        balancing: &mut Balancing,
        crowd: &[f64],
        cost_us: impl Fn(NodeId, f64) -> f64,
    ) -> BTreeMap<NodeId, usize> {
        let mut quiet = 0;
        for round in 0..100 {
            let view = balancing.view.clone();
            let mut shares = BTreeMap::new();
            for member in &view.members {
                let node = member.node;
                let own = view.allocation.iter().filter(|(_, owner)| **owner == node);
                let mut report = LoadReport::default();
                for (&region, _) in own {
                    let there =
                        crowd.iter().map(|&x| [x, 0.0, 0.0]).filter(|&at| view.tree.leaf_at(at) == region);
                    let there: Vec<_> = there.collect();
                    let activity = there.len() as f64;
                    *shares.entry(node).or_default() += there.len();
                    let (step_us, vacant) = (cost_us(node, activity), there.is_empty());
                    report.regions.push(RegionLoad { region, activity, step_us, vacant });
                    report.burdens.extend(there.into_iter().map(|place| Burden {
                        place,
                        weight: 1.0,
                        island: None,
                    }));
                }
                balancing.hear(node, Tick(round), report);
            }
            quiet = if balancing.plan().is_none() { quiet + 1 } else { 0 };
            if quiet == 10 {
                return shares;
            }
            assert!(balancing.view.tree.is_sound());
            assert!(balancing.view.allocation.keys().copied().eq(balancing.view.tree.leaves()));
        }
        panic!("it flaps");
    }

    fn crowd(from: f64, to: f64, count: usize) -> Vec<f64> {
        (0..count).map(|i| from + (to - from) * (i as f64 + 0.5) / count as f64).collect()
    }

    #[test]
    fn idle_members_get_regions_and_all_have_equal_shares() {
        for (regions, nodes, members) in
            [(1, vec![1], 8), (3, vec![1, 2], 5), (8, vec![1], 8), (8, vec![2], 3)]
        {
            let mut balancing = Balancing::new(Balance::by_nodes(), road(regions, &nodes, members), false);
            let shares = settle(&mut balancing, &crowd(300.0, 700.0, 960), |_, work| 5.0 * work);
            assert_eq!(shares.len(), members as usize, "{regions} regions: {shares:?}");
            assert_eq!(balancing.view.tree.leaf_count(), members as usize);
            let (least, most) = (shares.values().min().unwrap(), shares.values().max().unwrap());
            assert!(*most as f64 <= 1.2 * 960.0 / f64::from(members), "{regions} regions: {least} to {most}");
        }
    }

    #[test]
    fn a_node_that_is_ten_times_slower_gets_a_tenth() {
        let mut balancing = Balancing::new(Balance::by_nodes(), road(4, &[1, 2, 3, 4], 4), false);
        let cost = |node, work| if node == NodeId(3) { 50.0 * work } else { 5.0 * work };
        let shares = settle(&mut balancing, &crowd(0.0, 1000.0, 3100), cost);
        assert!((85..=120).contains(&shares[&NodeId(3)]), "{shares:?}");
        assert!([1, 2, 4].iter().all(|&node| shares[&NodeId(node)] < 1200), "{shares:?}");
        // By counts all nodes are alike.
        let counts = Balance { load: Load::Counts, ..Balance::by_nodes() };
        let mut balancing = Balancing::new(counts, road(4, &[1, 2, 3, 4], 4), false);
        let shares = settle(&mut balancing, &crowd(0.0, 500.0, 3100), cost);
        assert!(shares.values().all(|share| (700..=930).contains(share)), "{shares:?}");
    }

    #[test]
    fn what_a_step_costs_whatever_it_computes_takes_no_load_from_a_node() {
        // The first node serves clients besides, and is slower by the same time whatever it computes.
        let cost = |node, work| if node == NodeId(1) { 250.0 + work } else { 50.0 + work };
        let mut balancing = Balancing::new(Balance::by_nodes(), road(3, &[1, 2, 3], 3), false);
        let shares = settle(&mut balancing, &crowd(0.0, 1000.0, 600), cost);
        assert!(shares.values().all(|share| *share <= 240), "{shares:?}");
    }

    #[test]
    fn a_node_that_was_slow_gets_its_share_of_a_light_load_again() {
        let mut balancing = Balancing::new(Balance::by_nodes(), road(3, &[1, 2, 3], 3), false);
        let slow = |node, work| if node == NodeId(3) { 50.0 * work } else { 200.0 + work };
        let shares = settle(&mut balancing, &crowd(0.0, 1000.0, 600), slow);
        assert!(shares[&NodeId(3)] < 50, "{shares:?}");
        let shares = settle(&mut balancing, &crowd(0.0, 1000.0, 600), |_, work| 200.0 + work);
        assert!(shares.values().all(|share| *share <= 240), "{shares:?}");
    }

    #[test]
    fn regions_that_nobody_needs_are_merged_once_they_are_empty() {
        let mut balancing = Balancing::new(Balance::by_nodes(), road(8, &[1, 1, 1, 1, 1, 1, 1, 1], 1), true);
        let shares = settle(&mut balancing, &crowd(0.0, 1000.0, 100), |_, work| 5.0 * work);
        assert_eq!((balancing.view.tree.leaf_count(), shares[&NodeId(1)]), (1, 100));
    }

    #[test]
    fn nothing_is_planned_before_all_have_reported_of_the_same_tick() {
        let mut balancing = Balancing::new(Balance::by_nodes(), road(2, &[1, 2], 2), false);
        let report = |region: u32| LoadReport {
            regions: vec![RegionLoad {
                region: RegionId(region),
                activity: f64::from(region),
                step_us: 1.0,
                vacant: false,
            }],
            burdens: vec![Burden { place: [100.0, 0.0, 0.0], weight: f64::from(region), island: None }],
            islands: Vec::new(),
        };
        balancing.hear(NodeId(1), Tick(1), report(1));
        assert_eq!(balancing.plan(), None);
        balancing.hear(NodeId(2), Tick(2), report(2));
        assert_eq!(balancing.plan(), None, "of another tick");
        balancing.hear(NodeId(1), Tick(2), report(2));
        assert_eq!(balancing.plan(), None, "not its own region");
    }

    #[test]
    fn parts_of_an_island_at_two_members_are_one() {
        let island = |from: f64, to: f64| LoadReport {
            islands: vec![Bounds::new([from, 0.0, 0.0], [to, 1.0, 1.0])],
            burdens: vec![Burden { place: [from, 0.0, 0.0], weight: 1.0, island: Some(0) }],
            ..LoadReport::default()
        };
        let reports = [(1, 0.0, 10.0), (2, 9.0, 20.0), (3, 30.0, 40.0)]
            .map(|(node, from, to)| (NodeId(node), island(from, to)));
        let (burdens, islands) = joined(&reports.into());
        assert_eq!(islands.len(), 2);
        assert_eq!((islands[0].min[0], islands[0].max[0]), (0.0, 20.0));
        assert_eq!(
            burdens.iter().map(|burden| burden.island).collect::<Vec<_>>(),
            [Some(0), Some(0), Some(1)]
        );
    }
}
