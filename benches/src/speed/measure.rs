//! Makes one measurement: steps a fresh world of a scene, and counts its ghosts and exchanges.

use std::error::Error;

use dcd::runtime::measure::{Plan, Subject};
use dcd::runtime::{Partitioning, WorldConfig};
use dcd::scene::Scene;

use super::case::Variant;
use crate::timing::StepMs;

/// What a run gave.
#[derive(Clone, Debug)]
pub(super) struct Measurement {
    pub(super) step: StepMs,
    pub(super) replicas: usize,
    pub(super) coupling: String,
    pub(super) exchanges: usize,
}

/// Steps a fresh world of the scene.
pub(super) fn measure(scene: &Scene, variant: &Variant, ticks: usize) -> Result<Measurement, Box<dyn Error>> {
    let config = (variant.regions > 0).then(|| WorldConfig {
        partitioning: Partitioning::Regions(variant.regions),
        threads: variant.threads,
        ..WorldConfig::for_scene(scene)
    });
    let settings = config.as_ref().map(|config| config.step);
    let plan = Plan { config, ticks: ticks as u64 };
    let mut subject = plan.subject(scene)?;
    if let Subject::Bare(world) = &mut subject {
        world.configure_thread_pool(variant.threads)?;
    }
    let step = StepMs::of(&mut subject, ticks)?;
    let replicas = match &subject {
        Subject::Bare(_) => 0,
        Subject::Regions(world) => world.stats().replicas,
    };
    Ok(Measurement {
        step,
        replicas,
        coupling: settings.map_or("none", |step| step.coupling.name()).to_owned(),
        exchanges: settings.map_or(0, |step| step.exchanges),
    })
}
