//! How regions that hold the same body agree on it: the one place where regions meet.
//!
//! Before each (micro-)step a region *prepares* what it shares; after it, every region *gathers* what it has to say into
//! one [`BorderMessage`] a neighbour, and then *applies* the messages of its neighbours in rank order. Values go in and
//! come out; who carries them (memory, a simulator, QUIC) is not known here.
//!
//! Two families: `owner` and `proxy` hold copies of all that comes near a border (`halo`) and let the owner's word
//! stand. `overlap`, `island` and `auto` hold copies of what touches (`nearby`, `reach`, `membership`): of islands that may be in
//! one region (`island`) whole ones, of which the best informed region's count; of others each has its share of the mass
//! (`share`), and their means count (`agree`).

mod auto;
mod consensus;
mod ghosts;
mod halo;
mod island;
mod membership;
mod overlap;
mod owner;
mod predicted_contacts;
mod proxy;
mod reach;
mod shared;

use rapier3d::prelude::RigidBodyHandle;
use serde::{Deserialize, Serialize};

use self::shared::SharedBodies;
use super::outbox::Outbox;
use super::partition::{OWNER_HYSTERESIS_M, Partition};
use super::rank_remap::RankRemap;
use super::region::{BodyRef, Region};
use super::settings::{Coupling, StepSettings};
use super::shapes::{ShapeError, ShapeLibrary};
use super::statics::Statics;
use crate::protocol::BorderMessage;
use crate::space::{RegionId, Tick};

/// A region with its side of its borders: what it keeps of them, and what it says to its neighbours.
#[derive(Serialize, Deserialize)]
pub(super) struct Side {
    pub region: Region,
    pub border: Border,
    pub outbox: Outbox,
}

impl Side {
    /// Of a region of a world that has these regions, which take so many substeps a tick at first.
    pub(super) fn new(region: Region, leaves: &std::sync::Arc<[RegionId]>, steps: usize) -> Self {
        let outbox = Outbox::new(region.id(), leaves.clone());
        Self { region, border: Border::new(leaves.len(), steps), outbox }
    }

    /// Substeps of the present tick.
    pub(super) fn steps(&self) -> usize {
        self.border.pace.steps_of(self.region.rank())
    }

    /// Substeps of the next tick.
    pub(super) fn steps_next(&self) -> usize {
        self.border.pace.next_of(self.region.rank())
    }

    /// Whether nothing here can change in the tick to come.
    pub(super) fn is_idle(&self) -> bool {
        self.region.is_idle() && !self.border.awaits_any() && self.border.pace.is_settled(self.region.rank())
    }

    /// Ranks have changed.
    pub(super) fn remap_ranks(&mut self, ranks: &RankRemap) {
        self.region.remap_ranks(ranks);
        self.border.remap_ranks(&self.region, ranks);
        self.outbox = Outbox::new(self.region.id(), ranks.leaves.clone());
    }

    /// Membership changed: all that is shared must be announced again.
    pub(super) fn forget_holders(&mut self, regions: usize, steps: usize) {
        self.region.forget_holders();
        self.border = Border::new(regions, steps);
    }
}

impl Coupling {
    /// Fills the outbox with what neighbours must hold of the bodies inserted since the last step.
    pub(super) fn announce(self, side: &mut Side, moment: Moment<'_>) {
        if self.shares_mass() {
            membership::announce(side, moment);
        } else {
            halo::announce(side, moment.partition, moment.tick, moment.dt_s);
        }
    }

    /// Before a step of the region.
    pub(super) fn prepare(self, region: &mut Region, dt_s: f32) {
        if self.shares_mass() {
            for place in 0..region.held_elsewhere_count() {
                region.prepare_copy(region.held_elsewhere_at(place).handle, dt_s);
            }
        }
    }

    /// Fills the outbox after a step.
    pub(super) fn gather(self, side: &mut Side, moment: Moment<'_>) {
        if moment.partition.len() == 1 {
            side.region.take_fresh();
        } else if self.shares_mass() {
            overlap::gather(side, moment);
        } else {
            owner::gather(side, moment.partition, moment.tick, moment.dt_s);
        }
    }

    /// Takes in what the neighbours said, in rank order.
    pub(super) fn apply<'a>(
        self,
        side: &mut Side,
        inbox: impl Iterator<Item = &'a BorderMessage> + Clone,
        ground: Ground<'_>,
        moment: Moment<'_>,
    ) -> Result<(), ShapeError> {
        match self {
            Self::Owner => owner::apply(side, inbox, ground),
            Self::Proxy => proxy::apply(side, inbox, ground),
            Self::Overlap | Self::Island | Self::Auto => overlap::apply(side, inbox, ground, moment),
        }
    }
}

