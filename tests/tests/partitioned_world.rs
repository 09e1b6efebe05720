//! Tests a partitioned world through its public API: what holds for one Rapier world holds for many.

use dcd::physics::{Coupling, StepSettings};
use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig, WorldError};
use dcd::scene::{Params, Scene};
use dcd::sim::Random;
use dcd::space::{Axis, BodyId, Bounds};
use rapier3d::prelude::*;

/// Returns the configuration of two regions that meet at x = 0.
fn two_regions() -> WorldConfig {
    WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() }
}

fn weightless(mut config: WorldConfig) -> WorldConfig {
    config.step.gravity = [0.0; 3];
    config
}

fn coupled(config: WorldConfig, coupling: Coupling) -> WorldConfig {
    WorldConfig { step: config.step.with_coupling(coupling), ..config }
}

fn steps(world: &mut LocalWorld, count: usize) {
    for _ in 0..count {
        world.step().unwrap();
        for (id, ..) in world.states().collect::<Vec<_>>() {
            assert_eq!(world.owners_of(id), 1, "{id} at {}", world.tick());
        }
    }
}

fn ball_at(x: f32, y: f32) -> (RigidBodyBuilder, ColliderBuilder) {
    (RigidBodyBuilder::dynamic().translation(Vector::new(x, y, 0.0)), ColliderBuilder::ball(0.5))
}

fn insert_ball(world: &mut LocalWorld, x: f32, y: f32, vx: f32) -> BodyId {
    let (body, collider) = ball_at(x, y);
    world.insert(body.linvel(Vector::new(vx, 0.0, 0.0)), collider).unwrap()
}

fn insert_floor(world: &mut LocalWorld) -> BodyId {
    let body = RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0));
    world.insert(body, ColliderBuilder::cuboid(50.0, 0.5, 50.0)).unwrap()
}

#[test]
fn a_body_leaving_a_region_is_owned_by_exactly_one_other() {
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(coupled(weightless(two_regions()), coupling)).unwrap();
        let ball = insert_ball(&mut world, -3.0, 0.0, 2.0);
        let first = world.owner_of(ball).unwrap();
        let mut held_before_transfer = false;
        for _ in 0..240 {
            steps(&mut world, 1);
            if world.owner_of(ball) == Some(first) {
                held_before_transfer = world.stats().ghosts == 1;
            }
        }
        assert_ne!(world.owner_of(ball), Some(first), "{coupling:?}");
        // Where regions agree on means, a body that touches nothing has no contacts to lose, and is
        // transferred at once.
        let announced = matches!(coupling, Coupling::Proxy | Coupling::Owner);
        assert_eq!(held_before_transfer, announced, "{coupling:?}");
        assert_eq!((world.stats().transfers, world.stats().ghosts), (1, 0), "{coupling:?}");
        assert!((world.pose(ball).unwrap().translation[0] - 5.0).abs() < 1e-3, "{coupling:?}");
    }
}

#[test]
fn a_body_resting_on_the_border_does_not_change_owner_to_and_fro() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let ball = insert_ball(&mut world, -0.01, 0.0, 0.0);
    for step in 0..600 {
        let speed = if step % 20 < 10 { 0.06 } else { -0.06 };
        world.set_velocity(ball, Velocity { linear: [speed, 0.0, 0.0], angular: [0.0; 3] }).unwrap();
        steps(&mut world, 1);
    }
    assert!(world.stats().transfers <= 1, "{} transfers", world.stats().transfers);
}

