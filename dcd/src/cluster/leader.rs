//! Implements the leader of a group, the part of a node that is active while it leads: it opens each tick
//! when all members have completed the last one (lockstep), takes in clients' inputs, and sends contacts and
//! states to clients (thesis 3.3.8, 4.3.2.10).

mod balancing;
mod condensed;
mod contacts;
mod holders;
mod inputs;
mod inter_group;
mod questions;
mod relays;
mod scheduling;
#[cfg(test)]
mod tests;
mod watching;

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use self::balancing::Balancing;
use self::condensed::condensed;
use self::holders::Holders;
use self::inputs::{Inputs, Taken};
pub use self::inter_group::Deviations;
use self::inter_group::InterGroup;
use self::questions::Questions;
use self::relays::Relays;
use self::scheduling::Scheduling;
use self::watching::Watching;
use super::Peer;
use super::state_replication::{Latest, Replication, ReplicationEvent, StateReplication, TickNews};
use crate::fidelity::Schedule;
use crate::protocol::{
    Area, BodyRecord, ContactLedger, Dispatch, Done, EnvironmentProperties, FromClient, Heard, Input, Pace,
    Query, Refusal, RegionEvents, Repartition, Report, SharedState, Thresholds, ToClient, ToServer, View,
    ViewNumber, WorldOp, encoded_len, most_items,
};
use crate::space::{
    Allocation, BodyId, ClientId, DistributionTree, Epoch, NodeId, RegionId, Renaming, Tick, Viewpoint,
};

/// The most bytes of the server's operations in one tick, unless the first alone is longer. The rest waits.
const OPS_BYTES: usize = 4 << 20;
/// The number of ticks between reports to the server of what fidelity saves.
const TELL_FIDELITY: u64 = 60;
/// The number of allocations kept, for late reports.
const KEPT_ALLOCATIONS: usize = 8;

/// The state that a leader hands on to itself if it leads the next view, too.
#[derive(Clone, Debug)]
pub struct Legacy {
    contacts: ContactLedger,
    allocation: Allocation,
}

/// The state of a leader. It begins and ends with a view.
#[derive(Clone, Debug)]
pub struct Leader {
    view: ViewNumber,
    members: BTreeSet<NodeId>,
    dt: Duration,
    pace: Pace,
    /// The last dispatched tick; the view's tick before the first.
    tick: Tick,
    /// The time at which it was due, by which clients count time.
    opened: Duration,
    last_tick: Option<Tick>,
    /// The newest tick that each member has completed.
    done: BTreeMap<NodeId, Tick>,
    /// How many ticks members may be apart.
    lag: u64,
    /// The most rounds for the next tick that any member has asked for.
    rounds_wanted: u32,
    holders: Holders,
    events: BTreeMap<RegionId, RegionEvents>,
    next_due: Duration,
    ops: Vec<WorldOp>,
    /// The number of the server's operations that move bodies and have come.
    moves_heard: u64,
    inputs: Inputs,
    latest: Latest,
    /// Bodies that were removed by a tick which not all members have completed, each with that tick, or with
    /// the tick in which it came again. Members that are behind report such a body as it was before.
    gone: BTreeMap<BodyId, Tick>,
    /// Bodies that moved since clients were last told.
    moved: BTreeSet<BodyId>,
    contacts: ContactLedger,
    clients: BTreeMap<ClientId, Peer>,
    /// The logical time of each client's newest applied input, and how many ticks early it came.
    applied: BTreeMap<ClientId, (u64, i8)>,
    /// The news for the replication, to be given with the next tick.
    news: TickNews,
    replication: Replication,
    relays: Relays,
    watching: Watching,
    questions: Questions,
    /// The area of interest of each client that has named one; `None` in it is everything.
    interests: BTreeMap<ClientId, Option<Area>>,
    messages: Vec<(ClientId, ToClient)>,
    server_messages: Vec<ToServer>,
    /// Says whether the server's program hears of all contacts.
    events_to_server: bool,
    thresholds: Thresholds,
    /// The state between groups, while there are other groups.
    inter_group: Option<InterGroup>,
    /// The balancer, if the regions follow the load.
    balancing: Option<Balancing>,
    /// The choice of the regions that stay behind, if not everything is computed in full.
    scheduling: Option<Scheduling>,
    /// Who computes which regions, from which tick on. A member is believed about its own regions only.
    computed_by: VecDeque<(Tick, Allocation)>,
    /// The tree of the view as it begins. While regions follow the load, `balancing` has the present one.
    tree: DistributionTree,
    /// The newest view, of any group, in which the server has placed a body that members may report.
    newest_view: u64,
}

