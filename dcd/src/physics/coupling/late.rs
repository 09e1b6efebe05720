//! Takes in what owners tell some ticks late (`owner` without lockstep). States are carried forward to the present tick
//! (dead reckoning, thesis 3.3.11), unless that contradicts what the copies here have met:
//!
//! - A copy that was just hit goes on as it does here, until its owner tells states from after the hit. The owner has
//!   computed the same hit by now. An earlier state would put the copy back to where it was about to be hit, and it
//!   would be hit again in each of the ticks until then: what does not bounce bounced fully. A body that is handed over
//!   is as its owner told: what its user did to it on the way is done to it anew (`runtime/device.rs`).
//! - A copy that touches something is carried forward by how it has moved of late in the mean. What lies still is told
//!   with velocities that tremble. Carried forward over many ticks, they shake a stack until it falls.
//! - What joints hold is carried forward at a steady acceleration.
//! - What touches nothing falls on the way.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::{RigidBody, RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

use crate::physics::region::{Ownership, Region};
use crate::protocol::{BorderMessage, Velocity};
use crate::space::{BodyId, Tick};

/// The changes of a copy's velocity in a tick from which on it was hit: as a multiple of what gravity adds in a tick,
/// and at least so much, m/s. What lies still may lose in a tick what gravity adds.
const HIT_BY_GRAVITY: f32 = 1.25;
const HIT_M_S: f32 = 0.1;
/// For how many times as long as states come late a copy goes on by itself while it is hit again and again.
const MOST_ALONE: u64 = 3;
/// The difference between a velocity and the mean of those before, m/s, up to which a copy that touches something is
/// carried forward by the mean.
const STEADY_M_S: f32 = 1.0;
/// Over how many times as long as states come late the mean of velocities reaches. So half of a velocity's lead over the
/// mean is what a steady acceleration adds until the present.
const MEAN_OVER: f32 = 2.0;
/// The share of a velocity's lead over the mean that is added to the velocity of what joints hold. A chain that swings for 20 s,
/// six ticks late, gains a sixth of its energy; without, a quarter.
const SPEED_UP: f32 = 0.5;

/// The courses of copies whose owners' states come late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Late {
    /// By how many ticks states come late at most; 0 where none ever did.
    most: u64,
    courses: BTreeMap<BodyId, Course>,
}

/// The motion of a copy of late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Course {
    /// The copy's velocities as the last exchange left them, linear and angular.
    was: Option<(Vector, Vector)>,
    /// The mean of the velocities told of late.
    mean: Option<(Vector, Vector)>,
    /// The first and the last tick in which it was hit, of hits that followed one another.
    hit: Option<(Tick, Tick)>,
}

