//! Computes once more what participants compute, from what other members told them, and compares what they
//! told others. This is part of a dedicated leader's work. It begins with a participant that has kept nothing
//! of an earlier view, so that everything that the participant begins with is known.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::Node;
use super::borders::{self, can_be_said};
use crate::cluster::{PhysicsCommand, PhysicsEvent, Sampling};
use crate::protocol::{
    Border, BorderMessage, Chunk, Finding, HeardBorder, Hindrance, JointRecord, Message, Placed, Report,
    SharedState, Testimony, ToServer, ViewNumber, WorldOp, encode_value,
};
use crate::space::{Allocation, BodyId, NodeId, RegionId, Tick, TreeChange};

/// The most ticks that a verification may be behind the world, which does not wait for it. Beyond that it is
/// given up, since everything that members say of each of these ticks is kept meanwhile.
const MOST_BEHIND: usize = 64;
/// The most states that are kept of a participant's reports of one tick.
const MOST_STATES: usize = 1 << 17;
/// The most bytes that are kept of a member's copies of one tick: of what it says that it told participants.
const MOST_COPIED_BYTES: usize = 16 << 20;

/// A tick of a view. The view's own tick is the one with which it begins.
type Moment = (ViewNumber, Tick);

/// The state of verification: what is computed once more, and what members said of the ticks that are yet to
/// be verified.
#[derive(Clone, Debug, Default)]
pub(super) struct Verifier {
    runs: BTreeMap<NodeId, Run>,
    told: BTreeMap<Moment, Told>,
    /// The number of the newest run. It grows for as long as the process lives, as answers of the physics may
    /// come late.
    last_run: u64,
}

/// What members told one another in one tick, by their own words.
#[derive(Clone, Debug, Default)]
struct Told {
    rounds: u32,
    /// The digests of the border messages that each member says it has heard, by (from, round).
    heard: BTreeMap<NodeId, BTreeMap<(NodeId, u32), u64>>,
    /// The border messages that members say they have sent, by (from, to, round).
    copies: BTreeMap<(NodeId, NodeId, u32), Border>,
    /// The bytes of all copies of each member.
    copied_bytes: BTreeMap<NodeId, usize>,
    /// The states that each participant reported for clients.
    reports: BTreeMap<NodeId, Vec<SharedState>>,
}

impl Told {
    /// Returns the digest of what one member says that another told it.
    fn heard(&self, by: NodeId, from: NodeId, round: u32) -> Option<u64> {
        self.heard.get(&by)?.get(&(from, round)).copied()
    }
}

/// The verification of one participant.
#[derive(Clone, Debug, Default)]
struct Run {
    number: u64,
    /// The commands that come before the next tick: chunks, a view, changes of the tree.
    changes: Vec<PhysicsCommand>,
    jobs: VecDeque<Job>,
    /// Participants that contradict this one. The server is told of each once.
    disputed: BTreeSet<NodeId>,
}

/// A tick that is to be computed once more.
#[derive(Clone, Debug)]
struct Job {
    at: Moment,
    /// The commands with which it begins, in order.
    commands: Vec<PhysicsCommand>,
    /// The round of the exchange that is under way, once the tick has begun.
    round: Option<u32>,
    /// Says whether all members exchange in it, and not only neighbours.
    begins: bool,
    allocation: Allocation,
    newest_view: u64,
    /// The other members, the dedicated members, and the members that died in the tick, which may have told
    /// the participant something or not.
    members: BTreeSet<NodeId>,
    dedicated: BTreeSet<NodeId>,
    dead: BTreeSet<NodeId>,
}

impl Job {
    /// Returns the first region that a node computes.
    fn region_of(&self, node: NodeId) -> RegionId {
        let mut own = self.allocation.iter().filter(|(_, of)| **of == node);
        own.next().map(|(&region, _)| region).unwrap_or_default()
    }

    /// Judges a contradiction between a participant and another member. A dedicated member is believed.
    fn contradicts(&self, node: NodeId, other: NodeId) -> Finding {
        match self.dedicated.contains(&other) {
            true => Finding::Deviates(self.region_of(node)),
            false => Finding::Contradicts(other),
        }
    }

