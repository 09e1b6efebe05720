//! Computes the physics of a node: carries out the commands of the node's state machine on the regions that
//! the node computes.

mod led;
mod verify;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

use rapier3d::prelude::*;
use tracing::warn;

use self::led::Led;
use self::verify::{Listener, Twin};
use crate::cluster::{PhysicsCommand, PhysicsEvent, Sampling, TickStats};
use crate::fidelity::Fidelity;
use crate::physics::{HostError, Partition, Region, RegionHost};
use crate::protocol::{
    Answer, BodyCheckpoint, BodyRecord, BorderMessage, Chunk, Claim, EnvironmentProperties, JointRecord,
    LoadReport, Push, Query, RegionLoad, SharedState, WorldOp,
};
use crate::space::{BodyId, ClientId, DistributionTree, Epoch, Load, RegionId, Tick, summarised};

/// An error after which the physics cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The host refused bodies, shapes or threads.
    #[error(transparent)]
    Host(#[from] HostError),
}

/// The regions of one node, with what was reported of them.
pub struct PhysicsDevice {
    threads: usize,
    host: Option<RegionHost>,
    rebuilding: bool,
    /// The number of rounds of the present tick that are not computed yet.
    rounds_left: u32,
    /// The queries that came with the present tick.
    questions: Vec<(ClientId, Query)>,
    transfers_told: u64,
    compute_us: u32,
    report: Sampler,
    checkpoint: Sampler,
    /// The regions that were stepped since the last report.
    stepped: BTreeSet<RegionId>,
    /// The world of speculative ticks, computed while others are waited for: all bodies held here, in one
    /// region.
    copy: Option<RegionHost>,
    /// Avatars of which a copy is, or was, held here.
    avatars: BTreeSet<BodyId>,
    world: Option<EnvironmentProperties>,
    /// The pushes of the last ticks, each with its tick, for as long as a body that they concern may be on
    /// its way here; none in lockstep.
    pushes: Vec<(Tick, Push)>,
    /// The bodies that jumped in the last ticks, each with the tick, for as long.
    jumps: Vec<(Tick, BodyId)>,
    /// The hits of bodies, while some follow another group.
    led: Led,
    /// Bodies that are being taken over.
    arriving: Vec<Arrival>,
    /// Repeated computations of what other members compute, by the number of their run; `None` for one that
    /// failed.
    runs: BTreeMap<u64, Option<Twin>>,
    /// Receives the results of repeated computations that run on threads of their own.
    apart: Option<Listener>,
}

/// A body that is being taken over.
struct Arrival {
    id: BodyId,
    epoch: Epoch,
    /// The tick that its record is of.
    written: Tick,
    /// The tick since which it has gone on as its copy here did, if it arrives so.
    as_here: Option<Tick>,
}

impl PhysicsDevice {
    /// Makes a device without a world, which steps up to `threads` regions at the same time.
    pub fn new(threads: usize) -> Self {
        Self {
            threads,
            host: None,
            rebuilding: false,
            rounds_left: 0,
            questions: Vec::new(),
            transfers_told: 0,
            compute_us: 0,
            report: Sampler::default(),
            checkpoint: Sampler::default(),
            stepped: BTreeSet::new(),
            copy: None,
            avatars: BTreeSet::new(),
            world: None,
            pushes: Vec::new(),
            jumps: Vec::new(),
            led: Led::default(),
            arriving: Vec::new(),
            runs: BTreeMap::new(),
            apart: None,
        }
    }

    /// Returns the regions computed here, once there is a world.
    pub fn host(&self) -> Option<&RegionHost> {
        self.host.as_ref()
    }

    pub(super) fn host_mut(&mut self) -> Option<&mut RegionHost> {
        self.host.as_mut()
    }

