//! Chooses which of a group's regions are stepped in a tick (thesis 4.3.2.3): from what members say of their
//! regions after each tick, and from what clients look at, the leader decides which regions stay behind in
//! the next. All members are told.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::fidelity::{
    ATTENDED_TICKS, Fidelity, FidelityReport, Governed, Governor, LookedAt, RegionState, Schedule,
};
use crate::protocol::{Area, EnvironmentProperties, View, WorldOp};
use crate::space::{Allocation, BodyId, Cell, ClientId, DistributionTree, NodeId, RegionId, Tick, Viewpoint};

/// The choice of the regions that stay behind.
#[derive(Clone, Debug)]
pub(super) struct Scheduling {
    governor: Governor,
    /// The viewpoints of the world's own, which count whatever clients there are.
    viewpoints: Vec<Viewpoint>,
    dt_s: f32,
    allocation: Allocation,
    cells: BTreeMap<RegionId, Cell>,
    /// The state of each region, as told after the last tick.
    states: BTreeMap<RegionId, RegionState>,
    /// The region of which an island is audited in the present tick.
    audited: Option<RegionId>,
    /// The bodies that the server's program has moved of late, each with the last tick in which it did.
    attended: BTreeMap<BodyId, Tick>,
    /// Says whether all regions are stepped in the present tick: which region such a body is in is not known.
    attends: bool,
}

impl Scheduling {
    /// Returns the choice for a view; `None` where everything is computed in full in every tick.
    pub(super) fn new(view: &View, world: &EnvironmentProperties) -> Option<Self> {
        if world.fidelity == Fidelity::Off || world.protocol.lag_ticks() > 0 {
            return None;
        }
        let mut scheduling = Self {
            governor: Governor::new(world.fidelity),
            viewpoints: view.viewpoints.clone(),
            dt_s: world.step.dt_s,
            allocation: Allocation::new(),
            cells: BTreeMap::new(),
            states: BTreeMap::new(),
            audited: None,
            attended: BTreeMap::new(),
            attends: false,
        };
        scheduling.settle(&view.tree, &view.allocation);
        Some(scheduling)
    }

    /// Sets the world's own viewpoints, which count whatever clients there are.
    pub(super) fn look(&mut self, viewpoints: Vec<Viewpoint>) {
        self.viewpoints = viewpoints;
    }

    /// Takes in what the server's program does in a tick. The members keep the regions of bodies that it moves at
    /// the present for some ticks from then on.
    pub(super) fn attend(&mut self, tick: Tick, ops: &[WorldOp]) {
        self.attended.retain(|_, last| tick.0 < last.0 + u64::from(ATTENDED_TICKS));
        for body in ops.iter().filter_map(WorldOp::moves) {
            self.attends |= self.attended.insert(body, tick).is_none();
        }
    }

    /// Goes on with another tree: what was said of regions concerned those before.
    pub(super) fn settle(&mut self, tree: &DistributionTree, allocation: &Allocation) {
        self.allocation.clone_from(allocation);
        self.cells = tree.leaves().map(|region| (region, tree.cell(region))).collect();
        self.states.clear();
    }

    /// Takes in a member's regions after a tick, and how long the member has computed for it. Nobody is
    /// believed about others' regions, nor about an audit that was not asked for.
    pub(super) fn hear(&mut self, from: NodeId, computed: Duration, states: Vec<RegionState>) {
        let mut steps_ms = 0.0;
        for state in states {
            if self.allocation.get(&state.region) != Some(&from) {
                continue;
            }
            steps_ms += f64::from(state.took_ms);
            self.governor.note_spent(state.took_ms, state.full_ms);
            if let Some(audited) = state.audited
                && self.audited.take_if(|asked| *asked == state.region).is_some()
            {
                self.governor.note_audited(state.region, &audited);
            }
            self.states.insert(state.region, state);
        }
        self.governor.note_tick(u64::from(from.0), computed.as_secs_f64() * 1e3, steps_ms);
    }

