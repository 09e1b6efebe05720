//! What a region knows of the copies of a body that it shares with others: who holds it, which copies count, and what was heard
//! and told of them last.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use crate::physics::convert;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::Region;
use crate::protocol::{Check, CopyState};
use crate::space::{RegionSet, mixed};

/// What a region knows of a body that it shares with others.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Shared {
    /// All that hold it as of the last exchange, this region too.
    pub members: RegionSet,
    /// Those of them whose copies do not count: they follow the others', to have their contacts when they come to count.
    pub warming: RegionSet,
    /// The other members' copies as last heard, by rank.
    pub heard: Vec<(usize, CopyState)>,
    /// This region's copy after the last step.
    pub own: CopyState,
    /// Whether it has followed the others since it came to be held here. What came as its owner had it may be other than what all
    /// agreed on in that exchange, so what becomes of it in the first step is nobody's word.
    pub followed: bool,
    /// Rank of the region whose word stood in the last exchange, unless the body is split.
    pub led_by: Option<usize>,
    /// How far the velocities of warming were from what they follow, m/s; told to the owner.
    pub strayed_m_s: f32,
    /// Averaged difference of its first copy's velocity from the mean while it is split, m/s.
    pub lasting: Vector,
    /// Ticks since members changed.
    pub settled: u32,
    /// Ticks for which bodies of other regions have belonged to its island.
    pub joined: u32,
    /// Ticks for which some member has had no reason to be one.
    pub idle: u32,
}

impl Shared {
    /// Whether several copies count, each with its share of the mass; else the owner's does, and the others are ghosts of it.
    pub(super) fn is_split(&self) -> bool {
        self.members.without(self.warming).len() > 1
    }

    /// Ranks have changed.
    fn remap_ranks(&mut self, ranks: &RankRemap) {
        (self.members, self.warming) = (ranks.set(self.members), ranks.set(self.warming));
        for (rank, _) in &mut self.heard {
            *rank = ranks.rank(*rank);
        }
        self.heard.sort_by_key(|(rank, _)| *rank);
        self.led_by = self.led_by.and_then(|rank| ranks.to[rank]);
    }
}

/// What is known of each body that several regions hold, by Rapier's handle.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct SharedBodies {
    /// By Rapier's body index. What is left of a body that is no more has another generation than its successor.
    of: Vec<Option<(RigidBodyHandle, Box<Shared>)>>,
}

impl SharedBodies {
    /// Of one body; none while one region alone holds it.
    #[inline]
    pub(super) fn get(&self, handle: RigidBodyHandle) -> Option<&Shared> {
        let (of, shared) = self.of.get(handle.into_raw_parts().0 as usize)?.as_ref()?;
        (*of == handle).then_some(shared)
    }

    #[inline]
    pub(super) fn get_mut(&mut self, handle: RigidBodyHandle) -> Option<&mut Shared> {
        let (of, shared) = self.of.get_mut(handle.into_raw_parts().0 as usize)?.as_mut()?;
        (*of == handle).then_some(shared)
    }

    fn enter(&mut self, handle: RigidBodyHandle) -> &mut Shared {
        let index = handle.into_raw_parts().0 as usize;
        if self.of.len() <= index {
            self.of.resize_with(index + 1, || None);
        }
        let place = &mut self.of[index];
        if place.as_ref().is_none_or(|(of, _)| *of != handle) {
            *place = Some((handle, Box::default()));
        }
        &mut place.as_mut().expect("just entered").1
    }

    /// One region alone holds the body, or none any more.
    pub(super) fn forget(&mut self, handle: RigidBodyHandle) {
        if let Some(place) = self.of.get_mut(handle.into_raw_parts().0 as usize) {
            *place = None;
        }
    }

    /// A body has come to be held here, or is announced anew: no copies of others have been heard.
    pub(super) fn begin(&mut self, handle: RigidBodyHandle) {
        let shared = self.enter(handle);
        shared.followed = false;
        shared.heard.clear();
    }

    /// Makes these regions the members. A body with one member is shared no more.
    pub(super) fn set_members(
        &mut self,
        region: &mut Region,
        handle: RigidBodyHandle,
        members: RegionSet,
        warming: RegionSet,
    ) {
        let shared = self.enter(handle);
        if (shared.members, shared.warming) != (members, warming) {
            (shared.settled, shared.joined, shared.idle) = (0, 0, 0);
            shared.heard.retain(|(rank, _)| members.contains(*rank));
            region.slot_mut(handle).told_asleep = false;
        }
        (shared.members, shared.warming) = (members, warming);
        let own = RegionSet::only(region.rank());
        region.set_holders(handle, members.without(own));
        if members.len() == 1 {
            region.undivide(handle);
            self.forget(handle);
        } else {
            region.split_mass_among(handle, members.without(warming));
        }
    }

    /// Ranks have changed. Forgets what is left of bodies that are here no more: it may speak of regions that are none either.
    pub(super) fn remap_ranks(&mut self, region: &Region, ranks: &RankRemap) {
        for place in &mut self.of {
            if place.as_ref().is_some_and(|(handle, _)| !region.physics().bodies.contains(*handle)) {
                *place = None;
            } else if let Some((_, shared)) = place {
                shared.remap_ranks(ranks);
            }
        }
    }
}

/// Reads a copy after a step: its state, and what contacts and joints pressed on it since the last exchange.
pub(super) fn read(region: &Region, handle: RigidBodyHandle, shared: &Shared, tick_s: f32) -> CopyState {
    let (slot, body) = (region.slot(handle), &region.physics().bodies[handle]);
    // What cannot be told says nothing, as a copy that Rapier has set aside.
    let unsound = CopyState { id: slot.id, ..CopyState::default() };
    if region.mass_split(handle).is_some_and(|mass_split| mass_split.is_broken()) {
        return unsound;
    }
    let before = (Vector::from_array(shared.own.force_n), Vector::from_array(shared.own.torque_nm));
    let (force, torque) = region.strain(handle, before, tick_s);
    let own = CopyState {
        id: slot.id,
        pose: convert::world_from_region(region.anchor(), body.position()),
        velocity: convert::velocity_of(body),
        sleeping: body.is_sleeping(),
        force_n: force.to_array(),
        torque_nm: torque.to_array(),
        sound: true,
        partners: if body.is_dynamic() && shared.is_split() { partners(region, handle) } else { 0 },
        ..CopyState::default()
    };
    if own.check().is_ok() { own } else { unsound }
}

/// A hash of the names of the bodies that press on this one or are tied to it, the same in whatever order they come.
fn partners(region: &Region, handle: RigidBodyHandle) -> u64 {
    let world = region.physics();
    let mut hash = 0u64;
    for &collider in world.bodies[handle].colliders() {
        for pair in world.narrow_phase.contact_pairs_with(collider) {
            if !pair.has_any_active_contact() || pair.total_impulse_magnitude() == 0.0 {
                continue;
            }
            let other = if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
            let parent = world.colliders.get(other).and_then(Collider::parent);
            if let Some((id, _)) = parent.and_then(|parent| region.role_of(parent)) {
                hash = hash.wrapping_add(mixed(id.bits().wrapping_add(1)));
            }
        }
    }
    for joint in &region.slot(handle).joints {
        hash = hash.wrapping_add(mixed(!joint.0));
    }
    hash
}
