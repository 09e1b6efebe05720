//! Tests vehicles, which are driven where they are computed: in one region, over borders, with every
//! coupling, and over the network.

use dcd::prelude::*;
use dcd::{Axis, Costs, Refusal, StepSettings};
use dcd_tests::served::Served;
use rapier3d::control::{DynamicRayCastVehicleController, WheelTuning};

/// Returns a world with ground: whole, or with borders at x = 6 and z = 1.3, to which nothing here is
/// symmetrical.
fn world(cuts: usize, coupling: Coupling) -> World {
    let cuts = [(Axis::X, 6.0), (Axis::Z, 1.3)][..cuts].to_vec();
    let partitioning = Partitioning::Cuts(cuts);
    let step = StepSettings::default().with_coupling(coupling);
    let mut world = World::new(WorldConfig { partitioning, step, ..WorldConfig::default() }).unwrap();
    let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
    world.insert(ground, ColliderBuilder::cuboid(200.0, 0.5, 200.0)).unwrap();
    world
}

fn chassis() -> ColliderBuilder {
    ColliderBuilder::cuboid(1.6, 0.4, 0.8).density(250.0)
}

fn car_at(world: &mut World, at: [f64; 3]) -> BodyId {
    world
        .insert_vehicle(WorldPose::at(at), &Vehicle::default(), RigidBodyBuilder::dynamic(), [chassis()])
        .unwrap()
}

fn run(world: &mut World, ticks: usize) {
    (0..ticks).for_each(|_| world.step().unwrap());
}

fn place(world: &World, id: BodyId) -> [f64; 3] {
    world.pose(id).unwrap().translation
}

fn forward(throttle: f32) -> Drive {
    Drive { throttle, ..Drive::default() }
}

/// Returns the world in one region, and in four with every coupling.
fn worlds() -> impl Iterator<Item = (String, World)> {
    let couplings = [Coupling::Auto, Coupling::Overlap, Coupling::Owner, Coupling::Proxy];
    let cut = couplings.into_iter().map(|coupling| (format!("{coupling:?}"), world(2, coupling)));
    std::iter::once(("one region".to_owned(), world(0, Coupling::Auto))).chain(cut)
}

#[test]
fn a_refused_change_leaves_a_car_a_car_and_where_it_was() {
    let mut world = world(1, Coupling::Auto);
    let post = RigidBodyBuilder::fixed().translation(Vector::Y * 3.0);
    let post = world.insert(post, ColliderBuilder::ball(0.1)).unwrap();
    let car = car_at(&mut world, [0.0, 1.0, 0.0]);
    let rod = SphericalJointBuilder::new().local_anchor2(Vector::Y * 2.0);
    world.insert_multibody_joint(post, car, rod, LinkSettings::default()).unwrap();
    run(&mut world, 5);
    let before = world.motion(car);
    let refused = world.update(car, |body| {
        body.set_body_type(RigidBodyType::KinematicPositionBased, true);
        body.set_translation(Vector::X * 9.0, true);
        body.set_linvel(Vector::X, true);
    });
    assert!(refused.is_err());
    assert_eq!(world.motion(car), before);
    world.drive(car, Drive::default()).unwrap();
}

