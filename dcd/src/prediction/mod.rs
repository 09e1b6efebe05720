//! Predicts own avatars and what they touch ahead of the world, so that they answer to their user at once
//! (client-side prediction).
//!
//! A client keeps a small Rapier world of what is near its avatars. There an input acts at once, in the tick
//! that it names. The node that computes the world applies the input in the same tick, some time later. When
//! the states of a tick arrive and differ from the prediction, the client corrects that tick and computes the
//! ticks after it again, with the inputs since (rollback). What that changes of what is shown fades out.

mod near;
mod shown;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tracing::warn;

use self::near::{Chosen, Search};
use self::shown::Shown;
use crate::cluster::Client;
use crate::physics::{Checkpoint, HostError, Partition, RegionHost};
use crate::playback::{Motion, ViewTime};
use crate::protocol::{
    BodyKind, BodyRecord, BodyState, BodyTraits, EnvironmentProperties, Gait, Input, JointRecord, ShapeHash,
    ShapeRecord,
};
use crate::space::{BodyId, ClientId, DistributionTree, JointId, Tick};

/// The most ticks that are predicted beyond the last one told.
const AHEAD_TICKS: u64 = 90;
/// The number of ticks for which inputs are kept.
const KEPT_TICKS: u64 = 4 * AHEAD_TICKS;
/// The number of ticks between two searches for what is near.
const SEARCH_TICKS: u64 = 6;
/// The least number of ticks between two corrections of bodies that no own avatar is about to touch.
const PATIENCE_TICKS: u64 = 30;
/// The error within which a predicted position is as told, metres. States are told in steps of about a tenth
/// of these tolerances.
const LIKE_M: f64 = 0.004;
/// The same of a rotation, radians; see [`LIKE_M`].
const LIKE_RAD: f64 = 0.01;
/// The same of a speed, m/s; see [`LIKE_M`].
const LIKE_M_S: f32 = 0.1;
/// A body that moves less than this from a moment behind the world to the predicted tick may be shown at
/// either, metres.
const STILL_M: f64 = 0.002;
/// The number of ticks between two checkpoints: states are told every third tick as a rule.
const CHECKPOINT_TICKS: u64 = 3;
/// The correction above which it is counted, metres.
const COUNTED_M: f64 = 0.02;

/// Statistics of what a client predicted, and how often it was wrong
/// ([`World::prediction`](crate::World::prediction)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Prediction {
    /// The number of movable bodies that are predicted now: own avatars and what is near.
    pub bodies: usize,
    /// The number of ticks predicted so far.
    pub ticks: u64,
    /// The number of replays: times that the received states differed from the prediction, and ticks were
    /// computed again.
    pub replays: u64,
    /// The number of replays by which an own avatar, or what it touches, was shown more than 2 cm off.
    pub corrections: u64,
    /// The largest such correction, metres.
    pub largest_correction_m: f64,
    /// The wall time of predictions in the last frame.
    pub last_frame: Duration,
    /// The longest wall time of predictions in a frame.
    pub longest_frame: Duration,
}

/// A movable body that is predicted.
struct Near {
    traits: Arc<BodyTraits>,
    user_data: u128,
    /// Its states from the base tick on, one per tick.
    states: VecDeque<BodyState>,
    shown: Shown,
}

/// What the world tells of the tick from which predictions begin.
struct Told {
    tick: Tick,
    states: BTreeMap<BodyId, (Motion, bool)>,
    /// Bodies as shown a moment behind the world, at the ticks of the last frame.
    behind: BTreeMap<BodyId, Motion>,
    first_unapplied: Option<Tick>,
}

/// A change of the set of bodies that are predicted.
struct Changes {
    chosen: Chosen,
    bodies: Vec<BodyRecord>,
    /// Shapes; parts come before the compounds that use them.
    shapes: Vec<ShapeRecord>,
    joints: Vec<JointRecord>,
}

