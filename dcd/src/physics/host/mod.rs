//! Steps the regions that one process computes, tick by tick, and exchanges their messages. In a local world
//! these are all regions, on a node some of them.

mod borders;
mod change;
mod checkpoint;
mod contents;
mod error;
mod exchange;
mod fidelity;
mod giants;
mod holders;
mod neighbours;
mod place;
#[cfg(test)]
pub(super) mod processes;
#[cfg(test)]
mod quiet;
mod rebuild;
mod repartition;
mod replace;
mod report;
mod rolling;
mod rounds;
mod tasks;
mod teams;
mod threads;
mod validate;

pub use self::borders::BorderView;
pub(in crate::physics) use self::change::MOST_M_S;
pub(crate) use self::checkpoint::Checkpoint;
pub use self::error::HostError;
pub use self::tasks::Tasks;
pub use self::validate::Inconsistency;

use std::cmp::Reverse;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rapier3d::prelude::IntegrationParameters;
use serde::{Deserialize, Serialize};

use self::threads::{Threads, Trial, WORTH_WAITING};
use super::coupling::{Moment, Side, meet_in};
use super::hooks::ContactHooks;
use super::owner_index::{Home, OwnerIndex};
use super::partition::Partition;
use super::region::{Ownership, Region};
use super::settings::StepSettings;
use super::shapes::ShapeLibrary;
use super::spread::Team;
use super::statics::Statics;
use crate::fidelity::{Audited, Governor, relative_time};
use crate::protocol::{BorderMessage, Handover};
use crate::space::{RegionId, RegionSet, Tick};

/// Some regions of a world, stepped together. Its serde form is part of snapshots
/// ([`LocalWorld::save`](crate::runtime::LocalWorld::save)) and is checked by nothing else.
#[derive(Clone, Serialize, Deserialize)]
pub struct RegionHost {
    partition: Arc<Partition>,
    settings: StepSettings,
    shapes: ShapeLibrary,
    statics: Statics,
    /// The regions computed here, each with its side of its borders, in rank order.
    sides: Vec<Side>,
    /// The place of each region in `sides`, by rank; none for a region computed elsewhere.
    place_of: Vec<Option<usize>>,
    owner_index: OwnerIndex,
    #[serde(skip)]
    hooks: Option<Arc<dyn ContactHooks>>,
    #[serde(skip)]
    threads: Threads,
    /// Only the time that a tick takes depends on it.
    #[serde(skip)]
    trial: Trial,
    /// Messages from regions computed elsewhere, for the next exchange.
    incoming: Vec<BorderMessage>,
    balancer: Option<repartition::Balancer>,
    #[serde(skip)]
    giants: giants::KnownGiants,
    /// Says whether all regions meet in the next tick, not only neighbours. `meets_always`: whether they do in
    /// every tick.
    meets: bool,
    meets_always: bool,
    /// Says whether all that the world begins with has been placed as one scene.
    is_placed: bool,
    /// Says whether all regions know which cells of the present tree are near theirs.
    #[serde(skip)]
    settled: bool,
    /// Says whether owners may not know who holds their bodies, because membership has changed.
    #[serde(skip)]
    holders_unsure: bool,
    /// Chooses the rates at which regions are stepped; none where all is computed in full.
    governor: Option<Governor>,
    /// Says whether the leader of a group chooses which regions stay behind, not this process.
    #[serde(skip)]
    is_scheduled: bool,
    /// The regions that stay behind in the tick under way, by rank.
    #[serde(skip)]
    behind: RegionSet,
    /// The number of ticks for which each region has stayed behind, by rank, where the leader chooses.
    #[serde(skip)]
    late: Vec<u8>,
    /// The most ticks that any region may be behind after the tick that follows the one under way, as the
    /// schedule says.
    #[serde(skip)]
    behind_most: u8,
    /// The audits of the tick under way.
    #[serde(skip)]
    auditing: fidelity::Audits,
    /// What the last audit found, and in which region, if it was in the last tick.
    #[serde(skip)]
    audited: Option<(RegionId, Audited)>,
    tick: Tick,
    /// Rounds of the tick to come; `round` is how many of them are done.
    rounds: usize,
    round: usize,
    /// Rounds of the last tick.
    rounds_done: usize,
    /// Wall time of the exchanges of the present tick.
    #[serde(skip)]
    exchange_time: Duration,
    transfers: u64,
    /// The handovers of the last step, and of insertions since.
    handovers: Vec<Handover>,
    /// The handovers since the last step, of regions that caught up: the next step tells of them.
    #[serde(skip)]
    early_handovers: Vec<Handover>,
    #[serde(skip)]
    rolls: rolling::Rolls,
}

