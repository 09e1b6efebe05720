//! Inserts bodies into a region and removes them, and keeps its lists of owned and shared bodies and of ghosts.

use std::sync::Arc;

use rapier3d::prelude::*;

use super::characters::Walking;
use super::urgency::is_delicate;
use super::vehicles::Driving;
use super::{BodyRef, Ownership, Region, Slot, floating_origin};
use crate::physics::outline::Outline;
use crate::physics::shapes::{ShapeError, ShapeLibrary};
use crate::physics::{convert, record};
use crate::protocol::{BodyKind, BodyRecord, JointRecord};
use crate::space::{BodyId, Epoch, RegionSet};

impl Region {
    /// Inserts a body that is not held here yet, with this ownership. Takes the body by value: each clone of
    /// its shared parts that is made and dropped on the way would cost two atomic operations.
    pub(in crate::physics) fn insert(
        &mut self,
        body: BodyRecord,
        role: Ownership,
        holders: RegionSet,
        shapes: &ShapeLibrary,
    ) -> Result<RigidBodyHandle, ShapeError> {
        let like = self.newest_like(&body).map(|like| (like.reach_m, like.outline.clone()));
        if like.is_none() {
            for collider in &body.traits.colliders {
                shapes.look_at(collider.shape)?;
            }
        }
        self.stirred = true;
        let found = std::mem::take(&mut self.moved);
        let bodies = &mut self.world.bodies;
        let handle = bodies.insert(record::body_builder(&body, self.anchor));
        record::finish_body(&mut bodies[handle], &body);
        let before = self.by_id.insert(body.id, handle);
        assert!(before.is_none(), "{} is already held by {}", body.id, self.id);
        for (place, record) in body.traits.colliders.iter().enumerate() {
            let collider = record::collider_builder(record, shapes)
                .expect("it has been looked at, or one like it is here");
            let world = &mut *self.world;
            let collider = world.colliders.insert_with_parent(collider, handle, &mut world.bodies);
            let inserted = &mut world.colliders[collider];
            if role == Ownership::Immovable {
                floating_origin::fetch_plane(inserted, &body.state.pose, self.anchor);
            }
            self.listener.name(inserted, collider, (body.id, place as u16), record);
        }
        if body.traits.extra_mass.is_some() || body.traits.colliders.iter().any(|collider| !collider.enabled)
        {
            // Until it steps, Rapier leaves out the extra mass and counts disabled colliders.
            let PhysicsWorld { bodies, colliders, .. } = &mut *self.world;
            bodies[handle].recompute_mass_properties_from_colliders(colliders);
        }
        self.targets.note(handle, body.traits.kind);
        if body.traits.character.is_some() {
            self.characters.insert(body.id, Walking::new(body.state.gait.unwrap_or_default()));
        }
        self.delicate += usize::from(is_delicate(&body.traits));
        if role == Ownership::Immovable {
            self.immovable = None;
        }
        if body.traits.vehicle.is_some() {
            self.vehicles.insert(body.id, Driving::new(body.state.drive.unwrap_or_default()));
        }
        let (reach_m, outline) = like.unwrap_or_else(|| {
            let PhysicsWorld { bodies, colliders, .. } = &*self.world;
            let own = &bodies[handle];
            (record::reach_of(own, colliders, &body.traits), Outline::of(own, colliders))
        });
        let index = handle.into_raw_parts().0 as usize;
        if self.slots.len() <= index {
            self.slots.resize_with(index + 1, || None);
            self.due.resize(index + 1, 0);
        }
        self.due[index] = 0;
        self.slots[index] = Some(Slot {
            id: body.id,
            epoch: body.epoch,
            role,
            holders,
            traits: body.traits,
            reach_m,
            outline,
            joints: Vec::new(),
            assembly: None,
            led_by: None,
            told_asleep: body.state.sleeping,
            confirmed: true,
            mass_split: None,
            whole: false,
            doubt: 0,
            away: (0, 0),
            asleep_at: (body.state.sleeping)
                .then(|| convert::region_from_world(self.anchor, &body.state.pose)),
        });
        if self.slot(handle).traits.kind != BodyKind::Dynamic {
            self.obstacles.push(handle);
        }
        match role {
            _ if body.state.sleeping => self.turnover.born_asleep.push(handle),
            Ownership::Immovable => {}
            _ => self.turnover.born_awake.push(handle),
        }
        let link = BodyRef { id: body.id, handle };
        if !holders.is_empty() || matches!(role, Ownership::Ghost { .. }) {
            self.list(link);
        }
        if role == Ownership::Owner {
            self.fresh.push(link);
        }
        if !self.waiting.is_empty() {
            let tied = |joint: &JointRecord| joint.a == body.id || joint.b == body.id;
            for joint in self.waiting.values().filter(|joint| tied(joint)).cloned().collect::<Vec<_>>() {
                self.insert_joint(&joint);
            }
        }
        self.touch_only(handle, found);
        Ok(handle)
    }

