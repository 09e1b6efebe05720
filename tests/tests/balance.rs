//! Tests that regions follow the load, and that results do not depend on the positions of the planes.

use dcd::physics::{Coupling, StepSettings};
use dcd::protocol::{Velocity, WorldPose};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, Balance, BodyId, Bounds, Load, RegionId};

fn scene(name: &str, params: &[&str]) -> Scene {
    let params: Vec<_> = params.iter().map(ToString::to_string).collect();
    Scene::named(name, &Params::from_args(&params).unwrap()).unwrap()
}

/// Returns a flat world with one plane across x.
fn cut_at(at: f64) -> LocalWorld {
    coupled(at, Coupling::default())
}

fn coupled(at: f64, coupling: Coupling) -> LocalWorld {
    let config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0; 3]),
        partitioning: Partitioning::Cuts(vec![(Axis::X, at)]),
        step: StepSettings::default().with_coupling(coupling),
        ..WorldConfig::default()
    };
    let mut world = LocalWorld::new(config).unwrap();
    let floor = ColliderBuilder::cuboid(40.0, 0.5, 40.0).translation(Vector::Y * -0.5);
    world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
    world
}

fn owned(world: &LocalWorld) -> Vec<usize> {
    let mut counts = vec![0; world.regions().len()];
    for (_, owner, ..) in world.states() {
        counts[world.regions().position(|region| region.id() == owner).unwrap()] += 1;
    }
    counts
}

/// Returns a crowd: balls that walk along x at 4 m/s, each with a small velocity of its own.
fn crowd(count: u32, threads: usize) -> LocalWorld {
    let config = WorldConfig {
        bounds: Bounds::new([0.0, -2.0, -10.0], [400.0, 6.0, 10.0]),
        partitioning: Partitioning::Regions(8),
        balance: Some(Balance { every_ticks: 10, tolerance: 1.15, ..Balance::keeping(8) }),
        threads,
        ..WorldConfig::default()
    };
    let mut world = LocalWorld::new(config).unwrap();
    let floor = ColliderBuilder::cuboid(300.0, 0.5, 40.0).translation(Vector::new(200.0, -0.5, 0.0));
    world.insert(RigidBodyBuilder::fixed(), floor.friction(0.0)).unwrap();
    for i in 0..count {
        let (row, place) = (i / 20, i % 20);
        let own = (i * 7919 % 100) as f32 / 100.0;
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(1.0 + row as f32, 0.4, place as f32 - 9.5))
            .linvel(Vector::new(4.0 + own, 0.0, 0.3 * own - 0.15))
            .can_sleep(false);
        world.insert(body, ColliderBuilder::ball(0.4).friction(0.0)).unwrap();
    }
    world
}

#[test]
fn a_crowd_that_walks_through_the_world_is_shared_evenly_by_all_regions_all_the_way() {
    let mut world = crowd(600, 2);
    let mut most = 0;
    for tick in 0..4200 {
        world.step().unwrap();
        if tick >= 360 {
            most = most.max(*owned(&world).iter().max().unwrap());
        }
    }
    assert!(world.states().all(|(_, _, pose, _)| pose.translation[0] > 250.0), "they have crossed the world");
    // An island of up to 128 bodies stays whole, and the mean of 8 regions is 75.
    assert!(most <= 75 + 95, "the heaviest region had {most} bodies");
    assert_eq!(world.stats().bodies, 600);
}

#[test]
fn balance_is_the_same_for_any_number_of_threads() {
    let hash = |threads| {
        let mut world = crowd(300, threads);
        (0..400).for_each(|_| world.step().unwrap());
        (world.state_hash(), world.regions().map(|region| *region.cell()).collect::<Vec<_>>())
    };
    assert_eq!(hash(1), hash(3));
}

