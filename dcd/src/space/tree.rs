//! Cuts the world by axis-aligned planes into the distribution tree (a k-d tree; thesis 3.2, 4.3.1.3), whose
//! leaves are the regions.

use std::collections::BTreeMap;

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{Axis, Bounds, Cell, MAX_REGIONS, RegionId};

/// The limits at which subdivision stops (thesis 4.3.1.3).
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Limits {
    /// The shortest edge that a cut may leave, metres.
    pub smallest_edge_m: f64,
    /// The greatest depth of a vertex below the root; at most 30.
    pub largest_depth: u32,
    /// The most leaves; at most [`MAX_REGIONS`].
    pub most_leaves: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { smallest_edge_m: 1.0, largest_depth: 30, most_leaves: MAX_REGIONS }
    }
}

/// The error of a distribution tree that cannot be made or changed as asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TreeError {
    /// The bounds of the world are no finite box.
    #[error("the world's bounds from {:?} to {:?} are no finite box: give a lowest corner (min) below a highest one (max) along every axis", .0.min, .0.max)]
    Bounds(Bounds),
    /// A world cannot have this number of regions.
    #[error("{0} regions asked for: a world has 1 to {MAX_REGIONS}")]
    Count(usize),
    /// Every region is at a limit and cannot be cut further.
    #[error(
        "no region can be cut further: {0} regions fit into the bounds of the world, as a cut leaves at least a metre on either side (`Limits`); ask for fewer or give larger bounds"
    )]
    Limits(usize),
    /// The vertex is not a leaf of the tree.
    #[error("{0} is not a leaf of the distribution tree")]
    NotALeaf(RegionId),
    /// The vertex does not have two leaves below it.
    #[error("{0} cannot be merged: its two children are not both leaves")]
    NotMergeable(RegionId),
    /// A plane lies beyond those above it in the tree.
    #[error(
        "the planes do not fit into one another: each must cut the part of the world that its vertex covers"
    )]
    Crossed,
    /// The vertex is not cut.
    #[error("{0} has no plane to move: it is a region, or not in the tree")]
    NotCut(RegionId),
    /// The plane lies outside the region that it should cut.
    #[error("the plane {axis:?} = {at} does not cut any region")]
    Plane {
        /// The axis across which the plane cuts.
        axis: Axis,
        /// The position on the axis, metres.
        at: f64,
    },
}

/// A change of a distribution tree.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub enum TreeChange {
    /// Moves the plane of an inner vertex.
    Move {
        /// The vertex.
        vertex: RegionId,
        /// The new position on the axis of its cut, metres.
        at: f64,
    },
    /// Cuts a region in two. The left one keeps what the region has, the right one is new.
    Split {
        /// The region.
        leaf: RegionId,
        /// The axis across which it is cut.
        axis: Axis,
        /// The position of the plane on that axis, metres.
        at: f64,
    },
    /// Has one of two sibling regions take over everything of the other, which is emptied before the two are
    /// merged.
    Yield {
        /// The parent of the regions.
        vertex: RegionId,
        /// The region that remains.
        heir: RegionId,
    },
    /// Merges two sibling regions, one of them empty, into one.
    Merge {
        /// The parent of the regions.
        vertex: RegionId,
    },
}

/// The two regions of a vertex that is to become one region again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Yielding {
    /// The region that takes over all bodies of the other.
    pub heir: RegionId,
    /// The region that is given up once it is empty.
    pub leaving: RegionId,
}

/// The effect of a change of the tree on the names of regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Renaming {
    /// The region that goes on under another name.
    pub from: RegionId,
    /// Its new name.
    pub to: RegionId,
    /// A region that is new.
    pub born: Option<RegionId>,
    /// A region that is given up.
    pub gone: Option<RegionId>,
}

/// The distribution tree. Every member of a group holds an equal copy, so that an id names the same box to
/// all.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct DistributionTree {
    bounds: Bounds,
    limits: Limits,
    /// The cut of each inner vertex.
    cuts: BTreeMap<RegionId, (Axis, f64)>,
}