#[test]
fn it_drives_as_rapier_s_own_controller_does() {
    let mut world = world(0, Coupling::Auto);
    // Before its first step the bare world finds no ground. It is too far below to be felt by then.
    let car = car_at(&mut world, [0.0, 2.0, 0.0]);
    let mut bare = PhysicsWorld::new();
    let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
    bare.insert(ground, ColliderBuilder::cuboid(200.0, 0.5, 200.0));
    let (body, _) = bare.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 2.0), chassis());
    let mut controller = DynamicRayCastVehicleController::new(body);
    for wheel in &Vehicle::default().wheels {
        let tuning = WheelTuning {
            suspension_stiffness: wheel.stiffness,
            suspension_compression: wheel.compression,
            suspension_damping: wheel.relaxation,
            max_suspension_travel: wheel.travel_m,
            side_friction_stiffness: wheel.side_grip,
            friction_slip: wheel.grip,
            max_suspension_force: wheel.most_force_n,
        };
        let [at, down, axle] = [wheel.at_m, wheel.down, wheel.axle].map(Vector::from_array);
        controller.add_wheel(at, down, axle, wheel.rest_m, wheel.radius_m, &tuning);
    }
    run(&mut world, 1);
    bare.step();
    let drive = Drive { throttle: 0.7, brake: 0.0, steering: 0.3 };
    world.drive(car, drive).unwrap();
    for _ in 0..240 {
        run(&mut world, 1);
        for (wheel, of) in controller.wheels_mut().iter_mut().zip(&Vehicle::default().wheels) {
            wheel.engine_force = drive.throttle * of.engine_n;
            wheel.steering = drive.steering * of.steering_rad;
        }
        let PhysicsWorld { broad_phase, narrow_phase, bodies, colliders, integration_parameters, .. } =
            &mut bare;
        let filter = QueryFilter::default().exclude_rigid_body(body).exclude_sensors();
        let dispatcher = narrow_phase.query_dispatcher();
        let rays = broad_phase.as_query_pipeline_mut(dispatcher, bodies, colliders, filter);
        controller.update_vehicle(integration_parameters.dt, rays);
        bare.step();
    }
    let expected = bare.bodies[body].translation().to_array().map(f64::from);
    assert_eq!(place(&world, car), expected);
    let rolled = controller.wheels().to_vec();
    // Once more, to see the wheels where the chassis is now.
    let PhysicsWorld { broad_phase, narrow_phase, bodies, colliders, integration_parameters, .. } = &mut bare;
    let filter = QueryFilter::default().exclude_rigid_body(body).exclude_sensors();
    let rays = broad_phase.as_query_pipeline_mut(narrow_phase.query_dispatcher(), bodies, colliders, filter);
    controller.update_vehicle(integration_parameters.dt, rays);
    for ((state, wheel), rolled) in world.wheels(car).unwrap().iter().zip(controller.wheels()).zip(rolled) {
        let near = |a: Vector, b: [f32; 3]| (a - Vector::from_array(b)).length() < 1e-3;
        let info = wheel.raycast_info();
        let ground = state.ground.expect("it stands on the ground");
        assert!((state.suspension_m - info.suspension_length).abs() < 1e-4, "{state:?}, {info:?}");
        assert!(near(wheel.center(), state.pose.translation.map(|v| v as f32)), "{state:?}, {wheel:?}");
        assert!(near(info.contact_point_ws, ground.point.map(|v| v as f32)), "{state:?}, {info:?}");
        assert!(near(info.contact_normal_ws, ground.normal) && ground.slope_rad < 1e-3);
        assert_eq!((state.steering_rad, ground.collider), (rolled.steering, BodyId::persistent(0).into()));
        let turns = (state.rolled_rad - rolled.rotation) / std::f32::consts::TAU;
        assert!(rolled.rotation > 10.0 && (turns - turns.round()).abs() < 1e-3, "{state:?}, {rolled:?}");
        // Its axle is where the controller has it, and what was below it at first has gone round backwards.
        let turn = Rotation::from_array(state.pose.rotation);
        assert!(near(turn * Vector::Z, wheel.axle().to_array()), "{state:?}, {wheel:?}");
        let steered = turn * Rotation::from_axis_angle(Vector::Z, state.rolled_rad);
        assert!(near(steered * -Vector::Y, wheel.suspension().to_array()), "{state:?}, {wheel:?}");
    }
    let way = expected[0].hypot(expected[2]);
    assert!(way > 8.0 && expected[2] < -3.0, "it drives, and to the left: {expected:?}");
}