#[test]
fn a_plane_that_sweeps_through_towers_leaves_them_standing() {
    let mut world = cut_at(-20.0);
    let mut tops = Vec::new();
    for column in 0..6 {
        for level in 0..8 {
            let place = Vector::new(3.0 * column as f32 - 7.5, level as f32 + 0.5, 0.0);
            let body = RigidBodyBuilder::dynamic().translation(place).can_sleep(false);
            tops.push(world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap());
        }
    }
    let before: Vec<_> = tops.iter().map(|&id| world.pose(id).unwrap().translation).collect();
    for tick in 0..1800 {
        // To and fro at up to 2.4 m/s, later at up to 9.6 m/s.
        let at = 12.0 * (f64::from(tick) * 0.2 / 60.0 * if tick < 900 { 1.0 } else { 4.0 }).sin();
        world.move_plane(RegionId(0), at).unwrap();
        world.step().unwrap();
        for &id in &tops {
            assert_eq!(world.owners_of(id), 1, "{id} at tick {tick}");
        }
    }
    assert!(world.stats().transfers > 200, "{} transfers", world.stats().transfers);
    for (id, before) in tops.iter().zip(before) {
        let now = world.pose(*id).unwrap().translation;
        let aside = (now[0] - before[0]).hypot(now[2] - before[2]);
        assert!(aside < 0.02 && (now[1] - before[1]).abs() < 0.03, "{id}: {now:?} was {before:?}");
    }
}

#[test]
fn regions_come_as_bodies_are_inserted_and_go_as_they_are_removed() {
    let config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0; 3]),
        balance: Some(Balance {
            every_ticks: 10,
            split_above: 60.0,
            merge_below: 40.0,
            ..Balance::default()
        }),
        ..WorldConfig::default()
    };
    let mut world = LocalWorld::new(config).unwrap();
    let floor = ColliderBuilder::cuboid(60.0, 0.5, 60.0).translation(Vector::Y * -0.5);
    world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
    let mut ids = Vec::new();
    for i in 0..200 {
        let place = Vector::new(3.0 * (i % 20) as f32 - 30.0, 0.5, 3.0 * (i / 20) as f32 - 15.0);
        let body = RigidBodyBuilder::dynamic().translation(place).linvel(Vector::X * 0.1).can_sleep(false);
        let collider = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
        ids.push(world.insert(body, collider).unwrap());
    }
    let (mut most, mut began, mut ended) = (0, 0, 0);
    for tick in 0..900 {
        world.step().unwrap();
        most = most.max(world.regions().len());
        began += world.events().touches.iter().filter(|touch| touch.began).count();
        ended += world.events().touches.iter().filter(|touch| !touch.began).count();
        for &id in &ids {
            assert_eq!(world.owners_of(id), 1, "{id} at tick {tick}");
        }
        if tick > 300 && ids.len() > 10 {
            world.remove(ids.swap_remove(0)).unwrap();
        }
    }
    assert!(most >= 4, "{most} regions");
    world.step().unwrap();
    ended += world.events().touches.len();
    assert_eq!(ended, 200 - ids.len(), "each let go when it was removed");
    assert_eq!(began, 200, "each touched the floor once, whatever its region was called");
    assert_eq!(world.regions().len(), 1, "ten bodies need one region");
    for id in ids {
        assert!((world.pose(id).unwrap().translation[1] - 0.5).abs() < 0.01, "{id} is on the floor");
    }
}

#[test]
fn what_sleeps_stays_asleep_under_a_plane_that_moves_a_little_and_is_woken_to_follow_when_it_moves_far() {
    let mut world = cut_at(-20.0);
    let report = |collider: ColliderBuilder| collider.active_events(ActiveEvents::COLLISION_EVENTS);
    let boxes: Vec<_> = (0..3)
        .map(|level| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::Y * (level as f32 + 0.5));
            world.insert(body, report(ColliderBuilder::cuboid(0.5, 0.5, 0.5))).unwrap()
        })
        .collect();
    (0..200).for_each(|_| world.step().unwrap());
    let asleep = |world: &LocalWorld| boxes.iter().all(|&id| world.body(id).unwrap().is_sleeping());
    assert!(asleep(&world));
    let (hash, owner) = (world.state_hash(), world.owner_of(boxes[0]));
    world.set_balance(Some(Balance { tolerance: 1e9, ..Balance::keeping(2) })).unwrap();
    let rest = |world: &mut LocalWorld, at| {
        world.move_plane(RegionId(0), at).unwrap();
        for tick in 0..150 {
            world.step().unwrap();
            assert!(world.events().touches.is_empty(), "tick {tick}: {:?}", world.events().touches);
        }
        assert!(asleep(world), "at {at}");
    };
    rest(&mut world, 5.0);
    assert_eq!((world.state_hash(), world.owner_of(boxes[0])), (hash, owner), "nothing has happened");
    rest(&mut world, 20.0);
    assert!(boxes.iter().all(|&id| world.owner_of(id) != owner));
    for (level, &id) in boxes.iter().enumerate() {
        let now = world.pose(id).unwrap().translation;
        assert!((now[1] - level as f64 - 0.5).abs() < 0.02 && now[0].abs() < 0.002, "{now:?}");
    }
}

