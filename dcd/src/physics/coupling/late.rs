//! Takes in what owners tell some ticks late (`owner` without lockstep). States are carried forward to the present tick
//! (dead reckoning, thesis 3.3.11), unless that contradicts what the copies here have met:
//!
//! - A copy that was just hit goes on as it does here, until its owner tells states from after the hit. The owner has
//!   computed the same hit by now. An earlier state would put the copy back to where it was about to be hit, and it
//!   would be hit again in each of the ticks until then: what does not bounce bounced fully.
//! - A copy that touches something is carried forward by how it has moved of late in the mean. What lies still is told
//!   with velocities that tremble. Carried forward over many ticks, they shake a stack until it falls.
//! - What joints hold goes on as it does here, unless it was some centimetres from where its owner had it in the same tick.
//!   Then all that hangs together is computed again from there, tick by tick (`replay`): to be carried forward body by body
//!   would strain its joints. What is handed over is so, too.
//! - What touches nothing falls on the way.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use rapier3d::prelude::{RigidBody, RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

use super::replay::replay;
use crate::physics::hits::Hits;
use crate::physics::region::{Ownership, Region};
use crate::protocol::{BorderMessage, MAX_LAG, Velocity, WorldPose};
use crate::space::{BodyId, Tick};

/// The difference between a velocity and the mean of those before, m/s, up to which a copy that touches something is
/// carried forward by the mean.
const STEADY_M_S: f32 = 1.0;
/// Over how many times as long as states come late the mean of velocities reaches.
const MEAN_OVER: f32 = 2.0;
/// The distance, metres, of a copy that joints hold from where its owner had it in the same tick, from which on it is
/// computed again.
const APART_M: f64 = 0.05;
/// The same for its velocity, m/s, where it is handed over.
const APART_M_S: f32 = 0.5;

/// The courses of copies whose owners' states come late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Late {
    /// By how many ticks states come late at most; 0 where none ever did.
    most: u64,
    courses: BTreeMap<BodyId, Course>,
    /// The copies that joints hold.
    tied: BTreeMap<BodyId, Past>,
}

/// Where a copy that joints hold was after each of the last ticks.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Past {
    /// Says whether the copy began where its owner had it, and not where it was reckoned to be.
    is_sure: bool,
    /// Its states, newest last.
    states: VecDeque<(Tick, WorldPose, Velocity)>,
}

/// The state that a copy that joints hold is to have now.
struct Tied {
    pose: WorldPose,
    velocity: Velocity,
    /// Says whether that comes from what its owner told.
    is_replayed: bool,
}

/// The motion of a copy of late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Course {
    hits: Hits,
    /// The mean of the velocities told of late, linear and angular.
    mean: Option<(Vector, Vector)>,
}

impl Late {
    /// Carries what a message says of bodies forward from its tick to the present one, `now`. Returns the bodies that are
    /// handed over as they are here, each with the tick since which it has gone on so. Those in `as_told` are not.
    pub(super) fn carry_forward(
        &mut self,
        region: &Region,
        message: &mut BorderMessage,
        now: Tick,
        dt_s: f32,
        as_told: &BTreeSet<BodyId>,
    ) -> BTreeMap<BodyId, Tick> {
        let told = message.tick;
        let late = now.0.saturating_sub(told.0);
        let late_s = late as f64 * f64::from(dt_s);
        self.most = self.most.max(late.min(u64::from(MAX_LAG)));
        let tied = self.carry_tied_forward(region, message, now, dt_s, as_told);
        let mut as_here = BTreeMap::new();
        let (courses, gravity) = (&mut self.courses, region.physics().gravity);
        message.carry_forward(|id, pose, velocity| {
            if let Some(here) = tied.get(&id) {
                (*pose, *velocity) = (here.pose, here.velocity);
                if !here.is_replayed {
                    as_here.insert(id, told);
                }
                return;
            }
            let Some(handle) = copy_of(region, id).filter(|handle| !region.is_jointed(*handle)) else {
                *pose = pose.moved(velocity, late_s);
                return;
            };
            let course = courses.entry(id).or_default();
            let mean = course.take_in(velocity, late);
            let alone = course.hits.alone_since(told, late).filter(|_| !as_told.contains(&id));
            if let Some(since) = alone {
                let state = region.body_state(handle);
                (*pose, *velocity) = (state.pose, state.velocity);
                as_here.insert(id, since);
            } else if region.is_pressed(handle) {
                // What speeds up steadily is ahead of the mean.
                let is_steady = differ_m_s(&mean, velocity) < STEADY_M_S;
                *pose = pose.moved(if is_steady { &mean } else { velocity }, late_s);
            } else {
                // Velocities change before bodies are moved by them.
                let falls = gravity * falls_by(&region.physics().bodies[handle]);
                let on_the_way = add(velocity, falls * (0.5 * (late + 1) as f32 * dt_s));
                *pose = pose.moved(&on_the_way, late_s);
                *velocity = add(velocity, falls * late_s as f32);
            }
        });
        let handed_over = message.transfers.iter().map(|transfer| transfer.body.id);
        handed_over.filter_map(|id| Some((id, *as_here.get(&id)?))).collect()
    }

