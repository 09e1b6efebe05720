//! Stands in for the physics: bodies fly straight and bounce off the world's bounds, have ghosts in a halo,
//! and change owner by position, in the same border messages as the real ones. Bodies near an avatar report
//! contacts with it, without any force.

use std::collections::{BTreeMap, BTreeSet};

use super::Engine;
use crate::cluster::{PhysicsCommand, PhysicsEvent, Sampling, TickStats, correction, deviation_m};
use crate::protocol::{
    Answer, BodyCheckpoint, BodyKind, BodyRecord, BodyState, BorderMessage, CastAnswer, CastQuery, Claim,
    ContactKey, EnvironmentProperties, LoadReport, Overlap, OverlapQuery, Place, Placed, Query, QueryParts,
    QueryResult, RayAnswer, RayQuery, RegionEvents, RegionLoad, SharedState, Touch, Transfer, Velocity,
    WorldOp, WorldPose,
};
use crate::recording::{BodyBits, Physics, Readout};
use crate::space::{
    BodyId, Bounds, Burden, ClientId, Epoch, RegionId, RegionSet, Renaming, Tick, TreeChange, summarised,
};

/// The width of the halo: how far beyond its cell a region holds ghosts, metres.
const HALO_M: f64 = 1.0;
/// The time that a body or contact takes per tick, microseconds: so much that a few of them tell how fast a
/// node is.
pub(super) const WORK_US: f64 = 250.0;
/// The number of ticks between two in which each region exchanges messages with all.
const MEET_EVERY: u64 = 8;
/// The distance at which a body and an avatar touch, metres.
const TOUCH_M: f64 = 1.0;

#[derive(Clone, Debug)]
struct Owned {
    body: BodyRecord,
    /// The regions that hold a ghost of it.
    holders: BTreeSet<RegionId>,
}

#[derive(Clone, Debug, Default)]
struct Region {
    owned: BTreeMap<BodyId, Owned>,
    ghosts: BTreeMap<BodyId, BodyRecord>,
    /// The owners of the ghosts.
    owners: BTreeMap<BodyId, RegionId>,
    touching: BTreeSet<ContactKey>,
}

impl Region {
    fn bodies(&self) -> impl Iterator<Item = &BodyRecord> {
        self.owned.values().map(|owned| &owned.body).chain(self.ghosts.values())
    }

    fn is_vacant(&self) -> bool {
        self.owned.is_empty() && self.ghosts.is_empty()
    }

    /// Returns the contacts that have begun or ceased since the last call.
    fn touches(&mut self) -> Vec<Touch> {
        let (avatars, bodies): (Vec<_>, Vec<_>) = self.bodies().partition(|body| body.id.client().is_some());
        let pairs = avatars.iter().flat_map(|a| bodies.iter().map(move |b| (a, b)));
        let near = pairs.filter(|(a, b)| deviation_m(&a.state.pose, &b.state.pose) < TOUCH_M);
        let key =
            |a: BodyId, b: BodyId| ContactKey { a: a.min(b), b: a.max(b), collider_a: 0, collider_b: 0 };
        let now: BTreeSet<_> = near.map(|(a, b)| key(a.id, b.id)).collect();
        let before = std::mem::replace(&mut self.touching, now);
        let touch =
            |&key, began| Touch { key, began, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 };
        let ended = before.difference(&self.touching).map(|key| touch(key, false));
        self.touching.difference(&before).map(|key| touch(key, true)).chain(ended).collect()
    }
}

/// The stand-in physics: the regions of one node.
#[derive(Clone, Debug, Default)]
pub struct StandIn {
    world: Option<EnvironmentProperties>,
    regions: BTreeMap<RegionId, Region>,
    /// The rounds of the present tick, and those of them that are not computed yet.
    rounds: u32,
    rounds_left: u32,
    /// The questions that came with the tick.
    questions: Vec<(ClientId, Query)>,
    reported: BTreeMap<BodyId, BodyState>,
    checkpointed: BTreeMap<BodyId, BodyState>,
    copy: Option<Box<Copy>>,
    /// Other members' regions that are computed once more here, by the number of the run.
    runs: BTreeMap<u64, Self>,
}

