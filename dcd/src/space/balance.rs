//! How the tree follows the load (thesis 3.2, 4.3.2.2): planes move so that regions have equal shares, regions are cut and
//! merged as the load grows and shrinks. From equal counts follow equal trees; hysteresis keeps what is good enough.

use serde::{Deserialize, Serialize};

use super::{Axis, Bounds, DistributionTree, RegionId};

/// When and how the tree follows the load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Balance {
    /// Looked at once in so many ticks; at least 1.
    pub every_ticks: u32,
    /// Planes move when the heaviest region has more than so many times the mean load; above 1.
    pub tolerance: f64,
    /// The heaviest region is cut while it has more load than this: bodies and contacts, or microseconds a tick.
    pub split_above: f64,
    /// Two siblings are merged when they have less load together; below `split_above`.
    pub merge_below: f64,
    /// Never fewer regions than this, at least 1.
    pub least_regions: usize,
    /// Never more regions than this, at most [`MAX_REGIONS`](super::MAX_REGIONS).
    pub most_regions: usize,
    /// No region becomes thinner than this, in metres: a few times the largest common body.
    pub smallest_edge_m: f64,
    /// What counts as load.
    pub load: Load,
}

/// What counts as load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Load {
    /// Awake bodies, copies of others' among them, and contacts: the same on every machine.
    #[default]
    Counts,
    /// The time that regions took, in microseconds a tick, smoothed: true, and never the same twice.
    Times,
}

impl Default for Balance {
    fn default() -> Self {
        Self {
            every_ticks: 30,
            tolerance: 1.2,
            split_above: 20_000.0,
            merge_below: 1_000.0,
            least_regions: 1,
            most_regions: 64,
            smallest_edge_m: 4.0,
            load: Load::Counts,
        }
    }
}

impl Balance {
    /// Keeps so many regions, whatever the load.
    pub fn keeping(regions: usize) -> Self {
        Self { least_regions: regions, most_regions: regions, ..Self::default() }
    }

    /// What is wrong with the settings, if anything: which one, what it is, and what it may be.
    pub fn fault(&self) -> Option<(&'static str, String, &'static str)> {
        let Self { every_ticks, tolerance, split_above, merge_below, least_regions, most_regions, .. } =
            *self;
        let edge = self.smallest_edge_m;
        let found = |what, value: &dyn ToString, range| Some((what, value.to_string(), range));
        if every_ticks == 0 {
            found("every_ticks", &every_ticks, "1 tick or more")
        } else if tolerance.is_nan() || tolerance <= 1.0 {
            found("tolerance", &tolerance, "a number above 1, as 1.2")
        } else if split_above.is_nan() {
            found("split_above", &split_above, "a number, in units of the load")
        } else if merge_below.is_nan() || merge_below >= split_above {
            found("merge_below", &merge_below, "less than split_above, or regions flap")
        } else if least_regions == 0 {
            found("least_regions", &least_regions, "1 region or more")
        } else if most_regions < least_regions || most_regions > super::MAX_REGIONS {
            found("most_regions", &most_regions, "from least_regions to 256")
        } else if !(edge > 0.0 && edge.is_finite()) {
            found("smallest_edge_m", &edge, "a positive number of metres")
        } else {
            None
        }
    }
}

/// A part of the load and where it is, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burden {
    /// Metres.
    pub place: [f64; 3],
    /// In the units of the load.
    pub weight: f64,
}

/// What is to become of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// The plane of an inner vertex goes here.
    Move {
        /// Which vertex.
        vertex: RegionId,
        /// Metres along the axis of its cut.
        at: f64,
    },
    /// A region is cut in two.
    Split {
        /// Which region.
        leaf: RegionId,
        /// Across which axis.
        axis: Axis,
        /// Where.
        at: f64,
    },
    /// One of two sibling regions takes over all of the other's.
    Merge {
        /// Their parent.
        vertex: RegionId,
        /// The one that remains, so far.
        heir: RegionId,
    },
}

