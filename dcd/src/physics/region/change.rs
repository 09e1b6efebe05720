//! Lets a user change bodies and colliders in place, and updates a region's records of them.

use std::sync::{Arc, OnceLock};

use rapier3d::prelude::*;

use super::contacts::renew_contacts;
use super::urgency::is_delicate;
use super::{Moved, Region};
use crate::physics::outline::Outline;
use crate::physics::shapes::{ShapeError, ShapeLibrary};
use crate::physics::{convert, record};
use crate::protocol::{BodyKind, BodyTraits, ColliderRecord};

impl Region {
    /// Sets gravity, m/s².
    pub(in crate::physics) fn set_gravity(&mut self, gravity: [f32; 3]) {
        self.world.gravity = Vector::from_array(gravity);
    }

    /// Notes that a body may have changed or moved since the last step.
    pub(in crate::physics) fn touch(&mut self, handle: RigidBodyHandle) {
        self.moved.take();
        self.revision += 1;
        if self.touched.last() != Some(&handle) {
            self.touched.push(handle);
        }
    }

    /// Updates the broad phase for bodies that came or were put elsewhere since the last step, since controllers
    /// query it before the next one.
    pub(in crate::physics) fn find_moved(&mut self) {
        let touched = self.touched.clone();
        let PhysicsWorld { bodies, colliders, broad_phase, integration_parameters, .. } = self.world_mut();
        bodies.propagate_modified_body_positions_to_colliders(colliders);
        let moved = touched.iter().filter_map(|&handle| bodies.get(handle)).flat_map(RigidBody::colliders);
        for &handle in moved {
            let Some(collider) = colliders.get(handle).filter(|collider| collider.is_enabled()) else {
                continue;
            };
            let aabb = collider.compute_broad_phase_aabb(integration_parameters, bodies);
            broad_phase.set_aabb(integration_parameters, handle, aabb);
        }
    }

    /// Does the same as [`Region::touch`], but keeps `found`, the moved colliders that queries have
    /// collected, and updates this body's among them. Nothing else may have changed since they were
    /// collected.
    pub(super) fn touch_only(&mut self, handle: RigidBodyHandle, mut found: OnceLock<Box<Moved>>) {
        self.touch(handle);
        if let Some(found) = found.get_mut() {
            found.add(self, handle);
            found.measure(self);
        }
        self.moved = found;
    }

    /// Lets a user change the body in place, whole even if its mass is split. Reads its traits anew, and lets
    /// the coupling check it soon. A body that keeps its pose and stays enabled or disabled is not collected
    /// anew for queries, which ask Rapier for everything else.
    pub(in crate::physics) fn change<R>(
        &mut self,
        handle: RigidBodyHandle,
        change: impl FnOnce(&mut RigidBody) -> R,
    ) -> R {
        let place = |region: &Self| {
            let body = &region.world.bodies[handle];
            (*body.position(), body.is_enabled())
        };
        let (before, found) = (place(self), std::mem::take(&mut self.moved));
        let (was_asleep, kind) =
            (self.world.bodies[handle].is_sleeping(), self.world.bodies[handle].body_type());
        let velocity = self.world.bodies[handle].linvel();
        let result = self.change_unseen(handle, change);
        self.note_launch(handle, velocity);
        self.note_awake(handle, was_asleep);
        self.note_laid(handle);
        if !was_asleep && self.world.bodies[handle].is_sleeping() {
            self.put_to_sleep.push(handle);
        }
        if self.world.bodies[handle].is_enabled() != before.1 {
            self.wake_tied(handle);
            self.tie_anew(handle);
            self.enable_colliders(handle);
        }
        if (self.world.bodies[handle].is_enabled(), self.world.bodies[handle].body_type()) != (before.1, kind)
        {
            self.look_at_ties();
            self.note_appearance(handle);
        }
        if place(self) == before {
            self.moved = found;
        } else {
            self.note_appearance(handle);
            if self.slot(handle).traits.kind != BodyKind::Dynamic {
                self.wake_touching(handle);
            }
            self.touch_only(handle, found);
        }
        result
    }

    /// Wakes what joints tie to a body that has just been enabled or disabled, which Rapier does not.
    fn wake_tied(&mut self, handle: RigidBodyHandle) {
        let mut tied = Vec::new();
        self.for_each_pair(handle, |other, pair| {
            if pair.is_none() {
                tied.push(other);
            }
        });
        tied.into_iter().for_each(|other| self.wake(other));
    }

    /// Enables the colliders of a body that has just been enabled, and weighs it. Rapier would do so in the next
    /// step, and until then the body would have no mass to push.
    fn enable_colliders(&mut self, handle: RigidBodyHandle) {
        if !self.world.bodies[handle].is_enabled() {
            return;
        }
        self.change_colliders_whole(handle, |region| {
            let traits = Arc::clone(&region.slot(handle).traits);
            let PhysicsWorld { bodies, colliders, .. } = region.world_mut();
            let body = &mut bodies[handle];
            for (&collider, record) in body.colliders().iter().zip(&traits.colliders) {
                if record.enabled && !colliders[collider].is_enabled() {
                    let own = &mut colliders[collider];
                    // Rapier does not enable what its body disabled.
                    own.set_enabled(false);
                    own.set_enabled(true);
                }
            }
            body.recompute_mass_properties_from_colliders(colliders);
        });
    }

