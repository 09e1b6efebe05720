//! Steps regions at the rates that a governor chooses, and audits what they compute.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use super::RegionHost;
use crate::physics::coupling::Side;
use crate::physics::fidelity::{Audit, Fidelity, FidelityReport, Governor, RegionState};
use crate::space::{RegionId, Viewpoint, mixed};

/// Loads out of proportion are looked for every so many ticks.
const REFINE_TICKS: u64 = 16;

/// Bodies that are drawn for an audit, of which the first is audited that does not fly alone; what that costs, in bodies stepped once.
const DRAWS: usize = 32;
const DRAWING: f64 = 10.0;
/// The cost of looking at an awake body, in bodies stepped once.
const GATHERING: f64 = 0.01;
/// The increment of SplitMix64.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// An audit under way, of a region in this place.
pub(super) struct Auditing {
    place: usize,
    /// Of so many ticks' step.
    span: u8,
    /// Where it is one of all: see [`RegionHost::audit_all`]. Otherwise the part of all bodies that do not fly alone.
    share: Option<f32>,
    audit: Audit,
}

impl RegionHost {
    /// Sets how much of the world is computed in full; to be called before the first step.
    pub fn set_fidelity(&mut self, fidelity: Fidelity) {
        self.governor = (fidelity != Fidelity::Off).then(|| Governor::new(fidelity));
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

    /// Returns how seldom each region was stepped in the last tick, where that followed the time that steps take: no other run chooses
    /// the same.
    pub(crate) fn timed_rates(&self) -> Option<&BTreeMap<RegionId, u8>> {
        let governor = self.governor.as_ref()?;
        matches!(governor.fidelity(), Fidelity::Budget { .. }).then(|| governor.rates())
    }

    /// Steps regions as seldom as it is told from now on, and no more by the time that steps take. Returns whether it can.
    pub(crate) fn follow_rates(&mut self, rates: BTreeMap<RegionId, u8>) -> bool {
        self.governor.as_mut().is_some_and(|governor| governor.follow(rates))
    }

    /// Counts so much time for each of the last steps of all regions.
    #[cfg(test)]
    pub(crate) fn count_time(&mut self, took: std::time::Duration) {
        for side in &mut self.sides {
            (0..100).for_each(|_| side.region.count_time(took, true));
        }
    }

    /// Sets the part of the time that audits may take.
    #[doc(hidden)]
    pub fn set_audited(&mut self, part: f64) {
        if let Some(governor) = &mut self.governor {
            governor.set_audited(part);
        }
    }

    /// Audits every island in every tick, beside those by which levels are chosen: see [`RegionHost::true_error_m_s`].
    #[doc(hidden)]
    pub fn audit_all(&mut self) {
        if let Some(governor) = &mut self.governor {
            governor.audit_all();
        }
    }

    /// Returns the mean error of all bodies in all ticks in which all were audited, m/s.
    #[doc(hidden)]
    pub fn true_error_m_s(&self) -> Option<f64> {
        self.governor.as_ref()?.true_error_m_s()
    }

    /// Chooses which regions are stepped in the tick that begins, and perhaps an island to be audited in it.
    pub(super) fn govern(&mut self) -> Vec<Auditing> {
        let Some(governor) = &mut self.governor else { return Vec::new() };
        let states = self.sides.iter().map(|side| RegionState {
            id: side.region.id(),
            cell: *side.region.cell(),
            // What rests is not stepped: the time that its last steps took is not spent.
            step_ms: if side.is_idle() { 0.0 } else { side.region.mean_step_us() * 1e-3 },
            signals: side.region.signals(),
        });
        governor.choose(&states.collect::<Vec<_>>(), self.settings.dt_s);
        for side in &mut self.sides {
            side.clock.rate = governor.rates().get(&side.region.id()).copied().unwrap_or(1);
        }
        // In turn, so that no tick takes much longer than another.
        let due = |side: &&mut Side| (self.tick.0 + side.region.rank() as u64).is_multiple_of(REFINE_TICKS);
        self.sides.iter_mut().filter(due).for_each(|side| side.region.refine());
        self.schedule();
        for side in self.sides.iter_mut().filter(|side| side.steps_now()) {
            side.region.foresee(side.clock.span);
        }
        let mut begun = Vec::new();
        if self.governor.as_ref().is_some_and(Governor::audits_all) {
            begun.extend((0..self.sides.len()).flat_map(|place| self.audits(place)));
        }
        begun.extend(self.sample());
        begun
    }

    /// Begins to audit the island of a body that is chosen at random, when the last audit is paid for.
    fn sample(&mut self) -> Option<Auditing> {
        let work = |side: &Side| {
            if side.steps_now() { side.region.physics().islands.num_active_bodies() } else { 0 }
        };
        let work: usize = self.sides.iter().map(work).sum();
        if !self.governor.as_mut()?.earn(work) {
            return None;
        }
        let awake = |side: &Side| -> Vec<_> {
            if side.steps_now() {
                side.region.physics().islands.active_bodies().collect()
            } else {
                Vec::new()
            }
        };
        let awake: Vec<_> = self.sides.iter().map(awake).collect();
        // Every body in every tick is as likely as any other: what a step computes counts for each of its ticks. What flies alone is right;
        // how much of all that is, some draws tell.
        let weight = |place: usize| (awake[place].len() * usize::from(self.sides[place].clock.span)) as u64;
        let total: u64 = (0..awake.len()).map(weight).sum();
        if total == 0 {
            return None;
        }
        let mut random = mixed(self.tick.0 + 1);
        let mut draw = || {
            random = mixed(random.wrapping_add(GOLDEN));
            let mut at = random % total;
            let place = (0..awake.len()).find(|&place| {
                let is_here = at < weight(place);
                at = at.saturating_sub(weight(place));
                is_here
            });
            let place = place.expect("the sum of all weights is above it");
            (place, awake[place][(random >> 32) as usize % awake[place].len()])
        };
        let drawn: Vec<_> = (0..DRAWS).map(|_| draw()).collect();
        let is_held =
            |&&(place, body): &&(usize, RigidBodyHandle)| self.sides[place].region.may_collide(body);
        let held: Vec<_> = drawn.iter().filter(is_held).collect();
        let share = held.len() as f32 / DRAWS as f32;
        let auditing = held.first().and_then(|&&(place, body)| self.audit(place, body));
        let governor = self.governor.as_mut()?;
        // To gather all awake bodies and to draw costs something, whatever comes of it.
        let drawing = DRAWING + work as f64 * GATHERING;
        governor.pay(drawing + auditing.as_ref().map_or(0.0, |auditing| auditing.audit.work()));
        if held.is_empty() {
            governor.note_error(self.sides[drawn[0].0].region.id(), 0.0);
        }
        // What cannot be audited is not drawn again.
        auditing.map(|auditing| Auditing { share: Some(share), ..auditing })
    }

    /// Begins to audit all islands of the region in this place.
    fn audits(&self, place: usize) -> Vec<Auditing> {
        let side = &self.sides[place];
        let mut begun: Vec<Auditing> = Vec::new();
        if side.steps_now() {
            for handle in side.region.physics().islands.active_bodies() {
                if !begun.iter().any(|auditing| auditing.audit.contains(handle)) {
                    begun.extend(self.audit(place, handle));
                }
            }
        }
        begun
    }

    /// Begins to audit the island of an awake body of the region in this place.
    fn audit(&self, place: usize, seed: RigidBodyHandle) -> Option<Auditing> {
        let Side { region, clock, .. } = &self.sides[place];
        let parameters = region.refined(IntegrationParameters {
            dt: self.settings.dt_s,
            num_solver_iterations: self.settings.solver_iterations,
            ..self.settings.integration
        });
        let audit = Audit::begin(region, seed, clock.span, &parameters)?;
        Some(Auditing { place, span: clock.span, share: None, audit })
    }

    /// Notes what the tick's steps took, and concludes its audits.
    pub(super) fn conclude(&mut self, all: Vec<Auditing>) {
        let Some(governor) = &mut self.governor else { return };
        let per_tick = self.settings.solver_iterations.max(1);
        for side in self.sides.iter().filter(|side| side.steps_now()) {
            let iterations = side.clock.iterations(per_tick) as f64 / per_tick as f64;
            governor.note_step(side.region.last_step().as_secs_f64() * 1e3, side.clock.span, iterations);
        }
        let (mut sum, mut weight) = (0.0, 0.0);
        for Auditing { place, span, share, audit } in all {
            let region = &self.sides[place].region;
            let bodies = audit.len() as f64;
            let Some(error_m_s) = audit.finish(region) else { continue };
            match share {
                Some(share) => governor.note_error(region.id(), share * error_m_s),
                None => {
                    sum += f64::from(error_m_s) * f64::from(span) * bodies;
                    weight += f64::from(span) * bodies;
                }
            }
        }
        governor.note_all(sum, weight);
    }

    /// Notes how long a tick took, for a budget.
    pub(crate) fn note_tick_time(&mut self, took_ms: f64) {
        if let Some(governor) = &mut self.governor {
            governor.note_time(took_ms);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::physics::{Partition, StepSettings};
    use crate::protocol::WorldPose;
    use crate::space::{Axis, BodyId, Bounds, DistributionTree};

    #[test]
    fn what_regions_at_rest_took_when_they_were_awake_counts_for_no_budget() {
        let tree = DistributionTree::cut_by(Bounds::around([0.0; 3], [20.0; 3]), &[(Axis::X, 0.0)]).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let settings = StepSettings { gravity: [0.0; 3], ..StepSettings::default() };
        let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
        host.set_fidelity(Fidelity::Budget { tick_ms: 10.0 });
        let bodies = [-10.0, 10.0].into_iter().zip(0..).map(|(x, id)| {
            let (body, ball) = (RigidBodyBuilder::dynamic().build(), ColliderBuilder::ball(0.5));
            let (id, at) = (BodyId::persistent(id), WorldPose::at([x, 0.0, 0.0]));
            host.shapes_mut().describe(id, at, &body, &[ball]).unwrap()
        });
        let bodies = bodies.collect();
        host.insert(bodies, &[]).unwrap();
        let levels_after_hard_work = |host: &mut RegionHost| {
            host.count_time(Duration::from_secs(5));
            (0..16).for_each(|_| host.step().unwrap());
            host.fidelity_report().unwrap().levels
        };
        assert_eq!(levels_after_hard_work(&mut host), [0, 0, 2], "awake");
        for _ in 0..600 {
            host.step().unwrap();
        }
        assert!(host.sides.iter().all(Side::is_idle));
        assert_eq!(levels_after_hard_work(&mut host), [2, 0, 0], "asleep");
    }
}