impl RegionHost {
    /// Creates an empty host of the regions named, which must be leaves of the partition's tree.
    ///
    /// For `threads` see [`RegionHost::set_threads`].
    pub fn new(
        partition: Partition,
        settings: StepSettings,
        threads: usize,
        hosted: &[RegionId],
    ) -> Result<Self, HostError> {
        let mut host = Self {
            place_of: vec![None; partition.len()],
            partition: Arc::new(partition),
            settings,
            shapes: ShapeLibrary::default(),
            statics: Statics::default(),
            sides: Vec::new(),
            owner_index: OwnerIndex::default(),
            hooks: None,
            threads: Threads::default(),
            trial: Trial::default(),
            incoming: Vec::new(),
            balancer: None,
            giants: giants::KnownGiants::default(),
            meets: true,
            meets_always: false,
            is_placed: false,
            settled: false,
            holders_unsure: false,
            governor: None,
            is_scheduled: false,
            behind: RegionSet::EMPTY,
            late: Vec::new(),
            behind_most: 0,
            auditing: fidelity::Audits::default(),
            audited: None,
            tick: Tick(0),
            rounds: settings.coupling.first_steps(settings.exchanges),
            round: 0,
            rounds_done: 0,
            exchange_time: Duration::ZERO,
            transfers: 0,
            handovers: Vec::new(),
            early_handovers: Vec::new(),
            rolls: rolling::Rolls::new(),
        };
        for &region in hosted {
            host.add_region(region);
        }
        host.set_threads(threads)?;
        Ok(host)
    }

    /// Completes a restore from a snapshot: tells Rapier again what its own part of the snapshot left out.
    pub(crate) fn resume(&mut self) {
        for Side { region, border, .. } in &mut self.sides {
            region.repeat_joint_changes();
            region.find_awake();
            border.resume();
        }
    }

    /// Returns the contact hooks that are called.
    pub(crate) fn hooks(&self) -> Option<&Arc<dyn ContactHooks>> {
        self.hooks.as_ref()
    }

    /// Takes over the threads and hooks of the host that this one replaces.
    pub(crate) fn serve_as(&mut self, former: &Self) -> Result<(), HostError> {
        (self.threads, self.trial) = (former.threads.clone(), former.trial.clone());
        self.set_hooks(former.hooks.clone());
        self.threads.suit(self.sides.len())
    }

    /// Sets the contact hooks of every region; `None` removes them.
    pub fn set_hooks(&mut self, hooks: Option<Arc<dyn ContactHooks>>) {
        for side in &mut self.sides {
            side.region.set_hooks(hooks.clone());
        }
        self.hooks = hooks;
    }

    /// Returns the shapes of this process.
    pub fn shapes(&self) -> &ShapeLibrary {
        &self.shapes
    }

    /// Returns the shapes of this process, to describe bodies by Rapier's builders.
    pub fn shapes_mut(&mut self) -> &mut ShapeLibrary {
        &mut self.shapes
    }

    /// Computes the first half of a round: every region that is due takes a substep and writes the messages
    /// to its neighbours.
    pub fn compute(&mut self) {
        self.on_threads(Self::compute_here);
    }

    fn compute_here(&mut self) {
        self.round += 1;
        let (settings, coarsest) = (self.settings, self.coarsest());
        let (tick, rounds, round) = (self.tick.next(), self.rounds, self.round);
        let partition = Arc::clone(&self.partition);
        if round == 1 {
            self.exchange_time = Duration::ZERO;
            for side in &mut self.sides {
                let rests = side.is_idle();
                side.region.begin_tick(rests);
            }
            self.meet(self.meets || self.meets_always || meet_in(tick));
            let moment = Moment::new(&partition, &settings, tick, rounds, round, coarsest);
            for side in self.sides.iter_mut().filter(|side| side.steps_now()) {
                settings.coupling.begin(side, moment);
            }
        }
        let is_due = move |side: &Side, moment: &Moment<'_>| side.steps_now() && moment.is_due(side.steps());
        let moment = Moment::new(&self.partition, &settings, tick, rounds, round, coarsest);
        let mut any_is_due = false;
        for side in &mut self.sides {
            if is_due(side, &moment) {
                any_is_due = true;
            } else {
                side.outbox.clear(tick);
            }
        }
        let statics = self.statics.clone();
        let step = move |side: &mut Side| {
            let start = Instant::now();
            let (steps, clock, dt_s) = (side.steps(), side.clock, side.substep_s(settings.dt_s));
            let region = &mut side.region;
            // A region with fewer substeps than the rest of the world begins its tick in a later round.
            let begins = region.begins_tick();
            if begins {
                region.shift_origin(tick, clock.span, |id| statics.pose(id));
                region.time_mut().begin(clock.span, relative_time(settings.solver_iterations, clock.span));
            }
            settings.coupling.prepare(region, dt_s);
            let parameters = region.refined(IntegrationParameters {
                dt: dt_s,
                num_solver_iterations: clock.iterations(settings.solver_iterations).div_ceil(steps).max(1),
                ..settings.integration
            });
            region.step(&parameters, steps);
            side.region.time_mut().add(start.elapsed());
        };
        let gather = move |side: &mut Side, team: Team| {
            let start = Instant::now();
            let moment = Moment::new(&partition, &settings, tick, rounds, round, coarsest);
            let dt_s = side.substep_s(settings.dt_s);
            settings.coupling.gather(side, Moment { dt_s, team, ..moment });
            side.region.time_mut().add(start.elapsed());
        };
        if self.threads.are_entered() {
            let by_all = self.one_by_one();
            let due = self.sides.iter_mut().enumerate().filter(|(_, side)| is_due(side, &moment));
            let due = due.map(|(place, side)| (by_all.contains(&place), side));
            let (mut by_all, mut others): (Vec<_>, Vec<_>) = due.partition(|(is_by_all, _)| *is_by_all);
            let awake = |side: &Side| side.region.physics().islands.num_active_bodies();
            let all_awake =
                |sides: &[(bool, &mut Side)]| sides.iter().map(|(_, side)| awake(side)).sum::<usize>();
            // All threads gather what the region tells others, unless these have enough to do meanwhile.
            let is_alone = by_all.len() == 1 && all_awake(&others) * WORTH_WAITING < all_awake(&by_all);
            for (_, side) in &mut by_all {
                self.threads.together(|| {
                    step(side);
                    if is_alone {
                        gather(side, Team::here());
                    }
                });
            }
            if is_alone {
                by_all.clear();
            }
            for sides in [&mut by_all, &mut others] {
                sides.sort_by_key(|(_, side)| Reverse(awake(side)));
            }
            self.threads.share_out(by_all.iter_mut().chain(&mut others).collect(), |(is_stepped, side)| {
                if !*is_stepped {
                    step(side);
                }
                gather(side, Team::here());
            });
        } else if any_is_due {
            let partition = Arc::clone(&self.partition);
            threads::alone(&mut self.sides, move |sides| {
                let moment = Moment::new(&partition, &settings, tick, rounds, round, coarsest);
                for side in sides.iter_mut().filter(|side| is_due(side, &moment)) {
                    step(side);
                    gather(side, Team::ALONE);
                }
            });
        }
    }