/// The small world that a client predicts.
pub(crate) struct Predictor {
    client: ClientId,
    host: RegionHost,
    dt_s: f64,
    near: BTreeMap<BodyId, Near>,
    /// Immovable bodies and joints, as told when they were inserted.
    scenery: BTreeMap<BodyId, BodyRecord>,
    joints: BTreeMap<JointId, JointRecord>,
    search: Search,
    search_at: Tick,
    /// The changes found since the last frame.
    changes: Option<Changes>,
    /// Says whether anything was inserted, removed or changed since the last prediction: checkpoints are of the
    /// bodies before.
    is_changed: bool,
    told: Option<Told>,
    /// Inputs that may have to act again, in the order of the ticks that they name.
    inputs: VecDeque<Input>,
    first_unapplied: Option<Tick>,
    /// The newest tick told, from which predictions begin, and the newest tick predicted.
    base: Tick,
    tip: Tick,
    /// Checkpoints of the small world after the base tick and some of those since. They hold contacts too,
    /// without which stacks fall differently.
    checkpoints: VecDeque<Checkpoint>,
    /// The first tick to compute again, if any.
    stale: Option<Tick>,
    put_right: Tick,
    /// The newest tick that was ever predicted.
    newest: Tick,
    stats: Prediction,
}

impl Predictor {
    pub(crate) fn new(client: ClientId, world: &EnvironmentProperties) -> Result<Self, HostError> {
        let tree = DistributionTree::halved(world.tree.bounds(), 1)?;
        let regions: Vec<_> = tree.leaves().collect();
        let host = RegionHost::new(Partition::new(tree, world.halo_m), world.step.into(), 1, &regions)?;
        Ok(Self {
            client,
            host,
            dt_s: f64::from(world.step.dt_s),
            near: BTreeMap::new(),
            scenery: BTreeMap::new(),
            joints: BTreeMap::new(),
            search: Search::default(),
            search_at: Tick(0),
            changes: None,
            is_changed: false,
            told: None,
            inputs: VecDeque::new(),
            first_unapplied: None,
            base: Tick(0),
            tip: Tick(0),
            checkpoints: VecDeque::new(),
            stale: None,
            put_right: Tick(0),
            newest: Tick(0),
            stats: Prediction::default(),
        })
    }

    pub(crate) fn stats(&self) -> Prediction {
        Prediction { bodies: self.near.len(), ..self.stats }
    }

    /// Takes in an input that was made now. It names a tick.
    pub(crate) fn input(&mut self, input: Input) {
        // Inputs of the same slot that name later ticks are older: the world stood still meanwhile.
        self.inputs.retain(|old| old.slot() != input.slot() || old.tick <= input.tick);
        // The client may never show a frame, which would let inputs go.
        while self.inputs.front().is_some_and(|old| old.tick.0 + KEPT_TICKS < input.tick.0) {
            self.inputs.pop_front();
        }
        self.inputs.push_back(input);
        if input.tick <= self.tip {
            self.stale = Some(self.stale.map_or(input.tick, |stale| stale.min(input.tick)));
        }
    }

    /// Takes in what the client was told since the last frame.
    pub(crate) fn listen(&mut self, client: &Client, predicted: f64) {
        let start = Instant::now();
        self.look(client, Tick(predicted.max(0.0) as u64));
        // Where everything rests, nothing is told, and the told tick follows the shown one. A world that
        // stood still has not reached that tick.
        let told = client.told_tick().map(|tick| tick.min(Tick(predicted.max(0.0) as u64)));
        self.told = told.map(|tick| Told {
            tick,
            states: self.near.keys().filter_map(|&id| Some((id, client.told_at(id, tick)?))).collect(),
            behind: self
                .near
                .iter()
                .filter_map(|(&id, near)| Some((id, client.view(id, near.shown.tick()?)?)))
                .collect(),
            first_unapplied: client.first_unapplied(),
        });
        self.stats.last_frame = start.elapsed();
    }

    /// Predicts up to the tick `time.predicted`. Call it once per frame.
    pub(crate) fn advance(&mut self, time: &ViewTime) {
        let start = Instant::now();
        self.change();
        if let Some(told) = self.told.take().filter(|_| !self.near.is_empty())
            && let Err(error) = self.predict(&told, time)
        {
            warn!(%error, "avatars are not predicted");
            self.near.keys().copied().collect::<Vec<_>>().into_iter().for_each(|id| self.drop_body(id));
        }
        self.stats.last_frame += start.elapsed();
        self.stats.longest_frame = self.stats.longest_frame.max(self.stats.last_frame);
    }

