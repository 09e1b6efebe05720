//! Tests bodies at borders that differ from their neighbours: fast, heavy, large, locked, bouncy, disabled.

use dcd::space::Bounds;

use super::*;

/// Returns how far behind the middle of a wall a bullet ends that flies at it, metres.
fn beyond_wall(coupling: Coupling, wall_x: f32, movable: bool, start_x: f32, speed: f32) -> f64 {
    let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
    let wall =
        if movable { RigidBodyBuilder::dynamic().additional_mass(1e4) } else { RigidBodyBuilder::fixed() };
    let wall = wall.translation(Vector::new(wall_x, 0.0, 0.0));
    let wall = world.insert(wall, ColliderBuilder::cuboid(0.02, 8.0, 8.0)).unwrap();
    steps(&mut world, 2);
    let bullet = body_at(start_x, 1.5, 0.0).ccd_enabled(true).linvel(Vector::new(speed, 0.0, 0.0));
    let bullet = world.insert(bullet, ColliderBuilder::ball(0.1)).unwrap();
    steps(&mut world, (70.0 / speed * 60.0) as usize);
    at(&world, bullet)[0] - at(&world, wall)[0]
}

#[test]
fn bullets_stop_at_walls_at_and_beyond_borders() {
    for coupling in SHARING {
        for start_x in [-30.0, -58.0] {
            for wall_x in [-0.3, 0.0, 0.3, 3.0] {
                for movable in [false, true] {
                    for speed in [20.0, 50.0, 100.0, 200.0, 400.0] {
                        let beyond = beyond_wall(coupling, wall_x, movable, start_x, speed);
                        let what = format!("{} {movable}: {speed} m/s at x = {wall_x}", coupling.name());
                        assert!(beyond < 0.0, "{what}: {beyond} m");
                    }
                }
            }
        }
    }
}

#[test]
fn balls_of_every_restitution_and_mass_meet_at_a_border_as_in_one_world() {
    for coupling in SHARING {
        for restitution in [0.0, 0.5, 1.0] {
            for ratio in [1.0, 10.0, 1000.0] {
                let off = deviation(weightless(halves(coupling)), |world| {
                    let ball =
                        |mass| ColliderBuilder::ball(0.5).mass(mass).restitution(restitution).friction(0.0);
                    world
                        .insert(body_at(-2.0, 0.0, 0.0).linvel(Vector::new(3.0, 0.0, 0.0)), ball(1.0))
                        .unwrap();
                    world.insert(body_at(1.1, 0.0, 0.0), ball(ratio)).unwrap();
                    steps(world, 90);
                });
                assert!(off < 0.03, "{} e {restitution} 1:{ratio}: {off}", coupling.name());
            }
        }
    }
}

#[test]
fn friction_locked_axes_and_dominance_hold_for_shared_bodies() {
    type Setting = (&'static str, fn(RigidBodyBuilder) -> RigidBodyBuilder, f32);
    let settings: [Setting; 5] = [
        ("friction 0", |body| body, 0.0),
        ("friction 1", |body| body, 1.0),
        ("rotations locked", |body| body.lock_rotations(), 0.5),
        (
            "planar",
            |body| body.enabled_translations(true, true, false).enabled_rotations(false, false, true),
            0.5,
        ),
        // With friction, Rapier itself leaves the other body sunk in this one.
        ("dominant", |body| body.dominance_group(2), 0.0),
    ];
    for coupling in SHARING {
        for (name, with, friction) in settings {
            let off = deviation(halves(coupling), |world| {
                insert_floor(world);
                let body = with(body_at(-1.2, 0.5, 0.0)).linvel(Vector::new(3.0, 0.0, 0.3));
                world.insert(body, cube().friction(friction)).unwrap();
                world.insert(body_at(0.3, 0.5, 0.2), cube().friction(friction)).unwrap();
                steps(world, 60);
            });
            // An impact is over before `auto` would ask for a second exchange.
            let gate_m = if (coupling, name) == (Coupling::Auto, "dominant") { 0.08 } else { 0.05 };
            assert!(off < gate_m, "{} {name}: {off}", coupling.name());
        }
    }
}

#[test]
fn a_heavy_body_rests_on_a_light_one_at_a_border_as_long_as_in_one_world() {
    for coupling in SHARING {
        let off = deviation(cut(coupling, &[(Axis::Y, 1.0)]), |world| {
            insert_floor(world);
            world.insert(body_at(0.0, 0.5, 0.0), cube().density(1000.0)).unwrap();
            world.insert(body_at(0.0, 1.5, 0.0), cube()).unwrap();
            steps(world, 120);
        });
        assert!(off < 5e-3, "{}: {off}", coupling.name());
    }
}

#[test]
fn a_slab_over_eight_regions_holds_a_pebble_at_its_far_corner() {
    for coupling in SHARING {
        let mut config = cut(coupling, &[(Axis::X, -5.0), (Axis::X, 0.0), (Axis::X, 5.0), (Axis::Z, 0.0)]);
        config.bounds = Bounds::around([0.0; 3], [12.0; 3]);
        let mut world = LocalWorld::new(config).unwrap();
        assert_eq!(world.regions().len(), 8);
        for (x, z) in [(-9.0, -9.0), (9.0, -9.0), (-9.0, 9.0), (9.0, 9.0)] {
            let post = RigidBodyBuilder::fixed().translation(Vector::new(x, -1.0, z));
            world.insert(post, ColliderBuilder::cuboid(0.5, 1.0, 0.5)).unwrap();
        }
        let slab = ColliderBuilder::cuboid(10.0, 0.25, 10.0);
        let slab = world.insert(body_at(0.2, 0.26, 0.2), slab).unwrap();
        let pebble = world.insert(body_at(9.5, 0.8, 9.5), ColliderBuilder::ball(0.2)).unwrap();
        steps(&mut world, 240);
        let (slab, pebble) = (at(&world, slab)[1], at(&world, pebble)[1]);
        assert!(
            (slab - 0.25).abs() < 0.02 && (pebble - 0.7).abs() < 0.02,
            "{}: {slab} {pebble}",
            coupling.name()
        );
    }
}

#[test]
fn a_disabled_body_is_not_there_until_it_is_enabled() {
    for coupling in SHARING {
        let off = deviation(halves(coupling), |world| {
            insert_floor(world);
            let left = world.insert(body_at(-0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
            world.insert(body_at(0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
            steps(world, 10);
            world.update(left, |body| body.set_enabled(false)).unwrap();
            steps(world, 10);
            let body = body_at(-3.0, 0.3, 0.0).linvel(Vector::new(6.0, 0.0, 0.0));
            world.insert(body, ColliderBuilder::ball(0.3).friction(0.0)).unwrap();
            steps(world, 20);
            world.update(left, |body| body.set_linvel(Vector::ZERO, true)).unwrap();
            steps(world, 25);
            assert!(at(world, left)[0] < -0.49);
            world.update(left, |body| body.set_enabled(true)).unwrap();
            steps(world, 10);
        });
        assert!(off < 0.03, "{}: {off}", coupling.name());
    }
}