#[test]
fn it_drives_over_borders_as_in_one_region() {
    let mut ways: Vec<(String, [f64; 3], [f64; 3])> = Vec::new();
    let mut rolls: Vec<f32> = Vec::new();
    for (name, mut world) in worlds() {
        let car = car_at(&mut world, [0.0, 0.8, 2.2]);
        run(&mut world, 30);
        world.drive(car, Drive { throttle: 0.8, brake: 0.0, steering: 0.25 }).unwrap();
        let (mut lowest, mut rolled_rad) = (f64::INFINITY, 0.0);
        let mut before = world.wheels(car).unwrap()[3];
        for tick in 0..180 {
            run(&mut world, 1);
            lowest = lowest.min(place(&world, car)[1]);
            let wheel = world.wheels(car).unwrap()[3];
            let turns = (wheel.rolled_rad - before.rolled_rad) / std::f32::consts::TAU;
            let step_rad = (turns - turns.round()) * std::f32::consts::TAU;
            let spun_rad = wheel.spin_rad_s * world.dt_s();
            assert!(
                (step_rad - spun_rad).abs() < 1e-3,
                "{name}: it jumps in tick {tick}: {before:?}, {wheel:?}"
            );
            let ground = wheel.ground.map(|ground| ground.collider.body);
            assert_eq!(ground, Some(BodyId::persistent(0)), "{name} in tick {tick}");
            rolled_rad += step_rad;
            before = wheel;
        }
        assert!(lowest > 0.55, "{name}: its wheels carry it over the borders, {lowest}");
        rolls.push(rolled_rad);
        ways.push((name, place(&world, car), world.velocity(car).unwrap().linear.map(f64::from)));
    }
    assert!(rolls.iter().all(|roll| (roll / rolls[0] - 1.0).abs() < 0.03), "{rolls:?} radians");
    let (_, alone, speed) = ways[0].clone();
    assert!(alone[0] > 8.0 && alone[2] < 0.5, "it crosses both borders: {alone:?}");
    for (name, at, v) in &ways[1..] {
        let off = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        assert!(off(at, &alone) < 0.25, "{name}: {at:?}, in one region {alone:?}");
        assert!(off(v, &speed) < 0.25, "{name}: {v:?} m/s, in one region {speed:?}");
    }
}

#[test]
fn neither_engine_nor_suspension_misses_a_step_at_a_border_or_at_first() {
    for (name, mut world) in worlds() {
        let car = car_at(&mut world, [-3.0, 0.8, 0.0]);
        let mut speeds = vec![[0.0_f32; 2]];
        for _ in 0..240 {
            world.drive(car, Drive { throttle: 0.5, brake: 0.0, steering: 0.0 }).unwrap();
            run(&mut world, 1);
            let [along, up, _] = world.velocity(car).unwrap().linear;
            speeds.push([along, up]);
        }
        assert!(place(&world, car)[0] > 8.0, "{name}: it crosses the borders");
        // Once it has come to rest on its springs, each step makes it as fast as the one before.
        let gains: Vec<_> = speeds.windows(2).map(|pair| [0, 1].map(|i| pair[1][i] - pair[0][i])).collect();
        for (step, pair) in gains.windows(2).enumerate().skip(90) {
            let jump = [0, 1].map(|i| (pair[1][i] - pair[0][i]).abs());
            assert!(jump[0] < 0.01 && jump[1] < 0.02, "{name}, step {step}: {pair:?} m/s");
        }
        // On its springs it falls less than freely from the beginning.
        assert!(gains[0][1] > -0.15, "{name}: {:?}", gains[0]);
    }
}

#[test]
fn it_brakes_falls_asleep_and_wakes_when_it_is_driven() {
    for (name, mut world) in worlds() {
        let car = car_at(&mut world, [4.0, 0.8, 1.0]);
        world.drive(car, forward(1.0)).unwrap();
        run(&mut world, 120);
        let fast = world.velocity(car).unwrap().linear[0];
        assert!(fast > 6.0, "{name}: {fast} m/s");
        world.drive(car, Drive { brake: 1.0, ..Drive::default() }).unwrap();
        run(&mut world, 150);
        let at = place(&world, car);
        run(&mut world, 240);
        let rests = place(&world, car);
        assert!((0..3).all(|i| (at[i] - rests[i]).abs() < 0.02), "{name}: it stands, {at:?} {rests:?}");
        assert!(world.body(car).unwrap().sleeping, "{name}: {:?}", world.velocity(car));
        world.drive(car, forward(-1.0)).unwrap();
        run(&mut world, 60);
        assert!(place(&world, car)[0] < rests[0] - 0.5, "{name}: backwards");
    }
}