    /// Returns the motion in which a body is shown at a tick; `None` if that is not predicted.
    pub(crate) fn at(&self, id: BodyId, tick: f64) -> Option<Motion> {
        let near = self.near.get(&id)?;
        let mut motion = self.bare_at(near, tick)?;
        near.shown.melt(&mut motion, tick, self.dt_s);
        Some(motion)
    }

    /// Returns the tick at which a body is shown in this frame; `None` if it is not predicted.
    pub(crate) fn tick_of(&self, id: BodyId, time: &ViewTime) -> Option<f64> {
        let ahead = self.near.get(&id)?.shown.ahead();
        Some(time.shown + ahead * (time.predicted - time.shown))
    }

    fn bare_at(&self, near: &Near, tick: f64) -> Option<Motion> {
        let since = tick - self.base.0 as f64;
        let last = near.states.len().checked_sub(1)?;
        if since < 0.0 || self.base == self.tip {
            return None;
        }
        let from = (since as usize).min(last);
        let motion = |index: usize| Motion::of(&near.states[index]);
        let next = (from + 1).min(last);
        let share = (since - from as f64).min(1.0);
        let (a, b) = (motion(from), motion(next));
        // Within a tick a body moves straight, at the velocity that it has after the tick.
        let mut between = a.towards(&b, self.dt_s, share);
        if !a.is_teleported_to(&b, self.dt_s) {
            let [a, to] = [a, b].map(|motion| motion.pose.translation);
            between.pose.translation = std::array::from_fn(|i| a[i] + (to[i] - a[i]) * share);
            between.velocity = b.velocity;
        }
        Some(between)
    }

    /// Searches now and then for what is near, and for bodies and joints that have changed.
    fn look(&mut self, client: &Client, now: Tick) {
        let waits = now < self.search_at && now.0 + SEARCH_TICKS >= self.search_at.0;
        // While the world arrives, perhaps once more, not all joints are known.
        if waits || self.changes.is_some() || !client.is_joined() {
            return;
        }
        let present = Chosen {
            movable: self.near.keys().copied().collect(),
            scenery: self.scenery.keys().copied().collect(),
        };
        let Some(chosen) = self.search.go_on(client, &present) else { return };
        self.search_at = Tick(now.0 + SEARCH_TICKS);
        let told = |ids: &BTreeSet<BodyId>| -> Vec<&BodyRecord> {
            ids.iter().filter_map(|id| Some(&client.body(*id)?.body)).collect()
        };
        let movable = told(&chosen.movable).into_iter().filter(|body| !self.moves_as(body));
        let scenery = told(&chosen.scenery).into_iter().filter(|body| !self.stands_as(body));
        let bodies: Vec<_> = movable.chain(scenery).cloned().collect();
        let named: BTreeSet<_> =
            bodies.iter().flat_map(|body| &body.traits.colliders).map(|part| part.shape).collect();
        let find = |hash: &ShapeHash| client.shapes().get(hash);
        let whole = || named.iter().filter_map(find);
        let parts = whole().flat_map(ShapeRecord::parts).filter_map(|hash| find(&hash));
        let shapes = parts.chain(whole()).cloned().collect();
        let holds = |id: &BodyId| chosen.movable.contains(id) || chosen.scenery.contains(id);
        let joints = chosen.movable.iter().flat_map(|id| client.joints_of(*id));
        let joints: BTreeMap<_, _> = joints.map(|joint| (joint.id, joint)).collect();
        let joints = joints.into_values().filter(|joint| holds(&joint.a) && holds(&joint.b));
        let joints = joints.cloned().collect();
        self.changes = Some(Changes { chosen, bodies, shapes, joints });
    }

    /// Returns whether a movable body is predicted with the traits and user data that are told of it now.
    fn moves_as(&self, told: &BodyRecord) -> bool {
        let near = self.near.get(&told.id);
        near.is_some_and(|near| near.user_data == told.user_data && is_of(&near.traits, &told.traits))
    }

    /// Returns whether an immovable body is in the small world as it is told now, and where it is told to be.
    fn stands_as(&self, told: &BodyRecord) -> bool {
        let held = self.scenery.get(&told.id);
        held.is_some_and(|held| {
            held.traits == told.traits
                && held.user_data == told.user_data
                && held.state.pose == told.state.pose
        })
    }

    fn drop_body(&mut self, id: BodyId) {
        self.host.remove(id);
        self.near.remove(&id);
        self.scenery.remove(&id);
    }

