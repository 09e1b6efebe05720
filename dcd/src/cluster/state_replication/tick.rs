//! Gathers what a tick, or several, change for clients.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::news::Latest;
use crate::protocol::{Area, RelayNews};
use crate::space::{Allocation, BodyId, ClientId, Tick};

/// The changes of a tick, or of several, for clients.
#[derive(Clone, Debug, Default)]
pub struct TickNews {
    pub(super) tick: Tick,
    pub(super) opened: Duration,
    /// Says whether no tick follows.
    pub(super) is_last: bool,
    /// Bodies that are gone.
    pub(super) gone: BTreeSet<BodyId>,
    /// The states of bodies that moved, each with the tick after which it was so.
    pub(super) moved: Latest,
    /// The logical time of each client's newest applied input, and how many ticks early it came.
    pub(super) applied: BTreeMap<ClientId, (u64, i8)>,
    /// Interests that clients have named since the tick before.
    pub(super) interests: BTreeMap<ClientId, Option<Area>>,
    /// The node that computes each region, if that is new.
    pub(super) allocation: Option<Allocation>,
}

impl TickNews {
    /// Returns the changes gathered so far as those of a tick.
    pub(in crate::cluster) fn after(
        self,
        tick: Tick,
        opened: Duration,
        is_last: bool,
        moved: Latest,
    ) -> Self {
        Self { tick, opened, is_last, moved, ..self }
    }

    /// Returns the newest tick in it.
    #[cfg(all(feature = "net", feature = "physics"))]
    pub(crate) fn tick(&self) -> Tick {
        self.tick
    }

    pub(in crate::cluster) fn interested(&mut self, client: ClientId, area: Option<Area>) {
        self.interests.insert(client, area);
    }

    pub(crate) fn uninterested(&mut self, client: ClientId) {
        self.interests.remove(&client);
    }

    pub(in crate::cluster) fn has_applied(&mut self, client: ClientId, newest: (u64, i8)) {
        self.applied.insert(client, newest);
    }

    pub(in crate::cluster) fn is_allocated(&mut self, allocation: Allocation) {
        self.allocation = Some(allocation);
    }

    pub(in crate::cluster) fn is_gone(&mut self, id: BodyId) {
        self.moved.remove(&id);
        self.gone.insert(id);
    }

    /// Returns what a leader tells its relay as the changes of a tick in which these bodies moved.
    pub(super) fn of_relay(news: RelayNews, moved: Latest) -> Self {
        Self {
            tick: news.tick,
            opened: Duration::from_micros(news.opened_us),
            is_last: news.is_last,
            gone: news.gone.into_iter().collect(),
            moved,
            applied: news.applied.into_iter().map(|(client, time, early)| (client, (time, early))).collect(),
            interests: news.interests.into_iter().collect(),
            allocation: news.allocation,
        }
    }

    /// Takes in other bodies that moved in the same tick.
    pub(super) fn extend(&mut self, moved: Latest) {
        self.moved.extend(moved);
    }

    /// Takes in what a later tick changes. Only the newest state of each body remains.
    pub fn absorb(&mut self, later: Self) {
        for id in later.gone {
            self.is_gone(id);
        }
        self.moved.extend(later.moved);
        self.applied.extend(later.applied);
        self.interests.extend(later.interests);
        self.allocation = later.allocation.or(self.allocation.take());
        (self.tick, self.opened, self.is_last) = (later.tick, later.opened, later.is_last);
    }
}
