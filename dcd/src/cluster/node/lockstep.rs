//! Runs the ticks (lockstep) and view changes of a node: every event leads to [`Node::progress`], which does
//! whatever the state now allows.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::{Exchange, Node, NodeOutput, PendingView, Phase, borders};
use crate::cluster::state_replication::TELL_TICK;
use crate::cluster::{
    DelayMonitor, DelayRules, Peer, PhysicsCommand, PhysicsEvent, Sampling, VoteThresholds,
};
use crate::delta::alone;
use crate::protocol::{
    BodyRecord, Border, BorderMessage, CHUNK_BYTES, Chunk, Dispatch, Done, EnvironmentProperties, Message,
    RegionEvents, Report, ToNode, ToServer, ViewNumber, WorldOp, split,
};
use crate::space::{NodeId, RegionId, Tick, Viewpoint};

impl Node {
    pub(super) fn hear_server(&mut self, now: Duration, message: ToNode) {
        let present = self.number();
        if self.world.is_none() && needs_world(&message) {
            self.counters.refused += 1;
            return;
        }
        match message {
            ToNode::Welcome { world, .. } => {
                self.begin_anew();
                let thresholds = world.thresholds.delay.map(VoteThresholds::from);
                self.watch =
                    thresholds.map(|thresholds| DelayMonitor::new(thresholds, DelayRules::default()));
                self.order(PhysicsCommand::World(world.clone()));
                self.world = Some(world);
            }
            ToNode::Chunk(Chunk::Placed(placed)) => self.placed.extend(placed),
            ToNode::Chunk(Chunk::Joints(joints)) => self.joints.extend(joints),
            ToNode::Chunk(chunk) => {
                self.verifier.load(&chunk);
                self.order(PhysicsCommand::Load(chunk));
            }
            ToNode::WorldEnd => {
                self.send_server(ToServer::Loaded);
                // The server may have forgotten the wish to leave.
                if self.leaving {
                    self.send_server(ToServer::Leave);
                }
            }
            ToNode::Settle { view } => {
                if view > present && self.change.as_ref().is_none_or(|change| change.view < view) {
                    self.change = Some(PendingView::to(view));
                    self.placed.clear();
                    self.joints.clear();
                    self.tell_settled(view);
                }
            }
            ToNode::Finish { view, dispatches, survivors, last } => {
                if let Some(change) = self.change.as_mut().filter(|change| change.view == view) {
                    change.dispatches.extend(dispatches);
                    if last {
                        self.finish(&survivors);
                    }
                }
            }
            ToNode::Fetch { view, bodies } => {
                if let Some(change) = self.change.as_mut().filter(|change| change.view == view) {
                    change.fetch = Some(bodies);
                }
            }
            ToNode::Adopt { view, drop } => {
                if view.number > present {
                    let change = self.change.get_or_insert_with(|| PendingView::to(view.number));
                    change.adopt = Some((view, drop));
                }
            }
            ToNode::Ask { view, question } => match &mut self.leader {
                Some(leader) if view == leader.view() => leader.ask_for_server(question),
                _ => self.counters.stale += 1,
            },
            ToNode::Apply { view, first, ops } => match &mut self.leader {
                Some(leader) if leader.view() == view => leader.hear_ops(first, ops),
                _ => self.counters.stale += 1,
            },
            ToNode::Look { view, viewpoints } => self.look(view, viewpoints),
            ToNode::Roster(members) => {
                self.know(now, &members, true);
                self.tend_links(now);
            }
            ToNode::Poll { poll, motion } => {
                let delay_us = self.pinger.delay_us(Peer::Node(motion.candidate()));
                let delay_ms = delay_us.map(|us| (us / 1e3) as f32);
                self.send_server(ToServer::Ballot { poll, delay_ms });
            }
            ToNode::InterGroup { view, main, tick, states } => match &mut self.leader {
                Some(leader) if leader.view() == view => match alone::read(&states) {
                    Ok(states) => leader.hear_other_groups(main, tick, states),
                    Err(_) => self.counters.stale += 1,
                },
                _ => self.counters.stale += 1,
            },
            ToNode::Authority { view, alone, by_default, stances } => match &mut self.leader {
                Some(leader) if leader.view() == view => leader.authority(alone, by_default, stances),
                _ => self.counters.stale += 1,
            },
            ToNode::Verify { view, nodes, anew } => self.witness.learn(view, nodes, anew),
            ToNode::Shutdown { farewell, reason } => self.stop(farewell, reason),
        }
    }

