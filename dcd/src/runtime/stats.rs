//! Defines the statistics of a world, in every role.

use std::time::Duration;

/// Statistics of a world so far, as far as its process knows them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stats {
    /// The number of ticks done.
    pub ticks: u64,
    /// The number of movable bodies.
    pub bodies: usize,
    /// The number of ghosts: copies of bodies in regions that do not own them.
    pub ghosts: usize,
    /// The number of changes of owner since the beginning.
    pub transfers: u64,
    /// The wall time of the last step: in a local world that of the tick, in a client of taking in what
    /// arrived, in a node of its last tick; 0 in a server.
    pub last_step: Duration,
    /// The number of copies that Rapier set aside in the last step because their state was not finite.
    pub quarantined: usize,
    /// The number of exchanges of the last tick, of the border that had most; 0 in a world of one region.
    pub exchanges: usize,
    /// The disagreement of the copies of shared bodies at the worst border in the last tick, summed over its
    /// exchanges, m/s: an estimate of the error that borders make. 0 with the couplings `owner` and `proxy`,
    /// which have no consensus.
    pub disagreement_m_s: f32,
}
