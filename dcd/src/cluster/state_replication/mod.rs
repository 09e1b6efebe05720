//! Sends clients the states of bodies (state replication): which bodies each client hears of, when, and in which bytes.
//!
//! It belongs to a leader, and begins and ends with it, but no tick waits for it: it is told of each tick when that is complete
//! ([`ReplicationEvent`]). A process may thus let it run on a thread of its own, where it may fall behind: of several ticks that it has not taken in
//! yet only the newest states count ([`TickNews::absorb`]).

mod channel;
mod fed;
mod feed;
mod interest;
mod news;
mod place;
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
pub use self::tick::TickNews;
use self::trails::Trails;
use super::Peer;
use crate::delta::{FreeMotion, RESTARTS};
use crate::protocol::{
    Area, EnvironmentProperties, Heard, Member, Message, SharedState, Stamp, ToClient, ToRelay, View,
    ViewNumber,
};
use crate::space::{Allocation, BodyId, ClientId, GroupId, NodeId, Tick};

/// The ticks after which clients and the server at the earliest hear that time goes on though nothing moves (a heartbeat).
pub(in crate::cluster) const TELL_TICK: u64 = 30;

/// So many heartbeats to a client are sent so early after states, since some may be lost.
const FIRST_BEATS: u32 = 3;

/// The time between later ones in a world that goes at the pace of its clock.
const REST: Duration = Duration::from_secs(5);

/// By how much that pace may be missed between two heartbeats: who shows the world reckons with it.
const PACE_MISSED: Duration = Duration::from_millis(250);

/// The most turns of a client in a view: it is told by its leader, by a relay, and by the leader again. Each has series of its own, so that what is
/// still on its way of an earlier turn is older than all of a later one.
pub(in crate::cluster) const MAX_TURNS: u32 = 64;

/// When a client was last told of anything.
#[derive(Clone, Copy, Debug)]
struct Told {
    tick: Tick,
    opened: Duration,
    /// The heartbeats since the last states.
    beats: u32,
}

/// The most states that are coded for all clients together in the ticks of a second, at 1.1 to 1.5 µs each with all that goes with it. Where
/// the same thread computes the world, ticks that take all of their time take about a fifth longer.
const STATES_PER_S: f64 = 140_000.0;

/// The same on a thread of its own: two thirds of a core at most.
const STATES_PER_S_ELSEWHERE: f64 = 420_000.0;

/// So many bodies are compared by how much they matter in the time that the state of one takes.
const COMPARED_PER_STATE: usize = 4;

/// An event for the state replication.
#[derive(Clone, Debug)]
pub enum ReplicationEvent {
    /// A leader begins, and its replication with it; that of a former view ends.
    Begin(Box<StateReplication>),
    /// A client is to be told from now on: what it was told before counts no more.
    Admit {
        /// Who.
        client: ClientId,
        /// The number of its turn.
        turn: u32,
        /// Whether another has told it until now, which cannot be asked of what.
        told_elsewhere: bool,
        /// What it wants to hear of, if it has said so.
        area: Option<Option<Area>>,
    },
    /// A client is told by a relay from now on.
    Relay {
        /// Who.
        client: ClientId,
        /// By which member.
        node: NodeId,
        /// The number of its turn.
        turn: u32,
        /// What it wants to hear of.
        area: Option<Area>,
    },
    /// A client's link is gone.
    Dismiss(ClientId),
    /// A client has acknowledged states.
    Heard {
        /// Who.
        client: ClientId,
        /// What.
        heard: Heard,
        /// The newest tick then.
        now: Tick,
    },
    /// A tick is complete.
    Tick(TickNews),
    /// The leader has told this process, its relay, something.
    ByLeader(ToRelay),
    /// A relay has taken in what it was told, up to what has this number.
    Fed {
        /// Which member.
        node: NodeId,
        /// The number.
        number: u64,
    },
    /// States of a tick that was computed without the other nodes; later ones may contradict them.
    Speculative {
        /// Which.
        tick: Tick,
        /// The bodies in it.
        states: Vec<SharedState>,
        /// The members that are waited for, who are told of no guess.
        silent: BTreeSet<NodeId>,
    },
    /// This process leads no more.
    End,
}

/// The state replication of a leader.
#[derive(Clone, Debug)]
pub struct StateReplication {
    group: GroupId,
    view: ViewNumber,
    dt: Duration,
    motion: FreeMotion,
    /// The leader, as clients are told of it.
    introduction: Option<Member>,
    allocation: Allocation,
    /// The newest tick, and when it was due, by which clients count time.
    tick: Tick,
    opened: Duration,
    is_last: bool,
    latest: Latest,
    clients: BTreeMap<ClientId, Peer>,
    /// How often each client has been told by another, or anew, in this view.
    turns: BTreeMap<ClientId, u32>,
    /// Clients that another has told until they came here, as long as they have not said what they want to hear of.
    told_elsewhere: BTreeSet<ClientId>,
    /// Clients that relays tell, and what those are told.
    relayed: BTreeMap<ClientId, NodeId>,
    feeds: BTreeMap<NodeId, Feed>,
    /// The number of what a relay was told last.
    told_relays: u64,
    /// What this process is told as a relay.
    fed: Fed,
    /// Clients that have not said yet what they want to hear of: they are told no states.
    undecided: BTreeSet<ClientId>,
    /// The logical time of each client's newest input that a tick has applied, and how early it came.
    applied: BTreeMap<ClientId, (u64, i8)>,
    /// When each client was last told of a tick.
    told: BTreeMap<ClientId, Told>,
    /// What clients in other processes are told, and in which way.
    channels: BTreeMap<ClientId, Channel>,
    /// The most states that are coded per second of ticks, and those that were coded beyond so far.
    states_per_s: f64,
    coded_beyond: usize,
    /// What moved lately, and last, in id order.
    batches: Batches,
    moved_last: Vec<BodyId>,
    /// Where fast bodies have been, since relays tell clients.
    trails: Option<Trails>,
    /// Audiences of clients that have an area of interest.
    audiences: BTreeMap<ClientId, Audience>,
    messages: Vec<(ClientId, ToClient)>,
    member_messages: Vec<(NodeId, Message)>,
}

