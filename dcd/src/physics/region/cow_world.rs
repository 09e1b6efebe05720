//! Holds the Rapier world of a region by copy on write: checkpoints share the world until the region changes
//! it.
//!
//! Making a checkpoint and going back to one cost nothing then. A shared world is copied before it is first
//! changed, by the step that changes it and so on that region's thread. A region at rest is never copied.

use std::mem;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use rapier3d::prelude::*;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A Rapier world that may be shared. Reading it costs a branch. The first change copies it if others share
/// it.
pub(super) enum CowWorld {
    Own(Box<PhysicsWorld>),
    /// A shared world, and this region's own workspace. A region that has gone back to a checkpoint begins
    /// with a new workspace, because Rapier's workspace remembers by counters that go back too.
    Shared(Arc<PhysicsWorld>, Option<Box<Workspace>>),
}

/// The pipelines that Rapier keeps from step to step only for their memory. Snapshots leave them out too.
pub(super) struct Workspace(PhysicsPipeline, CollisionPipeline, CCDSolver);

impl CowWorld {
    pub(super) fn new(world: PhysicsWorld) -> Self {
        Self::Own(Box::new(world))
    }

    /// Makes the next [`Clone::clone`] share the world instead of copying it.
    pub(super) fn share(&mut self) {
        if let Self::Own(world) = self {
            let workspace = Workspace(
                mem::take(&mut world.physics_pipeline),
                mem::take(&mut world.collision_pipeline),
                mem::take(&mut world.ccd_solver),
            );
            let world = mem::take(&mut **world);
            *self = Self::Shared(Arc::new(world), Some(Box::new(workspace)));
        }
    }

    /// Makes the world this region's own, by a copy if others share it.
    #[cold]
    fn own(&mut self) {
        if let Self::Shared(shared, workspace) = self {
            let shared = mem::take(shared);
            let mut world = Arc::try_unwrap(shared).unwrap_or_else(|shared| copy(&shared));
            if let Some(workspace) = workspace.take() {
                (world.physics_pipeline, world.collision_pipeline, world.ccd_solver) =
                    (workspace.0, workspace.1, workspace.2);
            }
            *self = Self::new(world);
        }
    }
}

impl Clone for CowWorld {
    fn clone(&self) -> Self {
        match self {
            Self::Own(world) => Self::new(copy(world)),
            Self::Shared(world, _) => Self::Shared(Arc::clone(world), None),
        }
    }
}

impl Deref for CowWorld {
    type Target = PhysicsWorld;

    #[inline]
    fn deref(&self) -> &PhysicsWorld {
        match self {
            Self::Own(world) => world,
            Self::Shared(world, _) => world,
        }
    }
}

impl DerefMut for CowWorld {
    #[inline]
    fn deref_mut(&mut self) -> &mut PhysicsWorld {
        if matches!(self, Self::Shared(..)) {
            self.own();
        }
        match self {
            Self::Own(world) => world,
            Self::Shared(..) => unreachable!("it has just become its own"),
        }
    }
}

impl Serialize for CowWorld {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for CowWorld {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        PhysicsWorld::deserialize(deserializer).map(Self::new)
    }
}

/// Copies all that a snapshot includes, and what Rapier has noted for its next step. The large parts are copied
/// beside each other by the threads of the pool in which this is called, if it is called in one.
fn copy(world: &PhysicsWorld) -> PhysicsWorld {
    let (narrow_phase, (bodies, (colliders, broad_phase))) = beside(
        || world.narrow_phase.clone(),
        || beside(|| world.bodies.clone(), || (world.colliders.clone(), world.broad_phase.clone())),
    );
    PhysicsWorld {
        gravity: world.gravity,
        integration_parameters: world.integration_parameters,
        physics_pipeline: PhysicsPipeline::new(),
        collision_pipeline: CollisionPipeline::new(),
        islands: world.islands.clone(),
        broad_phase,
        narrow_phase,
        bodies,
        colliders,
        impulse_joints: world.impulse_joints.clone(),
        multibody_joints: world.multibody_joints.clone(),
        soft_bodies: world.soft_bodies.clone(),
        ccd_solver: CCDSolver::new(),
    }
}

/// Does two things beside each other in the pool of this thread. Without one, it does both itself: rayon would take
/// them to its global pool.
fn beside<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    match rayon::current_thread_index() {
        Some(_) => rayon::join(a, b),
        None => (a(), b()),
    }
}
