//! Tests worlds of many kilometres: bodies far out behave as at the origin. Measures worlds of many bodies, most
//! of which are at rest.

use std::time::{Duration, Instant};

use dcd::net::JoinRole;
use dcd::physics::{BodyFilter, WorldRay};
use dcd::protocol::{Pace, WorldPose};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{
    JoinConfig, LocalWorld, Member, MemberConfig, Origin, Partitioning, ServeConfig, ServerProcess,
    WorldConfig,
};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, BodyId, Bounds, Tick};

/// Inserts a slab with three boxes on it at this place. Returns the boxes.
fn stack(world: &mut LocalWorld, at: [f64; 3]) -> Vec<BodyId> {
    let lifted = |y: f64| WorldPose::at([at[0], at[1] + y, at[2]]);
    let slab = ColliderBuilder::cuboid(5.0, 0.5, 5.0);
    world.insert_at(lifted(-0.5), RigidBodyBuilder::fixed(), vec![slab]).unwrap();
    let boxes = [0.5, 1.5, 2.5].map(|y| {
        let body = RigidBodyBuilder::dynamic().can_sleep(false);
        world.insert_at(lifted(y + 0.01), body, vec![ColliderBuilder::cuboid(0.5, 0.5, 0.5)]).unwrap()
    });
    boxes.to_vec()
}

#[test]
fn bodies_100_km_apart_keep_millimetres() {
    let far = [100_000.3, 0.0, -70_000.7];
    let heights = |at: [f64; 3]| {
        let mut world = LocalWorld::new(WorldConfig {
            bounds: Bounds::around([0.0; 3], [120_000.0; 3]),
            partitioning: Partitioning::Cuts(vec![(Axis::X, 50_000.0)]),
            ..WorldConfig::default()
        })
        .unwrap();
        stack(&mut world, [0.25, 0.0, 0.75]);
        let boxes = stack(&mut world, at);
        (0..120).for_each(|_| world.step().unwrap());
        boxes.iter().map(|&id| world.pose(id).unwrap().translation).collect::<Vec<_>>()
    };
    let (near, far_out) = (heights([0.3, 0.0, -0.7]), heights(far));
    for (near, far_out) in near.iter().zip(&far_out) {
        let offset = [0.3 - far[0], 0.0, -0.7 - far[2]];
        let off = (0..3).map(|i| (far_out[i] + offset[i] - near[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-3, "{off} m");
    }
}

/// The fixed body comes first, when the origin of the only region is still far from there.
#[test]
fn what_is_fixed_far_out_holds_what_is_joined_to_it_where_it_was_put() {
    for far in [100_000.3, 20_000_000.3] {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        let cube = || vec![ColliderBuilder::cuboid(0.2, 0.2, 0.2)];
        let at = |aside: f64| WorldPose::at([far + aside, 0.0, 0.0]);
        let post = world.insert_at(at(0.0), RigidBodyBuilder::fixed(), cube()).unwrap();
        let arm = world.insert_at(at(1.0), RigidBodyBuilder::dynamic(), cube()).unwrap();
        let joint = FixedJointBuilder::new().local_anchor1(Vector::X);
        world.insert_joint(post, arm, joint).unwrap();
        (0..120).for_each(|_| world.step().unwrap());
        let aside = world.pose(arm).unwrap().translation[0] - far;
        assert!((aside - 1.0).abs() < 1e-3, "{far} m out it is {aside} m aside");
    }
}

#[test]
fn a_stack_that_is_carried_a_hundred_kilometres_arrives_as_it_left() {
    // One region, whose floating origin (anchor) must follow.
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let belt = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 400.0);
    world.insert(belt, ColliderBuilder::cuboid(5.0, 0.5, 5.0).translation(Vector::Y * -0.5)).unwrap();
    let boxes = [0.5, 1.5, 2.5].map(|y| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::Y * y).linvel(Vector::X * 400.0);
        world.insert(body.can_sleep(false), ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
    });
    let offsets = |world: &LocalWorld| {
        let place = |id| world.pose(id).unwrap().translation;
        let base = place(BodyId::persistent(0));
        boxes.map(|id| std::array::from_fn::<_, 3, _>(|i| place(id)[i] - base[i]))
    };
    (0..200).for_each(|_| world.step().unwrap());
    let before = offsets(&world);
    (0..15_000).for_each(|_| world.step().unwrap());
    assert!(world.pose(boxes[0]).unwrap().translation[0] > 100_000.0);
    for (before, after) in before.iter().zip(offsets(&world)) {
        let off = (0..3).map(|i| (after[i] - before[i]).abs()).fold(0.0, f64::max);
        assert!(off < 2e-3, "{off} m: {after:?} was {before:?}");
    }
}

/// The mean speed of a convoy's cars, and the mean and the spread of their heights.
#[derive(Debug, Default)]
struct Ride {
    speed_m_s: f64,
    height_m: f64,
    spread_m: f64,
}

