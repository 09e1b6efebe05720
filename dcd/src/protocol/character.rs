//! Describes characters: bodies that walk by Rapier's character controller where they are computed, at the velocity that their
//! user wants.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// The settings of a character: a body that walks on what it stands on, slides along walls, climbs steps and slopes, falls, rides
/// on what moves, and pushes what is in its way. Its velocity is what its user wants; how it moves follows from what is around.
///
/// The first collider that is no sensor is its shape. Upwards it wants to jump, which it can from the ground; with a gravity scale
/// of 0 it flies as it wants, and collides all the same.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Character {
    /// The highest step that it climbs without a jump, metres; 0 to climb none.
    pub step_height_m: f32,
    /// How much free floor there must be on a step, metres.
    pub step_depth_m: f32,
    /// The steepest slope that it climbs, radians; 0 to π/2.
    pub max_climb_rad: f32,
    /// The least steep slope that it slides down, radians; 0 to π/2.
    pub min_slide_rad: f32,
    /// How far it is drawn down to the ground as it walks downhill, metres; 0 to be in the air instead.
    pub snap_m: f32,
    /// The gap that it keeps from all else, metres; above 0, at most 1.
    pub gap_m: f32,
    /// The mass with which it pushes dynamic bodies and stands on them, kilograms; 0 to push none.
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

/// How a character walks: the part of its state that its velocity does not show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Gait {
    /// The velocity that its user wants, m/s.
    pub wanted: [f32; 3],
    /// How fast it rises (jumps) or, below 0, falls, m/s.
    pub rise_m_s: f32,
    /// Whether it stood on something after the last tick.
    pub grounded: bool,
}
