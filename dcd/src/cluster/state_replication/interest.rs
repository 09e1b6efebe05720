//! Selects the states that a client with an area of interest is sent (interest management): of bodies in its
//! area, and of other bodies where needed so that nothing that the client takes to be in its area is out of
//! date.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use super::news::{Change, Latest, News};
use super::places::Places;
use super::trails::{SILENT_S, Trails};
use crate::cluster::coverage::AROUND_M;
use crate::protocol::{Area, SharedState};
use crate::space::{BodyId, ClientId, Tick};

/// The seconds for which a body may have gone on at its velocity since the client's former teller last told
/// of it: what was on its way then may be lost.
const TURN_S: f64 = 3.0;

/// Returns the place on a straight way that is nearest to another place.
fn nearest(from: [f64; 3], way: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let apart = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let length = dot(way, way);
    let share = if length > 0.0 { (dot(apart, way) / length).clamp(0.0, 1.0) } else { 0.0 };
    [0, 1, 2].map(|axis| from[axis] + share * way[axis])
}

/// One client's area of interest, and which bodies it was sent.
#[derive(Clone, Debug)]
pub(super) struct Audience {
    client: ClientId,
    area: Area,
    /// The areas around own avatars that the area of interest does not cover.
    near: BTreeMap<BodyId, Area>,
    /// Bodies that are sent whenever they move.
    inside: BTreeSet<BodyId>,
    /// Bodies to be sent even if they rest.
    owed: BTreeSet<BodyId>,
    /// Bodies outside that have moved since the client was last told of them, each with the place that it was
    /// told. At most one entry per body.
    stale: BTreeMap<BodyId, [f64; 3]>,
    /// The same bodies, by the places that the client was told.
    stale_places: Places,
    /// Bodies outside of which the client was told since bodies last moved. If they move on, they are stale
    /// from then on.
    parted: BTreeSet<BodyId>,
    /// Says whether no moved bodies were looked through yet.
    is_new: bool,
}

impl Audience {
    /// Returns the audience of a client that was sent all these bodies, which are at these places, and has this area of
    /// interest from now on.
    pub(super) fn new(client: ClientId, area: Area, latest: &Latest, places: &Places) -> Self {
        let mut audience = Self {
            client,
            area,
            near: BTreeMap::new(),
            inside: BTreeSet::new(),
            owed: BTreeSet::new(),
            stale: BTreeMap::new(),
            stale_places: Places::default(),
            parted: BTreeSet::new(),
            is_new: true,
        };
        audience.settle(latest, places);
        audience
    }

    /// Returns the radius of the client's area of interest, metres.
    pub(super) fn radius_m(&self) -> f64 {
        self.area.radius_m
    }

    /// Changes the area of interest.
    pub(super) fn turn_to(&mut self, area: Area, latest: &Latest, places: &Places) {
        if area != self.area {
            self.area = area;
            self.settle(latest, places);
        }
    }

    /// Notes that another process may have told the client, in the seconds before `now` (a tick, and the
    /// seconds of one), of bodies that moved. The client is sent again those that may have left the area
    /// since: by where they are, by where they come from at their velocity, or by where their trails say they
    /// were.
    pub(super) fn begin_after(&mut self, now: (Tick, f64), latest: &Latest, trails: Option<&Trails>) {
        let (Tick(tick), dt) = now;
        let since = tick.saturating_sub((SILENT_S / dt) as u64);
        let widened = |area: &Area| Area { radius_m: area.radius_m + AROUND_M, ..*area };
        let areas: Vec<_> = self.near.values().chain([&self.area]).map(widened).collect();
        let may_have_left = |state: &SharedState| {
            let way_m = state.velocity.linear.map(|speed| -f64::from(speed) * TURN_S);
            areas.iter().any(|area| area.enters(nearest(state.pose.translation, way_m, area.centre)))
        };
        let left = latest.iter().filter(|(_, (state, tick))| tick.0 >= since && may_have_left(state));
        self.owed.extend(left.map(|(&id, _)| id));
        let gone_through = trails.map(|trails| trails.through(&areas, Tick(tick), dt)).unwrap_or_default();
        self.owed.extend(gone_through.into_iter().filter(|id| latest.contains_key(id)));
    }

    fn settle(&mut self, latest: &Latest, places: &Places) {
        for (&id, (state, _)) in latest.range(self.own()) {
            self.follow(id, state);
        }
        self.look(latest, places);
    }

    /// Returns the ids that the client's own avatars may have.
    fn own(&self) -> RangeInclusive<BodyId> {
        BodyId::avatar(self.client, 0)..=BodyId::avatar(self.client, u32::MAX)
    }