/// What is to change so that the regions of a tree have equal shares of the load; nothing if they are near enough.
/// `merging` are vertices one of whose children is being emptied: they count as one region.
pub fn plan(
    tree: &DistributionTree,
    burdens: &[Burden],
    settings: &Balance,
    merging: &[RegionId],
) -> Vec<Change> {
    let mut planner = Planner { tree, settings, merging, leaves: Vec::new(), moves: Vec::new() };
    let all: Vec<_> = burdens.iter().collect();
    planner.weigh(RegionId(0), all.clone());
    let total: f64 = burdens.iter().map(|burden| burden.weight).sum();
    let (count, heaviest) =
        (planner.leaves.len(), planner.leaves.iter().map(|leaf| leaf.load).fold(0.0, f64::max));
    if count < settings.most_regions
        && (count < settings.least_regions || heaviest > settings.split_above)
        && let Some(split) = split_of(&planner.leaves, settings)
    {
        return vec![split];
    }
    if count > settings.least_regions
        && let Some(merge) = planner.lightest_pair()
    {
        return vec![merge];
    }
    if count > 1 && heaviest > settings.tolerance * total / count as f64 {
        planner.level(RegionId(0), tree.bounds(), all);
    }
    planner.moves
}

/// A region and what is in it.
struct Weighed<'a> {
    leaf: RegionId,
    load: f64,
    burdens: Vec<&'a Burden>,
}

struct Planner<'a> {
    tree: &'a DistributionTree,
    settings: &'a Balance,
    merging: &'a [RegionId],
    leaves: Vec<Weighed<'a>>,
    moves: Vec<Change>,
}

impl<'a> Planner<'a> {
    /// Whether a vertex counts as a region.
    fn is_leaf(&self, vertex: RegionId) -> bool {
        self.tree.is_leaf(vertex) || self.merging.contains(&vertex)
    }

    fn count(&self, vertex: RegionId) -> usize {
        match self.tree.children_of(vertex) {
            Some((left, right)) if !self.is_leaf(vertex) => self.count(left) + self.count(right),
            _ => 1,
        }
    }

    fn weigh(&mut self, vertex: RegionId, burdens: Vec<&'a Burden>) {
        match (self.tree.cut_of(vertex), self.tree.children_of(vertex)) {
            (Some((axis, at)), Some((left, right))) if !self.is_leaf(vertex) => {
                let (below, above) = parted(burdens, axis, at);
                self.weigh(left, below);
                self.weigh(right, above);
            }
            _ => {
                let load = burdens.iter().map(|burden| burden.weight).sum();
                self.leaves.push(Weighed { leaf: vertex, load, burdens });
            }
        }
    }

    /// Moves the planes below a vertex whose part of the world is `part`.
    fn level(&mut self, vertex: RegionId, part: Bounds, burdens: Vec<&'a Burden>) {
        let (Some((axis, now)), Some((left, right))) =
            (self.tree.cut_of(vertex), self.tree.children_of(vertex))
        else {
            return;
        };
        if self.is_leaf(vertex) {
            return;
        }
        let i = axis.index();
        let (below, above) = (self.count(left) as f64, self.count(right) as f64);
        // What lies below needs room for its own planes, and so does what lies above.
        let edge = self.settings.smallest_edge_m;
        let (least, most) = (part.min[i] + edge * below, part.max[i] - edge * above);
        let wished = quantile(&burdens, axis, below / (below + above)).unwrap_or(now);
        let at = if least < most { wished.clamp(least, most) } else { 0.5 * (part.min[i] + part.max[i]) };
        if at != now {
            self.moves.push(Change::Move { vertex, at });
        }
        let (mut lower, mut upper) = (part, part);
        (lower.max[i], upper.min[i]) = (at, at);
        let (below, above) = parted(burdens, axis, at);
        self.level(left, lower, below);
        self.level(right, upper, above);
    }

    /// The two siblings with the least load together, if that is little.
    fn lightest_pair(&self) -> Option<Change> {
        let load_of = |leaf| self.leaves.iter().find(|other| other.leaf == leaf).map(|leaf| leaf.load);
        let pairs = self.tree.inner().filter(|vertex| !self.merging.contains(vertex)).filter_map(|vertex| {
            let (left, right) = self.tree.children_of(vertex)?;
            let (below, above) = (load_of(left)?, load_of(right)?);
            (self.tree.is_leaf(left) && self.tree.is_leaf(right))
                .then_some((vertex, left, right, below, above))
        });
        let (vertex, left, right, below, above) =
            pairs.min_by(|a, b| (a.3 + a.4).total_cmp(&(b.3 + b.4)).then(a.0.cmp(&b.0)))?;
        let heir = if above > below { right } else { left };
        (below + above < self.settings.merge_below).then_some(Change::Merge { vertex, heir })
    }
}