/// A copy of the regions for speculative ticks, while the node waits for other members.
#[derive(Clone, Debug)]
struct Copy {
    bodies: BTreeMap<BodyId, BodyRecord>,
}

impl Copy {
    fn of(regions: &BTreeMap<RegionId, Region>) -> Self {
        let mut bodies = BTreeMap::new();
        for region in regions.values() {
            bodies.extend(region.ghosts.iter().map(|(&id, body)| (id, body.clone())));
        }
        for region in regions.values() {
            bodies.extend(region.owned.iter().map(|(&id, owned)| (id, owned.body.clone())));
        }
        Self { bodies }
    }

    fn fly(&mut self, world: &EnvironmentProperties, ops: Vec<WorldOp>) {
        for op in ops {
            if let WorldOp::Input(input) = op
                && let Some(body) = self.bodies.get_mut(&input.body)
            {
                body.state.velocity = input.velocity;
                body.state.pose = input.pose.unwrap_or(body.state.pose);
            }
        }
        let movable = self.bodies.values_mut().filter(|body| body.traits.kind != BodyKind::Fixed);
        movable.for_each(|body| fly(&mut body.state, &world.tree.bounds(), f64::from(world.step.dt_s)));
    }

    fn states(&self) -> Vec<SharedState> {
        // No region owns the bodies of a copy.
        self.bodies.values().map(|body| shared(body, RegionId::default())).collect()
    }
}

/// Moves a body straight on, and turns it back at the bounds of the world.
fn fly(state: &mut BodyState, bounds: &Bounds, dt_s: f64) {
    for i in 0..3 {
        state.pose.translation[i] += f64::from(state.velocity.linear[i]) * dt_s;
        let place = state.pose.translation[i];
        if place < bounds.min[i] || place > bounds.max[i] {
            state.pose.translation[i] = place.clamp(bounds.min[i], bounds.max[i]);
            state.velocity.linear[i] = -state.velocity.linear[i];
        }
    }
}

impl Engine for StandIn {
    fn claims(&self) -> Vec<Claim> {
        let of = |(&region, content): (&RegionId, &Region)| {
            let claim = move |(&id, owned): (&BodyId, &Owned)| Claim { id, epoch: owned.body.epoch, region };
            content.owned.iter().map(claim).collect::<Vec<_>>()
        };
        let mut claims: Vec<_> = self.regions.iter().flat_map(of).collect();
        claims.sort_by_key(|claim| claim.id);
        claims
    }

    fn ghosts(&self) -> Vec<(BodyId, Epoch, WorldPose)> {
        let of = |body: &BodyRecord| (body.id, body.epoch, body.state.pose);
        self.regions.values().flat_map(|region| region.ghosts.values().map(of)).collect()
    }

    fn state(&self, id: BodyId) -> Option<BodyState> {
        self.regions.values().find_map(|region| region.owned.get(&id)).map(|owned| owned.body.state)
    }

    fn rounds(&self) -> u32 {
        self.rounds
    }

    // Returns the rounds wanted for the next tick: for the world's first region a number that varies, for all
    // others 1.
    fn rounds_wanted(&self) -> u32 {
        let first = self.world().tree.leaves().next();
        let bodies = first.and_then(|first| self.regions.get(&first)).map(|region| region.owned.len());
        bodies.map_or(1, |bodies| 1 + bodies as u32 % 3)
    }
}

impl Physics for StandIn {
    fn execute(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, String> {
        Ok(self.carry_out(command))
    }
}

impl Readout for StandIn {
    fn regions(&self) -> Vec<RegionId> {
        self.regions.keys().copied().collect()
    }

