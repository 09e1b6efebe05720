//! Runs a scene by one setting, which is measured twice: for its error and for its speed.

use std::time::Instant;

use dcd::physics::{Coupling, Preset};
use dcd::runtime::WorldConfig;

use crate::accuracy::{Bare, Case, Setup, world_of};
use crate::timing::{StepMs, WARM_UP};

/// What is set.
#[derive(Clone, Copy, Debug)]
pub(super) enum Setting {
    /// One Rapier world, with one of its settings changed.
    Bare {
        /// Which.
        sweep: &'static str,
        bare: Bare,
    },
    /// A coupling with so many exchanges per tick.
    Fixed { method: Coupling, regions: usize, exchanges: usize },
    /// `auto`, which chooses.
    Auto { preset: Preset, regions: usize },
}

impl Setting {
    /// What the setup's closure borrows ends with this call, so the work is handed in.
    pub(super) fn with<R>(&self, work: impl FnOnce(Setup<'_>) -> R) -> R {
        self.with_threads(1, work)
    }

    fn with_threads<R>(&self, threads: usize, work: impl FnOnce(Setup<'_>) -> R) -> R {
        let threads = self.threads(threads);
        match *self {
            Self::Bare { bare, .. } => work(Setup::Bare(bare)),
            Self::Fixed { method, regions, exchanges } => {
                let adjust = move |config: &mut WorldConfig| {
                    config.step = config.step.with_coupling(method);
                    (config.step.exchanges, config.threads) = (exchanges, threads);
                };
                work(Setup::Cut { regions, adjust: &adjust })
            }
            Self::Auto { preset, regions } => {
                let adjust = move |config: &mut WorldConfig| {
                    config.step = config.step.with_preset(preset);
                    config.threads = threads;
                };
                work(Setup::Cut { regions, adjust: &adjust })
            }
        }
    }

    /// Times the steps of the case's first scene for so many simulated seconds, with nothing between them but what acts on
    /// the scene from outside.
    pub(super) fn time(
        &self,
        case: &Case,
        seconds: f64,
        threads: usize,
    ) -> Result<StepMs, Box<dyn std::error::Error>> {
        let dt_s = self.dt_s(case);
        let ticks = ((seconds / dt_s).round() as usize).max(WARM_UP + 30);
        let (mut world, ..) = self.with_threads(threads, |setup| world_of(case, &case.scenes[0], &setup))?;
        let mut steps = Vec::with_capacity(ticks);
        for tick in 0..ticks {
            if let Some(drive) = &case.drive {
                drive(&mut world, tick as f64 * dt_s);
            }
            let start = Instant::now();
            world.step()?;
            steps.push(start.elapsed());
        }
        StepMs::from_steps(&steps)
    }

    /// Name of the method.
    pub(super) fn method(&self) -> &'static str {
        match self {
            Self::Bare { .. } => "bare",
            Self::Fixed { method, .. } => method.name(),
            Self::Auto { .. } => Coupling::Auto.name(),
        }
    }

    /// What is swept and its value.
    pub(super) fn sweep(&self) -> (&'static str, String) {
        match self {
            Self::Bare { sweep, bare: Bare { dt_s: Some(dt_s), .. } } => {
                (sweep, format!("1/{:.0}", 1.0 / dt_s))
            }
            Self::Bare { sweep, bare } => (sweep, bare.iterations.unwrap_or_default().to_string()),
            Self::Fixed { exchanges, .. } => ("exchanges", exchanges.to_string()),
            Self::Auto { preset, .. } => ("preset", preset.name().to_owned()),
        }
    }

    /// 0 for one bare world.
    pub(super) fn regions(&self) -> usize {
        match *self {
            Self::Bare { .. } => 0,
            Self::Fixed { regions, .. } | Self::Auto { regions, .. } => regions,
        }
    }

    /// Of so many that may be used.
    pub(super) fn threads(&self, most: usize) -> usize {
        self.regions().clamp(1, most)
    }

    /// Seconds a step.
    pub(super) fn dt_s(&self, case: &Case) -> f64 {
        let own = match self {
            Self::Bare { bare, .. } => bare.dt_s,
            _ => None,
        };
        f64::from(own.unwrap_or(case.scenes[0].dt_s))
    }
}
