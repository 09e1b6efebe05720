//! Defines the settings of a step and of the coupling of regions: the coupling methods, presets and defaults.

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use crate::protocol::BIG_ISLAND;

/// The coupling methods: how regions agree on bodies near their borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Coupling {
    /// Replicas are kinematic ghosts that push and are not pushed. What most projects do; it gains energy and drops
    /// stacks. The baseline that the other methods are compared with.
    Proxy,
    /// Replicas are dynamic copies, overwritten by their owner after each step. Cheap and tolerant of delay; it does not
    /// conserve momentum across a border.
    Owner,
    /// Bodies within some contact hops of a border live in both regions, each copy with a part of the mass (mass splitting);
    /// copies follow their consensus, the mean, and regions even out the forces at the edges of the overlap.
    Overlap,
    /// Bodies that meet across a border are solved by both regions with whole copies, and the region that sees most of the island
    /// is authoritative; an island that stays in touch moves whole to one region, where it is computed exactly. Islands above the
    /// limit as by `overlap`.
    Island,
    /// As `island`, with the exchanges of each border at which an island is split chosen by how far its copies disagree.
    #[default]
    Auto,
}

impl Coupling {
    /// All coupling methods.
    pub const ALL: [Self; 5] = [Self::Proxy, Self::Owner, Self::Overlap, Self::Island, Self::Auto];

    /// Returns its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Proxy => "proxy",
            Self::Owner => "owner",
            Self::Overlap => "overlap",
            Self::Island => "island",
            Self::Auto => "auto",
        }
    }

    /// Returns the exchanges per tick that suit it; for `auto`, the most that it may take.
    pub const fn usual_exchanges(self) -> usize {
        match self {
            Self::Proxy | Self::Owner => 1,
            Self::Overlap | Self::Island => 2,
            Self::Auto => 4,
        }
    }

    /// Returns whether regions use mass splitting, with consensus on the means of a body's copies.
    pub(super) const fn shares_mass(self) -> bool {
        matches!(self, Self::Overlap | Self::Island | Self::Auto)
    }

    /// Returns whether small islands move whole to one region.
    pub(super) const fn moves_islands(self) -> bool {
        matches!(self, Self::Island | Self::Auto)
    }

    /// Returns the substeps per tick at first; `exchanges` is the setting.
    pub(super) const fn first_steps(self, exchanges: usize) -> usize {
        match self {
            Self::Auto => 1,
            _ => exchanges,
        }
    }
}

/// The largest island limit that may be asked for: no island is too large to be whole in one region.
pub(super) const WHOLE: usize = BIG_ISLAND as usize - 1;

/// The settings by which a world is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepSettings {
    /// Gravity, m/s².
    pub gravity: [f32; 3],
    /// Seconds per tick.
    pub dt_s: f32,
    /// Solver iterations per tick, divided among its substeps.
    pub solver_iterations: usize,
    /// The coupling method: how regions agree on bodies near their borders.
    pub coupling: Coupling,
    /// Substeps per tick, with an exchange after each; with [`Coupling::Auto`] the most that a border may take.
    pub exchanges: usize,
    /// Contact hops across a border within which bodies live in both regions, for couplings that overlap.
    pub depth: usize,
    /// The most bodies of an island that moves whole, for couplings that move islands; up to 65,534, which is as good as no limit.
    pub island_limit: usize,
    /// The disagreement of replicas that [`Coupling::Auto`] tolerates, in metres per second.
    pub tolerance_m_s: f32,
    /// All other parameters of Rapier's solver, the same in every region; its `dt` and `num_solver_iterations` are those above. A
    /// served world uses Rapier's defaults.
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
    /// Speed first: islands of more than 256 bodies are cut, and the copies at such a cut may differ by 0.1 m/s.
    Draft,
    /// What games want: every island whole in one region; 0.03 m/s where one is cut all the same.
    #[default]
    Game,
    /// As `Game`, but 0.01 m/s and three hops deep where an island is cut all the same.
    Precise,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 3] = [Self::Draft, Self::Game, Self::Precise];

    /// Returns its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Game => "game",
            Self::Precise => "precise",
        }
    }
}

impl StepSettings {
    /// Returns the settings with another coupling and its usual exchanges.
    pub fn with_coupling(self, coupling: Coupling) -> Self {
        Self { coupling, exchanges: coupling.usual_exchanges(), ..self }
    }

    /// Returns the settings with [`Coupling::Auto`] and the values of the preset.
    pub fn with_preset(self, preset: Preset) -> Self {
        let (exchanges, depth, island_limit, tolerance_m_s) = match preset {
            Preset::Draft => (2, 2, 256, 0.1),
            Preset::Game => (4, 2, WHOLE, 0.03),
            Preset::Precise => (4, 3, WHOLE, 0.01),
        };
        Self { coupling: Coupling::Auto, exchanges, depth, island_limit, tolerance_m_s, ..self }
    }
}
