//! Implements the leader of a group, the part of a node that is active while it leads: it opens each tick when all members are
//! done with the last (lockstep), takes in clients' inputs, and sends contacts and states to clients (thesis 3.3.8, 4.3.2.10).

mod balancing;
mod holders;
mod inter_group;
mod interest;
mod questions;
mod state_replication;
#[cfg(test)]
mod tests;

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use self::balancing::Balancing;
use self::holders::Holders;
pub use self::inter_group::Deviations;
use self::inter_group::InterGroup;
use self::interest::{Audience, Latest, Moved};
use self::questions::Questions;
pub(super) use self::state_replication::TELL_TICK;

use super::{MAX_AVATARS, Peer};
use crate::protocol::{
    Area, ContactLedger, Dispatch, Done, EnvironmentProperties, FromClient, Input, Pace, Query, Refusal,
    RegionEvents, Repartition, Report, Thresholds, ToClient, View, ViewNumber, WorldOp, encoded_len,
};
use crate::space::{Allocation, BodyId, ClientId, GroupId, NodeId, RegionId, Renaming, Tick};

/// How long an input waits for its avatar to appear, in ticks.
const EARLY_TICKS: u64 = 60;
/// The most bytes of the server's operations in one tick, unless the first is longer: what is left over waits.
const OPS_BYTES: usize = 4 << 20;
/// Allocations kept, of which late reports may speak.
const KEPT_ALLOCATIONS: usize = 8;

/// The state of a leader: it begins and ends with a view.
#[derive(Clone, Debug)]
pub struct Leader {
    view: ViewNumber,
    group: GroupId,
    members: BTreeSet<NodeId>,
    dt: Duration,
    pace: Pace,
    speed_limit: f32,
    /// The last dispatched tick; that of the view before the first.
    tick: Tick,
    last_tick: Option<Tick>,
    /// Returns the newest tick that each member has completed, and what it cost.
    done: BTreeMap<NodeId, Tick>,
    /// How many ticks members may be apart.
    lag: u64,
    /// The most rounds that a member wants for the next tick, of those that are done.
    rounds_wanted: u32,
    holders: Holders,
    events: BTreeMap<RegionId, RegionEvents>,
    next_due: Duration,
    ops: Vec<WorldOp>,
    inputs: BTreeMap<BodyId, Input>,
    /// Newest inputs for avatars not heard of yet, and since when they wait.
    early: BTreeMap<BodyId, (Input, Tick)>,
    /// Avatars in the world and the logical time of their newest input.
    avatars: BTreeMap<BodyId, Option<u64>>,
    latest: Latest,
    moved: Moved,
    reminded: BodyId,
    contacts: ContactLedger,
    clients: BTreeMap<ClientId, Peer>,
    /// The tick that each client was last sent.
    told: BTreeMap<ClientId, Tick>,
    questions: Questions,
    /// Interests that clients have sent since the last tick.
    interests: BTreeMap<ClientId, Option<Area>>,
    /// Audiences of clients that have an area of interest.
    audiences: BTreeMap<ClientId, Audience>,
    messages: Vec<(ClientId, ToClient)>,
    thresholds: Thresholds,
    /// The state between groups, while there are other groups.
    inter_group: Option<InterGroup>,
    /// While the regions follow the load.
    balancing: Option<Balancing>,
    /// Who computes which regions, from which tick on: what a member says counts of its own regions only.
    computed_by: VecDeque<(Tick, Allocation)>,
}

impl Leader {
    /// Returns the leader of this view from `now` on.
    pub fn new(now: Duration, view: &View, world: &EnvironmentProperties) -> Self {
        let participants =
            view.members.iter().filter_map(|member| Some((member.client?, Peer::Node(member.node))));
        Self {
            view: view.number,
            group: view.group,
            members: view.members.iter().map(|member| member.node).collect(),
            dt: Duration::from_secs_f32(world.step.dt_s),
            pace: world.pace,
            speed_limit: world.avatar_speed_limit,
            tick: view.tick,
            last_tick: world.last_tick,
            done: BTreeMap::new(),
            lag: world.protocol.lag_ticks(),
            rounds_wanted: 1,
            holders: Holders::default(),
            events: BTreeMap::new(),
            next_due: now,
            ops: Vec::new(),
            inputs: BTreeMap::new(),
            early: BTreeMap::new(),
            avatars: BTreeMap::new(),
            latest: Latest::new(),
            moved: Moved::new(),
            reminded: BodyId::default(),
            contacts: ContactLedger::default(),
            clients: participants.collect(),
            told: BTreeMap::new(),
            questions: Questions::default(),
            interests: BTreeMap::new(),
            audiences: BTreeMap::new(),
            messages: Vec::new(),
            thresholds: world.thresholds,
            inter_group: None,
            balancing: world
                .balance
                .map(|settings| Balancing::new(settings, view.clone(), world.protocol.lag_ticks() > 0)),
            computed_by: [(view.tick, view.allocation.clone())].into(),
        }
    }

