//! Tells a relay, once for all of its clients, what it is to tell them: the same as the leader's own replication is told with each tick.

use std::collections::{BTreeMap, BTreeSet};

use super::TickNews;
use super::news::Latest;
use super::reach::Reach;
use crate::protocol::{Area, CHUNK_BYTES, RelayNews, SharedState, ToRelay, ViewNumber, most_items, split};
use crate::space::{BodyId, ClientId, Tick};

/// What a relay is told. It lasts as long as that has clients.
#[derive(Clone, Debug, Default)]
pub(super) struct Feed {
    /// Whether it has been told of all bodies.
    has_begun: bool,
    clients: BTreeSet<ClientId>,
    /// Clients that have come, each with its turn, or gone since the tick before.
    changes: BTreeMap<ClientId, Option<u32>>,
    interests: BTreeMap<ClientId, Option<Area>>,
    reach: Reach,
    applied: BTreeMap<ClientId, (u64, i8)>,
}

impl Feed {
    /// Returns whether it has no client.
    pub(super) fn is_over(&self) -> bool {
        self.clients.is_empty()
    }

    pub(super) fn admit(&mut self, client: ClientId, turn: u32, area: Option<Area>) {
        // One that had none left may have been lost with all that it was told.
        if self.is_over() {
            *self = Self::default();
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

    /// Returns what the relay is told of a speculative tick: what its clients may hear of, in one message, since a later guess takes the place of
    /// those before.
    pub(super) fn guess(&self, view: ViewNumber, tick: Tick, states: &[SharedState]) -> ToRelay {
        let near = states.iter().filter(|state| self.reach.hears_of(state)).copied();
        ToRelay::Guess { view, tick, states: near.take(most_items::<SharedState>()).collect() }
    }

    /// Returns what the relay is told of a tick, in which these bodies are gone and those have moved.
    pub(super) fn tell(
        &mut self,
        view: ViewNumber,
        tick: &TickNews,
        moved: impl Iterator<Item = BodyId>,
        latest: &Latest,
    ) -> Vec<ToRelay> {
        let begins = !self.is_over() && !std::mem::replace(&mut self.has_begun, true);
        let gone = tick.gone.iter().copied().filter(|&id| self.reach.forget(id)).collect();
        let chosen = self.reach.choose(moved, latest);
        let states: Vec<_> =
            chosen.iter().filter_map(|id| latest.get(id)).map(|&(state, tick)| (tick, state)).collect();
        let mut parts = split(states, CHUNK_BYTES).into_iter();
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
            gone,
            allocation: tick.allocation.clone(),
            states: parts.next().unwrap_or_default(),
        };
        let (number, last) = (tick.tick, parts.len());
        let rest = (1..).zip(parts).map(|(at, states)| RelayNews {
            view,
            more: at < last,
            tick: number,
            states,
            ..RelayNews::default()
        });
        std::iter::once(first).chain(rest).map(|news| ToRelay::News(Box::new(news))).collect()
    }
}
