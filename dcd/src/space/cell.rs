//! Defines boxes in world space: the closed [`Bounds`] of a world or a body, and the half-open [`Cell`] of a
//! region.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// One of the three axes of world space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Encode, Decode, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// The first coordinate.
    X,
    /// The second coordinate, up by default.
    Y,
    /// The third coordinate.
    Z,
}

impl Axis {
    /// All three, in order.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// Returns the index of the coordinate: 0, 1 or 2.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A closed axis-aligned box in world space, metres. May be infinite, as that of a half-space is.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Bounds {
    /// The lowest corner.
    pub min: [f64; 3],
    /// The highest corner.
    pub max: [f64; 3],
}

impl Bounds {
    /// Makes a box from its corners.
    #[must_use]
    pub const fn new(min: [f64; 3], max: [f64; 3]) -> Self {
        Self { min, max }
    }

    /// Makes a box from its centre and half of its edges.
    #[must_use]
    pub fn around(centre: [f64; 3], half: [f64; 3]) -> Self {
        Self {
            min: std::array::from_fn(|i| centre[i] - half[i]),
            max: std::array::from_fn(|i| centre[i] + half[i]),
        }
    }

    /// Returns the box grown by `margin_m` on every side.
    #[must_use]
    pub fn grown(&self, margin_m: f64) -> Self {
        Self { min: self.min.map(|v| v - margin_m), max: self.max.map(|v| v + margin_m) }
    }

    /// Returns the box that holds this one on its way at `velocity_m_s` for `ahead_s` seconds.
    #[cfg(feature = "physics")]
    #[must_use]
    pub(crate) fn swept(&self, velocity_m_s: [f32; 3], ahead_s: f64) -> Self {
        let way_m = velocity_m_s.map(|v| f64::from(v) * ahead_s);
        Self {
            min: std::array::from_fn(|i| self.min[i] + way_m[i].min(0.0)),
            max: std::array::from_fn(|i| self.max[i] + way_m[i].max(0.0)),
        }
    }

    /// Returns the smallest box that holds both boxes.
    #[must_use]
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].min(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].max(other.max[i])),
        }
    }

    /// Returns the intersection of the boxes, if they touch.
    #[must_use]
    #[doc(hidden)]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].max(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].min(other.max[i])),
        }
    }

    /// Returns whether the boxes touch or overlap.
    #[inline]
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Returns whether the other box lies inside this one.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.min[i] && other.max[i] <= self.max[i])
    }

    /// Returns the lengths of the edges, metres.
    #[inline]
    pub fn size(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.max[i] - self.min[i])
    }

    /// Returns the centre.
    #[inline]
    pub fn centre(&self) -> [f64; 3] {
        std::array::from_fn(|i| 0.5 * (self.min[i] + self.max[i]))
    }

    /// Returns the axis of the longest edge; the first of equal ones.
    pub fn longest_axis(&self) -> Axis {
        let size = self.size();
        Axis::ALL.into_iter().fold(
            Axis::X,
            |best, axis| {
                if size[axis.index()] > size[best.index()] { axis } else { best }
            },
        )
    }

    /// Returns whether the box is finite and no edge is negative.
    pub fn is_finite(&self) -> bool {
        (0..3).all(|i| self.min[i].is_finite() && self.max[i].is_finite() && self.min[i] <= self.max[i])
    }
}

/// The half-open box of a region: `min <= p < max` on every axis. Cells at the edge of the world reach to
/// infinity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The lowest corner, inside the cell.
    pub min: [f64; 3],
    /// The highest corner, outside the cell.
    pub max: [f64; 3],
}

impl Cell {
    /// The whole of space.
    pub const EVERYWHERE: Self = Self { min: [f64::NEG_INFINITY; 3], max: [f64::INFINITY; 3] };

    /// Returns whether the point lies in the cell.
    pub fn contains(&self, point: [f64; 3]) -> bool {
        (0..3).all(|i| self.min[i] <= point[i] && point[i] < self.max[i])
    }

    /// Returns whether any point of the closed box lies in the cell.
    #[inline]
    pub fn touches(&self, bounds: &Bounds) -> bool {
        (0..3).all(|i| bounds.min[i] < self.max[i] && self.min[i] <= bounds.max[i])
    }

    /// Returns whether every point of the closed box lies in the cell.
    #[doc(hidden)]
    pub fn contains_box(&self, bounds: &Bounds) -> bool {
        (0..3).all(|i| self.min[i] <= bounds.min[i] && bounds.max[i] < self.max[i])
    }

    /// Returns the distance of two cells on the axis on which they are farthest apart, metres; 0 or less if
    /// they touch.
    #[doc(hidden)]
    pub fn gap_m(&self, other: &Self) -> f64 {
        (0..3)
            .map(|i| (self.min[i] - other.max[i]).max(other.min[i] - self.max[i]))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns how far the point lies outside the cell on the worst axis, metres; inside, the negative
    /// distance to the nearest face.
    #[doc(hidden)]
    pub fn excess_m(&self, point: [f64; 3]) -> f64 {
        (0..3).map(|i| (self.min[i] - point[i]).max(point[i] - self.max[i])).fold(f64::NEG_INFINITY, f64::max)
    }
}