    /// Takes in the viewpoints of the server's program, as the leader of this view or the leader to be.
    fn look(&mut self, of: ViewNumber, viewpoints: Vec<Viewpoint>) {
        let coming = self.change.as_mut().and_then(|change| change.adopt.as_mut());
        match (coming, &mut self.leader) {
            (Some((view, _)), _) if view.number == of => view.viewpoints = viewpoints,
            (_, Some(leader)) if leader.view() == of => leader.look(viewpoints),
            _ => self.counters.stale += 1,
        }
    }

    pub(super) fn dispatched(&mut self, from: NodeId, dispatch: Dispatch) {
        let leads =
            self.view.as_ref().is_some_and(|view| view.leader == from && view.number == dispatch.view);
        // No tick is opened before all members have completed those that it may be ahead of.
        let newest = self.tick.0 + self.lag() + 1;
        if !leads || dispatch.tick <= self.dispatched || dispatch.tick.0 > newest {
            self.counters.stale += 1;
        } else if self.change.is_some() {
            // A node that has answered `Settle` starts only what `Finish` tells it to.
            let is_new = self.held.last().map_or(self.dispatched, |held| held.tick).next() == dispatch.tick;
            self.held.extend(Some(dispatch).filter(|_| is_new));
        } else if dispatch.tick == self.dispatched.next() {
            self.dispatched = dispatch.tick;
            self.dispatches.push_back(dispatch);
        } else {
            self.counters.stale += 1;
        }
    }

