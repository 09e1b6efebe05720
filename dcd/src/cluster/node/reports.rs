//! Chooses which of a member's bodies it reports to the leader: those that somebody looks at. So the leader
//! has nothing to do with all others, however many the group computes.

use std::collections::{BTreeMap, HashMap};

use super::Node;
use crate::cluster::Sampling;
use crate::cluster::coverage::Coverage;
use crate::protocol::{SharedState, Watch, WorldOp};
use crate::space::BodyId;

/// The state of a member's reports: what clients look at, and what the leader knows of this member's bodies.
/// It lasts as long as a view.
///
/// Wherever somebody looks, the leader has all bodies as the last reports had them, and none that has gone
/// from there since.
#[derive(Clone, Debug)]
pub(super) struct Reports {
    coverage: Coverage,
    /// The state that the leader was last told of each body. A body without an entry is reported wherever it
    /// is.
    told: HashMap<BodyId, SharedState>,
    /// The states of bodies that fell asleep where nobody looked, so that the leader does not have them so. Bodies
    /// that are awake are in the next sample, or gone.
    untold: BTreeMap<BodyId, SharedState>,
    /// Says whether the next report is to look through all bodies.
    looks_through: bool,
    /// Says whether somebody has begun to look at everything since the report before.
    all_begins: bool,
    /// The sample from which the report of the present tick is chosen, if there is a report.
    asked: Option<Sampling>,
}

impl Default for Reports {
    fn default() -> Self {
        Self {
            coverage: Coverage::of_reports(),
            told: HashMap::new(),
            untold: BTreeMap::new(),
            looks_through: false,
            all_begins: false,
            asked: None,
        }
    }
}

impl Reports {
    /// Has everything reported again: reports may be lost.
    pub(super) fn begin_anew(&mut self) {
        self.told.clear();
        self.untold.clear();
        self.looks_through = true;
    }

    /// Takes in what a tick's operations change for reports.
    fn learn(&mut self, ops: &[WorldOp]) {
        for op in ops {
            match op {
                WorldOp::Insert { bodies, .. } => bodies.iter().for_each(|body| self.forget(body.id)),
                WorldOp::Remove(id) => {
                    self.forget(*id);
                    self.coverage.forget(*id);
                }
                // A region that is handed over and back keeps the epochs of its bodies, and bodies that sleep
                // in it are in no sample.
                WorldOp::Repartition(_) => self.begin_anew(),
                WorldOp::Watch(watch) => self.watch(watch),
                _ => {}
            }
        }
    }

    fn forget(&mut self, id: BodyId) {
        self.told.remove(&id);
        self.untold.remove(&id);
    }

    fn watch(&mut self, watch: &Watch) {
        let was_all = self.coverage.is_all();
        watch.gone.iter().for_each(|&client| _ = self.coverage.leave(client));
        watch.areas.iter().for_each(|&(client, area)| _ = self.coverage.turn(client, area));
        watch.avatars.iter().for_each(|&(avatar, at)| _ = self.coverage.follow(avatar, at));
        self.all_begins |= self.coverage.is_all() && !was_all;
    }

    /// Returns the sample from which the report of the present tick is chosen. It is called once per exchange
    /// of the tick.
    fn sampling(&mut self) -> Sampling {
        let is_grown = self.all_begins || self.coverage.has_grown();
        // A body that has come to be looked at may be another member's by now.
        let comes =
            is_grown && self.untold.values().any(|state| self.is_due(state, self.told.get(&state.id)));
        let sampling = if self.looks_through || comes { Sampling::All } else { Sampling::Moved };
        self.asked = Some(sampling);
        sampling
    }

