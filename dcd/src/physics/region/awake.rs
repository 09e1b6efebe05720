//! Finds the bodies of a region that do not sleep, at a cost that depends on their number alone, not on that
//! of all bodies.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Ownership, Region};
use crate::space::JointId;

/// The bodies that Rapier's list of active bodies does not have right, since they were woken or put to sleep between steps.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct ChangedSleep {
    /// Bodies that were woken since the last step by what changed them.
    #[serde(skip)]
    roused: Vec<RigidBodyHandle>,
    /// Bodies with joints that were put to sleep among bodies that are awake.
    laid: Vec<RigidBodyHandle>,
}

impl Region {
    /// Returns the bodies that do not sleep, in no order and some more than once. Rapier's list of active
    /// bodies lacks those that were inserted or woken since its last step. It also lacks those that Rapier
    /// does not step: a disabled body does not sleep.
    pub(in crate::physics) fn awake(&self) -> impl Iterator<Item = RigidBodyHandle> {
        let stepped = self.world.islands.active_bodies();
        let others = self.touched.iter().chain(&self.changed_sleep.roused).chain(self.unstepped.values());
        stepped.chain(others.copied()).filter(|&handle| {
            #[cfg(test)]
            LOOKS.set(LOOKS.get() + 1);
            self.world.bodies.get(handle).is_some_and(|body| !body.is_sleeping())
        })
    }

    /// Returns the joints of the bodies that do not sleep, some more than once.
    pub(in crate::physics) fn awake_joints(&self) -> impl Iterator<Item = JointId> {
        self.awake().filter_map(|handle| self.slot_at(handle)).flat_map(|slot| slot.joints.iter().copied())
    }

    /// Returns the region's own bodies that do not sleep, each once.
    pub(in crate::physics) fn own_awake(&self) -> Vec<RigidBodyHandle> {
        let owned = |handle: &RigidBodyHandle| {
            self.slot_at(*handle).is_some_and(|slot| slot.role == Ownership::Owner)
        };
        let mut awake: Vec<_> = self.awake().filter(owned).collect();
        awake.sort_unstable_by_key(|handle| handle.into_raw_parts());
        awake.dedup();
        awake
    }

    /// Notes that a body may have woken, or may have become one that Rapier does not step. A body that Rapier
    /// disables in a step does not sleep after that.
    pub(super) fn note_awake(&mut self, handle: RigidBodyHandle, was_asleep: bool) {
        let Some(body) = self.world.bodies.get(handle) else { return };
        if was_asleep && !body.is_sleeping() {
            self.changed_sleep.roused.push(handle);
        }
        let (is_stepped, index) = (body.is_enabled() && !body.is_fixed(), handle.into_raw_parts().0);
        let can_move = self.slot_at(handle).is_some_and(|slot| slot.role != Ownership::Immovable);
        if can_move && !is_stepped {
            self.unstepped.insert(index, handle);
        } else {
            self.unstepped.remove(&index);
        }
    }

    /// Wakes a body.
    pub(in crate::physics) fn wake(&mut self, handle: RigidBodyHandle) {
        let was_asleep = self.world.bodies[handle].is_sleeping();
        let PhysicsWorld { islands, bodies, .. } = self.world_mut();
        islands.wake_up(bodies, handle, true);
        self.note_awake(handle, was_asleep);
    }

    /// Wakes what its user has put to sleep since the last step, if it touches or is tied to what is awake. Seen
    /// with Rapier 0.36.1: such a body goes on to move, and nothing holds it.
    fn wake_sleepers_among_awake(&mut self) {
        let put_to_sleep = std::mem::take(&mut self.put_to_sleep);
        let sleeps =
            |handle: &RigidBodyHandle| self.world.bodies.get(*handle).is_some_and(RigidBody::is_sleeping);
        let of = |handle: RigidBodyHandle| handle.into_raw_parts();
        let mut asleep: BTreeMap<_, _> =
            put_to_sleep.into_iter().filter(sleeps).map(|one| (of(one), one)).collect();
        let mut woken: Vec<_> =
            asleep.values().copied().filter(|&handle| self.is_among_awake(handle)).collect();
        while let Some(handle) = woken.pop() {
            if asleep.remove(&of(handle)).is_some() {
                self.wake(handle);
                // Those that are woken wake others.
                self.for_each_contact(handle, |other, touches| {
                    if touches && asleep.contains_key(&of(other)) {
                        woken.push(other);
                    }
                });
            }
        }
    }

