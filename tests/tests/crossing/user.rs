//! Tests that a user's changes to a body that several regions hold reach all its copies.

use dcd::protocol::{Velocity, WorldPose};

use super::*;

/// Inserts this body beside another at the border, with no pressure between them. Returns this body, the left
/// one.
fn beside_another(world: &mut LocalWorld, body: RigidBodyBuilder, colliders: Vec<ColliderBuilder>) -> BodyId {
    let pose = WorldPose::at([-0.501, 0.0, 0.0]);
    let left = world.insert_at(pose, body.can_sleep(false), colliders).unwrap();
    world.insert(body_at(0.501, 0.0, 0.0).can_sleep(false), cube().friction(0.0)).unwrap();
    steps(world, 3);
    left
}

/// Returns a body for each way to set a mass, with the way's name and the mass, kilograms.
fn masses() -> Vec<(&'static str, RigidBodyBuilder, Vec<ColliderBuilder>, f32)> {
    let smooth = || cube().friction(0.0);
    let body = RigidBodyBuilder::dynamic;
    let given = MassProperties::new(Vector::new(0.1, 0.0, 0.0), 5.0, Vector::new(1.0, 2.0, 3.0));
    let child = ColliderBuilder::ball(0.25).translation(Vector::new(0.0, 1.0, 0.0)).friction(0.0);
    vec![
        ("density", body(), vec![smooth().density(3.0)], 3.0),
        ("mass of a collider", body(), vec![smooth().mass(7.0)], 7.0),
        ("properties of a collider", body(), vec![smooth().mass_properties(given)], 5.0),
        ("additional mass", body().additional_mass(2.5), vec![smooth()], 3.5),
        ("properties alone", body().additional_mass_properties(given), vec![smooth().density(0.0)], 5.0),
        ("additional mass alone", body().additional_mass(4.0), vec![smooth().density(0.0)], 4.0),
        (
            "several colliders",
            body().additional_mass(1.0),
            vec![smooth(), child.mass(2.0), smooth().sensor(true)],
            5.0,
        ),
    ]
}

#[test]
fn impulses_forces_and_torques_act_on_the_whole_mass_wherever_it_comes_from() {
    for coupling in SHARING {
        for (name, body, colliders, mass_kg) in masses() {
            let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
            let id = beside_another(&mut world, body, colliders);
            let what = format!("{name}, {}", coupling.name());
            assert_eq!(parts(&world, id), 2, "{what}");
            assert!((world.mass_kg(id).unwrap() - mass_kg).abs() < 1e-4, "{what}: {:?}", world.mass_kg(id));
            assert!((world.update(id, |body| body.mass()).unwrap() - mass_kg).abs() < 1e-4, "{what}");

            world.update(id, |body| body.apply_impulse(Vector::new(0.0, 0.0, mass_kg), true)).unwrap();
            assert!((speed(&world, id)[2] - 1.0).abs() < 1e-5, "{what}: {:?}", speed(&world, id));
            steps(&mut world, 3);
            assert_eq!(parts(&world, id), 2, "{what}");
            assert!((speed(&world, id)[2] - 1.0).abs() < 1e-4, "{what}: {:?}", speed(&world, id));

            // A force persists: while the body is shared, and afterwards.
            let force = Vector::new(-mass_kg, 0.0, -2.0 * mass_kg);
            world.update(id, |body| body.add_force(force, true)).unwrap();
            steps(&mut world, 60);
            assert_eq!(parts(&world, id), 1, "{what}");
            let expected = [-1.0, 0.0, -1.0];
            for (v, expected) in speed(&world, id).into_iter().zip(expected) {
                assert!((v - expected).abs() < 1e-3, "{what}: {:?}", speed(&world, id));
            }
            assert_eq!(world.update(id, |body| body.user_force()).unwrap(), force, "{what}");
            assert_eq!(world.host().record(id).unwrap().state.force, force.to_array(), "{what}");
        }
    }
}