impl Late {
    /// Carries what a message says of bodies forward from its tick to the present one, `now`.
    pub(super) fn carry_forward(
        &mut self,
        region: &Region,
        message: &mut BorderMessage,
        now: Tick,
        dt_s: f32,
    ) {
        let told = message.tick;
        let late = now.0.saturating_sub(told.0);
        let late_s = late as f64 * f64::from(dt_s);
        self.most = self.most.max(late);
        let handed_over: BTreeSet<_> = message.transfers.iter().map(|transfer| transfer.body.id).collect();
        let (courses, gravity) = (&mut self.courses, region.physics().gravity);
        message.carry_forward(|id, pose, velocity| {
            let Some(handle) = copy_of(region, id) else {
                *pose = pose.moved(velocity, late_s);
                return;
            };
            let course = courses.entry(id).or_default();
            let mean = course.take_in(velocity, late);
            // Joints pull at what they hold in every tick: that is no hit, and does not shake it.
            if !region.slot(handle).joints.is_empty() {
                let on_the_way = speeded_up(velocity, &mean, 0.5 * SPEED_UP);
                *pose = pose.moved(&on_the_way, late_s);
                *velocity = speeded_up(velocity, &mean, SPEED_UP);
            } else if course.is_alone(told, late) && !handed_over.contains(&id) {
                let state = region.body_state(handle);
                (*pose, *velocity) = (state.pose, state.velocity);
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
    }

    /// Notes which copies were hit in the step of a tick.
    pub(super) fn look_back(&mut self, region: &Region, tick: Tick, dt_s: f32) {
        let least_m_s = (HIT_BY_GRAVITY * dt_s * region.physics().gravity.length()).max(HIT_M_S);
        for (id, course) in &mut self.courses {
            let (Some((linear, angular)), Some(handle)) = (course.was.take(), copy_of(region, *id)) else {
                continue;
            };
            let body = &region.physics().bodies[handle];
            let by_turning = (body.angvel() - angular).length() * region.slot(handle).reach_m;
            if (body.linvel() - linear).length().max(by_turning) > least_m_s {
                let first = course
                    .hit
                    .filter(|(_, last)| last.0 + self.most >= tick.0)
                    .map_or(tick, |(first, _)| first);
                course.hit = Some((first, tick));
            }
        }
    }

    /// Notes how copies move after an exchange.
    pub(super) fn look_ahead(&mut self, region: &Region) {
        self.courses.retain(|id, course| {
            let body = copy_of(region, *id).map(|handle| &region.physics().bodies[handle]);
            course.was = body.map(|body| (body.linvel(), body.angvel()));
            body.is_some()
        });
    }
}

impl Course {
    /// Returns whether the copy goes on as it does here: it was hit after the tick of a state that comes `late` ticks
    /// late, and has not been alone for too long.
    fn is_alone(&self, told: Tick, late: u64) -> bool {
        self.hit.is_some_and(|(first, last)| told < last && told.0 < first.0 + MOST_ALONE * late)
    }

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

/// Returns the share of gravity by which a body falls along each axis: none without mass, or where it is locked.
fn falls_by(body: &RigidBody) -> Vector {
    body.mass_properties().effective_inv_mass * body.mass() * body.gravity_scale()
}

/// Returns a velocity with so many times its lead over the mean of those before.
fn speeded_up(velocity: &Velocity, mean: &Velocity, times: f32) -> Velocity {
    let lead = |v: [f32; 3], mean: [f32; 3]| std::array::from_fn(|i| v[i] + times * (v[i] - mean[i]));
    Velocity { linear: lead(velocity.linear, mean.linear), angular: lead(velocity.angular, mean.angular) }
}

fn differ_m_s(a: &Velocity, b: &Velocity) -> f32 {
    (Vector::from(a.linear) - Vector::from(b.linear)).length()
}

fn add(velocity: &Velocity, change: Vector) -> Velocity {
    Velocity { linear: (Vector::from(velocity.linear) + change).into(), ..*velocity }
}

/// Returns the copy of a dynamic body that another region owns.
fn copy_of(region: &Region, id: BodyId) -> Option<RigidBodyHandle> {
    let handle = region.handle_of(id)?;
    let is_copy = matches!(region.slot(handle).role, Ownership::Replica { .. });
    (is_copy && region.physics().bodies.get(handle).is_some_and(RigidBody::is_dynamic)).then_some(handle)
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use rapier3d::prelude::*;

    use crate::physics::{Coupling, Measured, Partition, RegionHost, StepSettings};
    use crate::protocol::{BorderMessage, Push, Velocity, WorldPose};
    use crate::scene::{Params, Scene};
    use crate::space::{BodyId, Bounds, DistributionTree, RegionId};

    /// Two regions whose messages to each other come some ticks late.
    struct Apart {
        hosts: Vec<RegionHost>,
        under_way: VecDeque<Vec<BorderMessage>>,
        late: usize,
    }

    impl Apart {
        fn new(scene: &Scene, late: usize) -> Self {
            let tree = DistributionTree::halved(Bounds::around([0.0; 3], [20.0; 3]), 2).unwrap();
            let partition = Partition::new(tree, Some(2.0));
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
            let mut apart = Self { hosts, under_way: VecDeque::new(), late: 0 };
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
                        _ => host.accept_late(message, now),
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
    fn a_chain_that_swings_through_a_border_gains_little_energy_up_to_six_ticks_late() {
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
        for late in [1, 3, 6] {
            let gained = (energy_j(late) - at_once_j) / at_once_j.abs();
            assert!((-0.05..0.2).contains(&gained), "{late} ticks late: {:.1} %", 100.0 * gained);
        }
    }

    /// What pushes it on the way is applied again by the process when it has arrived.
    #[test]
    fn a_body_that_is_pushed_while_it_is_handed_over_arrives_as_its_owner_told() {
        let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("ball") };
        let body = RigidBodyBuilder::dynamic().linvel(Vector::X * 2.0);
        scene.push(WorldPose::at([-0.5, 0.0, 0.0]), body, ColliderBuilder::ball(0.5));
        let mut apart = Apart::new(&scene, 6);
        let id = apart.states()[0].0;
        while !apart.states().is_empty() {
            apart.step();
        }
        let push = Push { body: id, linear: [0.0, 5.0, 0.0], angular: [0.0; 3], point: None, lasts: false };
        assert!(apart.hosts.iter_mut().all(|host| host.push(&push)), "both hold it");
        while apart.states().is_empty() {
            apart.step();
        }
        assert_eq!(apart.states()[0].3.linear, [2.0, 0.0, 0.0]);
    }
}