const CARS: u32 = 3;

fn ride(samples: &[(f64, f64)]) -> Ride {
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| samples.iter().map(of).sum::<f64>() / samples.len() as f64;
    let height_m = mean(&|sample| sample.1);
    let spread_m = mean(&|sample| (sample.1 - height_m).powi(2)).sqrt();
    Ride { speed_m_s: mean(&|sample| sample.0), height_m, spread_m }
}

#[test]
fn a_convoy_drives_100_km_through_hundreds_of_regions_as_it_drives_at_the_origin() {
    let params = ["cars=3", "speed=150", "road=100000"].map(str::to_owned);
    let scene = Scene::named("convoy", &Params::from_args(&params).unwrap()).unwrap();
    let mut bare = scene.bare_world();
    let mut near = Vec::new();
    for tick in 0..900 {
        bare.step();
        for car in 0..CARS as usize {
            let (_, body) = bare.rigid_bodies().nth(1 + 8 * car).unwrap();
            if tick >= 600 {
                near.push((f64::from(body.linvel().x), f64::from(body.translation().y)));
            }
        }
    }
    let config = WorldConfig { partitioning: Partitioning::Regions(256), ..WorldConfig::for_scene(&scene) };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    let cars: Vec<_> = (0..CARS).map(|car| BodyId::persistent(1 + 8 * car)).collect();
    let mut crossed = std::collections::BTreeSet::new();
    let mut rides = Vec::new();
    while world.pose(cars[0]).unwrap().translation[0] < 100_000.0 {
        let mut samples = Vec::new();
        for _ in 0..600 {
            world.step().unwrap();
            for &car in &cars {
                crossed.insert(world.owner_of(car).unwrap());
                let velocity = world.velocity(car).unwrap().linear;
                samples.push((f64::from(velocity[0]), world.pose(car).unwrap().translation[1]));
            }
        }
        rides.push(ride(&samples));
        assert!(rides.len() < 150, "it does not get on");
    }
    assert!(crossed.len() > 200, "{} regions", crossed.len());
    assert_eq!(world.stats().quarantined, 0);
    let near = ride(&near);
    for far in &rides[1..] {
        assert!((far.speed_m_s / near.speed_m_s - 1.0).abs() < 1e-4, "{far:?}, {near:?}");
        assert!((far.height_m - near.height_m).abs() < 1e-4, "{far:?}, {near:?}");
        assert!(far.spread_m < near.spread_m + 1e-4, "{far:?}, {near:?}");
    }
}

#[test]
fn a_ray_finds_the_ground_where_it_is_as_the_origin_of_its_region_follows_the_player() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let slab = || vec![ColliderBuilder::cuboid(5.0, 0.5, 5.0)];
    let at = |x: f64, y: f64| WorldPose::at([x, y, 0.0]);
    let ground = world.insert_at(at(50_000.0, -0.5), RigidBodyBuilder::fixed(), slab()).unwrap();
    world.step().unwrap();
    let found = |world: &LocalWorld, x: f64, player: BodyId| {
        let filter = BodyFilter { exclude_bodies: &[player], ..BodyFilter::default() };
        let ray = WorldRay::new([x, 10.0, 0.0], [0.0, -1.0, 0.0]);
        world.queries().cast_ray(&ray, &filter).unwrap().map(|hit| hit.body)
    };
    let spawn = |world: &mut LocalWorld, x: f64| {
        let body = RigidBodyBuilder::dynamic();
        let player = world.insert_at(at(x, 1.0), body, vec![ColliderBuilder::ball(0.5)]).unwrap();
        assert_eq!(found(world, 50_000.0, player), Some(ground), "the player is at {x}");
        let mut elsewhere = (50..=150).map(|km| 1_000.0 * f64::from(km) + 176.0);
        assert!(elsewhere.all(|place| found(world, place, player).is_none()), "the player is at {x}");
        world.step().unwrap();
        assert_eq!(found(world, 50_000.0, player), Some(ground), "after a step");
        player
    };
    let player = spawn(&mut world, 50_000.0);
    world.remove(player).unwrap();
    spawn(&mut world, 53_000.0);
}