#[test]
fn a_persistent_force_is_told_whole_while_its_body_is_shared_and_after_it_has_changed_owner() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
        let id = beside_another(&mut world, RigidBodyBuilder::dynamic(), vec![cube().friction(0.0)]);
        let (force, torque) = (Vector::new(1.0, 0.0, 0.0), Vector::new(0.0, 0.0, 0.25));
        world.update(id, |body| body.add_force(force, true)).unwrap();
        steps(&mut world, 2);
        world.update(id, |body| body.add_torque(torque, true)).unwrap();
        for _ in 0..240 {
            steps(&mut world, 1);
            let read = world.update(id, |body| (body.user_force(), body.user_torque())).unwrap();
            assert_eq!(read, (force, torque), "{} at {}", coupling.name(), world.tick());
        }
        assert!(at(&world, id)[0] > 1.0, "it pushes the other along: {:?}", at(&world, id));
        let home = world.owner_of(id).unwrap();
        assert_eq!(world.regions().nth(1).unwrap().id(), home);
    }
}

#[test]
fn torques_turn_a_shared_body_as_in_one_world() {
    for coupling in SHARING {
        let apart = |world: &mut LocalWorld| {
            let body = RigidBodyBuilder::dynamic().additional_mass(3.0);
            let id = beside_another(world, body, vec![ColliderBuilder::ball(0.5).friction(0.0)]);
            world.update(id, |body| body.apply_torque_impulse(Vector::new(0.3, -0.2, 0.5), true)).unwrap();
            world.update(id, |body| body.add_torque(Vector::new(0.1, 0.0, -0.2), true)).unwrap();
            world
                .update(id, |body| body.apply_impulse_at_point(Vector::Y, Vector::new(-0.5, 0.0, 0.2), true))
                .unwrap();
            steps(world, 60);
            world.velocity(id).unwrap().angular
        };
        let mut one = LocalWorld::new(weightless(one_world())).unwrap();
        let mut many = LocalWorld::new(weightless(halves(coupling))).unwrap();
        let (one, many) = (apart(&mut one), apart(&mut many));
        for axis in 0..3 {
            assert!((one[axis] - many[axis]).abs() < 5e-3, "{}: {one:?} {many:?}", coupling.name());
        }
    }
}

#[test]
fn a_mass_that_changes_while_shared_changes_whole() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
        let id = beside_another(&mut world, RigidBodyBuilder::dynamic(), vec![cube().friction(0.0)]);
        let kick = |world: &mut LocalWorld, mass_kg: f32| {
            assert_eq!(parts(world, id), 2);
            let still = Velocity::default();
            world.set_velocity(id, still).unwrap();
            world.update(id, |body| body.apply_impulse(Vector::new(0.0, 0.0, 1.0), true)).unwrap();
            steps(world, 2);
            assert!((world.mass_kg(id).unwrap() - mass_kg).abs() < 1e-4, "{:?} {mass_kg}", world.mass_kg(id));
            assert!((speed(world, id)[2] - 1.0 / mass_kg).abs() < 1e-4, "{:?} {mass_kg}", speed(world, id));
        };
        world.update(id, |body| body.set_additional_mass(3.0, true)).unwrap();
        steps(&mut world, 1);
        kick(&mut world, 4.0);
        world.update_collider(id, 0, |collider| collider.set_density(5.0)).unwrap();
        kick(&mut world, 8.0);
        world.update_collider(id, 0, |collider| collider.set_mass(2.0)).unwrap();
        kick(&mut world, 5.0);
        world.update_collider(id, 0, |collider| collider.set_friction(0.25)).unwrap();
        kick(&mut world, 5.0);
        world.set_velocity(id, Velocity { linear: [-5.0, 0.0, 0.0], angular: [0.0; 3] }).unwrap();
        steps(&mut world, 60);
        assert_eq!(parts(&world, id), 1);
        assert!((world.body(id).unwrap().mass() - 5.0).abs() < 1e-4, "{}", world.body(id).unwrap().mass());
    }
}

