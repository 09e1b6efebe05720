//! Defines the settings of a step and of the coupling of regions, with their presets and defaults.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use crate::protocol::{BIG_ISLAND, SettingFault, StepRecord};

pub use crate::protocol::Coupling;

impl Coupling {
    /// Returns whether regions use mass splitting, with consensus on the mean of a body's copies.
    pub(crate) const fn shares_mass(self) -> bool {
        matches!(self, Self::Overlap | Self::Island | Self::Auto)
    }

    /// Returns whether small islands move whole to one region.
    pub(super) const fn moves_islands(self) -> bool {
        matches!(self, Self::Island | Self::Auto)
    }

    /// Returns the number of substeps per tick at first; `exchanges` is the setting.
    pub(super) const fn first_steps(self, exchanges: usize) -> usize {
        match self {
            Self::Auto => 1,
            _ => exchanges,
        }
    }
}

/// The largest island limit that may be asked for: every island may be whole in one region.
pub(super) const WHOLE: usize = BIG_ISLAND as usize - 1;

/// The settings by which a world is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepSettings {
    /// Gravity, m/s²: finite.
    pub gravity: [f32; 3],
    /// The length of a tick, seconds: above 0, at most 1.
    pub dt_s: f32,
    /// The number of solver iterations per tick, 1 to 1,000, divided among its substeps.
    pub solver_iterations: usize,
    /// The coupling method: how regions agree on bodies near their borders.
    pub coupling: Coupling,
    /// The number of substeps per tick, 1 to 64, with an exchange after each. With [`Coupling::Auto`] it is
    /// the most that a border may take.
    pub exchanges: usize,
    /// The number of contact hops across a border, 1 to 16, within which bodies live in both regions, for
    /// couplings that overlap.
    pub depth: usize,
    /// The largest number of bodies of an island that moves whole, for couplings that move islands: 0 to
    /// 65,534, which is as good as no limit.
    pub island_limit: usize,
    /// The disagreement of a body's copies that [`Coupling::Auto`] tolerates, m/s; above 0.
    pub tolerance_m_s: f32,
    /// All other parameters of Rapier's solver, the same in every region. Its `dt` and
    /// `num_solver_iterations` are replaced by the settings above. A served world must have Rapier's
    /// defaults, but for the speed limit ([`StepSettings::with_speed_limit`]).
    pub integration: IntegrationParameters,
}

impl Default for StepSettings {
    fn default() -> Self {
        Self {
            gravity: [0.0, -9.81, 0.0],
            dt_s: 1.0 / 60.0,
            solver_iterations: 4,
            coupling: Coupling::default(),
            exchanges: Coupling::default().usual_exchanges(),
            depth: 2,
            island_limit: WHOLE,
            tolerance_m_s: 0.03,
            integration: IntegrationParameters::default(),
        }
    }
}

/// The accuracy that a world asks of [`Coupling::Auto`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Speed first: islands of more than 256 bodies are cut, and the copies at such a cut may differ by 0.1
    /// m/s.
    Draft,
    /// For games: every island is whole in one region. Where one is cut all the same, copies may differ by
    /// 0.03 m/s.
    #[default]
    Game,
    /// The same as `Game`, but where an island is cut all the same, copies may differ by 0.01 m/s, and
    /// overlaps are three hops deep.
    Precise,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 3] = [Self::Draft, Self::Game, Self::Precise];

    /// Returns the name of the preset on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Game => "game",
            Self::Precise => "precise",
        }
    }
}

impl StepSettings {
    /// Returns the settings that nodes of a served world are sent: all but `integration`, which is Rapier's own there.
    #[doc(hidden)]
    pub fn record(&self) -> StepRecord {
        let Self {
            gravity,
            dt_s,
            solver_iterations,
            coupling,
            exchanges,
            depth,
            island_limit,
            tolerance_m_s,
            integration: _,
        } = *self;
        let speed_limit_m_s = self.speed_limit_m_s();
        // A number that is out of range stays out of range.
        let narrowed = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        StepRecord {
            gravity,
            dt_s,
            solver_iterations: narrowed(solver_iterations),
            coupling,
            exchanges: narrowed(exchanges),
            depth: narrowed(depth),
            island_limit: narrowed(island_limit),
            tolerance_m_s,
            speed_limit_m_s,
        }
    }

