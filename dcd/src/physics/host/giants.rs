//! Finds islands of the whole world that are too large to move whole, so that planes of the tree can keep out
//! of them.

use std::collections::BTreeMap;
use std::sync::Arc;

use rapier3d::prelude::*;

use crate::physics::coupling::Side;
use crate::physics::region::{Ownership, Region};
use crate::protocol::BodyKind;
use crate::space::{BodyId, Bounds, Burden, PlaceGroups, RegionId};

/// The islands with more bodies than a limit: bodies that touch or are tied, awake or asleep, in whatever
/// regions.
#[derive(Debug, Default)]
pub(super) struct Giants {
    /// The AABB of each, in world space.
    pub boxes: Vec<Bounds>,
    /// The place in `boxes` of each body's island.
    members: BTreeMap<BodyId, usize>,
    /// Their sleeping bodies, in id order: they are no load, and lie where planes keep out.
    pub asleep: Vec<Burden>,
}

/// The large islands of a host as they were last found. While nothing has changed since, nothing is searched.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownGiants {
    limit: usize,
    /// The revisions of the regions then.
    revisions: Vec<(RegionId, u64)>,
    found: Arc<Giants>,
}

impl KnownGiants {
    /// Returns the islands with more bodies than a limit.
    pub(super) fn find(&mut self, sides: &[Side], limit: usize) -> Arc<Giants> {
        let revisions = || sides.iter().map(|side| (side.region.id(), side.region.revision()));
        if self.limit != limit || !self.revisions.iter().copied().eq(revisions()) {
            self.found = Arc::new(Giants::find(sides, limit));
            (self.limit, self.revisions) = (limit, revisions().collect());
        }
        Arc::clone(&self.found)
    }

    /// Forgets the islands, since regions come or go.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl Giants {
    fn find(sides: &[Side], limit: usize) -> Self {
        #[cfg(test)]
        tests::SEARCHES.set(tests::SEARCHES.get() + 1);
        let mut bodies: Vec<_> = sides
            .iter()
            .enumerate()
            .flat_map(|(place, Side { region, .. })| {
                let owned = region.bodies().filter(move |(_, role, handle, _)| {
                    *role == Ownership::Owner && is_part(region, *handle)
                });
                owned.map(move |(id, _, handle, _)| (id, place, handle))
            })
            .collect();
        if bodies.len() <= limit {
            return Self::default();
        }
        bodies.sort_unstable_by_key(|&(id, ..)| id);
        let mut groups = PlaceGroups::new(bodies.len());
        for Side { region, .. } in sides {
            join(region, |id| bodies.binary_search_by_key(&id, |&(id, ..)| id).ok(), &mut groups);
        }
        let mut sizes = vec![0; bodies.len()];
        (0..bodies.len()).for_each(|body| sizes[groups.root(body)] += 1);
        let mut giants = Self::default();
        let mut of_root = vec![None; bodies.len()];
        for (body, &(id, place, handle)) in bodies.iter().enumerate() {
            let root = groups.root(body);
            if sizes[root] > limit {
                let region = &sides[place].region;
                let bounds = region.world_bounds(handle);
                let island = *of_root[root].get_or_insert_with(|| {
                    giants.boxes.push(bounds);
                    giants.boxes.len() - 1
                });
                giants.boxes[island] = giants.boxes[island].union(&bounds);
                giants.members.insert(id, island);
                if region.physics().bodies[handle].is_sleeping() {
                    let place = region.centre_of(handle);
                    giants.asleep.push(Burden { place, weight: 0.0, island: Some(island) });
                }
            }
        }
        giants
    }

    /// Returns the large island that a body is part of.
    pub(super) fn of(&self, body: BodyId) -> Option<usize> {
        self.members.get(&body).copied()
    }
}

