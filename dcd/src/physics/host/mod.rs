//! The regions that one process computes: all of them in a local world, some of them on a node.

mod borders;
mod change;
mod giants;
mod place;
mod repartition;
mod replace;
mod rounds;
mod threads;

pub use self::borders::BorderView;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use self::threads::{Threads, Trial, WORTH_WAKING};
use super::coupling::{Coupling, Ground, Moment};
use super::directory::{Directory, Home};
use super::follow;
use super::hooks::ContactHooks;
use super::outbox::Outbox;
use super::partition::Partition;
use super::region::{Region, Role};
use super::shapes::{ShapeError, ShapeLibrary};
use super::statics::Statics;
use crate::protocol::{
    BIG_ISLAND, BodyRecord, BorderMessage, Handover, JointRecord, RegionEvents, Velocity, WorldPose,
};
use crate::space::{BodyId, JointId, RegionId, Tick};

/// No island is too large to be in one region whole: the most that may be asked for.
const WHOLE: usize = BIG_ISLAND as usize - 1;

/// How a world is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepSettings {
    /// m/s².
    pub gravity: [f32; 3],
    /// Seconds a tick.
    pub dt_s: f32,
    /// Solver iterations a tick, shared out among its micro-steps.
    pub solver_iterations: usize,
    /// How regions agree.
    pub coupling: Coupling,
    /// Micro-steps a tick, with an exchange after each; with [`Coupling::Auto`] the most that a border may take.
    pub exchanges: usize,
    /// Contact hops across a border within which bodies live in both regions, for couplings that overlap.
    pub depth: usize,
    /// The most bodies of an island that moves whole, for couplings that move islands; up to 65,534, which is as good as no limit.
    pub island_limit: usize,
    /// The disagreement of replicas that [`Coupling::Auto`] tolerates, in metres per second.
    pub tolerance_m_s: f32,
    /// All else that Rapier's solver may be told, in every region alike; its `dt` and `num_solver_iterations` are those above. A
    /// served world has Rapier's own.
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

/// How much accuracy a world asks of [`Coupling::Auto`].
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
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Draft, Self::Game, Self::Precise];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Game => "game",
            Self::Precise => "precise",
        }
    }
}

impl StepSettings {
    /// The same with another coupling, and the exchanges that are usual for it.
    pub fn with_coupling(self, coupling: Coupling) -> Self {
        Self { coupling, exchanges: coupling.usual_exchanges(), ..self }
    }

    /// The same with [`Coupling::Auto`] and what the preset stands for.
    pub fn with_preset(self, preset: Preset) -> Self {
        let (exchanges, depth, island_limit, tolerance_m_s) = match preset {
            Preset::Draft => (2, 2, 256, 0.1),
            Preset::Game => (4, 2, WHOLE, 0.03),
            Preset::Precise => (4, 3, WHOLE, 0.01),
        };
        Self { coupling: Coupling::Auto, exchanges, depth, island_limit, tolerance_m_s, ..self }
    }
}

/// Why a host cannot do what it is asked.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// A shape cannot be held.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The operating system gives no threads.
    #[error("cannot start {threads} threads: {cause}; ask for fewer")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// The system's reason.
        cause: rayon::ThreadPoolBuildError,
    },
    /// The name is taken.
    #[error("{0} is in the world already; every body has one id")]
    Taken(BodyId),
    /// A joint ties a body that is not there.
    #[error("joint {joint} ties {body}, which is not in the world; insert both bodies first")]
    Untied {
        /// Which joint.
        joint: JointId,
        /// Which body.
        body: BodyId,
    },
    /// Rapier cannot have the joint in a multibody.
    #[error("multibody joint {joint} to {body}: {cause}")]
    Link {
        /// Which joint.
        joint: JointId,
        /// Its second body.
        body: BodyId,
        /// What is wrong, and what to do.
        cause: &'static str,
    },
    /// A number that must be finite is not, or a rotation is not a unit quaternion.
    #[error(
        "{0} has a pose or velocity that is not finite, or a rotation that is not a unit quaternion; check its numbers"
    )]
    NotFinite(BodyId),
}

