//! Tests that the errors which audits find are those of the whole world computed again by finer steps, with
//! all that it knows of its contacts, and that longer steps have larger ones.

use bincode::config::standard;
use dcd::physics::Region;
use rapier3d::prelude::PhysicsWorld;

use super::*;

/// The number of substeps per tick of the finer model, as in an audit.
const FINESSE: usize = 4;

/// Returns the Rapier world of a region as it is.
fn copy(region: &Region) -> PhysicsWorld {
    let bytes = bincode::serde::encode_to_vec(region.physics(), standard()).unwrap();
    bincode::serde::decode_from_slice(&bytes, standard()).unwrap().0
}

/// Returns the mean error of a world's bodies over some ticks, as all audits find it and as a copy of every
/// region's whole world has it.
fn errors(mut world: LocalWorld, ticks: usize) -> [f64; 2] {
    world.audit_all();
    let mut before: Vec<_> = world.regions().map(copy).collect();
    let mut owed = vec![0; before.len()];
    let (mut sum, mut count) = (0.0, 0.0);
    for _ in 0..ticks {
        world.step().unwrap();
        for ((region, before), owed) in world.regions().zip(&mut before).zip(&mut owed) {
            *owed += 1;
            if world.host().behind(region.id()) > 0 {
                continue;
            }
            let span = std::mem::take(owed);
            let awake: Vec<_> = before.islands.active_bodies().collect();
            before.integration_parameters = region.physics().integration_parameters;
            before.integration_parameters.num_solver_iterations = 4;
            before.integration_parameters.dt = 1.0 / 60.0 / FINESSE as f32;
            (0..FINESSE * span).for_each(|_| before.step());
            for body in awake {
                let off = region.physics().bodies[body].linvel() - before.bodies[body].linvel();
                sum += f64::from(off.length()) * span as f64;
                count += span as f64;
            }
            *before = copy(region);
        }
    }
    [world.host().true_error_m_s().unwrap(), sum / count]
}

#[test]
fn audits_find_the_error_of_the_whole_world_and_more_of_it_in_longer_steps() {
    for (name, key, n) in [("heap", "n", 60), ("ragdolls", "count", 8), ("gas", "n", 150)] {
        let mut scene = Scene::open(name, &Params::default().with(key, n)).unwrap();
        // Seen from an empty region beside it, or from everywhere.
        let [min, max] = [scene.bounds.min, scene.bounds.max];
        scene.bounds = Bounds::new([min[0] - 200.0, min[1], min[2]], max);
        scene.cuts = vec![(Axis::X, min[0] - 100.0)];
        let of = |viewpoints: &[Viewpoint]| {
            let mut world = world(&scene, ALL_COARSE, 1);
            world.set_viewpoints(viewpoints).unwrap();
            let [audits, whole] = errors(world, 150);
            println!("{name}: {audits} by audits, {whole} by the whole world");
            assert!((audits / whole - 1.0).abs() < 0.3, "{name}: {audits} by audits, {whole} by the world");
            audits
        };
        let (full, coarse) = (of(&[]), of(&[Viewpoint { at: [min[0] - 150.0, 0.0, 0.0], radius_m: 1.0 }]));
        assert!(coarse > 1.3 * full, "{name}: {coarse} in long steps, {full} in full");
    }
}