    /// Returns the bodies to send, in id order: those that moved in the area, and those that came into it or
    /// left it.
    pub(super) fn batch(&mut self, news: &News, latest: &Latest, places: &Places) -> BTreeSet<BodyId> {
        let moved = news.all();
        let from = moved.partition_point(|change| change.state.id < BodyId::avatar(self.client, 0));
        let client = self.client;
        let own = moved[from..].iter().take_while(|change| change.state.id.client() == Some(client));
        let mut strayed = false;
        for Change { state, .. } in own {
            strayed |= self.follow(state.id, state);
        }
        if strayed {
            self.look(latest, places);
        }
        let mut told = self.tell(news);
        told.append(&mut self.owed);
        if !moved.is_empty() {
            self.parted.clear();
        }
        self.parted.extend(told.difference(&self.inside));
        told
    }

    /// Notes what has become of bodies that moved, and returns those to be sent. It looks at the bodies that
    /// come into the area, and at those whose motion elsewhere matters: bodies that were inside, and bodies
    /// that may have to become stale. Nothing changes for all others, which moved the time before too and are
    /// outside.
    fn tell(&mut self, news: &News) -> BTreeSet<BodyId> {
        let mut told = BTreeSet::new();
        if news.all().is_empty() {
            return told;
        }
        if std::mem::take(&mut self.is_new) {
            news.all().iter().for_each(|change| self.notice(change, &mut told));
            return told;
        }
        let known = self.inside.iter().chain(&self.parted).chain(news.begun());
        let mut known: Vec<_> = known.copied().collect();
        known.sort_unstable();
        known.dedup();
        known.iter().filter_map(|id| news.of_body(*id)).for_each(|change| self.notice(change, &mut told));
        let areas: Vec<_> = self.near.values().chain([&self.area]).copied().collect();
        for area in areas {
            news.near(&area, |change| {
                if area.enters(change.state.pose.translation)
                    && known.binary_search(&change.state.id).is_err()
                {
                    self.notice(change, &mut told);
                }
            });
        }
        told
    }

    /// Notes what has become of a body that moved: whether it is to be sent, now or in the end, or is stale
    /// from now on.
    fn notice(&mut self, &Change { state, before }: &Change, told: &mut BTreeSet<BodyId>) {
        let id = state.id;
        let is_inside = self.inside.contains(&id);
        if self.reaches_to(&state, is_inside) {
            told.insert(id);
            self.inside.insert(id);
            self.put_right(id);
        } else if is_inside {
            self.inside.remove(&id);
            self.owed.insert(id);
        } else if !self.stale.contains_key(&id) && !self.owed.contains(&id) {
            match before {
                // The area has come to where the client has the body.
                Some(before) if self.spans(before) => drop(self.owed.insert(id)),
                Some(before) => {
                    self.stale_places.put(id, self.stale.insert(id, before), before);
                }
                // Nobody knows what an earlier leader sent.
                None => drop(told.insert(id)),
            }
        }
    }

    /// Returns whether a body in this state is sent.
    pub(super) fn reaches(&self, state: &SharedState) -> bool {
        self.reaches_to(state, self.inside.contains(&state.id))
    }

    fn reaches_to(&self, state: &SharedState, is_inside: bool) -> bool {
        let (id, at) = (state.id, state.pose.translation);
        let reach = |area: &Area| if is_inside { area.keeps(at) } else { area.enters(at) };
        id.client() == Some(self.client) || reach(&self.area) || self.near.values().any(reach)
    }

    /// Notes the place at which the client has now been told that a body is.
    pub(super) fn has_told(&mut self, state: &SharedState) {
        if let Some(at) = self.stale.get_mut(&state.id) {
            let before = std::mem::replace(at, state.pose.translation);
            self.stale_places.put(state.id, Some(before), *at);
        }
    }

    /// Notes that a body is not stale any more.
    fn put_right(&mut self, id: BodyId) {
        self.stale.remove(&id).into_iter().for_each(|at| self.stale_places.remove(id, at));
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        self.near.remove(&id);
        self.inside.remove(&id);
        self.owed.remove(&id);
        self.put_right(id);
        self.parted.remove(&id);
    }

    /// Moves the area around one of the client's own avatars. Returns whether all bodies must be looked at
    /// because of that.
    fn follow(&mut self, id: BodyId, state: &SharedState) -> bool {
        let around = Area::around_avatar(state.pose.translation);
        if self.area.contains(&around) {
            return self.near.remove(&id).is_some();
        }
        if self.near.get(&id).is_some_and(|known| known.stands_for(&around)) {
            return false;
        }
        self.near.insert(id, around);
        true
    }

