//! Visits the neighbours of a body: bodies that it may touch, touches, or is tied to by joints. Makes Rapier find
//! contacts anew that it would take over though a user changed what they depend on.

use rapier3d::prelude::*;

use super::mass_splitting::MassSplit;
use super::{BodyRef, Ownership, Region, Slot};
use crate::space::RegionSet;

impl Region {
    /// Visits every movable body that is near enough to touch this one or to overlap it as a sensor, or that
    /// joints tie to it. Some may come twice.
    pub(in crate::physics) fn for_each_neighbour(
        &self,
        handle: RigidBodyHandle,
        mut visit: impl FnMut(RigidBodyHandle),
    ) {
        self.for_each_pair(handle, |other, _| visit(other));
        for &collider in self.world.bodies[handle].colliders() {
            for (first, second, _) in self.world.narrow_phase.intersection_pairs_with(collider) {
                let other = if first == collider { second } else { first };
                self.movable_parent(handle, other).into_iter().for_each(&mut visit);
            }
        }
    }

    /// Visits every movable body that is near enough to touch this one or that joints tie to it, with whether
    /// it does touch it (true for joints). Some may come twice.
    pub(in crate::physics) fn for_each_contact(
        &self,
        handle: RigidBodyHandle,
        mut visit: impl FnMut(RigidBodyHandle, bool),
    ) {
        let touches = |pair: Option<&ContactPair>| pair.is_none_or(ContactPair::has_any_active_contact);
        self.for_each_pair(handle, |other, pair| visit(other, touches(pair)));
    }

    /// Returns the dynamic bodies that hang together with one, itself among them: those that touch, and that joints
    /// tie to one another. `None` if they are more than `most`.
    pub(in crate::physics) fn in_touch(&self, link: BodyRef, most: usize) -> Option<Vec<BodyRef>> {
        let mut all = vec![link];
        let mut next = 0;
        while let Some(BodyRef { handle, .. }) = all.get(next).copied() {
            next += 1;
            self.for_each_contact(handle, |other, touches| {
                if touches
                    && self.world.bodies[other].is_dynamic()
                    && all.len() <= most
                    && all.iter().all(|known| known.handle != other)
                {
                    all.push(BodyRef { id: self.slot(other).id, handle: other });
                }
            });
        }
        (all.len() <= most).then_some(all)
    }

    /// Returns whether a body is in a sensor, or something in one of its own.
    pub(in crate::physics) fn is_sensed(&self, handle: RigidBodyHandle) -> bool {
        let is_in = |&collider: &ColliderHandle| {
            let mut pairs = self.world.narrow_phase.intersection_pairs_with(collider);
            pairs.any(|(_, _, intersects)| intersects)
        };
        self.world.bodies[handle].colliders().iter().any(is_in)
    }

    /// Returns whether this region's contacts of a body with another one, or with what is fixed, are those
    /// that moved the body. They are those of the region that leads the body if that holds the other one, and
    /// otherwise those of the region that reports them ([`Region::teller`]).
    pub(in crate::physics) fn solves(&self, handle: RigidBodyHandle, other: Option<RigidBodyHandle>) -> bool {
        let Some(slot) = self.slot_at(handle) else { return false };
        let other = other.and_then(|other| self.slot_at(other));
        // The leading region may have dropped the body since.
        let leader = slot.led_by.filter(|&rank| self.holders_of_both(slot, other).contains(rank));
        leader.or_else(|| self.teller(slot, other)) == Some(self.rank)
    }

    /// Returns the rank of the region that reports what happens between a body and another one, or what is
    /// fixed: the owner of the first if it holds the other, else the owner of the other if it holds the
    /// first, else the lowest rank that holds both. `None` for an immovable body.
    pub(super) fn teller(&self, slot: &Slot, other: Option<&Slot>) -> Option<usize> {
        let both = self.holders_of_both(slot, other);
        let owner = self.owner_of(slot)?;
        let owners = [Some(owner), other.and_then(|other| self.owner_of(other))];
        owners.into_iter().flatten().find(|&rank| both.contains(rank)).or_else(|| both.iter().next())
    }

    fn holders_of_both(&self, slot: &Slot, other: Option<&Slot>) -> RegionSet {
        other.map_or(RegionSet::ALL, |other| self.holders_of(other)).intersection(self.holders_of(slot))
    }

    /// Returns the regions that hold a body, as far as this one knows; all regions if it does not know, as of
    /// a ghost in couplings without consensus.
    fn holders_of(&self, slot: &Slot) -> RegionSet {
        match self.owner_of(slot) {
            None => RegionSet::ALL,
            Some(owner) if owner != self.rank && slot.holders.is_empty() => RegionSet::ALL,
            Some(owner) => slot.holders.union([owner, self.rank].into_iter().collect()),
        }
    }

    fn owner_of(&self, slot: &Slot) -> Option<usize> {
        match slot.role {
            Ownership::Immovable => None,
            Ownership::Owner => Some(self.rank),
            Ownership::Ghost { owner } => Some(owner),
        }
    }

    /// Visits the same bodies as [`Region::for_each_contact`], with the pair of colliders unless a joint ties
    /// the two.
    pub(in crate::physics) fn for_each_pair(
        &self,
        handle: RigidBodyHandle,
        mut visit: impl FnMut(RigidBodyHandle, Option<&ContactPair>),
    ) {
        for &collider in self.world.bodies[handle].colliders() {
            for pair in self.world.narrow_phase.contact_pairs_with(collider) {
                let other = if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
                if let Some(other) = self.movable_parent(handle, other) {
                    visit(other, Some(pair));
                }
            }
        }
        for &joint in &self.slot(handle).joints {
            if let Some((a, b)) = self.joint_ends(joint) {
                let other = if a == handle { b } else { a };
                if self.is_movable(other) {
                    visit(other, None);
                }
            }
        }
    }