    fn bodies(&self, region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_> {
        let owned = self.regions.get(&region).into_iter().flat_map(|region| &region.owned);
        Box::new(owned.map(|(&id, owned)| {
            let BodyState { pose, velocity, .. } = owned.body.state;
            (id, BodyBits::of_f64(pose.translation, pose.rotation, velocity.linear, velocity.angular))
        }))
    }

    fn set(&mut self, body: BodyId, bits: &BodyBits) -> bool {
        let Some(owned) = self.regions.values_mut().find_map(|region| region.owned.get_mut(&body)) else {
            return false;
        };
        let BodyState { pose, velocity, .. } = &mut owned.body.state;
        *pose = WorldPose { translation: bits.translation_f64(), rotation: bits.rotation() };
        *velocity = Velocity { linear: bits.linvel(), angular: bits.angvel() };
        true
    }

    fn touching(&self, body: BodyId) -> Vec<BodyId> {
        let keys = self.regions.values().flat_map(|region| &region.touching);
        let others: BTreeSet<_> = keys.filter_map(|key| key.other(body)).collect();
        others.into_iter().collect()
    }
}

impl StandIn {
    /// Carries out a command, and returns its answer; `None` for commands that have none.
    fn carry_out(&mut self, command: PhysicsCommand) -> Option<PhysicsEvent> {
        match command {
            PhysicsCommand::World(world) => {
                *self = Self { world: Some(world), ..Self::default() };
                None
            }
            PhysicsCommand::Load(_) => None,
            PhysicsCommand::Anew => {
                let (world, runs) = (self.world.take(), std::mem::take(&mut self.runs));
                *self = Self { world, runs, ..Self::default() };
                None
            }
            PhysicsCommand::Rebuild { tick, tree, regions, placed, drop, .. } => {
                self.world.as_mut().expect("the world comes first").tree = tree;
                self.rebuild(&regions, placed, &drop);
                (self.rounds, self.rounds_left) = (0, 0);
                Some(self.speak(tick, Vec::new()))
            }
            PhysicsCommand::Repartition { changes, newborn_here } => {
                self.repartition(&changes, newborn_here);
                None
            }
            PhysicsCommand::Step { tick, rounds, ops } => {
                let mut removed = Vec::new();
                ops.into_iter().for_each(|op| self.apply(tick, op, &mut removed));
                (self.rounds, self.rounds_left) = (rounds, rounds - 1);
                self.fly();
                Some(self.speak(tick, removed))
            }
            PhysicsCommand::Drain { tick, incoming } => {
                incoming.into_iter().for_each(|message| self.hear(tick, message));
                Some(PhysicsEvent::Drained)
            }
            PhysicsCommand::Accept { tick, incoming, report, checkpoint, load, .. } => {
                incoming.into_iter().for_each(|message| self.hear(tick, message));
                if self.rounds_left > 0 {
                    self.rounds_left -= 1;
                    self.fly();
                    return Some(self.speak(tick, Vec::new()));
                }
                Some(self.settled(tick, report, checkpoint, load))
            }
            PhysicsCommand::Speculate(ops) => {
                let copy = self.copy.get_or_insert_with(|| Box::new(Copy::of(&self.regions)));
                copy.fly(self.world.as_ref().expect("the world comes first"), ops);
                Some(PhysicsEvent::Speculated(copy.states()))
            }
            PhysicsCommand::Return => {
                self.copy = None;
                None
            }
            PhysicsCommand::Verify { run, command: None } => {
                self.runs.remove(&run);
                None
            }
            PhysicsCommand::Verify { run, command: Some(command) } => {
                let world = self.world.clone();
                let twin = self.runs.entry(run).or_insert_with(|| Self { world, ..Self::default() });
                let event = twin.carry_out(*command)?;
                Some(PhysicsEvent::Verified { run, event: Some(Box::new(event)) })
            }
            PhysicsCommand::Survey => Some(PhysicsEvent::Surveyed(self.claims())),
            PhysicsCommand::Fetch(ids) => {
                Some(PhysicsEvent::Found(ids.into_iter().filter_map(|id| self.find(id)).collect()))
            }
        }
    }

    fn world(&self) -> &EnvironmentProperties {
        self.world.as_ref().expect("the world comes first")
    }

    fn find(&self, id: BodyId) -> Option<BodyRecord> {
        let owned = self.regions.values().find_map(|region| region.owned.get(&id)).map(|owned| &owned.body);
        let ghost = || self.regions.values().filter_map(|region| region.ghosts.get(&id));
        owned.or_else(|| ghost().max_by_key(|body| body.epoch)).cloned()
    }