/// Joins the bodies that touch or are tied in a region.
fn join(region: &Region, place_of: impl Fn(BodyId) -> Option<usize>, groups: &mut PlaceGroups) {
    let world = region.physics();
    let mut places: Vec<Option<usize>> = Vec::new();
    for (id, _, handle, _) in region.bodies().filter(|(_, _, handle, _)| is_part(region, *handle)) {
        let index = handle.into_raw_parts().0 as usize;
        places.resize(places.len().max(index + 1), None);
        places[index] = place_of(id);
    }
    let place = |handle: RigidBodyHandle| places.get(handle.into_raw_parts().0 as usize).copied().flatten();
    for pair in world.contact_pairs().filter(|pair| pair.has_any_active_contact()) {
        let parent = |collider| place(world.colliders.get(collider)?.parent()?);
        if let (Some(a), Some(b)) = (parent(pair.collider1), parent(pair.collider2)) {
            groups.join(a, b);
        }
    }
    for (a, b) in region.ties() {
        if let (Some(a), Some(b)) = (place_of(a), place_of(b)) {
            groups.join(a, b);
        }
    }
}

/// Returns whether a body can be part of an island: contacts can move it.
fn is_part(region: &Region, handle: RigidBodyHandle) -> bool {
    region.slot(handle).traits.kind == BodyKind::Dynamic
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::physics::host::RegionHost;
    use crate::physics::{Partition, StepSettings, joint_record};
    use crate::protocol::{Velocity, WorldPose};
    use crate::space::{Axis, DistributionTree, JointId, Load};

    thread_local! {
        pub(super) static SEARCHES: Cell<usize> = const { Cell::new(0) };
    }

    /// Makes a host with 300 sleeping boxes side by side, tied to one another, across a border or beside it.
    fn row(cut: f64) -> RegionHost {
        let tree = DistributionTree::cut_by(Bounds::around([0.0; 3], [200.0; 3]), &[(Axis::X, cut)]).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let settings = StepSettings { island_limit: 256, ..StepSettings::default() };
        let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
        let floor = (RigidBodyBuilder::fixed(), [0.0, -0.5, 0.0], [200.0, 0.5, 200.0]);
        let boxes =
            (0..300).map(|i| (RigidBodyBuilder::dynamic(), [f64::from(i) - 149.5, 0.5, 0.0], [0.5; 3]));
        let records = std::iter::once(floor).chain(boxes).zip(0..).map(|((body, at, [x, y, z]), id)| {
            let (id, collider) = (BodyId::persistent(id), ColliderBuilder::cuboid(x, y, z));
            host.shapes_mut().describe(id, WorldPose::at(at), &body.build(), &[collider]).unwrap()
        });
        let records = records.collect();
        let rope = RopeJointBuilder::new(2.0).build().into();
        let ties = (1..300_u32).map(|i| {
            joint_record(JointId(i.into()), BodyId::persistent(i), BodyId::persistent(i + 1), &rope)
        });
        host.insert(records, &ties.collect::<Vec<_>>()).unwrap();
        for _ in 0..240 {
            host.step().unwrap();
        }
        assert!(host.awake_bodies().is_empty());
        host
    }

    /// Returns how many bodies are part of large islands, and whether a search was made.
    fn look(host: &mut RegionHost) -> (usize, bool) {
        let before = SEARCHES.get();
        let found = host.burdens(Load::Counts);
        let searched = SEARCHES.get() > before;
        host.giants.forget();
        assert_eq!(host.burdens(Load::Counts), found, "as if nothing were remembered");
        (found.0.iter().filter(|burden| burden.island.is_some()).count(), searched)
    }

    #[test]
    fn large_islands_that_sleep_are_looked_for_once_and_again_when_anything_has_changed() {
        for cut in [0.0, -180.0] {
            let mut host = row(cut);
            assert_eq!(look(&mut host), (300, true));
            for _ in 0..40 {
                host.step().unwrap();
            }
            assert_eq!(look(&mut host), (300, false), "cut at {cut}");
            host.steer(BodyId::persistent(1), &Velocity::linear([0.0, 0.0, 0.5]));
            host.step().unwrap();
            assert!(look(&mut host).1);
            host.remove(BodyId::persistent(300));
            assert_eq!(look(&mut host), (299, true));
        }
    }
}
