//! Tests islands that span many regions, too large for one region to compute whole, and bodies that ride on
//! belts.

use dcd::physics::{Measured, StepSettings};
use dcd::protocol::WorldPose;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene, SceneJoint};
use dcd::space::{Axis, BodyId, Bounds};
use rapier3d::prelude::*;

/// Returns the configuration of this many regions side by side along x, over a length around the origin.
fn side_by_side(regions: usize, length_m: f64) -> WorldConfig {
    let cut = |i: usize| (Axis::X, length_m * (i as f64 / regions as f64 - 0.5));
    let partitioning = match regions {
        1 => Partitioning::Regions(1),
        _ => Partitioning::Cuts((1..regions).map(cut).collect()),
    };
    WorldConfig { partitioning, bounds: Bounds::around([0.0; 3], [length_m; 3]), ..WorldConfig::default() }
}

/// Returns the same for a world that cuts islands of more than 256 bodies.
fn with_cut_islands(config: WorldConfig) -> WorldConfig {
    WorldConfig { step: StepSettings { island_limit: 256, ..config.step }, ..config }
}

fn steps(world: &mut LocalWorld, count: usize) {
    for _ in 0..count {
        world.step().unwrap();
    }
}

fn joint(a: Vector, b: Vector) -> SphericalJointBuilder {
    SphericalJointBuilder::new().local_anchor1(a).local_anchor2(b).contacts_enabled(false)
}

/// Returns a scene with a rope of this many links of half a metre, along x around the origin, hung up at its
/// left end.
fn rope(links: usize, can_sleep: bool) -> Scene {
    const LINK_M: f32 = 0.5;
    let at = |i: f32| Vector::new((i - 0.5 * links as f32) * LINK_M, 0.0, 0.0);
    let mut scene = Scene::empty("rope");
    let hook = push(&mut scene, RigidBodyBuilder::fixed().translation(at(0.0)), ColliderBuilder::ball(0.05));
    let mut above = (hook, Vector::ZERO);
    for i in 0..links {
        let body = RigidBodyBuilder::dynamic().translation(at(i as f32 + 0.5)).can_sleep(can_sleep);
        let link = push(&mut scene, body, ColliderBuilder::capsule_x(0.2, 0.05).mass(1.0));
        tie(&mut scene, above.0, link, joint(above.1, -0.5 * LINK_M * Vector::X));
        above = (link, 0.5 * LINK_M * Vector::X);
    }
    scene
}

/// Returns a scene with a swinging bridge of this many planks of a metre along x, hung on an arc around the
/// origin.
fn bridge(planks: usize, can_sleep: bool) -> Scene {
    let radius = planks as f32;
    let angle = |i: f32| (i - 0.5 * planks as f32) / radius;
    let at = |i: f32| radius * Vector::new(angle(i).sin(), 1.0 - angle(i).cos(), 0.0);
    let mut scene = Scene::empty("bridge");
    let pier = |scene: &mut Scene, i: f32| {
        push(scene, RigidBodyBuilder::fixed().translation(at(i)), ColliderBuilder::ball(0.05))
    };
    let half = 0.5 * Vector::X;
    let (mut left, end) = (pier(&mut scene, 0.0), pier(&mut scene, planks as f32));
    for i in 0..planks {
        let turn = Rotation::from_rotation_z(angle(i as f32 + 0.5));
        let swing = 4.0 * (std::f32::consts::PI * (i as f32 + 0.5) / planks as f32).sin();
        let body = RigidBodyBuilder::dynamic()
            .pose(Pose::from_parts(at(i as f32 + 0.5), turn))
            .linvel(Vector::Z * swing)
            .can_sleep(can_sleep);
        let plank = push(&mut scene, body, ColliderBuilder::cuboid(0.45, 0.06, 1.0).density(10.0));
        let hinge = RevoluteJointBuilder::new(Vector::Z).contacts_enabled(false);
        match i {
            0 => tie(&mut scene, left, plank, joint(Vector::ZERO, -half)),
            _ => tie(&mut scene, left, plank, hinge.local_anchor1(half).local_anchor2(-half)),
        }
        left = plank;
    }
    tie(&mut scene, left, end, joint(half, Vector::ZERO));
    scene
}