    /// Returns which states of a sample the leader is told at the end of the tick; all of them, if everything
    /// is reported `throughout` the view.
    fn choose(&mut self, sampled: Vec<SharedState>, throughout: bool) -> Vec<SharedState> {
        let Some(sampling) = self.asked.take() else {
            // The sample is all bodies, as with the first tick of a view, or none.
            self.told.extend(sampled.iter().map(|state| (state.id, *state)));
            return sampled;
        };
        self.all_begins = false;
        self.coverage.settle();
        if throughout || self.coverage.is_all() {
            self.looks_through &= sampling != Sampling::All;
            // The leader has every body as it is. Their states need not be kept for that.
            self.told.clear();
            self.untold.clear();
            return sampled;
        }
        let has = |id: &BodyId| sampled.binary_search_by_key(id, |state| state.id).is_ok();
        if sampling == Sampling::All {
            self.looks_through = false;
            self.told.retain(|id, _| has(id));
            self.untold.clear();
        }
        let mut due = Vec::new();
        for state in sampled {
            // Of a sample of moved bodies every due one is reported; of a sample of all, those that the
            // leader does not have so.
            let told = self.told.get(&state.id);
            let is_known = told == Some(&state);
            self.untold.remove(&state.id);
            match self.is_due(&state, told) {
                true if sampling == Sampling::Moved || !is_known => due.push(state),
                false if state.sleeping && !is_known => _ = self.untold.insert(state.id, state),
                _ => {}
            }
        }
        self.told.extend(due.iter().map(|state| (state.id, *state)));
        due
    }

    /// Returns whether the leader, which was `told` of a body, must be told of this state of it.
    fn is_due(&self, state: &SharedState, told: Option<&SharedState>) -> bool {
        // A body that has been another member's since may have been reported by that member.
        let Some(told) = told.filter(|told| told.epoch == state.epoch) else { return true };
        let is_seen = |state: &SharedState| self.coverage.covers(state.pose.translation);
        let is_watched = self.coverage.is_all() || state.id.client().is_some();
        // A body that is awake has moved, or stays where others would think that it has moved on.
        let is_new = !state.sleeping || told != state;
        is_new && (is_watched || is_seen(state) || is_seen(told))
    }
}

impl Node {
    /// Takes in what a tick's operations change for reports.
    pub(super) fn learn_watch(&mut self, ops: &[WorldOp]) {
        self.reports.learn(ops);
    }

    /// Returns the sample from which the report of a tick is chosen, given the sample that is due.
    pub(super) fn report_of(&mut self, due: Sampling) -> Sampling {
        match due {
            Sampling::Moved => self.reports.sampling(),
            due => due,
        }
    }

    /// Returns which states of a sample the leader is told. Participants are verified by what they report:
    /// they report everything, whoever looks.
    pub(super) fn reported(&mut self, sampled: Vec<SharedState>) -> Vec<SharedState> {
        let is_verified = self.config.client.is_some() && self.witness.verified().is_some();
        self.reports.choose(sampled, is_verified)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Area, Velocity, WorldPose};
    use crate::sim::Random;
    use crate::space::{ClientId, Epoch, RegionId};

    fn state(id: BodyId, epoch: Epoch, translation: [f64; 3], sleeping: bool) -> SharedState {
        let (owner, pose) = (RegionId(1), WorldPose::at(translation));
        SharedState { id, owner, epoch, pose, velocity: Velocity::default(), sleeping }
    }

    /// A member with its bodies, which samples them as a device does; `awake` lists those awake at the last
    /// report.
    #[derive(Default)]
    struct Device {
        reports: Reports,
        owned: BTreeMap<BodyId, SharedState>,
        awake: Vec<BodyId>,
    }

    impl Device {
        fn report(&mut self) -> Vec<SharedState> {
            let sampling = self.reports.sampling();
            let is_awake = |state: &&SharedState| !state.sleeping;
            let awake = self.owned.values().filter(is_awake).map(|state| state.id).collect();
            let before = std::mem::replace(&mut self.awake, awake);
            let is_sampled = |state: &&SharedState| {
                sampling == Sampling::All || !state.sleeping || before.contains(&state.id)
            };
            let sampled = self.owned.values().filter(is_sampled).copied().collect();
            self.reports.choose(sampled, false)
        }
    }

