//! Keeps border messages until their round is reached, and checks what members say in them.

use super::{Exchange, Node, Phase};
use crate::protocol::{Border, BorderMessage, Placed, ViewNumber, WorldOp};
use crate::space::{Allocation, NodeId, Tick};

/// Returns whether one member may say this to another, by who computes which region and by the newest view in
/// which bodies were placed.
pub(super) fn can_be_said(
    allocation: &Allocation,
    newest_view: u64,
    (from, to): (NodeId, NodeId),
    message: &BorderMessage,
) -> bool {
    let computes = |region, node| allocation.get(&region) == Some(&node);
    let is_possible = || message.epochs().all(|epoch| epoch.is_possible(newest_view, message.tick));
    !message.gone
        && computes(message.from, from)
        && computes(message.to, to)
        && (from == to || message.names_only(allocation.len()) && is_possible())
}

/// Returns what a member tells its own regions of the regions of a member that was lost before it told anything in
/// this exchange.
pub(super) fn gone(
    allocation: &Allocation,
    (lost, member): (NodeId, NodeId),
    tick: Tick,
) -> impl Iterator<Item = BorderMessage> {
    let of = |node| allocation.iter().filter(move |&(_, of)| *of == node).map(|(&region, _)| region);
    of(lost).flat_map(move |from| {
        of(member).map(move |to| BorderMessage { from, to, tick, gone: true, ..BorderMessage::default() })
    })
}

/// The number of early border messages kept from one member beside those of the ticks that members may be
/// apart.
pub(super) const EARLY_BORDERS: usize = 4;

impl Node {
    /// Keeps a border message until its round is reached here. Old ones are dropped.
    pub(super) fn keep_early(&mut self, from: NodeId, border: Border) {
        let next_round = match self.phase {
            Phase::Resting => (self.tick.next(), 0),
            Phase::Computing(tick, round) | Phase::Exchanging(Exchange { tick, round, .. }) => (tick, round),
        };
        let due = match self.heard_after(next_round.0) {
            Some(tick) => (self.number(), tick, if self.lag() == 0 { next_round.1 } else { 0 }),
            None => (self.number(), Tick(0), 0),
        };
        let bound = EARLY_BORDERS + 2 * self.lag() as usize;
        let queue = self.early.entry(from).or_default();
        let key = |border: &Border| (border.view, border.tick, border.round);
        if key(&border) < due {
            self.counters.stale += 1;
            return;
        }
        queue.retain(|kept| key(kept) >= due);
        if queue.iter().any(|kept| key(kept) == key(&border)) {
            return;
        }
        queue.push_back(border);
        if queue.len() > bound {
            queue.pop_front();
            self.counters.overflow += 1;
        }
    }

    /// Returns whether a member may say this. The message must go from a region of its own to one of ours. If
    /// the member is another node, the message must also name only regions that exist, and bodies at possible
    /// epochs: nobody else would believe an owner at any other epoch.
    pub(super) fn can_be(&self, from: NodeId, message: &BorderMessage) -> bool {
        let allocation = self.view.as_ref().map(|view| &view.allocation);
        allocation.is_some_and(|own| can_be_said(own, self.newest_view, (from, self.config.id), message))
    }

    /// Notes the views in which the bodies were placed with which a view begins. An avatar that has returned
    /// meanwhile was placed in the newest view of all groups.
    pub(super) fn begin_epochs(&mut self, view: ViewNumber, placed: &[Placed]) {
        let newest = placed.iter().map(|placed| placed.body.epoch.view()).fold(view.0, u64::max);
        self.newest_view = newest;
        if let Some(leader) = &mut self.leader {
            leader.knows_view(newest);
        }
    }

    /// Notes the views in which the bodies were placed that come in a tick.
    pub(super) fn learn_epochs(&mut self, ops: &[WorldOp]) {
        let come = ops.iter().flat_map(|op| match op {
            WorldOp::Insert { bodies, .. } => &bodies[..],
            _ => &[],
        });
        self.newest_view = come.map(|body| body.epoch.view()).fold(self.newest_view, u64::max);
    }
}