impl DistributionTree {
    /// Makes a tree with one leaf, the root.
    pub fn new(bounds: Bounds, limits: Limits) -> Result<Self, TreeError> {
        if !bounds.is_finite() || bounds.size().contains(&0.0) {
            return Err(TreeError::Bounds(bounds));
        }
        let limits = Limits {
            largest_depth: limits.largest_depth.min(30),
            most_leaves: limits.most_leaves.min(MAX_REGIONS),
            ..limits
        };
        Ok(Self { bounds, limits, cuts: BTreeMap::new() })
    }

    /// Makes a tree of `count` regions: the largest leaf is halved across its longest axis until there are
    /// enough.
    pub fn halved(bounds: Bounds, count: usize) -> Result<Self, TreeError> {
        Self::halved_across(bounds, count, &Axis::ALL)
    }

    /// Makes a tree of `count` regions as [`DistributionTree::halved`] does, by planes across these axes
    /// only.
    pub fn halved_across(bounds: Bounds, count: usize, axes: &[Axis]) -> Result<Self, TreeError> {
        let mut tree = Self::new(bounds, Limits::default())?;
        if count == 0 || count > MAX_REGIONS {
            return Err(TreeError::Count(count));
        }
        while tree.leaf_count() < count {
            let volume_m3 = |leaf: RegionId| tree.part(leaf).size().iter().product::<f64>();
            let largest = tree
                .leaves()
                .filter_map(|leaf| Some((leaf, tree.longest_of(leaf, axes)?)))
                .max_by(|(a, _), (b, _)| volume_m3(*a).total_cmp(&volume_m3(*b)).then(b.cmp(a)));
            let (largest, axis) = largest.ok_or(TreeError::Limits(tree.leaf_count()))?;
            let at = tree.part(largest).centre()[axis.index()];
            tree.split_at(largest, axis, at)?;
        }
        Ok(tree)
    }

    /// Makes a tree whose regions are divided by these planes. Each plane cuts every leaf that it passes
    /// through.
    pub fn cut_by(bounds: Bounds, planes: &[(Axis, f64)]) -> Result<Self, TreeError> {
        let mut tree = Self::new(bounds, Limits { smallest_edge_m: 0.0, ..Limits::default() })?;
        for &(axis, at) in planes {
            let i = axis.index();
            let crossed: Vec<_> = tree
                .leaves()
                .filter(|&leaf| {
                    let cell = tree.cell(leaf);
                    cell.min[i] < at && at < cell.max[i]
                })
                .collect();
            if crossed.is_empty() || !at.is_finite() {
                return Err(TreeError::Plane { axis, at });
            }
            for leaf in crossed {
                tree.split_at(leaf, axis, at)?;
            }
        }
        Ok(tree)
    }

    /// Returns whether a tree from a peer keeps the rules that all calls here rely on: its inner vertices are
    /// connected, each is cut inside its part of the world, and the tree stays within the limits of trees.
    pub fn is_sound(&self) -> bool {
        self.bounds.is_finite()
            && self.limits.largest_depth <= 30
            && self.limits.most_leaves <= MAX_REGIONS
            && self.cuts.len() < MAX_REGIONS
            // The depth is checked first, since arithmetic on ids of deeper vertices would overflow.
            && self.cuts.keys().all(|vertex| vertex.0 < (1 << 30) - 1)
            && self.cuts.iter().all(|(&vertex, &(axis, at))| {
                let part = self.part(vertex);
                let yields = at.is_infinite() && self.has_two_leaves(vertex);
                (vertex.0 == 0 || self.cuts.contains_key(&parent(vertex)))
                    && (yields || part.min[axis.index()] < at && at < part.max[axis.index()])
            })
    }

    /// Returns the box that is subdivided. Bodies may leave it: the outer cells reach to infinity.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Returns the limits of subdivision.
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// Cuts a leaf in the middle of its longest axis.
    pub fn split(&mut self, leaf: RegionId) -> Result<(RegionId, RegionId), TreeError> {
        let part = self.part(leaf);
        let axis = part.longest_axis();
        if self.is_leaf(leaf) && part.size()[axis.index()] * 0.5 < self.limits.smallest_edge_m {
            return Err(TreeError::Limits(self.leaf_count()));
        }
        self.split_at(leaf, axis, part.centre()[axis.index()])
    }

