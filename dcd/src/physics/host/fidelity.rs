//! Steps regions at the rates that a governor chooses, here or at the leader of a group, and audits what they
//! compute.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use super::{HostError, RegionHost};
use crate::fidelity::{
    Audited, COARSEST, Fidelity, FidelityReport, Governed, Governor, LookedAt, Pace, Pick, RegionState,
    Schedule, relative_time,
};
use crate::physics::audit::Audit;
use crate::physics::coupling::{Clock, Side};
use crate::physics::region::Region;
use crate::protocol::{BodyKind, BodyRecord, ContactForce, JointRecord};
use crate::space::{BodyId, JointId, RegionId, RegionSet, Tick, Viewpoint, drawn};

/// Ticks between two searches for loads out of proportion.
const REFINE_TICKS: u64 = 16;

/// How many bodies are drawn for an audit, of which the first that does not fly alone is audited. `DRAWING`
/// is what that costs, in bodies stepped once.
const DRAWS: usize = 32;
const DRAWING: f64 = 10.0;
/// The cost of looking at an awake body, in bodies stepped once.
const GATHERING: f64 = 0.01;

/// The audits under way in a tick. Hosts are copied between ticks, when there are none.
#[derive(Default)]
pub(super) struct Audits(Vec<Auditing>);

impl Clone for Audits {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// An audit under way, of the region at this place in the host.
struct Auditing {
    place: usize,
    /// The number of ticks of the audited step.
    span: u8,
    /// `None` for one of the audits of all islands: see [`RegionHost::audit_all`].
    share: Option<Share>,
    /// `None` if all bodies that were drawn fly alone, or if the first that does not cannot be audited.
    audit: Option<Audit>,
}

/// The part of a region's bodies that do not fly alone, as drawn, and the cost of an audit, in bodies stepped
/// once.
#[derive(Clone, Copy)]
struct Share {
    held: f32,
    cost: f32,
}

impl RegionHost {
    /// Sets how much of the world is computed in full; to be called before the first step.
    pub fn set_fidelity(&mut self, fidelity: Fidelity) {
        self.governor = (fidelity != Fidelity::Off).then(|| Governor::new(fidelity));
    }

    /// Returns the most ticks that one step of a region may have in the next tick.
    pub(super) fn coarsest(&self) -> u8 {
        1 + self.governor.as_ref().map_or(self.behind_most, Governor::behind_most)
    }

    /// Returns by how many ticks a region computed here is behind the present.
    pub fn behind(&self, region: RegionId) -> u8 {
        let side = self.sides.iter().find(|side| side.region.id() == region);
        side.map_or(0, |side| side.clock.owed)
    }

    /// Returns how much of the world is computed in full.
    pub fn fidelity(&self) -> Fidelity {
        self.governor.as_ref().map_or(Fidelity::Off, Governor::fidelity)
    }

    /// Returns what the fidelity saves and costs; `None` where all is computed in full.
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        self.governor.as_ref().map(Governor::report)
    }

    /// Sets the viewpoints from which the world is looked at. Without any, all of it is looked at.
    pub fn set_viewpoints(&mut self, viewpoints: Vec<Viewpoint>) {
        if let Some(governor) = &mut self.governor {
            governor.look(match viewpoints.is_empty() {
                true => LookedAt::All,
                false => LookedAt::From(viewpoints),
            });
        }
    }

    /// Returns the viewpoints from which the world is looked at; none if all of it is.
    #[cfg(feature = "net")]
    pub(crate) fn viewpoints(&self) -> &[Viewpoint] {
        self.governor.as_ref().map_or(&[], Governor::viewpoints)
    }

    /// Returns the pace of each region in the last tick, if paces follow the time that steps take: no other
    /// run chooses the same.
    pub(crate) fn timed_paces(&self) -> Option<&BTreeMap<RegionId, Pace>> {
        let governor = self.governor.as_ref()?;
        matches!(governor.fidelity(), Fidelity::Budget { .. }).then(|| governor.paces())
    }