#[test]
fn it_stands_on_what_another_region_owns_and_pushes_what_is_in_its_way() {
    for (name, mut world) in worlds() {
        // A heavy deck beyond the border, and a crate on it.
        let deck = RigidBodyBuilder::dynamic().translation(Vector::new(13.0, 0.15, 0.0));
        let deck = world.insert(deck, ColliderBuilder::cuboid(6.0, 0.15, 3.0).density(3000.0)).unwrap();
        let load = RigidBodyBuilder::dynamic().translation(Vector::new(14.0, 0.81, 0.0));
        let load = world.insert(load, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(50.0)).unwrap();
        let car = car_at(&mut world, [0.0, 0.8, 0.0]);
        world.drive(car, forward(0.6)).unwrap();
        let mut ticks = 0;
        while place(&world, car)[0] < 11.5 {
            assert!(ticks < 400, "{name}: it is at {:?}", place(&world, car));
            run(&mut world, 1);
            ticks += 1;
        }
        world.drive(car, Drive { brake: 1.0, ..Drive::default() }).unwrap();
        run(&mut world, 60);
        let [at, held, pushed] = [car, deck, load].map(|id| place(&world, id));
        assert!((0.9..1.25).contains(&at[1]) && at[0] < 17.0, "{name}: its wheels stand on the deck, {at:?}");
        assert!((held[0] - 13.0).abs() < 0.5, "{name}: {held:?}");
        assert!(pushed[0] > 14.5, "{name}: the crate is at {pushed:?}, the car at {at:?}");
    }
}

/// Only its wheels reach the deck, which another region owns.
#[test]
fn a_high_one_stands_on_a_deck_that_its_chassis_is_far_above() {
    for (name, mut world) in worlds() {
        let deck = RigidBodyBuilder::dynamic().translation(Vector::new(12.0, 0.2, 0.0));
        world.insert(deck, ColliderBuilder::cuboid(9.0, 0.2, 3.0).density(3000.0)).unwrap();
        let mut vehicle = Vehicle::default();
        vehicle.wheels.iter_mut().for_each(|wheel| (wheel.rest_m, wheel.stiffness) = (3.0, 60.0));
        let body = RigidBodyBuilder::dynamic();
        let car = world.insert_vehicle(WorldPose::at([-5.0, 3.6, 0.0]), &vehicle, body, [chassis()]).unwrap();
        run(&mut world, 60);
        let low = place(&world, car)[1];
        world.drive(car, forward(0.4)).unwrap();
        for _ in 0..600 {
            if place(&world, car)[0] < 4.4 {
                run(&mut world, 1);
            }
        }
        world.drive(car, Drive { brake: 1.0, ..Drive::default() }).unwrap();
        run(&mut world, 10);
        let [x, y, _] = place(&world, car);
        assert!((4.3..6.0).contains(&x), "{name}: it is before the border, {x}");
        assert!(y > low + 0.15, "{name}: its front wheels stand on the deck: {low} m before, now {y} m");
    }
}

/// The car is split among regions as long as it touches what another region owns: each copy has its part of
/// the engine.
#[test]
fn it_pushes_a_load_across_a_border_no_faster_than_in_one_region() {
    let mut speeds = Vec::new();
    for (name, mut world) in worlds() {
        let load = RigidBodyBuilder::dynamic().translation(Vector::new(9.0, 0.5, 0.0));
        let slides = ColliderBuilder::cuboid(4.0, 0.5, 1.0).density(200.0).friction(0.0);
        world.insert(load, slides.friction_combine_rule(CoefficientCombineRule::Min)).unwrap();
        let car = car_at(&mut world, [3.0, 0.8, 0.0]);
        run(&mut world, 20);
        world.drive(car, forward(1.0)).unwrap();
        run(&mut world, 100);
        speeds.push((name, world.velocity(car).unwrap().linear[0], place(&world, car)[0]));
    }
    let (_, alone, at) = speeds[0].clone();
    assert!(alone > 1.5 && at > 4.5, "{alone} m/s at {at}");
    for (name, speed, at) in &speeds[1..] {
        println!("{name}: {speed} m/s at {at}, in one region {alone} m/s");
        // With `proxy` the load feels nothing of the car's mass.
        assert!(
            name == "Proxy" || (speed / alone - 1.0).abs() < 0.15,
            "{name}: {speed} m/s, in one region {alone}"
        );
    }
}