    /// Returns the view it leads.
    pub fn view(&self) -> ViewNumber {
        self.view
    }

    /// Adds the server's operations to the next tick.
    pub fn apply(&mut self, ops: Vec<WorldOp>) {
        self.ops.extend(ops);
    }

    /// Admits a client that is linked directly; it is sent every body at once, and sends its interest again.
    pub fn admit(&mut self, client: ClientId) {
        self.clients.insert(client, Peer::Client(client));
        self.uninterest(client);
        self.tell_everything(client);
    }

    /// Takes in a client's area of interest; `None` is everything. It counts after the present tick, so that however often it
    /// changes, all bodies are looked at once per tick.
    pub fn take_interest(&mut self, client: ClientId, area: Option<Area>) {
        // One that is not linked sends it again when it is.
        if self.clients.contains_key(&client) {
            self.interests.insert(client, area);
        }
    }

    /// Takes in a client's question about bodies, perhaps once more; the answer comes with the next tick, or a later one.
    pub fn ask(&mut self, client: ClientId, question: Query) {
        if self.clients.contains_key(&client) {
            self.questions.ask(client, question);
        }
    }

    fn turn_audiences(&mut self) {
        for (client, area) in std::mem::take(&mut self.interests) {
            match (self.audiences.get_mut(&client), area) {
                (Some(audience), Some(area)) => audience.turn_to(area, &self.latest),
                (None, Some(area)) => {
                    self.audiences.insert(client, Audience::new(client, area, &self.latest));
                }
                (Some(_), None) => {
                    self.audiences.remove(&client);
                    self.tell_everything(client);
                }
                (None, None) => {}
            }
        }
    }

    fn uninterest(&mut self, client: ClientId) {
        self.interests.remove(&client);
        self.audiences.remove(&client);
    }

    fn tell_everything(&mut self, client: ClientId) {
        let states = self.latest.values().map(|&(state, _)| state).collect();
        self.tell(client, self.tick, false, states);
    }

    /// Removes a client whose direct link is gone.
    pub fn dismiss(&mut self, client: ClientId) {
        if self.clients.get(&client) == Some(&Peer::Client(client)) {
            self.clients.remove(&client);
            self.told.remove(&client);
            self.uninterest(client);
            self.questions.forget(client);
        }
    }

    /// Returns the link over which a client is reached.
    pub fn route(&self, client: ClientId) -> Option<Peer> {
        self.clients.get(&client).copied()
    }

    /// Accepts a client's input for an avatar if that is its own, and the input is within the speed limit and newer than the
    /// last one.
    pub fn accept_input(&mut self, client: ClientId, input: Input) -> Result<(), Refusal> {
        if input.body.client() != Some(client) {
            return Err(Refusal::NotYours);
        }
        if !input.velocity.is_within(self.speed_limit) {
            return Err(Refusal::TooFast);
        }
        let Some(last) = self.avatars.get_mut(&input.body) else {
            // A new leader, or one whom the input reached before the server's word, may yet hear of the avatar.
            let range = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
            if self.early.range(range).count() >= MAX_AVATARS {
                return Err(Refusal::TooMany);
            }
            let (known, _) = self.early.entry(input.body).or_insert((input, self.tick));
            if known.logical_time < input.logical_time {
                *known = input;
            }
            return Ok(());
        };
        // Sent again because it might have been lost.
        if *last == Some(input.logical_time) {
            return Ok(());
        }
        if last.is_some_and(|last| input.logical_time < last) {
            return Err(Refusal::Late);
        }
        *last = Some(input.logical_time);
        self.inputs.insert(input.body, input);
        Ok(())
    }

    /// Returns whether a member computes a region after a tick.
    fn computes(&self, from: NodeId, region: RegionId, tick: Tick) -> bool {
        let since = self.computed_by.iter().rev().find(|(since, _)| *since <= tick);
        since.is_some_and(|(_, allocation)| allocation.get(&region) == Some(&from))
    }