    /// Steps a host that computes every region by a whole tick.
    pub fn step(&mut self) -> Result<(), HostError> {
        assert_eq!(
            self.sides.len(),
            self.partition.len(),
            "a node's exchange needs its neighbours' messages"
        );
        // The teams are entered once per tick, so that the threads stay awake between its halves.
        self.on_threads(Self::step_all)
    }

    fn step_all(&mut self) -> Result<(), HostError> {
        self.handovers = std::mem::take(&mut self.early_handovers);
        if self.partition.len() > 1 {
            self.expect_launched();
        }
        if self.partition.len() > 1 && self.regions().any(|region| region.fresh().next().is_some()) {
            let fresh = self.regions().flat_map(Region::fresh).map(|link| link.id);
            let fresh: Vec<_> = fresh.collect();
            self.announce();
            self.exchange_here()?;
            self.target_newcomers(&fresh);
        }
        self.govern();
        for _ in 0..self.rounds {
            self.compute_here();
            self.exchange_here()?;
        }
        self.conclude();
        // The sort is stable: the handovers of a body that went twice stay in order.
        self.handovers.sort_by_key(|handover| handover.body);
        self.roll_wheels();
        self.end_tick();
        self.set_rounds(self.rounds_wanted());
        Ok(())
    }

    /// Marks bodies to be announced that their user sped up since the last step and that fly into other
    /// regions soon. All regions meet if one flies far.
    fn expect_launched(&mut self) {
        let settings = self.settings;
        let moment = Moment::new(&self.partition, &settings, self.tick, self.rounds, 0, self.coarsest());
        for side in &mut self.sides {
            self.meets |= settings.coupling.expect(side, moment);
        }
    }

    /// Ends the tick and counts it.
    pub fn end_tick(&mut self) {
        self.tick = self.tick.next();
        self.rounds_done = std::mem::take(&mut self.round);
        self.meets = false;
        #[cfg(feature = "validate")]
        assert_eq!(self.validate(), [], "after tick {}", self.tick.0);
    }

    /// Returns the ticks since the world began.
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Sets the clock of a host that joins a running world.
    pub fn set_tick(&mut self, tick: Tick) {
        self.tick = tick;
    }

    /// Returns the settings by which the world is stepped.
    pub fn settings(&self) -> &StepSettings {
        &self.settings
    }

    /// Returns the partition of the world into regions.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// Returns the regions computed here, in rank order.
    pub fn regions(&self) -> impl ExactSizeIterator<Item = &Region> + Clone {
        self.sides.iter().map(|side| &side.region)
    }

    /// Returns the region of a rank, if it is computed here.
    #[inline]
    fn region_at(&self, rank: usize) -> Option<&Region> {
        Some(&self.sides[self.place_of[rank]?].region)
    }

    fn index(&mut self) {
        self.giants.forget();
        self.place_of.fill(None);
        for (place, side) in self.sides.iter().enumerate() {
            self.place_of[side.region.rank()] = Some(place);
        }
        self.settled = false;
        self.owner_index = OwnerIndex::default();
        for Side { region, .. } in &self.sides {
            for (id, role, handle, _) in region.bodies() {
                if role == Ownership::Owner {
                    self.owner_index.set(id, Home { rank: region.rank(), handle });
                }
            }
        }
    }
}
