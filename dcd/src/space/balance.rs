//! Plans load balancing of the distribution tree (thesis 3.2, 4.3.2.2). Planes move so that regions have
//! equal load; regions are split and merged as the load grows and shrinks.
//!
//! Equal counts give equal trees. Hysteresis keeps a tree that is good enough.

mod settings;

use std::collections::BTreeSet;

use bincode::{Decode, Encode};

pub use self::settings::{Balance, Load};
use super::{Axis, Bounds, DistributionTree, RegionId, TreeChange, TreeError};

/// A part of the load, and where it is in world space.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Burden {
    /// The place, metres.
    pub place: [f64; 3],
    /// The weight, in the units of the load.
    pub weight: f64,
    /// The island that it is part of, as an index into the islands given to [`plan`].
    pub island: Option<usize>,
}

/// The factor by which the work of a region grows for its part of an island that other regions compute too:
/// up to four substeps, which `auto` takes where copies disagree, of up to twice as many bodies. So a cut
/// pays only into more parts than this. (`benches/results`: a giant island gains nothing from being cut on
/// one machine.)
const CUT_COST: f64 = 8.0;

/// The input of a plan: the tree, the load and where it is, and how much each region can do.
pub struct Loads<'a> {
    /// The present tree. A vertex that has one of its two regions being emptied counts as one region.
    pub tree: &'a DistributionTree,
    /// All parts of the load, each with its place.
    pub burdens: &'a [Burden],
    /// Boxes around the islands that are too large to move whole. Planes keep out of those that are not worth
    /// a cut.
    pub islands: &'a [Bounds],
    /// Returns how much a region can do compared with others: the capacity of its node divided by the number
    /// of the node's regions. It is called for a vertex that counts as one region as for a region.
    pub capacity: &'a dyn Fn(RegionId) -> f64,
}

/// Plans the changes after which each region of a tree has load in proportion to its capacity. Returns no
/// changes if the loads are near enough to that.
pub fn plan(loads: &Loads<'_>, settings: &Balance) -> Vec<TreeChange> {
    let Loads { tree, burdens, islands, capacity } = *loads;
    let merging: Vec<_> = tree.yielding().map(|(vertex, _)| vertex).collect();
    let all: Vec<_> = burdens.iter().collect();
    let total: f64 = burdens.iter().map(|burden| burden.weight).sum();
    let leaves = weighed(tree, &merging, all.clone(), capacity);
    let (count, heaviest) = (leaves.len(), leaves.iter().map(|leaf| leaf.load).fold(0.0, f64::max));
    // An island must weigh more than this to be worth a cut.
    let whole_up_to = |share: f64| Whole::of(burdens, islands, CUT_COST * share);
    if count < settings.most_regions
        && (count < settings.least_regions || heaviest > settings.split_above)
        && let Some(split) = split_of(
            tree,
            &leaves,
            &whole_up_to(settings.split_above),
            settings,
            count < settings.least_regions,
        )
    {
        return vec![split];
    }
    let whole = whole_up_to(total / count as f64);
    let mut planner =
        Planner { tree, settings, merging: &merging, whole: &whole, capacity, moves: Vec::new() };
    if count > settings.least_regions
        && let Some(merge) = planner.lightest_pair(&leaves)
    {
        return vec![merge];
    }
    let mean = total / leaves.iter().map(|leaf| leaf.capacity).sum::<f64>();
    let now = busiest(&leaves, islands.len());
    if count == 1 || now <= settings.tolerance * mean {
        return Vec::new();
    }
    planner.level(RegionId(0), tree.bounds(), all.clone());
    // If much of the load lies in one place or in one island, planes can improve little, and are not moved
    // for that.
    let moved = after(tree, &planner.moves).map(|tree| weighed(&tree, &merging, all, capacity));
    let worth = 1.0 + 0.5 * (settings.tolerance - 1.0);
    let pays = moved.is_some_and(|leaves| worth * busiest(&leaves, islands.len()) < now);
    if pays { planner.moves } else { Vec::new() }
}

