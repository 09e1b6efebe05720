//! Couples regions across their borders: keeps the copies of one body in several regions consistent, by
//! messages after each substep.
//!
//! Before each substep a region *prepares* the bodies that it shares. After the substep every region
//! *gathers* one [`BorderMessage`] per neighbour, and then *applies* its neighbours' messages in rank order.
//! Values go in and come out; this module does not know what carries them (memory, a simulator, QUIC).
//!
//! There are two families of couplings:
//!
//! - `owner` and `proxy` hold copies of all that comes near a border (`halo`). The owner's state is
//!   authoritative.
//! - `overlap`, `island` and `auto` hold copies of what touches (`predicted_contacts`, `reach`, `ownership`).
//!   The bodies of islands that may be in one region (`island`) have whole copies. These follow one region
//!   (`leader`), and are told of impulses that this region does not see (`strike`). The mass of all other
//!   bodies is split among their copies (`region::mass_splitting`), which follow their mean (`consensus`).

mod articulated;
mod auto;
mod consensus;
mod ghosts;
mod halo;
mod island;
mod late;
mod launch;
mod leader;
mod neighbours;
mod overlap;
mod owner;
mod ownership;
mod predicted_contacts;
mod proxy;
mod reach;
mod replay;
mod shared;
mod strike;
mod sweep;

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::{RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

pub(super) use self::neighbours::meet_in;
use self::neighbours::{Neighbours, held_with};
pub(super) use self::predicted_contacts::swept_bounds;
use self::shared::SharedBodies;
use super::outbox::Outbox;
use super::partition::{OWNER_HYSTERESIS_M, Partition};
use super::rank_remap::RankRemap;
use super::region::{BodyRef, Region};
use super::settings::{Coupling, StepSettings};
use super::shapes::{ShapeError, ShapeLibrary};
use super::spread::Team;
use super::statics::Statics;
use crate::fidelity::iterations;
use crate::protocol::BorderMessage;
use crate::space::{BodyId, RegionId, RegionSet, Tick};

/// The number of silent ticks after which a region that holds bodies with others rests. No decision on such
/// bodies ([`ownership`]) is put off for that long.
const SILENT_TICKS: u32 = 150;

/// A region with the state of its borders and the messages to its neighbours.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Side {
    pub region: Region,
    pub border: Border,
    pub outbox: Outbox,
    pub clock: Clock,
}

impl Side {
    /// Makes the side of a region in a world of the regions `leaves`, which take `steps` substeps per tick at
    /// first.
    pub(super) fn new(region: Region, leaves: &std::sync::Arc<[RegionId]>, steps: usize) -> Self {
        let outbox = Outbox::new(region.id(), leaves.clone());
        Self { region, border: Border::new(leaves.len(), steps), outbox, clock: Clock::default() }
    }

    /// Returns the number of substeps of the present tick.
    pub(super) fn steps(&self) -> usize {
        self.border.pace.steps_of(self.region.rank())
    }

    /// Returns the number of substeps of the next tick.
    pub(super) fn steps_next(&self) -> usize {
        self.border.pace.next_of(self.region.rank())
    }

    /// Returns the length in seconds of the region's substeps in the present tick; a tick of the world is
    /// `tick_s` seconds long.
    pub(super) fn substep_s(&self, tick_s: f32) -> f32 {
        tick_s * f32::from(self.clock.span) / self.steps() as f32
    }

    /// Returns whether the region is stepped in the present tick.
    pub(super) fn steps_now(&self) -> bool {
        self.clock.span > 0 && !self.region.rests()
    }

    /// Returns whether the region stays behind in the present tick.
    pub(super) fn is_behind(&self) -> bool {
        self.clock.span == 0
    }

    /// Returns whether nothing here can change in the tick to come.
    pub(super) fn is_idle(&self) -> bool {
        let Self { region, border, .. } = self;
        let is_settled = region.held_elsewhere_count() == 0 || border.silent_ticks == SILENT_TICKS;
        let is_settled = is_settled && border.left_behind.is_empty();
        region.is_idle() && is_settled && !border.awaits_any() && border.pace.is_settled(region.rank())
    }

