//! Finds the bodies of a region that do not sleep, at a cost that depends on their number alone, not on that
//! of all bodies.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;

use super::{Ownership, Region};
use crate::space::JointId;

/// The distance, metres, up to which a sleeper may touch a newcomer.
const BESIDE_M: f32 = 0.05;
/// The depth, metres, from which on a sleeper does not just lie on another body.
const DEEP_M: f32 = 0.02;

impl Region {
    /// Returns the bodies that do not sleep, in no order and some more than once. Rapier's list of active
    /// bodies lacks those that were inserted or woken since its last step. It also lacks those that Rapier
    /// does not step: a disabled body does not sleep.
    pub(in crate::physics) fn awake(&self) -> impl Iterator<Item = RigidBodyHandle> {
        let stepped = self.world.islands.active_bodies();
        let others = self.touched.iter().chain(&self.roused).chain(self.unstepped.values());
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
    pub(super) fn own_awake(&self) -> Vec<RigidBodyHandle> {
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
            self.roused.push(handle);
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
    pub(super) fn wake(&mut self, handle: RigidBodyHandle) {
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

    /// Wakes what sleeps where a body that is not dynamic has been put, or let touch it. Seen with Rapier 0.36.1: such a
    /// sleeper wakes without that contact, and stays in the other body.
    fn wake_what_is_hit(&mut self) {
        let mut hit = Vec::new();
        for handle in std::mem::take(&mut self.obstacles) {
            let Some(body) = self.world.bodies.get(handle) else { continue };
            if body.is_dynamic() || !body.is_enabled() {
                continue;
            }
            let solid = body.colliders().iter().map(|&own| &self.world.colliders[own]);
            for collider in solid.filter(|own| !own.is_sensor() && own.is_enabled()) {
                let place = super::moved::place(body, collider);
                let bounds = collider.shape().compute_aabb(&place);
                let near = self.world.intersect_aabb_conservative(bounds, QueryFilter::only_dynamic());
                let meets = |other: &Collider| {
                    !other.is_sensor() && collider.collision_groups().test(other.collision_groups())
                };
                for (_, other) in near.filter(|(_, other)| meets(other)) {
                    let sleeper = other.parent().filter(|parent| self.world.bodies[*parent].is_sleeping());
                    let shapes = (collider.shape(), other.shape());
                    let is_in = || {
                        let met = parry3d::query::contact(&place, shapes.0, other.position(), shapes.1, 0.0);
                        met.is_ok_and(|met| met.is_some_and(|met| met.dist < -DEEP_M))
                    };
                    hit.extend(sleeper.filter(|_| is_in()));
                }
            }
        }
        hit.into_iter().for_each(|handle| self.wake(handle));
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
        self.roused.clear();
    }

    /// Notes a body with joints that has been put to sleep, perhaps among bodies that are awake.
    pub(super) fn note_laid(&mut self, handle: RigidBodyHandle) {
        let is_tied = self.slot_at(handle).is_some_and(|slot| !slot.joints.is_empty());
        if is_tied && self.world.bodies[handle].is_sleeping() {
            self.laid.push(handle);
        }
    }

    /// Makes Rapier choose anew in this step which joints it solves, if its list of active bodies has one
    /// that sleeps, or that slept before the last step. Seen with Rapier 0.36.1: a body that Rapier itself
    /// wakes there, as by a contact, has no joints until another choice is made.
    pub(super) fn choose_joints(&mut self) {
        if self.laid.is_empty() {
            return;
        }
        let mut laid = std::mem::take(&mut self.laid);
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
        self.laid = active.filter(|&handle| is_laid(handle) && sleeps(handle)).collect();
    }

    /// Wakes the bodies that were inserted asleep, and those that sleep beside them, for as long as Rapier finds their contacts: it puts
    /// them to sleep again in the same step before it solves, unless what they touch is awake. Returns them, with what
    /// [`Region::restore_limits`] gives back. Seen with Rapier 0.36.1: a body that begins to touch something
    /// in its sleep wakes without that contact, and sinks 5 cm until the contact is found anew. So does what sleeps on a
    /// kinematic body when something awake comes to touch it; what sleeps where bodies come awake is woken like that, too.
    ///
    /// Keeps asleep in the same way what sleeps beside copies that were given up or put elsewhere, and lets what is
    /// awake there, and what came awake, go on to fall asleep.
    pub(super) fn wake_newcomers(&mut self) -> Lulled {
        let (departed, left) = (std::mem::take(&mut self.departed), std::mem::take(&mut self.left));
        let still = self.still_for(left.clone());
        let mut newcomers = std::mem::take(&mut self.born_asleep);
        newcomers.extend(&left);
        newcomers.retain(|&handle| self.world.bodies.get(handle).is_some_and(sleeps_still));
        newcomers.sort_unstable_by_key(|handle| handle.into_raw_parts());
        newcomers.dedup();
        let mut awake = std::mem::take(&mut self.born_awake);
        awake.retain(|handle| self.world.bodies.contains(*handle));
        let all: Vec<_> = newcomers.iter().chain(&awake).copied().collect();
        if !all.is_empty() {
            let beside = self.sleepers_beside(&all);
            for &handle in &beside {
                let PhysicsWorld { islands, bodies, .. } = self.world_mut();
                islands.wake_up(bodies, handle, false);
            }
            for &handle in &newcomers {
                self.world.bodies[handle].wake_up(false);
            }
            newcomers.extend(beside);
        }
        if !departed.is_empty() {
            self.forget_departed(&departed, &left);
        }
        let limits = self.lull(&newcomers);
        Lulled { limits, still, came_still: self.still_for(awake) }
    }

    /// Returns for how long those of these bodies that are awake have been still, in seconds.
    fn still_for(&self, mut handles: Vec<RigidBodyHandle>) -> Vec<(RigidBodyHandle, f32)> {
        handles.sort_unstable_by_key(|handle| handle.into_raw_parts());
        handles.dedup();
        let still = handles.into_iter().filter_map(|handle| {
            let body =
                self.world.bodies.get(handle).filter(|body| body.is_dynamic() && !body.is_sleeping())?;
            Some((handle, body.activation().time_since_can_sleep))
        });
        still.filter(|(_, still_s)| *still_s > 0.0).collect()
    }

    /// Puts a copy where other regions say that it is. What sleeps beside it without touching it sleeps on.
    pub(in crate::physics) fn put_copy(&mut self, handle: RigidBodyHandle, pose: Pose) {
        self.leave_at_rest_beside(handle);
        if !self.world.bodies[handle].is_sleeping() {
            self.left.push(handle);
        }
        self.world_mut().bodies[handle].set_position(pose, false);
    }

    /// Leaves a body at rest, with what is beside it, when the coupling is about to change it.
    pub(super) fn leave_at_rest(&mut self, handle: RigidBodyHandle) {
        self.left.push(handle);
        self.leave_at_rest_beside(handle);
    }

    /// Keeps asleep what sleeps beside a body without touching it, when the coupling is about to change the body, and lets
    /// what is awake beside it go on to fall asleep: Rapier would wake the one, and have the other begin anew to be still.
    fn leave_at_rest_beside(&mut self, handle: RigidBodyHandle) {
        let mut beside = Vec::new();
        self.for_each_contact(handle, |other, touches| {
            if !touches || !self.world.bodies[other].is_sleeping() {
                beside.push(other);
            }
        });
        self.left.extend(beside);
    }

    /// Has Rapier forget the contacts of colliders that were removed, as it would in the next step. It makes
    /// those whose boxes met theirs begin anew to be still for long enough to sleep, and these do not.
    fn forget_departed(&mut self, departed: &[ColliderHandle], left: &[RigidBodyHandle]) {
        self.unsettle();
        let Self { world, listener, .. } = self;
        let PhysicsWorld { narrow_phase, islands, colliders, bodies, .. } = &mut **world;
        let awake = left.iter().filter_map(|&handle| {
            let body = bodies.get(handle).filter(|body| !body.is_sleeping())?;
            Some((handle, body.activation().time_since_can_sleep))
        });
        let awake: Vec<_> = awake.filter(|(_, still_s)| *still_s > 0.0).collect();
        narrow_phase.handle_user_changes(Some(islands), &[], departed, colliders, bodies, listener);
        for (handle, still_s) in awake {
            bodies[handle].activation_mut().time_since_can_sleep = still_s;
        }
    }

    /// Returns the sleepers that were here before and that newcomers touch, with all that hangs together with them: when
    /// Rapier finds that contact it wakes the whole island, and none of it would sleep again in that step.
    fn sleepers_beside(&self, newcomers: &[RigidBodyHandle]) -> Vec<RigidBodyHandle> {
        let mut known: BTreeSet<_> = newcomers.iter().map(|handle| handle.into_raw_parts()).collect();
        let mut found = Vec::new();
        let mut enter = |handle: RigidBodyHandle, found: &mut Vec<_>| {
            let body = &self.world.bodies[handle];
            let sleeps = sleeps_still(body) || body.is_kinematic() && body.is_sleeping();
            if sleeps && known.insert(handle.into_raw_parts()) {
                found.push(handle);
            }
        };
        for &handle in newcomers {
            for &collider in self.world.bodies[handle].colliders() {
                let bounds = self.world.colliders[collider].compute_aabb().loosened(BESIDE_M);
                let near = self.world.intersect_aabb_conservative(bounds, QueryFilter::only_dynamic());
                near.filter_map(|(_, other)| other.parent()).for_each(|other| enter(other, &mut found));
            }
        }
        let mut next = 0;
        while let Some(&handle) = newcomers.iter().chain(&found).nth(next) {
            next += 1;
            self.for_each_contact(handle, |other, touches| {
                if touches {
                    enter(other, &mut found);
                }
            });
        }
        found
    }

    /// Has Rapier put bodies to sleep in the next step before it solves, unless what they touch is awake.
    /// Returns them, with what [`Region::restore_limits`] gives back.
    pub(super) fn lull(&mut self, bodies: &[RigidBodyHandle]) -> Vec<(RigidBodyHandle, SleepLimits)> {
        let all = &mut self.world.bodies;
        bodies.iter().filter_map(|&handle| Some((handle, lull(all.get_mut(handle)?)))).collect()
    }

    /// Gives bodies back the limits within which they may sleep, and the time for which they have been still, after a
    /// step of this length.
    pub(super) fn restore_limits(&mut self, lulled: Lulled, dt_s: f32) {
        for (handle, limits) in lulled.limits {
            if let Some(body) = self.world.bodies.get_mut(handle) {
                let activation = body.activation_mut();
                activation.normalized_linear_threshold = limits.linear;
                activation.angular_threshold = limits.angular;
                activation.time_until_sleep = limits.still_s;
                if activation.sleeping {
                    activation.time_since_can_sleep = limits.still_s;
                }
            }
        }
        let still = lulled.still.into_iter().map(|(handle, still_s)| (handle, still_s, false));
        let came = lulled.came_still.into_iter().map(|(handle, still_s)| (handle, still_s, true));
        for (handle, still_s, came) in still.chain(came) {
            let Some(body) = self.world.bodies.get_mut(handle).filter(|body| !body.is_sleeping()) else {
                continue;
            };
            let (linear, angular) = (body.linvel().length(), body.angvel().length());
            let activation = body.activation_mut();
            let is_slow =
                linear <= activation.normalized_linear_threshold && angular <= activation.angular_threshold;
            // Rapier takes what came for moved. Else what has moved is not at rest, however slow it is.
            let is_still = came || activation.time_since_can_sleep > 0.0;
            if is_slow && is_still && activation.time_since_can_sleep <= dt_s {
                activation.time_since_can_sleep = still_s + dt_s;
            }
        }
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

/// Returns whether a body sleeps and is to stay where it is when it wakes: what flies on then would fly on now.
fn sleeps_still(body: &RigidBody) -> bool {
    body.is_dynamic() && body.is_sleeping() && (body.linvel(), body.angvel()) == (Vector::ZERO, Vector::ZERO)
}

/// Bodies that are made to fall asleep in a step if nothing that is awake touches them, and those that are to go on to
/// fall asleep, with the time for which they have been still, in seconds.
#[derive(Default)]
pub(super) struct Lulled {
    pub(super) limits: Vec<(RigidBodyHandle, SleepLimits)>,
    pub(super) still: Vec<(RigidBodyHandle, f32)>,
    pub(super) came_still: Vec<(RigidBodyHandle, f32)>,
}

/// The limits within which a body may sleep: its speeds, in Rapier's units, and for how long it must be still.
pub(super) struct SleepLimits {
    linear: f32,
    angular: f32,
    still_s: f32,
}

/// Makes a body one that may sleep at any speed and at once, even if Rapier makes it begin anew to be still, and that
/// has not moved since, wherever Rapier takes it to have been. Returns its own limits.
fn lull(body: &mut RigidBody) -> SleepLimits {
    let activation = body.activation_mut();
    activation.time_since_can_sleep = activation.time_until_sleep;
    SleepLimits {
        linear: std::mem::replace(&mut activation.normalized_linear_threshold, f32::INFINITY),
        angular: std::mem::replace(&mut activation.angular_threshold, f32::INFINITY),
        still_s: std::mem::replace(&mut activation.time_until_sleep, 0.0),
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
    use crate::space::{Axis, BodyId, Bounds, DistributionTree, RegionSet};

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
        assert_eq!(looks_of(|| host.wake_left_behind()), (0, 0));
        let activity = |host: &RegionHost| host.regions().map(Region::activity).sum::<f64>();
        assert_eq!(looks_of(|| activity(&host)), (0, 0));
        host.steer(BodyId::persistent(1), &Velocity::linear([0.0, 0.0, 1.0]));
        host.step().unwrap();
        let (bodies, contacts) = looks_of(|| assert_eq!(activity(&host), 2.0, "a box, and the floor"));
        assert!(bodies <= 2 && contacts <= 2, "{bodies} bodies, {contacts} contacts");
        // Bodies that an emptied region or a moved plane leaves behind are looked for.
        let region = &mut host.regions().next().unwrap().clone();
        assert!(looks_of(|| region.wake_left_behind(RegionSet::only(1))).0 >= 50);
        region.set_cell(*region.cell());
        assert!(looks_of(|| region.wake_left_behind(RegionSet::EMPTY)).0 >= 50);
    }

    #[test]
    fn whatever_is_done_to_a_body_it_is_awake_where_it_does_not_sleep() {
        let mut host = sleepers(4);
        let flagged = |host: &RegionHost| {
            let owned = host.owned_bodies();
            let awake = owned.filter(|(_, region, handle)| !region.physics().bodies[*handle].is_sleeping());
            awake.map(|(id, ..)| id).collect::<BTreeSet<_>>()
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
                (region.roused, region.unstepped) = Default::default();
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

    /// Two boxes on the ground and a box in the air that are inserted asleep, and are woken later.
    #[test]
    fn what_is_inserted_asleep_stays_where_it_is_and_has_its_contacts_when_it_wakes() {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        for cuts in [vec![], vec![(Axis::X, 0.1)]] {
            let partitioning = Partitioning::Cuts(cuts);
            let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
            world.insert(ground, ColliderBuilder::cuboid(9.0, 0.5, 9.0)).unwrap();
            let mut insert = |at: [f32; 3]| {
                let body = RigidBodyBuilder::dynamic().translation(Vector::from_array(at)).sleeping(true);
                world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
            };
            let all =
                [[0.0, 0.5, 0.0], [0.0, 1.5, 0.0], [3.0, 4.0, 0.0]].map(|at| (insert(at), f64::from(at[1])));
            let asleep = |world: &LocalWorld, id| {
                let (region, handle) = world.host().owned(id).unwrap();
                region.physics().bodies[handle].is_sleeping()
            };
            for _ in 0..60 {
                world.step().unwrap();
                for (id, height) in all {
                    assert!(asleep(&world, id));
                    assert_eq!(world.pose(id).unwrap().translation[1], height);
                }
            }
            for (id, _) in all {
                world.update(id, |body| body.wake_up(true)).unwrap();
            }
            for _ in 0..30 {
                world.step().unwrap();
                for (id, height) in &all[..2] {
                    let sunk_m = height - world.pose(*id).unwrap().translation[1];
                    assert!(sunk_m.abs() < 2e-3, "{sunk_m} m");
                }
            }
            assert!(world.pose(all[2].0).unwrap().translation[1] < 3.0, "nothing holds it");
        }
    }

    /// Boxes that stand apart by less than what counts as near.
    #[test]
    fn what_is_near_but_does_not_touch_sleeps_at_a_border() {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
        let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
        let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
        world.insert(ground, ColliderBuilder::cuboid(20.0, 0.5, 9.0)).unwrap();
        for i in 0..12 {
            let at = Vector::new(1.03 * (i as f32 - 5.5), 0.5, 0.0);
            let body = RigidBodyBuilder::dynamic().translation(at);
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
        }
        for tick in 0..240 {
            world.step().unwrap();
            let awake: usize = world.host().regions().map(|region| region.own_awake().len()).sum();
            assert!(tick < 120 || awake == 0, "{awake} in tick {tick}");
        }
    }

    /// A box in one region, and a pair of boxes in another that does not touch it, though their boxes along the axes meet.
    #[test]
    fn what_comes_near_others_without_touching_falls_asleep_with_them_at_a_border() {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        for (apart_m, falls_m) in [(0.8, 2.0), (1.0, 2.5), (1.2, 2.0), (1.2, 2.5)] {
            let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
            let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
            world.insert(ground, ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
            let mut insert = |at: [f32; 3], turned: f32| {
                let body = RigidBodyBuilder::dynamic().translation(Vector::from_array(at));
                let body = body.rotation(Vector::Y * turned);
                world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
            };
            let all = [
                insert([-0.5, 0.5, apart_m], std::f32::consts::FRAC_PI_4),
                insert([0.5, 0.5, 0.0], 0.0),
                insert([0.6, falls_m, 0.1], 0.0),
            ];
            (0..150).for_each(|_| world.step().unwrap());
            let asleep = all.map(|id| world.body(id).unwrap().is_sleeping());
            assert_eq!(asleep, [true; 3], "{apart_m} m apart, one falls from {falls_m} m");
        }
    }

    /// Chains hang from an anchor on one side of a level border, most of them on the other.
    #[test]
    fn a_chain_that_hangs_over_a_border_falls_asleep_and_sleeps_on() {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        for (links, top_m) in [(1, 0.3), (4, 0.5), (7, 0.96), (9, 1.5)] {
            let partitioning = Partitioning::Cuts(vec![(Axis::Y, 0.0)]);
            let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            let at = |y: f32| Vector::new(0.45, y, 0.0);
            let anchor = RigidBodyBuilder::kinematic_position_based().translation(at(top_m));
            let mut all = vec![world.insert(anchor, ColliderBuilder::cuboid(0.1, 0.1, 0.1)).unwrap()];
            for i in 0..links {
                let body = RigidBodyBuilder::dynamic().translation(at(top_m - 0.45 - 0.5 * i as f32));
                let link = world.insert(body, ColliderBuilder::cuboid(0.1, 0.2, 0.1)).unwrap();
                let foot = Vector::Y * if i > 0 { -0.25 } else { -0.2 };
                let joint = SphericalJointBuilder::new().local_anchor1(foot).local_anchor2(Vector::Y * 0.25);
                world.insert_joint(*all.last().unwrap(), link, joint).unwrap();
                all.push(link);
            }
            for tick in 0..500 {
                world.step().unwrap();
                let asleep = all.iter().filter(|&&id| world.body(id).unwrap().is_sleeping()).count();
                assert!(tick < 400 || asleep == all.len(), "{links} links: {asleep} sleep in tick {tick}");
            }
        }
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

    /// A wall of boxes with CCD sleeps over a border, and a heavy ball flies at it or past it. Returns the tick in which it
    /// wakes, if it does, and how fast a box falls then.
    fn woken_wall(is_cut: bool, height_m: f32, speed: f32) -> Option<(usize, f32)> {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        let cuts = is_cut.then_some((Axis::X, 0.0)).into_iter().collect();
        let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        world
            .insert(
                RigidBodyBuilder::fixed().translation(-Vector::Y),
                ColliderBuilder::cuboid(50.0, 1.0, 50.0),
            )
            .unwrap();
        let mut boxes = Vec::new();
        for i in 0..24 {
            let (row, column) = ((i / 6) as f32, (i % 6) as f32);
            let at = Vector::new(0.05, 0.4 + 0.8 * row, 0.8 * (column - 2.5) + 0.4 * (row % 2.0));
            let body = RigidBodyBuilder::dynamic().translation(at).ccd_enabled(true);
            boxes.push(world.insert(body, ColliderBuilder::cuboid(0.4, 0.4, 0.4).mass(1.0)).unwrap());
        }
        (0..200).for_each(|_| world.step().unwrap());
        assert!(boxes.iter().all(|&id| world.body(id).unwrap().is_sleeping()));
        let ball = RigidBodyBuilder::dynamic().translation(Vector::new(-11.87, height_m, 0.0));
        let ball = ball.linvel(Vector::X * speed).gravity_scale(0.0).ccd_enabled(true);
        world.insert(ball, ColliderBuilder::ball(0.8).mass(200.0)).unwrap();
        (0..60).find_map(|tick| {
            world.step().unwrap();
            let awake = boxes.iter().filter(|&&id| !world.body(id).unwrap().is_sleeping());
            let falls = awake.map(|&id| -world.velocity(id).unwrap().linear[1]);
            falls.reduce(f32::max).map(|most| (tick, most))
        })
    }

    #[test]
    fn a_sleeping_wall_at_a_border_is_woken_by_what_hits_it_and_not_by_what_comes_near() {
        let mut unlike = Vec::new();
        for speed in [20.0, 30.0, 40.0] {
            for height_m in [1.4, 4.02, 4.05, 4.06, 4.08, 4.2] {
                let [one, two] = [false, true].map(|is_cut| woken_wall(is_cut, height_m, speed));
                if one.map(|(tick, _)| tick) != two.map(|(tick, _)| tick) {
                    unlike.push(format!("{speed} m/s at {height_m} m: {two:?}, in one region {one:?}"));
                }
            }
        }
        for speed in [20.0, 40.0] {
            let [one, two] = [false, true].map(|is_cut| woken_wall(is_cut, 1.4, speed).expect("it is hit").0);
            assert_eq!(one, two, "at {speed} m/s");
        }
        assert!(unlike.is_empty(), "{unlike:#?}");
    }

    /// Two boxes sleep beside each other over a border. One is pushed along it, up or away. Returns whether the other wakes.
    fn wakes_by_the_way(is_cut: bool, gap_m: f32, push: Vector) -> bool {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::Axis;
        let cuts = is_cut.then_some((Axis::X, 0.0)).into_iter().collect();
        let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let cuboid = |x: f32, y: f32| ColliderBuilder::cuboid(x, y, x);
        world.insert(RigidBodyBuilder::fixed().translation(-Vector::Y), cuboid(50.0, 1.0)).unwrap();
        let [sleeper, mover] = [1.0, -1.0].map(|side| {
            let at = Vector::new(side * (0.5 + 0.5 * gap_m) - 0.1, 0.5, 0.0);
            world.insert(RigidBodyBuilder::dynamic().translation(at), cuboid(0.5, 0.5)).unwrap()
        });
        (0..90).for_each(|_| world.step().unwrap());
        assert!([sleeper, mover].iter().all(|&id| world.body(id).unwrap().is_sleeping()));
        world.update(mover, |body| body.apply_impulse(push, true)).unwrap();
        (0..200).any(|_| {
            world.step().unwrap();
            !world.body(sleeper).unwrap().is_sleeping()
        })
    }

    #[test]
    fn what_moves_beside_a_sleeper_of_another_region_wakes_it_where_it_would_in_one_world() {
        let mut unlike = Vec::new();
        for gap_m in [0.02, 0.05, 0.1, 0.2, 0.4] {
            for push in [Vector::Z * 0.5, Vector::Z * 6.0, Vector::Y * 1.5, -Vector::X * 1.5] {
                let [one, two] = [false, true].map(|is_cut| wakes_by_the_way(is_cut, gap_m, push));
                if one != two {
                    unlike.push(format!("{gap_m} m apart, {push} N s: woken {two}, in one region {one}"));
                }
            }
        }
        assert!(unlike.is_empty(), "{unlike:#?}");
    }

    /// A wall or a platform is put into a box that sleeps, and gravity turns shortly before boxes fall asleep.
    #[test]
    fn a_sleeper_into_which_its_program_puts_a_body_is_pushed_out() {
        use crate::protocol::WorldPose;
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        for (kind, cut) in [
            (RigidBodyType::Fixed, None),
            (RigidBodyType::KinematicPositionBased, None),
            (RigidBodyType::KinematicPositionBased, Some(0.3)),
        ] {
            let cuts = cut.map(|at| (Axis::X, at)).into_iter().collect();
            let config = WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::default() };
            let mut world = LocalWorld::new(config).unwrap();
            let cuboid = |x: f32, y: f32| ColliderBuilder::cuboid(x, y, x);
            world.insert(RigidBodyBuilder::fixed().translation(-Vector::Y), cuboid(50.0, 1.0)).unwrap();
            let at = |x: f32| Vector::new(x, 0.5, 0.0);
            let sleeper =
                world.insert(RigidBodyBuilder::dynamic().translation(at(0.0)), cuboid(0.5, 0.5)).unwrap();
            let wall =
                world.insert(RigidBodyBuilder::new(kind).translation(at(1.1)), cuboid(0.5, 0.5)).unwrap();
            (0..200).for_each(|_| world.step().unwrap());
            assert!(world.body(sleeper).unwrap().is_sleeping());
            world.set_pose(wall, WorldPose::at([0.84, 0.5, 0.0])).unwrap();
            (0..60).for_each(|_| world.step().unwrap());
            let x = world.pose(sleeper).unwrap().translation[0];
            assert!(x < -0.12, "{kind:?}, cut at {cut:?}: {x} m");
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

    /// Boxes fall onto a platform that does not move, over a border.
    #[test]
    fn what_falls_onto_a_platform_at_a_border_comes_to_rest_and_sleeps() {
        use rand_chacha::ChaCha8Rng;
        use rand_chacha::rand_core::{Rng, SeedableRng};

        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        let mut restless = Vec::new();
        for seed in 0..60 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut aside = |most: f32| most * (rng.next_u32() as f32 / u32::MAX as f32 - 0.5);
            let cuts = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
            let mut world =
                LocalWorld::new(WorldConfig { partitioning: cuts, ..WorldConfig::default() }).unwrap();
            let plate = RigidBodyBuilder::kinematic_velocity_based().translation(-Vector::Y);
            world.insert(plate, ColliderBuilder::cuboid(20.0, 1.0, 20.0)).unwrap();
            let (x, z) = (aside(1.0), aside(1.0));
            let boxes = [(-0.31, -0.31), (-0.31, 0.31), (0.31, -0.31), (0.31, 0.31)].map(|(i, k)| {
                let at = Vector::new(x + i + aside(0.04), 4.3, z + k + aside(0.04));
                let body = RigidBodyBuilder::dynamic().translation(at);
                world.insert(body, ColliderBuilder::cuboid(0.3, 0.3, 0.3)).unwrap()
            });
            let fastest = |world: &LocalWorld| {
                let speed = |id| Vector::from_array(world.velocity(id).unwrap().linear).length();
                boxes.map(speed).into_iter().fold(0.0, f32::max)
            };
            (0..500).for_each(|_| world.step().unwrap());
            let mut most = 0.0_f32;
            for _ in 0..150 {
                world.step().unwrap();
                most = most.max(fastest(&world));
            }
            let sleep = boxes.iter().all(|&id| world.body(id).unwrap().is_sleeping());
            if most > 0.05 || !sleep {
                restless.push(format!("seed {seed}: {most} m/s, asleep: {sleep}"));
            }
        }
        assert!(restless.is_empty(), "{} {restless:#?}", restless.len());
    }

    /// What sleeps on a ledge is left without it, and in the same tick a ball comes beside it.
    #[test]
    fn what_slept_on_a_ledge_that_is_taken_away_falls_whatever_comes_beside_it() {
        use crate::protocol::WorldPose;
        use crate::runtime::{LocalWorld, WorldConfig};
        for way in ["removed", "moved"] {
            let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
            let at = |y: f32| Vector::new(0.0, y, 0.0);
            let cube = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
            let ledge = RigidBodyBuilder::kinematic_position_based().translation(at(-0.5));
            let ledge = world.insert(ledge, cube.clone()).unwrap();
            let id = world.insert(RigidBodyBuilder::dynamic().translation(at(0.5)), cube).unwrap();
            (0..200).for_each(|_| world.step().unwrap());
            assert!(world.body(id).unwrap().is_sleeping());
            match way {
                "removed" => world.remove(ledge).unwrap(),
                _ => world.set_pose(ledge, WorldPose::at([0.0, -9.0, 0.0])).unwrap(),
            }
            let beside =
                RigidBodyBuilder::dynamic().translation(Vector::new(0.84, 0.5, 0.0)).gravity_scale(0.0);
            world.insert(beside, ColliderBuilder::ball(0.3)).unwrap();
            (0..30).for_each(|_| world.step().unwrap());
            let y = world.pose(id).unwrap().translation[1];
            assert!(y < 0.0, "{way}: {y} m");
        }
    }
}