    /// Compares what a participant's regions would have said in a round with what others heard of it. Returns
    /// what these told it, and the participants that say they heard something else.
    fn exchange(
        &self,
        node: NodeId,
        round: u32,
        outgoing: Vec<BorderMessage>,
        neighbours: &[RegionId],
        told: &Told,
    ) -> Result<(Vec<BorderMessage>, Vec<NodeId>), Finding> {
        let (view, tick) = self.at;
        let mut with = self.members.clone();
        if !self.begins {
            let near: BTreeSet<_> =
                neighbours.iter().filter_map(|region| self.allocation.get(region)).collect();
            with.retain(|other| near.contains(other));
        }
        let mut by_node: BTreeMap<NodeId, Vec<BorderMessage>> =
            with.iter().chain([&node]).map(|&other| (other, Vec::new())).collect();
        for message in outgoing {
            if let Some(messages) = self.allocation.get(&message.to).and_then(|to| by_node.get_mut(to)) {
                messages.push(message);
            }
        }
        let mut incoming: Vec<_> =
            by_node.remove(&node).into_iter().flatten().map(|message| (node, message)).collect();
        let (mut disputed, mut lost) = (Vec::new(), Vec::new());
        for (other, messages) in by_node {
            let digest = Border { view, tick, round, messages }.digest();
            // A member that died may have heard nothing.
            if told.heard(other, node, round).is_some_and(|heard| heard != digest) {
                match self.contradicts(node, other) {
                    // The verification goes on from what the participant was told, whatever the other one
                    // says.
                    Finding::Contradicts(other) => disputed.push(other),
                    finding => return Err(finding),
                }
            }
            match (told.heard(node, other, round), told.copies.get(&(other, node, round))) {
                (Some(heard), Some(copy)) if copy.digest() == heard => {
                    incoming.extend(copy.messages.iter().map(|message| (other, message.clone())));
                }
                (Some(_), Some(_)) => return Err(self.contradicts(node, other)),
                (None, _) if self.dead.contains(&other) => lost.push(other),
                _ => return Err(Finding::GivenUp(Hindrance::Unknown)),
            }
        }
        let can_be = |(from, message): &(NodeId, BorderMessage)| {
            message.tick == tick && can_be_said(&self.allocation, self.newest_view, (*from, node), message)
        };
        let mut incoming: Vec<_> = incoming.into_iter().filter(can_be).map(|(_, message)| message).collect();
        incoming
            .extend(lost.into_iter().flat_map(|lost| borders::gone(&self.allocation, (lost, node), tick)));
        incoming.sort_by_key(|message| (message.from, message.to));
        Ok((incoming, disputed))
    }

    /// Compares what a participant reported of its own regions with what it should have.
    fn compare(
        &self,
        node: NodeId,
        reported: &[SharedState],
        computed: &[SharedState],
    ) -> Result<(), Finding> {
        let states: BTreeMap<BodyId, &SharedState> = computed.iter().map(|state| (state.id, state)).collect();
        // Nobody believes what it says of others' regions.
        let is_own = |state: &&SharedState| self.allocation.get(&state.owner) == Some(&node);
        // States are compared bit by bit: a zero has two signs.
        let is_right = |state: &&SharedState| {
            states.get(&state.id).is_some_and(|own| encode_value(*own) == encode_value(*state))
        };
        match reported.iter().filter(is_own).find(|state| !is_right(state)) {
            Some(state) => Err(Finding::Deviates(state.owner)),
            None => Ok(()),
        }
    }
}

impl Verifier {
    /// Ends all verification.
    pub(super) fn end(&mut self) {
        *self = Self { last_run: self.last_run, ..Self::default() };
    }

    /// Begins to keep what members say of a tick with this many rounds.
    pub(super) fn opens(&mut self, view: ViewNumber, tick: Tick, rounds: u32) {
        if !self.runs.is_empty() {
            self.told.entry((view, tick)).or_default().rounds = rounds;
        }
    }

    /// Notes that the tree changes before the next tick.
    pub(super) fn repartition(&mut self, changes: &[TreeChange], newborn: NodeId) {
        for (&node, run) in &mut self.runs {
            let (changes, newborn_here) = (changes.to_vec(), newborn == node);
            run.changes.push(PhysicsCommand::Repartition { changes, newborn_here });
        }
    }

    /// Notes a chunk of the world, which a verified participant takes in before its next tick.
    pub(super) fn load(&mut self, chunk: &Chunk) {
        self.runs.values_mut().for_each(|run| run.changes.push(PhysicsCommand::Load(chunk.clone())));
    }

    /// Returns whether a participant is verified.
    pub(super) fn verifies(&self, node: NodeId) -> bool {
        self.runs.contains_key(&node)
    }

    /// Notes that only these members are still there to complete ticks.
    pub(super) fn survive(&mut self, survivors: &[NodeId]) {
        for job in self.runs.values_mut().flat_map(|run| &mut run.jobs) {
            job.dead.extend(job.members.iter().filter(|node| !survivors.contains(node)));
        }
    }

    /// Takes in what a member says that it has heard.
    pub(super) fn hear(&mut self, from: NodeId, testimony: Testimony) {
        if let Some(told) = self.told.get_mut(&(testimony.view, testimony.tick)) {
            told.heard.entry(from).or_insert_with(|| by_origin(&testimony.heard));
        }
    }