/// Returns the height of hills to which nothing here is tuned, metres.
fn hill_m(x: f32, z: f32) -> f32 {
    1.2 * (0.11 * x).sin() * (0.13 * z + 0.4).cos() + 0.35 * (0.31 * x + 0.23 * z).sin()
}

/// Returns a number from -1 to 1, by a seed.
fn random(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 40) as f32 / (1 << 23) as f32 - 1.0
}

/// Trucks with six wheels, carts with three, and cars, all with drivers that do not look, on a mesh of hills,
/// among crates, over borders.
#[test]
fn a_crowd_of_drivers_stays_on_the_hills_in_every_coupling() {
    const HALF: i32 = 40;
    let corner = |i: i32, j: i32| {
        let (x, z) = (2.0 * i as f32, 2.0 * j as f32);
        Vector::new(x, hill_m(x, z), z)
    };
    let side = 2 * HALF + 1;
    let vertices: Vec<_> = (-HALF..=HALF).flat_map(|i| (-HALF..=HALF).map(move |j| corner(i, j))).collect();
    let quads = (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i * side + j) as u32));
    let side = side as u32;
    let triangles: Vec<_> =
        quads.flat_map(|a| [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]).collect();
    let couplings = [Coupling::Auto, Coupling::Overlap, Coupling::Owner, Coupling::Proxy];
    let cut = couplings.into_iter().map(|coupling| (4, coupling));
    for (regions, coupling) in std::iter::once((1, Coupling::Auto)).chain(cut) {
        let name = format!("{regions} by {coupling:?}");
        let step = StepSettings::default().with_coupling(coupling);
        let partitioning = Partitioning::Regions(regions);
        let mut world = World::new(WorldConfig { partitioning, step, ..WorldConfig::default() }).unwrap();
        let hills = ColliderBuilder::trimesh(vertices.clone(), triangles.clone()).unwrap();
        world.insert(RigidBodyBuilder::fixed(), hills).unwrap();
        let mut seed = 5;
        let mut cars = Vec::new();
        for k in 0..12 {
            let (x, z) = (7.0 * (k % 4) as f32 - 11.0, 6.0 * (k / 4) as f32 - 7.0);
            let wheel = |x: f32, z: f32| Wheel {
                at_m: [x, -0.15, z],
                engine_n: 1500.0,
                steering_rad: if x > 0.5 { 0.5 } else { 0.0 },
                ..Wheel::default()
            };
            let wheels = match k % 3 {
                0 => Vehicle::default().wheels,
                1 => [-1.3, 0.0, 1.3].into_iter().flat_map(|x| [wheel(x, -0.9), wheel(x, 0.9)]).collect(),
                _ => vec![wheel(1.0, 0.0), wheel(-0.9, -0.8), wheel(-0.9, 0.8)],
            };
            let vehicle = Vehicle { wheels, top_speed_m_s: 9.0 };
            let at = WorldPose::at([x, hill_m(x, z) + 1.3, z].map(f64::from));
            cars.push(world.insert_vehicle(at, &vehicle, RigidBodyBuilder::dynamic(), [chassis()]).unwrap());
            let (x, z) = (x + 3.5, z + 2.5);
            let crate_at = RigidBodyBuilder::dynamic().translation(Vector::new(x, hill_m(x, z) + 0.6, z));
            world.insert(crate_at, ColliderBuilder::cuboid(0.4, 0.4, 0.4).density(120.0)).unwrap();
        }
        let mut way_m = 0.0;
        let mut fastest: f32 = 0.0;
        for tick in 0..600 {
            if tick % 40 == 0 {
                for &car in &cars {
                    let brake = (random(&mut seed) - 0.7).max(0.0);
                    let throttle = if brake > 0.0 { 0.0 } else { 0.3 + 0.7 * random(&mut seed) };
                    world.drive(car, Drive { throttle, brake, steering: random(&mut seed) }).unwrap();
                }
            }
            world.step().unwrap();
            for &car in &cars {
                let [x, y, z] = place(&world, car);
                let above = y - f64::from(hill_m(x as f32, z as f32));
                assert!(x.abs() < 78.0 && z.abs() < 78.0, "{name}, tick {tick}: the hills end at {x} {z}");
                assert!(
                    (-0.1..6.0).contains(&above),
                    "{name}, tick {tick}: {above} m above the hills at {x} {z}"
                );
                let v = Vector::from_array(world.velocity(car).unwrap().linear).length();
                fastest = fastest.max(v);
                way_m += v / 60.0;
            }
        }
        assert!(way_m > 12.0 * 10.0, "{name}: they drive, {way_m} m in all");
        assert!(fastest < 25.0, "{name}: nobody is shot away, {fastest} m/s");
        println!("{name}: {way_m:.0} m, at most {fastest:.1} m/s");
    }
}

