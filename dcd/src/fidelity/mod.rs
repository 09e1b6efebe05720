//! Computes no more than a scene needs: regions that nobody looks at are stepped at lower rates, as far as an
//! error allows or a time demands. Audits compute some islands again with finer steps, and so tell how large
//! the error is.
//!
//! After time-critical collision detection (thesis 4.3.2.3) and perceptually adaptive simulation (O'Sullivan
//! and Dingliana 2001).
//!
//! One [`Governor`] chooses the rates of a whole world: in a local world by what its regions report of
//! themselves after each tick, in a served one at the leader of a group, by what members report of theirs.
//! Its choice for a tick is a [`Schedule`], by which every host steps its regions.

mod budget;
mod estimate;
mod governor;
mod schedule;
#[cfg(test)]
mod tests;

pub use governor::{Governed, Governor, LookedAt};
pub use schedule::{
    ATTENDED_TICKS, Audited, COARSEST, Pace, Pick, RegionState, Schedule, Signals, iterations, relative_time,
};

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

/// The part of a world that is computed in full.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Fidelity {
    /// All of it, in every tick.
    #[default]
    Off,
    /// What is looked at is computed in full, all else as seldom as keeps the mean error of its bodies below
    /// a tolerance. The result is the same with any number of threads.
    Tolerance {
        /// The tolerated error of a body's velocity after a step, on average, m/s; above 0.
        m_s: f32,
    },
    /// As much is computed in full as fits into a time, what is looked at before all else. The choice depends
    /// on the time that steps take.
    Budget {
        /// The time that a tick may take, milliseconds; above 0.
        tick_ms: f32,
    },
}

impl Fidelity {
    /// The setting of a world that is only told to save. It tolerates an error of what gravity adds to the
    /// velocity of a falling body in two ticks of 1/60 s. One world at full rate is as far off where bodies
    /// collide all the time.
    pub const AUTO: Self = Self::Tolerance { m_s: 0.33 };

    /// Returns what is wrong with the setting, if anything: its name, its value, and the values that are
    /// allowed.
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

impl std::fmt::Display for Fidelity {
    /// Writes it as it is parsed.
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Off => to.write_str("off"),
            Self::Tolerance { m_s } => write!(to, "tolerance={m_s}"),
            Self::Budget { tick_ms } => write!(to, "budget={tick_ms}"),
        }
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

/// What fidelity saved and what it cost, as far as it is known
/// ([`World::fidelity_report`](crate::World::fidelity_report)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode)]
#[non_exhaustive]
pub struct FidelityReport {
    /// The mean error of a body's velocity after a step, m/s, against a model with steps a quarter of a tick
    /// long, by the last audits. Each tick counts with the step that computes it. Zero before the first audit. The next two fields are its 95 % confidence
    /// interval.
    pub error_m_s: f32,
    /// The lower end of that interval, m/s.
    pub low95_m_s: f32,
    /// The upper end of that interval, m/s; infinite before there are two audits.
    pub high95_m_s: f32,
    /// The estimated time of the regions' steps over the time that they would have taken had every region
    /// been stepped in every tick. The estimate assumes that half of a step is solving, whose time grows with
    /// its iterations. Exchanges and measurements are left out.
    pub share_of_full_time: f64,
    /// The number of audits so far.
    pub audits: u64,
    /// The number of ticks that took longer than the budget, since the first second.
    pub overruns: u64,
    /// The numbers of regions that are stepped in every tick, in every second one, and in every fourth.
    /// Regions that share bodies with one that is looked at are stepped as often as that.
    pub levels: [usize; 3],
}
