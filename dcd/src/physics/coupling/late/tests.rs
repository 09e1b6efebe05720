//! Tests what comes late against what comes at once, in two regions.

use std::collections::{BTreeSet, VecDeque};

use rapier3d::prelude::*;

use crate::physics::coupling::replay::replay_multibodies;
use crate::physics::{Coupling, LinkSettings, Measured, Partition, RegionHost, StepSettings};
use crate::protocol::{BorderMessage, JointRecord, Push, Velocity, WorldPose};
use crate::scene::{Params, Scene, SceneJoint};
use crate::space::{BodyId, Bounds, DistributionTree, JointId, RegionId};

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
        Self::cut_at(0.0, scene, late)
    }

    fn cut_at(x: f64, scene: &Scene, late: usize) -> Self {
        let around = Bounds::around([x, 0.0, 0.0], [20.0; 3]);
        let tree = DistributionTree::halved(around, 2).unwrap();
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
            assert!(off_m < 0.02 && speed < 0.05, "{late} ticks late: box {i} {off_m} m off, at {speed} m/s");
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
        let off_m =
            |i: usize| Vector::from(std::array::from_fn(|k| (landed[i][k] - at_once[i][k]) as f32)).length();
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
            let at_ends =
                SphericalJointBuilder::new().local_anchor1(Vector::X * 0.25).local_anchor2(Vector::X * -0.25);
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
fn a_chain_that_comes_from_afar_flies_on_in_another_region_and_hits_what_is_there_however_late_that_hears() {
    for x in [0.6, 1.0, 2.0, 3.0, 4.5, 18.0] {
        for speed in [2.0, 8.0] {
            let at_once = thrown(0, speed, x).0;
            for late in [1, 3, 6, 12] {
                let ends = thrown(late, speed, x).0;
                let off_m = ends.iter().flatten().zip(at_once.iter().flatten()).map(|(a, b)| (a - b).abs());
                let off_m = off_m.fold(0.0, f64::max);
                assert!(off_m < 1e-3, "{late} ticks late, {speed} m/s, ball at {x} m: {off_m} m off");
            }
        }
    }
}

#[test]
fn a_multibody_that_turns_falls_on_into_another_region_however_late_that_hears() {
    let fallen = |late| {
        let mut scene = Scene { gravity: [4.0, 0.0, 0.0], ..Scene::empty("falling") };
        for i in 0..6 {
            let at = WorldPose::at([-6.0 + 0.5 * f64::from(i), 0.0, 0.0]);
            let body = RigidBodyBuilder::dynamic().can_sleep(false);
            let b = scene.push(at, body, ColliderBuilder::cuboid(0.2, 0.1, 0.1));
            if let Some(a) = b.checked_sub(1) {
                let hinge = RevoluteJointBuilder::new(Vector::Z)
                    .local_anchor1(Vector::X * 0.25)
                    .local_anchor2(Vector::X * -0.25);
                let multibody = Some(LinkSettings::default());
                scene.joints.push(SceneJoint { a, b, joint: hinge.into(), multibody });
            }
        }
        let mut apart = Apart::new(&scene, late);
        let (first, .., pose, _) = apart.states()[0];
        for joint in apart.hosts[0].all_joints_of(first).into_keys() {
            assert!(apart.hosts[0].set_link_velocity(joint, [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        }
        (0..150).for_each(|_| apart.step());
        let states = apart.states();
        assert_eq!(states.len(), 6, "{late} ticks late: none is under way");
        assert!(states.iter().all(|(.., region, _, _)| *region == RegionId(2)), "{late} ticks late");
        assert!(states[0].2.rotation[2].abs() > 0.1, "it has turned from {pose:?}");
        states.iter().map(|(.., pose, _)| pose.translation).collect::<Vec<_>>()
    };
    let at_once = fallen(0);
    for late in [1, 3, 6, 12] {
        let ends = fallen(late);
        let off_m = ends.iter().flatten().zip(at_once.iter().flatten()).map(|(a, b)| (a - b).abs());
        let off_m = off_m.fold(0.0, f64::max);
        assert!(off_m < 0.03, "{late} ticks late: {off_m} m off");
    }
}

#[test]
fn multibodies_that_tumble_down_stairs_into_another_region_gain_no_energy_however_late_that_hears() {
    let params = Params::new().with("count", 10).with("sleep", 0).with("multibody", 1);
    let mut scene = Scene::named("ragdolls", &params).unwrap();
    // Thrown, their limbs are faster than the bound below in one world, too.
    for body in &mut scene.bodies {
        (body.body.linvel, body.body.angvel) = (Vector::ZERO, Vector::ZERO);
    }
    for late in [1, 6, 12] {
        let mut apart = Apart::cut_at(3.0, &scene, late);
        let energy_j = |apart: &Apart| apart.hosts.iter().map(RegionHost::energy_j).sum::<f64>();
        let owners = |apart: &Apart| {
            apart.states().iter().map(|&(id, region, ..)| (id, region)).collect::<BTreeSet<_>>()
        };
        let (at_first_j, at_first) = (energy_j(&apart), owners(&apart));
        let (mut has_crossed, mut fastest_m_s) = (false, 0.0_f32);
        for tick in 0..300 {
            apart.step();
            let now_j = energy_j(&apart);
            assert!(now_j < at_first_j, "{late} ticks late, tick {tick}: {now_j} J, {at_first_j} J at first");
            has_crossed |= !owners(&apart).is_subset(&at_first);
            let speeds =
                apart.states().into_iter().map(|(.., velocity)| Vector::from(velocity.linear).length());
            fastest_m_s = speeds.fold(fastest_m_s, f32::max);
        }
        // In step 8.2 m/s.
        assert!(fastest_m_s < 14.0, "{late} ticks late: {fastest_m_s} m/s");
        assert!(has_crossed, "none went over the border");
    }
}

/// Rapier would end the program.
#[test]
fn what_can_be_no_link_is_not_computed_again_as_one() {
    let params = Params::new().with("count", 1).with("multibody", 1);
    let apart = Apart::new(&Scene::named("ragdolls", &params).unwrap(), 1);
    let host = apart.hosts.iter().find(|host| Measured::states(*host).len() == 11).unwrap();
    let region = host.regions().next().unwrap();
    let (states, joint) = (Measured::states(host), host.joint(JointId(0)).unwrap());
    let start = |id| {
        states
            .iter()
            .find(|state| state.0 == id)
            .map(|state| (region.handle_of(id).unwrap(), state.2, state.3))
            .unwrap()
    };
    let ends = [start(joint.a), start(joint.b)];
    let replayed = |start: &[_], joint: &JointRecord| {
        replay_multibodies(region, start, &mut [joint.clone()], 3, 1.0 / 60.0).is_some()
    };
    assert!(replayed(&ends, &joint));
    let fixed = region.physics().bodies.iter().find(|(_, body)| body.is_fixed()).unwrap().0;
    let to_ground = JointRecord { b: region.slot(fixed).id, ..joint.clone() };
    assert!(!replayed(&ends, &to_ground));
    assert!(!replayed(&ends[..1], &joint), "its link is not among those that are handed over");
}

#[test]
fn a_chain_that_hangs_from_a_trolley_goes_along_into_another_region_however_late_that_hears() {
    let carried = |late, multibody| {
        let mut scene = Scene::empty("trolley");
        let trolley = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 2.0);
        scene.push(WorldPose::at([-6.0, 3.0, 0.0]), trolley, ColliderBuilder::cuboid(0.2, 0.1, 0.2));
        for a in 0..4 {
            let body = RigidBodyBuilder::dynamic().can_sleep(false).linvel(Vector::X * 2.0);
            let at = WorldPose::at([-6.0, 2.5 - 0.5 * a as f64, 0.0]);
            let b = scene.push(at, body, ColliderBuilder::cuboid(0.1, 0.2, 0.1));
            let at_ends =
                SphericalJointBuilder::new().local_anchor1(Vector::Y * -0.25).local_anchor2(Vector::Y * 0.25);
            // Nothing kinematic is part of a multibody.
            let multibody = if a == 0 { None } else { multibody };
            scene.joints.push(SceneJoint { a, b, joint: at_ends.into(), multibody });
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
    for (multibody, within_m) in [(None, 1e-3), (Some(LinkSettings::default()), 0.02)] {
        let at_once = carried(0, multibody);
        for late in [1, 3, 6, 12] {
            let end = carried(late, multibody);
            let off_m = (end.0 - at_once.0).abs().max((end.1 - at_once.1).abs());
            assert!(off_m < within_m, "{late} ticks late, its end is at {end:?}, not {at_once:?}");
        }
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
        let push = Push { body: id, linear: [0.0, 5.0, 0.0], angular: [0.0; 3], point: None, lasts: false };
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
                assert!(!is_off, "{late} ticks late, bounce {bounce}, at {x} m: {parted:?}, not {at_once:?}");
            }
        }
    }
}