/// Returns a world in which so many boxes rest three metres apart, and a thousand others fly about in a closed
/// room beside them. Each row of boxes has ground of its own: when a pair comes near, Rapier looks through all
/// pairs of its colliders, which takes minutes where one collider is in 100,000 of them.
fn room_beside(resting: usize) -> Scene {
    let mut scene = Scene::empty("room");
    let smooth = ColliderBuilder::ball(1.0).restitution(1.0).friction(0.0);
    let room = [-70.0, 20.0, 20.0];
    for (axis, side) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0), (2, -1.0), (2, 1.0)] {
        let (mut at, mut half_m) = (room, [22.0; 3]);
        (at[axis], half_m[axis]) = (room[axis] + side * 21.0, 1.0);
        scene.push_fixed_box(at, half_m, &smooth);
    }
    for i in 0..1_000u32 {
        let place = [i % 10, i / 10 % 10, i / 100].map(|k| 3.6 * f64::from(k) - 16.2);
        let speed = [7, 11, 13].map(|k| (i * k % 21) as f32 * 0.5 - 5.0);
        let body = RigidBodyBuilder::dynamic().gravity_scale(0.0).linvel(speed.into()).can_sleep(false);
        let collider = ColliderBuilder::cuboid(0.5, 0.5, 0.5).restitution(1.0).friction(0.0);
        scene.push(WorldPose::at(std::array::from_fn(|k| room[k] + place[k])), body, collider);
    }
    for row in 0..resting.div_ceil(316) {
        let middle = [474.0, -0.5, 3.0 * row as f64];
        scene.push_fixed_box(middle, [480.0, 0.5, 1.4], &ColliderBuilder::ball(1.0));
    }
    for i in 0..resting {
        let at = [3.0 * (i % 316) as f64, 0.5, 3.0 * (i / 316) as f64];
        let body = RigidBodyBuilder::dynamic().sleeping(true);
        scene.push(WorldPose::at(at), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    scene.bounds = Bounds::new([-100.0, -1.0, -10.0], [960.0, 60.0, 960.0]);
    scene
}

const WARM_UP: u64 = 30;
const MEASURED: u64 = 60;

/// Returns the milliseconds of the median tick of a local world.
fn local_ms(scene: &Scene, partitioning: Partitioning) -> f64 {
    let config = WorldConfig { partitioning, threads: 1, ..WorldConfig::for_scene(scene) };
    let mut world = LocalWorld::from_scene(scene, config).unwrap();
    (0..WARM_UP).for_each(|_| world.step().unwrap());
    let awake = world.states().filter(|&(id, ..)| !world.body(id).unwrap().is_sleeping()).count();
    assert_eq!(awake, 1_000, "these fly, and all others rest");
    let mut times: Vec<_> = (0..MEASURED)
        .map(|_| {
            let begins = Instant::now();
            world.step().unwrap();
            begins.elapsed()
        })
        .collect();
    times.sort_unstable();
    1e3 * times[times.len() / 2].as_secs_f64()
}

/// Returns the milliseconds of a tick of a world that two nodes of this process compute as fast as they can.
fn served_ms(scene: &Scene) -> f64 {
    const LIMIT: Duration = Duration::from_secs(600);
    let partitioning = Partitioning::Cuts(vec![(Axis::X, -20.0)]);
    let world = WorldConfig { partitioning, threads: 1, ..WorldConfig::for_scene(scene) };
    let data = tempfile::tempdir().unwrap();
    let config = ServeConfig { nodes: 2, pace: Pace::Unpaced, ..ServeConfig::new(data.path()) };
    let server = ServerProcess::start(Origin::Scene(scene, &world), config).unwrap();
    let node = || {
        let token = server.token(JoinRole::Node, LIMIT).unwrap();
        let identity = JoinConfig::new(server.address, token).join(JoinRole::Node).unwrap();
        Member::start(MemberConfig::new(server.address, identity)).unwrap()
    };
    let nodes = [node(), node()];
    let reached = |tick: u64| {
        assert!(server.wait(LIMIT, |summary, _| summary.tick >= Tick(tick)));
        (Instant::now(), server.summary().tick.0)
    };
    let (begins, first) = reached(WARM_UP);
    let (ends, last) = reached(first + MEASURED);
    let summary = server.stop().unwrap();
    assert_eq!((summary.lost, summary.doubled), (0, 0));
    nodes.into_iter().for_each(|node| drop(node.finish().unwrap()));
    1e3 * (ends - begins).as_secs_f64() / (last - first) as f64
}

#[test]
#[ignore = "measures, on a machine that does nothing else; takes minutes"]
fn a_hundred_thousand_boxes_at_rest_are_measured_beside_a_thousand_that_move() {
    let [alone, beside] = [0, 100_000].map(room_beside);
    let through = || Partitioning::Cuts(vec![(Axis::X, -20.0)]);
    type Ms<'a> = &'a dyn Fn(&Scene) -> f64;
    let cuts: [(&str, Ms<'_>); 4] = [
        ("one region", &|scene| local_ms(scene, Partitioning::Regions(1))),
        ("two regions, cut between both", &|scene| local_ms(scene, through())),
        ("sixteen regions", &|scene| local_ms(scene, Partitioning::Regions(16))),
        ("two nodes, cut between both", &served_ms),
    ];
    for (what, ms) in cuts {
        let (alone_ms, beside_ms) = (ms(&alone), ms(&beside));
        let ratio = beside_ms / alone_ms;
        println!("{what}: {beside_ms:.2} ms per tick, {alone_ms:.2} ms without what rests: {ratio:.2} times");
    }
}
