//! Runs one seed as a trial: a cluster with users, scheduled faults, a calm end, and conditions that must
//! hold all the while.

mod acts;
mod groups;
mod looks;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use self::groups::Lately;
pub use self::looks::Staleness;
use super::faults::{FaultProfile, Moment, Planned, Promise, Schedule};
use super::{
    Bounds, Comparer, Flipped, NetworkConditions, Path, Random, Ruler, Sim, SimConfig, Spoilt, Strain, Tally,
    Tape, Timeline, Traffic, Violation, Watch, sim_world,
};
use crate::cluster::Peer;
use crate::protocol::{DelayThresholds, MAX_STATE_TICKS, SyncProtocol, Thresholds, Velocity};
use crate::space::{ClientId, NodeId, Tick};

/// The longest time from the beginning of the calm until all is well.
const CALM: Duration = Duration::from_secs(15);
/// The same where groups depend on delay: a node that was parted from its group stays out for a minute, then
/// votes are held every half minute.
const CALM_APART: Duration = Duration::from_secs(150);
/// The time for which all then has to stay well.
const AFTERMATH: Duration = Duration::from_secs(3);
/// The length from which on a time without ticks is noted.
const LONG_PAUSE: Duration = Duration::from_secs(1);
/// The time that a fault waits for its moment.
const PATIENCE: Duration = Duration::from_secs(1);
/// The thresholds that make the nodes of one site a group, where there are several sites.
const DELAYS: DelayThresholds =
    DelayThresholds { inclusion_ms: 30.0, rejection_ms: 60.0, deviation_ms: 30.0 };
/// The speed of bodies along each axis with several sites: a group's extrapolation of another's bodies then
/// holds, except just after a bounce.
const SLOW_M_S: f64 = 2.0;
/// How many times slower a slow node is.
const SLOWER: f64 = 10.0;
/// The additional recovery time of a world of one node: no node goes on without it until the server has given
/// it up.
const ALONE: Duration = Duration::from_secs(5);
/// The largest error of bodies that fly straight on, metres and metres per second.
const ROUNDING: f64 = 1e-3;
/// The number of ticks between comparisons of groups.
const SAMPLES: u64 = 3;
/// The interval of checks of conditions that no event reports. It is out of step with ticks.
const LOOK: Duration = Duration::from_millis(47);

/// The cluster of a trial.
#[derive(Clone, Copy, Debug)]
pub struct TrialConfig {
    /// The number of nodes at each site.
    pub nodes: u32,
    /// The number of clients at each site, with an avatar each. Where there are several sites, each client is
    /// in one process with a node of its site.
    pub clients: u32,
    /// The number of regions of the world.
    pub regions: usize,
    /// The function that begins the cluster with its world: bodies that fly straight on, or a scene.
    pub begin: fn(SimConfig) -> Sim,
    /// The number of persistent bodies, where they fly straight on.
    pub bodies: u32,
    /// The number of ticks per second.
    pub rate: u32,
    /// How many ticks members may be apart; 0: they keep in step.
    pub lag_ticks: u32,
    /// A bug to plant: this number of transfers is lost after the third second.
    pub lost_transfers: u32,
    /// A bug to plant: every transfer is spoilt after the third second.
    pub spoilt: Option<Spoilt>,
    /// A bug to plant: a bit of a body is flipped after this tick, on one of the first nodes.
    pub flip: Option<Tick>,
    /// Says whether nodes and servers are recorded.
    pub record: bool,
    /// Says whether two of three nodes are participants that are verified.
    pub verify: bool,
    /// The number of clients that a leader tells itself; `None`: all.
    pub relays_above: Option<u32>,
}

impl Default for TrialConfig {
    fn default() -> Self {
        Self {
            nodes: 4,
            clients: 2,
            regions: 8,
            begin: fly,
            bodies: 30,
            rate: 30,
            lag_ticks: 0,
            lost_transfers: 0,
            spoilt: None,
            flip: None,
            record: false,
            verify: false,
            relays_above: None,
        }
    }
}

