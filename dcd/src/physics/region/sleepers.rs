//! Keeps asleep what Rapier would wake when the coupling moves, brings and takes away copies, and has what is inserted beside
//! sleepers, or asleep, find its contacts first.

use std::collections::BTreeSet;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Region;

/// The distance, metres, up to which a sleeper may touch a newcomer.
const BESIDE_M: f32 = 0.05;

/// The bodies that came into a region since its last step, and what copies left behind that were given up or moved.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Turnover {
    /// Bodies inserted asleep since the last step, which has to find their contacts; some may be gone again.
    pub(super) born_asleep: Vec<RigidBodyHandle>,
    /// Movable bodies inserted awake since the last step; some may be gone again.
    pub(super) born_awake: Vec<RigidBodyHandle>,
    /// The colliders of copies that were given up since the last step, and the bodies whose boxes met theirs;
    /// some may be gone, too.
    pub(super) departed: Vec<ColliderHandle>,
    pub(super) left: Vec<RigidBodyHandle>,
}

impl Region {
    /// Wakes the bodies that were inserted asleep, and those that sleep beside them, for as long as Rapier finds their contacts: it puts
    /// them to sleep again in the same step before it solves, unless what they touch is awake. Returns them, with what
    /// [`Region::restore_limits`] gives back. Seen with Rapier 0.36.1: a body that begins to touch something
    /// in its sleep wakes without that contact, and sinks 5 cm until the contact is found anew. So does what sleeps on a
    /// kinematic body when something awake comes to touch it; what sleeps where bodies come awake is woken like that, too.
    ///
    /// Keeps asleep in the same way what sleeps beside copies that were given up or put elsewhere, and lets what is
    /// awake there, and what came awake, go on to fall asleep, or fall asleep in this step of `dt_s` seconds.
    pub(super) fn wake_newcomers(&mut self, dt_s: f32) -> Lulled {
        let (departed, mut left) =
            (std::mem::take(&mut self.turnover.departed), std::mem::take(&mut self.turnover.left));
        left.sort_unstable_by_key(|handle| handle.into_raw_parts());
        left.dedup();
        let still = self.still_for(&left);
        let mut newcomers = std::mem::take(&mut self.turnover.born_asleep);
        newcomers.extend(&left);
        newcomers.retain(|&handle| self.world.bodies.get(handle).is_some_and(sleeps_still));
        newcomers.sort_unstable_by_key(|handle| handle.into_raw_parts());
        newcomers.dedup();
        let mut awake = std::mem::take(&mut self.turnover.born_awake);
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
        let ripe = |(handle, still_s): &&_| self.may_sleep(*handle, still_s + dt_s);
        newcomers.extend(still.iter().filter(ripe).map(|(handle, _)| *handle));
        let limits = self.lull(&newcomers);
        Lulled { limits, still, came_still: self.still_for(&awake) }
    }

    /// Returns whether a body that has been still for so many seconds may sleep.
    fn may_sleep(&self, handle: RigidBodyHandle, still_s: f32) -> bool {
        let body = &self.world.bodies[handle];
        body.is_dynamic() && is_slow(body) && still_s >= body.activation().time_until_sleep
    }

    /// Returns for how long those of these bodies that are awake have been still, in seconds.
    fn still_for(&self, handles: &[RigidBodyHandle]) -> Vec<(RigidBodyHandle, f32)> {
        let still = handles.iter().filter_map(|&handle| {
            let body = self.world.bodies.get(handle).filter(|body| rests_awake(body))?;
            Some((handle, body.activation().time_since_can_sleep))
        });
        still.collect()
    }

    /// Puts a copy where other regions say that it is. What sleeps beside it without touching it sleeps on.
    pub(in crate::physics) fn put_copy(&mut self, handle: RigidBodyHandle, pose: Pose) {
        self.leave_at_rest_beside(handle);
        if rests_awake(&self.world.bodies[handle]) {
            self.turnover.left.push(handle);
        }
        self.world_mut().bodies[handle].set_position(pose, false);
    }