    /// Steps regions at the given paces from now on, and no longer by the time that steps take. Returns
    /// whether it can.
    pub(crate) fn follow_paces(&mut self, paces: BTreeMap<RegionId, Pace>) -> bool {
        self.governor.as_mut().is_some_and(|governor| governor.follow(paces))
    }

    /// Counts `took` for each of the last steps of all regions.
    #[cfg(test)]
    pub(crate) fn count_time(&mut self, took: std::time::Duration) {
        for side in &mut self.sides {
            for _ in 0..100 {
                side.region.time_mut().begin(1, 1.0);
                side.region.time_mut().add(took);
            }
        }
    }

    /// Sets the part of the time that audits may take.
    #[doc(hidden)]
    pub fn set_audited(&mut self, part: f64) {
        if let Some(governor) = &mut self.governor {
            governor.set_audited(part);
        }
    }

    /// Audits every island in every tick, besides the audits by which levels are chosen: see
    /// [`RegionHost::true_error_m_s`].
    #[doc(hidden)]
    pub fn audit_all(&mut self) {
        if let Some(governor) = &mut self.governor {
            governor.audit_all();
        }
    }

    /// Returns the mean error of all bodies, m/s, in all ticks in which all were audited.
    #[doc(hidden)]
    pub fn true_error_m_s(&self) -> Option<f64> {
        self.governor.as_ref()?.true_error_m_s()
    }

    /// Chooses which regions stay behind in the tick that begins, for a world of this process alone.
    pub(super) fn govern(&mut self) {
        if self.governor.is_none() {
            return;
        }
        let states = self.region_states();
        let governor = self.governor.as_mut().expect("asked above");
        let cells = self.sides.iter().map(|side| *side.region.cell());
        let regions = states.iter().zip(cells).map(|(state, cell)| Governed { state, cell, by: 0 });
        let schedule = governor.schedule(self.tick.next(), &regions.collect::<Vec<_>>(), self.settings.dt_s);
        for side in &mut self.sides {
            side.clock.rate = governor.paces().get(&side.region.id()).map_or(1, |pace| pace.rate);
        }
        self.keep(&schedule);
        if self.governor.as_ref().is_some_and(Governor::audits_all) {
            let all: Vec<_> = (0..self.sides.len()).flat_map(|place| self.audits(place)).collect();
            self.auditing.0.extend(all);
        }
    }

    /// Makes the tick that begins step all regions but those that stay behind, here and elsewhere, and begins
    /// the scheduled audit.
    pub(crate) fn keep(&mut self, schedule: &Schedule) {
        // In turn, so that no tick takes much longer than another.
        let due = |side: &&mut Side| (self.tick.0 + side.region.rank() as u64).is_multiple_of(REFINE_TICKS);
        self.sides.iter_mut().filter(due).for_each(|side| side.region.refine());
        self.behind = schedule.behind.iter().filter_map(|region| self.partition.rank_of(*region)).collect();
        if self.is_scheduled {
            self.disbelieve();
        }
        self.behind_most = schedule.behind_most.min(COARSEST - 1);
        for side in &mut self.sides {
            side.region.count_attended();
            let stays = self.behind.contains(side.region.rank());
            // A region at rest is the same at any time.
            let owed = if side.is_idle() && !stays { 0 } else { side.clock.owed };
            (side.clock.span, side.clock.owed) = if stays { (0, owed + 1) } else { (owed + 1, 0) };
            if self.is_scheduled && !stays {
                side.clock.rate = side.clock.span;
            }
        }
        let dt_s = self.settings.dt_s;
        for side in self.sides.iter_mut().filter(|side| side.steps_now()) {
            side.region.foresee(side.clock.span, dt_s);
        }
        self.audited = None;
        self.auditing.0.clear();
        let place = schedule.audit.and_then(|pick| self.place_of[self.partition.rank_of(pick.region)?]);
        if let (Some(place), Some(pick)) = (place, schedule.audit) {
            let begun = self.sample(place, pick);
            self.auditing.0.extend(begun);
        }
    }

