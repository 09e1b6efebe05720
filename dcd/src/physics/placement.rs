//! Chooses the first owner region of new bodies. Bodies that joints tie, or that may touch in the next tick, are placed as they would be
//! some ticks later: a small group whole, in the region where most of it lies.

use std::collections::BTreeSet;

use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use rapier3d::prelude::*;

use super::partition::Partition;
use super::record;
use super::settings::StepSettings;
use super::shapes::{ShapeError, ShapeLibrary};
use crate::protocol::{BodyKind, BodyRecord, ContactOffset, JointRecord};
use crate::space::{Bounds, PlaceGroups};

/// Bodies closer than this touch, metres.
const NEAR_M: f64 = 0.02;

/// The speed, metres per second, below which nobody misses a bounce.
const SLOW_M_S: f32 = 0.5;

/// The grouping by which new bodies are placed.
pub(super) struct Placement {
    /// `None` when each body is by itself.
    groups: Option<Groups>,
    /// The most bodies of a group that is kept whole.
    limit: usize,
    moves_islands: bool,
}

/// The groups of new bodies that belong together.
struct Groups {
    /// The first body of each body's group.
    group: Vec<u32>,
    /// The number of bodies of each group, by the group's first body.
    sizes: Vec<u32>,
    /// The first body of each body's multibody with all that is tied to it, or the body itself.
    assembly: Vec<u32>,
}

impl Placement {
    /// Groups bodies, which must be in id order. Only couplings that move islands group bodies that touch.
    pub(super) fn of(
        bodies: &[BodyRecord],
        joints: &[JointRecord],
        shapes: &ShapeLibrary,
        settings: &StepSettings,
    ) -> Result<Self, ShapeError> {
        let moves_islands = settings.coupling.moves_islands();
        let may_touch = bodies.len() > 1 && moves_islands;
        let groups = if joints.is_empty() && !may_touch {
            None
        } else {
            Some(Groups::of(bodies, joints, may_touch.then_some(shapes), settings.dt_s)?)
        };
        let limit = match settings.coupling {
            _ if moves_islands => settings.island_limit,
            coupling if coupling.shares_mass() => 1,
            _ => usize::MAX,
        };
        Ok(Self { groups, limit, moves_islands })
    }

    /// Returns the rank of the first owner of each body.
    pub(super) fn owners(&self, bodies: &[BodyRecord], partition: &Partition) -> Vec<usize> {
        let homes: Vec<_> =
            bodies.iter().map(|body| partition.rank_at(body.state.pose.translation)).collect();
        let Some(Groups { group, sizes, .. }) = &self.groups else { return homes };
        let mut votes = std::collections::BTreeMap::<(u32, usize), usize>::new();
        for (&group, &home) in group.iter().zip(&homes) {
            let size = sizes[group as usize] as usize;
            if size <= self.limit && size > 1 {
                *votes.entry((group, home)).or_default() += 1;
            }
        }
        let mut chosen = std::collections::BTreeMap::<u32, (usize, usize)>::new();
        for ((group, home), count) in votes {
            let best = chosen.entry(group).or_insert((home, count));
            // Among equals the lowest rank wins, since ranks come in order.
            if count > best.1 {
                *best = (home, count);
            }
        }
        let home = |(body, group): (usize, &u32)| chosen.get(group).map_or(homes[body], |(rank, _)| *rank);
        self.together(group.iter().enumerate().map(home).collect())
    }

    /// Gives all bodies of a multibody the owner of its first body.
    pub(super) fn together(&self, owners: Vec<usize>) -> Vec<usize> {
        let Some(Groups { assembly, .. }) = &self.groups else { return owners };
        assembly.iter().map(|&first| owners[first as usize]).collect()
    }