#[test]
fn a_transferred_body_keeps_everything() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let body = RigidBodyBuilder::dynamic()
        .translation(Vector::new(-2.0, 0.0, 0.0))
        .linvel(Vector::new(3.0, 0.0, 0.0))
        .linear_damping(0.001)
        .angular_damping(0.5)
        .gravity_scale(0.5)
        .dominance_group(2)
        .locked_axes(LockedAxes::ROTATION_LOCKED_X | LockedAxes::TRANSLATION_LOCKED_Z)
        .additional_solver_iterations(3)
        .additional_mass(2.0)
        .can_sleep(false)
        .ccd_enabled(true)
        .user_data(0xdead_beef_0000_0001);
    let groups = InteractionGroups::new(Group::GROUP_2, Group::GROUP_4, InteractionTestMode::And);
    let colliders = vec![
        ColliderBuilder::cuboid(0.25, 0.5, 0.75).friction(0.9).restitution(0.3).density(3.0).user_data(11),
        ColliderBuilder::ball(0.1).collision_groups(groups).sensor(true).mass(0.25).user_data(12),
    ];
    let id = world.insert_at(WorldPose::at([-2.0, 0.0, 0.0]), body, colliders).unwrap();
    world.update(id, |body| body.add_force(Vector::new(0.5, 0.0, 0.0), true)).unwrap();
    world.update(id, |body| body.add_torque(Vector::new(0.0, 0.125, 0.0), true)).unwrap();
    steps(&mut world, 1); // Rapier folds additional mass in at the first step.
    let before = world.host().record(id).unwrap();
    let inertia = world.body(id).unwrap().mass_properties().local_mprops;
    let owner = world.owner_of(id);
    steps(&mut world, 90);
    assert_ne!(world.owner_of(id), owner, "the body must have crossed");
    let after = world.host().record(id).unwrap();
    assert_eq!(after.traits, before.traits);
    assert_eq!((after.state.force, after.state.torque), (before.state.force, before.state.torque));
    assert_eq!(world.body(id).unwrap().mass_properties().local_mprops, inertia);
    let region = world.regions().find(|region| Some(region.id()) == world.owner_of(id)).unwrap();
    let body = world.body(id).unwrap();
    assert_eq!(body.user_data, 0xdead_beef_0000_0001);
    assert_eq!(body.locked_axes(), LockedAxes::ROTATION_LOCKED_X | LockedAxes::TRANSLATION_LOCKED_Z);
    let collider = |place: usize| &region.physics().colliders[body.colliders()[place]];
    assert_eq!((collider(0).friction(), collider(0).restitution()), (0.9, 0.3));
    assert_eq!((collider(1).collision_groups(), collider(1).is_sensor()), (groups, true));
    assert_eq!((collider(0).user_data, collider(1).user_data), (11, 12));
}

#[test]
fn a_sleeping_body_stays_asleep_when_its_neighbour_is_cut_off_by_a_border() {
    for (coupling, x, ghosts) in [
        (Coupling::Owner, 0.6, 2),
        (Coupling::Overlap, 0.5, 2),
        (Coupling::Island, 0.5, 0),
        (Coupling::Auto, 0.5, 0),
    ] {
        let mut world = LocalWorld::new(coupled(two_regions(), coupling)).unwrap();
        insert_floor(&mut world);
        let left = insert_ball(&mut world, -x, 0.5, 0.0);
        let right = insert_ball(&mut world, x, 0.5, 0.0);
        steps(&mut world, 240);
        for ball in [left, right] {
            assert!(world.body(ball).unwrap().is_sleeping(), "{coupling:?}");
        }
        assert_eq!(world.stats().ghosts, ghosts, "{coupling:?}");
        let ghosts_asleep = world
            .regions()
            .flat_map(|region| region.bodies())
            .all(|(_, _, _, body)| body.is_fixed() || body.is_sleeping());
        assert!(ghosts_asleep, "{coupling:?}: ghosts must sleep with their owners");
    }
}

#[test]
fn waking_crosses_a_border() {
    let mut world = LocalWorld::new(two_regions()).unwrap();
    insert_floor(&mut world);
    let row: Vec<_> = (-3..=3).map(|i| insert_ball(&mut world, i as f32 * 1.001, 0.5, 0.0)).collect();
    steps(&mut world, 120);
    assert!(row.iter().all(|&ball| world.body(ball).unwrap().is_sleeping()));
    world.set_velocity(row[0], Velocity { linear: [4.0, 0.0, 0.0], angular: [0.0; 3] }).unwrap();
    steps(&mut world, 60);
    let far = world.pose(row[6]).unwrap().translation[0];
    assert!(far > 3.1, "the last ball of the row must have been pushed, it is at {far}");
}

#[test]
fn bodies_that_touch_across_a_border_feel_each_other_once() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let bouncy = |builder: ColliderBuilder| {
        builder.restitution(1.0).friction(0.0).active_events(ActiveEvents::COLLISION_EVENTS)
    };
    let mut balls = Vec::new();
    for (x, vx) in [(-2.0, 2.0), (2.0, -2.0)] {
        let (body, collider) = ball_at(x, 0.0);
        balls.push(world.insert(body.linvel(Vector::new(vx, 0.0, 0.0)), bouncy(collider)).unwrap());
    }
    let (mut began, mut ended) = (Vec::new(), Vec::new());
    for _ in 0..120 {
        world.step().unwrap();
        for touch in &world.events().touches {
            if touch.began { began.push(*touch) } else { ended.push(*touch) }
        }
    }
    assert_eq!((began.len(), ended.len()), (1, 1));
    assert_eq!((began[0].key.a, began[0].key.b), (balls[0], balls[1]));
    assert!((began[0].speed - 4.0).abs() < 0.05, "approach speed {}", began[0].speed);
    assert!(began[0].point[0].abs() < 0.1 && began[0].normal[0] > 0.99);
    for (ball, vx) in [(balls[0], -2.0), (balls[1], 2.0)] {
        let speed = world.velocity(ball).unwrap().linear[0];
        assert!((speed - vx).abs() < 0.05, "{ball} moves at {speed}, not {vx}");
    }
}

