//! Defines and steps the worlds that run a case: one bare Rapier world, one cut into regions, or regions
//! whose exchanges fail.

use dcd::physics::{Measured, View};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{LocalWorld, WorldConfig, WorldError};
use dcd::space::BodyId;

use super::fleet::Fleet;

/// The way in which a scene is computed.
#[derive(Clone, Copy)]
pub(crate) enum Setup<'a> {
    /// One bare Rapier world.
    Bare(Bare),
    /// Regions, as the case cuts them.
    Cut {
        /// The number of regions.
        regions: usize,
        /// A function that changes the configuration that the scene asks for.
        adjust: &'a (dyn Fn(&mut WorldConfig) + Sync),
    },
}

/// The settings of a bare world; those not given are the scene's and Rapier's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Bare {
    /// Seconds per step.
    pub dt_s: Option<f32>,
    /// Solver iterations per step.
    pub iterations: Option<usize>,
    /// The natural frequency of contacts between moving bodies, Hz. Contacts with fixed bodies have twice
    /// that, as in Rapier.
    pub contact_hz: Option<f32>,
    /// Threads of Rapier's own `parallel`; one if not given.
    pub threads: Option<usize>,
}

/// A world that is stepped.
pub(crate) enum World {
    /// One bare Rapier world with none of our code in its step: the reference.
    Bare(Box<PhysicsWorld>),
    /// A world cut into regions.
    Cut(Box<LocalWorld>),
    /// The same, with one host per region and faults between them.
    Apart(Fleet),
}

impl World {
    /// Computes one tick.
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

    /// Returns the number of copies of bodies that are held by regions that do not own them.
    pub(crate) fn ghosts(&self) -> usize {
        match self {
            Self::Bare(_) => 0,
            Self::Cut(world) => world.stats().ghosts,
            Self::Apart(fleet) => fleet.ghosts(),
        }
    }

    /// Returns the number of changes of owner so far.
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
