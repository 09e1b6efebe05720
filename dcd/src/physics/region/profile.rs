//! Measures the last tick of a region: time by phase, and what was computed.

use std::time::Duration;

use rapier3d::counters::Counters;
use rapier3d::prelude::*;

/// The times of the phases of the last step, and what was computed in it
/// ([`World::profile`](crate::World::profile)). Times are sums over all regions and substeps, numbers over
/// all regions. Regions compute side by side, so that times may add up to more than the time of the step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Profile {
    /// Rapier's steps, with all phases.
    pub rapier: Duration,
    /// The broad phase: finding pairs of colliders whose boxes touch. This and the next four are 0 without
    /// the feature `profiler`.
    pub broad_phase: Duration,
    /// The narrow phase: finding contacts.
    pub narrow_phase: Duration,
    /// Maintaining islands, and putting bodies to sleep.
    pub islands: Duration,
    /// Solving contacts and joints, and moving bodies.
    pub solver: Duration,
    /// Continuous collision detection: sweeping fast bodies.
    pub ccd: Duration,
    /// The exchange of messages between regions, wall time.
    pub border: Duration,
    /// The number of pairs of colliders near enough for contacts, in the last substep. Pairs that regions
    /// share count in each region.
    pub contact_pairs: usize,
    /// The number of contact points that were solved in the last substep.
    pub contacts: usize,
    /// The number of awake bodies in the last substep. Bodies that regions share count in each region.
    pub awake: usize,
    /// The number of impulse joints, awake or not. Joints that regions share count in each region.
    pub joints: usize,
    /// The number of awake islands (groups of bodies that touch or are tied) now. An island that regions
    /// share counts in each region.
    pub islands_awake: usize,
    /// The approximate memory of bodies, colliders, contacts and joints, bytes; without that of shapes, and
    /// of what is kept for the next step.
    pub memory_bytes: usize,
}

impl Profile {
    /// Adds a substep of Rapier: how long it took, its counters, and the numbers of awake bodies and of
    /// joints.
    pub(super) fn note(&mut self, took: Duration, counters: &Counters, awake: usize, joints: usize) {
        self.rapier += took;
        self.broad_phase += counters.cd.broad_phase_time.time() + counters.cd.final_broad_phase_time.time();
        self.narrow_phase += counters.cd.narrow_phase_time.time();
        self.islands += counters.stages.island_construction_time.time();
        self.solver += counters.stages.solver_time.time();
        self.ccd += counters.stages.ccd_time.time();
        self.contact_pairs = counters.cd.ncontact_pairs;
        self.contacts = counters.solver.ncontacts;
        (self.awake, self.joints) = (awake, joints);
    }

    /// Adds what the world has now: awake islands, and memory.
    pub(super) fn with(self, world: &PhysicsWorld) -> Self {
        let island = |handle| world.islands.persistent_island_of(&world.bodies, handle);
        let mut islands: Vec<_> = world.islands.active_bodies().filter_map(island).collect();
        islands.sort_unstable();
        islands.dedup();
        Self { islands_awake: islands.len(), memory_bytes: memory_bytes(world), ..self }
    }

    /// Returns the sum of the profiles of two regions.
    pub(in crate::physics) fn and(self, other: &Self) -> Self {
        Self {
            rapier: self.rapier + other.rapier,
            broad_phase: self.broad_phase + other.broad_phase,
            narrow_phase: self.narrow_phase + other.narrow_phase,
            islands: self.islands + other.islands,
            solver: self.solver + other.solver,
            ccd: self.ccd + other.ccd,
            border: self.border + other.border,
            contact_pairs: self.contact_pairs + other.contact_pairs,
            contacts: self.contacts + other.contacts,
            awake: self.awake + other.awake,
            joints: self.joints + other.joints,
            islands_awake: self.islands_awake + other.islands_awake,
            memory_bytes: self.memory_bytes + other.memory_bytes,
        }
    }
}

/// Estimates the memory of a world, in bytes, from the numbers of its bodies, colliders, pairs and joints.
/// `tests/tests/steady_state.rs` compares it with an allocator that counts.
fn memory_bytes(world: &PhysicsWorld) -> usize {
    // Besides Rapier's own records: places in its broad phase, islands and graphs, and what a region keeps of
    // each; for a pair, the manifolds and what the solver keeps of them. As counted in a world of balls on
    // 2026-11-27: 1,935 bytes per ball, 1,865 per pair.
    const BODY: usize = size_of::<RigidBody>() + 900;
    const COLLIDER: usize = size_of::<Collider>() + 300;
    const PAIR: usize = size_of::<ContactPair>() + 1600;
    const JOINT: usize = size_of::<ImpulseJoint>() + 200;
    BODY * world.bodies.len()
        + COLLIDER * world.colliders.len()
        + PAIR * world.narrow_phase.contact_pairs().count()
        + JOINT * world.impulse_joints.len()
}