/// Cuts the heaviest region that is wide enough, in the middle of its load.
fn split_of(leaves: &[Weighed<'_>], settings: &Balance) -> Option<Change> {
    let mut by_load: Vec<_> = leaves.iter().collect();
    by_load.sort_by(|a, b| b.load.total_cmp(&a.load).then(a.leaf.cmp(&b.leaf)));
    by_load.into_iter().find_map(|Weighed { leaf, burdens, .. }| {
        let boxes = burdens.iter().map(|burden| Bounds::new(burden.place, burden.place));
        let around = boxes.reduce(|a, b| a.union(&b))?;
        let axis = around.longest_axis();
        let i = axis.index();
        let (least, most) =
            (around.min[i] + settings.smallest_edge_m, around.max[i] - settings.smallest_edge_m);
        let at = quantile(burdens, axis, 0.5)?.clamp(least.min(most), most);
        (least < most).then_some(Change::Split { leaf: *leaf, axis, at })
    })
}

fn parted(burdens: Vec<&Burden>, axis: Axis, at: f64) -> (Vec<&Burden>, Vec<&Burden>) {
    burdens.into_iter().partition(|burden| burden.place[axis.index()] < at)
}

/// Where along an axis this part of the weight lies below: halfway between two neighbours.
fn quantile(burdens: &[&Burden], axis: Axis, part: f64) -> Option<f64> {
    let mut line: Vec<_> = burdens.iter().map(|burden| (burden.place[axis.index()], burden.weight)).collect();
    line.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let wanted = part * line.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut below = 0.0;
    for pair in line.windows(2) {
        below += pair[0].1;
        if below >= wanted {
            return Some(0.5 * (pair[0].0 + pair[1].0));
        }
    }
    line.last().map(|(place, _)| *place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crowd(from: f64, to: f64, count: usize) -> Vec<Burden> {
        let place = |i: usize| from + (to - from) * (i as f64 + 0.5) / count as f64;
        (0..count).map(|i| Burden { place: [place(i), 0.0, 0.0], weight: 1.0 }).collect()
    }

    fn applied(tree: &mut DistributionTree, changes: &[Change]) {
        for change in changes {
            match *change {
                Change::Move { vertex, at } => tree.move_plane(vertex, at).unwrap(),
                Change::Split { leaf, axis, at } => drop(tree.split_at(leaf, axis, at).unwrap()),
                Change::Merge { vertex, .. } => tree.merge(vertex).unwrap(),
            }
        }
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
            let changes = plan(&tree, &crowd, &settings, &[]);
            assert!(!changes.is_empty());
            applied(&mut tree, &changes);
            assert_eq!(loads(&tree, &crowd), [100; 8]);
            assert_eq!(plan(&tree, &crowd, &settings, &[]), []);
        }
    }

    #[test]
    fn a_little_imbalance_moves_nothing() {
        let tree = road(2);
        let mut crowd = crowd(0.0, 1000.0, 100);
        crowd.extend(std::iter::repeat_n(Burden { place: [1.0; 3], weight: 1.0 }, 20));
        assert_eq!(plan(&tree, &crowd, &Balance::keeping(2), &[]), [], "70 of 120");
        crowd.extend(std::iter::repeat_n(Burden { place: [1.0; 3], weight: 1.0 }, 60));
        assert!(matches!(
            plan(&tree, &crowd, &Balance::keeping(2), &[])[..],
            [Change::Move { vertex: RegionId(0), .. }]
        ));
    }

    #[test]
    fn regions_stay_as_wide_as_asked() {
        let settings = Balance { smallest_edge_m: 10.0, ..Balance::keeping(8) };
        let (mut tree, crowd) = (road(8), crowd(500.0, 501.0, 100));
        let changes = plan(&tree, &crowd, &settings, &[]);
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
                let changes = plan(&tree, &crowd, &settings, &[]);
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

    #[test]
    fn what_is_being_merged_counts_as_one_region() {
        let (tree, settings) =
            (road(4), Balance { merge_below: 300.0, split_above: 1000.0, ..Balance::default() });
        let crowd = crowd(0.0, 1000.0, 400);
        let [Change::Merge { vertex, .. }] = plan(&tree, &crowd, &settings, &[])[..] else { panic!() };
        assert_eq!(vertex, RegionId(1));
        let [Change::Merge { vertex, .. }] = plan(&tree, &crowd, &settings, &[RegionId(1)])[..] else {
            panic!()
        };
        assert_eq!(vertex, RegionId(2));
        assert_eq!(plan(&tree, &crowd, &settings, &[RegionId(1), RegionId(2)]), []);
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