    /// Returns one of this region's newest own bodies that shares its traits with this one: both reach
    /// equally far.
    pub(in crate::physics) fn newest_like(&self, body: &BodyRecord) -> Option<&Slot> {
        let newest = self.fresh.iter().rev().take(record::LIKE).filter_map(|link| self.slot_at(link.handle));
        newest.into_iter().find(|slot| Arc::ptr_eq(&slot.traits, &body.traits))
    }

    /// Removes a body, with its joints. Returns whether it was held here.
    pub(in crate::physics) fn remove(&mut self, id: BodyId) -> bool {
        let Some(handle) = self.by_id.remove(&id) else { return false };
        if self.slot(handle).assembly.is_some() {
            self.note_retied(handle);
        }
        // Most bodies have no joints, and need no search.
        if self.is_jointed(handle) || !self.waiting.is_empty() {
            let joints: Vec<_> = self.joints_of(handle).collect();
            for joint in &joints {
                self.remove_joint(joint.id);
            }
            // A joint whose other body is still held here waits for this one.
            joints.iter().for_each(|joint| self.insert_joint(joint));
        }
        self.forget_retied(id);
        self.listener.forget(id);
        self.delicate -= usize::from(is_delicate(&self.slot(handle).traits));
        if self.slot(handle).role == Ownership::Immovable {
            self.immovable = None;
        }
        self.targets.forget(handle);
        self.characters.remove(&id);
        self.vehicles.remove(&id);
        self.spins.remove(&id);
        self.moved.take();
        self.remove_from_rapier(handle);
        self.slots[handle.into_raw_parts().0 as usize] = None;
        self.unlist(id);
        true
    }

    /// Removes a body that its user takes out of the world, and wakes what it touched. Returns whether it was held here.
    pub(in crate::physics) fn take_away(&mut self, id: BodyId) -> bool {
        if let Some(&handle) = self.by_id.get(&id) {
            self.wake_touching(handle);
        }
        self.remove(id)
    }

    /// Removes a body that other regions go on to hold. What lies beside it goes on to sleep, or to fall asleep:
    /// Rapier would wake it, as if the body were gone from the world.
    pub(in crate::physics) fn give_up(&mut self, id: BodyId) {
        let Some(handle) = self.handle_of(id) else { return };
        let mut beside = Vec::new();
        self.for_each_pair(handle, |other, pair| {
            if pair.is_some() {
                beside.push(other);
            }
        });
        if !beside.is_empty() {
            self.turnover.departed.extend(self.world.bodies[handle].colliders());
            self.turnover.left.extend(beside);
        }
        self.without_waking_ends(|region| _ = region.remove(id));
    }

    /// Sets the owner, the other holders and the epoch of a body that is held here.
    pub(in crate::physics) fn set_role(
        &mut self,
        handle: RigidBodyHandle,
        role: Ownership,
        holders: RegionSet,
        epoch: Epoch,
    ) {
        let slot = self.slot_mut(handle);
        assert!(epoch >= slot.epoch, "{} would go back from epoch {} to {epoch}", slot.id, slot.epoch);
        (slot.role, slot.epoch) = (role, epoch);
        slot.asleep_at = None;
        slot.told_asleep = false;
        self.due[handle.into_raw_parts().0 as usize] = 0;
        self.set_holders(handle, holders);
        self.relink(handle);
    }