    /// Cuts a leaf by a given plane inside its part of the world.
    pub fn split_at(
        &mut self,
        leaf: RegionId,
        axis: Axis,
        at: f64,
    ) -> Result<(RegionId, RegionId), TreeError> {
        if !self.is_leaf(leaf) {
            return Err(TreeError::NotALeaf(leaf));
        }
        if depth(leaf) >= self.limits.largest_depth || self.leaf_count() >= self.limits.most_leaves {
            return Err(TreeError::Limits(self.leaf_count()));
        }
        // The plane must be inside the bounds too, though outer cells reach farther, so that every region
        // covers a part of the world.
        let part = self.part(leaf);
        if !(part.min[axis.index()] < at && at < part.max[axis.index()]) {
            return Err(TreeError::Plane { axis, at });
        }
        self.cuts.insert(leaf, (axis, at));
        Ok(leaf.children())
    }

    /// Moves the plane of an inner vertex. Planes below it across the same axis must stay on their sides of
    /// it: move those before or after, and check with [`DistributionTree::is_sound`].
    pub fn move_plane(&mut self, vertex: RegionId, at: f64) -> Result<(), TreeError> {
        let Some((axis, plane)) = self.cuts.get_mut(&vertex) else {
            return Err(TreeError::NotCut(vertex));
        };
        if !at.is_finite() {
            return Err(TreeError::Plane { axis: *axis, at });
        }
        *plane = at;
        Ok(())
    }

    /// Gives all of an inner vertex to one of its two children, both leaves, so that the other one can be
    /// emptied before the two are merged.
    pub fn yield_to(&mut self, vertex: RegionId, heir: RegionId) -> Result<(), TreeError> {
        if !self.has_two_leaves(vertex) {
            return Err(TreeError::NotMergeable(vertex));
        }
        let (left, right) = vertex.children();
        match self.cuts.get_mut(&vertex) {
            Some((_, at)) if heir == left => *at = f64::INFINITY,
            Some((_, at)) if heir == right => *at = f64::NEG_INFINITY,
            _ => return Err(TreeError::NotMergeable(vertex)),
        }
        Ok(())
    }

    /// Makes an inner vertex with two leaves a leaf again.
    pub fn merge(&mut self, vertex: RegionId) -> Result<(), TreeError> {
        if !self.has_two_leaves(vertex) {
            return Err(TreeError::NotMergeable(vertex));
        }
        self.cuts.remove(&vertex);
        Ok(())
    }

    /// Applies these changes in order, or none of them.
    pub fn change(&mut self, changes: &[TreeChange]) -> Result<(), TreeError> {
        let mut changed = self.clone();
        changes.iter().try_for_each(|change| changed.change_unchecked(change))?;
        if !changed.is_sound() {
            return Err(TreeError::Crossed);
        }
        *self = changed;
        Ok(())
    }

    /// Applies one of several changes. Planes may cross until all are applied.
    pub(crate) fn change_unchecked(&mut self, change: &TreeChange) -> Result<(), TreeError> {
        match *change {
            TreeChange::Move { vertex, at } => self.move_plane(vertex, at),
            TreeChange::Split { leaf, axis, at } => self.split_at(leaf, axis, at).map(drop),
            TreeChange::Yield { vertex, heir } => self.yield_to(vertex, heir),
            TreeChange::Merge { vertex } => self.merge(vertex),
        }
    }

    /// Returns what becomes of the names of regions by a change of this tree, before it is made; `None` if
    /// all keep their names.
    pub fn renaming(&self, change: &TreeChange) -> Option<Renaming> {
        match *change {
            TreeChange::Split { leaf, .. } => {
                let (left, right) = leaf.children();
                Some(Renaming { from: leaf, to: left, born: Some(right), gone: None })
            }
            TreeChange::Merge { vertex } => {
                let (_, Yielding { heir, leaving }) = self.yielding().find(|(other, _)| *other == vertex)?;
                Some(Renaming { from: heir, to: vertex, born: None, gone: Some(leaving) })
            }
            TreeChange::Move { .. } | TreeChange::Yield { .. } => None,
        }
    }

