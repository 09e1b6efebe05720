//! Tests that what is noted where nobody looks is as if all were computed in full: hits, what sensors sense, bounces, spins,
//! and vehicles on their way.

use dcd::protocol::{Velocity, WorldPose};

use super::*;

/// Returns whether some region is stepped in every fourth tick.
fn is_coarse(world: &LocalWorld) -> bool {
    world.fidelity_report().is_some_and(|report| report.levels[2] > 0)
}

/// Returns what happens in a world in full, and in one in which nobody looks.
fn in_full_and_unseen<T>(run: impl Fn(LocalWorld) -> T) -> [T; 2] {
    [Fidelity::Off, ALL_COARSE].map(|fidelity| run(unseen(fidelity)))
}

#[test]
fn hits_are_as_hard_where_nobody_looks() {
    let [full, unseen] = in_full_and_unseen(|mut world| {
        let mut boxes = Vec::new();
        for i in 0..8 {
            let crate_10_kg = ColliderBuilder::cuboid(0.3, 0.3, 0.3)
                .mass(10.0)
                .active_events(ActiveEvents::CONTACT_FORCE_EVENTS)
                .contact_force_event_threshold(500.0);
            let at = WorldPose::at([-35.0 + 5.0 * f64::from(i), 0.3, -10.0]);
            let body = RigidBodyBuilder::dynamic().can_sleep(false);
            boxes.push(world.insert_at(at, body, [crate_10_kg]).unwrap());
        }
        run(&mut world, 120);
        let is_coarse = is_coarse(&world);
        for (i, &id) in boxes.iter().enumerate() {
            let x = world.pose(id).unwrap().translation[0];
            world.set_pose(id, WorldPose::at([x, 3.0 + 0.3 * i as f64, -10.0])).unwrap();
        }
        let mut hardest = vec![0.0_f32; boxes.len()];
        for _ in 0..120 {
            world.step().unwrap();
            for force in &world.events().forces {
                let hit = boxes.iter().position(|id| [force.key.a, force.key.b].contains(id)).unwrap();
                hardest[hit] = hardest[hit].max(force.magnitude_n);
            }
        }
        (is_coarse, hardest)
    });
    assert_eq!((full.0, unseen.0), (false, true));
    for (full, unseen) in full.1.iter().zip(&unseen.1) {
        assert!(*full > 500.0 && (unseen / full - 1.0).abs() < 0.1, "{unseen} N, not {full} N");
    }
}

#[test]
fn sensors_miss_nothing_that_moves_where_nobody_looks() {
    let [full, unseen] = in_full_and_unseen(|mut world| {
        let sensor =
            |collider: ColliderBuilder| collider.sensor(true).active_events(ActiveEvents::COLLISION_EVENTS);
        let free = || RigidBodyBuilder::dynamic().gravity_scale(0.0).can_sleep(false);
        let at = |x: f64, z: f64| WorldPose::at([x, 2.0, z]);
        let mut met = 0;
        for i in 0..12 {
            // Either of the two senses, and moves.
            let (ball, plate) = (ColliderBuilder::ball(0.2), ColliderBuilder::cuboid(0.05, 0.5, 0.5));
            let (ball, plate) = if i % 2 == 0 { (sensor(ball), plate) } else { (ball, sensor(plate)) };
            let z = f64::from(i) * 2.0 - 12.0;
            let [ball_m_s, plate_m_s] = if i % 4 < 2 { [8.0, 0.0] } else { [0.0, -9.0] };
            let x = -30.0 + 0.13 * f64::from(i);
            world.insert_at(at(x, z), free().linvel(Vector::X * ball_m_s), [ball]).unwrap();
            world.insert_at(at(x + 21.0, z), free().linvel(Vector::X * plate_m_s), [plate]).unwrap();
        }
        for _ in 0..200 {
            world.step().unwrap();
            met += world.events().touches.iter().filter(|touch| touch.began && touch.sensor).count();
        }
        (is_coarse(&world), met)
    });
    assert_eq!((full, unseen), ((false, 12), (true, 12)));
}

#[test]
fn what_bounces_bounces_on_where_nobody_looks() {
    let [full, unseen] = in_full_and_unseen(|mut world| {
        let mut balls = Vec::new();
        for i in 0..20 {
            let at = WorldPose::at([-38.0 + 2.9 * f64::from(i), 2.0 + 0.1 * f64::from(i), 0.0]);
            let ball = ColliderBuilder::ball(0.3)
                .restitution(1.0)
                .restitution_combine_rule(CoefficientCombineRule::Max);
            let body = RigidBodyBuilder::dynamic().can_sleep(false);
            balls.push(world.insert_at(at, body, [ball]).unwrap());
        }
        let energy = |world: &LocalWorld| {
            let each = balls.iter().map(|&ball| {
                let velocity = world.velocity(ball).unwrap().linear.map(f64::from);
                0.5 * length(velocity).powi(2) + 9.81 * (world.pose(ball).unwrap().translation[1] - 0.3)
            });
            each.sum::<f64>()
        };
        run(&mut world, 60);
        let before = energy(&world);
        run(&mut world, 660);
        (is_coarse(&world), energy(&world) / before)
    });
    assert!(!full.0 && full.1 > 0.9, "{full:?}");
    assert!(unseen.0 && unseen.1 > 0.85, "{unseen:?}");
}

