//! Tells members what clients look at, so that they report what is there and nothing else; and lets an interest count when what is newly looked
//! at has been reported: until then the leader has it as it was when somebody looked there last.

use std::collections::{BTreeMap, BTreeSet};

use super::Leader;
use crate::cluster::coverage::{Cell, Coverage, cell_of};
use crate::protocol::{Area, SharedState, Watch, WorldOp};
use crate::space::{BodyId, ClientId, Tick};

/// What clients look at. It lasts as long as the view.
#[derive(Clone, Debug)]
pub(super) struct Watching {
    /// The ticks from one report to the next.
    every: u64,
    coverage: Coverage,
    /// What members have not been told yet.
    areas: BTreeMap<ClientId, Option<Area>>,
    gone: BTreeSet<ClientId>,
    avatars: BTreeMap<BodyId, Cell>,
    /// The tick whose reports are of all that is looked at by now.
    reported_at: Tick,
    /// Interests that count after a tick, in the order in which they came.
    waiting: Vec<(Tick, ClientId, Option<Area>)>,
}

impl Watching {
    pub(super) fn new(state_every: u32) -> Self {
        Self {
            every: u64::from(state_every).max(1),
            coverage: Coverage::default(),
            areas: BTreeMap::new(),
            gone: BTreeSet::new(),
            avatars: BTreeMap::new(),
            reported_at: Tick(0),
            waiting: Vec::new(),
        }
    }

    /// Notes that a client looks at an area from the tick after `now` on.
    fn turn(&mut self, now: Tick, client: ClientId, area: Option<Area>) {
        let was_all = self.coverage.is_all();
        if self.coverage.turn(client, area) {
            self.areas.insert(client, area);
            let begins = self.coverage.is_all() && !was_all;
            self.note_growth(now, begins);
        }
    }

    /// Notes that members are to report more than before, from the tick after `now` on.
    fn note_growth(&mut self, now: Tick, begins: bool) {
        if !self.coverage.take_grown().is_empty() || begins {
            self.reported_at = Tick(now.next().0.next_multiple_of(self.every));
        }
    }

    fn leave(&mut self, client: ClientId) {
        self.waiting.retain(|(_, waiting, _)| *waiting != client);
        self.areas.remove(&client);
        self.avatars.retain(|avatar, _| avatar.client() != Some(client));
        if self.coverage.leave(client) {
            self.gone.insert(client);
        }
    }

    /// Notes where an avatar is.
    pub(super) fn see(&mut self, now: Tick, avatar: &SharedState) {
        let at = cell_of(avatar);
        if self.coverage.follow(avatar.id, at) {
            self.avatars.insert(avatar.id, at);
            self.note_growth(now, false);
        }
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        self.coverage.forget(id);
        self.avatars.remove(&id);
    }

    /// Returns what members are to be told with the next tick.
    fn take(&mut self) -> Option<Watch> {
        if self.areas.is_empty() && self.gone.is_empty() && self.avatars.is_empty() {
            return None;
        }
        let areas = std::mem::take(&mut self.areas).into_iter().collect();
        let gone = std::mem::take(&mut self.gone).into_iter().collect();
        let avatars = std::mem::take(&mut self.avatars).into_iter().collect();
        Some(Watch { areas, gone, avatars })
    }
}

impl Leader {
    /// Notes what a client wants to hear of: replication is told when what is there has been reported.
    pub(super) fn watch(&mut self, client: ClientId, area: Option<Area>) {
        self.watching.turn(self.tick, client, area);
        let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
        for (_, (avatar, _)) in self.latest.range(own) {
            self.watching.see(self.tick, avatar);
        }
        // With the first tick of a view all is reported.
        match self.completed() {
            Some(completed) if completed < self.watching.reported_at => {
                self.watching.waiting.push((self.watching.reported_at, client, area));
            }
            _ => self.news.interested(client, area),
        }
    }

    /// Returns whether members have reported all of their bodies as they are.
    pub(super) fn knows_all(&self) -> bool {
        let is_reported = |completed| self.watching.reported_at <= completed;
        self.watching.coverage.is_all() && self.completed().is_some_and(is_reported)
    }

    pub(super) fn unwatch(&mut self, client: ClientId) {
        self.watching.leave(client);
    }

    /// Lets interests count of which all is reported.
    pub(super) fn tell_interests(&mut self) {
        let completed = self.completed();
        for (_, client, area) in self
            .watching
            .waiting
            .extract_if(.., |(at, ..)| completed.is_some_and(|completed| *at <= completed))
        {
            self.news.interested(client, area);
        }
    }

    /// Returns what members are to be told of the next tick. While there are other groups, which are told of everything, all is looked at.
    pub(super) fn next_watch(&mut self) -> Option<WorldOp> {
        match self.inter_group.is_some() {
            true => self.watching.turn(self.tick, ClientId::NOBODY, None),
            false => self.watching.leave(ClientId::NOBODY),
        }
        self.watching.take().map(WorldOp::Watch)
    }
}