    /// Compares copies that joints hold with what a message tells of the same tick. Returns how they are to be now: as they
    /// are or, where any body of their assembly was too far off, as its bodies come from where they were told to be.
    fn carry_tied_forward(
        &mut self,
        region: &Region,
        message: &mut BorderMessage,
        now: Tick,
        dt_s: f32,
        as_told: &BTreeSet<BodyId>,
    ) -> BTreeMap<BodyId, Tied> {
        let (told, tied) = (message.tick, &mut self.tied);
        let late = now.0.saturating_sub(told.0).min(u64::from(MAX_LAG));
        let handed_over: BTreeSet<_> = message.transfers.iter().map(|transfer| transfer.body.id).collect();
        let (mut told_of, mut off) = (BTreeMap::new(), BTreeSet::new());
        message.carry_forward(|id, pose, velocity| {
            let Some(handle) = copy_of(region, id).filter(|&handle| is_tied(region, handle)) else { return };
            let slot = region.slot(handle);
            let is_as_told = tied.get(&id).is_some_and(|past| match past.at(told) {
                // What is handed over is not told of again.
                Some((_, was, speed)) if handed_over.contains(&id) => {
                    differ_m(was, pose, slot.reach_m) < APART_M && differ_m_s(speed, velocity) < APART_M_S
                }
                Some((_, was, _)) => differ_m(was, pose, slot.reach_m) < APART_M,
                None => past.is_sure && !handed_over.contains(&id),
            });
            if !is_as_told || as_told.contains(&id) {
                off.extend(slot.assembly);
            }
            told_of.insert(id, (handle, slot.assembly, *pose, *velocity));
        });
        let is_off = |assembly: Option<u32>| assembly.is_some_and(|assembly| off.contains(&assembly));
        let start = told_of.values().filter(|(_, assembly, ..)| is_off(*assembly));
        let start: Vec<_> = start.map(|&(handle, _, pose, velocity)| (handle, pose, velocity)).collect();
        let mut replayed = replay(region, &start, late, dt_s).into_iter();
        let mut carried = BTreeMap::new();
        for (id, (_, assembly, ..)) in told_of {
            let past = tied.entry(id).or_default();
            let is_replayed = is_off(assembly);
            if is_replayed {
                let (pose, velocity) = replayed.next().expect("one for each");
                *past = Past { is_sure: true, states: [(now, pose, velocity)].into() };
            }
            if let Some(&(_, pose, velocity)) = past.states.back() {
                carried.insert(id, Tied { pose, velocity, is_replayed });
            }
        }
        carried
    }

