//! Tests that all copies of a body sleep together, and that waking crosses borders.

use dcd::protocol::Velocity;

use super::*;

const FOUR: [(Axis, f64); 3] = [(Axis::X, -2.0), (Axis::X, 0.0), (Axis::X, 2.0)];

fn awake(world: &LocalWorld) -> usize {
    let bodies = world.regions().flat_map(|region| region.bodies());
    bodies.filter(|(.., body)| !body.is_fixed() && !body.is_sleeping()).count()
}

#[test]
fn all_copies_sleep_when_the_bodies_of_one_world_do() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(cut(coupling, &FOUR)).unwrap();
        insert_floor(&mut world);
        for row in 0..4 {
            for i in 0..8 - 2 * row {
                let x = i as f32 - (7 - 2 * row) as f32 / 2.0;
                world.insert(body_at(x * 1.01, 0.5 + row as f32, 0.0), cube()).unwrap();
            }
        }
        steps(&mut world, 600);
        assert_eq!(awake(&world), 0, "{}", coupling.name());
        let hash = world.state_hash();
        steps(&mut world, 60);
        assert_eq!((awake(&world), world.state_hash()), (0, hash), "{}", coupling.name());
    }
}

#[test]
fn dominoes_that_slept_fall_over_four_regions_as_those_that_did_not() {
    let fallen = |coupling, can_sleep: bool| {
        let mut world = LocalWorld::new(cut(coupling, &FOUR)).unwrap();
        insert_floor(&mut world);
        let row: Vec<_> = (0..13)
            .map(|i| {
                let body = body_at(-3.6 + 0.6 * i as f32, 0.5, 0.0).can_sleep(can_sleep);
                world.insert(body, ColliderBuilder::cuboid(0.08, 0.5, 0.25)).unwrap()
            })
            .collect();
        steps(&mut world, 180);
        if can_sleep {
            assert_eq!(awake(&world), 0, "{}", coupling.name());
        }
        let push = Velocity { linear: [0.6, 0.0, 0.0], angular: [0.0, 0.0, -1.5] };
        world.set_velocity(row[0], push).unwrap();
        steps(&mut world, 360);
        row.iter().filter(|&&id| at(&world, id)[1] < 0.4).count()
    };
    for coupling in SHARING {
        assert_eq!((fallen(coupling, true), fallen(coupling, false)), (13, 13), "{}", coupling.name());
    }
}

#[test]
fn a_sleeping_body_that_is_hit_from_another_region_wakes() {
    for coupling in SHARING {
        let off = deviation(halves(coupling), |world| {
            insert_floor(world);
            let target = world.insert(body_at(0.6, 0.5, 0.0), cube().friction(0.3)).unwrap();
            steps(world, 120);
            assert!(world.body(target).unwrap().is_sleeping());
            let body = body_at(-4.0, 0.25, 0.1).linvel(Vector::new(8.0, 0.0, 0.0));
            world.insert(body, ColliderBuilder::ball(0.25).density(20.0)).unwrap();
            steps(world, 60);
            assert!(!world.body(target).unwrap().is_sleeping());
        });
        // Half the way of a substep at 8 m/s: they may meet that much earlier or later.
        assert!(off < 0.1, "{}: {off}", coupling.name());
    }
}
