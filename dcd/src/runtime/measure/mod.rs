//! Measures a run of a scene (times, energy, penetration, owners), for `dcd run`, the benchmarks and the
//! accuracy suite.

mod report;
mod run;

pub use report::{Chosen, FidelityShare, MeanMax, Report, StartEnd, Stated, StepTimes};
pub use run::{Cast, Plan, Subject, run};

use super::LocalWorld;
use crate::physics::{Measured, View};

impl Measured for LocalWorld {
    fn views(&self) -> Vec<View<'_>> {
        self.host().views()
    }
}