    /// Puts a copy that found its contacts elsewhere to where the body is, which has been still for so many seconds.
    /// However far that is, the body has not moved: it goes on to fall asleep.
    pub(in crate::physics) fn put_copy_back(&mut self, handle: RigidBodyHandle, pose: Pose, still_s: f32) {
        self.put_copy(handle, pose);
        self.set_still(handle, still_s);
        if still_s > 0.0 && !self.world.bodies[handle].is_sleeping() {
            self.turnover.born_awake.push(handle);
        }
    }

    /// Lays a copy to rest where the body has fallen asleep in the region that leads it. It sleeps after the next step,
    /// unless something awake touches it.
    pub(in crate::physics) fn lay_copy(&mut self, handle: RigidBodyHandle, pose: Pose, still_s: f32) {
        if self.world.bodies[handle].is_sleeping() {
            return;
        }
        if *self.world.bodies[handle].position() != pose {
            self.put_copy(handle, pose);
        }
        let body = &mut self.world_mut().bodies[handle];
        body.set_linvel(Vector::ZERO, false);
        body.set_angvel(Vector::ZERO, false);
        self.set_still(handle, still_s);
        self.turnover.left.push(handle);
    }

    /// Has a copy be still for as long as the body has been in the region that leads it, so that both fall asleep in the same
    /// tick: what Rapier takes for moved, or finds to move, would begin anew here.
    pub(in crate::physics) fn set_still(&mut self, handle: RigidBodyHandle, still_s: f32) {
        let body = &mut self.world.bodies[handle];
        if body.is_dynamic() && !body.is_sleeping() {
            body.activation_mut().time_since_can_sleep = still_s;
        }
    }

    /// Leaves a body at rest, with what is beside it, when the coupling is about to change it.
    pub(super) fn leave_at_rest(&mut self, handle: RigidBodyHandle) {
        self.turnover.left.push(handle);
        self.leave_at_rest_beside(handle);
    }

    /// Keeps asleep what sleeps beside a body without touching it, when the coupling is about to change the body, and lets
    /// what is awake beside it go on to fall asleep: Rapier would wake the one, and have the other begin anew to be still.
    fn leave_at_rest_beside(&mut self, handle: RigidBodyHandle) {
        // In the memory of the list, since this is done for each copy that is moved.
        let mut left = std::mem::take(&mut self.turnover.left);
        self.for_each_contact(handle, |other, touches| {
            let body = &self.world.bodies[other];
            if rests_awake(body) || !touches && body.is_sleeping() {
                left.push(other);
            }
        });
        self.turnover.left = left;
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
            let is_slow = is_slow(body);
            let activation = body.activation_mut();
            // Rapier takes what came for moved. Else what has moved is not at rest, however slow it is.
            let is_still = came || activation.time_since_can_sleep > 0.0;
            if is_slow && is_still && activation.time_since_can_sleep <= dt_s {
                activation.time_since_can_sleep = still_s + dt_s;
            }
        }
    }
}

/// Returns whether a body is awake and has been still for a while.
fn rests_awake(body: &RigidBody) -> bool {
    // By Rapier, what lies on a kinematic body sleeps only together with it.
    let is_still = body.is_dynamic() || body.is_kinematic() && !body.is_moving();
    is_still && !body.is_sleeping() && body.activation().time_since_can_sleep > 0.0
}