    /// Carries out one command; returns `None` if the command has no answer.
    ///
    /// # Panics
    /// If a command comes before [`PhysicsCommand::World`], which the state machine never does.
    pub fn run(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, DeviceError> {
        let start = Instant::now();
        let event = match command {
            // Not counted in the time of this node's tick.
            PhysicsCommand::Verify { run, command } => return Ok(self.verify(run, command)),
            PhysicsCommand::World(world) => {
                *self = Self { apart: self.apart.take(), ..Self::new(self.threads) };
                let mut host = host_of(&world, self.threads, &[])?;
                if world.protocol.lag_ticks() > 0 {
                    host.meet_always();
                }
                if world.fidelity != Fidelity::Off {
                    host.follow_schedules();
                }
                self.host = Some(host);
                self.world = Some(world);
                None
            }
            PhysicsCommand::Load(chunk) => self.load(chunk).map(|()| None)?,
            PhysicsCommand::Anew => self.begin_anew().map(|()| None)?,
            PhysicsCommand::Rebuild { tick, tree, regions, placed, joints, drop } => {
                let host = self.world();
                let avatars: Vec<_> =
                    placed.iter().map(|placed| placed.body.id).filter(|id| id.client().is_some()).collect();
                let placed = placed.into_iter().map(|placed| (placed.region, placed.body)).collect();
                host.set_tick(tick);
                host.rebuild(&tree, &regions, placed, &joints, &drop)?;
                host.announce();
                self.avatars.extend(avatars);
                self.rebuilding = true;
                Some(self.computed(Vec::new()))
            }
            PhysicsCommand::Repartition { changes, newborn_here } => {
                let host = self.world();
                host.repartition(&changes, newborn_here)?;
                host.move_left_behind();
                None
            }
            PhysicsCommand::Step { tick, rounds, ops } => {
                let band_m = self.band_m();
                let questions = ops.iter().filter_map(|op| match op {
                    WorldOp::Ask { client, question } => Some((*client, question.clone())),
                    _ => None,
                });
                self.questions = questions.collect();
                self.note_pushes(tick, &ops);
                let is_scheduled = self.is_scheduled();
                let host = self.host.as_mut().expect("a world comes before commands");
                assert_eq!(tick, host.tick().next(), "ticks are computed in order");
                let new = ops.iter().flat_map(|op| match op {
                    WorldOp::Insert { bodies, .. } => bodies.as_slice(),
                    _ => &[],
                });
                let avatars: Vec<_> = new.map(|body| body.id).filter(|id| id.client().is_some()).collect();
                let schedule = ops.iter().find_map(WorldOp::schedule).cloned().unwrap_or_default();
                let removed = apply(host, &mut self.led, ops, band_m);
                self.led.look_ahead(host);
                host.set_rounds(rounds as usize);
                if is_scheduled {
                    host.keep(&schedule);
                }
                host.compute();
                self.avatars.extend(avatars);
                (self.rebuilding, self.rounds_left) = (false, rounds - 1);
                self.compute_us = 0;
                Some(self.computed(removed))
            }
            PhysicsCommand::Accept { tick, incoming, report, checkpoint, load, .. } => {
                self.hear(tick, incoming);
                let mut event = self.accept(report, checkpoint)?;
                if let PhysicsEvent::Settled { load: told, .. } = &mut event {
                    *told = load.then(|| self.load_report());
                }
                Some(event)
            }
            PhysicsCommand::Drain { tick, incoming } => {
                self.hear(tick, incoming);
                self.world().drain()?;
                self.push_again();
                Some(PhysicsEvent::Drained)
            }
            PhysicsCommand::Speculate(ops) => {
                let awake = self.speculate(ops).unwrap_or_else(|error| {
                    warn!(%error, "nothing is computed while others are waited for");
                    Vec::new()
                });
                Some(PhysicsEvent::Speculated(awake))
            }
            PhysicsCommand::Return => {
                self.copy = None;
                None
            }
            PhysicsCommand::Survey => Some(PhysicsEvent::Surveyed(self.claims())),
            PhysicsCommand::Fetch(ids) => Some(PhysicsEvent::Found(self.world().records(&ids))),
        };
        self.compute_us = self.compute_us.saturating_add(start.elapsed().as_micros() as u32);
        Ok(event)
    }

    /// Computes a speculative tick on the copy, and returns the states of its awake bodies.
    fn speculate(&mut self, ops: Vec<WorldOp>) -> Result<Vec<SharedState>, DeviceError> {
        if self.copy.is_none() {
            let world = self.world.as_ref().expect("a world comes before commands");
            let host = self.host.as_ref().expect("a world comes before commands");
            let tree = DistributionTree::halved(world.tree.bounds(), 1).expect("one region always can be");
            let regions: Vec<_> = tree.leaves().collect();
            let world = EnvironmentProperties { tree, ..world.clone() };
            let mut copy = host_of(&world, self.threads, &regions)?;
            *copy.shapes_mut() = host.shapes().clone();
            copy.insert(host.scenery().cloned().collect(), &[])?;
            let ids = host.held_bodies();
            let bodies: Vec<_> = ids.iter().filter_map(|&id| host.record(id)).collect();
            let known: BTreeSet<_> = ids.iter().copied().chain(host.scenery().map(|body| body.id)).collect();
            // A body that is tied to a body which only others hold is free during these ticks.
            let is_held = |joint: &JointRecord| known.contains(&joint.a) && known.contains(&joint.b);
            let joints: BTreeMap<_, _> = ids
                .iter()
                .flat_map(|&id| host.joints_of(id))
                .filter(is_held)
                .map(|joint| (joint.id, joint))
                .collect();
            copy.insert(bodies, &joints.into_values().collect::<Vec<_>>())?;
            self.copy = Some(copy);
        }
        let band_m = self.band_m();
        let copy = self.copy.as_mut().expect("made above");
        apply(copy, &mut self.led.clone(), ops, band_m);
        copy.step()?;
        copy.clear_events();
        let awake = copy.awake_bodies().into_iter().filter_map(|id| copy.owned(id));
        Ok(awake.map(|(region, handle)| region.shared_state(handle)).collect())
    }

    /// Returns the distance within which a body of another group is not corrected, metres: half the inter-group threshold.
    fn band_m(&self) -> f64 {
        self.world.as_ref().map_or(0.0, |world| f64::from(world.thresholds.between_groups_m) / 2.0)
    }

    /// Returns whether regions may be stepped less often than once per tick.
    fn is_scheduled(&self) -> bool {
        self.world.as_ref().is_some_and(|world| world.fidelity != Fidelity::Off)
    }

    fn world(&mut self) -> &mut RegionHost {
        self.host.as_mut().expect("a world comes before commands")
    }

    fn load(&mut self, chunk: Chunk) -> Result<(), DeviceError> {
        let host = self.world();
        match chunk {
            Chunk::Shapes(shapes) => {
                for shape in shapes {
                    host.shapes_mut().add(shape).map_err(HostError::from)?;
                }
            }
            // A server that was restarted does not know what its nodes hold already.
            Chunk::Bodies(mut bodies) => {
                bodies.retain(|body| host.record(body.id).is_none());
                host.insert(bodies, &[])?;
            }
            Chunk::Placed(_) | Chunk::Joints(_) => {
                unreachable!("placed bodies and joints come with a rebuild")
            }
        }
        Ok(())
    }

    fn computed(&mut self, removed: Vec<BodyRecord>) -> PhysicsEvent {
        let host = self.world();
        PhysicsEvent::Computed {
            outgoing: host.outgoing().cloned().collect(),
            neighbours: host.neighbours(),
            removed,
        }
    }

    /// Accepts border messages. States of earlier ticks are carried forward to this one.
    fn hear(&mut self, tick: Tick, incoming: Vec<BorderMessage>) {
        for message in &incoming {
            let bodies = message.ghosts.iter().map(|body| body.id);
            let transfers = message.transfers.iter().map(|transfer| transfer.body.id);
            // Their former owner reports them no more, and they may fall asleep before the next sample here.
            self.report.awake.extend(transfers.clone());
            self.checkpoint.awake.extend(transfers.clone());
            self.avatars.extend(bodies.chain(transfers).filter(|id| id.client().is_some()));
        }
        let host = self.host.as_mut().expect("a world comes before commands");
        for message in incoming {
            let written = message.tick;
            let taken: Vec<_> =
                message.transfers.iter().map(|transfer| (transfer.body.id, transfer.body.epoch)).collect();
            let mut as_here = BTreeMap::new();
            if written < tick {
                let jumped = self.jumps.iter().filter(|(at, _)| *at > written).map(|(_, id)| *id).collect();
                as_here = host.accept_late(message, tick, &jumped);
            } else {
                host.accept(message);
            }
            let arrival = |(id, epoch)| Arrival { id, epoch, written, as_here: as_here.get(&id).copied() };
            self.arriving.extend(taken.into_iter().map(arrival));
        }
    }

    /// Remembers the pushes of a tick for as long as a body that they concern may be on its way here. An
    /// input that sets a body's velocity replaces all impulses on it before.
    fn note_pushes(&mut self, tick: Tick, ops: &[WorldOp]) {
        let lag = self.world.as_ref().map_or(0, |world| world.protocol.lag_ticks());
        self.pushes.retain(|(at, _)| at.0 + lag > tick.0);
        self.jumps.retain(|(at, _)| at.0 + lag > tick.0);
        for op in ops.iter().filter(|_| lag > 0) {
            match op {
                WorldOp::Push(push) => self.pushes.push((tick, *push)),
                WorldOp::Input(input) if input.drive.is_none() => {
                    self.pushes.retain(|(_, push)| push.lasts || push.body != input.body);
                    self.jumps.extend(input.pose.map(|_| (tick, input.body)));
                }
                _ => {}
            }
        }
    }

    /// Applies the pushes that came while their bodies were on the way here, after the bodies' records were
    /// written. A body that arrives as its copy is here has had those since it has gone on so, but for forces that last,
    /// which are as in the record.
    fn push_again(&mut self) {
        for Arrival { id, epoch, written, as_here } in std::mem::take(&mut self.arriving) {
            let host = self.host.as_mut().expect("a world comes before commands");
            let is_taken = host.owned(id).is_some_and(|(region, handle)| region.epoch_of(handle) == epoch);
            for (at, push) in self.pushes.iter().filter(|(at, push)| *at > written && push.body == id) {
                let is_missing = push.lasts || as_here.is_none_or(|since| *at < since);
                if is_taken && is_missing {
                    host.push(push);
                }
            }
        }
    }

    /// Returns the avatars of which a copy is held here.
    fn holds(&mut self) -> Vec<BodyId> {
        let host = self.host.as_ref().expect("a world comes before commands");
        let held = |id: &BodyId| host.regions().any(|region| region.handle_of(*id).is_some());
        self.avatars.retain(held);
        self.avatars.iter().copied().collect()
    }

    fn accept(&mut self, report: Sampling, checkpoint: Sampling) -> Result<PhysicsEvent, DeviceError> {
        let (rebuilding, rounds_left) = (self.rebuilding, self.rounds_left);
        self.world().exchange()?;
        self.push_again();
        let host = self.host.as_mut().expect("a world comes before commands");
        if rebuilding {
            host.drop_unconfirmed();
        } else if rounds_left > 0 {
            host.compute();
            self.rounds_left = rounds_left - 1;
            return Ok(self.computed(Vec::new()));
        } else {
            host.conclude();
            host.end_tick();
            self.led.look_back(host);
        }
        self.rebuilding = false;
        let exchanges = if rebuilding { 0 } else { self.world().exchanges_done() };
        Ok(self.settled(rebuilding, exchanges, report, checkpoint))
    }

    fn settled(
        &mut self,
        rebuilding: bool,
        exchanges: usize,
        report: Sampling,
        checkpoint: Sampling,
    ) -> PhysicsEvent {
        let host = self.host.as_mut().expect("a world comes before commands");
        let events = host.events().cloned().collect();
        host.clear_events();
        self.stepped.extend(host.regions().filter(|region| !host.stays_behind(region)).map(Region::id));
        let stepped = match report {
            Sampling::Nothing => BTreeSet::new(),
            _ => std::mem::take(&mut self.stepped),
        };
        // Bodies of regions that were not stepped are where they were.
        let is_told = |region: &Region| report == Sampling::All || stepped.contains(&region.id());
        let report: Vec<SharedState> = self
            .report
            .sample(host, report)
            .into_iter()
            .filter_map(|id| host.owned(id))
            .filter(|(region, _)| is_told(region))
            .map(|(region, handle)| region.shared_state(handle))
            .collect();
        let checkpoint: Vec<BodyCheckpoint> = self
            .checkpoint
            .sample(host, checkpoint)
            .into_iter()
            .filter_map(|id| {
                let (region, handle) = host.owned(id)?;
                let (epoch, state) = (region.epoch_of(handle), region.body_state(handle));
                Some(BodyCheckpoint { id, region: region.id(), epoch, state })
            })
            .collect();
        let transfers = host.transfers();
        let stats = TickStats {
            bodies: host.owned_count() as u32,
            ghosts: host.regions().map(|region| region.ghost_count() as u32).sum(),
            contacts: host.regions().map(|region| contact_pairs(region.physics())).sum(),
            transfers: (transfers - self.transfers_told) as u32,
            compute_us: self.compute_us,
            exchanges: exchanges as u32,
            disagreement_m_s: host.disagreement_m_s(),
        };
        self.transfers_told = transfers;
        let rounds_wanted = host.rounds_wanted() as u32;
        let holds = self.holds();
        let host = self.host.as_ref().expect("a world comes before commands");
        let questions = std::mem::take(&mut self.questions);
        let answer = |(client, question): (ClientId, Query)| Answer {
            client,
            number: question.number,
            found: host.queries().answer(&question),
        };
        let answers = questions.into_iter().map(answer).collect();
        let mut regions = if self.is_scheduled() { host.region_states() } else { Vec::new() };
        if rebuilding {
            // A rebuild steps nothing.
            regions.iter_mut().for_each(|state| state.set_times_ms([state.step_ms, 0.0, 0.0]));
        }
        PhysicsEvent::Settled {
            rounds_wanted,
            stats,
            holds,
            events,
            answers,
            report,
            checkpoint,
            load: None,
            regions,
        }
    }

    /// Returns the load of the regions computed here, summed up by place.
    fn load_report(&mut self) -> LoadReport {
        let host = self.world();
        let regions = host.regions().map(|region| RegionLoad {
            region: region.id(),
            activity: host.load_of(region, Load::Counts),
            step_us: host.load_of(region, Load::Times),
            vacant: host.is_vacant(region.id()),
        });
        let regions: Vec<_> = regions.collect();
        let (burdens, islands) = host.burdens(Load::Counts);
        LoadReport { burdens: summarised(burdens, LoadReport::BURDENS * regions.len()), regions, islands }
    }

    fn claims(&mut self) -> Vec<Claim> {
        self.world()
            .owned_bodies()
            .map(|(id, region, handle)| Claim { id, epoch: region.epoch_of(handle), region: region.id() })
            .collect()
    }
}

fn host_of(
    world: &EnvironmentProperties,
    threads: usize,
    regions: &[RegionId],
) -> Result<RegionHost, DeviceError> {
    let partition = Partition::new(world.tree.clone(), world.halo_m);
    Ok(RegionHost::new(partition, world.step.into(), threads, regions)?)
}

/// Applies world operations (insertions, removals, inputs, inter-group corrections) before a tick. Every
/// member applies them to the bodies it holds. Returns the owned bodies that disappeared, as they were. An
/// operation that cannot be done is refused by all members alike, so it is only logged.
fn apply(host: &mut RegionHost, led: &mut Led, ops: Vec<WorldOp>, band_m: f64) -> Vec<BodyRecord> {
    let (mut removed, mut gone) = (Vec::new(), BTreeSet::new());
    // All regions meet, as on nodes that hold nothing of what these operations concern.
    if ops.iter().any(WorldOp::concerns_all) {
        host.meet_all();
    }
    for op in ops {
        match op {
            WorldOp::Insert { bodies, shapes, joints } => {
                // The new bodies may have a shape that an operation before this one forgets.
                host.forget_shapes(&std::mem::take(&mut gone));
                let first = bodies.first().map(|body| body.id);
                let known = shapes.into_iter().try_for_each(|shape| host.shapes_mut().add(shape).map(|_| ()));
                let inserted = known.map_err(HostError::from).and_then(|()| host.insert(bodies, &joints));
                if let Err(error) = inserted {
                    warn!(?first, %error, "bodies are not inserted");
                }
            }
            WorldOp::Remove(id) => {
                removed.extend(host.owned(id).map(|(region, handle)| region.body_record(handle)));
                host.remove(id);
            }
            WorldOp::RemoveJoint(id) => {
                host.remove_joint(id);
            }
            WorldOp::ForgetShapes(names) => gone.extend(names),
            WorldOp::Input(input) => {
                host.heed(input.body);
                host.obey(&input);
            }
            WorldOp::Push(push) => {
                host.heed(push.body);
                host.push(&push);
            }
            WorldOp::Alter(alteration) => {
                if let Err(error) = host.alter(&alteration) {
                    warn!(?alteration, %error, "nothing is changed");
                }
            }
            // A repartition was done before the tick began, a query is answered when it is over, a schedule
            // is kept when all is applied, and a watch concerns what is told of the tick.
            WorldOp::Repartition(_) | WorldOp::Ask { .. } | WorldOp::Schedule(_) | WorldOp::Watch(_) => {}
            WorldOp::Correct { tick, states, stuck } => {
                led.lead(host, tick, &states, &stuck, band_m);
            }
        }
    }
    // One pass over all bodies serves all names.
    host.forget_shapes(&gone);
    removed
}

/// Returns the number of pairs near enough to touch. Counting those that do touch would visit every pair.
fn contact_pairs(world: &PhysicsWorld) -> u32 {
    world.narrow_phase.contact_graph().interactions().count() as u32
}

/// The bodies that were awake at the last sample, or have come since, so that falling asleep is reported
/// once.
#[derive(Default)]
struct Sampler {
    awake: Vec<BodyId>,
}

impl Sampler {
    /// Returns the bodies of a sample, in id order.
    fn sample(&mut self, host: &RegionHost, sampling: Sampling) -> Vec<BodyId> {
        if sampling == Sampling::Nothing {
            return Vec::new();
        }
        let awake = host.awake_bodies();
        let before = std::mem::replace(&mut self.awake, awake);
        let mut sampled: Vec<_> = match sampling {
            Sampling::All => host.owned_bodies().map(|(id, ..)| id).collect(),
            _ => before.into_iter().chain(self.awake.iter().copied()).collect(),
        };
        // Ordered runs are merged.
        sampled.sort();
        sampled.dedup();
        sampled
    }
}

#[cfg(all(test, feature = "sim"))]
mod tests;