    /// Takes in what a member says that it told a participant.
    pub(super) fn copy(&mut self, from: NodeId, to: NodeId, border: Border) {
        let is_asked = from != to && self.runs.contains_key(&to);
        if let Some(told) = self.told.get_mut(&(border.view, border.tick)).filter(|_| is_asked)
            && border.round < told.rounds
        {
            let bytes = told.copied_bytes.entry(from).or_default();
            *bytes += encode_value(&border).len();
            if *bytes <= MOST_COPIED_BYTES {
                told.copies.entry((from, to, border.round)).or_insert(border);
            }
        }
    }

    /// Takes in what a participant reported for clients.
    pub(super) fn report(&mut self, from: NodeId, report: &Report) {
        if let Some(told) = self.told.get_mut(&(report.view, report.tick))
            && self.runs.contains_key(&from)
        {
            let states = told.reports.entry(from).or_default();
            let room = MOST_STATES.saturating_sub(states.len());
            states.extend(report.states.iter().take(room));
        }
    }

    fn forget_told(&mut self, newest: Moment) {
        let waiting = self.runs.values().filter_map(|run| run.jobs.front()).map(|job| job.at);
        let oldest = waiting.min().unwrap_or(newest).min(newest);
        self.told = self.told.split_off(&oldest);
    }
}

/// Sorts what a member says that it has heard. Of several digests for one message the first counts.
fn by_origin(heard: &[HeardBorder]) -> BTreeMap<(NodeId, u32), u64> {
    heard.iter().rev().map(|heard| ((heard.from, heard.round), heard.digest)).collect()
}

impl Node {
    /// Begins a view, as its leader: begins to verify participants that come, and goes on with those that
    /// were there before.
    pub(super) fn verify_view(&mut self, placed: &[Placed], joints: &[JointRecord]) {
        let Some(view) = self.view.clone() else { return };
        let asked = self.witness.verified().filter(|_| view.leader == self.config.id && self.lag() == 0);
        let asked = asked.map(<[_]>::to_vec).unwrap_or_default();
        let goes_on = |node: &NodeId| asked.iter().any(|one| one.node == *node && !one.anew);
        let (runs, over): (BTreeMap<_, _>, BTreeMap<_, _>) =
            std::mem::take(&mut self.verifier.runs).into_iter().partition(|(node, _)| goes_on(node));
        self.verifier.runs = runs;
        for run in over.into_values() {
            self.order(PhysicsCommand::Verify { run: run.number, command: None });
        }
        for one in asked {
            if one.anew {
                self.verifier.last_run += 1;
                let run = self.verifier.last_run;
                // The run takes the immovable bodies as they are now. The next tick of this node may change
                // them.
                self.order(PhysicsCommand::Verify { run, command: Some(Box::new(PhysicsCommand::Anew)) });
                let begun = Run { number: run, ..Run::default() };
                self.verifier.runs.insert(one.node, begun);
            }
            let Some(run) = self.verifier.runs.get_mut(&one.node) else {
                self.tell_verdict((view.number, view.tick), one.node, Finding::GivenUp(Hindrance::Unknown));
                continue;
            };
            let regions = view.allocation.iter().filter(|&(_, &node)| node == one.node);
            let rebuild = PhysicsCommand::Rebuild {
                tick: view.tick,
                tree: view.tree.clone(),
                regions: regions.map(|(&region, _)| region).collect(),
                placed: placed.to_vec(),
                joints: joints.to_vec(),
                drop: one.drop,
            };
            run.changes.push(rebuild);
        }
        self.verifier.opens(view.number, view.tick, 1);
        self.plan_verification(view.tick, None);
    }

    /// Plans to compute a tick once more for each participant that is verified, as this member begins it.
    pub(super) fn verify_tick(&mut self, tick: Tick, rounds: u32, ops: &[WorldOp]) {
        self.plan_verification(tick, Some((rounds, ops)));
    }

    fn plan_verification(&mut self, tick: Tick, step: Option<(u32, &[WorldOp])>) {
        let Some(view) = self.view.as_ref().filter(|_| !self.verifier.runs.is_empty()) else { return };
        let me = self.config.id;
        let members: BTreeSet<_> = view.members.iter().map(|member| member.node).collect();
        let dedicated = view.members.iter().filter(|member| member.client.is_none());
        let dedicated: BTreeSet<_> = dedicated.map(|member| member.node).collect();
        let dead = members.iter().filter(|node| **node != me && !self.others.contains(node)).copied();
        let dead: BTreeSet<_> = dead.collect();
        for (&node, run) in &mut self.verifier.runs {
            let mut commands = std::mem::take(&mut run.changes);
            commands.extend(step.map(|(rounds, ops)| PhysicsCommand::Step {
                tick,
                rounds,
                ops: ops.to_vec(),
            }));
            run.jobs.push_back(Job {
                at: (view.number, tick),
                commands,
                round: None,
                begins: step.is_none(),
                allocation: view.allocation.clone(),
                newest_view: self.newest_view,
                members: members.iter().filter(|other| **other != node).copied().collect(),
                dedicated: dedicated.clone(),
                dead: dead.clone(),
            });
        }
    }