    /// Returns the inner vertices that have one of their two regions being emptied, in id order, each with
    /// the region that takes over and the one that is emptied.
    pub fn yielding(&self) -> impl Iterator<Item = (RegionId, Yielding)> {
        self.cuts.iter().filter(|(_, (_, at))| at.is_infinite()).map(|(&vertex, &(_, at))| {
            let (left, right) = vertex.children();
            let (heir, leaving) = if at > 0.0 { (left, right) } else { (right, left) };
            (vertex, Yielding { heir, leaving })
        })
    }

    fn has_two_leaves(&self, vertex: RegionId) -> bool {
        // Ids from other processes may have no children.
        self.cuts.contains_key(&vertex) && {
            let (left, right) = vertex.children();
            self.is_leaf(left) && self.is_leaf(right)
        }
    }

    /// Returns whether the vertex is a region.
    pub fn is_leaf(&self, vertex: RegionId) -> bool {
        let has_parent = vertex.0 == 0 || self.cuts.contains_key(&parent(vertex));
        has_parent && !self.cuts.contains_key(&vertex)
    }

    /// Returns the number of regions.
    pub fn leaf_count(&self) -> usize {
        self.cuts.len() + 1
    }

    /// Returns the regions in id order. The position of a region here is its *rank*.
    pub fn leaves(&self) -> impl Iterator<Item = RegionId> {
        let mut leaves: Vec<_> = if self.cuts.is_empty() {
            vec![RegionId(0)]
        } else {
            self.cuts
                .keys()
                .flat_map(|&vertex| {
                    let (left, right) = vertex.children();
                    [left, right]
                })
                .filter(|&vertex| self.is_leaf(vertex))
                .collect()
        };
        leaves.sort_unstable();
        leaves.into_iter()
    }

    /// Returns the region whose cell contains the point: exactly one does.
    pub fn leaf_at(&self, point: [f64; 3]) -> RegionId {
        let mut vertex = RegionId(0);
        while let Some(&(axis, at)) = self.cuts.get(&vertex) {
            let (left, right) = vertex.children();
            vertex = if point[axis.index()] < at { left } else { right };
        }
        vertex
    }

    /// Returns the regions that the closed box touches, in id order.
    pub fn leaves_touching(&self, bounds: &Bounds) -> Vec<RegionId> {
        let mut found = Vec::new();
        let mut open = vec![RegionId(0)];
        while let Some(vertex) = open.pop() {
            let Some(&(axis, at)) = self.cuts.get(&vertex) else {
                found.push(vertex);
                continue;
            };
            let (left, right) = vertex.children();
            if bounds.min[axis.index()] < at {
                open.push(left);
            }
            if bounds.max[axis.index()] >= at {
                open.push(right);
            }
        }
        found.sort_unstable();
        found
    }

    /// Returns the half-open cell of any vertex. Outer faces lie at infinity.
    pub fn cell(&self, vertex: RegionId) -> Cell {
        let mut cell = Cell::EVERYWHERE;
        self.narrow(vertex, |axis, at, left| {
            let face = if left { &mut cell.max } else { &mut cell.min };
            face[axis.index()] = at;
        });
        cell
    }

    /// Returns the part of the world's bounds that the vertex covers: its cell within the bounds.
    pub fn part(&self, vertex: RegionId) -> Bounds {
        let mut part = self.bounds;
        self.narrow(vertex, |axis, at, left| {
            let i = axis.index();
            // The plane of a vertex that yields lies at infinity.
            let at = if at.is_infinite() { at.clamp(part.min[i], part.max[i]) } else { at };
            let face = if left { &mut part.max } else { &mut part.min };
            face[i] = at;
        });
        part
    }

    /// Returns the vertices that are cut, in id order.
    pub fn inner(&self) -> impl Iterator<Item = RegionId> {
        self.cuts.keys().copied()
    }

    /// Returns the cut of an inner vertex; `None` for a vertex that is not cut.
    pub fn cut_of(&self, vertex: RegionId) -> Option<(Axis, f64)> {
        self.cuts.get(&vertex).copied()
    }