    fn rebuild(&mut self, regions: &[RegionId], placed: Vec<Placed>, drop: &[BodyId]) {
        self.regions.retain(|region, _| regions.contains(region));
        for &region in regions {
            self.regions.entry(region).or_default();
        }
        for region in self.regions.values_mut() {
            region.ghosts.clear();
            region.owners.clear();
            region.touching.clear();
            for id in drop.iter().chain(placed.iter().map(|placed| &placed.body.id)) {
                region.owned.remove(id);
            }
            region.owned.values_mut().for_each(|owned| owned.holders.clear());
        }
        for Placed { region, body } in placed {
            if let Some(region) = self.regions.get_mut(&region) {
                region.owned.insert(body.id, Owned { body, holders: BTreeSet::new() });
            }
        }
    }

    fn apply(&mut self, tick: Tick, op: WorldOp, removed: &mut Vec<BodyRecord>) {
        match op {
            WorldOp::Insert { bodies, .. } => {
                for body in bodies.into_iter().filter(|body| body.traits.kind != BodyKind::Fixed) {
                    let region = self.world().tree.leaf_at(body.state.pose.translation);
                    if let Some(region) = self.regions.get_mut(&region) {
                        let before = region.owned.insert(body.id, Owned { body, holders: BTreeSet::new() });
                        assert!(before.is_none(), "a body is inserted once");
                    }
                }
            }
            WorldOp::Remove(id) => {
                for region in self.regions.values_mut() {
                    removed.extend(region.owned.remove(&id).map(|owned| owned.body));
                    region.ghosts.remove(&id);
                    region.owners.remove(&id);
                }
            }
            WorldOp::RemoveJoint(_)
            | WorldOp::ForgetShapes(_)
            | WorldOp::Push(_)
            | WorldOp::Alter(_)
            | WorldOp::Repartition(_)
            | WorldOp::Schedule(_)
            | WorldOp::Watch(_) => {}
            WorldOp::Ask { client, question } => self.questions.push((client, question)),
            WorldOp::Correct { tick: told, states, stuck: _ } => {
                let (dt_s, band_m) = {
                    let world = self.world();
                    (f64::from(world.step.dt_s), f64::from(world.thresholds.between_groups_m) / 2.0)
                };
                // The poses here are those after the last tick.
                let lag_s = (tick.0 as f64 - 1.0 - told.0 as f64) * dt_s;
                for state in states {
                    let owner = self.regions.values_mut().find_map(|region| region.owned.get_mut(&state.id));
                    if let Some(Owned { body, .. }) = owner {
                        body.state.velocity = correction(&body.state.pose, &state, lag_s, band_m);
                    }
                }
            }
            WorldOp::Input(input) => {
                let owner = self.regions.values_mut().find_map(|region| region.owned.get_mut(&input.body));
                if let Some(owned) = owner {
                    owned.body.state.velocity = input.velocity;
                    owned.body.state.pose = input.pose.unwrap_or(owned.body.state.pose);
                }
            }
        }
    }

    fn fly(&mut self) {
        let dt_s = f64::from(self.world().step.dt_s) / f64::from(self.rounds);
        let bounds = self.world().tree.bounds();
        for owned in self.regions.values_mut().flat_map(|region| region.owned.values_mut()) {
            fly(&mut owned.body.state, &bounds, dt_s);
        }
    }

    /// Returns the regions with which a region here exchanges messages in a tick: regions near it and regions
    /// that hold the same bodies; all regions in every eighth tick, and always where members are not in step.
    fn neighbours(&self, tick: Tick, of: RegionId) -> BTreeSet<RegionId> {
        let EnvironmentProperties { tree, protocol, .. } = self.world();
        if tick.0.is_multiple_of(MEET_EVERY) || protocol.lag_ticks() > 0 {
            return tree.leaves().collect();
        }
        let (cell, region) = (tree.cell(of), &self.regions[&of]);
        let near = tree.leaves().filter(|&leaf| tree.cell(leaf).gap_m(&cell) <= HALO_M);
        let holders = region.owned.values().flat_map(|owned| owned.holders.iter().copied());
        near.chain(holders).chain(region.owners.values().copied()).collect()
    }

