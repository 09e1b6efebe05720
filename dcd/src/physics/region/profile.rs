//! Counts what the last tick of a region took: time by phase, and what was computed.

use std::time::Duration;

use rapier3d::counters::Counters;
use rapier3d::prelude::*;

/// What the last step took, as [`World::profile`](crate::World::profile) tells: times and numbers are sums over all regions and substeps; regions
/// compute side by side, so that times may be more than those of the step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Profile {
    /// Rapier's steps, all phases.
    pub rapier: Duration,
    /// Finding pairs whose boxes touch; as the next four, 0 without the feature `profiler`.
    pub broad_phase: Duration,
    /// Finding contacts.
    pub narrow_phase: Duration,
    /// Keeping islands, and putting bodies to sleep.
    pub islands: Duration,
    /// Solving contacts and joints, and moving bodies.
    pub solver: Duration,
    /// Sweeping fast bodies.
    pub ccd: Duration,
    /// Exchange of messages between regions: wall time.
    pub border: Duration,
    /// Pairs of colliders that are near enough for contacts, in the last substep; those that regions share count in each.
    pub contact_pairs: usize,
    /// Points of contact that were solved, in the last substep.
    pub contacts: usize,
    /// Bodies that were awake, in the last substep; those that regions share count in each.
    pub awake: usize,
    /// Joints that are solved by impulses, awake or not; those that regions share count in each.
    pub joints: usize,
    /// Islands that are awake now: groups of bodies that touch or are tied; one that regions share counts in each.
    pub islands_awake: usize,
    /// Memory that bodies, colliders, contacts and joints take, roughly, bytes: not that of shapes, nor what is kept for the next step.
    pub memory_bytes: usize,
}

impl Profile {
    /// Adds a substep of Rapier that took so long.
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

    /// Adds what a world has now.
    pub(super) fn with(self, world: &PhysicsWorld) -> Self {
        let island = |handle| world.islands.persistent_island_of(&world.bodies, handle);
        let mut islands: Vec<_> = world.islands.active_bodies().filter_map(island).collect();
        islands.sort_unstable();
        islands.dedup();
        Self { islands_awake: islands.len(), memory_bytes: memory_bytes(world), ..self }
    }

    /// Adds up two regions.
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

/// Estimates what a world takes by what it has, which `tests/tests/steady_state.rs` holds against an allocator that counts.
fn memory_bytes(world: &PhysicsWorld) -> usize {
    // Beside Rapier's own records: places in its broad phase, islands and graphs, what a region keeps of each, and of a pair the manifolds and
    // what the solver keeps of them. As counted in a world of balls on 2026-11-27: 1,935 bytes per ball, 1,865 per pair.
    const BODY: usize = size_of::<RigidBody>() + 900;
    const COLLIDER: usize = size_of::<Collider>() + 300;
    const PAIR: usize = size_of::<ContactPair>() + 1600;
    const JOINT: usize = size_of::<ImpulseJoint>() + 200;
    BODY * world.bodies.len()
        + COLLIDER * world.colliders.len()
        + PAIR * world.narrow_phase.contact_pairs().count()
        + JOINT * world.impulse_joints.len()
}