#[test]
fn a_body_meets_what_slept_when_the_plane_came_to_it() {
    for coupling in Coupling::ALL {
        let mut world = coupled(-20.0, coupling);
        let big = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
        let target =
            world.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 0.5), big.clone()).unwrap();
        let far = RigidBodyBuilder::dynamic().translation(Vector::new(-8.0, 0.5, 0.0)).can_sleep(false);
        let hitter = world.insert(far, big.friction(0.0)).unwrap();
        (0..200).for_each(|_| world.step().unwrap());
        assert!(world.body(target).unwrap().is_sleeping());
        world.move_plane(RegionId(0), 0.6).unwrap();
        (0..150).for_each(|_| world.step().unwrap());
        // Under `owner` and `proxy` nothing is lost when a sleeping body changes owner.
        let stays = !matches!(coupling, Coupling::Owner | Coupling::Proxy);
        assert_eq!(world.owner_of(hitter) != world.owner_of(target), stays, "{coupling:?}");
        world.set_velocity(hitter, Velocity { linear: [12.0, 0.0, 0.0], ..Default::default() }).unwrap();
        (0..120).for_each(|_| world.step().unwrap());
        let (target, hitter) = (world.pose(target).unwrap(), world.pose(hitter).unwrap());
        assert!(target.translation[0] > 0.1, "{coupling:?}: {target:?} was hit");
        assert!(hitter.translation[0] < target.translation[0] - 0.9, "{coupling:?}: {hitter:?} did not pass");
    }
}

#[test]
fn a_world_that_follows_its_load_goes_on_from_a_snapshot_to_the_same_bits() {
    let mut world = crowd(200, 1);
    (0..100).for_each(|_| world.step().unwrap());
    let mut saved = Vec::new();
    world.save(&mut saved).unwrap();
    let mut again = LocalWorld::restore(&saved[..], 1).unwrap();
    for world in [&mut world, &mut again] {
        (0..100).for_each(|_| world.step().unwrap());
    }
    assert_eq!(world.state_hash(), again.state_hash());
    assert_eq!(world.regions().len(), again.regions().len());
}

#[test]
fn planes_move_within_reason_only() {
    let mut world = cut_at(0.0);
    for at in [f64::NAN, f64::INFINITY, 1e9] {
        let error = world.move_plane(RegionId(0), at).unwrap_err().to_string();
        assert!(error.contains("does not cut"), "{error}");
    }
    assert!(world.move_plane(RegionId(1), 0.0).unwrap_err().to_string().contains("no plane"));
    let wrong = Balance { merge_below: 2.0, split_above: 1.0, ..Balance::default() };
    assert!(world.set_balance(Some(wrong)).unwrap_err().to_string().contains("merge_below"));
    world.move_plane(RegionId(0), 1.0).unwrap();
    assert_eq!(world.regions().next().unwrap().cell().max[0], 1.0);
}

#[test]
fn a_convoy_keeps_its_four_regions_busy_along_the_road() {
    let scene = scene("convoy", &["cars=24", "speed=60", "road=20000"]);
    let config = WorldConfig {
        partitioning: Partitioning::Regions(4),
        balance: Some(Balance { every_ticks: 10, ..Balance::keeping(4) }),
        ..WorldConfig::for_scene(&scene)
    };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    (0..1200).for_each(|_| world.step().unwrap());
    let shares = owned(&world);
    assert!(shares.iter().all(|&count| count >= 24), "{shares:?} of {}", world.stats().bodies);
    let lead = world.pose(BodyId::persistent(1)).unwrap();
    assert!(lead.translation[0] > 1000.0, "{lead:?}");
    let heights = world.states().map(|(_, _, WorldPose { translation, .. }, _)| translation[1]);
    assert!(heights.fold(f64::INFINITY, f64::min) > 0.3, "none has sunk");
}