    /// Chooses the regions that stay behind in a tick. `interests` are the areas that clients look at (`None`
    /// among them is everything), `avatars` the places of avatars. Without a client, and without a viewpoint
    /// of the world's own, nobody looks. `interests` is `None` if nobody knows what is looked at; everything
    /// is then computed in full.
    pub(super) fn schedule(
        &mut self,
        tick: Tick,
        interests: Option<&BTreeMap<ClientId, Option<Area>>>,
        avatars: impl Iterator<Item = [f64; 3]>,
    ) -> Schedule {
        self.governor.end_tick();
        self.governor.look(interests.map_or(LookedAt::All, |interests| self.looked_at(interests, avatars)));
        // Nothing is taken for granted about a region whose state was not told, as in the first tick of a
        // view or of a tree.
        let mut told = std::mem::take(&mut self.states);
        let known = |&region| told.remove(&region).unwrap_or(RegionState::unknown(region));
        let states: Vec<_> = self.cells.keys().map(known).collect();
        let regions = states.iter().zip(&self.cells).map(|(state, (region, cell))| Governed {
            state,
            cell: *cell,
            by: self.allocation.get(region).map_or(0, |node| u64::from(node.0)),
        });
        let mut schedule = self.governor.schedule(tick, &regions.collect::<Vec<_>>(), self.dt_s);
        if std::mem::take(&mut self.attends) || interests.is_none() {
            // How far regions look ahead stays as it is, so that regions may lag again in the next tick, or as
            // soon as the interests are known.
            schedule.behind.clear();
        }
        self.audited = schedule.audit.map(|pick| pick.region);
        schedule
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

    /// Returns what lower rates save and cost.
    pub(super) fn report(&self) -> FidelityReport {
        self.governor.report()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fidelity::Audited;
    use crate::protocol::{Member, Push, ViewNumber};
    use crate::sim::sim_world;
    use crate::space::GroupId;

    const HONEST: NodeId = NodeId(1);
    const OTHER: NodeId = NodeId(2);

    fn scheduling(fidelity: Fidelity) -> Scheduling {
        let world = EnvironmentProperties { fidelity, ..sim_world(2) };
        let member = |node| Member { node, address: ([127, 0, 0, 1], 1).into(), client: None };
        let view = View {
            group: GroupId(1),
            number: ViewNumber(1),
            tick: Tick(0),
            leader: HONEST,
            members: [HONEST, OTHER].map(member).into(),
            tree: world.tree.clone(),
            allocation: world.tree.leaves().zip([HONEST, OTHER]).collect(),
            events: false,
            viewpoints: Vec::new(),
        };
        Scheduling::new(&view, &world).expect("not all is computed in full")
    }

    /// Has both members tell the states of their regions after a tick, and chooses for a tick.
    fn tick(scheduling: &mut Scheduling, tick: u64, of: impl Fn(RegionState) -> RegionState) -> Schedule {
        for (region, node) in scheduling.allocation.clone() {
            let state = RegionState { urgent: false, awake: 1_000, ..RegionState::unknown(region) };
            scheduling.hear(node, Duration::from_millis(1), vec![of(state)]);
        }
        scheduling.schedule(Tick(tick), Some(&BTreeMap::new()), std::iter::empty())
    }

    #[test]
    fn what_is_not_told_of_a_region_leaves_others_behind_but_never_that_one() {
        let mut scheduling = scheduling(Fidelity::Tolerance { m_s: 1e6 });
        let [one, other] = [0, 1].map(|at| *scheduling.allocation.keys().nth(at).unwrap());
        let behind: Vec<_> = (1..200).map(|at| tick(&mut scheduling, at, |state| state).behind).collect();
        assert!(behind[..32].iter().all(Vec::is_empty), "levels need some time");
        assert!([one, other].iter().all(|region| behind[100..].iter().any(|tick| tick.contains(region))));
        for at in 200..240 {
            scheduling.hear(
                HONEST,
                Duration::ZERO,
                vec![RegionState { urgent: false, ..RegionState::unknown(one) }],
            );
            let behind = scheduling.schedule(Tick(at), Some(&BTreeMap::new()), std::iter::empty()).behind;
            assert!(!behind.contains(&other));
        }
        let unknown = scheduling.schedule(Tick(240), None, std::iter::empty());
        assert!(unknown.behind.is_empty(), "nobody knows");
        assert_eq!(unknown.behind_most, scheduling.governor.behind_most());
        assert!(unknown.behind_most > 0, "what may lag in the next tick is looked ahead for");
    }

    #[test]
    fn what_the_program_moves_for_the_first_time_in_a_while_lets_no_region_stay_behind() {
        let mut scheduling = scheduling(Fidelity::Tolerance { m_s: 1e6 });
        let push = [WorldOp::Push(Push::impulse(BodyId::persistent(1), [1.0, 0.0, 0.0]))];
        let mut all_step = Vec::new();
        for at in 1..300 {
            let moves = (200..220).contains(&at) || (226..240).contains(&at) || at == 247 || at == 255;
            scheduling.attend(Tick(at), if moves { &push[..] } else { &[] });
            let behind = tick(&mut scheduling, at, |state| state).behind;
            all_step.extend((at >= 200 && behind.is_empty()).then_some(at));
        }
        // Members keep the region at the present for eight ticks after each push.
        assert_eq!(all_step, [200, 247, 255]);
    }

    #[test]
    fn an_audit_that_was_not_asked_for_and_a_word_about_others_regions_count_for_nothing() {
        let mut scheduling = scheduling(Fidelity::Tolerance { m_s: 1e6 });
        let lie = Some(Audited { error_m_s: Some(1e6), cost: 1e6 });
        let mut asked = 0;
        for at in 1..400 {
            let picked = scheduling.audited;
            asked += u64::from(picked.is_some());
            let found = Some(Audited { error_m_s: Some(0.1), cost: 100.0 });
            tick(&mut scheduling, at, |state| RegionState {
                audited: if picked == Some(state.region) { found } else { lie },
                ..state
            });
            let others = *scheduling.allocation.iter().find(|(_, node)| **node == HONEST).unwrap().0;
            scheduling.hear(
                OTHER,
                Duration::ZERO,
                vec![RegionState { took_ms: 1e6, ..RegionState::unknown(others) }],
            );
        }
        let report = scheduling.report();
        assert!(asked > 20 && report.audits == asked, "{asked}: {report:?}");
        assert!((report.error_m_s - 0.1).abs() < 1e-6 && report.share_of_full_time == 1.0, "{report:?}");
    }
}