/// Wheels that are all steered across do not push the car along its front, by which its speed might be told.
#[test]
fn no_wheel_pushes_it_beyond_its_top_speed() {
    for turned in [0.0, std::f32::consts::FRAC_PI_2] {
        let mut world = world(0, Coupling::Auto);
        let mut vehicle = Vehicle { top_speed_m_s: 12.0, ..Vehicle::default() };
        for wheel in &mut vehicle.wheels {
            (wheel.engine_n, wheel.grip, wheel.side_grip, wheel.steering_rad) = (1e9, 1e3, 0.0, turned);
        }
        let at = WorldPose::at([0.0, 0.8, 0.0]);
        let car = world.insert_vehicle(at, &vehicle, RigidBodyBuilder::dynamic(), [chassis()]).unwrap();
        world.drive(car, Drive { throttle: 1.0, brake: 0.0, steering: 1.0 }).unwrap();
        let mut fastest: f32 = 0.0;
        for _ in 0..120 {
            run(&mut world, 1);
            fastest = fastest.max(Vector::from_array(world.velocity(car).unwrap().linear).length());
        }
        assert!((8.0..18.0).contains(&fastest), "turned by {turned}: {fastest} m/s");
    }
}

#[test]
fn a_restored_one_drives_on_to_the_same_bits() {
    for (name, mut world) in worlds() {
        let car = car_at(&mut world, [3.0, 0.8, 1.0]);
        world.drive(car, Drive { throttle: 1.0, brake: 0.0, steering: 0.2 }).unwrap();
        run(&mut world, 70);
        let mut saved = Vec::new();
        world.save(&mut saved).unwrap();
        let mut again = World::restore(&saved[..], 2).unwrap();
        run(&mut world, 60);
        run(&mut again, 60);
        assert_eq!(world.state_hash().unwrap(), again.state_hash().unwrap(), "{name}");
    }
}

#[test]
fn what_cannot_drive_is_refused() {
    let mut world = world(0, Coupling::Auto);
    let mut insert = |vehicle: &Vehicle, body: RigidBodyBuilder| {
        world
            .insert_vehicle(WorldPose::default(), vehicle, body, [chassis()])
            .map_err(|error| error.to_string())
    };
    let usual = Vehicle::default();
    let fixed = insert(&usual, RigidBodyBuilder::fixed()).unwrap_err();
    assert!(fixed.contains("Fixed") && fixed.contains("dynamic()"), "{fixed}");
    let none =
        insert(&Vehicle { wheels: Vec::new(), ..usual.clone() }, RigidBodyBuilder::dynamic()).unwrap_err();
    assert!(none.contains("wheels") && none.contains("1 to 32"), "{none}");
    let flat = Wheel { radius_m: 0.0, ..Wheel::default() };
    let flat =
        insert(&Vehicle { wheels: vec![flat], ..usual.clone() }, RigidBodyBuilder::dynamic()).unwrap_err();
    assert!(flat.contains("radius_m"), "{flat}");
    let odd = Wheel { axle: [0.0, 1.0, 0.0], ..Wheel::default() };
    let odd = insert(&Vehicle { wheels: vec![odd], ..usual }, RigidBodyBuilder::dynamic()).unwrap_err();
    assert!(odd.contains("across the suspension"), "{odd}");
    let ball = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).unwrap();
    let other = world.drive(ball, forward(1.0)).unwrap_err().to_string();
    assert!(other.contains("insert_vehicle"), "{other}");
    let car = car_at(&mut world, [9.0, 1.0, 0.0]);
    for drive in [forward(1.1), forward(f32::NAN), Drive { brake: -0.1, ..Drive::default() }] {
        assert!(world.drive(car, drive).unwrap_err().to_string().contains("drive."), "{drive:?}");
    }
}