    /// Returns for each body whether its island is small and has one owner, so that nothing from beyond a
    /// border touches it in the next tick. This is never known of a kinematic body: what it may meet is not
    /// in its group.
    pub(super) fn whole(&self, bodies: &[BodyRecord], owners: &[usize]) -> Vec<bool> {
        let Some(islands) = self.groups.as_ref().filter(|_| self.moves_islands) else {
            return vec![false; owners.len()];
        };
        let mut whole: Vec<_> = islands.sizes.iter().map(|&size| size as usize <= self.limit).collect();
        for (body, &first) in islands.group.iter().enumerate() {
            let is_moved = bodies[body].traits.kind == BodyKind::Dynamic;
            whole[first as usize] &= is_moved && owners[body] == owners[first as usize];
        }
        islands.group.iter().map(|&first| whole[first as usize]).collect()
    }
}

impl Groups {
    /// Groups bodies that joints tie and, if `shapes` are given, bodies that may touch within `ahead_s`
    /// seconds.
    fn of(
        bodies: &[BodyRecord],
        joints: &[JointRecord],
        shapes: Option<&ShapeLibrary>,
        ahead_s: f32,
    ) -> Result<Self, ShapeError> {
        let mut groups = PlaceGroups::new(bodies.len());
        for joint in joints {
            if let [Some(a), Some(b)] = movable_ends(joint, bodies) {
                groups.join(a, b);
            }
        }
        if let Some(shapes) = shapes {
            join_touching(bodies, shapes, ahead_s, &mut groups)?;
        }
        let group: Vec<_> = (0..bodies.len()).map(|body| groups.root(body) as u32).collect();
        let mut sizes = vec![0; bodies.len()];
        for &root in &group {
            sizes[root as usize] += 1;
        }
        Ok(Self { group, sizes, assembly: articulated(bodies, joints) })
    }
}

/// Returns the places of the two bodies of a joint in a list in id order; `None` for a fixed body, which is
/// tied to nothing, and for a body that is not in the list.
pub(super) fn movable_ends(joint: &JointRecord, bodies: &[BodyRecord]) -> [Option<usize>; 2] {
    [joint.a, joint.b].map(|id| {
        let place = bodies.binary_search_by_key(&id, |body| body.id).ok()?;
        (bodies[place].traits.kind != BodyKind::Fixed).then_some(place)
    })
}

/// Returns for each body the first body of its multibody with all that is tied to that; a body without a
/// multibody is by itself.
fn articulated(bodies: &[BodyRecord], joints: &[JointRecord]) -> Vec<u32> {
    if joints.iter().all(|joint| joint.link.is_none()) {
        return (0..bodies.len() as u32).collect();
    }
    let mut groups = PlaceGroups::new(bodies.len());
    let mut linked = vec![false; bodies.len()];
    for joint in joints {
        let ends = movable_ends(joint, bodies);
        if let [Some(a), Some(b)] = ends {
            groups.join(a, b);
        }
        if joint.link.is_some() {
            ends.into_iter().flatten().for_each(|end| linked[end] = true);
        }
    }
    let roots: Vec<_> = (0..bodies.len()).map(|body| groups.root(body) as u32).collect();
    let mut whole = vec![false; bodies.len()];
    for (&root, linked) in roots.iter().zip(linked) {
        whole[root as usize] |= linked;
    }
    roots
        .iter()
        .enumerate()
        .map(|(body, &root)| if whole[root as usize] { root } else { body as u32 })
        .collect()
}

fn join_touching(
    bodies: &[BodyRecord],
    shapes: &ShapeLibrary,
    ahead_s: f32,
    groups: &mut PlaceGroups,
) -> Result<(), ShapeError> {
    let mut boxes = Vec::new();
    for (index, body) in bodies.iter().enumerate() {
        if body.traits.kind == BodyKind::Dynamic {
            let bounds = record::bounds_of(body, shapes)?.grown(0.5 * NEAR_M);
            let bounds = bounds.swept(body.state.velocity.linear, ahead_s.into());
            boxes.push((index, bounds));
        }
    }
    join_overlapping(&boxes, groups);
    Ok(())
}

