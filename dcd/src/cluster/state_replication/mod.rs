//! Sends clients the states of bodies (state replication): which bodies each client is sent, when, and in
//! which bytes.
//!
//! It belongs to a leader, or to a relay in its place, and begins and ends with it, but no tick waits for it:
//! it is given each tick when that is complete ([`ReplicationEvent`]). So a process may run it on a thread of
//! its own. That thread may fall behind: of several ticks that it has not taken in yet only the newest states
//! count ([`TickNews::absorb`]).

mod channel;
mod fed;
mod feed;
mod interest;
mod news;
mod place;
mod places;
mod reach;
#[cfg(test)]
mod tests;
mod tick;
mod trails;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use self::channel::{Batches, Channel};
use self::fed::Fed;
use self::feed::Feed;
use self::interest::Audience;
pub(super) use self::news::Latest;
use self::news::{Moved, News};
pub(super) use self::place::Replication;
use self::places::Places;
pub use self::tick::TickNews;
use self::trails::Trails;
use super::Peer;
use crate::delta::{FreeMotion, RESTARTS};
use crate::protocol::{
    Area, EnvironmentProperties, Heard, Member, Message, SharedState, Stamp, ToClient, ToRelay, View,
    ViewNumber,
};
use crate::space::{Allocation, BodyId, ClientId, GroupId, NodeId, Tick};

/// The fewest ticks after which clients and the server hear that time goes on though nothing moves (a
/// heartbeat).
pub(in crate::cluster) const TELL_TICK: u64 = 30;

/// The number of heartbeats to a client that come this early after states, since some may be lost.
const FIRST_BEATS: u32 = 3;

/// The time between later heartbeats in a world that keeps the pace of its clock.
const REST: Duration = Duration::from_secs(5);

/// How far that pace may be missed between two heartbeats before one is sent: a client that shows the world
/// reckons with the pace.
const PACE_MISSED: Duration = Duration::from_millis(250);

/// The most turns of a client in a view. A client is told by its leader, by a relay, and by the leader again.
/// Each turn has series of its own, so that everything on its way from an earlier turn is older than all of a
/// later one.
pub(in crate::cluster) const MAX_TURNS: u32 = 64;

/// The tick of which a client was last told.
#[derive(Clone, Copy, Debug)]
struct Told {
    tick: Tick,
    opened: Duration,
    /// The number of heartbeats since the last states.
    beats: u32,
}

/// The most states that are coded for all clients together in the ticks of a second, at 1.1 to 1.5 µs each
/// with everything around it. Where the same thread computes the world, ticks that take all of their time
/// take about a fifth longer.
const STATES_PER_S: f64 = 140_000.0;

/// The same on a thread of its own: two thirds of a core at most.
const STATES_PER_S_ELSEWHERE: f64 = 420_000.0;

/// The number of bodies that are compared by urgency in the time that coding one state takes.
const COMPARED_PER_STATE: usize = 4;

/// An event for the state replication.
#[derive(Clone, Debug)]
pub enum ReplicationEvent {
    /// A leader or a relay begins, and its replication with it. The former replication ends.
    Begin(Box<StateReplication>),
    /// A client is to be told from now on. What it was told before counts no more.
    Admit {
        /// The client.
        client: ClientId,
        /// The number of its turn.
        turn: u32,
        /// Says whether another process has told it until now, which cannot be asked what it told.
        told_elsewhere: bool,
        /// Its area of interest, if it has named one; `None` in it is everything.
        area: Option<Option<Area>>,
    },
    /// A client is told by a relay from now on.
    Relay {
        /// The client.
        client: ClientId,
        /// The member that is its relay.
        node: NodeId,
        /// The number of its turn.
        turn: u32,
        /// Its area of interest; `None` is everything.
        area: Option<Area>,
    },
    /// A client's link is gone.
    Dismiss(ClientId),
    /// A client has acknowledged states.
    Heard {
        /// The client.
        client: ClientId,
        /// What it has acknowledged.
        heard: Heard,
        /// The newest tick at that time.
        now: Tick,
    },
    /// A tick is complete.
    Tick(TickNews),
    /// The leader has sent a message to this process, its relay.
    ByLeader(ToRelay),
    /// A relay has read what it was sent, up to the message of this number.
    Fed {
        /// The relay.
        node: NodeId,
        /// The number.
        number: u64,
    },
    /// States of a tick that was computed without the other nodes. Later ones may contradict them.
    Speculative {
        /// The tick.
        tick: Tick,
        /// The states of bodies after it.
        states: Vec<SharedState>,
        /// The members that are waited for. They are sent no speculative states.
        silent: BTreeSet<NodeId>,
    },
    /// This process leads, or relays, no more.
    End,
}

