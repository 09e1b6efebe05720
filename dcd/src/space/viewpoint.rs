//! Defines points of view: where somebody looks at a world from, and how far.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::Cell;

/// A place that somebody looks at a world from.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Viewpoint {
    /// Where, in world space, metres.
    pub at: [f64; 3],
    /// How far is looked from there, metres.
    pub radius_m: f64,
}

impl Viewpoint {
    /// Returns whether its numbers are finite and it looks no less than nowhere.
    #[doc(hidden)]
    pub fn is_fit(&self) -> bool {
        self.at.iter().all(|v| v.is_finite()) && self.radius_m.is_finite() && self.radius_m >= 0.0
    }

    /// Returns how far a cell is from what is looked at, metres; not above 0 where it is looked into.
    #[doc(hidden)]
    pub fn gap_m(&self, cell: &Cell) -> f64 {
        let off = (0..3).map(|i| (cell.min[i] - self.at[i]).max(self.at[i] - cell.max[i]).max(0.0));
        off.map(|off| off * off).sum::<f64>().sqrt() - self.radius_m
    }
}
