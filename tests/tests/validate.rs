//! Tests what must hold for all regions between two ticks, in lively scenes, with every coupling.

use dcd::physics::Coupling;
use dcd::prelude::*;

fn validated(scene: &str, parameters: &[&str], regions: usize, coupling: Coupling, ticks: usize) {
    let scene = Scene::open(scene, &Params::from_args(parameters.iter().copied()).unwrap()).unwrap();
    let mut config =
        WorldConfig { partitioning: Partitioning::Regions(regions), ..WorldConfig::for_scene(&scene) };
    config.step = config.step.with_coupling(coupling);
    let mut world = World::from_scene(&scene, config).unwrap();
    let mut shared = 0;
    for tick in 0..ticks {
        assert_eq!(world.validate().unwrap(), [], "{coupling:?} in {regions} regions after tick {tick}");
        world.step().unwrap();
        shared += world.stats().ghosts;
    }
    assert!(shared > 0, "nothing is at a border");
}

#[test]
fn owners_and_holders_agree_after_every_tick() {
    for coupling in Coupling::ALL {
        validated("gas", &["n=150"], 8, coupling, 90);
        validated("heap", &["n=80"], 4, coupling, 90);
        validated("ragdolls", &["count=6"], 3, coupling, 90);
    }
}

#[test]
fn a_body_that_is_put_elsewhere_or_removed_leaves_no_trace() {
    let mut world = World::new(WorldConfig {
        partitioning: Partitioning::Cuts(vec![(dcd::Axis::X, 0.0)]),
        ..WorldConfig::default()
    })
    .unwrap();
    let ball = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.0, 0.0)).gravity_scale(0.0);
    let ids = [-0.6, 0.3, 1.2].map(|x| world.insert(ball(x), ColliderBuilder::ball(0.5)).unwrap());
    for round in 0..60 {
        match round {
            10 => world.set_pose(ids[0], WorldPose::at([9.0, 0.0, 0.0])).unwrap(),
            20 => world.set_pose(ids[0], WorldPose::at([-0.6, 0.0, 0.0])).unwrap(),
            30 => world.remove(ids[1]).unwrap(),
            _ => {}
        }
        assert_eq!(world.validate().unwrap(), [], "before tick {round}");
        world.step().unwrap();
    }
    assert_eq!(world.movable_count(), 2);
}

/// The regions are at rest when the body comes, so nobody would look at what is said.
#[test]
fn a_body_that_comes_into_a_world_at_rest_is_held_by_whom_its_owner_believes() {
    for (kind, coupling) in [RigidBodyType::Dynamic, RigidBodyType::KinematicPositionBased]
        .into_iter()
        .flat_map(|kind| Coupling::ALL.map(|coupling| (kind, coupling)))
    {
        let mut config = WorldConfig { partitioning: Partitioning::Regions(2), ..WorldConfig::default() };
        config.step = config.step.with_coupling(coupling);
        let mut world = World::new(config).unwrap();
        for tick in 0..30 {
            if tick == 2 {
                world.insert(RigidBodyBuilder::new(kind), ColliderBuilder::ball(0.2)).unwrap();
            }
            assert_eq!(world.validate().unwrap(), [], "{coupling:?}, {kind:?}, before tick {tick}");
            world.step().unwrap();
        }
    }
}