    /// Counts a tick in which nothing has changed here and nothing was sent, or ends the count.
    fn count_silence(&mut self) {
        let Self { region, border, outbox, .. } = self;
        let says_nothing = border.decisions.is_empty() && outbox.letters().next().is_none();
        let is_silent = region.is_idle() && says_nothing && border.pace.has_rested();
        border.silent_ticks = if is_silent { SILENT_TICKS.min(border.silent_ticks + 1) } else { 0 };
    }

    /// Translates all ranks kept here, after ranks have changed.
    pub(super) fn remap_ranks(&mut self, ranks: &RankRemap) {
        self.region.remap_ranks(ranks);
        self.border.remap_ranks(&self.region, ranks);
        self.outbox = Outbox::new(self.region.id(), ranks.leaves.clone());
    }

    /// Begins a tick, in which all regions meet or only neighbours exchange messages, and the regions
    /// `behind` stay behind.
    pub(super) fn meet(&mut self, regions: usize, all: bool, behind: RegionSet) {
        let Self { region, border, clock, .. } = self;
        let acquainted = border.predicted.acquainted();
        border.neighbours.begin(region, acquainted, regions, all);
        border.neighbours.leave_behind(behind, clock.span > 0);
    }

    /// Returns the regions with which this one exchanges messages in a round. In the last round of a tick
    /// these are all neighbours; before that, those with which an exchange is due by the substeps of both,
    /// and new ones.
    pub(super) fn exchanges_with(&self, moment: &Moment<'_>) -> RegionSet {
        if moment.last {
            return self.border.neighbours.now();
        }
        let own = RegionSet::only(self.region.rank());
        let pace = &self.border.pace;
        self.border
            .neighbours
            .in_round(|rank| moment.is_due(pace.exchanges_among(own.union(RegionSet::only(rank)))))
    }

    /// Carries what a message of an earlier tick says forward to the present one. Returns the bodies that are handed over
    /// as they are here, each with the tick since which it has gone on so. Those in `as_told` are not.
    pub(super) fn carry_forward(
        &mut self,
        message: &mut BorderMessage,
        now: Tick,
        dt_s: f32,
        as_told: &BTreeSet<BodyId>,
    ) -> BTreeMap<BodyId, Tick> {
        self.border.late.carry_forward(&self.region, message, now, dt_s, as_told)
    }

    /// Returns the regions that must be at the same time as this one: those with which it shares bodies, or
    /// is about to.
    pub(super) fn bound_to(&self) -> RegionSet {
        let Border { neighbours, predicted, .. } = &self.border;
        held_with(&self.region).union(predicted.met_with()).union(neighbours.missed())
    }

    /// Returns whether bodies inserted here are to be announced as soon as the region is at the same time as
    /// others.
    pub(super) fn is_awaited(&self) -> bool {
        self.region.fresh().next().is_some() && !self.border.neighbours.missed().is_empty()
    }

    /// Takes in what other regions tell of bodies near this one, in a tick in which it stays behind.
    pub(super) fn hear<'a>(&mut self, inbox: impl Iterator<Item = &'a BorderMessage>, ground: Ground<'_>) {
        let Self { region, border, .. } = self;
        for message in inbox {
            let sender = ground.rank_of(message);
            predicted_contacts::see(region, border, sender, message);
            border.pace.hear(sender, message.steps);
            if message.asks {
                border.neighbours.hear(sender);
            }
        }
        border.predicted.meet();
        border.pace.turn();
    }

    /// Takes in what other regions tell in a tick in which this one rests, if that is only how far their bodies
    /// reach elsewhere. Returns whether nothing here lies where they have newly come to reach; otherwise this region
    /// must act on what they tell.
    pub(super) fn overhears<'a>(
        &mut self,
        inbox: impl Iterator<Item = &'a BorderMessage> + Clone,
        ground: Ground<'_>,
    ) -> bool {
        let Self { region, border, .. } = self;
        let is_elsewhere = |message: &BorderMessage| {
            border.predicted.reaches_elsewhere(region, ground.rank_of(message), message)
        };
        if !inbox.clone().all(is_elsewhere) {
            return false;
        }
        for message in inbox {
            predicted_contacts::see(region, border, ground.rank_of(message), message);
        }
        border.overlooked.is_empty()
    }

    /// Forgets which regions hold what, after membership has changed: all that is shared must be announced again.
    pub(super) fn forget_holders(&mut self, regions: usize, steps: usize) {
        self.region.forget_holders();
        self.border = Border::new(regions, steps);
    }
}

