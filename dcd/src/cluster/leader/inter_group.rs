//! Synchronises a group with other groups (inter-group, thesis 3.3.8): tracks which bodies it is
//! authoritative for, sends their states to the other groups, and corrects its own bodies where another group
//! is authoritative.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Bound;

use nalgebra::Vector3;

use super::Leader;
use crate::cluster::Peer;
use crate::cluster::correction::deviation_m;
use crate::delta::alone;
use crate::protocol::{Input, STATES_BYTES, SharedState, Stance, ToServer, Touch, WorldOp};
use crate::space::{BodyId, ClientId, Tick};

/// The number of ticks between messages to the other groups.
const TELL_EVERY: u64 = 6;
/// The number of bodies told before that are sent again with each message.
const REMINDERS: usize = 4;
/// The age from which a state that another group sent does not count any more, ticks.
const STALE_TICKS: u64 = 60;
/// The time after which a body counts as stuck whose deviation has stayed about the same, seconds. Nothing in its way, it
/// would have come nearer by 0.7 m.
const STUCK_S: f64 = 2.0;
/// The change up to which a deviation stays about the same: a part of it, and metres.
const ABOUT: f64 = 0.5;
const ABOUT_M: f64 = 0.5;
/// The difference in ticks to the main group beyond which this group hurries or waits.
const STEP_TICKS: i64 = 1;
/// The share of a tick by which the group hurries or waits per tick of difference. A difference of a second
/// is made up for in some five seconds.
const HURRY: f32 = 0.01;
const MOST_HURRY: f32 = 0.25;

/// The deviations of this group's bodies from the authoritative groups', since they were last asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviations {
    /// The number of comparisons of a body.
    pub count: u64,
    /// The sum over all comparisons, metres.
    pub sum_m: f64,
    /// The largest deviation, metres.
    pub max_m: f64,
    /// The number of deviations above the threshold between groups.
    pub above: u64,
}

/// The leader's state between groups.
#[derive(Clone, Debug, Default)]
pub(super) struct InterGroup {
    by_default: bool,
    stances: BTreeMap<BodyId, (u32, bool)>,
    /// Bodies that moved since states were last sent, among those that this group is authoritative for.
    moved: BTreeSet<BodyId>,
    told: BTreeMap<BodyId, (Tick, SharedState)>,
    /// The body that other groups were reminded of last; none before the first, and where the round begins anew.
    reminded: Option<BodyId>,
    /// The newest states that other groups sent.
    heard: BTreeMap<BodyId, (Tick, SharedState)>,
    news: BTreeSet<BodyId>,
    /// Bodies that are corrected, with where they were from their goals when that last changed, metres, and since when it
    /// is about so.
    correcting: BTreeMap<BodyId, (Vector3<f64>, Tick)>,
    /// Bodies that are corrected and have come no nearer for long.
    stuck: BTreeSet<BodyId>,
    /// How many ticks the main group is ahead.
    pub ahead: Option<i64>,
    deviations: Deviations,
    pub to_server: Vec<ToServer>,
}

impl InterGroup {
    /// Returns the messages for the server since the last call.
    pub(super) fn take_messages(&mut self) -> Vec<ToServer> {
        std::mem::take(&mut self.to_server)
    }

    /// Returns whether no other body that is corrected, too, stands in the place of this one: nearer to it than to its own.
    /// In the authoritative group nothing overlaps, so what is where it should be is not in the way.
    fn has_room(&self, id: BodyId, latest: &BTreeMap<BodyId, (SharedState, Tick)>) -> bool {
        let Some((_, goal)) = self.heard.get(&id) else { return false };
        let is_in_the_way = |(other, (way, _)): (&BodyId, &(Vector3<f64>, Tick))| {
            let at = latest.get(other).map(|(own, _)| own.pose);
            *other != id && at.is_some_and(|at| deviation_m(&at, &goal.pose) < way.norm())
        };
        !self.correcting.iter().any(is_in_the_way)
    }

    fn is_ours(&self, id: BodyId, clients: &BTreeMap<ClientId, Peer>) -> bool {
        match id.client() {
            Some(client) => clients.contains_key(&client),
            None => self.stances.get(&id).map_or(self.by_default, |&(_, ours)| ours),
        }
    }
}

