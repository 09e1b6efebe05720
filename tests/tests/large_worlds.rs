//! Tests worlds of many kilometres: bodies far out behave as at the origin.

use dcd::physics::{BodyFilter, WorldRay};
use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, BodyId, Bounds};

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
