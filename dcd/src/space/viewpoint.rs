//! Defines viewpoints: the place from which somebody looks at a world, and how far.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::Cell;

/// A place from which somebody looks at a world, and how far.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Viewpoint {
    /// The place in world space, metres; finite.
    pub at: [f64; 3],
    /// The distance up to which is looked from there, metres; finite, 0 or more.
    pub radius_m: f64,
}

impl Viewpoint {
    /// Returns whether all numbers are finite and the radius is not negative.
    #[doc(hidden)]
    pub fn is_fit(&self) -> bool {
        self.at.iter().all(|v| v.is_finite()) && self.radius_m.is_finite() && self.radius_m >= 0.0
    }

    /// Returns the distance of a cell from what is looked at, metres; 0 or less if the viewpoint sees into
    /// the cell.
    #[doc(hidden)]
    pub fn gap_m(&self, cell: &Cell) -> f64 {
        let off = (0..3).map(|i| (cell.min[i] - self.at[i]).max(self.at[i] - cell.max[i]).max(0.0));
        off.map(|off| off * off).sum::<f64>().sqrt() - self.radius_m
    }
}