/// The state replication of a leader or a relay.
#[derive(Clone, Debug)]
pub struct StateReplication {
    group: GroupId,
    view: ViewNumber,
    dt: Duration,
    motion: FreeMotion,
    /// The leader, as clients are told of it.
    introduction: Option<Member>,
    allocation: Allocation,
    /// The newest tick, and the time at which it was due, by which clients count time.
    tick: Tick,
    opened: Duration,
    is_last: bool,
    latest: Latest,
    clients: BTreeMap<ClientId, Peer>,
    /// The number of each client's turn in this view.
    turns: BTreeMap<ClientId, u32>,
    /// Clients that another process told until they came here, as long as they have not named an interest.
    told_elsewhere: BTreeSet<ClientId>,
    /// Clients that relays tell, and what each relay is told.
    relayed: BTreeMap<ClientId, NodeId>,
    feeds: BTreeMap<NodeId, Feed>,
    /// The number of the last message to any relay.
    told_relays: u64,
    /// What this process has been told as a relay.
    fed: Fed,
    /// Clients that have not named an interest yet. They are sent no states.
    undecided: BTreeSet<ClientId>,
    /// The logical time of each client's newest applied input, and how many ticks early it came.
    applied: BTreeMap<ClientId, (u64, i8)>,
    /// The tick of which each client was last told.
    told: BTreeMap<ClientId, Told>,
    /// The channels to clients in other processes.
    channels: BTreeMap<ClientId, Channel>,
    /// The most states that are coded per second of ticks, and the number that were coded beyond that so far.
    states_per_s: f64,
    coded_beyond: usize,
    /// The bodies that moved lately, and those that moved last, in id order.
    batches: Batches,
    moved_last: Vec<BodyId>,
    /// The places where fast bodies have been, since the first client was given to a relay.
    trails: Option<Trails>,
    /// The audiences of clients that have an area of interest.
    audiences: BTreeMap<ClientId, Audience>,
    /// The places of all bodies, while there are audiences.
    places: Places,
    messages: Vec<(ClientId, ToClient)>,
    member_messages: Vec<(NodeId, Message)>,
}

impl StateReplication {
    /// Returns the replication of the leader of this view, which knows no body yet.
    pub(super) fn new(
        now: Duration,
        view: &View,
        world: &EnvironmentProperties,
        clients: &BTreeMap<ClientId, Peer>,
    ) -> Self {
        let motion = FreeMotion::of(&world.step);
        Self {
            group: view.group,
            view: view.number,
            dt: Duration::from_secs_f32(world.step.dt_s),
            motion,
            introduction: view.led_by().cloned(),
            allocation: view.allocation.clone(),
            tick: view.tick,
            opened: now,
            is_last: false,
            latest: Latest::new(),
            undecided: clients.keys().copied().collect(),
            clients: clients.clone(),
            turns: BTreeMap::new(),
            told_elsewhere: BTreeSet::new(),
            relayed: BTreeMap::new(),
            feeds: BTreeMap::new(),
            told_relays: 0,
            fed: Fed::new(motion),
            applied: BTreeMap::new(),
            told: BTreeMap::new(),
            channels: BTreeMap::new(),
            states_per_s: STATES_PER_S,
            coded_beyond: 0,
            batches: Batches::default(),
            moved_last: Vec::new(),
            trails: None,
            audiences: BTreeMap::new(),
            places: Places::default(),
            messages: Vec::new(),
            member_messages: Vec::new(),
        }
    }