/// The position of a region in time. A region that is stepped at a lower rate is behind the present by the
/// ticks that it owes, and catches up in one step.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Clock {
    /// The ticks per step, unless a region with which it shares bodies is stepped more often.
    pub rate: u8,
    /// Ticks that it owes.
    pub owed: u8,
    /// The ticks that it computes in the present tick: 0 where it stays behind.
    pub span: u8,
}

impl Clock {
    /// Returns the solver iterations of its step; `per_tick` are those of one tick.
    pub(super) fn iterations(self, per_tick: usize) -> usize {
        iterations(per_tick, self.span)
    }
}

impl Default for Clock {
    fn default() -> Self {
        Self { rate: 1, owed: 0, span: 1 }
    }
}

impl Coupling {
    /// Marks for announcement the bodies that their user has sped up since the last step and that neighbours
    /// must hold. Returns whether all regions must meet for their sake.
    pub(super) fn expect(self, side: &mut Side, moment: Moment<'_>) -> bool {
        self.shares_mass() && launch::expect(side, moment)
    }

    /// Begins a tick, after everything that was to be announced has been.
    pub(super) fn begin(self, side: &mut Side, moment: Moment<'_>) {
        match self.shares_mass() && moment.partition.len() > 1 {
            true => launch::hold(side, moment),
            false => drop((side.region.take_launched(), side.region.take_appeared())),
        }
    }

    /// Notes what sleeps far outside its region's cell, and what regions in `emptied`, which are being emptied,
    /// hold, for the exchanges to come.
    pub(super) fn move_left_behind(self, side: &mut Side, emptied: RegionSet) {
        let Side { region, border, .. } = side;
        let left_behind = region.left_behind(emptied.contains(region.rank()));
        let is_held_there =
            |link: &BodyRef| !region.slot(link.handle).holders.intersection(emptied).is_empty();
        let holds_there = !emptied.is_empty() && region.held_elsewhere().any(|link| is_held_there(&link));
        if left_behind.is_empty() && !holds_there {
            return;
        }
        match self.shares_mass() {
            true => border.left_behind.extend(left_behind),
            false => border.overlooked.extend(region.own_resting()),
        }
        region.forget_leaders(emptied);
        border.silent_ticks = 0;
        region.stir();
    }

    /// Fills the outbox with the bodies inserted since the last step that neighbours must hold.
    pub(super) fn announce(self, side: &mut Side, moment: Moment<'_>) {
        if self.shares_mass() {
            ownership::announce(side, moment);
        } else {
            halo::announce(side, moment.partition, moment.tick, moment.dt_s);
        }
    }

    /// Prepares the shared bodies for a substep of the region.
    pub(super) fn prepare(self, region: &mut Region, dt_s: f32) {
        if self.shares_mass() {
            for place in 0..region.held_elsewhere_count() {
                region.prepare_copy(region.held_elsewhere_at(place).handle, dt_s);
            }
        }
    }

    /// Fills the outbox after a substep.
    pub(super) fn gather(self, side: &mut Side, moment: Moment<'_>) {
        if moment.last && self.shares_mass() {
            launch::release(side);
        }
        if moment.partition.len() == 1 {
            side.region.take_fresh();
        } else if self.shares_mass() {
            overlap::gather(side, moment);
        } else {
            owner::gather(side, moment.partition, moment.tick, moment.dt_s);
        }
        if moment.last {
            side.border.neighbours.ask(side.region.rank(), &mut side.outbox);
            side.count_silence();
        }
    }