/// Returns whether a body is within the speeds at which it may sleep.
fn is_slow(body: &RigidBody) -> bool {
    let (linear, angular, activation) = (body.linvel().length(), body.angvel().length(), body.activation());
    linear <= activation.normalized_linear_threshold && angular <= activation.angular_threshold
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
mod tests {
    use super::*;
    use crate::space::Axis;

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

    /// Takes the ledge away on which a box sleeps, and inserts a ball beside the box in the same tick.
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

    /// Eight boxes fall onto a platform that does not move, in two layers that come apart over the corner of four
    /// regions. Copies of boxes that lie near others come and go there.
    #[test]
    fn copies_that_come_and_go_keep_nothing_on_a_platform_awake() {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        use crate::space::mixed;
        for seed in [112, 146] {
            let mut drawn = 100 * seed;
            let mut aside = |most: f32| {
                drawn += 1;
                most * ((mixed(drawn) >> 40) as f32 / (1 << 24) as f32 - 0.5)
            };
            let partitioning = Partitioning::Cuts(vec![(Axis::X, 0.0), (Axis::Z, 0.0)]);
            let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            let plate = RigidBodyBuilder::kinematic_velocity_based().translation(-0.5 * Vector::Y);
            world.insert(plate, ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
            let (x, z) = (aside(1.0), aside(1.0));
            let boxes = [0, 1, 2, 3, 4, 5, 6, 7].map(|i: u32| {
                let [along, across, up] = [i & 1, i >> 1 & 1, i >> 2].map(|i| 0.62 * i as f32);
                let (x, z) = (x + along - 0.31 + aside(0.04), z + across - 0.31 + aside(0.04));
                let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 4.3 + up, z));
                world.insert(body, ColliderBuilder::cuboid(0.3, 0.3, 0.3)).unwrap()
            });
            (0..1_000).for_each(|_| world.step().unwrap());
            let awake = boxes.iter().filter(|&&id| !world.body(id).unwrap().is_sleeping()).count();
            assert_eq!(awake, 0, "seed {seed}");
        }
    }

    /// Neat towers, that is of boxes exactly above one another, some millimetres apart: how many there are, of how many boxes of what
    /// half size, and the gap between them, in metres.
    type Towers = (usize, usize, f32, f32);

    /// Returns how many of the towers' tops are awake after four seconds, and how far they are from where they began.
    fn lean((towers, height, half, gap): Towers, planes: &[f64]) -> (usize, f64) {
        use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
        let partitioning = Partitioning::Cuts(planes.iter().map(|&z| (Axis::Z, z)).collect());
        let mut world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
        let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
        world.insert(ground, ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
        let mut tops = Vec::new();
        for i in 0..towers * height {
            let (tower, level) = ((i / height) as f32, (i % height) as f32);
            let z = (2.0 * half + gap) * (tower - 0.5 * (towers - 1) as f32);
            let body =
                RigidBodyBuilder::dynamic().translation(Vector::new(0.0, half * (2.0 * level + 1.0), z));
            let id = world.insert(body, ColliderBuilder::cuboid(half, half, half).density(100.0)).unwrap();
            if i % height == height - 1 {
                tops.push(id);
            }
        }
        (0..240).for_each(|_| world.step().unwrap());
        let awake = tops.iter().filter(|&&id| !world.body(id).unwrap().is_sleeping()).count();
        let lean_m = |&id| world.pose(id).unwrap().translation[0].abs();
        (awake, tops.iter().map(lean_m).fold(0.0, f64::max))
    }

    /// Copies of a neat tower lose corners of their contacts, so that they sway in a region that does not lead them.
    #[test]
    fn neat_towers_beside_a_border_fall_asleep_as_in_one_world() {
        for towers in [(8, 25, 0.25, 0.025), (8, 25, 0.25, 0.04), (12, 20, 0.15, 0.02)] {
            let (awake, one_world_m) = lean(towers, &[]);
            assert_eq!(awake, 0);
            for planes in [&[0.0][..], &[-1.05, 0.0, 1.05]] {
                let (awake, lean_m) = lean(towers, planes);
                let says = format!("{towers:?}: {awake} awake, {lean_m} m, {one_world_m} in one world");
                assert!(awake == 0 && lean_m < 1.5 * one_world_m, "{says}");
            }
        }
    }
}