    /// Returns the messages of every region, with the transfers that follow from positions. A body is
    /// transferred only to a region that has a ghost of it already.
    fn speak(&mut self, tick: Tick, removed: Vec<BodyRecord>) -> PhysicsEvent {
        let neighbours: BTreeMap<_, _> =
            self.regions.keys().map(|&region| (region, self.neighbours(tick, region))).collect();
        let tree = self.world().tree.clone();
        let mut messages: BTreeMap<(RegionId, RegionId), BorderMessage> = BTreeMap::new();
        for (&from, region) in &mut self.regions {
            let mut to = |to, say: &mut dyn FnMut(&mut BorderMessage)| {
                let empty = || BorderMessage { from, to, tick, ..BorderMessage::default() };
                say(messages.entry((from, to)).or_insert_with(empty));
            };
            let mut left = Vec::new();
            for (&id, Owned { body, holders }) in &mut region.owned {
                if body.traits.kind == BodyKind::Fixed {
                    continue;
                }
                let place = body.state.pose.translation;
                let mut wanted: BTreeSet<_> =
                    tree.leaves_touching(&Bounds::around(place, [HALO_M; 3])).into_iter().collect();
                wanted.remove(&from);
                let target = tree.leaf_at(place);
                let leaves = target != from && holders.contains(&target);
                // A region that gets a ghost of a body that leaves would not know its owner.
                wanted.retain(|new| holders.contains(new) || neighbours[&from].contains(new) && !leaves);
                for &gone in holders.difference(&wanted) {
                    to(gone, &mut |message| message.drops.push(id));
                }
                for &new in wanted.difference(holders) {
                    to(new, &mut |message| message.ghosts.push(body.clone()));
                }
                if leaves {
                    body.epoch = body.epoch.next();
                }
                for &kept in holders.intersection(&wanted).filter(|&&kept| !leaves || kept != target) {
                    let owner = if leaves { target } else { from };
                    to(kept, &mut |message| message.states.push(shared(body, owner)));
                }
                *holders = wanted;
                if leaves {
                    let mut set = RegionSet::EMPTY;
                    for (rank, leaf) in tree.leaves().enumerate() {
                        if leaf != target && (leaf == from || holders.contains(&leaf)) {
                            set.insert(rank);
                        }
                    }
                    let transfer = Transfer { body: body.clone(), holders: set, whole: false };
                    to(target, &mut |message| message.transfers.push(transfer.clone()));
                    left.push((id, target));
                }
            }
            for (id, target) in left {
                region.owners.insert(id, target);
                region.ghosts.extend(region.owned.remove(&id).map(|owned| (id, owned.body)));
            }
        }
        let elsewhere: BTreeSet<_> = neighbours.into_values().flatten().collect();
        let elsewhere = elsewhere.into_iter().filter(|region| !self.regions.contains_key(region));
        PhysicsEvent::Computed {
            outgoing: messages.into_values().collect(),
            neighbours: elsewhere.collect(),
            removed,
        }
    }

    fn hear(&mut self, tick: Tick, mut message: BorderMessage) {
        if message.tick < tick {
            message.extrapolate((tick.0 - message.tick.0) as f64 * f64::from(self.world().step.dt_s));
        }
        let tree = self.world().tree.clone();
        let region = self.regions.get_mut(&message.to).expect("messages go to regions of this node");
        region.owners.extend(message.ghosts.iter().map(|ghost| (ghost.id, message.from)));
        region.ghosts.extend(message.ghosts.into_iter().map(|ghost| (ghost.id, ghost)));
        for state in message.states {
            if let Some(body) = region.ghosts.get_mut(&state.id) {
                assert!(body.epoch <= state.epoch, "no state goes back in time");
                body.epoch = state.epoch;
                region.owners.insert(state.id, state.owner);
                body.state.pose = state.pose;
                body.state.velocity = state.velocity;
            }
        }
        for id in message.drops {
            region.ghosts.remove(&id);
            region.owners.remove(&id);
        }
        for Transfer { body, holders, .. } in message.transfers {
            region.ghosts.remove(&body.id);
            region.owners.remove(&body.id);
            let holders =
                tree.leaves().enumerate().filter(|(rank, _)| holders.contains(*rank)).map(|(_, leaf)| leaf);
            region.owned.insert(body.id, Owned { body, holders: holders.collect() });
        }
    }

