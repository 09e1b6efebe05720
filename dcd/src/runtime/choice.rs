//! Chooses the regions of a world whose user asked for none: one region, or more if its bodies lie too far
//! apart for f32.

use crate::physics::Coupling;
use crate::scene::Scene;
use crate::space::{Axis, Bounds, DistributionTree, MAX_REGIONS, RegionId, TreeError};
use rapier3d::prelude::RigidBodyType;

/// The largest distance of a region's bodies from the middle of their extent, metres: f32 resolves 1 mm
/// there.
const REACH_M: f64 = 16_384.0;

/// The regions, threads and coupling that a world is computed with, and the reason for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Choice {
    /// The number of regions at present.
    pub regions: usize,
    /// The largest number of threads that step the world at a time.
    pub threads: usize,
    /// The coupling of the regions; without effect while there is one region.
    pub coupling: Coupling,
    /// The reason for the number of regions.
    pub why: Why,
}

/// The reason for the number of regions of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Why {
    /// The user or the scene asked for them.
    Asked,
    /// Nobody asked for any: one region is exact, and all threads work in it.
    Exact,
    /// Nobody asked for any, and the bodies lie too far apart for one region's f32 to resolve millimetres.
    Spread,
    /// Nobody asked for any: the world began with one region, and its balance splits and merges regions.
    Balance,
    /// They are the regions of the snapshot that the world was restored from.
    Saved,
}

impl std::fmt::Display for Why {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.write_str(match self {
            Self::Asked => "asked for",
            Self::Exact => "one region is exact, and all threads work in it",
            Self::Spread => "bodies lie too far apart for the f32 of one region",
            Self::Balance => "from one region on, the balance decides",
            Self::Saved => "as it was saved",
        })
    }
}

/// Returns the distribution tree of a world whose user asked for no cut: one region, unless the movable
/// bodies lie too far apart for that. Then each cut goes through the widest gap near the middle of the bodies
/// it divides.
pub(super) fn tree_for(scene: &Scene, bounds: Bounds) -> Result<DistributionTree, TreeError> {
    let movable = scene.bodies.iter().filter(|body| body.body.body_type != RigidBodyType::Fixed);
    let mut tree = DistributionTree::halved(bounds, 1)?;
    let mut groups: Vec<(RegionId, Vec<[f64; 3]>)> =
        vec![(RegionId(0), movable.map(|body| body.pose.translation).collect())];
    while let Some((leaf, places)) = groups.pop() {
        let Some((axis, at)) = cut_between(&places) else { continue };
        if tree.leaf_count() == MAX_REGIONS {
            break;
        }
        // Bodies outside the box that is cut stay with those at its edge.
        let Ok((left, right)) = tree.split_at(leaf, axis, at) else { continue };
        let (below, above) = places.into_iter().partition(|place| place[axis.index()] < at);
        groups.extend([(left, below), (right, above)]);
    }
    Ok(tree)
}

/// Returns the plane through the widest gap in the middle half of these places, across the axis of their
/// largest extent; `None` if they lie near enough to one another.
fn cut_between(places: &[[f64; 3]]) -> Option<(Axis, f64)> {
    let around = places.iter().map(|&place| Bounds::new(place, place)).reduce(|all, one| all.union(&one))?;
    let extent = |axis: Axis| around.max[axis.index()] - around.min[axis.index()];
    let axis = [Axis::X, Axis::Y, Axis::Z].into_iter().max_by(|&a, &b| extent(a).total_cmp(&extent(b)))?;
    if extent(axis) <= 2.0 * REACH_M {
        return None;
    }
    let middle = 0.5 * (around.min[axis.index()] + around.max[axis.index()]);
    let (lowest, highest) = (middle - 0.25 * extent(axis), middle + 0.25 * extent(axis));
    let mut along: Vec<_> = places.iter().map(|place| place[axis.index()].clamp(lowest, highest)).collect();
    along.sort_by(f64::total_cmp);
    let widest = along.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
    Some((axis, 0.5 * (widest[0] + widest[1])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_cut_apart_only_beyond_what_f32_bears() {
        let row = |step_m: f64| (0..10).map(|i| [f64::from(i) * step_m, 0.0, 5.0]).collect::<Vec<_>>();
        assert_eq!(cut_between(&[]), None);
        assert_eq!(cut_between(&row(3_640.0)), None, "32.8 km from end to end");
        assert_eq!(cut_between(&row(4_000.0)).map(|(axis, _)| axis), Some(Axis::X));
        let towns = [[-30_000.0, 0.0, 0.0], [-29_000.0, 0.0, 0.0], [9_000.0, 0.0, 0.0], [10_000.0, 0.0, 0.0]];
        let (axis, at) = cut_between(&towns).unwrap();
        assert!(axis == Axis::X && (-29_000.0..9_000.0).contains(&at), "{at}");
    }

    #[test]
    fn equal_places_end_the_cutting() {
        let pair = [[-40_000.0, 0.0, 0.0], [40_000.0, 0.0, 0.0]];
        let (_, at) = cut_between(&pair).unwrap();
        assert_eq!(at, 0.0);
        assert_eq!(cut_between(&pair[..1]), None);
    }
}
