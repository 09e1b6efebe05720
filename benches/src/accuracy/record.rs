//! Keeps the result of one case by one method at one number of regions, as it stands in the CSV.

use serde::{Deserialize, Serialize};

/// The result of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// The number and the name of the experiment.
    pub(super) scene: u8,
    pub(super) name: String,
    pub(super) case: String,
    /// Name of the coupling, or R1, R2, R3.
    pub(super) method: String,
    /// The number of regions; 0: a bare world.
    pub(super) regions: usize,
    pub(super) error: f64,
    pub(super) r1_error: f64,
    pub(super) unit: String,
    /// The largest error that passes; `None` where nothing is asked of it.
    pub(super) threshold: Option<f64>,
    pub(super) pass: bool,
    pub(super) momentum_error: Option<f64>,
    pub(super) ground_error: Option<f64>,
    pub(super) lost: usize,
    pub(super) doubled: usize,
    pub(super) quarantined: usize,
    pub(super) transfers: u64,
    pub(super) ghosts_mean: f64,
    /// Simulated seconds per second of wall time; below, milliseconds per step.
    pub(super) rtf: f64,
    pub(super) p50_ms: Option<f64>,
    pub(super) p99_ms: Option<f64>,
    pub(super) max_ms: Option<f64>,
}

impl Record {
    /// Returns the error in gates: 1 just passes.
    pub(super) fn of_gate(&self) -> Option<f64> {
        self.threshold.map(|threshold| self.error / threshold)
    }
}