    /// Notes which copies were hit in the step of a tick.
    pub(super) fn look_back(&mut self, region: &Region, tick: Tick, dt_s: f32) {
        for (id, course) in &mut self.courses {
            if let Some(handle) = copy_of(region, *id) {
                course.hits.look_back(region, handle, tick, self.most, dt_s);
            }
        }
        if self.most == 0 {
            return;
        }
        let is_here = |handle| is_tied(region, handle) && region.physics().bodies[handle].is_dynamic();
        self.tied.retain(|&id, _| copy_of(region, id).is_some_and(is_here));
        for link in region.replicas().iter().filter(|link| is_here(link.handle)) {
            let state = region.body_state(link.handle);
            let states = &mut self.tied.entry(link.id).or_default().states;
            // A tick may have several substeps.
            states.retain(|(of, ..)| *of != tick && of.0 + self.most >= tick.0);
            states.push_back((tick, state.pose, state.velocity));
        }
    }

    /// Notes how copies move after an exchange.
    pub(super) fn look_ahead(&mut self, region: &Region) {
        self.courses.retain(|id, course| {
            let body = copy_of(region, *id).map(|handle| &region.physics().bodies[handle]);
            body.inspect(|body| course.hits.look_ahead(body)).is_some()
        });
    }
}

impl Course {
    /// Takes in a velocity told by the owner. Returns the mean.
    fn take_in(&mut self, told: &Velocity, late: u64) -> Velocity {
        let share = 1.0 / (1.0 + MEAN_OVER * late as f32);
        let told = (Vector::from(told.linear), Vector::from(told.angular));
        let (linear, angular) = self.mean.get_or_insert(told);
        *linear += (told.0 - *linear) * share;
        *angular += (told.1 - *angular) * share;
        Velocity { linear: (*linear).into(), angular: (*angular).into() }
    }
}

impl Past {
    /// Returns what is known of a tick.
    fn at(&self, tick: Tick) -> Option<&(Tick, WorldPose, Velocity)> {
        self.states.iter().find(|(of, ..)| *of == tick)
    }
}

/// Returns the share of gravity by which a body falls along each axis: none without mass, or where it is locked.
fn falls_by(body: &RigidBody) -> Vector {
    body.mass_properties().effective_inv_mass * body.mass() * body.gravity_scale()
}

/// Returns how far the points of a body that reaches so far are apart at most in two poses, metres.
fn differ_m(a: &WorldPose, b: &WorldPose, reach_m: f32) -> f64 {
    let (a, b) = (a.isometry(), b.isometry());
    (a.translation.vector - b.translation.vector).norm()
        + f64::from(reach_m) * a.rotation.angle_to(&b.rotation)
}

fn differ_m_s(a: &Velocity, b: &Velocity) -> f32 {
    (Vector::from(a.linear) - Vector::from(b.linear)).length()
}

fn add(velocity: &Velocity, change: Vector) -> Velocity {
    Velocity { linear: (Vector::from(velocity.linear) + change).into(), ..*velocity }
}

/// Returns whether a body is held by impulse joints and by nothing that Rapier knows nothing of.
fn is_tied(region: &Region, handle: RigidBodyHandle) -> bool {
    region.is_jointed(handle) && region.is_auditable(handle)
}