    /// Looks at what was inside, and at what is where the area may be, after the area has changed. It marks as owed the
    /// bodies that come in, those that go, so that the client knows, and those that the client has in the area although
    /// they have moved on unseen.
    fn look(&mut self, latest: &Latest, places: &Places) {
        let areas: Vec<_> = self.near.values().chain([&self.area]).copied().collect();
        let own = latest.range(self.own()).map(|(&id, _)| id);
        let near = areas.iter().flat_map(|area| places.near(area));
        let mut looked_at: Vec<_> = self.inside.iter().copied().chain(own).chain(near).collect();
        looked_at.sort_unstable();
        looked_at.dedup();
        for id in looked_at {
            let Some((state, _)) = latest.get(&id) else { continue };
            let is_inside = self.reaches(state);
            if is_inside {
                self.put_right(id);
            }
            if is_inside != self.inside.contains(&id) {
                self.owed.insert(id);
                match is_inside {
                    true => drop(self.inside.insert(id)),
                    false => drop(self.inside.remove(&id)),
                }
            }
        }
        for id in areas.iter().flat_map(|area| self.stale_places.near(area)).collect::<Vec<_>>() {
            if self.stale.get(&id).is_some_and(|at| self.spans(*at)) {
                self.put_right(id);
                self.owed.insert(id);
            }
        }
    }

    /// Returns whether a body that comes to this place is sent.
    fn spans(&self, at: [f64; 3]) -> bool {
        self.area.enters(at) || self.near.values().any(|area| area.enters(at))
    }
}

#[cfg(test)]
mod tests {
    use super::super::news::Moved;
    use super::*;
    use crate::protocol::{Velocity, WorldPose};
    use crate::sim::Random;
    use crate::space::{Epoch, RegionId};

    const CLIENT: ClientId = ClientId(4);
    const AVATAR: BodyId = BodyId::avatar(CLIENT, 0);
    const STONE: BodyId = BodyId::persistent(1);

    /// A leader's states, one client with an interest, and where that client has each body.
    struct Stage {
        latest: Latest,
        moved: Moved,
        former: Vec<BodyId>,
        places: Places,
        audience: Audience,
        believed: BTreeMap<BodyId, [f64; 3]>,
    }

    fn area(x: f64, radius_m: f64) -> Area {
        Area { centre: [x, 0.0, 0.0], radius_m }
    }

    fn state(id: BodyId, x: f64) -> SharedState {
        let pose = WorldPose::at([x, 0.0, 0.0]);
        SharedState {
            id,
            owner: RegionId(1),
            epoch: Epoch(0),
            pose,
            velocity: Velocity::default(),
            sleeping: false,
        }
    }

    impl Stage {
        /// Returns a stage on which everything was sent, also what is owed at first.
        fn new(bodies: &[(BodyId, f64)], area: Area) -> Self {
            let latest: Latest = bodies.iter().map(|&(id, x)| (id, (state(id, x), Tick(0)))).collect();
            let believed = latest.iter().map(|(&id, (state, _))| (id, state.pose.translation)).collect();
            let places = bodies.iter().map(|&(id, x)| (id, [x, 0.0, 0.0])).collect();
            let audience = Audience::new(CLIENT, area, &latest, &places);
            let mut stage =
                Self { latest, moved: Moved::new(), former: Vec::new(), places, audience, believed };
            stage.tell();
            stage
        }

        fn put(&mut self, id: BodyId, x: f64) {
            let before = self.latest.insert(id, (state(id, x), Tick(0)));
            let before = before.map(|(state, _)| state.pose.translation);
            self.places.put(id, before, [x, 0.0, 0.0]);
            self.moved.entry(id).or_insert(before);
        }

        fn turn_to(&mut self, area: Area) {
            self.audience.turn_to(area, &self.latest, &self.places);
        }

        /// Returns the bodies that the client is sent at the end of a tick.
        fn tell(&mut self) -> Vec<BodyId> {
            let moved = std::mem::take(&mut self.moved);
            let news = News::of(&moved, &self.former, &self.latest, self.audience.radius_m());
            let told = self.audience.batch(&news, &self.latest, &self.places);
            if !moved.is_empty() {
                self.former = moved.into_keys().collect();
            }
            let at = |id: &BodyId| (*id, self.latest[id].0.pose.translation);
            self.believed.extend(told.iter().map(at));
            told.into_iter().collect()
        }
    }

    #[test]
    fn what_moves_in_the_area_is_told_and_what_moves_elsewhere_is_not() {
        let other = BodyId::persistent(2);
        let mut stage = Stage::new(&[(STONE, 0.0), (other, 50.0)], area(0.0, 10.0));
        assert_eq!(stage.tell(), [], "nothing moves");
        stage.put(STONE, 1.0);
        stage.put(other, 51.0);
        assert_eq!(stage.tell(), [STONE]);
    }