    /// Drops joints that are no longer told, or differ from when they were inserted. Returns whether there
    /// were any. Joints of removed bodies went with these.
    fn drop_joints(&mut self, told: &[JointRecord]) -> bool {
        self.joints.retain(|joint, _| self.host.joint(*joint).is_some());
        let gone: Vec<_> =
            self.joints.values().filter(|held| !told.contains(held)).map(|held| held.id).collect();
        for joint in &gone {
            self.host.remove_joint(*joint);
            self.joints.remove(joint);
        }
        !gone.is_empty()
    }

    /// Applies the changes to the small world.
    fn change(&mut self) {
        let Some(Changes { chosen, bodies, shapes, joints }) = self.changes.take() else { return };
        let movable = self.near.keys().filter(|id| !chosen.movable.contains(id));
        let scenery = self.scenery.keys().filter(|id| !chosen.scenery.contains(id));
        let others = bodies.iter().map(|body| &body.id);
        let gone: Vec<_> = movable.chain(scenery).chain(others).copied().collect();
        gone.iter().for_each(|id| self.drop_body(*id));
        let is_untied = self.drop_joints(&joints);
        let joints: Vec<_> =
            joints.into_iter().filter(|joint| !self.joints.contains_key(&joint.id)).collect();
        self.is_changed |= is_untied || !gone.is_empty() || !joints.is_empty();
        if let Err(error) = self.insert(bodies, shapes, &joints) {
            warn!(%error, "what is near an avatar is not predicted");
        }
        self.host.forget_unused_shapes();
    }

    fn insert(
        &mut self,
        bodies: Vec<BodyRecord>,
        shapes: Vec<ShapeRecord>,
        joints: &[JointRecord],
    ) -> Result<(), HostError> {
        for shape in shapes {
            self.host.shapes_mut().add(shape)?;
        }
        let bodies: Vec<_> = bodies.into_iter().map(predictable).collect();
        self.host.insert(bodies.clone(), joints)?;
        self.joints.extend(joints.iter().map(|joint| (joint.id, joint.clone())));
        for body in bodies {
            if body.traits.kind == BodyKind::Fixed {
                self.scenery.insert(body.id, body);
                continue;
            }
            let is_own = body.id.client() == Some(self.client);
            let reach_m = body.reach_m(|hash| self.host.shapes().record_of(hash));
            let near = Near {
                traits: body.traits,
                user_data: body.user_data,
                states: VecDeque::new(),
                shown: Shown::new(is_own, reach_m),
            };
            self.near.insert(body.id, near);
        }
        Ok(())
    }

    fn predict(&mut self, told: &Told, time: &ViewTime) -> Result<(), HostError> {
        let before = self.as_shown();
        let is_wrong = self.begin_from(told)?;
        if let Some(stale) = self.stale.take().filter(|_| !is_wrong) {
            // The input of this frame acts on ticks that the last frame predicted.
            self.go_back(Tick(stale.0.max(self.base.0 + 1) - 1))?;
        }
        let goal = Tick((time.predicted.max(0.0) as u64 + 1).min(self.base.0 + AHEAD_TICKS)).max(self.tip);
        let before_goal = if self.newest == Tick(0) { goal } else { self.newest };
        self.stats.ticks += goal.0.saturating_sub(before_goal.0);
        self.newest = goal;
        while self.tip < goal {
            self.step()?;
        }
        if is_wrong {
            self.melt(&before);
        }
        let still: BTreeSet<_> = self
            .near
            .iter()
            .filter(|(id, near)| self.is_still(**id, near, told))
            .map(|(id, _)| *id)
            .collect();
        shown::advance(&mut self.near, &self.host, &still, self.dt_s, time);
        self.jump_back(&before);
        Ok(())
    }

    /// Goes on from what was shown of bodies that were shown at a later tick: the world stood still, and
    /// predictions go back with it.
    fn jump_back(&mut self, before: &[(BodyId, f64, Motion)]) {
        for (id, last, shown) in before {
            let tick = self.near.get(id).and_then(|near| near.shown.tick()).filter(|tick| tick + 1.0 < *last);
            let Some(tick) = tick else { continue };
            let Some(bare) = self.near.get(id).and_then(|near| self.bare_at(near, tick)) else { continue };
            if let Some(near) = self.near.get_mut(id) {
                near.shown.melt_from(shown, &bare, tick, self.dt_s);
            }
        }
    }