    /// Makes the change itself, on the whole body, without noting for queries that the body may have moved.
    fn change_unseen<R>(&mut self, handle: RigidBodyHandle, change: impl FnOnce(&mut RigidBody) -> R) -> R {
        self.unrefine(handle);
        // Under the proxy coupling a ghost of a dynamic body is kinematic in Rapier. Its user must not see
        // that.
        let ghost = self.world.bodies[handle].body_type();
        let is_ghost = self.slot(handle).traits.kind == BodyKind::Dynamic && ghost != RigidBodyType::Dynamic;
        if is_ghost {
            self.world.bodies[handle].set_body_type(RigidBodyType::Dynamic, false);
        }
        let result = self.change_whole(handle, change);
        if is_ghost && self.slot(handle).traits.kind == BodyKind::Dynamic {
            self.world.bodies[handle].set_body_type(ghost, false);
        }
        result
    }

    /// Reads a body's traits anew from Rapier.
    pub(in crate::physics) fn refresh(&mut self, handle: RigidBodyHandle) {
        self.due[handle.into_raw_parts().0 as usize] = 0;
        let old = &self.slot(handle).traits;
        let read = record::traits_of(&self.world.bodies[handle], old.colliders.clone());
        let same = read.kind == old.kind;
        let (character, vehicle) = (old.character.filter(|_| same), old.vehicle.clone().filter(|_| same));
        let new = BodyTraits { character, vehicle, ..read };
        if new != **old {
            self.targets.note(handle, new.kind);
            if new.character.is_none() {
                let id = self.slot(handle).id;
                self.characters.remove(&id);
            }
            if new.vehicle.is_none() {
                let id = self.slot(handle).id;
                self.vehicles.remove(&id);
            }
            self.slot_mut(handle).traits = Arc::new(new);
        }
    }