impl Leader {
    /// Returns the leader of this view from `now` on.
    pub fn new(now: Duration, view: &View, world: &EnvironmentProperties) -> Self {
        let participants =
            view.members.iter().filter_map(|member| Some((member.client?, Peer::Node(member.node))));
        let clients: BTreeMap<_, _> = participants.collect();
        Self {
            view: view.number,
            members: view.members.iter().map(|member| member.node).collect(),
            dt: Duration::from_secs_f32(world.step.dt_s),
            pace: world.pace,
            tick: view.tick,
            opened: now,
            last_tick: world.last_tick,
            done: BTreeMap::new(),
            lag: world.protocol.lag_ticks(),
            rounds_wanted: 1,
            holders: Holders::default(),
            events: BTreeMap::new(),
            next_due: now,
            ops: Vec::new(),
            moves_heard: 0,
            inputs: Inputs::new(world),
            latest: Latest::new(),
            gone: BTreeMap::new(),
            moved: BTreeSet::new(),
            contacts: ContactLedger::default(),
            replication: Replication::Here(Box::new(StateReplication::new(now, view, world, &clients))),
            relays: Relays::new(view, world),
            watching: Watching::new(world.state_every),
            applied: BTreeMap::new(),
            news: TickNews::default(),
            clients,
            questions: Questions::default(),
            interests: BTreeMap::new(),
            messages: Vec::new(),
            server_messages: Vec::new(),
            events_to_server: view.events,
            thresholds: world.thresholds,
            inter_group: None,
            balancing: world
                .balance
                .map(|settings| Balancing::new(settings, view.clone(), world.protocol.lag_ticks() > 0)),
            scheduling: Scheduling::new(view, world),
            computed_by: [(view.tick, view.allocation.clone())].into(),
            tree: view.tree.clone(),
            newest_view: view.number.0,
        }
    }

    /// Returns the number of the view that it leads.
    pub fn view(&self) -> ViewNumber {
        self.view
    }

    /// Returns the newest tick, when it was opened, and how long a tick is.
    pub fn opened(&self) -> (Tick, Duration, Duration) {
        (self.tick, self.opened, self.dt)
    }

    /// Notes that bodies of the view were placed in the view of this number or before.
    pub(super) fn knows_view(&mut self, number: u64) {
        self.newest_view = self.newest_view.max(number);
    }

    /// Adds the server's operations to the next tick.
    pub fn apply(&mut self, ops: Vec<WorldOp>) {
        self.ops.extend(ops);
    }

    /// Adds the operations of a message. `first` is the number of the first of them that moves a body. An
    /// operation with another number than the next came over a new link, before the server knew what was lost
    /// with the link before. It is passed over: the server sends it again after the lost ones.
    pub(super) fn hear_ops(&mut self, first: u64, mut ops: Vec<WorldOp>) {
        let mut number = first;
        ops.retain(|op| {
            let moves = u64::from(op.moves().is_some());
            let counts = moves == 0 || number == self.moves_heard;
            number = number.saturating_add(moves);
            self.moves_heard += if counts { moves } else { 0 };
            counts
        });
        self.apply(ops);
    }

    /// Returns how many of the server's operations that move bodies have come.
    pub(super) fn moves_heard(&self) -> u64 {
        self.moves_heard
    }

    /// Leaves the states for clients to whoever is given the events of [`Leader::take_replication_events`],
    /// from the first on.
    #[must_use]
    pub fn with_replication_elsewhere(mut self) -> Self {
        self.replication = self.replication.moved_elsewhere();
        self
    }

    /// Returns the events for a replication elsewhere since the last call.
    pub fn take_replication_events(&mut self) -> Vec<ReplicationEvent> {
        self.replication.take_events()
    }