    /// Bodies move, jump, fall asleep, change owner and disappear, and interests change, at random. Two
    /// members report.
    #[test]
    fn the_leader_has_what_is_looked_at_as_it_is_and_hears_little_of_the_rest() {
        let (mut told, mut looked_through) = (0, 0);
        for seed in 0..300 {
            let mut random = Random::new(seed);
            let place = |random: &mut Random| [0; 3].map(|_| 1_000.0 * random.unit());
            let clients = [ClientId(1), ClientId(2)];
            let mut devices = [Device::default(), Device::default()];
            let mut leader: BTreeMap<BodyId, SharedState> = BTreeMap::new();
            let mut areas: BTreeMap<ClientId, Option<Area>> = BTreeMap::new();
            for at in 0..40 {
                let id = BodyId::persistent(at);
                let body = state(id, Epoch(0), place(&mut random), false);
                devices[at as usize % 2].owned.insert(id, body);
            }
            // With the first tick of a view everything is reported.
            for device in &mut devices {
                let all = device.owned.values().copied().collect();
                leader.extend(device.reports.choose(all, false).into_iter().map(|state| (state.id, state)));
            }
            for round in 1..60 {
                // A body of one member becomes the other's, or is removed.
                let from = random.below(2) as usize;
                let nth = random.below(20) as usize;
                let Some((&id, &(mut body))) = devices[from].owned.iter().nth(nth) else { continue };
                let mut ops = Vec::new();
                match random.below(6) {
                    0..2 => {
                        devices[from].owned.remove(&id);
                        body.epoch = Epoch(body.epoch.0 + 1);
                        devices[1 - from].owned.insert(id, body);
                        // A body that crosses a border is awake.
                        devices[1 - from].awake.push(id);
                    }
                    2 => {
                        ops.push(WorldOp::Remove(id));
                        leader.remove(&id);
                        devices[from].awake.push(id);
                    }
                    _ => {}
                }
                for device in &mut devices {
                    for body in device.owned.values_mut() {
                        let at = body.pose.translation;
                        body.sleeping = true;
                        body.pose.translation = match random.below(20) {
                            0 => place(&mut random),
                            1..8 => at.map(|at| at + 30.0 * (random.unit() - 0.5)),
                            _ => continue,
                        };
                        body.sleeping = random.below(2) == 0;
                        // A body that moves is awake for a while at least.
                        device.awake.push(body.id);
                    }
                }
                let client = clients[random.below(2) as usize];
                let mut watch = Watch::default();
                match random.below(10) {
                    0 => {
                        watch.gone.push(client);
                        areas.remove(&client);
                    }
                    1 if seed % 3 == 0 => {
                        watch.areas.push((client, None));
                        areas.insert(client, None);
                    }
                    2..6 => {
                        let area = Area { centre: place(&mut random), radius_m: 5.0 + 60.0 * random.unit() };
                        watch.areas.push((client, Some(area)));
                        areas.insert(client, Some(area));
                    }
                    _ => {}
                }
                ops.push(WorldOp::Watch(watch));
                let is_link_lost = random.below(20) == 0;
                for device in &mut devices {
                    device.reports.learn(&ops);
                    if is_link_lost {
                        device.reports.begin_anew();
                    }
                    // A tick may take several exchanges.
                    device.reports.sampling();
                    let report = device.report();
                    (told, looked_through) = (told + report.len(), looked_through + device.owned.len());
                    // A state that the other member has reported at a later epoch is newer.
                    let is_new = |state: &SharedState| {
                        leader.get(&state.id).is_none_or(|known| known.epoch <= state.epoch)
                    };
                    let report: Vec<_> = report.into_iter().filter(is_new).collect();
                    leader.extend(report.into_iter().map(|state| (state.id, state)));
                }
                for (&id, is) in devices.iter().flat_map(|device| &device.owned) {
                    let known = leader.get(&id).map(|state| state.pose.translation);
                    for area in areas.values() {
                        let near = |at: [f64; 3]| {
                            area.is_none_or(|area| Area { radius_m: area.radius_m + 4.0, ..area }.covers(at))
                        };
                        let is_at = is.pose.translation;
                        let is_right = known == Some(is_at);
                        let matters = near(is_at) || known.is_some_and(near);
                        assert!(
                            is_right || !matters,
                            "seed {seed}, {round}: {id} is at {is_at:?}, {known:?}"
                        );
                    }
                }
            }
        }
        assert!(told < looked_through / 4, "{told} of {looked_through}");
    }
}