    /// Begins to verify the ticks that all members are done with. What members say of such a tick has come
    /// before, if it comes at all.
    pub(super) fn verify(&mut self) {
        let Some(leader) = self.leader.as_ref().filter(|_| !self.verifier.runs.is_empty()) else { return };
        let (view, completed) = (leader.view(), leader.completed());
        let Some(completed) = completed else { return };
        let is_done = |(of, tick): Moment| of < view || of == view && tick <= completed;
        let mut given_up = Vec::new();
        let mut commands = Vec::new();
        for (&node, run) in &mut self.verifier.runs {
            let behind = run.jobs.len();
            let Some(job) = run.jobs.front_mut() else { continue };
            if behind > MOST_BEHIND {
                given_up.push((job.at, node, Hindrance::Behind));
            } else if job.round.is_none() && is_done(job.at) {
                match self.verifier.told.get(&job.at) {
                    Some(told) if told.heard.contains_key(&node) => {
                        job.round = Some(0);
                        let own = std::mem::take(&mut job.commands).into_iter();
                        commands.extend(own.map(|command| (run.number, command)));
                    }
                    _ => given_up.push((job.at, node, Hindrance::Unknown)),
                }
            }
        }
        for (run, command) in commands {
            self.order(PhysicsCommand::Verify { run, command: Some(Box::new(command)) });
        }
        for (at, node, why) in given_up {
            self.conclude(at, node, Finding::GivenUp(why));
        }
    }

    /// Goes on with an answer of the physics to a run.
    pub(super) fn verified(&mut self, run: u64, event: Option<PhysicsEvent>) {
        let mut runs = self.verifier.runs.iter_mut();
        let Some((&node, run)) = runs.find(|(_, known)| known.number == run) else { return };
        let number = run.number;
        let Some(job) = run.jobs.front_mut() else { return };
        let (at, Some(round)) = (job.at, job.round) else { return };
        let Some(told) = self.verifier.told.get(&at) else { return };
        let reported = told.reports.get(&node).map_or(&[][..], Vec::as_slice);
        match event {
            Some(PhysicsEvent::Computed { outgoing, neighbours, .. }) => {
                match job.exchange(node, round, outgoing, &neighbours, told) {
                    Ok((incoming, mut disputed)) => {
                        job.round = Some(round + 1);
                        disputed.retain(|other| run.disputed.insert(*other));
                        let report = if reported.is_empty() { Sampling::Nothing } else { Sampling::All };
                        let (tick, checkpoint, load) = (at.1, Sampling::Nothing, false);
                        let accept =
                            PhysicsCommand::Accept { tick, round, incoming, report, checkpoint, load };
                        self.order(PhysicsCommand::Verify { run: number, command: Some(Box::new(accept)) });
                        for other in disputed {
                            self.tell_verdict(at, node, Finding::Contradicts(other));
                        }
                    }
                    Err(finding) => self.conclude(at, node, finding),
                }
            }
            Some(PhysicsEvent::Settled { report, .. }) => match job.compare(node, reported, &report) {
                Ok(()) => {
                    run.jobs.pop_front();
                    self.counters.verified += 1;
                    let newest = (self.number(), self.tick);
                    self.verifier.forget_told(newest);
                }
                Err(finding) => self.conclude(at, node, finding),
            },
            // The participant said that a region is empty, and it is not.
            _ => {
                let region = job.region_of(node);
                self.conclude(at, node, Finding::Deviates(region));
            }
        }
    }

    /// Ends the verification of a participant.
    fn conclude(&mut self, at: Moment, node: NodeId, finding: Finding) {
        if let Some(run) = self.verifier.runs.remove(&node) {
            self.order(PhysicsCommand::Verify { run: run.number, command: None });
        }
        if self.verifier.runs.is_empty() {
            self.verifier.told.clear();
        }
        self.tell_verdict(at, node, finding);
        if let Finding::Contradicts(_) = finding {
            self.tell_verdict(at, node, Finding::GivenUp(Hindrance::Unknown));
        }
    }

    fn tell_verdict(&mut self, (view, tick): Moment, node: NodeId, finding: Finding) {
        self.send_server(ToServer::Verdict { view, tick, node, finding });
    }

    /// Takes in what a member tells the leader that verifies participants.
    pub(super) fn hear_witness(&mut self, from: NodeId, message: Message) {
        match message {
            Message::Testimony(testimony) => self.verifier.hear(from, testimony),
            Message::Copied { to, border } => self.verifier.copy(from, to, border),
            _ => {}
        }
    }
}
