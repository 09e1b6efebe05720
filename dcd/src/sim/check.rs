//! Invariant I (fault table of the design): every body has exactly one owner, at its highest epoch; none lost, none doubled.

use std::collections::{BTreeMap, BTreeSet};

use super::StandIn;
use crate::protocol::{View, ViewNumber};
use crate::space::{BodyId, Epoch, NodeId, Tick};

/// What a run must never show.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Violation {
    /// Nobody owns it.
    #[error("{body} is owned by nobody after {tick}")]
    Lost {
        /// Which body.
        body: BodyId,
        /// After which tick.
        tick: Tick,
    },
    /// Two own it.
    #[error("{body} has more than one owner after {tick}")]
    Doubled {
        /// Which body.
        body: BodyId,
        /// After which tick.
        tick: Tick,
    },
    /// A replica has seen a later epoch than the owner's.
    #[error("a replica of {body} is newer than its owner after {tick}")]
    Outdated {
        /// Which body.
        body: BodyId,
        /// After which tick.
        tick: Tick,
    },
    /// An owner's epoch went down.
    #[error("{body} went back from {before} to {after} after {tick}")]
    WentBack {
        /// Which body.
        body: BodyId,
        /// Its earlier epoch.
        before: Epoch,
        /// Its epoch now.
        after: Epoch,
        /// After which tick.
        tick: Tick,
    },
    /// Members took unequal numbers of rounds, or not the most that any of them had wanted.
    #[error("{tick} took {taken:?} rounds, where {wanted} were wanted")]
    Rounds {
        /// Which tick.
        tick: Tick,
        /// What members took.
        taken: Vec<u32>,
        /// The most that a member wanted after the tick before.
        wanted: u32,
    },
}

#[derive(Clone, Debug, Default)]
struct Snapshot {
    nodes: BTreeSet<NodeId>,
    rounds: BTreeSet<u32>,
    wanted: u32,
    owned: Vec<(BodyId, Epoch)>,
    replicas: Vec<(BodyId, Epoch)>,
}

/// Collects what every member holds after each tick and checks it when all have completed that tick.
#[derive(Clone, Debug, Default)]
pub struct Checker {
    expected: BTreeSet<BodyId>,
    snapshots: BTreeMap<(ViewNumber, Tick), Snapshot>,
    epochs: BTreeMap<BodyId, Epoch>,
    /// After the last tick that was checked: in which view, and how many rounds members want.
    wanted: Option<(ViewNumber, Tick, u32)>,
    owned: usize,
    last: Tick,
    checked: u64,
}

impl Checker {
    /// These bodies must be there at all times.
    pub fn new(expected: impl IntoIterator<Item = BodyId>) -> Self {
        Self { expected: expected.into_iter().collect(), ..Self::default() }
    }

    /// How many ticks have been checked as a whole.
    pub fn checked(&self) -> u64 {
        self.checked
    }

    /// The newest tick that has been checked as a whole.
    pub fn last(&self) -> Tick {
        self.last
    }

    /// How many bodies were owned after it.
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// A member has died: what it gave away in a tick that others have not completed may be lost until the next view.
    pub fn died(&mut self) {
        self.snapshots.clear();
    }

    /// A member has completed a tick of this view.
    pub fn settled(
        &mut self,
        node: NodeId,
        view: &View,
        tick: Tick,
        physics: &StandIn,
    ) -> Result<(), Violation> {
        let key = (view.number, tick);
        let snapshot = self.snapshots.entry(key).or_default();
        snapshot.nodes.insert(node);
        snapshot.rounds.insert(physics.rounds());
        snapshot.wanted = snapshot.wanted.max(physics.rounds_wanted());
        snapshot.owned.extend(physics.claims().iter().map(|claim| (claim.id, claim.epoch)));
        snapshot.replicas.extend(physics.replicas());
        if snapshot.nodes.len() < view.members.len() {
            return Ok(());
        }
        let snapshot = self.snapshots.remove(&key).unwrap_or_default();
        self.snapshots.retain(|&other, _| other > key);
        self.check_rounds(key, &snapshot)?;
        self.check(tick, snapshot)
    }

    fn check_rounds(
        &mut self,
        (view, tick): (ViewNumber, Tick),
        snapshot: &Snapshot,
    ) -> Result<(), Violation> {
        let before = self.wanted.replace((view, tick, snapshot.wanted));
        match before {
            Some((seen, before, wanted))
                if (seen, before.next()) == (view, tick) && snapshot.rounds != BTreeSet::from([wanted]) =>
            {
                let taken = snapshot.rounds.iter().copied().collect();
                Err(Violation::Rounds { tick, taken, wanted })
            }
            _ => Ok(()),
        }
    }

    fn check(&mut self, tick: Tick, snapshot: Snapshot) -> Result<(), Violation> {
        let mut owned = BTreeMap::new();
        for (body, epoch) in snapshot.owned {
            if owned.insert(body, epoch).is_some() {
                return Err(Violation::Doubled { body, tick });
            }
        }
        if let Some(&body) = self.expected.iter().find(|id| !owned.contains_key(id)) {
            return Err(Violation::Lost { body, tick });
        }
        for (body, epoch) in snapshot.replicas {
            match owned.get(&body) {
                None => return Err(Violation::Lost { body, tick }),
                Some(&owner) if owner < epoch => return Err(Violation::Outdated { body, tick }),
                Some(_) => {}
            }
        }
        for (&body, &after) in &owned {
            let before = self.epochs.insert(body, after).unwrap_or_default();
            if after < before {
                return Err(Violation::WentBack { body, before, after, tick });
            }
        }
        self.owned = owned.len();
        self.last = tick;
        self.checked += 1;
        Ok(())
    }
}