#[test]
fn a_stack_across_a_border_stands() {
    let mut world = LocalWorld::new(WorldConfig {
        partitioning: Partitioning::Cuts(vec![(Axis::Y, 2.0)]),
        ..WorldConfig::default()
    })
    .unwrap();
    insert_floor(&mut world);
    let boxes: Vec<_> = (0..4)
        .map(|i| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 0.5 + i as f32, 0.0));
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
        })
        .collect();
    steps(&mut world, 300);
    for (i, &id) in boxes.iter().enumerate() {
        let y = world.pose(id).unwrap().translation[1];
        assert!((y - (0.5 + i as f64)).abs() < 0.05, "box {i} is at {y}");
    }
}

#[test]
fn a_tower_under_a_heavy_top_stands_however_many_exchanges_a_tick_has() {
    let params = Params::new().with("top_mass_ratio", 100).with("sleep", 0);
    let scene = Scene::named("tower", &params).unwrap();
    for (exchanges, at) in [(2, 5.0), (4, 5.0), (8, 5.0), (16, 2.5)] {
        let mut config = coupled(WorldConfig::default(), Coupling::Overlap);
        config.partitioning = Partitioning::Cuts(vec![(Axis::Y, at)]);
        config.step.exchanges = exchanges;
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        let before: Vec<_> = world.states().map(|(_, _, pose, _)| pose.translation).collect();
        steps(&mut world, 600);
        let gone = world.states().zip(&before).map(|((_, _, pose, _), before)| {
            (0..3).map(|i| (pose.translation[i] - before[i]).powi(2)).sum::<f64>().sqrt()
        });
        // In one world the top sinks by 0.51 m.
        let worst_m = gone.fold(0.0, f64::max);
        assert!(worst_m < 0.7, "with {exchanges} exchanges a box goes {worst_m} m");
    }
}

#[test]
fn an_assembly_is_owned_and_moved_whole() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let links: Vec<_> = (0..5)
        .map(|i| {
            let body = RigidBodyBuilder::dynamic()
                .translation(Vector::new(-6.0 + i as f32, 0.0, 0.0))
                .linvel(Vector::new(3.0, 0.0, 0.0));
            world.insert(body, ColliderBuilder::ball(0.25)).unwrap()
        })
        .collect();
    for pair in links.windows(2) {
        let joint = SphericalJointBuilder::new()
            .local_anchor1(Vector::new(0.5, 0.0, 0.0))
            .local_anchor2(Vector::new(-0.5, 0.0, 0.0));
        world.insert_joint(pair[0], pair[1], joint).unwrap();
    }
    let first = world.owner_of(links[0]);
    for _ in 0..200 {
        steps(&mut world, 1);
        let owner = world.owner_of(links[0]);
        assert!(links.iter().all(|&link| world.owner_of(link) == owner), "torn apart at {}", world.tick());
    }
    assert_ne!(world.owner_of(links[0]), first);
    for pair in links.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|id| world.pose(id).unwrap().translation[0]);
        assert!((b - a - 1.0).abs() < 1e-3, "joint stretched to {}", b - a);
    }
}

#[test]
fn tying_two_bodies_of_different_regions_brings_them_together() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let a = insert_ball(&mut world, -3.0, 0.0, 0.0);
    let b = insert_ball(&mut world, 4.0, 0.0, 0.0);
    assert_ne!(world.owner_of(a), world.owner_of(b));
    let rope = RopeJointBuilder::new(7.0);
    let joint = world.insert_joint(a, b, rope).unwrap();
    assert_eq!(world.owner_of(a), world.owner_of(b));
    steps(&mut world, 10);
    world.remove_joint(joint).unwrap();
    assert!(matches!(world.remove_joint(joint), Err(WorldError::NoJoint(_))));
    steps(&mut world, 10);
}