/// Allowed numbers at the edge of their ranges must not end a world: Rapier's controller asserts that its
/// forces are numbers.
#[test]
fn odd_ones_end_no_world() {
    let mut heavy = Vehicle::default();
    heavy.wheels.iter_mut().for_each(|wheel| (wheel.stiffness, wheel.grip) = (1e9, 0.0));
    let mut world_of_one = world(0, Coupling::Auto);
    let body = RigidBodyBuilder::dynamic();
    let pose = WorldPose::at([0.0, 0.6, 0.0]);
    world_of_one.insert_vehicle(pose, &heavy, body, [chassis().density(1e34)]).unwrap();
    run(&mut world_of_one, 10);
    let extremes = [0.0, 1e-30, 1.0, 1e3, 1e9];
    let mut seed = 11;
    for round in 0..60 {
        let mut world = world(2, Coupling::Auto);
        let mut pick = || extremes[((random(&mut seed) + 1.0) * 2.49) as usize];
        let wheel = Wheel {
            at_m: [1.0, -0.2, 0.3],
            stiffness: pick(),
            compression: pick(),
            relaxation: pick(),
            most_force_n: pick(),
            grip: pick().min(1e3),
            engine_n: pick(),
            brake_n: pick(),
            rest_m: pick().min(100.0),
            travel_m: pick().min(100.0),
            radius_m: pick().clamp(1e-30, 100.0),
            ..Wheel::default()
        };
        let vehicle = Vehicle { wheels: vec![wheel; 3], top_speed_m_s: 1e4 };
        let heavy = chassis().density([1e-20, 1.0, 1e25, 1e37][round % 4]);
        // Faster bodies are refused.
        let (ahead, down) = (pick().min(280.0), pick().min(280.0));
        let body =
            RigidBodyBuilder::dynamic().linvel(Vector::new(ahead, -down, 0.0)).angvel(Vector::X * pick());
        let car = world.insert_vehicle(WorldPose::at([5.0, 0.9, 1.0]), &vehicle, body, [heavy]).unwrap();
        world
            .drive(car, Drive { throttle: if round % 3 == 0 { 0.0 } else { 1.0 }, brake: 1.0, steering: 1.0 })
            .unwrap();
        run(&mut world, 20);
    }
}

fn served() -> Served {
    Served::of(&world(1, Coupling::Auto))
}

#[test]
fn a_clients_vehicle_is_driven_by_the_nodes() {
    let mut served = served();
    let car = car_at(&mut served.client, [0.0, 1.0, 0.0]);
    served.client.drive(car, forward(1.0)).unwrap();
    served.until("it drives", |client| client.pose(car).is_some_and(|at| at.translation[0] > 2.0));
    let owner = served.client.owner(car).region;
    served.until("it is owned beyond the border", |client| client.owner(car).region != owner);
    served.client.drive(car, Drive { brake: 1.0, ..Drive::default() }).unwrap();
    served.until("it stands", |client| client.body(car).is_some_and(|body| body.sleeping));
    let at = place(&served.client, car);
    assert!(at[0] > 7.0 && (0.55..0.95).contains(&at[1]), "on its wheels: {at:?}");
    // The server's program may also put it back, and drive it.
    served.server.set_pose(car, WorldPose::at([0.0, 1.0, 5.0])).unwrap();
    served.server.drive(car, forward(-0.5)).unwrap();
    served.until("it is put back, and drives backwards", |client| {
        let [x, _, z] = place(client, car);
        x < -1.0 && (z - 5.0).abs() < 0.5
    });
    // A node goes, and the car drives on.
    served.client.drive(car, forward(1.0)).unwrap();
    served.nodes.pop();
    served.until("it comes by once more", |client| place(client, car)[0] > 8.0);
    let mine = served.client.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).unwrap();
    assert!(served.client.drive(mine, forward(1.0)).unwrap_err().to_string().contains("no vehicle"));
    assert!(served.client.drive(BodyId::persistent(0), forward(1.0)).is_err());
}