    pub(super) fn physics(&mut self, now: Duration, event: PhysicsEvent) {
        if let PhysicsEvent::Verified { run, event } = event {
            return self.verified(run, event.map(|event| *event));
        }
        if self.void > 0 {
            self.void -= 1;
            return;
        }
        assert!(self.busy, "the physics answered without being asked");
        self.busy = false;
        if let PhysicsEvent::Speculated(states) = event {
            return self.speculated(states);
        }
        if event == PhysicsEvent::Drained {
            return;
        }
        self.tick_takes = now.saturating_sub(self.since);
        self.since = now;
        match event {
            PhysicsEvent::Speculated(_) | PhysicsEvent::Drained | PhysicsEvent::Verified { .. } => {
                unreachable!("taken care of above")
            }
            PhysicsEvent::Computed { outgoing, neighbours, removed } => {
                self.exchange(outgoing, &neighbours, removed)
            }
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
            } => {
                let Phase::Computing(tick, _) = self.phase else { panic!("no tick is being computed") };
                self.phase = Phase::Resting;
                self.tick = tick;
                // Members that share nothing with this one may be behind it, and their leader may die.
                let behind = self.lag() + 1;
                self.dispatches.retain(|dispatch| tick.0 < dispatch.tick.0 + behind);
                let (view, division) = (self.number(), self.division);
                let is_last = self.world.as_ref().is_some_and(|world| world.last_tick == Some(tick));
                let leads_on = self.leader.is_some() && self.told.0 + TELL_TICK <= tick.0;
                if (is_last || leads_on) && checkpoint.is_empty() {
                    self.send_server(ToServer::Checkpoint { view, tick, division, bodies: Vec::new() });
                }
                if is_last || leads_on || !checkpoint.is_empty() {
                    self.told = tick;
                }
                for bodies in split(checkpoint, CHUNK_BYTES) {
                    self.send_server(ToServer::Checkpoint { view, tick, division, bodies });
                }
                for states in split(self.reported(report), CHUNK_BYTES) {
                    self.tell_leader(Message::Report(Report { view, tick, states }));
                }
                let all = self.view.as_ref().is_some_and(|view| view.events);
                let events = match all {
                    true => events,
                    false => events.into_iter().filter_map(of_avatars).collect(),
                };
                let holds = (self.holds != holds)
                    .then(|| std::mem::replace(&mut self.holds, holds.clone()))
                    .map(|_| holds);
                let compute_us = stats.compute_us;
                let done =
                    Done { view, tick, rounds_wanted, holds, events, answers, load, compute_us, regions };
                self.done.push_back(done.clone());
                if self.done.len() as u64 > 1 + self.lag() {
                    self.done.pop_front();
                }
                for message in self.witness.testify(view, tick) {
                    self.tell_leader(message);
                }
                self.tell_leader(Message::Done(done));
                self.outputs.push_back(NodeOutput::Settled(tick));
            }
            PhysicsEvent::Surveyed(claims) => {
                if let Some(change) = &self.change
                    && self.asked == Some(change.view)
                {
                    let (view, tick) = (change.view, self.tick);
                    let division =
                        self.view.as_ref().map(|view| (view.tree.clone(), view.allocation.clone()));
                    self.send_server(ToServer::Survey { view, tick, division, claims });
                }
            }
            PhysicsEvent::Found(bodies) => {
                if let Some(change) = &self.change
                    && self.asked == Some(change.view)
                {
                    let view = change.view;
                    for bodies in split(bodies, CHUNK_BYTES) {
                        self.send_server(ToServer::Found { view, bodies, last: false });
                    }
                    self.send_server(ToServer::Found { view, bodies: Vec::new(), last: true });
                }
            }
        }
    }

    /// Does what can be done: gives the physics one command at most, and opens the leader's next tick.
    pub(super) fn progress(&mut self, now: Duration) {
        self.go_on(now);
        self.verify();
    }

    fn go_on(&mut self, now: Duration) {
        if self.change.is_none()
            && let Some(dispatch) = self.leader.as_mut().and_then(|leader| leader.dispatch(now))
        {
            for &node in &self.others {
                let leader = self.leader.as_mut().expect("only a leader dispatches");
                let message = Message::Dispatch(leader.for_member(node, &dispatch));
                self.outputs.push_back(NodeOutput::Send { to: Peer::Node(node), message });
            }
            self.verifier.opens(dispatch.view, dispatch.tick, dispatch.rounds);
            self.dispatched = dispatch.tick;
            self.dispatches.push_back(dispatch);
        }
        self.flush_leader();
        if self.busy {
            return;
        }
        match self.phase {
            Phase::Exchanging(..) => self.accept(),
            Phase::Resting => self.begin(now),
            Phase::Computing(..) => unreachable!("the physics is idle"),
        }
    }

    /// Starts whatever comes next after a completed tick.
    fn begin(&mut self, now: Duration) {
        let next = self.tick.next();
        let Some(change) = &mut self.change else {
            if let Some(dispatch) = self.dispatches.iter().find(|dispatch| dispatch.tick == next).cloned() {
                self.step(now, dispatch);
            }
            return;
        };
        if let Some((view, drop)) = change.adopt.take() {
            self.end_speculation();
            self.adopt(now, view, drop);
        } else if change.finish {
            if let Some(dispatch) = self.dispatches.iter().find(|dispatch| dispatch.tick == next).cloned() {
                self.step(now, dispatch);
            } else if !change.drained {
                self.drain(now);
            } else if !change.surveyed {
                change.surveyed = true;
                self.asked = Some(change.view);
                self.end_speculation();
                self.ask(PhysicsCommand::Survey);
            } else if let Some(bodies) = change.fetch.take() {
                self.asked = Some(change.view);
                self.end_speculation();
                self.ask(PhysicsCommand::Fetch(bodies));
            }
        }
    }

    fn step(&mut self, now: Duration, Dispatch { tick, rounds, ops, .. }: Dispatch) {
        assert_eq!(tick, self.tick.next(), "ticks follow one another");
        let changes: Vec<_> = ops.iter().filter_map(WorldOp::repartition).collect();
        // Border messages name regions as they were when they were written, so those on their way are taken
        // in first.
        if !changes.is_empty() && self.lag() > 0 && self.drained < self.tick {
            return self.drain(now);
        }
        changes.into_iter().for_each(|change| self.repartition(tick, change));
        self.note_inputs(&ops);
        self.learn_epochs(&ops);
        self.learn_watch(&ops);
        self.verify_tick(tick, rounds, &ops);
        self.phase = Phase::Computing(tick, 0);
        self.end_speculation();
        self.ask(PhysicsCommand::Step { tick, rounds, ops });
    }

    /// Sends the regions' border messages to the members that compute neighbours of them, and waits for
    /// theirs (a barrier). At the beginning of a view, and where messages are taken in later than they are
    /// written, all members exchange.
    fn exchange(&mut self, outgoing: Vec<BorderMessage>, neighbours: &[RegionId], removed: Vec<BodyRecord>) {
        let view = self.view.as_ref().expect("only members compute");
        let number = view.number;
        let (tick, round) = match self.phase {
            Phase::Computing(tick, round) => (tick, round),
            _ => panic!("no round is being computed"),
        };
        let me = self.config.id;
        let members = view.members.iter().map(|member| member.node).filter(|node| *node != me);
        let (mut with, mut lost): (BTreeSet<_>, BTreeSet<_>) =
            members.partition(|node| self.others.contains(node));
        if tick > view.tick && self.lag() == 0 {
            let near: BTreeSet<_> =
                neighbours.iter().filter_map(|region| view.allocation.get(region)).collect();
            with.retain(|node| near.contains(node));
            lost.retain(|node| near.contains(node));
        }
        let mut by_node: BTreeMap<NodeId, Vec<BorderMessage>> =
            with.iter().map(|&node| (node, Vec::new())).collect();
        by_node.insert(me, Vec::new());
        for message in outgoing {
            // Messages to regions of dead members end here. The survey finds what they carried.
            if let Some(messages) = view.allocation.get(&message.to).and_then(|node| by_node.get_mut(node)) {
                messages.push(message);
            }
        }
        let mut arrived = BTreeMap::new();
        for (node, messages) in by_node {
            if node == me {
                arrived.insert(me, messages);
            } else {
                let border = Border { view: number, tick, round, messages };
                let lag = self.lag();
                self.link.keep(node, &border, lag);
                self.witness.tells(node, &border);
                self.send(Peer::Node(node), Message::Border(border));
            }
        }
        self.phase = Phase::Exchanging(Exchange { tick, round, with, lost, arrived });
        if !removed.is_empty() {
            self.send_server(ToServer::Removed { view: number, tick, bodies: removed });
        }
    }

    /// Hands the round to the physics once the border messages of all members that it exchanges with have
    /// arrived.
    fn accept(&mut self) {
        let number = self.number();
        let Phase::Exchanging(Exchange { tick, round, .. }) = self.phase else { return };
        // All members begin a view together: the leader would drop what is said of a view that it has not
        // heard of.
        let begins = self.view.as_ref().is_some_and(|view| view.tick == tick);
        let is_new = |heard: &Tick| self.lag() == 0 || begins || *heard > self.drained;
        let heard = self.heard_after(tick).filter(is_new);
        let Phase::Exchanging(Exchange { with, lost, arrived, .. }) = &mut self.phase else { return };
        for node in with.iter() {
            let Some(said) = heard else {
                arrived.entry(*node).or_default();
                continue;
            };
            let Some(queue) = self.early.get_mut(node) else { continue };
            let is_due = |border: &Border| (border.view, border.tick, border.round) == (number, said, round);
            if let Some(at) = queue.iter().position(is_due)
                && let Some(border) = queue.remove(at)
            {
                arrived.insert(*node, border.messages);
            }
        }
        if !with.iter().all(|node| arrived.contains_key(node)) {
            return;
        }
        let me = self.config.id;
        let mut incoming: Vec<BorderMessage> = Vec::new();
        let lost = std::mem::take(lost);
        for (node, messages) in std::mem::take(arrived) {
            let border = Border { view: number, tick, round, messages };
            if node != me {
                self.witness.hears(node, &border);
            }
            for message in border.messages {
                let said = if node == me { Some(tick) } else { heard };
                if Some(message.tick) == said && self.can_be(node, &message) {
                    incoming.push(message);
                } else {
                    self.counters.refused += 1;
                }
            }
        }
        // Out of step, what was told before holds until something newer comes.
        if let Some(view) = self.view.as_ref().filter(|_| self.lag() == 0) {
            let gone = |lost| borders::gone(&view.allocation, (lost, me), tick);
            incoming.extend(lost.into_iter().flat_map(gone));
        }
        incoming.sort_by_key(|message| (message.from, message.to));
        self.amend(tick, &mut incoming);
        // In the first exchange of a view, and at the end of a world, leader and server are sent everything.
        let last = self.world.as_ref().and_then(|world| world.last_tick);
        let sample = |every| match tick {
            tick if begins || Some(tick) == last => Sampling::All,
            tick if tick.0.is_multiple_of(every) => Sampling::Moved,
            _ => Sampling::Nothing,
        };
        let (report, checkpoint) = (sample(self.state_every()), sample(self.config.checkpoint_every));
        let report = self.report_of(report);
        self.end_speculation();
        self.phase = Phase::Computing(tick, round + 1);
        let load = self.world.as_ref().and_then(load_every).is_some_and(|every| tick.0.is_multiple_of(every));
        self.ask(PhysicsCommand::Accept { tick, round, incoming, report, checkpoint, load });
    }

    /// Returns the number of ticks from one report of moved bodies to the leader to the next.
    pub(super) fn state_every(&self) -> u64 {
        self.world.as_ref().map_or(1, |world| u64::from(world.state_every))
    }

    /// Returns whether the world has ended here.
    fn is_over(&self) -> bool {
        self.world.as_ref().is_some_and(|world| world.last_tick == Some(self.tick))
    }

    /// Returns the members that are waited for though they are linked.
    pub(super) fn laggards(&self) -> Vec<NodeId> {
        let linked = |node: &NodeId| self.link.is_up(*node);
        match (&self.phase, &self.leader) {
            (Phase::Exchanging(Exchange { with, arrived, .. }), _) => {
                with.iter().filter(|&node| linked(node) && !arrived.contains_key(node)).copied().collect()
            }
            (Phase::Resting, Some(leader)) => leader.missing().filter(linked).collect(),
            // A leader that waits for others says so.
            (Phase::Resting, None) => {
                let leader = self.view.as_ref().map(|view| view.leader);
                leader.filter(|node| linked(node) && !self.is_over()).into_iter().collect()
            }
            _ => Vec::new(),
        }
    }

    /// Returns the tick whose messages are taken in at the end of this one: an earlier one when members are
    /// not in step. `None`: none yet.
    pub(super) fn heard_after(&self, tick: Tick) -> Option<Tick> {
        let view = self.view.as_ref().map_or(Tick(0), |view| view.tick);
        let lag = self.lag();
        match lag {
            0 => Some(tick),
            _ if tick <= view => Some(tick),
            _ => Some(Tick(tick.0.saturating_sub(lag))).filter(|&heard| heard > view),
        }
    }

    /// Takes in the border messages of members' last ticks before a survey or a change of the tree, when
    /// nothing must be on its way.
    fn drain(&mut self, now: Duration) {
        let Some(mut incoming) = self.unheard() else { return };
        let goes_on = self.dispatches.iter().any(|dispatch| dispatch.tick == self.tick.next());
        if let Some(change) = self.change.as_mut().filter(|_| !goes_on) {
            change.drained = true;
        }
        self.drained = self.tick;
        if incoming.is_empty() {
            return self.begin(now);
        }
        self.amend(self.tick, &mut incoming);
        self.end_speculation();
        self.ask(PhysicsCommand::Drain { tick: self.tick, incoming });
    }

    /// Returns the border messages that were not taken in yet. `None`: some have not arrived.
    fn unheard(&self) -> Option<Vec<BorderMessage>> {
        let Some(view) = self.view.as_ref().filter(|_| self.lag() > 0) else { return Some(Vec::new()) };
        let from = self.heard_after(self.tick).unwrap_or(view.tick).max(self.drained).next();
        let mut unheard = Vec::new();
        for tick in (from.0..=self.tick.0).map(Tick) {
            for &node in &self.others {
                let mut said = self.early.get(&node).into_iter().flatten();
                let border = said.find(|border| (border.view, border.tick) == (view.number, tick))?;
                unheard.extend(border.messages.iter().filter(|message| self.can_be(node, message)).cloned());
            }
        }
        unheard.sort_by_key(|message| (message.tick, message.from, message.to));
        Some(unheard)
    }

    /// Applies to bodies on their way the removals, inputs and alterations that were dispatched since their
    /// messages were written.
    fn amend(&mut self, tick: Tick, incoming: &mut [BorderMessage]) {
        let mut removed = Vec::new();
        for dispatch in self.dispatches.iter().filter(|dispatch| dispatch.tick <= tick) {
            for message in incoming.iter_mut().filter(|message| message.tick < dispatch.tick) {
                for op in &dispatch.ops {
                    match op {
                        WorldOp::Remove(gone) => removed.extend(message.forget(*gone)),
                        WorldOp::Input(input) => message.apply_input(input),
                        WorldOp::Alter(alteration) => message.alter(alteration),
                        WorldOp::RemoveJoint(gone) => message.joints.retain(|joint| joint.id != *gone),
                        _ => {}
                    }
                }
            }
        }
        if !removed.is_empty() {
            let view = self.number();
            self.send_server(ToServer::Removed { view, tick, bodies: removed });
        }
    }

    fn tell_leader(&mut self, message: Message) {
        let Some(view) = &self.view else { return };
        if view.leader != self.config.id {
            let to = Peer::Node(view.leader);
            return self.send(to, message);
        }
        let leader = self.leader.as_mut().expect("the leader leads");
        match message {
            Message::Done(done) => leader.done(self.config.id, done),
            Message::Report(report) => {
                leader.report(self.config.id, report);
            }
            Message::Testimony(_) | Message::Copied { .. } => self.hear_witness(self.config.id, message),
            _ => unreachable!("members only report to their leader"),
        }
    }

    pub(super) fn order(&mut self, command: PhysicsCommand) {
        self.outputs.push_back(NodeOutput::Physics(command));
    }

    pub(super) fn ask(&mut self, command: PhysicsCommand) {
        assert!(!self.busy, "the physics does one thing at a time");
        self.busy = true;
        self.order(command);
    }
}

/// Returns whether the server sends this only about a world that it has named before.
fn needs_world(message: &ToNode) -> bool {
    use ToNode::{Adopt, Chunk, Fetch, Finish, Settle, WorldEnd};
    matches!(message, Chunk(_) | WorldEnd | Settle { .. } | Finish { .. } | Fetch { .. } | Adopt { .. })
}

/// Returns the number of ticks from one report of the load to the next, if the world is balanced. By the next
/// report all members have made the change that was planned from the last one.
fn load_every(world: &EnvironmentProperties) -> Option<u64> {
    let every = u64::from(world.balance.as_ref()?.every_ticks);
    Some(every.max(2 * world.protocol.lag_ticks() + 2))
}

/// Keeps of a region's contact events those of avatars, which clients may want.
fn of_avatars(mut events: RegionEvents) -> Option<RegionEvents> {
    events.touches.retain(|touch| touch.key.a.client().or(touch.key.b.client()).is_some());
    events.forces.retain(|force| force.key.a.client().or(force.key.b.client()).is_some());
    (!events.touches.is_empty() || !events.forces.is_empty()).then_some(events)
}