impl Leader {
    /// Takes in from the server which bodies this group is authoritative for.
    pub fn authority(&mut self, alone: bool, by_default: bool, stances: Vec<Stance>) {
        let known: BTreeSet<_> = self.latest.keys().copied().collect();
        let inter_group =
            self.inter_group.get_or_insert_with(|| InterGroup { moved: known, ..InterGroup::default() });
        inter_group.by_default = by_default;
        for Stance { body, number, yours } in stances {
            if inter_group.stances.get(&body).is_none_or(|&(known, _)| known <= number) {
                inter_group.stances.insert(body, (number, yours));
                inter_group.moved.insert(body);
            }
        }
        if by_default {
            inter_group.ahead = None;
        }
        // Bodies that this group is authoritative for are corrected no more.
        let is_ours = |id: &BodyId| alone || inter_group.is_ours(*id, &self.clients);
        let ours: Vec<_> = inter_group.heard.keys().copied().filter(is_ours).collect();
        ours.into_iter().for_each(|id| self.let_go(id));
        if alone {
            self.inter_group = None;
        }
    }

    /// Stops correcting a body. It goes on with the velocity of its target, not with that of the correction.
    fn let_go(&mut self, id: BodyId) {
        let Some(inter_group) = &mut self.inter_group else { return };
        inter_group.news.remove(&id);
        let Some((_, state)) = inter_group.heard.remove(&id) else { return };
        if inter_group.correcting.remove(&id).is_some() && id.client().is_none() {
            let velocity = state.velocity;
            self.ops.push(WorldOp::Input(Input {
                body: id,
                logical_time: 0,
                tick: Tick(0),
                velocity,
                pose: None,
                drive: None,
            }));
            if let Some((latest, _)) = self.latest.get_mut(&id) {
                latest.velocity = velocity;
            }
        }
    }

    /// Takes in states that other groups sent of bodies that they are authoritative for.
    pub fn hear_other_groups(&mut self, main: bool, tick: Tick, states: Vec<SharedState>) {
        let now = self.tick.0;
        let Some(inter_group) = &mut self.inter_group else { return };
        if main && !inter_group.by_default {
            inter_group.ahead = Some(tick.0 as i64 - now as i64);
        }
        for state in states {
            let id = state.id;
            // A state of one of our bodies was sent before this group became authoritative.
            let theirs = !inter_group.is_ours(id, &self.clients);
            if theirs && inter_group.heard.get(&id).is_none_or(|(known, _)| *known < tick) {
                inter_group.heard.insert(id, (tick, state));
                // A body that moves is compared when it is reported, and left alone within the threshold:
                // velocities of some ticks ago would undo what it has hit since.
                let is_compared = self.latest.get(&id).is_some_and(|(own, _)| !own.sleeping);
                if id.client().is_some() || !is_compared || inter_group.correcting.contains_key(&id) {
                    inter_group.news.insert(id);
                }
            }
        }
    }

    /// Returns how far this group's bodies were from where the authoritative groups have them, since the last
    /// call.
    pub fn take_deviations(&mut self) -> Deviations {
        self.inter_group
            .as_mut()
            .map(|inter_group| std::mem::take(&mut inter_group.deviations))
            .unwrap_or_default()
    }

    /// Returns the factor by which the next tick is longer or shorter than usual, so that groups keep step.
    pub(super) fn stretch(&self) -> f32 {
        match self.inter_group.as_ref().and_then(|inter_group| inter_group.ahead) {
            Some(ahead) if ahead.abs() > STEP_TICKS => {
                1.0 - (ahead as f32 * HURRY).clamp(-MOST_HURRY, MOST_HURRY)
            }
            _ => 1.0,
        }
    }

    pub(super) fn moved_here(&mut self, id: BodyId) {
        if let Some(inter_group) =
            self.inter_group.as_mut().filter(|inter_group| inter_group.is_ours(id, &self.clients))
        {
            inter_group.moved.insert(id);
        }
    }

    /// Returns whether this group takes itself to be authoritative for a body.
    pub fn is_authoritative(&self, id: BodyId) -> bool {
        self.inter_group.as_ref().is_none_or(|inter_group| inter_group.is_ours(id, &self.clients))
    }

    /// Claims authority for bodies that a local avatar touches.
    pub(super) fn claim(&mut self, touches: &[Touch]) {
        let Some(inter_group) = &mut self.inter_group else { return };
        let mut claims = BTreeMap::new();
        for touch in touches.iter().filter(|touch| touch.began && !touch.sensor) {
            for (avatar, body) in [(touch.key.a, touch.key.b), (touch.key.b, touch.key.a)] {
                let is_local = avatar.client().is_some_and(|client| self.clients.contains_key(&client));
                if !is_local || body.client().is_some() || !self.latest.contains_key(&body) {
                    continue;
                }
                let (number, ours) =
                    inter_group.stances.get(&body).copied().unwrap_or((0, inter_group.by_default));
                if !ours {
                    claims.insert(body, number + 1);
                }
            }
        }
        if !claims.is_empty() {
            inter_group
                .to_server
                .push(ToServer::Touched { view: self.view, bodies: claims.into_iter().collect() });
        }
    }