    /// Returns the two children of an inner vertex: below its plane and above it.
    pub fn children_of(&self, vertex: RegionId) -> Option<(RegionId, RegionId)> {
        self.cuts.contains_key(&vertex).then(|| vertex.children())
    }

    /// Calls `narrow(axis, at, is_left)` for every cut on the way from the root to the vertex.
    fn narrow(&self, vertex: RegionId, mut narrow: impl FnMut(Axis, f64, bool)) {
        let mut path = Vec::new();
        let mut at = vertex;
        while at.0 != 0 {
            path.push(at);
            at = parent(at);
        }
        for &child in path.iter().rev() {
            if let Some(&(axis, plane)) = self.cuts.get(&parent(child)) {
                narrow(axis, plane, child == parent(child).children().0);
            }
        }
    }

    /// Returns the longest of these axes of a leaf (the first of equal ones), if the limits let the leaf be
    /// halved across it.
    fn longest_of(&self, leaf: RegionId, axes: &[Axis]) -> Option<Axis> {
        let size = self.part(leaf).size();
        let longer =
            |best: Axis, axis: Axis| if size[axis.index()] > size[best.index()] { axis } else { best };
        let axis = axes.iter().copied().reduce(longer)?;
        let may = depth(leaf) < self.limits.largest_depth
            && size[axis.index()] * 0.5 >= self.limits.smallest_edge_m;
        may.then_some(axis)
    }
}

/// Returns the vertex above this one, which must not be the root.
const fn parent(vertex: RegionId) -> RegionId {
    RegionId((vertex.0 - 1) / 2)
}