    /// Returns whether a body neither moved nor will move from the tick at which it was shown last to the
    /// newest predicted.
    fn is_still(&self, id: BodyId, near: &Near, told: &Told) -> bool {
        let predicted = near.shown.tick().and_then(|tick| self.at(id, tick));
        let (Some(now), Some(last)) = (predicted.or(told.behind.get(&id).copied()), near.states.back())
        else {
            return false;
        };
        let is_there = |motion: &Motion| motion.distance_m(&Motion::of(last)) < STILL_M;
        is_there(&now) && near.states.front().is_some_and(|first| is_there(&Motion::of(first)))
    }

    /// Returns how bodies were shown in the last frame, at the ticks of that frame.
    fn as_shown(&self) -> Vec<(BodyId, f64, Motion)> {
        let of = |(id, near): (&BodyId, &Near)| {
            let tick = near.shown.tick()?;
            Some((*id, tick, self.at(*id, tick)?))
        };
        self.near.iter().filter_map(of).collect()
    }

    /// Fades out what a replay changed of what is shown, and counts corrections.
    fn melt(&mut self, before: &[(BodyId, f64, Motion)]) {
        let mut most_m = 0.0_f64;
        for (id, tick, shown) in before {
            let Some(bare) = self.near.get(id).and_then(|near| self.bare_at(near, *tick)) else { continue };
            let Some(near) = self.near.get_mut(id) else { continue };
            let off_m = near.shown.melt_from(shown, &bare, *tick, self.dt_s);
            if near.shown.ahead() > 0.5 {
                most_m = most_m.max(off_m);
            }
        }
        if most_m > COUNTED_M {
            self.stats.corrections += 1;
        }
        self.stats.largest_correction_m = self.stats.largest_correction_m.max(most_m);
    }

    /// Begins from the newest tick told. Returns whether ticks must be computed again from there.
    fn begin_from(&mut self, told: &Told) -> Result<bool, HostError> {
        let is_changed = std::mem::take(&mut self.is_changed);
        let is_known = (self.base..=self.tip).contains(&told.tick);
        if is_changed || !is_known {
            self.checkpoints.clear();
        }
        if is_known {
            let over = (told.tick.0 - self.base.0) as usize;
            // A body that is new has no states yet.
            self.near.values_mut().for_each(|near| drop(near.states.drain(..over.min(near.states.len()))));
        }
        (self.base, self.first_unapplied) = (told.tick, told.first_unapplied);
        self.forget_before_base();
        let mut unlike = BTreeMap::new();
        let mut is_urgent = is_changed || !is_known;
        for (id, near) in &self.near {
            let Some((motion, rests)) = told.states.get(id) else { continue };
            let state = near.states.front().filter(|_| is_known);
            if !state.is_some_and(|state| is_like(state, motion, *rests)) {
                is_urgent |= near.shown.is_engaged();
                unlike.insert(*id, (*motion, *rests));
            }
        }
        let is_due = self.base.0 >= self.put_right.0 + PATIENCE_TICKS && !unlike.is_empty();
        if !is_urgent && !is_due {
            return Ok(false);
        }
        self.put_right = self.base;
        self.stats.replays += u64::from(self.tip > self.base);
        if is_known {
            self.go_back(self.base)?;
        }
        self.put_states(&unlike);
        Ok(true)
    }

    /// Forgets what is not needed to compute again from the base tick on.
    fn forget_before_base(&mut self) {
        while self.checkpoints.get(1).is_some_and(|second| second.tick() <= self.base) {
            self.checkpoints.pop_front();
        }
        let from = self.checkpoints.front().map_or(self.base, Checkpoint::tick);
        let (base, first) = (self.base, self.first_unapplied);
        self.inputs.retain(|input| input.tick > from || is_late(input, base, first));
    }

    /// Puts bodies into the states told of the base tick. All others are put into the states predicted for
    /// it, where no checkpoint has restored them with their contacts.
    fn put_states(&mut self, told: &BTreeMap<BodyId, (Motion, bool)>) {
        let mut states = Vec::new();
        for (id, near) in &mut self.near {
            let Some(held) = self.host.owned(*id).map(|(region, handle)| region.body_state(handle)) else {
                continue;
            };
            let former = near.states.front().copied().unwrap_or(held);
            let state = match told.get(id) {
                Some((motion, rests)) => put_right(former, motion, *rests, near.shown.is_own()),
                None => former,
            };
            near.states.clear();
            near.states.push_back(state);
            if state != held {
                states.push((*id, state));
            }
        }
        self.host.put(self.base, states.iter().map(|(id, state)| (*id, state)));
        self.tip = self.base;
        self.checkpoints.clear();
        self.checkpoints.push_back(self.host.checkpoint());
    }