#[test]
fn immovable_geometry_is_one_object_in_all_regions() {
    let mut world =
        LocalWorld::new(WorldConfig { partitioning: Partitioning::Regions(8), ..WorldConfig::default() })
            .unwrap();
    let floor = insert_floor(&mut world);
    let shapes: Vec<_> = world
        .regions()
        .filter_map(|region| {
            let body = &region.physics().bodies[region.handle_of(floor)?];
            Some(std::sync::Arc::as_ptr(&region.physics().colliders[body.colliders()[0]].shared_shape().0))
        })
        .collect();
    assert_eq!(shapes.len(), 8, "the floor touches every region's cell");
    assert!(shapes.iter().all(|shape| std::ptr::addr_eq(*shape, shapes[0])));
}

#[test]
fn a_number_of_regions_cuts_by_upright_planes_unless_axes_are_named() {
    let level = |partitioning, gravity, bounds| {
        let config = WorldConfig { partitioning, bounds, ..WorldConfig::default() };
        let tree = WorldConfig { step: StepSettings { gravity, ..config.step }, ..config }.tree().unwrap();
        tree.inner().filter(|&vertex| tree.cut_of(vertex).unwrap().0 == Axis::Y).count()
    };
    let (cube, down) = (Bounds::around([0.0; 3], [64.0; 3]), [0.0, -9.81, 0.0]);
    assert_eq!(level(Partitioning::Regions(8), down, cube), 0);
    assert_eq!(level(Partitioning::Regions(8), [0.0; 3], cube), 2, "without gravity nothing is level");
    assert_eq!(level(Partitioning::Regions(4), [9.0, -3.0, 1.0], cube), 1, "down is along x");
    let shaft = Bounds::around([0.0; 3], [1.0, 64.0, 1.0]);
    assert_eq!(level(Partitioning::Regions(4), down, shaft), 0);
    assert_eq!(
        level(Partitioning::Regions(8), down, shaft),
        7,
        "there is no room for eight beside one another"
    );
    assert_eq!(level(Partitioning::RegionsAcross(4, vec![Axis::Y]), down, cube), 3);
    let nowhere = WorldConfig { partitioning: Partitioning::RegionsAcross(2, vec![]), ..two_regions() };
    assert!(LocalWorld::new(nowhere).is_err());
    let flat =
        WorldConfig { bounds: Bounds::new([-9.0, 0.0, -9.0], [9.0, 0.0, 9.0]), ..WorldConfig::default() };
    assert!(LocalWorld::new(flat).err().unwrap().to_string().contains("below a highest one"));
}

#[test]
fn a_body_faster_than_the_limit_of_its_world_is_refused_by_name() {
    let limited = |limit_m_s| {
        let config = weightless(two_regions());
        WorldConfig { step: config.step.with_speed_limit(limit_m_s), ..config }
    };
    let mut world = LocalWorld::new(limited(50.0)).unwrap();
    let (body, collider) = ball_at(-2.0, 0.0);
    let fast = body.clone().linvel(Vector::X * 51.0);
    let refused = world.insert(fast.clone(), collider.clone()).unwrap_err();
    assert!(matches!(refused, WorldError::TooFast { limit_m_s: 50.0, .. }), "{refused}");
    let ball = world.insert(body, collider.clone()).unwrap();
    let at = |x: f32| Velocity { linear: [x, 0.0, 0.0], angular: [0.0; 3] };
    assert!(matches!(world.set_velocity(ball, at(-51.0)), Err(WorldError::TooFast { .. })));
    world.set_velocity(ball, at(50.0)).unwrap();
    world.update(ball, |body| body.apply_impulse(Vector::X * 1e4, true)).unwrap();
    world.step().unwrap();
    let velocity = world.velocity(ball).unwrap();
    assert!((velocity.linear[0] - 50.0).abs() < 1e-3, "{velocity:?}");
    world.set_velocity(ball, velocity).unwrap();
    let belt = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 900.0);
    world.insert(belt, ColliderBuilder::ball(0.1)).expect("the solver does not move it");

    let mut scene = Scene::empty("shot");
    scene.bounds = Bounds::around([0.0; 3], [8.0; 3]);
    scene.push(WorldPose::default(), fast, collider);
    scene.speed_limit_m_s = 50.0;
    let opened = |scene: &Scene| LocalWorld::from_scene(scene, WorldConfig::for_scene(scene));
    assert!(matches!(opened(&scene), Err(WorldError::TooFast { .. })));
    scene.speed_limit_m_s = 51.0;
    assert_eq!(opened(&scene).unwrap().host().settings().speed_limit_m_s(), 51.0);
}