    /// Lets regions catch up that the schedule keeps behind for longer than any may be, here and at all
    /// others alike.
    fn disbelieve(&mut self) {
        self.late.resize(self.partition.len(), 0);
        for (rank, late) in self.late.iter_mut().enumerate() {
            if *late + 1 >= COARSEST {
                self.behind.remove(rank);
            }
            *late = if self.behind.contains(rank) { *late + 1 } else { 0 };
        }
    }

    /// Leaves it to others from now on which regions stay behind in each tick: see [`RegionHost::keep`].
    pub(crate) fn follow_schedules(&mut self) {
        self.is_scheduled = true;
    }

    /// Returns whether a region computed here stays behind in the tick under way, or stayed behind in the
    /// last one.
    pub(crate) fn stays_behind(&self, region: &Region) -> bool {
        self.behind.contains(region.rank())
    }

    /// Takes all regions for present: they do not catch up the ticks that they owe. When membership changes,
    /// nobody knows what regions of others owe, and those that share bodies are at one time already.
    pub(super) fn forgive(&mut self) {
        (self.behind, self.audited) = (RegionSet::EMPTY, None);
        self.behind_most = 0;
        self.late.clear();
        for side in &mut self.sides {
            side.clock = Clock::default();
            side.region.forget_attended();
        }
    }

    /// Has the regions that hold a body stepped in every tick for a while, since the program changes something
    /// about it.
    pub(crate) fn heed(&mut self, body: BodyId) {
        if self.may_lag() {
            self.heed_in(self.holding(body));
        }
    }

    /// Does the same, and first brings these regions to the present, so that the change counts from now on, and for
    /// as many ticks as it lasts. A process that computes a part of the world cannot do that alone.
    pub(crate) fn attend(&mut self, body: BodyId) -> Result<(), HostError> {
        if !self.may_lag() {
            return Ok(());
        }
        let holding = self.holding(body);
        self.heed_in(holding);
        self.catch_up(holding)
    }

    /// Does the same for the movable bodies that a joint ties, or is to tie.
    pub(crate) fn attend_ends(&mut self, joint: &JointRecord) -> Result<(), HostError> {
        for end in [joint.a, joint.b] {
            if self.immovable(end).is_none() {
                self.attend(end)?;
            }
        }
        Ok(())
    }

    /// Does the same for a joint by its id.
    pub(crate) fn attend_joint(&mut self, joint: JointId) -> Result<(), HostError> {
        let record = if self.may_lag() { self.joint(joint) } else { None };
        record.map_or(Ok(()), |record| self.attend_ends(&record))
    }

    /// Does the same for a body that is to be inserted. A fixed one has no time of its own.
    pub(crate) fn attend_new(&mut self, body: &BodyRecord) -> Result<(), HostError> {
        match body.traits.kind {
            BodyKind::Fixed => Ok(()),
            _ => self.attend_at(body.state.pose.translation),
        }
    }

    /// Does the same for the region that computes a place.
    pub(crate) fn attend_at(&mut self, place: [f64; 3]) -> Result<(), HostError> {
        if !self.may_lag() {
            return Ok(());
        }
        let region = RegionSet::only(self.partition.rank_at(place));
        self.heed_in(region);
        self.catch_up(region)
    }

    /// Brings all regions to the present.
    pub(crate) fn catch_up_all(&mut self) -> Result<(), HostError> {
        self.catch_up(RegionSet::ALL)
    }

    /// Returns whether regions may be behind the present.
    fn may_lag(&self) -> bool {
        self.governor.is_some() || self.is_scheduled
    }

    fn holding(&self, body: BodyId) -> RegionSet {
        self.regions().filter(|region| region.holds(body)).map(Region::rank).collect()
    }

    fn heed_in(&mut self, ranks: RegionSet) {
        let regions = self.sides.iter_mut().map(|side| &mut side.region);
        regions.filter(|region| ranks.contains(region.rank())).for_each(Region::attend);
    }

