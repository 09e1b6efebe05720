//! Checks the invariants of a cluster while it runs.
//!
//! Invariant I: in each group every body has exactly one owner, at its highest epoch; no body is lost, none
//! is doubled. Further invariants: no state goes back in time, neither in a group nor at a node nor at a
//! client. A node that computes a view that is over holds nothing at an epoch that would beat its successors'
//! epochs.

mod violation;

use std::collections::{BTreeMap, BTreeSet};

use super::Engine;
use crate::cluster::Client;
use crate::protocol::{Border, View, ViewNumber};
use crate::space::{BodyId, ClientId, Epoch, GroupId, NodeId, Tick};

pub use violation::Violation;

/// The bodies that the members of a view held after a tick, as far as they have completed it.
#[derive(Clone, Debug, Default)]
struct Snapshot {
    nodes: BTreeSet<NodeId>,
    rounds: BTreeSet<u32>,
    wanted: u32,
    owned: Vec<(BodyId, Epoch)>,
    ghosts: Vec<(BodyId, Epoch)>,
}

/// The state of a group as far as it has been checked.
#[derive(Clone, Debug, Default)]
struct Checked {
    /// The newest view in which a tick has been checked.
    view: ViewNumber,
    tick: Tick,
    epochs: BTreeMap<BodyId, Epoch>,
    /// The last checked tick, its view, and how many rounds members want for the next tick.
    wanted: Option<(ViewNumber, Tick, u32)>,
    /// Transfers to new owners that were sent in a tick and have not arrived.
    flights: BTreeMap<(ViewNumber, Tick), Flight>,
}

/// The last state of a body that a client has seen.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    at: (Epoch, Tick),
    /// Says whether it was seen in a group that the client was in before. Then the first state of the present
    /// group counts, whatever it is.
    elsewhere: bool,
}

/// The bodies that one node has sent another to own, with their epochs.
type Flight = BTreeMap<(NodeId, NodeId), Vec<(BodyId, Epoch)>>;

/// A collector of what every member holds after each tick. It checks a tick when all members have completed
/// it.
#[derive(Clone, Debug, Default)]
pub struct Checker {
    expected: BTreeSet<BodyId>,
    /// The number of ticks after which messages of members are applied.
    lag: u64,
    groups: BTreeMap<GroupId, Checked>,
    /// The group of each view.
    views: BTreeMap<ViewNumber, GroupId>,
    /// Views whose last tick was completed by some members alone. Transfers that others sent in that tick may
    /// be lost until the next view.
    crippled: BTreeSet<ViewNumber>,
    snapshots: BTreeMap<(ViewNumber, Tick), Snapshot>,
    /// The newest epochs of bodies that each node has seen, with the group that it is in.
    nodes: BTreeMap<NodeId, (GroupId, BTreeMap<BodyId, Epoch>)>,
    /// The newest epochs that each client has seen, with the group that it is in.
    clients: BTreeMap<ClientId, (Option<GroupId>, BTreeMap<BodyId, Seen>)>,
    owned: usize,
    last: Tick,
    rewound: u64,
    checked: u64,
}

impl Checker {
    /// Creates a checker for bodies that must exist at all times: owned, or on their way to a new owner for
    /// up to `lag` ticks.
    pub fn new(expected: impl IntoIterator<Item = BodyId>, lag: u64) -> Self {
        Self { expected: expected.into_iter().collect(), lag, ..Self::default() }
    }

    /// Returns the number of ticks that have been checked as a whole.
    pub fn checked(&self) -> u64 {
        self.checked
    }

    /// Returns the largest number of ticks that a group went back because nobody was left who had computed
    /// them.
    pub fn rewound(&self) -> u64 {
        self.rewound
    }

    /// Returns the newest tick of any group that has been checked as a whole.
    pub fn last(&self) -> Tick {
        self.last
    }

    /// Returns the number of bodies owned after the tick that was checked last.
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// Returns the newest view and tick of a group that have been checked as a whole.
    pub fn progress(&self, group: GroupId) -> Option<(ViewNumber, Tick)> {
        self.groups.get(&group).map(|checked| (checked.view, checked.tick))
    }