#[test]
fn a_vehicle_whose_velocity_is_set_in_each_step_hears_its_driver() {
    let mut served = served();
    let car = car_at(&mut served.client, [0.0, 1.0, 0.0]);
    served.until("it is there", |client| client.movable_count() > 0);
    let mut steps = 0;
    while place(&served.client, car)[0] < 2.0 {
        assert!(steps < 3_000, "{:?}", place(&served.client, car));
        steps += 1;
        // The car is set to its present velocity: by that alone it would never get faster.
        let velocity = served.client.velocity(car).unwrap();
        served.client.set_velocity(car, velocity).unwrap();
        served.client.drive(car, forward(1.0)).unwrap();
        let mut is_stepped = false;
        served.until("a step", |_| std::mem::replace(&mut is_stepped, true));
    }
}

#[test]
fn a_vehicle_that_is_refused_is_refused_once_whatever_its_driver_did() {
    let mut served = served();
    let fast = Vehicle { top_speed_m_s: 500.0, ..Vehicle::default() };
    let body = RigidBodyBuilder::dynamic();
    let refused = served.client.insert_vehicle(WorldPose::at([9.0, 3.0, 9.0]), &fast, body, [chassis()]);
    let refused = refused.unwrap();
    served.client.drive(refused, forward(1.0)).unwrap();
    // The world goes on.
    let car = car_at(&mut served.client, [0.0, 1.0, 0.0]);
    served.client.drive(car, forward(0.2)).unwrap();
    let mut refusals = Vec::new();
    let mut end = None;
    served.until("a leader would have refused its driver, too", |client| {
        refusals.extend(client.changes().iter().filter_map(|change| match change {
            BodyChange::Refused { body, why, .. } if *body == Some(refused) => Some(*why),
            _ => None,
        }));
        if !refusals.is_empty() && client.movable_count() > 0 {
            end.get_or_insert(client.tick().0 + 120);
        }
        end.is_some_and(|end| client.tick().0 > end)
    });
    assert_eq!(refusals, [Refusal::TooFast]);
}

#[test]
fn a_clients_vehicle_has_bounds_and_a_programs_has_none() {
    let mut served = served();
    let refused = |served: &mut Served, vehicle: Vehicle| {
        let body = RigidBodyBuilder::dynamic();
        let id = served
            .client
            .insert_vehicle(WorldPose::at([0.0, 3.0, 0.0]), &vehicle, body, [chassis()])
            .unwrap();
        let mut why = None;
        served.until("it is refused", |client| {
            let of = |change: &BodyChange| match change {
                BodyChange::Refused { body: Some(body), why, .. } if *body == id => Some(*why),
                _ => None,
            };
            why = why.or(client.changes().iter().find_map(of));
            why.is_some()
        });
        why
    };
    let usual = Vehicle::default();
    let fast = Vehicle { top_speed_m_s: 500.0, ..usual.clone() };
    assert_eq!(refused(&mut served, fast.clone()), Some(Refusal::TooFast));
    let mut springs = usual.clone();
    springs.wheels[0].stiffness = 1e6;
    assert_eq!(refused(&mut served, springs), Some(Refusal::Costly(Costs::Wheels)));
    // Each damper is gentle, but together they turn a fall into a leap.
    let dampers = vec![Wheel { relaxation: 30.0, compression: 30.0, ..Wheel::default() }; 8];
    assert_eq!(
        refused(&mut served, Vehicle { wheels: dampers, ..usual.clone() }),
        Some(Refusal::Costly(Costs::Wheels))
    );
    let body = RigidBodyBuilder::dynamic();
    let pose = WorldPose::at([0.0, 1.0, 9.0]);
    let car = served.server.insert_vehicle(pose, &fast, body, [chassis()]).unwrap();
    served.server.drive(car, forward(1.0)).unwrap();
    served.until("the program's drives", |client| client.pose(car).is_some_and(|at| at.translation[0] > 8.0));
}