    /// Steps regions, and those that must be at one time with them, to the present: computes the last tick once
    /// more, in which all others stay as they are. No tick ends with it.
    fn catch_up(&mut self, mut due: RegionSet) -> Result<(), HostError> {
        let owes = |side: &Side| side.clock.owed > 0 && due.contains(side.region.rank());
        if self.governor.is_none() || !self.sides.iter().any(owes) {
            return Ok(());
        }
        let bound = |side: &Side| side.bound_to().union(RegionSet::only(side.region.rank()));
        let bound: Vec<_> = self.sides.iter().map(bound).collect();
        loop {
            let reached = bound.iter().filter(|bound| !bound.intersection(due).is_empty());
            let all = reached.fold(due, |all, bound| all.union(*bound));
            if std::mem::replace(&mut due, all) == all {
                break;
            }
        }
        let spans: Vec<_> = self.sides.iter().map(|side| side.clock.span).collect();
        for side in &mut self.sides {
            side.clock.span = 0;
            if due.contains(side.region.rank()) {
                std::mem::swap(&mut side.clock.span, &mut side.clock.owed);
                side.region.foresee(side.clock.span, self.settings.dt_s);
            }
        }
        let (now, told) = (self.tick, self.handovers.len());
        self.tick = Tick(now.0 - 1);
        let stepped = (0..self.rounds).try_for_each(|_| {
            self.compute();
            self.exchange()
        });
        (self.tick, self.round) = (now, 0);
        self.early_handovers.extend(self.handovers.drain(told..));
        self.note_spent();
        for (side, span) in self.sides.iter_mut().zip(spans) {
            if side.is_behind() {
                side.clock.span = span;
            }
        }
        self.set_rounds(self.rounds_wanted());
        stepped
    }

    /// Takes the contact forces of steps between two ticks: see [`RegionHost::attend`].
    pub(crate) fn take_early_forces(&mut self) -> Vec<ContactForce> {
        let may_lag = self.may_lag();
        let regions = self.sides.iter_mut().filter(|_| may_lag).map(|side| &mut side.region);
        regions.flat_map(Region::take_forces).collect()
    }

    /// Returns the state of each region computed here after the last tick, in rank order.
    pub(crate) fn region_states(&self) -> Vec<RegionState> {
        // Nothing stays behind if nobody looks ahead for that.
        let (may_lag, longest_s) = (self.coarsest() > 1, self.settings.dt_s * f32::from(COARSEST));
        let state = |side: &Side| {
            let Side { region, clock, .. } = side;
            let rests = side.is_idle();
            let [took_ms, full_ms] = self.spent_ms(side);
            let audited = self.audited.filter(|(audited, _)| *audited == region.id());
            RegionState {
                region: region.id(),
                behind: clock.owed,
                rests,
                // A region that is behind is as it was when that was found to be safe.
                urgent: side.is_awaited()
                    || region.is_attended()
                    || may_lag && clock.owed == 0 && region.is_rushed(longest_s),
                bound: side.bound_to(),
                awake: region.physics().islands.num_active_bodies() as u32,
                // A region at rest is not stepped, so it does not spend the time of its last steps.
                step_ms: if rests { 0.0 } else { (region.time().full_us() * 1e-3) as f32 },
                signals: region.signals(),
                took_ms,
                full_ms,
                audited: audited.map(|(_, audited)| audited),
            }
        };
        self.sides.iter().map(state).collect()
    }

    /// Returns the regions that stay behind in the tick under way, or stayed behind in the last one, by rank.
    pub(super) fn left_behind(&self) -> RegionSet {
        match self.is_scheduled {
            true => self.behind,
            // By the saved clocks, and by the ranks that the regions have now.
            false => {
                self.sides.iter().filter(|side| side.is_behind()).map(|side| side.region.rank()).collect()
            }
        }
    }

    /// Returns how long a region's step in the last tick took, and the estimate for as many steps of one tick
    /// each, milliseconds.
    fn spent_ms(&self, side: &Side) -> [f32; 2] {
        if !side.steps_now() {
            return [0.0; 2];
        }
        let clock = side.clock;
        let longer = relative_time(self.settings.solver_iterations, clock.span);
        let took_ms = side.region.last_step().as_secs_f64() * 1e3;
        [took_ms as f32, (took_ms * f64::from(clock.span) / longer) as f32]
    }

