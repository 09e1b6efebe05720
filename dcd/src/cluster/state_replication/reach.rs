//! Knows of which part of the world the clients of a relay are told, so that the relay is told of no other.

use std::collections::{BTreeMap, BTreeSet};

use super::news::Latest;
use crate::cluster::coverage::Coverage;
use crate::protocol::{Area, SharedState};
use crate::space::{BodyId, ClientId, Epoch, Tick};

/// The version of a body's state.
type Version = (Epoch, Tick);

/// The part of the world of which a relay is told.
#[derive(Clone, Debug)]
pub(super) struct Reach {
    coverage: Coverage,
    clients: BTreeSet<ClientId>,
    /// Says whether that was everything the last time.
    was_all: bool,
    /// The place where the relay has each body, and the version of that state.
    told: BTreeMap<BodyId, ([f64; 3], Version)>,
}

impl Reach {
    pub(super) fn new() -> Self {
        Self {
            coverage: Coverage::of_relay(),
            clients: BTreeSet::new(),
            was_all: false,
            told: BTreeMap::new(),
        }
    }

    /// Notes a client's area of interest; `None` is everything.
    pub(super) fn turn(&mut self, client: ClientId, area: Option<Area>) {
        self.clients.insert(client);
        self.coverage.turn(client, area);
    }

    pub(super) fn leave(&mut self, client: ClientId) {
        self.clients.remove(&client);
        self.coverage.leave(client);
    }

    pub(super) fn forget(&mut self, id: BodyId) -> bool {
        self.coverage.forget(id);
        self.told.remove(&id).is_some()
    }

    /// Returns the bodies of which the relay is told: the moved ones that are in its part of the world, or
    /// were, and all that are where that part has grown, except those that it has as they are.
    pub(super) fn choose(
        &mut self,
        moved: impl Iterator<Item = BodyId>,
        latest: &Latest,
    ) -> BTreeSet<BodyId> {
        self.follow_avatars(latest);
        let is_all = self.coverage.is_all();
        let begins = is_all && !std::mem::replace(&mut self.was_all, is_all);
        self.was_all = is_all;
        let mut chosen: BTreeSet<BodyId> = match is_all {
            true => moved.collect(),
            false => {
                moved.filter(|id| latest.get(id).is_some_and(|(state, _)| self.reaches(state))).collect()
            }
        };
        if begins || !is_all && self.coverage.has_grown() {
            let comes = |(id, (state, tick)): &(&BodyId, &(SharedState, Tick))| {
                let told = self.told.get(id);
                let is_known = told.is_some_and(|(_, version)| *version == (state.epoch, *tick));
                let is_new = |at| self.coverage.is_new(at);
                let has_come = || is_new(state.pose.translation) || told.is_some_and(|(at, _)| is_new(*at));
                !is_known && (begins || has_come())
            };
            chosen.extend(latest.iter().filter(comes).map(|(&id, _)| id));
        }
        self.coverage.settle();
        let place = |(state, tick): &(SharedState, Tick)| (state.pose.translation, (state.epoch, *tick));
        let places = chosen.iter().filter_map(|id| Some((*id, place(latest.get(id)?))));
        self.told.extend(places);
        chosen
    }

    /// Returns whether the relay is told of a body in this state.
    pub(super) fn hears_of(&self, state: &SharedState) -> bool {
        self.coverage.is_all() || self.reaches(state)
    }

    fn reaches(&self, state: &SharedState) -> bool {
        let is_own = state.id.client().is_some_and(|client| self.clients.contains(&client));
        let is_in = |at| self.coverage.covers(at);
        is_own || is_in(state.pose.translation) || self.told.get(&state.id).is_some_and(|(at, _)| is_in(*at))
    }