#[test]
fn a_body_larger_than_its_region_finds_its_ground_and_carries_others() {
    let mut world = LocalWorld::new(WorldConfig {
        bounds: Bounds::around([0.0; 3], [20.0; 3]),
        partitioning: Partitioning::Cuts(vec![(Axis::X, -8.0), (Axis::X, 0.0), (Axis::X, 8.0)]),
        ..WorldConfig::default()
    })
    .unwrap();
    let posts = [-18.0f32, 18.0];
    for x in posts {
        let body = RigidBodyBuilder::fixed().translation(Vector::new(x, 0.5, 0.0));
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 5.0)).unwrap();
    }
    let slab = world
        .insert(
            RigidBodyBuilder::dynamic().translation(Vector::new(-1.0, 1.3, 0.0)),
            ColliderBuilder::cuboid(20.0, 0.25, 5.0),
        )
        .unwrap();
    let pebble = insert_ball(&mut world, 16.0, 2.2, 0.0);
    steps(&mut world, 300);
    let (slab_y, pebble_y) =
        (world.pose(slab).unwrap().translation[1], world.pose(pebble).unwrap().translation[1]);
    assert!((slab_y - 1.25).abs() < 0.05, "the slab lies at {slab_y}");
    assert!((pebble_y - 2.0).abs() < 0.05, "the pebble lies at {pebble_y}");
}

#[test]
fn a_projectile_crosses_several_regions_in_one_step() {
    let cuts = (-9..=9).map(|i| (Axis::X, f64::from(i))).collect();
    let mut world = LocalWorld::new(weightless(WorldConfig {
        partitioning: Partitioning::Cuts(cuts),
        ..WorldConfig::default()
    }))
    .unwrap();
    let shot = insert_ball(&mut world, -12.0, 0.0, 300.0);
    steps(&mut world, 6);
    let x = world.pose(shot).unwrap().translation[0];
    assert!((x - (-12.0 + 300.0 * 6.0 / 60.0)).abs() < 1e-2, "at {x}");
}

#[test]
fn a_changed_collider_is_changed_in_every_region_and_stays_so() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let ball = insert_ball(&mut world, -2.0, 0.0, 2.0);
    let wall = insert_floor(&mut world);
    for body in [ball, wall] {
        world.update_collider(body, 0, |collider| collider.set_friction(0.125)).unwrap();
        world
            .update_collider(body, 0, |collider| collider.set_active_events(ActiveEvents::COLLISION_EVENTS))
            .unwrap();
    }
    world.update(wall, |body| body.user_data = 77).unwrap();
    let mut handovers = Vec::new();
    for _ in 0..120 {
        world.step().unwrap();
        handovers.extend_from_slice(world.handovers());
    }
    let [handover] = handovers[..] else { panic!("{handovers:?}") };
    assert_eq!((handover.body, Some(handover.to)), (ball, world.owner_of(ball)));
    assert_ne!(handover.from, handover.to);
    for id in [ball, wall] {
        let record = world.host().record(id).unwrap();
        assert_eq!(record.traits.colliders[0].friction, 0.125);
        for region in world.regions() {
            let Some(handle) = region.handle_of(id) else { continue };
            let physics = region.physics();
            let collider = &physics.colliders[physics.bodies[handle].colliders()[0]];
            assert_eq!(collider.friction(), 0.125);
            assert_eq!(collider.active_events(), ActiveEvents::COLLISION_EVENTS);
        }
    }
    assert_eq!(world.host().record(wall).unwrap().user_data, 77);
    let missing = world.update_collider(ball, 1, |_| ());
    assert!(matches!(missing, Err(WorldError::NoCollider { index: 1, count: 1, .. })), "{missing:?}");
}

#[test]
fn a_teleported_body_changes_region_at_once_and_keeps_its_epoch_growing() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let ball = insert_ball(&mut world, -10.0, 0.0, 0.0);
    let first = world.owner_of(ball);
    world.set_pose(ball, WorldPose::at([10.0, 1.0, 0.0])).unwrap();
    assert_ne!(world.owner_of(ball), first);
    steps(&mut world, 5);
    assert_eq!(world.pose(ball).unwrap().translation, [10.0, 1.0, 0.0]);
}