    fn replicate(&mut self, event: ReplicationEvent) {
        let (for_clients, for_members) = self.replication.handle(event);
        self.messages.extend(for_clients);
        self.relays.messages.extend(for_members);
    }

    /// Admits a client that is linked directly. The client then says what it wants to hear of.
    pub fn admit(&mut self, client: ClientId) {
        self.clients.insert(client, Peer::Client(client));
        self.uninterest(client);
        self.relays.forget(client);
        let turn = self.relays.next_turn(client);
        // A relay may have told it up to now.
        let told_elsewhere = turn > 0;
        self.replicate(ReplicationEvent::Admit { client, turn, told_elsewhere, area: None });
    }

    /// Takes in a client's area of interest; `None` is everything. It counts after the present tick, so that
    /// all bodies are looked at once per tick however often the area changes.
    pub fn take_interest(&mut self, client: ClientId, area: Option<Area>) {
        // A client that is not linked sends it again when it is.
        if self.clients.contains_key(&client) {
            self.interests.insert(client, area);
            self.watch(client, area);
            self.relays.interested(client);
        }
    }

    /// Takes in the viewpoints of the server's program, which count from the next tick on.
    pub(super) fn look(&mut self, viewpoints: Vec<Viewpoint>) {
        self.scheduling.iter_mut().for_each(|scheduling| scheduling.look(viewpoints.clone()));
    }

    /// Takes in a client's query, perhaps once more. The answer comes with the next tick, or a later one.
    pub fn ask(&mut self, client: ClientId, question: Query) {
        if self.clients.contains_key(&client) {
            self.questions.ask(client, question);
        }
    }

    /// Takes in a query of the server's program, perhaps once more. The answer goes to the server.
    pub fn ask_for_server(&mut self, question: Query) {
        self.questions.ask(ClientId::NOBODY, question);
    }

    fn uninterest(&mut self, client: ClientId) {
        self.interests.remove(&client);
        self.unwatch(client);
        self.news.uninterested(client);
    }

    /// Removes a client whose direct link is gone.
    pub fn dismiss(&mut self, client: ClientId) {
        if self.clients.get(&client) == Some(&Peer::Client(client)) {
            self.clients.remove(&client);
            self.applied.remove(&client);
            self.uninterest(client);
            self.questions.forget(client);
            self.relays.forget(client);
            self.replicate(ReplicationEvent::Dismiss(client));
        }
    }

    /// Returns the link over which a client is reached.
    pub fn route(&self, client: ClientId) -> Option<Peer> {
        self.clients.get(&client).copied()
    }

    /// Accepts a client's input if it is for an avatar of its own, is newer than the last one, and keeps the
    /// world's limits of speed, spin and jumps.
    pub fn accept_input(&mut self, client: ClientId, input: Input) -> Result<(), Refusal> {
        self.inputs.accept(client, input, self.tick)
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
        if let Some(scheduling) = &mut self.scheduling {
            scheduling.hear(from, Duration::from_micros(done.compute_us.into()), done.regions);
        }
        self.questions.answered(from, done.answers);
        self.questions.done(from, done.tick);
        self.messages.extend(self.questions.tell());
        done.events.retain(|events| self.computes(from, events.region, done.tick));
        self.events.extend(done.events.into_iter().map(|events| (events.region, events)));
        if self.lag > 0 {
            self.forward_contacts();
        }
        let completed = self.completed();
        if completed.is_some() && completed > was_complete {
            self.forward_contacts();
            self.forget_contacts(completed);
            self.forward_states();
            self.compare_and_tell();
            self.tell_fidelity();
        }
    }

