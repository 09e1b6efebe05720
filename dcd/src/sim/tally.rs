//! Counts the events of a run.

/// Counts of the events of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// The number of transfers of bodies between regions of different nodes.
    pub transfers: u64,
    /// The number of nodes that were expelled.
    pub evictions: u64,
    /// The number of views with another leader than the view before.
    pub elections: u64,
    /// The number of views that began.
    pub views: u64,
    /// The number of ticks that all members of a group have completed.
    pub ticks: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.transfers += other.transfers;
        self.evictions += other.evictions;
        self.elections += other.elections;
        self.views += other.views;
        self.ticks += other.ticks;
    }
}
