//! Sends clients contacts of their avatars and the states of bodies (state replication from the leader to clients).

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::Leader;
use super::channel::Channel;
use super::interest::{Audience, news};
use crate::cluster::Peer;
use crate::delta::RESTARTS;
use crate::protocol::{
    ContactForce, ContactKey, Heard, SharedState, Stamp, ToClient, ToServer, Touch, WorldEvents,
};
use crate::space::{BodyId, ClientId, Tick};

/// The ticks after which clients and the server at the earliest hear that time goes on though nothing moves (a heartbeat).
pub(in crate::cluster) const TELL_TICK: u64 = 30;

/// So many heartbeats to a client are sent so early after states, since some may be lost.
const FIRST_BEATS: u32 = 3;

/// The time between later ones in a world that goes at the pace of its clock.
const REST: Duration = Duration::from_secs(5);

/// By how much that pace may be missed between two heartbeats: who shows the world reckons with it.
const PACE_MISSED: Duration = Duration::from_millis(250);

/// When a client was last told of anything.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    tick: Tick,
    opened: Duration,
    /// The heartbeats since the last states.
    beats: u32,
}

/// The most states that are coded for all clients together in the ticks of a second, at 1.1 to 1.5 µs each with all that goes with it: ticks
/// that take all of their time take about a fifth longer.
const STATES_PER_S: f64 = 140_000.0;

/// So many bodies are compared by how much they matter in the time that the state of one takes.
const COMPARED_PER_STATE: usize = 4;

impl Leader {
    /// Sends contacts to the clients whose avatars touch. A pair that two regions hold is seen by both: it begins with the
    /// first and ends with the last of them.
    pub(super) fn forward_contacts(&mut self) {
        let mut seen = WorldEvents::default();
        self.contacts.merge(std::mem::take(&mut self.events).values(), &mut seen);
        self.claim(&seen.touches);
        if self.events_to_server && !(seen.touches.is_empty() && seen.forces.is_empty()) {
            let (view, tick, events) = (self.view, self.tick, seen.clone());
            self.server_messages.push(ToServer::Contacts { view, tick, events });
        }
        let mut touches: BTreeMap<ClientId, Vec<Touch>> = BTreeMap::new();
        let mut forces: BTreeMap<ClientId, Vec<ContactForce>> = BTreeMap::new();
        for touch in seen.touches {
            for client in hosts(touch.key) {
                touches.entry(client).or_default().push(touch);
            }
        }
        for force in seen.forces {
            for client in hosts(force.key) {
                forces.entry(client).or_default().push(force);
            }
        }
        let concerned: BTreeSet<_> = touches.keys().chain(forces.keys()).copied().collect();
        for client in concerned.into_iter().filter(|client| self.clients.contains_key(client)) {
            let message = ToClient::Contacts {
                tick: self.tick,
                touches: touches.remove(&client).unwrap_or_default(),
                forces: forces.remove(&client).unwrap_or_default(),
            };
            self.messages.push((client, message));
        }
    }