fn push(scene: &mut Scene, body: RigidBodyBuilder, collider: ColliderBuilder) -> usize {
    let pose = WorldPose {
        translation: body.position.translation.to_array().map(f64::from),
        rotation: body.position.rotation.to_array(),
    };
    scene.push(pose, body, collider)
}

fn tie(scene: &mut Scene, a: usize, b: usize, joint: impl Into<GenericJoint>) {
    scene.joints.push(SceneJoint { a, b, joint: joint.into(), multibody: None });
}

fn movable(world: &LocalWorld) -> Vec<BodyId> {
    world.states().map(|(id, ..)| id).collect()
}

fn kinetic_energy_j(world: &LocalWorld, bodies: &[BodyId]) -> f32 {
    let energy = |&id: &BodyId| {
        let speed = Vector::from_array(world.velocity(id).unwrap().linear).length();
        0.5 * world.mass_kg(id).unwrap() * speed * speed
    };
    bodies.iter().map(energy).sum()
}

/// Returns by how many metres the centre of a body lies outside of its owner's cell.
fn out_of_cell_m(world: &LocalWorld, body: BodyId) -> f64 {
    let (owner, at) = (world.owner_of(body).unwrap(), world.pose(body).unwrap().translation);
    let region = world.regions().find(|region| region.id() == owner).unwrap();
    region.cell().excess_m(at)
}

/// Returns how far bodies sink at most below where they were after half a second, millimetres.
fn sag_mm(world: &mut LocalWorld, bodies: &[BodyId], ticks: usize) -> f64 {
    steps(world, 30);
    let height = |world: &LocalWorld, body| world.pose(body).unwrap().translation[1];
    let before: Vec<_> = bodies.iter().map(|&body| height(world, body)).collect();
    let mut worst = 0.0f64;
    for _ in 0..ticks {
        steps(world, 1);
        for (&body, before) in bodies.iter().zip(&before) {
            worst = worst.max(1e3 * (before - height(world, body)));
        }
    }
    worst
}

fn insert_box(world: &mut LocalWorld, x: f32, y: f32, vx: f32, half: f32) -> BodyId {
    let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, y, 0.0)).linvel(Vector::X * vx);
    world.insert(body, ColliderBuilder::cuboid(half, half, half).density(100.0)).unwrap()
}

/// Inserts a long platform that moves along x under all regions, with boxes on it that are far from each
/// other.
fn insert_platform(world: &mut LocalWorld) -> Vec<BodyId> {
    let body = RigidBodyBuilder::kinematic_velocity_based()
        .translation(Vector::new(-14.0, -0.5, 0.0))
        .linvel(Vector::X * 3.0);
    world.insert(body, ColliderBuilder::cuboid(12.0, 0.5, 2.0)).unwrap();
    [-9.0, -6.5, -4.0].into_iter().map(|x| insert_box(world, x, 0.25, 3.0, 0.25)).collect()
}

/// Inserts turning rollers in a row along x, and boxes that ride on them.
fn insert_rollers(world: &mut LocalWorld) -> Vec<BodyId> {
    for i in 0..60 {
        let turn = Rotation::from_rotation_x(std::f32::consts::FRAC_PI_2);
        let body = RigidBodyBuilder::kinematic_velocity_based()
            .pose(Pose::from_parts(Vector::new(-9.0 + 0.3 * i as f32, -0.14, 0.0), turn))
            .angvel(-Vector::Z * (2.0 / 0.14));
        world.insert(body, ColliderBuilder::cylinder(1.0, 0.14).friction(1.0)).unwrap();
    }
    [-8.0, -5.0, -2.5].into_iter().map(|x| insert_box(world, x, 0.5, 2.0, 0.5)).collect()
}

