//! The worlds that a case is run by: one bare Rapier world, one cut into regions, or regions whose exchanges fail.

use dcd::physics::{Measured, View};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{DcdWorld, Partitioning, WorldConfig, WorldError};
use dcd::scene::Scene;
use dcd::space::BodyId;

use super::fleet::Fleet;
use super::scene::Case;

/// What a scene is computed by.
#[derive(Clone, Copy)]
pub(crate) enum Setup<'a> {
    /// One bare Rapier world.
    Bare(Bare),
    /// Regions, as the case cuts them.
    Cut {
        /// How many.
        regions: usize,
        /// Changes the configuration that the scene asks for.
        adjust: &'a (dyn Fn(&mut WorldConfig) + Sync),
    },
}

/// Settings of a bare world; those not given are the scene's and Rapier's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Bare {
    /// Seconds a step.
    pub dt_s: Option<f32>,
    /// Solver iterations a step.
    pub iterations: Option<usize>,
    /// Natural frequency of contacts between moving bodies; twice that for contacts with fixed ones, as Rapier has it.
    pub contact_hz: Option<f32>,
}

/// What is stepped.
pub(crate) enum World {
    /// One bare Rapier world, none of our code in its step: the reference.
    Bare(Box<PhysicsWorld>),
    /// A world cut into regions.
    Cut(Box<DcdWorld>),
    /// The same, each region by itself, with faults between them.
    Apart(Fleet),
}

impl World {
    /// The world of a scene of a case, its dt and its solver iterations a tick.
    pub(crate) fn new(
        case: &Case,
        scene: &Scene,
        setup: &Setup<'_>,
    ) -> Result<(Self, f32, usize), WorldError> {
        match setup {
            Setup::Bare(bare) => {
                let mut scene = scene.clone();
                scene.dt_s = bare.dt_s.unwrap_or(scene.dt_s);
                scene.solver_iterations = bare.iterations.unwrap_or(scene.solver_iterations);
                let mut world = scene.bare_world();
                if let Some(hz) = bare.contact_hz {
                    let parameters = &mut world.integration_parameters;
                    parameters.contact_softness.natural_frequency = hz;
                    parameters.static_contact_softness.natural_frequency = 2.0 * hz;
                }
                Ok((Self::Bare(Box::new(world)), scene.dt_s, scene.solver_iterations))
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
                    Some(_) if *regions > 1 => Self::Apart(Fleet::new(scene, &config, case.fault)?),
                    _ => Self::Cut(Box::new(DcdWorld::from_scene(scene, config)?)),
                };
                // As many as all micro-steps of a tick have together.
                let iterations = step.exchanges * step.solver_iterations.div_ceil(step.exchanges);
                Ok((world, step.dt_s, iterations))
            }
        }
    }

    /// One tick.
    pub(crate) fn step(&mut self) -> Result<(), WorldError> {
        match self {
            Self::Bare(world) => world.step(),
            Self::Cut(world) => world.step()?,
            Self::Apart(fleet) => fleet.step()?,
        }
        Ok(())
    }

    /// Changes a body of the scene in place, by Rapier's own setters, wherever it is held.
    pub(crate) fn change(&mut self, body: usize, change: impl Fn(&mut RigidBody)) {
        let id = BodyId::persistent(body as u32);
        match self {
            // Rapier numbers bodies in order of insertion.
            Self::Bare(world) => change(&mut world.bodies[RigidBodyHandle::from_raw_parts(body as u32, 0)]),
            Self::Cut(world) => world.update(id, change).expect("a scene's body stays"),
            Self::Apart(fleet) => fleet.update(id, change),
        }
    }

    /// Copies of bodies held by regions that do not own them.
    pub(crate) fn replicas(&self) -> usize {
        match self {
            Self::Bare(_) => 0,
            Self::Cut(world) => world.stats().replicas,
            Self::Apart(fleet) => fleet.replicas(),
        }
    }

    /// Changes of owner so far.
    pub(crate) fn transfers(&self) -> u64 {
        match self {
            Self::Bare(_) => 0,
            Self::Cut(world) => world.stats().transfers,
            Self::Apart(fleet) => fleet.transfers(),
        }
    }
}

impl Measured for World {
    fn views(&self) -> Vec<View<'_>> {
        match self {
            Self::Bare(world) => world.views(),
            Self::Cut(world) => world.views(),
            Self::Apart(fleet) => fleet.views(),
        }
    }
}
