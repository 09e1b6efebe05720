//! Runs a scene of a case, and records a trace of it.

use std::collections::BTreeSet;
use std::time::Instant;

use dcd::physics::{Measured, View};
use dcd::rapier3d::prelude::RigidBodyType;
use dcd::runtime::measure::Plan;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig, WorldError};
use dcd::scene::Scene;
use dcd::space::BodyId;

use super::fleet::Fleet;
use super::scene::Case;
use super::trace::{Look, Trace, masses_kg, norm};
use super::world::{Setup, World};

/// Runs one scene of a case, from before its first step to after its last.
pub(crate) fn trace(case: &Case, scene: &Scene, setup: &Setup<'_>) -> Result<Trace, WorldError> {
    let (mut world, dt_s, iterations) = world_of(case, scene, setup)?;
    let ticks = Plan::ticks_of(case.seconds, dt_s);
    let dt = f64::from(dt_s);
    let masses = masses_kg(scene);
    let movable: Vec<_> = (0..scene.bodies.len())
        .filter(|&index| scene.bodies[index].body.body_type != RigidBodyType::Fixed)
        .map(|index| BodyId::persistent(index as u32))
        .collect();
    let momentum = world.momentum_kgms();
    let mut run = Trace { substep_s: dt / iterations as f64, ..Trace::default() };
    run.looks.push(look(scene, &world, 0.0));
    let (mut ghosts, mut quarantined, mut looks) = (0, BTreeSet::new(), 0);
    for tick in 1..=ticks {
        if let Some(drive) = &case.drive {
            drive(&mut world, (tick - 1) as f64 * dt);
        }
        let start = Instant::now();
        world.step()?;
        run.steps.push(start.elapsed());
        ghosts += world.ghosts();
        quarantined.extend(world.quarantined());
        let t_s = tick as f64 * dt;
        if case.rests && (ticks - tick) as f64 * dt < 1.0 - 0.5 * dt {
            run.ground_ratios.extend(world.contacts().ground_force_ratio());
        }
        let due = case.look_s <= 0.0 || t_s > (looks + 1) as f64 * case.look_s - 0.5 * dt;
        if due || tick == ticks {
            looks = if case.look_s > 0.0 { ((t_s + 0.5 * dt) / case.look_s) as u64 } else { tick };
            let look = look(scene, &world, t_s);
            if case.free {
                run.momentum_error =
                    run.momentum_error.max(momentum_error(&look, &masses, momentum, world.momentum_kgms()));
            }
            let census = world.census();
            run.lost = run.lost.max(census.lost(&movable));
            run.doubled = run.doubled.max(census.doubled());
            run.looks.push(look);
        }
    }
    run.pairs = world.contacts().pairs;
    run.regions = world.views().len();
    run.quarantined = quarantined.len();
    run.ghosts_mean = ghosts as f64 / ticks as f64;
    run.transfers = world.transfers();
    Ok(run)
}

/// Returns the world of a scene of a case, its dt and its solver iterations per tick.
pub(crate) fn world_of(
    case: &Case,
    scene: &Scene,
    setup: &Setup<'_>,
) -> Result<(World, f32, usize), WorldError> {
    match setup {
        Setup::Bare(bare) => {
            let mut scene = scene.clone();
            scene.dt_s = bare.dt_s.unwrap_or(scene.dt_s);
            scene.solver_iterations = bare.iterations.unwrap_or(scene.solver_iterations);
            let mut world = scene.bare_world();
            if let Some(threads) = bare.threads {
                world.configure_thread_pool(threads).expect("the system has as many more threads");
            }
            if let Some(hz) = bare.contact_hz {
                let parameters = &mut world.integration_parameters;
                parameters.contact_softness.natural_frequency = hz;
                parameters.static_contact_softness.natural_frequency = 2.0 * hz;
            }
            Ok((World::Bare(Box::new(world)), scene.dt_s, scene.solver_iterations))
        }
        Setup::Cut { regions, adjust } => {
            let mut config = WorldConfig::for_scene(scene);
            config.partitioning = match regions {
                1 => Partitioning::Regions(1),
                _ => Partitioning::Cuts((case.cuts)(*regions)),
            };
            adjust(&mut config);
            if case.early {
                config.step.exchanges = 1;
            }
            let step = config.step;
            let world = match case.fault {
                Some(_) if *regions > 1 => World::Apart(Fleet::new(scene, &config, case.fault)?),
                _ => World::Cut(Box::new(LocalWorld::from_scene(scene, config)?)),
            };
            // The iterations of all substeps of a tick together.
            let iterations = step.exchanges * step.solver_iterations.div_ceil(step.exchanges);
            Ok((world, step.dt_s, iterations))
        }
    }
}

