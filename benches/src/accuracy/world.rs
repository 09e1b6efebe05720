//! Builds and steps the worlds that a case is run by: one bare Rapier world, one cut into regions, or regions whose exchanges fail.

use dcd::physics::{Measured, View};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{LocalWorld, WorldConfig, WorldError};
use dcd::space::BodyId;

use super::fleet::Fleet;

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
    /// Threads of Rapier's own `parallel`; one if not given.
    pub threads: Option<usize>,
}

/// What is stepped.
pub(crate) enum World {
    /// One bare Rapier world, none of our code in its step: the reference.
    Bare(Box<PhysicsWorld>),
    /// A world cut into regions.
    Cut(Box<LocalWorld>),
    /// The same, each region by itself, with faults between them.
    Apart(Fleet),
}

impl World {
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
