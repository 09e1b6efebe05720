//! Tests violent scenes: nothing is lost or doubled, and bits do not depend on threads.

use std::collections::BTreeSet;

use dcd::space::Bounds;

use super::*;

fn heap(coupling: Coupling, threads: usize, island_limit: usize) -> LocalWorld {
    let mut config = WorldConfig {
        partitioning: Partitioning::Regions(8),
        bounds: Bounds::around([0.0, 3.0, 0.0], [4.0, 3.0, 4.0]),
        threads,
        ..WorldConfig::default()
    };
    config.step = config.step.with_coupling(coupling);
    config.step.island_limit = island_limit;
    let mut world = LocalWorld::new(config).unwrap();
    insert_floor(&mut world);
    for i in 0..150 {
        let (x, y, z) =
            ((i * 7 % 11) as f32 * 0.6 - 3.3, 1.0 + (i / 15) as f32 * 0.9, (i * 5 % 13) as f32 * 0.5 - 3.1);
        // Damped, since balls would otherwise roll off the floor.
        let body = body_at(x, y, z).angular_damping(1.0).linvel(Vector::new(-x * 1.5, -4.0, -z * 1.5));
        let collider = match i % 3 {
            0 => ColliderBuilder::ball(0.3).restitution(0.6),
            1 => ColliderBuilder::cuboid(0.35, 0.25, 0.3),
            _ => ColliderBuilder::capsule_y(0.2, 0.2).density(5.0),
        };
        world.insert(body, collider).unwrap();
    }
    world
}

#[test]
fn no_body_of_a_heap_over_eight_regions_is_lost_or_doubled() {
    for coupling in SHARING {
        let mut world = heap(coupling, 2, 32);
        let all: BTreeSet<_> = world.states().map(|(id, ..)| id).collect();
        for _ in 0..600 {
            world.step().unwrap();
            let ids: Vec<_> = world.states().map(|(id, ..)| id).collect();
            assert_eq!(ids.len(), all.len(), "{} at {}", coupling.name(), world.tick());
            for &id in &ids {
                assert_eq!(world.owners_of(id), 1, "{}: {id} at {}", coupling.name(), world.tick());
            }
            // All regions that hold a body divide its mass by the same number.
            for region in world.regions() {
                for (id, _, handle, body) in region.bodies().filter(|(.., body)| !body.is_fixed()) {
                    let whole = body.mass() * region.share_of(handle) as f32;
                    assert!(
                        (whole / world.mass_kg(id).unwrap() - 1.0).abs() < 1e-4,
                        "{id} at {}",
                        world.tick()
                    );
                    let holders = world.regions().filter(|region| region.handle_of(id).is_some()).count();
                    assert!(region.share_of(handle) <= holders, "{id} at {}", world.tick());
                }
            }
        }
        for (id, _, pose, velocity) in world.states() {
            let [x, y, z] = pose.translation;
            assert!(
                y > 0.1 && y < 6.0 && x.abs() < 60.0 && z.abs() < 60.0,
                "{}: {id} at {pose:?}",
                coupling.name()
            );
            assert!(velocity.is_finite());
        }
    }
}

#[test]
fn bits_do_not_depend_on_threads_under_any_sharing_coupling() {
    for coupling in SHARING {
        let run = |threads| {
            let mut world = heap(coupling, threads, 16);
            for _ in 0..150 {
                world.step().unwrap();
            }
            (world.state_hash(), world.stats().transfers)
        };
        let one = run(1);
        assert!(one.1 > 0);
        assert_eq!((one, one), (run(2), run(4)), "{}", coupling.name());
    }
}