/// Returns the tree after all changes that follow from such plans, for a world that is not computed yet, so
/// that no region has to be emptied first.
pub fn balanced(mut tree: DistributionTree, burdens: &[Burden], settings: &Balance) -> DistributionTree {
    // Each plan cuts or merges one region, or levels all planes. Some arrangements of bodies cannot be
    // levelled.
    for _ in 0..2 * super::MAX_REGIONS {
        let changes = plan(&Loads { tree: &tree, burdens, islands: &[], capacity: &|_| 1.0 }, settings);
        if changes.is_empty() || change_at_once(&mut tree, &changes).is_err() {
            break;
        }
    }
    tree
}

/// Applies a plan to a tree that is not computed: regions that yield are merged at once.
fn change_at_once(tree: &mut DistributionTree, changes: &[TreeChange]) -> Result<(), TreeError> {
    tree.change(changes)?;
    let yielding: Vec<_> = tree.yielding().map(|(vertex, _)| TreeChange::Merge { vertex }).collect();
    tree.change(&yielding)
}

/// Sums burdens that are near one another up to about `most`, none of them over two islands. So a node tells
/// its leader no more of its load than a plan needs.
pub fn summarised(mut burdens: Vec<Burden>, most: usize) -> Vec<Burden> {
    burdens.sort_by_key(|burden| burden.island);
    let total = burdens.len();
    let mut summary = Vec::new();
    for island in burdens.chunk_by_mut(|a, b| a.island == b.island) {
        let share = (most * island.len()).div_ceil(total);
        sum_up(island, share, &mut summary);
    }
    summary
}

fn sum_up(burdens: &mut [Burden], most: usize, summary: &mut Vec<Burden>) {
    let boxes = burdens.iter().map(|burden| Bounds::new(burden.place, burden.place));
    let Some(around) = boxes.reduce(|a, b| a.union(&b)) else { return };
    if most > 1 && burdens.len() > 1 {
        let i = around.longest_axis().index();
        let middle = burdens.len() / 2;
        burdens.select_nth_unstable_by(middle, |a, b| a.place[i].total_cmp(&b.place[i]));
        let (below, above) = burdens.split_at_mut(middle);
        sum_up(below, most / 2, summary);
        sum_up(above, most - most / 2, summary);
    } else {
        let count = burdens.len() as f64;
        let mean = |i: usize| burdens.iter().map(|burden| burden.place[i]).sum::<f64>() / count;
        let weight = burdens.iter().map(|burden| burden.weight).sum();
        summary.push(Burden { place: [0, 1, 2].map(mean), weight, island: burdens[0].island });
    }
}

/// Returns the same tree with planes moved; `None` if it has no room for one of them.
fn after(tree: &DistributionTree, moves: &[TreeChange]) -> Option<DistributionTree> {
    let mut tree = tree.clone();
    for change in moves {
        let TreeChange::Move { vertex, at } = *change else { return None };
        tree.move_plane(vertex, at).ok()?;
    }
    Some(tree)
}

/// Returns whether a vertex counts as a region.
fn is_leaf(tree: &DistributionTree, merging: &[RegionId], vertex: RegionId) -> bool {
    tree.is_leaf(vertex) || merging.contains(&vertex)
}

/// Returns the regions of a tree with the load in each.
fn weighed<'a>(
    tree: &DistributionTree,
    merging: &[RegionId],
    burdens: Vec<&'a Burden>,
    capacity: &dyn Fn(RegionId) -> f64,
) -> Vec<Weighed<'a>> {
    let (mut leaves, mut open) = (Vec::new(), vec![(RegionId(0), burdens)]);
    while let Some((vertex, burdens)) = open.pop() {
        match (tree.cut_of(vertex), tree.children_of(vertex)) {
            (Some((axis, at)), Some((left, right))) if !is_leaf(tree, merging, vertex) => {
                let (below, above) = parted(burdens, axis, at);
                open.extend([(right, above), (left, below)]);
            }
            _ => {
                let load = burdens.iter().map(|burden| burden.weight).sum();
                leaves.push(Weighed { leaf: vertex, load, capacity: capacity(vertex), burdens });
            }
        }
    }
    leaves
}