    #[test]
    fn what_leaves_is_told_where_it_went_and_then_no_more() {
        let mut stage = Stage::new(&[(STONE, 0.0)], area(0.0, 10.0));
        stage.put(STONE, 100.0);
        assert_eq!(stage.tell(), [STONE]);
        stage.put(STONE, 200.0);
        assert_eq!(stage.tell(), []);
    }

    #[test]
    fn what_goes_to_and_fro_at_the_edge_is_told_as_what_moves_inside() {
        let mut stage = Stage::new(&[(STONE, 0.0)], area(0.0, 10.0));
        for x in [10.9, 11.4, 10.9, 11.4] {
            stage.put(STONE, x);
            assert_eq!(stage.tell(), [STONE]);
            assert!(stage.audience.owed.is_empty(), "no last words");
        }
    }

    #[test]
    fn what_came_to_rest_unseen_is_told_when_the_area_comes_over_it() {
        let mut stage = Stage::new(&[(STONE, 50.0)], area(0.0, 10.0));
        stage.put(STONE, 60.0);
        assert_eq!(stage.tell(), []);
        stage.turn_to(area(55.0, 10.0));
        assert_eq!(stage.tell(), [STONE]);
        assert_eq!(stage.believed[&STONE][0], 60.0);
    }

    #[test]
    fn what_is_believed_where_the_area_comes_and_is_not_there_any_more_is_told() {
        let mut stage = Stage::new(&[(STONE, 50.0)], area(0.0, 10.0));
        stage.put(STONE, 90.0);
        stage.tell();
        stage.put(STONE, 95.0);
        stage.tell();
        stage.turn_to(area(50.0, 10.0));
        assert_eq!(stage.tell(), [STONE]);
        assert_eq!(stage.believed[&STONE][0], 95.0);
    }

    #[test]
    fn a_body_first_heard_of_is_told_once_wherever_it_is() {
        let mut stage = Stage::new(&[], area(0.0, 10.0));
        stage.put(STONE, 50.0);
        assert_eq!(stage.tell(), [STONE], "the leader before may have told otherwise");
        stage.put(STONE, 51.0);
        assert_eq!(stage.tell(), []);
    }

    #[test]
    fn an_avatar_of_its_own_is_always_told_and_so_is_what_is_near_it() {
        let other = BodyId::avatar(ClientId(5), 0);
        let bodies = [(AVATAR, 100.0), (other, 130.0), (STONE, 120.0)];
        let mut stage = Stage::new(&bodies, area(0.0, 10.0));
        stage.put(other, 131.0);
        stage.put(STONE, 121.0);
        assert_eq!(stage.tell(), []);
        // The avatar comes to the stone, which rests by now.
        stage.put(AVATAR, 115.0);
        assert_eq!(stage.tell(), [STONE, AVATAR]);
        assert_eq!(stage.believed[&STONE][0], 121.0);
    }

    /// Bodies, avatars and areas move and jump at random. Whatever is in the area, or the client has there,
    /// the client has where it is. The leader keeps no more than an entry per body.
    #[test]
    fn what_a_client_believes_of_its_area_is_so_whatever_moves() {
        for seed in 0..300 {
            let mut random = Random::new(seed);
            let anywhere = |random: &mut Random| 200.0 * random.unit();
            let ids: Vec<_> = (0..30).map(BodyId::persistent).chain([AVATAR]).collect();
            let bodies: Vec<_> = ids.iter().map(|&id| (id, anywhere(&mut random))).collect();
            let mut here = area(anywhere(&mut random), 5.0 + 20.0 * random.unit());
            let mut stage = Stage::new(&bodies, here);
            for _ in 0..60 {
                for &id in ids.iter().filter(|_| random.below(3) == 0).collect::<Vec<_>>() {
                    let step = if random.below(8) == 0 { anywhere(&mut random) } else { random.unit() - 0.5 };
                    let x = (stage.latest[&id].0.pose.translation[0] + step) % 200.0;
                    stage.put(id, x);
                }
                if random.below(4) == 0 {
                    here = match random.below(2) {
                        0 => area(anywhere(&mut random), here.radius_m),
                        _ => Area { centre: [here.centre[0] + 3.0, 0.0, 0.0], ..here },
                    };
                    stage.turn_to(here);
                }
                stage.tell();
                // Members report of every third tick only.
                if random.below(2) == 0 {
                    stage.tell();
                }
                let avatar = stage.latest[&AVATAR].0.pose.translation;
                let near = Area::around_avatar(avatar);
                for (id, (state, _)) in &stage.latest {
                    let (is, believed) = (state.pose.translation, stage.believed[id]);
                    let matters = |at| here.covers(at) || near.covers(at);
                    if *id == AVATAR || matters(is) || matters(believed) {
                        assert_eq!(is, believed, "seed {seed}: {id}");
                    }
                }
                assert!(stage.audience.stale.len() <= ids.len());
            }
        }
    }
}