    /// Draws bodies of the region at this place, and begins to audit the island of the first that does not
    /// fly alone. What flies alone is computed right; the draws tell which part of all bodies that is.
    fn sample(&self, place: usize, pick: Pick) -> Option<Auditing> {
        let side = &self.sides[place];
        let awake: Vec<_> = side.region.physics().islands.active_bodies().collect();
        if awake.is_empty() || !side.steps_now() {
            return None;
        }
        let mut random = pick.seed;
        let drawn: Vec<_> = (0..DRAWS)
            .map(|_| {
                random = drawn(random);
                awake[(random >> 32) as usize % awake.len()]
            })
            .collect();
        let held: Vec<_> = drawn.into_iter().filter(|&body| side.region.may_collide(body)).collect();
        let audit = held.first().and_then(|&body| self.audit(place, body));
        // Gathering the awake bodies and drawing cost something, whatever comes of them.
        let drawing = DRAWING + awake.len() as f64 * GATHERING;
        let cost = drawing + audit.as_ref().map_or(0.0, Audit::work);
        let share = Share { held: held.len() as f32 / DRAWS as f32, cost: cost as f32 };
        Some(Auditing { place, span: side.clock.span, share: Some(share), audit })
    }

    /// Begins to audit all islands of the region at this place.
    fn audits(&self, place: usize) -> Vec<Auditing> {
        let side = &self.sides[place];
        let mut begun: Vec<Auditing> = Vec::new();
        if side.steps_now() {
            for handle in side.region.physics().islands.active_bodies() {
                let is_known =
                    |auditing: &Auditing| auditing.audit.as_ref().is_some_and(|audit| audit.contains(handle));
                if !begun.iter().any(is_known) {
                    let audit = self.audit(place, handle);
                    let span = side.clock.span;
                    begun.extend(audit.map(|audit| Auditing {
                        place,
                        span,
                        share: None,
                        audit: Some(audit),
                    }));
                }
            }
        }
        begun
    }

    /// Begins to audit the island of an awake body of the region at this place.
    fn audit(&self, place: usize, seed: RigidBodyHandle) -> Option<Audit> {
        let Side { region, clock, .. } = &self.sides[place];
        let parameters = region.refined(IntegrationParameters {
            dt: self.settings.dt_s,
            num_solver_iterations: self.settings.solver_iterations,
            ..self.settings.integration
        });
        Audit::begin(region, seed, clock.span, &parameters)
    }

    /// Concludes the audits of the tick.
    pub(crate) fn conclude(&mut self) {
        let (mut sum, mut weight) = (0.0, 0.0);
        for Auditing { place, span, share, audit } in std::mem::take(&mut self.auditing.0) {
            let region = &self.sides[place].region;
            let bodies = audit.as_ref().map_or(0, Audit::len) as f64;
            let error_m_s = audit.and_then(|audit| audit.finish(region));
            match share {
                Some(Share { held, cost }) => {
                    // If a drawn body cannot be audited, no other is drawn.
                    let error_m_s = if held == 0.0 { Some(0.0) } else { error_m_s.map(|error| held * error) };
                    self.audited = Some((region.id(), Audited { error_m_s, cost }));
                }
                None => {
                    let Some(error_m_s) = error_m_s else { continue };
                    sum += f64::from(error_m_s) * f64::from(span) * bodies;
                    weight += f64::from(span) * bodies;
                }
            }
        }
        self.note_spent();
        if let Some(governor) = &mut self.governor {
            self.audited.iter().for_each(|(region, audited)| governor.note_audited(*region, audited));
            governor.note_all(sum, weight);
        }
    }

    /// Notes how long the steps have taken that were just done.
    fn note_spent(&mut self) {
        if self.governor.is_none() {
            return;
        }
        let spent: Vec<_> = self.sides.iter().map(|side| self.spent_ms(side)).collect();
        let governor = self.governor.as_mut().expect("just asked");
        spent.into_iter().for_each(|[took_ms, full_ms]| governor.note_spent(took_ms, full_ms));
    }