    /// Compares bodies with the authoritative groups' after a completed tick, and sends states to the other
    /// groups at a set rate.
    pub(super) fn compare_and_tell(&mut self) {
        let (view, tick, dt_s) = (self.view, self.tick, self.dt.as_secs_f64());
        let thresholds = self.thresholds;
        let is_known = self.knows_all();
        let heard = self.inter_group.iter().flat_map(|inter_group| &inter_group.heard);
        let stale = heard.filter(|(_, (heard, _))| heard.0 + STALE_TICKS <= tick.0).map(|(&id, _)| id);
        stale.collect::<Vec<_>>().into_iter().for_each(|id| self.let_go(id));
        let Some(inter_group) = &mut self.inter_group else { return };
        for (id, (heard, state)) in &inter_group.heard {
            let Some((own, at)) = self.latest.get(id).filter(|(_, at)| *at == tick) else { continue };
            let lag_s = (at.0 as f64 - heard.0 as f64) * dt_s;
            let goal = state.pose.moved(&state.velocity, lag_s);
            let deviation = deviation_m(&own.pose, &goal);
            let band = f64::from(thresholds.between_groups_m);
            let seen = &mut inter_group.deviations;
            seen.count += 1;
            seen.sum_m += deviation;
            seen.max_m = seen.max_m.max(deviation);
            seen.above += u64::from(deviation > band);
            if deviation > 0.5 * band {
                let way = Vector3::from(goal.translation) - Vector3::from(own.pose.translation);
                let (before, since) = inter_group.correcting.entry(*id).or_insert((way, tick));
                if (way - *before).norm() > (ABOUT * before.norm()).min(ABOUT_M) {
                    (*before, *since) = (way, tick);
                } else if (tick.0 - since.0) as f64 * dt_s >= STUCK_S {
                    *since = tick;
                    inter_group.stuck.insert(*id);
                }
                inter_group.news.insert(*id);
            } else if inter_group.correcting.remove(id).is_some() {
                inter_group.news.insert(*id);
            }
        }
        if tick.0.is_multiple_of(TELL_EVERY) {
            // Bodies that nobody has looked at until now are yet to be reported.
            let after = inter_group.reminded.map_or(Bound::Unbounded, Bound::Excluded);
            let most = if is_known { REMINDERS } else { 0 };
            let reminders = inter_group.told.range((after, Bound::Unbounded)).take(most);
            let reminders: Vec<_> = reminders.map(|(&id, _)| id).collect();
            if is_known {
                inter_group.reminded = reminders.last().copied();
            }
            let mut states = Vec::new();
            let moved = if is_known { std::mem::take(&mut inter_group.moved) } else { BTreeSet::new() };
            for id in moved.iter().chain(&reminders).collect::<BTreeSet<_>>() {
                let Some((state, at)) = self.latest.get(id) else { continue };
                let foretold = inter_group.told.get(id).is_some_and(|(told, known)| {
                    let lag_s = (at.0 as f64 - told.0 as f64) * dt_s;
                    let pose = known.pose.moved(&known.velocity, lag_s);
                    let limit = f64::from(thresholds.dead_reckoning_m);
                    known.sleeping == state.sleeping
                        && at.0 < told.0 + STALE_TICKS / 2
                        && deviation_m(&state.pose, &pose) < limit
                });
                if !foretold || !moved.contains(id) {
                    // States are sent as of this tick: the reader has one tick per message.
                    let lag_s = (tick.0 as f64 - at.0 as f64) * dt_s;
                    let pose = state.pose.moved(&state.velocity, lag_s);
                    let state = SharedState { pose, ..*state };
                    inter_group.told.insert(*id, (tick, state));
                    states.push(state);
                }
            }
            // A message goes out even without news, so that the others can keep step.
            for states in alone::write(&states, STATES_BYTES) {
                inter_group.to_server.push(ToServer::InterGroup { view, tick, states });
            }
        }
    }