#[test]
fn what_rides_on_a_platform_does_not_sink_when_it_comes_into_another_region() {
    for regions in [3, 5] {
        let mut world = LocalWorld::new(side_by_side(regions, 16.0)).unwrap();
        let boxes = insert_platform(&mut world);
        let sag = sag_mm(&mut world, &boxes, 240);
        assert!(world.stats().transfers >= 2, "{} transfers", world.stats().transfers);
        assert!(sag < 1.5, "{sag:.2} mm in {regions} regions");
    }
}

#[test]
fn what_rides_on_rollers_does_not_sink_when_it_comes_into_another_region() {
    for regions in [3, 5] {
        let mut world = LocalWorld::new(side_by_side(regions, 16.0)).unwrap();
        let boxes = insert_rollers(&mut world);
        let sag = sag_mm(&mut world, &boxes, 240);
        assert!(world.stats().transfers >= 2, "{} transfers", world.stats().transfers);
        assert!(sag < 3.0, "{sag:.2} mm in {regions} regions");
    }
}

#[test]
fn no_link_of_a_long_rope_stays_with_a_region_that_it_has_left() {
    let mut world =
        LocalWorld::from_scene(&rope(300, true), with_cut_islands(side_by_side(7, 150.0))).unwrap();
    let links = movable(&world);
    let mut out_ticks = vec![0; links.len()];
    for _ in 0..210 {
        steps(&mut world, 1);
        for (&link, ticks) in links.iter().zip(&mut out_ticks) {
            *ticks = if out_of_cell_m(&world, link) > 0.5 { *ticks + 1 } else { 0 };
            assert!(*ticks <= 20, "{link} is {:.1} m out at {}", out_of_cell_m(&world, link), world.tick());
        }
    }
    assert!(world.stats().transfers > 20, "{} transfers", world.stats().transfers);
}

#[test]
fn a_bridge_over_many_regions_swings_with_the_energy_that_it_has_in_one_world() {
    let energy_j = |regions, seconds: &[usize]| -> Vec<f32> {
        let mut world =
            LocalWorld::from_scene(&bridge(300, true), with_cut_islands(side_by_side(regions, 300.0)))
                .unwrap();
        let planks = movable(&world);
        let swing = |&seconds: &usize| {
            steps(&mut world, 60 * seconds);
            let out_m = planks.iter().map(|&plank| out_of_cell_m(&world, plank)).fold(0.0, f64::max);
            assert!(out_m < 1.0, "a plank is {out_m:.1} m out of its region in {regions}");
            kinetic_energy_j(&world, &planks)
        };
        seconds.iter().map(swing).collect()
    };
    // Whatever pumps energy into a bridge does so for as long as it swings.
    let alone = energy_j(1, &[2, 22]);
    for (regions, seconds) in [(2, &[2][..]), (4, &[2]), (8, &[2, 22])] {
        let split = energy_j(regions, seconds);
        for ((split, alone), most) in split.into_iter().zip(&alone).zip([0.05, 0.15]) {
            let off = split / alone - 1.0;
            println!("{split:.0} J in {regions} regions, {alone:.0} J in one");
            assert!(off.abs() < most, "{split:.0} J in {regions} regions, {alone:.0} J in one");
        }
    }
}

#[test]
fn an_island_that_stays_whole_comes_to_the_bits_of_one_world_in_any_number_of_regions() {
    let hash = |scene: &Scene, regions| {
        let mut world = LocalWorld::from_scene(scene, side_by_side(regions, 300.0)).unwrap();
        steps(&mut world, 60);
        world.host().state_hash()
    };
    for scene in [bridge(300, true), rope(300, false)] {
        let alone = hash(&scene, 1);
        for regions in [2, 3, 5, 8, 16] {
            assert_eq!(hash(&scene, regions), alone, "{} in {regions} regions", scene.name);
        }
    }
}

