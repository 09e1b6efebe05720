//! Counts the events of a run.

/// Counts of events in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Bodies that changed owner between regions.
    pub transfers: u64,
    /// Nodes that were told to go without having asked.
    pub evictions: u64,
    /// Views with another leader than the view before.
    pub elections: u64,
    /// Views that began.
    pub views: u64,
    /// Ticks that all members of a group have completed.
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