#[test]
fn what_spins_spins_on_where_nobody_looks() {
    for spin in [10.0, 14.0, 30.0] {
        let [full, unseen] = in_full_and_unseen(|mut world| {
            let body = RigidBodyBuilder::dynamic().gravity_scale(0.0).angvel(Vector::Y * spin);
            let at = WorldPose::at([-20.0, 5.0, 0.0]);
            let top = world.insert_at(at, body.can_sleep(false), [ColliderBuilder::ball(0.3)]).unwrap();
            // One in ten of what is awake is what counts for the rate.
            for i in 0..12 {
                let at = WorldPose::at([-30.0, 2.0 * f64::from(i) - 12.0, 10.0]);
                let still = RigidBodyBuilder::dynamic().gravity_scale(0.0).can_sleep(false);
                world.insert_at(at, still, [ColliderBuilder::ball(0.3)]).unwrap();
            }
            run(&mut world, 240);
            let told = world.update(top, |body| body.is_fast_rotation_allowed()).unwrap();
            assert!(!told, "a program sees what it has set");
            (is_coarse(&world), world.velocity(top).unwrap().angular[1])
        });
        assert_eq!((full.0, unseen.0), (false, true));
        assert!(
            (full.1 - spin).abs() < 0.01 && (unseen.1 - spin).abs() < 0.01,
            "{spin}: {full:?} {unseen:?}"
        );
    }
}

#[test]
fn vehicles_get_over_a_ridge_where_nobody_looks() {
    let [full, unseen] = in_full_and_unseen(|world| {
        let mut world: World = world.into();
        let mut cars = Vec::new();
        for i in 0..5 {
            let lane = 7.0 * f64::from(i) - 14.0;
            let chassis = ColliderBuilder::cuboid(1.6, 0.3, 0.8).mass(1_000.0);
            let vehicle = Vehicle { top_speed_m_s: 4.0 + f32::from(i as u8), ..Vehicle::default() };
            let at = WorldPose::at([-36.0 + 0.2 * f64::from(i), 1.0, lane]);
            let car = world.insert_vehicle(at, &vehicle, RigidBodyBuilder::dynamic(), [chassis]).unwrap();
            let ridge = RigidBodyBuilder::fixed()
                .translation(Vector::new(-24.0, -0.35, lane as f32))
                .rotation(Vector::Z * 0.78);
            world.insert(ridge, ColliderBuilder::cuboid(0.5, 0.5, 2.0)).unwrap();
            cars.push(car);
        }
        for _ in 0..160 {
            world.step().unwrap();
        }
        for &car in &cars {
            world.drive(car, Drive { throttle: 1.0, ..Drive::default() }).unwrap();
        }
        for _ in 0..480 {
            world.step().unwrap();
        }
        cars.iter().filter(|car| world.pose(**car).unwrap().translation[0] > -20.0).count()
    });
    assert_eq!((full, unseen), (5, 5));
}

#[test]
fn a_tolerance_is_kept_in_a_small_world_too() {
    let mut world = unseen(Fidelity::Tolerance { m_s: 1e-6 });
    for i in 0..3 {
        // Chains swing in each unseen region.
        let x = -30.0 + 20.0 * f64::from(i);
        let mut above = world.insert_at(WorldPose::at([x, 9.0, 0.0]), RigidBodyBuilder::fixed(), []).unwrap();
        for link in 1..6 {
            let at = WorldPose::at([x + f64::from(link), 9.0, 0.0]);
            let body = RigidBodyBuilder::dynamic().can_sleep(false);
            let below = world.insert_at(at, body, [ColliderBuilder::ball(0.2)]).unwrap();
            let joint = SphericalJointBuilder::new().local_anchor2(-Vector::X);
            world.insert_joint(above, below, joint.build()).unwrap();
            above = below;
        }
    }
    run(&mut world, 3_600);
    // It is tried again, after ever longer times.
    let mut coarse = 0;
    for _ in 0..1_200 {
        world.step().unwrap();
        coarse += levels(&world)[2];
    }
    assert!(coarse < 3 * 1_200 / 2, "{coarse} of 3,600 {:?}", world.fidelity_report());
}

#[test]
fn what_falls_onto_a_lift_that_comes_up_is_caught_where_nobody_looks() {
    let [full, unseen] = in_full_and_unseen(|mut world| {
        let mut lifts = Vec::new();
        for i in 0..16 {
            let [x, z] = [-36.0 + 4.5 * f64::from(i % 8), if i < 8 { -5.0 } else { 5.0 }];
            let lift = RigidBodyBuilder::kinematic_velocity_based();
            let plate = ColliderBuilder::cuboid(1.0, 0.2, 1.0);
            let lift = world.insert_at(WorldPose::at([x, 1.0, z]), lift, [plate]).unwrap();
            let load = ColliderBuilder::cuboid(0.4, 0.4, 0.4);
            let load = world.insert_at(WorldPose::at([x, 1.6, z]), RigidBodyBuilder::dynamic(), [load]);
            lifts.push((lift, load.unwrap(), 3.7 + 0.02 * i as f32));
        }
        run(&mut world, 160);
        // The load flies up when its lift turns, and comes down when the lift comes up again.
        for tick in 0..480 {
            if tick % 75 == 0 {
                let up = if tick % 150 == 0 { 1.0 } else { -1.0 };
                for &(lift, _, speed) in &lifts {
                    world.set_velocity(lift, Velocity::linear([0.0, up * speed, 0.0])).unwrap();
                }
            }
            world.step().unwrap();
        }
        let height = |id| world.pose(id).unwrap().translation[1];
        lifts.iter().filter(|&&(lift, load, _)| height(load) > height(lift)).count()
    });
    assert_eq!((full, unseen), (16, 16));
}