/// Some regions of a world, stepped together. Its serde form is part of snapshots
/// ([`DcdWorld::save`](crate::runtime::DcdWorld::save)) and is checked by nothing else.
#[derive(Serialize, Deserialize)]
pub struct RegionHost {
    partition: Arc<Partition>,
    settings: StepSettings,
    shapes: ShapeLibrary,
    statics: Statics,
    /// Those computed here, in rank order.
    regions: Vec<Region>,
    /// By rank: where in `regions`.
    place_of: Vec<Option<usize>>,
    directory: Directory,
    #[serde(skip)]
    hooks: Option<Arc<dyn ContactHooks>>,
    #[serde(skip)]
    threads: Threads,
    /// Only what it takes to compute depends on it.
    #[serde(skip)]
    trial: Trial,
    /// From regions computed elsewhere, for the exchange that is open.
    incoming: Vec<BorderMessage>,
    balancer: Option<repartition::Balancer>,
    tick: Tick,
    /// Rounds of the tick to come, and how many of them are done.
    rounds: usize,
    round: usize,
    /// Rounds of the last tick.
    rounds_done: usize,
    transfers: u64,
    /// Of the last step, and of insertions since.
    handovers: Vec<Handover>,
}

impl RegionHost {
    /// An empty host of the regions named, which must be leaves of the partition's tree.
    ///
    /// As [`RegionHost::set_threads`] says of `threads`.
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
            regions: Vec::new(),
            directory: Directory::default(),
            hooks: None,
            threads: Threads::default(),
            trial: Trial::default(),
            incoming: Vec::new(),
            balancer: None,
            tick: Tick(0),
            rounds: settings.coupling.first_steps(settings.exchanges),
            round: 0,
            rounds_done: 0,
            transfers: 0,
            handovers: Vec::new(),
        };
        for &region in hosted {
            host.add_region(region);
        }
        host.set_threads(threads)?;
        Ok(host)
    }

    /// Restored from a snapshot: Rapier hears again what its own part of the snapshot left out.
    pub(crate) fn resume(&mut self) {
        self.regions.iter_mut().for_each(Region::repeat_joint_changes);
    }

    /// Steps by so many threads from now on; 1 uses the calling thread, which few bodies do anyhow. What happens does not depend
    /// on it. With the feature `parallel` the only region has all of them, several share them out; without, each has one.
    pub fn set_threads(&mut self, threads: usize) -> Result<(), HostError> {
        self.threads = Threads::new(threads, self.regions.len())?;
        Ok(())
    }

    /// How many threads step it.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Takes over threads and hooks of a host whose place this one takes.
    pub(crate) fn serve_as(&mut self, former: &Self) -> Result<(), HostError> {
        self.threads = former.threads.clone();
        self.set_hooks(former.hooks.clone());
        self.threads.suit(self.regions.len())
    }

    /// Whether so much is awake that it may be worth waking other threads.
    fn is_busy(&self) -> bool {
        let awake = self.regions.iter().flat_map(|region| region.physics().islands.active_bodies());
        self.threads.are_teams() && awake.take(WORTH_WAKING).count() == WORTH_WAKING
    }

    /// Does the work of a tick on the threads on which it takes least time.
    fn on_threads<R: Send>(&mut self, work: impl FnOnce(&mut Self) -> R + Send) -> R {
        if !self.is_busy() {
            return work(self);
        }
        let start = Instant::now();
        let done =
            if self.trial.is_for_teams() { self.threads.clone().enter(|| work(self)) } else { work(self) };
        self.trial.note(start.elapsed());
        done
    }

    /// Asks these hooks about contacts in every region from now on; `None` asks nobody.
    pub fn set_hooks(&mut self, hooks: Option<Arc<dyn ContactHooks>>) {
        for region in &mut self.regions {
            region.hooks = hooks.clone();
        }
        self.hooks = hooks;
    }

    /// The shapes of this process.
    pub fn shapes(&self) -> &ShapeLibrary {
        &self.shapes
    }

    /// The same, to describe bodies by Rapier's builders.
    pub fn shapes_mut(&mut self) -> &mut ShapeLibrary {
        &mut self.shapes
    }

    /// The first half of a round: every region that is to step in it does, and says what its neighbours must know.
    pub fn compute(&mut self) {
        self.on_threads(Self::compute_here);
    }

    fn compute_here(&mut self) {
        self.round += 1;
        let settings = self.settings;
        let (tick, rounds, round) = (self.tick.next(), self.rounds, self.round);
        let partition = Arc::clone(&self.partition);
        if round == 1 {
            for region in &mut self.regions {
                region.rests = region.is_idle();
            }
        }
        let is_due =
            move |region: &Region, moment: &Moment<'_>| !region.rests && moment.is_due(region.steps());
        let moment = Moment::new(&self.partition, &settings, tick, rounds, round);
        let mut any_is_due = false;
        for region in &mut self.regions {
            if is_due(region, &moment) {
                any_is_due = true;
            } else {
                region.be_silent(tick);
            }
        }
        let step = move |region: &mut Region| {
            let start = Instant::now();
            let moment = Moment::new(&partition, &settings, tick, rounds, round);
            let steps = region.steps();
            if round == 1 {
                follow::follow(region, tick);
            }
            let moment = Moment { dt_s: settings.dt_s / steps as f32, ..moment };
            settings.coupling.prepare(region, moment.dt_s);
            region.step(&IntegrationParameters {
                dt: moment.dt_s,
                num_solver_iterations: settings.solver_iterations.div_ceil(steps).max(1),
                ..settings.integration
            });
            settings.coupling.gather(region, moment);
            region.count_time(start.elapsed(), round == 1);
        };
        if self.threads.are_entered() {
            let heaviest = heaviest(&self.regions);
            let due = self.regions.iter_mut().enumerate().filter(|(_, region)| is_due(region, &moment));
            let (heavy, others): (Vec<_>, Vec<_>) = due.partition(|(place, _)| Some(*place) == heaviest);
            // First, with all threads: one alone would be at it when all others have long been done.
            for (_, region) in heavy {
                self.threads.together(|| step(region));
            }
            self.threads.share_out(others.into_iter().map(|(_, region)| region).collect(), step);
        } else if any_is_due {
            let partition = Arc::clone(&self.partition);
            threads::alone(&mut self.regions, move |regions| {
                let moment = Moment::new(&partition, &settings, tick, rounds, round);
                regions.iter_mut().filter(|region| is_due(region, &moment)).for_each(step);
            });
        }
    }

    /// What regions here have to say to regions elsewhere, non-empty messages only.
    pub fn outgoing(&self) -> impl Iterator<Item = &BorderMessage> {
        let letters = self.regions.iter().flat_map(|region| region.outbox.letters());
        letters.filter(|(rank, _)| self.place_of[*rank].is_none()).map(|(_, message)| message)
    }

    /// Hands in what a region computed elsewhere said; the exchange takes it in.
    pub fn accept(&mut self, message: BorderMessage) {
        self.incoming.push(message);
    }

    /// Takes in what was accepted, and nothing else: no tick ends with it.
    pub fn drain(&mut self) -> Result<(), HostError> {
        let tick = self.tick;
        self.regions.iter_mut().for_each(|region| region.outbox.clear(tick));
        self.exchange()
    }

    /// The second half: every region takes in what the others said, in rank order.
    pub fn exchange(&mut self) -> Result<(), HostError> {
        if self.is_busy() && self.trial.is_for_teams() {
            self.threads.clone().enter(|| self.exchange_here())
        } else {
            self.exchange_here()
        }
    }

    fn exchange_here(&mut self) -> Result<(), HostError> {
        if self.partition.len() > 1 {
            let outboxes: Vec<_> =
                self.regions.iter_mut().map(|region| std::mem::take(&mut region.outbox)).collect();
            let ground = Ground { partition: &self.partition, shapes: &self.shapes, statics: &self.statics };
            let (incoming, place_of, settings) = (&self.incoming, &self.place_of, self.settings);
            let (tick, rounds, round) = (self.tick.next(), self.rounds, self.round);
            let moment = Moment::new(&self.partition, &settings, tick, rounds, round);
            let failure = std::sync::Mutex::new(None);
            let mut inboxes = vec![Vec::new(); self.regions.len()];
            let here = outboxes.iter().flat_map(Outbox::letters);
            let elsewhere = incoming.iter().map(|message| {
                (ground.partition.rank_of(message.to).expect("messages go to regions of this tree"), message)
            });
            for (rank, message) in here.chain(elsewhere) {
                if let Some(place) = place_of[rank] {
                    inboxes[place].push(message);
                }
            }
            // Ids are in rank order; what one region said in several ticks stays in order.
            inboxes.iter_mut().for_each(|inbox| inbox.sort_by_key(|message| message.from));
            let inbox_of = |region: &Region| &inboxes[place_of[region.rank()].expect("hosted here")];
            let is_due = |region: &Region| {
                moment.is_due(region.steps()) && !(region.rests && inbox_of(region).is_empty())
            };
            let due = self.regions.iter_mut().filter(|region| is_due(region)).collect();
            self.threads.share_out(due, |region| {
                let inbox = inbox_of(region);
                region.stirred |= !inbox.is_empty();
                if let Err(error) = settings.coupling.apply(region, inbox.iter().copied(), ground, moment) {
                    failure.lock().expect("no panic while locked").get_or_insert(error);
                }
            });
            for (region, outbox) in self.regions.iter_mut().zip(outboxes) {
                region.outbox = outbox;
            }
            self.incoming.clear();
            self.note_arrivals();
            if let Some(error) = failure.into_inner().expect("no panic while locked") {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// A whole tick of a host that computes every region.
    pub fn step(&mut self) -> Result<(), HostError> {
        assert_eq!(
            self.regions.len(),
            self.partition.len(),
            "a node's exchange needs its neighbours' messages"
        );
        // One entry a tick: between its halves the threads stay awake.
        self.on_threads(Self::step_all)
    }

    fn step_all(&mut self) -> Result<(), HostError> {
        self.handovers.clear();
        if self.partition.len() > 1 && self.regions.iter().any(|region| !region.fresh.is_empty()) {
            let fresh = self.regions.iter().flat_map(|region| &region.fresh).map(|link| link.id);
            let fresh: Vec<_> = fresh.collect();
            self.announce();
            self.exchange_here()?;
            self.guide_newcomers(&fresh);
        }
        for _ in 0..self.rounds {
            self.compute_here();
            self.exchange_here()?;
        }
        // Stable: a body that went twice has its ways in order.
        self.handovers.sort_by_key(|handover| handover.body);
        self.end_tick();
        self.set_rounds(self.rounds_wanted());
        Ok(())
    }

    /// The tick is over: counts it.
    pub fn end_tick(&mut self) {
        self.tick = self.tick.next();
        self.rounds_done = std::mem::take(&mut self.round);
    }

    /// What the regions saw of contacts since [`RegionHost::clear_events`], in rank order.
    pub fn events(&self) -> impl Iterator<Item = &RegionEvents> {
        self.regions.iter().map(|region| &region.events)
    }

    /// Forgets what the regions saw.
    pub fn clear_events(&mut self) {
        for region in &mut self.regions {
            region.events.touches.clear();
            region.events.forces.clear();
        }
    }

    /// Ticks since the world began.
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Sets the clock of a host that joins a running world.
    pub fn set_tick(&mut self, tick: Tick) {
        self.tick = tick;
    }

    /// How it is stepped.
    pub fn settings(&self) -> &StepSettings {
        &self.settings
    }

    /// Where the regions are.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// The regions computed here, in rank order.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Bodies that changed owner since the host was made, counted by the new owner.
    pub fn transfers(&self) -> u64 {
        self.transfers
    }

    /// Bodies that regions here gave to others in the last [`RegionHost::step`], in id order.
    pub fn handovers(&self) -> &[Handover] {
        &self.handovers
    }

    /// The owner's copy of a movable body, if its region is computed here.
    #[inline]
    pub fn owned(&self, id: BodyId) -> Option<(&Region, RigidBodyHandle)> {
        let home = self.directory.home(id)?;
        let region = &self.regions[self.place_of[home.rank]?];
        Some((region, home.handle))
    }

    /// An immovable body by name.
    pub fn immovable(&self, id: BodyId) -> Option<&BodyRecord> {
        self.statics.body(id)
    }

    /// A body, whole: as its owner has it, if that is here, else as a replica has it.
    pub fn record(&self, id: BodyId) -> Option<BodyRecord> {
        if let Some(body) = self.statics.body(id) {
            return Some(body.clone());
        }
        if let Some((region, handle)) = self.owned(id) {
            return Some(region.body_record(handle));
        }
        self.regions.iter().find_map(|region| Some(region.body_record(region.handle_of(id)?)))
    }

    /// The joints of one body, whole, in order of insertion.
    pub fn joints_of(&self, id: BodyId) -> impl Iterator<Item = JointRecord> {
        let held = self.regions.iter().find_map(|region| Some((region, region.handle_of(id)?)));
        held.into_iter().flat_map(|(region, handle)| region.joints_of(handle))
    }

    /// Every movable body owned here in id order, with its region.
    pub fn states(&self) -> impl Iterator<Item = (BodyId, RegionId, WorldPose, Velocity)> {
        self.owned_bodies().map(|(id, region, handle)| {
            let (pose, velocity) = region.motion(handle);
            (id, region.id(), pose, velocity)
        })
    }

    /// Every movable body owned here in id order, with its region and Rapier's handle there.
    pub fn owned_bodies(&self) -> impl Iterator<Item = (BodyId, &Region, RigidBodyHandle)> {
        self.directory
            .homes()
            .filter_map(|(id, home)| Some((id, &self.regions[self.place_of[home.rank]?], home.handle)))
    }

    /// Every movable body held here, owned or replica, in id order.
    pub fn held_bodies(&self) -> BTreeSet<BodyId> {
        let held = self.regions.iter().flat_map(Region::bodies);
        held.map(|(id, ..)| id).filter(|&id| self.statics.body(id).is_none()).collect()
    }

    /// Every immovable body of the world, in id order.
    pub fn scenery(&self) -> impl Iterator<Item = &BodyRecord> {
        self.statics.bodies()
    }

    /// How many movable bodies are owned here.
    pub fn owned_count(&self) -> usize {
        self.directory.len()
    }

    fn index(&mut self) {
        self.place_of.fill(None);
        for (place, region) in self.regions.iter().enumerate() {
            self.place_of[region.rank()] = Some(place);
        }
        self.directory = Directory::default();
        for region in &self.regions {
            for (id, role, handle, _) in region.bodies() {
                if role == Role::Owner {
                    self.directory.set(id, Home { rank: region.rank(), handle });
                }
            }
        }
    }

    fn note_arrivals(&mut self) {
        for (_, message) in self.regions.iter().flat_map(|region| region.outbox.letters()) {
            for transfer in &message.transfers {
                self.directory.remove(transfer.body.id);
                self.handovers.push(Handover { body: transfer.body.id, from: message.from, to: message.to });
            }
        }
        for region in &mut self.regions {
            let rank = region.rank();
            self.transfers += region.arrived.len() as u64;
            // Once: what arrived may be gone when the region, at rest, has not looked at its letters since.
            for link in region.arrived.drain(..) {
                self.directory.set(link.id, Home { rank, handle: link.handle });
            }
        }
    }
}
/// The region that has more than half of all awake bodies, if it is worth more than one thread.
fn heaviest(regions: &[Region]) -> Option<usize> {
    let awake = |region: &Region| region.physics().islands.active_bodies().count();
    let (place, most) = regions.iter().map(awake).enumerate().max_by_key(|&(_, awake)| awake)?;
    let all: usize = regions.iter().map(awake).sum();
    (2 * most > all && most >= 4 * WORTH_WAKING).then_some(place)
}