    /// Returns the replication as it is on a thread of its own, which may code more if there is a core for
    /// it.
    pub(super) fn with_own_thread(self) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let states_per_s = if cores > 1 { STATES_PER_S_ELSEWHERE } else { STATES_PER_S };
        Self { states_per_s, ..self }
    }

    /// Takes an event in. [`StateReplication::take_messages`] returns what follows from it.
    pub fn handle(&mut self, event: ReplicationEvent) {
        match event {
            ReplicationEvent::Begin(new) => *self = *new,
            ReplicationEvent::Admit { client, turn, told_elsewhere, area } => {
                self.admit(client, turn, told_elsewhere);
                self.turn_audiences(area.map(|area| (client, area)));
            }
            ReplicationEvent::Relay { client, node, turn, area } => {
                self.dismiss(client);
                self.relayed.insert(client, node);
                self.trails.get_or_insert_default();
                let feed = self.feeds.entry(node).or_insert_with(|| Feed::new(self.motion));
                feed.admit(client, turn, area);
            }
            ReplicationEvent::Dismiss(client) => self.dismiss(client),
            ReplicationEvent::Heard { client, heard, now } => {
                if let Some(channel) = self.channels.get_mut(&client) {
                    channel.hear(now, &heard);
                }
            }
            ReplicationEvent::Tick(news) => self.take_in(news),
            ReplicationEvent::Speculative { tick, states, silent } => {
                for (&node, feed) in self.feeds.iter_mut().filter(|(node, _)| !silent.contains(node)) {
                    let guess = feed.guess(self.view, &mut self.told_relays, tick, &states);
                    self.member_messages.extend(guess.map(|guess| (node, Message::Relay(guess))));
                }
                self.tell_speculative(tick, &states);
            }
            ReplicationEvent::ByLeader(message) => {
                self.read(message).into_iter().for_each(|event| self.handle(event));
            }
            ReplicationEvent::Fed { node, number } => {
                self.feeds.get_mut(&node).into_iter().for_each(|feed| feed.has_arrived(number));
            }
            ReplicationEvent::End => {
                self.clients.clear();
                self.feeds.clear();
            }
        }
    }

    /// Returns the messages for clients since the last call.
    pub fn take_messages(&mut self) -> Vec<(ClientId, ToClient)> {
        std::mem::take(&mut self.messages)
    }

    /// Returns the messages for other members since the last call: for relays, and for the leader whose relay
    /// this is.
    pub fn take_member_messages(&mut self) -> Vec<(NodeId, Message)> {
        self.acknowledge_feed();
        std::mem::take(&mut self.member_messages)
    }

    /// Returns the link over which a client is reached.
    pub fn route(&self, client: ClientId) -> Option<Peer> {
        self.clients.get(&client).copied()
    }

    /// Notes how many bytes for a client wait for its link.
    pub fn hear_backlog(&mut self, client: ClientId, bytes: usize) {
        if let Some(channel) = self.channels.get_mut(&client) {
            channel.adapt(bytes);
        }
    }

    /// Admits a client that is linked directly. The client then says what it wants to hear of.
    fn admit(&mut self, client: ClientId, turn: u32, told_elsewhere: bool) {
        self.leave_relay(client);
        self.turns.insert(client, turn);
        self.told_elsewhere.remove(&client);
        self.told_elsewhere.extend(told_elsewhere.then_some(client));
        self.clients.insert(client, Peer::Client(client));
        self.channels.remove(&client);
        self.audiences.remove(&client);
        self.undecided.insert(client);
    }

    fn leave_relay(&mut self, client: ClientId) {
        let feed = self.relayed.remove(&client).and_then(|node| self.feeds.get_mut(&node));
        feed.into_iter().for_each(|feed| feed.dismiss(client));
    }

    fn dismiss(&mut self, client: ClientId) {
        self.leave_relay(client);
        self.clients.remove(&client);
        self.turns.remove(&client);
        self.told_elsewhere.remove(&client);
        self.told.remove(&client);
        self.applied.remove(&client);
        self.channels.remove(&client);
        self.undecided.remove(&client);
        self.audiences.remove(&client);
    }

    fn take_in(&mut self, news: TickNews) {
        let relayed = self.tell_relayed(&news);
        let last = self.tick;
        (self.tick, self.opened, self.is_last) = (news.tick, news.opened, news.is_last);
        self.allocation = news.allocation.unwrap_or(std::mem::take(&mut self.allocation));
        self.applied.extend(news.applied.into_iter().filter(|(client, _)| self.clients.contains_key(client)));
        for id in news.gone {
            self.forget(id);
        }
        let mut moved = Moved::new();
        for (id, (state, tick)) in news.moved {
            let before = self.latest.insert(id, (state, tick));
            if !self.audiences.is_empty() {
                let before = before.map(|(before, _)| before.pose.translation);
                self.places.put(id, before, state.pose.translation);
            }
            if let (Some(trails), Some((before, _))) = (&mut self.trails, &before) {
                let places = (before.pose.translation, state.pose.translation);
                trails.add((last, self.tick), self.dt.as_secs_f64(), id, places);
            }
            moved.insert(id, before.map(|(before, _)| before.pose.translation));
        }
        if let Some(tick) = relayed {
            self.tell_relays(&tick, &moved);
        }
        self.turn_audiences(news.interests);
        self.forward_states(moved);
    }

    /// Notes what relays are to be told of their clients. Returns what each is told of the tick besides, if
    /// there are any relays.
    fn tell_relayed(&mut self, news: &TickNews) -> Option<TickNews> {
        if self.feeds.is_empty() {
            return None;
        }
        let Self { relayed, feeds, .. } = self;
        for (&client, &area) in &news.interests {
            let feed = relayed.get(&client).and_then(|node| feeds.get_mut(node));
            feed.into_iter().for_each(|feed| feed.interested(client, area));
        }
        for (&client, &newest) in &news.applied {
            let feed = relayed.get(&client).and_then(|node| feeds.get_mut(node));
            feed.into_iter().for_each(|feed| feed.has_applied(client, newest));
        }
        let (gone, allocation) = (news.gone.clone(), news.allocation.clone());
        Some(TickNews {
            tick: news.tick,
            opened: news.opened,
            is_last: news.is_last,
            gone,
            allocation,
            ..TickNews::default()
        })
    }

    fn tell_relays(&mut self, tick: &TickNews, moved: &Moved) {
        for (&node, feed) in &mut self.feeds {
            let told = feed.tell(self.view, &mut self.told_relays, tick, moved.keys().copied(), &self.latest);
            self.member_messages.extend(told.into_iter().map(|message| (node, Message::Relay(message))));
        }
        self.feeds.retain(|_, feed| !feed.is_over());
    }

    fn forget(&mut self, id: BodyId) {
        if let Some((state, _)) = self.latest.remove(&id)
            && !self.audiences.is_empty()
        {
            self.places.remove(id, state.pose.translation);
        }
        if let Ok(place) = self.moved_last.binary_search(&id) {
            self.moved_last.remove(place);
        }
        self.audiences.values_mut().for_each(|audience| audience.forget(id));
        self.channels.values_mut().for_each(|channel| channel.forget(id));
    }

    fn turn_audiences(&mut self, interests: impl IntoIterator<Item = (ClientId, Option<Area>)>) {
        for (client, area) in interests {
            // A client whose link is gone names its interest again over the next link.
            if !self.clients.contains_key(&client) {
                continue;
            }
            let is_first = self.undecided.remove(&client);
            let told_elsewhere = self.told_elsewhere.remove(&client);
            match (self.audiences.get_mut(&client), area) {
                (Some(audience), Some(area)) => audience.turn_to(area, &self.latest, &self.places),
                (None, Some(area)) => {
                    if let Some(channel) = self.channels.get_mut(&client) {
                        channel.catch_up(&self.batches, || self.latest.keys().copied());
                    }
                    if self.audiences.is_empty() {
                        let all = self.latest.iter().map(|(&id, (state, _))| (id, state.pose.translation));
                        self.places = all.collect();
                    }
                    let mut audience = Audience::new(client, area, &self.latest, &self.places);
                    if told_elsewhere {
                        let now = (self.tick, self.dt.as_secs_f64());
                        audience.begin_after(now, &self.latest, self.trails.as_ref());
                    }
                    self.audiences.insert(client, audience);
                }
                (Some(_), None) => {
                    self.audiences.remove(&client);
                    self.tell_everything(client);
                }
                (None, None) if is_first => self.tell_everything(client),
                (None, None) => {}
            }
        }
    }

    fn tell_everything(&mut self, client: ClientId) {
        let all = self.latest.keys().copied().collect::<Vec<_>>();
        self.tell_soon(client, all);
    }

    fn forward_states(&mut self, moved: Moved) {
        if self.clients.is_empty() {
            return;
        }
        let mut radii: Vec<_> = self.audiences.values().map(Audience::radius_m).collect();
        let middle = radii.len() / 2;
        let news = match radii.is_empty() {
            true => News::default(),
            false => {
                let (_, radius_m, _) = radii.select_nth_unstable_by(middle, f64::total_cmp);
                News::of(&moved, &self.moved_last, &self.latest, *radius_m)
            }
        };
        let (latest, places) = (&self.latest, &self.places);
        let batch =
            |(&client, audience): (&ClientId, &mut Audience)| (client, audience.batch(&news, latest, places));
        let batches: Vec<_> = self.audiences.iter_mut().map(batch).collect();
        for (client, bodies) in batches.into_iter().filter(|(_, bodies)| !bodies.is_empty()) {
            self.tell_soon(client, bodies);
        }
        if !moved.is_empty() {
            let here = self.hear_all().into_iter().filter(|client| self.is_here(*client));
            for client in here.collect::<Vec<_>>() {
                self.tell_soon(client, moved.keys().copied());
            }
            self.moved_last = moved.keys().copied().collect();
            self.batches.push(moved.into_keys().collect());
        }
        self.take_turns();
        self.tell_tick();
    }

    /// Sends a heartbeat to each client that is due one.
    fn tell_tick(&mut self) {
        let is_due = |client: &ClientId| self.is_heartbeat_due(*client);
        for client in self.clients.keys().copied().filter(is_due).collect::<Vec<_>>() {
            if self.undecided.contains(&client) {
                self.introduce(client);
            }
            self.tell(client, self.tick, false, Vec::new());
        }
    }

    /// Returns whether a client is to hear that time goes on. It hears that rarely if it would learn only
    /// that time goes on as ever.
    fn is_heartbeat_due(&self, client: ClientId) -> bool {
        let Some(Told { tick, opened, beats }) = self.told.get(&client).copied() else { return true };
        let ticks = self.tick.0.saturating_sub(tick.0);
        if ticks < TELL_TICK {
            return false;
        }
        let passed = self.opened.saturating_sub(opened);
        let reckoned = self.dt.saturating_mul(u32::try_from(ticks).unwrap_or(u32::MAX));
        beats < FIRST_BEATS
            || passed >= REST
            || passed.abs_diff(reckoned) > PACE_MISSED
            || self.undecided.contains(&client)
            || self.is_here(client)
    }

    /// Tells a client who leads, and so asks it for its interest: what it said may be lost.
    fn introduce(&mut self, client: ClientId) {
        let message = ToClient::LeaderIs {
            group: self.group,
            view: self.view,
            leader: self.introduction.clone(),
            tree: None,
            allocation: self.allocation.clone(),
        };
        self.messages.push((client, message));
    }

    /// Returns the clients without an area of interest.
    fn hear_all(&self) -> Vec<ClientId> {
        let hears_all =
            |client: &&ClientId| !self.audiences.contains_key(client) && !self.undecided.contains(client);
        self.clients.keys().filter(hears_all).copied().collect()
    }

    /// Tells a client of bodies, given in id order: in this process at once, in another when it is its turn.
    fn tell_soon(&mut self, client: ClientId, bodies: impl IntoIterator<Item = BodyId>) {
        if !self.is_here(client) {
            self.channel(client).wait_for(bodies);
            return;
        }
        let known = |id| self.latest.get(&id).map(|&(state, _)| state);
        let states: Vec<_> = bodies.into_iter().filter_map(known).collect();
        if !states.is_empty() {
            self.tell(client, self.tick, false, states);
        }
    }

    /// Returns the most states that are coded per tick. One client's batch may exceed that; the next ticks
    /// make up for it.
    pub(super) fn states_per_tick(&self) -> usize {
        ((self.states_per_s * self.dt.as_secs_f64()).round() as usize).max(1)
    }

    /// Sends clients in other processes what waits for them. Those go first that were last sent a batch
    /// longest ago, and only so many that the tick takes little longer; the others follow in the next tick.
    /// After the last tick all are sent everything.
    fn take_turns(&mut self) {
        let decided = |client: &ClientId| !self.undecided.contains(client) && !self.is_here(*client);
        let turn = |client| (self.channels.get(&client).map_or(Tick(0), Channel::turn), client);
        let mut clients: Vec<_> = self.clients.keys().copied().filter(decided).map(turn).collect();
        clients.sort_unstable();
        let most = self.states_per_tick();
        let mut coded = std::mem::take(&mut self.coded_beyond);
        for (_, client) in clients {
            if coded >= most && !self.is_last {
                break;
            }
            let states = self.choose(client, most, &mut coded);
            self.tell_by_tick(client, states);
        }
        self.coded_beyond = coded.saturating_sub(most);
    }

    /// Returns the states that a client is sent now, and adds what that costs to `coded`.
    fn choose(&mut self, client: ClientId, most: usize, coded: &mut usize) -> Vec<SharedState> {
        let now = (self.tick, self.opened, self.dt.as_secs_f64());
        self.channel(client);
        let Self { channels, batches, latest, audiences, is_last, .. } = self;
        let channel = channels.get_mut(&client).expect("it was made, if it was not there");
        if !audiences.contains_key(&client) {
            channel.catch_up(batches, || latest.keys().copied());
        }
        if *is_last {
            return channel.choose_all(latest);
        }
        if !channel.waits(now.0) {
            return Vec::new();
        }
        let (states, compared) = channel.choose(now, latest, most);
        *coded += states.len() + compared / COMPARED_PER_STATE;
        states
    }

    /// Sends a client states, each with the tick that members reported it for. A body at rest is still so
    /// after the newest of these ticks, and goes with that one.
    fn tell_by_tick(&mut self, client: ClientId, states: Vec<SharedState>) {
        let of = |state: &SharedState| self.latest.get(&state.id).map_or(self.tick, |&(_, tick)| tick);
        let Some(newest) = states.iter().map(of).max() else { return };
        let mut by_tick: BTreeMap<Tick, Vec<SharedState>> = BTreeMap::new();
        for state in states {
            let tick = if state.sleeping { newest } else { of(&state) };
            by_tick.entry(tick).or_default().push(state);
        }
        if let Some(audience) = self.audiences.get_mut(&client) {
            by_tick.values().flatten().for_each(|state| audience.has_told(state));
        }
        for (tick, states) in by_tick {
            self.tell(client, tick, false, states);
        }
    }

    /// Returns whether a client is in this process.
    fn is_here(&self, client: ClientId) -> bool {
        let here = self.introduction.as_ref().map(|leader| Peer::Node(leader.node));
        self.route(client) == here
    }

    /// Returns the bytes that are held for a client: those of bodies, and the rest.
    #[cfg(test)]
    pub(super) fn bytes_of(&self, client: ClientId) -> (usize, usize) {
        self.channels[&client].bytes()
    }

    /// Returns the channel of a client, which begins if there is none.
    fn channel(&mut self, client: ClientId) -> &mut Channel {
        // Numbers of views grow, and so do those of series.
        let turn = self.turns.get(&client).map_or(0, |turn| *turn);
        assert!(turn < MAX_TURNS, "a client of turn {turn} would be told in the series of a later view");
        let series = (self.view.0 as u32).wrapping_mul(MAX_TURNS * RESTARTS) + turn * RESTARTS;
        let new = || Channel::new(client, self.motion, series, self.batches.next());
        self.channels.entry(client).or_insert_with(new)
    }

    /// Sends a client states, in id order; without any, a heartbeat.
    fn tell(&mut self, client: ClientId, tick: Tick, speculative: bool, states: Vec<SharedState>) {
        if !speculative {
            let before = self.told.get(&client).map_or(0, |told| told.beats);
            let beats = if states.is_empty() { before.saturating_add(1) } else { 0 };
            self.told.insert(client, Told { tick: self.tick, opened: self.opened, beats });
        }
        let stamp = self.stamp(client, tick, speculative);
        if states.is_empty() || self.is_here(client) {
            self.messages.push((client, ToClient::States { stamp, states }));
            return;
        }
        self.channel(client);
        let Self { channels, fed, .. } = self;
        let channel = channels.get_mut(&client).expect("it was made, if it was not there");
        let parts = channel.pack((self.tick, tick), &states, speculative, |id| fed.left_out(id));
        let message = |part| (client, ToClient::CompactStates { stamp, part });
        self.messages.extend(parts.into_iter().map(message));
    }

    /// Returns the stamp of what a client is told of a tick.
    fn stamp(&self, client: ClientId, tick: Tick, speculative: bool) -> Stamp {
        // Speculative ticks come after the tick that is waited for, reports are of that tick or one before.
        let apart = |a: Tick, b: Tick| self.dt * u32::try_from(a.0.saturating_sub(b.0)).unwrap_or(u32::MAX);
        let opened = (self.opened + apart(tick, self.tick)).saturating_sub(apart(self.tick, tick));
        let opened_us = opened.as_micros() as u64;
        let (applied, early) = self.applied.get(&client).copied().unwrap_or_default();
        Stamp { group: self.group, tick, opened_us, applied, early, speculative }
    }

    /// Sends clients the states of a speculative tick, computed without the other nodes.
    fn tell_speculative(&mut self, tick: Tick, states: &[SharedState]) {
        let of =
            |audience: &Audience| states.iter().filter(|state| audience.reaches(state)).copied().collect();
        // A client that asked for a limited rate is sent no speculative states.
        let is_limited = |client: &ClientId| self.channels.get(client).is_some_and(Channel::is_limited);
        let parts = self.audiences.iter().map(|(&client, all)| (client, of(all)));
        let all = self.hear_all().into_iter().map(|client| (client, states.to_vec()));
        let told: Vec<(_, Vec<_>)> = parts.chain(all).filter(|(client, _)| !is_limited(client)).collect();
        for (client, states) in told {
            self.tell(client, tick, true, states);
        }
    }
}
