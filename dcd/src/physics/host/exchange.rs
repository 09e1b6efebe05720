//! Exchanges the messages of regions after a substep: among the regions here, and with those computed
//! elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

use super::{HostError, RegionHost, threads};
use crate::physics::coupling::{Ground, Moment, Side};
use crate::physics::outbox::Outbox;
use crate::physics::owner_index::Home;
use crate::physics::region::Region;
use crate::protocol::{BorderMessage, Handover};
use crate::space::{BodyId, Tick};

impl RegionHost {
    /// Returns the messages of regions here to regions computed elsewhere, non-empty ones only.
    pub fn outgoing(&self) -> impl Iterator<Item = &BorderMessage> {
        let letters = self.sides.iter().flat_map(|side| side.outbox.letters());
        letters.filter(|(rank, _)| self.place_of[*rank].is_none()).map(|(_, message)| message)
    }

    /// Accepts a message of a region computed elsewhere. The next exchange applies it.
    pub fn accept(&mut self, message: BorderMessage) {
        self.incoming.push(message);
    }

    /// Accepts a message that was written after an earlier tick than `now`, the last one computed here. What it says of
    /// bodies is carried forward to that tick. Returns the bodies that are handed over as they are here, each with the tick
    /// since which all that was done to it here is in that. Those in `as_told` are taken as their owner told.
    pub fn accept_late(
        &mut self,
        message: BorderMessage,
        now: Tick,
        as_told: &BTreeSet<BodyId>,
    ) -> BTreeMap<BodyId, Tick> {
        let rank = self.partition.rank_of(message.to).expect("messages go to regions of this tree");
        let dt_s = self.settings.dt_s;
        let Some(place) = self.place_of[rank] else {
            self.accept(message);
            return BTreeMap::new();
        };
        let as_told = as_told.clone();
        let mut work = vec![(std::mem::take(&mut self.sides), message, BTreeMap::new())];
        // Rapier computes some of it again, which it shares out over no other threads than this host's.
        threads::alone(&mut work, move |work| {
            let (sides, message, as_here) = &mut work[0];
            *as_here = sides[place].carry_forward(message, now, dt_s, &as_told);
        });
        let (sides, message, as_here) = work.pop().expect("one was put in");
        self.sides = sides;
        self.accept(message);
        as_here
    }

    /// Applies the messages accepted so far, and sends none. No tick ends with it.
    pub fn drain(&mut self) -> Result<(), HostError> {
        let tick = self.tick;
        self.sides.iter_mut().for_each(|side| side.outbox.clear(tick));
        self.exchange()
    }

    /// Computes the second half of a round: every region applies the messages of the others, in rank order.
    pub fn exchange(&mut self) -> Result<(), HostError> {
        if self.is_busy() && self.trial.is_for_teams() {
            self.on_teams(Self::exchange_here)
        } else {
            self.exchange_here()
        }
    }

    pub(super) fn exchange_here(&mut self) -> Result<(), HostError> {
        let start = Instant::now();
        let exchanged = self.exchange_messages();
        self.exchange_time += start.elapsed();
        exchanged
    }

    fn exchange_messages(&mut self) -> Result<(), HostError> {
        if self.partition.len() > 1 {
            let outboxes: Vec<_> =
                self.sides.iter_mut().map(|side| std::mem::take(&mut side.outbox)).collect();
            let ground = Ground { partition: &self.partition, shapes: &self.shapes, statics: &self.statics };
            let (incoming, place_of, settings) = (&self.incoming, &self.place_of, self.settings);
            let coarsest = self.coarsest();
            let (tick, rounds, round) = (self.tick.next(), self.rounds, self.round);
            let moment = Moment::new(&self.partition, &settings, tick, rounds, round, coarsest);
            for (side, outbox) in self.sides.iter().zip(&outboxes) {
                let neighbours = side.exchanges_with(&moment);
                for (rank, letter) in outbox.letters() {
                    debug_assert!(neighbours.contains(rank), "to {rank}, of {neighbours:?}: {letter:?}");
                }
            }
            let failure = std::sync::Mutex::new(None);
            let mut inboxes = vec![Vec::new(); self.sides.len()];
            let here = outboxes.iter().flat_map(Outbox::letters);
            let elsewhere = incoming.iter().map(|message| {
                (ground.partition.rank_of(message.to).expect("messages go to regions of this tree"), message)
            });
            for (rank, message) in here.chain(elsewhere) {
                if let Some(place) = place_of[rank] {
                    inboxes[place].push(message);
                }
            }
            // Ids are in rank order. The sort is stable: what one region said in several ticks stays in
            // order.
            inboxes.iter_mut().for_each(|inbox| inbox.sort_by_key(|message| message.from));
            let inbox_of = |region: &Region| &inboxes[place_of[region.rank()].expect("hosted here")];
            let is_due = |side: &Side| {
                moment.is_due(side.steps()) && !(side.region.rests() && inbox_of(&side.region).is_empty())
            };
            let due = self.sides.iter_mut().filter(|side| is_due(side)).collect();
            self.threads.share_out(due, |side| {
                let inbox = inbox_of(&side.region);
                if side.is_behind() {
                    side.hear(inbox.iter().copied(), ground);
                    return;
                }
                if side.region.rests() && side.overhears(inbox.iter().copied(), ground) {
                    return;
                }
                if !inbox.is_empty() {
                    side.region.stir();
                }
                if let Err(error) = settings.coupling.apply(side, inbox.iter().copied(), ground, moment) {
                    failure.lock().expect("no panic while locked").get_or_insert(error);
                }
            });
            for (side, outbox) in self.sides.iter_mut().zip(outboxes) {
                side.outbox = outbox;
            }
            self.incoming.clear();
            self.note_arrivals();
            if let Some(error) = failure.into_inner().expect("no panic while locked") {
                return Err(error.into());
            }
        }
        Ok(())
    }

    pub(super) fn note_arrivals(&mut self) {
        for (_, message) in self.sides.iter().flat_map(|side| side.outbox.letters()) {
            for transfer in &message.transfers {
                self.owner_index.remove(transfer.body.id);
                self.handovers.push(Handover { body: transfer.body.id, from: message.from, to: message.to });
            }
        }
        for side in &mut self.sides {
            let rank = side.region.rank();
            // Each arrival is taken once: a region at rest does not look at its letters, and what arrived may
            // be gone by now.
            for link in side.border.take_arrived() {
                self.transfers += 1;
                self.owner_index.set(link.id, Home { rank, handle: link.handle });
            }
        }
    }
}
