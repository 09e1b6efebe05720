//! How far copies of a body are apart: between groups after the same tick, and inside a group between owner and replica.

use std::collections::BTreeMap;
use std::time::Duration;

use dcd::cluster::deviation_m;
use dcd::protocol::WorldPose;
use dcd::sim::{Sample, Sim};
use dcd::space::{BodyId, GroupId, Tick};

use super::scene::{GROUPS, MEMBERS};

/// Deviations after one tick, metres.
#[derive(Clone, Debug, Default)]
pub(super) struct Deviating {
    /// Of persistent bodies, in every group but the one that is believed about them.
    pub(super) bodies: Vec<f64>,
    /// The same of avatars.
    pub(super) avatars: Vec<f64>,
    /// Of replicas from their owners, in every group.
    pub(super) replicas: Vec<f64>,
    /// Persistent bodies about which another group than the main one is believed.
    pub(super) claimed: usize,
    /// Between the first group's and the last group's completion of the tick.
    pub(super) apart: Duration,
}

#[derive(Default)]
struct Group {
    nodes: u32,
    time: Duration,
    owned: BTreeMap<BodyId, WorldPose>,
    replicas: Vec<(BodyId, WorldPose)>,
}

/// Puts together what nodes of all groups held after the same tick.
#[derive(Default)]
pub(super) struct Comparer {
    ticks: BTreeMap<Tick, BTreeMap<GroupId, Group>>,
}

impl Comparer {
    /// Takes samples, and compares the ticks that are complete by now.
    pub(super) fn compare(&mut self, sim: &mut Sim) -> Vec<Deviating> {
        for Sample { time, group, tick, owned, replicas, .. } in sim.take_samples() {
            let group = self.ticks.entry(tick).or_default().entry(group).or_default();
            group.nodes += 1;
            group.time = group.time.max(time);
            group.owned.extend(owned.into_iter().map(|(id, state)| (id, state.pose)));
            group.replicas.extend(replicas);
        }
        let is_complete = |groups: &BTreeMap<GroupId, Group>| {
            groups.len() == GROUPS as usize && groups.values().all(|group| group.nodes == MEMBERS)
        };
        let complete: Vec<_> =
            self.ticks.iter().filter(|(_, groups)| is_complete(groups)).map(|(&tick, _)| tick).collect();
        let mut compared = Vec::new();
        for tick in complete {
            let groups = self.ticks.remove(&tick).unwrap_or_default();
            self.ticks.retain(|&other, _| other > tick);
            compared.push(deviating(&groups, |id| sim.server().believed(id)));
        }
        compared
    }
}

fn deviating(groups: &BTreeMap<GroupId, Group>, believed: impl Fn(BodyId) -> GroupId) -> Deviating {
    let times = || groups.values().map(|group| group.time);
    let apart = times().max().unwrap_or_default() - times().min().unwrap_or_default();
    let mut all = Deviating { apart, ..Deviating::default() };
    for (&id, group) in groups {
        for (body, pose) in &group.replicas {
            all.replicas.extend(group.owned.get(body).map(|owner| deviation_m(pose, owner)));
        }
        for (&body, pose) in &group.owned {
            let authority = believed(body);
            let deviation = groups
                .get(&authority)
                .filter(|_| authority != id)
                .and_then(|group| group.owned.get(&body))
                .map(|other| deviation_m(pose, other));
            match body.client() {
                Some(_) => all.avatars.extend(deviation),
                None => all.bodies.extend(deviation),
            }
        }
    }
    let main = believed(BodyId::persistent(u32::MAX));
    let ids = groups.values().next().into_iter().flat_map(|group| group.owned.keys());
    all.claimed = ids.filter(|id| id.client().is_none() && believed(**id) != main).count();
    all
}

/// Mean, 99th percentile and largest; zeros of nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    pub(super) mean_m: f64,
    pub(super) p99_m: f64,
    pub(super) max_m: f64,
}

impl Spread {
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<_> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let Some(&max_m) = values.last() else { return Self::default() };
        let rank = (values.len() * 99).div_ceil(100) - 1;
        Self { mean_m: values.iter().sum::<f64>() / values.len() as f64, p99_m: values[rank], max_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_a_hundred_may_be_above_the_99th_percentile() {
        let spread = Spread::of((1..=200).rev().map(f64::from));
        assert_eq!((spread.mean_m, spread.p99_m, spread.max_m), (100.5, 198.0, 200.0));
        assert_eq!(Spread::of([]).max_m, 0.0);
    }
}
