//! Steps regions at the rates that a governor chooses, and audits what they compute.

use rapier3d::prelude::*;

use super::RegionHost;
use crate::physics::fidelity::{Audit, Fidelity, FidelityReport, Governor, RegionState};
use crate::space::{RegionId, Viewpoint, mixed};

/// An audit under way, of a region in this place.
pub(super) struct Auditing {
    place: usize,
    audit: Audit,
}

impl RegionHost {
    /// Sets how much of the world is computed in full; at once, and all of it is at the present time after the next step.
    pub fn set_fidelity(&mut self, fidelity: Fidelity) {
        // One that has nothing to choose brings regions that are behind to the present.
        if fidelity != Fidelity::Off || self.governor.is_some() {
            self.governor = Some(Governor::new(fidelity));
        }
    }

    /// Returns how much of the world is computed in full.
    pub fn fidelity(&self) -> Fidelity {
        self.governor.as_ref().map_or(Fidelity::Off, Governor::fidelity)
    }

    /// Returns what that saves and costs; `None` where all is computed in full.
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        self.governor.as_ref().map(Governor::report)
    }

    /// Sets where the world is looked at from; without any viewpoint all of it is.
    pub fn set_viewpoints(&mut self, viewpoints: Vec<Viewpoint>) {
        if let Some(governor) = &mut self.governor {
            governor.set_viewpoints(viewpoints);
        }
    }

    /// Chooses which regions are stepped in the tick that begins, and perhaps an island to be audited in it.
    pub(super) fn govern(&mut self) -> Option<Auditing> {
        let governor = self.governor.as_mut()?;
        let states = self.sides.iter().map(|side| RegionState {
            id: side.region.id(),
            cell: *side.region.cell(),
            step_ms: side.region.mean_step_us() * 1e-3,
        });
        let rates = governor.rates(&states.collect::<Vec<_>>());
        for (side, (_, rate)) in self.sides.iter_mut().zip(rates) {
            side.clock.rate = rate;
        }
        self.schedule();
        self.audited()
    }

    /// Begins to audit the island of a body that is chosen at random, when the last audit is paid for.
    fn audited(&mut self) -> Option<Auditing> {
        let work: Vec<_> = self
            .sides
            .iter()
            .map(
                |side| {
                    if side.steps_now() { side.region.physics().islands.active_bodies().count() } else { 0 }
                },
            )
            .collect();
        let governor = self.governor.as_mut().filter(|governor| governor.fidelity() != Fidelity::Off)?;
        if !governor.earn(work.iter().sum()) {
            return None;
        }
        // Every body in every tick is as likely as any other: what a step computes counts for each of its ticks.
        let weight = |place: usize| (work[place] * usize::from(self.sides[place].clock.span)) as u64;
        let total: u64 = (0..work.len()).map(weight).sum();
        let mut at = mixed(self.tick.0 + 1) % total.max(1);
        let place = (0..work.len()).find(|&place| {
            let is_here = at < weight(place);
            at = at.saturating_sub(weight(place));
            is_here
        })?;
        let side = &self.sides[place];
        let one = mixed(mixed(self.tick.0 + 1)) as usize % work[place];
        let seed = side.region.physics().islands.active_bodies().nth(one)?;
        let parameters = IntegrationParameters {
            dt: self.settings.dt_s,
            num_solver_iterations: self.settings.solver_iterations,
            ..self.settings.integration
        };
        let audit = Audit::begin(&side.region, seed, side.clock.span, &parameters)?;
        governor.pay(audit.work());
        Some(Auditing { place, audit })
    }

    /// Notes what the tick's steps took, and concludes its audit.
    pub(super) fn conclude(&mut self, auditing: Option<Auditing>) {
        if let Some(governor) = &mut self.governor {
            let per_tick = self.settings.solver_iterations.max(1);
            for side in self.sides.iter().filter(|side| side.steps_now()) {
                let iterations = side.clock.iterations(per_tick) as f64 / per_tick as f64;
                governor.note_step(side.region.last_step().as_secs_f64() * 1e3, side.clock.span, iterations);
            }
        }
        let Some(Auditing { place, audit }) = auditing else { return };
        let region = &self.sides[place].region;
        let (id, found): (RegionId, _) = (region.id(), audit.finish(region));
        if let (Some(governor), Some(error_m_s)) = (&mut self.governor, found) {
            governor.note_error(id, error_m_s);
        }
    }

    /// Notes how long a tick took, for a budget.
    pub(crate) fn note_tick_time(&mut self, took_ms: f64) {
        if let Some(governor) = &mut self.governor {
            governor.note_time(took_ms);
        }
    }
}
