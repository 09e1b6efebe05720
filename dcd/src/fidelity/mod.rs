//! Models no more than a scene needs: where nobody looks, regions are stepped at lower rates, as far as an error allows or a time
//! demands. Audits compute some islands again, finer, and so tell how large the error is.
//!
//! After time-critical collision detection (thesis 4.3.2.3) and perceptually adaptive simulation (O'Sullivan and Dingliana 2001).
//!
//! One [`Governor`] chooses for a whole world: in a local world by what its regions say of themselves after each tick, in a served one at the leader
//! of a group, by what members say of theirs. What it chooses for a tick is a [`Schedule`], by which every host steps its regions.

mod budget;
mod estimate;
mod governor;
mod schedule;
#[cfg(test)]
mod tests;

pub use governor::{Governed, Governor, LookedAt};
pub use schedule::{
    Audited, COARSEST, Pace, Pick, RegionState, Schedule, Signals, iterations, relative_time,
};

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// How much of a world is computed in full.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Fidelity {
    /// All of it, in every tick.
    #[default]
    Off,
    /// What is looked at in full, all else as seldom as keeps the mean error of its bodies below this. The same on every machine, with any
    /// number of threads.
    Tolerance {
        /// By how much the velocity of a body may be off per tick, on average, m/s.
        m_s: f32,
    },
    /// As much as fits into a time, what is looked at before all else. What is chosen depends on the time that steps take.
    Budget {
        /// The time that a tick may take, milliseconds.
        tick_ms: f32,
    },
}

impl Fidelity {
    /// What a world does that is only told to save: an error of what gravity adds to the velocity of a falling body in two ticks of 1/60 s.
    /// Where bodies collide all the time, one world at full rate is as far off.
    pub const AUTO: Self = Self::Tolerance { m_s: 0.33 };

    /// Returns what is wrong with it, if anything: the name of the setting, its value, and what it may be.
    pub(crate) fn fault(&self) -> Option<(&'static str, String, &'static str)> {
        let (what, value) = match *self {
            Self::Off => return None,
            Self::Tolerance { m_s } => ("fidelity.m_s", m_s),
            Self::Budget { tick_ms } => ("fidelity.tick_ms", tick_ms),
        };
        let is_fit = value.is_finite() && value > 0.0;
        (!is_fit).then(|| (what, value.to_string(), "finite and above 0"))
    }
}

impl std::str::FromStr for Fidelity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |value: &str| {
            value
                .parse::<f32>()
                .map_err(|_| format!("`{value}` is no number: try budget=8 or tolerance=0.03"))
        };
        let fidelity = match text.split_once('=') {
            None if text == "off" => Self::Off,
            None if text == "auto" => Self::AUTO,
            Some(("budget", tick_ms)) => Self::Budget { tick_ms: number(tick_ms)? },
            Some(("tolerance", m_s)) => Self::Tolerance { m_s: number(m_s)? },
            _ => return Err(format!("`{text}` is none of off, auto, tolerance=M_S, budget=MS")),
        };
        match fidelity.fault() {
            Some((_, value, range)) => Err(format!("`{value}` must be {range}")),
            None => Ok(fidelity),
        }
    }
}

/// What fidelity saved and what it cost, as far as is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode)]
#[non_exhaustive]
pub struct FidelityReport {
    /// The mean error of a body per tick against a model four times as fine, m/s, by the audits of the last ticks; with its 95 %
    /// confidence interval. Zero before the first audit.
    pub error_m_s: f32,
    /// The lower end of that interval.
    pub low95_m_s: f32,
    /// The upper end of that interval; infinite before there are two audits.
    pub high95_m_s: f32,
    /// The time of regions' steps over what they would have taken had every region been stepped in every tick, as reckoned: half of a step
    /// is solving, which takes as long as it has iterations. What is exchanged and what is measured is left out.
    pub share_of_full_time: f64,
    /// How many audits there have been.
    pub audits: u64,
    /// How many ticks took longer than the budget, since the first second.
    pub overruns: u64,
    /// How many regions are stepped in every tick, in every second one, and in every fourth. Those that share bodies with one that is looked
    /// at are stepped as often as that.
    pub levels: [usize; 3],
}