/// Starts a cluster of bodies that fly straight on, with a watch that they do.
fn fly(config: SimConfig) -> Sim {
    let mut sim = Sim::new(config);
    // A body that comes late, or that another group corrects, does not fly straight.
    if sim.config.protocol.lag_ticks() == 0 && sim.config.thresholds.delay.is_none() {
        let bodies: Vec<_> = sim.server().record().present().cloned().collect();
        let room = sim_world(sim.config.regions).tree.bounds();
        let ruler = Ruler::new(sim.config.dt_s, &bodies, &[]).flying(room, 0.0).passing(&bodies);
        sim.watch(Watch::new(ruler, Strain::each(|_| ROUNDING)));
    }
    sim
}

/// The outcome of a trial.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The violation, if any.
    pub violation: Option<Violation>,
    /// The longest time from a fault, or its end, until the main group computed on in one membership of live
    /// nodes. With several sites, every group with a live member must.
    pub worst_recovery: Duration,
    /// The longest time in which no group completed a tick.
    pub worst_pause: Duration,
    /// The longest time that a group went back because nobody was left who had computed it.
    pub worst_rewind: Duration,
    /// The counts of events.
    pub tally: Tally,
    /// The statistics of the network.
    pub traffic: Traffic,
    /// The simulated time.
    pub time: Duration,
    /// The worst that touching bodies did, as shares of their gates.
    pub strain: Strain,
    /// The ages of what clients saw of their avatars, milliseconds.
    pub staleness: Staleness,
    /// The timeline, for people.
    pub timeline: Timeline,
    /// The bit that was flipped, if one was to be and its node got that far.
    pub flipped: Option<Flipped>,
    /// The number of participants' ticks that were computed once more and found right, by nodes that live.
    pub verified: u64,
    /// The recordings of all nodes and servers by their names, including those that died.
    pub tapes: BTreeMap<String, Tape>,
}

impl Outcome {
    /// Returns the outcome of a run that ended in a panic. Nothing else is known of it.
    pub(super) fn panicked(text: &str) -> Self {
        Self {
            violation: Some(Violation::Panicked(text.into())),
            worst_recovery: Duration::ZERO,
            worst_pause: Duration::ZERO,
            worst_rewind: Duration::ZERO,
            tally: Tally::default(),
            traffic: Traffic::default(),
            time: Duration::ZERO,
            strain: Strain::default(),
            staleness: Staleness::default(),
            timeline: Timeline::default(),
            flipped: None,
            verified: 0,
            tapes: BTreeMap::new(),
        }
    }
}

/// Runs one seed of a profile with this schedule.
pub fn run_trial(config: &TrialConfig, profile: FaultProfile, seed: u64, schedule: &Schedule) -> Outcome {
    let mut trial = Trial::new(config, profile.promise(), seed, schedule);
    let violation = trial.run().err();
    trial.outcome(violation)
}

/// A scheduled action of a trial.
#[derive(Clone, Debug)]
enum Action {
    /// A fault may happen from now on.
    Arm(Planned),
    /// A node, the server, or a client begins.
    Begin(Peer),
    Resume(Peer),
    Hasten(Peer),
    /// A cut is over. The value is whether it kept the world waiting.
    Healed(bool),
    /// The server dies now, unless it has died already after storing a durable output.
    Doom,
    /// There are to be this number of nodes.
    Populate(u32),
    /// The server's program saves the world.
    Save,
    /// The server's program goes back to what was saved last.
    Restore,
    /// The user of a client does something.
    Use(ClientId),
    Look,
    Plant,
    Calm,
}

/// A fault that waits for its moment.
#[derive(Clone, Debug)]
struct Armed {
    planned: Planned,
    until: Duration,
    /// The number of events still to come, once the moment has begun.
    left: Option<u32>,
}