/// Returns the load of the busiest region relative to its capacity, including the cost of having parts of cut
/// islands.
fn busiest(leaves: &[Weighed<'_>], islands: usize) -> f64 {
    let mut in_leaves = vec![BTreeSet::new(); islands];
    for leaf in leaves {
        for island in leaf.burdens.iter().filter_map(|burden| burden.island) {
            in_leaves[island].insert(leaf.leaf);
        }
    }
    let is_cut = |burden: &Burden| burden.island.is_some_and(|island| in_leaves[island].len() > 1);
    let cost = |burden: &&Burden| burden.weight * if is_cut(burden) { CUT_COST } else { 1.0 };
    leaves.iter().map(|leaf| leaf.burdens.iter().map(cost).sum::<f64>() / leaf.capacity).fold(0.0, f64::max)
}

/// The islands that are not worth a cut: a box around each, by its index in the list of all islands.
struct Whole(Vec<Option<Bounds>>);

impl Whole {
    /// Returns the islands that weigh at most `most`.
    fn of(burdens: &[Burden], islands: &[Bounds], most: f64) -> Self {
        let mut weights = vec![0.0; islands.len()];
        for burden in burdens {
            burden.island.into_iter().for_each(|island| weights[island] += burden.weight);
        }
        Self(
            islands.iter().zip(weights).map(|(bounds, weight)| (weight <= most).then_some(*bounds)).collect(),
        )
    }

    /// Returns where to cut across an axis so that this part of the weight lies below, as nearly as possible
    /// without cutting one of these islands: halfway between two neighbours. A plane may be within `range`.
    /// It keeps `edge_m` away if everything lies on one side of it, and `room_m` away from what must not be
    /// cut.
    fn quantile(
        &self,
        burdens: &[&Burden],
        axis: Axis,
        part: f64,
        range: (f64, f64),
        edge_m: f64,
        room_m: f64,
    ) -> Option<f64> {
        let i = axis.index();
        let mut line: Vec<(f64, f64, f64)> = Vec::new();
        let mut places = vec![None; self.0.len()];
        for burden in burdens {
            let whole = burden.island.and_then(|island| Some((island, self.0[island]?)));
            match whole {
                Some((island, bounds)) => {
                    let place = *places[island].get_or_insert_with(|| {
                        line.push((bounds.min[i] - room_m, bounds.max[i] + room_m, 0.0));
                        line.len() - 1
                    });
                    line[place].2 += burden.weight;
                }
                None => line.push((burden.place[i], burden.place[i], burden.weight)),
            }
        }
        line.sort_unstable_by(|a, b| (a.0 + a.1).total_cmp(&(b.0 + b.1)));
        if line.is_empty() {
            return None;
        }
        let wanted = part * line.iter().map(|(.., weight)| weight).sum::<f64>();
        let mut lowest_above = vec![f64::INFINITY; line.len() + 1];
        for (place, &(low, ..)) in line.iter().enumerate().rev() {
            lowest_above[place] = low.min(lowest_above[place + 1]);
        }
        let mut taken: Vec<(f64, f64)> = line.iter().map(|&(low, high, _)| (low, high)).collect();
        taken.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        taken.retain(|(low, high)| low < high);
        taken.dedup_by(|next, last| {
            let overlap = next.0 < last.1;
            last.1 = if overlap { last.1.max(next.1) } else { last.1 };
            overlap
        });
        let is_clear = |at: f64| {
            let next = taken.partition_point(|&(_, high)| high <= at);
            taken.get(next).is_none_or(|&(low, _)| at <= low)
        };
        let clamped = |at: f64| at.clamp(range.0, range.1);
        let (mut below, mut highest, mut cuts) = (0.0, f64::NEG_INFINITY, Vec::new());
        for (place, &(_, high, weight)) in line.iter().enumerate() {
            (below, highest) = (below + weight, high.max(highest));
            let above = lowest_above[place + 1];
            let at = if above.is_finite() { 0.5 * (highest + above) } else { highest };
            cuts.push((at, below));
        }
        cuts.pop();
        let miss = |&(_, below): &(f64, f64)| (below - wanted).abs();
        // Each side keeps something, however small its part: a region without work would never show that its
        // node is faster by now.
        let nearest = cuts.iter().rev().min_by(|a, b| miss(a).total_cmp(&miss(b)));
        if let Some(&(at, _)) = nearest.filter(|(at, _)| is_clear(clamped(*at))) {
            return Some(clamped(at));
        }
        // A whole island lies where the cut should be. Cut as near to that as possible, or beside everything.
        cuts.extend([(lowest_above[0] - edge_m, 0.0), (highest + edge_m, below)]);
        let cuts = cuts.into_iter().map(|cut| (clamped(cut.0), miss(&cut)));
        let clear = cuts.filter(|(at, _)| is_clear(*at));
        clear.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| at)
    }
}