    /// Takes in the states of bodies that moved in one member's regions. Returns how many are not believed:
    /// those of bodies in regions that others compute, of a tick that has not been opened, or at an epoch
    /// that cannot be: true states would all be older than such a state.
    pub fn report(&mut self, from: NodeId, report: Report) -> u64 {
        if report.tick > self.tick {
            return report.states.len() as u64;
        }
        let mut refused = 0;
        for state in report.states {
            let is_own = self.computes(from, state.owner, report.tick);
            if !is_own || !state.epoch.is_possible(self.newest_view, report.tick) {
                refused += 1;
                continue;
            }
            if self.gone.get(&state.id).is_some_and(|since| report.tick < *since) {
                continue;
            }
            match self.latest.entry(state.id) {
                Entry::Vacant(entry) => {
                    entry.insert((state, report.tick));
                }
                Entry::Occupied(mut entry) => {
                    let (old, tick) = *entry.get();
                    if (old.epoch, tick) > (state.epoch, report.tick) {
                        continue;
                    }
                    entry.insert((state, report.tick));
                }
            }
            self.moved.insert(state.id);
            self.moved_here(state.id);
            if state.id.client().is_some() {
                let lives_on = state.epoch < Epoch::placed_in(self.view.0);
                self.inputs.see(state.id, state.pose.translation, report.tick, lives_on);
                self.watch_avatar(&state);
            }
        }
        refused
    }

    /// Tells the replication what the tick has changed.
    fn forward_states(&mut self) {
        let moved = std::mem::take(&mut self.moved);
        let states = moved.into_iter().filter_map(|id| Some((id, *self.latest.get(&id)?))).collect();
        self.give_clients();
        let is_last = self.last_tick == Some(self.tick);
        self.tell_interests(is_last);
        let news = std::mem::take(&mut self.news).after(self.tick, self.opened, is_last, states);
        self.replicate(ReplicationEvent::Tick(news));
    }

    /// Sends clients the states of a speculative tick, computed without the other nodes.
    pub fn tell_speculative(&mut self, tick: Tick, states: Vec<SharedState>) {
        let silent = self.missing().collect();
        self.replicate(ReplicationEvent::Speculative { tick, states, silent });
    }

    /// Takes in which states a client has acknowledged.
    pub fn heard(&mut self, client: ClientId, heard: Heard) {
        if self.clients.contains_key(&client) {
            self.replicate(ReplicationEvent::Heard { client, heard, now: self.tick });
        }
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
        self.opened = match self.pace {
            Pace::Unpaced => now,
            Pace::RealTime => self.next_due,
        };
        self.next_due = match self.pace {
            Pace::Unpaced => now,
            Pace::RealTime => (self.next_due + self.dt.mul_f32(self.stretch())).max(now),
        };
        self.tick = self.tick.next();
        let mut ops = self.next_ops();
        self.scheduling.iter_mut().for_each(|scheduling| scheduling.attend(self.tick, &ops));
        let repartition = self.repartition();
        ops.extend(repartition.map(WorldOp::Repartition));
        for op in &ops {
            match op {
                WorldOp::Insert { bodies, .. } => bodies.iter().for_each(|body| self.appears(body)),
                WorldOp::Remove(id) => self.forget(*id),
                _ => {}
            }
        }
        for (body, reason) in self.inputs.sort_early(self.tick) {
            let refusal = ToClient::Rejected { body: Some(body), reason };
            self.messages.extend(body.client().map(|client| (client, refusal)));
        }
        ops.extend(self.take_inputs().map(WorldOp::Input));
        ops.extend(self.corrections());
        ops.extend(self.questions.dispatch(self.tick, &self.members));
        self.questions.allow();
        self.messages.extend(self.questions.tell());
        // Where the tree changes, all regions catch up.
        let is_cut_anew = ops.iter().any(|op| op.repartition().is_some());
        let schedule = self.schedule().filter(|schedule| !is_cut_anew && *schedule != Schedule::default());
        ops.extend(schedule.map(WorldOp::Schedule));
        ops.extend(self.next_watch());
        // Members that are not in step cannot exchange within a tick.
        let wanted = std::mem::replace(&mut self.rounds_wanted, 1);
        let rounds = if self.lag == 0 { wanted } else { 1 };
        Some(Dispatch { view: self.view, tick: self.tick, rounds, ops })
    }

    /// Takes the inputs of the tick, and notes up to which input each client's are applied.
    fn take_inputs(&mut self) -> impl Iterator<Item = Input> + use<> {
        let taken = self.inputs.take(self.tick);
        let said_again = self.inputs.take_said_again().into_iter().map(|(client, time)| (client, (time, 0)));
        let newest =
            |Taken { input, early }: &Taken| Some((input.body.client()?, (input.logical_time, *early)));
        for (client, newest) in said_again.chain(taken.iter().filter_map(newest)) {
            if self.clients.contains_key(&client) {
                let applied = self.applied.entry(client).or_default();
                *applied = newest.max(*applied);
                self.news.has_applied(client, *applied);
            }
        }
        taken.into_iter().map(|taken| taken.input)
    }

