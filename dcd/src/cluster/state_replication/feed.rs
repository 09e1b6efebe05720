//! Tells a relay, once for all of its clients, what it is to tell them: the same as the leader's own
//! replication is given with each tick. While much of that is on its way, what follows waits, and several
//! ticks become one.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::TickNews;
use super::news::Latest;
use super::reach::Reach;
use crate::delta::{FreeMotion, OrderedSender};
use crate::protocol::{Area, RelayNews, SharedState, ToRelay, ViewNumber, encoded_len};
use crate::space::{Allocation, BodyId, ClientId, Tick};

/// The most bytes that a relay may not have read yet. Beyond that the feed waits, except after the last tick.
/// The bound is far below what QUIC holds of a link ([`WINDOW_BYTES`](crate::protocol::link::WINDOW_BYTES)),
/// beyond which dispatches would wait too.
const ON_THE_WAY: usize = 256 << 10;

/// The same for speculative states, which are worth nothing when they come late.
const GUESSES_ON_THE_WAY: usize = 8 << 10;

/// The state of what a relay is told. It lasts as long as the relay has clients.
#[derive(Clone, Debug)]
pub(super) struct Feed {
    motion: FreeMotion,
    sender: OrderedSender,
    /// The number of the last message to it, guesses aside.
    last: u64,
    /// The messages that it has not said it has read, by number, with their bytes.
    on_the_way: VecDeque<(u64, usize)>,
    /// Says whether the relay has been told of all bodies that it is to know.
    has_begun: bool,
    clients: BTreeSet<ClientId>,
    /// Clients that have come since the tick before, each with its turn, or gone.
    changes: BTreeMap<ClientId, Option<u32>>,
    interests: BTreeMap<ClientId, Option<Area>>,
    reach: Reach,
    applied: BTreeMap<ClientId, (u64, i8)>,
    /// Bodies that are gone, and those that have moved, since the relay was told last.
    gone: BTreeSet<BodyId>,
    moved: BTreeSet<BodyId>,
    allocation: Option<Allocation>,
}

impl Feed {
    /// Returns the feed of a relay that was told nothing.
    pub(super) fn new(motion: FreeMotion) -> Self {
        Self {
            motion,
            sender: OrderedSender::new(motion),
            last: 0,
            on_the_way: VecDeque::new(),
            has_begun: false,
            clients: BTreeSet::new(),
            changes: BTreeMap::new(),
            interests: BTreeMap::new(),
            reach: Reach::new(),
            applied: BTreeMap::new(),
            gone: BTreeSet::new(),
            moved: BTreeSet::new(),
            allocation: None,
        }
    }

    /// Returns whether the relay has no client, and knows it.
    pub(super) fn is_over(&self) -> bool {
        self.clients.is_empty() && self.changes.is_empty()
    }

    /// Notes that the relay has read what it was sent, up to this number.
    pub(super) fn has_arrived(&mut self, number: u64) {
        self.on_the_way.retain(|(of, _)| *of > number);
    }

    fn bytes_on_the_way(&self) -> usize {
        self.on_the_way.iter().map(|(_, bytes)| bytes).sum()
    }

    pub(super) fn admit(&mut self, client: ClientId, turn: u32, area: Option<Area>) {
        // A relay that had no client left may have been lost with all that it was told.
        if self.clients.is_empty() {
            *self = Self::new(self.motion);
        }
        self.clients.insert(client);
        self.changes.insert(client, Some(turn));
        self.interested(client, area);
        self.applied.remove(&client);
    }

    pub(super) fn dismiss(&mut self, client: ClientId) {
        self.clients.remove(&client);
        self.changes.insert(client, None);
        self.interests.remove(&client);
        self.reach.leave(client);
        self.applied.remove(&client);
    }

    pub(super) fn interested(&mut self, client: ClientId, area: Option<Area>) {
        self.reach.turn(client, area);
        self.interests.insert(client, area);
    }

    pub(super) fn has_applied(&mut self, client: ClientId, newest: (u64, i8)) {
        self.applied.insert(client, newest);
    }

    /// Returns the message about a speculative tick: the states that the relay's clients may hear of. It is
    /// one message, since a later guess takes the place of those before.
    pub(super) fn guess(
        &mut self,
        view: ViewNumber,
        number: &mut u64,
        tick: Tick,
        states: &[SharedState],
    ) -> Option<ToRelay> {
        if self.bytes_on_the_way() > GUESSES_ON_THE_WAY {
            return None;
        }
        let near = states.iter().filter(|state| self.reach.hears_of(state)).copied();
        let states = self.sender.write_guesses(tick, near);
        *number += 1;
        self.on_the_way.push_back((*number, states.len()));
        Some(ToRelay::Guess { view, number: *number, follows: self.last, tick, states })
    }

    /// Returns the messages about a tick, with all bodies that have moved or gone and of which the relay was
    /// not told yet. `number` is the number of the last message to any relay.
    pub(super) fn tell(
        &mut self,
        view: ViewNumber,
        number: &mut u64,
        tick: &TickNews,
        moved: impl Iterator<Item = BodyId>,
        latest: &Latest,
    ) -> Vec<ToRelay> {
        for id in &tick.gone {
            self.moved.remove(id);
            if self.reach.forget(*id) {
                self.gone.insert(*id);
            }
        }
        self.moved.extend(moved);
        self.allocation = tick.allocation.clone().or(self.allocation.take());
        if self.bytes_on_the_way() > ON_THE_WAY && !tick.is_last {
            return Vec::new();
        }
        let mut told = self.news(view, tick, latest);
        for news in &mut told {
            *number += 1;
            (news.number, news.follows) = (*number, self.last);
            self.last = *number;
            self.on_the_way.push_back((*number, encoded_len(news)));
        }
        told.into_iter().map(|news| ToRelay::News(Box::new(news))).collect()
    }

    /// Returns all that the relay has not been told yet.
    fn news(&mut self, view: ViewNumber, tick: &TickNews, latest: &Latest) -> Vec<RelayNews> {
        let begins = !self.clients.is_empty() && !std::mem::replace(&mut self.has_begun, true);
        self.gone.iter().for_each(|&id| self.sender.forget(id));
        let moved = std::mem::take(&mut self.moved);
        let chosen = self.reach.choose(moved.into_iter(), latest);
        let states: Vec<_> =
            chosen.iter().filter_map(|id| latest.get(id)).map(|&(state, tick)| (tick, state)).collect();
        let mut parts = self.sender.write(tick.tick, &states).into_iter();
        let first = RelayNews {
            view,
            begins,
            more: parts.len() > 1,
            tick: tick.tick,
            opened_us: tick.opened.as_micros() as u64,
            is_last: tick.is_last,
            clients: std::mem::take(&mut self.changes).into_iter().collect(),
            interests: std::mem::take(&mut self.interests).into_iter().collect(),
            applied: std::mem::take(&mut self.applied)
                .into_iter()
                .map(|(of, (time, early))| (of, time, early))
                .collect(),
            gone: std::mem::take(&mut self.gone).into_iter().collect(),
            allocation: self.allocation.take(),
            states: parts.next().unwrap_or_default(),
            ..RelayNews::default()
        };
        let last = parts.len();
        let now = tick.tick;
        let part =
            |(at, states)| RelayNews { view, more: at < last, tick: now, states, ..RelayNews::default() };
        std::iter::once(first).chain((1..).zip(parts).map(part)).collect()
    }
}
