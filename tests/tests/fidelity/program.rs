//! Tests what a program does where nobody looks: what it ties, sets, removes and moves.

use dcd::Push;

use super::*;

#[test]
fn what_a_program_ties_where_nobody_looks_holds() {
    let mut world = row(4, ALL_COARSE, [0.0, -9.81, 0.0]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    run(&mut world, 70);
    // At a tick at which regions are behind: across the border at -20, and away from it.
    for from_m in [-22.0_f64, -8.0] {
        let nail = world
            .insert_at(
                WorldPose::at([from_m, 5.0, 0.0]),
                RigidBodyBuilder::fixed(),
                [ColliderBuilder::ball(0.1)],
            )
            .unwrap();
        let mut above = nail;
        let mut chain = Vec::new();
        for i in 1..=6 {
            let at = WorldPose::at([from_m + 0.6 * f64::from(i), 5.0, 0.0]);
            let link =
                world.insert_at(at, RigidBodyBuilder::dynamic(), [ColliderBuilder::ball(0.2)]).unwrap();
            let joint =
                SphericalJointBuilder::new().local_anchor1(Vector::X * 0.3).local_anchor2(Vector::X * -0.3);
            world.insert_joint(above, link, joint).unwrap();
            chain.push(link);
            above = link;
        }
        run(&mut world, 241);
        assert_eq!(world.host().validate(), []);
        let mut before = [from_m, 5.0, 0.0];
        for link in chain {
            let place = world.pose(link).unwrap().translation;
            let apart = (0..3).map(|i| (place[i] - before[i]).powi(2)).sum::<f64>().sqrt();
            assert!(apart < 0.65, "{link} is {apart} m from the one before it");
            before = place;
        }
    }
    assert_eq!(levels(&world)[2], 3);
}

#[test]
fn what_a_program_sets_for_one_tick_counts_for_one_tick_where_nobody_looks() {
    let mut world = row(4, ALL_COARSE, [0.0; 3]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    let mut insert = |x: f64, z: f64, body: RigidBodyBuilder| {
        world.insert_at(WorldPose::at([x, 0.0, z]), body, [ColliderBuilder::ball(0.3).mass(2.0)]).unwrap()
    };
    let places = (0..24_u8).map(|i| 2.0 * f64::from(i) - 38.0);
    let pairs: Vec<_> = places
        .map(|x| {
            let ball = insert(x, 0.0, RigidBodyBuilder::dynamic().can_sleep(false));
            (x, ball, insert(x, 5.0, RigidBodyBuilder::kinematic_velocity_based()))
        })
        .collect();
    run(&mut world, 100);
    let mut late = 0;
    for (x, ball, door) in pairs {
        late += usize::from(is_late(&world, ball));
        for (force_n, speed) in [(120.0, 6.0), (0.0, 0.0)] {
            world.push(&Push::force(ball, [0.0, force_n, 0.0], [0.0; 3])).unwrap();
            world.set_velocity(door, Velocity::linear([speed, 0.0, 0.0])).unwrap();
            run(&mut world, 1);
        }
        run(&mut world, 11);
        let (gained, gone) =
            (world.velocity(ball).unwrap().linear[1], world.pose(door).unwrap().translation[0] - x);
        assert!((gained - 1.0).abs() < 1e-4 && (gone - 0.1).abs() < 1e-4, "{gained} m/s, {gone} m");
    }
    assert!(late > 8, "{late} of 24 were in regions that were behind");
    assert_eq!(levels(&world), [1, 0, 3]);
}

#[test]
fn what_a_program_removes_where_nobody_looks_lets_go_in_the_next_tick() {
    let mut world = unseen(ALL_COARSE);
    let boxes: Vec<_> = (0..20_u8)
        .map(|i| {
            let at = Vector::new(2.0 * f32::from(i) - 38.0, 0.5, 0.0);
            let body = RigidBodyBuilder::dynamic().translation(at).can_sleep(false);
            let shape = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
            world.insert(body, shape.active_events(ActiveEvents::COLLISION_EVENTS)).unwrap()
        })
        .collect();
    run(&mut world, 100);
    let mut late = 0;
    for id in boxes {
        late += usize::from(is_late(&world, id));
        world.remove(id).unwrap();
        run(&mut world, 1);
        let touches = world.events().touches.iter();
        let of_it = touches.filter(|touch| [touch.key.a, touch.key.b].contains(&id));
        let ends: Vec<_> = of_it.map(|touch| touch.began).collect();
        assert_eq!(ends, [false], "of {id}");
        run(&mut world, 12);
    }
    assert!(late > 5, "{late} of 20 were in regions that were behind");
}

/// Platforms that go to and fro and up and down, as their program says in each tick.
#[test]
fn who_rides_where_nobody_looks_keeps_its_place() {
    let cuts = [-20.0, 0.0, 20.0].map(|x| (Axis::X, x));
    let mut world = World::new(WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0, 20.0, 20.0]),
        partitioning: Partitioning::Cuts(cuts.to_vec()),
        fidelity: ALL_COARSE,
        ..WorldConfig::default()
    })
    .unwrap();
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    let floor = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
    world.insert(floor, ColliderBuilder::cuboid(80.0, 0.5, 40.0)).unwrap();
    let rides: Vec<_> = [-30.0, -10.0, 10.0]
        .map(|x| {
            let body = RigidBodyBuilder::kinematic_velocity_based;
            let platform = [ColliderBuilder::cuboid(2.0, 0.2, 2.0)];
            let platform = world.insert_at(WorldPose::at([x, 3.0, 0.0]), body(), platform).unwrap();
            let (at, capsule) = (WorldPose::at([x - 1.0, 3.95, 0.0]), [ColliderBuilder::capsule_y(0.4, 0.3)]);
            (platform, world.insert_character(at, &Character::default(), body(), capsule).unwrap())
        })
        .to_vec();
    for tick in 0..700_u16 {
        let turn = f32::from(tick.saturating_sub(200)) / 30.0;
        let velocity = Velocity::linear([1.5 * turn.sin(), (0.6 * turn).sin(), 0.0]);
        for (platform, _) in rides.iter().filter(|_| tick >= 200) {
            world.set_velocity(*platform, velocity).unwrap();
        }
        world.step().unwrap();
    }
    for (platform, rider) in rides {
        let [on, at] = [platform, rider].map(|id| world.pose(id).unwrap().translation);
        let off: [f64; 3] = std::array::from_fn(|i| at[i] - on[i] - [-1.0, 0.92, 0.0][i]);
        assert!(length(off) < 0.1, "{rider} is {off:?} m from its place");
    }
}