    /// Takes in that a member has completed a tick: it has reached the barrier.
    pub fn done(&mut self, from: NodeId, mut done: Done) {
        // A message may come again after a link broke.
        let is_new = self.done.get(&from).is_none_or(|&known| known < done.tick);
        if done.tick > self.tick || !self.members.contains(&from) || !is_new {
            return;
        }
        let was_complete = self.completed();
        self.done.insert(from, done.tick);
        if let Some(holds) = done.holds {
            self.holders.now_holds(from, holds);
        }
        self.rounds_wanted = self.rounds_wanted.max(done.rounds_wanted);
        if let (Some(balancing), Some(load)) = (&mut self.balancing, done.load) {
            balancing.hear(from, done.tick, load);
        }
        self.questions.answered(from, done.answers);
        self.messages.extend(self.questions.tell());
        done.events.retain(|events| self.computes(from, events.region, done.tick));
        self.events.extend(done.events.into_iter().map(|events| (events.region, events)));
        if self.lag > 0 {
            self.forward_contacts();
        }
        let completed = self.completed();
        if completed.is_some() && completed > was_complete {
            self.forward_contacts();
            self.forward_states();
            self.compare_and_tell();
        }
    }

    /// Takes in the states of bodies that moved in one member's regions. Returns how many are not believed: those of bodies in regions
    /// that others compute.
    pub fn report(&mut self, from: NodeId, report: Report) -> u64 {
        let mut refused = 0;
        for state in report.states {
            if !self.computes(from, state.owner, report.tick) {
                refused += 1;
                continue;
            }
            let before = match self.latest.entry(state.id) {
                Entry::Vacant(entry) => {
                    entry.insert((state, report.tick));
                    None
                }
                Entry::Occupied(mut entry) => {
                    let (old, tick) = *entry.get();
                    if (old.epoch, tick) > (state.epoch, report.tick) {
                        continue;
                    }
                    entry.insert((state, report.tick));
                    Some(old.pose.translation)
                }
            };
            self.moved.entry(state.id).or_insert(before);
            self.moved_here(state.id);
            if state.id.client().is_some() {
                self.avatars.entry(state.id).or_default();
            }
        }
        refused
    }

    /// Returns when the next tick may be dispatched, if all members are ready for it.
    pub fn timeout(&self) -> Option<Duration> {
        (self.is_complete() && self.last_tick != Some(self.tick)).then_some(self.next_due)
    }

    /// Opens the next tick, if all members are ready and its time has come.
    pub fn dispatch(&mut self, now: Duration) -> Option<Dispatch> {
        if self.timeout().is_none_or(|due| now < due) {
            return None;
        }
        self.next_due = match self.pace {
            Pace::Unpaced => now,
            Pace::RealTime => (self.next_due + self.dt.mul_f32(self.stretch())).max(now),
        };
        self.tick = self.tick.next();
        let mut ops = self.next_ops();
        ops.extend(self.repartition().map(WorldOp::Repartition));
        for op in &ops {
            match op {
                WorldOp::Insert { bodies, .. } => {
                    for body in bodies.iter().filter(|body| body.id.client().is_some()) {
                        self.avatars.entry(body.id).or_default();
                    }
                }
                WorldOp::Remove(id) => self.forget(*id),
                _ => {}
            }
        }
        self.sort_early();
        ops.extend(std::mem::take(&mut self.inputs).into_values().map(WorldOp::Input));
        ops.extend(self.corrections());
        ops.extend(self.questions.dispatch(&self.members));
        self.questions.allow();
        self.messages.extend(self.questions.tell());
        // Members that are not in step cannot exchange within a tick.
        let wanted = std::mem::replace(&mut self.rounds_wanted, 1);
        let rounds = if self.lag == 0 { wanted } else { 1 };
        Some(Dispatch { view: self.view, tick: self.tick, rounds, ops })
    }

    /// Returns the change of the tree before this tick, if the load asks for one.
    fn repartition(&mut self) -> Option<Repartition> {
        let balancing = self.balancing.as_mut()?;
        let before = balancing.tree().clone();
        let change = balancing.plan()?;
        for Renaming { from, to, .. } in change.renamings(&before) {
            self.contacts.rename(from, to);
        }
        self.computed_by.push_back((self.tick, balancing.allocation().clone()));
        if self.computed_by.len() > KEPT_ALLOCATIONS {
            self.computed_by.pop_front();
        }
        Some(change)
    }