struct Trial<'a> {
    config: &'a TrialConfig,
    promise: Promise,
    sim: Sim,
    random: Random,
    agenda: BTreeMap<(Duration, u64), Action>,
    planned: u64,
    armed: Vec<Armed>,
    transfers: u64,
    checked: u64,
    /// The number of cuts, stops and the like that last, because of which recovery is not expected yet.
    hindered: u32,
    /// The time since when recovery is waited for.
    watch: Option<Duration>,
    worst_recovery: Duration,
    worst_pause: Duration,
    progressed_at: Duration,
    clients: Vec<ClientId>,
    /// The clients that have asked for their avatar, and when and how each last asked it to move.
    spawned: BTreeSet<ClientId>,
    inputs: BTreeMap<ClientId, (Duration, Velocity)>,
    /// The time at which the server is to be back, if it is to die at its next durable output.
    doomed: Option<Duration>,
    /// How many nodes are still to begin.
    expected_nodes: u32,
    /// How many nodes there are to be, unless the configuration says it.
    population: Option<u32>,
    /// A slow node, and how many bodies it owned in the last looks beyond its part by speed.
    slow_node: Option<(NodeId, VecDeque<f64>)>,
    calm_since: Option<Duration>,
    healed_at: Option<Duration>,
    staleness: Staleness,
    settled_at: BTreeMap<Tick, Duration>,
    apart: BTreeMap<(NodeId, NodeId), Duration>,
    /// The number of sites, and for several sites what compares their groups.
    sites: u32,
    comparer: Comparer,
    /// The times at which each body was last near enough to its place in the authoritative group, and at
    /// which each leader last knew which group that is.
    agreed_at: Lately,
    known_at: Lately,
}

impl<'a> Trial<'a> {
    fn new(config: &'a TrialConfig, promise: Promise, seed: u64, schedule: &Schedule) -> Self {
        let is_alone = config.nodes == 1 && schedule.sites == 1;
        let recovery = promise.recovery + if is_alone { ALONE } else { Duration::ZERO };
        let promise = Promise { recovery, ..promise };
        // States are told every 100 ms: with every third tick at half the rate of a real world, a sixth as
        // often as that has ticks. Where ages are measured, they are told with every tick.
        let (rate, state_every) = match schedule.rate {
            Some(rate) => (rate, 1),
            None => (config.rate, (config.rate / 10).clamp(1, MAX_STATE_TICKS)),
        };
        let sites = schedule.sites;
        let delay = (sites > 1).then_some(DELAYS);
        let participants = if sites > 1 { config.clients } else { 0 };
        let sim = (config.begin)(SimConfig {
            seed,
            nodes: match schedule.nodes.first() {
                Some(&(_, count)) => count,
                None => sites * config.nodes.saturating_sub(participants),
            },
            balance: schedule.balance,
            thresholds: Thresholds { delay, ..Thresholds::default() },
            regions: config.regions,
            bodies: config.bodies,
            speed_m_s: if sites > 1 { SLOW_M_S } else { SimConfig::default().speed_m_s },
            dt_s: 1.0 / rate as f32,
            network: schedule.network.clone(),
            bounds: if promise.no_eviction { narrow() } else { Bounds::default() },
            skew: schedule.skew,
            protocol: match schedule.lag_ticks.unwrap_or(config.lag_ticks) {
                0 => SyncProtocol::Synchronised,
                lag_ticks => SyncProtocol::Unsynchronised { lag_ticks },
            },
            state_every,
            checkpoint_every: (rate / 5).max(1).into(),
            record: config.record,
            verify: config.verify,
            relays_above: config.relays_above,
            ..SimConfig::default()
        });
        let mut trial = Self {
            config,
            promise,
            sim,
            random: Random::new(seed ^ 0x7e57_0000_0000_0000),
            agenda: BTreeMap::new(),
            planned: 0,
            armed: Vec::new(),
            transfers: 0,
            checked: 0,
            hindered: 0,
            watch: None,
            worst_recovery: Duration::ZERO,
            worst_pause: Duration::ZERO,
            progressed_at: Duration::ZERO,
            clients: Vec::new(),
            spawned: BTreeSet::new(),
            inputs: BTreeMap::new(),
            doomed: None,
            expected_nodes: 0,
            population: schedule.nodes.first().map(|&(_, count)| count),
            slow_node: None,
            calm_since: None,
            healed_at: None,
            staleness: Staleness::default(),
            settled_at: BTreeMap::new(),
            apart: BTreeMap::new(),
            sites,
            comparer: Comparer::new(sites as usize),
            agreed_at: Lately::default(),
            known_at: Lately::default(),
        };
        for (at, node) in trial.sim.nodes.keys().copied().collect::<Vec<_>>().into_iter().enumerate() {
            trial.sim.place(Peer::Node(node), at as u32 % sites);
        }
        for at in 0..sites * config.clients {
            let client = match sites {
                1 => trial.sim.start_client(None),
                _ => trial.begin_participant(None, at % sites).1,
            };
            trial.clients.push(client);
            trial.plan(Duration::from_millis(500), Action::Use(client));
        }
        if sites > 1 {
            trial.sim.sample_every(SAMPLES);
        }
        for &(at, count) in schedule.nodes.iter().skip(1) {
            trial.plan(Duration::from_secs(2) + at, Action::Populate(count));
        }
        let nodes: Vec<_> = trial.sim.nodes.keys().copied().collect();
        if let Some(tick) = config.flip {
            trial.sim.flip(nodes[seed as usize % nodes.len()], tick);
        }
        if let Some(pick) = schedule.slow_node {
            let node = nodes[pick as usize % nodes.len()];
            trial.sim.slow_down(node, SLOWER);
            trial.slow_node = Some((node, VecDeque::new()));
        }
        for &(save, restore) in &schedule.restores {
            trial.plan(save, Action::Save);
            trial.plan(restore, Action::Restore);
        }
        for &planned in &schedule.faults {
            trial.plan(planned.at, Action::Arm(planned));
        }
        trial.plan(LOOK, Action::Look);
        trial.plan(schedule.calm_at, Action::Calm);
        if config.lost_transfers > 0 || config.spoilt.is_some() {
            trial.plan(Duration::from_secs(3), Action::Plant);
        }
        trial
    }