    /// Notes how long a tick took, for a budget.
    pub(crate) fn note_tick_time(&mut self, took_ms: f64) {
        let steps_ms: f64 = self.sides.iter().map(|side| f64::from(self.spent_ms(side)[0])).sum();
        if let Some(governor) = &mut self.governor {
            governor.note_tick(0, took_ms, steps_ms);
            governor.end_tick();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::physics::host::processes::Processes;
    use crate::physics::{Partition, StepSettings};
    use crate::protocol::WorldPose;
    use crate::runtime::WorldConfig;
    use crate::scene::{Params, Scene};
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

    #[test]
    fn loads_are_those_of_whole_bodies_however_their_masses_are_split() {
        let planes = [(Axis::X, 0.0), (Axis::Z, 0.0)];
        for (heavy_kg, split, is_strained) in [(12.0, 1, false), (40.0, 2, true)] {
            let tree = DistributionTree::cut_by(Bounds::around([0.0; 3], [20.0; 3]), &planes).unwrap();
            let partition = Partition::new(tree, None);
            let leaves = partition.leaves().to_vec();
            let mut host = RegionHost::new(partition, StepSettings::default(), 1, &leaves).unwrap();
            let cube = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
            let stack = [
                (RigidBodyBuilder::fixed(), 1.0),
                (RigidBodyBuilder::dynamic(), 1.0),
                (RigidBodyBuilder::dynamic(), heavy_kg),
            ];
            let ids = [0, 1, 2].map(BodyId::persistent);
            let bodies = stack.into_iter().zip(ids).enumerate().map(|(k, ((body, mass), id))| {
                let at = WorldPose::at([-10.0, k as f64, -10.0]);
                host.shapes_mut().describe(id, at, &body.build(), &[cube.clone().mass(mass)]).unwrap()
            });
            let bodies = bodies.collect();
            host.insert(bodies, &[]).unwrap();
            (0..30).for_each(|_| host.step().unwrap());
            let holds = |side: &&mut Side| side.region.handle_of(ids[split]).is_some();
            let region = &mut host.sides.iter_mut().find(holds).unwrap().region;
            let handle = region.handle_of(ids[split]).unwrap();
            region.split_mass_among(handle, (0..4).collect());
            region.refine();
            let usual = IntegrationParameters::default();
            let is_stiffer = region.refined(usual).contact_softness != usual.contact_softness;
            assert_eq!(is_stiffer, is_strained, "{heavy_kg} kg on 1 kg");
        }
    }

    /// A leader may say what it likes, even that regions which share bodies are at unequal times.
    #[test]
    fn whatever_is_said_to_stay_behind_no_body_is_lost_and_no_region_is_late_by_more_than_three_ticks() {
        for (name, seed) in [("terrain", 1), ("ragdolls", 2), ("gas", 3), ("heap", 4)] {
            let scene = Scene::named(name, &Params::new()).unwrap();
            let step = WorldConfig::for_scene(&scene).step;
            let mut world = Processes::of(&scene, step, 6, 3);
            let bodies = world.states().len();
            let regions: Vec<_> = world.0[0].partition().leaves().to_vec();
            world.0.iter_mut().for_each(RegionHost::follow_schedules);
            let mut random = seed;
            let mut behind_most = 0;
            for _ in 0..90 {
                let mut is_behind = |_: &&RegionId| {
                    random = drawn(random);
                    random % 3 > 0
                };
                let behind = regions.iter().filter(|region| is_behind(region)).copied().collect();
                let schedule = Schedule { behind, behind_most: 3, ..Schedule::default() };
                world.0.iter_mut().for_each(|host| host.keep(&schedule));
                world.step();
                let late =
                    world.0.iter().flat_map(|host| host.region_states()).map(|state| state.behind).max();
                behind_most = behind_most.max(late.unwrap());
            }
            assert_eq!(behind_most, 3, "{name}");
            assert_eq!(world.states().len(), bodies, "{name}");
        }
    }
}