    /// Returns the bodies of a group after the tick that was checked last.
    pub fn bodies(&self, group: GroupId) -> impl Iterator<Item = BodyId> {
        self.groups.get(&group).into_iter().flat_map(|checked| checked.epochs.keys().copied())
    }

    /// Returns the group of a view.
    pub(super) fn group_of(&self, view: ViewNumber) -> Option<GroupId> {
        self.views.get(&view).copied()
    }

    /// Notes that a view begins.
    pub(super) fn began(&mut self, group: GroupId, view: ViewNumber) {
        self.views.insert(view, group);
    }

    /// Notes the transfers that one member sends another, perhaps repeatedly.
    pub(super) fn sends(&mut self, from: NodeId, to: NodeId, border: &Border) {
        let transfers: Vec<_> = border
            .messages
            .iter()
            .flat_map(|message| &message.transfers)
            .map(|transfer| (transfer.body.id, transfer.body.epoch))
            .collect();
        let group = self.views.get(&border.view).filter(|_| self.lag > 0 && !transfers.is_empty());
        if let Some(checked) = group.and_then(|group| self.groups.get_mut(group)) {
            checked.flights.entry((border.view, border.tick)).or_default().insert((from, to), transfers);
        }
    }

    /// Notes that some members of a view complete its last tick without the others.
    pub(super) fn crippled(&mut self, view: ViewNumber) {
        if self.crippled.insert(view) {
            self.snapshots.retain(|&(of, _), _| of != view);
        }
    }

    /// Forgets what a node knew, because it begins anew or is gone.
    pub(super) fn forget_node(&mut self, node: NodeId) {
        self.nodes.remove(&node);
    }

    /// Forgets what a client knew.
    pub(super) fn forget_client(&mut self, client: ClientId) {
        self.clients.remove(&client);
    }

    /// Checks the states that a client was sent.
    pub(super) fn told(&mut self, client: &Client) -> Result<(), Violation> {
        let (group, seen) = self.clients.entry(client.id()).or_default();
        if std::mem::replace(group, client.group()) != client.group() {
            seen.values_mut().for_each(|seen| seen.elsewhere = true);
        }
        for view in client.bodies().filter(|view| !view.speculative) {
            let (id, at) = (view.body.id, (view.body.epoch, view.tick));
            let now = Seen { at, elsewhere: false };
            match seen.insert(id, now) {
                Some(before) if before.elsewhere && before.at == at => {
                    seen.insert(id, before);
                }
                Some(before) if !before.elsewhere && at < before.at => {
                    let (before, after) = (before.at, at);
                    return Err(Violation::ClientWentBack { client: client.id(), body: id, before, after });
                }
                _ => {}
            }
        }
        seen.retain(|&id, _| client.body(id).is_some());
        Ok(())
    }

    /// Checks a tick of this view that a member has completed.
    pub fn settled(
        &mut self,
        node: NodeId,
        view: &View,
        tick: Tick,
        physics: &dyn Engine,
    ) -> Result<(), Violation> {
        let claims: Vec<_> = physics.claims().iter().map(|claim| (claim.id, claim.epoch)).collect();
        let ghosts: Vec<_> = physics.ghosts().into_iter().map(|(id, epoch, _)| (id, epoch)).collect();
        let Some(&group) = self.views.get(&view.number) else { return Ok(()) };
        self.check_node(node, group, tick, claims.iter().chain(&ghosts).copied())?;
        let checked = self.groups.entry(group).or_default();
        if view.number < checked.view {
            let beats =
                |(id, epoch): &&(BodyId, Epoch)| checked.epochs.get(id).is_some_and(|newest| epoch >= newest);
            return match claims.iter().find(beats) {
                Some(&(body, epoch)) => {
                    Err(Violation::Overreach { node, body, epoch, present: checked.epochs[&body] })
                }
                None => Ok(()),
            };
        }
        if self.crippled.contains(&view.number) {
            return Ok(());
        }
        let key = (view.number, tick);
        let snapshot = self.snapshots.entry(key).or_default();
        snapshot.nodes.insert(node);
        snapshot.rounds.insert(physics.rounds());
        snapshot.wanted = snapshot.wanted.max(physics.rounds_wanted());
        snapshot.owned.extend(claims);
        snapshot.ghosts.extend(ghosts);
        if snapshot.nodes.len() < view.members.len() {
            return Ok(());
        }
        let snapshot = self.snapshots.remove(&key).unwrap_or_default();
        let views = &self.views;
        self.snapshots.retain(|&other, _| other > key || views.get(&other.0) != Some(&group));
        self.check_rounds(group, key, &snapshot)?;
        self.check(group, view, tick, snapshot)
    }