    /// Goes back to a tick that was predicted, with the contacts of then.
    fn go_back(&mut self, tick: Tick) -> Result<(), HostError> {
        self.checkpoints.truncate(self.checkpoints.partition_point(|checkpoint| checkpoint.tick() <= tick));
        if let Some(checkpoint) = self.checkpoints.back() {
            self.host.restore(checkpoint)?;
            while self.host.tick() < tick {
                self.compute()?;
            }
        }
        self.tip = tick;
        let count = tick.0.saturating_sub(self.base.0) as usize + 1;
        self.near.values_mut().for_each(|near| near.states.truncate(count));
        Ok(())
    }

    /// Computes the next tick with its inputs.
    fn compute(&mut self) -> Result<(), HostError> {
        let next = self.host.tick().next();
        let (base, first) = (self.base, self.first_unapplied);
        // Inputs that were not applied in the tick that they named are applied after the base tick.
        let is_due =
            |input: &&Input| input.tick == next || next == base.next() && is_late(input, base, first);
        let inputs: Vec<_> = self.inputs.iter().filter(is_due).copied().collect();
        inputs.iter().for_each(|input| self.host.obey(input));
        self.host.step()?;
        self.host.clear_events();
        Ok(())
    }

    /// Predicts the next tick.
    fn step(&mut self) -> Result<(), HostError> {
        self.compute()?;
        self.tip = self.host.tick();
        for (id, near) in &mut self.near {
            if let Some((region, handle)) = self.host.owned(*id) {
                near.states.push_back(region.body_state(handle));
            }
        }
        if self.checkpoints.back().is_none_or(|last| last.tick().0 + CHECKPOINT_TICKS <= self.tip.0) {
            self.checkpoints.push_back(self.host.checkpoint());
        }
        Ok(())
    }
}

/// Returns whether an input was not applied in the tick that it named, and may yet be. A refused input never
/// is.
fn is_late(input: &Input, base: Tick, first_unapplied: Option<Tick>) -> bool {
    let was_due = input.tick <= base && input.tick.0 + AHEAD_TICKS > base.0;
    was_due && first_unapplied.is_some_and(|first| first <= input.tick)
}

/// Returns whether traits are predicted as told. A body that follows poses is predicted to go on at its
/// velocity.
fn is_of(predicted: &BodyTraits, told: &Arc<BodyTraits>) -> bool {
    *predicted == **told
        || told.kind == BodyKind::KinematicPosition && predicted.kind == BodyKind::KinematicVelocity
}

/// Returns a body as it is predicted. The next pose of a body that follows poses is not known, so it goes on
/// at its velocity.
fn predictable(mut body: BodyRecord) -> BodyRecord {
    if body.traits.kind == BodyKind::KinematicPosition {
        Arc::make_mut(&mut body.traits).kind = BodyKind::KinematicVelocity;
    }
    body
}

/// Returns whether a predicted state is as told, within the tolerances.
fn is_like(state: &BodyState, told: &Motion, rests: bool) -> bool {
    let predicted = Motion::of(state);
    let speeds = predicted.velocity.linear.iter().zip(&told.velocity.linear);
    predicted.distance_m(told) < LIKE_M
        && predicted.turn_rad(told) < LIKE_RAD
        && (rests || speeds.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < LIKE_M_S)
}

/// Returns the state of a body as told. How it walks or is driven stays as predicted, since that is not told.
fn put_right(former: BodyState, told: &Motion, rests: bool, is_own: bool) -> BodyState {
    let gait = former.gait.map(|gait| match is_own {
        true => gait,
        // What others want is taken to be what they do.
        false => Gait { wanted: told.velocity.linear, ..gait },
    });
    let velocity = if rests { Default::default() } else { told.velocity };
    BodyState { pose: told.pose, velocity, sleeping: rests, still_s: 0.0, gait, ..former }
}
