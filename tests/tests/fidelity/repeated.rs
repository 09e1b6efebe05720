//! Tests that a world of which less is computed is the same by any number of threads and after a snapshot.

use dcd::Push;

use super::*;

#[test]
fn a_town_loses_nothing_and_is_the_same_by_any_threads_and_after_a_snapshot() {
    let scene = town(4);
    let mut worlds = [1, 2].map(|threads| world(&scene, Fidelity::AUTO, threads));
    let bodies = worlds[0].states().count();
    worlds.iter_mut().for_each(|world| run(world, 150));
    let mut saved = Vec::new();
    worlds[0].save(&mut saved).unwrap();
    let mut restored = LocalWorld::restore(saved.as_slice(), 1).unwrap();
    worlds.iter_mut().for_each(|world| run(world, 150));
    run(&mut restored, 150);
    for world in worlds.iter().chain([&restored]) {
        assert_eq!(world.states().count(), bodies);
        assert_eq!(world.host().validate(), []);
        assert_eq!(world.state_hash(), worlds[0].state_hash());
        assert_eq!(levels(world), levels(&worlds[0]));
    }
    assert!(levels(&worlds[0])[2] >= 10, "{:?}", levels(&worlds[0]));
    assert!(worlds[0].stats().transfers >= 8, "cars pass from region to region: {:?}", worlds[0].stats());
}

#[test]
fn what_a_program_does_where_nobody_looks_is_the_same_by_any_threads_and_after_a_snapshot() {
    let scene = town(4);
    let mut worlds: Vec<_> = [1, 2].map(|threads| world(&scene, Fidelity::AUTO, threads)).into();
    let ids: Vec<_> = worlds[0].states().map(|(id, ..)| id).collect();
    let pushed = |tick: usize| ids[37 * tick % ids.len()];
    let push = |world: &mut LocalWorld, tick| {
        world.push(&Push::impulse(pushed(tick), [0.0, 1.0, 0.0])).unwrap();
    };
    worlds.iter_mut().for_each(|world| run(world, 120));
    worlds.iter_mut().for_each(|world| push(world, 120));
    let mut saved = Vec::new();
    worlds[0].save(&mut saved).unwrap();
    worlds.push(LocalWorld::restore(saved.as_slice(), 1).unwrap());
    worlds.iter_mut().for_each(|world| run(world, 1));
    let mut late = 0;
    for tick in (123..240).step_by(3) {
        late += usize::from(is_late(&worlds[0], pushed(tick)));
        for world in &mut worlds {
            push(world, tick);
            run(world, 3);
        }
    }
    for world in &worlds {
        assert_eq!(world.states().count(), ids.len());
        assert_eq!(world.host().validate(), []);
        assert_eq!(world.state_hash(), worlds[0].state_hash());
        assert_eq!(world.stats().transfers, worlds[0].stats().transfers);
    }
    assert!(late > 5, "{late} were in regions that were behind");
}