/// A region with the load in it.
struct Weighed<'a> {
    leaf: RegionId,
    load: f64,
    capacity: f64,
    burdens: Vec<&'a Burden>,
}

struct Planner<'a> {
    tree: &'a DistributionTree,
    settings: &'a Balance,
    merging: &'a [RegionId],
    whole: &'a Whole,
    capacity: &'a dyn Fn(RegionId) -> f64,
    moves: Vec<TreeChange>,
}

impl Planner<'_> {
    fn is_leaf(&self, vertex: RegionId) -> bool {
        is_leaf(self.tree, self.merging, vertex)
    }

    /// Returns how many regions a vertex has, and their capacity together.
    fn strength(&self, vertex: RegionId) -> (usize, f64) {
        match self.tree.children_of(vertex) {
            Some((left, right)) if !self.is_leaf(vertex) => {
                let (below, above) = (self.strength(left), self.strength(right));
                (below.0 + above.0, below.1 + above.1)
            }
            _ => (1, (self.capacity)(vertex)),
        }
    }

    /// Moves the planes below a vertex that covers the part `part` of the world.
    fn level(&mut self, vertex: RegionId, part: Bounds, burdens: Vec<&Burden>) {
        let (Some((axis, now)), Some((left, right))) =
            (self.tree.cut_of(vertex), self.tree.children_of(vertex))
        else {
            return;
        };
        if self.is_leaf(vertex) {
            return;
        }
        let i = axis.index();
        let ((below, weak), (above, strong)) = (self.strength(left), self.strength(right));
        let (below, above) = (below as f64, above as f64);
        // Each side of the plane needs room for its own planes.
        let edge = self.settings.smallest_edge_m;
        let (least, most) = (part.min[i] + edge * below, part.max[i] - edge * above);
        let share = weak / (weak + strong);
        let at = if least < most {
            let wished = |room| self.whole.quantile(&burdens, axis, share, (least, most), edge, room);
            // The planes of each side must find room beside the whole islands there.
            let wished = wished(edge * (below.max(above) - 1.0)).or_else(|| wished(0.0));
            wished.unwrap_or_else(|| now.clamp(least, most))
        } else {
            0.5 * (part.min[i] + part.max[i])
        };
        if at != now {
            self.moves.push(TreeChange::Move { vertex, at });
        }
        let (mut lower, mut upper) = (part, part);
        (lower.max[i], upper.min[i]) = (at, at);
        let (below, above) = parted(burdens, axis, at);
        self.level(left, lower, below);
        self.level(right, upper, above);
    }

    /// Returns the merge of the two siblings with the least load together, if that is little enough.
    fn lightest_pair(&self, leaves: &[Weighed<'_>]) -> Option<TreeChange> {
        let load_of = |leaf| leaves.iter().find(|other| other.leaf == leaf).map(|leaf| leaf.load);
        let pairs = self.tree.inner().filter(|vertex| !self.merging.contains(vertex)).filter_map(|vertex| {
            let (left, right) = self.tree.children_of(vertex)?;
            let (below, above) = (load_of(left)?, load_of(right)?);
            (self.tree.is_leaf(left) && self.tree.is_leaf(right))
                .then_some((vertex, left, right, below, above))
        });
        let (vertex, left, right, below, above) =
            pairs.min_by(|a, b| (a.3 + a.4).total_cmp(&(b.3 + b.4)).then(a.0.cmp(&b.0)))?;
        let heir = if above > below { right } else { left };
        (below + above < self.settings.merge_below).then_some(TreeChange::Yield { vertex, heir })
    }
}