    /// Changes one collider of a body, and its record with it. Returns `None` if the body has no such
    /// collider. Refuses a shape that cannot be sent, and the loss of all mass; the collider then stays as it
    /// is.
    pub(in crate::physics) fn update_collider<R>(
        &mut self,
        handle: RigidBodyHandle,
        index: usize,
        shapes: &mut ShapeLibrary,
        change: impl FnOnce(&mut Collider) -> R,
    ) -> Option<Result<R, ShapeError>> {
        let collider = *self.world.bodies[handle].colliders().get(index)?;
        self.touch(handle);
        let (mut wakes, mut appears) = (false, false);
        let changed = self.change_colliders_whole(handle, |region| {
            let slot = region.slots[handle.into_raw_parts().0 as usize].as_mut().expect("a body held here");
            region.stirred = true;
            let PhysicsWorld { bodies, colliders, .. } = &mut *region.world;
            let own = &mut colliders[collider];
            let old = &slot.traits.colliders[index];
            // Change a copy: a change that is refused must leave no trace.
            let mut changed = own.clone();
            changed.set_contact_force_event_threshold(old.force_event_threshold_n);
            let result = change(&mut changed);
            let mut new = record::renewed(old, &changed);
            if !Arc::ptr_eq(&changed.shared_shape().0, &own.shared_shape().0) {
                new.shape = shapes.intern(changed.shared_shape())?;
            }
            let place = own.position_wrt_parent();
            if let Some(now) = changed.position_wrt_parent().filter(|&now| Some(now) != place) {
                new.pose = convert::pose_record(now);
            }
            wakes = (new.shape, new.pose, new.enabled) != (old.shape, old.pose, old.enabled);
            let meets = |own: &ColliderRecord| (own.sensor, own.collision_groups, own.solver_groups);
            appears = wakes || meets(&new) != meets(old);
            if new != *old {
                region.delicate -= usize::from(is_delicate(&slot.traits));
                let traits = Arc::make_mut(&mut slot.traits);
                let old = std::mem::replace(&mut traits.colliders[index], new);
                let new = &traits.colliders[index];
                let weighs = |own: &ColliderRecord| (own.shape, own.mass, own.enabled);
                let is_massless = weighs(&old) != weighs(new) && record::hangs(traits, shapes);
                if is_massless {
                    traits.colliders[index] = old;
                }
                region.delicate += usize::from(is_delicate(traits));
                if is_massless {
                    return Err(ShapeError::Massless);
                }
            }
            let tells = |own: &Collider| own.active_events().contains(ActiveEvents::COLLISION_EVENTS);
            let is_muted = tells(own) && !tells(&changed);
            let felt = |own: &Collider| (*own.material(), own.contact_skin(), own.active_collision_types());
            if felt(own) != felt(&changed) {
                renew_contacts(&mut changed);
            }
            let comes = changed.is_enabled() && !own.is_enabled();
            *own = changed;
            if comes && !bodies[handle].is_enabled() {
                // Has Rapier disable it for its body's sake.
                bodies[handle].set_enabled(true);
                bodies[handle].set_enabled(false);
            }
            let own = &mut colliders[collider];
            let of = (slot.id, index as u16);
            region.listener.name(own, collider, of, &slot.traits.colliders[index]);
            if is_muted {
                region.listener.mute(of, |(id, place)| {
                    let other = region.by_id.get(&id).and_then(|&other| bodies.get(other));
                    let other = other.and_then(|other| other.colliders().get(usize::from(place)));
                    other.and_then(|&other| colliders.get(other)).is_some_and(tells)
                });
            }
            let body = &mut bodies[handle];
            body.recompute_mass_properties_from_colliders(colliders);
            // Its skin may reach farther than before.
            slot.reach_m = record::reach_of(body, colliders, &slot.traits);
            slot.outline = Outline::of(body, colliders);
            region.due[handle.into_raw_parts().0 as usize] = 0;
            Ok(result)
        });
        // What it lay on, it may no longer touch.
        if wakes && changed.is_ok() {
            self.wake(handle);
        }
        if appears && changed.is_ok() {
            self.note_appearance(handle);
        }
        Some(changed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::{LocalWorld, WorldConfig};

    /// A body is born disabled, or is disabled later; it is enabled, and all else is done in the same tick.
    #[test]
    fn a_body_that_is_enabled_has_its_mass_and_its_colliders_at_once() {
        for is_born_disabled in [true, false] {
            let mut config = WorldConfig::default();
            config.step.gravity = [0.0; 3];
            let mut world = LocalWorld::new(config).unwrap();
            let body = RigidBodyBuilder::dynamic().enabled(!is_born_disabled);
            let id = world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(2.0)).unwrap();
            world.step().unwrap();
            world.update(id, |body| body.set_enabled(false)).unwrap();
            world.step().unwrap();
            world.update(id, |body| body.set_enabled(true)).unwrap();
            world.update(id, |body| body.apply_impulse(Vector::X * 6.0, true)).unwrap();
            world.update_collider(id, 0, |collider| collider.set_friction(0.9)).unwrap();
            let is_enabled =
                |world: &LocalWorld| world.host().record(id).unwrap().traits.colliders[0].enabled;
            assert!(is_enabled(&world));
            for _ in 0..2 {
                let (region, handle) = world.host().owned(id).unwrap();
                let body = &region.physics().bodies[handle];
                assert_eq!((body.mass(), body.linvel().x), (2.0, 3.0));
                world.step().unwrap();
            }
            // While its body is disabled, a collider is told as its user has it.
            world.update(id, |body| body.set_enabled(false)).unwrap();
            world.step().unwrap();
            for enabled in [false, true, false] {
                world.update_collider(id, 0, |collider| collider.set_enabled(enabled)).unwrap();
                assert_eq!(is_enabled(&world), enabled);
                world.step().unwrap();
            }
        }
    }

    /// Boxes fall beside a border and sleep. One of them is made to touch nothing any more.
    #[test]
    fn a_sleeper_at_a_border_that_its_program_makes_air_falls() {
        use crate::runtime::Partitioning;
        use crate::space::Axis;
        let mut hang = Vec::new();
        for (way, is_sensor) in [("sensor", true), ("groups", false)] {
            for place in -5..5_i16 {
                let cuts = vec![(Axis::Z, 0.0)];
                let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
                let mut world = LocalWorld::new(config).unwrap();
                let cube = |half: f32| ColliderBuilder::cuboid(half, 0.5, half);
                let at = |y: f32, z: f32| Vector::new(0.0, y, z);
                world.insert(RigidBodyBuilder::fixed().translation(at(-0.5, 0.0)), cube(20.0)).unwrap();
                let z = 0.2 * f32::from(place);
                let zone = RigidBodyBuilder::kinematic_position_based().translation(at(0.5, z));
                world.insert(zone, cube(1.2).sensor(true)).unwrap();
                let falls =
                    world.insert(RigidBodyBuilder::dynamic().translation(at(0.5, z)), cube(0.5)).unwrap();
                (0..200).for_each(|_| world.step().unwrap());
                assert!(world.body(falls).unwrap().is_sleeping());
                let change = |own: &mut Collider| match is_sensor {
                    true => own.set_sensor(true),
                    false => own.set_collision_groups(InteractionGroups::none()),
                };
                world.update_collider(falls, 0, change).unwrap();
                (0..60).for_each(|_| world.step().unwrap());
                if world.pose(falls).unwrap().translation[1] > 0.0 {
                    hang.push(format!("{way} at {z} m"));
                }
            }
        }
        assert!(hang.is_empty(), "{hang:?}");
    }
}