/// Returns the distance of a tower's highest box from its place after 900 ticks. A plane across y moves up
/// and down through the tower at up to 2 m/s; without a plane the tower stands in one bare Rapier world.
fn swept_tower(load_kg: f32, plane: bool, coupling: Coupling) -> f64 {
    let mut scene = Scene::empty("tower");
    let floor = ColliderBuilder::ball(1.0).friction(0.7);
    scene.push_fixed_box([0.0, -0.5, 0.0], [10.0, 0.5, 10.0], &floor);
    for level in 0..10 {
        let mass = if level == 9 { load_kg } else { 1.0 };
        let pose = WorldPose::at([0.0, f64::from(level) + 0.5, 0.0]);
        let collider = ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(mass).friction(0.7);
        scene.push(pose, RigidBodyBuilder::dynamic().can_sleep(false), collider);
    }
    scene.bounds = Bounds::new([-4.0, -2.0, -4.0], [4.0, 14.0, 4.0]);
    let off = |at: [f64; 3]| ((at[1] - 9.5).powi(2) + at[0].powi(2) + at[2].powi(2)).sqrt();
    if !plane {
        let mut bare = scene.bare_world();
        (0..900).for_each(|_| bare.step());
        return off(bare.rigid_bodies().last().unwrap().1.translation().to_array().map(f64::from));
    }
    let config = WorldConfig {
        partitioning: Partitioning::Cuts(vec![(Axis::Y, 1.0)]),
        step: StepSettings { gravity: scene.gravity, ..StepSettings::default().with_coupling(coupling) },
        ..WorldConfig::for_scene(&scene)
    };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    for tick in 0..900 {
        world.move_plane(RegionId(0), 5.0 - 6.0 * (f64::from(tick) / 180.0).cos()).unwrap();
        world.step().unwrap();
    }
    off(world.pose(BodyId::persistent(10)).unwrap().translation)
}

#[test]
fn a_plane_that_goes_up_and_down_a_loaded_tower_leaves_it_as_one_world_does() {
    for load_kg in [1.0, 10.0] {
        let bare = swept_tower(load_kg, false, Coupling::Auto);
        for coupling in [Coupling::Auto, Coupling::Island] {
            let swept = swept_tower(load_kg, true, coupling);
            assert!(swept <= 1.1 * bare + 1e-3, "{coupling:?}, {load_kg} kg: {swept} m against {bare} m");
        }
    }
}

#[test]
fn regions_may_follow_measured_times() {
    let scene = scene("convoy", &["cars=24", "speed=60", "road=20000"]);
    let balance = Balance { every_ticks: 10, load: Load::Times, ..Balance::keeping(4) };
    let config = WorldConfig {
        partitioning: Partitioning::Regions(4),
        balance: Some(balance),
        ..WorldConfig::for_scene(&scene)
    };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    (0..600).for_each(|_| world.step().unwrap());
    let shares = owned(&world);
    assert_eq!(shares.iter().sum::<usize>(), world.stats().bodies);
    // The positions of the planes depend on the machine, but every region must own bodies.
    assert!(shares.iter().all(|&count| count > 0), "{shares:?}");
}

#[test]
fn the_ground_goes_with_the_plane() {
    let config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [200.0, 20.0, 20.0]),
        partitioning: Partitioning::Cuts(vec![(Axis::X, -150.0)]),
        ..WorldConfig::default()
    };
    let mut world = LocalWorld::new(config).unwrap();
    for tile in 0..100 {
        let place = Vector::new(4.0 * tile as f32 - 198.0, -0.5, 0.0);
        world
            .insert(RigidBodyBuilder::fixed().translation(place), ColliderBuilder::cuboid(2.0, 0.5, 5.0))
            .unwrap();
    }
    let ball = RigidBodyBuilder::dynamic().translation(Vector::new(100.0, 0.5, 0.0)).can_sleep(false);
    let ball = world.insert(ball, ColliderBuilder::ball(0.5)).unwrap();
    let tiles =
        |world: &LocalWorld| world.regions().map(|region| region.bodies().count()).collect::<Vec<_>>();
    let before = tiles(&world);
    assert!(before[0] < 30 && before[1] > 85, "{before:?}");
    world.move_plane(RegionId(0), 150.0).unwrap();
    for _ in 0..120 {
        world.step().unwrap();
        assert!((world.pose(ball).unwrap().translation[1] - 0.5).abs() < 0.01, "it has ground under it");
    }
    assert_eq!(world.owner_of(ball), Some(world.regions().next().unwrap().id()));
    world.move_plane(RegionId(0), 140.0).unwrap();
    let after = tiles(&world);
    assert!(after[0] > 85 && after[1] < 30, "each has the ground of its own cell: {after:?}");
}