/// Returns the copy of a dynamic body that another region owns.
fn copy_of(region: &Region, id: BodyId) -> Option<RigidBodyHandle> {
    let handle = region.handle_of(id)?;
    let is_copy = matches!(region.slot(handle).role, Ownership::Replica { .. });
    (is_copy && region.physics().bodies.get(handle).is_some_and(RigidBody::is_dynamic)).then_some(handle)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeSet, VecDeque};

    use rapier3d::prelude::*;

    use crate::physics::{Coupling, Measured, Partition, RegionHost, StepSettings};
    use crate::protocol::{BorderMessage, Push, Velocity, WorldPose};
    use crate::scene::{Params, Scene, SceneJoint};
    use crate::space::{BodyId, Bounds, DistributionTree, RegionId};

    /// Two regions whose messages to each other come some ticks late.
    struct Apart {
        hosts: Vec<RegionHost>,
        under_way: VecDeque<Vec<BorderMessage>>,
        late: usize,
        /// The number of bodies that were handed over as they were here, not as their owner told.
        as_here: usize,
    }

    impl Apart {
        fn new(scene: &Scene, late: usize) -> Self {
            let tree = DistributionTree::halved(Bounds::around([0.0; 3], [20.0; 3]), 2).unwrap();
            let partition = Partition::new(tree, Some(2.0 + late as f64 * 20.0 / 60.0));
            let step = StepSettings {
                coupling: Coupling::Owner,
                dt_s: 1.0 / 60.0,
                exchanges: 1,
                ..scene.step_settings()
            };
            let host = |&region: &_| {
                let mut host = RegionHost::new(partition.clone(), step, 1, &[region]).unwrap();
                let (bodies, joints) = scene.records(host.shapes_mut()).unwrap();
                host.insert(bodies, &joints).unwrap();
                host.meet_always();
                host.announce();
                host
            };
            let hosts: Vec<_> = partition.leaves().iter().map(host).collect();
            let mut apart = Self { hosts, under_way: VecDeque::new(), late: 0, as_here: 0 };
            apart.exchange();
            apart.late = late;
            apart
        }

        fn exchange(&mut self) {
            self.under_way.push_back(self.hosts.iter().flat_map(RegionHost::outgoing).cloned().collect());
            if self.under_way.len() > self.late {
                for message in self.under_way.pop_front().unwrap() {
                    let host =
                        self.hosts.iter_mut().find(|host| host.regions().next().unwrap().id() == message.to);
                    let host = host.unwrap();
                    let now = host.tick().next();
                    match self.late {
                        0 => host.accept(message),
                        _ => self.as_here += host.accept_late(message, now, &BTreeSet::new()).len(),
                    }
                }
            }
            self.hosts.iter_mut().for_each(|host| host.exchange().unwrap());
        }

        fn step(&mut self) {
            self.hosts.iter_mut().for_each(RegionHost::compute);
            self.exchange();
            self.hosts.iter_mut().for_each(RegionHost::end_tick);
        }

        fn states(&self) -> Vec<(BodyId, RegionId, WorldPose, Velocity)> {
            let mut states: Vec<_> = self.hosts.iter().flat_map(RegionHost::states).collect();
            states.sort_by_key(|(id, ..)| *id);
            states
        }
    }

    /// Lets two balls meet over the border. Returns their velocities when both are past it.
    fn velocities_after_meeting(late: usize, bounce: f32, speed: f32, aside: f32) -> Vec<[f32; 3]> {
        let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("balls") };
        for side in [-1.0_f32, 1.0] {
            let body = RigidBodyBuilder::dynamic().linvel(-Vector::X * side * speed);
            let ball = ColliderBuilder::ball(0.5).restitution(bounce).friction(0.0);
            scene.push(WorldPose::at([2.2 * f64::from(side), 0.0, f64::from(side * aside)]), body, ball);
        }
        let mut apart = Apart::new(&scene, late);
        for _ in 0..(60.0 * 2.2 / speed) as u32 + 20 {
            apart.step();
        }
        // A body may be on its way from one region to the other.
        while apart.states().len() < 2 {
            apart.step();
        }
        apart.states().iter().map(|(.., velocity)| velocity.linear).collect()
    }

    #[test]
    fn balls_that_meet_part_as_in_one_world_however_late_each_region_hears_of_the_other() {
        for bounce in [0.0, 0.5, 1.0] {
            for (speed, aside) in [(1.0, 0.0), (4.0, 0.1), (12.0, 0.2)] {
                let at_once = velocities_after_meeting(0, bounce, speed, aside);
                for late in [1, 3, 6, 12] {
                    let parted = velocities_after_meeting(late, bounce, speed, aside);
                    let differ = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-4 * speed;
                    assert!(
                        !parted.iter().flatten().zip(at_once.iter().flatten()).any(differ),
                        "{late} ticks late, bounce {bounce}, {speed} m/s: {parted:?}, not {at_once:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_tower_of_boxes_of_both_regions_stands_however_late_they_hear_of_each_other() {
        for late in [0, 1, 3, 6, 12] {
            let mut scene = Scene::empty("tower");
            scene.push_fixed_box([0.0, -1.0, 0.0], [9.0, 1.0, 9.0], &ColliderBuilder::ball(1.0));
            for i in 0..6 {
                let at = [if i % 2 == 0 { -0.1 } else { 0.1 }, 0.5 + 1.05 * f64::from(i), 0.0];
                let body = RigidBodyBuilder::dynamic().can_sleep(false);
                scene.push(WorldPose::at(at), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
            }
            let mut apart = Apart::new(&scene, late);
            (0..600).for_each(|_| apart.step());
            assert_eq!(apart.states().len(), 6, "{late} ticks late: none is under way");
            for (i, (.., pose, velocity)) in apart.states().into_iter().enumerate() {
                let off_m = (pose.translation[1] - 0.5 - i as f64).abs();
                let speed = Vector::from(velocity.linear).length();
                assert!(
                    off_m < 0.02 && speed < 0.05,
                    "{late} ticks late: box {i} {off_m} m off, at {speed} m/s"
                );
            }
        }
    }

    #[test]
    fn a_row_that_slides_into_another_region_keeps_its_speed_however_late_that_hears_of_it() {
        for late in [0, 1, 3, 6, 12] {
            for speed in [0.3_f32, 2.0] {
                let mut scene = Scene::empty("row");
                let ice = ColliderBuilder::ball(1.0).friction(0.0);
                scene.push_fixed_box([0.0, -1.0, 0.0], [9.0, 1.0, 9.0], &ice);
                for i in 0..5 {
                    let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(Vector::X * speed);
                    let at = [-1.5 - 1.001 * f64::from(i), 0.5, 0.0];
                    scene.push(WorldPose::at(at), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(0.0));
                }
                let mut apart = Apart::new(&scene, late);
                (0..(60.0 * 4.0 / speed) as u32).for_each(|_| apart.step());
                assert_eq!(apart.states().len(), 5, "{late} ticks late: none is under way");
                for (i, (.., pose, velocity)) in apart.states().into_iter().enumerate() {
                    let off_m = (pose.translation[0] - 2.5 + 1.001 * i as f64).abs();
                    let off_m_s = (velocity.linear[0] - speed).abs();
                    let is_on = off_m < 0.01 && off_m_s < 0.01 * speed;
                    assert!(is_on, "{late} ticks late, {speed} m/s: box {i} {off_m} m and {off_m_s} m/s off");
                }
            }
        }
    }

    #[test]
    fn what_falls_beside_a_border_lands_however_late_its_region_is_heard() {
        let land = |late| {
            let mut scene = Scene::empty("fall");
            scene.push_fixed_box([0.0, -1.0, 0.0], [9.0, 1.0, 9.0], &ColliderBuilder::ball(1.0));
            for (x, y) in [(-0.3, 0.5), (0.2, 4.5)] {
                let body = RigidBodyBuilder::dynamic().can_sleep(false);
                scene.push(WorldPose::at([x, y, 0.0]), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
            }
            let mut apart = Apart::new(&scene, late);
            (0..240).for_each(|_| apart.step());
            apart.states().iter().map(|(.., pose, _)| pose.translation).collect::<Vec<_>>()
        };
        let at_once = land(0);
        assert!(at_once[1][0] > 1.0, "it fell over the edge of the lower box: {at_once:?}");
        for late in [1, 3, 6, 12] {
            let landed = land(late);
            let off_m = |i: usize| {
                Vector::from(std::array::from_fn(|k| (landed[i][k] - at_once[i][k]) as f32)).length()
            };
            assert!(off_m(0) < 0.01 && off_m(1) < 0.2, "{late} ticks late: {landed:?}, not {at_once:?}");
        }
    }

    #[test]
    fn a_chain_that_swings_through_a_border_keeps_its_energy_however_late_each_region_hears_of_the_other() {
        let energy_j = |late| {
            let params = Params::new().with("links", 12).with("bob_mass_ratio", 4).with("offset", 3);
            let mut apart = Apart::new(&Scene::named("chain", &params).unwrap(), late);
            (0..1_200).for_each(|_| apart.step());
            // It goes to the other region as a whole, and is under way for some ticks.
            while apart.states().is_empty() {
                apart.step();
            }
            apart.hosts.iter().map(RegionHost::energy_j).sum::<f64>()
        };
        let at_once_j = energy_j(0);
        for late in [1, 3, 6, 12] {
            let gained = (energy_j(late) - at_once_j) / at_once_j.abs();
            assert!((-0.01..0.01).contains(&gained), "{late} ticks late: {:.1} %", 100.0 * gained);
        }
    }

    /// Lets a chain of boxes fly and turn, and hit a ball that rests at `x`. Returns where all are in the end, and their energy.
    fn thrown(late: usize, speed: f32, x: f64) -> (Vec<[f64; 3]>, f64) {
        let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("thrown") };
        for i in 0..6 {
            let velocity = Vector::new(speed, 0.0, (i as f32 - 2.5) * 0.25 * speed);
            let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(velocity);
            let at = WorldPose::at([-6.0 + 0.5 * f64::from(i), 0.0, 0.0]);
            let b = scene.push(at, body, ColliderBuilder::cuboid(0.2, 0.1, 0.1));
            if let Some(a) = b.checked_sub(1) {
                let at_ends = SphericalJointBuilder::new()
                    .local_anchor1(Vector::X * 0.25)
                    .local_anchor2(Vector::X * -0.25);
                scene.joints.push(SceneJoint { a, b, joint: at_ends.into(), multibody: None });
            }
        }
        let ball = ColliderBuilder::ball(0.4).restitution(0.5);
        scene.push(WorldPose::at([x, 0.05, 0.0]), RigidBodyBuilder::dynamic().can_sleep(false), ball);
        let mut apart = Apart::new(&scene, late);
        (0..(600.0 / speed) as u32).for_each(|_| apart.step());
        let ends = apart.states();
        assert_eq!(ends.len(), scene.bodies.len(), "{late} ticks late: none is under way");
        let energy_j = apart.hosts.iter().map(RegionHost::energy_j).sum();
        (ends.iter().map(|(.., pose, _)| pose.translation).collect(), energy_j)
    }

    /// Far away there is no ball to hit.
    #[test]
    fn a_chain_that_comes_from_afar_flies_on_in_another_region_and_hits_what_is_there_however_late_that_hears()
     {
        for x in [0.6, 1.0, 2.0, 3.0, 4.5, 18.0] {
            for speed in [2.0, 8.0] {
                let at_once = thrown(0, speed, x).0;
                for late in [1, 3, 6, 12] {
                    let ends = thrown(late, speed, x).0;
                    let off_m =
                        ends.iter().flatten().zip(at_once.iter().flatten()).map(|(a, b)| (a - b).abs());
                    let off_m = off_m.fold(0.0, f64::max);
                    assert!(off_m < 1e-3, "{late} ticks late, {speed} m/s, ball at {x} m: {off_m} m off");
                }
            }
        }
    }

    #[test]
    fn a_chain_that_hangs_from_a_trolley_goes_along_into_another_region_however_late_that_hears() {
        let carried = |late| {
            let mut scene = Scene::empty("trolley");
            let trolley = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 2.0);
            scene.push(WorldPose::at([-6.0, 3.0, 0.0]), trolley, ColliderBuilder::cuboid(0.2, 0.1, 0.2));
            for a in 0..4 {
                let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(Vector::X * 2.0);
                let at = WorldPose::at([-6.0, 2.5 - 0.5 * a as f64, 0.0]);
                let b = scene.push(at, body, ColliderBuilder::cuboid(0.1, 0.2, 0.1));
                let at_ends = SphericalJointBuilder::new()
                    .local_anchor1(Vector::Y * -0.25)
                    .local_anchor2(Vector::Y * 0.25);
                scene.joints.push(SceneJoint { a, b, joint: at_ends.into(), multibody: None });
            }
            let mut apart = Apart::new(&scene, late);
            (0..360).for_each(|_| apart.step());
            while apart.states().len() < 5 {
                apart.step();
            }
            let states = apart.states();
            let at = |i: usize| states[i].2.translation;
            (at(4)[0] - at(0)[0], at(4)[1])
        };
        let at_once = carried(0);
        for late in [1, 3, 6, 12] {
            let end = carried(late);
            let off_m = (end.0 - at_once.0).abs().max((end.1 - at_once.1).abs());
            assert!(off_m < 1e-3, "{late} ticks late, its end is at {end:?}, not {at_once:?}");
        }
    }

    #[test]
    fn a_chain_that_hits_a_ball_over_the_border_gains_little_energy_however_late_each_region_hears_of_the_other()
     {
        for speed in [2.0, 8.0] {
            let at_once_j = thrown(0, speed, -1.0).1;
            for late in [1, 3, 6, 12] {
                let gained = (thrown(late, speed, -1.0).1 - at_once_j) / at_once_j;
                assert!(gained.abs() < 0.1, "{late} ticks late, {speed} m/s: {:.1} %", 100.0 * gained);
            }
        }
    }

    /// Pushes on the way have been done to the copy already, and must not be done again.
    #[test]
    fn a_body_that_is_pushed_while_it_is_handed_over_arrives_as_it_is_here_and_says_so() {
        let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("ball") };
        let body = RigidBodyBuilder::dynamic().linvel(Vector::X * 2.0);
        scene.push(WorldPose::at([-0.5, 0.0, 0.0]), body, ColliderBuilder::ball(0.5).mass(1.0));
        for is_pushed in [false, true] {
            let mut apart = Apart::new(&scene, 6);
            let id = apart.states()[0].0;
            while !apart.states().is_empty() {
                apart.step();
            }
            let push =
                Push { body: id, linear: [0.0, 5.0, 0.0], angular: [0.0; 3], point: None, lasts: false };
            if is_pushed {
                assert!(apart.hosts.iter_mut().all(|host| host.push(&push)), "both hold it");
            }
            let as_here = apart.as_here;
            while apart.states().is_empty() {
                apart.step();
            }
            assert_eq!(apart.states()[0].3.linear, [2.0, if is_pushed { 5.0 } else { 0.0 }, 0.0]);
            assert_eq!(apart.as_here > as_here, is_pushed);
        }
    }

    #[test]
    fn what_is_hit_while_it_is_handed_over_is_hit_once() {
        for bounce in [0.0, 1.0] {
            for x in [-0.2, 0.1, 0.4, 0.7, 1.0] {
                let part = |late| {
                    let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("balls") };
                    for (x, v) in [(x + 1.0, 0.0), (x - 3.0, 4.0)] {
                        let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(Vector::X * v);
                        let ball = ColliderBuilder::ball(0.5).restitution(bounce).friction(0.0);
                        scene.push(WorldPose::at([x, 0.0, 0.0]), body, ball);
                    }
                    let mut apart = Apart::new(&scene, late);
                    (0..90).for_each(|_| apart.step());
                    while apart.states().len() < 2 {
                        apart.step();
                    }
                    apart.states().iter().map(|(.., velocity)| velocity.linear[0]).collect::<Vec<_>>()
                };
                let at_once = part(0);
                for late in [1, 3, 6, 12] {
                    let parted = part(late);
                    let is_off = parted.iter().zip(&at_once).any(|(a, b)| (a - b).abs() > 0.01);
                    assert!(
                        !is_off,
                        "{late} ticks late, bounce {bounce}, at {x} m: {parted:?}, not {at_once:?}"
                    );
                }
            }
        }
    }
}