#[test]
fn gravity_scale_damping_velocity_and_teleports_reach_every_copy() {
    for coupling in SHARING {
        let off = deviation(halves(coupling), |world| {
            insert_floor(world);
            let left = world.insert(body_at(-0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
            let right = world.insert(body_at(0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
            steps(world, 5);
            world.update(left, |body| body.set_gravity_scale(-0.5, true)).unwrap();
            world.update(right, |body| body.set_linear_damping(2.0)).unwrap();
            steps(world, 10);
            world.set_velocity(right, Velocity { linear: [0.0, 2.0, 0.5], angular: [0.0; 3] }).unwrap();
            steps(world, 10);
            world.set_pose(right, WorldPose::at([0.6, 3.0, 0.0])).unwrap();
            world.set_pose(left, WorldPose::at([-0.6, 5.0, 0.0])).unwrap();
            steps(world, 20);
        });
        assert!(off < 2e-2, "{}: {off}", coupling.name());
    }
}

#[test]
fn to_look_at_a_sleeping_body_does_not_wake_it() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        insert_floor(&mut world);
        let pair: Vec<_> = [-0.5, 0.5].map(|x| world.insert(body_at(x, 0.5, 0.0), cube()).unwrap()).into();
        steps(&mut world, 300);
        let asleep = |world: &LocalWorld| pair.iter().all(|&id| world.body(id).unwrap().is_sleeping());
        assert!(asleep(&world), "{}", coupling.name());
        assert_eq!(parts(&world, pair[0]), 2);
        let mass_kg = world.update(pair[0], |body| body.mass()).unwrap();
        assert!((mass_kg - 1.0).abs() < 1e-5);
        steps(&mut world, 5);
        assert!(asleep(&world), "{}", coupling.name());
    }
}

#[test]
fn a_user_puts_a_shared_body_to_sleep_and_wakes_it() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        insert_floor(&mut world);
        let pair: Vec<_> = [-0.5, 0.5].map(|x| world.insert(body_at(x, 0.5, 0.0), cube()).unwrap()).into();
        steps(&mut world, 5);
        for &id in &pair {
            world.update(id, |body| body.sleep()).unwrap();
        }
        steps(&mut world, 5);
        assert!(pair.iter().all(|&id| world.body(id).unwrap().is_sleeping()), "{}", coupling.name());
        world.update(pair[1], |body| body.wake_up(true)).unwrap();
        steps(&mut world, 2);
        assert!(pair.iter().all(|&id| !world.body(id).unwrap().is_sleeping()), "{}", coupling.name());
    }
}

#[test]
fn bodies_come_and_go_while_they_are_shared() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(cut(coupling, &[(Axis::Y, 2.0)])).unwrap();
        insert_floor(&mut world);
        let mut tower: Vec<_> =
            (0..4).map(|i| world.insert(body_at(0.0, 0.5 + i as f32, 0.0), cube()).unwrap()).collect();
        steps(&mut world, 30);
        for place in [2, 3, 1, 0] {
            assert!(parts(&world, tower[1]) == 2, "{}", coupling.name());
            world.remove(tower.remove(place)).unwrap();
            steps(&mut world, 60);
            tower.push(world.insert(body_at(0.0, 3.5, 0.0), cube()).unwrap());
            steps(&mut world, 60);
            for (i, &id) in tower.iter().enumerate() {
                let height = at(&world, id)[1];
                assert!((height - 0.5 - i as f64).abs() < 1e-2, "{}: {i} at {height}", coupling.name());
            }
        }
    }
}

#[test]
fn a_number_that_is_not_finite_sets_a_body_aside_and_no_other() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        insert_floor(&mut world);
        let row: Vec<_> = [-1.0, 0.0, 1.0]
            .map(|x| world.insert(body_at(x, 0.5, 0.0).can_sleep(false), cube()).unwrap())
            .into();
        steps(&mut world, 20);
        assert!(parts(&world, row[1]) == 2, "{}", coupling.name());
        world.update(row[1], |body| body.set_linvel(Vector::splat(f32::NAN), true)).unwrap();
        steps(&mut world, 1);
        assert_eq!(world.stats().quarantined, 2, "both copies");
        steps(&mut world, 60);
        assert!(!world.host().record(row[1]).unwrap().traits.enabled, "as one world has it");
        for (id, x) in [(row[0], -1.0), (row[2], 1.0)] {
            assert!(distance(at(&world, id), [x, 0.5, 0.0]) < 1e-2, "{:?}", at(&world, id));
        }
        assert!(at(&world, row[1]).iter().all(|v| v.is_finite()));
    }
}