    pub(super) fn forward_states(&mut self) {
        let moved = std::mem::take(&mut self.moved);
        if self.clients.is_empty() {
            return;
        }
        self.turn_audiences();
        let news = if self.audiences.is_empty() { Vec::new() } else { news(&moved, &self.latest) };
        for (client, mut audience) in std::mem::take(&mut self.audiences) {
            let bodies = audience.batch(&news, &self.latest);
            self.audiences.insert(client, audience);
            self.tell_soon(client, bodies);
        }
        if !moved.is_empty() {
            let here = self.hear_all().into_iter().filter(|client| self.is_here(*client));
            for client in here.collect::<Vec<_>>() {
                self.tell_soon(client, moved.keys().copied());
            }
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
        let allocation = self.computed_by.back().map(|(_, allocation)| allocation.clone());
        let message = ToClient::LeaderIs {
            group: self.group,
            view: self.view,
            leader: self.introduction.clone(),
            tree: None,
            allocation: allocation.unwrap_or_default(),
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
    pub(super) fn tell_soon(&mut self, client: ClientId, bodies: impl IntoIterator<Item = BodyId>) {
        if !self.is_here(client) {
            let mut channel = self.channel(client);
            channel.wait_for(bodies);
            self.channels.insert(client, channel);
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
        ((STATES_PER_S * self.dt.as_secs_f64()).round() as usize).max(1)
    }

    /// Tells clients in other processes what waits for them: those first that had their turn longest ago, and only so many that the tick
    /// takes little longer; the others have their turn in the next one. After the last tick all are told all.
    fn take_turns(&mut self) {
        let is_last = self.last_tick == Some(self.tick);
        let decided = |client: &ClientId| !self.undecided.contains(client) && !self.is_here(*client);
        let turn = |client| (self.channels.get(&client).map_or(Tick(0), Channel::turn), client);
        let mut clients: Vec<_> = self.clients.keys().copied().filter(decided).map(turn).collect();
        clients.sort_unstable();
        let most = self.states_per_tick();
        let mut coded = std::mem::take(&mut self.coded_beyond);
        for (_, client) in clients {
            if coded >= most && !is_last {
                break;
            }
            let mut channel = self.channel(client);
            if !self.audiences.contains_key(&client) {
                channel.catch_up(&self.batches, || self.latest.keys().copied());
            }
            let mut states = Vec::new();
            if is_last {
                states = channel.choose_all(&self.latest);
            } else if channel.waits(self.tick) {
                let now = (self.tick, self.opened, self.dt.as_secs_f64());
                let compared;
                (states, compared) = channel.choose(now, &self.latest, most);
                coded += states.len() + compared / COMPARED_PER_STATE;
            }
            self.channels.insert(client, channel);
            self.tell_by_tick(client, states);
        }
        self.coded_beyond = coded.saturating_sub(most);
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

    /// Takes the channel of a client, which is to be put back.
    fn channel(&mut self, client: ClientId) -> Channel {
        // Views follow each other with growing numbers, and so do series.
        let new = || {
            Channel::new(
                client,
                self.motion,
                (self.view.0 as u32).wrapping_mul(RESTARTS),
                self.batches.next(),
            )
        };
        self.channels.remove(&client).unwrap_or_else(new)
    }

    /// Notes how many bytes for a client wait for its link.
    pub fn hear_backlog(&mut self, client: ClientId, bytes: usize) {
        if let Some(channel) = self.channels.get_mut(&client) {
            channel.adapt(bytes);
        }
    }

    /// Takes in which states a client has acknowledged.
    pub fn heard(&mut self, client: ClientId, heard: &Heard) {
        if let Some(channel) = self.channels.get_mut(&client) {
            channel.hear(self.tick, heard);
        }
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
        let mut channel = self.channel(client);
        let parts = channel.pack(self.tick, tick, &states, speculative);
        self.channels.insert(client, channel);
        let message = |part| (client, ToClient::CompactStates { stamp, part });
        self.messages.extend(parts.into_iter().map(message));
    }

    /// Returns the stamp of what a client is told of a tick.
    pub fn stamp(&self, client: ClientId, tick: Tick, speculative: bool) -> Stamp {
        // Speculative ticks follow the one that is waited for; reports are of one before.
        let apart = |a: Tick, b: Tick| self.dt * u32::try_from(a.0.saturating_sub(b.0)).unwrap_or(u32::MAX);
        let opened = (self.opened + apart(tick, self.tick)).saturating_sub(apart(self.tick, tick));
        let opened_us = opened.as_micros() as u64;
        let (applied, early) = self.applied.get(&client).copied().unwrap_or_default();
        Stamp { group: self.group, tick, opened_us, applied, early, speculative }
    }

    /// Sends clients the states of a speculative tick, computed without the other nodes.
    pub fn tell_speculative(&mut self, tick: Tick, states: &[SharedState]) {
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

/// Returns the clients whose avatars touch, each once.
fn hosts(key: ContactKey) -> BTreeSet<ClientId> {
    key.a.client().into_iter().chain(key.b.client()).collect()
}