fn look(scene: &Scene, world: &World, t_s: f64) -> Look {
    let mut bodies = vec![None; scene.bodies.len()];
    for (id, _, pose, velocity) in world.states() {
        // Body i of a scene is the i-th persistent body.
        bodies[id.bits() as usize] = Some((pose, velocity));
    }
    let mut depths_m = world.penetrations_m();
    depths_m.sort_by(f64::total_cmp);
    let owned = world.views().into_iter().flat_map(View::owned);
    let asleep = owned.filter(|(_, body)| body.is_sleeping()).count();
    let penetration_m = world.contacts().max_penetration_m;
    Look { t_s, bodies, energy_j: world.energy_j(), penetration_m, depths_m, asleep }
}

fn momentum_error(look: &Look, masses_kg: &[f64], start: [f64; 3], now: [f64; 3]) -> f64 {
    let moving: f64 = look.moving().map(|body| masses_kg[body] * norm(look.velocity(body))).sum();
    let off = norm(std::array::from_fn(|i| now[i] - start[i]));
    if off == 0.0 { 0.0 } else { off / moving }
}

#[cfg(test)]
mod tests {
    use dcd::protocol::{Velocity, WorldPose};
    use dcd::runtime::WorldConfig;
    use dcd::scene::Params;

    use super::*;

    fn falling_tower(cut: bool) -> Trace {
        let scene = Scene::named("tower", &Params::new()).unwrap();
        let cuts = |_| vec![(dcd::space::Axis::X, 0.1)];
        let case = Case::new("any", scene, 2.0, cuts, |_, _| 0.0).resting();
        let regions = if cut { 2 } else { 1 };
        let adjust = |config: &mut WorldConfig| {
            (config.step.coupling, config.step.exchanges) = (dcd::physics::Coupling::Owner, 1);
            config.step.solver_iterations = 8;
        };
        let setup = Setup::Cut { regions, adjust: &adjust };
        trace(&case, &case.scenes[0], &setup).unwrap()
    }

    #[test]
    fn a_run_is_looked_at_at_equal_intervals_and_weighed_in_its_last_second() {
        let trace = falling_tower(false);
        let times: Vec<_> = trace.looks.iter().map(|look| (look.t_s * 10.0).round() as u32).collect();
        assert_eq!(times, (0..=20).collect::<Vec<_>>());
        assert_eq!((trace.ground_ratios.len(), trace.steps.len()), (60, 120));
        assert_eq!(trace.tail(1.0).count(), 11);
        assert!((trace.substep_s - 1.0 / 480.0).abs() < 1e-9);
    }

    #[test]
    fn fixed_bodies_are_not_seen_and_movable_ones_always_are() {
        let trace = falling_tower(true);
        assert!(trace.looks.iter().all(|look| look.moving().eq(1..=10)));
        assert_eq!((trace.lost, trace.doubled, trace.quarantined), (0, 0, 0));
        assert!(trace.ghosts_mean > 9.0);
    }

    #[test]
    fn momentum_is_measured_in_parts_of_all_that_moves() {
        let at = |v: f32| Some((WorldPose::default(), Velocity { linear: [v, 0.0, 0.0], angular: [0.0; 3] }));
        let look = Look { bodies: vec![None, at(1.0), at(-3.0)], ..Look::default() };
        let error = momentum_error(&look, &[0.0, 1.0, 3.0], [0.0; 3], [-8.0, 0.0, 0.0]);
        assert!((error - 0.8).abs() < 1e-12);
        assert_eq!(momentum_error(&Look::default(), &[], [0.0; 3], [0.0; 3]), 0.0);
    }
}