    /// Returns the speed limit of dynamic bodies, m/s: 400 unless set otherwise. A body that the solver makes
    /// faster is slowed to it.
    pub fn speed_limit_m_s(&self) -> f32 {
        self.integration.max_linear_velocity()
    }

    /// Returns the settings with another speed limit, m/s above 0.
    #[must_use]
    pub fn with_speed_limit(mut self, m_s: f32) -> Self {
        self.integration.normalized_max_linear_velocity = m_s / self.integration.length_unit;
        self
    }

    /// Returns whether a served world can be stepped with these parameters of the solver.
    #[cfg(feature = "net")]
    pub(crate) fn can_be_served(&self) -> bool {
        self.integration == Self::from(self.record()).integration
    }

    /// Returns the first setting that is out of range.
    pub(crate) fn fault(&self) -> Option<SettingFault> {
        // These parameters come first, since the speed limit is a product of some of them.
        let unfit = unfit(&self.integration);
        let fault = unfit
            .map(|(what, value)| (what, value.to_string(), "finite and not negative; length_unit above 0"));
        fault.or_else(|| self.record().fault())
    }
}

impl From<StepRecord> for StepSettings {
    fn from(record: StepRecord) -> Self {
        let StepRecord {
            gravity,
            dt_s,
            solver_iterations,
            coupling,
            exchanges,
            depth,
            island_limit,
            tolerance_m_s,
            speed_limit_m_s,
        } = record;
        Self {
            gravity,
            dt_s,
            solver_iterations: solver_iterations as usize,
            coupling,
            exchanges: exchanges as usize,
            depth: depth as usize,
            island_limit: island_limit as usize,
            tolerance_m_s,
            integration: IntegrationParameters::default(),
        }
        .with_speed_limit(speed_limit_m_s)
    }
}

impl StepSettings {
    /// Returns the settings with another coupling and its usual number of exchanges.
    #[must_use]
    pub fn with_coupling(self, coupling: Coupling) -> Self {
        Self { coupling, exchanges: coupling.usual_exchanges(), ..self }
    }

    /// Returns the settings with [`Coupling::Auto`] and the values of the preset.
    #[must_use]
    pub fn with_preset(self, preset: Preset) -> Self {
        let (exchanges, depth, island_limit, tolerance_m_s) = match preset {
            Preset::Draft => (2, 2, 256, 0.1),
            Preset::Game => (4, 2, WHOLE, 0.03),
            Preset::Precise => (4, 3, WHOLE, 0.01),
        };
        Self { coupling: Coupling::Auto, exchanges, depth, island_limit, tolerance_m_s, ..self }
    }
}

/// Returns the first of the solver's parameters that Rapier cannot use, with its value.
fn unfit(parameters: &IntegrationParameters) -> Option<(&'static str, f32)> {
    let (moving, fixed) = (parameters.contact_softness, parameters.static_contact_softness);
    let numbers = [
        ("integration.min_ccd_dt", parameters.min_ccd_dt),
        ("integration.contact_softness", moving.natural_frequency),
        ("integration.contact_softness", moving.damping_ratio),
        ("integration.static_contact_softness", fixed.natural_frequency),
        ("integration.static_contact_softness", fixed.damping_ratio),
        ("integration.warmstart_coefficient", parameters.warmstart_coefficient),
        ("integration.normalized_allowed_linear_error", parameters.normalized_allowed_linear_error),
        ("integration.normalized_max_corrective_velocity", parameters.normalized_max_corrective_velocity),
        ("integration.normalized_prediction_distance", parameters.normalized_prediction_distance),
        ("integration.normalized_max_linear_velocity", parameters.normalized_max_linear_velocity),
        ("integration.normalized_contact_recycle_distance", parameters.normalized_contact_recycle_distance),
    ];
    let is_unit = parameters.length_unit.is_finite() && parameters.length_unit > 0.0;
    let mut unfit = numbers.into_iter().filter(|(_, value)| !(value.is_finite() && *value >= 0.0));
    unfit.next().or((!is_unit).then_some(("integration.length_unit", parameters.length_unit)))
}