/// Formerly, sizes that regions heard of one another counted what comes together and apart in every tick many
/// times, and each region that held one body of a part of up to 256 bodies held all of the part: seven copies
/// of each body.
#[test]
fn a_heap_that_falls_into_the_corner_of_eight_regions_is_not_held_by_all_of_them() {
    let scene = Scene::named("heap", &Params::new().with("n", 1200).with("slenderness", 1.07)).unwrap();
    let config = WorldConfig { partitioning: Partitioning::Regions(8), ..WorldConfig::for_scene(&scene) };
    let mut world = LocalWorld::from_scene(&scene, config).unwrap();
    let (ticks, mut copies) = (90, 0);
    for _ in 0..ticks {
        world.step().unwrap();
        copies += world.stats().ghosts;
    }
    let moves = world.stats().transfers;
    assert!(moves > 400, "a third of it must have moved: {moves}");
    assert!(moves < 2 * 1200, "{moves} moves of 1,200 bodies");
    assert!(copies < ticks * 1200 * 3 / 2, "{} copies of 1,200 bodies", copies / ticks);
}

/// Rapier itself loses the joint: it chose what to solve while the second box slept, and keeps to that when
/// the ball wakes the box.
#[test]
fn who_was_put_to_sleep_has_its_joint_when_it_is_struck() {
    for regions in [1, 2] {
        let config = side_by_side(regions, 20.0);
        let mut world = LocalWorld::new(WorldConfig {
            step: StepSettings { gravity: [0.0; 3], ..config.step },
            ..config
        })
        .unwrap();
        let mut insert = |body: RigidBodyBuilder, at: [f32; 3], collider: ColliderBuilder| {
            world.insert(body.translation(at.into()).can_sleep(false), collider).unwrap()
        };
        let cube = || ColliderBuilder::cuboid(0.4, 0.4, 0.4);
        let awake = insert(RigidBodyBuilder::dynamic(), [2.0, 0.0, 0.0], cube());
        let sleeper = insert(RigidBodyBuilder::dynamic(), [3.0, 0.0, 0.0], cube());
        let ball = RigidBodyBuilder::dynamic().linvel(Vector::new(0.0, -6.0, 0.0));
        insert(ball, [3.0, 3.0, 0.0], ColliderBuilder::ball(0.3));
        world.insert_joint(awake, sleeper, joint(0.5 * Vector::X, -0.5 * Vector::X)).unwrap();
        steps(&mut world, 2);
        world.update(sleeper, |body| body.sleep()).unwrap();
        steps(&mut world, 60);
        let ends = [(awake, 0.5), (sleeper, -0.5)].map(|(id, x)| {
            let pose = world.pose(id).unwrap();
            let arm = Rotation::from_array(pose.rotation) * Vector::new(x, 0.0, 0.0);
            Vector::from_array(pose.translation.map(|v| v as f32)) + arm
        });
        let moved_m = -world.pose(sleeper).unwrap().translation[1];
        assert!(moved_m > 0.3, "{regions} regions: it was struck, and moved {moved_m} m");
        let apart_m = (ends[0] - ends[1]).length();
        assert!(apart_m < 0.01, "{regions} regions: the joint's ends are {apart_m} m apart");
    }
}

/// A region that holds only a part of a ring, and not what holds up its last domino, must not wake the rest.
#[test]
fn what_fell_across_a_border_falls_asleep_when_it_does_in_one_region() {
    let asleep_after = |dominoes, regions| {
        let params = Params::new().with("n", dominoes).with("starts", 4);
        let scene = Scene::named("domino_ring", &params).unwrap();
        let partitioning = Partitioning::Regions(regions);
        let config = WorldConfig { partitioning, ..WorldConfig::default() };
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        let bodies = movable(&world);
        let sleeps = |world: &LocalWorld| bodies.iter().all(|&id| world.body(id).unwrap().is_sleeping());
        (1..600u32).find(|_| {
            steps(&mut world, 1);
            sleeps(&world)
        })
    };
    for dominoes in [80, 90] {
        let one = asleep_after(dominoes, 1).unwrap();
        for regions in [2, 4, 8] {
            let several = asleep_after(dominoes, regions).unwrap_or(600);
            assert!(
                several.abs_diff(one) <= 10,
                "{dominoes} dominoes, {regions} regions: {several}, {one} in one"
            );
        }
    }
}