    /// Wakes what a body touches, or joints tie to it, when its user takes it away or changes it. Rapier would do so in the
    /// next step, and what is made to sleep there might sleep on.
    pub(in crate::physics) fn wake_touching(&mut self, handle: RigidBodyHandle) {
        let mut touching = Vec::new();
        self.for_each_contact(handle, |other, touches| {
            if touches {
                touching.push(other);
            }
        });
        touching.into_iter().for_each(|other| self.wake(other));
    }

    fn is_among_awake(&self, handle: RigidBodyHandle) -> bool {
        let mut is_among = false;
        self.for_each_contact(handle, |other, touches| {
            let other = &self.world.bodies[other];
            is_among |= touches && !other.is_fixed() && other.is_enabled() && !other.is_sleeping();
        });
        is_among
    }

    /// Empties the lists of touched and woken bodies when a step begins: after it, Rapier's list has all that
    /// it steps.
    pub(super) fn hand_awake_over(&mut self) {
        self.wake_sleepers_among_awake();
        self.wake_what_is_hit();
        for place in 0..self.touched.len() {
            self.note_awake(self.touched[place], false);
        }
        self.touched.clear();
        self.changed_sleep.roused.clear();
    }

    /// Notes a body with joints that has been put to sleep, perhaps among bodies that are awake.
    pub(super) fn note_laid(&mut self, handle: RigidBodyHandle) {
        let is_tied = self.slot_at(handle).is_some_and(|slot| !slot.joints.is_empty());
        if is_tied && self.world.bodies[handle].is_sleeping() {
            self.changed_sleep.laid.push(handle);
        }
    }

    /// Makes Rapier choose anew in this step which joints it solves, if its list of active bodies has one
    /// that sleeps, or that slept before the last step. Seen with Rapier 0.36.1: a body that Rapier itself
    /// wakes there, as by a contact, has no joints until another choice is made.
    pub(super) fn choose_joints(&mut self) {
        if self.changed_sleep.laid.is_empty() {
            return;
        }
        let mut laid = std::mem::take(&mut self.changed_sleep.laid);
        laid.sort_unstable_by_key(|handle| handle.into_raw_parts());
        laid.dedup();
        for &handle in &laid {
            // A mutable reference counts as a change.
            self.world.bodies.get_mut(handle);
        }
        let is_laid = |handle: RigidBodyHandle| {
            laid.binary_search_by_key(&handle.into_raw_parts(), |laid| laid.into_raw_parts()).is_ok()
        };
        let sleeps = |handle| self.world.bodies.get(handle).is_some_and(RigidBody::is_sleeping);
        let active = self.world.islands.active_bodies();
        self.changed_sleep.laid = active.filter(|&handle| is_laid(handle) && sleeps(handle)).collect();
    }

    /// Finds the awake bodies that are not on Rapier's list, after the region was restored from a snapshot.
    pub(in crate::physics) fn find_awake(&mut self) {
        let stepped: BTreeSet<_> =
            self.world.islands.active_bodies().map(RigidBodyHandle::into_raw_parts).collect();
        for link in self.links() {
            self.note_awake(link.handle, !stepped.contains(&link.handle.into_raw_parts()));
        }
    }
}