/// Returns the cut of the heaviest region that is wide enough, in the middle of its load. If there `must` be
/// more regions, the region is cut whatever that brings.
fn split_of(
    tree: &DistributionTree,
    leaves: &[Weighed<'_>],
    whole: &Whole,
    settings: &Balance,
    must: bool,
) -> Option<TreeChange> {
    let may_be = |leaf: &&Weighed<'_>| tree.is_leaf(leaf.leaf) && (must || leaf.load > settings.split_above);
    let mut by_load: Vec<_> = leaves.iter().filter(may_be).collect();
    let busy = |leaf: &Weighed<'_>| leaf.load / leaf.capacity;
    by_load.sort_by(|a, b| busy(b).total_cmp(&busy(a)).then(a.leaf.cmp(&b.leaf)));
    by_load.into_iter().find_map(|Weighed { leaf, load, burdens, .. }| {
        let around = middle_of(burdens, &tree.part(*leaf))?;
        let axis = around.longest_axis();
        let (i, edge) = (axis.index(), settings.smallest_edge_m);
        let (least, most) = (around.min[i] + edge, around.max[i] - edge);
        if least >= most {
            return None;
        }
        let at = whole.quantile(burdens, axis, 0.5, (least, most), edge, 0.0)?;
        let below: f64 =
            burdens.iter().filter(|burden| burden.place[i] < at).map(|burden| burden.weight).sum();
        let pays = settings.tolerance * below.max(load - below) < *load;
        (must || pays).then_some(TreeChange::Split { leaf: *leaf, axis, at })
    })
}

/// Returns a box around the load of a region, within the bounds of the world and without a sixty-fourth at
/// each side. So what has fallen off the ground, or left the bounds, does not influence how the rest is cut.
/// `None` if nothing is left.
fn middle_of(burdens: &[&Burden], part: &Bounds) -> Option<Bounds> {
    const LEFT_OUT: f64 = 1.0 / 64.0;
    let least = LEFT_OUT * burdens.iter().map(|burden| burden.weight).sum::<f64>();
    let (mut min, mut max) = (part.min, part.max);
    for i in 0..3 {
        let mut places: Vec<_> = burdens.iter().map(|burden| (burden.place[i], burden.weight)).collect();
        places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // Finds the first place beyond what is left out.
        let first = |passed: &mut f64, &(_, weight): &(f64, f64)| {
            *passed += weight;
            *passed > least
        };
        let (mut below, mut above) = (0.0, 0.0);
        min[i] = min[i].max(places.iter().find(|place| first(&mut below, place))?.0);
        max[i] = max[i].min(places.iter().rev().find(|place| first(&mut above, place))?.0);
    }
    (0..3).all(|i| min[i] <= max[i]).then(|| Bounds::new(min, max))
}

fn parted(burdens: Vec<&Burden>, axis: Axis, at: f64) -> (Vec<&Burden>, Vec<&Burden>) {
    burdens.into_iter().partition(|burden| burden.place[axis.index()] < at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crowd(from: f64, to: f64, count: usize) -> Vec<Burden> {
        let place = |i: usize| from + (to - from) * (i as f64 + 0.5) / count as f64;
        (0..count).map(|i| Burden { place: [place(i), 0.0, 0.0], weight: 1.0, island: None }).collect()
    }

    fn applied(tree: &mut DistributionTree, changes: &[TreeChange]) {
        change_at_once(tree, changes).unwrap();
    }

    fn planned(
        tree: &DistributionTree,
        burdens: &[Burden],
        islands: &[Bounds],
        settings: &Balance,
    ) -> Vec<TreeChange> {
        plan(&Loads { tree, burdens, islands, capacity: &|_| 1.0 }, settings)
    }

    fn loads(tree: &DistributionTree, burdens: &[Burden]) -> Vec<usize> {
        let of = |leaf| burdens.iter().filter(|burden| tree.leaf_at(burden.place) == leaf).count();
        tree.leaves().map(of).collect()
    }

    fn road(regions: usize) -> DistributionTree {
        DistributionTree::halved(Bounds::new([0.0, -4.0, -4.0], [1000.0, 4.0, 4.0]), regions).unwrap()
    }

    #[test]
    fn planes_follow_a_crowd_and_rest_when_shares_are_equal() {
        let (mut tree, settings) = (road(8), Balance::keeping(8));
        for from in [0.0, 100.0, 450.0, 800.0] {
            let crowd = crowd(from, from + 200.0, 800);
            let changes = planned(&tree, &crowd, &[], &settings);
            assert!(!changes.is_empty());
            applied(&mut tree, &changes);
            assert_eq!(loads(&tree, &crowd), [100; 8]);
            assert_eq!(planned(&tree, &crowd, &[], &settings), []);
        }
    }

    #[test]
    fn a_little_imbalance_moves_nothing() {
        let tree = road(2);
        let mut crowd = crowd(0.0, 1000.0, 100);
        crowd.extend(std::iter::repeat_n(Burden { place: [1.0; 3], weight: 1.0, island: None }, 20));
        assert_eq!(planned(&tree, &crowd, &[], &Balance::keeping(2)), [], "70 of 120");
        crowd.extend(std::iter::repeat_n(Burden { place: [1.0; 3], weight: 1.0, island: None }, 60));
        assert!(matches!(
            planned(&tree, &crowd, &[], &Balance::keeping(2))[..],
            [TreeChange::Move { vertex: RegionId(0), .. }]
        ));
    }

    #[test]
    fn regions_stay_as_wide_as_asked() {
        let settings = Balance { smallest_edge_m: 10.0, ..Balance::keeping(8) };
        let (mut tree, crowd) = (road(8), crowd(500.0, 501.0, 100));
        let changes = planned(&tree, &crowd, &[], &settings);
        applied(&mut tree, &changes);
        let narrowest = tree.leaves().map(|leaf| tree.part(leaf).size()[0]).fold(f64::INFINITY, f64::min);
        assert!(narrowest >= 10.0 - 1e-9, "{narrowest} m");
    }

    #[test]
    fn regions_are_cut_and_merged_as_the_load_grows_and_shrinks_and_do_not_flap() {
        let settings = Balance { split_above: 100.0, merge_below: 60.0, ..Balance::default() };
        let mut tree = road(1);
        let mut settle = |count: usize| {
            let crowd = crowd(0.0, 1000.0, count);
            for _ in 0..40 {
                let changes = planned(&tree, &crowd, &[], &settings);
                if changes.is_empty() {
                    return tree.leaf_count();
                }
                applied(&mut tree, &changes);
            }
            panic!("it flaps at {count}");
        };
        assert_eq!(settle(90), 1);
        assert_eq!(settle(500), 8, "500 in 4 regions are too many for each");
        assert_eq!(settle(400), 8, "not few enough to merge");
        assert_eq!(settle(200), 4);
        assert_eq!(settle(10), 1);
    }

    /// Returns `count` bodies in one island from 480 to 520 m, and a hundred along the road, with a box
    /// around the island.
    fn crowd_with_island(count: usize) -> (Vec<Burden>, Bounds) {
        let island =
            crowd(480.0, 520.0, count).into_iter().map(|burden| Burden { island: Some(0), ..burden });
        (
            crowd(0.0, 1000.0, 100).into_iter().chain(island).collect(),
            Bounds::new([480.0, -1.0, -1.0], [520.0, 1.0, 1.0]),
        )
    }

    /// Returns where the planes lie when nothing changes any more.
    fn settled(
        tree: &mut DistributionTree,
        burdens: &[Burden],
        island: Bounds,
        settings: &Balance,
    ) -> Vec<f64> {
        for _ in 0..10 {
            let changes = planned(tree, burdens, &[island], settings);
            if changes.is_empty() {
                return tree.inner().filter_map(|vertex| Some(tree.cut_of(vertex)?.1)).collect();
            }
            applied(tree, &changes);
        }
        panic!("it flaps");
    }

    #[test]
    fn planes_keep_out_of_an_island_that_is_not_worth_a_cut() {
        for (regions, count) in [(2, 600), (3, 600), (4, 600), (5, 400), (8, 200), (8, 600)] {
            let (burdens, island) = crowd_with_island(count);
            let (mut tree, settings) = (road(regions), Balance::keeping(regions));
            let planes = settled(&mut tree, &burdens, island, &settings);
            let within = |at: &f64| island.min[0] < *at && *at < island.max[0];
            assert!(!planes.iter().any(within), "{regions} regions: {planes:?}");
            let most = loads(&tree, &burdens).into_iter().max().unwrap();
            assert!(most < count + 60, "{regions} regions: {most}");
            let again = planned(&tree, &burdens, &[Bounds { max: [520.5; 3], ..island }], &settings);
            assert_eq!(again, [], "an island that grows a little moves nothing");
        }
    }

    #[test]
    fn planes_cut_an_island_where_so_many_regions_share_it_that_it_pays() {
        let (burdens, island) = crowd_with_island(3000);
        let (mut tree, settings) = (road(16), Balance { smallest_edge_m: 1.0, ..Balance::keeping(16) });
        settled(&mut tree, &burdens, island, &settings);
        let most = loads(&tree, &burdens).into_iter().max().unwrap();
        assert!(most < 300, "{most} of 3100 in 16 regions");
    }

    #[test]
    fn a_region_is_not_cut_through_an_island_and_others_not_in_its_stead() {
        let settings = Balance { split_above: 500.0, merge_below: 10.0, ..Balance::default() };
        let (burdens, island) = crowd_with_island(600);
        let mut tree = road(1);
        let planes = settled(&mut tree, &burdens, island, &settings);
        assert!(planes.is_empty(), "{planes:?}");
        let whole: Vec<_> = burdens.iter().map(|burden| Burden { island: None, ..*burden }).collect();
        assert!(!settled(&mut tree, &whole, island, &settings).is_empty(), "no island, no harm");
    }

    #[test]
    fn what_is_being_merged_counts_as_one_region() {
        let (mut tree, settings) =
            (road(4), Balance { merge_below: 300.0, split_above: 1000.0, ..Balance::default() });
        let crowd = crowd(0.0, 1000.0, 400);
        for expected in [RegionId(1), RegionId(2)] {
            let changes = planned(&tree, &crowd, &[], &settings);
            assert!(
                matches!(changes[..], [TreeChange::Yield { vertex, .. }] if vertex == expected),
                "{changes:?}"
            );
            tree.change(&changes).unwrap();
        }
        assert_eq!(tree.leaf_count(), 4, "none of them is empty yet");
        assert_eq!(planned(&tree, &crowd, &[], &settings), []);
    }

    #[test]
    fn what_fell_off_the_ground_or_left_the_bounds_does_not_say_how_the_rest_is_cut() {
        let burden = |place| Burden { place, ..crowd(0.0, 1.0, 1)[0] };
        let ground =
            |x0: f64| (0..200).map(move |i| [x0 + f64::from(i % 20) * 5.0, 0.5, f64::from(i / 20) * 5.0]);
        // Cases of how deep the bounds are, and how many bodies have fallen out of them.
        for (depth, strays) in [(-1.0, 1), (-64.0, 1), (-64.0, 3), (-1.0, 0)] {
            let bounds = Bounds::new([0.0, depth, 0.0], [100.0, 8.0, 60.0]);
            let tree = DistributionTree::halved(bounds, 1).unwrap();
            let mut burdens: Vec<_> = ground(0.0).map(burden).collect();
            burdens.extend((0..strays).map(|i| burden([50.0, -5_000.0 - f64::from(i), 30.0])));
            for settings in [Balance::keeping(2), Balance { split_above: 100.0, ..Balance::default() }] {
                let changes = planned(&tree, &burdens, &[], &settings);
                let [TreeChange::Split { axis: Axis::X, at, .. }] = changes[..] else {
                    panic!("{changes:?}")
                };
                assert!((20.0..80.0).contains(&at), "{at}");
                tree.clone().change(&changes).unwrap();
            }
        }
    }

    #[test]
    fn regions_have_load_as_they_have_capacity() {
        let (mut tree, crowd, settings) = (road(4), crowd(0.0, 1000.0, 1300), Balance::keeping(4));
        let slow = tree.leaves().nth(2).unwrap();
        let capacity = |leaf| if leaf == slow { 0.1 } else { 0.4 };
        let loads_of = |tree: &DistributionTree| {
            plan(&Loads { tree, burdens: &crowd, islands: &[], capacity: &capacity }, &settings)
        };
        let changes = loads_of(&tree);
        applied(&mut tree, &changes);
        assert_eq!(loads(&tree, &crowd), [400, 400, 100, 400]);
        assert_eq!(loads_of(&tree), []);
    }

    #[test]
    fn a_slow_region_has_the_number_of_bodies_nearest_to_its_part_and_never_none() {
        let (crowd, settings) = (crowd(0.0, 1000.0, 32), Balance::keeping(2));
        for (speed, expected) in [(0.036, 1), (0.06, 2), (0.001, 1)] {
            for slow in 0..2 {
                let mut tree = road(2);
                let slow_leaf = tree.leaves().nth(slow).unwrap();
                let capacity = |leaf| if leaf == slow_leaf { speed } else { 1.0 - speed };
                let of = Loads { tree: &tree, burdens: &crowd, islands: &[], capacity: &capacity };
                let changes = plan(&of, &settings);
                applied(&mut tree, &changes);
                assert_eq!(loads(&tree, &crowd)[slow], expected, "at speed {speed}, region {slow}");
            }
        }
    }

    #[test]
    fn a_world_that_nobody_computes_is_cut_for_its_nodes_at_once() {
        let crowd = crowd(0.0, 300.0, 800);
        for (regions, nodes) in [(1, 8), (8, 3), (5, 5)] {
            let tree = balanced(road(regions), &crowd, &Balance::by_nodes().among(nodes));
            let loads = loads(&tree, &crowd);
            assert_eq!(loads.len(), nodes);
            let most = *loads.iter().max().unwrap() as f64;
            assert!(most <= 1.2 * 800.0 / nodes as f64, "{regions} regions, {nodes} nodes: {loads:?}");
        }
    }

    #[test]
    fn a_summary_is_short_and_says_how_much_lies_where() {
        let (mut burdens, island) = crowd_with_island(3000);
        burdens.iter_mut().enumerate().for_each(|(i, burden)| burden.place[1] = (i % 17) as f64);
        let summary = summarised(burdens.clone(), 128);
        assert!(summary.len() <= 130, "{}", summary.len());
        let within = |burdens: &[Burden], from: f64, to: f64| {
            let there = burdens.iter().filter(|burden| (from..to).contains(&burden.place[0]));
            there.map(|burden| burden.weight).sum::<f64>()
        };
        for (from, to) in [(-1.0, 1001.0), (-1.0, 500.0), (470.0, 530.0), (480.0, 490.0)] {
            let (all, summed) = (within(&burdens, from, to), within(&summary, from, to));
            assert!((all - summed).abs() < 0.03 * 3100.0, "{from} to {to}: {summed} of {all}");
        }
        let inside = |burden: &Burden| island.min[0] <= burden.place[0] && burden.place[0] <= island.max[0];
        assert!(summary.iter().filter(|burden| burden.island.is_some()).all(inside));
        assert_eq!(summarised(Vec::new(), 128), []);
        assert_eq!(summarised(crowd(0.0, 1.0, 1), 128).len(), 1);
    }

    #[test]
    fn settings_that_cannot_be_are_named() {
        let fault = |change: fn(&mut Balance)| {
            let mut settings = Balance::default();
            change(&mut settings);
            settings.fault().map(|(what, ..)| what)
        };
        assert_eq!(fault(|_| {}), None);
        assert_eq!(fault(|settings| settings.merge_below = 20_000.0), Some("merge_below"));
        assert_eq!(fault(|settings| settings.most_regions = 257), Some("most_regions"));
        assert_eq!(fault(|settings| settings.tolerance = f64::NAN), Some("tolerance"));
    }
}