    fn outcome(mut self, violation: Option<Violation>) -> Outcome {
        Outcome {
            tapes: self.sim.take_recordings(),
            flipped: self.sim.flipped().cloned(),
            verified: self.sim.nodes().map(|node| node.counters().verified).sum(),
            violation,
            worst_recovery: self.worst_recovery,
            worst_pause: self.worst_pause,
            worst_rewind: Duration::from_secs_f32(self.sim.checker.rewound() as f32 * self.sim.config.dt_s),
            tally: self.sim.tally(),
            traffic: self.sim.traffic(),
            time: self.sim.now(),
            strain: self.sim.watch.as_ref().map(Watch::worst).unwrap_or_default(),
            staleness: self.staleness,
            timeline: self.sim.timeline().clone(),
        }
    }

    fn plan(&mut self, at: Duration, action: Action) {
        self.planned += 1;
        self.agenda.insert((at, self.planned), action);
    }

    fn plan_in(&mut self, time: Duration, action: Action) {
        self.plan(self.sim.now() + time, action);
    }

    /// Runs until all has been well for a while after the calm has begun.
    fn run(&mut self) -> Result<(), Violation> {
        while !self.is_over() {
            self.step()?;
        }
        Ok(())
    }

    fn is_over(&self) -> bool {
        self.healed_at.is_some_and(|at| at + AFTERMATH <= self.sim.now)
    }

