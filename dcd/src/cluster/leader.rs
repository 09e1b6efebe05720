//! Implements the leader of a group, the part of a node that is active while it leads: it opens each tick when all members are
//! done with the last (lockstep), takes in clients' inputs, and sends contacts and states to clients (thesis 3.3.8, 4.3.2.10).

mod balancing;
mod holders;
mod inter_group;
mod interest;
mod questions;
mod state_replication;

use std::collections::{BTreeMap, BTreeSet};
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
use crate::space::{BodyId, ClientId, GroupId, NodeId, RegionId, Renaming, Tick};

/// How long an input waits for its avatar to appear, in ticks.
const EARLY_TICKS: u64 = 60;
/// The most bytes of the server's operations in one tick, unless the first is longer: what is left over waits.
const OPS_BYTES: usize = 4 << 20;

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

    /// Takes in that a member has completed a tick: it has reached the barrier.
    pub fn done(&mut self, from: NodeId, done: Done) {
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

    /// Takes in the states of bodies that moved in one member's regions.
    pub fn report(&mut self, report: Report) {
        for state in report.states {
            let known = self.latest.get(&state.id);
            if known.is_none_or(|(old, tick)| (old.epoch, *tick) <= (state.epoch, report.tick)) {
                self.moved.entry(state.id).or_insert(known.map(|(old, _)| old.pose.translation));
                self.latest.insert(state.id, (state, report.tick));
                self.moved_here(state.id);
                if state.id.client().is_some() {
                    self.avatars.entry(state.id).or_default();
                }
            }
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
            WorldOp::Input(input) => holders.concerns(node, input.body),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{ContactKey, Member, SharedState, Touch, Velocity, WorldPose};
    use crate::sim::{sim_body, sim_world};

    const CLIENT: ClientId = ClientId(4);
    const AVATAR: BodyId = BodyId::avatar(CLIENT, 0);

    /// Returns a leader of two members that has one client with one avatar; the first tick may be dispatched.
    fn leader() -> Leader {
        let member = |id| Member { node: NodeId(id), address: ([127, 0, 0, 1], 1).into(), client: None };
        let view = View {
            group: GroupId(1),
            number: ViewNumber(1),
            tick: Tick(0),
            leader: NodeId(1),
            members: vec![member(1), member(2)],
            tree: sim_world(2).tree,
            allocation: [(RegionId(1), NodeId(1)), (RegionId(2), NodeId(2))].into(),
        };
        let mut leader = Leader::new(Duration::ZERO, &view, &sim_world(2));
        leader.admit(CLIENT);
        leader.apply(vec![WorldOp::Insert {
            bodies: vec![sim_body(AVATAR, [1.0; 3])],
            shapes: vec![],
            joints: vec![],
        }]);
        both_done(&mut leader, 0, vec![], vec![]);
        leader
    }

    fn both_done(leader: &mut Leader, tick: u64, one: Vec<Touch>, two: Vec<Touch>) {
        for (id, touches) in [(1, one), (2, two)] {
            let events =
                RegionEvents { region: RegionId(id), tick: Tick(tick), touches, ..RegionEvents::default() };
            let view = ViewNumber(1);
            let done = Done {
                view,
                tick: Tick(tick),
                rounds_wanted: id,
                holds: None,
                events: vec![events],
                answers: vec![],
                load: None,
            };
            leader.done(NodeId(id), done);
        }
    }

    fn input(logical_time: u64, speed: f32) -> Input {
        let velocity = Velocity { linear: [0.0, speed, 0.0], angular: [0.0; 3] };
        Input { body: AVATAR, logical_time, velocity, pose: Some(WorldPose::default()) }
    }

    #[test]
    fn a_tick_waits_for_all_members_and_for_its_time() {
        let mut leader = leader();
        let first = leader.dispatch(Duration::ZERO).unwrap();
        assert_eq!((first.tick, first.ops.len()), (Tick(1), 1));
        assert_eq!(leader.dispatch(Duration::from_secs(9)), None, "nobody is done");
        both_done(&mut leader, 1, vec![], vec![]);
        assert_eq!(leader.dispatch(Duration::from_millis(1)), None, "too early");
        let due = leader.timeout().unwrap();
        assert_eq!(due, Duration::from_secs_f32(1.0 / 60.0));
        assert_eq!(leader.dispatch(due).unwrap().tick, Tick(2));
    }

    #[test]
    fn operations_that_no_message_has_room_for_wait_for_the_next_tick_in_order() {
        let mut leader = leader();
        leader.dispatch(Duration::ZERO);
        let corners = vec![[0.5; 3]; 100_000];
        let op = |i: u32| WorldOp::Insert {
            bodies: vec![sim_body(BodyId::persistent(100 + i), [1.0; 3])],
            shapes: vec![crate::protocol::ShapeRecord::ConvexPolyhedron(corners.clone(), Vec::new())],
            joints: vec![],
        };
        let ops: Vec<_> = (0..30).map(op).collect();
        leader.apply(ops.clone());
        let mut told = Vec::new();
        for tick in 1..20 {
            both_done(&mut leader, tick, vec![], vec![]);
            let dispatch = leader.dispatch(Duration::from_secs(tick)).unwrap();
            assert!(encoded_len(&dispatch) < crate::protocol::MAX_MESSAGE_BYTES / 2);
            told.extend(dispatch.ops);
        }
        assert_eq!(told.len(), ops.len());
        assert!(told == ops, "none is lost, and none overtaken");
    }

    #[test]
    fn a_tick_takes_as_many_rounds_as_a_member_wanted_after_the_one_before() {
        let mut leader = leader();
        assert_eq!(leader.dispatch(Duration::ZERO).unwrap().rounds, 2, "the members want 1 and 2");
        for (id, rounds_wanted) in [(1, 3), (2, 1)] {
            let view = ViewNumber(1);
            leader.done(
                NodeId(id),
                Done {
                    view,
                    tick: Tick(1),
                    rounds_wanted,
                    holds: None,
                    events: vec![],
                    answers: vec![],
                    load: None,
                },
            );
        }
        assert_eq!(leader.dispatch(Duration::from_secs(1)).unwrap().rounds, 3);
        both_done(&mut leader, 2, vec![], vec![]);
        assert_eq!(leader.dispatch(Duration::from_secs(2)).unwrap().rounds, 2, "what was is forgotten");
    }

    #[test]
    fn only_the_newest_input_of_an_avatar_is_dispatched() {
        let mut leader = leader();
        leader.dispatch(Duration::ZERO);
        assert_eq!(leader.accept_input(CLIENT, input(5, 1.0)), Ok(()));
        assert_eq!(leader.accept_input(CLIENT, input(7, 2.0)), Ok(()));
        assert_eq!(leader.accept_input(CLIENT, input(6, 3.0)), Err(Refusal::Late));
        assert_eq!(leader.accept_input(CLIENT, input(8, 20.5)), Err(Refusal::TooFast));
        assert_eq!(leader.accept_input(ClientId(5), input(9, 1.0)), Err(Refusal::NotYours));
        both_done(&mut leader, 1, vec![], vec![]);
        let ops = leader.dispatch(Duration::from_secs(1)).unwrap().ops;
        assert_eq!(ops, [WorldOp::Input(input(7, 2.0))]);
    }

    #[test]
    fn an_input_that_waited_for_its_avatar_does_not_undo_a_later_one() {
        let mut leader = leader();
        assert_eq!(leader.accept_input(CLIENT, input(5, 1.0)), Ok(()), "the avatar has not appeared yet");
        let (id, epoch) = (AVATAR, crate::space::Epoch(0));
        let state = SharedState {
            id,
            owner: RegionId(1),
            epoch,
            pose: WorldPose::default(),
            velocity: Velocity::default(),
            sleeping: false,
        };
        leader.report(Report { view: ViewNumber(1), tick: Tick(0), states: vec![state] });
        assert_eq!(leader.accept_input(CLIENT, input(6, 2.0)), Ok(()));
        let ops = leader.dispatch(Duration::ZERO).unwrap().ops;
        let inputs: Vec<_> = ops.iter().filter(|op| matches!(op, WorldOp::Input(_))).collect();
        assert_eq!(inputs, [&WorldOp::Input(input(6, 2.0))]);
    }

    #[test]
    fn of_two_inputs_for_an_avatar_not_heard_of_yet_the_newer_counts_whichever_came_first() {
        let mut leader = leader();
        let early = BodyId::avatar(CLIENT, 7);
        for time in [6, 5] {
            let input = Input { body: early, ..input(time, time as f32) };
            assert_eq!(leader.accept_input(CLIENT, input), Ok(()));
        }
        let inputs = leader.into_inputs();
        assert_eq!(inputs, [(CLIENT, FromClient::Input(Input { body: early, ..input(6, 6.0) }))]);
    }

    #[test]
    fn an_interest_counts_from_the_tick_on_is_handed_on_and_goes_with_the_link() {
        let mut leader = leader();
        let body = BodyId::persistent(1);
        let told_at = |leader: &mut Leader, tick: u64, x: f64| {
            leader.dispatch(Duration::from_secs(tick)).unwrap();
            let pose = WorldPose::at([x, 0.0, 0.0]);
            let (epoch, velocity) = (crate::space::Epoch(0), Velocity::default());
            let states =
                vec![SharedState { id: body, owner: RegionId(1), epoch, pose, velocity, sleeping: false }];
            leader.report(Report { view: ViewNumber(1), tick: Tick(tick), states });
            leader.take_messages();
            both_done(leader, tick, vec![], vec![]);
            let states = |(client, message)| match message {
                ToClient::States { states, .. } => Some((client, states.len())),
                _ => None,
            };
            leader.take_messages().into_iter().filter_map(states).collect::<Vec<_>>()
        };
        let area = Area { centre: [0.0; 3], radius_m: 10.0 };
        let other = ClientId(5);
        leader.admit(other);
        assert_eq!(told_at(&mut leader, 1, 50.0), [(CLIENT, 1), (other, 1)]);
        leader.take_interest(CLIENT, Some(area));
        leader.take_interest(ClientId(6), Some(area));
        assert_eq!(told_at(&mut leader, 2, 51.0), [(other, 1)]);
        assert_eq!(told_at(&mut leader, 3, 5.0), [(CLIENT, 1), (other, 1)]);
        let handed_on = leader.clone().into_inputs();
        assert_eq!(handed_on, [(CLIENT, FromClient::Interest(Some(area)))]);
        leader.take_interest(CLIENT, None);
        assert_eq!(
            told_at(&mut leader, 4, 60.0),
            [(CLIENT, 1), (CLIENT, 1), (other, 1)],
            "all at once, and on"
        );
        leader.take_interest(CLIENT, Some(area));
        told_at(&mut leader, 5, 70.0);
        leader.admit(CLIENT);
        assert_eq!(told_at(&mut leader, 6, 71.0), [(CLIENT, 1), (other, 1)], "it has not said it again yet");
    }

    #[test]
    fn clients_hear_now_and_then_that_time_goes_on_though_nothing_moves() {
        let mut leader = leader();
        let mut told = Vec::new();
        leader.take_messages();
        for tick in 1..=100 {
            leader.dispatch(Duration::from_secs(tick)).unwrap();
            // Of what moves it is told in place of that.
            let (id, epoch) = (AVATAR, crate::space::Epoch(0));
            let (pose, velocity) = (WorldPose::default(), Velocity::default());
            let states = vec![SharedState { id, owner: RegionId(0), epoch, pose, velocity, sleeping: false }];
            if tick == 40 {
                leader.report(Report { view: ViewNumber(1), tick: Tick(tick), states });
            }
            both_done(&mut leader, tick, vec![], vec![]);
            for (client, message) in leader.take_messages() {
                let ToClient::States { stamp, states } = message else { continue };
                told.push((client, stamp.tick.0, states.len()));
            }
        }
        assert_eq!(told, [(CLIENT, 30, 0), (CLIENT, 40, 1), (CLIENT, 70, 0), (CLIENT, 100, 0)]);
    }

    #[test]
    fn a_contact_seen_by_two_regions_begins_and_ends_once() {
        let mut leader = leader();
        let key = ContactKey { a: BodyId::persistent(3), b: AVATAR, collider_a: 0, collider_b: 0 };
        let touch =
            |began| vec![Touch { key, began, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }];
        let mut told = Vec::new();
        let script = [
            (touch(true), touch(true)),
            (vec![], vec![]),
            (touch(false), vec![]),
            (vec![], touch(false)),
            (touch(true), vec![]),
        ];
        leader.take_messages();
        for (tick, (one, two)) in (1..).zip(script) {
            leader.dispatch(Duration::from_secs(tick)).unwrap();
            both_done(&mut leader, tick, one, two);
            for (client, message) in leader.take_messages() {
                let ToClient::Contacts { tick, touches, .. } = message else { continue };
                told.extend(touches.iter().map(|touch| (client, tick, touch.began)));
            }
        }
        assert_eq!(told, [(CLIENT, Tick(1), true), (CLIENT, Tick(4), false), (CLIENT, Tick(5), true)]);
    }
}
