//! Measures how far apart the copies of a body are: between groups after the same tick, and inside a group
//! between owner and ghost.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Sample, Sim};
use crate::cluster::deviation_m;
use crate::protocol::{ViewNumber, WorldPose};
use crate::space::{BodyId, GroupId, Tick};

/// The most ticks that wait for samples. Groups are some tenths of a second apart.
const KEPT: usize = 64;

/// The deviation of a body in a group that is not authoritative for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// The group.
    pub group: GroupId,
    /// The body.
    pub body: BodyId,
    /// The distance from its position in the authoritative group, metres.
    pub by_m: f64,
}

/// The deviations after one tick.
#[derive(Clone, Debug, Default)]
pub struct Deviating {
    /// Deviations of persistent bodies, in every group but the authoritative one.
    pub bodies: Vec<Apart>,
    /// Deviations of avatars, likewise.
    pub avatars: Vec<Apart>,
    /// Distances of ghosts from their owners, in every group, metres.
    pub ghosts: Vec<f64>,
    /// The number of persistent bodies for which another group than the main one is authoritative.
    pub claimed: usize,
    /// The time between the first group's and the last group's completion of the tick.
    pub apart: Duration,
}

#[derive(Clone, Debug, Default)]
struct Group {
    view: ViewNumber,
    /// The number of members whose samples are still to come.
    missing: usize,
    time: Duration,
    owned: BTreeMap<BodyId, WorldPose>,
    ghosts: Vec<(BodyId, WorldPose)>,
}

/// A collector that combines the samples of nodes of all groups after the same tick.
#[derive(Clone, Debug)]
pub struct Comparer {
    groups: usize,
    ticks: BTreeMap<Tick, BTreeMap<GroupId, Group>>,
}

impl Comparer {
    /// Creates a comparer for this number of groups.
    pub fn new(groups: usize) -> Self {
        Self { groups, ticks: BTreeMap::new() }
    }

    /// Takes the simulation's samples. Returns the deviations of the ticks that all groups have completed by
    /// now.
    pub fn compare(&mut self, sim: &mut Sim) -> Vec<Deviating> {
        for Sample { time, group, view, members, tick, owned, ghosts, .. } in sim.take_samples() {
            let group = self.ticks.entry(tick).or_default().entry(group).or_default();
            if group.view != view {
                // The next view begins with the last tick of the view before.
                *group = Group { view, missing: members, ..Group::default() };
            }
            group.missing = group.missing.saturating_sub(1);
            group.time = time;
            group.owned.extend(owned.into_iter().map(|(id, state)| (id, state.pose)));
            group.ghosts.extend(ghosts);
        }
        let is_complete = |groups: &BTreeMap<GroupId, Group>| {
            groups.len() == self.groups && groups.values().all(|group| group.missing == 0)
        };
        let complete: Vec<_> =
            self.ticks.iter().filter(|(_, groups)| is_complete(groups)).map(|(&tick, _)| tick).collect();
        let mut compared = Vec::new();
        for tick in complete {
            let groups = self.ticks.remove(&tick).unwrap_or_default();
            self.ticks.retain(|&other, _| other > tick);
            compared.push(deviating(&groups, |id| sim.server().authoritative(id)));
        }
        while self.ticks.len() > KEPT {
            self.ticks.pop_first();
        }
        compared
    }
}

fn deviating(groups: &BTreeMap<GroupId, Group>, authoritative: impl Fn(BodyId) -> GroupId) -> Deviating {
    let times = || groups.values().map(|group| group.time);
    let apart = times().max().unwrap_or_default() - times().min().unwrap_or_default();
    let mut all = Deviating { apart, ..Deviating::default() };
    for (&id, group) in groups {
        for (body, pose) in &group.ghosts {
            all.ghosts.extend(group.owned.get(body).map(|owner| deviation_m(pose, owner)));
        }
        for (&body, pose) in &group.owned {
            let authority = authoritative(body);
            let other = groups.get(&authority).filter(|_| authority != id);
            let Some(other) = other.and_then(|group| group.owned.get(&body)) else { continue };
            let apart = Apart { group: id, body, by_m: deviation_m(pose, other) };
            match body.client() {
                Some(_) => all.avatars.push(apart),
                None => all.bodies.push(apart),
            }
        }
    }
    let main = authoritative(BodyId::persistent(u32::MAX));
    let ids = groups.values().next().into_iter().flat_map(|group| group.owned.keys());
    all.claimed = ids.filter(|id| id.client().is_none() && authoritative(**id) != main).count();
    all
}