    /// Sets which other regions hold a body.
    pub(in crate::physics) fn set_holders(&mut self, handle: RigidBodyHandle, holders: RegionSet) {
        self.touch(handle);
        let slot = self.slot_mut(handle);
        slot.holders = holders;
        let link = BodyRef { id: slot.id, handle };
        if !self.is_listed(link) {
            self.unlist(link.id);
            self.list(link);
        }
    }

    /// Forgets who holds what, after membership has changed. The holders of this region's bodies must be
    /// announced again, and so must the ghosts here, which may no longer be valid.
    pub(in crate::physics) fn forget_holders(&mut self) {
        self.fresh.clear();
        self.targets.reset();
        // What sleeps outside the cell may not have been handed over yet.
        self.passed_over = true;
        for BodyRef { id, handle } in self.links() {
            let holders = self.slot(handle).holders;
            let was_shared = self.mass_split(handle).is_some();
            if was_shared {
                self.undivide(handle);
                self.set_holders(handle, RegionSet::EMPTY);
                self.slot_mut(handle).told_asleep = false;
            }
            let slot = self.slot_mut(handle);
            match slot.role {
                Ownership::Owner => {
                    slot.holders = if was_shared { holders } else { RegionSet::EMPTY };
                    self.fresh.push(BodyRef { id, handle });
                }
                Ownership::Ghost { .. } => slot.confirmed = false,
                Ownership::Immovable => {}
            }
        }
        self.shared.clear();
    }

    /// Returns whether a body that other regions hold too is in the list where it belongs.
    fn is_listed(&self, link: BodyRef) -> bool {
        let slot = self.slot(link.handle);
        let list = match slot.role {
            Ownership::Owner if !slot.holders.is_empty() => &self.shared,
            Ownership::Ghost { .. } => &self.ghosts,
            _ => return false,
        };
        let place = list.binary_search_by_key(&link.id, |other| other.id);
        place.is_ok_and(|place| list[place].handle == link.handle)
    }

    /// Puts a body on the list of its ownership: shared bodies or ghosts.
    pub(in crate::physics) fn list(&mut self, link: BodyRef) {
        let slot = self.slot(link.handle);
        let list = match slot.role {
            Ownership::Owner if !slot.holders.is_empty() => &mut self.shared,
            Ownership::Ghost { .. } => &mut self.ghosts,
            _ => return,
        };
        if let Err(place) = list.binary_search_by_key(&link.id, |other| other.id) {
            list.insert(place, link);
        }
    }

    pub(in crate::physics) fn unlist(&mut self, id: BodyId) {
        for list in [&mut self.shared, &mut self.ghosts] {
            if let Ok(place) = list.binary_search_by_key(&id, |other| other.id) {
                list.remove(place);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::WorldPose;
    use crate::space::{Bounds, Cell, RegionId};

    #[test]
    fn bodies_that_are_gone_again_are_announced_to_nobody() {
        let part = Bounds::around([0.0; 3], [10.0; 3]);
        let mut region = Region::new(RegionId(0), 0, Cell::EVERYWHERE, &part, [0.0; 3]);
        let mut shapes = ShapeLibrary::default();
        let mut insert = |region: &mut Region, index: u32| {
            let (body, collider) = (RigidBodyBuilder::dynamic().build(), ColliderBuilder::ball(0.5));
            let body =
                shapes.describe(BodyId::persistent(index), WorldPose::at([0.0; 3]), &body, &[collider]);
            region.insert(body.unwrap(), Ownership::Owner, RegionSet::EMPTY, &shapes).unwrap();
        };
        for index in 0..4 {
            insert(&mut region, index);
        }
        for gone in [1, 0, 3] {
            assert!(region.remove(BodyId::persistent(gone)));
        }
        insert(&mut region, 1);
        // Body 1 is a new one in Rapier, perhaps in the former one's slot.
        let fresh: Vec<_> = region.take_fresh().iter().map(|link| link.id).collect();
        assert_eq!(fresh, [2, 1].map(BodyId::persistent));
        assert!(region.take_fresh().is_empty());
    }
}