    /// Returns the regions that stay behind in this tick, if not everything is computed in full. While there
    /// are other groups, this leader does not know what their clients look at, and everything is computed in
    /// full.
    fn schedule(&mut self) -> Option<Schedule> {
        let scheduling = self.scheduling.as_mut()?;
        let interests = self.inter_group.is_none().then_some(&self.interests);
        Some(scheduling.schedule(self.tick, interests, self.inputs.places()))
    }

    /// Tells the server now and then what lower rates save and cost.
    fn tell_fidelity(&mut self) {
        if let Some(scheduling) =
            self.scheduling.as_ref().filter(|_| self.tick.0.is_multiple_of(TELL_FIDELITY))
        {
            let (view, report) = (self.view, scheduling.report());
            self.server_messages.push(ToServer::Fidelity { view, report });
        }
    }

    /// Returns the change of the tree before this tick, if the load asks for one.
    fn repartition(&mut self) -> Option<Repartition> {
        let balancing = self.balancing.as_mut()?;
        let before = balancing.tree().clone();
        let change = balancing.plan()?;
        for Renaming { from, to, .. } in change.renamings(&before) {
            self.contacts.rename(from, to);
        }
        if let Some(scheduling) = &mut self.scheduling {
            scheduling.settle(balancing.tree(), balancing.allocation());
        }
        self.news.is_allocated(balancing.allocation().clone());
        self.computed_by.push_back((self.tick, balancing.allocation().clone()));
        if self.computed_by.len() > KEPT_ALLOCATIONS {
            self.computed_by.pop_front();
        }
        Some(change)
    }

    /// Takes the server's operations of one tick: as many as a message has room for, in order. The others
    /// wait.
    fn next_ops(&mut self) -> Vec<WorldOp> {
        let mut bytes = 0;
        let is_over = |op: &WorldOp| {
            bytes += encoded_len(op);
            bytes > OPS_BYTES
        };
        // A single operation is never too long: the server splits what it sends.
        let count = self.ops.iter().position(is_over).map_or(self.ops.len(), |count| count.max(1));
        let count = count.min(most_items::<WorldOp>());
        let later = self.ops.split_off(count);
        std::mem::replace(&mut self.ops, later)
    }

    /// Returns the messages for clients since the last call.
    pub fn take_messages(&mut self) -> Vec<(ClientId, ToClient)> {
        let mut for_clients = std::mem::take(&mut self.messages);
        let view = self.view;
        let answers = for_clients.extract_if(.., |(client, _)| *client == ClientId::NOBODY);
        self.server_messages.extend(answers.filter_map(|(_, message)| match message {
            ToClient::Answer { number, found } => Some(ToServer::Answer { view, number, found }),
            _ => None,
        }));
        for_clients
    }

    /// Returns the messages for the server since the last call.
    pub fn take_server_messages(&mut self) -> Vec<ToServer> {
        let mut messages = std::mem::take(&mut self.server_messages);
        messages.extend(self.inter_group.as_mut().map(InterGroup::take_messages).unwrap_or_default());
        messages
    }

    /// Returns the newest tick that all members have completed.
    pub(super) fn completed(&self) -> Option<Tick> {
        let ticks = self.members.iter().map(|node| self.done.get(node).copied());
        ticks.min().flatten()
    }

    /// Returns whether a member has said that it is done with a tick of this view.
    pub(super) fn has_done(&self, node: NodeId, view: ViewNumber, tick: Tick) -> bool {
        view == self.view && self.done.get(&node).is_some_and(|done| tick <= *done)
    }

    /// Returns whether all members are ready for the next tick.
    fn is_complete(&self) -> bool {
        self.completed().is_some_and(|completed| self.tick.0 <= completed.0 + self.lag)
    }