#[test]
fn a_body_that_regions_share_has_its_whole_mass_for_the_user() {
    let cut = Partitioning::Cuts(vec![(Axis::Y, 1.0)]);
    let config = WorldConfig { partitioning: cut, ..WorldConfig::default() };
    let mut world = LocalWorld::new(coupled(config, Coupling::Overlap)).unwrap();
    let floor = insert_floor(&mut world);
    let boxes = [0.5, 1.5].map(|y| {
        let body = RigidBodyBuilder::dynamic().can_sleep(false).translation(Vector::new(0.0, y, 0.0));
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(3.0)).unwrap()
    });
    steps(&mut world, 30);
    assert_eq!(world.stats().ghosts, 2, "the test needs bodies that are shared");
    assert!(boxes.iter().all(|&id| (world.mass_kg(id).unwrap() - 3.0).abs() < 1e-5));
    assert!(boxes.iter().all(|&id| (world.body(id).unwrap().mass() - 1.5).abs() < 1e-5));
    assert_eq!(world.mass_kg(floor), Some(0.0));
}

#[test]
fn what_is_removed_before_its_first_step_leaves_nothing_behind() {
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(coupled(two_regions(), coupling)).unwrap();
        let gone = insert_ball(&mut world, 0.1, 3.0, 0.0);
        world.remove(gone).unwrap();
        let stays = insert_ball(&mut world, 0.2, 5.0, 0.0);
        steps(&mut world, 2);
        assert_eq!((world.owners_of(gone), world.owners_of(stays)), (0, 1), "{coupling:?}");
    }
}

#[test]
fn changes_at_any_time_lose_and_double_nothing_in_any_coupling() {
    for (seed, coupling) in
        Coupling::ALL.into_iter().flat_map(|coupling| (0..6).map(move |seed| (seed, coupling)))
    {
        let mut random = Random::new(seed);
        let cuts = Partitioning::Cuts(vec![(Axis::X, 0.0), (Axis::Y, 1.5)]);
        let config = WorldConfig { partitioning: cuts, ..WorldConfig::default() };
        let mut world = LocalWorld::new(coupled(config, coupling)).unwrap();
        insert_floor(&mut world);
        let (mut bodies, mut joints) = (Vec::new(), Vec::new());
        let somewhere = |random: &mut Random| [random.unit() * 5.0 - 2.5, random.unit() * 4.0 + 0.5];
        for _ in 0..300 {
            let [x, y] = somewhere(&mut random);
            let body = bodies.get(random.below(bodies.len().max(1) as u64) as usize).copied();
            match (random.below(9), body) {
                (0 | 1, _) if bodies.len() < 25 => {
                    bodies.push(insert_ball(&mut world, x as f32, y as f32, 0.0));
                }
                (2, Some(body)) => {
                    world.remove(body).unwrap();
                    bodies.retain(|&other| other != body);
                }
                (3, Some(body)) => world.set_pose(body, WorldPose::at([x, y, 0.0])).unwrap(),
                (4, Some(body)) => {
                    let linear = [x as f32, y as f32, 0.0];
                    world.set_velocity(body, Velocity { linear, angular: [0.0; 3] }).unwrap();
                }
                (5, Some(a)) if bodies[0] != a => {
                    joints.push(world.insert_joint(a, bodies[0], RopeJointBuilder::new(2.0)).unwrap());
                }
                (6, _) if !joints.is_empty() => {
                    // This fails for a joint that was removed with its body.
                    let _ = world.remove_joint(joints.swap_remove(0));
                }
                _ => world.step().unwrap(),
            }
            for &body in &bodies {
                assert_eq!(world.owners_of(body), 1, "{coupling:?} seed {seed}: {body} at {}", world.tick());
            }
            assert_eq!(world.stats().bodies, bodies.len(), "{coupling:?} seed {seed} at {}", world.tick());
        }
        assert_eq!(world.stats().quarantined, 0, "{coupling:?} seed {seed}");
    }
}

#[test]
fn bodies_100_km_from_the_origin_keep_millimetres() {
    let mut config = weightless(two_regions());
    config.bounds = Bounds::around([99_000.0, -98_765.0, 0.0], [300.0; 3]);
    config.partitioning = Partitioning::Regions(8);
    let mut world = LocalWorld::new(config).unwrap();
    let pose = WorldPose::at([99_000.123_456, -98_765.432_1, 5.0]);
    let body = RigidBodyBuilder::dynamic().linvel(Vector::new(0.06, 0.0, 0.0));
    let id = world.insert_at(pose, body.can_sleep(false), vec![ColliderBuilder::ball(0.5)]).unwrap();
    steps(&mut world, 60);
    let at = world.pose(id).unwrap().translation;
    // 60 steps of 1 mm, each rounded to f32 some hundred metres from the anchor.
    assert!((at[0] - 99_000.183_456).abs() < 2e-3 && (at[1] + 98_765.432_1).abs() < 1e-3, "{at:?}");
}

