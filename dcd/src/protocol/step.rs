//! Carries the settings by which a world is stepped, which every process that computes a part of it must
//! share, and the range of each.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{BIG_ISLAND, MAX_DEPTH, MAX_ROUNDS};

/// A method by which regions agree on the bodies that several of them hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Encode, Decode)]
#[serde(rename_all = "lowercase")]
pub enum Coupling {
    /// Ghosts are kinematic: they push and are not pushed. Most projects do so. It gains energy and drops
    /// stacks. The baseline with which the other methods are compared.
    Proxy,
    /// Ghosts are dynamic copies, which their owner overwrites after each step. Cheap and tolerant of delay;
    /// it does not conserve momentum across a border.
    Owner,
    /// Bodies within some contact hops of a border live in both regions, each copy with a part of the mass
    /// (mass splitting). The copies follow their consensus, the mean, and regions even out the forces at the
    /// edges of the overlap.
    Overlap,
    /// Both regions solve bodies that meet across a border with whole copies, and the region that sees most
    /// of the island is authoritative. An island that stays in touch moves whole to one region, where it is
    /// computed exactly. Islands above the limit are treated as by `overlap`.
    Island,
    /// The same as `island`, but the number of exchanges at each border that splits an island follows from
    /// how far its copies disagree.
    #[default]
    Auto,
}

impl Coupling {
    /// All methods.
    pub const ALL: [Self; 5] = [Self::Proxy, Self::Owner, Self::Overlap, Self::Island, Self::Auto];

    /// Returns the name of the method on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Proxy => "proxy",
            Self::Owner => "owner",
            Self::Overlap => "overlap",
            Self::Island => "island",
            Self::Auto => "auto",
        }
    }

    /// Returns the number of exchanges per tick that suits the method; for `auto`, the most it may take.
    pub const fn usual_exchanges(self) -> usize {
        match self {
            Self::Proxy | Self::Owner => 1,
            Self::Overlap | Self::Island => 2,
            Self::Auto => 4,
        }
    }
}

/// The settings of how a world is stepped, as they are sent: those of [`StepSettings`](crate::StepSettings)
/// that nodes share.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct StepRecord {
    /// The gravity, m/s².
    pub gravity: [f32; 3],
    /// The length of a tick, seconds.
    pub dt_s: f32,
    /// Solver iterations per tick.
    pub solver_iterations: u32,
    /// The method by which regions agree.
    pub coupling: Coupling,
    /// The exchanges per tick, or the most that a border may take.
    pub exchanges: u32,
    /// The depth of an overlap, in contact hops.
    pub depth: u32,
    /// The most bodies of an island that moves whole.
    pub island_limit: u32,
    /// The tolerated disagreement of copies, m/s.
    pub tolerance_m_s: f32,
    /// The highest speed of a dynamic body, m/s.
    pub speed_limit_m_s: f32,
}

/// A setting that is out of range: its name, its value, and the values that are allowed.
pub type SettingFault = (&'static str, String, &'static str);

/// The shortest tick, seconds. Ticks in real time that last less than a nanosecond would always be due; a
/// microsecond is less than any world needs.
const SHORTEST_TICK_S: f32 = 1e-6;

impl StepRecord {
    /// Returns the first setting that is out of range. Programs, scene files, the C API and peers all keep to
    /// these ranges.
    pub fn fault(&self) -> Option<SettingFault> {
        let Self {
            gravity,
            dt_s,
            solver_iterations,
            coupling: _,
            exchanges,
            depth,
            island_limit,
            tolerance_m_s,
            speed_limit_m_s,
        } = *self;
        let (finite, positive) = (gravity.iter().all(|v| v.is_finite()), tolerance_m_s > 0.0);
        let rules = [
            ("gravity", finite, format!("{gravity:?}"), "three finite numbers, m/s²"),
            (
                "dt_s",
                (SHORTEST_TICK_S..=1.0).contains(&dt_s),
                dt_s.to_string(),
                "from 0.000001 to 1 second per tick, as 1/60",
            ),
            (
                "solver_iterations",
                (1..=1_000).contains(&solver_iterations),
                solver_iterations.to_string(),
                "a whole number from 1 to 1000",
            ),
            (
                "exchanges",
                (1..=MAX_ROUNDS).contains(&exchanges),
                exchanges.to_string(),
                "a whole number from 1 to 64",
            ),
            ("depth", (1..=MAX_DEPTH).contains(&depth), depth.to_string(), "a whole number from 1 to 16"),
            (
                "island_limit",
                island_limit < u32::from(BIG_ISLAND),
                island_limit.to_string(),
                "a whole number from 0 to 65534",
            ),
            (
                "tolerance_m_s",
                tolerance_m_s.is_finite() && positive,
                tolerance_m_s.to_string(),
                "a number of m/s above 0",
            ),
            (
                "speed_limit_m_s",
                speed_limit_m_s > 0.0,
                speed_limit_m_s.to_string(),
                "a number of m/s above 0, as 400",
            ),
        ];
        let (what, _, value, range) = rules.into_iter().find(|(_, holds, ..)| !holds)?;
        Some((what, value, range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: StepRecord = StepRecord {
        gravity: [0.0, -9.81, 0.0],
        dt_s: 1.0 / 60.0,
        solver_iterations: 4,
        coupling: Coupling::Auto,
        exchanges: 4,
        depth: 2,
        island_limit: 256,
        tolerance_m_s: 0.03,
        speed_limit_m_s: 400.0,
    };

    #[test]
    fn a_setting_out_of_range_is_named_with_its_value_and_range() {
        assert_eq!(GOOD.fault(), None);
        let wrong = [
            ("gravity", StepRecord { gravity: [0.0, f32::NAN, 0.0], ..GOOD }),
            ("dt_s", StepRecord { dt_s: 0.0, ..GOOD }),
            ("dt_s", StepRecord { dt_s: 9e-7, ..GOOD }),
            ("dt_s", StepRecord { dt_s: f32::INFINITY, ..GOOD }),
            ("solver_iterations", StepRecord { solver_iterations: 0, ..GOOD }),
            ("exchanges", StepRecord { exchanges: 65, ..GOOD }),
            ("depth", StepRecord { depth: 17, ..GOOD }),
            ("island_limit", StepRecord { island_limit: 65_535, ..GOOD }),
            ("tolerance_m_s", StepRecord { tolerance_m_s: f32::NAN, ..GOOD }),
            ("speed_limit_m_s", StepRecord { speed_limit_m_s: f32::NAN, ..GOOD }),
            ("speed_limit_m_s", StepRecord { speed_limit_m_s: 0.0, ..GOOD }),
        ];
        for (name, record) in wrong {
            let (what, ..) = record.fault().unwrap_or_else(|| panic!("{record:?} passes"));
            assert_eq!(what, name);
        }
        assert_eq!(StepRecord { depth: 17, ..GOOD }.fault().unwrap().1, "17");
    }
}