#[test]
fn settings_that_were_read_can_be_given_back_while_regions_follow_the_load() {
    let balance = Some(Balance { every_ticks: 10, ..Balance::keeping(4) });
    let config = WorldConfig { partitioning: Partitioning::Regions(4), balance, ..WorldConfig::default() };
    let mut world = dcd::World::new(config).unwrap();
    let before = world.settings().unwrap();
    assert_eq!(before.island_limit, StepSettings::default().island_limit);
    for i in 0..400 {
        let at = Vector::new((i % 20) as f32 * 2.0 - 20.0, 1.0, (i / 20) as f32 * 2.0 - 20.0);
        world.insert(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.4)).unwrap();
    }
    for _ in 0..30 {
        world.step().unwrap();
    }
    assert_eq!(world.settings().unwrap().island_limit, before.island_limit);
    world.set_settings(StepSettings { gravity: [0.0; 3], ..before }).unwrap();
}

/// Returns the Rapier body of this id.
fn body_of(world: &LocalWorld, id: BodyId) -> &RigidBody {
    let of = |region: &'_ dcd::physics::Region| region.handle_of(id).is_some();
    let region = world.regions().find(|region| of(region)).unwrap();
    &region.physics().bodies[region.handle_of(id).unwrap()]
}

/// Returns a world with a floor, cut into two regions at x = 0.
fn two_regions(balance: Balance) -> LocalWorld {
    let config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0; 3]),
        partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]),
        balance: Some(balance),
        ..WorldConfig::default()
    };
    let mut world = LocalWorld::new(config).unwrap();
    let floor = ColliderBuilder::cuboid(60.0, 0.5, 60.0).translation(Vector::Y * -0.5);
    world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
    world
}

#[test]
fn an_island_that_lies_over_a_plane_sleeps_while_regions_follow_the_load() {
    let mut world = two_regions(Balance { every_ticks: 10, tolerance: 1e9, ..Balance::keeping(2) });
    let row: Vec<_> = (0..10)
        .map(|i| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(i as f32 * 4.0 - 23.99, 2.0, 0.0));
            world.insert(body, ColliderBuilder::cuboid(2.0, 2.0, 2.0)).unwrap()
        })
        .collect();
    (0..300).for_each(|_| world.step().unwrap());
    assert_eq!(owned(&world), [10, 0], "it is the left one's, which reaches far into the right one's cell");
    for tick in 0..60 {
        world.step().unwrap();
        for &id in &row {
            assert!(body_of(&world, id).is_sleeping(), "{id} is awake {tick} ticks later");
        }
    }
}

#[test]
fn a_disabled_body_does_not_keep_a_region_from_being_given_up() {
    let merge_below = 1_000.0;
    let mut world = two_regions(Balance { every_ticks: 10, merge_below, ..Balance::default() });
    let disabled = [-20.0, 20.0].map(|x| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.5, 0.0)).enabled(false);
        world.insert(body, ColliderBuilder::ball(0.5)).unwrap()
    });
    for x in [-10.0, 10.0] {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.5, 0.0)).can_sleep(false);
        world.insert(body, ColliderBuilder::ball(0.5)).unwrap();
    }
    assert_eq!(world.regions().len(), 2);
    (0..200).for_each(|_| world.step().unwrap());
    assert_eq!(world.regions().len(), 1);
    for id in disabled {
        assert!(!body_of(&world, id).is_enabled());
        assert_eq!(world.owners_of(id), 1);
    }
}