    /// Returns the corrections for the next tick.
    pub(super) fn corrections(&mut self) -> Vec<WorldOp> {
        let Some(inter_group) = &mut self.inter_group else { return Vec::new() };
        let mut by_tick: BTreeMap<Tick, (Vec<SharedState>, Vec<BodyId>)> = BTreeMap::new();
        let mut stuck = std::mem::take(&mut inter_group.stuck);
        stuck.retain(|id| inter_group.has_room(*id, &self.latest));
        for id in std::mem::take(&mut inter_group.news) {
            let Some(&(tick, state)) = inter_group.heard.get(&id) else { continue };
            // A body that is unknown here is left alone. Avatars have no other way to learn where they go.
            if id.client().is_some() || self.latest.contains_key(&id) {
                let of_tick = by_tick.entry(tick).or_default();
                of_tick.0.push(state);
                of_tick.1.extend(stuck.take(&id));
            }
        }
        let correct = |(tick, (states, stuck))| WorldOp::Correct { tick, states, stuck };
        by_tick.into_iter().map(correct).collect()
    }

    pub(super) fn forget_in_other_groups(&mut self, id: BodyId) {
        if let Some(inter_group) = &mut self.inter_group {
            inter_group.moved.remove(&id);
            inter_group.told.remove(&id);
            inter_group.heard.remove(&id);
            inter_group.news.remove(&id);
            inter_group.correcting.remove(&id);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::protocol::{Dispatch, Done, Member, Report, Velocity, View, ViewNumber, WorldPose};
    use crate::sim::sim_world;
    use crate::space::{Epoch, GroupId, NodeId, RegionId};

    const BODY: BodyId = BodyId::persistent(1);

    fn moving(x: f64, speed: f32) -> SharedState {
        let velocity = Velocity { linear: [speed, 0.0, 0.0], angular: [0.0; 3] };
        SharedState {
            id: BODY,
            owner: RegionId(1),
            epoch: Epoch(0),
            pose: WorldPose::at([x, 4.0, 4.0]),
            velocity,
            sleeping: false,
        }
    }

    /// Returns the leader of a group of one node that is not the main group.
    fn leader() -> Leader {
        let member = Member { node: NodeId(1), address: ([127, 0, 0, 1], 1).into(), client: None };
        let view = View {
            events: false,
            viewpoints: Vec::new(),
            group: GroupId(2),
            number: ViewNumber(1),
            tick: Tick(0),
            leader: NodeId(1),
            members: vec![member],
            tree: sim_world(2).tree,
            allocation: [(RegionId(1), NodeId(1))].into(),
        };
        let mut leader = Leader::new(Duration::ZERO, &view, &sim_world(2));
        leader.authority(false, false, Vec::new());
        leader
    }

    /// Completes a tick, after which the body is where `state` says, and dispatches the next.
    fn tick(leader: &mut Leader, state: SharedState) -> Dispatch {
        tick_with(leader, vec![state])
    }

    fn tick_with(leader: &mut Leader, states: Vec<SharedState>) -> Dispatch {
        let (view, tick) = (leader.view, leader.tick);
        leader.report(NodeId(1), Report { view, tick, states });
        let done = Done {
            view,
            tick,
            rounds_wanted: 1,
            holds: None,
            events: Vec::new(),
            answers: vec![],
            load: None,
            compute_us: 0,
            regions: vec![],
        };
        leader.done(NodeId(1), done);
        let mut dispatch = leader.dispatch(Duration::from_secs(tick.0 + 1)).expect("it is alone");
        dispatch.ops.retain(|op| !matches!(op, WorldOp::Watch(_)));
        dispatch
    }

    /// Returns a leader that corrects a body towards a place far from where it is.
    fn leading() -> Leader {
        let mut leader = leader();
        tick(&mut leader, moving(1.0, 6.0));
        leader.hear_other_groups(true, Tick(1), vec![moving(2.0, 0.5)]);
        let ops = tick(&mut leader, moving(1.1, 6.0)).ops;
        assert_eq!(ops, [WorldOp::Correct { tick: Tick(1), states: vec![moving(2.0, 0.5)], stuck: vec![] }]);
        leader
    }

    /// Returns the operation that ends a correction: the body is to move as it does in the other group.
    fn let_go() -> Vec<WorldOp> {
        let velocity = moving(0.0, 0.5).velocity;
        vec![WorldOp::Input(Input {
            body: BODY,
            logical_time: 0,
            tick: Tick(0),
            velocity,
            pose: None,
            drive: None,
        })]
    }

    #[test]
    fn who_becomes_authoritative_for_a_body_does_not_keep_the_speed_at_which_it_was_led() {
        let mut leader = leading();
        leader.authority(false, false, vec![Stance { body: BODY, number: 1, yours: true }]);
        assert_eq!(leader.latest[&BODY].0.velocity, moving(0.0, 0.5).velocity, "as the others are told");
        assert_eq!(tick(&mut leader, moving(1.2, 0.5)).ops, let_go());
        assert_eq!(tick(&mut leader, moving(1.2, 0.5)).ops, [], "once");
        let mut main = leading();
        main.authority(false, true, Vec::new());
        assert_eq!(tick(&mut main, moving(1.2, 0.5)).ops, let_go());
        let mut alone = leading();
        alone.authority(true, true, Vec::new());
        assert_eq!(tick(&mut alone, moving(1.2, 0.5)).ops, let_go());
    }

    #[test]
    fn a_body_that_is_not_heard_of_any_more_is_let_go() {
        let mut leader = leading();
        for _ in 2..=STALE_TICKS {
            let ops = tick(&mut leader, moving(1.2, 6.0)).ops;
            assert!(matches!(ops[..], [WorldOp::Correct { .. }]), "{ops:?}");
        }
        assert_eq!(tick(&mut leader, moving(1.2, 6.0)).ops, let_go());
    }

    /// Returns in which ticks of five seconds a body is put to where the authoritative group has it, three metres off,
    /// which is at these states here.
    fn put_in(states: impl Fn(u64) -> Vec<SharedState>) -> Vec<u64> {
        let mut leader = leader();
        tick_with(&mut leader, states(0));
        let mut put = Vec::new();
        for now in 1..=300 {
            leader.hear_other_groups(true, leader.tick, vec![moving(4.0, 0.0)]);
            let ops = tick_with(&mut leader, states(now)).ops;
            let is_put = |op: &WorldOp| matches!(op, WorldOp::Correct { stuck, .. } if stuck == &[BODY]);
            put.extend(ops.iter().any(is_put).then_some(now));
        }
        put
    }

    #[test]
    fn what_comes_no_nearer_for_two_seconds_is_put_to_its_place_if_nothing_else_stands_there() {
        let jitters = |now: u64| moving(1.0 + 0.02 * (now % 7) as f64, 1.0);
        assert_eq!(put_in(|now| vec![jitters(now)]), [121, 241]);
        // One that comes nearer by half a metre per second, and one that is pushed away time and again.
        assert_eq!(put_in(|now| vec![moving(1.0 + now as f64 / 120.0, 0.5)]), [0; 0]);
        assert_eq!(put_in(|now| vec![moving(1.0 - now as f64 % 90.0 / 30.0, 0.5)]), [0; 0]);
    }

    #[test]
    fn nothing_is_put_to_where_another_stands_that_should_be_elsewhere() {
        let other = |x: f64| SharedState { id: BodyId::persistent(2), ..moving(x, 0.0) };
        for (at, puts) in [(4.3, vec![]), (5.6, vec![120])] {
            let mut leader = leader();
            let mut put = Vec::new();
            for now in 0..200 {
                let states = vec![moving(4.0, 0.0), other(7.0)];
                leader.hear_other_groups(true, leader.tick, states);
                let ops = tick_with(&mut leader, vec![moving(1.0, 1.0), other(at)]).ops;
                let is_put =
                    |op: &WorldOp| matches!(op, WorldOp::Correct { stuck, .. } if stuck.contains(&BODY));
                put.extend(ops.iter().any(is_put).then_some(now));
            }
            assert_eq!(put, puts, "{at}");
        }
    }

    #[test]
    fn what_was_not_led_moves_on_as_it_did_when_its_group_becomes_believed() {
        let mut leader = leader();
        tick(&mut leader, moving(1.0, 0.6));
        leader.hear_other_groups(true, Tick(1), vec![moving(1.01, 0.5)]);
        tick(&mut leader, moving(1.01, 0.6));
        leader.authority(false, false, vec![Stance { body: BODY, number: 1, yours: true }]);
        assert_eq!(tick(&mut leader, moving(1.02, 0.6)).ops, []);
    }

    #[test]
    fn a_group_hurries_or_waits_the_more_the_farther_it_is_from_the_main_one() {
        let mut leader = leader();
        let mut stretch = |ahead: u64| {
            leader.tick = Tick(1_000);
            leader.hear_other_groups(true, Tick(1_000 + ahead), Vec::new());
            leader.stretch()
        };
        assert_eq!([0, 1, 10, 80].map(&mut stretch), [1.0, 1.0, 0.9, 0.75]);
        leader.tick = Tick(1_010);
        leader.hear_other_groups(true, Tick(1_000), Vec::new());
        assert_eq!(leader.stretch(), 1.1);
    }
}
