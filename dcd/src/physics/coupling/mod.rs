//! How regions that hold the same body agree on it: the one place where regions meet.
//!
//! Before each (micro-)step a region *prepares* what it shares; after it, every region *gathers* what it has to say into
//! one [`BorderMessage`] a neighbour, and then *applies* the messages of its neighbours in rank order. Values go in and
//! come out; who carries them (memory, a simulator, QUIC) is not known here.
//!
//! Two families: `owner` and `proxy` hold copies of all that comes near a border (`halo`) and let the owner's word
//! stand. `overlap`, `island` and `auto` hold copies of what touches (`sight`, `reach`, `membership`): of islands that may be in
//! one region (`island`) whole ones, of which the best informed region's count; of others each has its share of the mass
//! (`share`), and their means count (`agree`).

mod agree;
mod auto;
mod halo;
mod held;
mod island;
mod membership;
mod overlap;
mod owner;
mod proxy;
mod reach;
mod share;
mod sight;

pub(super) use halo::Change;
use serde::{Deserialize, Serialize};
pub(super) use share::{Shared, make_whole, whole, whole_colliders};

use super::host::StepSettings;
use super::partition::Partition;
use super::region::Region;
use super::renumber::Renumbering;
use super::shapes::ShapeLibrary;
use super::statics::Statics;
use crate::protocol::BorderMessage;
use crate::space::Tick;

/// The methods, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Coupling {
    /// Replicas are kinematic ghosts that push and are not pushed. What most projects do; it gains energy and drops
    /// stacks. The baseline that the other methods are compared with.
    Proxy,
    /// Replicas are dynamic copies, overwritten by their owner after each step. Cheap and tolerant of delay; it does not
    /// conserve momentum across a border.
    Owner,
    /// Bodies within some contact hops of a border live in both regions, each copy with its share of the mass; regions
    /// agree on means and even out what presses on the edges of the overlap.
    Overlap,
    /// What meets across a border is solved by both regions with whole copies, and the word of the one that sees most of it stands;
    /// what stays in touch moves whole to one region, where it is computed exactly. Islands above the limit as by `overlap`.
    Island,
    /// As `island`, with the exchanges of each border at which an island is split chosen by how far its copies disagree.
    #[default]
    Auto,
}

impl Coupling {
    /// All methods.
    pub const ALL: [Self; 5] = [Self::Proxy, Self::Owner, Self::Overlap, Self::Island, Self::Auto];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Proxy => "proxy",
            Self::Owner => "owner",
            Self::Overlap => "overlap",
            Self::Island => "island",
            Self::Auto => "auto",
        }
    }

    /// Exchanges a tick that suit it; of `auto`, the most it may take.
    pub const fn usual_exchanges(self) -> usize {
        match self {
            Self::Proxy | Self::Owner => 1,
            Self::Overlap | Self::Island => 2,
            Self::Auto => 4,
        }
    }

    /// Whether regions agree on means of copies that share a body's mass.
    pub(super) const fn shares_mass(self) -> bool {
        matches!(self, Self::Overlap | Self::Island | Self::Auto)
    }

    /// Whether small islands move whole to one region.
    pub(super) const fn moves_islands(self) -> bool {
        matches!(self, Self::Island | Self::Auto)
    }

    /// Micro-steps a tick at first, of which `exchanges` is the setting.
    pub(super) const fn first_steps(self, exchanges: usize) -> usize {
        match self {
            Self::Auto => 1,
            _ => exchanges,
        }
    }

    /// Fills `region.outbox` with what neighbours must hold of the bodies inserted since the last step.
    pub(super) fn announce(self, region: &mut Region, moment: Moment<'_>) {
        if self.shares_mass() {
            membership::announce(region, moment);
        } else {
            halo::announce(region, moment.partition, moment.tick, moment.dt_s);
        }
    }

    /// Before a step of the region.
    pub(super) fn prepare(self, region: &mut Region, dt_s: f32) {
        if self.shares_mass() {
            share::prepare(region, dt_s);
        }
    }

    /// Fills `region.outbox` after a step.
    pub(super) fn gather(self, region: &mut Region, moment: Moment<'_>) {
        if moment.partition.len() == 1 {
            region.fresh.clear();
        } else if self.shares_mass() {
            overlap::gather(region, moment);
        } else {
            owner::gather(region, moment.partition, moment.tick, moment.dt_s);
        }
    }

    /// Takes in what the neighbours said, in rank order.
    pub(super) fn apply<'a>(
        self,
        region: &mut Region,
        inbox: impl Iterator<Item = &'a BorderMessage> + Clone,
        ground: Ground<'_>,
        moment: Moment<'_>,
    ) -> Result<(), super::ShapeError> {
        match self {
            Self::Owner => owner::apply(region, inbox, ground),
            Self::Proxy => proxy::apply(region, inbox, ground),
            Self::Overlap | Self::Island | Self::Auto => overlap::apply(region, inbox, ground, moment),
        }
    }
}

/// What a region keeps for its borders from one exchange to the next.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Border {
    sights: sight::Sights,
    reach: reach::Reach,
    islands: island::Islands,
    decisions: Vec<membership::Decision>,
    /// By assembly: whether all of it may go where its island goes.
    #[serde(skip)]
    ready_assemblies: Vec<bool>,
    /// How many micro-steps regions take.
    pub pace: auto::Pace,
    /// By rank of the other region: how far copies disagreed in the last exchange, m/s; none where nothing is shared.
    disagreement: Vec<Option<f32>>,
}

impl Border {
    /// For a world of so many regions that take so many micro-steps a tick at first.
    pub(super) fn new(regions: usize, steps: usize) -> Self {
        Self {
            sights: sight::Sights::new(regions),
            pace: auto::Pace::new(regions, steps),
            disagreement: vec![None; regions],
            ..Self::default()
        }
    }
}

impl Border {
    /// Ranks have changed.
    pub(super) fn renumber(&mut self, ranks: &Renumbering) {
        self.sights.renumber(ranks);
        self.pace.renumber(ranks);
        self.islands.renumber(ranks);
        ranks.list(&mut self.disagreement, || None);
        self.decisions.clear();
    }

    /// Whether a body here is about to meet another region's.
    pub(super) fn awaits_any(&self) -> bool {
        !self.sights.meetings.is_empty()
    }
}

/// Which exchange of which tick is being prepared.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub partition: &'a Partition,
    pub settings: &'a StepSettings,
    pub tick: Tick,
    /// Of this region's micro-steps.
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