    /// Applies the messages of the neighbours, in rank order.
    pub(super) fn apply<'a>(
        self,
        side: &mut Side,
        inbox: impl Iterator<Item = &'a BorderMessage> + Clone,
        ground: Ground<'_>,
        moment: Moment<'_>,
    ) -> Result<(), ShapeError> {
        for message in inbox.clone().filter(|message| message.gone) {
            side.border.shared.forget_region(ground.rank_of(message));
        }
        let inbox = inbox.filter(|message| !message.gone);
        for message in inbox.clone() {
            side.border.silent_ticks = 0;
            if message.asks {
                side.border.neighbours.hear(ground.rank_of(message));
            }
        }
        match self {
            Self::Owner => owner::apply(side, inbox, ground),
            Self::Proxy => proxy::apply(side, inbox, ground),
            Self::Overlap | Self::Island | Self::Auto => overlap::apply(side, inbox, ground, moment),
        }
    }
}

/// The state that a region keeps for its borders from one exchange to the next.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Border {
    /// The copies of each body that other regions hold too.
    shared: SharedBodies,
    predicted: predicted_contacts::PredictedContacts,
    reach: reach::Reach,
    islands: island::Islands,
    decisions: Vec<ownership::Decision>,
    /// The bodies owned here whose mass is to be split because of what they are about to touch, in order of
    /// handle.
    #[serde(skip)]
    splitting: Vec<RigidBodyHandle>,
    /// The bodies owned here that are to move to another region but are about to touch a body that stays, in
    /// order of handle.
    #[serde(skip)]
    parting: Vec<RigidBodyHandle>,
    /// Says for each assembly whether all of it may move to where its island moves.
    #[serde(skip)]
    ready_assemblies: Vec<bool>,
    /// The numbers of substeps that regions take.
    pub pace: auto::Pace,
    pub neighbours: Neighbours,
    /// The number of ticks in a row, up to [`SILENT_TICKS`], in which everything here slept and nothing was
    /// sent, received or decided.
    silent_ticks: u32,
    /// The disagreement of copies in the last exchange, by rank of the other region, m/s; `None` where
    /// nothing is shared.
    disagreement: Vec<Option<auto::Disagreement>>,
    late: late::Late,
    /// Bodies to be checked once, asleep or not, because the border or another region's bodies have come to them.
    overlooked: Vec<RigidBodyHandle>,
    /// Bodies that sleep where they should not, and are to be handed over asleep.
    left_behind: Vec<RigidBodyHandle>,
    /// Bodies that are held in place in this tick, with the velocities that they get back: see
    /// [`launch::hold`].
    #[serde(skip)]
    held_back: Vec<(RigidBodyHandle, Vector)>,
    /// Bodies that became the region's own in the exchange under way.
    arrived: Vec<BodyRef>,
    #[serde(skip)]
    leaders: leader::Leaders,
    /// Scratch, kept for its memory.
    #[serde(skip)]
    looked_at: Vec<RigidBodyHandle>,
    #[serde(skip)]
    changes: Vec<halo::HolderChange>,
}

impl Border {
    /// Makes the borders of a region in a world of so many regions, which take `steps` substeps per tick at
    /// first.
    fn new(regions: usize, steps: usize) -> Self {
        Self {
            predicted: predicted_contacts::PredictedContacts::new(regions),
            pace: auto::Pace::new(regions, steps),
            disagreement: vec![None; regions],
            ..Self::default()
        }
    }

    /// Completes a restore from a snapshot.
    pub(super) fn resume(&mut self) {
        self.islands.resume();
    }

    /// Translates all ranks kept here, after ranks have changed.
    fn remap_ranks(&mut self, region: &Region, ranks: &RankRemap) {
        self.shared.remap_ranks(region, ranks);
        self.predicted.remap_ranks(ranks);
        self.neighbours.remap_ranks(ranks);
        self.pace.remap_ranks(ranks);
        self.islands.remap_ranks(ranks);
        ranks.list(&mut self.disagreement, || None);
        self.decisions.clear();
    }

    /// Returns whether a contact between a body here and a body of another region is predicted.
    fn awaits_any(&self) -> bool {
        !self.predicted.meetings.is_empty()
    }