    /// Changes the tree: regions are renamed, begin here, or are given up.
    fn repartition(&mut self, changes: &[TreeChange], newborn_here: bool) {
        let tree = &mut self.world.as_mut().expect("the world comes first").tree;
        let renamings: Vec<_> = changes.iter().filter_map(|change| tree.renaming(change)).collect();
        tree.change(changes).expect("it suits the tree");
        for Renaming { from, to, born, gone } in renamings {
            if let Some(born) = born.filter(|_| newborn_here) {
                self.regions.insert(born, Region::default());
            }
            if let Some(region) = gone.and_then(|gone| self.regions.remove(&gone)) {
                assert!(region.is_vacant(), "{gone:?} is given up with bodies");
            }
            if let Some(region) = self.regions.remove(&from) {
                self.regions.insert(to, region);
            }
            for owner in self.regions.values_mut().flat_map(|region| region.owners.values_mut()) {
                if *owner == from {
                    *owner = to;
                }
            }
            for owned in self.regions.values_mut().flat_map(|region| region.owned.values_mut()) {
                if owned.holders.remove(&from) {
                    owned.holders.insert(to);
                }
            }
        }
    }

    /// Returns the load of the regions here: every body is as much work as any other.
    fn load_report(&self) -> LoadReport {
        let regions = self.regions.iter().map(|(&region, content)| {
            let count = content.owned.len() as f64;
            RegionLoad { region, activity: count, step_us: count * WORK_US, vacant: content.is_vacant() }
        });
        let owned = self.regions.values().flat_map(|region| region.owned.values());
        let burden =
            |owned: &Owned| Burden { place: owned.body.state.pose.translation, weight: 1.0, island: None };
        let burdens = summarised(owned.map(burden).collect(), LoadReport::BURDENS * self.regions.len());
        LoadReport { regions: regions.collect(), burdens, islands: Vec::new() }
    }

