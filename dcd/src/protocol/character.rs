//! Describes characters: bodies that Rapier's character controller moves where they are computed, at the
//! velocity that their user wants.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// The settings of a character: a body that walks on what it stands on, slides along walls, climbs steps and
/// slopes, falls, rides on what moves, and pushes what is in its way. The program sets the velocity that the
/// character wants ([`Gait::wanted`]); how it moves follows from its surroundings.
///
/// The first collider that is no sensor is its shape. A wish upwards is a jump, which needs ground to start
/// from. With a gravity scale of 0 a character flies as it wants, and still collides.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Character {
    /// The highest step that the character climbs without a jump, metres, 0 to 100; 0 to climb none.
    pub step_height_m: f32,
    /// The free floor that a step must have, metres, 0 to 100.
    pub step_depth_m: f32,
    /// The steepest slope that the character climbs, radians, 0 to π/2.
    pub max_climb_rad: f32,
    /// The least steep slope that the character slides down, radians, 0 to π/2.
    pub min_slide_rad: f32,
    /// The distance by which the character is drawn down to the ground as it walks downhill, metres, 0 to
    /// 100; 0 to be in the air instead.
    pub snap_m: f32,
    /// The gap that the character keeps from all else, metres; above 0, at most 1.
    pub gap_m: f32,
    /// The mass with which the character pushes dynamic bodies and stands on them, kilograms, 0 to 1e9; 0 to
    /// push none.
    pub mass_kg: f32,
}

impl Default for Character {
    fn default() -> Self {
        Self {
            step_height_m: 0.3,
            step_depth_m: 0.1,
            max_climb_rad: FRAC_PI_4,
            min_slide_rad: FRAC_PI_4,
            snap_m: 0.2,
            gap_m: 0.02,
            mass_kg: 80.0,
        }
    }
}

impl Character {
    /// Returns the first setting out of range, and its range.
    pub(crate) fn fault(&self) -> Option<(&'static str, &'static str)> {
        let length = |value: f32| (0.0..=100.0).contains(&value);
        let angle = |value: f32| (0.0..=FRAC_PI_2).contains(&value);
        [
            (length(self.step_height_m), "character.step_height_m", "0 to 100"),
            (length(self.step_depth_m), "character.step_depth_m", "0 to 100"),
            (angle(self.max_climb_rad), "character.max_climb_rad", "0 to π/2"),
            (angle(self.min_slide_rad), "character.min_slide_rad", "0 to π/2"),
            (length(self.snap_m), "character.snap_m", "0 to 100"),
            (self.gap_m > 0.0 && self.gap_m <= 1.0, "character.gap_m", "above 0, at most 1"),
            ((0.0..=1e9).contains(&self.mass_kg), "character.mass_kg", "0 to 1e9"),
        ]
        .into_iter()
        .find_map(|(holds, field, rule)| (!holds).then_some((field, rule)))
    }
}

/// The part of a character's state that its velocity does not show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Gait {
    /// The velocity that the program asked for, m/s.
    pub wanted: [f32; 3],
    /// The speed at which the character rises (jumps) or, below 0, falls, m/s.
    pub rise_m_s: f32,
    /// Says whether the character stood on something after the last tick.
    pub grounded: bool,
}
