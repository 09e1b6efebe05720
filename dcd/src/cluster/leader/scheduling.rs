//! Chooses which of a group's regions are stepped in a tick (thesis 4.3.2.3): from what members say of theirs after each tick, and from what clients look at, the leader
//! decides which stay behind in the next; all members are told.

use std::collections::BTreeMap;

use crate::fidelity::{Fidelity, FidelityReport, Governed, Governor, LookedAt, RegionState, Schedule};
use crate::protocol::{Area, EnvironmentProperties, View};
use crate::space::{Allocation, Cell, ClientId, DistributionTree, NodeId, RegionId, Tick, Viewpoint};

/// The choice of the regions that stay behind.
#[derive(Clone, Debug)]
pub(super) struct Scheduling {
    governor: Governor,
    /// Where the world is looked at from, whoever is there.
    viewpoints: Vec<Viewpoint>,
    dt_s: f32,
    allocation: Allocation,
    cells: BTreeMap<RegionId, Cell>,
    /// By region, as last told.
    states: BTreeMap<RegionId, RegionState>,
    /// How long the steps of each member's regions took in the tick that is being completed, milliseconds.
    took_ms: BTreeMap<NodeId, f64>,
}

impl Scheduling {
    /// Returns the choice for a view; `None` where all is computed in full in every tick.
    pub(super) fn new(view: &View, world: &EnvironmentProperties) -> Option<Self> {
        if world.fidelity == Fidelity::Off || world.protocol.lag_ticks() > 0 {
            return None;
        }
        let mut scheduling = Self {
            governor: Governor::new(world.fidelity),
            viewpoints: world.viewpoints.clone(),
            dt_s: world.step.dt_s,
            allocation: Allocation::new(),
            cells: BTreeMap::new(),
            states: BTreeMap::new(),
            took_ms: BTreeMap::new(),
        };
        scheduling.settle(&view.tree, &view.allocation);
        Some(scheduling)
    }

    /// Goes on with another tree: what was said of regions is of those before.
    pub(super) fn settle(&mut self, tree: &DistributionTree, allocation: &Allocation) {
        self.allocation.clone_from(allocation);
        self.cells = tree.leaves().map(|region| (region, tree.cell(region))).collect();
        self.states.clear();
    }

    /// Takes in what a member says of its regions after a tick.
    pub(super) fn hear(&mut self, from: NodeId, states: Vec<RegionState>) {
        for state in states {
            if self.allocation.get(&state.region) != Some(&from) {
                continue;
            }
            self.governor.note_spent(state.took_ms, state.full_ms);
            *self.took_ms.entry(from).or_default() += f64::from(state.took_ms);
            state.audited.iter().for_each(|audited| self.governor.note_audited(state.region, audited));
            self.states.insert(state.region, state);
        }
    }

    /// Chooses which regions stay behind in a tick, in which clients look at these areas, or at all, and play where these avatars are. Without a client, and without a
    /// viewpoint of the world's own, nobody looks.
    pub(super) fn schedule(
        &mut self,
        tick: Tick,
        interests: &BTreeMap<ClientId, Option<Area>>,
        avatars: impl Iterator<Item = [f64; 3]>,
    ) -> Schedule {
        let slowest_ms = std::mem::take(&mut self.took_ms).into_values().fold(0.0, f64::max);
        self.governor.note_time(slowest_ms);
        // The first tick of a view, or of a tree.
        if !self.states.keys().eq(self.cells.keys()) {
            return Schedule::default();
        }
        self.governor.look(self.looked_at(interests, avatars));
        let regions = self.states.values().zip(&self.cells).map(|(state, (region, cell))| Governed {
            state,
            cell: *cell,
            by: self.allocation.get(region).map_or(0, |node| u64::from(node.0)),
        });
        self.governor.schedule(tick, &regions.collect::<Vec<_>>(), self.dt_s)
    }

    fn looked_at(
        &self,
        interests: &BTreeMap<ClientId, Option<Area>>,
        avatars: impl Iterator<Item = [f64; 3]>,
    ) -> LookedAt {
        let of_clients = interests
            .values()
            .map(|area| area.map(|Area { centre, radius_m }| Viewpoint { at: centre, radius_m }));
        match of_clients.collect::<Option<Vec<_>>>() {
            None => LookedAt::All,
            Some(of_clients) => {
                let played = avatars.map(|at| Viewpoint { at, radius_m: 0.0 });
                LookedAt::From(self.viewpoints.iter().copied().chain(of_clients).chain(played).collect())
            }
        }
    }

    /// Returns what it saves and costs.
    pub(super) fn report(&self) -> FidelityReport {
        self.governor.report()
    }
}
