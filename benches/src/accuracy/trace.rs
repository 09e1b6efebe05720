//! One run of one scene, and what was seen of it.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use dcd::physics::{Measured, View};
use dcd::protocol::{Velocity, WorldPose};
use dcd::rapier3d::prelude::*;
use dcd::runtime::WorldError;
use dcd::runtime::measure::Plan;
use dcd::scene::Scene;
use dcd::space::BodyId;

use super::scene::Case;
use super::world::{Setup, World};

/// What was seen of a run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Seconds a solver iteration: Rapier moves bodies in steps of this.
    pub substep_s: f64,
    /// The first is from before the first step, the last from after the last.
    pub looks: Vec<Look>,
    /// Force on the ground over the weight, after each step of the last second; none without gravity.
    pub ground_ratios: Vec<f64>,
    /// Pairs of colliders that touched after the last step.
    pub pairs: usize,
    /// Changes of owner.
    pub transfers: u64,
    /// Bodies without an owner, at any look.
    pub lost: usize,
    /// Bodies with several owners, at any look.
    pub doubled: usize,
    /// Bodies that Rapier set aside because their state was not finite.
    pub quarantined: usize,
    /// Largest |P − P₀| / Σ m|v| at any look: momentum against its start, in parts of the momentum that moves.
    pub momentum_error: f64,
    /// Wall time of each step.
    pub steps: Vec<Duration>,
    /// Copies of bodies held by regions that do not own them, mean of all steps.
    pub replicas_mean: f64,
}

/// All bodies at one moment.
#[derive(Clone, Debug, Default)]
pub(crate) struct Look {
    /// Simulated seconds.
    pub t_s: f64,
    /// By their index in the scene; none for fixed and for lost bodies.
    pub bodies: Vec<Option<(WorldPose, Velocity)>>,
    /// Kinetic and potential energy, joules.
    pub energy_j: f64,
    /// Deepest penetration, metres.
    pub penetration_m: f64,
    /// Lists how deep each pair that touches overlaps, metres, from the least to the deepest.
    pub depths_m: Vec<f64>,
    /// Counts the bodies that sleep.
    pub asleep: usize,
}

impl Trace {
    /// Before the first step.
    pub(crate) fn first(&self) -> &Look {
        &self.looks[0]
    }

    /// After the last step.
    pub(crate) fn last(&self) -> &Look {
        &self.looks[self.looks.len() - 1]
    }

    /// The looks of the last so many simulated seconds.
    pub(crate) fn tail(&self, seconds: f64) -> impl Iterator<Item = &Look> {
        // A tick is a number of 32 bits, so times are off by some ten-millionths.
        let from_s = self.last().t_s - seconds - 1e-5;
        self.looks.iter().filter(move |look| look.t_s >= from_s)
    }
}

impl Look {
    /// A body's place in metres; not a number if the body is lost.
    pub(crate) fn place(&self, body: usize) -> [f64; 3] {
        self.bodies[body].map_or([f64::NAN; 3], |(pose, _)| pose.translation)
    }

    /// A body's velocity in m/s; not a number if the body is lost.
    pub(crate) fn velocity(&self, body: usize) -> [f64; 3] {
        self.bodies[body].map_or([f64::NAN; 3], |(_, velocity)| velocity.linear.map(f64::from))
    }

    /// Indices of the bodies that are there.
    pub(crate) fn moving(&self) -> impl Iterator<Item = usize> {
        self.bodies.iter().enumerate().filter(|(_, body)| body.is_some()).map(|(index, _)| index)
    }
}

/// Runs one scene of a case, from before its first step to after its last.
pub(crate) fn trace(case: &Case, scene: &Scene, setup: &Setup<'_>) -> Result<Trace, WorldError> {
    let (mut world, dt_s, iterations) = World::new(case, scene, setup)?;
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
    let (mut replicas, mut quarantined, mut looks) = (0, BTreeSet::new(), 0);
    for tick in 1..=ticks {
        if let Some(drive) = &case.drive {
            drive(&mut world, (tick - 1) as f64 * dt);
        }
        let start = Instant::now();
        world.step()?;
        run.steps.push(start.elapsed());
        replicas += world.replicas();
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
    run.quarantined = quarantined.len();
    run.replicas_mean = replicas as f64 / ticks as f64;
    run.transfers = world.transfers();
    Ok(run)
}

fn look(scene: &Scene, world: &World, t_s: f64) -> Look {
    let mut bodies = vec![None; scene.bodies.len()];
    for (id, _, pose, velocity) in world.states() {
        // Body i of a scene is the i-th persistent one.
        bodies[id.bits() as usize] = Some((pose, velocity));
    }
    let mut depths_m = world.penetrations_m();
    depths_m.sort_by(f64::total_cmp);
    let owned = world.views().into_iter().flat_map(View::owned);
    let asleep = owned.filter(|(_, body)| body.is_sleeping()).count();
    let penetration_m = world.contacts().max_penetration_m;
    Look { t_s, bodies, energy_j: world.energy_j(), penetration_m, depths_m, asleep }
}

/// Of every body of a scene, in kilograms; 0 for what does not move.
pub(crate) fn masses_kg(scene: &Scene) -> Vec<f64> {
    let world = scene.bare_world();
    world
        .rigid_bodies()
        .map(|(_, body)| {
            let mut body = body.clone();
            body.recompute_mass_properties_from_colliders(&world.colliders);
            if body.is_dynamic() { f64::from(body.mass()) } else { 0.0 }
        })
        .collect()
}

fn momentum_error(look: &Look, masses_kg: &[f64], start: [f64; 3], now: [f64; 3]) -> f64 {
    let moving: f64 = look.moving().map(|body| masses_kg[body] * norm(look.velocity(body))).sum();
    let off = norm(std::array::from_fn(|i| now[i] - start[i]));
    if off == 0.0 { 0.0 } else { off / moving }
}

/// The length of a vector.
pub(crate) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// How far apart two points are.
pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(std::array::from_fn(|i| a[i] - b[i]))
}

#[cfg(test)]
mod tests {
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
        assert!(trace.replicas_mean > 9.0);
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