impl StateReplication {
    /// Returns that of the leader of this view, which knows no body yet.
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
            messages: Vec::new(),
            member_messages: Vec::new(),
        }
    }

    /// Returns one that has a thread of its own, and so may code more where there is a core for it.
    pub(super) fn with_own_thread(self) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let states_per_s = if cores > 1 { STATES_PER_S_ELSEWHERE } else { STATES_PER_S };
        Self { states_per_s, ..self }
    }

    /// Takes an event in; [`StateReplication::take_messages`] tells what follows from it.
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

    /// Returns the messages for other members since the last call: for relays, and for the leader whose relay this is.
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

    /// Admits a client that is linked directly; it says what it wants to hear of.
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

    /// Notes what relays are to be told of their clients. Returns what each is told of the tick beside, if there are any.
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
        self.latest.remove(&id);
        if let Ok(place) = self.moved_last.binary_search(&id) {
            self.moved_last.remove(place);
        }
        self.audiences.values_mut().for_each(|audience| audience.forget(id));
        self.channels.values_mut().for_each(|channel| channel.forget(id));
    }

    fn turn_audiences(&mut self, interests: impl IntoIterator<Item = (ClientId, Option<Area>)>) {
        for (client, area) in interests {
            // One whose link is gone says it again over the next one.
            if !self.clients.contains_key(&client) {
                continue;
            }
            let is_first = self.undecided.remove(&client);
            let told_elsewhere = self.told_elsewhere.remove(&client);
            match (self.audiences.get_mut(&client), area) {
                (Some(audience), Some(area)) => audience.turn_to(area, &self.latest),
                (None, Some(area)) => {
                    if let Some(channel) = self.channels.get_mut(&client) {
                        channel.catch_up(&self.batches, || self.latest.keys().copied());
                    }
                    let mut audience = Audience::new(client, area, &self.latest);
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
        let latest = &self.latest;
        let batch = |(&client, audience): (&ClientId, &mut Audience)| (client, audience.batch(&news, latest));
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

    /// Sends the tick to clients that have not heard of anything for long.
    fn tell_tick(&mut self) {
        let is_due = |client: &ClientId| self.is_heartbeat_due(*client);
        for client in self.clients.keys().copied().filter(is_due).collect::<Vec<_>>() {
            if self.undecided.contains(&client) {
                self.introduce(client);
            }
            self.tell(client, self.tick, false, Vec::new());
        }
    }

    /// Returns whether a client is to hear that time goes on: rarely, where all that it would learn is that it does so as ever.
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

    /// Tells a client of bodies, in id order: in this process at once, elsewhere when it is its turn.
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

    /// Returns the most states that are coded per tick, but for those of one client, which the next ticks make up for.
    pub(super) fn states_per_tick(&self) -> usize {
        ((self.states_per_s * self.dt.as_secs_f64()).round() as usize).max(1)
    }

    /// Tells clients in other processes what waits for them: those first that had their turn longest ago, and only so many that the tick
    /// takes little longer; the others have their turn in the next one. After the last tick all are told all.
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

    /// Returns what a client is told now, whose turn it is, and adds what that costs to what is `coded`.
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

    /// Tells a client states as they are after the ticks that members reported them of; what rests is still so after the newest of these.
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

    /// Returns the bytes that are held for a client, those of each body and the rest.
    #[cfg(test)]
    pub(super) fn bytes_of(&self, client: ClientId) -> (usize, usize) {
        self.channels[&client].bytes()
    }

    /// Returns the channel of a client.
    fn channel(&mut self, client: ClientId) -> &mut Channel {
        // Views follow each other with growing numbers, and so do series.
        let turn = self.turns.get(&client).map_or(0, |turn| *turn);
        assert!(turn < MAX_TURNS, "a client of turn {turn} would be told in the series of a later view");
        let series = (self.view.0 as u32).wrapping_mul(MAX_TURNS * RESTARTS) + turn * RESTARTS;
        let new = || Channel::new(client, self.motion, series, self.batches.next());
        self.channels.entry(client).or_insert_with(new)
    }

    /// Sends a client states, in id order; without any, that time goes on.
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
        // Speculative ticks follow the one that is waited for; reports are of one before.
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
        // Who asked for few bytes is sent no guesses.
        let is_limited = |client: &ClientId| self.channels.get(client).is_some_and(Channel::is_limited);
        let parts = self.audiences.iter().map(|(&client, all)| (client, of(all)));
        let all = self.hear_all().into_iter().map(|client| (client, states.to_vec()));
        let told: Vec<(_, Vec<_>)> = parts.chain(all).filter(|(client, _)| !is_limited(client)).collect();
        for (client, states) in told {
            self.tell(client, tick, true, states);
        }
    }
}