    /// Returns the part of a dispatch that concerns one member. Inputs for an avatar go to the members that
    /// hold it, and once more to those that held it before, so that they let go (thesis 3.3.8).
    pub fn for_member(&mut self, node: NodeId, dispatch: &Dispatch) -> Dispatch {
        let holders = &mut self.holders;
        let mut concerns = |op: &WorldOp| match op {
            // All members must know of what concerns all.
            WorldOp::Input(input) => holders.concerns(node, input.body) || op.concerns_all(),
            _ => true,
        };
        let ops = dispatch.ops.iter().filter(|op| concerns(op)).cloned().collect();
        Dispatch { ops, ..*dispatch }
    }

    /// Notes that a body is inserted in the present tick.
    fn appears(&mut self, body: &BodyRecord) {
        // The server numbers the views of all groups together: an avatar that returns is placed in the newest
        // of all.
        self.knows_view(body.epoch.view());
        if body.id.client().is_some() {
            self.inputs.see(body.id, body.state.pose.translation, self.tick, false);
        }
        if let Some(since) = self.gone.get_mut(&body.id) {
            *since = self.tick;
        }
    }

    /// Forgets a body that is removed in the present tick.
    fn forget(&mut self, id: BodyId) {
        self.gone.insert(id, self.tick);
        self.inputs.forget(id);
        self.watching.forget(id);
        self.latest.remove(&id);
        self.moved.remove(&id);
        self.news.is_gone(id);
        self.holders.forget(id);
        self.forget_in_other_groups(id);
    }

    /// Forgets the contacts of bodies whose removal all members have completed: the ends of these contacts
    /// have been told.
    fn forget_contacts(&mut self, completed: Option<Tick>) {
        let mut over = BTreeSet::new();
        self.gone.retain(|&id, since| {
            let is_over = Some(*since) <= completed;
            if is_over {
                over.insert(id);
            }
            !is_over
        });
        if !over.is_empty() {
            self.contacts.forget_bodies(&over);
        }
    }

    /// Returns the inputs that the next tick is to apply, for speculative ticks.
    pub fn inputs(&self) -> impl Iterator<Item = Input> {
        self.inputs.due(self.tick.next())
    }

    /// Returns what another leader must know of clients (inputs that are not dispatched yet, and their
    /// interests), and what this one hands on to itself if it leads on.
    pub fn into_legacy(self) -> (Vec<(ClientId, FromClient)>, Legacy) {
        let inputs = self
            .inputs
            .into_untaken()
            .filter_map(|input| Some((input.body.client()?, FromClient::Input(input))));
        let interests = self.interests.into_iter().map(|(client, area)| (client, FromClient::Interest(area)));
        let allocation =
            self.computed_by.back().map(|(_, allocation)| allocation.clone()).unwrap_or_default();
        (inputs.chain(interests).collect(), Legacy { contacts: self.contacts, allocation })
    }

    /// Returns what the server's program did to moving bodies and no tick has done yet. All else is told
    /// again from the server's record.
    pub fn undone(&self) -> Vec<WorldOp> {
        condensed(&self.ops)
    }

    /// Goes on from the view before, which this node led too, with its contacts. Only contacts of regions
    /// remain whose member stays the same, and keeps them.
    pub fn inherit(&mut self, legacy: Legacy, is_kept: impl Fn(NodeId) -> bool) {
        let Legacy { mut contacts, allocation } = legacy;
        if let Some((_, now)) = self.computed_by.back() {
            contacts.keep_regions(|region| {
                now.get(&region).is_some_and(|node| allocation.get(&region) == Some(node) && is_kept(*node))
            });
        }
        self.contacts = contacts;
    }

    /// Passes over inputs that are sent again, of each kind for each avatar up to this logical time: ticks
    /// before the view have done them.
    pub(super) fn pass_over(&mut self, done: BTreeMap<(BodyId, bool), u64>) {
        self.inputs.pass_over(done);
    }

    /// Returns whether there are clients to send states to.
    pub fn has_clients(&self) -> bool {
        !self.clients.is_empty()
    }

    /// Returns the members that have not completed the newest tick, apart from the lag that they may have.
    pub fn missing(&self) -> impl Iterator<Item = NodeId> {
        let is_behind =
            |node: &&NodeId| self.done.get(node).is_none_or(|&tick| tick.0 + self.lag < self.tick.0);
        self.members.iter().filter(is_behind).copied()
    }
}