    fn settled(&mut self, tick: Tick, report: Sampling, checkpoint: Sampling, load: bool) -> PhysicsEvent {
        let events = self.regions.iter_mut().map(|(&region, content)| {
            let touches = content.touches();
            RegionEvents { region, tick, touches, ..RegionEvents::default() }
        });
        let events = events.collect();
        let owned: BTreeMap<_, _> = self
            .regions
            .values()
            .flat_map(|region| region.owned.values().map(|owned| (owned.body.id, &owned.body)))
            .collect();
        let regions = self.regions.iter();
        let owners: BTreeMap<_, _> =
            regions.flat_map(|(&id, region)| region.owned.keys().map(move |&body| (body, id))).collect();
        let owner_of = |body: BodyId| owners[&body];
        let stats = TickStats {
            bodies: owned.len() as u32,
            ghosts: self.regions.values().map(|region| region.ghosts.len() as u32).sum(),
            ..TickStats::default()
        };
        let report =
            sample(report, &owned, &mut self.reported).map(|body| shared(body, owner_of(body.id))).collect();
        let checkpoint = sample(checkpoint, &owned, &mut self.checkpointed)
            .map(|body| {
                let (id, region) = (body.id, owner_of(body.id));
                BodyCheckpoint { id, region, epoch: body.epoch, state: body.state }
            })
            .collect();
        let rounds_wanted = self.rounds_wanted();
        let holds = self.regions.values().flat_map(|region| region.owned.keys().chain(region.ghosts.keys()));
        let holds: BTreeSet<_> = holds.filter(|id| id.client().is_some()).copied().collect();
        let holds = holds.into_iter().collect();
        let questions = std::mem::take(&mut self.questions);
        let answers =
            questions.into_iter().map(|(client, question)| answer(&owned, client, &question)).collect();
        let load = load.then(|| self.load_report());
        let regions = Vec::new();
        PhysicsEvent::Settled {
            rounds_wanted,
            stats,
            holds,
            events,
            answers,
            report,
            checkpoint,
            load,
            regions,
        }
    }
}

/// Answers a question. Bodies are balls of a metre, shapes are points, and no filter leaves anything out.
fn answer(owned: &BTreeMap<BodyId, &BodyRecord>, client: ClientId, question: &Query) -> Answer {
    let mut found = question.parts.nothing();
    for body in owned.values() {
        let at = body.state.pose.translation;
        let near = |place: [f64; 3]| (0..3).map(|i| (at[i] - place[i]).powi(2)).sum::<f64>() < 1.0;
        let is_at = |place: &Place| match place {
            Place::Shape(_, pose) => near(pose.translation),
            Place::Point(point) => near(*point),
            Place::Box(bounds) => bounds.contains(&Bounds::new(at, at)),
        };
        let met = match &question.parts {
            QueryParts::Rays(rays) => QueryResult::Rays(rays.iter().map(|ray| on_ray(body, ray)).collect()),
            QueryParts::Casts(casts) => {
                QueryResult::Casts(casts.iter().map(|cast| on_way(body, cast)).collect())
            }
            QueryParts::Overlaps(overlaps) => {
                let overlap = Overlap { body: body.id, collider: 0 };
                let there = |asked: &OverlapQuery| is_at(&asked.place).then_some(overlap);
                QueryResult::Overlaps(
                    overlaps.iter().map(|asked| there(asked).into_iter().collect()).collect(),
                )
            }
        };
        found.join(met);
    }
    Answer { client, number: question.number, found }
}

fn on_ray(body: &BodyRecord, ray: &RayQuery) -> Option<RayAnswer> {
    let (body, point) = (body.id, body.state.pose.translation);
    let distance_m =
        passed(point, ray.origin, ray.direction).filter(|distance_m| *distance_m <= ray.max_m)?;
    Some(RayAnswer { body, collider: 0, point, normal: [0.0; 3], distance_m, subshape: 0 })
}

fn on_way(body: &BodyRecord, cast: &CastQuery) -> Option<CastAnswer> {
    let (body, point) = (body.id, body.state.pose.translation);
    let length = cast.motion.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    let fraction = (passed(point, cast.pose.translation, cast.motion)? / length) as f32;
    let [normal, point_on_shape, normal_on_shape] = [[0.0; 3]; 3];
    let (collider, subshape, inside) = (0, 0, fraction == 0.0);
    let hit = CastAnswer {
        body,
        collider,
        fraction,
        point,
        normal,
        point_on_shape,
        normal_on_shape,
        subshape,
        inside,
    };
    (fraction <= 1.0).then_some(hit)
}

/// Returns the distance along a way at which it passes within a metre of a place; `None` if it does not.
fn passed(place: [f64; 3], origin: [f64; 3], direction: [f32; 3]) -> Option<f64> {
    let along = nalgebra::Vector3::from(direction.map(f64::from)).normalize();
    let from = nalgebra::Vector3::from(place) - nalgebra::Vector3::from(origin);
    let distance_m = from.dot(&along);
    (distance_m >= 0.0 && (from - along * distance_m).norm() < 1.0).then_some(distance_m)
}

fn shared(body: &BodyRecord, owner: RegionId) -> SharedState {
    let BodyState { pose, velocity, sleeping, .. } = body.state;
    SharedState { id: body.id, owner, epoch: body.epoch, pose, velocity, sleeping }
}

fn sample<'a>(
    sampling: Sampling,
    owned: &BTreeMap<BodyId, &'a BodyRecord>,
    last: &mut BTreeMap<BodyId, BodyState>,
) -> impl Iterator<Item = &'a BodyRecord> + use<'a> {
    let mut chosen = Vec::new();
    if sampling != Sampling::Nothing {
        let moved = |body: &BodyRecord| last.get(&body.id) != Some(&body.state);
        chosen.extend(owned.values().filter(|body| sampling == Sampling::All || moved(body)).copied());
        *last = owned.iter().map(|(&id, body)| (id, body.state)).collect();
    }
    chosen.into_iter()
}
