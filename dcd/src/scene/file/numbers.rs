//! Checks numbers of scene files while they are read, so that an error names the very line.

use rapier3d::prelude::{Rotation, Vector};
use serde::Deserialize;

use crate::protocol::WORLD_REACH_M;

macro_rules! checked {
    ($(#[$doc:meta])* $name:ident, $accepts:expr, $what:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Deserialize)]
        #[serde(try_from = "f64")]
        pub(super) struct $name(pub(super) f32);

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                let accepts: fn(f32) -> bool = $accepts;
                let narrow = value as f32;
                if narrow.is_finite() && accepts(narrow) {
                    Ok(Self(narrow))
                } else {
                    Err(format!(concat!("{} is not ", $what), value))
                }
            }
        }
    };
}

checked!(
    /// Any number but infinity and not-a-number.
    Finite,
    |_| true,
    "a finite number"
);
checked!(
    /// A number of at least zero.
    NonNegative,
    |value| value >= 0.0,
    "a finite number of at least 0"
);
checked!(
    /// Above zero.
    Positive,
    |value| value > 0.0,
    "a finite number above 0"
);
checked!(
    /// A share of a whole.
    Share,
    |value| (0.0..=1.0).contains(&value),
    "a number from 0 to 1"
);

/// A position or a step in world space, metres.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(try_from = "[f64; 3]")]
pub(super) struct Place(pub(super) [f64; 3]);

impl TryFrom<[f64; 3]> for Place {
    type Error = String;

    fn try_from(values: [f64; 3]) -> Result<Self, String> {
        // No message may have a body farther out, so it would be reported at that edge.
        match values.iter().find(|v| !v.is_finite() || v.abs() > WORLD_REACH_M) {
            None => Ok(Self(values)),
            Some(value) => Err(format!("{value} is not a number of metres within 1e9, where a world ends")),
        }
    }
}

/// A coordinate in world space, metres.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "f64")]
pub(super) struct Coordinate(pub(super) f64);

impl TryFrom<f64> for Coordinate {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, String> {
        Place::try_from([value, 0.0, 0.0]).map(|place| Self(place.0[0]))
    }
}

/// A unit quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "[f32; 4]")]
pub(super) struct Quaternion(pub(super) Rotation);

impl TryFrom<[f32; 4]> for Quaternion {
    type Error = String;

    fn try_from(values: [f32; 4]) -> Result<Self, String> {
        let length = values.iter().map(|v| v * v).sum::<f32>().sqrt();
        if (length - 1.0).abs() < 1e-2 {
            Ok(Self(Rotation::from_array(values).normalize()))
        } else {
            Err(format!(
                "{values:?} is not a unit quaternion x, y, z, w (its length is {length}); divide by its length, or write euler_deg"
            ))
        }
    }
}

/// A direction, normalised to a unit vector.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "[f32; 3]")]
pub(super) struct Direction(pub(super) Vector);

impl TryFrom<[f32; 3]> for Direction {
    type Error = String;

    fn try_from(values: [f32; 3]) -> Result<Self, String> {
        Vector::from(values)
            .try_normalize()
            .map(Self)
            .ok_or_else(|| format!("{values:?} is not a direction; write a finite vector that is not zero"))
    }
}

/// Returns the vector of three checked numbers.
pub(super) fn vector(values: [Finite; 3]) -> Vector {
    Vector::from(values.map(|value| value.0))
}

/// Returns the rotation of a quaternion, or of turns about the fixed x, then y, then z axis, degrees; an
/// error if both are given.
pub(super) fn rotation(
    quaternion: Option<Quaternion>,
    euler_deg: Option<[Finite; 3]>,
) -> Result<Rotation, super::Fault> {
    match (quaternion, euler_deg) {
        (None, None) => Ok(Rotation::IDENTITY),
        (Some(quaternion), None) => Ok(quaternion.0),
        (None, Some(degrees)) => {
            let [x, y, z] = degrees.map(|v| v.0.to_radians());
            Ok(Rotation::from_rotation_z(z) * Rotation::from_rotation_y(y) * Rotation::from_rotation_x(x))
        }
        (Some(_), Some(_)) => {
            Err(super::Fault::new("both `rotation` and `euler_deg` are given", "write one of them"))
        }
    }
}

/// Sets a field if the file gives a value for it.
pub(super) fn set<T>(field: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *field = value;
    }
}
