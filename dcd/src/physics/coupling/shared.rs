//! Keeps, for each body that a region shares with others, the state of its copies: which regions hold it,
//! which copies have a part of the mass, and the states last sent and received.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use crate::physics::convert;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::Region;
use crate::protocol::{Check, CopyState, Impulse, Strike};
use crate::space::{RegionSet, mixed};

/// The members of a body that several regions hold, and the last states of its copies.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Shared {
    /// All regions that hold it as of the last exchange, this one included.
    pub members: RegionSet,
    /// The members that hold warm-up ghosts: copies without a part of the mass that follow the others, so
    /// that they have their contacts and their warm start when they come to count.
    pub warming: RegionSet,
    /// The other members' copies as last received, by rank.
    pub heard: Vec<(usize, CopyState)>,
    /// This region's copy after the last step.
    pub own: CopyState,
    /// The largest difference between the velocity of a warm-up ghost and the velocity that it follows, m/s.
    pub strayed_m_s: f32,
    /// The average difference of its first copy's velocity from the mean while its mass is split, m/s.
    pub lasting: Vector,
    /// Impulses on copies of it since the last exchange from bodies that are not held by the same regions,
    /// each with the rank of the region that found it.
    #[serde(skip)]
    pub strikes: Vec<(usize, Strike)>,
    /// The impulses of whole bodies on this copy since the last exchange, while its mass is split.
    #[serde(skip)]
    pub dealt: Dealt,
    /// The impulse on this copy after it was sent to a new member, which is still to be told.
    pub owed: Option<Strike>,
    /// Says whether the copy lies as it did when its owner found its contacts, and not where the body is; until the
    /// next exchange.
    pub displaced: bool,
    /// Says whether the copy that the others follow was awake at the last exchange.
    pub led_awake: bool,
    /// Ticks since its members or its warm-up ghosts changed.
    pub settled: u32,
    /// Ticks for which its island has included bodies of other regions.
    pub joined: u32,
    /// Ticks for which some member has had no reason to hold it.
    pub idle: u32,
}

/// The impulses of whole bodies on a copy with a part of its body's mass, in the steps since the last
/// exchange.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Dealt {
    pub all: Impulse,
    /// How much of that the other regions count.
    pub beyond: Impulse,
}

impl Shared {
    /// Returns whether its mass is split among several copies. Otherwise the owner's copy has all of it, and
    /// the others are ghosts.
    #[inline]
    pub(super) fn is_split(&self) -> bool {
        self.members.without(self.warming).len() > 1
    }

    /// Returns how many bodies of its island another region owns, as heard; none while its copy there sleeps.
    pub(super) fn awake_size_in(&self, rank: usize) -> Option<u16> {
        let (_, copy) = self.heard.iter().find(|(other, _)| *other == rank)?;
        (!copy.sleeping).then_some(copy.size)
    }

    /// Translates all ranks.
    fn remap_ranks(&mut self, ranks: &RankRemap) {
        (self.members, self.warming) = (ranks.set(self.members), ranks.set(self.warming));
        for copy in self.heard.iter_mut().map(|(_, copy)| copy).chain([&mut self.own]) {
            (copy.held_by, copy.rests_with) = (ranks.set(copy.held_by), ranks.set(copy.rests_with));
        }
        for (rank, _) in &mut self.heard {
            *rank = ranks.rank(*rank);
        }
        if let Some(strike) = &mut self.owed {
            strike.held_by = ranks.set(strike.held_by);
        }
        self.heard.sort_by_key(|(rank, _)| *rank);
    }
}

/// The [`Shared`] state of each body that several regions hold, by Rapier's handle.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct SharedBodies {
    /// The states of bodies, by Rapier's body index. An entry left by a removed body has another generation
    /// than the body that took its place.
    of: Vec<Option<(RigidBodyHandle, Box<Shared>)>>,
}

impl SharedBodies {
    /// Returns the state of one shared body; none while one region alone holds it.
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

    /// Forgets all copies of a region that is gone.
    pub(super) fn forget_region(&mut self, rank: usize) {
        for (_, shared) in self.of.iter_mut().flatten() {
            shared.heard.retain(|(other, _)| *other != rank);
        }
    }

    /// Forgets a body that only one region holds, or none any more.
    pub(super) fn forget(&mut self, handle: RigidBodyHandle) {
        if let Some(place) = self.of.get_mut(handle.into_raw_parts().0 as usize) {
            *place = None;
        }
    }

    /// Enters a body that this region has come to hold, or that is announced anew: no other region's copy has
    /// been received.
    pub(super) fn begin(&mut self, handle: RigidBodyHandle) {
        let shared = self.enter(handle);
        shared.heard.clear();
        shared.displaced = false;
    }

    /// Sets the members of a body and its warm-up ghosts. A body with one member is no longer shared.
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
            region.slot_mut(handle).led_by = None;
            region.undivide(handle);
            self.forget(handle);
        } else {
            region.split_mass_among(handle, members.without(warming));
        }
    }

    /// Translates all ranks. Forgets entries of bodies that are no longer here: they may name regions that no
    /// longer exist.
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

/// Reads a copy after a step: its state, and the force and torque of contacts and joints on it since the last exchange.
pub(super) fn read(region: &Region, handle: RigidBodyHandle, shared: &Shared, tick_s: f32) -> CopyState {
    let (slot, body) = (region.slot(handle), &region.physics().bodies[handle]);
    // A copy whose numbers cannot be sent is unsound, like one that Rapier has quarantined.
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
        still_s: body.activation().time_since_can_sleep,
        force_n: force.to_array(),
        torque_nm: torque.to_array(),
        sound: true,
        partners: if body.is_dynamic() && shared.is_split() { partners(region, handle) } else { 0 },
        ..CopyState::default()
    };
    if own.check().is_ok() { own } else { unsound }
}

/// Returns a hash of the ids of the bodies that press on this one and of its joints, independent of their
/// order.
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
