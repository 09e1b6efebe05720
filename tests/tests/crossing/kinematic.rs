//! Tests kinematic bodies at borders.

use dcd::protocol::WorldPose;

use super::*;

#[test]
fn a_body_sent_to_a_pose_moves_at_one_speed_through_all_substeps() {
    for exchanges in [1, 2, 4] {
        let mut config = halves(Coupling::Overlap);
        config.step.exchanges = exchanges;
        let mut world = LocalWorld::new(config).unwrap();
        let pusher = RigidBodyBuilder::kinematic_position_based().translation(Vector::new(-3.0, 0.5, 0.0));
        let pusher = world.insert(pusher, ColliderBuilder::cuboid(0.25, 0.5, 1.0)).unwrap();
        insert_floor(&mut world);
        let ball = ColliderBuilder::ball(0.25).restitution(0.0).friction(0.0);
        let ball = world.insert(body_at(-2.4, 0.25, 0.0).can_sleep(false), ball).unwrap();
        let mut fastest = 0.0f32;
        for tick in 1..=60 {
            world.set_next_pose(pusher, WorldPose::at([-3.0 + 0.1 * f64::from(tick), 0.5, 0.0])).unwrap();
            steps(&mut world, 1);
            let x = at(&world, pusher)[0];
            assert!((x - (-3.0 + 0.1 * f64::from(tick))).abs() < 1e-5, "at tick {tick} it is at {x}");
            assert!(
                (speed(&world, pusher)[0] - 6.0).abs() < 1e-2,
                "{exchanges}: {:?}",
                speed(&world, pusher)
            );
            fastest = fastest.max(speed(&world, ball)[0]);
        }
        assert!(fastest < 6.3, "{exchanges}: pushed at 6 m/s, the ball went at {fastest}");
        assert!((speed(&world, ball)[0] - 6.0).abs() < 0.3, "{exchanges}: {:?}", speed(&world, ball));
    }
}

#[test]
fn a_body_sent_round_turns_about_its_centre_as_in_one_world() {
    for coupling in SHARING {
        let off = deviation(halves(coupling), |world| {
            let arm = RigidBodyBuilder::kinematic_position_based();
            let arm = world.insert(arm, ColliderBuilder::cuboid(2.0, 0.1, 0.1)).unwrap();
            insert_floor(world);
            world.update(arm, |_| {}).unwrap();
            for x in [-1.5, 1.5] {
                world
                    .insert(body_at(x, 0.3, if x < 0.0 { -1.0 } else { 1.0 }), ColliderBuilder::ball(0.3))
                    .unwrap();
            }
            for tick in 1..=20 {
                let angle = -0.02 * tick as f32;
                let (sin, cos) = (0.5 * angle).sin_cos();
                let pose = WorldPose { translation: [0.0, 0.3, 0.0], rotation: [0.0, sin, 0.0, cos] };
                world.set_next_pose(arm, pose).unwrap();
                steps(world, 1);
            }
        });
        assert!(off < 2e-2, "{}: {off}", coupling.name());
    }
}

#[test]
fn a_platform_carries_boxes_across_a_border() {
    for coupling in SHARING {
        for by_velocity in [false, true] {
            let off = deviation(halves(coupling), |world| {
                let kind = if by_velocity {
                    RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::new(1.5, 0.0, 0.0))
                } else {
                    RigidBodyBuilder::kinematic_position_based()
                };
                let platform = kind.translation(Vector::new(-3.0, 0.0, 0.0));
                let platform =
                    world.insert(platform, ColliderBuilder::cuboid(2.0, 0.25, 1.0).friction(1.0)).unwrap();
                for i in 0..3 {
                    let body = body_at(-4.2 + 1.2 * i as f32, 0.75, 0.0).linvel(Vector::new(1.5, 0.0, 0.0));
                    world.insert(body, cube().friction(1.0)).unwrap();
                }
                for tick in 1..=240 {
                    if !by_velocity {
                        let x = -3.0 + 1.5 / 60.0 * f64::from(tick);
                        world.set_next_pose(platform, WorldPose::at([x, 0.0, 0.0])).unwrap();
                    }
                    steps(world, 1);
                }
            });
            assert!(off < 2e-2, "{} {by_velocity}: {off}", coupling.name());
        }
    }
}

#[test]
fn a_body_that_gets_a_collider_goes_where_it_was_sent_and_so_does_what_it_is_tied_to() {
    for config in [one_world(), halves(Coupling::Auto), halves(Coupling::Overlap)] {
        let mut world = LocalWorld::new(weightless(config)).unwrap();
        let lift = RigidBodyBuilder::kinematic_position_based().translation(Vector::new(-0.2, 0.0, 0.0));
        let lift = world.insert(lift, cube()).unwrap();
        let hung = world.insert(body_at(-0.2, -2.0, 0.0).can_sleep(false), cube()).unwrap();
        let rope = SphericalJointBuilder::new().local_anchor2(Vector::Y * 2.0);
        world.insert_joint(lift, hung, rope).unwrap();
        steps(&mut world, 3);
        for (changed, y) in [(lift, 0.05), (hung, 0.1)] {
            world.set_next_pose(lift, WorldPose::at([-0.2, y, 0.0])).unwrap();
            world.insert_collider(changed, ColliderBuilder::ball(0.1)).unwrap();
            steps(&mut world, 1);
            let at = at(&world, lift);
            assert!((at[1] - y).abs() < 1e-6, "{at:?}");
        }
        let free = RigidBodyBuilder::kinematic_position_based().translation(Vector::new(-5.0, 0.0, 0.0));
        let free = world.insert(free, cube()).unwrap();
        world.set_next_pose(free, WorldPose::at([-6.0, 0.0, 0.0])).unwrap();
        world.set_pose(free, WorldPose::at([5.0, 0.0, 0.0])).unwrap();
        steps(&mut world, 2);
        assert_eq!(at(&world, free), [5.0, 0.0, 0.0], "what is put elsewhere stays there");
    }
}

#[test]
fn what_a_joint_ties_to_a_resting_body_of_another_region_stays_tied() {
    let far = [(Axis::X, -3.0), (Axis::X, 0.0), (Axis::X, 3.0)];
    for coupling in SHARING {
        for (planes, limit) in [(&far[1..2], 0), (&far[1..2], 256), (&far[..], 256)] {
            let mut config = cut(coupling, planes);
            config.step.island_limit = limit;
            let off = deviation(config, |world| {
                let post =
                    RigidBodyBuilder::kinematic_position_based().translation(Vector::new(-4.0, 0.0, 0.0));
                let post = world.insert(post, ColliderBuilder::ball(0.05)).unwrap();
                for x in [-1.0, 1.0, 5.0] {
                    let load =
                        world.insert(body_at(x, 0.0, 0.0), ColliderBuilder::cuboid(0.2, 0.1, 0.1)).unwrap();
                    let rope = FixedJointBuilder::new().local_anchor1(Vector::new(x + 4.0, 0.0, 0.0));
                    world.insert_joint(post, load, rope).unwrap();
                }
                steps(world, 180);
            });
            assert!(off < 0.05, "{} at {planes:?}, islands up to {limit}: {off} m off", coupling.name());
        }
    }
}