const fn depth(vertex: RegionId) -> u32 {
    (vertex.0 + 1).ilog2()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const WORLD: Bounds = Bounds::new([-8.0, 0.0, -4.0], [8.0, 8.0, 4.0]);

    /// A change that may be asked of a tree.
    #[derive(Clone, Debug)]
    enum Update {
        Split(usize),
        SplitAt(usize, usize, f64),
        Merge(usize),
    }

    fn update() -> impl Strategy<Value = Update> {
        let leaf = 0_usize..64;
        prop_oneof![
            leaf.clone().prop_map(Update::Split),
            (leaf, 0_usize..3, -9.0..9.0).prop_map(|(leaf, axis, at)| Update::SplitAt(leaf, axis, at)),
            (0_usize..64).prop_map(Update::Merge),
        ]
    }

    fn grown(updates: &[Update]) -> DistributionTree {
        let limits = Limits { smallest_edge_m: 0.25, largest_depth: 12, most_leaves: 40 };
        let mut tree = DistributionTree::new(WORLD, limits).unwrap();
        for update in updates {
            let leaves: Vec<_> = tree.leaves().collect();
            let leaf = |i: usize| leaves[i % leaves.len()];
            // A tree must stay as it was if it refuses a change.
            let _ = match *update {
                Update::Split(i) => tree.split(leaf(i)).map(drop),
                Update::SplitAt(i, axis, at) => tree.split_at(leaf(i), Axis::ALL[axis], at).map(drop),
                Update::Merge(i) if leaf(i).0 > 0 => tree.merge(parent(leaf(i))),
                Update::Merge(_) => Ok(()),
            };
        }
        tree
    }

    fn trees() -> impl Strategy<Value = DistributionTree> {
        prop::collection::vec(update(), 0..60).prop_map(|updates| grown(&updates))
    }

    /// Generates points in the world, on its planes, and far outside it.
    fn point() -> impl Strategy<Value = [f64; 3]> {
        let coordinate = prop_oneof![-20.0..20.0, (-8_i32..9).prop_map(f64::from), Just(-1e9), Just(1e9)];
        [coordinate.clone(), coordinate.clone(), coordinate]
    }

    proptest! {
        #[test]
        fn any_point_is_in_exactly_one_leaf(tree in trees(), point in point()) {
            let holders: Vec<_> = tree.leaves().filter(|&leaf| tree.cell(leaf).contains(point)).collect();
            prop_assert_eq!(holders, [tree.leaf_at(point)]);
        }

        #[test]
        fn the_parts_of_the_leaves_tile_the_world(tree in trees()) {
            let volume = |part: Bounds| part.size().iter().product::<f64>();
            let leaves: Vec<_> = tree.leaves().collect();
            let sum: f64 = leaves.iter().map(|&leaf| volume(tree.part(leaf))).sum();
            prop_assert!((sum - volume(WORLD)).abs() < 1e-6 * volume(WORLD), "{} of {}", sum, volume(WORLD));
            prop_assert!(leaves.iter().all(|&leaf| tree.part(leaf).size().iter().all(|&edge| edge > 0.0)));
            prop_assert_eq!(leaves.len(), tree.leaf_count());
            prop_assert!(tree.leaf_count() <= 40 && leaves.iter().all(|&leaf| depth(leaf) <= 12));
        }

        #[test]
        fn leaves_touching_a_box_are_those_whose_cell_it_touches(
            tree in trees(), a in point(), size in [0.0..6.0_f64, 0.0..6.0, 0.0..6.0],
        ) {
            let bounds = Bounds::new(a, std::array::from_fn(|i| a[i] + size[i]));
            let expected: Vec<_> = tree.leaves().filter(|&leaf| tree.cell(leaf).touches(&bounds)).collect();
            prop_assert_eq!(tree.leaves_touching(&bounds), expected);
        }

        #[test]
        fn the_tree_is_equal_on_every_member_after_the_same_updates(
            updates in prop::collection::vec(update(), 0..60),
        ) {
            let (one, other) = (grown(&updates), grown(&updates));
            prop_assert_eq!(&one, &other);
            prop_assert!(one.is_sound());
        }
    }

    #[test]
    fn trees_from_elsewhere_that_break_a_rule_are_not_sound() {
        let tree = DistributionTree::halved(WORLD, 8).unwrap();
        assert!(tree.is_sound());
        let with = |vertex: u32, at: f64| {
            let mut tree = tree.clone();
            tree.cuts.insert(RegionId(vertex), (Axis::X, at));
            tree.is_sound()
        };
        assert!(!with(u32::MAX, 0.0), "arithmetic on the id would overflow");
        assert!(!with(100, 0.0), "no parent");
        assert!(!with(1, 5.0), "outside its part");
        assert!(!with(0, 9.0), "outside the world");
        assert!(!with(0, f64::NAN));
    }

    #[test]
    fn halving_gives_every_count_and_ids_are_those_of_the_thesis() {
        for count in 1..=MAX_REGIONS {
            assert_eq!(DistributionTree::halved(WORLD, count).unwrap().leaf_count(), count);
        }
        let tree = DistributionTree::halved(WORLD, 2).unwrap();
        assert_eq!(tree.leaves().collect::<Vec<_>>(), [RegionId(1), RegionId(2)]);
        assert_eq!(tree.cut_of(RegionId(0)), Some((Axis::X, 0.0)), "across the longest axis");
        assert!(DistributionTree::halved(WORLD, MAX_REGIONS + 1).is_err());
    }

    #[test]
    fn halving_across_some_axes_leaves_the_others_whole() {
        let cube = Bounds::around([0.0; 3], [8.0; 3]);
        let tree = DistributionTree::halved_across(cube, 8, &[Axis::X, Axis::Z]).unwrap();
        assert!(tree.inner().all(|vertex| tree.cut_of(vertex).unwrap().0 != Axis::Y));
        let sizes: Vec<_> = tree.leaves().map(|leaf| tree.part(leaf).size()).collect();
        assert_eq!(sizes, [[4.0, 16.0, 8.0]; 8]);
        let thin = Bounds::new([0.0; 3], [2.0, 9.0, 9.0]);
        assert_eq!(DistributionTree::halved_across(thin, 3, &[Axis::X]), Err(TreeError::Limits(2)));
    }

    #[test]
    fn a_box_without_a_volume_is_refused() {
        let flat = Bounds::new([-4.0, 1.0, -4.0], [4.0, 1.0, 4.0]);
        let refused = DistributionTree::new(flat, Limits::default());
        assert_eq!(refused, Err(TreeError::Bounds(flat)));
    }
}
