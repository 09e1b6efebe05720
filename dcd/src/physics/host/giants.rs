//! Finds islands of the whole world that are too large to move whole, so that planes of the tree can keep out of them.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use crate::physics::coupling::Side;
use crate::physics::region::{Ownership, Region};
use crate::protocol::BodyKind;
use crate::space::{BodyId, Bounds, PlaceGroups};

/// The islands with more bodies than a limit: bodies that touch or are tied, awake or asleep, in whatever regions.
#[derive(Debug, Default)]
pub(super) struct Giants {
    /// The AABB of each, in world space.
    pub boxes: Vec<Bounds>,
    /// The island that a body is part of.
    members: BTreeMap<BodyId, usize>,
}

impl Giants {
    pub(super) fn find(sides: &[Side], limit: usize) -> Self {
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
                let bounds = sides[place].region.world_bounds(handle);
                let island = *of_root[root].get_or_insert_with(|| {
                    giants.boxes.push(bounds);
                    giants.boxes.len() - 1
                });
                giants.boxes[island] = giants.boxes[island].union(&bounds);
                giants.members.insert(id, island);
            }
        }
        giants
    }

    /// Returns the large island that a body is part of.
    pub(super) fn of(&self, body: BodyId) -> Option<usize> {
        self.members.get(&body).copied()
    }

    /// Returns all bodies of large islands, in id order.
    pub(super) fn members(&self) -> impl Iterator<Item = (BodyId, usize)> {
        self.members.iter().map(|(&id, &island)| (id, island))
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