    /// Notes bodies to be checked in the next exchange, asleep or not.
    pub(super) fn overlook(&mut self, bodies: Vec<RigidBodyHandle>) {
        self.overlooked = bodies;
    }

    /// Takes the bodies noted by [`Border::overlook`] that are still here.
    fn take_overlooked(&mut self, region: &Region) -> Vec<RigidBodyHandle> {
        let mut handles = std::mem::take(&mut self.overlooked);
        handles
            .retain(|&handle| region.role_of(handle).is_some() && region.physics().bodies.contains(handle));
        handles
    }

    /// Notes that a body has become the region's own.
    pub(super) fn note_arrival(&mut self, link: BodyRef) {
        self.arrived.push(link);
    }

    /// Takes the bodies that became the region's own since the last call.
    pub(super) fn take_arrived(&mut self) -> Vec<BodyRef> {
        std::mem::take(&mut self.arrived)
    }
}

/// The exchange and the tick that are being computed.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub partition: &'a Partition,
    pub settings: &'a StepSettings,
    pub tick: Tick,
    /// The length in seconds of this region's substep while it is stepped, of the tick in an exchange.
    pub dt_s: f32,
    /// The number of rounds of the tick, and which of them this is, from 1.
    pub rounds: usize,
    pub round: usize,
    /// Says whether it is the last exchange of the tick: holders and owners of bodies change only then.
    pub last: bool,
    /// The most ticks that any region may compute in one step of the next tick.
    pub coarsest: u8,
    /// The threads that look at the bodies of the region.
    pub team: Team,
}

impl<'a> Moment<'a> {
    /// Makes the moment of a round. Round 0 is the exchange before a tick, in which new bodies are announced.
    pub(super) fn new(
        partition: &'a Partition,
        settings: &'a StepSettings,
        tick: Tick,
        rounds: usize,
        round: usize,
        coarsest: u8,
    ) -> Self {
        let last = round == 0 || round >= rounds;
        let (dt_s, team) = (settings.dt_s, Team::ALONE);
        Self { partition, settings, tick, dt_s, rounds, round, last, coarsest, team }
    }

    /// Returns the rank of the region that a body's centre lies in, or of the present region until the centre
    /// has left that by the hysteresis.
    fn home_of(&self, region: &Region, handle: RigidBodyHandle) -> usize {
        let centre = region.centre_of(handle);
        if region.cell().excess_m(centre) > OWNER_HYSTERESIS_M {
            self.partition.rank_at(centre)
        } else {
            region.rank()
        }
    }

    /// Returns whether something that happens `times` times per tick happens in this round.
    pub(super) fn is_due(&self, times: usize) -> bool {
        self.round.is_multiple_of((self.rounds / times.clamp(1, self.rounds)).max(1))
    }
}

/// The tables that all regions of a process share: partition, shapes and immovable bodies.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub partition: &'a Partition,
    pub shapes: &'a ShapeLibrary,
    pub statics: &'a Statics,
}

impl Ground<'_> {
    /// Returns the rank of a message's sender.
    fn rank_of(&self, message: &BorderMessage) -> usize {
        self.partition.rank_of(message.from).expect("messages come from regions of this tree")
    }
}

/// Returns this thread's counts up to now: of looks at what another region's bodies reach, at all borders of
/// a region, and at all cells for those near one.
#[cfg(test)]
pub(super) fn looks() -> [usize; 3] {
    [predicted_contacts::LOOKS.get(), auto::WALKS.get(), neighbours::SETTLED.get()]
}

#[cfg(test)]
impl Side {
    /// Ends the count of silent ticks, so that what the region shares keeps it from resting for long.
    pub(super) fn end_silence(&mut self) {
        self.border.silent_ticks = 0;
    }

    /// Returns whether what the region remembers of its borders equals what it would find there.
    pub(super) fn remembers_right(&self) -> bool {
        let [mut known, mut found] = [self.border.clone(), self.border.clone()];
        found.predicted.forget();
        found.pace.forget();
        let rank = self.region.rank();
        known.predicted.acquainted() == found.predicted.acquainted()
            && known.pace.is_settled(rank) == found.pace.is_settled(rank)
    }
}