/// What a region keeps for its borders from one exchange to the next.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Border {
    /// What is known of each body that other regions hold too.
    shared: SharedBodies,
    predicted: predicted_contacts::PredictedContacts,
    reach: reach::Reach,
    islands: island::Islands,
    decisions: Vec<membership::Decision>,
    /// By assembly: whether all of it may go where its island goes.
    #[serde(skip)]
    ready_assemblies: Vec<bool>,
    /// How many substeps regions take.
    pub pace: auto::Pace,
    /// By rank of the other region: how far copies disagreed in the last exchange, m/s; none where nothing is shared.
    disagreement: Vec<Option<auto::Disagreement>>,
    /// Bodies that must be looked at once, asleep or not, since the border or another region's bodies have come to them.
    overlooked: Vec<RigidBodyHandle>,
    /// Bodies that became the region's own in the exchange under way.
    arrived: Vec<BodyRef>,
    /// Scratch, kept for its memory.
    #[serde(skip)]
    looked_at: Vec<RigidBodyHandle>,
    #[serde(skip)]
    changes: Vec<halo::HolderChange>,
}

impl Border {
    /// For a world of so many regions that take so many substeps a tick at first.
    fn new(regions: usize, steps: usize) -> Self {
        Self {
            predicted: predicted_contacts::PredictedContacts::new(regions),
            pace: auto::Pace::new(regions, steps),
            disagreement: vec![None; regions],
            ..Self::default()
        }
    }

    /// Ranks have changed.
    fn remap_ranks(&mut self, region: &Region, ranks: &RankRemap) {
        self.shared.remap_ranks(region, ranks);
        self.predicted.remap_ranks(ranks);
        self.pace.remap_ranks(ranks);
        self.islands.remap_ranks(ranks);
        ranks.list(&mut self.disagreement, || None);
        self.decisions.clear();
    }

    /// Whether a body here is about to meet another region's.
    fn awaits_any(&self) -> bool {
        !self.predicted.meetings.is_empty()
    }

    /// These bodies must be looked at in the next exchange, asleep or not.
    pub(super) fn overlook(&mut self, bodies: Vec<RigidBodyHandle>) {
        self.overlooked = bodies;
    }

    /// Those of them that are still here.
    fn take_overlooked(&mut self, region: &Region) -> Vec<RigidBodyHandle> {
        let mut handles = std::mem::take(&mut self.overlooked);
        handles
            .retain(|&handle| region.role_of(handle).is_some() && region.physics().bodies.contains(handle));
        handles
    }

    /// A body has become the region's own.
    pub(super) fn note_arrival(&mut self, link: BodyRef) {
        self.arrived.push(link);
    }

    /// Bodies that became the region's own since this was asked last.
    pub(super) fn take_arrived(&mut self) -> Vec<BodyRef> {
        std::mem::take(&mut self.arrived)
    }
}

/// Which exchange of which tick is being prepared.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub partition: &'a Partition,
    pub settings: &'a StepSettings,
    pub tick: Tick,
    /// Of this region's substeps.
    pub dt_s: f32,
    /// The rounds of the tick, and which of them this is, from 1.
    pub rounds: usize,
    pub round: usize,
    /// Whether it is the last exchange of the tick: who holds and owns what changes only then.
    pub last: bool,
}

impl<'a> Moment<'a> {
    /// Round 0 is the exchange before a tick in which new bodies are announced.
    pub(super) fn new(
        partition: &'a Partition,
        settings: &'a StepSettings,
        tick: Tick,
        rounds: usize,
        round: usize,
    ) -> Self {
        let last = round == 0 || round >= rounds;
        Self { partition, settings, tick, dt_s: settings.dt_s, rounds, round, last }
    }

    /// The region of a body's centre; the present one until the centre has left it for good.
    fn home_of(&self, region: &Region, handle: RigidBodyHandle) -> usize {
        let centre = region.centre_of(handle);
        if region.cell().excess_m(centre) > OWNER_HYSTERESIS_M {
            self.partition.rank_at(centre)
        } else {
            region.rank()
        }
    }

    /// Whether what happens so many times a tick happens in this round.
    pub(super) fn is_due(&self, times: usize) -> bool {
        self.round.is_multiple_of((self.rounds / times.clamp(1, self.rounds)).max(1))
    }
}

/// What every region of a process may look things up in.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub partition: &'a Partition,
    pub shapes: &'a ShapeLibrary,
    pub statics: &'a Statics,
}