#[cfg(test)]
thread_local! {
    pub(super) static LOOKS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
    pub(super) static PAIRS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
impl Region {
    /// Returns how many bodies this thread has looked at so far to find those that sleep or not, and how many
    /// contacts.
    pub(crate) fn looks() -> (usize, usize) {
        (LOOKS.get(), PAIRS.get())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::physics::host::RegionHost;
    use crate::physics::{Coupling, Partition, StepSettings};
    use crate::protocol::{Velocity, WorldPose};
    use crate::space::{Axis, BodyId, Bounds, DistributionTree};

    /// Makes a host with `count` boxes on each side of a border, asleep on one floor.
    fn sleepers(count: u32) -> RegionHost {
        let bounds = Bounds::around([0.0; 3], [100.0, 20.0, 20.0]);
        let tree = DistributionTree::cut_by(bounds, &[(Axis::X, 0.0)]).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let mut host = RegionHost::new(partition, StepSettings::default(), 1, &leaves).unwrap();
        let floor = (0, RigidBodyBuilder::fixed(), [0.0, -0.5, 0.0], [100.0, 0.5, 20.0]);
        let boxes = (1..=count).flat_map(|i| [(2 * i - 1, 1.0), (2 * i, -1.0)]);
        let boxes = boxes.map(|(id, side)| {
            let at = [side * (8.0 + 1.5 * f64::from(id.div_ceil(2))), 0.5, 0.0];
            (id, RigidBodyBuilder::dynamic(), at, [0.5; 3])
        });
        let records = std::iter::once(floor).chain(boxes).map(|(id, body, at, [x, y, z])| {
            let (id, collider) = (BodyId::persistent(id), ColliderBuilder::cuboid(x, y, z));
            host.shapes_mut().describe(id, WorldPose::at(at), &body.build(), &[collider]).unwrap()
        });
        let records = records.collect();
        host.insert(records, &[]).unwrap();
        for _ in 0..300 {
            host.step().unwrap();
        }
        assert!(host.awake_bodies().is_empty());
        host
    }

    /// Does some work, and returns how many bodies and contacts were looked at for it.
    fn looks_of<R>(work: impl FnOnce() -> R) -> (usize, usize) {
        let before = Region::looks();
        work();
        let after = Region::looks();
        (after.0 - before.0, after.1 - before.1)
    }

    #[test]
    fn who_measures_the_load_looks_at_no_sleeper() {
        let mut host = sleepers(50);
        assert_eq!(looks_of(|| host.move_left_behind()), (0, 0));
        let activity = |host: &RegionHost| host.regions().map(Region::activity).sum::<f64>();
        assert_eq!(looks_of(|| activity(&host)), (0, 0));
        host.steer(BodyId::persistent(1), &Velocity::linear([0.0, 0.0, 1.0]));
        host.step().unwrap();
        let (bodies, contacts) = looks_of(|| assert_eq!(activity(&host), 2.0, "a box, and the floor"));
        assert!(bodies <= 2 && contacts <= 2, "{bodies} bodies, {contacts} contacts");
        // Bodies that an emptied region or a moved plane leaves behind are looked for.
        let region = &mut host.regions().next().unwrap().clone();
        assert!(looks_of(|| _ = region.left_behind(true)).0 >= 50);
        region.set_cell(*region.cell());
        assert!(looks_of(|| _ = region.left_behind(false)).0 >= 50);
    }

    #[test]
    fn whatever_is_done_to_a_body_it_is_awake_where_it_does_not_sleep() {
        let mut host = sleepers(4);
        let flagged = |host: &RegionHost| {
            let owned = host.owned_bodies();
            let awake = owned.filter(|(_, region, handle)| !region.physics().bodies[*handle].is_sleeping());
            let mut ids: Vec<_> = awake.map(|(id, ..)| id).collect();
            ids.sort();
            ids
        };
        let id = BodyId::persistent;
        let record = host.record(id(8)).unwrap();
        type Deed<'a> = &'a dyn Fn(&mut RegionHost);
        let deeds: [Deed<'_>; 12] = [
            &|host| _ = host.update(id(1), |body| body.wake_up(true)).unwrap(),
            &|host| _ = host.update(id(2), |body| body.set_enabled(false)).unwrap(),
            &|host| _ = host.steer(id(3), &Velocity::linear([0.0, 1.0, 0.0])),
            &|host| _ = host.update(id(3), |body| body.set_enabled(false)).unwrap(),
            &|host| _ = host.move_copies(id(3), WorldPose::at([15.0, 9.0, 0.0])),
            &|host| _ = host.update(id(4), |body| body.set_linvel(Vector::Y, true)).unwrap(),
            &|host| _ = host.update(id(4), |body| body.sleep()).unwrap(),
            &|host| _ = host.update(id(3), |body| body.set_enabled(true)).unwrap(),
            &|host| _ = host.remove(id(8)),
            &|host| host.insert(vec![record.clone()], &[]).unwrap(),
            &|host| _ = host.teleport(id(5), WorldPose::at([-20.0, 3.0, 0.0])).unwrap(),
            &|host| _ = host.update(id(6), |body| body.set_linvel(Vector::splat(f32::NAN), true)).unwrap(),
        ];
        for (place, deed) in deeds.into_iter().enumerate() {
            deed(&mut host);
            for step in 0..3 {
                assert_eq!(host.awake_bodies(), flagged(&host), "deed {place}, step {step}");
                host.step().unwrap();
            }
            for mut region in host.regions().cloned() {
                let before: BTreeSet<_> =
                    region.own_awake().into_iter().map(RigidBodyHandle::into_raw_parts).collect();
                (region.changed_sleep.roused, region.unstepped) = Default::default();
                region.find_awake();
                let after: BTreeSet<_> =
                    region.own_awake().into_iter().map(RigidBodyHandle::into_raw_parts).collect();
                assert_eq!(before, after, "deed {place}, restored");
            }
        }
        assert!(flagged(&host).contains(&id(6)), "one that is not finite is disabled");
    }
    #[test]
    fn a_copy_that_was_set_aside_and_is_mended_is_stepped_again() {
        let bounds = Bounds::around([0.0; 3], [10.0; 3]);
        let partition = Partition::new(DistributionTree::cut_by(bounds, &[(Axis::X, 0.0)]).unwrap(), None);
        let leaves = partition.leaves().to_vec();
        let shared = StepSettings::default().with_coupling(Coupling::Overlap);
        let settings = StepSettings { gravity: [0.0; 3], island_limit: 0, ..shared };
        let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
        let ids = [0, 1].map(BodyId::persistent);
        let records = ids.iter().zip([-0.501, 0.501]).map(|(&id, x)| {
            let body = RigidBodyBuilder::dynamic().can_sleep(false).build();
            let collider = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
            host.shapes_mut().describe(id, WorldPose::at([x, 0.0, 0.0]), &body, &[collider]).unwrap()
        });
        let records = records.collect();
        host.insert(records, &[]).unwrap();
        (0..3).for_each(|_| host.step().unwrap());
        let place = Pose::from_translation(Vector::new(-0.501, 0.0, 0.0));
        assert!(host.disturb(ids[0], place, Vector::splat(f32::NAN), Vector::ZERO));
        host.step().unwrap();
        assert!(host.regions().any(|region| region.quarantined() == [ids[0]]), "one copy was set aside");
        let is_whole = |region: &Region| region.physics().bodies.iter().all(|(_, body)| body.is_enabled());
        assert!(host.regions().all(is_whole), "the other one mends it");
        assert!(host.regions().all(|region| region.unstepped.is_empty()));
    }

    /// Two boxes, of which one is put to sleep, beside the other or touching it, or both; on the ground, or on a lift that goes
    /// sideways.
    #[test]
    fn what_is_put_to_sleep_falls_through_nothing() {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        for (regions, apart_m, lay, lifts) in [
            (1, 1.0, 1, false),
            (1, 3.0, 1, false),
            (1, 1.0, 2, false),
            (2, 1.0, 1, false),
            (2, 1.0, 2, false),
            (1, 3.0, 1, true),
            (2, 3.0, 2, true),
        ] {
            let cuts = [(Axis::X, 0.0)][..regions - 1].to_vec();
            let partitioning = Partitioning::Cuts(cuts);
            let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            let ground = match lifts {
                true => RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 0.5),
                false => RigidBodyBuilder::fixed(),
            };
            let ground = ground.translation(Vector::Y * -0.5);
            world.insert(ground, ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
            let boxes = [0.5, 0.5 - apart_m].map(|x| {
                let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.5, 0.0));
                world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
            });
            (0..10).for_each(|_| world.step().unwrap());
            for &id in &boxes[..lay] {
                world.update(id, RigidBody::sleep).unwrap();
            }
            for tick in 0..60 {
                world.step().unwrap();
                let height = world.pose(boxes[0]).unwrap().translation[1];
                assert!(height > 0.49, "{regions} regions, {apart_m} m apart, {lay} laid: {height} m");
                let sleeps = world.body(boxes[0]).unwrap().is_sleeping();
                let is_laid = !lifts && (lay == 2 || apart_m > 1.0);
                assert!(tick > 20 || sleeps == is_laid, "{regions} regions, {apart_m} m apart, {lay} laid");
            }
        }
    }

    /// A box hangs from another by a joint, and sleeps; or it lies on the ground and gets smaller.
    #[test]
    fn what_loses_its_hold_in_its_sleep_falls() {
        use crate::runtime::{LocalWorld, WorldConfig};
        for by_shape in [false, true] {
            let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
            let cube = |half: f32| ColliderBuilder::cuboid(half, half, half);
            let at = |y: f32| Vector::new(0.0, y, 0.0);
            world.insert(RigidBodyBuilder::fixed().translation(at(-0.5)), cube(0.5)).unwrap();
            let above = if by_shape { 0.5 } else { 8.0 };
            let falls = world.insert(RigidBodyBuilder::dynamic().translation(at(above)), cube(0.5)).unwrap();
            let holds = RigidBodyBuilder::kinematic_position_based().translation(at(10.0));
            let holds = world.insert(holds, cube(0.2)).unwrap();
            if !by_shape {
                let joint = SphericalJointBuilder::new().local_anchor1(-Vector::Y).local_anchor2(Vector::Y);
                world.insert_joint(holds, falls, joint).unwrap();
            }
            (0..240).for_each(|_| world.step().unwrap());
            assert!(world.body(falls).unwrap().is_sleeping(), "by its shape: {by_shape}");
            let before = world.pose(falls).unwrap().translation[1];
            if by_shape {
                world
                    .update_collider(falls, 0, |own| own.set_shape(SharedShape::cuboid(0.3, 0.3, 0.3)))
                    .unwrap();
            } else {
                world.update(holds, |body| body.set_enabled(false)).unwrap();
            }
            (0..30).for_each(|_| world.step().unwrap());
            let after = world.pose(falls).unwrap().translation[1];
            assert!(before - after > 0.15, "by its shape: {by_shape}; {before} m, {after} m");
        }
    }

    #[test]
    fn gravity_that_turns_moves_what_is_about_to_sleep() {
        use crate::runtime::{LocalWorld, WorldConfig};
        for wait in 20..40 {
            let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
            let cuboid = |x: f32, y: f32| ColliderBuilder::cuboid(x, y, x);
            world.insert(RigidBodyBuilder::fixed().translation(-Vector::Y), cuboid(50.0, 1.0)).unwrap();
            let body = RigidBodyBuilder::dynamic().translation(0.5 * Vector::Y);
            let id = world.insert(body, cuboid(0.5, 0.5)).unwrap();
            (0..wait).for_each(|_| world.step().unwrap());
            let step = StepSettings { gravity: [0.0, 5.0, 0.0], ..*world.host().settings() };
            world.set_settings(step).unwrap();
            (0..60).for_each(|_| world.step().unwrap());
            assert!(world.pose(id).unwrap().translation[1] > 0.6, "after {wait} ticks");
        }
    }
}