#[test]
fn an_impulse_on_a_shared_body_is_not_lost_when_another_body_is_inserted_before_the_step() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
        let pair = [-0.5, 0.5].map(|x| world.insert(body_at(x, 0.0, 0.0), cube()).unwrap());
        steps(&mut world, 5);
        assert_eq!(pair.map(|id| parts(&world, id)), [2, 2], "{coupling:?}: the test needs shared bodies");
        for id in pair {
            world.update(id, |body| body.apply_impulse(Vector::new(0.0, 2.0, 0.0), true)).unwrap();
        }
        world.insert(body_at(0.0, 0.0, 5.0), cube()).unwrap();
        steps(&mut world, 5);
        for id in pair {
            assert!((speed(&world, id)[1] - 2.0).abs() < 1e-4, "{coupling:?}: {:?}", speed(&world, id));
        }
    }
}

#[test]
fn a_force_goes_on_behind_a_border() {
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
        let id = world.insert(body_at(-1.0, 0.0, 0.0), cube()).unwrap();
        world.update(id, |body| body.add_force(Vector::new(2.0, 0.0, 0.0), true)).unwrap();
        let first = world.owner_of(id);
        steps(&mut world, 120);
        assert_ne!(world.owner_of(id), first, "{coupling:?}");
        assert!((speed(&world, id)[0] - 4.0).abs() < 0.01, "{coupling:?}: {:?}", speed(&world, id));
    }
}

/// One region computes both boxes, since they touch.
#[test]
fn what_is_moved_by_a_little_stays_where_its_island_is_computed() {
    let mut config = halves(Coupling::Auto);
    config.step.island_limit = dcd::physics::StepSettings::default().island_limit;
    let mut world = LocalWorld::new(config).unwrap();
    insert_floor(&mut world);
    let pair = [-0.49, 0.49].map(|x| world.insert(body_at(x, 0.5, 0.0).can_sleep(false), cube()).unwrap());
    steps(&mut world, 30);
    assert_eq!(world.owner_of(pair[0]), world.owner_of(pair[1]));
    let epochs = |world: &LocalWorld| {
        pair.map(|id| {
            let (region, handle) = world.host().owned(id).unwrap();
            (region.id(), handle, region.epoch_of(handle))
        })
    };
    let before = epochs(&world);
    for id in pair {
        let pose = world.pose(id).unwrap();
        let [x, y, z] = pose.translation;
        world.set_pose(id, WorldPose { translation: [x, y, z + 1e-4], ..pose }).unwrap();
    }
    assert_eq!(epochs(&world), before);
    steps(&mut world, 20);
    assert_eq!(epochs(&world), before);
}

/// As above, but one box is put far into the region in which it lies, where only that region knows what the
/// box meets.
#[test]
fn what_is_put_far_off_in_its_own_region_meets_what_lies_there_at_once() {
    for by_update in [false, true] {
        let mut config = halves(Coupling::Auto);
        config.step.island_limit = dcd::physics::StepSettings::default().island_limit;
        let mut world = LocalWorld::new(config).unwrap();
        insert_floor(&mut world);
        for x in [-40.0, 40.0] {
            let slab = RigidBodyBuilder::fixed().translation(Vector::new(x, 4.5, 0.0));
            world.insert(slab, ColliderBuilder::cuboid(2.0, 0.5, 2.0)).unwrap();
        }
        let pair =
            [-0.49, 0.49].map(|x| world.insert(body_at(x, 0.5, 0.0).can_sleep(false), cube()).unwrap());
        steps(&mut world, 30);
        let owner = world.host().owned(pair[0]).unwrap().0.rank();
        let (guest, x) = [(pair[1], 40.0), (pair[0], -40.0)][owner];
        assert_eq!(world.host().owned(guest).unwrap().0.rank(), owner, "it lies in the other region");
        let place = Vector::new(x, 5.5, 0.0);
        match by_update {
            true => world.update(guest, |body| body.set_translation(place, true)).unwrap(),
            false => world.set_pose(guest, WorldPose::at(place.to_array().map(f64::from))).unwrap(),
        }
        steps(&mut world, 1);
        assert_ne!(world.host().owned(guest).unwrap().0.rank(), owner);
        assert!(speed(&world, guest)[1].abs() < 0.05, "it falls at {:?}", speed(&world, guest));
    }
}