    fn check_node(
        &mut self,
        node: NodeId,
        group: GroupId,
        tick: Tick,
        held: impl Iterator<Item = (BodyId, Epoch)>,
    ) -> Result<(), Violation> {
        // Among several copies in regions of one node, the newest counts.
        let mut present: BTreeMap<BodyId, Epoch> = BTreeMap::new();
        for (body, epoch) in held {
            let newest = present.entry(body).or_default();
            *newest = epoch.max(*newest);
        }
        let (in_group, seen) = self.nodes.entry(node).or_default();
        if std::mem::replace(in_group, group) != group {
            // Each group has its own epochs.
            seen.clear();
        }
        for (body, after) in present {
            let before = seen.insert(body, after).unwrap_or_default();
            if after < before {
                return Err(Violation::NodeWentBack { node, body, before, after, tick });
            }
        }
        Ok(())
    }

    fn check_rounds(
        &mut self,
        group: GroupId,
        (view, tick): (ViewNumber, Tick),
        snapshot: &Snapshot,
    ) -> Result<(), Violation> {
        // Members that are not in lockstep cannot exchange within a tick.
        let wanted = if self.lag == 0 { snapshot.wanted } else { 1 };
        let checked = self.groups.entry(group).or_default();
        match checked.wanted.replace((view, tick, wanted)) {
            Some((seen, before, wanted))
                if (seen, before.next()) == (view, tick) && snapshot.rounds != BTreeSet::from([wanted]) =>
            {
                let taken = snapshot.rounds.iter().copied().collect();
                Err(Violation::Rounds { tick, taken, wanted })
            }
            _ => Ok(()),
        }
    }

    fn check(
        &mut self,
        group: GroupId,
        view: &View,
        tick: Tick,
        snapshot: Snapshot,
    ) -> Result<(), Violation> {
        let mut owned = BTreeMap::new();
        let checked = self.groups.entry(group).or_default();
        for (body, epoch) in snapshot.owned.into_iter().chain(checked.flying(view, tick, self.lag)) {
            if owned.insert(body, epoch).is_some() {
                return Err(Violation::Doubled { body, tick });
            }
        }
        if let Some(&body) = self.expected.iter().find(|id| !owned.contains_key(id)) {
            return Err(Violation::Lost { body, tick });
        }
        for (body, epoch) in snapshot.ghosts {
            match owned.get(&body) {
                None => return Err(Violation::Lost { body, tick }),
                Some(&owner) if owner < epoch => return Err(Violation::Outdated { body, tick }),
                Some(_) => {}
            }
        }
        for (&body, &after) in &owned {
            let before = checked.epochs.get(&body).copied().unwrap_or_default();
            if after < before {
                return Err(Violation::WentBack { body, before, after, tick });
            }
        }
        self.owned = owned.len();
        let rewound = checked.tick.0.saturating_sub(tick.0);
        (checked.view, checked.tick, checked.epochs) = (view.number, tick, owned);
        self.last = self.last.max(tick);
        self.rewound = self.rewound.max(rewound);
        self.checked += 1;
        Ok(())
    }
}

impl Checked {
    /// Returns the bodies in transfer after a tick, and forgets those that have arrived.
    fn flying(&mut self, view: &View, tick: Tick, lag: u64) -> impl Iterator<Item = (BodyId, Epoch)> {
        // Messages written when a view begins are applied at once.
        let arrived = Tick(tick.0.saturating_sub(lag)).max(view.tick);
        self.flights.retain(|&flight, _| flight > (view.number, arrived));
        let flights = self.flights.range(..=(view.number, tick));
        flights.flat_map(|(_, flight)| flight.values().flatten().copied())
    }
}
