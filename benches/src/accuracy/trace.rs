//! Holds what was observed in one run of one scene.

use std::time::Duration;

use dcd::protocol::{Velocity, WorldPose};
use dcd::scene::Scene;

/// The observations of a run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Seconds per solver iteration: Rapier moves bodies in steps of this length.
    pub substep_s: f64,
    /// The looks at the bodies, the first from before the first step, the last from after the last step.
    pub looks: Vec<Look>,
    /// The force on the ground over the weight, after each step of the last second, in cases that rest; empty
    /// without gravity.
    pub ground_ratios: Vec<f64>,
    /// Pairs of colliders that touched after the last step.
    pub pairs: usize,
    /// The number of regions after the last step; a bare world counts as one.
    pub regions: usize,
    /// Changes of owner.
    pub transfers: u64,
    /// The most bodies without an owner at any look.
    pub lost: usize,
    /// The most bodies with several owners at any look.
    pub doubled: usize,
    /// Bodies that Rapier set aside because their state was not finite.
    pub quarantined: usize,
    /// The largest |P − P₀| / Σ m|v| at any look, in free cases: the change of momentum over the momentum
    /// that moves.
    pub momentum_error: f64,
    /// Wall time of each step.
    pub steps: Vec<Duration>,
    /// Copies of bodies held by regions that do not own them, mean of all steps.
    pub ghosts_mean: f64,
}

/// All bodies at one moment.
#[derive(Clone, Debug, Default)]
pub(crate) struct Look {
    /// The simulated seconds so far.
    pub t_s: f64,
    /// Poses and velocities by index in the scene; `None` for fixed and for lost bodies.
    pub bodies: Vec<Option<(WorldPose, Velocity)>>,
    /// Kinetic and potential energy, joules.
    pub energy_j: f64,
    /// Deepest penetration, metres.
    pub penetration_m: f64,
    /// The overlap of each pair that touches, metres, from the least to the deepest.
    pub depths_m: Vec<f64>,
    /// The number of bodies that sleep.
    pub asleep: usize,
}

impl Trace {
    /// Returns the look before the first step.
    pub(crate) fn first(&self) -> &Look {
        &self.looks[0]
    }

    /// Returns the look after the last step.
    pub(crate) fn last(&self) -> &Look {
        &self.looks[self.looks.len() - 1]
    }

    /// Returns the looks of the last so many simulated seconds.
    pub(crate) fn tail(&self, seconds: f64) -> impl Iterator<Item = &Look> {
        // dt is a number of 32 bits, so times are off by some ten-millionths.
        let from_s = self.last().t_s - seconds - 1e-5;
        self.looks.iter().filter(move |look| look.t_s >= from_s)
    }
}

impl Look {
    /// Returns a body's place in metres; not a number if the body is lost.
    pub(crate) fn place(&self, body: usize) -> [f64; 3] {
        self.bodies[body].map_or([f64::NAN; 3], |(pose, _)| pose.translation)
    }

    /// Returns a body's velocity in m/s; not a number if the body is lost.
    pub(crate) fn velocity(&self, body: usize) -> [f64; 3] {
        self.bodies[body].map_or([f64::NAN; 3], |(_, velocity)| velocity.linear.map(f64::from))
    }

    /// Returns the indices of the bodies that are there.
    pub(crate) fn moving(&self) -> impl Iterator<Item = usize> {
        self.bodies.iter().enumerate().filter(|(_, body)| body.is_some()).map(|(index, _)| index)
    }
}

/// Returns the mass of every body of a scene, in kilograms; 0 for what does not move.
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

/// Returns the length of a vector.
pub(crate) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns the distance between two points.
pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(std::array::from_fn(|i| a[i] - b[i]))
}
