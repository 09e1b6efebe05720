//! Tests that bits do not depend on threads: their number, how regions share them, and whose they are.

use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, BodyId, Bounds};
use rapier3d::prelude::*;

fn insert_floor(world: &mut LocalWorld) -> BodyId {
    let body = RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0));
    world.insert(body, ColliderBuilder::cuboid(50.0, 0.5, 50.0)).unwrap()
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        let mut world = LocalWorld::new(WorldConfig {
            partitioning: Partitioning::Regions(8),
            bounds: Bounds::around([0.0, 4.0, 0.0], [6.0, 4.0, 6.0]),
            threads,
            ..WorldConfig::default()
        })
        .unwrap();
        insert_floor(&mut world);
        for i in 0..300 {
            let (x, y, z) =
                ((i * 7 % 11) as f32 - 5.0, 1.0 + (i / 20) as f32 * 1.2, (i * 5 % 13) as f32 - 6.0);
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, y, z));
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.4, 0.3)).unwrap();
        }
        for _ in 0..200 {
            world.step().unwrap();
        }
        (world.state_hash(), world.stats().transfers)
    };
    let one = run(1);
    assert!(one.1 > 20, "only {} transfers: the test needs traffic", one.1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(4));
}

#[test]
fn regions_with_several_threads_each_give_the_same_bits() {
    let pile = Scene::named("pile", &Params::new().with("n", 500)).unwrap();
    // So many bodies near the border that all threads of a team look at them; and a cut that leaves nearly
    // all bodies in one region.
    let gas = Params::new().with("n", 3000).with("fill", 0.2).with("speed", 20);
    let gas = Scene::named("gas", &gas).unwrap();
    let aside = Partitioning::Cuts(vec![(Axis::X, 4.4)]);
    let run = |scene: &Scene, partitioning: &Partitioning, threads| {
        let partitioning = partitioning.clone();
        let config = WorldConfig { partitioning, threads, ..WorldConfig::for_scene(scene) };
        let mut world = LocalWorld::from_scene(scene, config).unwrap();
        for _ in 0..60 {
            world.step().unwrap();
        }
        world.state_hash()
    };
    let in_regions = [(&pile, 1), (&pile, 2), (&pile, 3), (&gas, 2)];
    let in_regions = in_regions.map(|(scene, regions)| (scene, Partitioning::Regions(regions)));
    for (scene, partitioning) in in_regions.into_iter().chain([(&gas, aside)]) {
        let one = run(scene, &partitioning, 1);
        for threads in [2, 5] {
            assert_eq!(one, run(scene, &partitioning, threads), "{partitioning:?} on {threads} threads");
        }
    }
}

#[test]
fn a_world_may_be_stepped_on_a_pool_of_the_users() {
    let worlds = || -> Vec<_> {
        let world = |threads| {
            let mut world = LocalWorld::new(WorldConfig { threads, ..WorldConfig::default() }).unwrap();
            insert_floor(&mut world);
            for i in 0..300 {
                let at =
                    Vector::new((i % 10) as f32 * 1.5, 1.0 + (i / 100) as f32, (i / 10 % 10) as f32 * 1.5);
                world
                    .insert(
                        RigidBodyBuilder::dynamic().translation(at),
                        ColliderBuilder::cuboid(0.5, 0.5, 0.5),
                    )
                    .unwrap();
            }
            world
        };
        [1, 1, 1, 2, 2].map(world).into()
    };
    let step = |world: &mut LocalWorld| {
        for _ in 0..20 {
            world.step().unwrap();
        }
        world.state_hash()
    };
    let alone: Vec<_> = worlds().iter_mut().map(step).collect();
    let pool = rapier3d::rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let mut worlds = worlds();
    let mut hashes = vec![0; worlds.len()];
    pool.scope(|scope| {
        for (world, hash) in worlds.iter_mut().zip(&mut hashes) {
            scope.spawn(|_| *hash = step(world));
        }
    });
    assert_eq!(alone, hashes);
}