#[test]
fn bad_input_is_refused_with_cause_and_remedy() {
    let mut world = LocalWorld::new(two_regions()).unwrap();
    let (body, collider) = ball_at(0.0, 0.0);
    let nan = WorldPose::at([f64::NAN, 0.0, 0.0]);
    let error = world.insert_at(nan, body.clone(), vec![collider.clone()]).unwrap_err().to_string();
    assert!(error.contains("not finite") && error.contains("check"), "{error}");
    let error = world.insert(body, ColliderBuilder::ball(-1.0)).unwrap_err().to_string();
    assert!(error.contains("ball") && error.contains("from 1e-4"), "{error}");
    let ghost = BodyId::persistent(77);
    assert!(matches!(world.remove(ghost), Err(WorldError::NoBody(id)) if id == ghost));
    assert!(world.set_pose(ghost, WorldPose::default()).is_err());
    assert!(world.insert_joint(ghost, ghost, SphericalJointBuilder::new()).is_err());
    for regions in [0, 257] {
        let config = WorldConfig { partitioning: Partitioning::Regions(regions), ..WorldConfig::default() };
        let error = LocalWorld::new(config).err().unwrap().to_string();
        assert!(error.contains("1 to 256"), "{error}");
    }
    let mut config = WorldConfig::default();
    config.step.dt_s = 0.0;
    assert!(LocalWorld::new(config).err().unwrap().to_string().contains("dt_s"));
    // The refusals used up no id: the next body gets the first one.
    let (body, collider) = ball_at(0.0, 0.0);
    assert_eq!(world.insert(body, collider).unwrap(), BodyId::persistent(0));
}

#[test]
fn a_bullet_does_not_tunnel_through_a_wall_behind_a_border() {
    let mut world = LocalWorld::new(weightless(two_regions())).unwrap();
    let wall = RigidBodyBuilder::fixed().translation(Vector::new(0.5, 0.0, 0.0));
    world.insert(wall, ColliderBuilder::cuboid(0.01, 5.0, 5.0)).unwrap();
    for (row, speed) in [50.0f32, 100.0, 200.0, 400.0].into_iter().enumerate() {
        let start = Vector::new(-4.0, row as f32 * 1.5 - 2.0, 0.0);
        let body = RigidBodyBuilder::dynamic().translation(start).linvel(Vector::new(speed, 0.0, 0.0));
        let bullet = world.insert(body.ccd_enabled(true), ColliderBuilder::ball(0.1)).unwrap();
        steps(&mut world, 20);
        let x = world.pose(bullet).unwrap().translation[0];
        assert!(x < 0.5, "at {speed} m/s the bullet went through the wall to x = {x}");
    }
}

#[test]
fn the_force_of_a_contact_across_a_border_is_reported_once() {
    let mut world = LocalWorld::new(WorldConfig {
        partitioning: Partitioning::Cuts(vec![(Axis::Y, 1.0)]),
        ..WorldConfig::default()
    })
    .unwrap();
    insert_floor(&mut world);
    let mut ids = Vec::new();
    for i in 0..2 {
        let body =
            RigidBodyBuilder::dynamic().can_sleep(false).translation(Vector::new(0.0, 0.5 + i as f32, 0.0));
        let collider = ColliderBuilder::cuboid(0.5, 0.5, 0.5)
            .active_events(ActiveEvents::CONTACT_FORCE_EVENTS)
            .contact_force_event_threshold(1.0);
        ids.push(world.insert(body, collider).unwrap());
    }
    steps(&mut world, 60);
    let pushes: Vec<_> =
        world.events().forces.iter().filter(|force| (force.key.a, force.key.b) == (ids[0], ids[1])).collect();
    assert_eq!(pushes.len(), 1, "{pushes:?}");
    assert!(
        (pushes[0].magnitude_n - 9.81).abs() < 0.5,
        "a box of 1 kg presses with {} N",
        pushes[0].magnitude_n
    );
    assert!(pushes[0].force_n[1] > 9.0, "the force on the upper box points up: {:?}", pushes[0].force_n);
}