/// Returns which of these bodies may be inserted where they lay when their contacts were found: dynamic
/// bodies in a group that touches, if all of the group are known to have had contacts and have the same
/// owner.
pub(super) fn standing(
    bodies: &[BodyRecord],
    owners: &[usize],
    shapes: &ShapeLibrary,
) -> Result<Vec<bool>, ShapeError> {
    let mut boxes = Vec::new();
    for (index, body) in bodies.iter().enumerate().filter(|(_, body)| body.traits.kind == BodyKind::Dynamic) {
        boxes.push((index, record::bounds_of(&lying(body), shapes)?));
    }
    let mut groups = PlaceGroups::new(bodies.len());
    join_overlapping(&boxes, &mut groups);
    let mut stands = vec![true; bodies.len()];
    for (index, _) in &boxes {
        let root = groups.root(*index);
        stands[root] &= lies(&bodies[*index]) && owners[*index] == owners[root];
    }
    let mut standing = vec![false; bodies.len()];
    boxes.iter().for_each(|(index, _)| standing[*index] = stands[groups.root(*index)]);
    Ok(standing)
}

/// Lets bodies that are placed anew find their contacts where they are, under their loads, if nobody knows
/// how they lay when these were found. Bodies that may be about to bounce are left out: those that bounce
/// themselves, and moving ones if anything else that is placed bounces. Bodies that joints tie are left out
/// too, whatever was known of them before the joints came: they are not solved without these.
pub(super) fn note_standing(bodies: &mut [BodyRecord], joints: &[JointRecord]) {
    let tied: BTreeSet<_> = joints.iter().flat_map(|joint| [joint.a, joint.b]).collect();
    let bounces = |body: &BodyRecord| body.traits.colliders.iter().any(|collider| collider.restitution > 0.0);
    let any_bounces = bodies.iter().any(bounces);
    for body in bodies.iter_mut().filter(|body| body.traits.kind == BodyKind::Dynamic) {
        if tied.contains(&body.id) {
            body.state.contact_offset = None;
            continue;
        }
        let is_slow = Vector::from_array(body.state.velocity.linear).length() < SLOW_M_S;
        if !bounces(body) && (is_slow || !any_bounces) {
            body.state.contact_offset.get_or_insert_default();
        }
    }
}

/// Returns whether a body is known to have had contacts.
pub(super) fn lies(body: &BodyRecord) -> bool {
    body.state.contact_offset.is_some()
}

/// Returns a body in the pose in which it lay when its contacts were found.
pub(super) fn lying(body: &BodyRecord) -> BodyRecord {
    let mut lying = body.clone();
    // Rounding would turn a body that is not turned.
    if let Some(offset) = body.state.contact_offset.filter(|offset| *offset != ContactOffset::default()) {
        lying.state.pose = offset.applied_to(&body.state.pose);
    }
    lying
}

fn join_overlapping(boxes: &[(usize, Bounds)], groups: &mut PlaceGroups) {
    let Some(all) = boxes.iter().map(|(_, bounds)| *bounds).reduce(|a, b| a.union(&b)) else { return };
    let origin = if all.is_finite() { all.centre() } else { [0.0; 3] };
    let aabb = |bounds: &Bounds| {
        let local =
            |corner: [f64; 3]| Vector::from_array(std::array::from_fn(|i| (corner[i] - origin[i]) as f32));
        Aabb::new(local(bounds.min), local(bounds.max))
    };
    let leaves = boxes.iter().map(|(_, bounds)| aabb(bounds)).enumerate();
    let bvh = Bvh::from_iter(BvhBuildStrategy::Binned, leaves);
    for (index, bounds) in boxes {
        for leaf in bvh.intersect_aabb(&aabb(bounds)) {
            groups.join(*index, boxes[leaf as usize].0);
        }
    }
}
