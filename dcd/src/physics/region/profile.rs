//! Counts what the last tick of a region took: time by phase, and what was computed.

use std::time::Duration;

use rapier3d::counters::Counters;

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
        }
    }
}