    fn follow_avatars(&mut self, latest: &Latest) {
        for client in self.coverage.with_areas().collect::<Vec<_>>() {
            let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
            for (_, (state, _)) in latest.range(own) {
                self.coverage.follow(state.id, self.coverage.cell_of(state));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Velocity, WorldPose};
    use crate::sim::Random;
    use crate::space::RegionId;

    fn state(id: BodyId, translation: [f64; 3]) -> SharedState {
        let (owner, epoch, pose) = (RegionId(1), Epoch(0), WorldPose::at(translation));
        SharedState { id, owner, epoch, pose, velocity: Velocity::default(), sleeping: false }
    }

    /// Bodies, avatars and interests move and jump at random. The relay has every body where it is that is
    /// near a client, or that the relay has there.
    #[test]
    fn what_a_relay_has_near_its_clients_is_so_whatever_moves() {
        let mut left_out = 0;
        for seed in 0..200 {
            let mut random = Random::new(seed);
            let place = |random: &mut Random| [0; 3].map(|_| 1_000.0 * random.unit());
            let [one, other] = [ClientId(1), ClientId(2)];
            let avatar = BodyId::avatar(one, 0);
            let ids: Vec<_> = (0..40).map(BodyId::persistent).chain([avatar]).collect();
            let mut latest: Latest =
                ids.iter().map(|&id| (id, (state(id, place(&mut random)), Tick(0)))).collect();
            let (mut reach, mut areas, mut known) = (Reach::new(), BTreeMap::new(), BTreeMap::new());
            for tick in 1..=80 {
                let mut moved = BTreeSet::new();
                for &id in &ids {
                    let at = latest[&id].0.pose.translation;
                    let to = match random.below(12) {
                        0 => place(&mut random),
                        1..5 => at.map(|at| at + 30.0 * (random.unit() - 0.5)),
                        _ => continue,
                    };
                    latest.insert(id, (state(id, to), Tick(tick)));
                    moved.insert(id);
                }
                let client = if random.below(2) == 0 { one } else { other };
                match random.below(8) {
                    0 => {
                        reach.leave(client);
                        areas.remove(&client);
                    }
                    1 => {
                        reach.turn(client, None);
                        areas.insert(client, None);
                    }
                    2..5 => {
                        let area = Area { centre: place(&mut random), radius_m: 5.0 + 60.0 * random.unit() };
                        reach.turn(client, Some(area));
                        areas.insert(client, Some(area));
                    }
                    _ => {}
                }
                let told = reach.choose(moved.iter().copied(), &latest);
                left_out += moved.difference(&told).count();
                known.extend(told.into_iter().map(|id| (id, latest[&id].0.pose.translation)));
                for (&client, area) in &areas {
                    let around = Area::around_avatar(latest[&avatar].0.pose.translation);
                    let near = |at| match area {
                        None => true,
                        Some(area) => area.enters(at) || client == one && around.enters(at),
                    };
                    for (id, (state, _)) in &latest {
                        let (is, known) = (state.pose.translation, known.get(id));
                        let matters =
                            near(is) || known.is_some_and(|&at| near(at)) || id.client() == Some(client);
                        assert!(!matters || known == Some(&is), "seed {seed}: {id} is at {is:?}, {known:?}");
                    }
                }
            }
            areas.keys().for_each(|client| reach.leave(*client));
            assert!(reach.coverage.is_empty(), "seed {seed}");
        }
        assert!(left_out > 1_000, "what is far from all clients is not told: {left_out}");
    }

    /// An area moves on by half of its margin, over and over. A body at rest is told once.
    #[test]
    fn a_step_of_an_interest_tells_of_what_is_new_there_alone() {
        let [one, other] = [ClientId(1), ClientId(2)];
        let places = (0..200).map(|at| (BodyId::persistent(at), [2.0 * f64::from(at), 0.0, 0.0]));
        let avatars = [(BodyId::avatar(one, 0), [0.0; 3]), (BodyId::avatar(other, 0), [900.0, 0.0, 0.0])];
        let mut latest: Latest =
            places.chain(avatars).map(|(id, at)| (id, (state(id, at), Tick(0)))).collect();
        let mut reach = Reach::new();
        let mut told = BTreeSet::new();
        for step in 0..200_u32 {
            let at = 0.6 * f64::from(step);
            reach.turn(one, Some(Area { centre: [at, 0.0, 0.0], radius_m: 12.0 }));
            // Its avatar moves along, and back over the border of a cell now and then.
            let avatar = BodyId::avatar(one, 0);
            let to = [at - f64::from(step % 7), 0.0, 0.0];
            latest.insert(avatar, (state(avatar, to), Tick(u64::from(step))));
            for id in reach.choose([avatar].into_iter(), &latest) {
                assert!(told.insert(id) || id == avatar, "{id} is told again at step {step}");
            }
        }
        assert!((80..190).contains(&told.len()), "{} are told", told.len());
    }
}
