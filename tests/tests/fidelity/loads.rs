//! Tests that loads out of proportion are computed finer, and that bodies keep the iterations that their user
//! gave them.

use super::*;

/// Returns how far a tower sags under a load of 100:1, and how far a chain with a bob of 1000:1 stretches,
/// metres.
fn strain(fidelity: Fidelity) -> [f64; 2] {
    let tower =
        Scene::open("tower", &Params::default().with("top_mass_ratio", 100).with("sleep", 0)).unwrap();
    let mut standing = world(&tower, fidelity, 1);
    let top = standing.states().map(|(id, ..)| id).last().unwrap();
    let height_m = |world: &LocalWorld| world.pose(top).unwrap().translation[1];
    let begin_m = height_m(&standing);
    run(&mut standing, 300);
    let chain = Scene::open("chain", &Params::default().with("bob_mass_ratio", 1_000)).unwrap();
    let mut hanging = world(&chain, fidelity, 1);
    let bob = hanging.states().map(|(id, ..)| id).last().unwrap();
    let low_m = |world: &LocalWorld| world.pose(bob).unwrap().translation[1];
    let before_m = low_m(&hanging);
    run(&mut hanging, 300);
    [begin_m - height_m(&standing), before_m - low_m(&hanging)]
}

#[test]
fn loads_out_of_proportion_are_computed_finer() {
    let [plain, fine] = [Fidelity::Off, Fidelity::AUTO].map(strain);
    println!("sag and stretch: {plain:?} m in full, {fine:?} m finer");
    for (plain_m, fine_m) in plain.into_iter().zip(fine) {
        assert!(plain_m > 0.05 && fine_m < 0.25 * plain_m, "{plain_m} m, finer {fine_m} m");
    }
}

#[test]
fn a_body_that_is_set_aside_keeps_the_iterations_that_its_user_gave_it() {
    let mut world = row(1, Fidelity::AUTO, [0.0, -9.81, 0.0]);
    let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
    world.insert(ground, ColliderBuilder::cuboid(5.0, 0.5, 5.0)).unwrap();
    let stack = [(0.5, 1.0), (1.5, 100.0)].map(|(y, mass)| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::Y * y).can_sleep(false);
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(mass)).unwrap()
    });
    // Up to before the tick in which loads are searched for.
    run(&mut world, 48);
    let iterations = |world: &LocalWorld, id| world.body(id).unwrap().additional_solver_iterations();
    assert!(stack.iter().all(|&id| iterations(&world, id) > 0), "the load is computed finer");
    world.update(stack[1], |body| body.add_force(Vector::X * f32::INFINITY, true)).unwrap();
    run(&mut world, 1);
    let region = world.regions().next().unwrap();
    assert!(region.quarantined().contains(&stack[1]), "{:?}", region.quarantined());
    for id in stack {
        assert_eq!(world.host().record(id).unwrap().traits.extra_solver_iterations, 0);
    }
    assert_eq!(iterations(&world, stack[1]), 0);
}
