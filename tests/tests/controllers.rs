//! Tests Rapier's controllers across borders: characters walk and cars drive as in one Rapier world.

use dcd::physics::{BodyFilter, CharacterMove, ControlError, Coupling, VehicleController};
use dcd::protocol::WorldPose;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig, WorldError};
use dcd::scene::{Scene, SceneBody};
use dcd::space::{Axis, BodyId, Bounds};
use rapier3d::control::{
    CharacterAutostep, CharacterLength, DynamicRayCastVehicleController, KinematicCharacterController,
    WheelTuning,
};
use rapier3d::prelude::*;

fn cut_at(scene: &Scene, planes: &[f64], coupling: Coupling) -> LocalWorld {
    let config = WorldConfig::for_scene(scene);
    let planes = planes.iter().map(|&x| (Axis::X, x)).collect();
    let step = config.step.with_coupling(coupling);
    LocalWorld::from_scene(scene, WorldConfig { partitioning: Partitioning::Cuts(planes), step, ..config })
        .unwrap()
}

fn handles(world: &PhysicsWorld) -> Vec<RigidBodyHandle> {
    world.bodies.iter().map(|(handle, _)| handle).collect()
}

/// Returns the distance of each body of the world from its place in the bare world.
fn apart_m(world: &LocalWorld, bare: &PhysicsWorld) -> Vec<f32> {
    let apart = |(index, handle): (usize, RigidBodyHandle)| {
        let pose = world.pose(BodyId::persistent(index as u32)).unwrap();
        let place = Vector::from(pose.translation.map(|v| v as f32));
        (place - bare.bodies[handle].translation()).length()
    };
    handles(bare).into_iter().enumerate().map(apart).collect()
}

const HERO: u32 = 1;