#[test]
fn a_joint_waits_while_it_has_nothing_to_move() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let mut insert = |body: RigidBodyBuilder, x: f32| {
        world.insert(body.translation(Vector::X * x), ColliderBuilder::ball(0.1)).unwrap()
    };
    let (fixed, belt) =
        (insert(RigidBodyBuilder::fixed(), 0.0), insert(RigidBodyBuilder::kinematic_velocity_based(), 1.0));
    let off = insert(RigidBodyBuilder::dynamic().enabled(false), 2.0);
    let rope = || SphericalJointBuilder::new().local_anchor1(Vector::X);
    world.insert_joint(fixed, belt, rope()).unwrap();
    let tie = world.insert_joint(belt, off, rope()).unwrap();
    (0..10).for_each(|_| world.step().unwrap());
    assert_eq!(world.joint_load(tie), Some([0.0; 6]));
    world.update(off, |body| body.set_enabled(true)).unwrap();
    (0..60).for_each(|_| world.step().unwrap());
    assert!((world.pose(off).unwrap().translation[0] - 2.0).abs() < 0.01, "it hangs at its anchor");
    assert!(world.joint_load(tie).unwrap()[1].abs() > 0.01, "and weighs on it");
}

/// Rapier looks only at the enabled end, and stops the process at a joint whose other end is disabled.
#[test]
fn a_joint_waits_while_an_end_is_disabled_however_it_came_to_that() {
    for by_joint in [true, false] {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        let mut insert = |body: RigidBodyBuilder, x: f32| {
            world.insert(body.translation(Vector::X * x), ColliderBuilder::ball(0.1)).unwrap()
        };
        let nail = insert(RigidBodyBuilder::fixed(), 0.0);
        let bob = insert(RigidBodyBuilder::dynamic(), 1.0);
        for x in 3..7 {
            insert(RigidBodyBuilder::dynamic(), x as f32);
        }
        let rope = SphericalJointBuilder::new().local_anchor1(Vector::X);
        let tie = world.insert_joint(nail, bob, rope).unwrap();
        let enable = |world: &mut LocalWorld, body, on| {
            world.update(body, |body| body.set_enabled(on)).unwrap();
            world.step().unwrap();
        };
        world.step().unwrap();
        if by_joint {
            world.update_joint(tie, |joint| joint.set_enabled(false)).unwrap();
            enable(&mut world, bob, false);
            world.update_joint(tie, |joint| joint.set_enabled(true)).unwrap();
        } else {
            enable(&mut world, bob, false);
            enable(&mut world, nail, false);
            enable(&mut world, nail, true);
        }
        (0..10).for_each(|_| world.step().unwrap());
        enable(&mut world, bob, true);
        (0..60).for_each(|_| world.step().unwrap());
        let at = world.pose(bob).unwrap().translation;
        assert!((at[0] - 1.0).abs() < 0.01 && at[1].abs() < 0.01, "it hangs at its anchor: {at:?}");
    }
}

/// What another process sends may be wrong, and must not end this one.
#[test]
fn a_transfer_of_what_is_owned_here_or_is_newer_here_is_refused() {
    use dcd::physics::{Partition, RegionHost};
    use dcd::protocol::{BorderMessage, Transfer};
    use dcd::space::{Epoch, RegionSet};
    let config = two_regions();
    let partition = Partition::new(config.tree().unwrap(), None);
    let [left, right] = [0, 1].map(|rank| partition.leaves()[rank]);
    let mut host = RegionHost::new(partition, config.step, 1, &[right]).unwrap();
    let (body, ball) = ball_at(5.0, 0.0);
    let id = BodyId::persistent(0);
    let place = WorldPose::at([5.0, 0.0, 0.0]);
    let mut record = host.shapes_mut().describe(id, place, &body.build(), &[ball]).unwrap();
    record.epoch = Epoch(3);
    host.insert(vec![record.clone()], &[]).unwrap();
    for epoch in [0, 3, 9] {
        let elsewhere = WorldPose::at([7.0, 0.0, 0.0]);
        let told = dcd::protocol::BodyState { pose: elsewhere, ..record.state };
        let body = dcd::BodyRecord { epoch: Epoch(epoch), state: told, ..record.clone() };
        let transfers = vec![Transfer { body, holders: RegionSet::EMPTY, whole: false }];
        let tick = host.tick().next();
        host.compute();
        host.accept(BorderMessage { from: left, to: right, tick, transfers, ..BorderMessage::default() });
        host.exchange().unwrap();
        host.end_tick();
        let (region, handle) = host.owned(id).expect("its owner stays");
        assert!((region.world_pose(handle).translation[0] - 5.0).abs() < 0.1, "epoch {epoch}");
    }
}
