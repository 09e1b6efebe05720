//! Tells members what clients look at, so that they report what is there and nothing else. An interest counts
//! when what is newly looked at has been reported: until then the leader has it as it was when somebody
//! looked there last.

use std::collections::{BTreeMap, BTreeSet};

use super::Leader;
use crate::cluster::coverage::{Cell, Coverage};
use crate::cluster::server::MAX_AVATARS;
use crate::protocol::{Area, SharedState, Watch, WorldOp};
use crate::space::{BodyId, ClientId, Tick};

/// The most avatars that members are told of with a tick. The others follow.
const AVATARS_AT_ONCE: usize = 4_096;

/// The state of what clients look at, and of what members have been told of it. It lasts as long as the view.
#[derive(Clone, Debug)]
pub(super) struct Watching {
    /// The number of ticks from one report to the next.
    every: u64,
    /// The coverage as members have been told.
    coverage: Coverage,
    /// The news for members: the last interest that each client has named. Each counts once per tick, however
    /// often it changes.
    turned: BTreeMap<ClientId, Option<Area>>,
    left: BTreeSet<ClientId>,
    seen: BTreeMap<BodyId, Cell>,
    /// The tick whose reports cover all that is looked at by now.
    reported_at: Tick,
    /// Interests that count after a tick.
    waiting: BTreeMap<(Tick, ClientId), Option<Area>>,
}

impl Watching {
    pub(super) fn new(state_every: u32) -> Self {
        Self {
            every: u64::from(state_every).max(1),
            coverage: Coverage::of_reports(),
            turned: BTreeMap::new(),
            left: BTreeSet::new(),
            seen: BTreeMap::new(),
            reported_at: Tick(0),
            waiting: BTreeMap::new(),
        }
    }

    fn leave(&mut self, client: ClientId) {
        self.forget_interests(client);
        self.turned.remove(&client);
        self.seen.retain(|avatar, _| avatar.client() != Some(client));
        self.left.insert(client);
    }

    /// Forgets the interests of a client that are yet to count.
    pub(super) fn forget_interests(&mut self, client: ClientId) {
        self.waiting.retain(|(_, waiting), _| *waiting != client);
    }

    /// Notes where an avatar of a client with an area is.
    pub(super) fn see(&mut self, avatar: &SharedState) {
        // Avatars beyond this number are made up.
        if (avatar.id.index() as usize) < MAX_AVATARS {
            self.seen.insert(avatar.id, self.coverage.cell_of(avatar));
        }
    }

    pub(super) fn forget(&mut self, id: BodyId) {
        self.coverage.forget(id);
        self.seen.remove(&id);
    }

    /// Returns what members are to be told with a tick, if anything, and the interests that are new.
    fn take(&mut self, now: Tick) -> (Option<Watch>, BTreeMap<ClientId, Option<Area>>) {
        let Self { coverage, .. } = self;
        let was_all = coverage.is_all();
        let gone = std::mem::take(&mut self.left).into_iter();
        let gone: Vec<_> = gone.filter(|client| coverage.leave(*client)).collect();
        let turned = std::mem::take(&mut self.turned);
        let areas = turned.iter().filter(|(client, area)| coverage.turn(**client, **area));
        let areas: Vec<_> = areas.map(|(&client, &area)| (client, area)).collect();
        let mut avatars = Vec::new();
        while avatars.len() < AVATARS_AT_ONCE
            && let Some((id, at)) = self.seen.pop_first()
        {
            avatars.extend(coverage.follow(id, at).then_some((id, at)));
        }
        let is_all = coverage.is_all();
        let is_grown = coverage.settle();
        // Whoever is told of everything is told of what has grown, too.
        if is_all && !was_all || is_grown && !is_all {
            self.reported_at = Tick(now.0.next_multiple_of(self.every));
        }
        let is_new = !gone.is_empty() || !areas.is_empty() || !avatars.is_empty();
        (is_new.then_some(Watch { areas, gone, avatars }), turned)
    }
}

impl Leader {
    /// Notes what a client wants to hear of. The replication is told when what is there has been reported.
    pub(super) fn watch(&mut self, client: ClientId, area: Option<Area>) {
        self.watching.turned.insert(client, area);
        if self.completed().is_none() {
            // With the first tick of a view everything is reported.
            self.news.interested(client, area);
        }
    }

    /// Notes where an avatar is.
    pub(super) fn watch_avatar(&mut self, avatar: &SharedState) {
        let area = avatar.id.client().and_then(|client| self.interests.get(&client));
        if area.is_some_and(Option::is_some) {
            self.watching.see(avatar);
        }
    }

    /// Returns whether members have reported all of their bodies as they are.
    pub(super) fn knows_all(&self) -> bool {
        self.watching.coverage.is_all() && self.is_reported()
    }

    fn is_reported(&self) -> bool {
        self.completed().is_some_and(|completed| self.watching.reported_at <= completed)
    }

    pub(super) fn unwatch(&mut self, client: ClientId) {
        self.watching.leave(client);
    }

    /// Tells the replication the interests whose bodies are all reported; after the last tick, all interests.
    pub(super) fn tell_interests(&mut self, is_last: bool) {
        let completed = self.completed();
        while let Some(first) = self.watching.waiting.first_entry()
            && (is_last || completed.is_some_and(|completed| first.key().0 <= completed))
        {
            let ((_, client), area) = first.remove_entry();
            self.news.interested(client, area);
        }
        if is_last {
            let turned = std::mem::take(&mut self.watching.turned);
            turned.into_iter().for_each(|(client, area)| self.news.interested(client, area));
        }
    }

    /// Returns what members are to be told with the tick that begins. While there are other groups, which are
    /// told of everything, everything is looked at.
    pub(super) fn next_watch(&mut self) -> Option<WorldOp> {
        if self.inter_group.is_some() {
            self.watching.turned.insert(ClientId::NOBODY, None);
        } else if self.watching.coverage.knows(ClientId::NOBODY) {
            self.watching.left.insert(ClientId::NOBODY);
        }
        let with_areas = self.watching.turned.iter().filter(|(_, area)| area.is_some());
        for client in with_areas.map(|(&client, _)| client).collect::<Vec<_>>() {
            let own = BodyId::avatar(client, 0)..=BodyId::avatar(client, u32::MAX);
            self.latest.range(own).for_each(|(_, (avatar, _))| self.watching.see(avatar));
        }
        let (watch, turned) = self.watching.take(self.tick);
        for (client, area) in turned.into_iter().filter(|(client, _)| *client != ClientId::NOBODY) {
            match self.is_reported() {
                true => self.news.interested(client, area),
                false => _ = self.watching.waiting.insert((self.watching.reported_at, client), area),
            }
        }
        watch.map(WorldOp::Watch)
    }
}
