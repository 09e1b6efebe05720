//! Tests that time neither stands still nor runs twice between regions of unlike rates.

use std::collections::BTreeSet;

use super::*;

/// Returns the place of a body at the present tick, extrapolated if its region is behind.
fn now(world: &LocalWorld, id: BodyId) -> [f64; 3] {
    let (region, handle) = world.host().owned(id).unwrap();
    let late_s = f64::from(world.host().behind(region.id())) / 60.0;
    let (pose, velocity) = region.motion(handle);
    std::array::from_fn(|i| pose.translation[i] + f64::from(velocity.linear[i]) * late_s)
}

#[test]
fn what_flies_through_regions_of_unlike_rates_keeps_its_time() {
    let mut world = row(8, ALL_COARSE, [0.0; 3]);
    world.set_viewpoints(&[Viewpoint { at: [10.0, 0.0, 0.0], radius_m: 3.0 }]).unwrap();
    let mut balls = Vec::new();
    for i in 0..12_u8 {
        let speed = (3.0 + 4.0 * f32::from(i)) * if i % 2 == 0 { 1.0 } else { -1.0 };
        let from = [f64::from(-speed.signum() * 70.0), 0.0, 1.5 * f64::from(i) - 8.0];
        let ball = RigidBodyBuilder::dynamic().linvel(Vector::X * speed).can_sleep(false);
        let ball = world.insert_at(WorldPose::at(from), ball, [ColliderBuilder::ball(0.3)]).unwrap();
        balls.push((ball, from, f64::from(speed)));
    }
    let mut rates = BTreeSet::new();
    for tick in 1..=200 {
        world.step().unwrap();
        rates.insert(levels(&world).map(|count| count > 0));
        for &(ball, from, speed) in &balls {
            let off_m = now(&world, ball)[0] - (from[0] + speed * f64::from(tick) / 60.0);
            assert!(off_m.abs() < 1e-3, "{ball} is {off_m} m off at tick {tick}");
            let (region, handle) = world.host().owned(ball).unwrap();
            let x = region.motion(handle).0.translation[0];
            let outside_m = (region.cell().min[0] - x).max(x - region.cell().max[0]);
            assert!(
                outside_m < speed.abs() * 10.0 / 60.0,
                "{ball} is {outside_m} m outside of its region at tick {tick}"
            );
        }
    }
    assert!(rates.contains(&[true, false, true]), "{rates:?}");
    assert!(world.stats().transfers >= 24, "{:?}", world.stats());
}

#[test]
fn what_meets_at_a_border_of_unlike_rates_collides_as_in_one_world() {
    for speed in [1.0, 8.0, 30.0] {
        let mut world = row(2, ALL_COARSE, [0.0; 3]);
        // The right region is in sight. The left one is not, until its ball meets the other one.
        world.set_viewpoints(&[Viewpoint { at: [15.0, 0.0, 0.0], radius_m: 5.0 }]).unwrap();
        let mut ball = |x: f64, speed: f32| {
            let body =
                RigidBodyBuilder::dynamic().linvel(Vector::X * speed).can_sleep(false).ccd_enabled(true);
            let shape = ColliderBuilder::ball(0.5).restitution(1.0).friction(0.0);
            world.insert_at(WorldPose::at([x, 0.0, 0.0]), body, [shape]).unwrap()
        };
        // They meet at the border.
        let way_m = f64::from(speed) * 2.0 + 0.5;
        let (left, right) = (ball(-way_m.min(19.0), speed), ball(way_m.min(19.0), -speed));
        run(&mut world, 90);
        assert!(levels(&world)[2] == 1, "{:?}", levels(&world));
        run(&mut world, 60);
        let velocity = |id| world.velocity(id).unwrap().linear[0];
        let momentum = velocity(left) + velocity(right);
        assert!(momentum.abs() < 1e-3 * speed, "{speed} m/s: momentum {momentum}");
        assert!((velocity(right) - speed).abs() < 0.02 * speed, "{speed} m/s: away at {}", velocity(right));
    }
}

/// Returns the place of a point of a body, metres.
fn point(world: &LocalWorld, id: BodyId, local: Vector) -> [f64; 3] {
    let pose = world.pose(id).unwrap();
    let arm = (Rotation::from_array(pose.rotation) * local).to_array();
    std::array::from_fn(|i| pose.translation[i] + f64::from(arm[i]))
}

#[test]
fn what_is_tied_over_regions_at_different_times_comes_to_be_one_in_the_same_tick() {
    // One of the two bodies' regions is in sight, or neither.
    for (eye_m, rates) in [(15.0, [2, 0, 1]), (28.0, [1, 0, 2])] {
        for phase in 0..4 {
            let mut world = row_of(3, ALL_COARSE, [0.0; 3], Coupling::Overlap);
            world.set_viewpoints(&[Viewpoint { at: [eye_m, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
            let [left, right] = [-18.0, 0.0].map(|x: f64| {
                let body = RigidBodyBuilder::dynamic().linvel(Vector::Z * x.signum() as f32).can_sleep(false);
                world.insert_at(WorldPose::at([x, 0.0, 0.0]), body, [ColliderBuilder::ball(0.3)]).unwrap()
            });
            run(&mut world, 120 + phase);
            assert_eq!(levels(&world), rates);
            // They fly apart with a taut rope.
            let (from, to) = (now(&world, left), now(&world, right));
            let half: [f32; 3] = std::array::from_fn(|i| (0.5 * (to[i] - from[i])) as f32);
            let half = Vector::from(half);
            let rope = SphericalJointBuilder::new().local_anchor1(half).local_anchor2(-half);
            world.insert_joint(left, right, rope).unwrap();
            for ticks in [1, 60] {
                run(&mut world, ticks);
                assert_eq!(world.host().validate(), [], "{eye_m} m, phase {phase}");
            }
            let (a, b) = (point(&world, left, half), point(&world, right, -half));
            let gap_m = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
            assert!(gap_m < 0.05, "{eye_m} m, phase {phase}: the ends of the rope are {gap_m} m apart");
        }
    }
}