/// Returns a scene with a floor, a character at x = -6, steps up to x = 0 and down again, and boxes in its
/// way.
fn stairs() -> Scene {
    let mut scene = Scene::empty("stairs");
    scene.bounds = Bounds::around([0.0; 3], [20.0, 5.0, 5.0]);
    let plain = ColliderBuilder::ball(1.0);
    scene.push_fixed_box([0.0, -0.5, 0.0], [20.0, 0.5, 5.0], &plain);
    let hero = RigidBodyBuilder::kinematic_position_based();
    scene.push(WorldPose::at([-6.0, 0.85, 0.0]), hero, ColliderBuilder::capsule_y(0.5, 0.3));
    for (i, height) in [0.15, 0.3, 0.45, 0.3, 0.15].into_iter().enumerate() {
        scene.push_fixed_box([i as f64 - 2.0, height / 2.0, 0.0], [0.5, height as f32 / 2.0, 2.0], &plain);
    }
    for x in [4.05, 6.0] {
        let body = RigidBodyBuilder::dynamic();
        scene.push(WorldPose::at([x, 0.5, 0.1]), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    scene
}

fn walker() -> KinematicCharacterController {
    KinematicCharacterController {
        autostep: Some(CharacterAutostep {
            max_height: CharacterLength::Absolute(0.3),
            min_width: CharacterLength::Absolute(0.2),
            include_dynamic_bodies: false,
        }),
        snap_to_ground: Some(CharacterLength::Absolute(0.3)),
        ..KinematicCharacterController::default()
    }
}

const STRIDE_M: [f32; 3] = [0.05, -0.05, 0.0];

fn walk(world: &mut LocalWorld) {
    let (controller, shape) = (walker(), Capsule::new_y(0.5, 0.3));
    let hero = BodyId::persistent(HERO);
    let pose = world.pose(hero).unwrap();
    let filter = BodyFilter { exclude_bodies: &[hero], ..BodyFilter::default() };
    let character =
        CharacterMove { controller: &controller, shape: &shape, pose, desired_m: STRIDE_M, filter };
    let mut hits = Vec::new();
    let movement = world.move_character(&character, |hit| hits.push(hit)).unwrap();
    world.push_by_character(&character, 60.0, &hits).unwrap();
    let moved = movement.translation.to_array().map(f64::from);
    let to = std::array::from_fn(|i| pose.translation[i] + moved[i]);
    world.set_next_pose(hero, WorldPose { translation: to, ..pose }).unwrap();
    world.step().unwrap();
}

fn walk_bare(world: &mut PhysicsWorld) {
    let (controller, shape, dt) = (walker(), Capsule::new_y(0.5, 0.3), world.integration_parameters.dt);
    let hero = handles(world)[HERO as usize];
    let filter = QueryFilter::new().exclude_rigid_body(hero);
    let pose = *world.bodies[hero].position();
    let mut hits = Vec::new();
    let pipeline = world.query_pipeline_with_filter(filter);
    let desired = Vector::from(STRIDE_M);
    let movement = controller.move_shape(dt, &pipeline, &shape, &pose, desired, |hit| hits.push(hit));
    let PhysicsWorld { broad_phase, narrow_phase, bodies, colliders, .. } = world;
    let mut pipeline =
        broad_phase.as_query_pipeline_mut(narrow_phase.query_dispatcher(), bodies, colliders, filter);
    controller.solve_character_collision_impulses(dt, &mut pipeline, &shape, 60.0, &hits);
    world.bodies[hero].set_next_kinematic_translation(pose.translation + movement.translation);
    world.step();
}

#[test]
fn a_character_climbs_steps_and_pushes_boxes_over_a_border_as_in_one_world() {
    let scene = stairs();
    for coupling in Coupling::ALL {
        for planes in [&[][..], &[-0.5], &[4.5, 5.6], &[-3.0, -1.0, 1.0, 3.0, 4.5, 5.0, 6.5]] {
            let (mut world, mut bare) = (cut_at(&scene, planes, coupling), scene.bare_world());
            // Queries of the bare world see its bodies only after a step.
            bare.step();
            world.step().unwrap();
            // With `proxy`, pushes on ghosts are wrong. On the steps alone all couplings agree.
            let limit_m = if coupling == Coupling::Proxy { 0.5 } else { 0.06 };
            let (mut highest, mut walked_m) = (0.0f64, 0.0f32);
            for tick in 0..300 {
                walk(&mut world);
                walk_bare(&mut bare);
                let pose = world.pose(BodyId::persistent(HERO)).unwrap();
                highest = highest.max(pose.translation[1]);
                walked_m = walked_m.max(apart_m(&world, &bare)[HERO as usize]);
                // Simultaneous hits are met in the order of Rapier's tree, which differs even with one
                // region.
                let limit_m = if pose.translation[0] < 3.0 { 1e-4 } else { limit_m };
                assert!(walked_m <= limit_m, "{coupling:?} {planes:?}: {walked_m} m apart at tick {tick}");
            }
            assert!(highest > 1.25, "it climbed to {highest}: the test needs stairs");
            let pushed: Vec<_> = apart_m(&world, &bare).split_off(7);
            let first = world.pose(BodyId::persistent(7)).unwrap().translation[0];
            assert!(first > 4.6, "{coupling:?} {planes:?}: the box is at {first}");
            println!("{coupling:?} {planes:?}: character {walked_m} m, boxes {pushed:?} m apart");
            assert!(pushed.iter().all(|&apart| apart <= limit_m), "{coupling:?} {planes:?}: {pushed:?}");
        }
    }
}

/// With nothing to do, Rapier's controller moves a character out of what overlaps it. Parry 0.31.1 takes any
/// half-space for deep in it.
#[test]
fn a_character_at_rest_rises_from_a_half_space_only_where_it_overlaps() {
    let mut scene = Scene::empty("plane");
    scene.bounds = Bounds::around([0.0; 3], [20.0, 5.0, 5.0]);
    let half_space = ColliderBuilder::new(SharedShape::halfspace(Vector::Y));
    scene.push(WorldPose::default(), RigidBodyBuilder::fixed(), half_space);
    for planes in [&[][..], &[0.0]] {
        let mut world = cut_at(&scene, planes, Coupling::Auto);
        world.step().unwrap();
        let (controller, shape) = (KinematicCharacterController::default(), Capsule::new_y(0.5, 0.3));
        // The capsule reaches 0.8 m down, and keeps 1 % of its height as a gap.
        for (height_m, rise_m) in [(3.0, 0.0), (0.7, 0.116)] {
            let pose = WorldPose::at([1.0, height_m, 0.0]);
            let (desired_m, filter) = ([0.0; 3], BodyFilter::default());
            let character = CharacterMove { controller: &controller, shape: &shape, pose, desired_m, filter };
            let moved = world.move_character(&character, |_| ()).unwrap().translation;
            let off_m = (moved - Vector::Y * rise_m).length();
            assert!(off_m < 1e-3, "{planes:?}: it rises by {moved:?} at {height_m} m");
        }
    }
}

const CAR: u32 = 1;

/// Returns a scene with a road with bumps, and a car.
fn road() -> Scene {
    let mut scene = Scene::empty("road");
    scene.bounds = Bounds::around([0.0; 3], [40.0, 5.0, 10.0]);
    let plain = ColliderBuilder::ball(1.0);
    scene.push_fixed_box([0.0, -0.5, 0.0], [60.0, 0.5, 10.0], &plain);
    scene.bodies.push(SceneBody {
        pose: WorldPose::at([-25.0, 0.8, 0.0]),
        body: RigidBodyBuilder::dynamic().can_sleep(false),
        colliders: vec![ColliderBuilder::cuboid(1.0, 0.2, 0.6).density(100.0)],
    });
    for i in 0..8 {
        scene.push_fixed_box([f64::from(i) * 5.0 - 17.5, 0.0, 0.5], [0.3, 0.06, 0.5], &plain);
    }
    scene
}

fn add_wheels(controller: &mut DynamicRayCastVehicleController) {
    let tuning = WheelTuning {
        suspension_stiffness: 80.0,
        suspension_damping: 10.0,
        suspension_compression: 8.0,
        ..WheelTuning::default()
    };
    for (x, z) in [(0.8, 0.5), (0.8, -0.5), (-0.8, 0.5), (-0.8, -0.5)] {
        let at = Vector::new(x, 0.0, z);
        let wheel = controller.add_wheel(at, -Vector::Y, Vector::Z, 0.5, 0.2, &tuning);
        wheel.engine_force = 70.0;
    }
}

#[test]
fn a_car_drives_over_borders_as_in_one_world() {
    let scene = road();
    let eight = [-24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 24.0];
    for coupling in Coupling::ALL {
        for planes in [&[][..], &[0.0], &eight] {
            let (mut world, mut bare) = (cut_at(&scene, planes, coupling), scene.bare_world());
            bare.step();
            world.step().unwrap();
            let car = BodyId::persistent(CAR);
            let mut vehicle = VehicleController::new(car);
            add_wheels(&mut vehicle.controller);
            let chassis = handles(&bare)[CAR as usize];
            let mut bare_vehicle = DynamicRayCastVehicleController::new(chassis);
            add_wheels(&mut bare_vehicle);
            let (mut regions, mut apart) = (Vec::from_iter(world.owner_of(car)), 0.0f32);
            for _ in 0..400 {
                world.update_vehicle(&mut vehicle, &BodyFilter::default()).unwrap();
                world.step().unwrap();
                let dt = bare.integration_parameters.dt;
                let PhysicsWorld { broad_phase, narrow_phase, bodies, colliders, .. } = &mut bare;
                let filter = QueryFilter::new().exclude_rigid_body(chassis);
                let dispatcher = narrow_phase.query_dispatcher();
                let pipeline = broad_phase.as_query_pipeline_mut(dispatcher, bodies, colliders, filter);
                bare_vehicle.update_vehicle(dt, pipeline);
                bare.step();
                apart = apart.max(apart_m(&world, &bare)[CAR as usize]);
                let owner = world.owner_of(car).unwrap();
                if regions.last() != Some(&owner) {
                    regions.push(owner);
                }
            }
            let at = world.pose(car).unwrap().translation;
            println!("{coupling:?} {planes:?}: {apart} m apart, at {at:?}, {} regions", regions.len());
            assert!(at[0] > 26.0 && at[2].abs() < 3.0, "{coupling:?} {planes:?}: it drove to {at:?}");
            assert_eq!(regions.len(), planes.len() + 1, "{coupling:?}: {regions:?}");
            let limit = if planes.is_empty() { 0.0 } else { 0.02 };
            assert!(apart <= limit, "{coupling:?} {planes:?}: {apart} m apart");
            assert_eq!(vehicle.ground(0).map(|id| id.body), Some(BodyId::persistent(0)));
        }
    }
}

#[test]
fn a_vehicle_without_a_chassis_and_a_character_from_nowhere_are_refused() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let floor = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(1.0)).unwrap();
    for chassis in [floor, BodyId::persistent(77)] {
        let refused = world.update_vehicle(&mut VehicleController::new(chassis), &BodyFilter::default());
        let no_chassis = |error: &WorldError| matches!(error, WorldError::Control(ControlError::NoChassis(id)) if *id == chassis);
        assert!(refused.as_ref().is_err_and(no_chassis), "{refused:?}");
    }
    let controller = KinematicCharacterController::default();
    let character = CharacterMove {
        controller: &controller,
        shape: &Ball::new(0.5),
        pose: WorldPose::at([f64::NAN, 0.0, 0.0]),
        desired_m: [0.0; 3],
        filter: BodyFilter::default(),
    };
    let refused = world.move_character(&character, |_| ()).unwrap_err();
    assert!(refused.to_string().contains("character's pose"), "{refused}");
    let standing = CharacterMove { pose: WorldPose::default(), ..character };
    let refused = world.push_by_character(&standing, 0.0, &[]).unwrap_err();
    assert!(matches!(refused, WorldError::Control(ControlError::Mass(_))), "{refused}");
}