    /// Takes the server's operations of one tick: as many as a message has room for, in order. The others wait.
    fn next_ops(&mut self) -> Vec<WorldOp> {
        let mut bytes = 0;
        let is_over = |op: &WorldOp| {
            bytes += encoded_len(op);
            bytes > OPS_BYTES
        };
        // One alone is never too long: the server splits what it sends.
        let count = self.ops.iter().position(is_over).map_or(self.ops.len(), |count| count.max(1));
        let later = self.ops.split_off(count);
        std::mem::replace(&mut self.ops, later)
    }

    /// Inputs for avatars that have appeared count now; those that waited too long are refused.
    fn sort_early(&mut self) {
        for (id, (input, since)) in std::mem::take(&mut self.early) {
            if let Some(last) = self.avatars.get_mut(&id) {
                // A later input may have come since the avatar appeared.
                if *last < Some(input.logical_time) {
                    *last = Some(input.logical_time);
                    self.inputs.insert(id, input);
                }
            } else if self.tick.0 - since.0 < EARLY_TICKS {
                self.early.insert(id, (input, since));
            } else if let Some(client) = id.client() {
                let refusal = ToClient::Rejected { body: Some(id), reason: Refusal::Unknown };
                self.messages.push((client, refusal));
            }
        }
    }

    /// Returns the messages for clients since the last call.
    pub fn take_messages(&mut self) -> Vec<(ClientId, ToClient)> {
        std::mem::take(&mut self.messages)
    }

    /// The newest tick that all members have completed.
    fn completed(&self) -> Option<Tick> {
        let ticks = self.members.iter().map(|node| self.done.get(node).copied());
        ticks.min().flatten()
    }

    /// Whether the next tick may begin as far as members go.
    fn is_complete(&self) -> bool {
        self.completed().is_some_and(|completed| self.tick.0 <= completed.0 + self.lag)
    }

    /// Returns the part of a dispatch that concerns one member: inputs for avatars go to members that hold them, and once more
    /// to those that held them before, so that they let go (thesis 3.3.8).
    pub fn for_member(&mut self, node: NodeId, dispatch: &Dispatch) -> Dispatch {
        let holders = &mut self.holders;
        let mut concerns = |op: &WorldOp| match op {
            // All must know of what concerns all.
            WorldOp::Input(input) => holders.concerns(node, input.body) || op.concerns_all(),
            _ => true,
        };
        let ops = dispatch.ops.iter().filter(|op| concerns(op)).cloned().collect();
        Dispatch { ops, ..*dispatch }
    }

    fn forget(&mut self, id: BodyId) {
        self.avatars.remove(&id);
        self.inputs.remove(&id);
        self.latest.remove(&id);
        self.moved.remove(&id);
        self.audiences.values_mut().for_each(|audience| audience.forget(id));
        self.contacts.forget_body(id);
        self.holders.forget(id);
        self.forget_in_other_groups(id);
    }

    /// Returns the inputs that are not dispatched yet, for speculative ticks.
    pub fn inputs(&self) -> impl Iterator<Item = Input> {
        self.inputs.values().copied()
    }

    /// Returns what another leader must know of clients: inputs that are not dispatched yet, and their interests.
    pub fn into_inputs(self) -> Vec<(ClientId, FromClient)> {
        let early = self.early.into_values().map(|(input, _)| input);
        let inputs = self.inputs.into_values().chain(early);
        let inputs = inputs.filter_map(|input| Some((input.body.client()?, FromClient::Input(input))));
        let areas = self.audiences.into_iter().map(|(client, audience)| (client, Some(audience.area())));
        let interests = areas.chain(self.interests);
        inputs.chain(interests.map(|(client, area)| (client, FromClient::Interest(area)))).collect()
    }

    /// Returns whether there are clients to send states to.
    pub fn has_clients(&self) -> bool {
        !self.clients.is_empty()
    }

    /// Returns the members that have not completed the newest tick, but for the lag that they may have.
    pub fn missing(&self) -> impl Iterator<Item = NodeId> {
        let is_behind =
            |node: &&NodeId| self.done.get(node).is_none_or(|&tick| tick.0 + self.lag < self.tick.0);
        self.members.iter().filter(is_behind).copied()
    }
}