    /// Executes the next event, or the actions that are due.
    fn step(&mut self) -> Result<(), Violation> {
        let next = self.agenda.keys().next().map(|&(time, _)| time).expect("there is always a next look");
        let stepped = self.sim.step(next);
        if let Some(violation) = self.sim.violation.take() {
            return Err(violation);
        }
        if stepped {
            if std::mem::take(&mut self.sim.server_crashed)
                && let Some(back_after) = self.doomed.take()
            {
                self.died(Peer::Server, back_after);
            }
            self.moments();
            if self.sim.checker.checked() != self.checked {
                self.progressed();
            }
            return Ok(());
        }
        while let Some(entry) = self.agenda.first_entry().filter(|entry| entry.key().0 <= self.sim.now) {
            let action = entry.remove();
            self.act(action)?;
        }
        Ok(())
    }

    /// Executes faults whose moment has come.
    fn moments(&mut self) {
        let transferred = std::mem::replace(&mut self.transfers, self.sim.tally.transfers);
        let transfers = transferred != self.sim.tally.transfers;
        if self.armed.is_empty() {
            return;
        }
        let changes = self.sim.server.as_ref().is_some_and(|server| server.is_changing());
        let now = self.sim.now;
        let mut due = Vec::new();
        self.armed.retain_mut(|armed| {
            armed.left = match (armed.left, armed.planned.moment) {
                (Some(left), _) => Some(left.saturating_sub(1)),
                (None, Moment::Any) => Some(0),
                (None, Moment::Changing(left)) => changes.then_some(left),
                (None, Moment::Transferring(left)) => transfers.then_some(left),
            };
            let is_due = armed.left == Some(0) || armed.until <= now;
            if is_due {
                due.push(armed.planned.fault);
            }
            !is_due
        });
        due.into_iter().for_each(|fault| self.happen(fault));
    }

    /// Notes that a tick of some group has been completed and checked.
    fn progressed(&mut self) {
        self.checked = self.sim.checker.checked();
        let tick = self.sim.checker.last();
        let pause = self.sim.now - self.progressed_at;
        self.progressed_at = self.sim.now;
        if pause > LONG_PAUSE {
            self.sim.note(|| format!("{tick}, after {} ms without any", pause.as_millis()));
        }
        self.settled_at.entry(tick).or_insert(self.sim.now);
        if self.settled_at.len() > 1_024 {
            self.settled_at.pop_first();
        }
        if let Some(since) = self.watch
            && self.hindered == 0
            && self.lacks_steadiness(since).is_none()
        {
            self.worst_recovery = self.worst_recovery.max(self.sim.now - since);
            self.watch = None;
        }
    }

    /// Notes that something has gone wrong, or has ceased to. Recovery is waited for from now on.
    fn disturbed(&mut self) {
        self.watch = Some(self.sim.now);
    }
}

/// Returns the bounds of queues where no link may break: some seconds of what such small worlds send.
fn narrow() -> Bounds {
    const MOST: usize = 1 << 16;
    Bounds { inbox_bytes: MOST, queue_bytes: MOST, client_queue_bytes: MOST, ..Bounds::default() }
}

/// Returns the network conditions of a calm time.
fn calm() -> NetworkConditions {
    NetworkConditions::calm(Path::up_to(2_000))
}

/// The processes on one side of a cut, or the two that are cut off from one another.
type Island = BTreeSet<Peer>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{Fault, ProcessKind, Victim};

    #[test]
    fn a_fault_in_the_middle_of_a_transfer_waits_for_one() {
        let victim = Victim { role: ProcessKind::Member, pick: 0 };
        let fault = Fault::Kill { victim, back_after: Duration::from_secs(1) };
        let at = Duration::from_secs(5);
        let planned = Planned { at, moment: Moment::Transferring(0), fault };
        let (config, profile) = (TrialConfig::default(), FaultProfile::KillNode);
        for seed in 0..4 {
            let schedule = Schedule { faults: vec![planned], ..FaultProfile::None.schedule(seed) };
            let mut trial = Trial::new(&config, profile.promise(), seed, &schedule);
            while trial.armed.is_empty() {
                trial.step().unwrap();
            }
            let before = trial.sim.tally.transfers;
            while !trial.armed.is_empty() {
                trial.step().unwrap();
            }
            assert!(trial.sim.tally.transfers > before, "seed {seed}");
        }
    }
}