    /// Returns the bodies held here that joints tie to this one.
    pub(in crate::physics) fn tied_to(
        &self,
        handle: RigidBodyHandle,
    ) -> impl Iterator<Item = RigidBodyHandle> {
        let ends = self.slot(handle).joints.iter().filter_map(|&joint| self.joint_ends(joint));
        ends.map(move |(a, b)| if a == handle { b } else { a })
    }

    /// Returns whether a joint holds the body or anything touches it, immovable bodies included.
    pub(in crate::physics) fn is_pressed(&self, handle: RigidBodyHandle) -> bool {
        let touches = |&collider: &ColliderHandle| {
            let mut pairs = self.world.narrow_phase.contact_pairs_with(collider);
            pairs.any(ContactPair::has_any_active_contact)
        };
        self.is_jointed(handle) || self.world.bodies[handle].colliders().iter().any(touches)
    }

    /// Returns whether one contact alone moves a body: it touches one collider by one of its own, and no joint
    /// holds it.
    pub(in crate::physics) fn is_touched_once(&self, handle: RigidBodyHandle) -> bool {
        let pairs = |&collider: &ColliderHandle| self.world.narrow_phase.contact_pairs_with(collider);
        let all = self.world.bodies[handle].colliders().iter().flat_map(pairs);
        let touching = all.filter(|pair| pair.has_any_active_contact()).take(2).count();
        touching == 1 && !self.is_jointed(handle)
    }

    /// Returns whether a body touches something that no contact moves.
    pub(in crate::physics) fn is_grounded(&self, handle: RigidBodyHandle) -> bool {
        let rests_on = |pair: &ContactPair| {
            [pair.collider1, pair.collider2].into_iter().any(|collider| {
                let parent = self.world.colliders.get(collider).and_then(Collider::parent);
                parent.is_none_or(|parent| !self.world.bodies[parent].is_dynamic())
            })
        };
        let touches = |&collider: &ColliderHandle| {
            let mut pairs = self.world.narrow_phase.contact_pairs_with(collider);
            pairs.any(|pair| pair.has_any_active_contact() && rests_on(pair))
        };
        self.world.bodies[handle].colliders().iter().any(touches)
    }

    /// Returns whether a joint ties a body to something that no contact moves.
    pub(in crate::physics) fn is_tied_down(&self, handle: RigidBodyHandle) -> bool {
        self.tied_to(handle).any(|other| !self.world.bodies[other].is_dynamic())
    }

    /// Returns whether anything is near enough to a body to touch it, or a joint ties it.
    pub(in crate::physics) fn may_collide(&self, handle: RigidBodyHandle) -> bool {
        let is_near = |&collider: &ColliderHandle| {
            self.world.narrow_phase.contact_pairs_with(collider).next().is_some()
        };
        self.is_jointed(handle) || self.world.bodies[handle].colliders().iter().any(is_near)
    }

    /// Returns whether a body can be audited, that is, computed apart from the region with what it touches.
    /// It must be no link of a multibody nor tied to one, no character or vehicle, and have all of its mass
    /// here.
    pub(in crate::physics) fn is_auditable(&self, handle: RigidBodyHandle) -> bool {
        let slot = self.slot(handle);
        let is_driven = slot.traits.character.is_some() || slot.traits.vehicle.is_some();
        !is_driven
            && !self.is_articulated(handle)
            && !slot.mass_split.as_deref().is_some_and(MassSplit::is_split)
    }

    fn movable_parent(&self, of: RigidBodyHandle, other: ColliderHandle) -> Option<RigidBodyHandle> {
        let parent = self.world.colliders.get(other).and_then(Collider::parent);
        parent.filter(|&parent| parent != of && self.is_movable(parent))
    }

    fn is_movable(&self, handle: RigidBodyHandle) -> bool {
        self.role_of(handle).is_some_and(|(_, role)| role != Ownership::Immovable)
    }

    /// Makes the next step find the contacts of two bodies anew ([`renew_contacts`]), if any of their colliders are
    /// near one another.
    pub(super) fn renew_contacts_between(&mut self, ends: [Option<RigidBodyHandle>; 2]) {
        let [Some(a), Some(b)] = ends else { return };
        let mut near = Vec::new();
        for &collider in self.world.bodies[a].colliders() {
            let is_near = |pair: &ContactPair| {
                let other = if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
                self.world.colliders.get(other).and_then(Collider::parent) == Some(b)
            };
            near.extend(
                self.world.narrow_phase.contact_pairs_with(collider).any(is_near).then_some(collider),
            );
        }
        for collider in near {
            renew_contacts(&mut self.world_mut().colliders[collider]);
        }
    }
}

/// Makes the next step find all contacts of a collider anew. Rapier takes the contacts of what has hardly moved
/// over from the step before. It does not notice that the material, the skin or the collision types have changed,
/// nor that a joint now lets the two bodies collide or no longer does.
pub(super) fn renew_contacts(collider: &mut Collider) {
    // Rapier marks only groups that differ from those before.
    let (groups, none) = (collider.collision_groups(), InteractionGroups::none());
    let other = if groups == none { InteractionGroups::all() } else { none };
    collider.set_collision_groups(other);
    collider.set_collision_groups(groups);
}
